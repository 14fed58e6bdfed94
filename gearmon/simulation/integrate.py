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

import numpy as np
from numpy.typing import NDArray

from gearmon.simulation.march import March
from gearmon.simulation.system import (
    SUBSTEPS,
    Course,
    FloatArray,
    GearedSystem,
    IntArray,
    MeshForces,
)

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
    return MeshForces(
        course=course,
        impulses_ns=record[0],
        starts_n=record[1],
        ends_n=record[2],
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
