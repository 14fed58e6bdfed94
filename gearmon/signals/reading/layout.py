"""How a table of numbers is written and what stands above it.

Separator, decimal character, number of columns and first row; then the lines above: names of the
columns, their units, and what else they tell. Last, what counts as a number, a missing value or a
time stamp in one field of a line.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

from gearmon.errors import RecordingError, counted
from gearmon.signals.reading.columns import LONGEST_QUOTE, Column, describe_columns, shortened
from gearmon.units import are_units

# Lines that are looked at to find the dialect; the last ones, as those are rows most surely.
_SAMPLE = 100
_SEPARATORS = ("\t", ";", ",", " ", "")
_EMPTY = ' \t,;"'
_MOST_COLUMNS = 1000
_BEGINS = "0123456789+-.,"  # a number
# What may follow a decimal comma.
_DECIMALS = re.compile(r"\d+([eE][+-]?\d+)?")
_ONE_NAME = re.compile(r"\S+(?:\s*[\[(].*[\])])?")
# Lines that announce the numbers and name no column.
_MARKERS = frozenset(
    {"data", "begin", "begin data", "start data", "data start", "end header", "header end"}
    | {"end of header", "end_of_header", "endofheader", "daten", "messdaten", "measurement data"}
)
_RATE = re.compile(
    r"sampl|abtast|\bfs\b|\brate\b|frequen|interval|\bdt\b|delta_?[tx]|schrittweite", re.IGNORECASE
)
# Between names as in "Time (s)  a1 (g)", and as in "Time (s) a1 (g)".
_GAPS = re.compile(r"\s{2,}|\t"), re.compile(r"\s+(?![\[(])")
# A field that begins with a quote and has no end in its line.
_OPEN_QUOTE = re.compile(r'(?:^|[,;\s])"[^"]*$')
_CLOSED_QUOTES = re.compile(r'"[^"]*"')
# A number that ends where none can; rows above the last one that tell how many digits it has.
_CUT_NUMBER = re.compile(r"[+-]?(?:[0-9]*(?:[.,][0-9]*)?[eEdD][+-]?)?|[+-]?[.,]")
_ENOUGH_ROWS = 50
_REMEDY = "correct it, or put # before the line if it is no sample"
_FEWEST_BELOW = 5  # rows of decimals that tell names 0, 1, 2 ... from one more row

Line = tuple[int, str]
_EXPONENT_LETTERS = str.maketrans("dD", "ee")
_NUMBER = {
    mark: re.compile(rf"[+-]?(?:[0-9]+(?:[{mark}][0-9]*)?|[{mark}][0-9]+)(?:[eEdD][+-]?[0-9]+)?")
    for mark in ".,"
}
_QUOTED = re.compile(r'[ \t]*"((?:[^"]|"")*)"[ \t]*')
# Fields, with their quotes, in which a separator is no end.
_FIELDS = {
    mark: re.compile(rf'(?:^|{mark})((?:[^"{mark}]|"[^"]*(?:"|\Z))*)') for mark in "\t;,"
} | {" ": re.compile(r'((?:[^"\s]|"[^"]*(?:"|\Z))+)')}
# Days are told apart by ISO 8601 alone: 4/5/2026 may be of April or of May.
_TIME_OF_DAY = re.compile(
    r"(?:\d{1,2}([/.-])\d{1,2}\1\d{4}[T ]+)?(\d{1,2})(:\d{2}:\d{2}(?:[.,]\d+)?)(?:\s?([AaPp])[Mm])?"
)
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}")
_SPREADSHEET_ERROR = re.compile(r"(?i)#(n/a|nv|div/0!|wert!|value!|ref!|num!|zahl!|name\?|null!)")
# What loggers, spreadsheets and C libraries print instead of a number.
_NO_VALUE = """
    nan -nan +nan nan(ind) -nan(ind) nan(snan) 1.#qnan -1.#qnan 1.#ind -1.#ind 1.#inf -1.#inf
    inf +inf -inf infinity +infinity -infinity na n/a null none missing overflow - -- ? *
