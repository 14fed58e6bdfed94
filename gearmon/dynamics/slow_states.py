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

with h = s -+ i n/R and V the coupling: q and b are one more column of U and L, that of a state
which stays as it is. L_k A is what textbooks call D_k A, the derivative on the
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
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearmon.dynamics.fourier import Complex, Real
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
    """U and L of some slow states, in the time s = w0 t; q and b are their last columns.

    Attributes
    ----------
    lines : float ndarray, shape (M,)
        Harmonics in ascending order.
    states : complex ndarray, shape (K', 2, M, p+1)
        U_k and q_k [m]; exact on every line for orders up to the one asked for.
    rates : complex ndarray, shape (K+1, p+1, p+1)
        L_k and b_k [m] above a row of zeros.
    smallest_divisor : float
        Smallest |h_slow - h| that was divided by.
    """

    lines: Real
    states: Complex
    rates: Complex
    smallest_divisor: float


def reduce(
    coupling: Coupling,
    slow: Sequence[State],
    order: int,
    rate_order: int,
    forces: Complex | None = None,
    apart: bool = False,
) -> Reduction:
    """Eliminate all states but the slow ones.

    Parameters
    ----------
    coupling : Coupling
        The system.
    slow : sequence of (sign, harmonic)
        States kept; their harmonics differ by integers.
    order, rate_order : int
        Highest orders of U and of L.
    forces : complex ndarray, shape (G+1,), optional
        (F, f_1..f_G)/k0 [m]; by default there are neither q nor b, nor their columns.
    apart : bool
        Whether every state is kept by itself, all others following it; L is then diagonal.

    Raises
    ------
    ArgumentError
        If another state within reach has the same exponent as one of the slow ones, or a harmonic
        that forces reach lies on the natural frequency, undamped.
    """
    forced = forces is not None
    reach = max(order, (rate_order + forced) // 2) * len(coupling.harmonics)
    coupling, lines, moved = _start(coupling, slow, forces, reach)
    count, columns = len(slow), moved.shape[-1]
    where = [0 if sign > 0 else 1 for sign, _ in slow], np.searchsorted(lines, [n for _, n in slow])
    h = coupling.exponents(lines)
    # a force is a slow state that stays as it is
    own = np.append(h[where], [0j] * forced)
    kept = np.eye(count, columns) if apart else np.ones((count, columns))
    divisor = own - h[:, :, None]
    divisor[where] = np.where(kept, math.inf, divisor[where])
    _check_divisors(divisor, lines, slow)
    states = np.zeros((max(order, rate_order - 1) + 1, *divisor.shape), dtype=complex)
    rates = np.zeros((rate_order + 1, columns, columns), dtype=complex)
    states[0][where], rates[0] = np.eye(count, columns), np.diag(own)
    for k in range(max(order, rate_order) + 1):
        if k:
            moved = coupling(states[k - 1])
        if k <= rate_order:
            rates[k, :count] += moved[where] * kept
        if k < len(states):
            for i in range(1, min(k - 1, rate_order) + 1):
                moved -= states[k - i] @ rates[i]
            states[k] += moved / divisor
            if k and forced:
                states[k, ..., -1] -= states[k] @ np.append(rates[0, :-1, -1], 0) / divisor[..., -1]
    smallest = float(np.abs(divisor).min())
    return Reduction(lines=lines, states=states, rates=rates, smallest_divisor=smallest)


def _start(
    coupling: Coupling, slow: Sequence[State], forces: Complex | None, reach: int
) -> tuple[Coupling, Real, Complex]:
    """Lines within reach, what couples them, and the rates that forces give to order zero."""
    edge = max(abs(n) for _, n in slow)
    if forces is None:
        lines: Real = np.linspace(-edge - reach, edge + reach, round(2 * (edge + reach)) + 1)
        return coupling, lines, np.zeros((2, len(lines), len(slow)), dtype=complex)
    steps, edge = 1, max(math.ceil(edge), len(forces) - 1)
    if slow[0][1] % 1:
        # forces act on whole lines: half ones stand between them, each kind coupled to its own
        steps, apart = 2, np.zeros(2 * len(coupling.harmonics), dtype=complex)
        apart[1::2] = coupling.harmonics
        coupling = replace(coupling, harmonics=apart)
    highest = edge + reach
    lines = np.linspace(-highest, highest, 2 * highest * steps + 1)
    force = np.zeros(len(lines), dtype=complex)
    middle = highest * steps
    force[middle : middle + steps * len(forces) : steps] = forces
    force[:middle] = force[:middle:-1].conj()
    start = np.zeros((2, len(lines), len(slow) + 1), dtype=complex)
    start[..., -1] = coupling.driven(force)
    return coupling, lines, start


def _check_divisors(divisor: Complex, lines: Real, slow: Sequence[State]) -> None:
    """Leave out what slow states and forces do not reach, and raise if another is resonant."""
    ends = [*(n for _, n in slow), 0.0][: divisor.shape[-1]]
    divisor[:, np.subtract.outer(lines, ends) % 1 != 0] = math.inf
    sizes = np.abs(divisor)
    if sizes[..., : len(slow)].min() < SAME_FREQUENCY:
        raise ArgumentError(
            f"slow={list(slow)}: another state has the same frequency, and the terms that it makes "
            "are secular: keep it among the slow ones; parametric_resonance(problem) does"
        )
    if sizes.min() < SAME_FREQUENCY:
        n = int(abs(lines[int(sizes[..., -1].argmin()) % len(lines)]))
        raise ArgumentError(
            f"harmonic {n} lies on the natural frequency and has no damping in order zero; use "
            f"forced_resonance(problem, lines=[{n}])"
        )
