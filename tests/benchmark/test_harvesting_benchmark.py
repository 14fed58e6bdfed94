"""The benchmark of harvesting runs, and its figures make sense."""

from __future__ import annotations

import pytest

from gearmon.benchmark.harvesting import time_harvesting


@pytest.fixture(scope="module")
def rows():
    seen = []
    found = time_harvesting(seen.append, quick=True)
    assert seen[-1] == 1.0
    return found


def test_tuning_finds_what_time_integration_finds(rows):
    assert rows[0]["power_ratio"] == pytest.approx(1.0, abs=0.02)
    assert min(rows[0]["time_s"], rows[0]["rival_time_s"]) > 0


def test_ratios_are_times_of_the_rival_over_ours(rows):
    for row in rows:
        assert row["ratio"] == pytest.approx(row["rival_time_s"] / row["time_s"])


def test_optimum_is_not_below_brute_force(rows):
    for row in rows[1:]:
        assert row["power_ratio"] > 0.995
