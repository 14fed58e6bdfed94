"""Amplitude equations: resonance, free vibration and transients under periodic stiffness.

    A' = L A + b,    z(t) = sum_n [sum_p U_np A_p(t) + q_n] e^{i n w t}

They are what is left of Hill's equation when fast states are eliminated: A holds the complex
amplitudes of a few slow states (sign, n), the part of line n that belongs to the free vibration of
that sign; L, b, U and q are series in the variation of stiffness (and in the damping where that is
small), by the recursion below. `free_vibration` keeps one state at a time,
`forced_resonance` and `parametric_resonance` those that are near each other in frequency.

Limits: all states left out must be away from those kept, by much more than max|phi|/2 relative to
w0: see `smallest_divisor`.

Resonance. The line p w near the natural frequency carries z = A e^{i p w t} + conjugate, whose
amplitude obeys

    A' = alpha A + beta conj(A) + b

alpha = -h + i (w0 - p w) + ..., beta = i w0 c_{2p}/2 + ... and, for whole p, b = i w0 c_p delta/2 +
..., delta = F/k0, each to any order. (Signs: z'' + ... = -w0^2 phi z.)

Forced parametric resonance, n w = w0 (p = n): at first order the steady line has the amplitude
2|A| = w0 |c_n| delta/sqrt(h^2 + (n w - w0)^2), which a direct force f_n at the line adds to.

Principal parametric resonance, n w = 2 w0 (p = n/2): A grows with the rate
-h + sqrt(|beta|^2 - Im(alpha)^2); at first order inside |n w - 2 w0| < 2 sqrt((w0 |c_n|/2)^2 - h^2)
and only if 2|c_n| > 4 zeta (2|c_n| is the real amplitude of the stiffness harmonic n).

Coincidences of second and higher order need nothing else: beta and b then start at that order, from
products c_j c_l with j + l = 2p or p.

Orders: with damping and detuning of order r (r = 1 where c_p or c_2p itself is resonant, 2 where a
product is) A is of order zero and its error of order N + 1 if L and b go to order N + r; the
default is N + 2.

Limits: all other lines must be away from the natural frequency by much more than |phi| w0/2; the
nearest is usually a mesh frequency away, so max|phi| R should not be large. Lines p and p+1 may be
taken together for the steady state (and are, half-way between them). Overdamped systems have no
resonance.

The recursion. The two free vibrations of the mean stiffness have the exponents s+ and s- (in s = w0
t). With z = y+ + y- and z' = s+ y+ + s- y-, and every y written as sum_n y_n(s) e^{i n s/R}, Hill's
equation is a linear system with constant coefficients,

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

Free vibration. Away from parametric resonance it is

    z(t) = A e^{lambda t} sum_n U_n e^{i n w t} + conjugate,    U_0 = 1 + order two

The amplitude equation is A' = lambda A: the modulation of amplitude and phase is a' = -decay a and
theta' = Im lambda. With small damping (h = eps mu, h = zeta w0) and to second order

    Im lambda = w0 - h^2/(2 w0) - w0 sum_{n>=1} |c_n|^2/(4 - (n/R)^2),     decay = h
    U_n = c_n/[(n/R)(2 + n/R)]       side lines at w0 + n w, first order

and with the damping in order zero lambda starts from -h + i w0 sqrt(1 - zeta^2); overdamped, both
exponents are real. Higher orders follow by recursion and agree with the Floquet exponents, up to
the multiple of i w that these leave open.

Limits: the divisors are n/R (slow stiffness against w0: the side lines are then many, like those
of frequency modulation with index c_n R/n) and 2 sqrt(1 - zeta^2) - n/R (n w near 2 w0: parametric
resonance); `AmplitudeEquations.smallest_divisor` tells how near. Near parametric resonance use
`parametric_resonance`, and `transient` anywhere.

Motion from given initial conditions. Of two amplitude equations,

    z(t) = sum_n [q_n + sum_p U_np A_p(t)] e^{i n w t},    A(t) = A_s + e^{L t} (A(0) - A_s)

A_s is the steady amplitude and A(0) is found from z(0) and z'(0). The exponential of the 2 x 2
matrix L is in closed form, also where its two exponents coincide (edge of an instability tongue).

Sources: Nayfeh and Mook, Nonlinear Oscillations, 1979, chapter 5 (the equations of first order;
section 5.2 for free vibration, 5.7 for the resonances); Floquet exponents by a perturbation series
(Hill 1886); Bloch, Nucl. Phys. 6 (1958) 329 (the recursion for a group of
nearly equal eigenvalues).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real, turning
from gearmon.dynamics.hill import KINDS, HillProblem, check_kind
from gearmon.errors import ArgumentError, check_finite, check_range
from gearmon.result import Result

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
        return np.asarray(np.array(self.roots)[:, None] - 1j * lines / self.ratio)

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
        return np.asarray(np.array([force, -force]) / (self.roots[0] - self.roots[1]))


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


MOST_ORDERS = 60


@dataclass(frozen=True, kw_only=True, eq=False)
class AmplitudeEquations(Result):
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
    rate_terms : complex ndarray, shape (K+1, p, p+1)
        L_0..L_K [1/s], and in their last column b_0..b_K [m/s]; L_0 is diagonal and holds the
        detuning s - i n w.
    lines : float ndarray, shape (M,)
        Harmonics n: whole numbers, and halves where the slow states are such.
    shape_terms : complex ndarray, shape (N+1, M, p+1)
        Orders of U [1], and in their last column of q [m].
    smallest_divisor : float
        Smallest difference of exponents that was divided by, relative to w0. The expansion is
        asymptotic, good for max|phi|/2 well below this.
    """

    problem: HillProblem
    slow: tuple[State, ...]
    small_damping: bool
    rate_terms: Complex
    lines: Real
    shape_terms: Complex
    smallest_divisor: float

    @property
    def order(self) -> int:
        """N, highest order of the lines."""
        return len(self.shape_terms) - 1

    @property
    def rate(self) -> Complex:
        """L, all orders [1/s], shape (p, p)."""
        return np.asarray(self.rate_terms.sum(axis=0)[:, :-1], dtype=np.complex128)

    @property
    def forcing(self) -> Complex:
        """b, all orders [m/s], shape (p,)."""
        return np.asarray(self.rate_terms.sum(axis=0)[:, -1], dtype=np.complex128)

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
        total = self.shape_terms.sum(axis=0) @ np.append(self.steady_amplitudes(), 1.0)
        whole: Complex = total[(self.lines >= 0) & (self.lines % 1 == 0)]
        whole[0] = whole[0].real
        return whole


