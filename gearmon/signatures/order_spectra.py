"""Order spectra and order maps of a recording, counted in turns of any shaft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine
from gearmon.signals.angle import AngleGrid, angle_blocks
from gearmon.signals.recording import Recording
from gearmon.signals.spectrum import amplitude_spectrum
from gearmon.signals.transforms import fast_length
from gearmon.signatures.line_marks import Mark, machine_marks, mark_near
from gearmon.signatures.measured import MeasuredSignature, measure_signature
from gearmon.signatures.recording_spectrum import highest_peaks

FloatArray = NDArray[np.float64]

# Rows of a map; more blocks are averaged in power, so that each row is of equal length.
_MAP_ROWS = 200
_TURNS = 40.0


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderSpectra:
    """Amplitude against order, averaged and along the recording.

    Parameters
    ----------
    recording : str
    shaft : int
        Shaft whose turns the orders count.
    channel_names : tuple of str
    units : tuple of (str or None)
    order : ndarray of float, shape (bins,)
        Cycles a turn of the shaft.
    amplitude : ndarray of float, shape (channels, bins)
        Peak amplitude, root mean square over the blocks.
    map_time_s, map_speed_hz : ndarray of float, shape (rows,)
        Middle of each row of the map [s], and speed of the shaft there [Hz].
    map_amplitude : ndarray of float, shape (rows, channels, bins)
    resolution : float
        Noise bandwidth [orders].
    peaks : tuple of dict
        Highest peaks and the lines of the machine they are near to.
    marks : tuple of Mark
        Lines of the machine.
    signature : MeasuredSignature
        Speed and meshes.
    notes : tuple of str
    """

    recording: str
    shaft: int
    channel_names: tuple[str, ...]
    units: tuple[str | None, ...]
    order: FloatArray
    amplitude: FloatArray
    map_time_s: FloatArray
    map_speed_hz: FloatArray
    map_amplitude: FloatArray
    resolution: float
    peaks: tuple[dict[str, Any], ...]
    marks: tuple[Mark, ...]
    signature: MeasuredSignature
    notes: tuple[str, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return the averaged spectrum as rows, one column a channel."""
        columns = zip(self.channel_names, self.amplitude.tolist(), strict=True)
        named = {"order": self.order.tolist(), **dict(columns)}
        return [dict(zip(named, row, strict=True)) for row in zip(*named.values(), strict=True)]

    def map_rows(self) -> list[dict[str, Any]]:
        """Return the map as rows: time, speed, channel and the amplitude at every order."""
        names = [f"order_{value:.6g}" for value in self.order]
        return [
            {"time_s": float(time), "speed_hz": float(speed), "channel": channel}
            | dict(zip(names, self.map_amplitude[row, column].tolist(), strict=True))
            for row, (time, speed) in enumerate(
                zip(self.map_time_s, self.map_speed_hz, strict=True)
            )
            for column, channel in enumerate(self.channel_names)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the peaks and what they mean, in built-in types."""
        return {
            "recording": self.recording,
            "shaft": self.shaft,
            "speed": self.signature.speed.to_dict(),
            "resolution_orders": self.resolution,
            "peaks": list(self.peaks),
            "lines": [{"name": mark.name, "order": mark.place} for mark in self.marks],
            "warnings": list(self.notes),
        }


def order_spectra(
    recording: Recording,
    machine: Machine,
    shaft: int = 1,
    *,
    top: float | None = None,
    window_name: str = "hann",
    most_peaks: int = 20,
) -> OrderSpectra:
    """Compute order spectrum and order map of every vibration channel.

    Parameters
    ----------
    recording : Recording
    machine : Machine
    shaft : int
        Shaft whose turns the orders count, from 1.
    top : float, optional
        Highest order; by default a tenth above the last mesh harmonic looked at, as far as the
        sampling rate allows.
    window_name : str
        Of the blocks.
    most_peaks : int
        Peaks listed a channel.

    Returns
    -------
    OrderSpectra
        In half-overlapped blocks of 40 turns of the shaft, or a quarter of a short recording.

    Raises
    ------
    GearmonError
        If there is no such shaft, or the recording cannot be used.
    """
    train = kinematics(machine)
    ratio = train.shaft(shaft).order
    signature = measure_signature(recording, machine)
    vibration = recording.vibration()
    rate, track = vibration.sampling_rate_hz, signature.track
    nyquist = 0.5 * rate / float(track.speed_hz.max())
    last = 1.1 * max(8 * mesh.order for mesh in train.meshes)
    highest = min(nyquist, last) if top is None else top * ratio
    if not 0 < highest <= nyquist * (1 + 1e-9):
        raise ArgumentError(f"top={top} orders must lie in (0, {nyquist / ratio:.4g}]")
    grid = AngleGrid.of(vibration.samples.shape[-1], rate, track, highest)
    turns = min(_TURNS / ratio, grid.count / grid.per_turn / 4)
    block = min(grid.count, fast_length(max(16, int(turns * grid.per_turn))))
    blocks = max(1, (grid.count - block) // max(1, block // 2) + 1)
    together = -(-blocks // _MAP_ROWS)
    bins = int(highest * block / grid.per_turn) + 1
    powers = np.zeros((-(-blocks // together), len(vibration.samples), bins))
    seen, middles = np.zeros(len(powers)), np.zeros(len(powers))
    for number, (start, part) in enumerate(
        angle_blocks(vibration.samples, rate, track, grid, block)
    ):
        found = amplitude_spectrum(
            part - part.mean(axis=-1, keepdims=True),
            float(grid.per_turn),
            window_name=window_name,
            length=block,
        )
        row = number // together
        powers[row] += found.values[:, :bins] ** 2
        middles[row] += grid.first_turn + (start + block / 2) / grid.per_turn
        seen[row] += 1
    amplitude = np.sqrt(powers.sum(axis=0) / seen.sum())
    order = found.frequency_hz[:bins] / ratio
    marks = machine_marks(machine, 1.0 / ratio, float(order[-1]))
    time = track.time_at(middles / seen)
    return OrderSpectra(
        recording=recording.origin,
        shaft=shaft,
        channel_names=vibration.channel_names,
        units=vibration.units,
        order=order,
        amplitude=amplitude,
        map_time_s=time,
        map_speed_hz=ratio * _speed_at(signature, time),
        map_amplitude=np.sqrt(powers / seen[:, None, None]),
        resolution=found.resolution_hz / ratio,
        peaks=_peaks(amplitude, order, vibration, marks, most_peaks),
        marks=marks,
        signature=signature,
        notes=_notes(signature, blocks, block / grid.per_turn * ratio, shaft),
    )


def _speed_at(signature: MeasuredSignature, time: FloatArray) -> FloatArray:
    track = signature.track
    middle = 0.5 * (track.time_s[1:] + track.time_s[:-1])
    return np.asarray(np.interp(time, middle, track.speed_hz), dtype=np.float64)


def _peaks(
    amplitude: FloatArray,
    order: FloatArray,
    vibration: Recording,
    marks: tuple[Mark, ...],
    most: int,
) -> tuple[dict[str, Any], ...]:
    within = 1.5 * float(order[1] - order[0])
    return tuple(
        {
            "channel": name,
            "order": float(order[index]),
            "amplitude": float(amplitude[row, index]),
            "unit": vibration.units[row] or "",
            "near": mark_near(marks, float(order[index]), within),
        }
        for row, name in enumerate(vibration.channel_names)
        for index in highest_peaks(amplitude[row], most, 2)
    )


def _notes(signature: MeasuredSignature, blocks: int, turns: float, shaft: int) -> tuple[str, ...]:
    notes = list(signature.notes)
    notes.append(f"{blocks} half-overlapped blocks of {turns:.4g} turns of shaft {shaft}")
    if not signature.found:
        notes.append("no mesh found: the speed, and with it every order, is not to be relied on")
    return tuple(notes)
