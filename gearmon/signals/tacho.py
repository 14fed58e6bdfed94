"""Angle of a shaft from the pulses of a tachometer channel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import RecordingError
from gearmon.signals.angle import AngleTrack

FloatArray = NDArray[np.float64]

# Share of pulses that may be missing or extra before the channel is no longer believed.
_REPAIRABLE = 0.02
# How far a nominal speed may be off.
_SPEED_UNKNOWN = 0.03


@dataclass(frozen=True, kw_only=True)
class TachoPulses:
    """Times of the pulses of a tachometer.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Rising edges [s], missing ones filled in, extra ones left out.
    missing, extra : int
        Pulses that were filled in and left out.
    """

    time_s: FloatArray
    missing: int
    extra: int


def find_pulses(waveform: FloatArray, sampling_rate_hz: float) -> TachoPulses:
    """Find the rising edges of a tachometer waveform.

    The threshold is half way between the extremes, with a hysteresis of a tenth of their distance
    on either side; edges are interpolated between samples. Intervals of two or three times the
    median of their neighbours get the missing pulses, intervals below 0.6 of it lose one.

    Parameters
    ----------
    waveform : ndarray of float, shape (n,)
        The channel, any unit.
    sampling_rate_hz : float
        Sampling rate [Hz].

    Returns
    -------
    TachoPulses

    Raises
    ------
    RecordingError
        If there are fewer than four pulses, or more than 2 % have to be repaired.
    """
    low, high = float(np.min(waveform)), float(np.max(waveform))
    middle, margin = 0.5 * (low + high), 0.1 * (high - low)
    raw = _edges(waveform, middle, margin) / sampling_rate_hz
    if len(raw) < 4:
        raise RecordingError(
            f"tacho channel: {len(raw)} pulses found between {low:g} and {high:g}; at least 4 are "
            "needed. Name the right channel with --tacho, or leave the tacho out"
        )
    cleaned, extra = _without_extra(raw)
    filled, missing = _with_missing(cleaned)
    if missing + extra > max(2, _REPAIRABLE * len(filled)):
        raise RecordingError(
            f"tacho channel: {missing} pulses missing and {extra} too many among {len(filled)}; "
            "at most 2 % can be repaired. Check the sensor, or leave the tacho out"
        )
    return TachoPulses(time_s=filled, missing=missing, extra=extra)


def _edges(waveform: FloatArray, middle: float, margin: float) -> FloatArray:
    """Fractional samples at which the waveform rises through the middle, with hysteresis."""
    state = np.zeros(len(waveform), dtype=np.int8)
    state[waveform > middle + margin] = 1
    state[waveform < middle - margin] = -1
    known = np.flatnonzero(state)
    rises = np.flatnonzero((state[known[1:]] == 1) & (state[known[:-1]] == -1))
    edges = np.empty(len(rises))
    for row, index in enumerate(rises):
        start, stop = known[index], known[index + 1]
        part = waveform[start : stop + 1]
        after = int(np.argmax(part > middle))
        before = after - 1
        step = part[after] - part[before]
        edges[row] = start + before + (middle - part[before]) / step
    return edges


_NEIGHBOURS = 15


def _typical(interval: FloatArray) -> FloatArray:
    """Median interval among each one's neighbours: the speed may change along the recording."""
    half = min(_NEIGHBOURS, len(interval)) // 2
    padded = np.pad(interval, half, mode="reflect") if half else interval
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    typical: FloatArray = np.median(windows, axis=-1)
    return typical


def _without_extra(time_s: FloatArray) -> tuple[FloatArray, int]:
    """Leave out pulses that come too soon, of two close ones the one that fits its neighbours less.

    A short interval between pulses i and i + 1 means that one of them is extra: without the right
    one the intervals on both sides add up to the typical one.
    """
    time = time_s
    extra = 0
    while len(time) > 3:
        interval = np.diff(time)
        typical = _typical(interval)
        short = np.flatnonzero(interval < 0.6 * typical)
        if len(short) == 0:
            break
        index = int(short[0])
        cost = []
        for candidate in (index, index + 1):
            rest = np.delete(time, candidate)
            near = np.diff(rest)[max(0, index - 2) : index + 2]
            cost.append(float(np.sum((near / typical[index] - 1) ** 2)))
        time = np.delete(time, index + int(np.argmin(cost)))
        extra += 1
        if extra > max(10, 0.1 * len(time_s)):
            break  # far beyond repair: the caller refuses
    return time, extra