"""
MISSING = frozenset(_NO_VALUE.split())


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How a table is written: its rows of numbers, where they begin, and what stands above them.

    Parameters
    ----------
    separator : str
        "," or ";" or a tab; " " for any run of spaces and tabs; "" for one number in a line.
    decimal : str
        "." or ",".
    columns : int
        Numbers in a row; 0 as long as that is not known.
    trailing : bool
        Whether separators follow the last number.
    stamp : int or None
        Index of a column of dates and times or times of day.
    stamp_origin : int
        The first of these stamps, in microseconds.
    texts : frozenset of int
        Indices of columns of words, such as labels, that are not read.
    first_line : int
        Number of the first row's line.
    names, units : sequence of str
        The cells of the line of names, and of that of units below it; none if there is no such
        line.
    remark : str
        Why a line that looks like names was not used.
    rate_hint : str
        The line that seems to tell the sampling rate.
    """

    separator: str
    decimal: str
    columns: int = 0
    trailing: bool = False
    stamp: int | None = None
    stamp_origin: int = 0
    texts: frozenset[int] = frozenset()
    first_line: int = 1
    names: Sequence[str] = ()
    units: Sequence[str] = ()
    remark: str = ""
    rate_hint: str = ""

    def described(self) -> tuple[Column, ...]:
        """Return the columns of the table, as far as the lines above the numbers tell."""
        return describe_columns(self.names or ("",) * self.columns, self.units)

    def split(self, line: str) -> list[str]:
        """Return the fields of a line."""
        return split_fields(line, self.separator)

    def row(self, line: str) -> list[str] | None:
        """Return the fields if each is a number, a time stamp or missing, and not all missing."""
        fields = self.split(line)
        stamps_allowed = self.separator not in ("", " ")
        for field in (told := [own for k, own in enumerate(fields) if k not in self.texts]):
            if not (is_number(field, self.decimal) or is_missing(field)):
                if not stamps_allowed or to_microseconds(field) is None:
                    return None
                stamps_allowed = False  # one such column at most
        # a line of dashes is no row; one of NaN is
        says = (any(map(str.isdigit, own)) or own[-3:].lower() in ("nan", "inf") for own in told)
        return fields if any(says) else None

    def fitting(self, line: str) -> list[str] | None:
        """Return the fields of the line if it is a row of this table, else None."""
        fields = self.row(line)
        return fields if fields is not None and self.fits(fields) else None

    def fits(self, fields: Sequence[str]) -> bool:
        """Tell whether the number of fields is right; empty ones may follow."""
        return len(fields) >= self.columns and not any(fields[self.columns :])

    def value(self, index: int, field: str) -> float | None:
        """Return what a field of a column tells; NaN if it is missing, None if it is no number."""
        moment = to_microseconds(field) if index == self.stamp else None
        if moment is not None:
            return (moment - self.stamp_origin) / 1e6
        if index not in (self.stamp, *self.texts) and is_number(field, self.decimal):
            return float(field.replace(self.decimal, ".").translate(_EXPONENT_LETTERS))
        return math.nan if index in self.texts or is_missing(field) else None

    def numbers(self, cells: Sequence[str]) -> int:
        """Return how many of the cells are numbers."""
        return sum(is_number(cell, self.decimal) for cell in cells)

    def is_row(self, line: str) -> bool:
        """Tell whether a line below the first row is one of the rows."""
        return bool(line.strip()) and not is_comment(line) and any(self.split(line))

    def values(self, where: str, fields: Sequence[str]) -> list[float]:
        """Return the numbers of a row.

        Raises
        ------
        RecordingError
            If it is none, with the place that is told.
        """
        if not self.fits(fields):
            found = counted(len(without_empty_end(fields)), "field")
            wrong = f"{found} where the table has {counted(self.columns, 'column')}"
            if not self.numbers(fields):
                wrong = f"'{shortened(' '.join(fields).strip())}' is not a number"
            raise RecordingError(f"{where}: {wrong}; {_REMEDY}")
        values = []
        for index, field in enumerate(fields[: self.columns]):
            value = self.value(index, field)
            if value is None:
                what = "time stamp" if index == self.stamp else "number"
                place = f"{where}, {self.described()[index].label}"
                raise RecordingError(f"{place}: '{shortened(field)}' is not a {what}; {_REMEDY}")
            values.append(value)
        return values

    def cut(self, last: Sequence[str], above: Sequence[Sequence[str]]) -> str:
        """Say what shows that the last row is cut off, beside those above; "" if nothing does."""
        place = self.columns - 1
        before = [own for k, own in enumerate(last[:place]) if k not in self.texts]
        if self.numbers(before) < len(before):
            return ""
        if len(last) <= place:
            return f"{counted(len(last), 'field')} of {self.columns}"
        if self.trailing and len(last) == self.columns and above:
            return "no separator at its end, as the lines above have"
        field = last[place]
        # what stands behind the digits before the point, digit by digit
        ending, *others = (
            re.sub("[0-9]", "0", "".join(row[place].partition(self.decimal)[1:]))
            for row in (last, *above)
        )
        # fewer digits behind the point than all others have
        shorter = bool(others) and field.endswith(self.decimal) and self.decimal not in others
        if len(set(others)) == 1 and len(above) >= _ENOUGH_ROWS:
            shorter = shorter or len(ending) < len(others[0])
        cut = self.fits(last) and (_CUT_NUMBER.fullmatch(field) or shorter)
        return f"'{shortened(field)}'" if cut else ""


