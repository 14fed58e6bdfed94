"""From recording to verdict: the one place that strings the analysis together."""

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
from gearmon.diagnosis.evidence import level_flags, summary, tooth_flags
from gearmon.diagnosis.localisation import locate
from gearmon.diagnosis.results import Analysis, Change, Flag, ToothProfile
from gearmon.errors import ArgumentError, GearmonError
from gearmon.machine import Machine
from gearmon.signals.recording import Recording
from gearmon.signatures.indicators import gear_indicators, waveform_indicators
from gearmon.signatures.measured import MeasuredSignature, measure_signature
from gearmon.signatures.reference import Profile, Reference, make_reference, tooth_counts
from gearmon.signatures.signature import Signature

# A fault is called at this false-alarm probability; up to five times it the answer stays open.
FAULT_BELOW = 0.01
OPEN_BELOW = 0.05
# Shares of that probability given to all levels together, to the levels of one group of families,
# and to the search for a single tooth.
_LEVEL_SHARE, _GROUP_SHARE, _TOOTH_SHARE = 0.5, 0.3, 0.2


def learn(recordings: Sequence[Recording], machine: Machine) -> Reference:
    """Build a healthy reference from recordings.

    Parameters
    ----------
    recordings : sequence of Recording
        Healthy recordings of the same channels, at one or several loads.
    machine : Machine
        The machine.

    Returns
    -------
    Reference

    Raises
    ------
    GearmonError
        If a recording cannot be used.
    """
    return make_reference([measure_signature(r, machine) for r in recordings], machine)


def analyse(recording: Recording, machine: Machine, reference: Reference | None = None) -> Analysis:
    """Say whether a machine is healthy, and why.

    Parameters
    ----------
    recording : Recording
        The new recording.
    machine : Machine
        Its machine.
    reference : Reference, optional
        Healthy recordings to compare with. Without them the gear's own teeth and the expected
        signature have to do, which rarely allows more than "cannot tell".

    Returns
    -------
    Analysis

    Raises
    ------
    GearmonError
        If the recording cannot be used or the reference does not fit.
    """
    if reference is not None:
        _check_fit(machine, reference)
    signature = measure_signature(recording, machine)
    vibration = recording.vibration()
    indicators = waveform_indicators(vibration.samples, vibration.channel_names)
    if not signature.found:
        return _no_mesh(signature, machine, indicators)
    indicators |= gear_indicators(signature)
    expected, notes = _expected(signature, machine) if reference is None else (None, ())
    comparison = _compare(signature, reference) if reference is not None else None
    profiles = _profiles(signature, reference, comparison)
    return _judged(signature, machine, indicators, comparison, profiles, expected, notes)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Comparison:
    """Levels against a reference, with what was compared."""

    change: LevelChange
    test: LevelTest
    groups: tuple[GroupTest, ...]
    rows: tuple[int, ...]
    reference_rows: tuple[int, ...]
    columns: tuple[int, ...]
    warnings: tuple[str, ...]


def _check_fit(machine: Machine, reference: Reference) -> None:
    if reference.teeth != tooth_counts(machine):
        raise ArgumentError(
            f"the reference was learned for teeth {reference.teeth} ({reference.machine}), the "
            f"machine file has {tooth_counts(machine)}; learn one for this machine"
        )


