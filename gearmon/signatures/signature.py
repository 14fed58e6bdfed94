"""The signature: order lines with amplitude and phase, where they come from, and their files.

Amplitudes are peak values, 2|z_n| for the complex coefficient z_n; `phase_rad` is the phase of the
displacement as a cosine, at the instant when tooth 1 of both gears enters contact. Units stand in
the names.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, SignatureError, check_type, check_word
from gearmon.files import parquet, write_atomically
from gearmon.result import Result

INTEGER_COLUMNS = ("stage", "mesh_harmonic", "sideband")
TEXT_COLUMNS = ("sideband_of",)
SIZES = ("displacement_m", "velocity_ms", "acceleration_ms2")
COLUMNS = (*INTEGER_COLUMNS, *TEXT_COLUMNS, "order", "frequency_hz", *SIZES, "phase_rad")
FORMAT = "gearmon signature 1"
#: What the phases and amplitudes of expected lines mean.
AMPLITUDES = "peak; phase of the displacement as a cosine when tooth 1 enters contact"
RESERVED = ("format", "machine", "origin", "columns", "rows")
SUFFIXES = (".csv", ".json", ".parquet")

Array = npt.NDArray[Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Signature(Result):
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
    >>> [row["order"] for row in gearmon.expected_signature(machine, max_hz=1500.0).rows()]
    [23.0, 46.0]
    >>> gearmon.expected_signature(machine, max_hz=1500.0).save("healthy.csv")[0].name
    'healthy.csv'
    >>> gearmon.expected_signature(machine, max_hz=1500.0).to_dict()["machine"]
    'drive'
    """

    machine: str
    origin: str
    header: Mapping[str, Any]
    columns: Mapping[str, Array]
    picture = "expected_plots.signature_figure"

    def __post_init__(self) -> None:
        taken = set(RESERVED) & set(self.header)
        if taken:
            raise ArgumentError(f"signature: header key {min(taken)} is reserved; use another name")
        missing = [name for name in COLUMNS if name not in self.columns]
        if missing:
            raise ArgumentError(f"signature: column {missing[0]} is missing")
        names = [*COLUMNS, *(name for name in self.columns if name not in COLUMNS)]
        columns = {name: _column(name, self.columns[name]) for name in names}
        stages = len(columns["stage"])
        for name, own in columns.items():
            if len(own) != stages:
                raise ArgumentError(
                    f"signature: column {name} has {len(own)} values, stage has {stages}"
                )
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "header", MappingProxyType(dict(self.header)))

    def __len__(self) -> int:
        return len(self.columns["stage"])

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def save(self, path: str | Path) -> list[Path]:
        """Write it as `write_signature` does, for `read_signature`; or its picture."""
        if Path(path).suffix in (".png", ".svg", ".pdf"):
            return super().save(path)
        write_signature(self, path)
        return [Path(path)]

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the lines as mappings of column name to Python number or text."""
        for values in zip(*(own.tolist() for own in self.columns.values()), strict=True):
            yield dict(zip(self.columns, values, strict=True))

    def to_dict(self) -> dict[str, Any]:
        """Return machine, origin, header and rows as built-in types that JSON can hold."""
        told = {name: own for name, own in _about(self).items() if name != "format"}
        return told | {"rows": _plain(list(self.rows()))}


def _column(name: str, values: npt.ArrayLike) -> Array:
    """Return a read-only copy of a column in its type."""
    array: Array = np.array(values, dtype=str if name in TEXT_COLUMNS else None)
    if array.ndim != 1:
        raise ArgumentError(f"signature: column {name} has shape {array.shape}, must be one row")
    if array.dtype.kind in "iuf":
        array = array.astype(float)
        if name in COLUMNS and not np.isfinite(array).all():
            line = int(np.flatnonzero(~np.isfinite(array))[0]) + 1
            raise ArgumentError(f"signature: {name} of line {line} is not a finite number")
        if name in INTEGER_COLUMNS:
            if (array % 1).any():
                raise ArgumentError(f"signature: column {name} must hold whole numbers")
            array = array.astype(int)
    elif array.dtype.kind != "U" or (name in COLUMNS and name not in TEXT_COLUMNS):
        raise ArgumentError(f"signature: column {name} must hold numbers")
    array.flags.writeable = False
    return array


def _plain(value: Any) -> Any:
    """Turn numbers and arrays into built-in types; numbers that JSON lacks into their names."""
    text = json.dumps(value, default=lambda own: own.tolist())
    return json.loads(text, parse_constant=lambda name: str(float(name)))


def _restored(value: Any) -> Any:
    """Undo what `_plain` did to numbers that JSON lacks."""
    if isinstance(value, dict):
        return {key: _restored(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_restored(item) for item in value]
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

    Examples
    --------
    >>> gearmon.write_signature(gearmon.expected_signature(machine, max_hz=2000.0), "healthy.csv")
    """
    check_type("signature", signature, Signature, "what gearmon.expected_signature returns")
    suffix, about, columns = _suffix(Path(path)), _about(signature), dict(signature.columns)
    told: bytes | str
    if suffix == ".parquet":
        pyarrow, file = parquet(), io.BytesIO()
        own = {"gearmon": json.dumps(about, allow_nan=False)}
        pyarrow.parquet.write_table(pyarrow.table(columns).replace_schema_metadata(own), file)
        told = file.getvalue()
    elif suffix == ".json":
        rows = ",\n".join(json.dumps(row, allow_nan=False) for row in signature.rows())
        about |= {"columns": list(columns)}
        head = json.dumps(about, allow_nan=False, ensure_ascii=False, indent=1)
        told = f'{head.removesuffix("}").rstrip()},\n "rows": [\n{rows}\n]}}\n'
    else:
        import pandas as pd

        lines = (
            f"# {key}: {json.dumps(value, allow_nan=False, ensure_ascii=False)}\n"
            for key, value in about.items()
        )
        # the shortest digits that give the same number back
        told = "".join(lines) + pd.DataFrame(columns).to_csv(index=False)
    write_atomically(path, told)


