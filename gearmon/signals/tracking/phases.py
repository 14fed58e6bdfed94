"""Angle of shaft 1 from the phases of known order lines, and where it loses them.

The comb gives the speed to a fraction of a spectral line; the phases of the lines give it a hundred
times finer (`lock_track`). Each line votes with the weight of its clarity, a smoothness prior
carries the track through blocks where no line is clear. Phases that are compared from block to
block would add up like a random walk; those compared with the line's own slowly varying mean do
not. The blocks slide by a quarter of their length and are cut at the ends of the recording.

A speed that changes is followed in short blocks first (`comb.SpeedScan`). Read at equal steps of
that path's angle the lines are nearly steady (`unwarp`), so that the comb and then the phases of
the mesh lines tell the rest.

An angle that is followed by the phases of mesh lines may slip by whole mesh periods where the lines
are faint or another line takes over; afterwards the lines are as coherent as before. But on the way
they do not: against its own mean over the turns about it each line then turns, all of them at once.
Where that shows, lines whose orders are no multiples of one another tell by their phases before and
after by how much the angle has slipped: those of other stages, and those of the shafts.

What no line can tell is a delay that they share. A path that rings turns the lines with the speed:
each by its own delay, and the angle by their mean. That mean is about as large as they differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, uniform_filter1d

from gearmon.arrays import BoolArray, ComplexArray, FloatArray, runs_where
from gearmon.errors import ArgumentError
from gearmon.signals.angle import AngleTrack, phasors
from gearmon.signals.orders.lines import OrderSums, SlidingLines
from gearmon.signals.orders.resampling import InAngle
from gearmon.signals.tracking.comb import Comb, SpeedScan, SpeedTrack, best_path, peak_refined

# Thresholds divide what `test_phases` and `test_speed_tracking` hold apart: simulated gears whose
# speed wanders, jumps and ramps, in noise.
# Hann blocks a quarter of their length apart that are worth an independent one in a mean: 1 + 2
#: (0.659 + 0.167 + 0.008), by the correlations of such blocks (Harris 1978).
_QUARTER_HOP = 2.7
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
# Blocks that tell whether lines are phase-coherent [turns].
_BLOCK_TURNS = 5.0
# Half the width of a line read through a Hann window, over one by its length.
_PARTED = 2.0
# Length of the blocks: enough to part mesh lines from the sidebands of shaft 1 [turns].
_LOCK_TURNS = 4.0
# Readings of the recording.
_PASSES = 2
# Solutions a reading: up to which share of the highest order lines are listened to. Faint low lines
# lead astray, and so does a tone that one of them crosses: where the lines are not coherent after
# it all are heard from the start. Of a drawn machine whose first three mesh harmonics are 0 to 4 dB
# over the noise and the others 18 to 35 the angle was lost in 8 of 9 recordings, and is in none.
_LIMITS, _AT_ONCE = (0.4, 0.7, 1.0, 1.0, 1.0), (1.0, 1.0, 1.0)
# Phases of noise scatter evenly over a cycle, variance 1/12; a line near that is not listened to.
_NOISE_VARIANCE = 1.0 / 12.0
# Blocks in which the comb is searched in the angle of a track [turns, s]. Ten turns of a slow shaft
# last so long that a speed that wanders smears them: the angle of a planetary set at 11 Hz that
# wanders by 1 and 2 % was off by 0.1 to 9 mesh periods in 8 of 8 recordings, and is by 0.01 in 6.
_UNWARP_TURNS, _UNWARP_S = (4.0, 10.0), 0.4
# Blocks in which a speed is followed by phases, one reading after the other [turns]; how far about
# the track's; steps of the speeds tried, as a turn of the highest line from block to block
# [cycles]; and how often lines are weighed anew. Of 184 recordings of 23 trains integrated in time,
# under loads that ripple by 1 to 3 % at 0.1 to 6 Hz, 173 have the right angle (140 where the comb
# was followed in blocks of 0.4 s instead); six of the others are of one that sways by 6 to 9 %.
_FOLLOWED_TURNS, _REACH, _STEP_CYCLES, _WEIGHED = (0.5, 0.5, 1.0, 1.0, 2.0), 0.04, 0.1, 2
# Share that is phase-coherent from which a first lock is followed no further, which takes three
# times as long as locking: one of these recordings lost the angle at 0.86, one that sways at 0.90.
_LOCKED = 0.87
# A line tells the speed if its phases agree with it by more standard deviations than noise does.
_AGREES = 3.0
#: Share of the lines that is phase-coherent above which nothing is left to gain by that.
ALL_COHERENT = 0.93

# Thresholds divide what `test_slips` holds apart: angles with slips of whole mesh periods planted,
# lines that fade, paths that ring.
# Phase scatter of a line that counts [cycles], and the share of its usual strength below which its
# mean is no measure of it.
_CLEAR_CYCLES, _FAINT = 0.12, 0.3
# Coherence below which an angle is lost, and up to which a lost stretch reaches.
_LOST, _SOUND = 1 / 3, 0.6
# Where the coherence is below the first for more than a tenth of the time, the lines fade by
# themselves, as those of real gears do for a turn or two: shorter stretches than the second [turns]
# are then no sign of a slip.
_STEADY_LINES, _FADING_TURNS = 0.75, 5.0
# Lost stretches nearer to one another are one; over longer ones no displacement is looked for, and
# longer ones are not led over [turns].
_APART_TURNS, _LONGEST_TURNS, _MENDABLE_TURNS = 6.0, 200.0, 20.0
# Largest error of the speed while the angle is lost.
_ASTRAY = 0.06
# Group delay of a housing [s] where lines do not tell it: half a cycle for each mode, some two a
# kilohertz, of which the zeros between modes give half back; and the part of its error that does
# not go with the departure of the speed from its mean.
_DELAY_S, _STEADY_DELAY = 5e-4, 0.25
# Lines before and after a lost stretch: over how many turns at most and at least, what the speed
# may turn them by [cycles], and the log likelihood by which one displacement must outdo others.
_BESIDE_TURNS, _LEAST_BESIDE, _TURNED_CYCLES, _TOLD = 40.0, 12.0, 0.05, 5.0
#: Turns of shaft 1 in which slips can show.
LEAST_TURNS = 8.0
# Length of the blocks [turns]: the sidebands of shaft 1 are next to nothing in it.
_CHECKED_TURNS = 2.0
# Turns to either side whose mean a line is compared with, and over which its delay is followed.
_ABOUT_TURNS, _DELAY_TURNS = 30.0, 8.0
# Cycles by which the path turns a line beside the others, at most: half a one for every mode that
# it passes. In two simulated recordings of a gearbox of 1:81 an angle right to 0.008 mesh periods
# was said to be off by 0.17 without it, by 0.007 with it.
_TURNED_BY_PATH = 1.0
# A lost stretch is wider than it shows [turns]. The angle over it is a cubic through some turns to
# either side; of 6, 8, 10 and 20 turns and degrees 3 to 7, 6 and 3 found the displacement over
# 9 turns best: 0.3 mesh periods in nine cases of ten, where the speed wanders by 0.5 %.
_WIDER, _BESIDE, _DEGREE = 3.0, 6.0, 3
_KNOTS = 0.25  # distance of the knots over it
# How often the comb is looked for in the angle of a track that is lost here and there.
_AGAIN = 3


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
    clear = (power > _CLEAR_POWER * noise) & _loudest(sums.orders, power, lines.hop)
    if not clear.any():
        return 0.0
    still = np.abs(amplitude.mean(axis=0)) ** 2 - noise * _QUARTER_HOP / len(amplitude)
    return float(np.clip(still[clear] / (power - noise)[clear], 0.0, 1.0).mean())


def _loudest(orders: FloatArray, power: FloatArray, hop: float) -> BoolArray:
    """Whether each line is the loudest of those that blocks, four hops long, do not part."""
    blended = np.abs(orders[:, None] - orders) < 0.25 * _PARTED / hop
    return np.asarray(power >= np.max(np.where(blended, power[:, None, :], 0.0), axis=2))


def roughness(x: FloatArray, order: int) -> FloatArray:
    """Lower diagonals of the squared difference quotients of first or second order.

    Parameters
    ----------
    x : ndarray of float, shape (n,), n > order
        Ascending places; their mean step is the unit.
    order : int
        1 or 2.

    Returns
    -------
    ndarray of float, shape (order + 1, n)
        As `scipy.linalg.solveh_banded` takes them.
    """
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


def lock_track(sums: OrderSums, track: AngleTrack) -> tuple[AngleTrack, float]:
    """Lock an angle track to the phases of order lines, right to the ends of the recording.

    Parameters
    ----------
    sums : OrderSums
        Lines of the recording at the orders to follow: mesh harmonics.
    track : AngleTrack
        A track whose speed is right to about 0.2 over the highest order.

    Returns
    -------
    track : AngleTrack
        The track; unchanged but for an infinite uncertainty if no line is clear.
    share : float
        Share of the lines' power that is phase-coherent in it, see `coherent_share`.

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
    found = []
    for limits in (_LIMITS, _AT_ONCE):
        locked = track
        for _ in range(_PASSES):
            locked = _locked(locked, sums.sliding(locked, _LOCK_TURNS), limits)
        found.append((locked, coherent_share(sums, locked)))
        if found[-1][1] > ALL_COHERENT:
            break
    return max(found, key=lambda own: own[1])


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
    told = advance / lines.orders
    # of each block the weighted median
    order = np.argsort(told, axis=1)
    half = np.argmax(np.cumsum(weight[order], axis=1) >= 0.5 * total, axis=1)
    increment = told[np.arange(len(told)), order[np.arange(len(told)), half]]
    for _ in range(3):
        rest = advance - increment[:, None] * lines.orders
        votes = weight * (np.abs(rest) < _SLIPPED_CYCLES)
        mass = np.maximum(votes.sum(axis=1), 1e-300)
        increment = increment + (votes * rest / lines.orders).sum(axis=1) / mass
    return np.asarray(np.concatenate([[0.0], np.cumsum(increment)]))


