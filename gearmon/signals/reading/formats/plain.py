"""Files that need no further library: WAV, NumPy's (npy, npz), MATLAB's of versions 5 to 7.

WAV files, read in blocks, may be plain RIFF, RF64 or BW64 (beyond 4 GiB), integers of 8, 16, 24 and
32 bits, floats of 32 and 64 bits, plain or with an extended format. The header is taken apart here:
libraries give a shorter recording where it announces more samples than there are (soundfile), or
take half a minute over 8 MB behind a header that was never completed, and no RF64 of this kind
(SciPy 1.17).

So are the elements of a MATLAB file (7.3 is HDF5), with every length checked: compiled readers can
bring the process down on a damaged one (SciPy 1.17 did so on 6 of 1,400 changed at random).

References
----------
EBU Tech 3306, "MBWF / RF64: an extended file format for audio", 2009; Microsoft, "Multiple channel
audio data and WAVE files", 2007; MathWorks, "MAT-File Format", 2023, chapter 1.
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from gearmon.errors import RecordingError
from gearmon.files import archive_swells, most_unpacked
from gearmon.signals.reading.formats.arrays import Array, Holding, as_array, check_not_square, hold
from gearmon.signals.reading.source import Floats

_INTEGERS, _FLOATS, _EXTENSIBLE = 0x0001, 0x0003, 0xFFFE
_UNKNOWN_SIZE = 0xFFFFFFFF
_BIAS_8_BITS = 128
_LONGEST_REST = 1 << 24
_WAV_DTYPES = {
    (_INTEGERS, 8): "u1",
    (_INTEGERS, 16): "<i2",
    (_INTEGERS, 24): "u1",
    (_INTEGERS, 32): "<i4",
    (_FLOATS, 32): "<f4",
    (_FLOATS, 64): "<f8",
}
_HEADER_BYTES = 128
_DEEPEST = 8
_MATRIX, _COMPRESSED = 14, 15
_STRUCT = 2
_NUMERIC_CLASSES = range(6, 16)
_COMPLEX_FLAG = 0x0800
_MAT_DTYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _WavHeader:
    """Where and how the samples are written."""

    path: str
    tag: int
    channels: int
    rate: int
    bytes_a_second: int
    bits: int
    begin: int = 0
    frames: int = 0

    @property
    def frame_bytes(self) -> int:
        return self.channels * self.bits // 8

    @property
    def rates_hz(self) -> dict[str, float]:
        """What the header says of the rate, which it does twice; some writers leave one out."""
        other = self.bytes_a_second / self.frame_bytes or self.rate
        return {"header.sampling rate": self.rate, "bytes a second.sampling rate": other}


def read_wav(path: str) -> Holding:
    """Return what a WAV file holds: one array, its sampling rate, no unit.

    Raises
    ------
    RecordingError
        If the header is damaged, the samples are compressed, or fewer are there than announced.
    """
    with open(path, "rb") as stream:
        layout = _wav_header(path, stream)

    def read(start: int, stop: int) -> Floats:
        return _wav_samples(layout, start, stop)

    array = Array(
        name="",
        names=("",) * layout.channels,
        count=layout.frames,
        read=read,
    )
    how = "float" if layout.tag == _FLOATS else "integer, full scale is taken as 1"
    note = (
        f"{layout.bits}-bit {how}; a WAV file tells no unit: state unit and sensitivity in a "
        "[[sensor]] of the machine file"
    )
    rates = layout.rates_hz
    return Holding(arrays=(array,), together=True, facts=rates, notes=(note,))


def _wav_samples(layout: _WavHeader, start: int, stop: int) -> Floats:
    size = layout.frame_bytes
    raw = np.fromfile(
        layout.path,
        dtype=_WAV_DTYPES[layout.tag, layout.bits],
        count=(stop - start) * size // (1 if layout.bits in (8, 24) else layout.bits // 8),
        offset=layout.begin + start * size,
    )
    if layout.bits == 24:
        # the three bytes as the upper ones of 32 bits: sign and full scale come out right
        wide = np.zeros((raw.size // 3, 4), np.uint8)
        wide[:, 1:] = raw.reshape(-1, 3)
        raw = wide.view("<i4")[:, 0]
    values = raw.reshape(-1, layout.channels).T.astype(np.float64)
    if layout.tag == _INTEGERS:
        if layout.bits == 8:
            values -= _BIAS_8_BITS
        # by a power of two: as exact as a division, and quicker
        values *= 0.5 ** (31 if layout.bits == 24 else layout.bits - 1)
    return values


def _wav_header(path: str, stream: BinaryIO) -> _WavHeader:
    size = os.fstat(stream.fileno()).st_size
    begin = stream.read(12)
    if len(begin) < 12:
        raise RecordingError(f"{path}: a WAV file cut off in its header; copy it again")
    magic, _, kind = struct.unpack("<4sI4s", begin)
    if kind != b"WAVE":
        raise RecordingError(f"{path}: a RIFF file that holds no WAVE sound; export it as CSV")
    layout: _WavHeader | None = None
    long_size = 0
    while True:
        head = stream.read(8)
        if len(head) < 8:
            raise RecordingError(f"{path}: a WAV header without samples; copy the file again")
        chunk, length = struct.unpack("<4sI", head)
        if chunk == b"data":
            if layout is None:
                raise RecordingError(f"{path}: a WAV file whose samples come before their format")
            if magic in (b"RF64", b"BW64") and length == _UNKNOWN_SIZE:
                length = long_size
            complete = _with_samples(layout, stream.tell(), length, size)
            _check_rest(path, stream, stream.tell() + length + length % 2)
            return complete
        if length > size - stream.tell():
            raise RecordingError(
                f"{path}: its WAV header is damaged (a part of {length} bytes in a file of {size})"
            )
        body = stream.read(length) if chunk in (b"fmt ", b"ds64") else b""
        if chunk == b"fmt ":
            layout = _wav_format(path, body)
        elif chunk == b"ds64" and len(body) >= 16:
            long_size = struct.unpack("<Q", body[8:16])[0]
        stream.seek(length - len(body) + length % 2, os.SEEK_CUR)


def _check_rest(path: str, stream: BinaryIO, begin: int) -> None:
    """Raise if what follows the samples is neither whole chunks nor zeros: samples are shifted."""
    stream.seek(begin)
    rest = stream.read(_LONGEST_REST)
    while any(rest):
        length = int.from_bytes(rest[4:8], "little")
        if len(rest) < 8 or not rest[:4].isascii() or 8 + length > len(rest):
            raise RecordingError(
                f"{path}: {len(rest)} bytes behind its samples belong to nothing, so its header or "
                "its samples are damaged; copy it again"
            )
        rest = rest[8 + length + length % 2 :]


def _wav_format(path: str, body: bytes) -> _WavHeader:
    if len(body) < 16:
        raise RecordingError(f"{path}: its WAV header is damaged (a format of {len(body)} bytes)")
    tag, channels, rate, a_second, frame_bytes, bits = struct.unpack("<HHIIHH", body[:16])
    if tag == _EXTENSIBLE and len(body) >= 26:
        tag = struct.unpack("<H", body[24:26])[0]
    if (tag, bits) not in _WAV_DTYPES:
        kinds = {_INTEGERS: "integers", _FLOATS: "floats"}
        kind = kinds.get(tag, f"compressed samples (format {tag:#06x})")
        raise RecordingError(
            f"{path}: a WAV file with {bits}-bit {kind}; read are integers of 8, 16, 24 or 32 bits "
            "and floats of 32 or 64: export it as one of these"
        )
    if not channels or not rate or frame_bytes != channels * bits // 8:
        raise RecordingError(
            f"{path}: its WAV header is damaged ({channels} channels of {bits} bits in "
            f"{frame_bytes} bytes at {rate} Hz)"
        )
    return _WavHeader(
        path=path, tag=tag, channels=channels, rate=rate, bytes_a_second=a_second, bits=bits
    )


def _with_samples(layout: _WavHeader, begin: int, length: int, size: int) -> _WavHeader:
    there = size - begin
    if (length == 0 and there > 0) or length == _UNKNOWN_SIZE:
        raise RecordingError(
            f"{layout.path}: its WAV header was never completed (was the recorder switched off "
            f"while it wrote?); {there} bytes follow it: mend the header with a sound program"
        )
    if length > there:
        raise RecordingError(
            f"{layout.path}: is cut off: its header announces {length} bytes of samples, {there} "
            "are there; copy it again"
        )
    if there - length > _UNKNOWN_SIZE:
        raise RecordingError(
            f"{layout.path}: holds {there} bytes of samples, but its header can say {length} only; "
            "export it as RF64"
        )
    if length % layout.frame_bytes:
        raise RecordingError(
            f"{layout.path}: its {length} bytes of samples are no whole number of samples of "
            f"{layout.frame_bytes} bytes; copy it again"
        )
    return replace(layout, begin=begin, frames=length // layout.frame_bytes)


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
    if kind not in _MAT_DTYPES:
        raise _DamagedError(f"an element of type {kind} where numbers are needed")
    dtype = np.dtype(order + _MAT_DTYPES[kind])
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
