"""What damaged teeth take: from what is measured on a tooth to its pair and its mesh, and back.

A loss is a few pulses: along the contact of the pair, on a part of its face width, the share of the
stiffness that is gone. Every pair keeps a pulse of its own; the mesh stiffness is their sum. Pairs
whose stiffness is a given curve know nothing of one another. Teeth on elastic bodies do: neighbours
feel each other through the bodies of their gears, so a pair carries less than it would alone while
another is in contact, and a damaged tooth changes the load of its neighbours too.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, reduce
from itertools import chain, combinations, pairwise
from typing import TypeVar

import numpy as np
from scipy.optimize import brentq

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, check_word
from gearmon.gears.faults import BANDS, SIZES, Fault, GearError
from gearmon.gears.geometry import contact_zones
from gearmon.gears.pairs import MeshPair, mesh_pairs
from gearmon.gears.pulses import (
    POINTS,
    Losses,
    Pulse,
    PulseTerm,
    PulseTrain,
    distinct,
    gauss,
    lost_share,
    panel_nodes,
    union,
)
from gearmon.gears.tooth_damage import (
    LARGEST_WIDTH,
    SOUND,
    ToothDamage,
    face_part,
    largest_size,
    tooth_damage,
)
from gearmon.gears.tooth_pairs import ToothPair, teeth_of

#: Losses of the teeth of a gear, by tooth number; 0 for all of them.
GearLosses = dict[int, Losses]
BothLosses = tuple[GearLosses, GearLosses]
#: What is lost at the two teeth of a pair.
PairState = tuple[Losses, Losses]
_Wrong = TypeVar("_Wrong", Fault, GearError, Fault | GearError)
#: A pair keeps at least this share of its stiffness: a number for "nothing" that can be inverted.
LEAST_LEFT = 1e-12
#: Rounds of sharing a load that the contact depends on.
LOAD_ROUNDS = 4
SOUND_PAIR: PairState = ((), ())
#: Slices of the cracked part of a helical face.
SLICES = 8
#: Gauss points of a loss between its corners: it is that of a beam, taken once for all meshes.
LOSS_POINTS = 32


@dataclass(frozen=True, kw_only=True, eq=False)
class PairsInMesh(ABC):
    """Pairs of teeth in mesh, one mesh period apart.

    Parameters
    ----------
    worn : PairState
        Loss that all teeth of each gear have.
    teeth : ToothPair, optional
        Where they are known.
    points : int
        Gauss points between corners.
    """

    worn: PairState = SOUND_PAIR
    teeth: ToothPair | None = None
    points: int = POINTS

    @property
    @abstractmethod
    def corners(self) -> FloatArray:
        """Phases of the contact, from end to end, where what a sound pair carries is not smooth."""

    @property
    def length(self) -> float:
        """Length of the contact of a pair [mesh periods]."""
        return float(self.corners[-1])

    @abstractmethod
    def loads(self, phase: FloatArray, states: Sequence[PairState]) -> FloatArray:
        """Return what each pair carries per unit of deflection [N/m].

        Parameters
        ----------
        phase : ndarray, shape (pieces, points)
            Phase of the middle pair; within a row the same pairs are in contact.
        states : sequence of PairState
            Of the pairs from `reach` before it to `reach` after it, itself in the middle.

        Returns
        -------
        ndarray, shape (2 reach + 1, pieces, points)
        """

    @cached_property
    def reach(self) -> int:
        """How many pairs before and after one feel what it carries, in contact with it."""
        return max(0, math.ceil(self.length - 1e-12) - 1) if self.teeth else 0

    @cached_property
    def healthy(self) -> Pulse:
        """What a pair carries among sound neighbours, per unit of deflection [N/m]."""
        sound = [SOUND_PAIR] * len(self._places)
        edges = self._edges(sound)
        return Pulse.through(edges, self.loads(panel_nodes(edges, self.points), sound)[self.reach])

    def trains(self, pair: MeshPair, losses: BothLosses) -> list[PulseTrain]:
        """Return what damaged teeth take away, with a period each.

        Parameters
        ----------
        pair : MeshPair
        losses : (dict, dict)
            Of the first and of the second gear.

        Returns
        -------
        list of PulseTrain
            One for each gear with damaged teeth and, where damaged teeth of both gears meet, one
            for what the two miss there.
        """
        (one, two), z, overlap = losses, pair.teeth, pair.overlap_ratio
        parts = [(pair.first.name, z[0], (one, {})), (pair.second.name, z[1], ({}, two))]
        parts += [(" and ".join(pair.names), math.lcm(*z), losses)] * bool(one and two)
        found = [(gear, period, self._terms(own, z, period)) for gear, period, own in parts]
        return [PulseTrain(gear, period, overlap, terms) for gear, period, terms in found if terms]

    def _terms(self, losses: BothLosses, teeth: tuple[int, int], period: int) -> Losses:
        """Return what damaged teeth take from the pairs near them.

        Of both gears, where their damaged teeth meet: what they take less than by themselves.
        """
        found: list[PulseTerm] = []
        # of the pairs that enter one after the other, those that feel what each carries
        felt = np.add.outer(np.arange(period), self._places)
        # teeth that are damaged alike, with neighbours alike, lose the same
        known: dict[tuple[PairState, ...], Pulse] = {}
        # parts of the face width in which all damage is uniform along the face
        parts = chain(*losses[0].values(), *losses[1].values())
        edges = {0.0, 1.0}.union(*({part.face_start, part.face_end} for part in parts))
        for low, high in pairwise(sorted(edges)):
            inside = [_inside(own, low, high) for own in losses]
            of_gears = list(zip(inside, teeth, strict=True))
            near = [np.isin(felt % z + 1, [*own]).any(axis=1) for own, z in of_gears]
            entries = near[0] & near[1] if all(losses) else near[0] | near[1]
            for entry in np.flatnonzero(entries).tolist():
                places = felt[entry].tolist()
                met = [[own.get(n % z + 1, ()) for n in places] for own, z in of_gears]
                states = tuple(zip(*met, strict=True))
                if states not in known:
                    known[states] = self._lost(states)
                if len(known[states].series):
                    found.append(PulseTerm(known[states], -1.0, float(entry), low, high))
        return tuple(found)

    def _lost(self, states: Sequence[PairState]) -> Pulse:
        """Return the loss near damage; near that of both gears, less that near either."""
        edges = self._edges(states)
        phase = panel_nodes(edges, self.points)
        sound = self.healthy.value(phase)
        lost = sound - self.loads(phase, states)[self.reach]
        apart = [(own, ()) for own, _ in states], [((), own) for _, own in states]
        if all(any(map(any, alone)) for alone in apart):
            lost -= sum(sound - self.loads(phase, alone)[self.reach] for alone in apart)
        # in the pieces at its ends nothing is lost but for rounding
        used = np.flatnonzero(np.abs(lost).max(axis=1) > 1e-11 * self.healthy.area)
        first, last = (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 0)
        return Pulse.through(edges[first : last + 1], lost[first:last], self.healthy.fastest)

    @property
    def _places(self) -> range:
        """Mesh periods from a pair to those that feel it."""
        return range(-self.reach, self.reach + 1)

    def _edges(self, states: Sequence[PairState]) -> FloatArray:
        edges = [self.corners]
        for n, state in zip(self._places, states, strict=True):
            edges += [part.pulse.edges + n for part in chain(*self.worn, *state)]
        limits = distinct(np.clip(np.concatenate(edges), 0.0, self.length), 1e-10)
        limits[-1] = self.length
        return limits


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvePairs(PairsInMesh):
    """Pairs whose stiffness is a given curve; what is left of one is what each loss leaves of it.

    Parameters
    ----------
    pulse : Pulse
        Stiffness [N/m] of a pair of new teeth.
    """

    pulse: Pulse

    @property
    def corners(self) -> FloatArray:
        """Limits of the pieces of the curve."""
        return self.pulse.edges

    @cached_property
    def healthy(self) -> Pulse:
        """What a pair carries [N/m]; without wear the curve as it is."""
        return super().healthy if any(self.worn) else self.pulse

    def loads(self, phase: FloatArray, states: Sequence[PairState]) -> FloatArray:
        """Return what the pair carries per unit of deflection [N/m], shape (1, pieces, points)."""
        left = self.pulse.value(phase)
        for losses in (*self.worn, *states[0]):
            left = left * (1 - _lost_here(losses, phase))
        return left[None]


@dataclass(frozen=True, kw_only=True, eq=False)
class TeethInMesh(PairsInMesh):
    """Pairs of elastic teeth.

    Parameters
    ----------
    teeth : ToothPair
        Sound teeth.
    force_n : float or None
        Static force that the pairs carry together; only load-dependent contacts need it.
    """

    teeth: ToothPair
    force_n: float | None = None

    @cached_property
    def corners(self) -> FloatArray:
        """Where another pair enters or leaves."""
        return contact_zones(self.teeth.contact_ratio)[0]

    def loads(self, phase: FloatArray, states: Sequence[PairState]) -> FloatArray:
        """Return what each pair carries per unit of deflection [N/m]."""
        if self.teeth.form.contact == "constant" or self.force_n is None:
            return self._share(phase, states, None)
        force = np.full((len(states), *phase.shape), self.force_n)
        for _ in range(LOAD_ROUNDS):
            loads = self._share(phase, states, force)
            # a pair that carries nothing flattens nothing, and its logarithm needs some load
            force = self.force_n * np.maximum(loads / loads.sum(axis=0), 1e-6)
        return loads

    def _share(
        self, phase: FloatArray, states: Sequence[PairState], force: FloatArray | None
    ) -> FloatArray:
        """Return C^-1 (1, 1, ...) of the pairs in contact, 0 of the others."""
        middle, count = phase.mean(axis=-1), len(states)
        present = np.array([(middle > n) & (middle - n < self.length) for n in self._places])
        # pairs that are not in contact stand by themselves and feel nothing
        matrix = np.zeros((*phase.shape, count, count)) + np.eye(count)
        bodies = np.zeros((count, 2, *phase.shape))
        for i, (n, here) in enumerate(zip(self._places, present, strict=True)):
            own, own_force = phase[here] - n, None if force is None else force[i][here]
            parts = self.teeth.compliances(self.teeth.roll(own), force_n=own_force)
            # the compliances that the teeth of a pair have added add up
            ratio = np.ones(own.shape)
            for losses in filter(None, (*self.worn, *states[i])):
                ratio += 1 / np.maximum(1 - _lost_here(losses, own), LEAST_LEFT) - 1
            matrix[here, :, i, i] = parts.total * ratio
            bodies[i][:, here] = parts.foundation
        for j, i in combinations(range(count), 2) if self.teeth.form.is_coupled else ():
            both = present[i] & present[j]
            phases = phase[both] - self._places[j], phase[both] - self._places[i]
            shared = self.teeth.coupling(i - j, bodies[[j, i]][:, :, both], phases)
            matrix[both, :, i, j] = matrix[both, :, j, i] = shared
        felt = np.moveaxis(present[..., None] * np.ones((count, *phase.shape)), 0, -1)[..., None]
        return np.moveaxis(np.asarray(np.linalg.solve(matrix, felt)[..., 0]), -1, 0)


def _lost_here(losses: Losses, phase: FloatArray) -> FloatArray:
    """Return the share lost where all of them lie on the face."""
    return np.asarray(sum(p.weight * p.pulse.value(phase) for p in losses), dtype=np.float64)


def _inside(losses: GearLosses, low: float, high: float) -> GearLosses:
    return {
        tooth: inside
        for tooth, parts in losses.items()
        if (inside := tuple(p for p in parts if p.face_start <= low and p.face_end >= high))
    }


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
    if fault.kind == "breakage":
        return _gone(0.0, length, 0.0, fault.loss)
    # a pitch point near an end of the path leaves less of the band in contact
    half = 0.5 * BANDS[fault.kind] * length if fault.kind in BANDS else math.inf
    start, end = max(0.0, pitch_phase - half), min(length, pitch_phase + half)
    if not fault.loss or end <= start:
        return ()
    return (PulseTerm(Pulse.constant(start, end), fault.loss),)


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
    tooth = pair.teeth[index]
    damage = tooth_damage(faults, tooth)
    parts = [_broken(fault, pair, index) for fault in faults if fault.kind == "breakage"]
    for hole in damage.holes:
        if not hole.round:
            # the face on which a spall leaves no flank, while the contact passes it
            ends = sorted(pair.phase_of(index, angle) for angle in hole.angles(tooth))
            start, end = np.clip(ends, 0.0, pair.contact_ratio).tolist()
            share = min(hole.width_m / tooth.face_width_m, LARGEST_WIDTH)
            parts.append(_gone(start, end, hole.start, share))
    parts.append(_weaker_sections(damage, pair, index, is_helical))
    losses: Losses = reduce(union, parts, ())
    nominal = pair.contact_ratio if length is None else length
    factor = nominal / pair.contact_ratio
    losses = tuple(replace(part, pulse=part.pulse.stretched(factor)) for part in losses)
    if any(fault.kind == "missing" for fault in faults):
        losses = union(losses, (PulseTerm(_bridged(pair, nominal)),))
    return losses


@lru_cache(maxsize=64)
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
    corners = [np.array([0.0, pair.contact_ratio]), *(p.pulse.edges for p in losses)]
    edges = distinct(np.clip(np.concatenate(corners), 0.0, pair.contact_ratio), 1e-12)
    phase = panel_nodes(edges)
    lost, stiffness = lost_share(losses, phase), pair.compliances(pair.roll(phase)).stiffness
    weights = gauss(phase.shape[1])[1] * np.diff(edges)[:, None] * stiffness
    mean = float((weights * lost).sum() / weights.sum())
    middle = float(lost_share(losses, np.array(0.5 * pair.contact_ratio)))
    return PairLoss(mean=mean, greatest=float(lost.max()), at_middle=middle)


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
    SIZES[""].checked("loss", loss)
    most_size = largest_size(fault, pair.teeth[index])
    most = stiffness_loss(replace(fault, size=most_size), pair, index).mean
    if loss > most:
        raise ArgumentError(
            f"a {fault.kind} costs at most {100 * most:.3g} % of the stiffness of its pair, at "
            f"{most_size:.4g}{fault.unit}; loss={100 * loss:.3g} % is out of its reach"
        )

    def missed(size: float) -> float:
        return stiffness_loss(replace(fault, size=size), pair, index).mean - loss

    return replace(fault, size=brentq(missed, 0.0, most_size, rtol=1e-9))


def _broken(fault: Fault, pair: ToothPair, index: int) -> Losses:
    """Return the loss of a broken-off part of the tooth."""
    tooth, start, end = pair.teeth[index], 0.0, pair.contact_ratio
    begin, share = face_part(fault, tooth)
    if fault.height is not None:
        broken = tooth.tip_radius_m - tooth.sign * 1e-3 * fault.height
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


@lru_cache(maxsize=64)
def _bridged(pair: ToothPair, length: float) -> Pulse:
    """Return the loss of a pair that is gone while the ends of its neighbours bridge the gap.

    Where no other pair is in its regular contact, the corner of a neighbour's tip still carries,
    about as stiffly as at the end of its path.
    """
    part, few = length % 1.0, math.floor(length)
    factor = pair.contact_ratio / length
    ends = pair.compliances(pair.roll(np.array([0.0, pair.contact_ratio]))).stiffness.mean()
    edges = distinct([0.0, *(x for x in (part, 1.0) if 0 < x < length), length], 1e-12)
    phase = panel_nodes(edges, LOSS_POINTS)
    own = pair.compliances(pair.roll(factor * phase)).stiffness
    alone = (few == 1) & (phase >= part) & (phase < 1)
    return Pulse.through(edges, np.where(alone, 1 - np.minimum(ends / own, 1.0), 1.0))


def _weaker_sections(damage: ToothDamage, pair: ToothPair, index: int, is_helical: bool) -> Losses:
    """Return the loss by weaker sections: over the whole face, or slice by slice."""
    found = []
    for low, high in pairwise(_face_edges(damage, pair) if is_helical else (0.0, 1.0)):
        width = pair.first.face_width_m
        local = _slice(damage, low, high, width) if is_helical else damage
        if local.is_none:
            continue
        beams = pair.beams(*((local, SOUND) if index == 0 else (SOUND, local)))
        edges = distinct([0.0, *pair.corners(beams), pair.contact_ratio], 1e-12)
        roll = pair.roll(panel_nodes(edges, LOSS_POINTS))
        sound, hurt = pair.compliances(roll).total, pair.compliances(roll, beams).total
        lost = Pulse.through(edges, 1 - sound / hurt)
        found.append(PulseTerm(lost, 1.0, 0.0, low, high))
    return tuple(found)


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
    x, pits = middle[0], [hole for hole in damage.holes if hole.round]
    spalls = [own for own in damage.holes if own.start <= x <= own.start + own.width_m / width]
    whole_face = [replace(own, width_m=width, start=0.0) for own in spalls if not own.round]
    return replace(damage, crack=crack, holes=(*pits, *whole_face))


def acting_faults(pair: MeshPair, faults: Iterable[_Wrong]) -> tuple[list[_Wrong], list[str]]:
    """Return the faults and errors that act in this mesh, and notes on those that do not.

    Breakage, wear or a missing tooth of a planet acts in its meshes with sun and ring. Pitting and
    spalls are on the flank that meets the sun, and a root crack opens under the load of that flank:
    the ring loads the other flank and presses it shut, and a closed crack carries.

    Raises
    ------
    ArgumentError
        If the stage has no such gear or the gear no such tooth.
    """
    acting, notes = [], []
    known = [name for other in mesh_pairs(pair.stage, pair.number) for name in other.names]
    for own in faults:
        check_word(f"{pair.where}: gear ", own.gear, known)
        # the flank of a planet that meets the ring is not the one that is hurt
        far = own.gear == "planet" and pair.second.internal
        if own.gear not in pair.names or (far and own.kind in ("crack", *BANDS)):
            why = ": there it is pressed shut" if far and own.kind == "crack" else ""
            notes.append(f"{own.word} {own} does not act in the {pair.name} mesh{why}")
            continue
        teeth = pair.member(own.gear).teeth
        if own.tooth is not None and own.tooth > teeth:
            raise ArgumentError(
                f"{own.word} {own}: tooth {own.tooth} does not exist, the {own.gear} of "
                f"{pair.where} has {teeth} teeth"
            )
        acting.append(own)
    if pair.given("contact_ratio") is not None and _needs_pitch(acting):
        notes.append(
            "the pitch point is taken in the middle of the contact: contact_ratio is given"
        )
    return acting, notes


def gear_losses(pair: MeshPair, faults: Sequence[Fault], mesh: PairsInMesh) -> BothLosses:
    """Return the loss of each damaged tooth of each gear, by its number, 0 for all teeth.

    Parameters
    ----------
    pair : MeshPair
    faults : sequence of Fault
        Of this mesh.
    mesh : PairsInMesh
        Where it does not know the teeth, they are made when a size asks for them.

    Raises
    ------
    ArgumentError
        If a size does not fit its tooth, or data that it needs are missing.
    """
    # the contact of the half-duty forms is a nominal one, on which the true one is laid
    length = mesh.length
    pitch = pair.pitch_phase * length / pair.contact_ratio if _needs_pitch(faults) else 0.0
    found: BothLosses = {}, {}
    for index, (name, losses) in enumerate(zip(pair.names, found, strict=True)):
        hurt = [fault for fault in faults if fault.gear == name]
        for tooth in {fault.tooth or 0 for fault in hurt}:
            own = [fault for fault in hurt if (fault.tooth or 0) == tooth]
            parts = [loss_in_contact(fault, length, pitch) for fault in own if fault.is_loss]
            measured = [fault for fault in own if not fault.is_loss]
            if measured:
                known, is_helical = mesh.teeth or teeth_of(pair), pair.overlap_ratio > 0
                parts.append(measured_losses(measured, known, index, is_helical, length))
            lost: Losses = reduce(union, parts, ())
            if lost:
                losses[tooth] = lost
    return found


def _needs_pitch(faults: Sequence[Fault | GearError]) -> bool:
    return any(isinstance(own, Fault) and own.is_loss and own.kind in BANDS for own in faults)
