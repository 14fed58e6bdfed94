"""Units of what is measured: how they are spelt, what they measure, factors to m/s2 and s."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

#: What is told of them where one is not known.
KNOWN_UNITS = "m/s2, g, mm/s, um, V or the like"
STANDARD_GRAVITY = 9.80665  # m/s2, ISO 80000-3
_SPELLING = str.maketrans({"²": "2", "μ": "u", "µ": "u", "·": "", "*": "", "^": "", " ": ""})
_ACCELERATION = (
    dict.fromkeys(
        ["m/s2", "m/s/s", "m/(s2)", "m/sec2", "ms-2", "ms2", "m_s2", "m_s_2", "mps2"], 1.0
    )
    | {"mm/s2": 1e-3, "mms-2": 1e-3, "cm/s2": 1e-2, "ft/s2": 0.3048, "in/s2": 0.0254}
    | dict.fromkeys(["g", "gn", "g_n", "g0"], STANDARD_GRAVITY)
    | {"mg": 1e-3 * STANDARD_GRAVITY}
)
_TIME = (
    dict.fromkeys(["s", "sec", "secs", "second", "seconds", "sek"], 1.0)
    | dict.fromkeys(["ms", "msec"], 1e-3)
    | dict.fromkeys(["us", "usec"], 1e-6)
    | {"ns": 1e-9, "min": 60.0, "h": 3600.0}
)
#: Turns a second.
_SPEED = (
    dict.fromkeys(["rpm", "1/min", "min-1", "u/min", "r/min", "rev/min", "tr/min"], 1.0 / 60.0)
    | dict.fromkeys(["1/s", "hz"], 1.0)
    | {"rad/s": 1.0 / (2.0 * math.pi)}
)
#: Units by what is measured in them.
_KINDS = {
    "vibration": {"v", "mv", "uv", "m/s", "mm/s", "in/s", "ips", "m", "mm", "um", "mil", "mils"}
    | _ACCELERATION.keys(),
    "time": _TIME.keys(),
    "speed": _SPEED.keys() - {"hz"},
    "torque": {"nm", "n.m", "n-m", "knm", "mnm", "ncm", "lbfft", "ftlb", "inlb", "lb-ft"},
    "other": {"°c", "degc", "c", "k", "°f", "degf", "a", "ma", "n", "kn", "w", "kw", "bar", "mbar"}
    | {"pa", "kpa", "mpa", "%", "hz", "khz", "deg", "°", "rad", "rev", "kg", "db", "l/min"},
}
_BRACKETS = re.compile(r"\[\s*(.*?)\s*\]|\(\s*(.*?)\s*\)|<\s*(.*?)\s*>")


def plain_unit(text: str) -> str:
    """Return one spelling of the unit: lower case, no brackets, powers as plain digits.

    Examples
    --------
    >>> plain_unit("[m/s²]"), plain_unit("(N·m)")
    ('m/s2', 'nm')
    """
    match = _BRACKETS.fullmatch(text.strip())
    inner = next(part for part in match.groups() if part is not None) if match else text.strip()
    return inner.translate(_SPELLING).lower()


def acceleration_factor(unit: str | None) -> float | None:
    """Return how many m/s2 the unit is, or None if it is no known unit of acceleration."""
    return _ACCELERATION.get(plain_unit(unit)) if unit else None


def time_factor(unit: str | None) -> float | None:
    """Return how many seconds the unit is, or None if it is no known unit of time."""
    return _TIME.get(plain_unit(unit)) if unit else None


def speed_factor(unit: str | None) -> float | None:
    """Return how many turns a second the unit is, or None if it is no known unit of speed."""
    return _SPEED.get(plain_unit(unit)) if unit else None


def kind_of_unit(unit: str | None) -> str | None:
    """Return what is measured in that unit, or None where it tells nothing.

    Returns
    -------
    {"speed", "torque", "other", "vibration", "time"} or None
        "vibration" stands for acceleration, velocity, displacement and volts.
    """
    plain = plain_unit(unit) if unit else ""
    return next((kind for kind, units in _KINDS.items() if plain in units), None)


def is_unit(text: str) -> bool:
    """Tell whether the text is a known unit."""
    return kind_of_unit(text) is not None


def is_trusted_unit(text: str) -> bool:
    """Tell whether the text is a unit even where it might be a name: ``g``, but not ``a``."""
    return is_unit(text) and (len(text) > 1 or text in "gsVv")


def are_units(cells: Sequence[str]) -> bool:
    """Tell whether the cells of a line are units: known or in brackets, or left open."""
    stated = [cell for cell in cells if cell not in ("", "-", "--", "1")]
    if stated and all(_BRACKETS.fullmatch(cell) for cell in stated):
        return True
    return bool(stated) and all(is_trusted_unit(plain_unit(cell)) for cell in stated)
