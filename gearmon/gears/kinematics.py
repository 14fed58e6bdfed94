"""Kinematics of a drive train: at which orders its shafts, meshes and bearings show.

Stage i lies between shafts i and i + 1. Directions of rotation are dropped, except inside a
planetary set, where they decide how fast the members pass one another.

References
----------
R. B. Randall, Vibration-based Condition Monitoring, Wiley 2011, chapter 2.
P. D. McFadden and J. D. Smith, An explanation for the asymmetry of the modulation sidebands about
the tooth meshing frequency in epicyclic gear vibration, Proc. IMechE 199 C1 (1985) 65-70.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, pairwise, product
from typing import Any, TypeVar

from gearmon.errors import ArgumentError, check_word
from gearmon.machine import Bearing, Machine, ParallelStage, PlanetaryStage
from gearmon.result import Result

_Item = TypeVar("_Item")
#: Part of a planet's mesh force that a sensor on the housing hears only while the planet passes.
PLANET_PASS_DEPTH = 0.8


@dataclass(frozen=True)
class Turning:
    """Something that repeats a fixed number of times per turn of shaft 1.

    Parameters
    ----------
    exact : Fraction
        Its order: how often per turn of shaft 1, seen from the housing, without sign.
    """

    exact: Fraction

    @property
    def order(self) -> float:
        """The order as a number."""
        return float(self.exact)


@dataclass(frozen=True)
class Shaft(Turning):
    """A shaft in the power flow.

    Parameters
    ----------
    exact : Fraction
        Turns per turn of shaft 1, without sign.
    number : int
        Counted from 1, the input.
    name : str
        What it is in the train.
    """

    number: int
    name: str


@dataclass(frozen=True)
class Wheel(Turning):
    """A gear in a mesh.

    Parameters
    ----------
    exact : Fraction
        Turns per turn of shaft 1, seen from the housing.
    gear : {"pinion", "gear", "sun", "planet", "ring"}
    teeth : int
    shaft : int or None
        Shaft that it turns with; None if it stands still or turns on a planet pin.
    exact_relative : Fraction
        Turns per turn of shaft 1 relative to the carrier (to the housing in a parallel stage):
        ``teeth * exact_relative`` is the mesh order.
    """

    gear: str
    teeth: int
    shaft: int | None
    exact_relative: Fraction

    @property
    def relative_order(self) -> float:
        """Turns per turn of shaft 1 relative to the carrier."""
        return float(self.exact_relative)


@dataclass(frozen=True)
class Line(Turning):
    """A frequency that the machine can show, or the spacing of a family of sidebands.

    Parameters
    ----------
    exact : Fraction
        Order, in turns of shaft 1; where angles enter (bearings) that of a rounded number.
    kind : str
        "shaft", "mesh", "assembly phase", "hunting tooth", "rotation", "planet pass",
        "local fault" or "bearing".
    name : str
    stage, shaft : int or None
    gear : {"pinion", "gear", "sun", "planet", "ring", "carrier", ""}
        The member to blame for sidebands.
    """

    kind: str
    name: str
    stage: int | None = None
    shaft: int | None = None
    gear: str = ""


@dataclass(frozen=True, kw_only=True)
class Mesh(Turning):
    """The mesh of one stage; in a planetary set all meshes have the same frequency.

    Parameters
    ----------
    stage : int
        Counted from 1.
    name : str
    exact : Fraction
        Tooth pairs per turn of shaft 1.
    wheels : tuple of Wheel
        Pinion and gear, or sun, planet and ring.
    modulations : tuple of Line
        The families of sidebands to look for about its harmonics, by what modulates.
    planets : int
        Planets; 0 in a parallel stage.
    carrier : Fraction
        Signed order of the carrier, positive where tooth contacts on the ring run with it; 0 in a
        parallel stage or if the carrier stands still.
    equally_spaced : bool
        Whether the planets sit at equal angles.
    """

    stage: int
    name: str
    wheels: tuple[Wheel, ...]
    modulations: tuple[Line, ...]
    planets: int = 0
    carrier: Fraction = Fraction(0)
    equally_spaced: bool = True

    def wheel(self, gear: str) -> Wheel:
        """Return the wheel called `gear`.

        Raises
        ------
        ArgumentError
            If the stage has no such gear.
        """
        known = {wheel.gear: wheel for wheel in self.wheels}
        check_word(f"gear of stage {self.stage}: ", gear, known)
        return known[gear]

    def brought_alike(self, gear: str, side: int) -> tuple[int, int]:
        """Return which lines of damage of a tooth all planets bring alike; the others cancel.

        Parameters
        ----------
        gear : str
            Gear of the tooth. One of a planet meets no other planet.
        side : {-1, 0, 1}
            Turns of the carrier beside multiples of the gear's own relative to the carrier.

        Returns
        -------
        step, first : int
            Multiples n with n % step == first.
        """
        if gear not in ("sun", "ring") or not self.equally_spaced:
            return 1, 0
        # planets come to a tooth of the ring in the other sense
        return self.planets, side * (-1 if gear == "ring" else 1) % self.planets

    def healthy_orders(self, harmonic: int, reach: int = 2) -> tuple[float, ...]:
        """Return where a sensor on the housing sees one mesh harmonic of a faultless stage.

        Parameters
        ----------
        harmonic : int, 1 or more
            Harmonic of the mesh.
        reach : int, 1 or more
            Lines wanted on either side of the harmonic, for a planetary set.

        Returns
        -------
        tuple of float
            Orders, ascending: of a parallel stage the mesh harmonic alone.

        Raises
        ------
        ArgumentError
            If `harmonic` or `reach` is less than 1.

        Notes
        -----
        Past the sensor go N equal planets whose contacts with the ring differ in phase by
        2 pi z_r / N. Their sum leaves only the lines k f_m + s f_c with k z_r + s divisible by N
        (McFadden and Smith 1985): there may be none at the mesh harmonic itself. With unequal
        spacing nothing cancels and every s is possible.
        """
        if harmonic < 1 or reach < 1:
            raise ArgumentError(f"harmonic={harmonic} and reach={reach} must be 1 or more")
        if self.carrier == 0:
            return (float(harmonic * self.exact),)
        step = self.planets if self.equally_spaced else 1
        first = -harmonic * self.wheel("ring").teeth % step - step * reach
        shifts = (s for s in range(first, step * reach + 1, step))
        orders = (abs(harmonic * self.exact + s * self.carrier) for s in shifts)
        return tuple(float(order) for order in sorted(orders))


@dataclass(frozen=True, kw_only=True)
class Kinematics:
    """Shafts, meshes and lines of a machine.

    Parameters
    ----------
    shafts : tuple of Shaft
        Shaft 1 is the input; stage i lies between shafts i and i + 1.
    meshes : tuple of Mesh
        One for each stage.
    lines : tuple of Line
        Everything: the shafts, then each stage, then the bearings.
    """

    shafts: tuple[Shaft, ...]
    meshes: tuple[Mesh, ...]
    lines: tuple[Line, ...]

    def shaft(self, number: int) -> Shaft:
        """Return the shaft with this number, counted from 1.

        Raises
        ------
        ArgumentError
            If there is no such shaft.
        """
        return numbered("shaft", self.shafts, number)

    def mesh(self, stage: int) -> Mesh:
        """Return the mesh of this stage, counted from 1.

        Raises
        ------
        ArgumentError
            If there is no such stage.
        """
        return numbered("stage", self.meshes, stage)

    def coincidences(self, highest_harmonic: int = 20) -> tuple[tuple[tuple[int, int], ...], ...]:
        """Return the lowest common harmonic of every two stages that have one, exactly.

        Their lines cannot be told apart.

        Parameters
        ----------
        highest_harmonic : int
            Harmonics above this do not count.

        Returns
        -------
        tuple of ((int, int), (int, int))
            Stage and number of the one mesh harmonic, and of the other.
        """
        found = []
        for low, high in combinations(self.meshes, 2):
            ratio = low.exact / high.exact
            if max(ratio.numerator, ratio.denominator) <= highest_harmonic:
                found.append(((low.stage, ratio.denominator), (high.stage, ratio.numerator)))
        return tuple(found)


@dataclass(frozen=True, kw_only=True)
class LineTable(Result):
    """The lines of a machine at its operating points.

    Parameters
    ----------
    machine : str
        Name of the machine.
    rows : tuple of dict
        Of each line at each operating point: operating, speed_rpm, stage, kind, name, shaft, order
        and frequency_hz.
    notes : tuple of str
        Remarks on the machine file and on lines that coincide.
    """

    machine: str
    rows: tuple[dict[str, Any], ...]
    notes: tuple[str, ...] = ()


def numbered(what: str, items: tuple[_Item, ...], number: int) -> _Item:
    """Return the item with this number, counted from 1.

    Raises
    ------
    ArgumentError
        If there is none.
    """
    if number not in range(1, len(items) + 1):
        raise ArgumentError(f"{what}={number} must lie in [1, {len(items)}], a whole number")
    return items[int(number) - 1]


@lru_cache(maxsize=16)
def kinematics(machine: Machine, pace: Fraction = Fraction(1)) -> Kinematics:
    """Return the shafts, meshes and lines of a machine as orders of shaft 1.

    Parameters
    ----------
    machine : Machine
        Stages in the order of power flow; speed-increasing stages and planetary sets with any
        fixed and any driving member may follow one another in any way.
    pace : Fraction, > 0
        Turns a turn of shaft 1 of the shaft that orders count the turns of.

    Returns
    -------
    Kinematics

    Examples
    --------
    >>> from gearmon.machine import Machine, OperatingPoint, ParallelStage
    >>> stage = ParallelStage(pinion_teeth=8, gear_teeth=42)
    >>> train = kinematics(Machine(operating=[OperatingPoint(speed_rpm=1200)], stages=[stage]))
    >>> [round(20 * line.order, 4) for line in train.lines]
    [20.0, 3.8095, 160.0, 80.0, 0.9524]
    """
    orders, meshes = [1 / pace], []
    for number, stage in enumerate(machine.stages, start=1):
        if isinstance(stage, ParallelStage):
            own = {"pinion": Fraction(1), "gear": Fraction(stage.pinion_teeth, stage.gear_teeth)}
        else:
            own = planetary_speeds(stage)
        speeds = {name: speed * orders[-1] for name, speed in own.items()}
        meshes.append(_mesh(number, stage, speeds))
        orders.append(abs(speeds[stage.on_shafts[1]]))
    names = {len(orders): "output"} | {1: "input"}
    shafts = tuple(Shaft(own, n, names.get(n, "intermediate")) for n, own in enumerate(orders, 1))
    lines = [Line(own.exact, "shaft", f"{own.name} shaft", shaft=own.number) for own in shafts]
    for mesh in meshes:
        lines.append(Line(mesh.exact, "mesh", mesh.name, mesh.stage))
        for one, two in pairwise(mesh.wheels):
            name = f"{one.gear}-{two.gear}, {one.teeth}/{two.teeth}" if mesh.planets else mesh.name
            # with a common factor g of the tooth counts a tooth meets only every g-th tooth of the
            # other wheel; the same two teeth meet again after lcm(z1, z2) mesh periods
            common, least = math.gcd(one.teeth, two.teeth), math.lcm(one.teeth, two.teeth)
            lines.append(Line(mesh.exact / common, "assembly phase", name, mesh.stage))
            lines.append(Line(mesh.exact / least, "hunting tooth", name, mesh.stage))
        for wheel in mesh.wheels:
            if wheel.gear == "planet" and wheel.exact:
                seen = "planet, seen from the housing"
                lines.append(Line(wheel.exact, "rotation", seen, mesh.stage))
        lines += [family for family in mesh.modulations if family.shaft is None]
    for bearing in machine.bearings:
        lines += _bearing_lines(bearing, shafts, meshes)
    return Kinematics(shafts=shafts, meshes=tuple(meshes), lines=tuple(lines))


def line_table(machine: Machine) -> LineTable:
    """Return every line of a machine in hertz.

    Parameters
    ----------
    machine : Machine

    Returns
    -------
    LineTable
        One row for each line and operating point, with notes on lines that coincide.
    """
    train = kinematics(machine)
    rows = []
    for point, line in product(machine.operating, train.lines):
        row = {"operating": point.name or f"{point.speed_rpm:g} rpm", "speed_rpm": point.speed_rpm}
        row |= {name: getattr(line, name) for name in ("stage", "kind", "name", "shaft", "order")}
        # of a fraction one rounding only: 500 Hz reads 500.0
        rows.append(row | {"frequency_hz": float(line.exact * Fraction(point.speed_rpm) / 60)})
    coinciding = tuple(
        f"mesh harmonic {harmonic} of stage {stage} is exactly mesh harmonic "
        f"{other_harmonic} of stage {other_stage}: these lines cannot be told apart"
        for (stage, harmonic), (other_stage, other_harmonic) in train.coincidences()
    )
    return LineTable(machine=machine.name, rows=tuple(rows), notes=machine.notes + coinciding)


def planetary_speeds(stage: PlanetaryStage) -> dict[str, Fraction]:
    """Return the speeds of the members of a planetary set for one turn of the driving one.

    Parameters
    ----------
    stage : PlanetaryStage

    Returns
    -------
    dict of str to Fraction
        Signed turns of "sun", "ring", "carrier" and "planet" (about its own axis, seen from the
        housing).

    Notes
    -----
    Willis: z_s (n_s - n_c) + z_r (n_r - n_c) = 0, that is, the speeds times the weights z_s, z_r
    and -(z_s + z_r) sum to zero. The planet turns at -(z_s / z_p)(n_s - n_c) on its carrier.

    Examples
    --------
    >>> stage = PlanetaryStage(sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4)
    >>> planetary_speeds(stage)["carrier"]
    Fraction(1, 6)
    """
    sun, ring = stage.sun_teeth, stage.ring_teeth
    weights = {"sun": sun, "ring": ring, "carrier": -(sun + ring)}
    speeds = {stage.fixed: Fraction(0), stage.driving: Fraction(1)}
    speeds[stage.driven] = Fraction(-weights[stage.driving], weights[stage.driven])
    spin = Fraction(-sun, stage.planet_teeth) * (speeds["sun"] - speeds["carrier"])
    speeds["planet"] = spin + speeds["carrier"]
    return speeds


def _mesh(i: int, stage: ParallelStage | PlanetaryStage, speeds: dict[str, Fraction]) -> Mesh:
    shafts = dict(zip(stage.on_shafts, (i, i + 1), strict=True))
    carrier, planets = speeds.get("carrier", Fraction(0)), getattr(stage, "planets", 0)
    gears = ("sun", "planet", "ring") if planets else ("pinion", "gear")
    counts = {gear: getattr(stage, f"{gear}_teeth") for gear in gears}
    wheels = tuple(
        Wheel(abs(speeds[gear]), gear, count, shafts.get(gear), abs(speeds[gear] - carrier))
        for gear, count in counts.items()
    )
    forwards = (carrier - speeds.get("ring", 0)) * carrier > 0
    teeth = "/".join(map(str, counts.values()))
    families, shaft = list[Line](), shafts.get("carrier")
    if planets:
        families.append(Line(abs(carrier), "rotation", "carrier rotation", i, shaft, "carrier"))
        passing = Line(planets * abs(carrier), "planet pass", "planet pass", i, gear="carrier")
        families.append(passing)
    for w in wheels:
        spins = w.gear == "planet"
        if not spins:
            families.append(Line(w.exact, "rotation", f"{w.gear} rotation", i, w.shaft, w.gear))
        if planets:
            # a tooth of a planet meets sun and ring in a turn, one of theirs all planets
            turns, meets = w.exact_relative, 2 if spins else planets
            seen = "planet spin" if spins else f"{w.gear} relative to carrier"
            around = turns * bool(spins or carrier)
            families.append(Line(around, "rotation", seen, i, gear=w.gear))
            families.append(Line(meets * turns, "local fault", f"{w.gear} fault", i, gear=w.gear))
    return Mesh(
        stage=i,
        name=f"{stage.name}, {teeth}" if stage.name else teeth,
        exact=wheels[0].teeth * wheels[0].exact_relative,
        wheels=wheels,
        modulations=tuple(family for family in families if family.exact),
        planets=planets,
        carrier=abs(carrier) if forwards else -abs(carrier),
        equally_spaced=getattr(stage, "equally_spaced", True),
    )


def _bearing_lines(
    bearing: Bearing, shafts: tuple[Shaft, ...], meshes: list[Mesh]
) -> Iterator[Line]:
    """Yield the four kinematic lines of a bearing that rolls without slip.

    With g = (ball / pitch diameter) cos(contact angle) and one ring turning at f past the other:
    BPFO n f (1 - g) / 2, BPFI n f (1 + g) / 2, BSF f (D / d) (1 - g^2) / 2. The cage turns at
    f (1 - g) / 2 with the inner ring, at f (1 + g) / 2 with the outer one (on a planet: relative
    to the carrier). Slip makes real lines depart from these by 1 or 2 per cent.
    """
    if not (bearing.balls and bearing.ball_diameter_mm and bearing.pitch_diameter_mm):
        return
    turning, stage = shafts[(bearing.shaft or 1) - 1].order, bearing.planet_stage
    if stage is not None:
        turning = meshes[stage - 1].wheel("planet").relative_order
    diameters = bearing.ball_diameter_mm / bearing.pitch_diameter_mm
    g = diameters * math.cos(math.radians(bearing.contact_angle_deg))
    cage = (1 - g) / 2 if bearing.rotating == "inner" else (1 + g) / 2
    for name, factor in (
        ("cage (FTF)", cage),
        ("ball spin (BSF)", (1 - g * g) / (2 * diameters)),
        ("outer race (BPFO)", bearing.balls * (1 - g) / 2),
        ("inner race (BPFI)", bearing.balls * (1 + g) / 2),
    ):
        exact, told = Fraction(factor * turning), f"{bearing.name}: {name}"
        yield Line(exact, "bearing", told, stage, bearing.shaft)
