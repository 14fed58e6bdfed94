"""Speed from a comb: the rotation that puts known orders onto the lines of a spectrum.

A gearbox without a tachometer still tells its speed, because its lines stand at known multiples of
it. For every block of the recording each candidate speed collects the log signal-to-noise ratios at
all its orders; the best path of speeds through the blocks is found by dynamic programming.
Logarithms keep one loud line of another origin from deciding alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.sparse import csr_array

from gearmon.arrays import FloatArray, IntArray
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.signals.orders.resampling import InAngle
from gearmon.signals.spectra import fast_length, local_floor, window, window_powers
from gearmon.threads import side_by_side

# Most candidates of a scan, and of a path, whose search takes the longer the more blocks there are.
_MAX_CANDIDATES, _PATH_CANDIDATES = 6000, 4000
# Fastest relative change of the speed that is followed [1/s], of a steady machine and of any: a
# simulated engine that hunts by 3 % within 0.5 to 20 s reaches 19 % a second.
_STEADY_SLOPE, _PATH_SLOPE = 0.02, 0.3
# Blocks from which on they do not overlap: a long recording has enough of them.
_MANY_BLOCKS = 400
# Moves to either side that a path may choose among, and the most candidates from one to the next.
_MOVES, _SPACING = 24, 12
# Spectra kept for judging whether a mesh is there; more would only take memory.
_KEPT_BLOCKS = 80
# Samples whose blocks are looked at together: the scans of 500 s take 1.5 s with 2^16, 1.3 s with
# 2^17 and more, of which short recordings would have too few for all cores.
_TOGETHER = 1 << 17
# Lines of two combs are the same if they are nearer than this share of their frequency.
_SAME_LINE = 1e-3


@dataclass(frozen=True, kw_only=True)
class Comb:
    """Orders that a rotation is known by.

    Parameters
    ----------
    orders : ndarray of float, shape (lines,)
        Multiples of the rotation frequency, > 0.
    weights : ndarray of float, shape (lines,)
        Weight of each order's log signal-to-noise ratio, >= 0.

    Raises
    ------
    ArgumentError
        If the comb is empty, or an order is not > 0.
    """

    orders: FloatArray
    weights: FloatArray

    def __post_init__(self) -> None:
        """Check the comb."""
        if len(self.orders) == 0 or len(self.orders) != len(self.weights):
            raise ArgumentError(f"a comb needs orders, one weight each; got {len(self.orders)}")
        if np.min(self.orders) <= 0 or np.min(self.weights) < 0:
            raise ArgumentError("a comb's orders must be > 0 and its weights >= 0")

    def below(self, order: float) -> Comb:
        """Return the part of the comb below `order`; at least its lowest line."""
        keep = self.orders <= max(order, float(self.orders.min()))
        return Comb(orders=self.orders[keep], weights=self.weights[keep])


@dataclass(frozen=True, kw_only=True)
class SpeedTrack:
    """Rotation frequency over time.

    Parameters
    ----------
    time_s : ndarray of float, shape (blocks,)
        Centres of the blocks [s].
    speed_hz : ndarray of float, shape (blocks,)
        Rotation frequency of shaft 1 [Hz].
    """

    time_s: FloatArray
    speed_hz: FloatArray

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the speed [Hz] at the given times, linear between blocks, constant outside."""
        return np.interp(time_s, self.time_s, self.speed_hz)

    @property
    def mean_hz(self) -> float:
        """Mean speed [Hz] over the blocks."""
        return float(np.mean(self.speed_hz))


