"""Pictures of the forms of stiffness, of the responses to them, and of the orders."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearmon.report.palette import BLACK, GREY, LIGHT_GREY, series_colour, series_marker
from gearmon.report.study_plots_style import (
    LINE,
    decibels,
    labelled,
    sheet,
    stems,
    titled,
    zero_line,
)
from gearmon.study.expansion import HIGHEST_ORDER, PUBLISHED_ORDER
from gearmon.study.reference_case import REFERENCE
from gearmon.study.responses import FormResponse
from gearmon.study.results import StudyResults
from gearmon.study.stiffness_signals import StiffnessSignal

GN, MICRO, MILLI = 1e-9, 1e6, 1e3
DRAWN = ("parabolic", "wave", "rectangular", "fourier")
COLOURS = {key: series_colour(i) for i, key in enumerate((*DRAWN, "fourier-half"))}
HARMONICS_SHOWN = 50


def stiffness_forms(results: StudyResults) -> Figure:
    """Draw the four forms over two mesh periods, each over the parabola."""
    figure = sheet(5.4)
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    phase = np.arange(4000) / 2000
    reference = results.forms["parabolic"].signal
    for ax, key in zip(axes.ravel(), DRAWN, strict=True):
        signal = results.forms[key].signal
        if key != "parabolic":
            ax.plot(phase, _stiffness(reference, phase), color=GREY, lw=1, label=reference.label)
        ax.plot(phase, _stiffness(signal, phase), color=COLOURS[key], lw=LINE, label=signal.label)
        if key == "fourier":
            half = results.forms["fourier-half"].signal
            ax.plot(
                phase,
                _stiffness(half, phase),
                color=COLOURS["fourier-half"],
                lw=0.9,
                ls="--",
                label=half.label,
            )
        titled(ax, f"Fig. 1, {signal.label}")
        ax.legend(fontsize=7.5, loc="upper right", framealpha=0.95)
    axes[0, 0].set_ylim(0.64, 1.14)
    axes[0, 0].set_xlim(0, 2)
    for ax in axes[1]:
        ax.set_xlabel("time in mesh periods (a pair enters contact at 0 and 1)", fontsize=9)
    for ax in axes[:, 0]:
        ax.set_ylabel("mesh stiffness in GN/m", fontsize=9)
    return figure


def stiffness_form_spectra(results: StudyResults) -> Figure:
    """Draw the spectra of the forms together, and each by itself."""
    figure = sheet(7.6)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.25, 1, 1))
    orders = np.arange(1, HARMONICS_SHOWN + 1)
    frequency = orders / REFERENCE.period_s / MILLI
    together = figure.add_subplot(grid[0, :])
    for index, key in enumerate((*DRAWN, "fourier-half")):
        signal = results.forms[key].signal
        level = decibels(_line_amplitudes(signal))
        shown = np.where(level > -70, level, np.nan)
        together.plot(
            frequency,
            shown,
            series_marker(index),
            color=COLOURS[key],
            markersize=4,
            fillstyle="none",
            label=signal.label,
        )
    together.legend(fontsize=7.5, ncols=3, loc="upper right")
    titled(together, "Fig. 2: all forms together")
    labelled(together, "frequency in kHz", "dB re mean stiffness")
    together.set_ylim(-70, -5)
    for place, key in zip(range(4), DRAWN, strict=True):
        ax = figure.add_subplot(grid[1 + place // 2, place % 2])
        signal = results.forms[key].signal
        stems(ax, frequency, decibels(_line_amplitudes(signal)), -70, COLOURS[key])
        titled(ax, f"Fig. 3: {signal.label}")
        labelled(ax, "frequency in kHz", "dB re mean stiffness")
        ax.set_ylim(-70, -5)
        ax.set_xlim(together.get_xlim())
    return figure


def form_responses(results: StudyResults) -> Figure:
    """Draw displacement, velocity and acceleration from rest, under three forms."""
    figure = sheet(8.2)
    axes = figure.subplots(3, 3, sharex=True, sharey="row")
    keys = (("wave", 4), ("rectangular", 5), ("fourier", 6))
    for column, (key, number) in enumerate(keys):
        response = results.forms[key]
        _response_column(axes[:, column], response, COLOURS[key])
        titled(axes[0, column], f"Fig. {number}: {response.signal.label}")
    labels = ("displacement in µm", "velocity in mm/s", "acceleration in m/s²")
    for ax, label in zip(axes[:, 0], labels, strict=True):
        ax.set_ylabel(label, fontsize=9)
    for ax in axes[2]:
        ax.set_xlabel("time in ms", fontsize=9)
    _clip_to_settled(results, axes, [key for key, _ in keys])
    axes[0, 0].legend(fontsize=7.5, loc="lower right")
    return figure


def mesh_force(results: StudyResults) -> Figure:
    """Draw the mesh force from rest and its lines."""
    figure = sheet(6.2)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.35, 1))
    wide, near = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0])
    lines = figure.add_subplot(grid[1, 1])
    for key, style in (("rectangular", "-"), ("fourier", "-"), ("fourier-half", "--")):
        response = results.forms[key]
        motion, colour = response.simulated, COLOURS[key]
        wide.plot(
            MILLI * motion.time_s[:-1],
            motion.mesh_force_n[:-1] / MILLI,
            style,
            color=colour,
            lw=LINE,
            label=response.signal.label,
        )
        last = response.last_period
        force = motion.mesh_force_n[last] / MILLI
        near.plot(response.phase, force, style, color=colour, lw=LINE)
    for ax in (wide, near):
        ax.axhline(REFERENCE.force_n / MILLI, color=BLACK, lw=0.7)
        ax.set_ylabel("mesh force in kN", fontsize=9)
    titled(wide, "Fig. 7: mesh force from rest (thin line: transmitted force F)")
    titled(near, "one settled mesh period")
    wide.set_xlabel("time in ms", fontsize=9)
    near.set_xlabel("mesh phase in mesh periods", fontsize=9)
    wide.legend(fontsize=8, loc="lower right")
    steady = results.forms["fourier-half"].steady
    sizes = 2 * np.abs(steady.mesh_force[1 : HARMONICS_SHOWN + 1])
    frequency = np.arange(1, HARMONICS_SHOWN + 1) / REFERENCE.period_s / MILLI
    stems(lines, frequency, decibels(sizes), 0.0, COLOURS["fourier-half"])
    titled(lines, "its lines, Fourier sum at half duty")
    labelled(lines, "frequency in kHz", "dB re 1 N")
    lines.set_ylim(bottom=0)
    return figure


def orders(results: StudyResults) -> Figure:
    """Draw the orders of the expansion beside the exact solution, and their errors."""
    study = results.orders
    figure = sheet(7.0)
    axes = figure.subplots(2, 2)
    phase = np.arange(801) / 800
    turned = np.exp(2j * np.pi * np.outer(phase, np.arange(1, study.expansion.terms.shape[1])))
    exact = MICRO * study.exact.at(phase * REFERENCE.period_s)
    for order in range(PUBLISHED_ORDER + 1):
        z = study.expansion.terms[: order + 1].sum(axis=0)
        curve = MICRO * (z[0].real + 2 * (turned @ z[1:]).real)
        axes[0, 0].plot(phase, curve, color=series_colour(order), lw=LINE, label=f"order {order}")
        axes[0, 1].plot(phase, curve - exact, color=series_colour(order), lw=LINE)
    axes[0, 0].plot(phase, exact, color=BLACK, lw=0.9, ls="--", label="exact")
    axes[0, 0].legend(fontsize=8)
    zero_line(axes[0, 1])
    titled(axes[0, 0], "solution to orders 0, 1, 2")
    titled(axes[0, 1], "its error")
    labelled(axes[0, 0], "mesh phase in mesh periods", "displacement in µm")
    labelled(axes[0, 1], "mesh phase in mesh periods", "displacement less exact in µm")
    _error_of_order(axes[1, 0], results)
    _error_of_variation(axes[1, 1], results)
    return figure


def _error_of_order(ax: Axes, results: StudyResults) -> None:
    study, numbers = results.orders, np.arange(HIGHEST_ORDER + 1)
    for index, (errors, label) in enumerate(
        (
            (study.displacement_errors, "displacement, largest error over largest value"),
            (study.acceleration_errors, "acceleration, relative L2 error"),
        )
    ):
        ax.semilogy(
            numbers, errors, series_marker(index) + "-", color=series_colour(index), label=label
        )
    ax.axvspan(-0.3, PUBLISHED_ORDER + 0.3, color=LIGHT_GREY, alpha=0.5, lw=0)
    ax.text(0.03, 0.05, "orders of the study", fontsize=8, transform=ax.transAxes)
    ax.legend(fontsize=8)
    titled(ax, f"error of each order at eps = {REFERENCE.variation:g}")
    labelled(ax, "order", "relative error")


def _error_of_variation(ax: Axes, results: StudyResults) -> None:
    study = results.orders
    for order in range(PUBLISHED_ORDER + 2):
        ax.loglog(
            study.variations,
            study.errors_of_variation[:, order],
            series_marker(order) + "-",
            color=series_colour(order),
            label=f"order {order}: slope {study.slopes[order]:.2f}",
        )
    ax.legend(fontsize=8, loc="lower right")
    titled(ax, "error falls by one more power of eps with each order")
    ax.set_xticks(study.variations, [f"{eps:g}" for eps in study.variations])
    ax.set_xticks([], minor=True)
    labelled(ax, "stiffness variation eps", "RMS error of displacement over F/k0")


def _response_column(axes: np.ndarray, response: FormResponse, colour: str) -> None:
    simulated, solved = response.simulated, response.solved
    # the last point belongs to the next mesh period
    time = MILLI * simulated.time_s[:-1]
    for ax, name, scale in zip(
        axes,
        ("displacement_m", "velocity_ms", "acceleration_ms2"),
        (MICRO, MILLI, 1.0),
        strict=True,
    ):
        ax.plot(
            time,
            scale * getattr(simulated, name)[:-1],
            color=colour,
            lw=2.2,
            alpha=0.45,
            label="direct integration",
        )
        ax.plot(
            time,
            scale * getattr(solved, name)[:-1],
            color=BLACK,
            lw=0.8,
            label="multiple scales",
        )
        titled(ax, "")


def _clip_to_settled(results: StudyResults, axes: np.ndarray, keys: list[str]) -> None:
    """Scale velocity and acceleration to what follows the start, which they begin far outside."""
    for row, name, scale in ((1, "velocity_ms", MILLI), (2, "acceleration_ms2", 1.0)):
        largest = max(
            float(
                np.abs(
                    getattr(results.forms[key].simulated, name)[results.forms[key].last_period]
                ).max()
            )
            for key in keys
        )
        axes[row, 0].set_ylim(-1.5 * scale * largest, 1.5 * scale * largest)


def _stiffness(signal: StiffnessSignal, phase: np.ndarray) -> np.ndarray:
    k = REFERENCE.stiffness_n_per_m * (1 + REFERENCE.variation * signal.shape(phase))
    return np.asarray(GN * k)


def _line_amplitudes(signal: StiffnessSignal) -> np.ndarray:
    return 2 * REFERENCE.variation * np.abs(signal.shape_harmonics(HARMONICS_SHOWN))
