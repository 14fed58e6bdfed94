"""Pictures of the sweeps: from rest, over a settled mesh period, and as spectra."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearmon.report.palette import GREY
from gearmon.report.study_plots_style import (
    HIGHEST_KHZ,
    decibels,
    grid_of_panels,
    labelled,
    shades,
    sheet,
    stems,
    titled,
    value_legend,
    zero_line,
)
from gearmon.study.results import StudyResults
from gearmon.study.sweeps import POINTS_PER_PERIOD, Operation, Sweep

MICRO, MILLI = 1e6, 1e3
#: Quantity: field of a trajectory, factor to the shown unit, label.
DISPLACEMENT = ("displacement_m", MICRO, "displacement in µm")
VELOCITY = ("velocity_ms", MILLI, "velocity in mm/s")
ACCELERATION = ("acceleration_ms2", 1.0, "acceleration in m/s²")
Quantity = tuple[str, float, str]
#: The part of a mesh period around the moment at which one pair is left.
NEAR_CHANGE = (0.46, 0.66)


def stiffness_from_rest(results: StudyResults) -> Figure:
    """Draw the three quantities from rest for all stiffnesses."""
    return _from_rest(
        results.sweeps["stiffness_n_per_m"],
        ((DISPLACEMENT, "Fig. 8"), (VELOCITY, "Fig. 9"), (ACCELERATION, "Fig. 10")),
    )


def stiffness_settled(results: StudyResults) -> Figure:
    """Draw a settled mesh period for all stiffnesses, and the change of pairs in detail."""
    sweep = results.sweeps["stiffness_n_per_m"]
    figure = sheet(6.8)
    axes = figure.subplots(2, 2)
    panels = (
        (DISPLACEMENT, "Fig. 11: displacement, one settled mesh period"),
        (VELOCITY, "Fig. 12: velocity"),
        (ACCELERATION, "Fig. 13: acceleration"),
        (ACCELERATION, "Fig. 14: acceleration as one pair is left"),
    )
    for ax, (quantity, title) in zip(axes.ravel(), panels, strict=True):
        _settled(ax, sweep, quantity)
        titled(ax, title)
    axes[1, 1].set_xlim(*NEAR_CHANGE)
    value_legend(figure, sweep.shown, sweep.label)
    return figure


def stiffness_spectra(results: StudyResults) -> Figure:
    """Draw the spectra of the three quantities for all stiffnesses."""
    sweep = results.sweeps["stiffness_n_per_m"]
    figure = sheet(8.4)
    axes = figure.subplots(3, 1)
    _overlay(axes[0], sweep, lambda p: decibels(_amplitudes(p, "displacement"), 1e-6))
    titled(axes[0], "Fig. 15: displacement")
    labelled(axes[0], "frequency in kHz", "dB re 1 µm")
    axes[0].set_ylim(-60, 15)
    _overlay(axes[1], sweep, lambda p: MILLI * _amplitudes(p, "velocity"))
    titled(axes[1], "Fig. 16: velocity")
    labelled(axes[1], "frequency in kHz", "amplitude in mm/s")
    _overlay(axes[2], sweep, lambda p: _amplitudes(p, "acceleration"))
    titled(axes[2], "Fig. 18: acceleration")
    labelled(axes[2], "frequency in kHz", "amplitude in m/s²")
    for ax in axes[1:]:
        ax.set_ylim(bottom=0)
    value_legend(figure, sweep.shown, sweep.label)
    return figure


def stiffness_velocity_lines(results: StudyResults) -> Figure:
    """Draw the velocity lines of each stiffness by themselves."""
    return _separate_lines(
        results.sweeps["stiffness_n_per_m"],
        "Fig. 17",
        lambda p: decibels(_amplitudes(p, "velocity"), 1e-3),
        "velocity, dB re 1 mm/s",
        (-60, 30),
    )


def stiffness_acceleration_lines(results: StudyResults) -> Figure:
    """Draw the acceleration lines of each stiffness by themselves."""
    return _acceleration_lines(results.sweeps["stiffness_n_per_m"], "Fig. 19")


def mass_in_time(results: StudyResults) -> Figure:
    """Draw the displacement for all masses, from rest and settled."""
    return _in_time(results.sweeps["mass_kg"], 20, 21)


def mass_separate(results: StudyResults) -> Figure:
    """Draw the displacement of each mass by itself."""
    return _separate_displacement(results.sweeps["mass_kg"], "Fig. 22")


def mass_spectra(results: StudyResults) -> Figure:
    """Draw the acceleration spectra for all masses."""
    return _acceleration_spectra(results.sweeps["mass_kg"], "Fig. 23")


def mass_lines(results: StudyResults) -> Figure:
    """Draw the acceleration lines of each mass by themselves."""
    return _acceleration_lines(results.sweeps["mass_kg"], "Fig. 24")


def damping_in_time(results: StudyResults) -> Figure:
    """Draw the displacement for all dampings, from rest and settled."""
    return _in_time(results.sweeps["damping_ns_per_m"], 25, 26)


def damping_separate(results: StudyResults) -> Figure:
    """Draw the displacement of each damping by itself."""
    return _separate_displacement(results.sweeps["damping_ns_per_m"], "Fig. 27")


def damping_spectra(results: StudyResults) -> Figure:
    """Draw the acceleration spectra for all dampings."""
    return _acceleration_spectra(results.sweeps["damping_ns_per_m"], "Fig. 28")


def damping_lines(results: StudyResults) -> Figure:
    """Draw the acceleration lines of each damping by themselves."""
    return _acceleration_lines(results.sweeps["damping_ns_per_m"], "Fig. 29")


def _from_rest(sweep: Sweep, rows: tuple[tuple[Quantity, str], ...]) -> Figure:
    """Draw the first mesh period and the next three apart: the start dwarfs what follows."""
    figure = sheet(1.0 + 2.5 * len(rows))
    axes = figure.subplots(len(rows), 2, width_ratios=(1, 2.2), squeeze=False)
    for (left, right), (quantity, name) in zip(axes, rows, strict=True):
        what = quantity[2].split(" in ")[0]
        _trajectories(left, sweep, quantity, slice(0, POINTS_PER_PERIOD + 1))
        _trajectories(right, sweep, quantity, slice(POINTS_PER_PERIOD, None))
        titled(left, f"{name}: {what}, first period")
        titled(right, f"{name}: {what}, the next three")
    value_legend(figure, sweep.shown, sweep.label)
    return figure


def _in_time(sweep: Sweep, first: int, second: int) -> Figure:
    figure = sheet(6.4)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 2.2))
    left, right = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    _trajectories(left, sweep, DISPLACEMENT, slice(0, POINTS_PER_PERIOD + 1))
    _trajectories(right, sweep, DISPLACEMENT, slice(POINTS_PER_PERIOD, None))
    titled(left, f"Fig. {first}: displacement, first mesh period")
    titled(right, f"Fig. {first}: the next three")
    settled = figure.add_subplot(grid[1, :])
    _settled(settled, sweep, DISPLACEMENT)
    titled(settled, f"Fig. {second}: displacement, one settled mesh period")
    value_legend(figure, sweep.shown, sweep.label)
    return figure


def _separate_displacement(sweep: Sweep, name: str) -> Figure:
    figure = sheet(7.6)
    panels = grid_of_panels(figure, len(sweep.points), 3)
    for ax, point, shown, colour in zip(
        panels, sweep.points, sweep.shown, shades(len(panels)), strict=True
    ):
        static = MICRO * point.parameters.static_deflection_m
        ax.axhline(static, color=GREY, linewidth=0.8)
        ax.plot(
            MILLI * point.start.motion.time_s,
            MICRO * point.start.motion.displacement_m,
            color=colour,
            lw=1.1,
        )
        zero_line(ax)
        titled(ax, f"{name}: {shown}")
    figure.supxlabel("time in ms", fontsize=9)
    figure.supylabel("displacement in µm (grey: F/k0)", fontsize=9)
    return figure


def _acceleration_spectra(sweep: Sweep, name: str) -> Figure:
    figure = sheet(6.4)
    axes = figure.subplots(2, 1)
    _overlay(axes[0], sweep, lambda p: _amplitudes(p, "acceleration"))
    titled(axes[0], f"{name}: acceleration, linear")
    labelled(axes[0], "frequency in kHz", "amplitude in m/s²")
    axes[0].set_ylim(bottom=0)
    _overlay(axes[1], sweep, lambda p: decibels(_amplitudes(p, "acceleration")))
    titled(axes[1], f"{name}: the same as level")
    labelled(axes[1], "frequency in kHz", "dB re 1 m/s²")
    value_legend(figure, sweep.shown, sweep.label)
    return figure


def _acceleration_lines(sweep: Sweep, name: str) -> Figure:
    return _separate_lines(
        sweep,
        name,
        lambda p: decibels(_amplitudes(p, "acceleration")),
        "acceleration, dB re 1 m/s²",
        (-20, 62),
    )


def _separate_lines(
    sweep: Sweep,
    name: str,
    levels: Callable[[Operation], np.ndarray],
    label: str,
    limits: tuple[float, float],
) -> Figure:
    figure = sheet(7.6)
    panels = grid_of_panels(figure, len(sweep.points), 3)
    for ax, point, shown, colour in zip(
        panels, sweep.points, sweep.shown, shades(len(panels)), strict=True
    ):
        frequency = point.response.frequency_hz / MILLI
        inside = (frequency > 0) & (frequency <= HIGHEST_KHZ)
        stems(ax, frequency[inside], levels(point)[inside], limits[0], colour)
        natural = point.response.problem.natural_frequency_hz / MILLI
        ax.axvline(natural, color=GREY, linewidth=0.8, linestyle=":")
        titled(ax, f"{name}: {shown}")
    panels[0].set_ylim(*limits)
    panels[0].set_xlim(0, HIGHEST_KHZ)
    figure.supxlabel("frequency in kHz (dotted: natural frequency)", fontsize=9)
    figure.supylabel(label, fontsize=9)
    return figure


def _overlay(ax: Axes, sweep: Sweep, heights: Callable[[Operation], np.ndarray]) -> None:
    """Draw the odd harmonics of all values, joined to guide the eye."""
    for point, colour in zip(sweep.points, shades(len(sweep.points)), strict=True):
        frequency = point.response.frequency_hz[1::2] / MILLI
        inside = frequency <= HIGHEST_KHZ
        ax.plot(
            frequency[inside],
            heights(point)[1::2][inside],
            "o-",
            color=colour,
            markersize=3,
            linewidth=0.8,
        )
    ax.set_xlim(0, HIGHEST_KHZ)


def _amplitudes(point: Operation, kind: str) -> np.ndarray:
    return np.asarray(2 * np.abs(getattr(point.response, kind)))


def _trajectories(ax: Axes, sweep: Sweep, quantity: Quantity, part: slice) -> None:
    name, scale, label = quantity
    for point, colour in zip(sweep.points, shades(len(sweep.points)), strict=True):
        motion = point.start.motion
        ax.plot(
            MILLI * motion.time_s[part], scale * getattr(motion, name)[part], color=colour, lw=1.0
        )
    first, last = motion.time_s[part][[0, -1]]
    ax.set_xlim(MILLI * first, MILLI * last)
    labelled(ax, "time in ms", label)


def _settled(ax: Axes, sweep: Sweep, quantity: Quantity) -> None:
    name, scale, label = quantity
    for point, colour in zip(sweep.points, shades(len(sweep.points)), strict=True):
        motion = point.waveform
        phase = motion.time_s / point.parameters.period_s
        ax.plot(phase, scale * getattr(motion, name), color=colour, lw=1.0)
    ax.set_xlim(0, 1)
    labelled(ax, "mesh phase in mesh periods", label)
