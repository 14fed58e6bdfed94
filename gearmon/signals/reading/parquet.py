"""Parquet tables: one column for each channel, read by row groups."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearmon.signals.reading.arrays import Array, Holding, load_library, reading
from gearmon.signals.reading.rounding import Floats

WHAT = "an Apache Parquet table"
EXTRA = "parquet"
_UNIT_KEYS = (b"unit", b"units")


def read_parquet(path: str) -> Holding:
    """Return what a Parquet table holds: its columns of numbers and times.

    The metadata of a column may tell its unit (`unit`), that of the table the sampling rate (`fs`,
    `sampling_rate` ...).

    Raises
    ------
    RecordingError
        If pyarrow is not installed or the file is damaged.
    """
    parquet = load_library("pyarrow.parquet", EXTRA, path, WHAT)
    with reading(path, WHAT):
        file = parquet.ParquetFile(path)
    try:
        with reading(path, WHAT):
            return _held(path, file)
    except BaseException:
        file.close()
        raise


def _held(path: str, file: Any) -> Holding:
    import pyarrow

    schema, rows = file.schema_arrow, file.metadata.num_rows
    groups = _Groups(file)
    kept = [field for field in schema if _is_numeric(pyarrow, field.type)]
    index = _index_of_frame(schema)
    names = tuple(field.name for field in kept)
    units = tuple(_unit(pyarrow, field) for field in kept)
    arrays = []
    if rows >= 2 and names:
        arrays = [_array(groups, rows, n, u) for n, u in zip(names, units, strict=True)]
        arrays = [array for array in arrays if array.name not in index]
    return Holding(
        path=path,
        what=WHAT,
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


def _unit(pyarrow: Any, field: Any) -> str | None:
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


def _array(groups: _Groups, rows: int, name: str, unit: str | None) -> Array:
    def read(start: int, stop: int) -> Floats:
        return groups.column(name, start, stop).reshape(1, -1)

    return Array(name=name, names=(name,), count=rows, read=read, units=(unit,))
