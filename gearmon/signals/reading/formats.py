"""Kinds of files: told by their first bytes, never by their names; one table of all at the end.

A loader gives a `Holding` while its file is open: arrays that may be signals, read in blocks, and
the facts beside them. `arrays.choose` picks the arrays that are the recording. Here stand the
loaders that need no further library: WAV, NumPy's (npy, npz), MATLAB's up to version 7.

WAV files may be plain RIFF, RF64 or BW64 (beyond 4 GiB), integers of 8, 16, 24 and 32 bits, floats
of 32 and 64 bits, plain or with an extended format. Their chunks must fill the file: libraries give
a shorter recording where the header announces more samples than there are (soundfile), or take half
a minute over 8 MB behind a header that was never completed (SciPy 1.17).

MATLAB files (7.3 is HDF5) are unpacked here, so that none swells, and read by SciPy, first in a
process of its own: SciPy 1.17 crashed on 6 of 1,400 that were changed at random.

References
----------
EBU Tech 3306, "MBWF / RF64: an extended file format for audio", 2009; Microsoft, "Multiple channel
audio data and WAVE files", 2007; MathWorks, "MAT-File Format", 2023, chapter 1.
"""

from __future__ import annotations

import io
import os
import re
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import GearmonError, RecordingError
from gearmon.files import archive_swells, most_unpacked
from gearmon.signals.reading import extras
from gearmon.signals.reading.arrays import Array, Holding, choose, hold
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.columns import Table
from gearmon.signals.reading.source import Source, shortened

Loader = Callable[[str], AbstractContextManager[Holding]]

