"""Pictures of the energy lines, of contact, of damage and of speed."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from gearmon.report.palette import (
    BLACK,
    BLUE,
    GREY,
    LIGHT_GREY,
    VERMILLION,
    series_colour,
    series_marker,
)
from gearmon.report.study_plots_style import (
    HIGHEST_KHZ,
    LINE,
    grid_of_panels,
    labelled,
    shades,
    sheet,
    stems,
    titled,
    value_legend,
    zero_line,
)
from gearmon.study.claims_use import COMPARABLE, LIKELY_LIMIT_HZ, PRINTED_LIMIT_HZ
from gearmon.study.reference_case import PINION_TEETH, REFERENCE
from gearmon.study.results import StudyResults
from gearmon.study.speed import MANY, METHODS
from gearmon.study.sweeps import Sweep

MICRO, MILLI = 1e6, 1e3
FLOOR_DB = -40.0
LEVEL_FLOOR_DB = -35.0


def energy_of_stiffness(results: StudyResults) -> Figure:
    """Draw the energy lines of all stiffnesses together and apart."""
    return _energy(results.sweeps["stiffness_n_per_m"], 30, 31)


def energy_of_mass(results: StudyResults) -> Figure:
    """Draw the energy lines of all masses together and apart."""
    return _energy(results.sweeps["mass_kg"], 32, 33)


def energy_of_damping(results: StudyResults) -> Figure:
    """Draw the energy lines of all dampings together and apart."""
    return _energy(results.sweeps["damping_ns_per_m"], 34, 35)


def energy_of_reference(results: StudyResults) -> Figure:
    """Draw the energy lines of the reference case, and what a harvester takes from each."""
    figure = sheet(6.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    point = results.reference
    frequency, energy = point.response.frequency_hz / MILLI, MICRO * point.energy
    inside = (frequency > 0) & (frequency <= HIGHEST_KHZ)
    stems(upper, frequency[inside], energy[inside], 0.0, BLUE)
    upper.axhline(COMPARABLE * energy.max(), color=GREY, lw=0.8, ls="--")
    upper.text(
        HIGHEST_KHZ,
        COMPARABLE * energy.max(),
        "a third of the best ",
        ha="right",
        va="bottom",
        fontsize=8,
    )
    best = int(energy.argmax())
    upper.annotate(
        f"best: {MILLI * frequency[best]:.0f} Hz, {energy[best]:.1f} µJ/kg",
        (frequency[best], energy[best]),
        xytext=(0, 7),
        textcoords="offset points",
        ha="center",
        fontsize=8,
    )
    for limit, text in ((PRINTED_LIMIT_HZ, "printed limit"), (LIKELY_LIMIT_HZ, "likely limit")):
        upper.axvline(limit / MILLI, color=VERMILLION, lw=0.9, ls=":")
        upper.text(limit / MILLI + 0.1, 1.18 * energy.max(), text, color=VERMILLION, fontsize=8)
    upper.set_ylim(0, 1.28 * energy.max())
    titled(upper, "Fig. 36: energy lines of the reference case")
    labelled(upper, "", "energy in µJ/kg")
    harvest = results.harvest
    stems(lower, harvest.frequency_hz / MILLI, MILLI * harvest.power_w, 0.0, VERMILLION)
    titled(lower, "electrical power of a matched 5 g generator tuned to each line in turn")
    labelled(lower, "frequency in kHz", "power in mW")
    lower.set_ylim(bottom=0)
    lower.set_xlim(0, HIGHEST_KHZ)
    return figure


def contact(results: StudyResults) -> Figure:
    """Draw where contact would be lost."""
    study = results.contact
    figure = sheet(7.4)
    axes = figure.subplots(2, 2)
    curves = (
        (axes[0, 0], study.masses_kg, study.of_mass, "equivalent mass in kg", study.first_mass_kg),
        (
            axes[0, 1],
            study.dampings / MILLI,
            study.of_damping,
            "mesh damping in kN s/m, mass 3 kg",
            None if study.first_damping is None else study.first_damping / MILLI,
        ),
        (
            axes[1, 0],
            study.variations,
            study.of_variation,
            "stiffness variation eps, mass 3 kg",
            study.first_variation,
        ),
    )
    for ax, x, y, label, first in curves:
        _least_force(ax, x, y, first)
        labelled(ax, label, "least mesh force over F")
    axes[0, 0].set_xscale("log")
    axes[0, 0].axvspan(0.2, 3.0, color=LIGHT_GREY, alpha=0.6, lw=0)
    axes[0, 0].text(0.23, -1.9, "masses of\nthe study", fontsize=8)
    axes[0, 1].set_xscale("log")
    titled(axes[0, 0], "mass at the reference damping")
    titled(axes[0, 1], "damping at 3 kg")
    titled(axes[1, 0], "variation at 3 kg")
    _contact_map(figure, axes[1, 1], results)
    return figure


def damage(results: StudyResults) -> Figure:
    """Draw the lines of a pair with one weak tooth, and the level of its sidebands."""
    study = results.damage
    figure = sheet(3.9)
    left, right = figure.subplots(1, 2, width_ratios=(1.8, 1))
    index = study.losses.tolist().index(0.05)
    response = study.responses[index]
    lines, frequency = 2 * np.abs(response.acceleration), response.frequency_hz / MILLI
    mesh = np.arange(len(lines)) % PINION_TEETH == 0
    inside = (frequency > 0) & (frequency <= HIGHEST_KHZ)
    level = 20 * np.log10(np.maximum(lines, 1e-12))
    between = inside & ~mesh & (level > FLOOR_DB)
    left.vlines(
        frequency[between], FLOOR_DB, level[between], color=VERMILLION, lw=0.5, label="sidebands"
    )
    stems(left, frequency[inside & mesh], level[inside & mesh], FLOOR_DB, BLUE, "mesh harmonics")
    left.set_xlim(0, HIGHEST_KHZ)
    left.set_ylim(FLOOR_DB, 60)
    left.legend(fontsize=8, loc="upper right")
    titled(left, "acceleration, one pinion tooth 5 % weaker")
    labelled(left, "frequency in kHz", "dB re 1 m/s²")
    right.semilogx(100 * study.losses, study.levels_db, "o-", color=VERMILLION)
    titled(right, "sidebands over mesh harmonics, RMS")
    labelled(right, "loss of the tooth's pair stiffness in %", "dB")
    ticks = (100 * study.losses).tolist()
    right.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    right.set_xticks([], minor=True)
    return figure


def speed(results: StudyResults) -> Figure:
    """Draw time against error of substitution, new solution and simulation."""
    figure = sheet(5.2)
    ax = figure.subplots()
    ways = list(dict.fromkeys(cost.way for cost in results.speed.costs))
    for index, way in enumerate(ways):
        costs = [c for c in results.speed.costs if c.way == way and c.error > 0]
        simulated = way in METHODS
        ax.loglog(
            [cost.error for cost in costs],
            [MILLI * cost.seconds for cost in costs],
            series_marker(index) + ("--" if simulated else "-"),
            color=series_colour(index),
            label=f"simulation, SciPy {way}" if simulated else way,
        )
    for cost in results.speed.costs:
        if cost.way == MANY:
            ax.annotate(
                f"order {cost.setting}",
                (cost.error, MILLI * cost.seconds),
                xytext=(0, -11),
                textcoords="offset points",
                ha="center",
                fontsize=7,
            )
    ax.invert_xaxis()
    ax.legend(fontsize=8, loc="center left")
    ax.margins(y=0.12)
    titled(
        ax,
        f"one set of parameters, median of {results.speed.repeats} interleaved repeats "
        f"({results.speed.machine})",
    )
    labelled(ax, "relative L2 error of the acceleration", "time in ms")
    return figure


def _energy(sweep: Sweep, together: int, apart: int) -> Figure:
    figure = sheet(10.2)
    halves = figure.add_gridspec(2, 1, height_ratios=(1, 1.9))
    upper, lower = figure.add_subfigure(halves[0]), figure.add_subfigure(halves[1])
    left, right = upper.subplots(1, 2)
    for point, colour in zip(sweep.points, shades(len(sweep.points)), strict=True):
        frequency = point.response.frequency_hz[1::2] / MILLI
        inside = frequency <= HIGHEST_KHZ
        energy = MICRO * point.energy[1::2]
        style = {"color": colour, "markersize": 3, "linewidth": 0.8, "marker": "o"}
        left.plot(frequency[inside], energy[inside], **style)
        right.plot(frequency[inside], _level(energy)[inside], **style)
    titled(left, f"Fig. {together}: energy lines, linear")
    labelled(left, "frequency in kHz", "energy in µJ/kg")
    left.set_ylim(bottom=0)
    titled(right, f"Fig. {together}: the same as level")
    labelled(right, "frequency in kHz", "dB re 1 µJ/kg")
    right.set_ylim(bottom=LEVEL_FLOOR_DB)
    for ax in (left, right):
        ax.set_xlim(0, HIGHEST_KHZ)
    panels = grid_of_panels(lower, len(sweep.points), 3)
    for ax, point, shown, colour in zip(
        panels, sweep.points, sweep.shown, shades(len(panels)), strict=True
    ):
        frequency = point.response.frequency_hz / MILLI
        inside = (frequency > 0) & (frequency <= HIGHEST_KHZ)
        stems(ax, frequency[inside], _level(MICRO * point.energy)[inside], FLOOR_DB, colour)
        titled(ax, f"Fig. {apart}: {shown}, total {MICRO * point.total_energy:.3g} µJ/kg")
    panels[0].set_ylim(FLOOR_DB, 22)
    panels[0].set_xlim(0, HIGHEST_KHZ)
    lower.supxlabel("frequency in kHz", fontsize=9)
    lower.supylabel("dB re 1 µJ/kg", fontsize=9)
    value_legend(upper, sweep.shown, sweep.label)
    return figure


def _level(energy: np.ndarray) -> np.ndarray:
    return np.asarray(10 * np.log10(np.maximum(energy, 1e-12)))


def _least_force(ax: Axes, x: np.ndarray, y: np.ndarray, first: float | None) -> None:
    bottom = max(-3.0, float(np.min(y)) - 0.1)
    shown = np.maximum(y, bottom)
    ax.plot(x, shown, color=BLUE, lw=LINE)
    ax.fill_between(x, np.minimum(shown, 0), 0, color=VERMILLION, alpha=0.25, lw=0)
    zero_line(ax)
    ax.set_ylim(min(bottom, -0.05), 1.0)
    if first is not None:
        ax.plot(first, 0, "o", color=VERMILLION, markersize=5)
        ax.annotate(
            f"{first:.3g}",
            (first, 0),
            xytext=(-6, -12),
            textcoords="offset points",
            ha="right",
            color=VERMILLION,
            fontsize=8,
        )


def _contact_map(figure: Figure, ax: Axes, results: StudyResults) -> None:
    study = results.contact
    shown = np.maximum(study.of_both, -1.0)
    image = ax.pcolormesh(
        study.map_masses_kg,
        study.map_dampings / MILLI,
        shown,
        cmap="RdBu",
        norm=TwoSlopeNorm(0.0, -1.0, 1.0),
        shading="gouraud",
    )
    ax.contour(study.map_masses_kg, study.map_dampings / MILLI, shown, levels=[0.0], colors=BLACK)
    ax.plot(REFERENCE.mass_kg, REFERENCE.damping_ns_per_m / MILLI, "*", color=BLACK, markersize=10)
    ax.set_xscale("log")
    ax.set_yscale("log")
    bar = figure.colorbar(image, ax=ax, extend="min")
    bar.set_label("least mesh force over F", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    titled(ax, "black line: contact is just lost; star: reference")
    ax.grid(visible=False)
    labelled(ax, "equivalent mass in kg", "mesh damping in kN s/m")
