"""Figures: size, lettering, colours and files.

The modules `*plots` are the only users of matplotlib. A function `..._figure` takes a result and
returns a `Picture`: a matplotlib figure that keeps its style wherever it is drawn, and carries its
words where a report needs them.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import ticker
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray
from PIL import Image

from gearmon.files import replacing, write_atomically
from gearmon.report.wording import VERDICT_STYLE, power_of_ten, template

_Floats = Sequence[float] | NDArray[np.float64]

# Colours that stay apart for colour-blind readers and in grey print: Okabe and Ito, Color Universal
# Design, 2008.
BLACK = "#1a1a1a"
GREY = "#8a8f98"
LIGHT_GREY = "#d5d8dd"
BLUE = "#0072B2"
SKY = "#56B4E9"
GREEN = "#009E73"
ORANGE = "#E69F00"
VERMILLION = "#D55E00"
PURPLE = "#B0508A"

# In the order in which stages, gears or channels take them.
SERIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")

#: Dashes of limits, nominal values and marks of lines.
DASHED = (0, (4, 2))

# Width of the text on an A4 page with 15 mm margins [inch].
PAGE_WIDTH_IN = 7.1
PNG_DOTS_PER_INCH, SHEET_DOTS_PER_INCH = 150, 130
# Every verdict has a shape as well as a colour.
VERDICT_MARKERS = {"healthy": "o", "cannot tell": "^", "fault": "s", "no mesh found": "x"}

# Names of machines, channels and files may hold a dollar sign: it starts no formula.
_PLAIN: dict[str, Any] = {"text.parse_math": False}
# Letters of 7 to 8 points on a picture that fills the width of an A4 page.
_STYLE: dict[str, Any] = {
    **_PLAIN,
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


#: Draws in gearmon's style inside a block or function, and leaves the caller's own style alone.
style = partial(matplotlib.rc_context, _STYLE)  # type: ignore[arg-type,unused-ignore]
#: Draws in the caller's own style, names as they are.
sheet_style = partial(matplotlib.rc_context, _PLAIN)  # type: ignore[arg-type,unused-ignore]


class Picture(Figure):
    """A figure that is drawn in the style that it was made in, with its words.

    Not known to pyplot: it goes when its last user does.

    Parameters
    ----------
    size_in : tuple of float
        Width and height [inch].
    dpi : float
        Dots of a PNG [per inch].

    Attributes
    ----------
    name, heading, caption, alt : str
        Part of a file name; heading; what to look for; and what is to be seen, for readers who do
        not see it. Empty but in reports.
    """

    def __init__(self, size_in: tuple[float, float], dpi: float = PNG_DOTS_PER_INCH) -> None:
        super().__init__(figsize=size_in, dpi=dpi, layout="constrained")
        FigureCanvasAgg(self)
        self.name = self.heading = self.caption = self.alt = ""
        # marks on an axis are made when it is drawn, in the style of that moment
        settings: Any = matplotlib.rcParams
        self._style: Any = {name: settings[name] for name in _STYLE}

    def told(self, name: str, **facts: Any) -> Picture:
        """Give the figure its name and words, and return it.

        Parameters
        ----------
        name : str
            See the attributes; its first part chooses the words of captions.txt.
        **facts : Any
            What these tell.
        """
        words = template("captions.txt").render(name=name, **facts)
        self.name = name
        self.heading, self.caption, self.alt = (
            " ".join(part.split()) for part in words.split("\n--\n")
        )
        return self

    def draw(self, renderer: Any) -> None:
        """Draw in the figure's own style."""
        for ax in self.axes:
            for axis in (ax.xaxis, ax.yaxis):
                if isinstance(axis.get_major_formatter(), ticker.LogFormatterMathtext):
                    axis.set_major_formatter(_PowersOfTen())
                if isinstance(axis.get_minor_formatter(), ticker.LogFormatterMathtext):
                    axis.set_minor_formatter(_PowersOfTen())
        with matplotlib.rc_context(self._style):
            super().draw(renderer)


