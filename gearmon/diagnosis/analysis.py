"""From recording to verdict: the one place that strings the analysis together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.diagnosis.against_reference import Comparison, compare
from gearmon.diagnosis.evidence import level_flags, summary, tooth_flags
from gearmon.diagnosis.fault_types.features import FeatureVector, kind_features
from gearmon.diagnosis.flagging import (
    finding_flag,
    foreign_flags,
    named_by_kind,
    response_warnings,
    runout_flags,
)
from gearmon.diagnosis.kind_runout import RunoutGrowth, healthy_turns, runout_growth
from gearmon.diagnosis.kind_turns import turn_changes
from gearmon.diagnosis.localisation import locate
from gearmon.diagnosis.nongear import NonGearFinding as ForeignFinding
from gearmon.diagnosis.nongear import nongear_findings as foreign_findings
from gearmon.diagnosis.results import Analysis, Change, Flag, ToothProfile
from gearmon.diagnosis.tooth_evidence import ToothFinding, find_tooth, with_finding
from gearmon.errors import ArgumentError, GearmonError
from gearmon.gears.kinematics import kinematics
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
# to the search for a single tooth, to lines of no gear, and to runout. Their sum exceeds 1: the
# tests of levels rest on scatter assumed on the safe side, and hardly ever give a false alarm.
_LEVEL_SHARE, _GROUP_SHARE, _TOOTH_SHARE, _FOREIGN_SHARE = 0.4, 0.3, 0.6, 0.05
_RUNOUT_SHARE = 0.05
# Of that of the search for a tooth, the part for gears that the matched search cannot judge.
_REST_SHARE = 0.5


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
    evidence = _evidence(signature, machine, reference)
    return _judged(signature, machine, indicators, evidence, expected, notes)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Evidence:
    """All that was compared."""

    profiles: tuple[ToothProfile, ...]
    comparison: Comparison | None = None
    finding: ToothFinding | None = None
    foreign: tuple[ForeignFinding, ...] = ()
    changes: tuple[Change, ...] = ()
    features: FeatureVector | None = None
    runout: tuple[RunoutGrowth, ...] = ()


def _evidence(
    signature: MeasuredSignature, machine: Machine, reference: Reference | None
) -> _Evidence:
    own = Profile.of(signature)
    if reference is None:
        return _Evidence(profiles=_profiles(signature, own, None, None))
    foreign = foreign_findings(signature, reference, kinematics(machine))
    striking = [f for f in foreign if f.false_alarm_probability < FAULT_BELOW]
    comparison = compare(signature, reference, striking)
    profiles = _profiles(signature, own, reference, comparison)
    finding = find_tooth(
        own, comparison.rows, reference.profiles, comparison.reference_rows, machine, profiles
    )
    changes = _changes(signature, comparison)
    healthy = [profile.wheels for profile in reference.profiles]
    turns = turn_changes(own.wheels, comparison.rows, healthy, comparison.reference_rows)
    return _Evidence(
        profiles=with_finding(profiles, finding, float(np.log10(FAULT_BELOW * _TOOTH_SHARE))),
        comparison=comparison,
        finding=finding,
        foreign=foreign,
        changes=changes,
        features=kind_features(changes, profiles, turns),
        runout=runout_growth(turns, healthy_turns(healthy, comparison.reference_rows)),
    )


def _check_fit(machine: Machine, reference: Reference) -> None:
    if reference.teeth != tooth_counts(machine):
        raise ArgumentError(
            f"the reference was learned for teeth {reference.teeth} ({reference.machine}), the "
            f"machine file has {tooth_counts(machine)}; learn one for this machine"
        )


def _profiles(
    signature: MeasuredSignature,
    own: Profile,
    reference: Reference | None,
    comparison: Comparison | None,
) -> tuple[ToothProfile, ...]:
    """Look for a departing tooth on every gear that the recording resolves."""
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
    evidence: _Evidence,
    expected: Signature | None,
    notes: tuple[str, ...],
) -> Analysis:
    comparison, profiles = evidence.comparison, evidence.profiles
    tests = _tests(evidence)
    # weighed as the verdict weighs them, but never cut off at a probability of 1 as that is
    largest = max(share for share, _ in tests)
    score = max(0.0, *(float(np.log10(share / largest)) - log10 for share, log10 in tests))
    probability = float(10.0 ** min(0.0, *(log10 - np.log10(share) for share, log10 in tests)))
    flags: tuple[Flag, ...] = ()
    if probability < FAULT_BELOW:
        flags = _flags(evidence, machine)
    verdict = _verdict(probability, with_reference=comparison is not None)
    warnings = signature.notes + notes + (comparison.warnings if comparison else ())
    against = "reference" if comparison else "expected signature" if expected else "nothing"
    missing = [mesh for mesh in signature.meshes if not mesh.found]
    warnings += tuple(f"mesh of stage {mesh.stage} not found: {mesh.reason}" for mesh in missing)
    if comparison is not None and evidence.finding is not None:
        warnings += response_warnings(evidence.finding)
    test = comparison.test if comparison else None
    return Analysis(
        recording=signature.origin,
        machine=machine.name,
        verdict=verdict,
        reason=summary(verdict, evidence.changes, profiles, test),
        score=score,
        false_alarm_probability=probability,
        compared_with=against,
        signature=signature,
        indicators=indicators,
        changes=evidence.changes,
        profiles=profiles,
        flags=flags,
        expected=expected,
        warnings=warnings,
        foreign=evidence.foreign,
    )


def _tests(evidence: _Evidence) -> list[tuple[float, float]]:
    """Every test made: its share of the false alarms, and log10 of its probability."""
    if evidence.comparison is None:
        return [(1.0, _best_tooth(evidence.profiles))]
    comparison, finding = evidence.comparison, evidence.finding
    searched = (
        {(gear.match.stage, gear.match.gear) for gear in finding.searched} if finding else set()
    )
    # gears that the matched search could not judge
    rest = [p for p in evidence.profiles if (p.stage, p.gear) not in searched]
    tooth = _best_tooth(rest) if rest else 0.0
    if finding is not None:
        tooth = min(finding.log10_probability, tooth - float(np.log10(_REST_SHARE)))
    foreign = min((f.log10_probability for f in evidence.foreign), default=0.0)
    runout = min((growth.log10_probability for growth in evidence.runout), default=0.0)
    return [
        (_LEVEL_SHARE, comparison.test.log10_probability),
        (_GROUP_SHARE, comparison.groups[0].log10_probability),
        (_TOOTH_SHARE, min(0.0, tooth)),
        (_FOREIGN_SHARE, foreign),
        (_RUNOUT_SHARE, runout),
    ]


def _flags(evidence: _Evidence, machine: Machine) -> tuple[Flag, ...]:
    """Flag what stands out: a tooth, groups of families, lines of no gear."""
    comparison, finding = evidence.comparison, evidence.finding
    if comparison is None:
        return tooth_flags(evidence.profiles, FAULT_BELOW, len(evidence.profiles))
    found: list[Flag] = []
    tooth_limit = FAULT_BELOW * _TOOTH_SHARE
    if finding is not None and finding.log10_probability < np.log10(tooth_limit):
        found.append(
            finding_flag(finding, evidence.profiles, evidence.features, machine, _TOOTH_SHARE)
        )
    else:
        rest = evidence.profiles if finding is None else ()
        found += tooth_flags(rest, tooth_limit, len(rest), comparison.groups)
    found += runout_flags(
        evidence.runout, FAULT_BELOW, _RUNOUT_SHARE, found, evidence.features, finding
    )
    found += level_flags(evidence.changes, comparison.groups, comparison.test, FAULT_BELOW)
    if not any(flag.tooth for flag in found):
        found = list(named_by_kind(found, evidence.features, finding))
    found += foreign_flags(evidence.foreign, FAULT_BELOW, _FOREIGN_SHARE)
    return tuple(found)


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


def _changes(signature: MeasuredSignature, comparison: Comparison | None) -> tuple[Change, ...]:
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
