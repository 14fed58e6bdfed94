"""Which order lines belong together: mesh harmonics, sidebands by gear, synchronous rest.

Every line is counted once. Orders of a train are ratios of tooth counts, so coincidences (the third
mesh harmonic of one stage on the first of another) are decided exactly, in fractions; a line that
several families claim goes to the one it is nearest to in its own harmonics. Shaft and mesh
harmonics also have names (`machine_marks`), for the peaks of a spectrum.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import combinations

import numpy as np

from gearmon.gears.kinematics import Kinematics, Mesh, Wheel, kinematics
from gearmon.machine import Machine
from gearmon.signals.array_types import BoolArray, FloatArray, IntArray

MESH_HARMONICS = 8
NEAR_SIDEBANDS = 6
# A slow mesh is heard where the housing rings, from about 1 kHz on, and not at its first harmonics:
# more of them are taken, up to this frequency [Hz], but no more than so many.
_HEARD_HZ, _MOST_HARMONICS = 2500.0, 32
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
        8 to 32.

    Examples
    --------
    >>> mesh_harmonics(480.0), mesh_harmonics(150.0), mesh_harmonics(40.0)
    (8, 17, 32)
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
    gear: str
    harmonic: int
    spacing: float
    shaft: int | None
    lines: tuple[int, ...]

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


@dataclass(frozen=True, kw_only=True)
class WheelLines:
    """All multiples of one gear's rotation, to build its synchronous average from.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : str
        "pinion", "gear", "sun", "planet" or "ring".
    teeth : int
        Teeth.
    shaft : int or None
        Shaft it turns with.
    order : float
        Rotation relative to the carrier (to the housing in a parallel stage).
    number : ndarray of int, shape (lines,)
        Multiple of the rotation.
    lines : ndarray of int, shape (lines,)
        Position of each in the plan's orders.
    mesh : ndarray of bool, shape (lines,)
        Whether the line is a harmonic of any mesh.
    beside : ndarray of int, shape (0 or 2, lines)
        Position of the lines a turn of the carrier below and above each, where passing planets put
        what damage of a tooth adds (`Mesh.brought_alike`); -1 elsewhere and for harmonics of a
        mesh. None of gears that planets do not pass, and of one that stands still: its own turn is
        the carrier's.
    """

    stage: int
    gear: str
    teeth: int
    shaft: int | None
    order: float
    number: IntArray
    lines: IntArray
    mesh: BoolArray
    beside: IntArray

    @classmethod
    def of(
        cls,
        stage: int,
        wheel: Wheel,
        number: IntArray,
        lines: IntArray,
        mesh: BoolArray,
        beside: Sequence[IntArray] = (),
    ) -> WheelLines:
        """Return the lines of a gear."""
        return cls(
            stage=stage,
            gear=wheel.gear,
            teeth=wheel.teeth,
            shaft=wheel.shaft,
            order=wheel.relative_order,
            number=number,
            lines=lines,
            mesh=mesh,
            beside=np.array(beside, dtype=np.int64).reshape(len(beside), len(number)),
        )


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
    unit = _common_denominator(train)
    counts = {mesh.stage: mesh_harmonics(mesh.order * shaft1_hz) for mesh in train.meshes}
    claims = _Claims(Fraction(top_order).limit_denominator(10**6), unit, counts)
    for mesh in train.meshes:
        _claim_mesh(claims, mesh)
    for mesh in train.meshes:
        for spacing, gear, shaft, teeth in _spacings(mesh):
            if float(spacing) >= finest_spacing:
                _claim_sidebands(claims, mesh, spacing, gear, shaft, teeth)
    wheels = [
        (mesh, wheel)
        for mesh in train.meshes
        for wheel in mesh.wheels
        if wheel.relative_order >= finest_spacing
    ]
    for mesh, wheel in wheels:
        centre, turning = claims.units(mesh.exact), claims.units(wheel.exact_relative)
        for k in claims.harmonics(mesh):
            for r in range(-(wheel.teeth // 2), wheel.teeth // 2 + 1):
                claims.add(k * centre + r * turning, 10**6, None)
                for side in _sides(mesh, wheel, finest_spacing):
                    order = k * centre + r * turning + side * claims.units(mesh.carrier)
                    step, first = mesh.brought_alike(wheel.gear, side)
                    if (k * wheel.teeth + r) % step == first:
                        claims.add(order, 10**6, None)
    if not claims.owner:  # no mesh can be seen at this sampling rate: at least the shafts
        for rotation in train.shafts:
            claims.add(claims.units(rotation.exact), 10**6, None)
    exact = sorted(claims.owner)
    position = {order: index for index, order in enumerate(exact)}
    meshes = {
        k * claims.units(mesh.exact)
        for mesh in train.meshes
        for k in range(1, int(claims.top / mesh.exact) + 1)
    }
    return LinePlan(
        orders=np.array([order / unit for order in exact]),
        families=tuple(_families(claims, position)),
        wheels=tuple(
            _wheel_lines(mesh, wheel, position, meshes, claims, _sides(mesh, wheel, finest_spacing))
            for mesh, wheel in wheels
        ),
    )


def _sides(mesh: Mesh, wheel: Wheel, finest_spacing: float) -> tuple[int, ...]:
    """Return on which sides of multiples of a gear's turn passing planets are heard."""
    told = mesh.carrier != 0 and abs(mesh.carrier) >= finest_spacing
    return (-1, 1) if told and wheel.exact != 0 else ()


