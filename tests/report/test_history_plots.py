from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from gearmon.diagnosis.history import Entry, History, Place, history_trends
from gearmon.report.day_plots import DayView, save_day_picture
from gearmon.report.history_plots import history_figure, save_history_picture
from gearmon.report.kind_plots import KindView, save_kind_picture
from gearmon.report.plots import style


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
    return {text.get_text() for legend in figure.legends for text in legend.get_texts()}


def test_losses_limit_and_scores_are_drawn():
    found = history_trends(history(), limit=0.3)
    with style():
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
    begin = found.teeth[0].trend.changes[0].time_s / 86400.0
    assert any(np.allclose(line.get_xdata(), begin) for line in upper.lines)


def test_losses_of_sound_teeth_do_not_fill_the_picture():
    quiet = history(count=4)
    with style():
        upper, lower = history_figure(history_trends(quiet)).axes
    assert upper.get_ylim()[1] >= 5.0
    assert lower.get_ylim()[1] >= 2.0


def test_without_estimates_only_the_scores_are_drawn(tmp_path):
    found = history_trends(history(losses=False))
    with style():
        assert len(history_figure(found).axes) == 1
    path = save_history_picture(found, tmp_path / "h.png")
    with Image.open(path) as image:
        assert image.size[0] > 1000


def test_one_recording_can_be_drawn(tmp_path):
    save_history_picture(history_trends(history(count=1), limit=0.2), tmp_path / "h.png")


def test_day_and_kinds_are_drawn(tmp_path):
    hour = np.arange(6.0)
    view = DayView(
        hour=hour,
        load=0.5 + 0.1 * hour,
        speed_hz=24 + 0.1 * hour,
        level_db=np.vstack([hour, -hour]),
        reference_level_db=np.zeros((2, 1)),
        limit_db=3.0,
        score=hour,
        verdict=("healthy", "healthy", "cannot tell", "fault", "healthy", "no mesh found"),
        channel_names=("a1", "a2"),
    )
    kinds = [
        KindView(title=title, features=("mesh", "far"), names=("a", "b"), value_db=np.ones((2, 2)))
        for title in ("one", "two")
    ]
    for path in (
        save_day_picture(view, tmp_path / "day.png"),
        save_kind_picture(kinds, tmp_path / "kinds.png"),
    ):
        with Image.open(path) as image:
            assert image.size[0] > 1000
