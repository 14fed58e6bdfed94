"""What damaged teeth take from the stiffness of a mesh, as trains of missing pulses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from gearmon.errors import ArgumentError
from gearmon.gears.curve_pulses import product
from gearmon.gears.fault_sizes import measured_patches
from gearmon.gears.faults import BANDS, Fault, LossPatch, loss_patches, overlap, union
from gearmon.gears.loss_curves import LossCurve
from gearmon.gears.pairs import MeshPair, mesh_pairs
from gearmon.gears.potential_energy import teeth_of
from gearmon.gears.pulse_trains import PulseTerm, PulseTrain
from gearmon.gears.pulses import FloatArray, Pulse
from gearmon.gears.tooth_mesh import meeting
from gearmon.gears.tooth_pairs import ToothPair


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
    trains = []
    for member, teeth in zip(pair.members, losses, strict=True):
        terms = tuple(
            term
            for tooth, patches in teeth.items()
            for term in _terms(pulse, patches, -1.0, tooth - 1)
        )
        trains.append(_train(pair, member.name, member.teeth.teeth, terms))
    trains += _meetings(pair, pulse, losses)
    return tuple(train for train in trains if train.terms)


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


def wear_curve(pair: MeshPair, faults: Sequence[Fault], length: float) -> LossCurve | None:
    """Return what wear in mm leaves of every pair, or None without such wear."""
    patches: tuple[LossPatch, ...] = ()
    for member in pair.members:
        worn = [f for f in faults if f.kind == "wear" and f.gear == member.name and not f.is_loss]
        if worn:
            patches = union(patches, _measured(pair, member.name, worn, length, None))
    if not patches:
        return None

    def left(phase: FloatArray) -> FloatArray:
        total = np.ones(phase.shape)
        for patch in patches:
            total -= patch.weight * (1.0 if patch.curve is None else patch.curve.share(phase))
        return total

    corners = {corner for p in patches if p.curve for corner in p.curve.corners}
    return LossCurve(share=left, corners=tuple(sorted(corners)))


def _needs_pitch(faults: Sequence[Fault]) -> bool:
    return any(fault.is_loss and fault.kind in BANDS for fault in faults)


def _measured(
    pair: MeshPair, gear: str, faults: Sequence[Fault], length: float, teeth: ToothPair | None
) -> tuple[LossPatch, ...]:
    """Return the loss that sizes in mm or shares of the flank mean, in a contact of this length."""
    known = teeth_of(pair) if teeth is None else teeth
    index = [member.name for member in pair.members].index(gear)
    return measured_patches(faults, known, index, pair.overlap_ratio > 0, length)


def _meetings(
    pair: MeshPair, pulse: Pulse, losses: Sequence[dict[int, tuple[LossPatch, ...]]]
) -> list[PulseTrain]:
    """Return what was taken away twice where damaged teeth of both gears meet."""
    z1, z2 = (member.teeth.teeth for member in pair.members)
    terms: list[PulseTerm] = []
    for one, first in losses[0].items():
        for two, second in losses[1].items():
            offset = meeting(one - 1, z1, two - 1, z2)
            if offset is not None:
                terms += _terms(pulse, overlap(first, second), 1.0, offset)
    name = f"{pair.first.name} and {pair.second.name}"
    return [_train(pair, name, math.lcm(z1, z2), tuple(terms))]


def _terms(
    pulse: Pulse, patches: Sequence[LossPatch], sign: float, offset: float
) -> list[PulseTerm]:
    return [
        PulseTerm(
            pulse=_lost(pulse.window(patch.start, patch.end), patch),
            weight=sign * patch.weight,
            offset=offset,
            face_start=patch.face_start,
            face_end=patch.face_end,
        )
        for patch in patches
    ]


def _lost(pulse: Pulse, patch: LossPatch) -> Pulse:
    if patch.curve is None:
        return pulse
    return product(pulse, patch.curve.share, patch.curve.corners)


def _train(pair: MeshPair, gear: str, period: int, terms: tuple[PulseTerm, ...]) -> PulseTrain:
    return PulseTrain(gear=gear, period_mesh=period, overlap_ratio=pair.overlap_ratio, terms=terms)
