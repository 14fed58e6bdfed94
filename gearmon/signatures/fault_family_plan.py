"""Which faults a family holds: kinds, sizes, gears and operating points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from gearmon.errors import ArgumentError, check_range, nearest_name
from gearmon.gears.faults import ERROR_KINDS, KINDS, parse_fault_or_error
from gearmon.gears.pairs import mesh_pairs
from gearmon.machine import Machine
from gearmon.signatures.fault_family_members import fault_text
from gearmon.signatures.fault_family_mesh import mesh_with

#: What a family holds unless told otherwise. A crack in % is a uniform loss of stiffness.
FAMILY_KINDS = (
    "crack",
    "breakage",
    "pitting",
    "spall",
    "wear",
    "missing",
    "pitch",
    "eccentricity",
    "misalignment",
)
LOSSES = ("2.5%", "5%", "10%", "20%", "40%")
ERROR_SIZES = ("5um", "10um", "20um", "40um")
GONE = ("1tooth",)

Size = float | str


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What a family holds.

    Parameters
    ----------
    sizes : dict of str to tuple of str
        Sizes by kind, as in ``KIND:STAGE:GEAR:TOOTH:SIZE``.
    gears : tuple of (int, str, int)
        Stage, gear, and the mesh in which it is taken.
    operating : tuple of int
        Operating points, from 0.
    """

    sizes: dict[str, tuple[str, ...]]
    gears: tuple[tuple[int, str, int], ...]
    operating: tuple[int, ...]


def family_plan(
    machine: Machine,
    kinds: Iterable[str] | None,
    sizes: Sequence[Size] | Mapping[str, Sequence[Size]] | None,
    gears: Iterable[tuple[int, str] | str] | None,
    operating: Iterable[int] | int | None,
) -> Plan:
    """Return what a family holds, see `fault_family.fault_family`.

    Raises
    ------
    ArgumentError
        If a name or a size has no meaning, or nothing is left.
    """
    chosen = FAMILY_KINDS if kinds is None else tuple(dict.fromkeys(kinds))
    known = (*KINDS, *ERROR_KINDS)
    for kind in chosen:
        if kind not in known:
            near = nearest_name(kind, known)
            hint = f"; did you mean {near}?" if near else ""
            raise ArgumentError(f"kind {kind!r} is not one of {', '.join(known)}{hint}")
    if operating is None:
        operating = range(len(machine.operating))
    points = (operating,) if isinstance(operating, int) else tuple(operating)
    for number in points:
        check_range("operating", number, 0, len(machine.operating) - 1)
    plan = Plan(
        sizes=_sizes(chosen, sizes, kinds is not None),
        gears=tuple(dict.fromkeys(_gears(machine, gears))),
        operating=tuple(dict.fromkeys(points)),
    )
    for name, part in (("kinds", plan.sizes), ("gears", plan.gears), ("operating", points)):
        if not part:
            raise ArgumentError(f"{name}: none given, at least one is needed")
    return plan


def _sizes(
    kinds: Sequence[str],
    sizes: Sequence[Size] | Mapping[str, Sequence[Size]] | None,
    is_asked: bool,
) -> dict[str, tuple[str, ...]]:
    if sizes is None or isinstance(sizes, Mapping):
        given = {} if sizes is None else sizes
        foreign = [kind for kind in given if kind not in kinds]
        if foreign:
            raise ArgumentError(f"sizes: {foreign[0]!r} is not among the kinds {', '.join(kinds)}")
        own = {kind: tuple(map(_text, given.get(kind, _default(kind)))) for kind in kinds}
        for kind, texts in own.items():
            for text in texts:
                parse_fault_or_error(fault_text(kind, 1, "pinion", text))
        return own
    texts = tuple(dict.fromkeys(map(_text, sizes)))
    found = {kind: tuple(t for t in texts if _fits(kind, t)) for kind in kinds}
    found |= {kind: GONE for kind in kinds if kind == "missing"}
    for text in texts:
        if not any(text in own for own in found.values()):
            raise ArgumentError(
                f"size {text!r} fits none of the kinds {', '.join(kinds)}: losses are written 0.2 "
                f"or 20%, damage 1.5mm or 12%flank, errors 20um"
            )
    for kind, own_texts in found.items():
        if not own_texts and is_asked:
            raise ArgumentError(f"no size fits kind {kind!r}; its default is {_default(kind)}")
    return {kind: own_texts for kind, own_texts in found.items() if own_texts}


def _default(kind: str) -> tuple[str, ...]:
    if kind == "missing":
        return GONE
    return ERROR_SIZES if kind in ERROR_KINDS else LOSSES


def _text(size: Size) -> str:
    """Write a number as a loss in per cent."""
    return size.strip() if isinstance(size, str) else f"{100 * float(size):.12g}%"


def _fits(kind: str, text: str) -> bool:
    # in a list for all kinds mm are depths of damage: an error of millimetres is none
    if kind in ERROR_KINDS:
        return text.endswith("um")
    try:
        parse_fault_or_error(fault_text(kind, 1, "pinion", text))
    except ArgumentError:
        return False
    return True


def _gears(
    machine: Machine, gears: Iterable[tuple[int, str] | str] | None
) -> Iterable[tuple[int, str, int]]:
    every = [
        (number, gear)
        for number, stage in enumerate(machine.stages, start=1)
        for gear in dict.fromkeys(
            m.name for pair in mesh_pairs(stage, number, machine.path) for m in pair.members
        )
    ]
    if gears is None:
        return [(stage, gear, mesh_with(machine, stage, gear)) for stage, gear in every]
    found: list[tuple[int, str, int]] = []
    for item in gears:
        if isinstance(item, str) and ":" not in item:
            own = [place for place in every if place[1] == item.strip()]
            if not own:
                names = ", ".join(dict.fromkeys(gear for _, gear in every))
                raise ArgumentError(f"gear {item!r} is not in this machine: it has {names}")
        else:
            own = [_place(item)]
        found += [(stage, gear, mesh_with(machine, stage, gear)) for stage, gear in own]
    return found


def _place(item: tuple[int, str] | str) -> tuple[int, str]:
    if not isinstance(item, str):
        return int(item[0]), item[1]
    stage, _, gear = item.partition(":")
    try:
        return int(stage), gear.strip()
    except ValueError:
        raise ArgumentError(
            f"gear {item!r}: must be STAGE:GEAR, such as 1:pinion, or GEAR"
        ) from None
