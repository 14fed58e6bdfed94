"""The drive train as it is integrated: the elastic system of the machine, in modes, and its meshes.

The system is that of `gears.drive_train`, which also tells natural frequencies and expected lines.
Modes that hold next to nothing of any mesh and are faster than a recording carries are left out.
Motor and load act as torques on the first and the last shaft; the rotation of the train as a whole
is given, not computed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.gears.assembly import WIDTH_OVER_MODULE, drive_train
from gearmon.gears.drive_train import DriveTrain, Spring
from gearmon.gears.faults import Fault, GearError
from gearmon.gears.geometry import GearTeeth
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.gears.pairs import MeshPair, mesh_pairs
from gearmon.machine import Machine, OperatingPoint, PlanetaryStage
from gearmon.simulation.contact import GearErrors, ToothMesh, ideal, random_errors
from gearmon.simulation.integrate import GearedSystem
from gearmon.simulation.settings import stream

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class _Made:
    """What the meshes of a train are made from: see `build_train`."""

    machine: Machine
    faults: Sequence[Fault | GearError]
    point: OperatingPoint
    load: float
    seed: int
    accuracy_grade: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Train:
    """A drive train ready to be integrated.

    Parameters
    ----------
    system : GearedSystem
        Its inputs: the load over its mean, then the acceleration of the runout [m/s2] of each mesh
        that does not float.
    meshes : tuple of ToothMesh
    mechanics : tuple of StageMechanics
        One for each mesh, at the mean load.
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
    gear_mass_kg: float
    carrier_orders: tuple[float, ...]
    notes: tuple[str, ...]

    @property
    def static_force(self) -> FloatArray:
        """Force of every mesh [N] under the mean load."""
        return np.array([own.force_n for own in self.mechanics])

    @property
    def greatest_stiffness(self) -> FloatArray:
        """Of every mesh without damage [N/m]."""
        variation = np.array([own.stiffness.variation for own in self.mechanics])
        return np.asarray(self.system.mesh_stiffness * (1 + variation))


