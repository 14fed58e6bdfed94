"""Pictures of families of signatures: how strong the traces of each kind of fault are."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearmon.files import replacing
from gearmon.report.palette import GREY, series_colour, series_marker
from gearmon.report.plots import style
from gearmon.signatures.fault_family import FaultFamily

#: Panels side by side, and size of one [inch].
COLUMNS, PANEL_IN = 3, (2.9, 2.15)
#: Levels below this are not shown [dB].
LEAST_DB = -120.0
#: A fault of all teeth alike makes no sidebands: the change of the mesh lines is shown in place.
CHANGED = "mesh_change_ms2"


def plot_kind(rows: list[dict[str, Any]], kind: str, gears: list[str], ax: Axes) -> Axes:
    """Draw the levels of one kind of fault against its size, one curve for each gear.

    Parameters
    ----------
    rows : list of dict
        Rows of `FaultFamily.rows` of one operating point.
    kind : str
    gears : list of str
        All gears of the picture, such as "1 pinion": they keep their colours.
    ax : Axes
    """
    own = [row for row in rows if row["kind"] == kind]
    column = "sidebands_ms2" if any(row["sidebands_ms2"] for row in own) else CHANGED
    is_loss = any(row["loss"] for row in own)
    for number, gear in enumerate(gears):
        mine = [row for row in own if _gear(row) == gear]
        points = [(_size(row, is_loss), _level(row, column), row["contact_lost"]) for row in mine]
        points = sorted(point for point in points if point[1] > LEAST_DB)
        if not points:
            continue
        x, y, lost = (np.array(values) for values in zip(*points, strict=True))
        colour = series_colour(number)
        ax.plot(x, y, color=colour, linewidth=1.1)
        # gears that behave alike lie upon one another: the first ones stay to be seen behind
        size = max(3.5, 6.5 - number)
        ax.plot(
            x, y, series_marker(number), color=colour, markersize=size, linestyle="none", label=gear
        )
        ax.plot(x[lost], y[lost], "o", markersize=9, markerfacecolor="none", markeredgecolor=GREY)
    ax.set_xscale("log")
    # gears of one kind differ a little in what a size takes
    ticks = sorted({float(f"{_size(row, is_loss):.2g}") for row in own})
    ax.set_xticks(ticks[:: max(1, math.ceil(len(ticks) / 6))])
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
    if any(_level(row, column) <= LEAST_DB for row in own):
        note = f"not shown: below {LEAST_DB:g} dB"
        ax.text(0.03, 0.04, note, transform=ax.transAxes, fontsize=7, color=GREY)
    ax.minorticks_off()
    every = [_size(row, is_loss) for row in own]
    ax.set_xlim(0.85 * min(every), 1.18 * max(every))
    ax.set_xlabel("loss of pair stiffness in %" if is_loss else "size in um")
    ax.set_title(kind if column != CHANGED else f"{kind}: change of the mesh lines")
    ax.grid(True, color="#e3e5e8", linewidth=0.5)
    return ax


def family_figure(family: FaultFamily, operating: int | None = None) -> Figure:
    """Return one sheet: a panel for each kind, levels of its sidebands against its size.

    Parameters
    ----------
    family : FaultFamily
    operating : int, optional
        Operating point, from 0; by default the first in the family.
    """
    number = family.members[0].operating if operating is None else operating
    rows = [row for row in family.rows() if row["operating"] == number]
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    gears = list(dict.fromkeys(_gear(row) for row in rows))
    columns = min(COLUMNS, len(kinds))
    down = math.ceil(len(kinds) / columns)
    width = max(2, columns) * PANEL_IN[0]
    with style():
        figure = Figure(figsize=(width, 0.9 + down * PANEL_IN[1]), layout="constrained")
        axes = figure.subplots(down, columns, sharey=True, squeeze=False)
        for kind, ax in zip(kinds, axes.flat, strict=False):
            plot_kind(rows, kind, gears, ax)
        for ax in axes.flat[len(kinds) :]:
            ax.set_visible(False)
        for ax in axes[:, 0]:
            ax.set_ylabel("dB re healthy mesh lines")
        _legend(figure, [ax for ax in axes.flat if ax.get_visible()])
        point = family.machine.operating[number]
        name = f", {point.name}" if point.name else ""
        figure.suptitle(
            f"{family.machine.name}{name}: rms acceleration of the sidebands of one faulty tooth "
            f"or gear",
            fontsize=9,
        )
    return figure


def save_family_figure(family: FaultFamily, path: str | Path, operating: int | None = None) -> Path:
    """Write the sheet as a picture; the format follows the suffix of `path`."""
    target = Path(path)
    with replacing(target) as temporary, style():
        family_figure(family, operating).savefig(temporary, dpi=150)
    return target


def _legend(figure: Figure, axes: list[Axes]) -> None:
    named: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    ring = axes[0].plot([], [], "o", markersize=9, markerfacecolor="none", markeredgecolor=GREY)[0]
    named["teeth part: beyond the linear model"] = ring
    figure.legend(
        list(named.values()), list(named), loc="outside lower center", ncols=min(6, len(named))
    )


def _gear(row: dict[str, Any]) -> str:
    return f"{row['stage']} {row['gear']}"


def _size(row: dict[str, Any], is_loss: bool) -> float:
    if is_loss:
        return 100 * float(row["loss"])
    text = str(row["size"])
    return 1e3 * float(text[:-2]) if text.endswith("mm") else float(text[:-2])


def _level(row: dict[str, Any], column: str) -> float:
    if not row[column] or not row["healthy_ms2"]:
        return -math.inf
    return 20 * math.log10(row[column] / row["healthy_ms2"])
