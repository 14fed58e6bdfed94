"""Angle: tracks invert, tones survive resampling, grids lose nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.synthetic_signals import (
    band_limited,
    constant_track,
    lines_on,
    track_of,
    wandering_turns,
    white,
)
from scipy.interpolate import CubicHermiteSpline

from gearmon.errors import ArgumentError
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders import AngleGrid, resample_to_angle, resampling

RATE = 2000.0


def track(time_s, turns):
    return AngleTrack(
        time_s=np.array(time_s, dtype=float),
        turns=np.array(turns, dtype=float),
        method="tacho",
        uncertainty_turns=0.0,
    )


def wandering(duration_s=10.0, speed_hz=20.0, wander=0.01, seed=0):
    """A known angle, and a track through 400 of its points."""

    def turns(time_s):
        return wandering_turns(time_s, speed_hz, wander, seed)

    return turns, track_of(turns, duration_s, 400)


@pytest.mark.parametrize(("time_s", "turns"), [([0.0], [0.0]), ([0.0, 1.0], [0.0, 1.0, 2.0])])
def test_track_needs_two_matching_knots(time_s, turns):
    with pytest.raises(ArgumentError, match="two knots or more"):
        track(time_s, turns)


@pytest.mark.parametrize(
    ("time_s", "turns"),
    [
        ([0, 1, 2], [0, 5, 4]),
        ([0, 1, 2], [0, 5, 5]),
        ([0, 1, 1], [0, 5, 6]),
        ([0, 2, 1], [0, 1, 2]),
    ],
)
def test_track_must_increase(time_s, turns):
    with pytest.raises(ArgumentError, match="stands still or turns back"):
        track(time_s, turns)


def test_track_goes_through_its_knots_and_on_in_straight_lines():
    curve = track([0, 1, 2, 3], [0, 10, 21, 33])
    np.testing.assert_allclose(curve.turns_at(curve.time_s), curve.turns, rtol=1e-14)
    np.testing.assert_allclose(curve.turns_at(np.array([-1.0, 5.0])), [-10.0, 57.0])
    np.testing.assert_allclose(curve.speed_hz, [10, 11, 12])


def test_track_is_exact_where_time_is_a_parabola_of_the_angle():
    # slopes come from parabolas through neighbours, at the ends from straight lines
    angles = np.linspace(0, 200, 21)
    curve = track(0.05 * angles - 2e-5 * angles**2, angles)
    at = np.linspace(10, 190, 333)
    times = 0.05 * at - 2e-5 * at**2
    np.testing.assert_allclose(curve.time_at(at), times, rtol=1e-12)
    np.testing.assert_allclose(curve.turns_at(times), at, atol=1e-6)


def test_track_of_constant_acceleration_is_right_between_its_knots():
    time = np.linspace(0, 10, 101)
    curve = track(time, 20 * time + 0.5 * time**2)
    at = np.linspace(0.2, 9.8, 333)
    np.testing.assert_allclose(curve.turns_at(at), 20 * at + 0.5 * at**2, atol=1e-5)


def test_track_converges_with_the_third_order_at_least():
    def error(knots):
        at = np.linspace(1.0, 9.0, 1000)
        return np.abs(track_of(turns, 10.0, knots).turns_at(at) - turns(at)).max()

    turns = wandering()[0]
    orders = np.diff(np.log2([error(80), error(160), error(320)]))
    assert np.all(orders < -2.8)


@given(
    st.lists(st.floats(0.8, 1.2), min_size=2, max_size=60),
    st.floats(0.5, 200.0),
    st.integers(0, 1000),
)
def test_time_and_angle_invert_each_other(ratios, speed_hz, seed):
    interval = np.random.default_rng(seed).uniform(0.5, 2.0, len(ratios)) / speed_hz
    time = np.concatenate([[0.0], np.cumsum(interval)])
    curve = track(time, np.concatenate([[0.0], np.cumsum(speed_hz * np.array(ratios) * interval)]))
    angles = np.linspace(curve.turns[0] - 1, curve.turns[-1] + 1, 500)
    back = curve.turns_at(curve.time_at(angles))
    np.testing.assert_allclose(back, angles, atol=1e-3)


@pytest.mark.parametrize("wander", [0.0, 0.01, 0.05])
def test_time_and_angle_of_a_smooth_shaft_invert_to_a_millionth_of_a_turn(wander):
    curve = wandering(wander=wander)[1]
    angles = np.linspace(curve.turns[0], curve.turns[-1], 5000)
    np.testing.assert_allclose(curve.turns_at(curve.time_at(angles)), angles, atol=1e-6)


@pytest.mark.parametrize(("share", "bound"), [(0.02, 1e-6), (0.1, 1e-6), (0.3, 1e-4)])
def test_tone_survives_resampling_a_turn_away_from_the_ends(share, bound):
    assert tone_error(share, away=100) < bound


@pytest.mark.parametrize(("share", "bound"), [(0.1, 1e-5), (0.3, 1e-4)])
def test_tone_survives_resampling_far_from_the_ends(share, bound):
    assert tone_error(share, away=16_000) < bound


def tone_error(share, away):
    """Largest error of a tone resampled `away` samples from the ends."""
    count, speed_hz = 40_000, 20.0
    time = np.arange(count) / RATE
    curve = constant_track(speed_hz, time[-1])
    samples = np.sin(2 * np.pi * share * RATE * time + 0.3)[None, :]
    per_turn, first = 137, away / RATE * speed_hz
    wanted = int((curve.turns[-1] - 2 * first) * per_turn)
    found = resample_to_angle(
        samples, RATE, curve, AngleGrid(per_turn=per_turn, first_turn=first, count=wanted)
    )
    at = (first + np.arange(wanted) / per_turn) / speed_hz
    return np.abs(found[0] - np.sin(2 * np.pi * share * RATE * at + 0.3)).max()


def test_pieces_join_without_a_seam(monkeypatch):
    curve = wandering()[1]
    samples = band_limited(2, 20_000, seed=1)
    first, count = 20.0, 110 * 160
    whole = resample_to_angle(
        samples, RATE, curve, AngleGrid(per_turn=110, first_turn=first, count=count)
    )
    monkeypatch.setattr(resampling, "_CHUNK", 1000)
    pieces = resample_to_angle(
        samples, RATE, curve, AngleGrid(per_turn=110, first_turn=first, count=count)
    )
    assert np.abs(whole - pieces).max() < 2e-3


def test_line_locked_to_the_angle_stands_still_after_resampling():
    turns, curve = wandering()
    samples = lines_on(turns(np.arange(20_000) / RATE), [7.0], [2.0], 0.4)
    found = resample_to_angle(
        samples, RATE, curve, AngleGrid(per_turn=128, first_turn=1.0, count=128 * 190)
    )
    expected = 2.0 * np.cos(2 * np.pi * 7 * np.arange(128 * 190) / 128 + 0.4)
    assert np.abs(found[0] - expected).max() < 5e-4
    assert np.sqrt(np.mean((found[0] - expected) ** 2)) < 5e-5


def test_constant_stays_constant_to_the_ends():
    curve = constant_track(20.0, 999 / RATE)
    found = resample_to_angle(
        np.full((1, 1000), 9.81), RATE, curve, AngleGrid(per_turn=100, first_turn=0.0, count=999)
    )
    np.testing.assert_allclose(found, 9.81, rtol=1e-12)


@given(st.floats(-1e3, 1e3), st.integers(0, 1000))
def test_resampling_is_linear_and_channels_stay_apart(factor, seed):
    curve = constant_track(20.0, 1.0)
    samples = white((2, 2001), seed=seed)
    one, two = resample_to_angle(
        samples, RATE, curve, AngleGrid(per_turn=100, first_turn=0.5, count=1900)
    )
    mixed = np.stack([samples[1], samples[0] + factor * samples[1]])
    found = resample_to_angle(
        mixed, RATE, curve, AngleGrid(per_turn=100, first_turn=0.5, count=1900)
    )
    np.testing.assert_allclose(found, [two, one + factor * two], atol=1e-9 * (1 + abs(factor)))


@pytest.mark.parametrize(("first", "count"), [(-0.5, 100), (0.0, 2200)])
def test_angles_beyond_the_recording_are_refused(first, count):
    curve = constant_track(20.0, 1.0)
    with pytest.raises(ArgumentError, match="the recording from 0 to 2000"):
        resample_to_angle(
            np.zeros((1, 2001)), RATE, curve, AngleGrid(per_turn=100, first_turn=first, count=count)
        )


def test_grid_never_steps_further_than_the_samples():
    turns, curve = wandering(wander=0.05)
    grid = AngleGrid.of(20_000, RATE, curve, 10.0)
    at = curve.time_at(grid.first_turn + np.arange(grid.count) / grid.per_turn)
    assert np.diff(at).max() <= (1 + 1e-9) / RATE
    assert at[0] >= -1e-9
    assert at[-1] <= 19_999 / RATE
    assert grid.count / grid.per_turn > turns(19_999 / RATE) - 2 / grid.per_turn


def test_grid_has_room_for_the_highest_order():
    grid = AngleGrid.of(20_000, RATE, constant_track(20.0, 10.0), 400.0)
    assert grid.per_turn >= 880


def test_grid_of_a_short_recording_is_refused():
    with pytest.raises(ArgumentError, match="turns of shaft 1: too short"):
        AngleGrid.of(50, RATE, constant_track(20.0, 1.0), 1.0)


def test_uncertainty_counts_turns_of_the_shaft_it_is_told_for():
    fast = replace(track([0, 1], [0, 20]), uncertainty_turns=1e-3).of_shaft(3.5)
    assert fast.speed_hz == pytest.approx(70.0)
    assert fast.uncertainty_turns == pytest.approx(3.5e-3)


@pytest.mark.parametrize(
    "angle", [[5.0, 6.0], [0.0, 8.0, 20.0], [-3.0, 2.0, 9.0, 25.0], np.arange(0.0, 20.0, 0.25)]
)
def test_a_track_moved_by_a_straight_line_is_that_line_from_end_to_end(angle):
    """Wherever it is told: within the ends, at them or beyond; and times stay as they were."""
    angle = np.array(angle)
    old = constant_track(20.0, 1.0)
    new = old.moved(angle, 0.3 + 0.01 * angle, 2e-3)
    at = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(new.turns_at(at), 0.3 + 1.01 * old.turns_at(at), atol=1e-12)
    assert new.time_s[[0, -1]].tolist() == pytest.approx([0.0, 1.0])
    assert (new.uncertainty_turns, new.indexed) == (2e-3, False)


def test_a_parabola_through_uneven_knots_is_met_exactly():
    """Slopes are those of the parabolas through neighbours, however far apart these are."""
    turns = np.array([0.0, 1.0, 1.5, 3.5, 4.0, 6.0, 6.3, 9.0])
    track = AngleTrack(
        time_s=0.1 * turns + 4e-3 * turns**2, turns=turns, method="constant", uncertainty_turns=0.0
    )
    inside = np.linspace(1.0, 6.3, 200)
    np.testing.assert_allclose(track.time_at(inside), 0.1 * inside + 4e-3 * inside**2, rtol=1e-12)


@pytest.mark.parametrize(("start_s", "stop_s"), [(0.0, 10.0), (2.513, 7.77), (3.0, 3.02)])
def test_a_part_keeps_the_angle_of_the_whole(start_s, stop_s):
    turns, whole = wandering()
    part = whole.between(start_s, stop_s)
    assert part.time_s[0] == 0.0
    assert part.time_s[-1] == pytest.approx(stop_s - start_s, rel=1e-12)
    np.testing.assert_allclose(part.turns, whole.turns_at(part.time_s + start_s), atol=1e-9)
    time_s = np.linspace(start_s, stop_s, 200)
    np.testing.assert_allclose(part.turns_at(time_s - start_s), turns(time_s), atol=2e-4)


def test_time_and_slope_are_those_of_a_hermite_curve_in_whatever_order_they_are_asked_for():
    rng = np.random.default_rng(3)
    turns = np.cumsum(rng.uniform(0.5, 2.0, 300))
    curve = track(np.cumsum(rng.uniform(0.04, 0.06, 300)), turns)
    spline = CubicHermiteSpline(turns, curve.time_s, np.gradient(curve.time_s, turns))
    asked = rng.permutation(np.append(turns, rng.uniform(turns[0], turns[-1], 2000)))
    time_s, slope = curve.time_and_slope_at(asked)
    np.testing.assert_allclose(time_s, spline(asked), rtol=1e-13)
    np.testing.assert_allclose(slope, spline(asked, 1), rtol=1e-10)
    beyond = curve.time_at(np.array([turns[-1] + 4.0, turns[0] - 2.0]))
    ends = curve.time_s[[-1, 0]] + [4.0, -2.0] * spline(turns[[-1, 0]], 1)
    np.testing.assert_allclose(beyond, ends, rtol=1e-12)
    assert curve.time_at(turns[:0]).shape == (0,)
