"""Pictures of spectra."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from gearmon.report.palette import BLACK, GREY, series_colour, series_marker
from gearmon.report.plots import light_grid, spread
from gearmon.report.views import LineMark, SpectrumView
from gearmon.report.wording import power_of_ten, strip_label

# Least distance of two labels as a share of the axis: the height of a letter turned sideways.
_LABEL_DISTANCE = 0.019
# A picture shows at most so many decades below the highest line.
_DECADES = 6.0


def plot_spectrum(view: SpectrumView, ax: Axes) -> Axes:
    """Draw an amplitude spectrum with the places of the mesh harmonics and of the sidebands.

    Parameters
    ----------
    view : SpectrumView
        The spectrum and its marks.
    ax : Axes
        Where to draw.

    Returns
    -------
    Axes
        `ax`.
    """
    for mark in view.meshes:
        _mesh_line(mark, ax)
    ax.semilogy(view.frequency_hz, view.amplitude, color=BLACK, linewidth=0.55)
    _sidebands(view, ax)
    if len(view.frequency_hz):
        ax.set_xlim(view.frequency_hz[0], view.frequency_hz[-1])
        _limits(view, ax)
    light_grid(ax)
    ax.yaxis.set_major_locator(LogLocator(numticks=6))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter(FuncFormatter(_power))
    ax.set_ylabel(strip_label(view.channel, view.unit), fontsize=7)
    return ax


def _power(value: float, position: int) -> str:  # noqa: ARG001 (the caller gives both)
    return power_of_ten(round(float(np.log10(value)))) if value > 0 else ""


def _mesh_line(mark: LineMark, ax: Axes) -> None:
    colour = series_colour(mark.series)
    if mark.half_width_hz > 0:
        low, high = mark.frequency_hz - mark.half_width_hz, mark.frequency_hz + mark.half_width_hz
        ax.axvspan(low, high, color=colour, alpha=0.13, linewidth=0)
    ax.axvline(mark.frequency_hz, color=colour, linewidth=0.8, linestyle=(0, (4, 2)), alpha=0.8)


def _limits(view: SpectrumView, ax: Axes) -> None:
    shown = view.amplitude[view.amplitude > 0]
    if not len(shown):
        return
    heard = [mark.amplitude for mark in view.sidebands if mark.amplitude]
    high = max([float(shown.max()), *heard])
    low = max(float(np.percentile(shown, 1)) / 2, high * 10**-_DECADES)
    ax.set_ylim(low, 2.5 * high)


def _sidebands(view: SpectrumView, ax: Axes) -> None:
    for name, series in view.legend:
        own = [mark for mark in view.sidebands if mark.series == series]
        heard = [mark for mark in own if mark.amplitude is not None]
        colour = series_colour(series)
        ax.plot(
            [mark.frequency_hz for mark in heard],
            [mark.amplitude or np.nan for mark in heard],
            linestyle="none",
            marker=series_marker(series),
            markersize=4.2,
            markerfacecolor="none",
            markeredgecolor=colour,
            markeredgewidth=1.0,
            label=f"sidebands of {name}",
        )
        # ticks at the bottom show every place, heard or not
        ax.plot(
            [mark.frequency_hz for mark in own],
            np.full(len(own), 0.0),
            linestyle="none",
            marker=2,
            markersize=6 if series % 2 == 0 else 4,
            color=colour,
            transform=ax.get_xaxis_transform(),
            clip_on=False,
        )


def label_meshes(view: SpectrumView, ax: Axes) -> Axes:
    """Write the names of the mesh harmonics above the axes, sideways.

    Parameters
    ----------
    view : SpectrumView
        Its `meshes` carry the names.
    ax : Axes
        The uppermost axes of the picture, already drawn.

    Returns
    -------
    Axes
        `ax`.
    """
    low, high = ax.get_xlim()
    share = [(mark.frequency_hz - low) / (high - low) for mark in view.meshes]
    lines = max((mark.label.count("\n") + 1 for mark in view.meshes), default=1)
    places = spread(share, lines * _LABEL_DISTANCE, 0.0, 1.0)
    for mark, at, place in zip(view.meshes, share, places, strict=True):
        ax.annotate(
            mark.label,
            xy=(at, 1.0),
            xycoords="axes fraction",
            xytext=(place, 1.06),
            textcoords="axes fraction",
            rotation=90,
            linespacing=0.95,
            ha="center",
            va="bottom",
            fontsize=6.5,
            color=series_colour(mark.series),
            arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.4, "shrinkA": 0},
        )
    return ax


def label_sidebands(view: SpectrumView, ax: Axes) -> Axes:
    """Write the numbers of the sidebands of the widest spacing along the bottom, and the legend.

    Parameters
    ----------
    view : SpectrumView
        A close-up.
    ax : Axes
        Axes with its spectrum.

    Returns
    -------
    Axes
        `ax`.
    """
    spans = {
        series: [mark for mark in view.sidebands if mark.series == series]
        for _, series in view.legend
    }
    widest = max(
        (marks for marks in spans.values() if marks),
        key=lambda marks: marks[-1].frequency_hz - marks[0].frequency_hz,
        default=[],
    )
    for mark in widest:
        ax.annotate(
            mark.label,
            xy=(mark.frequency_hz, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 1.5),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=6.5,
            color=series_colour(mark.series),
        )
    return ax
