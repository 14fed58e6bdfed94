"""Pictures of what is in a recording: order map, one turn of each gear, condition indicators."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator

from gearmon.arrays import FloatArray
from gearmon.report import plots
from gearmon.report.spectrum_plots import MOST_STRIPS, label_marks, line_marks, order_axis
from gearmon.report.wording import shortened, strip_label, unit_text
from gearmon.signals.orders.resampling import one_turn
from gearmon.signatures.gear_averages import GearAverage, GearAverages
from gearmon.signatures.measured.indicators import IndicatorTable, gear_signals
from gearmon.signatures.recording_spectrum import OrderSpectra

# Columns of a map: more than a page shows.
_COLUMNS = 900
# What lies further below the highest value of a channel is all one colour at any rate.
_DECADES = 4.0
# Width of the speed along time, beside a map, as a share of that of the map.
_SPEED_WIDTH = 0.1
# More channels than this get no readable pair of strips each in the picture of a turn.
_MOST_PAIRS = 4
# Values a tooth, at least.
_PER_TOOTH = 24
# Standard errors of the band: it holds 95 of 100 values of noise.
_BAND = 2.0
# Values of indicators for Gaussian noise, drawn for comparison.
_GAUSSIAN = {"kurtosis": 3.0, "FM4": 3.0, "NA4": 3.0, "NA4*": 3.0, "M6A": 15.0, "M8A": 105.0}
_PANELS, _PANEL_IN = 4, 1.6


@plots.style()
def order_map_figure(found: OrderSpectra) -> plots.Picture:
    """Draw a map a channel: amplitude in colour over order and time, or order and speed.

    Parameters
    ----------
    found : OrderSpectra
        Along time the speed of the shaft is drawn beside each map.

    Returns
    -------
    Picture
    """
    names = found.channel_names[:MOST_STRIPS]
    over_time = found.map.against == "time"
    height = 1.2 + len(names) * (2.4 if len(names) < 3 else 1.5)
    figure = plots.Picture((plots.PAGE_WIDTH_IN, height))
    widths = (1.0, _SPEED_WIDTH)[: 1 + over_time]
    grid = figure.subplots(
        len(names), len(widths), squeeze=False, sharex="col", sharey="row", width_ratios=widths
    )
    for row, (name, axes) in enumerate(zip(names, grid, strict=True)):
        image = _plot_order_map(found, row, axes[0])
        label = f"{shortened(name)}\npeak amplitude ({unit_text(found.units[row])})"
        scale = figure.colorbar(image, ax=axes, extend="min", pad=0.02, aspect=25)
        scale.set_label(label, fontsize=6.5)
        if over_time:
            _plot_speed(found, axes[1])
    label_marks(line_marks(found.marks, *_ends(found)), grid[0, 0])
    grid[-1, 0].set_xlabel(order_axis(found))
    if over_time:
        grid[-1, 1].set_xlabel(f"Shaft {found.shaft} (Hz)", fontsize=6.5)
    what = "Time (s)" if over_time else f"Speed of shaft {found.shaft} (Hz)"
    figure.supylabel(what, fontsize=7.5)
    if not over_time and np.ma.is_masked(grid[0, 0].images[0].get_array()):
        figure.text(0.995, 0.004, "grey: speeds that were not recorded", ha="right", fontsize=6)
    return figure


def _ends(found: OrderSpectra) -> tuple[float, float]:
    # the mean and what leaks from it are no lines
    order = found.map.order
    return float(order[min(2, len(order) - 1)]), float(order[-1])


def _plot_order_map(found: OrderSpectra, row: int, ax: Axes) -> AxesImage:
    """Draw the largest value in each of some columns, in a logarithmic scale of colours."""
    own, values = found.map, found.map.amplitude[:, row, 2:]
    low, high = float(own.low[0]), float(own.high[-1])
    if own.against != "time":
        # on an even scale of speeds, NaN where there is none
        step = float(own.high[0] - own.low[0])
        even = np.full((max(1, round((high - low) / step)), values.shape[1]), np.nan)
        even[np.rint((own.low - low) / step).astype(int)] = values
        values = even
    columns = min(_COLUMNS, values.shape[1])
    edges = np.linspace(0, values.shape[1], columns + 1).astype(int)[:-1]
    held = np.maximum.reduceat(values, edges, axis=1)
    top = max(float(np.nanmax(held)), np.finfo(float).tiny)
    # colours are spent on what stands above the quietest twentieth, within four decades
    low_end = max(min(float(np.nanpercentile(held, 5)), 0.1 * top), top * 10**-_DECADES)
    scale: dict[str, Any] = {"norm": LogNorm(vmin=low_end, vmax=top), "origin": "lower"}
    scale["extent"] = (*_ends(found), low, high)
    shown = np.maximum(held, low_end)
    image = plots.heat_map(ax, shown, "viridis", plots.LIGHT_GREY, **scale)
    ax.yaxis.set_major_locator(MaxNLocator(5))
    return image


def _plot_speed(found: OrderSpectra, ax: Axes) -> None:
    """Draw the speed along time, beside a map."""
    own = found.map
    ax.plot(own.speed_hz, own.time_s, color=plots.BLUE, linewidth=1.0)
    low, high = float(own.speed_hz.min()), float(own.speed_hz.max())
    # a steady speed must not be blown up until its last digit looks like trouble
    room = max(0.15 * (high - low), 0.005 * high)
    ax.set_xlim(low - room, high + room)
    ax.xaxis.set_major_locator(MaxNLocator(2))
    ax.tick_params(labelsize=6)
    ax.ticklabel_format(useOffset=False, axis="x")
    plots.light_grid(ax, "both")


def average_figures(found: GearAverages) -> dict[str, plots.Picture]:
    """Draw one turn of every gear; keys such as "-1-pinion" tell stage and gear.

    Parameters
    ----------
    found : GearAverages

    Returns
    -------
    dict of str to Picture
        By what is added to the name of a file.
    """
    return {
        f"-{own.wheel.stage}-{own.wheel.gear}": average_figure(found, own) for own in found.gears
    }


@plots.style()
def average_figure(found: GearAverages, own: GearAverage) -> plots.Picture:
    """Draw two strips a channel: the synchronous average, and what is left of it.

    Parameters
    ----------
    found : GearAverages
    own : GearAverage
        Of one of its gears.
    """
    average, wheel = own.average, own.wheel
    names = found.channel_names[:_MOST_PAIRS]
    # so many values a tooth that straight lines join them
    count = max(average.per_turn, _PER_TOOTH * wheel.teeth)
    angle = np.arange(count + 1.0) * wheel.teeth / count
    known = np.arange(average.per_turn + 1.0) * wheel.teeth / average.per_turn
    whole = one_turn(average.lines, count)
    signals = gear_signals(average.lines, wheel, per_turn=count)
    figure, axes = plots.stack([0.85, 0.85] * len(names), room_in=1.0, sharex=True)
    for row, name in enumerate(names):
        error = _BAND * np.interp(angle, known, _closed(average.waveform_error[row]))
        turn, residual = _closed(whole[row]), _closed(signals.residual[row])
        upper, lower = axes[2 * row], axes[2 * row + 1]
        _band(angle, turn, error, upper)
        upper.plot(angle, turn, color=plots.BLACK, linewidth=0.6, label="synchronous average")
        _band(angle, 0.0 * turn, error, lower)
        # a mark for the legend: a filled area has no data that it could be told by
        label = f"± {_BAND:g} standard errors"
        lower.plot([0.0], [0.0], color=plots.LIGHT_GREY, linewidth=4, label=label)
        # wider and lighter: where both are the same it still shows behind the difference
        lower.plot(angle, residual, color=plots.SKY, linewidth=1.6, label="residual")
        difference = _closed(signals.difference[row])
        lower.plot(angle, difference, color=plots.VERMILLION, linewidth=0.6, label="difference")
        for ax in (upper, lower):
            ax.set_ylabel(strip_label(name, unit_text(found.units[row])), fontsize=7)
            ax.yaxis.set_major_locator(MaxNLocator(4))
            ax.set_xlim(0.0, wheel.teeth)
            plots.light_grid(ax)
    zero = "at the tachometer pulse" if own.numbered else "anywhere: no pulse once a turn"
    axes[-1].set_xlabel(f"Angle of the {wheel.gear} (tooth pitches; 0 {zero})")
    accelerations = all(unit in ("m/s2", "m/s^2", "g") for unit in found.units)
    figure.supylabel("Acceleration" if accelerations else "Signal", fontsize=7.5)
    title = (
        f"{wheel.gear} of stage {wheel.stage}, {wheel.teeth} teeth: mean of {average.turns} of "
        f"its turns, order {average.rotation_order:.6g} of shaft 1"
    )
    axes[0].set_title(title)
    plots.legend(figure, axes)
    return figure


def _band(angle: FloatArray, value: FloatArray, error: FloatArray, ax: Axes) -> None:
    ax.fill_between(angle, value - error, value + error, color=plots.LIGHT_GREY, linewidth=0)


def _closed(values: FloatArray) -> FloatArray:
    """Return a turn with its first value again at its end."""
    return np.append(values, values[0])


@plots.style()
def indicator_figure(tables: IndicatorTable | Sequence[IndicatorTable]) -> plots.Picture:
    """Draw a panel for every condition indicator and input.

    Of several recordings the values run along the horizontal axis; of one the gears stand side by
    side. Channels have markers, gears colours.

    Parameters
    ----------
    tables : IndicatorTable, or sequence of them
        In the order of the run.

    Returns
    -------
    Picture
    """
    tables = [tables] if isinstance(tables, IndicatorTable) else tables
    every = pd.DataFrame(
        vars(row)
        # the band of an envelope differs from gear to gear; its panel is one
        | {"record": number, "of": row.input.split(",")[0]}
        | {"who": f"{row.gear} {row.stage}" if row.gear else "raw"}
        for number, table in enumerate(tables, start=1)
        for row in table.rows
    )
    gears, channels = every["who"].unique().tolist(), every["channel"].unique().tolist()
    panels = every.groupby(["indicator", "of"], sort=False)
    rows = -(-len(panels) // _PANELS)
    figure = plots.Picture((plots.PAGE_WIDTH_IN, 0.55 + rows * _PANEL_IN))
    for number, ((name, of), panel) in enumerate(panels, start=1):
        ax = figure.add_subplot(rows, _PANELS, number)
        shown = [gear for gear in gears if gear in set(panel["who"])]
        for (gear, channel), own in panel.groupby(["who", "channel"], sort=False):
            ax.plot(
                own["record"] if len(tables) > 1 else [shown.index(gear)] * len(own),
                own["value"],
                color=plots.series_colour(gears.index(gear)),
                marker=plots.series_marker(channels.index(channel)),
                markersize=3.2,
                linewidth=0.8 if len(tables) > 1 else 0.0,
                markerfacecolor="none",
                label=f"{gear}, {shortened(str(channel), 12)}",
            )
        # a unit that is not stated is no text in a frame
        unit = next(iter(panel["unit"].dropna()), None)
        stated = "" if unit == "1" else f" ({unit_text(unit)})"
        ax.set_title(f"{name}{stated}\nof {of}", fontsize=6.5, pad=3)
        _finish_panel(ax, _GAUSSIAN.get(str(name)), shown, len(tables))
    plots.legend(figure, figure.axes, columns=5)
    if not _GAUSSIAN.keys().isdisjoint(every["indicator"]):
        note = {"x": 0.01, "ha": "left", "fontsize": 6.5, "color": plots.GREY}
        figure.supxlabel("dashed: Gaussian noise", **note)
    return figure


def _finish_panel(ax: Axes, gaussian: float | None, gears: Sequence[str], records: int) -> None:
    if gaussian is not None:
        ax.axhline(gaussian, color=plots.GREY, linewidth=0.7, linestyle=plots.DASHED)
    if records > 1:
        ax.set_xlim(0.7, records + 0.3)
        ax.set_xticks(sorted({1, (records + 1) // 2, records}))
        ax.set_xlabel("record", fontsize=6.5, labelpad=1)
    else:
        ax.set_xlim(-0.6, max(len(gears) - 0.4, 0.6))
        ax.set_xticks(range(len(gears)), gears, fontsize=5.5, rotation=20)
    low, high = ax.get_ylim()
    ax.set_ylim(min(0.0, low), 1.06 * high if high > 0 else 1.0)
    ax.tick_params(labelsize=6)
    plots.light_grid(ax)
