"""What damage a recording could have told of, had there been any.

A clean bill of health is worth what could be heard. How loud the response to damage of one tooth is
at the sensor is known roughly: its lines are, up to the path, and the path is told by the mesh
harmonics of the same recording. Beside the noise about every line it tells how strong the evidence
of each loss would be.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.decision.evidence import tooth_strength
from gearmon.diagnosis.decision.thresholds import LIMITS
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES
from gearmon.diagnosis.hypotheses.tooth_search import SearchedGear

FloatArray = NDArray[np.float64]

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
    times the load showed it. Below half of that load such teeth depart by themselves as damage
    does, and only what would be called a fault counts as heard; nor does more beside a single
    reference where lines may not follow the load. Of a mesh that is not heard by itself nothing is.
    """
    if gear.search is None or not gear.shown:
        return None
    if gear.loaded < LIMITS.lightly_loaded or gear.load_unlearned:
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
