"""WAV files, read in blocks.

They may be plain RIFF, RF64 or BW64 (files beyond 4 GiB), integers of 8, 16, 24 and 32 bits, floats
of 32 and 64 bits, plain or with an extended format. The header is taken apart here: libraries give
a shorter recording where it announces more samples than there are (soundfile), or take half a
minute over 8 MB behind a header that was never completed, and no RF64 of this kind (SciPy 1.17).

References
----------
EBU Tech 3306, "MBWF / RF64: an extended file format for audio", 2009; Microsoft, "Multiple channel
audio data and WAVE files", 2007.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass, replace
from typing import BinaryIO

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.fields import Floats
from gearmon.signals.reading.formats.arrays import Array, Holding

_INTEGERS, _FLOATS, _EXTENSIBLE = 0x0001, 0x0003, 0xFFFE
_UNKNOWN_SIZE = 0xFFFFFFFF
_BIAS_8_BITS = 128
_LONGEST_REST = 1 << 24
_DTYPES = {
    (_INTEGERS, 8): "u1",
    (_INTEGERS, 16): "<i2",
    (_INTEGERS, 24): "u1",
    (_INTEGERS, 32): "<i4",
    (_FLOATS, 32): "<f4",
    (_FLOATS, 64): "<f8",
}


@dataclass(frozen=True, kw_only=True)
class _Layout:
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
        layout = _layout(path, stream)

    def read(start: int, stop: int) -> Floats:
        return _samples(layout, start, stop)

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


def _samples(layout: _Layout, start: int, stop: int) -> Floats:
    size = layout.frame_bytes
    raw = np.fromfile(
        layout.path,
        dtype=_DTYPES[layout.tag, layout.bits],
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


def _layout(path: str, stream: BinaryIO) -> _Layout:
    size = os.fstat(stream.fileno()).st_size
    begin = stream.read(12)
    if len(begin) < 12:
        raise RecordingError(f"{path}: a WAV file cut off in its header; copy it again")
    magic, _, kind = struct.unpack("<4sI4s", begin)
    if kind != b"WAVE":
        raise RecordingError(f"{path}: a RIFF file that holds no WAVE sound; export it as CSV")
    layout: _Layout | None = None
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
            layout = _format(path, body)
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


def _format(path: str, body: bytes) -> _Layout:
    if len(body) < 16:
        raise RecordingError(f"{path}: its WAV header is damaged (a format of {len(body)} bytes)")
    tag, channels, rate, a_second, frame_bytes, bits = struct.unpack("<HHIIHH", body[:16])
    if tag == _EXTENSIBLE and len(body) >= 26:
        tag = struct.unpack("<H", body[24:26])[0]
    if (tag, bits) not in _DTYPES:
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
    return _Layout(
        path=path, tag=tag, channels=channels, rate=rate, bytes_a_second=a_second, bits=bits
    )


def _with_samples(layout: _Layout, begin: int, length: int, size: int) -> _Layout:
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
