"""FLAC files: packed sound without loss, read in blocks."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.arrays import Array, Holding, load_library, reading
from gearmon.signals.reading.rounding import Floats

WHAT = "a FLAC sound file"
EXTRA = "flac"
# What the library says of a file that does not tell how long it is.
_ENDLESS = 1 << 62


def read_flac(path: str) -> Holding:
    """Return what a FLAC file holds: one array, its sampling rate, no unit.

    Raises
    ------
    RecordingError
        If soundfile is not installed or the file is damaged.
    """
    library = load_library("soundfile", EXTRA, path, WHAT)
    with reading(path, WHAT):
        file = library.SoundFile(path)
    if not 0 < file.frames < _ENDLESS:
        file.close()
        raise RecordingError(f"{path}: a FLAC file that does not tell its length; pack it anew")
    array = Array(
        name="",
        names=("",) * file.channels,
        count=int(file.frames),
        read=_reader(file),
        units=(None,) * file.channels,
        rate_hz=float(file.samplerate),
    )
    note = (
        f"{file.subtype.replace('PCM_', '')}-bit integer, full scale is taken as 1; a FLAC file "
        "tells no unit: state unit and sensitivity in a [[sensor]] of the machine file"
    )
    return Holding(
        path=path, what=WHAT, arrays=(array,), together=True, notes=(note,), close=file.close
    )


def _reader(file: Any) -> Any:
    def read(start: int, stop: int) -> Floats:
        if file.tell() != start:
            file.seek(start)
        part = file.read(stop - start, dtype="float64", always_2d=True)
        return np.asarray(part, dtype=np.float64).T

    return read
