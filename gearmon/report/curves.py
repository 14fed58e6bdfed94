"""What pictures and charts of an analysis show, computed once: spectra, turns, teeth, marks.

Pictures have some thousand columns of pixels. A spectrum is thinned by holding the largest value of
each column, so that no line is lost; waveforms keep the smallest and largest value of each column.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.diagnosis.results import Analysis, ToothProfile
from gearmon.signals.angle import AngleTrack
from gearmon.signals.bad_samples import inspected, sound_part, sound_piece
from gearmon.signals.orders.resampling import READ_UP_TO, one_turn
from gearmon.signals.orders.spectra import order_map
from gearmon.signals.recording import Recording
from gearmon.signals.spectra import Spectrum, power_density
from gearmon.signatures.measured.line_plan import Mark, mesh_harmonics
from gearmon.signatures.measured.measurement import MeasuredSignature, MeshFinding
from gearmon.signatures.measured.reference import WheelPattern

# The axis ends this far beyond the last mesh harmonic that is looked at.
_BEYOND_LAST = 1.12
# Columns of pixels that a full-width picture has in print.
COLUMNS = 1200
_TIME_BLOCK = 1 << 17
# A drawing needs no more than this: about a minute at usual rates.
_ANGLE_SAMPLES = 1 << 19
# Pictures number teeth at the middle of their contact. Tooth j is in contact from j - 1 to about
# j + 0.6 mesh periods after the angle zero; profiles hold the energy at whole mesh periods.
_CONTACT_CENTRE = 0.8


def max_hold(x: FloatArray, y: FloatArray, columns: int = COLUMNS) -> tuple[FloatArray, FloatArray]:
    """Keep the largest value in each of `columns` equal groups, at its own place.

    Parameters
    ----------
    x : ndarray of float, shape (n,)
        Places.
    y : ndarray of float, shape (n,) or (channels, n)
        One curve, or several; these share the place of the one that is clearest there.
    columns : int
        Groups, >= 1; a curve with fewer points is returned as it is.

    Returns
    -------
    x : ndarray of float, shape (min(n, columns),)
    y : ndarray of float, shape (min(n, columns),) or (channels, min(n, columns))

    Examples
    --------
    >>> max_hold(np.arange(6.0), np.array([0.0, 3, 1, 1, 2, 0]), 2)
    (array([1., 4.]), array([3., 2.]))
    """
    if len(x) <= columns:
        return x, y
    rows, groups = np.atleast_2d(y), np.array_split(np.arange(len(x)), columns)
    largest = np.fmax.reduce(rows, axis=1, keepdims=True)
    clear = (rows / np.maximum(largest, 1e-300)).max(axis=0)
    index = [own[np.argmax(clear[own])] for own in groups]
    return x[index], np.maximum.reduceat(y, [own[0] for own in groups], axis=-1)


def time_spectrum(samples: FloatArray, sampling_rate_hz: float) -> tuple[Spectrum, int]:
    """Return the amplitude spectrum of a recording of any length.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].

    Returns
    -------
    spectrum : Spectrum
        Root mean square over half-overlapped Hann blocks of the peak amplitude.
    blocks : int
        Number of blocks.
    """
    block = min(samples.shape[-1], _TIME_BLOCK) // 2 * 2
    level = samples.mean(axis=-1, keepdims=True)
    found = power_density(samples - level, sampling_rate_hz, block)
    # a sine of amplitude A on a line has the power A^2 / 2 in its noise bandwidth
    peak = np.sqrt(2.0 * found.resolution_hz * found.values)
    return replace(found, values=peak), 2 * (samples.shape[-1] - block) // block + 1


def angle_spectrum(
    analysis: Analysis, recording: Recording, top: float
) -> tuple[FloatArray, FloatArray]:
    """Return orders and amplitudes in angle, where a wandering speed smears no line.

    Parameters
    ----------
    analysis : Analysis
    recording : Recording
        Its recording; of a very long one the first half million samples are taken.
    top : float
        Highest order wanted; cut to what the sampling rate allows.

    Returns
    -------
    order : ndarray of float, shape (bins,)
        Cycles a turn of shaft 1, without the mean and what leaks from it.
    amplitude : ndarray of float, shape (channels, bins)
    """
    vibration, track = vibration_of(analysis, recording), track_of(analysis, recording)
    samples, rate = vibration.samples[:, :_ANGLE_SAMPLES], vibration.sampling_rate_hz
    turns = 2 * analysis.signature.lines.block_turns
    top = min(top, READ_UP_TO * rate / float(track.speed_hz.max()))
    found = order_map(samples, rate, track, top=top, block_turns=turns, rows=1)
    return found.order[2:], found.mean[:, 2:]


def turn_waveform(pattern: WheelPattern, points: int, *, mesh: bool = True) -> FloatArray:
    """Return one turn of a gear by its lines, with or without the mesh harmonics.

    Parameters
    ----------
    pattern : WheelPattern
        The lines; those that so few points cannot hold are left out.
    points : int
        Equal steps over the turn, from the angle zero of the recording.
    mesh : bool
        Whether with the mesh harmonics.

    Returns
    -------
    ndarray of float, shape (channels, points)
        In the units of the channels.
    """
    half = np.zeros((len(pattern.amplitude), -(-points // 2)), dtype=complex)
    chosen = (pattern.number < half.shape[1]) & (mesh | ~pattern.mesh)
    half[:, pattern.number[chosen]] = pattern.amplitude[:, chosen]
    return one_turn(half, points)


def _harmonics(signature: MeasuredSignature, mesh: MeshFinding) -> int:
    """Return how many harmonics of a mesh were looked at: more of a slow one."""
    speed = signature.speed
    return mesh_harmonics(mesh.frequency_hz * speed.nominal_hz / speed.peak_hz)


def last_harmonic_hz(signature: MeasuredSignature) -> float:
    """Return where a spectrum may end: a little beyond the last mesh harmonic looked at [Hz]."""
    last = max(_harmonics(signature, mesh) * mesh.frequency_hz for mesh in signature.meshes)
    return _BEYOND_LAST * last


def mesh_marks(signature: MeasuredSignature) -> list[Mark]:
    """Return the mesh harmonics of all stages [Hz], coinciding ones as one mark with both names.

    Without a mesh the speed is unknown, and they stand in the middle of what was searched.
    """
    by_place: dict[float, Mark] = {}
    speed = signature.speed
    ratio = 1.0 if signature.found else speed.nominal_hz / speed.estimated_hz
    for mesh in signature.meshes:
        for k in range(1, _harmonics(signature, mesh) + 1):
            place, name = k * mesh.frequency_hz * ratio, f"mesh {mesh.stage} ×{k}"
            key = round(place / speed.estimated_hz, 6)
            if known := by_place.get(key):
                by_place[key] = replace(known, name=f"{known.name} = {name}")
            else:
                by_place[key] = Mark(place=place, name=name, kind="mesh", number=mesh.stage)
    return [by_place[key] for key in sorted(by_place)]


def mark_label(mark: Mark) -> str:
    """Return the name of a mark as pictures have it, such as "GMF1 ×2"."""
    return mark.name.replace("mesh ", "GMF").replace(" = ", "\n")


def vibration_of(analysis: Analysis, recording: Recording) -> Recording:
    """Return the channels of the recording that were analysed, in the order of the analysis."""
    vibration, names = sound_part(recording, 0.0).vibration(), analysis.signature.channel_names
    return vibration if vibration.channel_names == names else vibration.select(names)


def track_of(analysis: Analysis, recording: Recording) -> AngleTrack:
    """Return the angle of shaft 1 over the samples of `vibration_of`."""
    signature = analysis.signature
    if sound_part(recording, 0.0).duration_s >= signature.duration_s:
        return signature.track
    start, stop = sound_piece(inspected(recording))
    return signature.track.between(
        start / recording.sampling_rate_hz, stop / recording.sampling_rate_hz
    )


def profile_of(analysis: Analysis, stage: int, gear: str) -> ToothProfile | None:
    """Return the tooth profile of a gear, None if there is none."""
    own = (p for p in analysis.profiles if (p.stage, p.gear) == (stage, gear))
    return next(own, None)


def flagged_place(analysis: Analysis, stage: int, gear: str) -> float | None:
    """Return the place of a flagged tooth as a tooth number, None if no tooth is flagged.

    Between two numbers where the energy peaks between two teeth.
    """
    for flag in analysis.flags:
        if flag.kind == "tooth damage" and (flag.stage, flag.gear) == (stage, gear):
            profile = profile_of(analysis, stage, gear)
            if profile is not None:
                return peak_place(profile)
            return None if flag.tooth is None else float(flag.tooth)
    return None


def peak_place(profile: ToothProfile) -> float:
    """Return where in the turn the energy of a profile is highest, as a tooth number."""
    place = np.array([profile.position * profile.teeth])
    return float(tooth_numbers(place, profile, profile.teeth)[0])


def tooth_numbers(place: FloatArray, profile: ToothProfile | None, teeth: int) -> FloatArray:
    """Return tooth numbers of places in a turn, from half a tooth before tooth 1.

    Number j is in the middle of the contact of tooth j. Teeth counted from the reference begin
    elsewhere than the recording does: the tooth that stands out has both a place in the recording
    and its number, and the difference holds for all.

    Parameters
    ----------
    place : ndarray of float
        Tooth pitches from the angle zero of the recording.
    profile : ToothProfile or None
        Of the gear.
    teeth : int
        Teeth of the gear.
    """
    first = 1.0 - _CONTACT_CENTRE
    if profile is not None and profile.tooth is not None and profile.counted_from == "reference":
        first = profile.tooth - profile.position * teeth
    return np.asarray((place + first - 0.5) % teeth + 0.5, dtype=float)
