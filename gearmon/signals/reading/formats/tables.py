"""Files of named arrays or columns: HDF5 (MATLAB 7.3 among them) and Parquet."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from gearmon.signals.reading.fields import Floats
from gearmon.signals.reading.formats.arrays import (
    Array,
    Holding,
    Read,
    as_array,
    reading,
    stated_rate,
)

_UNIT_KEYS = (b"unit", b"units")
_UNIT_NAMES = ("unit", "units", "Unit", "Units")
# MATLAB stores text as numbers, and cells as references to what lies in #refs#.
_NO_SIGNALS = ("char", "cell", "struct", "function_handle")


def read_hdf5(path: str, what: str) -> Holding:
    """Return what an HDF5 file holds: all its arrays and single numbers, by their paths.

    Attributes of an array tell its unit (`units`) and its sampling rate (`fs`, `sampling_rate`
    ...); attributes of the file and of groups count as single numbers.

    Raises
    ------
    RecordingError
        If the file is damaged.
    """
    import h5py

    with reading(path, what):
        file = h5py.File(path, "r")
    try:
        with reading(path, what):
            return _held_arrays(path, what, file)
    except BaseException:
        file.close()
        raise


def _held_arrays(path: str, what: str, file: Any) -> Holding:
    import h5py

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
        what=what,
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
    array = as_array(name, item, unit=_unit_of_array(item.attrs), rate_hz=rate)
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


def _unit_of_array(attributes: Any) -> str | None:
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


def read_parquet(path: str, what: str) -> Holding:
    """Return what a Parquet table holds: its columns of numbers and times.

    The metadata of a column may tell its unit (`unit`), that of the table the sampling rate (`fs`,
    `sampling_rate` ...).

    Raises
    ------
    RecordingError
        If the file is damaged.
    """
    from pyarrow import parquet

    with reading(path, what):
        file = parquet.ParquetFile(path)
    try:
        with reading(path, what):
            return _held_columns(path, what, file)
    except BaseException:
        file.close()
        raise


def _held_columns(path: str, what: str, file: Any) -> Holding:
    import pyarrow

    schema, rows = file.schema_arrow, file.metadata.num_rows
    kept = [field for field in schema if _is_numeric(pyarrow, field.type)]
    index = _index_of_frame(schema)
    names = tuple(field.name for field in kept)
    units = tuple(_unit_of_column(pyarrow, field) for field in kept)
    arrays = []
    if rows >= 2 and names:
        whole = lru_cache(maxsize=1)(lambda name: _floats(file.read([name]).column(0)))
        arrays = [
            Array(name=n, names=(n,), count=rows, read=_part_of(whole, n), units=(u,))
            for n, u in zip(names, units, strict=True)
            if n not in index
        ]
    return Holding(
        path=path,
        what=what,
        arrays=tuple(arrays),
        together=True,
        facts=_facts(schema.metadata or {}),
        left_out=tuple(f"{field.name} ({field.type})" for field in schema if field not in kept),
        notes=tuple(
            f"column '{field.name}' holds no numbers: left out"
            for field in schema
            if field not in kept
        ),
        close=file.close,
    )


def _part_of(whole: Callable[[str], Floats], name: str) -> Read:
    return lambda start, stop: whole(name)[None, start:stop]


def _is_numeric(pyarrow: Any, kind: Any) -> bool:
    types = pyarrow.types
    return bool(
        types.is_integer(kind)
        or types.is_floating(kind)
        or types.is_decimal(kind)
        or types.is_timestamp(kind)
    )


def _unit_of_column(pyarrow: Any, field: Any) -> str | None:
    if pyarrow.types.is_timestamp(field.type):
        return "s"
    for key in _UNIT_KEYS:
        text = (field.metadata or {}).get(key, b"").decode(errors="replace").strip()
        if text:
            return str(text)
    return None


def _index_of_frame(schema: Any) -> frozenset[str]:
    """Return the columns that are only the row labels of a data frame."""
    return frozenset(name for name in schema.names if name.startswith("__index_level_"))


def _facts(metadata: dict[bytes, bytes]) -> dict[str, float]:
    found = {}
    for key, value in metadata.items():
        try:
            found[key.decode(errors="replace")] = float(value)
        except ValueError:
            continue
    return found


def _floats(column: Any) -> Floats:
    """Return a column as numbers; time stamps in seconds from the first one on."""
    import pyarrow
    import pyarrow.compute

    if pyarrow.types.is_timestamp(column.type):
        # seconds since 1970 as floats would lose the microseconds
        steps = pyarrow.compute.subtract(column, column[0]).cast(pyarrow.duration("ns"))
        return np.asarray(steps.cast(pyarrow.int64()).to_numpy(), dtype=np.float64) * 1e-9
    if pyarrow.types.is_decimal(column.type):
        column = column.cast(pyarrow.float64())
    return np.asarray(column.to_numpy(), dtype=np.float64)