def _locked(track: AngleTrack, lines: SlidingLines, limits: Sequence[float]) -> AngleTrack:
    """Solve for the angle error of a track and take it away."""
    from scipy.linalg import solveh_banded

    hop_s = lines.hop / float(np.mean(track.speed_hz))
    step = _WANDER * np.sqrt(hop_s) * lines.hop
    low = 1.01 * float(lines.orders.min())
    error = _unwound(lines)
    hats = _speed_classes(track, lines.angle)
    mass = np.maximum(hats.sum(axis=0), 1e-12)[:, None]
    rough = roughness(np.arange(float(len(error))), 2) / step**2
    for share in limits:
        near = lines.orders <= max(share * float(lines.orders.max()), low)
        order = lines.orders[near]
        turned = lines.amplitude[:, near] * phasors(np.outer(-error, order))
        # of each line as a function of the speed, linear between classes of speed
        mean = hats @ ((hats.T @ turned) / mass)
        rest = np.angle(turned * np.conj(mean)) / (2 * np.pi)
        variance = np.mean(rest**2, axis=0) + FLOOR_CYCLES**2
        clear = variance < 0.5 * _NOISE_VARIANCE
        believed = clear & (np.abs(rest) < _SLIPPED_CYCLES)
        weight = np.where(believed, order**2 / (variance * _QUARTER_HOP), 0.0)
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
    return track.moved(lines.angle, error, float(np.sqrt(quick + slow)))


