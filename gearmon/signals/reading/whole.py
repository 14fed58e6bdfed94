"""Large plain files in one go through a parallel parser, where nothing is in doubt.

The parsers of pandas 3.1 and of polars round correctly and use all cores. Either is lenient in ways
that are not wanted here, so another thread looks at the bytes of the file meanwhile: for pandas at
zero bytes, at exponents of more than four digits, and at as many line ends as there come out rows;
for polars see `strict`. What fails any of this, or is no number to either (a field that is missing
neither), is left to the blocks, which say what is wrong and where.

The parsers take up to three times the memory of the numbers while they work.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Literal

import numpy as np
import numpy.typing as npt

from gearmon.signals.reading.byte_scan import (
    has_lone_return,
    has_long_exponent,
    line_feeds,
    pieces,
)
from gearmon.signals.reading.compiled import is_exact
from gearmon.signals.reading.dialect import Layout
from gearmon.signals.reading.rounding import Floats
from gearmon.signals.reading.source import Source
from gearmon.signals.reading.strict import is_at_hand, parse_strictly

Bytes = npt.NDArray[np.uint8]

_SMALLEST, _LARGEST = 8 * 1024 * 1024, 1024 * 1024 * 1024
# Loading pandas or polars costs as much as it saves in a file of this size.
_WORTH_LOADING = 192 * 1024 * 1024
# Up to so many columns polars is quicker than pandas.
_FEW_COLUMNS = 2
_PIECE = 64 * 1024
_NO_QUOTES: Literal[3] = 3
_NEWLINE = ord("\n")
_TAIL = 64 * 1024


def is_eligible(source: Source, layout: Layout) -> bool:
    """Tell whether a file may be read in one go: plain, large but not too large, parser at hand."""
    dialect = layout.dialect
    if source.content is not None or source.zipped or source.encoding:
        return False
    if dialect.stamp is not None or dialect.trailing or dialect.separator == " ":
        return False
    size = os.path.getsize(source.path)
    if not _SMALLEST <= size <= _LARGEST:
        return False
    return _parser(dialect.columns, size) is not None


def _parser(columns: int, size: int) -> Callable[[Source, Layout, int], Floats | None] | None:
    """Return the quicker parser of those that are loaded or, for a large file, installed."""
    parsers = ((is_at_hand, _by_polars), (_has_pandas, _by_pandas))
    load = size >= _WORTH_LOADING
    for has, parse in parsers if columns <= _FEW_COLUMNS else parsers[::-1]:
        if has(load=load):
            return parse
    return None


def _has_pandas(*, load: bool) -> bool:
    return ("pandas" in sys.modules or load) and is_exact()


def parse_file(source: Source, layout: Layout) -> Floats | None:
    """Return all rows of numbers of a file, or None if anything about it is in doubt.

    Parameters
    ----------
    source : Source
        The file, for which `is_eligible` holds.
    layout : Layout
        Where and how the rows are written.

    Returns
    -------
    ndarray of float64, shape (columns, rows), or None
    """
    text = np.asarray(np.memmap(source.path, np.uint8, "r"))
    begin = _start_of_line(text, layout.first_line)
    if begin is None:
        return None
    parse = _parser(layout.dialect.columns, len(text))
    del text  # its pages count as memory
    return None if parse is None else parse(source, layout, begin)


def _by_polars(source: Source, layout: Layout, begin: int) -> Floats | None:  # noqa: ARG001
    return parse_strictly(source.path, layout.dialect, layout.first_line)


def _by_pandas(source: Source, layout: Layout, begin: int) -> Floats | None:
    import pandas

    dialect = layout.dialect
    with ThreadPoolExecutor(1) as pool:
        counted = pool.submit(_lines, source.path, begin)
        try:
            frame = pandas.read_csv(
                os.path.abspath(source.path),
                sep=dialect.separator or ("," if dialect.decimal != "," else ";"),
                decimal="." if dialect.decimal == dialect.separator else dialect.decimal,
                header=None,
                skiprows=layout.first_line - 1,
                dtype=float,
                na_filter=False,
                quoting=_NO_QUOTES,
                skip_blank_lines=False,
                compression=None,
                engine="c",
            )
        except (ValueError, OverflowError):  # any text that is no number
            return None
        values: Floats = frame.to_numpy()
        if values.shape != (counted.result(), dialect.columns):
            return None
    # pandas locks what it hands out; the frame ends here, so the numbers are nobody else's
    if not values.flags.writeable and (values.base is None or values.base.flags.writeable):
        values.flags.writeable = True
    by_column = np.ascontiguousarray(values.T)
    return by_column if by_column.flags.writeable else by_column.copy()


def _lines(path: str, begin: int) -> int:
    """Return how many lines a file has from a byte on; -1 where anything in it is in doubt."""
    lines = 0
    piece = None
    for piece in pieces(path, begin):
        if b"\0" in piece.text or has_lone_return(piece) or has_long_exponent(piece):
            return -1
        lines += line_feeds(piece)
    return lines + int(piece is not None and piece.text[-1] != _NEWLINE)


def tail(source: Source) -> tuple[bytes, bool]:
    """Return the last whole lines of a file, and whether the very last one is closed."""
    with open(source.path, "rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(0, size - _TAIL))
        text = stream.read()
    whole = text if size <= _TAIL else text.partition(b"\n")[2]
    return whole, whole.endswith(b"\n")


def _start_of_line(text: Bytes, line: int) -> int | None:
    """Return where the line (counted from 1) begins; None if fewer line feeds than that are there.

    A lone carriage return ends a line as well, but not here: it gives None too.
    """
    begin, missing = 0, line - 1
    while missing:
        if begin >= len(text):
            return None
        ends = np.flatnonzero(text[begin : begin + _PIECE] == _NEWLINE)
        if len(ends) >= missing:
            begin += int(ends[missing - 1]) + 1
            above = text[:begin].tobytes()
            return begin if above.count(b"\r") == above.count(b"\r\n") else None
        missing -= len(ends)
        begin += _PIECE
    return begin
