"""Readers of files that are no text, by the key of their format; each loads what it needs."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import cast

from gearmon.errors import RecordingError
from gearmon.signals.reading.arrays import Holding
from gearmon.signals.reading.formats import Format
from gearmon.signals.reading.source import Source

# The module and the function that reads the format; another format is another line here.
_READERS = {
    "wav": ("wav", "read_wav"),
    "flac": ("flac", "read_flac"),
    "npy": ("numpy_files", "read_npy"),
    "npz": ("numpy_files", "read_npz"),
    "mat": ("matlab", "read_mat"),
    "hdf5": ("hdf5", "read_hdf5"),
    "tdms": ("tdms", "read_tdms"),
    "uff": ("universal", "read_universal"),
    "parquet": ("parquet", "read_parquet"),
}
_NAMES = "text, WAV, FLAC, npy, npz, MATLAB, HDF5, TDMS, UFF 58, Parquet"


def held_by(source: Source, found: Format) -> Holding:
    """Return what a file holds that is no text; the caller closes it.

    Parameters
    ----------
    source : Source
        The file.
    found : Format
        Its kind.

    Raises
    ------
    RecordingError
        If there is no reader for that kind, it is packed or comes through a pipe, or is damaged.
    """
    if found.key not in _READERS:
        raise RecordingError(
            f"{source.path}: looks like {found.what}, which is not read here; {found.remedy} "
            f"(read are: {_NAMES}; text plain or gzip)"
        )
    if source.zipped:
        raise RecordingError(f"{source.path}: {found.what} packed with gzip; unpack it first")
    if source.content is not None:
        raise RecordingError(
            f"{source.path}: {found.what} cannot be read through a pipe; give the file itself"
        )
    module, name = _READERS[found.key]
    loaded = importlib.import_module(f"gearmon.signals.reading.{module}")
    return cast(Callable[[str], Holding], getattr(loaded, name))(source.path)
