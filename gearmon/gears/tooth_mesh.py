"""Pairs of teeth that carry together: what each of them carries, and the pulses that follow.

Neighbouring teeth feel each other through the bodies of their gears, so a pair carries less than
it would alone while another is in contact, and a damaged tooth changes the load of its neighbours
too. Every pair keeps a pulse of its own; the mesh stiffness is their sum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise, product

import numpy as np
from numpy.typing import NDArray

from gearmon.gears.faults import LossPatch
from gearmon.gears.geometry import contact_zones
from gearmon.gears.pulses import FloatArray, Pulse, PulseTerm, distinct, panel_nodes
from gearmon.gears.tooth_pairs import PairCompliance, ToothPair

#: Losses of the teeth of a gear, by tooth number.
Losses = dict[int, tuple[LossPatch, ...]]
#: What is lost at the two teeth of a pair.
PairState = tuple[tuple[LossPatch, ...], tuple[LossPatch, ...]]
#: A pair keeps at least this share of its stiffness: a number for "nothing" that can be inverted.
LEAST_LEFT = 1e-12
#: Rounds of sharing a load that the contact depends on.
LOAD_ROUNDS = 4
SOUND_PAIR: PairState = ((), ())


@dataclass(frozen=True, kw_only=True, eq=False)
class TeethInMesh:
    """Pairs of teeth in mesh, one mesh period apart.

    Parameters
    ----------
    pair : ToothPair
        Sound teeth.
    worn : PairState
        Loss that all teeth of each gear have.
    is_coupled : bool
        Whether neighbouring teeth share the yielding of the bodies.
    force_n : float or None
        Static force that the pairs carry together; only load-dependent contacts need it.
    """

    pair: ToothPair
    worn: PairState = SOUND_PAIR
    is_coupled: bool = True
    force_n: float | None = None

    @cached_property
    def reach(self) -> int:
        """How many pairs before and after one may be in contact with it."""
        return max(0, math.ceil(self.pair.contact_ratio - 1e-12) - 1)

    @cached_property
    def healthy(self) -> Pulse:
        """What a pair carries among sound neighbours, per unit of deflection [N/m]."""
        return self.pulse([SOUND_PAIR] * (2 * self.reach + 1))

    def pulse(self, states: Sequence[PairState]) -> Pulse:
        """Return what a pair carries over its contact [N/m].

        Parameters
        ----------
        states : sequence of PairState
            Of the pairs from `reach` before it to `reach` after it, itself in the middle.
        """
        edges = self._edges(states)
        return Pulse.through(edges, self.loads(panel_nodes(edges), states)[self.reach])

    def loads(self, phase: FloatArray, states: Sequence[PairState] | None = None) -> FloatArray:
        """Return what each pair carries per unit of deflection [N/m].

        Parameters
        ----------
        phase : ndarray, shape (pieces, points)
            Phase of the middle pair; within a row the same pairs are in contact.
        states : sequence of PairState, optional
            As in `pulse`; sound by default.

        Returns
        -------
        ndarray, shape (2 reach + 1, pieces, points)
        """
        known = [SOUND_PAIR] * (2 * self.reach + 1) if states is None else states
        if self.pair.contact == "constant" or self.force_n is None:
            return self._share(phase, known, None)
        force = np.full((len(known), *phase.shape), self.force_n / self.pair.contact_ratio)
        for _ in range(LOAD_ROUNDS):
            loads = self._share(phase, known, force)
            # a pair that carries nothing flattens nothing, and its logarithm needs some load
            force = self.force_n * np.maximum(loads / loads.sum(axis=0), 1e-6)
        return loads

    def terms(self, losses: Losses, other: Losses, teeth: tuple[int, int]) -> list[PulseTerm]:
        """Return what damaged teeth of one gear take from the pairs near them.

        Parameters
        ----------
        losses, other : dict
            Of the first and of the second gear; one of them is empty.
        teeth : (int, int)
        """
        period = teeth[0] if losses else teeth[1]
        found: list[PulseTerm] = []
        # teeth that are damaged alike, with neighbours alike, lose the same
        known: dict[tuple[PairState, ...], Pulse] = {}
        for low, high in _face_parts(losses, other):
            one, two = _inside(losses, low, high), _inside(other, low, high)
            for entry in sorted(self._near(one or two, period)):
                states = self._states(entry, one, two, teeth)
                if states not in known:
                    known[states] = self._lost(states)
                found += _term(known[states], entry, low, high)
        return found

    def meeting_terms(
        self, losses: Losses, other: Losses, teeth: tuple[int, int]
    ) -> list[PulseTerm]:
        """Return what `terms` of each gear alone misses where damaged teeth of both meet."""
        found = []
        for low, high in _face_parts(losses, other):
            one, two = _inside(losses, low, high), _inside(other, low, high)
            if not (one and two):
                continue
            for entry in self._both(one, two, teeth):
                lost = self._difference(entry, one, two, teeth)
                found += _term(lost, entry, low, high)
        return found

    def _difference(self, entry: int, one: Losses, two: Losses, teeth: tuple[int, int]) -> Pulse:
        """Return the loss near damage of both gears, less that near either."""
        joint = self._states(entry, one, two, teeth)
        first = self._states(entry, one, {}, teeth)
        second = self._states(entry, {}, two, teeth)
        edges = self._edges(joint)
        phase = panel_nodes(edges)
        sound = self.loads(phase)[self.reach]
        total = self.loads(phase, first)[self.reach] + self.loads(phase, second)[self.reach]
        lost = total - sound - self.loads(phase, joint)[self.reach]
        return _trimmed(edges, lost, float(sound.max()))

    def _lost(self, states: Sequence[PairState]) -> Pulse:
        edges = self._edges(states)
        # where no damaged tooth is in contact nothing changes
        middle = 0.5 * (edges[:-1] + edges[1:])
        here = np.zeros(len(middle), dtype=bool)
        for n, state in zip(range(-self.reach, self.reach + 1), states, strict=True):
            here |= any(state) & (middle > n) & (middle < n + self.pair.contact_ratio)
        phase = panel_nodes(edges)
        lost = np.zeros(phase.shape)
        sound = self.healthy.value(phase[here])
        lost[here] = sound - self.loads(phase[here], states)[self.reach]
        return _trimmed(edges, lost, float(sound.max()))

    def _share(
        self, phase: FloatArray, states: Sequence[PairState], force: FloatArray | None
    ) -> FloatArray:
        eps = self.pair.contact_ratio
        places = range(-self.reach, self.reach + 1)
        middle = phase.mean(axis=-1)
        present = np.array([(middle - n > 0) & (middle - n < eps) for n in places])
        total = np.full((len(states), *phase.shape), np.inf)
        bodies = np.zeros((2, *total.shape))
        for i, (n, here) in enumerate(zip(places, present, strict=True)):
            if not here.any():
                continue
            own = phase[here] - n
            parts = self._compliances(own, None if force is None else force[i][here])
            total[i][here] = parts.total * self._ratio(states[i], own)
            bodies[0][i][here], bodies[1][i][here] = parts.foundation
        loads = np.zeros(total.shape)
        for pattern in np.unique(present, axis=1).T:
            rows = np.flatnonzero((present == pattern[:, None]).all(axis=0))
            who = np.flatnonzero(pattern)
            chosen = np.ix_(who, rows)
            loads[chosen] = self._solve(
                phase[rows], total[chosen], bodies[0][chosen], bodies[1][chosen], who
            )
        return loads

    def _compliances(self, phase: FloatArray, force: FloatArray | None) -> PairCompliance:
        return self.pair.compliances(self.pair.roll(phase), force_n=force)

    def _ratio(self, state: PairState, phase: FloatArray) -> FloatArray:
        """Return how many times more compliant a pair is than a sound one.

        The compliances that the teeth of a pair have added add up.
        """
        total = np.ones(phase.shape)
        for patches in (*self.worn, *state):
            if patches:
                lost = sum(patch.at(phase) for patch in patches)
                total += 1 / np.maximum(1 - lost, LEAST_LEFT) - 1
        return total

    def _solve(
        self,
        phase: FloatArray,
        total: FloatArray,
        first: FloatArray,
        second: FloatArray,
        who: NDArray[np.intp],
    ) -> FloatArray:
        """Return C^-1 (1, 1, ...) for the pairs in contact."""
        if len(total) == 1 or not self.is_coupled:
            return np.asarray(1 / total)
        own = [phase - (int(place) - self.reach) for place in who]
        shared = {
            (i, j): self.pair.coupling(
                int(who[j] - who[i]),
                [(first[i], first[j]), (second[i], second[j])],
                (own[i], own[j]),
            )
            for i, j in product(range(len(who)), repeat=2)
            if i < j
        }
        if len(total) == 2:
            c = shared[0, 1]
            rest = total[0] * total[1] - c * c
            return np.stack([(total[1] - c) / rest, (total[0] - c) / rest])
        matrix = np.zeros((*total.shape[1:], len(who), len(who)))
        for i in range(len(who)):
            matrix[..., i, i] = total[i]
        for (i, j), c in shared.items():
            matrix[..., i, j] = matrix[..., j, i] = c
        ones = np.ones((*total.shape[1:], len(who), 1))
        return np.moveaxis(np.linalg.solve(matrix, ones)[..., 0], -1, 0)

    def _edges(self, states: Sequence[PairState]) -> FloatArray:
        eps = self.pair.contact_ratio
        edges = [limit for zone in contact_zones(eps) for limit in zone[:2]]
        for n, state in zip(range(-self.reach, self.reach + 1), states, strict=True):
            for patch in chain(*self.worn, *state):
                edges += [corner + n for corner in patch.corners]
        limits = distinct(np.clip(edges, 0.0, eps), 1e-10)
        limits[-1] = eps
        return limits

    def _states(
        self, entry: int, one: Losses, two: Losses, teeth: tuple[int, int]
    ) -> tuple[PairState, ...]:
        return tuple(
            (one.get((entry + n) % teeth[0] + 1, ()), two.get((entry + n) % teeth[1] + 1, ()))
            for n in range(-self.reach, self.reach + 1)
        )

    def _near(self, losses: Losses, period: int) -> set[int]:
        """Return the mesh phases at which pairs enter that damage affects."""
        reach = self.reach if self.is_coupled else 0
        return {(tooth - 1 + n) % period for tooth in losses for n in range(-reach, reach + 1)}

    def _both(self, one: Losses, two: Losses, teeth: tuple[int, int]) -> list[int]:
        """Return the mesh phases of the hunting period near damage of both gears."""
        near = (self._near(one, teeth[0]), self._near(two, teeth[1]))
        found = (meeting(a, teeth[0], b, teeth[1]) for a, b in product(*near))
        return sorted({entry for entry in found if entry is not None})


def meeting(one: int, z1: int, two: int, z2: int) -> int | None:
    """Return the mesh phase at which tooth phases `one` mod z1 and `two` mod z2 coincide."""
    common = math.gcd(z1, z2)
    if (two - one) % common:
        return None
    turns = (two - one) // common * pow(z1 // common, -1, z2 // common) % (z2 // common)
    return one + z1 * turns


def _face_parts(one: Losses, two: Losses) -> list[tuple[float, float]]:
    """Return the parts of the face width in which all damage is uniform along the face."""
    patches = chain(*one.values(), *two.values())
    edges = {0.0, 1.0}.union(*({patch.face_start, patch.face_end} for patch in patches))
    return list(pairwise(sorted(edges)))


def _inside(losses: Losses, low: float, high: float) -> Losses:
    found = {}
    for tooth, patches in losses.items():
        own = tuple(p for p in patches if p.face_start <= low and p.face_end >= high)
        if own:
            found[tooth] = own
    return found


def _trimmed(edges: FloatArray, values: FloatArray, scale: float) -> Pulse:
    """Return the pulse without the pieces at its ends where nothing is lost."""
    used = np.flatnonzero(np.abs(values).max(axis=1) > 1e-12 * scale)
    if not len(used):
        return Pulse.through(edges[:1], values[:0])
    first, last = int(used[0]), int(used[-1])
    return Pulse.through(edges[first : last + 2], values[first : last + 1])


def _term(pulse: Pulse, offset: int, low: float, high: float) -> list[PulseTerm]:
    if not len(pulse.starts):
        return []
    return [PulseTerm(pulse, -1.0, float(offset), low, high)]
