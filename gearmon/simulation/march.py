"""The Runge-Kutta march of many chunks along one course, all at the same time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gearmon.simulation.system import SUBSTEPS, Course, FloatArray, GearedSystem, IntArray


class March:
    """Many chunks on their way along one course.

    Parameters
    ----------
    system : GearedSystem
    course : Course
    """

    def __init__(self, system: GearedSystem, course: Course) -> None:
        self.system, self.course = system, course
        self._lengths_s = np.diff(course.times_s)
        self.longest_step_s = float(self._lengths_s.max(initial=0.0)) / SUBSTEPS or 1.0

    def run(
        self,
        state: FloatArray,
        first: IntArray,
        count: int,
        substeps: int,
        record: NDArray[np.float32] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> FloatArray:
        """Advance all chunks by the same number of pieces.

        Parameters
        ----------
        state : ndarray, shape (2 elements, chunks)
            Deformations [m] and their rates [m/s].
        first : ndarray of int, shape (chunks,)
            First piece of each chunk. Pieces before the beginning or after the end of the course
            last no time.
        count : int
            Pieces to take.
        substeps : int
            Steps in a piece.
        record : ndarray of float32, shape (3, meshes, count * substeps, chunks), optional
            Takes the impulses [N s] of the steps and the forces [N] at their ends.
        progress : callable, optional
            Called with the share done.

        Returns
        -------
        ndarray, shape (2 elements, chunks)
            The state reached.
        """
        stepper = _Stepper(self.system, self.course.deviation.shape[0], state, substeps)
        powers = np.arange(len(self.course.stiffness))
        nodes = np.linspace(0.0, 1.0, 2 * substeps + 1)[:, None] ** powers
        for i in range(count):
            self._enter(stepper, first + i, nodes)
            for j in range(substeps):
                into = None if record is None else record[:, :, i * substeps + j]
                stepper.advance(2 * j, into)
            if progress is not None and i % 16 == 0:
                progress(i / count)
        return np.array(stepper.state)

    def _enter(self, stepper: _Stepper, wanted: IntArray, nodes: FloatArray) -> None:
        """Let the chunks begin the pieces `wanted`, one each."""
        course = self.course
        piece = np.clip(wanted, 0, course.pieces - 1)
        interval, start, width = course.interval[piece], course.start[piece], course.width[piece]
        before = _taken(course.forcing, interval)
        slope = _taken(course.forcing, interval + 1) - before
        polynomial = _shifted(_taken(course.stiffness, interval), start, width)
        values = nodes @ polynomial.reshape(len(polynomial), -1)
        stepper.enter(
            np.where(piece == wanted, self._lengths_s[piece], 0.0),
            values.reshape(-1, *polynomial.shape[1:]),
            _taken(course.deviation, interval),
            before + slope * start,
            slope * width,
        )


def _taken(rows: FloatArray, where: IntArray) -> FloatArray:
    """Return ``rows[..., where]``, contiguous as it is needed; plain indexing is not."""
    flat = rows.reshape(-1, rows.shape[-1])
    return np.take(flat, where, axis=1).reshape(*rows.shape[:-1], len(where))


def _shifted(powers: FloatArray, start: FloatArray, width: FloatArray) -> FloatArray:
    """Return, in place, the polynomials in x of what were polynomials in start + width x."""
    highest = len(powers) - 1
    # Horner's scheme divides by (variable - start) again and again; the remainders stay behind
    for done in range(highest):
        for power in range(highest - 1, done - 1, -1):
            powers[power] += start * powers[power + 1]
    scale = width
    for power in range(1, highest + 1):
        powers[power] *= scale
        scale = scale * width
    return powers


class _Stepper:
    """The Runge-Kutta step; its arrays are filled again and again, for that is where time goes."""

    def __init__(self, system: GearedSystem, pairs: int, state: FloatArray, substeps: int) -> None:
        size, meshes, chunks = system.elements, system.meshes, state.shape[1]
        self._system = system
        self._size, self._meshes, self._substeps = size, meshes, substeps
        self._matrices = _acceleration_matrices(system.coupling, substeps)
        # equal shapes multiply much faster than broadcast ones
        self._damping = np.repeat(system.damping[:, None], chunks, axis=1)
        self._shafts = np.repeat(system.shaft_stiffness[:, None], chunks, axis=1)
        # states at the four stages, and the rates there
        self._states = np.empty((4, 2 * size, chunks))
        self._rates = np.empty((4, 2 * size, chunks))
        self.state = self._states[0]
        self.state[:] = state
        # rows: elastic mesh forces, element forces, forcing of the piece, its change over the piece
        self._rows = np.zeros((4, meshes + 3 * size, chunks))
        self._gap = np.empty((pairs, meshes, chunks))
        self._step, self._half, self._sixth = np.empty((3, 2 * size, chunks))
        self._total = np.empty((2 * size, chunks))

    def enter(
        self,
        length: FloatArray,
        stiffness: FloatArray,
        deviation: FloatArray,
        forcing: FloatArray,
        change: FloatArray,
    ) -> None:
        """Begin a piece.

        Given are its length [s], the pair stiffnesses [N/m] at the ends and middles of its steps,
        the deviations [m], the forcing at its beginning and the change of that over it [m/s2].
        """
        np.multiply(length, 1 / self._substeps, out=self._step[0])
        self._step[1:] = self._step[0]
        np.multiply(self._step, 0.5, out=self._half)
        np.multiply(self._step, 1 / 6, out=self._sixth)
        self._stiffness, self._deviation = stiffness, deviation
        first = self._meshes + self._size
        self._rows[:, first : first + self._size] = forcing
        self._rows[:, first + self._size :] = change

    def advance(self, node: int, record: NDArray[np.float32] | None) -> None:
        """Make the step that begins at a node of the piece (two to a step) and write its forces."""
        rates = self._rates
        self._rate(0, node)
        self._move(1, self._half)
        self._rate(1, node + 1)
        self._move(2, self._half)
        self._rate(2, node + 1)
        self._move(3, self._step)
        self._rate(3, node + 2)
        if record is not None:
            self._note(record)
        total = np.add(rates[1], rates[2], out=self._total)
        total += total
        total += rates[0]
        total += rates[3]
        total *= self._sixth
        self.state += total

    def _move(self, stage: int, step: FloatArray) -> None:
        moved = self._states[stage]
        np.multiply(step, self._rates[stage - 1], out=moved)
        moved += self.state

    def _rate(self, stage: int, node: int) -> None:
        size, meshes, gap = self._size, self._meshes, self._gap
        state, rate, rows = self._states[stage], self._rates[stage], self._rows[stage]
        np.subtract(state[:meshes], self._deviation, out=gap)
        np.maximum(gap, 0.0, out=gap)
        gap *= self._stiffness[node]
        elastic = gap.sum(axis=0, out=rows[:meshes])
        np.multiply(self._damping, state[size:], out=rows[meshes : meshes + size])
        force = rows[meshes : 2 * meshes]
        force += elastic
        if len(self._shafts):
            rows[2 * meshes : meshes + size] += self._shafts * state[meshes:size]
        if rows[: 2 * meshes].min() <= 0.0:
            # a mesh pushes or lets go; its damper does not hold it
            np.maximum(force, 0.0, out=force)
            force *= elastic > 0.0
            self._push_back(state, force)
        rate[:size] = state[size:]
        np.matmul(self._matrices[node], rows[meshes:], out=rate[size:])

    def _push_back(self, state: FloatArray, force: FloatArray) -> None:
        """Add the forces of opposite flanks, in place, where meshes have opened that far."""
        backlash, stiffness = self._system.backlash_m, self._system.back_stiffness
        if backlash is None or stiffness is None:
            return
        beyond = state[: self._meshes] + backlash[:, None]
        if beyond.min() < 0.0:
            speed = state[self._size : self._size + self._meshes]
            push = stiffness[:, None] * beyond + self._damping[: self._meshes] * speed
            force += np.where(beyond < 0.0, np.minimum(push, 0.0), 0.0)

    def _note(self, record: NDArray[np.float32]) -> None:
        """Write the impulse of a step and the forces at its ends."""
        s = self._rows[:, self._meshes : 2 * self._meshes]
        impulse = s[1] + s[2]
        impulse += impulse
        impulse += s[0]
        impulse += s[3]
        impulse *= self._sixth[: self._meshes]
        record[0] = impulse
        record[1] = s[0]
        record[2] = s[3]


def _acceleration_matrices(coupling: FloatArray, substeps: int) -> FloatArray:
    """Return what turns element forces, forcing and its change into accelerations, by node."""
    size = len(coupling)
    passed = np.linspace(0.0, 1.0, 2 * substeps + 1)
    fixed = np.hstack([-coupling, np.eye(size)])
    return np.stack([np.hstack([fixed, share * np.eye(size)]) for share in passed])
