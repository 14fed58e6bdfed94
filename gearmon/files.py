"""Writing files so that nothing already written is ever lost.

Every file is written beside its place and takes it in one step. It carries a mark (an extended
attribute of the file) of who wrote it and of its size and time: while a command runs, files without
the mark, files that were changed since, and files of other commands are never written over.
"""

from __future__ import annotations

import csv
import errno
import io
import json
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints

from gearmon.errors import ArgumentError, GearmonError, SignatureError

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Version of what JSON output holds: keys may be added within it, none is renamed or goes.
SCHEMA = "gearmon/1"
_MARK = "user.gearmon"
# Noise alone keeps a sample from taking less than a bit: 64:1 for numbers of 8 bytes, 160:1 for
# text of 20 characters. Deflate reaches 1032:1. Little is unpacked in any case.
_MOST_PACKED, _ALWAYS_BYTES = 250, 1 << 24
# What spreadsheets take for a formula; numbers with a sign are none.
_FORMULA = re.compile(r"[=@\t\r]|[+-](?![\d.]+(?:[eE][+-]?\d+)?$)")
# What no program can mend: no room, or a disk that fails.
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)


@dataclass(frozen=True, kw_only=True)
class _Writer:
    """The command that writes, the files that it reads, and those that it goes on with."""

    command: str
    read: frozenset[tuple[int, int]]  # by device and number
    kept: frozenset[Path]


# None outside commands: who calls from Python says himself what is written over
_WRITER: ContextVar[_Writer | None] = ContextVar("writer", default=None)


@contextmanager
def protecting(
    command: str, read: Iterable[str | Path], kept: Iterable[str | Path] = ()
) -> Iterator[None]:
    """Write nothing over inside this block but what the same command has written before.

    Parameters
    ----------
    command : str
        Its name.
    read : iterable of str or Path
        What it reads, which is not written over whoever wrote it.
    kept : iterable of str or Path
        What it goes on with: it has looked at what stands there.
    """
    known = {found for path in read if (found := _identity(Path(path))) is not None}
    own = frozenset(Path(os.path.realpath(path)) for path in kept)
    token = _WRITER.set(_Writer(command=command, read=frozenset(known), kept=own))
    try:
        yield
    finally:
        _WRITER.reset(token)


def check_output(path: str | Path) -> Path:
    """Return the file that a path leads to, or raise if it must or can not be written.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Path
        `path`; of a link the file that it points to.

    Raises
    ------
    ArgumentError
        If it is a folder or no ordinary file, its folder does not exist or cannot be written, or,
        inside `protecting`, it is read as well or holds what the same command has not written.
    """
    given = Path(path)
    try:
        target = given.resolve()  # a link stays a link: what it points to is replaced
        if target.is_dir():
            raise ArgumentError(f"{given}: is a folder; give the name of a file to write")
        if target.is_symlink() or (target.exists() and not target.is_file()):
            raise ArgumentError(f"{given}: is no ordinary file; give the name of a file to write")
        target.parent.stat()
    except (OSError, RuntimeError) as error:
        # links in a circle are a RuntimeError up to Python 3.12
        why = getattr(error, "strerror", None) or "links in a circle"
        raise ArgumentError(f"{given}: cannot write there ({why})") from None
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise ArgumentError(f"{given}: cannot write there (no permission to write in its folder)")
    writer = _WRITER.get()
    if writer is None:
        return target
    if _identity(target) in writer.read:
        raise ArgumentError(f"{given}: is read as well; give another name to write to")
    known = target in writer.kept or not target.exists() or not target.stat().st_size
    if not (known or _is_own(target, writer.command)):
        raise ArgumentError(
            f"{given}: exists, and gearmon {writer.command} did not write it, or it was changed "
            "since; remove it, or give another name"
        )
    return target


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and number of a file: the same by whatever name or link."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_dev, found.st_ino


def _is_own(path: Path, command: str) -> bool:
    """Whether a command wrote a file, which nobody changed; also where no mark can be kept."""
    try:
        told = os.getxattr(path, _MARK).decode("utf-8", "replace")
    except AttributeError:
        return True  # systems other than Linux keep no marks
    except OSError as error:
        return error.errno in (errno.ENOTSUP, errno.ENOSYS)
    writer, _, state = told.partition(" ")
    return state == _state(path) and writer in (command, "python")


def _state(path: Path) -> str:
    found = path.stat()
    return f"{found.st_size} {found.st_mtime_ns}"


