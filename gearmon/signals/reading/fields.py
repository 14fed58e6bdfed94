"""What counts as a number, a missing value or a time stamp in one field of a line."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
#: Told the share of a file that has been read; gives an array of a shape.
Progress = Callable[[float], object]
Room = Callable[[tuple[int, int]], Floats]

LONGEST_QUOTE = 60  # characters of a file that a message shows
_EXPONENT_LETTERS = str.maketrans("dD", "ee")
_QUOTED = re.compile(r'[ \t]*"((?:[^"]|"")*)"[ \t]*')
# Fields, with their quotes, in which a separator is no end.
_FIELDS = {
    mark: re.compile(rf'(?:^|{mark})((?:[^"{mark}]|"[^"]*(?:"|\Z))*)') for mark in "\t;,"
} | {" ": re.compile(r'((?:[^"\s]|"[^"]*(?:"|\Z))+)')}
_TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)")
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}")
_SPREADSHEET_ERROR = re.compile(r"#(n/a|nv|div/0!|wert!|value!|ref!|num!|zahl!|name\?|null!)")
# What loggers, spreadsheets and C libraries print instead of a number.
_NO_VALUE = """
    nan -nan +nan nan(ind) -nan(ind) nan(snan) 1.#qnan -1.#qnan 1.#ind -1.#ind 1.#inf -1.#inf
    inf +inf -inf infinity +infinity -infinity na n/a null none missing overflow - -- ? *
"""
MISSING = frozenset(_NO_VALUE.split())


def decoded(text: bytes) -> str:
    """Return the text: UTF-8 if it is valid, otherwise Western European."""
    try:
        return text.decode()
    except UnicodeDecodeError:
        return text.decode("cp1252", errors="replace")


def shortened(text: str) -> str:
    """Return the text, cut to what fits in a message, with no line ends or control characters."""
    begin = text[: LONGEST_QUOTE + 1]
    shown = "".join(character if character.isprintable() else "?" for character in begin)
    return shown if len(shown) <= LONGEST_QUOTE else shown[: LONGEST_QUOTE - 3] + "..."


@cache
def _number(decimal: str) -> re.Pattern[str]:
    point = re.escape(decimal)
    digits = rf"[+-]?(?:[0-9]+(?:{point}[0-9]*)?|{point}[0-9]+)"
    return re.compile(rf"{digits}(?:[eEdD][+-]?[0-9]+)?")


def is_number(field: str, decimal: str) -> bool:
    """Tell whether the field is a number: digits, one decimal character, an exponent (e or d).

    Examples
    --------
    >>> is_number("-1,5d-3", ","), is_number("1.5.2", ".")
    (True, False)
    """
    return _number(decimal).fullmatch(field) is not None


def to_number(field: str, decimal: str) -> float:
    """Return the value of a field for which `is_number` holds."""
    return float(field.replace(decimal, ".").translate(_EXPONENT_LETTERS))


def is_missing(field: str) -> bool:
    """Tell whether the field is empty or says, in a usual way, that there is no finite value."""
    return not field or field.lower() in MISSING or is_spreadsheet_error(field)


def is_spreadsheet_error(text: str) -> bool:
    """Tell whether the text begins with an error value of a spreadsheet, such as ``#N/A``."""
    return _SPREADSHEET_ERROR.match(text.lower()) is not None


def is_comment(line: str) -> bool:
    """Tell whether the line is a remark: it begins with ``#`` or ``%``."""
    text = line.lstrip()
    return text.startswith(("#", "%")) and not is_spreadsheet_error(text)


def to_microseconds(field: str) -> int | None:
    """Return a time stamp (ISO 8601 date and time, or time of day) in microseconds, or None.

    They count from midnight; for dates, from the start of the year 1, without time zones.

    Examples
    --------
    >>> to_microseconds("00:01:00.25"), to_microseconds("1.5")
    (60250000, None)
    """
    clock = _TIME_OF_DAY.fullmatch(field)
    if clock is not None:
        hours, minutes, seconds = clock.groups()
        whole = 60 * (60 * int(hours) + int(minutes))
        return 10**6 * whole + round(10**6 * float(seconds.replace(",", ".")))
    if _DATE.match(field) is None:
        return None
    from datetime import datetime, timedelta  # few recordings have dates

    try:
        moment = datetime.fromisoformat(field)
    except ValueError:
        return None
    return (moment.replace(tzinfo=None) - datetime.min) // timedelta(microseconds=1)


def split_fields(line: str, separator: str) -> list[str]:
    """Return the fields of a line, without blanks around them and without their quotes.

    Parameters
    ----------
    line : str
        One line.
    separator : str
        "," or ";" or a tab; " " for any run of spaces and tabs; "" for one field per line.

    Examples
    --------
    >>> split_fields('1; "2,5" ;', ";")
    ['1', '2,5', '']
    """
    if separator == "":
        return [_unquoted(line)]
    if '"' not in line:
        return line.split() if separator == " " else [own.strip() for own in line.split(separator)]
    return [_unquoted(part) for part in _FIELDS[separator].findall(line)]


def without_empty_end(fields: Sequence[str]) -> Sequence[str]:
    """Return the fields up to the last one that is not empty."""
    count = len(fields)
    while count and not fields[count - 1]:
        count -= 1
    return fields[:count]


def _unquoted(field: str) -> str:
    match = _QUOTED.fullmatch(field)
    return match[1].replace('""', '"').strip() if match else field.strip()
