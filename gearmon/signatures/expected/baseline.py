"""Gear data -> stiffness -> Hill's equation -> the lines that a machine should show.

A mesh repeats after its mesh period, a turn of the gear that is marked by damage or errors, or the
hunting period if both are. Where faults change the stiffness of one gear only, the lines have a
guaranteed bound of their error. What moves the flanks, damage of both gears and planetary sets are
solved from corner to corner of stiffness and excitation, in the few mesh periods that differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.arrays import ComplexArray
from gearmon.dynamics import Method, steady_state
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.faults import faults_of
from gearmon.gears.mechanics import StageMechanics
from gearmon.machine import MachineLike, load_machine
from gearmon.signatures.expected.faulty_teeth import faulty_lines
from gearmon.signatures.expected.mesh import MeshPlace, PosedStage, Wrong, operating_point
from gearmon.signatures.expected.mesh_lines import AMPLITUDES, MeshLines, joined, refuse_no_lines
from gearmon.signatures.signature import Signature

#: Lines, how they were solved, and what to warn of.
Solved = tuple[MeshLines, dict[str, Any], list[str]]
#: Most stiffness harmonics of one problem.
MOST_HARMONICS = 200_000
# What is told of a stage that is solved from corner to corner, besides its error.
_TOLD: dict[str, Any] = {
    "order_used": 0,
    "error_bound": None,
    "error_estimate": None,
    "stiffness_harmonics": 0,
}
_TOLD |= {"stiffness_cut": 0.0, "stable": True, "contact_loss_angle_rad": None}
#: Effect of stiffness harmonics above J over A^2 (R/J)^3, see `_stiffness_harmonics`.
CUT_FACTOR = 6.0


def expected_signature(
    machine: MachineLike,
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
    machine : Machine, path or dict
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
    `error_bound` is the guaranteed bound of the solution for the harmonics taken of the stiffness,
    plus an estimate of what the others would change (`stiffness_cut`, from their 1/n fall). What
    moves the flanks (errors, missing teeth, wear), damage of both gears (method "auto") and
    planetary sets have no bound but an `error_estimate`. Lines are attributed to the nearest mesh
    harmonic.
    Those that belong to neither shaft are not listed; where they were solved for, their share of
    the acceleration is given as `cross_lines_share`.

    Examples
    --------
    >>> healthy = gearmon.expected_signature(machine, max_hz=2000.0)
    >>> healthy.header["mesh_frequency_hz"], healthy["mesh_harmonic"].tolist()
    (567.3333333333334, [1, 2, 3])
    """
    machine = load_machine(machine)
    point = operating_point(machine, operating)
    known = faults_of(faults, errors=True, stages=len(machine.stages))
    if max_hz is not None:
        check_positive("max_hz", max_hz, "Hz")
    check_range("tolerance", tolerance, 1e-13, 1.0)
    tables, stages, mechanics = [], [], []
    for number in range(1, len(machine.stages) + 1):
        ring = any(fault.stage == number and fault.gear == "ring" for fault in known)
        posed = MeshPlace(machine, number, operating, form, int(ring)).posed(known)
        limit = posed.limit_hz(max_hz)
        lines, told, warnings = _solved(posed, limit, tolerance, method, order)
        columns, share = _listed(lines, limit)
        tables.append(columns)
        stages.append(
            lines.header()
            | told
            | {
                "max_hz": limit,
                "cross_lines_share": share,
                "warnings": [*posed.warnings, *warnings],
            }
        )
        mechanics.append(posed.mechanics)
    if max_hz is not None and not any(len(table["stage"]) for table in tables):
        refuse_no_lines(mechanics, max_hz)
    header = {key: value for key, value in stages[0].items() if key != "stage"} | {
        "speed_rpm": point.speed_rpm,
        "torque_nm": point.torque_nm,
        "operating": point.name,
        "faults": [str(one) for one in known],
        "amplitudes": AMPLITUDES,
        "stages": stages,
        "tolerance": tolerance,
    }
    return Signature(machine=machine.name, origin="expected", header=header, columns=joined(tables))


