"""What damage a recording could have told of, had there been any.

A clean bill of health is worth what the search behind it could see. The likelihood of damage says so
itself: at a tooth that has lost some stiffness the logarithm of its ratio to that of no damage is
known on average, from the noise about every line and from how loud the path makes the response.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.decision.evidence import tooth_evidence_needed
from gearmon.diagnosis.decision.thresholds import LIMITS
from gearmon.diagnosis.hypotheses.tooth_damage import STANDS_OUT, GearEvidence
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES, PATH_DEVIATION

FloatArray = NDArray[np.float64]

# The factor is a mean over all losses held possible, of which a quarter or so explain a departure.
_LOSSES_IN_FIVE = 5.0
# Share of a mesh's stiffness that one pair carries, about: with a contact ratio of 1.3 to 2.
_PAIR_SHARE = 0.65


def noticed_from(gear: GearEvidence, gears: int) -> float | None:
    """Find the loss from which damage of one tooth would have been called a fault.

    Parameters
    ----------
    gear : GearEvidence
        The gear.
    gears : int, >= 1
        Gears searched.

    Returns
    -------
    float or None
        Loss of the pair's stiffness; None if even the largest of `LOSSES` might not be.

    Notes
    -----
    One tooth has to overcome that all teeth, gears and losses share the prior probability, and to
    stand out of the misfit of its machine. The path about the lines of the response is taken as
    weaker than its mesh harmonics tell by one standard deviation.
    """
    deviation = gear.deviation
    expected = _expected(gear) - float(np.log(deviation.teeth * gears * _LOSSES_IN_FIVE))
    lines = sum(band.rest.size for band in deviation.bands)
    # a gamma variable of so many degrees: how far the tooth stands out of its turn
    peak = 1.0 + np.maximum(expected, 0.0) / max(1.0, 2.0 * lines / deviation.teeth)
    misfit = max(1.0, deviation.misfit)
    believed = expected * np.minimum(1.0, misfit**-2 + (peak / misfit / STANDS_OUT) ** 2)
    enough = believed >= tooth_evidence_needed(LIMITS.fault)
    if not enough.any():
        return None
    loss = float(LOSSES[int(np.argmax(enough))]) * float(np.exp(PATH_DEVIATION))
    return loss if loss <= LOSSES[-1] else None


def _expected(gear: GearEvidence) -> FloatArray:
    """Mean log likelihood ratio at a tooth that has lost each of `LOSSES`.

    Without a template: a pulse of one of z teeth modulates every mesh harmonic X_k by the depth a,
    lines of X_k a / z each (McFadden 1986), taken in the energy of the tooth's window.
    """
    if gear.search is not None:
        return gear.search.match.expected
    deviation = gear.deviation
    signal = 0.0
    for band in deviation.bands:
        if band.harmonic < deviation.mesh_power.shape[1]:
            power = deviation.mesh_power[:, band.harmonic] / deviation.teeth**2
            signal += float(np.sum(power[:, None] / band.deviation**2))
    value: FloatArray = (_PAIR_SHARE * LOSSES) ** 2 * signal
    return value
