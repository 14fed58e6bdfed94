"""Uneven pulses, encoders, falling edges and times of pulses, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.synthetic_signals import wandering_turns, white

from gearmon.errors import ArgumentError, RecordingError
from gearmon.signals.tracking import TachoPulses, find_pulses, track_from_pulses
from gearmon.signals.tracking.tacho import (
    is_even,
    learn_spacing,
    repair,
    track_from_pulse_times,
)

RATE, DURATION = 20_000.0, 10.0
TIME = np.arange(int(RATE * DURATION)) / RATE
# a zebra tape whose joint makes one gap wide, stripes painted by hand, two bolts side by side
SPACINGS = {
    "tape": np.arange(8) / 8.4,
    "paint": np.array([0.0, 0.21, 0.55, 0.68]),
    "bolts": np.array([0.0, 0.12]),
}


def turns_of(time_s, wander=0.01, speed_hz=20.0, seed=0):
    return 0.3 + wandering_turns(time_s, speed_hz, wander, seed)


def pulse_times(spacing, wander=0.01, seed=0, jitter_s=0.0):
    """Times at which a wandering shaft shows its stripes, the first whole turn on."""
    turns = turns_of(TIME, wander, seed=seed)
    angles = (np.arange(1, int(turns[-1]))[:, None] + spacing).ravel()
    times = np.interp(angles, turns, TIME)
    return times + jitter_s * np.random.default_rng(seed).standard_normal(len(times))


def square(times, width_s=0.001):
    """A waveform with edges of two samples, high for a while from each of the times on."""
    wave = np.zeros(len(TIME))
    for start in times:
        near = slice(max(0, int((start - 0.001) * RATE)), int((start + width_s + 0.001) * RATE))
        rise = np.clip(0.5 + (TIME[near] - start) * RATE / 2, 0, 1)
        fall = np.clip(0.5 + (TIME[near] - start - width_s) * RATE / 2, 0, 1)
        wave[near] += rise - fall
    return wave


def angle_error(track, wander=0.01, seed=0):
    """Departure from the true angle a turn from the ends, without the offset [turns]."""
    inner = TIME[2000:-2000:50]
    error = track.turns_at(inner) - turns_of(inner, wander, seed=seed)
    return error - error.mean()


@pytest.mark.parametrize("kind", SPACINGS)
def test_pulses_that_come_late_in_some_turns_are_no_spacing(kind):
    """A belt that slips, or dirt on a stripe: a fifth of the turns, by a tenth of a turn."""
    spacing = SPACINGS[kind]
    times = 0.05 * (np.arange(100)[:, None] + spacing)
    times[7::5, 1:] += 0.005
    learned = learn_spacing(times.ravel(), len(spacing))
    np.testing.assert_allclose(learned, spacing, atol=1e-9)


@pytest.mark.parametrize("kind", SPACINGS)
def test_spacing_is_learned_to_a_ten_thousandth_of_a_turn(kind):
    spacing = SPACINGS[kind]
    learned = learn_spacing(pulse_times(spacing), len(spacing))
    np.testing.assert_allclose(learned, spacing, atol=1e-4)


@given(
    st.lists(st.floats(0.05, 1.0), min_size=2, max_size=12),
    st.floats(-0.3, 0.3),
)
def test_any_spacing_is_learned_on_any_ramp(gaps, ramp):
    spacing = np.concatenate([[0.0], np.cumsum(gaps)[:-1]]) / sum(gaps)
    angles = (np.arange(100)[:, None] + spacing).ravel()
    # angle = 20 t + ramp t^2: the times are known in closed form
    times = angles / 20 if abs(ramp) < 1e-6 else (np.sqrt(400 + 4 * ramp * angles) - 20) / 2 / ramp
    np.testing.assert_allclose(learn_spacing(times, len(spacing)), spacing, atol=1e-5)


def test_spacing_of_a_steady_shaft_is_exact_in_few_turns():
    times = (np.arange(3)[:, None] + SPACINGS["paint"]).ravel() / 20
    np.testing.assert_allclose(learn_spacing(times, 4), SPACINGS["paint"], atol=1e-12)


@pytest.mark.parametrize("kind", SPACINGS)
def test_angle_from_uneven_pulses_is_right_between_them(kind):
    spacing = SPACINGS[kind]
    pulses = find_pulses(square(pulse_times(spacing)), RATE, len(spacing))
    assert (pulses.missing, pulses.extra) == (0, 0)
    track = track_from_pulses(pulses, len(spacing), 1.0, TIME[-1])
    assert np.abs(angle_error(track)).max() < 3e-4


@pytest.mark.parametrize("kind", SPACINGS)
@pytest.mark.parametrize("seed", range(3))
def test_missing_and_extra_pulses_are_told_from_uneven_ones(kind, seed):
    spacing = SPACINGS[kind]
    whole = pulse_times(spacing, seed=seed)
    generator = np.random.default_rng(seed)
    gone = generator.choice(np.arange(10, len(whole) - 10), 2, replace=False)
    place = int(generator.integers(10, len(whole) - 10))
    while min(abs(place - gone)) < 3 * len(spacing):
        place = int(generator.integers(10, len(whole) - 10))
    # half way into the widest of the gaps beside it, where it can be no stripe
    widest = place + int(np.argmax(np.diff(whole[place : place + len(spacing) + 1])))
    more = 0.5 * (whole[widest] + whole[widest + 1])
    spoilt = np.sort(np.append(np.delete(whole, gone), more))
    fixed = repair(spoilt, len(spacing))
    assert (fixed.missing, fixed.extra) == (2, 1)
    np.testing.assert_allclose(fixed.time_s, whole, atol=1e-3)


@pytest.mark.parametrize("per_turn", [2, 5, 60])
def test_sound_sequences_are_left_alone(per_turn):
    times = pulse_times(np.arange(per_turn) / per_turn)
    fixed = repair(times, per_turn)
    assert (fixed.missing, fixed.extra) == (0, 0)
    np.testing.assert_array_equal(fixed.time_s, times)


def test_too_many_repairs_of_uneven_pulses_are_refused():
    whole = pulse_times(SPACINGS["paint"])
    with pytest.raises(RecordingError, match=r"pulses missing.*at most 2 % can be repaired"):
        repair(np.delete(whole, np.arange(40, len(whole) - 5, 23)), 4)


def test_falling_edges_are_those_of_the_inverted_waveform():
    times = pulse_times(np.zeros(1))
    falling = find_pulses(-square(times, 0.004), RATE).time_s
    np.testing.assert_allclose(falling, times + 0.004, atol=1e-6)


def test_bounces_by_less_than_the_hysteresis_are_ignored():
    times = pulse_times(np.zeros(1))
    bouncing = 0.58 * square(times + 0.0003, 0.0004)  # the level falls to 0.42 and comes back
    wave = square(times, 0.002) - bouncing
    assert len(find_pulses(wave, RATE).time_s) == len(times)


def test_pulse_times_give_the_same_track_as_their_waveform():
    times = pulse_times(SPACINGS["paint"])
    direct = track_from_pulse_times(times, TIME[-1], 4)
    sampled = track_from_pulses(find_pulses(square(times), RATE, 4), 4, 1.0, TIME[-1])
    np.testing.assert_allclose(direct.turns_at(TIME[::99]), sampled.turns_at(TIME[::99]), atol=1e-5)
    assert np.abs(angle_error(direct)).max() < 3e-4


def test_encoder_pulses_are_averaged():
    times = pulse_times(np.arange(512) / 512, jitter_s=2e-6)
    track = track_from_pulse_times(times, TIME[-1], 512)
    assert len(track.time_s) < 20 * 16 * DURATION
    assert angle_error(track).std() < 2e-6 * 20


@pytest.mark.parametrize("kind", ["paint", "tape"])
@pytest.mark.parametrize("jitter_s", [2e-5, 1e-4])
def test_uncertainty_is_the_jitter_of_uneven_pulses(kind, jitter_s):
    times = pulse_times(SPACINGS[kind], wander=0.001, jitter_s=jitter_s)
    track = track_from_pulse_times(np.sort(times), TIME[-1], len(SPACINGS[kind]))
    assert track.uncertainty_turns == pytest.approx(20 * jitter_s, rel=0.15)


def test_a_waveform_is_no_row_of_pulse_times():
    wave = square(pulse_times(np.zeros(1))) + white(len(TIME), 1e-3)
    with pytest.raises(RecordingError, match=r"does not come after .* to find_pulses"):
        track_from_pulse_times(wave, TIME[-1])


def test_pulse_times_are_no_waveform():
    with pytest.raises(RecordingError, match=r"only rise, .* give those to track_from_pulse_times"):
        find_pulses(pulse_times(np.zeros(1)), RATE)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0.1, 0.2, 0.3], "at least 4 times"),
        ([[0.1, 0.2], [0.3, 0.4]], "a row of at least 4"),
        ([0.1, 0.2, float("nan"), 0.4, 0.5], "pulse 3 has no finite time"),
        ([0.1, 0.2, 0.2, 0.4, 0.5], "pulse 3 at 0.2 s does not come after pulse 2"),
    ],
)
def test_what_are_no_pulse_times_is_refused(times, message):
    with pytest.raises(RecordingError, match=message):
        repair(times)


def test_track_needs_pulses_per_turn_above_zero():
    pulses = TachoPulses(time_s=np.arange(9.0), missing=0, extra=0)
    with pytest.raises(ArgumentError, match="pulses_per_turn"):
        track_from_pulses(pulses, 0, 1.0, 9.0)


@pytest.mark.parametrize("per_turn", [6, 20])
@pytest.mark.parametrize("turns", [1.5, 2.9, 6.0])
@pytest.mark.parametrize("ramp", [-0.2, 0.0, 0.3])
def test_pulses_are_even_or_not_whatever_the_turns_and_the_ramp(per_turn, turns, ramp):
    """A quarter more of the gaps is uneven, a hundredth is not."""
    number = np.arange(int(turns * per_turn) + 1)
    for uneven, even in ((0.0, True), (0.01, True), (0.25, False)):
        place = (number + uneven * (number % 2)) / number[-1]
        assert is_even(place * (1 + 0.5 * ramp * (1 - place)), per_turn) == even
