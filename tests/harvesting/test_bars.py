"""Quick rounds of `harvest_bars`: power and peaks of marching, its ranking, intervals that hold."""

from __future__ import annotations

import numpy as np
import pytest
from harvest_bars import Days, against_marching, ranked_as_marched


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
