"""What a sensor on the housing hears of a healthy planetary set.

The set vibrates as a part of its machine (`gears.drive_train`): the stiffness of each of its meshes
varies, each in its phase, those of other stages stay at their means. Of the forces of planet p, in
both of its meshes, the share d is heard only as it passes the sensor,

    g_p(t) = 1 - d/2 + (d/2) cos(2 pi f_c t + psi_p),

so that mesh harmonic k has the lines k f_m + s f_c, s = -1, 0, 1, of amplitude
w_s sum_p F_kp exp(i s psi_p), w_0 = 1 - d/2, w_+-1 = d/4. The N equal planets of an equally spaced
set leave those with k z_r + s divisible by N (McFadden and Smith, Proc. IMechE 199 C1 (1985) 65).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearmon.dynamics import HillSystem, SystemResponse, steady_state
from gearmon.errors import ArgumentError, check_range
from gearmon.gears.drive_train import DriveTrain, drive_train
from gearmon.gears.kinematics import PLANET_PASS_DEPTH, kinematics
from gearmon.gears.mechanics import stage_mechanics
from gearmon.machine import Machine, PlanetaryStage
from gearmon.result import Result
from gearmon.signatures.expected.mesh import FloatArray, operating_point
from gearmon.signatures.expected.modes import carried_by_mass, natural

#: Stiffness harmonics taken, at least, and for each harmonic that is shown.
STIFFNESS_HARMONICS, FOR_EACH = 32, 2


@dataclass(frozen=True, kw_only=True, eq=False)
class HousingLines(Result):
    """Lines of the force of a planetary set on the housing.

    Parameters
    ----------
    stage : int
    rows : tuple of dict
        Columns `mesh_harmonic`, `sideband` (s, of the carrier), `order`, `frequency_hz`, `force_n`
        (peak), `phase_rad` and `allowed`: whether equal planets at equal angles leave the line.
    error_bound : float or None
        Of the vibration, relative; guaranteed for the stiffness harmonics taken. None where none
        could be computed, mostly for want of damping (`damping_ns_per_m` of the bearings).
    contact_lost : bool
        Whether teeth part: the linear model ends there.
    notes : tuple of str
        What was taken where the machine file says nothing.
    """

    stage: int
    rows: tuple[dict[str, Any], ...]
    error_bound: float | None
    contact_lost: bool
    notes: tuple[str, ...]


def housing_lines(
    machine: Machine,
    stage: int,
    operating: int = 0,
    *,
    harmonics: int = 10,
    form: str = "parabolic",
    tolerance: float = 1e-4,
) -> HousingLines:
    """Return what a sensor on the housing hears of a healthy planetary set.

    Parameters
    ----------
    machine : Machine
        With what a baseline and `modes` need.
    stage, operating : int
        A planetary stage, counted from 1, and operating point, from 0.
    harmonics : int, 1 to 200
        Mesh harmonics.
    form : str
        Of the stiffness curves.
    tolerance : float
        Relative L2 error of the acceleration.

    Raises
    ------
    ArgumentError
        If the stage is not planetary, or the machine lacks data.
    """
    check_range("harmonics", harmonics, 1, 200)
    check_range("stage", stage, 1, len(machine.stages))
    own = machine.stages[stage - 1]
    if not isinstance(own, PlanetaryStage):
        raise ArgumentError(f"stage={stage} is not planetary: no planets pass the housing")
    point = operating_point(machine, operating)
    train = drive_train(machine, point, form)
    before = sum(isinstance(other, PlanetaryStage) for other in machine.stages[: stage - 1])
    psi = train.planets[before].angles_rad
    response = _vibration(machine, train, stage, operating, harmonics, form, tolerance)
    # sun meshes of all planets, then their ring meshes
    forces = response.mesh_force[:, : len(psi)] + response.mesh_force[:, len(psi) :]
    mesh = kinematics(machine).mesh(stage)
    carrier, depth = float(mesh.carrier), PLANET_PASS_DEPTH if mesh.carrier else 0.0
    rows = []
    for k in range(1, harmonics + 1):
        for s in (-1, 0, 1) if depth else (0,):
            weight = depth / 4 if s else 1 - depth / 2
            line = weight * complex(forces[k] @ np.exp(1j * s * psi)) if k < len(forces) else 0j
            order = k * mesh.order + s * carrier
            allowed = not own.equally_spaced or (k * own.ring_teeth + s) % own.planets == 0
            row = {
                "mesh_harmonic": k,
                "sideband": s,
                "order": order,
                "frequency_hz": order * point.shaft1_hz,
                "force_n": 2 * abs(line) if allowed else 0.0,
                "phase_rad": float(np.angle(line)),
                "allowed": allowed or not depth,
            }
            rows.append(row)
    return HousingLines(
        stage=stage,
        rows=tuple(rows),
        error_bound=response.error_bound if math.isfinite(response.error_bound) else None,
        contact_lost=bool(response.contact_lost.any()),
        notes=train.notes,
    )


def _vibration(
    machine: Machine,
    train: DriveTrain,
    stage: int,
    operating: int,
    harmonics: int,
    form: str,
    tolerance: float,
) -> SystemResponse:
    """Solve the machine with the varying meshes of one planetary set."""
    point, meshes = machine.operating[operating], train.meshes(stage)
    rest = replace(train, springs=tuple(own for own in train.springs if own not in meshes))
    carried = carried_by_mass(train)
    vectors = np.array([mesh.rows[0] for mesh in meshes])
    means = np.array([mesh.stiffness[0, 0] for mesh in meshes])
    dampers = np.array([mesh.damping_ns_per_m for mesh in meshes])
    sides = [stage_mechanics(machine, stage, point, form=form, mesh=side) for side in (0, 1)]
    count = max(STIFFNESS_HARMONICS, FOR_EACH * harmonics)
    orders = np.arange(1, count + 1)
    shapes = [side.stiffness.mesh_harmonics(count) for side in sides]
    turned = [
        shapes["ring" in mesh.part] * np.exp(2j * math.pi * orders * mesh.phase) for mesh in meshes
    ]
    system = HillSystem(
        carried.T @ train.mass @ carried,
        carried.T @ rest.damping @ carried,
        carried.T @ rest.stiffness @ carried,
        vectors @ carried,
        means,
        np.array(turned),
        1 / sides[0].mesh_frequency_hz,
        carried.T @ _torques(train, vectors[0], sides[0].force_n, means[0]),
        mesh_damping_ns_per_m=dampers,
    )
    return steady_state(system, tolerance, harmonics=harmonics)


def _torques(train: DriveTrain, mesh: FloatArray, force_n: float, stiffness: float) -> FloatArray:
    """Return the torques on the first and the last shaft that load a mesh with its force."""
    squares, shapes = natural(train)
    if squares[0] > 0:
        raise ArgumentError("the machine cannot turn: its shafts are held against rotation")
    rigid, load = shapes[:, 0], np.zeros(len(train.mass))
    ends = [i for i, name in enumerate(train.coordinates) if name.startswith("shaft")]
    first, last = ends[0], [i for i in ends if train.turning[i]][-1]
    load[first], load[last] = 1.0, -rigid[first] / rigid[last]
    moved = np.linalg.lstsq(train.stiffness, load, rcond=None)[0]
    return np.asarray(load * force_n / (stiffness * float(mesh @ moved)))
