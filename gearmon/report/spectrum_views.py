"""From an analysis and its recording to the spectra that a picture shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gearmon.diagnosis.results import Analysis
from gearmon.report.curves import angle_spectrum, max_hold, time_spectrum
from gearmon.report.views import FloatArray, LineMark, SpectrumView
from gearmon.report.wording import shaft_text, told_apart, unit_text
from gearmon.signals.recording import Recording
from gearmon.signals.spectrum import Spectrum
from gearmon.signatures.families import MESH_HARMONICS, NEAR_SIDEBANDS, Family
from gearmon.signatures.measured import MeasuredSignature, MeshFinding
from gearmon.signatures.speed import SPEED_TOLERANCE

# The axis ends this far beyond the last mesh harmonic that is looked at.
_BEYOND_LAST = 1.12
# A close-up shows this many sidebands of the fastest shaft, and some air.
_CLOSE_UP_SPACINGS = NEAR_SIDEBANDS + 0.7
# It never reaches the neighbouring mesh harmonics.
_CLOSE_UP_MESHES = 0.6
# Where no mesh was found, a close-up shows twice the range that was searched.
_SEARCH_SHOWN = 2.0 * SPEED_TOLERANCE


def vibration_of(analysis: Analysis, recording: Recording) -> Recording:
    """Return the channels of the recording that were analysed, in the order of the analysis."""
    vibration = recording.vibration()
    names = analysis.signature.channel_names
    return vibration if vibration.channel_names == names else vibration.select(names)


def spectrum_views(analysis: Analysis, recording: Recording) -> tuple[list[SpectrumView], str]:
    """Return the spectrum of every channel with its mesh harmonics, and how it was made.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    recording : Recording
        Its recording.

    Returns
    -------
    views : list of SpectrumView
        One a channel.
    remark : str
        Resolution, averaging and what of the band is shown, in a sentence.
    """
    vibration = vibration_of(analysis, recording)
    spectrum, blocks = time_spectrum(vibration.samples, vibration.sampling_rate_hz)
    nyquist = 0.5 * vibration.sampling_rate_hz
    last = max(MESH_HARMONICS * mesh.frequency_hz for mesh in analysis.signature.meshes)
    high = min(nyquist, _BEYOND_LAST * last)
    marks = tuple(
        mark for mark in mesh_marks(analysis.signature) if mark.frequency_hz < 0.999 * high
    )
    views = _views(analysis, spectrum, (2 * float(spectrum.frequency_hz[1]), high), marks)
    made = f"{blocks} Hann blocks, averaged in power" if blocks > 1 else "one Hann window"
    cut = "" if high == nyquist else f", shown up to {high:.0f} of {nyquist:.0f} Hz"
    return views, f"Peak amplitudes, {made}, resolution {spectrum.resolution_hz:.2g} Hz{cut}."


def mesh_marks(signature: MeasuredSignature) -> list[LineMark]:
    """Return the mesh harmonics of all stages, coinciding ones as one mark with both names."""
    by_place: dict[float, LineMark] = {}
    # without a mesh the speed is unknown, and the nominal one was the middle of the search
    ratio = 1.0 if signature.found else signature.speed.nominal_hz / signature.speed.estimated_hz
    for mesh in signature.meshes:
        width = 0.0 if signature.found else SPEED_TOLERANCE * mesh.frequency_hz * ratio
        for k in range(1, MESH_HARMONICS + 1):
            frequency = k * mesh.frequency_hz * ratio
            label = f"GMF{mesh.stage} ×{k}"
            key = round(frequency / signature.speed.estimated_hz, 6)
            known = by_place.get(key)
            if known:
                by_place[key] = replace(known, label=f"{known.label}\n{label}")
            else:
                by_place[key] = LineMark(
                    frequency_hz=frequency,
                    label=label,
                    series=mesh.stage - 1,
                    half_width_hz=k * width,
                )
    return [by_place[key] for key in sorted(by_place)]


def close_up_harmonic(analysis: Analysis, stage: int) -> int:
    """Return the mesh harmonic of a stage whose surroundings are worth a close look.

    The one whose sidebands changed most, if a reference tells; else the strongest.
    """
    changed: dict[int, float] = {}
    for change in analysis.changes:
        if change.stage == stage and change.kind == "sidebands":
            # capped, so that one line that vanished does not outweigh a whole row that rose
            size = min(abs(change.standardised), 6.0)
            changed[change.harmonic] = changed.get(change.harmonic, 0.0) + size
    if changed:
        return max(changed, key=lambda harmonic: changed[harmonic])
    signature = analysis.signature
    level = signature.level_db.max(axis=0)
    strong = [
        (float(level[column]), family.harmonic)
        for column, family in enumerate(signature.plan.families)
        if family.kind == "mesh" and family.stage == stage
    ]
    return max(strong)[1] if strong else 1


def close_up_views(
    analysis: Analysis, recording: Recording, mesh: MeshFinding
) -> tuple[list[SpectrumView], int]:
    """Return the surroundings of one mesh harmonic in every channel.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    recording : Recording
        Its recording.
    mesh : MeshFinding
        The mesh; if no mesh was found, the place where its first harmonic should be is shown.

    Returns
    -------
    views : list of SpectrumView
        One a channel.
    harmonic : int
        The mesh harmonic in the middle.
    """
    if not analysis.signature.found:
        return _searched(analysis, recording, mesh), 1
    harmonic = close_up_harmonic(analysis, mesh.stage)
    return _sidebands(analysis, recording, mesh, harmonic), harmonic


def _searched(analysis: Analysis, recording: Recording, mesh: MeshFinding) -> list[SpectrumView]:
    vibration = vibration_of(analysis, recording)
    spectrum, _ = time_spectrum(vibration.samples, vibration.sampling_rate_hz)
    signature = analysis.signature
    nominal = mesh.frequency_hz * signature.speed.nominal_hz / signature.speed.estimated_hz
    mark = LineMark(
        frequency_hz=nominal,
        label=f"GMF{mesh.stage} ×1",
        series=mesh.stage - 1,
        half_width_hz=SPEED_TOLERANCE * nominal,
    )
    band = (nominal * (1 - _SEARCH_SHOWN), nominal * (1 + _SEARCH_SHOWN))
    return _views(analysis, spectrum, band, (mark,))


def _sidebands(
    analysis: Analysis, recording: Recording, mesh: MeshFinding, harmonic: int
) -> list[SpectrumView]:
    signature = analysis.signature
    vibration = vibration_of(analysis, recording)
    speed = signature.speed.estimated_hz
    families = [
        family
        for family in signature.plan.families
        if family.kind == "sidebands" and family.stage == mesh.stage and family.harmonic == harmonic
    ]
    spacing = max((family.spacing for family in families), default=1.0)
    centre = harmonic * mesh.frequency_hz / speed
    top = 0.48 * vibration.sampling_rate_hz / speed
    mesh_order = mesh.frequency_hz / speed
    half = min(_CLOSE_UP_SPACINGS * spacing, _CLOSE_UP_MESHES * mesh_order)
    low, high = centre - half, centre + half
    orders = angle_spectrum(
        vibration.samples,
        vibration.sampling_rate_hz,
        signature.track,
        2 * signature.lines.block_turns,
        min(top, high),
    )
    spectrum = replace(orders, frequency_hz=orders.frequency_hz * speed)
    band = (max(low, 0.0) * speed, min(top, high) * speed)
    marks = tuple(m for m in mesh_marks(signature) if band[0] < m.frequency_hz < band[1])
    views = _views(analysis, spectrum, band, marks)
    names = [shaft_text(family.shaft, family.gear) for family in families]
    distinct = told_apart(names, [family.spacing for family in families])
    legend = tuple((name, row) for row, name in enumerate(distinct))
    return [
        replace(
            view,
            axis="Frequency at the mean speed (Hz)",
            sidebands=_sideband_marks(signature, channel, centre, families),
            legend=legend,
        )
        for channel, view in enumerate(views)
    ]


def _sideband_marks(
    signature: MeasuredSignature, channel: int, centre: float, families: Sequence[Family]
) -> tuple[LineMark, ...]:
    power = signature.lines.cross_power()[channel]
    noise = signature.lines.noise[channel]
    marks = []
    for row, family in enumerate(families):
        for line in family.lines:
            order = float(signature.plan.orders[line])
            number = round((order - centre) / family.spacing)
            heard = power[line] > noise[line]
            marks.append(
                LineMark(
                    frequency_hz=order * signature.speed.estimated_hz,
                    label=f"{number:+d}".replace("-", "−"),
                    series=row,
                    amplitude=float(np.sqrt(power[line])) if heard else None,
                )
            )
    return tuple(marks)


def _views(
    analysis: Analysis,
    spectrum: Spectrum,
    band: tuple[float, float],
    marks: tuple[LineMark, ...],
) -> list[SpectrumView]:
    inside = (spectrum.frequency_hz >= band[0]) & (spectrum.frequency_hz <= band[1])
    frequency: FloatArray = spectrum.frequency_hz[inside]
    views = []
    for row, channel in enumerate(analysis.signature.channel_names):
        x, y = max_hold(frequency, spectrum.values[row, inside])
        views.append(
            SpectrumView(
                channel=channel,
                unit=unit_text(analysis.signature.units[row]),
                axis="Frequency (Hz)",
                frequency_hz=x,
                amplitude=y,
                meshes=marks,
            )
        )
    return views
