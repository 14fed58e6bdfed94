"""The picture of what different faults do to the lines: one panel a state, bars of changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gearmon.files import write_atomically
from gearmon.report.palette import BLACK, series_colour
from gearmon.report.plots import as_png, left_label, legend, light_grid, new_figure, style

FloatArray = NDArray[np.float64]


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


def save_kind_picture(views: Sequence[KindView], path: Path) -> Path:
    """Draw the changes of several states and write the picture.

    Parameters
    ----------
    views : sequence of KindView
        With the same features and recordings.
    path : Path
        Name of the PNG.

    Returns
    -------
    Path
        `path`.
    """
    with style():
        figure, axes = new_figure(
            [1.0] * len(views), top_in=0.45, bottom_in=0.45, gap_in=0.32, left_in=0.6
        )
        low = min(0.0, min(float(view.value_db.min()) for view in views))
        high = max(float(view.value_db.max()) for view in views)
        for view, ax in zip(views, axes, strict=True):
            _bars(view, ax)
            ax.set_ylim(1.08 * low - 0.5, 1.08 * high + 0.5)
        axes[-1].set_xticks(range(len(views[-1].features)), views[-1].features)
        left_label(figure, axes, "Change, or height above the median (dB)")
        legend(figure, axes[:1], columns=6)
        png = as_png(figure)
    write_atomically(path, png)
    return path


def _bars(view: KindView, ax: Axes) -> None:
    place = np.arange(len(view.features), dtype=float)
    width = 0.8 / len(view.names)
    for number, (name, row) in enumerate(zip(view.names, view.value_db, strict=True)):
        shift = (number - 0.5 * (len(view.names) - 1)) * width
        ax.bar(place + shift, row, 0.92 * width, color=series_colour(number), label=name)
    ax.axhline(0.0, color=BLACK, linewidth=0.6)
    ax.set_title(view.title, pad=3)
    ax.set_xticks(place, [""] * len(place))
    light_grid(ax)
