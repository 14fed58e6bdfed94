"""Multiple scales with the damping kept in the zeroth-order operator.

Putting phi(t) = eps f(t) and z = z^(0) + eps z^(1) + ..., with 2 zeta w0 z' in the operator of
order zero, the free vibration dies out on the fast scale and every order of the steady state is
forced:

    z^(k+1)'' + 2 zeta w0 z^(k+1)' + w0^2 z^(k+1) = -w0^2 f z^(k)
    Z^(0)_n = g_n/D_n,      Z^(k+1)_n = -(1/D_n) sum_m phi_{n-m} Z^(k)_m
    D_n = 1 - (n/R)^2 + 2 i zeta n/R

with eps absorbed in phi and g = (F, f_1, ...)/k0. So stiffness harmonic j makes, at first order,
line j of size |c_j| F/(k0 |D_j|); lines n = j + l follow at second order, and so on. The series
converges if max|phi| max 1/|D_n| < 1 and may converge or not beyond. Order k reaches harmonics
0..kJ, or is cut at `highest`.

The damping ratio of meshes (0.03 to 0.3) is not small beside the variation of stiffness, which is
why it is not moved to the next order as in the textbook form for vanishing damping (Nayfeh and
Mook, Nonlinear Oscillations, 1979, chapter 5).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.certificate import Approximation, Certifier
from gearmon.dynamics.fourier import Complex, Modulation, rms
from gearmon.dynamics.hill import HillProblem

MOST_ORDERS = 400


@dataclass(frozen=True, kw_only=True)
class Expansion:
    """The orders of one steady state.

    Attributes
    ----------
    problem : HillProblem
        What was expanded.
    terms : complex ndarray, shape (order+1, N+1)
        Z^(k)_n [m] with the powers of the stiffness variation included; their sum approximates z_n.
    """

    problem: HillProblem
    terms: Complex

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
            Multiplies every c_j; order k scales with its k-th power.
        """
        powers = factor ** np.arange(self.order + 1)
        total: Complex = powers @ self.terms
        return total

    def rows(self, most: int = 12) -> list[dict[str, float]]:
        """Lines by size: harmonic, frequency_hz and the amplitude 2|Z^(k)_n| [m] of every order.

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


def expand(problem: HillProblem, order: int, highest: int | None = None) -> Expansion:
    """Orders 0..`order` of the steady vibration.

    Parameters
    ----------
    problem : HillProblem
        What to expand.
    order : int
        Highest order, >= 0.
    highest : int, optional
        Highest harmonic kept; by default every harmonic that these orders reach.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> first = expand(p, 1).terms[1]     # line 1: F/k0 * c_1 / |D_1|
    >>> bool(abs(abs(first[1]) - 5e-6 * 0.065 / abs(p.dynamic_stiffness(1)[1])) < 1e-18)
    True
    """
    if highest is None:
        forced = len(problem.force_harmonics_n)
        highest = max(1, forced + order * len(problem.stiffness_harmonics))
    stream = orders(problem, highest)
    return Expansion(problem=problem, terms=np.array([next(stream) for _ in range(order + 1)]))


def orders(problem: HillProblem, highest: int) -> Iterator[Complex]:
    """Yield Z^(0), Z^(1), ... [m] without end, harmonics 0..highest."""
    stiffness = problem.dynamic_stiffness(highest)
    modulate = Modulation(problem.stiffness_harmonics, highest, highest)
    term = problem.static_forcing(highest) / stiffness
    while True:
        yield term
        term = -modulate(term) / stiffness


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
