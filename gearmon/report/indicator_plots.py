"""The picture of `gearmon indicators`: a panel an indicator, gears and channels side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gearmon.files import write_atomically
from gearmon.report.palette import GREY, series_colour, series_marker
from gearmon.report.plots import PAGE_WIDTH_IN, as_png, legend, light_grid, style
from gearmon.report.wording import shortened, unit_text
from gearmon.signatures.indicator_table import IndicatorTable

#: Values for Gaussian noise, drawn for comparison.
GAUSSIAN = {"kurtosis": 3.0, "FM4": 3.0, "NA4": 3.0, "NA4*": 3.0, "M6A": 15.0, "M8A": 105.0}
_COLUMNS = 4
_PANEL_IN = 1.05

_Series = dict[tuple[str, str], list[tuple[int, float]]]


def save_indicator_picture(tables: Sequence[IndicatorTable], path: Path) -> Path:
    """Draw the indicators of one or more recordings and write the picture.

    Parameters
    ----------
    tables : sequence of IndicatorTable
        In the order of the run.
    path : Path
        Name of the PNG.

    Returns
    -------
    Path
        `path`.
    """
    with style():
        png = as_png(indicator_figure(tables))
    write_atomically(path, png)
    return path


def indicator_figure(tables: Sequence[IndicatorTable]) -> Figure:
    """Draw a panel for every indicator and input.

    Of several recordings the values run along the horizontal axis; of one the gears stand side by
    side. Channels have markers, gears colours.
    """
    panels: dict[tuple[str, str], _Series] = {}
    units: dict[tuple[str, str], str | None] = {}
    places: list[str] = []
    channels: list[str] = []
    for number, table in enumerate(tables, start=1):
        for row in table.rows:
            where = f"{row.gear} {row.stage}" if row.gear else "raw"
            places += [where] if where not in places else []
            channels += [row.channel] if row.channel not in channels else []
            # the band of an envelope differs from gear to gear; its panel is one
            key = (row.indicator, row.input.split(",")[0])
            units.setdefault(key, row.unit)
            panels.setdefault(key, {}).setdefault((where, row.channel), []).append(
                (number, row.value)
            )
    lines = -(-len(panels) // _COLUMNS)
    height = 0.55 + lines * (_PANEL_IN + 0.55)
    figure = Figure(figsize=(PAGE_WIDTH_IN, height))
    FigureCanvasAgg(figure)
    axes = []
    for number, (key, series) in enumerate(panels.items()):
        ax = _place(figure, number, height)
        axes.append(ax)
        _panel(key, series, units[key], ax, places, channels, len(tables))
    legend(figure, axes, columns=5)
    if any(name in GAUSSIAN for name, _ in panels):
        top = 1 - 0.06 / height
        figure.text(0.012, top, "dashed:\nGaussian noise", va="top", fontsize=6.5, color=GREY)
    return figure


def _place(figure: Figure, number: int, height: float) -> Axes:
    row, column = divmod(number, _COLUMNS)
    cell = PAGE_WIDTH_IN / _COLUMNS
    left, bottom = column * cell + 0.45, height - 0.75 - (row + 1) * _PANEL_IN - row * 0.55
    return figure.add_axes(
        (left / PAGE_WIDTH_IN, bottom / height, (cell - 0.55) / PAGE_WIDTH_IN, _PANEL_IN / height)
    )


def _panel(
    key: tuple[str, str],
    series: _Series,
    unit: str | None,
    ax: Axes,
    places: list[str],
    channels: list[str],
    records: int,
) -> None:
    name, of = key
    own = [where for where in places if any(where == place for place, _ in series)]
    for (where, channel), points in series.items():
        x = [n if records > 1 else own.index(where) for n, _ in points]
        ax.plot(
            x,
            [value for _, value in points],
            color=series_colour(places.index(where)),
            marker=series_marker(channels.index(channel)),
            markersize=3.2,
            linewidth=0.8 if records > 1 else 0.0,
            markerfacecolor="none",
            label=f"{where}, {shortened(channel, 12)}",
        )
    if name in GAUSSIAN:
        ax.axhline(GAUSSIAN[name], color=GREY, linewidth=0.7, linestyle=(0, (4, 2)))
    stated = "" if unit == "1" else f" ({unit_text(unit)})"
    ax.set_title(f"{name}{stated}\nof {of}", fontsize=6.5, pad=3)
    if records > 1:
        ax.set_xlim(0.7, records + 0.3)
        ax.set_xticks(sorted({1, (records + 1) // 2, records}))
        ax.set_xlabel("record", fontsize=6.5, labelpad=1)
    else:
        ax.set_xlim(-0.6, max(len(own) - 0.4, 0.6))
        ax.set_xticks(range(len(own)), own, fontsize=5.5, rotation=20)
    low, high = ax.get_ylim()
    ax.set_ylim(min(0.0, low), 1.06 * high if high > 0 else 1.0)
    ax.tick_params(labelsize=6)
    light_grid(ax)
