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
from typing import Any, TypeVar

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.errors import ArgumentError, check_positive, check_range, check_word
from gearmon.gears.excitation import FlankError
from gearmon.gears.pulses import PulseTrain
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result
from gearmon.signatures.expected.contact_motion import (
    Deviations,
    PeriodicMotion,
    PhaseGrid,
    deviations,
)
from gearmon.signatures.expected.mesh import MeshPlace, PosedMesh, PosedStage, gear_places
from gearmon.signatures.expected.mesh_lines import MeshLines

_Motion = TypeVar("_Motion", PeriodicMotion, Deviations)

#: How often panels are halved at most.
MOST_HALVINGS = 4
#: Cases, panels and coordinates that are solved at once: some 100 MB.
MOST_NUMBERS = 2_000_000
#: Loss of a tooth that stands for the derivative at none: it leaves out as much of it.
SMALL_LOSS = 1e-6


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
    grid = contact_grid([posed], max_hz) if posed.is_local else _turn_grid(posed, max_hz)
    found = _refined(grid, tolerance, lambda own: periodic_motion(posed, own))
    period, mean = posed.period, found.mean_deflection[:, 0]
    number, carrier, lines = posed.heard(found, _count(posed, max_hz, period), period)
    same = {"period": period, "number": number, "carrier": carrier}
    method = "contact" if posed.is_local else "whole turn"
    return _each([posed], found, mean, lines, method=method, **same)[0]


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
    even, solved = _Even(healthy), dict[PosedStage, MeshLines]()
    for own in teeth.values():
        solved |= zip(own, _tooth_lines(even, own, max_hz, tolerance), strict=True)
    return [solved.get(own) or periodic_lines(own, max_hz, tolerance) for own in faulty]


class _Even:
    """The healthy mesh on the panels it was asked for last: those of several gears may be alike."""

    def __init__(self, posed: PosedStage) -> None:
        self.posed = posed
        self._motion: PeriodicMotion | None = None

    def motion(self, grid: PhaseGrid) -> PeriodicMotion:
        """Return its motion."""
        known = self._motion
        if known is None or not np.array_equal(known.grid.edges, grid.edges):
            self._motion = known = periodic_motion(self.posed, grid)
        return known


def _tooth_lines(
    even: _Even, faulty: Sequence[PosedStage], max_hz: float, tolerance: float
) -> list[MeshLines]:
    """Solve cases of which a few mesh periods of a turn differ from the others."""
    healthy = even.posed
    grid, half = contact_grid([healthy, *faulty], max_hz), len(faulty) // 2
    numbers = len(faulty) * len(grid.widths) * (8 + len(healthy.around.force)) ** 2
    if half and numbers > MOST_NUMBERS:
        parts = faulty[:half], faulty[half:]
        return [own for part in parts for own in _tooth_lines(even, part, max_hz, tolerance)]
    found, number, carrier, sound, added = _solved(even, faulty, grid, max_hz, tolerance)
    mean = found.mesh.mean_deflection[0, 0] + found.mean_deflection[:, 0]
    same = {"period": found.states.shape[1], "number": number, "carrier": carrier}
    return _each(faulty, found, mean, sound + added, method="contact", **same)


def contact_grid(cases: Sequence[PosedStage], max_hz: float) -> PhaseGrid:
    """Return panels of a mesh period on which all these cases can be solved."""
    corners = [
        own - mesh.lead
        for posed in cases
        for mesh in posed.members
        for _, own in _corners(mesh, mesh.mechanics.stiffness.trains)
    ]
    return PhaseGrid.between(
        np.concatenate(corners), max(_cycles(posed, max_hz) for posed in cases)
    )


def periodic_motion(posed: PosedStage, grid: PhaseGrid) -> PeriodicMotion:
    """Solve a mesh or a set on panels of its whole period."""
    phase = grid.phase
    kappa = [own.mechanics.stiffness.at(phase + own.lead) for own in posed.members]
    return PeriodicMotion(
        grid=grid,
        around=posed.around,
        kappa=posed.scale * np.array(kappa),
        excitation=_moved(posed, phase) if posed.is_excited else None,
    )