def _speed_classes(track: AngleTrack, angle: FloatArray) -> FloatArray:
    """Weights of the blocks in overlapping classes of speed, shape (blocks, classes)."""
    speed = np.gradient(angle, track.time_at(angle))
    place = np.log(speed / speed.min()) / _SPEED_CLASS
    count = max(1, round(float(place.max())))
    if count == 1:
        return np.ones((len(place), 1))
    place *= count / float(place.max())
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(count + 1))))


def scan_angle(vibration: InAngle, comb: Comb, reach: float, block_turns: float) -> SpeedScan:
    """Try all speeds about a track in its angle, where lines stand still however the speed changes.

    Parameters
    ----------
    vibration : InAngle
        In the angle of the track; what spreading takes of an order it takes of the noise there too.
    comb : Comb
        Orders and weights.
    reach : float
        How far about the track's speed to look, as a fraction.
    block_turns : float
        Length of a block [turns].

    Returns
    -------
    SpeedScan
        With turns for seconds: speeds are multiples of the track's.
    """
    top = 0.45 * vibration.sampling_rate_hz / float(vibration.track.speed_hz.max())
    return SpeedScan(vibration, vibration.grid.per_turn, comb.below(top), 1.0, reach, block_turns)


def unwarp(
    sums: OrderSums, track: AngleTrack, comb: Comb, reach: float = 0.015, turns: float | None = None
) -> AngleTrack:
    """Follow a comb again in the angle of a first track, where its lines are nearly steady.

    Parameters
    ----------
    sums : OrderSums
        Of the recording.
    track : AngleTrack
        The first track.
    comb : Comb
        Orders and weights.
    reach : float
        How far about the first track's speed to look, as a fraction.
    turns : float, optional
        Length of a block; by default as many as last 0.4 s, but 4 to 10.

    Returns
    -------
    AngleTrack
        The better track.
    """
    turns = turns or float(np.clip(_UNWARP_S * track.mean_hz, *_UNWARP_TURNS))
    vibration = InAngle.of(sums.samples, sums.sampling_rate_hz, track)
    grid, scan = vibration.grid, scan_angle(vibration, comb, reach, turns)
    inner = integrate_speed(scan.track(), (grid.count - 1) / grid.per_turn)
    return track.moved(grid.first_turn + inner.time_s, inner.turns - inner.time_s, np.nan)


