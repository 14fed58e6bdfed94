"""All rows of a text file: as one array of numbers, or block by block where memory is too small."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.columns import Content, describe_columns
from gearmon.signals.reading.dialect import Layout, counted, find_layout
from gearmon.signals.reading.fields import Floats, decoded, is_number, shortened, split_fields
from gearmon.signals.reading.rows import check_last_line, is_row, parse_rows, read_rows
from gearmon.signals.reading.source import Block, Source

if TYPE_CHECKING:
    from concurrent.futures import Future

Progress = Callable[[float], object]

_HEAD_BYTES = 64 * 1024
_LONGEST_PREAMBLE = 64 * 1024 * 1024
_ROWS_TO_JUDGE = 50
# Threads pay only where a file has many blocks; more than four wait for the interpreter.
_THREADED_BYTES = 8 * 1024 * 1024
_MOST_THREADS = 4
_KEPT_BYTES = 16 * 1024 * 1024
_MARGIN = 1.1  # reserved rows over estimated ones: memory that is not touched costs nothing
_CUT_CHECK_BYTES = 64 * 1024


@dataclass(frozen=True, kw_only=True)
class Table:
    """The numbers of a text file.

    Parameters
    ----------
    source : Source
        The file.
    layout : Layout
        Where and how the rows are written.
    values : ndarray of float64, shape (columns, rows)
        The numbers; NaN where one is missing.
    """

    source: Source
    layout: Layout
    values: Floats

    def line(self, row: int) -> tuple[int, list[str]]:
        """Return the number of the line that holds the row (counted from 0), and its fields."""
        dialect = self.layout.dialect
        for block in _blocks_from(self.source.blocks(), self.layout.first_line):
            for number, line in enumerate(decoded(block.text).split("\n"), block.first_line):
                if is_row(line, dialect):
                    if row == 0:
                        return number, split_fields(line, dialect.separator)
                    row -= 1
        raise IndexError("the file became shorter while it was read")

    def content(self) -> Content:
        """Return the numbers with what the lines above them say."""
        header = self.layout.header
        return Content(
            path=self.source.path,
            values=self.values,
            columns=describe_columns(header, len(self.values)),
            stamp=self.layout.dialect.stamp,
            rate_hint=header.rate_hint,
            notes=(header.remark,) if header.remark else (),
            is_text=True,
            place=lambda row: f"line {self.line(row)[0]}",
            shown=self._shown,
        )

    def _shown(self, row: int, index: int) -> str:
        _, fields = self.line(row)
        field = fields[index] if index < len(fields) else ""
        return f"'{shortened(field)}'" if field else "an empty field"


def read_table(
    source: Source,
    progress: Progress | None = None,
    room: Callable[[tuple[int, int]], Floats] = np.empty,
) -> Table:
    """Return all rows of numbers in a text file.

    Parameters
    ----------
    source : Source
        The file.
    progress : callable, optional
        Called with the share of the file that has been read, 0 to 1.
    room : callable
        Gives an array of a shape.

    Raises
    ------
    RecordingError
        If the file has no rows of numbers, or a line among them is none.
    """
    layout = layout_of(source)
    collected = _Rows(layout.dialect.columns, room)
    done, size = 0, max(source.size_hint(), 1)
    for block, values in parsed_blocks(source, layout):
        done += len(block.text)
        if not collected.capacity:
            collected.reserve(int(_MARGIN * len(values) * max(1.0, size / len(block.text))) + 1000)
        collected.append(values)
        if progress is not None:
            progress(min(1.0, done / size))
    if progress is not None:
        progress(1.0)
    return Table(source=source, layout=layout, values=collected.values())


class _Rows:
    """Rows gathered into one array with the columns apart."""

    def __init__(self, columns: int, room: Callable[[tuple[int, int]], Floats]) -> None:
        self._room = room
        self._array = np.empty((columns, 0))
        self._count = 0

    @property
    def capacity(self) -> int:
        return self._array.shape[1]

    def reserve(self, capacity: int) -> None:
        array = self._room((len(self._array), capacity))
        array[:, : self._count] = self._array[:, : self._count]
        self._array = array

    def append(self, values: Floats) -> None:
        end = self._count + len(values)
        if end > self.capacity:
            self.reserve(end + self.capacity // 2)
        self._array[:, self._count : end] = values.T
        self._count = end

    def values(self) -> Floats:
        return self._array[:, : self._count]


def parsed_blocks(source: Source, layout: Layout) -> Iterator[tuple[Block, Floats]]:
    """Yield the blocks with their rows, in order; the plain ones are parsed ahead by threads.

    Parameters
    ----------
    source : Source
        The file.
    layout : Layout
        Where and how the rows are written.

    Yields
    ------
    block : Block
        Lines.
    values : ndarray of float64, shape (rows, columns)
        Their numbers; NaN where one is missing.

    Raises
    ------
    RecordingError
        If a line among the rows is none.
    """
    blocks = _blocks_from(source.blocks(), layout.first_line)
    parse = partial(parse_rows, dialect=layout.dialect)
    labels = _labels(layout)
    recent: deque[bytes] = deque()
    empty_line = 0
    for block, plain in _parsed_ahead(blocks, source, parse):
        if not block.closed:
            _check_end(source.path, b"".join(recent), block, layout)
        if plain is None or (empty_line and len(plain)):
            rows = read_rows(source.path, block, layout.dialect, labels, empty_line)
            plain, empty_line = rows.values, rows.empty_line
        recent.append(block.text)
        while sum(map(len, recent)) - len(recent[0]) > _CUT_CHECK_BYTES:
            recent.popleft()
        yield block, plain


def _parsed_ahead(
    blocks: Iterator[Block], source: Source, parse: Callable[[bytes], Floats | None]
) -> Iterator[tuple[Block, Floats | None]]:
    threads = min(os.cpu_count() or 1, _MOST_THREADS)
    if threads == 1 or source.size_hint() < _THREADED_BYTES:
        for block in blocks:
            yield block, parse(block.text)
        return
    from concurrent.futures import ThreadPoolExecutor  # small files do without

    # The C library keeps freed memory up to the largest piece it ever gave back, instead of handing
    # every array of every block to the system and asking for it again.
    np.empty(_KEPT_BYTES, np.uint8)
    waiting: deque[tuple[Block, Future[Floats | None]]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        for block in blocks:
            waiting.append((block, pool.submit(parse, block.text)))
            if len(waiting) > threads:
                first, future = waiting.popleft()
                yield first, future.result()
        for first, future in waiting:
            yield first, future.result()


def _blocks_from(blocks: Iterator[Block], line: int) -> Iterator[Block]:
    """Yield the blocks from the given line on."""
    for block in blocks:
        skipped = line - block.first_line
        if skipped <= 0:
            yield block
            continue
        parts = block.text.split(b"\n", skipped)
        if len(parts) > skipped and parts[-1]:
            yield replace(block, text=parts[-1], first_line=line)


def layout_of(source: Source) -> Layout:
    """Return the layout, from as much of the beginning of the file as it takes.

    Raises
    ------
    RecordingError
        If there are no rows of numbers.
    """
    text, enough = b"", _HEAD_BYTES
    for block in source.blocks(_HEAD_BYTES):
        text += block.text
        if len(text) < enough:
            continue
        enough *= 4
        layout = _layout_of(source.path, text)
        if layout is not None and text.count(b"\n") - layout.first_line >= _ROWS_TO_JUDGE:
            return layout
        if enough > _LONGEST_PREAMBLE:
            break
    layout = _layout_of(source.path, text)
    if layout is None:
        raise RecordingError(f"{source.path}: {_why_no_table(decoded(text).split(chr(10))[:-1])}")
    return layout


def _layout_of(path: str, text: bytes) -> Layout | None:
    return find_layout(path, decoded(text).split("\n")[:-1])


def _labels(layout: Layout) -> list[str]:
    names = layout.header.names or ("",) * layout.dialect.columns
    return [
        f"column {number} ('{shortened(name)}')" if name else f"column {number}"
        for number, name in enumerate(names, 1)
    ]


def _check_end(path: str, before: bytes, block: Block, layout: Layout) -> None:
    if len(before) > _CUT_CHECK_BYTES:
        before = before[-_CUT_CHECK_BYTES:].partition(b"\n")[2]
    text = before + block.text
    lines = decoded(text).split("\n")[:-1]
    number = block.first_line + block.text.count(b"\n") - 1
    check_last_line(path, lines, number, layout.dialect)


def _why_no_table(lines: Sequence[str]) -> str:
    """Say what a text without rows of numbers holds instead."""
    filled = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    found = _text_column(filled)
    if found is not None:
        return found
    number, text = filled[-1]
    what = "only a header, no rows of numbers" if len(filled) <= 2 else "no rows of numbers"
    return (
        f"{what} in its {counted(len(lines), 'line')} (line {number} reads "
        f"'{shortened(text.strip())}'); a recording has one line of numbers per sample"
    )


def _text_column(lines: Sequence[tuple[int, str]]) -> str | None:
    """Say which column holds text, if the last lines are rows of numbers but for it."""
    for separator in ("\t", ";", ","):
        rows = [(number, split_fields(line, separator)) for number, line in lines[-20:]]
        number, fields = rows[-1]
        numeric = sum(is_number(field, ".") or is_number(field, ",") for field in fields)
        if numeric == 0 or len(rows) < 3 or len({len(row) for _, row in rows[-3:]}) > 1:
            continue
        for index, field in enumerate(fields, 1):
            if field and not is_number(field, ".") and not is_number(field, ","):
                return (
                    f"line {number}, column {index}: '{shortened(field)}' is not a number, as in "
                    "the lines above; take that column out"
                )
    return None
