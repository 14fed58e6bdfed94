"""Levels of a recording against a reference: what is compared, and what limits it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.diagnosis.comparison import (
    GroupTest,
    LevelChange,
    LevelTest,
    compare_levels,
    judge_groups,
    judge_levels,
)
from gearmon.diagnosis.nongear import NonGearFinding as ForeignFinding
from gearmon.diagnosis.nongear import disturbed
from gearmon.diagnosis.speed_scatter import family_speed_scatter_db
from gearmon.errors import ArgumentError
from gearmon.signatures.measured import MeasuredSignature
from gearmon.signatures.reference import Reference


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Levels against a reference, with what was compared."""

    change: LevelChange
    test: LevelTest
    groups: tuple[GroupTest, ...]
    rows: tuple[int, ...]
    reference_rows: tuple[int, ...]
    columns: tuple[int, ...]
    warnings: tuple[str, ...]


def compare(
    signature: MeasuredSignature, reference: Reference, foreign: Sequence[ForeignFinding] = ()
) -> Comparison:
    """Compare the channels and families that recording and reference share.

    Parameters
    ----------
    signature : MeasuredSignature
        The new recording.
    reference : Reference
        Healthy recordings.
    foreign : sequence of ForeignFinding
        Lines of no gear; families that they disturb are left out.

    Returns
    -------
    Comparison

    Raises
    ------
    ArgumentError
        If they share no channel or no family.
    """
    shared = [name for name in signature.channel_names if name in reference.channel_names]
    if not shared:
        raise ArgumentError(
            f"{signature.origin}: channels {', '.join(signature.channel_names)} are not in the "
            f"reference, which has {', '.join(reference.channel_names)}"
        )
    rows = tuple(signature.channel_names.index(name) for name in shared)
    reference_rows = tuple(reference.channel_names.index(name) for name in shared)
    names = [family.name for family in signature.plan.families]
    columns = tuple(i for i, name in enumerate(names) if name in reference.family_names)
    resolution = 2.0 / signature.lines.block_turns
    mask = disturbed(signature.plan.orders, foreign, resolution)
    clean = tuple(i for i in columns if not mask[list(signature.plan.families[i].lines)].any())
    columns = clean or columns
    if not columns:
        raise ArgumentError(
            f"{signature.origin}: shares no family of lines with the reference: sampling rate or "
            "length differ too much"
        )
    theirs = [reference.family_names.index(names[i]) for i in columns]
    pick = np.ix_(rows, columns)
    healthy_pick = np.ix_(range(len(reference.profiles)), reference_rows, theirs)
    families = [signature.plan.families[i] for i in columns]
    # a changed speed moves every line to another place of the path's response
    moved = family_speed_scatter_db(
        families,
        signature.plan.orders,
        signature.speed.estimated_hz,
        [profile.speed_hz for profile in reference.profiles],
    )
    change = compare_levels(
        signature.level_db[pick],
        np.sqrt(signature.scatter_db[pick] ** 2 + moved**2),
        reference.level_db[healthy_pick],
        reference.scatter_db[healthy_pick],
    )
    harmonics = len({(family.stage, family.harmonic) for family in families})
    independent = harmonics * float(np.sqrt(len(rows)))
    return Comparison(
        change=change,
        test=judge_levels(change.standardised, change.worth, independent),
        groups=judge_groups(change, families),
        rows=rows,
        reference_rows=reference_rows,
        columns=columns,
        warnings=_limits(signature, reference, shared),
    )


def _limits(
    signature: MeasuredSignature, reference: Reference, shared: Sequence[str]
) -> tuple[str, ...]:
    """Name what limits a comparison with this reference."""
    notes = []
    if len(reference.profiles) == 1:
        notes.append(
            "the reference is one recording: how healthy recordings differ from one another is "
            "assumed (2 dB a family, besides a common gain), not learned"
        )
    left_out = [name for name in signature.channel_names if name not in shared]
    if left_out:
        notes.append(f"channels not in the reference were left out: {', '.join(left_out)}")
    missing = [name for name in reference.channel_names if name not in shared]
    if missing:
        notes.append(
            f"channels of the reference not looked at: {', '.join(missing)}; a fault may show in "
            "those alone"
        )
    speeds = [profile.speed_hz for profile in reference.profiles]
    speed = signature.speed.estimated_hz
    if not 0.97 * min(speeds) <= speed <= 1.03 * max(speeds):
        notes.append(
            f"speed {speed:.2f} Hz lies outside the reference's {min(speeds):.2f} to "
            f"{max(speeds):.2f} Hz by more than 3 %: resonances may change levels"
        )
    return tuple(notes)
