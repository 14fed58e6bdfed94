"""What speaks against a healthy machine, test by test, and what follows from it.

Every test is brought to one scale, the *strength*: minus log10 of a probability that errs on the
side of the healthy machine. The strongest test decides. Short of a fault a healthy machine reaches
more by its levels than by one of its teeth: score and probability are read from strengths that are
made comparable first. What such a strength means on a healthy machine, with as many references and
as far from their states, is looked up in a table made from simulated healthy machines; a fault is
called by strength, so that it must stand out of whatever machine it is, simulated or not. The table
`calibration.json` was made by `.ci/calibration` from healthy pairs of machines drawn at random, of
which the detector knows the file only; it says how many.

A clean bill of health is worth what could be heard. How loud the response to damage of one tooth is
at the sensor is known roughly: its lines are, up to the path, and the path is told by the mesh
harmonics of the same recording. Beside the noise about every line it tells how strong the evidence
of each loss would be (`heard_from`).

Whether the path changed, rather than the gears, is told by the levels: a sensor that was moved, or
a housing that was opened, colours every line anew: all that stands about one mesh harmonic, the
harmonic itself and the sidebands of either gear, rises or falls together in each channel,
differently from harmonic to harmonic and from channel to channel. A gear at fault moves its own
sidebands, or the mesh, against the rest of the band, and does so in all channels.

>>> from gearmon.diagnosis.evidence import LIMITS
>>> LIMITS.must_notice
0.4
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence, ToothFinding
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES, path_power
from gearmon.diagnosis.hypotheses.turns import RunoutGrowth
from gearmon.diagnosis.law.gear_lines import FULL_LOAD
from gearmon.diagnosis.law.machine import LevelDeviation, MachineDeviation
from gearmon.diagnosis.nongear import NonGearFinding
from gearmon.signatures.measured.line_plan import Family


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of the verdict.

    The experiments: 2,000 healthy pairs of 27 drawn machines (`benchmark.detection_machines`,
    loads 50 to 115 %, speeds +-2 %, gains up to a factor of 2, one to five references) and of the
    catalogue's machines; damage of one tooth of 2.5 to 40 % on the same. On those machines alone
    the limits could be lower by half: they leave as much room for machines that depart more from
    one recording to the next than any simulation does.

    Parameters
    ----------
    fault : float
        Strength from which a fault is called: one false alarm in a hundred on a machine that is as
        unsteady as the scales below assume.
    open : float
        Strength from which the answer stays open.
    rare : float
        Calibrated probability below which it stays open.
    tooth_offset, tooth_scale : float
        Believed log Bayes factor of strength 0, and for one more unit. Of the healthy pairs 99 %
        stay below 11; losses of 5 % of a pair's stiffness have 30 and more in nine of ten.
    levels_offset : float
        Mean square of standardised levels of strength 0: what half of the healthy pairs reach.
    bands_weight : float
        Strength for one unit of mean square of the changes of whole bands: those of a sensor that
        was moved have 5 and more in nineteen of twenty, 290 healthy pairs 2.8 at most; of
        1,728 others one is called a fault by this alone.
    lines_weight, broadband_weight : float
        Strength for one unit of mean square of the families of lines, and of the broadband levels,
        which move more easily: with a bearing, a fan, a neighbouring machine.
    heaviest : float
        Load [Np] beyond that of every reference from which the answer stays open: twice as heavy,
        and how well that is heard. Teeth that yield more, by wear of all of them, raise mesh
        harmonics and their sidebands as such a load does: of 28 simulated gears at 40 % of their
        stiffness 26 are as loud.
    levels_open : float
        Most that levels count where the speed, or its swing, is off that of every reference by
        more than `law.machine.SPEED_UNIT`, or knocks drown them: they leave the answer open. A
        simulated path of 14 modes with quality factors of 15 to 60 changes single lines by 19 dB at
        a speed 5 % off.
    short : float
        How much more the other tests than that of a tooth count by what they are short of a fault,
        for score and probability. Of 4,589 healthy pairs of 80 drawn machines 98 % stay below 0.91
        (levels), 0.51 (path), 0.96 (lines of no gear), and -0.18 (one tooth). Of 36 others, one
        reference, the area under the ROC curve for losses of 5, 10 and 20 % is 0.815, 0.963 and
        0.976 with 1, 0.934, 0.990 and 0.999 with 1.6, 0.941, 0.992 and 0.999 with 2; with 2 half
        of the healthy pairs of a real rig would have a probability below 0.05, a third with 1.6.
    rare_share : float
        Strength taken off tests of rare kinds: a twentieth of the false alarms is theirs.
    shaft_power : float
        Exponent of the law of how much more the gears of one shaft depart all around their turn
        than any of another: a healthy machine exceeds c with a probability of c^-power. Of 851
        healthy pairs of 16 drawn machines 95 % stay below 1.4 and all below 2.4, 84 of 14 machines
        of the catalogue below 2.7 and 70 of a real rig below 1.7; of 210 of single channels of the
        rig, which move most, the largest is 3.24, which alone asks for a power of 4.5.
    noise_strength, noise_rise_db : float
        Share of the broadband spectrum in the strength of the levels, and rise of the spectrum
        between the lines over that of the lines [dB], from which a change is one of the noise.
    all_around, one_event : float
        Energy at the most striking place of a gear's turn, over the misfit of its median tooth,
        below which a departure is that of the whole turn, unless one tooth explains this share of
        it: single teeth of up to 40 % loss have 0.8 and more, or 0.9 explained where a pinion of 17
        teeth rings around; one of fourteen cases of distributed pitting passes for one tooth.
    angle_unsure, angle_slipped, unsure_share : float
        Standard deviation of the angle [mesh periods] from which it is unsure, and the share of the
        strength of lines and levels that then counts: of 700 simulated recordings none lies between
        0.02, where lines hold the angle, and 0.1, where they turn in it. Beyond the second it is
        the angle after a slip that is unsure, by whole mesh periods; the parts before and after
        still tell.
    recurs : float
        Energy at a tooth over what the scatter of its blocks leaves there, below which it does not
        come again with every turn. Recordings of four drawn machines with 1 to 20 knocks of up to
        twenty times the rest: 2.4 at most; 15 % on a tooth, in 2 s with 3 blocks too: 16 and more.
        On a planet, lines at its turn included, 15 % leave 2.8 to 3.4 in four blocks and 30 % 8 and
        more (three machines). Of nine lumped machines whose speed changes by a factor of 1.8 a
        crack of 30 % is in 5.6 to 27 blocks of 8 to 30, what 5 and 20 knocks leave in 3.6 at most,
        of 40 in 5.
    knocks : float
        Share of the blocks with knocks from which levels call no fault.
    knock_scatter : float
        Scatter of the blocks at a tooth, over that at the median tooth, from which it is asked
        whether an event there recurs: 6 to 70 where few knocks are, 0.9 to 1.5 at 15 to 50 % loss.
    must_notice : float
        Loss of a pair's stiffness that a healthy verdict has to exclude on every gear.
    about : float
        What counts as that loss: what would be noticed is known to a factor of 1.6 only.
    """

    fault: float = 2.0
    open: float = 1.0
    rare: float = 0.01
    tooth_offset: float = 2.0
    tooth_scale: float = 12.0
    levels_offset: float = 0.3
    bands_weight: float = 0.35
    lines_weight: float = 0.65
    broadband_weight: float = 0.35
    heaviest: float = 0.75
    levels_open: float = 1.9
    short: float = 1.6
    rare_share: float = 1.3
    shaft_power: float = 4.0
    noise_strength: float = 0.9
    noise_rise_db: float = 1.5
    all_around: float = 0.3
    one_event: float = 0.85
    angle_unsure: float = 0.1
    angle_slipped: float = 0.5
    unsure_share: float = 0.5
    recurs: float = 4.0
    knocks: float = 0.2
    knock_scatter: float = 3.0
    must_notice: float = 0.4
    about: float = 1.1


