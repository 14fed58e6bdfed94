"""Kinds of files: told by their first bytes, never by their names; one table of all at the end.

A loader gives a `Holding` while its file is open: arrays that may be signals, read in blocks, and
the facts beside them. `arrays.choose` picks the arrays that are the recording. Here stand the
loaders that need no further library: WAV, NumPy's (npy, npz), MATLAB's up to version 7.

WAV files may be plain RIFF, RF64 or BW64 (beyond 4 GiB), integers of 8, 16, 24 and 32 bits, floats
of 32 and 64 bits, plain or with an extended format. Their chunks must fill the file: libraries give
a shorter recording where the header announces more samples than there are (soundfile), or take half
a minute over 8 MB behind a header that was never completed (SciPy 1.17).

MATLAB files (7.3 is HDF5) are read by SciPy, first in a process of its own that has as much memory
as a file of that size may take: SciPy 1.17 crashed on 6 of 1,400 that were changed at random.

References
----------
EBU Tech 3306, "MBWF / RF64: an extended file format for audio", 2009; Microsoft, "Multiple channel
audio data and WAVE files", 2007.
"""

from __future__ import annotations

import os
import re
import struct
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import GearmonError, RecordingError
from gearmon.files import archive_swells
from gearmon.signals.reading import extras
from gearmon.signals.reading.arrays import Array, Holding, choose, hold
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.columns import Table
from gearmon.signals.reading.source import Source, open_source, shortened
from gearmon.signals.reading.text import read_table

Loader = Callable[[str], AbstractContextManager[Holding]]


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Parameters
    ----------
    what : str
        What it is, for messages.
    magic : bytes
        Regular expression of how it begins.
    loader : callable or None
        Reads it; None if it is not read.
    extra : str
        The extra of gearmon that installs the library that the loader needs.
    remedy : str
        What to do if it is not read.
    """

    what: str
    magic: bytes
    loader: Loader | None = None
    extra: str = ""
    remedy: str = "export it as CSV"


_READ = "text, WAV, FLAC, npy, npz, MATLAB, HDF5, TDMS, UFF 58, Parquet"
_NO_UNIT = "tells no unit: state unit and sensitivity in a [[sensor]] of the machine file"
_FLOATS, _EXTENSIBLE = 3, 0xFFFE
_UNKNOWN_SIZE = 0xFFFFFFFF
# Format and bits of a sample -> its type; three bytes are taken as the upper ones of four, so that
# sign and full scale come out right.
_WAV_SAMPLES = {(1, 8): "<u1", (1, 16): "<i2", (1, 24): "<i4", (1, 32): "<i4"}
_WAV_SAMPLES |= {(_FLOATS, 32): "<f4", (_FLOATS, 64): "<f8"}
_CONTROL = bytes(set(range(32)) - set(b"\t\n\v\f\r\x1a\x1b")) + b"\x7f"
_BLANK = b"\x00 \t\r\n\xef\xbb\xbf\xff\xfe"


def identify(source: Source) -> Format | None:
    """Return what kind of file it is; None for a text.

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
    known = next((own for own in _FORMATS if re.match(own.magic, head, re.DOTALL)), None)
    # binary if more than one byte in a hundred of the beginning is no character
    sample = head[:4096]
    controls = len(sample) - len(sample.translate(None, _CONTROL))
    binary = controls > max(2, 0.01 * len(sample)) and source.encoding in ("", "utf-8-sig")
    return known or (
        Format("a binary file of unknown kind, or UTF-16 without its mark", b"") if binary else None
    )


def read_file(path: str | Path, wanted: Wanted) -> Table:
    """Return the recording in a file.

    Parameters
    ----------
    path : str or Path
        The file, or a pipe such as ``/dev/stdin``.
    wanted : Wanted
        What the user says.

    Raises
    ------
    RecordingError
        If there is no such file or it holds no recording, its kind is not read or its library is
        not installed, or it is packed, comes through a pipe or is damaged.
    """
    source = open_source(path)
    found = identify(source)
    return _read_arrays(source, found, wanted) if found else read_table(source, wanted)


def _read_arrays(source: Source, found: Format, wanted: Wanted) -> Table:
    if found.loader is None:
        raise RecordingError(
            f"{source.path}: looks like {found.what}, which is not read here; {found.remedy} "
            f"(read are: {_READ}; text plain or gzip)"
        )
    if source.zipped or source.content is not None:
        pipe = "cannot be read through a pipe; give the file itself"
        how = "packed with gzip; unpack it first" if source.zipped else pipe
        raise RecordingError(f"{source.path}: {found.what} {how}")
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
    # what a library raises about a damaged file is anything but documented
    except Exception as error:
        first = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise RecordingError(
            f"{source.path}: looks like {found.what} and cannot be read as such "
            f"({shortened(first)}); is it damaged? Copy it again"
        ) from None


