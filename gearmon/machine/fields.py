"""Rules that fields obey - type, range and the reason for it - and tables of a file held to them.

A rule stands in the metadata of a dataclass field, so that an object built in Python and a table
read from a machine file are held to the same limits with the same words.
"""

from __future__ import annotations

import math
import numbers
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

from gearmon.errors import ArgumentError, MachineFileError, nearest_name
from gearmon.units import is_unit

LONGEST_VALUE_SHOWN = 60


class FieldError(ArgumentError):
    """A field of a machine has a value that cannot be.

    Parameters
    ----------
    key : str
        Name of the field, which is also its key in the machine file.
    reason : str
        What is wrong and what is allowed; follows the key (and value) in the message.
    value : object, optional
        The value refused; left out of the message if not given.
    """

    def __init__(self, key: str, reason: str, value: object = ...) -> None:
        super().__init__(key, reason, value)
        self.key, self.reason, self.value = key, reason, value

    def __str__(self) -> str:
        return self.message(self.key)

    def message(self, where: str) -> str:
        """Return the one-line message with `where` in the place of the key."""
        shown = "" if self.value is ... else f" = {shown_value(self.value)}"
        return f"{where}{shown} {self.reason}"


@dataclass(frozen=True)
class Number:
    """A finite number between low and high; the ends belong to the range unless said otherwise."""

    low: float
    high: float
    unit: str = ""
    why: str = ""
    example: str = "1.0"
    open_low: bool = False
    open_high: bool = False

    def checked(self, key: str, value: object) -> float:
        """Return `value` as a float, or raise `FieldError`."""
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise FieldError(key, "must be a number, without quotes or unit", value)
        try:
            number = float(value)
        except OverflowError:  # a TOML integer may have hundreds of digits
            number = math.inf
        above = number > self.low if self.open_low else number >= self.low
        below = number < self.high if self.open_high else number <= self.high
        if not (above and below and math.isfinite(number)):
            left, right = "(" if self.open_low else "[", ")" if self.open_high else "]"
            unit = f" {self.unit}" if self.unit else ""
            because = f": {self.why}" if self.why else ""
            allowed = f"{left}{self.low:g}, {self.high:g}{right}{unit}"
            raise FieldError(key, f"must lie in {allowed}{because}", value)
        return number


@dataclass(frozen=True)
class Count(Number):
    """An integer in [low, high]; 26.0 is refused, for a tooth count is never measured."""

    example: str = "20"

    def checked(self, key: str, value: object) -> int:
        """Return `value` as an int, or raise `FieldError`."""
        if isinstance(value, bool) or not isinstance(value, numbers.Integral):
            raise FieldError(key, "must be a whole number, without quotes or decimal point", value)
        super().checked(key, value)
        return int(value)


@dataclass(frozen=True, kw_only=True)
class Text:
    """A string of one line, or of another kind that is told."""

    example: str = '"..."'
    kind: str = "one line of printable text"
    is_kind: Callable[[str], bool] = str.isprintable

    def checked(self, key: str, value: object) -> str:
        """Return `value` if it is such a string, or raise `FieldError`."""
        if not isinstance(value, str):
            raise FieldError(key, f"must be text in quotes, such as {self.example}", value)
        if not self.is_kind(value):
            raise FieldError(key, f"must be {self.kind}", value)
        return value


_UNITS = "a known unit: m/s2, g, mm/s, V, rpm, Nm or the like"
#: A unit that is known where recordings are read.
UNIT = Text(example='"m/s2"', kind=_UNITS, is_kind=is_unit)


