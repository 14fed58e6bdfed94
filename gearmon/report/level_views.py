"""From an analysis and its reference to the levels that pictures show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gearmon.diagnosis.results import Analysis, Change
from gearmon.report.views import (
    ChangesView,
    FamilyGroup,
    FloatArray,
    LevelsView,
    PatternView,
)
from gearmon.report.wording import shaft_text, told_apart, unit_text
from gearmon.signatures.families import Family
from gearmon.signatures.measured import MeasuredSignature
from gearmon.signatures.reference import Reference

# Changes of more than this many standard deviations are highlighted in pictures and tables.
BEYOND = 3.0
_KINDS = {"mesh": "mesh", "sidebands": "sidebands", "residual": "residual"}
# The colour scale of changes spans at least this and at most that [dB].
_LEAST_LIMIT_DB, _MOST_LIMIT_DB = 6.0, 20.0

# Stage, rank of the kind, negative spacing, gear: sorting by it is the order of the pictures.
_GroupKey = tuple[int, int, float, str]


def family_groups(families: Sequence[Family]) -> tuple[FamilyGroup, ...]:
    """Return the families by stage, kind and shaft, the mesh harmonics ascending in each group."""
    members: dict[_GroupKey, list[tuple[int, int]]] = {}
    labels: dict[_GroupKey, str] = {}
    for column, family in enumerate(families):
        kind = list(_KINDS).index(family.kind)
        key = (family.stage, kind, -family.spacing, family.gear)
        members.setdefault(key, []).append((family.harmonic, column))
        who = shaft_text(family.shaft, family.gear)
        labels[key] = f"mesh {family.stage}" if kind == 0 else f"{_KINDS[family.kind]}\n{who}"
    keys = sorted(members)
    distinct = dict(zip(keys, _distinct(keys, labels), strict=True))
    return tuple(
        FamilyGroup(
            stage=key[0],
            label=distinct[key],
            harmonics=tuple(harmonic for harmonic, _ in sorted(members[key])),
            columns=tuple(column for _, column in sorted(members[key])),
        )
        for key in keys
    )


def _distinct(keys: Sequence[_GroupKey], labels: Mapping[_GroupKey, str]) -> list[str]:
    """Labels of the groups; two spacings of one gear in one stage are told apart by their order."""
    result: list[str] = []
    for stage in sorted({key[0] for key in keys}):
        own = [key for key in keys if key[0] == stage]
        result += told_apart([labels[key] for key in own], [-key[2] for key in own])
    return result


def level_views(analysis: Analysis, reference: Reference | None) -> list[LevelsView]:
    """Return the levels of every channel, with those of the healthy recordings if there are any.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    reference : Reference or None
        What it was compared with.

    Returns
    -------
    list of LevelsView
        One a channel.
    """
    signature = analysis.signature
    groups = family_groups(signature.plan.families)
    changes = _by_place(analysis.changes)
    views = []
    for row, channel in enumerate(signature.channel_names):
        own = [changes.get((channel, family.name)) for family in signature.plan.families]
        low, high = _healthy_range(signature, reference, channel)
        views.append(
            LevelsView(
                channel=channel,
                unit=unit_text(signature.units[row]),
                groups=groups,
                measured_db=signature.level_db[row],
                low_db=low,
                high_db=high,
                expected_db=np.array([c.reference_db if c else np.nan for c in own]),
                scatter_db=np.array([c.scatter_db if c else np.nan for c in own]),
                beyond=np.array([c is not None and is_beyond(c) for c in own], dtype=bool),
            )
        )
    return views


def is_beyond(change: Change) -> bool:
    """Tell whether a change exceeds `BEYOND` standard deviations."""
    return abs(change.standardised) > BEYOND


def _by_place(changes: Sequence[Change]) -> dict[tuple[str, str], Change]:
    return {(change.channel, change.family): change for change in changes}


def _healthy_range(
    signature: MeasuredSignature, reference: Reference | None, channel: str
) -> tuple[FloatArray, FloatArray]:
    count = len(signature.plan.families)
    low, high = np.full(count, np.nan), np.full(count, np.nan)
    if reference is None or channel not in reference.channel_names:
        return low, high
    levels = reference.level_db[:, reference.channel_names.index(channel), :]
    known = {name: column for column, name in enumerate(reference.family_names)}
    for column, family in enumerate(signature.plan.families):
        if family.name in known:
            low[column] = levels[:, known[family.name]].min()
            high[column] = levels[:, known[family.name]].max()
    return low, high


def change_views(analysis: Analysis) -> list[ChangesView]:
    """Return the changes of each stage as a table of groups against channels and harmonics.

    Parameters
    ----------
    analysis : Analysis
        With changes; without, the list is empty.

    Returns
    -------
    list of ChangesView
        One a stage that has changes.
    """
    if not analysis.changes:
        return []
    signature = analysis.signature
    changes = _by_place(analysis.changes)
    sizes = [abs(change.change_db) for change in analysis.changes]
    limit = float(np.clip(np.percentile(sizes, 98), _LEAST_LIMIT_DB, _MOST_LIMIT_DB))
    groups = family_groups(signature.plan.families)
    views = []
    for stage in sorted({change.stage for change in analysis.changes}):
        own = [group for group in groups if group.stage == stage]
        harmonics = sorted({k for group in own for k in group.harmonics})
        shape = (len(own), len(signature.channel_names), len(harmonics))
        change_db, beyond = np.full(shape, np.nan), np.zeros(shape, dtype=bool)
        for row, group in enumerate(own):
            for k, column in zip(group.harmonics, group.columns, strict=True):
                name = signature.plan.families[column].name
                for block, channel in enumerate(signature.channel_names):
                    change = changes.get((channel, name))
                    if change is not None:
                        place = (row, block, harmonics.index(k))
                        change_db[place] = change.change_db
                        beyond[place] = is_beyond(change)
        views.append(
            ChangesView(
                stage=stage,
                rows=tuple(group.label.replace("\n", ", ") for group in own),
                channels=signature.channel_names,
                harmonics=tuple(harmonics),
                change_db=change_db,
                beyond=beyond,
                limit_db=limit,
            )
        )
    return views


def pattern_views(analysis: Analysis) -> list[PatternView]:
    """Return the mesh harmonics of each stage, expected and measured, relative to the strongest.

    Parameters
    ----------
    analysis : Analysis
        With an expected signature; without, the list is empty.

    Returns
    -------
    list of PatternView
        One a stage for which both are known.
    """
    if analysis.expected is None:
        return []
    views = [
        _pattern(analysis, mesh.stage, mesh.frequency_hz) for mesh in analysis.signature.meshes
    ]
    return [view for view in views if view is not None]


def _pattern(analysis: Analysis, stage: int, mesh_hz: float) -> PatternView | None:
    expected, signature = analysis.expected, analysis.signature
    if expected is None:
        return None
    chosen = (expected["stage"] == stage) & (expected["sideband"] == 0)
    by_harmonic = dict(
        zip(
            expected["mesh_harmonic"][chosen].tolist(),
            expected["acceleration_ms2"][chosen].tolist(),
            strict=True,
        )
    )
    columns = {
        family.harmonic: column
        for column, family in enumerate(signature.plan.families)
        if family.kind == "mesh"
        and family.stage == stage
        and by_harmonic.get(family.harmonic, 0) > 0
    }
    harmonics = sorted(columns)
    if len(harmonics) < 2:
        return None
    taken = [columns[k] for k in harmonics]
    level = np.where(signature.heard[:, taken], signature.level_db[:, taken], np.nan)
    theory = 20 * np.log10([by_harmonic[k] for k in harmonics])
    strongest = np.max(level, axis=1, keepdims=True, initial=-np.inf, where=np.isfinite(level))
    return PatternView(
        stage=stage,
        harmonics=np.array(harmonics),
        frequency_hz=mesh_hz * np.array(harmonics, dtype=float),
        expected_db=theory - theory.max(),
        channels=signature.channel_names,
        measured_db=level - np.where(np.isfinite(strongest), strongest, 0.0),
    )