def read_signature(path: str | Path) -> Signature:
    """Read a signature written by `write_signature`.

    Parameters
    ----------
    path : str or Path
        A .csv, .parquet or .json file.

    Returns
    -------
    Signature

    Raises
    ------
    SignatureError
        If the file is not there, is not a signature, or is damaged; with the line if there is one.
    ArgumentError
        If the suffix is unknown, or Parquet support is not installed.

    Examples
    --------
    >>> gearmon.write_signature(gearmon.expected_signature(machine, max_hz=2000.0), "healthy.csv")
    >>> gearmon.read_signature("healthy.csv").machine == machine.name
    True
    """
    source = Path(path)
    suffix = _suffix(source)
    try:
        data = source.read_bytes()
    except OSError as error:
        raise SignatureError(f"{source}: cannot be read ({error.strerror})") from None
    pyarrow = parquet() if suffix == ".parquet" else None
    try:
        about, columns = _read(data, suffix, pyarrow)
        if not isinstance(about, dict) or about.get("format") != FORMAT:
            says = about.get("format") if isinstance(about, dict) else about
            raise ArgumentError(f"it must say format {FORMAT!r}, and says {says!r}")
        return Signature(
            machine=str(about.get("machine", "")),
            origin=str(about.get("origin", "")),
            header=_restored({key: own for key, own in about.items() if key not in RESERVED}),
            columns=columns,
        )
    except (ValueError, TypeError, KeyError, OSError, RecursionError) as error:
        # of a damaged file pandas and pyarrow tell the line where they can
        why = str(error).strip().splitlines()[0]
        raise SignatureError(f"{source}: not a signature, or a damaged one ({why})") from None


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    check_word(f"{path}: suffix=", suffix, SUFFIXES)
    return suffix


def _about(signature: Signature) -> dict[str, Any]:
    """Return everything but the lines."""
    about = {"format": FORMAT, "machine": signature.machine, "origin": signature.origin}
    return {**about, **_plain(dict(signature.header))}


def _read(data: bytes, suffix: str, pyarrow: Any) -> tuple[Any, dict[str, Any]]:
    """Return all but the lines, and the columns, as a file tells them."""
    if suffix == ".parquet":
        table = pyarrow.parquet.read_table(pyarrow.BufferReader(data))
        stored = (table.schema.metadata or {}).get(b"gearmon", "null")
        return json.loads(stored), table.to_pydict()
    text = data.decode("utf-8")
    if suffix == ".json":
        whole = json.loads(text)
        told = whole if isinstance(whole, dict) else {}
        names, rows = told.get("columns", ()), told.get("rows", ())
        return whole, {name: [row[name] for row in rows] for name in names}
    import pandas as pd

    heads = list(takewhile(lambda line: line.startswith("#"), text.splitlines()))
    pairs = (line[1:].strip().partition(": ") for line in heads)
    about = {key: json.loads(value) for key, _, value in pairs}
    table = pd.read_csv(
        io.StringIO(text),
        skiprows=len(heads),
        index_col=False,
        keep_default_na=False,
        dtype=dict.fromkeys(TEXT_COLUMNS, str),
    )
    # what is no number is not finite
    numeric = [name for name in COLUMNS if name not in TEXT_COLUMNS and name in table]
    table[numeric] = table[numeric].apply(pd.to_numeric, errors="coerce")
    return about, {str(name): table[name].tolist() for name in table}
