from __future__ import annotations

import base64
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from reference.drawn_extent import badly_filled

from gearmon.diagnosis.history import Entry, History, Place, history_trends
from gearmon.report.analysis_plots import day_figure, history_figure, kind_figure
from gearmon.report.html import history_charts
from gearmon.report.plots import as_png
from gearmon.report.text import history_lines


def history(losses=True, count=14):
    generator = np.random.default_rng(1)
    entries = []
    for number in range(count):
        true = 0.02 * max(0, number - 5)
        places = [
            Place(
                stage=1,
                gear="pinion",
                tooth=tooth,
                loss=float(generator.normal(true if tooth == 2 else 0.0, 0.01)),
                loss_sigma=0.01,
            )
            for tooth in (1, 2, 3)
        ]
        entries.append(
            Entry(
                machine="m",
                recording=f"{number}.csv",
                time_s=1.7e9 + 86400.0 * number,
                time_source="given",
                verdict="fault" if true > 0.1 else "healthy",
                score=float(generator.exponential(0.3) + 40 * true),
                false_alarm_probability=0.5,
                speed_hz=20.0,
                places=tuple(places) if losses else (),
            )
        )
    return History(machine="m", entries=tuple(entries))


def labels(figure):
    assert badly_filled(figure) == []
    return {text.get_text() for legend in figure.legends for text in legend.get_texts()}


def in_data(patch):
    """The outline of a patch in the coordinates of its axes' data."""
    return patch.get_patch_transform().transform_path(patch.get_path())


def test_losses_limit_and_scores_are_drawn():
    found = history_trends(history(), limit=0.3)
    figure = history_figure(found, [0.0] * 14)
    upper, lower = figure.axes
    assert {
        "stage 1, pinion, tooth 2",
        "trend, 90 % interval",
        "limit",
        "healthy",
        "fault",
        "known loss",
    } <= labels(figure)
    assert "(%)" in upper.get_ylabel()
    assert lower.get_ylabel().startswith("Score (")
    figure.draw_without_rendering()
    drawn = figure.legends[0].get_window_extent()
    assert drawn.x0 >= 0
    assert drawn.y0 >= upper.get_window_extent().y1
    limit = [line for line in upper.lines if line.get_label() == "limit"]
    assert limit[0].get_ydata()[0] == pytest.approx(30.0)
    (band,) = [part for part in upper.collections if part.get_label().startswith("trend, ")]
    (drawn,) = band.get_paths()
    _, low, high = found.teeth[0].trend.at(86400.0 * np.unique(drawn.vertices[:, 0]))
    assert drawn.vertices[:, 1].max() == pytest.approx(100 * high.max())
    assert drawn.vertices[:, 1].min() >= 100 * low.min() - 1e-9
    crossing = found.teeth[0].crossing
    (bar,) = [line for line in upper.lines if line.get_label() == "when the limit is reached"]
    assert bar.get_ydata() == pytest.approx(30.0)
    times = found.teeth[0].trend.series.time_s
    ends = np.minimum([crossing.low_s, crossing.high_s], 2 * times[-1] - times[0])
    assert bar.get_xdata() == pytest.approx(ends / 86400.0, abs=1e-6)
    assert band.get_paths()[0].vertices[:, 0].max() == pytest.approx(crossing.time_s / 86400.0)
    begin = found.teeth[0].trend.changes[0].time_s / 86400.0
    assert any(np.allclose(line.get_xdata(), begin) for line in upper.lines)
    # an interval of its time is shaded about every change
    for ax, changes in ((upper, found.teeth[0].trend.changes), (lower, found.evidence.changes)):
        spans = [patch.get_extents().intervalx for patch in map(in_data, ax.patches)]
        ends = [(change.low_s / 86400.0, change.high_s / 86400.0) for change in changes]
        assert changes
        for own in ends:
            assert any(np.allclose(span, own) for span in spans)


@pytest.mark.parametrize("unknown", [("low_s",), ("high_s",), ("low_s", "high_s")])
def test_an_unknown_end_of_when_the_limit_is_reached_is_the_farthest_or_the_likeliest(
    unknown, monkeypatch
):
    """Never reached for certain: as far as is drawn; no earliest time: the likeliest one."""
    found = history_trends(history(), limit=0.3)
    known, times = found.teeth[0].crossing, found.teeth[0].trend.series.time_s
    open_ended = replace(known, **dict.fromkeys(unknown))
    monkeypatch.setattr(found.teeth[0], "crossing", open_ended)
    upper = history_figure(found, [0.0] * 14).axes[0]
    (bar,) = [line for line in upper.lines if line.get_label() == "when the limit is reached"]
    farthest = 2 * times[-1] - times[0]
    low = known.time_s if "low_s" in unknown else known.low_s
    high = farthest if "high_s" in unknown else min(known.high_s, farthest)
    assert bar.get_xdata() == pytest.approx([low / 86400.0, high / 86400.0], abs=1e-6)