def follow_lines(sums: OrderSums, track: AngleTrack) -> tuple[AngleTrack, float]:
    """Make a track right to a small part of a mesh period.

    It is locked to the lines. Where they are not phase-coherent then, the likeliest course of speed
    that their phases tell is followed first, in blocks so short that the speed hardly changes
    within them: long ones smear the lines of a load that ripples.

    Parameters
    ----------
    sums : OrderSums
        Mesh harmonics of a recording, whose phases are followed.
    track : AngleTrack
        A first track, its speed right to about a per cent.

    Returns
    -------
    track : AngleTrack
        The track in which most of the lines is coherent.
    share : float
        That share, see `coherent_share`.
    """
    best = lock_track(sums, track)
    if best[1] > _LOCKED:
        return best
    followed = track
    for turns in _FOLLOWED_TURNS:
        followed = _followed(followed, sums.sliding(followed, turns))
    # short blocks follow sidebands of slow shafts, too, as if the speed did what they do
    angle = np.arange(track.turns[0], track.turns[-1], _KNOTS)
    ahead = _about(followed.turns_at(track.time_at(angle)) - angle, _LOCK_TURNS / _KNOTS)
    for course in (track.moved(angle, ahead, np.nan), followed):
        # from so far off one is not enough: the means of the lines are not yet theirs
        found = lock_track(sums, lock_track(sums, course)[0])
        best = max(best, found, key=lambda own: own[1])
        if best[1] > ALL_COHERENT:
            break
    return best


def _followed(track: AngleTrack, lines: SlidingLines) -> AngleTrack:
    """Follow the likeliest course of speed that phases tell by their advance from block to block.

    A high line tells it finely but for whole cycles, a low one roughly: together, and because a
    shaft has inertia, they leave one. With R the mean cosine of a line's phase beside that course
    its weight is that of a von Mises law, R (2 - R^2) / (1 - R^2) (Banerjee et al. 2005).
    """
    product = lines.amplitude[1:] * np.conj(lines.amplitude[:-1])
    advance = product / np.maximum(np.abs(product), np.finfo(float).tiny)
    cycles = lines.orders * lines.hop
    half = int(np.ceil(max(2.0, _REACH * float(cycles.max()) / _STEP_CYCLES)))
    tried = _REACH * np.arange(-half, half + 1) / half
    usual = _WANDER * np.sqrt(lines.hop / float(np.mean(track.speed_hz)))
    reach = max(1, round(3 * usual * half / _REACH))
    weight = np.ones(len(cycles))
    for _ in range(_WEIGHED):
        scores = ((advance * weight) @ phasors(-np.outer(cycles, tried))).real
        course = peak_refined(scores, best_path(scores, reach), tried)
        agreed = (advance * phasors(-np.outer(course, cycles))).real.mean(axis=0)
        agreed = np.where(agreed > _AGREES / np.sqrt(2 * len(advance)), agreed, 0.0)
        weight = agreed * (2 - agreed**2) / (1 - agreed.clip(max=0.99) ** 2)
        if not weight.any():
            return track
    error = np.concatenate([[0.0], np.cumsum(course * lines.hop)])
    return track.moved(lines.angle, error, np.nan)


class LostStretch(NamedTuple):
    """A stretch in which the lines are not phase-coherent in the angle.

    Parameters
    ----------
    start_s, end_s : float
        Where it begins and ends [s].
    turns : float
        How many turns of shaft 1 it lasts.
    slipped_turns : float, optional
        By how much the angle is ahead after it [turns], 0 if it came back to where it should be;
        None if the lines do not tell, or there are none on one side.
    """

    start_s: float
    end_s: float
    turns: float
    slipped_turns: float | None

    @property
    def harmless(self) -> bool:
        """Whether the angle is known to be right again after it."""
        return self.slipped_turns == 0.0


