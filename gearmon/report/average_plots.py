"""One turn of a gear: its synchronous average, what is left of it, and how sure both are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from gearmon.files import write_atomically
from gearmon.report.palette import BLACK, LIGHT_GREY, SKY, VERMILLION
from gearmon.report.plots import as_png, left_label, legend, light_grid, new_figure, style
from gearmon.report.wording import shortened, strip_label, unit_text
from gearmon.signals.tsa import one_turn
from gearmon.signatures.gear_averages import GearAverage, GearAverages
from gearmon.signatures.gear_signals import gear_signals

FloatArray = NDArray[np.float64]

# More channels than this get no readable pair of strips each.
_MOST_CHANNELS = 4
# Values a tooth, at least.
_PER_TOOTH = 24
# Standard errors of the band: it holds 95 of 100 values of noise.
_BAND = 2.0


def save_average_pictures(found: GearAverages, path: Path) -> list[Path]:
    """Draw the average of every gear and write a picture of each.

    Parameters
    ----------
    found : GearAverages
    path : Path
        Name of a PNG; stage and gear are put into it.

    Returns
    -------
    list of Path
    """
    paths = []
    for own in found.gears:
        target = path.with_name(f"{path.stem}-{own.stage}-{own.gear}{path.suffix}")
        with style():
            png = as_png(average_figure(found, own))
        write_atomically(target, png)
        paths.append(target)
    return paths


def average_figure(found: GearAverages, own: GearAverage) -> Figure:
    """Draw two strips a channel: the average, and its residual and difference signals."""
    names = found.channel_names[:_MOST_CHANNELS]
    figure, axes = new_figure([0.85, 0.85] * len(names), top_in=0.52, sharex=True)
    drawn = _Drawn(own)
    for row, name in enumerate(names):
        whole, rest = axes[2 * row], axes[2 * row + 1]
        label = strip_label(name, unit_text(found.units[row]))
        drawn.whole(row, whole)
        drawn.rest(row, rest)
        for ax in (whole, rest):
            ax.set_ylabel(label, fontsize=7)
            ax.yaxis.set_major_locator(MaxNLocator(4))
            ax.set_xlim(0.0, own.teeth)
            light_grid(ax)
    axes[-1].set_xlabel(_axis(own))
    left_label(figure, axes, "Acceleration" if _accelerations(found) else "Signal")
    average = own.average
    figure.text(
        0.012,
        1 - 0.09 / figure.get_figheight(),
        f"{shortened(own.name, 40)}, {own.teeth} teeth: mean of {average.turns} of its turns, "
        f"order {average.rotation_order:.6g} of shaft 1",
        va="top",
        fontsize=8,
    )
    legend(figure, axes)
    # the legend goes below the line that says what is drawn
    figure.legends[0].set_bbox_to_anchor((1.0, 1 - 0.24 / figure.get_figheight()))
    return figure


def _accelerations(found: GearAverages) -> bool:
    return all(unit in ("m/s2", "m/s^2", "g") for unit in found.units)


def _axis(own: GearAverage) -> str:
    zero = (
        "0 at the tachometer pulse"
        if own.numbered
        else "0 anywhere: no once-a-turn pulse on this shaft"
    )
    return f"Angle of the {own.gear} (tooth pitches; {zero})"


def _closed(values: FloatArray) -> FloatArray:
    """Return a turn with its first value again at its end."""
    return np.append(values, values[0])


class _Drawn:
    """The signals of a turn with so many values a tooth that straight lines join them."""

    def __init__(self, own: GearAverage) -> None:
        average = own.average
        count = max(average.per_turn, _PER_TOOTH * own.teeth)
        self._angle = np.arange(count + 1.0) * own.teeth / count
        self._average = one_turn(average.lines, count)
        self._signals = own.signals
        if count > average.per_turn:
            self._signals = gear_signals(average.lines, own.signals.wheel, per_turn=count)
        known = np.arange(average.per_turn + 1.0) * own.teeth / average.per_turn
        self._error = _BAND * np.array(
            [np.interp(self._angle, known, _closed(error)) for error in average.waveform_error]
        )

    def whole(self, row: int, ax: Axes) -> None:
        value, error = _closed(self._average[row]), self._error[row]
        ax.fill_between(self._angle, value - error, value + error, color=LIGHT_GREY, linewidth=0)
        ax.plot(self._angle, value, color=BLACK, linewidth=0.6, label="synchronous average")

    def rest(self, row: int, ax: Axes) -> None:
        angle, error = self._angle, self._error[row]
        ax.fill_between(angle, -error, error, color=LIGHT_GREY, linewidth=0)
        # a mark for the legend: a filled area has no data that it could be told by
        ax.plot([0.0], [0.0], color=LIGHT_GREY, linewidth=4, label=f"± {_BAND:g} standard errors")
        residual, difference = self._signals.residual[row], self._signals.difference[row]
        # wider and lighter: where both are the same it still shows behind the difference
        ax.plot(angle, _closed(residual), color=SKY, linewidth=1.6, label="residual")
        ax.plot(angle, _closed(difference), color=VERMILLION, linewidth=0.6, label="difference")
