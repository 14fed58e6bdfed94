"""The picture of `gearmon benchmark signals`: run times of every case, gearmon's marked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from gearmon.files import write_atomically
from gearmon.report.palette import BLUE, GREY
from gearmon.report.plots import as_png, light_grid, new_figure, style

Row = dict[str, Any]


def save_signals_figure(rows: Sequence[Row], path: str | Path) -> list[Path]:
    """Draw the run times and write the picture.

    Parameters
    ----------
    rows : sequence of dict
        Of the benchmark.
    path : str or Path
        Name of the PNG.

    Returns
    -------
    list of Path
    """
    timed = [row for row in rows if row["median_s"] not in (None, "")]
    with style():
        figure, axes = new_figure([0.2 * len(timed) + 0.1], left_in=3.6, right_in=0.6)
        plot_times(timed, axes[0])
        png = as_png(figure)
    write_atomically(path, png)
    return [Path(path)]


def plot_times(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw the median run time of every method as a bar, with its ratio to gearmon's."""
    places = range(len(rows))
    times = [1e3 * float(row["median_s"]) for row in rows]
    own = [float(row["times_own"] or 1.0) for row in rows]
    first = [i == 0 or _case(row) != _case(rows[i - 1]) for i, row in enumerate(rows)]
    ax.barh(places, times, color=[BLUE if new else GREY for new in first], height=0.7)
    ax.set_xscale("log")
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.set_yticks(
        list(places),
        [
            f"{_case(row)}: {row['method']}" if new else str(row["method"])
            for row, new in zip(rows, first, strict=True)
        ],
        fontsize=6.5,
    )
    for place, time, ratio, new in zip(places, times, own, first, strict=True):
        if not new:
            ax.annotate(
                f"{ratio:.2g} ×", (time, place), (3, 0), textcoords="offset points", va="center"
            )
    ax.set_xlabel("Median run time (ms), beside it as a multiple of gearmon's")
    light_grid(ax, "x")
    return ax


def _case(row: Row) -> str:
    channels = f", {row['channels']} channels" if int(row["channels"]) > 1 else ""
    return f"{row['case']}{channels}"
