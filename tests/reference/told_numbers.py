"""Numbers in words, held against those of the result that the words tell of."""

from __future__ import annotations

import math
import re
from dataclasses import fields, is_dataclass

import numpy as np

#: Unit in words -> endings of the fields that hold it, and what these are multiplied by.
UNITS = {
    # doses hold their unit beside them
    "m/s2": {"_ms2": 1.0, "doses": 1.0},
    "m/s²": {"_ms2": 1.0},
    "Hz": {"_hz": 1.0},
    "rpm": {"_rpm": 1.0, "_hz": 60.0},
    "%": {"share": 100.0, "loss": 100.0, "_low": 100.0, "_high": 100.0},
    "h": {"hours": 1.0, "_h": 1.0, "_s": 1 / 3600},
    "s": {"_s": 1.0},
    "dB": {"_db": 1.0},
}
_NUMBER = r"(?<![\w.])[+\u2212-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_UNIT = "|".join(sorted(map(re.escape, UNITS), key=len, reverse=True))
_TOLD = re.compile(rf"({_NUMBER}) ({_UNIT})(?![\w/])")


def numbers(value, place=()):
    """Every number of a result, with the names of the fields that hold it."""
    if is_dataclass(value):
        value = {own.name: getattr(value, own.name) for own in fields(value)}
    if isinstance(value, dict):
        for key, own in value.items():
            yield from numbers(own, (*place, str(key)))
    elif isinstance(value, list | tuple):
        for own in value:
            yield from numbers(own, place)
    elif isinstance(value, np.ndarray):
        # samples and lines are not told one by one
        if value.size < 100 and not np.iscomplexobj(value):
            yield from numbers(value.ravel().tolist(), place)
    elif isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        yield place, float(value)


def with_units(text):
    """The numbers in a text that have a unit: as they are written, with the unit."""
    return _TOLD.findall(text)


def is_rounded(written, value):
    """Whether a number is another one as it is written, to the last digit."""
    plain = written.replace("\u2212", "-")
    mantissa, _, exponent = plain.partition("e")
    step = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(plain) - value) <= 0.5001 * step


def untold(text, result):
    """Numbers with a unit in a text that are those of no field of the result in that unit."""
    known = list(numbers(result))
    return [
        f"{written} {unit}"
        for written, unit in with_units(text)
        if not any(
            is_rounded(written, factor * value)
            for ending, factor in UNITS[unit].items()
            for place, value in known
            if any(name.endswith(ending) for name in place)
        )
    ]


_INTERVAL = re.compile(
    rf"(?:({_NUMBER})(?: [^\d\s(,;]+)? \()?({_NUMBER})(?: \S+)? to ({_NUMBER})(?![\d.]|th)"
)


def disordered(text):
    """Intervals in a text whose ends are exchanged, or that do not hold the value before them."""
    wrong = []
    for found in _INTERVAL.finditer(text):
        value, low, high = (
            None if own is None else float(own.replace("\u2212", "-")) for own in found.groups()
        )
        if low > high or (value is not None and not low <= value <= high):
            wrong.append(found[0])
    return wrong