def _with_missing(time_s: FloatArray) -> tuple[FloatArray, int]:
    interval = np.diff(time_s)
    steps = np.maximum(1, np.rint(interval / _typical(interval))).astype(int)
    parts = [time_s[:1]]
    for index, count in enumerate(steps):
        parts.append(time_s[index] + interval[index] * np.arange(1, count + 1) / count)
    return np.concatenate(parts), int(np.sum(steps - 1))


def track_from_pulses(
    pulses: TachoPulses,
    pulses_per_turn: int,
    shaft_order: float,
    duration_s: float,
) -> AngleTrack:
    """Turn tachometer pulses into the angle of shaft 1.

    Parameters
    ----------
    pulses : TachoPulses
        The pulses.
    pulses_per_turn : int
        Pulses a turn of the shaft that carries them. With several, one and the same of them is
        used, so that their uneven spacing does not matter.
    shaft_order : float
        Turns of that shaft a turn of shaft 1.
    duration_s : float
        Duration of the recording [s]; the track is continued to its ends.

    Returns
    -------
    AngleTrack
        Angle zero at the first pulse.

    Raises
    ------
    RecordingError
        If there are fewer than three turns.
    """
    time = pulses.time_s[::pulses_per_turn]
    if len(time) < 3:
        raise RecordingError(f"tacho channel: {len(time)} turns recorded, at least 3 are needed")
    turns = np.arange(len(time)) / shaft_order
    jitter = float(np.std(np.diff(time, 2)) / np.sqrt(6)) if len(time) > 3 else 0.0
    slope = np.diff(turns) / np.diff(time)
    ends = (turns[0] - time[0] * slope[0], turns[-1] + (duration_s - time[-1]) * slope[-1])
    inside = (time > 0) & (time < duration_s)
    return AngleTrack(
        time_s=np.concatenate([[0.0], time[inside], [duration_s]]),
        turns=np.concatenate([[ends[0]], turns[inside], [ends[1]]]),
        method="tacho",
        # of several pulses a turn nobody knows which one came first
        indexed=pulses_per_turn == 1 and shaft_order == 1.0,
        uncertainty_turns=jitter * float(slope.mean()),
    )


def pulses_per_turn(pulses: TachoPulses, shaft_hz: float, tolerance: float = 0.05) -> int:
    """Tell how many pulses a turn a tachometer gives from the nominal speed.

    Parameters
    ----------
    pulses : TachoPulses
        The pulses.
    shaft_hz : float
        Nominal rotation frequency of the shaft [Hz].
    tolerance : float
        How far the speed may be from nominal.

    Returns
    -------
    int
        Pulses a turn, at least 1.

    Raises
    ------
    RecordingError
        If the rate of the pulses fits no whole number of pulses a turn.
    """
    rate = 1.0 / float(np.median(np.diff(pulses.time_s)))
    count = max(1, round(rate / shaft_hz))
    if count * _SPEED_UNKNOWN > 0.25:
        raise RecordingError(
            f"tacho channel: about {rate / shaft_hz:.3g} pulses a turn at the nominal "
            f"{shaft_hz:.4g} Hz, too many to count while the speed may be "
            f"{_SPEED_UNKNOWN:.0%} off; give pulses_per_turn in a [[sensor]] of the machine file"
        )
    if abs(rate / shaft_hz / count - 1) > tolerance:
        raise RecordingError(
            f"tacho channel: {rate:.4g} pulses a second are {rate / shaft_hz:.3g} a turn at the "
            f"nominal {shaft_hz:.4g} Hz, not within {tolerance:.0%} of a whole number; give shaft "
            "and pulses_per_turn in a [[sensor]] of the machine file"
        )
    return count
