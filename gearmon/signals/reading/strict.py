"""Large plain files in one go through the parser of polars, which is nearly as strict as wanted.

It rounds correctly, uses all cores and refuses what is no number: blanks inside a field, zero
bytes, quotes, remarks, fields too many. Blank lines and fields that are missing come out as nulls.
Two things it passes over, and another thread looks for these meanwhile: a carriage return before a
separator, and a decimal point where commas are meant. A single column with decimal points has
neither.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from gearmon.signals.reading.byte_scan import has_lone_return, pieces
from gearmon.signals.reading.dialect import Dialect
from gearmon.signals.reading.rounding import Floats

# The first version whose numbers and refusals were compared with those of the careful reader.
_STRICT_SINCE = (2, 1)
_NO_SEPARATOR = "\x1f"


def is_at_hand(*, load: bool) -> bool:
    """Tell whether a polars that is known to be strict is loaded, or installed if `load`."""
    if "polars" not in sys.modules and not (load and importlib.util.find_spec("polars")):
        return False
    version = str(importlib.import_module("polars").__version__).split(".")
    return tuple(int(part) for part in version[:2] if part.isdigit()) >= _STRICT_SINCE


def parse_strictly(path: str, dialect: Dialect, first_line: int) -> Floats | None:
    """Return all rows of numbers of a file, or None if anything about it is in doubt.

    Parameters
    ----------
    path : str
        The file: UTF-8 without a mark.
    dialect : Dialect
        How its rows are written: no separator at their ends, no time stamps, no blanks that
        separate.
    first_line : int > 0
        The line of the first row; above it only line feeds end lines.

    Returns
    -------
    ndarray of float64, shape (columns, rows), or None
    """
    commas = dialect.decimal == "," != dialect.separator
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        looked_at = commas or dialect.columns > 1
        doubtful = pool.submit(_is_doubtful, path, commas=commas) if looked_at else None
        columns = _columns(path, dialect, first_line, commas=commas)
        if columns is None or (doubtful is not None and doubtful.result()):
            return None
        return _as_rows(columns, pool)


def _columns(path: str, dialect: Dialect, first_line: int, *, commas: bool) -> list[Any] | None:
    polars = importlib.import_module("polars")
    try:
        frame = polars.read_csv(
            os.path.abspath(path),
            has_header=False,
            skip_lines=first_line - 1,
            schema={str(number): polars.Float64 for number in range(dialect.columns)},
            separator=dialect.separator or _NO_SEPARATOR,
            decimal_comma=commas,
            quote_char=None,
            glob=False,
        )
    except (polars.exceptions.PolarsError, OSError):  # any text that is no number
        return None
    columns: list[Any] = frame.get_columns()
    missing = frame.height == 0 or any(column.null_count() for column in columns)
    return None if missing else columns


def _as_rows(columns: list[Any], pool: ThreadPoolExecutor) -> Floats:
    """Return columns, which are used up, as rows of one array."""
    values = np.empty((len(columns), len(columns[0])))

    def copy(row: int) -> None:
        place = 0
        for part in columns[row].get_chunks():
            values[row, place : place + len(part)] = part.to_numpy()
            place += len(part)
        columns[row] = None

    list(pool.map(copy, range(len(columns))))
    return values


def _is_doubtful(path: str, *, commas: bool) -> bool:
    """Tell whether a carriage return stands alone, or a point where commas are decimal."""
    return any(has_lone_return(piece) or (commas and b"." in piece.text) for piece in pieces(path))
