"""Sizes of damage in the units of whoever looks at a tooth: millimetres, share of the flank, level.

A size is written as a number and its unit, and further dimensions after commas:
``1.5mm,angle=70``, ``1.5mm,limit=parabolic``, ``4x1.5x0.5mm,at=0.2``, ``12%flank,radius=0.3``,
``2level``.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields
from typing import Any

from gearmon.errors import ArgumentError, check_finite, nearest_name
from gearmon.gears.tooth_damage import LIMITS

#: Losses of pair stiffness, and what they are worth.
LOSS_UNITS = {"": 1.0, "%": 0.01}
#: Severity of pitting by share of the flank: lower and upper end of each level (ASM Handbook).
LEVELS: dict[int, tuple[str, float, float]] = {
    1: ("slight", 0.03, 0.10),
    2: ("moderate", 0.10, 0.30),
    3: ("severe", 0.30, 0.50),
}
#: Units that each kind understands beside the loss of stiffness.
KIND_UNITS: dict[str, tuple[str, ...]] = {
    "crack": ("mm",),
    "spall": ("mm",),
    "pitting": ("flank", "%flank", "level"),
    "breakage": ("mm",),
    "wear": ("mm",),
    "missing": ("tooth",),
    "stiffness": (),
}
#: Further dimensions that each kind takes with a size that is no loss.
KIND_OPTIONS: dict[str, tuple[str, ...]] = {
    "crack": ("angle", "far", "width", "from", "limit"),
    "spall": ("at", "from"),
    "pitting": ("radius", "depth"),
    "breakage": ("height", "from"),
}


@dataclass(frozen=True, kw_only=True)
class FaultShape:
    """Dimensions of damage beyond its size; None where they are not given.

    Parameters
    ----------
    angle : float, optional
        Of a crack against the middle of the tooth [deg]; by default 60.
    far : float, optional
        Depth [mm] of a crack at its other end along the face; by default its size.
    width : float, optional
        Part of the face width that is cracked [mm]; by default all.
    start : float, optional
        Distance [mm] along the face at which the damage begins, from the side that enters contact
        first; by default 0. Written ``from=``.
    length, depth : float, optional
        Of a spall, along the profile and into the tooth [mm]; depth of pits [mm].
    at : float, optional
        Middle of a spall above the pitch circle [mm], negative below; by default 0.
    radius : float, optional
        Of pits [mm]; by default a tenth of the module.
    height : float, optional
        Of a broken-off corner, from the tip down [mm]; by default the whole tooth.
    limit : {"flat", "parabolic"}, optional
        Line up to which a cracked section carries, see `tooth_damage.RootCrack`; by default flat.
    """

    angle: float | None = None
    far: float | None = None
    width: float | None = None
    start: float | None = None
    length: float | None = None
    depth: float | None = None
    at: float | None = None
    radius: float | None = None
    height: float | None = None
    limit: str | None = None

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is None:
                continue
            if item.name == "limit":
                _check_limit(value)
                continue
            check_finite(_key(item.name), value, "deg" if item.name == "angle" else "mm")
            if item.name == "angle" and not 5 <= value <= 90:
                raise ArgumentError(f"angle={value:g} deg of a crack must lie in [5, 90] deg")
            if item.name in ("width", "length", "depth", "radius", "height") and value <= 0:
                raise ArgumentError(f"{item.name}={value:g} mm must be > 0")
            if item.name in ("start", "far") and value < 0:
                raise ArgumentError(f"{_key(item.name)}={value:g} mm must be >= 0")

    def options(self, kind: str) -> str:
        """Return the dimensions as they are written after a size."""
        given = [(key, getattr(self, _field(key))) for key in KIND_OPTIONS.get(kind, ())]
        written = [(key, _written(value)) for key, value in given if value is not None]
        return "".join(f",{key}={value}" for key, value in written)


#: Nothing given beyond the size.
PLAIN = FaultShape()


def parse_size(kind: str, text: str) -> tuple[float, str, FaultShape]:
    """Read a size: number, unit, and further dimensions.

    Parameters
    ----------
    kind : str
        Kind of the fault, which decides what the dimensions mean.
    text : str

    Returns
    -------
    size : float
    unit : str
    shape : FaultShape

    Raises
    ------
    ArgumentError
        If the text is no size.

    Examples
    --------
    >>> parse_size("crack", "1.5mm,angle=70")[:2]
    (1.5, 'mm')
    """
    head, *options = [part.strip() for part in text.split(",")]
    shape: dict[str, Any] = {}
    for option in options:
        key, value = _option(kind, option)
        shape[_field(key)] = value
    names = [name for _, (name, _, _) in sorted(LEVELS.items())]
    if kind == "pitting" and head in names:
        return float(names.index(head) + 1), "level", FaultShape(**shape)
    numbers, unit = _numbers(head)
    if len(numbers) == 3 and kind == "spall":
        shape |= {"length": numbers[1], "depth": numbers[2]}
    elif len(numbers) != 1:
        raise ArgumentError(f"SIZE {head!r} of a {kind} must be one number and its unit")
    return numbers[0], unit, FaultShape(**shape)


def size_text(kind: str, size: float, unit: str, shape: FaultShape) -> str:
    """Return a size in the form that `parse_size` reads."""
    if unit == "tooth":
        return ""
    head = f"{size:g}"
    if kind == "spall" and unit == "mm":
        head += f"x{shape.length:g}x{shape.depth:g}"
    return f"{head}{unit}{shape.options(kind)}"


def check_size(kind: str, size: float, unit: str, shape: FaultShape) -> None:
    """Refuse a size that has no meaning for its kind.

    Raises
    ------
    ArgumentError
    """
    if unit not in LOSS_UNITS and unit not in KIND_UNITS[kind]:
        own = [u for u in KIND_UNITS[kind] if u != "tooth"]
        others = f", or its size in {' or '.join(own)}" if own else ""
        raise ArgumentError(
            f"fault unit {unit!r} is not known for {kind}; give the loss of stiffness of the tooth "
            f"pair as a fraction (0.2) or in per cent (20%){others}"
        )
    if unit == "tooth":
        return
    if unit in LOSS_UNITS:
        _check_loss(size, unit)
        if shape != PLAIN:
            raise ArgumentError(
                f"fault size={size:g}{unit} is a loss of stiffness, which has no dimensions; give "
                f"the size in {' or '.join(KIND_UNITS[kind]) or 'no unit'} or leave them out"
            )
    else:
        _check_physical(kind, size, unit, shape)


def flank_share(size: float, unit: str) -> float:
    """Return the share of the flank that is pitted; of a level, the middle of its range."""
    if unit == "level":
        _, low, high = LEVELS[int(size)]
        return 0.5 * (low + high)
    return size * (0.01 if unit == "%flank" else 1.0)


def flank_level(share: float) -> int | None:
    """Return the level of pitting of a share of the flank, or None below the first.

    The upper end of a level belongs to the next; beyond the last range it is the last.

    Examples
    --------
    >>> flank_level(0.2), flank_level(0.01)
    (2, None)
    """
    found = [number for number, (_, low, _) in LEVELS.items() if share >= low]
    return max(found) if found else None


def _check_loss(size: float, unit: str) -> None:
    if not (math.isfinite(size) and 0 <= size * LOSS_UNITS[unit] < 1):
        top = "100 %" if unit == "%" else "1"
        raise ArgumentError(
            f"fault size={size:g}{unit} must lie in [0, {top}): it is the loss of stiffness of "
            f"the tooth pair"
        )


def _check_physical(kind: str, size: float, unit: str, shape: FaultShape) -> None:
    check_finite("fault size", size, unit)
    if unit == "level":
        if size not in LEVELS:
            names = ", ".join(f"{number} ({name})" for number, (name, _, _) in LEVELS.items())
            raise ArgumentError(f"pitting level={size:g} must be one of {names}")
        return
    if size < 0:
        raise ArgumentError(f"fault size={size:g}{unit} must be >= 0")
    if kind == "pitting" and not flank_share(size, unit) <= 0.5:
        top = "50%flank" if unit == "%flank" else "0.5flank"
        raise ArgumentError(
            f"fault size={size:g}{unit} must be at most {top}: beyond half of the flank the pits "
            f"run into one another; give the loss of stiffness instead"
        )
    if kind == "spall" and (shape.length is None or shape.depth is None):
        raise ArgumentError(
            f"a spall of {size:g} mm needs its width along the face, its length along the profile "
            f"and its depth: 4x1.5x0.5mm"
        )


def _numbers(text: str) -> tuple[list[float], str]:
    number = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
    match = re.fullmatch(rf"\s*({number}(?:\s*x\s*{number})*)\s*([%A-Za-z ]*)", text)
    if match is None:
        raise ArgumentError(f"SIZE {text!r} is not a number")
    return [float(part) for part in match[1].split("x")], match[2].strip()


def _option(kind: str, text: str) -> tuple[str, float | str]:
    known = KIND_OPTIONS.get(kind, ())
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or key not in known:
        near = nearest_name(key, known)
        hint = f"; did you mean {near}?" if near else ""
        names = ", ".join(known) if known else "none"
        raise ArgumentError(f"dimension {text!r} of a {kind} is not known: {names}{hint}")
    if key == "limit":
        return key, value
    number = re.sub(r"(mm|deg)$", "", value).strip()
    try:
        return key, float(number)
    except ValueError:
        raise ArgumentError(f"dimension {text!r} of a {kind} is not a number") from None


def _check_limit(value: str) -> None:
    if value not in LIMITS:
        near = nearest_name(value, LIMITS)
        hint = f"; did you mean {near}?" if near else ""
        raise ArgumentError(f"limit={value!r} of a crack must be one of {', '.join(LIMITS)}{hint}")


def _written(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _field(key: str) -> str:
    return "start" if key == "from" else key


def _key(name: str) -> str:
    return "from" if name == "start" else name