def find_layout(path: str, lines: Sequence[str]) -> Dialect:
    """Return the layout of the table of numbers in the lines.

    Parameters
    ----------
    path : str
        The file, for messages.
    lines : sequence of str
        The beginning of the file, from its first line on.

    Raises
    ------
    RecordingError
        If there is no row of numbers, the beginning can be read in two ways, or its first rows are
        damaged.
    """
    # is there a column of words, or a text below the rows?
    for count, worded in ((_SAMPLE, False), (_SAMPLE, True), (len(lines), False)):
        # the last lines that are neither remarks nor empty
        filled = (line for line in reversed(lines) if line.strip(_EMPTY) and not is_comment(line))
        sample = list(islice(filled, count))[::-1]
        dialect = _most_likely(sample, lines, worded)
        if dialect is not None:
            break
    else:
        raise RecordingError(f"{path}: {_without_rows(lines)}")
    if dialect.columns > _MOST_COLUMNS:
        raise RecordingError(
            f"{path}: {dialect.columns} numbers in a line; a recording needs one line per sample "
            "and one column per channel: transpose it"
        )
    rows = [line for line in sample if dialect.fitting(line) is not None]
    first, above = _first_row(path, lines, dialect)
    dialect = _widened(_decided(path, dialect, rows, above), rows, above)
    # what seems to tell the sampling rate in the lines of text above the first row
    told = (
        f"line {number} says '{shortened(text.strip())}'"
        for number, text in above
        if _RATE.search(text) and any(map(str.isdigit, text))
    )
    dialect = replace(dialect, first_line=first, rate_hint=next(told, ""))
    return _with_counted_names(_with_names(path, dialect, above), lines[first - 1], rows)


def _without_rows(lines: Sequence[str]) -> str:
    """Say what stands in lines that hold no rows of numbers."""
    filled = [(number, line.strip()) for number, line in enumerate(lines, 1) if line.strip()]
    number, text = filled[-1]
    what = f"{'only a header, ' if len(filled) <= 2 else ''}no rows of numbers in its"
    what += f" {counted(len(lines), 'line')} (line {number} reads '{shortened(text)}')"
    return f"{what}; a recording has one line of numbers per sample"


