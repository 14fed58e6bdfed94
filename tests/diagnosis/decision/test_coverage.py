"""What a healthy verdict is worth: the damage that would have been heard."""

from dataclasses import replace

import numpy as np
import pytest
from reference.gear_departures import complex_noise

from gearmon.diagnosis.decision.coverage import heard_from, noticed_from
from gearmon.diagnosis.decision.thresholds import LIMITS
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence
from gearmon.diagnosis.law import GearDeviation
from gearmon.diagnosis.law.gear_lines import BandDeviation

TEETH, BANDS = 23, 6


def gear(mesh_power=1e5, departs=1.0, loaded=1.0):
    """A sound gear whose lines depart by some times what noise lets expect."""
    rng = np.random.default_rng(5)
    bands = []
    for k in range(1, BANDS + 1):
        number = k * TEETH + np.setdiff1d(np.arange(-11, 12), range(-2, 3))
        noise = np.ones((2, len(number)))
        bands.append(
            BandDeviation(
                harmonic=k,
                number=number,
                rest=departs * complex_noise(rng, *noise.shape),
                deviation=noise,
                noise=noise,
                pattern=np.zeros(noise.shape, dtype=complex),
            )
        )
    deviation = GearDeviation(
        stage=1,
        gear="pinion",
        teeth=TEETH,
        order=1.0,
        bands=tuple(bands),
        mesh_power=np.full((2, BANDS + 1), mesh_power),
        shift_turns=0.0,
    )
    return GearEvidence(deviation=deviation, search=None, loaded=loaded)


def test_a_louder_path_lets_smaller_losses_be_heard():
    losses = [heard_from(gear(power)) for power in (1e4, 1e5, 1e6)]
    assert losses == sorted(losses, reverse=True)
    # ten times the power is sqrt(10) times the amplitude
    assert losses[1] / losses[2] == pytest.approx(10**0.5, rel=0.25)


def test_teeth_loaded_less_need_a_larger_loss_in_proportion():
    assert heard_from(gear(loaded=0.8)) == pytest.approx(heard_from(gear()) / 0.8)


def test_of_teeth_that_hardly_touch_only_what_would_be_a_fault_counts_as_heard():
    quiet, restless = gear(), gear(departs=4.0)
    assert heard_from(restless) == pytest.approx(heard_from(quiet))
    light = replace(restless, loaded=0.9 * LIMITS.lightly_loaded)
    told = noticed_from(light)
    assert heard_from(light) == told
    assert told is None or told > 2.0 * heard_from(restless)