_UNPACK = "unpack it first"


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Parameters
    ----------
    what : str
        What it is, for messages.
    magic : tuple of bytes
        How it begins. Text in lower case is compared regardless of case, after leading blanks.
    loader : callable or None
        Reads it; None if it is not read.
    extra : str
        The extra of gearmon that installs the library that the loader needs.
    remedy : str
        What to do if it is not read.
    """

    what: str
    magic: tuple[bytes, ...] = ()
    loader: Loader | None = None
    extra: str = ""
    remedy: str = "export it as CSV"

    @property
    def is_text(self) -> bool:
        """Whether it is read line by line."""
        return self is TEXT


_READ = "text, WAV, FLAC, npy, npz, MATLAB, HDF5, TDMS, UFF 58, Parquet"
_UNIVERSAL_FILE = re.compile(rb" {4}-1\s*\r?\n {0,4}(?:15|55|58|58b|82|151|164|24\d\d)\s")
_FLOATS, _EXTENSIBLE = 3, 0xFFFE
_UNKNOWN_SIZE = 0xFFFFFFFF
# Format and bits of a sample -> its type, its zero and full scale; three bytes are taken as the
# upper ones of four, so that sign and full scale come out right.
_WAV_SAMPLES = {
    (1, 8): ("u1", 128, 2.0**7),
    (1, 16): ("<i2", 0, 2.0**15),
    (1, 24): ("<i4", 0, 2.0**31),
    (1, 32): ("<i4", 0, 2.0**31),
    (_FLOATS, 32): ("<f4", 0, 1.0),
    (_FLOATS, 64): ("<f8", 0, 1.0),
}
_MAT_HEADER, _COMPRESSED = 128, 15


_CONTROL = bytes(set(range(32)) - set(b"\t\n\v\f\r\x1a\x1b")) + b"\x7f"
_BLANK = b"\x00 \t\r\n\xef\xbb\xbf\xff\xfe"


def identify(source: Source) -> Format:
    """Return what kind of file it is.

    Parameters
    ----------
    source : Source
        The file.

    Raises
    ------
    RecordingError
        If the file is empty.
    """
    head = source.head(64 * 1024)
    if not head.strip(_BLANK):
        zeros = " (only zero bytes: was the recorder switched off while it wrote?)"
        of_what = zeros if b"\x00" in head else " (only blanks)" if head else ""
        raise RecordingError(f"{source.path}: is empty{of_what}; nothing to analyse")
    named = _named(head)
    if named is not None:
        return named
    # binary if more than one byte in a hundred of the beginning is no character
    sample = head[:4096]
    controls = len(sample) - len(sample.translate(None, _CONTROL))
    binary = controls > max(2, 0.01 * len(sample))
    return _BINARY if source.encoding in ("", "utf-8-sig") and binary else TEXT


def read_arrays(source: Source, found: Format, wanted: Wanted) -> Table:
    """Return the recording in a file that is no text.

    Parameters
    ----------
    source : Source
        The file.
    found : Format
        Its kind.
    wanted : Wanted
        What the user says.

    Raises
    ------
    RecordingError
        If that kind is not read or its library is not installed, the file is packed, comes through
        a pipe, or is damaged, or holds no recording.
    """
    if found.loader is None:
        raise RecordingError(
            f"{source.path}: looks like {found.what}, which is not read here; {found.remedy} "
            f"(read are: {_READ}; text plain or gzip)"
        )
    if source.zipped:
        raise RecordingError(f"{source.path}: {found.what} packed with gzip; unpack it first")
    if source.content is not None:
        raise RecordingError(
            f"{source.path}: {found.what} cannot be read through a pipe; give the file itself"
        )
    size = os.path.getsize(source.path)
    try:
        with warnings.catch_warnings(), found.loader(source.path) as loaded:
            warnings.simplefilter("ignore")  # a library's remarks on a file that it can read
            holding = replace(loaded, path=source.path, what=found.what, size=size)
            return choose(holding, wanted)
    except GearmonError:
        raise
    except ImportError:
        raise RecordingError(
            f"{source.path}: looks like {found.what}; to read it install gearmon[{found.extra}], "
            "or export it as CSV"
        ) from None
    except MemoryError:
        raise RecordingError(
            f"{source.path}: {found.what} whose content does not fit into memory; cut it into parts"
        ) from None
    # what a library raises about a damaged file is anything but documented
    except Exception as error:
        first = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise RecordingError(
            f"{source.path}: looks like {found.what} and cannot be read as such "
            f"({shortened(first)}); is it damaged? Copy it again"
        ) from None


def _named(head: bytes) -> Format | None:
    if head.startswith(b"PK\x03\x04"):
        first_member = head[30 : 30 + int.from_bytes(head[26:28], "little")]
        if first_member.endswith(b".npy"):
            return _NPZ
        return _XLSX if b"[Content_Types].xml" in head or b"xl/" in head else _ZIP
    begin = head.lstrip(b"\xef\xbb\xbf\r\n\t ")[:64].lower()
    for found in _FORMATS:
        texts = tuple(magic for magic in found.magic if magic.islower())
        if head.startswith(found.magic) or begin.startswith(texts):
            return found
    if _UNIVERSAL_FILE.match(head):
        return _UFF
    return _TAR if head[257:262] == b"ustar" else None


@contextmanager
def read_wav(path: str) -> Iterator[Holding]:
    """Give what a WAV file holds: one array, its sampling rate, no unit.

    Raises
    ------
    RecordingError
        If the header is damaged, the samples are compressed, or fewer are there than announced.
    """
    chunks = _wav_chunks(path, np.memmap(path, np.uint8, "r"))
    if not {b"fmt ", b"data"} <= chunks.keys():
        raise ValueError("it has no samples, or does not say what they are")
    form, data = bytes(chunks[b"fmt "]), chunks[b"data"]
    tag, channels, rate, a_second, frame, bits = struct.unpack("<HHIIHH", form[:16])
    tag = int.from_bytes(form[24:26], "little") if tag == _EXTENSIBLE else tag
    if (tag, bits) not in _WAV_SAMPLES:
        raise RecordingError(
            f"{path}: a WAV file with {bits}-bit samples of format {tag:#06x}; read are integers "
            "of 8, 16, 24 or 32 bits and floats of 32 or 64: export it as one of these"
        )
    if not channels or not rate or frame != channels * bits // 8 or len(data) % frame:
        raise ValueError(f"{len(data)} bytes, {channels} channels, {bits} bits, {rate} Hz")
    kind, zero, full = _WAV_SAMPLES[tag, bits]
    frames = data.reshape(-1, channels, bits // 8)

    def read(start: int, stop: int) -> FloatArray:
        part = np.asarray(frames[start:stop])
        part = np.pad(part, ((0, 0), (0, 0), (1, 0))) if bits == 24 else part
        values = np.ascontiguousarray(part).view(kind)[..., 0].T.astype(np.float64)
        values -= zero
        values /= full  # a power of two: exact
        return values

    how = "float" if tag == _FLOATS else "integer, full scale is taken as 1"
    yield Holding(
        arrays=(Array(name="", names=("",) * channels, count=len(frames), read=read),),
        together=True,
        # some writers leave one of the two out
        facts={
            "header.sampling rate": rate,
            "bytes a second.sampling rate": a_second / frame or rate,
        },
        notes=(
            f"{bits}-bit {how}; a WAV file tells no unit: state unit and sensitivity in a "
            "[[sensor]] of the machine file",
        ),
    )


def _wav_chunks(path: str, raw: Any) -> dict[bytes, Any]:
    """Return the chunks of a WAV file by their names; nothing may lie beside them but zeros."""
    magic, kind, place = bytes(raw[:4]), bytes(raw[8:12]), 12
    chunks: dict[bytes, Any] = {}
    if kind != b"WAVE":
        raise RecordingError(f"{path}: a RIFF file that holds no WAVE sound; export it as CSV")
    while place < len(raw):
        name, size = bytes(raw[place:][:4]), int.from_bytes(raw[place + 4 :][:4], "little")
        begin, there = place + 8, max(0, len(raw) - place - 8)
        if not any(name) and not raw[place:].any():
            break
        if name == b"data" and magic != b"RIFF" and size == _UNKNOWN_SIZE:
            size = int.from_bytes(chunks.get(b"ds64", raw[:0])[8:16], "little")
        if name == b"data" and size in (0, _UNKNOWN_SIZE):
            raise RecordingError(
                f"{path}: its WAV header was never completed (was the recorder switched off while "
                f"it wrote?); {there} bytes follow it: mend the header with a sound program"
            )
        if size > there or not name.isascii():
            raise ValueError(f"a chunk of {size} bytes where {there} are left")
        chunks[name], place = raw[begin : begin + size], begin + size + size % 2
    return chunks


@contextmanager
def read_mat(path: str) -> Iterator[Holding]:
    """Give what a MATLAB file holds: its arrays and single numbers, those of structs by a dot.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    from scipy.io import loadmat

    plain = _unpacked_mat(Path(path).read_bytes())
    load = partial(loadmat, io.BytesIO(plain), simplify_cells=True)
    if not extras.outlived(load):
        raise ValueError("it is so damaged that reading it crashes")
    items: dict[str, Any] = {}
    left = [(name, own) for name, own in load().items() if not name.startswith("__")]
    while left:
        name, own = left.pop(0)
        if isinstance(own, dict):
            left = [(f"{name}.{key}", value) for key, value in own.items()] + left
        else:
            items[name] = np.asarray(own)
    yield hold(path, items)


