"""Rules that a field of a machine obeys: its type, its range and the reason for the range.

A rule stands in the metadata of a dataclass field, so that an object built in Python and a table
read from a machine file are held to the same limits with the same words.
"""

from __future__ import annotations

import math
import numbers
from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from gearmon.errors import ArgumentError, nearest_name
from gearmon.units import KNOWN_UNITS, is_unit

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
            because = f": {self.why}" if self.why else ""
            raise FieldError(key, f"must lie in {self.range_text()}{because}", value)
        return number

    def range_text(self) -> str:
        """Return the range and unit as in ``(0, 100] mm``."""
        left, right = "(" if self.open_low else "[", ")" if self.open_high else "]"
        unit = f" {self.unit}" if self.unit else ""
        return f"{left}{self.low:g}, {self.high:g}{right}{unit}"


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

    def range_text(self) -> str:
        """Return the range as in ``[5, 2000]``."""
        return f"[{self.low}, {self.high}]"


@dataclass(frozen=True, kw_only=True)
class Text:
    """A string of one line."""

    example: str = '"..."'

    def checked(self, key: str, value: object) -> str:
        """Return `value` if it is a one-line string, or raise `FieldError`."""
        if not isinstance(value, str):
            raise FieldError(key, f"must be text in quotes, such as {self.example}", value)
        if not value.isprintable():
            raise FieldError(key, "must be one line of printable text", value)
        return value


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit that is known where recordings are read."""

    example: str = '"m/s2"'

    def checked(self, key: str, value: object) -> str:
        """Return `value` if it is a known unit, or raise `FieldError`."""
        if not (isinstance(value, str) and is_unit(value)):
            raise FieldError(key, f"must be a known unit: {KNOWN_UNITS}", value)
        return value


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


Rule = Number | Text | Unit | Choice | Column | Several


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


class Checked:
    """What a dataclass is whose fields are held to their rules as soon as it is made."""

    def __post_init__(self) -> None:
        check_fields(self)


def shown_value(value: object) -> str:
    """Return `value` on one line as a machine file would have it, shortened if long."""
    text = str(value).lower() if isinstance(value, bool) else _literal(value)
    return text if len(text) <= LONGEST_VALUE_SHOWN else f"{text[: LONGEST_VALUE_SHOWN - 3]}..."


def _literal(value: object) -> str:
    if isinstance(value, str):
        inner = repr(value)[1:-1].replace("\\'", "'")
        return f'"{inner}"'
    if isinstance(value, int) and abs(value) >= 10**LONGEST_VALUE_SHOWN:
        return "an integer of more than 60 digits"
    return str(value) if isinstance(value, numbers.Number) else repr(value)
