"""Kinds of files: told by their first bytes, never by their names; one table of all.

A loader gives a `Holding` while its file is open: arrays that may be signals, read in blocks, and
the facts beside them. `arrays.choose` picks the arrays that are the recording.
"""

from __future__ import annotations

import importlib
import os
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace

from gearmon.errors import GearmonError, RecordingError
from gearmon.signals.reading.arrays import Holding, choose
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.columns import Content
from gearmon.signals.reading.source import Progress, Room, Source, shortened

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
    loader : str
        Module and function that read it; "" if it is not read.
    needs : str
        The library that the loader needs.
    extra : str
        The extra of gearmon that installs this library.
    remedy : str
        What to do if it is not read.
    """

    what: str
    magic: tuple[bytes, ...] = ()
    loader: str = ""
    needs: str = ""
    extra: str = ""
    remedy: str = "export it as CSV"

    @property
    def is_text(self) -> bool:
        """Whether it is read line by line."""
        return self is TEXT


TEXT = Format("text")
_BINARY = Format("a binary file of unknown kind")
_UFF = Format("a universal file (UFF)", (), "extras.read_universal", "pyuff", "uff")
_NPZ = Format("a NumPy archive (npz)", (), "plain.read_npz")
_XLSX = Format("an Excel workbook (xlsx)")
_ZIP = Format("a zip archive", (b"PK\x05\x06",), remedy=_UNPACK)
_TAR = Format("a tar archive", remedy=_UNPACK)
_PAGE = "save the file itself, not the page that offers it"
# First match wins.
_FORMATS = (
    Format("a WAV sound file", (b"RIFF", b"RF64", b"BW64"), "plain.read_wav"),
    Format("a FLAC sound file", (b"fLaC",), "extras.read_flac", "soundfile", "flac"),
    Format("a NumPy array (npy)", (b"\x93NUMPY",), "plain.read_npy"),
    Format("a MATLAB file", (b"MATLAB 5.0 MAT-file",), "plain.read_mat"),
    Format(
        "an HDF5 or MATLAB 7.3 file",
        (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file"),
        "extras.read_hdf5",
        "h5py",
        "hdf5",
    ),
    Format(
        "an Apache Parquet table", (b"PAR1",), "extras.read_parquet", "pyarrow.parquet", "parquet"
    ),
    Format("a TDMS file (LabVIEW)", (b"TDSm",), "extras.read_tdms", "nptdms", "tdms"),
    _ZIP,
    Format("an Apache Arrow file", (b"ARROW1",)),
    Format("an Ogg sound file", (b"OggS",)),
    Format("an MDF measurement file", (b"MDF ",)),
    Format("an old Excel or Office document", (b"\xd0\xcf\x11\xe0",)),
    Format("a file compressed with bzip2", (b"BZh",), remedy=_UNPACK),
    Format("a file compressed with xz", (b"\xfd7zXZ\x00",), remedy=_UNPACK),
    Format("a file compressed with zstd", (b"\x28\xb5\x2f\xfd",), remedy=_UNPACK),
    Format("a 7-Zip archive", (b"7z\xbc\xaf\x27\x1c",), remedy=_UNPACK),
    Format("a RAR archive", (b"Rar!\x1a\x07",), remedy=_UNPACK),
    Format("a file compressed twice", (b"\x1f\x8b",), remedy=_UNPACK),
    Format("an SQLite database", (b"SQLite format 3\x00",)),
    Format("a PDF document", (b"%PDF-",)),
    Format("a picture", (b"\x89PNG", b"\xff\xd8\xff")),
    Format("a JSON document", (b"{",)),
    Format(
        "a pointer left by Git LFS instead of the data",
        (b"version https://git-lfs",),
        remedy="fetch the data",
    ),
    Format("a web page", (b"<!doctype html", b"<html"), remedy=_PAGE),
    Format("an XML document", (b"<?xml",)),
)
_READ = "text, WAV, FLAC, npy, npz, MATLAB, HDF5, TDMS, UFF 58, Parquet"
_UNIVERSAL_FILE = re.compile(rb" {4}-1\s*\r?\n {0,4}(?:15|55|58|58b|82|151|164|24\d\d)\s")
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


def read_arrays(
    source: Source, found: Format, wanted: Wanted, progress: Progress | None, room: Room
) -> tuple[Content, Wanted]:
    """Return the recording in a file that is no text, and what the user says about its columns.

    Parameters
    ----------
    source : Source
        The file.
    found : Format
        Its kind.
    wanted : Wanted
        What the user says.
    progress : callable or None
        Called with the share of the samples that has been read.
    room : callable
        Gives an array of a shape.

    Raises
    ------
    RecordingError
        If that kind is not read or its library is not installed, the file is packed, comes through
        a pipe, or is damaged, or holds no recording.
    """
    if not found.loader:
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
    try:
        if found.needs:
            importlib.import_module(found.needs)
    except ImportError:
        raise RecordingError(
            f"{source.path}: looks like {found.what}; to read it install gearmon[{found.extra}], "
            "or export it as CSV"
        ) from None
    module, _, name = found.loader.partition(".")
    load: Loader = getattr(importlib.import_module(f"gearmon.signals.reading.{module}"), name)
    size = os.path.getsize(source.path)
    with _reading(source.path, found.what), load(source.path) as loaded:
        holding = replace(loaded, path=source.path, what=found.what, size=size)
        return choose(holding, wanted, progress, room)


@contextmanager
def _reading(path: str, what: str) -> Iterator[None]:
    """Turn whatever a library raises about a damaged file into one line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a library's remarks on a file that it can read
            yield
    except GearmonError:
        raise
    except MemoryError:
        raise RecordingError(
            f"{path}: {what} whose content does not fit into memory; cut it into parts"
        ) from None
    # what a library raises about a damaged file is anything but documented
    except Exception as error:
        first = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise RecordingError(
            f"{path}: looks like {what} and cannot be read as such ({shortened(first)}); is it "
            "damaged? Copy it again"
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
