"""Multiple scales: the orders of the steady vibration, in closed form.

With the damping kept in the zeroth-order operator the free vibration dies out on the fast scale
and every order of the steady state is forced. Putting phi(t) = eps f(t) and z = z^(0) + eps z^(1)
+ ...,

    z^(k+1)'' + 2 zeta w0 z^(k+1)' + w0^2 z^(k+1) = -w0^2 f z^(k)
    Z^(0)_n = g_n/D_n,      Z^(k+1)_n = -(1/D_n) sum_m phi_{n-m} Z^(k)_m
    D_n = 1 - (n/R)^2 + 2 i zeta n/R

with eps absorbed in phi and g = (F, f_1, ...)/k0. So stiffness harmonic j makes, at first order,
line j of size |c_j| F/(k0 |D_j|); lines n = j + l follow at second order, and so on. The series
converges if max|phi| max 1/|D_n| < 1 and may converge or not beyond. Order k reaches harmonics
0..kJ, or is cut at `highest`.

The textbook form for vanishing damping (Nayfeh and Mook, Nonlinear Oscillations, 1979, chapter 5)
has h = zeta w0 = eps mu, so that damping acts one order later:

    Z^(k+1)_n = -(1/D_n) [sum_m phi_{n-m} Z^(k)_m + 2 i zeta (n/R) Z^(k)_n],   D_n = 1 - (n/R)^2

It is offered as `small_damping`. It diverges where 2 zeta n/R > |D_n|, that is near resonance,
where n w = w0 makes the right side secular: there use `resonance.forced_resonance`. The damping
ratio of meshes (0.03 to 0.3) is not small beside the variation of stiffness, which is why it is in
order zero by default. Transients are in `motion`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.certificate import Approximation, Certifier
from gearmon.dynamics.fourier import Complex, Modulation, Real, rms
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.substitution import Formula
from gearmon.errors import ArgumentError, check_range

MOST_ORDERS = 400
#: |D_n| that is rounding only
NO_STIFFNESS = 1e-13


@dataclass(frozen=True, kw_only=True)
class Expansion:
    """The orders of one steady state.

    Attributes
    ----------
    problem : HillProblem
        What was expanded.
    terms : complex ndarray, shape (order+1, N+1)
        Z^(k)_n [m] with the powers of the stiffness variation included; their sum approximates z_n.
    small_damping : bool
        Whether damping counts as order one.
    """

    problem: HillProblem
    terms: Complex
    small_damping: bool = False

    @property
    def order(self) -> int:
        """Highest order."""
        return len(self.terms) - 1

    @property
    def displacement(self) -> Complex:
        """Sum of all orders [m], shape (N+1,)."""
        total: Complex = self.terms.sum(axis=0)
        return total

    def scaled(self, factor: float) -> Complex:
        """Displacement [m] if the stiffness varied `factor` times as much: no new solve.

        Parameters
        ----------
        factor : float
            Multiplies every c_j, and c where damping is small; order k scales with its k-th power.
        """
        powers = factor ** np.arange(self.order + 1)
        total: Complex = powers @ self.terms
        return total

    @cached_property
    def formula(self) -> Formula:
        """The same orders and harmonics as a function of the parameters."""
        return Formula(
            problem=self.problem,
            order=self.order,
            highest=self.terms.shape[1] - 1,
            small_damping=self.small_damping,
        )

    def substitute(
        self,
        *,
        mass_kg: npt.ArrayLike | None = None,
        damping_ns_per_m: npt.ArrayLike | None = None,
        stiffness_n_per_m: npt.ArrayLike | None = None,
        period_s: npt.ArrayLike | None = None,
        force_n: npt.ArrayLike | None = None,
        variation: npt.ArrayLike = 1.0,
    ) -> Complex:
        """Displacement [m] for other parameter values, many at once: see `Formula.at`."""
        return self.formula.at(
            mass_kg=mass_kg,
            damping_ns_per_m=damping_ns_per_m,
            stiffness_n_per_m=stiffness_n_per_m,
            period_s=period_s,
            force_n=force_n,
            variation=variation,
        )

    def rows(self, most: int = 12) -> list[dict[str, float]]:
        """Lines by size: harmonic, frequency_hz and the amplitude 2|Z^(k)_n| [m] of every order.

        `terms.paths` tells which stiffness harmonics make them.

        Parameters
        ----------
        most : int
            Number of lines.
        """
        sizes = 2 * np.abs(self.displacement[1:])
        largest = np.argsort(-sizes)[:most] + 1
        return [
            {"harmonic": int(n), "frequency_hz": n / self.problem.period_s}
            | {f"order_{k}_m": float(2 * abs(term[n])) for k, term in enumerate(self.terms)}
            for n in largest
        ]


def expand(
    problem: HillProblem, order: int, highest: int | None = None, small_damping: bool = False
) -> Expansion:
    """Orders 0..`order` of the steady vibration.

    Parameters
    ----------
    problem : HillProblem
        What to expand.
    order : int
        Highest order, >= 0.
    highest : int, optional
        Highest harmonic kept, >= 1; by default every harmonic that these orders reach.
    small_damping : bool
        Damping of order one (h = eps mu) instead of zero.

    Raises
    ------
    ArgumentError
        If order or highest is out of its range, or if in the zeroth order a harmonic lies undamped
        on the natural frequency.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> first = expand(p, 1).terms[1]     # line 1: F/k0 * c_1 / |D_1|
    >>> bool(abs(abs(first[1]) - 5e-6 * 0.065 / abs(p.dynamic_stiffness(1)[1])) < 1e-18)
    True
    """
    check_range("order", order, 0, 10_000)
    if highest is None:
        forced = len(problem.force_harmonics_n)
        highest = max(1, forced + order * len(problem.stiffness_harmonics))
    check_range("highest", highest, 1, 10_000_000)
    stream = orders(problem, highest, small_damping)
    return Expansion(
        problem=problem,
        terms=np.array([next(stream) for _ in range(order + 1)]),
        small_damping=small_damping,
    )


def orders(problem: HillProblem, highest: int, small_damping: bool = False) -> Iterator[Complex]:
    """Yield Z^(0), Z^(1), ... [m] without end, harmonics 0..highest.

    Raises
    ------
    ArgumentError
        If a harmonic has |D_n| < 1e-13: undamped resonance.
    """
    stiffness, damping = zeroth_stiffness(problem, highest, small_damping)
    modulate = Modulation(problem.stiffness_harmonics, highest, highest)
    term = problem.static_forcing(highest) / stiffness
    while True:
        yield term
        following = modulate(term)
        if small_damping:
            following += 1j * damping * term
        term = -following / stiffness


def zeroth_stiffness(
    problem: HillProblem, highest: int, small_damping: bool
) -> tuple[Complex, Real]:
    """D_n of order zero and the damping 2 zeta n/R that is left to order one, (highest+1,) each.

    Raises
    ------
    ArgumentError
        If a harmonic has |D_n| < 1e-13: undamped resonance.
    """
    stiffness = problem.dynamic_stiffness(highest)
    damping = np.zeros(highest + 1)
    if small_damping:
        damping = stiffness.imag.copy()
        stiffness = stiffness.real.astype(complex)
    if np.abs(stiffness).min() < NO_STIFFNESS:
        n = int(np.abs(stiffness).argmin())
        raise ArgumentError(
            f"harmonic {n} lies on the natural frequency and has no damping in order zero: its "
            f"terms are secular; use forced_resonance(problem, lines=[{n}])"
        )
    return stiffness, damping


def plain_sum(
    certifier: Certifier, highest: int, tolerance: float, order: int | None
) -> Approximation:
    """Sum the orders as they come: `order` of them, or until they meet the tolerance or diverge.

    Parameters
    ----------
    certifier : Certifier
        Of the problem.
    highest : int
        Highest response harmonic kept.
    tolerance : float
        Relative error of the acceleration to stop at, where no order is given.
    order : int or None
        Highest order.
    """
    stream = orders(certifier.problem, highest)
    start = next(stream)
    dynamic = np.zeros_like(start)
    used = 0
    smallest = math.inf
    for term in itertools.islice(stream, MOST_ORDERS if order is None else order):
        dynamic = dynamic + term
        used += 1
        if order is None:
            size = rms(certifier.weights(highest) * term)
            smallest = min(smallest, size)
            total = rms(certifier.weights(highest) * (start + dynamic))
            if size <= 0.1 * tolerance * total and (
                size <= 1e-3 * tolerance * total
                or certifier.judge(dynamic).bound.relative <= tolerance
            ):
                break
            if size > 1e3 * smallest:
                break
    return certifier.judge(dynamic, used)
