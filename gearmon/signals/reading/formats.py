"""What a file is, told by its first bytes: a text, or something else that has a name."""

from __future__ import annotations

import re
from dataclasses import dataclass

from gearmon.errors import RecordingError
from gearmon.signals.reading.source import Source

_EXPORT = "export it as CSV"
_UNPACK = "unpack it first"


@dataclass(frozen=True, kw_only=True)
class Format:
    """A kind of file.

    Parameters
    ----------
    key : str
        Its short name, by which readers are found.
    what : str
        What it is, for messages.
    remedy : str
        What to do if no reader takes it.
    """

    key: str
    what: str
    remedy: str = _EXPORT


TEXT = Format(key="text", what="text")
_BINARY = Format(key="binary", what="a binary file of unknown kind")
_XLSX = Format(key="xlsx", what="an Excel workbook (xlsx)")
_ZIP = Format(key="zip", what="a zip archive", remedy=_UNPACK)
_TAR = Format(key="tar", what="a tar archive", remedy=_UNPACK)
_NPZ = Format(key="npz", what="a NumPy archive (npz)")
_UFF = Format(key="uff", what="a universal file (UFF)")
_WAV = Format(key="wav", what="a WAV sound file")
_HTML = Format(
    key="html", what="a web page", remedy="save the file itself, not the page that offers it"
)
_LFS = Format(
    key="lfs", what="a pointer left by Git LFS instead of the data", remedy="fetch the data"
)

# First match wins. Text in lower case is compared regardless of case, after leading blanks.
_SIGNATURES: tuple[tuple[bytes, Format], ...] = (
    (b"PAR1", Format(key="parquet", what="an Apache Parquet table")),
    (b"ARROW1", Format(key="arrow", what="an Apache Arrow file")),
    (b"\x89HDF\r\n\x1a\n", Format(key="hdf5", what="an HDF5 or MATLAB 7.3 file")),
    (b"MATLAB 7.3 MAT-file", Format(key="hdf5", what="an HDF5 or MATLAB 7.3 file")),
    (b"MATLAB 5.0 MAT-file", Format(key="mat", what="a MATLAB file")),
    (b"\x93NUMPY", Format(key="npy", what="a NumPy array (npy)")),
    (b"RIFF", _WAV),
    (b"RF64", _WAV),
    (b"BW64", _WAV),
    (b"fLaC", Format(key="flac", what="a FLAC sound file")),
    (b"OggS", Format(key="ogg", what="an Ogg sound file")),
    (b"TDSm", Format(key="tdms", what="a TDMS file (LabVIEW)")),
    (b"MDF ", Format(key="mdf", what="an MDF measurement file")),
    (b"\xd0\xcf\x11\xe0", Format(key="xls", what="an old Excel or Office document")),
    (b"PK\x05\x06", _ZIP),
    (b"BZh", Format(key="bzip2", what="a file compressed with bzip2", remedy=_UNPACK)),
    (b"\xfd7zXZ\x00", Format(key="xz", what="a file compressed with xz", remedy=_UNPACK)),
    (b"\x28\xb5\x2f\xfd", Format(key="zstd", what="a file compressed with zstd", remedy=_UNPACK)),
    (b"7z\xbc\xaf\x27\x1c", Format(key="7z", what="a 7-Zip archive", remedy=_UNPACK)),
    (b"Rar!\x1a\x07", Format(key="rar", what="a RAR archive", remedy=_UNPACK)),
    (b"\x1f\x8b", Format(key="gzip", what="a file compressed twice", remedy=_UNPACK)),
    (b"SQLite format 3\x00", Format(key="sqlite", what="an SQLite database")),
    (b"%PDF-", Format(key="pdf", what="a PDF document")),
    (b"\x89PNG", Format(key="png", what="a picture")),
    (b"\xff\xd8\xff", Format(key="jpeg", what="a picture")),
    (b"{", Format(key="json", what="a JSON document")),
    (b"version https://git-lfs", _LFS),
    (b"<!doctype html", _HTML),
    (b"<html", _HTML),
    (b"<?xml", Format(key="xml", what="an XML document")),
)
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
        raise RecordingError(f"{source.path}: is empty{_of_what(head)}; nothing to analyse")
    named = _named(head)
    if named is not None:
        return named
    return _BINARY if source.encoding in ("", "utf-8-sig") and _is_binary(head) else TEXT


def _named(head: bytes) -> Format | None:
    if head.startswith(b"PK\x03\x04"):
        if _first_member(head).endswith(b".npy"):
            return _NPZ
        return _XLSX if b"[Content_Types].xml" in head or b"xl/" in head else _ZIP
    begin = head.lstrip(b"\xef\xbb\xbf\r\n\t ")[:64].lower()
    for signature, found in _SIGNATURES:
        if head.startswith(signature) or (signature.islower() and begin.startswith(signature)):
            return found
    if _UNIVERSAL_FILE.match(head):
        return _UFF
    return _TAR if head[257:262] == b"ustar" else None


def _first_member(head: bytes) -> bytes:
    """Return the name of the first file in a zip archive."""
    return head[30 : 30 + int.from_bytes(head[26:28], "little")]


def _is_binary(head: bytes) -> bool:
    """Tell whether more than one byte in a hundred of the beginning is no character."""
    sample = head[:4096]
    controls = len(sample) - len(sample.translate(None, _CONTROL))
    return controls > max(2, 0.01 * len(sample))


def _of_what(head: bytes) -> str:
    if b"\x00" in head:
        return " (only zero bytes: was the recorder switched off while it wrote?)"
    return " (only blanks)" if head else ""