def amplitude_equations(
    problem: HillProblem,
    slow: list[State],
    order: int,
    rate_order: int | None = None,
    small_damping: bool = False,
    apart: bool = False,
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
    rate_order : int, optional
        K: highest order of L and b; by default N + 2. With damping and detuning of order r,
        amplitudes have an error of order N+1 if K >= N + r.
    small_damping : bool
        Damping of order one instead of zero.
    apart : bool
        Whether each state is expanded by itself, as if it alone were slow, and the forces without
        any: L is diagonal and b is zero.

    Raises
    ------
    ArgumentError
        If orders are out of range, two states coincide, damping is critical, or a harmonic that is
        not kept lies on the natural frequency.
    """
    rate_order = order + 2 if rate_order is None else rate_order
    check_range("order", order, 0, MOST_ORDERS)
    check_range("rate_order", rate_order, 0, MOST_ORDERS)
    offsets = {n % 1 for _, n in slow}
    if not slow or len(set(slow)) < len(slow) or offsets not in ({0.0}, {0.5}):
        raise ArgumentError(f"slow={slow} must be different states, all on whole or on half lines")
    ratio, zeta, c = problem.frequency_ratio, problem.damping_ratio, problem.stiffness_harmonics
    coupling = Coupling(ratio=ratio, zeta=zeta, harmonics=c, small_damping=small_damping)
    forces = problem.static_forcing(len(problem.force_harmonics_n))
    found = reduce(coupling, slow, order, rate_order, forces, apart)
    return AmplitudeEquations(
        problem=problem,
        slow=tuple(slow),
        small_damping=small_damping,
        rate_terms=2 * math.pi * problem.natural_frequency_hz * found.rates[:, :-1],
        lines=found.lines,
        shape_terms=found.states[: order + 1].sum(axis=1),
        smallest_divisor=found.smallest_divisor,
    )


def forced_resonance(
    problem: HillProblem,
    order: int = 2,
    lines: Sequence[int] | None = None,
    rate_order: int | None = None,
    small_damping: bool = False,
) -> AmplitudeEquations:
    """Amplitude equations of the mesh harmonics near the natural frequency.

    Parameters
    ----------
    problem : HillProblem
        What to expand; zeta < 1.
    order : int
        N >= 0: highest order of the lines.
    lines : sequence of int, optional
        Harmonics >= 0 to treat as resonant; by default the one nearest to the natural frequency,
        or its two neighbours where it is more than w/4 away from both. Two serve the steady state
        only: for initial conditions see `transient`.
    rate_order : int, optional
        Highest order of the rates; default order + 2.
    small_damping : bool
        Damping of order one (h = eps mu) instead of zero.

    Returns
    -------
    AmplitudeEquations
        `steady_displacement()` is the steady vibration; see `Motion` for transients.

    Raises
    ------
    ArgumentError
        If the system is overdamped, or an argument is out of its range.

    Examples
    --------
    >>> p = HillProblem(1.0, 0.02, 1.0, [0.05], 2 * math.pi / 1.02, 1.0)    # w0 = 1, w = 1.02
    >>> e = forced_resonance(p, 0, rate_order=1, small_damping=True)
    >>> a = 2 * abs(e.steady_amplitudes()[0])
    >>> round(float(a), 3), round(0.05 / math.hypot(0.01, 0.02), 3)
    (2.236, 2.236)
    """
    near = natural_line(problem, small_damping)
    chosen = nearest_lines(near) if lines is None else [int(n) for n in lines]
    for n in chosen:
        check_range("lines", n, 0, 100_000)
    slow = [(sign, float(sign * n)) for n in chosen for sign in (1, -1)]
    return amplitude_equations(problem, slow, order, rate_order, small_damping)


def parametric_resonance(
    problem: HillProblem,
    order: int = 2,
    number: int | None = None,
    rate_order: int | None = None,
    small_damping: bool = False,
) -> AmplitudeEquations:
    """Amplitude equations where n w is near twice the natural frequency.

    Parameters
    ----------
    problem : HillProblem
        What to expand; zeta < 1.
    order, rate_order, small_damping
        As in `forced_resonance`.
    number : int, optional
        n >= 1; by default the nearest.

    Returns
    -------
    AmplitudeEquations
        `growth_per_s` > 0 tells instability. For even n this is the forced resonance of n/2, too.

    Raises
    ------
    ArgumentError
        If the system is overdamped, or an argument is out of its range.

    Examples
    --------
    >>> p = HillProblem(1.0, 0.02, 1.0, [0.05], math.pi, 1.0)    # w0 = 1, w = 2, zeta = 0.01
    >>> growth = parametric_resonance(p, 0, rate_order=1, small_damping=True).growth_per_s
    >>> round(growth, 6)    # w0 c_1/2 - h
    0.015
    """
    near = natural_line(problem, small_damping)
    n = max(1, round(2 * near)) if number is None else int(number)
    check_range("number", n, 1, 100_000)
    slow = [(1, n / 2), (-1, -n / 2)]
    return amplitude_equations(problem, slow, order, rate_order, small_damping)


def nearest_lines(natural: float) -> list[int]:
    """Whole lines near the natural frequency: one, or both neighbours of the middle.

    Line n alone would leave a divisor |2 R - 2n - 1|/R, lines n and n+1 together |2 R - 2n|/R.

    Examples
    --------
    >>> nearest_lines(2.2), nearest_lines(2.4)
    ([2], [2, 3])
    """
    below = math.floor(natural)
    if abs(natural - round(natural)) <= 0.25:
        return [round(natural)]
    return [below, below + 1]


def natural_line(problem: HillProblem, small_damping: bool = False) -> float:
    """Natural frequency as a multiple of the mesh frequency, damped unless damping is small.

    Raises
    ------
    ArgumentError
        If the system is overdamped.
    """
    if small_damping:
        return problem.frequency_ratio
    zeta = problem.damping_ratio
    if zeta >= 1:
        raise ArgumentError(
            f"damping_ratio={zeta:.6g} must be < 1: an overdamped system has no resonance; "
            "use expand(problem, order)"
        )
    return problem.frequency_ratio * math.sqrt(1 - zeta**2)


VALUES_AT_ONCE = 1 << 20


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion(Result):
    """Transient and steady vibration that starts at t = 0.

    Parameters
    ----------
    equations : AmplitudeEquations
        Of two slow states.
    displacement_m, velocity_ms : float
        z(0) and z'(0), met exactly.

    Raises
    ------
    ArgumentError
        If there are not two slow states, or they cannot carry the initial conditions.
    """

    equations: AmplitudeEquations
    displacement_m: float
    velocity_ms: float

    def __post_init__(self) -> None:
        check_finite("displacement_m", self.displacement_m, "m")
        check_finite("velocity_ms", self.velocity_ms, "m/s")
        if len(self.equations.slow) != 2:
            raise ArgumentError(
                f"slow={self.equations.slow}: initial conditions fix two amplitudes, no more or "
                "less; choose a single line"
            )

    @cached_property
    def start_amplitudes(self) -> Complex:
        """A(0) [m], shape (2,)."""
        # z and z' at t = 0 per amplitude, and without any
        sums = np.array([shape.sum(axis=0) for shape in self._shapes[:2]])
        matrix = sums[:, :2]
        wanted = np.array([self.displacement_m, self.velocity_ms]) - sums[:, 2]
        scale = np.array([1.0, 2 * math.pi * self.equations.problem.natural_frequency_hz])
        if np.linalg.cond(matrix / scale[:, None]) > 1e12:
            raise ArgumentError(
                "the two slow states look alike at t = 0 and cannot carry the initial conditions; "
                "take a lower order"
            )
        return np.asarray(np.linalg.solve(matrix, wanted), dtype=np.complex128)

    @cached_property
    def steady_amplitudes(self) -> Complex:
        """A_s [m], shape (2,)."""
        return self.equations.steady_amplitudes()

    def amplitudes(self, time_s: npt.ArrayLike) -> Complex:
        """Slow amplitudes A(t) [m], shape (..., 2): envelope and phase of the modulation."""
        time, rate = np.asarray(time_s, dtype=float), self.equations.rate
        middle = complex(np.trace(rate)) / 2
        apart = rate - middle * np.eye(2)
        # half the difference of both exponents: the root of the slower one has the positive real
        # part, so that nothing overflows
        half = cmath.sqrt(-complex(apart[0, 0] * apart[1, 1] - apart[0, 1] * apart[1, 0]))
        first, twice = np.exp((middle + half) * time), 2 * half * time
        safe = np.where(twice == 0, 1.0, twice)
        share = np.where(twice == 0, 1.0, -np.expm1(-safe) / safe)
        # e^{Lt} = even + odd (L - middle)
        even, odd = first * (1 + np.exp(-twice)) / 2, first * time * share
        away = self.start_amplitudes - self.steady_amplitudes
        moved = self.steady_amplitudes + even[..., None] * away + odd[..., None] * (apart @ away)
        return np.asarray(moved, dtype=np.complex128)

    def at(self, time_s: npt.ArrayLike, kind: str = "displacement") -> Real:
        """Displacement [m], velocity [m/s], acceleration [m/s2] or mesh force [N] at any times.

        Parameters
        ----------
        time_s : float array
            Times [s] from the start, any shape.
        kind : {"displacement", "velocity", "acceleration", "mesh_force"}
            What to evaluate: the displacement as it stands, its derivatives, or k(t) z + c z'.
        """
        derivative = KINDS.index(check_kind(kind))
        time = np.asarray(time_s, dtype=float)
        rows = max(1, VALUES_AT_ONCE // len(self.equations.lines))
        flat = time.ravel()
        found = np.empty(len(flat))
        for first in range(0, len(flat), rows):
            part = slice(first, first + rows)
            found[part] = self._values(flat[part], derivative)
        return found.reshape(time.shape)

    @cached_property
    def _shapes(self) -> list[Complex]:
        """Lines of z, z' and z'' per amplitude, and without any, shape (M, 3) each."""
        e = self.equations
        rates = np.zeros((3, 3), dtype=complex)
        rates[:2] = e.rate_terms.sum(axis=0)
        turning = 1j * e.problem.angular_frequency * e.lines[:, None]
        shapes = [e.shape_terms.sum(axis=0)]
        for _ in range(2):
            shapes.append(turning * shapes[-1] + shapes[-1] @ rates)
        return shapes

    def _values(self, time: Real, derivative: int) -> Real:
        """Differentiate the displacement at a few times, or for 3 give the mesh force."""
        e, p = self.equations, self.equations.problem
        angle = p.angular_frequency * time
        if derivative == KINDS.index("mesh_force"):
            n = np.arange(1.0, len(p.stiffness_harmonics) + 1)
            phi = 2 * (turning(angle, n) @ p.stiffness_harmonics).real
            spring = p.stiffness_n_per_m * (1 + phi) * self._values(time, 0)
            return np.asarray(spring + p.damping_ns_per_m * self._values(time, 1))
        moved = turning(angle, e.lines) @ self._shapes[derivative]
        z = (moved[:, :2] * self.amplitudes(time)).sum(axis=1) + moved[:, 2]
        return np.asarray(z.real, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeVibration(AmplitudeEquations):
    """The two free vibrations, A' = lambda A each, and the steady one that they die out to.

    Both are states of line 0: A holds the fast e^{lambda t}. As a start for `Motion` the error at a
    fixed time is of order N+1 in the variation of stiffness; up to times of the order of 1/eps that
    takes rate_order >= order + 1.
    """

    @property
    def exponent(self) -> complex:
        """Sum of all orders of lambda [1/s], of the vibration with Im lambda > 0 (or slower)."""
        return complex(self.rate[0, 0])

    @property
    def frequency_hz(self) -> float:
        """Shifted natural frequency [Hz]; 0 if overdamped."""
        return self.exponent.imag / (2 * math.pi)

    @property
    def decay_per_s(self) -> float:
        """Decay rate -Re lambda [1/s]."""
        return -self.exponent.real


def free_vibration(
    problem: HillProblem, order: int = 2, rate_order: int | None = None, small_damping: bool = False
) -> FreeVibration:
    """Expand the free vibration.

    Parameters
    ----------
    problem : HillProblem
        What to expand.
    order : int
        N >= 0: highest order of the lines.
    rate_order : int, optional
        K >= 0: highest order of the exponent; by default `order`. Its error is of order K+1, and
        K+2 with K even and no damping.
    small_damping : bool
        Damping of order one (h = eps mu) instead of zero. For zeta well below 1 only.

    Raises
    ------
    ArgumentError
        If orders are out of range, damping is critical in order zero, or n w equals twice the
        natural frequency for some n that the orders reach.

    Examples
    --------
    >>> p = HillProblem(1.0, 0.0, 3.3**2, [0.1], 2 * math.pi, 0.0)    # w0 = 3.3 w, eps = 0.2
    >>> round(free_vibration(p, 2).exponent.imag, 8)
    3.29155616
    """
    rate_order = order if rate_order is None else rate_order
    slow = [(1, 0.0), (-1, 0.0)]
    found = amplitude_equations(problem, slow, order, rate_order, small_damping, apart=True)
    return FreeVibration(**vars(found))


def transient(
    problem: HillProblem,
    displacement_m: float = 0.0,
    velocity_ms: float = 0.0,
    order: int = 4,
    small_damping: bool = False,
) -> Motion:
    """Vibration from given initial conditions, resonant or not.

    Parameters
    ----------
    problem : HillProblem
        What to expand.
    displacement_m, velocity_ms : float
        z(0) [m] and z'(0) [m/s].
    order : int
        N >= 0: the error is of order N+1 in the variation of stiffness, up to times of the order
        of its inverse squared; rates are taken to order N+2.
    small_damping : bool
        Damping of order one (h = eps mu) instead of zero.

    Returns
    -------
    Motion
        Of the slow line p w nearest to the natural frequency, p = 0, 1/2, 1, 3/2, ...: that also
        covers parametric (2p) and forced (p) resonance. Overdamped, and where the damped natural
        frequency is below w/4, p = 0.

    Raises
    ------
    ArgumentError
        If an argument is out of its range or the damping critical.

    Notes
    -----
    Other lines are at least w/2 away, so that max|phi| R should be well below one (fast meshes);
    with it above, as for w0 = 13.6 w, more orders help as long as they converge.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 4e-5, 4e3)
    >>> m = transient(p)    # from rest
    >>> abs(float(m.at(0.0))) < 1e-18, abs(float(m.at(1.0)) / 5e-6 - 1) < 0.1
    (True, True)
    """
    zeta = 0.0 if small_damping else problem.damping_ratio
    near = problem.frequency_ratio * math.sqrt(max(0.0, 1 - zeta**2))
    line = round(2 * near) / 2
    slow = [(1, line), (-1, -line)]
    equations = amplitude_equations(problem, slow, order, small_damping=small_damping)
    return Motion(equations=equations, displacement_m=displacement_m, velocity_ms=velocity_ms)
