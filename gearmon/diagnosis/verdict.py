"""The verdict: flags from what was found, and its reason, what a plant manager needs first.

Flags are of a tooth, of a kind of fault, of a path, of lines of no gear; each has its evidence in
sentences that can be checked on the pictures.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from gearmon.diagnosis.evidence import LIMITS, Evidence, lines_strength, rare_strength
from gearmon.diagnosis.fault_types.kinds import NONE, GearFeatures, focus_of, judge_kind
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence, ToothFinding, crack_depth_mm
from gearmon.diagnosis.law.machine import SPEED_UNIT, LevelDeviation
from gearmon.diagnosis.results import Analysis, Change, Flag, ToothProfile
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, PlanetaryStage
from gearmon.signatures.measured.line_plan import Family
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.reference import Reference

# A kind is named if the rules hold it this likely.
_NAMED = 0.5
# A departure is called one tooth's from this probability on; from the second where the sidebands
# once or twice a turn away grew by so much more [dB] than those four to six turns away, which one
# tooth hardly ever does.
_ONE_TOOTH, _ONE_TOOTH_AND_RUNOUT, _RUNOUT_DB = 0.5, 0.99, 12.0
# Where no kind is clear, a departure far from the mesh harmonics is called by its place.
_UNCLEAR = "changed residual"
_SENTENCES = 4
# Lead (logarithm of a factor) below which another gear may be the cause as well: of 287 findings on
# one of two gears with the same lines (47 machines of two simulators, 15 to 60 %) the right one is
# blamed in 24 of 32 below it, in 254 of 255 beyond.
_SURE_LEAD = 4.0
_RESONANCES = "resonances may change levels, so that levels alone call no fault"
# Gears of stages whose axes stand still.
_OF_PAIRS = ("pinion", "gear")
# What numbers of teeth mean, by where they are counted from.
_COUNTED = {
    "tacho": "teeth are counted from the one that enters mesh at the tachometer pulse, in this "
    "recording as in the healthy ones",
    "reference": "teeth are counted from where the first healthy recording begins: the same number "
    "is the same tooth in every recording compared with this reference",
}
# Stage and gear of a flag.
_Place = tuple[int | None, str | None]
_NOWHERE: _Place = (None, None)
# How sentences end that leave open which planet, tooth or gear it is.
_UNTOLD = ("cannot be told", "may be any of them", "may be the cause as well")


def decide(evidence: Evidence, unheard: str = "") -> str:
    """Judge the evidence.

    Parameters
    ----------
    evidence : Evidence
        Against the healthy machine.
    unheard : str
        What this recording, with this reference, could not have told of; "" if nothing.

    Returns
    -------
    {"healthy", "fault", "cannot tell"}
    """
    if evidence.strength >= LIMITS.fault:
        return "fault"
    return "cannot tell" if doubt(evidence) or unheard else "healthy"


def doubt(evidence: Evidence) -> str:
    """Say why evidence that calls no fault does not speak for a healthy machine; "" if it does."""
    heavy = evidence.deviation.heavy
    drowned = evidence.knocks > LIMITS.knocks and evidence.changed >= LIMITS.open
    if drowned or evidence.recurrence < LIMITS.recurs:
        return (
            "Knocks drown the gears: what stands out came in single turns, not in each. Record "
            "again where the machine runs more quietly, or longer."
        )
    if evidence.strength >= LIMITS.open or evidence.probability < LIMITS.rare:
        return "More changed than is usual, but not enough to call it a fault: record again."
    if heavy > LIMITS.heaviest:
        return (
            f"The gear mesh is {20.0 / np.log(10.0) * heavy:.0f} dB louder than any healthy "
            "recording had it: the load is far heavier than those learned, or all teeth are worn."
        )
    # off throughout, and not only after a slip
    if evidence.lost or LIMITS.angle_unsure < evidence.angle < LIMITS.angle_slipped:
        return (
            "Nothing speaks against the machine, but its angle was lost on the way: record again "
            "at a steadier speed, or with a tachometer."
        )
    return ""


class Flagging(NamedTuple):
    """All that flags are made from.

    Parameters
    ----------
    evidence : Evidence
        What was compared.
    changes : tuple of Change
        Families of lines.
    features : dict of (int, str) to dict
        What kinds of fault are told by.
    """

    evidence: Evidence
    changes: tuple[Change, ...]
    features: GearFeatures

    def flags(self) -> tuple[Flag, ...]:
        """Flag what stands out, the strongest first."""
        whole, found = self.evidence, list[Flag]()
        finding, strength = whole.finding, whole.strengths.get("tooth", 0.0)
        if finding is not None and strength >= LIMITS.open:
            # another path changes the pattern of every gear, all around its turn: the louder of the
            # two is the cause, unless it is one event
            louder = strength >= whole.changed or not whole.path.likely
            spread = None if louder else finding.best.spread
            if louder or (spread is not None and spread.explained >= LIMITS.one_event):
                found.append(self._of_finding(finding, strength))
        # none of 51 simulated gears that run out changes the noise or whole bands; bearings and
        # sensors that were moved do, and move single sidebands with them
        moved = whole.changed >= LIMITS.fault and (whole.noise_rose or whole.path.likely)
        grown = whole.strengths["runout"] >= LIMITS.fault and not moved
        flagged = {(flag.stage, flag.gear) for flag in found}
        for growth in whole.runout if grown else ():
            strength, gear = rare_strength([growth.log10_probability]), (growth.stage, growth.gear)
            if strength >= LIMITS.fault and gear not in flagged:
                flagged.add(gear)
                kind, _, told = self._kind(gear, growth.kind, gear)
                found.append(self._flag(kind, strength, (*growth.evidence, *told), gear))
        (gear, times), strength = whole.one_shaft, whole.strengths["one shaft"]
        if strength >= LIMITS.fault and not any(flag.gear for flag in found):
            departs = f"{_gear(*gear)} departs from its healthy pattern all around its turn"
            beside = f"{departs}, {times:.0f} times as much as any gear of another shaft"
            kind, place, told = self._kind(gear, _UNCLEAR, gear)
            flagged.add(gear)
            found.append(self._flag(kind, strength, (beside, *told), place))
        # lines that belong to no gear blame none
        nongear = [
            self._flag(own.kind, strength, (own.name, *own.evidence))
            for own in whole.nongear
            if (strength := rare_strength([own.log10_probability])) >= LIMITS.fault
        ]
        if whole.changed >= LIMITS.fault and not any(flag.tooth for flag in found):
            levels = self._levels(bool(nongear))
            found += [flag for flag in levels if (flag.stage, flag.gear) not in flagged]
        return (*found, *nongear)

    def _flag(
        self, kind: str, strength: float, told: Iterable[str], place: _Place = _NOWHERE, **more: Any
    ) -> Flag:
        """Return a flag of a kind, with the probability of its strength on a healthy machine."""
        chance, (stage, gear) = self.evidence.chance(strength), place
        known: dict[str, Any] = {"stage": stage, "gear": gear or None} | more
        return Flag(kind=kind, false_alarm_probability=chance, evidence=tuple(told), **known)

    def _of_finding(self, finding: ToothFinding, strength: float) -> Flag:
        """Flag the departure that the search found: of one tooth, or of another kind."""
        best, loss, spread = finding.best, finding.loss, finding.best.spread
        departs = f"{_gear(*best.key)} departs from its healthy pattern"
        explained = list[str]()
        around = best.deviation.peak < LIMITS.all_around * best.deviation.misfit
        if spread is not None:
            explained = [f"one tooth explains {100 * spread.explained:.0f} % of the departure"]
            # an event that rings on around a small pinion is still one tooth's
            around = around and spread.explained < LIMITS.one_event
            row = self.features[best.key]
            first, others = max(row["once_db"], row["twice_db"]), max(row["several_db"], 0.0)
            runs_out = first - others > _RUNOUT_DB
            around |= spread.one_tooth < (_ONE_TOOTH_AND_RUNOUT if runs_out else _ONE_TOOTH)
        if around:
            return self._spread_flag(finding, strength, [f"{departs} around its turn", *explained])
        tooth, _ = best.place
        peak = f"{best.deviation.peak:.1f} times the energy elsewhere in its turn"
        evidence, crack, sizes = [f"{departs} at tooth {tooth}: {peak}"], list[str](), {}
        if loss is not None:
            ends = ("", "_low", "_high")
            sizes = {f"stiffness_loss{end}": own for end, own in zip(ends, loss, strict=True)}
            evidence.append(
                f"as a loss of {100 * loss.loss:.0f} % ({100 * loss.low:.0f} to "
                f"{100 * loss.high:.0f} %) of the stiffness of that tooth's pair would make it"
            )
            # known where the geometry of the gears is
            depths = [crack_depth_mm(finding.machine, *best.key, own) for own in loss]
            if depths[0] is not None:
                size, low, high = ("?" if own is None else f"{own:.2g}" for own in depths)
                crack = [f"as a crack depth that would be {size} mm ({low} to {high} mm)"]
        evidence += [_COUNTED[best.counted_from], *_alike(finding), *explained]
        evidence += [
            f"the {name} of stage {number} shows it too"
            + (f" and {_UNTOLD[2]}" if lead < _SURE_LEAD else "")
            for name, number, lead in finding.rivals
        ]
        told = (*evidence, *crack)
        return self._flag("tooth damage", strength, told, best.key, tooth=tooth, **sizes)

    def _spread_flag(self, finding: ToothFinding, strength: float, evidence: list[str]) -> Flag:
        """Flag a departure that one tooth does not explain, by its kind where one is clear."""
        best, spread = finding.best, finding.best.spread
        if spread is not None:
            second = spread.second
            if second is not None and spread.several_teeth > _NAMED:
                count, way = abs(second.distance), "after" if second.distance > 0 else "before"
                evidence.append(
                    f"a second tooth, {count} teeth {way} the one that departs most, is heard at "
                    f"about {second.size:.1f} of it"
                )
            if spread.of_two_teeth:
                return self._flag("several teeth", strength, evidence, best.key)
        # what departs repeats with all gears on its shaft: the one that changed most tells its kind
        focus, order = focus_of(self.features), best.deviation.order
        own = next((one.deviation.order for one in finding.searched if one.key == focus), 0.0)
        alike = abs(own - order) <= 1e-9 * order
        kind, place, told = self._kind(focus if alike else best.key, _UNCLEAR, best.key)
        return self._flag(kind, strength, (*evidence, *told), place)

    def _kind(
        self, gear: tuple[int, str], otherwise: str, place: _Place
    ) -> tuple[str, _Place, tuple[str, ...]]:
        """Kind of a fault of one gear, its place, and why; where no kind but one tooth is clear."""
        spread = next((own.spread for own in self.evidence.searched if own.key == gear), None)
        judged = judge_kind(self.features, gear=gear, spread=spread)
        if judged.kind in (NONE, "tooth damage") or judged.probability < _NAMED:
            return otherwise, place, ()
        likely = f"{judged.probability:.0%} by physical rules, not calibrated"
        told = f"most like {judged.kind} ({likely})", *judged.evidence
        return judged.kind, (judged.stage, judged.gear), told

    def _levels(self, nongear: bool) -> list[Flag]:
        """Flag changed levels: as noise, a path, a kind of a gear's fault, or as they are."""
        whole, strength, strongest = self.evidence, self.evidence.changed, sentences(self.changes)
        noisy, path = whole.noise_rose, whole.path
        if path.likely and (whole.strengths["path"] >= LIMITS.fault or not noisy):
            told = (
                f"all lines about one mesh harmonic moved together: {100 * path.common:.0f} % "
                "of the change is common to them, and no gear stands out: a sensor that was moved "
                "or fixed anew, or a gearbox that was opened"
            )
            return [self._flag("path changed", strength, (told, *strongest))]
        first = max(self.changes, key=lambda c: abs(c.standardised), default=None)
        told = "no line of a gear moved with it"
        if noisy:
            told = (
                "the spectrum between the lines of the gears rose, by more than those lines: a "
                "bearing, a loose part, or another machine"
            )
        elif first is not None and lines_strength(whole.deviation.levels) >= LIMITS.open:
            group = attrgetter("kind", "stage", "gear")
            own = sentences([change for change in self.changes if group(change) == group(first)])
            # the kind of fault that they are most like
            plain = f"changed {first.kind}", (first.stage, first.gear)
            kind, place, why = self._kind(focus_of(self.features), *plain)
            return [self._flag(kind, strength, (*why, *own), place)]
        # mains and bearings fill whole bands of the spectrum; no gear is to blame
        kind = "broadband rise" if noisy else "broadband change"
        return [] if nongear else [self._flag(kind, strength, (told, *strongest[:1]))]


