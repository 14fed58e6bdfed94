"""Many spectra tuned at once equal each tuned by itself."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.harvesting.inertial import InertialHarvester
from gearmon.harvesting.request import built_in
from gearmon.harvesting.sweep import tune_sweep
from gearmon.harvesting.tuning import tune_harvester
from gearmon.harvesting.vibration import OperatingShare, Vibration

LINES = 150.0 * np.arange(1, 9)


def spectra(count, seed=0):
    rng = np.random.default_rng(seed)
    return 1e-3 * rng.lognormal(0, 1.5, (count, len(LINES)))


@pytest.mark.parametrize(
    "harvester",
    [
        InertialHarvester(mass_kg=5e-3, natural_frequency_hz=300.0, highest_hz=2000.0),
        built_in()[0],
    ],
    ids=["inertial", "cantilever"],
)
def test_each_is_within_half_a_percent_of_its_own_tuning(harvester):
    power = spectra(6)
    found = tune_sweep(harvester, LINES, power)
    for k, row in enumerate(power):
        duty = [OperatingShare(vibration=Vibration(frequency_hz=LINES, mean_square_m2s4=row))]
        alone = tune_harvester(harvester, duty)
        assert found.power_w[k] >= alone.power_w * (1 - 0.005)
        tuned = harvester.retuned(found.natural_frequency_hz[k]).with_load(found.load[k])
        assert tuned.gains(LINES).power_w @ row * 2 == pytest.approx(found.power_w[k], rel=1e-9)


def test_shape_is_that_of_the_spectra():
    h = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=300.0)
    power = spectra(6).reshape(2, 3, -1)
    found = tune_sweep(h, LINES, power)
    assert found.power_w.shape == (2, 3)
    np.testing.assert_allclose(found.power_w.ravel(), tune_sweep(h, LINES, spectra(6)).power_w)


def test_what_does_not_fit_is_refused():
    h = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=50.0, highest_hz=60.0)
    with pytest.raises(ArgumentError, match="no line lies between"):
        tune_sweep(h, LINES, spectra(2))
    with pytest.raises(ArgumentError, match="last axis"):
        tune_sweep(h, LINES, np.ones((2, 3)))
