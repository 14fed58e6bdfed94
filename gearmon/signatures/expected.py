"""Gear data -> stiffness -> Hill's equation -> the lines that a machine should show.

Each mesh is solved by itself, at one operating point. A healthy mesh repeats every mesh period;
with damaged teeth or errors on one gear it repeats every turn of that gear, with both gears marked
after the hunting period (see `stage_lines`). Errors and lost profile act as displacement excitation
e(t) in ``m z'' + c (z - e)' + k(t) (z - e) = F``. Lines are those of the motion z along the line of
action, before any path to a sensor: without errors the deflection of the teeth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import Method
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.excitation import Excitation, displacement_excitation
from gearmon.gears.faults import Fault, GearError, parse_fault_or_error
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.gears.pairs import mesh_pairs
from gearmon.machine import Machine, OperatingPoint
from gearmon.signatures.signature import Signature
from gearmon.signatures.stage_lines import StageLines, stage_lines


def expected_signature(
    machine: Machine,
    faults: Iterable[Fault | GearError | str] = (),
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
    faults : iterable of Fault, GearError or str
        Damaged teeth, such as "crack:1:pinion:5:20%", and errors of gears, such as
        "eccentricity:1:gear:all:20um".
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
    `error_bound` is the guaranteed bound of the solution for the harmonics taken of stiffness and
    excitation, plus an estimate of what the others would change (`stiffness_cut`, from their 1/n
    fall). With both gears marked, method "auto" adds the vibrations with either marked; what
    damaged gears then do to one another is estimated (`superposition_error`) and part of
    `error_bound`. Every other method solves the hunting period as a whole: seconds in place of a
    fraction. Lines are attributed to the nearest mesh harmonic. Lines that belong to neither shaft
    are not listed; where they were solved for, their share of the acceleration is given as
    `cross_lines_share`.
    """
    point = _operating_point(machine, operating)
    known = _faults(machine, faults)
    if max_hz is not None:
        check_positive("max_hz", max_hz, "Hz")
    check_range("tolerance", tolerance, 1e-13, 1.0)
    train = kinematics(machine)
    solved = []
    for number in range(1, len(machine.stages) + 1):
        own = [fault for fault in known if fault.stage == number]
        mesh = 1 if any(fault.gear == "ring" for fault in own) else 0
        faulty = [fault for fault in own if isinstance(fault, Fault)]
        errors = [error for error in own if isinstance(error, GearError)]
        mechanics = stage_mechanics(
            machine, number, point, faults=faulty, errors=errors, form=form, mesh=mesh
        )
        excitation = _excitation(machine, mechanics, own, mesh)
        limit = _limit(mechanics, max_hz)
        solved.append(stage_lines(mechanics, excitation, limit, tolerance, method, order))
    orders = [train.mesh(number).order for number in range(1, len(solved) + 1)]
    tables = [_table(stage, order) for stage, order in zip(solved, orders, strict=True)]
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


def _faults(
    machine: Machine, faults: Iterable[Fault | GearError | str]
) -> tuple[Fault | GearError, ...]:
    known = tuple(
        parse_fault_or_error(fault) if isinstance(fault, str) else fault for fault in faults
    )
    for fault in known:
        if fault.stage > len(machine.stages):
            raise ArgumentError(
                f"fault {fault}: stage {fault.stage} must lie in [1, {len(machine.stages)}]"
            )
    return known


def _excitation(
    machine: Machine, mechanics: StageMechanics, own: list[Fault | GearError], mesh: int
) -> Excitation | None:
    """Return the displacement excitation of a stage, or None if nothing moves the flanks."""
    if not own:
        return None
    pair = mesh_pairs(machine.stages[mechanics.stage - 1], mechanics.stage, machine.path)[mesh]
    errors = [error for error in own if isinstance(error, GearError)]
    faults = [fault for fault in own if isinstance(fault, Fault)]
    found = displacement_excitation(pair, mechanics.stiffness, errors, faults)
    return found if found.errors or found.warnings else None


def _limit(mechanics: StageMechanics, max_hz: float | None) -> float:
    if max_hz is not None:
        return max_hz
    return max(10 * mechanics.mesh_frequency_hz, 2 * mechanics.natural_frequency_hz)


def _table(stage: StageLines, mesh_order: float) -> tuple[dict[str, npt.NDArray[Any]], float]:
    """Columns of the lines of one stage, and the share of acceleration in lines of no family."""
    meshes, lines, frequency = stage.period_mesh, stage.lines, stage.frequency_hz
    harmonic = np.ceil(lines / meshes - 0.5).astype(int)
    sideband, name = _attribution(stage, lines, lines - harmonic * meshes)
    known = (name != "?") & (frequency <= stage.max_hz * (1 + 1e-12))
    z, angular = stage.displacement, 2 * np.pi * frequency
    energy = np.abs(stage.acceleration) ** 2
    strange = float(energy[name == "?"].sum() / energy.sum()) if energy.any() else 0.0
    columns = {
        "stage": np.full(len(lines), stage.mechanics.stage),
        "mesh_harmonic": harmonic,
        "sideband": sideband,
        "sideband_of": name,
        "order": lines / meshes * mesh_order,
        "frequency_hz": frequency,
        "displacement_m": 2 * np.abs(z),
        "velocity_ms": 2 * angular * np.abs(z),
        "acceleration_ms2": 2 * angular**2 * np.abs(z),
        "phase_rad": np.angle(z),
    }
    return {key: column[known] for key, column in columns.items()}, math.sqrt(strange)


def _attribution(
    stage: StageLines, lines: npt.NDArray[np.int_], distance: npt.NDArray[np.int_]
) -> tuple[npt.NDArray[np.int_], npt.NDArray[np.str_]]:
    """Sideband number and modulating gear of each line; "?" for lines of no single gear."""
    number = np.zeros(len(lines), dtype=int)
    name = np.full(len(lines), "?", dtype="U16")
    for gear, teeth in stage.marked.items():
        step = stage.period_mesh // teeth
        own = (lines % step == 0) & (name == "?")
        name[own] = gear
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
    elif stage.error_bound > tolerance:
        found.append(f"error bound {stage.error_bound:.2g} misses the tolerance {tolerance:.2g}")
    if stage.superposed:
        found.append(
            "what marks both gears was solved gear by gear and added; the effect of one on the "
            f"other is estimated as {stage.superposed:.2g} of the acceleration"
        )
    if stage.contact_loss is not None:
        when = "first at" if stage.superposed is None else "at worst at"
        found.append(
            f"teeth lose contact, {when} mesh phase {stage.contact_loss:.4g}: the linear model "
            f"ends there"
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
        "period_mesh": stage.period_mesh,
        "mean_deflection_m": stage.mean_m,
        "max_hz": stage.max_hz,
        "method": response.method,
        "order_used": response.order,
        "error_bound": stage.error_bound,
        "stiffness_harmonics": len(response.problem.stiffness_harmonics),
        "stiffness_cut": stage.cut,
        "stable": response.stable,
        "contact_lost": stage.contact_loss is not None,
        "contact_loss_angle_rad": _contact_loss_angle(stage),
        "superposition_error": stage.superposed,
        "cross_lines_share": cross_lines_share,
        "message": f"{response.message}; stiffness harmonics left out: {stage.cut:.2g}",
        "assumptions": list(mechanics.assumptions),
        "warnings": [*mechanics.warnings, *_warnings(stage, tolerance)],
    }


def _contact_loss_angle(stage: StageLines) -> float | None:
    if stage.contact_loss is None:
        return None
    return 2 * math.pi * stage.contact_loss / stage.period_mesh
