"""Large plain files in one go through the parallel parser of pandas, where nothing is in doubt.

The parser of pandas 3.1 rounds correctly and uses all cores. It is lenient in ways that are not
wanted here, so the bytes of the file are counted first: as many line ends and separators as the
table must have, no blanks or zero bytes, no exponent of more than four digits. What fails any of
this, or is no number to pandas, is left to the blocks, which say what is wrong and where.

The parser takes about three times the memory of the numbers while it works.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from gearmon.signals.reading.compiled import is_exact
from gearmon.signals.reading.dialect import Layout
from gearmon.signals.reading.rounding import Floats
from gearmon.signals.reading.source import Source

Bytes = npt.NDArray[np.uint8]

_SMALLEST, _LARGEST = 8 * 1024 * 1024, 1024 * 1024 * 1024
# Loading pandas costs as much as it saves in a file of this size.
_WORTH_LOADING = 192 * 1024 * 1024
_SHARE = 8 * 1024 * 1024  # of one thread at a time
_PIECE = 128 * 1024
_NO_QUOTES: Literal[3] = 3
_SPACE, _NEWLINE, _TAB, _RETURN = b" \n\t\r"
_LOWER_E, _TO_LOWER = ord("e"), 0x20
_LONGEST_EXPONENT = 4
_TAIL = 64 * 1024


@dataclass(frozen=True, kw_only=True)
class _Counts:
    lines: int
    returns: int
    separators: int
    clean: bool


def is_eligible(source: Source, layout: Layout) -> bool:
    """Tell whether a file may be read in one go: plain, large but not too large, pandas at hand."""
    dialect = layout.dialect
    if source.content is not None or source.zipped or source.encoding:
        return False
    if dialect.stamp is not None or dialect.trailing or dialect.separator == " ":
        return False
    least = _SMALLEST if "pandas" in sys.modules else _WORTH_LOADING
    return least <= os.path.getsize(source.path) <= _LARGEST and is_exact()


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
    import pandas

    dialect = layout.dialect
    text = np.asarray(np.memmap(source.path, np.uint8, "r"))
    begin = _start_of_line(text, layout.first_line)
    if begin is None:
        return None
    counts = _count(text[begin:], ord(dialect.separator or "\0"))
    rows = counts.lines + int(text[-1] != _NEWLINE)
    if not counts.clean or counts.separators != rows * (dialect.columns - 1):
        return None
    if counts.returns not in (0, counts.lines):  # not the line ends of one system
        return None
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
    if values.shape != (rows, dialect.columns):
        return None
    # pandas locks what it hands out; the frame ends here, so the numbers are nobody else's
    if not values.flags.writeable and (values.base is None or values.base.flags.writeable):
        values.flags.writeable = True
    by_column = np.ascontiguousarray(values.T)
    return by_column if by_column.flags.writeable else by_column.copy()


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

    A lone carriage return ends a line as well, but not here.
    """
    begin, missing = 0, line - 1
    while missing:
        if begin >= len(text):
            return None
        ends = np.flatnonzero(text[begin : begin + _PIECE] == _NEWLINE)
        if len(ends) >= missing:
            return begin + int(ends[missing - 1]) + 1
        missing -= len(ends)
        begin += _PIECE
    return begin


def _count(text: Bytes, separator: int) -> _Counts:
    """Count what makes up rows, with all cores."""
    starts = range(0, len(text), _SHARE)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = list(pool.map(lambda start: _counted(text, start, separator), starts))
    return _Counts(
        lines=sum(one.lines for one in found),
        returns=sum(one.returns for one in found),
        separators=sum(one.separators for one in found),
        clean=all(one.clean for one in found),
    )


def _counted(text: Bytes, begin: int, separator: int) -> _Counts:
    lines = returns = separators = 0
    mask = np.empty(_PIECE, np.bool_)  # used again and again: it stays in the cache
    lower = np.empty(_PIECE, np.uint8)
    clean = True
    for start in range(begin, min(begin + _SHARE, len(text)), _PIECE):
        piece = text[start : start + _PIECE]
        own, letters = mask[: len(piece)], lower[: len(piece)]
        ends = int(np.count_nonzero(np.equal(piece, _NEWLINE, out=own)))
        between = int(np.count_nonzero(np.equal(piece, separator, out=own))) if separator else 0
        blanks = int(np.count_nonzero(np.less_equal(piece, _SPACE, out=own))) - ends
        blanks -= between if separator == _TAB else 0
        if blanks:
            turns = int(np.count_nonzero(np.equal(piece, _RETURN, out=own)))
            clean &= blanks == turns
            returns += turns
        lines, separators = lines + ends, separators + between
        np.equal(np.bitwise_or(piece, _TO_LOWER, out=letters), _LOWER_E, out=own)
        if own.any():
            clean &= not _has_long_exponent(text, start + np.flatnonzero(own))
    return _Counts(lines=lines, returns=returns, separators=separators, clean=clean)


def _has_long_exponent(text: Bytes, letters: npt.NDArray[np.int64]) -> bool:
    """Tell whether more than four digits follow a sign or the letter e itself."""
    if not len(letters):
        return False
    last = len(text) - 1
    after = np.minimum(letters + 1, last)
    signed = (text[after] == ord("+")) | (text[after] == ord("-"))
    digits = np.ones(len(letters), np.bool_)
    for step in range(1, _LONGEST_EXPONENT + 2):
        characters = text[np.minimum(letters + signed + step, last)]
        digits &= characters - np.uint8(ord("0")) <= 9
    return bool(digits.any())
