"""Order lines that faults and errors of one machine add, ready to be superposed.

Every mesh is solved once for each thing that may be wrong with one tooth or with a whole gear, of
a given small size. To first order the lines of several teeth add, each delayed by its place in the
turn, so that any pattern w_j over the teeth of a gear gives the lines ``L_n W_n``, with L_n those
of tooth 1 and ``W_n = sum_j w_j exp(-2 pi i n (j - 1)/z)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.gears.faults import Fault, GearError
from gearmon.gears.kinematics import kinematics
from gearmon.gears.pairs import mesh_pairs
from gearmon.machine import Machine
from gearmon.signatures.expected.baseline import faulty_lines
from gearmon.signatures.expected.mesh import MeshPlace, operating_point
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, LinePlan, WheelLines, line_plan

#: Loss of stiffness at which the lines of a damaged tooth, and of worn teeth, are computed.
LOSS = 0.1
#: Size at which the lines of errors are computed, in modules: 20 um at 2 mm.
SIZE = 0.01
#: A wobble that the load closes shows nothing; it is made larger up to this size, in modules.
LARGEST_WOBBLE = 0.3
_USUAL_MODULE_M = 2e-3
_TOLERANCE = 1e-2


@dataclass(frozen=True, kw_only=True, eq=False)
class GearLines:
    """What can be wrong with one gear, as lines at the multiples of its rotation.

    Errors come in units of their effect: 1 makes lines of the same rms as those of the sound mesh.

    Parameters
    ----------
    wheel : WheelLines
        The gear and its place in the plan.
    distance : ndarray of int, shape (lines,)
        Turns of the gear from the nearest mesh harmonic.
    crack, pitting : ndarray of complex, shape (lines,)
        Acceleration lines per whole loss of stiffness of tooth 1 [m/s2].
    pitch : ndarray of complex, shape (lines,)
        The same for tooth 1 standing back; a pattern over the teeth of unit variance has unit
        effect.
    eccentricity, wobble, profile : ndarray of complex, shape (lines,)
        The same for the whole gear, of unit effect.
    wear : ndarray of complex, shape (lines,)
        Per whole loss of stiffness of all teeth.
    """

    wheel: WheelLines
    distance: IntArray
    crack: ComplexArray
    pitting: ComplexArray
    pitch: ComplexArray
    eccentricity: ComplexArray
    wobble: ComplexArray
    profile: ComplexArray
    wear: ComplexArray

    def by_tooth(self, line: ComplexArray, weight: FloatArray) -> ComplexArray:
        """Return the lines of a pattern over the teeth, from those of tooth 1."""
        return np.asarray(line * np.fft.fft(weight)[self.distance % self.wheel.teeth])

    def multiple(self, number: int, share: float, angle_rad: float) -> ComplexArray:
        """Return the lines of an error that repeats once or twice per turn, of unit effect.

        Parameters
        ----------
        number : {1, 2}
            1 for eccentricity, 2 for wobble.
        share : float, in [0, 1]
            Share of lines in which the error changes the contact of the teeth as well, and not only
            moves them: models and machines differ in that.
        angle_rad : float
            Of the gear.
        """
        whole = self.eccentricity if number == 1 else self.wobble
        tooth = 2 * np.pi * np.arange(self.wheel.teeth) / self.wheel.teeth
        moved = self.by_tooth(self.pitch, np.sqrt(2.0) * np.cos(number * tooth))
        return self.turned(share * whole + (1 - share) * moved, angle_rad)

    def turned(self, line: ComplexArray, angle_rad: float) -> ComplexArray:
        """Return the lines of a whole gear's error, turned by an angle."""
        return np.asarray(line * np.exp(1j * self.distance * angle_rad))


@dataclass(frozen=True, kw_only=True, eq=False)
class MachineLines:
    """All that superposition needs of a machine.

    Parameters
    ----------
    plan : LinePlan
        Orders and families.
    healthy : ndarray of complex, shape (stages, orders)
        Acceleration of each sound mesh at the operating point [m/s2].
    gears : tuple of GearLines
        Every gear.
    members : ndarray of float, shape (orders, families)
        1 where an order is of a family.
    """

    plan: LinePlan
    healthy: ComplexArray
    gears: tuple[GearLines, ...]
    members: FloatArray


