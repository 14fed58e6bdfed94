"""Faults of single teeth or of all teeth, and the stiffness that they take from a pair.

The size of a fault is the loss of stiffness of the pair whose tooth it is, or what can be measured
on the tooth (see `fault_shapes`), from which the loss follows. A fault is turned into `LossPatch`
objects: where, along the contact of the pair and across its face width, which share of the
stiffness is gone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from gearmon.errors import ArgumentError, nearest_name
from gearmon.gears.fault_shapes import (
    LOSS_UNITS,
    PLAIN,
    FaultShape,
    check_size,
    parse_size,
    size_text,
)
from gearmon.gears.loss_curves import LossCurve

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
GEARS = ("pinion", "gear", "sun", "planet", "ring")
UNITS = LOSS_UNITS
#: Share of the path of contact that is hurt, centred on the pitch point.
BANDS = {"pitting": 0.3, "spall": 0.15}
SYNTAX = "KIND:STAGE:GEAR:TOOTH:SIZE, such as crack:1:pinion:5:20% or crack:1:pinion:5:1.5mm"

GearName = Literal["pinion", "gear", "sun", "planet", "ring"]


@dataclass(frozen=True, kw_only=True)
class Fault:
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
    shape : FaultShape
        Further dimensions of a size that is no loss.

    Raises
    ------
    ArgumentError
        If a value has no meaning.

    Examples
    --------
    >>> Fault(kind="crack", stage=1, gear="pinion", tooth=5, size=20, unit="%").loss
    0.2
    """

    kind: str
    stage: int
    gear: str
    tooth: int | None
    size: float
    unit: str = ""
    shape: FaultShape = PLAIN

    def __post_init__(self) -> None:
        _check_word("fault kind", self.kind, KINDS)
        _check_word("gear", self.gear, GEARS)
        if self.stage != int(self.stage) or self.stage < 1:
            raise ArgumentError(f"fault stage={self.stage} must be a whole number >= 1")
        self._check_tooth()
        check_size(self.kind, self.size, self.unit, self.shape)

    @property
    def is_loss(self) -> bool:
        """Whether the size is a loss of stiffness, and not something measured on the tooth."""
        return self.unit in UNITS

    @property
    def loss(self) -> float:
        """Loss of stiffness of the pair where the fault acts, in [0, 1).

        Raises
        ------
        ArgumentError
            If the size is given in other units; `gears.fault_sizes.stiffness_loss` converts it.
        """
        if not self.is_loss:
            raise ArgumentError(
                f"fault {self}: the loss of stiffness follows from the teeth; convert it with "
                f"gears.fault_sizes.stiffness_loss"
            )
        return self.size * UNITS[self.unit]

    def __str__(self) -> str:
        """Return the fault in the form that `parse_fault` reads."""
        tooth = "all" if self.tooth is None else self.tooth
        size = size_text(self.kind, self.size, self.unit, self.shape)
        place = f"{self.kind}:{self.stage}:{self.gear}:{tooth}"
        return f"{place}:{size}" if size else place

    def _check_tooth(self) -> None:
        if (self.tooth is None) != (self.kind == "wear"):
            wanted = "'all'" if self.kind == "wear" else "one tooth number"
            raise ArgumentError(f"fault {self.kind}: TOOTH must be {wanted}")
        if self.tooth is not None and (self.tooth != int(self.tooth) or self.tooth < 1):
            raise ArgumentError(f"fault tooth={self.tooth} must be a whole number >= 1")


@dataclass(frozen=True, kw_only=True)
class LossPatch:
    """A share of the stiffness lost in a part of the contact and of the face width.

    Parameters
    ----------
    weight : float
        Share lost there; negative in the overlap of two faults, which do not add up.
    start, end : float
        Part of the contact, in mesh periods from the entry of the pair.
    face_start, face_end : float, in [0, 1]
        Part of the face width, from the side that enters contact first.
    curve : LossCurve, optional
        By what the weight is multiplied along the contact; by default 1.
    """

    weight: float
    start: float
    end: float
    face_start: float = 0.0
    face_end: float = 1.0
    curve: LossCurve | None = None


