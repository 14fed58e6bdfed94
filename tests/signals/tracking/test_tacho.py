"""Tachometer: edges between samples, repairs counted, and refusals instead of guesses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.synthetic_signals import wandering_turns, white

from gearmon.errors import RecordingError
from gearmon.signals.tracking import TachoPulses, find_pulses, pulses_per_turn, track_from_pulses
from gearmon.signals.tracking.tacho import track_through

RATE = 10_000.0
DURATION = 10.0
TIME = np.arange(int(RATE * DURATION)) / RATE


def waveform(turns, per_turn=1, shares=None, width=0.1):
    """Pulses with edges that last two samples, so that they can be found between samples."""
    shares = np.arange(per_turn) / per_turn if shares is None else np.asarray(shares)
    speed = np.gradient(turns, 1 / RATE)
    total = np.zeros(len(turns))
    for share in shares:
        distance = (turns - share + 0.5) % 1.0 - 0.5  # turns past this pulse's rising edge
        rising = np.clip(0.5 + distance * RATE / (2 * speed), 0, 1)
        falling = np.clip(0.5 + (distance - width / len(shares)) * RATE / (2 * speed), 0, 1)
        total += np.where(np.abs(distance) < 0.45 / len(shares), rising - falling, 0.0)
    return total


def steady(speed_hz=20.0, start=0.25):
    return start + speed_hz * TIME


def without(times, chosen):
    return np.delete(times, chosen)


def square(times, width_s=0.004):
    """A waveform that is high for a while from each of the given times on."""
    wave = np.zeros(len(TIME))
    for start in times:
        wave[round(start * RATE) : round((start + width_s) * RATE)] = 5.0
    return wave


def test_edges_are_found_between_samples():
    pulses = find_pulses(waveform(steady()), RATE)
    expected = (np.arange(1, 200 + 1) - 0.25) / 20.0
    np.testing.assert_allclose(pulses.time_s, expected[expected < DURATION], atol=1e-9)
    assert (pulses.missing, pulses.extra) == (0, 0)


@given(st.floats(1e-3, 1e3), st.floats(-100.0, 100.0))
def test_unit_and_offset_of_the_channel_do_not_matter(factor, offset):
    plain = find_pulses(waveform(steady()), RATE).time_s
    found = find_pulses(factor * waveform(steady()) + offset, RATE).time_s
    np.testing.assert_allclose(found, plain, atol=1e-7)


def test_noise_at_the_edges_makes_no_extra_pulses():
    noisy = find_pulses(5 * waveform(steady()) + white(len(TIME), 0.1, seed=1), RATE)
    assert len(noisy.time_s) == 200
    assert (noisy.missing, noisy.extra) == (0, 0)


@pytest.mark.parametrize("per_turn", [1, 2, 6, 60])
def test_track_follows_a_wandering_shaft(per_turn):
    turns = 0.25 + wandering_turns(TIME, 20.0, 0.01, seed=2)
    pulses = find_pulses(waveform(turns, per_turn), RATE)
    track = track_from_pulses(pulses, per_turn, 1.0, TIME[-1])
    first = pulses.time_s[0]
    offset = np.interp(first, TIME, turns)
    inner = (first < TIME) & (TIME < DURATION - 0.1)
    error = track.turns_at(TIME[inner]) - (turns[inner] - offset)
    assert np.abs(error).max() < 6e-4
    assert track.method == "tacho"


def test_uneven_pulses_do_not_matter():
    turns = 0.25 + wandering_turns(TIME, 20.0, 0.01, seed=2)
    pulses = find_pulses(waveform(turns, shares=[0.0, 0.3, 0.66]), RATE)
    assert (pulses.missing, pulses.extra) == (0, 0)
    track = track_from_pulses(pulses, 3, 1.0, TIME[-1])
    true = np.interp(track.time_s[1:-1], TIME, turns)
    np.testing.assert_allclose(np.diff(true), np.diff(track.turns[1:-1]), atol=1e-4)


@pytest.mark.parametrize("order", [0.25, 1.0, 2.5])
def test_tacho_on_another_shaft_counts_turns_of_the_first(order):
    pulses = find_pulses(waveform(steady()), RATE)
    track = track_from_pulses(pulses, 1, order, TIME[-1])
    np.testing.assert_allclose(track.speed_hz, 20.0 / order, rtol=1e-6)
    assert track.turns_at(pulses.time_s[:1]) == pytest.approx(0.0, abs=1e-9)


def test_track_reaches_from_end_to_end_of_the_recording():
    track = track_from_pulses(find_pulses(waveform(steady()), RATE), 1, 1.0, TIME[-1])
    np.testing.assert_allclose(track.time_s[[0, -1]], [0.0, TIME[-1]])
    np.testing.assert_allclose(track.turns[-1] - track.turns[0], 20 * TIME[-1], rtol=1e-9)


def test_uncertainty_is_the_jitter_of_the_pulses():
    jitter = white(400, 1e-5, seed=3)
    times = 0.01 + np.arange(400) / 40.0 + jitter
    pulses = TachoPulses(time_s=times, missing=0, extra=0)
    track = track_from_pulses(pulses, 1, 1.0, 10.0)
    assert track.uncertainty_turns == pytest.approx(1e-5 * 40, rel=0.15)


def test_a_shaft_that_speeds_up_evenly_has_no_jitter():
    # an angle of 20 t + t^2 turns: 20 to 40 turns a second within 10 s
    times = -10 + np.sqrt(100 + np.arange(1.0, 300.0))
    jitter = white(len(times), 1e-5, seed=3)
    for scatter in 0.0, 1e-5:
        pulses = TachoPulses(time_s=times + scatter / 1e-5 * jitter, missing=0, extra=0)
        track = track_from_pulses(pulses, 1, 1.0, 10.0)
        assert track.uncertainty_turns == pytest.approx(scatter * 30, abs=5e-5)


@pytest.mark.parametrize("gone", [[50], [50, 120], [80, 81]])
def test_missing_pulses_are_filled_in_and_counted(gone):
    times = 0.0125 + np.arange(199) / 20.0
    pulses = find_pulses(square(without(times, gone)), RATE)
    assert (pulses.missing, pulses.extra) == (len(gone), 0)
    np.testing.assert_allclose(pulses.time_s, times, atol=1.5 / RATE)


@pytest.mark.parametrize("more", [[5.03], [2.03, 7.03], [5.0]])
def test_extra_pulses_are_left_out_and_counted(more):
    times = 0.0125 + np.arange(199) / 20.0
    pulses = find_pulses(square(np.sort([*times, *more])), RATE)
    assert (pulses.missing, pulses.extra) == (0, len(more))
    np.testing.assert_allclose(pulses.time_s, times, atol=1.5 / RATE)


def test_repairs_of_both_kinds_leave_the_angle_right():
    turns = 0.25 + wandering_turns(TIME, 20.0, 0.005, seed=4)
    whole = np.interp(np.arange(1, 199), turns, TIME)
    spoilt = np.sort([*without(whole, [60]), whole[150] + 0.02])
    pulses = find_pulses(square(spoilt), RATE)
    assert (pulses.missing, pulses.extra) == (1, 1)
    track = track_from_pulses(pulses, 1, 1.0, TIME[-1])
    inner = (TIME > 0.1) & (TIME < 9.8)
    error = track.turns_at(TIME[inner]) - turns[inner]
    assert np.ptp(error) < 0.01


@pytest.mark.parametrize("share", [0.03, 0.2])
def test_more_than_two_per_cent_missing_is_refused(share):
    times = 0.0125 + np.arange(199) / 20.0
    gone = np.linspace(10, 188, round(share * 199)).astype(int)
    with pytest.raises(RecordingError, match=r"pulses missing.*at most 2 % can be repaired"):
        find_pulses(square(without(times, gone)), RATE)


def test_more_than_two_per_cent_extra_is_refused():
    times = 0.0125 + np.arange(199) / 20.0
    more = times[5:190:20] + 0.015
    with pytest.raises(RecordingError, match=r"too many among \d+; at most 2 % can be repaired"):
        find_pulses(square(np.sort([*times, *more])), RATE)


@pytest.mark.parametrize(
    "channel",
    [
        pytest.param(white(len(TIME), seed=5), id="noise"),
        pytest.param(
            np.convolve(white(len(TIME), seed=6), np.hanning(60), "same"), id="slow noise"
        ),
        pytest.param(
            np.sin(2 * np.pi * 523.7 * TIME) * (1 + np.sin(2 * np.pi * 20 * TIME))
            + white(len(TIME), 0.4, seed=7),
            id="vibration",
        ),
    ],
)
def test_wrong_channel_is_refused(channel):
    with pytest.raises(RecordingError, match=r"tacho channel: .*(Check|Name)"):
        find_pulses(channel, RATE)


@pytest.mark.parametrize("channel", [np.zeros(1000), np.linspace(0, 1, 1000), square([1, 2, 3])])
def test_fewer_than_four_pulses_are_refused(channel):
    with pytest.raises(RecordingError, match=r"pulses found between .*at least 4 are needed"):
        find_pulses(channel, RATE)


@pytest.mark.parametrize(("first", "last"), [(20.0, 24.0), (24.0, 20.0), (20.0, 26.0)])
def test_ramps_need_no_repair(first, last):
    turns = 0.25 + first * TIME + (last - first) * TIME**2 / (2 * DURATION)
    pulses = find_pulses(waveform(turns), RATE)
    assert (pulses.missing, pulses.extra) == (0, 0)


@pytest.mark.parametrize(("first", "last"), [(10.0, 30.0), (30.0, 10.0)])
def test_run_up_and_run_down_need_no_repair(first, last):
    turns = 0.25 + first * TIME + (last - first) * TIME**2 / (2 * DURATION)
    pulses = find_pulses(waveform(turns), RATE)
    assert (pulses.missing, pulses.extra) == (0, 0)


def test_three_turns_at_least():
    pulses = TachoPulses(time_s=np.arange(6) / 10.0, missing=0, extra=0)
    with pytest.raises(RecordingError, match="2 turns recorded, at least 3 are needed"):
        track_from_pulses(pulses, 3, 1.0, 1.0)


@pytest.mark.parametrize("kept", [slice(None, 120), slice(80, None), slice(30, 160)])
def test_pulses_of_a_part_of_the_recording_do_not_tell_the_rest(kept):
    times = 0.0125 + np.arange(199) / 20.0
    few = f"{199 - len(times[kept])} are missing beside them"
    with pytest.raises(RecordingError, match=few):
        track_from_pulses(TachoPulses(time_s=times[kept]), 1, 1.0, 9.93)
    assert track_from_pulses(TachoPulses(time_s=times[1:-1]), 1, 1.0, 9.93).method == "tacho"


def evenly(rate_hz):
    return TachoPulses(time_s=np.arange(200) / rate_hz, missing=0, extra=0)


@pytest.mark.parametrize("count", [1, 2, 6])
@pytest.mark.parametrize("slip", [-0.03, 0.0, 0.03])
def test_pulses_a_turn_are_told_from_the_nominal_speed(count, slip):
    assert pulses_per_turn(evenly(count * 25.0 * (1 + slip)), 25.0) == (count,)


@pytest.mark.parametrize(
    ("slowest", "fastest", "counts"),
    [(0.6, 1.1, (1,)), (1.2, 2.2, (2,)), (0.3, 1.0, (1,)), (1.0, 2.1, (1, 2)), (1.8, 3.3, (2, 3))],
)
def test_every_count_is_told_with_which_the_speed_passes_the_nominal_one(slowest, fastest, counts):
    # the speed rises evenly for 20 s: the angle is a parabola
    time_s = np.linspace(0.0, 20.0, 40_001)
    pulses = 25.0 * (slowest * time_s + (fastest - slowest) * time_s**2 / 40.0)
    found = np.interp(np.arange(1, int(pulses[-1])), pulses, time_s)
    assert pulses_per_turn(TachoPulses(time_s=found, missing=0, extra=0), 25.0) == counts


@pytest.mark.parametrize("rate_hz", [12.0, 37.0, 60.0])
def test_pulses_that_fit_no_whole_number_are_refused(rate_hz):
    with pytest.raises(RecordingError, match="not within 5% of a whole number"):
        pulses_per_turn(evenly(rate_hz), 25.0)


@pytest.mark.parametrize(("count", "slip"), [(20, -0.03), (30, 0.02), (60, -0.01)])
def test_many_pulses_a_turn_are_asked_for_and_not_guessed(count, slip):
    # 60 pulses at 1 % slip come at 59.4 a nominal turn: 59 and 60 are equally possible
    with pytest.raises(RecordingError, match="pulses_per_turn"):
        pulses_per_turn(evenly(count * 25.0 * (1 + slip)), 25.0)


def test_a_waveform_is_no_row_of_pulse_times():
    wave = np.sin(2 * np.pi * 25 * np.arange(2000) / 5000)
    with pytest.raises(RecordingError, match=r"does not come after .* give it to find_pulses"):
        track_from_pulses(TachoPulses(time_s=wave), 1, 1.0, 0.4)
    with pytest.raises(RecordingError, match="pulse 3 has no finite time"):
        TachoPulses(time_s=np.array([0.0, 1.0, np.nan, 3.0]))
    with pytest.raises(RecordingError, match="a row of at least 4 times is needed"):
        TachoPulses(time_s=np.zeros((2, 5)))


@given(st.integers(0, 1000), st.integers(2, 9))
def test_a_track_holds_the_angles_that_are_known_and_goes_straight_beyond_them(seed, knots):
    rng = np.random.default_rng(seed)
    time_s, turns = 1.0 + np.cumsum(rng.uniform(0.1, 1.0, (2, knots)), axis=1)
    track = track_through(time_s, turns, 12.0)
    assert (track.time_s[0], track.time_s[-1]) == (0.0, 12.0)
    inside = slice(1, -1)
    known = np.interp(track.time_s[inside], time_s, turns)
    np.testing.assert_allclose(track.turns[inside], known, rtol=1e-12)
    speed = np.diff(turns) / np.diff(time_s)
    assert track.speed_hz[[0, -1]] == pytest.approx(speed[[0, -1]])
