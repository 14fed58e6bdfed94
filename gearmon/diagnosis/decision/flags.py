"""Flags from what was found: of a tooth, of a kind, of a path, of lines of no gear."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from gearmon.diagnosis.decision.evidence import Evidence, noise_rose, rare_strength
from gearmon.diagnosis.decision.thresholds import LIMITS, false_alarm_probability
from gearmon.diagnosis.fault_types.features import NONE, FeatureVector
from gearmon.diagnosis.fault_types.judgement import KindJudgement, judge_kind
from gearmon.diagnosis.hypotheses.several_teeth import DepartureSpread, departure_spread
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence, ToothFinding
from gearmon.diagnosis.law import LevelDeviation
from gearmon.diagnosis.results import Change, Flag
from gearmon.errors import GearmonError
from gearmon.machine import Machine
from gearmon.signatures.measured.line_plan import Family

# A kind is named if the rules hold it this likely.
_NAMED = 0.5
# A departure is called one tooth's from this probability on; from the second where the sidebands
# once or twice a turn away grew by so much more [dB] than those four to six turns away, which one
# tooth hardly ever does.
_ONE_TOOTH, _ONE_TOOTH_AND_RUNOUT, _RUNOUT_DB = 0.5, 0.99, 12.0
# Where no kind is clear, a departure far from the mesh harmonics is called by its place.
_UNCLEAR = "changed residual"
_SENTENCES = 4
# Lead (logarithm of a factor) below which another gear may be the cause as well: of 75 findings on
# one of two gears of a shaft (17 machines of two simulators, 10 to 30 %) the right one was blamed
# in 28 of 41 below it, in 32 of 34 beyond.
_SURE_LEAD = 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Flagging:
    """All that flags are made from.

    Parameters
    ----------
    evidence : Evidence
        What was compared.
    machine : Machine
        The machine.
    changes : tuple of Change
        Families of lines.
    features : FeatureVector or None
        What kinds of fault are told by.
    """

    evidence: Evidence
    machine: Machine
    changes: tuple[Change, ...]
    features: FeatureVector | None

    def flags(self) -> tuple[Flag, ...]:
        """Flag what stands out, the strongest first."""
        strengths = self.evidence.strengths
        found: list[Flag] = []
        finding = self.evidence.finding
        # another path changes the pattern of every gear: the louder of the two is the cause
        least = max(LIMITS.open, self._changed if self.evidence.path.likely else 0.0)
        if finding is not None and strengths["tooth"] >= least:
            found.append(self._of_finding(finding, strengths["tooth"]))
        found += self._runout({(flag.stage, flag.gear) for flag in found})
        nongear = self._nongear()
        if self._changed >= LIMITS.fault and not any(flag.tooth for flag in found):
            found += self._levels(bool(nongear))
        return (*found, *nongear)

    @property
    def _changed(self) -> float:
        """Strength of the changed levels, one by one or band by band."""
        strengths = self.evidence.strengths
        return max(strengths["levels"], strengths["path"])

    def _flag(
        self,
        kind: str,
        strength: float,
        told: Iterable[str],
        stage: int | None = None,
        gear: str | None = None,
        **more: Any,
    ) -> Flag:
        """Return a flag of a kind, with the probability of its strength on a healthy machine."""
        whole = self.evidence
        chance = false_alarm_probability(strength, whole.references, whole.deviation.gap)
        place: dict[str, Any] = {"stage": stage, "gear": gear or None} | more
        return Flag(kind=kind, false_alarm_probability=chance, evidence=tuple(told), **place)

    def _of_finding(self, finding: ToothFinding, strength: float) -> Flag:
        """Flag the departure that the search found: of one tooth, or of another kind."""
        best, loss = finding.best, finding.loss
        spread = departure_spread(best.search) if best.search is not None else None
        around = best.deviation.peak < LIMITS.all_around * best.deviation.misfit
        if spread is not None:
            # an event that rings on around a small pinion is still one tooth's
            around = around and spread.explained < LIMITS.one_event
            around = around or spread.one_tooth < self._least_sure(best)
        if around:
            return self._spread_flag(finding, spread, strength)
        stage, gear = best.key
        evidence = [
            f"the {gear} of stage {stage} departs from its healthy pattern at tooth "
            f"{finding.tooth}: {best.deviation.peak:.1f} times the energy elsewhere in its turn"
        ]
        sizes = {}
        if loss is not None:
            sizes = {"": loss.loss, "_low": loss.low, "_high": loss.high}
            evidence.append(
                f"as a loss of {100 * loss.loss:.0f} % ({100 * loss.low:.0f} to "
                f"{100 * loss.high:.0f} %) of the stiffness of that tooth's pair would make it"
            )
        evidence += [_counting(finding), *_alike(finding)]
        if spread is not None:
            evidence.append(_explained(spread))
        evidence += [
            f"the {name} of stage {number} shows it too"
            + (" and may be the cause as well" if lead < _SURE_LEAD else "")
            for name, number, lead in finding.rivals
        ]
        evidence += _size(self.machine, finding)
        more = {f"stiffness_loss{end}": size for end, size in sizes.items()}
        return self._flag(
            "tooth damage", strength, evidence, stage, gear, tooth=finding.tooth, **more
        )

    def _least_sure(self, best: GearEvidence) -> float:
        """Probability from which a departure is called that of one tooth."""
        features = self.features
        if features is None or best.key not in features.gears:
            return _ONE_TOOTH
        row = features.named(features.gears.index(best.key))
        first, others = max(row["once_db"], row["twice_db"]), max(row["several_db"], 0.0)
        return _ONE_TOOTH_AND_RUNOUT if first - others > _RUNOUT_DB else _ONE_TOOTH

    def _spread_flag(
        self, finding: ToothFinding, spread: DepartureSpread | None, strength: float
    ) -> Flag:
        """Flag a departure that one tooth does not explain, by its kind where one is clear."""
        stage, gear = finding.best.key
        evidence = [f"the {gear} of stage {stage} departs from its healthy pattern around its turn"]
        if spread is not None:
            evidence += [_explained(spread), *_second_told(spread)]
        judged = self._judged_departure(finding)
        if judged is None:
            return self._flag(_UNCLEAR, strength, evidence, stage, gear)
        told = (*evidence, *_told(judged))
        return self._flag(judged.kind, strength, told, judged.stage or stage, judged.gear)

    def _judged_departure(self, finding: ToothFinding) -> KindJudgement | None:
        """Judge the kind of a departure that one tooth does not explain; None if none is clear."""
        best, focus = finding.best, self._focus
        focused = finding.of(*focus) if focus is not None else None
        order = best.deviation.order
        if focused is None or abs(focused.deviation.order - order) > 1e-9 * order:
            focus = best.key
        return self._clear(focus)

    @property
    def _focus(self) -> tuple[int, str] | None:
        """The gear that changed most."""
        features = self.features
        return features.gears[features.focus] if features is not None else None

    def _clear(self, gear: tuple[int, str] | None) -> KindJudgement | None:
        """Judge the kind of a fault of one gear; None where no kind but one tooth is clear."""
        features, finding = self.features, self.evidence.finding
        if features is None or gear is None or gear not in features.gears:
            return None
        own = finding.of(*gear) if finding is not None else None
        searched = own.search if own is not None else None
        spread = departure_spread(searched) if searched is not None else None
        judged = judge_kind(features, stage=gear[0], gear=gear[1], spread=spread)
        clear = judged.kind not in (NONE, "tooth damage") and judged.probability >= _NAMED
        return judged if clear else None

    def _runout(self, flagged: set[tuple[int | None, str | None]]) -> list[Flag]:
        """Flag gears whose first or second sidebands have grown beyond the farther ones."""
        strengths = self.evidence.strengths
        if strengths["runout"] < LIMITS.fault:
            return []
        # none of 51 simulated gears that run out changes the noise or whole bands; bearings and
        # sensors that were moved do, and move single sidebands with them
        elsewhere = noise_rose(self.evidence.deviation) or self.evidence.path.likely
        if self._changed >= LIMITS.fault and elsewhere:
            return []
        found = []
        for growth in self.evidence.runout:
            strength = rare_strength([growth.log10_probability])
            gear = growth.stage, growth.gear
            if strength < LIMITS.fault or gear in flagged:
                continue
            judged = self._clear(gear)
            kind = growth.kind if judged is None else judged.kind
            evidence = [*growth.evidence, *(_told(judged) if judged is not None else ())]
            found.append(self._flag(kind, strength, evidence, *gear))
        return found

    def _nongear(self) -> list[Flag]:
        """Flag lines that belong to no gear, and blame none."""
        return [
            self._flag(finding.kind, strength, (finding.name, *finding.evidence))
            for finding in self.evidence.nongear
            if (strength := rare_strength([finding.log10_probability])) >= LIMITS.fault
        ]

    def _levels(self, nongear: bool) -> list[Flag]:
        """Flag changed levels: as noise, a path, a kind of a gear's fault, or as they are."""
        strongest, strength = sentences(self.changes), self._changed
        if noise_rose(self.evidence.deviation):
            if nongear:
                return []
            told = (
                "the spectrum between the lines of the gears rose, by more than those lines: a "
                "bearing, a loose part, or another machine",
                *strongest[:1],
            )
            return [self._flag("broadband rise", strength, told)]
        if self.evidence.path.likely:
            common = 100 * self.evidence.path.common
            told = (
                f"all lines about one mesh harmonic moved together: {common:.0f} % "
                "of the change is common to them, and none of it to one gear: a sensor that was "
                "moved or fixed anew, or a gearbox that was opened",
                *strongest,
            )
            return [self._flag("path changed", strength, told)]
        first = max(self.changes, key=lambda c: abs(c.standardised), default=None)
        if first is None:
            return [self._flag("broadband change", strength, ("no line moved with it",))]
        group = attrgetter("kind", "stage", "gear")
        own = sentences([change for change in self.changes if group(change) == group(first)])
        # the kind of fault that they are most like
        judged = self._clear(self._focus)
        if judged is None:
            return [self._flag(f"changed {first.kind}", strength, own, first.stage, first.gear)]
        told = (*_told(judged), *own)
        return [self._flag(judged.kind, strength, told, judged.stage, judged.gear)]


