"""Pictures of a gear's turn and of the speed."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from gearmon.report.palette import BLACK, BLUE, GREY, LIGHT_GREY, SKY, VERMILLION
from gearmon.report.plots import light_grid
from gearmon.report.views import SpeedView, TeethView, TurnView
from gearmon.report.wording import strip_label

_MOST_TOOTH_LABELS = 34


def plot_turn(view: TurnView, ax: Axes) -> Axes:
    """Draw a synchronous average over one turn, whole and without the mesh harmonics.

    Parameters
    ----------
    view : TurnView
        One channel.
    ax : Axes
        Where to draw.

    Returns
    -------
    Axes
        `ax`.
    """
    _flagged(view.flagged, ax)
    ax.plot(view.tooth, view.average, color="#a9adb4", linewidth=0.6, label="synchronous average")
    ax.plot(
        view.tooth, view.rest, color=BLUE, linewidth=0.8, label="the same without mesh harmonics"
    )
    light_grid(ax)
    ax.set_ylabel(strip_label(view.channel, view.unit), fontsize=7)
    ax.margins(x=0)
    ax.yaxis.set_major_locator(MaxNLocator(4))
    return ax


def plot_teeth(view: TeethView, ax: Axes) -> Axes:
    """Draw the energy of the departure by tooth as bars, a flagged tooth marked.

    Parameters
    ----------
    view : TeethView
        The gear.
    ax : Axes
        Where to draw.

    Returns
    -------
    Axes
        `ax`.
    """
    teeth = len(view.energy)
    tooth = (round(view.place) - 1) % teeth + 1
    peak = int(np.argmin(np.abs(view.number - view.place)))
    colours = [SKY] * teeth
    if view.flagged:
        colours[peak] = VERMILLION
        _flagged(view.place, ax)
    ax.bar(view.number, view.energy, width=0.8, color=colours, edgecolor=BLACK, linewidth=0.3)
    ax.axhline(1.0, color=BLACK, linewidth=0.7, linestyle=(0, (4, 2)))
    word = "flagged" if view.flagged else "highest, not flagged"
    name = f"tooth {tooth}: " if view.numbered else ""
    left = view.place > 0.6 * teeth
    ax.annotate(
        f"{name}{view.ratio:.1f} × median ({word})",
        # above the bars beside it, which may be higher
        xy=(view.number[peak], float(view.energy.max())),
        xytext=(-6 if left else 6, 2),
        textcoords="offset points",
        ha="right" if left else "left",
        va="bottom",
        fontsize=7,
        fontweight="bold" if view.flagged else "normal",
    )
    ax.set_ylim(0, 1.25 * max(float(view.energy.max()), 1.6))
    light_grid(ax)
    ax.set_ylabel("Energy by tooth\n(median 1)", fontsize=7)
    return ax


def label_teeth(teeth: int, counted_from: str | None, ax: Axes) -> Axes:
    """Write the numbers of the teeth along the lowest axes.

    Parameters
    ----------
    teeth : int
        Teeth.
    counted_from : {"tacho", "reference"} or None
        Where tooth 1 is; None if only this recording knows.
    ax : Axes
        The lowest axes.

    Returns
    -------
    Axes
        `ax`.
    """
    step = 1 if teeth <= _MOST_TOOTH_LABELS else 5 if teeth <= 5 * _MOST_TOOTH_LABELS else 20
    ticks = list(range(1, teeth + 1)) if step == 1 else [1, *range(step, teeth + 1, step)]
    ax.set_xlim(0.5, teeth + 0.5)
    ax.set_xticks(ticks)
    words = {
        "tacho": "Tooth (tooth 1 at the tachometer pulse)",
        "reference": "Tooth (tooth 1 where the first healthy recording begins)",
    }
    relative = "Tooth, from the start of the recording (relative: no tachometer on this shaft)"
    ax.set_xlabel(words.get(counted_from or "", relative))
    return ax


def _flagged(place: float | None, ax: Axes) -> None:
    if place is not None:
        ax.axvspan(place - 1.0, place + 1.0, color=VERMILLION, alpha=0.15, linewidth=0)


def _rpm(speed_hz: Any) -> Any:
    return 60.0 * speed_hz


def _hz(speed_rpm: Any) -> Any:
    return speed_rpm / 60.0


def plot_speed(view: SpeedView, ax: Axes) -> Axes:
    """Draw the speed of shaft 1 over time.

    Parameters
    ----------
    view : SpeedView
        The speed.
    ax : Axes
        Where to draw.

    Returns
    -------
    Axes
        `ax`.
    """
    ax.axhline(
        view.nominal_hz,
        color=GREY,
        linewidth=0.9,
        linestyle=(0, (4, 2)),
        label=f"nominal {view.nominal_hz:.5g} Hz",
    )
    ax.axhline(view.mean_hz, color=BLACK, linewidth=0.7, label=f"mean {view.mean_hz:.6g} Hz")
    if np.isfinite(view.uncertainty_hz):
        ax.axhspan(
            view.mean_hz - view.uncertainty_hz,
            view.mean_hz + view.uncertainty_hz,
            color=LIGHT_GREY,
            linewidth=0,
        )
    ax.plot(view.time_s, view.speed_hz, color=BLUE, linewidth=1.0, label=f"speed, by {view.method}")
    low, high = (float(v) for v in (view.speed_hz.min(), view.speed_hz.max()))
    # a steady speed must not be blown up until its last digit looks like trouble
    room = max(0.15 * (high - low), 0.002 * view.mean_hz)
    ax.set_ylim(min(low, view.nominal_hz) - room, max(high, view.nominal_hz) + room)
    ax.set_xlim(float(view.time_s[0]), float(view.time_s[-1]))
    ax.set_xlabel("Time (s)")
    ax.set_ylabel("Shaft 1 (Hz)")
    ax.ticklabel_format(useOffset=False)
    right = ax.secondary_yaxis("right", functions=(_rpm, _hz))
    right.set_ylabel("Shaft 1 (rpm)")
    light_grid(ax)
    return ax
