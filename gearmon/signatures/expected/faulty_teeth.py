"""Lines of meshes with one faulty tooth or gear, of many sizes at once.

A fault of tooth 1 changes the mesh for the contact of that tooth only, and only that is solved anew
(see `contact_motion`), exactly for every size. Eccentricity, cumulative pitch error and
misalignment act all through the turn: they shift the contact of every pair a little, and with it
the corners of the stiffness; their turns are solved as a whole, on panels that follow the corners.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.excitation import FlankError, TurningError
from gearmon.gears.pulses import PulseTrain
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result
from gearmon.signals.array_types import ComplexArray, FloatArray, IntArray
from gearmon.signatures.expected.contact_motion import (
    Deviations,
    PeriodicMotion,
    PhaseGrid,
    deviations,
    lines_per_unit,
)
from gearmon.signatures.expected.mesh import Heard, MeshLines, PosedMesh, mesh_with
from gearmon.signatures.expected.planetary_set import PosedSet, posed_stage

Posed = PosedMesh | PosedSet
_Motion = TypeVar("_Motion", PeriodicMotion, Deviations)

#: How often panels are halved at most.
MOST_HALVINGS = 4
#: Loss of a tooth at whose contact the answer per unit of loss is taken.
SMALL_LOSS = 1e-3


def periodic_lines(posed: Posed, max_hz: float, tolerance: float) -> MeshLines:
    """Solve a mesh, or a planetary set, over its whole period: one mesh period where all are alike.

    Parameters
    ----------
    posed : PosedMesh or PosedSet
    max_hz : float
        Highest frequency [Hz].
    tolerance : float
        Relative error of the acceleration (an estimate).
    """
    local = _is_local(posed)
    found = _refined(
        contact_grid([posed], max_hz) if local else _turn_grid(posed, max_hz),
        tolerance,
        lambda grid: periodic_motion(posed, grid),
        lambda made: made.unresolved,
    )
    period = posed.period
    heard = posed.heard(found, _count(posed, max_hz, period), period)
    method, lost = "contact" if local else "whole turn", found.least_force <= 0
    return _lines(posed, period, heard, method, found.unresolved, lost)


def faulty_lines(
    healthy: Posed, faulty: Sequence[Posed], max_hz: float, tolerance: float
) -> list[MeshLines]:
    """Solve a mesh, or a planetary set, with faults that differ from case to case.

    Parameters
    ----------
    healthy : PosedMesh or PosedSet
    faulty : sequence of the same
        With the faults, such as one of growing size.
    max_hz : float
        Highest frequency [Hz].
    tolerance : float
        Relative error of what the fault adds (an estimate), or of the whole for turns that are
        solved as a whole.
    """
    if not all(map(_is_local, faulty)) or all(posed.period == 1 for posed in faulty):
        return [periodic_lines(posed, max_hz, tolerance) for posed in faulty]
    period = max(posed.period for posed in faulty)
    count = _count(healthy, max_hz, period)
    found = _refined(
        contact_grid([healthy, *faulty], max_hz),
        tolerance,
        lambda grid: contact_changes(healthy, faulty, grid, period),
        lambda made: max(made.unresolved.max(), made.mesh.unresolved),
    )
    heard = healthy.heard(found, count, period)
    even = healthy.heard(found.mesh, count // period, 1)
    errors = np.maximum(found.unresolved, found.mesh.unresolved)
    return [
        _lines(posed, period, _with(even, heard, turn, period), "contact", error, least <= 0)
        for turn, (posed, error, least) in enumerate(
            zip(faulty, errors.tolist(), found.least_force.tolist(), strict=True)
        )
    ]


def contact_changes(
    healthy: Posed, faulty: Sequence[Posed], grid: PhaseGrid, period: int
) -> Deviations:
    """Return what faults of teeth change in a turn of P mesh periods, case by case."""
    where = tuple(sorted({place for posed in faulty for place in _changed(posed, period)})) or (0,)
    kappa = np.stack([_kappa(posed, grid, where) for posed in faulty])
    excitation = None
    if any(posed.excitation is not None for posed in faulty):
        excitation = np.stack([_moved(posed, grid, where) for posed in faulty])
    return deviations(periodic_motion(healthy, grid), period, where, kappa, excitation)


def periodic_motion(posed: Posed, grid: PhaseGrid) -> PeriodicMotion:
    """Solve a mesh or a set on panels of its whole period."""
    return PeriodicMotion(
        grid=grid,
        around=posed.around,
        kappa=_kappa(posed, grid, (0,))[0],
        excitation=None if posed.excitation is None else _moved(posed, grid, (0,))[0],
    )


def contact_grid(cases: Sequence[Posed], max_hz: float) -> PhaseGrid:
    """Return panels of a mesh period on which all these cases can be solved."""
    corners = [
        own - lead
        for posed in cases
        for mesh, lead in posed.members
        for _, own in _corners(mesh, mesh.mechanics.stiffness.trains)
    ]
    return PhaseGrid.between(
        np.concatenate(corners), max(_cycles(posed, max_hz) for posed in cases)
    )


def pair_loss(faulty: PosedMesh, healthy: PosedMesh) -> float:
    """Return the share of the stiffness of a pair, integrated over its contact, that is lost."""
    own, whole = faulty.mechanics.stiffness, healthy.mechanics.stiffness
    return float(own.period_mesh * (1 - own.mean_n_per_m / whole.mean_n_per_m))


def _refined(
    grid: PhaseGrid,
    tolerance: float,
    solve: Callable[[PhaseGrid], _Motion],
    unresolved: Callable[[_Motion], float],
) -> _Motion:
    """Solve on panels that are halved until no more than the tolerance is left unresolved."""
    found = solve(grid)
    for _ in range(MOST_HALVINGS):
        if unresolved(found) <= tolerance:
            break
        grid = grid.halved()
        found = solve(grid)
    return found


def _with(even: Heard, added: Heard, turn: int, period: int) -> Heard:
    """Return what a fault adds in one of the turns together with the even lines."""
    number = np.concatenate([added.number, even.number * period])
    carrier = np.concatenate([added.carrier, even.carrier])
    span = 1 + 2 * int(np.abs(carrier).max(initial=0))
    _, first, where = np.unique(number * span + carrier, return_index=True, return_inverse=True)
    lines = np.zeros(len(first), dtype=np.complex128)
    np.add.at(lines, where, np.concatenate([added.lines[turn], even.lines[0]]))
    return Heard(number[first], carrier[first], lines[None], even.mean + added.mean[turn])


def _lines(
    posed: Posed, period: int, heard: Heard, method: str, error: float, lost: bool
) -> MeshLines:
    return MeshLines(
        mechanics=posed.mechanics,
        mesh_order=posed.order,
        period=period,
        number=heard.number,
        carrier=heard.carrier,
        pass_order=posed.pass_order,
        displacement=heard.lines[0],
        marked=posed.marked if period > 1 else {},
        method=method,
        error=error,
        contact_lost=lost,
        mean_m=float(heard.mean[0]),
    )


def _count(posed: Posed, max_hz: float, period: int) -> int:
    return math.floor(max_hz / posed.mechanics.mesh_frequency_hz * period * (1 + 1e-12))


def _kappa(posed: Posed, grid: PhaseGrid, places: Sequence[int]) -> FloatArray:
    """Return kappa in some mesh periods, shape (places, meshes, panels, points)."""
    phases = np.asarray(places)[:, None, None] + grid.phase
    found = [mesh.mechanics.stiffness.at(phases + lead) for mesh, lead in posed.members]
    return np.asarray(np.stack(found, axis=1) * posed.scale)


def _moved(posed: Posed, grid: PhaseGrid, places: Sequence[int]) -> FloatArray:
    """Return e [m] there, same shape."""
    phases = np.asarray(places)[:, None, None] + grid.phase
    found = [
        np.zeros(phases.shape) if mesh.excitation is None else mesh.excitation.at(phases + lead)
        for mesh, lead in posed.members
    ]
    return np.stack(found, axis=1)


def _is_local(posed: Posed) -> bool:
    return all(mesh.is_local for mesh, _ in posed.members)


def _errors(mesh: PosedMesh) -> tuple[TurningError | FlankError, ...]:
    return () if mesh.excitation is None else mesh.excitation.errors


def _changed(posed: Posed, period: int) -> set[int]:
    """Mesh periods of P in which a mesh differs."""
    found: set[int] = set()
    for mesh, lead in posed.members:
        stiffness = mesh.mechanics.stiffness
        spans = [
            (
                term.offset,
                term.pulse.length + term.face_end * train.overlap_ratio,
                train.period_mesh,
            )
            for train in stiffness.pulses
            for term in train.terms
        ]
        spans += [
            ((e.tooth or 1) - 1, stiffness.total_contact_ratio, e.period_mesh)
            for e in _errors(mesh)
            if isinstance(e, FlankError)
        ]
        for start, length, repeats in spans:
            first = math.floor(start - lead + 1e-9)
            last = math.ceil(start - lead + length - 1e-9)
            for turn in range(0, period, repeats):
                found.update((turn + i) % period for i in range(first, max(last, first + 1)))
    return found


def _cycles(posed: Posed, highest_hz: float) -> float:
    """Return the cycles a mesh period that panels are to follow: motion times highest line.

    The motion itself is followed with a margin, also where no high line is asked for.
    """
    natural, trains = posed.highest_natural_hz, posed.members[0][0].mechanics.stiffness.trains
    terms = [term for train in trains for term in train.terms]
    fastest = max((term.pulse.fastest for term in terms), default=0.0) / (2 * math.pi)
    mesh_hz = posed.mechanics.mesh_frequency_hz
    return max(max(2 * natural, natural + highest_hz) / mesh_hz, fastest)


def _corners(posed: PosedMesh, trains: Iterable[PulseTrain]) -> Iterator[tuple[int, FloatArray]]:
    """Give mesh phases at which stiffness or excitation are not smooth, and when they repeat."""
    yield 1, np.zeros(1)
    for train in trains:
        for term in train.terms:
            faces = np.array([term.face_start, term.face_end]) * train.overlap_ratio
            limits = term.offset + term.pulse.edges
            yield train.period_mesh, np.add.outer(np.unique(faces), limits).ravel()
    overlap = posed.mechanics.stiffness.overlap_ratio
    for error in _errors(posed):
        if isinstance(error, FlankError):
            limits = (error.tooth or 1) - 1 + error.gap.edges
            yield error.period_mesh, np.add.outer([0.0, overlap], limits).ravel()


def _turn_grid(posed: Posed, highest_hz: float) -> PhaseGrid:
    """Return panels round a turn, with edges at all corners of stiffness and excitation."""
    period, found = posed.period, []
    for mesh, lead in posed.members:
        stiffness = mesh.mechanics.stiffness
        # the last one moves with all gears
        moving = stiffness.modulations[-1:]
        found += [train.corners(train.offsets, period) - lead for train in moving]
        # damaged teeth lose what they lose where the teeth would be without the errors, and single
        # errors are shared as by these
        apart = moving and not any(isinstance(error, FlankError) for error in _errors(mesh))
        still = stiffness.pulses if apart else stiffness.trains
        for repeats, corners in _corners(mesh, still):
            found.append(np.add.outer(np.arange(0, period, repeats), corners).ravel() - lead)
    return PhaseGrid.between(np.concatenate(found), _cycles(posed, highest_hz), period)


@dataclass(frozen=True, kw_only=True, eq=False)
class LossResponse(Result):
    """What a loss of stiffness of one tooth adds to the lines of its mesh, per unit of loss.

    Parameters
    ----------
    stage : int
    gear : str
    kind : str
    teeth : int
        z of the gear.
    operating : int
    loss : float
        Loss at which it holds: the share that the pair of the tooth loses of its stiffness,
        integrated over its contact; 0 for the derivative at no loss.
    number : ndarray of int, shape (n,)
        r: harmonics of the turn of the gear in its mesh, of a planetary gear relative to the
        carrier; mesh harmonic h is r = h z. Of a parallel stage r = 1..n.
    carrier : ndarray of int, shape (n,)
        s: turns of the carrier beside them. A sensor on the housing hears every line of a planetary
        set at s = -1, 0, 1: planets pass. It turns with the place of the sensor, a, as exp(i s a).
    order, frequency_hz : ndarray, shape (n,)
        Frequency over that of shaft 1, and in Hz at the operating point.
    acceleration : complex ndarray, shape (n,)
        Change of acceleration over loss [m/s2], tooth 1; half of peak amplitudes. At `loss`, or at
        small losses, the lines are ``mesh_acceleration + loss * acceleration``.
    mesh_acceleration : complex ndarray, shape (n,)
        The healthy mesh [m/s2]; zero but at multiples of z.
    """

    stage: int
    gear: str
    kind: str
    teeth: int
    operating: int
    loss: float
    number: IntArray
    carrier: IntArray
    order: FloatArray
    frequency_hz: FloatArray
    acceleration: ComplexArray
    mesh_acceleration: ComplexArray

    def at_tooth(self, tooth: int | IntArray) -> ComplexArray:
        """Return `acceleration` for other teeth, shape (..., n) for teeth of shape (...)."""
        numbers = np.asarray(tooth)
        turns = np.multiply.outer(numbers - 1, self.number) % self.teeth
        return np.asarray(self.acceleration * np.exp(-2j * np.pi / self.teeth * turns))


def loss_response(
    machine: MachineLike,
    stage: int,
    gear: str,
    operating: int = 0,
    max_order: float | None = None,
    *,
    kind: str = "crack",
    loss: float = 0.0,
    form: str = "parabolic",
) -> LossResponse:
    """Return what a small loss of stiffness of one tooth adds to the lines of its mesh.

    Parameters
    ----------
    machine : Machine, path or dict
        With the data that a baseline needs.
    stage : int
        From 1.
    gear : str
        "pinion", "gear", "sun", "planet" or "ring".
    operating : int
        Operating point, from 0.
    max_order : float, optional
        Highest order of shaft 1; by default 10 mesh harmonics or 2 natural frequencies.
    kind : {"crack", "stiffness", "breakage", "pitting", "spall"}
        How the loss is spread along the contact of the tooth.
    loss : float, in [0, 1)
        0 for the derivative at no loss; else the whole change at this loss (the lost share of the
        stiffness of the pair where the fault acts), divided by `LossResponse.loss`.
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.

    Returns
    -------
    LossResponse
        Costs one mesh period and the contact of one tooth.

    Raises
    ------
    ArgumentError
        If the machine lacks data, has no such gear, or nothing lies below `max_order`.

    Notes
    -----
    The derivative at no loss leaves out what is of second order: of the shipped machines it misses
    the sidebands by 1 to 3 % of them at a loss of 1 %, 20 to 30 % at 20 %. A corner that breaks off
    a helical tooth moves on along the face as it grows: its derivative holds for slivers only, so
    give a `loss` there.

    Examples
    --------
    >>> response = gearmon.loss_response(machine, 1, "pinion", max_order=50.0)
    >>> response.teeth, response.acceleration.shape == response.order.shape
    (23, True)
    """
    if kind not in ("crack", "stiffness", "breakage", "pitting", "spall"):
        raise ArgumentError(
            f"kind={kind!r} must be one of: crack, stiffness, breakage, pitting, spall"
        )
    machine = load_machine(machine)
    place = mesh_with(machine, stage, gear)
    check_range("loss", loss, 0.0, 0.999)
    text = f"{kind}:{stage}:{gear}:1:{float(loss) or SMALL_LOSS!r}"
    healthy, faulty = (
        posed_stage(machine, stage, operating, wrong, form=form, mesh=place)
        for wrong in ((), (text,))
    )
    highest_hz = healthy.limit_hz(None)
    if max_order is not None:
        check_positive("max_order", max_order)
        highest_hz = max_order * machine.operating[operating].shaft1_hz
    teeth = faulty.period
    count = _count(healthy, highest_hz, teeth)
    if count < 1:
        raise ArgumentError(f"max_order={max_order} lies below the first line: nothing is left")
    grid = contact_grid([healthy, faulty], highest_hz)
    lost = max(
        pair_loss(own, even)
        for (own, _), (even, _) in zip(faulty.members, healthy.members, strict=True)
    )
    changes = contact_changes(healthy, [faulty], grid, teeth)
    if not loss:
        where = changes.where
        changes = lines_per_unit(changes.mesh, teeth, where, _kappa(faulty, grid, where))
    added = healthy.heard(changes, count, teeth)
    sound = healthy.heard(changes.mesh, count // teeth, 1)
    still, none = (replace(own, lines=0 * own.lines) for own in (sound, added))
    table, change = _with(sound, none, 0, teeth), _with(still, added, 0, teeth).lines[0]
    turns = table.number / teeth + table.carrier * float(healthy.pass_order)
    to_acceleration = -((2 * math.pi * turns * healthy.mechanics.mesh_frequency_hz) ** 2)
    return LossResponse(
        stage=stage,
        gear=gear,
        kind=kind,
        teeth=teeth,
        operating=operating,
        loss=lost if loss else 0.0,
        number=table.number,
        carrier=table.carrier,
        order=np.asarray(turns * healthy.order),
        frequency_hz=np.asarray(turns * healthy.mechanics.mesh_frequency_hz),
        acceleration=to_acceleration * change / lost,
        mesh_acceleration=to_acceleration * table.lines[0],
    )
