"""Gear data -> stiffness -> equation of motion -> the lines that a machine should show.

A mesh repeats after its mesh period, a turn of the gear that is marked by damage or errors, or the
hunting period if both are. Where faults change the stiffness of one gear only, the lines have a
guaranteed bound of their error, from Hill's equation. What moves the flanks, damage of both gears,
planetary sets and families of faults are solved from corner to corner of stiffness and excitation
(see `contact_motion`): a fault of a tooth changes the mesh for the contact of that tooth only, and
only that is solved anew, exactly for every size. Eccentricity, cumulative pitch error and
misalignment act all through the turn: they shift the contact of every pair a little, and with it
the corners of the stiffness; their turns are solved as a whole, on panels that follow the corners.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache, lru_cache, partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_range
from gearmon.gears.faults import faults_of
from gearmon.gears.mechanics import StageMechanics
from gearmon.machine import MachineLike, load_machine
from gearmon.signatures.expected.contact_motion import Deviations, PeriodicMotion, PhaseGrid
from gearmon.signatures.expected.mesh import MeshLines, MeshPlace, PosedStage, Wrong, joined, rms
from gearmon.signatures.signature import AMPLITUDES, Signature

if TYPE_CHECKING:  # an analysis solves no mesh
    from gearmon.dynamics import Method

#: Most stiffness harmonics of one problem.
MOST_HARMONICS = 200_000
# What is told of a stage that is solved from corner to corner, besides its error.
_TOLD: dict[str, Any] = {"order_used": 0, "error_bound": None, "error_estimate": None}
_TOLD |= {"stiffness_harmonics": 0, "stiffness_cut": 0.0, "stable": True}
_TOLD |= {"contact_loss_angle_rad": None}
#: Effect of stiffness harmonics above J over A^2 (R/J)^3, see `_stiffness_harmonics`.
CUT_FACTOR = 6.0
_Motion = TypeVar("_Motion", PeriodicMotion, Deviations)
#: How often panels are halved at most.
MOST_HALVINGS = 4
#: Cases, panels and coordinates that are solved at once: some 100 MB.
MOST_NUMBERS = 2_000_000


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
        Highest frequency [Hz], > 0, up to 1e6. By default each stage is shown up to 10 mesh
        harmonics or 2 natural frequencies, whichever is higher.
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
    known = faults_of(faults, errors=True, stages=len(machine.stages))
    check_range("tolerance", tolerance, 1e-13, 1.0)
    tables, stages = [], []
    for number in range(1, len(machine.stages) + 1):
        ring = any(fault.stage == number and fault.gear == "ring" for fault in known)
        place = MeshPlace(machine, number, operating, form, int(ring))
        posed = place.posed(known)
        limit = posed.limit_hz(max_hz)
        lines, told, warnings = _stage_lines(posed, limit, tolerance, method, order)
        columns = lines.columns()
        cross = columns["sideband_of"] == "?"
        listed = ~cross & (columns["frequency_hz"] <= limit * (1 + 1e-12))
        tables.append({name: column[listed] for name, column in columns.items()})
        sizes = columns["acceleration_ms2"]
        share = rms(sizes[cross]) / rms(sizes) if sizes.any() else 0.0
        told |= {"max_hz": limit, "cross_lines_share": share}
        stages.append(lines.header() | told | {"warnings": [*posed.warnings, *warnings]})
    if max_hz is not None and not any(len(table["stage"]) for table in tables):
        refuse_no_lines((own["mesh_frequency_hz"] for own in stages), max_hz)
    header = {key: value for key, value in stages[0].items() if key != "stage"} | {
        "speed_rpm": place.point.speed_rpm,
        "torque_nm": place.point.torque_nm,
        "operating": place.point.name,
        "faults": [str(one) for one in known],
        "amplitudes": AMPLITUDES,
        "stages": stages,
        "tolerance": tolerance,
    }
    return Signature(machine=machine.name, origin="expected", header=header, columns=joined(tables))


def refuse_no_lines(mesh_hz: Iterable[float], max_hz: float | None) -> None:
    """Say that no line is left below the highest frequency."""
    raise ArgumentError(
        f"max_hz={max_hz} Hz lies below the lowest mesh frequency, {min(mesh_hz):.6g} Hz: no lines"
    )


def _stage_lines(
    posed: PosedStage, max_hz: float, tolerance: float, method: Method, order: int | None
) -> tuple[MeshLines, dict[str, Any], list[str]]:
    """Solve one stage with all that is wrong with it: with a bound, or from corner to corner.

    Returns its lines, how they were solved, and what to warn of.
    """
    alone = posed.train is None
    if alone and not posed.errors and (method != "auto" or len(posed.marked) < 2):
        lines, told = _steady(posed, max_hz, tolerance, method, order)
    elif alone and method != "auto":
        raise ArgumentError(
            f"method={method!r} takes faults that change the stiffness only, and those of "
            f"stage {posed.mechanics.stage} move the flanks too; leave method out"
        )
    else:
        (lines,) = faulty_lines(posed.sound, [posed], max_hz, tolerance)
        what = "from corner to corner" if alone else "the whole set, as the housing hears it"
        added = " of what the faults add" if lines.period > 1 and lines.method == "contact" else ""
        message = f"{what}: error estimated as {lines.error:.2g}{added}"
        told = _TOLD | {"error_estimate": lines.error, "message": message}
    warnings, angle = [], told["contact_loss_angle_rad"]
    if told["stable"] is False:
        warnings.append(told["message"])
    elif lines.error > tolerance:
        bound = " bound" if told["error_estimate"] is None else ""
        warnings.append(f"error{bound} {lines.error:.2g} misses the tolerance {tolerance:.2g}")
    if lines.contact_lost:
        place = (angle or 0.0) / (2 * math.pi) * lines.period
        first = "" if angle is None else f", first at mesh phase {place:.4g}"
        warnings.append(f"teeth lose contact{first}: the linear model ends there")
    return lines, told, warnings


def _steady(
    posed: PosedStage, max_hz: float, tolerance: float, method: Method, order: int | None
) -> tuple[MeshLines, dict[str, Any]]:
    """Solve a mesh over its true period, with a bound of the error."""
    from gearmon.dynamics import steady_state

    period = posed.period
    shown = max(1, _count(posed, max_hz, period))
    harmonics, cut = _stiffness_harmonics(posed.mechanics, shown, tolerance)
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
    return lines, _TOLD | {
        "order_used": response.order,
        "error_bound": lines.error,
        "stiffness_harmonics": len(harmonics),
        "stiffness_cut": cut,
        "stable": response.stable,
        "contact_loss_angle_rad": angle,
        "message": f"{response.message}; stiffness harmonics left out: {cut:.2g}",
    }


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


def periodic_lines(posed: PosedStage, max_hz: float, tolerance: float) -> MeshLines:
    """Solve a mesh, or a planetary set, over its whole period: one mesh period where all are alike.

    Parameters
    ----------
    posed : PosedStage
    max_hz : float
        Highest frequency [Hz].
    tolerance : float
        Relative error of the acceleration (an estimate).
    """
    period = posed.period
    grid = contact_grid([posed], max_hz, period)
    found = _refined(grid, tolerance, partial(periodic_motion, posed))
    places, lines = posed.heard(found.force_lines(_count(posed, max_hz, period)), period)
    method = "contact" if posed.is_local else "whole turn"
    return _each([posed], found, lines, method=method, **places)[0]


def faulty_lines(
    healthy: PosedStage, faulty: Sequence[PosedStage], max_hz: float, tolerance: float
) -> list[MeshLines]:
    """Solve a mesh, or a planetary set, with faults that differ from case to case.

    Parameters
    ----------
    healthy : PosedStage
        The same where no tooth differs.
    faulty : sequence of PosedStage
        With the faults: of all sizes and kinds, each on teeth of one gear.
    max_hz : float
        Highest frequency [Hz].
    tolerance : float
        Relative error of what the fault adds (an estimate), or of the whole for turns that are
        solved as a whole.
    """
    teeth: dict[int, list[PosedStage]] = {}
    for posed in faulty:
        if posed.is_local and posed.period > 1:
            teeth.setdefault(posed.period, []).append(posed)
    solved: dict[PosedStage, MeshLines] = {}
    for own in teeth.values():
        grid = contact_grid([healthy, *own], max_hz)
        numbers = len(grid.widths) * (8 + len(healthy.modes.inputs)) ** 2
        together = max(1, MOST_NUMBERS // numbers)
        for first in range(0, len(own), together):
            some = own[first : first + together]
            sound, added = added_lines(healthy, some, max_hz, tolerance, grid)
            for lines in added:
                whole = sound.displacement + lines.displacement
                solved[lines.posed] = replace(lines, displacement=whole)
    return [solved.get(own) or periodic_lines(own, max_hz, tolerance) for own in faulty]


def added_lines(
    healthy: PosedStage,
    faulty: Sequence[PosedStage],
    max_hz: float,
    tolerance: float = math.inf,
    grid: PhaseGrid | None = None,
) -> tuple[MeshLines, list[MeshLines]]:
    """Return the healthy lines in the places of those of faulty teeth of a gear, and what is added.

    Parameters
    ----------
    healthy, faulty, max_hz
        As in `faulty_lines`.
    tolerance : float
        Relative error of what is added; by default that of the panels as they are.
    grid : PhaseGrid, optional
        Panels on which all cases can be solved.
    """
    period = faulty[0].period
    grid = grid or contact_grid([healthy, *faulty], max_hz)
    found = _refined(grid, tolerance, lambda own: _changes(healthy, own, faulty))
    count = _count(healthy, max_hz, period)
    forces = found.force_lines(count)
    even = np.zeros_like(forces[:1])
    even[..., period - 1 :: period] = found.mesh.force_lines(count // period)
    places, lines = healthy.heard(np.concatenate([even, forces]), period)
    added = _each(faulty, found, lines[1:], method="contact", **places)
    return replace(added[0], posed=healthy, displacement=lines[0]), added


def contact_grid(cases: Sequence[PosedStage], max_hz: float, period: int = 1) -> PhaseGrid:
    """Return panels of a mesh period, or of so many, on which all these cases can be solved."""
    corners = [
        np.add.outer(np.arange(0, period, repeats), own).ravel() - mesh.lead
        for posed in cases
        for mesh in posed.members
        for repeats, own in _corners(mesh, changed=False)
    ]
    # panels follow motion times highest line, the motion itself with a margin, and the ripple of
    # a Fourier sum
    natural, mesh_hz = cases[0].modes.fastest_hz, cases[0].mechanics.mesh_frequency_hz
    trains = (train for posed in cases for train in posed.mechanics.stiffness.trains)
    ripple = max(term.pulse.fastest for train in trains for term in train.terms) / (2 * math.pi)
    cycles = max(max(2 * natural, natural + max_hz) / mesh_hz, ripple)
    return PhaseGrid.between(np.concatenate(corners), cycles, period)


def periodic_motion(posed: PosedStage, grid: PhaseGrid) -> PeriodicMotion:
    """Solve a mesh or a set on panels of its whole period."""
    return PeriodicMotion(
        grid=grid,
        period_s=1 / posed.mechanics.mesh_frequency_hz,
        around=posed.modes,
        stiffness=np.stack([k.stiffness.at(grid.phase + k.lead) for k in posed.members], axis=1),
        excitation=np.stack([e.excitation.at(grid.phase + e.lead) for e in posed.members], axis=1),
    )


# panels of several gears may be alike
_even = lru_cache(maxsize=1)(periodic_motion)


def _changes(healthy: PosedStage, grid: PhaseGrid, faulty: Sequence[PosedStage]) -> Deviations:
    """Return what faults of teeth change in a turn, case by case."""
    where = tuple(sorted(set().union(*map(_changed, faulty)))) or (0,)
    phases = np.array(where)[:, None, None] + grid.phase
    delta = np.zeros((len(faulty), *phases.shape[:2], len(healthy.members), phases.shape[2]))
    # sizes of a kind may share a pulse
    lost_by = cache(lambda train, lead: train.at(phases + lead))
    for posed, own in zip(faulty, np.moveaxis(delta, 3, 1), strict=True):
        for mesh, lost in zip(posed.members, own, strict=True):
            for train in mesh.stiffness.pulses:
                for term in train.terms:
                    alone = replace(train, terms=(replace(term, weight=1.0),))
                    lost += term.weight * lost_by(alone, mesh.lead)
    moved = [
        np.stack([own.excitation.at(phases + own.lead) for own in posed.members], axis=2)
        for posed in faulty
    ]
    return Deviations(
        mesh=_even(healthy, grid),
        period=faulty[0].period,
        where=where,
        delta=delta,
        excitation=np.array(moved),
    )


def _refined(grid: PhaseGrid, tolerance: float, solve: Callable[[PhaseGrid], _Motion]) -> _Motion:
    """Solve on panels that are halved until no more than the tolerance is left unresolved."""
    found = solve(grid)
    for _ in range(MOST_HALVINGS):
        if found.unresolved.max() <= tolerance:
            break
        grid = grid.halved()
        found = solve(grid)
    return found


def _each(
    posed: Sequence[PosedStage], found: _Motion, lines: ComplexArray, **same: Any
) -> list[MeshLines]:
    """Return the lines of each turn by themselves."""
    columns = found.unresolved, *found.contact
    told = zip(posed, lines, *(own.tolist() for own in columns), strict=True)
    names = ("posed", "displacement", "error", "contact_lost", "mean_m")
    return [MeshLines(**dict(zip(names, own, strict=True)), **same) for own in told]


def _count(posed: PosedStage, max_hz: float, period: int) -> int:
    return math.floor(max_hz / posed.mechanics.mesh_frequency_hz * period * (1 + 1e-12))


def _changed(posed: PosedStage) -> set[int]:
    """Mesh periods of a turn in which a mesh differs."""
    found, period = set[int](), posed.period
    for mesh in posed.members:
        for repeats, corners in _corners(mesh, changed=True):
            first = math.floor(corners.min() - mesh.lead + 1e-9)
            last = max(math.ceil(corners.max() - mesh.lead - 1e-9), first + 1)
            turns = range(0, period, repeats)
            found.update((turn + i) % period for turn in turns for i in range(first, last))
    return found


def _corners(mesh: StageMechanics, *, changed: bool) -> Iterator[tuple[int, FloatArray]]:
    """Give phases at which a mesh, or what faults change of it, is not smooth, and their period."""
    stiffness, errors = mesh.stiffness, mesh.excitation.errors
    even, gaps = stiffness.healthy, [(own, own.gap) for own in errors if own.gap is not None]
    # damaged teeth lose what they lose where the teeth would be without the errors, and single
    # errors are shared as by these
    apart = changed or (stiffness.modulations and not gaps)
    for train in stiffness.pulses if apart else stiffness.trains:
        for term in train.terms:
            yield train.period_mesh, term.corners(train.overlap_ratio)
    for error, gap in gaps:
        # what is missing beyond the contact of a pair moves nothing
        limits = np.minimum(gap.edges, even.terms[0].pulse.length) + (error.wrong.tooth or 1) - 1
        yield error.period_mesh, np.add.outer([0.0, even.overlap_ratio], limits).ravel()
    yield from ((train.period_mesh, train.corners) for train in stiffness.modulations)
