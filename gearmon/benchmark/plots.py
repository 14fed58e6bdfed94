"""Pictures of the benchmarks, drawn from their rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gearmon.benchmark.detection import detection_summary
from gearmon.benchmark.dynamics import fitted_exponent
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
#: Faint grid lines, and the logarithmic scale of both axes.
GRID: dict[str, Any] = {"color": LIGHT_GREY, "linewidth": 0.4}
LOG_LOG = {"xscale": "log", "yscale": "log"}
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
        style: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": dashes}
        # in the order of their settings, so that a method that stalls is seen to turn back
        ax.plot(*zip(*points, strict=True), **style, markersize=4, linewidth=1.1, label=method)
    ax.set(**LOG_LOG)
    ax.axvline(TARGET, color=LIGHT_GREY, linewidth=3, zorder=0)
    low, high = ax.get_xlim()
    ax.set_xlim(min(high, 3.0), max(low, 1e-15))
    ax.grid(**GRID)
    return ax


def work_precision_figure(rows: Sequence[Row]) -> Figure:
    """Return small multiples, one a case, with the axes in common."""
    cases = [name for name in dict.fromkeys(row["case"] for row in rows) if name not in SPECIAL]
    figure, axes = _multiples(len(cases), 3.3, 0.6, 2.9, spare=1)
    for ax, name in zip(axes, cases, strict=False):
        plot_work_precision([row for row in rows if row["case"] == name], ax)
        ax.set_title(name, fontsize=9)
        ax.tick_params(labelsize=8, labelbottom=True)
    _limits(axes[: len(cases)])
    figure.supxlabel("relative L2 error of acceleration, more accurate to the right", fontsize=9)
    figure.supylabel("median run time in s", fontsize=9)
    _method_legend(rows, axes[len(cases)])
    return figure


def _multiples(
    count: int, width: float, beside: float, height: float, spare: int = 0
) -> tuple[Figure, list[Axes]]:
    """Return small multiples with their axes in common, at most four in a row."""
    columns = min(4, max(1, count))
    lines = math.ceil((max(1, count) + spare) / columns)
    size = width * columns + beside, height * lines + 0.5
    figure = Figure(figsize=size, layout="constrained")
    axes = list(figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel())
    for ax in axes[count:]:
        ax.axis("off")
    return figure, axes


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
    figure, axes = _multiples(len(cases), 2.6, 1.9, 0.19 * len(methods) + 0.75)
    for ax, name in zip(axes, cases, strict=False):
        plot_ratios([row for row in rows if row["case"] == name], methods, ax)
        ax.set_title(name, fontsize=9)
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
    return bool(row["at_target"]) and row["group"] != "gearmon" and row["times_ours"] != 1.0


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
        number = f"{factor:.0f}" if factor >= 10 else f"{factor:.2g}"
        side = "left" if factor > 1 else "right"
        ax.text(factor, place, f" {number} ", ha=side, va="center", fontsize=7)
    ax.axvline(1.0, color=BLACK, linewidth=0.8)
    ax.set_xscale("log")
    _rows_of_names(ax, methods, 8)
    ax.tick_params(axis="x", labelsize=8, labelbottom=True)
    return ax


def _rows_of_names(ax: Axes, names: Sequence[str], size: float) -> None:
    """Name the rows of bars from top to bottom, over a faint grid."""
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_yticks(range(len(names)), names, fontsize=size)
    ax.grid(axis="x", **GRID)
    ax.set_axisbelow(True)


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
            sizes = [{"unknowns": u, "median_s": c} for u, c in zip(n, n_log_n, strict=True)]
            slope = fitted_exponent(sizes)
            label = "n log n, through the last point"
            label += "" if slope is None else f" (the same fit gives {slope:.2f})"
            through = 1e3 * time[-1] * n_log_n / n_log_n[-1]
            ax.plot(n, through, color=GREY, linestyle="--", linewidth=1, label=label)
    ax.set(**LOG_LOG, xlabel="harmonics solved for", ylabel="median run time in ms")
    ax.grid(**GRID)
    ax.legend(fontsize=8)
    return ax


def growth_figure(rows: Sequence[Row]) -> Figure:
    """Return the cost over the number of unknowns; exponents are fitted from 2,000 on."""
    figure, (ax,) = _panels(1, width=5.8)
    plot_growth([row for row in rows if row["case"] == "cost growth"], ax)
    ax.set_title("one dip of stiffness in a period of 1, 2, 4, ... meshes", fontsize=10)
    return figure


def dynamics_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return the pictures of the dynamics benchmark for which there are rows.

    Parameters
    ----------
    rows : sequence of dict
        From `gearmon.benchmark.dynamics.run_dynamics`.
    """
    cases = {row["case"] for row in rows}
    figures: dict[str, Figure] = {}
    if cases - set(SPECIAL):
        figures["work-precision"] = work_precision_figure(rows)
    if any(_is_rival(row) for row in rows):
        figures["ratios"] = ratio_figure(rows)
    if "cost growth" in cases:
        figures["growth"] = growth_figure(rows)
    return figures


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
    ax.set(xscale="log", xlabel="error bound over true error", ylabel="systems")
    ax.set_yscale("symlog", linthresh=10)
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
        label = f"{outcome} ({sum(row['outcome'] == outcome for row in rows)})"
        ax.plot(*points.T, ".", markersize=2.5, color=styles.get(outcome, BLACK), label=label)
    ax.set(**LOG_LOG, xlabel="true relative error of acceleration", ylabel="error bound")
    low, high = ax.get_xlim()
    bottom, top = ax.get_ylim()
    ax.axvspan(low, tolerance, ymax=1.0, color=LIGHT_GREY, alpha=0.35, zorder=0)
    ax.axhline(tolerance, color=GREY, linewidth=0.8)
    line = np.array([min(low, bottom), max(high, top)])
    ax.plot(line, line, color=BLACK, linewidth=0.9)
    ax.set(xlim=(low, max(high, 2 * tolerance)), ylim=(bottom, max(top, 2 * tolerance)))
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
        at = [row["ratio"] for row in kept], [row["zeta"] for row in kept]
        ax.plot(*at, marker, color=colour, markersize=4, label=f"{reason} ({len(kept)})")
    ax.set(**LOG_LOG, xlabel="natural over stiffness frequency w0/w", ylabel="damping ratio")
    # outside, for systems fill the whole field
    ax.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), markerscale=1.4, ncols=2)
    return ax


