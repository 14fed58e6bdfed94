"""Levels moved across resonances: limits, and an independent simulation of many paths."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearmon.diagnosis.nongear.speed_scatter import (
    family_speed_scatter_db,
    independent_lines,
    speed_scatter_db,
)
from gearmon.errors import ArgumentError
from gearmon.signatures.measured.line_plan import Family


def test_same_speed_has_no_scatter():
    assert speed_scatter_db(0.0) == pytest.approx(0.0, abs=1e-6)


def test_far_apart_levels_are_independent():
    # two independent exponential powers: standard deviation of the difference of their levels
    expected = 10 / math.log(10) * math.pi / math.sqrt(3)
    assert speed_scatter_db(50.0) == pytest.approx(expected, rel=1e-3)


def test_it_rises_with_the_change_and_falls_with_damping_and_averaging():
    changes = [speed_scatter_db(d) for d in (0.001, 0.005, 0.02, 0.1)]
    assert changes == sorted(changes)
    assert speed_scatter_db(-0.02) == speed_scatter_db(0.02)
    assert speed_scatter_db(0.02, 0.05) < speed_scatter_db(0.02, 0.01)
    assert speed_scatter_db(0.02, independent=4.0) == pytest.approx(0.5 * speed_scatter_db(0.02))


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
    assert moved == pytest.approx(speed_scatter_db(change, damping), rel=0.1)


def test_lines_count_as_independent_where_they_are_apart():
    assert independent_lines(np.array([10.0])) == pytest.approx(1.0)
    assert independent_lines(np.full(5, 10.0)) == pytest.approx(1.0)
    assert independent_lines(np.geomspace(1.0, 1e4, 5)) == pytest.approx(5.0, rel=0.02)
    two = independent_lines(np.array([99.0, 101.0]), 0.01)
    # one bandwidth apart: they correlate by a half
    assert two == pytest.approx(4 / 3, rel=1e-6)


def test_mean_of_simulated_lines_scatters_as_so_many():
    generator = np.random.default_rng(5)
    damping, paths, modes = 0.02, 1500, 400
    natural = generator.uniform(0.7, 1.3, (paths, modes))
    shape = generator.standard_normal((paths, modes))
    lines = np.array([0.95, 0.98, 1.0, 1.06])
    powers = np.array(
        [
            np.abs(np.sum(shape / (natural**2 - f**2 + 2j * damping * natural * f), axis=-1)) ** 2
            for f in lines
        ]
    )
    powers /= powers.mean(axis=1, keepdims=True)
    share = np.var(powers.mean(axis=0)) / np.var(powers, axis=1).mean()
    assert 1 / share == pytest.approx(independent_lines(lines, damping), rel=0.15)


def family(*lines):
    return Family(kind="mesh", stage=1, gear="", harmonic=1, spacing=0.0, shaft=None, lines=lines)


def test_families_move_by_the_nearest_healthy_speed():
    orders = np.array([5.0, 20.0, 40.0, 80.0])
    families = (family(1), family(0, 3))
    moved = family_speed_scatter_db(families, orders, 25.5, (24.0, 25.0))
    assert moved[0] == pytest.approx(speed_scatter_db(0.02))
    assert moved[1] == pytest.approx(speed_scatter_db(0.02) / math.sqrt(2), rel=0.02)
    still = family_speed_scatter_db(families, orders, 25.0, (24.0, 25.0))
    np.testing.assert_allclose(still, 0.0, atol=1e-6)


def test_bad_arguments_are_refused():
    with pytest.raises(ArgumentError, match="at least one speed"):
        family_speed_scatter_db((family(0),), np.ones(1), 25.0, ())
    with pytest.raises(ArgumentError, match="all > 0"):
        independent_lines(np.array([1.0, 0.0]))
    with pytest.raises(ArgumentError, match="damping_ratio"):
        speed_scatter_db(0.01, 0.0)
    with pytest.raises(ArgumentError, match="relative_change"):
        speed_scatter_db(math.nan)
