"""The lines above the numbers: names of the columns, their units, and what else they tell."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from gearmon.errors import RecordingError
from gearmon.signals.reading.fields import (
    LONGEST_QUOTE,
    is_missing,
    is_number,
    shortened,
    split_fields,
    without_empty_end,
)
from gearmon.signals.reading.units import are_units

# Lines that announce the numbers and name no column.
_MARKERS = frozenset(
    {"data", "begin", "begin data", "start data", "data start", "end header", "header end"}
    | {"end of header", "end_of_header", "endofheader", "daten", "messdaten", "measurement data"}
)
_RATE = re.compile(
    r"sampl|abtast|\bfs\b|\brate\b|frequen|interval|\bdt\b|delta_?[tx]|schrittweite", re.IGNORECASE
)

# A quote that opens a field and is not closed in its line, and over how many lines it may reach.
_OPEN_QUOTE = re.compile(r'(?:^|[,;\s])"[^"]*$')
_MOST_PARTS = 16

Line = tuple[int, str]


@dataclass(frozen=True, kw_only=True)
class Header:
    """What the lines above the numbers say about the columns.

    Parameters
    ----------
    names : tuple of str or None
        The cells of the line of names; None if there is none.
    units : tuple of str or None
        The cells of the line of units below it.
    line : int
        Number of the line of names.
    remark : str
        Why a line that looks like names was not used.
    rate_hint : str
        The line that seems to tell the sampling rate.
    """

    names: tuple[str, ...] | None = None
    units: tuple[str, ...] | None = None
    line: int = 0
    remark: str = ""
    rate_hint: str = ""


def find_header(
    path: str, above: Sequence[Line], separator: str, decimal: str, columns: int
) -> Header:
    """Return what the lines of text above the first row say.

    Parameters
    ----------
    path : str
        The file, for messages.
    above : sequence of (int, str)
        Lines of text above the first row with their numbers; no blank ones.
    separator, decimal : str
        How the rows are written.
    columns : int > 0
        Numbers in a row.

    Raises
    ------
    RecordingError
        If the last of these lines is a row of numbers with a damaged field.
    """
    hint = _rate_hint(above)
    lines = [line for line in above if line[1] and not is_marker(line[1])]
    if not lines:
        return Header(rate_hint=hint)
    number, text = lines[-1]
    cells = _cells(text, separator, columns)
    _check_no_odd_row(path, lines[-1], separator, decimal, columns)
    if cells is None:
        return Header(remark=_remark(lines[-1], separator, columns), rate_hint=hint)
    upper = _cells(lines[-2][1], separator, columns) if len(lines) > 1 else None
    if upper is not None and _numbers(upper, decimal):
        upper = None
    if are_units(cells) and (upper is not None or cells[0].startswith(("[", "("))):
        names = None if upper is None else tuple(upper)
        line = number if upper is None else lines[-2][0]
        return Header(names=names, units=tuple(cells), line=line, rate_hint=hint)
    if _numbers(cells, decimal) and not _are_numbered(cells):
        _check_no_damaged_row(path, lines, cells, separator, decimal)
        return Header(rate_hint=hint)
    if columns == 1 and (_is_metadata(text) or len(text) > LONGEST_QUOTE):
        return Header(rate_hint=hint)
    return Header(names=tuple(cells), line=number, rate_hint=hint)


def joined_lines(lines: Sequence[Line]) -> list[Line]:
    r"""Return the lines with those put together that a line break within quotes has parted.

    Examples
    --------
    >>> joined_lines([(1, '"a1'), (2, '[g]","a2'), (3, '[g]"'), (4, "5")])
    [(1, '"a1 [g]","a2 [g]"'), (4, '5')]
    """
    joined, place = [], 0
    while place < len(lines):
        number, text = lines[place]
        end = place + _parts(lines[place : place + _MOST_PARTS])
        joined.append((number, " ".join([text, *(part for _, part in lines[place + 1 : end])])))
        place = end
    return joined


def _parts(lines: Sequence[Line]) -> int:
    """Return of how many lines the first one is a part: 1 if no quote is left open in it."""
    quotes = 0
    for count, (_, text) in enumerate(lines, 1):
        quotes += text.count('"')
        if quotes % 2 == 0:
            return count
        if count == 1 and not _OPEN_QUOTE.search(text):
            return 1
    return 1


def is_marker(text: str) -> bool:
    """Tell whether the line only announces the numbers, such as ``DATA`` or ``sep=;``."""
    words = text.strip(" []<>*=:-\t").lower()
    return words in _MARKERS or words.startswith("sep=")


def _cells(text: str, separator: str, columns: int) -> list[str] | None:
    """Return the cells of the line if it has one for each column, with any usual separator."""
    if columns == 1:
        cells = without_empty_end(split_fields(text, separator))
        return cells if len(cells) == 1 else split_fields(text, "")
    for trial in dict.fromkeys((separator, "\t", ";", ",")):
        cells = split_fields(text, trial)
        named = len(without_empty_end(cells)) - (cells[-1:] in (["Comment"], ["comment"]))
        if named <= columns <= len(cells):
            return cells[:columns]
    for gap in (r"\s{2,}|\t", r"\s+(?![\[(])"):  # "Time (s)  a1 (g)", "Time (s) a1 (g)"
        cells = re.split(gap, text.strip())
        if len(cells) == columns:
            return [cell.strip('"') for cell in cells]
    return None


def _numbers(cells: Sequence[str], decimal: str) -> int:
    return sum(is_number(cell, decimal) for cell in cells)


def _are_numbered(cells: Sequence[str]) -> bool:
    """Tell names such as ``t,1,2,3``: a word, then channel numbers that count up."""
    numbers = cells[1:]
    if len(numbers) < 2 or not all(cell.isdigit() for cell in numbers):
        return False
    start = int(numbers[0])
    return start < 2 and [int(cell) for cell in numbers] == list(range(start, start + len(numbers)))


def _check_no_damaged_row(
    path: str, lines: Sequence[Line], cells: Sequence[str], separator: str, decimal: str
) -> None:
    """Raise if the last line, which has some numbers, is a row with a damaged field."""
    number, text = lines[-1]
    count = len(cells)
    if count < 2 or len(split_fields(text, separator)) < count:
        return
    begins_as_row = cells[0][:1].isdigit() or cells[0][:1] in "+-.," or is_missing(cells[0])
    if not begins_as_row and not _stands_below_names(lines, cells, separator, decimal):
        return
    for index, cell in enumerate(cells, 1):
        if not is_number(cell, decimal) and not is_missing(cell):
            raise RecordingError(
                f"{path}, line {number}, column {index}: '{shortened(cell)}' is not a number; "
                "if this line is no sample, put # before it"
            )


def _check_no_odd_row(path: str, line: Line, separator: str, decimal: str, columns: int) -> None:
    """Raise if the line has another number of fields than the rows, but most are numbers."""
    number, text = line
    fields = split_fields(text, separator)
    if len(without_empty_end(fields)) <= columns <= len(fields):
        return
    if is_number(fields[0], decimal) and 2 * _numbers(fields, decimal) > len(fields):
        raise RecordingError(
            f"{path}, line {number}: {len(fields)} fields, not all of them numbers, where the rows "
            f"below have {columns}; if this line is no sample, put # before it"
        )


def _stands_below_names(
    lines: Sequence[Line], cells: Sequence[str], separator: str, decimal: str
) -> bool:
    if len(lines) < 2 or _is_metadata(lines[-1][1]):
        return False
    above = split_fields(lines[-2][1], separator)
    fits = len(without_empty_end(above)) <= len(cells) <= len(above)
    if not fits or _numbers(above, decimal):
        return False
    # where blanks separate, the words of two sentences may be as many as the columns
    return separator != " " or any(character.isdigit() for character in cells[0])


def _is_metadata(text: str) -> bool:
    """Tell ``Operator: Smith`` from names of columns."""
    return ":" in text or "=" in text


def _remark(line: Line, separator: str, columns: int) -> str:
    cells = without_empty_end(split_fields(line[1], separator))
    if len(cells) < 2 or ":" in line[1] or "=" in line[1]:
        return ""
    return (
        f"line {line[0]} has {len(cells)} names for {columns} columns: names not used, columns "
        "are numbered"
    )


def _rate_hint(above: Sequence[Line]) -> str:
    for number, text in above:
        if _RATE.search(text) and any(character.isdigit() for character in text):
            return f"line {number} says '{shortened(text.strip())}'"
    return ""
