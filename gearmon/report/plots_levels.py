"""Pictures of levels: against the reference, against the expected pattern, and their changes."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from gearmon.report.palette import (
    BLACK,
    BLUE,
    GREY,
    LIGHT_GREY,
    VERMILLION,
    series_colour,
    series_marker,
)
from gearmon.report.plots import light_grid
from gearmon.report.views import ChangesView, FamilyGroup, FloatArray, LevelsView, PatternView
from gearmon.report.wording import shortened, strip_label

# Cells narrower than this share of the page cannot hold a number.
_NARROWEST_NUMBERED = 1 / 44


def plot_levels(view: LevelsView, ax: Axes) -> Axes:
    """Draw measured levels over the range of the healthy recordings.

    Parameters
    ----------
    view : LevelsView
        Levels of one channel.
    ax : Axes
        Where to draw.

    Returns
    -------
    Axes
        `ax`.
    """
    place = _places(view.groups, len(view.measured_db))
    _healthy(view, place, ax)
    for chosen, colour, marker, size, label in (
        (~view.beyond, BLUE, "o", 3.2, "measured"),
        (view.beyond, VERMILLION, "D", 4.2, "measured, changed by more than 3 standard deviations"),
    ):
        ax.plot(
            place[chosen],
            view.measured_db[chosen],
            linestyle="none",
            marker=marker,
            markersize=size,
            color=colour,
            label=label,
            zorder=5,
        )
    _group_lines(view.groups, ax)
    light_grid(ax)
    ax.set_ylabel(strip_label(view.channel, view.unit), fontsize=7)
    ax.yaxis.set_major_locator(MaxNLocator(5))
    return ax


def _healthy(view: LevelsView, place: FloatArray, ax: Axes) -> None:
    """Draw what the reference tells, as far as there is one."""
    low, high = _at_least(view.low_db, view.high_db, 0.8)
    if np.isfinite(low).any():
        ax.bar(
            place,
            high - low,
            bottom=low,
            width=0.86,
            color=LIGHT_GREY,
            edgecolor=GREY,
            linewidth=0.4,
            label="range of the healthy recordings",
        )
    if np.isfinite(view.expected_db).any():
        ax.errorbar(
            place,
            view.expected_db,
            yerr=view.scatter_db,
            fmt="_",
            color=BLACK,
            markersize=5,
            markeredgewidth=1.0,
            elinewidth=0.6,
            label="healthy at this load and gain, ± standard deviation",
        )


def _at_least(low: FloatArray, high: FloatArray, height: float) -> tuple[FloatArray, FloatArray]:
    """Bars of one healthy recording would have no height: give them one that can be seen."""
    short = np.maximum(0.0, height - (high - low)) / 2
    return low - short, high + short


def _places(groups: Sequence[FamilyGroup], count: int) -> FloatArray:
    """Place of every family on the horizontal axis: groups in a row, one place between them."""
    place = np.full(count, np.nan)
    start = 0.0
    for group in groups:
        for offset, column in enumerate(group.columns):
            place[column] = start + offset
        start += len(group.columns) + 1.0
    return place


def _group_lines(groups: Sequence[FamilyGroup], ax: Axes) -> None:
    end = 0.0
    for before, group in zip(groups, [*groups[1:], None], strict=True):
        end += len(before.columns) + 1.0
        if group is not None:
            new_stage = group.stage != before.stage
            ax.axvline(
                end - 1.0,
                color=BLACK if new_stage else LIGHT_GREY,
                linewidth=0.9 if new_stage else 0.6,
            )
    ax.set_xlim(-1.0, end - 1.0)
    ax.set_xticks([])


def label_groups(groups: Sequence[FamilyGroup], top: Axes, bottom: Axes) -> Axes:
    """Write the stages above the axes, mesh harmonics and names of the groups below.

    Parameters
    ----------
    groups : sequence of FamilyGroup
        The groups, as drawn.
    top, bottom : Axes
        The uppermost and the lowest axes of the picture; may be the same.

    Returns
    -------
    Axes
        `bottom`.
    """
    ticks: list[float] = []
    numbers, start = [], 0.0
    sideways = sideways_labels(groups)
    spans: dict[int, tuple[float, float]] = {}
    for group in groups:
        ticks += [start + offset for offset in range(len(group.columns))]
        numbers += [str(harmonic) for harmonic in group.harmonics]
        end = start + len(group.columns) - 1
        spans[group.stage] = (spans.get(group.stage, (start, end))[0], end)
        bottom.annotate(
            group.label.replace("\n", " ") if sideways else group.label,
            xy=((start + end) / 2, 0.0),
            xycoords=("data", "axes fraction"),
            xytext=(4 if sideways else 0, -13),
            textcoords="offset points",
            ha="right" if sideways else "center",
            va="top",
            fontsize=6.5,
            rotation=45 if sideways else 0,
            rotation_mode="anchor" if sideways else "default",
        )
        start = end + 2.0
    for stage, (first, last) in spans.items():
        top.annotate(
            f"about the harmonics of mesh {stage}",
            xy=((first + last) / 2, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=7,
        )
    few = len(ticks) <= 64
    bottom.set_xticks(ticks, numbers if few else [""] * len(ticks), fontsize=6)
    bottom.tick_params(axis="x", length=2, pad=1.5, labelbottom=True)
    return bottom


def sideways_labels(groups: Sequence[FamilyGroup]) -> bool:
    """Tell whether the names of the groups are too long to stand upright below them."""
    total = sum(len(group.columns) + 1 for group in groups)
    # a name of two lines takes about a thirteenth of the width
    return min(len(group.columns) + 1 for group in groups) / total < 1 / 13


def plot_changes(view: ChangesView, ax: Axes) -> AxesImage:
    """Draw the changes of one stage as coloured cells, with numbers where they fit.

    Parameters
    ----------
    view : ChangesView
        The changes.
    ax : Axes
        Where to draw.

    Returns
    -------
    AxesImage
        The cells, for a colour scale.
    """
    rows, channels, harmonics = view.change_db.shape
    table = view.change_db.reshape(rows, channels * harmonics)
    beyond = view.beyond.reshape(rows, channels * harmonics)
    colours = matplotlib.colormaps["RdBu_r"].with_extremes(bad="#f1f1f1")
    image = ax.imshow(
        np.ma.masked_invalid(table),
        cmap=colours,
        vmin=-view.limit_db,
        vmax=view.limit_db,
        aspect="auto",
        interpolation="nearest",
    )
    numbered = 0.8 / table.shape[1] > _NARROWEST_NUMBERED
    for row, column in np.argwhere(np.isfinite(table)):
        _cell(
            ax,
            int(row),
            int(column),
            table[row, column] / view.limit_db,
            _number(table[row, column]) if numbered else "",
            bool(beyond[row, column]),
        )
    for edge in range(1, channels):
        ax.axvline(edge * harmonics - 0.5, color="white", linewidth=3)
    ax.set_yticks(range(rows), view.rows)
    every = 1 if table.shape[1] <= 48 else 2
    ticks = [c for c in range(table.shape[1]) if c % harmonics % every == 0]
    ax.set_xticks(ticks, [str(view.harmonics[c % harmonics]) for c in ticks], fontsize=6)
    ax.tick_params(length=0, pad=2)
    for spine in ax.spines.values():
        spine.set_visible(False)
    for block, channel in enumerate(view.channels):
        ax.annotate(
            shortened(channel),
            xy=((block + 0.5) / channels, 1.0),
            xycoords="axes fraction",
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontweight="bold",
            fontsize=7.5,
        )
    ax.set_xlabel(f"Harmonic of mesh {view.stage}")
    return image


def _number(change_db: float) -> str:
    return "0" if abs(change_db) < 0.5 else f"{change_db:+.0f}".replace("-", "−")


def _cell(ax: Axes, row: int, column: int, share: float, number: str, beyond: bool) -> None:
    dark = abs(share) > 0.62
    if number:
        ax.text(
            column,
            row,
            number,
            ha="center",
            va="center",
            fontsize=6,
            color="white" if dark else BLACK,
            fontweight="bold" if beyond else "normal",
        )
    elif beyond:
        ax.plot(column, row, marker="o", markersize=1.8, color="white" if dark else BLACK)
    if beyond:
        ax.add_patch(
            Rectangle(
                (column - 0.44, row - 0.44), 0.88, 0.88, fill=False, edgecolor=BLACK, linewidth=0.9
            )
        )


def plot_pattern(view: PatternView, ax: Axes) -> Axes:
    """Draw the mesh harmonics of one stage relative to the strongest, expected and measured.

    Parameters
    ----------
    view : PatternView
        The patterns.
    ax : Axes
        Where to draw.

    Returns
    -------
    Axes
        `ax`.
    """
    ax.bar(
        view.harmonics,
        view.expected_db - _floor_db(view),
        bottom=_floor_db(view),
        width=0.62,
        color=LIGHT_GREY,
        edgecolor=GREY,
        linewidth=0.6,
        label="expected at the mesh",
    )
    count = len(view.channels)
    for row, channel in enumerate(view.channels):
        offset = 0.5 * ((row + 0.5) / count - 0.5)
        ax.plot(
            view.harmonics + offset,
            view.measured_db[row],
            linestyle="none",
            marker=series_marker(row),
            markersize=4.5,
            color=series_colour(row),
            label=f"measured, {channel}",
        )
    labels = [f"×{k}\n{f:.4g} Hz" for k, f in zip(view.harmonics, view.frequency_hz, strict=True)]
    ax.set_xticks(view.harmonics, labels)
    ax.set_ylim(_floor_db(view), 4)
    light_grid(ax)
    ax.set_ylabel("Level re strongest\nharmonic (dB)")
    ax.set_title(f"Mesh {view.stage}", fontweight="bold", pad=3)
    return ax


def _floor_db(view: PatternView) -> float:
    shown = view.measured_db[np.isfinite(view.measured_db)]
    lowest = min([float(view.expected_db.min()), *shown.tolist()])
    return 10.0 * float(np.floor(lowest / 10.0 - 0.3))
