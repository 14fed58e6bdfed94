"""Random machines for the benchmark of detection, and their recordings: a tenth of a second each.

The machine file holds teeth, modules, widths, speed and torque. Hidden from whoever analyses are
errors of manufacture, the paths to the sensors, the true stiffness, mass, damping and form of the
teeth's contact, which depart from the standard's, and the bearings.

The vibration of a mesh is that of ``m z'' + c z' + k z = F + c e' + k e`` over one turn of a gear,
in the orders of that gear, to a guaranteed error. What marks the two gears of a mesh is added up;
what the marks of one do to those of the other is left out. Read at the angle that the shafts have
at each sample it makes forces, which are sent in the time domain through the impulse responses of
the housing: lines that wander with the speed meet its resonances as they do in a machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.dynamics import HillProblem, steady_state
from gearmon.errors import ArgumentError
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signals.recording import Recording
from gearmon.simulation.vibration import tacho_pulses

#: Sampling rate of the recordings, and highest frequency of the lines that are made [Hz].
RATE_HZ, HIGHEST_HZ = 20_000.0, 9_200.0
#: Mesh harmonics that are solved for at most, and relative error of the motion.
MOST_HARMONICS = 40
TOLERANCE = 1e-6
_FINE = 2048


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshModel:
    """One mesh at one speed.

    Parameters
    ----------
    length : float
        Length of the contact of a tooth pair [mesh periods].
    overlap : float
        Overlap ratio of helical teeth, 0 for spur gears.
    droop : float
        Share of the middle's stiffness that is missing at the ends of the contact.
    edge : float
        Over how much of a mesh period a pair takes on its load and gives it up.
    stiffness_n_per_m : float
        Mean over the mesh period [N/m].
    mass_kg, damping_ns_per_m : float
    mesh_hz : float
        Mesh frequency [Hz].
    """

    length: float
    overlap: float
    droop: float
    edge: float
    stiffness_n_per_m: float
    mass_kg: float
    damping_ns_per_m: float
    mesh_hz: float

    @property
    def reach(self) -> float:
        """Length of the contact over the whole face [mesh periods]."""
        return self.length + self.overlap

    @property
    def harmonics(self) -> int:
        """Mesh harmonics to solve for."""
        return min(MOST_HARMONICS, math.ceil(1.25 * HIGHEST_HZ / self.mesh_hz) + 2)

    @property
    def points(self) -> int:
        """Grid points of a mesh period; products of two waves keep their harmonics apart."""
        return 1 << math.ceil(math.log2(3 * self.harmonics + 1))

    def pair(self, phase: FloatArray, band: float = math.inf) -> FloatArray:
        """Return the stiffness of one pair, 1 in the middle of its contact.

        Parameters
        ----------
        phase : ndarray
            Since its entry [mesh periods].
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

    @cached_property
    def pair_n_per_m(self) -> float:
        """Stiffness of one pair in the middle of its contact [N/m]."""
        phase = np.arange(math.ceil(self.reach) * _FINE) / _FINE
        return self.stiffness_n_per_m * _FINE / float(self.pair(phase).sum())

    def wave(self, per_tooth: FloatArray, band: float = math.inf) -> FloatArray:
        """Return the sum over the teeth of a value times the stiffness of the tooth's pair [N/m].

        Parameters
        ----------
        per_tooth : ndarray, shape (teeth,)
        band : float
            See `pair`.

        Returns
        -------
        ndarray, shape (teeth * points,)
            Over one turn; tooth j enters contact j - 1 mesh periods after its start.
        """
        count = math.ceil(self.reach)
        pieces = self.pair(np.arange(count * self.points) / self.points, band).reshape(count, -1)
        total = sum(np.outer(np.roll(per_tooth, n), piece) for n, piece in enumerate(pieces))
        return self.pair_n_per_m * np.ravel(total)

    def motion(
        self, teeth: int, error: FloatArray | None = None, loss: FloatArray | float = 0.0
    ) -> ComplexArray:
        """Return what errors and lost stiffness of a gear make of the motion.

        Parameters
        ----------
        teeth : int
            Of the gear.
        error : ndarray, shape (teeth * points,), optional
            Displacement of the flanks over one turn [m].
        loss : ndarray, shape (teeth * points,)
            Stiffness lost over one turn [N/m].

        Returns
        -------
        ndarray of complex, shape (2, harmonics * teeth + 1)
            Motion over static force [m/N], and what errors make at any load [m], in orders
            0, 1, ... of the gear.
        """
        orders, period_s = np.arange(self.harmonics * teeth + 1), teeth / self.mesh_hz

        def lines(wave: FloatArray) -> ComplexArray:
            return np.asarray(np.fft.rfft(wave, norm="forward")[orders])

        def solved(problem: HillProblem) -> ComplexArray:
            return steady_state(problem, TOLERANCE, harmonics=int(orders[-1])).displacement

        stiffness = self.wave(np.ones(teeth)) - loss
        mean, *others = lines(stiffness)
        known = self.mass_kg, self.damping_ns_per_m, float(mean.real)
        mesh = HillProblem(*known, np.array(others) / mean.real, period_s, 1.0)
        if error is None:
            return np.stack([solved(mesh), np.zeros(len(orders))])
        rate = 2j * np.pi * orders / period_s * lines(error)
        force = lines(stiffness * error) + self.damping_ns_per_m * rate
        moved = replace(mesh, force_n=float(force[0].real), force_harmonics_n=force[1:])
        return np.stack([solved(mesh), solved(moved)])


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
    runout_m: ComplexArray


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
        try:
            machine, drawn = _draw_file(rng, number)
            found = [stage_mechanics(machine, n + 1) for n in range(len(machine.stages))]
        except ArgumentError:
            continue  # a recording could not show it, or its gears cannot run together
        break
    stages = tuple(_hide(rng, *own) for own in zip(found, drawn, strict=True))
    sensors = int(rng.integers(1, 3)) if channels is None else channels
    path = _draw_path(rng, sensors, len(stages))
    orders = rng.uniform(1.3, 9.7, 3)
    return DrawnMachine(machine=machine, stages=stages, path=path, bearing_orders=orders)


