"""Quick rounds of `harvest_bars`: power and peaks of marching, its ranking, intervals that hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from harvest_bars import Days, against_marching, heard, ranked_as_marched
from reference.marching import marched_answer

from gearmon.harvesting import CoilHarvester, tune_harvester, vibration_of_samples


@pytest.mark.parametrize("seed", range(3))
def test_power_and_peaks_of_a_random_recording_are_those_of_marching(seed):
    _, power, peaks = against_marching(seed, longest=20.0)
    assert power == pytest.approx(1.0, rel=0.01)
    np.testing.assert_allclose(peaks, 1.0, rtol=0.05)


def test_places_are_ranked_as_marching_ranks_them():
    assert all(ranked_as_marched(seed) for seed in range(2))


def test_intervals_of_whole_surveys_hold():
    days = Days("fast wander")
    # of ten days at 90 % fewer than seven hold once in eighty times
    assert sum(bool(days.held(seed)) for seed in range(10)) >= 7


@pytest.mark.parametrize(("wander", "noise"), [(0.01, 0.01), (0.003, 0.5)])
def test_power_within_a_clearance_is_the_most_that_marching_allows(wander, noise):
    rng = np.random.default_rng([22, 1])
    samples = heard(rng, 8.0, wander, 0.2, noise, line_hz=90.0, rate=600.0)
    samples -= samples.mean()
    coil = CoilHarvester(
        mass_kg=5e-3,
        natural_frequency_hz=90.0,
        lowest_hz=84.0,
        highest_hz=96.0,
        turns=500.0,
        field_length_tm=5e-3,
        coil_ohm=50.0,
        coil_henry=5e-3,
    )
    shaking = vibration_of_samples(samples, 600.0)
    free = tune_harvester(coil, shaking).answers[0].travel_m
    tight = replace(coil, clearance_m=0.75 * free)
    found = tune_harvester(tight, shaking)
    power, (_, travel) = marched_answer(found.harvester, samples, 600.0, times=8)
    assert found.power_w == pytest.approx(power, rel=0.01)
    assert travel <= 1.05 * tight.clearance_m
    for frequency in np.linspace(87.0, 93.0, 13):
        tried = tight.retuned(float(frequency))
        for load in np.geomspace(10.0, 300.0, 8):
            one = marched_answer(tried.with_load(float(load)), samples, 600.0, times=8)
            assert one[1][1] > tight.clearance_m or one[0] <= power / 0.95
