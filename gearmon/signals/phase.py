"""Angle of shaft 1 from the phases of known order lines, refining a comb's speed track.

The comb gives the speed to a fraction of a spectral line; the phase advance of the lines from block
to block gives it a hundred times finer. Each line votes with the weight of its signal-to-noise
ratio, a smoothness prior carries the track through blocks where nothing can be heard.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.angle import AngleTrack
from gearmon.signals.comb import SpeedTrack
from gearmon.signals.order_lines import OrderLines
from gearmon.signals.order_sums import OrderSums

FloatArray = NDArray[np.float64]

# Phase noise that modulation and interference leave on even the clearest line [cycles].
_PHASE_FLOOR_CYCLES = 0.01
# Power over noise from which the phase of a line is listened to.
_HEARD = 6.0
# Blocks that tell whether lines stand still [turns].
_BLOCK_TURNS = 5.0
# Errors of the speed that each pass expects: they bound the orders that it may use.
_SPEED_ERRORS = (1e-2, 3e-3, 1e-3, 1e-4)


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
    count = max(2, 2 * len(speed.time_s) + 1)
    time = np.linspace(0.0, duration_s, count)
    middle = speed.at(0.5 * (time[1:] + time[:-1]))
    turns = np.concatenate([[0.0], np.cumsum(middle * np.diff(time))])
    return AngleTrack(time_s=time, turns=turns, method="comb", uncertainty_turns=float("nan"))


def refine_track(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    orders: FloatArray,
    block_turns: float = 8.0,
    wander: float = 0.003,
) -> AngleTrack:
    """Refine an angle track by the phases of order lines.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        A first track, its speed right to some tenths of a per cent.
    orders : ndarray of float, shape (lines,)
        Orders to follow: mesh harmonics.
    block_turns : float
        Length of the blocks whose phases are compared [turns of shaft 1]: long enough to part the
        mesh lines from their sidebands, short enough to follow the speed.
    wander : float
        How restless the speed may be: standard deviation of its relative change in one second.

    Returns
    -------
    AngleTrack
        The refined track; the angle zero is that of the first track.

    Notes
    -----
    The increments d_j of the angle error between blocks are estimated by
    arg(A_j+1 conj A_j) / (2 pi order), weighted by 1/variance with
    var = (noise / |A|^2 + floor^2) / order^2, and smoothed by minimising
    sum w_j (d_j - s_j)^2 + sum (s_j+1 - s_j)^2 / q. Low orders come first: they cannot slip by a
    cycle as long as the speed is wrong by less than a fifth of a cycle a hop. A correction is kept
    if it raises the likelihood of standing lines by four times what its degrees of freedom (the
    trace of the smoother) would gain by fitting noise, half a unit each.
    """
    sums = OrderSums(samples, sampling_rate_hz, orders)
    return refined(sums, track, block_turns, wander)


def refined(
    sums: OrderSums, track: AngleTrack, block_turns: float = 8.0, wander: float = 0.003
) -> AngleTrack:
    """Refine a track as `refine_track` does, by lines of a recording that was read before."""
    turns = float(track.turns[-1] - track.turns[0])
    size = min(block_turns, turns / 4)
    for speed_error in _SPEED_ERRORS:
        limit = 0.2 / (speed_error * size / 2)
        before = sums.blocks(track, size, limit)
        candidate, freedom = _corrected(track, before, wander)
        if _gain(before, sums.blocks(candidate, size, limit)) > 2.0 * freedom:
            track = candidate
    return track


def standing_share(
    samples: FloatArray, sampling_rate_hz: float, track: AngleTrack, orders: FloatArray
) -> float:
    """Share of the power of order lines that stands still in angle: 1 for a perfect track.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        The track to be judged.
    orders : ndarray of float, shape (lines,)
        Mesh harmonics.

    Returns
    -------
    float
        Mean over the lines that are heard of |mean A|^2 / mean |A|^2, both less the share of noise,
        in [0, 1]; 0 if none is heard.
    """
    return share_standing(OrderSums(samples, sampling_rate_hz, orders), track)


def share_standing(sums: OrderSums, track: AngleTrack) -> float:
    """Return `standing_share` from the lines of a recording that was read before."""
    turns = float(track.turns[-1] - track.turns[0])
    lines = sums.blocks(track, min(_BLOCK_TURNS, turns / 4))
    power = np.mean(np.abs(lines.amplitude) ** 2, axis=0)
    heard = power > _HEARD * lines.noise
    if not heard.any():
        return 0.0
    blocks = lines.amplitude.shape[0]
    still = np.abs(lines.mean) ** 2 - lines.noise / blocks
    share = still[heard] / (power - lines.noise)[heard]
    return float(np.clip(share, 0.0, 1.0).mean())


def _gain(before: OrderLines, after: OrderLines) -> float:
    """Log likelihood that standing lines gain, noise of unknown variance about them.

    Half overlapped blocks are worth about two thirds of their number. Another track may hold one
    block more or less: its likelihood is that of as many blocks.
    """
    blocks = min(before.amplitude.shape[0], after.amplitude.shape[0])
    return float(2 / 3 * blocks * (_misfit(before) - _misfit(after)))


def _misfit(lines: OrderLines) -> float:
    """Negative log likelihood of lines that stand still, averaged over the blocks."""
    scatter = np.mean(np.abs(lines.amplitude - lines.mean) ** 2, axis=0)
    return float(np.log(scatter + 1e-3 * lines.noise).sum())


def _corrected(track: AngleTrack, lines: OrderLines, wander: float) -> tuple[AngleTrack, float]:
    """Return the track less the angle error that the lines show; the freedom that this took."""
    amplitude = lines.amplitude
    if amplitude.shape[0] < 2:
        return track, np.inf
    product = amplitude[1:] * np.conj(amplitude[:-1])
    order = lines.orders
    strength = np.maximum(np.abs(product), np.finfo(float).tiny)
    variance = lines.noise / strength / (2 * np.pi) ** 2 + _PHASE_FLOOR_CYCLES**2
    weight = order**2 / variance
    # a line below its noise says nothing about phase, however many such lines there are
    weight = np.where(strength > _HEARD * lines.noise, weight, 0.0)
    error = np.angle(product) / (2 * np.pi * order)
    increment, total = _robust_mean(error, weight, order)
    hop_turns = lines.block_turns / 2
    hop_s = hop_turns / float(np.mean(track.speed_hz))
    step = wander * np.sqrt(hop_s) * hop_turns
    smooth, spread, freedom = _smoothed(increment, total, step)
    middle = lines.first_turn + lines.block_turns / 2
    centres: FloatArray = middle + hop_turns * np.arange(len(smooth) + 1.0)
    shift = np.concatenate([[0.0], np.cumsum(smooth)])
    return shifted_track(track, centres, shift, spread), freedom


def _robust_mean(
    error: FloatArray, weight: FloatArray, order: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Weighted mean over channels and lines; votes beyond a quarter cycle are dropped once."""
    flat_error = error.reshape(len(error), -1)
    flat_weight = weight.reshape(len(weight), -1).copy()
    cycles = np.broadcast_to(order, error.shape).reshape(len(error), -1)
    for _ in range(2):
        total = flat_weight.sum(axis=1)
        mean = (flat_weight * flat_error).sum(axis=1) / np.where(total > 0, total, 1.0)
        flat_weight[np.abs(flat_error - mean[:, None]) * cycles > 0.25] = 0.0
    total = flat_weight.sum(axis=1)
    mean = (flat_weight * flat_error).sum(axis=1) / np.where(total > 0, total, 1.0)
    return mean, total


