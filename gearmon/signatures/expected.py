"""Gear data -> stiffness -> Hill's equation -> the lines that a machine should show.

Each mesh is solved by itself, at one operating point. A healthy mesh repeats every mesh period;
with damaged teeth on one gear it repeats every turn of that gear, with damage on both gears after
the hunting period, and the full coupled problem is solved over that period. Lines are those of the
deflection along the line of action, before any path to a sensor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import HillProblem, Method, Response, steady_state
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.faults import Fault, faults_of_stage, parse_fault
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.machine import Machine, OperatingPoint
from gearmon.signatures.signature import Signature

#: Most stiffness harmonics of one problem.
MOST_HARMONICS = 200_000
#: Effect of stiffness harmonics above J over A^2 (R/J)^3, see `_stiffness_harmonics`.
CUT_FACTOR = 6.0


@dataclass(frozen=True, kw_only=True)
class StageLines:
    """Lines of one mesh.

    Attributes
    ----------
    mechanics : StageMechanics
        What was solved.
    mesh_order : float
        Order of the mesh frequency.
    response : Response
        The solution over the true period.
    cut : float
        Estimate of the relative error from stiffness harmonics that were left out.
    max_hz : float
        Highest frequency asked for.
    """

    mechanics: StageMechanics
    mesh_order: float
    response: Response
    cut: float
    max_hz: float


def expected_signature(
    machine: Machine,
    faults: Iterable[Fault | str] = (),
    tolerance: float = 1e-6,
    max_hz: float | None = None,
    operating: int = 0,
    *,
    form: str = "parabolic",
    method: Method = "auto",
    order: int | None = None,
) -> Signature:
    """Lines that a machine should show at one operating point.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs; what is missing is named in the error.
    faults : iterable of Fault or str
        Damaged teeth, such as "crack:1:pinion:5:20%".
    tolerance : float
        Relative L2 error of the acceleration of the lines of each stage, 1e-13 to 1.
    max_hz : float, optional
        Highest frequency [Hz], > 0. By default each stage is shown up to 10 mesh harmonics or 2
        natural frequencies, whichever is higher.
    operating : int
        Which operating point of the machine, counted from 0.
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.
    method, order
        As in `dynamics.steady_state`.

    Returns
    -------
    Signature
        Origin "expected". The header holds the numbers of stage 1 and, under "stages", those of
        each stage.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or the machine lacks data.

    Notes
    -----
    `error_bound` is the guaranteed bound of the solution for the stiffness harmonics taken,
    plus an estimate of what the others would change (`stiffness_cut`, from their 1/n fall). Lines
    are attributed to the nearest mesh harmonic. With damage on both gears, lines that belong to
    neither shaft are not listed; their share of the acceleration is given as `cross_lines_share`.
    """
    point = _operating_point(machine, operating)
    known = _faults(machine, faults)
    if max_hz is not None:
        check_positive("max_hz", max_hz, "Hz")
    check_range("tolerance", tolerance, 1e-13, 1.0)
    train = kinematics(machine)
    solved = []
    for number in range(1, len(machine.stages) + 1):
        own = faults_of_stage(known, number)
        mesh = 1 if any(fault.gear == "ring" for fault in own) else 0
        mechanics = stage_mechanics(machine, number, point, faults=own, form=form, mesh=mesh)
        limit = _limit(mechanics, max_hz)
        solved.append(_solve(mechanics, train.mesh(number).order, limit, tolerance, method, order))
    tables = [_table(stage) for stage in solved]
    columns = {name: np.concatenate([table[name] for table, _ in tables]) for name in tables[0][0]}
    if max_hz is not None and not len(columns["stage"]):
        lowest = min(stage.mechanics.mesh_frequency_hz for stage in solved)
        raise ArgumentError(
            f"max_hz={max_hz} Hz lies below the lowest mesh frequency, {lowest:.6g} Hz: no lines"
        )
    stages = [
        _stage_header(stage, tolerance, share)
        for stage, (_, share) in zip(solved, tables, strict=True)
    ]
    header = stages[0] | {
        "speed_rpm": point.speed_rpm,
        "torque_nm": point.torque_nm,
        "operating": point.name,
        "faults": [str(fault) for fault in known],
        "tolerance": tolerance,
        "amplitudes": "peak; phase of the displacement as a cosine when tooth 1 enters contact",
        "stages": stages,
    }
    del header["stage"]
    return Signature(machine=machine.name, origin="expected", header=header, columns=columns)


def _operating_point(machine: Machine, operating: int) -> OperatingPoint:
    if not 0 <= operating < len(machine.operating):
        raise ArgumentError(
            f"operating={operating} must lie in [0, {len(machine.operating) - 1}]: the machine has "
            f"{len(machine.operating)} operating points, counted from 0"
        )
    return machine.operating[operating]


def _faults(machine: Machine, faults: Iterable[Fault | str]) -> tuple[Fault, ...]:
    known = tuple(parse_fault(fault) if isinstance(fault, str) else fault for fault in faults)
    for fault in known:
        if fault.stage > len(machine.stages):
            raise ArgumentError(
                f"fault {fault}: stage {fault.stage} must lie in [1, {len(machine.stages)}]"
            )
    return known


def _limit(mechanics: StageMechanics, max_hz: float | None) -> float:
    if max_hz is not None:
        return max_hz
    return max(10 * mechanics.mesh_frequency_hz, 2 * mechanics.natural_frequency_hz)


def _solve(
    mechanics: StageMechanics,
    mesh_order: float,
    max_hz: float,
    tolerance: float,
    method: Method,
    order: int | None,
) -> StageLines:
    shown = max(1, math.floor(max_hz * mechanics.period_s * (1 + 1e-12)))
    harmonics, cut = _stiffness_harmonics(mechanics, shown, tolerance)
    problem = HillProblem(
        mass_kg=mechanics.equivalent_mass_kg,
        damping_ns_per_m=mechanics.damping_ns_per_m,
        stiffness_n_per_m=mechanics.stiffness.mean_n_per_m,
        stiffness_harmonics=harmonics,
        period_s=mechanics.period_s,
        force_n=mechanics.force_n,
    )
    response = steady_state(
        problem, max(0.6 * tolerance, 1e-13), method=method, order=order, harmonics=shown
    )
    return StageLines(
        mechanics=mechanics, mesh_order=mesh_order, response=response, cut=cut, max_hz=max_hz
    )


def _stiffness_harmonics(
    mechanics: StageMechanics, shown: int, tolerance: float
) -> tuple[npt.NDArray[np.complex128], float]:
    """As many stiffness harmonics as the tolerance takes, and what the others may change.

    A stiffness with jumps has |c_n| = A/n. Harmonics above J reach the lines shown only through
    the lines that they make themselves, A (R/n)^2/n each: together a share of about A^2 (R/J)^3.
    """
    stiffness = mechanics.stiffness
    meshes = stiffness.period_mesh
    ratio = mechanics.natural_frequency_hz / mechanics.mesh_frequency_hz
    most = max(MOST_HARMONICS // meshes, math.ceil(shown / meshes), 8)
    count = min(most, max(32, math.ceil(2 * ratio), math.ceil(shown / meshes)))
    while True:
        harmonics = stiffness.harmonics(count * meshes)
        orders = np.arange(1, count * meshes + 1) / meshes
        blocks = (np.abs(harmonics * orders) ** 2).reshape(count, meshes).sum(axis=1)
        cut = CUT_FACTOR * float(blocks[-8:].max()) * (ratio / count) ** 3
        if cut <= 0.3 * tolerance or count == most:
            return harmonics, cut
        count = min(most, math.ceil(1.05 * count * (cut / (0.3 * tolerance)) ** (1 / 3)) + 1)


def _table(stage: StageLines) -> tuple[dict[str, npt.NDArray[Any]], float]:
    """Columns of the lines of one stage, and the share of acceleration in lines of no family."""
    response, meshes = stage.response, stage.mechanics.stiffness.period_mesh
    lines = np.arange(1, len(response.displacement))
    harmonic = np.ceil(lines / meshes - 0.5).astype(int)
    sideband, name = _attribution(stage.mechanics, lines, lines - harmonic * meshes)
    frequency = lines / meshes * stage.mechanics.mesh_frequency_hz
    known = (name != "?") & (frequency <= stage.max_hz * (1 + 1e-12))
    energy = np.abs(response.acceleration[1:]) ** 2
    strange = float(energy[name == "?"].sum() / energy.sum()) if energy.any() else 0.0
    z = response.displacement[1:]
    columns = {
        "stage": np.full(len(lines), stage.mechanics.stage),
        "mesh_harmonic": harmonic,
        "sideband": sideband,
        "sideband_of": name,
        "order": lines / meshes * stage.mesh_order,
        "frequency_hz": frequency,
        "displacement_m": 2 * np.abs(z),
        "velocity_ms": 2 * np.abs(response.velocity[1:]),
        "acceleration_ms2": 2 * np.abs(response.acceleration[1:]),
        "phase_rad": np.angle(z),
    }
    return {key: column[known] for key, column in columns.items()}, math.sqrt(strange)


def _attribution(
    mechanics: StageMechanics, lines: npt.NDArray[np.int_], distance: npt.NDArray[np.int_]
) -> tuple[npt.NDArray[np.int_], npt.NDArray[np.str_]]:
    """Sideband number and modulating gear of each line; "?" for lines of no single gear."""
    stiffness = mechanics.stiffness
    number = np.zeros(len(lines), dtype=int)
    name = np.full(len(lines), "?", dtype="U16")
    for train in stiffness.pulses:
        step = stiffness.period_mesh // train.period_mesh
        if " and " in train.gear:
            continue
        own = (lines % step == 0) & (name == "?")
        name[own] = train.gear
        number[own] = distance[own] // step
    mesh = distance == 0
    name[mesh] = ""
    number[mesh] = 0
    return number, name


def _warnings(stage: StageLines, tolerance: float) -> list[str]:
    """Say where the linear model ends or the accuracy asked for was not reached."""
    response, found = stage.response, []
    if response.stable is False:
        found.append(response.message)
    elif response.error_bound + stage.cut > tolerance:
        bound = response.error_bound + stage.cut
        found.append(f"error bound {bound:.2g} misses the tolerance {tolerance:.2g}")
    if response.contact_loss_angle_rad is not None:
        turns = response.contact_loss_angle_rad / (2 * math.pi)
        phase = turns * stage.mechanics.stiffness.period_mesh
        found.append(
            f"teeth lose contact, first at mesh phase {phase:.4g}: the linear model ends there"
        )
    return found


def _stage_header(stage: StageLines, tolerance: float, cross_lines_share: float) -> dict[str, Any]:
    mechanics, response = stage.mechanics, stage.response
    stiffness = mechanics.stiffness
    return {
        "stage": mechanics.stage,
        "mesh": mechanics.mesh,
        "mesh_frequency_hz": mechanics.mesh_frequency_hz,
        "mean_stiffness_n_per_m": stiffness.mean_n_per_m,
        "stiffness_variation": stiffness.variation,
        "contact_ratio": stiffness.contact_ratio,
        "overlap_ratio": stiffness.overlap_ratio,
        "natural_frequency_hz": mechanics.natural_frequency_hz,
        "damping_ratio": mechanics.damping_ratio,
        "equivalent_mass_kg": mechanics.equivalent_mass_kg,
        "damping_ns_per_m": mechanics.damping_ns_per_m,
        "force_n": mechanics.force_n,
        "period_mesh": stiffness.period_mesh,
        "mean_deflection_m": float(response.displacement[0].real),
        "max_hz": stage.max_hz,
        "method": response.method,
        "order_used": response.order,
        "error_bound": response.error_bound + stage.cut,
        "stiffness_harmonics": len(response.problem.stiffness_harmonics),
        "stiffness_cut": stage.cut,
        "stable": response.stable,
        "contact_lost": response.contact_lost,
        "contact_loss_angle_rad": response.contact_loss_angle_rad,
        "cross_lines_share": cross_lines_share,
        "message": f"{response.message}; stiffness harmonics left out: {stage.cut:.2g}",
        "assumptions": list(mechanics.assumptions),
        "warnings": [*mechanics.warnings, *_warnings(stage, tolerance)],
    }
