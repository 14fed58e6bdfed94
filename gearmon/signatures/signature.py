"""The signature: order lines with amplitude and phase, where they come from, and their files.

Amplitudes are peak values, 2|z_n| for the complex coefficient z_n; `phase_rad` is the phase of the
displacement as a cosine, at the instant when tooth 1 of both gears enters contact. Units stand in
the names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError

INTEGER_COLUMNS = ("stage", "mesh_harmonic", "sideband")
TEXT_COLUMNS = ("sideband_of",)
COLUMNS = (
    "stage",
    "mesh_harmonic",
    "sideband",
    "sideband_of",
    "order",
    "frequency_hz",
    "displacement_m",
    "velocity_ms",
    "acceleration_ms2",
    "phase_rad",
)

Array = npt.NDArray[Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Signature:
    """Lines of a machine, expected or measured.

    Parameters
    ----------
    machine : str
        Name of the machine.
    origin : str
        "expected", "measured" or another word for where it comes from.
    header : mapping
        What holds for all lines: numbers, words, lists and mappings of them.
    columns : mapping of str to array, shape (lines,)
        All of `COLUMNS` in any order, and others if wanted. Every line lies at ``mesh_harmonic``
        mesh orders of its stage plus ``sideband`` turns of the gear ``sideband_of`` ("" for a mesh
        line).

    Raises
    ------
    ArgumentError
        If a column is missing, of another length, or not finite.

    Examples
    --------
    >>> import numpy as np
    >>> line = {name: np.array([0.0]) for name in COLUMNS} | {"sideband_of": np.array([""])}
    >>> signature = Signature(machine="pump", origin="expected", header={}, columns=line)
    >>> len(signature), signature["stage"].dtype.kind
    (1, 'i')
    """

    machine: str
    origin: str
    header: Mapping[str, Any]
    columns: Mapping[str, Array]

    def __post_init__(self) -> None:
        taken = {"format", "machine", "origin", "columns", "rows"} & set(self.header)
        if taken:
            raise ArgumentError(f"signature: header key {min(taken)} is reserved; use another name")
        missing = [name for name in COLUMNS if name not in self.columns]
        if missing:
            raise ArgumentError(f"signature: column {missing[0]} is missing")
        names = [*COLUMNS, *(name for name in self.columns if name not in COLUMNS)]
        columns = {name: _column(name, self.columns[name]) for name in names}
        lengths = {name: len(column) for name, column in columns.items()}
        for name, length in lengths.items():
            if length != lengths["stage"]:
                raise ArgumentError(
                    f"signature: column {name} has {length} values, stage has {lengths['stage']}"
                )
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "header", MappingProxyType(dict(self.header)))

    def __len__(self) -> int:
        return len(self.columns["stage"])

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the lines as mappings of column name to Python number or text."""
        names = list(self.columns)
        for values in zip(*(self.columns[name].tolist() for name in names), strict=True):
            yield dict(zip(names, values, strict=True))

    def to_dict(self) -> dict[str, Any]:
        """Return machine, origin, header and rows as built-in types that JSON can hold."""
        return {
            "machine": self.machine,
            "origin": self.origin,
            **plain(dict(self.header)),
            "rows": [plain(row) for row in self.rows()],
        }


def _column(name: str, values: npt.ArrayLike) -> Array:
    """Return a read-only copy of a column in its type."""
    array: Array = np.array(values, dtype=str if name in TEXT_COLUMNS else None)
    if array.ndim != 1:
        raise ArgumentError(f"signature: column {name} has shape {array.shape}, must be one row")
    if array.dtype.kind in "iuf":
        array = _numbers(name, array.astype(float))
    elif array.dtype.kind != "U" or (name in COLUMNS and name not in TEXT_COLUMNS):
        raise ArgumentError(f"signature: column {name} must hold numbers")
    array.flags.writeable = False
    return array


def _numbers(name: str, array: Array) -> Array:
    if name in COLUMNS and not np.isfinite(array).all():
        line = int(np.flatnonzero(~np.isfinite(array))[0]) + 1
        raise ArgumentError(f"signature: {name} of line {line} is not a finite number")
    if name not in INTEGER_COLUMNS:
        return array
    whole = array.astype(int)
    if (whole != array).any():
        raise ArgumentError(f"signature: column {name} must hold whole numbers")
    return whole


def plain(value: Any) -> Any:
    """Turn numbers and arrays into built-in types; numbers that JSON lacks into their names."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value


def restored(value: Any) -> Any:
    """Undo what `plain` did to numbers that JSON lacks."""
    if isinstance(value, dict):
        return {key: restored(item) for key, item in value.items()}
    if isinstance(value, list):
        return [restored(item) for item in value]
    return float(value) if value in ("inf", "-inf", "nan") else value


def write_signature(signature: Signature, path: str | Path) -> None:
    """Write a signature, in one step, in the format that the suffix names.

    Parameters
    ----------
    signature : Signature
        What to write.
    path : str or Path
        ``.csv`` (comment lines ``# key: value``, then rows), ``.json`` or ``.parquet``. What is
        read back is exactly what was written.

    Raises
    ------
    ArgumentError
        If the suffix is unknown, the file cannot be written, or Parquet support is not installed.
    """
    from gearmon.signatures import storage

    storage.write(signature, Path(path))


def read_signature(path: str | Path) -> Signature:
    """Read a signature written by `write_signature`.

    Raises
    ------
    SignatureError
        If the file is not there, is not a signature, or is damaged; with the line if there is one.
    ArgumentError
        If the suffix is unknown, or Parquet support is not installed.
    """
    from gearmon.signatures import storage

    return storage.read(Path(path))
