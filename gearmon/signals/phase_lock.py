"""Angle of shaft 1 from order lines taken together: each line against its own slow mean.

Phases that are compared from block to block add up like a random walk and end half a block before
the recording does. Compared with the line's own slowly varying mean they do neither: the blocks
slide by a quarter of their length and are cut at the ends of the recording.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.angle import AngleTrack
from gearmon.signals.angle_phasors import phasors
from gearmon.signals.order_sums import OrderSums, SlidingLines
from gearmon.signals.phase import shifted_track

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# Length of the blocks: enough to part mesh lines from the sidebands of shaft 1 [turns].
_BLOCK_TURNS = 4.0
# Speeds at which a line has a mean of its own, their relative distance: the path turns it between.
_CLASS_WIDTH = 0.04
# Readings of the recording.
_PASSES = 2
# Solutions a reading: up to which share of the highest order lines are listened to.
_LIMITS = (0.4, 0.7, 1.0, 1.0, 1.0)
# A vote further than this from the consensus has slipped; what even the clearest line may err.
_GATE_CYCLES = 0.25
_FLOOR_CYCLES = 0.005
# Phases of noise scatter evenly over a cycle, variance 1/12; a line near that is not listened to.
_NOISE_VARIANCE = 1.0 / 12.0
# Hann blocks a quarter of their length apart are worth this many independent ones.
_OVERLAP = 2.7
# Blocks from which the import of a solver costs less than a loop.
_LONG = 4000


def lock_track(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    orders: FloatArray,
    wander: float = 0.02,
) -> AngleTrack:
    """Lock an angle track to the phases of order lines, right to the ends of the recording.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        A track whose speed is right to about 0.2 over the highest order.
    orders : ndarray of float, shape (lines,)
        Orders to follow: mesh harmonics.
    wander : float
        How restless the speed may be: standard deviation of its relative change in one second.

    Returns
    -------
    AngleTrack
        The track; unchanged but for an infinite uncertainty if no line can be heard.

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
    return locked(OrderSums(samples, sampling_rate_hz, orders), track, wander)


def locked(sums: OrderSums, track: AngleTrack, wander: float = 0.02) -> AngleTrack:
    """Lock a track as `lock_track` does, to lines of a recording that was read before."""
    for _ in range(_PASSES):
        track = _locked(track, sums.sliding(track, _BLOCK_TURNS), wander)
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
    variance = np.mean(jump**2, axis=0) / 6 + _FLOOR_CYCLES**2
    weight = np.where(variance < _NOISE_VARIANCE / 6, lines.orders**2 / variance, 0.0)
    total = float(weight.sum())
    if total <= 0:
        return np.zeros(len(lines.angle))
    increment = _median(advance / lines.orders, weight)
    for _ in range(3):
        rest = advance - increment[:, None] * lines.orders
        votes = weight * (np.abs(rest) < _GATE_CYCLES)
        mass = votes.sum(axis=1)
        mean = (votes * rest / lines.orders).sum(axis=1) / np.maximum(mass, 1e-300)
        increment = increment + np.where(mass > 0, mean, 0.0)
    error: FloatArray = np.concatenate([[0.0], np.cumsum(increment)])
    return error


def _median(rows: FloatArray, weight: FloatArray) -> FloatArray:
    """Weighted median along each row."""
    place = np.argsort(rows, axis=1)
    mass = np.cumsum(weight[place], axis=1)
    middle = np.argmax(mass >= 0.5 * mass[:, -1:], axis=1)
    found: FloatArray = np.take_along_axis(rows, place, axis=1)[np.arange(len(rows)), middle]
    return found


