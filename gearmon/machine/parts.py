"""The machine, its parts other than gears, and how both are made of a machine file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeAlias

from gearmon.errors import ArgumentError
from gearmon.machine import fields as rules
from gearmon.machine import stages
from gearmon.machine.fields import Checked, FieldError, check_fields, held, limit, optional, within
from gearmon.machine.stages import ParallelStage, PlanetaryStage
from gearmon.result import Result

Stage = ParallelStage | PlanetaryStage

SENSOR_KINDS = ("vibration", "tacho", "torque", "speed", "other")
#: Keys that tell the lines of a rolling bearing.
BALLS = ("balls", "ball_diameter_mm", "pitch_diameter_mm")
SHARE_TOLERANCE = 1e-6
MOST_STAGES = 30
#: Parts of a machine by the names of their tables in a machine file.
TABLES = {
    "operating": "operating",
    "stage": "stages",
    "shaft": "sections",
    "bearing": "bearings",
    "disc": "discs",
    "sensor": "sensors",
}
#: Fastest over slowest operating point of one machine.
MOST_SPEEDS_APART = 100.0


@dataclass(frozen=True, kw_only=True)
class OperatingPoint(Checked):
    """A speed and torque at which the machine runs, and for what share of its time.

    Parameters
    ----------
    speed_rpm : float, above 0
        Nominal speed of shaft 1, the input [1/min]; its magnitude.
    torque_nm : float, optional, 0 or more
        Torque on shaft 1 [Nm]; its magnitude.
    share : float, above 0 and up to 1
        Share of the running time.
    name : str
        What the point is called in tables.

    Raises
    ------
    FieldError
        If a value has the wrong type or is out of its range.

    Examples
    --------
    >>> OperatingPoint(speed_rpm=1800.0).shaft1_hz
    30.0
    """

    speed_rpm: float = within(
        0, 1e6, "rpm", open_low=True, why="the magnitude of the speed of shaft 1", example="1460.0"
    )
    torque_nm: float | None = optional(0, 1e9, "Nm", "the magnitude of the torque on shaft 1")
    share: float = within(0, 1, default=1.0, open_low=True, why="a share of the running time")
    name: str = held(rules.Text(example='"full load"'), "")

    @property
    def shaft1_hz(self) -> float:
        """Nominal rotation frequency of shaft 1 [Hz]."""
        return self.speed_rpm / 60.0


@dataclass(frozen=True, kw_only=True)
class Bearing:
    """A bearing: what holds a shaft or planet; of balls, lines in the spectrum that are not gears.

    Parameters
    ----------
    name : str
        What the bearing is called in tables.
    shaft : int, optional
        Shaft that the bearing carries, counted from 1 (the input) in the order of power flow.
    planet_stage : int, optional
        Instead of `shaft`: the planetary stage, counted from 1, whose planets it carries.
    balls : int, 3 to 200, optional
        Rolling elements in one row; without them the bearing has a stiffness and no lines.
    ball_diameter_mm, pitch_diameter_mm : float, optional
        Diameter of a rolling element and of the circle of their centres [mm]; beside `balls`.
    roller_length_mm : float, optional
        Length of a roller [mm]; without it the rolling elements are taken as balls.
    contact_angle_deg : float, 0 to 90
        Contact angle [deg].
    rotating : {"inner", "outer"}, optional
        The ring that turns with the shaft or planet: the inner one, on planets the outer one.
    stiffness_n_per_m, damping_ns_per_m : float, optional
        Radial stiffness [N/m] and damping [Ns/m], the same in all directions; of a planet bearing,
        of each planet's pin.
    position_mm : float, optional
        Where it sits on its shaft [mm], see `ShaftSection`.

    Raises
    ------
    FieldError
        If a value has the wrong type or cannot be.
    """

    name: str = held(rules.Text(example='"drive end"'))
    shaft: int | None = held(rules.Count(low=1, high=1000, example="1"), None)
    planet_stage: int | None = held(rules.Count(low=1, high=1000), None)
    balls: int | None = held(rules.Count(low=3, high=200, example="9"), None)
    ball_diameter_mm: float | None = optional(0, 500, "mm", open_low=True, example="7.94")
    pitch_diameter_mm: float | None = optional(0, 10_000, "mm", open_low=True, example="39.04")
    roller_length_mm: float | None = optional(0, 500, "mm", open_low=True)
    contact_angle_deg: float = within(0, 90, "deg", default=0.0)
    rotating: str = held(rules.Choice(options=("inner", "outer")), "")
    stiffness_n_per_m: float | None = held(stages.STIFFNESS, None)
    damping_ns_per_m: float | None = optional(0, 1e10, "Ns/m")
    position_mm: float | None = held(stages.PLACE, None)

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.shaft is None) == (self.planet_stage is None):
            raise FieldError("shaft", "or planet_stage must be given, and only one of them")
        if not self.rotating:
            object.__setattr__(self, "rotating", "inner" if self.planet_stage is None else "outer")
        if self.planet_stage is not None and self.position_mm is not None:
            raise FieldError("position_mm", "is for bearings of a shaft", self.position_mm)
        missing = [name for name in BALLS if getattr(self, name) is None]
        rolls = len(missing) < len(BALLS) or self.roller_length_mm is not None
        if self.stiffness_n_per_m is not None and not rolls:
            return
        if self.balls is None or self.ball_diameter_mm is None or self.pitch_diameter_mm is None:
            told = "is missing; give all of " + ", ".join(BALLS)
            raise FieldError(missing[0], f"{told}, or stiffness_n_per_m and no rolling elements")
        pitch_mm, why = self.pitch_diameter_mm, "less than pitch_diameter_mm"
        limit(self, "ball_diameter_mm", 0, pitch_mm, "mm", why, open_high=True)
        most = math.floor(math.pi / math.asin(self.ball_diameter_mm / pitch_mm) + 1e-9)
        limit(self, "balls", 1, most, "", "more do not fit on the pitch circle")


@dataclass(frozen=True, kw_only=True)
class ShaftSection:
    """A piece of a shaft of one diameter; the sections of a shaft follow one another.

    Positions on a shaft count from the beginning of its first section. What has none sits where it
    mostly does: the first bearing at the beginning and the last at the end, a gear in the middle,
    two gears at a third and two thirds, a disc on shaft 1 at its beginning, on the last shaft at
    its end, else in the middle.

    Parameters
    ----------
    shaft : int
        Shaft, counted from 1 (the input) in the order of power flow.
    length_mm : float
    diameter_mm : float, optional
        Without it the section has no mass and bends only where `bending_stiffness_nm2` is given.
    bore_mm : float
        Inner diameter [mm].
    torsional_stiffness_nm_per_rad : float, optional
        Of the whole section [Nm/rad], in the place of G I_p/length.
    bending_stiffness_nm2 : float, optional
        E I [N m2], in the place of that of the diameter; then no shear is counted.
    elastic_modulus_pa, poisson_ratio, density_kgm3 : float
        Steel by default [Pa, -, kg/m3].

    Raises
    ------
    FieldError
        If a value has the wrong type or cannot be.
    """

    shaft: int = held(rules.Count(low=1, high=1000, example="1"))
    length_mm: float = within(0, 1e5, "mm", open_low=True, example="120.0")
    diameter_mm: float | None = optional(0, 5000, "mm", open_low=True)
    bore_mm: float = within(0, 5000, "mm", default=0.0)
    torsional_stiffness_nm_per_rad: float | None = held(stages.TORSION, None)
    bending_stiffness_nm2: float | None = optional(0, 1e13, "N m2", open_low=True)
    elastic_modulus_pa: float = held(stages.MODULUS, 206e9)
    poisson_ratio: float = within(0, 0.5, default=0.3, open_high=True, why="steel has 0.3")
    density_kgm3: float = within(0, 25_000, "kg/m3", default=7850.0)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.diameter_mm is None and self.torsional_stiffness_nm_per_rad is None:
            raise FieldError("diameter_mm", "or torsional_stiffness_nm_per_rad must be given")
        if self.diameter_mm is not None:
            most_mm, why = self.diameter_mm, "less than diameter_mm"
            limit(self, "bore_mm", 0, most_mm, "mm", why, open_high=True)


@dataclass(frozen=True, kw_only=True)
class Disc(Checked):
    """A body on a shaft that is no gear: motor, load, flywheel, coupling.

    Parameters
    ----------
    name : str
    shaft : int
        Counted from 1 (the input) in the order of power flow.
    inertia_kgm2 : float
        Moment of inertia about the shaft's axis [kg m2].
    mass_kg : float, optional
        Without it the disc does not count in translations [kg].
    position_mm : float, optional
        Where it sits on its shaft [mm], see `ShaftSection`.

    Raises
    ------
    FieldError
        If a value has the wrong type or cannot be.
    """

    name: str = held(rules.Text(example='"motor"'))
    shaft: int = held(rules.Count(low=1, high=1000, example="1"))
    inertia_kgm2: float = held(stages.INERTIA)
    mass_kg: float | None = held(stages.MASS, None)
    position_mm: float | None = held(stages.PLACE, None)


@dataclass(frozen=True, kw_only=True)
class Sensor(Checked):
    """What stands in one column of the recordings.

    Parameters
    ----------
    column : str or int
        Name of the column, or its number counted from 1.
    unit : str, optional
        Unit of the physical quantity, such as "m/s2", "g", "mm/s" or "Nm".
    sensitivity : float, above 0
        Recorded number [per `unit`]: the physical value is the recorded number divided by it. A
        sensor of 100 mV/g recorded in volts has ``unit = "g"`` and ``sensitivity = 0.1``.
    position : str
        Where the sensor sits, in words.
    kind : {"vibration", "tacho", "torque", "speed", "other"}
        What the column is.
    shaft : int
        Shaft that a tacho or speed column belongs to, counted from 1.
    pulses_per_turn : int
        Pulses that a tacho gives in one turn of that shaft.

    Raises
    ------
    FieldError
        If a value has the wrong type or is out of its range.
    """

    column: str | int = held(rules.Column())
    unit: str | None = held(rules.UNIT, None)
    sensitivity: float = within(0, 1e12, default=1.0, open_low=True, why="recorded number per unit")
    position: str = held(rules.Text(example='"input bearing, radial"'), "")
    kind: str = held(rules.Choice(options=SENSOR_KINDS), "vibration")
    shaft: int = held(rules.Count(low=1, high=1000), 1)
    pulses_per_turn: int = held(rules.Count(low=1, high=100_000), 1)


@dataclass(frozen=True, kw_only=True)
class Machine(Result):
    """A drive train, how it runs and how it is measured.

    Stage number i (from 1) is driven by shaft i and drives shaft i + 1.

    Parameters
    ----------
    name : str
        What the machine is called.
    operating : tuple of OperatingPoint
        At least one; their shares sum to 1.
    stages : tuple of ParallelStage or PlanetaryStage
        At least one, in the order of power flow.
    bearings : tuple of Bearing
    sections : tuple of ShaftSection
        Of all shafts, those of each in their order; a shaft without any twists between its gears.
    discs : tuple of Disc
    sensors : tuple of Sensor
        At most one for a column.
    path : str
        The file it was read from, if any.
    notes : tuple of str
        What was derived or is unusual, in words.

    Raises
    ------
    FieldError
        If the parts do not fit together.

    Examples
    --------
    >>> machine.shaft_count, machine.stages[0].gear_teeth
    (2, 57)
    >>> machine.to_dict()["operating"]
    [{'speed_rpm': 1480.0, 'torque_nm': 120.0}]
    """

    name: str = ""
    operating: tuple[OperatingPoint, ...]
    stages: tuple[Stage, ...]
    bearings: tuple[Bearing, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    sections: tuple[ShaftSection, ...] = ()
    discs: tuple[Disc, ...] = ()
    path: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in (*TABLES.values(), "notes"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.operating:
            raise FieldError("operating", "must hold at least one operating point")
        if not 1 <= len(self.stages) <= MOST_STAGES:
            reason = f"is given {len(self.stages)} times; a train has 1 to {MOST_STAGES} stages"
            raise FieldError("stage", reason)
        total = math.fsum(point.share for point in self.operating)
        if abs(total - 1) > SHARE_TOLERANCE:
            reason = f"must sum to 1 over all operating points; the sum is {total:.7g}"
            raise FieldError("operating.share", reason)
        speeds = [point.speed_rpm for point in self.operating]
        if max(speeds) > MOST_SPEEDS_APART * min(speeds):
            reason = (
                f"must not differ by more than a factor of {MOST_SPEEDS_APART:g} between operating "
                f"points; they go from {min(speeds):g} to {max(speeds):g} 1/min"
            )
            raise FieldError("operating.speed_rpm", reason)
        self._check_places()
        columns = [sensor.column for sensor in self.sensors]
        for number, column in enumerate(columns):
            if (earlier := columns.index(column)) < number:
                reason = f"is also the column of sensor[{earlier + 1}]"
                raise FieldError(f"sensor[{number + 1}].column", reason, column)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of a machine file, without what is as by default.

        Returns
        -------
        dict
            `load_machine` makes the machine of it again.
        """
        tables = {table: list(map(_filled, getattr(self, own))) for table, own in TABLES.items()}
        return {"name": self.name} | {table: parts for table, parts in tables.items() if parts}

    @property
    def shaft_count(self) -> int:
        """Shafts in the power flow: one more than there are stages."""
        return len(self.stages) + 1

    def _check_places(self) -> None:
        """Refuse what sits on a shaft or in a stage that is not there, or beyond a shaft's end."""
        planetary = [i for i, s in enumerate(self.stages, start=1) if s.kind == "planetary"]
        shafts = rules.Number(1, self.shaft_count, why="n stages in a row have n + 1 shafts")
        places = [
            (f"stage[{number}].position_{member}_mm", shaft, getattr(own, f"position_{member}_mm"))
            for number, own in enumerate(self.stages, start=1)
            for shaft, member in enumerate(own.on_shafts, start=number)
        ]
        for name in ("bearing", "sensor", "shaft", "disc"):
            for number, part in enumerate(getattr(self, TABLES[name]), start=1):
                where = f"{name}[{number}]"
                if part.shaft is not None:
                    shafts.checked(f"{where}.shaft", part.shaft)
                    at = getattr(part, "position_mm", None)
                    places.append((f"{where}.position_mm", part.shaft, at))
                elif part.planet_stage not in planetary:
                    known = ", ".join(map(str, planetary)) or "none here"
                    reason = f"must be the number of a planetary stage ({known})"
                    raise FieldError(f"{where}.planet_stage", reason, part.planet_stage)
        for key, shaft, at in places:
            length = sum(own.length_mm for own in self.sections if own.shaft == shaft)
            told = f"the length of shaft {shaft}" if length else f"shaft {shaft} has no [[shaft]]"
            if at is not None and at > length * (1 + 1e-9):
                rules.Number(0, length, "mm", told).checked(key, at)


