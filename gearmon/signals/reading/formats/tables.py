"""Files of named arrays or columns, read in blocks: HDF5 (MATLAB 7.3 among them) and Parquet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from gearmon.signals.reading.fields import Floats
from gearmon.signals.reading.formats.arrays import (
    Array,
    Holding,
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
    groups = _Groups(file)
    kept = [field for field in schema if _is_numeric(pyarrow, field.type)]
    index = _index_of_frame(schema)
    names = tuple(field.name for field in kept)
    units = tuple(_unit_of_column(pyarrow, field) for field in kept)
    arrays = []
    if rows >= 2 and names:
        arrays = [_column(groups, rows, n, u) for n, u in zip(names, units, strict=True)]
        arrays = [array for array in arrays if array.name not in index]
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


class _Groups:
    """Row groups of a table; the one last read is kept, as blocks are read in order."""

    def __init__(self, file: Any) -> None:
        self._file = file
        sizes = [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]
        self._starts = np.concatenate([[0], np.cumsum(sizes)])
        self._kept: tuple[int, Any] = (-1, None)
        self._origins: dict[str, Any] = {}

    def column(self, name: str, start: int, stop: int) -> Floats:
        first = int(np.searchsorted(self._starts, start, side="right")) - 1
        parts, place = [], start
        for group in range(first, len(self._starts) - 1):
            if place >= stop:
                break
            begin, end = int(self._starts[group]), int(self._starts[group + 1])
            piece = self._group(group).column(name).slice(place - begin, min(stop, end) - place)
            parts.append(_floats(piece, self._origin(name, piece)))
            place = min(stop, end)
        return np.concatenate(parts) if parts else np.empty(0)

    def _origin(self, name: str, piece: Any) -> Any:
        """Return the first time stamp: seconds since 1970 as floats would lose the microseconds."""
        if _is_timestamp(piece) and name not in self._origins:
            self._origins[name] = next(self._file.iter_batches(1, columns=[name]))[0][0]
        return self._origins.get(name)

    def _group(self, number: int) -> Any:
        if self._kept[0] != number:
            self._kept = (number, self._file.read_row_group(number))
        return self._kept[1]


def _is_timestamp(piece: Any) -> bool:
    import pyarrow

    return bool(pyarrow.types.is_timestamp(piece.type))


def _floats(piece: Any, origin: Any) -> Floats:
    import pyarrow
    import pyarrow.compute

    if _is_timestamp(piece):
        piece = pyarrow.compute.subtract(piece, origin).cast(pyarrow.duration("ns"))
        steps = piece.cast(pyarrow.int64()).to_numpy()
        return np.asarray(steps, dtype=np.float64) * 1e-9
    if pyarrow.types.is_decimal(piece.type):
        piece = piece.cast(pyarrow.float64())
    return np.asarray(piece.to_numpy(), dtype=np.float64)


def _column(groups: _Groups, rows: int, name: str, unit: str | None) -> Array:
    def read(start: int, stop: int) -> Floats:
        return groups.column(name, start, stop).reshape(1, -1)

    return Array(name=name, names=(name,), count=rows, read=read, units=(unit,))
