"""Prediction from state to state: limits that are known in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.diagnosis.law import Kriging, operating_states
from gearmon.diagnosis.law.state import LENGTH

HERE = np.zeros(2)


def at(*loads):
    return np.array([[load, 0.0] for load in loads])


def test_one_reference_is_the_prediction_with_a_spread_that_grows_with_distance():
    near = [Kriging.of(at(x), HERE, 0.1, 0.5) for x in (0.0, 0.01, 0.1)]
    assert all(one.weights == pytest.approx([1.0]) for one in near)
    # two independent scatters, and the square of slope times distance while it is small
    assert near[0].spread == pytest.approx(2 * 0.1**2)
    assert near[2].spread - near[0].spread == pytest.approx((0.5 * 0.1) ** 2, rel=0.02)


def test_far_away_the_spread_is_that_of_two_strangers():
    far = Kriging.of(at(50.0), HERE, 0.1, 0.5)
    assert far.spread == pytest.approx(2 * (0.5 * LENGTH) ** 2 + 2 * 0.1**2)


@pytest.mark.parametrize("count", [2, 5])
def test_references_at_one_state_are_averaged(count):
    found = Kriging.of(at(*count * [0.3]), np.array([0.3, 0.0]), 0.1, 0.5)
    assert found.weights == pytest.approx(np.full(count, 1 / count))
    assert found.spread == pytest.approx(0.1**2 * (1 + 1 / count))


def test_scatter_and_change_with_the_state_are_told_apart():
    same = Kriging.of(at(0.3, 0.3), np.array([0.3, 0.0]), 0.1, 0.5)
    assert same.parts == pytest.approx([0.1**2 * (1 + 1 / 2), 0.0], abs=1e-12)
    far = Kriging.of(at(50.0), HERE, 0.1, 0.5)
    assert far.parts == pytest.approx([2 * 0.1**2, 2 * (0.5 * LENGTH) ** 2])


def test_between_two_references_it_interpolates_and_is_surer_than_beside_one():
    between = Kriging.of(at(-0.2, 0.2), HERE, 0.01, 0.5)
    assert between.weights == pytest.approx([0.5, 0.5])
    assert between.spread < 0.1 * Kriging.of(at(0.2), HERE, 0.01, 0.5).spread


def test_a_straight_course_is_followed_between_references():
    found = Kriging.of(at(-0.3, 0.0, 0.3), np.array([0.15, 0.0]), 1e-3, 0.5)
    assert found.weights @ np.array([-0.3, 0.0, 0.3]) == pytest.approx(0.15, abs=0.02)


@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=6),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
)
def test_one_more_reference_never_makes_it_less_sure(known, more, state):
    one = Kriging.of(np.array(known), np.array(state))
    two = Kriging.of(np.array([*known, more]), np.array(state))
    assert one.weights.sum() == pytest.approx(1.0)
    assert two.spread <= one.spread * (1 + 1e-9)


@pytest.mark.parametrize(
    ("mesh", "others", "floor", "load"),
    [(6.0, 6.0, 6.0, 0.0), (6.0, 0.0, 0.0, 6.0), (6.0, 2.0, 3.0, 4.0), (6.0, -1.0, 2.0, 6.0)],
)
def test_the_load_is_what_the_mesh_lines_rose_beyond_a_gain(mesh, others, floor, load):
    def profile(*change_db):
        return SimpleNamespace(
            family_names=("mesh 1 x1", "shaft 1"),
            level_db=np.array([change_db[:2]]),
            heard=np.ones((1, 2), dtype=bool),
            band_db=np.array([[change_db[2]]]),
            speed_hz=20.0,
        )

    base, new = profile(0.0, 0.0, 0.0), profile(mesh, others, floor)
    ((found, speed),) = operating_states([new], base, [(0,)], (0,))
    assert found == pytest.approx(load * np.log(10) / 20)
    assert speed == 0.0
