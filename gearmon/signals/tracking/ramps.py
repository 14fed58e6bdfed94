"""Speed that changes: a comb followed through short blocks, then unwarped and followed again.

Short blocks hold a rising speed still enough for lines to show; the best path through them is found
by dynamic programming over log frequency, a quarter about the nominal speed wide. Read at equal
steps of that path's angle the lines are nearly steady, so that the comb and then the phases of the
mesh lines tell the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import check_positive, check_range
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders.nonuniform_fft import quick_spreading
from gearmon.signals.orders.resampling import AngleGrid
from gearmon.signals.orders.sums import OrderSums
from gearmon.signals.spectra.spectrum import hann
from gearmon.signals.threads import side_by_side
from gearmon.signals.tracking.comb import (
    Comb,
    SpeedTrack,
    best_path,
    line_quality,
    peak_refined,
    scan_speed,
    weighted_sum,
)
from gearmon.signals.tracking.phases import integrate_speed, lock_track
from gearmon.signals.transforms import fast_length

FloatArray = NDArray[np.float64]

# Blocks of the first search [turns at the nominal speed].
_BLOCK_TURNS = 8.0
# Fastest relative change of the speed that is followed [1/s].
_SLOPE_PER_S = 0.12
# Searches in the angle of the track so far: block [turns], reach about it.
_UNWARPED = ((10.0, 0.015), (10.0, 0.008))
_MAX_CANDIDATES = 4000


@dataclass(frozen=True, kw_only=True)
class SpeedPath:
    """A path of speeds through a recording.

    Parameters
    ----------
    speed : SpeedTrack
        The speed, block by block.
    score : float
        Mean over the blocks of the comb's weighted log(1 + signal-to-noise ratio).
    """

    speed: SpeedTrack
    score: float


def find_path(
    samples: FloatArray,
    sampling_rate_hz: float,
    comb: Comb,
    nominal_hz: float,
    reach: float = 0.25,
) -> SpeedPath:
    """Follow a comb whose speed may change, in short blocks and far about the nominal speed.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration; a channel's scale does not matter.
    sampling_rate_hz : float
        Sampling rate [Hz].
    comb : Comb
        Orders and weights; those above half the sampling rate are left out.
    nominal_hz : float
        Where to look [Hz], > 0.
    reach : float
        How far from nominal to look, as a fraction, in (0, 0.5].

    Returns
    -------
    SpeedPath
        The best path: the largest sum of scores, the speed changing by at most 12 % a second.

    Raises
    ------
    ArgumentError
        If the nominal speed or the reach is out of range.

    Notes
    -----
    Half-overlapped Hann blocks of eight turns, zero padded to twice their length; candidates half a
    bin apart at the comb's highest order, evenly in log frequency. A ramp of 2 % a second smears
    the lines of a block by 0.6 % of their frequency: the low harmonics still tell it, and
    `follow_speed` unwarps the rest.
    """
    check_positive("nominal_hz", nominal_hz, "Hz")
    check_range("reach", reach, 1e-6, 0.5)
    used = comb.below(0.49 * sampling_rate_hz / nominal_hz)
    count = samples.shape[-1]
    block = int(min(count, max(16.0, round(_BLOCK_TURNS / nominal_hz * sampling_rate_hz))))
    hop = max(block // 2, 1)
    length = fast_length(2 * block)
    bins = length // 2 + 1
    bin_hz = sampling_rate_hz / length
    top_hz = float(used.orders.max()) * nominal_hz
    half = int(np.clip(np.ceil(np.log1p(reach) / (0.5 * bin_hz / top_hz)), 2, _MAX_CANDIDATES // 2))
    step = np.log1p(reach) / half
    ratio = np.exp(step * np.arange(-half, half + 1))
    place = np.rint(np.outer(used.orders, ratio) * (nominal_hz / bin_hz))
    nearest = np.minimum(place, bins).astype(np.intp)
    starts = np.arange(0, count - block + 1, hop)
    if len(starts) > 3 and starts[-1] != count - block:
        starts = np.append(starts, count - block)  # takes the recording to its end
    window = hann(block)
    scores = np.empty((len(starts), len(ratio)))
    total = len(starts) * samples.shape[0] * length

    def score(row: int) -> None:
        part = samples[:, starts[row] : starts[row] + block]
        quality = line_quality(part, window, length, bins, total)
        # the last one stands for what lies beyond the band: nothing
        scores[row] = weighted_sum(np.append(quality, 0.0), nearest, used.weights)

    side_by_side(score, range(len(starts)), total)
    path = best_path(scores, max(1, round(_SLOPE_PER_S * hop / sampling_rate_hz / step)))
    speed = SpeedTrack(
        time_s=(starts + block / 2) / sampling_rate_hz,
        speed_hz=nominal_hz * peak_refined(scores, path, ratio),
        resolution_hz=bin_hz / float(used.orders.max()),
    )
    return SpeedPath(speed=speed, score=float(scores[np.arange(len(path)), path].mean()))


def unwarp(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    comb: Comb,
    block_turns: float,
    tolerance: float,
) -> AngleTrack:
    """Follow a comb again in the angle of a first track, where its lines are nearly steady.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        The first track.
    comb : Comb
        Orders and weights.
    block_turns : float
        Length of the blocks [turns].
    tolerance : float
        How far about the first track's speed to look, as a fraction.

    Returns
    -------
    AngleTrack
        The better track.
    """
    top = 0.45 * sampling_rate_hz / float(track.speed_hz.max())
    grid = AngleGrid.of(samples.shape[-1], sampling_rate_hz, track, 0.0)
    # what spreading takes of an order it takes of the noise there as well
    read = np.empty((samples.shape[0], grid.count))
    per_turn = float(grid.per_turn)
    quick_spreading(samples, sampling_rate_hz, track, per_turn).spread(grid.first_turn, read)
    scan = scan_speed(read, grid.per_turn, comb.below(top), 1.0, tolerance, block_turns)
    inner = integrate_speed(scan.track(), (grid.count - 1) / grid.per_turn)
    ends = track.turns[[0, -1]]
    knots = grid.first_turn + inner.time_s
    kept = knots[(knots > ends[0]) & (knots < ends[1])]
    angle = np.concatenate([ends[:1], kept, ends[1:]])
    return AngleTrack(
        time_s=track.time_at(angle),
        turns=inner.turns_at(angle - grid.first_turn),
        method="comb",
        uncertainty_turns=float("nan"),
    )


def follow_speed(
    samples: FloatArray,
    sampling_rate_hz: float,
    comb: Comb,
    orders: FloatArray,
    path: SpeedTrack,
) -> AngleTrack:
    """Turn a path of speeds into an angle track that is right to a small part of a mesh period.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    sampling_rate_hz : float
        Sampling rate [Hz].
    comb : Comb
        Orders and weights.
    orders : ndarray of float, shape (lines,)
        Mesh harmonics, whose phases are followed; those beyond the band are left out.
    path : SpeedTrack
        The path, from `find_path`.

    Returns
    -------
    AngleTrack
        The track; the path itself if no mesh harmonic lies within the band.
    """
    track = integrate_speed(path, (samples.shape[-1] - 1) / sampling_rate_hz)
    for block_turns, tolerance in _UNWARPED:
        track = unwarp(samples, sampling_rate_hz, track, comb, block_turns, tolerance)
    within = orders[orders < 0.45 * sampling_rate_hz / float(track.speed_hz.max())]
    if len(within) == 0:
        return track
    return lock_track(OrderSums(samples, sampling_rate_hz, within), track)
