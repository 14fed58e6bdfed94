"""Blocks of rows as `digits` wants them: no quotes, no blanks, no separators at the line ends."""

from __future__ import annotations

import re

import numpy as np

from gearmon.signals.reading.compiled import parse_compiled
from gearmon.signals.reading.dialect import Dialect
from gearmon.signals.reading.digits import parse_block
from gearmon.signals.reading.rounding import Floats
from gearmon.signals.reading.short_fields import parse_short_fields

_NO_SEPARATOR = "\0"
_BLANK_LINES = re.compile(rb"\n{2,}")
_NEWLINE, _SPACE, _TAB, _QUOTE = b'\n \t"'


def parse_plain(text: bytes, dialect: Dialect, *, compiled: bool = False) -> Floats | None:
    """Return the rows of numbers in a block of lines, or None if a line needs a closer look.

    Parameters
    ----------
    text : bytes
        Whole lines.
    dialect : Dialect
        How they are written.
    compiled : bool
        Whether to try the parser that is quicker for long numbers first.

    Returns
    -------
    ndarray of float64, shape (rows, columns), or None
    """
    if dialect.stamp is not None or b"#" in text or b"%" in text:
        return None
    bare = _bare(text, dialect)
    if bare is None:
        return None
    values = parse_compiled(bare, dialect) if compiled else None
    if values is None:
        values = _parsed(bare, dialect)
    # Blank lines are looked for only now, as most blocks have none. In a single column one may
    # stand for a missing number.
    if values is None and dialect.columns > 1:
        dense = _BLANK_LINES.sub(b"\n", bare).lstrip(b"\n")
        values = _parsed(dense, dialect) if dense else np.empty((0, dialect.columns))
    return values


def _parsed(text: bytes, dialect: Dialect) -> Floats | None:
    decimal = "." if dialect.separator == dialect.decimal else dialect.decimal
    separator = dialect.separator or _NO_SEPARATOR
    values = parse_short_fields(text, dialect.columns, separator, decimal)
    if values is None:
        values = parse_block(text, dialect.columns, separator, decimal)
    return values


def _bare(text: bytes, dialect: Dialect) -> bytes | None:
    """Return the text without blanks, quotes and separators at the line ends."""
    separator = dialect.separator.encode()
    bare: bytes | None = text
    if _has_blanks(text, dialect.separator):
        bare = _squeezed(text, dialect.separator)
    if bare is not None and (b'"' in bare or dialect.separator == dialect.decimal):
        bare = _unquoted(bare, dialect)
    if bare is None or not dialect.trailing:
        return bare
    if bare.startswith(separator) or b"\n" + separator in bare:
        return None  # perhaps a row of empty fields only
    while separator + b"\n" in bare:
        bare = bare.replace(separator + b"\n", b"\n")
    return bare


def _unquoted(text: bytes, dialect: Dialect) -> bytes | None:
    """Return the text without the quotes round whole fields; None if there are others."""
    characters = np.frombuffer(b"\n" + text, np.uint8).copy()
    quotes = np.flatnonzero(characters == _QUOTE)
    begins, ends = quotes[0::2], quotes[1::2]
    edges = characters == _NEWLINE
    if dialect.separator == dialect.decimal:  # quotes protect decimal commas: "1,5" -> 1.5
        commas = np.flatnonzero(characters == ord(dialect.separator))
        protected = np.searchsorted(quotes, commas) % 2 == 1
        if b"." in text:
            return None
        characters[commas[protected]] = ord(".")
    edges |= characters == ord(dialect.separator or "\n")
    bounds = np.flatnonzero(edges)
    whole = len(quotes) % 2 == 0 and edges[begins - 1].all() and edges[ends + 1].all()
    if not whole or (ends == begins + 1).any():
        return None
    if (np.searchsorted(bounds, begins) != np.searchsorted(bounds, ends)).any():
        return None
    unquoted: bytes = characters[characters != _QUOTE][1:].tobytes()
    return unquoted


def _has_blanks(text: bytes, separator: str) -> bool:
    if separator != " ":
        return b" " in text or (separator != "\t" and b"\t" in text)
    irregular = any(pattern in text for pattern in (b"  ", b"\t", b" \n", b"\n "))
    return irregular or text.startswith(b" ")


def _squeezed(text: bytes, separator: str) -> bytes | None:
    """Return the text without the blanks beside separators and line ends.

    Where blanks separate, one space is left of each run. Blanks inside a field give None.
    """
    characters = np.frombuffer(b"\n" + text, np.uint8).copy()
    blank = characters == _SPACE
    if separator != "\t":
        blank |= characters == _TAB
    edges = np.flatnonzero(np.diff(blank)) + 1
    begins, ends = edges[0::2], edges[1::2]
    outer = (characters[begins - 1] == _NEWLINE) | (characters[ends] == _NEWLINE)
    if separator == " ":
        kept = begins[~outer]
        characters[kept] = _SPACE
        blank[kept] = False
    else:
        beside = ord(separator) if separator else _NEWLINE
        outer |= (characters[begins - 1] == beside) | (characters[ends] == beside)
        if not outer.all():
            return None
    squeezed: bytes = characters[~blank][1:].tobytes()
    return squeezed