@dataclass(frozen=True, kw_only=True)
class Choice:
    """One of a few words."""

    options: tuple[str, ...]
    example: str = '"..."'

    def checked(self, key: str, value: object) -> str:
        """Return `value` if it is one of the options, or raise `FieldError`."""
        if isinstance(value, str) and value in self.options:
            return value
        guess = nearest_name(value, self.options) if isinstance(value, str) else None
        hint = f'; did you mean "{guess}"?' if guess else ""
        listed = ", ".join(f'"{word}"' for word in self.options)
        raise FieldError(key, f"must be one of {listed}{hint}", value)


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a recording: its name, or its number counted from 1."""

    example: str = '"a1"'

    def checked(self, key: str, value: object) -> str | int:
        """Return `value` as a non-empty string or a number from 1 on, or raise `FieldError`."""
        if isinstance(value, str) and value.strip() and value.isprintable():
            return value
        if isinstance(value, numbers.Integral) and not isinstance(value, bool) and int(value) >= 1:
            return int(value)
        raise FieldError(key, "must be a column name in quotes or a column number from 1 on", value)


@dataclass(frozen=True, kw_only=True)
class Several:
    """A list of values that obey a rule each; `one` may stand by itself, and none is too few."""

    rule: Text | Choice | Column
    example: str = '["a1", "a2"]'
    one: bool = False

    def checked(self, key: str, value: object) -> tuple[Any, ...]:
        """Return the values as a tuple, or raise `FieldError`."""
        if self.one and isinstance(value, str):
            value = [value]
        if not isinstance(value, list | tuple) or (self.one and not (value and all(value))):
            raise FieldError(key, f"must be a list, such as {self.example}", value)
        return tuple(self.rule.checked(key, one) for one in value)


Rule = Number | Text | Choice | Column | Several


def held(rule: Rule, default: Any = MISSING) -> Any:
    """Return a field of a dataclass that is held to `rule`."""
    return field(default=default, metadata={"rule": rule})


def within(low: float, high: float, unit: str = "", default: Any = MISSING, **rule: Any) -> Any:
    """Return a field of a dataclass that is held to a range; `rule` as for a `Number`."""
    return held(Number(low, high, unit, **rule), default)


def optional(low: float, high: float, unit: str = "", why: str = "", **rule: Any) -> Any:
    """Return a field like one of `within` that may be left out: it is None then."""
    return held(Number(low, high, unit, why, **rule), None)


def check_fields(part: Any) -> None:
    """Hold every field of a dataclass object to its rule and store it in its proper type.

    A field whose default is None, an empty string or infinite may be left at that.

    Raises
    ------
    FieldError
        For the first field that breaks its rule.
    """
    for own in fields(part):
        rule = own.metadata.get("rule")
        value = getattr(part, own.name)
        if rule is None or (value in (None, "", math.inf) and value == own.default):
            continue
        object.__setattr__(part, own.name, rule.checked(own.name, value))


def limit(part: Any, key: str, low: float, high: float, unit: str, why: str, **ends: Any) -> None:
    """Hold a field of a dataclass object, if it is told, to a range that its other fields set.

    Parameters
    ----------
    part : dataclass object
    key : str
    low, high, unit, why, **ends
        As for a `Number`.

    Raises
    ------
    FieldError
        If it lies elsewhere.
    """
    if (value := getattr(part, key)) is not None:
        Number(low, high, unit, why, **ends).checked(key, value)


class Checked:
    """What a dataclass is whose fields are held to their rules as soon as it is made."""

    def __post_init__(self) -> None:
        check_fields(self)


def shown_value(value: object) -> str:
    """Return `value` on one line as a machine file would have it, shortened if long."""
    if isinstance(value, int) and abs(value) >= 10**LONGEST_VALUE_SHOWN:
        return "an integer of more than 60 digits"
    text = str(value) if isinstance(value, numbers.Number) else repr(value)
    if isinstance(value, bool):
        text = text.lower()
    elif isinstance(value, str):
        inner = text[1:-1].replace("\\'", "'")
        text = f'"{inner}"'
    return text if len(text) <= LONGEST_VALUE_SHOWN else f"{text[: LONGEST_VALUE_SHOWN - 3]}..."


LARGEST_FILE_BYTES, MOST_KEYS_LISTED = 1 << 20, 10
_Part = TypeVar("_Part")

# A text of several lines, which holds no keys; the head of a table; a key.
_PLACE = re.compile(
    r"""(?s:(\"{3}|'{3}).*?(?:\1|\Z))|^[ \t]*(\[\[?)[ \t]*([\w-]+)[ \t]*\]\]?[ \t]*(?:#.*)?$"""
    r"""|^[ \t]*(["']?)([\w-]+)\4[ \t]*=""",
    re.ASCII | re.MULTILINE,
)
# What the parser complains of, and where: at the end of the document, if there is no number.
_COMPLAINT = re.compile(
    r"(.*?)\s*(?:\(at (?:line (\d+), column (\d+)|end of document)\))?", re.DOTALL
)
_DECIMAL_COMMA = re.compile(r"=\s*[+-]?\d+,\d")


@dataclass(frozen=True, kw_only=True)
class MachineSource:
    """The text of one file and its parsed content.

    Parameters
    ----------
    path : str
        The file.
    document : dict
        What the TOML parser made of it.
    lines : dict of str to int
        Line of each table and key, such as ``"stage[2].module_mm"``, as far as it is known.
    homes : mapping of str to type
        What tables hold, by how they are written: where a key that stands elsewhere belongs.
    """

    path: str
    document: dict[str, Any]
    lines: dict[str, int] = field(default_factory=dict)
    homes: Mapping[str, type] = field(default_factory=dict)

    def error(self, key: str, message: str) -> MachineFileError:
        """Return the error that says `message` about the line of `key`."""
        line = self.lines.get(key) or self.lines.get(key.rpartition(".")[0])
        place = f"{self.path}:{line}" if line else self.path or "machine"
        return MachineFileError(f"{place}: {message}")

    def tables(self, name: str, single: bool = False) -> list[tuple[str, dict[str, Any]]]:
        """Return the tables called `name` with their labels, such as ``stage[2]``.

        In memory, where there is no file, one may stand by itself.

        Parameters
        ----------
        name : str
        single : bool
            Whether it may be one table, without a number.
        """
        content = self.document.get(name, [])
        if single and isinstance(content, dict):
            return [(name, content)]
        if not self.path and isinstance(content, Mapping | tuple):
            content = [content] if isinstance(content, Mapping) else list(content)
        if not isinstance(content, list) or not all(isinstance(table, dict) for table in content):
            brackets = f"[{name}] or [[{name}]]" if single else f"[[{name}]], with double brackets"
            raise self.error(name, f"{name} must be a table: write {brackets}")
        return [(f"{name}[{number}]", table) for number, table in enumerate(content, start=1)]

    def table(self, name: str) -> dict[str, Any]:
        """Return the only table called `name`, empty if there is none."""
        content = self.document.get(name, {})
        if not isinstance(content, dict):
            raise self.error(name, f"{name} must be one table: write [{name}]")
        return content

    def part(self, kind: type[_Part], label: str, table: dict[str, Any]) -> _Part:
        """Build a dataclass, whose fields have rules, from a table with this label.

        Raises
        ------
        MachineFileError
            If a key is unknown, missing or breaks its rule; the line names file, key and value.
        """
        described = {own.name: own for own in fields(kind)}  # type: ignore[arg-type]
        self.refuse_unknown_keys(table, described, label)
        needed = [name for name, own in described.items() if own.default is MISSING]
        missing = [name for name in needed if name not in table]
        if missing:
            example = f"{missing[0]} = {described[missing[0]].metadata['rule'].example}"
            lacks = " and ".join(missing)
            raise self.error(label, f"{label} lacks {lacks}; write for example {example}")
        try:
            return kind(**table)
        except FieldError as error:
            key = f"{label}.{error.key}" if label else error.key
            raise self.error(key, error.message(key)) from None

    def refuse_unknown_keys(
        self, table: Mapping[str, Any], known: Iterable[str], label: str = ""
    ) -> None:
        """Refuse keys of a table that are not known, with the nearest one that is."""
        names = tuple(known)
        for key in table:
            if key not in names:
                where = f"{label}.{key}" if label else key
                shown = where if where.isprintable() else repr(where)
                raise self.error(where, f"{shown} is not a known key{self._hint(key, names)}")

    def _hint(self, key: str, known: tuple[str, ...]) -> str:
        """Return where a key belongs, what it resembles, or else what would be known here."""
        for home, part in self.homes.items():
            if key in {own.name for own in fields(part)}:
                return f" here; it belongs to {home}"
        if guess := nearest_name(key, known):
            return f"; did you mean {guess}?"
        return f"; known are {', '.join(known)}" if len(known) <= MOST_KEYS_LISTED else ""


def read_source(path: str | Path) -> MachineSource:
    """Open and parse a machine file, or another one of such tables.

    Raises
    ------
    MachineFileError
        If there is no such file, or it is not TOML in UTF-8.
    """
    shown = str(path)
    text = _text_of(Path(path), shown)
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
    return MachineSource(path=shown, document=document, lines=key_lines(text))


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


def _text_of(path: Path, shown: str) -> str:
    try:
        size, ordinary = path.stat().st_size, path.is_file()
        large = size > LARGEST_FILE_BYTES
        data = path.read_bytes() if ordinary and not large else b""
    except FileNotFoundError:
        hint = "; give the name of a TOML file, standard input is not taken" if shown == "-" else ""
        raise MachineFileError(f"{shown}: no such file{hint}") from None
    except OSError as error:
        raise MachineFileError(f"{shown}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise MachineFileError(f"{shown!r}: is not the name of a file ({error})") from None
    refusals = {
        "is a folder; give the name of a machine file (TOML)": path.is_dir(),
        "is not an ordinary file": not ordinary,
        f"has {size / 1e6:.1f} MB; a machine file is a short text (at most 1 MB)": large,
        "is UTF-16 text; save it as UTF-8": data.startswith((b"\xff\xfe", b"\xfe\xff")),
        "is a binary file; a machine file is TOML text": b"\0" in data,
    }
    for reason in (told for told, holds in refusals.items() if holds):
        raise MachineFileError(f"{shown}: {reason}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        reason = f"byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise MachineFileError(f"{shown}:{line}: {reason}") from None


def _syntax_error(shown: str, text: str, message: str) -> MachineFileError:
    """Return the parser's complaint with its place in front, the line itself and a remedy."""
    match = _COMPLAINT.fullmatch(message)
    assert match is not None  # anything does
    lines = text.splitlines()
    number = int(match[2]) if match[2] else max(len(lines), 1)
    line = lines[number - 1].strip() if number <= len(lines) else ""
    place = f"{number}:{match[3]}" if match[3] else f"{number}"
    printed = "".join(letter if letter.isprintable() else "?" for letter in line)
    here = f", in: {printed if len(printed) <= 60 else f'{printed[:57]}...'}" if line else ""
    here += " (decimal numbers take a point)" if _DECIMAL_COMMA.search(line) else ""
    complaint = " ".join(match[1].split())
    if complaint == "Cannot overwrite a value":
        complaint = "this key stands here for the second time"
    elif complaint.startswith("Cannot declare") and complaint.endswith("twice"):
        complaint = "this [table] stands here for the second time; a list of them takes [[table]]"
    return MachineFileError(f"{shown}:{place}: not valid TOML: {complaint}{here}")