class SlipCheck(NamedTuple):
    """How well an angle is held by the lines.

    Parameters
    ----------
    time_s : ndarray of float, shape (blocks,)
        Centres of blocks half a turn apart [s].
    coherence : ndarray of float, shape (blocks,)
        Mean over the lines of their part in phase with their own mean: 1 while they are coherent, 0
        while they turn.
    uncertainty_turns : ndarray of float, shape (blocks,)
        Standard deviation of the angle about the true one [turns], a common offset left out; after
        a slip that of the whole record is meant.
    lost : tuple of LostStretch
        Stretches in which the angle is lost, in order.
    """

    time_s: FloatArray
    coherence: FloatArray
    uncertainty_turns: FloatArray
    lost: tuple[LostStretch, ...]

    @property
    def locked(self) -> bool:
        """Whether the angle is held throughout, or comes back after each lost stretch."""
        return all(stretch.harmless for stretch in self.lost)

    @property
    def held_throughout(self) -> bool:
        """Whether the lines also stand still beside those of the turns about them, nearly always.

        As the speed changes the path turns lines that stand still in no angle of the whole
        recording: of eight lumped machines run up and down between 0.8 and 1.1 of a speed 37 to
        60 % of their power does in an angle that is right to 0.07 mesh periods, where a tenth of
        the blocks lies below 0.77 to 0.91; in angles that are lost it lies below 0.15.
        """
        return self.locked and bool(np.quantile(self.coherence, 0.1) >= _SOUND)

    def typical_turns(self, start_s: float = -np.inf, stop_s: float = np.inf) -> float:
        """Root mean square of the uncertainty between two times [turns].

        Lost stretches that do no harm are left out if they last less than a tenth of the time: that
        takes less than 1 dB from a line.
        """
        time_s, lost = self.time_s, [(own.start_s, own.end_s) for own in self.lost if own.harmless]
        inside = (time_s >= start_s) & (time_s <= stop_s)
        passed = [inside & (time_s >= first) & (time_s <= last) for first, last in lost]
        held = inside & ~np.any(passed, axis=0)
        told = held if held.sum() > 0.9 * inside.sum() else inside
        return float(np.sqrt(np.mean(self.uncertainty_turns[told] ** 2)))

    def held(self, track: AngleTrack) -> tuple[float, float]:
        """Longest part in which the angle is held or comes back [s], for the track checked."""
        ends = track.time_s[[0, -1]].tolist()
        for stretch in self.lost:
            if not stretch.harmless:
                turns = track.turns_at(np.array([stretch.start_s, stretch.end_s]))
                ends[-1:-1] = track.time_at(turns + np.array([-_WIDER, _WIDER])).tolist()
        return max(zip(ends[::2], ends[1::2], strict=True), key=lambda part: part[1] - part[0])


