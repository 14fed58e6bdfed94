"""HDF5 files, MATLAB 7.3 files among them; samples are read in blocks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from gearmon.signals.reading.arrays import (
    Array,
    Holding,
    as_array,
    load_library,
    reading,
    stated_rate,
)

WHAT = "an HDF5 or MATLAB 7.3 file"
EXTRA = "hdf5"
_UNIT_NAMES = ("unit", "units", "Unit", "Units")
# MATLAB stores text as numbers, and cells as references to what lies in #refs#.
_NO_SIGNALS = ("char", "cell", "struct", "function_handle")


def read_hdf5(path: str) -> Holding:
    """Return what an HDF5 file holds: all its arrays and single numbers, by their paths.

    Attributes of an array tell its unit (`units`) and its sampling rate (`fs`, `sampling_rate`
    ...); attributes of the file and of groups count as single numbers.

    Raises
    ------
    RecordingError
        If h5py is not installed or the file is damaged.
    """
    h5py = load_library("h5py", EXTRA, path, WHAT)
    with reading(path, WHAT):
        file = h5py.File(path, "r")
    try:
        with reading(path, WHAT):
            return _held(path, file, h5py)
    except BaseException:
        file.close()
        raise


def _held(path: str, file: Any, h5py: Any) -> Holding:
    arrays: list[Array] = []
    facts = _numbers(file.attrs, "")
    others: list[str] = []
    for name, item in _walk(file):
        if isinstance(item, h5py.Group):
            facts |= _numbers(item.attrs, f"{name}.")
        elif isinstance(item, h5py.Dataset):
            _gather(name, item, arrays, facts, others)
    return Holding(
        path=path,
        what=WHAT,
        arrays=tuple(arrays),
        facts=facts,
        left_out=tuple(others),
        close=file.close,
    )


def _walk(group: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key in group:
        if key.startswith("#"):
            continue
        item = group.get(key)
        if item is None:  # a link that leads nowhere
            continue
        yield prefix + key, item
        if hasattr(item, "keys") and group.get(key, getlink=True).__class__.__name__ == "HardLink":
            yield from _walk(item, f"{prefix}{key}/")


def _gather(
    name: str, item: Any, arrays: list[Array], facts: dict[str, float], others: list[str]
) -> None:
    kind = item.attrs.get("MATLAB_class", b"")
    text = kind.decode(errors="replace") if isinstance(kind, bytes) else str(kind)
    if item.shape is None or item.dtype.kind not in "fiub" or text in _NO_SIGNALS:
        others.append(f"{name} ({text or item.dtype})")
        return
    if all(size == 1 for size in item.shape):
        facts[name] = float(np.asarray(item[()], dtype=np.float64).reshape(-1)[0])
        return
    rate, _ = stated_rate(_numbers(item.attrs, ""))
    array = as_array(name, item, unit=_unit(item.attrs), rate_hz=rate)
    if array is None:
        others.append(f"{name} of shape {item.shape}")
    else:
        arrays.append(replace(array, names=_names(item.attrs, array.names)))


def _numbers(attributes: Any, prefix: str) -> dict[str, float]:
    found = {}
    for key in attributes:
        value = np.asarray(attributes[key])
        if value.dtype.kind in "fiu" and value.size == 1:
            found[f"{prefix}{key}"] = float(value.reshape(-1)[0])
    return found


def _unit(attributes: Any) -> str | None:
    for key in _UNIT_NAMES:
        value = attributes.get(key)
        text = value.decode(errors="replace") if isinstance(value, bytes) else value
        if isinstance(text, str) and text.strip():
            return text.strip()
    return None


def _names(attributes: Any, usual: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of channels that an attribute lists, if there is one for each."""
    for key in ("channel_names", "channels", "names"):
        value = np.asarray(attributes.get(key, ()))
        if value.shape == (len(usual),) and value.dtype.kind in "OSU":
            return tuple(
                one.decode(errors="replace") if isinstance(one, bytes) else str(one)
                for one in value.tolist()
            )
    return usual