def _solved(
    even: _Even,
    faulty: Sequence[PosedStage],
    grid: PhaseGrid,
    max_hz: float,
    tolerance: float,
) -> tuple[Deviations, IntArray, IntArray, ComplexArray, ComplexArray]:
    """Return turns, places of their lines, the healthy ones, and what faults add in each turn."""
    period, healthy = max(posed.period for posed in faulty), even.posed
    found = _refined(
        grid, tolerance, lambda own: _changes(healthy, even.motion(own), faulty, period)
    )
    count = _count(healthy, max_hz, period)
    number, carrier, added = healthy.heard(found, count, period)
    of_mesh, beside, sound = healthy.heard(found.mesh, count // period, 1)
    number = np.concatenate([number, of_mesh * period])
    carrier = np.concatenate([carrier, beside])
    span = 1 + 2 * int(np.abs(carrier).max(initial=0))
    _, first, where = np.unique(number * span + carrier, return_index=True, return_inverse=True)
    lines = np.zeros((1 + len(added), len(first)), dtype=np.complex128)
    lines[1:, where[: added.shape[1]]], lines[0, where[added.shape[1] :]] = added, sound[0]
    return found, number[first], carrier[first], lines[0], lines[1:]


def _changes(
    healthy: PosedStage, motion: PeriodicMotion, faulty: Sequence[PosedStage], period: int
) -> Deviations:
    """Return what faults of teeth change in a turn of P mesh periods, case by case."""
    where = tuple(sorted({place for posed in faulty for place in _changed(posed, period)})) or (0,)
    phases = np.array(where)[:, None, None] + motion.grid.phase
    delta = np.zeros((len(faulty), len(where), *motion.kappa.shape))
    # sizes of a kind may share a pulse
    known: dict[tuple[object, ...], FloatArray] = {}
    for posed, own in zip(faulty, delta, strict=True):
        for number, mesh in enumerate(posed.members):
            for train in mesh.mechanics.stiffness.pulses:
                for term in train.terms:
                    place = (term.pulse, term.offset, term.face_start, term.face_end)
                    key = (*place, train.period_mesh, mesh.lead)
                    if key not in known:
                        alone = replace(train, terms=(replace(term, weight=healthy.scale),))
                        known[key] = alone.at(phases + mesh.lead)
                    own[:, number] += term.weight * known[key]
    moved = np.array([_moved(posed, phases).swapaxes(0, 1) for posed in faulty])
    return deviations(motion, period, where, delta, moved if moved.any() else None)


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
    posed: Sequence[PosedStage],
    found: PeriodicMotion | Deviations,
    mean_m: FloatArray,
    lines: ComplexArray,
    **same: Any,
) -> list[MeshLines]:
    """Return the lines of each turn by themselves."""
    columns = found.unresolved, found.contact_lost, mean_m
    told = zip(posed, lines, *(own.tolist() for own in columns), strict=True)
    names = ("posed", "displacement", "error", "contact_lost", "mean_m")
    return [MeshLines(**dict(zip(names, own, strict=True)), **same) for own in told]


def _count(posed: PosedStage, max_hz: float, period: int) -> int:
    return math.floor(max_hz / posed.mechanics.mesh_frequency_hz * period * (1 + 1e-12))


def _moved(posed: PosedStage, phases: FloatArray) -> FloatArray:
    """Return e [m] of every mesh at some phases, (meshes, *phases.shape)."""
    found = np.zeros((len(posed.members), *phases.shape))
    for own, moved in zip(posed.members, found, strict=True):
        if own.excitation is not None:
            moved[:] = own.excitation.at(phases + own.lead)
    return found


def _changed(posed: PosedStage, period: int) -> set[int]:
    """Mesh periods of P in which a mesh differs."""
    found: set[int] = set()
    for mesh in posed.members:
        stiffness = mesh.mechanics.stiffness
        spans = [
            (t.offset, t.pulse.length + t.face_end * train.overlap_ratio, train.period_mesh)
            for train in stiffness.pulses
            for t in train.terms
        ]
        spans += [
            ((e.tooth or 1) - 1, stiffness.total_contact_ratio, e.period_mesh)
            for e in mesh.errors
            if isinstance(e, FlankError)
        ]
        for start, length, repeats in spans:
            first = math.floor(start - mesh.lead + 1e-9)
            last = math.ceil(start - mesh.lead + length - 1e-9)
            for turn in range(0, period, repeats):
                found.update((turn + i) % period for i in range(first, max(last, first + 1)))
    return found


