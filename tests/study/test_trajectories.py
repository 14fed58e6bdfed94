"""Direct integration against closed forms."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gearmon.dynamics import steady_state
from gearmon.study.pair import (
    PERIODS,
    POINTS,
    REFERENCE,
    SIGNALS,
    acceleration_error,
    dynamic_difference,
    series,
    simulate,
    start_from_rest,
    varied,
)


def step_response(time, natural, zeta, static):
    damped = natural * np.sqrt(1 - zeta**2)
    phase = np.cos(damped * time) + zeta / np.sqrt(1 - zeta**2) * np.sin(damped * time)
    return static * (1 - np.exp(-zeta * natural * time) * phase)


def test_constant_stiffness_gives_the_step_response():
    time = np.linspace(0, 1.6e-3, 101)
    found = simulate(REFERENCE, lambda phase: 0.0 * phase, time)
    problem = REFERENCE
    exact = step_response(
        time, 2 * np.pi * problem.natural_frequency_hz, problem.damping_ratio, 5e-6
    )
    np.testing.assert_allclose(found.displacement_m, exact, atol=5e-14)
    # the acceleration at rest is F/m
    assert found.acceleration_ms2[0] == pytest.approx(4e3 / 0.28)
    np.testing.assert_allclose(found.mesh_force_n, 8e8 * exact + 9e3 * found.velocity_ms, atol=1e-3)


def test_rectangle_is_piecewise_the_motion_on_its_levels():
    """Within the first zone the stiffness is constant: again a step response."""
    signal = SIGNALS["rectangular"]
    level = 1 + float(signal.modulation(0.2))
    time = np.linspace(0, 0.412 * 1.6e-3, 60)
    found = simulate(REFERENCE, signal.modulation, time, signal.jumps)
    natural = np.sqrt(8e8 * level / 0.28)
    zeta = 9e3 / (2 * np.sqrt(8e8 * level * 0.28))
    exact = step_response(time, natural, zeta, 5e-6 / level)
    np.testing.assert_allclose(found.displacement_m, exact, atol=5e-14)


def test_series_is_the_sum_of_its_cosines():
    phase = np.linspace(0, 1, 7)
    expected = 0.2 * np.cos(2 * np.pi * phase) - 0.1 * np.sin(6 * np.pi * phase)
    np.testing.assert_allclose(series(np.array([0.1, 0, 0.05j]))(phase), expected, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "value", "method", "most"),
    [
        ("mass_kg", 3.0, "multiple scales", 1e-4),
        ("damping_ns_per_m", 60e3, "multiple scales", 1e-4),
        ("damping_ns_per_m", 30e3, "direct integration", 0.0),
        ("stiffness_n_per_m", 8e8, "multiple scales", 5e-3),
    ],
)
def test_starts_settle_to_the_steady_vibration(name, value, method, most):
    problem = varied(REFERENCE, name, value)
    steady = steady_state(problem, 1e-9)
    motion, error, found = start_from_rest(steady, 5, 64)
    assert found == method
    assert error <= most
    last = motion.time_s[-64:]
    decay_rate = problem.damping_ns_per_m / (2 * problem.mass_kg)
    tolerance = 1e-8 + 2 * np.exp(-decay_rate * last[0]) * (value < 5)
    np.testing.assert_allclose(
        motion.displacement_m[-64:], steady.at(last), rtol=max(1e-7, tolerance)
    )


def test_error_of_the_acceleration_weighs_a_line_by_its_square():
    exact = steady_state(REFERENCE, 1e-9)
    other = exact.displacement.copy()
    other[5] *= 1.02
    lines = np.arange(len(other)) ** 2 * np.abs(other)
    share = 0.02 / 1.02 * lines[5] / np.linalg.norm(np.arange(len(other)) ** 2 * exact.displacement)
    assert acceleration_error(other, exact) == pytest.approx(share, rel=1e-6)
    # a line that is left out is all in error
    assert acceleration_error(exact.displacement[:1], exact) == pytest.approx(1.0)


def test_means_are_no_part_of_the_difference_of_two_motions():
    """One swings a tenth more than the other, about another mean."""
    wave = np.sin(2 * np.pi * np.arange(PERIODS * POINTS + 1) / POINTS)
    one, other = (
        SimpleNamespace(simulated=SimpleNamespace(displacement_m=z))
        for z in (7.0 + 1.1 * wave, 5.0 + wave)
    )
    assert dynamic_difference(one, other) == pytest.approx(0.1)
