"""From recording to verdict: the one place that strings the analysis together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.diagnosis import alone, verdict
from gearmon.diagnosis.evidence import LIMITS, Evidence, noticed_from, path_change, tooth_strength
from gearmon.diagnosis.fault_types.kinds import kind_features
from gearmon.diagnosis.hypotheses import turns
from gearmon.diagnosis.hypotheses.tooth_damage import ToothFinding, find_tooth, told_losses
from gearmon.diagnosis.law.gear_lines import which_gear
from gearmon.diagnosis.law.machine import HealthyMachine, MachineDeviation
from gearmon.diagnosis.nongear import disturbed, nongear_findings
from gearmon.diagnosis.results import Analysis, Flag, ToothProfile
from gearmon.errors import check_range
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.signals.bad_samples import inspected, sound_part
from gearmon.signals.recording import Recording, RecordingLike, read_recording, read_recordings
from gearmon.signatures.measured import reference as references
from gearmon.signatures.measured.indicators import gear_indicators, waveform_indicators
from gearmon.signatures.measured.line_plan import Family
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature
from gearmon.signatures.measured.reference import Profile, Reference

# How far the lines of a mesh lie below those of all healthy recordings [dB] before another speed is
# looked for: over a factor of ten in load. Of a drawn machine whose second mesh alone is heard, 3 %
# above its nominal speed, that passed for the first: its own lines were 60 dB lower.
_GONE_DB = 20.0


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
    measured = measured_healthy((partial(measure_signature, r) for r in healthy), machine)
    return learned(measured, machine)


def measured_healthy(
    recordings: Iterable[Callable[..., MeasuredSignature]], machine: Machine
) -> list[MeasuredSignature]:
    """Measure healthy recordings; a mesh that some of them show is looked for far off in others.

    Parameters
    ----------
    recordings : iterable of callable
        What `measure_signature` does with each of them.
    machine : Machine
        The machine.
    """
    found = [(measure, measure(machine)) for measure in recordings]
    far = any(own.found for _, own in found)
    return [own if own.found or not far else measure(machine, far=True) for measure, own in found]


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
    reference, doubts = references.make_reference(signatures, machine), []
    for own, profile in zip(signatures, reference.profiles, strict=True):
        if alone.own_teeth_flags(alone.own_teeth(profile)):
            doubts.append(
                f"{own.origin}: one tooth stands out of its gear already; is the machine sound?"
            )
        if own.angle_lost:
            doubts.append(
                f"{own.origin}: its angle was lost on the way, so that it teaches little; record "
                "at a steadier speed, or with a tachometer"
            )
        others = tuple(one for one in reference.profiles if one is not profile)
        known = replace(reference, profiles=others)
        # of two that differ nobody knows which is the odd one
        strength = evidence_against(own, machine, known).strength if len(others) > 1 else 0.0
        if strength >= LIMITS.fault:
            doubts.append(
                f"{own.origin}: departs from the other recordings as a fault would (strength "
                f"{strength:.1f}); was the machine sound, and everything as in the others?"
            )
    return replace(reference, notes=tuple(doubts))


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
    if isinstance(reference, str | Path) and references.is_reference(reference):
        reference = references.read_reference(reference)
    if not (reference is None or isinstance(reference, Reference)):
        reference = learn(reference, machine, **known)
    if reference is not None:
        references.machine_notes(machine, reference)  # refuses other gears before any work
    recording = inspected(read_recording(recording, sensors=machine.sensors, **known))
    signature = _measured(recording, machine, reference)
    vibration = sound_part(recording, 0.0).vibration()
    indicators = waveform_indicators(vibration.samples, vibration.channel_names)
    told = signature.found or (reference is not None and signature.held)
    if told:
        indicators |= gear_indicators(signature)
    if reference is not None:
        answer = _Compared(signature, machine, reference).answer(told, must_notice)
    else:
        answer = (alone.judged_alone if told else alone.no_mesh)(signature, machine)
    return replace(answer, indicators=indicators)


def _measured(recording: Recording, machine: Machine, known: Reference | None) -> MeasuredSignature:
    """Measure a recording; where what was learned is not heard, also at other speeds.

    The lines of a broken tooth, which fill all orders of its gear, suit half the speed as well; and
    those of another mesh may suit one that is not heard.
    """
    signature = measure_signature(recording, machine)
    if known is None or signature.speed.method == "tacho":
        return signature
    if signature.found and not _mesh_gone(signature, known):
        return signature
    speeds = {
        min(machine.operating, key=lambda point: abs(point.shaft1_hz - profile.speed_hz))
        for profile in known.profiles
    }
    learned_at = tuple(replace(point, share=1.0 / len(speeds)) for point in speeds)
    again = measure_signature(recording, replace(machine, operating=learned_at), far=True)
    better = again.found and not _mesh_gone(again, known)
    return again if better or (again.held and not signature.found) else signature


def _mesh_gone(signature: MeasuredSignature, reference: Reference) -> bool:
    """Whether a mesh that is not found lies far below that of all healthy recordings."""
    known, rows = reference.shared_with(signature)
    families, shared = enumerate(signature.plan.families), known.family_names
    every = [(f.stage, f.name, k) for k, f in families if f.kind == "mesh" and f.name in shared]
    for stage in (mesh.stage for mesh in signature.meshes if not mesh.found):
        its = {name: place for own, name, place in every if own == stage}
        healthy = [profile.of_families([*its]) for profile in known.profiles]
        heard = np.all([levels.heard for levels in healthy], axis=0)
        least = np.min([levels.level_db for levels in healthy], axis=0)
        fell = (least - signature.level_db[np.ix_(rows, [*its.values()])])[heard]
        if fell.size and np.median(fell) > _GONE_DB:
            return True
    return False


def evidence_against(own: MeasuredSignature, machine: Machine, reference: Reference) -> Evidence:
    """Weigh what speaks against a healthy machine, without judging it.

    Parameters
    ----------
    own : MeasuredSignature
        Of the new recording.
    machine : Machine
        Its machine.
    reference : Reference
        Healthy recordings.
    """
    return _Compared(own, machine, reference).evidence()


class _Compared:
    """A recording beside its reference: `own` and `known` are both in the channels of both."""

    def __init__(self, measured: MeasuredSignature, machine: Machine, reference: Reference) -> None:
        self.signature, self.machine, self.reference = measured, machine, reference
        self.known, self.rows = reference.shared_with(measured)
        self.own = Profile.of(measured).part(self.rows)
        self.healthy = tuple(profile.wheels for profile in self.known.profiles)

    @cached_property
    def sidebands(self) -> turns.Sidebands:
        """Changes of single sidebands."""
        return turns.turn_changes(self.own.wheels, self.healthy)

    def answer(self, told: bool, must_notice: float) -> Analysis:
        """Judge a recording of which gears are told, or that lacks the mesh of its reference."""
        # refuses other channels
        notes = references.recording_notes(self.signature, self.reference)
        notes = references.machine_notes(self.machine, self.reference) + notes
        if not told:
            deviation = _law_of(self.known, self.machine).deviation(self.own)
            count = len(self.reference.profiles)
            evidence = Evidence(deviation=deviation, finding=None, references=count)
            found = alone.mesh_lost(alone.no_mesh(self.signature, self.machine), evidence)
            return replace(found, warnings=(*found.warnings, *notes))
        if elsewhere := references.other_speed(self.signature, self.reference):
            return alone.judged_alone(self.signature, self.machine, elsewhere, self.known.profiles)
        return self.judged(must_notice, notes)

    def judged(self, must_notice: float, notes: Sequence[str]) -> Analysis:
        """Weigh all evidence and judge."""
        signature = self.signature
        evidence = self.evidence()
        families, shared = self._families(evidence.deviation), self.known.channel_names
        changes = verdict.level_changes(evidence.deviation.levels, shared, families)
        undetected = [mesh.stage for mesh in signature.meshes if not mesh.found]
        hidden = verdict.hidden_stages(evidence.searched, undetected)
        profiles = tuple(_profiles(evidence, hidden))
        silent = [name for name in self.reference.channel_names if name not in shared]
        deaf = verdict.unheard(evidence, self.machine, silent, must_notice, hidden)
        answer = verdict.decide(evidence, deaf)
        flags: tuple[Flag, ...] = ()
        if answer == "fault":
            energies = {(own.stage, own.gear): own.energy for own in profiles}
            features = kind_features(changes, energies, self.sidebands)
            flags = verdict.Flagging(evidence, changes, features).flags()
        found = replace(
            alone.no_mesh(signature, self.machine),
            verdict=answer,
            score=evidence.score,
            false_alarm_probability=evidence.probability,
            compared_with="reference",
            changes=changes,
            profiles=profiles,
            flags=flags,
            warnings=(
                *signature.notes,
                *notes,
                *verdict.limits(signature, self.reference),
                *verdict.not_found(signature),
                *verdict.taken_for_granted(evidence),
            ),
            foreign=evidence.nongear,
        )
        return replace(found, reason=verdict.reason(found, evidence, deaf))

    def evidence(self) -> Evidence:
        """Weigh what speaks against a healthy machine."""
        signature, plan = self.signature, self.signature.plan
        nongear = nongear_findings(self.own, self.known, kinematics(self.machine))
        striking = [f for f in nongear if f.false_alarm_probability < LIMITS.rare]
        mask = disturbed(plan.orders, striking, 2.0 / signature.lines.block_turns)
        left_out = [family.name for family in plan.families if mask[list(family.lines)].any()]
        healthy, whole = _law_of(self.known, self.machine), len(left_out) == len(plan.families)
        deviation = healthy.deviation(self.own, () if whole else left_out)
        finding = find_tooth(self.own, deviation, self.machine)
        return Evidence(
            deviation=deviation,
            finding=finding,
            lost=signature.angle_lost,
            recurrence=self._recurrence(finding),
            knocks=signature.lines.knocked,
            path=path_change(deviation.levels, self._families(deviation)),
            runout=turns.runout_growth(self.sidebands, _healthy_turns(self.healthy), deviation.gap),
            nongear=nongear,
            references=len(self.reference.profiles),
            angle=signature.track.uncertainty_turns
            * max(mesh.order for mesh in kinematics(self.machine).meshes),
        )

    def _recurrence(self, finding: ToothFinding | None) -> float:
        """How surely what was found comes again; not asked where it is weak or nothing knocks."""
        if finding is None or tooth_strength(finding.evidence) < LIMITS.open:
            return np.inf
        found, plan, lines = finding.best, self.signature.plan, self.signature.lines
        wheel = next(own for own in plan.wheels if (own.stage, own.gear) == found.key)
        blocks, swings = lines.amplitude[:, self.rows], self.signature.speed_swings
        again, scatter = found.deviation.recurrence(found.tooth, blocks, wheel, swings)
        # where the speed swings, knocks are not looked for
        knocked = swings or scatter > LIMITS.knock_scatter or lines.knocked > LIMITS.knocks
        return again if knocked else np.inf

    def _families(self, deviation: MachineDeviation) -> list[Family]:
        """Families of lines that were compared, in the order of their levels."""
        families = {family.name: family for family in self.signature.plan.families}
        return [families[name] for name in deviation.family_names]


def _profiles(evidence: Evidence, hidden: set[int]) -> Iterator[ToothProfile]:
    """Give what was found around the turn of each gear that was searched."""
    finding = evidence.finding
    if finding is None:
        return
    for gear in finding.searched:
        deviation, chance = gear.deviation, evidence.chance(tooth_strength(gear.believed))
        tooth, position = gear.place
        loss, sigma = told_losses(finding, gear)
        yield ToothProfile(
            **which_gear(deviation),
            energy=deviation.by_tooth,
            tooth=tooth,
            position=position,
            ratio=deviation.peak,
            log10_probability=float(np.log10(chance)),
            against="reference",
            counted_from=gear.counted_from,
            loss_by_tooth=loss,
            loss_sigma_by_tooth=sigma,
            noticed_from=None if deviation.stage in hidden else noticed_from(gear),
        )


# several recordings are held against one reference
_law_of = lru_cache(maxsize=4)(HealthyMachine)
_healthy_turns = lru_cache(maxsize=4)(turns.healthy_turns)
