"""Time integration of long records: many chunks side by side.

The stiffness of a tooth pair jumps when it enters or leaves contact. The course of the motion is
given in pieces that end at every such event, so that the fourth-order Runge-Kutta step never
straddles one. A long record is cut into chunks of pieces that are integrated at the same time; each
starts early from the static state and forgets that guess during its run-in. What is left of it is
measured where the chunks join, and chunks that do not join are integrated again from the end of the
one before. Motion with loss of contact can be irregular and never forget: there each chunk is faded
from the motion that continues the chunk before it into the one that the chunk after it continues.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from gearmon.errors import ArgumentError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

#: Runge-Kutta steps in every piece of a course.
SUBSTEPS = 8


#: Runge-Kutta steps in a piece of the part of the run-in whose errors are forgotten too.
COARSE_SUBSTEPS = 4
#: That part of the run-in.
COARSE_SHARE = 0.65
#: Largest disagreement of two chunks at their joint, relative to the static deformation.
JOINT_TOLERANCE = 3e-6
#: Most passes over chunks that do not join; only irregular (rattling) motion is not done then.
REPAIR_PASSES = 6
# A step costs as much for this many chunks as it costs to call the routines that make it.
_CHUNKS_PER_CALL = 600.0


@dataclass(frozen=True, kw_only=True, eq=False)
class GearedSystem:
    """Inertias, dampers and shafts of a drive train, seen from the deformations of its elements.

    Parameters
    ----------
    coupling : ndarray, shape (elements, elements)
        W = B M^-1 B' [1/kg for meshes], symmetric and positive semidefinite.
    damping : ndarray, shape (elements,)
        Damping of every element [N s/m].
    shaft_stiffness : ndarray, shape (elements - meshes,)
        Stiffness of the elements that are not meshes [N/m]; the meshes come first.
    backlash_m : ndarray, shape (meshes,), optional
        Way from contact to contact of the opposite flanks [m]; endless without it.
    back_stiffness : ndarray, shape (meshes,), optional
        Stiffness of the opposite flanks [N/m]; goes with `backlash_m`.
    """

    coupling: FloatArray
    damping: FloatArray
    shaft_stiffness: FloatArray
    backlash_m: FloatArray | None = None
    back_stiffness: FloatArray | None = None

    def __post_init__(self) -> None:
        size = len(self.damping)
        if self.coupling.shape != (size, size) or len(self.shaft_stiffness) > size:
            raise ArgumentError(f"coupling of shape {self.coupling.shape} must be square, {size=}")

    @property
    def elements(self) -> int:
        """Number of meshes and shafts."""
        return len(self.damping)

    @property
    def meshes(self) -> int:
        """Number of meshes."""
        return len(self.damping) - len(self.shaft_stiffness)

    def natural_frequencies_hz(self, mesh_stiffness: FloatArray) -> FloatArray:
        """Undamped natural frequencies with constant mesh stiffnesses [Hz], increasing.

        Elements that cannot deform independently of one another give zeros, which are left out.
        """
        root = np.sqrt(np.concatenate([mesh_stiffness, self.shaft_stiffness]))
        squares = np.linalg.eigvalsh(root[:, None] * self.coupling * root)
        return np.asarray(np.sqrt(squares[squares > 1e-9 * squares[-1]]) / (2 * math.pi))

    def decay_rate(self, mesh_stiffness: FloatArray) -> float:
        """Decay rate of the slowest transient with constant mesh stiffnesses [1/s]."""
        stiffness, base = np.concatenate([mesh_stiffness, self.shaft_stiffness]), self._base
        size = base.shape[1]
        matrix = np.zeros((2 * size, 2 * size))
        matrix[:size, size:] = np.eye(size)
        matrix[size:, :size] = -(base.T * stiffness) @ base
        matrix[size:, size:] = -(base.T * self.damping) @ base
        return float(-np.linalg.eigvals(matrix).real.max())

    def static_deformation(self, forcing: FloatArray, mesh_stiffness: FloatArray) -> FloatArray:
        """Deformations at rest under constant `forcing` [m], shape (elements,)."""
        stiffness, base = np.concatenate([mesh_stiffness, self.shaft_stiffness]), self._base
        # q = base x and W = base base', so that base' k base x = base^+ g
        load = np.linalg.pinv(base) @ forcing
        return np.asarray(base @ np.linalg.solve((base.T * stiffness) @ base, load))

    @property
    def _base(self) -> FloatArray:
        """Root of W: eigenvectors times roots of eigenvalues; elsewhere nothing moves or decays."""
        values, vectors = np.linalg.eigh(self.coupling)
        kept = values > 1e-9 * values[-1]
        return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """Stiffnesses, deviations and forcing over time, in intervals within which they are smooth.

    Intervals end at events; each is cut into equal pieces that the integration takes one by one.

    Parameters
    ----------
    times_s : ndarray, shape (pieces + 1,)
        Edges of the pieces [s], not decreasing.
    interval : ndarray of int, shape (pieces,)
        Interval that a piece belongs to.
    start, width : ndarray, shape (pieces,)
        Beginning and length of the piece as shares of its interval.
    stiffness : ndarray, shape (powers, pairs, meshes, intervals)
        Polynomials of the pair stiffnesses [N/m] in the share of the interval that has passed;
        zero for pairs that are not in contact.
    deviation : ndarray, shape (pairs, meshes, intervals)
        Missing material of each pair in contact [m].
    forcing : ndarray, shape (elements, intervals + 1)
        g at the ends of the intervals [m/s2]; straight in between.
    """

    times_s: FloatArray
    interval: IntArray
    start: FloatArray
    width: FloatArray
    stiffness: FloatArray
    deviation: FloatArray
    forcing: FloatArray

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.interval)


def divided_course(
    times_s: FloatArray,
    stiffness: FloatArray,
    deviation: FloatArray,
    forcing: FloatArray,
    longest_step_s: float,
) -> Course:
    """Return a course whose intervals are cut so that no step is longer than `longest_step_s`.

    Parameters
    ----------
    times_s : ndarray, shape (intervals + 1,)
        Ends of the intervals [s].
    stiffness, deviation, forcing
        See `Course`.
    longest_step_s : float
        [s].
    """
    lengths = np.diff(times_s)
    parts = np.maximum(np.ceil(lengths / (SUBSTEPS * longest_step_s)), 1).astype(np.intp)
    interval = np.repeat(np.arange(len(lengths)), parts)
    part = np.arange(len(interval)) - np.repeat(np.cumsum(parts) - parts, parts)
    width = 1.0 / parts[interval]
    edges = times_s[interval] + lengths[interval] * part * width
    return Course(
        times_s=np.append(edges, times_s[-1]),
        interval=interval,
        start=part * width,
        width=width,
        stiffness=stiffness,
        deviation=deviation,
        forcing=forcing,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshForces:
    """Mesh forces over the Runge-Kutta steps of a course.

    Parameters
    ----------
    course : Course
        Each of its pieces holds `SUBSTEPS` equal steps.
    impulses_ns, starts_n, ends_n : ndarray of float32, shape (meshes, steps)
        Integral of the force over each step [N s] and its limits at the ends of the step [N].
    end_state : ndarray, shape (2, elements)
        Deformations [m] and their rates [m/s] at the end.
    joint_mismatch : float
        Largest disagreement of two chunks at their joint, relative to the static deformation.
    """

    course: Course
    impulses_ns: NDArray[np.float32]
    starts_n: NDArray[np.float32]
    ends_n: NDArray[np.float32]
    end_state: FloatArray
    joint_mismatch: float

    @property
    def steps_s(self) -> FloatArray:
        """Where the steps of the course begin, and where the last one ends [s]."""
        times = self.course.times_s
        share = np.arange(SUBSTEPS) / SUBSTEPS
        return np.append((times[:-1, None] + np.diff(times)[:, None] * share).ravel(), times[-1])


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
        nodes = np.linspace(0.0, 1.0, 2 * substeps + 1)
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
        before = np.take(course.forcing, interval, axis=-1)
        slope = np.take(course.forcing, interval + 1, axis=-1) - before
        stiffness = np.take(course.stiffness, interval, axis=-1)
        # one more axis in front: the nodes of the steps
        place = (start + width * nodes[:, None])[:, None, None]
        stepper.enter(
            np.where(piece == wanted, self._lengths_s[piece], 0.0),
            np.asarray(polyval(place, stiffness, tensor=False), dtype=np.float64),
            np.take(course.deviation, interval, axis=-1),
            before + slope * start,
            slope * width,
        )


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


def integrate(
    system: GearedSystem,
    course: Course,
    static_m: FloatArray,
    *,
    run_in: int,
    start: FloatArray | None = None,
    chunks: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> MeshForces:
    """Integrate the equations of motion along a course.

    Parameters
    ----------
    system : GearedSystem
    course : Course
    static_m : ndarray, shape (elements,)
        Static deformation [m]: the first guess of every chunk and the scale of the joints.
    run_in : int, >= 0
        Pieces that a chunk starts early.
    start : ndarray, shape (2, elements), optional
        State at the beginning of the course; the static one at rest by default.
    chunks : int, optional
        Number of chunks; by default what costs least, and one without a run-in.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    MeshForces
    """
    count = chunks or _cheapest_chunks(course.pieces, run_in)
    length = -(-course.pieces // count)
    # rounded lengths may leave nothing for the last chunks
    count = -(-course.pieces // length)
    first = np.arange(count) * length
    at_rest = np.concatenate([static_m, np.zeros_like(static_m)])
    state = np.repeat(at_rest[:, None], count, axis=1)
    if start is not None:
        state[:, first <= run_in] = start.reshape(-1, 1)
    march = March(system, course)
    coarse = int(COARSE_SHARE * run_in)
    state = march.run(state, first - run_in, coarse, COARSE_SUBSTEPS)
    begun = march.run(state, first - run_in + coarse, run_in - coarse, SUBSTEPS)
    record = np.empty((3, system.meshes, length * SUBSTEPS, count), dtype=np.float32)
    ended = march.run(begun, first, length, SUBSTEPS, record, progress)
    mismatch = _join(march, record, begun, ended, first, static_m)
    # the last chunk goes on beyond the end of the course with steps that last no time
    ordered = record.swapaxes(2, 3).reshape(3, system.meshes, -1)
    impulses, starts, ends = ordered[:, :, : course.pieces * SUBSTEPS]
    return MeshForces(
        course=course,
        impulses_ns=impulses,
        starts_n=starts,
        ends_n=ends,
        end_state=ended[:, -1].reshape(2, -1),
        joint_mismatch=mismatch,
    )


def _cheapest_chunks(pieces: int, run_in: int) -> int:
    """Return the number of chunks that balances the cost of calls against repeated run-ins."""
    if run_in == 0:
        return 1
    # cost of a chunk's pieces: (run_in + pieces / n) (calls + n)
    return max(1, min(round(math.sqrt(_CHUNKS_PER_CALL * pieces / run_in)), pieces))


def _join(
    march: March,
    record: NDArray[np.float32],
    begun: FloatArray,
    ended: FloatArray,
    first: IntArray,
    static_m: FloatArray,
) -> float:
    """Make the chunks continue one another, in place; return how well they did by themselves."""
    size, length = len(static_m), record.shape[2] // SUBSTEPS
    # rates are compared by the deformation that they make within a radian of the fastest mode
    scale = np.abs(static_m).max() / np.repeat([1.0, march.longest_step_s], size)[:, None]
    for passes in range(REPAIR_PASSES + 1):
        mismatch = (np.abs(begun[:, 1:] - ended[:, :-1]) / scale).max(axis=0, initial=0.0)
        loose = 1 + np.flatnonzero(mismatch > JOINT_TOLERANCE)
        if not len(loose):
            break
        before = ended[:, loose - 1]
        again = np.empty((*record.shape[:-1], len(loose)), dtype=np.float32)
        reached = march.run(before, first[loose], length, SUBSTEPS, again)
        if passes == REPAIR_PASSES:
            record[..., loose] = _faded(again, record[..., loose])
            break
        begun[:, loose], ended[:, loose], record[..., loose] = before, reached, again
    return float(mismatch.max(initial=0.0))


def _faded(first: NDArray[np.float32], last: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return records that begin as `first` and end as `last`."""
    steps = first.shape[2]
    share = (np.arange(steps, dtype=np.float32) / steps)[:, None]
    return np.asarray(first + share * (last - first), dtype=np.float32)
