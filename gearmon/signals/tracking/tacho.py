"""Angle of a shaft from the pulses of a tachometer channel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.errors import ArgumentError, RecordingError, check_positive, check_range
from gearmon.signals.angle import AngleTrack
from gearmon.signals.tracking.pulse_repair import (
    Repaired,
    is_even,
    learn_spacing,
    misplaced,
    repair_even,
    repair_uneven,
)

FloatArray = NDArray[np.float64]

# Share of pulses that may be missing or extra before the channel is no longer believed.
_REPAIRABLE = 0.02
# How far a nominal speed may be off.
_SPEED_UNKNOWN = 0.03
# Fewest pulses that are believed.
_FEWEST = 4
# Knots a turn that an angle track gets; of an encoder's many pulses neighbours are averaged.
_KNOTS_PER_TURN = 16

Edge = Literal["rising", "falling"]


@dataclass(frozen=True, kw_only=True)
class TachoPulses:
    """Times of the pulses of a tachometer.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Edges [s], ascending, missing ones filled in, extra ones left out.
    missing, extra : int
        Pulses that were filled in and left out.

    Raises
    ------
    RecordingError
        If these are no times of pulses: they do not ascend (a waveform, perhaps), or are not
        finite.
    """

    time_s: FloatArray
    missing: int = 0
    extra: int = 0

    def __post_init__(self) -> None:
        """Check the times."""
        _check_times(self.time_s)


def find_pulses(
    waveform: FloatArray,
    sampling_rate_hz: float,
    per_turn: int | None = None,
    edge: Edge = "rising",
    hysteresis: float = 0.1,
) -> TachoPulses:
    """Find the edges of a tachometer waveform.

    The threshold is half way between the extremes, with a hysteresis on either side; edges are
    interpolated between samples. Missing pulses are filled in and extra ones left out
    (`gearmon.signals.tracking.pulse_repair`); of several pulses a turn the spacing is learned first
    (`gearmon.signals.tracking.pulse_repair`), so that uneven ones are left alone.

    Parameters
    ----------
    waveform : ndarray of float, shape (n,)
        The channel, any unit.
    sampling_rate_hz : float
        Sampling rate [Hz].
    per_turn : int, optional
        Pulses a turn, if known.
    edge : {"rising", "falling"}
        Which edge of the pulses to take: the sharper one, if they differ.
    hysteresis : float
        Part of the distance between the extremes that the waveform must pass the threshold by,
        on either side, before a next edge counts; in [0.001, 0.45].

    Returns
    -------
    TachoPulses

    Raises
    ------
    RecordingError
        If there are fewer than four pulses, or more than 2 % have to be repaired.
    ArgumentError
        If an argument is out of its range.
    """
    check_range("hysteresis", hysteresis, 1e-3, 0.45)
    if edge not in ("rising", "falling"):
        raise ArgumentError(f'edge must be "rising" or "falling", got {edge!r}')
    low, high = float(np.min(waveform)), float(np.max(waveform))
    middle, margin = 0.5 * (low + high), hysteresis * (high - low)
    if edge == "rising":
        raw = _edges(waveform, middle, margin) / sampling_rate_hz
    else:
        raw = _edges(-np.asarray(waveform), -middle, margin) / sampling_rate_hz
    if len(raw) < _FEWEST:
        times = len(waveform) > _FEWEST and bool(np.all(np.diff(waveform) > 0))
        hint = (
            "; its values only rise, as times of pulses do: give those to track_from_pulse_times"
            if times
            else ""
        )
        raise RecordingError(
            f"tacho channel: {len(raw)} pulses found between {low:g} and {high:g}; at least 4 are "
            f"needed. Name the right channel with --tacho, or leave the tacho out{hint}"
        )
    return repaired_pulses(raw, per_turn)


def repaired_pulses(
    raw: FloatArray, per_turn: int | None, channel: str = "tacho channel"
) -> TachoPulses:
    """Fill in and leave out pulses up to the limit, refuse beyond it.

    Parameters
    ----------
    raw : ndarray of float, shape (pulses,)
        Times as they were found [s], ascending.
    per_turn : int, optional
        Pulses a turn, if known: the spacing of several is learned.
    channel : str
        What messages call the channel.

    Raises
    ------
    RecordingError
        If more than 2 % have to be repaired, or it is unclear how.
    """
    if per_turn is None or is_even(raw, per_turn):
        found = repair_even(raw)
    else:
        filled, missing, extra = repair_uneven(raw, per_turn)
        wrong = misplaced(filled, per_turn) if missing or extra else None
        unclear_s = None if wrong is None else float(filled[wrong])
        found = Repaired(time_s=filled, missing=missing, extra=extra, unclear_s=unclear_s)
    if found.missing + found.extra > max(2, _REPAIRABLE * len(found.time_s)):
        raise RecordingError(
            f"{channel}: {found.missing} pulses missing and {found.extra} too many among "
            f"{len(found.time_s)}; at most 2 % can be repaired. Check the sensor, or leave the "
            "tacho out"
        )
    if found.unclear_s is not None:
        raise RecordingError(
            f"{channel}: pulses about {found.unclear_s:.4g} s come at times that fit no steady or "
            "slowly changing speed, and it is unclear which are missing or too many. Check the "
            "sensor, or leave the tacho out"
        )
    return TachoPulses(time_s=found.time_s, missing=found.missing, extra=found.extra)


def pulses_from_times(time_s: ArrayLike, per_turn: int | None = None) -> TachoPulses:
    """Take pulses whose times were measured already, as a counter board gives them.

    Parameters
    ----------
    time_s : array_like of float, shape (pulses,)
        Times of the pulses [s], ascending.
    per_turn : int, optional
        Pulses a turn, if known.

    Returns
    -------
    TachoPulses
        Repaired as those of a waveform.

    Raises
    ------
    RecordingError
        If these are no times of pulses (they do not ascend: a waveform, perhaps), there are fewer
        than four, or more than 2 % have to be repaired.
    """
    times = np.asarray(time_s, dtype=np.float64)
    if times.ndim != 1 or len(times) < _FEWEST:
        raise RecordingError(
            f"pulse times: an array of shape {times.shape}; a row of at least 4 times is needed"
        )
    _check_times(times)
    return repaired_pulses(times, per_turn)


def _check_times(times: FloatArray) -> None:
    if times.ndim != 1:
        raise RecordingError(
            f"pulse times: an array of shape {times.shape}; a row of times is needed"
        )
    if not np.all(np.isfinite(times)):
        place = int(np.argmin(np.isfinite(times)))
        raise RecordingError(f"pulse times: pulse {place + 1} has no finite time")
    falls = np.flatnonzero(np.diff(times) <= 0)
    if len(falls):
        first = int(falls[0])
        raise RecordingError(
            f"pulse times: pulse {first + 2} at {times[first + 1]:g} s does not come after pulse "
            f"{first + 1} at {times[first]:g} s, nor do {len(falls) - 1} others after theirs; if "
            "this is the waveform of a tachometer, give it to find_pulses with its sampling rate"
        )


def track_from_pulse_times(
    time_s: ArrayLike, duration_s: float, per_turn: int = 1, shaft_order: float = 1.0
) -> AngleTrack:
    """Turn measured times of pulses into the angle of shaft 1.

    Parameters
    ----------
    time_s : array_like of float, shape (pulses,)
        Times of the pulses [s], ascending, on the clock of the recording.
    duration_s : float
        Duration of the recording [s].
    per_turn : int
        Pulses a turn of the shaft that carries them.
    shaft_order : float
        Turns of that shaft a turn of shaft 1.

    Returns
    -------
    AngleTrack
        Angle zero at the first pulse.

    Raises
    ------
    RecordingError
        As `pulses_from_times` and `track_from_pulses`.
    """
    pulses = pulses_from_times(time_s, per_turn)
    return track_from_pulses(pulses, per_turn, shaft_order, duration_s)


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
        Pulses a turn of the shaft that carries them, > 0. Of several the spacing is learned and
        corrected, see `learn_spacing`.
    shaft_order : float
        Turns of that shaft a turn of shaft 1, > 0.
    duration_s : float
        Duration of the recording [s]; the track is continued to its ends.

    Returns
    -------
    AngleTrack
        Angle zero at the first pulse. Its uncertainty is the jitter of single pulses: by how much
        they come off the straight line between their neighbours, which counts three half times.

    Raises
    ------
    RecordingError
        If there are fewer than three turns.
    """
    time, turns, jitter = pulse_angles(pulses, pulses_per_turn, shaft_order)
    # of several pulses a turn nobody knows which one came first
    indexed = int(pulses_per_turn) == 1 and shaft_order == 1.0
    track = track_through(time, turns, duration_s)
    return replace(track, indexed=indexed, uncertainty_turns=jitter)


