"""Figures: size, lettering and files. The modules `plots*` are the only users of matplotlib."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from gearmon.report.palette import BLACK, LIGHT_GREY

# Width of the text on an A4 page with 15 mm margins [inch].
PAGE_WIDTH_IN = 7.1
PNG_DOTS_PER_INCH = 190

# Letters of 7 to 8 points on a picture that fills the width of an A4 page.
_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7.5,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.labelsize": 7.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "axes.edgecolor": "#5a5f66",
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "text.color": BLACK,
    "axes.labelcolor": BLACK,
    "lines.linewidth": 0.8,
    "path.simplify_threshold": 0.2,
}


@contextmanager
def style() -> Iterator[None]:
    """Draw in gearmon's style inside this block, and leave the caller's own style alone."""
    with matplotlib.rc_context(_STYLE):  # type: ignore[arg-type,unused-ignore]
        yield


def new_figure(
    heights_in: Sequence[float],
    *,
    top_in: float = 0.26,
    bottom_in: float = 0.42,
    left_in: float = 0.85,
    right_in: float = 0.12,
    gap_in: float = 0.12,
    sharex: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Return a figure as wide as a page, with axes one above the other.

    The margins are given, not found by measuring all letters: that took as long as drawing.

    Parameters
    ----------
    heights_in : sequence of float
        Height of each axes [inch], from the top.
    top_in, bottom_in, left_in, right_in, gap_in : float
        Margins, and the gap between neighbours [inch].
    sharex : bool
        Whether all have one horizontal scale, numbered at the lowest only.

    Returns
    -------
    figure : Figure
        Not known to pyplot: it goes when its last user does.
    axes : list of Axes
    """
    height = top_in + bottom_in + sum(heights_in) + gap_in * (len(heights_in) - 1)
    figure = Figure(figsize=(PAGE_WIDTH_IN, height))
    FigureCanvasAgg(figure)
    left, width = left_in / PAGE_WIDTH_IN, 1 - (left_in + right_in) / PAGE_WIDTH_IN
    axes: list[Axes] = []
    below = height - top_in
    for own in heights_in:
        below -= own
        shared = axes[0] if sharex and axes else None
        place = (left, below / height, width, own / height)
        axes.append(figure.add_axes(place, sharex=shared))
        below -= gap_in
    if sharex:
        for ax in axes[:-1]:
            # ticks take most of the time of drawing, and these would carry no numbers
            ax.xaxis.set_visible(False)
    return figure, axes


def legend(figure: Figure, axes: Sequence[Axes], columns: int = 4) -> None:
    """Put one legend above all axes: each name once, and only if something is drawn under it."""
    named: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            data = getattr(handle, "get_xdata", lambda: [0])()
            if len(data):
                named.setdefault(label, handle)
    figure.legend(
        list(named.values()),
        list(named),
        loc="upper right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        borderaxespad=0.2,
        columnspacing=1.4,
        handletextpad=0.5,
    )


def left_label(figure: Figure, axes: Sequence[Axes], text: str) -> None:
    """Write what all axes show along the left edge."""
    middle = 0.5 * (axes[0].get_position().y1 + axes[-1].get_position().y0)
    figure.text(0.012, middle, text, rotation=90, ha="center", va="center", fontsize=7.5)


def as_png(figure: Figure, *, many_colours: bool = False) -> bytes:
    """Draw a figure as a PNG.

    Parameters
    ----------
    figure : Figure
        The figure.
    many_colours : bool
        Whether it has areas in shades of colour. Lines and letters do with a palette: the same to
        the eye at a third of the size.

    Returns
    -------
    bytes
    """
    figure.set_dpi(PNG_DOTS_PER_INCH)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())[:, :, :3]  # type: ignore[no-untyped-call]
    image = Image.fromarray(np.ascontiguousarray(pixels))
    if not many_colours:
        image = image.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        # the palette averages nearby shades; paper stays white
        colours = image.getpalette() or []
        image.putpalette([255 if shade > 251 else shade for shade in colours])
    file = io.BytesIO()
    image.save(file, format="png", dpi=(PNG_DOTS_PER_INCH, PNG_DOTS_PER_INCH))
    return file.getvalue()


def light_grid(ax: Axes, axis: str = "y") -> None:
    """Put a grid behind the data that does not compete with it."""
    ax.grid(visible=True, axis=axis, color=LIGHT_GREY, linewidth=0.5)  # type: ignore[arg-type]
    ax.set_axisbelow(True)


def spread(places: list[float], least: float, low: float, high: float) -> list[float]:
    """Move labels apart so that neighbours keep a least distance, as little as a sweep needs.

    Parameters
    ----------
    places : list of float
        Wanted places, ascending.
    least : float
        Least distance; halved until all fit.
    low, high : float
        Range that they may use.

    Returns
    -------
    list of float

    Examples
    --------
    >>> spread([1.0, 1.1, 5.0], 0.5, 0.0, 5.0)
    [1.0, 1.5, 5.0]
    """
    if not places:
        return []
    least = min(least, (high - low) / max(1, len(places) - 1))
    moved: list[float] = []
    for place in places:
        moved.append(max(place, moved[-1] + least) if moved else max(place, low))
    moved[-1] = min(moved[-1], high)
    for index in range(len(moved) - 2, -1, -1):
        moved[index] = min(moved[index], moved[index + 1] - least)
    return moved