def check_slips(sums: OrderSums, track: AngleTrack) -> SlipCheck:
    """Check whether an angle stays locked to the lines of a recording.

    Parameters
    ----------
    sums : OrderSums
        Lines that the angle was found by, or others that are loud: mesh harmonics. It costs little
        if they were asked for near this track before.
    track : AngleTrack
        The angle, found without a tachometer.

    Returns
    -------
    SlipCheck

    Raises
    ------
    ArgumentError
        If the recording holds fewer than eight turns.

    Notes
    -----
    With y_lb the amplitude of line l in block b and m_lb its mean over the 30 turns about it, the
    coherence is the mean over the lines of Re(y conj m) / |m|^2, within -1 and 1, over the lines
    whose phases scatter by less than 0.12 of a cycle and that no louder one drowns. An error of e
    turns that comes and goes takes it to cos(2 pi o e). A stretch is lost where it falls below a
    third; where lines fade by themselves (below 0.75 for more than a tenth of the time) only if
    that lasts five turns or more.

    The variance of the angle has three parts: what the lines say of it from block to block; how far
    their consensus departs over the record; and the shared delay (f d)^2 (t^2 + s t0^2), f the mean
    speed, d its relative departure (a quarter of its mean square at least), t the root mean square
    by which the delays of the lines differ, weighted by w = o^2 / (phase variance), s the sum of
    the squares of these weights over the square of their sum, t0 = 0.5 ms. In a lost stretch, and
    beyond it unless it is known to do no harm, the angle may be off by 6 % of its turns.
    """
    turns = float(track.turns[-1] - track.turns[0])
    if turns < LEAST_TURNS:
        raise ArgumentError(
            f"recording of {turns:.2g} turns of shaft 1: slips show in {LEAST_TURNS:g} and more"
        )
    lines = sums.sliding(track, _CHECKED_TURNS)
    mean = _about(lines.amplitude, _ABOUT_TURNS / lines.hop)
    phase = np.angle(lines.amplitude * np.conj(mean)) / (2 * np.pi)
    scatter = np.median(np.abs(phase), axis=0) / 0.6745
    power = np.mean(np.abs(lines.amplitude) ** 2, axis=0).reshape(-1, len(sums.orders))
    # what leaks of a louder line turns with its own order
    clear = (scatter < _CLEAR_CYCLES) & _loudest(sums.orders, power, lines.hop).ravel()
    time_s = track.time_at(lines.angle)
    coherence = _coherence(lines.amplitude[:, clear], mean[:, clear])
    stretches = _stretches(coherence, lines.hop)
    # sound and lost blocks take turns between these
    cuts = [0, *chain(*stretches), len(time_s)]
    sound = np.repeat(np.arange(len(cuts) - 1) % 2 == 0, np.diff(cuts))
    told = replace(lines, orders=lines.orders[clear], amplitude=lines.amplitude[:, clear])
    lost = tuple(_lost(told, time_s, cuts[k : k + 4]) for k in range(0, len(cuts) - 2, 2))
    variance = _astray(cuts, lost)
    if sound.any():
        weight = told.orders**2 / (scatter[clear] ** 2 + FLOOR_CYCLES**2)
        variance += _variance(told, phase[:, clear], weight, sound, time_s)
    doubt = np.sqrt(variance)
    return SlipCheck(time_s=time_s, coherence=coherence, uncertainty_turns=doubt, lost=lost)


def mend_slips(
    sums: OrderSums, track: AngleTrack, check: SlipCheck, comb: Comb
) -> tuple[AngleTrack, SlipCheck]:
    """Find an angle again where it is lost: by the comb, then led smoothly over what is left.

    Parameters
    ----------
    sums : OrderSums
        As for `check_slips`.
    track : AngleTrack
        The angle.
    check : SlipCheck
        What was found of it.
    comb : Comb
        Orders and weights, looked for in the angle of the track once more.

    Returns
    -------
    track, check
        The angle in which less is lost, or the same.

    Notes
    -----
    In the angle of a track that is right nearly everywhere the comb stands still and is found where
    the speed by time had hidden it. Of 108 simulated recordings (four machines, speeds that wander
    by 0.5 to 4 %, 0 to 20 dB) 94 are right from end to end with it, 90 without.

    A shaft has inertia: its angle over a lost stretch is a cubic through the turns to either side,
    displaced on one of them by what fits best. That is right to some part of a mesh period, spread
    over all blocks of the stretch; the phases of the lines within it tell the rest.
    """
    share = coherent_share(sums, track)
    for _ in range(_AGAIN):
        again, its = lock_track(sums, unwarp(sums, track, comb))
        found = check_slips(sums, again)
        if its < share or _lost_turns(found) >= _lost_turns(check):
            break
        track, check, share = again, found, its
    for stretch in check.lost:
        led = None if stretch.harmless else _led_over(track, stretch)
        if led is not None:
            with suppress(ArgumentError):  # a wrong way can lead to one that turns back
                other, its = lock_track(sums, led)
                found = check_slips(sums, other)
                if its >= share and _lost_turns(found) < _lost_turns(check):
                    track, check, share = other, found, its
    return track, check


def _lost_turns(check: SlipCheck) -> float:
    return sum(stretch.turns for stretch in check.lost if not stretch.harmless)


