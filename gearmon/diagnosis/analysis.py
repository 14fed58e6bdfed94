"""From recording to verdict: the one place that strings the analysis together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.diagnosis.decision.evidence import (
    Evidence,
    broadband_strength,
    decide,
    heard_from,
    noticed_from,
    tooth_strength,
)
from gearmon.diagnosis.decision.flags import Flagging, own_teeth_flags
from gearmon.diagnosis.decision.thresholds import LIMITS, false_alarm_probability
from gearmon.diagnosis.decision.words import fault_sentence, own_teeth_reason, reason
from gearmon.diagnosis.fault_types.features import kind_features
from gearmon.diagnosis.hypotheses.changed_path import path_change
from gearmon.diagnosis.hypotheses.own_teeth import locate
from gearmon.diagnosis.hypotheses.runout import (
    TurnChange,
    healthy_turns,
    runout_growth,
    turn_changes,
)
from gearmon.diagnosis.hypotheses.tooth_damage import (
    GearEvidence,
    ToothFinding,
    find_tooth,
    place,
    told_losses,
)
from gearmon.diagnosis.law import HealthyMachine, MachineDeviation
from gearmon.diagnosis.law.state import SPEED_UNIT
from gearmon.diagnosis.nongear import disturbed, nongear_findings
from gearmon.diagnosis.results import Analysis, Change, Flag, ToothProfile
from gearmon.errors import GearmonError, check_range
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.signals.bad_samples import inspected, sound_part
from gearmon.signals.recording import Recording, RecordingLike, read_recording, read_recordings
from gearmon.signatures.measured.indicators import gear_indicators, waveform_indicators
from gearmon.signatures.measured.line_plan import Family
from gearmon.signatures.measured.measurement import (
    MeasuredSignature,
    measure_signature,
)
from gearmon.signatures.measured.reference import (
    Profile,
    Reference,
    is_reference,
    machine_notes,
    make_reference,
    other_speed,
    read_reference,
    recording_notes,
)
from gearmon.signatures.signature import Signature

# Without a reference: false-alarm probability below which one tooth is called damaged. Seen on
# simulated sound machines: 1 of 52.
_OWN_TEETH_BELOW = 0.01
# Drop of the broadband level [dB] from which a recording without a mesh is one of a machine that
# stands still, or of a dead sensor: a hundredth of the power.
_SILENT_DB = -20.0


def learn(
    recordings: RecordingLike | Sequence[RecordingLike],
    machine: MachineLike,
    *,
    sampling_rate_hz: float | None = None,
    unit: str | None = None,
) -> Reference:
    """Build a healthy reference from recordings.

    Parameters
    ----------
    recordings : list of str, Path, array, DataFrame or Recording, or one of them
        Healthy recordings of the same channels, at one or several loads.
    machine : Machine, path or dict
        The machine.
    sampling_rate_hz, unit
        Of an array, or where the recording does not state them: as of `gearmon.read_recording`.

    Returns
    -------
    Reference

    Raises
    ------
    GearmonError
        If a recording cannot be used.

    Examples
    --------
    >>> gearmon.learn([half, full], machine).origins
    ('simulated 1', 'simulated 2')
    """
    machine = load_machine(machine)
    known: dict[str, Any] = {"sampling_rate_hz": sampling_rate_hz, "unit": unit}
    healthy = read_recordings(recordings, sensors=machine.sensors, **known)
    return learned([measure_signature(r, machine) for r in healthy], machine)


def learned(signatures: Sequence[MeasuredSignature], machine: Machine) -> Reference:
    """Build a healthy reference from what was measured, with notes on what is doubtful.

    Parameters
    ----------
    signatures : sequence of MeasuredSignature
        Of healthy recordings.
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
    reference = make_reference(signatures, machine)
    return replace(reference, notes=tuple(_doubts(signatures, machine)))


def _doubts(signatures: Sequence[MeasuredSignature], machine: Machine) -> Iterator[str]:
    """Name recordings that do not look like those of a sound machine."""
    for number, own in enumerate(signatures):
        if own_teeth_flags(_own_teeth(Profile.of(own)), _OWN_TEETH_BELOW):
            yield f"{own.origin}: one tooth stands out of its gear already; is the machine sound?"
        others = [*signatures[:number], *signatures[number + 1 :]]
        # of two that differ nobody knows which is the odd one
        if len(others) < 2:
            continue
        strength = evidence_against(own, machine, make_reference(others, machine)).strength
        if strength >= LIMITS.fault:
            yield (
                f"{own.origin}: departs from the other recordings as a fault would (strength "
                f"{strength:.1f}); was the machine sound, and everything as in the others?"
            )


