"""Random machines for the benchmark of detection: what a machine file says, and what it does not.

The machine file holds teeth, modules, widths, speed and torque. Hidden from whoever analyses are
errors of manufacture, the paths to the sensors, the true stiffness, mass, damping and form of the
teeth's contact, which depart from the standard's, and the bearings.

The vibration of a mesh is solved here, so that what is judged is not judged by itself:
``m z'' + c z' + k z = F + c e' + k e`` over one turn of a gear, in the orders of that gear. The
healthy stiffness repeats with the mesh, so that orders couple only a whole number of mesh orders
apart: one small matrix for each distance from the mesh harmonics. Damage is added by GMRES on top
of them. What marks the two gears of a mesh is added up; what the marks of one do to those of the
other is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.machine import Machine, OperatingPoint, ParallelStage

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

#: Mesh harmonics that are solved for at most, and relative residual of the damaged motion.
MOST_HARMONICS = 40
RESIDUAL = 1e-6
_FINE = 2048


@dataclass(frozen=True, kw_only=True)
class PairShape:
    """Stiffness of one tooth pair along its contact.

    Parameters
    ----------
    length : float
        Length of the contact [mesh periods].
    overlap : float
        Overlap ratio of helical teeth, 0 for spur gears.
    droop : float
        Share of the middle's stiffness that is missing at the ends.
    edge : float
        Over how much of a mesh period the load is taken on and given up.
    """

    length: float
    overlap: float
    droop: float
    edge: float

    @property
    def reach(self) -> float:
        """Length of the contact over the whole face [mesh periods]."""
        return self.length + self.overlap

    def at(self, phase: FloatArray, band: float | None = None) -> FloatArray:
        """Return the stiffness, 1 in the middle, `phase` mesh periods after the entry.

        Parameters
        ----------
        phase : ndarray
        band : float, optional
            Only in this share of the contact, about its middle: what pitting takes.
        """
        slices = max(1, math.ceil(16 * self.overlap))
        total = np.zeros_like(phase)
        for number in range(slices):
            total += self._slice(phase - self.overlap * (number + 0.5) / slices, band)
        return total / slices

    def _slice(self, phase: FloatArray, band: float | None) -> FloatArray:
        place = 2 * phase / self.length - 1
        inside = np.clip(np.minimum(phase, self.length - phase) / self.edge, 0, 1)
        value: FloatArray = (1 - self.droop * place**2) * inside * inside * (3 - 2 * inside)
        if band is not None:
            value = value * (np.abs(place) < band)
        return value


@dataclass(frozen=True, kw_only=True, eq=False)
class GearMotion:
    """Motion of a mesh over one turn of a gear, in orders 0, 1, ... of it.

    Parameters
    ----------
    per_force : ndarray of complex
        What goes with the load: motion over static force [m/N].
    of_errors : ndarray of complex
        What errors make at any load [m].
    """

    per_force: ComplexArray
    of_errors: ComplexArray


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshModel:
    """One mesh at one speed.

    Parameters
    ----------
    shape : PairShape
    stiffness_n_per_m : float
        Mean over the mesh period [N/m].
    mass_kg, damping_ns_per_m : float
    mesh_hz : float
        Mesh frequency [Hz].
    highest_hz : float
        Highest frequency that is of interest [Hz].
    """

    shape: PairShape
    stiffness_n_per_m: float
    mass_kg: float
    damping_ns_per_m: float
    mesh_hz: float
    highest_hz: float

    @property
    def harmonics(self) -> int:
        """Mesh harmonics to solve for."""
        return min(MOST_HARMONICS, math.ceil(1.25 * self.highest_hz / self.mesh_hz) + 2)

    @property
    def points(self) -> int:
        """Grid points of a mesh period; products of two waves keep their harmonics apart."""
        return 1 << math.ceil(math.log2(3 * self.harmonics + 1))

    @cached_property
    def pair_n_per_m(self) -> float:
        """Stiffness of one pair in the middle of its contact [N/m]."""
        phase = np.arange(math.ceil(self.shape.reach) * _FINE) / _FINE
        return self.stiffness_n_per_m / (float(self.shape.at(phase).sum()) / _FINE)

    @cached_property
    def _stiffness_lines(self) -> ComplexArray:
        """Fourier coefficients 0, 1, ... of the healthy stiffness [N/m]."""
        phase = np.arange(_FINE) / _FINE
        wave = sum(self.shape.at(phase + n) for n in range(math.ceil(self.shape.reach)))
        lines: ComplexArray = np.fft.rfft(self.pair_n_per_m * np.asarray(wave)) / _FINE
        return lines

    def wave(self, per_tooth: FloatArray, band: float | None = None) -> FloatArray:
        """Return the sum over the teeth of a value times the stiffness of the tooth's pair [N/m].

        Parameters
        ----------
        per_tooth : ndarray, shape (teeth,)
        band : float, optional
            See `PairShape.at`.

        Returns
        -------
        ndarray, shape (teeth * points,)
            Over one turn; tooth j enters contact j - 1 mesh periods after its start.
        """
        teeth = len(per_tooth)
        count = math.ceil(self.shape.reach)
        pulse = self.shape.at(np.arange(count * self.points) / self.points, band)
        total = np.zeros((teeth, self.points))
        for n in range(count):
            piece = pulse[n * self.points : (n + 1) * self.points]
            total += np.roll(per_tooth, n)[:, None] * piece
        return self.pair_n_per_m * total.ravel()

    def turn(self, teeth: int) -> Turn:
        """Return the solver for marks of a gear with so many teeth."""
        return Turn(model=self, teeth=teeth)


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """Solver of one mesh over the turn of one of its gears.

    Parameters
    ----------
    model : MeshModel
    teeth : int
    """

    model: MeshModel
    teeth: int

    @property
    def size(self) -> int:
        """Grid points of a turn."""
        return self.teeth * self.model.points

    @cached_property
    def _orders(self) -> IntArray:
        """Orders that couple: a row for each distance from the mesh harmonics."""
        meshes = np.arange(-self.model.harmonics, self.model.harmonics + 1)
        return np.arange(self.teeth // 2 + 1)[:, None] + self.teeth * meshes

    @cached_property
    def _inverse(self) -> ComplexArray:
        model = self.model
        count = 2 * model.harmonics + 1
        away = np.arange(count)[:, None] - np.arange(count)
        lines = model._stiffness_lines
        matrix = np.where(away >= 0, lines[np.abs(away)], np.conj(lines[np.abs(away)]))
        angular = 2 * np.pi * model.mesh_hz / self.teeth * self._orders
        diagonal = 1j * angular * model.damping_ns_per_m - model.mass_kg * angular**2
        blocks = np.tile(matrix, (len(diagonal), 1, 1))
        index = np.arange(count)
        blocks[:, index, index] += diagonal
        inverse: ComplexArray = np.linalg.inv(blocks)
        return inverse

    def _healthy(self, force: FloatArray) -> FloatArray:
        """Motion of the healthy mesh under a force over one turn."""
        lines = np.fft.rfft(force)
        orders = self._orders
        known = np.abs(orders)
        right = np.where(orders >= 0, lines[known], np.conj(lines[known]))
        solved = np.matmul(self._inverse, right[:, :, None])[:, :, 0]
        result = np.zeros_like(lines)
        result[known] = np.where(orders >= 0, solved, np.conj(solved))
        motion: FloatArray = np.fft.irfft(result, self.size)
        return motion

    def motion(self, error: FloatArray | None = None, loss: FloatArray | None = None) -> GearMotion:
        """Return what errors and lost stiffness of the gear make of the motion.

        Parameters
        ----------
        error : ndarray, shape (size,), optional
            Displacement of the flanks over one turn [m].
        loss : ndarray, shape (size,), optional
            Stiffness lost over one turn [N/m].
        """
        per_force = self._with_loss(self._healthy(np.ones(self.size)), loss)
        of_errors = np.zeros(self.size)
        if error is not None:
            model = self.model
            lines = np.fft.rfft(error)
            angular = 2 * np.pi * model.mesh_hz / self.teeth * np.arange(len(lines))
            rate = np.fft.irfft(1j * angular * lines, self.size)
            whole = model.wave(np.ones(self.teeth))
            if loss is not None:
                whole = whole - loss
            force = model.damping_ns_per_m * rate + whole * error
            of_errors = self._with_loss(self._healthy(force), loss)
        return GearMotion(
            per_force=np.fft.rfft(per_force) / self.size,
            of_errors=np.fft.rfft(of_errors) / self.size,
        )

    def _with_loss(self, motion: FloatArray, loss: FloatArray | None) -> FloatArray:
        """Add to a motion of the healthy mesh what lost stiffness changes of it."""
        if loss is None or not loss.any():
            return motion
        from scipy.sparse.linalg import LinearOperator, gmres

        def left(guess: FloatArray) -> FloatArray:
            return guess - self._healthy(loss * guess)

        operator = LinearOperator((self.size, self.size), matvec=left, dtype=np.float64)
        right = self._healthy(loss * motion)
        change, failed = gmres(operator, right, rtol=RESIDUAL, restart=100, maxiter=10)
        if failed:
            raise ArithmeticError(f"the motion with damage was not found in {failed} steps")
        return motion + np.asarray(change, dtype=np.float64)


PINION_TEETH, GEAR_TEETH = (17, 60), (25, 120)
LARGEST_RATIO = 5.0
SPEED_HZ = (12.0, 45.0)
#: Mesh frequencies [Hz] and the slowest shaft [Hz] that a recording of 10 s can show.
MESH_HZ = (100.0, 1800.0)
SLOWEST_HZ = 2.0
MODULE_MM = (1.5, 4.0)
WIDTH_MODULES = (8.0, 14.0)
#: Tangential force over the face width of the first stage [N/mm].
LOAD_N_PER_MM = (100.0, 350.0)
#: Departures of the true mesh from the standard's: stiffness and mass as factors, damping ratio.
STIFFNESS_FACTOR, MASS_FACTOR, DAMPING = (0.9, 1.1), (0.85, 1.15), (0.04, 0.12)
#: Standard deviation of the pitch [m], amplitude of the eccentricity [m].
PITCH_M, ECCENTRICITY_M = (0.4e-6, 2.5e-6), (2e-6, 20e-6)
MODES, MODE_BAND_HZ, MODE_DAMPING = (8, 25), (250.0, 9500.0), (0.01, 0.06)
GEARS = ("pinion", "gear")


@dataclass(frozen=True, kw_only=True, eq=False)
class HiddenGear:
    """Errors of manufacture of one gear.

    Parameters
    ----------
    teeth : int
    pitch_m : ndarray, shape (teeth,)
        Displacement of each flank along the line of action [m].
    runout_m : ndarray of complex, shape (harmonics,)
        Once, twice, ... a turn: complex peak amplitudes [m].
    """

    teeth: int
    pitch_m: FloatArray
    runout_m: NDArray[np.complex128]

    def runout(self, points: int) -> FloatArray:
        """Return the runout over one turn [m], so many points a mesh period."""
        angle = 2j * np.pi * np.arange(self.teeth * points) / (self.teeth * points)
        harmonic = np.arange(1, len(self.runout_m) + 1)
        wave: FloatArray = (self.runout_m @ np.exp(np.outer(harmonic, angle))).real
        return wave


@dataclass(frozen=True, kw_only=True, eq=False)
class HiddenStage:
    """What the machine file does not say of a stage.

    Parameters
    ----------
    mechanics : StageMechanics
        By the standard.
    shape : PairShape
    stiffness_factor, mass_factor, damping_ratio : float
    gears : tuple of HiddenGear
        Pinion and gear.
    """

    mechanics: StageMechanics
    shape: PairShape
    stiffness_factor: float
    mass_factor: float
    damping_ratio: float
    gears: tuple[HiddenGear, HiddenGear]

    def model(self, speed_factor: float, highest_hz: float) -> MeshModel:
        """Return the true mesh at a multiple of the nominal speed."""
        stiffness = self.stiffness_factor * self.mechanics.stiffness.mean_n_per_m
        mass = self.mass_factor * self.mechanics.equivalent_mass_kg
        return MeshModel(
            shape=self.shape,
            stiffness_n_per_m=stiffness,
            mass_kg=mass,
            damping_ns_per_m=2 * self.damping_ratio * math.sqrt(stiffness * mass),
            mesh_hz=speed_factor * self.mechanics.mesh_frequency_hz,
            highest_hz=highest_hz,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class HiddenPath:
    """Housing modes between the meshes and the sensors.

    Parameters
    ----------
    mode_hz, damping_ratio : ndarray, shape (modes,)
    gain : ndarray, shape (channels, stages, modes)
    """

    mode_hz: FloatArray
    damping_ratio: FloatArray
    gain: FloatArray

    def taps(self, rate_hz: float) -> int:
        """Return the samples until the slowest mode has fallen to 1e-4."""
        slowest = float((2 * np.pi * self.mode_hz * self.damping_ratio).min())
        return math.ceil(math.log(1e4) / slowest * rate_hz)

    def impulse(self, rate_hz: float) -> FloatArray:
        """Return the impulse responses, shape (channels, stages, taps)."""
        time = np.arange(self.taps(rate_hz)) / rate_hz
        angular = 2 * np.pi * self.mode_hz[:, None]
        ring = np.exp(-self.damping_ratio[:, None] * angular * time) * np.sin(
            angular * np.sqrt(1 - self.damping_ratio[:, None] ** 2) * time
        )
        response: FloatArray = (self.gain * self.mode_hz / rate_hz) @ ring
        return response


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnMachine:
    """A machine file and what it hides.

    Parameters
    ----------
    machine : Machine
    stages : tuple of HiddenStage
    path : HiddenPath
    bearing_orders : ndarray
        Tones and impacts of rolling bearings, as orders of shaft 1, of no gear.
    """

    machine: Machine
    stages: tuple[HiddenStage, ...]
    path: HiddenPath
    bearing_orders: FloatArray

    @property
    def speed_hz(self) -> float:
        """Nominal speed of shaft 1 [Hz]."""
        return self.machine.operating[0].shaft1_hz

    @property
    def channels(self) -> int:
        """Sensors."""
        return len(self.path.gain)


def draw_machine(
    rng: np.random.Generator, number: int = 0, channels: int | None = None
) -> DrawnMachine:
    """Draw a machine of one or two parallel stages.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int
        For its name.
    channels : int, optional
        Sensors; 1 or 2 by default.
    """
    while True:
        machine = _draw_file(rng, number)
        if machine is None:
            continue
        try:
            found = [stage_mechanics(machine, n + 1) for n in range(len(machine.stages))]
        except ArgumentError:
            continue  # gears that cannot run together
        break
    stages = tuple(_hide(rng, mechanics, machine) for mechanics in found)
    sensors = int(rng.integers(1, 3)) if channels is None else channels
    return DrawnMachine(
        machine=machine,
        stages=stages,
        path=_draw_path(rng, sensors, len(stages)),
        bearing_orders=rng.uniform(1.3, 9.7, 3),
    )


def _draw_file(rng: np.random.Generator, number: int) -> Machine | None:
    """Return a random machine, or None if a recording could not show it."""
    count = int(rng.integers(1, 3))
    speed_hz = rng.uniform(*SPEED_HZ)
    module, order, stages = rng.uniform(*MODULE_MM), 1.0, []
    for _ in range(count):
        pinion = int(rng.integers(PINION_TEETH[0], PINION_TEETH[1] + 1))
        gear = int(rng.integers(GEAR_TEETH[0], GEAR_TEETH[1] + 1))
        if pinion == gear or not 0.6 <= gear / pinion <= LARGEST_RATIO:
            return None
        if not MESH_HZ[0] <= order * pinion * speed_hz <= MESH_HZ[1]:
            return None
        stages.append(_draw_stage(rng, pinion, gear, module))
        order *= pinion / gear
        module *= rng.uniform(1.1, 1.5)
    if order * speed_hz < SLOWEST_HZ:
        return None
    width_mm = float(stages[0].face_width_mm or 0.0)
    radius_m = 0.5e-3 * float(stages[0].module_mm or 0.0) * stages[0].pinion_teeth
    torque = rng.uniform(*LOAD_N_PER_MM) * width_mm * radius_m
    return Machine(
        name=f"drawn machine {number}",
        operating=(
            OperatingPoint(
                speed_rpm=round(60 * speed_hz, 1), torque_nm=float(f"{torque:.4g}"), share=1.0
            ),
        ),
        stages=tuple(stages),
    )


def _draw_stage(rng: np.random.Generator, pinion: int, gear: int, module: float) -> ParallelStage:
    helix = rng.uniform(5, 20) if rng.random() < 0.2 else 0.0
    return ParallelStage(
        pinion_teeth=pinion,
        gear_teeth=gear,
        module_mm=round(module, 2),
        face_width_mm=round(module * rng.uniform(*WIDTH_MODULES), 1),
        helix_angle_deg=round(helix, 1),
        bore_diameter_pinion_mm=round(0.35 * module * pinion, 1),
        bore_diameter_gear_mm=round(0.3 * module * gear, 1),
    )


def _hide(rng: np.random.Generator, mechanics: StageMechanics, machine: Machine) -> HiddenStage:
    stage = machine.stages[mechanics.stage - 1]
    assert isinstance(stage, ParallelStage)
    stiffness = mechanics.stiffness
    return HiddenStage(
        mechanics=mechanics,
        shape=PairShape(
            length=stiffness.contact_ratio,
            overlap=stiffness.overlap_ratio,
            droop=rng.uniform(0.2, 0.6),
            edge=rng.uniform(0.03, 0.15),
        ),
        stiffness_factor=rng.uniform(*STIFFNESS_FACTOR),
        mass_factor=rng.uniform(*MASS_FACTOR),
        damping_ratio=rng.uniform(*DAMPING),
        gears=(_draw_gear(rng, stage.pinion_teeth), _draw_gear(rng, stage.gear_teeth)),
    )


def _draw_gear(rng: np.random.Generator, teeth: int) -> HiddenGear:
    pitch = rng.uniform(*PITCH_M) * rng.normal(size=teeth)
    size = np.exp(rng.uniform(*np.log(ECCENTRICITY_M))) * np.array([1.0, 0.2, 0.1, 0.05])
    phase = rng.uniform(0, 2 * np.pi, 4)
    return HiddenGear(teeth=teeth, pitch_m=pitch - pitch.mean(), runout_m=size * np.exp(1j * phase))


def _draw_path(rng: np.random.Generator, channels: int, stages: int) -> HiddenPath:
    modes = int(rng.integers(MODES[0], MODES[1] + 1))
    low, high = np.log(MODE_BAND_HZ)
    return HiddenPath(
        mode_hz=np.exp(rng.uniform(low, high, modes)),
        damping_ratio=rng.uniform(*MODE_DAMPING, modes),
        gain=rng.normal(size=(channels, stages, modes)),
    )