def _cycles(posed: PosedStage, highest_hz: float) -> float:
    """Return the cycles a mesh period that panels are to follow: motion times highest line.

    The motion itself is followed with a margin, also where no high line is asked for.
    """
    natural, trains = posed.fastest_hz, posed.mechanics.stiffness.trains
    terms = [term for train in trains for term in train.terms]
    fastest = max((term.pulse.fastest for term in terms), default=0.0) / (2 * math.pi)
    mesh_hz = posed.mechanics.mesh_frequency_hz
    return max(max(2 * natural, natural + highest_hz) / mesh_hz, fastest)


def _corners(posed: PosedMesh, trains: Iterable[PulseTrain]) -> Iterator[tuple[int, FloatArray]]:
    """Give mesh phases at which stiffness or excitation are not smooth, and when they repeat."""
    yield 1, np.zeros(1)
    for train in trains:
        for term in train.terms:
            faces = {face * train.overlap_ratio for face in (term.face_start, term.face_end)}
            limits = term.offset + term.pulse.edges
            yield train.period_mesh, np.concatenate([face + limits for face in faces])
    overlap = posed.mechanics.stiffness.overlap_ratio
    for error in posed.errors:
        if isinstance(error, FlankError):
            limits = (error.tooth or 1) - 1 + error.gap.edges
            yield error.period_mesh, np.add.outer([0.0, overlap], limits).ravel()


def _turn_grid(posed: PosedStage, highest_hz: float) -> PhaseGrid:
    """Return panels round a turn, with edges at all corners of stiffness and excitation."""
    period, found = posed.period, []
    for mesh in posed.members:
        stiffness, lead = mesh.mechanics.stiffness, mesh.lead
        # the last one moves with all gears
        moving = stiffness.modulations[-1:]
        found += [train.corners(train.offsets, period) - lead for train in moving]
        # damaged teeth lose what they lose where the teeth would be without the errors, and single
        # errors are shared as by these
        apart = moving and not any(isinstance(error, FlankError) for error in mesh.errors)
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
    check_word("kind=", kind, ("crack", "stiffness", "breakage", "pitting", "spall"))
    machine = load_machine(machine)
    check_range("stage", stage, 1, len(machine.stages))
    places = {own: mesh for (at, own), mesh in gear_places(machine).items() if at == stage}
    check_word("gear ", gear, places)
    check_range("loss", loss, 0.0, 0.999)
    text = f"{kind}:{stage}:{gear}:1:{float(loss) or SMALL_LOSS!r}"
    place = MeshPlace(machine, stage, operating, form, places[gear])
    healthy, faulty = place.posed(), place.posed([text])
    highest_hz = healthy.limit_hz(None)
    if max_order is not None:
        check_positive("max_order", max_order)
        highest_hz = max_order * machine.operating[operating].shaft1_hz
    if _count(healthy, highest_hz, faulty.period) < 1:
        raise ArgumentError(f"max_order={max_order} lies below the first line: nothing is left")
    grid = contact_grid([healthy, faulty], highest_hz)
    _, number, carrier, even, (added,) = _solved(
        _Even(healthy), [faulty], grid, highest_hz, math.inf
    )
    turns = number / faulty.period + carrier * float(healthy.pass_order)
    to_acceleration = -((2 * math.pi * turns * healthy.mechanics.mesh_frequency_hz) ** 2)
    lost = faulty.loss(healthy)
    return LossResponse(
        stage=stage,
        gear=gear,
        kind=kind,
        teeth=faulty.period,
        operating=operating,
        loss=lost if loss else 0.0,
        number=number,
        carrier=carrier,
        order=np.asarray(turns * healthy.order),
        frequency_hz=np.asarray(turns * healthy.mechanics.mesh_frequency_hz),
        acceleration=to_acceleration * added / lost,
        mesh_acceleration=to_acceleration * even,
    )
