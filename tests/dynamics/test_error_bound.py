import math

import numpy as np
import pytest
from reference.hill_cases import random_problem, scaled_problem

from gearmon.dynamics import steady_state
from gearmon.dynamics.error_bound import (
    Pattern,
    _step_averages,
    best_gain,
    energy_gain,
    floquet_gain,
    small_gain,
)


def true_gain(problem, highest):
    """Norm of the acceleration operator from the inverse of a large matrix."""
    n = np.arange(-highest, highest + 1)
    x = n / problem.frequency_ratio
    matrix = np.diag(1 - x**2 + 2j * problem.damping_ratio * x)
    for j, c in enumerate(problem.stiffness_harmonics, start=1):
        matrix += c * np.eye(len(n), k=-j) + np.conj(c) * np.eye(len(n), k=j)
    return np.linalg.norm(x[:, None] ** 2 * np.linalg.inv(matrix), 2)


def numbers(problem):
    one = np.ones(1)
    return problem.frequency_ratio * one, problem.damping_ratio * one, one


def best(problem):
    return best_gain(*numbers(problem), Pattern(problem.stiffness_harmonics))


def gains(problem):
    """Of every kind, infinite where it proves nothing."""
    values, pattern = numbers(problem), Pattern(problem.stiffness_harmonics)
    return [
        small_gain(*values, pattern)[0][0],
        energy_gain(*values, pattern)[0],
        floquet_gain(*values, pattern)[0][0],
        best(problem).acceleration[0],
    ]


def test_gains_bound_the_inverse_operator():
    rng = np.random.default_rng(11)
    ratios, proven = [], np.zeros(4)
    for _ in range(60):
        problem = random_problem(rng, 8, ratios=(0.1, 5.0))
        highest = math.ceil(4 * problem.frequency_ratio) + 20
        true = true_gain(problem, highest)
        found = np.array(gains(problem))
        assert (found >= true * (1 - 1e-9)).all()
        proven += np.isfinite(found)
        if best(problem).stable[0]:
            ratios.append(found[-1] / true)
    assert len(ratios) > 52
    assert np.median(ratios) < 3
    assert (proven > [10, 10, 50, 52]).all()


def test_strong_variation_is_still_bounded():
    rng = np.random.default_rng(4)
    bounded = stable = 0
    for _ in range(30):
        problem = random_problem(rng, 8, largest=1.5, ratios=(0.2, 5.0), zetas=(0.02, 0.3))
        gain = best(problem)
        if gain.stable[0]:
            stable += 1
            bounded += math.isfinite(gain.acceleration[0])
            true = true_gain(problem, math.ceil(5 * problem.frequency_ratio) + 20)
            assert gain.acceleration[0] >= true * (1 - 1e-9)
    assert stable > 20
    assert bounded >= 0.97 * stable


def test_single_oscillator_is_bounded_tightly():
    # no variation: the gain is the largest x^2/|D| over the harmonics
    gain = best(scaled_problem(5.0, 0.01, []))
    assert gain.acceleration[0] == pytest.approx(50)
    assert gain.stable[0]


def test_unstable_systems_have_no_gain():
    gain = best(scaled_problem(0.5, 0.001, [0.1]))
    assert not gain.stable[0]
    assert math.isinf(gain.acceleration[0])


def test_growth_inside_a_tongue():
    # principal parametric resonance without damping: rate eps w0/4 in angles of w0
    gain = best(scaled_problem(0.5, 1e-4, [0.05]))
    assert gain.growth[0] == pytest.approx(math.pi * (0.1 / 4 - 1e-4), rel=1e-2)


def test_negative_stiffness_under_strong_damping():
    found = steady_state(scaled_problem(2.0, 1.5, [0.8]))
    assert found.stable
    assert found.error_bound <= 1e-6