def _most_likely(sample: Sequence[str], lines: Sequence[str], worded: bool) -> Dialect | None:
    """Return the dialect in which most lines of the sample are rows of one length.

    It has what these rows tell, and how many columns those of all lines have that are as long;
    where it is `worded`, columns that hold words in every line count for nothing.
    """
    commas, quotes = (any(mark in line for line in sample) for mark in ',"')
    best, most = None, 0
    for mark, decimal in product(_SEPARATORS, ".,"):
        if decimal == "," and not (commas and (mark != "," or quotes)):
            continue
        parts = worded and sample and mark in _FIELDS and mark != " "
        texts = _texts(sample, lines, mark) if parts else frozenset[int]()
        dialect = Dialect(separator=mark, decimal=decimal, texts=texts)
        rows = [(line, row) for line in sample if (row := dialect.row(line)) is not None]
        parted = sum(len(line.split()) > 1 if mark == " " else mark in line for line, _ in rows)
        lengths = Counter(len(row) for _, row in rows).most_common(1)
        if 2 * parted < len(rows) or not lengths or lengths[0][1] <= most:
            continue
        length, most = lengths[0]
        alike = [row for _, row in rows if len(row) == length]
        columns = max(len(without_empty_end(row)) for row in alike)
        if length > columns:  # a last column may hold a number now and then, as of a slow sensor
            full = (dialect.row(x) for x in lines if not x.endswith(mark * (length - columns)))
            filled = (len(without_empty_end(row)) for row in full if row and len(row) == length)
            columns = max([columns, *filled])
        moments = [*map(to_microseconds, alike[0])]
        stamp = next((k for k, own in enumerate(moments) if own is not None), None)
        origin = 0 if stamp is None else moments[stamp] or 0
        best = replace(dialect, columns=columns, trailing=length > columns)
        best = replace(best, stamp=stamp, stamp_origin=origin)
    return best


def _texts(sample: Sequence[str], lines: Sequence[str], mark: str) -> frozenset[int]:
    """Return the columns that hold words in every line of the sample, and no number in any line."""
    words = [split_fields(line, mark) for line in sample]
    alike = (own for own in (split_fields(x, mark) for x in lines) if len(own) == len(words[-1]))
    numbers = {k for own in alike for k, x in enumerate(own) if _NUMBER["."].match(x)}
    own = range(min(map(len, words)))
    worded = {k for k in own if all(x[k][:1].isalpha() and not is_missing(x[k]) for x in words)}
    return frozenset(worded - numbers)


def _first_row(path: str, lines: Sequence[str], dialect: Dialect) -> tuple[int, list[Line]]:
    """Return the number of the first row, and the lines of text above it with their numbers."""
    above: list[Line] = []
    odd: tuple[int, int] | None = None
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        remark = is_comment(line)
        row = None if remark else dialect.row(line)
        if row is None:
            if not remark and _OPEN_QUOTE.search(_CLOSED_QUOTES.sub("", line)):
                raise RecordingError(
                    f"{path}, line {number}: a quote is not closed in this line; close it, or take "
                    "line breaks within quotes out"
                )
            above.append((number, line.strip().lstrip("#% \t") if remark else line))
            odd = None
        elif not dialect.fits(row):
            odd = odd or (number, len(without_empty_end(row)))
        elif odd is None:
            return number, above
        else:
            raise RecordingError(
                f"{path}, line {odd[0]}: {counted(odd[1], 'number')} where the rows below have "
                f"{dialect.columns}; if this line is no sample, put # before it"
            )
    raise AssertionError("the sample has a row, so the lines have one")


def _widened(dialect: Dialect, rows: Sequence[str], above: Sequence[Line]) -> Dialect:
    """Count columns that have a name but no number in any row."""
    named = len(without_empty_end(dialect.split(above[-1][1]))) if above else 0
    length = min(len(dialect.split(line)) for line in rows)
    wider = dialect.trailing and dialect.columns < named <= length
    return replace(dialect, columns=named, trailing=length > named) if wider else dialect


