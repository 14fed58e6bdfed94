"""Repair of pulse trains: right to a twelfth of an interval, or refused, and in linear time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gearmon.errors import RecordingError
from gearmon.signals.tracking.tacho import repair

LIMIT = 0.02
REFUSED = "Check the sensor"
# Pulses of the same shaft before and after those of the sensor: an extra one may stand for them.
BEYOND = 4


def train(count, rate_hz, ramp):
    """Pulses of a shaft whose speed changes evenly by `ramp` over the train, and a few beyond."""
    number = np.arange(-BEYOND, count + BEYOND) / count
    # angle = s + ramp s^2 / 2 of a time s that ends at about 1: solved for s
    place = number if abs(ramp) < 1e-9 else (np.sqrt(1 + 2 * ramp * number) - 1) / ramp
    return 1.0 + place * count / rate_hz


def check_repaired(beyond, spoilt, per_turn=1):
    """What comes back is the whole train, but for its ends, to a tenth of an interval."""
    whole = beyond[BEYOND:-BEYOND]
    found = repair(spoilt, per_turn).time_s
    nearest = np.clip(np.searchsorted(beyond, found), 1, len(beyond) - 1)
    nearest -= found - beyond[nearest - 1] < beyond[nearest] - found
    assert np.all(np.abs(found - beyond[nearest]) <= 0.1 * np.gradient(beyond)[nearest])
    # one after the other: none left out within, none twice
    np.testing.assert_array_equal(np.diff(nearest), 1)
    # what the sensor missed at an end cannot be known, what it saw must be there
    seen = whole[np.isin(whole, spoilt)]
    assert found[0] <= seen[0] + 1e-9
    assert found[-1] >= seen[-1] - 1e-9


@st.composite
def spoilt_trains(draw):
    count = draw(st.integers(12, 600))
    beyond = train(count, draw(st.floats(0.5, 500.0)), draw(st.floats(-0.4, 0.8)))
    whole = beyond[BEYOND:-BEYOND]
    wrong = draw(st.integers(0, max(2, int(LIMIT * count))))
    gone = draw(st.lists(st.integers(0, count - 1), max_size=wrong, unique=True))
    places = st.floats(float(beyond[2]), float(beyond[-3]))
    more = draw(st.lists(places, max_size=wrong - len(gone)))
    spoilt = np.unique(np.concatenate([np.delete(whole, gone), more]))
    assume(np.min(np.diff(spoilt)) > 1e-9)
    return beyond, spoilt


@given(spoilt_trains())
def test_any_even_or_ramped_train_is_repaired_or_refused(case):
    try:
        check_repaired(*case)
    except RecordingError as refusal:
        assert REFUSED in str(refusal)  # noqa: PT017 - either outcome is right


@given(spoilt_trains(), st.sampled_from([2, 4, 8]))
def test_so_is_one_of_several_pulses_a_turn(case, per_turn):
    # the spacing is learned from six turns
    assume(len(case[1]) > 6 * per_turn)
    try:
        check_repaired(*case, per_turn)
    except RecordingError as refusal:
        assert REFUSED in str(refusal)  # noqa: PT017


@given(st.data(), st.lists(st.floats(0.2, 1.0), min_size=2, max_size=6), st.floats(-0.2, 0.4))
def test_so_is_one_of_uneven_pulses(data, gaps, ramp):
    spacing = np.concatenate([[0.0], np.cumsum(gaps)[:-1]]) / sum(gaps)
    turns = data.draw(st.integers(12, 80))
    angle = (np.arange(turns)[:, None] + spacing).ravel() / turns
    whole = angle if abs(ramp) < 1e-9 else (np.sqrt(1 + 2 * ramp * angle) - 1) / ramp
    count = len(whole)
    wrong = data.draw(st.integers(0, max(2, int(LIMIT * count))))
    gone = data.draw(st.lists(st.integers(0, count - 1), max_size=wrong, unique=True))
    places = st.floats(0.0, float(whole[-1]))
    more = data.draw(st.lists(places, max_size=wrong - len(gone)))
    spoilt = np.unique(np.concatenate([np.delete(whole, gone), more]))
    assume(np.min(np.diff(spoilt)) > 1e-9)
    try:
        found = repair(spoilt, len(gaps)).time_s
    except RecordingError as refusal:
        assert REFUSED in str(refusal)  # noqa: PT017
        return
    nearest = np.argmin(np.abs(found[:, None] - whole), axis=1)
    # those that are missing at the end may be filled in beyond it
    inside = (found >= whole[0]) & (found <= whole[-1])
    interval = np.minimum(np.diff(whole, prepend=-1.0), np.diff(whole, append=9.0))
    off = np.abs(found - whole[nearest]) / interval[nearest]
    assert np.all(off[inside] <= 0.15)
    np.testing.assert_array_equal(np.diff(nearest[inside]), 1)


@given(st.lists(st.floats(1e-6, 10.0), min_size=3, max_size=40))
def test_whatever_comes_is_repaired_or_refused(intervals):
    times = np.cumsum([0.0, *intervals])
    try:
        found = repair(times).time_s
    except RecordingError as refusal:
        assert REFUSED in str(refusal)  # noqa: PT017
    else:
        assert np.all(np.diff(found) > 0)


def even(count=200):
    return 0.0125 + np.arange(count) / 20.0


def test_sound_pulses_keep_their_times():
    times = even() + 1e-4 * np.random.default_rng(0).standard_normal(200)
    assert repair(times).time_s is times


def test_a_pulse_at_a_wrong_time_is_both_missing_and_extra():
    times = even()
    times[80] += 0.015
    found = repair(times)
    assert (found.missing, found.extra) == (1, 1)
    np.testing.assert_allclose(found.time_s, even(), atol=1e-9)


@pytest.mark.parametrize("place", [-0.02, 9.985])
def test_extra_pulses_beyond_the_ends_are_left_out(place):
    found = repair(np.sort([*even(), place]))
    assert (found.missing, found.extra) == (0, 1)
    np.testing.assert_allclose(found.time_s, even(), atol=1e-12)


def test_pulses_twice_as_fast_for_a_while_are_unclear():
    times = even(2000)
    burst = 0.5 * (times[500:512] + times[501:513])
    with pytest.raises(
        RecordingError, match=r"about 25\.\d* s .* unclear which .* Check the sensor"
    ):
        repair(np.sort([*times, *burst]))


def test_jitter_is_no_reason_to_repair():
    jitter = 0.02 * np.random.default_rng(1).standard_normal(500)
    times = (np.arange(500) + jitter) / 20.0
    assert repair(times).time_s is times


def test_many_repairs_in_a_long_train():
    generator = np.random.default_rng(2)
    count = 100_000
    whole = 0.01 * np.cumsum(1 + 0.02 * np.sin(np.arange(count) * 2 * np.pi / 997))
    more = generator.uniform(whole[0], whole[-1], count // 200)
    gone = generator.choice(np.arange(5, count - 5), count // 200, replace=False)
    found = repair(np.sort([*np.delete(whole, gone), *more]))
    assert len(found.time_s) == count
    np.testing.assert_allclose(found.time_s, whole, atol=1e-3)


@pytest.mark.parametrize("per_turn", [2, 3, 5])
@pytest.mark.parametrize("missing", [False, True])
def test_of_less_than_three_turns_no_spacing_is_learned(per_turn, missing):
    """Uneven pulses are kept as they came: nothing tells which of them belong there."""
    gaps = np.tile(np.linspace(1.0, 1.8, per_turn), 3) / 50.0
    times = 0.1 + np.cumsum(gaps)
    for count in range(max(4, per_turn + 1), len(times) + 1):
        came = np.delete(times[:count], [1] if missing and count > 4 else [])
        found = repair(came, per_turn)
        np.testing.assert_array_equal(found.time_s, came)
        assert (found.missing, found.extra) == (0, 0)
