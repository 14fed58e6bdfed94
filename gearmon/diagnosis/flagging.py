"""Flags from what was found: of a tooth, of a kind, of lines of no gear."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from gearmon.diagnosis.fault_types.features import NONE, FeatureVector
from gearmon.diagnosis.kind_rules import KindJudgement, judge_kind
from gearmon.diagnosis.kind_runout import RunoutGrowth
from gearmon.diagnosis.kind_spread import DepartureSpread, departure_spread
from gearmon.diagnosis.nongear import NonGearFinding as ForeignFinding
from gearmon.diagnosis.results import Flag, ToothProfile
from gearmon.diagnosis.tooth_evidence import ToothFinding
from gearmon.diagnosis.tooth_search import SearchedGear
from gearmon.errors import GearmonError
from gearmon.machine import Machine

# A kind is named if the rules hold it this likely.
_NAMED = 0.5
# A departure is called one tooth's from this probability on; from the second where the sidebands
# once or twice a turn away grew by so much more [dB] than those four to six turns away, which one
# tooth hardly ever does.
_ONE_TOOTH, _ONE_TOOTH_AND_RUNOUT, _RUNOUT_DB = 0.5, 0.99, 12.0
# Where no kind is clear, a departure far from the mesh harmonics is called by its place.
_UNCLEAR = "changed residual"


def finding_flag(
    finding: ToothFinding,
    profiles: Sequence[ToothProfile],
    features: FeatureVector | None,
    machine: Machine,
    share: float,
) -> Flag:
    """Flag the departure that the matched search found: of one tooth, or of another kind.

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
        A tooth is blamed only where it explains the departure better than a change around the whole
        turn does, see `kind_spread`; else the kind is judged by rules and no loss is given.
    """
    probability = float(10.0 ** min(0.0, finding.log10_probability - float(np.log10(share))))
    spread = departure_spread(finding.best)
    if spread is not None and spread.one_tooth < _least_sure(finding, features):
        return _spread_flag(finding, spread, features, probability)
    match, loss = finding.best.match, finding.loss
    evidence = [
        f"the {match.gear} of stage {match.stage} departs from the healthy pattern as a loss of "
        f"{100 * loss.loss:.0f} % ({100 * loss.low:.0f} to {100 * loss.high:.0f} %) of the "
        f"stiffness of tooth {finding.tooth}'s pair would make it, {match.lines} lines looked at"
    ]
    evidence.append(
        "teeth are counted from the one that enters mesh at the tachometer pulse"
        if finding.counted_from == "tacho"
        else "teeth are counted from where the first healthy recording begins: the same number is "
        "the same tooth in every recording compared with this reference"
    )
    evidence += _energy(profiles, match.stage, match.gear)
    if spread is not None:
        evidence.append(_explained(spread))
    evidence += [
        f"the {gear} of stage {stage} shows it too"
        + (" and may be the cause as well" if lead < np.log(10.0) else "")
        for gear, stage, lead in finding.rivals
    ]
    evidence += _size(machine, finding)
    return Flag(
        kind="tooth damage",
        stage=match.stage,
        gear=match.gear,
        tooth=finding.tooth,
        stiffness_loss=loss.loss,
        stiffness_loss_low=loss.low,
        stiffness_loss_high=loss.high,
        false_alarm_probability=probability,
        evidence=tuple(evidence),
    )


def _least_sure(finding: ToothFinding, features: FeatureVector | None) -> float:
    """Probability from which a departure is called that of one tooth."""
    gear = finding.best.match.stage, finding.best.match.gear
    if features is None or gear not in features.gears:
        return _ONE_TOOTH
    row = features.named(features.gears.index(gear))
    first, others = max(row["once_db"], row["twice_db"]), max(row["several_db"], 0.0)
    return _ONE_TOOTH_AND_RUNOUT if first - others > _RUNOUT_DB else _ONE_TOOTH


def _explained(spread: DepartureSpread) -> str:
    return (
        f"one tooth explains {100 * spread.explained:.0f} % of the departure; that it is of one "
        f"tooth, not of many, is {100 * spread.one_tooth:.3g} % probable"
    )


def _second_told(spread: DepartureSpread) -> list[str]:
    """Tell of a second damaged tooth, where one is likely."""
    second = spread.second
    if second is None or spread.several_teeth <= _NAMED:
        return []
    count, way = abs(second.distance), "after" if second.distance > 0 else "before"
    return [
        f"a second tooth, {count} {'tooth' if count == 1 else 'teeth'} {way} the one that departs "
        f"most, is heard at about {second.size:.1f} of it"
    ]


def _spread_flag(
    finding: ToothFinding,
    spread: DepartureSpread,
    features: FeatureVector | None,
    probability: float,
) -> Flag:
    """Flag a departure that one tooth does not explain, by its kind where one is clear."""
    match = finding.best.match
    stage, gear, kind = match.stage, match.gear, _UNCLEAR
    evidence = [
        f"the {gear} of stage {stage} departs from the healthy pattern around its turn, "
        f"{match.lines} lines looked at",
        _explained(spread),
        *_second_told(spread),
    ]
    judged = _judged(features, finding)
    if judged is not None:
        kind, stage = judged.kind, judged.stage or stage
        evidence += _told(judged)
        gear = judged.gear or ""
    return Flag(
        kind=kind,
        stage=stage,
        gear=gear or None,
        tooth=None,
        stiffness_loss=None,
        stiffness_loss_low=None,
        stiffness_loss_high=None,
        false_alarm_probability=probability,
        evidence=tuple(evidence),
    )


def _judged(features: FeatureVector | None, finding: ToothFinding) -> KindJudgement | None:
    """Judge the kind of a departure that one tooth does not explain; None where none is clear.

    Gears on one shaft show the same departure: of these the one is judged that changed most.
    """
    if features is None or not features.gears:
        return None
    best = finding.best.match
    gear = features.gears[features.focus]
    focused = _searched(finding, gear)
    if focused is None or abs(focused.match.order - best.order) > 1e-9 * best.order:
        gear = best.stage, best.gear
    return _clear(features, gear, finding) if gear in features.gears else None


def _judged_levels(
    features: FeatureVector | None, finding: ToothFinding | None
) -> KindJudgement | None:
    if features is None or not features.gears:
        return None
    return _clear(features, features.gears[features.focus], finding)


def _clear(
    features: FeatureVector, gear: tuple[int, str], finding: ToothFinding | None
) -> KindJudgement | None:
    """Judge the kind of a fault of one gear; None where no kind but one tooth is clear."""
    own = _searched(finding, gear) if finding is not None else None
    spread = departure_spread(own) if own is not None else None
    judged = judge_kind(features, stage=gear[0], gear=gear[1], spread=spread)
    clear = judged.kind not in (NONE, "tooth damage") and judged.probability >= _NAMED
    return judged if clear else None


def _searched(finding: ToothFinding, gear: tuple[int, str]) -> SearchedGear | None:
    return next((g for g in finding.searched if (g.match.stage, g.match.gear) == gear), None)


def _told(judged: KindJudgement) -> tuple[str, ...]:
    return (
        f"most like {judged.kind} ({judged.probability:.0%} by physical rules, not calibrated)",
        *judged.evidence,
    )


def _energy(profiles: Sequence[ToothProfile], stage: int, gear: str) -> list[str]:
    return [
        f"its departure has {profile.ratio:.1f} times the energy of the median tooth there"
        for profile in profiles
        if (profile.stage, profile.gear) == (stage, gear)
    ]


def _size(machine: Machine, finding: ToothFinding) -> list[str]:
    """Tell the size of the damage where the geometry of the gears is known."""
    from gearmon.diagnosis.kind_sizes import physical_size  # sound machines need no model of teeth

    match, loss = finding.best.match, finding.loss
    try:
        size = physical_size(
            machine, match.stage, match.gear, "tooth damage", loss.loss, loss.low, loss.high
        )
    except GearmonError:
        return []  # these teeth cannot be cut as the file says; the loss stands without it
    if size is None:
        return []
    bounds = [f"{v:.2g}" if v is not None else "?" for v in (size.low, size.high)]
    return [
        f"as a {size.quantity} that would be {size.size:.2g} {size.unit} "
        f"({bounds[0]} to {bounds[1]} {size.unit})"
    ]


def runout_flags(
    growths: Sequence[RunoutGrowth],
    below: float,
    share: float,
    flags: Sequence[Flag],
    features: FeatureVector | None,
    finding: ToothFinding | None = None,
) -> tuple[Flag, ...]:
    """Flag gears whose first or second sidebands have grown beyond the farther ones.

    Parameters
    ----------
    growths : sequence of RunoutGrowth
        Of all gears.
    below : float
        False-alarm probability below which to flag.
    share : float
        Share of the false alarms that this test has.
    flags : sequence of Flag
        What has been found already: a gear is flagged but once.
    features : FeatureVector or None
        What the kind is judged by: many damaged teeth may move these sidebands as well.
    finding : ToothFinding or None
        What the matched search looked at.

    Returns
    -------
    tuple of Flag
    """
    flagged = {(flag.stage, flag.gear) for flag in flags}
    found = []
    for growth in growths:
        log10 = min(0.0, growth.log10_probability - float(np.log10(share)))
        gear = growth.stage, growth.gear
        if log10 >= np.log10(below) or gear in flagged:
            continue
        judged = None
        if features is not None and gear in features.gears:
            judged = _clear(features, gear, finding)
        found.append(
            Flag(
                kind=growth.kind if judged is None else judged.kind,
                stage=growth.stage,
                gear=growth.gear,
                tooth=None,
                stiffness_loss=None,
                stiffness_loss_low=None,
                stiffness_loss_high=None,
                false_alarm_probability=float(10.0**log10),
                evidence=(*growth.evidence, *(_told(judged) if judged is not None else ())),
            )
        )
    return tuple(found)


def named_by_kind(
    flags: Iterable[Flag], features: FeatureVector | None, finding: ToothFinding | None = None
) -> tuple[Flag, ...]:
    """Name changed levels after the kind of fault that they are most like.

    Parameters
    ----------
    flags : iterable of Flag
        Flags of changed levels.
    features : FeatureVector or None
        What the kind is judged by.
    finding : ToothFinding, optional
        What the matched search looked at: it tells how far a departure is one tooth's.

    Returns
    -------
    tuple of Flag
        The strongest flag of the gear or stage that changed most renamed, if its kind is clear; the
        others as they were. All as they were if something has been named already.
    """
    found = list(flags)
    if not found or not all(flag.kind.startswith("changed") for flag in found):
        return tuple(found)
    judged = _judged_levels(features, finding)
    if judged is None:
        return tuple(found)
    first = _best_place(found, judged)
    if first is None:
        return tuple(found)
    found[first] = replace(
        found[first],
        kind=judged.kind,
        stage=judged.stage,
        gear=judged.gear,
        evidence=(*_told(judged), *found[first].evidence),
    )
    return tuple(found)


def _best_place(flags: Sequence[Flag], judged: KindJudgement) -> int | None:
    """Return which flag is of the gear that was judged, or else of its stage."""
    own = [i for i, flag in enumerate(flags) if flag.stage == judged.stage]
    same = [i for i in own if flags[i].gear == judged.gear]
    return next(iter(same + own), None)


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
