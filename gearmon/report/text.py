"""An analysis in words: the lines of a terminal, the facts and tables of a report.

And what it rests on: the reference, and the lines of a machine.
"""

from __future__ import annotations

from gearmon import __version__
from gearmon.diagnosis.history import HistoryTrends
from gearmon.diagnosis.results import Analysis, Change, Flag
from gearmon.gears.kinematics import LineTable
from gearmon.machine import Machine, ParallelStage
from gearmon.report.text_tables import Table, table_lines
from gearmon.report.verdict import summary
from gearmon.report.wording import (
    counted,
    gear_text,
    loss_text,
    percent,
    printable,
    probability_text,
    score_text,
    unit_text,
    with_uncertainty,
)
from gearmon.signatures.measured.reference import Reference
from gearmon.signatures.speed import SPEED_REACH, SPEED_TOLERANCE, Speed

# Changes of more than this many standard deviations are highlighted in pictures and tables.
BEYOND = 3.0
# Sentences of evidence that a terminal shows of each flag; the report has them all.
_SENTENCES = 2
# Definitions of the usual condition indicators, by their name in lower case.
INDICATOR_DEFINITIONS = {
    "rms": "root mean square less the mean, in the unit of the signal",
    "peak to peak": "largest less smallest value, in the unit of the signal",
    "crest factor": "largest departure from the mean over the root mean square",
    "kurtosis": "fourth central moment over the squared variance; 3 for Gaussian noise, 1.5 for a "
    "sine",
    "fm0": "peak to peak of the synchronous average over the summed amplitudes of its mesh "
    "harmonics",
    "fm4": "kurtosis of the difference signal: the synchronous average without shaft lines, mesh "
    "harmonics and their first sidebands; 3 for Gaussian noise",
    "m6a": "sixth moment of the difference signal over its variance cubed; 15 for Gaussian noise",
    "m8a": "eighth moment of the difference signal over the fourth power of its variance; 105 for "
    "Gaussian noise",
    "energy ratio": "root mean square of the difference signal over that of the regular meshing "
    "signal",
    "ser": "sideband energy ratio: summed amplitudes of the sidebands up to the sixth over that of "
    "the first mesh harmonic",
    "sideband index": "mean amplitude of the sidebands ±1 of the first mesh harmonic, in the unit "
    "of the signal",
    "sideband level factor": "summed amplitudes of the sidebands ±1 of the first mesh harmonic "
    "over the standard deviation of the synchronous average",
    "na4": "fourth moment of the residual signal (the synchronous average without shaft lines and "
    "mesh harmonics) over the squared mean of its variances in the run so far; 3 for steady "
    "Gaussian noise",
    "na4*": "as NA4, with the variance held at that of the healthy records at the start of the run",
    "nb4": "as NA4, of the envelope of the synchronous average in a band about the first mesh "
    "harmonic",
    "nb4*": "as NB4, with the variance held at that of the healthy records at the start of the run",
}


def is_beyond(change: Change) -> bool:
    """Tell whether a change exceeds `BEYOND` standard deviations."""
    return abs(change.standardised) > BEYOND


def analysis_text(
    analysis: Analysis, history: HistoryTrends | None = None, most_changes: int = 5
) -> str:
    """Return an analysis in some lines: verdict, how sure, what to do; then the evidence.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    history : HistoryTrends, optional
        Of the machine: tells since when.
    most_changes : int
        Largest number of changes to list, the most significant first.

    Returns
    -------
    str
        Lines without a final line break.
    """
    own = summary(analysis, history)
    lines = [f"{printable(analysis.recording)}: {analysis.verdict.upper()}", f"  {own.what}"]
    lines += [f"  {name}: {text}" for name, text in own.lines()]
    lines += ["  evidence:", *([f"  {own.because}"] if own.because else [])]
    lines.append(f"  score {score_text(analysis.score)}, compared with {analysis.compared_with}")
    if analysis.signature.found:
        lines.append(f"  shaft 1 at {_running(analysis.signature.speed)}")
    lines += [f"  {sentence}" for sentence in mesh_sentences(analysis)]
    for flag in analysis.flags:
        lines += _flag_lines(flag)
    # the flags' own evidence names the strongest changes already
    lines += _change_lines(analysis, 0 if analysis.flags else most_changes)
    lines += [f"  note: {warning}" for warning in analysis.warnings]
    return "\n".join(lines)