def machine_lines(machine: Machine, operating: int = 0) -> MachineLines:
    """Compute the lines of everything that can be wrong with the gears of a machine.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs.
    operating : int
        Operating point, from 0.

    Returns
    -------
    MachineLines

    Raises
    ------
    ArgumentError
        If the machine lacks data.

    Notes
    -----
    Of a planetary set the ring's mesh adds to the mesh harmonics with phases that depend on the
    planets; faults of the ring are therefore taken not to change them.
    """
    train = kinematics(machine)
    top = (MESH_HARMONICS + 0.6) * max(mesh.order for mesh in train.meshes)
    slowest = min(wheel.relative_order for mesh in train.meshes for wheel in mesh.wheels)
    plan = line_plan(train, top, 0.5 * slowest)
    healthy = np.zeros((len(machine.stages), len(plan.orders)), dtype=np.complex128)
    gears = []
    for stage in range(1, len(machine.stages) + 1):
        mesh = _Mesh(machine, stage, operating)
        own = [wheel for wheel in plan.wheels if wheel.stage == stage]
        gears += [mesh.gear(wheel) for wheel in own]
        for wheel in own[:1]:
            chosen = wheel.number % wheel.teeth == 0
            sound = _on(mesh.sound, wheel.number // wheel.teeth)
            healthy[stage - 1, wheel.lines[chosen]] = sound[chosen]
    members = np.zeros((len(plan.orders), len(plan.families)))
    for index, family in enumerate(plan.families):
        members[list(family.lines), index] = 1.0
    return MachineLines(plan=plan, healthy=healthy, gears=tuple(gears), members=members)


class _Mesh:
    """The mesh of one stage at one operating point."""

    def __init__(self, machine: Machine, stage: int, operating: int) -> None:
        self.machine, self.stage, self.operating = machine, stage, operating
        point = operating_point(machine, operating)
        order = kinematics(machine).mesh(stage).order
        self.max_hz = (MESH_HARMONICS + 0.6) * order * point.shaft1_hz
        module_mm = machine.stages[stage - 1].module_mm
        self.module_m = _USUAL_MODULE_M if module_mm is None else 1e-3 * module_mm
        # the first gear of a stage is in its main mesh
        self.first = mesh_pairs(machine.stages[stage - 1], stage, machine.path)[0].members[0].name
        self.sound = self._lines(None, 1, self.first)
        self.rms = float(np.linalg.norm(self.sound))
        profile, worn = (
            self._lines(self._wrong(kind, self.first), 1, self.first)
            for kind in ("profile", "wear")
        )
        self.profile = self._unit(profile - _fitted(self.sound, len(profile)))
        self.wear = (worn - _fitted(self.sound, len(worn))) / LOSS

    def gear(self, wheel: WheelLines) -> GearLines:
        """Return what can be wrong with a gear."""
        half, number = wheel.teeth // 2, wheel.number
        distance = (number + half) % wheel.teeth - half
        pitch = self._added("pitch", wheel)
        # summed over z random teeth, z times the power of one
        scale = np.sqrt(wheel.teeth) * float(np.linalg.norm(pitch))
        mesh = (distance == 0) & (wheel.gear != "ring")
        common = number // wheel.teeth
        return GearLines(
            wheel=wheel,
            distance=distance,
            crack=self._added("crack", wheel) / LOSS,
            pitting=self._added("pitting", wheel) / LOSS,
            pitch=pitch * (self.rms / scale if scale else 0.0),
            eccentricity=self._unit(self._added("eccentricity", wheel)),
            wobble=self._wobble(wheel),
            profile=np.where(mesh, _on(self.profile, common), 0.0),
            wear=np.where(mesh, _on(self.wear, common), 0.0),
        )

    def _wobble(self, wheel: WheelLines) -> ComplexArray:
        size = SIZE
        lines = self._added("misalignment", wheel, size)
        while np.linalg.norm(lines) <= 0.05 * self.rms and 3 * size <= LARGEST_WOBBLE:
            size *= 3
            lines = self._added("misalignment", wheel, size)
        return self._unit(lines)

    def _unit(self, lines: ComplexArray) -> ComplexArray:
        size = float(np.linalg.norm(lines))
        # what does not act (a gap that the load closes) leaves rounding errors
        return np.asarray(lines * (self.rms / size if size > 1e-6 * self.rms else 0.0))

    def _added(self, kind: str, wheel: WheelLines, size: float = SIZE) -> ComplexArray:
        lines = self._lines(self._wrong(kind, wheel.gear, size), wheel.teeth, wheel.gear)
        common = lines[:: wheel.teeth]
        common -= common if wheel.gear == "ring" else _fitted(self.sound, len(common))
        return _on(lines, wheel.number)

    def _lines(self, wrong: Fault | GearError | None, teeth: int, gear: str) -> ComplexArray:
        """Return acceleration lines 0, 1, ... of the turn of a gear (of the mesh: 1 tooth)."""
        mesh = 1 if gear == "ring" else 0
        place = MeshPlace(self.machine, self.stage, self.operating, mesh=mesh)
        healthy, faulty = place.alone(), place.alone([] if wrong is None else [wrong])
        (solved,) = faulty_lines(healthy, [faulty], self.max_hz, _TOLERANCE)
        number = solved.number * (teeth // solved.period)
        lines = np.zeros(int(number.max(initial=0)) + 1, dtype=np.complex128)
        lines[number] = 2 * solved.acceleration
        return lines

    def _wrong(self, kind: str, gear: str, size: float = SIZE) -> Fault | GearError:
        tooth = 1 if kind in ("crack", "pitting", "pitch") else None
        if kind in ("crack", "pitting", "wear"):
            return Fault(kind=kind, stage=self.stage, gear=gear, tooth=tooth, size=LOSS)
        moved = size * self.module_m
        return GearError(kind=kind, stage=self.stage, gear=gear, tooth=tooth, size_m=moved)


def _fitted(lines: ComplexArray, count: int) -> ComplexArray:
    """Return the first `count` lines, zeros beyond their end."""
    return _on(lines, np.arange(count))


def _on(lines: ComplexArray, number: IntArray) -> ComplexArray:
    """Return lines by their numbers, 0 where there is none."""
    known = number < len(lines)
    return np.asarray(np.where(known, lines[np.where(known, number, 0)], 0.0))
