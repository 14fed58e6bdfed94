"""Which order lines belong together: mesh harmonics, sidebands by gear, synchronous rest.

Every line is counted once. Orders of a train are ratios of tooth counts, so coincidences (the third
mesh harmonic of one stage on the first of another) are decided exactly, in fractions; a line that
several families claim goes to the one it is nearest to in its own harmonics. Shaft and mesh
harmonics also have names (`machine_marks`), for the peaks of a spectrum.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, product
from operator import itemgetter
from typing import Any

import numpy as np

from gearmon.arrays import BoolArray, FloatArray, IntArray
from gearmon.gears.kinematics import Kinematics, Mesh, Wheel, kinematics
from gearmon.machine import Machine

MESH_HARMONICS = 8
NEAR_SIDEBANDS = 6
# A slow mesh is heard where the housing rings, from about 1 kHz on, and not at its first harmonics:
# more of them are taken, up to this frequency [Hz], but no more than so many. With 32 two of eight
# simulated final drives, whose planets mesh at 48 Hz, could not be learned (one mode at 2.1 kHz),
# and five at 22 Hz; with 128 all can, and six of six at 10 Hz (40 s). Of 115 recordings without
# gears (bearings, shafts, mains, noise) 16 to 18 show a slow mesh that is none, whatever the limit.
_HEARD_HZ, _MOST_HARMONICS = 2500.0, 128
# Harmonics of each shaft that are named in a spectrum.
_SHAFT_HARMONICS = 3


def mesh_harmonics(mesh_hz: float) -> int:
    """Return how many harmonics of a mesh are looked at: eight, or as many as reach 2.5 kHz.

    Parameters
    ----------
    mesh_hz : float
        Mesh frequency at nominal speed [Hz].

    Returns
    -------
    int
        8 to 128.

    Examples
    --------
    >>> mesh_harmonics(480.0), mesh_harmonics(150.0), mesh_harmonics(40.0)
    (8, 17, 63)
    """
    return min(max(MESH_HARMONICS, math.ceil(_HEARD_HZ / mesh_hz)), _MOST_HARMONICS)


@dataclass(frozen=True, kw_only=True)
class Family:
    """Lines with one cause about one mesh harmonic.

    Parameters
    ----------
    kind : {"mesh", "sidebands", "residual"}
        The mesh harmonic itself, the sidebands up to the sixth, or what else repeats with the gear.
    stage : int
        Stage, from 1.
    gear : str
        Gear or member that repeats with the spacing ("" for the mesh itself).
    harmonic : int
        Mesh harmonic, from 1.
    spacing : float
        Spacing of the lines as an order of shaft 1 (0 for the mesh itself).
    shaft : int or None
        Shaft that turns at this spacing.
    lines : tuple of int
        Positions in the plan's orders.
    """

    kind: str
    stage: int
    gear: str = ""
    harmonic: int
    spacing: float = 0.0
    shaft: int | None = None
    lines: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """The family in words."""
        if self.kind == "mesh":
            return f"mesh {self.stage} harmonic {self.harmonic}"
        # a planetary gear has several spacings: turning, and passing the planets
        spaced = f"the {self.gear} at {self.spacing:.4g} orders"
        where = f"shaft {self.shaft}" if self.shaft else spaced
        what = "sidebands" if self.kind == "sidebands" else "synchronous residual"
        return f"{what} of {where} around mesh {self.stage} harmonic {self.harmonic}"


@dataclass(frozen=True, kw_only=True, eq=False)
class GearMultiples:
    """Multiples of one gear's rotation.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : str
        "pinion", "gear", "sun", "planet" or "ring".
    teeth : int
        Teeth.
    order : float
        Rotation relative to the carrier (to the housing in a parallel stage), in turns of shaft 1.
    number : ndarray of int, shape (lines,)
        Multiple of the rotation.
    mesh : ndarray of bool, shape (lines,)
        Whether the line is a harmonic of any mesh.
    """

    stage: int
    gear: str
    teeth: int
    order: float
    number: IntArray
    mesh: BoolArray


@dataclass(frozen=True, kw_only=True)
class WheelLines(GearMultiples):
    """All multiples of one gear's rotation, to build its synchronous average from.

    Parameters
    ----------
    shaft : int or None
        Shaft it turns with.
    lines : ndarray of int, shape (lines,)
        Position of each in the plan's orders.
    beside : ndarray of int, shape (0 or 2, lines)
        Position of the lines a turn of the carrier below and above each, where passing planets put
        what damage of a tooth adds (`Mesh.brought_alike`); -1 elsewhere and for harmonics of a
        mesh. None of gears that planets do not pass, and of one that stands still: its own turn is
        the carrier's.
    """

    shaft: int | None
    lines: IntArray
    beside: IntArray = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))

    @classmethod
    def of(cls, stage: int, wheel: Wheel, **lines: Any) -> WheelLines:
        """Return the lines of a gear."""
        whose: dict[str, Any] = {"gear": wheel.gear, "teeth": wheel.teeth, "shaft": wheel.shaft}
        return cls(stage=stage, **whose, order=wheel.relative_order, **lines)


@dataclass(frozen=True, kw_only=True)
class LinePlan:
    """The orders to measure and what each is.

    Parameters
    ----------
    orders : ndarray of float, shape (lines,)
        Ascending orders of shaft 1.
    families : tuple of Family
        Disjoint groups of lines.
    wheels : tuple of WheelLines
        Gears whose turn can be resolved; their lines may be shared.
    """

    orders: FloatArray
    families: tuple[Family, ...]
    wheels: tuple[WheelLines, ...]

    def by_family(self, lines: FloatArray) -> FloatArray:
        """Return the sums over each family of what the lines have, shape (..., families)."""
        chosen = [line for family in self.families for line in family.lines]
        sizes = np.array([len(family.lines) for family in self.families], dtype=int)
        own = lines[..., np.array(chosen, dtype=int)]
        return np.asarray(np.add.reduceat(own, np.cumsum(sizes) - sizes, axis=-1))


# A line in parts of an order, the rank of a claim on it (the lowest wins), and the family if any.
_Claim = tuple[int, int, Family | None]
# How far beside multiples of a gear's turn passing planets are heard, and of which multiples.
_Side = tuple[int, int, int]


# recordings of one machine have the same lines
@lru_cache(maxsize=16)
def line_plan(
    train: Kinematics, top_order: float, finest_spacing: float, shaft1_hz: float = math.inf
) -> LinePlan:
    """Plan the order lines of a drive train that a recording can show.

    Parameters
    ----------
    train : Kinematics
        The drive train.
    top_order : float
        Highest order that the sampling rate allows.
    finest_spacing : float
        Smallest distance of lines that the blocks of the recording tell apart; gears that turn
        more slowly get no sidebands.
    shaft1_hz : float
        Nominal rotation frequency of shaft 1 [Hz]: of slow meshes more harmonics are planned.

    Returns
    -------
    LinePlan
        The mesh harmonics of `mesh_harmonics`, sidebands of every modulation, all multiples of
        every gear's rotation up to half a mesh order beyond.
    """
    top = Fraction(top_order).limit_denominator(10**6)
    # orders are counted in whole parts of one of which all lines are multiples: exact as fractions
    exact = [shaft.exact for shaft in train.shafts]
    for mesh in train.meshes:
        exact += [mesh.exact, mesh.carrier, *(own.exact for own in mesh.modulations)]
        exact += [wheel.exact_relative for wheel in mesh.wheels]
    unit = math.lcm(*(order.denominator for order in exact))
    end, claims = math.ceil(top * unit), list[_Claim]()
    for mesh in train.meshes:
        count = min(mesh_harmonics(mesh.order * shaft1_hz), int(top / mesh.exact))
        claims += _claims(mesh, range(1, count + 1), finest_spacing, unit)
    claims.sort(key=itemgetter(1))
    # a family that the sampling rate cuts short would differ from recording to recording
    cut = {family for order, _, family in claims if order >= end}
    # the strongest claim wins, of equal ones the first: it is the last to be written
    owner = {order: family for order, _, family in reversed(claims) if 0 < order < end}
    if not owner:  # no mesh can be seen at this sampling rate: at least the shafts
        turning = (int(shaft.exact * unit) for shaft in train.shafts)
        owner = dict.fromkeys(order for order in turning if order < end)
    position = {order: index for index, order in enumerate(sorted(owner))}
    members: dict[Family, list[int]] = {}
    for order, index in position.items():
        known = owner[order]
        if known is not None and known not in cut:
            members.setdefault(known, []).append(index)
    ranked = sorted(members, key=lambda own: (own.stage, own.kind, own.spacing, own.harmonic))
    return LinePlan(
        orders=np.array([order / unit for order in position]),
        families=tuple(replace(own, lines=tuple(members[own])) for own in ranked),
        wheels=_wheels(train, finest_spacing, unit, position),
    )


def _claims(mesh: Mesh, harmonics: range, finest: float, unit: int) -> Iterator[_Claim]:
    """Give the lines of a mesh, its sidebands and all multiples of its gears' turns about them."""
    for k in harmonics:
        family = Family(kind="mesh", stage=mesh.stage, harmonic=k)
        for order in group_orders(mesh, k):
            yield int(order * unit), k - (1000 if order == k * mesh.exact else 500), family
    centre, teeth = int(mesh.exact * unit), {own.gear: own.teeth for own in mesh.wheels}
    seen = set[Fraction]()
    for own in mesh.modulations:
        if own.exact in seen or own.order < finest:
            continue
        seen.add(own.exact)
        apart = int(own.exact * unit)
        reach = min(max(NEAR_SIDEBANDS, teeth.get(own.gear, 0) // 2), centre // (2 * apart))
        whose: dict[str, Any] = {"gear": own.gear, "spacing": own.order, "shaft": own.shaft}
        for k in harmonics:
            near = Family(kind="sidebands", stage=mesh.stage, harmonic=k, **whose)
            far = replace(near, kind="residual")
            for r, sign in product(range(1, reach + 1), (-1, 1)):
                yield k * centre + sign * r * apart, r, near if r <= NEAR_SIDEBANDS else far
    for wheel, turning, sides in _resolved(mesh, finest, unit):
        half = wheel.teeth // 2
        for k in harmonics:
            for n in range(k * wheel.teeth - half, k * wheel.teeth + half + 1):
                yield n * turning, 10**6, None
                for aside, step, first in sides:
                    if n % step == first:
                        yield n * turning + aside, 10**6, None


def _resolved(mesh: Mesh, finest: float, unit: int) -> Iterator[tuple[Wheel, int, list[_Side]]]:
    """Give the gears of a mesh whose turn can be resolved, with it in parts of an order."""
    carrier = int(mesh.carrier * unit) if abs(mesh.carrier) >= finest else 0
    for wheel in mesh.wheels:
        if wheel.relative_order >= finest:
            told = (-1, 1) if carrier and wheel.exact else ()
            sides = [(s * carrier, *mesh.brought_alike(wheel.gear, s)) for s in told]
            yield wheel, int(wheel.exact_relative * unit), sides


def _wheels(
    train: Kinematics, finest: float, unit: int, position: dict[int, int]
) -> tuple[WheelLines, ...]:
    """Return the lines of every gear among those of the plan."""
    # whole numbers of any size
    orders, found = np.array([*position], dtype=object), []
    of_mesh = np.logical_or.reduce([orders % int(own.exact * unit) == 0 for own in train.meshes])
    apart = {order: place for order, place in position.items() if not of_mesh[place]}
    for mesh in train.meshes:
        for wheel, turning, sides in _resolved(mesh, finest, unit):
            lines = np.flatnonzero(orders % turning == 0)
            number = (orders[lines] // turning).astype(np.int64)
            # planned only for a gear that turns k times as often, lines tell nothing of one tooth:
            # they are the same for k places of the turn
            kept = np.isin(number + 1, number) | np.isin(number - 1, number)
            lines, number = lines[kept], number[kept]
            beside = [
                [apart.get(n * turning + aside, -1) if n % step == first else -1 for n in number]
                for aside, step, first in sides
            ]
            own: dict[str, Any] = {"number": number, "lines": lines, "mesh": of_mesh[lines]}
            own["beside"] = np.array(beside, dtype=np.int64).reshape(len(beside), len(lines))
            found.append(WheelLines.of(mesh.stage, wheel, **own))
    return tuple(found)


def group_orders(mesh: Mesh, harmonic: int) -> tuple[Fraction, ...]:
    """Orders where one mesh harmonic may show on a healthy machine.

    A parallel stage shows it at the harmonic. Of a planetary set the planets' phases may cancel
    it there; the nearest lines that they allow count with it, and the neighbours one carrier turn
    away, which unequal planets put there (McFadden and Smith 1985).

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    harmonic : int
        Harmonic, from 1.

    Returns
    -------
    tuple of Fraction
        Orders, exact.
    """
    turns = {0}
    if mesh.carrier:
        shift = -harmonic * mesh.wheel("ring").teeth % mesh.planets if mesh.equally_spaced else 0
        turns |= {-1, 1} | ({shift, shift - mesh.planets} if shift else set())
    orders = (harmonic * mesh.exact + own * mesh.carrier for own in turns)
    return tuple(sorted(order for order in orders if order > 0))


# recordings of one machine are asked for the same orders
@lru_cache(maxsize=16)
def known_orders(train: Kinematics, top: float, width: float) -> FloatArray:
    """Orders at which the gears and shafts of a machine can show.

    Parameters
    ----------
    train : Kinematics
        The machine.
    top : float
        Highest order wanted.
    width : float
        Resolution: rotations less than six times this apart are followed for twelve harmonics
        only, for all of them would leave no place for anything else.

    Returns
    -------
    ndarray of float
        Ascending: multiples of all rotations; mesh harmonics with six sidebands of every rotation,
        and sums of two rotations up to the third; sums and differences of mesh harmonics.
    """
    every = {shaft.order for shaft in train.shafts}
    for mesh in train.meshes:
        every |= {wheel.relative_order for wheel in mesh.wheels}
        every |= {float(family.exact) for family in mesh.modulations}
    turning = sorted(order for order in every if order > 0)
    orders = [
        rotation * np.arange(1, int(top / rotation) + 1 if rotation > 6 * width else 13)
        for rotation in turning
    ]
    about = [0.0, *(r * one for one in turning for r in range(-6, 7) if r)]
    sums = [(a, b) for a, b in product((-2, -1, 1, 2), repeat=2) if abs(a) + abs(b) <= 3]
    about += [a * one + b * other for one, other in combinations(turning, 2) for a, b in sums]
    meshes = [mesh.order * np.arange(1, int(top / mesh.order) + 2) for mesh in train.meshes]
    orders += [np.add.outer(harmonics, about).ravel() for harmonics in meshes]
    for one, other in combinations(meshes, 2):
        orders += [np.abs(one[:, None] + sign * other).ravel() for sign in (1, -1)]
    whole = np.concatenate(orders)
    return np.unique(np.round(whole[(whole > 0) & (whole <= top)], 9))


def distance_to(known: FloatArray, orders: FloatArray) -> FloatArray:
    """Distance of orders to the nearest of ascending known ones; infinite if there is none."""
    ends = np.concatenate([[-np.inf], known, [np.inf]])
    after = np.searchsorted(ends, orders)
    return np.asarray(np.minimum(ends[after] - orders, orders - ends[after - 1]))


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A line of the machine.

    Parameters
    ----------
    place : float
        Frequency [Hz], or order of the shaft that the axis counts by.
    name : str
        "shaft 2 ×1", "mesh 1 ×3"; several names are joined by " = ".
    kind : {"shaft", "mesh"}
    number : int
        Shaft, or stage.
    """

    place: float
    name: str
    kind: str
    number: int


def machine_marks(machine: Machine, per_order: float, top: float) -> tuple[Mark, ...]:
    """Return the shaft and mesh harmonics of a machine, lowest first.

    Parameters
    ----------
    machine : Machine
        The machine.
    per_order : float
        What one order of shaft 1 is on the axis: its speed [Hz], or the reciprocal of the order of
        the shaft that the axis counts by.
    top : float
        No marks above this place.
    """
    train = kinematics(machine)
    named = [(mesh.order, "mesh", mesh.stage, MESH_HARMONICS) for mesh in train.meshes]
    named += [(shaft.order, "shaft", shaft.number, _SHAFT_HARMONICS) for shaft in train.shafts]
    found: dict[float, Mark] = {}
    for order, kind, number, harmonics in named:
        for k in range(1, harmonics + 1):
            name, place = f"{kind} {number} ×{k}", k * order * per_order
            mark = Mark(place=place, name=name, kind=kind, number=number)
            known = found.setdefault(round(k * order, 9), mark)
            if known is not mark:
                found[round(k * order, 9)] = replace(known, name=f"{known.name} = {name}")
    return tuple(found[key] for key in sorted(found) if found[key].place <= top)


def mark_near(marks: tuple[Mark, ...], place: float, within: float) -> str:
    """Return the name of the mark nearest to a place, "" if none lies within a distance."""
    near = min(marks, key=lambda mark: abs(mark.place - place), default=None)
    return near.name if near is not None and abs(near.place - place) <= within else ""
