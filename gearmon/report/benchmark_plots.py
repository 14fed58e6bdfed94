"""Pictures of benchmarks, drawn from their rows: run time over error, factors, growth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearmon.files import replacing
from gearmon.report.palette import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT_GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
)

Row = dict[str, Any]

#: Colour, marker and dashes of every method: the same in all pictures.
STYLES: dict[str, tuple[str, str, str]] = {
    "steady_state": (BLUE, "o", "-"),
    "sweep": (BLUE, "D", "-"),
    "steady_state of the Fourier sum": (BLUE, "o", "-"),
    "the same, acceleration from forces": (SKY, "D", "-"),
    "harmonic balance": (SKY, "s", "-"),
    "multiple scales, plain sum": (GREEN, "^", "--"),
    "multiple scales, least residual": (GREEN, "v", "-"),
    "exact pieces": (GREEN, "*", "-"),
    "SciPy RK45": (ORANGE, "o", ":"),
    "SciPy DOP853": (ORANGE, "s", "-"),
    "SciPy LSODA": (VERMILLION, "^", "-"),
    "SciPy Radau": (ORANGE, "v", "--"),
    "SciPy odeint": (VERMILLION, "D", "-"),
    "SciPy DOP853, as usually written": (BLACK, "s", ":"),
    "SciPy LSODA, as usually written": (BLACK, "^", ":"),
    "SciPy DOP853, shooting": (PURPLE, "P", "-"),
    "compiled RK4 from rest": (GREY, "X", "-"),
    "compiled RK4, shooting": (GREY, "P", "--"),
    "solve_banded": (BLACK, "*", "-"),
}
FALLBACK = (BLACK, ".", ":")
SPECIAL = ("parameter sets", "cost growth")
TARGET = 1e-6


def plot_work_precision(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw the median run time of every method over its error, for one case.

    Parameters
    ----------
    rows : sequence of dict
        With method, error and median_s; rows without a figure are left out.
    ax : Axes

    Returns
    -------
    Axes
    """
    for method in dict.fromkeys(row["method"] for row in rows):
        points = [
            (row["error"], row["median_s"])
            for row in rows
            if row["method"] == method and row["error"] and row["median_s"]
        ]
        if not points:
            continue
        colour, marker, dashes = STYLES.get(method, FALLBACK)
        # in the order of their settings, so that a method that stalls is seen to turn back
        ax.plot(
            *zip(*points, strict=True),
            color=colour,
            marker=marker,
            linestyle=dashes,
            markersize=4,
            linewidth=1.1,
            label=method,
        )
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.axvline(TARGET, color=LIGHT_GREY, linewidth=3, zorder=0)
    low, high = ax.get_xlim()
    ax.set_xlim(min(high, 3.0), max(low, 1e-15))
    ax.grid(True, which="major", color=LIGHT_GREY, linewidth=0.4)
    return ax


def work_precision_figure(rows: Sequence[Row]) -> Figure:
    """Return small multiples, one a case, with the axes in common."""
    cases = [name for name in dict.fromkeys(row["case"] for row in rows) if name not in SPECIAL]
    columns = min(4, len(cases))
    lines = math.ceil((len(cases) + 1) / columns)
    figure = Figure(figsize=(3.3 * columns + 0.6, 2.9 * lines + 0.4), layout="constrained")
    axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, name in zip(axes, cases, strict=False):
        plot_work_precision([row for row in rows if row["case"] == name], ax)
        ax.set_title(name, fontsize=9)
        ax.tick_params(labelsize=8, labelbottom=True)
    for ax in axes[len(cases) :]:
        ax.axis("off")
    _limits(list(axes[: len(cases)]))
    figure.supxlabel("relative L2 error of acceleration, more accurate to the right", fontsize=9)
    figure.supylabel("median run time in s", fontsize=9)
    _method_legend(rows, axes[len(cases)])
    return figure


def _limits(axes: Sequence[Axes]) -> None:
    """Undo the clipping of single axes: shared ones take the last."""
    points = np.concatenate(
        [np.asarray(line.get_xydata()) for ax in axes for line in ax.lines[:-1]]
        or [np.array([[1.0, 1.0]])]
    )
    error, time = points[points[:, 0] > 0].T
    axes[0].set_xlim(min(3.0, 2 * error.max()), max(1e-15, 0.5 * error.min()))
    axes[0].set_ylim(0.5 * time.min(), 2 * time.max())


def _method_legend(rows: Sequence[Row], ax: Axes) -> None:
    drawn = {row["method"] for row in rows if row["median_s"] and row["case"] not in SPECIAL}
    handles = [
        ax.plot([], [], color=c, marker=m, linestyle=d, markersize=5, label=name)[0]
        for name, (c, m, d) in STYLES.items()
        if name in drawn
    ]
    ax.legend(handles=handles, fontsize=8, loc="center", frameon=False)