def _led_over(track: AngleTrack, stretch: LostStretch) -> AngleTrack | None:
    """Return the track, led over a lost stretch; None if that is too long or not smooth."""
    first, last = track.turns[[0, -1]]
    begin, end = track.turns_at(np.array([stretch.start_s, stretch.end_s]))
    begin, end = max(begin - _WIDER, first), min(end + _WIDER, last)
    beside = _KNOTS * np.arange(1.0, _BESIDE / _KNOTS)
    angle = np.concatenate([begin - beside[::-1], end + beside])
    angle = angle[(angle > first) & (angle < last)]
    if stretch.turns > _MENDABLE_TURNS or len(angle) < len(beside):
        return None
    behind = angle > end
    inside = np.linspace(begin, end, 1 + int(np.ceil((end - begin) / _KNOTS)))
    one_sided = behind.all() or not behind.any()
    fitted = partial(Polynomial.fit, track.time_at(angle), deg=1 if one_sided else _DEGREE)
    ahead = stretch.slipped_turns or 0.0
    if stretch.slipped_turns is None and not one_sided:
        # of what no curve through the turns explains, the share that is a step between them
        step = behind - fitted(behind)(track.time_at(angle))
        ahead = float(step @ angle / (step @ step))
    shift = fitted(angle - ahead * behind)(track.time_at(inside)) - inside
    gaps = shift[[0, -1]] + [0.0, ahead]
    # the end of the recording may be anywhere, the turns beside the stretch may not
    fits = np.abs(gaps[[begin > first, end < last]]).max(initial=0.0) < _KNOTS
    if not fits or np.any(np.diff(inside + shift) <= 0):
        return None
    before, after = track.turns < inside[0] - _KNOTS, track.turns > inside[-1] + _KNOTS
    turns = np.concatenate([track.turns[before], inside + shift, track.turns[after] - ahead])
    time_s = np.concatenate([track.time_s[before], track.time_at(inside), track.time_s[after]])
    return replace(track, time_s=time_s, turns=turns)


def _about(rows: NDArray[Any], width: float) -> NDArray[Any]:
    """Mean of the rows about each, cut at the ends: three running means, nearly a Gaussian."""
    size = 2 * max(1, round(0.25 * width)) + 1
    number = uniform_filter1d(np.ones(len(rows)), size, mode="constant")
    for _ in range(3):
        rows = (uniform_filter1d(rows, size, axis=0, mode="constant").T / number).T
    return rows


def _coherence(amplitude: ComplexArray, mean: ComplexArray) -> FloatArray:
    """Mean over the lines of their part in phase with their mean, over three blocks; 0 of none."""
    if not amplitude.shape[1]:
        return np.zeros(len(amplitude))
    size = np.abs(mean)
    size = np.maximum(size, _FAINT * np.median(size, axis=0))
    part = np.clip((amplitude * np.conj(mean)).real / size**2, -1, 1).mean(axis=1)
    return np.asarray(convolve1d(part, [0.25, 0.5, 0.25], mode="nearest"))


def _stretches(coherence: FloatArray, hop: float) -> list[tuple[int, int]]:
    """Where the coherence is lost, as far as it is not sound."""
    unsound = runs_where(coherence < _SOUND).tolist()
    lost = [(a, b) for a, b in unsound if coherence[a:b].min() < _LOST]
    long = [(a, b) for a, b in lost if (b - a) * hop >= _FADING_TURNS]
    # a long stretch tells nothing of whether lines fade by themselves elsewhere
    beside = np.ones(len(coherence), dtype=bool)
    for start, stop in long:
        beside[start:stop] = False
    fading = beside.any() and np.quantile(coherence[beside], 0.1) < _STEADY_LINES
    found: list[tuple[int, int]] = []
    for start, stop in long if fading else lost:
        # while the angle slips by several periods the lines come back once in each
        if found and (start - found[-1][1]) * hop < _APART_TURNS:
            start = found.pop()[0]
        found.append((start, stop))
    return found


