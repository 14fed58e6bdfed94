"""Pictures of teeth and of mesh stiffness: a sheet of a stage, and the forms side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from gearmon.gears.stiffness_report import (
    DrawnGear,
    FormComparison,
    SizeCurve,
    StageStiffness,
    StiffnessReport,
    TeethPicture,
)
from gearmon.report.plots import BLUE, GREEN, ORANGE, Picture, plot_marks, sheet, sheet_style
from gearmon.report.plots import VERMILLION as RED

_GREY = "#777777"
_CAUSES = {
    "bending": BLUE,
    "shear": ORANGE,
    "axial": _GREY,
    "foundation": GREEN,
    "contact": "#CC79A7",
}
#: How what is broken off or worn away looks, and a hole.
_HOLE: dict[str, Any] = {"facecolor": "white", "edgecolor": RED, "linewidth": 1.0}
_GONE = _HOLE | {"hatch": "///"}
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


def stiffness_figures(report: StiffnessReport) -> dict[str, Picture]:
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


@sheet_style()
def stiffness_figure(stage: StageStiffness) -> Picture:
    """Draw the sheet of a stage: teeth, flank, stiffness, shares of compliance, loss by size.

    Parameters
    ----------
    stage : StageStiffness
    """
    figure = sheet(11.5, 8.2)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.0, 0.55, 1.0))
    if stage.picture is not None:
        _plot_teeth(stage.picture, figure.add_subplot(grid[0:2, 0]))
        gears = stage.picture.gears
        hurt = next((gear for gear in gears if gear.damage), gears[0])
        _plot_flank(hurt, figure.add_subplot(grid[1, 1]))
    _plot_stiffness(stage, figure.add_subplot(grid[0, 1]))
    if stage.shares:
        # without a curve of losses the shares take its place too
        place = grid[2, 0] if stage.curve is not None else grid[2, :]
        _plot_compliance_shares(stage, figure.add_subplot(place))
    if stage.curve is not None:
        _plot_size_curve(stage.curve, figure.add_subplot(grid[2, 1]))
    faults = ", ".join(str(entry.fault) for entry in stage.faults) or "healthy"
    figure.suptitle(f"stage {stage.stage}, {stage.mesh}: {faults}", fontsize=11)
    return figure


def _plot_teeth(picture: TeethPicture, ax: Axes) -> None:
    """Draw the pair of teeth, cut square to their flanks, to scale."""
    # the body of the first gear lies below its teeth, that of the second above, a ring's too
    for gear, colour, side in zip(picture.gears, (BLUE, GREEN), (-1, 1), strict=True):
        body = _with_body(gear.outline, side)
        ax.fill(*body.T, facecolor=colour, alpha=0.18, linewidth=0)
        ax.plot(*gear.outline.T, color=colour, linewidth=1.2, label=gear.name)
    for damage in picture.gears[0].damage + picture.gears[1].damage:
        if damage.kind == "crack":
            ax.plot(*damage.section.T, color=RED, linewidth=2.2, label="crack")
        else:
            looks = _HOLE if damage.kind in ("spall", "pits") else _GONE
            ax.add_patch(Polygon(damage.section, closed=True, **looks))
    x, y = picture.contact
    plot_marks(ax, x, y, "o", 4, "black", label="contact")
    # the loaded teeth with their roots and no more
    reach = 1.7 * max(gear.tip for gear in picture.gears)
    ax.set(xlim=(x - reach, x + reach), ylim=(y - 0.95 * reach, y + 0.95 * reach), aspect="equal")
    ax.set(xlabel="across the line of centres in mm", ylabel="along the line of centres in mm")
    ax.legend(loc="upper right", fontsize=8)


def _with_body(outline: NDArray[np.float64], side: int) -> NDArray[np.float64]:
    """Return a row of teeth closed far above or below it."""
    far = side * (2 * np.ptp(outline[:, 1]) + np.ptp(outline[:, 0]))
    edge = (outline[:, 1].max() if side > 0 else outline[:, 1].min()) + far
    corners = np.array([[outline[-1, 0], edge], [outline[0, 0], edge]])
    return np.concatenate([outline, corners])


def _plot_flank(gear: DrawnGear, ax: Axes) -> None:
    """Draw the loaded flank of a gear as its mate sees it, with its damage to scale."""
    width, low, high = gear.face_width, gear.flank_start, gear.tip
    ax.add_patch(Rectangle((0, 0), width, low, facecolor=_GREY, alpha=0.25, linewidth=0))
    ax.add_patch(Rectangle((0, low), width, high - low, facecolor=BLUE, alpha=0.15, linewidth=0))
    ax.add_patch(Rectangle((0, 0), width, high, fill=False, edgecolor="black", linewidth=1.0))
    for own in gear.damage:
        begin, size = own.face_start, own.high - own.low
        if own.kind == "crack":
            ax.plot([begin, begin + own.face_width], [own.low] * 2, color=RED, linewidth=2.5)
        elif own.kind == "pits":
            _plot_pits(ax, width, own.face_width, own.low + size / 2, size / 2)
        else:
            ax.add_patch(Rectangle((begin, own.low), own.face_width, size, **_GONE))
    ax.set(xlim=(-0.03 * width, 1.03 * width), ylim=(-0.08 * high, 1.12 * high), aspect="equal")
    ax.set(xlabel="along the face in mm", ylabel="above root in mm")
    ax.set_title(f"loaded flank of the {gear.name} (fillet grey)", fontsize=9)


def _plot_pits(ax: Axes, face: float, width: float, middle: float, radius: float) -> None:
    """Spread pits evenly along the face; their number times their diameter is `width`."""
    count = max(1, round(width / (2 * radius)))
    angle = np.linspace(0, 2 * np.pi, 24)
    # every other row is shifted by half a step
    shift = 0.25 if round(middle / radius) % 2 else 0.75
    for k in range(count):
        x = face * (k + shift) / count
        outline = x + radius * np.cos(angle), middle + radius * np.sin(angle)
        ax.fill(*outline, **_HOLE | {"linewidth": 0.6})


def _plot_stiffness(stage: StageStiffness, ax: Axes) -> None:
    """Draw the mesh stiffness, healthy against damaged."""
    # without the last phase, where the next pair enters
    x = np.linspace(stage.phase[0], stage.phase[-1], 3 * len(stage.phase), endpoint=False)
    healthy = _GN * stage.healthy.at(x)
    if stage.faults:
        damaged = _GN * stage.damaged.at(x)
        ax.fill_between(x, damaged, healthy, color=RED, alpha=0.15, linewidth=0)
        ax.plot(x, damaged, color=RED, linewidth=1.4, label="damaged")
    ax.plot(x, healthy, color=BLUE, linewidth=1.4, label="healthy")
    ax.set(ylim=(0, 1.08 * healthy.max()), xlim=(stage.phase[0], stage.phase[-1]))
    ax.set(xlabel="mesh phase in mesh periods", ylabel="mesh stiffness in GN/m")
    ax.legend(fontsize=8, loc="lower right")


def _plot_compliance_shares(stage: StageStiffness, ax: Axes) -> None:
    """Draw the share of each cause in the compliance of a sound pair over its contact."""
    names = [name for name in _CAUSES if name in stage.shares]
    ax.stackplot(
        stage.contact_phase,
        [100 * stage.shares[name] for name in names],
        colors=[_CAUSES[name] for name in names],
        labels=names,
        alpha=0.85,
    )
    ax.set(xlim=(0, stage.contact_phase[-1]), ylim=(0, 100))
    ax.set_xlabel("phase of the pair's contact in mesh periods")
    ax.set_ylabel("share of pair compliance in %")
    # above the bands, in their order from below
    ax.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5)


def _plot_size_curve(curve: SizeCurve, ax: Axes) -> None:
    """Draw the loss of pair stiffness against the size of the damage."""
    fault, unit = curve.fault, _UNITS[curve.fault.unit]
    ax.plot(curve.sizes, 100 * curve.greatest_loss, color=ORANGE, label="greatest in the contact")
    ax.plot(curve.sizes, 100 * curve.mean_loss, color=BLUE, label="mean over the contact")
    if fault.size:
        loss = 100 * float(np.interp(fault.size, curve.sizes, curve.mean_loss))
        ax.plot(fault.size, loss, "o", color=RED, label=f"{fault.size:.3g} {unit}")
    ax.set_xlim(0, curve.sizes[-1])
    ax.set_ylim(bottom=0)
    ax.set_xlabel(f"{_SIZES[fault.kind]} ({fault.gear}) in {unit}")
    ax.set_ylabel("loss of pair stiffness in %")
    ax.legend(fontsize=8, loc="upper left")


@sheet_style()
def form_figure(comparison: FormComparison) -> Picture:
    """Draw a row for each form of the stiffness: its curve on the left, its spectrum on the right.

    Parameters
    ----------
    comparison : FormComparison

    Returns
    -------
    Picture
    """
    groups = list(dict.fromkeys(curve.group for curve in comparison.forms))
    figure = sheet(11.5, 0.9 + 2.0 * len(groups))
    axes = figure.subplots(len(groups), 2, sharex="col", squeeze=False)
    for group, (left, right) in zip(groups, axes, strict=True):
        _plot_form(comparison, group, left)
        _plot_form_lines(comparison, group, right)
    axes[-1][0].set_xlabel("mesh phase in mesh periods")
    axes[-1][1].set_xlabel(f"mesh harmonic (times {comparison.spectrum[0]['frequency_hz']:.5g} Hz)")
    figure.suptitle(
        f"{comparison.machine}, stage {comparison.stage}, {comparison.mesh}: forms of the mesh "
        f"stiffness, contact ratio {comparison.contact_ratio:.4g}",
        fontsize=11,
    )
    return figure


def _plot_form(comparison: FormComparison, group: str, ax: Axes) -> None:
    """Draw the curves of one form over the mesh periods, the first form of all in grey."""
    phase, reference = [row["mesh_phase"] for row in comparison.table], comparison.forms[0]
    if reference.group != group:
        known = _GN * reference.stiffness_n_per_m
        ax.plot(phase, known, color=_GREY, linewidth=0.9, alpha=0.7, label="reference")
    own = [curve for curve in comparison.forms if curve.group == group]
    for curve, colour, width in zip(own, (BLUE, RED), (1.6, 1.1), strict=False):
        name = _FORMS[curve.form]
        ax.plot(phase, _GN * curve.stiffness_n_per_m, color=colour, linewidth=width, label=name)
    least = _GN * min(curve.stiffness_n_per_m.min() for curve in comparison.forms)
    most = _GN * max(curve.stiffness_n_per_m.max() for curve in comparison.forms)
    ax.set_xlim(phase[0], phase[-1])
    # room for the names of the curves above them
    ax.set_ylim(least - 0.08 * (most - least), most + 0.55 * (most - least))
    ax.set_ylabel("stiffness in GN/m")
    ax.legend(fontsize=8, loc="upper right", ncols=3)


def _plot_form_lines(comparison: FormComparison, group: str, ax: Axes) -> None:
    """Draw the spectrum of one form: amplitudes of the mesh harmonics, without the mean."""
    own = [curve for curve in comparison.forms if curve.group == group]
    shifts = [0.0] if len(own) == 1 else [-0.13, 0.13]
    for curve, colour, shift in zip(own, (BLUE, RED), shifts, strict=False):
        height = _MN * curve.amplitudes_n_per_m
        orders = np.arange(1, len(height) + 1) + shift
        ax.vlines(orders, 0, height, color=colour, linewidth=1.4)
        ax.plot(orders, height, "o", color=colour, markersize=3.5)
    top = _MN * max(float(curve.amplitudes_n_per_m.max()) for curve in comparison.forms)
    ax.set(xlim=(0.3, len(height) + 0.7), ylim=(0, 1.08 * top if top else 1.0))
    ax.set_ylabel("amplitude in MN/m")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
