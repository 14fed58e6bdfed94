"""The limits of the verdict, with the experiments that set them, and what a strength means.

The table `calibration.json` was made by `.ci/calibration` from healthy pairs of
machines drawn at random, of which the detector knows the file only; it says how many. It tells the
share of healthy machines that show as much. Beyond its last entry the probability falls by a decade
for each unit of strength, which is what strength means where the tests' own laws hold.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np


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
        Most that levels count where the speed is off that of every reference by more than
        `law.state.SPEED_UNIT`, or knocks drown them: they leave the answer open. A simulated path
        of 14 modes with quality factors of 15 to 60 changes single lines by 19 dB at a speed 5 %
        off.
    rare_share : float
        Strength taken off tests of rare kinds: a twentieth of the false alarms is theirs.
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
        twenty times the rest: 2.4 at most; 15 % on a tooth, in 2 s with 3 blocks too: 16 and more,
        7 to 15 % on a planet, beside its lines: 5 and more.
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
    rare_share: float = 1.3
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
    text = resources.files("gearmon.diagnosis.decision").joinpath("calibration.json").read_text()
    table: dict[str, Any] = json.loads(text)
    return table
