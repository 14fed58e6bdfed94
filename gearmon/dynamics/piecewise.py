"""Exact steady vibration where the mesh stiffness is constant piece by piece.

    m z'' + c z' + k(t) z = F(t),    k(t) = k_i and F(t) = F_i during tau_i,  i = 1..P, periodic

A rectangular mesh stiffness (one and two pairs in contact in turn) is the case P = 2. Nothing is
truncated: the state is moved through each piece in closed form, and the Fourier coefficients are
those of the true motion with its jumps of acceleration.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import floquet, period_trace
from gearmon.dynamics.fourier import Complex, Real, rms
from gearmon.dynamics.hill import (
    KINDS,
    HillProblem,
    PeriodicVibration,
    check_kind,
    frozen_vector,
)
from gearmon.dynamics.piecewise_motion import PiecewiseMotion
from gearmon.errors import ArgumentError, check_finite, check_positive, check_range

MOST_HARMONICS = 10_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class PiecewiseProblem:
    """One mass on a spring whose stiffness is constant piece by piece.

    Parameters
    ----------
    mass_kg : float
        m > 0.
    damping_ns_per_m : float
        c >= 0. Without damping (0) no steady state is ever reached.
    stiffness_n_per_m : float array, shape (P,)
        k_1..k_P > 0, in the order of time.
    durations_s : float array, shape (P,)
        tau_1..tau_P > 0; their sum is the period T.
    force_n : float or float array, shape (P,)
        F, constant or piece by piece.
    start_s : float
        Time at which the first piece begins; it sets the phases of the lines.

    Raises
    ------
    ArgumentError
        If a value is not finite or out of its range.

    Examples
    --------
    >>> p = PiecewiseProblem.rectangular(0.28, 9e3, 8e8, 0.13, 0.412, 1.6e-3, 4e3)
    >>> round(p.mean_stiffness_n_per_m, 3), round(p.frequency_ratio, 4)
    (800000000.0, 13.6115)
    """

    mass_kg: float
    damping_ns_per_m: float
    stiffness_n_per_m: Real
    durations_s: Real
    force_n: float | Real
    start_s: float = 0.0

    def __post_init__(self) -> None:
        check_positive("mass_kg", self.mass_kg, "kg")
        check_finite("damping_ns_per_m", self.damping_ns_per_m, "N s/m")
        if self.damping_ns_per_m < 0:
            raise ArgumentError(f"damping_ns_per_m={self.damping_ns_per_m} N s/m must be >= 0")
        check_finite("start_s", self.start_s, "s")
        levels = _row("stiffness_n_per_m", self.stiffness_n_per_m, "N/m", above_zero=True)
        times = _row("durations_s", self.durations_s, "s", above_zero=True)
        force = np.atleast_1d(np.asarray(self.force_n, dtype=np.float64))
        force = _row("force_n", force, "N", above_zero=False)
        if len(times) != len(levels):
            raise ArgumentError(
                f"durations_s: {len(times)} values for {len(levels)} pieces; give one to each"
            )
        if len(force) not in (1, len(levels)):
            raise ArgumentError(
                f"force_n: {len(force)} values for {len(levels)} pieces; give one, or one to each"
            )
        object.__setattr__(self, "stiffness_n_per_m", levels)
        object.__setattr__(self, "durations_s", times)
        object.__setattr__(self, "force_n", float(force[0]) if len(force) == 1 else force)

    @classmethod
    def rectangular(
        cls,
        mass_kg: float,
        damping_ns_per_m: float,
        mean_stiffness_n_per_m: float,
        variation: float,
        duty: float,
        period_s: float,
        force_n: float,
    ) -> PiecewiseProblem:
        """Two levels: k0 (1 + eps) for D T about t = 0, k0 (1 - eps D/(1-D)) for the rest.

        Parameters
        ----------
        mass_kg, damping_ns_per_m, mean_stiffness_n_per_m, period_s, force_n : float
            As of `HillProblem`.
        variation : float
            Relative, eps > -1; both levels must be above zero.
        duty : float
            D in (0, 1): contact ratio less one for spur gears below two pairs.

        Raises
        ------
        ArgumentError
            If a value is out of its range.
        """
        check_positive("mean_stiffness_n_per_m", mean_stiffness_n_per_m, "N/m")
        check_positive("period_s", period_s, "s")
        check_finite("variation", variation)
        check_finite("duty", duty)
        if not 0 < duty < 1:
            raise ArgumentError(f"duty={duty} must lie between 0 and 1")
        levels = np.array([1 + variation, 1 - variation * duty / (1 - duty)])
        if levels.min() <= 0:
            raise ArgumentError(
                f"variation={variation} with duty={duty} makes the stiffness {levels.min():.4g} "
                "times its mean; it must stay > 0"
            )
        return cls(
            mass_kg=mass_kg,
            damping_ns_per_m=damping_ns_per_m,
            stiffness_n_per_m=mean_stiffness_n_per_m * levels,
            durations_s=period_s * np.array([duty, 1 - duty]),
            force_n=force_n,
            start_s=-duty * period_s / 2,
        )

    @property
    def period_s(self) -> float:
        """T [s]."""
        return float(self.durations_s.sum())

    @property
    def angular_frequency(self) -> float:
        """Angular frequency w = 2 pi/T [rad/s]."""
        return 2 * math.pi / self.period_s

    @property
    def mean_stiffness_n_per_m(self) -> float:
        """k0, mean over the period [N/m]."""
        return float(self.stiffness_n_per_m @ self.durations_s) / self.period_s

    @property
    def natural_frequency_hz(self) -> float:
        """sqrt(k0/m)/(2 pi) [Hz], undamped and with the mean stiffness."""
        return math.sqrt(self.mean_stiffness_n_per_m / self.mass_kg) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio zeta = c/(2 sqrt(k0 m)) [1]."""
        return self.damping_ns_per_m / (2 * math.sqrt(self.mean_stiffness_n_per_m * self.mass_kg))

    @property
    def frequency_ratio(self) -> float:
        """R = w0/w [1]."""
        return self.natural_frequency_hz * self.period_s

    @property
    def relative_levels(self) -> Real:
        """k_i/k0 [1], shape (P,)."""
        return np.asarray(self.stiffness_n_per_m / self.mean_stiffness_n_per_m)

    @property
    def shares(self) -> Real:
        """tau_i/T [1], shape (P,)."""
        return np.asarray(self.durations_s / self.period_s)

    @property
    def force_pieces_n(self) -> Real:
        """Force in each piece [N], shape (P,)."""
        return np.broadcast_to(self.force_n, self.durations_s.shape)

    @property
    def mean_force_n(self) -> float:
        """Mean of F(t) [N]."""
        return float(self.force_pieces_n @ self.shares)

    def harmonics_of(self, values: npt.ArrayLike, highest: int) -> Complex:
        """Fourier coefficients 0..highest of what has one value in each piece.

        Parameters
        ----------
        values : float array, shape (pieces,)
            In any unit.
        highest : int, >= 0
            Number of the last.
        """
        pieces = np.broadcast_to(np.asarray(values, dtype=np.float64), self.durations_s.shape)
        ends = np.concatenate([[0.0], np.cumsum(self.shares)]) + self.start_s / self.period_s
        orders = np.arange(1, highest + 1)
        # sum over pieces of value times the integral of e^{-inwt}, by the jumps at their starts
        jumps = pieces - np.roll(pieces, 1)
        turns = np.exp(-2j * math.pi * np.mod(orders[:, None] * ends[:-1], 1.0))
        half = np.empty(highest + 1, dtype=complex)
        half[0] = pieces @ self.shares
        half[1:] = (turns @ jumps) / (2j * math.pi * orders)
        return half

    def hill(self, harmonics: int) -> HillProblem:
        """Return the problem with k(t), and F(t), cut after so many harmonics.

        Parameters
        ----------
        harmonics : int
            J >= 1. The cut series overshoots each jump by 9 % of it however many are kept, and its
            response approaches the exact one as 1/J^2 in displacement.
        """
        check_range("harmonics", harmonics, 1, MOST_HARMONICS)
        stiffness = self.harmonics_of(self.relative_levels, harmonics)
        force = self.harmonics_of(self.force_n, harmonics)[1:]
        return HillProblem(
            self.mass_kg,
            self.damping_ns_per_m,
            self.mean_stiffness_n_per_m,
            stiffness[1:],
            self.period_s,
            self.mean_force_n,
            force if np.ndim(self.force_n) else np.zeros(0, dtype=complex),
        )


