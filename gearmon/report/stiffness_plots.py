"""Pictures of teeth and of mesh stiffness. Each function draws one value on given axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from numpy.typing import NDArray

from gearmon.files import replacing
from gearmon.gears.stiffness_report import SizeCurve, StageStiffness, StiffnessReport
from gearmon.gears.tooth_outline import TeethPicture

#: Colours that can be told apart by everyone (Okabe & Ito).
BLUE, ORANGE, GREEN, RED, PURPLE, GREY = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#CC79A7",
    "#777777",
)
CAUSES = {
    "bending": BLUE,
    "shear": ORANGE,
    "axial": GREY,
    "foundation": GREEN,
    "contact": PURPLE,
}
GN = 1e-9


def plot_teeth(picture: TeethPicture, ax: Axes) -> Axes:
    """Draw the pair of teeth in the transverse section, to scale.

    Parameters
    ----------
    picture : TeethPicture
    ax : Axes

    Returns
    -------
    Axes
    """
    # the body of the first gear lies below its teeth, that of the second above, a ring's too
    for outline, colour, name, side in zip(
        picture.outlines, (BLUE, GREEN), picture.names, (-1, 1), strict=True
    ):
        ax.fill(*_with_body(outline, side).T, facecolor=colour, alpha=0.18, linewidth=0)
        ax.plot(*outline.T, color=colour, linewidth=1.2, label=name)
    for hole in picture.holes:
        ax.add_patch(Polygon(hole, closed=True, facecolor="white", edgecolor=RED, linewidth=1.0))
    for part in picture.gone:
        ax.add_patch(
            Polygon(part, closed=True, facecolor="white", edgecolor=RED, hatch="///", linewidth=1.0)
        )
    for crack in picture.cracks:
        ax.plot(*crack.T, color=RED, linewidth=2.2, solid_capstyle="round", label="crack")
    ax.plot(
        *picture.contact, marker="o", markersize=4, color="black", linestyle="none", label="contact"
    )
    _frame(picture, ax)
    ax.set_aspect("equal")
    ax.set_xlabel("across the line of centres in mm")
    ax.set_ylabel("along the line of centres in mm")
    ax.legend(loc="upper right", fontsize=8)
    return ax


def plot_flank(picture: TeethPicture, gear: str, ax: Axes) -> Axes:
    """Draw the loaded flank of a gear as its mate sees it, with its damage to scale.

    Parameters
    ----------
    picture : TeethPicture
    gear : str
    ax : Axes
    """
    width, low, high = picture.flank_sizes_mm[gear]
    ax.add_patch(Rectangle((0, 0), width, low, facecolor=GREY, alpha=0.25, linewidth=0))
    ax.add_patch(Rectangle((0, low), width, high - low, facecolor=BLUE, alpha=0.15, linewidth=0))
    ax.add_patch(Rectangle((0, 0), width, high, fill=False, edgecolor="black", linewidth=1.0))
    for mark in picture.marks[gear]:
        place, size = (mark.face_start_mm, mark.low_mm), mark.high_mm - mark.low_mm
        if mark.kind == "crack":
            ax.plot([place[0], place[0] + mark.face_width_mm], [place[1]] * 2, color=RED, lw=2.5)
        elif mark.kind == "pits":
            _pits(ax, width, mark.face_width_mm, place[1] + size / 2, size / 2)
        else:
            ax.add_patch(
                Rectangle(
                    place, mark.face_width_mm, size, facecolor="white", edgecolor=RED, hatch="///"
                )
            )
    ax.set_xlim(-0.03 * width, 1.03 * width)
    ax.set_ylim(-0.08 * high, 1.12 * high)
    ax.set_aspect("equal")
    ax.set_xlabel("along the face in mm")
    ax.set_ylabel("above root in mm")
    ax.set_title(f"loaded flank of the {gear} (fillet grey)", fontsize=9)
    return ax


def plot_stiffness(stage: StageStiffness, ax: Axes) -> Axes:
    """Draw the mesh stiffness, healthy against damaged."""
    # without the last phase, where the next pair enters
    x = np.linspace(stage.phase[0], stage.phase[-1], 3 * len(stage.phase), endpoint=False)
    healthy = GN * stage.healthy.at(x)
    if stage.faults:
        damaged = GN * stage.damaged.at(x)
        ax.fill_between(x, damaged, healthy, color=RED, alpha=0.15, linewidth=0)
        ax.plot(x, damaged, color=RED, linewidth=1.4, label="damaged")
    ax.plot(x, healthy, color=BLUE, linewidth=1.4, label="healthy")
    ax.set_ylim(0, 1.08 * healthy.max())
    ax.set_xlim(stage.phase[0], stage.phase[-1])
    ax.set_xlabel("mesh phase in mesh periods")
    ax.set_ylabel("mesh stiffness in GN/m")
    ax.legend(fontsize=8, loc="lower right")
    return ax


def plot_compliance_shares(stage: StageStiffness, ax: Axes) -> Axes:
    """Draw the share of each cause in the compliance of a sound pair over its contact."""
    names = [name for name in CAUSES if name in stage.shares]
    ax.stackplot(
        stage.contact_phase,
        [100 * stage.shares[name] for name in names],
        colors=[CAUSES[name] for name in names],
        labels=names,
        alpha=0.85,
    )
    ax.set_xlim(0, stage.contact_phase[-1])
    ax.set_ylim(0, 100)
    ax.set_xlabel("phase of the pair's contact in mesh periods")
    ax.set_ylabel("share of pair compliance in %")
    handles, labels = ax.get_legend_handles_labels()
    # above the bands, in their order from below
    ax.legend(handles, labels, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5)
    return ax


def plot_size_curve(curve: SizeCurve, ax: Axes) -> Axes:
    """Draw the loss of pair stiffness against the size of the damage."""
    ax.plot(curve.sizes, 100 * curve.greatest_loss, color=ORANGE, label="greatest in the contact")
    ax.plot(curve.sizes, 100 * curve.mean_loss, color=BLUE, label="mean over the contact")
    if curve.marked:
        loss = 100 * float(np.interp(curve.marked, curve.sizes, curve.mean_loss))
        ax.plot(curve.marked, loss, "o", color=RED, label=f"{curve.marked:.3g} {_unit(curve)}")
    ax.set_xlim(0, curve.sizes[-1])
    ax.set_ylim(bottom=0)
    ax.set_xlabel(f"{_size_name(curve)} in {_unit(curve)}")
    ax.set_ylabel("loss of pair stiffness in %")
    ax.legend(fontsize=8, loc="upper left")
    return ax


def stiffness_figure(stage: StageStiffness) -> Figure:
    """Return one sheet for a stage: teeth, flank, stiffness, shares, loss against size."""
    figure = Figure(figsize=(11.5, 8.2), layout="constrained")
    grid = figure.add_gridspec(3, 2, height_ratios=(1.0, 0.55, 1.0))
    if stage.picture is not None:
        plot_teeth(stage.picture, figure.add_subplot(grid[0:2, 0]))
        marked = [name for name in stage.picture.names if stage.picture.marks[name]]
        gear = marked[0] if marked else stage.picture.names[0]
        plot_flank(stage.picture, gear, figure.add_subplot(grid[1, 1]))
    plot_stiffness(stage, figure.add_subplot(grid[0, 1]))
    if stage.shares:
        # without a curve of losses the shares take its place too
        place = grid[2, 0] if stage.curve is not None else grid[2, :]
        plot_compliance_shares(stage, figure.add_subplot(place))
    if stage.curve is not None:
        plot_size_curve(stage.curve, figure.add_subplot(grid[2, 1]))
    faults = ", ".join(str(entry.fault) for entry in stage.faults) or "healthy"
    figure.suptitle(f"stage {stage.stage}, {stage.mesh}: {faults}", fontsize=11)
    return figure


def save_stiffness_figures(report: StiffnessReport, path: str | Path) -> list[Path]:
    """Write the sheets of a report as pictures; the format follows the suffix of `path`.

    Parameters
    ----------
    report : StiffnessReport
    path : str or Path
        Of several stages each gets its number before the suffix, and of several meshes of a stage
        their gears.

    Returns
    -------
    list of Path
    """
    target, written = Path(path), []
    numbers = [stage.stage for stage in report.stages]
    for stage in report.stages:
        name = target
        if len(report.stages) > 1:
            mesh = "" if numbers.count(stage.stage) < 2 else f"-{stage.mesh}"
            name = target.with_name(f"{target.stem}-stage{stage.stage}{mesh}{target.suffix}")
        with replacing(name) as temporary:
            stiffness_figure(stage).savefig(temporary, dpi=130)
        written.append(name)
    return written


def _with_body(outline: NDArray[np.float64], side: int) -> NDArray[np.float64]:
    """Return a row of teeth closed far above or below it."""
    far = side * (2 * np.ptp(outline[:, 1]) + np.ptp(outline[:, 0]))
    edge = (outline[:, 1].max() if side > 0 else outline[:, 1].min()) + far
    corners = np.array([[outline[-1, 0], edge], [outline[0, 0], edge]])
    return np.concatenate([outline, corners])


def _frame(picture: TeethPicture, ax: Axes) -> None:
    """Show the loaded teeth with their roots and no more."""
    sizes = [high for _, _, high in picture.flank_sizes_mm.values()]
    reach = 1.7 * max(sizes)
    x, y = picture.contact
    ax.set_xlim(x - reach, x + reach)
    ax.set_ylim(y - 0.95 * reach, y + 0.95 * reach)


def _pits(ax: Axes, face: float, width: float, middle: float, radius: float) -> None:
    """Spread pits evenly along the face; their number times their diameter is `width`."""
    count = max(1, round(width / (2 * radius)))
    angle = np.linspace(0, 2 * np.pi, 24)
    # every other row is shifted by half a step
    shift = 0.25 if round(middle / radius) % 2 else 0.75
    for k in range(count):
        x = face * (k + shift) / count
        ax.fill(
            x + radius * np.cos(angle),
            middle + radius * np.sin(angle),
            facecolor="white",
            edgecolor=RED,
            linewidth=0.6,
        )


def _unit(curve: SizeCurve) -> str:
    return {"mm": "mm", "flank": "share of the flank", "%flank": "% of the flank"}[curve.unit]


def _size_name(curve: SizeCurve) -> str:
    names = {
        "crack": "depth of the root crack",
        "spall": "width of the spall",
        "breakage": "face width broken off",
        "wear": "wear",
        "pitting": "pitting",
    }
    return f"{names[curve.kind]} ({curve.gear})"