def _filled(part: Any) -> dict[str, Any]:
    """Return what is told of a part, as the keys of its table."""
    told = {own.name: (getattr(part, own.name), own.default) for own in fields(part)}
    kind = {"kind": part.kind} if isinstance(part, Stage) else {}
    return kind | {name: own for name, (own, usual) in told.items() if own not in (None, usual)}


STAGE_KINDS: dict[str, type[Stage]] = {"parallel": ParallelStage, "planetary": PlanetaryStage}

#: Parts that a machine may have, by the names of their tables.
_PARTS = {"bearing": Bearing, "sensor": Sensor, "shaft": ShaftSection, "disc": Disc}
_TOP_KEYS = ("name", *TABLES)
_HOMES: dict[str, type] = (
    {"[operating]": OperatingPoint}
    | {f"[[{table}]]": part for table, part in _PARTS.items()}
    | {f'[[stage]] with kind = "{kind}"': part for kind, part in STAGE_KINDS.items()}
)

#: What `load_machine` takes.
MachineLike: TypeAlias = Machine | str | Path | Mapping[str, Any]


def example_machine() -> str:
    """Return the text of a machine file that demos and the benchmark write."""
    return resources.files("gearmon.machine").joinpath("example.toml").read_text("utf-8")


def load_machine(source: MachineLike | None = None, **tables: Any) -> Machine:
    """Return the machine in a file, a dictionary, or keywords of the same names.

    Parameters
    ----------
    source : str, Path, mapping or Machine, optional
        A TOML file with a table ``[operating]`` (or several ``[[operating]]``, a duty cycle with
        ``share``), one ``[[stage]]`` for each stage in the order of power flow, and optionally
        ``name``, ``[[shaft]]``, ``[[bearing]]``, ``[[disc]]`` and ``[[sensor]]``; or a
        dictionary of the same content, with a list where there are several tables. A Machine is
        returned as it is.
    **tables : mapping, or list of them
        The same as keywords, in the place of a source.

    Returns
    -------
    Machine
        With the file's name for want of a better one, and notes on what was derived.

    Raises
    ------
    MachineFileError
        If the file cannot be read, or anything in it is unknown, missing or impossible: one line
        with file, line, key, value and what is allowed.
    ArgumentError
        If the source is none of these.

    Examples
    --------
    >>> stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
    >>> load_machine(operating={"speed_rpm": 1480.0}, stage=stage).shaft_count
    2
    """
    if isinstance(source, Machine) and not tables:
        return source
    given = tables if source is None else source
    if source is not None and tables:
        raise ArgumentError(f"machine: given twice, also as {', '.join(tables)}=; give it once")
    if isinstance(given, str | Path):
        read = replace(rules.read_source(given), homes=_HOMES)
    elif isinstance(given, Mapping):
        read = rules.MachineSource(path="", document=dict(given), homes=_HOMES)
    else:
        raise ArgumentError(
            f"machine: {type(given).__name__} is no machine; give the name of a machine file, a "
            "dictionary with operating and stage, or a Machine"
        )
    read.refuse_unknown_keys(read.document, _TOP_KEYS)
    name = read.document.get("name", Path(read.path).stem or "machine")
    stages, notes = _stages(read)
    parts: dict[str, Any] = {"stages": stages, "notes": notes}
    for table, part in _PARTS.items():
        parts[TABLES[table]] = [read.part(part, *own) for own in read.tables(table)]
    parts["operating"] = _operating_points(read)
    try:
        if not isinstance(name, str) or not name.strip() or not name.isprintable():
            raise FieldError("name", "must be one line of text in quotes", name)
        return Machine(name=name, path=read.path, **parts)
    except FieldError as error:
        raise read.error(error.key, error.message(error.key)) from None


