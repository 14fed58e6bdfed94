"""What time integration hands out: time series, and the lines of a last period."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.fourier import Complex, Real, fast_length
from gearmon.dynamics.time_marching import Leg, March, Periodic, Scaled, Solver, scaled
from gearmon.errors import check_range

#: Points of Gauss's rule on a stretch over which the fastest part turns by PANEL radians.
GAUSS_POINTS = 12
PANEL = 4.0


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeHistory:
    """A vibration as a time series.

    Attributes
    ----------
    time_s, displacement, velocity, acceleration, mesh_force : float ndarray, shape (M,)
        [s], [m], [m/s], [m/s2], [N]; acceleration and mesh force by the equation of motion, not by
        differences. At a jump the values after it.
    apart : bool ndarray, shape (M,)
        Where the teeth are apart.
    evaluations : int
        Calls of the right side.
    solver : str
    """

    time_s: Real
    displacement: Real
    velocity: Real
    acceleration: Real
    mesh_force: Real
    apart: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    evaluations: int
    solver: Solver


@dataclass(frozen=True, kw_only=True, eq=False)
class IntegratedResponse:
    """Periodic vibration found by time integration.

    Attributes
    ----------
    problem : HillProblem or PiecewiseProblem
    displacement, velocity, acceleration, mesh_force : complex ndarray, shape (N+1,)
        Fourier coefficients 0..N of the last period [m, m/s, m/s2, N], each from its own time
        function; the acceleration is by the equation of motion.
    history : TimeHistory
        Last period.
    periods : int
        Periods marched through.
    evaluations : int
        Calls of the right side in all.
    defect : float
        Change of state over the last period, relative to the rms swing of the state.
    error_bound : float
        Infinite: time integration bounds nothing.
    method : str
        "integration" or "shooting", with the solver.
    order : int
        0.
    stable : bool or None
        Shooting: whether both multipliers lie inside the unit circle. Settling: whether the motion
        settled; None if it had not yet.
    floquet_multipliers : (complex, complex) or None
        Shooting only.
    parted_at_rad : float or None
        First angle w t, counted from the start of the march, at which the teeth parted
        (one-sided contact only).
    message : str
    """

    problem: Periodic
    displacement: Complex
    velocity: Complex
    acceleration: Complex
    mesh_force: Complex
    history: TimeHistory
    periods: int
    evaluations: int
    defect: float
    error_bound: float
    method: str
    order: int
    stable: bool | None
    floquet_multipliers: tuple[complex, complex] | None
    parted_at_rad: float | None
    message: str

    @property
    def frequency_hz(self) -> Real:
        """Frequencies n/T [Hz], shape (N+1,)."""
        return np.arange(len(self.displacement)) / self.problem.period_s

    @property
    def energy_lines(self) -> Real:
        """E_n = (2 pi f_n A_n)^2/2 [J/kg] of each line, A_n = 2|z_n|, shape (N+1,)."""
        energy: Real = 2 * np.abs(self.velocity) ** 2
        return energy

    @property
    def contact_lost(self) -> bool:
        """Whether the mesh force is <= 0 somewhere on the points of the last period."""
        force = self.history.mesh_force * scaled(self.problem).sign
        return bool(self.history.apart.any() or (force <= 0).any())


def defect_of(before: list[float], after: list[float], legs: list[Leg], system: Scaled) -> float:
    """Return the change of state over the last period, relative to the rms swing of the state."""
    s, weights = _quadrature(legs, 1.0)
    states = np.concatenate([np.array(leg.values(x, system.zeta)[:2]) for leg, x in s], axis=1)
    share = np.concatenate(weights) / system.period
    swing = states - (states * share).sum(axis=1, keepdims=True)
    size = math.sqrt(float((swing**2 * share).sum()))
    change = math.hypot(after[0] - before[0], after[1] - before[1])
    return change / size if size else change


def _quadrature(legs: list[Leg], fastest: float) -> tuple[list[tuple[Leg, Real]], list[Real]]:
    """Gauss points and weights of each leg, for parts that turn by up to `fastest` rad a unit."""
    x, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    points, weights = [], []
    for leg in legs:
        panels = max(1, math.ceil((leg.end - leg.start) * max(1.0, fastest) / PANEL))
        width = (leg.end - leg.start) / panels
        begins = leg.start + width * np.arange(panels)
        points.append((leg, (begins[:, None] + width * (x + 1) / 2).ravel()))
        weights.append(np.tile(w * width / 2, panels))
    return points, weights


def response(
    march: March,
    legs: list[Leg],
    harmonics: int,
    points: int,
    periods: int,
    defect: float,
    stable: bool | None,
    pair: tuple[complex, complex] | None,
    message: str,
) -> IntegratedResponse:
    """Return the lines and the time series of the last period, whose legs are given."""
    check_range("points", points, 2, 10_000_000)
    system = march.system
    lines = _lines(legs, system, harmonics)
    begin = legs[0].start
    steps: Real = np.arange(points, dtype=np.float64)
    last = history(march, legs, begin + steps * (system.period / points))
    units = _units(system)
    parted = march.parted_at
    kind = "shooting" if pair is not None else "integration"
    return IntegratedResponse(
        problem=system.problem,
        displacement=lines[0] * units[0],
        velocity=lines[1] * units[1],
        acceleration=lines[2] * units[2],
        mesh_force=lines[3] * units[3],
        history=last,
        periods=periods,
        evaluations=march.evaluations,
        defect=defect,
        error_bound=math.inf,
        method=f"{kind} ({march.integrator.solver})",
        order=0,
        stable=stable,
        floquet_multipliers=pair,
        parted_at_rad=None if parted is None else 2 * math.pi * parted / system.period,
        message=message,
    )


def _units(system: Scaled) -> Real:
    d, w0 = system.size_m, system.w0
    return np.array([d, d * w0, d * w0**2, system.problem.mass_kg * d * w0**2])


def _lines(legs: list[Leg], system: Scaled, harmonics: int) -> Complex:
    """Fourier coefficients of y, y', y'' and the mesh force over one period, shape (4, N+1)."""
    period = system.period
    if len(legs) == 1:
        # smooth and periodic: equal steps are as good as any
        length = fast_length(max(256, 4 * harmonics + 16, math.ceil(8 * period)))
        steps: Real = np.arange(length, dtype=np.float64)
        s = legs[0].start + steps * (period / length)
        values = np.array(legs[0].values(s, system.zeta))
        found: Complex = np.fft.rfft(values, norm="forward", axis=1)[:, : harmonics + 1]
        return found
    total = np.zeros((4, harmonics + 1), dtype=np.complex128)
    orders = np.arange(harmonics + 1)
    points, weights = _quadrature(legs, 2 * math.pi * harmonics / period)
    for (leg, s), weight in zip(points, weights, strict=True):
        turns = np.exp(-2j * math.pi / period * np.mod(s, period)[:, None] * orders)
        total += (np.array(leg.values(s, system.zeta)) * weight) @ turns / period
    return total


def history(march: March, legs: list[Leg], s: Real) -> TimeHistory:
    """Return the motion at s, in units."""
    system = march.system
    values = np.empty((4, len(s)))
    apart = np.zeros(len(s), dtype=bool)
    # a point on a jump, up to rounding, takes the values after it
    jumps = np.array([leg.start for leg in legs[1:]]) - 1e-12 * system.period
    first = np.searchsorted(s, jumps)
    edges = [0, *first.tolist(), len(s)]
    for leg, low, high in zip(legs, edges[:-1], edges[1:], strict=True):
        if high > low:
            values[:, low:high] = leg.values(s[low:high], system.zeta)
            apart[low:high] = leg.apart
    z, v, a, force = values * _units(system)[:, None]
    return TimeHistory(
        time_s=s / system.w0,
        displacement=z,
        velocity=v,
        acceleration=a,
        mesh_force=force,
        apart=apart,
        evaluations=march.evaluations,
        solver=march.integrator.solver,
    )
