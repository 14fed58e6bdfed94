"""Synchronous averages of every gear of a recording, and the signals made of them.

One call gives, gear by gear, one turn of the gear (its exact rotation follows from the tooth
counts), the standard error of every value and every line, and the signals that indicators are
computed of, with the list of the orders that were taken out:

- the *residual* is the average less the harmonics 1 and 2 of the gear's rotation and less every
  mesh harmonic on it, also of other meshes;
- the *difference* is the residual less the first sidebands of all these mesh harmonics;
- the *regular* signal is what was taken out to get the difference;
- the *envelope* is that of the average in a band about the first mesh harmonic.

Of the lines of a whole machine an average holds the multiples of the rotation that lie up to half a
mesh order from one of the first eight mesh harmonics, as far as the sampling rate reaches.

References
----------
Lebold, McClintic, Campbell, Byington and Maynard, MFPT 54 (2000) 623-634; Zakrajsek, Townsend and
Decker, NASA TM-105950 (1993).
"""

from __future__ import annotations

import math
from cmath import phase
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, RecordingError
from gearmon.gears.kinematics import Kinematics, Wheel, kinematics
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result
from gearmon.signals.orders.resampling import SynchronousAverage, one_turn, time_synchronous_average
from gearmon.signals.recording import RecordingLike
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, NEAR_SIDEBANDS, WheelLines
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature, opened

#: Harmonics of the rotation that count as the shaft's own.
SHAFT_HARMONICS = 2
# Samples of a turn over its highest multiple: sums of eighth powers are then exact.
_OVERSAMPLING = 8.5


@dataclass(frozen=True, kw_only=True, eq=False)
class GearSignals:
    """Signals over one turn of a gear, and lines about its mesh.

    Parameters
    ----------
    wheel : WheelLines
        The gear.
    average, residual, difference, regular, envelope : ndarray of float, shape (channels, n)
        See the module; without mean, but for the envelope.
    mesh_amplitude : ndarray of float, shape (channels, harmonics)
        Peak amplitudes of the gear's own mesh harmonics.
    fundamental : ndarray of float, shape (channels,)
        That of the first.
    first_sidebands : ndarray of float, shape (channels, 2)
        Peak amplitudes of the lines -1 and +1 of the first mesh harmonic; 0 where not measured.
    near_sidebands : ndarray of float, shape (channels, 12)
        The same of -6 to +6.
    part : tuple of str
        What each multiple of the rotation, from 0, counts as: "mesh", "shaft", "first sideband" or
        "difference".
    band : (int, int)
        Lowest and highest multiple of the envelope's band.
    """

    wheel: WheelLines
    average: FloatArray
    residual: FloatArray
    difference: FloatArray
    regular: FloatArray
    envelope: FloatArray
    mesh_amplitude: FloatArray
    fundamental: FloatArray
    first_sidebands: FloatArray
    near_sidebands: FloatArray
    part: tuple[str, ...]
    band: tuple[int, int]

    @property
    def removed(self) -> dict[str, tuple[int, ...]]:
        """Multiples of the rotation taken out of the average, by the signal that was left."""
        residual = ("mesh", "shaft")
        every = {"residual": residual, "difference": (*residual, "first sideband")}
        return {name: self.multiples(*parts) for name, parts in every.items()}

    def multiples(self, *parts: str) -> tuple[int, ...]:
        """Return the multiples of the rotation that count as one of these parts."""
        return tuple(number for number, part in enumerate(self.part) if part in parts)


def gear_signals(
    mean: ComplexArray, wheel: WheelLines, *, per_turn: int | None = None
) -> GearSignals:
    """Build the signals of a gear from the lines of its machine.

    Parameters
    ----------
    mean : ndarray of complex, shape (channels, lines)
        Complex peak amplitudes of all lines of the plan.
    wheel : WheelLines
        Which of them belong to the gear.
    per_turn : int, optional
        Values a turn, more than twice the highest multiple; by default so many that sums of eighth
        powers over them are exact.

    Returns
    -------
    GearSignals

    Raises
    ------
    ArgumentError
        If `per_turn` is too small for the lines.
    """
    number, teeth = wheel.number, wheel.teeth
    top = int(number.max(initial=0))
    if per_turn is None:
        per_turn = 1 << int(np.ceil(np.log2(_OVERSAMPLING * (top + 1))))
    elif per_turn <= 2 * top:
        raise ArgumentError(
            f"per_turn={per_turn} must be above {2 * top}, twice the highest multiple"
        )
    spectrum = np.zeros((len(mean), max(top, teeth + NEAR_SIDEBANDS) + 1), dtype=complex)
    spectrum[:, number] = mean[:, wheel.lines]
    beside = np.isin(number, np.add.outer([-1, 1], number[wheel.mesh]))
    chosen = (wheel.mesh, number <= SHAFT_HARMONICS, beside)
    part = np.full(top + 1, "difference", dtype="U16")
    part[number] = np.select(chosen, ("mesh", "shaft", "first sideband"), "difference")
    near = [teeth + r for r in range(-NEAR_SIDEBANDS, NEAR_SIDEBANDS + 1) if r and teeth + r > 0]
    known, size = spectrum[:, : top + 1], np.abs(spectrum)
    reach = max(1, min(teeth // 2, teeth - 1))

    def without(*left_out: str) -> FloatArray:
        """Return a turn of all lines but those of some parts."""
        return one_turn(np.where(np.isin(part, left_out), 0.0, known), per_turn)

    within = np.where(np.abs(np.arange(top + 1) - teeth) <= reach, known, 0.0)
    return GearSignals(
        wheel=wheel,
        average=without(),
        residual=without("mesh", "shaft"),
        difference=without("mesh", "shaft", "first sideband"),
        regular=without("difference"),
        envelope=np.abs(np.fft.ifft(within, per_turn, axis=-1, norm="forward")),
        mesh_amplitude=size[:, number[(number % teeth == 0) & (number >= teeth)]],
        fundamental=size[:, teeth],
        first_sidebands=size[:, [teeth - 1, teeth + 1]],
        near_sidebands=size[:, near],
        part=tuple(part.tolist()),
        band=(teeth - reach, teeth + reach),
    )


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
