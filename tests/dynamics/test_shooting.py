import math

import numpy as np
import pytest
from reference.hill_cases import balanced, published_pair, scaled_problem
from reference.hill_reference import acceleration_error

from gearmon.dynamics import steady_state
from gearmon.dynamics.compliance import PairCompliance
from gearmon.dynamics.mesh_equations import equations_of
from gearmon.dynamics.shooting import Shooting


def turn_with_a_weak_tooth(meshes, zeta=0.3, lines=12):
    """One tooth 20 % softer among `meshes`, a turn as the period."""
    phase = np.arange(meshes * 64) / 64
    stiffness = np.where(phase < 1.4, 0.8, 1.0) * (1 + 0.1 * np.cos(2 * math.pi * phase))
    c = np.fft.rfft(stiffness) / stiffness.sum()
    return scaled_problem(5.3 * meshes, zeta, c[1 : lines * meshes])


def shooting_of(problem, highest):
    equations = equations_of(problem)
    pair, gain = equations.compliance, equations.gain.acceleration[None]
    return Shooting(pair, np.ones(1), gain, equations.pattern, highest)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("zeta", [0.01, 0.3, 2.0])
def test_a_turn_is_shot_for(tolerance, zeta):
    p = turn_with_a_weak_tooth(26, zeta)
    r = steady_state(p, tolerance)
    assert r.method == "shooting"
    assert "shot round the period" in r.message
    tight = steady_state(p, 1e-11, method="msm least residual")
    error = acceleration_error(r, tight.displacement)
    assert error <= r.error_bound + tight.error_bound
    assert r.error_bound <= tolerance


def test_against_the_matrix():
    p = turn_with_a_weak_tooth(5)
    found = shooting_of(p, 300).solve(1e-10)
    exact = balanced(p, 300)
    weights = np.arange(301) ** 2
    error = np.linalg.norm(weights * (found.lines[:301, 0] - exact))
    assert error < found.relative[0] * np.linalg.norm(weights * exact)
    assert found.relative[0] < 1e-10


# free motions that last the period, that die out within it, and that phi feeds
@pytest.mark.parametrize(
    ("p", "died_out"),
    [
        (published_pair(damping=150.0), False),
        (turn_with_a_weak_tooth(5), True),
        (scaled_problem(90.0, 0.08, [0.0] * 179 + [0.12]), False),
    ],
)
def test_a_motion_closes_and_obeys_its_recursion(p, died_out):
    shooting = shooting_of(p, 60)
    assert (shooting.free.shape[1] <= shooting.length) == died_out
    still = np.random.default_rng(0).normal(size=(shooting.length, 1))
    moved = shooting.answer(still.copy())
    twice, product, after, middle, before = shooting.stencil
    driven = shooting.phi * moved
    left = np.roll(moved - still, -1) - twice * (moved - still)
    left += product * np.roll(moved - still, 1)
    left += after * np.roll(driven, -1) + middle * driven + before * np.roll(driven, 1)
    np.testing.assert_allclose(left, 0, atol=1e-11 * np.abs(moved).max())


def test_one_set_is_marched_like_many():
    p = published_pair(damping=900.0)
    one, equations = shooting_of(p, 60), equations_of(p)
    two = np.ones(2)
    pair, gain = equations.compliance, equations.gain.acceleration
    pairs = PairCompliance(pair.ratio * two, pair.zeta * two, pair.forces)
    many = Shooting(pairs, two, gain * two, equations.pattern, 60)
    np.testing.assert_allclose(many.free, np.repeat(one.free, 2, axis=-1), atol=1e-12)
    lines = many.solve(1e-9).lines
    np.testing.assert_allclose(lines, np.repeat(one.solve(1e-9).lines, 2, axis=1), atol=1e-14)


def test_forces_are_answered():
    p = scaled_problem(3.0, 0.4, [0.1], force_harmonics=[100.0, 40j], force=0.0)
    found = shooting_of(p, 60).solve(1e-11)
    exact = balanced(p, 60)
    shown = found.lines[:61, 0]
    np.testing.assert_allclose(shown, exact[: len(shown)], atol=1e-10 * np.abs(exact).max())
