"""The start from rest by multiple scales, beside direct integration."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearmon.dynamics import Response
from gearmon.dynamics.motion import transient
from gearmon.gears.pulses import FloatArray
from gearmon.study.reference_case import MeshParameters
from gearmon.study.trajectories import Modulation, Trajectory, motion, series, simulate

#: Order of the free vibration that dies out after the start.
FREE_ORDER = 6
#: Harmonics of the stiffness that the free vibration sees.
FREE_HARMONICS = 100
# Both free vibrations coincide at critical damping, where they cannot be expanded one by one.
NEAR_CRITICAL = (0.95, 1.05)


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """Motion from rest.

    Attributes
    ----------
    motion : Trajectory
    error : float
        Largest difference of the displacement to direct integration, over the largest
        displacement; 0 where `motion` is that integration.
    method : str
        "multiple scales" or "direct integration".
    """

    motion: Trajectory
    error: float
    method: str


def start_from_rest(
    parameters: MeshParameters, steady: Response, periods: int, points: int
) -> Start:
    """Solve the start by multiple scales and measure its error against direct integration.

    Parameters
    ----------
    parameters : MeshParameters
    steady : Response
        What the motion settles to.
    periods, points : int
        Number of mesh periods, and of points in each.

    Returns
    -------
    Start
        By direct integration where the damping is within 5 % of the critical one.
    """
    time = np.arange(periods * points + 1) / points * parameters.period_s
    modulation = series(steady.problem.stiffness_harmonics)
    simulated = simulate(parameters, modulation, time, tolerance=1e-8)
    if NEAR_CRITICAL[0] < steady.problem.damping_ratio < NEAR_CRITICAL[1]:
        return Start(motion=simulated, error=0.0, method="direct integration")
    found = solved_start(parameters, steady, modulation, time)
    apart = np.abs(found.displacement_m - simulated.displacement_m).max()
    return Start(
        motion=found,
        error=float(apart / np.abs(simulated.displacement_m).max()),
        method="multiple scales",
    )


def solved_start(
    parameters: MeshParameters, steady: Response, modulation: Modulation, time_s: FloatArray
) -> Trajectory:
    """Add to the steady vibration the free one that brings it to rest at t = 0.

    The free vibration has the damping in order zero and `FREE_HARMONICS` of the stiffness.
    """
    kept = steady.problem.stiffness_harmonics[:FREE_HARMONICS]
    unforced = replace(steady.problem, force_n=0.0, stiffness_harmonics=kept)
    displacement, velocity = (float(steady.at(0.0, kind)) for kind in ("displacement", "velocity"))
    free = transient(unforced, -displacement, -velocity, FREE_ORDER)
    return motion(
        parameters,
        modulation,
        time_s,
        steady.at(time_s) + free.at(time_s),
        steady.at(time_s, "velocity") + free.at(time_s, "velocity"),
    )
