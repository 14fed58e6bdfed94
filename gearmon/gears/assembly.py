"""How the machine is put together: shafts in bearings, gears, carriers, planets, motor and load.

Every body turns about its axis and moves along x and y. Coordinates are displacements [m] and
rotations [rad]. A shaft is a chain of sections: it twists between the places where something sits,
and bends as a Timoshenko beam, its mass spread evenly (consistent); how it tilts follows from its
bending without inertia. Tilting gears, axial motion and gyroscopic moments are left out.

A gear on shaft i that turns in the sense s pushes its mate, seen from it in the direction g, along
n = (cos b, sin b), b = g + s (90 deg - alpha_w):

    d = n . (q_1 - q_2) + s (r_1 theta_1 + r_2 theta_2)

The mesh of planet and ring is the same with alpha_w + 90 deg and a negative radius. What happens to
a planet happens to those behind it later: with psi counted as the sun turns past the carrier, the
meshes of the planet at psi lead by -z_s psi/(2 pi) and z_r psi/(2 pi) mesh periods, and a tooth of
the planet reaches the ring half a turn of the planet after the sun.

References
----------
J. Lin and R. G. Parker, J. Vib. Acoust. 121 (1999) 316 (planetary set, carried over to the fixed
frame); R. G. Parker and J. Lin, J. Mech. Des. 126 (2004) 68 (phases); M. I. Friswell, J. E. T.
Penny, S. D. Garvey and A. W. Lees, Dynamics of Rotating Machines, 2010 (beams, geared shafts,
bearings); G. R. Cowper, J. Appl. Mech. 33 (1966) 335 (shear of round sections).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gearmon.arrays import FloatArray
from gearmon.gears.kinematics import planetary_speeds
from gearmon.gears.mechanics import (
    ELASTIC_DAMPING_S,
    DriveTrain,
    Planets,
    Spring,
    disc_body,
    equivalent_mass,
    gear_disc,
    known_force,
    mesh_damping,
    pairs_of,
)
from gearmon.gears.pairs import MeshPair
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.machine import (
    Bearing,
    Disc,
    Machine,
    OperatingPoint,
    ParallelStage,
    PlanetaryStage,
    ShaftSection,
)

#: Stiffness of a ball bearing over (balls^2 ball_diameter load cos^5(contact angle))^(1/3), by
#: Hertz (Friswell et al., section 5.5.1) [N^(2/3) m^(-4/3)].
BALL_BEARING = 13e6
#: That of a roller bearing over rollers^0.9 roller_length^0.8 load^0.1 cos^1.9(contact angle), in
#: the same place [N^0.9 m^-1.8].
ROLLER_BEARING = 1e9
#: Pieces at least into which a shaft with mass is cut, and k l (wave number times length of a
#: piece) up to which they tell bending and twist: frequencies are then 0.5 and 1 % too high.
PIECES = 12
BEND_RESOLVED, TWIST_RESOLVED = 1.2, 0.5
#: A shaft between two gears that has no section: its diameter over the smaller gear's reference
#: diameter where neither has a bore, its length over both face widths; these, where not given, over
#: the module.
SHAFT_OVER_GEAR, SHAFT_OVER_WIDTHS, WIDTH_OVER_MODULE = 0.6, 4.5, 10.0
_LEFT_OUT = "tilting gears, axial motion and gyroscopic moments are left out"
_DAMPED = (
    "shafts, bearings and supports that tell no damper have "
    f"{ELASTIC_DAMPING_S:g} s of damping over stiffness"
)
#: Of a beam of unit length between deflection and tilt at both ends: stiffness over E I, what the
#: shear adds to it, and mass.
_BENT = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
_SHEARED = np.array([[0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 0, 0], [0, -1, 0, 1]])
_CARRIED = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
_PAIR, _SPREAD = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[2.0, 1.0], [1.0, 2.0]]) / 6


def drive_train(
    machine: Machine, point: OperatingPoint | None = None, form: str = "parabolic"
) -> DriveTrain:
    """Return a machine as one elastic system.

    Parameters
    ----------
    machine : Machine
        What it says nothing of is taken as said in `notes`: a shaft without section twists between
        its gears, a bearing without stiffness is rigid; one that tells its rolling elements yields
        by Hertz under planets and shafts with sections.
    point : OperatingPoint, optional
        Its torque loads the teeth and the bearings; by default the machine's first.
    form : str
        Of the stiffness curve, see `mesh_stiffness`.

    Raises
    ------
    ArgumentError
        If the machine lacks data, with the key to add.
    """
    made = _Assembly(machine, point or machine.operating[0], form)
    n = len(made.names)  # rows have room for more
    return DriveTrain(
        coordinates=tuple(made.names),
        turning=np.array(made.turning, dtype=bool),
        mass=made.mass[:n, :n],
        springs=tuple(replace(own, rows=own.rows[:, :n]) for own in made.springs),
        planets={i: replace(own, rows=own.rows[..., :n]) for i, own in made.planets.items()},
        shafts=made.torques,
        notes=tuple(dict.fromkeys(made.notes)),
    )


@dataclass(frozen=True, eq=False)
class _Shaft:
    """A shaft and what sits on it.

    `ends` are where its sections begin and end [m], `at` the places that move by themselves [m],
    and `rows` how they move, shape (places, 3, width).
    """

    number: int
    sections: list[ShaftSection]
    ends: FloatArray
    bearings: list[tuple[float, Bearing]]
    discs: list[tuple[float, Disc]]
    at: FloatArray
    rows: FloatArray

    @property
    def bends(self) -> bool:
        return bool(self.sections) and all(_section(own)[1] for own in self.sections)

    def place(self, position_m: float) -> FloatArray:
        return np.asarray(self.rows[int(np.abs(self.at - position_m).argmin())])


class _Assembly:
    """Collects coordinates, masses and springs; rows have room for more coordinates than come."""

    def __init__(self, machine: Machine, point: OperatingPoint, form: str) -> None:
        self.machine, self.form, self.notes = machine, form, [_LEFT_OUT, _DAMPED]
        self.pairs = [pairs_of(machine, number) for number in range(1, machine.shaft_count)]
        found = [self.shaft(number) for number in range(1, machine.shaft_count + 1)]
        planets = sum(getattr(stage, "planets", 0) for stage in machine.stages)
        width = 3 * (sum(len(own.at) + 2 for own in found) + planets)
        self.names: list[str] = []
        self.turning: list[bool] = []
        self.mass = np.zeros((width, width))
        self.springs: list[Spring] = []
        self.planets: dict[int, Planets] = {}
        self.forces = [known_force(machine, own[0], point) for own in self.pairs]
        lines = [replace(own, rows=np.zeros((len(own.at), 3, width))) for own in found]
        for line in lines:
            self.moving(line)
        places = [line.rows[-1 if line is lines[-1] else 0, 2] for line in lines]
        self.torques = tuple(int(row.argmax()) for row in places)
        sense = 1
        for i, stage in enumerate(machine.stages):
            if isinstance(stage, ParallelStage):
                self.parallel(i, stage, lines, sense)
                sense = -sense
            else:
                self.planetary(i, stage, lines, sense)
                sense *= 1 if planetary_speeds(stage)[stage.driven] > 0 else -1

    def free(self, name: str, turning: bool = False) -> FloatArray:
        """Return the row of a new coordinate."""
        row = np.zeros(len(self.mass))
        row[len(self.names)] = 1.0
        self.names.append(name)
        self.turning.append(turning)
        return row

    def across(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return the rows of new coordinates along x and y."""
        return self.free(f"{name}: x"), self.free(f"{name}: y")

    def inertia(self, rows: FloatArray, values: npt.ArrayLike) -> None:
        """Add masses, one to each row, or a matrix of them."""
        given = np.asarray(values, dtype=np.float64)
        self.mass += rows.T @ (given if given.ndim == 2 else np.diag(given)) @ rows

    def spring(self, part: str, rows: FloatArray, stiffness: npt.ArrayLike, *more: float) -> None:
        """Add springs of equal stiffness for all rows, or a matrix; `more` as of `Spring`."""
        given = np.asarray(stiffness, dtype=np.float64)
        matrix = given if given.ndim == 2 else given * np.eye(len(rows))
        self.springs.append(Spring(part, rows, matrix, *more))

    # shafts

    def shaft(self, number: int) -> _Shaft:
        """Return a shaft, with usual places [m] for what tells none; nothing moves yet."""
        sections = [own for own in self.machine.sections if own.shaft == number]
        if not sections and len(self.gears(number)) == 2:
            sections = [self.usual_section(number)]
        ends = 1e-3 * np.cumsum([0.0, *(own.length_mm for own in sections)])
        length = float(ends[-1])
        bearings = [own for own in self.machine.bearings if own.shaft == number]
        usual = np.linspace(0.0, length, len(bearings)).tolist()
        end = {1: 0.0, self.machine.shaft_count: length}.get(number, 0.5 * length)
        held = [(_told_m(own, place), own) for own, place in zip(bearings, usual, strict=True)]
        discs = [(_told_m(own, end), own) for own in self.machine.discs if own.shaft == number]
        gears = [self.position(*gear, length) for gear in self.gears(number)]
        standing = [place for place, _ in (*held, *discs)]
        at = np.unique(np.round([*ends, *standing, *gears], 9))
        if any(own.diameter_mm for own in sections):
            pieces = np.ceil(PIECES * np.diff(at) / length - 1e-6).astype(int)
            gaps = zip(at[:-1], at[1:], pieces, strict=True)
            between = [np.linspace(a, b, n, endpoint=False) for a, b, n in gaps]
            at = np.concatenate([*between, at[-1:]])
        return _Shaft(number, sections, ends, held, discs, at, np.zeros((len(at), 3, 0)))

    def moving(self, line: _Shaft) -> None:
        """Let a shaft move, with its bearings and discs."""
        for place, row in zip(line.at, line.rows, strict=True):
            row[2] = self.free(f"shaft {line.number} at {1e3 * place:g} mm: rotation", True)
        self.held(line)
        if line.sections:
            self.twisted(line)
        else:
            self.notes.append(f"shaft {line.number} is rigid: it has no [[shaft]] section")
        for place, disc in line.discs:
            mass = disc.mass_kg or 0.0
            self.inertia(line.place(place), (mass, mass, disc.inertia_kgm2))

    def usual_section(self, number: int) -> ShaftSection:
        """Return a section that lets two gears on a shaft twist against each other."""
        gears = [(self.pairs[i][0], member) for i, member in self.gears(number)]
        bores = [getattr(pair.stage, f"bore_diameter_{member}_mm", None) for pair, member in gears]
        diameter, source = min(filter(None, bores), default=0.0), "the bore of its gear"
        if not diameter:
            diameter = 1e3 * SHAFT_OVER_GEAR * min(_diameter_m(*own) for own in gears)
            source = f"{SHAFT_OVER_GEAR:g} of the smaller gear on it"
        usual, pairs = 1e3 * WIDTH_OVER_MODULE, [pair for pair, _ in gears]
        widths = [p.stage.face_width_mm or usual * p.geometry.transverse_module_m for p in pairs]
        length = SHAFT_OVER_WIDTHS * sum(widths)
        bar = ShaftSection(shaft=number, length_mm=length, diameter_mm=diameter)
        torsion = _section(bar)[0] / (1e-3 * length)
        self.notes.append(
            f"shaft {number}: torsional stiffness {3 * torsion:.3g} Nm/rad between its gears, of a "
            f"steel bar {diameter:.3g} mm in diameter ({source}) and {length / 3:.3g} mm long"
        )
        return replace(bar, diameter_mm=None, torsional_stiffness_nm_per_rad=torsion)

    def gears(self, number: int) -> list[tuple[int, str]]:
        """Stages (from 0) and members that sit on a shaft, along the power flow."""
        around = ((number - 2, 1), (number - 1, 0))
        stages = self.machine.stages
        return [(i, stages[i].on_shafts[end]) for i, end in around if 0 <= i < len(stages)]

    def position(self, stage: int, member: str, length: float) -> float:
        """Place of a gear on its shaft [m]."""
        told = getattr(self.machine.stages[stage], f"position_{member}_mm")
        if told is not None:
            return 1e-3 * float(told)
        both = self.gears(stage + 1 + self.machine.stages[stage].on_shafts.index(member))
        return length * (both.index((stage, member)) + 1) / (len(both) + 1)

    def held(self, line: _Shaft) -> None:
        """Let a shaft move across its axis, as far as its bearings let it."""
        number, bearings, bends = line.number, line.bearings, line.bends
        meshing = [self.forces[i] for i, _ in self.gears(number) if len(self.pairs[i]) == 1]
        # without sections the path to the sensors has their softness; and by Hertz, with no damper
        # told, a sound simulated pair at half load swung at 1.5 times its mesh
        if not any(own.shaft == number for own in self.machine.sections):
            meshing = []
        load = sum(abs(force) for force in meshing if force) / max(1, len(bearings))
        springs = [(at, own, self.bearing_stiffness(own, load)) for at, own in bearings]
        stiff = [at for at, _, stiffness in springs if stiffness is None]
        if bends and not bearings:
            self.notes.append(f"shaft {number} is held rigidly at its ends: it has no [[bearing]]")
            stiff = [float(line.at[0]), float(line.at[-1])]
        if bends and len({at for at, _ in bearings}) == 1:
            self.notes.append(
                f"shaft {number} swings freely about its only bearing: give it a second [[bearing]]"
            )
        if bends:
            for place, row in zip(line.at, line.rows, strict=True):
                if np.abs(place - np.array(stiff or [np.inf])).min() > 1e-9:
                    row[:2] = self.across(f"shaft {number} at {1e3 * place:g} mm")
        elif bearings and not stiff:
            line.rows[:, :2] = self.across(f"shaft {number}")
        else:
            self.notes.append(f"shaft {number} does not move across its axis: no bearing yields")
        for at, own, stiffness in springs:
            if stiffness is not None:
                part = f"bearing {self.machine.bearings.index(own) + 1} {own.name}"
                self.spring(part, line.place(at)[:2], stiffness, own.damping_ns_per_m or 0.0)

    def bearing_stiffness(self, bearing: Bearing, load_n: float) -> float | None:
        """Stiffness of a bearing [N/m], None of a rigid one."""
        if bearing.stiffness_n_per_m is not None:
            return bearing.stiffness_n_per_m
        if not load_n or not bearing.balls or not bearing.ball_diameter_mm:
            self.notes.append(f"bearing {bearing.name} is rigid: it has no stiffness_n_per_m")
            return None
        cosine = math.cos(math.radians(bearing.contact_angle_deg))
        if bearing.roller_length_mm:
            lines = bearing.balls**0.9 * (1e-3 * bearing.roller_length_mm) ** 0.8
            kind, found = "roller", float(ROLLER_BEARING * lines * load_n**0.1 * cosine**1.9)
        else:
            root = bearing.balls**2 * 1e-3 * bearing.ball_diameter_mm * load_n * cosine**5
            kind, found = "ball", BALL_BEARING * float(np.cbrt(root))
        source = f"a {kind} bearing's by Hertz at {load_n:.4g} N"
        self.notes.append(f"bearing {bearing.name}: {found:.3g} N/m, {source}")
        return found

    def twisted(self, line: _Shaft) -> None:
        """Add the stiffness and mass of a shaft's sections."""
        number, bends = line.number, line.bends
        beam, mass = np.zeros((2, 2 * len(line.at), 2 * len(line.at)))
        waves = math.inf
        for i, length in enumerate(np.diff(line.at)):
            own = line.sections[int(np.searchsorted(line.ends, line.at[i] + 1e-9)) - 1]
            twist, bend, shear, heavy, polar = _section(own)
            turns, across = line.rows[[i, i + 1], 2], slice(2 * i, 2 * i + 4)
            wave = TWIST_RESOLVED / length * math.sqrt(twist / polar) if polar else math.inf
            torsion, part = twist / length * _PAIR, f"shaft {number} torsion"
            self.spring(part, turns, torsion, 0.0, 0.0, wave / (2 * math.pi))
            self.inertia(turns, polar * length * _SPREAD)
            if bends:
                # a Timoshenko beam between deflection and tilt at both ends
                phi, lever = shear / length**2, np.array([1.0, length, 1.0, length])
                arms = np.outer(lever, lever)
                stiff = bend / (length**3 * (1 + phi)) * arms
                beam[across, across] += stiff * (_BENT + phi * _SHEARED)
                mass[across, across] += heavy * length / 420 * arms * _CARRIED
                wave = (BEND_RESOLVED / length) ** 2 * math.sqrt(bend / heavy) if heavy else waves
                waves = min(waves, wave)
            else:
                self.inertia(line.rows[0, :2], [heavy * length] * 2)
        if bends:
            # tilts have no load of their own: they follow the deflections
            tilts = -np.linalg.solve(beam[1::2, 1::2], beam[1::2, ::2])
            shape = np.zeros((2 * len(line.at), len(line.at)))
            shape[::2], shape[1::2] = np.eye(len(line.at)), tilts
            bending, part = shape.T @ beam @ shape, f"shaft {number} bending"
            for rows in (line.rows[:, 0], line.rows[:, 1]):
                self.spring(part, rows, bending, 0.0, 0.0, waves / (2 * math.pi))
                self.inertia(rows, shape.T @ mass @ shape)

    # gears

    def on(self, lines: Sequence[_Shaft], stage: int, member: str) -> FloatArray:
        """Return how a member of a stage moves that sits on a shaft."""
        line = lines[stage + self.machine.stages[stage].on_shafts.index(member)]
        return line.place(self.position(stage, member, float(line.at[-1])))

    def gear(self, pair: MeshPair, index: int, rows: FloatArray) -> None:
        """Add the inertia of a gear that moves."""
        if rows.any():
            mass, inertia = gear_disc(pair, index)
            self.inertia(rows, (mass, mass, inertia))

    def parallel(self, i: int, stage: ParallelStage, lines: Sequence[_Shaft], sense: int) -> None:
        (pair,) = self.pairs[i]
        first, second = (self.on(lines, i, member) for member in stage.on_shafts)
        self.gear(pair, 0, first)
        self.gear(pair, 1, second)
        towards = math.radians(stage.axis_angle_deg) + sense * _push(pair)
        one, two = pair.base_radii_m
        vector = _pushed(first, towards, sense * one) - _pushed(second, towards, -sense * two)
        self.mesh(i, pair, [vector], [0.0])

    def planetary(self, i: int, stage: PlanetaryStage, lines: Sequence[_Shaft], sense: int) -> None:
        inner, outer = self.pairs[i]
        rows = {member: self.on(lines, i, member) for member in stage.on_shafts}
        rows[stage.fixed] = self.fixed(i + 1, stage)
        self.gear(inner, 0, rows["sun"])
        self.gear(outer, 1, rows["ring"])
        self.carrier(inner, stage, rows["carrier"])
        speeds = planetary_speeds(stage)
        turn = sense if speeds["sun"] > speeds["carrier"] else -sense
        # torques on sun and ring have one sense, that on the carrier the other
        sense *= -1 if stage.driving == "carrier" else 1
        teeth = stage.sun_teeth + stage.ring_teeth
        seats = np.round(np.arange(stage.planets) * teeth / stage.planets) / teeth
        planets = self.planet_rows(i, stage, rows["carrier"], 2 * math.pi * seats, turn)
        suns, rings = [], []
        for psi, planet in zip(2 * math.pi * seats, planets, strict=True):
            push, pull = sense * _push(inner), sense * (math.pi - _push(outer))
            sun, own = (sense * radius for radius in inner.base_radii_m)
            ring = sense * outer.base_radii_m[1]
            suns.append(_pushed(rows["sun"], psi + push, sun) - _pushed(planet, push, -own))
            rings.append(_pushed(rows["ring"], psi + pull, ring) - _pushed(planet, pull, own))
        self.mesh(i, inner, suns, -turn * stage.sun_teeth * seats)
        self.mesh(i, outer, rings, turn * stage.ring_teeth * seats - 0.5 * stage.planet_teeth)

    def fixed(self, number: int, stage: PlanetaryStage) -> FloatArray:
        """Return how the fixed member of a planetary set moves, and add what holds it."""
        rows, name = np.zeros((3, len(self.mass))), f"{stage.fixed} {number}"
        if stage.fixed_support_n_per_m is not None:
            rows[:2] = self.across(name)
            self.spring(f"support of {name}", rows[:2], stage.fixed_support_n_per_m)
        if stage.fixed_torsion_nm_per_rad is not None:
            rows[2] = self.free(f"{name}: rotation", True)
            self.spring(f"support of {name}", rows[2:], stage.fixed_torsion_nm_per_rad)
        if not rows.any():
            self.notes.append(f"stage {number}: the {stage.fixed} is held rigidly")
        return rows

    def carrier(self, pair: MeshPair, stage: PlanetaryStage, rows: FloatArray) -> None:
        """Add the inertia of a carrier: as given, else of a disc that reaches the planet axes."""
        mass, inertia = stage.mass_carrier_kg, stage.inertia_carrier_kgm2
        if (mass is None or inertia is None) and rows.any():
            instead = "mass_carrier_kg and inertia_carrier_kgm2"
            width, density = disc_body(pair, "mass of the carrier", instead)
            radius = pair.geometry.centre_distance_m
            mass = mass or density * math.pi * radius**2 * width
            inertia = inertia or 0.5 * mass * radius**2
            told = f"stage {pair.number}: the carrier is a disc of {mass:.3g} kg to the planet axes"
            self.notes.append(told)
        self.inertia(rows, (mass or 0.0, mass or 0.0, inertia or 0.0))

    def planet_rows(
        self, i: int, stage: PlanetaryStage, carrier: FloatArray, angles: FloatArray, turn: int
    ) -> FloatArray:
        """Return how the planets of a set move, and add their inertia and pins."""
        inner = self.pairs[i][0]
        radius = inner.geometry.centre_distance_m
        on_pins = [own for own in self.machine.bearings if own.planet_stage == i + 1]
        force = self.forces[i]
        load = 2 * force * math.sin(_push(inner)) / max(1, len(on_pins)) if force else 0.0
        springs = [(own, self.bearing_stiffness(own, load)) for own in on_pins]
        yields = bool(springs) and all(stiffness is not None for _, stiffness in springs)
        rows = np.zeros((stage.planets, 3, len(self.mass)))
        for number, (psi, row) in enumerate(zip(angles, rows, strict=True), start=1):
            name = f"planet {number} of stage {i + 1}"
            row[2] = self.free(f"{name}: rotation")
            # radial and tangential
            pin = _pushed(carrier, psi, 0.0), _pushed(carrier, psi + 0.5 * math.pi, radius)
            row[:2] = pin
            if yields:
                row[:2] = self.free(f"{name}: radial"), self.free(f"{name}: tangential")
            self.gear(inner, 1, row)
            for own, stiffness in springs if yields else ():
                slack, damper = row[:2] - pin, own.damping_ns_per_m or 0.0
                self.spring(f"pins of stage {i + 1}", slack, stiffness or 0.0, damper)
        if not yields:
            self.notes.append(f"stage {i + 1}: planet pins are rigid: no bearing of them yields")
        mass, inertia = gear_disc(inner, 1)
        self.planets[i + 1] = Planets(rows, np.array([mass, mass, inertia]), turn * angles)
        return rows

    def mesh(self, i: int, pair: MeshPair, rows: list[FloatArray], phases: Iterable[float]) -> None:
        """Add meshes of a kind with their mean stiffness and damping."""
        force, notes = self.forces[i], list[str]()
        mean = mesh_stiffness(pair, (), self.form, force_n=force).healthy_mean_n_per_m
        damping = mesh_damping(pair, math.sqrt(mean * equivalent_mass(pair, notes)), notes)[1]
        self.notes += [f"stage {pair.number}: {note}" for note in notes if "ring is" not in note]
        part = f"mesh {pair.number} {pair.name}"
        for row, phase in zip(rows, phases, strict=True):
            self.spring(part, row[None], mean, damping, float(phase))


