"""Recordings of random machines for the benchmark of detection, a tenth of a second each.

Motion of the meshes as tables over the turns of their gears, read at the angle that the shafts have
at each sample, made into forces and sent in the time domain through the impulse responses of the
housing: lines that wander with the speed meet its resonances as they do in a machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.benchmark.detection_machines import (
    GEARS,
    DrawnMachine,
    GearMotion,
    HiddenStage,
    MeshModel,
    Turn,
)
from gearmon.errors import ArgumentError
from gearmon.signals.recording import Recording

FloatArray = NDArray[np.float64]

RATE_HZ, DURATION_S, SNR_DB = 20_000.0, 10.0, 20.0
SPEED_WANDER, LOAD_WANDER, WANDER_HZ = 0.005, 0.03, 0.5
#: Below which share of the sampling rate lines are made.
BELOW = 0.46
#: Points of a table per period of its highest line.
FINENESS = 16
#: Bearing vibration over that of the gears: of a sound and of a worn bearing.
SOUND_BEARING, WORN_BEARING = (0.01, 0.08), (0.3, 0.8)
#: First order of each shaft over the vibration of the gears: unbalance.
UNBALANCE = 0.02
CONDITIONS = (
    "healthy",
    "tooth",
    "eccentricity",
    "misalignment",
    "bearing",
    "pitting",
    "wear",
)


@dataclass(frozen=True, kw_only=True)
class Condition:
    """State of a machine.

    Parameters
    ----------
    kind : str
        One of `CONDITIONS`.
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

    def __post_init__(self) -> None:
        if self.kind not in CONDITIONS:
            raise ArgumentError(f"condition {self.kind!r} must be one of {', '.join(CONDITIONS)}")


