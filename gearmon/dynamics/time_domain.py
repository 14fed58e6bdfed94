"""Vibration by integration in time: start-up, lost contact, backlash.

Needs no theory and bounds no error, but follows teeth that part. The force of a mesh, counted in
the direction in which the steady load presses it, is

    max(0, k(t) d + c d') + min(0, k(t) (d + b) + c d'),    b the backlash,

so that the masses fly freely until spring and damper would press again, on either flank. A pair is
a machine of one mesh and one coordinate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.system import HillSystem
from gearmon.errors import ArgumentError, check_range
from gearmon.result import Result


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeHistory(Result):
    """A vibration as a time series.

    Attributes
    ----------
    time_s : float ndarray, shape (M,)
    displacement, velocity, acceleration : float ndarray, shape (M, n)
        [m], [m/s], [m/s2], the acceleration by the equation of motion.
    mesh_force : float ndarray, shape (M, meshes)
        [N], positive where the teeth are pressed together.
    apart : bool ndarray, shape (M, meshes)
        Where the teeth are apart.
    evaluations : int
        Calls of the right side.
    """

    time_s: Real
    displacement: Real
    velocity: Real
    acceleration: Real
    mesh_force: Real
    apart: npt.NDArray[np.bool_]
    evaluations: int


def system_of(p: HillProblem) -> HillSystem:
    """Return a pair as a machine of one coordinate, its damper between the teeth."""
    return HillSystem(
        np.array(p.mass_kg),
        np.zeros(1),
        np.zeros(1),
        np.ones(1),
        np.array(p.stiffness_n_per_m),
        p.stiffness_harmonics[None],
        p.period_s,
        np.array(p.force_n),
        force_harmonics_n=p.force_harmonics_n[:, None],
        mesh_damping_ns_per_m=np.array(p.damping_ns_per_m),
    )


def integrate(
    problem: HillProblem | HillSystem,
    time_s: npt.ArrayLike,
    state: npt.ArrayLike | None = None,
    backlash_m: float | None = None,
    relative_tolerance: float = 1e-9,
) -> TimeHistory:
    """Vibration from a state at the first of some times on.

    Parameters
    ----------
    problem : HillProblem or HillSystem
        The equation.
    time_s : float array, shape (M,)
        Ascending.
    state : float array, shape (2 n,), optional
        Displacements [m], then velocities [m/s]; by default all 0.
    backlash_m : float, optional
        b >= 0 of all meshes, `math.inf` for teeth that only part. By default the teeth stay
        together: the linear equation, also where it pulls.
    relative_tolerance : float
        Relative, of every step, 2.3e-14 to 0.1, by DOP853.

    Returns
    -------
    TimeHistory

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or the solver fails.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> h = integrate(p, [0.0, 4e-4, 8e-4])
    >>> h.displacement.shape, float(h.displacement[0, 0]), float(round(h.acceleration[0, 0]))
    ((3, 1), 0.0, 14286.0)
    """
    from scipy.integrate import solve_ivp

    check_range("relative_tolerance", relative_tolerance, 2.3e-14, 0.1)
    if backlash_m is not None and not backlash_m >= 0:
        raise ArgumentError(f"backlash_m={backlash_m} m must be >= 0")
    equation = _Equation(
        system_of(problem) if isinstance(problem, HillProblem) else problem, backlash_m
    )
    n, times = equation.coordinates, np.asarray(time_s, dtype=np.float64)
    start = np.zeros(2 * n) if state is None else np.asarray(state, dtype=np.float64)
    if start.shape != (2 * n,) or not np.isfinite(start).all():
        raise ArgumentError(f"state: {start} must be {2 * n} finite numbers")
    if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0).all():
        raise ArgumentError("time_s: must be a row of ascending times, two at least")
    size = relative_tolerance * equation.deflection
    found = solve_ivp(
        lambda t, x: np.concatenate([x[n:], equation.rates(t, x)[0]]),
        (times[0], times[-1]),
        start,
        method="DOP853",
        t_eval=times,
        rtol=relative_tolerance,
        atol=np.repeat([size, size * equation.fastest], n) * 1e-2,
    )
    if not found.success:
        raise ArgumentError(f"integration failed at {found.t[-1]:.6g} s: {found.message}")
    values = [equation.rates(t, x) for t, x in zip(times, found.y.T, strict=True)]
    rates, forces, apart = (np.array([row[i] for row in values]) for i in range(3))
    return TimeHistory(
        time_s=times,
        displacement=found.y[:n].T,
        velocity=found.y[n:].T,
        acceleration=rates,
        mesh_force=forces,
        apart=apart,
        evaluations=found.nfev,
    )


class _Equation:
    """Right side of the equations of motion; meshes are left to their own law."""

    def __init__(self, system: HillSystem, backlash_m: float | None) -> None:
        self.coordinates, self.backlash = len(system.mass), backlash_m
        self.inverse = np.linalg.inv(system.mass)
        damping = system.damping
        self.damping = damping if system.gyroscopic is None else damping + system.gyroscopic
        self.stiffness, self.vectors = system.stiffness, system.mesh_vectors
        self.means, self.w = system.mesh_stiffness_n_per_m, system.angular_frequency
        still = system.mesh_damping_ns_per_m
        self.dampers = np.zeros(len(self.means)) if still is None else still
        self.harmonics = 2 * system.mesh_harmonics
        self.force, more = system.force_n, system.force_harmonics_n
        self.swing: Complex | None = None if more is None else 2 * more.T
        at_rest = np.linalg.pinv(system.mean_stiffness, rcond=1e-9) @ system.force_n
        self.sign = np.where(self.vectors @ at_rest < 0, -1.0, 1.0)
        #: sizes of a deflection and a rate, for what is small beside them
        self.deflection = float(np.abs(at_rest).max()) or 1.0
        self.fastest = 2 * math.pi * float(system.natural_frequencies_hz[-1])

    def rates(self, time: float, state: Real) -> tuple[Real, Real, npt.NDArray[np.bool_]]:
        """Accelerations, mesh forces, and whether teeth are apart."""
        n = self.coordinates
        turns = np.exp(1j * self.w * time * np.arange(1, self.harmonics.shape[1] + 1))
        stiffness = self.means * (1 + (self.harmonics @ turns).real)
        deflection, rate = self.vectors @ state[:n], self.vectors @ state[n:]
        push = self.sign * (stiffness * deflection + self.dampers * rate)
        apart = np.zeros(len(push), dtype=bool)
        if self.backlash is not None:
            # an endless way leaves no back flank
            back = np.minimum(0.0, push + stiffness * min(self.backlash, 1e100))
            apart = (push < 0) & (back == 0)
            push = np.maximum(0.0, push) + np.where(push < 0, back, 0.0)
        force = self.force - self.stiffness @ state[:n] - self.damping @ state[n:]
        if self.swing is not None:
            lines = np.arange(1, self.swing.shape[1] + 1)
            force = force + (self.swing @ np.exp(1j * self.w * time * lines)).real
        forces = self.sign * push
        return self.inverse @ (force - self.vectors.T @ forces), forces, apart