def _variance(
    lines: SlidingLines, phase: FloatArray, weight: FloatArray, sound: BoolArray, time_s: FloatArray
) -> FloatArray:
    """Variance of the angle while it is locked [turns^2]."""
    slow = _about(lines.amplitude, _DELAY_TURNS / lines.hop)
    # a lost stretch would unwind phases by whole cycles
    drift = np.unwrap(np.angle(slow[sound]), axis=0) / (2 * np.pi)
    drift = (drift - np.median(drift, axis=0)) / lines.orders
    beside = (drift - np.median(drift, axis=1)[:, None]) * lines.orders
    # what turns on and on beside the others is no line at this order
    held = np.where(np.ptp(beside, axis=0) < _TURNED_BY_PATH, weight, 0.0)
    weight = held if held.sum() > 0.5 * weight.sum() else weight
    total = float(weight.sum())
    shared = drift @ weight / total
    apart = float(np.mean((drift - shared[:, None]) ** 2 @ weight) / total)
    quick = (phase / lines.orders) @ weight / total
    variance = _about(quick**2, _ABOUT_TURNS / lines.hop)
    speed = _about(np.gradient(lines.angle, time_s), 2 * _DELAY_TURNS / lines.hop)
    mean_hz = float((lines.angle[-1] - lines.angle[0]) / (time_s[-1] - time_s[0]))
    # a delay t sets the angle off by t times the departure of the speed from its mean [turns]
    departure = (speed - mean_hz) ** 2
    size = float(departure[sound].mean())
    delay = float(np.sum(weight**2)) / total**2 * _DELAY_S**2
    if size > 0:
        delay += apart / size
    variance += delay * ((1 - _STEADY_DELAY) * departure + _STEADY_DELAY * size)
    variance[sound] += shared**2
    return variance


def _lost(told: SlidingLines, time_s: FloatArray, cuts: Sequence[int]) -> LostStretch:
    """Describe one stretch by where the sound blocks before and after it begin and end."""
    angle, (_, start, stop, _) = told.angle, cuts
    begin, end = float(angle[max(start - 1, 0)]), float(angle[min(stop, len(angle) - 1)])
    inside = start > 0 and stop < len(angle) and end - begin < _LONGEST_TURNS
    slipped = _displacement(told, cuts, _ASTRAY * (end - begin)) if inside else None
    start_s, end_s = float(time_s[start]), float(time_s[stop - 1])
    return LostStretch(start_s=start_s, end_s=end_s, turns=end - begin, slipped_turns=slipped)


def _displacement(told: SlidingLines, cuts: Sequence[int], reach: float) -> float | None:
    """How far the angle has slipped in a stretch, some turns at most; None if unclear [turns]."""
    order, means = told.orders, []
    most, least = int(_BESIDE_TURNS / told.hop), int(np.ceil(_LEAST_BESIDE / told.hop))
    # blocks that reach into the stretch hold what is lost
    first, start, stop, last = cuts[0] + 3, cuts[1] - 3, cuts[2] + 3, cuts[3] - 3
    variance = np.full(len(order), (2 * np.pi * _TURNED_CYCLES) ** 2)
    for low, high in ((max(first, start - most), start), (stop, min(last, stop + most))):
        if high - low < least:
            return None
        rows = told.amplitude[low:high]
        mean = rows.mean(axis=0)
        noise = np.mean(np.abs(rows - mean) ** 2, axis=0) * _QUARTER_HOP / len(rows)
        variance += 0.5 * noise / np.maximum(np.abs(mean) ** 2, np.finfo(float).tiny)
        means.append(mean)
    # by how many cycles lines are turned after the stretch, and how surely
    turned = np.angle(means[1] * np.conj(means[0])) / (2 * np.pi)
    sure = np.where(variance < 1, 1 / variance, 0.0)
    if sure.sum() < 2 * _TOLD:
        return None
    # lines that are turned alike are told apart within half a cycle of their mean order
    lobe = 0.5 / float(np.sqrt(np.average(order**2, weights=sure)))
    step = 0.125 * lobe
    count = int(np.ceil(max(reach, 4 * lobe) / step))
    tried = step * np.arange(-count, count + 1)
    likely = phasors(turned + np.outer(tried, order)).real @ sure
    best = int(np.argmax(likely))
    others = np.abs(tried - tried[best]) > 2 * lobe
    if likely[best] - likely[others].max() < _TOLD:
        return None
    found = float(tried[best])
    return 0.0 if abs(found) <= lobe else found


def _astray(cuts: Sequence[int], lost: tuple[LostStretch, ...]) -> FloatArray:
    """Variance of the angle because it was lost [turns^2]."""
    variance = np.zeros(cuts[-1])
    # the longest time that it is locked is what the rest is compared with
    home = int(np.argmax(np.diff(cuts)[::2]))
    for number, stretch in enumerate(lost):
        start, stop = cuts[2 * number + 1 : 2 * number + 3]
        own = (_ASTRAY * stretch.turns) ** 2 / 3
        variance[start:stop] += own
        # nothing beyond one that is harmless: the angle has slipped by none after it
        beyond = slice(stop, None) if number >= home else slice(0, start)
        slipped = stretch.slipped_turns
        variance[beyond] += own if slipped is None else slipped**2
    return variance
