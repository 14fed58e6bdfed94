"""Evidence in words: sentences that can be checked on the pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearmon.diagnosis.comparison import GroupTest, LevelTest
from gearmon.diagnosis.results import Change, Flag, ToothProfile

_SENTENCES = 4
# Loss of a pair's stiffness that is gross damage of a tooth.
_GROSS = 0.5
#: What no recording tells by itself.
UNKNOWABLE = (
    "Without a healthy recording it cannot be known whether the gear was always so, how much "
    "stiffness is lost, nor of wear, pitting, misalignment or eccentricity, which change all teeth."
)


def tooth_flags(
    profiles: Sequence[ToothProfile],
    below: float,
    looked_at: int,
    groups: Sequence[GroupTest] = (),
) -> tuple[Flag, ...]:
    """Flag gears with one departing tooth.

    Gears of one train whose tooth counts have common factors repeat one another's events; of those
    that stand out the clearest is flagged and the others are named in its evidence. Gears on one
    shaft show the same event; of those the one is blamed whose own sidebands changed more clearly,
    by a factor of ten in probability, else none.

    Parameters
    ----------
    profiles : sequence of ToothProfile
        All gears looked at.
    below : float
        False-alarm probability, corrected for the gears looked at, below which to flag.
    looked_at : int
        Gears looked at.
    groups : sequence of GroupTest
        Level tests of the groups of families, which tell gears on one shaft apart.

    Returns
    -------
    tuple of Flag
        None or one.
    """
    striking = sorted(
        (p for p in profiles if p.log10_probability + np.log10(looked_at) < np.log10(below)),
        key=lambda profile: profile.log10_probability,
    )
    if not striking:
        return ()
    first, alone = _blamed(striking, groups)
    against = "the healthy pattern" if first.against == "reference" else "its other teeth"
    where = (
        f"tooth {first.tooth}"
        if first.tooth is not None
        else (f"one place, {first.position:.2f} of a turn after the recording's zero")
    )
    evidence = [
        f"the {first.gear} of stage {first.stage} departs from {against} at {where}: "
        f"{first.ratio:.1f} times the energy of its median tooth"
    ]
    if first.tooth is not None:
        evidence.append("teeth are counted from the one that enters mesh at the tachometer pulse")
    if first.against != "reference":
        evidence.append(
            "one tooth of a sound gear may be cut as differently: without a healthy recording it "
            "cannot be known whether it was always so, nor how much stiffness is lost"
        )
    evidence += [
        f"the {other.gear} of stage {other.stage} shows it too ({other.ratio:.1f} times)"
        + (", on the same shaft" if _on_one_shaft(first, other) else "")
        for other in striking
        if other is not first
    ]
    if not alone:
        evidence.append("gears on one shaft turn together: it may be either of them")
    probability = float(10.0 ** min(0.0, first.log10_probability + float(np.log10(looked_at))))
    return (
        Flag(
            kind="tooth damage",
            stage=first.stage if alone else None,
            gear=first.gear if alone else None,
            tooth=first.tooth if alone else None,
            stiffness_loss=None,
            stiffness_loss_low=None,
            stiffness_loss_high=None,
            false_alarm_probability=probability,
            evidence=tuple(evidence),
        ),
    )


def _on_one_shaft(one: ToothProfile, other: ToothProfile) -> bool:
    return abs(one.order - other.order) < 1e-9 * one.order


def _blamed(
    striking: Sequence[ToothProfile], groups: Sequence[GroupTest]
) -> tuple[ToothProfile, bool]:
    """Choose the gear to blame, and tell whether it can be told from its neighbours on the shaft.

    An event once a turn of a shaft is as clear in the pattern of each of its gears, and clearer the
    more teeth one has. The sidebands about a gear's own mesh tell more.
    """
    first = striking[0]
    together = [profile for profile in striking if _on_one_shaft(first, profile)]
    if len(together) == 1:
        return first, True

    def level(profile: ToothProfile) -> float:
        own = [
            group.log10_probability
            for group in groups
            if (group.stage, group.gear) == (profile.stage, profile.gear)
        ]
        return min(own, default=0.0)

    ranked = sorted(together, key=level)
    return ranked[0], level(ranked[0]) < level(ranked[1]) - 1.0


def level_flags(
    changes: Sequence[Change], groups: Sequence[GroupTest], overall: LevelTest, below: float
) -> tuple[Flag, ...]:
    """Flag the groups of families whose levels changed, by kind, stage and gear.

    Parameters
    ----------
    changes : sequence of Change
        All changes.
    groups : sequence of GroupTest
        Tests of the groups, strongest first.
    overall : LevelTest
        Test over all families.
    below : float
        False-alarm probability below which to flag.

    Returns
    -------
    tuple of Flag
        The groups that stand out by themselves; if none does but all together do, the strongest.
    """
    limit = float(np.log10(below))
    chosen = [(group, group.log10_probability) for group in groups]
    chosen = [item for item in chosen if item[1] < limit]
    if not chosen and overall.log10_probability < limit:
        chosen = [(groups[0], overall.log10_probability)]
    return tuple(
        Flag(
            kind=f"changed {group.kind}",
            stage=group.stage,
            gear=group.gear or None,
            tooth=None,
            stiffness_loss=None,
            stiffness_loss_low=None,
            stiffness_loss_high=None,
            false_alarm_probability=float(10.0**probability),
            evidence=sentences(
                [
                    change
                    for change in changes
                    if (change.kind, change.stage, change.gear)
                    == (group.kind, group.stage, group.gear)
                ]
            ),
        )
        for group, probability in chosen
    )


def sentences(changes: Sequence[Change]) -> tuple[str, ...]:
    """Describe the strongest changes, one sentence each.

    Parameters
    ----------
    changes : sequence of Change
        Changes of one group.

    Returns
    -------
    tuple of str
        As "a1: sidebands of shaft 1 around mesh 2 harmonic 1 rose 6.8 dB; learned scatter 0.7 dB".
    """
    strongest = sorted(changes, key=lambda change: -abs(change.standardised))[:_SENTENCES]
    return tuple(
        f"{change.channel}: {change.family} {'rose' if change.change_db > 0 else 'fell'} "
        f"{abs(change.change_db):.1f} dB; learned scatter {change.scatter_db:.1f} dB"
        for change in strongest
    )


def summary(
    verdict: str,
    changes: Sequence[Change],
    profiles: Sequence[ToothProfile],
    test: LevelTest | None,
) -> str:
    """Give the reason of a verdict in one or two sentences.

    Parameters
    ----------
    verdict : str
        The verdict.
    changes : sequence of Change
        Changes against the reference.
    profiles : sequence of ToothProfile
        Gears searched for a departing tooth.
    test : LevelTest or None
        Test over all families, if there was a reference.

    Returns
    -------
    str
    """
    best = min(profiles, key=lambda p: p.log10_probability, default=None)
    tooth = (
        f"The most striking place of a gear (the {best.gear} of stage {best.stage}) has "
        f"{best.ratio:.1f} times its median energy."
        if best is not None
        else "No gear's turn could be resolved."
    )
    if test is None:
        return (
            "There is no healthy reference: teeth were compared with the others of their gear. "
            "Pitch errors and eccentricity of a sound gear look like weak damage, so only gross "
            "damage of one tooth can be found: on simulated machines two of three losses of 40 % "
            f"of a pair's stiffness, one of four of 20 %. {tooth} {UNKNOWABLE}"
        )
    moved = (
        f"Line levels differ from the reference by {test.rms:.1f} times their learned scatter "
        f"(root mean square of {len(changes)})."
    )
    strongest = sentences(changes)[:1]
    if verdict == "healthy":
        return f"{moved} {tooth}{_noticed(profiles)}"
    detail = f" Most of all, {strongest[0]}." if strongest else ""
    return f"{moved}{detail} {tooth}"


def _noticed(profiles: Sequence[ToothProfile]) -> str:
    """Say how much damage of one tooth a healthy verdict excludes; changed levels tell of more."""
    searched = [p for p in profiles if p.loss_by_tooth is not None]
    from_loss = [p.noticed_from or 1.0 for p in searched]
    seen = [loss for loss in from_loss if loss <= _GROSS]
    blind = [
        f"the {p.gear} of stage {p.stage}"
        for p, loss in zip(searched, from_loss, strict=True)
        if loss > _GROSS
    ]
    if not searched:
        return ""
    if not seen:
        return " Damage of one tooth alone might not be noticed, not even a gross one."
    but = f", but hardly on {', '.join(blind)}" if blind else ""
    return (
        f" Damage of one tooth would mostly be noticed from a loss of {100 * max(seen):.2g} % of "
        f"its pair's stiffness{but}."
    )