def _told_m(standing: Bearing | Disc, usual_m: float) -> float:
    """Return the place of what stands on a shaft [m]."""
    return usual_m if standing.position_mm is None else 1e-3 * standing.position_mm


def _diameter_m(pair: MeshPair, member: str) -> float:
    """Return the reference diameter of a gear, of a carrier the circle of its planets [m]."""
    names = ("sun", "planet") if member == "carrier" else (member,)
    teeth = sum(getattr(pair.stage, f"{name}_teeth") for name in names)
    return float(teeth * pair.geometry.transverse_module_m)


def _push(pair: MeshPair) -> float:
    """Angle from the line of centres to the line of action [rad]."""
    return 0.5 * math.pi - pair.geometry.working_pressure_angle_rad


def _pushed(rows: FloatArray, direction_rad: float, arm_m: float) -> FloatArray:
    """Return how far a body moves in a direction, at an arm of its rotation."""
    return np.array([math.cos(direction_rad), math.sin(direction_rad), arm_m]) @ rows


def _section(own: ShaftSection) -> tuple[float, float, float, float, float]:
    """Return G I_p, E I, 12 E I/(kappa G A), rho A and rho I_p of a section, in SI."""
    outer, inner = 1e-3 * (own.diameter_mm or 0.0), 1e-3 * own.bore_mm * bool(own.diameter_mm)
    area, second = (math.pi / 4**k * (outer ** (2 * k) - inner ** (2 * k)) for k in (1, 2))
    second /= 4  # pi/64 (D^4 - d^4)
    shear_modulus = own.elastic_modulus_pa / (2 * (1 + own.poisson_ratio))
    twist, bend = 2 * second * shear_modulus, own.elastic_modulus_pa * second
    kappa = 6 * (1 + own.poisson_ratio) / (7 + 6 * own.poisson_ratio)
    shear = 12 * bend / (kappa * shear_modulus * area) if area else 0.0
    if own.torsional_stiffness_nm_per_rad is not None:
        twist = own.torsional_stiffness_nm_per_rad * 1e-3 * own.length_mm
    if own.bending_stiffness_nm2 is not None:
        bend, shear = own.bending_stiffness_nm2, 0.0
    return twist, bend, shear, own.density_kgm3 * area, 2 * own.density_kgm3 * second
