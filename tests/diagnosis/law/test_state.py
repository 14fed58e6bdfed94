"""Prediction from state to state: limits that are known in closed form."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.diagnosis.law.gear_lines import LENGTH, Kriging
from gearmon.diagnosis.law.machine import FLUCTUATION_UNIT, SPEED_UNIT, StateGauge
from gearmon.signatures.measured.reference import Profile

HERE = np.zeros(2)


def at(*loads):
    return np.array([[load, 0.0] for load in loads])


def test_one_reference_is_the_prediction_with_a_spread_that_grows_with_distance():
    near = [Kriging(at(x), HERE, 0.1, 0.5) for x in (0.0, 0.01, 0.1)]
    assert all(one.weights == pytest.approx([1.0]) for one in near)
    # two independent scatters, and the square of slope times distance while it is small
    assert near[0].spread == pytest.approx(2 * 0.1**2)
    assert near[2].spread - near[0].spread == pytest.approx((0.5 * 0.1) ** 2, rel=0.02)


def test_far_away_the_spread_is_that_of_two_strangers():
    far = Kriging(at(50.0), HERE, 0.1, 0.5)
    assert far.spread == pytest.approx(2 * (0.5 * LENGTH) ** 2 + 2 * 0.1**2)


@pytest.mark.parametrize("count", [2, 5])
def test_references_at_one_state_are_averaged(count):
    found = Kriging(at(*count * [0.3]), np.array([0.3, 0.0]), 0.1, 0.5)
    assert found.weights == pytest.approx(np.full(count, 1 / count))
    assert found.spread == pytest.approx(0.1**2 * (1 + 1 / count))


def test_scatter_and_change_with_the_state_are_told_apart():
    same = Kriging(at(0.3, 0.3), np.array([0.3, 0.0]), 0.1, 0.5)
    assert same.parts == pytest.approx([0.1**2 * (1 + 1 / 2), 0.0, 0.0], abs=1e-12)
    far = Kriging(at(50.0), HERE, 0.1, 0.5)
    assert far.parts == pytest.approx([2 * 0.1**2, 2 * (0.5 * LENGTH) ** 2, 0.0])


def test_between_two_references_it_interpolates_and_is_surer_than_beside_one():
    between = Kriging(at(-0.2, 0.2), HERE, 0.01, 0.5)
    assert between.weights == pytest.approx([0.5, 0.5])
    assert between.spread < 0.1 * Kriging(at(0.2), HERE, 0.01, 0.5).spread


def test_a_straight_course_is_followed_between_references():
    found = Kriging(at(-0.3, 0.0, 0.3), np.array([0.15, 0.0]), 1e-3, 0.5)
    assert found.weights @ np.array([-0.3, 0.0, 0.3]) == pytest.approx(0.15, abs=0.02)


@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=6),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
)
def test_one_more_reference_never_makes_it_less_sure(known, more, state):
    one = Kriging(np.array(known), np.array(state), 0.06, 0.5)
    two = Kriging(np.array([*known, more]), np.array(state), 0.06, 0.5)
    assert one.weights.sum() == pytest.approx(1.0)
    assert two.spread <= one.spread * (1 + 1e-9)


def test_what_changes_with_the_load_is_told_from_what_changes_with_the_speed():
    near = Kriging(np.array([[0.1, 0.2]]), HERE, 0.1, 0.5)
    # while they are small, squares of slope times distance in each direction
    assert near.parts[1:] == pytest.approx([(0.5 * 0.1) ** 2, (0.5 * 0.2) ** 2], rel=0.06)
    assert near.spread == pytest.approx(Kriging(at(0.05**0.5), HERE, 0.1, 0.5).spread)


def profile(*change_np, heard=True, speed_hz=20.0, swing=0.0):
    """Levels of mesh harmonics, and of a family that is none and moves otherwise."""
    names = (*(f"mesh 1 harmonic {k}" for k in range(1, len(change_np) + 1)), "shaft 1")
    own = SimpleNamespace(
        family_names=names,
        level_db=20 / np.log(10) * np.array([[*change_np, 3.0]]),
        scatter_db=np.zeros((1, len(names))),
        heard=np.array([[*np.broadcast_to(heard, len(change_np)), True]]),
        speed_hz=speed_hz,
        speed_fluctuation=swing,
    )
    own.of_families = partial(Profile.of_families, own)
    return own


#: How the harmonics of a lightly loaded machine follow its load; their median does not.
UNEVEN = np.array([2.2, 1.6, 0.1, 0.0, -0.1, -0.9, 0.2])


def test_one_reference_takes_the_median_mesh_harmonic_for_the_load():
    gauge = StateGauge([profile(*0.0 * UNEVEN)], 0.2)
    load, speed, swing = gauge.state(profile(*-0.5 + 0.1 * UNEVEN, speed_hz=20.6, swing=0.06))
    assert load == pytest.approx(-0.5 + 0.1 * np.median(UNEVEN))
    assert speed == pytest.approx(0.03 / SPEED_UNIT)
    assert swing == pytest.approx((0.06 / FLUCTUATION_UNIT) ** 2)
    muffled = profile(*4 * [-9.0], *3 * [-0.5], heard=[*4 * [False], *3 * [True]])
    assert gauge.state(muffled)[0] == pytest.approx(-0.5)


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0, 2.0])
def test_lightly_loaded_references_teach_how_the_harmonics_follow_the_load(share):
    loads = np.log([1.0, 0.75, 0.5])
    references = [profile(*load * UNEVEN) for load in loads]
    gauge = StateGauge(references, share)
    between, heavier = (gauge.state(profile(*x * UNEVEN))[0] for x in np.log([0.6, 1.2]))
    size = np.sqrt(np.mean(UNEVEN**2))
    if share < 1.5:
        assert between == pytest.approx(size * np.log(0.6), rel=0.1)
        assert heavier == pytest.approx(size * np.log(1.2), rel=0.1)
    else:
        # of fully loaded teeth all follow alike, whatever a few of them do
        assert between == pytest.approx(np.median(UNEVEN) * np.log(0.6))


def test_references_of_one_load_teach_nothing():
    rng = np.random.default_rng(3)
    alike = [profile(*0.03 * rng.normal(size=7)) for _ in range(3)]
    gauge = StateGauge(alike, 0.1)
    assert np.all(np.abs(gauge.direction[0, :7] - 1.0) < 0.25)