def ratio_figure(rows: Sequence[Row]) -> Figure:
    """Return a bar a rival and case: its run time over ours at an error of 1e-6.

    Of each method the cheapest row within the error counts. Bars to the right of 1 are slower.
    """
    cases = [
        name
        for name in dict.fromkeys(row["case"] for row in rows)
        if any(row["at_target"] for row in rows if row["case"] == name)
    ]
    methods = [
        name for name in STYLES if any(_is_rival(row) and row["method"] == name for row in rows)
    ]
    columns = min(4, max(1, len(cases)))
    lines = math.ceil(max(1, len(cases)) / columns)
    height = (0.19 * len(methods) + 0.75) * lines + 0.5
    figure = Figure(figsize=(2.6 * columns + 1.9, height), layout="constrained")
    axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, name in zip(axes, cases, strict=False):
        plot_ratios([row for row in rows if row["case"] == name], methods, ax)
        ax.set_title(name, fontsize=9)
    for ax in axes[len(cases) :]:
        ax.axis("off")
    factors = [1.0, *(row["times_ours"] for row in rows if _is_rival(row))]
    # room for the numbers beside the longest bars
    axes[0].set_xlim(0.03 * min(factors), 40 * max(factors))
    figure.supxlabel(
        "run time over ours, both with an error within 1e-6 (rectangle: exact pieces, "
        "parameter sets: sweep, else steady_state); "
        "orange is slower, grey faster, a cross has no figure",
        fontsize=9,
    )
    return figure


def _is_rival(row: Row) -> bool:
    own = ("gearmon",)
    return bool(row["at_target"]) and row["group"] not in own and row["times_ours"] != 1.0


def plot_ratios(rows: Sequence[Row], methods: Sequence[str], ax: Axes) -> Axes:
    """Draw the factors of one case as bars from 1, a method a line.

    Parameters
    ----------
    rows : sequence of dict
    methods : sequence of str
        From top to bottom.
    ax : Axes
    """
    known = {row["method"]: row["times_ours"] for row in rows if _is_rival(row)}
    for place, method in enumerate(methods):
        factor = known.get(method)
        if factor is None:
            ax.text(1.0, place, "×", ha="center", va="center", color=GREY, fontsize=8)
            continue
        ax.barh(place, factor - 1, left=1.0, height=0.7, color=ORANGE if factor > 1 else GREY)
        ax.text(
            factor,
            place,
            f" {_factor(factor)} ",
            ha="left" if factor > 1 else "right",
            va="center",
            fontsize=7,
        )
    ax.axvline(1.0, color=BLACK, linewidth=0.8)
    ax.set_xscale("log")
    ax.set_ylim(len(methods) - 0.4, -0.6)
    ax.set_yticks(range(len(methods)), methods, fontsize=8)
    ax.tick_params(axis="x", labelsize=8, labelbottom=True)
    ax.grid(True, axis="x", color=LIGHT_GREY, linewidth=0.4)
    ax.set_axisbelow(True)
    return ax


def _factor(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def plot_growth(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw run time over unknowns, with n log n through the last point of the first method.

    Parameters
    ----------
    rows : sequence of dict
        Those of the case "cost growth".
    ax : Axes
    """
    for method in dict.fromkeys(row["method"] for row in rows):
        kept = [row for row in rows if row["method"] == method and row["median_s"]]
        colour, marker, _ = STYLES.get(method, FALLBACK)
        exponent = kept[0]["exponent"]
        label = method if exponent is None else f"{method}, fitted exponent {exponent:.2f}"
        n, time = (np.array([row[key] for row in kept]) for key in ("unknowns", "median_s"))
        ax.plot(n, 1e3 * time, color=colour, marker=marker, markersize=5, label=label)
        if method == "steady_state":
            n_log_n = n * np.log(n)
            slope = _slope(n, n_log_n)
            ax.plot(
                n,
                1e3 * time[-1] * n_log_n / n_log_n[-1],
                color=GREY,
                linestyle="--",
                linewidth=1,
                label=f"n log n, through the last point{slope}",
            )
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("harmonics solved for")
    ax.set_ylabel("median run time in ms")
    ax.grid(True, which="major", color=LIGHT_GREY, linewidth=0.4)
    ax.legend(fontsize=8)
    return ax


def _slope(n: np.ndarray[Any, Any], cost: np.ndarray[Any, Any], least: int = 2000) -> str:
    """Exponent that the same fit finds for n log n at these sizes, in words."""
    large = n >= least
    if large.sum() < 3:
        return ""
    exponent = np.polyfit(np.log(n[large]), np.log(cost[large]), 1)[0]
    return f" (the same fit gives {exponent:.2f})"


def growth_figure(rows: Sequence[Row]) -> Figure:
    """Return the cost over the number of unknowns; exponents are fitted from 2,000 on."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    ax = figure.subplots()
    plot_growth([row for row in rows if row["case"] == "cost growth"], ax)
    ax.set_title("one dip of stiffness in a period of 1, 2, 4, ... meshes", fontsize=10)
    return figure


def save_dynamics_figures(rows: Sequence[Row], path: str | Path) -> list[Path]:
    """Write the pictures of the dynamics benchmark beside each other.

    Parameters
    ----------
    rows : sequence of dict
        From `gearmon.benchmark.dynamics.run_dynamics`.
    path : str or Path
        "name.png" gives name-work-precision.png, name-ratios.png and name-growth.png; a picture for
        which there are no rows is left out.

    Returns
    -------
    list of Path
    """
    cases = {row["case"] for row in rows}
    figures: dict[str, Figure] = {}
    if cases - set(SPECIAL):
        figures["work-precision"] = work_precision_figure(rows)
    if any(_is_rival(row) for row in rows):
        figures["ratios"] = ratio_figure(rows)
    if "cost growth" in cases:
        figures["growth"] = growth_figure(rows)
    target = Path(path)
    return [
        save_picture(figure, target.with_name(f"{target.stem}-{name}{target.suffix}"))
        for name, figure in figures.items()
    ]


def save_picture(figure: Figure, path: Path) -> Path:
    """Write a figure in one step; its format follows the suffix."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=130)
    return path
