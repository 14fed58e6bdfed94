"""Amplitude equations of Hill's equation: what is left when fast states are eliminated.

    A' = L A + b,    z(t) = sum_n [sum_p U_np A_p(t) + q_n] e^{i n w t}

A holds the complex amplitudes of a few slow states (sign, n), the part of line n that belongs to
the free vibration of that sign; L, b, U and q are series in the variation of stiffness (and in the
damping where that is small), by the recursion of `slow_states`. `free_vibration` keeps one state at
a time, `resonance` those that are near each other in frequency.

Limits: all states left out must be away from those kept, by much more than max|phi|/2 relative to
w0: see `smallest_divisor`.

Source: Nayfeh and Mook, Nonlinear Oscillations, 1979, chapter 5.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.slow_states import Coupling, State, answer_forces, reduce
from gearmon.errors import ArgumentError, check_range

MOST_ORDERS = 60


@dataclass(frozen=True, kw_only=True, eq=False)
class AmplitudeEquations:
    """A' = L A + b for the amplitudes of a few slow states, and the vibration that they carry.

    z(t) = sum_n [sum_p U_np A_p(t) + q_n] e^{i n w t}. State p is (sign, n): A_p is the complex
    amplitude of the part of line n that belongs to the free vibration of that sign.

    Attributes
    ----------
    problem : HillProblem
        What was expanded.
    slow : tuple of (sign, harmonic)
        The states. Pairs (1, n), (-1, -n) are conjugate: their amplitudes are, too.
    small_damping : bool
        Whether damping counts as order one.
    rate_terms : complex ndarray, shape (K+1, p, p)
        L_0..L_K [1/s]; L_0 is diagonal and holds the detuning s - i n w.
    forcing_terms : complex ndarray, shape (K+1, p)
        b_0..b_K [m/s].
    lines : float ndarray, shape (M,)
        Harmonics n that the slow states reach (whole or half numbers).
    shape_terms : complex ndarray, shape (N+1, M, p)
        Orders of U [1].
    forced_lines : float ndarray, shape (Q,)
        Harmonics of q.
    forced_terms : complex ndarray, shape (N+1, Q)
        Orders of q [m].
    smallest_divisor : float
        Smallest difference of exponents that was divided by, relative to w0. The expansion is
        asymptotic, good for max|phi|/2 well below this.
    """

    problem: HillProblem
    slow: tuple[State, ...]
    small_damping: bool
    rate_terms: Complex
    forcing_terms: Complex
    lines: Real
    shape_terms: Complex
    forced_lines: Real
    forced_terms: Complex
    smallest_divisor: float

    @property
    def order(self) -> int:
        """N, highest order of the lines."""
        return len(self.shape_terms) - 1

    @property
    def rate(self) -> Complex:
        """L, all orders [1/s], shape (p, p)."""
        return np.asarray(self.rate_terms.sum(axis=0), dtype=np.complex128)

    @property
    def forcing(self) -> Complex:
        """b, all orders [m/s], shape (p,)."""
        return np.asarray(self.forcing_terms.sum(axis=0), dtype=np.complex128)

    @property
    def exponents(self) -> Complex:
        """Eigenvalues of L [1/s], the fastest growing first, shape (p,)."""
        found = np.linalg.eigvals(self.rate)
        return np.asarray(found[np.argsort(-found.real, kind="stable")], dtype=np.complex128)

    @property
    def growth_per_s(self) -> float:
        """Largest real part of the exponents [1/s]; positive means instability."""
        return float(self.exponents[0].real)

    def steady_amplitudes(self) -> Complex:
        """Return A with A' = 0 [m], shape (p,).

        Raises
        ------
        ArgumentError
            If L is singular: no steady amplitude exists (resonance without damping).
        """
        if not self.forcing.any():
            return np.zeros(len(self.slow), dtype=complex)
        if np.linalg.cond(self.rate) > 1e15:
            raise ArgumentError(
                "the amplitude equations are singular: an undamped resonance has no steady "
                "vibration; give the problem damping or detune it"
            )
        return np.asarray(np.linalg.solve(self.rate, -self.forcing), dtype=np.complex128)

    def steady_displacement(self) -> Complex:
        """Steady vibration as z_0..z_n [m], whole harmonics."""
        amplitudes = self.steady_amplitudes()
        highest = round(max(self.forced_lines[-1], np.floor(self.lines[-1])))
        whole: Complex = np.zeros(highest + 1, dtype=complex)
        upper = self.forced_lines >= 0
        whole[np.rint(self.forced_lines[upper]).astype(int)] = self.forced_terms.sum(axis=0)[upper]
        if amplitudes.any():
            upper = self.lines >= 0
            carried = self.shape_terms.sum(axis=0) @ amplitudes
            whole[np.rint(self.lines[upper]).astype(int)] += carried[upper]
        whole[0] = whole[0].real
        return whole

    @property
    def text(self) -> str:
        """The equations in words of one line each, A(n) for the state of line n.

        Examples
        --------
        >>> p = HillProblem(1.0, 0.02, 1.0, [0.05], 2 * math.pi / 1.02, 1.0)
        >>> e = amplitude_equations(p, [(1, 1.0), (-1, -1.0)], 0, 1, small_damping=True)
        >>> print(e.text.splitlines()[0])
        A(1)' = (-0.01-0.02i) A(1) + (0+0.025i) m/s
        """
        rows = []
        for p, (_, line) in enumerate(self.slow):
            terms = [
                f"{_shown(self.rate[p, r])} A({n:g})"
                for r, (_, n) in enumerate(self.slow)
                if abs(self.rate[p, r]) > 1e-15 * np.abs(self.rate).max()
            ]
            if self.forcing[p] != 0:
                terms.append(f"{_shown(self.forcing[p])} m/s")
            rows.append(f"A({line:g})' = " + " + ".join(terms or ["0"]))
        return "\n".join(rows)

    def rows(self) -> list[dict[str, float | int | str]]:
        """Secular terms order by order: what was removed from the lines and put into A'.

        Returns
        -------
        list of dict
            line, order, term ("A of line n" or "force"), real_per_s and imaginary_per_s of its
            coefficient in A' [1/s, or m/s for a force].
        """
        found: list[dict[str, float | int | str]] = []
        for k, (rate, forcing) in enumerate(zip(self.rate_terms, self.forcing_terms, strict=True)):
            for p, (_, line) in enumerate(self.slow):
                named = [(f"A of line {n:g}", rate[p, r]) for r, (_, n) in enumerate(self.slow)]
                named.append(("force", forcing[p]))
                found += [
                    {
                        "line": float(line),
                        "order": k,
                        "term": term,
                        "real_per_s": float(value.real),
                        "imaginary_per_s": float(value.imag),
                    }
                    for term, value in named
                    if value != 0
                ]
        return found

    def modulation(self, amplitude_m: float, phase_rad: float) -> tuple[float, float]:
        """Amplitude and phase modulation of the first slow line, a cos(n w t + theta).

        A' = alpha A + beta conj(A) + b with A = (a/2) e^{i theta} gives

            a' = Re(alpha) a + Re(beta e^{-2i theta}) a + 2 Re(b e^{-i theta})
            theta' = Im(alpha) + Im(beta e^{-2i theta}) + (2/a) Im(b e^{-i theta})

        Parameters
        ----------
        amplitude_m : float
            a > 0 [m].
        phase_rad : float
            theta [rad].

        Returns
        -------
        (float, float)
            a' [m/s] and theta' [rad/s].
        """
        self.check_conjugate_pair()
        if not amplitude_m > 0:
            raise ArgumentError(f"amplitude_m={amplitude_m} m must be > 0")
        turn = cmath.exp(1j * phase_rad)
        slow = amplitude_m / 2 * np.array([turn, turn.conjugate()])
        change = complex((self.rate @ slow + self.forcing)[0]) / turn
        return 2 * change.real, 2 * change.imag / amplitude_m

    def check_conjugate_pair(self) -> None:
        """Raise ArgumentError unless the slow states are one pair (1, n), (-1, -n)."""
        two = len(self.slow) == 2
        if not two or self.slow[0] != (1, -self.slow[1][1]) or self.slow[1][0] != -1:
            raise ArgumentError(
                f"slow={self.slow}: this needs one pair (1, n), (-1, -n); choose a single line"
            )
        if self.problem.damping_ratio >= 1 and not self.small_damping:
            raise ArgumentError(
                f"damping_ratio={self.problem.damping_ratio:.6g} must be < 1: overdamped, there is "
                "no oscillation to be modulated"
            )


def _shown(value: complex) -> str:
    return f"({value.real:.6g}{value.imag:+.6g}i)"


def check_orders(order: int, rate_order: int) -> None:
    """Check the orders asked for; ArgumentError if one is out of range."""
    check_range("order", order, 0, MOST_ORDERS)
    check_range("rate_order", rate_order, 0, MOST_ORDERS)


def coupling_of(problem: HillProblem, small_damping: bool) -> Coupling:
    """`Coupling` of a problem."""
    return Coupling(
        ratio=problem.frequency_ratio,
        zeta=problem.damping_ratio,
        harmonics=problem.stiffness_harmonics,
        small_damping=small_damping,
    )


def amplitude_equations(
    problem: HillProblem,
    slow: list[State],
    order: int,
    rate_order: int,
    small_damping: bool = False,
) -> AmplitudeEquations:
    """Amplitude equations for any choice of slow states.

    Parameters
    ----------
    problem : HillProblem
        What to expand.
    slow : list of (sign, harmonic)
        States kept, such as [(1, 3), (-1, -3)] where 3 w is near w0, or [(1, 1.5), (-1, -1.5)]
        where 3 w is near 2 w0. All whole harmonics, or all halves.
    order : int
        N: highest order of the lines.
    rate_order : int
        K: highest order of L and b. With damping and detuning of order r, amplitudes have an error
        of order N+1 if K >= N + r.
    small_damping : bool
        Damping of order one instead of zero.

    Raises
    ------
    ArgumentError
        If orders are out of range, two states coincide, damping is critical, or a harmonic that is
        not kept lies on the natural frequency.
    """
    check_orders(order, rate_order)
    offsets = {n % 1 for _, n in slow}
    if not slow or len(set(slow)) < len(slow) or offsets not in ({0.0}, {0.5}):
        raise ArgumentError(f"slow={slow} must be different states, all on whole or on half lines")
    coupling = coupling_of(problem, small_damping)
    reduction = reduce(coupling, slow, order, rate_order)
    forced = answer_forces(coupling, problem, slow, reduction, order)
    w0 = 2 * math.pi * problem.natural_frequency_hz
    shapes = reduction.states[: order + 1].sum(axis=1)
    return AmplitudeEquations(
        problem=problem,
        slow=tuple(slow),
        small_damping=small_damping,
        rate_terms=w0 * reduction.rates,
        forcing_terms=w0 * forced.forcing,
        lines=reduction.lines,
        shape_terms=shapes,
        forced_lines=forced.lines,
        forced_terms=forced.terms,
        smallest_divisor=min(reduction.smallest_divisor, forced.smallest_divisor),
    )
