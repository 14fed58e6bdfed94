"""Bytes of a recording, from wherever they lie, as blocks of whole lines, and these as fields.

What counts as a number, a missing value or a time stamp in one field of a line.
"""

from __future__ import annotations

import codecs
import io
import os
import re
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np

from gearmon.errors import RecordingError, nearest_name
from gearmon.files import most_unpacked

# With 256 kB reading takes 65 % more time, with 512 kB 20 %, with 1 MB 0 to 2 %, with 2 MB 10 %
# (2e6 rows of 4 columns, two cores); every MB takes some 20 MB of memory while it is parsed.
BLOCK_BYTES = 768 * 1024
# Files of a folder up to which a name is looked for that looks like a missing one.
_NAMES_COMPARED = 50
_LONGEST_LINE = 16 * 1024 * 1024
# A line that a carriage return alone ends, and the first bytes in which it is looked for.
_LONE_RETURN, _TOLD_BY = re.compile(rb"\r(?!\n|\Z)"), 1 << 16
_GZIP_MAGIC = b"\x1f\x8b"
_END_OF_FILE_MARK = b"\x1a"
_BYTE_ORDER_MARKS = {
    "utf-32": (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE),  # before UTF-16, whose mark begins alike
    "utf-16": (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE),
    "utf-8-sig": (codecs.BOM_UTF8,),
}

LONGEST_QUOTE = 60  # characters of a file that a message shows
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
_TIME_OF_DAY = re.compile(r"\d{1,2}:\d{2}:\d{2}([.,]\d+)?")
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}")
_SPREADSHEET_ERROR = re.compile(r"#(n/a|nv|div/0!|wert!|value!|ref!|num!|zahl!|name\?|null!)")
# What loggers, spreadsheets and C libraries print instead of a number.
_NO_VALUE = """
    nan -nan +nan nan(ind) -nan(ind) nan(snan) 1.#qnan -1.#qnan 1.#ind -1.#ind 1.#inf -1.#inf
    inf +inf -inf infinity +infinity -infinity na n/a null none missing overflow - -- ? *
"""
MISSING = frozenset(_NO_VALUE.split())


@dataclass(frozen=True, kw_only=True)
class Block:
    r"""Whole lines of a file.

    Parameters
    ----------
    text : bytes
        Lines, each closed by ``\n`` whatever the file has.
    first_line : int
        Number of the first line, counted from 1.
    closed : bool
        False if the file ends here without a line end.
    """

    text: bytes
    first_line: int
    closed: bool = True


