"""Pictures of stability: where free vibrations of a mesh grow. Each draws on given axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure

from gearmon.dynamics.fourier import Real
from gearmon.dynamics.stability_map import StabilityMap, Tongue
from gearmon.files import replacing
from gearmon.report.palette import BLACK, BLUE, GREEN, GREY, SERIES, VERMILLION

LINES = {1: (GREEN, ":"), 2: (BLUE, "--"), 3: (GREY, "-.")}
SPEED_LABEL = "mesh frequency over natural frequency, $\\omega/\\omega_0$"
VARIATION_LABEL = "stiffness variation $\\varepsilon$"


def plot_stability_map(stability: StabilityMap, ax: Axes) -> QuadContourSet | None:
    """Draw growth as filled contours, boundaries exact and by multiple scales, and the mark.

    Parameters
    ----------
    stability : StabilityMap
    ax : Axes

    Returns
    -------
    QuadContourSet or None
        For a colour bar; None if nothing grows on the grid.
    """
    chart = stability.chart
    _axes(ax, stability)
    filled = None
    top = float(chart.growth.max())
    if top > 1e-9:
        filled = ax.contourf(
            chart.speeds,
            chart.variations,
            chart.growth,
            levels=np.linspace(0.0, top, 13),
            cmap="YlOrRd",
            vmin=-0.15 * top,
        )
    for tongue in stability.tongues:
        _boundary(ax, tongue, tongue.exact, BLACK, "-", "boundary, exact")
        for order, edges in tongue.expanded.items():
            colour, dashes = LINES.get(order, (GREY, "-."))
            name = {1: "1st", 2: "2nd", 3: "3rd"}.get(order, f"{order}th")
            _boundary(ax, tongue, edges, colour, dashes, f"multiple scales, {name} order")
    if stability.mark is not None:
        ax.plot(
            *stability.mark,
            marker="*",
            markersize=13,
            color="white",
            markeredgecolor=BLACK,
            linestyle="none",
            label="this pair",
            clip_on=False,
            zorder=5,
        )
    ax.set_title(f"damping ratio {chart.damping_ratio:.3g}", fontsize=10)
    _legend(ax)
    return filled


def plot_damped_tongues(maps: Sequence[StabilityMap], ax: Axes) -> Axes:
    """Draw the exact boundaries of one stiffness form for several damping ratios.

    Parameters
    ----------
    maps : sequence of StabilityMap
        Of the same stiffness form and range.
    ax : Axes
    """
    _axes(ax, maps[0])
    for index, stability in enumerate(maps):
        for tongue in stability.tongues:
            label = f"damping ratio {stability.chart.damping_ratio:.3g}"
            _boundary(ax, tongue, tongue.exact, SERIES[index % len(SERIES)], "-", label)
    _legend(ax)
    return ax


def stability_figure(stability: StabilityMap) -> Figure:
    """Return one chart with its colour bar."""
    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    ax = figure.add_subplot()
    filled = plot_stability_map(stability, ax)
    if filled is not None:
        bar = figure.colorbar(filled, ax=ax, format="%.2g")
        bar.set_label("growth: ln of the largest multiplier, per mesh period")
    else:
        ax.text(
            0.5,
            0.5,
            "stable everywhere",
            transform=ax.transAxes,
            ha="center",
            va="center",
            color=GREY,
            fontsize=13,
        )
    return figure


def save_stability_figure(stability: StabilityMap, path: str | Path) -> Path:
    """Write the chart as a picture; the format follows the suffix of `path`."""
    target = Path(path)
    with replacing(target) as temporary:
        stability_figure(stability).savefig(temporary, dpi=130)
    return target


def _boundary(ax: Axes, tongue: Tongue, edges: Real, colour: str, dashes: str, label: str) -> None:
    """Draw both edges of each stretch of eps on which the tongue is open as one line."""
    left, right = ax.get_xlim()
    there = np.asarray(np.isfinite(edges).all(axis=1))
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]])))
    for first, last in zip(bounds[::2], bounds[1::2], strict=True):
        (low, high), eps = edges[first:last].T, tongue.variations[first:last]
        x, y = np.concatenate([low[::-1], high]), np.concatenate([eps[::-1], eps])
        if x.max() < left or x.min() > right:
            continue
        closes = last < len(there)
        if closes and dashes == "-":
            x, y = np.append(x, x[0]), np.append(y, y[0])
        ax.plot(x, y, color=colour, linestyle=dashes, linewidth=1.3, label=label)


def _axes(ax: Axes, stability: StabilityMap) -> None:
    chart = stability.chart
    ax.set_xlim(chart.speeds[0], chart.speeds[-1])
    ax.set_ylim(0, chart.variations[-1])
    ax.set_xlabel(SPEED_LABEL)
    ax.set_ylabel(VARIATION_LABEL)
    starts = [2 / tongue.number for tongue in stability.tongues]
    inside = [x for x in starts if chart.speeds[0] <= x <= chart.speeds[-1]]
    if inside:
        ax.plot(
            inside,
            np.zeros(len(inside)),
            marker="^",
            markersize=5,
            color=VERMILLION,
            linestyle="none",
            clip_on=False,
            label="$2/n$",
            zorder=4,
        )


def _legend(ax: Axes) -> None:
    """Show each name once, below the axes where it hides nothing."""
    handles, labels = ax.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    ax.legend(
        named.values(),
        named.keys(),
        fontsize=8,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.13),
        ncols=5,
        frameon=False,
    )
