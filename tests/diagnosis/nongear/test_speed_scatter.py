"""Levels moved across resonances: limits, and an independent simulation of many paths."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearmon.diagnosis.nongear import speed_scatter_db


def test_same_speed_has_no_scatter():
    assert speed_scatter_db(0.0) == pytest.approx(0.0, abs=1e-6)


def test_far_apart_levels_are_independent():
    # two independent exponential powers: standard deviation of the difference of their levels
    expected = 10 / math.log(10) * math.pi / math.sqrt(3)
    assert speed_scatter_db(50.0) == pytest.approx(expected, rel=1e-3)


def test_it_rises_with_the_change():
    changes = [speed_scatter_db(d) for d in (0.001, 0.005, 0.02, 0.1)]
    assert changes == sorted(changes)
    assert speed_scatter_db(-0.02) == speed_scatter_db(0.02)


@pytest.mark.parametrize("change", [0.01, 0.03])
def test_agrees_with_simulated_paths_of_many_modes(change):
    generator = np.random.default_rng(3)
    damping, paths, modes = 0.02, 1500, 400
    # frequencies over that of the line; ten modes within the bandwidth of one
    natural = generator.uniform(0.7, 1.3, (paths, modes))
    shape = generator.standard_normal((paths, modes))

    def level(frequency):
        response = shape / (natural**2 - frequency**2 + 2j * damping * natural * frequency)
        return 20 * np.log10(np.abs(response.sum(axis=-1)))

    moved = np.std(level(1.0 + change / 2) - level(1.0 - change / 2))
    assert moved == pytest.approx(speed_scatter_db(change), rel=0.1)
