"""Recordings larger than memory, read block by block.

A stream knows what a `Recording` knows but its samples, and gives these in blocks. Files whose
samples lie at known places (WAV, FLAC, npy, HDF5, TDMS, Parquet) are read from anywhere; a text
is read from its start each time. Other formats are read whole by their libraries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

import numpy as np

from gearmon.errors import ArgumentError, RecordingError
from gearmon.signals.reading import (
    Floats,
    Frames,
    Interpreted,
    SensorLike,
    Wanted,
    choose,
    identify,
    interpret,
    load,
    open_source,
    open_text,
)
from gearmon.signals.recording import wanted_of

BLOCK = 1 << 18
# What tells a time column, a counter and the kinds of channels; the rest is checked on the way.
_JUDGED = 1 << 16


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordingStream:
    """A recording whose samples stay in their file; a context that closes it.

    Parameters
    ----------
    shape : tuple of two int
        Channels and samples of each.
    sampling_rate_hz : float > 0
        Samples per second.
    channel_names, channel_kinds, units, columns, origin, notes
        As of a `Recording`.
    source : callable
        Gives the samples from a first to before a last one in pieces, each of shape (channels, n).
    close : callable
        Closes the file.
    speed_rpm : float > 0 or None
        The speed that the file states as one number [1/min].
    """

    shape: tuple[int, int]
    sampling_rate_hz: float
    channel_names: tuple[str, ...]
    channel_kinds: tuple[str, ...]
    units: tuple[str | None, ...]
    columns: tuple[int, ...]
    origin: str
    notes: tuple[str, ...]
    source: Callable[[int, int], Iterator[Floats]] = field(repr=False)
    close: Callable[[], object] = field(repr=False, default=lambda: None)
    speed_rpm: float | None = None

    def __enter__(self) -> RecordingStream:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def duration_s(self) -> float:
        """Duration in seconds: number of samples over sampling rate."""
        return self.shape[1] / self.sampling_rate_hz

    def blocks(
        self, samples: int = BLOCK, start: int = 0, stop: int | None = None
    ) -> Iterator[tuple[int, Floats]]:
        """Give the samples in order, block by block.

        Parameters
        ----------
        samples : int > 0
            Samples of each channel in a block; the last may be shorter.
        start, stop : int, optional
            First sample, and the one before which to end.

        Yields
        ------
        first : int
            Index of the first sample of the block.
        block : ndarray of float64, shape (channels, samples)
            All finite.

        Raises
        ------
        RecordingError
            If a sample is no finite number, or the file is damaged.
        """
        if samples < 1:
            raise ArgumentError(f"{samples=} must be at least 1")
        end = self.shape[1] if stop is None else min(stop, self.shape[1])
        place, held, length = max(start, 0), list[Floats](), 0
        for piece in self.source(place, end):
            self._check(piece, place + length)
            held.append(piece)
            length += piece.shape[1]
            while length >= samples:
                whole = held[0] if len(held) == 1 else np.concatenate(held, axis=1)
                yield place, whole[:, :samples]
                place, length = place + samples, length - samples
                held = [whole[:, samples:]] if length else []
        if length:
            yield place, held[0] if len(held) == 1 else np.concatenate(held, axis=1)

    def read(self, start: int, stop: int) -> Floats:
        """Return the samples from `start` to before `stop`, shape (channels, stop - start)."""
        if not 0 <= start < stop <= self.shape[1]:
            raise ArgumentError(f"samples {start} to {stop} are not within 0 to {self.shape[1]}")
        return next(block for _, block in self.blocks(stop - start, start, stop))

    def _check(self, piece: Floats, first: int) -> None:
        if np.isfinite(piece.min(initial=0.0)) and np.isfinite(piece.max(initial=0.0)):
            return
        row, column = np.argwhere(~np.isfinite(piece))[0]
        raise RecordingError(
            f"{self.origin}, sample {first + column + 1}, channel '{self.channel_names[row]}': no "
            "finite number; correct the file, or name the channels to use with --channel"
        )


def open_recording(
    path: str | Path,
    sampling_rate_hz: float | None = None,
    channels: str | int | Iterable[str | int] | None = None,
    tacho: str | int | None = None,
    sensors: Iterable[SensorLike] = (),
) -> RecordingStream:
    """Open a recording of any size as a stream of blocks.

    Parameters
    ----------
    path, sampling_rate_hz, channels, tacho, sensors
        As of `gearmon.signals.recording.read_recording`. A text is read through once to check and
        count its rows.

    Returns
    -------
    RecordingStream
        Close it, or use it in a ``with`` statement. Dead or clipped channels are not looked for.

    Raises
    ------
    RecordingError
        If the file cannot be read as a recording.

    Examples
    --------
    >>> with open_recording("night.wav") as stream:  # doctest: +SKIP
    ...     peak = max(float(abs(block).max()) for _, block in stream.blocks())
    """
    wanted = wanted_of(sampling_rate_hz, channels, tacho, sensors)
    source = open_source(path)
    found = identify(source)
    if found.is_text:
        text = open_text(source, wanted, _JUDGED)
        return _stream(text.head, text.count, text.pieces, lambda: None, None)
    held = load(source, found)
    try:
        frames, wanted = choose(held, wanted)
        return _of_frames(frames, wanted, held.close)
    except BaseException:
        held.close()
        raise


def _of_frames(frames: Frames, wanted: Wanted, close: Callable[[], object]) -> RecordingStream:
    head = interpret(frames.content(_JUDGED), wanted)
    numbers = [column.number for column in frames.columns]
    rows = [numbers.index(column.number) for column in head.columns]
    scales = np.array(head.scales)[:, None]
    every, unscaled = rows == list(range(len(numbers))), bool((scales == 1.0).all())

    def pieces(start: int, stop: int) -> Iterator[Floats]:
        for first in range(start, stop, BLOCK):
            part = frames.read(first, min(stop, first + BLOCK))
            part = part if every else part[rows]
            if not unscaled:
                with np.errstate(over="ignore"):
                    part = part * scales
            yield part

    return _stream((head, frames.path), frames.count, pieces, close, frames.speed_rpm)


def _stream(
    head: tuple[Interpreted, str],
    count: int,
    source: Callable[[int, int], Iterator[Floats]],
    close: Callable[[], object],
    speed_rpm: float | None,
) -> RecordingStream:
    found, origin = head
    return RecordingStream(
        shape=(len(found.columns), count),
        sampling_rate_hz=found.rate_hz,
        channel_names=tuple(column.name for column in found.columns),
        channel_kinds=tuple(column.kind for column in found.columns),
        units=tuple(column.unit for column in found.columns),
        columns=tuple(column.number for column in found.columns),
        origin=origin,
        notes=found.notes,
        source=source,
        close=close,
        speed_rpm=speed_rpm,
    )