def parse_fault(text: str) -> Fault:
    """Read a fault written as ``KIND:STAGE:GEAR:TOOTH:SIZE``.

    Parameters
    ----------
    text : str
        SIZE is the loss of pair stiffness, ``0.2`` or ``20%``, or what is measured on the tooth:
        ``crack:1:pinion:5:1.5mm``, ``spall:1:gear:3:4x1.5x0.5mm``, ``pitting:1:gear:3:12%flank``;
        see `fault_shapes`. TOOTH is a number or ``all``. A missing tooth has no SIZE.

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
    parts = [part.strip() for part in text.split(":")]
    if parts[0] == "missing" and len(parts) == 4:
        parts.append("1tooth")
    if len(parts) != 5:
        raise ArgumentError(f"fault {text!r} has {len(parts)} parts and not 5: {SYNTAX}")
    kind, stage, gear, tooth, size = parts
    _check_word("fault kind", kind, KINDS)
    try:
        number, unit, shape = parse_size(kind, size)
    except ArgumentError as error:
        raise ArgumentError(f"fault {text!r}: {error}; {SYNTAX}") from None
    return Fault(
        kind=kind,
        stage=_whole("STAGE", stage, text),
        gear=gear,
        tooth=None if tooth == "all" else _whole("TOOTH", tooth, text),
        size=number,
        unit=unit,
        shape=shape,
    )


def faults_of_stage(faults: Iterable[Fault], stage: int) -> tuple[Fault, ...]:
    """Return the faults of one stage, counted from 1."""
    return tuple(fault for fault in faults if fault.stage == stage)


def loss_patches(fault: Fault, contact_ratio: float, pitch_phase: float) -> tuple[LossPatch, ...]:
    """Return where in the contact of its pair a fault takes which share of the stiffness.

    Parameters
    ----------
    fault : Fault
    contact_ratio : float
        Length of the contact of a pair (of one transverse section) [mesh periods].
    pitch_phase : float
        Mesh periods from the entry to the pitch point.

    Returns
    -------
    tuple of LossPatch
        Empty for a fault of size 0.

    Raises
    ------
    ArgumentError
        If the size is no loss of stiffness.
    """
    if fault.loss == 0:
        return ()
    if fault.kind == "breakage":
        return (LossPatch(weight=1.0, start=0.0, end=contact_ratio, face_end=fault.loss),)
    if fault.kind not in BANDS:
        return (LossPatch(weight=fault.loss, start=0.0, end=contact_ratio),)
    half = 0.5 * BANDS[fault.kind] * contact_ratio
    # a pitch point near an end of the path leaves less of the band in contact
    start, end = max(0.0, pitch_phase - half), min(contact_ratio, pitch_phase + half)
    return (LossPatch(weight=fault.loss, start=start, end=end),) if end > start else ()


def union(one: Sequence[LossPatch], other: Sequence[LossPatch]) -> tuple[LossPatch, ...]:
    """Return the loss of two faults of one pair: what is left after both is multiplied."""
    return (*one, *other, *(negated(patch) for patch in overlap(one, other)))


def overlap(one: Sequence[LossPatch], other: Sequence[LossPatch]) -> tuple[LossPatch, ...]:
    """Return the product of two losses, patch by patch."""
    patches = []
    for a in one:
        for b in other:
            start, end = max(a.start, b.start), min(a.end, b.end)
            low, high = max(a.face_start, b.face_start), min(a.face_end, b.face_end)
            if start < end and low < high:
                patches.append(
                    LossPatch(
                        weight=a.weight * b.weight,
                        start=start,
                        end=end,
                        face_start=low,
                        face_end=high,
                        curve=_product(a.curve, b.curve),
                    )
                )
    return tuple(patches)


def negated(patch: LossPatch) -> LossPatch:
    """Return the patch with the opposite weight."""
    return replace(patch, weight=-patch.weight)


def _product(one: LossCurve | None, other: LossCurve | None) -> LossCurve | None:
    if one is None or other is None:
        return one or other
    return one.times(other)


def _check_word(name: str, word: str, known: Iterable[str]) -> None:
    words = list(known)
    if word in words:
        return
    near = nearest_name(str(word), words)
    hint = f"; did you mean {near}?" if near else ""
    raise ArgumentError(f"{name} {word!r} is not one of {', '.join(words)}{hint}")


def _whole(name: str, word: str, text: str) -> int:
    try:
        return int(word)
    except ValueError:
        hint = " or 'all'" if name == "TOOTH" else ""
        raise ArgumentError(
            f"fault {text!r}: {name} {word!r} must be a whole number{hint}; {SYNTAX}"
        ) from None