def _unpacked_mat(content: bytes) -> bytes:
    """Return the file with its compressed elements unpacked."""
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise ValueError("no order of bytes")
    parts, place, most = [content[:_MAT_HEADER]], _MAT_HEADER, most_unpacked(len(content))
    while place < len(content):
        kind, size = struct.unpack_from(f"{order}II", content, place)
        own = content[place : place + 8 + size]
        if len(own) < 8 + size:
            raise ValueError(f"an element of {size} bytes where {len(own) - 8} are left")
        if kind == _COMPRESSED:
            packer = zlib.decompressobj()
            own = packer.decompress(own[8:], most + 1)
            most -= len(own)
            if most < 0:
                raise ValueError("it unpacks to more than any")
            if not packer.eof:
                raise ValueError("a part is cut off")
        parts.append(own)
        place += 8 + size
    return b"".join(parts)


@contextmanager
def read_npy(path: str) -> Iterator[Holding]:
    """Give what an npy file holds: one array, or one channel for each field of its records.

    Raises
    ------
    ValueError
        If it is damaged or holds Python objects.
    """
    stored = np.load(path, mmap_mode="r", allow_pickle=False)
    if stored.offset + stored.nbytes != os.path.getsize(path):
        raise ValueError("bytes behind its numbers")
    # the fields of records are channels
    items = {name: stored[name] for name in stored.dtype.names or ()} or {"": stored}
    yield replace(hold(path, items), together=True)