def build_train(
    machine: Machine,
    faults: Sequence[Fault | GearError] = (),
    *,
    point: OperatingPoint | None = None,
    load: float = 1.0,
    seed: int = 0,
    accuracy_grade: float | None = 6.0,
    carried_hz: float = math.inf,
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
    carried_hz : float
        Natural frequency up to which all modes are kept, see `DriveTrain.around`.

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
    pairs = [mesh_pairs(stage, i, machine.path) for i, stage in enumerate(machine.stages, start=1)]
    gears = {(pair.number, m.name) for own in pairs for pair in own for m in pair.members}
    for error in faults:
        if isinstance(error, GearError) and (error.stage, error.gear) not in gears:
            raise ArgumentError(f"error {error}: {machine.name} has no such gear")
    made = _Made(machine, faults, running, load, seed, accuracy_grade)
    # a bearing that tells only its balls stays rigid: the path to the sensors has its softness, and
    # by Hertz, with no damper told, a sound pair at half load swung at 1.5 times its mesh
    modelled = {section.shaft for section in machine.sections}
    yielding = [
        own
        for own in machine.bearings
        if own.stiffness_n_per_m is not None or own.shaft in modelled
    ]
    train = drive_train(replace(machine, bearings=tuple(yielding)), running)
    springs = [train.meshes(number) for number in range(1, len(pairs) + 1)]
    sides = [
        side for own in zip(pairs, springs, strict=True) for side in _meshes(made, train, *own)
    ]
    meshes, mechanics = zip(*sides, strict=True)
    floats = "a floating sun shares the load among planets but for the pitch deviations"
    return Train(
        system=_system(
            train, [mesh for own in springs for mesh in own], meshes, mechanics, carried_hz
        ),
        meshes=meshes,
        mechanics=mechanics,
        gear_mass_kg=sum(_gear_mass_kg(own[0]) for own in pairs),
        carrier_orders=tuple(float(mesh.carrier) for mesh in kinematics(machine).meshes),
        notes=(*train.notes, *([floats] if train.planets else [])),
    )


def _meshes(
    made: _Made, train: DriveTrain, pairs: Sequence[MeshPair], springs: Sequence[Spring]
) -> list[tuple[ToothMesh, StageMechanics]]:
    """Return the meshes of a stage, those with the sun before those with the ring."""
    stage, number = pairs[0].stage, pairs[0].number or 1
    if not isinstance(stage, PlanetaryStage):
        return [_mesh(made, pairs[0], springs[0], "", 0.0)]
    stages = made.machine.stages[: number - 1]
    angles = train.planets[sum(isinstance(s, PlanetaryStage) for s in stages)].angles_rad
    # damage of a planet is on the first one; wear of all of its teeth on every planet
    hurt = [f for f in made.faults if isinstance(f, Fault) and f.gear == "planet" and f.tooth]
    others = replace(made, faults=[f for f in made.faults if f not in hurt])
    return [
        _mesh(others if i else made, pair, springs[side * len(angles) + i], f" {i + 1}", angle)
        for side, pair in enumerate(pairs)
        for i, angle in enumerate(angles.tolist())
    ]


def _mesh(
    made: _Made, pair: MeshPair, spring: Spring, planet: str, angle_rad: float
) -> tuple[ToothMesh, StageMechanics]:
    number = pair.number or 1
    faults = [own for own in made.faults if isinstance(own, Fault)]
    mechanics = stage_mechanics(
        made.machine, number, made.point, faults=faults, mesh=int(pair.second.internal)
    )
    if mechanics.torque_nm is None:  # the stage gives its force, which the load must scale
        mechanics = replace(mechanics, force_n=made.load * mechanics.force_n)
    first, second = (_errors(made, pair, member, planet) for member in pair.members)
    mesh = ToothMesh(
        stage=number,
        name=pair.name + planet,
        order=kinematics(made.machine).mesh(number).order,
        offset=spring.phase,
        teeth=pair.teeth,
        errors=(first, second),
        base_pitch_m=pair.geometry.base_pitch_m,
        stiffness=mechanics.stiffness,
        backlash_m=_backlash_m(pair),
        place_turns=angle_rad / (2 * math.pi),
        floating=bool(planet),
    )
    return mesh, mechanics


def _backlash_m(pair: MeshPair) -> float:
    """Return the least normal backlash that ISO/TR 10064-2 recommends for industrial drives [m].

    ``j_bn = 2/3 (0.06 + 0.0005 a + 0.03 m_n)``, all in mm.
    """
    distance_mm = 1e3 * pair.geometry.centre_distance_m
    module_mm = pair.need("module_mm", "backlash")
    return 2e-3 / 3 * (0.06 + 0.0005 * distance_mm + 0.03 * module_mm)


def _errors(made: _Made, pair: MeshPair, member: GearTeeth, planet: str) -> GearErrors:
    if made.accuracy_grade is None:
        own = ideal(member.teeth)
    else:
        # a planet has two flanks at work, and there are several planets
        flank = f"{pair.name}{planet}" if member.name == "planet" else ""
        own = random_errors(
            member.teeth,
            pair.geometry.transverse_module_m * member.teeth,
            1e-3 * pair.need("module_mm", "pitch errors"),
            made.accuracy_grade,
            stream(made.seed, "errors", pair.number or 1, member.name, flank),
        )
    for error in made.faults:
        if isinstance(error, GearError) and (error.stage, error.gear) == (pair.number, member.name):
            own = own.with_error(error)
    return own


def _gear_mass_kg(pair: MeshPair) -> float:
    module, width = pair.geometry.transverse_module_m, pair.stage.face_width_mm
    radii = [0.5 * module * teeth for teeth in pair.teeth]
    area = math.pi * (radii[0] ** 2 + pair.planets * radii[1] ** 2)
    width_m = WIDTH_OVER_MODULE * module if width is None else 1e-3 * width
    return pair.stage.density_kgm3 * width_m * area


def _system(
    train: DriveTrain,
    springs: Sequence[Spring],
    meshes: Sequence[ToothMesh],
    mechanics: Sequence[StageMechanics],
    carried_hz: float,
) -> GearedSystem:
    around = train.around(springs, carried_hz)
    loads = [train.load({own.stage: own.force_n for own in mechanics})]
    # runout of a mesh that strains nothing: all behind it turns
    rows = np.concatenate([own.rows[0:1] for own in springs])
    still = [own.stiffness @ own.rows for own in train.springs if own not in springs]
    still = [own / np.linalg.norm(own) for own in still]
    free = np.linalg.pinv(np.concatenate([rows, *still]), rcond=1e-9)
    loads += [-train.mass @ free[:, j] for j, mesh in enumerate(meshes) if not mesh.floating]
    return GearedSystem(
        rows=around.vectors,
        stiffness=around.stiffness,
        damping=around.damping,
        mesh_stiffness=around.means,
        mesh_damping=around.dampers,
        inputs=around.shapes.T @ np.transpose(loads),
        backlash_m=np.array([mesh.backlash_m for mesh in meshes]),
    )