def _counting(finding: ToothFinding) -> str:
    if finding.counted_from == "tacho":
        return (
            "teeth are counted from the one that enters mesh at the tachometer pulse, in this "
            "recording as in the healthy ones"
        )
    return (
        "teeth are counted from where the first healthy recording begins: the same number is "
        "the same tooth in every recording compared with this reference"
    )


def _alike(finding: ToothFinding) -> list[str]:
    """Tell which teeth of a planetary set sound alike."""
    best = finding.best
    count, teeth = best.deviation.meetings, best.deviation.teeth
    if count > 1 and best.deviation.gear == "planet":
        return ["which of the planets it is of cannot be told"]
    others = sorted(
        {round(finding.tooth - 1 + k * teeth / count) % teeth + 1 for k in range(count)}
    )
    if len(others) < 2:
        return []
    named = ", ".join(str(tooth) for tooth in others)
    return [f"teeth {named} meet a planet at the same moments: it may be any of them"]


def _explained(spread: DepartureSpread) -> str:
    return f"one tooth explains {100 * spread.explained:.0f} % of the departure"


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


def _told(judged: KindJudgement) -> tuple[str, ...]:
    return (
        f"most like {judged.kind} ({judged.probability:.0%} by physical rules, not calibrated)",
        *judged.evidence,
    )


def _size(machine: Machine, finding: ToothFinding) -> list[str]:
    """Tell the size of the damage where the geometry of the gears is known."""
    # sound machines need no model of teeth
    from gearmon.diagnosis.hypotheses.damage_size import physical_size

    loss = finding.loss
    if loss is None:
        return []
    stage, gear = finding.best.key
    try:
        size = physical_size(machine, stage, gear, "tooth damage", loss.loss, loss.low, loss.high)
    except GearmonError:
        return []  # these teeth cannot be cut as the file says; the loss stands without it
    if size is None:
        return []
    bounds = [f"{v:.2g}" if v is not None else "?" for v in (size.low, size.high)]
    return [
        f"as a {size.quantity} that would be {size.size:.2g} {size.unit} "
        f"({bounds[0]} to {bounds[1]} {size.unit})"
    ]


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