def analyse(
    recording: RecordingLike,
    machine: MachineLike,
    reference: Reference | RecordingLike | Sequence[RecordingLike] | None = None,
    *,
    sampling_rate_hz: float | None = None,
    unit: str | None = None,
    must_notice: float = LIMITS.must_notice,
) -> Analysis:
    """Say whether a machine is healthy, and why.

    Parameters
    ----------
    recording : str, Path, array, DataFrame or Recording
        The new recording.
    machine : Machine, path or dict
        Its machine.
    reference : Reference, or what `learn` takes or `write_reference` wrote, optional
        Healthy recordings to compare with. Without them the gear's own teeth and the expected
        signature have to do, which rarely allows more than "cannot tell".
    sampling_rate_hz, unit
        Of an array, or where the recording does not state them: as of `gearmon.read_recording`.
    must_notice : float, in (0, 1]
        Share of its stiffness whose loss on one tooth's pair has to be noticeable on every gear
        before a machine is called healthy.

    Returns
    -------
    Analysis

    Raises
    ------
    GearmonError
        If the recording cannot be used or the reference does not fit.

    Examples
    --------
    >>> found = gearmon.analyse(half, machine, [half, full])
    >>> found.verdict, found.flags
    ('healthy', ())
    """
    check_range("must_notice", must_notice, 0.0, 1.0)
    machine = load_machine(machine)
    known: dict[str, Any] = {"sampling_rate_hz": sampling_rate_hz, "unit": unit}
    if isinstance(reference, str | Path) and is_reference(reference):
        reference = read_reference(reference)
    if not (reference is None or isinstance(reference, Reference)):
        reference = learn(reference, machine, **known)
    if reference is not None:
        machine_notes(machine, reference)  # refuses other gears before any work
    recording = inspected(read_recording(recording, sensors=machine.sensors, **known))
    signature = _measured(recording, machine, reference)
    vibration = sound_part(recording, 0.0).vibration()
    indicators = waveform_indicators(vibration.samples, vibration.channel_names)
    told = signature.found or (reference is not None and signature.held)
    if told:
        indicators |= gear_indicators(signature)
    if reference is None:
        return (
            _alone(signature, machine, indicators)
            if told
            else _no_mesh(signature, machine, indicators)
        )
    compared = _Compared.of(signature, machine, reference)
    if not told:
        return compared.without_mesh(indicators)
    if elsewhere := other_speed(signature, reference):
        return _alone(signature, machine, indicators, elsewhere)
    return compared.judged(indicators, must_notice)


def _measured(
    recording: Recording, machine: Machine, reference: Reference | None
) -> MeasuredSignature:
    """Measure a recording; where no mesh stands out, at the speeds that were learned.

    The lines of a broken tooth, which fill all orders of its gear, suit half the speed as well.
    """
    signature = measure_signature(recording, machine)
    if signature.found or reference is None:
        return signature
    speeds = {
        min(machine.operating, key=lambda point: abs(point.shaft1_hz - profile.speed_hz))
        for profile in reference.profiles
    }
    if {own.shaft1_hz for own in machine.operating} == {own.shaft1_hz for own in speeds}:
        return signature
    learned_at = tuple(replace(point, share=1.0 / len(speeds)) for point in speeds)
    again = measure_signature(recording, replace(machine, operating=learned_at))
    return again if again.found or again.held else signature


def evidence_against(
    signature: MeasuredSignature, machine: Machine, reference: Reference
) -> Evidence:
    """Weigh what speaks against a healthy machine, without judging it.

    Parameters
    ----------
    signature : MeasuredSignature
        Of the new recording.
    machine : Machine
        Its machine.
    reference : Reference
        Healthy recordings.
    """
    return _Compared.of(signature, machine, reference).evidence()


def score_of(strength: float) -> float:
    """Score of a strength of evidence: log10(1 + 10^s), the strength itself where it is large."""
    return float(np.logaddexp(0.0, strength * np.log(10.0)) / np.log(10.0))


