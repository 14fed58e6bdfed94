"""The stages of a drive train as discs and meshes.

A parallel stage is two discs; a planetary one has its sun, ring and carrier, less the one that
stands still, and its planets. The inertias are those of discs, scaled so that the equivalent mass
of the mesh is the one that the rest of the package works with.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.gears.faults import Fault
from gearmon.gears.kinematics import kinematics, planetary_speeds
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.gears.pairs import Member, MeshPair, mesh_pairs
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.simulation.contact import ToothMesh
from gearmon.simulation.manufacture import GearErrors, ideal, random_errors
from gearmon.simulation.streams import stream

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """One stage: how its meshes see its coordinates, and how easily those are accelerated.

    The first coordinate is the rotation of the input shaft, the last that of the output shaft,
    both positive in the direction of power flow.

    Parameters
    ----------
    rows : ndarray, shape (meshes, coordinates)
        Deformation of each mesh per unit of each coordinate [m].
    inverse_inertia : ndarray, shape (coordinates, coordinates)
        Inverse of the inertia matrix [1/(kg m2)].
    meshes : tuple of ToothMesh
    mechanics : tuple of StageMechanics
        One for each mesh.
    notes : tuple of str
        Assumptions, in words.
    """

    rows: FloatArray
    inverse_inertia: FloatArray
    meshes: tuple[ToothMesh, ...]
    mechanics: tuple[StageMechanics, ...]
    notes: tuple[str, ...]

    @property
    def torque_in_nm(self) -> float:
        """Torque on the input shaft under the static mesh forces [Nm]."""
        return float(self.rows[:, 0] @ [m.force_n for m in self.mechanics])

    @property
    def lever_m(self) -> float:
        """Lever of a mesh force on the input shaft [m]."""
        return float(np.abs(self.rows[:, 0]).max())


@dataclass(frozen=True, kw_only=True)
class PartData:
    """What a part is made from.

    Parameters
    ----------
    machine : Machine
    number : int
        Stage, counted from 1.
    faults : sequence of Fault
    point : OperatingPoint
        Speed and mean torque.
    load : float
        Mean load over the machine's nominal one, for stages that give their force and no torque.
    seed : int
        Of the errors of manufacture.
    accuracy_grade : float or None
        None for perfect gears.
    """

    machine: Machine
    number: int
    faults: Sequence[Fault]
    point: OperatingPoint
    load: float
    seed: int
    accuracy_grade: float | None


def part(data: PartData) -> Part:
    """Return one stage of a machine as discs and meshes.

    Raises
    ------
    ArgumentError
        If the stage lacks data or a fault does not fit it.
    """
    stage = data.machine.stages[data.number - 1]
    if isinstance(stage, ParallelStage):
        return _parallel(data, stage)
    return _planetary(data, stage)


def transverse_module_m(pair: MeshPair) -> float:
    """Return the transverse module of a pair [m]."""
    module = pair.need("module_mm", "simulation of its flanks")
    return 1e-3 * module / math.cos(pair.helix_angle_rad)


def _parallel(data: PartData, stage: ParallelStage) -> Part:
    (pair,) = mesh_pairs(stage, data.number)
    mechanics = _mechanics(data, 0, data.faults)
    radii = pair.base_radii_m
    discs = _discs(pair)
    scale = mechanics.equivalent_mass_kg * sum(r**2 / d for r, d in zip(radii, discs, strict=True))
    return Part(
        rows=np.array([[radii[0], -radii[1]]]),
        inverse_inertia=np.diag([1 / (scale * disc) for disc in discs]),
        meshes=(_mesh(data, pair, mechanics, ""),),
        mechanics=(mechanics,),
        notes=mechanics.assumptions,
    )


def _planetary(data: PartData, stage: PlanetaryStage) -> Part:
    inner, outer = mesh_pairs(stage, data.number)
    # damage of a planet is on the first one; wear of all of its teeth on every planet
    others = [f for f in data.faults if f.gear != "planet" or f.tooth is None]
    sides: list[tuple[ToothMesh, StageMechanics]] = []
    for side, pair in enumerate((inner, outer)):
        for planet in range(stage.planets):
            mechanics = _mechanics(data, side, others if planet else data.faults)
            mesh = _mesh(data, pair, mechanics, f" {planet + 1}")
            sides.append((_placed(mesh, stage, side, planet), mechanics))
    rows, inertia = _planetary_matrices(stage, inner, sides[0][1].equivalent_mass_kg)
    return Part(
        rows=rows,
        inverse_inertia=np.asarray(np.linalg.inv(inertia), dtype=np.float64),
        meshes=tuple(mesh for mesh, _ in sides),
        mechanics=tuple(mechanics for _, mechanics in sides),
        notes=(
            *sides[0][1].assumptions,
            "carrier and planets together have twice the inertia of the planets as point masses; a "
            "floating sun shares the load among them but for the pitch deviations",
        ),
    )


def _placed(mesh: ToothMesh, stage: PlanetaryStage, side: int, planet: int) -> ToothMesh:
    """Return the mesh with the sun (side 0) or ring (1) at the place of a planet."""
    total = stage.sun_teeth + stage.ring_teeth
    # the angles at which planets can be put in, nearest to equal spacing
    place = round(planet * total / stage.planets) / total
    if side == 0:
        return replace(mesh, place_turns=place, offset=-stage.sun_teeth * place, floating=True)
    # a tooth of the planet reaches the ring half a turn after the sun
    offset = stage.ring_teeth * place - 0.5 * stage.planet_teeth
    return replace(mesh, place_turns=place, offset=offset, floating=True)


def _planetary_matrices(
    stage: PlanetaryStage, inner: MeshPair, mass_kg: float
) -> tuple[FloatArray, FloatArray]:
    """Return the rows and the inertia matrix of a planetary set.

    Coordinates at first: rotations of sun, carrier and ring in the housing, all in one sense, and
    of each planet on its carrier, in the sense opposite to the sun's.
    """
    count = stage.planets
    sun, planet = inner.base_radii_m
    ring = sun * stage.ring_teeth / stage.sun_teeth
    rows = np.zeros((2 * count, 3 + count))
    rows[:count, :2] = sun, -sun
    rows[count:, 1:3] = -ring, ring
    rows[:count, 3:] = -planet * np.eye(count)
    rows[count:, 3:] = planet * np.eye(count)
    inertia = _planetary_inertia(stage, inner, mass_kg)
    names = ("sun", "carrier", "ring")
    inside = [names.index(stage.driving), *range(3, 3 + count), names.index(stage.driven)]
    sign = np.ones(len(inside))
    if planetary_speeds(stage)[stage.driven] < 0:
        sign[-1] = -1.0
    # a driving carrier loads the opposite flanks
    flank = -1.0 if stage.driving == "carrier" else 1.0
    return flank * rows[:, inside] * sign, inertia[np.ix_(inside, inside)] * np.outer(sign, sign)


def _planetary_inertia(stage: PlanetaryStage, inner: MeshPair, mass_kg: float) -> FloatArray:
    module = transverse_module_m(inner)
    sun, planet = _discs(inner)
    radii = inner.base_radii_m
    scale = mass_kg * (stage.planets * radii[0] ** 2 / sun + radii[1] ** 2 / planet)
    sun, planet = scale * sun, scale * planet
    bottom = 0.5 * module * stage.ring_teeth
    ring = scale * ((bottom + 4 * module) ** 4 - bottom**4)
    distance = 0.5 * module * (stage.sun_teeth + stage.planet_teeth)
    point_mass = 2 * planet / (0.5 * module * stage.planet_teeth) ** 2
    count = stage.planets
    inertia = np.zeros((3 + count, 3 + count))
    carrier = 2 * count * point_mass * distance**2 + count * planet
    inertia[:3, :3] = np.diag([sun, carrier, ring])
    # seen from the housing a planet turns at the carrier's rate less its own
    inertia[3:, 3:] = planet * np.eye(count)
    inertia[1, 3:] = inertia[3:, 1] = -planet
    return inertia


def _discs(pair: MeshPair) -> tuple[float, float]:
    """Return R^4 - r_bore^4 of both gears, R half way up the teeth: inertias but for a factor."""
    circles = pair.unchecked_geometry
    middle = [
        0.5 * (tip + root)
        for tip, root in zip(circles.tip_radii_m, circles.root_radii_m, strict=True)
    ]
    one, two = (
        radius**4 - (0.5 * member.bore_m) ** 4
        for radius, member in zip(middle, pair.members, strict=True)
    )
    return one, two


def _mechanics(data: PartData, mesh: int, faults: Sequence[Fault]) -> StageMechanics:
    mechanics = stage_mechanics(data.machine, data.number, data.point, faults=faults, mesh=mesh)
    if mechanics.torque_nm is None:  # the stage gives its force, which the load must scale
        return replace(mechanics, force_n=data.load * mechanics.force_n)
    return mechanics


def _mesh(data: PartData, pair: MeshPair, mechanics: StageMechanics, suffix: str) -> ToothMesh:
    module = transverse_module_m(pair)
    first, second = pair.members
    alpha = math.acos(2 * pair.base_radii_m[0] / (module * first.teeth.teeth))
    name = pair.name + suffix
    return ToothMesh(
        stage=data.number,
        name=name,
        order=kinematics(data.machine).mesh(data.number).order,
        offset=0.0,
        teeth=(first.teeth.teeth, second.teeth.teeth),
        errors=(
            _errors(data, pair, first, suffix),
            _errors(data, pair, second, suffix),
        ),
        base_pitch_m=math.pi * module * math.cos(alpha),
        stiffness=mechanics.stiffness,
        backlash_m=_backlash_m(pair),
    )


def _backlash_m(pair: MeshPair) -> float:
    """Return the least normal backlash that ISO/TR 10064-2 recommends for industrial drives [m].

    ``j_bn = 2/3 (0.06 + 0.0005 a + 0.03 m_n)``, all in mm.
    """
    distance_mm = 1e3 * pair.unchecked_geometry.centre_distance_m
    module_mm = pair.need("module_mm", "backlash")
    return 2e-3 / 3 * (0.06 + 0.0005 * distance_mm + 0.03 * module_mm)


def _errors(data: PartData, pair: MeshPair, member: Member, suffix: str) -> GearErrors:
    if data.accuracy_grade is None:
        return ideal(member.teeth.teeth)
    # a planet has two flanks at work, and there are several planets
    flank = f"{pair.name}{suffix}" if member.name == "planet" else ""
    return random_errors(
        member.teeth.teeth,
        transverse_module_m(pair) * member.teeth.teeth,
        1e-3 * pair.need("module_mm", "pitch errors"),
        data.accuracy_grade,
        stream(data.seed, "errors", data.number, member.name, flank),
    )