def test_energy_proves_light_damping_where_the_mesh_is_slow():
    # 4 zeta is far below the variation, and the circle criterion fails
    problem = scaled_problem(30.0, 0.01, 0.15 * np.array([0.5, 0.1j]))
    small, energy = gains(problem)[:2]
    assert math.isinf(small)
    assert true_gain(problem, 90) < energy < 10 * true_gain(problem, 90)


@pytest.mark.parametrize("zeta", [0.02, 0.3, 0.8])
@pytest.mark.parametrize("size", [0.05, 0.15])
def test_energy_takes_the_worst_stiffness_that_the_mesh_runs_through(zeta, size):
    """At s = k/k0 - zeta^2 a motion of one adiabatic invariant: by every s that there is."""
    pattern = Pattern(size * np.array([0.5, 0.3j]))
    s = 1 - zeta**2 + np.linspace(-pattern.highest, pattern.highest, 1001)
    ratio = 4 * pattern.variation / (8 * math.pi * zeta * s[0])
    decay = zeta - pattern.variation / (8 * math.pi * ratio * s[0])
    force = np.hypot(2 * zeta * s**0.25, np.abs(s - zeta**2) / s**0.25).max()
    slow = 1 + force * (s**-0.25).max() * np.exp(pattern.variation / (4 * s[0])) / decay
    (found,) = energy_gain(ratio * np.ones(1), zeta * np.ones(1), np.ones(1), pattern)
    assert slow * (1 - 1e-12) <= found < 1.5 * slow


def test_sizes_of_phi_are_bounds():
    rng = np.random.default_rng(3)
    for count in (1, 4, 20):
        c = rng.normal(size=(5, count)) + 1j * rng.normal(size=(5, count))
        for row in c:
            angle = np.linspace(0, 2 * math.pi, 40_001)
            phi = 2 * (np.exp(1j * angle[:, None] * np.arange(1, count + 1)) @ row).real
            pattern = Pattern(row)
            assert np.abs(phi).max() <= pattern.highest < 1.1 * np.abs(phi).max()
            variation = np.abs(np.diff(phi)).sum()
            assert variation <= pattern.variation < 1.1 * variation


@pytest.mark.parametrize("count", [40, 400, 4000])
@pytest.mark.parametrize("place", [0.0, 0.3, 0.99])
def test_means_over_steps_are_those_of_quadrature(count, place):
    """Of phi, and of the integral of what phi departs from its mean by, from the step's start."""
    harmonics = np.array([0.2 + 0.1j, -0.15j, 0.05, 0.0, 0.02 + 0.03j])
    mean, offset = _step_averages(harmonics, count)
    k, (x, weights) = int(place * count), np.polynomial.legendre.leggauss(12)
    step = 2 * math.pi / count
    begin = k * step

    def average(function, high):
        return float(weights @ function(begin + (high - begin) * (1 + x) / 2) / 2)

    def phi(angle):
        return 2 * (np.exp(1j * np.outer(angle, np.arange(1, 6))) @ harmonics).real

    def gathered(angles):
        whole = average(phi, begin + step)
        return np.array([(own - begin) * (average(phi, own) - whole) for own in angles])

    assert mean[k] == pytest.approx(average(phi, begin + step), abs=1e-14)
    own = average(gathered, begin + step)
    assert offset[k] == pytest.approx(own, rel=1e-6, abs=1e-13 * step)


def test_sets_side_by_side_are_as_each_alone():
    rng = np.random.default_rng(8)
    ratio, zeta, scale = rng.uniform(0.3, 12, 40), 10 ** rng.uniform(-3, 0.3, 40), rng.random(40)
    pattern = Pattern(np.array([0.2, 0.1j, -0.05]))
    together = best_gain(ratio, zeta, scale, pattern)
    for i in range(40):
        alone = best_gain(ratio[i : i + 1], zeta[i : i + 1], scale[i : i + 1], pattern)
        assert alone.stable[0] == together.stable[i]
        if alone.stable[0]:
            # a set by itself is worth a sharper bound
            assert alone.acceleration[0] <= 1.5 * together.acceleration[i]
