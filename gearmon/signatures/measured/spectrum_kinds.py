"""What each kind of spectrum of a recording computes, from which band; marks of the machine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine
from gearmon.signals.cepstrum import real_cepstrum
from gearmon.signals.cyclic import cyclic_coherence
from gearmon.signals.envelope import envelope_spectrum
from gearmon.signals.kurtogram import Kurtogram, kurtogram
from gearmon.signals.recording import Recording
from gearmon.signals.spectrum import amplitude_spectrum, power_density
from gearmon.signals.transforms import fast_length
from gearmon.signatures.measured.line_plan import MESH_HARMONICS

FloatArray = NDArray[np.float64]

# Modulation frequencies and pieces of a coherence, and the block of its carriers [samples].
_CYCLIC, _PIECES, _CARRIER_BLOCK = 300, 2, 256
# Halvings of the bandwidth among which the band of an envelope is chosen, and of a map.
_ENVELOPE_LEVELS, _MAP_LEVELS = 4, 6
_DENSITY_BLOCKS, _DENSITY_LONGEST = 16, 1 << 16
# Harmonics of a shaft that are marked.
_SHAFT_HARMONICS = 3


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A line of the machine.

    Parameters
    ----------
    place : float
        Frequency [Hz], or order of the shaft that the axis counts by.
    name : str
        "shaft 2 ×1", "mesh 1 ×3"; several names are joined by " = ".
    kind : {"shaft", "mesh"}
    number : int
        Shaft, or stage.
    """

    place: float
    name: str
    kind: str
    number: int


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordingSpectrum:
    """A spectrum of every channel of a recording.

    Parameters
    ----------
    recording, kind : str
    channel_names : tuple of str
    axis : str
        Name of the horizontal column: "frequency_hz", "quefrency_s", "cyclic_frequency_hz" or
        "order".
    place : ndarray of float, shape (bins,)
    values : ndarray of float, shape (channels, bins)
    value_name : str
        What the values are, in words.
    units : tuple of str
        Of the values, channel by channel; "" where unknown.
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

    recording: str
    kind: str
    channel_names: tuple[str, ...]
    axis: str
    place: FloatArray
    values: FloatArray
    value_name: str
    units: tuple[str, ...]
    peaks: tuple[dict[str, Any], ...]
    marks: tuple[Mark, ...] = ()
    kurtograms: tuple[Kurtogram, ...] = ()
    wander: float = 0.0
    notes: tuple[str, ...] = field(default=())

    def rows(self) -> list[dict[str, Any]]:
        """Return the whole spectrum as rows, one column a channel."""
        if self.kurtograms:
            return [
                {"channel": name, **row}
                for name, own in zip(self.channel_names, self.kurtograms, strict=True)
                for row in own.rows()
            ]
        columns = zip(self.channel_names, self.values.tolist(), strict=True)
        named = {self.axis: self.place.tolist(), **dict(columns)}
        return [dict(zip(named, row, strict=True)) for row in zip(*named.values(), strict=True)]

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


def _made(
    vibration: Recording,
    kind: str,
    axis: tuple[FloatArray, FloatArray],
    value_name: str,
    units: tuple[str, ...],
    **more: Any,
) -> RecordingSpectrum:
    place, values = axis
    return RecordingSpectrum(
        recording=vibration.origin,
        kind=kind,
        channel_names=vibration.channel_names,
        axis=more.pop("axis_name", "frequency_hz"),
        place=place,
        values=values,
        value_name=value_name,
        units=units,
        peaks=(),
        **more,
    )


def _cut(
    place: FloatArray, values: FloatArray, band: tuple[float, float] | None
) -> tuple[FloatArray, FloatArray]:
    if band is None:
        return place, values
    inside = (place >= band[0]) & (place <= band[1])
    if inside.sum() < 2:
        raise ArgumentError(
            f"band {band[0]:g} to {band[1]:g} holds fewer than two lines; they are "
            f"{place[1] - place[0]:.3g} apart: give a wider one or record longer"
        )
    return place[inside], values[:, inside]


def _amplitudes(kind: str) -> Callable[..., RecordingSpectrum]:
    names = {"amplitude": "peak amplitude", "rms": "RMS of the line", "energy": "energy per line"}

    def compute(
        vibration: Recording, band: tuple[float, float] | None, window_name: str
    ) -> RecordingSpectrum:
        found = amplitude_spectrum(
            vibration.samples,
            vibration.sampling_rate_hz,
            window_name=window_name,
            quantity=kind,  # type: ignore[arg-type]
        )
        axis = _cut(found.frequency_hz, found.values, band)
        units = _units(vibration, "({})^2" if kind == "energy" else "{}")
        note = f"{window_name} window, noise bandwidth {found.resolution_hz:.3g} Hz"
        return _made(vibration, kind, axis, names[kind], units, notes=(note,))

    return compute


def _density(
    vibration: Recording, band: tuple[float, float] | None, window_name: str
) -> RecordingSpectrum:
    count = vibration.samples.shape[-1]
    wanted = fast_length(max(16, count // _DENSITY_BLOCKS))
    block = min(count, _DENSITY_LONGEST, wanted)
    found = power_density(
        vibration.samples, vibration.sampling_rate_hz, block, window_name=window_name
    )
    axis = _cut(found.frequency_hz, found.values, band)
    units = _units(vibration, "({})^2/Hz")
    note = f"Welch, blocks of {block} samples, half overlap, {window_name} window"
    return _made(vibration, "density", axis, "power spectral density", units, notes=(note,))


def _envelope(
    vibration: Recording,
    band: tuple[float, float] | None,
    _window_name: str,
) -> RecordingSpectrum:
    rate, notes = vibration.sampling_rate_hz, []
    if band is None:
        # narrow bands through which a wandering line passes now and then would look impulsive
        found_bands = [own.best for own in _kurtograms(vibration, _ENVELOPE_LEVELS)]
        channel = int(np.argmax([height for _, _, height in found_bands]))
        low, high, height = found_bands[channel]
        band = (low, high)
        notes.append(
            f"band {low:.6g} to {high:.6g} Hz by the kurtogram of "
            f"{vibration.channel_names[channel]} (kurtosis {height:.3g})"
        )
    found = envelope_spectrum(vibration.samples, rate, *band)
    axis, units = (found.frequency_hz[1:], found.values[:, 1:]), _units(vibration, "{}")
    name = f"envelope of {band[0]:.6g} to {band[1]:.6g} Hz"
    return _made(vibration, "envelope", axis, name, units, notes=tuple(notes))


def _cepstrum(
    vibration: Recording, band: tuple[float, float] | None, _window_name: str
) -> RecordingSpectrum:
    found = real_cepstrum(vibration.samples, vibration.sampling_rate_hz)
    # the first quefrencies hold the coarse shape of the spectrum, many times higher than the rest
    chosen = band or (16 / vibration.sampling_rate_hz, min(0.5, float(found.quefrency_s[-1])))
    axis = _cut(found.quefrency_s, found.values, chosen)
    ones = ("1",) * len(axis[1])
    return _made(vibration, "cepstrum", axis, "real cepstrum", ones, axis_name="quefrency_s")


def _kurtograms(vibration: Recording, most_levels: int) -> tuple[Kurtogram, ...]:
    levels = max(0, min(most_levels, int(np.log2(vibration.samples.shape[-1] / 64))))
    rate = vibration.sampling_rate_hz
    return tuple(kurtogram(samples, rate, levels) for samples in vibration.samples)


def _kurtogram(
    vibration: Recording, band: tuple[float, float] | None, _window_name: str
) -> RecordingSpectrum:
    if band is not None:
        raise ArgumentError("band: a kurtogram covers all frequencies; leave the band out")
    maps = _kurtograms(vibration, _MAP_LEVELS)
    axis, ones = (np.zeros(0), np.zeros((len(maps), 0))), ("1",) * len(maps)
    return _made(vibration, "kurtogram", axis, "kurtosis of the envelope", ones, kurtograms=maps)


def _coherence(
    vibration: Recording, band: tuple[float, float] | None, _window_name: str
) -> RecordingSpectrum:
    rate, count = vibration.sampling_rate_hz, vibration.samples.shape[-1]
    low, high = band or (1.0, min(200.0, rate / 8))
    # modulation is resolved to rate over length: so long a piece that no line falls between
    piece = min(count, max(16 * _CARRIER_BLOCK, int(_CYCLIC * rate / (high - low))))
    pieces = max(1, min(_PIECES, count // piece))
    block = min(_CARRIER_BLOCK, piece // 16)
    if block < 8:
        raise ArgumentError(f"{vibration.origin}: {count} samples are too few for a coherence")
    step = rate / piece
    cyclic = np.arange(max(low, step), high, step)

    def mean(samples: FloatArray) -> FloatArray:
        parts = samples[: pieces * piece].reshape(pieces, piece)
        found = [cyclic_coherence(part, rate, cyclic, block) for part in parts]
        return np.asarray(np.mean([one.enhanced_envelope_spectrum for one in found], axis=0))

    values = np.array([mean(samples) for samples in vibration.samples])
    note = (
        f"modulation resolved to {step:.3g} Hz, carriers to {1.5 * rate / block:.3g} Hz, from "
        f"the first {pieces * piece / rate:.3g} s"
    )
    name, ones = "squared cyclic coherence, mean over carriers", ("1",) * len(values)
    return _made(
        vibration,
        "coherence",
        (cyclic, values),
        name,
        ones,
        axis_name="cyclic_frequency_hz",
        notes=(note,),
    )


def _units(vibration: Recording, form: str) -> tuple[str, ...]:
    return tuple(form.format(unit) if unit else "" for unit in vibration.units)


# Each takes the vibration, the band or none, and the name of the window.
COMPUTE: dict[str, Callable[..., RecordingSpectrum]] = {
    "amplitude": _amplitudes("amplitude"),
    "rms": _amplitudes("rms"),
    "density": _density,
    "energy": _amplitudes("energy"),
    "envelope": _envelope,
    "cepstrum": _cepstrum,
    "kurtogram": _kurtogram,
    "coherence": _coherence,
}

KINDS = tuple(COMPUTE)


def machine_marks(machine: Machine, per_order: float, top: float) -> tuple[Mark, ...]:
    """Return the shaft and mesh harmonics of a machine, lowest first.

    Parameters
    ----------
    machine : Machine
        The machine.
    per_order : float
        What one order of shaft 1 is on the axis: its speed [Hz], or the reciprocal of the order of
        the shaft that the axis counts by.
    top : float
        No marks above this place.
    """
    train = kinematics(machine)
    found: dict[float, Mark] = {}

    def add(order: float, name: str, kind: str, number: int) -> None:
        place = order * per_order
        if place > top:
            return
        key = round(order, 9)
        known = found.get(key)
        if known is None:
            found[key] = Mark(place=place, name=name, kind=kind, number=number)
        else:
            joined = f"{known.name} = {name}"
            found[key] = Mark(place=place, name=joined, kind=known.kind, number=known.number)

    for mesh in train.meshes:
        for k in range(1, MESH_HARMONICS + 1):
            add(k * mesh.order, f"mesh {mesh.stage} ×{k}", "mesh", mesh.stage)
    for shaft in train.shafts:
        for k in range(1, _SHAFT_HARMONICS + 1):
            add(k * shaft.order, f"shaft {shaft.number} ×{k}", "shaft", shaft.number)
    return tuple(found[key] for key in sorted(found))


def mark_near(marks: tuple[Mark, ...], place: float, within: float) -> str:
    """Return the name of the mark nearest to a place, "" if none lies within a distance."""
    near = min(marks, key=lambda mark: abs(mark.place - place), default=None)
    return near.name if near is not None and abs(near.place - place) <= within else ""
