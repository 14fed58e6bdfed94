"""Every kind of spectrum of a recording, with its highest peaks and the lines of its machine."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, check_range
from gearmon.machine import Machine
from gearmon.signals.line_peaks import line_amplitude
from gearmon.signals.recording import Recording
from gearmon.signals.windows import half_lobe
from gearmon.signatures.measured.measurement import measure_signature
from gearmon.signatures.measured.spectrum_kinds import (
    COMPUTE,
    KINDS,
    RecordingSpectrum,
    machine_marks,
    mark_near,
)

__all__ = ["KINDS", "RecordingSpectrum", "highest_peaks", "recording_spectrum"]

FloatArray = NDArray[np.float64]


def recording_spectrum(
    recording: Recording,
    kind: str = "amplitude",
    *,
    machine: Machine | None = None,
    band: tuple[float, float] | None = None,
    window_name: str = "hann",
    most_peaks: int = 12,
) -> RecordingSpectrum:
    """Compute one kind of spectrum of every vibration channel.

    Parameters
    ----------
    recording : Recording
    kind : {"amplitude", "rms", "density", "energy", "envelope", "cepstrum", "kurtogram", \
"coherence"}
        Peak amplitude or root mean square of every line, power density, energy per line, amplitude
        of the envelope of a band, real cepstrum, kurtogram, cyclic spectral coherence averaged over
        carriers.
    machine : Machine, optional
        Marks its lines at the speed found in the recording.
    band : (float, float), optional
        Of the axis that is shown [Hz; s for the cepstrum]; for the envelope the band that is
        demodulated, by default the most impulsive one; for the coherence the modulation
        frequencies, by default up to 200 Hz.
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
    """
    if kind not in KINDS:
        raise ArgumentError(f"kind={kind!r} must be one of {', '.join(KINDS)}")
    check_range("peaks", most_peaks, 0, 1000)
    vibration = recording.vibration()
    _check_band(band, vibration, kind)
    result = COMPUTE[kind](vibration, band, window_name)
    result = replace(result, notes=tuple(recording.notes) + result.notes)
    if machine is not None:
        result = _marked(result, recording, machine)
    return replace(result, peaks=_peaks(result, vibration, window_name, most_peaks))


def _check_band(band: tuple[float, float] | None, vibration: Recording, kind: str) -> None:
    if band is None:
        return
    top = vibration.duration_s / 2 if kind == "cepstrum" else vibration.sampling_rate_hz / 2
    unit = "s" if kind == "cepstrum" else "Hz"
    for name, value in zip(("low", "high"), band, strict=True):
        check_range(f"band {name}", value, 0.0, top, unit)
    if band[0] >= band[1]:
        raise ArgumentError(f"band {band[0]:g} to {band[1]:g} {unit}: low must be below high")


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
    if result.kind == "cepstrum":
        # a family of sidebands stands at the reciprocal of its spacing
        marks = tuple(
            replace(mark, place=1.0 / mark.place)
            for mark in reversed(machine_marks(machine, speed, np.inf))
            if mark.name.endswith("×1")
        )
    elif result.kind == "kurtogram":
        marks = ()
    else:
        marks = machine_marks(machine, speed, np.inf)
    inside = tuple(
        mark
        for mark in marks
        if len(result.place) and result.place[0] <= mark.place <= result.place[-1]
    )
    return replace(result, marks=inside, wander=wander, notes=(*result.notes, note))


def _peaks(
    result: RecordingSpectrum, vibration: Recording, window_name: str, most: int
) -> tuple[dict[str, Any], ...]:
    if result.kurtograms:
        return tuple(
            {
                "channel": name,
                "low_hz": own.best[0],
                "high_hz": own.best[1],
                "kurtosis": own.best[2],
            }
            for name, own in zip(result.channel_names, result.kurtograms, strict=True)
        )
    reach = half_lobe(window_name) if result.kind in ("amplitude", "rms", "energy") else 2
    exact = result.kind in ("amplitude", "rms")
    rows: list[dict[str, Any]] = []
    for row, name in enumerate(result.channel_names):
        chosen = highest_peaks(result.values[row], most, reach)
        place, value = result.place[chosen], result.values[row, chosen]
        if exact and len(chosen):
            place, value = _read(vibration.samples[row], vibration, place, value, window_name)
            value = value / np.sqrt(2) if result.kind == "rms" else value
        within = 3 * float(result.place[1] - result.place[0])
        rows += [
            {
                "channel": name,
                result.axis: float(at),
                "value": float(height),
                "unit": result.units[row],
                "near": mark_near(result.marks, float(at), max(within, result.wander * float(at))),
            }
            for at, height in zip(place, value, strict=True)
        ]
    return tuple(rows)


def _read(
    samples: FloatArray,
    vibration: Recording,
    place: FloatArray,
    value: FloatArray,
    window_name: str,
) -> tuple[FloatArray, FloatArray]:
    """Read lines between the bins; the mean and what is too near to an end stay as they are."""
    rate = vibration.sampling_rate_hz
    bin_hz = rate / samples.shape[-1]
    inner = (place > 0.6 * bin_hz) & (place < rate / 2 - 0.6 * bin_hz)
    if not inner.any() or samples.shape[-1] < 16:
        return place, value
    found = line_amplitude(samples, rate, place[inner], window_name=window_name, within_bins=1.0)
    place, value = place.copy(), value.copy()
    place[inner], value[inner] = found.frequency_hz[0], found.amplitude[0]
    return place, value


def highest_peaks(values: FloatArray, most: int, reach: int) -> NDArray[np.intp]:
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
    inner = (values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:])
    tops = np.flatnonzero(inner) + 1
    kept: list[int] = []
    for top in tops[np.argsort(-values[tops], kind="stable")]:
        if len(kept) == most:
            break
        if all(abs(int(top) - other) >= reach for other in kept):
            kept.append(int(top))
    return np.array(kept, dtype=np.intp)
