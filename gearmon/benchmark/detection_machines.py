"""Random machines for the benchmark of detection: what a machine file says, and what it does not.

The machine file holds teeth, modules, widths, speed and torque. Hidden from whoever analyses are
errors of manufacture, the paths to the sensors, the true stiffness, mass, damping and form of the
teeth's contact, which depart from the standard's, and the bearings.

The vibration of a mesh is that of ``m z'' + c z' + k z = F + c e' + k e`` over one turn of a gear,
in the orders of that gear, to a guaranteed error. What marks the two gears of a mesh is added up;
what the marks of one do to those of the other is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.dynamics import HillProblem, steady_state
from gearmon.errors import ArgumentError
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.machine import Machine, OperatingPoint, ParallelStage

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Sampling rate of the recordings, and highest frequency of the lines that are made [Hz].
RATE_HZ, HIGHEST_HZ = 20_000.0, 9_200.0
#: Mesh harmonics that are solved for at most, and relative error of the motion.
MOST_HARMONICS = 40
TOLERANCE = 1e-6
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

    def at(self, phase: FloatArray, band: float = math.inf) -> FloatArray:
        """Return the stiffness, 1 in the middle, `phase` mesh periods after the entry.

        Parameters
        ----------
        phase : ndarray
        band : float
            Only in this share of the contact, about its middle: what pitting takes.
        """
        slices = max(1, math.ceil(16 * self.overlap))
        entered = self.overlap * (np.arange(slices) + 0.5) / slices
        own = np.subtract.outer(phase, entered)
        place = 2 * own / self.length - 1
        inside = np.clip(np.minimum(own, self.length - own) / self.edge, 0, 1)
        value = (1 - self.droop * place**2) * inside * inside * (3 - 2 * inside)
        return np.asarray((value * (np.abs(place) < band)).mean(axis=-1))


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
    """

    shape: PairShape
    stiffness_n_per_m: float
    mass_kg: float
    damping_ns_per_m: float
    mesh_hz: float

    @property
    def harmonics(self) -> int:
        """Mesh harmonics to solve for."""
        return min(MOST_HARMONICS, math.ceil(1.25 * HIGHEST_HZ / self.mesh_hz) + 2)

    @property
    def points(self) -> int:
        """Grid points of a mesh period; products of two waves keep their harmonics apart."""
        return 1 << math.ceil(math.log2(3 * self.harmonics + 1))

    @cached_property
    def pair_n_per_m(self) -> float:
        """Stiffness of one pair in the middle of its contact [N/m]."""
        phase = np.arange(math.ceil(self.shape.reach) * _FINE) / _FINE
        return self.stiffness_n_per_m / (float(self.shape.at(phase).sum()) / _FINE)

    def wave(self, per_tooth: FloatArray, band: float = math.inf) -> FloatArray:
        """Return the sum over the teeth of a value times the stiffness of the tooth's pair [N/m].

        Parameters
        ----------
        per_tooth : ndarray, shape (teeth,)
        band : float
            See `PairShape.at`.

        Returns
        -------
        ndarray, shape (teeth * points,)
            Over one turn; tooth j enters contact j - 1 mesh periods after its start.
        """
        count = math.ceil(self.shape.reach)
        pulse = self.shape.at(np.arange(count * self.points) / self.points, band)
        pieces = pulse.reshape(count, self.points)
        total = sum(np.outer(np.roll(per_tooth, n), piece) for n, piece in enumerate(pieces))
        return self.pair_n_per_m * np.ravel(total)

    def motion(
        self, teeth: int, error: FloatArray | None = None, loss: FloatArray | None = None
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return what errors and lost stiffness of a gear make of the motion.

        Parameters
        ----------
        teeth : int
            Of the gear.
        error : ndarray, shape (teeth * points,), optional
            Displacement of the flanks over one turn [m].
        loss : ndarray, shape (teeth * points,), optional
            Stiffness lost over one turn [N/m].

        Returns
        -------
        per_force, of_errors : ndarray of complex, shape (harmonics * teeth + 1,)
            Motion over static force [m/N], and what errors make at any load [m], in orders
            0, 1, ... of the gear.
        """
        orders, period_s = np.arange(self.harmonics * teeth + 1), teeth / self.mesh_hz

        def lines(wave: FloatArray) -> ComplexArray:
            return np.asarray(np.fft.rfft(wave, norm="forward")[orders])

        def solved(problem: HillProblem) -> ComplexArray:
            return steady_state(problem, TOLERANCE, harmonics=int(orders[-1])).displacement

        stiffness = self.wave(np.ones(teeth)) - (0.0 if loss is None else loss)
        mean, *others = lines(stiffness)
        known = self.mass_kg, self.damping_ns_per_m, float(mean.real)
        mesh = HillProblem(*known, np.array(others) / mean.real, period_s, 1.0)
        if error is None:
            return solved(mesh), np.zeros(len(orders), dtype=np.complex128)
        rate = 2j * np.pi * orders / period_s * lines(error)
        force = lines(stiffness * error) + self.damping_ns_per_m * rate
        moved = replace(mesh, force_n=float(force[0].real), force_harmonics_n=force[1:])
        return solved(mesh), solved(moved)


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
        What it says.
    model : MeshModel
        The true mesh at nominal speed.
    gears : tuple of HiddenGear
        Pinion and gear.
    """

    mechanics: StageMechanics
    model: MeshModel
    gears: tuple[HiddenGear, HiddenGear]


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
    torque_nm = float(f"{rng.uniform(*LOAD_N_PER_MM) * width_mm * radius_m:.4g}")
    point = OperatingPoint(speed_rpm=round(60 * speed_hz, 1), torque_nm=torque_nm, share=1.0)
    return Machine(name=f"drawn machine {number}", operating=(point,), stages=tuple(stages))


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
    length, overlap = mechanics.contact_ratio, mechanics.stiffness.overlap_ratio
    droop, edge = rng.uniform(0.2, 0.6), rng.uniform(0.03, 0.15)
    stiffness = rng.uniform(*STIFFNESS_FACTOR) * mechanics.stiffness.mean_n_per_m
    mass = rng.uniform(*MASS_FACTOR) * mechanics.equivalent_mass_kg
    model = MeshModel(
        shape=PairShape(length=length, overlap=overlap, droop=droop, edge=edge),
        stiffness_n_per_m=stiffness,
        mass_kg=mass,
        damping_ns_per_m=2 * rng.uniform(*DAMPING) * math.sqrt(stiffness * mass),
        mesh_hz=mechanics.mesh_frequency_hz,
    )
    gears = _draw_gear(rng, stage.pinion_teeth), _draw_gear(rng, stage.gear_teeth)
    return HiddenStage(mechanics=mechanics, model=model, gears=gears)


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