@dataclass(frozen=True, kw_only=True)
class Source:
    """A file that can be read from its start as often as needed.

    Parameters
    ----------
    path : str
        The name for messages.
    content : bytes or None
        The bytes themselves where they can be read only once (a pipe).
    zipped : bool
        Whether they are compressed with gzip.
    encoding : str
        Encoding where lines cannot be cut at the byte of a line feed; "" for all others.
    """

    path: str
    content: bytes | None = None
    zipped: bool = False
    encoding: str = ""

    def head(self, size: int) -> bytes:
        """Return the first bytes, unpacked if need be."""
        with self._opened() as stream:
            return stream.read(size)

    def size(self) -> int:
        """Return how many bytes it has as it lies there."""
        return os.path.getsize(self.path) if self.content is None else len(self.content)

    def size_hint(self) -> int:
        """Return roughly how many bytes the unpacked file has."""
        return self.size() * 4 if self.zipped else self.size()

    def blocks(self, size: int = BLOCK_BYTES, *, line: int = 1) -> Iterator[Block]:
        """Yield the lines of the file, from the given one on, some `size` bytes at a time.

        Raises
        ------
        RecordingError
            If a line has no end or the compressed file is damaged.
        """
        # bytes in which a line feed is one pass through as they are
        one_byte = self.encoding in ("", "utf-8-sig")
        with self._opened() as raw:
            raw.read(len(codecs.BOM_UTF8) if self.encoding == "utf-8-sig" else 0)
            first, read, stream = 1, 0, cast(Any, raw)
            if not one_byte or _LONE_RETURN.search(self.head(_TOLD_BY)):
                stream = io.TextIOWrapper(raw, "latin-1" if one_byte else self.encoding, "replace")
            while text := stream.read(size) + stream.readline(_LONGEST_LINE):
                read += len(text)
                if self.zipped and read > most_unpacked(self.size()):
                    raise RecordingError(
                        f"{self.path}: {self.size() / 1e6:.2g} MB unpack to over {read / 1e6:.2g} "
                        "MB, as no recording does; unpack it and look at it"
                    )
                if isinstance(text, str):
                    text = text.encode("latin-1" if one_byte else "utf-8")
                elif b"\r" in text:
                    text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
                end = text.rfind(b"\n") + 1
                rest = text[end:].rstrip(_END_OF_FILE_MARK)
                lines = text[:end] + (rest and rest + b"\n")
                count, skipped = count_of(lines, "\n"), max(0, line - first)
                if len(rest) >= _LONGEST_LINE:
                    raise RecordingError(
                        f"{self.path}, line {first + count - 1}: over "
                        f"{_LONGEST_LINE // 2**20} MB without a line end; a recording needs one "
                        "line per sample"
                    )
                if count > skipped:
                    own = lines.split(b"\n", skipped)[-1]
                    yield Block(text=own, first_line=first + skipped, closed=not rest)
                first += count

    @contextmanager
    def _opened(self) -> Iterator[BinaryIO]:
        with open(self.path, "rb") if self.content is None else io.BytesIO(self.content) as raw:
            if not self.zipped:
                yield raw
                return
            import gzip  # most recordings are not compressed
            import zlib

            try:
                with gzip.GzipFile(fileobj=raw) as stream:
                    yield cast(BinaryIO, stream)
            except (EOFError, gzip.BadGzipFile, zlib.error) as error:
                raise RecordingError(
                    f"{self.path}: the compressed file is damaged ({error}); copy it again"
                ) from None


def count_of(text: bytes, character: str) -> int:
    """Return how often a character stands in a text."""
    # several times as fast as bytes.count where there are many
    return int(np.count_nonzero(np.frombuffer(text, np.uint8) == ord(character)))


def open_source(path: str | Path) -> Source:
    """Return the file as a source of lines: plain or gzip, whatever its suffix says.

    Parameters
    ----------
    path : str or Path
        A file, or a pipe such as ``/dev/stdin``.

    Raises
    ------
    RecordingError
        If there is no such file or it cannot be read.
    """
    name = os.fspath(path)
    try:
        mode = os.stat(name).st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or stat.S_ISFIFO(mode)):
            raise OSError(0, "is no file")
        # a pipe cannot be opened again
        content = Path(name).read_bytes() if stat.S_ISFIFO(mode) else None
        source = Source(path=name, content=content)
        source = replace(source, zipped=source.head(2) == _GZIP_MAGIC)
    except OSError as error:
        raise RecordingError(f"{name}: {_why_not(Path(name), error)}") from None
    head = source.head(4)
    told = (encoding for encoding, marks in _BYTE_ORDER_MARKS.items() if head.startswith(marks))
    return replace(source, encoding=next(told, ""))


def _why_not(path: Path, error: OSError) -> str:
    if isinstance(error, IsADirectoryError):
        return "is a folder; name a recording in it"
    if not isinstance(error, FileNotFoundError):
        return f"cannot be read ({error.strerror})"
    if str(path) == "-":
        return "no such file; name a recording, or /dev/stdin for one that comes through a pipe"
    if not path.parent.is_dir():
        return f"no such file, nor a folder {path.parent}"
    with os.scandir(path.parent) as entries:
        names = sorted(entry.name for entry in islice(entries, _NAMES_COMPARED + 1))
    # comparing many takes longer than reading
    similar = nearest_name(path.name, names) if len(names) <= _NAMES_COMPARED else None
    return "no such file" + (f"; did you mean {path.parent / similar}?" if similar else "")


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


def is_number(field: str, decimal: str) -> bool:
    """Tell whether the field is a number: digits, one decimal character, an exponent (e or d).

    Examples
    --------
    >>> is_number("-1,5d-3", ","), is_number("1.5.2", ".")
    (True, False)
    """
    return _NUMBER[decimal].fullmatch(field) is not None


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
    if _TIME_OF_DAY.fullmatch(field):
        field = "0001-01-01T" + "0" * (field[1] == ":") + field
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
