"""Pictures of what a machine file foretells: teeth, stiffness, lines, modes, what faults leave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.ticker import MaxNLocator

from gearmon.arrays import runs_where
from gearmon.dynamics.fourier import Real
from gearmon.dynamics.stability import StabilityMap, Tongue
from gearmon.errors import ArgumentError
from gearmon.gears.stiffness_report import (
    HARMONICS,
    FormComparison,
    SizeCurve,
    StageStiffness,
    StiffnessReport,
)
from gearmon.report import plots
from gearmon.report.teeth_plots import plot_flank, plot_teeth, teeth_picture
from gearmon.signatures.expected.fault_family import FaultFamily
from gearmon.signatures.expected.modes import Modes
from gearmon.signatures.signature import Signature

_GREY = "#777777"
_CAUSES = {
    "bending": plots.BLUE,
    "shear": plots.ORANGE,
    "axial": _GREY,
    "foundation": plots.GREEN,
    "contact": "#CC79A7",
}
_GN, _MN = 1e-9, 1e-6
_UNITS = {"mm": "mm", "flank": "share of the flank", "%flank": "% of the flank"}
_SIZES = {
    "crack": "depth of the root crack",
    "spall": "width of the spall",
    "breakage": "face width broken off",
    "wear": "wear",
    "pitting": "pitting",
}
_FORMS = {
    "parabolic": "parabola (reference)",
    "wave": "half-sine arches",
    "rectangular": "rectangle, true duty",
    "rectangular-half": "rectangle, duty 1/2",
    "fourier-true": "Fourier sum, true duty",
    "fourier": "Fourier sum, duty 1/2",
}
_ORDERS = {1: ("1st", plots.GREEN, ":"), 2: ("2nd", plots.BLUE, "--"), 3: ("3rd", plots.GREY, "-.")}
# Colour and dashes of natural frequencies by the type of mode.
_TYPE_LINES: dict[str, tuple[str, str]] = {
    "rotational": (plots.BLACK, "-"),
    "translational": (plots.GREY, "--"),
    "planet": (plots.GREY, ":"),
}
# Below this growth nothing is drawn: it is rounding.
_LEAST_GROWTH = 1e-9
# Panels of kinds of faults side by side, and size of one [inch].
_COLUMNS, _PANEL_IN = 3, (2.9, 2.15)
# Lines of a signature lower than this share of the highest are not shown: 100 dB.
_LEAST_SHARE = 1e-5
# Mesh harmonics that are named at most.
_MOST_NAMED = 30
# Levels of traces below this are not shown [dB].
_LEAST_DB = -120.0


def stiffness_figures(report: StiffnessReport) -> dict[str, plots.Picture]:
    """Draw a sheet for each stage and mesh; keys such as "-stage2-sun-planet", of one stage "".

    Parameters
    ----------
    report : StiffnessReport

    Returns
    -------
    dict of str to Picture
        By what is added to the name of a file.
    """
    numbers = [stage.stage for stage in report.stages]
    figures = {}
    for stage in report.stages:
        mesh = f"-{stage.mesh}" if numbers.count(stage.stage) > 1 else ""
        name = f"-stage{stage.stage}{mesh}" if len(numbers) > 1 else ""
        figures[name] = stiffness_figure(stage)
    return figures


@plots.sheet_style()
def stiffness_figure(stage: StageStiffness) -> plots.Picture:
    """Draw the sheet of a stage: teeth, flank, stiffness, shares of compliance, loss by size.

    Parameters
    ----------
    stage : StageStiffness
    """
    figure = plots.sheet(11.5, 8.2)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.0, 0.55, 1.0))
    if stage.teeth is not None:
        picture = teeth_picture(stage.teeth, stage.drawn)
        plot_teeth(picture, figure.add_subplot(grid[0:2, 0]))
        hurt = next((gear for gear in picture.gears if gear.damage), picture.gears[0])
        plot_flank(hurt, figure.add_subplot(grid[1, 1]))
    _plot_stiffness(stage, figure.add_subplot(grid[0, 1]))
    if stage.teeth is not None:
        # without a curve of losses the shares take its place too
        place = grid[2, 0] if stage.curve is not None else grid[2, :]
        _plot_compliance_shares(stage, figure.add_subplot(place))
    if stage.curve is not None:
        _plot_size_curve(stage.curve, figure.add_subplot(grid[2, 1]))
    faults = ", ".join(str(entry.fault) for entry in stage.faults) or "healthy"
    figure.suptitle(f"stage {stage.stage}, {stage.mesh}: {faults}", fontsize=11)
    return figure


def _plot_stiffness(stage: StageStiffness, ax: Axes) -> None:
    """Draw the mesh stiffness, healthy against damaged."""
    # without the last phase, where the next pair enters
    x = np.linspace(stage.phase[0], stage.phase[-1], 3 * len(stage.phase), endpoint=False)
    healthy = _GN * stage.healthy.at(x)
    if stage.faults:
        damaged = _GN * stage.damaged.at(x)
        ax.fill_between(x, damaged, healthy, color=plots.VERMILLION, alpha=0.15, linewidth=0)
        ax.plot(x, damaged, color=plots.VERMILLION, linewidth=1.4, label="damaged")
    ax.plot(x, healthy, color=plots.BLUE, linewidth=1.4, label="healthy")
    ax.set(ylim=(0, 1.08 * healthy.max()), xlim=(stage.phase[0], stage.phase[-1]))
    ax.set(xlabel="mesh phase in mesh periods", ylabel="mesh stiffness in GN/m")
    ax.legend(fontsize=8, loc="lower right")


def _plot_compliance_shares(stage: StageStiffness, ax: Axes) -> None:
    """Draw the share of each cause in the compliance of a sound pair over its contact."""
    phase = np.linspace(0.0, stage.healthy.contact_ratio, 201)
    shares = stage.shares(phase)
    causes = {name: colour for name, colour in _CAUSES.items() if name in shares}
    percents, colours = [100 * shares[name] for name in causes], [*causes.values()]
    ax.stackplot(phase, percents, colors=colours, labels=[*causes], alpha=0.85)
    ax.set(xlim=(0, phase[-1]), ylim=(0, 100))
    ax.set_xlabel("phase of the pair's contact in mesh periods")
    ax.set_ylabel("share of pair compliance in %")
    # above the bands, in their order from below
    ax.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5)


def _plot_size_curve(curve: SizeCurve, ax: Axes) -> None:
    """Draw the loss of pair stiffness against the size of the damage."""
    fault, unit = curve.fault, _UNITS[curve.fault.unit]
    greatest, mean = 100 * curve.greatest_loss, 100 * curve.mean_loss
    ax.plot(curve.sizes, greatest, color=plots.ORANGE, label="greatest in the contact")
    ax.plot(curve.sizes, mean, color=plots.BLUE, label="mean over the contact")
    if fault.size:
        loss = float(np.interp(fault.size, curve.sizes, mean))
        ax.plot(fault.size, loss, "o", color=plots.VERMILLION, label=f"{fault.size:.3g} {unit}")
    ax.set(xlim=(0, curve.sizes[-1]), ylim=(0, None), ylabel="loss of pair stiffness in %")
    ax.set_xlabel(f"{_SIZES[fault.kind]} ({fault.gear}) in {unit}")
    ax.legend(fontsize=8, loc="upper left")


@plots.sheet_style()
def form_figure(comparison: FormComparison) -> plots.Picture:
    """Draw a row for each form of the stiffness: its curve on the left, its spectrum on the right.

    Parameters
    ----------
    comparison : FormComparison

    Returns
    -------
    Picture
    """
    # a form and its variants, which share a row
    rows: dict[str, list[int]] = {}
    for place, curve in enumerate(comparison.forms):
        rows.setdefault(curve.form.name.split("-")[0], []).append(place)
    phase = np.array([row["mesh_phase"] for row in comparison.table])
    orders = np.arange(1, HARMONICS + 1)
    heights = [_GN * curve.at(phase) for curve in comparison.forms]
    lines = [_MN * curve.mesh_amplitudes(HARMONICS) for curve in comparison.forms]
    least, most, top = np.min(heights), np.max(heights), float(np.max(lines))
    figure = plots.sheet(11.5, 0.9 + 2.0 * len(rows))
    axes = figure.subplots(len(rows), 2, sharex="col", squeeze=False)
    for own, (left, right) in zip(rows.values(), axes, strict=True):
        if own[0]:
            left.plot(phase, heights[0], color=_GREY, linewidth=0.9, alpha=0.7, label="reference")
        looks = ((plots.BLUE, 1.6, -0.13), (plots.VERMILLION, 1.1, 0.13))
        for place, (colour, width, shift) in zip(own, looks, strict=False):
            name = _FORMS[comparison.forms[place].form.name]
            left.plot(phase, heights[place], color=colour, linewidth=width, label=name)
            beside = orders + (shift if len(own) > 1 else 0.0)
            right.vlines(beside, 0, lines[place], color=colour, linewidth=1.4)
            plots.plot_marks(right, beside, lines[place], "o", 3.5, colour)
        # room for the names of the curves above them
        spread = most - least
        left.set(xlim=(phase[0], phase[-1]), ylim=(least - 0.08 * spread, most + 0.55 * spread))
        left.set_ylabel("stiffness in GN/m")
        left.legend(fontsize=8, loc="upper right", ncols=3)
        right.set(xlim=(0.3, HARMONICS + 0.7), ylim=(0, 1.08 * top if top else 1.0))
        right.set_ylabel("amplitude in MN/m")
        right.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes[-1][0].set_xlabel("mesh phase in mesh periods")
    axes[-1][1].set_xlabel(f"mesh harmonic (times {comparison.spectrum[0]['frequency_hz']:.5g} Hz)")
    figure.suptitle(
        f"{comparison.machine}, stage {comparison.stage}, {comparison.mesh}: forms of the mesh "
        f"stiffness, contact ratio {comparison.contact_ratio:.4g}",
        fontsize=11,
    )
    return figure


@plots.style()
def signature_figure(signature: Signature) -> plots.Picture:
    """Draw the lines of each stage: mesh harmonics, and the sidebands of each gear.

    Parameters
    ----------
    signature : Signature
        Lines more than 100 dB below the highest of their stage are not shown.

    Returns
    -------
    Picture

    Raises
    ------
    ArgumentError
        If there is no line to draw.
    """
    stages = np.unique(signature["stage"][signature["acceleration_ms2"] > 0]).tolist()
    if not stages:
        raise ArgumentError(f"{signature.machine or 'machine'}: no line above 0 to draw")
    figure, axes = plots.stack([2.3] * len(stages), room_in=0.8)
    level, hertz, beside = (
        signature[name] for name in ("acceleration_ms2", "frequency_hz", "sideband_of")
    )
    gears = [gear for gear in dict.fromkeys(beside.tolist()) if gear]
    for stage, ax in zip(stages, axes, strict=True):
        own = signature["stage"] == stage
        lowest = _LEAST_SHARE * float(level[own].max())
        # sidebands in front: where they are many, their lower ends are one area
        for number, gear in enumerate(["", *gears]):
            chosen = own & (beside == gear) & (level > lowest)
            name = f"sidebands of the {gear}" if gear else "mesh lines"
            colour = plots.series_colour(number - 1) if gear else plots.BLACK
            x, y = hertz[chosen], level[chosen]
            ax.vlines(x, lowest, y, color=colour, linewidth=0.6, label=name if x.size else "")
        ax.set(yscale="log", ylim=(lowest, None), xlim=(0, 1.02 * float(hertz[own].max())))
        ax.set_ylabel("acceleration\nin m/s² (peak)")
        plots.light_grid(ax)
        title, mesh = f"stage {stage}", own & (beside == "") & (signature["mesh_harmonic"] > 0)
        if mesh.any():
            mesh_hz = float(np.median(hertz[mesh] / signature["mesh_harmonic"][mesh]))
            title += f", mesh harmonics of {mesh_hz:.5g} Hz:"
            counted = partial(np.multiply, 1 / mesh_hz), partial(np.multiply, mesh_hz)
            above = ax.secondary_xaxis("top", functions=counted)
            above.xaxis.set_major_locator(MaxNLocator(_MOST_NAMED, integer=True))
            above.tick_params(labelsize=6.5, length=0, pad=1)
        ax.set_title(title, fontsize=8, loc="left", pad=3)
    axes[-1].set_xlabel("frequency in Hz")
    told = ", ".join(signature.header.get("faults", ())) or "healthy"
    figure.text(0.01, 1 - 0.05 / figure.get_figheight(), f"{signature.machine}: {told}", va="top")
    plots.legend(figure, axes)
    return figure


@plots.sheet_style()
def stability_figure(stability: StabilityMap) -> plots.Picture:
    """Draw where free vibrations of a mesh grow: growth, boundaries, and where the pair runs.

    Parameters
    ----------
    stability : StabilityMap
        Boundaries are drawn exact and, as far as it has them, by multiple scales.

    Returns
    -------
    Picture
    """
    figure = plots.sheet(9.0, 5.6)
    ax = figure.add_subplot()
    filled = _plot_growth(stability, ax)
    if filled is not None:
        bar = figure.colorbar(filled, ax=ax, format="%.2g")
        bar.set_label("growth: ln of the largest multiplier, per mesh period")
    else:
        middle: dict[str, Any] = {"transform": ax.transAxes, "ha": "center", "va": "center"}
        ax.text(0.5, 0.5, "stable everywhere", color=plots.GREY, fontsize=13, **middle)
    for tongue in stability.tongues:
        _plot_boundary(tongue, tongue.exact, plots.BLACK, "-", "boundary, exact", ax)
        for order, edges in tongue.expanded.items():
            name, colour, dashes = _ORDERS.get(order, (f"{order}th", plots.GREY, "-."))
            label = f"multiple scales, {name} order"
            _plot_boundary(tongue, edges, colour, dashes, label, ax)
    if stability.mark is not None:
        above = {
            "markeredgecolor": plots.BLACK,
            "label": "this pair",
            "clip_on": False,
            "zorder": 5,
        }
        plots.plot_marks(ax, *stability.mark, "*", 13, "white", **above)
    ax.set_title(f"damping ratio {stability.chart.damping_ratio:.3g}", fontsize=10)
    plots.legend(figure, [ax], 5, "lower center")
    return figure


def _plot_growth(stability: StabilityMap, ax: Axes) -> QuadContourSet | None:
    """Draw growth as filled contours, if anything grows, and where each tongue begins."""
    chart = stability.chart
    ax.set(
        xlim=(chart.speeds[0], chart.speeds[-1]),
        ylim=(0, chart.variations[-1]),
        xlabel="mesh frequency over natural frequency, ω/ω₀",
        ylabel="stiffness variation ε",
    )
    starts = [2 / tongue.number for tongue in stability.tongues]
    inside = [x for x in starts if chart.speeds[0] <= x <= chart.speeds[-1]]
    if inside:
        above = {"label": "2/n", "clip_on": False, "zorder": 4}
        plots.plot_marks(ax, inside, np.zeros(len(inside)), "^", 5, plots.VERMILLION, **above)
    top = float(chart.growth.max())
    if top <= _LEAST_GROWTH:
        return None
    drawn, levels = (chart.speeds, chart.variations, chart.growth), np.linspace(0.0, top, 13)
    return ax.contourf(*drawn, levels=levels, cmap="YlOrRd", vmin=-0.15 * top)


def _plot_boundary(
    tongue: Tongue, edges: Real, colour: str, dashes: str, label: str, ax: Axes
) -> None:
    """Draw both edges of each stretch of eps on which the tongue is open as one line."""
    left, right = ax.get_xlim()
    there = np.asarray(np.isfinite(edges).all(axis=1))
    for first, last in runs_where(there).tolist():
        (low, high), eps = edges[first:last].T, tongue.variations[first:last]
        x, y = np.concatenate([low[::-1], high]), np.concatenate([eps[::-1], eps])
        if x.max() < left or x.min() > right:
            continue
        if last < len(there) and dashes == "-":
            x, y = np.append(x, x[0]), np.append(y, y[0])
        ax.plot(x, y, color=colour, linestyle=dashes, linewidth=1.3, label=label)


@plots.sheet_style()
def campbell_figure(found: Modes) -> plots.Picture:
    """Draw mesh harmonics against speed, natural frequencies, and where they meet.

    Parameters
    ----------
    found : Modes
        Full marks: the mesh forces drive the mode, the more of its strain energy the meshes hold
        the larger; empty marks: they cancel.
    """
    figure = plots.sheet(9.0, 5.8)
    ax = figure.add_subplot()
    speeds = np.array([0.0, found.highest_rpm])
    top = max(found.mesh_orders) * found.harmonics * found.highest_rpm / 60
    elastic = [mode for mode in found.rows if mode.frequency_hz > 0]
    top = max(top, 1.05 * min((mode.frequency_hz for mode in elastic), default=0.0))
    for mode in (own for own in elastic if own.frequency_hz <= top):
        colour, dashes = _TYPE_LINES[mode.type]
        ax.axhline(
            mode.frequency_hz, color=colour, linestyle=dashes, linewidth=0.7, label=mode.type
        )
    ends: list[tuple[float, str, str]] = []
    for stage, order in enumerate(found.mesh_orders):
        label, colour = f"harmonics of mesh {stage + 1}", plots.series_colour(stage)
        hertz = np.outer(speeds / 60, order * np.arange(1, found.harmonics + 1))
        ax.plot(speeds, hertz, color=colour, linewidth=1.0, label=label)
        ends += [(end, f" {harmonic}", colour) for harmonic, end in enumerate(hertz[1], start=1)]
    ends.sort()
    # letters of 7 points on axes of five inches
    heights = plots.spread([hertz for hertz, _, _ in ends], 0.02 * top, 0.0, top)
    for height, (_, text, colour) in zip(heights, ends, strict=True):
        ax.text(speeds[1], height, text, fontsize=7, color=colour, va="center")
    for speed in found.speeds_rpm:
        ax.axvline(
            speed, color=plots.BLACK, linewidth=1.2, linestyle=(0, (6, 2)), label="operating point"
        )
    for meeting in found.campbell:
        size = 2.5 + 6 * math.sqrt(meeting.mesh_share) * (meeting.in_phase if meeting.drives else 0)
        face = plots.series_colour(meeting.stage - 1) if meeting.drives else "white"
        edge = {"markeredgecolor": plots.series_colour(meeting.stage - 1), "markeredgewidth": 0.6}
        plots.plot_marks(
            ax, meeting.speed_rpm, meeting.frequency_hz, "o", size, face, zorder=4, **edge
        )
    ax.set(xlim=(0, found.highest_rpm), ylim=(0, top), xlabel="speed of shaft 1 in rpm")
    ax.set_ylabel("frequency in Hz")
    told = "filled: driven by the mesh, larger where it holds more of the strain energy"
    ax.set_title(f"{found.machine}: natural frequencies and mesh harmonics\n{told}", fontsize=9)
    plots.legend(figure, [ax], 5, "lower center")
    return figure


@plots.style()
def family_figure(family: FaultFamily, operating: int | None = None) -> plots.Picture:
    """Draw a panel for each kind of fault: levels of its sidebands against its size.

    Parameters
    ----------
    family : FaultFamily
    operating : int, optional
        Operating point, from 0; by default the first in the family.

    Returns
    -------
    Picture
    """
    number = family.members[0].operating if operating is None else operating
    members = family.to_frame().query("operating == @number")
    members["member"] = members["stage"].astype(str) + " " + members["gear"]
    kinds, gears = members["kind"].unique(), members["member"].unique().tolist()
    columns = min(_COLUMNS, len(kinds))
    down = math.ceil(len(kinds) / columns)
    figure = plots.sheet(max(2, columns) * _PANEL_IN[0], 0.9 + down * _PANEL_IN[1])
    figure.set_dpi(150)
    axes = figure.subplots(down, columns, sharey=True, squeeze=False)
    for kind, ax in zip(kinds, axes.flat, strict=False):
        _plot_kind(members[members["kind"] == kind], gears, ax)
    for ax in axes.flat[len(kinds) :]:
        ax.set_visible(False)
    for ax in axes[:, 0]:
        ax.set_ylabel("dB re healthy mesh lines")
    beyond = "teeth part: beyond the linear model"
    how = {"label": beyond, "markerfacecolor": "none"}
    plots.plot_marks(axes.flat[0], [np.nan], [np.nan], "o", 9, plots.GREY, **how)
    plots.legend(figure, figure.axes, 6, "lower center")
    point = family.machine.operating[number]
    name = f", {point.name}" if point.name else ""
    figure.suptitle(
        f"{family.machine.name}{name}: rms acceleration of the sidebands of one faulty tooth or "
        "gear",
        fontsize=9,
    )
    return figure


def _plot_kind(rows: pd.DataFrame, gears: Sequence[str], ax: Axes) -> None:
    """Draw the levels of one kind of fault against its size, one curve for each gear."""
    # a fault of all teeth alike makes no sidebands: the change of the mesh lines is shown in place
    alike, is_loss = not rows["sidebands_ms2"].any(), bool(rows["loss"].any())
    share = rows["mesh_change_ms2" if alike else "sidebands_ms2"] / rows["healthy_ms2"]
    # what is not there at all lies below every level
    levels = 20 * np.log10(share.where(share > 0, 1e-99))
    # errors of gears have sizes in um; all else is told by its loss
    sizes = 100 * rows["loss"] if is_loss else rows["size"].str.removesuffix("um").astype(float)
    for number, gear in enumerate(gears):
        chosen = (rows["member"] == gear) & (levels > _LEAST_DB)
        if not chosen.any():
            continue
        order = sizes[chosen].sort_values().index
        x, y, lost = sizes[order], levels[order], rows["contact_lost"][order].astype(bool)
        colour = plots.series_colour(number)
        ax.plot(x, y, color=colour, linewidth=1.1)
        # gears that behave alike lie upon one another: the first ones stay to be seen behind
        size = max(3.5, 6.5 - number)
        plots.plot_marks(ax, x, y, plots.series_marker(number), size, colour, label=gear)
        plots.plot_marks(ax, x[lost], y[lost], "o", 9, plots.GREY, markerfacecolor="none")
    ax.set_xscale("log")
    # gears of one kind differ a little in what a size takes
    ticks = sorted({float(f"{size:.2g}") for size in sizes})
    ax.set_xticks(ticks[:: max(1, math.ceil(len(ticks) / 6))])
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
    if min(levels) <= _LEAST_DB:
        note = f"not shown: below {_LEAST_DB:g} dB"
        ax.text(0.03, 0.04, note, transform=ax.transAxes, fontsize=7, color=plots.GREY)
    ax.minorticks_off()
    ax.set(
        xlim=(0.85 * min(sizes), 1.18 * max(sizes)),
        xlabel="loss of pair stiffness in %" if is_loss else "size in µm",
    )
    kind = rows["kind"].iloc[0]
    ax.set_title(f"{kind}: change of the mesh lines" if alike else kind)
    ax.grid(True, color="#e3e5e8", linewidth=0.5)