@dataclass(frozen=True, kw_only=True)
class Setting:
    """How a recording was taken.

    Parameters
    ----------
    load, speed, gain : float
        Load, speed and sensor gain over nominal.
    tacho : bool
    seed : int
        Of noise, wander and the angles at the start.
    duration_s : float
    """

    load: float = 1.0
    speed: float = 1.0
    gain: float = 1.0
    tacho: bool = True
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
        place = time_s * self.recording.sampling_rate_hz
        index = int(np.clip(math.floor(place), 0, len(self.turns) - 2))
        step = self.turns[index + 1] - self.turns[index]
        return float(self.turns[index] + (place - index) * step)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Table:
    """Force of one gear's marks over one turn: what goes with the load, and what does not."""

    per_force: FloatArray
    of_errors: FloatArray

    def at(self, place: FloatArray, force: FloatArray) -> FloatArray:
        """Return the force where `place` is in turns and `force` the static force [N]."""
        size = len(self.per_force) - 1
        at = (place - np.floor(place)) * size
        index = at.astype(np.int64)
        np.minimum(index, size - 1, out=index)
        at -= index
        loaded = self.per_force[index]
        loaded += at * (self.per_force[index + 1] - loaded)
        loaded *= force
        other = self.of_errors[index]
        other += at * (self.of_errors[index + 1] - other)
        return np.asarray(loaded + other)


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """Makes recordings of one machine; remembers the motions that it has solved for.

    Parameters
    ----------
    drawn : DrawnMachine
    rate_hz : float
    """

    drawn: DrawnMachine
    rate_hz: float = RATE_HZ
    _turns: dict[tuple[int, int, float], Turn] = field(default_factory=dict, repr=False)
    _tables: dict[tuple[int, int, float, Condition], _Table] = field(
        default_factory=dict, repr=False
    )
    _paths: dict[int, NDArray[np.complex128]] = field(default_factory=dict, repr=False)

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
        count = round(setting.duration_s * self.rate_hz)
        lead = self.drawn.path.taps(self.rate_hz)
        speed = self.drawn.speed_hz * setting.speed
        # the path has to ring up before the recording begins
        wander = _wander(rng, count + lead, self.rate_hz, SPEED_WANDER)
        turns = rng.uniform(0, 1000) + np.cumsum(speed * (1 + wander)) / self.rate_hz
        load = setting.load * (1 + _wander(rng, count + lead, self.rate_hz, LOAD_WANDER))
        forces = self._forces(condition, setting, turns, load)
        forces[0] += self._impacts(condition, turns, forces[0], rng)
        vibration = self._at_sensors(forces)[:, lead:]
        turns = turns[lead:]
        vibration += self._tones(condition, turns, vibration, rng)
        for row in vibration:
            deviation = float(np.std(row)) * 10 ** (-SNR_DB / 20)
            row += _noise(rng, count, deviation)
        vibration *= setting.gain
        names = tuple(f"a{n + 1}" for n in range(len(vibration)))
        rows, kinds = vibration, ("vibration",) * len(vibration)
        if setting.tacho:
            pulses = _pulses(turns, speed / self.rate_hz)
            rows, names, kinds = np.vstack([rows, pulses]), (*names, "tacho"), (*kinds, "tacho")
        recording = Recording(
            samples=rows,
            sampling_rate_hz=self.rate_hz,
            channel_names=names,
            channel_kinds=kinds,
            origin=f"{self.drawn.machine.name}, {condition.kind}",
        )
        return Taken(recording=recording, turns=turns)

    def _forces(
        self, condition: Condition, setting: Setting, turns: FloatArray, load: FloatArray
    ) -> FloatArray:
        """Dynamic forces of the stages [N]."""
        forces = np.zeros((len(self.drawn.stages), len(turns)))
        shaft = turns
        # motions change little with the speed: those of the nearest half per cent do
        solved = round(200 * setting.speed) / 200
        for number, stage in enumerate(self.drawn.stages):
            static = stage.mechanics.force_n * load
            phase = shaft * stage.gears[0].teeth
            for side, gear in enumerate(stage.gears):
                own = _own(condition, number, side)
                table = self._table(number, side, solved, own)
                forces[number] += table.at(phase / gear.teeth, static)
            shaft = phase / stage.gears[1].teeth
        return forces

    def _table(self, number: int, side: int, speed: float, condition: Condition) -> _Table:
        key = (number, side, speed, condition)
        if key not in self._tables:
            self._tables[key] = self._solved(number, side, speed, condition)
        return self._tables[key]

    def _solved(self, number: int, side: int, speed: float, condition: Condition) -> _Table:
        stage = self.drawn.stages[number]
        turn = self._turn(number, side, speed)
        error, loss = gear_marks(stage, side, turn, condition)
        motion = turn.motion(error, loss)
        if side == 1:
            # the mesh itself is heard once, with the pinion
            healthy = turn.motion().per_force
            motion = replace(motion, per_force=motion.per_force - healthy)
        return _tabled(motion, turn, BELOW * self.rate_hz)

    def _turn(self, number: int, side: int, speed: float) -> Turn:
        key = (number, side, speed)
        if key not in self._turns:
            stage = self.drawn.stages[number]
            model: MeshModel = stage.model(speed, BELOW * self.rate_hz)
            self._turns[key] = model.turn(stage.gears[side].teeth)
        return self._turns[key]

    def _at_sensors(self, forces: FloatArray) -> FloatArray:
        """Send the forces through the housing; the first `taps` samples are not yet right."""
        count = forces.shape[1]
        size = 1 << math.ceil(math.log2(count))
        if count <= 5 * size // 8:
            size = 5 * size // 8
        elif count <= 3 * size // 4:
            size = 3 * size // 4
        if size not in self._paths:
            impulse = self.drawn.path.impulse(self.rate_hz)
            self._paths[size] = np.fft.rfft(impulse, size)
        spectra = np.fft.rfft(forces, size)
        arrived = np.einsum("csf,sf->cf", self._paths[size], spectra)
        return np.asarray(np.fft.irfft(arrived, size)[:, :count])

    def _impacts(
        self, condition: Condition, turns: FloatArray, force: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Impacts of a rolling bearing on the first stage's force; they slip a little."""
        share = rng.uniform(*SOUND_BEARING)
        if condition.kind == "bearing":
            share = condition.size
        order = self.drawn.bearing_orders[0]
        first, last = order * turns[0], order * turns[-1]
        places = np.arange(math.ceil(first), math.floor(last)) + rng.normal(
            0, 0.02, max(0, math.floor(last) - math.ceil(first))
        )
        index = np.searchsorted(turns, np.sort(places) / order)
        train = np.zeros(len(turns))
        train[index[index < len(turns)]] = 1.0
        power = float(np.mean(train * train))
        return train * (share * float(np.std(force)) / math.sqrt(max(power, 1e-12)))

    def _tones(
        self,
        condition: Condition,
        turns: FloatArray,
        vibration: FloatArray,
        rng: np.random.Generator,
    ) -> FloatArray:
        """Tones of bearings, and the first orders of the shafts."""
        total = np.zeros_like(vibration)
        size = np.std(vibration, axis=1)
        share = rng.uniform(*SOUND_BEARING)
        if condition.kind == "bearing":
            share = condition.size
        orders = [float(order) for order in self.drawn.bearing_orders[1:]]
        weights = [share] * len(orders)
        order = 1.0
        for stage in (None, *self.drawn.stages):
            if stage is not None:
                order *= stage.gears[0].teeth / stage.gears[1].teeth
            orders.append(order)
            weights.append(UNBALANCE)
        for line, weight in zip(orders, weights, strict=True):
            wave = np.sin(2 * np.pi * (line * turns + rng.random()))
            total += (weight * size * rng.uniform(0.5, 1.5, len(size)))[:, None] * wave
        return total


def _own(condition: Condition, number: int, side: int) -> Condition:
    """Return the condition as far as it touches one gear."""
    if condition.stage == number + 1 and condition.gear == GEARS[side]:
        return condition
    return Condition()


def gear_marks(
    stage: HiddenStage, side: int, turn: Turn, condition: Condition
) -> tuple[FloatArray, FloatArray | None]:
    """Return the displacement [m] and lost stiffness [N/m] of one gear over its turn.

    Parameters
    ----------
    stage : HiddenStage
    side : {0, 1}
        Pinion or gear.
    turn : Turn
    condition : Condition
        Of this gear.
    """
    gear, model = stage.gears[side], turn.model
    rng = np.random.default_rng([condition.seed, 12])
    whole = model.wave(np.ones(gear.teeth))
    deflection = stage.mechanics.force_n / model.stiffness_n_per_m
    error = gear.runout(model.points) + model.wave(gear.pitch_m) / whole
    angle = 2 * np.pi * np.arange(turn.size) / turn.size
    loss: FloatArray | None = None
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
        phase = np.arange(turn.size) / model.points
        # most at root and tip, little at the pitch point: a wave of the mesh, alike on all teeth
        worn = np.abs(np.sin(np.pi * (phase - 0.5 * model.shape.length))) - 2 / np.pi
        error = error - condition.size * deflection * worn
    return error, loss


def _tabled(motion: GearMotion, turn: Turn, highest_hz: float) -> _Table:
    gear_hz = turn.model.mesh_hz / turn.teeth
    top = min(math.floor(highest_hz / gear_hz), len(motion.per_force) - 1)
    size = 1 << math.ceil(math.log2(FINENESS * top))
    weight = turn.model.mass_kg * (2 * np.pi * gear_hz * np.arange(top + 1)) ** 2
    rows = []
    for lines in (motion.per_force, motion.of_errors):
        wave = np.fft.irfft(weight * lines[: top + 1], size) * size
        rows.append(np.append(wave, wave[0]))
    return _Table(per_force=rows[0], of_errors=rows[1])


def _wander(rng: np.random.Generator, count: int, rate_hz: float, deviation: float) -> FloatArray:
    """Slow random departure from the mean, piecewise straight, with the given deviation."""
    knots = math.ceil(count / rate_hz * 50) + 2
    time = np.arange(knots) / 50
    band = rng.uniform(0.05, WANDER_HZ, 6)
    wave = np.sin(2 * np.pi * (np.outer(time, band) + rng.random(6))).sum(axis=1)
    wave *= deviation * math.sqrt(2.0 / 6)
    return np.asarray(np.interp(np.arange(count) / rate_hz, time, wave), dtype=np.float64)


def _noise(rng: np.random.Generator, count: int, deviation: float) -> FloatArray:
    """White noise with a coloured part, a third of its power."""
    white = rng.standard_normal(count + 8)
    # a short moving sum: more at low frequencies, without a recursion
    total = np.cumsum(white)
    coloured = (total[8:] - total[:-8]) / math.sqrt(8)
    mixed = math.sqrt(2 / 3) * rng.standard_normal(count) + math.sqrt(1 / 3) * coloured
    return np.asarray(deviation * mixed, dtype=np.float64)


def _pulses(turns: FloatArray, turns_per_sample: float) -> FloatArray:
    """One pulse a turn, its flanks crossing half height at the true angle."""
    place = turns - np.floor(turns)
    place = np.where(place > 0.6, place - 1, place) / turns_per_sample
    width = 0.1 / turns_per_sample
    rise, fall = np.clip(0.5 + 0.5 * place, 0, 1), np.clip(0.5 + 0.5 * (place - width), 0, 1)
    return np.asarray(5.0 * (rise - fall))