def _common_denominator(train: Kinematics) -> int:
    """Return the least number of parts of an order of which all lines of a train are multiples."""
    exact = [rotation.exact for rotation in train.shafts]
    for mesh in train.meshes:
        exact += [mesh.exact, Fraction(mesh.carrier)]
        exact += [wheel.exact_relative for wheel in mesh.wheels]
        exact += [family.exact for family in mesh.modulations]
    return math.lcm(*(order.denominator for order in exact))


_Key = tuple[str, int, str, int, Fraction, int | None]


class _Claims:
    """Lines and the family each belongs to: the strongest claim wins.

    Orders are counted in whole parts of one, `unit` of them: that is as exact as fractions.
    """

    def __init__(self, top: Fraction, unit: int, counts: dict[int, int]) -> None:
        self.top = top
        self.counts = counts
        self.unit = unit
        self.owner: dict[int, tuple[int, _Key | None]] = {}
        self.cut: set[_Key] = set()
        # the first whole number that is not below the top
        self._end = math.ceil(top * unit)

    def harmonics(self, mesh: Mesh) -> range:
        """Return the harmonics of a mesh that are planned."""
        return range(1, min(self.counts[mesh.stage], int(self.top / mesh.exact)) + 1)

    def units(self, order: Fraction) -> int:
        """Return an order in parts."""
        return int(order * self.unit)

    def add(self, order: int, rank: int, key: _Key | None) -> None:
        if order >= self._end and key is not None:
            # a family that the sampling rate cuts short would differ from recording to recording
            self.cut.add(key)
        if not 0 < order < self._end:
            return
        held = self.owner.get(order)
        if held is None or rank < held[0]:
            self.owner[order] = (rank, key)


def _claim_mesh(claims: _Claims, mesh: Mesh) -> None:
    for k in claims.harmonics(mesh):
        key = ("mesh", mesh.stage, "", k, Fraction(0), None)
        claims.add(k * claims.units(mesh.exact), -1000 + k, key)
        for order in group_orders(mesh, k):
            claims.add(claims.units(order), -500 + k, key)


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
    centre = harmonic * mesh.exact
    if mesh.carrier == 0:
        return (centre,)
    carrier = abs(mesh.carrier)
    orders = {centre - carrier, centre, centre + carrier}
    if mesh.equally_spaced:
        shift = -harmonic * mesh.wheel("ring").teeth % mesh.planets
        if shift:
            orders |= {
                centre + shift * mesh.carrier,
                centre + (shift - mesh.planets) * mesh.carrier,
            }
    return tuple(sorted(order for order in orders if order > 0))


def _spacings(mesh: Mesh) -> Iterator[tuple[Fraction, str, int | None, int]]:
    """Distinct sideband spacings of a mesh, with the member to name and its tooth count."""
    teeth = {wheel.gear: wheel.teeth for wheel in mesh.wheels}
    seen: set[Fraction] = set()
    for family in mesh.modulations:
        if family.exact not in seen:
            seen.add(family.exact)
            yield family.exact, family.gear, family.shaft, teeth.get(family.gear, 0)


