"""The drive train as inertias, meshes and shafts: what the integration needs of a machine.

Every stage brings its gears as rotating discs; the driven gear of a stage and the driving gear of
the next are joined by the torsion of their shaft. Motor and load act as torques on the first and
the last disc. The deformations of meshes and shafts describe the motion; the rotation of the train
as a whole is given, not computed. Bearings and the bending of shafts do not yield.

References
----------
A. Kahraman, Free torsional vibration characteristics of compound planetary gear sets, Mech. Mach.
Theory 29 (1994), for the planetary set.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from gearmon.errors import ArgumentError
from gearmon.gears.faults import Fault, GearError
from gearmon.gears.kinematics import kinematics, planetary_speeds
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.gears.pairs import Member, MeshPair, Stage, mesh_pairs
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.simulation.contact import GearErrors, ToothMesh, ideal, random_errors
from gearmon.simulation.integrate import GearedSystem
from gearmon.simulation.settings import stream

FloatArray = NDArray[np.float64]


#: Shear modulus of steel [Pa].
SHEAR_MODULUS_PA = 80e9
#: Damping ratio that the shafts alone would give to the lowest mode of the train, if all of its
#: energy were in them; their loss of energy is proportional to their stiffness.
SHAFT_DAMPING_RATIO = 0.05
#: Shaft over reference diameter of the smaller gear on it, where no bore is given.
SHAFT_OVER_GEAR = 0.6
#: Length of a shaft over the sum of the face widths of the gears on it.
SHAFT_OVER_WIDTHS = 1.5
#: Face width over module where none is given.
WIDTH_OVER_MODULE = 10.0


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


@dataclass(frozen=True, kw_only=True)
class PartData:
    """What a part is made from.

    Parameters
    ----------
    machine : Machine
    number : int
        Stage, counted from 1.
    faults : sequence of Fault
    errors : sequence of GearError
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
    errors: Sequence[GearError]
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
    middle = 0.5 * (np.array(circles.tip_radii_m) + circles.root_radii_m)
    bores = np.array([member.bore_m for member in pair.members])
    one, two = (middle**4 - (0.5 * bores) ** 4).tolist()
    return one, two


def _mechanics(data: PartData, mesh: int, faults: Sequence[Fault]) -> StageMechanics:
    mechanics = stage_mechanics(data.machine, data.number, data.point, faults=faults, mesh=mesh)
    if mechanics.torque_nm is None:  # the stage gives its force, which the load must scale
        return replace(mechanics, force_n=data.load * mechanics.force_n)
    return mechanics


