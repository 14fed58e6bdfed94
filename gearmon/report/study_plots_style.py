"""What the pictures of the study share: colours of ordered values, lines, decibels, panels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from gearmon.report.palette import BLACK, LIGHT_GREY

WIDTH = 11.0
LINE = 1.3
#: Highest frequency of the spectra shown [kHz]; every line above is weaker than those shown.
HIGHEST_KHZ = 25.0

FloatArray = NDArray[np.float64]


def shades(count: int) -> list[tuple[float, float, float, float]]:
    """Return colours in the order of their values, dark to light and apart in grey print too."""
    # the light end of the map is too pale on white
    return [colormaps["viridis"](x) for x in np.linspace(0.0, 0.88, count)]


def sheet(height: float) -> Figure:
    """Return an empty sheet of the common width; height in inches."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


def titled(ax: Axes, title: str) -> Axes:
    """Give a panel its title and a light grid."""
    ax.set_title(title, loc="left", fontsize=9.5)
    ax.grid(color=LIGHT_GREY, linewidth=0.5)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=8)
    return ax


def labelled(ax: Axes, x: str, y: str) -> Axes:
    """Name the axes with their units."""
    ax.set_xlabel(x, fontsize=9)
    ax.set_ylabel(y, fontsize=9)
    return ax


def value_legend(figure: FigureBase, names: Sequence[str], title: str) -> None:
    """Put the colours of a swept parameter beside the panels."""
    handles = [
        Line2D([], [], color=colour, linewidth=2, label=name)
        for colour, name in zip(shades(len(names)), names, strict=True)
    ]
    figure.legend(
        handles=handles, title=title, loc="outside right upper", fontsize=8, title_fontsize=9
    )


def decibels(amplitudes: ArrayLike, reference: float = 1.0) -> FloatArray:
    """Return 20 lg of amplitudes over the reference; zeros become -400 dB."""
    sizes = np.maximum(np.abs(np.asarray(amplitudes, dtype=np.float64)), 1e-20 * reference)
    return np.asarray(20 * np.log10(sizes / reference))


def stems(
    ax: Axes, x: ArrayLike, y: ArrayLike, floor: float, colour: object, label: str = ""
) -> None:
    """Draw lines of a spectrum from a floor up, with a point on top; those below are left out."""
    heights, places = np.asarray(y, dtype=np.float64), np.asarray(x, dtype=np.float64)
    kept = heights > floor
    ax.vlines(places[kept], floor, heights[kept], color=colour, linewidth=1.0)
    ax.plot(places[kept], heights[kept], "o", color=colour, markersize=2.6, label=label or None)


def grid_of_panels(figure: FigureBase, count: int, columns: int) -> list[Axes]:
    """Return panels that share both axes, row by row; only outer ones keep their tick labels."""
    rows = -(-count // columns)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    panels = list(grid.ravel())
    for spare in panels[count:]:
        spare.set_visible(False)
        # the panel above keeps the labels that its absent neighbour would have had
        panels[panels.index(spare) - columns].xaxis.set_tick_params(labelbottom=True)
    return panels[:count]


def zero_line(ax: Axes) -> None:
    """Mark zero."""
    ax.axhline(0.0, color=BLACK, linewidth=0.6)