def made_folder(path: str | Path) -> Path:
    """Make a folder, with all above it, if it is not there; return it.

    Raises
    ------
    ArgumentError
        If it cannot be made.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{folder}: cannot make this folder ({error.strerror})") from None
    return folder


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; on success it takes the place of `path`.

    Parameters
    ----------
    path : str or Path
        The file to be written. Its folder must exist.

    Yields
    ------
    Path
        A temporary file in the same folder, with the same suffix.

    Raises
    ------
    ArgumentError
        If the folder does not exist, the disk is full, or `check_output` refuses.
    """
    target = check_output(path)
    # no private file of tempfile: a result is as readable as any file the user writes
    temporary = target.with_name(f".{os.urandom(8).hex()}{target.suffix}")
    try:
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise ArgumentError(f"{path}: cannot write there ({error.strerror})") from None
    try:
        yield temporary
        writer = _WRITER.get()
        mark = f"{writer.command if writer else 'python'} {_state(temporary)}"
        with suppress(AttributeError, OSError):  # not every file system keeps marks
            os.setxattr(temporary, _MARK, mark.encode())
        os.replace(temporary, target)
    except OSError as error:
        if error.errno in _FULL:
            raise ArgumentError(
                f"{path}: cannot write it ({error.strerror}); what was there before is unchanged"
            ) from None
        raise
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()


def write_atomically(path: str | Path, content: bytes | str) -> None:
    """Write `content` to `path` in one step: readers see the old file or the new one.

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def parquet() -> Any:
    """Return pyarrow with what reads and writes Parquet files.

    Raises
    ------
    ArgumentError
        If it is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError:
        raise ArgumentError(
            "Parquet files need pyarrow: pip install 'gearmon[parquet]', or use .csv"
        ) from None
    return pyarrow


def write_archive(
    path: str | Path, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
) -> None:
    """Store arrays with a header in one file: a NumPy archive with JSON inside, no code.

    Parameters
    ----------
    path : str or Path
    header : dict
        Built-in types; its "format" tells readers what it is.
    arrays : mapping of str to ndarray

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    import numpy as np  # the command line does without it where it only writes text

    told = np.frombuffer(json.dumps(header).encode("utf-8"), dtype=np.uint8)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **{**arrays, "header": told})


@contextmanager
def reading_archive(
    path: str | Path, formats: Sequence[str], what: str, remedy: str, missing: str
) -> Iterator[tuple[dict[str, Any], dict[str, NDArray[Any]]]]:
    """Give header and arrays of a file that `write_archive` wrote.

    Whatever goes wrong with them inside this block, because they are damaged or were made to do
    harm, ends in one clear line.

    Parameters
    ----------
    path : str or Path
    formats : sequence of str
        Formats that can be read, the present one first.
    what : str
        What the file should be.
    remedy : str
        What to do about one that cannot be read: it is to be done anew.
    missing : str
        What to do where there is none.

    Yields
    ------
    header : dict
    arrays : dict of str to ndarray

    Raises
    ------
    SignatureError
        If the file is missing, something else, or damaged.
    """
    import numpy as np

    try:
        # opened here, so that it is closed even if it turns out to be no archive
        with Path(path).open("rb") as file:
            if file.read(2) != b"PK":
                raise ValueError("another kind of file")
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                if archive_swells(archive):
                    raise ValueError("it unpacks to more than any")
                arrays = {name: archive[name] for name in archive.files}
        header = json.loads(bytes(arrays.pop("header")).decode("utf-8"))
        if header.get("format") not in formats:
            raise SignatureError(
                f"{path}: format {header.get('format')!r} is not {formats[0]!r}; {remedy} anew"
            )
        yield header, arrays
    except GearmonError:
        raise
    except FileNotFoundError:
        raise SignatureError(f"{path}: no such file; {missing}") from None
    except IsADirectoryError:
        raise SignatureError(f"{path}: is a folder, no {what}; {missing}") from None
    except Exception as error:  # damage shows in every way there is
        name = type(error).__name__
        why = str(error) if name == "ValueError" and len(str(error)) < 80 else name
        raise SignatureError(f"{path}: not a readable {what} ({why}); {remedy} anew") from None


def stored(value: Any, arrays: dict[str, NDArray[Any]], place: str = "") -> Any:
    """Take a value object apart for `write_archive`.

    Parameters
    ----------
    value : dataclass, tuple, ndarray, or what JSON holds
    arrays : dict of str to ndarray
        Every array of the value is added, under its place in it.
    place : str
        Place of the value itself.

    Returns
    -------
    dict, list, str, int, float, bool or None
        What `restored` puts together again.
    """
    if is_dataclass(value):
        named = {field.name: getattr(value, field.name) for field in fields(value)}
        return {name: stored(own, arrays, f"{place}/{name}") for name, own in named.items()}
    if isinstance(value, tuple):
        return [stored(own, arrays, f"{place}/{i}") for i, own in enumerate(value)]
    if not hasattr(value, "dtype") or isinstance(value, float):
        return value
    arrays[place] = value
    return place


def restored(kind: Any, told: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Put together again what `stored` took apart.

    Parameters
    ----------
    kind : type
        A dataclass, or the type of one of its fields.
    told : dict, list, str, int, float, bool or None
    arrays : mapping of str to ndarray

    Raises
    ------
    KeyError, TypeError, ValueError
        If something is missing or of another type: the file is damaged or made to do harm.
    """
    if isinstance(kind, type) and is_dataclass(kind):
        hints = _hints(kind)
        return kind(**{name: restored(hint, told[name], arrays) for name, hint in hints.items()})
    origin, parts = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return None if told is None else restored(parts[0], told, arrays)
    if origin is tuple:
        return tuple(restored(parts[0], own, arrays) for own in told)
    if hasattr(origin, "dtype"):
        array = arrays[told]
        if array.dtype != get_args(parts[1])[0]:
            raise ValueError(f"its {told.strip('/')} cannot be")
        return array
    if kind is float:
        return float(told)
    if type(told) is not (origin or kind):
        raise ValueError(f"{told!r:.40} cannot be")
    return told


