"""A slow, obvious reader of text tables: whole file in memory, one character after the other.

It shares no code with the package. `read_slowly` returns the rows as lists of floats (NaN where a
value is missing) or raises `NotATableError`.
"""

from __future__ import annotations

import math
import re

MISSING = {
    "", "nan", "-nan", "+nan", "nan(ind)", "-nan(ind)", "nan(snan)", "1.#qnan", "-1.#qnan",
    "1.#ind", "-1.#ind", "1.#inf", "-1.#inf", "inf", "+inf", "-inf", "infinity", "+infinity",
    "-infinity", "na", "n/a", "null", "none", "missing", "overflow", "-", "--", "?", "*",
}  # fmt: skip
SPREADSHEET_ERRORS = (
    "#n/a", "#nv", "#div/0!", "#wert!", "#value!", "#ref!", "#num!", "#zahl!", "#name?", "#null!",
)  # fmt: skip


class NotATableError(Exception):
    """The text is no table of numbers, or a damaged one."""


def read_slowly(data: bytes) -> list[list[float]]:
    lines, closed = lines_of(data)
    separator, decimal, columns = best_dialect(lines)
    first = first_row(lines, separator, decimal, columns)
    if not closed:
        refuse_cut_end(lines[first:], separator, decimal, columns)
    if any("\0" in line for line in lines[first:]):
        raise NotATableError("zero bytes")
    rows, gap = [], False
    for line in lines[first:]:
        if is_comment(line):
            inner = fields_of(line.strip().lstrip("#% \t"), separator)
            if is_row(inner, decimal) and fits(inner, columns):
                raise NotATableError("a row behind a comment sign")
            continue
        fields = fields_of(line, separator)
        if all(field == "" for field in fields):
            gap = gap or line.strip() != "" or columns == 1
            continue
        if gap:
            raise NotATableError("an empty row between rows")
        if not fits(fields, columns):
            raise NotATableError("another number of fields")
        rows.append([value_of(field, decimal) for field in fields[:columns]])
    return rows


def lines_of(data: bytes) -> tuple[list[str], bool]:
    """Return the lines, and whether the last one has a line end."""
    if data.startswith(b"\xef\xbb\xbf"):
        data = data[3:]
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    lines, current, position = [], "", 0
    while position < len(text):
        character = text[position]
        if character in "\r\n":
            lines.append(current)
            current = ""
            if text[position : position + 2] == "\r\n":
                position += 1
        else:
            current += character
        position += 1
    current = current.rstrip("\x1a")
    if current:
        lines.append(current)
    return lines, current == ""


def fields_of(line: str, separator: str) -> list[str]:
    """Split at separators outside quotes; " " means any run of blanks, "" one field."""
    fields, current, quoted = [], "", False
    for character in line:
        if character == '"':
            quoted = not quoted
        is_blank = separator == " " and character.isspace()
        if not quoted and separator and (character == separator or is_blank):
            fields.append(current)
            current = ""
        else:
            current += character
    fields.append(current)
    if separator == " ":
        fields = [field for field in fields if field != ""]
    return [unquoted(field.strip()) for field in fields]


def unquoted(field: str) -> str:
    if len(field) >= 2 and field[0] == field[-1] == '"':
        inner = field[1:-1].replace('""', "\0")
        if '"' not in inner:
            return inner.replace("\0", '"').strip()
    return field


def is_comment(line: str) -> bool:
    text = line.lstrip().lower()
    return text[:1] in ("#", "%") and not text.startswith(SPREADSHEET_ERRORS)


def is_number(field: str, decimal: str) -> bool:
    body = field[1:] if field[:1] in ("+", "-") else field
    match = re.fullmatch(r"([0-9]*)(?:([.,])([0-9]*))?(?:[eEdD][+-]?[0-9]+)?", body)
    if match is None or match[2] not in (None, decimal):
        return False
    return bool(match[1] or match[3])


def is_missing(field: str) -> bool:
    return field.lower() in MISSING or field.lower().startswith(SPREADSHEET_ERRORS)


def is_row(fields: list[str], decimal: str) -> bool:
    if not all(is_number(field, decimal) or is_missing(field) for field in fields):
        return False
    ends = [field.lower()[-3:] for field in fields]
    return any(re.search("[0-9]", field) for field in fields) or "nan" in ends or "inf" in ends