def _decided(path: str, dialect: Dialect, rows: Sequence[str], above: Sequence[Line]) -> Dialect:
    """Tell ``1,5`` as one number with a decimal comma from two whole numbers, or raise."""
    if (dialect.separator, dialect.decimal, dialect.columns) != (",", ".", 2):
        return dialect
    firsts, seconds = zip(*(dialect.split(line)[:2] for line in rows), strict=True)
    plain = all(own.lstrip("+-").isdigit() for own in firsts)
    plain = plain and all(map(_DECIMALS.fullmatch, seconds))
    if not plain or any(mark in line.strip() for line in rows for mark in ' "'):
        return dialect
    named = _columns_named(above[-1][1]) if above else 0
    whole = all(own.isdigit() for own in seconds)  # 1e-5 stands by itself more often than 0,1e-5
    # whole numbers are not written -0 or 05, and of 50 decimals some would begin with 0
    one = {"-0", "+0"} & {*firsts} or any(own[0] == "0" and own != "0" for own in seconds)
    if named == 1 or (not named and whole and one):
        return replace(dialect, separator="", decimal=",", columns=1, trailing=False)
    if named == 2 or not whole or (len(rows) >= 50 and max(map(len, seconds)) >= 2):
        return dialect
    raise RecordingError(
        f"{path}: its lines, such as '{shortened(rows[0].strip())}', may be one column with "
        "decimal commas or two columns of whole numbers; add a first line that names the column(s)"
    )


def _columns_named(text: str) -> int:
    """Return whether the last line of text names one column or two; 0 if that cannot be told."""
    names = without_empty_end(split_fields(text, ","))
    if _is_metadata(text) or _is_marker(text) or len(names) > 2:
        return 0
    return 0 if len(names) == 1 and _ONE_NAME.fullmatch(names[0]) is None else len(names)


def _with_counted_names(dialect: Dialect, first: str, rows: Sequence[str]) -> Dialect:
    """Take a first row 0, 1, 2 ... above rows of decimals as the names that it is."""
    cells, below = dialect.split(first)[: dialect.columns], [line for line in rows if line != first]
    if dialect.names or dialect.columns < 3 or not _count_up(cells):
        return dialect
    whole = any(field.isdigit() for line in below for field in dialect.split(line))
    if whole or len(below) < _FEWEST_BELOW:
        return dialect
    return replace(dialect, first_line=dialect.first_line + 1, names=cells)


def _with_names(path: str, dialect: Dialect, above: Sequence[Line]) -> Dialect:
    """Add the names and units that the lines of text above the first row tell.

    Raises
    ------
    RecordingError
        If the last of them is a row with a damaged field, or one with another number of fields.
    """
    lines = [line for line in above if line[1] and not _is_marker(line[1])]
    if not lines:
        return dialect
    number, text = lines[-1]
    cells = _cells(text, dialect)
    upper = _cells(lines[-2][1], dialect) if len(lines) > 1 else None
    if upper is not None and dialect.numbers(upper):
        upper = None
    if cells and are_units(cells) and (upper is not None or cells[0].startswith(("[", "("))):
        return replace(dialect, names=upper or (), units=cells)
    if damage := _damage(lines, dialect):
        raise RecordingError(
            f"{path}, line {number}{damage}; if this line is no sample, put # before it"
        )
    if cells is None:
        named = len(without_empty_end(dialect.split(text)))
        remark = f"line {number} has {named} names for {dialect.columns} columns"
        remark += ": names not used, columns are numbered"
        return dialect if named < 2 or _is_metadata(text) else replace(dialect, remark=remark)
    told = dialect.columns > 1 or not (_is_metadata(text) or len(text) > LONGEST_QUOTE)
    row = dialect.numbers(cells) and not _count_up(cells[1:])
    return replace(dialect, names=cells) if told and not row else dialect


def _is_marker(text: str) -> bool:
    """Tell whether the line only announces the numbers, such as ``DATA`` or ``sep=;``."""
    words = text.strip(" []<>*=:-\t").lower()
    return words in _MARKERS or words.startswith("sep=")