def _claim_sidebands(
    claims: _Claims, mesh: Mesh, spacing: Fraction, gear: str, shaft: int | None, teeth: int
) -> None:
    half = max(NEAR_SIDEBANDS, teeth // 2)
    centre, apart = claims.units(mesh.exact), claims.units(spacing)
    for k in claims.harmonics(mesh):
        for r in range(1, half + 1):
            if 2 * r * apart > centre:
                break
            kind = "sidebands" if r <= NEAR_SIDEBANDS else "residual"
            key = (kind, mesh.stage, gear, k, spacing, shaft)
            claims.add(k * centre - r * apart, r, key)
            claims.add(k * centre + r * apart, r, key)


def _families(claims: _Claims, position: dict[int, int]) -> Iterator[Family]:
    members: dict[_Key, list[int]] = {}
    for order, (_, key) in claims.owner.items():
        if key is not None and key not in claims.cut:
            members.setdefault(key, []).append(position[order])
    for key in sorted(members, key=lambda item: (item[1], item[0], item[4], item[3])):
        kind, stage, gear, harmonic, spacing, shaft = key
        yield Family(
            kind=kind,
            stage=stage,
            gear=gear,
            harmonic=harmonic,
            spacing=float(spacing),
            shaft=shaft,
            lines=tuple(sorted(members[key])),
        )


def _wheel_lines(
    mesh: Mesh,
    wheel: Wheel,
    position: dict[int, int],
    meshes: set[int],
    claims: _Claims,
    sides: tuple[int, ...],
) -> WheelLines:
    turning = claims.units(wheel.exact_relative)
    last = int(claims.top / wheel.exact_relative)
    multiples = ((n, n * turning) for n in range(1, last + 1))
    held = [(n, order, position[order]) for n, order in multiples if order in position]
    number, lines = (np.array([one[k] for one in held], dtype=np.int64) for k in (0, 2))
    of_mesh = np.array([order in meshes for _, order, _ in held], dtype=bool)
    beside = []
    for side in sides:
        step, first = mesh.brought_alike(wheel.gear, side)
        orders = [order + side * claims.units(mesh.carrier) for _, order, _ in held]
        places = np.array([-1 if n in meshes else position.get(n, -1) for n in orders])
        beside.append(np.where(number % step == first, places, -1))
    return WheelLines.of(mesh.stage, wheel, number, lines, of_mesh, beside)


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
    turning = sorted(
        {shaft.order for shaft in train.shafts}
        | {wheel.relative_order for mesh in train.meshes for wheel in mesh.wheels}
        | {float(family.exact) for mesh in train.meshes for family in mesh.modulations}
    )
    turning = [order for order in turning if order > 0]
    orders = [
        rotation * np.arange(1, int(top / rotation) + 1 if rotation > 6 * width else 13)
        for rotation in turning
    ]
    about = np.array([0.0] + [r * one for one in turning for r in range(-6, 7) if r])
    beside = [
        a * one + b * other
        for one, other in combinations(turning, 2)
        for a, b in ((1, 1), (1, 2), (2, 1), (1, -1), (1, -2), (2, -1))
    ]
    about = np.concatenate([about, beside, -np.array(beside)])
    meshes = [mesh.order * np.arange(1, int(top / mesh.order) + 2) for mesh in train.meshes]
    orders += [(harmonics[:, None] + about).ravel() for harmonics in meshes]
    for one, other in combinations(meshes, 2):
        orders.append(np.abs(one[:, None] + other).ravel())
        orders.append(np.abs(one[:, None] - other).ravel())
    whole = np.concatenate(orders)
    return np.unique(np.round(whole[(whole > 0) & (whole <= top)], 9))


def distance_to(known: FloatArray, orders: FloatArray) -> FloatArray:
    """Distance of orders to the nearest of ascending known ones; infinite if there is none."""
    if len(known) == 0:
        return np.full(len(orders), np.inf)
    after = np.searchsorted(known, orders)
    above = np.abs(known[np.minimum(after, len(known) - 1)] - orders)
    below = np.abs(known[np.maximum(after - 1, 0)] - orders)
    return np.asarray(np.minimum(above, below), dtype=np.float64)


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
    found: dict[float, Mark] = {}

    def add(order: float, name: str, kind: str, number: int) -> None:
        place = order * per_order
        if place > top:
            return
        key = round(order, 9)
        known = found.get(key)
        if known is None:
            found[key] = Mark(place=place, name=name, kind=kind, number=number)
        else:
            joined = f"{known.name} = {name}"
            found[key] = Mark(place=place, name=joined, kind=known.kind, number=known.number)

    for mesh in train.meshes:
        for k in range(1, MESH_HARMONICS + 1):
            add(k * mesh.order, f"mesh {mesh.stage} ×{k}", "mesh", mesh.stage)
    for shaft in train.shafts:
        for k in range(1, _SHAFT_HARMONICS + 1):
            add(k * shaft.order, f"shaft {shaft.number} ×{k}", "shaft", shaft.number)
    return tuple(found[key] for key in sorted(found))


def mark_near(marks: tuple[Mark, ...], place: float, within: float) -> str:
    """Return the name of the mark nearest to a place, "" if none lies within a distance."""
    near = min(marks, key=lambda mark: abs(mark.place - place), default=None)
    return near.name if near is not None and abs(near.place - place) <= within else ""
