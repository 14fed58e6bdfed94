"""Exact steady vibration where the mesh stiffness is constant piece by piece.

    m z'' + c z' + k(t) z = F(t),    k(t) = k_i and F(t) = F_i during tau_i,  i = 1..P, periodic

A rectangular mesh stiffness (one and two pairs in contact in turn) is the case P = 2. Nothing is
truncated: the state is moved through each piece in closed form, and the Fourier coefficients are
those of the true motion with its jumps of acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real, rms
from gearmon.dynamics.hill import frozen_vector
from gearmon.dynamics.piecewise_motion import PiecewiseMotion
from gearmon.dynamics.piecewise_problem import MOST_HARMONICS, PiecewiseProblem, multipliers
from gearmon.errors import ArgumentError, check_range

__all__ = ["PiecewiseProblem", "PiecewiseResponse", "multipliers", "solve_exactly", "sweep"]

ROUNDING = 2.0**-52


@dataclass(frozen=True, kw_only=True, eq=False)
class PiecewiseResponse:
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

    @cached_property
    def velocity(self) -> Complex:
        """Velocity i n w z_n [m/s], shape (N+1,)."""
        return 1j * self._angular * self.displacement

    @cached_property
    def acceleration(self) -> Complex:
        """Acceleration -(n w)^2 z_n [m/s2], shape (N+1,); with its jumps, none of it cut."""
        return -(self._angular**2) * self.displacement

    @cached_property
    def mesh_force(self) -> Complex:
        """Coefficients of k(t) z + c z' = F(t) - m z'' [N], shape (N+1,)."""
        force = self.problem.harmonics_of(self.problem.force_n, len(self.displacement) - 1)
        return force - self.problem.mass_kg * self.acceleration

    @property
    def frequency_hz(self) -> Real:
        """Frequencies n/T [Hz], shape (N+1,)."""
        return np.arange(len(self.displacement)) / self.problem.period_s

    @property
    def energy_lines(self) -> Real:
        """E_n = (2 pi f_n A_n)^2/2 [J/kg] of each line, A_n = 2|z_n|, shape (N+1,)."""
        energy: Real = 2 * np.abs(self.velocity) ** 2
        return energy

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
        kinds = ("displacement", "velocity", "acceleration", "mesh_force")
        if kind not in kinds:
            raise ArgumentError(
                f"kind={kind!r} must be displacement, velocity, acceleration or mesh_force"
            )
        times = np.asarray(time_s, dtype=np.float64)
        phase = np.mod((times.ravel() - self.problem.start_s) / self.problem.period_s, 1.0)
        values = self.motion.values(phase)[kinds.index(kind)].reshape(times.shape)
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

    @property
    def _angular(self) -> Real:
        lines = np.arange(len(self.displacement), dtype=np.float64)
        return np.asarray(lines * self.problem.angular_frequency)


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


def sweep(
    mass_kg: npt.ArrayLike,
    damping_ns_per_m: npt.ArrayLike,
    stiffness_n_per_m: npt.ArrayLike,
    durations_s: npt.ArrayLike,
    force_n: npt.ArrayLike,
) -> PiecewiseMotion:
    """Exact steady vibration of many systems at once.

    Parameters
    ----------
    mass_kg, damping_ns_per_m : float array, shape (...,)
        m > 0 and c > 0.
    stiffness_n_per_m, durations_s : float array, shape (..., P)
        k_i > 0 and tau_i > 0; the pieces on the last axis.
    force_n : float array, shape (...,) or (..., P)
        F. With one axis more than the systems its last axis is the pieces.

    Returns
    -------
    PiecewiseMotion
        States of all systems; its `lines`, `values`, `least_push` and `stable` work on all at
        once. Multiply `least_push` by the mass to have the mesh force [N].

    Raises
    ------
    ArgumentError
        If a value is not finite or out of its range.

    Examples
    --------
    >>> found = sweep(0.28, np.array([3e3, 9e3]), 8e8 * np.array([1.1, 0.9]), [8e-4, 8e-4], 4e3)
    >>> found.lines(3).shape, found.stable.tolist()
    ((2, 4), [True, True])
    """
    m, c, k, tau = (
        _all_positive(name, values)
        for name, values in (
            ("mass_kg", mass_kg),
            ("damping_ns_per_m", damping_ns_per_m),
            ("stiffness_n_per_m", stiffness_n_per_m),
            ("durations_s", durations_s),
        )
    )
    force = np.asarray(force_n, dtype=np.float64)
    if not np.isfinite(force).all():
        raise ArgumentError("force_n: all values must be finite")
    systems = np.broadcast_shapes(m.shape, c.shape, k.shape[:-1], tau.shape[:-1])
    pieces = k.shape[-1]
    if force.ndim <= len(systems):
        force = force[..., None]

    def first(values: Real) -> Real:
        return np.moveaxis(np.broadcast_to(values, (*systems, pieces)), -1, 0)

    return PiecewiseMotion.solve(
        first((c / (2 * m))[..., None]),
        first(k / m[..., None]),
        first(tau),
        first(force / m[..., None]),
    )


def _all_positive(name: str, values: npt.ArrayLike) -> Real:
    array = np.asarray(values, dtype=np.float64)
    if not (array > 0).all() or not np.isfinite(array).all():
        raise ArgumentError(f"{name}: all values must be finite and > 0")
    return array
