"""Short texts for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from gearmon.diagnosis.results import Analysis, Flag
from gearmon.gears.kinematics import LineTable
from gearmon.report.level_views import BEYOND, is_beyond
from gearmon.report.tables import Table, mesh_sentences
from gearmon.report.wording import (
    counted,
    gear_text,
    loss_text,
    printable,
    probability_text,
    score_text,
    with_uncertainty,
)
from gearmon.signatures.listing import signature_lines
from gearmon.signatures.reference import Reference
from gearmon.signatures.signature import Signature

# Sentences of evidence that a terminal shows of each flag; the report has them all.
_SENTENCES = 2


def analysis_text(analysis: Analysis, most_changes: int = 5) -> str:
    """Return an analysis in some lines: the verdict first, then why.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    most_changes : int
        Largest number of changes to list, the most significant first.

    Returns
    -------
    str
        Lines without a final line break.
    """
    lines = [f"{printable(analysis.recording)}: {analysis.verdict.upper()}", f"  {analysis.reason}"]
    lines.append(
        f"  score {score_text(analysis.score)}, false-alarm probability "
        f"{probability_text(analysis.false_alarm_probability)}, compared with "
        f"{analysis.compared_with}"
    )
    speed = analysis.signature.speed
    if analysis.signature.found:
        running = with_uncertainty(speed.estimated_hz, speed.uncertainty_hz, "Hz")
        lines.append(
            f"  shaft 1 at {running} ({60 * speed.estimated_hz:.1f} rpm), by {speed.method}"
        )
    lines += [f"  {sentence}" for sentence in mesh_sentences(analysis)]
    for flag in analysis.flags:
        lines += _flag_lines(flag)
    # the flags' own evidence names the strongest changes already
    lines += _change_lines(analysis, 0 if analysis.flags else most_changes)
    lines += [f"  note: {warning}" for warning in analysis.warnings]
    return "\n".join(lines)


def _flag_lines(flag: Flag) -> list[str]:
    loss = loss_text(flag.stiffness_loss, flag.stiffness_loss_low, flag.stiffness_loss_high)
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
    return "\n".join(lines)


def signature_text(signature: Signature, most: int = 30) -> str:
    """Return a signature: what holds for each stage, then its strongest lines by frequency.

    Parameters
    ----------
    signature : Signature
        The signature.
    most : int
        Largest number of lines.
    """
    return "\n".join(signature_lines(signature, most))


def line_table_text(lines: LineTable) -> str:
    """Return the lines of a machine as a table in columns, with its notes.

    Parameters
    ----------
    lines : LineTable
        The lines.
    """
    several = len({row.operating for row in lines}) > 1
    rows = tuple(
        (
            *((row.operating,) if several else ()),
            "–" if row.stage is None else str(row.stage),
            row.kind,
            row.name,
            "–" if row.shaft is None else str(row.shaft),
            f"{row.order:.5f}",
            f"{row.frequency_hz:.3f}",
        )
        for row in lines
    )
    headings = ("stage", "kind", "line", "shaft", "order", "Hz")
    table = Table(
        headings=(("operating",) if several else ()) + headings,
        rows=rows,
        align="l" * several + "rllrrr",
    )
    notes = [f"note: {note}" for note in lines.notes]
    return "\n".join([lines.machine or "machine", *table_lines(table), *notes])


def table_lines(table: Table) -> list[str]:
    """Return a table in columns of equal width, two spaces apart.

    Parameters
    ----------
    table : Table
        The table.

    Examples
    --------
    >>> table_lines(Table(headings=("name", "Hz"), rows=(("mesh", "4.25"),), align="lr"))
    ['name    Hz', 'mesh  4.25']
    """
    everything: Sequence[tuple[str, ...]] = (table.headings, *table.rows)
    widths = [max(len(row[column]) for row in everything) for column in range(len(table.headings))]
    return [
        "  ".join(
            cell.rjust(width) if side == "r" else cell.ljust(width)
            for cell, width, side in zip(row, widths, table.align, strict=True)
        ).rstrip()
        for row in everything
    ]
