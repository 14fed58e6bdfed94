"""Pictures of the stress test, drawn from its rows: bounds over errors, and refusals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearmon.report.benchmark_plots import save_picture
from gearmon.report.palette import BLACK, BLUE, GREY, LIGHT_GREY, ORANGE, PURPLE, VERMILLION

Row = dict[str, Any]

#: Colour and marker of every reason of a refusal.
OUTCOME_STYLES = {
    "bound too wide": (ORANGE, "s"),
    "not accurate enough": (VERMILLION, "v"),
    "no bound": (PURPLE, "D"),
    "called unstable, but is stable": (BLACK, "X"),
    "unstable": (GREY, "P"),
}


def stress_figure(rows: Sequence[Row]) -> Figure:
    """Return the bounds over the true errors, and where answers were refused.

    Parameters
    ----------
    rows : sequence of dict
        From the stress test.
    """
    tolerances = list(dict.fromkeys(row["tolerance"] for row in rows))
    figure = Figure(figsize=(11.5, 4.4 * len(tolerances)), layout="constrained")
    axes = figure.subplots(len(tolerances), 3, squeeze=False)
    for line, tolerance in zip(axes, tolerances, strict=True):
        here = [row for row in rows if row["tolerance"] == tolerance]
        plot_bound_ratios(here, line[0])
        plot_bounds(here, tolerance, line[1])
        plot_refusals(here, line[2])
        for ax, what in zip(line, ("bounds over errors", "bounds", "refusals"), strict=True):
            ax.set_title(f"{what}, tolerance {tolerance:.0e}", fontsize=9)
    return figure


def plot_bound_ratios(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw the histogram of bound over true error; left of 1 a bound would be broken."""
    ratios = np.array([row["bound_over_error"] for row in rows if row["bound_over_error"]])
    if len(ratios):
        tenths = 10 * np.log10(ratios)
        # an edge stands at 1, so that a broken bound is seen to the left of it
        edges = np.arange(min(-2, math.floor(tenths.min())), max(10, tenths.max()) + 2)
        ax.hist(ratios, bins=(10 ** (edges / 10)).tolist(), color=BLUE, alpha=0.8)
        median = float(np.median(ratios))
        ax.axvline(median, color=VERMILLION, linewidth=1.2, label=f"median {median:.3g}")
    ax.axvline(1.0, color=BLACK, linewidth=1.2, label="bound = error")
    ax.set_xscale("log")
    ax.set_yscale("symlog", linthresh=10)
    ax.set_xlabel("error bound over true error")
    ax.set_ylabel("systems")
    ax.legend(fontsize=8)
    return ax


def plot_bounds(rows: Sequence[Row], tolerance: float, ax: Axes) -> Axes:
    """Draw bound against true error: answers lie above the diagonal, met ones in the grey field.

    Parameters
    ----------
    rows : sequence of dict
    tolerance : float
    ax : Axes
    """
    styles = {"met": BLUE, "refused": ORANGE}
    for outcome in dict.fromkeys(row["outcome"] for row in rows):
        kept = [r for r in rows if r["outcome"] == outcome and r["error_bound"] and r["error"]]
        points = np.array([(row["error"], row["error_bound"]) for row in kept]).reshape(-1, 2)
        ax.plot(
            *points.T,
            ".",
            markersize=2.5,
            color=styles.get(outcome, BLACK),
            label=f"{outcome} ({sum(row['outcome'] == outcome for row in rows)})",
        )
    ax.set_xscale("log")
    ax.set_yscale("log")
    low, high = ax.get_xlim()
    bottom, top = ax.get_ylim()
    ax.axvspan(low, tolerance, ymax=1.0, color=LIGHT_GREY, alpha=0.35, zorder=0)
    ax.axhline(tolerance, color=GREY, linewidth=0.8)
    line = np.array([min(low, bottom), max(high, top)])
    ax.plot(line, line, color=BLACK, linewidth=0.9)
    ax.set_xlim(low, max(high, 2 * tolerance))
    ax.set_ylim(bottom, max(top, 2 * tolerance))
    ax.set_xlabel("true relative error of acceleration")
    ax.set_ylabel("error bound")
    ax.legend(fontsize=8, loc="upper left", markerscale=4)
    return ax


def plot_refusals(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw all systems over w0/w and damping ratio, the refused ones marked by their reason.

    Parameters
    ----------
    rows : sequence of dict
    ax : Axes
    """
    met = np.array([(r["ratio"], r["zeta"]) for r in rows if r["outcome"] == "met"]).reshape(-1, 2)
    ax.plot(*met.T, ".", color=LIGHT_GREY, markersize=2, label="met", zorder=0)
    others = [row for row in rows if row["outcome"] != "met"]
    for reason in dict.fromkeys(_reason(row) for row in others):
        kept = [row for row in others if _reason(row) == reason]
        colour, marker = OUTCOME_STYLES.get(reason, (BLACK, "*"))
        ax.plot(
            [row["ratio"] for row in kept],
            [row["zeta"] for row in kept],
            marker,
            color=colour,
            markersize=4,
            label=f"{reason} ({len(kept)})",
        )
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("natural over stiffness frequency w0/w")
    ax.set_ylabel("damping ratio")
    # outside, for systems fill the whole field
    ax.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), markerscale=1.4, ncols=2)
    return ax


def _reason(row: Row) -> str:
    if row["outcome"] != "refused":
        return str(row["outcome"])
    return row["reason"] if row["reason"] in OUTCOME_STYLES else "refused outright"


def save_stress_figure(rows: Sequence[Row], path: str | Path) -> list[Path]:
    """Write the picture of the stress test to `path`.

    Parameters
    ----------
    rows : sequence of dict
        From `gearmon.benchmark.stress.run_stress`.
    path : str or Path
        Its suffix sets the format.
    """
    return [save_picture(stress_figure(rows), Path(path))]
