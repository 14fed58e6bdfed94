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
    HIGHEST_HZ,
    RATE_HZ,
    ComplexArray,
    DrawnMachine,
    HiddenStage,
    MeshModel,
)
from gearmon.errors import check_word
from gearmon.signals.recording import Recording
from gearmon.simulation.vibration import tacho_pulses

FloatArray = NDArray[np.float64]

DURATION_S, SNR_DB = 10.0, 20.0
SPEED_WANDER, LOAD_WANDER, WANDER_HZ = 0.005, 0.03, 0.5
#: Points of a table per period of its highest line.
FINENESS = 16
#: Bearing vibration over that of the gears: of a sound bearing.
SOUND_BEARING = (0.01, 0.08)
#: First order of each shaft over the vibration of the gears: unbalance.
UNBALANCE = 0.02
CONDITIONS = ("healthy", "tooth", "eccentricity", "misalignment", "bearing", "pitting", "wear")


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
        check_word("condition ", self.kind, CONDITIONS)


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
class Bench:
    """Makes recordings of one machine; remembers the motions that it has solved for.

    Parameters
    ----------
    drawn : DrawnMachine
    """

    drawn: DrawnMachine
    _tables: dict[tuple[int, int, float, Condition], ComplexArray] = field(
        default_factory=dict, repr=False
    )

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
        from scipy.signal import oaconvolve

        rng = np.random.default_rng([setting.seed, 11])
        count = round(setting.duration_s * RATE_HZ)
        impulse = self.drawn.path.impulse(RATE_HZ)
        # the path has to ring up before the recording begins
        lead = impulse.shape[-1]
        speed = self.drawn.speed_hz * setting.speed
        wander = _wander(rng, count + lead, SPEED_WANDER)
        turns = rng.uniform(0, 1000) + np.cumsum(speed * (1 + wander)) / RATE_HZ
        load = setting.load * (1 + _wander(rng, count + lead, LOAD_WANDER))
        forces = self._forces(condition, setting, turns, load)
        forces[0] += self._impacts(condition, turns, forces[0], rng)
        heard = oaconvolve(forces[None], impulse, mode="valid", axes=-1)
        vibration, turns = np.asarray(heard.sum(axis=1)[:, 1:]), turns[lead:]
        vibration += self._tones(condition, turns, vibration, rng)
        for row in vibration:
            row += _noise(rng, count, float(np.std(row)) * 10 ** (-SNR_DB / 20))
        rows = [*(setting.gain * vibration)]
        names, kinds = [f"a{n + 1}" for n in range(len(rows))], ["vibration"] * len(rows)
        if setting.tacho:
            rows.append(tacho_pulses(turns, RATE_HZ, np.full(count, speed), 5.0, 0.1))
            names, kinds = [*names, "tacho"], [*kinds, "tacho"]
        recording = Recording(
            samples=np.array(rows),
            sampling_rate_hz=RATE_HZ,
            channel_names=tuple(names),
            channel_kinds=tuple(kinds),
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
            phase = shaft * stage.gears[0].teeth
            for side, gear in enumerate(stage.gears):
                table = self._table(number, side, solved, _own(condition, number, side))
                grid = np.arange(len(table)) / len(table)
                force = np.interp(phase / gear.teeth, grid, table, period=1.0)
                forces[number] += stage.mechanics.force_n * load * force.real + force.imag
            shaft = phase / stage.gears[1].teeth
        return forces

    def _table(self, number: int, side: int, speed: float, condition: Condition) -> ComplexArray:
        """Force of one gear's marks over its turn: over static force, and 1j that of errors [N]."""
        key = (number, side, speed, condition)
        if key not in self._tables:
            stage = self.drawn.stages[number]
            model, teeth = stage.model, stage.gears[side].teeth
            model = replace(model, mesh_hz=speed * model.mesh_hz)
            per_force, of_errors = model.motion(teeth, *gear_marks(stage, side, model, condition))
            if side == 1:
                # the mesh itself is heard once, with the pinion
                per_force = per_force - model.motion(teeth)[0]
            self._tables[key] = _force_over_turn(model, teeth, per_force, of_errors)
        return self._tables[key]

    def _impacts(
        self, condition: Condition, turns: FloatArray, force: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Impacts of a rolling bearing on the first stage's force; they slip a little."""
        share, order = _bearing(condition, rng), self.drawn.bearing_orders[0]
        places = np.arange(math.ceil(order * turns[0]), math.floor(order * turns[-1]))
        places = np.sort(places + rng.normal(0, 0.02, len(places)))
        index = np.searchsorted(turns, places / order)
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
        total, size = np.zeros_like(vibration), np.std(vibration, axis=1)
        share = _bearing(condition, rng)
        ratios = [stage.gears[0].teeth / stage.gears[1].teeth for stage in self.drawn.stages]
        lines = [(order, share) for order in self.drawn.bearing_orders[1:]]
        lines += [(order, UNBALANCE) for order in np.cumprod([1.0, *ratios])]
        for order, weight in lines:
            wave = np.sin(2 * np.pi * (order * turns + rng.random()))
            total += (weight * size * rng.uniform(0.5, 1.5, len(size)))[:, None] * wave
        return total


def _bearing(condition: Condition, rng: np.random.Generator) -> float:
    """Draw the vibration of a bearing over that of the gears."""
    share = float(rng.uniform(*SOUND_BEARING))
    return condition.size if condition.kind == "bearing" else share


def _own(condition: Condition, number: int, side: int) -> Condition:
    """Return the condition as far as it touches one gear."""
    if condition.stage == number + 1 and condition.gear == GEARS[side]:
        return condition
    return Condition()


def gear_marks(
    stage: HiddenStage, side: int, model: MeshModel, condition: Condition
) -> tuple[FloatArray, FloatArray | None]:
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
    error = gear.runout(model.points) + model.wave(gear.pitch_m) / whole
    phase = np.arange(len(whole)) / model.points
    angle = 2 * np.pi * phase / gear.teeth
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
        # most at root and tip, little at the pitch point: a wave of the mesh, alike on all teeth
        worn = np.abs(np.sin(np.pi * (phase - 0.5 * model.shape.length))) - 2 / np.pi
        error = error - condition.size * deflection * worn
    return error, loss


def _force_over_turn(
    model: MeshModel, teeth: int, per_force: ComplexArray, of_errors: ComplexArray
) -> ComplexArray:
    gear_hz = model.mesh_hz / teeth
    top = min(math.floor(HIGHEST_HZ / gear_hz), len(per_force) - 1)
    size = 1 << math.ceil(math.log2(FINENESS * top))
    weight = model.mass_kg * (2 * np.pi * gear_hz * np.arange(top + 1)) ** 2
    one, two = (
        np.fft.irfft(weight * lines[: top + 1], size, norm="forward")
        for lines in (per_force, of_errors)
    )
    return np.asarray(one + 1j * two)


def _wander(rng: np.random.Generator, count: int, deviation: float) -> FloatArray:
    """Slow random departure from the mean, piecewise straight, with the given deviation."""
    time = np.arange(math.ceil(count / RATE_HZ * 50) + 2) / 50
    band = rng.uniform(0.05, WANDER_HZ, 6)
    wave = np.sin(2 * np.pi * (np.outer(time, band) + rng.random(6))).sum(axis=1)
    wave *= deviation * math.sqrt(2.0 / 6)
    return np.asarray(np.interp(np.arange(count) / RATE_HZ, time, wave), dtype=np.float64)


def _noise(rng: np.random.Generator, count: int, deviation: float) -> FloatArray:
    """White noise with a coloured part, a third of its power."""
    white = rng.standard_normal(count + 8)
    # a short moving sum: more at low frequencies, without a recursion
    total = np.cumsum(white)
    coloured = (total[8:] - total[:-8]) / math.sqrt(8)
    mixed = math.sqrt(2 / 3) * rng.standard_normal(count) + math.sqrt(1 / 3) * coloured
    return np.asarray(deviation * mixed, dtype=np.float64)
