"""NumPy's own files: one array (npy, read in blocks) or several (npz)."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.fields import Floats
from gearmon.signals.reading.formats.arrays import Array, Holding, as_array, reading


def read_npy(path: str, what: str) -> Holding:
    """Return what an npy file holds: one array, or one channel for each field of its records.

    Raises
    ------
    RecordingError
        If it is damaged or holds Python objects.
    """
    with reading(path, what):
        stored = np.load(path, mmap_mode="r", allow_pickle=False)
    if stored.dtype.names:
        arrays: tuple[Array | None, ...] = _fields(stored)
    else:
        _check_not_square(path, stored.shape)
        arrays = (as_array("", stored),)
    found = tuple(array for array in arrays if array is not None)
    described = f"numbers of type {stored.dtype} and shape {stored.shape}"
    return Holding(path=path, what=what, arrays=found, together=True, left_out=(described,))


def _fields(stored: Any) -> tuple[Array, ...]:
    """Return the fields of records as channels of one array, as they lie side by side."""
    names = [name for name in stored.dtype.names or () if stored.dtype[name].kind in "fiu"]
    if not names or len(stored.shape) != 1 or any(stored.dtype[name].shape for name in names):
        return ()

    def read(start: int, stop: int) -> Floats:
        records = stored[start:stop]
        return np.stack([records[name].astype(np.float64) for name in names])

    units = (None,) * len(names)
    one = Array(name="", names=tuple(names), count=stored.shape[0], read=read, units=units)
    return (one,)


def read_npz(path: str, what: str) -> Holding:
    """Return what an npz file holds: its arrays and single numbers by name.

    Raises
    ------
    RecordingError
        If it is damaged.
    """
    with (
        reading(path, what),
        open(path, "rb") as stream,
        np.load(stream, allow_pickle=False) as archive,
    ):
        items = {name: archive[name] for name in archive.files if _is_plain(archive, name)}
        others = tuple(name for name in archive.files if name not in items)
    return hold(path, what, items, others)


def _is_plain(archive: Any, name: str) -> bool:
    try:
        return bool(archive[name].dtype.kind in "fiub")
    except ValueError:  # an array of Python objects
        return False


def hold(path: str, what: str, items: dict[str, Any], left_out: tuple[str, ...] = ()) -> Holding:
    """Return named arrays and single numbers as what a file holds.

    Parameters
    ----------
    path, what : str
        The file and its kind, for messages.
    items : dict of str to array-like
        Arrays and single numbers by name.
    left_out : tuple of str
        What else is in the file.

    Raises
    ------
    RecordingError
        If the only array has two axes of the same length.
    """
    arrays, facts, others = [], {}, list(left_out)
    for name, data in items.items():
        if data.dtype.kind in "fiu" and all(size == 1 for size in data.shape):
            facts[name] = float(np.asarray(data[()]).reshape(-1)[0])
            continue
        array = as_array(name, data)
        if array is None:
            others.append(f"{name} of shape {data.shape} and type {data.dtype}")
        else:
            arrays.append(array)
    if not arrays and len(items) - len(facts) == 1:
        shape = next(data.shape for name, data in items.items() if name not in facts)
        _check_not_square(path, shape)
    left = tuple(others)
    return Holding(path=path, what=what, arrays=tuple(arrays), facts=facts, left_out=left)


def _check_not_square(path: str, shape: tuple[int, ...]) -> None:
    long_axes = [size for size in shape if size != 1]
    if len(long_axes) == 2 and long_axes[0] == long_axes[1]:
        raise RecordingError(
            f"{path}: an array of shape {shape}: which axis is time cannot be told; store one "
            "channel, or more samples than channels"
        )
