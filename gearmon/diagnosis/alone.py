"""What can be said of a recording that nothing is compared with: no reference, or no mesh.

Without a healthy reference every tooth is held against the others of its gear
(`hypotheses.turns`). Where no mesh stands out nothing is known of any gear; beside a reference that
shows one this is a change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gearmon.diagnosis.evidence import LIMITS, Evidence, broadband_strength, comparable, score_of
from gearmon.diagnosis.hypotheses.turns import locate
from gearmon.diagnosis.results import Analysis, Flag, ToothProfile
from gearmon.diagnosis.verdict import fault_sentence, most_striking, not_found
from gearmon.errors import GearmonError
from gearmon.machine import Machine
from gearmon.signatures.expected.baseline import expected_signature
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.reference import Profile
from gearmon.signatures.signature import Signature

_WHY = "There is no healthy reference"
# False-alarm probability below which one tooth is called damaged. Seen on simulated sound
# machines: 1 of 52.
_BELOW = 0.01
# Drop of the broadband level [dB] from which a recording without a mesh is one of a machine that
# stands still, or of a dead sensor: a hundredth of the power.
_SILENT_DB = -20.0
# The same of one that a broken tooth drowns: another gain alone would not hide the mesh. Of 66
# recordings of six lumped machines in which a tooth has lost 95 to 100 %, 15 are louder by more in
# all bands alike and show no mesh.
_LOUD_DB = 20.0


def judged_alone(
    signature: MeasuredSignature, machine: Machine, why: str = _WHY, healthy: Sequence[Profile] = ()
) -> Analysis:
    """Judge a recording by itself: every tooth against the others of its gear.

    Parameters
    ----------
    signature : MeasuredSignature
        Of the recording.
    machine : Machine
        Its machine.
    why : str
        Why there is no reference.
    healthy : sequence of Profile
        Recordings that tell how far teeth of the sound machine depart from their gears, though
        nothing else is compared with them.
    """
    profiles = own_teeth(Profile.of(signature), healthy)
    log10 = min((p.log10_probability for p in profiles), default=0.0)
    log10 = min(0.0, log10 + float(np.log10(max(1, len(profiles)))))
    flags, notes = own_teeth_flags(profiles), list(signature.notes)
    expected: Signature | None = None
    try:
        expected = expected_signature(machine, max_hz=0.5 * signature.sampling_rate_hz)
    except GearmonError as error:
        notes.append(f"no expected signature: {error}")
    return replace(
        no_mesh(signature, machine),
        verdict="fault" if flags else "cannot tell",
        reason=own_teeth_reason(profiles, why, healthy),
        score=-log10,
        false_alarm_probability=float(10.0**log10),
        compared_with="expected signature" if expected else "nothing",
        profiles=profiles,
        flags=flags,
        expected=expected,
        warnings=(*notes, *not_found(signature)),
    )


def own_teeth(own: Profile, healthy: Sequence[Profile] = ()) -> tuple[ToothProfile, ...]:
    """Hold every tooth against the others of its gear, of which healthy ones may depart as well."""
    others, found = [one for known in healthy for one in own_teeth(known)], []
    for wheel in own.wheels:
        # the tachometer's zero is that of shaft 1: other shafts stand anywhere when it comes
        one = locate(wheel, numbered=own.tacho and abs(wheel.order - 1.0) < 1e-12)
        if one is None:
            continue
        same = [o.log10_probability for o in others if (o.stage, o.gear) == (one.stage, one.gear)]
        excess = min(0.0, one.log10_probability - min(same, default=0.0))
        found.append(replace(one, log10_probability=excess))
    return tuple(found)


def own_teeth_flags(profiles: Sequence[ToothProfile]) -> tuple[Flag, ...]:
    """Flag the gear with one departing tooth where there is no reference.

    Parameters
    ----------
    profiles : sequence of ToothProfile
        Gears that were looked at, each against its own other teeth.
    """
    # any gear may be called damaged by chance
    looked_at = float(np.log10(max(1, len(profiles))))
    rare = [p for p in profiles if p.log10_probability + looked_at < np.log10(_BELOW)]
    striking = sorted(rare, key=lambda profile: profile.log10_probability)
    if not striking:
        return ()
    first, *others = striking
    where = f"one place, {first.position:.2f} of a turn after the recording's zero"
    where = where if first.tooth is None else f"tooth {first.tooth}"
    evidence = [
        f"the {first.gear} of stage {first.stage} departs from its other teeth at {where}: "
        f"{first.ratio:.1f} times the energy of its median tooth",
        "one tooth of a sound gear may be cut as differently: without a healthy recording it "
        "cannot be known whether it was always so, nor how much stiffness is lost",
    ]
    if first.tooth is not None:
        evidence.append("teeth are counted from the one that enters mesh at the tachometer pulse")
    evidence += [
        f"the {other.gear} of stage {other.stage} shows it too ({other.ratio:.1f} times)"
        for other in others
    ]
    place: dict[str, Any] = {"stage": first.stage, "gear": first.gear, "tooth": first.tooth}
    if any(abs(other.order - first.order) < 1e-9 * first.order for other in others):
        evidence.append("gears on one shaft turn together: it may be either of them")
        place = {}
    chance = float(10.0 ** min(0.0, first.log10_probability + looked_at))
    told = tuple(evidence)
    return (Flag(kind="tooth damage", false_alarm_probability=chance, evidence=told, **place),)


def own_teeth_reason(
    profiles: Sequence[ToothProfile], why: str, healthy: Sequence[Profile] = ()
) -> str:
    """Give the reason of a verdict without a reference, which begins with why there is none."""
    known, always = "", "whether the gear was always so, "
    if healthy:
        known, always = ", less what healthy recordings show of them at another speed", ""
    return (
        f"{why}. Teeth were compared with the others of their gear{known}. "
        "Pitch errors and eccentricity of a sound gear look like weak damage, so only gross "
        "damage of one tooth can be found: on simulated machines two of three losses of 40 % "
        f"of a pair's stiffness, one of four of 20 %. {most_striking(profiles)} Without a healthy "
        f"recording at this speed it cannot be known {always}how much stiffness is lost, nor of "
        "wear, pitting, misalignment or eccentricity, which change all teeth."
    )


def no_mesh(signature: MeasuredSignature, machine: Machine) -> Analysis:
    """Say that no mesh of the machine stands out of a recording."""
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
        warnings=signature.notes,
    )


def mesh_lost(found: Analysis, evidence: Evidence) -> Analysis:
    """Judge a recording that lacks the mesh which its reference has: that is a change too.

    Parameters
    ----------
    found : Analysis
        As of `no_mesh`.
    evidence : Evidence
        The deviation from the healthy machine.
    """
    broadband = evidence.deviation.broadband
    gain = 0.0 if broadband is None else float(np.median(broadband.gain_db))
    strength = broadband_strength(broadband)
    if gain > _LOUD_DB:
        strength = max(strength, LIMITS.fault)
    probability = evidence.chance(comparable(strength))
    flags: tuple[Flag, ...] = ()
    if gain < _SILENT_DB:
        told = (
            f"The recording is {-gain:.0f} dB quieter than the healthy ones and shows no gear "
            "mesh: the machine stood still, or the sensor is dead or disconnected."
        )
    elif strength >= LIMITS.noise_strength:
        why = (
            f"the spectrum between the lines changed too ({gain:+.1f} dB in the median): gross "
            "damage, or a machine that runs at another speed than its file says",
            found.reason,
        )
        flags = (Flag(kind="mesh lost", false_alarm_probability=probability, evidence=why),)
        told = fault_sentence(flags)
    else:
        told = (
            "The healthy recordings show a gear mesh that this one does not: gross damage, or a "
            "machine that runs at another speed than its file says. Record again."
        )
        return replace(found, reason=f"{told} {found.reason}")
    return replace(
        found,
        verdict="fault" if flags else "cannot tell",
        reason=f"{told} {found.reason}",
        flags=flags,
        score=score_of(strength),
        false_alarm_probability=probability,
        compared_with="reference",
    )
