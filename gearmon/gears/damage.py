"""What damaged teeth take: from what is measured on a tooth to the loss of its pair, and back.

The losses of single teeth become trains of pulses that are missing from the mesh.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from gearmon.errors import ArgumentError
from gearmon.gears.faults import BANDS, Fault, LossCurve, LossPatch, loss_patches, overlap, union
from gearmon.gears.pairs import MeshPair, mesh_pairs
from gearmon.gears.pulses import (
    FloatArray,
    Pulse,
    PulseTerm,
    PulseTrain,
    distinct,
    gauss,
    panel_nodes,
)
from gearmon.gears.tooth_damage import (
    LARGEST_WIDTH,
    SOUND,
    Hole,
    ToothDamage,
    largest_size,
    tooth_damage,
)
from gearmon.gears.tooth_mesh import meeting
from gearmon.gears.tooth_pairs import ToothPair, teeth_of

#: Slices of the cracked part of a helical face.
SLICES = 8


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


# Sizes between which one is looked for: nearly straight pieces of the curve of losses.
_SIZES = 9


def measured_patches(
    faults: Sequence[Fault],
    pair: ToothPair,
    index: int,
    is_helical: bool = False,
    length: float | None = None,
) -> tuple[LossPatch, ...]:
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
    patches: tuple[LossPatch, ...] = ()
    for fault in faults:
        if fault.kind == "breakage":
            patches = union(patches, _broken(fault, pair, index))
    for hole in tooth_damage(faults, pair.teeth[index]).holes:
        if not hole.round:
            patches = union(patches, _without_flank(hole, pair, index))
    damage = tooth_damage(faults, pair.teeth[index])
    if not damage.is_none:
        patches = union(patches, _section_patches(damage, pair, index, is_helical))
    nominal = pair.contact_ratio if length is None else length
    factor = nominal / pair.contact_ratio
    if abs(factor - 1) > 1e-9:
        patches = tuple(patch.stretched(factor) for patch in patches)
    if any(fault.kind == "missing" for fault in faults):
        gone = LossPatch(1.0, 0.0, nominal, curve=_bridged(pair, nominal))
        patches = union(patches, (gone,))
    return patches


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
        pitch = 0.5 * pair.contact_ratio
        patches = loss_patches(fault, pair.contact_ratio, pitch)
    else:
        patches = measured_patches([fault], pair, index)
    mean, greatest = _mean_loss(patches, pair)
    middle = patch_loss(patches, np.array([0.5 * pair.contact_ratio]))
    return PairLoss(mean=mean, greatest=greatest, at_middle=float(middle[0]))


def _mean_loss(patches: Sequence[LossPatch], pair: ToothPair) -> tuple[float, float]:
    """Mean loss over the contact, weighted with the stiffness, and the greatest."""
    edges = _edges(patches, pair)
    phase = panel_nodes(edges)
    stiffness = pair.compliances(pair.roll(phase)).stiffness
    lost = patch_loss(patches, phase)
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

    sizes, losses = _losses_of_sizes(fault, pair, index)
    most_size, most = float(sizes[-1]), float(losses[-1])
    if loss > most:
        raise ArgumentError(
            f"a {fault.kind} costs at most {100 * most:.3g} % of the stiffness of its pair, at "
            f"{most_size:.4g}{fault.unit}; loss={100 * loss:.3g} % is out of its reach"
        )
    if loss in (0, most):
        return replace(fault, size=most_size if loss else 0.0)

    def missed(size: float) -> float:
        return _loss_of_size(fault, size, pair, index) - loss

    beyond = int(np.argmax(losses >= loss))
    size = brentq(missed, sizes[beyond - 1], sizes[beyond], rtol=1e-9)
    return replace(fault, size=size)


@lru_cache(maxsize=64)
def _loss_of_size(fault: Fault, size: float, pair: ToothPair, index: int) -> float:
    return _mean_loss(measured_patches([replace(fault, size=size)], pair, index), pair)[0]


@lru_cache(maxsize=64)
def _losses_of_sizes(fault: Fault, pair: ToothPair, index: int) -> tuple[FloatArray, FloatArray]:
    """Return sizes up to the largest and their losses, between which a size is looked for."""
    sizes = np.linspace(0.0, largest_size(fault, pair.teeth[index]), _SIZES)
    return sizes, np.array([_loss_of_size(fault, float(s), pair, index) for s in sizes])


def patch_loss(patches: Sequence[LossPatch], phase: FloatArray) -> FloatArray:
    """Return the loss at phases of the contact, of the whole face width."""
    total = np.zeros(phase.shape)
    for patch in patches:
        total += (patch.face_end - patch.face_start) * patch.at(phase)
    return total


def _broken(fault: Fault, pair: ToothPair, index: int) -> tuple[LossPatch, ...]:
    """Return the loss of a broken-off part of the tooth."""
    tooth, end = pair.teeth[index], pair.contact_ratio
    width = 1e3 * tooth.face_width_m
    begin = (fault.shape.start or 0.0) / width
    share = fault.size / width
    if begin + share > 1 + 1e-9:
        raise ArgumentError(
            f"fault {fault}: more than the face width of {width:g} mm is broken off; a whole tooth "
            f"is written missing:{fault.stage}:{fault.gear}:{fault.tooth}"
        )
    if share > 0.99:
        raise ArgumentError(
            f"fault {fault}: the whole face width is broken off; write "
            f"missing:{fault.stage}:{fault.gear}:{fault.tooth}"
        )
    start = 0.0
    if fault.shape.height is not None:
        broken = tooth.radius_below_tip(1e-3 * fault.shape.height)
        angle = tooth.angle_at_radius(max(broken, tooth.base_radius_m))
        edge = pair.phase_of(index, angle)
        # the tip of the first gear leaves last, that of the second enters first
        start, end = (max(0.0, edge), end) if index == 0 else (0.0, min(end, edge))
    if share == 0 or end <= start:
        return ()
    return (LossPatch(1.0, start, end, begin, min(1.0, begin + share)),)


def _without_flank(hole: Hole, pair: ToothPair, index: int) -> tuple[LossPatch, ...]:
    """Return the loss of the face on which a spall leaves no flank, while the contact passes it.

    Of a spall across the whole face `LARGEST_WIDTH` is lost, and its edges carry the rest.
    """
    tooth = pair.teeth[index]
    ends = [pair.phase_of(index, tooth.angle_at_height(h)) for h in (hole.low_m, hole.high_m)]
    start, end = np.clip(sorted(ends), 0.0, pair.contact_ratio).tolist()
    share = min(hole.width_m / tooth.face_width_m, LARGEST_WIDTH)
    if share == 0 or end <= start:
        return ()
    return (LossPatch(1.0, start, end, hole.start, min(1.0, hole.start + share)),)


def _bridged(pair: ToothPair, length: float) -> LossCurve:
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

    return LossCurve(share, (part, 1.0))


def _section_patches(
    damage: ToothDamage, pair: ToothPair, index: int, is_helical: bool
) -> tuple[LossPatch, ...]:
    """Return the loss by weaker sections: over the whole face, or slice by slice."""
    if not is_helical:
        return (_patch(damage, pair, index, 0.0, 1.0),)
    edges = _face_edges(damage, pair)
    patches = []
    for low, high in pairwise(edges):
        local = _slice(damage, low, high, pair.teeth[index].face_width_m)
        if not local.is_none:
            patches.append(_patch(local, pair, index, low, high))
    return tuple(patches)


def _patch(damage: ToothDamage, pair: ToothPair, index: int, low: float, high: float) -> LossPatch:
    beams = pair.beams(*((damage, SOUND) if index == 0 else (SOUND, damage)))

    def share(phase: FloatArray) -> FloatArray:
        roll = pair.roll(phase)
        return 1 - pair.compliances(roll).total / pair.compliances(roll, beams).total

    curve = LossCurve(share, tuple(pair.corners(beams).tolist()))
    return LossPatch(1.0, 0.0, pair.contact_ratio, low, high, curve)


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
    holes = []
    for hole in damage.holes:
        inside = hole.start <= middle[0] <= hole.start + hole.width_m / width
        if hole.round:
            holes.append(hole)
        elif inside:
            holes.append(replace(hole, width_m=width, start=0.0))
    return replace(damage, crack=crack, holes=tuple(holes))


def _edges(patches: Sequence[LossPatch], pair: ToothPair) -> FloatArray:
    corners = [0.0, pair.contact_ratio, *(corner for p in patches for corner in p.corners)]
    return distinct(np.clip(corners, 0.0, pair.contact_ratio), 1e-12)


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
    stage_gears = {m.name for p in mesh_pairs(pair.stage, pair.number) for m in p.members}
    own = {member.name for member in pair.members}
    for fault in faults:
        if fault.gear not in stage_gears:
            pair.member(fault.gear)
        elif fault.gear not in own or _far_flank(pair, fault):
            shut = ": there it is pressed shut" if fault.kind == "crack" else ""
            why = shut if fault.gear in own else ""
            notes.append(f"fault {fault} does not act in the {pair.name} mesh{why}")
        else:
            _check_tooth(pair, fault)
            acting.append(fault)
    if pair.given("contact_ratio") is not None and _needs_pitch(acting):
        notes.append(
            "the pitch point is taken in the middle of the contact: contact_ratio is given"
        )
    return acting, notes


def _far_flank(pair: MeshPair, fault: Fault) -> bool:
    one_sided = fault.kind == "crack" or fault.kind in BANDS
    return one_sided and pair.second.internal and fault.gear == "planet"


def _check_tooth(pair: MeshPair, fault: Fault) -> None:
    teeth = pair.member(fault.gear).teeth.teeth
    if fault.tooth is not None and fault.tooth > teeth:
        raise ArgumentError(
            f"fault {fault}: tooth {fault.tooth} does not exist, the {fault.gear} of {pair.where} "
            f"has {teeth} teeth"
        )


def damage_trains(pair: MeshPair, pulse: Pulse, faults: Sequence[Fault]) -> tuple[PulseTrain, ...]:
    """Return what the damaged teeth take away.

    Parameters
    ----------
    pair : MeshPair
    pulse : Pulse
        Stiffness [N/m] of a pair of sound teeth.
    faults : sequence of Fault
        Of this mesh; wear of all teeth is left aside.

    Returns
    -------
    tuple of PulseTrain
        One for each gear with damaged teeth and, where damaged teeth of both gears meet, one for
        the loss counted twice: what is left of a pair is the product of what each tooth leaves.
    """
    losses = [gear_losses(pair, member.name, faults, pulse.length) for member in pair.members]
    one, two = (
        [
            term
            for tooth, patches in teeth.items()
            for term in _terms(pulse, patches, -1.0, tooth - 1)
        ]
        for teeth in losses
    )
    return lost_trains(pair, one, two, _meetings(pair, pulse, losses))


def lost_trains(
    pair: MeshPair, one: list[PulseTerm], two: list[PulseTerm], both: list[PulseTerm]
) -> tuple[PulseTrain, ...]:
    """Return the trains of what damage of the one gear, of the other and of both takes away."""
    names = [member.name for member in pair.members]
    parts = zip(
        (*names, " and ".join(names)),
        (*pair.teeth, math.lcm(*pair.teeth)),
        (one, two, both),
        strict=True,
    )
    return tuple(
        PulseTrain(
            gear=gear, period_mesh=period, overlap_ratio=pair.overlap_ratio, terms=tuple(terms)
        )
        for gear, period, terms in parts
        if terms
    )


def gear_losses(
    pair: MeshPair,
    gear: str,
    faults: Sequence[Fault],
    length: float,
    teeth: ToothPair | None = None,
) -> dict[int, tuple[LossPatch, ...]]:
    """Return the loss of each damaged tooth of a gear.

    Parameters
    ----------
    pair : MeshPair
    gear : str
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
    own = [f for f in faults if f.gear == gear and f.tooth is not None]
    losses: dict[int, tuple[LossPatch, ...]] = {}
    for fault in own:
        if fault.is_loss and fault.loss > 0:
            tooth = int(fault.tooth or 0)
            losses[tooth] = union(losses.get(tooth, ()), loss_patches(fault, length, pitch))
    measured = [fault for fault in own if not fault.is_loss]
    for tooth in sorted({int(fault.tooth or 0) for fault in measured}):
        together = [fault for fault in measured if fault.tooth == tooth]
        patches = _measured(pair, gear, together, length, teeth)
        if patches:
            losses[tooth] = union(losses.get(tooth, ()), patches)
    return losses


