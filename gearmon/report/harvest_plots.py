"""Pictures of a harvester survey: energy with the harvester over it, power by tuning, positions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

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
    low, high = _span(best)
    top = 0.0
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
    power, low, high, degraded = (
        _MICRO
        * np.array(
            [(p.power_w, p.power_low_w, p.power_high_w, p.degraded_power_w) for p in survey.placed]
        ).T
    )
    ax.barh(rows, power, height=0.5, color=plots.BLUE, alpha=0.85, label="gears sound")
    if np.isfinite(low).any():
        how: dict[str, Any] = {"fmt": "none", "ecolor": plots.BLACK, "capsize": 4}
        middle, reach = (low + high) / 2, (high - low) / 2
        ax.errorbar(middle, rows, xerr=reach, label="90 % interval", **how)
    if np.isfinite(degraded).any():
        label = "same tuning, gear damaged"
        plots.plot_marks(ax, degraded, rows - 0.16, "D", 6, plots.VERMILLION, label=label)
    for row, place in zip(rows, survey.placed, strict=True):
        ax.annotate(
            _remark(place),
            (0, row + 0.37),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=9,
            color=plots.GREY if place.tuned is None else plots.BLACK,
        )
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


def _span(place: Placed) -> tuple[float, float]:
    """Frequencies worth showing: the lines, and the harvester if it is elsewhere."""
    ends = [] if place.tuned is None else list(place.tuned.harvester.frequency_range_hz)
    for point in place.position.healthy:
        vibration = point.vibration
        energy = vibration.energy_j_per_kg
        loud = vibration.frequency_hz[energy > energy.max() * 1e-5]
        # the lines with most of the energy are shown wherever they lie; drift of a sensor is not
        ends += [row["frequency_hz"] for row in operating_lines(vibration, 3)]
        ends += [float(loud.max())] + ([] if vibration.resolution_hz else [float(loud.min())])
    return min(ends) / 1.5, max(ends) * 1.5


def _short(text: str) -> str:
    return shortened(Path(text).name if "/" in text else text, _LONGEST_LABEL)
