"""Natural vibrations of a whole machine, and the speeds at which mesh harmonics meet them.

The machine is the elastic system of `gears.mechanics`, with mean mesh stiffnesses and without
damping; natural frequencies do not depend on its speed, for gyroscopic moments are left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import check_range
from gearmon.gears.assembly import drive_train
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import DriveTrain
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result

TYPES = ("rotational", "translational", "planet")
#: Share of strain energy in shafts too coarse for a mode from which it is left out.
COARSE = 0.1
#: Share of strain energy from which a mesh takes part in a mode, and is said to drive it.
LEAST_SHARE, DRIVING_SHARE = 1e-6, 1e-3
#: Highest speed of the Campbell table over the fastest operating point.
SPEED_REACH = 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Mode:
    """A natural vibration.

    Parameters
    ----------
    number : int
        Counted from 1, by frequency.
    frequency_hz : float
        0 for a motion that strains nothing.
    damping_ratio : float
        Of meshes and told dampers; shafts, bearings and supports without one as the notes say. 0
        for a rigid-body motion.
    type : {"rigid body", "rotational", "translational", "planet"}
        What holds most of the kinetic energy: shafts and members of planetary sets turning, with
        their planets in step; the same moving across their axes, with the planets' motion once
        round; or planets against each other.
    rotational, translational, planet : float
        Shares of kinetic energy, 0 to 1.
    strain_energy : dict of str to float
        Shares of strain energy in shafts, bearings and meshes, 0 to 1.
    shape : ndarray, shape (n,)
        Of unit modal mass.
    """

    number: int
    frequency_hz: float
    damping_ratio: float
    type: str
    rotational: float
    translational: float
    planet: float
    strain_energy: dict[str, float]
    shape: FloatArray

    def strained(self) -> str:
        """Return the parts that hold most of the strain energy, in words."""
        parts = sorted(self.strain_energy.items(), key=lambda own: -own[1])[:3]
        return ", ".join(f"{part} {share:.0%}" for part, share in parts if share >= 0.05)


@dataclass(frozen=True)
class Meeting:
    """A harmonic of a mesh at a natural frequency.

    Parameters
    ----------
    speed_rpm : float
        Of shaft 1.
    mode : int
    frequency_hz : float
    stage, harmonic : int
    mesh_share : float
        Share of the mode's strain energy in the meshes of this stage, 0 to 1.
    in_phase : float, 0 to 1
        How far the meshes of the stage drive the mode together: 1 where there is one, or all are
        in phase; 0 where those of a planetary set cancel.
    """

    speed_rpm: float
    mode: int
    frequency_hz: float
    stage: int
    harmonic: int
    mesh_share: float
    in_phase: float

    @property
    def drives(self) -> bool:
        """Whether the meshes together hold more than a thousandth of the strain energy."""
        return self.mesh_share * self.in_phase**2 >= DRIVING_SHARE


@dataclass(frozen=True, kw_only=True, eq=False)
class Modes(Result):
    """Natural vibrations of a machine and its Campbell table.

    Parameters
    ----------
    machine : str
    speeds_rpm : tuple of float
        Operating points, speeds of shaft 1.
    mesh_orders : tuple of float
        Mesh frequency of each stage over the frequency of shaft 1.
    rows : tuple of Mode
        By frequency.
    campbell : tuple of Meeting
        By speed.
    coordinates : tuple of str
        What the entries of a shape are.
    highest_rpm : float
        Highest speed of the Campbell table.
    harmonics : int
        Harmonics of each mesh in it.
    notes : tuple of str
        What is left out, and what was taken where the machine file says nothing.
    """

    picture: ClassVar[str] = "expected_plots.campbell_figure"

    machine: str
    speeds_rpm: tuple[float, ...]
    mesh_orders: tuple[float, ...]
    rows: tuple[Mode, ...]
    campbell: tuple[Meeting, ...]
    coordinates: tuple[str, ...]
    highest_rpm: float
    harmonics: int
    notes: tuple[str, ...]

    @property
    def frequencies_hz(self) -> FloatArray:
        """Natural frequencies [Hz], ascending."""
        return np.array([mode.frequency_hz for mode in self.rows])

    def headline(self) -> str:
        """Return how many there are, and which meeting lies nearest to an operating speed."""
        told = f"{len(self.rows)} modes up to {self.rows[-1].frequency_hz:.4g} Hz"
        driven = [own for own in self.campbell if own.drives]
        if not driven:
            return told
        near, speed = min(
            ((own, rpm) for own in driven for rpm in self.speeds_rpm),
            key=lambda pair: abs(math.log(pair[0].speed_rpm / pair[1])),
        )
        return (
            f"{told}; nearest to {speed:g} rpm: harmonic {near.harmonic} of mesh {near.stage} "
            f"meets mode {near.mode} ({near.frequency_hz:.4g} Hz) at {near.speed_rpm:.4g} rpm"
        )

    def frame_rows(self) -> list[dict[str, Any]]:
        """Return a row for each mode, with a column for each part that is strained."""
        single = [own.name for own in fields(Mode) if own.name not in ("strain_energy", "shape")]
        return [
            {name: getattr(mode, name) for name in single}
            | {f"strain {part}": share for part, share in mode.strain_energy.items()}
            for mode in self.rows
        ]

    def campbell_rows(self, meetings: Iterable[Meeting] | None = None) -> list[dict[str, Any]]:
        """Return a row for each meeting, or for those given."""
        return [asdict(own) for own in (self.campbell if meetings is None else meetings)]


def modes(
    machine: MachineLike,
    *,
    harmonics: int = 10,
    highest_rpm: float | None = None,
    operating: int = 0,
    form: str = "parabolic",
) -> Modes:
    """Return the natural vibrations of a machine, and which mesh harmonics meet them.

    Parameters
    ----------
    machine : Machine, or what `load_machine` takes
        With module and face width, or masses, inertias and mesh stiffnesses. Shafts, bearings and
        bodies that are no gears are optional: `Modes.notes` says what is taken without them.
    harmonics : int, 1 to 100
        Mesh harmonics of the Campbell table.
    highest_rpm : float, optional
        Its highest speed of shaft 1; by default 1.5 times that of the fastest operating point.
    operating : int
        Operating point whose torque loads teeth and ball bearings, from 0.
    form : str
        Of the stiffness curve, whose mean counts.

    Returns
    -------
    Modes

    Raises
    ------
    ArgumentError
        If the machine lacks data, with the key to add, or an argument is out of its range.

    Examples
    --------
    >>> stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57, "module_mm": 2.5,
    ...          "face_width_mm": 28.0}
    >>> found = modes({"operating": {"speed_rpm": 1480.0}, "stage": stage})
    >>> [(mode.type, round(mode.frequency_hz)) for mode in found.rows]
    [('rigid body', 0), ('rotational', 7319)]
    """
    known = load_machine(machine)
    check_range("harmonics", harmonics, 1, 100)
    check_range("operating", operating, 0, len(known.operating) - 1)
    speeds = tuple(point.speed_rpm for point in known.operating)
    top = SPEED_REACH * max(speeds) if highest_rpm is None else highest_rpm
    check_range("highest_rpm", top, 1e-3, 1e7)
    train = drive_train(known, known.operating[operating], form)
    orders = tuple(mesh.order for mesh in kinematics(known).meshes)
    rows = _modes(train)
    found = [
        own
        for mode in rows
        for stage, order in enumerate(orders, start=1)
        for own in _meetings(train, mode, stage, order, harmonics)
        if own.speed_rpm <= top
    ]
    return Modes(
        machine=known.name,
        speeds_rpm=speeds,
        mesh_orders=orders,
        rows=rows,
        campbell=tuple(sorted(found, key=lambda own: own.speed_rpm)),
        coordinates=train.coordinates,
        highest_rpm=top,
        harmonics=harmonics,
        notes=train.notes,
    )


def _modes(train: DriveTrain) -> tuple[Mode, ...]:
    """Return the modes, without those of shafts that are too coarse for them."""
    squares, shapes = train.modes
    angular = np.sqrt(squares)
    hertz = angular / (2 * math.pi)
    strain = {spring.part: np.zeros(len(hertz)) for spring in train.springs}
    coarse = np.zeros(len(hertz))
    for spring in train.springs:
        moved = spring.rows @ shapes
        # of unit modal mass: the whole is the square of the angular frequency
        share = np.sum(moved * (spring.stiffness @ moved), axis=0) / np.where(angular, squares, 1)
        strain[spring.part] += np.where(angular, np.abs(share), 0.0)
        coarse += share * (hertz > spring.resolved_hz)
    damped = np.sum(shapes * (train.damping @ shapes), axis=0).clip(0)
    damping = np.where(angular, damped / np.where(angular, 2 * angular, 1), 0.0)
    kinetic = _kinetic_shares(train, shapes)
    return tuple(
        Mode(
            number=number,
            frequency_hz=float(hertz[i]),
            damping_ratio=float(damping[i]),
            type=TYPES[int(kinetic[:, i].argmax())] if squares[i] else "rigid body",
            **dict(zip(TYPES, kinetic[:, i].tolist(), strict=True)),
            strain_energy={part: float(share[i]) for part, share in strain.items()},
            shape=shapes[:, i],
        )
        for number, i in enumerate(np.flatnonzero(coarse < COARSE), start=1)
    )


def _kinetic_shares(train: DriveTrain, shapes: FloatArray) -> FloatArray:
    """Return the shares of rotation, translation and planets against each other, shape (3, m)."""
    mass = train.mass.copy()
    shares = np.zeros((3, shapes.shape[1]))
    for planets in train.planets.values():
        mass -= np.einsum("pia,i,pib->ab", planets.rows, planets.inertia, planets.rows)
        # by how their motion goes round: alike, once, otherwise
        moved, angles = planets.rows @ shapes, planets.angles_rad
        alike = np.ones((len(moved), 1))
        once = np.column_stack([alike, np.cos(angles), np.sin(angles)])
        parts = [np.tensordot(own @ np.linalg.pinv(own), moved, 1) for own in (alike, once)]
        energy = [np.einsum("pim,i->m", part**2, planets.inertia) for part in (*parts, moved)]
        shares += np.diff(energy, axis=0, prepend=0.0)
    for kind, chosen in enumerate((train.turning, ~train.turning)):
        own = np.where(chosen[:, None], shapes, 0.0)
        shares[kind] += np.sum(own * (mass @ own), axis=0)
    return np.asarray(np.abs(shares / shares.sum(axis=0)))


def _meetings(
    train: DriveTrain, mode: Mode, stage: int, order: float, harmonics: int
) -> list[Meeting]:
    """Return the meetings of a mode with the harmonics of a mesh."""
    strained = mode.strain_energy.items()
    share = sum(own for part, own in strained if part.startswith(f"mesh {stage} "))
    if share < LEAST_SHARE:
        return []
    meshes = train.meshes(stage)
    forces = np.array([m.stiffness[0, 0] * (m.rows[0] @ mode.shape) for m in meshes])
    phases, kinds = np.array([m.phase for m in meshes]), np.array([m.part for m in meshes])
    found = []
    for harmonic in range(1, harmonics + 1):
        turned = forces * np.exp(2j * math.pi * harmonic * phases)
        sums = [turned[kinds == kind] for kind in set(kinds.tolist())]
        together = sum(abs(own.sum()) ** 2 / len(own) for own in sums)
        speed, together = 60 * mode.frequency_hz / (harmonic * order), together / sum(forces**2)
        place = (speed, mode.number, mode.frequency_hz, stage, harmonic)
        found.append(Meeting(*place, mesh_share=share, in_phase=math.sqrt(together)))
    return found
