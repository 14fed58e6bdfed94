"""What damaged teeth take: from what is measured on a tooth to the loss of its pair, and back.

A loss is a few pulses: along the contact of the pair, on a part of its face width, the share of the
stiffness that is gone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.faults import BANDS, Fault
from gearmon.gears.pairs import MeshPair, mesh_pairs
from gearmon.gears.pulses import (
    Losses,
    Pulse,
    PulseTerm,
    distinct,
    gauss,
    lost_share,
    panel_nodes,
    union,
)
from gearmon.gears.tooth_damage import (
    LARGEST_WIDTH,
    SOUND,
    Hole,
    ToothDamage,
    largest_size,
    tooth_damage,
)
from gearmon.gears.tooth_pairs import ToothPair, teeth_of

#: Slices of the cracked part of a helical face.
SLICES = 8
#: Gauss points of a loss between its corners: it is that of a beam, taken once for all meshes.
LOSS_POINTS = 32


@dataclass(frozen=True, kw_only=True)
class PairLoss:
    """Loss of stiffness of the pair of a damaged tooth.

    Parameters
    ----------
    mean : float
        Loss of its mean over the contact: the measure that sizes are converted to.
    greatest : float
        Largest loss at any point of the contact.
    at_middle : float
        Loss in the middle of the contact.
    """

    mean: float
    greatest: float
    at_middle: float


def loss_in_contact(fault: Fault, length: float, pitch_phase: float) -> Losses:
    """Return where in the contact of its pair a fault given as a loss takes it.

    Parameters
    ----------
    fault : Fault
    length : float
        Length of the contact of a pair (of one transverse section) [mesh periods].
    pitch_phase : float
        Mesh periods from the entry to the pitch point.

    Returns
    -------
    tuple of PulseTerm
        Empty for a fault of size 0.

    Raises
    ------
    ArgumentError
        If the size is no loss of stiffness.
    """
    if fault.loss == 0:
        return ()
    if fault.kind == "breakage":
        return (PulseTerm(Pulse.constant(0.0, length), face_end=fault.loss),)
    # a pitch point near an end of the path leaves less of the band in contact
    half = 0.5 * BANDS[fault.kind] * length if fault.kind in BANDS else math.inf
    start, end = max(0.0, pitch_phase - half), min(length, pitch_phase + half)
    return (PulseTerm(Pulse.constant(start, end), fault.loss),) if end > start else ()


def measured_losses(
    faults: Sequence[Fault],
    pair: ToothPair,
    index: int,
    is_helical: bool = False,
    length: float | None = None,
) -> Losses:
    """Return the loss that measured faults of one tooth cause along the contact of its pair.

    Load that finds no flank, over a spall or where the tooth is broken off, is not carried there:
    the line of contact is shorter by the face that is lost, and what is left of the face carries
    it, slice by slice as helical teeth do. So a spall as high as the flank costs what a breakage as
    wide does, in proportion to the face, and a shorter one costs that while the contact passes it;
    the section of the tooth, which the spall weakens too, counts beside it. Pits are small and
    many, and between them the flank carries: they only shorten the contact.

    Parameters
    ----------
    faults : sequence of Fault
        With sizes that are no losses.
    pair : ToothPair
    index : {0, 1}
        Gear of the tooth.
    is_helical : bool
        Whether parts of the face are in contact one after the other, so that damage acts on its
        own part only.
    length : float, optional
        Nominal length of the contact on which the true one is laid [mesh periods].
    """
    damage = tooth_damage(faults, pair.teeth[index])
    parts = [_broken(fault, pair, index) for fault in faults if fault.kind == "breakage"]
    parts += [_without_flank(hole, pair, index) for hole in damage.holes if not hole.round]
    if not damage.is_none:
        parts.append(_weaker_sections(damage, pair, index, is_helical))
    losses: Losses = reduce(union, parts, ())
    nominal = pair.contact_ratio if length is None else length
    factor = nominal / pair.contact_ratio
    if abs(factor - 1) > 1e-9:
        losses = tuple(replace(p, pulse=p.pulse.stretched(factor)) for p in losses)
    if any(fault.kind == "missing" for fault in faults):
        losses = union(losses, (PulseTerm(_bridged(pair, nominal)),))
    return losses


def stiffness_loss(fault: Fault, pair: ToothPair, index: int) -> PairLoss:
    """Return the loss of pair stiffness that a fault means.

    Parameters
    ----------
    fault : Fault
        With any size.
    pair : ToothPair
    index : {0, 1}
        Gear of the tooth.
    """
    if fault.is_loss:
        losses = loss_in_contact(fault, pair.contact_ratio, 0.5 * pair.contact_ratio)
    else:
        losses = measured_losses([fault], pair, index)
    mean, greatest = _mean_loss(losses, pair)
    middle = lost_share(losses, np.array(0.5 * pair.contact_ratio))
    return PairLoss(mean=mean, greatest=greatest, at_middle=float(middle))


def _mean_loss(losses: Losses, pair: ToothPair) -> tuple[float, float]:
    """Mean loss over the contact, weighted with the stiffness, and the greatest."""
    corners = [np.array([0.0, pair.contact_ratio]), *(p.pulse.edges for p in losses)]
    edges = distinct(np.clip(np.concatenate(corners), 0.0, pair.contact_ratio), 1e-12)
    phase = panel_nodes(edges)
    stiffness = pair.compliances(pair.roll(phase)).stiffness
    lost = lost_share(losses, phase)
    weights = gauss(phase.shape[1])[1] * np.diff(edges)[:, None] * stiffness
    return float((weights * lost).sum() / weights.sum()), float(lost.max())


def size_for_loss(fault: Fault, loss: float, pair: ToothPair, index: int) -> Fault:
    """Return the same fault with the size at which its pair loses this much on average.

    Parameters
    ----------
    fault : Fault
        With a size in a unit that is no loss; its value does not matter.
    loss : float, in [0, 1)
        Mean loss of the stiffness of the pair.
    pair : ToothPair
    index : {0, 1}

    Raises
    ------
    ArgumentError
        If no size of this kind of damage costs so much.
    """
    if fault.unit == "level":
        fault = replace(fault, unit="flank", size=0.1)
    if fault.is_loss or fault.unit == "tooth":
        raise ArgumentError(f"fault {fault} has no size to be found; give one in mm or as share")
    if not 0 <= loss < 1:
        raise ArgumentError(f"loss={loss:g} must lie in [0, 1)")
    most_size = largest_size(fault, pair.teeth[index])
    most = _loss_of_size(fault, most_size, pair, index)
    if loss > most:
        raise ArgumentError(
            f"a {fault.kind} costs at most {100 * most:.3g} % of the stiffness of its pair, at "
            f"{most_size:.4g}{fault.unit}; loss={100 * loss:.3g} % is out of its reach"
        )
    if loss in (0, most):
        return replace(fault, size=most_size if loss else 0.0)

    def missed(size: float) -> float:
        return _loss_of_size(fault, size, pair, index) - loss

    return replace(fault, size=brentq(missed, 0.0, most_size, rtol=1e-9))


@lru_cache(maxsize=64)
def _loss_of_size(fault: Fault, size: float, pair: ToothPair, index: int) -> float:
    return _mean_loss(measured_losses([replace(fault, size=size)], pair, index), pair)[0]


def _broken(fault: Fault, pair: ToothPair, index: int) -> Losses:
    """Return the loss of a broken-off part of the tooth."""
    tooth, start, end = pair.teeth[index], 0.0, pair.contact_ratio
    width = 1e3 * tooth.face_width_m
    begin, share = (fault.shape.start or 0.0) / width, fault.size / width
    if share > 0.99 or begin + share > 1 + 1e-9:
        lost = "more than" if begin + share > 1 + 1e-9 else "all of"
        raise ArgumentError(
            f"fault {fault}: {lost} the face width of {width:g} mm is broken off; for a whole "
            f"tooth write missing:{fault.stage}:{fault.gear}:{fault.tooth}"
        )
    if fault.shape.height is not None:
        broken = tooth.radius_below_tip(1e-3 * fault.shape.height)
        angle = tooth.angle_at_radius(max(broken, tooth.base_radius_m))
        edge = pair.phase_of(index, angle)
        # the tip of the first gear leaves last, that of the second enters first
        start, end = (max(0.0, edge), end) if index == 0 else (0.0, min(end, edge))
    return _gone(start, end, begin, share)


def _gone(start: float, end: float, begin: float, share: float) -> Losses:
    """Return the loss of a part of the face, from `begin` on, while the contact passes it."""
    if share == 0 or end <= start:
        return ()
    return (PulseTerm(Pulse.constant(start, end), 1.0, 0.0, begin, min(1.0, begin + share)),)


def _without_flank(hole: Hole, pair: ToothPair, index: int) -> Losses:
    """Return the loss of the face on which a spall leaves no flank, while the contact passes it.

    Of a spall across the whole face `LARGEST_WIDTH` is lost, and its edges carry the rest.
    """
    tooth = pair.teeth[index]
    ends = [pair.phase_of(index, angle) for angle in hole.angles(tooth)]
    start, end = np.clip(sorted(ends), 0.0, pair.contact_ratio).tolist()
    return _gone(start, end, hole.start, min(hole.width_m / tooth.face_width_m, LARGEST_WIDTH))


@lru_cache(maxsize=64)
def _bridged(pair: ToothPair, length: float) -> Pulse:
    """Return the loss of a pair that is gone while the ends of its neighbours bridge the gap.

    Where no other pair is in its regular contact, the corner of a neighbour's tip still carries,
    about as stiffly as at the end of its path.
    """
    part, few = length % 1.0, math.floor(length)
    factor = pair.contact_ratio / length
    ends = pair.compliances(pair.roll(np.array([0.0, pair.contact_ratio]))).stiffness.mean()

    def share(phase: FloatArray) -> FloatArray:
        own = pair.compliances(pair.roll(factor * phase)).stiffness
        alone = (few == 1) & (phase >= part) & (phase < 1)
        return np.where(alone, 1 - np.minimum(ends / own, 1.0), 1.0)

    edges = distinct([0.0, *(x for x in (part, 1.0) if 0 < x < length), length], 1e-12)
    return Pulse.of(edges, share, LOSS_POINTS)


def _weaker_sections(damage: ToothDamage, pair: ToothPair, index: int, is_helical: bool) -> Losses:
    """Return the loss by weaker sections: over the whole face, or slice by slice."""
    if not is_helical:
        return (PulseTerm(_weaker(damage, pair, index)),)
    found = []
    for low, high in pairwise(_face_edges(damage, pair)):
        local = _slice(damage, low, high, pair.teeth[index].face_width_m)
        if not local.is_none:
            found.append(PulseTerm(_weaker(local, pair, index), 1.0, 0.0, low, high))
    return tuple(found)


def _weaker(damage: ToothDamage, pair: ToothPair, index: int) -> Pulse:
    beams = pair.beams(*((damage, SOUND) if index == 0 else (SOUND, damage)))

    def share(phase: FloatArray) -> FloatArray:
        roll = pair.roll(phase)
        return 1 - pair.compliances(roll).total / pair.compliances(roll, beams).total

    edges = distinct([0.0, *pair.corners(beams), pair.contact_ratio], 1e-12)
    return Pulse.of(edges, share, LOSS_POINTS)


def _face_edges(damage: ToothDamage, pair: ToothPair) -> list[float]:
    """Return shares of the face width at which the damage of a helical tooth changes."""
    edges = {0.0, 1.0}
    crack, width = damage.crack, pair.first.face_width_m
    if crack is not None:
        slices = 1 if crack.depths[0] == crack.depths[1] else SLICES
        end = min(1.0, crack.start + crack.extent)
        edges |= set(np.linspace(crack.start, end, slices + 1).tolist())
    for hole in damage.holes:
        if not hole.round:
            edges |= {hole.start, min(1.0, hole.start + hole.width_m / width)}
    return sorted(edges)


def _slice(damage: ToothDamage, low: float, high: float, width: float) -> ToothDamage:
    """Return the damage of a slice of the face, as if the whole face had it."""
    middle, crack = np.array([0.5 * (low + high)]), damage.crack
    if crack is not None:
        depth = float(crack.at(middle)[0])
        whole = replace(crack, depth_m=depth, far_depth_m=None, extent=1.0, start=0.0)
        crack = whole if depth else None
    holes = (
        hole if hole.round else replace(hole, width_m=width, start=0.0)
        for hole in damage.holes
        if hole.round or hole.start <= middle[0] <= hole.start + hole.width_m / width
    )
    return replace(damage, crack=crack, holes=tuple(holes))


def acting_faults(pair: MeshPair, faults: Iterable[Fault]) -> tuple[list[Fault], list[str]]:
    """Return the faults that act in this mesh, and notes on those that do not.

    Breakage, wear or a missing tooth of a planet acts in its meshes with sun and ring. Pitting and
    spalls are on the flank that meets the sun, and a root crack opens under the load of that flank:
    the ring loads the other flank and presses it shut, and a closed crack carries.

    Raises
    ------
    ArgumentError
        If the stage has no such gear or the gear no such tooth.
    """
    acting, notes = [], []
    stage_gears = {name for other in mesh_pairs(pair.stage, pair.number) for name in other.names}
    own = pair.names
    for fault in faults:
        if fault.gear not in stage_gears:
            pair.member(fault.gear)  # refuses it
        # the flank of a planet that meets the ring is not the one that is hurt
        far = fault.gear == "planet" and pair.second.internal
        if fault.gear not in own or (far and fault.kind in ("crack", *BANDS)):
            why = ": there it is pressed shut" if far and fault.kind == "crack" else ""
            notes.append(f"fault {fault} does not act in the {pair.name} mesh{why}")
        else:
            pair.check_tooth(f"fault {fault}", fault.gear, fault.tooth)
            acting.append(fault)
    if pair.given("contact_ratio") is not None and _needs_pitch(acting):
        notes.append(
            "the pitch point is taken in the middle of the contact: contact_ratio is given"
        )
    return acting, notes


def gear_losses(
    pair: MeshPair, faults: Sequence[Fault], length: float, teeth: ToothPair | None = None
) -> tuple[dict[int, Losses], dict[int, Losses]]:
    """Return the loss of each damaged tooth of each gear, by its number.

    Parameters
    ----------
    pair : MeshPair
    faults : sequence of Fault
        Of this mesh; wear is left aside.
    length : float
        Length of the contact of a pair [mesh periods].
    teeth : ToothPair, optional
        Known teeth of the pair; else they are made when a size asks for them.

    Raises
    ------
    ArgumentError
        If a size does not fit its tooth, or data that it needs are missing.
    """
    # the contact of the half-duty forms is a nominal one, on which the true one is laid
    pitch = pair.pitch_phase * length / pair.contact_ratio if _needs_pitch(faults) else 0.0
    found: tuple[dict[int, Losses], dict[int, Losses]] = {}, {}
    for index, (name, losses) in enumerate(zip(pair.names, found, strict=True)):
        hurt = [fault for fault in faults if fault.gear == name and fault.tooth is not None]
        for tooth in sorted({fault.tooth or 0 for fault in hurt}):
            own = [fault for fault in hurt if fault.tooth == tooth]
            parts = [loss_in_contact(fault, length, pitch) for fault in own if fault.is_loss]
            measured = [fault for fault in own if not fault.is_loss]
            if measured:
                parts.append(_measured(pair, index, measured, length, teeth))
            lost: Losses = reduce(union, parts, ())
            if lost:
                losses[tooth] = lost
    return found


def worn_losses(
    pair: MeshPair,
    faults: Sequence[Fault],
    length: float | None = None,
    teeth: ToothPair | None = None,
) -> tuple[Losses, Losses]:
    """Return the loss by wear in mm of all teeth of each gear; see `gear_losses`."""
    found = []
    for index, name in enumerate(pair.names):
        worn = [f for f in faults if f.kind == "wear" and f.gear == name and not f.is_loss]
        found.append(_measured(pair, index, worn, length, teeth) if worn else ())
    return found[0], found[1]


def _needs_pitch(faults: Sequence[Fault]) -> bool:
    return any(fault.is_loss and fault.kind in BANDS for fault in faults)


def _measured(
    pair: MeshPair,
    index: int,
    faults: Sequence[Fault],
    length: float | None,
    teeth: ToothPair | None,
) -> Losses:
    """Return the loss that sizes in mm or shares of the flank mean, in a contact of this length."""
    known = teeth_of(pair) if teeth is None else teeth
    return measured_losses(faults, known, index, pair.overlap_ratio > 0, length)