def pulse_angles(
    pulses: TachoPulses, pulses_per_turn: int, shaft_order: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return the times of pulses, the angles of shaft 1 that they mark, and their scatter.

    Parameters
    ----------
    pulses : TachoPulses
        The pulses.
    pulses_per_turn : int
        Pulses a turn of the shaft that carries them, > 0; the spacing of several is learned.
    shaft_order : float
        Turns of that shaft a turn of shaft 1, > 0.

    Returns
    -------
    time_s, turns : ndarray of float, shape (knots,)
        Times [s] and angles [turns], 0 for the first pulse; of an encoder's many pulses neighbours
        are averaged.
    jitter_turns : float
        Standard deviation of single pulses about the line through their neighbours [turns].

    Raises
    ------
    RecordingError
        If there are fewer than three turns.
    """
    check_positive("pulses_per_turn", pulses_per_turn)
    check_positive("shaft_order", shaft_order)
    count = int(pulses_per_turn)
    whole = (len(pulses.time_s) - 1) // count + 1
    if whole < 3:
        raise RecordingError(f"tacho channel: {whole} turns recorded, at least 3 are needed")
    spacing = learn_spacing(pulses.time_s, count)
    number = np.arange(len(pulses.time_s))
    turns = (number // count + spacing[number % count]) / shaft_order
    slope = float((turns[-1] - turns[0]) / (pulses.time_s[-1] - pulses.time_s[0]))
    jitter = _jitter(pulses.time_s, turns) * slope
    return *_thinned(pulses.time_s, turns, max(1, count // _KNOTS_PER_TURN)), jitter


def track_through(time_s: FloatArray, turns: FloatArray, duration_s: float) -> AngleTrack:
    """Return the track through known angles, continued straight to the ends of a recording.

    Parameters
    ----------
    time_s, turns : ndarray of float, shape (knots,)
        Times [s] and angles [turns], ascending.
    duration_s : float
        Where the recording ends [s].
    """
    slope = np.diff(turns) / np.diff(time_s)
    first = turns[0] - time_s[0] * slope[0]
    last = turns[-1] + (duration_s - time_s[-1]) * slope[-1]
    inside = (time_s > 0) & (time_s < duration_s)
    return AngleTrack(
        time_s=np.concatenate([[0.0], time_s[inside], [duration_s]]),
        turns=np.concatenate([[first], turns[inside], [last]]),
        method="tacho",
        uncertainty_turns=float("nan"),
    )


def _jitter(time_s: FloatArray, turns: FloatArray) -> float:
    """Return the standard deviation of a pulse's time about its neighbours' line [s]."""
    if len(time_s) < _FEWEST:
        return 0.0
    share = (turns[1:-1] - turns[:-2]) / (turns[2:] - turns[:-2])
    off = time_s[1:-1] - (1 - share) * time_s[:-2] - share * time_s[2:]
    return float(np.std(off / np.sqrt(1 + share**2 + (1 - share) ** 2)))


def _thinned(time_s: FloatArray, turns: FloatArray, together: int) -> tuple[FloatArray, FloatArray]:
    """Average neighbouring pulses of an encoder: less jitter, and fewer knots."""
    if together == 1:
        return time_s, turns
    groups = len(time_s) // together
    cut = groups * together
    return (
        time_s[:cut].reshape(groups, together).mean(axis=1),
        turns[:cut].reshape(groups, together).mean(axis=1),
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
    times = pulses.time_s
    # the mean rate: of uneven pulses no single interval tells it
    rate = (len(times) - 1) / float(times[-1] - times[0])
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
