"""Order maps: amplitude in colour over order and time, or order and speed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from gearmon.files import write_atomically
from gearmon.report.order_plots import order_axis
from gearmon.report.palette import BLUE, LIGHT_GREY
from gearmon.report.plots import as_png, left_label, light_grid, new_figure, style
from gearmon.report.spectrum_command_plots import MOST_STRIPS, label_marks, line_marks
from gearmon.report.wording import shortened, unit_text
from gearmon.signatures.order_spectra import OrderSpectra

FloatArray = NDArray[np.float64]

# Columns of a map: more than a page shows.
_COLUMNS = 900
# What lies further below the highest value of a channel is all one colour at any rate.
_DECADES = 4.0
# Room to the right: speed along time, and the scale of colours [inch].
_SPEED_IN, _SCALE_IN = 0.85, 1.0


def save_order_map(found: OrderSpectra, path: Path) -> Path:
    """Draw the order map of every channel and write the picture.

    Parameters
    ----------
    found : OrderSpectra
    path : Path
        Name of the PNG.

    Returns
    -------
    Path
        `path`.
    """
    with style():
        png = as_png(order_map_figure(found), many_colours=True)
    write_atomically(path, png)
    return path


def order_map_figure(found: OrderSpectra) -> Figure:
    """Draw a map a channel; along time with the speed of the shaft beside each."""
    names = found.channel_names[:MOST_STRIPS]
    marks = line_marks(found.marks, *_ends(found))
    heights = [2.2 if len(names) < 3 else 1.3] * len(names)
    over_time = found.map.against == "time"
    right = _SCALE_IN + (_SPEED_IN if over_time else 0.0)
    figure, axes = new_figure(
        heights, top_in=0.78, right_in=right, left_in=0.62, gap_in=0.3 if len(names) > 1 else 0.12
    )
    for row, (name, ax) in enumerate(zip(names, axes, strict=True)):
        image = plot_order_map(found, row, ax)
        edge = _beside(found, figure, ax, row == len(names) - 1) if over_time else _right(ax)
        place = ax.get_position()
        scale = figure.add_axes((edge + 0.015, place.y0, 0.014, place.height))
        bar = figure.colorbar(image, cax=scale, extend="min")
        bar.set_label(
            f"{shortened(name)}\npeak amplitude ({unit_text(found.units[row])})", fontsize=6.5
        )
        if row < len(names) - 1:
            ax.tick_params(labelbottom=False)
    label_marks(marks, axes[0])
    axes[-1].set_xlabel(order_axis(found))
    left_label(figure, axes, "Time (s)" if over_time else f"Speed of shaft {found.shaft} (Hz)")
    if not over_time and len(_gaps(found)):
        figure.text(0.995, 0.004, "grey: speeds that were not recorded", ha="right", fontsize=6)
    return figure


def _ends(found: OrderSpectra) -> tuple[float, float]:
    # the mean and what leaks from it are no lines
    order = found.map.order
    return float(order[min(2, len(order) - 1)]), float(order[-1])


def _right(ax: Axes) -> float:
    return float(ax.get_position().x1)


def plot_order_map(found: OrderSpectra, row: int, ax: Axes) -> AxesImage:
    """Draw amplitude over order and time, or order and speed, of one channel.

    Parameters
    ----------
    found : OrderSpectra
    row : int
        Channel.
    ax : Axes
        Where to draw.

    Returns
    -------
    AxesImage
        Of the largest value in each of at most 900 columns, in a logarithmic scale of colours four
        decades deep or less.
    """
    values, low, high = _evenly(found, found.map.amplitude[:, row, 2:])
    columns = min(_COLUMNS, values.shape[1])
    edges = np.linspace(0, values.shape[1], columns + 1).astype(int)[:-1]
    held = np.maximum.reduceat(values, edges, axis=1)
    top = max(float(np.nanmax(held)), np.finfo(float).tiny)
    # colours are spent on what stands above the quietest twentieth, within four decades
    low_end = max(min(float(np.nanpercentile(held, 5)), 0.1 * top), top * 10**-_DECADES)
    shown = np.ma.masked_invalid(np.maximum(held, low_end))
    first, last = _ends(found)
    image = ax.imshow(
        shown,
        aspect="auto",
        origin="lower",
        extent=(first, last, low, high),
        cmap=colormaps["viridis"].with_extremes(bad=LIGHT_GREY),
        norm=LogNorm(vmin=low_end, vmax=top),
        interpolation="nearest",
    )
    ax.yaxis.set_major_locator(MaxNLocator(5))
    return image


def _evenly(found: OrderSpectra, values: FloatArray) -> tuple[FloatArray, float, float]:
    """Put the rows of a map on an even scale, NaN where there is none; and its ends."""
    own = found.map
    low, high = float(own.low[0]), float(own.high[-1])
    step = float(own.high[0] - own.low[0])
    count = max(1, round((high - low) / step))
    if count == len(own.low) or own.against == "time":
        return values, low, high
    even = np.full((count, values.shape[1]), np.nan)
    even[np.rint((own.low - low) / step).astype(int)] = values
    return even, low, high


def _gaps(found: OrderSpectra) -> FloatArray:
    own = found.map
    step = own.high - own.low
    gaps: FloatArray = np.flatnonzero(own.low[1:] - own.high[:-1] > 0.5 * step[1:]).astype(float)
    return gaps


def _beside(found: OrderSpectra, figure: Figure, ax: Axes, lowest: bool) -> float:
    """Draw the speed along time at the right of a map; return where that ends."""
    own, place = found.map, ax.get_position()
    width = _SPEED_IN / figure.get_figwidth()
    beside = figure.add_axes((place.x1 + 0.01, place.y0, width - 0.02, place.height))
    beside.plot(own.speed_hz, own.time_s, color=BLUE, linewidth=1.0)
    low, high = float(own.speed_hz.min()), float(own.speed_hz.max())
    # a steady speed must not be blown up until its last digit looks like trouble
    room = max(0.15 * (high - low), 0.005 * high)
    beside.set_xlim(low - room, high + room)
    beside.set_ylim(ax.get_ylim())
    beside.yaxis.set_major_locator(MaxNLocator(5))
    beside.xaxis.set_major_locator(MaxNLocator(2))
    beside.tick_params(labelleft=False, labelsize=6, labelbottom=lowest)
    light_grid(beside, "both")
    if lowest:
        beside.set_xlabel(f"Shaft {found.shaft} (Hz)", fontsize=6.5)
        beside.ticklabel_format(useOffset=False, axis="x")
    return float(place.x1 + width - 0.01)
