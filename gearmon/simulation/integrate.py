"""Time integration of long records: many chunks side by side.

The stiffness of a tooth pair jumps when it enters or leaves contact. The course of the motion is
given in pieces that end at every such event, so that the fourth-order Runge-Kutta step never
straddles one. A long record is cut into chunks of pieces that are integrated at the same time; each
starts early from the static state and forgets that guess during its run-in: all of it, or only what
fast modes make of it. What is left is measured where the chunks join. What a chunk must begin with
instead is told by the jumps at all joints before it, as they die out in the system with mean mesh
stiffnesses, and chunks that do not join are integrated again from there (parareal; Lions, Maday and
Turinici, C. R. Acad. Sci. Paris 332 (2001) 661). Motion with loss of contact can be irregular and
never forget: there each chunk is faded from the motion that continues the chunk before it into the
one that the chunk after it continues.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from gearmon.arrays import FloatArray
from gearmon.gears.mechanics import Around
from gearmon.terminal import Progress, part_of

IntArray = NDArray[np.intp]

#: Runge-Kutta steps in every piece of a course.
SUBSTEPS = 8


#: Runge-Kutta steps in a piece of the part of the run-in whose errors are forgotten too.
COARSE_SUBSTEPS = 4
#: That part of the run-in.
COARSE_SHARE = 0.65
#: Largest disagreement of two chunks at their joint, root of its energy over that at rest. Of a
#: wind turbine, whose vibration is small beside its load, it leaves 1.4e-5 of the vibration.
JOINT_TOLERANCE = 1e-7
#: Most passes over chunks that do not join; only irregular (rattling) motion is not done then.
#: Where all of it is irregular, half of the joints are no nearer by this share after a pass: the
#: next is the last then. Of a planetary set that rattles under 3 Nm a pass mends one of 120 joints.
REPAIR_PASSES, IRREGULAR = 6, 0.5
#: Passes over all chunks that a short run-in takes, and the share of a mode's strain energy in the
#: meshes up to which the run-in need not last until it has died out: two modes of a wind turbine's
#: train, with shares of 5 and 6 %, join after three passes; those with shares of 24 to 41 % of
#: three other machines do not in six.
PASSES_AFTER_SHORT_RUN_IN, HARDLY_FELT = 3, 0.1
# A step costs as much for this many chunks as it costs to call the routines that make it.
_CHUNKS_PER_CALL = 600.0


@dataclass(frozen=True, kw_only=True, eq=False)
class GearedSystem(Around):
    """A drive train in m modes: p'' + C p' + K p = G u(t) - V' s with the mesh forces s.

    The deflections of the meshes are V p; all free motion strains something.

    Parameters
    ----------
    vectors, means, dampers, stiffness, damping, inputs
        V, mean stiffness [N/m] and damping [N s/m] of the meshes (the former that of their opposite
        flanks too), K and C of all but the meshes, and G, as of `Around`; the first input is the
        load over its mean.
    backlash_m : ndarray, shape (meshes,), optional
        Way from contact to contact of the opposite flanks [m]; endless without it.
    """

    backlash_m: FloatArray | None = None

    def whole_stiffness(self, mesh_stiffness: FloatArray | None = None) -> FloatArray:
        """K with constant meshes, by default with their means."""
        means = self.means if mesh_stiffness is None else mesh_stiffness
        return np.asarray(self.stiffness + (self.vectors.T * means) @ self.vectors)

    def natural_frequencies_hz(self, mesh_stiffness: FloatArray | None = None) -> FloatArray:
        """Undamped natural frequencies with constant meshes [Hz], increasing."""
        squares = np.linalg.eigvalsh(self.whole_stiffness(mesh_stiffness))
        return np.asarray(np.sqrt(squares) / (2 * math.pi))

    @property
    def free_motion(self) -> FloatArray:
        """A of (p, p')' = A (p, p'), with mean mesh stiffnesses and no inputs, shape (2 m, 2 m)."""
        none, one = np.zeros_like(self.damping), np.eye(len(self.damping))
        return np.block([[none, one], [-self.whole_stiffness(), -self.whole_damping]])

    @property
    def rates(self) -> NDArray[np.complex128]:
        """Of free motion with mean mesh stiffnesses: exp(rate t) [1/s]."""
        return np.asarray(np.linalg.eigvals(self.free_motion), dtype=np.complex128)

    @property
    def decay_rate(self) -> float:
        """Decay rate of the slowest transient with mean mesh stiffnesses [1/s]."""
        return float(-self.rates.real.max())

    @property
    def mesh_decay_rate(self) -> float:
        """Decay rate of the slowest of the modes that strain the meshes [1/s]."""
        squares, shapes = np.linalg.eigh(self.whole_stiffness())
        share = self.means @ (self.vectors @ shapes) ** 2 / squares
        rates = 0.5 * np.einsum("ij,ij->j", shapes, self.whole_damping @ shapes)
        # many modes of fine shafts may share what the meshes feel
        return float(rates[share > min(HARDLY_FELT, 0.5 * share.max())].min())

    @property
    def at_rest(self) -> FloatArray:
        """Modes p under the mean load with mean mesh stiffnesses."""
        return np.asarray(np.linalg.solve(self.whole_stiffness(), self.inputs[:, 0]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """Stiffnesses, deviations and inputs over time, in intervals within which they are smooth.

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
    inputs : ndarray, shape (inputs, intervals + 1)
        u at the ends of the intervals; straight in between.
    """

    times_s: FloatArray
    interval: IntArray
    start: FloatArray
    width: FloatArray
    stiffness: FloatArray
    deviation: FloatArray
    inputs: FloatArray

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.interval)


def divided_course(
    times_s: FloatArray,
    stiffness: FloatArray,
    deviation: FloatArray,
    inputs: FloatArray,
    longest_step_s: float,
) -> Course:
    """Return a course whose intervals are cut so that no step is longer than `longest_step_s`.

    Parameters
    ----------
    times_s : ndarray, shape (intervals + 1,)
        Ends of the intervals [s].
    stiffness, deviation, inputs
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
        inputs=inputs,
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
    end_state : ndarray, shape (2, m)
        p and p' at the end.
    joint_mismatch : float
        Largest disagreement of two chunks at their joint: root of its energy over that at rest.
    """

    course: Course
    impulses_ns: NDArray[np.float32]
    starts_n: NDArray[np.float32]
    ends_n: NDArray[np.float32]
    end_state: FloatArray
    joint_mismatch: float


class March:
    """Many chunks on their way along one course, by Runge-Kutta steps.

    Its arrays are filled again and again, for that is where time goes.

    Parameters
    ----------
    system : GearedSystem
    course : Course
    state : ndarray, shape (2 m, chunks)
        p, then p'.
    substeps : int
        Steps in a piece.
    """

    def __init__(
        self, system: GearedSystem, course: Course, state: FloatArray, substeps: int = SUBSTEPS
    ) -> None:
        (meshes, size), chunks = system.vectors.shape, state.shape[1]
        self._course, self._lengths_s = course, np.diff(course.times_s)
        self._system, self._substeps, self._size = system, substeps, size
        self._sight = np.kron(np.eye(2), system.vectors)
        # what turns state, mesh forces, inputs and their change into accelerations, by node
        fixed = (-system.stiffness, -system.damping, -system.vectors.T, system.inputs)
        self._nodes = np.linspace(0.0, 1.0, 2 * substeps + 1)
        matrices = [np.hstack([*fixed, share * system.inputs]) for share in self._nodes]
        self._matrices = np.stack(matrices)
        # equal shapes multiply much faster than broadcast ones
        self._damping = np.repeat(system.dampers[:, None], chunks, axis=1)
        # rows of the four stages: state, mesh forces, inputs of the piece, their change over it
        self._rows = np.zeros((4, self._matrices.shape[2], chunks))
        self._states, self._inputs = self._rows[:, : 2 * size], self._rows[:, 2 * size + meshes :]
        self._forces = self._rows[:, 2 * size : 2 * size + meshes]
        self._rates = np.empty((4, 2 * size, chunks))
        self._state = self._states[0]
        self._state[:] = state
        self._seen = np.empty((2, meshes, chunks))
        self._gap = np.empty((course.deviation.shape[0], meshes, chunks))
        self._elastic = np.empty((meshes, chunks))
        self._step, self._half, self._sixth = np.empty((3, 2 * size, chunks))
        self._total = np.empty((2 * size, chunks))

    def run(
        self,
        first: IntArray,
        count: int,
        record: NDArray[np.float32] | None = None,
        progress: Progress | None = None,
    ) -> FloatArray:
        """Advance all chunks by the same number of pieces, and return the state reached.

        Parameters
        ----------
        first : ndarray of int, shape (chunks,)
            First piece of each chunk. Pieces before the beginning or after the end of the course
            last no time.
        count : int
            Pieces to take.
        record : ndarray of float32, shape (3, meshes, count * substeps, chunks), optional
            Takes the impulses [N s] of the steps and the forces [N] at their ends.
        progress : callable, optional
            Called with the share done.
        """
        for i in range(count):
            self._enter(first + i)
            for j in range(self._substeps):
                into = None if record is None else record[:, :, i * self._substeps + j]
                self._advance(2 * j, into)
            if progress is not None and i % 16 == 0:
                progress(i / count)
        return np.array(self._state)

    def _enter(self, wanted: IntArray) -> None:
        """Let the chunks begin the pieces `wanted`, one each."""
        course = self._course
        piece = np.clip(wanted, 0, course.pieces - 1)
        interval, start, width = course.interval[piece], course.start[piece], course.width[piece]
        length = np.where(piece == wanted, self._lengths_s[piece], 0.0)
        np.multiply(length, 1 / self._substeps, out=self._step[0])
        self._step[1:] = self._step[0]
        np.multiply(self._step, 0.5, out=self._half)
        np.multiply(self._step, 1 / 6, out=self._sixth)
        # at the ends and middles of the steps: one more axis in front
        place = (start + width * self._nodes[:, None])[:, None, None]
        stiffness = np.take(course.stiffness, interval, axis=-1)
        self._stiffness = np.asarray(polyval(place, stiffness, tensor=False), dtype=np.float64)
        self._deviation = np.take(course.deviation, interval, axis=-1)
        before = np.take(course.inputs, interval, axis=-1)
        slope = np.take(course.inputs, interval + 1, axis=-1) - before
        self._inputs[:] = np.concatenate([before + slope * start, slope * width])

    def _advance(self, node: int, record: NDArray[np.float32] | None) -> None:
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
            s = self._forces
            impulse = s[1] + s[2]
            impulse += impulse
            impulse += s[0]
            impulse += s[3]
            impulse *= self._sixth[0]
            record[0], record[1], record[2] = impulse, s[0], s[3]
        total = np.add(rates[1], rates[2], out=self._total)
        total += total
        total += rates[0]
        total += rates[3]
        total *= self._sixth
        self._state += total

    def _move(self, stage: int, step: FloatArray) -> None:
        moved = self._states[stage]
        np.multiply(step, self._rates[stage - 1], out=moved)
        moved += self._state

    def _rate(self, stage: int, node: int) -> None:
        size, rate, rows, gap = self._size, self._rates[stage], self._rows[stage], self._gap
        place, speed = self._seen
        np.matmul(self._sight, rows[: 2 * size], out=self._seen.reshape(len(self._sight), -1))
        np.subtract(place, self._deviation, out=gap)
        np.maximum(gap, 0.0, out=gap)
        gap *= self._stiffness[node]
        elastic, force = gap.sum(axis=0, out=self._elastic), self._forces[stage]
        np.multiply(self._damping, speed, out=force)
        force += elastic
        if elastic.min() <= 0.0 or force.min() <= 0.0:
            # a mesh pushes or lets go; its damper does not hold it
            np.maximum(force, 0.0, out=force)
            force *= elastic > 0.0
            # opposite flanks push back where meshes have opened that far
            backlash = self._system.backlash_m
            beyond = place + (math.inf if backlash is None else backlash[:, None])
            if beyond.min() < 0.0:
                push = self._system.means[:, None] * beyond + self._damping * speed
                force += np.where(beyond < 0.0, np.minimum(push, 0.0), 0.0)
        rate[:size] = rows[size : 2 * size]
        np.matmul(self._matrices[node], rows, out=rate[size:])


def integrate(
    system: GearedSystem,
    course: Course,
    *,
    run_in: int,
    start: FloatArray | None = None,
    chunks: int | None = None,
    progress: Progress | None = None,
) -> MeshForces:
    """Integrate the equations of motion along a course.

    Parameters
    ----------
    system : GearedSystem
    course : Course
    run_in : int, >= 0
        Pieces in which a chunk forgets all of its guess; it starts as early, or where that costs
        less, as late as lets fast modes forget theirs.
    start : ndarray, shape (2, m), optional
        p and p' at the beginning of the course; the static one at rest by default.
    chunks : int, optional
        Number of chunks, each with all of the run-in; by default what costs least, and one without
        a run-in.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    MeshForces
    """
    plans = _plans(system, course.pieces, run_in) if chunks is None else [(1, run_in, chunks)]
    at_rest = np.append(system.at_rest, np.zeros(len(system.stiffness)))
    meshes = len(system.vectors)
    for passes, own, wanted in plans:

        def tell(done: float, passes: int = passes) -> None:
            """Tell how often all of the course has been done."""
            if progress is not None:
                progress(min(1.0, done / passes))

        length = -(-course.pieces // wanted)
        # rounded lengths may leave nothing for the last chunks
        count = -(-course.pieces // length)
        first, coarse = np.arange(count) * length, int(COARSE_SHARE * own)
        state = np.repeat(at_rest[:, None], count, axis=1)
        if start is not None:
            state[:, first <= own] = start.reshape(-1, 1)
        state = March(system, course, state, COARSE_SUBSTEPS).run(first - own, coarse)
        begun = March(system, course, state).run(first - own + coarse, own - coarse)
        record = np.empty((3, meshes, length * SUBSTEPS, count), dtype=np.float32)
        ended = March(system, course, begun).run(first, length, record, tell)
        mismatch = _join(system, course, record, begun, ended, first, tell)
        # slow modes of irregular motion must forget by themselves
        if mismatch <= JOINT_TOLERANCE:
            break
    # the last chunk goes on beyond the end of the course with steps that last no time
    ordered = record.swapaxes(2, 3).reshape(3, meshes, -1)
    impulses, starts, ends = ordered[:, :, : course.pieces * SUBSTEPS]
    return MeshForces(
        course=course,
        impulses_ns=impulses,
        starts_n=starts,
        ends_n=ends,
        end_state=ended[:, -1].reshape(2, -1),
        joint_mismatch=mismatch,
    )


def _plans(system: GearedSystem, pieces: int, run_in: int) -> list[tuple[int, int, int]]:
    """Return passes, run-ins and numbers of chunks that balance the cost of calls and pieces.

    The last has all of the run-in, and before it comes a cheaper one if there is any.
    """
    if run_in == 0:
        return [(1, 0, 1)]
    short = min(run_in, math.ceil(run_in * system.decay_rate / system.mesh_decay_rate))
    plans, costs = [], []
    for passes, own in (1 + PASSES_AFTER_SHORT_RUN_IN, short), (1, run_in):
        # cost of a chunk's pieces: (own + passes pieces / n) (calls + n)
        best = math.sqrt(_CHUNKS_PER_CALL * passes * pieces / own)
        count = max(1, min(round(best), pieces))
        costs.append((own + passes * pieces / count) * (_CHUNKS_PER_CALL + count))
        plans.append((passes, own, count))
    return plans if costs[0] < costs[1] else plans[1:]


def _join(
    system: GearedSystem,
    course: Course,
    record: NDArray[np.float32],
    begun: FloatArray,
    ended: FloatArray,
    first: IntArray,
    tell: Progress,
) -> float:
    """Make the chunks continue one another, in place; return how well they did in the end."""
    length, stiffness = record.shape[2] // SUBSTEPS, system.whole_stiffness()
    rest = math.sqrt(float(system.at_rest @ system.inputs[:, 0]))

    def size(state: FloatArray) -> FloatArray:
        moved, speed = np.split(state, 2)
        return np.asarray(np.sqrt(np.sum(moved * (stiffness @ moved) + speed**2, axis=0)) / rest)

    dying: FloatArray | None = None
    usual = math.inf
    for passes in range(REPAIR_PASSES + 1):
        jumps = ended[:, :-1] - begun[:, 1:]
        mismatch = size(jumps)
        if not (mismatch > JOINT_TOLERANCE).any():
            break
        earlier, usual = usual, float(np.median(mismatch))
        last = passes == REPAIR_PASSES or usual > max(IRREGULAR * earlier, JOINT_TOLERANCE)
        if not last:
            if dying is None:
                # what free motion with mean mesh stiffnesses becomes over each chunk
                spans = np.diff(course.times_s[first])[:, None, None]
                dying = np.asarray(scipy.linalg.expm(system.free_motion * spans))
            # what comes before a chunk changes what it must begin with
            for k in range(1, jumps.shape[1]):
                jumps[:, k] += dying[k] @ jumps[:, k - 1]
        loose = 1 + np.flatnonzero(np.maximum(mismatch, size(jumps)) > JOINT_TOLERANCE)
        before = begun[:, loose] + jumps[:, loose - 1]
        again = np.empty((*record.shape[:-1], len(loose)), dtype=np.float32)
        told = part_of(tell, passes + 1, 1.0)
        reached = March(system, course, before).run(first[loose], length, again, told)
        if last:
            # irregular motion does not join: it is faded from one way into the other
            share = np.linspace(0, 1, again.shape[2], endpoint=False, dtype=np.float32)[:, None]
            record[..., loose] = again + share * (record[..., loose] - again)
            break
        begun[:, loose], ended[:, loose], record[..., loose] = before, reached, again
    return float(mismatch.max(initial=0.0))
