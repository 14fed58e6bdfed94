"""Rows read line by line: slow, and able to say what is wrong and where."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.dialect import Dialect, counted
from gearmon.signals.reading.fields import (
    is_comment,
    is_missing,
    is_number,
    split_fields,
    to_microseconds,
    to_number,
    without_empty_end,
)
from gearmon.signals.reading.header import shortened
from gearmon.signals.reading.rounding import Floats
from gearmon.signals.reading.source import Block

# Rows whose last fields are compared to see whether the very last one is cut off.
_ENOUGH_ROWS, _MOST_ROWS = 50, 200
_CUT_NUMBER = re.compile(r"[+-]?(?:[0-9]*(?:[.,][0-9]*)?[eEdD])?[+-]?|[+-]?[.,]")
_REMEDY = "correct it, or put # before the line if it is no sample"


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Rows of a block.

    Parameters
    ----------
    values : ndarray of float64, shape (rows, columns)
        NaN where a value is missing.
    empty_line : int
        Number of a line with empty fields only after the last row; 0 if there is none.
    """

    values: Floats
    empty_line: int = 0


def decoded(text: bytes) -> str:
    """Return the text: UTF-8 if it is valid, otherwise Western European."""
    try:
        return text.decode()
    except UnicodeDecodeError:
        return text.decode("cp1252", errors="replace")


def read_rows(
    path: str, block: Block, dialect: Dialect, labels: Sequence[str], empty_line: int = 0
) -> Rows:
    """Return the rows of a block, read line by line.

    Parameters
    ----------
    path : str
        The file, for messages.
    block : Block
        Lines from the first row on.
    dialect : Dialect
        How they are written.
    labels : sequence of str
        How to call each column in messages.
    empty_line : int
        Number of an empty row before this block; 0 if there is none.

    Raises
    ------
    RecordingError
        At the first line that is neither a row nor blank nor a remark.
    """
    values: list[list[float]] = []
    for number, line in enumerate(decoded(block.text).split("\n")[:-1], block.first_line):
        where = f"{path}, line {number}"
        fields = _fields(where, line, dialect)
        if fields is None:
            continue
        if not any(fields):
            empty_line = empty_line or number
            continue
        if empty_line:
            raise RecordingError(
                f"{path}, line {empty_line}: empty between samples; was a sample lost? If not, "
                "delete the line"
            )
        _check_count(where, fields, dialect)
        values.append(_values(where, fields, dialect, labels))
    table = np.array(values, dtype=np.float64).reshape(-1, dialect.columns)
    return Rows(values=table, empty_line=empty_line)


def is_row(line: str, dialect: Dialect) -> bool:
    """Tell whether a line below the first row is one of the rows."""
    return bool(line.strip()) and not is_comment(line) and any(_split(line, dialect))


def _split(line: str, dialect: Dialect) -> list[str]:
    return split_fields(line, dialect.separator)


def _fields(where: str, line: str, dialect: Dialect) -> list[str] | None:
    """Return the fields of a row; None for a remark or a blank line that means nothing."""
    if "\0" in line:
        raise RecordingError(f"{where}: zero bytes; the file is damaged, copy it again")
    if is_comment(line):
        if dialect.row(line.strip().lstrip("#% \t")) is not None:
            raise RecordingError(
                f"{where}: a sample is taken out by '{line.strip()[0]}', so those after it come "
                "too early; restore it, or cut the file there"
            )
        return None
    if not line.strip():
        return [""] if dialect.columns == 1 else None
    return _split(line, dialect)


def _check_count(where: str, fields: Sequence[str], dialect: Dialect) -> None:
    if dialect.fits(fields):
        return
    count = len(without_empty_end(list(fields)))
    if not any(is_number(field, dialect.decimal) for field in fields):
        text = shortened(" ".join(fields).strip())
        raise RecordingError(f"{where}: '{text}' is not a number; {_REMEDY}")
    raise RecordingError(
        f"{where}: {counted(count, 'field')} where the table has "
        f"{counted(dialect.columns, 'column')}; {_REMEDY}"
    )


def _values(
    where: str, fields: Sequence[str], dialect: Dialect, labels: Sequence[str]
) -> list[float]:
    values = []
    for index, field in enumerate(fields[: dialect.columns]):
        value = _stamp(field, dialect) if index == dialect.stamp else _number(field, dialect)
        if value is None:
            what = "time stamp" if index == dialect.stamp else "number"
            raise RecordingError(
                f"{where}, {labels[index]}: '{shortened(field)}' is not a {what}; {_REMEDY}"
            )
        values.append(value)
    return values


def _number(field: str, dialect: Dialect) -> float | None:
    if is_number(field, dialect.decimal):
        return to_number(field, dialect.decimal)
    return float("nan") if is_missing(field) else None


def _stamp(field: str, dialect: Dialect) -> float | None:
    moment = to_microseconds(field)
    if moment is None:
        return float("nan") if is_missing(field) else None
    return (moment - dialect.stamp_origin) / 1e6


def check_last_line(path: str, lines: Sequence[str], number: int, dialect: Dialect) -> None:
    """Raise if the last line, which has no line end, is visibly cut off.

    Parameters
    ----------
    path : str
        The file, for messages.
    lines : sequence of str
        The last line and the lines before it.
    number : int
        Number of the last line.
    dialect : Dialect
        How they are written.

    Raises
    ------
    RecordingError
        If fields are missing, or the last number is shorter than those above it always are.
    """
    last = _split(lines[-1], dialect)
    if is_comment(lines[-1]) or not any(last):
        return
    above = [_split(line, dialect) for line in lines[-_MOST_ROWS - 1 : -1] if is_row(line, dialect)]
    reason = _cut(last, above, dialect)
    if reason:
        raise RecordingError(
            f"{path}, line {number}: the file is cut off in mid-line ({reason}); delete the last "
            "line, or copy the file again"
        )


def _cut(last: Sequence[str], above: Sequence[Sequence[str]], dialect: Dialect) -> str:
    if not all(is_number(field, dialect.decimal) for field in last[: dialect.columns - 1]):
        return ""
    if len(last) < dialect.columns:
        return f"{counted(len(last), 'field')} of {dialect.columns}"
    if dialect.trailing and len(last) == dialect.columns and above:
        return "no separator at its end, as the lines above have"
    field = last[dialect.columns - 1]
    fits = dialect.fits(last)
    if fits and (_CUT_NUMBER.fullmatch(field) or _is_shorter(field, above, dialect)):
        return f"'{shortened(field)}'"
    return ""


def _is_shorter(field: str, above: Sequence[Sequence[str]], dialect: Dialect) -> bool:
    """Tell whether the field has fewer characters after the point than all above alike have."""
    endings = {_ending(row[dialect.columns - 1], dialect) for row in above if dialect.fits(row)}
    ending = _ending(field, dialect)
    if field.endswith(dialect.decimal):
        return bool(above) and not any(end == dialect.decimal for end in endings)
    return len(endings) == 1 and len(above) >= _ENOUGH_ROWS and len(ending) < len(endings.pop())


def _ending(field: str, dialect: Dialect) -> str:
    """Return the field from its decimal character on, with every digit as 0."""
    _, point, decimals = field.partition(dialect.decimal)
    return re.sub("[0-9]", "0", point + decimals)
