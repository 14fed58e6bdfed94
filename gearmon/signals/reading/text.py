"""Recordings in text: the bytes of a file as blocks of whole lines, and these as rows of numbers.

Rows are read by the parser of pandas, or line by line where a line is in doubt. The parser (from
3.1 on) rounds every number as `float` does and works without Python's lock, so that threads share
the blocks of a file. It is lenient in a few ways that would change what a damaged file means. Which
they are is looked for in the bytes before, and in the shape and the values of what comes out; a
block that fails is read line by line, slowly, to say what is wrong and where. Rows with dates are
read line by line as well.
"""

from __future__ import annotations

import codecs
import csv
import io
import os
import re
import stat
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import RecordingError, nearest_name
from gearmon.files import most_unpacked
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.columns import Table, shortened
from gearmon.signals.reading.layout import MISSING, Dialect, find_layout, is_comment
from gearmon.threads import MOST_THREADS, cores

# With 256 kB reading takes 65 % more time, with 512 kB 20 %, with 1 MB 0 to 2 %, with 2 MB 10 %
# (2e6 rows of 4 columns, two cores); every MB takes some 20 MB of memory while it is parsed.
_BLOCK_BYTES = 768 * 1024
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
_FORTRAN_EXPONENTS = bytes.maketrans(b"dD", b"ee")
# pandas 3.1 misses the nearest float in one of seven numbers of 17 digits with " +" before them.
# The sign stands first here: it is rare, and looked for ten times as fast as blanks are.
_BLANK_AND_PLUS = re.compile(rb"\+(?<=[ \t\v\f]\+)")
_BLANK_LINES = re.compile(rb"\n{2,}")
# Infinities are told by the line: which it is, and where.
_NO_VALUES = [
    spelling
    for word in ("", *sorted(MISSING))
    if "inf" not in word
    for spelling in {word, word.upper(), word.capitalize(), word.replace("n", "N")}
]
# Rows whose last fields are compared to see whether the very last one is cut off.
_MOST_ROWS = 200
_HEAD_BYTES = 768 * 1024  # tell the layout
# Threads pay only where a file has many blocks.
_THREADED_BYTES = 8 * 1024 * 1024
_KEPT_BYTES = 4 * 1024 * 1024  # with 16 MB 4 % faster, and 8 MB more held
_MARGIN = 1.1  # reserved rows over estimated ones: memory that is not touched costs nothing
_CUT_CHECK_BYTES = 64 * 1024


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

    def blocks(self, size: int = _BLOCK_BYTES, *, line: int = 1) -> Iterator[Block]:
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
                count, skipped = _count_of(lines, "\n"), max(0, line - first)
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


def _count_of(text: bytes, character: str) -> int:
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


def _decoded(text: bytes) -> str:
    """Return the text: UTF-8 if it is valid, otherwise Western European."""
    try:
        return text.decode()
    except UnicodeDecodeError:
        return text.decode("cp1252", errors="replace")