def _compare(signature: MeasuredSignature, reference: Reference) -> _Comparison:
    """Compare the channels and families that recording and reference share."""
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
    if not columns:
        raise ArgumentError(
            f"{signature.origin}: shares no family of lines with the reference: sampling rate or "
            "length differ too much"
        )
    theirs = [reference.family_names.index(names[i]) for i in columns]
    pick = np.ix_(rows, columns)
    healthy_pick = np.ix_(range(len(reference.profiles)), reference_rows, theirs)
    change = compare_levels(
        signature.level_db[pick],
        signature.scatter_db[pick],
        reference.level_db[healthy_pick],
        reference.scatter_db[healthy_pick],
    )
    families = [signature.plan.families[i] for i in columns]
    harmonics = len({(family.stage, family.harmonic) for family in families})
    independent = harmonics * float(np.sqrt(len(rows)))
    return _Comparison(
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


def _profiles(
    signature: MeasuredSignature, reference: Reference | None, comparison: _Comparison | None
) -> tuple[ToothProfile, ...]:
    """Look for a departing tooth on every gear that the recording resolves."""
    own = Profile.of(signature)
    rows = comparison.rows if comparison else tuple(range(len(signature.channel_names)))
    theirs = comparison.reference_rows if comparison else ()
    healthy_profiles = reference.profiles if reference is not None else ()
    profiles = []
    for wheel in own.wheels:
        healthy = [
            other
            for profile in healthy_profiles
            for other in profile.wheels
            if (other.stage, other.gear, other.teeth) == (wheel.stage, wheel.gear, wheel.teeth)
        ]
        if reference is not None and not healthy:
            continue
        # the tachometer's zero is that of shaft 1: other shafts stand anywhere when it comes
        numbered = own.tacho and abs(wheel.order - 1.0) < 1e-12
        same_zero = numbered and all(profile.tacho for profile in healthy_profiles)
        profile = locate(
            wheel, rows, healthy, theirs, numbered=numbered, same_zero=same_zero and bool(healthy)
        )
        if profile is not None:
            profiles.append(profile)
    return tuple(profiles)


def _expected(
    signature: MeasuredSignature, machine: Machine
) -> tuple[Signature | None, tuple[str, ...]]:
    """Return the expected signature up to half the sampling rate, or why there is none."""
    from gearmon.signatures.expected import expected_signature  # not needed with a reference

    try:
        return expected_signature(machine, max_hz=0.5 * signature.sampling_rate_hz), ()
    except GearmonError as error:
        return None, (f"no expected signature: {error}",)


def _judged(
    signature: MeasuredSignature,
    machine: Machine,
    indicators: dict[str, dict[str, float]],
    comparison: _Comparison | None,
    profiles: tuple[ToothProfile, ...],
    expected: Signature | None,
    notes: tuple[str, ...],
) -> Analysis:
    tooth = _best_tooth(profiles)
    combined, score = tooth, -tooth
    if comparison is not None:
        strongest = comparison.groups[0].log10_probability
        # not corrected for the number of tests: healthy recordings then still have an order
        score = -min(comparison.test.log10_probability, strongest, tooth)
        combined = min(
            0.0,
            comparison.test.log10_probability - np.log10(_LEVEL_SHARE),
            strongest - np.log10(_GROUP_SHARE),
            tooth - np.log10(_TOOTH_SHARE),
        )
    probability = float(10.0**combined)
    changes = _changes(signature, comparison)
    flags: tuple[Flag, ...] = ()
    if probability < FAULT_BELOW:
        groups = comparison.groups if comparison else ()
        flags = tooth_flags(profiles, FAULT_BELOW, len(profiles), groups)
        if comparison is not None:
            flags += level_flags(changes, comparison.groups, comparison.test, FAULT_BELOW)
    verdict = _verdict(probability, with_reference=comparison is not None)
    warnings = signature.notes + notes + (comparison.warnings if comparison else ())
    against = "reference" if comparison else "expected signature" if expected else "nothing"
    missing = [mesh for mesh in signature.meshes if not mesh.found]
    warnings += tuple(f"mesh of stage {mesh.stage} not found: {mesh.reason}" for mesh in missing)
    return Analysis(
        recording=signature.origin,
        machine=machine.name,
        verdict=verdict,
        reason=summary(verdict, changes, profiles, comparison.test if comparison else None),
        score=abs(float(score)),
        false_alarm_probability=probability,
        compared_with=against,
        signature=signature,
        indicators=indicators,
        changes=changes,
        profiles=profiles,
        flags=flags,
        expected=expected,
        warnings=warnings,
    )


def _best_tooth(profiles: Sequence[ToothProfile]) -> float:
    """log10 of the probability of the most striking tooth, corrected for the gears looked at."""
    if not profiles:
        return 0.0
    best = min(profile.log10_probability for profile in profiles)
    return min(0.0, best + float(np.log10(len(profiles))))


def _verdict(probability: float, *, with_reference: bool) -> str:
    if probability < FAULT_BELOW:
        return "fault"
    if not with_reference or probability < OPEN_BELOW:
        return "cannot tell"
    return "healthy"


def _changes(signature: MeasuredSignature, comparison: _Comparison | None) -> tuple[Change, ...]:
    if comparison is None:
        return ()
    change = comparison.change
    rows = []
    for i, channel in enumerate(comparison.rows):
        for j, column in enumerate(comparison.columns):
            family = signature.plan.families[column]
            rows.append(
                Change(
                    channel=signature.channel_names[channel],
                    family=family.name,
                    kind=family.kind,
                    stage=family.stage,
                    harmonic=family.harmonic,
                    gear=family.gear,
                    shaft=family.shaft,
                    level_db=float(change.expected_db[i, j] + change.residual_db[i, j]),
                    reference_db=float(change.expected_db[i, j]),
                    scatter_db=float(change.sigma_db[i, j]),
                )
            )
    return tuple(rows)


def _no_mesh(
    signature: MeasuredSignature, machine: Machine, indicators: dict[str, dict[str, float]]
) -> Analysis:
    reasons = "; ".join(f"stage {mesh.stage}: {mesh.reason}" for mesh in signature.meshes)
    return Analysis(
        recording=signature.origin,
        machine=machine.name,
        verdict="no mesh found",
        reason=f"No gear mesh of this machine stands out of the recording ({reasons}).",
        score=0.0,
        false_alarm_probability=1.0,
        compared_with="nothing",
        signature=signature,
        indicators=indicators,
        changes=(),
        profiles=(),
        flags=(),
        expected=None,
        warnings=signature.notes,
    )