@lru_cache(maxsize=32)
def _hints(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a dataclass."""
    known = get_type_hints(kind)
    return {field.name: known[field.name] for field in fields(kind)}


def most_unpacked(packed: int) -> int:
    """Return the size that a compressed file may have: larger ones were made to fill the memory.

    Parameters
    ----------
    packed : int
        Size as it lies there [bytes].

    Examples
    --------
    >>> 7e8 > most_unpacked(1_800_000), 4e9 > most_unpacked(1_000_000_000)
    (True, False)
    """
    return max(_ALWAYS_BYTES, _MOST_PACKED * packed)


def archive_swells(archive: Any) -> bool:
    """Tell whether a NumPy archive unpacks to more than it may."""
    parts = archive.zip.infolist()
    packed: int = sum(own.compress_size for own in parts)
    return bool(sum(own.file_size for own in parts) > most_unpacked(packed))


def table_cell(value: Any) -> Any:
    """Return what a table on disk holds: text that a spreadsheet would run as a formula is quoted.

    What is no number has an empty cell.

    Examples
    --------
    >>> table_cell("=1+1"), table_cell("-5.2"), table_cell(-5.2), table_cell("mesh")
    ("'=1+1", '-5.2', -5.2, 'mesh')
    >>> table_cell(float("nan")) is None
    True
    """
    if isinstance(value, str) and _FORMULA.match(value):
        return "'" + value
    return None if isinstance(value, float) and math.isnan(value) else value


def rows_as_csv(rows: Sequence[dict[str, Any]], columns: Iterable[str] = ()) -> str:
    """Return rows as CSV text with a header.

    Parameters
    ----------
    rows : sequence of dict
        Rows with the same keys.
    columns : iterable of str
        The keys, for the header of no rows.

    Returns
    -------
    str
        None is an empty field; see `table_cell`.
    """
    text = io.StringIO()
    names = list(rows[0] if rows else columns)
    if names:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(map(table_cell, names))
        writer.writerows([table_cell(row.get(name)) for name in names] for row in rows)
    return text.getvalue()


def as_json(result: Mapping[str, Any]) -> str:
    """Return a result as JSON, marked with the version of its schema (see `schemas.json`).

    What is infinite or no number becomes null.
    """
    marked = {"schema": SCHEMA, **result}
    try:
        return json.dumps(marked, indent=1, ensure_ascii=False, allow_nan=False)
    except ValueError:
        plain = json.loads(json.dumps(marked), parse_constant=lambda _: None)
        return json.dumps(plain, indent=1, ensure_ascii=False)


def write_table(
    path: str | Path,
    result: Mapping[str, Any],
    rows: list[dict[str, Any]],
    columns: Iterable[str] = (),
) -> None:
    """Write rows as CSV or the whole result as JSON, by the ending of the name."""
    is_csv = Path(path).suffix.lower() == ".csv"
    write_atomically(path, rows_as_csv(rows, columns) if is_csv else as_json(result) + "\n")