def parse_rows(text: bytes, dialect: Dialect) -> FloatArray | None:
    r"""Return the rows of numbers in a block of lines, or None if a line needs a closer look.

    Parameters
    ----------
    text : bytes
        Whole lines, each closed by a line feed; no carriage returns.
    dialect : Dialect
        How they are written.

    Returns
    -------
    ndarray of float64, shape (rows, columns), or None
        Equal to ``float`` of each field; NaN where a field is empty or says that it has no value.

    Examples
    --------
    >>> parse_rows(b"1.5;2\n-3;4e1\n", Dialect(separator=";", decimal=".", columns=2))
    array([[ 1.5,  2. ],
           [-3. , 40. ]])
    """
    separator = dialect.separator.encode()
    # perhaps a row of empty fields only
    empty = dialect.trailing and (text.startswith(separator) or b"\n" + separator in text)
    # pandas passes over quotes and zero bytes within numbers, and over a mark of the order of bytes
    edges = b"\n" + (b" \t" if separator == b" " else re.escape(separator))
    joined = b'"' in text and re.search(rb'[^%b]"[^%b]' % (edges, edges), text)
    doubtful = joined or b"\0" in text or text.startswith(codecs.BOM_UTF8)
    if empty or doubtful or dialect.stamp is not None:
        return None
    if separator != b" " and _BLANK_AND_PLUS.search(text):
        if b'"' in text:
            return None
        blanks = rb"[ \v\f]+" if separator == b"\t" else rb"[ \t\v\f]+"
        begins = rb"(?m)(^|%b)%b(?=\+)" % (re.escape(separator or b"\n"), blanks)
        text = re.sub(begins, rb"\1", text)
    if b"d" in text or b"D" in text:
        text = text.translate(_FORTRAN_EXPONENTS)
    while dialect.trailing and separator + b"\n" in text:
        text = text.replace(separator + b"\n", b"\n")
    values = _parsed(text, dialect)
    # in a single column a blank line may stand for a missing number
    if values is None and dialect.columns > 1 and (b"\n\n" in text or text.startswith(b"\n")):
        return parse_rows(_BLANK_LINES.sub(b"\n", text).lstrip(b"\n"), dialect)
    if values is None or (np.isfinite(values.min()) and np.isfinite(values.max())):
        return values
    # pandas fills up short rows and refuses long ones: with all separators there, none is short
    marks = _count_of(text, dialect.separator) if separator.strip(b" ") else -1
    whole = dialect.columns > 1 and marks == (dialect.columns - 1) * len(values)
    usable = whole and not np.isinf(values).any() and not np.isnan(values).all(axis=1).any()
    return values if usable else None


def _parsed(text: bytes, dialect: Dialect) -> FloatArray | None:
    """Return what pandas makes of the text if that is one row of all columns for each line.

    NaN stands where a field is empty, says that it has no value, or is not there.
    """
    import pandas  # takes longer to load than all the rest

    separator = {" ": r"\s+", "": ";" if dialect.decimal == "," else ","}
    try:
        frame = pandas.read_csv(
            io.BytesIO(text),
            sep=separator.get(dialect.separator, dialect.separator),
            decimal=dialect.decimal,
            header=None,
            dtype={k: str if k in dialect.texts else float for k in range(dialect.columns)},
            na_values=_NO_VALUES,
            keep_default_na=False,
            quoting=csv.QUOTE_MINIMAL if b'"' in text else csv.QUOTE_NONE,
            skip_blank_lines=False,
            low_memory=False,
        )
    except (ValueError, OverflowError):  # any text that is no number
        return None
    if frame.shape != (_count_of(text, "\n"), dialect.columns):
        return None
    frame[[*dialect.texts]] = np.nan
    return cast(FloatArray, frame.to_numpy())


def read_rows(path: str, block: Block, dialect: Dialect, empty: int = 0) -> tuple[FloatArray, int]:
    """Return the rows of a block, read line by line.

    Parameters
    ----------
    path : str
        The file, for messages.
    block : Block
        Lines from the first row on.
    dialect : Dialect
        How they are written.
    empty : int
        Number of an empty row before this block; 0 if there is none.

    Raises
    ------
    RecordingError
        At the first line that is neither a row nor blank nor a remark.
    """
    values: list[list[float]] = []
    for number, line in enumerate(_decoded(block.text).split("\n")[:-1], block.first_line):
        where = f"{path}, line {number}"
        if "\0" in line:
            raise RecordingError(f"{where}: zero bytes; the file is damaged, copy it again")
        if is_comment(line):
            # a row of numbers but for its mark
            if dialect.fitting(line.strip().lstrip("#% \t")) is not None:
                raise RecordingError(
                    f"{where}: a sample is taken out by '{line.strip()[0]}', so those after it "
                    "come too early; restore it, or cut the file there"
                )
        elif any(fields := dialect.split(line)):
            if empty:
                raise RecordingError(
                    f"{path}, line {empty}: empty between samples; was a sample lost? If not, "
                    "delete the line"
                )
            values.append(dialect.values(where, fields))
        elif dialect.columns == 1 or line.strip():
            empty = empty or number
    return np.array(values, dtype=np.float64).reshape(-1, dialect.columns), empty