def _cells(text: str, dialect: Dialect) -> list[str] | None:
    """Return the cells of the line if it has one for each column, with any usual separator."""
    columns = dialect.columns
    if columns == 1:
        cells = list(without_empty_end(dialect.split(text)))
        return cells if len(cells) == 1 else split_fields(text, "")
    marks = dict.fromkeys((dialect.separator, "\t", ";", ","))
    trials = [split_fields(text, mark) for mark in marks]
    trials += [[cell.strip('"') for cell in gap.split(text.strip())] for gap in _GAPS]
    for cells in trials:
        named = len(without_empty_end(cells)) - (cells[-1:] in (["Comment"], ["comment"]))
        if named <= columns <= len(cells):
            return cells[:columns]
    return None


def _count_up(cells: Sequence[str]) -> bool:
    """Tell the numbers of channels: 0, 1, 2 ... or 1, 2 ..."""
    known = [[str(start + k) for k in range(len(cells))] for start in (0, 1)]
    return len(cells) > 1 and [*cells] in known


def _damage(lines: Sequence[Line], dialect: Dialect) -> str:
    """Say why the last line of text is no text but a damaged row; "" if it is text."""
    fields, columns = dialect.split(lines[-1][1]), dialect.columns
    numbers = dialect.numbers(fields)
    if not dialect.fits(fields):
        odd = is_number(fields[0], dialect.decimal) and 2 * numbers > len(fields)
        what = "fields, not all of them numbers, where the rows below have"
        return f": {len(fields)} {what} {columns}" if odd else ""
    cells = fields[:columns]
    begins_as_row = cells[0][:1] in _BEGINS or is_missing(cells[0])
    is_row = begins_as_row or _stands_below_names(lines, cells, dialect)
    wrong = [k for k, cell in enumerate(cells) if dialect.value(k, cell) is None]
    if columns == 1 or not numbers or _count_up(cells[1:]) or not is_row or not wrong:
        return ""
    return f", column {wrong[0] + 1}: '{shortened(cells[wrong[0]])}' is not a number"


def _stands_below_names(lines: Sequence[Line], cells: Sequence[str], dialect: Dialect) -> bool:
    if len(lines) < 2 or _is_metadata(lines[-1][1]):
        return False
    above = dialect.split(lines[-2][1])
    names = dialect.fits(above) and not dialect.numbers(above)
    # where blanks separate, the words of two sentences may be as many as the columns
    return names and (dialect.separator != " " or any(map(str.isdigit, cells[0])))


def _is_metadata(text: str) -> bool:
    """Tell ``Operator: Smith`` from names of columns."""
    return ":" in text or "=" in text


def is_number(field: str, decimal: str) -> bool:
    """Tell whether the field is a number: digits, one decimal character, an exponent (e or d).

    Examples
    --------
    >>> is_number("-1,5d-3", ","), is_number("1.5.2", ".")
    (True, False)
    """
    return _NUMBER[decimal].fullmatch(field) is not None


def is_missing(field: str) -> bool:
    """Tell whether the field is empty or says, in a usual way, that there is no finite value."""
    return not field or field.lower() in MISSING or bool(_SPREADSHEET_ERROR.match(field))


def is_comment(line: str) -> bool:
    """Tell whether the line is a remark: it begins with ``#`` or ``%``."""
    text = line.lstrip()
    return text.startswith(("#", "%")) and not _SPREADSHEET_ERROR.match(text)


def to_microseconds(field: str) -> int | None:
    """Return a time stamp (ISO 8601 date and time, or time of day) in microseconds, or None.

    They count from midnight; for dates, from the start of the year 1, without time zones.

    Examples
    --------
    >>> to_microseconds("00:01:00.25"), to_microseconds("1.5")
    (60250000, None)
    """
    if clock := _TIME_OF_DAY.fullmatch(field):
        hour, rest, half = clock.groups()[1:]
        after = int(hour) % 12 + 12 * (half in "Pp") if half else int(hour)
        field = f"0001-01-01T{after:02}{rest}"
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
    filled = [count for count, field in enumerate(fields, 1) if field]
    return fields[: max(filled, default=0)]


def _unquoted(field: str) -> str:
    match = _QUOTED.fullmatch(field)
    return match[1].replace('""', '"').strip() if match else field.strip()
