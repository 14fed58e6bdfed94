"""Bandwidth against quality factor, and tables of the response."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.harvesting.harvester import InertialHarvester, half_power_band, response_rows
from gearmon.harvesting.response import evaluate
from gearmon.harvesting.tuning import bandwidth_against_quality, built_in
from gearmon.harvesting.vibration import vibration_of_lines


def inertial(**changes):
    return InertialHarvester(**({"mass_kg": 5e-3, "natural_frequency_hz": 100.0} | changes))


@given(heat=st.floats(1e-3, 0.1), load=st.floats(1e-3, 0.1))
def test_bandwidth_of_a_mass_on_a_spring_is_twice_its_damping(heat, load):
    # r^2/((1 - r^2)^2 + (2 z r)^2) is half its top where r - 1/r = +-2 z: exactly 2 z wide
    h = inertial(mechanical_damping_ratio=heat, electrical_damping_ratio=load)
    band = half_power_band(h)
    assert band["width_hz"] == pytest.approx(2 * (heat + load) * 100.0, rel=1e-7)
    assert band["low_hz"] * band["high_hz"] == pytest.approx(100.0**2, rel=1e-7)
    assert band["quality_factor"] == pytest.approx(1 / (2 * (heat + load)), rel=1e-6)


def test_matched_power_times_bandwidth_does_not_depend_on_quality():
    rows = bandwidth_against_quality(inertial(), [10, 30, 100, 300])
    product = [row["peak_power_w"] * row["width_hz"] for row in rows]
    assert product == pytest.approx([product[0]] * 4, rel=1e-3)
    # m A^2/(16 zm wn), twice as broad as the mechanics alone
    for row in rows:
        bound = 5e-3 * row["quality_factor"] / (8 * 2 * math.pi * 100)
        assert row["peak_power_w"] == pytest.approx(bound, rel=1e-3)
        assert row["width_hz"] == pytest.approx(2 * 100.0 / row["quality_factor"], rel=1e-2)


def test_wander_takes_the_gain_of_a_high_quality_away():
    still = bandwidth_against_quality(inertial(), [20, 2000])
    moving = bandwidth_against_quality(inertial(), [20, 2000], wander=0.02)
    assert still[1]["power_w"] == pytest.approx(100 * still[0]["power_w"], rel=1e-3)
    assert moving[1]["power_w"] < 10 * moving[0]["power_w"]
    # spread by far more than the resonance it is noise: m S/4 in all for the one-sided density S,
    # A^2/2 times the top of a Gaussian, and a load that damps more than heat takes most of it
    density = 0.5 / (0.02 * 100.0 * math.sqrt(2 * math.pi))
    assert moving[1]["power_w"] < 5e-3 * density / 4
    assert moving[1]["power_w"] > 0.75 * 5e-3 * density / 4


def test_table_says_what_the_gains_say():
    beam = built_in()[0].retuned(300.0)
    rows = response_rows(beam)
    grid = np.array([row["frequency_hz"] for row in rows])
    assert np.all(np.diff(grid) > 0)
    assert grid[0] == pytest.approx(100.0)
    gains = beam.gains(grid)
    for name in ("power_w", "voltage_v", "travel_m", "stress_pa"):
        np.testing.assert_allclose([row[name] for row in rows], getattr(gains, name))
    assert response_rows(inertial())[0]["stress_pa"] is None


def test_what_has_no_band_is_refused():
    with pytest.raises(ArgumentError, match="there is no band"):
        half_power_band(inertial(electrical_damping_ratio=5.0))
    with pytest.raises(ArgumentError, match="quality_factor"):
        bandwidth_against_quality(inertial(), [0.2])


def test_the_weight_counts_in_shares_of_limits_as_much_as_motion_does():
    """Shares are straight in the motion, and begin at what the weight alone takes."""
    beam, _ = built_in()
    quiet, soft, loud = (
        evaluate(beam, vibration_of_lines([200.0], acceleration_ms2=[size]))
        for size in (1e-9, 0.5, 1.0)
    )
    assert quiet.stress_share == pytest.approx(quiet.static_stress_pa / beam.stress_limit_pa)
    assert quiet.travel_share == pytest.approx(quiet.static_travel_m / beam.clearance_m)
    assert quiet.stress_share > 0
    grown = loud.stress_share - quiet.stress_share
    assert soft.stress_share - quiet.stress_share == pytest.approx(0.5 * grown, rel=1e-6)
    assert grown > 0
