"""Synchronous averages of every gear of a recording, and the signals made of them.

One call gives, gear by gear, one turn of the gear (its exact rotation follows from the tooth
counts), the standard error of every value and every line, and the signals that indicators are
computed of (see `indicators`), with the list of the orders that were taken out.
"""

from __future__ import annotations

import math
from cmath import phase
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import RecordingError
from gearmon.gears.kinematics import Kinematics, Wheel, kinematics
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result
from gearmon.signals.orders.resampling import SynchronousAverage, time_synchronous_average
from gearmon.signals.recording import RecordingLike
from gearmon.signatures.measured.indicators import GearSignals, gear_signals
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, WheelLines
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature, opened


@dataclass(frozen=True, kw_only=True, eq=False)
class GearAverage:
    """One turn of a gear.

    Parameters
    ----------
    average : SynchronousAverage
        Over its turns relative to the carrier (to the housing in a parallel stage).
    signals : GearSignals
        Residual, difference and regular signal at the same angles, without mean.
    numbered : bool
        Whether angle zero is the same position of the gear in every recording.
    """

    average: SynchronousAverage
    signals: GearSignals
    numbered: bool

    @property
    def wheel(self) -> WheelLines:
        """The gear."""
        return self.signals.wheel

    @property
    def angle_turns(self) -> FloatArray:
        """Share of the turn at every value, shape (per_turn,)."""
        return np.arange(float(self.average.per_turn)) / self.average.per_turn

    @property
    def columns(self) -> dict[str, FloatArray]:
        """What is told of every angle, by name, shape (channels, per_turn)."""
        known = {"average": self.average.waveform, "standard_error": self.average.waveform_error}
        made = ("residual", "difference", "regular")
        return known | {name: getattr(self.signals, name) for name in made}