def _draw_file(rng: np.random.Generator, number: int) -> tuple[Machine, list[ParallelStage]]:
    """Return a random machine and its stages; refuse one that a recording could not show."""
    count, speed_hz = int(rng.integers(1, 3)), rng.uniform(*SPEED_HZ)
    module, order = rng.uniform(*MODULE_MM), 1.0
    stages: list[ParallelStage] = []
    for _ in range(count):
        pinion = int(rng.integers(*PINION_TEETH, endpoint=True))
        gear = int(rng.integers(*GEAR_TEETH, endpoint=True))
        ratio, mesh_hz = gear / pinion, order * pinion * speed_hz
        heard = MESH_HZ[0] <= mesh_hz <= MESH_HZ[1] and 0.6 <= ratio <= LARGEST_RATIO
        if pinion == gear or not heard:
            raise ArgumentError("no pair that is drawn, or a mesh that a recording does not show")
        helix = rng.uniform(5, 20) if rng.random() < 0.2 else 0.0
        stages.append(
            ParallelStage(
                pinion_teeth=pinion,
                gear_teeth=gear,
                module_mm=round(module, 2),
                face_width_mm=round(module * rng.uniform(*WIDTH_MODULES), 1),
                helix_angle_deg=round(helix, 1),
                bore_diameter_pinion_mm=round(0.35 * module * pinion, 1),
                bore_diameter_gear_mm=round(0.3 * module * gear, 1),
            )
        )
        order *= pinion / gear
        module *= rng.uniform(1.1, 1.5)
    if order * speed_hz < SLOWEST_HZ:
        raise ArgumentError("a shaft that a recording is too short for")
    width_mm = float(stages[0].face_width_mm or 0.0)
    radius_m = 0.5e-3 * float(stages[0].module_mm or 0.0) * stages[0].pinion_teeth
    torque_nm = float(f"{rng.uniform(*LOAD_N_PER_MM) * width_mm * radius_m:.4g}")
    point = OperatingPoint(speed_rpm=round(60 * speed_hz, 1), torque_nm=torque_nm, share=1.0)
    name = f"drawn machine {number}"
    return Machine(name=name, operating=(point,), stages=tuple(stages)), stages


