"""Faults of single teeth or of all teeth, and the stiffness that they take from a pair.

The size of a fault is the loss of stiffness of the pair whose tooth it is, or what can be measured
on the tooth, from which the loss follows; see `damage`.

A size is written as a number and its unit, and further dimensions after commas:
``1.5mm,angle=70``, ``1.5mm,limit=parabolic``, ``4x1.5x0.5mm,at=0.2``, ``12%flank,radius=0.3``,
``2level``. Errors of manufacture or mounting are written alike, with a size in um.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

from gearmon.errors import ArgumentError, check_word
from gearmon.machine.fields import Choice, Count, FieldError, Number, check_fields, held, optional

#: What material a crack leaves without load, by name.
LIMITS = ("flat", "parabolic")
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
#: All of them, and the sides of a spall.
DIMENSIONS = ("angle", "limit", "far", "from", "at", "width", "length", "depth", "radius", "height")
#: Rules of dimensions: none is longer than the largest gears are wide.
_PLACE, _LENGTH = Number(0, 20_000, "mm"), Number(0, 20_000, "mm", open_low=True)
_LOSS = "it is the loss of stiffness of the tooth pair, as a fraction or with % in per cent"
_PITS = "beyond, the pits run into one another; give the loss of stiffness instead"
#: What a size may be, by its unit.
SIZES: dict[str, Number] = {
    "": Number(0, 1, why=_LOSS, open_high=True),
    "%": Number(0, 100, "%", _LOSS, open_high=True),
    "mm": _PLACE,
    "flank": Number(0, 0.5, "flank", _PITS),
    "%flank": Number(0, 50, "%flank", _PITS),
    "level": Number(1, 3, why=", ".join(f"{n} is {name}" for n, (name, _, _) in LEVELS.items())),
    "tooth": Number(1, 1),
}
#: What each kind means, for help texts.
KINDS: dict[str, str] = {
    "stiffness": "uniform loss over the whole contact of the tooth",
    "crack": "root crack through the face width: uniform loss over the whole contact",
    "breakage": "corner broken off: that share of the face width carries nothing",
    "pitting": "loss while the contact passes the neighbourhood of the pitch point",
    "spall": "as pitting, in a narrower band about the pitch point",
    "wear": "every tooth of the gear alike (TOOTH is 'all')",
    "missing": "the whole tooth is gone; its neighbours bridge the gap with their ends",
}
#: What each kind of error means, for help texts.
ERROR_KINDS: dict[str, str] = {
    "eccentricity": "the gear runs out: once per turn, SIZE is the offset of its centre",
    "pitch": "one tooth stands back by SIZE over its whole contact",
    "profile": "SIZE is missing at both ends of the contact, nothing in its middle",
    "misalignment": "the gear wobbles: SIZE is the lead deviation across the face, turning with it",
    "cumulative": "slow cumulative pitch error: once per turn, SIZE is half of its range F_p",
}
#: Errors of a whole gear.
WHOLE_KINDS = ("eccentricity", "misalignment", "cumulative")
GEARS = ("pinion", "gear", "sun", "planet", "ring")
#: Share of the path of contact that is hurt, centred on the pitch point.
BANDS = {"pitting": 0.3, "spall": 0.15}
SYNTAX = "KIND:STAGE:GEAR:TOOTH:SIZE, such as crack:1:pinion:5:20% or crack:1:pinion:5:1.5mm"
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"


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
    return max((n for n, (_, low, _) in LEVELS.items() if share >= low), default=None)


@dataclass(frozen=True, kw_only=True)
class _OnGear:
    """What is wrong with a gear, and where; fields as of `Fault`."""

    #: What messages call it.
    word: ClassVar[str] = "fault"
    kind: str
    stage: int = held(Count(low=1, high=1000))
    gear: str = held(Choice(options=GEARS))
    tooth: int | None = held(Count(low=1, high=100_000), None)

    def __post_init__(self) -> None:
        try:
            check_fields(self)
        except FieldError as error:
            key = "from" if error.key == "start" else error.key
            raise ArgumentError(error.message(f"{self.word} {key}")) from None
        is_whole = self.kind in ("wear", *WHOLE_KINDS)
        if (self.tooth is None) != is_whole and self.kind != "profile":
            wanted = "'all'" if is_whole else "one tooth number"
            raise ArgumentError(f"{self.word} {self.kind}: TOOTH must be {wanted}")

    @property
    def _place(self) -> str:
        return f"{self.kind}:{self.stage}:{self.gear}:{'all' if self.tooth is None else self.tooth}"


@dataclass(frozen=True, kw_only=True)
class Fault(_OnGear):
    """One fault of one tooth, or of all teeth of a gear.

    Parameters
    ----------
    kind : {"stiffness", "crack", "breakage", "pitting", "spall", "wear", "missing"}
        See `KINDS`.
    stage : int, >= 1
        Stage of the drive train, in the order of power flow.
    gear : {"pinion", "gear", "sun", "planet", "ring"}
        The pinion is on the driving shaft.
    tooth : int, >= 1, or None
        Number of the tooth; tooth j enters contact at mesh phase j - 1. None means all teeth and
        is what wear asks for.
    size : float
        Loss of stiffness of the pair where the fault acts: in [0, 1), or in [0, 100) with unit %.
        In other units what is measured on the tooth: depth of a crack, width of a spall along the
        face, width of a broken-off part, wear normal to the flank [mm]; share of the flank that is
        pitted.
    unit : {"", "%", "mm", "flank", "%flank", "level", "tooth"}
        "level" is the ASM level of pitting 1, 2, 3; "tooth" goes with a missing tooth.
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

    Raises
    ------
    ArgumentError
        If a value has no meaning.

    Examples
    --------
    >>> Fault(kind="crack", stage=1, gear="pinion", tooth=5, size=20, unit="%").loss
    0.2
    """

    kind: str = held(Choice(options=tuple(KINDS)))
    size: float
    unit: str = ""
    angle: float | None = optional(5, 90, "deg")
    far: float | None = held(_PLACE, None)
    width: float | None = held(_LENGTH, None)
    start: float | None = held(_PLACE, None)
    length: float | None = held(_LENGTH, None)
    depth: float | None = held(_LENGTH, None)
    at: float | None = optional(-20_000, 20_000, "mm")
    radius: float | None = held(_LENGTH, None)
    height: float | None = held(_LENGTH, None)
    limit: str | None = held(Choice(options=LIMITS), None)

    def __post_init__(self) -> None:
        super().__post_init__()
        units = KIND_UNITS[self.kind]
        if self.unit not in (*LOSS_UNITS, *units):
            own = [unit for unit in units if unit != "tooth"]
            others = f", or its size in {' or '.join(own)}" if own else ""
            raise ArgumentError(
                f"fault unit {self.unit!r} is not known for {self.kind}; give the loss of "
                f"stiffness of the tooth pair as a fraction (0.2) or in per cent (20%){others}"
            )
        if not self.unit and 1 <= self.size < 100:
            told = f"fault size = {self.size} must lie in [0, 1): {_LOSS}"
            raise ArgumentError(f"{told}; did you mean {self.size:g}%?")
        size = SIZES[self.unit].checked("fault size", self.size)
        if self.unit == "level" and size not in LEVELS:
            raise ArgumentError(f"pitting level={size:g} must be a whole number")
        if self.is_loss and self._dimensions:
            raise ArgumentError(
                f"fault size={size:g}{self.unit} is a loss of stiffness, which has no dimensions; "
                f"give the size in {' or '.join(units) or 'no unit'} or leave them out"
            )
        if self.kind == "spall" and not self.is_loss and not (self.length and self.depth):
            raise ArgumentError(
                f"a spall of {size:g} mm needs its width along the face, its length along the "
                f"profile and its depth: 4x1.5x0.5mm"
            )

    @property
    def _dimensions(self) -> dict[str, Any]:
        """Further dimensions that are given, by the words that name them."""
        every = {key: getattr(self, _field(key)) for key in DIMENSIONS}
        return {key: value for key, value in every.items() if value is not None}

    @property
    def is_loss(self) -> bool:
        """Whether the size is a loss of stiffness, and not something measured on the tooth."""
        return self.unit in LOSS_UNITS

    @property
    def loss(self) -> float:
        """Loss of stiffness of the pair where the fault acts, in [0, 1).

        Raises
        ------
        ArgumentError
            If the size is given in other units; `gears.damage.stiffness_loss` converts it.
        """
        if not self.is_loss:
            raise ArgumentError(
                f"fault {self}: the loss of stiffness follows from the teeth; convert it with "
                f"gears.damage.stiffness_loss"
            )
        return self.size * LOSS_UNITS[self.unit]

    @property
    def size_text(self) -> str:
        """Size and further dimensions as they are written; "" of a missing tooth."""
        if self.unit == "tooth":
            return ""
        is_box = self.kind == "spall" and not self.is_loss
        sides = (self.size, self.length, self.depth) if is_box else (self.size,)
        given, keys = self._dimensions, KIND_OPTIONS.get(self.kind, ())
        options = [(key, given[key]) for key in keys if key in given]
        told = [f",{key}={x if isinstance(x, str) else f'{x:g}'}" for key, x in options]
        return "".join(["x".join(f"{side:g}" for side in sides), self.unit, *told])

    def __str__(self) -> str:
        """Return the fault in the form that `parse_fault` reads."""
        return f"{self._place}:{self.size_text}".removesuffix(":")


def parse_fault(text: str) -> Fault:
    """Read a fault written as ``KIND:STAGE:GEAR:TOOTH:SIZE``.

    Parameters
    ----------
    text : str
        SIZE is the loss of pair stiffness, ``0.2`` or ``20%``, or what is measured on the tooth:
        ``crack:1:pinion:5:1.5mm``, ``spall:1:gear:3:4x1.5x0.5mm``, ``pitting:1:gear:3:12%flank``.
        TOOTH is a number or ``all``. A missing tooth has no SIZE.

    Returns
    -------
    Fault

    Raises
    ------
    ArgumentError
        If the text is not of this form or a part of it has no meaning.

    Examples
    --------
    >>> parse_fault("crack:1:pinion:5:20%").tooth
    5
    """
    where, words = _parts("fault", text, KINDS, SYNTAX)
    try:
        return Fault(**where, **_size(where["kind"], words))
    except ArgumentError as error:
        raise ArgumentError(f"fault {text!r}: {error}; {SYNTAX}") from None


def _size(kind: str, text: str) -> dict[str, Any]:
    """Read size, unit and further dimensions."""
    head, *options = [part.strip() for part in text.split(",")]
    told = dict(_option(kind, option) for option in options)
    names = [name for name, _, _ in LEVELS.values()]
    if kind == "pitting" and head in names:
        return told | {"size": names.index(head) + 1.0, "unit": "level"}
    match = re.fullmatch(rf"({NUMBER}(?:\s*x\s*{NUMBER})*)\s*([%A-Za-z ]*)", head)
    if match is None:
        raise ArgumentError(f"SIZE {head!r} is not a number")
    size, *others = [float(part) for part in match[1].split("x")]
    if len(others) == 2 and kind == "spall":
        told |= dict(zip(("length", "depth"), others, strict=True))
    elif others:
        raise ArgumentError(f"SIZE {head!r} of a {kind} must be one number and its unit")
    return told | {"size": size, "unit": match[2]}


def _option(kind: str, text: str) -> tuple[str, Any]:
    key, _, value = (part.strip() for part in text.partition("="))
    check_word(f"dimension of a {kind} ", key, KIND_OPTIONS.get(kind, ["none"]))
    try:
        number = re.sub(r"(mm|deg)$", "", value).strip()
        return _field(key), value if key == "limit" else float(number)
    except ValueError:
        raise ArgumentError(f"dimension {text!r} of a {kind} is not a number") from None


def _field(key: str) -> str:
    return "start" if key == "from" else key


def faults_of(given: object, *, errors: bool, stages: int | None = None) -> tuple[Any, ...]:
    """Return faults, one or several, of which some may be text.

    Parameters
    ----------
    given : Fault, GearError, str, or iterable of these
    errors : bool
        Whether errors of gears are taken too.
    stages : int, optional
        Stages of the machine that they are to be of.

    Raises
    ------
    ArgumentError
        If something else stands there, a text says no fault, or there is no such stage.

    Examples
    --------
    >>> [own.tooth for own in faults_of("crack:1:pinion:5:20%", errors=False)]
    [5]
    """
    parsed, kinds = (parse_fault_or_error, Fault | GearError) if errors else (parse_fault, Fault)
    several = [given] if isinstance(given, str | Fault | GearError) else given
    listed: Iterable[Any] = several if isinstance(several, Iterable) else [None]
    faults = tuple(parsed(own) if isinstance(own, str) else own for own in listed)
    if not all(isinstance(own, kinds) for own in faults):
        raise ArgumentError(
            f"faults={given!r}: must be faults or their text, such as ['crack:1:pinion:5:20%']"
        )
    for own in faults:
        if stages is not None and own.stage > stages:
            raise ArgumentError(
                f"fault {own}: stage {own.stage} does not exist, the machine has {stages}"
            )
    return faults


def _parts(what: str, text: str, kinds: Iterable[str], syntax: str) -> tuple[dict[str, Any], str]:
    """Take ``KIND:STAGE:GEAR:TOOTH:SIZE`` apart: where it is, and SIZE."""
    parts = [part.strip() for part in text.split(":")]
    if parts[0] == "missing" and len(parts) == 4:
        parts.append("1tooth")
    if len(parts) != 5:
        raise ArgumentError(f"{what} {text!r} has {len(parts)} parts and not 5: {syntax}")
    check_word(f"{what} kind ", parts[0], kinds)
    where: dict[str, Any] = dict(zip(("kind", "stage", "gear", "tooth"), parts, strict=False))
    for name, others, hint in (("stage", {}, ""), ("tooth", {"all": None}, " or 'all'")):
        word = where[name]
        try:
            where[name] = others[word] if word in others else int(word)
        except ValueError:
            wanted = f"{name.upper()} {word!r} must be a whole number{hint}"
            raise ArgumentError(f"{what} {text!r}: {wanted}; {syntax}") from None
    return where, parts[4]


@dataclass(frozen=True, kw_only=True)
class GearError(_OnGear):
    """An error of manufacture or mounting of one gear.

    Parameters
    ----------
    kind : {"eccentricity", "pitch", "profile", "misalignment", "cumulative"}
        See `ERROR_KINDS`.
    stage : int, >= 1
    gear : str
    tooth : int or None
        Of pitch and profile errors; None for all teeth.
    size_m : float
        Missing material along the line of action [m]; negative for too much material.
    phase_rad : float
        Angle of the gear, from the entry of tooth 1, at which eccentricity, misalignment or
        cumulative pitch error is largest, negated.

    Raises
    ------
    ArgumentError
        If a value has no meaning.
    """

    word: ClassVar[str] = "error"
    kind: str = held(Choice(options=tuple(ERROR_KINDS)))
    size_m: float = held(Number(-20, 20, "m"))
    phase_rad: float = 0.0

    def __str__(self) -> str:
        """Return the error in the form that `parse_error` reads."""
        return f"{self._place}:{1e6 * self.size_m:g}um"


def parse_fault_or_error(text: str) -> Fault | GearError:
    """Read a fault or an error of a gear; the kind decides.

    Parameters
    ----------
    text : str
        See `faults.parse_fault` and `parse_error`.

    Returns
    -------
    Fault or GearError

    Raises
    ------
    ArgumentError
        If the text is neither.

    Examples
    --------
    >>> parse_fault_or_error("pitch:1:gear:7:8um").kind
    'pitch'
    """
    kind = text.split(":")[0].strip()
    if kind in ERROR_KINDS:
        return parse_error(text)
    check_word("fault kind ", kind, (*KINDS, *ERROR_KINDS))
    return parse_fault(text)


def parse_error(text: str) -> GearError:
    """Read an error of a gear written as ``KIND:STAGE:GEAR:TOOTH:SIZE``.

    Parameters
    ----------
    text : str
        SIZE in um or mm; TOOTH is a number or ``all``: ``eccentricity:1:pinion:all:20um``,
        ``pitch:1:gear:7:8um``.

    Returns
    -------
    GearError

    Raises
    ------
    ArgumentError
        If the text is not of this form.

    Examples
    --------
    >>> round(parse_error("eccentricity:1:pinion:all:20um").size_m, 9)
    2e-05
    """
    syntax = "KIND:STAGE:GEAR:TOOTH:SIZE, such as eccentricity:1:pinion:all:20um"
    where, size = _parts("error", text, ERROR_KINDS, syntax)
    match = re.fullmatch(rf"({NUMBER})\s*(um|mm)", size)
    if match is None:
        raise ArgumentError(f"error {text!r}: SIZE must be a number in um or mm: {syntax}")
    size_m = float(match[1]) * (1e-6 if match[2] == "um" else 1e-3)
    return GearError(**where, size_m=size_m)
