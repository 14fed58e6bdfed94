"""The mass on a spring of Williams and Yates: limits, matched load, bound, time integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.harvester_simulation import integrated_inertial_power

from gearmon.errors import ArgumentError
from gearmon.harvesting.harvester import InertialHarvester

harvesters = st.builds(
    InertialHarvester,
    mass_kg=st.floats(1e-4, 0.1),
    natural_frequency_hz=st.floats(10, 2000),
    mechanical_damping_ratio=st.floats(1e-3, 0.2),
    electrical_damping_ratio=st.floats(1e-3, 0.5),
)


def test_a_load_that_is_kept_is_not_tuned():
    free = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=625.0)
    assert free.load_range == free.usual_loads
    kept = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=625.0, load_kept=True)
    assert kept.load_range == (kept.load, kept.load)


def test_published_example():
    # m 5 g, total damping 0.02, 13.04 m/s2 at 625 Hz: 2.706 mW dissipated in all
    h = InertialHarvester(
        mass_kg=5e-3,
        natural_frequency_hz=625.0,
        mechanical_damping_ratio=1e-6,
        electrical_damping_ratio=0.02 - 1e-6,
    )
    assert 1e3 * h.gains(625.0).power_w[0] * 13.04**2 == pytest.approx(2.706, rel=1e-3)


@given(h=harvesters, ratio=st.floats(0.2, 3))
def test_power_is_that_of_the_damper(h, ratio):
    # m zT Y^2 r^3 w^3/[(1-r^2)^2 + (2 zT r)^2], the electrical share of it
    frequency = ratio * h.natural_frequency_hz
    w = 2 * math.pi * frequency
    total = h.mechanical_damping_ratio + h.electrical_damping_ratio
    base = 1 / w**2
    whole = h.mass_kg * total * base**2 * ratio**3 * w**3
    whole /= (1 - ratio**2) ** 2 + (2 * total * ratio) ** 2
    expected = whole * h.electrical_damping_ratio / total
    assert h.gains(frequency).power_w[0] == pytest.approx(expected, rel=1e-10)


@given(h=harvesters, ratio=st.floats(0.5, 2))
def test_bound_is_never_exceeded(h, ratio):
    assert h.gains(ratio * h.natural_frequency_hz).power_w[0] <= h.power_bound_w() * (1 + 1e-12)


@given(h=harvesters, factor=st.floats(1.05, 10))
def test_matched_load_is_best_at_resonance(h, factor):
    matched = h.with_load(h.mechanical_damping_ratio)
    power = matched.gains(h.natural_frequency_hz).power_w[0]
    assert power == pytest.approx(h.power_bound_w(), rel=1e-12)
    for load in (h.mechanical_damping_ratio * factor, h.mechanical_damping_ratio / factor):
        assert h.with_load(load).gains(h.natural_frequency_hz).power_w[0] < power


def test_power_under_lines_equals_time_integration():
    h = InertialHarvester(
        mass_kg=2e-3,
        natural_frequency_hz=100.0,
        mechanical_damping_ratio=0.02,
        electrical_damping_ratio=0.015,
    )
    lines = [(49.0, 2.0), (98.0, 1.0), (147.0, 3.0)]
    gains = h.gains([f for f, _ in lines]).power_w
    ours = float(gains @ np.square([a for _, a in lines]))
    assert ours == pytest.approx(integrated_inertial_power(h, lines), rel=1e-3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass_kg": 0.0}, "mass_kg"),
        ({"mechanical_damping_ratio": 0.0}, "mechanical"),
        ({"electrical_damping_ratio": -1.0}, "electrical"),
        ({"clearance_m": -1.0}, "clearance"),
        ({"lowest_hz": 50.0, "highest_hz": 20.0}, "highest_hz"),
        ({"natural_frequency_hz": 1.0}, "natural_frequency_hz"),
    ],
)
def test_impossible_values_are_refused(changes, words):
    values = {"mass_kg": 1e-3, "natural_frequency_hz": 100.0}
    with pytest.raises(ArgumentError, match=words):
        InertialHarvester(**(values | changes))