def _hide(rng: np.random.Generator, mechanics: StageMechanics, stage: ParallelStage) -> HiddenStage:
    droop, edge = rng.uniform(0.2, 0.6), rng.uniform(0.03, 0.15)
    stiffness = rng.uniform(*STIFFNESS_FACTOR) * mechanics.stiffness.mean_n_per_m
    mass = rng.uniform(*MASS_FACTOR) * mechanics.equivalent_mass_kg
    model = MeshModel(
        length=mechanics.stiffness.contact_ratio,
        overlap=mechanics.stiffness.overlap_ratio,
        droop=droop,
        edge=edge,
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


def _draw_path(rng: np.random.Generator, channels: int, stages: int) -> FloatArray:
    """Draw modes of the housing; return their impulse responses until the slowest is at 1e-4."""
    modes = int(rng.integers(*MODES, endpoint=True))
    low, high = np.log(MODE_BAND_HZ)
    own_hz = np.exp(rng.uniform(low, high, modes))
    damping = rng.uniform(*MODE_DAMPING, modes)
    gain = rng.normal(size=(channels, stages, modes))
    decay = 2 * np.pi * own_hz * damping
    time = np.arange(math.ceil(math.log(1e4) / decay.min() * RATE_HZ)) / RATE_HZ
    turning = 2 * np.pi * own_hz * np.sqrt(1 - damping**2)
    ring = np.exp(-np.outer(decay, time)) * np.sin(np.outer(turning, time))
    return np.asarray((gain * own_hz / RATE_HZ) @ ring)


DURATION_S, SNR_DB = 10.0, 20.0
SPEED_WANDER, LOAD_WANDER, WANDER_HZ = 0.005, 0.03, 0.5
#: Points of a table per period of its highest line.
FINENESS = 16
#: Bearing vibration over that of the gears: of a sound bearing.
SOUND_BEARING = (0.01, 0.08)
#: First order of each shaft over the vibration of the gears: unbalance.
UNBALANCE = 0.02


@dataclass(frozen=True, kw_only=True)
class Condition:
    """State of a machine.

    Parameters
    ----------
    kind : str
        "healthy", "tooth", "eccentricity", "misalignment", "bearing", "pitting" or "wear".
    stage : int
        Stage, from 1; 0 where there is none to name.
    gear : str
        "pinion" or "gear", "" where there is none to name.
    tooth : int or None
        Counted from 1.
    size : float
        Loss of a tooth pair's stiffness ("tooth", and the mean over the teeth of "pitting"), share
        of the stiffness that comes and goes ("misalignment"), added amplitude over static
        deflection ("eccentricity", "wear"), bearing vibration over that of the gears ("bearing").
    seed : int
        Of what else it has that is random.
    """

    kind: str = "healthy"
    stage: int = 0
    gear: str = ""
    tooth: int | None = None
    size: float = 0.0
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class Setting:
    """How a recording was taken.

    Parameters
    ----------
    load, speed, gain : float
        Load, speed and sensor gain over nominal.
    warmth : float
        Relative change of the housing's natural frequencies.
    seed : int
        Of noise, wander and the angles at the start.
    duration_s : float
    """

    load: float = 1.0
    speed: float = 1.0
    gain: float = 1.0
    warmth: float = 0.0
    seed: int = 0
    duration_s: float = DURATION_S


@dataclass(frozen=True, kw_only=True, eq=False)
class Taken:
    """A recording, and the angle of shaft 1 in it.

    Parameters
    ----------
    recording : Recording
    turns : ndarray
        Angle of shaft 1 at every sample [turns], since tooth 1 of every gear entered contact.
    """

    recording: Recording
    turns: FloatArray

    def turns_at(self, time_s: float) -> float:
        """Return the angle of shaft 1 [turns] at a time, straight on beyond the ends."""
        samples = np.arange(len(self.turns))
        place = time_s * self.recording.sampling_rate_hz
        return float(scipy.interpolate.make_interp_spline(samples, self.turns, k=1)(place))


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnMachine:
    """A machine file and what it hides; remembers the motions that it has solved for.

    Parameters
    ----------
    machine : Machine
    stages : tuple of HiddenStage
    path : ndarray, shape (channels, stages, taps)
        Impulse responses from the meshes to the sensors.
    bearing_orders : ndarray
        Impacts and tones of rolling bearings, as orders of shaft 1, of no gear.
    """

    machine: Machine
    stages: tuple[HiddenStage, ...]
    path: FloatArray
    bearing_orders: FloatArray
    _tables: dict[Any, ComplexArray] = field(default_factory=dict, init=False, repr=False)

    @property
    def speed_hz(self) -> float:
        """Nominal speed of shaft 1 [Hz]."""
        return self.machine.operating[0].shaft1_hz

    @property
    def shaft_orders(self) -> FloatArray:
        """Turns of every shaft per turn of shaft 1."""
        ratios = [stage.gears[0].teeth / stage.gears[1].teeth for stage in self.stages]
        return np.asarray(np.cumprod([1.0, *ratios]), dtype=np.float64)

    def take(self, condition: Condition, setting: Setting) -> Taken:
        """Make a recording.

        Parameters
        ----------
        condition : Condition
        setting : Setting

        Returns
        -------
        Taken
            Channels a1, a2, ... [m/s2], and a tachometer of shaft 1 that tells its whole turns.
        """
        rng = np.random.default_rng([setting.seed, 11])
        count = round(setting.duration_s * RATE_HZ)
        # the path has to ring up before the recording begins
        lead = self.path.shape[-1]
        speed = self.speed_hz * setting.speed
        wander = _wander(rng, count + lead, SPEED_WANDER)
        turns = rng.uniform(0, 1000) + np.cumsum(speed * (1 + wander)) / RATE_HZ
        load = setting.load * (1 + _wander(rng, count + lead, LOAD_WANDER))
        forces = self._forces(condition, setting, turns, load)
        forces[0] += self._impacts(condition, turns, forces[0], rng)
        path, taps = self.path, np.arange(lead)
        if setting.warmth:
            warmer = np.minimum((1 + setting.warmth) * taps, lead - 1)
            path = scipy.interpolate.make_interp_spline(taps, path, axis=-1)(warmer)
        heard = scipy.signal.oaconvolve(forces[None], path, mode="valid", axes=-1)
        vibration, turns = np.asarray(heard.sum(axis=1)[:, 1:]), turns[lead:]
        vibration += self._tones(condition, turns, vibration, rng)
        for row in vibration:
            row += _noise(rng, count, float(np.std(row)) * 10 ** (-SNR_DB / 20))
        pulses = tacho_pulses(turns, RATE_HZ, np.full(count, speed), 5.0, 0.1)
        sensors = range(1, len(vibration) + 1)
        recording = Recording(
            samples=np.vstack([setting.gain * vibration, pulses]),
            sampling_rate_hz=RATE_HZ,
            channel_names=(*(f"a{n}" for n in sensors), "tacho"),
            channel_kinds=(*("vibration" for _ in sensors), "tacho"),
            origin=f"{self.machine.name}, {condition.kind}",
        )
        return Taken(recording=recording, turns=turns)

    def _forces(
        self, condition: Condition, setting: Setting, turns: FloatArray, load: FloatArray
    ) -> FloatArray:
        """Dynamic forces of the stages [N]."""
        forces = np.zeros((len(self.stages), len(turns)))
        # motions change little with the speed: those of the nearest half per cent do
        solved = round(200 * setting.speed) / 200
        for number, stage in enumerate(self.stages):
            phase = turns * self.shaft_orders[number] * stage.gears[0].teeth
            for side, gear in enumerate(stage.gears):
                own = (condition.stage, condition.gear) == (number + 1, GEARS[side])
                table = self._table(number, side, solved, condition if own else Condition())
                grid = np.arange(len(table)) / len(table)
                force = np.interp(phase / gear.teeth, grid, table, period=1.0)
                forces[number] += stage.mechanics.force_n * load * force.real + force.imag
        return forces

    def _table(self, number: int, side: int, speed: float, condition: Condition) -> ComplexArray:
        """Force of one gear's marks over its turn: over static force, and 1j that of errors [N]."""
        key = (number, side, speed, condition)
        if key not in self._tables:
            stage = self.stages[number]
            model, teeth = stage.model, stage.gears[side].teeth
            model = replace(model, mesh_hz=speed * model.mesh_hz)
            lines = model.motion(teeth, *gear_marks(stage, side, model, condition))
            if side == 1:
                # the mesh itself is heard once, with the pinion
                lines[0] -= model.motion(teeth)[0]
            gear_hz = model.mesh_hz / teeth
            top = min(math.floor(HIGHEST_HZ / gear_hz), lines.shape[1] - 1)
            size = 1 << math.ceil(math.log2(FINENESS * top))
            weight = model.mass_kg * (2 * np.pi * gear_hz * np.arange(top + 1)) ** 2
            one, two = np.fft.irfft(weight * lines[:, : top + 1], size, norm="forward")
            self._tables[key] = one + 1j * two
        return self._tables[key]

    def _impacts(
        self, condition: Condition, turns: FloatArray, force: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Impacts of a rolling bearing on the first stage's force; they slip a little."""
        share, order = _bearing(condition, rng), self.bearing_orders[0]
        places = np.arange(math.ceil(order * turns[0]), math.floor(order * turns[-1]))
        places = np.sort(places + rng.normal(0, 0.02, len(places)))
        index = np.searchsorted(turns, places / order)
        train = np.zeros(len(turns))
        train[index[index < len(turns)]] = 1.0
        return train * (share * float(np.std(force)) / math.sqrt(max(train.mean(), 1e-12)))

    def _tones(
        self, condition: Condition, turns: FloatArray, heard: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Tones of bearings, and the first orders of the shafts."""
        total, size = np.zeros_like(heard), np.std(heard, axis=1)
        weights = [_bearing(condition, rng)] * 2 + [UNBALANCE] * len(self.shaft_orders)
        orders = [*self.bearing_orders[1:], *self.shaft_orders]
        for order, weight in zip(orders, weights, strict=True):
            wave = np.sin(2 * np.pi * (order * turns + rng.random()))
            total += (weight * size * rng.uniform(0.5, 1.5, len(size)))[:, None] * wave
        return total


def _bearing(condition: Condition, rng: np.random.Generator) -> float:
    """Draw the vibration of a bearing over that of the gears."""
    share = float(rng.uniform(*SOUND_BEARING))
    return condition.size if condition.kind == "bearing" else share


def gear_marks(
    stage: HiddenStage, side: int, model: MeshModel, condition: Condition
) -> tuple[FloatArray, FloatArray | float]:
    """Return the displacement [m] and lost stiffness [N/m] of one gear over its turn.

    Parameters
    ----------
    stage : HiddenStage
    side : {0, 1}
        Pinion or gear.
    model : MeshModel
        The mesh at the speed of the recording.
    condition : Condition
        Of this gear.
    """
    gear = stage.gears[side]
    rng = np.random.default_rng([condition.seed, 12])
    whole = model.wave(np.ones(gear.teeth))
    deflection = stage.mechanics.force_n / model.stiffness_n_per_m
    runout = np.fft.irfft(np.append(0j, gear.runout_m / 2), len(whole), norm="forward")
    error = runout + model.wave(gear.pitch_m) / whole
    phase = np.arange(len(whole)) / model.points
    angle = 2 * np.pi * phase / gear.teeth
    loss: FloatArray | float = 0.0
    if condition.kind == "tooth" and condition.tooth is not None:
        own = np.zeros(gear.teeth)
        own[condition.tooth - 1] = condition.size
        loss = model.wave(own)
    elif condition.kind == "pitting":
        share = np.where(rng.random(gear.teeth) < 0.6, rng.uniform(0, 2, gear.teeth), 0.0)
        own = np.minimum(condition.size * share / max(float(share.mean()), 0.1), 0.9)
        loss = model.wave(own, band=0.4)
    elif condition.kind == "misalignment":
        loss = condition.size * whole * (0.5 + 0.5 * np.cos(angle - rng.uniform(0, 2 * np.pi)))
    elif condition.kind == "eccentricity":
        error = error + condition.size * deflection * np.cos(angle - rng.uniform(0, 2 * np.pi))
    elif condition.kind == "wear":
        # most at root and tip, little at the pitch point: a wave of the mesh, alike on all teeth
        worn = np.abs(np.sin(np.pi * (phase - 0.5 * model.length))) - 2 / np.pi
        error = error - condition.size * deflection * worn
    return error, loss


def _wander(rng: np.random.Generator, count: int, deviation: float) -> FloatArray:
    """Slow random departure from the mean, piecewise straight, with the given deviation."""
    time = np.arange(math.ceil(count / RATE_HZ * 50) + 2) / 50
    band = rng.uniform(0.05, WANDER_HZ, 6)
    wave = np.sin(2 * np.pi * (np.outer(time, band) + rng.random(6))).sum(axis=1)
    wave *= deviation * math.sqrt(2.0 / 6)
    return np.asarray(np.interp(np.arange(count) / RATE_HZ, time, wave), dtype=np.float64)


def _noise(rng: np.random.Generator, count: int, deviation: float) -> FloatArray:
    """White noise with a coloured part, a third of its power."""
    # a short moving sum: more at low frequencies
    coloured = np.convolve(rng.standard_normal(count + 8)[1:], np.full(8, 8**-0.5), "valid")
    mixed = math.sqrt(2 / 3) * rng.standard_normal(count) + math.sqrt(1 / 3) * coloured
    return np.asarray(deviation * mixed, dtype=np.float64)
