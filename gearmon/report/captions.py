"""What to look for in each picture, and what is to be seen there, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearmon.diagnosis.results import Analysis, ToothProfile
from gearmon.report.level_views import BEYOND, is_beyond
from gearmon.report.turn_views import MOST_CHANNELS, flagged_place, peak_place
from gearmon.report.views import PatternView, SpectrumView
from gearmon.report.wording import counted, percent, probability_text
from gearmon.signatures.families import NEAR_SIDEBANDS, WheelLines
from gearmon.signatures.measured import MeshFinding
from gearmon.signatures.reference import Reference
from gearmon.signatures.speed import SPEED_TOLERANCE


def spectrum(analysis: Analysis) -> str:
    """Return what to look for in the spectra."""
    if not analysis.signature.found:
        return (
            "Dashed lines: where the mesh harmonics (GMF) of the machine file should be; shaded: "
            f"the ± {percent(SPEED_TOLERANCE, 0)} about the nominal speed that were searched. Look "
            "for a row of lines, one in each shaded range: none was found that stands out from "
            "those of other tooth counts. Lines may come from bearings, the electrical supply or "
            "another machine; check tooth counts, speed and channel before trusting the verdict."
        )
    return (
        "Look for the mesh harmonics (dashed, GMF1 ×2 is the second harmonic of mesh 1) standing "
        "out of the floor, and for skirts of sidebands around them. Strong lines between the "
        "marks come from something other than these gears."
    )


def spectrum_alt(views: Sequence[SpectrumView]) -> str:
    """Return what the spectra show."""
    parts = []
    for view in views:
        if len(view.amplitude):
            at = int(np.argmax(view.amplitude))
            parts.append(
                f"{view.channel} peaks with {view.amplitude[at]:.3g} {view.unit} at "
                f"{view.frequency_hz[at]:.1f} Hz"
            )
    return f"Amplitude spectra of {counted(len(views), 'channel')}: {'; '.join(parts)}."


def close_up(analysis: Analysis, mesh: MeshFinding, first: bool) -> str:
    """Return what to look for around one mesh harmonic, at length in the `first` such picture."""
    if not analysis.signature.found:
        return (
            f"The place of mesh {mesh.stage} at the nominal speed. A mesh would show a line inside "
            f"the shaded range, with others at its multiples. Not found: {mesh.reason}."
        )
    chosen = (
        "This harmonic is shown because its sidebands changed most"
        if any(c.stage == mesh.stage and c.kind == "sidebands" for c in analysis.changes)
        else "This harmonic is shown because it is the strongest"
    )
    if not first:
        return f"{chosen}. Ticks and symbols as above."
    return (
        f"{chosen}. Ticks along the bottom: every place of a sideband up to the "
        f"{NEAR_SIDEBANDS}th; open symbols: those heard above the floor. A row of sidebands at the "
        "spacing of one shaft points at a gear on that shaft; which shaft is the question to ask "
        "of this picture. Sampled at equal angles, so that a wandering speed smears nothing."
    )


def close_up_alt(analysis: Analysis, mesh: MeshFinding, harmonic: int) -> str:
    """Return what the close-up shows."""
    frequency = harmonic * mesh.frequency_hz
    if not analysis.signature.found:
        return f"Spectrum around {frequency:.1f} Hz, where mesh {mesh.stage} was looked for."
    return (
        f"Spectrum around harmonic {harmonic} of mesh {mesh.stage} at {frequency:.1f} Hz with the "
        "places of the sidebands of each shaft."
    )


def levels(reference: Reference | None) -> str:
    """Return what to look for among the levels."""
    meaning = (
        "Each place is a family of lines, numbered by its mesh harmonic: the mesh harmonic itself, "
        f"its sidebands up to the {NEAR_SIDEBANDS}th at the spacing of one shaft, and the residual "
        "(what else repeats with that shaft)."
    )
    if reference is None:
        return f"{meaning} No reference was given: no level can be called high or low by itself."
    many = len(reference.origins)
    return (
        f"{meaning} Grey: range of the {counted(many, 'healthy recording')}. Dash: what the "
        "reference makes expect at this load and sensor gain; a measured level can thus leave the "
        f"grey range and still be as expected. Look for diamonds: changes beyond {BEYOND:g} "
        "standard deviations. One alone among many is chance; a row of them at one shaft is not."
    )


def levels_alt(analysis: Analysis) -> str:
    """Return what the levels show."""
    beyond = sum(is_beyond(change) for change in analysis.changes)
    families = counted(len(analysis.signature.plan.families), "family", "families")
    return (
        f"Levels of {families} of lines in "
        f"{counted(len(analysis.signature.channel_names), 'channel')}; {beyond} changed by more "
        f"than {BEYOND:g} standard deviations."
    )


def changes() -> str:
    """Return what to look for among the changes."""
    return (
        "Measured less expected level in dB; red is louder, blue quieter than the healthy machine. "
        f"Framed: more than {BEYOND:g} standard deviations. Look for a whole row that is framed "
        "in several channels: its label names the shaft. A fault may make some lines quieter."
    )


def changes_alt(analysis: Analysis) -> str:
    """Return what the changes show."""
    strongest = max(analysis.changes, key=lambda change: abs(change.standardised))
    return (
        f"Table of changes by channel and family of lines; the clearest is {strongest.family} in "
        f"{strongest.channel}: {strongest.change_db:+.1f} dB, "
        f"{abs(strongest.standardised):.1f} standard deviations."
    )


def pattern() -> str:
    """Return what to look for in the mesh harmonics."""
    return (
        "Bars: acceleration expected at the mesh from the gear data. Symbols: measured at the "
        "sensors. Each is relative to its own strongest harmonic. The path from the mesh to the "
        "sensor, with its resonances, colours what arrives: differences of 10 to 20 dB are usual "
        "and no sign of damage. The picture tells whether the same harmonics carry the vibration; "
        "only the healthy reference tells whether something changed."
    )


def pattern_alt(views: Sequence[PatternView]) -> str:
    """Return what the patterns show."""
    parts = [
        f"of mesh {view.stage} harmonic {view.harmonics[int(np.argmax(view.expected_db))]} is "
        "expected strongest"
        for view in views
    ]
    return f"Relative levels of mesh harmonics, expected and measured; {', '.join(parts)}."


def turn(analysis: Analysis, wheel: WheelLines, profile: ToothProfile | None, first: bool) -> str:
    """Return what to look for in the turn of a gear, at length in the `first` such picture."""
    text = _turn_curves(analysis) if first else ""
    if profile is None:
        text += " The recording resolves too few lines of this gear for an energy by tooth."
        return text.strip()
    if first:
        against = (
            "the departure from the healthy reference"
            if profile.against == "reference"
            else "what sets each tooth apart from the others of this gear (no reference)"
        )
        text += f" Bars: energy of {against}, all channels, in windows of two teeth, median 1."
    flagged = flagged_place(analysis, wheel.stage, wheel.gear) is not None
    text += (
        f" The highest of the {wheel.teeth} is {profile.ratio:.1f} times the median; a healthy "
        "gear shows as much somewhere in its turn with probability "
        f"{probability_text(10.0**profile.log10_probability)}"
        f"{': flagged' if flagged else ''}."
    )
    if first and profile.tooth is None:
        text += (
            " Without a tachometer pulse on this shaft the tooth numbers count from where the "
            "recording happens to start: the pattern is real, the number is not that of the gear."
        )
    return text.strip()


def _turn_curves(analysis: Analysis) -> str:
    text = (
        "Grey: synchronous average, what repeats with every turn of this gear. Blue: the same "
        "without the mesh harmonics, on the same scale. A damaged tooth shows as a short burst at "
        "one place of the blue curve in every channel; a slow wave over the turn is eccentricity."
    )
    if len(analysis.signature.channel_names) > MOST_CHANNELS:
        text += f" The {MOST_CHANNELS} strongest channels are shown."
    return text


def turn_alt(analysis: Analysis, wheel: WheelLines, profile: ToothProfile | None) -> str:
    """Return what the turn shows."""
    text = f"Synchronous average over one turn of the {wheel.gear} of stage {wheel.stage}"
    if profile is None:
        return f"{text}."
    flagged = flagged_place(analysis, wheel.stage, wheel.gear) is not None
    place = round(peak_place(profile))
    return (
        f"{text} and energy by tooth: highest at place {place} of {wheel.teeth}, "
        f"{profile.ratio:.1f} times the median, {'flagged' if flagged else 'not flagged'}."
    )


def speed(analysis: Analysis) -> str:
    """Return what to look for in the speed."""
    found = analysis.signature.speed
    how = (
        "from the tachometer pulses"
        if found.method == "tacho"
        else "from the mesh and shaft lines of all stages together"
    )
    wander = (found.highest_hz - found.lowest_hz) / found.estimated_hz
    away = found.estimated_hz / found.nominal_hz - 1
    return (
        f"Speed of shaft 1 {how}: {percent(away, signed=True)} from nominal, wandering over "
        f"{percent(wander)} within the recording. Steps or spikes here mean that the speed was "
        "lost, and that all else in this report should be taken with care; a smooth wander is "
        "harmless."
    )


def speed_alt(analysis: Analysis) -> str:
    """Return what the speed shows."""
    found = analysis.signature.speed
    return (
        f"Speed of shaft 1 between {found.lowest_hz:.5g} and {found.highest_hz:.5g} Hz, mean "
        f"{found.estimated_hz:.6g} Hz, nominal {found.nominal_hz:.5g} Hz."
    )
