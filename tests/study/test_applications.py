"""Damage and harvesting."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.study.pair import PINION_TEETH


def test_sidebands_are_proportional_to_a_small_loss(results):
    levels = results.damage.levels_db
    np.testing.assert_allclose(levels[1] - levels[0], 20 * np.log10(2), atol=0.1)


def test_sidebands_are_told_over_all_mesh_lines_of_the_healthy_pair(results):
    mesh = np.linalg.norm(results.reference.response.acceleration[1:])
    for response, level in zip(results.damage.responses, results.damage.levels_db, strict=True):
        between = np.arange(len(response.acceleration)) % PINION_TEETH > 0
        share = np.linalg.norm(response.acceleration[between]) / mesh
        assert level == pytest.approx(20 * np.log10(share), abs=1e-4)


def test_mesh_lines_of_a_turn_are_those_of_the_pair(results):
    turn = results.damage.responses[0]
    pair = results.reference.response
    lines = np.abs(turn.acceleration[::PINION_TEETH])[1:30]
    # a loss of 1 % on one of 26 teeth
    np.testing.assert_allclose(lines[::2], np.abs(pair.acceleration)[1:30:2], rtol=5e-3)


def test_published_harvester_power(results):
    # as much again as the generator takes goes into heat
    assert 2e3 * results.harvested_w[0] == pytest.approx(2.706, abs=1e-3)


def test_matched_power_is_the_closed_form(results):
    amplitude = 2 * np.abs(results.reference.response.acceleration[1:20])
    angular = 2 * np.pi * results.reference.response.frequency_hz[1:20]
    expected = 5e-3 * amplitude**2 / (16 * 0.01 * angular)
    np.testing.assert_allclose(results.harvested_w[:19], expected, rtol=1e-9)