def _alike(finding: ToothFinding) -> list[str]:
    """Tell which teeth of a planetary set sound alike."""
    own, (tooth, _) = finding.best.deviation, finding.best.place
    count, teeth = own.meetings, own.teeth
    if count > 1 and own.gear == "planet":
        return [f"which of the planets it is of {_UNTOLD[0]}"]
    others = sorted({round(tooth - 1 + k * teeth / count) % teeth + 1 for k in range(count)})
    named = ", ".join(map(str, others))
    told = f"teeth {named} meet a planet at the same moments: it {_UNTOLD[1]}"
    return [told] if len(others) > 1 else []


def left_open(flag: Flag) -> list[str]:
    """Return what the evidence of a flag says of what cannot be told apart.

    Parameters
    ----------
    flag : Flag
    """
    return [told for told in flag.evidence if told.endswith(_UNTOLD)]


def level_changes(
    levels: LevelDeviation, channels: Sequence[str], families: Sequence[Family]
) -> tuple[Change, ...]:
    """Return every level that could be compared, by channel and family of lines.

    Parameters
    ----------
    levels : LevelDeviation
        Of a recording from the healthy machine.
    channels : sequence of str
        Its channels.
    families : sequence of Family
        Its families.
    """
    names = ("kind", "stage", "harmonic", "gear", "shaft")
    return tuple(
        Change(
            channel=channels[i],
            family=families[j].name,
            **{name: getattr(families[j], name) for name in names},
            level_db=float(levels.expected_db[i, j] + levels.rest_db[i, j]),
            reference_db=float(levels.expected_db[i, j]),
            scatter_db=float(levels.sigma_db[i, j]),
        )
        for i, j in np.argwhere(np.isfinite(levels.rest_db)).tolist()
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
        As "a1: sidebands of shaft 1 around mesh 2 harmonic 1 rose 6.8 dB; healthy scatter 0.7 dB".
    """
    strongest = sorted(changes, key=lambda change: -abs(change.standardised))[:_SENTENCES]
    return tuple(
        f"{change.channel}: {change.family} {'rose' if change.change_db > 0 else 'fell'} "
        f"{abs(change.change_db):.1f} dB; healthy scatter {change.scatter_db:.1f} dB"
        for change in strongest
    )


_PLAIN = {
    "tooth damage": "Damage of {tooth} of {gear}{loss}.",
    "several teeth": "Several teeth of {gear} are likely damaged.",
    "distributed pitting": "Many teeth of {gear} are likely pitted.",
    "wear": "The teeth of {gear} are likely worn.",
    "eccentricity": "{Gear} runs out, or more than it did.",
    "misalignment": "{Gear} wobbles, or more than it did: it may stand askew.",
    "looseness": "Something about {gear} is likely loose.",
    "path changed": "Everything sounds different, as if the sensor had been moved or the gearbox "
    "opened. If neither was done, look at the gears: which one it is cannot be told.",
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
    first, loss = flags[0], ""
    gear = _gear(first.stage, first.gear)
    tooth = f"tooth {first.tooth}" if first.tooth else "one tooth"
    if first.stiffness_loss is not None:
        loss = f", which has lost about {100 * first.stiffness_loss:.0f} % of its stiffness"
    plain = "The vibration of {gear} changed; what kind of fault is unclear."
    capital = gear[:1].upper() + gear[1:]
    return _PLAIN.get(first.kind, plain).format(gear=gear, Gear=capital, tooth=tooth, loss=loss)


def _gear(stage: int | None, gear: str | None) -> str:
    if stage is None:
        return "the machine"
    return f"the {gear} of stage {stage}" if gear else f"the gears of stage {stage}"


def hidden_stages(searched: Sequence[GearEvidence], undetected: Collection[int]) -> set[int]:
    """Name the stages of which nothing is heard.

    Parameters
    ----------
    searched : sequence of GearEvidence
        All gears.
    undetected : collection of int
        Stages whose mesh was not detected: what is heard at its lines may be pitch errors of a gear
        on the same shaft, unless they stand out of the other lines of both gears. Those of a
        planetary set stand where its planets put them.
    """
    asked = [own for own in searched if own.key[0] in undetected and own.key[1] in _OF_PAIRS]
    return {own.key[0] for own in asked if not own.mesh_stands_out}


def unheard(
    evidence: Evidence,
    machine: Machine,
    silent: Sequence[str],
    must_notice: float,
    hidden: Collection[int] = (),
) -> str:
    """Name the gears of which gross damage could not have been heard, and channels that are silent.

    Parameters
    ----------
    evidence : Evidence
        Against the healthy machine.
    machine : Machine
        The machine.
    silent : sequence of str
        Channels of the reference that the recording lacks.
    must_notice : float
        Loss of a pair's stiffness that should have been heard.
    hidden : collection of int
        Stages of which nothing is heard, see `hidden_stages`.

    Returns
    -------
    str
        A sentence or two; "" if all of them would have been.
    """
    meshes, heard, least = kinematics(machine).meshes, evidence.heard, LIMITS.about * must_notice
    gears = dict.fromkeys((mesh.stage, wheel.gear) for mesh in meshes for wheel in mesh.wheels)
    deaf = [_gear(*own) for own in gears if own[0] in hidden or heard.get(own, 1.0) > least]
    told = []
    if deaf:
        told.append(
            f"Even a loss of {100 * must_notice:.0f} % of a tooth's stiffness might have gone "
            f"unnoticed on {', '.join(deaf)}: record longer, under load, or nearer to it."
        )
        told += [
            f"A sun that floats hides damage in its set: if that of stage {stage} does not, give "
            f"{_sun_held(machine, stage)} in the machine file."
            for stage in dict.fromkeys(g.key[0] for g in evidence.searched if g.instead is not None)
        ]
    if silent:
        told.append(
            f"What {', '.join(silent)} hears is missing: check sensor, cable and name of the "
            "channel, and record again."
        )
    return " ".join(told)


def _sun_held(machine: Machine, number: int) -> str:
    """Say by what a machine file tells how the sun of a stage is held."""
    stage = machine.stages[number - 1]
    if "sun" not in stage.on_shafts:
        return "the stage its fixed_support_n_per_m"
    shaft = number + stage.on_shafts.index("sun")
    return f"its shaft a [[bearing]] (shaft = {shaft}) with its stiffness_n_per_m"


def reason(found: Analysis, evidence: Evidence, unheard: str = "") -> str:
    """Give the reason of a verdict on a recording that was compared with a reference.

    Parameters
    ----------
    found : Analysis
        With verdict, flags, changes and profiles.
    evidence : Evidence
        What was compared.
    unheard : str
        What could not have been told of; "" if nothing.
    """
    levels, broadband = evidence.deviation.levels, evidence.deviation.broadband
    rested = (
        f"Levels of lines differ from the expected by {levels.mean_square() ** 0.5:.1f} times "
        f"their healthy scatter (root mean square of {levels.rest_db.size})"
    )
    if broadband is not None:
        rested += f", the spectrum between them by {broadband.mean_square() ** 0.5:.1f} times"
    rested += f". {most_striking(found.profiles)}"
    if found.verdict == "fault":
        most = [f"Most of all, {strongest}." for strongest in sentences(found.changes)[:1]]
        return " ".join((fault_sentence(found.flags), rested, *most))
    if found.verdict != "healthy":
        told = doubt(evidence) or "Nothing speaks against the machine, but not all of it was heard."
        return " ".join(filter(None, (told, unheard, rested)))
    # wear of all teeth that would pass for a heavier load
    worn = 100 * (1.0 - np.exp(evidence.deviation.heavy - LIMITS.heaviest))
    return (
        f"The machine sounds as it did when it was healthy.{_noticed(evidence, found.profiles)} "
        "Wear of all teeth alike sounds like a heavier load: it would not have been noticed below "
        f"a loss of about {worn:.0f} %. {rested}"
    )


def most_striking(profiles: Sequence[ToothProfile]) -> str:
    """Name the most striking place of any gear."""
    best = min(profiles, key=lambda p: p.log10_probability, default=None)
    if best is None:
        return "No gear's turn could be resolved."
    return (
        f"The most striking place of a gear (the {best.gear} of stage {best.stage}) has "
        f"{best.ratio:.1f} times the energy elsewhere in its turn."
    )


def _noticed(evidence: Evidence, profiles: Sequence[ToothProfile]) -> str:
    """Say how much damage of one tooth would have been called a fault, or have left it open."""
    named = [(p.noticed_from, _gear(p.stage, p.gear)) for p in profiles]
    loss = max((loss for loss, _ in named if loss is not None), default=None)
    blind, told = [gear for loss, gear in named if loss is None], ""
    if loss is not None:
        heard = max(evidence.heard.values(), default=1.0)
        sooner = f", and have left the answer open from {100 * heard:.2g} %"
        told = (
            " Damage of one tooth would mostly have been called a fault from a loss of "
            f"{100 * loss:.2g} % of its pair's stiffness"
            f"{sooner if LIMITS.about * heard < loss else ''}."
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
            f"healthy recording ({min(speeds):.2f} to {max(speeds):.2f} Hz): {_RESONANCES}"
        )
    swings = [profile.speed_fluctuation for profile in reference.profiles]
    own_swing = signature.speed_fluctuation
    if min(abs(own_swing - known) for known in swings) > SPEED_UNIT:
        yield (
            f"the speed swung by +-{100 * own_swing:.2g} %, in the healthy recordings by "
            f"{100 * min(swings):.2g} to {100 * max(swings):.2g} %: {_RESONANCES}; record as they "
            "were, or add healthy recordings whose speed swings as far"
        )


def not_found(signature: MeasuredSignature) -> Iterator[str]:
    """Name the meshes that do not stand out."""
    for mesh in signature.meshes:
        if not mesh.found:
            yield f"mesh of stage {mesh.stage} not found: {mesh.reason}"


def taken_for_granted(evidence: Evidence) -> Iterator[str]:
    """Name what the estimate of a loss, or the loss said to be noticed, takes for granted."""
    finding = evidence.finding
    if finding is None:
        return
    search = finding.best.search
    if search is not None and search.response.from_teeth_alone:
        yield (
            "the machine file lacks gear data: the size of a loss rests on teeth of standard "
            "proportions"
        )
    for number, stage in enumerate(finding.machine.stages, start=1):
        # of a simulated set 30 % on a tooth near the sensor are a fault, 60 % far off read as 9 %
        if isinstance(stage, PlanetaryStage) and stage.fixed == "ring":
            yield (
                f"the ring of stage {number} stands still: what is said of its teeth is true near "
                "the sensor; one far from it has to lose several times as much to be heard"
            )
