"""Signals against angle: tones keep amplitude and phase, nothing folds, nothing is delayed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.synthetic_signals import constant_track, lines_on, track_of, wandering_turns, white

from gearmon.errors import ArgumentError, RecordingError
from gearmon.signals.orders import angular_waveform
from gearmon.signals.orders.resampling import PASSED, AngleGrid, resample_to_angle

RATE, COUNT = 2000.0, 40_000
TIME = np.arange(COUNT) / RATE


def shaft(speed_hz=20.0, wander=0.01, seed=1):
    def turns(time_s):
        return wandering_turns(time_s, speed_hz, wander, seed)

    return turns, track_of(turns, TIME[-1], 800)


def tone(share, at=TIME):
    return np.sin(2 * np.pi * share * RATE * at + 0.3)


# as many samples a turn as the recording has, and a tenth fewer: then a low-pass is in the way
@pytest.mark.parametrize("fewer", [None, 0.9])
@pytest.mark.parametrize("wander", [0.0, 0.01, 0.03])
@pytest.mark.parametrize("speed_hz", [5.3, 20.0, 33.0, 61.0])
@pytest.mark.parametrize(("share", "bound"), [(0.1, 1e-5), (0.3, 1e-4)])
def test_tone_is_read_right_a_turn_away_from_the_ends(share, bound, speed_hz, wander, fewer):
    track = shaft(speed_hz, wander)[1]
    steps = None if fewer is None else int(fewer * RATE / speed_hz)
    found = angular_waveform(tone(share)[None], RATE, track, steps)
    truth = tone(share, track.time_at(found.angle_turns))
    inner = slice(found.per_turn, -found.per_turn)
    assert np.abs(found.values[0] - truth)[inner].max() < bound


@pytest.mark.parametrize("order", [51, 64, 90, 118])
def test_what_would_fold_is_taken_out(order):
    # 100 samples a turn: order 64 would be read as 36
    turns, track = shaft(5.0)
    samples = lines_on(turns(TIME), order, 3.0)
    found = angular_waveform(samples, RATE, track, 100)
    inner = found.values[0, 400:-400]
    assert np.abs(inner).max() < 3.0 * 5e-5
    naive = resample_to_angle(
        samples, RATE, track, AngleGrid(per_turn=100, first_turn=1.0, count=9_000)
    )
    assert np.abs(naive).max() > 2.9


@pytest.mark.parametrize("steps", [50, 64, 100, 137])
def test_orders_that_pass_keep_amplitude_and_phase(steps):
    # slopes of the angle track are right to some 1e-5 of a turn: a smooth and steady shaft
    track = constant_track(8.0, TIME[-1])
    order = PASSED * steps - 0.3
    samples = lines_on(8.0 * TIME, order, 2.0, 0.7)
    found = angular_waveform(samples, RATE, track, steps)
    expected = 2.0 * np.cos(2 * np.pi * order * found.angle_turns + 0.7)
    assert found.top_order == pytest.approx(PASSED * steps)
    inner = slice(2 * steps, -2 * steps)
    np.testing.assert_allclose(found.values[0, inner], expected[inner], atol=2e-5)


@pytest.mark.parametrize("per_turn", [None, 60])
def test_pulse_stays_where_it_is(per_turn):
    # group delay zero: a symmetric event is symmetric about its own place
    track = constant_track(10.0, TIME[-1])
    middle = 10.0 + 7 / 30
    samples = np.exp(-0.5 * ((TIME - middle) / 0.004) ** 2)[None]
    found = angular_waveform(samples, RATE, track, per_turn)
    weight = found.values[0] ** 2
    centre = np.sum(weight * found.angle_turns) / weight.sum()
    assert centre == pytest.approx(10.0 * middle, abs=1e-6)


@pytest.mark.parametrize("ratio", [0.4, 23 / 57, 1.0, 2.5, 31 / 12])
def test_any_shaft_by_its_ratio(ratio):
    turns, track = shaft()
    samples = lines_on(ratio * turns(TIME), [3.0], [1.5], 0.4)
    found = angular_waveform(samples, RATE, track.of_shaft(ratio), 30)
    assert found.turns == pytest.approx(ratio * turns(TIME[-1]), abs=2)
    expected = 1.5 * np.cos(2 * np.pi * 3 * found.angle_turns + 0.4)
    np.testing.assert_allclose(found.values[0, 90:-90], expected[90:-90], atol=1e-3)


def test_constant_stays_constant_to_the_ends():
    track = constant_track(20.0, TIME[-1])
    for steps in (None, 12):
        found = angular_waveform(np.full((1, COUNT), 9.81), RATE, track, steps)
        np.testing.assert_allclose(found.values, 9.81, rtol=1e-9)


@pytest.mark.parametrize("rounding", [-1e-12, 0.0, 1e-12])
@pytest.mark.parametrize("first", [0, 3])
def test_turns_that_begin_or_end_with_the_recording_are_whole_but_for_rounding(first, rounding):
    track = track_of(lambda time_s: first + rounding + time_s, 8.0, 2)
    found = angular_waveform(white((1, 801), seed=1), 100.0, track, 20)
    assert (found.first_turn, found.turns) == (first, 8)


@given(st.floats(-1e3, 1e3), st.integers(0, 1000), st.sampled_from([None, 40]))
def test_linear_and_channels_stay_apart(factor, seed, steps):
    track = constant_track(20.0, 2.0)
    samples = white((2, 4001), seed=seed)
    one, two = angular_waveform(samples, RATE, track, steps).values
    mixed = np.stack([samples[1], samples[0] + factor * samples[1]])
    found = angular_waveform(mixed, RATE, track, steps).values
    np.testing.assert_allclose(found, [two, one + factor * two], atol=1e-9 * (1 + abs(factor)))


@pytest.mark.parametrize("steps", [3, 0, -5, 10.5])
def test_impossible_samples_a_turn_are_refused(steps):
    with pytest.raises(ArgumentError, match=f"per_turn={steps} must be a whole number"):
        angular_waveform(np.zeros((1, COUNT)), RATE, constant_track(20.0, TIME[-1]), steps)


def test_less_than_a_turn_is_refused():
    with pytest.raises(RecordingError, match="none of them whole"):
        angular_waveform(np.zeros((1, 50)), RATE, constant_track(20.0, 49 / RATE))


@pytest.mark.parametrize("order", [0.0, -1.0, np.inf])
def test_impossible_shafts_are_refused(order):
    with pytest.raises(ArgumentError, match="shaft_order"):
        constant_track(20.0, TIME[-1]).of_shaft(order)
