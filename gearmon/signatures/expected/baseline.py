"""Gear data -> stiffness -> Hill's equation -> the lines that a machine should show."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import Method
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.faults import parse_fault_or_error
from gearmon.machine import Machine
from gearmon.signatures.expected.mesh import (
    Wrong,
    joined,
    machine_header,
    operating_point,
    posed_mesh,
    refuse_no_lines,
)
from gearmon.signatures.expected.steady_lines import SteadyLines, steady_lines
from gearmon.signatures.signature import Signature


def expected_signature(
    machine: Machine,
    faults: Iterable[Wrong | str] = (),
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
    operating_point(machine, operating)
    known = _faults(machine, faults)
    if max_hz is not None:
        check_positive("max_hz", max_hz, "Hz")
    check_range("tolerance", tolerance, 1e-13, 1.0)
    tables, stages, mechanics = [], [], []
    for number in range(1, len(machine.stages) + 1):
        ring = any(fault.stage == number and fault.gear == "ring" for fault in known)
        posed = posed_mesh(machine, number, operating, known, form=form, mesh=int(ring))
        limit = posed.limit_hz(max_hz)
        lines = steady_lines(posed, limit, tolerance, method, order)
        columns, share = _listed(lines, limit)
        warnings = [*posed.mechanics.warnings, *posed.warnings, *lines.warnings(tolerance)]
        added = {"max_hz": limit, "cross_lines_share": share, "warnings": warnings}
        tables.append(columns)
        stages.append(lines.header() | added)
        mechanics.append(posed.mechanics)
    if max_hz is not None and not any(len(table["stage"]) for table in tables):
        refuse_no_lines(mechanics, max_hz)
    header = machine_header(machine, operating, known, stages) | {"tolerance": tolerance}
    return Signature(machine=machine.name, origin="expected", header=header, columns=joined(tables))


def _faults(machine: Machine, faults: Iterable[Wrong | str]) -> tuple[Wrong, ...]:
    known = tuple(
        parse_fault_or_error(fault) if isinstance(fault, str) else fault for fault in faults
    )
    for fault in known:
        if fault.stage > len(machine.stages):
            raise ArgumentError(
                f"fault {fault}: stage {fault.stage} must lie in [1, {len(machine.stages)}]"
            )
    return known


def _listed(lines: SteadyLines, max_hz: float) -> tuple[dict[str, npt.NDArray[Any]], float]:
    """Columns of the lines to list, and the share of acceleration in lines of no gear."""
    columns = lines.columns()
    strange = columns["sideband_of"] == "?"
    known = ~strange & (lines.frequency_hz <= max_hz * (1 + 1e-12))
    energy = np.abs(lines.acceleration) ** 2
    share = math.sqrt(float(energy[strange].sum() / energy.sum())) if energy.any() else 0.0
    return {name: column[known] for name, column in columns.items()}, share
