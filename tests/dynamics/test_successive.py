import math

import numpy as np
import pytest
from reference.hill_cases import balanced, published_pair, scaled_problem
from reference.hill_reference import acceleration_error

from gearmon.dynamics import steady_state
from gearmon.dynamics.mesh_equations import SLOWEST, equations_of, sum_orders


def converges_fast(equations):
    return equations.convergence < SLOWEST


def turn_with_a_weak_tooth(meshes, zeta=0.3, lines=12):
    """One tooth 20 % softer among `meshes`, a turn as the period."""
    phase = np.arange(meshes * 64) / 64
    stiffness = np.where(phase < 1.4, 0.8, 1.0) * (1 + 0.1 * np.cos(2 * math.pi * phase))
    c = np.fft.rfft(stiffness) / stiffness.sum()
    return scaled_problem(5.3 * meshes, zeta, c[1 : lines * meshes])


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
def test_orders_are_summed_for_a_turn(tolerance):
    p = turn_with_a_weak_tooth(26)
    r = steady_state(p, tolerance)
    assert r.method == "msm"
    assert "plain expansion to order" in r.message
    tight = steady_state(p, 1e-11, method="msm least residual")
    error = acceleration_error(r, tight.displacement)
    assert error <= r.error_bound + tight.error_bound
    assert r.error_bound <= tolerance


def test_against_the_matrix():
    p = turn_with_a_weak_tooth(5)
    equations = equations_of(p)
    assert converges_fast(equations)
    found = sum_orders(equations, np.zeros(301, dtype=complex), 1e-10)
    exact = balanced(p, 300)
    weights = np.arange(301) ** 2
    size = np.linalg.norm(weights * exact)
    assert np.linalg.norm(weights * (found.motion - exact)) < 1e-9 * size
    # and going on from there changes nothing
    again = sum_orders(equations, found.swing, 1e-10)
    assert again.orders <= 2
    np.testing.assert_allclose(again.motion, found.motion, atol=1e-15)


def test_slow_convergence_is_left_to_others():
    assert not converges_fast(equations_of(published_pair(damping=150.0)))
    assert not converges_fast(equations_of(scaled_problem(3.0, 0.2, [0.3])))
    assert converges_fast(equations_of(published_pair(damping=9e3)))


def test_forces_are_answered():
    p = scaled_problem(3.0, 0.4, [0.1], force_harmonics=[100.0, 40j], force=0.0)
    found = sum_orders(equations_of(p), np.zeros(61, dtype=complex), 1e-11)
    exact = balanced(p, 60)
    np.testing.assert_allclose(found.motion, exact, atol=1e-10 * np.abs(exact).max())