def _smoothed(
    increment: FloatArray, weight: FloatArray, step: float
) -> tuple[FloatArray, float, float]:
    """Smooth increments under a random walk of `step` a hop.

    Returns the smoothed increments, the error left per increment, and the degrees of freedom.
    """
    prior = 1.0 / step**2
    # a weak pull to the first track settles recordings in which no line is heard at all
    diagonal = weight + 1e-3 * prior
    diagonal[:-1] += prior
    diagonal[1:] += prior
    smooth, variance = _solve_tridiagonal(diagonal, -prior, weight * increment)
    return smooth, float(np.sqrt(np.mean(variance))), float(np.sum(weight * variance))


def _solve_tridiagonal(
    diagonal: FloatArray, off: float, right: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Solve a symmetric tridiagonal system; also the diagonal of its inverse (both sweeps)."""
    count = len(diagonal)
    ahead = diagonal.copy()
    behind = diagonal.copy()
    carried = right.copy()
    for i in range(1, count):
        ahead[i] -= off * off / ahead[i - 1]
        carried[i] -= off * carried[i - 1] / ahead[i - 1]
    solution = np.empty(count)
    solution[-1] = carried[-1] / ahead[-1]
    for i in range(count - 2, -1, -1):
        behind[i] -= off * off / behind[i + 1]
        solution[i] = (carried[i] - off * solution[i + 1]) / ahead[i]
    return solution, 1.0 / (ahead + behind - diagonal)


def shifted_track(
    track: AngleTrack, centres: FloatArray, shift: FloatArray, spread: float
) -> AngleTrack:
    """Add an angle error to a track.

    Parameters
    ----------
    track : AngleTrack
        The track.
    centres : ndarray of float, shape (blocks,)
        Angles of this track where the error is known [turns], ascending.
    shift : ndarray of float, shape (blocks,)
        What is to be added there [turns].
    spread : float
        Uncertainty of the result [turns].

    Returns
    -------
    AngleTrack
        Knots at the centres and at the ends of the old track.
    """
    ends = track.turns[[0, -1]]
    inner = centres[(centres > ends[0]) & (centres < ends[1])]
    angle = np.concatenate([[ends[0]], inner, [ends[1]]])
    slope_ends = _extrapolated(centres, shift, angle)
    return AngleTrack(
        time_s=track.time_at(angle),
        turns=angle + slope_ends,
        method=track.method,
        uncertainty_turns=spread,
    )


def _extrapolated(x: FloatArray, y: FloatArray, at: FloatArray) -> FloatArray:
    """Piecewise linear through (x, y), continued with the end slopes."""
    value = np.interp(at, x, y)
    if len(x) > 1:
        low, high = (y[1] - y[0]) / (x[1] - x[0]), (y[-1] - y[-2]) / (x[-1] - x[-2])
        value = np.where(at < x[0], y[0] + low * (at - x[0]), value)
        value = np.where(at > x[-1], y[-1] + high * (at - x[-1]), value)
    return value