class SpeedScan:
    """How well every candidate speed suits every block of a recording.

    Parameters
    ----------
    samples : ndarray of float or InAngle, shape (channels, n)
        Vibration; a channel's scale does not matter. What is spread is made block by block.
    sampling_rate_hz : float
        Sampling rate [Hz].
    comb : Comb
        Orders and weights; those above half the sampling rate are left out, and count nothing
        where they leave the band at the speed of a block.
    nominal_hz : float
        Where to look [Hz], > 0.
    tolerance : float
        How far from nominal to look, as a fraction, in (0, 0.3]; in (0, 0.5] of a changing speed.
    block_s : float
        Duration of a Hann block [s], cut to the recording. Blocks overlap by half, but for those
        of a recording that holds more than 400 so: they stand end to end.
    changing : bool
        Whether the speed may change fast: candidates are then evenly spaced in their logarithm, a
        path may move far from block to block, and all blocks overlap.

    Attributes
    ----------
    centre_s : ndarray of float, shape (blocks,)
        Centres of the blocks [s].
    scores : ndarray of float, shape (blocks, candidates)
        Weighted sum of log(1 + signal-to-noise ratio) over the comb's lines.
    bin_hz : float
        Spacing of the spectral bins [Hz]; half a line width because of zero padding.
    resolution_hz : float
        What the comb's highest line can tell apart [Hz].
    kept : ndarray of int, shape (kept,)
        Blocks whose spectra were kept, no two of them overlapping.
    quality : ndarray of float, shape (kept, bins)
        Their log(1 + signal-to-noise ratio), mean over channels.
    stride : int
        Blocks from one to the next that does not overlap it.

    Raises
    ------
    ArgumentError
        If the nominal speed, the tolerance or the block is out of range.
    """

    def __init__(
        self,
        samples: FloatArray | InAngle,
        sampling_rate_hz: float,
        comb: Comb,
        nominal_hz: float,
        tolerance: float = 0.03,
        block_s: float = 1.0,
        *,
        changing: bool = False,
    ) -> None:
        check_positive("nominal_hz", nominal_hz, "Hz")
        check_range("tolerance", tolerance, 1e-6, 0.5 if changing else 0.3)
        check_positive("block_s", block_s, "s")
        rate, (channels, total) = sampling_rate_hz, samples.shape
        size = int(min(total, max(16.0, round(block_s * rate))))
        hop = max(size // 2, 1)
        overlapped = changing or (total - size) // hop < _MANY_BLOCKS
        starts = np.arange(0, total - size + 1, hop if overlapped else size)
        # the last block takes the recording to its end
        starts = starts if len(starts) <= 3 else np.union1d(starts, [total - size])
        # a line is then two bins wide
        length, count = fast_length(2 * size), len(starts)
        self.centre_s, self.bin_hz = (starts + np.float64(size / 2)) / rate, rate / length
        used = comb.below(0.49 * rate / (nominal_hz * (1.0 if changing else 1 + tolerance)))
        self.nominal_hz, top = nominal_hz, float(used.orders.max())
        self.resolution_hz = self.bin_hz / top
        self.ratio, spacing = _candidates(tolerance, self.resolution_hz / nominal_hz, changing)
        self.reach = max(1, round(_PATH_SLOPE * hop / rate / spacing)) if changing else None
        # some more than the highest line may reach, for the noise about it
        highest = 1.1 * top * nominal_hz * float(self.ratio.max())
        bins = min(length // 2 + 1, int(np.ceil(highest / self.bin_hz) + 64))
        # of blocks that do not overlap, every other one or fewer is kept
        self.stride = min(2 if overlapped else 1, count)
        step = 2 * self.stride * max(1, -(-count // _KEPT_BLOCKS) // (2 * self.stride))
        self.kept = np.arange(self.stride if count >= 4 else 0, count, step)
        self.scores = np.empty((count, len(self.ratio)))
        places = nominal_hz / self.bin_hz * np.outer(self.ratio, used.orders)
        picked = _picking(places, used.weights, bins)
        together = max(1, _TOGETHER // size)

        def scan_blocks(first: int) -> NDArray[np.float32]:
            """Set the scores of some blocks; what they share is spread once."""
            own = starts[first : first + together]
            cut = samples[:, own[0] : own[-1] + size]
            blocks = sliding_window_view(cut, size, axis=-1)[:, own - own[0]]
            quality = line_quality(blocks, length, bins)
            self.scores[first : first + together] = (picked @ quality.T).T
            return quality[np.isin(first + np.arange(len(own)), self.kept)].astype(np.float32)

        work = count * channels * length
        self.quality = np.concatenate(side_by_side(scan_blocks, range(0, count, together), work))

    def track(self, blocks: IntArray | None = None) -> SpeedTrack:
        """Return the best path of speeds through the blocks (all of them by default)."""
        rows = np.arange(len(self.centre_s)) if blocks is None else blocks
        scores = self.scores[rows]
        path = self._path if blocks is None else best_path(scores, self._reach(rows))
        speed_hz = self.nominal_hz * peak_refined(scores, path, self.ratio)
        return SpeedTrack(time_s=self.centre_s[rows], speed_hz=speed_hz)

    def elsewhere(self, apart: float) -> SpeedTrack:
        """Return the best path that keeps so far from the best of all, as a share of its speed."""
        away = np.abs(self.ratio / self.ratio[self._path][:, None] - 1)
        scores = np.where(away > apart, self.scores, self.scores.min())
        path = best_path(scores, self._reach(np.arange(len(scores))))
        speed_hz = self.nominal_hz * peak_refined(self.scores, path, self.ratio)
        return SpeedTrack(time_s=self.centre_s, speed_hz=speed_hz)

    @property
    def best_score(self) -> float:
        """Mean score of the best path: compares one nominal speed with another."""
        return float(self.scores[np.arange(len(self.centre_s)), self._path].mean())

    def _unshared(self, comb: Comb, other: SpeedScan, theirs: Comb) -> float:
        """Weighted sum of the quality of a comb's lines that another comb does not have."""
        track = self.track()
        place, theirs_hz = comb.orders * track.mean_hz, theirs.orders * other.track().mean_hz
        width = 3 * max(self.bin_hz, other.bin_hz) + _SAME_LINE * place
        alone = np.abs(place[:, None] - theirs_hz).min(axis=1) > width
        alone &= place < (self.quality.shape[1] - 1) * self.bin_hz
        speed = track.at(self.centre_s[self.kept])
        bins = np.rint(np.outer(speed, comb.orders[alone]) / self.bin_hz).astype(np.intp)
        quality = np.take_along_axis(self.quality, bins.clip(max=self.quality.shape[1] - 1), axis=1)
        return float(quality.mean(axis=0) @ comb.weights[alone])

    @cached_property
    def _path(self) -> IntArray:
        return best_path(self.scores, self._reach(np.arange(len(self.centre_s))))

    def _reach(self, rows: IntArray) -> int:
        """Candidates that the speed may move by from block to block."""
        if self.reach is not None or len(rows) < 2:
            return self.reach or 0
        interval = float(np.diff(self.centre_s[rows]).mean())
        reach = _STEADY_SLOPE * interval / float(self.ratio[1] - self.ratio[0])
        return int(np.clip(round(reach), 1, len(self.ratio) - 1))


def clearest(scans: Sequence[tuple[SpeedScan, Comb]]) -> int:
    """Return which of several speeds is meant: that of the clearest lines of its own.

    Parameters
    ----------
    scans : sequence of (SpeedScan, Comb)
        Scans of one recording about different speeds, with what was looked for.

    Notes
    -----
    Half the true speed suits every line of the true one. Block by block it suits noise better too,
    as slower turns make longer blocks: told by their best scores, a 17-tooth pinion that may run at
    15.8 and 31.8 Hz was taken for the slower in 8 of 18 recordings of the faster. By the sum of
    log(1 + signal-to-noise ratio) over the lines that only one of the two has, in blocks of 12
    turns of each, none of 12 was, nor one of 12 of the slower for the faster.
    """
    first, *others = sorted(range(len(scans)), key=lambda own: -scans[own][0].best_score)
    for other in others:
        (mine, comb), (best, its) = scans[other], scans[first]
        if mine._unshared(comb, best, its) > best._unshared(its, mine, comb):
            first = other
    return first


def _candidates(tolerance: float, resolution: float, changing: bool) -> tuple[FloatArray, float]:
    """Speeds over the nominal one half a bin apart at the highest order, where nothing can hide.

    Returns them with their spacing; of a changing speed even in the logarithm.
    """
    span = float(np.log1p(tolerance)) if changing else tolerance
    most = _PATH_CANDIDATES if changing else _MAX_CANDIDATES
    half = int(np.clip(np.ceil(span / (0.5 * resolution)), 2, most // 2))
    away = span * np.arange(-half, half + 1) / half
    return np.exp(away) if changing else 1 + away, span / half


def _picking(places: FloatArray, weights: FloatArray, bins: int) -> csr_array:
    """Weights of the bins nearest to the lines of each candidate, none beyond the last one.

    Parameters
    ----------
    places : ndarray of float, shape (candidates, lines)
        Places of the lines [bins].
    weights : ndarray of float, shape (lines,)
    bins : int

    Returns
    -------
    csr_array, shape (candidates, bins)
    """
    nearest = np.rint(places).astype(np.int32).ravel()
    entries = np.tile(weights, len(places)) * (nearest < bins)
    ends = len(weights) * np.arange(len(places) + 1)
    return csr_array((entries, nearest.clip(max=bins - 1), ends), shape=(len(places), bins))


def line_quality(blocks: FloatArray, length: int, bins: int) -> FloatArray:
    """Mean over channels of log(1 + power over its local floor) of blocks.

    Parameters
    ----------
    blocks : ndarray of float, shape (channels, blocks, n)
        The blocks.
    length : int
        Length of the transform, at least n.
    bins : int
        Bins wanted.

    Returns
    -------
    ndarray of float, shape (blocks, bins)
    """
    weights = window("hann", blocks.shape[-1])
    power = window_powers(blocks, weights, length, centred=False)[..., :bins]
    # 24 line widths: more than a group of sidebands, less than a resonance
    power /= local_floor(power, 96)
    return np.asarray(np.log1p(power, out=power).mean(axis=0))


def best_path(scores: FloatArray, reach: int) -> IntArray:
    """Best sequence of candidates, moving at most `reach` a block, large moves penalised (Viterbi).

    The penalty is quadratic and costs one typical score contrast for a move over the whole reach.

    Parameters
    ----------
    scores : ndarray of float, shape (blocks, candidates)
        What each candidate is worth in each block.
    reach : int
        Candidates that the path may move by from block to block.

    Returns
    -------
    ndarray of int, shape (blocks,)
        The candidate in each block.
    """
    blocks, count = scores.shape
    contrast = float(np.mean(scores.max(axis=1) - np.median(scores, axis=1)))
    most = min(reach, max(_MOVES, -(-reach // _SPACING)))
    moves = np.unique(np.round(np.linspace(-reach, reach, 2 * most + 1)).astype(int))
    penalty = contrast * (moves / max(1, reach)) ** 2
    # steps to either side cost the same
    sideways, cost = moves[moves > 0], penalty[moves > 0][:, None]
    totals = np.empty((blocks, count))
    totals[0] = scores[0]
    # a move from beyond an end is one from that end
    before = np.empty(count + 2 * reach)
    moved = np.lib.stride_tricks.sliding_window_view(before, count)
    for block in range(1, blocks):
        last, best = totals[block - 1], totals[block]
        before[:reach], before[reach + count :] = last[0], last[-1]
        before[reach : reach + count] = last
        near = np.maximum(moved[reach - sideways], moved[reach + sideways]) - cost
        np.maximum(last, near.max(axis=0, initial=-np.inf), out=best)
        best += scores[block]
    # where each step of the best path came from is found again: only that path is wanted
    path = np.empty(blocks, dtype=np.int64)
    path[-1] = int(np.argmax(totals[-1]))
    for block in range(blocks - 1, 0, -1):
        sources = np.clip(path[block] - moves, 0, count - 1)
        path[block - 1] = sources[int(np.argmax(totals[block - 1, sources] - penalty))]
    return path


def peak_refined(scores: FloatArray, path: IntArray, speeds: FloatArray) -> FloatArray:
    """Refine each block's speed to the peak of the parabola through three scores.

    Parameters
    ----------
    scores : ndarray of float, shape (blocks, candidates)
        What each candidate is worth in each block.
    path : ndarray of int, shape (blocks,)
        The candidate chosen in each block.
    speeds : ndarray of float, shape (candidates,)
        The candidates, evenly spaced about their neighbours.

    Returns
    -------
    ndarray of float, shape (blocks,)
    """
    middle = np.clip(path, 1, len(speeds) - 2)
    rows = np.arange(len(path))
    left, here, right = (scores[rows, middle + shift] for shift in (-1, 0, 1))
    bend = 2 * here - left - right
    offset = np.divide(0.5 * (right - left), bend, out=np.zeros(len(path)), where=bend > 0)
    spacing = 0.5 * (speeds[middle + 1] - speeds[middle - 1])
    return np.asarray(speeds[middle] + np.clip(offset, -0.5, 0.5) * spacing)
