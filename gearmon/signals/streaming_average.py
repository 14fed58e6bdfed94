"""Synchronous averages (TSA) of a recording of any size, in bounded memory."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import RecordingError, check_positive
from gearmon.signals.angle import AngleTrack, resample_to_angle
from gearmon.signals.streaming import RecordingStream
from gearmon.signals.streaming_reading import positions, read_between

FloatArray = NDArray[np.float64]

# Steps of angle that are resampled at a time, over all channels.
_STEPS = 1 << 18
# Samples on either side of a piece: what the resampling of its ends looks at, and more.
_MARGIN = 4096
_MOST_THREADS = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class StreamedAverage:
    """Synchronous average of one shaft.

    Parameters
    ----------
    average : ndarray of float, shape (channels, per_turn)
        Mean over the turns at equal steps of the angle of the shaft, in the units of the channels.
    scatter : ndarray of float, shape (channels, per_turn)
        Standard deviation from turn to turn; that of the average is smaller by sqrt(turns).
    turns : int
        Turns of the shaft in the average.
    first_turn : float
        Angle of the shaft at which the first of them begins [turns].
    """

    average: FloatArray
    scatter: FloatArray
    turns: int
    first_turn: float


def stream_average(
    stream: RecordingStream,
    track: AngleTrack,
    *,
    shaft_order: float = 1.0,
    per_turn: int | None = None,
    precise: bool = True,
    progress: Callable[[float], object] | None = None,
) -> StreamedAverage:
    """Average a recording over the turns of a shaft, piece by piece.

    Parameters
    ----------
    stream : RecordingStream
        The recording.
    track : AngleTrack
        Angle of shaft 1 against time, over the whole recording.
    shaft_order : float > 0
        Turns of the shaft in a turn of shaft 1.
    per_turn : int, optional
        Samples a turn of the shaft; as many as keep the whole bandwidth at the lowest speed if not
        given. Fewer fold what lies above half of them into the average.
    precise : bool
        Whether to resample as `gearmon.signals.angle.resample_to_angle` does; without, some four
        times as quickly and as `gearmon.signals.streaming_reading.read_between` does: what lies
        above 0.2 of the sampling rate is read less well.
    progress : callable, optional
        Called with the share done, from 0 to 1.

    Returns
    -------
    StreamedAverage
        Of all whole turns of the shaft in the recording. Mean and scatter are gathered by
        Welford's recurrence, which does not lose digits over many turns.

    Raises
    ------
    RecordingError
        If the recording holds no whole turn of the shaft.
    ArgumentError
        If an argument is out of its range.
    """
    check_positive("shaft_order", shaft_order)
    shaft = AngleTrack(
        time_s=track.time_s,
        turns=track.turns * shaft_order,
        method=track.method,
        uncertainty_turns=track.uncertainty_turns * shaft_order,
        indexed=track.indexed,
    )
    steps = per_turn or math.ceil(stream.sampling_rate_hz / float(shaft.speed_hz.min()))
    check_positive("per_turn", steps)
    first, turns = _whole_turns(stream, shaft)
    gathered = _Gathered(stream.shape[0], steps)
    done, total = 0, turns * steps
    ranges = _pieces(total, steps, max(1, _STEPS // stream.shape[0]))
    for start, piece in _at_angle(stream, shaft, steps, first, ranges, precise):
        gathered.add(start % steps, piece)
        done = start + piece.shape[1]
        if progress is not None:
            progress(done / total)
    return StreamedAverage(
        average=gathered.mean, scatter=gathered.scatter(), turns=turns, first_turn=float(first)
    )


def _whole_turns(stream: RecordingStream, shaft: AngleTrack) -> tuple[int, int]:
    """Return the angle of the first whole turn, and how many whole turns follow."""
    last_s = (stream.shape[1] - 1) / stream.sampling_rate_hz
    begin, end = (float(turn) for turn in shaft.turns_at(np.array([0.0, last_s])))
    # a turn that begins with the recording is not lost to rounding
    first, last = math.ceil(begin - 1e-9), math.floor(end + 1e-9)
    if last <= first:
        raise RecordingError(
            f"{stream.origin}: {end - begin:.3g} turns of the shaft recorded; a whole one is needed"
        )
    return first, last - first


def _pieces(total: int, steps: int, most: int) -> Iterator[tuple[int, int]]:
    """Yield ranges of steps: of many whole turns where turns are short, else parts of turns."""
    size = steps * (most // steps) if steps <= most else most
    for turn_start in range(0, total, max(size, steps)):
        turn_stop = min(total, turn_start + max(size, steps))
        for start in range(turn_start, turn_stop, size):
            yield start, min(turn_stop, start + size)


def _at_angle(
    stream: RecordingStream,
    shaft: AngleTrack,
    steps: int,
    first_turn: int,
    ranges: Iterable[tuple[int, int]],
    precise: bool,
) -> Iterator[tuple[int, FloatArray]]:
    """Yield the signals at ranges of equal steps of angle, in order, resampled by threads.

    The file is read by one thread, from one end to the other.
    """
    rate = stream.sampling_rate_hz
    window = _Window(stream)

    def resampled(samples: FloatArray, near: AngleTrack, turn: float, count: int) -> FloatArray:
        if precise:
            return resample_to_angle(samples, rate, near, steps, turn, count)
        position = positions(near, turn, steps, count, rate)
        # a turn that begins or ends with the recording is not lost to rounding
        return read_between(samples, np.clip(position, 0.0, samples.shape[1] - 1.0))

    waiting: deque[tuple[int, Future[FloatArray]]] = deque()
    threads = min(os.cpu_count() or 1, _MOST_THREADS)
    with ThreadPoolExecutor(threads) as pool:
        for begin, end in ranges:
            turn, count = first_turn + begin / steps, end - begin
            ends = shaft.time_at(np.array([turn, turn + (count - 1) / steps])) * rate
            start = max(0, int(ends[0]) - _MARGIN)
            samples = window.read(start, min(stream.shape[1], int(ends[1]) + 2 + _MARGIN))
            near = _near(shaft, start / rate, (start + samples.shape[1]) / rate)
            waiting.append((begin, pool.submit(resampled, samples, near, turn, count)))
            if len(waiting) > threads:
                yield waiting[0][0], waiting.popleft()[1].result()
        while waiting:
            yield waiting[0][0], waiting.popleft()[1].result()


class _Window:
    """Samples of a stream that is read once, of which later ranges begin later."""

    def __init__(self, stream: RecordingStream) -> None:
        self._blocks = stream.blocks()
        self._held = np.empty((stream.shape[0], 0))
        self._first = 0

    def read(self, start: int, stop: int) -> FloatArray:
        """Return the samples from `start` to before `stop`."""
        parts = [self._held[:, start - self._first :]]
        end = self._first + self._held.shape[1]
        skipped = max(0, start - end)
        while end < stop:
            first, block = next(self._blocks)
            parts.append(block[:, skipped:])
            end = first + block.shape[1]
            skipped = max(0, start - end)
        self._held, self._first = np.concatenate(parts, axis=1), start
        return self._held[:, : stop - start]


def _near(shaft: AngleTrack, begin_s: float, end_s: float) -> AngleTrack:
    """Return the track with its time counted from `begin_s`: the knots around a piece only.

    Slopes of the Hermite curve depend on neighbours: three knots more on either side leave the
    curve within the piece as it is.
    """
    low = max(0, int(np.searchsorted(shaft.time_s, begin_s)) - 3)
    high = min(len(shaft.time_s), int(np.searchsorted(shaft.time_s, end_s)) + 3)
    return AngleTrack(
        time_s=shaft.time_s[low:high] - begin_s,
        turns=shaft.turns[low:high],
        method=shaft.method,
        uncertainty_turns=shaft.uncertainty_turns,
        indexed=shaft.indexed,
    )


class _Gathered:
    """Mean and sum of squares about it at every step of a turn, over the turns seen so far."""

    def __init__(self, channels: int, steps: int) -> None:
        self.mean = np.zeros((channels, steps))
        self._squares = np.zeros((channels, steps))
        self._turns = np.zeros(steps)

    def add(self, phase: int, piece: FloatArray) -> None:
        """Add signals of shape (channels, n), used up, that begin at that step of a turn."""
        channels, steps = self.mean.shape
        whole, rest = divmod(piece.shape[1], steps)
        if whole:
            many = piece[:, : whole * steps].reshape(channels, whole, steps)
            mean = many.mean(axis=1)
            many -= mean[:, None, :]  # the piece is used up
            squares = np.einsum("cts,cts->cs", many, many)
            self._join(slice(0, steps), whole, mean, squares)
        if rest:
            part = piece[:, whole * steps :]
            self._join(slice(phase, phase + rest), 1, part, np.zeros_like(part))

    def _join(self, where: slice, turns: int, mean: FloatArray, squares: FloatArray) -> None:
        before = self._turns[where]
        after = before + turns
        away = mean - self.mean[:, where]
        self.mean[:, where] += away * (turns / after)
        self._squares[:, where] += squares + away**2 * (before * turns / after)
        self._turns[where] = after

    def scatter(self) -> FloatArray:
        """Return the standard deviation from turn to turn; zero of a single turn."""
        spread: FloatArray = np.sqrt(self._squares / np.maximum(self._turns - 1.0, 1.0))
        return spread
