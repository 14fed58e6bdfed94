"""The pictures of the study; study.toml names them and says which figures they stand for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from gearmon.arrays import FloatArray
from gearmon.files import replacing
from gearmon.report.plots import (
    BLACK,
    BLUE,
    GREY,
    LIGHT_GREY,
    VERMILLION,
    series_colour,
    series_marker,
)
from gearmon.study.claims import COMPARABLE, LIKELY_LIMIT_HZ, PRINTED_LIMIT_HZ, study_table
from gearmon.study.experiments import (
    HIGHEST_ORDER,
    MANY,
    METHODS,
    PUBLISHED_ORDER,
    VARIATIONS,
    Scan,
    StudyResults,
    Sweep,
)
from gearmon.study.pair import (
    PINION_TEETH,
    POINTS_PER_PERIOD,
    REFERENCE,
    Operation,
    StiffnessSignal,
)

MICRO, MILLI = 1e6, 1e3
LINE = 1.3
#: Highest frequency of the spectra shown [kHz]; every line above is weaker than those shown.
HIGHEST_KHZ = 25.0
HARMONICS_SHOWN = 50
FLOOR_DB = -40.0
FORMS = ("parabolic", "wave", "rectangular", "fourier", "fourier-half")
COLOURS = {key: series_colour(i) for i, key in enumerate(FORMS)}
#: Quantity: field of a trajectory, factor to the shown unit, label.
DISPLACEMENT = ("displacement_m", MICRO, "displacement in µm")
VELOCITY = ("velocity_ms", MILLI, "velocity in mm/s")
ACCELERATION = ("acceleration_ms2", 1.0, "acceleration in m/s²")
QUANTITIES = {"displacement": DISPLACEMENT, "velocity": VELOCITY, "acceleration": ACCELERATION}
Quantity = tuple[str, float, str]
FREQUENCY = "frequency in kHz"
Style = dict[str, Any]


def save_picture(name: str, results: StudyResults, path: Path) -> None:
    """Draw one picture and write it as PNG.

    Parameters
    ----------
    name : str
        Key of `DRAWINGS`.
    results : StudyResults
    path : Path
        The file; its folder must exist.
    """
    with replacing(path) as temporary:
        DRAWINGS[name](results).savefig(temporary, dpi=110)


def shades(count: int) -> list[tuple[float, float, float, float]]:
    """Return colours in the order of their values, dark to light and apart in grey print too."""
    # the light end of the map is too pale on white
    return [colormaps["viridis"](x) for x in np.linspace(0.0, 0.88, count)]


def decibels(amplitudes: ArrayLike, reference: float = 1.0) -> FloatArray:
    """Return 20 lg of amplitudes over the reference; zeros become -400 dB."""
    sizes = np.maximum(np.abs(np.asarray(amplitudes)), 1e-20 * reference)
    return np.asarray(20 * np.log10(sizes / reference))


def _sheet(height: float) -> Figure:
    return Figure(figsize=(11.0, height), layout="constrained")


def _panel(ax: Axes, title: str, x: str = "", y: str = "") -> Axes:
    """Give a panel its title, a light grid, and names with units to its axes."""
    ax.set_title(title, loc="left", fontsize=9.5)
    ax.grid(color=LIGHT_GREY, linewidth=0.5)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=8)
    ax.set_xlabel(x, fontsize=9)
    ax.set_ylabel(y, fontsize=9)
    return ax


def _value_legend(figure: FigureBase, sweep: Sweep) -> None:
    """Put the colours of a swept parameter beside the panels."""
    pairs = zip(sweep.shown, shades(len(sweep.points)), strict=True)
    handles = [Line2D([], [], color=colour, linewidth=2, label=name) for name, colour in pairs]
    style: Style = {"loc": "outside right upper", "fontsize": 8, "title_fontsize": 9}
    figure.legend(handles=handles, title=sweep.label, **style)


def _stems(
    ax: Axes, x: ArrayLike, y: ArrayLike, floor: float, colour: Any, label: str | None = None
) -> None:
    """Draw lines of a spectrum from a floor up, with a point on top; those below are left out."""
    heights, places = np.asarray(y, dtype=np.float64), np.asarray(x, dtype=np.float64)
    kept = (heights > floor) & (places > 0) & (places <= HIGHEST_KHZ)
    ax.vlines(places[kept], floor, heights[kept], color=colour, linewidth=1.0)
    ax.plot(places[kept], heights[kept], "o", color=colour, markersize=2.6, label=label)


def _lines(kind: str, point: Operation) -> FloatArray:
    """Return the energy lines [J/kg], or amplitudes of what a response has by this name."""
    return point.energy if kind == "energy" else 2 * np.abs(getattr(point.response, kind))


# Forms of stiffness, the responses to them, and the orders.


def _draw_stiffness_forms(results: StudyResults) -> Figure:
    figure, phase = _sheet(5.4), np.arange(4000) / 2000
    axes = figure.subplots(2, 2, sharex=True, sharey=True)

    def draw(ax: Axes, key: str, colour: str, width: float, dashes: str = "-") -> None:
        signal = results.forms[key].signal
        stiffness = 1 + REFERENCE.variation * signal.shape(phase)
        stiffness *= 1e-9 * REFERENCE.stiffness_n_per_m
        ax.plot(phase, stiffness, color=colour, lw=width, ls=dashes, label=signal.label)

    for ax, key in zip(axes.ravel(), FORMS, strict=False):
        if key != "parabolic":
            draw(ax, "parabolic", GREY, 1)
        draw(ax, key, COLOURS[key], LINE)
        if key == "fourier":
            draw(ax, "fourier-half", COLOURS["fourier-half"], 0.9, "--")
        time = "time in mesh periods (a pair enters contact at 0 and 1)"
        _panel(ax, f"Fig. 1, {results.forms[key].signal.label}", time, "mesh stiffness in GN/m")
        ax.label_outer()
        ax.legend(fontsize=7.5, loc="upper right", framealpha=0.95)
    axes[0, 0].set(xlim=(0, 2), ylim=(0.64, 1.14))
    return figure


def _line_levels(signal: StiffnessSignal) -> FloatArray:
    return decibels(2 * REFERENCE.variation * signal.shape_harmonics(HARMONICS_SHOWN))


def _draw_stiffness_form_spectra(results: StudyResults) -> Figure:
    """Draw the spectra of the forms together, and each by itself."""
    figure = _sheet(7.6)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.25, 1, 1))
    frequency = np.arange(1, HARMONICS_SHOWN + 1) / REFERENCE.period_s / MILLI
    together = figure.add_subplot(grid[0, :], ylim=(-70, -5))
    _panel(together, "Fig. 2: all forms together", FREQUENCY, "dB re mean stiffness")
    for index, (key, colour) in enumerate(COLOURS.items()):
        signal = results.forms[key].signal
        level = _line_levels(signal)
        style: Style = {"color": colour, "markersize": 4, "fillstyle": "none"}
        shown = np.where(level > -70, level, np.nan)
        together.plot(frequency, shown, series_marker(index), label=signal.label, **style)
        if key != "fourier-half":
            ax = figure.add_subplot(grid[1 + index // 2, index % 2], sharey=together)
            _stems(ax, frequency, level, -70, colour)
            _panel(ax, f"Fig. 3: {signal.label}", FREQUENCY, "dB re mean stiffness")
            ax.set_xlim(0, frequency[-1])
    together.legend(fontsize=7.5, ncols=3, loc="upper right")
    return figure


def _draw_form_responses(results: StudyResults) -> Figure:
    """Draw displacement, velocity and acceleration from rest, under three forms."""
    figure = _sheet(8.2)
    axes = figure.subplots(3, 3, sharex=True, sharey="row")
    for row, (name, scale, label) in enumerate((DISPLACEMENT, VELOCITY, ACCELERATION)):
        largest = 0.0
        for column, key in enumerate(("wave", "rectangular", "fourier")):
            ax, form = axes[row, column], results.forms[key]
            # the last point belongs to the next mesh period
            time = MILLI * form.simulated.time_s[:-1]
            simulated, solved = (
                scale * getattr(motion, name) for motion in (form.simulated, form.solved)
            )
            broad: Style = {"color": COLOURS[key], "lw": 2.2, "alpha": 0.45}
            ax.plot(time, simulated[:-1], label="direct integration", **broad)
            ax.plot(time, solved[:-1], color=BLACK, lw=0.8, label="multiple scales")
            largest = max(largest, np.abs(simulated[form.last_period]).max())
            title = f"Fig. {4 + column}: {form.signal.label}" if row == 0 else ""
            _panel(ax, title, "time in ms", label).label_outer()
        if row:  # the start begins far outside of what follows it
            axes[row, 0].set_ylim(-1.5 * largest, 1.5 * largest)
    axes[0, 0].legend(fontsize=7.5, loc="lower right")
    return figure


def _draw_mesh_force(results: StudyResults) -> Figure:
    """Draw the mesh force from rest and its lines."""
    figure, label = _sheet(6.2), "mesh force in kN"
    grid = figure.add_gridspec(2, 2, width_ratios=(1.35, 1))
    wide, near = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0])
    for key in ("rectangular", "fourier", "fourier-half"):
        form, dashes = results.forms[key], "--" if key == "fourier-half" else "-"
        style: Style = {"color": COLOURS[key], "lw": LINE, "ls": dashes}
        time, force = form.simulated.time_s * MILLI, form.simulated.mesh_force_n / MILLI
        wide.plot(time[:-1], force[:-1], label=form.signal.label, **style)
        near.plot(form.phase, force[form.last_period], **style)
    for ax in (wide, near):
        ax.axhline(REFERENCE.force_n / MILLI, color=BLACK, lw=0.7)
    title = "Fig. 7: mesh force from rest (thin line: transmitted force F)"
    _panel(wide, title, "time in ms", label).legend(fontsize=8, loc="lower right")
    _panel(near, "one settled mesh period", "mesh phase in mesh periods", label)
    lines, steady = figure.add_subplot(grid[1, 1]), results.forms["fourier-half"].steady
    kept = slice(1, HARMONICS_SHOWN + 1)
    level = decibels(2 * np.abs(steady.mesh_force[kept]))
    _stems(lines, steady.frequency_hz[kept] / MILLI, level, 0.0, COLOURS["fourier-half"])
    _panel(lines, "its lines, Fourier sum at half duty", FREQUENCY, "dB re 1 N").set_ylim(bottom=0)
    return figure


def _draw_orders(results: StudyResults) -> Figure:
    """Draw the orders of the expansion beside the exact solution, and their errors."""
    study, figure, phase = results.orders, _sheet(7.0), np.arange(801) / 800
    ((together, error), (of_order, of_eps)) = figure.subplots(2, 2)
    turned = np.exp(2j * np.pi * np.outer(phase, np.arange(study.expansion.terms.shape[1])))
    exact = MICRO * study.exact.at(phase * REFERENCE.period_s)
    for order in range(PUBLISHED_ORDER + 1):
        z = study.expansion.terms[: order + 1].sum(axis=0)
        curve = MICRO * (2 * (turned @ z).real - z[0].real)
        style: Style = {"color": series_colour(order), "lw": LINE}
        together.plot(phase, curve, label=f"order {order}", **style)
        error.plot(phase, curve - exact, **style)
    together.plot(phase, exact, color=BLACK, lw=0.9, ls="--", label="exact")
    error.axhline(0.0, color=BLACK, linewidth=0.6)
    for index, (errors, label) in enumerate((
        (study.displacement_errors, "displacement, largest error over largest value"),
        (study.acceleration_errors, "acceleration, relative L2 error"),
    )):  # fmt: skip
        style = {"color": series_colour(index), "label": label}
        of_order.semilogy(range(HIGHEST_ORDER + 1), errors, series_marker(index) + "-", **style)
    of_order.axvspan(-0.3, PUBLISHED_ORDER + 0.3, color=LIGHT_GREY, alpha=0.5, lw=0)
    of_order.text(0.03, 0.05, "orders of the study", fontsize=8, transform=of_order.transAxes)
    for order in range(PUBLISHED_ORDER + 2):
        label = f"order {order}: slope {study.slopes[order]:.2f}"
        style = {"color": series_colour(order), "label": label}
        errors = study.errors_of_variation[:, order]
        of_eps.loglog(VARIATIONS, errors, series_marker(order) + "-", **style)
    of_eps.set_xticks(VARIATIONS, [f"{eps:g}" for eps in VARIATIONS])
    of_eps.set_xticks([], minor=True)
    at = "mesh phase in mesh periods"
    one_more = "error falls by one more power of eps with each order"
    _panel(together, "solution to orders 0, 1, 2", at, "displacement in µm").legend(fontsize=8)
    _panel(error, "its error", at, "displacement less exact in µm")
    of_which = f"error of each order at eps = {REFERENCE.variation:g}"
    _panel(of_order, of_which, "order", "relative error").legend(fontsize=8)
    rms = "RMS error of displacement over F/k0"
    _panel(of_eps, one_more, "stiffness variation eps", rms).legend(fontsize=8, loc="lower right")
    return figure


# Sweeps.


def _over_time(ax: Axes, sweep: Sweep, quantity: Quantity, when: str, title: str) -> None:
    """Draw the first mesh period from rest, the later ones that it dwarfs, or a settled one."""
    name, scale, label = quantity
    settled = when == "settled"
    part = slice(0 if settled else POINTS_PER_PERIOD, None)
    if when == "first":
        part = slice(POINTS_PER_PERIOD + 1)
    for point, colour in zip(sweep.points, shades(len(sweep.points)), strict=True):
        motion = point.waveform if settled else point.start.motion
        time = motion.time_s[part] * (1 / point.parameters.period_s if settled else MILLI)
        ax.plot(time, scale * getattr(motion, name)[part], color=colour, lw=1.0)
    x = "mesh phase in mesh periods" if settled else "time in ms"
    _panel(ax, title, x, label).set_xlim(0.0 if settled else time[0], 1.0 if settled else time[-1])


def _draw_over_time(
    name: str, height: float, rows: Sequence[Sequence[Sequence[Any]]], results: StudyResults
) -> Figure:
    """Draw rows of panels: quantity, part of the time, title, and limits of the time if any."""
    sweep, figure = results.sweeps[name], _sheet(height)
    grid = figure.add_gridspec(len(rows), 1)
    for number, row in enumerate(rows):
        widths = [1.0 if when == "first" else 2.2 for _, when, *_ in row]
        cells = grid[number].subgridspec(1, len(row), width_ratios=widths)
        for column, (quantity, when, title, *limits) in enumerate(row):
            ax = figure.add_subplot(cells[column])
            _over_time(ax, sweep, QUANTITIES[quantity], when, title)
            if limits:
                ax.set_xlim(*limits)
    _value_legend(figure, sweep)
    return figure


def _draw_spectra(
    name: str, height: float, panels: Sequence[Sequence[Any]], results: StudyResults
) -> Figure:
    """Draw the odd harmonics of all values joined to guide the eye, the even ones as points."""
    figure, sweep = _sheet(height), results.sweeps[name]
    axes = figure.subplots(len(panels), 1)
    for ax, (kind, mode, scale, title, label, *limits) in zip(axes, panels, strict=True):
        for point, colour in zip(sweep.points, shades(len(sweep.points)), strict=True):
            frequency, lines = point.response.frequency_hz / MILLI, _lines(kind, point)
            shown = decibels(lines, scale) if mode == "level" else scale * lines
            if kind == "energy" and mode == "level":
                shown = 0.5 * shown
            inside = frequency <= HIGHEST_KHZ
            style: Style = {"color": colour, "markersize": 3, "linewidth": 0.8}
            ax.plot(frequency[inside][1::2], shown[inside][1::2], "o-", **style)
            ax.plot(frequency[inside][2::2], shown[inside][2::2], ".", **style)
        low, high = (*limits, None, None)[:2]
        _panel(ax, title, FREQUENCY, label).set(xlim=(0, HIGHEST_KHZ), ylim=(low, high))
    _value_legend(figure, sweep)
    return figure


def _draw_energy_of_reference(results: StudyResults) -> Figure:
    """Draw the energy lines of the reference case, and what a harvester takes from each."""
    figure, point, harvest = _sheet(6.6), results.reference, results.harvest
    upper, lower = figure.subplots(2, 1, sharex=True)
    frequency, energy = point.response.frequency_hz / MILLI, MICRO * point.energy
    third, best = COMPARABLE * energy.max(), int(energy.argmax())
    _stems(upper, frequency, energy, 0.0, BLUE)
    upper.axhline(third, color=GREY, lw=0.8, ls="--")
    upper.text(HIGHEST_KHZ, third, "a third of the best ", ha="right", va="bottom", fontsize=8)
    text = f"best: {MILLI * frequency[best]:.0f} Hz, {energy[best]:.1f} µJ/kg"
    upper.text(frequency[best], 1.03 * energy[best], text, ha="center", fontsize=8)
    for limit, text in ((PRINTED_LIMIT_HZ, "printed limit"), (LIKELY_LIMIT_HZ, "likely limit")):
        upper.axvline(limit / MILLI, color=VERMILLION, lw=0.9, ls=":")
        upper.text(limit / MILLI + 0.1, 1.18 * energy.max(), text, color=VERMILLION, fontsize=8)
    _panel(upper, "Fig. 36: energy lines of the reference case", "", "energy in µJ/kg")
    upper.set_ylim(0, 1.28 * energy.max())
    _stems(lower, harvest.frequency_hz / MILLI, MILLI * harvest.power_w, 0.0, VERMILLION)
    title = "electrical power of a matched 5 g generator tuned to each line in turn"
    _panel(lower, title, FREQUENCY, "power in mW").set(xlim=(0, HIGHEST_KHZ), ylim=(0, None))
    return figure


def _draw_contact(results: StudyResults) -> Figure:
    """Draw where contact would be lost."""
    study, figure = results.contact, _sheet(7.4)
    ((of_mass, of_damping), (of_variation, both)) = figure.subplots(2, 2)
    _least_force(of_mass, study.mass, 1.0, "mass at the reference damping", "equivalent mass in kg")
    damping, eps = "mesh damping in kN s/m, mass 3 kg", "stiffness variation eps, mass 3 kg"
    _least_force(of_damping, study.damping, MILLI, "damping at 3 kg", damping)
    _least_force(of_variation, study.variation, 1.0, "variation at 3 kg", eps)
    of_mass.axvspan(0.2, 3.0, color=LIGHT_GREY, alpha=0.6, lw=0)
    of_mass.text(0.23, -1.9, "masses of\nthe study", fontsize=8)
    masses, dampings, shown = study.map_masses_kg, study.map_dampings / MILLI, study.of_both
    shown, norm = np.maximum(shown, -1.0), TwoSlopeNorm(0.0, -1.0, 1.0)
    image = both.pcolormesh(masses, dampings, shown, cmap="RdBu", norm=norm, shading="gouraud")
    both.contour(masses, dampings, shown, levels=[0.0], colors=BLACK)
    reference = REFERENCE.mass_kg, REFERENCE.damping_ns_per_m / MILLI
    both.plot(*reference, "*", color=BLACK, markersize=10)
    bar = figure.colorbar(image, ax=both, extend="min")
    bar.set_label("least mesh force over F", fontsize=9)
    title = "black line: contact is just lost; star: reference"
    _panel(both, title, "equivalent mass in kg", "mesh damping in kN s/m").grid(visible=False)
    for ax in (of_mass, of_damping, both):
        ax.set_xscale("log")
    both.set_yscale("log")
    return figure


def _least_force(ax: Axes, scan: Scan, scale: float, title: str, label: str) -> None:
    x, bottom = scan.values / scale, max(-3.0, float(np.min(scan.least_force)) - 0.1)
    shown = np.maximum(scan.least_force, bottom)
    ax.plot(x, shown, color=BLUE, lw=LINE)
    ax.fill_between(x, np.minimum(shown, 0), 0, color=VERMILLION, alpha=0.25, lw=0)
    ax.axhline(0.0, color=BLACK, linewidth=0.6)
    if scan.first is not None:
        at = scan.first / scale
        style: Style = {"color": VERMILLION, "ha": "right", "va": "top"}
        ax.plot(at, 0, "o", color=VERMILLION, markersize=5)
        ax.text(at, -0.02, f"{at:.3g} ", fontsize=8, **style)
    _panel(ax, title, label, "least mesh force over F").set_ylim(min(bottom, -0.05), 1.0)


def _draw_damage(results: StudyResults) -> Figure:
    """Draw the lines of a pair with one weak tooth, and the level of its sidebands."""
    study, figure = results.damage, _sheet(3.9)
    left, right = figure.subplots(1, 2, width_ratios=(1.8, 1))
    response = study.responses[study.losses.tolist().index(0.05)]
    frequency, level = response.frequency_hz / MILLI, decibels(2 * np.abs(response.acceleration))
    mesh = np.arange(len(level)) % PINION_TEETH == 0
    between = ~mesh & (level > FLOOR_DB) & (frequency <= HIGHEST_KHZ)
    sidebands: Style = {"color": VERMILLION, "lw": 0.5, "label": "sidebands"}
    left.vlines(frequency[between], FLOOR_DB, level[between], **sidebands)
    _stems(left, frequency[mesh], level[mesh], FLOOR_DB, BLUE, "mesh harmonics")
    left.set(xlim=(0, HIGHEST_KHZ), ylim=(FLOOR_DB, 60))
    _panel(left, "acceleration, one pinion tooth 5 % weaker", FREQUENCY, "dB re 1 m/s²")
    left.legend(fontsize=8, loc="upper right")
    percent = (100 * study.losses).tolist()
    right.semilogx(percent, study.levels_db, "o-", color=VERMILLION)
    loss = "loss of the tooth's pair stiffness in %"
    _panel(right, "sidebands over mesh harmonics, RMS", loss, "dB")
    right.set_xticks(percent, [f"{tick:g}" for tick in percent])
    right.set_xticks([], minor=True)
    return figure


def _draw_speed(results: StudyResults) -> Figure:
    """Draw time against error of substitution, new solution and simulation."""
    figure, study = _sheet(5.2), results.speed
    ax = figure.subplots()
    for index, way in enumerate(dict.fromkeys(cost.way for cost in study.costs)):
        costs = [c for c in study.costs if c.way == way and c.error > 0]
        errors, times = [c.error for c in costs], [MILLI * c.seconds for c in costs]
        label = f"simulation, SciPy {way}" if way in METHODS else way
        line = series_marker(index) + ("--" if way in METHODS else "-")
        ax.loglog(errors, times, line, color=series_colour(index), label=label)
        if way == MANY:
            for cost, time in zip(costs, times, strict=True):
                text, at = f"order {cost.setting}", (cost.error, 0.85 * time)
                ax.text(*at, text, ha="center", va="top", fontsize=7)
    ax.invert_xaxis()
    ax.legend(fontsize=8, loc="center left")
    ax.margins(y=0.12)
    how = f"median of {study.repeats} interleaved repeats ({study.machine})"
    error = "relative L2 error of the acceleration"
    _panel(ax, f"one set of parameters, {how}", error, "time in ms")
    return figure


def _drawing(picture: dict[str, Any]) -> Callable[[StudyResults], Figure]:
    kind, *arguments = picture.get("drawing", [picture["name"]])
    drawing: Callable[..., Figure] = globals()[f"_draw_{kind}"]
    return partial(drawing, *arguments)


#: By the name of the picture, in the order of study.toml.
DRAWINGS = {picture["name"]: _drawing(picture) for picture in study_table()["picture"]}
