"""Accurate motions that share nothing with the methods judged by them.

`solve_reference`: Gauss collocation in time. The period is cut into equal segments; in each, the
acceleration is a polynomial through the Gauss-Legendre nodes, and the equation holds at the nodes.
Every segment is then an affine map of its first state to its last; the periodic state closes the
chain. No Fourier series is involved, so a jump of stiffness between two segments costs nothing, and
the order is twice the number of nodes (Hairer, Lubich and Wanner, Geometric Numerical Integration,
2006, section II.1). Dimensionless, with time s = w0 t and deflection in F/k0:
z'' + 2 zeta z' + kappa(s) z = 1.

`refined_balance`: harmonic balance whose residual is computed term by term in extended precision
(64 bits of mantissa on x86) from mass, damping, stiffness and period as they are given; a banded
factorisation in double precision answers it, again and again until nothing changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.benchmark.equations import Case
from gearmon.dynamics import HillProblem

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

NODES = 12
#: Segments solved in one batch, so that a long period does not fill the memory.
BATCH = 20_000


@dataclass(frozen=True, eq=False)
class Lines:
    """A steady motion given as harmonics z_0..z_N of its deflection [F/k0]."""

    displacement: Complex


@dataclass(frozen=True, eq=False)
class Samples:
    """A steady motion given as accelerations [w0^2 F/k0] at shares of the period, ascending."""

    share: Real
    acceleration: Real


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """Accurate periodic motion of one case.

    Attributes
    ----------
    ratio, zeta : float
        w0/w and damping ratio.
    state : ndarray, shape (2,)
        Deflection and velocity at the start of the period.
    decay_rate : float
        Slowest decay of free vibrations, in units of w0; negative if they grow.
    acceleration : ndarray, shape (segments, nodes)
        At the Gauss nodes of every segment.
    """

    ratio: float
    zeta: float
    state: Real
    decay_rate: float
    acceleration: Real

    @property
    def size(self) -> float:
        """Rms acceleration."""
        return math.sqrt(self._mean(self.acceleration**2))

    def error(self, motion: Lines | Samples) -> float:
        """Relative L2 error of the acceleration of a motion over the period."""
        if isinstance(motion, Lines):
            found = self._at_nodes(motion.displacement)
            return math.sqrt(self._mean((found - self.acceleration) ** 2)) / self.size
        return self._error_of_samples(motion)

    def settling(self, wanted: float, deflection: float = 1.0) -> float:
        """Time [1/w0] after which a start without velocity is within `wanted` of the motion.

        Parameters
        ----------
        wanted : float
            Relative rms error of the acceleration that is left of the free vibration.
        deflection : float
            At the start [F/k0]; by default the static one.
        """
        start = np.array([deflection, 0.0]) - self.state
        excess = math.hypot(*start) / math.sqrt(2) / (wanted * self.size)
        return max(0.0, math.log(excess)) / self.decay_rate if excess > 1 else 0.0

    def _mean(self, values: Real) -> float:
        return float((values @ rule(NODES).weights).mean())

    def _at_nodes(self, displacement: Complex) -> Real:
        """Acceleration of harmonics at the nodes; the phase of a node turns every harmonic."""
        segments = len(self.acceleration)
        orders = np.arange(len(displacement))
        lines = -((orders / self.ratio) ** 2) * displacement
        found = np.empty_like(self.acceleration)
        for column, node in enumerate(rule(NODES).nodes):
            turned = lines * np.exp(2j * math.pi * orders * (node / segments))
            found[:, column] = folded(turned, segments)
        return found

    def _error_of_samples(self, motion: Samples) -> float:
        """Error at the samples, each with the share of the period that is nearest to it."""
        difference = motion.acceleration - self._at_shares(motion.share)
        gaps = np.diff(motion.share, append=motion.share[0] + 1.0)
        weight = 0.5 * (gaps + np.roll(gaps, 1))
        return math.sqrt(float((weight * difference**2).sum() / weight.sum())) / self.size

    def _at_shares(self, share: Real) -> Real:
        """Acceleration anywhere, from the polynomial of the segment that begins at or before."""
        place = (share % 1.0) * len(self.acceleration)
        # a sample on a jump belongs to the segment that begins there, rounding or not
        segment = np.floor(place + 1e-9).astype(int)
        values = self.acceleration[segment % len(self.acceleration)]
        distance = (place - segment)[:, None] - rule(NODES).nodes
        exact = np.abs(distance) < 1e-14
        shares = rule(NODES).barycentric / np.where(exact, 1.0, distance)
        blended = (shares * values).sum(axis=1) / shares.sum(axis=1)
        found = np.where(exact.any(axis=1), (values * exact).sum(axis=1), blended)
        return np.asarray(found, dtype=np.float64)


def folded(half: Complex, length: int) -> Real:
    """Values of a half spectrum on `length` equal steps, however many harmonics it has."""
    if len(half) <= length // 2:
        return np.asarray(np.fft.irfft(half, length, norm="forward"))
    whole = np.zeros(length, dtype=np.complex128)
    np.add.at(whole, np.arange(len(half)) % length, np.where(np.arange(len(half)), 2.0, 1.0) * half)
    return np.asarray(np.fft.ifft(whole, norm="forward").real)


@dataclass(frozen=True, eq=False)
class Rule:
    """Gauss-Legendre collocation on [0, 1].

    Attributes
    ----------
    nodes, weights : ndarray, shape (n,)
    integral : ndarray, shape (n, n)
        Row i integrates the polynomial through the nodes from 0 to node i.
    barycentric : ndarray, shape (n,)
        Weights of barycentric interpolation.
    """

    nodes: Real
    weights: Real
    integral: Real
    barycentric: Real


@lru_cache(maxsize=4)
def rule(count: int) -> Rule:
    """Return the collocation with `count` nodes."""
    x, w = np.polynomial.legendre.leggauss(count)
    values = np.polynomial.legendre.legvander(x, count)
    degrees = np.arange(count)
    # the integral of P_n from -1 is (P_{n+1} - P_{n-1})/(2n+1), of P_0 it is P_1 + P_0
    below = np.concatenate([-np.ones((count, 1)), values[:, : count - 1]], axis=1)
    integrals = (values[:, 1:] - below) / (2 * degrees + 1)
    # coefficients by the quadrature itself: (2n+1)/2 sum w_j P_n(x_j) f_j
    project = (degrees + 0.5)[:, None] * (w[:, None] * values[:, :count]).T
    gaps = x[:, None] - x + np.eye(count)
    return Rule(0.5 * (x + 1), 0.5 * w, 0.5 * integrals @ project, 1 / gaps.prod(axis=1))


def segments_needed(ratio: float, harmonics: int) -> int:
    """Segments short enough for rounding accuracy; divisible by 4 for the jumps of a rectangle."""
    return 4 * math.ceil(max(8.0, 2 * math.pi * max(1.3 * ratio, harmonics + 1)) / 4)


def solve_reference(case: Case, segments: int | None = None) -> Reference:
    """Periodic motion of a case to about 1e-13.

    Parameters
    ----------
    case : Case
    segments : int, optional
        Divisible by 4; by default what resonance and stiffness harmonics take.
    """
    p = case.problem
    ratio, zeta = p.frequency_ratio, p.damping_ratio
    if segments is None:
        segments = segments_needed(ratio, 0 if case.rectangle else len(p.stiffness_harmonics))
    step = 2 * math.pi * ratio / segments
    maps, accelerations = [], []
    for begin in range(0, segments, BATCH):
        which = np.arange(begin, min(begin + BATCH, segments))
        moved, accelerated = _segment_maps(_stiffness(case, segments, which), zeta, step)
        maps.append(moved)
        accelerations.append(accelerated)
    states, growth = _close(np.concatenate(maps))
    # acceleration is linear in (z, v, 1) at the start of the segment
    whole = np.concatenate(accelerations)
    acceleration = np.einsum("sij,sj->si", whole, np.column_stack([states, np.ones(segments)]))
    return Reference(
        ratio=ratio,
        zeta=zeta,
        state=states[0],
        decay_rate=-growth / (2 * math.pi * ratio),
        acceleration=acceleration,
    )


def _stiffness(case: Case, segments: int, which: npt.NDArray[np.int_]) -> Real:
    """Relative stiffness at the nodes of some segments, shape (count, nodes)."""
    nodes = rule(NODES).nodes
    if case.rectangle is not None:
        middle = (which + 0.5) / segments
        return np.repeat(case.relative_stiffness(middle)[:, None], NODES, axis=1)
    harmonics = case.problem.stiffness_harmonics
    half = np.concatenate([[1.0 + 0j], harmonics])
    orders = np.arange(len(half))
    columns = [
        folded(half * np.exp(2j * math.pi * orders * (node / segments)), segments)[which]
        for node in nodes
    ]
    return np.column_stack(columns)


def _segment_maps(stiffness: Real, zeta: float, step: float) -> tuple[Real, Real]:
    """Return what maps (z, v, 1) to the next (z, v), and to accelerations at the nodes."""
    r = rule(NODES)
    once, twice = step * r.integral, step**2 * (r.integral @ r.integral)
    matrix = np.eye(NODES) + 2 * zeta * once + stiffness[:, :, None] * twice
    right = np.empty((*stiffness.shape, 3))
    right[:, :, 0] = -stiffness
    right[:, :, 1] = -2 * zeta - stiffness * (step * r.nodes)
    right[:, :, 2] = 1.0
    acceleration = np.linalg.solve(matrix, right)
    velocity = step * (r.weights @ acceleration)
    deflection = step**2 * ((r.weights @ r.integral) @ acceleration)
    moved = np.stack([deflection, velocity], axis=1)
    moved[:, 0, 0] += 1
    moved[:, 0, 1] += step
    moved[:, 1, 1] += 1
    return moved, np.asarray(acceleration, dtype=np.float64)


def _close(maps: Real) -> tuple[Real, float]:
    """Periodic states at the start of every segment, and log of the largest multiplier."""
    whole, log = np.eye(2), 0.0
    shift = np.zeros(2)
    for moved in maps:
        whole = moved[:, :2] @ whole
        shift = moved[:, :2] @ shift + moved[:, 2]
        # the map of a long period is smaller than the smallest number
        size = float(np.abs(whole).max())
        whole /= size
        log += math.log(size)
    state = np.linalg.solve(np.eye(2) - math.exp(min(log, 700.0)) * whole, shift)
    states = np.empty((len(maps), 2))
    # small products in plain numbers: four times as fast as arrays of two
    z, v = float(state[0]), float(state[1])
    for number, ((a, b, e), (c, d, f)) in enumerate(maps.tolist()):
        states[number] = z, v
        z, v = a * z + b * v + e, c * z + d * v + f
    return states, log + math.log(float(np.abs(np.linalg.eigvals(whole)).max()))


Extended = npt.NDArray[np.clongdouble]

ROUNDS = 8
TAIL = 1e-20
#: 2 pi beyond double precision.
FULL_TURN = np.longdouble("6.283185307179586476925286766559005768")


@dataclass(frozen=True, kw_only=True, eq=False)
class RefinedBalance:
    """Harmonics of one system, and how well they are known.

    Attributes
    ----------
    displacement : extended complex ndarray, shape (N+1,)
        z_0..z_N [F/k0].
    uncertainty : float
        Relative: the last correction of the acceleration and the highest lines.
    """

    displacement: Extended
    uncertainty: float

    def error(self, displacement_m: npt.NDArray[np.complex128], problem: HillProblem) -> float:
        """Relative L2 error of the acceleration of given harmonics [m]."""
        size = max(len(self.displacement), len(displacement_m))
        exact = np.zeros(size, dtype=np.clongdouble)
        exact[: len(self.displacement)] = self.displacement
        unit = np.longdouble(problem.force_n) / np.longdouble(problem.stiffness_n_per_m)
        difference = exact.copy()
        difference[: len(displacement_m)] -= displacement_m.astype(np.clongdouble) / unit
        squares = np.arange(size, dtype=np.longdouble) ** 2
        return float(_norm(squares * difference) / _norm(squares * exact))

    def acceleration_at(self, share: Real, ratio: float) -> Real:
        """Acceleration [w0^2 F/k0] at shares of the period."""
        half = self.displacement.astype(np.complex128)
        orders = np.arange(len(half))
        phase = np.exp(2j * math.pi * np.outer(share, orders[1:]))
        lines = -((orders / ratio) ** 2) * half
        return np.asarray(2 * (phase @ lines[1:]).real)


def refined_balance(problem: HillProblem) -> RefinedBalance:
    """Solve the harmonic balance with as many harmonics as extended precision can tell.

    Parameters
    ----------
    problem : HillProblem
        With a constant force.
    """
    count = len(problem.stiffness_harmonics)
    reach = 1 + 2 * float(np.abs(problem.stiffness_harmonics).sum())
    highest = math.ceil(1.3 * problem.frequency_ratio * math.sqrt(reach)) + 2 * count + 8
    while True:
        found, change = _refined(problem, highest)
        weighted = np.arange(highest + 1) ** 2 * np.abs(found)
        tail = float(weighted[-count:].max() / weighted.max())
        if tail < TAIL or highest > 20_000:
            return RefinedBalance(displacement=found, uncertainty=change + tail)
        highest = math.ceil(1.3 * highest) + count


def _refined(problem: HillProblem, highest: int) -> tuple[Extended, float]:
    """Harmonics 0..highest and the relative size of the last correction."""
    equation = _Equation(problem, highest)
    z = np.zeros(2 * highest + 1, dtype=np.clongdouble)
    squares = np.arange(-highest, highest + 1) ** 2
    change = math.inf
    for _ in range(ROUNDS):
        correction = equation.answer(equation.residual(z))
        z = z + correction
        last, change = change, float(_norm(squares * correction) / _norm(squares * z))
        if change < 1e-19 or change > 0.5 * last:
            break
    return z[highest:], change


class _Equation:
    """D z + phi z = 1 for harmonics -N..N, in units of k0 and F/k0."""

    def __init__(self, problem: HillProblem, highest: int) -> None:
        from scipy.linalg.lapack import zgbtrf

        p = problem
        mass, damping, stiffness = (
            np.longdouble(value) for value in (p.mass_kg, p.damping_ns_per_m, p.stiffness_n_per_m)
        )
        turn = FULL_TURN / np.longdouble(p.period_s) * np.arange(-highest, highest + 1)
        real = (stiffness - mass * turn**2) / stiffness
        self.diagonal: Extended = real + 1j * (damping * turn / stiffness)
        c = p.stiffness_harmonics[: 2 * highest].astype(np.clongdouble)
        self.modulation: Extended = np.concatenate([c[::-1].conj(), np.zeros(1), c])
        self.highest = highest
        self.width = len(c)
        size, width = 2 * highest + 1, self.width
        bands = np.zeros((3 * width + 1, size), dtype=np.complex128)
        bands[width:] = self.modulation.astype(np.complex128)[:, None]
        bands[2 * width] = self.diagonal.astype(np.complex128)
        self.factors, self.pivots, _ = zgbtrf(bands, width, width)

    def residual(self, z: Extended) -> Extended:
        """Return what is left of the constant force."""
        size = len(z)
        left: Any = -self.diagonal * z
        left -= np.convolve(self.modulation, z)[self.width : self.width + size]
        left[self.highest] += 1
        return np.asarray(left)

    def answer(self, residual: Extended) -> Extended:
        """Return the correction, to double precision of itself."""
        from scipy.linalg.lapack import zgbtrs

        size = float(np.abs(residual).max()) or 1.0
        right = (residual / size).astype(np.complex128)
        solution, _ = zgbtrs(self.factors, self.width, self.width, right, self.pivots)
        return np.asarray(solution.astype(np.clongdouble) * size)


def _norm(values: Any) -> Any:
    return np.sqrt((values.real**2 + values.imag**2).sum())


def difference_to_shooting(problem: HillProblem, balance: RefinedBalance) -> float:
    """Relative rms difference of acceleration to DOP853 with its periodic state by shooting.

    Parameters
    ----------
    problem : HillProblem
    balance : RefinedBalance
        Of the same problem.
    """
    from scipy.integrate import solve_ivp

    ratio, zeta = problem.frequency_ratio, problem.damping_ratio
    orders = 1j * np.arange(1, len(problem.stiffness_harmonics) + 1) / ratio

    def kappa(time: float) -> float:
        return 1.0 + 2 * float((np.exp(orders * time) @ problem.stiffness_harmonics).real)

    def slope(time: float, y: Real) -> Real:
        z, v = y[::2], y[1::2]
        out = np.empty_like(y)
        out[::2] = v
        out[1::2] = -2 * zeta * v - kappa(time) * z
        out[-1] += 1.0
        return out

    start = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    period = 2 * math.pi * ratio
    found = solve_ivp(slope, (0.0, period), start, method="DOP853", rtol=3e-14, atol=1e-15)
    end = found.y[:, -1]
    matrix = np.eye(2) - np.array([[end[0], end[2]], [end[1], end[3]]])
    a, b = np.linalg.solve(matrix, end[4:])
    z = a * found.y[0] + b * found.y[2] + found.y[4]
    v = a * found.y[1] + b * found.y[3] + found.y[5]
    stiffness = np.array([kappa(time) for time in found.t])
    acceleration = 1.0 - 2 * zeta * v - stiffness * z
    exact = balance.acceleration_at(found.t / period, ratio)
    difference = np.trapezoid((acceleration - exact) ** 2, found.t)
    return math.sqrt(float(difference / np.trapezoid(exact**2, found.t)))
