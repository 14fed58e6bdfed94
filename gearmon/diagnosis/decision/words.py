"""The verdict in words: first what a plant manager needs, then what it rests on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gearmon.diagnosis.decision.evidence import Decision, Evidence
from gearmon.diagnosis.decision.flags import sentences
from gearmon.diagnosis.decision.thresholds import LIMITS
from gearmon.diagnosis.law.state import SPEED_UNIT
from gearmon.diagnosis.results import Change, Flag, ToothProfile
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.reference import Reference

_PLAIN = {
    "several teeth": "Several teeth of {gear} are likely damaged.",
    "distributed pitting": "Many teeth of {gear} are likely pitted.",
    "wear": "The teeth of {gear} are likely worn.",
    "eccentricity": "{Gear} runs out, or more than it did.",
    "misalignment": "{Gear} wobbles, or more than it did: it may stand askew.",
    "looseness": "Something about {gear} is likely loose.",
    "path changed": "Everything sounds different, as if the sensor had been moved or the gearbox "
    "opened: no single gear is to blame.",
    "broadband rise": "The noise between the gears' lines rose: look at bearings and mounts first.",
    "broadband change": "The noise between the gears' lines changed; no gear is to blame.",
    "bearing": "A bearing has likely been damaged.",
    "electrical": "Lines of the electrical supply rose.",
    "unknown lines": "New lines appeared that belong to no gear of this machine.",
    "mesh lost": "The gear mesh that the healthy recordings show is gone.",
}


def fault_sentence(flags: Sequence[Flag]) -> str:
    """Say what is wrong in one sentence.

    Parameters
    ----------
    flags : sequence of Flag
        Strongest first.
    """
    if not flags:
        return "The machine no longer sounds as it did when it was healthy."
    first = flags[0]
    gear = _gear(first.stage, first.gear)
    if first.kind == "tooth damage":
        tooth = f"tooth {first.tooth} of {gear}" if first.tooth else f"one tooth of {gear}"
        loss = ""
        if first.stiffness_loss is not None:
            loss = f", which has lost about {100 * first.stiffness_loss:.0f} % of its stiffness"
        return f"Damage of {tooth}{loss}."
    plain = _PLAIN.get(
        first.kind, "The vibration of {gear} changed; what kind of fault is unclear."
    )
    return plain.format(gear=gear, Gear=gear[:1].upper() + gear[1:])


def _gear(stage: int | None, gear: str | None) -> str:
    if stage is None:
        return "the machine"
    return f"the {gear} of stage {stage}" if gear else f"the gears of stage {stage}"


def reason(
    decision: Decision,
    evidence: Evidence,
    flags: Sequence[Flag],
    changes: Sequence[Change],
    profiles: Sequence[ToothProfile],
    must_notice: float,
) -> str:
    """Give the reason of a verdict on a recording that was compared with a reference.

    Parameters
    ----------
    decision : Decision
        The verdict.
    evidence : Evidence
        What was compared.
    flags, changes, profiles
        Of the analysis.
    must_notice : float
        Loss of one tooth's pair that a healthy verdict has to exclude.
    """
    rested = f"{_levels(evidence)} {most_striking(profiles)}"
    if decision.verdict == "fault":
        strongest = sentences(changes)[:1]
        most = f" Most of all, {strongest[0]}." if strongest else ""
        return f"{fault_sentence(flags)} {rested}{most}"
    if decision.verdict == "healthy":
        noticed = f"{_noticed(profiles)} {_wear(evidence)}"
        return f"The machine sounds as it did when it was healthy.{noticed} {rested}"
    if evidence.knocked:
        told = (
            "Knocks drown the gears: what stands out came in single turns, not in each. Record "
            "again where the machine runs more quietly, or longer."
        )
    elif evidence.strength >= LIMITS.open or evidence.probability < LIMITS.rare:
        told = "More changed than is usual, but not enough to call it a fault: record again."
    elif evidence.heavier_db:
        told = (
            f"The gear mesh is {evidence.heavier_db:.0f} dB louder than any healthy recording had "
            "it: the load is far heavier than those learned, or all teeth are worn."
        )
    elif evidence.angle_lost:
        told = (
            "Nothing speaks against the machine, but its angle was lost on the way: record again "
            "at a steadier speed, or with a tachometer."
        )
    else:
        told = "Nothing speaks against the machine, but not all of it was heard."
    if decision.unheard:
        told += (
            f" Even a loss of {100 * must_notice:.0f} % of a tooth's stiffness might have gone "
            f"unnoticed on {', '.join(decision.unheard)}: record longer, under load, or nearer to "
            "it."
        )
    return f"{told} {rested}"


def _wear(evidence: Evidence) -> str:
    """Say how much wear of all teeth would not pass for a heavier load."""
    loss = 1.0 - np.exp(evidence.deviation.heavy - LIMITS.heaviest)
    return (
        "Wear of all teeth alike sounds like a heavier load: it would not have been noticed below "
        f"a loss of about {100 * loss:.0f} %."
    )


def _levels(evidence: Evidence) -> str:
    levels = evidence.deviation.levels
    told = (
        f"Levels of lines differ from the expected by {levels.mean_square() ** 0.5:.1f} times "
        f"their healthy scatter (root mean square of {levels.rest_db.size})"
    )
    broadband = evidence.deviation.broadband
    if broadband is None:
        return f"{told}."
    return f"{told}, the spectrum between them by {broadband.mean_square() ** 0.5:.1f} times."


def most_striking(profiles: Sequence[ToothProfile]) -> str:
    """Name the most striking place of any gear."""
    best = min(profiles, key=lambda p: p.log10_probability, default=None)
    if best is None:
        return "No gear's turn could be resolved."
    return (
        f"The most striking place of a gear (the {best.gear} of stage {best.stage}) has "
        f"{best.ratio:.1f} times the energy elsewhere in its turn."
    )


def _noticed(profiles: Sequence[ToothProfile]) -> str:
    """Say how much damage of one tooth would have been called a fault."""
    from_loss = [p.noticed_from for p in profiles if p.noticed_from is not None]
    blind = [f"the {p.gear} of stage {p.stage}" for p in profiles if p.noticed_from is None]
    told = ""
    if from_loss:
        told = (
            f" Damage of one tooth would mostly have been noticed from a loss of "
            f"{100 * max(from_loss):.2g} % of its pair's stiffness."
        )
    if blind:
        told += (
            f" On {', '.join(blind)} this machine departs too much from one healthy recording to "
            "the next to name one tooth."
        )
    return told


def limits(signature: MeasuredSignature, reference: Reference) -> Iterator[str]:
    """Name what limits a comparison with a reference.

    Parameters
    ----------
    signature : MeasuredSignature
        Of the new recording.
    reference : Reference
        Healthy recordings.
    """
    yield from (f"reference: {note}" for note in reference.notes)
    if len(reference.profiles) == 1:
        yield (
            "the reference is one recording: how this machine differs from one healthy "
            "recording to the next is assumed, not learned"
        )
    own, theirs = signature.channel_names, reference.channel_names
    if left_out := [name for name in own if name not in theirs]:
        yield f"channels not in the reference were left out: {', '.join(left_out)}"
    if missing := [name for name in theirs if name not in own]:
        yield (
            f"channels of the reference not looked at: {', '.join(missing)}; a fault may show "
            "in those alone: check their sensors, cables and names, and record again"
        )
    speeds = [profile.speed_hz for profile in reference.profiles]
    speed = signature.speed.estimated_hz
    if min(abs(speed / known - 1) for known in speeds) > SPEED_UNIT:
        yield (
            f"speed {speed:.2f} Hz is more than {100 * SPEED_UNIT:g} % off that of every "
            f"healthy recording ({min(speeds):.2f} to {max(speeds):.2f} Hz): resonances may "
            "change levels, so that levels alone call no fault"
        )


def not_found(signature: MeasuredSignature) -> Iterator[str]:
    """Name the meshes that do not stand out."""
    for mesh in signature.meshes:
        if not mesh.found:
            yield f"mesh of stage {mesh.stage} not found: {mesh.reason}"


def size_note(evidence: Evidence) -> Iterator[str]:
    """Name what the estimate of a loss takes for granted."""
    finding = evidence.finding
    search = finding.best.search if finding is not None else None
    if search is not None and search.response.from_teeth_alone:
        yield (
            "the machine file lacks gear data: the size of a loss rests on teeth of standard "
            "proportions"
        )
