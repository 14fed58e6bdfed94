"""Blocks of long numbers through the compiled parser of pandas, with every doubt left to others.

From 17 digits on, array operations need more than twice as long as compiled code. The parser of
pandas 3.1 rounds correctly; what it makes of damaged lines differs from what is wanted here, so
its result counts only where nothing can have gone wrong: as many rows as lines, as many numbers in
each as the table has columns, all finite, no blanks, no byte that ends a field early, no exponent
of more than four digits.
"""

from __future__ import annotations

import io
import re
import sys
from typing import Literal

import numpy as np

from gearmon.signals.reading.dialect import Dialect
from gearmon.signals.reading.rounding import Floats

BLOCK_BYTES = 1024 * 1024
# Loading pandas costs as much as it saves in a file of this size.
_WORTH_LOADING = 192 * 1024 * 1024
_WORTH_CALLING = 8 * 1024 * 1024
_LONG_FIELD = 17
_EXACT_SINCE = (3, 1)
_NO_QUOTES: Literal[3] = 3
# one letter each: a search for one given byte is ten times as fast as for one of two
_LONG_EXPONENTS = {letter: re.compile(letter + rb"[+-]?[0-9]{5}") for letter in (b"e", b"E")}


def is_worthwhile(sample: bytes, dialect: Dialect, size: int) -> bool:
    """Tell whether a file gains by the compiled parser.

    Parameters
    ----------
    sample : bytes
        Some lines.
    dialect : Dialect
        How they are written.
    size : int
        Bytes of the file.
    """
    plain = dialect.stamp is None and dialect.separator != " "
    fields = sample.count(b"\n") * dialect.columns
    if not plain or fields == 0 or len(sample) / fields <= _LONG_FIELD:
        return False
    least = _WORTH_CALLING if "pandas" in sys.modules else _WORTH_LOADING
    return size >= least and is_exact()


def is_exact() -> bool:
    """Tell whether the installed pandas rounds every number correctly."""
    import pandas

    version = tuple(int(part) for part in pandas.__version__.split(".")[:2])
    return version >= _EXACT_SINCE


def parse_compiled(text: bytes, dialect: Dialect) -> Floats | None:
    """Return the rows of numbers in a block of lines, or None if any of them is in doubt.

    Parameters
    ----------
    text : bytes
        Whole lines, each closed by a line feed.
    dialect : Dialect
        How they are written.

    Returns
    -------
    ndarray of float64, shape (rows, columns), or None
    """
    import pandas

    if _is_doubtful(text, dialect):
        return None
    try:
        frame = pandas.read_csv(
            io.BytesIO(text),
            sep=dialect.separator or ("," if dialect.decimal != "," else ";"),
            decimal="." if dialect.decimal == dialect.separator else dialect.decimal,
            header=None,
            dtype=float,
            na_filter=False,
            quoting=_NO_QUOTES,
            skip_blank_lines=False,
            low_memory=False,
            engine="c",
        )
    except (ValueError, OverflowError):  # any text that is no number
        return None
    values: Floats = frame.to_numpy()
    lines = int(np.count_nonzero(np.frombuffer(text, np.uint8) == ord("\n")))
    if values.shape != (lines, dialect.columns):
        return None
    finite = np.isfinite(values.min()) and np.isfinite(values.max())
    return values if finite else None


def _is_doubtful(text: bytes, dialect: Dialect) -> bool:
    """Tell whether a number may be followed by what the parser passes over, or overflow."""
    blanks = b"\0\r " if dialect.separator == "\t" else b"\0\r \t"
    if any(bytes([blank]) in text for blank in blanks):
        return True
    exponents = _LONG_EXPONENTS.items()
    return any(letter in text and found.search(text) for letter, found in exponents)