LIMITS = Limits()


#: Distance of states [nepers of load] from which a recording counts as far from its references.
FAR = 0.25
_DECADE = 1.0
# Least logarithm of a probability: it stays a number above 0, whatever the strength.
_LEAST = -300.0


def situation(references: int, gap: float) -> str:
    """Name the situation of a comparison: how many references, and how near the nearest is."""
    count = "one" if references == 1 else "several"
    return f"{count}, {'far' if gap > FAR else 'near'}"


def false_alarm_probability(strength: float, references: int, gap: float) -> float:
    """Share of healthy machines that show evidence of this strength.

    Parameters
    ----------
    strength : float
        Of the strongest test.
    references : int, >= 1
        Healthy recordings learned.
    gap : float, >= 0
        Distance of the recording's operating state to the nearest reference's [Np].

    Returns
    -------
    float, in (0, 1]

    Examples
    --------
    >>> low, high = (false_alarm_probability(s, 3, 0.0) for s in (0.0, 4.0))
    >>> low > 0.05 > 0.001 > high
    True
    """
    known = _table()["situations"][situation(references, gap)]
    return probability_of(strength, known["strength"], known["share"])


def probability_of(strength: float, known: Sequence[float], shares: Sequence[float]) -> float:
    """Interpolate log10 of the share that exceeds a strength."""
    logs = np.log10(np.asarray(shares, dtype=np.float64))
    if strength <= known[0]:
        # weaker than what nine of ten show: between there and certainty
        return float(shares[0] + (1.0 - shares[0]) * min(1.0, known[0] - strength))
    if strength >= known[-1]:
        beyond = logs[-1] - (strength - known[-1]) / _DECADE
        return float(10.0 ** max(beyond, _LEAST))
    return float(10.0 ** np.interp(strength, known, logs))


