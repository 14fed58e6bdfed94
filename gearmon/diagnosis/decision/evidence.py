"""What speaks against a healthy machine, test by test, and what follows from it.

Every test is brought to one scale, the *strength*: minus log10 of a probability that errs on the
side of the healthy machine. The strongest test decides. What a strength means on a healthy machine,
with as many references and as far from their states, is looked up in a table made from simulated
healthy machines (`thresholds`); a fault is called by strength, so that it must stand out of
whatever machine it is, simulated or not.

A clean bill of health is worth what could be heard. How loud the response to damage of one tooth is
at the sensor is known roughly: its lines are, up to the path, and the path is told by the mesh
harmonics of the same recording. Beside the noise about every line it tells how strong the evidence
of each loss would be (`heard_from`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.diagnosis.decision.thresholds import LIMITS, false_alarm_probability
from gearmon.diagnosis.hypotheses.changed_path import UNCHANGED, PathChange
from gearmon.diagnosis.hypotheses.runout import RunoutGrowth
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence, ToothFinding
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES, SearchedGear
from gearmon.diagnosis.law import LevelDeviation, MachineDeviation
from gearmon.diagnosis.law.state import FULL_LOAD
from gearmon.diagnosis.nongear import NonGearFinding
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine

# Quantile of the broadband spectrum's changes that tells whether any part of it fell: with added
# noise none falls by more than 0.6 dB in 67 simulated bearings, in 9 of 10 moved sensors by 2 dB.
_LOWEST = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """All that was compared with a reference.

    Parameters
    ----------
    deviation : MachineDeviation
        From the healthy law.
    finding : ToothFinding or None
        The tooth whose damage explains it best.
    path : PathChange
        How far the levels change band by band.
    runout : tuple of RunoutGrowth
        Growth of first and second sidebands.
    nongear : tuple of NonGearFinding
        Lines of no gear that changed.
    references : int, >= 1
        Healthy recordings.
    angle : float
        Standard deviation of the angle of shaft 1 [periods of the fastest mesh]; infinite where
        nothing is known of it.
    lost : bool
        Whether the lines do not stand still in it, all along.
    recurrence : float
        How surely the finding comes again with every turn, see `GearDeviation.recurrence`; infinite
        where nothing knocks.
    knocks : float, in [0, 1]
        Share of the recording that bears knocks from outside.
    """

    deviation: MachineDeviation
    finding: ToothFinding | None
    path: PathChange = UNCHANGED
    runout: tuple[RunoutGrowth, ...] = ()
    nongear: tuple[NonGearFinding, ...] = ()
    references: int
    angle: float = 0.0
    lost: bool = False
    recurrence: float = np.inf
    knocks: float = 0.0

    @cached_property
    def strengths(self) -> dict[str, float]:
        """Strength of every test, by its name."""
        deviation, offset = self.deviation, LIMITS.levels_offset
        levels = LIMITS.lines_weight * (deviation.levels.mean_square() - offset)
        levels += broadband_strength(deviation.broadband)
        path = LIMITS.bands_weight * (self.path.together - offset)
        # a shorter recording has shorter blocks, which part lines from their neighbours less
        told = {"levels": levels * deviation.length, "path": path * deviation.length}
        # at another speed lines have moved across the modes of the path, knocks are as loud as
        # they are, in a lost angle they are smeared: all of it may change levels by any amount
        astray = deviation.speed_off > 1.0 or self.knocks > LIMITS.knocks or self.lost
        if astray or self.load_unlearned:
            told = {name: min(value, LIMITS.levels_open) for name, value in told.items()}
        told |= {
            "runout": rare_strength([one.log10_probability for one in self.runout]),
            "lines of no gear": rare_strength([one.log10_probability for one in self.nongear]),
        }
        if self.finding is not None:
            told["tooth"] = tooth_strength(self.finding.evidence)
            if self.recurrence < LIMITS.recurs:
                told["tooth"] = min(0.0, told["tooth"])
        unsure = np.isfinite(self.angle) and self.angle > LIMITS.angle_unsure
        if unsure:
            # what a smeared angle does to lines; single sidebands are smeared most
            told |= {
                name: min(value, value * LIMITS.unsure_share)
                for name, value in told.items()
                if name != "lines of no gear"
            }
            told["runout"] = min(0.0, told["runout"])
        return told

    @property
    def load_unlearned(self) -> bool:
        """Whether levels may change with the load as they like, see `GearEvidence`."""
        return self.finding is not None and any(g.load_unlearned for g in self.finding.searched)

    @property
    def angle_lost(self) -> bool:
        """Whether lines and levels mean little: the angle is off throughout, not after a slip."""
        return self.lost or LIMITS.angle_unsure < self.angle < LIMITS.angle_slipped

    @property
    def knocked(self) -> bool:
        """Whether what stands out came in single turns, as knocks from outside do."""
        levels = max(self.strengths["levels"], self.strengths["path"])
        drowned = self.knocks > LIMITS.knocks and levels >= LIMITS.open
        return self.recurrence < LIMITS.recurs or drowned

    @property
    def heavier_db(self) -> float:
        """By how much the mesh is louder than any learned load explains [dB]; 0 if it does."""
        heavy = self.deviation.heavy
        return 20.0 / float(np.log(10.0)) * heavy if heavy > LIMITS.heaviest else 0.0

    @property
    def strength(self) -> float:
        """Strength of the strongest test."""
        return max(self.strengths.values())

    @property
    def probability(self) -> float:
        """Probability that a healthy machine shows as much, by the calibration."""
        return false_alarm_probability(self.strength, self.references, self.deviation.gap)


def tooth_strength(evidence: float) -> float:
    """Strength of a believed log Bayes factor of damage of one tooth."""
    return (evidence - LIMITS.tooth_offset) / LIMITS.tooth_scale


def broadband_strength(broadband: LevelDeviation | None) -> float:
    """Share of the broadband spectrum in the strength of changed levels; 0 without one."""
    if broadband is None:
        return 0.0
    return LIMITS.broadband_weight * (broadband.mean_square() - LIMITS.levels_offset)


def score_of(strength: float) -> float:
    """Score of a strength of evidence: log10(1 + 10^s), the strength itself where it is large."""
    return float(np.logaddexp(0.0, strength * np.log(10.0)) / np.log(10.0))


def rare_strength(log10_probabilities: Sequence[float]) -> float:
    """Strength of the least probable of some findings that are asked for beside the others."""
    least = min(log10_probabilities, default=0.0)
    return -least - LIMITS.rare_share


@dataclass(frozen=True, kw_only=True)
class Decision:
    """The verdict and what it rests on.

    Parameters
    ----------
    verdict : {"healthy", "fault", "cannot tell"}
        The answer.
    unheard : tuple of str
        Gears of which gross damage might not have been noticed, in words.
    """

    verdict: str
    unheard: tuple[str, ...] = ()


def decide(evidence: Evidence, unheard: Sequence[str] = ()) -> Decision:
    """Judge the evidence.

    Parameters
    ----------
    evidence : Evidence
        Against the healthy machine.
    unheard : sequence of str
        Gears that this recording, with this reference, could not have told of.
    """
    if evidence.strength >= LIMITS.fault:
        return Decision(verdict="fault", unheard=tuple(unheard))
    open_ = evidence.strength >= LIMITS.open or evidence.probability < LIMITS.rare
    if open_ or unheard or evidence.angle_lost or evidence.heavier_db or evidence.knocked:
        return Decision(verdict="cannot tell", unheard=tuple(unheard))
    return Decision(verdict="healthy")


def noise_rose(deviation: MachineDeviation) -> bool:
    """Whether the spectrum between the lines rose, and by more than the lines did.

    A bearing, a loose part or a neighbour fills the spectrum between the lines of the gears; a
    sensor that was moved raises and lowers both alike, and noise that is added lowers no part of
    the spectrum.
    """
    broadband, lines_db = deviation.broadband, deviation.levels.gain_db
    if broadband is None or broadband_strength(broadband) < LIMITS.noise_strength:
        return False
    changed_db = broadband.rest_db + broadband.gain_db[:, None]
    fell_db = np.nanquantile(changed_db, _LOWEST, axis=1) - np.minimum(lines_db, 0.0)
    if np.any(fell_db < -LIMITS.noise_rise_db):
        return False
    return bool(np.median(broadband.gain_db - lines_db) > LIMITS.noise_rise_db)


# The factor is a mean over all losses held possible, of which a quarter or so explain a departure.
_LOSSES_IN_FIVE = 5.0
# Directions that hold the energy of an event in a band, its place in the contact and the ringing of
# the path being unknown: (sum of the eigenvalues)^2 over the sum of their squares is 2.1 to 2.8 for
# gears of 17 to 96 teeth and the two shorter decay times of `tooth_match`.
_DIRECTIONS = 2.4


def heard_from(gear: GearEvidence) -> float | None:
    """Find the loss of one tooth from which it would be heard beside the noise.

    Parameters
    ----------
    gear : GearEvidence
        The gear.

    Returns
    -------
    float or None
        Loss of the pair's stiffness; None if even the largest of `LOSSES` might not be, or nothing
        is known of how loud it would be.

    Notes
    -----
    In a band where an event has the energy E over the noise, in m directions unknown beforehand,
    its log likelihood ratio is E - m log(1 + E/m) in the mean. One tooth has to overcome that all
    teeth and losses share the prior probability. Half of the losses of this size are heard: the
    path about the lines of the response is known to a factor of about 1.6 only. Of teeth loaded too
    little to touch as they should the loss must be larger in proportion: a simulated rig at 18 and
    44 N/mm did not show 30 % of one tooth in 9 of 12 analyses, where 20 % would be stated; three
    times the load showed it. Such teeth depart by themselves as damage does, and of those that are
    loaded less than `FULL_LOAD` only what would be called a fault counts as heard: of 24 cracks of
    30 % of a simulated drive at 102 N/mm four passed for healthy without it, none does. Of a mesh
    that is not heard by itself nothing is.
    """
    if gear.search is None or not gear.shown:
        return None
    if gear.deviation.load < FULL_LOAD:
        return noticed_from(gear)
    return _first(gear, _log_ratio(gear.search) - _prior(gear), LIMITS.open)


def noticed_from(gear: GearEvidence) -> float | None:
    """Find the loss of one tooth from which it would have been called a fault.

    The same as `heard_from`, but beside all that this machine departs by from one healthy recording
    to the next, and with what is believed of it.
    """
    deviation, search = gear.deviation, gear.search
    if search is None:
        return None
    expected = search.match.expected - _prior(gear)
    lines = sum(band.rest.size for band in deviation.bands)
    beside = 2.0 * lines * deviation.meetings / deviation.teeth
    peak = 1.0 + np.maximum(search.match.stands_out - _prior(gear), 0.0) / max(1.0, beside)
    believed = [gear.believes(*each) for each in zip(expected.tolist(), peak.tolist(), strict=True)]
    return _first(gear, np.array(believed), LIMITS.fault)


def unheard(
    evidence: Evidence, machine: Machine, silent: Sequence[str], must_notice: float
) -> tuple[str, ...]:
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
    """
    searched = evidence.finding.searched if evidence.finding is not None else ()
    loss = {gear.key: heard_from(gear) for gear in searched}
    gears = dict.fromkeys(
        (mesh.stage, wheel.gear) for mesh in kinematics(machine).meshes for wheel in mesh.wheels
    )
    deaf = [gear for gear in gears if (loss.get(gear) or 1.0) > LIMITS.about * must_notice]
    return (
        *(f"the {gear} of stage {stage}" for stage, gear in deaf),
        *(f"what channel {name} hears" for name in silent),
    )


def _prior(gear: GearEvidence) -> float:
    return float(np.log(gear.deviation.teeth * _LOSSES_IN_FIVE))


def _first(gear: GearEvidence, evidence: FloatArray, strength: float) -> float | None:
    """Loss at which evidence, rising with it, reaches a strength."""
    told = np.maximum.accumulate([tooth_strength(value) for value in evidence.tolist()])
    if told[-1] < strength:
        return None
    loss = float(np.exp(np.interp(strength, told, np.log(LOSSES)))) / gear.loaded
    return loss if loss <= LOSSES[-1] else None


def _log_ratio(search: SearchedGear) -> FloatArray:
    """Mean log likelihood ratio of damage, for each of `LOSSES`."""
    size = search.response.amplitude(LOSSES)
    total = np.zeros(len(LOSSES))
    for band in search.difference.bands:
        power = search.expected_power(band.number.astype(np.float64))
        energy = np.sum(power / band.noise**2, axis=1)[:, None] * size**2
        total += np.sum(energy - _DIRECTIONS * np.log1p(energy / _DIRECTIONS), axis=0)
    return total
