"""How a table of numbers is written: separator, decimal character, number of columns, first row."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

from gearmon.errors import RecordingError
from gearmon.signals.reading.fields import (
    is_comment,
    is_missing,
    is_number,
    shortened,
    split_fields,
    to_microseconds,
    without_empty_end,
)
from gearmon.signals.reading.header import Header, find_header, is_marker, joined_lines

# Lines that are looked at to find the dialect; the last ones, as those are rows most surely.
_SAMPLE = 100
_SEPARATORS = ("\t", ";", ",", " ", "")
_EMPTY = ' \t,;"'
_MOST_COLUMNS = 1000
# What may follow a decimal comma.
_DECIMALS = re.compile(r"\d+([eE][+-]?\d+)?")
_ONE_NAME = re.compile(r"\S+(?:\s*[\[(].*[\])])?")


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How rows of numbers are written.

    Parameters
    ----------
    separator : str
        "," or ";" or a tab; " " for any run of spaces and tabs; "" for one number in a line.
    decimal : str
        "." or ",".
    columns : int > 0
        Numbers in a row.
    trailing : bool
        Whether separators follow the last number.
    stamp : int or None
        Index of a column of dates and times or times of day.
    stamp_origin : int
        The first of these stamps, in microseconds.
    """

    separator: str
    decimal: str
    columns: int
    trailing: bool = False
    stamp: int | None = None
    stamp_origin: int = 0

    def row(self, line: str) -> list[str] | None:
        """Return the fields of the line if it is a row of this table, else None."""
        fields = _row(line, self.separator, self.decimal)
        return fields if fields is not None and self.fits(fields) else None

    def fits(self, fields: Sequence[str]) -> bool:
        """Tell whether the number of fields is right; empty ones may follow."""
        return len(fields) >= self.columns and not any(fields[self.columns :])


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Where the rows of a table begin, how they are written, and what stands above them."""

    dialect: Dialect
    first_line: int
    header: Header


def find_layout(path: str, lines: Sequence[str]) -> Layout | None:
    """Return the layout of the table of numbers in the lines; None if there is no row of numbers.

    Parameters
    ----------
    path : str
        The file, for messages.
    lines : sequence of str
        The beginning of the file, from its first line on.

    Raises
    ------
    RecordingError
        If the beginning can be read in two ways, or its first rows are damaged.
    """
    sample = _sample(lines, _SAMPLE)
    dialect = _most_likely(sample)
    if dialect is None:  # a text below the rows?
        sample = _sample(lines, len(lines))
        dialect = _most_likely(sample)
    if dialect is None:
        return None
    _check_width(path, dialect)
    first, above = _first_row(path, lines, dialect)
    above = _joined(path, above, dialect)
    dialect = _clear_decimals(path, dialect, sample, above)
    dialect = _widened(dialect, sample, above)
    header = find_header(path, above, dialect.separator, dialect.decimal, dialect.columns)
    layout = Layout(dialect=dialect, first_line=first, header=header)
    return _with_counted_names(layout, lines)


def _sample(lines: Sequence[str], count: int) -> list[str]:
    """Return the last lines that are neither remarks nor empty."""
    filled = (line for line in reversed(lines) if line.strip(_EMPTY) and not is_comment(line))
    return list(islice(filled, count))[::-1]


def _most_likely(sample: Sequence[str]) -> Dialect | None:
    """Return the dialect in which most lines of the sample are rows of one length."""
    text = "\n".join(sample)
    best, most = None, 0
    for separator in _SEPARATORS:
        for decimal in ".,":
            quoted = '"' in text
            if decimal == "," and ("," not in text or (separator == "," and not quoted)):
                continue
            dialect, count = _fitted(sample, separator, decimal)
            if count > most:
                best, most = dialect, count
    return best


def _fitted(sample: Sequence[str], separator: str, decimal: str) -> tuple[Dialect | None, int]:
    rows = [(line, row) for line in sample if (row := _row(line, separator, decimal)) is not None]
    if not rows or 2 * sum(_has(line, separator) for line, _ in rows) < len(rows):
        return None, 0
    length, count = Counter(len(row) for _, row in rows).most_common(1)[0]
    alike = [row for _, row in rows if len(row) == length]
    columns = max(len(without_empty_end(row)) for row in alike)
    stamp, origin = _stamp(alike[0])
    dialect = Dialect(
        separator=separator,
        decimal=decimal,
        columns=columns,
        trailing=length > columns,
        stamp=stamp,
        stamp_origin=origin,
    )
    return dialect, count


def _row(line: str, separator: str, decimal: str) -> list[str] | None:
    """Return the fields if each is a number, a time stamp or missing, and not all are missing."""
    fields = split_fields(line, separator)
    stamps_allowed = separator not in ("", " ")
    for field in fields:
        if not (is_number(field, decimal) or is_missing(field)):
            if not stamps_allowed or to_microseconds(field) is None:
                return None
            stamps_allowed = False  # one such column at most
    return fields if any(_says_number(field) for field in fields) else None


def _says_number(field: str) -> bool:
    # A line of dashes is no row; one of NaN is.
    return any(character.isdigit() for character in field) or field[-3:].lower() in ("nan", "inf")


def _has(line: str, separator: str) -> bool:
    if separator == " ":
        return len(line.split(maxsplit=1)) > 1
    return separator in line


def _stamp(row: Sequence[str]) -> tuple[int | None, int]:
    for index, field in enumerate(row):
        moment = to_microseconds(field)
        if moment is not None:
            return index, moment
    return None, 0


def _check_width(path: str, dialect: Dialect) -> None:
    if dialect.columns > _MOST_COLUMNS:
        raise RecordingError(
            f"{path}: {dialect.columns} numbers in a line; a recording needs one line per sample "
            "and one column per channel: transpose it"
        )


def _first_row(
    path: str, lines: Sequence[str], dialect: Dialect
) -> tuple[int, list[tuple[int, str]]]:
    """Return the number of the first row, and the lines of text above it with their numbers."""
    above: list[tuple[int, str]] = []
    odd: tuple[int, int] | None = None
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        row = None if is_comment(line) else _row(line, dialect.separator, dialect.decimal)
        if row is None:
            above.append((number, line.strip().lstrip("#% \t") if is_comment(line) else line))
            odd = None
        elif dialect.fits(row):
            _check_no_odd_row(path, odd, dialect.columns)
            return number, above
        else:
            odd = odd or (number, len(without_empty_end(row)))
    raise AssertionError("the sample has a row, so the lines have one")


def _joined(path: str, above: list[tuple[int, str]], dialect: Dialect) -> list[tuple[int, str]]:
    """Put parted lines of names together; raise if it is a row of numbers that is parted."""
    joined = joined_lines(above)
    for number, text in joined:
        if (number, text) not in above and dialect.row(text) is not None:
            raise RecordingError(
                f"{path}, line {number}: a line break within quotes parts this row of numbers; "
                "take it out"
            )
    return joined


def _check_no_odd_row(path: str, odd: tuple[int, int] | None, columns: int) -> None:
    if odd is not None:
        number, count = odd
        raise RecordingError(
            f"{path}, line {number}: {counted(count, 'number')} where the rows below have "
            f"{columns}; if this line is no sample, put # before it"
        )


def counted(count: int, noun: str) -> str:
    """Return the number with its noun, in the plural where needed."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _widened(dialect: Dialect, sample: Sequence[str], above: Sequence[tuple[int, str]]) -> Dialect:
    """Count columns that have a name but no number in any row."""
    if not dialect.trailing or not above:
        return dialect
    named = len(without_empty_end(split_fields(above[-1][1], dialect.separator)))
    rows = [row for line in sample if (row := dialect.row(line)) is not None]
    length = min(len(row) for row in rows)
    if not dialect.columns < named <= length:
        return dialect
    return replace(dialect, columns=named, trailing=length > named)