def fits(fields: list[str], columns: int) -> bool:
    return len(fields) >= columns and all(field == "" for field in fields[columns:])


def filled(fields: list[str]) -> int:
    """Return the number of fields up to the last one that is not empty."""
    return max((k + 1 for k, field in enumerate(fields) if field != ""), default=0)


def value_of(field: str, decimal: str) -> float:
    if is_number(field, decimal):
        return float(re.sub("[dD]", "e", field.replace(decimal, ".")))
    if is_missing(field):
        return math.nan
    raise NotATableError(f"{field!r} is no number")


def best_dialect(lines: list[str]) -> tuple[str, str, int]:
    """Return separator, decimal character and columns of the most rows of one length."""
    sample = [line for line in lines if line.strip(' \t,;"') and not is_comment(line)]
    if any(is_candidate(line) for line in sample[-100:]):
        sample = sample[-100:]
    best: tuple[int, str, str, int] | None = None
    for separator in ("\t", ";", ",", " ", ""):
        for decimal in (".", ","):
            if separator == decimal == "," and not any('"' in line for line in sample):
                continue
            candidate = judged(sample, separator, decimal)
            if candidate is not None and (best is None or candidate[0] > best[0]):
                best = candidate
    if best is None:
        raise NotATableError("no rows")
    _, separator, decimal, columns = best
    if (separator, decimal, columns) == (",", ".", 2) and means_decimal_commas(sample, lines):
        return "", ",", 1
    named = columns_named_above(lines, separator, decimal, columns)
    rows = [fields_of(line, separator) for line in sample]
    lengths = [len(row) for row in rows if is_row(row, decimal) and fits(row, columns)]
    if columns < named <= min(lengths):
        columns = named
    return separator, decimal, columns


def is_candidate(line: str) -> bool:
    """Tell whether the line is a row in any dialect."""
    splits = [fields_of(line, separator) for separator in ("\t", ";", ",", " ", "")]
    return any(is_row(fields, decimal) for fields in splits for decimal in ".,")


def judged(sample: list[str], separator: str, decimal: str) -> tuple[int, str, str, int] | None:
    rows = []
    separated = 0
    for line in sample:
        fields = fields_of(line, separator)
        if is_row(fields, decimal):
            rows.append(fields)
            separated += len(line.split()) > 1 if separator == " " else separator in line
    if not rows or 2 * separated < len(rows):
        return None
    lengths = [len(row) for row in rows]
    usual = max(dict.fromkeys(lengths), key=lengths.count)
    columns = max(filled(row) for row in rows if len(row) == usual)
    return lengths.count(usual), separator, decimal, columns


def means_decimal_commas(sample: list[str], lines: list[str]) -> bool:
    """Tell whether ``1,5`` is one number; refuse if nobody can know."""
    sample = [
        line
        for line in sample
        if is_row(fields_of(line, ","), ".") and fits(fields_of(line, ","), 2)
    ]
    rows = [fields_of(line, ",") for line in sample]
    if any(" " in line.strip() or '"' in line for line in sample):
        return False
    decimals = "[0-9]+([eE][+-]?[0-9]+)?"
    if not all(
        re.fullmatch("[+-]*[0-9]+", row[0]) and re.fullmatch(decimals, row[1]) for row in rows
    ):
        return False
    above = text_above(lines, ",", ".", 2)
    names = fields_of(above, ",")[: filled(fields_of(above, ","))]
    if above and not re.search("[:=]", above) and not is_announcement(above):
        if len(names) == 2:
            return False
        if len(names) == 1 and re.fullmatch(r"\S+(\s*[\[(].*[\])])?", names[0]):
            return True
    if not all(row[1].isdigit() for row in rows):
        return False
    if any(row[0] in ("-0", "+0") or re.fullmatch("0[0-9]+", row[1]) for row in rows):
        return True
    if len(rows) >= 50 and max(len(row[1]) for row in rows) > 1:
        return False
    raise NotATableError("one column with decimal commas or two of whole numbers")


def is_announcement(text: str) -> bool:
    words = text.strip(" []<>*=:-\t").lower()
    return words.startswith("sep=") or words in {
        "data", "begin", "begin data", "start data", "data start", "end header", "header end",
        "end of header", "end_of_header", "endofheader", "daten", "messdaten", "measurement data",
    }  # fmt: skip