def _operating_points(source: rules.MachineSource) -> tuple[OperatingPoint, ...]:
    tables = source.tables("operating", single=True)
    if not tables:
        told = "lacks an operating point; write [operating] with speed_rpm = 1460.0"
        raise source.error("", told)
    without = [label for label, table in tables if "share" not in table]
    if 0 < len(without) < len(tables):
        told = f"{without[0]} lacks share; give it to every point or to none"
        raise source.error(without[0], told)
    equal = {"share": 1 / len(tables)} if without else {}
    return tuple(source.part(OperatingPoint, label, equal | table) for label, table in tables)


def _stages(source: rules.MachineSource) -> tuple[list[Stage], list[str]]:
    """Return the stages, and what is unusual about them."""
    stages: list[Stage] = []
    notes: list[str] = []
    for number, (label, table) in enumerate(source.tables("stage"), start=1):
        given = dict(table)
        kind = given.pop("kind", None)
        if kind is None:
            raise source.error(label, f'{label} lacks kind; write kind = "parallel" or "planetary"')
        if not isinstance(kind, str) or kind not in STAGE_KINDS:
            message = f'{label}.kind = {rules.shown_value(kind)} must be "parallel" or "planetary"'
            raise source.error(f"{label}.kind", message)
        derived = kind == "planetary" and "planet_teeth" not in given
        remarks = _derive_planet_teeth(source, label, given) if derived else []
        stage = source.part(STAGE_KINDS[kind], label, given)
        remarks += stage.notes if isinstance(stage, PlanetaryStage) else ()
        stages.append(stage)
        notes += [f"stage {number}: {told}" for told in remarks]
    if not stages:
        example = '[[stage]] with kind = "parallel", pinion_teeth = 26, gear_teeth = 53'
        raise source.error("", f"lacks a stage; write {example}")
    return stages, notes


def _derive_planet_teeth(
    source: rules.MachineSource, label: str, table: dict[str, Any]
) -> list[str]:
    """Set planet_teeth = (ring - sun) / 2 where that is a whole number; say so."""
    sun, ring = table.get("sun_teeth"), table.get("ring_teeth")
    if type(sun) is not int or type(ring) is not int:
        return []  # missing or of the wrong type: the ordinary checks will say which
    planet, rest = divmod(ring - sun, 2)
    if rest or planet < 1:
        reason = f"ring_teeth - sun_teeth = {ring - sun} is not twice a tooth count"
        raise source.error(label, f"{label} lacks planet_teeth, and {reason}: give planet_teeth")
    table["planet_teeth"] = planet
    return [f"planet_teeth = {planet} taken from (ring_teeth - sun_teeth) / 2"]
