"""Pictures of the benchmark of detection, drawn from its rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gearmon.report.benchmark_plots import save_picture
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


def save_detection_figures(
    rows: Sequence[Row], summary: Sequence[Row], path: str | Path
) -> list[Path]:
    """Write all pictures; each gets its name before the suffix of `path`.

    Parameters
    ----------
    rows : sequence of dict
        From `gearmon.benchmark.detection.run_detection`.
    summary : sequence of dict
        From `gearmon.benchmark.detection.detection_summary` of these rows.
    path : str or Path

    Returns
    -------
    list of Path
    """
    target = Path(path)
    figures = {
        "roc": roc_figure(summary),
        "false-alarms": false_alarm_figure(rows, summary),
        "blame": blame_figure(rows),
        "size": size_figure(rows),
        "time": time_figure(rows),
    }
    return [
        save_picture(figure, target.with_name(f"{target.stem}-{name}{target.suffix}"))
        for name, figure in figures.items()
    ]


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
        ours = name == "gearmon"
        ax.plot(
            shifted,
            area,
            color=colour,
            marker=marker,
            linestyle=dashes,
            linewidth=2.2 if ours else 1.1,
            markersize=5,
            zorder=3 if ours else 2,
            label=name,
        )
        ax.vlines(shifted, low, high, color=colour, linewidth=2.2 if ours else 0.5)
    ax.axhline(0.5, color=LIGHT_GREY, linewidth=3, zorder=0)
    ax.set_xscale("log")
    ticks = sorted(losses)
    ax.set_xticks(ticks, [f"{x:g}" for x in ticks])
    ax.minorticks_off()
    ax.set_ylim(0.35, 1.02)
    ax.set_xlabel("loss of one tooth's pair stiffness in %")
    ax.set_ylabel("area under the ROC curve")
    ax.grid(True, color=LIGHT_GREY, linewidth=0.4)
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
        ax.errorbar(
            level * (1.04 if tacho else 0.96),
            shown,
            yerr=np.maximum([shown - np.maximum(low, 0.3 * least), high - shown], 0),
            color=colour,
            marker=marker,
            linestyle="none",
            markersize=5,
            elinewidth=0.9,
            label=f"{_tacho_name(tacho)}, {len(own)} healthy recordings",
        )
    line = np.array([least, 1.0])
    ax.plot(line, line, color=BLACK, linewidth=0.9, label="observed as stated")
    ax.fill_between(line, 0.5 * line, 2 * line, color=LIGHT_GREY, alpha=0.5, label="within 2 times")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(least, 1.0)
    ax.set_ylim(least, 1.1)
    ax.set_xlabel("stated false-alarm probability")
    ax.set_ylabel("observed share of healthy recordings")
    ax.legend(fontsize=8, loc="lower right")
    return ax


def plot_variants(summary: Sequence[Row], ax: Axes) -> Axes:
    """Draw the false alarms at a stated 1 % by what differs from the reference."""
    own = [r for r in summary if r["figure"] == "false alarms" and "," in r["of"]]
    for place, row in enumerate(own):
        colour = BLUE if row["tacho"] else VERMILLION
        span = 100 * np.array([[row["value"] - row["low"]], [row["high"] - row["value"]]])
        ax.errorbar(
            [100 * row["value"]],
            [place],
            xerr=np.maximum(span, 0),
            color=colour,
            marker="o" if row["tacho"] else "s",
            markersize=5,
        )
    words = {"same": "nothing changed", "all": "load, speed and gain changed"}
    names = [row["of"].split(", ")[1] for row in own]
    labels = [
        f"{words.get(name, f'{name} changed')}\n{_tacho_name(row['tacho'])}, {row['count']}"
        for name, row in zip(names, own, strict=True)
    ]
    ax.set_yticks(range(len(own)), labels, fontsize=8)
    ax.invert_yaxis()
    ax.axvline(1.0, color=BLACK, linewidth=0.9)
    ax.set_xlim(left=0)
    ax.set_xlabel("observed false alarms in % at a stated 1 %")
    ax.grid(True, axis="x", color=LIGHT_GREY, linewidth=0.4)
    return ax


def blame_figure(rows: Sequence[Row]) -> Figure:
    """Return what was blamed: gear, tooth and kind, of recordings with a tacho."""
    figure, axes = _panels(3, width=5.0, height=4.6)
    own = [row for row in rows if row["tacho"]]
    clear = [r for r in own if r["condition"] == "tooth" and r["size"] >= CLEAR_LOSS]
    title = f"one tooth, loss {100 * CLEAR_LOSS:g} % and more"
    plot_gears(clear, axes[0])
    axes[0].set_title(f"gear: {title}", fontsize=9)
    plot_tooth_errors(clear, axes[1])
    axes[1].set_title(f"tooth: {title}", fontsize=9)
    plot_kinds(own, axes[2])
    axes[2].set_title("kind: all sizes", fontsize=9)
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
    ax.set_xlabel("found")
    ax.set_ylabel("true")
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
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(0.2, 150)
    ax.set_xlabel("true loss in %")
    ax.set_ylabel("estimated loss in %")
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
        ax.plot(values, np.full(len(values), place), "|", color=GREY, markersize=9)
        ax.plot([float(np.median(values))], [place], "o", color=BLUE, markersize=7)
        ax.annotate(
            f"{np.median(values):.2g} s", (float(np.median(values)), place - 0.25), fontsize=8
        )
    ax.set_yticks(range(len(kept)), list(kept), fontsize=8)
    ax.set_ylim(len(kept) - 0.4, -0.6)
    ax.set_xlim(left=0)
    ax.set_xlabel("run time of one analysis in s, with its median")
    return figure