def columns_named_above(lines: list[str], separator: str, decimal: str, columns: int) -> int:
    return filled(fields_of(text_above(lines, separator, decimal, columns), separator))


def text_above(lines: list[str], separator: str, decimal: str, columns: int) -> str:
    """Return the last line of text above the first row."""
    above = ""
    for line in lines:
        fields = fields_of(line, separator)
        if not is_comment(line) and is_row(fields, decimal) and fits(fields, columns):
            break
        if line.strip() and (is_comment(line) or not is_row(fields, decimal)):
            above = line.strip().lstrip("#% \t") if is_comment(line) else line
    return above


def first_row(lines: list[str], separator: str, decimal: str, columns: int) -> int:
    """Return the index of the first row; refuse odd or damaged rows right above it."""
    odd, texts = False, []
    for index, line in enumerate(lines):
        fields = fields_of(line, separator)
        if not line.strip():
            continue
        if is_comment(line) or not is_row(fields, decimal):
            odd = False
            texts.append(line.strip().lstrip("#% \t") if is_comment(line) else line)
        elif fits(fields, columns):
            if odd:
                raise NotATableError("a row of another length above the first")
            refuse_damaged_row(texts, separator, decimal, columns)
            return index
        else:
            odd = True
    raise NotATableError("no rows")


def refuse_damaged_row(texts: list[str], separator: str, decimal: str, columns: int) -> None:
    """Refuse a line of text right above the rows that has as many fields, some of them numbers."""
    texts = [text for text in texts if text != ""]
    if not texts or columns < 2:
        return
    last = fields_of(texts[-1], separator)
    if not filled(last) <= columns <= len(last):
        numbers = [is_number(field, decimal) for field in last]
        if numbers[0] and 2 * sum(numbers) > len(last):
            raise NotATableError("an odd row above the first")
        return
    if all(is_number(field, decimal) or is_missing(field) for field in last[:columns]):
        return  # a row behind a comment sign
    numbers = [is_number(field, decimal) for field in last[:columns]]
    named = [field for field in last[:columns] if field not in ("", "-", "--", "1")]
    if named and all(re.fullmatch(r"\[.*\]|\(.*\)|<.*>", field) for field in named):
        return  # units in brackets, some of them none
    counted = [field for field in last[1:columns] if field.isdigit()]
    if any(numbers) and not (len(counted) == columns - 1 >= 2):
        begins_like_a_row = bool(re.match(r"[0-9+\-.,]", last[0])) or is_missing(last[0])
        above = fields_of(texts[-2], separator) if len(texts) > 1 else []
        named = filled(above) <= columns <= len(above)
        named = named and not any(is_number(field, decimal) for field in above)
        if separator == " " and not re.search("[0-9]", last[0]):
            named = False
        if begins_like_a_row or (named and not re.search("[:=]", texts[-1])):
            raise NotATableError("a damaged row above the first")


def refuse_cut_end(lines: list[str], separator: str, decimal: str, columns: int) -> None:
    """Refuse a last line without line end that lacks fields or ends in half a number."""
    last = fields_of(lines[-1], separator)
    if is_comment(lines[-1]) or filled(last) == 0:
        return
    if not all(is_number(field, decimal) for field in last[: columns - 1]):
        return
    rows = [fields_of(line, separator) for line in lines[:-1] if not is_comment(line)]
    rows = [row for row in rows if filled(row) and fits(row, columns)]
    if len(last) < columns:
        raise NotATableError("fields are lacking at the end")
    if len(last) == columns and rows and min(len(row) for row in rows) > columns:
        raise NotATableError("the last separator is lacking")
    field = last[columns - 1]
    if re.fullmatch(r"[+-]?|[+-]?[.,]|[+-]?[0-9]*([.,][0-9]*)?[eEdD][+-]?", field):
        raise NotATableError("half a number at the end")
    endings = {ending(row[columns - 1], decimal) for row in rows}
    if field.endswith(decimal) and rows and decimal not in endings:
        raise NotATableError("half a number at the end")
    if len(rows) >= 50 and len(endings) == 1 and len(ending(field, decimal)) < len(min(endings)):
        raise NotATableError("fewer decimals at the end")


def ending(field: str, decimal: str) -> str:
    return re.sub("[0-9]", "0", field[field.index(decimal) :]) if decimal in field else ""