_Indicators = dict[str, dict[str, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Compared:
    """A recording beside its reference; `own` and `known` are of the channels of both."""

    signature: MeasuredSignature
    machine: Machine
    reference: Reference
    own: Profile
    known: Reference
    healthy: HealthyMachine
    notes: tuple[str, ...]

    @classmethod
    def of(cls, signature: MeasuredSignature, machine: Machine, reference: Reference) -> _Compared:
        notes = machine_notes(machine, reference) + recording_notes(signature, reference)
        known, rows = reference.shared_with(signature)
        return cls(
            signature=signature,
            machine=machine,
            reference=reference,
            own=Profile.of(signature).part(rows),
            known=known,
            healthy=_law_of(known, machine),
            notes=tuple(notes),
        )

    def judged(self, indicators: _Indicators, must_notice: float) -> Analysis:
        """Weigh all evidence and judge."""
        signature = self.signature
        evidence = self.evidence()
        changes = self._changes(evidence.deviation)
        profiles = self._profiles(evidence)
        decision = decide(evidence, self._unheard(evidence, must_notice))
        flags: tuple[Flag, ...] = ()
        if decision.verdict == "fault":
            flags = self._flags(evidence, changes, profiles)
        return Analysis(
            recording=signature.origin,
            machine=self.machine.name,
            verdict=decision.verdict,
            reason=reason(decision, evidence, flags, changes, profiles, must_notice),
            score=score_of(evidence.strength),
            false_alarm_probability=evidence.probability,
            compared_with="reference",
            signature=signature,
            indicators=indicators,
            changes=changes,
            profiles=profiles,
            flags=flags,
            warnings=(
                *signature.notes,
                *self._limits(),
                *_missing(signature),
                *_teeth_note(evidence),
            ),
            foreign=evidence.nongear,
        )

    def evidence(self) -> Evidence:
        """Weigh what speaks against a healthy machine."""
        signature, healthy = self.signature, self.healthy
        nongear = nongear_findings(self.own, self.known, kinematics(self.machine))
        striking = [f for f in nongear if f.false_alarm_probability < LIMITS.rare]
        mask = disturbed(signature.plan.orders, striking, 2.0 / signature.lines.block_turns)
        disturbed_families = [
            family.name for family in signature.plan.families if mask[list(family.lines)].any()
        ]
        whole = len(disturbed_families) == len(signature.plan.families)
        deviation = healthy.deviation(self.own, () if whole else disturbed_families)
        finding = find_tooth(self.own, deviation, healthy, self.machine)
        return Evidence(
            deviation=deviation,
            finding=finding,
            lost=signature.angle_lost,
            recurrence=self._recurrence(finding),
            knocks=signature.lines.knocked,
            path=path_change(deviation.levels, self._families(deviation)),
            runout=runout_growth(self._turns(), _healthy_turns(self.known), deviation.gap),
            nongear=nongear,
            references=len(self.known.profiles),
            angle=signature.track.uncertainty_turns
            * max(mesh.order for mesh in kinematics(self.machine).meshes),
        )

    def _recurrence(self, finding: ToothFinding | None) -> float:
        """How surely what was found comes again; not asked where it is weak or nothing knocks."""
        if finding is None or tooth_strength(finding.evidence) < LIMITS.open:
            return np.inf
        found, plan, lines = finding.best, self.signature.plan, self.signature.lines
        wheel = next(own for own in plan.wheels if (own.stage, own.gear) == found.key)
        _, rows = self.reference.shared_with(self.signature)
        blocks = lines.amplitude[:, rows]
        again, scatter = found.deviation.recurrence(found.tooth, blocks, wheel)
        knocked = scatter > LIMITS.knock_scatter or lines.knocked > LIMITS.knocks
        return again if knocked else np.inf

    def _flags(
        self, evidence: Evidence, changes: tuple[Change, ...], profiles: Sequence[ToothProfile]
    ) -> tuple[Flag, ...]:
        return Flagging(
            evidence=evidence,
            machine=self.machine,
            changes=changes,
            features=kind_features(changes, profiles, self._turns()),
        ).flags()

    def _turns(self) -> tuple[TurnChange, ...]:
        """Look how single sidebands of every gear changed."""
        return turn_changes(self.own.wheels, [own.wheels for own in self.known.profiles])

    def _families(self, deviation: MachineDeviation) -> list[Family]:
        """Families of lines that were compared, in the order of their levels."""
        families = {family.name: family for family in self.signature.plan.families}
        return [families[name] for name in deviation.family_names]

    def _changes(self, deviation: MachineDeviation) -> tuple[Change, ...]:
        levels, found = deviation.levels, []
        for i, channel in enumerate(self.known.channel_names):
            for j, family in enumerate(self._families(deviation)):
                if not np.isfinite(levels.rest_db[i, j]):
                    continue
                found.append(
                    Change(
                        channel=channel,
                        family=family.name,
                        kind=family.kind,
                        stage=family.stage,
                        harmonic=family.harmonic,
                        gear=family.gear,
                        shaft=family.shaft,
                        level_db=float(levels.expected_db[i, j] + levels.rest_db[i, j]),
                        reference_db=float(levels.expected_db[i, j]),
                        scatter_db=float(levels.sigma_db[i, j]),
                    )
                )
        return tuple(found)

    def _profiles(self, evidence: Evidence) -> tuple[ToothProfile, ...]:
        finding = evidence.finding
        if finding is None:
            return ()
        return tuple(self._profile(gear, finding, evidence) for gear in finding.searched)

    def _profile(
        self, gear: GearEvidence, finding: ToothFinding, evidence: Evidence
    ) -> ToothProfile:
        deviation = gear.deviation
        indexed = self.healthy.indexed(self.own, *gear.key)
        tooth, position = place(gear, indexed)
        losses = told_losses(finding, gear, indexed)
        strength = tooth_strength(gear.believed)
        probability = false_alarm_probability(strength, evidence.references, evidence.deviation.gap)
        return ToothProfile(
            stage=deviation.stage,
            gear=deviation.gear,
            teeth=deviation.teeth,
            order=deviation.order,
            energy=deviation.by_tooth,
            tooth=tooth,
            position=position,
            ratio=deviation.peak,
            log10_probability=float(np.log10(probability)),
            against="reference",
            counted_from="tacho" if indexed else "reference",
            loss_by_tooth=losses[0] if losses else None,
            loss_sigma_by_tooth=losses[1] if losses else None,
            noticed_from=noticed_from(gear),
        )

    def _unheard(self, evidence: Evidence, must_notice: float) -> tuple[str, ...]:
        """Name the gears of which gross damage could not have been heard."""
        searched = evidence.finding.searched if evidence.finding is not None else ()
        loss = {gear.key: heard_from(gear) for gear in searched}
        most = LIMITS.about * must_notice
        gears = dict.fromkeys(
            (mesh.stage, wheel.gear)
            for mesh in kinematics(self.machine).meshes
            for wheel in mesh.wheels
        )
        deaf = [gear for gear in gears if (loss.get(gear) or 1.0) > most]
        silent = [n for n in self.reference.channel_names if n not in self.known.channel_names]
        return (
            *(f"the {gear} of stage {stage}" for stage, gear in deaf),
            *(f"what channel {name} hears" for name in silent),
        )

    def _limits(self) -> tuple[str, ...]:
        """Name what limits a comparison with this reference."""
        signature, reference = self.signature, self.reference
        notes = [*self.notes, *(f"reference: {note}" for note in reference.notes)]
        if len(reference.profiles) == 1:
            notes.append(
                "the reference is one recording: how this machine differs from one healthy "
                "recording to the next is assumed, not learned"
            )
        shared = self.known.channel_names
        left_out = [name for name in signature.channel_names if name not in shared]
        if left_out:
            notes.append(f"channels not in the reference were left out: {', '.join(left_out)}")
        missing = [name for name in reference.channel_names if name not in shared]
        if missing:
            notes.append(
                f"channels of the reference not looked at: {', '.join(missing)}; a fault may show "
                "in those alone: check their sensors, cables and names, and record again"
            )
        speeds = [profile.speed_hz for profile in reference.profiles]
        speed = signature.speed.estimated_hz
        if min(abs(speed / known - 1) for known in speeds) > SPEED_UNIT:
            notes.append(
                f"speed {speed:.2f} Hz is more than {100 * SPEED_UNIT:g} % off that of every "
                f"healthy recording ({min(speeds):.2f} to {max(speeds):.2f} Hz): resonances may "
                "change levels, so that levels alone call no fault"
            )
        return tuple(notes)

    def without_mesh(self, indicators: _Indicators) -> Analysis:
        """Judge a recording that lacks the mesh which its reference has: that is a change too."""
        found = _no_mesh(self.signature, self.machine, indicators)
        found = replace(found, warnings=(*found.warnings, *self.notes))
        deviation = self.healthy.deviation(self.own)
        broadband = deviation.broadband
        if broadband is None:
            return found
        strength = broadband_strength(broadband)
        gain = float(np.median(broadband.gain_db))
        flags: tuple[Flag, ...] = ()
        probability = false_alarm_probability(strength, len(self.reference.profiles), deviation.gap)
        if gain < _SILENT_DB:
            verdict = "cannot tell"
            told = (
                f"The recording is {-gain:.0f} dB quieter than the healthy ones and shows no gear "
                "mesh: the machine stood still, or the sensor is dead or disconnected."
            )
        elif strength >= LIMITS.noise_strength:
            verdict = "fault"
            flags = (_mesh_lost(found.reason, gain, probability),)
            told = fault_sentence(flags)
        else:
            return found
        return replace(
            found,
            verdict=verdict,
            reason=f"{told} {found.reason}",
            flags=flags,
            score=score_of(strength),
            false_alarm_probability=probability,
            compared_with="reference",
        )


# several recordings are held against one reference
_law_of = lru_cache(maxsize=4)(HealthyMachine.of)


@lru_cache(maxsize=4)
def _healthy_turns(reference: Reference) -> tuple[tuple[TurnChange, ...], ...]:
    return healthy_turns([profile.wheels for profile in reference.profiles])


def _mesh_lost(why: str, gain: float, probability: float) -> Flag:
    return Flag(
        kind="mesh lost",
        false_alarm_probability=probability,
        evidence=(
            f"the spectrum between the lines changed too ({gain:+.1f} dB in the median): gross "
            "damage, or a machine that runs at another speed than its file says",
            why,
        ),
    )


def _alone(
    signature: MeasuredSignature,
    machine: Machine,
    indicators: _Indicators,
    why: str = "There is no healthy reference",
) -> Analysis:
    """Judge a recording by itself: every tooth against the others of its gear."""
    profiles = _own_teeth(Profile.of(signature))
    log10 = min((p.log10_probability for p in profiles), default=0.0)
    log10 = min(0.0, log10 + float(np.log10(max(1, len(profiles)))))
    flags = own_teeth_flags(profiles, _OWN_TEETH_BELOW)
    expected, notes = _expected(signature, machine)
    return Analysis(
        recording=signature.origin,
        machine=machine.name,
        verdict="fault" if flags else "cannot tell",
        reason=own_teeth_reason(profiles, why),
        score=-log10,
        false_alarm_probability=float(10.0**log10),
        compared_with="expected signature" if expected else "nothing",
        signature=signature,
        indicators=indicators,
        profiles=profiles,
        flags=flags,
        expected=expected,
        warnings=(*signature.notes, *notes, *_missing(signature)),
    )


def _own_teeth(own: Profile) -> tuple[ToothProfile, ...]:
    """Hold every tooth against the others of its gear."""
    looked = [
        # the tachometer's zero is that of shaft 1: other shafts stand anywhere when it comes
        locate(wheel, numbered=own.tacho and abs(wheel.order - 1.0) < 1e-12)
        for wheel in own.wheels
    ]
    return tuple(profile for profile in looked if profile is not None)


def _expected(
    signature: MeasuredSignature, machine: Machine
) -> tuple[Signature | None, tuple[str, ...]]:
    """Return the expected signature up to half the sampling rate, or why there is none."""
    # not needed with a reference
    from gearmon.signatures.expected.baseline import expected_signature

    try:
        return expected_signature(machine, max_hz=0.5 * signature.sampling_rate_hz), ()
    except GearmonError as error:
        return None, (f"no expected signature: {error}",)


def _missing(signature: MeasuredSignature) -> tuple[str, ...]:
    return tuple(
        f"mesh of stage {mesh.stage} not found: {mesh.reason}"
        for mesh in signature.meshes
        if not mesh.found
    )


def _teeth_note(evidence: Evidence) -> tuple[str, ...]:
    """Name what the estimate of a loss takes for granted."""
    finding = evidence.finding
    search = finding.best.search if finding is not None else None
    if search is not None and search.response.from_teeth_alone:
        return (
            "the machine file lacks gear data: the size of a loss rests on teeth of standard "
            "proportions",
        )
    return ()


def _no_mesh(signature: MeasuredSignature, machine: Machine, indicators: _Indicators) -> Analysis:
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
        warnings=signature.notes,
    )