def _flag_lines(flag: Flag) -> list[str]:
    loss = flag_loss(flag)
    head = f"  flag: {flag.kind}, {gear_text(flag.stage, flag.gear, flag.tooth)}"
    if loss:
        head += f", loss of stiffness {loss}"
    head += f", false-alarm probability {probability_text(flag.false_alarm_probability)}"
    return [head, *(f"    {sentence}" for sentence in flag.evidence[:_SENTENCES])]


def _change_lines(analysis: Analysis, most: int) -> list[str]:
    changed = sorted(
        (change for change in analysis.changes if is_beyond(change)),
        key=lambda change: -abs(change.standardised),
    )
    if not analysis.changes:
        return []
    head = (
        f"  {len(changed)} of {counted(len(analysis.changes), 'level')} changed by more than "
        f"{BEYOND:g} standard deviations"
    )
    if not changed or most < 1:
        return [head]
    rows = [
        f"    {change.channel}: {change.family} {change.change_db:+.1f} dB "
        f"(scatter {change.scatter_db:.1f} dB)"
        for change in changed[:most]
    ]
    return [f"{head}{', first of all' if len(changed) > most else ''}:", *rows]


def reference_text(reference: Reference) -> str:
    """Return what a reference holds.

    Parameters
    ----------
    reference : Reference
        The reference.

    Returns
    -------
    str
        Of several lines.
    """
    lines = [
        f"{reference.machine or 'machine'} ({reference.teeth}): reference of "
        f"{counted(len(reference.profiles), 'healthy recording')}",
        f"  channels {', '.join(reference.channel_names)}; "
        f"{counted(len(reference.family_names), 'family', 'families')} of lines",
    ]
    lines += [
        f"  {printable(profile.origin)}: {profile.duration_s:.4g} s, shaft 1 at "
        f"{profile.speed_hz:.4f} Hz{', tacho' if profile.tacho else ''}"
        for profile in reference.profiles
    ]
    lines += [f"  note: {printable(note)}" for note in reference.notes]
    return "\n".join(lines)


def line_table_text(lines: LineTable) -> str:
    """Return the lines of a machine as a table in columns, with its notes.

    Parameters
    ----------
    lines : LineTable
        The lines.

    Returns
    -------
    str
        Of several lines.
    """
    several = len({row.operating for row in lines}) > 1
    rows = [
        ({"operating": row.operating} if several else {})
        | {
            "stage": "–" if row.stage is None else str(row.stage),
            "kind": row.kind,
            "line": row.name,
            "shaft": "–" if row.shaft is None else str(row.shaft),
            "order": f"{row.order:.5f}",
            "Hz": f"{row.frequency_hz:.3f}",
        }
        for row in lines
    ]
    table = Table.of(rows, "l" * several + "rllrrr")
    notes = [f"note: {note}" for note in lines.notes]
    return "\n".join([lines.machine or "machine", *table_lines(table), *notes])


def facts(analysis: Analysis) -> tuple[tuple[str, str], ...]:
    """Return what a reader wants to know first: names with values."""
    signature, running = analysis.signature, "not known: no line of the machine was found"
    if signature.found:
        running = _running(signature.speed)
    channels = ", ".join(
        f"{name} ({unit_text(unit)})"
        for name, unit in zip(signature.channel_names, signature.units, strict=True)
    )
    return (
        ("Machine", printable(analysis.machine) or "without a name"),
        ("Recording", printable(analysis.recording)),
        ("Score", score_text(analysis.score)),
        ("Compared with", analysis.compared_with),
        ("Speed of shaft 1", running),
        ("Meshes", "; ".join(mesh_sentences(analysis))),
        ("Channels", printable(channels)),
        ("Length", f"{signature.duration_s:.4g} s at {signature.sampling_rate_hz:.6g} Hz"),
    )


def _running(speed: Speed) -> str:
    running = with_uncertainty(speed.estimated_hz, speed.uncertainty_hz, "Hz")
    return f"{running} ({60 * speed.estimated_hz:.1f} rpm), by {speed.method}"


def mesh_sentences(analysis: Analysis) -> list[str]:
    """Return one short statement for each mesh."""
    sentences = []
    for mesh in analysis.signature.meshes:
        if mesh.found:
            height = f", {mesh.snr_db:.0f} dB above the floor" if mesh.snr_db is not None else ""
            sentences.append(f"mesh {mesh.stage} found at {mesh.frequency_hz:.2f} Hz{height}")
        else:
            sentences.append(f"mesh {mesh.stage} not found")
    return sentences


