"""Edges of the instability tongues n w = 2 w0 by multiple scales.

The amplitude equation of line p = n/2 (see `resonance`), in s = w0 t and centred on n w/2,

    A' = [-zeta + i (1 + a - n nu/2)] A + i B conj(A),    nu = w/w0

has real exponents -zeta +- sqrt(|B|^2 - (1 + a - n nu/2)^2), so that the edges of the tongue are at

    nu = (2/n) [1 + a +- sqrt(|B|^2 - zeta^2)]

and there is no tongue where |B| < zeta. Through second order, at nu = 2/n,

    a = -zeta^2/2 - sum_{j>=1} |c_j|^2/(4 - 4 j^2/n^2)  (of j = n only its upper state, |c_n|^2/16)
    B = c_n/2 + products c_j c_l with j + l = n

which for 1 + eps cos(w t) gives nu = 2 +- eps/2 - eps^2/32 (n = 1), and nu = 1 + eps^2/24 and
1 - 5 eps^2/24 (n = 2). Coefficients of higher orders depend on nu, and the edge is iterated.

Limits: an asymptotic series; order K errs by order K+1 of the variation as long as neighbouring
tongues stay apart (n max|phi| well below 1). `zeta` is c/(2 sqrt(k0 m)), the same at every speed.

Sources: Nayfeh and Mook, Nonlinear Oscillations, 1979, section 5.2; McLachlan, Theory and
Application of Mathieu Functions, 1947 (n = 1, 2 undamped).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.amplitude_equations import MOST_ORDERS
from gearmon.dynamics.fourier import Complex
from gearmon.dynamics.hill import frozen_vector
from gearmon.dynamics.slow_states import Coupling, reduce
from gearmon.errors import ArgumentError, check_positive, check_range

MOST_ITERATIONS = 60


def expanded_tongue(
    harmonics: npt.ArrayLike, number: int, zeta: float = 0.0, order: int = 2
) -> tuple[float, float] | None:
    """Lower and upper edge w/w0 of the n-th tongue, to some order of the variation.

    Parameters
    ----------
    harmonics : complex array, shape (J,)
        c_1..c_J of phi; eps cos(wt) has c_1 = eps/2.
    number : int
        n >= 1.
    zeta : float
        Damping ratio, 0 to 0.99; counted as order one.
    order : int
        K >= 1: highest order of the amplitude equation.

    Returns
    -------
    (float, float) or None
        Edges w/w0; None if damping leaves no tongue at this order.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or the edges of an order above two do not settle.

    Examples
    --------
    >>> low, high = expanded_tongue([0.1], 1)    # eps = 0.2
    >>> round(low, 5), round(high, 5), 2 - 0.1 - 0.04 / 32, 2 + 0.1 - 0.04 / 32
    (1.89875, 2.09875, 1.89875, 2.09875)
    >>> expanded_tongue([0.1], 1, zeta=0.051) is None    # eps < 4 zeta
    True
    """
    c = frozen_vector("harmonics", harmonics)
    check_range("number", number, 1, 10_000)
    check_range("order", order, 1, MOST_ORDERS)
    check_range("zeta", zeta, 0.0, 0.99)
    edges = [_edge(c, number, zeta, order, side) for side in (-1, 1)]
    low, high = edges
    return None if low is None or high is None else (min(low, high), max(low, high))


def _edge(c: Complex, number: int, zeta: float, order: int, side: int) -> float | None:
    centre = 2 / number
    found = _next_edge(c, number, zeta, order, centre, side)
    if order <= 2 or found is None:
        return found
    change = math.inf
    for _ in range(MOST_ITERATIONS):
        better = _next_edge(c, number, zeta, order, found, side)
        if better is None:
            return None
        change, found = abs(better - found), better
        if change <= 1e-14 * centre:
            return found
        if not 0.5 * centre < found < 2 * centre:
            break
    if change <= 1e-12 * centre:
        return found
    raise ArgumentError(
        f"number={number}: order {order} of multiple scales gives no edge at this variation of "
        "stiffness (the iteration does not settle); use order=2 or Floquet multipliers"
    )


def _next_edge(
    c: Complex, number: int, zeta: float, order: int, nu: float, side: int
) -> float | None:
    """Edge by the coefficients at w/w0 = nu."""
    shift, coupling, decay = tongue_coefficients(c, number, zeta, order, nu)
    square = abs(coupling) ** 2 - decay**2
    if square < 0:
        return None
    return (2 / number) * (1 + shift + side * math.sqrt(square))


def tongue_coefficients(
    harmonics: npt.ArrayLike, number: int, zeta: float, order: int, nu: float
) -> tuple[float, complex, float]:
    """Coefficients (a, i B, decay) of the amplitude equation at w/w0 = nu, in s = w0 t.

    Parameters
    ----------
    harmonics, number, zeta, order
        As in `expanded_tongue`.
    nu : float
        w/w0 > 0.
    """
    coupling = Coupling(
        ratio=1 / check_positive("nu", nu),
        zeta=zeta,
        harmonics=frozen_vector("harmonics", harmonics),
        small_damping=True,
    )
    rates = reduce(coupling, [(1, number / 2), (-1, -number / 2)], 0, order).rates[1:]
    total = np.asarray(rates.sum(axis=0))
    return float(total[0, 0].imag), complex(total[0, 1]), float(-total[0, 0].real)
