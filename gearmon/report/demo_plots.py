"""Pictures of demos: a working day, and what different faults do to the lines of a gear."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

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


@style()
def day_figure(day: pd.DataFrame, limit_db: float) -> Picture:
    """Draw a day: load, speed, level of the vibration, and what was concluded.

    Parameters
    ----------
    day : DataFrame
        A row a recording, by hour of the day: `load` as a share of the nominal torque, `speed_hz`
        of shaft 1, `score`, `verdict`, and one or more columns "level of ..." less the mean level
        of the reference [dB].
    limit_db : float
        A limit on the levels [dB].
    """
    figure, axes = new_figure([0.8, 0.8, 1.2, 1.2], top_in=0.4, sharex=True)
    load, speed, level, score = axes
    load.plot(day.index, 100 * day["load"], color=BLACK, marker="o", markersize=2.5)
    load.set_ylabel("Load\n(% of nominal)")
    speed.plot(day.index, day["speed_hz"], color=BLACK, marker="o", markersize=2.5)
    speed.set_ylabel("Speed of\nshaft 1 (Hz)")
    for number, (name, moved) in enumerate(day.filter(like="level of ").items()):
        marker, colour = series_marker(number), series_colour(number)
        level.plot(day.index, moved, color=colour, marker=marker, markersize=3, label=str(name))
    level.axhline(
        limit_db, color=VERMILLION, linewidth=0.9, linestyle=(0, (5, 2)), label="level limit"
    )
    level.set_ylabel("Level re mean of\nreference (dB)")
    scores = day["score"].tolist()
    plot_verdicts(day.index.tolist(), scores, day["verdict"].tolist(), score, 4.5)
    lowest, highest = min(scores), max(scores)
    score.set(ylim=(min(-0.1, 1.1 * lowest), max(2.5, 1.1 * highest)), ylabel="Score")
    for ax in axes:
        light_grid(ax)
    score.set_xlabel("Hour of the day (UTC)")
    legend(figure, axes, columns=6)
    return figure


@style()
def kind_figure(changes: Mapping[str, pd.DataFrame]) -> Picture:
    """Draw the changes of several states: one panel a state, bars of changes.

    Parameters
    ----------
    changes : mapping of str to DataFrame
        By the title of the panel: changes [dB], a row a recording, a column a feature; the same
        features and recordings in all.
    """
    figure, axes = new_figure(
        [1.0] * len(changes), top_in=0.45, bottom_in=0.45, gap_in=0.32, left_in=0.6
    )
    low = min(0.0, *(float(frame.to_numpy().min()) for frame in changes.values()))
    high = max(float(frame.to_numpy().max()) for frame in changes.values())
    for (title, frame), ax in zip(changes.items(), axes, strict=True):
        place, width = np.arange(len(frame.columns), dtype=float), 0.8 / len(frame)
        for number, (name, row) in enumerate(frame.iterrows()):
            shift = (number - 0.5 * (len(frame) - 1)) * width
            ax.bar(place + shift, row, 0.92 * width, color=series_colour(number), label=str(name))
        ax.axhline(0.0, color=BLACK, linewidth=0.6)
        ax.set_title(title, pad=3)
        ax.set_xticks(place, frame.columns if ax is axes[-1] else [""] * len(place))
        ax.set_ylim(1.08 * low - 0.5, 1.08 * high + 0.5)
        light_grid(ax)
    left_label(figure, axes, "Change, or height above the median (dB)")
    legend(figure, axes[:1], columns=6)
    return figure
