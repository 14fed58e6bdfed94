"""Synchronous averages of every gear of a recording, and the signals made of them.

One call gives, gear by gear, one turn of the gear (its exact rotation follows from the tooth
counts), the standard error of every value and every line, and the residual, difference and regular
signals with the list of the orders that were taken out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from gearmon.errors import RecordingError
from gearmon.gears.kinematics import Kinematics, Wheel, kinematics
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result
from gearmon.signals.array_types import FloatArray
from gearmon.signals.bad_samples import sound_part
from gearmon.signals.orders import whole_turns
from gearmon.signals.orders.averages import SynchronousAverage, time_synchronous_average
from gearmon.signals.recording import Recording, RecordingLike, read_recording
from gearmon.signatures.measured.gear_signals import GearSignals, gear_signals
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, WheelLines
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature


@dataclass(frozen=True, kw_only=True, eq=False)
class GearAverage:
    """One turn of a gear.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : str
        "pinion", "gear", "sun", "planet" or "ring".
    teeth : int
        Teeth.
    shaft : int or None
        Shaft it turns with.
    average : SynchronousAverage
        Over its turns relative to the carrier (to the housing in a parallel stage).
    signals : GearSignals
        Residual, difference and regular signal at the same angles, without mean.
    numbered : bool
        Whether angle zero is the same position of the gear in every recording.
    """

    stage: int
    gear: str
    teeth: int
    shaft: int | None
    average: SynchronousAverage
    signals: GearSignals
    numbered: bool

    @property
    def name(self) -> str:
        """The gear in words."""
        return f"{self.gear} of stage {self.stage}"

    @property
    def angle_turns(self) -> FloatArray:
        """Share of the turn at every value, shape (per_turn,)."""
        return np.arange(float(self.average.per_turn)) / self.average.per_turn

    @property
    def removed_orders(self) -> dict[str, tuple[float, ...]]:
        """Orders of shaft 1 taken out to get the residual and the difference signal."""
        return self.signals.removed_orders


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
        for own in self.gears:
            if (own.stage, own.gear) == (stage, gear):
                return own
        raise KeyError((stage, gear))

    def rows(self) -> list[dict[str, Any]]:
        """Return all waveforms as rows: gear, angle, channel and the signals."""
        return [row for own in self.gears for row in self._waveform_rows(own)]

    def line_rows(self) -> list[dict[str, Any]]:
        """Return all lines as rows, with their standard errors and what they count as."""
        return [row for own in self.gears for row in self._line_rows(own)]

    def to_dict(self) -> dict[str, Any]:
        """Return what was averaged and taken out, and how large it is, in built-in types."""
        return {
            "averages": [self._brief(own) for own in self.gears],
            "warnings": list(self.notes),
        }

    def _waveform_rows(self, own: GearAverage) -> Iterator[dict[str, Any]]:
        columns = {
            "average": own.average.waveform,
            "standard_error": own.average.waveform_error,
            "residual": own.signals.residual,
            "difference": own.signals.difference,
            "regular": own.signals.regular,
        }
        for row in range(len(self.channel_names)):
            for index, angle in enumerate(own.angle_turns.tolist()):
                turned = {"angle_turns": angle, "angle_teeth": angle * own.teeth}
                yield (
                    self._place(own, row)
                    | turned
                    | {name: _short(values[row, index]) for name, values in columns.items()}
                )

    def _line_rows(self, own: GearAverage) -> Iterator[dict[str, Any]]:
        lines, signals = own.average.lines, own.signals
        parts = dict.fromkeys(signals.shaft, "shaft") | dict.fromkeys(signals.mesh, "mesh")
        parts |= dict.fromkeys(signals.first, "first sideband")
        for row in range(len(self.channel_names)):
            for number in range(1, own.average.top + 1):
                value = complex(lines[row, number])
                yield self._place(own, row) | {
                    "multiple": number,
                    "order": number * own.average.rotation_order,
                    "amplitude": _short(abs(value)),
                    "phase_deg": _short(math.degrees(math.atan2(value.imag, value.real))),
                    "standard_error": _short(own.average.line_error[row, number]),
                    "part": parts.get(number, "difference"),
                }

    def _place(self, own: GearAverage, row: int) -> dict[str, Any]:
        channel, unit = self.channel_names[row], self.units[row] or ""
        return {"stage": own.stage, "gear": own.gear, "channel": channel, "unit": unit}

    def _brief(self, own: GearAverage) -> dict[str, Any]:
        average, signals = own.average, own.signals
        return {
            "stage": own.stage,
            "gear": own.gear,
            "teeth": own.teeth,
            "shaft": own.shaft,
            "rotation_order": average.rotation_order,
            "turns": average.turns,
            "per_turn": average.per_turn,
            "numbered": own.numbered,
            "channels": [
                {
                    "channel": channel,
                    "unit": self.units[row] or "",
                    "average_rms": float(np.std(average.waveform[row])),
                    "standard_error_rms": float(np.sqrt(np.mean(average.waveform_error[row] ** 2))),
                    "residual_rms": float(np.std(signals.residual[row])),
                    "difference_rms": float(np.std(signals.difference[row])),
                    "regular_rms": float(np.std(signals.regular[row])),
                }
                for row, channel in enumerate(self.channel_names)
            ],
            "removed_orders": {name: list(taken) for name, taken in own.removed_orders.items()},
        }


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
    >>> [(own.gear, own.teeth) for own in averages.gears]
    [('pinion', 23), ('gear', 57)]
    """
    machine = load_machine(machine)
    train = kinematics(machine)
    recording = sound_part(
        read_recording(recording, sampling_rate_hz, sensors=machine.sensors, unit=unit)
    )
    found = measure_signature(recording, machine) if signature is None else signature
    vibration = recording.vibration()
    rate, track = vibration.sampling_rate_hz, found.track
    notes = list(found.notes)
    if not found.found:
        notes.append("no mesh found: the speed, and with it every average, is not to be relied on")
    averages: dict[Fraction, SynchronousAverage] = {}
    gears = []
    for mesh in train.meshes:
        for wheel in mesh.wheels:
            turning = wheel.exact_relative
            try:
                if turning not in averages:
                    _check_turns(vibration, found, turning)
                    averages[turning] = time_synchronous_average(
                        vibration.samples, rate, track, rotation_order=turning, per_turn=per_turn
                    )
            except RecordingError:
                notes.append(
                    f"{wheel.gear} of stage {mesh.stage}: fewer than two turns were recorded, it "
                    "has no average"
                )
                continue
            gears.append(_gear(mesh.stage, wheel, train, averages[turning], track.indexed))
    return GearAverages(
        recording=recording.origin,
        channel_names=vibration.channel_names,
        units=vibration.units,
        gears=tuple(gears),
        signature=found,
        notes=tuple(notes),
    )


def _check_turns(vibration: Recording, found: MeasuredSignature, turning: Fraction) -> None:
    """Raise before anything is computed if there are fewer than two turns."""
    shaft = found.track.of_shaft(float(turning))
    if whole_turns(vibration.samples.shape[-1], vibration.sampling_rate_hz, shaft)[1] < 2:
        raise RecordingError("fewer than two turns")


def _gear(
    stage: int, wheel: Wheel, train: Kinematics, average: SynchronousAverage, indexed: bool
) -> GearAverage:
    lines = wheel_lines(stage, wheel, train, average.top)
    return GearAverage(
        stage=stage,
        gear=wheel.gear,
        teeth=wheel.teeth,
        shaft=wheel.shaft,
        average=average,
        signals=gear_signals(average.lines, lines, per_turn=average.per_turn),
        # a once-a-turn pulse on shaft 1 tells the position of its own gears only
        numbered=indexed and wheel.exact_relative == 1,
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
    return WheelLines.of(stage, wheel, number, number, mesh)


def _short(value: float) -> float:
    """Return a value to seven digits: tables of waveforms are long."""
    return float(f"{value:.7g}")
