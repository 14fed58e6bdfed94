"""The picture of changes of level against the reference."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from gearmon.diagnosis.results import Analysis
from gearmon.report.palette import BLACK
from gearmon.report.plots import PAGE_WIDTH_IN, Picture, above, new_figure, style
from gearmon.report.text import BEYOND, is_beyond
from gearmon.report.wording import shaft_text, shortened, told_apart
from gearmon.signatures.measured.line_plan import Family

FloatArray = NDArray[np.float64]

_KINDS = ("mesh", "sidebands", "residual")
# The colour scale of changes spans at least this and at most that [dB].
_LEAST_LIMIT_DB, _MOST_LIMIT_DB = 6.0, 20.0
# Cells narrower than this share of the page cannot hold a number.
_NARROWEST_NUMBERED = 1 / 44


#: Stage, label, and families that differ only in the mesh harmonic, ascending.
FamilyGroup = tuple[int, str, list[Family]]


def family_groups(families: Sequence[Family]) -> list[FamilyGroup]:
    """Return the families by stage, kind and what repeats, as rows of a picture."""

    def rank(own: Family) -> tuple[int, int, float, str]:
        return own.stage, _KINDS.index(own.kind), -own.spacing, own.gear

    ordered = sorted(families, key=lambda own: (*rank(own), own.harmonic))
    groups = [list(own) for _, own in groupby(ordered, key=rank)]
    result: list[FamilyGroup] = []
    for stage, of_stage in groupby(groups, key=lambda own: own[0].stage):
        own = list(of_stage)
        # two spacings of one gear in one stage are told apart by their order
        names = told_apart([_label(one[0]) for one in own], [one[0].spacing for one in own])
        result += [(stage, name, one) for name, one in zip(names, own, strict=True)]
    return result


def _label(family: Family) -> str:
    if family.kind == "mesh":
        return f"mesh {family.stage}"
    return f"{family.kind}, {shaft_text(family.shaft, family.gear)}"


@style()
def changes_figure(analysis: Analysis) -> Picture:
    """Draw the changes of every stage: groups of families by channels and mesh harmonics.

    Parameters
    ----------
    analysis : Analysis
        With changes.

    Returns
    -------
    Picture
    """
    sizes = [abs(change.change_db) for change in analysis.changes]
    limit = float(np.clip(np.percentile(sizes, 98), _LEAST_LIMIT_DB, _MOST_LIMIT_DB))
    groups = family_groups(analysis.signature.plan.families)
    stages = sorted({change.stage for change in analysis.changes})
    own = [[group for group in groups if group[0] == stage] for stage in stages]
    figure, axes = new_figure(
        [0.24 * len(rows) for rows in own],
        left_in=1.25,
        right_in=0.75,
        gap_in=0.62,
        many_colours=True,
    )
    for stage, rows, ax in zip(stages, own, axes, strict=True):
        image = _plot_changes(analysis, rows, limit, ax)
        ax.set_xlabel(f"Harmonic of mesh {stage}")
    scale = figure.add_axes((1 - 0.65 / PAGE_WIDTH_IN, 0.25, 0.11 / PAGE_WIDTH_IN, 0.5))
    figure.colorbar(image, cax=scale, extend="both").set_label("Change (dB)")
    strongest = max(analysis.changes, key=lambda change: abs(change.standardised))
    return figure.told(
        name="changes",
        heading="Changes against the reference",
        caption="Measured less expected level in dB; red is louder, blue quieter than the healthy "
        f"machine. Framed: more than {BEYOND:g} standard deviations. Look for a whole row that is "
        "framed in several channels: its label names the shaft. A fault may make some lines "
        "quieter.",
        alt="Table of changes by channel and family of lines; the clearest is "
        f"{strongest.family} in {strongest.channel}: {strongest.change_db:+.1f} dB, "
        f"{abs(strongest.standardised):.1f} standard deviations.",
    )


def _plot_changes(
    analysis: Analysis, rows: Sequence[FamilyGroup], limit_db: float, ax: Axes
) -> AxesImage:
    """Draw the changes of one stage as coloured cells, with numbers where they fit."""
    channels = analysis.signature.channel_names
    harmonics = sorted({family.harmonic for _, _, own in rows for family in own})
    table, beyond = _change_table(analysis, rows, harmonics)
    columns = table.shape[1]
    image = ax.imshow(
        np.ma.masked_invalid(table),
        cmap=matplotlib.colormaps["RdBu_r"].with_extremes(bad="#f1f1f1"),
        vmin=-limit_db,
        vmax=limit_db,
        aspect="auto",
        interpolation="nearest",
    )
    numbered = 0.8 / columns > _NARROWEST_NUMBERED
    for row, column in np.argwhere(np.isfinite(table)):
        value = float(table[row, column])
        number = "0" if abs(value) < 0.5 else f"{value:+.0f}".replace("-", "−")
        colour = "white" if abs(value / limit_db) > 0.62 else BLACK
        place = (int(row), int(column))
        _cell(ax, place, number if numbered else "", colour, bool(beyond[row, column]))
    for edge in range(1, len(channels)):
        ax.axvline(edge * len(harmonics) - 0.5, color="white", linewidth=3)
    ax.set_yticks(range(len(rows)), [label for _, label, _ in rows])
    every = 1 if columns <= 48 else 2
    ticks = [c for c in range(columns) if c % len(harmonics) % every == 0]
    ax.set_xticks(ticks, [str(harmonics[c % len(harmonics)]) for c in ticks], fontsize=6)
    ax.tick_params(length=0, pad=2)
    for spine in ax.spines.values():
        spine.set_visible(False)
    for block, channel in enumerate(channels):
        middle = (block + 0.5) * len(harmonics) - 0.5
        above(ax, middle, shortened(channel), fontweight="bold", fontsize=7.5)
    return image


def _change_table(
    analysis: Analysis, rows: Sequence[FamilyGroup], harmonics: Sequence[int]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return changes and whether they stand out: rows of groups, a block of columns a channel."""
    channels = analysis.signature.channel_names
    place = {
        family.name: (row, harmonics.index(family.harmonic))
        for row, (_, _, own) in enumerate(rows)
        for family in own
    }
    shape = (len(rows), len(channels) * len(harmonics))
    table, beyond = np.full(shape, np.nan), np.zeros(shape, dtype=bool)
    for change in analysis.changes:
        if change.family in place and change.channel in channels:
            row, column = place[change.family]
            column += channels.index(change.channel) * len(harmonics)
            table[row, column] = change.change_db
            beyond[row, column] = is_beyond(change)
    return table, beyond


def _cell(ax: Axes, place: tuple[int, int], number: str, colour: str, beyond: bool) -> None:
    row, column = place
    if number:
        weight = "bold" if beyond else "normal"
        ax.text(
            column, row, number, ha="center", va="center", fontsize=6, color=colour, weight=weight
        )
    elif beyond:
        ax.plot(column, row, marker="o", markersize=1.8, color=colour)
    if beyond:
        corner = (column - 0.44, row - 0.44)
        ax.add_patch(Rectangle(corner, 0.88, 0.88, fill=False, edgecolor=BLACK, linewidth=0.9))
