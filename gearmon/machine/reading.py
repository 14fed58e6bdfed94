"""From the tables of a machine file to a `Machine`."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from gearmon.errors import ArgumentError, MachineFileError, nearest_name
from gearmon.machine.fields import FieldError, shown_value
from gearmon.machine.parts import (
    TABLES,
    Bearing,
    Disc,
    Machine,
    OperatingPoint,
    Sensor,
    ShaftSection,
    Stage,
)
from gearmon.machine.stages import ParallelStage, PlanetaryStage

LARGEST_FILE_BYTES = 1 << 20

# A text of several lines, which holds no keys; the head of a table; a key.
_PLACE = re.compile(
    r"""(?s:(\"{3}|'{3}).*?(?:\1|\Z))|^[ \t]*(\[\[?)[ \t]*([\w-]+)[ \t]*\]\]?[ \t]*(?:#.*)?$"""
    r"""|^[ \t]*(["']?)([\w-]+)\4[ \t]*=""",
    re.ASCII | re.MULTILINE,
)
_POSITION = re.compile(r"^(.*?)\s*\(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL)
_DECIMAL_COMMA = re.compile(r"=\s*[+-]?\d+,\d")


@dataclass(frozen=True, kw_only=True)
class MachineSource:
    """The text of one machine file and its parsed content.

    Parameters
    ----------
    path : str
        The file.
    document : dict
        What the TOML parser made of it.
    lines : dict of str to int
        Line of each table and key, such as ``"stage[2].module_mm"``, as far as it is known.
    """

    path: str
    document: dict[str, Any]
    lines: dict[str, int] = field(default_factory=dict)

    def error(self, key: str, message: str) -> MachineFileError:
        """Return the error that says `message` about the line of `key`."""
        line = self.lines.get(key) or self.lines.get(key.rpartition(".")[0])
        place = f"{self.path}:{line}" if line else self.path or "machine"
        return MachineFileError(f"{place}: {message}")


def read_source(path: str | Path) -> MachineSource:
    """Open and parse a machine file.

    Raises
    ------
    MachineFileError
        If there is no such file, or it is not TOML in UTF-8.
    """
    shown = str(path)
    text = _decoded(shown, _read_bytes(Path(path), shown))
    return MachineSource(path=shown, document=_parsed(shown, text), lines=key_lines(text))


def key_lines(text: str) -> dict[str, int]:
    r"""Return the line of every table header and bare key of a TOML text, counted from 1.

    A key is written with its table; tables of an array are counted from 1. Inline and dotted
    tables are left out: a line not known is better than a wrong one.

    Examples
    --------
    >>> key_lines('name = "a"\n[[stage]]\nkind = "parallel"')
    {'name': 1, 'stage[1]': 2, 'stage[1].kind': 3}
    """
    found: dict[str, int] = {}
    counts: Counter[str] = Counter()
    prefix = ""
    for place in _PLACE.finditer(text.replace("\r", "")):
        _, brackets, label, _, key = place.groups()
        if brackets == "[[":
            counts[label] += 1
            label = f"{label}[{counts[label]}]"
        if label:
            prefix = f"{label}."
        if label or key:
            line = place.string.count("\n", 0, place.start()) + 1
            found.setdefault(label or prefix + key, line)
    return found


def _read_bytes(path: Path, shown: str) -> bytes:
    try:
        size, ordinary = path.stat().st_size, path.is_file()
        data = path.read_bytes() if ordinary and size <= LARGEST_FILE_BYTES else b""
    except FileNotFoundError:
        hint = "; give the name of a TOML file, standard input is not taken" if shown == "-" else ""
        raise MachineFileError(f"{shown}: no such file{hint}") from None
    except OSError as error:
        raise MachineFileError(f"{shown}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise MachineFileError(f"{shown!r}: is not the name of a file ({error})") from None
    if path.is_dir():
        raise MachineFileError(f"{shown}: is a folder; give the name of a machine file (TOML)")
    if not ordinary:
        raise MachineFileError(f"{shown}: is not an ordinary file")
    if size > LARGEST_FILE_BYTES:
        reason = f"has {size / 1e6:.1f} MB; a machine file is a short text (at most 1 MB)"
        raise MachineFileError(f"{shown}: {reason}")
    return data


def _decoded(shown: str, data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise MachineFileError(f"{shown}: is UTF-16 text; save it as UTF-8")
    if b"\0" in data:
        raise MachineFileError(f"{shown}: is a binary file; a machine file is TOML text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        reason = f"byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise MachineFileError(f"{shown}:{line}: {reason}") from None


def _parsed(shown: str, text: str) -> dict[str, Any]:
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _syntax_error(shown, text, str(error)) from None
    except ValueError:  # of int(): Python limits the digits that it converts
        raise MachineFileError(f"{shown}: holds an integer of thousands of digits") from None
    except RecursionError:
        raise MachineFileError(f"{shown}: holds arrays nested too deeply") from None
    if not document:
        raise MachineFileError(f"{shown}: is empty; a machine file has [operating] and [[stage]]")
    return document


def _syntax_error(shown: str, text: str, message: str) -> MachineFileError:
    """Return the parser's complaint with its place in front, the line itself and a remedy."""
    match = _POSITION.match(message)
    if match is None:
        return MachineFileError(f"{shown}: is not valid TOML: {_one_line(message)}")
    lines = text.splitlines()
    number = int(match[2]) if match[2] else max(len(lines), 1)
    line = lines[number - 1].strip() if number <= len(lines) else ""
    place = f"{number}:{match[3]}" if match[3] else f"{number}"
    printed = "".join(letter if letter.isprintable() else "?" for letter in line)
    here = f", in: {printed if len(printed) <= 60 else f'{printed[:57]}...'}" if line else ""
    here += " (decimal numbers take a point)" if _DECIMAL_COMMA.search(line) else ""
    complaint = _one_line(_reworded(match[1]))
    return MachineFileError(f"{shown}:{place}: not valid TOML: {complaint}{here}")


def _reworded(complaint: str) -> str:
    if complaint == "Cannot overwrite a value":
        return "this key stands here for the second time"
    if complaint.startswith("Cannot declare") and complaint.endswith("twice"):
        return "this [table] stands here for the second time; a list of them takes [[table]]"
    return complaint


def _one_line(text: str) -> str:
    return " ".join(text.split())


STAGE_KINDS: dict[str, type[Stage]] = {"parallel": ParallelStage, "planetary": PlanetaryStage}

#: Parts that a machine may have, by the names of their tables.
_PARTS = {"bearing": Bearing, "sensor": Sensor, "shaft": ShaftSection, "disc": Disc}
_TOP_KEYS = ("name", *TABLES)
_HOMES: dict[str, type] = (
    {"[operating]": OperatingPoint}
    | {f"[[{table}]]": part for table, part in _PARTS.items()}
    | {f'[[stage]] with kind = "{kind}"': part for kind, part in STAGE_KINDS.items()}
)

MOST_KEYS_LISTED = 10

_Part = TypeVar("_Part")


#: What `load_machine` takes.
MachineLike: TypeAlias = Machine | str | Path | Mapping[str, Any]


def example_machine() -> str:
    """Return the text of a machine file that demos and the benchmark write."""
    return resources.files("gearmon.machine").joinpath("example.toml").read_text("utf-8")


def load_machine(source: MachineLike | None = None, **tables: Any) -> Machine:
    """Return the machine in a file, a dictionary, or keywords of the same names.

    Parameters
    ----------
    source : str, Path, mapping or Machine, optional
        A TOML file with a table ``[operating]`` (or several ``[[operating]]``, a duty cycle with
        ``share``), one ``[[stage]]`` for each stage in the order of power flow, and optionally
        ``name``, ``[[shaft]]``, ``[[bearing]]``, ``[[disc]]`` and ``[[sensor]]``; or a
        dictionary of the same content, with a list where there are several tables. A Machine is
        returned as it is.
    **tables : mapping, or list of them
        The same as keywords, in the place of a source.

    Returns
    -------
    Machine
        With the file's name for want of a better one, and notes on what was derived.

    Raises
    ------
    MachineFileError
        If the file cannot be read, or anything in it is unknown, missing or impossible: one line
        with file, line, key, value and what is allowed.
    ArgumentError
        If the source is none of these.

    Examples
    --------
    >>> stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
    >>> load_machine(operating={"speed_rpm": 1480.0}, stage=stage).shaft_count
    2
    """
    if isinstance(source, Machine) and not tables:
        return source
    return _machine(_source(source, tables))


def _source(source: object, tables: dict[str, Any]) -> MachineSource:
    given = tables if source is None else source
    if source is not None and tables:
        raise ArgumentError(f"machine: given twice, also as {', '.join(tables)}=; give it once")
    if isinstance(given, str | Path):
        return read_source(given)
    if not isinstance(given, Mapping):
        raise ArgumentError(
            f"machine: {type(given).__name__} is no machine; give the name of a machine file, a "
            "dictionary with operating and stage, or a Machine"
        )
    document = dict(given)
    for name in _TOP_KEYS[2:]:
        if isinstance(given.get(name), Mapping):
            document[name] = [given[name]]
        elif isinstance(given.get(name), tuple):
            document[name] = list(given[name])
    return MachineSource(path="", document=document)


def _machine(source: MachineSource) -> Machine:
    refuse_unknown_keys(source, source.document, _TOP_KEYS, "")
    name = source.document.get("name", Path(source.path).stem or "machine")
    stages, notes = _stages(source)
    parts: dict[str, Any] = {
        TABLES[table]: [read_part(source, part, *own) for own in read_tables(source, table)]
        for table, part in _PARTS.items()
    }
    try:
        if not isinstance(name, str) or not name.strip() or not name.isprintable():
            raise FieldError("name", "must be one line of text in quotes", name)
        return Machine(
            name=name,
            operating=_operating_points(source),
            stages=stages,
            **parts,
            path=source.path,
            notes=notes,
        )
    except FieldError as error:
        raise source.error(error.key, error.message(error.key)) from None


def _operating_points(source: MachineSource) -> tuple[OperatingPoint, ...]:
    tables = read_tables(source, "operating", single=True)
    if not tables:
        told = "lacks an operating point; write [operating] with speed_rpm = 1460.0"
        raise source.error("", told)
    without = [label for label, table in tables if "share" not in table]
    if 0 < len(without) < len(tables):
        told = f"{without[0]} lacks share; give it to every point or to none"
        raise source.error(without[0], told)
    equal = {"share": 1 / len(tables)} if without else {}
    return tuple(read_part(source, OperatingPoint, label, equal | table) for label, table in tables)


def _stages(source: MachineSource) -> tuple[tuple[Stage, ...], tuple[str, ...]]:
    tables = read_tables(source, "stage")
    if not tables:
        example = '[[stage]] with kind = "parallel", pinion_teeth = 26, gear_teeth = 53'
        raise source.error("", f"lacks a stage; write {example}")
    stages, remarks = zip(*(_stage(source, *own) for own in tables), strict=True)
    notes = [f"stage {n}: {told}" for n, own in enumerate(remarks, start=1) for told in own]
    return stages, tuple(notes)


def _stage(source: MachineSource, label: str, table: dict[str, Any]) -> tuple[Stage, list[str]]:
    kind = table.get("kind")
    if kind is None:
        raise source.error(label, f'{label} lacks kind; write kind = "parallel" or "planetary"')
    if not isinstance(kind, str) or kind not in STAGE_KINDS:
        message = f'{label}.kind = {shown_value(kind)} must be "parallel" or "planetary"'
        raise source.error(f"{label}.kind", message)
    given, remarks = {key: own for key, own in table.items() if key != "kind"}, []
    if kind == "planetary" and "planet_teeth" not in given:
        remarks = _derive_planet_teeth(source, label, given)
    stage = read_part(source, STAGE_KINDS[kind], label, given)
    return stage, [*remarks, *(stage.notes if isinstance(stage, PlanetaryStage) else ())]


def _derive_planet_teeth(source: MachineSource, label: str, table: dict[str, Any]) -> list[str]:
    """Set planet_teeth = (ring - sun) / 2 where that is a whole number; say so."""
    sun, ring = table.get("sun_teeth"), table.get("ring_teeth")
    if type(sun) is not int or type(ring) is not int:
        return []  # missing or of the wrong type: the ordinary checks will say which
    planet, rest = divmod(ring - sun, 2)
    if rest or planet < 1:
        reason = f"ring_teeth - sun_teeth = {ring - sun} is not twice a tooth count"
        raise source.error(label, f"{label} lacks planet_teeth, and {reason}: give planet_teeth")
    table["planet_teeth"] = planet
    return [f"planet_teeth = {planet} taken from (ring_teeth - sun_teeth) / 2"]


def read_tables(
    source: MachineSource, name: str, single: bool = False
) -> list[tuple[str, dict[str, Any]]]:
    """Return the tables called `name` with their labels, such as ``stage[2]``.

    Parameters
    ----------
    source : MachineSource
    name : str
    single : bool
        Whether it may be one table, without a number.
    """
    content = source.document.get(name, [])
    if single and isinstance(content, dict):
        return [(name, content)]
    if not isinstance(content, list) or not all(isinstance(table, dict) for table in content):
        brackets = f"[{name}] or [[{name}]]" if single else f"[[{name}]], with double brackets"
        raise source.error(name, f"{name} must be a table: write {brackets}")
    return [(f"{name}[{number}]", table) for number, table in enumerate(content, start=1)]


def read_table(source: MachineSource, name: str) -> dict[str, Any]:
    """Return the only table called `name`, empty if there is none."""
    content = source.document.get(name, {})
    if not isinstance(content, dict):
        raise source.error(name, f"{name} must be one table: write [{name}]")
    return content


def read_part(source: MachineSource, part: type[_Part], label: str, table: dict[str, Any]) -> _Part:
    """Build a dataclass, whose fields have rules, from a table with this label.

    Raises
    ------
    MachineFileError
        If a key is unknown, missing or breaks its rule; the line names file, key and value.
    """
    described = {field.name: field for field in dataclasses.fields(part)}  # type: ignore[arg-type]
    refuse_unknown_keys(source, table, tuple(described), label)
    needed = [name for name, own in described.items() if own.default is dataclasses.MISSING]
    missing = [name for name in needed if name not in table]
    if missing:
        example = f"{missing[0]} = {described[missing[0]].metadata['rule'].example}"
        lacks = " and ".join(missing)
        raise source.error(label, f"{label} lacks {lacks}; write for example {example}")
    try:
        return part(**table)
    except FieldError as error:
        key = f"{label}.{error.key}" if label else error.key
        raise source.error(key, error.message(key)) from None


def refuse_unknown_keys(
    source: MachineSource,
    table: dict[str, Any],
    known: tuple[str, ...],
    label: str,
    homes: Mapping[str, type] = _HOMES,
) -> None:
    """Refuse keys of a table that are not known, with the nearest one that is."""
    allowed = (*known, "kind") if label.startswith("stage") else known
    for key in table:
        if key not in allowed:
            where = f"{label}.{key}" if label else key
            shown = where if where.isprintable() else repr(where)
            raise source.error(where, f"{shown} is not a known key{_hint(key, allowed, homes)}")


def _hint(key: str, allowed: tuple[str, ...], homes: Mapping[str, type]) -> str:
    """Return where a key belongs, what it resembles, or else what would be known here."""
    for home, part in homes.items():
        if key in {field.name for field in dataclasses.fields(part)}:
            return f" here; it belongs to {home}"
    if guess := nearest_name(key, allowed):
        return f"; did you mean {guess}?"
    return f"; known are {', '.join(allowed)}" if len(allowed) <= MOST_KEYS_LISTED else ""