@contextmanager
def read_npz(path: str) -> Iterator[Holding]:
    """Give what an npz file holds: its arrays and single numbers by name.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
        if archive_swells(archive):
            raise ValueError("it unpacks to more than any")
        items: dict[str, Any] = {}
        others: list[str] = []
        for name in archive.files:
            try:
                items[name] = archive[name]
            except ValueError:  # an array of Python objects
                others.append(name)
    yield hold(path, items, tuple(others))


TEXT = Format("text")
_BINARY = Format("a binary file of unknown kind")
_UFF = Format("a universal file (UFF)", (), extras.read_universal, "uff")
_NPZ = Format("a NumPy archive (npz)", (), read_npz)
_XLSX = Format("an Excel workbook (xlsx)")
_ZIP = Format("a zip archive", (b"PK\x05\x06",), remedy=_UNPACK)
_TAR = Format("a tar archive", remedy=_UNPACK)
_PAGE = "save the file itself, not the page that offers it"
_HDF5 = (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file")
# First match wins.
_FORMATS = (
    Format("a WAV sound file", (b"RIFF", b"RF64", b"BW64"), read_wav),
    Format("a FLAC sound file", (b"fLaC",), extras.read_flac, "flac"),
    Format("a NumPy array (npy)", (b"\x93NUMPY",), read_npy),
    Format("a MATLAB file", (b"MATLAB 5.0 MAT-file",), read_mat),
    Format("an HDF5 or MATLAB 7.3 file", _HDF5, extras.read_hdf5, "hdf5"),
    Format("an Apache Parquet table", (b"PAR1",), extras.read_parquet, "parquet"),
    Format("a TDMS file (LabVIEW)", (b"TDSm",), extras.read_tdms, "tdms"),
    _ZIP,
    Format("an Ogg sound file", (b"OggS",)),
    Format("an MDF measurement file", (b"MDF ",)),
    Format("an old Excel or Office document", (b"\xd0\xcf\x11\xe0",)),
    Format("a file compressed with bzip2", (b"BZh",), remedy=_UNPACK),
    Format("a file compressed with xz", (b"\xfd7zXZ\x00",), remedy=_UNPACK),
    Format("a file compressed with zstd", (b"\x28\xb5\x2f\xfd",), remedy=_UNPACK),
    Format("a 7-Zip archive", (b"7z\xbc\xaf\x27\x1c",), remedy=_UNPACK),
    Format("a RAR archive", (b"Rar!\x1a\x07",), remedy=_UNPACK),
    Format("a file compressed twice", (b"\x1f\x8b",), remedy=_UNPACK),
    Format("a PDF document", (b"%PDF-",)),
    Format("a JSON document", (b"{",)),
    Format("a pointer left by Git LFS", (b"version https://git-lfs",), remedy="fetch the data"),
    Format("a web page", (b"<!doctype html", b"<html"), remedy=_PAGE),
)