def _locked(track: AngleTrack, lines: SlidingLines, wander: float) -> AngleTrack:
    """Solve for the angle error of a track and take it away."""
    hop_turns = float(np.median(np.diff(lines.angle)))
    hop_s = hop_turns / float(np.mean(track.speed_hz))
    step = wander * np.sqrt(hop_s) * hop_turns
    low = 1.01 * float(lines.orders.min())
    error = _unwound(lines)
    hats = _speed_classes(track, lines.angle)
    for share in _LIMITS:
        near = lines.orders <= max(share * float(lines.orders.max()), low)
        order = lines.orders[near]
        turned = lines.amplitude[:, near] * phasors(np.outer(-error, order))
        mean = _mean_at_speed(turned, hats)
        rest = np.angle(turned * np.conj(mean)) / (2 * np.pi)
        variance = np.mean(rest**2, axis=0) + _FLOOR_CYCLES**2
        heard = variance < 0.5 * _NOISE_VARIANCE
        weight = np.where(
            heard & (np.abs(rest) < _GATE_CYCLES), order**2 / (variance * _OVERLAP), 0.0
        )
        total = weight.sum(axis=1)
        departure = rest / order
        vote = error + (weight * departure).sum(axis=1) / np.maximum(total, 1e-300)
        error = _smoothed(vote, total, step)
    if not heard.any():
        return shifted_track(track, lines.angle, np.zeros(len(error)), float("inf"))
    quick = float(np.mean(((weight * departure) ** 2).sum(axis=1)) / np.mean(total) ** 2)
    drift = np.unwrap(np.angle(mean[:, heard]), axis=0) / (2 * np.pi * order[heard])
    slow = float(np.average(np.var(drift, axis=0), weights=(order**2 / variance)[heard]))
    return shifted_track(track, lines.angle, error, float(np.sqrt(quick + slow)))


def _mean_at_speed(amplitude: ComplexArray, hats: FloatArray) -> ComplexArray:
    """Mean of each line as a function of the speed, linear between classes of speed."""
    mass = hats.sum(axis=0)[:, None]
    mean: ComplexArray = hats @ ((hats.T @ amplitude) / np.maximum(mass, 1e-12))
    return mean


def _speed_classes(track: AngleTrack, angle: FloatArray) -> FloatArray:
    """Weights of the blocks in overlapping classes of speed, shape (blocks, classes)."""
    time = track.time_at(angle)
    speed = np.gradient(angle, time)
    place = np.log(speed / speed.min()) / _CLASS_WIDTH
    count = max(1, round(float(place.max())))
    place = place * (count / max(float(place.max()), 1e-12)) if count > 1 else 0.0 * place
    classes = np.arange(count + 1 if count > 1 else 1)
    hats: FloatArray = np.maximum(0.0, 1.0 - np.abs(place[:, None] - classes))
    return hats


def _smoothed(vote: FloatArray, weight: FloatArray, step: float) -> FloatArray:
    """Minimise sum w (e - vote)^2 + sum (second difference of e)^2 / step^2."""
    count = len(vote)
    prior = 1.0 / step**2
    band = np.zeros((3, count))  # lower diagonals of prior * D'D
    band[0, :-2] += prior
    band[0, 1:-1] += 4 * prior
    band[0, 2:] += prior
    band[1, :-2] -= 2 * prior
    band[1, 1:-1] -= 2 * prior
    band[2, :-2] += prior
    # a weak pull to no error settles what no line tells
    band[0] += weight + 1e-6 * prior
    return _solve_banded(band, weight * vote)


def _solve_banded(band: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a symmetric system of five diagonals, given by its lower three, by L D L'."""
    if len(right) > _LONG:
        from scipy.linalg import solveh_banded  # short recordings do without

        solution: FloatArray = solveh_banded(band, right, lower=True)
        return solution
    main, beside, apart = band.tolist()
    value = right.tolist()
    for i, pivot in enumerate(main):
        if i > 0:
            share = beside[i - 1] / main[i - 1]
            pivot -= share * beside[i - 1]
            value[i] -= share * value[i - 1]
            beside[i] -= share * apart[i - 1]
        if i > 1:
            share = apart[i - 2] / main[i - 2]
            pivot -= share * apart[i - 2]
            value[i] -= share * value[i - 2]
        main[i] = pivot
    after, behind = 0.0, 0.0
    for i in range(len(main) - 1, -1, -1):
        after, behind = (value[i] - beside[i] * after - apart[i] * behind) / main[i], after
        value[i] = after
    return np.array(value)
