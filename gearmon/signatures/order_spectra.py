"""Order spectra and order maps of a recording, counted in turns of any shaft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearmon.gears.kinematics import kinematics
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result, channel_rows, with_units
from gearmon.signals.array_types import FloatArray
from gearmon.signals.bad_samples import sound_part
from gearmon.signals.orders.resampling import READ_UP_TO
from gearmon.signals.orders.spectra import OrderMap, order_map
from gearmon.signals.recording import Recording, RecordingLike, read_recording
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, Mark, machine_marks
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature
from gearmon.signatures.recording_spectrum import highest_peaks, peak_rows

# Turns of a block: many for a spectrum, that lines stand apart; in a map as few as give it so many
# blocks, but enough to part the mesh from the sidebands of a shaft.
_TURNS, _MAP_TURNS, _MAP_BLOCKS = 40.0, 8.0, {"time": 24, "speed": 72}


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderSpectra(Result):
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
    resolution : float
        Noise bandwidth [orders].
    map : OrderMap
        The same along time or speed, in shorter blocks.
    peaks : tuple of dict
        Highest peaks and the lines of the machine they are near to.
    marks : tuple of Mark
        Lines of the machine.
    signature : MeasuredSignature
        Speed and meshes.
    notes : tuple of str
    """

    picture = "spectrum_plots.order_figure"

    recording: str
    shaft: int
    channel_names: tuple[str, ...]
    units: tuple[str | None, ...]
    order: FloatArray
    amplitude: FloatArray
    resolution: float
    map: OrderMap
    peaks: tuple[dict[str, Any], ...]
    marks: tuple[Mark, ...]
    signature: MeasuredSignature
    notes: tuple[str, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return the averaged spectrum as rows, one column a channel."""
        heads = with_units(self.channel_names, self.units)
        return channel_rows("order", self.order, self.amplitude, heads)

    def map_rows(self, most: int | None = None) -> list[dict[str, Any]]:
        """Return the map as rows: time, speed, blocks, channel and the amplitude at every order.

        Parameters
        ----------
        most : int, optional
            At most so many orders; of each group of neighbours the largest is kept, under the
            order in the middle of the group.
        """
        own = self.map
        count = len(own.order)
        edges = np.linspace(0, count, min(most or count, count) + 1).astype(int)
        middle = 0.5 * (own.order[edges[:-1]] + own.order[edges[1:] - 1])
        names = [f"order_{value:.6g}" for value in middle]
        held = np.maximum.reduceat(own.amplitude, edges[:-1], axis=2)
        return [
            {
                "time_s": float(own.time_s[row]),
                "speed_hz": float(own.speed_hz[row]),
                "blocks": int(own.blocks[row]),
                "channel": channel,
            }
            | {
                name: float(f"{value:.6g}")
                for name, value in zip(names, held[row, column].tolist(), strict=True)
            }
            for row in range(len(own.time_s))
            for column, channel in enumerate(self.channel_names)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the peaks and what they mean, in built-in types."""
        return {
            "recording": self.recording,
            "shaft": self.shaft,
            "speed": self.signature.speed.to_dict(),
            "resolution_orders": self.resolution,
            "map": {
                "against": self.map.against,
                "rows": len(self.map.time_s),
                "block_turns": self.map.block_turns,
                "resolution_orders": self.map.resolution,
            },
            "peaks": list(self.peaks),
            "lines": [{"name": mark.name, "order": mark.place} for mark in self.marks],
            "warnings": list(self.notes),
        }


def order_spectra(
    recording: RecordingLike,
    machine: MachineLike,
    shaft: int = 1,
    *,
    sampling_rate_hz: float | None = None,
    unit: str | None = None,
    top: float | None = None,
    window_name: str = "hann",
    most_peaks: int = 20,
    map_against: str = "time",
) -> OrderSpectra:
    """Compute order spectrum and order map of every vibration channel.

    Parameters
    ----------
    recording : str, Path, array, DataFrame or Recording
    machine : Machine, path or dict
    shaft : int
        Shaft whose turns the orders count, from 1.
    sampling_rate_hz, unit
        Of an array, or where the recording does not state them: as of `gearmon.read_recording`.
    top : float, optional
        Highest order; by default a tenth above the last mesh harmonic looked at, as far as the
        sampling rate allows.
    window_name : str
        Of the blocks.
    most_peaks : int
        Peaks listed a channel.
    map_against : {"time", "speed"}
        What the rows of the map run along.

    Returns
    -------
    OrderSpectra
        The spectrum in half-overlapped blocks of 40 turns of the shaft, or a quarter of a short
        recording; the map in blocks of 8 to 40 turns, short enough for 24 rows (72 blocks along
        speed) where it can be.

    Raises
    ------
    GearmonError
        If there is no such shaft, or the recording cannot be used.

    Examples
    --------
    >>> orders = gearmon.order_spectra(new, machine)
    >>> orders.to_frame().columns.tolist()
    ['order', 'a1 [m/s2]', 'a2 [m/s2]']
    """
    machine = load_machine(machine)
    train = kinematics(machine)
    ratio = train.shaft(shaft).order
    recording = sound_part(
        read_recording(recording, sampling_rate_hz, sensors=machine.sensors, unit=unit)
    )
    signature = measure_signature(recording, machine)
    vibration = recording.vibration()
    rate, track = vibration.sampling_rate_hz, signature.track
    if top is None:
        limit = READ_UP_TO * rate / float(track.speed_hz.max())
        last = 1.1 * MESH_HARMONICS * max(mesh.order for mesh in train.meshes)
        top = min(limit, last) / ratio

    def found(turns: float, against: str) -> OrderMap:
        return order_map(
            vibration.samples,
            rate,
            track,
            shaft_order=ratio,
            top=top,
            block_turns=turns,
            window_name=window_name,
            against=against,
        )

    whole = found(_TURNS, "time")
    turned = ratio * float(track.turns[-1] - track.turns[0])
    blocks = _MAP_BLOCKS.get(map_against, 1)
    turns = float(np.clip(2 * turned / blocks, _MAP_TURNS, _TURNS))
    along = whole if (turns, map_against) == (_TURNS, "time") else found(turns, map_against)
    amplitude, order = whole.mean, whole.order
    marks = machine_marks(machine, 1.0 / ratio, float(order[-1]))
    return OrderSpectra(
        recording=recording.origin,
        shaft=shaft,
        channel_names=vibration.channel_names,
        units=vibration.units,
        order=order,
        amplitude=amplitude,
        resolution=whole.resolution,
        map=along,
        peaks=_peaks(amplitude, order, vibration, marks, most_peaks),
        marks=marks,
        signature=signature,
        notes=_notes(signature, whole, along, shaft),
    )


def _peaks(
    amplitude: FloatArray,
    order: FloatArray,
    vibration: Recording,
    marks: tuple[Mark, ...],
    most: int,
) -> tuple[dict[str, Any], ...]:
    """Read lines between the bins: a parabola through the logarithms of three.

    Of a Hann window it is off by 0.016 bins and 4 % in height at most; the bin itself by half a bin
    and 15 %.
    """
    step, rows = float(order[1] - order[0]), []
    for values, channel, unit in zip(
        amplitude, vibration.channel_names, vibration.units, strict=True
    ):
        tops = highest_peaks(values, most, 2)
        before, here, after = np.log(np.maximum(values[tops + np.array([[-1], [0], [1]])], 1e-300))
        shift = 0.5 * (before - after) / np.minimum(before - 2.0 * here + after, -1e-12)
        height = np.exp(here - 0.25 * (before - after) * shift)
        about = {"channel": channel}, {"unit": unit or ""}
        found = {"order": order[tops] + shift * step, "amplitude": height}
        rows += peak_rows(about, found, marks, np.full(len(tops), 1.5 * step))
    return tuple(rows)


def _notes(
    signature: MeasuredSignature, whole: OrderMap, along: OrderMap, shaft: int
) -> tuple[str, ...]:
    notes = list(signature.notes)
    for name, own in (("spectrum", whole), ("map", along)):
        notes.append(
            f"{name}: {own.blocks.sum()} half-overlapped blocks of {own.block_turns:.4g} turns of "
            f"shaft {shaft}"
        )
    if along.against == "speed":
        low, high = float(along.speed_hz.min()), float(along.speed_hz.max())
        notes.append(f"map: {len(along.speed_hz)} rows from {low:.5g} to {high:.5g} Hz")
    if not signature.found:
        notes.append("no mesh found: the speed, and with it every order, is not to be relied on")
    return tuple(notes)