def _listed(lines: MeshLines, max_hz: float) -> tuple[dict[str, npt.NDArray[Any]], float]:
    """Columns of the lines to list, and the share of acceleration in lines of no gear."""
    columns = lines.columns()
    strange = columns["sideband_of"] == "?"
    known = ~strange & (columns["frequency_hz"] <= max_hz * (1 + 1e-12))
    energy = columns["acceleration_ms2"] ** 2
    share = math.sqrt(float(energy[strange].sum() / energy.sum())) if energy.any() else 0.0
    return {name: column[known] for name, column in columns.items()}, share


def _solved(
    posed: PosedStage, max_hz: float, tolerance: float, method: Method, order: int | None
) -> Solved:
    """Solve one stage with all that is wrong with it."""
    if posed.train is None:
        if not posed.is_excited and (method != "auto" or len(posed.marked) < 2):
            return _steady(posed, max_hz, tolerance, method, order)
        if method != "auto":
            raise ArgumentError(
                f"method={method!r} takes faults that change the stiffness only, and those of "
                f"stage {posed.mechanics.stage} move the flanks too; leave method out"
            )
    return _from_corners(posed, max_hz, tolerance)


def _from_corners(posed: PosedStage, max_hz: float, tolerance: float) -> Solved:
    """Solve a mesh or a planetary set from corner to corner of its stiffnesses."""
    (lines,) = faulty_lines(posed.sound, [posed], max_hz, tolerance)
    alone = posed.train is None
    what = "from corner to corner" if alone else "the whole set, as the housing hears it"
    added = " of what the faults add" if lines.period > 1 and lines.method == "contact" else ""
    told = _TOLD | {
        "error_estimate": lines.error,
        "message": f"{what}: error estimated as {lines.error:.2g}{added}",
    }
    warnings = []
    if lines.error > tolerance:
        warnings.append(f"error {lines.error:.2g} misses the tolerance {tolerance:.2g}")
    if lines.contact_lost:
        warnings.append("teeth lose contact: the linear model ends there")
    return lines, told, warnings


def _steady(
    posed: PosedStage, max_hz: float, tolerance: float, method: Method, order: int | None
) -> Solved:
    """Solve a mesh over its true period, with a bound of the error."""
    mechanics, period = posed.mechanics, posed.period
    shown = max(1, math.floor(max_hz * period / mechanics.mesh_frequency_hz * (1 + 1e-12)))
    harmonics, cut = _stiffness_harmonics(mechanics, shown, tolerance)
    problem, least = posed.hill_problem(harmonics), max(0.6 * tolerance, 1e-13)
    response = steady_state(problem, least, method=method, order=order, harmonics=shown)
    angle = response.contact_loss_angle_rad
    lines = MeshLines(
        posed=posed,
        period=period,
        number=np.arange(1, shown + 1),
        carrier=np.zeros(shown, dtype=int),
        displacement=response.displacement[1:],
        method=response.method,
        error=response.error_bound + cut,
        contact_lost=angle is not None,
        mean_m=float(response.displacement[0].real),
    )
    told = _TOLD | {
        "order_used": response.order,
        "error_bound": lines.error,
        "stiffness_harmonics": len(harmonics),
        "stiffness_cut": cut,
        "stable": response.stable,
        "contact_loss_angle_rad": angle,
        "message": f"{response.message}; stiffness harmonics left out: {cut:.2g}",
    }
    warnings = []
    if response.stable is False:
        warnings.append(response.message)
    elif lines.error > tolerance:
        warnings.append(f"error bound {lines.error:.2g} misses the tolerance {tolerance:.2g}")
    if angle is not None:
        warnings.append(
            f"teeth lose contact, first at mesh phase {angle / (2 * math.pi) * period:.4g}"
            ": the linear model ends there"
        )
    return lines, told, warnings


def _stiffness_harmonics(
    mechanics: StageMechanics, shown: int, tolerance: float
) -> tuple[ComplexArray, float]:
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
