"""Pictures of demos: a working day, and what different faults do to the lines of a gear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.report.palette import BLACK, VERMILLION, series_colour, series_marker
from gearmon.report.plots import (
    Picture,
    left_label,
    legend,
    light_grid,
    new_figure,
    plot_verdicts,
    style,
)

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class DayView:
    """Recordings of a day.

    Parameters
    ----------
    hour : ndarray of float, shape (n,)
        Hour of the day.
    load : ndarray of float, shape (n,)
        Share of the nominal torque.
    speed_hz : ndarray of float, shape (n,)
        Measured speed of shaft 1 [Hz].
    level_db : ndarray of float, shape (channels, n)
        Level [dB].
    reference_level_db : ndarray of float, shape (channels, 1)
        Mean level of the reference [dB].
    limit_db : float
        A limit above that [dB].
    score : ndarray of float, shape (n,)
    verdict : tuple of str
    channel_names : tuple of str
    """

    hour: FloatArray
    load: FloatArray
    speed_hz: FloatArray
    level_db: FloatArray
    reference_level_db: FloatArray
    limit_db: float
    score: FloatArray
    verdict: tuple[str, ...]
    channel_names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class KindView:
    """Changes in some recordings of one state.

    Parameters
    ----------
    title : str
    features : tuple of str
        What changed.
    names : tuple of str
        Recordings.
    value_db : ndarray of float, shape (recordings, features)
        Changes [dB].
    """

    title: str
    features: tuple[str, ...]
    names: tuple[str, ...]
    value_db: FloatArray


@style()
def day_figure(view: DayView) -> Picture:
    """Draw a day: load, speed, level of the vibration, and what was concluded.

    Parameters
    ----------
    view : DayView
    """
    figure, axes = new_figure([0.8, 0.8, 1.2, 1.2], top_in=0.4, sharex=True)
    load, speed, level, score = axes
    load.plot(view.hour, 100 * view.load, color=BLACK, marker="o", markersize=2.5)
    load.set_ylabel("Load\n(% of nominal)")
    speed.plot(view.hour, view.speed_hz, color=BLACK, marker="o", markersize=2.5)
    speed.set_ylabel("Speed of\nshaft 1 (Hz)")
    moved = view.level_db - view.reference_level_db
    for number, (name, row) in enumerate(zip(view.channel_names, moved, strict=True)):
        marker, colour = series_marker(number), series_colour(number)
        label = f"level of {name}"
        level.plot(view.hour, row, color=colour, marker=marker, markersize=3, label=label)
    level.axhline(
        view.limit_db, color=VERMILLION, linewidth=0.9, linestyle=(0, (5, 2)), label="level limit"
    )
    level.set_ylabel("Level re mean of\nreference (dB)")
    plot_verdicts(view.hour, view.score, view.verdict, score, 4.5)
    lowest, highest = float(view.score.min()), float(view.score.max())
    score.set_ylim(min(-0.1, 1.1 * lowest), max(2.5, 1.1 * highest))
    score.set_ylabel("Score")
    for ax in axes:
        light_grid(ax)
    score.set_xlabel("Hour of the day (UTC)")
    legend(figure, axes, columns=6)
    return figure


@style()
def kind_figure(views: Sequence[KindView]) -> Picture:
    """Draw the changes of several states: one panel a state, bars of changes.

    Parameters
    ----------
    views : sequence of KindView
        With the same features and recordings.
    """
    figure, axes = new_figure(
        [1.0] * len(views), top_in=0.45, bottom_in=0.45, gap_in=0.32, left_in=0.6
    )
    low = min(0.0, *(float(view.value_db.min()) for view in views))
    high = max(float(view.value_db.max()) for view in views)
    place = np.arange(len(views[0].features), dtype=float)
    for view, ax in zip(views, axes, strict=True):
        width = 0.8 / len(view.names)
        for number, (name, row) in enumerate(zip(view.names, view.value_db, strict=True)):
            shift = (number - 0.5 * (len(view.names) - 1)) * width
            ax.bar(place + shift, row, 0.92 * width, color=series_colour(number), label=name)
        ax.axhline(0.0, color=BLACK, linewidth=0.6)
        ax.set_title(view.title, pad=3)
        ax.set_xticks(place, view.features if ax is axes[-1] else [""] * len(place))
        ax.set_ylim(1.08 * low - 0.5, 1.08 * high + 0.5)
        light_grid(ax)
    left_label(figure, axes, "Change, or height above the median (dB)")
    legend(figure, axes[:1], columns=6)
    return figure