class _PowersOfTen(ticker.LogFormatterSciNotation):
    """Powers of ten without formulas: 10⁻³, 2×10⁻³."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        text = super().__call__(x, pos).replace(r"\times", "×")
        text = re.sub(r"10\^\{(-?\d+)\}", lambda found: power_of_ten(int(found[1])), text)
        return re.sub(r"\$\\mathdefault\{(.*)\}\$", r"\1", text)


def series_colour(index: int) -> str:
    """Return the colour of the item with this index, from 0; colours repeat after eight."""
    return SERIES[index % len(SERIES)]


def series_marker(index: int) -> str:
    """Return the marker of the item with this index, from 0; markers repeat after eight."""
    return MARKERS[index % len(MARKERS)]


def sheet(width_in: float, height_in: float) -> Picture:
    """Return an empty figure that is no page of a report."""
    return Picture((width_in, height_in), SHEET_DOTS_PER_INCH)


def stack(
    heights_in: Sequence[float], *, room_in: float = 0.68, sharex: bool = False
) -> tuple[Picture, list[Axes]]:
    """Return a figure as wide as a page, with axes one above the other.

    Parameters
    ----------
    heights_in : sequence of float
        Height of each axes [inch], from the top.
    room_in : float
        For letters above and below all axes [inch].
    sharex : bool
        Whether all have one horizontal scale, numbered at the lowest only.
    """
    height = sum(heights_in) + room_in + 0.12 * (len(heights_in) - 1)
    figure = Picture((PAGE_WIDTH_IN, height))
    grid = figure.subplots(
        len(heights_in), 1, sharex=sharex, squeeze=False, height_ratios=heights_in
    )
    axes: list[Axes] = grid[:, 0].tolist()
    for ax in axes[:-1] if sharex else ():
        # ticks take most of the time of drawing, and these would carry no numbers
        ax.xaxis.set_visible(False)
    return figure, axes


def named_handles(axes: Sequence[Axes]) -> dict[str, Artist]:
    """Return what has a name on any of the axes: each name once, and only if it has data."""
    named: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            if len(getattr(handle, "get_xdata", lambda: [0])()):
                named.setdefault(label, handle)
    return named


def legend(
    figure: Figure, axes: Sequence[Axes], columns: int = 4, where: str = "upper right"
) -> None:
    """Put one legend outside all axes."""
    named = named_handles(axes)
    how: dict[str, Any] = {"loc": f"outside {where}", "ncols": columns, "frameon": False}
    figure.legend([*named.values()], [*named], columnspacing=1.4, handletextpad=0.5, **how)


def above(ax: Axes, x: float, text: str, up: float = 3, **how: Any) -> None:
    """Write a text above axes, at a place of their horizontal axis."""
    how = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"} | how
    ax.annotate(text, xy=(x, 1.0), xytext=(0, up), textcoords="offset points", **how)


def light_grid(ax: Axes, axis: str = "y") -> None:
    """Put a grid behind the data that does not compete with it."""
    ax.grid(visible=True, axis=axis, color=LIGHT_GREY, linewidth=0.5)  # type: ignore[arg-type]
    ax.set_axisbelow(True)


def plain_frequencies(ax: Axes) -> None:
    """Write frequencies of a logarithmic axis out: 200, not 2 x 10^2."""
    ax.xaxis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(ticker.NullFormatter())


def heat_map(ax: Axes, values: Any, colours: str, empty: str, **how: Any) -> AxesImage:
    """Draw values as colours; what is no number has a colour of its own."""
    known = matplotlib.colormaps[colours].with_extremes(bad=empty)
    shown = np.ma.masked_invalid(values)
    return ax.imshow(shown, cmap=known, aspect="auto", interpolation="nearest", **how)


def plot_marks(
    ax: Axes, x: Any, y: Any, marker: str | int, size: float, colour: str, **how: Any
) -> None:
    """Draw single values, with no line between them."""
    ax.plot(x, y, linestyle="none", marker=marker, markersize=size, color=colour, **how)


def plot_verdicts(
    x: _Floats, scores: _Floats, verdicts: Sequence[str], ax: Axes, size: float
) -> None:
    """Draw scores, each with the colour and the shape of its verdict."""
    for verdict, marker in VERDICT_MARKERS.items():
        own, colour = np.array(verdicts) == verdict, VERDICT_STYLE[verdict][0]
        edge = {"markeredgecolor": BLACK, "markeredgewidth": 0.4, "label": verdict}
        plot_marks(ax, np.asarray(x)[own], np.asarray(scores)[own], marker, size, colour, **edge)


def as_png(figure: Figure) -> bytes:
    """Draw a figure as a PNG."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())[:, :, :3]  # type: ignore[no-untyped-call]
    image = Image.fromarray(np.ascontiguousarray(pixels))
    areas = (own for ax in figure.axes for own in (*ax.images, *ax.collections))
    if isinstance(figure, Picture) and all(own.get_array() is None for own in areas):
        # without areas in shades of colour a palette does: the same to the eye at a third the size
        image = image.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        # the palette averages nearby shades; paper stays white
        colours = image.getpalette() or []
        image.putpalette([255 if shade > 251 else shade for shade in colours])
    file = io.BytesIO()
    image.save(file, format="png", dpi=(figure.dpi, figure.dpi))
    return file.getvalue()


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure in one step, in the format of the suffix; return the path.

    Parameters
    ----------
    figure : Figure
        What to write.
    path : str or Path
        Its suffix tells the format, as .png, .svg or .pdf.

    Returns
    -------
    Path
        What was written.
    """
    target = Path(path)
    if target.suffix.lower() == ".png":
        write_atomically(target, as_png(figure))
        return target
    with replacing(target) as temporary:
        figure.savefig(temporary)
    return target


def save_all(figures: Mapping[str, Figure], path: str | Path) -> list[Path]:
    """Write several figures beside each other, each with its name put before the suffix.

    Parameters
    ----------
    figures : mapping of str to Figure
        By what is added to the name: "-energy" for ``harvest-energy.png``; "" for nothing.
    path : str or Path
        The name that is added to.

    Returns
    -------
    list of Path
        What was written.
    """
    target = Path(path)
    return [
        save(figure, target.with_name(f"{target.stem}{added}{target.suffix}"))
        for added, figure in figures.items()
    ]


def spread(places: list[float], least: float, low: float, high: float) -> list[float]:
    """Move labels apart so that neighbours keep a least distance, as little as a sweep needs.

    Parameters
    ----------
    places : list of float
        Wanted places, ascending.
    least : float
        Least distance; smaller where not all would fit.
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
    steps = np.arange(len(places)) * min(least, (high - low) / max(1, len(places) - 1))
    # less these steps, labels that keep their distance ascend; the last one must have room
    ascending = np.maximum.accumulate(np.maximum(np.array(places) - steps, low))
    moved: list[float] = (np.minimum(ascending, high - steps[-1]) + steps).tolist()
    return moved
