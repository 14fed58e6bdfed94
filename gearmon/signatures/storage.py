"""Files of signatures: CSV, JSON and Parquet, each of which gives back exactly what was written."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

from gearmon.errors import ArgumentError, SignatureError, nearest_name
from gearmon.files import replacing, write_atomically
from gearmon.signatures.signature import (
    COLUMNS,
    TEXT_COLUMNS,
    Signature,
    plain,
    restored,
)

FORMAT = "gearmon signature 1"
RESERVED = ("format", "machine", "origin", "columns", "rows")
SUFFIXES = (".csv", ".json", ".parquet")


def write(signature: Signature, path: Path) -> None:
    """Write a signature in the format that the suffix of `path` names."""
    suffix = _suffix(path)
    if suffix == ".csv":
        write_atomically(path, _to_csv(signature))
    elif suffix == ".json":
        write_atomically(path, _to_json(signature))
    else:
        _write_parquet(signature, path)


def read(path: Path) -> Signature:
    """Read a signature from the format that the suffix of `path` names."""
    suffix = _suffix(path)
    if not path.is_file():
        raise SignatureError(f"{path}: there is no such file")
    if suffix == ".parquet":
        return _read_parquet(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise SignatureError(f"{path}: cannot be read as text; not a signature") from None
    return _from_csv(text, path) if suffix == ".csv" else _from_json(text, path)


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
    header = restored({key: value for key, value in about.items() if key not in RESERVED})
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