def _mesh(data: PartData, pair: MeshPair, mechanics: StageMechanics, suffix: str) -> ToothMesh:
    first, second = (_errors(data, pair, member, suffix) for member in pair.members)
    return ToothMesh(
        stage=data.number,
        name=pair.name + suffix,
        order=kinematics(data.machine).mesh(data.number).order,
        offset=0.0,
        teeth=pair.teeth,
        errors=(first, second),
        base_pitch_m=pair.unchecked_geometry.base_pitch_m,
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
        own = ideal(member.teeth.teeth)
    else:
        # a planet has two flanks at work, and there are several planets
        flank = f"{pair.name}{suffix}" if member.name == "planet" else ""
        own = random_errors(
            member.teeth.teeth,
            transverse_module_m(pair) * member.teeth.teeth,
            1e-3 * pair.need("module_mm", "pitch errors"),
            data.accuracy_grade,
            stream(data.seed, "errors", data.number, member.name, flank),
        )
    for error in data.errors:
        if (error.stage, error.gear) == (data.number, member.name):
            own = own.with_error(error)
    return own


@dataclass(frozen=True, kw_only=True, eq=False)
class Train:
    """A drive train ready to be integrated.

    Parameters
    ----------
    system : GearedSystem
        Elements: the meshes stage by stage, then the shafts between the stages.
    meshes : tuple of ToothMesh
    mechanics : tuple of StageMechanics
        One for each mesh, at the mean load.
    mean_stiffness, greatest_stiffness : ndarray, shape (meshes,)
        Of every mesh without damage [N/m].
    static_force : ndarray, shape (elements,)
        [N] under the mean load.
    gear_mass_kg : float
        Mass of all gears as solid discs; what a ring weighs goes with the housing.
    carrier_orders : tuple of float
        For each stage the turns of its carrier per turn of shaft 1, positive where tooth contacts
        on the ring run with it; 0 where no planets pass the housing.
    notes : tuple of str
        Assumptions, in words.
    """

    system: GearedSystem
    meshes: tuple[ToothMesh, ...]
    mechanics: tuple[StageMechanics, ...]
    mean_stiffness: FloatArray
    greatest_stiffness: FloatArray
    static_force: FloatArray
    gear_mass_kg: float
    carrier_orders: tuple[float, ...]
    notes: tuple[str, ...]

    @property
    def static_forcing(self) -> FloatArray:
        """Accelerations [m/s2] that the mean torques alone would give."""
        return np.asarray(self.system.coupling @ self.static_force)

    @property
    def static_deformation(self) -> FloatArray:
        """Deformations under the mean load [m]."""
        return self.system.static_deformation(self.static_forcing, self.mean_stiffness)


def build_train(
    machine: Machine,
    faults: Sequence[Fault | GearError] = (),
    *,
    point: OperatingPoint | None = None,
    load: float = 1.0,
    seed: int = 0,
    accuracy_grade: float | None = 6.0,
) -> Train:
    """Build the model of a machine's drive train.

    Parameters
    ----------
    machine : Machine
        Every stage needs its module, and face width or the overrides in its place; the machine
        needs a torque.
    faults : sequence of Fault or GearError
    point : OperatingPoint, optional
        By default the machine's first.
    load : float, > 0
        Mean load over the torque of the operating point.
    seed : int
        Of the errors of manufacture.
    accuracy_grade : float or None
        Flank tolerance class of ISO 1328-1; None for perfect gears.

    Returns
    -------
    Train

    Raises
    ------
    ArgumentError
        If the machine lacks data, or a fault does not fit it.
    """
    running = machine.operating[0] if point is None else point
    if running.torque_nm is not None:
        running = replace(running, torque_nm=load * running.torque_nm)
    errors = [own for own in faults if isinstance(own, GearError)]
    numbered = list(enumerate(machine.stages, start=1))
    pairs = [(number, pair) for number, stage in numbered for pair in mesh_pairs(stage, number)]
    gears = {(number, member.name) for number, pair in pairs for member in pair.members}
    for error in errors:
        if (error.stage, error.gear) not in gears:
            raise ArgumentError(f"error {error}: {machine.name} has no such gear")
    parts = [
        part(
            PartData(
                machine=machine,
                number=number,
                faults=[own for own in faults if isinstance(own, Fault)],
                errors=errors,
                point=running,
                load=load,
                seed=seed,
                accuracy_grade=accuracy_grade,
            )
        )
        for number in range(1, len(machine.stages) + 1)
    ]
    shafts = [
        _shaft(number, machine.stages[number - 2], machine.stages[number - 1], after)
        for number, after in enumerate(parts[1:], start=2)
    ]
    return _assembled(machine, parts, shafts)


@dataclass(frozen=True, kw_only=True)
class _Shaft:
    """Torsion of the shaft between two stages, as a spring on the lever `radius_m`."""

    radius_m: float
    stiffness: float
    force_n: float
    note: str


def _shaft(number: int, driving: Stage, driven: Stage, after: Part) -> _Shaft:
    """Return shaft `number` between the stages `driving` and `driven`."""
    diameter, source = _diameter(driving, driven)
    length = SHAFT_OVER_WIDTHS * (_width(driving) + _width(driven))
    torsion = SHEAR_MODULUS_PA * math.pi * diameter**4 / (32 * length)
    radius = float(np.abs(after.rows[:, 0]).max())
    torque_nm = float(after.rows[:, 0] @ [own.force_n for own in after.mechanics])
    return _Shaft(
        radius_m=radius,
        stiffness=torsion / radius**2,
        force_n=torque_nm / radius,
        note=f"shaft {number}: torsional stiffness {torsion:.3g} Nm/rad, of a steel bar "
        f"{1e3 * diameter:.3g} mm in diameter ({source}) and {1e3 * length:.3g} mm long",
    )


def _diameter(driving: Stage, driven: Stage) -> tuple[float, str]:
    """Return the diameter of the shaft between two stages [m], and where it is from."""
    one = "gear" if isinstance(driving, ParallelStage) else driving.driven
    two = "pinion" if isinstance(driven, ParallelStage) else driven.driving
    bores = [
        1e-3 * bore
        for stage, gear in ((driving, one), (driven, two))
        if (bore := getattr(stage, f"bore_diameter_{gear}_mm", None))
    ]
    if bores:
        return min(bores), "the bore of its gear"
    sizes = [_size(driving, one), _size(driven, two)]
    return SHAFT_OVER_GEAR * min(sizes), f"{SHAFT_OVER_GEAR:g} of the smaller gear on it"


def _size(stage: Stage, gear: str) -> float:
    module = transverse_module_m(mesh_pairs(stage)[0])
    if isinstance(stage, PlanetaryStage) and gear == "carrier":
        # as large as the circle of its planets
        return (stage.sun_teeth + stage.planet_teeth) * module
    return float(getattr(stage, f"{gear}_teeth") * module)


def _width(stage: Stage) -> float:
    if stage.face_width_mm is not None:
        return 1e-3 * stage.face_width_mm
    return WIDTH_OVER_MODULE * transverse_module_m(mesh_pairs(stage)[0])


def _gear_mass_kg(stage: Stage) -> float:
    pair = mesh_pairs(stage)[0]
    number = (1, pair.planets)
    radii = [0.5 * transverse_module_m(pair) * member.teeth.teeth for member in pair.members]
    area = math.pi * sum(n * r * r for n, r in zip(number, radii, strict=True))
    return stage.density_kgm3 * _width(stage) * area


def _assembled(machine: Machine, parts: list[Part], shafts: list[_Shaft]) -> Train:
    rows, inverse = _matrices(parts, shafts)
    mechanics = [m for one in parts for m in one.mechanics]
    means = np.array([m.stiffness.healthy_mean_n_per_m for m in mechanics])
    return Train(
        system=_damped(
            GearedSystem(
                coupling=rows @ inverse @ rows.T,
                damping=np.array([m.damping_ns_per_m for m in mechanics] + [0.0] * len(shafts)),
                shaft_stiffness=np.array([shaft.stiffness for shaft in shafts]),
                backlash_m=np.array([mesh.backlash_m for one in parts for mesh in one.meshes]),
                back_stiffness=means,
            ),
            means,
        ),
        meshes=tuple(mesh for one in parts for mesh in one.meshes),
        mechanics=tuple(mechanics),
        mean_stiffness=means,
        greatest_stiffness=means * (1 + np.array([m.stiffness.variation for m in mechanics])),
        static_force=np.array([m.force_n for m in mechanics] + [shaft.force_n for shaft in shafts]),
        gear_mass_kg=sum(_gear_mass_kg(stage) for stage in machine.stages),
        carrier_orders=tuple(float(mesh.carrier) for mesh in kinematics(machine).meshes),
        notes=tuple(
            dict.fromkeys(
                [note for one in parts for note in one.notes] + [shaft.note for shaft in shafts]
            )
        ),
    )


def _damped(system: GearedSystem, mesh_stiffness: FloatArray) -> GearedSystem:
    """Return the system with damping in its shafts."""
    lowest = 2 * math.pi * system.natural_frequencies_hz(mesh_stiffness)[0]
    shafts = 2 * SHAFT_DAMPING_RATIO / lowest * system.shaft_stiffness
    return replace(system, damping=np.concatenate([system.damping[: system.meshes], shafts]))


def _matrices(parts: list[Part], shafts: list[_Shaft]) -> tuple[FloatArray, FloatArray]:
    """Return the deformations per unit of all coordinates, and the inverse inertia of these."""
    inverse = block_diag(*(one.inverse_inertia for one in parts))
    rows = [block_diag(*(one.rows for one in parts))]
    ends = np.cumsum([one.rows.shape[1] for one in parts])
    for shaft, joint in zip(shafts, ends, strict=False):
        # wound up where the driven gear before the joint runs ahead of the driving one after it
        wide = np.zeros((1, ends[-1]))
        wide[0, joint - 1 : joint + 1] = shaft.radius_m, -shaft.radius_m
        rows.append(wide)
    return np.concatenate(rows), inverse
