"""Angle of shaft 1 from the phases of known order lines.

The comb gives the speed to a fraction of a spectral line; the phases of the lines give it a hundred
times finer (`lock_track`). Each line votes with the weight of its clarity, a smoothness prior
carries the track through blocks where no line is clear. Phases that are compared from block to
block would add up like a random walk; those compared with the line's own slowly varying mean do
not. The blocks slide by a quarter of their length and are cut at the ends of the recording.

A speed that changes is followed in short blocks first (`comb.find_path`). Read at equal steps of
that path's angle the lines are nearly steady (`unwarp`), so that the comb and then the phases of
the mesh lines tell the rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.signals.angle import AngleTrack, phasors
from gearmon.signals.orders.lines import OrderSums, SlidingLines
from gearmon.signals.orders.resampling import AngleGrid, Spreading
from gearmon.signals.tracking.comb import Comb, SpeedScan, SpeedTrack, scan_speed

# Thresholds divide what `test_phases` and `test_speed_tracking` hold apart: simulated gears whose
# speed wanders, jumps and ramps, in noise.
#: Hann blocks a quarter of their length apart that are worth an independent one in a mean: 1 + 2
#: (0.659 + 0.167 + 0.008), by the correlations of such blocks (Harris 1978).
QUARTER_HOP = 2.7
#: Phase noise that modulation and interference leave on even the clearest line, against its own
#: slow mean [cycles].
FLOOR_CYCLES = 0.005
# Power over noise from which the phase of a line counts; a vote for the angle further than this
# from the consensus has slipped [cycles].
_CLEAR_POWER, _SLIPPED_CYCLES = 6.0, 0.25
# Restlessness of a speed that is locked to lines: standard deviation of its relative change in one
# second; relative distance of speeds at which a line has a mean of its own: the path turns it
# between.
_WANDER, _SPEED_CLASS = 0.02, 0.04
# Samples up to which a recording is held in its angle: 16 MB. Longer ones are spread block by
# block, twice where blocks overlap: memory stays flat.
_HELD = 1 << 21
# Blocks that tell whether lines are phase-coherent [turns].
_BLOCK_TURNS = 5.0
# Half the width of a line read through a Hann window, over one by its length.
_PARTED = 2.0
# Length of the blocks: enough to part mesh lines from the sidebands of shaft 1 [turns].
_LOCK_TURNS = 4.0
# Readings of the recording.
_PASSES = 2
# Solutions a reading: up to which share of the highest order lines are listened to.
_LIMITS = (0.4, 0.7, 1.0, 1.0, 1.0)
# Phases of noise scatter evenly over a cycle, variance 1/12; a line near that is not listened to.
_NOISE_VARIANCE = 1.0 / 12.0
# Blocks in which the comb is searched in the angle of a track [turns], and how often it is.
_UNWARP_TURNS, _UNWARPED = 10.0, 2
# Share of the lines that is phase-coherent above which nothing is left to gain by that.
_ALL_COHERENT = 0.93


def integrate_speed(speed: SpeedTrack, duration_s: float) -> AngleTrack:
    """Turn a speed track into an angle track that starts at angle zero.

    Parameters
    ----------
    speed : SpeedTrack
        Speed at the centres of blocks.
    duration_s : float
        Duration of the recording [s].

    Returns
    -------
    AngleTrack
        Knots at least as dense as the blocks, from 0 to `duration_s`.
    """
    time = np.linspace(0.0, duration_s, 2 * len(speed.time_s) + 1)
    middle = speed.at(0.5 * (time[1:] + time[:-1]))
    turns = np.concatenate([[0.0], np.cumsum(middle * np.diff(time))])
    return AngleTrack(time_s=time, turns=turns, method="comb", uncertainty_turns=float("nan"))


def coherent_share(sums: OrderSums, track: AngleTrack) -> float:
    """Share of the power of order lines that is phase-coherent in angle: 1 for a perfect track.

    Parameters
    ----------
    sums : OrderSums
        Lines of the recording: mesh harmonics.
    track : AngleTrack
        The track to be judged.

    Returns
    -------
    float
        Mean over the lines above the noise of |mean A|^2 / mean |A|^2, both less the share of
        noise, in [0, 1]; 0 if there is none. Of lines that the blocks do not part, such as those
        beside a planetary mesh that are a turn of the carrier apart, the loudest counts alone:
        what leaks of it to the others turns with the block.
    """
    lines = sums.sliding(track, _BLOCK_TURNS)
    noise = sums.noise(track, _BLOCK_TURNS)
    amplitude = lines.amplitude.reshape(-1, *noise.shape)
    power = np.mean(np.abs(amplitude) ** 2, axis=0)
    turns = min(_BLOCK_TURNS, 0.25 * float(track.turns[-1] - track.turns[0]))
    blended = np.abs(sums.orders[:, None] - sums.orders) < _PARTED / turns
    loudest = np.max(np.where(blended, power[:, None, :], 0.0), axis=2)
    clear = (power > _CLEAR_POWER * noise) & (power >= loudest)
    if not clear.any():
        return 0.0
    still = np.abs(amplitude.mean(axis=0)) ** 2 - noise * QUARTER_HOP / len(amplitude)
    share = still[clear] / (power - noise)[clear]
    return float(np.clip(share, 0.0, 1.0).mean())


def roughness(x: FloatArray, order: int) -> FloatArray:
    """Lower diagonals of the squared difference quotients of first or second order.

    Parameters
    ----------
    x : ndarray of float, shape (n,)
        Ascending places; their mean step is the unit.
    order : int
        1 or 2.

    Returns
    -------
    ndarray of float, shape (order + 1, n)
        As `scipy.linalg.solveh_banded` takes them.
    """
    if len(x) <= order:
        return np.zeros((order + 1, len(x)))
    step = np.diff(x) / np.mean(np.diff(x))
    if order == 1:
        rows, over = np.stack([-1 / step, 1 / step]), step
    else:
        over = 0.5 * (step[1:] + step[:-1])
        rows = np.stack([1 / step[:-1], -1 / step[:-1] - 1 / step[1:], 1 / step[1:]]) / over
    band = np.zeros((order + 1, len(x)))
    for low in range(order + 1):
        for high in range(low, order + 1):
            band[high - low, low : low + rows.shape[1]] += over * rows[low] * rows[high]
    return band


def lock_track(sums: OrderSums, track: AngleTrack) -> AngleTrack:
    """Lock an angle track to the phases of order lines, right to the ends of the recording.

    Parameters
    ----------
    sums : OrderSums
        Lines of the recording at the orders to follow: mesh harmonics.
    track : AngleTrack
        A track whose speed is right to about 0.2 over the highest order.

    Returns
    -------
    AngleTrack
        The track; unchanged but for an infinite uncertainty if no line is clear.

    Notes
    -----
    With y_lj the amplitude of line l in block j and e_j the angle error sought, the departures
    arg(y_lj exp(-2 pi i o_l e_j) conj m_lj) / (2 pi o_l) from the line's mean m_lj (Gaussian window
    of 40 turns) vote with o_l^2 over the variance of the line's own phase, and
    sum w (e - vote)^2 + sum (second difference of e)^2 / q is minimised. A path whose delay changes
    with speed turns all lines alike and cannot be told from rotation: the angle is that of the
    vibration at the sensor. The uncertainty joins what the lines disagree about from block to block
    with the slow drift of their means against each other, of which a change in the path's delay is
    of the same size.
    """
    for _ in range(_PASSES):
        track = _locked(track, sums.sliding(track, _LOCK_TURNS))
    return track


def _unwound(lines: SlidingLines) -> FloatArray:
    """Angle error from the phase advance of the lines from block to block [turns].

    Blocks are a turn apart: a line of order o slips only if the speed is wrong by more than
    0.5 / o. The order of a line weighs as in `lock_track`, its phases' variance is that of its
    second differences: what the speed does not explain.
    """
    product = lines.amplitude[1:] * np.conj(lines.amplitude[:-1])
    advance = np.angle(product) / (2 * np.pi)
    jump = np.angle(product[1:] * np.conj(product[:-1])) / (2 * np.pi)
    variance = np.mean(jump**2, axis=0) / 6 + FLOOR_CYCLES**2
    weight = np.where(variance < _NOISE_VARIANCE / 6, lines.orders**2 / variance, 0.0)
    total = float(weight.sum())
    if total <= 0:
        return np.zeros(len(lines.angle))
    increment = _median(advance / lines.orders, weight)
    for _ in range(3):
        rest = advance - increment[:, None] * lines.orders
        votes = weight * (np.abs(rest) < _SLIPPED_CYCLES)
        mass = votes.sum(axis=1)
        mean = (votes * rest / lines.orders).sum(axis=1) / np.maximum(mass, 1e-300)
        increment = increment + np.where(mass > 0, mean, 0.0)
    return np.asarray(np.concatenate([[0.0], np.cumsum(increment)]))


def _median(rows: FloatArray, weight: FloatArray) -> FloatArray:
    """Weighted median along each row."""
    place = np.argsort(rows, axis=1)
    mass = np.cumsum(weight[place], axis=1)
    middle = np.argmax(mass >= 0.5 * mass[:, -1:], axis=1)
    return np.asarray(np.take_along_axis(rows, place, axis=1)[np.arange(len(rows)), middle])


def _locked(track: AngleTrack, lines: SlidingLines) -> AngleTrack:
    """Solve for the angle error of a track and take it away."""
    from scipy.interpolate import make_interp_spline
    from scipy.linalg import solveh_banded

    hop_turns = float(np.median(np.diff(lines.angle)))
    hop_s = hop_turns / float(np.mean(track.speed_hz))
    step = _WANDER * np.sqrt(hop_s) * hop_turns
    low = 1.01 * float(lines.orders.min())
    error = _unwound(lines)
    hats = _speed_classes(track, lines.angle)
    mass = np.maximum(hats.sum(axis=0), 1e-12)[:, None]
    rough = roughness(np.arange(float(len(error))), 2) / step**2
    for share in _LIMITS:
        near = lines.orders <= max(share * float(lines.orders.max()), low)
        order = lines.orders[near]
        turned = lines.amplitude[:, near] * phasors(np.outer(-error, order))
        # of each line as a function of the speed, linear between classes of speed
        mean = hats @ ((hats.T @ turned) / mass)
        rest = np.angle(turned * np.conj(mean)) / (2 * np.pi)
        variance = np.mean(rest**2, axis=0) + FLOOR_CYCLES**2
        clear = variance < 0.5 * _NOISE_VARIANCE
        weight = np.where(
            clear & (np.abs(rest) < _SLIPPED_CYCLES), order**2 / (variance * QUARTER_HOP), 0.0
        )
        total = weight.sum(axis=1)
        departure = rest / order
        vote = error + (weight * departure).sum(axis=1) / np.maximum(total, 1e-300)
        # a weak pull to no error settles what no line tells
        band = rough.copy()
        band[0] += total + 1e-6 / step**2
        error = solveh_banded(band, total * vote, lower=True)
    if not clear.any():
        return replace(track, uncertainty_turns=np.inf, indexed=False)
    quick = float(np.mean(((weight * departure) ** 2).sum(axis=1)) / np.mean(total) ** 2)
    drift = np.unwrap(np.angle(mean[:, clear]), axis=0) / (2 * np.pi * order[clear])
    slow = float(np.average(np.var(drift, axis=0), weights=(order**2 / variance)[clear]))
    # straight from block to block, and on with the slopes at the ends
    shift = make_interp_spline(lines.angle, error, k=min(1, len(error) - 1))
    return track.moved(
        lines.angle, lambda turns: turns + shift(turns), float(np.sqrt(quick + slow))
    )


def _speed_classes(track: AngleTrack, angle: FloatArray) -> FloatArray:
    """Weights of the blocks in overlapping classes of speed, shape (blocks, classes)."""
    time = track.time_at(angle)
    speed = np.gradient(angle, time)
    place = np.log(speed / speed.min()) / _SPEED_CLASS
    count = max(1, round(float(place.max())))
    if count == 1:
        return np.ones((len(place), 1))
    place *= count / float(place.max())
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(count + 1))))


def scan_angle(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    comb: Comb,
    reach: float,
    block_turns: float,
) -> tuple[SpeedScan, AngleGrid]:
    """Try all speeds about a track in its angle, where lines stand still however the speed changes.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        The track.
    comb : Comb
        Orders and weights.
    reach : float
        How far about the track's speed to look, as a fraction.
    block_turns : float
        Length of a block [turns].

    Returns
    -------
    scan : SpeedScan
        With turns for seconds: speeds are multiples of the track's.
    grid : AngleGrid
        Steps of angle that it was made in.
    """
    top = 0.45 * sampling_rate_hz / float(track.speed_hz.max())
    # what spreading takes of an order it takes of the noise there as well
    read = Spreading.of(samples, sampling_rate_hz, track)
    if samples.size <= _HELD:
        read = read.holding()
    scan = scan_speed(read, read.grid.per_turn, comb.below(top), 1.0, reach, block_turns)
    return scan, read.grid


def unwarp(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    comb: Comb,
    reach: float = 0.015,
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
    reach : float
        How far about the first track's speed to look, as a fraction.

    Returns
    -------
    AngleTrack
        The better track, from blocks of 10 turns.
    """
    scan, grid = scan_angle(samples, sampling_rate_hz, track, comb, reach, _UNWARP_TURNS)
    inner = integrate_speed(scan.track(), (grid.count - 1) / grid.per_turn)
    first = grid.first_turn
    return track.moved(first + inner.time_s, lambda turns: inner.turns_at(turns - first), np.nan)


def follow_lines(sums: OrderSums, track: AngleTrack, comb: Comb) -> tuple[AngleTrack, float]:
    """Make a track right to a small part of a mesh period.

    It is locked to the lines; where they are not phase-coherent then, the comb is followed in the
    angle of the track first.

    Parameters
    ----------
    sums : OrderSums
        Mesh harmonics of a recording, whose phases are followed.
    track : AngleTrack
        A first track, its speed right to about a per cent.
    comb : Comb
        Orders and weights.

    Returns
    -------
    track : AngleTrack
        The track in which most of the lines is coherent.
    share : float
        That share, see `coherent_share`.
    """
    best = lock_track(sums, track)
    share = coherent_share(sums, best)
    for _ in range(_UNWARPED):
        if share > _ALL_COHERENT:
            break
        track = unwarp(sums.samples, sums.sampling_rate_hz, track, comb)
        locked = lock_track(sums, track)
        its = coherent_share(sums, locked)
        if its > share:
            best, share = locked, its
    return best, share
