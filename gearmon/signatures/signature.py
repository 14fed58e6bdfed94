"""The signature: order lines with amplitude and phase, where they come from, and their files.

Amplitudes are peak values, 2|z_n| for the complex coefficient z_n; `phase_rad` is the phase of the
displacement as a cosine, at the instant when tooth 1 of both gears enters contact. Units stand in
the names.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, SignatureError, check_type, nearest_name
from gearmon.files import replacing, write_atomically
from gearmon.result import Result

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
FORMAT = "gearmon signature 1"
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

    def save(self, path: str | Path) -> list[Path]:
        """Write it as `write_signature` does, for `read_signature`; or its picture."""
        if Path(path).suffix in (".png", ".svg", ".pdf"):
            return super().save(path)
        write_signature(self, path)
        return [Path(path)]

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


def _restored(value: Any) -> Any:
    """Undo what `plain` did to numbers that JSON lacks."""
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
    target = Path(path)
    suffix = _suffix(target)
    if suffix == ".parquet":
        _write_parquet(signature, target)
    else:
        write_atomically(target, _to_csv(signature) if suffix == ".csv" else _to_json(signature))


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
    if not source.is_file():
        raise SignatureError(f"{source}: there is no such file")
    if suffix == ".parquet":
        return _read_parquet(source)
    try:
        text = source.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise SignatureError(f"{source}: cannot be read as text; not a signature") from None
    return _from_csv(text, source) if suffix == ".csv" else _from_json(text, source)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        near = nearest_name(suffix, SUFFIXES)
        hint = f"; did you mean {near}?" if near else ""
        raise ArgumentError(f"{path}: suffix must be one of {', '.join(SUFFIXES)}{hint}")
    return suffix


def _about(signature: Signature) -> dict[str, Any]:
    """Return everything but the lines."""
    about = {"format": FORMAT, "machine": signature.machine, "origin": signature.origin}
    return about | {key: plain(value) for key, value in signature.header.items()}


def _check_format(about: dict[str, Any], path: Path) -> None:
    if about.get("format") != FORMAT:
        raise SignatureError(
            f"{path}: is not a signature: it must say format {FORMAT!r}, and says "
            f"{about.get('format')!r}"
        )


def _assembled(about: dict[str, Any], columns: dict[str, Any], path: Path) -> Signature:
    """Put a signature together from what was read, or say what is wrong with it."""
    header = _restored({key: value for key, value in about.items() if key not in RESERVED})
    machine, origin = (str(about.get(key, "")) for key in ("machine", "origin"))
    try:
        return Signature(machine=machine, origin=origin, header=header, columns=columns)
    except (ArgumentError, ValueError, TypeError) as error:
        raise SignatureError(f"{path}: {error}") from None


def _to_csv(signature: Signature) -> str:
    text = io.StringIO()
    for key, value in _about(signature).items():
        text.write(f"# {key}: {json.dumps(value, allow_nan=False, ensure_ascii=False)}\n")
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(signature.columns)
    # Python writes the shortest digits that give the same number back
    rows.writerows(zip(*(c.tolist() for c in signature.columns.values()), strict=True))
    return text.getvalue()


def _from_csv(text: str, path: Path) -> Signature:
    lines = text.splitlines()
    count = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    about: dict[str, Any] = {}
    for number, line in enumerate(lines[:count], start=1):
        key, _, value = line[1:].strip().partition(": ")
        try:
            about[key] = json.loads(value)
        except json.JSONDecodeError:
            raise SignatureError(f"{path}, line {number}: {line!r} is not '# key: value'") from None
    _check_format(about, path)
    return _assembled(about, _csv_columns(lines, count, path), path)


def _csv_columns(lines: list[str], start: int, path: Path) -> dict[str, Any]:
    table = csv.reader(lines[start:])
    names = next(table, [])
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise SignatureError(f"{path}, line {start + 1}: column {missing[0]} is missing")
    columns: dict[str, list[Any]] = {name: [] for name in names}
    for number, row in enumerate(table, start=start + 2):
        if len(row) != len(names):
            raise SignatureError(
                f"{path}, line {number}: {len(row)} values for {len(names)} columns; truncated?"
            )
        for name, word in zip(names, row, strict=True):
            columns[name].append(_value(name, word, number, path))
    return columns


def _value(name: str, word: str, number: int, path: Path) -> str | float:
    if name in TEXT_COLUMNS:
        return word
    try:
        return float(word)
    except ValueError:
        if name not in COLUMNS:
            return word
        raise SignatureError(
            f"{path}, line {number}, column {name}: {word!r} is not a number"
        ) from None


def _to_json(signature: Signature) -> str:
    rows = ",\n".join(json.dumps(row, allow_nan=False) for row in signature.rows())
    whole = _about(signature) | {"columns": list(signature.columns)}
    about = json.dumps(whole, allow_nan=False, ensure_ascii=False, indent=1)
    return f'{about.removesuffix("}").rstrip()},\n "rows": [\n{rows}\n]}}\n'


def _from_json(text: str, path: Path) -> Signature:
    try:
        whole = json.loads(text)
    except json.JSONDecodeError as error:
        raise SignatureError(
            f"{path}, line {error.lineno}: not valid JSON ({error.msg}); truncated?"
        ) from None
    about = whole if isinstance(whole, dict) else {}
    _check_format(about, path)
    rows = about.get("rows")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise SignatureError(f"{path}: rows must be a list of mappings")
    names = about.get("columns", list(COLUMNS))
    for number, row in enumerate(rows, start=1):
        if row.keys() != set(names):
            raise SignatureError(f"{path}, row {number}: its columns are not those announced")
    return _assembled(about, {name: [row[name] for row in rows] for name in names}, path)


def _parquet() -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise ArgumentError(
            "Parquet files need pyarrow: pip install 'gearmon[parquet]', or use .csv or .json"
        ) from None
    return pyarrow


def _write_parquet(signature: Signature, path: Path) -> None:
    pyarrow = _parquet()
    table = pyarrow.table(dict(signature.columns))
    about = json.dumps(_about(signature), allow_nan=False)
    table = table.replace_schema_metadata({"gearmon": about})
    with replacing(path) as temporary:
        pyarrow.parquet.write_table(table, temporary)


def _read_parquet(path: Path) -> Signature:
    pyarrow = _parquet()
    try:
        table = pyarrow.parquet.read_table(path)
    except (pyarrow.ArrowException, OSError):
        raise SignatureError(f"{path}: not a Parquet file, or a damaged one") from None
    stored = (table.schema.metadata or {}).get(b"gearmon")
    about = json.loads(stored) if stored else {}
    _check_format(about, path)
    return _assembled(about, {name: table[name].to_pylist() for name in table.column_names}, path)


def signature_lines(signature: Signature, most: int = 30) -> list[str]:
    """Return a compact table: what holds for each stage, then its strongest lines by frequency.

    Parameters
    ----------
    signature : Signature
        What to show.
    most : int
        Largest number of lines, taken by acceleration.
    """
    lines = [f"{signature.machine or 'machine'}: {signature.origin} signature"]
    for stage in signature.header.get("stages", []):
        lines += _stage_lines(stage)
    strongest = np.sort(np.argsort(-signature["acceleration_ms2"], kind="stable")[:most])
    strongest = strongest[np.argsort(signature["frequency_hz"][strongest], kind="stable")]
    lines.append("")
    lines.append(
        f"{'stage':>5} {'line':<18} {'order':>10} {'Hz':>10} {'displacement um':>16} "
        f"{'velocity mm/s':>14} {'acceleration m/s2':>18} {'phase deg':>10}"
    )
    lines += [_line(signature, int(index)) for index in strongest]
    if len(signature) > len(strongest):
        lines.append(f"({len(strongest)} strongest of {len(signature)} lines; peak amplitudes)")
    else:
        lines.append("(peak amplitudes)")
    return lines


def line_name(mesh_harmonic: int, sideband: int, sideband_of: str) -> str:
    """Return the name of a line, such as "mesh 2", "mesh 2 -3 pinion" or "5 pinion".

    Examples
    --------
    >>> line_name(2, -3, "pinion")
    'mesh 2 -3 pinion'
    """
    if not sideband:
        return f"mesh {mesh_harmonic}"
    if not mesh_harmonic:
        return f"{sideband} {sideband_of}"
    return f"mesh {mesh_harmonic} {sideband:+d} {sideband_of}"


def _line(signature: Signature, index: int) -> str:
    name = line_name(
        int(signature["mesh_harmonic"][index]),
        int(signature["sideband"][index]),
        str(signature["sideband_of"][index]),
    )
    return (
        f"{signature['stage'][index]:>5} {name:<18} {signature['order'][index]:>10.4f} "
        f"{signature['frequency_hz'][index]:>10.2f} "
        f"{1e6 * signature['displacement_m'][index]:>16.4g} "
        f"{1e3 * signature['velocity_ms'][index]:>14.4g} "
        f"{signature['acceleration_ms2'][index]:>18.4g} "
        f"{math.degrees(signature['phase_rad'][index]):>10.1f}"
    )


def _stage_lines(stage: dict[str, object]) -> list[str]:
    """Return what holds for one stage, as far as the header tells it."""
    shown = (
        ("mesh frequency", "mesh_frequency_hz", "Hz"),
        ("mean stiffness", "mean_stiffness_n_per_m", "N/m"),
        ("stiffness variation", "stiffness_variation", ""),
        ("contact ratio", "contact_ratio", ""),
        ("natural frequency", "natural_frequency_hz", "Hz"),
        ("damping ratio", "damping_ratio", ""),
        ("error bound", "error_bound", ""),
        ("estimated error", "error_estimate", ""),
    )
    parts = [
        f"{label} {stage[key]:.5g}{' ' + unit if unit else ''}"
        for label, key, unit in shown
        if isinstance(stage.get(key), float)
    ]
    lines = [f"stage {stage.get('stage', 1)}: {', '.join(parts)}"]
    if stage.get("message"):
        lines.append(f"  {stage['message']}")
    if stage.get("contact_lost"):
        lines.append("  teeth lose contact in every period: the linear model ends there")
    return lines