def _row(name: str, values: npt.ArrayLike, unit: str, *, above_zero: bool) -> Real:
    """Return a read-only copy of a row of finite numbers."""
    row = np.array(values, dtype=np.float64)
    if row.ndim != 1 or not len(row):
        raise ArgumentError(f"{name}: shape {row.shape} must be one row, one value to each piece")
    bad = ~np.isfinite(row) | (above_zero & (row <= 0))
    if bad.any():
        place = int(np.flatnonzero(bad)[0])
        wanted = "finite and > 0" if above_zero else "finite"
        raise ArgumentError(f"{name}: piece {place + 1} is {row[place]} {unit}, must be {wanted}")
    row.flags.writeable = False
    return row


def multipliers(problem: PiecewiseProblem) -> tuple[complex, complex]:
    """Floquet multipliers, the larger modulus first, in closed form.

    Examples
    --------
    >>> p = PiecewiseProblem.rectangular(1.0, 0.0, 1.0, 0.0, 0.5, 1.0, 1.0)
    >>> first, second = multipliers(p)
    >>> round(first.real, 12) == round(math.cos(1.0), 12), round(abs(first * second), 12)
    (True, 1.0)
    """
    h = problem.damping_ns_per_m / (2 * problem.mass_kg)
    steps, logs = period_trace.unit_matrices(
        np.array(h), problem.stiffness_n_per_m / problem.mass_kg, problem.durations_s
    )
    product, log = period_trace.scaled_product(steps, logs)
    pair = floquet.exponents(product, float(log))
    decay = h * problem.period_s
    return cmath.exp(pair[0] - decay), cmath.exp(pair[1] - decay)


