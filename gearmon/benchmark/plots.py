"""Pictures of the benchmarks, drawn from their rows: what a table cannot tell as well."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearmon.benchmark.detection import OURS, RIVALS, detection_summary
from gearmon.benchmark.timing import Row
from gearmon.report import plots

Style = dict[str, Any]

LOG_LOG = {"xscale": "log", "yscale": "log"}
#: Least probability that is shown.
LEAST = 1e-4


def styles(names: Iterable[str]) -> dict[str, Style]:
    """Return colour and marker of every name, all told apart."""
    return {
        name: {"color": plots.series_colour(n), "marker": plots.series_marker(n + n // 8)}
        for n, name in enumerate(names)
    }


#: Of every detector.
DETECTOR_STYLES = styles((OURS, *RIVALS))


def _panels(count: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with so many axes over a faint grid."""
    lines = math.ceil(count / columns)
    figure = plots.sheet(width * columns + 0.6, height * lines + 0.5)
    axes = [figure.add_subplot(lines, columns, place + 1) for place in range(count)]
    for ax in axes:
        plots.light_grid(ax, "both")
    return figure, axes


def dynamics_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return the run time over the error of every method, one panel a case."""
    table = pd.DataFrame(rows).dropna(subset=["error", "median_s"])
    table = table[table["case"].isin(table["case"][table["unknowns"].notna()])]
    looks = styles(table["method"].drop_duplicates())
    cases = table.groupby("case", sort=False)
    figure, axes = _panels(len(cases), 4, 3.3, 2.9)
    for ax, (name, own) in zip(axes, cases, strict=True):
        plot_work_precision(own, ax, looks)
        ax.set_title(str(name), fontsize=9)
    told = "relative L2 error of acceleration (of a chart: error of ln of the multiplier)"
    figure.supxlabel(f"{told}, more accurate to the right", fontsize=9)
    figure.supylabel("median run time in s", fontsize=9)
    plots.legend(figure, axes, where="upper center")
    return {"": figure}


def plot_work_precision(table: pd.DataFrame, ax: Axes, looks: dict[str, Style]) -> Axes:
    """Draw the median run time of every method over its error, for one case.

    Parameters
    ----------
    table : DataFrame
        Columns method, error and median_s, in the order of the settings: a method that stalls is
        seen to turn back.
    ax : Axes
    looks : dict of str to dict
        See `styles`.
    """
    for method, own in table.groupby("method", sort=False):
        ax.plot(own["error"], own["median_s"], **looks[str(method)], markersize=4, label=method)
    ax.set(**LOG_LOG)
    ax.axvline(1e-6, color=plots.LIGHT_GREY, linewidth=3, zorder=0)
    ax.set_xlim(min(2 * table["error"].max(), 3.0), max(0.5 * table["error"].min(), 1e-15))
    return ax


def detection_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return the pictures of the benchmark of detection.

    Parameters
    ----------
    rows : sequence of dict
        From `gearmon.benchmark.detection.run_detection`.
    """
    table, summary = pd.DataFrame(rows), pd.DataFrame(detection_summary(rows))
    roc, areas = _panels(2, 2, 5.2, 4.4)
    size, sizes = _panels(2, 2, 5.2, 4.4)
    false_alarms, (alarms,) = _panels(1, 1, 5.2, 4.4)
    kinds, (matrix,) = _panels(1, 1, 5.2, 4.6)
    shown = (True, "with tacho", plots.BLUE), (False, "without tacho", plots.VERMILLION)
    for place, (tacho, name, colour) in enumerate(shown):
        own = table[table["tacho"] == tacho]
        plot_areas(summary[summary["tacho"] == tacho], areas[place])
        plot_reliability(own, alarms, colour, name)
        plot_sizes(own[own["gear_right"].eq(True) & own["loss"].notna()], sizes[place])
        for ax in (areas[place], sizes[place]):
            ax.set_title(name, fontsize=10)
    alarms.plot([LEAST, 1.0], [LEAST, 1.0], color=plots.BLACK, linewidth=0.9, label="as stated")
    alarms.legend(fontsize=8, loc="lower right")
    plot_kinds(table[table["tacho"]], matrix)
    plots.legend(roc, areas, 1, "right center")
    return {"roc": roc, "false-alarms": false_alarms, "kinds": kinds, "size": size}


