"""Change points and trends: closed forms, laws, and coverage by Monte Carlo."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gearmon.diagnosis.history.changes import (
    Series,
    change_probability,
    find_changes,
    known_noise_bound,
    permuted_probability,
    tube_bound,
)
from gearmon.diagnosis.history.trends import _reached, fit_trend

DAY = 86400.0


def series(value, sigma=1.0, time_s=None, **more):
    value = np.asarray(value, dtype=float)
    times = 1.7e9 + DAY * np.arange(len(value)) if time_s is None else time_s
    return Series(
        time_s=times, value=value, sigma=np.broadcast_to(sigma, value.shape).copy(), **more
    )


def uneven(generator, count):
    """Times and standard deviations as unequal as those of a real history."""
    return (
        1.7e9 + DAY * np.cumsum(generator.uniform(0.3, 2.0, count)),
        generator.uniform(0.5, 2.0, count),
    )


def kinked(time_s, begin, rise):
    """Nothing until `begin` (a share of the span), then a straight rise by `rise`."""
    share = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
    return rise * np.maximum(share - begin, 0.0) / (1.0 - begin)


# the bound


@pytest.mark.parametrize("c", [0.1, 0.4, 0.9])
def test_one_direction_in_three_dimensions_is_archimedes(c):
    # the height of a random point on a sphere is uniform
    assert tube_bound(c, 0.0, 3) == pytest.approx(1.0 - c, abs=1e-12)


@pytest.mark.parametrize("c", [0.5, 0.9])
def test_on_a_circle_the_bound_is_exact(c):
    # an arc of length kappa and its mirror image, each widened by arccos(c) to both sides
    arc = 0.4
    exact = 2 * (arc + 2 * math.acos(c)) / (2 * math.pi)
    assert tube_bound(c, arc, 2) == pytest.approx(min(1.0, exact), abs=1e-12)


def test_bound_holds_for_random_directions_about_a_path():
    generator = np.random.default_rng(1)
    angle = np.linspace(0.0, 1.2, 200)
    path = np.zeros((200, 8))
    path[:, 0], path[:, 1] = np.cos(angle), np.sin(angle)
    noise = generator.standard_normal((40_000, 8))
    noise /= np.linalg.norm(noise, axis=1, keepdims=True)
    nearest = np.abs(noise @ path.T).max(axis=1)
    for c in (0.6, 0.75, 0.85):
        share, bound = float(np.mean(nearest >= c)), tube_bound(c, 1.2, 8)
        deviation = math.sqrt(bound / len(noise))
        assert share < bound + 3 * deviation
        assert share > 0.9 * bound - 3 * deviation


def test_bound_for_known_noise_is_the_limit_of_many_dimensions():
    for gain, length in ((1.5, 0.0), (3.0, 2.0), (4.5, 7.0)):
        m = 10**7
        limit = tube_bound(gain / math.sqrt(m), length, m)
        assert known_noise_bound(gain, length) == pytest.approx(limit, rel=1e-4)


def test_values_quieter_than_they_are_said_to_be_show_no_change():
    shape = np.r_[np.zeros(10), np.arange(10.0)]
    assert change_probability(series(0.1 * shape, 1.0)) > 0.3
    assert find_changes(series(0.1 * shape, 1.0)) == ()
    # where only the ratios of the uncertainties are known, the same shape is beyond doubt
    assert change_probability(series(0.1 * shape, 1.0, sigma_known=False)) < 1e-9
    (change,) = find_changes(series(3.0 * shape, 1.0), most=1)
    # and its time is no surer than the stated noise allows
    assert change.high_s - change.low_s > 0.2 * DAY


# false alarms


@pytest.mark.parametrize("count", [6, 20])
def test_series_without_change_are_called_no_more_often_than_stated(count):
    generator = np.random.default_rng(count)
    trials, found = 800, []
    for _ in range(trials):
        times, sigma = uneven(generator, count)
        value = 3.0 + sigma * generator.standard_normal(count)
        found.append(change_probability(series(value, sigma, times)))
    for level in (0.02, 0.1, 0.3):
        share = float(np.mean(np.array(found) < level))
        assert share < level + 3 * math.sqrt(level / trials)
        assert share > 0.3 * level - 3 * math.sqrt(level / trials)  # and it is no empty bound


def test_permuted_probability_is_uniform_for_any_law():
    generator = np.random.default_rng(5)
    trials = 200
    found = np.array(
        [
            permuted_probability(series(generator.exponential(size=12) ** 2), permutations=199)
            for _ in range(trials)
        ]
    )
    for level in (0.05, 0.2, 0.5):
        assert abs(np.mean(found <= level) - level) < 4 * math.sqrt(level * (1 - level) / trials)


@given(seed=st.integers(0, 10**6), scale=st.floats(1e-6, 1e6), shift=st.floats(-1e3, 1e3))
def test_no_unit_and_no_offset_matters(seed, scale, shift):
    value = np.random.default_rng(seed).standard_normal(10)
    one = change_probability(series(value))
    other = change_probability(series(scale * (value + shift), scale))
    assert other == pytest.approx(one, rel=1e-5)
    assert change_probability(series(-value)) == pytest.approx(one, rel=1e-9)


def test_order_decides_and_nothing_else():
    rising = np.arange(12.0) + np.random.default_rng(2).normal(0, 0.3, 12)
    shuffled = np.random.default_rng(3).permutation(rising)
    assert permuted_probability(series(rising)) == pytest.approx(1 / 5000)
    assert permuted_probability(series(shuffled)) > 0.01
    # the law is that of the values: the same for any order of them
    assert permuted_probability(series(np.full(12, 4.0))) == 1.0


def test_constant_and_short_series_have_no_change():
    assert find_changes(series(np.full(20, 0.1))) == ()
    assert change_probability(series(np.full(20, 0.1))) == 1.0
    assert change_probability(series([1.0, 2.0, 9.0])) == 1.0
    assert find_changes(series([1.0, 2.0, 3.0, 40.0, 50.0])) == ()


def test_one_wrong_estimate_is_no_change():
    value = np.random.default_rng(4).normal(0.0, 0.1, 20)
    for place in (0, 9, 19):
        wrong = value.copy()
        wrong[place] += 5.0
        assert find_changes(series(wrong)) == ()


# finding


def test_a_clean_kink_is_found_where_it_is():
    times = 1.7e9 + DAY * np.arange(20)
    begin = times[0] + 7.5 * DAY
    value = 0.02 * np.maximum(times - begin, 0.0) / DAY
    (change,) = find_changes(series(value, 0.01, times), most=1)
    assert change.kind == "growth"
    assert change.time_s == pytest.approx(begin, abs=0.01 * DAY)
    assert change.size == pytest.approx(0.02 * 11.5, rel=1e-6)
    assert change.low_s <= begin <= change.high_s
    assert not change.open_before


def test_a_step_lies_between_two_recordings():
    generator = np.random.default_rng(6)
    value = np.where(np.arange(20) < 12, 0.0, 5.0) + generator.normal(0, 0.3, 20)
    (change,) = find_changes(series(value, 0.3))
    assert change.kind == "step"
    assert change.time_s == pytest.approx(1.7e9 + 11.5 * DAY)
    assert change.low_s <= 1.7e9 + 11 * DAY
    assert change.high_s >= 1.7e9 + 12 * DAY
    assert change.size == pytest.approx(5.0, abs=0.4)


def test_growth_and_repair_are_two_changes():
    generator = np.random.default_rng(7)
    day = np.arange(40.0)
    value = np.where(day < 25, 0.5 * np.maximum(day - 10, 0), 0.0) + generator.normal(0, 0.2, 40)
    changes = find_changes(series(value, 0.2))
    assert len(changes) >= 2
    assert changes[0].size > 0
    assert any(
        c.kind == "step" and c.size < 0 and abs(c.time_s - 1.7e9 - 24.5 * DAY) < 1.0
        for c in changes
    )


def test_every_further_change_needs_two_more_recordings_than_six():
    """A staircase as clear as can be, two recordings a step, all of them upwards."""
    generator = np.random.default_rng(3)
    most = dict.fromkeys(range(6, 10), 0)
    for count in most:
        for _ in range(12):
            rise = np.where(np.arange(count) % 2, 0.0, 10.0 ** generator.uniform(1, 3, count))
            found = find_changes(series(np.cumsum(rise) + generator.normal(size=count)))
            most[count] = max(most[count], len(found))
    assert most == {6: 1, 7: 1, 8: 2, 9: 2}


def test_growth_from_the_first_recording_may_have_begun_before():
    generator = np.random.default_rng(8)
    (change,) = find_changes(series(np.arange(15.0) + generator.normal(0, 0.5, 15), 0.5))
    assert change.kind == "growth"
    assert change.open_before


# intervals


def test_intervals_cover_begin_value_rate_and_limit():
    generator = np.random.default_rng(9)
    trials, rise = 100, 10.0
    begun, now, rates, limits = [], [], [], []
    for _ in range(trials):
        times, sigma = uneven(generator, 20)
        begin = generator.uniform(0.25, 0.6)
        value = kinked(times, begin, rise) + sigma * generator.standard_normal(20)
        trend = fit_trend(series(value, sigma, times))
        assert len(trend.changes) == 1
        change, span = trend.changes[0], times[-1] - times[0]
        begun.append(change.low_s <= times[0] + begin * span <= change.high_s)
        _, low, high = trend.at(times[-1:])
        now.append(low[0] <= rise <= high[0])
        if change.kind != "growth":
            continue
        rate = rise / (1 - begin) / span
        rates.append(trend.rate()[1] <= rate <= trend.rate()[2])
        found = trend.crossing(1.4 * rise)
        assert found.status in ("ahead", "not extrapolated")
        if found.status == "ahead":
            true = times[-1] + 0.4 * rise / rate
            limits.append(found.low_s <= true and (found.high_s is None or true <= found.high_s))
    assert len(limits) > 80
    # stated at 90 %; three standard deviations of the counts below, and never narrower
    for covered in (begun, now, rates, limits):
        assert np.mean(covered) > 0.9 - 3 * math.sqrt(0.9 * 0.1 / len(covered))


def test_straight_line_has_its_closed_form():
    """With a kink far from the end the last piece is a line through the mean before it."""
    times = 1.7e9 + DAY * np.arange(30)
    value = 0.01 * np.maximum(np.arange(30) - 9.0, 0.0)
    trend = fit_trend(series(value, 0.001, times))
    assert trend.at(times)[0] == pytest.approx(value, abs=1e-9)
    assert trend.rate()[0] * DAY == pytest.approx(0.01, rel=1e-6)
    found = trend.crossing(0.25)
    assert found.status == "ahead"
    assert found.time_s == pytest.approx(1.7e9 + 34 * DAY, abs=1.0)
    assert found.low_s < found.time_s < found.high_s
    assert trend.crossing(0.1).status == "reached"


def test_a_limit_within_the_interval_is_reached_or_not_as_the_trend_says():
    generator = np.random.default_rng(16)
    times = 1.7e9 + DAY * np.arange(30)
    value = np.maximum(np.arange(30) - 9.0, 0.0) + generator.normal(0, 0.5, 30)
    trend = fit_trend(series(value, 0.5, times))
    last, low, high = (x[0] for x in trend.at(times[-1:]))
    assert low < last < high
    # what is not yet there was not there before, though it may have been as far as is known
    above = trend.crossing(0.9 * last + 0.1 * high)
    assert (above.status, above.low_s) == ("ahead", times[-1])
    sure, unsure = trend.crossing(0.9 * low), trend.crossing(0.9 * last + 0.1 * low)
    assert (sure.status, unsure.status) == ("reached", "reached")
    assert times[0] <= unsure.low_s < unsure.time_s < times[-1]
    told = "its interval reaches below the limit"
    assert [told in own.reason for own in (sure, unsure)] == [False, True]


@given(st.lists(st.integers(0, 5), min_size=1, max_size=8))
def test_a_limit_is_reached_where_values_last_rise_to_it_or_above(steps):
    """Of whole numbers some are the limit itself; between them a straight line leads to it."""
    values, limit = np.array(steps, dtype=float), 3.0
    times = 10.0 + 2.0 * np.arange(len(values))
    fine = np.linspace(times[0], times[-1], 12 * (len(values) - 1) * 5 + 1)
    high = np.interp(fine, times, values) >= limit - 1e-9
    found = _reached(times, values, limit)
    if not high[-1]:
        assert found is None
    else:
        # the first place of the last stretch
        assert found == pytest.approx(fine[len(high) - np.argmin(np.append(high[::-1], False))])


def test_constant_series_has_the_weighted_mean_with_its_interval():
    sigma = np.array([1.0, 2.0, 1.0, 0.5, 1.0, 2.0, 1.0])
    value = 2.0 + 0.1 * np.array([1, -1, 1, -1, 1, -1, 0.0])
    trend = fit_trend(series(value, sigma))
    mean, low, high = (x[0] for x in trend.at([1.7e9]))
    weight = 1 / sigma**2
    assert mean == pytest.approx(float(weight @ value / weight.sum()), rel=1e-12)
    # the stated uncertainties are larger than the scatter: they are what counts
    half = stats.t.ppf(0.95, 6) / math.sqrt(weight.sum())
    assert (high - low) / 2 == pytest.approx(half, rel=1e-9)
    assert trend.rate() == (0.0, 0.0, 0.0)


def test_nothing_is_extrapolated_from_what_noise_could_make():
    generator = np.random.default_rng(10)
    flat = fit_trend(series(generator.normal(0.05, 0.01, 15), 0.01)).crossing(0.2)
    assert (flat.status, flat.time_s) == ("not extrapolated", None)
    assert "noise" in flat.reason
    falling = fit_trend(series(5.0 - 0.2 * np.arange(15) + generator.normal(0, 0.1, 15), 0.1))
    assert falling.crossing(10.0).status == "not extrapolated"
    short = fit_trend(series([0.01, 0.05, 0.09], 0.001)).crossing(0.2)
    assert "too few" in short.reason
