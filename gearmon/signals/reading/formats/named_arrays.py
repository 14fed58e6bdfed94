"""Named arrays: NumPy's files (npy, npz), MATLAB's of versions 5 to 7 (7.3 is HDF5), and frames.

The elements of a MATLAB file are taken apart here, with every length checked: compiled readers can
bring the process down on a damaged file (SciPy 1.17 did so on 6 of 1,400 changed at random).

References
----------
MathWorks, "MAT-File Format", 2023, chapter 1.
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.errors import ArgumentError, RecordingError
from gearmon.files import archive_swells, most_unpacked
from gearmon.signals.reading.columns import Content, DataColumn, describe_columns
from gearmon.signals.reading.fields import Floats
from gearmon.signals.reading.formats.arrays import Array, Holding, as_array, check_not_square, hold

_HEADER_BYTES = 128
_DEEPEST = 8
_MATRIX, _COMPRESSED = 14, 15
_STRUCT = 2
_NUMERIC_CLASSES = range(6, 16)
_COMPLEX_FLAG = 0x0800
_DTYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
# What is taken of arrays and frames in memory.
_ACCEPTED = (
    "give the name of a file, an array of shape (n,) or (channels, n) with sampling_rate_hz=, a "
    "DataFrame (columns are channels), or a Recording"
)


class _DamagedError(ValueError):
    """The elements contradict each other."""


@dataclass(frozen=True, kw_only=True)
class _Found:
    """Arrays and single numbers by name, and what else there is."""

    items: dict[str, Any] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)


def read_mat(path: str) -> Holding:
    """Return what a MATLAB file holds: its arrays and single numbers, those of structs by a dot.

    Raises
    ------
    RecordingError
        If it is damaged.
    """
    content = Path(path).read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise RecordingError(f"{path}: a MATLAB file whose header is damaged; copy it again")
    found, most = _Found(), most_unpacked(len(content))
    for kind, body in _elements(memoryview(content)[_HEADER_BYTES:], order):
        inner = [(kind, body)]
        if kind == _COMPRESSED:
            unpacked = _unpacked(body, most)
            most -= len(unpacked)
            inner = list(_elements(memoryview(unpacked), order))
        for own_kind, own in inner:
            if own_kind == _MATRIX:
                _gather(own, order, "", found, _DEEPEST)
    return hold(path, found.items, tuple(found.others))


def _unpacked(body: memoryview, most: int) -> bytes:
    packer = zlib.decompressobj()
    data = packer.decompress(body, most + 1)
    if len(data) > most:
        raise _DamagedError("it unpacks to more than any")
    if not packer.eof:
        raise _DamagedError("a part is cut off")
    return data


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield the type and the content of each element."""
    place = 0
    while place + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, place)
        if kind >> 16:  # up to four bytes in the place of a size
            size, kind, begin, step = kind >> 16, kind & 0xFFFF, place + 4, 8
            if size > 4:
                raise _DamagedError(f"a short element of {size} bytes")
        else:
            begin = place + 8
            step = 8 + (size if kind == _COMPRESSED else (size + 7) // 8 * 8)
        if begin + size > len(data):
            raise _DamagedError(f"an element of {size} bytes where {len(data) - begin} are left")
        yield kind, data[begin : begin + size]
        place += step
    if any(data[place:]):
        raise _DamagedError("bytes behind the last element")


def _gather(body: memoryview, order: str, prefix: str, found: _Found, deeper: int) -> None:
    """Add an array, or the fields of a struct."""
    if not len(body):  # an empty field of a struct
        return
    parts = list(_elements(body, order))
    if len(parts) < 3:
        found.others.append(f"{prefix or 'a variable'} without content")
        return
    flags = _numbers(parts[0], order, 2)
    shape = tuple(_numbers(parts[1], order, 2).tolist())
    name = prefix or bytes(parts[2][1]).decode("ascii", errors="replace")
    family = int(flags[0]) & 0xFF
    if family == _STRUCT and math.prod(shape) == 1 and deeper:
        _gather_fields(parts, order, name, found, deeper)
    elif family in _NUMERIC_CLASSES and not int(flags[0]) & _COMPLEX_FLAG:
        if name and math.prod(shape):
            found.items[name] = _array(parts, order, shape)
    elif name:
        found.others.append(f"{name} (no array of real numbers)")


def _gather_fields(
    parts: list[tuple[int, memoryview]], order: str, name: str, found: _Found, deeper: int
) -> None:
    length = int(_numbers(parts[3], order, 1)[0])
    text = bytes(parts[4][1])
    if length < 1 or len(text) % length or len(parts) - 5 != len(text) // length:
        raise _DamagedError("a struct whose fields do not match their names")
    for number, (_, value) in enumerate(parts[5:]):
        own = text[number * length : (number + 1) * length].split(b"\0")[0]
        _gather(value, order, f"{name}.{own.decode('ascii', errors='replace')}", found, deeper - 1)


def _numbers(part: tuple[int, memoryview], order: str, fewest: int) -> Any:
    kind, body = part
    if kind not in _DTYPES:
        raise _DamagedError(f"an element of type {kind} where numbers are needed")
    dtype = np.dtype(order + _DTYPES[kind])
    if len(body) % dtype.itemsize or len(body) < fewest * dtype.itemsize:
        raise _DamagedError(f"an element of {len(body)} bytes, too few or too many")
    return np.frombuffer(body, dtype)


def _array(parts: list[tuple[int, memoryview]], order: str, shape: tuple[int, ...]) -> Any:
    if len(parts) != 4 or min(shape) < 0:
        raise _DamagedError(f"an array of {len(parts)} parts")
    values = _numbers(parts[3], order, 1)
    if values.size != math.prod(shape):
        raise _DamagedError(f"{values.size} numbers in an array of shape {shape}")
    return values.reshape(shape, order="F")


def read_npy(path: str) -> Holding:
    """Return what an npy file holds: one array, or one channel for each field of its records.

    Raises
    ------
    RecordingError
        If it is damaged or holds Python objects.
    """
    stored = np.load(path, mmap_mode="r", allow_pickle=False)
    if stored.offset + stored.nbytes != os.path.getsize(path):
        raise _DamagedError("bytes behind its numbers")
    if stored.dtype.names:
        arrays: tuple[Array | None, ...] = _record_fields(stored)
    else:
        check_not_square(path, stored.shape)
        arrays = (as_array("", stored),)
    found = tuple(array for array in arrays if array is not None)
    described = f"numbers of type {stored.dtype} and shape {stored.shape}"
    return Holding(arrays=found, together=True, left_out=(described,))


def _record_fields(stored: Any) -> tuple[Array, ...]:
    """Return the fields of records as channels of one array, as they lie side by side."""
    names = [name for name in stored.dtype.names or () if stored.dtype[name].kind in "fiu"]
    if not names or len(stored.shape) != 1 or any(stored.dtype[name].shape for name in names):
        return ()

    def read(start: int, stop: int) -> Floats:
        records = stored[start:stop]
        return np.stack([records[name].astype(np.float64) for name in names])

    return (Array(name="", names=tuple(names), count=stored.shape[0], read=read),)


def read_npz(path: str) -> Holding:
    """Return what an npz file holds: its arrays and single numbers by name.

    Raises
    ------
    RecordingError
        If it is damaged.
    """
    with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
        if archive_swells(archive):
            raise _DamagedError("it unpacks to more than any")
        items = {name: archive[name] for name in archive.files if _is_plain(archive, name)}
        others = tuple(name for name in archive.files if name not in items)
    return hold(path, items, others)


def _is_plain(archive: Any, name: str) -> bool:
    try:
        return bool(archive[name].dtype.kind in "fiub")
    except ValueError:  # an array of Python objects
        return False


def content_of(data: Any, rate_hz: float | None) -> Content:
    """Return what stands in an array or a frame, as if it had been read from a file.

    Parameters
    ----------
    data : array-like, DataFrame or Series
        An array of shape (n,), (channels, n) or (n, channels), the longer axis being time; or
        anything of pandas, whose columns may be named with their units, as "a1 [m/s2]", and whose
        index, of moments, durations or numbers, is the time.
    rate_hz : float > 0 or None
        Sampling rate of an array.

    Returns
    -------
    Content
        With copies of the numbers.

    Raises
    ------
    ArgumentError
        If it is none of these, or the sampling rate is not known.
    RecordingError
        If there are no numbers in it.
    """
    if hasattr(data, "to_frame") and hasattr(data, "index"):
        data = data.to_frame("" if data.name is None else data.name)  # a series is one column
    if hasattr(data, "columns") and hasattr(data, "iloc"):
        return _of_frame(data, rate_hz)
    if not hasattr(data, "__array__"):
        raise ArgumentError(f"recording: {type(data).__name__} is no recording; {_ACCEPTED}")
    return _of_array(np.asarray(data), rate_hz)


def _of_array(data: Any, rate_hz: float | None) -> Content:
    found = as_array("", data)
    if found is None:
        raise ArgumentError(
            f"recording: an array of shape {data.shape} and type {data.dtype} is none; "
            f"{_ACCEPTED}, with more samples than channels"
        )
    if rate_hz is None:
        raise ArgumentError(
            f"recording: the sampling rate of an array of shape {data.shape} cannot be known; give "
            "sampling_rate_hz="
        )
    numbers = range(1, len(found.names) + 1)
    return Content(
        path="array",
        values=np.array(found.read(0, found.count)),
        columns=tuple(DataColumn(number=number, name=f"channel {number}") for number in numbers),
        rate_hz=rate_hz,
    )


def _of_frame(frame: Any, rate_hz: float | None) -> Content:
    """Take the columns of numbers, and the index as one more where it may be the time."""
    kinds = [getattr(dtype, "kind", "O") for dtype in frame.dtypes]
    taken = [number for number, kind in enumerate(kinds) if kind in "fiub"]
    if not taken or len(frame) < 2:
        raise RecordingError(
            f"DataFrame of shape {frame.shape}: holds no recording; columns of numbers are channels"
        )
    names = [str(frame.columns[number]) for number in taken]
    rows = [frame.iloc[:, number].to_numpy(np.float64, na_value=np.nan) for number in taken]
    name, stamps = _time_of(frame.index)
    columns = describe_columns((*names, name))
    timed = any(column.kind == "time" for column in columns[:-1])
    if stamps is not None and not timed:
        rows.append(stamps)
    elif rate_hz is None and not timed:
        raise ArgumentError(
            f"DataFrame of shape {frame.shape}: its sampling rate is not known; give "
            "sampling_rate_hz=, or the time as index"
        )
    left_out = [str(name) for name, kind in zip(frame.columns, kinds, strict=True) if kind == "O"]
    return Content(
        path="DataFrame",
        values=np.array(rows),
        columns=columns[: len(rows)],
        notes=(f"no numbers, left out: {', '.join(left_out)}",) if left_out else (),
    )


def _time_of(index: Any) -> tuple[str, Floats | None]:
    """Return name and numbers of an index that may be the time."""
    kind = getattr(index.dtype, "kind", "O")
    if kind in "mM":
        # whole nanoseconds, as pandas has them: seconds would not show where they were rounded
        return "time_ns", np.asarray((index - index[0]) / np.timedelta64(1, "ns"), np.float64)
    if kind not in "fiu" or type(index).__name__ == "RangeIndex":
        return "", None
    return str(index.name or "time"), index.to_numpy(np.float64)
