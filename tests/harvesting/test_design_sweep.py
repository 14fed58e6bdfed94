"""Energy lines and tunings over a grid of gear pairs."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.dynamics import HillProblem, steady_state
from gearmon.errors import ArgumentError
from gearmon.harvesting.inertial import InertialHarvester
from gearmon.harvesting.sweep import sweep_designs
from gearmon.harvesting.tuning import tune_harvester
from gearmon.harvesting.vibration import vibration_of_lines

ODD = np.arange(1, 42, 2)
SQUARE = np.zeros(41)
SQUARE[ODD - 1] = 0.13 * (2 / np.pi) * (-1.0) ** ((ODD - 1) // 2) / ODD


def harvester():
    return InertialHarvester(
        mass_kg=5e-3, natural_frequency_hz=625.0, lowest_hz=300.0, highest_hz=20_000.0
    )


def swept(**changes):
    values = {
        "mass_kg": [[0.2], [0.28], [1.0]],
        "damping_ns_per_m": [9e3, 3e4],
        "stiffness_n_per_m": 8e8,
        "stiffness_harmonics": SQUARE,
        "period_s": 1.6e-3,
        "force_n": 4e3,
    }
    return sweep_designs(harvester(), **(values | changes))


def test_reference_design_has_its_operating_line_and_neighbours():
    found = swept()
    frequency, share = found.operating_lines(5)
    np.testing.assert_allclose(frequency[1, 0], [8125, 6875, 5625, 9375, 4375])
    # 14.6, 14.4, 11.3, 10.8 and 8.6 uJ/kg, printed to a digit
    energy = 1e6 * share[1, 0] * found.total_j_per_kg[1, 0]
    np.testing.assert_allclose(energy, [14.6, 14.4, 11.3, 10.8, 8.6], atol=0.06)


def test_each_design_is_what_it_is_by_itself():
    found = swept()
    rows = iter(found.rows())
    for mass in (0.2, 0.28, 1.0):
        for damping in (9e3, 3e4):
            z = steady_state(HillProblem(mass, damping, 8e8, SQUARE, 1.6e-3, 4e3), 1e-8)
            lines = 2 * np.abs(z.acceleration[1:20])
            row = next(rows)
            assert (row["mass_kg"], row["damping_ns_per_m"]) == (mass, damping)
            energy = lines**2 / 2 / (2 * np.pi * np.arange(1, 20) / 1.6e-3) ** 2
            assert row["energy_j_per_kg"] == pytest.approx(energy.sum(), rel=1e-5)
            shaking = vibration_of_lines(np.arange(1, 20) / 1.6e-3, acceleration_ms2=lines)
            alone = tune_harvester(harvester(), shaking)
            assert row["power_w"] == pytest.approx(alone.power_w, rel=5e-3)


def test_gain_counts_squared():
    assert swept(gain=0.1).tuning.power_w == pytest.approx(0.01 * swept().tuning.power_w)


def test_what_cannot_be_is_refused():
    with pytest.raises(ArgumentError, match="two mesh harmonics"):
        swept(highest_hz=700.0)
    with pytest.raises(ArgumentError, match="gain"):
        swept(gain=0.0)
    with pytest.raises(ArgumentError, match="count"):
        swept().operating_lines(0)
