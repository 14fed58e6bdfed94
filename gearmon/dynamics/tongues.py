"""Boundaries of the unstable tongues of Hill's equation.

The n-th tongue starts from w/w0 = 2/n. On its boundaries a vibration of period T (n even) or 2T
(n odd) neither grows nor dies out. Undamped, with y = sum_m y_m e^{i m w t} and integer or half-odd
m, these are the eigenvalues of a Hermitian problem,

    (w/w0)^2 m^2 y_m = y_m + eps sum_j f_{m-j} y_j,

two for each tongue, and they come to nearly machine precision. The damped tongue is found inside
the undamped one of w0^2 - h^2, whose growth e^{h t} outdoes there.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.stability import FourierShape, PiecewiseShape, excess
from gearmon.errors import ArgumentError, check_range

MOST_HARMONICS = 600
MOST_TONGUE = 200
#: A tongue whose excess stays below this is closed as far as rounding can tell.
CLOSED = 1e-13
PEAK_ROUNDS = 7
MOST_ROUNDS = 80


def tongue_edges(
    shape: FourierShape | PiecewiseShape,
    tongue: int,
    variations: npt.ArrayLike,
    damping_ratio: float = 0.0,
) -> Real:
    """Lower and upper w/w0 of an unstable tongue.

    Parameters
    ----------
    shape : FourierShape or PiecewiseShape
        f(t) of k0 [1 + eps f(t)].
    tongue : int
        n, 1 to 200: the tongue that starts from w/w0 = 2/n.
    variations : float array, shape (E,)
        eps; k(t) must stay > 0.
    damping_ratio : float
        zeta, 0 to below 1.

    Returns
    -------
    float ndarray, shape (E, 2)
        NaN where damping, or a coincidence, closes the tongue. Of an undamped Fourier shape both
        edges are given even if they coincide. Exact but for rounding: about 1e-14, or 1e-15
        divided by the tongue's width where it is narrow and not of that kind.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> low, high = tongue_edges(FourierShape([0.5]), 1, [0.1])[0]
    >>> float(round(low, 9)), float(round(high, 9))
    (1.949698438, 2.049678773)
    """
    check_range("tongue", tongue, 1, MOST_TONGUE)
    check_range("damping_ratio", damping_ratio, 0.0, 0.999)
    eps = np.atleast_1d(np.asarray(variations, dtype=np.float64))
    least = 1 + np.minimum(eps * shape.extremes[0], eps * shape.extremes[1])
    if eps.ndim != 1 or not (least > 0).all():
        raise ArgumentError(
            f"variations: one of them makes the stiffness {least.min():.4g} times its mean; "
            "it must stay > 0"
        )
    around = _around(shape, tongue, eps, damping_ratio)
    if isinstance(shape, FourierShape) and damping_ratio == 0:
        return around
    return _inside(shape, tongue, eps, damping_ratio, around)


def _undamped(shape: FourierShape | PiecewiseShape, tongue: int, eps: Real) -> Real:
    """Edges by the Hermitian eigenvalues, shape (E, 2)."""
    given = len(shape.harmonics) if isinstance(shape, FourierShape) else 6
    highest = min(MOST_HARMONICS, tongue + 2 * given + 24)
    f = shape.first_harmonics(2 * highest)
    matrices = _matrices(f, tongue, eps, highest)
    values = np.linalg.eigvalsh(matrices)[:, ::-1]
    first = 2 * ((tongue - 1) // 2)
    return np.asarray(np.sqrt(np.maximum(values[:, first : first + 2], 0.0))[:, ::-1])


def _matrices(f: Complex, tongue: int, eps: Real, highest: int) -> Complex | Real:
    """1/m (I + eps F) 1/j, without the static row, whose harmonic follows the others."""
    whole = np.arange(-highest, highest + 1)
    order = whole + 0.5 if tongue % 2 else whole.astype(np.float64)
    if tongue % 2:
        order = order[:-1]
    row = np.zeros(4 * highest + 1, dtype=complex)
    row[2 * highest + 1 : 2 * highest + 1 + len(f)] = f
    row[2 * highest - len(f) : 2 * highest] = f[::-1].conj()
    if np.abs(f.imag).max() <= 1e-15 * np.abs(f).max():
        row = row.real
    difference = np.subtract.outer(np.arange(len(order)), np.arange(len(order))) + 2 * highest
    matrix = eps[:, None, None] * row[difference] + np.eye(len(order))
    if tongue % 2 == 0:
        keep = order != 0
        static = matrix[:, keep][:, :, ~keep]
        matrix = matrix[:, keep][:, :, keep] - static @ static.conj().transpose(0, 2, 1)
        order = order[keep]
    return np.asarray(matrix / np.outer(order, order))


def is_open(
    shape: FourierShape | PiecewiseShape, tongue: int, variations: Real, damping_ratio: float
) -> npt.NDArray[np.bool_]:
    """Whether a tongue is open at each eps; arguments as of `tongue_edges`, unchecked."""
    around = _around(shape, tongue, variations, damping_ratio)
    return _opened(shape, tongue, variations, damping_ratio, around)[1]


def _around(shape: FourierShape | PiecewiseShape, tongue: int, eps: Real, zeta: float) -> Real:
    """Interval of w/w0 that holds the damped tongue, shape (E, 2)."""
    rest = 1 - zeta**2
    around = math.sqrt(rest) * _undamped(shape, tongue, eps / rest)
    if isinstance(shape, PiecewiseShape):
        # its series was cut; the neighbouring tongues lie far beyond this margin
        margin = 0.15 / tongue * around.mean(axis=1) / (tongue + 1)
        around = around + margin[:, None] * np.array([-1, 1])
    return around


def _opened(
    shape: FourierShape | PiecewiseShape, tongue: int, eps: Real, zeta: float, around: Real
) -> tuple[Real, npt.NDArray[np.bool_]]:
    """Where in the interval growth is largest, and whether there is any."""
    rows, side = np.arange(len(eps)), tongue % 2
    low, high = around.T
    for _ in range(PEAK_ROUNDS):
        x = np.linspace(low, high, 9, axis=1)
        values = excess(shape, 1 / x, eps[:, None], zeta)[side]
        best = np.argmax(values, axis=1)
        low, high = x[rows, np.maximum(best - 1, 0)], x[rows, np.minimum(best + 1, 8)]
    return x[rows, best], values[rows, best] > CLOSED


def _inside(
    shape: FourierShape | PiecewiseShape, tongue: int, eps: Real, zeta: float, around: Real
) -> Real:
    """Edges within an interval of w/w0 for each eps."""
    top, grows = _opened(shape, tongue, eps, zeta, around)
    edges = np.full((len(eps), 2), np.nan)
    for column in (0, 1):

        def value(x: Real) -> Real:
            return excess(shape, 1 / x, eps[grows], zeta)[tongue % 2]

        edges[grows, column] = roots(value, around[grows, column], top[grows])
    return edges


def roots(function: Callable[[Real], Real], outside: Real, inside: Real) -> Real:
    """Zeros between points where a function of arrays is <= 0 and where it is > 0.

    Chandrupatla's choice between bisection and inverse quadratic interpolation (Adv. Eng. Software
    28, 1997, 145), for all elements at once, down to rounding.
    """
    a, b, c = inside.copy(), outside.copy(), inside.copy()
    fa, fb = function(a), function(b)
    fc, share = fa.copy(), np.full(len(a), 0.5)
    for _ in range(MOST_ROUNDS):
        x = a + share * (b - a)
        f = function(x)
        same = (f > 0) == (fa > 0)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, f
        width = np.abs(b - a)
        if (width <= 4e-16 * np.abs(a)).all() or not len(a):
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            place, level = (a - b) / (c - b), (fa - fb) / (fc - fb)
            smooth = (1 - np.sqrt(1 - place) < level) & (level < np.sqrt(place))
            share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (
                fc - fb
            )
        least = np.minimum(0.5, 2e-16 * np.abs(a) / np.maximum(width, 1e-300))
        share = np.clip(np.where(smooth & np.isfinite(share), share, 0.5), least, 1 - least)
    return np.where(np.abs(fa) < np.abs(fb), a, b)
