"""Pairs of teeth that carry together: what each of them carries, and the pulses that follow.

Every pair keeps a pulse of its own; the mesh stiffness is their sum. Pairs whose stiffness is a
given curve know nothing of one another. Teeth on elastic bodies do: neighbours feel each other
through the bodies of their gears, so a pair carries less than it would alone while another is in
contact, and a damaged tooth changes the load of its neighbours too.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise, product

import numpy as np
from numpy.typing import NDArray

from gearmon.arrays import FloatArray
from gearmon.gears.geometry import contact_zones
from gearmon.gears.pairs import MeshPair
from gearmon.gears.pulses import POINTS, Losses, Pulse, PulseTerm, PulseTrain, distinct, panel_nodes
from gearmon.gears.tooth_pairs import ToothPair

#: Losses of the teeth of a gear, by tooth number.
GearLosses = dict[int, Losses]
#: What is lost at the two teeth of a pair.
PairState = tuple[Losses, Losses]
#: A pair keeps at least this share of its stiffness: a number for "nothing" that can be inverted.
LEAST_LEFT = 1e-12
#: Rounds of sharing a load that the contact depends on.
LOAD_ROUNDS = 4
SOUND_PAIR: PairState = ((), ())


@dataclass(frozen=True, kw_only=True, eq=False)
class PairsInMesh(ABC):
    """Pairs of teeth in mesh, one mesh period apart.

    Parameters
    ----------
    worn : PairState
        Loss that all teeth of each gear have.
    """

    worn: PairState = SOUND_PAIR

    @property
    @abstractmethod
    def corners(self) -> FloatArray:
        """Phases of the contact, from end to end, where what a sound pair carries is not smooth."""

    @property
    def length(self) -> float:
        """Length of the contact of a pair [mesh periods]."""
        return float(self.corners[-1])

    @abstractmethod
    def loads(self, phase: FloatArray, states: Sequence[PairState] | None = None) -> FloatArray:
        """Return what each pair carries per unit of deflection [N/m].

        Parameters
        ----------
        phase : ndarray, shape (pieces, points)
            Phase of the middle pair; within a row the same pairs are in contact.
        states : sequence of PairState, optional
            Of the pairs from `reach` before it to `reach` after it, itself in the middle; sound
            by default.

        Returns
        -------
        ndarray, shape (2 reach + 1, pieces, points)
        """

    @property
    def reach(self) -> int:
        """How many pairs before and after one feel what it carries."""
        return 0

    @property
    def points(self) -> int:
        """Gauss points between corners."""
        return POINTS

    @cached_property
    def healthy(self) -> Pulse:
        """What a pair carries among sound neighbours, per unit of deflection [N/m]."""
        edges = self._edges(self._sound)
        return Pulse.through(edges, self.loads(panel_nodes(edges, self.points))[self.reach])

    def trains(self, pair: MeshPair, losses: tuple[GearLosses, GearLosses]) -> list[PulseTrain]:
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
        (one, two), z = losses, pair.teeth
        both = self._terms(one, two, z) if one and two else ()
        parts = (
            (pair.first.name, z[0], self._terms(one, {}, z)),
            (pair.second.name, z[1], self._terms({}, two, z)),
            (" and ".join(pair.names), math.lcm(*z), both),
        )
        return [
            PulseTrain(gear=gear, period_mesh=period, overlap_ratio=pair.overlap_ratio, terms=terms)
            for gear, period, terms in parts
            if terms
        ]

    def _terms(self, one: GearLosses, two: GearLosses, teeth: tuple[int, int]) -> Losses:
        """Return what damaged teeth take from the pairs near them.

        Of both gears, where their damaged teeth meet: what they take less than by themselves.
        """
        found: list[PulseTerm] = []
        # teeth that are damaged alike, with neighbours alike, lose the same
        known: dict[tuple[PairState, ...], Pulse] = {}
        for low, high in _face_parts(one, two):
            first, second = _inside(one, low, high), _inside(two, low, high)
            near = self._near(first, teeth[0]), self._near(second, teeth[1])
            entries = near[0] | near[1]
            if one and two:
                met = (meeting(a, teeth[0], b, teeth[1]) for a, b in product(*near))
                entries = {place for place in met if place is not None}
            for entry in sorted(entries):
                states = self._states(entry, first, second, teeth)
                if states not in known:
                    known[states] = self._lost(states)
                if len(known[states].series):
                    found.append(PulseTerm(known[states], -1.0, float(entry), low, high))
        return tuple(found)

    def _lost(self, states: Sequence[PairState]) -> Pulse:
        """Return the loss near damage; near that of both gears, less that near either."""
        edges = self._edges(states)
        lost = self._missing(edges, states)
        apart = [(own, ()) for own, _ in states], [((), own) for _, own in states]
        if all(any(map(any, alone)) for alone in apart):
            lost -= sum(self._missing(edges, alone) for alone in apart)
        # nothing is lost in the pieces at its ends
        used = np.flatnonzero(np.abs(lost).max(axis=1) > 1e-12 * self.healthy.area)
        first, last = (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 0)
        return Pulse.through(edges[first : last + 1], lost[first:last], self.healthy.fastest)

    def _missing(self, edges: FloatArray, states: Sequence[PairState]) -> FloatArray:
        """Return what the middle pair carries less than among sound ones, at the panel nodes."""
        # where no damaged tooth is in contact nothing changes
        middle = 0.5 * (edges[:-1] + edges[1:])
        here = np.zeros(len(middle), dtype=bool)
        for n, state in zip(self._places, states, strict=True):
            here |= any(state) & (middle > n) & (middle < n + self.length)
        phase = panel_nodes(edges, self.points)
        lost = np.zeros(phase.shape)
        carried = self.loads(phase[here], states)[self.reach]
        lost[here] = self.healthy.value(phase[here]) - carried
        return lost

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

    @property
    def _sound(self) -> list[PairState]:
        return [SOUND_PAIR] * (2 * self.reach + 1)

    def _states(
        self, entry: int, one: GearLosses, two: GearLosses, teeth: tuple[int, int]
    ) -> tuple[PairState, ...]:
        return tuple(
            (one.get((entry + n) % teeth[0] + 1, ()), two.get((entry + n) % teeth[1] + 1, ()))
            for n in self._places
        )

    def _near(self, losses: GearLosses, period: int) -> set[int]:
        """Return the mesh phases at which pairs enter that damage affects."""
        return {(tooth - 1 + n) % period for tooth in losses for n in self._places}


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

    @property
    def points(self) -> int:
        """Gauss points between corners."""
        return self.pulse.points

    @cached_property
    def healthy(self) -> Pulse:
        """What a pair carries [N/m]; without wear the curve as it is."""
        return super().healthy if any(self.worn) else self.pulse

    def loads(self, phase: FloatArray, states: Sequence[PairState] | None = None) -> FloatArray:
        """Return what the pair carries per unit of deflection [N/m], shape (1, pieces, points)."""
        left = self.pulse.value(phase)
        for losses in (*self.worn, *(SOUND_PAIR if states is None else states[0])):
            left = left * (1 - _lost_here(losses, phase))
        return left[None]


@dataclass(frozen=True, kw_only=True, eq=False)
class TeethInMesh(PairsInMesh):
    """Pairs of elastic teeth.

    Parameters
    ----------
    pair : ToothPair
        Sound teeth.
    force_n : float or None
        Static force that the pairs carry together; only load-dependent contacts need it.
    """

    pair: ToothPair
    force_n: float | None = None

    @cached_property
    def corners(self) -> FloatArray:
        """Where another pair enters or leaves."""
        return contact_zones(self.pair.contact_ratio)[0]

    @cached_property
    def reach(self) -> int:
        """How many pairs before and after one may be in contact with it."""
        return max(0, math.ceil(self.length - 1e-12) - 1)

    def loads(self, phase: FloatArray, states: Sequence[PairState] | None = None) -> FloatArray:
        """Return what each pair carries per unit of deflection [N/m]."""
        known = self._sound if states is None else states
        if self.pair.form.contact == "constant" or self.force_n is None:
            return self._share(phase, known, None)
        force = np.full((len(known), *phase.shape), self.force_n / self.length)
        for _ in range(LOAD_ROUNDS):
            loads = self._share(phase, known, force)
            # a pair that carries nothing flattens nothing, and its logarithm needs some load
            force = self.force_n * np.maximum(loads / loads.sum(axis=0), 1e-6)
        return loads

    def _near(self, losses: GearLosses, period: int) -> set[int]:
        if self.pair.form.is_coupled:
            return super()._near(losses, period)
        return {tooth - 1 for tooth in losses}

    def _share(
        self, phase: FloatArray, states: Sequence[PairState], force: FloatArray | None
    ) -> FloatArray:
        middle = phase.mean(axis=-1)
        present = np.array([(middle > n) & (middle - n < self.length) for n in self._places])
        total = np.full((len(states), *phase.shape), np.inf)
        bodies = np.zeros((len(states), 2, *phase.shape))
        for i, (n, here) in enumerate(zip(self._places, present, strict=True)):
            if not here.any():
                continue
            own = phase[here] - n
            own_force = None if force is None else force[i][here]
            parts = self.pair.compliances(self.pair.roll(own), force_n=own_force)
            total[i][here] = parts.total * self._ratio(states[i], own)
            bodies[i][:, here] = parts.foundation
        loads = np.zeros(total.shape)
        for pattern in np.unique(present, axis=1).T:
            rows = np.flatnonzero((present == pattern[:, None]).all(axis=0))
            who = np.flatnonzero(pattern)
            chosen = np.ix_(who, rows)
            loads[chosen] = self._solve(phase[rows], total[chosen], bodies[who][:, :, rows], who)
        return loads

    def _ratio(self, state: PairState, phase: FloatArray) -> FloatArray:
        """Return how many times more compliant a pair is than a sound one.

        The compliances that the teeth of a pair have added add up.
        """
        total = np.ones(phase.shape)
        for losses in filter(None, (*self.worn, *state)):
            total += 1 / np.maximum(1 - _lost_here(losses, phase), LEAST_LEFT) - 1
        return total

    def _solve(
        self, phase: FloatArray, total: FloatArray, bodies: FloatArray, who: NDArray[np.intp]
    ) -> FloatArray:
        """Return C^-1 (1, 1, ...) for the pairs in contact."""
        if len(total) == 1 or not self.pair.form.is_coupled:
            return np.asarray(1 / total)
        own = [phase - (int(place) - self.reach) for place in who]
        matrix = np.zeros((*phase.shape, len(who), len(who)))
        for i in range(len(who)):
            matrix[..., i, i] = total[i]
            for j in range(i):
                both = own[j], own[i]
                shared = self.pair.coupling(int(who[i] - who[j]), bodies[[j, i]], both)
                matrix[..., i, j] = matrix[..., j, i] = shared
        ones = np.ones((*phase.shape, len(who), 1))
        return np.moveaxis(np.linalg.solve(matrix, ones)[..., 0], -1, 0)


def meeting(one: int, z1: int, two: int, z2: int) -> int | None:
    """Return the mesh phase at which tooth phases `one` mod z1 and `two` mod z2 coincide."""
    common = math.gcd(z1, z2)
    if (two - one) % common:
        return None
    turns = (two - one) // common * pow(z1 // common, -1, z2 // common) % (z2 // common)
    return one + z1 * turns


def _lost_here(losses: Losses, phase: FloatArray) -> FloatArray:
    """Return the share lost where all of them lie on the face."""
    return np.asarray(sum(p.weight * p.pulse.value(phase) for p in losses), dtype=np.float64)


def _face_parts(one: GearLosses, two: GearLosses) -> list[tuple[float, float]]:
    """Return the parts of the face width in which all damage is uniform along the face."""
    parts = chain(*one.values(), *two.values())
    edges = {0.0, 1.0}.union(*({part.face_start, part.face_end} for part in parts))
    return list(pairwise(sorted(edges)))


def _inside(losses: GearLosses, low: float, high: float) -> GearLosses:
    inside = {
        tooth: tuple(p for p in parts if p.face_start <= low and p.face_end >= high)
        for tooth, parts in losses.items()
    }
    return {tooth: parts for tooth, parts in inside.items() if parts}
