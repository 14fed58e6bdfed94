"""What speaks against a healthy machine, test by test, and what follows from it.

Every test is brought to one scale, the *strength*: minus log10 of a probability that errs on the
side of the healthy machine. The strongest test decides. What a strength means on a healthy machine,
with as many references and as far from their states, is looked up in a table made from simulated
healthy machines (`calibration`); a fault is called by strength, so that it must stand out of
whatever machine it is, simulated or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.diagnosis.decision.calibration import false_alarm_probability
from gearmon.diagnosis.decision.thresholds import LIMITS
from gearmon.diagnosis.hypotheses.changed_path import UNCHANGED, PathChange
from gearmon.diagnosis.hypotheses.runout import RunoutGrowth
from gearmon.diagnosis.hypotheses.tooth_damage import ToothFinding
from gearmon.diagnosis.law import LevelDeviation, MachineDeviation
from gearmon.diagnosis.nongear import NonGearFinding

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
        deviation = self.deviation
        levels = levels_strength(deviation.levels, deviation.broadband)
        told = {
            # a shorter recording has shorter blocks, which part lines from their neighbours less
            "levels": levels * deviation.length,
            "path": path_strength(self.path) * deviation.length,
        }
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


def levels_strength(families: LevelDeviation, broadband: LevelDeviation | None) -> float:
    """Strength of changed levels: families of lines and the broadband spectrum together."""
    told = LIMITS.lines_weight * (families.mean_square() - LIMITS.levels_offset)
    if broadband is None:
        return told
    return told + broadband_strength(broadband)


def path_strength(path: PathChange) -> float:
    """Strength of levels that changed band by band."""
    return LIMITS.bands_weight * (path.together - LIMITS.levels_offset)


def broadband_strength(broadband: LevelDeviation) -> float:
    """Share of the broadband spectrum in that strength."""
    return LIMITS.broadband_weight * (broadband.mean_square() - LIMITS.levels_offset)


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
