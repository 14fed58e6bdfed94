"""When growth began, straight or faster and faster: courses, coverage, limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.diagnosis.history import ChangePoint, Entry, History, Place, history_trends
from gearmon.diagnosis.history.changes import (
    CHANCES,
    GROWTHS,
    STRAIGHT,
    Fits,
    Growth,
    Series,
    find_changes,
)
from gearmon.diagnosis.history.changes import COURSES as TRIED
from gearmon.diagnosis.history.trends import fit_trend
from gearmon.report.text import change_text

DAY = 86400.0
# none of the bent ones is one of those that are tried
COURSES = {
    "straight": lambda x: x,
    "square": lambda x: x**1.8,
    "cube": lambda x: x**3.3,
    "exponential": lambda x: np.expm1(3.7 * x) / math.expm1(3.7),
}
# nor of those that have come to more at first than a straight line would
AT_FIRST = {
    "jump and on": lambda x: np.where(x > 0, 0.33 + 0.67 * x, 0.0),
    "small jump and on": lambda x: np.where(x > 0, 0.15 + 0.85 * x, 0.0),
    "running in": lambda x: x**0.6,
    "coming to a halt": lambda x: 1.0 - np.exp(-3.0 * x),
}


def grown(generator, course, rise, count=20):
    """A history with uneven times and noise in which something grows; and when it began."""
    times = 1.7e9 + DAY * np.cumsum(generator.uniform(0.3, 1.7, count))
    begin = times[0] + generator.uniform(0.2, 0.55) * (times[-1] - times[0])

    def true(time_s):
        return rise * (COURSES | AT_FIRST)[course](
            np.maximum((time_s - begin) / (times[-1] - begin), 0.0)
        )

    sigma = generator.uniform(0.7, 1.4, count)
    value = 5.0 + true(times) + sigma * generator.standard_normal(count)
    return Series(time_s=times, value=value, sigma=sigma), begin, true


def rate(growth, share, step=1e-6):
    """Derivative of a course where it has begun."""
    return (growth.at(share + step) - growth.at(share - step)) / (2 * step)


@pytest.mark.parametrize("growth", GROWTHS)
def test_courses_grow_from_nought_to_one(growth):
    share = np.linspace(-0.5, 1.5, 41)
    value = growth.at(share)
    assert np.all(value[share <= 0] == 0)
    assert growth.at(np.ones(1))[0] == pytest.approx(1.0)
    assert np.all(np.diff(value) >= 0)
    if growth.exponent >= 1 and growth.folds >= 0 and not growth.jump:
        assert np.all(np.diff(value, 2) > -1e-12)
    inside, outside = share[share > 0.1], share[share <= 0]
    moved = growth.tangents(inside)[0]
    slope = rate(growth, inside - 0.5e-7)  # half of the step back
    assert moved / moved[0] == pytest.approx(slope / slope[0], rel=1e-6)
    assert all(np.all(tangent == 0) for tangent in growth.tangents(outside))
    assert np.isfinite(growth.at(np.array([1e9]))).all()


@given(st.floats(1.1, 6.0), st.floats(0.5, 8.0))
def test_courses_bend_along_their_exponent(exponent, folds):
    share = np.linspace(0.05, 1.5, 12)
    bent = Growth(exponent=exponent).tangents(share)[1]
    expected = share**exponent * np.log(share)
    assert bent / np.linalg.norm(bent) == pytest.approx(
        expected / np.linalg.norm(expected), abs=1e-6
    )
    # of an exponential in units of its whole growth
    bent = Growth(folds=folds).tangents(share)[1]
    whole = math.expm1(folds)
    expected = share * np.exp(folds * share) / whole
    expected -= np.expm1(folds * share) * math.exp(folds) / whole**2
    assert bent / np.linalg.norm(bent) == pytest.approx(
        expected / np.linalg.norm(expected), abs=1e-6
    )


def test_courses_that_are_tried_have_a_chance_each():
    assert CHANCES.sum() == pytest.approx(1.0)
    assert GROWTHS[0] is STRAIGHT
    assert {growth.kind for growth in GROWTHS} == {
        "straight",
        "power",
        "exponential",
        "jump and straight",
        "jump and power",
    }


def test_fits_are_least_squares_with_their_variance():
    generator = np.random.default_rng(1)
    series, begin, _ = grown(generator, "cube", 10.0)
    times, end = series.time_s, float(series.time_s[-1])
    step = ChangePoint(growth=TRIED[0], time_s=float(times[4:6].mean()))
    cube = Growth(exponent=3.0)
    fits = Fits(
        series=series, known=[step], places=np.array([begin]), courses=np.array([TRIED.index(cube)])
    )

    def columns(at):
        grown_by = cube.at((at - begin) / (end - begin))
        return np.column_stack([np.ones(len(at)), at > step.time_s, grown_by])

    weighted = columns(times) / series.sigma[:, None]
    sizes, left, *_ = np.linalg.lstsq(weighted, series.value / series.sigma, rcond=None)
    assert fits.left == pytest.approx(left, rel=1e-9)
    asked = np.array([times[2], end, 2 * end - times[0]])
    value, variance = fits.at(asked, np.zeros(1, dtype=int))
    assert value[0] == pytest.approx(columns(asked) @ sizes, rel=1e-9)
    covariance = np.linalg.inv(weighted.T @ weighted)
    expected = np.sum(columns(asked) @ covariance * columns(asked), axis=1)
    assert variance[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("rise", [10.0, 40.0])
@pytest.mark.parametrize("course", COURSES)
def test_begin_rate_and_limit_of_any_growth_lie_in_their_intervals(course, rise):
    generator = np.random.default_rng([int(rise), len(course)])
    trials, late, begun, now, limits = 25, [], [], [], []
    for _ in range(trials):
        series, begin, true = grown(generator, course, rise)
        trend = fit_trend(series)
        # growth that speeds up is one change and not several
        (change,) = trend.changes
        apart = (series.time_s[-1] - series.time_s[0]) / (len(series) - 1)
        late.append((change.time_s - begin) / apart)
        begun.append(change.low_s <= begin <= change.high_s)
        _, low, high = trend.at(series.time_s[-1:])
        now.append(low[0] <= 5.0 + rise <= high[0])
        found = trend.crossing(5.0 + 1.5 * rise)
        if found.status != "ahead":
            continue
        ahead = series.time_s[-1] + np.linspace(0.0, 2.0, 20001) * 20 * apart
        reached = ahead[np.argmax(true(ahead) >= 1.5 * rise)]
        limits.append(found.low_s <= reached and (found.high_s is None or reached <= found.high_s))
    # stated at 90 %: three standard deviations of the count below
    assert len(limits) >= 0.8 * trials
    for covered in (begun, now, limits):
        assert np.mean(covered) >= 0.9 - 3 * math.sqrt(0.09 / len(covered))
    # a kink through these would lie three to seven recordings late
    assert abs(np.median(late)) < 2.5


@pytest.mark.parametrize("rise", [8.0, 30.0])
@pytest.mark.parametrize("course", AT_FIRST)
def test_growth_that_is_fast_at_first_does_not_begin_early(course, rise):
    generator = np.random.default_rng([int(rise), len(course)])
    trials, begun, early = 25, [], []
    for _ in range(trials):
        series, begin, _ = grown(generator, course, rise, count=40)
        change = find_changes(series)[0]
        apart = (series.time_s[-1] - series.time_s[0]) / (len(series) - 1)
        begun.append(change.low_s <= begin <= change.high_s)
        early.append((begin - change.time_s) / apart)
    assert np.mean(begun) >= 0.9 - 3 * math.sqrt(0.09 / trials)
    # where the jump is clear of the noise a straight line would begin up to twelve too early
    assert abs(np.median(early)) < (1.5 if rise > 20.0 else 4.0)


def test_clean_growth_began_where_it_did():
    times = 1.7e9 + DAY * np.arange(30)
    begin = times[12]
    for growth in GROWTHS:
        value = 0.3 * growth.at((times - begin) / (times[-1] - begin))
        series = Series(time_s=times, value=value, sigma=np.full(30, 1e-7))
        (change,) = find_changes(series)
        assert (change.time_s, change.growth) == (pytest.approx(begin, abs=60.0), growth)
        trend = fit_trend(series)
        assert trend.at(times)[0] == pytest.approx(value, abs=1e-6)
        assert trend.rate()[0] * 17 * DAY == pytest.approx(0.3 * rate(growth, np.ones(1))[0])
        limit = 0.3 * growth.at(np.array([1.4]))[0]
        assert trend.crossing(limit).time_s == pytest.approx(begin + 1.4 * 17 * DAY, abs=0.1 * DAY)


def test_noise_of_either_kind_is_no_onset():
    """A hundredth stated, white or a little correlated."""
    for correlation in (0.0, 0.2):
        generator = np.random.default_rng(int(10 * correlation))
        found = 0
        for _ in range(200):
            noise = generator.standard_normal(20)
            for n in range(1, 20):
                noise[n] = correlation * noise[n - 1] + math.sqrt(1 - correlation**2) * noise[n]
            series = Series(time_s=DAY * np.arange(20.0), value=noise, sigma=np.ones(20))
            found += bool(find_changes(series))
        assert found <= 2 + 3 * math.sqrt(2)


def test_growth_that_speeds_up_is_told_as_such():
    generator = np.random.default_rng(3)
    losses = 0.3 * np.maximum((np.arange(24) - 8) / 15.0, 0.0) ** 2.5
    entries = tuple(
        Entry(
            machine="conveyor",
            recording=f"r{n}.csv",
            time_s=1.7e9 + n * 7 * DAY,
            time_source="given",
            verdict="healthy",
            score=0.2 * (n % 3),
            false_alarm_probability=0.5,
            speed_hz=24.5,
            places=(
                Place(
                    stage=1,
                    gear="pinion",
                    teeth=5,
                    tooth=1,
                    loss=float(loss + generator.normal(0.0, 0.005)),
                    loss_sigma=0.005,
                ),
            ),
        )
        for n, loss in enumerate(losses)
    )
    found = history_trends(History(machine="conveyor", entries=entries), limit=0.4)
    (change,) = found.shown[0].trend.changes
    assert change.low_s <= entries[8].time_s <= change.high_s
    assert ", faster and faster (" in change_text(change, fine=True, growth=("grows", "shrinks"))
    told = found.to_dict()["teeth"][0]
    assert told["changes"][0]["course"] in ("power", "exponential")
    reached = entries[8].time_s + 15 * (0.4 / 0.3) ** 0.4 * 7 * DAY
    crossing = found.shown[0].crossing
    assert crossing.low_s <= reached <= crossing.high_s
    assert "speeding up" in crossing.reason
