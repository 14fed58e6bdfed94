"""The picture of a working day: load, speed, level of the vibration, and what was concluded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gearmon.files import write_atomically
from gearmon.report.palette import (
    BLACK,
    VERDICT_STYLE,
    VERMILLION,
    series_colour,
    series_marker,
)
from gearmon.report.plots import as_png, legend, light_grid, new_figure, style

FloatArray = NDArray[np.float64]

VERDICT_MARKERS = {"healthy": "o", "cannot tell": "^", "fault": "s", "no mesh found": "x"}


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


def save_day_picture(view: DayView, path: Path) -> Path:
    """Draw a day and write the picture.

    Parameters
    ----------
    view : DayView
    path : Path
        Name of the PNG.

    Returns
    -------
    Path
        `path`.
    """
    with style():
        figure, axes = new_figure([0.8, 0.8, 1.2, 1.2], top_in=0.4, sharex=True)
        _course(axes[0], view.hour, 100 * view.load, "Load\n(% of nominal)")
        _course(axes[1], view.hour, view.speed_hz, "Speed of\nshaft 1 (Hz)")
        _levels(view, axes[2])
        _scores(view, axes[3])
        axes[-1].set_xlabel("Hour of the day (UTC)")
        legend(figure, axes, columns=6)
        png = as_png(figure)
    write_atomically(path, png)
    return path


def _course(ax: Axes, hour: FloatArray, value: FloatArray, label: str) -> None:
    ax.plot(hour, value, color=BLACK, marker="o", markersize=2.5)
    ax.set_ylabel(label)
    light_grid(ax)


def _levels(view: DayView, ax: Axes) -> None:
    moved = view.level_db - view.reference_level_db
    for number, (name, row) in enumerate(zip(view.channel_names, moved, strict=True)):
        ax.plot(
            view.hour,
            row,
            color=series_colour(number),
            marker=series_marker(number),
            markersize=3,
            label=f"level of {name}",
        )
    ax.axhline(
        view.limit_db, color=VERMILLION, linewidth=0.9, linestyle=(0, (5, 2)), label="level limit"
    )
    ax.set_ylabel("Level re mean of\nreference (dB)")
    light_grid(ax)


def _scores(view: DayView, ax: Axes) -> None:
    for verdict, marker in VERDICT_MARKERS.items():
        own = np.array([v == verdict for v in view.verdict])
        if own.any():
            ax.plot(
                view.hour[own],
                view.score[own],
                linestyle="",
                marker=marker,
                markersize=4.5,
                color=VERDICT_STYLE[verdict][0],
                markeredgecolor=BLACK,
                markeredgewidth=0.4,
                label=verdict,
            )
    ax.set_ylim(min(-0.1, 1.1 * float(view.score.min())), max(2.5, 1.1 * float(view.score.max())))
    ax.set_ylabel("Score")
    light_grid(ax)
