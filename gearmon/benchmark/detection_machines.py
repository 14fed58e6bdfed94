"""Random machines for the benchmark of detection: what a machine file says, and what it does not.

The machine file holds teeth, modules, widths, speed and torque. Hidden from whoever analyses are
errors of manufacture, the paths to the sensors, the true stiffness, mass, damping and form of the
teeth's contact, which depart from the standard's, and the bearings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.benchmark.detection_mesh import MeshModel, PairShape
from gearmon.errors import ArgumentError
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.machine import Machine, OperatingPoint, ParallelStage

FloatArray = NDArray[np.float64]

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
