"""Areas under ROC curves and intervals: closed forms, slow versions, laws."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.benchmark.detection import _summed, roc_area_interval


def roc_area(healthy, faulty):
    """Area alone, of recordings of one machine."""
    return roc_area_interval([np.array(healthy)], [np.array(faulty)])[0]


SCORES = st.lists(st.integers(-5, 5), min_size=1, max_size=12)


@given(SCORES, SCORES)
def test_area_is_the_share_of_pairs_in_order(healthy, faulty):
    pairs = list(itertools.product(healthy, faulty))
    slow = sum(1.0 if f > h else 0.5 if f == h else 0.0 for h, f in pairs) / len(pairs)
    assert roc_area(healthy, faulty) == pytest.approx(slow)
    assert roc_area(faulty, healthy) == pytest.approx(1 - slow)


def test_area_of_two_normal_laws():
    # Phi(1/sqrt 2) for means one deviation apart
    rng = np.random.default_rng(0)
    area = roc_area(rng.normal(size=4000), rng.normal(1.0, 1.0, 4000))
    assert area == pytest.approx(0.7602, abs=0.012)


def test_interval_of_machines_covers():
    rng = np.random.default_rng(1)
    inside = 0
    for trial in range(30):
        healthy = [rng.normal(size=2) for _ in range(40)]
        faulty = [rng.normal(1.0, 1.0, 1) for _ in range(40)]
        area, low, high = roc_area_interval(healthy, faulty, seed=trial)
        assert low <= area <= high
        inside += low <= 0.7602 <= high
    assert inside >= 25


@pytest.mark.parametrize("share", [0.5, 0.8])
def test_interval_of_a_share_reaches_as_far_as_the_normal_law_says(share):
    """Where healthy scores are all alike the area is a share of machines, drawn anew."""
    count = 100
    healthy = [np.zeros(1)] * count
    faulty = [np.array([1.0 if n < share * count else -1.0]) for n in range(count)]
    intervals = [roc_area_interval(healthy, faulty, seed=seed) for seed in range(10)]
    area, low, high = np.mean(intervals, axis=0)
    assert area == pytest.approx(share)
    reach = 1.96 * np.sqrt(share * (1 - share) / count)
    assert [area - low, high - area] == pytest.approx([reach, reach], rel=0.08)


def test_machines_without_scores_do_no_harm():
    none = np.zeros(0)
    area, low, high = roc_area_interval([np.zeros(1), none, none], [none, np.ones(1), none])
    assert (area, low, high) == (1.0, 1.0, 1.0)


def share_interval(hits, trials):
    return _summed(pd.Series(np.arange(trials) < hits))


def test_wilson_solves_its_equation():
    share, low, high = share_interval(7, 40)
    assert share == 7 / 40
    for limit in (low, high):
        assert abs(share - limit) == pytest.approx(1.959964 * np.sqrt(limit * (1 - limit) / 40))
    assert share_interval(0, 5)[1] == 0.0
    assert share_interval(5, 5)[2] == pytest.approx(1.0)
    assert [round(x, 3) for x in share_interval(0, 10)] == [0.0, 0.0, 0.278]