@dataclass(frozen=True, kw_only=True, eq=False)
class GearAverages(Result):
    """Averages of all gears of a recording.

    Parameters
    ----------
    recording : str
        Where it came from.
    channel_names : tuple of str
    units : tuple of (str or None)
    gears : tuple of GearAverage
        Those of which two turns or more were recorded.
    signature : MeasuredSignature
        Speed and meshes.
    notes : tuple of str
        What the reader should know.
    """

    picture = "recording_plots.average_figures"

    recording: str
    channel_names: tuple[str, ...]
    units: tuple[str | None, ...]
    gears: tuple[GearAverage, ...]
    signature: MeasuredSignature
    notes: tuple[str, ...]

    def of(self, stage: int, gear: str) -> GearAverage:
        """Return one gear.

        Raises
        ------
        KeyError
            If it is not among them.
        """
        return {(own.wheel.stage, own.wheel.gear): own for own in self.gears}[stage, gear]

    def rows(self) -> list[dict[str, Any]]:
        """Return all waveforms as rows: gear, angle, channel and the signals."""
        return [
            self._place(own, row)
            | {"angle_turns": angle, "angle_teeth": angle * own.wheel.teeth}
            | {name: _short(values[row, index]) for name, values in own.columns.items()}
            for own in self.gears
            for row in range(len(self.channel_names))
            for index, angle in enumerate(own.angle_turns.tolist())
        ]

    def line_rows(self) -> list[dict[str, Any]]:
        """Return all lines as rows, with their standard errors and what they count as."""
        return [
            self._place(own, row)
            | {"multiple": number, "order": number * own.average.rotation_order}
            | {"amplitude": _short(abs(value)), "phase_deg": _short(math.degrees(phase(value)))}
            | {"standard_error": _short(own.average.line_error[row, number])}
            | {"part": own.signals.part[number]}
            for own in self.gears
            for row, lines in enumerate(own.average.lines.tolist())
            for number, value in enumerate(lines)
            if number
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return what was averaged and taken out, and how large it is, in built-in types."""
        averages = []
        for own in self.gears:
            average, wheel = own.average, own.wheel
            told = {name: getattr(wheel, name) for name in ("stage", "gear", "teeth", "shaft")}
            names = ("rotation_order", "turns", "per_turn")
            told |= {name: getattr(average, name) for name in names} | {"numbered": own.numbered}
            told["channels"] = [
                {"channel": channel, "unit": self.units[row] or ""}
                | {f"{name}_rms": _rms(name, values[row]) for name, values in own.columns.items()}
                for row, channel in enumerate(self.channel_names)
            ]
            removed = own.signals.removed.items()
            orders = {name: [n * wheel.order for n in taken] for name, taken in removed}
            averages.append(told | {"removed_orders": orders})
        return {"averages": averages, "warnings": list(self.notes)}

    def _place(self, own: GearAverage, row: int) -> dict[str, Any]:
        channel, unit = self.channel_names[row], self.units[row] or ""
        wheel = own.wheel
        return {"stage": wheel.stage, "gear": wheel.gear, "channel": channel, "unit": unit}


def gear_averages(
    recording: RecordingLike,
    machine: MachineLike,
    *,
    sampling_rate_hz: float | None = None,
    unit: str | None = None,
    signature: MeasuredSignature | None = None,
    per_turn: int | None = None,
) -> GearAverages:
    """Average a recording over the turns of every gear of its machine.

    Parameters
    ----------
    recording : str, Path, array, DataFrame or Recording
        Vibration channels, and perhaps a tacho channel.
    machine : Machine, path or dict
        Tooth counts: they give the rotations of output shafts, planets and all between as exact
        ratios.
    sampling_rate_hz, unit
        Of an array, or where the recording does not state them: as of `gearmon.read_recording`.
    signature : MeasuredSignature, optional
        Of the same recording, if it is at hand: its angle track is used.
    per_turn : int, optional
        Values a turn; by default as many as keep the whole bandwidth.

    Returns
    -------
    GearAverages

    Raises
    ------
    GearmonError
        If the recording cannot be used.

    Examples
    --------
    >>> averages = gearmon.gear_averages(new, machine)
    >>> [(own.wheel.gear, own.wheel.teeth) for own in averages.gears]
    [('pinion', 23), ('gear', 57)]
    """
    machine = load_machine(machine)
    train = kinematics(machine)
    recording = opened(recording, machine, sampling_rate_hz, unit)
    found = measure_signature(recording, machine) if signature is None else signature
    vibration = recording.vibration()
    rate, track = vibration.sampling_rate_hz, found.track
    notes = list(found.notes)
    if not found.found:
        notes.append("no mesh found: the speed, and with it every average, is not to be relied on")
    # gears of one shaft share an average
    averaged = cache(
        partial(time_synchronous_average, vibration.samples, rate, track, per_turn=per_turn)
    )
    gears = []
    for mesh in train.meshes:
        for wheel in mesh.wheels:
            turning = wheel.exact_relative
            try:
                average = averaged(rotation_order=turning)
            except RecordingError:
                notes.append(
                    f"{wheel.gear} of stage {mesh.stage}: fewer than two turns were recorded, it "
                    "has no average"
                )
                continue
            lines = wheel_lines(mesh.stage, wheel, train, average.top)
            signals = gear_signals(average.lines, lines, per_turn=average.per_turn)
            # a once-a-turn pulse on shaft 1 tells the position of its own gears only
            numbered = track.indexed and turning == 1
            gears.append(GearAverage(average=average, signals=signals, numbered=numbered))
    return GearAverages(
        recording=recording.origin,
        channel_names=vibration.channel_names,
        units=vibration.units,
        gears=tuple(gears),
        signature=found,
        notes=tuple(notes),
    )


def wheel_lines(stage: int, wheel: Wheel, train: Kinematics, top: int) -> WheelLines:
    """Return every multiple of a gear's rotation, and which of them are harmonics of a mesh.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    wheel : Wheel
        The gear.
    train : Kinematics
        Its drive train: a gear's turn may also hold mesh harmonics of other stages.
    top : int
        Highest multiple.

    Returns
    -------
    WheelLines
        Of lines 0 to `top` of an average: line n is multiple n.
    """
    number = np.arange(1, top + 1)
    mesh = np.zeros(top, dtype=bool)
    for other in train.meshes:
        # multiple n is harmonic k of that mesh with a whole k: n divides by the reduced numerator
        ratio = other.exact / wheel.exact_relative
        harmonic = number % ratio.numerator == 0
        if all(own.exact_relative != wheel.exact_relative for own in other.wheels):
            # of a mesh elsewhere only those that are looked at: it may be slower than this gear
            harmonic &= number <= int(MESH_HARMONICS * ratio)
        mesh |= harmonic
    return WheelLines.of(stage, wheel, number=number, lines=number, mesh=mesh)


def _short(value: float) -> float:
    """Return a value to seven digits: tables of waveforms are long."""
    return float(f"{value:.7g}")


def _rms(name: str, values: FloatArray) -> float:
    """Return the size of a signal without its mean, or of its errors."""
    centred = values if name == "standard_error" else values - values.mean()
    return float(np.sqrt(np.mean(centred**2)))
