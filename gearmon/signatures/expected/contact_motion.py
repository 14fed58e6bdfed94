"""Motion of masses on varying springs: over a period, and with a few mesh periods of it changed.

In modes of unit mass a machine and its meshes obey

    q'' + C q' + K0 q + sum_j v_j [k_j (d_j - e_j) - c_j e_j'] = f,    d_j = v_j . q

with the dampers c_j of the meshes in C. With q' = u + sum_j c_j e_j v_j the
excitation e may jump. Between the corners of k and e the motion is smooth, and a polynomial through
16 Gauss points of each panel follows it to nearly all digits (Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, section II.7). A single pair is one coordinate with K0 = 0.

With a damaged tooth the stiffness is that of the healthy meshes but for the mesh periods in which
the tooth is in contact, one to three each time that it meets a mate. What it changes there is a
force in its own mesh, -delta k d + k e, which the panel answers: 16 unknowns a panel and mesh,
whatever the machine. Through the rest of the turn what the tooth has set off dies away as free
vibration of the healthy machine, ``y_{p+1} = M y_p``. Every size of damage is exact, without an
expansion in it.

What is told of all is the force of each mesh: its lines are those of the force on what is around.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from scipy.fft import next_fast_len
from scipy.sparse import csr_array

from gearmon.arrays import BoolArray, ComplexArray, FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.mechanics import Around
from gearmon.gears.pulses import Pulse, distinct, gauss, panel_nodes

#: Collocation points of a panel, and the largest turn [rad] of the fastest part over half of it:
#: together they integrate that part to about 1e-12.
POINTS, LARGEST_HALF_TURN = 16, 9.0
#: Numbers of the equations of panels that are answered at a time.
VALUES_TOGETHER = 1 << 18
#: Points of the grid that each value is spread over for its lines, and nodes of their weights.
SPREAD, BELL_POINTS = 14, 40


@dataclass(frozen=True)
class PhaseGrid:
    """Panels of a mesh period, or of a whole turn, and the collocation points on them.

    Parameters
    ----------
    edges : tuple of float
        Of the panels, from 0 to the period, increasing.
    """

    edges: tuple[float, ...]

    @classmethod
    def between(cls, corners: FloatArray, fastest: float, period: int = 1) -> PhaseGrid:
        """Return panels between corners, fine enough for `fastest` cycles a mesh period."""
        folded = distinct(np.append(np.mod(corners, period), [0.0, period]), 1e-11)
        folded[-1] = period
        longest = LARGEST_HALF_TURN / (math.pi * max(fastest, 1.0))
        parts = [
            np.linspace(low, high, max(1, math.ceil((high - low) / longest)) + 1)[:-1]
            for low, high in pairwise(folded.tolist())
        ]
        return cls((*np.concatenate(parts).tolist(), float(period)))

    def halved(self) -> PhaseGrid:
        """Return every panel cut in two."""
        middles = [0.5 * (low + high) for low, high in pairwise(self.edges)]
        return PhaseGrid(tuple(sorted([*self.edges, *middles])))

    @cached_property
    def widths(self) -> FloatArray:
        """Lengths of the panels."""
        return np.diff(self.edges)

    @cached_property
    def phase(self) -> FloatArray:
        """Collocation points, shape (panels, points)."""
        return panel_nodes(np.array(self.edges), POINTS)

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of means over the period, shape (panels, points)."""
        return np.asarray(self.widths[:, None] * (0.5 * gauss(POINTS)[1]) / self.edges[-1])

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the means over the period, of (..., panels, meshes, points) by mesh."""
        return np.asarray((values * self.weights[:, None]).sum(axis=(-3, -1)))


@dataclass(frozen=True, kw_only=True, eq=False)
class PeriodicMotion:
    """The motion of which all periods of a grid are alike.

    Parameters
    ----------
    grid : PhaseGrid
    period_s : float
        T, the mesh period [s].
    around : Around
        The machine without its varying meshes, n modes under the load f.
    stiffness : ndarray, shape (panels, meshes, points)
        k [N/m].
    excitation : ndarray, same shape
        e [m].

    Raises
    ------
    ArgumentError
        If free vibrations do not die out.
    """

    grid: PhaseGrid
    period_s: float
    around: Around
    stiffness: FloatArray
    excitation: FloatArray

    def __post_init__(self) -> None:
        growth = float(np.abs(np.linalg.eigvals(self.monodromy)).max())
        if not growth < 1 - 1e-9:
            raise ArgumentError(
                f"free vibrations do not die out, they grow {growth:.9g} times a period: there is "
                f"no steady state; raise damping_ratio or change speed_rpm"
            )

    @cached_property
    def known_changes(self) -> dict[tuple[bytes, bytes], list[_Changed]]:
        """Mesh periods that differ, of the last turns asked for."""
        return {}

    @cached_property
    def maps(self) -> _PanelMaps:
        """Motion on the panels by the state at the start of each, and by the forcing."""
        load, pressed = self.around.inputs[:, 0], self.stiffness * self.excitation
        size, vectors, dampers = len(load), self.around.vectors, self.around.dampers
        push, shift = np.zeros((2, len(pressed), POINTS, size, 2 * size + 1))
        push[..., -1] = load + np.einsum("pmi,ma->pia", pressed, vectors)
        shift[..., -1] = np.einsum("pmi,ma->pia", self.excitation, dampers[:, None] * vectors)
        return self._answer(push, shift, np.eye(2 * size, 2 * size + 1))

    @cached_property
    def forced(self) -> _PanelMaps:
        """Motion on the panels from rest, by forces in the meshes: a column each mesh and point."""
        return self._from_rest(1.0, 0.0)

    @cached_property
    def shifted(self) -> _PanelMaps:
        """The same by e of the dampers."""
        return self._from_rest(0.0, np.repeat(self.around.dampers, POINTS))

    def _from_rest(self, force: FloatArray | float, moved: FloatArray | float) -> _PanelMaps:
        """Return the motions by unit forces at every mesh and point, and by shifts of the same."""
        vectors = self.around.vectors
        each = np.einsum("ma,il->iaml", vectors, np.eye(POINTS)).reshape(POINTS, len(vectors.T), -1)
        shape = len(self.stiffness), *each.shape
        push, shift = (np.broadcast_to(each * size, shape) for size in (force, moved))
        return self._answer(push, shift, np.zeros((len(self.monodromy), 1)))

    @cached_property
    def _collocation(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """C, K at the points, (panels, points, n, n), and the matrix of u' on each panel."""
        around, integrals, vectors = self.around, _integrals(), self.around.vectors
        h = self.period_s * self.grid.widths[:, None, None, None, None]
        springs = np.einsum("pmi,ma,mb->piab", self.stiffness, vectors, vectors)
        damping, stiffness = around.whole_damping, around.stiffness + springs
        matrix = h * integrals[:, None, :, None] * damping[:, None, :]
        twice = (integrals @ integrals)[:, None, :, None]
        matrix = matrix + h**2 * twice * stiffness[:, :, :, None, :]
        size = POINTS * len(damping)
        return damping, stiffness, matrix.reshape(len(h), size, size) + np.eye(size)

    def _answer(self, push: FloatArray, shift: FloatArray, start: FloatArray) -> _PanelMaps:
        """Return the motions, a column each.

        Parameters
        ----------
        push : ndarray, shape (panels, points, n, columns)
            What is added to u'.
        shift : ndarray, same shape
            What is added to q'.
        start : ndarray, shape (2n, columns)
            State when the panel begins.
        """
        size, (damping, stiffness, matrix) = push.shape[2], self._collocation
        q0, u0 = start[:size], start[size:]
        reach, weights = _integrals().sum(axis=1)[:, None, None], 0.5 * gauss(POINTS)[1]
        steps, seen = [], []

        def integrated(values: FloatArray) -> FloatArray:
            """Integrate along the points of [0, 1]."""
            return (_integrals() @ values.reshape(*values.shape[:2], -1)).reshape(values.shape)

        # a few panels at a time: what is made on the way stays in the cache
        together = max(1, VALUES_TOGETHER // (push[0].size + push[0, ..., 0].size ** 2))
        for first in range(0, len(push), together):
            some = slice(first, first + together)
            moved, h = shift[some], self.period_s * self.grid.widths[some, None, None, None]
            place = q0 + h * (reach * u0 + integrated(moved))
            right = push[some] - damping @ (u0 + moved) - stiffness[some] @ place
            asked = right.reshape(len(right), len(matrix[0]), -1)
            slope = np.linalg.solve(matrix[some], asked).reshape(right.shape)
            rate = u0 + h * integrated(slope) + moved
            ends = [h[:, 0] * np.einsum("i,piac->pac", weights, own) for own in (rate, slope)]
            steps.append(np.concatenate([q0 + ends[0], u0 + ends[1]], axis=1))
            places = rate, q0 + h * integrated(rate)
            both = np.stack([self.around.vectors @ own for own in places])
            seen.append(np.moveaxis(both, (1, 2), (0, 3)).reshape(len(h), -1, both.shape[-1]))
        return _PanelMaps(step=np.concatenate(steps), seen=np.concatenate(seen))

    @property
    def monodromy(self) -> FloatArray:
        """M, free vibration over a period of the grid, shape (2n, 2n)."""
        return np.asarray(self.maps.ends[-1, :, :-1])

    @cached_property
    def motion(self) -> FloatArray:
        """Speeds and deflections at the points, shape (panels, 2, meshes, points)."""
        free, forced = self.monodromy, self.maps.ends[-1, :, -1]
        start = np.asarray(np.linalg.solve(np.eye(len(free)) - free, forced))
        panels, *places = self.stiffness.shape
        return _applied(self.maps.seen, self.maps.states(start)).reshape(panels, 2, *places)

    @cached_property
    def free(self) -> FloatArray:
        """The same of free vibration, by the state when the period begins: one axis more, 2n."""
        before = np.eye(*self.maps.step.shape[1:])[None, :, :-1]
        before = np.concatenate([before, self.maps.ends[:-1, :, :-1]])
        return (self.maps.seen[..., :-1] @ before).reshape(*self.motion.shape, -1)

    @cached_property
    def force(self) -> FloatArray:
        """Mesh forces at the points but for those of e', shape (panels, meshes, points)."""
        speed, deflection = self.motion.swapaxes(0, 1)
        pressing = self.stiffness * (deflection - self.excitation)
        return np.asarray(pressing + self.around.dampers[:, None] * speed)

    @cached_property
    def free_force(self) -> FloatArray:
        """The same of free vibration, by mesh: shape (meshes, panels, points, 2n)."""
        (speed, deflection), dampers = self.free.swapaxes(0, 1), self.around.dampers[:, None, None]
        return np.asarray(self.stiffness[..., None] * deflection + dampers * speed).swapaxes(0, 1)

    @property
    def unresolved(self) -> FloatArray:
        """Share of the speeds in the last two Legendre terms of the panels; see `Deviations`."""
        return _unresolved(self.motion[None, :, 0], self.grid.widths)

    @property
    def contact(self) -> tuple[BoolArray, FloatArray]:
        """Whether teeth part (a mesh force falls to 0), and the mean deflection of the first mesh.

        Shapes (1,); the latter in m.
        """
        lowest = self.force.min(axis=(0, 2)) / self.grid.mean(self.force)
        return np.array([(lowest <= 0).any()]), self.grid.mean(self.motion[:, 1])[:1]

    def force_lines(self, highest: int) -> ComplexArray:
        """Return the harmonics 1..highest of all mesh forces, shape (1, meshes, highest)."""
        period = self.grid.edges[-1]
        values = np.stack([self.force, self.excitation]).swapaxes(1, 2) * self.grid.weights
        force, moved = fourier_sums(self.grid.phase / period, values, highest)
        return np.asarray(force - self.damped(moved, period))[None]

    def damped(self, lines: ComplexArray, period: float) -> ComplexArray:
        """Return the lines of c e' over P mesh periods by those of e, (..., meshes, lines)."""
        rates = 2j * np.pi / (period * self.period_s) * np.arange(1, lines.shape[-1] + 1)
        return np.asarray(self.around.dampers[:, None] * rates * lines)


def fourier_sums(turns: FloatArray, values: FloatArray, highest: int) -> ComplexArray:
    """Return the sums of values times exp(-2 pi i r turn), r = 1..highest, at any turns.

    The last axes of `values` are those of `turns`; in their place are the lines. Every value is
    spread over the points next to it of a grid that the fast transform takes, by
    exp(b (sqrt(1 - t^2) - 1)), whose own lines are divided out: right to 1e-12 of their size with
    14 points and twice as many as there are lines (Barnett, Magland and af Klinteberg, SIAM J. Sci.
    Comput. 41, 2019, C479).
    """
    length = next_fast_len(2 * (2 * highest + 1), real=True)
    place = turns.ravel() * length
    points = np.ceil(place - SPREAD / 2).astype(int)[:, None] + np.arange(SPREAD)
    spread = _bell((points - place[:, None]) * (2 / SPREAD))
    starts = np.arange(0, spread.size + 1, SPREAD)
    grid = csr_array((spread.ravel(), points.ravel() % length, starts), shape=(len(place), length))
    before = values.shape[: values.ndim - turns.ndim]
    found = np.fft.rfft(values.reshape(-1, len(place)) @ grid)[:, 1 : highest + 1]
    return np.asarray((found * _bell_lines(length, highest)).reshape(*before, highest))


@lru_cache(maxsize=8)
def _bell_lines(length: int, highest: int) -> FloatArray:
    """Return the reciprocals of the lines of the bell."""
    numbers, (nodes, weights, _) = np.arange(1, highest + 1), gauss(BELL_POINTS)
    waves = np.cos(np.pi * SPREAD / length * np.outer(numbers, nodes))
    return np.asarray(2 / SPREAD / (waves @ (weights * _bell(nodes))))


def _bell(t: FloatArray) -> FloatArray:
    return np.exp(2.3 * SPREAD * (np.sqrt(np.maximum(0.0, 1 - t * t)) - 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Deviations:
    """How turns with a few changed mesh periods differ from an even motion.

    Parameters
    ----------
    mesh : PeriodicMotion
        Of one mesh period, without excitation.
    period : int
        P, mesh periods of the turn.
    where : tuple of int, increasing
        Those that differ, 0 to P - 1.
    delta : ndarray, shape (turns, W, panels, meshes, points)
        Change of k in these periods [N/m].
    excitation : ndarray, same shape
        e [m] in these periods; zero in the others.
    """

    mesh: PeriodicMotion
    period: int
    where: tuple[int, ...]
    delta: FloatArray
    excitation: FloatArray

    @cached_property
    def _changed(self) -> list[_Changed]:
        """The mesh periods that differ; known where another gear asked for the same just now."""
        known, key = self.mesh.known_changes, (self.delta.tobytes(), self.excitation.tobytes())
        if key not in known:
            known.clear()
            each = zip(self.delta.swapaxes(0, 1), self.excitation.swapaxes(0, 1), strict=True)
            known[key] = [_Changed(self.mesh, *own) for own in each]
        return known[key]

    @cached_property
    def states(self) -> FloatArray:
        """Change of the state (q, u) when each mesh period begins, shape (turns, P, 2n).

        All there is to say of those that do not differ.
        """
        free, turns, where = self.mesh.monodromy, len(self.delta), self.where
        size = len(free)
        total = np.broadcast_to(np.eye(size, size + 1), (turns, size, size + 1)).copy()
        # from the first changed period on; those before it come last
        ends = (*where, self.period + where[0])
        for own, here, after in zip(self._changed, ends[:-1], ends[1:], strict=True):
            total = _after(own.maps.ends[..., -1, :, :], total)
            total = np.linalg.matrix_power(free, after - here - 1) @ total
        found = np.linalg.solve(np.eye(size) - total[..., :-1], total[..., -1:])
        state = np.asarray(found[..., 0], dtype=np.float64)
        states = np.empty((turns, self.period, size))
        met = dict(zip(where, self._changed, strict=True))
        for here in range(self.period):
            number = (here + where[0]) % self.period
            states[:, number] = state
            if number in met:
                state = _applied(met[number].maps.ends[..., -1, :, :], state)
            else:
                state = state @ free.T
        return states

    @cached_property
    def _even(self) -> FloatArray:
        """States with zeros where mesh periods differ."""
        states = self.states.copy()
        states[:, list(self.where)] = 0.0
        return states

    @cached_property
    def motion(self) -> FloatArray:
        """Change of speeds and deflections where mesh periods differ.

        Shape (turns, W, panels, 2, meshes, points).
        """
        each = zip(self.where, self._changed, strict=True)
        found = [own.motion(self.mesh, self.states[:, here]) for here, own in each]
        return np.stack(found, axis=1).reshape(*self.delta.shape[:2], *self.mesh.motion.shape)

    @cached_property
    def _force(self) -> FloatArray:
        """Change of the mesh forces there but for those of e'."""
        mesh, speed, moved = self.mesh, self.motion[..., 0, :, :], self.motion[..., 1, :, :]
        pressing = (mesh.stiffness + self.delta) * (moved - self.excitation)
        pressing += self.delta * mesh.motion[:, 1]
        return np.asarray(pressing + mesh.around.dampers[:, None] * speed)

    @property
    def contact(self) -> tuple[BoolArray, FloatArray]:
        """Whether teeth part (a mesh force falls to 0), and the mean deflection of the first mesh.

        Shapes (turns,); the latter in m.
        """
        mesh, mean = self.mesh, self.mesh.grid.mean(self.mesh.force)
        free = mesh.grid.mean(np.moveaxis(mesh.free[:, 1], -1, 0))
        moved = self._even.sum(axis=1) @ free + mesh.grid.mean(self.motion[..., 1, :, :]).sum(1)
        mean_m = (mesh.grid.mean(mesh.motion[:, 1]) + moved / self.period)[:, 0]
        changed = (self._force + mesh.force).min(axis=(1, 2, 4)) / mean
        lost = np.asarray((changed <= 0).any(axis=1))
        for free, even, own in zip(mesh.free_force, mesh.force.swapaxes(0, 1), mean, strict=True):
            by_state, still = free.reshape(-1, free.shape[-1]) / own, even.ravel() / own
            # only states that might bring some point down are looked at point by point
            near = np.abs(self._even) @ np.abs(by_state).max(axis=0) >= still.min()
            parted = (self._even[near] @ by_state.T + still).min(axis=1) <= 0
            lost[near.nonzero()[0][parted]] = True
        return lost, mean_m

    @cached_property
    def unresolved(self) -> FloatArray:
        """Share of the change of the speeds in the last two Legendre terms of the panels, (turns,).

        An estimate of the relative error: where the panels suffice the terms fall fast, and what
        is left out is less than what is still seen.
        """
        changed = _unresolved(self.motion[:, :, :, 0], self.mesh.grid.widths)
        return np.maximum(changed, self.mesh.unresolved)

    def force_lines(self, highest: int) -> ComplexArray:
        """Return harmonics 1..highest of the change of the forces, (turns, meshes, highest).

        Of a mesh period that does not differ they follow from its state: the sum over the turn is
        a transform of the states.
        """
        mesh, turns, period = self.mesh, len(self.delta), self.period
        numbers, excited = np.arange(1, highest + 1), self.excitation.any(axis=(1, 2, 3, 4))
        values = np.moveaxis(np.concatenate([self._force, self.excitation[excited]]), 3, 1)
        phases = (np.array(self.where)[:, None, None] + mesh.grid.phase) / period
        weights = mesh.grid.weights / period
        sums = fourier_sums(phases, values * weights, highest)
        # free vibration of the first mesh period that differs
        free = np.moveaxis(mesh.free_force, -1, 0) * weights
        by_place = fourier_sums(phases[0], free, highest)
        states = np.fft.fft(np.roll(self._even, -self.where[0], axis=1).swapaxes(1, 2))
        by_state = np.take(states, numbers % period, axis=2)
        found = np.einsum("kmr,tkr->tmr", by_place, by_state) + sums[:turns]
        found[excited] -= mesh.damped(sums[turns:], period)
        return np.asarray(found)


class _Changed:
    """A mesh period that differs: the forces that the difference makes in its meshes.

    With d the deflection in the even motion and x the deviation, mesh and point (j, i) bring
    ``f = -delta k (d + x) + k e``.

    Parameters
    ----------
    mesh : PeriodicMotion
    delta : ndarray, shape (turns, panels, meshes, points)
        Change of k.
    excitation : ndarray, same shape
        e.

    Attributes
    ----------
    columns : ndarray of int, shape (acting * points,)
        Meshes that differ, among the columns of `PeriodicMotion.forced`.
    force : ndarray, shape (turns, panels, acting * points, 2n + 1)
        f by the state of the deviation when its panel begins, and what is there anyway.
    moved : ndarray, shape (turns, panels, acting * points)
        e.
    maps : _PanelMaps
        Of the deviation.
    """

    def __init__(self, mesh: PeriodicMotion, delta: FloatArray, excitation: FloatArray) -> None:
        acting = np.flatnonzero(((delta != 0) | (excitation != 0)).any(axis=(0, 1, 3)))
        self.columns = (acting[:, None] * POINTS + np.arange(POINTS)).ravel()
        # deflections stand behind all speeds
        seen, forced = self.columns + mesh.stiffness[0].size, mesh.forced

        def rows(values: FloatArray) -> FloatArray:
            """By panel, then acting mesh and point."""
            return values.reshape(*values.shape[:-2], -1)[..., self.columns]

        free, own, self.moved = mesh.maps.seen[:, seen], rows(delta), rows(excitation)
        free[..., -1] = rows(mesh.motion[:, 1])
        right = -own[..., None] * free
        # of damage alone there is nothing to shift
        if self.moved.any():
            shifted = mesh.shifted
            by_e = _times(shifted.seen[:, seen][..., self.columns], self.moved)
            right[..., -1] += rows(mesh.stiffness + delta) * self.moved - own * by_e
        self.force, answers = np.zeros(right.shape), forced.seen[:, seen][..., self.columns]
        pressed = (right != 0).any(axis=(-2, -1))
        matrix = own[pressed][..., None] * answers[np.nonzero(pressed)[-1]]
        self.force[pressed] = np.linalg.solve(matrix + np.eye(len(seen)), right[pressed])
        step = forced.step[..., self.columns] @ self.force
        step[..., :-1] += mesh.maps.step[..., :-1]
        if self.moved.any():
            step[..., -1] += _times(shifted.step[..., self.columns], self.moved)
        self.maps = _PanelMaps(step=step, seen=mesh.maps.seen)

    def motion(self, mesh: PeriodicMotion, start: FloatArray) -> FloatArray:
        """Return deviations of speeds and deflections, (turns, panels, 2 * meshes * points)."""
        states = self.maps.states(start)
        found = _times(mesh.maps.seen[..., :-1], states)
        found += _times(mesh.forced.seen[..., self.columns], _applied(self.force, states))
        if self.moved.any():
            found += _times(mesh.shifted.seen[..., self.columns], self.moved)
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class _PanelMaps:
    """Motions on each panel, mostly as an affine function of the state (q, u) at its start.

    Parameters
    ----------
    step : ndarray of float, shape (..., panels, 2n, columns)
        The state at the end.
    seen : ndarray of float, shape (panels, 2 * meshes * points, columns)
        Speeds, then deflections, at the collocation points.
    """

    step: FloatArray
    seen: FloatArray

    @cached_property
    def ends(self) -> FloatArray:
        """Maps from the start of the first panel to the end of each, shape of `step`."""
        ends, reach = self.step, 1
        while reach < ends.shape[-3]:
            # each covers the `reach` panels before it: so do twice as many
            later, earlier = ends[..., reach:, :, :], ends[..., :-reach, :, :]
            ends = np.concatenate([ends[..., :reach, :, :], _after(later, earlier)], axis=-3)
            reach *= 2
        return ends

    def states(self, start: FloatArray) -> FloatArray:
        """Return the states at the starts of all panels, shape (..., panels, 2n)."""
        ends = _applied(self.ends[..., :-1, :, :], start[..., None, :])
        first = np.broadcast_to(start[..., None, :], (*ends.shape[:-2], 1, start.shape[-1]))
        return np.concatenate([first, ends], axis=-2)


def _applied(maps: FloatArray, state: FloatArray) -> FloatArray:
    """Return what an affine map makes of a state."""
    return np.asarray(_times(maps[..., :-1], state) + maps[..., -1])


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _after(later: FloatArray, earlier: FloatArray) -> FloatArray:
    """Return the affine map of one after another."""
    total = later[..., :-1] @ earlier
    total[..., -1] += later[..., -1]
    return np.asarray(total)


@lru_cache(maxsize=1)
def _integrals() -> FloatArray:
    """Return the matrix from values at the points to integrals from the start of [0, 1] to them."""
    edges = np.array([0.0, 1.0])
    each = Pulse.through(edges, np.eye(POINTS)[None]).running()
    return np.asarray(each.at(panel_nodes(edges, POINTS)[0]).T)


def _unresolved(speed: FloatArray, widths: FloatArray) -> FloatArray:
    """Return the share of the last two Legendre terms, of (turns, ..., points) by turn."""
    series = speed @ gauss(POINTS)[2].T
    power = series**2 / (2 * np.arange(POINTS) + 1) * widths[:, None, None]
    power = power.reshape(len(power), -1, POINTS)
    last, whole = (part.sum(axis=(1, 2)) for part in (power[..., -2:], power))
    return np.asarray(np.sqrt(last / np.where(whole > 0, whole, 1.0)))
