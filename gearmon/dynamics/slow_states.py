"""Slow and fast states of Hill's equation: the recursion behind all amplitude equations.

The two free vibrations of the mean stiffness have the exponents s+ and s- (in s = w0 t). With
z = y+ + y- and z' = s+ y+ + s- y-, and every y written as sum_n y_n(s) e^{i n s/R}, Hill's equation
is a linear system with constant coefficients,

    y+_n' = (s+ - i n/R) y+_n + (g_n - sum_m phi_{n-m} z_m)/(s+ - s-)
    y-_n' = (s- - i n/R) y-_n - (g_n - sum_m phi_{n-m} z_m)/(s+ - s-),

its diagonal of order zero and phi of order one. A few states (sign, n) are singled out as slow:
their amplitudes A are what is left of the motion when all others follow them,

    y = U A + q,    A' = L A + b,    U = U0 + U1 + ...,    L = L0 + L1 + ...,

where U_k holds the terms of order k in phi. Order by order the terms that would be secular (those
in the slow states) go into L and b, and the rest is divided by a difference of exponents:

    L_k = slow part of V U_{k-1}
    U_k = [V U_{k-1} - sum_{i=1..k-1} U_{k-i} L_i]/(h_slow - h)       in the other states
    b_k = slow part of V q_{k-1},   q_k = -[g + V q_{k-1} - sum_i U_i b_{k-i}]/h

with h = s -+ i n/R and V the coupling. L_k A is what textbooks call D_k A, the derivative on the
scale T_k = eps^k t; L is their reconstituted sum. Nothing is divided by the distance between slow
states, so a resonance between them does no harm; all other differences must be large beside
|phi|/2, and are reported as `smallest_divisor`.

Small damping (h = eps mu) uses s+- = +-i and moves -2 zeta z' into V; otherwise
s+- = -zeta +- sqrt(zeta^2 - 1) keeps all damping in order zero.

Sources: Nayfeh and Mook, Nonlinear Oscillations, 1979, chapter 5 (the equations of first order);
Bloch, Nucl. Phys. 6 (1958) 329 (the recursion for a group of nearly equal eigenvalues).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem
from gearmon.errors import ArgumentError

State = tuple[int, float]
SAME_FREQUENCY = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Coupling:
    """The two free vibrations of order zero, and what couples them, in the time s = w0 t.

    Attributes
    ----------
    ratio : float
        R = w0/w.
    zeta : float
        Damping ratio.
    harmonics : complex ndarray, shape (J,)
        c_1..c_J of phi.
    small_damping : bool
        Whether the damping is of order one, not zero.
    """

    ratio: float
    zeta: float
    harmonics: Complex
    small_damping: bool

    @cached_property
    def roots(self) -> tuple[complex, complex]:
        """Exponents s+ and s- of order zero."""
        if self.small_damping:
            return 1j, -1j
        swing = cmath.sqrt(self.zeta**2 - 1)
        if abs(swing) < 1e-6:
            raise ArgumentError(
                f"damping_ratio={self.zeta} must not be 1: the two free vibrations of critical "
                "damping coincide and their expansion fails; change the damping by 1e-9 of itself"
            )
        # the larger real root by division: no difference of nearly equal numbers
        lower = -self.zeta - swing
        return 1 / lower, lower

    def exponents(self, lines: Real) -> Complex:
        """Diagonal s+- - i n/R of order zero, shape (2, M)."""
        diagonal: Complex = np.array(self.roots)[:, None] - 1j * lines / self.ratio
        return diagonal

    def __call__(self, y: Complex) -> Complex:
        """V y for states y, shape (2, M, ...), on consecutive lines."""
        z = y[0] + y[1]
        force = np.zeros_like(z)
        for j, c in enumerate(self.harmonics[: len(z) - 1], start=1):
            if c != 0:
                force[j:] -= c * z[:-j]
                force[:-j] -= c.conjugate() * z[j:]
        if self.small_damping:
            force -= 2 * self.zeta * (self.roots[0] * y[0] + self.roots[1] * y[1])
        return self.driven(force)

    def driven(self, force: Complex) -> Complex:
        """Rates of both free vibrations under a force [relative to k0], shape (2, M, ...)."""
        rates: Complex = np.array([force, -force]) / (self.roots[0] - self.roots[1])
        return rates


@dataclass(frozen=True, kw_only=True, eq=False)
class Reduction:
    """U and L of a set of slow states, in the time s = w0 t.

    Attributes
    ----------
    lines : float ndarray, shape (M,)
        Harmonics, consecutive; halves where the slow states are.
    states : complex ndarray, shape (K, 2, M, p)
        U_0..U_{K-1}; exact on every line for orders up to the one asked for.
    rates : complex ndarray, shape (K+1, p, p)
        L_0..L_K.
    smallest_divisor : float
        Smallest |h_slow - h| that was divided by.
    """

    lines: Real
    states: Complex
    rates: Complex
    smallest_divisor: float


def reduce(coupling: Coupling, slow: list[State], order: int, rate_order: int) -> Reduction:
    """Eliminate all states but the slow ones.

    Parameters
    ----------
    coupling : Coupling
        The system.
    slow : list of (sign, harmonic)
        States kept; their harmonics differ by integers.
    order, rate_order : int
        Highest orders of U and of L.

    Raises
    ------
    ArgumentError
        If another state within reach has the same exponent as one of the slow ones.
    """
    reach = max(order, rate_order // 2) * len(coupling.harmonics)
    ends = [n for _, n in slow]
    first = min(ends) - reach
    lines: Real = np.arange(round(max(ends) + reach - first) + 1, dtype=np.float64) + first
    where = _places(slow, lines)
    h = coupling.exponents(lines)
    own = h[where]
    divisor = own - h[:, :, None]
    divisor[where] = math.inf
    smallest = float(np.abs(divisor).min())
    if smallest < SAME_FREQUENCY:
        raise ArgumentError(
            f"slow={slow}: another state has the same frequency, and the terms that it makes are "
            "secular: keep it among the slow ones; parametric_resonance(problem) does"
        )
    count = max(order, rate_order - 1) + 1
    states = np.zeros((count, 2, len(lines), len(slow)), dtype=complex)
    states[0][where] = np.eye(len(slow))
    rates = np.zeros((rate_order + 1, len(slow), len(slow)), dtype=complex)
    rates[0] = np.diag(own)
    for k in range(1, max(order, rate_order) + 1):
        moved = coupling(states[k - 1])
        if k <= rate_order:
            rates[k] = moved[where]
        if k < count:
            for i in range(1, min(k - 1, rate_order) + 1):
                moved -= states[k - i] @ rates[i]
            states[k] = moved / divisor
    return Reduction(
        lines=lines,
        states=states,
        rates=rates,
        smallest_divisor=smallest,
    )


def _places(slow: list[State], lines: Real) -> tuple[list[int], list[int]]:
    """Index of each slow state in arrays of shape (2, M)."""
    return [0 if sign > 0 else 1 for sign, _ in slow], [round(n - lines[0]) for _, n in slow]


@dataclass(frozen=True, kw_only=True, eq=False)
class Forced:
    """Answer of the fast states to the forces, and what the forces do to the slow ones.

    Attributes
    ----------
    lines : float ndarray, shape (M,)
        Harmonics -n..n.
    terms : complex ndarray, shape (order+1, M)
        Lines of q [m].
    forcing : complex ndarray, shape (K+1, p)
        b_0..b_K [m], per unit of s.
    smallest_divisor : float
        Smallest |h| that was divided by.
    """

    lines: Real
    terms: Complex
    forcing: Complex
    smallest_divisor: float


def answer_forces(
    coupling: Coupling, problem: HillProblem, slow: list[State], reduction: Reduction, order: int
) -> Forced:
    """Expand q and b; slow states are those of `reduction`, on whole harmonics or none of them.

    Raises
    ------
    ArgumentError
        If a harmonic that is not among the slow ones lies on the natural frequency, undamped.
    """
    rate_order = len(reduction.rates) - 1
    whole = [state for state in slow if float(state[1]).is_integer()]
    most_orders = max(order, math.ceil(rate_order / 2) if whole else 0)
    edge = max([len(problem.force_harmonics_n), *(math.ceil(abs(n)) for _, n in whole)])
    highest = edge + most_orders * len(coupling.harmonics)
    lines = np.arange(-highest, highest + 1.0)
    half = problem.static_forcing(highest)
    rate = coupling.driven(np.concatenate([half[:0:-1].conj(), half]))
    h = coupling.exponents(lines)
    where = _places(whole, lines)
    h[where] = math.inf
    if np.abs(h).min() < SAME_FREQUENCY:
        n = int(abs(lines[int(np.abs(h).argmin()) % len(lines)]))
        raise ArgumentError(
            f"harmonic {n} lies on the natural frequency and has no damping in order zero; use "
            f"forced_resonance(problem, lines=[{n}])"
        )
    forcing = np.zeros((rate_order + 1, len(slow)), dtype=complex)
    last = max(order, rate_order) if whole else order
    q: list[Complex] = []
    for k in range(last + 1):
        moved = coupling(q[-1]) if q else rate
        if whole and k <= rate_order:
            forcing[k] = moved[where]
        for i in range(1, k + 1):
            if whole and i < len(reduction.states) and k - i <= rate_order:
                moved = moved - _placed(reduction, i, forcing[k - i], lines)
        q.append(-moved / h)
    terms = np.array([y[0] + y[1] for y in q[: order + 1]])
    return Forced(
        lines=lines, terms=terms, forcing=forcing, smallest_divisor=float(np.abs(h).min())
    )


def _placed(reduction: Reduction, order: int, amplitudes: Complex, lines: Real) -> Complex:
    """U_order times amplitudes, cut or filled with zeros to other lines."""
    made = np.zeros((2, len(lines)), dtype=complex)
    offset = round(reduction.lines[0] - lines[0])
    start, stop = max(0, offset), min(len(lines), offset + len(reduction.lines))
    part = reduction.states[order] @ amplitudes
    made[:, start:stop] = part[:, start - offset : stop - offset]
    return made
