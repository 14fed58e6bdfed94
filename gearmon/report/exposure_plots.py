"""Pictures of exposure: what is felt of a recording, a day and its limits, the gears in it."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gearmon.exposure.day import DayExposure, Dose
from gearmon.exposure.gearbox import GearShare
from gearmon.exposure.measures import Exposure
from gearmon.report import plots
from gearmon.report.curves import extremes
from gearmon.report.wording import shortened
from gearmon.signals.array_types import FloatArray

# Narrow, so that letters can still be read where a page shows it 400 pixels wide [inch].
_WIDTH_IN = 6.0
# What is drawn below the highest band: more decades tell nothing.
_DECADES = 3.0
# Letters of a job's name that fit above the whole day.
_LETTERS = 64


@plots.sheet_style()
def exposure_figure(exposure: Exposure) -> plots.Picture:
    """Draw third octaves as recorded and as felt, and the weighted rms through the recording.

    Parameters
    ----------
    exposure : Exposure

    Returns
    -------
    Picture
    """
    figure = plots.sheet(_WIDTH_IN, 5.6)
    bands, course = figure.subplots(2, 1, height_ratios=[3, 2])
    weighted, top = exposure.weighted_band_ms2, float(exposure.band_ms2.max(initial=1e-9))
    seconds: FloatArray = np.arange(float(exposure.running_ms2.shape[1])) + 0.5
    for number, axis in enumerate(exposure.axes):
        colour, k = plots.series_colour(number), f"{axis.factor:g} × " if axis.factor != 1 else ""
        recorded = exposure.band_ms2[number]
        label = f"{axis.axis}: {k}{axis.weighting}"
        bands.plot(exposure.band_hz, weighted[number], linewidth=2, color=colour, label=label)
        bands.plot(exposure.band_hz, recorded, linewidth=1, color=colour, linestyle=plots.DASHED)
        course.plot(*extremes(seconds, exposure.running_ms2[number]), color=colour, linewidth=0.9)
    bands.set(xscale="log", yscale="log", ylim=(top * 10**-_DECADES, top * 2))
    plots.plain_frequencies(bands)
    bands.set(xlabel="third octave in Hz", ylabel="rms in m/s²")
    bands.set_title("dashed: recorded, solid: felt", loc="left", fontsize=10)
    bands.legend(fontsize=9, frameon=False, loc="lower left")
    course.axhline(exposure.value_ms2, color=plots.BLACK, linewidth=1.2, linestyle=plots.DASHED)
    told = f"dashed: {exposure.value_ms2:.3g} m/s² ({exposure.value_axis}, {exposure.position})"
    course.set_title(told, loc="left", fontsize=10)
    course.set(xlabel="time in s", ylabel="felt each second\nin m/s²")
    course.set(ylim=(0, 1.1 * max(exposure.value_ms2, course.get_ylim()[1])))
    course.set_xlim(0, exposure.duration_s)
    for ax in (bands, course):
        plots.light_grid(ax)
    return figure


@plots.sheet_style()
def day_exposure_figure(day: DayExposure) -> plots.Picture:
    """Draw A(8), and the dose value where it is known, through the day against their limits.

    Parameters
    ----------
    day : DayExposure

    Returns
    -------
    Picture
    """
    figure = plots.sheet(_WIDTH_IN, 0.8 + 2.3 * len(day.doses))
    grid = figure.subplots(len(day.doses), 1, sharex=True, squeeze=False)
    for ax, dose in zip(grid[:, 0], day.doses, strict=True):
        _draw_dose(ax, day, dose)
    ends = np.concatenate([[0.0], np.cumsum([job.hours for job in day.jobs])])
    for job, start, end in zip(day.jobs, ends[:-1], ends[1:], strict=True):
        room = max(5, int(_LETTERS * (end - start) / day.hours))
        named = [shortened(line, room) for line in textwrap.wrap(job.name, room)[:2]]
        told = "\n".join([*named, f"{job.hours:g} h"])
        plots.above(grid[0, 0], 0.5 * (start + end), told)
    grid[-1, 0].set_xlabel("hours of work")
    return figure


def _draw_dose(ax: Axes, day: DayExposure, dose: Dose) -> None:
    """Draw one dose as it grows, its interval at the end, and its limits with their names."""
    ax.plot(day.course_h, day.course[dose.measure], color=plots.series_colour(0), linewidth=2)
    spread = [[dose.value - dose.low], [dose.high - dose.value]]
    how: dict[str, Any] = {"color": plots.series_colour(0), "capsize": 4, "clip_on": False}
    ax.errorbar([day.hours], [dose.value], yerr=spread, **how)
    highest = dose.high
    for told, value, colour in (
        ("action", dose.action, plots.GREY),
        ("limit", dose.limit, plots.VERMILLION),
    ):
        if value is None or value > 4 * dose.high:  # so far off that the curve would be flat
            continue
        highest = max(highest, value)
        reached = dose.reached_h[told]
        when = "" if reached is None else f", reached after {reached:.2g} h"
        ax.axhline(value, color=colour, linewidth=1.4, linestyle=plots.DASHED)
        where: dict[str, Any] = {"xytext": (3, 2), "textcoords": "offset points", "fontsize": 9}
        ax.annotate(f"{told} value {value:g}{when}", (0, value), **where)
    for end in np.cumsum([job.hours for job in day.jobs])[:-1]:
        ax.axvline(end, color=plots.LIGHT_GREY, linewidth=0.8)
    unit = dose.unit.replace("s2", "s²").replace("s^1.75", "s¹·⁷⁵")
    ax.set(ylabel=f"{dose.measure} in {unit}", xlim=(0, day.hours), ylim=(0, 1.15 * highest))
    plots.light_grid(ax)


@plots.sheet_style()
def gear_share_figure(found: GearShare) -> plots.Picture:
    """Draw which shafts and meshes make up what is felt, axis by axis.

    Parameters
    ----------
    found : GearShare

    Returns
    -------
    Picture
    """
    figure = plots.sheet(_WIDTH_IN, 1.6 + 0.45 * len(found.axes))
    ax = figure.add_subplot()
    place, done = np.arange(len(found.axes)), np.zeros(len(found.axes))
    parts = {own.name: 100 * np.array(own.share) for own in found.lines}
    for number, (name, share) in enumerate(parts.items()):
        ax.barh(place, share, 0.62, left=done, color=plots.series_colour(number), label=name)
        done = done + share
    if parts:
        rest = np.maximum(100 - done, 0)
        ax.barh(place, rest, 0.62, left=done, color=plots.LIGHT_GREY, label="anything else")
        ax.legend(fontsize=9, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1))
    ax.set_yticks(place, found.axes)
    ax.invert_yaxis()
    ax.set(xlim=(0, max(100.0, float(done.max(initial=0)))))
    ax.set_xlabel("share of the weighted mean square in %")
    return figure