ROUNDING = 2.0**-52


@dataclass(frozen=True, kw_only=True, eq=False)
class PiecewiseResponse(PeriodicVibration):
    """Steady vibration of a `PiecewiseProblem`.

    Attributes
    ----------
    problem : PiecewiseProblem
        What was solved.
    motion : PiecewiseMotion
        States between the pieces; evaluates the motion.
    displacement : complex ndarray, shape (N+1,)
        z_0..z_N [m], z(t) = z_0 + sum_{n>=1} (z_n e^{inwt} + conjugate).
    error_bound : float
        Estimate, with a reserve, of the relative L2 error of the acceleration harmonics given
        here; only rounding enters. Infinite if there is no steady state.
    method : str
        "exact pieces".
    order : int
        0: nothing is expanded.
    stable : bool
        Whether free vibrations die out.
    message : str
        One line.
    """

    problem: PiecewiseProblem
    motion: PiecewiseMotion
    displacement: Complex
    error_bound: float
    method: str
    order: int
    stable: bool
    message: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "displacement", frozen_vector("displacement", self.displacement))

    @property
    def _period_s(self) -> float:
        return self.problem.period_s

    @cached_property
    def mesh_force(self) -> Complex:
        """Coefficients of k(t) z + c z' = F(t) - m z'' [N], shape (N+1,)."""
        force = self.problem.harmonics_of(self.problem.force_n, len(self.displacement) - 1)
        return force - self.problem.mass_kg * self.acceleration

    @cached_property
    def floquet_multipliers(self) -> tuple[complex, complex]:
        """Factors by which a free vibration changes over a period, the larger modulus first."""
        return multipliers(self.problem)

    @property
    def contact_lost(self) -> bool:
        """Whether the mesh force is <= 0 somewhere: there the linear model ends."""
        return self.least_mesh_force_n <= 0

    @cached_property
    def least_mesh_force_n(self) -> float:
        """Smallest mesh force of the period [N], counted in the direction of the mean force."""
        sign = math.copysign(1.0, self.problem.mean_force_n)
        return self.problem.mass_kg * float(self.motion.least_push(sign))

    @cached_property
    def contact_loss_angle_rad(self) -> float | None:
        """First angle w t in [0, 2 pi) with mesh force <= 0, or None."""
        if not self.contact_lost:
            return None
        period = self.problem.period_s
        left = self._stations_s()
        right = np.append(left[1:], period) - 1e-12 * period
        starts, ends = self._push(left) <= 0, self._push(right) <= 0
        # a touch between stations that rounding lifts off again lies at the lowest of them
        first = int(np.argmax(starts | ends)) if (starts | ends).any() else -1
        if first < 0:
            moment = float(left[np.argmin(self._push(left))])
        else:
            moment = left[first] if starts[first] else self._falls(left[first], right[first])
        return 2 * math.pi * float(moment) / period

    def at(self, time_s: npt.ArrayLike, kind: str = "displacement") -> Real:
        """Displacement [m], velocity [m/s], acceleration [m/s2] or mesh force [N] at any times.

        Parameters
        ----------
        time_s : float array
            Times [s], any shape. At a jump the value after it.
        kind : {"displacement", "velocity", "acceleration", "mesh_force"}
            What to evaluate; exact, not a sum of harmonics.
        """
        which = KINDS.index(check_kind(kind))
        times = np.asarray(time_s, dtype=np.float64)
        phase = np.mod((times.ravel() - self.problem.start_s) / self.problem.period_s, 1.0)
        values = self.motion.values(phase)[which].reshape(times.shape)
        return np.asarray(values * self.problem.mass_kg if kind == "mesh_force" else values)

    def _push(self, time_s: Real) -> Real:
        """Mesh force, counted in the direction of the mean force."""
        return math.copysign(1.0, self.problem.mean_force_n) * self.at(time_s, "mesh_force")

    def _stations_s(self) -> Real:
        """Return times in [0, T) between which the mesh force is continuous and monotonic."""
        p = self.problem
        begins = np.cumsum(p.durations_s) - p.durations_s
        turns = np.concatenate([begins + t for t in self.motion.turning_times()])
        since = np.concatenate([begins, turns[np.isfinite(turns)]])
        return np.unique(np.append(np.mod(since + p.start_s, p.period_s), 0.0))

    def _falls(self, left: float, right: float) -> float:
        """Time at which the mesh force falls through zero, by repeated division into 64."""
        for _ in range(9):
            times = np.linspace(left, right, 65)
            k = int(np.argmax(self._push(times) <= 0))
            left, right = times[max(0, k - 1)], times[k]
        return float(right)


