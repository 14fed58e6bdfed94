import math

import numpy as np
import pytest
from reference.hill_cases import random_problem

from gearmon.dynamics import error_bound
from gearmon.dynamics.sweep_bounds import energy_gain, small_gain, swing_of
from gearmon.dynamics.sweep_floquet import floquet_gain


def true_gain(ratio, zeta, c, highest):
    """Norm of r -> z'' on the harmonics -highest..highest."""
    n = np.arange(-highest, highest + 1)
    row = np.zeros(4 * highest + 1, dtype=complex)
    row[2 * highest + 1 : 2 * highest + 1 + len(c)] = c
    row[2 * highest - len(c) : 2 * highest] = c[::-1].conj()
    matrix = row[n[:, None] - n + 2 * highest]
    matrix[np.diag_indices(len(n))] += 1 - (n / ratio) ** 2 + 2j * zeta * n / ratio
    return np.linalg.norm((n / ratio)[:, None] ** 2 * np.linalg.inv(matrix), 2)


def cases(count):
    rng = np.random.default_rng(count)
    for _ in range(count):
        p = random_problem(rng, 8, ratios=(0.3, 8.0), zetas=(3e-3, 1.5))
        yield p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics


def test_no_gain_is_below_the_true_one():
    proven = np.zeros(3)
    for ratio, zeta, c in cases(60):
        swing = swing_of(c)
        one = np.array([ratio]), np.array([zeta])
        gains = [
            small_gain(*one, np.array([swing.highest]))[0],
            energy_gain(*one, np.array([swing.highest]), np.array([swing.variation])),
            floquet_gain(*one, np.ones(1), swing)[0],
        ]
        least = true_gain(ratio, zeta, c, math.ceil(4 * ratio) + 30)
        for number, gain in enumerate(gains):
            assert gain[0] >= least * (1 - 1e-9)
            proven[number] += np.isfinite(gain[0])
        if np.isfinite(min(g[0] for g in gains)):
            assert error_bound.best_gain(ratio, zeta, c).stable
    assert (proven > [10, 10, 50]).all()


def test_energy_proves_light_damping_where_the_mesh_is_slow():
    # 4 zeta is far below the variation, and the circle criterion fails
    c = 0.15 * np.array([0.5, 0.1j])
    swing = swing_of(c)
    one = np.array([30.0]), np.array([0.01])
    assert math.isinf(small_gain(*one, np.array([swing.highest]))[0][0])
    gain = energy_gain(*one, np.array([swing.highest]), np.array([swing.variation]))[0]
    assert true_gain(30.0, 0.01, c, 90) < gain < 10 * true_gain(30.0, 0.01, c, 90)


def test_sizes_of_phi_are_bounds():
    rng = np.random.default_rng(3)
    for count in (1, 4, 20):
        c = rng.normal(size=(5, count)) + 1j * rng.normal(size=(5, count))
        for row in c:
            angle = np.linspace(0, 2 * math.pi, 40_001)
            phi = 2 * (np.exp(1j * angle[:, None] * np.arange(1, count + 1)) @ row).real
            swing = swing_of(row)
            assert np.abs(phi).max() <= swing.highest < 1.1 * np.abs(phi).max()
            variation = np.abs(np.diff(phi)).sum()
            assert variation <= swing.variation < 1.1 * variation


def test_growth_inside_a_tongue():
    # principal parametric resonance without damping: rate eps w0/4 in angles of w0
    gain, growth = floquet_gain(
        np.array([0.5]), np.array([1e-4]), np.ones(1), swing_of(np.array([0.05 + 0j]))
    )
    assert math.isinf(gain[0])
    assert growth[0] == pytest.approx(math.pi * (0.1 / 4 - 1e-4), rel=1e-2)
