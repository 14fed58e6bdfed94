"""From forces at the steps of an integration to forces at regular instants, without aliasing.

The steps follow the events of the meshes, a recording has a clock. At the instants of a fine
regular grid the force is first averaged with a triangular weight over the two cells beside each.
That is exact, for the impulse of every step is known, and it keeps the jumps of the force, which
are large beside its slow parts, from being folded onto them. A low-pass then keeps what the
recording's rate can carry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.simulation.system import SUBSTEPS, MeshForces

FloatArray = NDArray[np.float64]

#: The recording's response is flat up to this share of its sampling rate and zero from a half on.
FLAT_SHARE = 0.4


def triangle_means(
    forces: MeshForces,
    start_s: float,
    cell_s: float,
    cells: int,
    before: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return means of the mesh forces with triangular weights about the beginnings of cells.

    Parameters
    ----------
    forces : MeshForces
        Over a course that covers the cells.
    start_s, cell_s : float
        Beginning of the first cell and length of a cell [s].
    cells : int
    before : ndarray, shape (meshes,), optional
        What the call for the cells before these gave as its second result; without it the first
        mean is one-sided.

    Returns
    -------
    means : ndarray, shape (meshes, cells)
        [N].
    after : ndarray, shape (meshes,)
        What the next cells need of these.

    Notes
    -----
    The weight is 1/h at the instant and falls to 0 at a cell's length h to both sides. Let I be
    the impulse since the instant: the mean is the integral of I over the cell after it, less that
    over the cell before it, over h^2. Within a step I is the cubic with the known total and the
    known forces at both ends.
    """
    edges = start_s + cell_s * np.arange(cells + 1, dtype=np.float64)
    places = _places(forces, edges)
    steps_s = forces.steps_s
    means = np.empty((len(forces.impulses_ns), cells))
    after = np.empty(len(means))
    for mesh, mean in enumerate(means):
        later, earlier = _moments(forces, mesh, steps_s, places, cell_s)
        first = -later[0] if before is None else before[mesh]
        mean[:] = later - np.concatenate([[first], earlier[:-1]])
        mean /= cell_s**2
        after[mesh] = earlier[-1]
    return means, after


@dataclass(frozen=True, kw_only=True, eq=False)
class _Places:
    """Where instants lie: step (an index into the flat arrays), its length and the share passed."""

    index: NDArray[np.intp]
    chunk: NDArray[np.intp]
    length_s: FloatArray
    share: FloatArray
    edges_s: FloatArray
    chunk_ends_s: FloatArray


def _places(forces: MeshForces, edges_s: FloatArray) -> _Places:
    times = forces.course.times_s
    step_s = np.diff(times) / SUBSTEPS
    piece = np.clip(np.searchsorted(times, edges_s, side="right") - 1, 0, len(step_s) - 1)
    length = step_s[piece]
    # pieces of no length hold no time; the division is for their sake
    passed = (edges_s - times[piece]) / np.where(length > 0, length, 1.0)
    inside = np.clip(passed.astype(np.intp), 0, SUBSTEPS - 1)
    steps, chunks = forces.impulses_ns.shape[1:]
    chunk, step = np.divmod(piece * SUBSTEPS + inside, steps)
    last = np.minimum(np.arange(1, chunks + 1) * (steps // SUBSTEPS), len(times) - 1)
    return _Places(
        index=step * chunks + chunk,
        chunk=chunk,
        length_s=length,
        share=np.clip(passed - inside, 0.0, 1.0),
        edges_s=edges_s,
        chunk_ends_s=times[last],
    )


def _moments(
    forces: MeshForces, mesh: int, steps_s: FloatArray, places: _Places, cell_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return for each cell the integral of the impulse since its beginning, and since its end."""
    impulses = forces.impulses_ns[mesh].astype(np.float64)
    starts, ends = forces.starts_n[mesh], forces.ends_n[mesh]
    # Less the mean of each chunk, the running sums come back to zero and keep their digits.
    chunk_means = impulses.sum(axis=0) / steps_s.sum(axis=0)
    impulses -= chunk_means * steps_s
    sums = np.cumsum(impulses, axis=0) - impulses
    areas = (sums + 0.5 * impulses + steps_s * (starts - ends) / 12) * steps_s
    totals = np.cumsum(areas, axis=0)
    offsets = np.concatenate([[0.0], np.cumsum(totals[-1])[:-1]])
    totals += offsets - areas
    length, x, mean = places.length_s, places.share, chunk_means[places.chunk]
    first = (np.take(starts, places.index) - mean) * length
    last = (np.take(ends, places.index) - mean) * length
    step = np.take(impulses, places.index)
    bend, twist = 3 * step - 2 * first - last, first + last - 2 * step
    sum_here = np.take(sums, places.index)
    impulse = sum_here + x * (first + x * (bend + x * twist))
    area = np.take(totals, places.index) + length * x * (
        sum_here + x * (first / 2 + x * (bend / 3 + x * twist / 4))
    )
    whole = np.diff(area)
    later, earlier = _constant_moments(places, chunk_means, cell_s)
    return whole - impulse[:-1] * cell_s + later, whole - impulse[1:] * cell_s + earlier


def _constant_moments(
    places: _Places, chunk_means: FloatArray, cell_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return what the means of the chunks add to the moments of the cells."""
    before, after = places.chunk[:-1], places.chunk[1:]
    later = 0.5 * cell_s**2 * chunk_means[before]
    earlier = -0.5 * cell_s**2 * chunk_means[after]
    # cells in which chunks join; a chunk is longer than a cell or else this is taken in turn
    for cell in np.flatnonzero(before != after):
        for chunk in range(before[cell], after[cell]):
            jump = chunk_means[chunk + 1] - chunk_means[chunk]
            place = places.chunk_ends_s[chunk] - places.edges_s[cell]
            later[cell] += 0.5 * jump * (cell_s - place) ** 2
            earlier[cell] += 0.5 * jump * place**2
    return later, earlier


def band_spectrum(cells: FloatArray, oversampling: int) -> NDArray[np.complex128]:
    """Return the spectrum of triangle means as far as a recording with fewer samples carries it.

    Parameters
    ----------
    cells : ndarray, shape (rows, samples * oversampling)
        Means with triangular weights about the beginnings of cells, real; taken as one period.
    oversampling : int
        Cells per sample of the recording.

    Returns
    -------
    ndarray of complex, shape (rows, samples // 2 + 1)
        Such that the inverse real transform gives the recording's samples, at the beginnings of
        the cells 0, oversampling, 2 oversampling ...
    """
    count = cells.shape[-1]
    kept = count // oversampling // 2 + 1
    frequency = np.arange(kept) / count
    # triangular weights roll off as sinc^2
    correction = _low_pass(frequency * oversampling) / np.sinc(frequency) ** 2 / oversampling
    return np.stack([np.fft.rfft(row)[:kept] * correction for row in cells])


def _low_pass(share: FloatArray) -> FloatArray:
    """Response of the anti-aliasing filter at shares of the sampling rate."""
    fall = np.clip((share - FLAT_SHARE) / (0.5 - FLAT_SHARE), 0.0, 1.0)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * fall))


def fade_ends(rows: FloatArray, flank: int) -> None:
    """Let all rows begin and end in cosine flanks of `flank` samples, in place."""
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(flank) + 0.5) / flank)
    rows[:, :flank] *= rise
    rows[:, -flank:] *= rise[::-1]