def _check_end(path: str, before: bytes, block: Block, dialect: Dialect) -> None:
    """Raise if the last line, which has no line end, is visibly cut off.

    Where a number has lost its end, what is left is a number as well: only a line with too few
    fields, a number that ends where none can, and one with fewer digits after the point than all
    others give it away.
    """
    if len(before) == _CUT_CHECK_BYTES:
        before = before.partition(b"\n")[2]
    lines = _decoded(before + block.text).split("\n")[-_MOST_ROWS - 2 : -1]
    *above, last = [dialect.split(line) if dialect.is_row(line) else [] for line in lines]
    reason = last and dialect.cut(last, [row for row in above if dialect.fits(row)])
    if reason:
        number = block.first_line + block.text.count(b"\n") - 1
        raise RecordingError(
            f"{path}, line {number}: the file is cut off in mid-line ({reason}); delete the last "
            "line, or copy the file again"
        )


def read_table(source: Source, wanted: Wanted) -> Table:
    """Return all rows of numbers in a text file, with what the lines above them say.

    Parameters
    ----------
    source : Source
        The file.
    wanted : Wanted
        Where the numbers are to lie.

    Raises
    ------
    RecordingError
        If the file has no rows of numbers, or a line among them is none.
    """
    head = next(source.blocks(_HEAD_BYTES), Block(text=b"", first_line=1)).text
    dialect = find_layout(source.path, _decoded(head).split("\n")[:-1])
    values, count = np.empty((dialect.columns, 0)), 0
    for block, rows in _parsed_blocks(source, dialect):
        if count + len(rows) > values.shape[1]:
            blocks = max(1.0, source.size_hint() / len(block.text))
            estimate = int(_MARGIN * len(rows) * blocks) + 1000
            grown = count + len(rows) + values.shape[1] // 2 if count else estimate
            values, old = wanted.room(source.path, (len(values), grown)), values
            values[:, :count] = old[:, :count]
        values[:, count : count + len(rows)] = rows.T
        count += len(rows)
    columns = [*dialect.described()]
    if dialect.stamp is not None:
        columns[dialect.stamp] = replace(columns[dialect.stamp], kind="time", unit="s")
    for index in dialect.texts:
        columns[index] = replace(columns[index], kind="other")
    return Table(
        path=source.path,
        values=values[:, :count],
        columns=tuple(columns),
        rate_hint=dialect.rate_hint,
        notes=(dialect.remark,),
        locate=partial(_located, source, dialect),
    )


def _located(source: Source, dialect: Dialect, row: int, index: int) -> tuple[str, str]:
    """Return which line holds a row (counted from 0), and what stands there in a column."""
    rows = (
        (number, line)
        for block in source.blocks(line=dialect.first_line)
        for number, line in enumerate(_decoded(block.text).split("\n"), block.first_line)
        if dialect.is_row(line)
    )
    number, line = next(islice(rows, row, None))
    field = [*dialect.split(line), *[""] * dialect.columns][index]
    return f"line {number}", f"'{shortened(field)}'" if field else "an empty field"


def _parsed_blocks(source: Source, dialect: Dialect) -> Iterator[tuple[Block, FloatArray]]:
    """Yield the blocks with their rows, in order; large files are parsed ahead by threads."""
    blocks = source.blocks(line=dialect.first_line)
    threads = min(cores(), MOST_THREADS) if source.size_hint() >= _THREADED_BYTES else 1
    # The C library keeps freed memory up to the largest piece it ever gave back, instead of handing
    # every array of every block to the system and asking for it again.
    np.empty(_KEPT_BYTES, np.uint8)
    before, empty_line = b"", 0
    with ThreadPoolExecutor(threads) as pool:
        submitted = ((block, pool.submit(parse_rows, block.text, dialect)) for block in blocks)
        waiting = deque(islice(submitted, threads))
        while waiting:
            block, future = waiting.popleft()
            waiting.extend(islice(submitted, 1))
            rows = future.result()
            if not block.closed:
                _check_end(source.path, before, block, dialect)
            if rows is None or (empty_line and len(rows)):
                rows, empty_line = read_rows(source.path, block, dialect, empty_line)
            before = (before + block.text)[-_CUT_CHECK_BYTES:]
            yield block, rows
