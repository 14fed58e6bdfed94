"""Flags from what was found: of a tooth, of a kind, of lines of no gear."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from gearmon.diagnosis.foreign import ForeignFinding
from gearmon.diagnosis.kind_features import FeatureVector
from gearmon.diagnosis.kind_names import NONE
from gearmon.diagnosis.kind_rules import KindJudgement, judge_kind
from gearmon.diagnosis.results import Flag, ToothProfile
from gearmon.diagnosis.tooth_evidence import ToothFinding
from gearmon.errors import GearmonError
from gearmon.machine import Machine

# A kind is named if the rules hold it this likely, and for what a matched tooth may be besides one
# tooth, this much.
_NAMED, _RENAMED = 0.5, 0.8
# Kinds that a departure of one tooth may be part of.
_OF_TEETH = ("several teeth", "distributed pitting")


def finding_flag(
    finding: ToothFinding,
    profiles: Sequence[ToothProfile],
    features: FeatureVector | None,
    machine: Machine,
    share: float,
) -> Flag:
    """Flag the tooth that the matched search found.

    Parameters
    ----------
    finding : ToothFinding
        The tooth.
    profiles : sequence of ToothProfile
        All gears looked at, for the picture that the evidence points to.
    features : FeatureVector or None
        What the kind is judged by.
    machine : Machine
        For the size of the damage.
    share : float
        Share of the false alarms that the search has.

    Returns
    -------
    Flag
    """
    match, loss = finding.best.match, finding.loss
    judged = _judged(features, match.stage, match.gear)
    kind = "tooth damage"
    evidence = [
        f"the {match.gear} of stage {match.stage} departs from the healthy pattern as a loss of "
        f"{100 * loss.loss:.0f} % ({100 * loss.low:.0f} to {100 * loss.high:.0f} %) of the "
        f"stiffness of tooth {finding.tooth}'s pair would make it, {match.lines} lines looked at"
    ]
    if judged is not None and judged.kind in _OF_TEETH and judged.probability >= _RENAMED:
        kind = judged.kind
        evidence.append(f"more than one tooth departs: {judged.evidence[0]}")
    evidence.append(
        "teeth are counted from the one that enters mesh at the tachometer pulse"
        if finding.counted_from == "tacho"
        else "teeth are counted from where the first healthy recording begins: the same number is "
        "the same tooth in every recording compared with this reference"
    )
    evidence += _energy(profiles, match.stage, match.gear)
    evidence += [
        f"the {gear} of stage {stage} shows it too"
        + (" and may be the cause as well" if lead < np.log(10.0) else "")
        for gear, stage, lead in finding.rivals
    ]
    evidence += _size(machine, finding, kind)
    log10 = min(0.0, finding.log10_probability - float(np.log10(share)))
    return Flag(
        kind=kind,
        stage=match.stage,
        gear=match.gear,
        tooth=finding.tooth,
        stiffness_loss=loss.loss,
        stiffness_loss_low=loss.low,
        stiffness_loss_high=loss.high,
        false_alarm_probability=float(10.0**log10),
        evidence=tuple(evidence),
    )


def _judged(features: FeatureVector | None, stage: int, gear: str) -> KindJudgement | None:
    if features is None or not features.gears:
        return None
    return judge_kind(features, stage=stage, gear=gear)


def _energy(profiles: Sequence[ToothProfile], stage: int, gear: str) -> list[str]:
    return [
        f"its departure has {profile.ratio:.1f} times the energy of the median tooth there"
        for profile in profiles
        if (profile.stage, profile.gear) == (stage, gear)
    ]


def _size(machine: Machine, finding: ToothFinding, kind: str) -> list[str]:
    """Tell the size of the damage where the geometry of the gears is known."""
    from gearmon.diagnosis.kind_sizes import physical_size  # sound machines need no model of teeth

    match, loss = finding.best.match, finding.loss
    try:
        size = physical_size(machine, match.stage, match.gear, kind, loss.loss, loss.low, loss.high)
    except GearmonError:
        return []  # these teeth cannot be cut as the file says; the loss stands without it
    if size is None:
        return []
    bounds = [f"{v:.2g}" if v is not None else "?" for v in (size.low, size.high)]
    return [
        f"as a {size.quantity} that would be {size.size:.2g} {size.unit} "
        f"({bounds[0]} to {bounds[1]} {size.unit})"
    ]


def named_by_kind(flags: Iterable[Flag], features: FeatureVector | None) -> tuple[Flag, ...]:
    """Name changed levels after the kind of fault that they are most like.

    Parameters
    ----------
    flags : iterable of Flag
        Flags of changed levels.
    features : FeatureVector or None
        What the kind is judged by.

    Returns
    -------
    tuple of Flag
        The strongest flag of each gear or mesh renamed where one kind is clear; the others as they
        were.
    """
    found = list(flags)
    if features is None or not features.gears or not found:
        return tuple(found)
    judged = judge_kind(features)
    if judged.kind in (NONE, "tooth damage") or judged.probability < _NAMED:
        return tuple(found)
    first = next((i for i, flag in enumerate(found) if flag.stage == judged.stage), 0)
    told = (
        f"most like {judged.kind} ({judged.probability:.0%} by physical rules, not calibrated)",
        *judged.evidence,
    )
    found[first] = replace(
        found[first],
        kind=judged.kind,
        stage=judged.stage,
        gear=judged.gear,
        evidence=(*told, *found[first].evidence),
    )
    return tuple(found)


def foreign_flags(
    findings: Sequence[ForeignFinding], below: float, share: float
) -> tuple[Flag, ...]:
    """Flag lines that belong to no gear, and blame none.

    Parameters
    ----------
    findings : sequence of ForeignFinding
        What changed.
    below : float
        False-alarm probability below which to flag.
    share : float
        Share of the false alarms that these lines have.

    Returns
    -------
    tuple of Flag
    """
    limit = np.log10(below)
    return tuple(
        Flag(
            kind=finding.kind,
            stage=None,
            gear=None,
            tooth=None,
            stiffness_loss=None,
            stiffness_loss_low=None,
            stiffness_loss_high=None,
            false_alarm_probability=float(
                10.0 ** min(0.0, finding.log10_probability - float(np.log10(share)))
            ),
            evidence=(finding.name, *finding.evidence),
        )
        for finding in findings
        if finding.log10_probability - np.log10(share) < limit
    )


def response_warnings(finding: ToothFinding) -> tuple[str, ...]:
    """Name what the estimate of a loss takes for granted."""
    if finding.best.response.from_teeth_alone:
        return (
            "the machine file lacks gear data: the size of a loss rests on teeth of standard "
            "proportions",
        )
    return ()