def _reason(row: Row) -> str:
    if row["outcome"] != "refused":
        return str(row["outcome"])
    return row["reason"] if row["reason"] in OUTCOME_STYLES else "refused outright"


def stress_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return the picture of the stress test, from `gearmon.benchmark.stress.run_stress`."""
    return {"": stress_figure(rows)}


def signals_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return the run times of the benchmark of signals."""
    timed = [row for row in rows if row["median_s"] not in (None, "")]
    figure = Figure(figsize=(8.0, 0.2 * len(timed) + 1.0), layout="constrained")
    plot_times(timed, figure.subplots())
    return {"": figure}


def plot_times(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw the median run time of every method as a bar, with its ratio to gearmon's."""
    places = range(len(rows))
    times = [1e3 * float(row["median_s"]) for row in rows]
    own = [float(row["times_own"] or 1.0) for row in rows]
    first = [i == 0 or _case(row) != _case(rows[i - 1]) for i, row in enumerate(rows)]
    ax.barh(places, times, color=[BLUE if new else GREY for new in first], height=0.7)
    ax.set_xscale("log")
    pairs = zip(rows, first, strict=True)
    names = [f"{_case(r)}: {r['method']}" if new else str(r["method"]) for r, new in pairs]
    _rows_of_names(ax, names, 6.5)
    for place, time, ratio, new in zip(places, times, own, first, strict=True):
        if not new:
            ax.text(1.03 * time, place, f"{ratio:.2g} ×", va="center", fontsize=6.5)
    ax.set_xlabel("Median run time (ms), beside it as a multiple of gearmon's")
    return ax


def _case(row: Row) -> str:
    channels = f", {row['channels']} channels" if int(row["channels"]) > 1 else ""
    return f"{row['case']}{channels}"


#: Colour, marker and dashes of every detector.
DETECTOR_STYLES: dict[str, tuple[str, str, str]] = {
    "gearmon": (BLUE, "o", "-"),
    "FM4": (ORANGE, "s", "--"),
    "NA4*": (VERMILLION, "^", "--"),
    "residual energy": (GREEN, "D", "-."),
    "kurtosis": (GREY, "v", ":"),
    "energy ratio": (SKY, "P", "-."),
    "sideband energy ratio": (PURPLE, "X", ":"),
    "sideband index": (PURPLE, "<", "--"),
    "localised difference": (GREEN, "p", "-"),
    "plain learning": (BLACK, "*", "-"),
}
#: From which loss on the gear and tooth found are counted.
CLEAR_LOSS = 0.2
NOTHING, UNNAMED = "nothing", "unnamed"


def detection_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return the pictures of the benchmark of detection.

    Parameters
    ----------
    rows : sequence of dict
        From `gearmon.benchmark.detection.run_detection`.
    """
    summary = detection_summary(rows)
    return {
        "roc": roc_figure(summary),
        "false-alarms": false_alarm_figure(rows, summary),
        "blame": blame_figure(rows),
        "size": size_figure(rows),
        "time": time_figure(rows),
    }


def _panels(columns: int, width: float = 5.2, height: float = 4.4) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width * columns + 0.6, height), layout="constrained")
    return figure, list(figure.subplots(1, columns, squeeze=False).ravel())


def _tacho_name(tacho: bool) -> str:
    return "with tacho" if tacho else "without tacho"


def roc_figure(summary: Sequence[Row]) -> Figure:
    """Areas under the ROC curves against loss of stiffness, with and without tacho."""
    figure, axes = _panels(2)
    for ax, tacho in zip(axes, (True, False), strict=True):
        plot_roc_areas([row for row in summary if row["tacho"] == tacho], ax)
        ax.set_title(_tacho_name(tacho), fontsize=10)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=8, frameon=False)
    return figure


def plot_roc_areas(summary: Sequence[Row], ax: Axes) -> Axes:
    """Draw the area of every detector over the loss, with 95 % intervals over machines.

    Parameters
    ----------
    summary : sequence of dict
        With or without tacho.
    ax : Axes
    """
    own = [row for row in summary if row["figure"] == "ROC area"]
    drawn = [name for name in DETECTOR_STYLES if any(r["detector"] == name for r in own)]
    losses: set[float] = set()
    for place, name in enumerate(drawn):
        colour, marker, dashes = DETECTOR_STYLES[name]
        points = [row for row in own if row["detector"] == name]
        loss = np.array([100 * float(row["of"].removeprefix("loss ")) for row in points])
        losses |= set(loss.tolist())
        area, low, high = (np.array([r[k] for r in points]) for k in ("value", "low", "high"))
        # a little apart, so that they can be told from one another
        shifted = loss * 1.02 ** (place - len(drawn) / 2)
        width, thin, over = (2.2, 2.2, 3) if name == "gearmon" else (1.1, 0.5, 2)
        style: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": dashes}
        ax.plot(shifted, area, **style, linewidth=width, markersize=5, zorder=over, label=name)
        ax.vlines(shifted, low, high, color=colour, linewidth=thin)
    ax.axhline(0.5, color=LIGHT_GREY, linewidth=3, zorder=0)
    ax.set_xscale("log")
    ticks = sorted(losses)
    ax.set_xticks(ticks, [f"{x:g}" for x in ticks])
    ax.minorticks_off()
    ax.set(xlabel="loss of one tooth's pair stiffness in %", ylabel="area under the ROC curve")
    ax.set_ylim(0.35, 1.02)
    ax.grid(**GRID)
    return ax


def false_alarm_figure(rows: Sequence[Row], summary: Sequence[Row]) -> Figure:
    """Observed share of false alarms against the stated probability."""
    figure, axes = _panels(2)
    plot_reliability(rows, summary, axes[0])
    plot_variants(summary, axes[1])
    return figure


def plot_reliability(rows: Sequence[Row], summary: Sequence[Row], ax: Axes) -> Axes:
    """Draw which share of healthy recordings has a stated probability at most so small."""
    least = 1e-4
    for tacho, colour, marker in ((True, BLUE, "o"), (False, VERMILLION, "s")):
        own = [
            row
            for row in rows
            if row["tacho"] == tacho and row["condition"] == "healthy" and row["probability"]
        ]
        if not own:
            continue
        stated = np.sort([max(row["probability"], 0.3 * least) for row in own])
        share = np.arange(1, len(stated) + 1) / len(stated)
        ax.step(stated, share, where="post", color=colour, linewidth=1.0)
        counted = [
            row
            for row in summary
            if row["figure"] == "false alarms" and row["tacho"] == tacho and "," not in row["of"]
        ]
        level = np.array([float(row["of"].removeprefix("stated ")) for row in counted])
        value, low, high = (np.array([r[k] for r in counted]) for k in ("value", "low", "high"))
        shown = np.maximum(value, least)
        span = np.maximum([shown - np.maximum(low, 0.3 * least), high - shown], 0)
        label = f"{_tacho_name(tacho)}, {len(own)} healthy recordings"
        at, style = level * (1.04 if tacho else 0.96), f"{marker}"
        ax.errorbar(at, shown, span, fmt=style, color=colour, markersize=5, label=label)
    line = np.array([least, 1.0])
    ax.plot(line, line, color=BLACK, linewidth=0.9, label="observed as stated")
    ax.fill_between(line, 0.5 * line, 2 * line, color=LIGHT_GREY, alpha=0.5, label="within 2 times")
    ax.set(**LOG_LOG, xlim=(least, 1.0), ylim=(least, 1.1))
    ax.set(xlabel="stated false-alarm probability", ylabel="observed share of healthy recordings")
    ax.legend(fontsize=8, loc="lower right")
    return ax


def plot_variants(summary: Sequence[Row], ax: Axes) -> Axes:
    """Draw the false alarms at a stated 1 % by what differs from the reference."""
    own = [r for r in summary if r["figure"] == "false alarms" and "," in r["of"]]
    for place, row in enumerate(own):
        colour = BLUE if row["tacho"] else VERMILLION
        span = 100 * np.array([[row["value"] - row["low"]], [row["high"] - row["value"]]])
        marker, at = "o" if row["tacho"] else "s", [100 * row["value"]]
        ax.errorbar(at, [place], xerr=np.maximum(span, 0), color=colour, fmt=marker, markersize=5)
    words = {"same": "nothing changed", "all": "load, speed and gain changed"}
    names = [row["of"].split(", ")[1] for row in own]
    labels = [
        f"{words.get(name, f'{name} changed')}\n{_tacho_name(row['tacho'])}, {row['count']}"
        for name, row in zip(names, own, strict=True)
    ]
    _rows_of_names(ax, labels, 8)
    ax.axvline(1.0, color=BLACK, linewidth=0.9)
    ax.set_xlim(left=0)
    ax.set_xlabel("observed false alarms in % at a stated 1 %")
    return ax


def blame_figure(rows: Sequence[Row]) -> Figure:
    """Return what was blamed: gear, tooth and kind, of recordings with a tacho."""
    figure, axes = _panels(3, width=5.0, height=4.6)
    own = [row for row in rows if row["tacho"]]
    clear = [r for r in own if r["condition"] == "tooth" and r["size"] >= CLEAR_LOSS]
    title = f"one tooth, loss {100 * CLEAR_LOSS:g} % and more"
    plot_gears(clear, axes[0])
    plot_tooth_errors(clear, axes[1])
    plot_kinds(own, axes[2])
    for ax, what in zip(
        axes, (f"gear: {title}", f"tooth: {title}", "kind: all sizes"), strict=True
    ):
        ax.set_title(what, fontsize=9)
    return figure


def plot_gears(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw the confusion matrix of gears."""
    gears = [f"{gear} {stage}" for stage in (1, 2) for gear in ("pinion", "gear")]

    def found(row: Row) -> str:
        if not row["tooth_flag"]:
            return NOTHING
        name = f"{row['found_gear']} {row['found_stage']}"
        return name if name in gears else UNNAMED

    pairs = [(f"{row['gear']} {row['stage']}", found(row)) for row in rows]
    columns = [*gears, UNNAMED, NOTHING]
    return _matrix(pairs, [g for g in gears if any(p[0] == g for p in pairs)], columns, ax)


def plot_kinds(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw the confusion matrix of kinds: the true condition and the first flag."""
    pairs = [(row["condition"], row["found_kind"] or f"({row['verdict']})") for row in rows]
    kinds = list(dict.fromkeys(pair[0] for pair in pairs))
    found = sorted({pair[1] for pair in pairs}, key=lambda name: (name.startswith("("), name))
    return _matrix(pairs, kinds, found, ax)


def _matrix(
    pairs: Sequence[tuple[str, str]], true: Sequence[str], found: Sequence[str], ax: Axes
) -> Axes:
    """Draw counts, shaded by their share of the row."""
    counts: NDArray[np.float64] = np.zeros((len(true), len(found)))
    for one, other in pairs:
        counts[true.index(one), found.index(other)] += 1
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    if share.size:
        ax.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (i, j), number in np.ndenumerate(counts):
        if number:
            colour = "white" if share[i, j] > 0.6 else BLACK
            ax.text(j, i, f"{number:.0f}", ha="center", va="center", color=colour, fontsize=8)
    ax.set_xticks(range(len(found)), list(found), rotation=45, ha="right", fontsize=8)
    ax.set_yticks(range(len(true)), list(true), fontsize=8)
    ax.set(xlabel="found", ylabel="true")
    return ax


def plot_tooth_errors(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw how far the tooth found lies from the true one."""
    names = ["right", "next", "two off", "farther", UNNAMED, "wrong gear", NOTHING]
    counts = dict.fromkeys(names, 0)
    for row in rows:
        counts[_tooth_outcome(row)] += 1
    good = {"right": BLUE, "next": SKY}
    ax.bar(range(len(names)), list(counts.values()), color=[good.get(n, GREY) for n in names])
    for place, number in enumerate(counts.values()):
        ax.text(place, number, f"{number}", ha="center", va="bottom", fontsize=8)
    ax.set_xticks(range(len(names)), names, rotation=45, ha="right", fontsize=8)
    ax.set_ylabel("recordings")
    return ax


def _tooth_outcome(row: Row) -> str:
    if not row["tooth_flag"]:
        return NOTHING
    if not row["gear_right"]:
        return "wrong gear"
    error = row["tooth_error"]
    if error is None:
        return UNNAMED
    steps = ((0.75, "right"), (1.5, "next"), (2.5, "two off"))
    return next((name for most, name in steps if error <= most), "farther")


def size_figure(rows: Sequence[Row]) -> Figure:
    """Estimated against true loss, with the stated intervals."""
    figure, axes = _panels(2)
    for ax, tacho in zip(axes, (True, False), strict=True):
        own = [
            row
            for row in rows
            if row["tacho"] == tacho and row["gear_right"] and row["loss"] is not None
        ]
        plot_sizes(own, ax)
        ax.set_title(f"{_tacho_name(tacho)}, right gear: {len(own)}", fontsize=10)
    return figure


def plot_sizes(rows: Sequence[Row], ax: Axes) -> Axes:
    """Draw the estimated loss of every recording over the true one."""
    for size in sorted({row["size"] for row in rows}):
        own = [row for row in rows if row["size"] == size]
        spread = np.exp(np.linspace(-0.13, 0.13, len(own))) if len(own) > 1 else np.ones(1)
        for row, shift in zip(sorted(own, key=lambda r: float(r["loss"])), spread, strict=True):
            bounded = row["loss_low"] is not None
            inside = bounded and row["loss_low"] <= size <= row["loss_high"]
            colour = BLUE if inside else VERMILLION
            at = 100 * size * shift
            if bounded:
                ends = [max(100 * row["loss_low"], 0.01), 100 * row["loss_high"]]
                ax.plot([at, at], ends, color=colour, linewidth=0.8)
            ax.plot([at], [100 * row["loss"]], ".", color=colour, markersize=4)
    line = np.array([0.7, 60.0])
    ax.plot(line, line, color=BLACK, linewidth=0.9, label="estimated = true")
    ax.fill_between(line, 0.75 * line, 1.25 * line, color=LIGHT_GREY, alpha=0.6, label="±25 %")
    ax.plot([], [], color=BLUE, label="90 % interval holds the true loss")
    ax.plot([], [], color=VERMILLION, label="it does not")
    ax.set(**LOG_LOG, ylim=(0.2, 150), xlabel="true loss in %", ylabel="estimated loss in %")
    ax.legend(fontsize=8, loc="upper left")
    if not rows:
        ax.text(0.5, 0.4, "no estimates", transform=ax.transAxes, ha="center", color=GREY)
    return ax


def time_figure(rows: Sequence[Row]) -> Figure:
    """Run times of one analysis, with and without a reference."""
    figure, (ax,) = _panels(1, width=6.5, height=3.6)
    groups: dict[str, list[float]] = {}
    for tacho in (True, False):
        own = [row for row in rows if row["tacho"] == tacho and row["run_time_s"]]
        alone = {row["machine"]: row["alone_s"] for row in own if row["alone_s"]}
        groups[f"with reference, {_tacho_name(tacho)}"] = [row["run_time_s"] for row in own]
        groups[f"without reference, {_tacho_name(tacho)}"] = list(alone.values())
    kept = {name: values for name, values in groups.items() if values}
    for place, values in enumerate(kept.values()):
        median = float(np.median(values))
        ax.plot(values, np.full(len(values), place), "|", color=GREY, markersize=9)
        ax.plot([median], [place], "o", color=BLUE, markersize=7)
        ax.text(median, place - 0.25, f"{median:.2g} s", fontsize=8)
    _rows_of_names(ax, list(kept), 8)
    ax.set_xlim(left=0)
    ax.set_xlabel("run time of one analysis in s, with its median")
    return figure
