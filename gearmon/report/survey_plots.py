"""Pictures of a harvester survey, and of vibration that people feel: recordings, days, gears."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gearmon.arrays import FloatArray
from gearmon.exposure.day import DayExposure, Dose
from gearmon.exposure.gearbox import GearShare
from gearmon.exposure.measures import Exposure
from gearmon.harvesting.placement import Placed, Survey
from gearmon.harvesting.tuning import power_against_tuning
from gearmon.harvesting.vibration import Vibration, operating_lines
from gearmon.report import plots
from gearmon.report.survey_text import spoken_time
from gearmon.report.wording import shortened

_MICRO = 1e6
_SIZE_IN = (8.0, 4.6)
#: Lines that a picture shows of each operating point: more would be a black band.
_MOST_LINES_DRAWN = 400
_LONGEST_LABEL = 44
#: Columns of the response, what they are called and what they are multiplied by.
_RESPONSES = (
    ("power_w", "mean power in µW", 1e6),
    ("voltage_v", "voltage amplitude in V", 1.0),
    ("travel_m", "tip amplitude in µm", 1e6),
    ("stress_pa", "peak stress in MPa", 1e-6),
)
#: Relative step of a measured curve: 1 % of frequency.
_CURVE_STEP = 0.01


def harvest_figures(survey: Survey) -> dict[str, plots.Picture]:
    """Draw the four pictures of a survey: "-energy", "-tuning", "-positions" and "-response".

    Parameters
    ----------
    survey : Survey

    Returns
    -------
    dict of str to Picture
        By what is added to the name of a file.
    """
    return {
        "-energy": energy_figure(survey),
        "-tuning": tuning_figure(survey),
        "-positions": positions_figure(survey),
        "-response": response_figure(survey),
    }


@plots.sheet_style()
def response_figure(survey: Survey) -> plots.Picture:
    """Draw power, voltage, tip displacement and peak stress at 1 m/s2 against frequency.

    Parameters
    ----------
    survey : Survey
        Of what is not modelled no panel is drawn.
    """
    figure, rows = plots.sheet(*_SIZE_IN), survey.response()
    panels = [
        (name, label, factor) for name, label, factor in _RESPONSES if rows[0][name] is not None
    ]
    frequency = np.array([row["frequency_hz"] for row in rows])
    grid = figure.subplots(-(-len(panels) // 2), 2, squeeze=False, sharex=True)
    for number, (ax, (name, label, factor)) in enumerate(zip(grid.flat, panels, strict=True)):
        values = factor * np.array([row[name] for row in rows])
        ax.plot(frequency, values, color=plots.series_colour(number), linewidth=1.2)
        ax.set(xscale="log", yscale="log", xlim=(frequency[0], frequency[-1]), ylabel=label)
        ax.set_ylim(bottom=max(values.min() / 2, values.max() * 1e-6))
        ax.grid(alpha=0.25)
        plots.plain_frequencies(ax)
    for ax in grid[-1]:
        ax.set_xlabel("frequency in Hz")
    best = survey.tuned.harvester
    tuned = f"tuned to {best.natural_frequency_hz:.4g} Hz"
    # a beam answers most between short and open circuit
    raised = getattr(best, "open_circuit_hz", None)
    tuned += f" in short circuit ({raised:.4g} Hz open)" if raised else ""
    figure.suptitle(f"Best harvester, {tuned}, shaken with 1 m/s²", fontsize=11)
    return figure


@plots.sheet_style()
def energy_figure(survey: Survey) -> plots.Picture:
    """Draw the energy of the lines at the best position, and the harvester's response over them.

    Parameters
    ----------
    survey : Survey
    """
    best = survey.best
    figure, ax = _sheet(
        f"{_short(best.position.name)}: energy of the lines and what is tuned to them",
        xlabel="frequency in Hz",
        ylabel="energy of a line in J/kg, (2πfA)²/2",
    )
    # frequencies worth showing: the lines, and the harvester if it is elsewhere
    ends = [] if best.tuned is None else list(best.tuned.harvester.frequency_range_hz)
    for vibration in (point.vibration for point in best.position.healthy):
        energy = vibration.energy_j_per_kg
        loud = vibration.frequency_hz[energy > energy.max() * 1e-5]
        # the lines with most of the energy are shown wherever they lie; drift of a sensor is not
        ends += [row["frequency_hz"] for row in operating_lines(vibration, 3)]
        ends += [float(loud.max())] + ([] if vibration.resolution_hz else [float(loud.min())])
    low, high, top = min(ends) / 1.5, max(ends) * 1.5, 0.0
    for number, point in enumerate(best.position.healthy):
        label = f"{_short(point.vibration.name)} ({100 * point.share:.0f} % of the time)"
        _draw_energy(ax, point.vibration, plots.series_colour(number), label)
        hertz = point.vibration.frequency_hz
        shown = point.vibration.energy_j_per_kg[(hertz >= low) & (hertz <= high)]
        top = max(top, float(shown.max(initial=0.0)))
    ax.set(xscale="log", yscale="log", xlim=(low, high), ylim=(top * 1e-6, top * 30))
    plots.plain_frequencies(ax)
    grid = np.geomspace(low, high, 4000)
    gain = survey.tuned.harvester.gains(grid).power_w * _MICRO
    beside = ax.twinx()
    beside.plot(grid, gain, color=plots.BLACK, linewidth=1.0, linestyle="--")
    beside.set(yscale="log", ylim=(gain.max() * 1e-6, gain.max() * 30))
    beside.set_ylabel("harvester: µW per (m/s²)² (dashed)")
    ax.legend(fontsize=9, loc="upper left")
    return figure


@plots.sheet_style()
def tuning_figure(survey: Survey) -> plots.Picture:
    """Draw mean power against natural frequency for the best positions, with the load found.

    Parameters
    ----------
    survey : Survey
    """
    figure, ax = _sheet(
        "Power against tuning, load as chosen at the best",
        xlabel="natural frequency the harvester is tuned to, in Hz",
        ylabel="mean power over the duty cycle in µW",
    )
    for number, place in enumerate(survey.placed[:3]):
        if place.tuned is None:
            continue
        harvester = place.tuned.harvester
        low, high = harvester.frequency_range_hz
        middle = harvester.natural_frequency_hz
        near = middle * (1 + harvester.damping_ratio * np.linspace(-8, 8, 81))
        grid = np.unique(np.concatenate([np.geomspace(low, high, 240), near]))
        grid = grid[(grid >= low) & (grid <= high)]
        power = power_against_tuning(harvester, place.position.healthy, grid) * _MICRO
        colour = plots.series_colour(number)
        label = f"{_short(place.position.name)}: best at {middle:.4g} Hz"
        ax.plot(grid, power, color=colour, linewidth=1.2, label=label)
        ax.plot(middle, place.tuned.power_w * _MICRO, "o", color=colour, markersize=5)
    ax.set(xscale="log", yscale="log")
    bottom, top = ax.get_ylim()
    ax.set_ylim(max(bottom, top * 1e-7), top * 8)
    plots.plain_frequencies(ax)
    ax.legend(fontsize=9, loc="upper left")
    return figure


def _sheet(title: str, **labels: Any) -> tuple[plots.Picture, Axes]:
    figure = plots.sheet(*_SIZE_IN)
    ax = figure.add_subplot(title=title, **labels)
    return figure, ax


@plots.sheet_style()
def positions_figure(survey: Survey) -> plots.Picture:
    """Draw the mean power at every position, sound and damaged, with its uncertainty.

    Parameters
    ----------
    survey : Survey
    """
    figure, ax = _sheet("Where to put it", xlabel="mean power over the duty cycle in µW")
    names = [_short(place.position.name) for place in survey.placed]
    rows = np.arange(len(names))
    watts = ("power_w", "power_low_w", "power_high_w", "degraded_power_w")
    power, low, high, degraded = (
        _MICRO * np.array([getattr(place, name) for place in survey.placed]) for name in watts
    )
    ax.barh(rows, power, height=0.5, color=plots.BLUE, alpha=0.85, label="gears sound")
    if np.isfinite(low).any():
        how: dict[str, Any] = {"fmt": "none", "ecolor": plots.BLACK, "capsize": 4}
        middle, reach = (low + high) / 2, (high - low) / 2
        ax.errorbar(middle, rows, xerr=reach, label="90 % interval", **how)
    if np.isfinite(degraded).any():
        label = "same tuning, gear damaged"
        plots.plot_marks(ax, degraded, rows - 0.16, "D", 6, plots.VERMILLION, label=label)
    where: dict[str, Any] = {"xytext": (4, 0), "textcoords": "offset points", "va": "center"}
    for row, place in zip(rows, survey.placed, strict=True):
        colour = plots.GREY if place.tuned is None else plots.BLACK
        ax.annotate(_remark(place), (0, row + 0.37), fontsize=9, color=colour, **where)
    ax.set_yticks(rows, names)
    ax.set_ylim(len(names) - 0.35, -0.6)
    ax.set_xlim(left=0)
    ax.legend(fontsize=9, loc="best")
    return figure


def _draw_energy(ax: Axes, vibration: Vibration, colour: str, label: str) -> None:
    """Lines as lines; a spectrum of bins as the curve of its peaks."""
    frequency, energy = vibration.frequency_hz, vibration.energy_j_per_kg
    if vibration.resolution_hz == 0:
        shown = np.sort(np.argsort(-energy)[:_MOST_LINES_DRAWN])
        feet = np.full(len(shown), energy.max() * 1e-9)
        ax.vlines(frequency[shown], feet, energy[shown], color=colour, linewidth=1.3, label=label)
        return
    group = np.floor(np.log(frequency) / _CURVE_STEP).astype(np.int64)
    starts = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
    peaks = np.maximum.reduceat(energy, starts)
    ax.plot(frequency[starts], peaks, color=colour, linewidth=0.9, label=label)


def _remark(place: Placed) -> str:
    if place.tuned is None:
        return "nothing to tune to"
    often = f"a recording every {spoken_time(place.interval_s)}"
    text = often if np.isfinite(place.interval_s) else "too little to send a recording"
    return text + ("; better only when damaged" if place.good_only_when_damaged else "")


def _short(text: str) -> str:
    return shortened(Path(text).name if "/" in text else text, _LONGEST_LABEL)


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
        (felt,) = course.plot(seconds, exposure.running_ms2[number], color=colour)
        # a single second makes no line
        felt.set(linewidth=0.9, marker="o" if len(seconds) == 1 else "")
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
    ends = np.cumsum([0.0, *(job.hours for job in day.jobs)])
    for ax, dose in zip(grid[:, 0], day.doses, strict=True):
        _draw_dose(ax, day, dose)
        for end in ends[1:-1]:
            ax.axvline(end, color=plots.LIGHT_GREY, linewidth=0.8)
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
    limits = ("action", dose.action, plots.GREY), ("limit", dose.limit, plots.VERMILLION)
    for told, value, colour in limits:
        if value is None or value > 4 * dose.high:  # so far off that the curve would be flat
            continue
        highest = max(highest, value)
        reached = dose.reached_h[told]
        when = "" if reached is None else f", reached after {reached:.2g} h"
        ax.axhline(value, color=colour, linewidth=1.4, linestyle=plots.DASHED)
        where: dict[str, Any] = {"xytext": (3, 2), "textcoords": "offset points", "fontsize": 9}
        ax.annotate(f"{told} value {value:g}{when}", (0, value), **where)
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