def plot_areas(summary: pd.DataFrame, ax: Axes) -> Axes:
    """Draw the area of every detector over the loss, with 95 % intervals over machines.

    Parameters
    ----------
    summary : DataFrame
        With or without tacho.
    ax : Axes
    """
    own = summary[summary["figure"] == "ROC area"]
    own = own.assign(loss=100 * own["of"].str.removeprefix("loss ").astype(float))
    for place, (name, style) in enumerate(DETECTOR_STYLES.items()):
        points = own[own["detector"] == name]
        if len(points):
            # a little apart, so that they can be told from one another
            shifted, width = points["loss"] * 1.02 ** (place - 5), 2.2 if name == OURS else 1.0
            ax.plot(shifted, points["value"], **style, linewidth=width, label=name)
            limits = points["low"], points["high"]
            ax.vlines(shifted, *limits, color=style["color"], linewidth=width / 2)
    ax.axhline(0.5, color=plots.LIGHT_GREY, linewidth=3, zorder=0)
    ticks = sorted(set(own["loss"]))
    ax.set(xscale="log", ylim=(0.35, 1.02), ylabel="area under the ROC curve")
    ax.set_xticks(ticks, [f"{x:g}" for x in ticks])
    ax.minorticks_off()
    ax.set_xlabel("loss of one tooth's pair stiffness in %")
    return ax


def plot_reliability(table: pd.DataFrame, ax: Axes, colour: str, name: str) -> Axes:
    """Draw which share of healthy recordings has a stated probability at most so small."""
    stated = table["probability"][table["condition"] == "healthy"].dropna().clip(lower=LEAST)
    if len(stated):
        ax.ecdf(stated, color=colour, label=f"{name}, {len(stated)} healthy recordings")
    ax.set(**LOG_LOG, xlim=(LEAST, 1.0), ylim=(LEAST, 1.1))
    ax.set(xlabel="stated false-alarm probability", ylabel="observed share of healthy recordings")
    return ax


def plot_kinds(table: pd.DataFrame, ax: Axes) -> Axes:
    """Draw the confusion matrix of the true condition and the first flag."""
    found = table["found_kind"].where(table["found_kind"].fillna("") != "", table["verdict"])
    counts = pd.crosstab(table["condition"], found)
    share = counts.div(counts.sum(axis=1), axis=0).to_numpy()
    ax.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (i, j), number in np.ndenumerate(counts.to_numpy()):
        if number:
            colour = "white" if share[i, j] > 0.6 else plots.BLACK
            ax.text(j, i, f"{number}", ha="center", va="center", color=colour, fontsize=8)
    ax.set_xticks(range(counts.shape[1]), list(counts.columns), rotation=45, ha="right")
    ax.set_yticks(range(counts.shape[0]), list(counts.index))
    ax.set(xlabel="found", ylabel="true")
    ax.grid(visible=False)
    return ax


def plot_sizes(table: pd.DataFrame, ax: Axes) -> Axes:
    """Draw the estimated loss of every recording over the true one, with the stated interval."""
    inside = table["size"].between(table["loss_low"], table["loss_high"])
    within = inside, plots.BLUE, "90 % interval holds the true loss"
    for held, colour, label in (within, (~inside, plots.VERMILLION, "it does not")):
        own = table[held].sort_values("loss")
        # those of one loss beside one another
        apart = own.groupby("size").cumcount() - own["size"].map(own["size"].value_counts()) / 2
        at = 100 * own["size"] * 1.01**apart
        low = (100 * own["loss_low"]).clip(lower=0.01)
        ax.vlines(at, low, 100 * own["loss_high"], color=colour, linewidth=0.8)
        ax.plot(at, 100 * own["loss"], ".", color=colour, markersize=4, label=label)
    line = np.array([0.7, 60.0])
    ax.plot(line, line, color=plots.BLACK, linewidth=0.9, label="estimated = true")
    ax.fill_between(
        line, 0.75 * line, 1.25 * line, color=plots.LIGHT_GREY, alpha=0.6, label="±25 %"
    )
    ax.set(**LOG_LOG, ylim=(0.2, 150), xlabel="true loss in %", ylabel="estimated loss in %")
    ax.legend(fontsize=8, loc="upper left")
    return ax