@lru_cache(maxsize=1)
def _table() -> dict[str, Any]:
    text = resources.files("gearmon.diagnosis").joinpath("calibration.json").read_text()
    table: dict[str, Any] = json.loads(text)
    return table


# Share of the change that has to be common to the bands where there is one channel: 39 of 42
# simulated sensors that were moved, 28 of them to another place altogether, exceed it, none of 26
# misaligned or pitted gears does (largest 0.22). Several tell more, by what they differ in: that is
# weighed as so much in common, and both have to exceed the second. Of 108 comparisons of sensors of
# 18 drawn machines that were moved all do (least 0.54), of 111 of worn, pitted and misaligned gears
# and damaged teeth in which whole bands change as strongly as a fault asks none (most 0.44).
_ALONE, _COMMON, _WORTH = 0.25, 0.5, 4.0
# Share by which channels differ, and strength of the change, from which no load makes it: simulated
# drives at a tenth to the whole of their load, beside one reference at another, have 0.00 where
# their bands change by up to 7.5, and 0.06 once, with 2.3.
_APART, _NO_LOAD = 0.04, 4.0


class PathChange(NamedTuple):
    """How far levels changed band by band.

    Parameters
    ----------
    common : float, in [0, 1]
        Share of the change that all families about one mesh harmonic have in common, what chance
        makes of it taken off.
    apart : float or None
        Share of the change by which mesh harmonics changed otherwise in one channel than in
        another, 0 to 1: what the gears do, all channels hear. None for one channel.
    together : float
        Mean square of the changes of whole bands: 1 where the families of each change alone, of
        the healthy variance.
    bands : int
        Mesh harmonics and channels looked at.
    """

    common: float
    apart: float | None
    together: float
    bands: int

    @property
    def likely(self) -> bool:
        """Whether a changed path explains most of it."""
        told = self.common > _ALONE
        if self.apart is not None:
            told = self.common + _WORTH * self.apart > _COMMON
        return self.bands >= 4 and told


#: Nothing was compared.
UNCHANGED = PathChange(common=0.0, apart=None, together=0.0, bands=0)


