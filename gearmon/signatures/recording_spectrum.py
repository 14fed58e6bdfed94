"""Every kind of spectrum of a recording, against frequency or against the orders of a shaft.

Each comes with its highest peaks and the lines of its machine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, Literal

import numpy as np

from gearmon.arrays import FloatArray, IntArray
from gearmon.errors import ArgumentError, check_range, check_word
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.result import Result, channel_rows, with_units
from gearmon.signals import spectra
from gearmon.signals.orders.resampling import READ_UP_TO
from gearmon.signals.orders.spectra import OrderMap, order_map
from gearmon.signals.recording import Recording, RecordingLike
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, Mark, machine_marks, mark_near
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature, opened

Band = tuple[float, float] | None
_Made = dict[str, Any]  # fields of a result
_Compute = Callable[[Recording, Band, str], _Made]
Peaks = tuple[FloatArray, FloatArray]  # places and heights

# Halvings of the bandwidth among which the band of an envelope is chosen, and of a map.
_ENVELOPE_LEVELS, _MAP_LEVELS = 4, 6
_DENSITY_BLOCKS, _DENSITY_LONGEST = 16, 1 << 16
# Turns of a block: many for a spectrum, that lines stand apart; in a map as few as give it so many
# blocks, but enough to part the mesh from the sidebands of a shaft.
_TURNS, _MAP_TURNS, _MAP_BLOCKS = 40.0, 8.0, {"time": 24, "speed": 72}


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordingSpectrum(Result):
    """A spectrum of every channel of a recording.

    Parameters
    ----------
    recording, kind : str
    channel_names : tuple of str
    place : ndarray of float, shape (bins,)
    values : ndarray of float, shape (channels, bins)
    value_name : str
        What the values are, in words.
    units : tuple of (str or None)
        Of the values, channel by channel; "" or None where unknown.
    axis : str
        Name of the horizontal column: "frequency_hz", "quefrency_s" or "order".
    peaks : tuple of dict
        Highest peaks: channel, place, value, near which line of the machine.
    marks : tuple of Mark
        Lines of the machine within the axis.
    kurtograms : tuple of Kurtogram
        One a channel, for that kind only.
    wander : float
        Half the range of the speed over its mean: lines are smeared so far about their marks.
    notes : tuple of str
    """

    picture = "spectrum_plots.spectrum_figure"

    recording: str
    kind: str
    channel_names: tuple[str, ...]
    place: FloatArray
    values: FloatArray
    value_name: str
    units: tuple[str | None, ...]
    axis: str = "frequency_hz"
    peaks: tuple[dict[str, Any], ...] = ()
    marks: tuple[Mark, ...] = ()
    kurtograms: tuple[spectra.Kurtogram, ...] = ()
    wander: float = 0.0
    notes: tuple[str, ...] = ()

    def rows(self) -> list[dict[str, Any]]:
        """Return the whole spectrum as rows, one column a channel."""
        if self.kurtograms:
            return [
                {"channel": name, **row}
                for name, own in zip(self.channel_names, self.kurtograms, strict=True)
                for row in own.rows()
            ]
        heads = with_units(self.channel_names, self.units)
        return channel_rows(self.axis, self.place, self.values, heads)

    def to_dict(self) -> dict[str, Any]:
        """Return the peaks and what they mean, in built-in types."""
        return {
            "recording": self.recording,
            "kind": self.kind,
            "value": self.value_name,
            "units": dict(zip(self.channel_names, self.units, strict=True)),
            "peaks": list(self.peaks),
            "lines": [{"name": mark.name, self.axis: mark.place} for mark in self.marks],
            "warnings": list(self.notes),
        }


def _cut(place: FloatArray, values: FloatArray, band: Band) -> _Made:
    if band is None:
        return {"place": place, "values": values}
    inside = (place >= band[0]) & (place <= band[1])
    if inside.sum() < 2:
        raise ArgumentError(
            f"band {band[0]:g} to {band[1]:g} holds fewer than two lines; they are "
            f"{place[1] - place[0]:.3g} apart: give a wider one or record longer"
        )
    return {"place": place[inside], "values": values[:, inside]}


def _amplitudes(
    vibration: Recording, band: Band, name: str, kind: Literal["amplitude", "rms", "energy"]
) -> _Made:
    samples, rate = vibration.samples, vibration.sampling_rate_hz
    found = spectra.amplitude_spectrum(samples, rate, window_name=name, quantity=kind)
    note = f"{name} window, noise bandwidth {found.resolution_hz:.3g} Hz"
    return _cut(found.frequency_hz, found.values, band) | {"notes": (note,)}


def _density(vibration: Recording, band: Band, window_name: str) -> _Made:
    samples, rate = vibration.samples, vibration.sampling_rate_hz
    count = samples.shape[-1]
    wanted = spectra.fast_length(max(16, count // _DENSITY_BLOCKS))
    block = min(count, _DENSITY_LONGEST, wanted)
    found = spectra.power_density(samples, rate, block, window_name=window_name)
    note = f"Welch, blocks of {block} samples, half overlap, {window_name} window"
    return _cut(found.frequency_hz, found.values, band) | {"notes": (note,)}


def _envelope(vibration: Recording, band: Band, _window_name: str) -> _Made:
    notes: tuple[str, ...] = ()
    if band is None:
        # narrow bands through which a wandering line passes now and then would look impulsive
        maps = [(name, *own.best) for name, own in _kurtograms(vibration, _ENVELOPE_LEVELS)]
        name, low, high, height = max(maps, key=lambda own: own[3])
        by = f"by the kurtogram of {name} (kurtosis {height:.3g})"
        band, notes = (low, high), (f"band {low:.6g} to {high:.6g} Hz {by}",)
    found = spectra.envelope_spectrum(vibration.samples, vibration.sampling_rate_hz, *band)
    return {
        "place": found.frequency_hz[1:],
        "values": found.values[:, 1:],
        "value_name": f"envelope of {band[0]:.6g} to {band[1]:.6g} Hz",
        "notes": notes,
    }


def _cepstrum(vibration: Recording, band: Band, _window_name: str) -> _Made:
    rate = vibration.sampling_rate_hz
    quefrency_s, values = spectra.real_cepstrum(vibration.samples, rate)
    # the first quefrencies hold the coarse shape of the spectrum, many times higher than the rest
    chosen = band or (16 / rate, min(0.5, float(quefrency_s[-1])))
    return _cut(quefrency_s, values, chosen) | {"axis": "quefrency_s"}


def _kurtogram(vibration: Recording, band: Band, _window_name: str) -> _Made:
    if band is not None:
        raise ArgumentError("band: a kurtogram covers all frequencies; leave the band out")
    named = _kurtograms(vibration, _MAP_LEVELS)
    heads = ("channel", "low_hz", "high_hz", "kurtosis")
    peaks = tuple(dict(zip(heads, (name, *own.best), strict=True)) for name, own in named)
    maps = tuple(own for _, own in named)
    empty = {"place": np.zeros(0), "values": np.zeros((len(maps), 0))}
    return empty | {"kurtograms": maps, "peaks": peaks}


def _kurtograms(vibration: Recording, most: int) -> list[tuple[str, spectra.Kurtogram]]:
    """Return the kurtogram of every channel by its name."""
    rate, channels = vibration.sampling_rate_hz, vibration.samples
    maps = [spectra.kurtogram(channel, rate, most) for channel in channels]
    return list(zip(vibration.channel_names, maps, strict=True))


# What each is called, the unit of its values from that of the channel, and how it is computed: of
# the vibration, the band or none, and the name of the window.
COMPUTE: dict[str, tuple[str, str, _Compute]] = {
    "amplitude": ("peak amplitude", "{}", partial(_amplitudes, kind="amplitude")),
    "rms": ("RMS of the line", "{}", partial(_amplitudes, kind="rms")),
    "density": ("power spectral density", "({})^2/Hz", _density),
    "energy": ("energy per line", "({})^2", partial(_amplitudes, kind="energy")),
    "envelope": ("envelope", "{}", _envelope),
    "cepstrum": ("real cepstrum", "1", _cepstrum),
    "kurtogram": ("kurtosis of the envelope", "1", _kurtogram),
}

KINDS = tuple(COMPUTE)


def recording_spectrum(
    recording: RecordingLike,
    kind: str = "amplitude",
    *,
    machine: MachineLike | None = None,
    sampling_rate_hz: float | None = None,
    unit: str | None = None,
    band: Band = None,
    window_name: str = "hann",
    most_peaks: int = 12,
) -> RecordingSpectrum:
    """Compute one kind of spectrum of every vibration channel.

    Parameters
    ----------
    recording : str, Path, array, DataFrame or Recording
    kind : {"amplitude", "rms", "density", "energy", "envelope", "cepstrum", "kurtogram"}
        Peak amplitude or root mean square of every line, power density, energy per line, amplitude
        of the envelope of a band, real cepstrum, kurtogram.
    machine : Machine, path or dict, optional
        Marks its lines at the speed found in the recording.
    sampling_rate_hz, unit
        Of an array, or where the recording does not state them: as of `gearmon.read_recording`.
    band : (float, float), optional
        Of the axis that is shown [Hz; s for the cepstrum]; for the envelope the band that is
        demodulated, by default the most impulsive one.
    window_name : {"hann", "flat-top", "blackman-harris", "rectangular"}
        For amplitude, rms, energy and density.
    most_peaks : int
        Peaks listed a channel.

    Returns
    -------
    RecordingSpectrum

    Raises
    ------
    GearmonError
        If the kind is unknown, the band is empty or out of range, or the recording too short.

    Examples
    --------
    >>> spectrum = gearmon.recording_spectrum(new, "envelope")
    >>> spectrum.to_frame().columns.tolist()
    ['frequency_hz', 'a1 [m/s2]', 'a2 [m/s2]']
    """
    check_word("kind=", kind, KINDS)
    check_range("peaks", most_peaks, 0, 1000)
    machine = None if machine is None else load_machine(machine)
    recording = opened(recording, machine, sampling_rate_hz, unit)
    vibration = recording.vibration()
    if band is not None:
        unit_of_band = "s" if kind == "cepstrum" else "Hz"
        longest = vibration.duration_s if kind == "cepstrum" else vibration.sampling_rate_hz
        if not isinstance(band, Sequence) or len(band) != 2:
            raise ArgumentError(f"band={band!r} must be two {unit_of_band}: low and high")
        for name, value in zip(("low", "high"), band, strict=True):
            check_range(f"band {name}", value, 0.0, longest / 2, unit_of_band)
        if band[0] >= band[1]:
            told = f"band {band[0]:g} to {band[1]:g} {unit_of_band}"
            raise ArgumentError(f"{told}: low must be below high")
    value_name, unit_of, compute = COMPUTE[kind]
    made: _Made = {"value_name": value_name, "notes": ()} | compute(vibration, band, window_name)
    units = (unit_of.format(own) if own or unit_of == "1" else "" for own in vibration.units)
    made |= {"units": tuple(units), "notes": (*recording.notes, *made["notes"])}
    names = vibration.channel_names
    result = RecordingSpectrum(recording=recording.origin, kind=kind, channel_names=names, **made)
    if machine is not None:
        result = _marked(result, recording, machine)
    if result.kurtograms:
        return result
    reach = spectra.half_lobe(window_name) if kind in ("amplitude", "rms", "energy") else 2
    read = partial(_between_bins, result, vibration, window_name)
    return replace(result, peaks=_peaks(result, most_peaks, reach, read))


def _between_bins(
    found: RecordingSpectrum, vibration: Recording, window_name: str, row: int, bins: IntArray
) -> Peaks:
    """Read lines between the bins; the mean and what is too near to an end stay as they are."""
    place, value = found.place[bins], found.values[row, bins]
    samples, rate = vibration.samples[row], vibration.sampling_rate_hz
    bin_hz = rate / len(samples)
    inner = (place > 0.6 * bin_hz) & (place < rate / 2 - 0.6 * bin_hz)
    if found.kind in ("amplitude", "rms") and inner.any() and len(samples) >= 16:
        own = spectra.line_amplitude(samples, rate, place[inner], window_name=window_name)
        place[inner], value[inner] = own.frequency_hz[0], own.amplitude[0]
    return place, value / np.sqrt(2) if found.kind == "rms" else value


def _marked(result: RecordingSpectrum, recording: Recording, machine: Machine) -> RecordingSpectrum:
    """Add the lines of the machine, at the speed of the recording."""
    signature = measure_signature(recording, machine)
    speed, own = signature.speed.peak_hz, signature.speed
    wander = 0.5 * (own.highest_hz - own.lowest_hz) / own.estimated_hz
    note = f"shaft 1 at {speed:.6g} Hz, {own.lowest_hz:.6g} to {own.highest_hz:.6g} Hz"
    if wander > 5e-4:
        note += ": lines are smeared by as much; gearmon orders shows them sharp"
    if not signature.found:
        speed = signature.speed.nominal_hz
        note = f"no mesh found: lines are marked at the nominal speed of {speed:.6g} Hz"
    marks = machine_marks(machine, speed, np.inf)
    if result.kind == "cepstrum":
        # a family of sidebands stands at the reciprocal of its spacing
        turning = [mark for mark in reversed(marks) if mark.name.endswith("×1")]
        marks = tuple(replace(mark, place=1.0 / mark.place) for mark in turning)
    ends = result.place[[0, -1]] if len(result.place) else (np.inf, 0.0)
    inside = tuple(mark for mark in marks if ends[0] <= mark.place <= ends[1])
    return replace(result, marks=inside, wander=wander, notes=(*result.notes, note))


def _peaks(
    found: RecordingSpectrum,
    most: int,
    reach: int,
    read: Callable[[int, IntArray], Peaks],
    value: str = "value",
    widths: float = 3.0,
) -> tuple[dict[str, Any], ...]:
    """Return a row a peak, highest first, channel by channel.

    Parameters
    ----------
    found : RecordingSpectrum
    most : int
        Peaks a channel.
    reach : int
        Least distance [bins].
    read : callable
        Takes the number of a channel and bins; gives places and heights.
    value : str
        What the height is called.
    widths : float
        How far from a mark a peak is near to it [bins].
    """
    rows, step = [], found.place[1] - found.place[0]
    whose = zip(found.values, found.channel_names, found.units, strict=True)
    for number, (values, channel, unit) in enumerate(whose):
        places, heights = read(number, highest_peaks(values, most, reach))
        ranked = np.argsort(-heights, kind="stable")
        for place, height in zip(places[ranked].tolist(), heights[ranked].tolist(), strict=True):
            near = mark_near(found.marks, place, max(widths * step, found.wander * place))
            row = {"channel": channel, found.axis: place, value: height}
            rows.append(row | {"unit": unit or "", "near": near})
    return tuple(rows)


def highest_peaks(values: FloatArray, most: int, reach: int) -> IntArray:
    """Return the highest local maxima that are `reach` bins or more apart, highest first.

    Parameters
    ----------
    values : ndarray of float, shape (bins,)
    most : int
        Largest number.
    reach : int
        Least distance [bins].

    Examples
    --------
    >>> highest_peaks(np.array([0.0, 3, 1, 2, 0, 5, 0]), 2, 1).tolist()
    [5, 1]
    """
    tops = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:])) + 1
    kept: list[int] = []
    for top in tops[np.argsort(-values[tops], kind="stable")].tolist():
        if len(kept) < most and all(abs(top - other) >= reach for other in kept):
            kept.append(top)
    return np.array(kept, dtype=np.intp)


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderSpectra(RecordingSpectrum):
    """Amplitude against order, averaged and along the recording.

    Peak amplitudes, root mean square over the blocks, against cycles a turn of a shaft.

    Parameters
    ----------
    shaft : int
        Shaft whose turns the orders count.
    resolution : float
        Noise bandwidth [orders].
    map : OrderMap
        The same along time or speed, in shorter blocks.
    signature : MeasuredSignature
        Speed and meshes.
    """

    picture = "spectrum_plots.order_figure"

    kind: str = "order"
    value_name: str = "peak amplitude"
    axis: str = "order"
    shaft: int
    resolution: float
    map: OrderMap
    signature: MeasuredSignature

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
        told = (own.time_s.tolist(), own.speed_hz.tolist(), own.blocks.tolist(), held)
        return [
            {"time_s": time_s, "speed_hz": speed_hz, "blocks": blocks, "channel": channel}
            | {name: float(f"{v:.6g}") for name, v in zip(names, values.tolist(), strict=True)}
            for time_s, speed_hz, blocks, rows in zip(*told, strict=True)
            for channel, values in zip(self.channel_names, rows, strict=True)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the peaks and what they mean, in built-in types."""
        told = super().to_dict()
        return {name: told[name] for name in ("recording", "peaks", "lines", "warnings")} | {
            "shaft": self.shaft,
            "speed": self.signature.speed.to_dict(),
            "resolution_orders": self.resolution,
            "map": {
                "against": self.map.against,
                "rows": len(self.map.time_s),
                "block_turns": self.map.block_turns,
                "resolution_orders": self.map.resolution,
            },
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
    recording = opened(recording, machine, sampling_rate_hz, unit)
    signature = measure_signature(recording, machine)
    vibration = recording.vibration()
    rate, track = vibration.sampling_rate_hz, signature.track
    if top is None:
        limit = READ_UP_TO * rate / float(track.speed_hz.max())
        last = 1.1 * MESH_HARMONICS * max(mesh.order for mesh in train.meshes)
        top = min(limit, last) / ratio
    of_shaft = partial(order_map, shaft_order=ratio, top=top, window_name=window_name)
    found = cache(partial(of_shaft, vibration.samples, rate, track))
    whole = found(block_turns=_TURNS, against="time")
    turned = ratio * float(track.turns[-1] - track.turns[0])
    blocks = _MAP_BLOCKS.get(map_against, 1)
    turns = float(np.clip(2 * turned / blocks, _MAP_TURNS, _TURNS))
    along = found(block_turns=turns, against=map_against)
    blocks_of = "{}: {} half-overlapped blocks of {:.4g} turns of shaft {}"
    notes = [
        blocks_of.format(name, own.blocks.sum(), own.block_turns, shaft)
        for name, own in (("spectrum", whole), ("map", along))
    ]
    if map_against == "speed":
        low, high = float(along.speed_hz.min()), float(along.speed_hz.max())
        notes.append(f"map: {len(along.speed_hz)} rows from {low:.5g} to {high:.5g} Hz")
    if not signature.found:
        notes.append("no mesh found: the speed, and with it every order, is not to be relied on")
    result = OrderSpectra(
        recording=recording.origin,
        shaft=shaft,
        channel_names=vibration.channel_names,
        units=vibration.units,
        place=whole.order,
        values=whole.mean,
        resolution=whole.resolution,
        map=along,
        marks=machine_marks(machine, 1.0 / ratio, float(whole.order[-1])),
        signature=signature,
        notes=(*signature.notes, *notes),
    )
    read = partial(_parabola, result)
    return replace(result, peaks=_peaks(result, most_peaks, 2, read, "amplitude", widths=1.5))


def _parabola(found: RecordingSpectrum, row: int, bins: IntArray) -> Peaks:
    """Read lines between the bins: a parabola through the logarithms of three.

    Of a Hann window it is off by 0.016 bins and 4 % in height at most; the bin itself by half a bin
    and 15 %.
    """
    three = found.values[row, bins + np.array([[-1], [0], [1]])]
    before, here, after = np.log(np.maximum(three, 1e-300))
    shift = 0.5 * (before - after) / np.minimum(before - 2.0 * here + after, -1e-12)
    step = float(found.place[1] - found.place[0])
    return found.place[bins] + shift * step, np.exp(here - 0.25 * (before - after) * shift)