def solve_exactly(problem: PiecewiseProblem, harmonics: int | None = None) -> PiecewiseResponse:
    """Steady vibration in closed form.

    Parameters
    ----------
    problem : PiecewiseProblem
        The equation.
    harmonics : int, optional
        Highest harmonic of the lines wanted, >= 1; by default 64 or four times w0/w. Time
        functions (`PiecewiseResponse.at`, contact) do not depend on it.

    Returns
    -------
    PiecewiseResponse

    Raises
    ------
    ArgumentError
        If `harmonics` is out of its range, or if the equation has no periodic solution at all
        (undamped, on the boundary of instability).

    Examples
    --------
    >>> p = PiecewiseProblem.rectangular(0.28, 9e3, 8e8, 0.13, 0.5, 1.6e-3, 4e3)
    >>> r = solve_exactly(p)
    >>> float(round(1e6 * r.displacement[0].real, 6)), r.stable, r.contact_lost
    (5.083494, True, False)
    """
    if harmonics is None:
        harmonics = max(64, math.ceil(4 * problem.frequency_ratio))
    check_range("harmonics", harmonics, 1, MOST_HARMONICS)
    m = problem.mass_kg
    motion = PiecewiseMotion.solve(
        np.array(problem.damping_ns_per_m / (2 * m)),
        problem.stiffness_n_per_m / m,
        problem.durations_s,
        problem.force_pieces_n / m,
        problem.start_s,
    )
    if not np.isfinite(motion.z).all():
        raise ArgumentError(
            "the equation has no periodic solution: a multiplier is 1 and nothing damps it; "
            f"give damping_ns_per_m={problem.damping_ns_per_m} N s/m a value > 0"
        )
    lines = motion.lines(harmonics)
    stable = bool(motion.stable)
    error = _rounding_error(problem, motion, lines) if stable else math.inf
    return PiecewiseResponse(
        problem=problem,
        motion=motion,
        displacement=lines,
        error_bound=error,
        method="exact pieces",
        order=0,
        stable=stable,
        message=_message(problem, stable, error),
    )


def _rounding_error(problem: PiecewiseProblem, motion: PiecewiseMotion, lines: Complex) -> float:
    """Relative L2 error of the acceleration that rounding can make.

    Each radian of free vibration and each piece costs about one rounding of the state; the
    periodic condition multiplies it by the norm of (I - M)^-1.
    """
    w0 = 2 * math.pi * problem.natural_frequency_hz
    whole = motion.whole
    entries = [whole.n11, whole.n12 * w0, whole.n21 / w0, whole.n22]
    amplified = math.hypot(*map(float, entries)) / float(whole.determinant())
    steps = 2 * math.pi * problem.frequency_ratio + math.sqrt(len(motion.z))
    largest = float(np.hypot(motion.z, motion.v / w0).max()) * w0**2
    orders = np.arange(len(lines)) * problem.angular_frequency
    size = rms(orders**2 * lines)
    return 8 * ROUNDING * steps * (1 + amplified) * largest / size if size else math.inf


def _message(problem: PiecewiseProblem, stable: bool, error: float) -> str:
    pieces = f"{len(problem.durations_s)} pieces of constant stiffness solved exactly"
    if stable:
        return f"{pieces}: nothing truncated, rounding error about {error:.1g}"
    if problem.damping_ns_per_m == 0:
        return "undamped: free vibrations never die out, so no steady state is reached"
    return (
        f"unstable: free vibrations grow by {abs(multipliers(problem)[0]):.6g} a period (largest "
        "Floquet multiplier), so there is no steady state"
    )
