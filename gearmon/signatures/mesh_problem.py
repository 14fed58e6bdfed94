"""Hill's equation of one healthy mesh of a machine, for whoever wants to look at it by itself."""

from __future__ import annotations

from gearmon.dynamics.hill import HillProblem
from gearmon.errors import ArgumentError, check_range
from gearmon.gears.mechanics import stage_mechanics
from gearmon.machine import Machine


def mesh_problem(
    machine: Machine,
    stage: int = 1,
    operating: int = 0,
    *,
    form: str = "parabolic",
    harmonics: int = 32,
    mesh: int = 0,
) -> HillProblem:
    """Return the equation of a healthy mesh at an operating point.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs; what is missing is named in the error.
    stage, operating : int
        Stage counted from 1, operating point from 0.
    form : str
        Form of the stiffness curve.
    harmonics : int, 1 to 10,000
        Stiffness harmonics taken.
    mesh : int
        Of a planetary stage 0 for sun and planet, 1 for planet and ring.

    Raises
    ------
    ArgumentError
        If there is no such stage or operating point, or the machine lacks data.
    """
    check_range("stage", stage, 1, len(machine.stages))
    check_range("operating", operating, 0, len(machine.operating) - 1)
    check_range("harmonics", harmonics, 1, 10_000)
    if machine.operating[operating].torque_nm == 0:
        raise ArgumentError(f"operating[{operating + 1}]: torque_nm is 0, no tooth is pressed")
    mechanics = stage_mechanics(machine, stage, machine.operating[operating], form=form, mesh=mesh)
    return HillProblem(
        mass_kg=mechanics.equivalent_mass_kg,
        damping_ns_per_m=mechanics.damping_ns_per_m,
        stiffness_n_per_m=mechanics.stiffness.mean_n_per_m,
        stiffness_harmonics=mechanics.stiffness.harmonics(harmonics),
        period_s=1 / mechanics.mesh_frequency_hz,
        force_n=mechanics.force_n,
    )