def mesh_table(analysis: Analysis) -> Table:
    """Return the meshes, how clear they are and why they count as found or not."""
    rows = [
        {
            "Mesh": mesh.stage,
            "Frequency (Hz)": f"{mesh.frequency_hz:.3f}",
            "Found": "yes" if mesh.found else "no",
            "Over floor (dB)": "–" if mesh.snr_db is None else f"{mesh.snr_db:.1f}",
            "Score (σ)": f"{mesh.score:.1f}",
            "Why": mesh.reason,
        }
        for mesh in analysis.signature.meshes
    ]
    return Table.of(rows, "rrlrrl")


def flag_loss(flag: Flag) -> str:
    """Return the estimated loss of stiffness with its interval, "" if there is none."""
    return loss_text(flag.stiffness_loss, flag.stiffness_loss_low, flag.stiffness_loss_high)


def indicator_table(analysis: Analysis) -> tuple[Table, tuple[tuple[str, str], ...]]:
    """Return the condition indicators by channel, and the definitions of those that are known."""
    channels = analysis.signature.channel_names
    rows = tuple(
        (name, *(f"{values[c]:.4g}" if c in values else "–" for c in channels))
        for name, values in analysis.indicators.items()
    )
    known = {_plain_name(name): None for name in analysis.indicators}
    definitions = tuple(
        (name, INDICATOR_DEFINITIONS[name.lower()])
        for name in known
        if name.lower() in INDICATOR_DEFINITIONS
    )
    table = Table(headings=("Indicator", *channels), rows=rows, align="l" + "r" * len(channels))
    return table, definitions


def _plain_name(name: str) -> str:
    """Name of an indicator; what comes after a comma only says of which gear."""
    return name.split(",")[0].replace("_", " ").strip()


def change_table(analysis: Analysis) -> Table:
    """Return all changes, the most significant first, those beyond `BEYOND` marked."""
    changes = sorted(analysis.changes, key=lambda change: -abs(change.standardised))
    rows = [
        {
            "Channel": change.channel,
            "Family of lines": change.family,
            "Level (dB)": f"{change.level_db:.1f}",
            "Healthy (dB)": f"{change.reference_db:.1f}",
            "Change (dB)": f"{change.change_db:+.1f}".replace("-", "−"),
            "Scatter (dB)": f"{change.scatter_db:.1f}",
            "Change / scatter": f"{change.standardised:+.1f}".replace("-", "−"),
        }
        for change in changes
    ]
    return Table.of(rows, "llrrrrr", marked=[is_beyond(change) for change in changes])


def settings_table(analysis: Analysis, reference: Reference | None, machine: Machine) -> Table:
    """Return how the answer was found: what was given, and the lengths and limits used."""
    signature = analysis.signature
    lines = signature.lines
    rows = [
        ("Machine file", printable(machine.path) or "none (built in a program)"),
        ("Teeth", "; ".join(_teeth(machine))),
        ("Operating points", "; ".join(_operating(machine))),
        ("Reference", printable("; ".join(reference.origins)) if reference else "none"),
        (
            "Search for the speed",
            f"± {percent(SPEED_TOLERANCE, 0)} about each nominal speed; where that shows no clear "
            f"mesh, or not all of them, ± {percent(SPEED_REACH, 0)}",
        ),
        (
            "Order analysis",
            f"{lines.amplitude.shape[0]} half-overlapped Hann blocks of {lines.block_turns:.4g} "
            f"turns of shaft 1; {len(lines.orders)} lines in {len(signature.plan.families)} "
            "families",
        ),
        ("Highlighted", f"changes beyond {BEYOND:g} standard deviations"),
        ("Made with", f"gearmon {__version__}"),
    ]
    return Table(headings=("Setting", "Value"), rows=tuple(rows), align="ll")


def _teeth(machine: Machine) -> list[str]:
    parts = []
    for number, stage in enumerate(machine.stages, start=1):
        name = f" ({stage.name})" if stage.name else ""
        if isinstance(stage, ParallelStage):
            teeth = f"{stage.pinion_teeth}/{stage.gear_teeth}"
        else:
            teeth = (
                f"sun {stage.sun_teeth}, {stage.planets} planets {stage.planet_teeth}, "
                f"ring {stage.ring_teeth}"
            )
        parts.append(f"stage {number}{name}: {teeth}")
    return parts


def _operating(machine: Machine) -> list[str]:
    parts = []
    for point in machine.operating:
        torque = "" if point.torque_nm is None else f", {point.torque_nm:g} N·m"
        name = f"{point.name}: " if point.name else ""
        parts.append(f"{name}{point.speed_rpm:g} rpm{torque}")
    return parts
