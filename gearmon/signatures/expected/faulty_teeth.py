"""Lines of meshes with one faulty tooth or gear, of many sizes at once.

A fault of tooth 1 changes the mesh for the contact of that tooth only, and only that is solved anew
(see `contact_motion`), exactly for every size. Eccentricity, cumulative pitch error and
misalignment act all through the turn: they shift the contact of every pair a little, and with it
the corners of the stiffness; their turns are solved as a whole, on panels that follow the corners.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.excitation import FlankError
from gearmon.gears.modulation import ModulationTrain, state_of
from gearmon.gears.pulses import PulseTrain
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result
from gearmon.signatures.expected.contact_motion import (
    Deviations,
    PeriodicMotion,
    PhaseGrid,
    deviations,
    lines_per_unit,
)
from gearmon.signatures.expected.mesh import (
    ComplexArray,
    FloatArray,
    IntArray,
    MeshLines,
    PosedMesh,
    mesh_with,
    posed_mesh,
)

_Motion = TypeVar("_Motion", PeriodicMotion, Deviations)

#: How often panels are halved at most.
MOST_HALVINGS = 4
#: Rounds of putting a corner where the contact is when it is reached: a shift of 1e-2 is then 1e-8.
ROUNDS = 4
#: Loss of a tooth at whose contact the answer per unit of loss is taken.
SMALL_LOSS = 1e-3


def healthy_lines(posed: PosedMesh, max_hz: float, tolerance: float) -> MeshLines:
    """Solve a mesh whose mesh periods are all alike.

    Parameters
    ----------
    posed : PosedMesh
    max_hz : float
        Highest frequency [Hz].
    tolerance : float
        Relative error of the acceleration (an estimate).
    """
    return _periodic(posed, max_hz, tolerance, "")


def faulty_lines(
    healthy: PosedMesh, faulty: Sequence[PosedMesh], gear: str, max_hz: float, tolerance: float
) -> list[MeshLines]:
    """Solve a mesh with one fault of tooth 1 or of the whole of one gear, of several sizes.

    Parameters
    ----------
    healthy : PosedMesh
    faulty : sequence of PosedMesh
        The same mesh with the fault, size by size.
    gear : str
        Whose fault it is.
    max_hz : float
        Highest frequency [Hz].
    tolerance : float
        Relative error of what the fault adds (an estimate), or of the whole for turns that are
        solved as a whole.
    """
    if not all(_is_local(posed) for posed in faulty):
        return [_periodic(posed, max_hz, tolerance, gear) for posed in faulty]
    if all(posed.period == 1 for posed in faulty):
        return [_periodic(posed, max_hz, tolerance, "") for posed in faulty]
    period = max(posed.period for posed in faulty)
    count = _count(healthy, max_hz, period)
    found = _refined(
        contact_grid([healthy, *faulty], max_hz),
        tolerance,
        lambda grid: contact_changes(healthy, faulty, grid, period),
        lambda made: max(made.unresolved.max(), made.mesh.unresolved),
    )
    lines = found.lines(count)
    lines[:, period - 1 :: period] += found.mesh.lines(count // period)
    errors = np.maximum(found.unresolved, found.mesh.unresolved)
    return [
        _lines(posed, gear, period, own, "contact", float(error), bool(least <= 0))
        for posed, own, error, least in zip(faulty, lines, errors, found.least_force, strict=True)
    ]


def contact_changes(
    healthy: PosedMesh, faulty: Sequence[PosedMesh], grid: PhaseGrid, period: int
) -> Deviations:
    """Return what a fault of a tooth changes in a turn of P mesh periods, size by size."""
    window = min(period, max(_window(posed) for posed in faulty))
    kappa = np.stack([_kappa(posed, grid, window) for posed in faulty])
    moved = [_moved(posed, grid, window) for posed in faulty]
    excitation = None
    if any(e is not None for e in moved):
        still = np.zeros(kappa.shape[1:])
        excitation = np.stack([still if e is None else e for e in moved])
    return deviations(periodic_motion(healthy, grid), period, kappa, excitation)


def periodic_motion(posed: PosedMesh, grid: PhaseGrid) -> PeriodicMotion:
    """Solve a mesh on panels of its whole period."""
    own = posed.mechanics
    return PeriodicMotion(
        grid=grid,
        gamma=own.damping_ns_per_m * _scale(posed) * own.mesh_frequency_hz,
        phi=own.force_n * _scale(posed),
        kappa=_kappa(posed, grid, 1),
        excitation=_moved(posed, grid, 1),
    )


def contact_grid(meshes: Sequence[PosedMesh], max_hz: float) -> PhaseGrid:
    """Return panels of a mesh period on which all these meshes can be solved."""
    corners = np.concatenate([_corners(posed) for posed in meshes])
    return PhaseGrid.between(corners, max(_cycles(posed, max_hz) for posed in meshes))


def pair_loss(faulty: PosedMesh, healthy: PosedMesh) -> float:
    """Return the share of the stiffness of a pair, integrated over its contact, that is lost."""
    own, whole = faulty.mechanics.stiffness, healthy.mechanics.stiffness
    return float(own.period_mesh * (1 - own.mean_n_per_m / whole.mean_n_per_m))


def _periodic(posed: PosedMesh, max_hz: float, tolerance: float, gear: str) -> MeshLines:
    """Solve a mesh over its period, on panels that are halved until nothing is left unresolved."""
    found = _refined(
        contact_grid([posed], max_hz) if _is_local(posed) else _turn_grid(posed, max_hz),
        tolerance,
        lambda grid: periodic_motion(posed, grid),
        lambda made: made.unresolved,
    )
    period, method = posed.period, "contact" if _is_local(posed) else "whole turn"
    half = found.lines(_count(posed, max_hz, period), period)
    return _lines(posed, gear, period, half, method, found.unresolved, found.least_force <= 0)


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


def _lines(
    posed: PosedMesh,
    gear: str,
    period: int,
    displacement: ComplexArray,
    method: str,
    error: float,
    lost: bool,
) -> MeshLines:
    return MeshLines(
        mechanics=posed.mechanics,
        mesh_order=posed.order,
        period=period,
        number=np.arange(1, len(displacement) + 1),
        displacement=displacement,
        marked={gear: period} if period > 1 else {},
        method=method,
        error=error,
        contact_lost=lost,
    )


def _count(posed: PosedMesh, max_hz: float, period: int) -> int:
    return math.floor(max_hz / posed.mechanics.mesh_frequency_hz * period * (1 + 1e-12))


def _scale(posed: PosedMesh) -> float:
    """Return T^2/m."""
    own = posed.mechanics
    return 1 / (own.equivalent_mass_kg * own.mesh_frequency_hz**2)


def _kappa(posed: PosedMesh, grid: PhaseGrid, periods: int) -> FloatArray:
    """Return k T^2/m in the first periods of a grid, shape (periods * panels, points)."""
    return np.asarray(posed.mechanics.stiffness.at(_phases(grid, periods)) * _scale(posed))


def _moved(posed: PosedMesh, grid: PhaseGrid, periods: int) -> FloatArray | None:
    """Return e [m] there, same shape; None where nothing moves."""
    return None if posed.excitation is None else posed.excitation.at(_phases(grid, periods))


def _phases(grid: PhaseGrid, periods: int) -> FloatArray:
    phases = np.arange(periods)[:, None, None] + grid.phase
    return np.asarray(phases.reshape(-1, grid.phase.shape[-1]))


def _is_local(posed: PosedMesh) -> bool:
    """Whether a fault acts in a few mesh periods of a turn, or in all of them alike."""
    if posed.mechanics.stiffness.modulations:
        return False
    errors = () if posed.excitation is None else posed.excitation.errors
    return all(isinstance(e, FlankError) or e.period_mesh == 1 for e in errors)


def _window(posed: PosedMesh) -> int:
    """Mesh periods, from the entry of tooth 1, in which the mesh differs."""
    stiffness = posed.mechanics.stiffness
    ends = [
        term.offset + term.pulse.length + term.face_end * train.overlap_ratio
        for train in stiffness.pulses
        for term in train.terms
    ]
    if posed.excitation is not None:
        ends.append(stiffness.total_contact_ratio)
    return min(posed.period, max(1, math.ceil(max(ends, default=1.0) - 1e-9)))


def _cycles(posed: PosedMesh, highest_hz: float) -> float:
    """Return the cycles a mesh period that panels are to follow: motion times highest line.

    The motion itself is followed with a margin, also where no high line is asked for.
    """
    own, natural = posed.mechanics, posed.mechanics.natural_frequency_hz
    terms = [term for train in own.stiffness.trains for term in train.terms]
    fastest = max((term.pulse.fastest for term in terms), default=0.0) / (2 * math.pi)
    return max(max(2 * natural, natural + highest_hz) / own.mesh_frequency_hz, fastest)


def _corners(posed: PosedMesh) -> FloatArray:
    """Mesh phases at which stiffness or excitation are not smooth."""
    stiffness = posed.mechanics.stiffness
    found = [np.zeros(1), *(_pulse_corners(train) for train in stiffness.trains)]
    for error in () if posed.excitation is None else posed.excitation.errors:
        if isinstance(error, FlankError):
            limits = error.gap.edges
            found += [limits, limits + stiffness.overlap_ratio]
    return np.concatenate(found)


def _pulse_corners(train: PulseTrain) -> FloatArray:
    found = [np.zeros(0)]
    for term in train.terms:
        limits = term.offset + np.concatenate([term.pulse.starts, term.pulse.ends])
        faces = (term.face_start, term.face_end) if train.overlap_ratio else (0.0,)
        found += [limits + face * train.overlap_ratio for face in faces]
    return np.concatenate(found)


def _turn_grid(posed: PosedMesh, highest_hz: float) -> PhaseGrid:
    """Return panels round a turn, with edges at all corners of stiffness and excitation."""
    stiffness, period = posed.mechanics.stiffness, posed.period
    moving = [
        train
        for train in stiffness.modulations
        if any(offset.leaving or offset.entering for offset in train.offsets)
    ]
    found = [_moved_corners(train, period, stiffness.overlap_ratio) for train in moving]
    if not moving:
        found = [np.add.outer(np.arange(period), _corners(posed)).ravel()]
    corners = np.concatenate([*found, _kinks(posed)])
    return PhaseGrid.between(corners, _cycles(posed, highest_hz), period)


def _moved_corners(train: ModulationTrain, period: int, overlap: float) -> FloatArray:
    """Return where corners of the pulses of all pairs lie [mesh periods]."""
    family = train.family
    at_rest = family.pulse(0.0)
    edges = np.append(at_rest.starts, at_rest.ends[-1:])
    place = np.add.outer(np.arange(period), edges)
    spread = np.array([0.0, overlap] if overlap else [0.0])
    place = place[..., None] + spread
    home = place.copy()
    for _ in range(ROUNDS):
        flat = place.ravel()
        state = state_of(
            train.offsets, [2 * np.pi * flat / o.teeth for o in train.offsets], train.free_gap_m
        )
        shift = family.entry(state.leaving, state.entering)
        grown = _edge_shifts(train, state.lost.reshape(place.shape))
        place = home + shift.reshape(place.shape) + grown
    return np.asarray(place.ravel())


def _edge_shifts(train: ModulationTrain, lost: FloatArray) -> FloatArray:
    """Return by how much the edges of a pulse lie later where its contact ratio is smaller."""
    if not train.family.largest:
        return np.zeros(lost.shape)
    # the edges are linear in the contact ratio but for rounding: two pulses tell all
    half = 0.5 * train.family.largest
    more, less = (train.family.pulse(value) for value in (half, -half))
    slope = (
        np.append(more.starts, more.ends[-1:]) - np.append(less.starts, less.ends[-1:])
    ) / train.family.largest
    return np.asarray(lost * slope[:, None])


def _kinks(posed: PosedMesh) -> FloatArray:
    """Return phases at which a wobbling gear changes the end of its face, or lifts off a part."""
    found = [np.zeros(1)]
    gap = posed.mechanics.stiffness.free_gap_m
    for train in posed.mechanics.stiffness.modulations:
        for offset in train.offsets:
            size, angle = abs(offset.lead_m), math.atan2(offset.lead_m.imag, offset.lead_m.real)
            if size:
                inner = math.acos(min(1.0, gap / size))
                ends = np.array([inner, math.pi - inner, math.pi + inner, -inner])
                whole = np.concatenate([ends, [0.5 * math.pi, 1.5 * math.pi]]) - angle
                found.append(whole / (2 * math.pi) * offset.teeth)
    return np.concatenate(found)


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
        r = 1..n: harmonics of the turn of the gear in its mesh; mesh harmonic h is r = h z.
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
    healthy = posed_mesh(machine, stage, operating, form=form, mesh=place)
    faulty = posed_mesh(machine, stage, operating, [text], form=form, mesh=place)
    highest_hz = healthy.limit_hz(None)
    if max_order is not None:
        check_positive("max_order", max_order)
        highest_hz = max_order * machine.operating[operating].shaft1_hz
    teeth, mesh_hz = faulty.period, healthy.mechanics.mesh_frequency_hz
    count = _count(healthy, highest_hz, teeth)
    if count < 1:
        raise ArgumentError(f"max_order={max_order} lies below the first line: nothing is left")
    grid, lost = contact_grid([healthy, faulty], highest_hz), pair_loss(faulty, healthy)
    if loss:
        changes = contact_changes(healthy, [faulty], grid, teeth)
        even, added = changes.mesh, changes.lines(count)[0]
    else:
        even = periodic_motion(healthy, grid)
        kappa = _kappa(faulty, grid, _window(faulty))
        added = lines_per_unit(even, teeth, kappa, count)
    mesh = np.zeros(count, dtype=np.complex128)
    mesh[teeth - 1 :: teeth] = even.lines(count // teeth)
    number = np.arange(1, count + 1)
    frequency_hz = number * (mesh_hz / teeth)
    to_acceleration = -((2 * math.pi * frequency_hz) ** 2)
    return LossResponse(
        stage=stage,
        gear=gear,
        kind=kind,
        teeth=teeth,
        operating=operating,
        loss=lost if loss else 0.0,
        number=number,
        order=np.asarray(number * (healthy.order / teeth), dtype=np.float64),
        frequency_hz=np.asarray(frequency_hz, dtype=np.float64),
        acceleration=to_acceleration * added / lost,
        mesh_acceleration=to_acceleration * mesh,
    )