def worn_patches(
    pair: MeshPair,
    faults: Sequence[Fault],
    length: float | None = None,
    teeth: ToothPair | None = None,
) -> tuple[tuple[LossPatch, ...], tuple[LossPatch, ...]]:
    """Return the loss by wear in mm of all teeth of each gear; see `gear_losses`."""
    found = []
    for member in pair.members:
        worn = [f for f in faults if f.kind == "wear" and f.gear == member.name and not f.is_loss]
        found.append(_measured(pair, member.name, worn, length, teeth) if worn else ())
    return found[0], found[1]


def wear_curve(pair: MeshPair, faults: Sequence[Fault], length: float) -> LossCurve | None:
    """Return what wear in mm leaves of every pair, or None without such wear."""
    patches = union(*worn_patches(pair, faults, length))
    if not patches:
        return None
    return LossCurve(
        lambda phase: 1 - np.asarray(sum(patch.at(phase) for patch in patches)),
        tuple(sorted({corner for patch in patches for corner in patch.corners})),
    )


def _needs_pitch(faults: Sequence[Fault]) -> bool:
    return any(fault.is_loss and fault.kind in BANDS for fault in faults)


def _measured(
    pair: MeshPair,
    gear: str,
    faults: Sequence[Fault],
    length: float | None,
    teeth: ToothPair | None,
) -> tuple[LossPatch, ...]:
    """Return the loss that sizes in mm or shares of the flank mean, in a contact of this length."""
    known = teeth_of(pair) if teeth is None else teeth
    index = [member.name for member in pair.members].index(gear)
    return measured_patches(faults, known, index, pair.overlap_ratio > 0, length)


def _meetings(
    pair: MeshPair, pulse: Pulse, losses: Sequence[dict[int, tuple[LossPatch, ...]]]
) -> list[PulseTerm]:
    """Return what was taken away twice where damaged teeth of both gears meet."""
    z1, z2 = pair.teeth
    terms: list[PulseTerm] = []
    for one, first in losses[0].items():
        for two, second in losses[1].items():
            offset = meeting(one - 1, z1, two - 1, z2)
            if offset is not None:
                terms += _terms(pulse, overlap(first, second), 1.0, offset)
    return terms


def _terms(
    pulse: Pulse, patches: Sequence[LossPatch], sign: float, offset: float
) -> list[PulseTerm]:
    found = []
    for p in patches:
        lost = pulse.window(p.start, p.end)
        if p.curve is not None:
            lost = lost.times(p.curve.share, p.curve.corners)
        found.append(PulseTerm(lost, sign * p.weight, offset, p.face_start, p.face_end))
    return found
