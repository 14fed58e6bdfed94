"""Text files larger than memory: checked and counted once, then read in blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.columns import Column
from gearmon.signals.reading.roles import Interpreted, Wanted, interpret
from gearmon.signals.reading.rounding import Floats
from gearmon.signals.reading.source import Source
from gearmon.signals.reading.table import Table, layout_of, parsed_blocks
from gearmon.signals.reading.timebase import Spacing, spacing

_SAME_STEP = 1e-3
_SAME_RATE = 1e-9


@dataclass(frozen=True, kw_only=True)
class TextStream:
    """A text of rows that is read in pieces.

    Parameters
    ----------
    head : tuple of Interpreted and str
        What its channels are, by its first rows, and the file.
    count : int
        Rows.
    pieces : callable
        Gives the samples from a first to before a last one in pieces, shape (channels, n).
    """

    head: tuple[Interpreted, str]
    count: int
    pieces: Callable[[int, int], Iterator[Floats]]


def open_text(source: Source, wanted: Wanted, judged: int) -> TextStream:
    """Return a text as a stream, after one reading from end to end that checks every row.

    Parameters
    ----------
    source : Source
        The file.
    wanted : Wanted
        What the user says.
    judged : int > 0
        Rows at the start by which the channels are told.

    Raises
    ------
    RecordingError
        If a line is no row, or the channels cannot be used.
    """
    layout = layout_of(source)

    def rows() -> Iterator[Floats]:
        for _, values in parsed_blocks(source, layout):
            if len(values):
                yield values.T

    first, count = _head(rows(), judged)
    table = Table(source=source, layout=layout, values=first)
    content = replace(table.content(), whole=first.shape[1] == count)
    found = interpret(content, wanted)
    if found.time is not None:
        step = _checked_step(table, found.time, rows())
        if wanted.sampling_rate_hz is None and not content.whole:
            found = replace(found, rate_hz=_refined(found, first, step))
    indices = [column.number - 1 for column in found.columns]
    scales = np.array(found.scales)[:, None]

    def pieces(start: int, stop: int) -> Iterator[Floats]:
        place = 0
        for block in rows():
            low, high = max(start - place, 0), min(stop - place, block.shape[1])
            if low < high:
                yield block[indices, low:high] * scales
            place += block.shape[1]
            if place >= stop:
                return

    return TextStream(head=(found, source.path), count=count, pieces=pieces)


def _head(rows: Iterator[Floats], judged: int) -> tuple[Floats, int]:
    """Return the first rows, and how many there are in all."""
    parts: list[Floats] = []
    count = 0
    for block in rows:
        if count < judged:
            parts.append(block[:, : judged - count].copy())
        count += block.shape[1]
    if not parts:
        return np.empty((0, 0)), 0
    return np.concatenate(parts, axis=1), count


def _refined(found: Interpreted, first: Floats, step: float) -> float:
    """Return the rate with the step of the whole file instead of that of the first rows."""
    stamps = first[found.time.number - 1] if found.time is not None else np.empty(0)
    ratio = spacing(stamps).step / step
    return found.rate_hz if abs(ratio - 1.0) < _SAME_RATE else found.rate_hz * ratio


def _checked_step(table: Table, column: Column, rows: Iterator[Floats]) -> float:
    """Return the slope of the time column against its rows; raise if it is irregular anywhere."""
    usual: Spacing | None = None
    index = column.number - 1
    last, place = np.empty(0), 0
    begin, total, moment = 0.0, 0.0, 0.0
    for block in rows:
        stamps = np.concatenate([last, block[index]])
        begin = begin if place else float(stamps[0])
        away = block[index] - begin
        total += float(away.sum())
        moment += float(away @ np.arange(place, place + len(away)))
        if len(stamps) < 3:
            last, place = stamps, place + block.shape[1]
            continue
        found = spacing(stamps) if np.isfinite(stamps).all() else Spacing(step=1.0, fault="missing")
        fault = found.fault
        if usual is None:
            usual = found
        elif not fault and abs(found.step / usual.step - 1.0) > _SAME_STEP + _slack(found, stamps):
            fault = f"the step changes from {usual.step:.6g} to {found.step:.6g}"
        if fault:
            row = place - len(last) + found.row
            raise RecordingError(
                f"{table.source.path}, line {table.line(row)[0]}, {column.label}: the time is "
                f" irregular: {fault}; if the samples are evenly spaced all the same, delete the "
                "time column and give --sampling-rate HZ, otherwise resample"
            )
        place += block.shape[1]
        last = stamps[-1:]
    return 12.0 * (moment - 0.5 * (place - 1) * total) / (place * (place**2 - 1.0))


def _slack(found: Spacing, stamps: Floats) -> float:
    """Return how far rounding alone may change the step within the block."""
    return 1.0 / len(stamps) if found.coarse else found.uncertainty