def test_the_known_loss_is_drawn_in_percent_at_the_times_of_the_recordings():
    found = history_trends(history(count=4), limit=0.3)
    upper = history_figure(found, [0.0, 0.02, 0.05, 0.11]).axes[0]
    (line,) = [own for own in upper.lines if own.get_label() == "known loss"]
    assert line.get_ydata() == pytest.approx([0.0, 2.0, 5.0, 11.0])
    days = [entry.time_s / 86400.0 for entry in found.history.entries]
    assert line.get_xdata() == pytest.approx(days)


def test_words_and_charts_tell_the_loss_in_percent_and_its_rate_a_day():
    found = history_trends(history(), limit=0.3)
    (tooth,) = found.shown
    text = "\n".join(history_lines(found))
    (rate,) = re.findall(r"rate \+(\S+) % \(\+(\S+) % to \+(\S+) %\) a day", text)
    assert [float(own) for own in rate] == pytest.approx(
        [100 * 86400 * own for own in tooth.trend.rate()], abs=0.051
    )
    (now,) = re.findall(r"loss of pair stiffness now (\S+) %", text)
    assert float(now) == pytest.approx(100 * tooth.now[0], abs=0.051)
    chart = history_charts(found)["charts"][0]
    assert (chart["name"], chart["limit"]) == ("history-loss", pytest.approx(30.0))
    estimates, trend = chart["curves"]
    value, low, high = tooth.trend.at(chart["times"])
    told = ((estimates, tooth.trend.series.value, tooth.low, tooth.high), (trend, value, low, high))
    for curve, *rows in told:
        for name, row in zip(("values", "low", "high"), rows, strict=True):
            numbers = np.frombuffer(base64.b64decode(curve[name]), dtype="<f4")
            np.testing.assert_allclose(numbers, 100 * np.asarray(row), rtol=1e-5, atol=1e-5)


def test_what_the_newest_recording_calls_lost_has_a_colour():
    kept = history(count=3).entries
    place = Place(stage=1, gear="pinion", tooth=3, loss=0.3, loss_sigma=0.01)
    newest = replace(kept[-1], verdict="fault", places=(*kept[-1].places[:2], place))
    found = history_trends(History(machine="m", entries=(*kept[:-1], newest)), limit=0.2)
    assert found.shown == ()
    assert labels(history_figure(found)) >= {
        "stage 1, pinion, tooth 3, not yet over several recordings",
        "2 other teeth, no loss clear of noise",
    }


def test_losses_of_sound_teeth_do_not_fill_the_picture():
    quiet = history(count=4)
    upper, lower = history_figure(history_trends(quiet)).axes
    assert upper.get_ylim()[1] >= 5.0
    assert lower.get_ylim()[1] >= 2.0


def test_without_estimates_only_the_scores_are_drawn():
    found = history_trends(history(losses=False))
    (ax,) = history_figure(found).axes
    drawn = [line for line in ax.lines if line.get_label() in ("healthy", "fault")]
    times = [entry.time_s / 86400.0 for entry in found.history.entries]
    assert sorted(x for line in drawn for x in line.get_xdata()) == pytest.approx(times)


def test_one_recording_can_be_drawn():
    assert as_png(history_figure(history_trends(history(count=1), limit=0.2)))


def test_day_and_kinds_are_drawn():
    hour = np.arange(6.0)
    verdicts = ["healthy", "healthy", "cannot tell", "fault", "healthy", "no mesh found"]
    known = {"load": 0.5 + 0.1 * hour, "speed_hz": 24 + 0.1 * hour, "score": hour}
    known |= {"level of a1": hour, "level of a2": -hour, "verdict": verdicts}
    day = pd.DataFrame(known, index=hour)
    changes = pd.DataFrame(np.ones((2, 2)), index=["a", "b"], columns=["mesh", "far"])
    kinds = {"one": changes, "two": changes}
    figure = day_figure(day, 3.0)
    load, speed, level, score = figure.axes
    for strength in (0.2, 1.0, 4.0):
        drawn = day_figure(day.assign(score=strength * (hour - 1.0)), 3.0).axes[-1]
        low, high = drawn.get_ylim()
        # nothing is cut, and a small score does not fill the page
        assert low < -strength
        assert high > max(2.4, 4.0 * strength)
    assert badly_filled(figure) == []
    assert np.allclose(load.lines[0].get_ydata(), 100 * day["load"])
    assert np.array_equal(speed.lines[0].get_ydata(), day["speed_hz"])
    assert np.array_equal(level.lines[1].get_ydata(), -hour)
    assert len(score.lines) == 4
    one, two = kind_figure(kinds).axes
    assert [one.get_title(loc="left"), two.get_title(loc="left")] == ["one", "two"]
    assert [bar.get_height() for bar in one.patches] == [1.0] * 4
    # the recordings stand side by side about the mark of their feature
    middles = np.array([bar.get_x() + bar.get_width() / 2 for bar in one.patches]).reshape(2, 2)
    np.testing.assert_allclose(middles.mean(axis=0), one.get_xticks(), atol=1e-12)
    gaps = np.diff(middles, axis=0)
    assert np.all(gaps >= one.patches[0].get_width())
    assert np.all(gaps < 0.5)
    assert [label.get_text() for label in two.get_xticklabels()] == ["mesh", "far"]