def path_change(levels: LevelDeviation, families: Sequence[Family]) -> PathChange:
    """Tell how much of changed levels is common to the bands about the mesh harmonics.

    Parameters
    ----------
    levels : LevelDeviation
        Of those families.
    families : sequence of Family
        One for each column.
    """
    places = [(family.stage, family.harmonic) for family in families]
    bands, band = np.unique(places, axis=0, return_inverse=True)
    of_band = np.eye(len(bands))[band]
    known = np.isfinite(levels.standardised)
    changes = np.where(known, levels.standardised, 0.0)
    count, total, squares = (own @ of_band for own in (known, changes, changes**2))
    several = count > 1
    count, whole, squares = count[several], total[several] ** 2 / count[several], squares[several]
    spread = squares - whole
    # by how much mesh harmonics differ between channels, beyond chance
    apart, mesh = None, levels.standardised[:, [family.kind == "mesh" for family in families]]
    if len(mesh) > 1:
        mesh = mesh[:, np.isfinite(mesh).all(axis=0)]
        differ = np.sum((mesh - mesh.mean(axis=0)) ** 2) - (len(mesh) - 1) * mesh.shape[1]
        apart = float(max(differ, 0.0) / max(np.sum(changes**2), np.finfo(float).tiny))
    # of unrelated changes the mean of `count` has a variance of one part in `count`
    between = np.sum(np.maximum(whole - spread / (count - 1), 0.0))
    within = np.sum(spread * count / (count - 1))
    common = float(between / max(between + within, np.finfo(float).tiny))
    return PathChange(common, apart, float(np.sum(whole)) / max(len(count), 1), len(count))


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
    def one_shaft(self) -> tuple[tuple[int, str], float]:
        """Gear that departs most all around its turn, and how much more than any other shaft's.

        A path, a load, a speed or an angle that is off changes the lines of all gears; damage of
        many teeth those that repeat with their shaft. 1 in planetary sets, whose members share
        their lines, and where no other shaft's gear could tell.
        """
        gears = [gear for gear in self.deviation.gears if gear.meetings == 1]
        if not gears:
            return (1, ""), 1.0
        most = max(gears, key=lambda gear: gear.misfit)
        shaft = 1e-9 * most.order
        others = [most.beyond(own) for own in gears if abs(own.order - most.order) > shaft]
        told = [beyond for beyond in others if beyond != 1.0]
        return (most.stage, most.gear), max(1.0, min(told, default=1.0))

    @property
    def searched(self) -> tuple[GearEvidence, ...]:
        """All gears that were searched for damage."""
        return self.finding.searched if self.finding is not None else ()

    @cached_property
    def heard(self) -> dict[tuple[int, str], float]:
        """Loss of a tooth of each gear from which it would be heard; 1 where none might be."""
        return {gear.key: heard_from(gear) or 1.0 for gear in self.searched}

    @cached_property
    def strengths(self) -> dict[str, float]:
        """Strength of every test, by its name."""
        deviation = self.deviation
        levels = lines_strength(deviation.levels) + broadband_strength(deviation.broadband)
        # a shorter recording has shorter blocks, which part lines from their neighbours less
        path = LIMITS.bands_weight * (self.path.together - LIMITS.levels_offset) * deviation.length
        around = rare_strength([-LIMITS.shaft_power * float(np.log10(self.one_shaft[1]))])
        told = {"levels": levels * deviation.length, "path": path, "one shaft": around}
        # at another speed lines have moved across the modes of the path, knocks are as loud as
        # they are, in a lost angle they are smeared: all of it may change levels by any amount
        astray = deviation.speed_off > 1.0 or self.knocks > LIMITS.knocks or self.lost
        capped = {name: min(value, LIMITS.levels_open) for name, value in told.items()}
        # nor do levels tell where they may change with the load as they like
        if astray or any(gear.load_unlearned for gear in self.searched):
            apart = self.path.apart or 0.0
            sure = self.path.likely and apart > _APART and path >= _NO_LOAD
            told = capped | ({"path": path} if sure and not astray else {})
        # of a lost angle the smeared lines of the gears look like lines of none
        most = LIMITS.levels_open if self.lost else np.inf
        lines = rare_strength([one.log10_probability for one in self.nongear])
        told["runout"] = rare_strength([one.log10_probability for one in self.runout])
        told["lines of no gear"] = min(lines, most)
        if self.finding is not None:
            told["tooth"] = tooth_strength(self.finding.evidence)
            if self.recurrence < LIMITS.recurs:
                told["tooth"] = min(0.0, told["tooth"])
        if np.isfinite(self.angle) and self.angle > LIMITS.angle_unsure:
            # what a smeared angle does to lines; single sidebands are smeared most
            for name in told.keys() - {"lines of no gear"}:
                told[name] = min(told[name], told[name] * LIMITS.unsure_share)
            told["runout"] = min(0.0, told["runout"])
        return told

    @property
    def changed(self) -> float:
        """Strength of the changed levels, one by one or band by band."""
        return max(self.strengths["levels"], self.strengths["path"])

    @property
    def strength(self) -> float:
        """Strength of the strongest test."""
        return max(self.strengths.values())

    @property
    def score(self) -> float:
        """Score of all tests together."""
        return score_of(self.comparable)

    @property
    def comparable(self) -> float:
        """Strength of the strongest test where all are as strong as they are rare."""
        told = self.strengths.items()
        return max(value if name == "tooth" else comparable(value) for name, value in told)

    @property
    def probability(self) -> float:
        """Probability that a healthy machine shows as much, by the calibration."""
        return self.chance(self.comparable)

    def chance(self, strength: float) -> float:
        """Probability that a healthy machine shows evidence of a strength, by the calibration."""
        return false_alarm_probability(strength, self.references, self.deviation.gap)

    @property
    def noise_rose(self) -> bool:
        """Whether the spectrum between the lines rose, and by more than the lines did.

        A bearing, a loose part or a neighbour fills the spectrum between the lines of the gears; a
        sensor that was moved raises and lowers both alike, and noise that is added lowers no part
        of the spectrum.
        """
        broadband, lines_db = self.deviation.broadband, self.deviation.levels.gain_db
        if broadband is None or broadband_strength(broadband) < LIMITS.noise_strength:
            return False
        changed_db = broadband.rest_db + broadband.gain_db[:, None]
        fell_db = np.nanquantile(changed_db, _LOWEST, axis=1) - np.minimum(lines_db, 0.0)
        if np.any(fell_db < -LIMITS.noise_rise_db):
            return False
        return bool(np.median(broadband.gain_db - lines_db) > LIMITS.noise_rise_db)