@contextmanager
def read_wav(path: str) -> Iterator[Holding]:
    """Give what a WAV file holds: one array, its sampling rate, no unit.

    Raises
    ------
    RecordingError
        If the header is damaged, the samples are compressed, or fewer are there than announced.
    """
    chunks = _wav_chunks(np.memmap(path, np.uint8, "r"))
    form, data = bytes(chunks[b"fmt "]), chunks[b"data"]
    if len(form) < 16:
        raise ValueError("it does not say what its samples are")
    tag, channels, rate, a_second, frame, bits = struct.unpack("<HHIIHH", form[:16])
    tag = int.from_bytes(form[24:26], "little") if tag == _EXTENSIBLE else tag
    if (tag, bits) not in _WAV_SAMPLES:
        raise RecordingError(
            f"{path}: a WAV file with {bits}-bit samples of format {tag:#06x}; read are integers "
            "of 8, 16, 24 or 32 bits and floats of 32 or 64: export it as one of these"
        )
    if not channels or not rate or frame != channels * bits // 8 or len(data) % frame:
        raise ValueError(f"{len(data)} bytes, {channels} channels, {bits} bits, {rate} Hz")
    kind = np.dtype(_WAV_SAMPLES[tag, bits])
    full_scale = 1.0 if tag == _FLOATS else 2.0 ** (8 * kind.itemsize - 1)
    frames = data.reshape(-1, channels, bits // 8)

    def read(start: int, stop: int) -> FloatArray:
        part = np.pad(frames[start:stop], ((0, 0), (0, 0), (kind.itemsize - bits // 8, 0)))
        values = part.view(kind)[..., 0].T.astype(np.float64)
        values -= full_scale if kind.kind == "u" else 0.0
        values /= full_scale  # a power of two: exact
        return values

    how = "float" if tag == _FLOATS else "integer, full scale is taken as 1"
    note = f"{bits}-bit {how}; a WAV file {_NO_UNIT}"
    # some writers leave out how many bytes a second has; one that contradicts leaves the rate open
    rate_hz = float(rate) if a_second in (0, rate * frame) else None
    array = Array(name="", names=("",) * channels, count=len(frames), read=read, rate_hz=rate_hz)
    yield Holding(arrays=(array,), together=True, notes=(note,))


def _wav_chunks(raw: Any) -> dict[bytes, Any]:
    """Return the chunks of a WAV file by their names; nothing may lie beside them but zeros."""
    chunks, place = {b"fmt ": raw[:0], b"data": raw[:0]}, 12
    while place < len(raw):
        name, size = bytes(raw[place:][:4]), int.from_bytes(raw[place + 4 :][:4], "little")
        if not any(name) and not raw[place:].any():
            break
        begin, there = place + 8, max(0, len(raw) - place - 8)
        if name == b"data" and b"ds64" in chunks and size == _UNKNOWN_SIZE:
            size = int.from_bytes(chunks[b"ds64"][8:16], "little")
        if name == b"data" and size in (0, _UNKNOWN_SIZE):
            raise ValueError(f"its header was never completed; {there} bytes follow it")
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

    load = partial(loadmat, path, simplify_cells=True)
    extras.try_out(path, load)
    items: dict[str, Any] = {}
    left = [(name, own) for name, own in load().items() if not name.startswith("__")]
    while left:
        name, own = left.pop(0)
        if isinstance(own, dict):
            left = [(f"{name}.{key}", value) for key, value in own.items()] + left
        else:
            items[name] = np.asarray(own)
    yield hold(items)


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
    yield replace(hold(items), together=True)


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
    yield hold(items, others)


_BEGIN = rb"(?i:(?:\xef\xbb\xbf)?\s*"
_PACKED = rb"PK[\x03\x05]|BZh|\xfd7zXZ\0|\x28\xb5\x2f\xfd|7z\xbc\xaf|Rar!|\x1f\x8b|.{257}ustar"
_HDF5 = rb"\x89HDF\r\n\x1a\n|MATLAB 7\.3 MAT-file"
_UFF = rb" {4}-1\s*\r?\n {0,4}(?:15|55|58|58b|82|151|164|24\d\d)\s"
_PAGE = "save the file itself, not the page that offers it"
# First match wins.
_FORMATS = (
    Format("a WAV sound file", rb"R(IFF|F64)|BW64", read_wav),
    Format("a FLAC sound file", rb"fLaC", extras.read_flac, "flac"),
    Format("a NumPy array (npy)", rb"\x93NUMPY", read_npy),
    Format("a NumPy archive (npz)", rb"PK\x03\x04.{26}[^\0]*?\.npy", read_npz),
    Format("a MATLAB file", rb"MATLAB 5\.0 MAT-file", read_mat),
    Format("an HDF5 or MATLAB 7.3 file", _HDF5, extras.read_hdf5, "hdf5"),
    Format("an Apache Parquet table", rb"PAR1", extras.read_parquet, "parquet"),
    Format("a TDMS file (LabVIEW)", rb"TDSm", extras.read_tdms, "tdms"),
    Format("a universal file (UFF)", _UFF, extras.read_universal, "uff"),
    Format("an Excel workbook", rb"PK\x03\x04.*(\[Content_Types\]\.xml|xl/)|\xd0\xcf\x11\xe0"),
    Format("an archive or a compressed file", _PACKED, remedy="unpack it first"),
    Format("an Ogg sound file", rb"OggS"),
    Format("an MDF measurement file", rb"MDF "),
    Format("a PDF document", rb"%PDF-"),
    Format("a JSON document", _BEGIN + rb"\{)"),
    Format("a pointer left by Git LFS", rb"version https://git-lfs", remedy="fetch the data"),
    Format("a web page", _BEGIN + rb"<(!doctype )?html)", remedy=_PAGE),
)
