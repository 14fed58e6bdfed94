import math

import numpy as np
import pytest
from reference.hill_cases import random_problem

from gearmon.dynamics.error_bound import best_gain, dense_gain, floquet_gain, small_gain


def true_gain(problem, highest):
    """Norm of the acceleration operator from the inverse of a large matrix."""
    n = np.arange(-highest, highest + 1)
    x = n / problem.frequency_ratio
    matrix = np.diag(1 - x**2 + 2j * problem.damping_ratio * x)
    for j, c in enumerate(problem.stiffness_harmonics, start=1):
        matrix += c * np.eye(len(n), k=-j) + np.conj(c) * np.eye(len(n), k=j)
    return np.linalg.norm(x[:, None] ** 2 * np.linalg.inv(matrix), 2)


def gains(problem):
    values = (problem.frequency_ratio, problem.damping_ratio, problem.stiffness_harmonics)
    return [method(*values) for method in (small_gain, floquet_gain, dense_gain, best_gain)]


def test_gains_bound_the_inverse_operator():
    rng = np.random.default_rng(11)
    ratios = []
    for _ in range(40):
        problem = random_problem(rng, 8, ratios=(0.1, 5.0))
        highest = math.ceil(4 * problem.frequency_ratio) + 20
        true = true_gain(problem, highest)
        for gain in gains(problem):
            if gain is not None:
                assert gain.acceleration >= true * (1 - 1e-9)
        best = gains(problem)[-1]
        if best.stable:
            ratios.append(best.acceleration / true)
    assert len(ratios) > 35
    assert np.median(ratios) < 3


def test_strong_variation_is_still_bounded():
    rng = np.random.default_rng(4)
    bounded = stable = 0
    for _ in range(30):
        problem = random_problem(rng, 8, largest=1.5, ratios=(0.2, 5.0), zetas=(0.02, 0.3))
        gain = gains(problem)[-1]
        if gain.stable:
            stable += 1
            bounded += math.isfinite(gain.acceleration)
            true = true_gain(problem, math.ceil(5 * problem.frequency_ratio) + 20)
            assert gain.acceleration >= true * (1 - 1e-9)
    assert stable > 20
    assert bounded >= 0.97 * stable


def test_single_oscillator_is_bounded_tightly():
    # no variation: the gain is the largest x^2/|D| over the harmonics
    gain = small_gain(5.0, 0.01, np.zeros(0, dtype=complex))
    assert gain.acceleration == pytest.approx(50)
    assert gain.stable


def test_unstable_systems_have_no_gain():
    gain = best_gain(0.5, 0.001, np.array([0.1 + 0j]))
    assert gain.stable is False
    assert math.isinf(gain.acceleration)


def test_negative_stiffness_under_strong_damping():
    problem_gain = best_gain(2.0, 1.5, np.array([0.8 + 0j]))
    assert problem_gain.stable
    assert math.isfinite(problem_gain.acceleration)