def comparable(strength: float) -> float:
    """Strength of a test of levels, or of something rare, on the scale of that of a tooth.

    Examples
    --------
    >>> [round(comparable(strength), 6) for strength in (0.0, 1.0, 2.0, 5.0)]
    [-1.2, 0.4, 2.0, 5.0]
    """
    return strength - (LIMITS.short - 1.0) * max(0.0, LIMITS.fault - strength)


def tooth_strength(evidence: float) -> float:
    """Strength of a believed log Bayes factor of damage of one tooth."""
    return (evidence - LIMITS.tooth_offset) / LIMITS.tooth_scale


def lines_strength(levels: LevelDeviation) -> float:
    """Share of the families of lines in the strength of changed levels."""
    return LIMITS.lines_weight * (levels.mean_square() - LIMITS.levels_offset)


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


# The factor is a mean over all losses held possible, of which a quarter or so explain a departure.
_LOSSES_IN_FIVE = 5.0
# Share of the energy along what damage would add, over that at sound teeth, that is found there:
# 0.44 to 0.68 in the median of each of seven situations (198 comparisons, 10 to 30 % on 16 drawn
# machines, references at other speeds and loads too), 0.39 to 0.47 of 16 others.
_MATCHED = 0.5
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
    30 % of a simulated drive at 102 N/mm four passed for healthy without it, none does. So of a set
    whose sun may float: of 192 losses of 40 % of sixteen simulated sets with one 22 passed for
    healthy beside what is heard if it is held, 9 do. Of a mesh that is not heard by itself nothing
    is.
    """
    search = gear.search
    if search is None or not gear.shown:
        return None
    if gear.deviation.load < FULL_LOAD or gear.instead is not None:
        return noticed_from(gear)
    response, difference = search.response, search.difference
    ratio, size = np.full(len(LOSSES), -_prior(gear)), response.amplitude(LOSSES)
    # between the mesh harmonics that tell of it the path is interpolated in its logarithm
    path = path_power(difference.mesh_power, response.mesh, mean=True)
    told = np.flatnonzero(path.all(axis=0))
    for band in difference.bands:
        place = band.number / difference.teeth
        power = np.exp([np.interp(place, told, row) for row in np.log(path[:, told])])
        heard = np.sum(power * response.band_power(band.number, band.side) / band.noise**2, axis=1)
        energy = heard[:, None] * size**2
        ratio += np.sum(energy - _DIRECTIONS * np.log1p(energy / _DIRECTIONS), axis=0)
    return _first(gear, ratio, LIMITS.open)


def noticed_from(gear: GearEvidence) -> float | None:
    """Find the loss of one tooth from which it would have been called a fault.

    The same as `heard_from`, but beside all that this machine departs by from one healthy recording
    to the next, and with what is believed of it. Where a sun may float the larger of both losses.
    """
    deviation, prior, losses = gear.deviation, _prior(gear), []
    beside = max(1.0, 2.0 * deviation.lines * deviation.meetings / deviation.teeth)
    for search in filter(None, (gear.search, gear.instead)):
        peak = 1.0 + np.maximum(search.stands_out - prior, 0.0) / beside
        matched = 1.0 + _MATCHED * np.maximum(search.matched_peak - 1.0, 0.0)
        told = [search.expected - prior, peak, matched, search.directions]
        believed = [gear.believes(*each) for each in np.transpose(told).tolist()]
        losses.append(_first(gear, np.array(believed), LIMITS.fault))
    return max(filter(None, losses), default=None) if all(losses) else None


def _prior(gear: GearEvidence) -> float:
    return float(np.log(gear.deviation.teeth * _LOSSES_IN_FIVE))


def _first(gear: GearEvidence, evidence: FloatArray, strength: float) -> float | None:
    """Loss at which evidence, rising with it, reaches a strength."""
    told = np.maximum.accumulate([tooth_strength(value) for value in evidence.tolist()])
    if told[-1] < strength:
        return None
    loss = float(np.exp(np.interp(strength, told, np.log(LOSSES))))
    # teeth that are loaded less than the response supposes have to lose more
    loss /= min(1.0, gear.deviation.load)
    return loss if loss <= LOSSES[-1] else None
