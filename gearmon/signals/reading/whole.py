"""Large plain files in one go through the parallel parser of pandas, where nothing is in doubt.

The parser of pandas 3.1 rounds correctly and uses all cores. It is lenient in ways that are not
wanted here, so the bytes of the file are looked at first: as many line ends as there come out rows,
no blanks or zero bytes, no exponent of more than four digits. What fails any of this, or is no
number to pandas (a field that is missing neither), is left to the blocks, which say what is wrong
and where.

The parser takes about three times the memory of the numbers while it works.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
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
_PIECE = 64 * 1024
_AHEAD = 16  # bytes beyond a piece: an exponent at its end is seen whole
_NO_QUOTES: Literal[3] = 3
_SPACE, _NEWLINE, _TAB, _RETURN = b" \n\t\r"
_UPPER_E, _LOWER_E, _TO_LOWER = ord("E"), ord("e"), 0x20
_LONGEST_EXPONENT = 4
_TAIL = 64 * 1024


@dataclass(frozen=True, kw_only=True)
class _Counts:
    lines: int
    returns: int
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
    counts = _count(source.path, begin, len(text), tabbed=dialect.separator == "\t")
    rows = counts.lines + int(text[-1] != _NEWLINE)
    if not counts.clean:
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


def _count(path: str, begin: int, end: int, *, tabbed: bool) -> _Counts:
    """Count what ends lines, and look for what is left to the blocks, with all cores."""
    starts = range(begin, end, _SHARE)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = list(
            pool.map(
                lambda start: _counted(path, start, min(start + _SHARE, end), tabbed=tabbed),
                starts,
            )
        )
    return _Counts(
        lines=sum(one.lines for one in found),
        returns=sum(one.returns for one in found),
        clean=all(one.clean for one in found),
    )


def _counted(path: str, begin: int, end: int, *, tabbed: bool) -> _Counts:
    lines = returns = 0
    # used again and again, so that they stay in the cache; mapped pages would cost more than this
    held, mask = bytearray(_PIECE + _AHEAD), np.empty(_PIECE, np.bool_)
    text = np.frombuffer(held, np.uint8)
    clean = True
    for start, got in _pieces(path, begin, end, held):
        wanted = min(_PIECE, end - start)
        if got < wanted:
            return _Counts(lines=0, returns=0, clean=False)  # cut while it is read
        piece, own = text[:wanted], mask[:wanted]
        ends = int(np.count_nonzero(np.equal(piece, _NEWLINE, out=own)))
        blanks = int(np.count_nonzero(np.less_equal(piece, _SPACE, out=own))) - ends
        if blanks and tabbed:
            blanks -= int(np.count_nonzero(np.equal(piece, _TAB, out=own)))
        if blanks:
            turns = int(np.count_nonzero(np.equal(piece, _RETURN, out=own)))
            clean &= blanks == turns
            returns += turns
        lines += ends
        if piece.max() >= _UPPER_E:
            letters = np.flatnonzero(np.greater_equal(piece, _UPPER_E, out=own))
            exponents = letters[piece[letters] | _TO_LOWER == _LOWER_E]
            clean &= not _has_long_exponent(text[:got], exponents)
    return _Counts(lines=lines, returns=returns, clean=clean)


def _pieces(path: str, begin: int, end: int, held: bytearray) -> Iterator[tuple[int, int]]:
    """Read a stretch of a file piece by piece; yield where each begins, and how many bytes came."""
    with open(path, "rb", buffering=0) as file:
        for start in range(begin, end, _PIECE):
            file.seek(start)
            yield start, file.readinto(held)


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