def _clear_decimals(
    path: str, dialect: Dialect, sample: Sequence[str], above: Sequence[tuple[int, str]]
) -> Dialect:
    """Tell ``1,5`` as one number with a decimal comma from two whole numbers, or raise."""
    if dialect.separator != "," or dialect.decimal != "." or dialect.columns != 2:
        return dialect
    lines = [line for line in sample if dialect.row(line) is not None]
    rows = [split_fields(line, ",")[:2] for line in lines]
    if not _may_be_decimals(lines, rows):
        return dialect
    verdict = _header_verdict(above) if above else None
    if verdict is None and not all(second.isdigit() for _, second in rows):
        return dialect  # 1e-5 stands by itself more often than 0,1e-5 does
    if verdict is None:
        verdict = _digit_verdict(rows)
    if verdict is None:
        raise RecordingError(
            f"{path}: its lines, such as '{shortened(','.join(rows[0]))}', may be one column with "
            "decimal commas or two columns of whole numbers; add a first line that names the "
            "column(s)"
        )
    if verdict == 2:
        return dialect
    return replace(dialect, separator="", decimal=",", columns=1, trailing=False)


def _may_be_decimals(lines: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    plain = all(
        first.lstrip("+-").isdigit() and _DECIMALS.fullmatch(second) for first, second in rows
    )
    return plain and not any(mark in line.strip() for line in lines for mark in ' "')


def _header_verdict(above: Sequence[tuple[int, str]]) -> int | None:
    """Return the number of columns that the last line of text names, if it names any."""
    names = without_empty_end(split_fields(above[-1][1], ","))
    if ":" in above[-1][1] or "=" in above[-1][1] or is_marker(above[-1][1]):
        return None
    if len(names) == 1 and _ONE_NAME.fullmatch(names[0]) is None:
        return None
    return len(names) if len(names) in (1, 2) else None


def _digit_verdict(rows: Sequence[Sequence[str]]) -> int | None:
    """Return 1 column or 2, from how the digits behave; None if they may be either."""
    if any(first in ("-0", "+0") or (second[0] == "0" and second != "0") for first, second in rows):
        return 1  # whole numbers are not written -0 or 05
    seconds = {second for _, second in rows}
    if len(rows) >= 50 and max(map(len, seconds)) >= 2:
        return 2  # of so many decimals some would begin with 0
    return None


def _with_counted_names(layout: Layout, lines: Sequence[str]) -> Layout:
    """Take a first row 0, 1, 2 ... above rows of decimals as the names that it is."""
    dialect = layout.dialect
    if layout.header.names is not None or dialect.columns < 3:
        return layout
    numbered = [
        (number, row)
        for number, line in enumerate(lines, 1)
        if number >= layout.first_line and (row := dialect.row(line)) is not None
    ]
    (_, names), later = numbered[0], numbered[1 : _SAMPLE + 1]
    start = names[0]
    if start not in ("0", "1") or names != [str(int(start) + k) for k in range(dialect.columns)]:
        return layout
    if len(later) < 5 or any(field.isdigit() for _, row in later for field in row):
        return layout
    header = Header(names=tuple(names), line=layout.first_line)
    return replace(layout, first_line=later[0][0], header=header)
