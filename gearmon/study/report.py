"""The study told: pictures, one HTML page that needs nothing else, and tables, in a folder.

study.toml names the pictures, says which figures of the study they stand for and how each is drawn.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from gearmon.arrays import FloatArray
from gearmon.benchmark.equations import VARIATION
from gearmon.files import made_folder, write_atomically
from gearmon.report import plots
from gearmon.report.wording import base64_text, rows_as_csv, template
from gearmon.study import experiments, pair
from gearmon.study.claims import COMPARABLE, LIMITS_HZ, STUDY, Evidence, Finding, Verdict, judge
from gearmon.study.experiments import Scan, StudyResults, Sweep, run_study
from gearmon.terminal import Progress, followed, part_of

#: Share of the time that computing takes; the rest is drawing.
COMPUTING_SHARE = 0.6
#: Of lines on a terminal.
WIDTH = 100

#: Name (of file and drawing), figures of the study that it stands for, title and caption of each.
PICTURES = STUDY["picture"]
#: Figure of the study -> the picture that stands for it.
FIGURES = {number: row for number in range(1, 37) for row in PICTURES if number in row["figures"]}

MICRO, MILLI = 1e6, 1e3
WIDTH_IN = 9.0
#: Highest frequency of the spectra shown [kHz]; every line above is weaker than those shown.
HIGHEST_KHZ = 25.0
HARMONICS_SHOWN = 50
FLOOR_DB = -40.0
Style = dict[str, Any]
#: What study.toml says of each.
Panels = Sequence[Sequence[Any]]
STYLES: dict[str, Style] = {
    key: {"color": plots.series_colour(i), "ls": "--" if key == "fourier-half" else "-"}
    for i, key in enumerate(pair.SIGNALS)
}
#: Quantity: field of a trajectory, factor to the shown unit, label.
QUANTITIES = {
    "displacement": ("displacement_m", MICRO, "displacement in µm"),
    "velocity": ("velocity_ms", MILLI, "velocity in mm/s"),
    "acceleration": ("acceleration_ms2", 1.0, "acceleration in m/s²"),
}
FREQUENCY, IN_TIME, IN_PHASE = "frequency in kHz", "time in ms", "mesh phase in mesh periods"
#: Part of a motion: which points, factor from seconds to the shown unit, label. The first mesh
#: period from rest dwarfs the later ones.
PARTS = {
    "first": (slice(pair.POINTS_PER_PERIOD + 1), MILLI, IN_TIME),
    "later": (slice(pair.POINTS_PER_PERIOD, None), MILLI, IN_TIME),
    "settled": (slice(None), 1 / pair.REFERENCE.period_s, IN_PHASE),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyReport:
    """What the study wrote.

    Attributes
    ----------
    judged : tuple of Finding
    page : Path
        The HTML page.
    files : tuple of Path
        Everything written, the page first.
    """

    judged: tuple[Finding, ...]
    page: Path
    files: tuple[Path, ...]

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        told, margin = [], " " * 23
        for entry in self.judged:
            head = f"{entry.claim.key:<4}{entry.verdict.upper():<19}{entry.claim.text}"
            told += textwrap.wrap(head, WIDTH, subsequent_indent=margin)
            told += textwrap.wrap(margin + entry.reason, WIDTH, subsequent_indent=margin)
        counts = ", ".join(f"{n} {verdict}" for verdict, n in _counts(self.judged).items())
        pictures = f"{len(PICTURES)} pictures for figures 1 to {max(FIGURES)}"
        told += ["", f"{len(self.judged)} claims: {counts}"]
        told += [f"{pictures}, and tables: {self.page.parent}", f"report: {self.page}"]
        return told

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "report": str(self.page),
            "files": [str(path) for path in self.files],
            "verdicts": _counts(self.judged),
            "claims": [
                {name: None if value != value else value for name, value in row.items()}
                for row in claim_rows(self.judged)
            ],
        }


def write_study(folder: str | Path, progress: Progress | None = None) -> StudyReport:
    """Compute the study, hold it against its claims, and write everything to a folder.

    Parameters
    ----------
    folder : str or Path
        Made if it does not exist. Gets ``study.html``, ``claims.csv``, ``sweeps.csv``,
        ``figures.csv`` and a PNG of each picture.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    StudyReport

    Raises
    ------
    ArgumentError
        If the folder cannot be made or written.

    Notes
    -----
    About half a minute: it integrates many equations of motion and measures run times.
    """
    target = made_folder(folder)
    results = run_study(part_of(progress, 0.0, COMPUTING_SHARE))
    return write_results(results, target, part_of(progress, COMPUTING_SHARE, 1 - COMPUTING_SHARE))


def write_results(results: StudyResults, folder: Path, progress: Progress | None) -> StudyReport:
    """Write a study that is computed already; see `write_study`."""
    judged = judge(results)
    pictures = [
        plots.save(draw_picture(picture, results), folder / f"{picture['name']}.png")
        for picture in followed(PICTURES, len(PICTURES), progress)
    ]
    tables = {
        "claims.csv": claim_rows(judged),
        "sweeps.csv": sweep_rows(results),
        "figures.csv": [
            {"figure": number, "picture": f"{row['name']}.png", "title": row["title"]}
            for number, row in FIGURES.items()
        ],
    }
    for name, rows in tables.items():
        write_atomically(folder / name, rows_as_csv(rows))
    page = folder / "study.html"
    told = template("study.html", "gearmon.study").render(
        number=shown_number,
        difference=shown_difference,
        problem=pair.REFERENCE,
        variation=VARIATION,
        judged=judged,
        counts=_counts(judged),
        index=FIGURES,
        pictures=zip(PICTURES, (base64_text(p.read_bytes()) for p in pictures), strict=True),
        results=results,
    )
    write_atomically(page, told)
    files = (page, *pictures, *(folder / name for name in tables))
    return StudyReport(judged=judged, page=page, files=files)


def _counts(judged: Sequence[Finding]) -> dict[str, int]:
    """Count the verdicts, in the order from reproduced to not checkable."""
    return {kind: sum(entry.verdict == kind for entry in judged) for kind in get_args(Verdict)}


def claim_rows(judged: Sequence[Finding]) -> list[dict[str, Any]]:
    """One row for every number behind every claim."""
    rows = []
    for entry in judged:
        claim = entry.claim
        head = {"claim": claim.key, "text": claim.text, "where": claim.where}
        head |= {"verdict": entry.verdict, "reason": entry.reason}
        for item in entry.evidence:
            agrees = None if item.expected is None else item.agrees
            rows.append(head | asdict(item) | {"difference": item.difference, "agrees": agrees})
    return rows


def sweep_rows(results: StudyResults) -> list[dict[str, Any]]:
    """One row for every value of every sweep."""
    return [
        {"parameter": sweep.name, "value": float(value)} | point.figures
        for sweep in results.sweeps.values()
        for value, point in zip(sweep.values, sweep.points, strict=True)
    ]


def shown_number(value: float | None) -> str:
    """Write a number to four digits.

    Examples
    --------
    >>> shown_number(276.19071), shown_number(None), shown_number(float("nan"))
    ('276.2', '', 'none')
    """
    if value is None:
        return ""
    if math.isnan(value):
        return "none"
    return f"{value:.4g}" if value == 0 or 1e-3 <= abs(value) < 1e5 else f"{value:.2e}"


def shown_difference(item: Evidence) -> str:
    """Write the difference of a number to the expected one."""
    if item.difference is None:
        return ""
    if item.expected == 0:
        return shown_number(item.difference)
    return "< 0.01 %" if abs(item.difference) < 5e-5 else f"{100 * item.difference:+.2f} %"


# Pictures.


def shades(count: int) -> list[tuple[float, float, float, float]]:
    """Return colours in the order of their values, dark to light and apart in grey print too."""
    # the light end of the map is too pale on white
    return [colormaps["viridis"](x) for x in np.linspace(0.0, 0.88, count)]


def decibels(amplitudes: ArrayLike, reference: float = 1.0) -> FloatArray:
    """Return 20 lg of amplitudes over the reference; zeros become -400 dB."""
    sizes = np.maximum(np.abs(np.asarray(amplitudes)), 1e-20 * reference)
    return np.asarray(20 * np.log10(sizes / reference))


def _sheet(height_in: float) -> Figure:
    return plots.Picture((WIDTH_IN, height_in))


def _panel(ax: Axes, title: str, x: str, y: str, **more: Any) -> Axes:
    """Give a panel its title, a light grid, and names with units to its axes."""
    plots.light_grid(ax, "both")
    ax.set(title=title, xlabel=x, ylabel=y, **more)
    return ax


def _stems(ax: Axes, x: FloatArray, y: FloatArray, floor: float, colour: str, name: str) -> None:
    """Draw lines of a spectrum from a floor up, with a point on top; those below are left out."""
    kept = (y > floor) & (x > 0) & (x <= HIGHEST_KHZ)
    ax.vlines(x[kept], floor, y[kept], color=colour, linewidth=1.0)
    plots.plot_marks(ax, x[kept], y[kept], "o", 2.2, colour, label=name)
    ax.set(xlim=(0, HIGHEST_KHZ), ylim=(floor, None))


# Forms of stiffness, the responses to them, and the orders.


def _draw_stiffness_forms(_results: StudyResults) -> Figure:
    figure, phase = _sheet(4.4), np.arange(4000) / 2000
    mean = 1e-9 * pair.REFERENCE.stiffness_n_per_m
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for ax, key in zip(axes.flat, pair.SIGNALS, strict=False):
        others = ("parabolic", "fourier-half") if key == "fourier" else ("parabolic",)
        for own in dict.fromkeys((*others, key)):
            signal = pair.SIGNALS[own]
            stiffness = mean * (1 + signal.modulation(phase))
            ax.plot(phase, stiffness, label=signal.label, **STYLES[own])
        time = "time in mesh periods (a pair enters contact at 0 and 1)"
        title = f"Fig. 1, {pair.SIGNALS[key].label}"
        _panel(ax, title, time, "mesh stiffness in GN/m", xlim=(0, 2), ylim=(0.64, 1.14)).legend()
        ax.label_outer()
    return figure


def _draw_stiffness_form_spectra(_results: StudyResults) -> Figure:
    """Draw the spectra of the forms together, and each by itself."""
    figure, floor, label = _sheet(6.2), -70.0, "dB re mean stiffness"
    grid = figure.add_gridspec(3, 2, height_ratios=(1.25, 1, 1))
    frequency = np.arange(1, HARMONICS_SHOWN + 1) / pair.REFERENCE.period_s / MILLI
    together = figure.add_subplot(grid[0, :])
    for index, (key, signal) in enumerate(pair.SIGNALS.items()):
        level = decibels(2 * VARIATION * signal.shape_harmonics(HARMONICS_SHOWN))
        colour, shown = plots.series_colour(index), np.where(level > floor, level, np.nan)
        named: Style = {"fillstyle": "none", "label": signal.label}
        marker = plots.series_marker(index)
        plots.plot_marks(together, frequency, shown, marker, 3.5, colour, **named)
        if key != "fourier-half":
            ax = figure.add_subplot(grid[1 + index // 2, index % 2], sharey=together)
            _stems(ax, frequency, level, floor, colour, "")
            _panel(ax, f"Fig. 3: {signal.label}", FREQUENCY, label)
    _panel(together, "Fig. 2: all forms together", FREQUENCY, label, ylim=(floor, -5))
    together.legend(ncols=3)
    return figure


def _draw_form_responses(results: StudyResults) -> Figure:
    """Draw displacement, velocity and acceleration from rest, under three forms."""
    figure, keys = _sheet(6.7), ("wave", "rectangular", "fourier")
    axes = figure.subplots(3, 3, sharex=True, sharey="row")
    for row, (name, scale, label) in enumerate(QUANTITIES.values()):
        largest = 0.0
        for column, (ax, key) in enumerate(zip(axes[row], keys, strict=True)):
            form = results.forms[key]
            simulated = scale * getattr(form.simulated, name)
            solved, time = scale * getattr(form.solved, name), MILLI * form.simulated.time_s
            # the last point belongs to the next mesh period
            ax.plot(time[:-1], simulated[:-1], lw=2, alpha=0.45, **STYLES[key])
            ax.plot(time[:-1], solved[:-1], color=plots.BLACK)
            largest = max(largest, np.abs(simulated[pair.LAST_PERIOD]).max())
            title = f"Fig. {4 + column}: {form.signal.label}" if row == 0 else ""
            _panel(ax, title, IN_TIME, label).label_outer()
        if row:  # the start begins far outside of what follows it
            axes[row, 0].set_ylim(-1.5 * largest, 1.5 * largest)
    axes[0, 0].legend(axes[0, 0].lines, ["direct integration", "multiple scales"])
    return figure


def _draw_mesh_force(results: StudyResults) -> Figure:
    """Draw the mesh force from rest and its lines."""
    figure = _sheet(5.1)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.35, 1))
    wide, near = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0])
    for key in ("rectangular", "fourier", "fourier-half"):
        motion = results.forms[key].simulated
        time, force = motion.time_s * MILLI, motion.mesh_force_n / MILLI
        wide.plot(time[:-1], force[:-1], label=pair.SIGNALS[key].label, **STYLES[key])
        near.plot(pair.PHASE, force[pair.LAST_PERIOD], **STYLES[key])
    for ax in (wide, near):
        ax.axhline(pair.REFERENCE.force_n / MILLI, color=plots.BLACK, lw=0.7)
    lines, steady = figure.add_subplot(grid[1, 1]), results.forms["fourier-half"].steady
    kept = slice(1, HARMONICS_SHOWN + 1)
    level = decibels(2 * np.abs(steady.mesh_force[kept]))
    _stems(lines, steady.frequency_hz[kept] / MILLI, level, 0.0, plots.ORANGE, "")
    return figure


def _draw_orders(results: StudyResults) -> Figure:
    """Draw the orders of the expansion beside the exact solution, and their errors."""
    study, figure, phase = results.orders, _sheet(5.7), np.arange(801) / 800
    ((together, error), (of_order, of_eps)) = figure.subplots(2, 2)
    exact = MICRO * results.reference.response.at(phase * pair.REFERENCE.period_s)
    sums = np.cumsum(study.expansion.terms, axis=0)
    for order, z in enumerate(sums[: pair.PUBLISHED_ORDER + 1]):
        curve = MICRO * (z[0].real + pair.series(z[1:])(phase))
        together.plot(phase, curve, color=plots.series_colour(order), label=f"order {order}")
        error.plot(phase, curve - exact, color=plots.series_colour(order))
    together.plot(phase, exact, color=plots.BLACK, ls="--", label="exact")
    error.axhline(0.0, color=plots.BLACK, linewidth=0.6)
    errors = {
        "displacement, largest error over largest value": study.displacement_errors,
        "acceleration, relative L2 error": study.acceleration_errors,
    }
    for index, (label, values) in enumerate(errors.items()):
        _marked(of_order, range(len(values)), values, index, label)
    of_order.axvspan(-0.3, pair.PUBLISHED_ORDER + 0.3, color=plots.LIGHT_GREY, alpha=0.5, lw=0)
    of_order.text(0.03, 0.05, "orders of the study", transform=of_order.transAxes)
    for order in range(pair.PUBLISHED_ORDER + 2):
        label = f"order {order}: slope {study.slopes[order]:.2f}"
        _marked(of_eps, experiments.VARIATIONS, study.errors_of_variation[:, order], order, label)
    of_order.set_yscale("log")
    of_eps.set(xscale="log", yscale="log")
    _ticks(of_eps, experiments.VARIATIONS)
    return figure


def _marked(ax: Axes, x: Any, y: Any, index: int, label: str, dashes: str = "-") -> None:
    """Draw a line with the colour and marker of its index."""
    marker, colour = plots.series_marker(index), plots.series_colour(index)
    ax.plot(x, y, marker + dashes, color=colour, markersize=4, label=label)


def _ticks(ax: Axes, places: Sequence[float]) -> None:
    """Give a logarithmic axis numbers at these places alone."""
    ax.set_xticks(places, [f"{place:g}" for place in places])
    ax.set_xticks([], minor=True)


# Sweeps.


def _by_value(sweep: Sweep) -> Iterator[tuple[pair.Operation, Style]]:
    """Yield the points of a sweep with colour and name of each value."""
    colours = shades(len(sweep.points))
    for point, name, colour in zip(sweep.points, sweep.shown, colours, strict=True):
        yield point, {"color": colour, "label": name}


def _draw_over_time(name: str, height: float, rows: list[Panels], results: StudyResults) -> Figure:
    """Draw rows of panels: quantity, part of the time, title, and limits of the time if any."""
    figure = _sheet(height)
    grid = figure.add_gridspec(len(rows), 1)
    for number, row in enumerate(rows):
        widths = [1.0 if when == "first" else 2.2 for _, when, *_ in row]
        cells = grid[number].subgridspec(1, len(row), width_ratios=widths)
        for column, (quantity, when, title, *limits) in enumerate(row):
            ax = figure.add_subplot(cells[column])
            (field, scale, label), (part, per_second, time) = QUANTITIES[quantity], PARTS[when]
            for point, style in _by_value(results.sweeps[name]):
                motion = point.waveform if when == "settled" else point.start
                values = scale * getattr(motion, field)[part]
                ax.plot(per_second * motion.time_s[part], values, **style)
            _panel(ax, title, time, label).margins(x=0)
            ax.set_xlim(*limits)
    plots.legend(figure, figure.axes, 1, "right upper")
    return figure


def _draw_spectra(name: str, height: float, panels: Panels, results: StudyResults) -> Figure:
    """Draw the odd harmonics of all values joined to guide the eye, the even ones as points."""
    figure = _sheet(height)
    axes = figure.subplots(len(panels), 1)
    for ax, (kind, mode, scale, title, label, *limits) in zip(axes, panels, strict=True):
        for point, style in _by_value(results.sweeps[name]):
            response = point.response
            energy, frequency = kind == "energy", response.frequency_hz / MILLI
            lines = response.energy_lines if energy else 2 * np.abs(getattr(response, kind))
            shown = scale * lines
            if mode == "level":
                shown = decibels(lines, scale) * (0.5 if energy else 1.0)
            shown = np.where(frequency <= HIGHEST_KHZ, shown, np.nan)
            ax.plot(frequency[1::2], shown[1::2], "o-", markersize=2.5, **style)
            ax.plot(frequency[2::2], shown[2::2], ".", markersize=2.5, color=style["color"])
        low, high = (*limits, None, None)[:2]
        _panel(ax, title, FREQUENCY, label, xlim=(0, HIGHEST_KHZ), ylim=(low, high))
    plots.legend(figure, axes, 1, "right upper")
    return figure


def _draw_energy_of_reference(results: StudyResults) -> Figure:
    """Draw the energy lines of the reference case, and what a harvester takes from each."""
    figure, response, power = _sheet(5.4), results.reference.response, results.harvested_w
    upper, lower = figure.subplots(2, 1, sharex=True)
    frequency, energy = response.frequency_hz / MILLI, MICRO * response.energy_lines
    third, best = COMPARABLE * energy.max(), int(energy.argmax())
    _stems(upper, frequency, energy, 0.0, plots.BLUE, "")
    upper.axhline(third, color=plots.GREY, ls="--")
    upper.text(HIGHEST_KHZ, third, "a third of the best ", ha="right", va="bottom")
    text = f"best: {MILLI * frequency[best]:.0f} Hz, {energy[best]:.1f} µJ/kg"
    upper.text(frequency[best], 1.03 * energy[best], text, ha="center")
    for text, limit in LIMITS_HZ.items():
        upper.axvline(limit / MILLI, color=plots.VERMILLION, ls=":")
        upper.text(limit / MILLI + 0.1, 1.18 * energy.max(), text, color=plots.VERMILLION)
    upper.set_ylim(0, 1.28 * energy.max())
    _stems(lower, frequency[1 : len(power) + 1], MILLI * power, 0.0, plots.VERMILLION, "")
    return figure


def _draw_contact(results: StudyResults) -> Figure:
    """Draw where contact would be lost."""
    study, figure = results.contact, _sheet(6.1)
    ((of_mass, of_damping), (of_variation, both)) = figure.subplots(2, 2)
    _least_force(of_mass, study.mass)
    _least_force(of_damping, study.damping, MILLI)
    _least_force(of_variation, study.variation)
    of_mass.axvspan(0.2, 3.0, color=plots.LIGHT_GREY, alpha=0.6, lw=0)
    of_mass.text(0.23, -1.9, "masses of\nthe study")
    masses, dampings, shown = study.map_masses_kg, study.map_dampings / MILLI, study.of_both
    shown, norm = np.maximum(shown, -1.0), TwoSlopeNorm(0.0, -1.0, 1.0)
    image = both.pcolormesh(masses, dampings, shown, cmap="RdBu", norm=norm, shading="gouraud")
    both.contour(masses, dampings, shown, levels=[0.0], colors=plots.BLACK)
    reference = pair.REFERENCE.mass_kg, pair.REFERENCE.damping_ns_per_m / MILLI
    both.plot(*reference, "*", color=plots.BLACK, markersize=10)
    figure.colorbar(image, ax=both, extend="min").set_label("least mesh force over F")
    both.set_yscale("log")
    for ax in (of_mass, of_damping, both):
        ax.set_xscale("log")
    return figure


def _least_force(ax: Axes, scan: Scan, scale: float = 1.0) -> None:
    x, bottom = scan.values / scale, max(-3.0, float(np.min(scan.least_force)) - 0.1)
    shown = np.maximum(scan.least_force, bottom)
    ax.plot(x, shown, color=plots.BLUE)
    ax.fill_between(x, np.minimum(shown, 0), 0, color=plots.VERMILLION, alpha=0.25, lw=0)
    ax.axhline(0.0, color=plots.BLACK, linewidth=0.6)
    if scan.first is not None:
        at = scan.first / scale
        ax.plot(at, 0, "o", color=plots.VERMILLION, markersize=4)
        ax.text(at, -0.02, f"{at:.3g} ", color=plots.VERMILLION, ha="right", va="top")
    ax.set_ylim(min(bottom, -0.05), 1.0)


def _draw_damage(results: StudyResults) -> Figure:
    """Draw the lines of a pair with one weak tooth, and the level of its sidebands."""
    study, figure = results.damage, _sheet(3.2)
    left, right = figure.subplots(1, 2, width_ratios=(1.8, 1))
    response = study.responses[experiments.LOSSES.index(0.05)]
    frequency, level = response.frequency_hz / MILLI, decibels(2 * np.abs(response.acceleration))
    mesh = np.arange(len(level)) % pair.PINION_TEETH == 0
    between = ~mesh & (level > FLOOR_DB) & (frequency <= HIGHEST_KHZ)
    sidebands: Style = {"color": plots.VERMILLION, "lw": 0.5, "label": "sidebands"}
    left.vlines(frequency[between], FLOOR_DB, level[between], **sidebands)
    _stems(left, frequency[mesh], level[mesh], FLOOR_DB, plots.BLUE, "mesh harmonics")
    left.set_ylim(FLOOR_DB, 60)
    percent = [100 * loss for loss in experiments.LOSSES]
    right.semilogx(percent, study.levels_db, "o-", color=plots.VERMILLION)
    _ticks(right, percent)
    return figure


def _draw_speed(results: StudyResults) -> Figure:
    """Draw time against error of substitution, new solution and simulation."""
    figure, study = _sheet(4.3), results.speed
    ax = figure.subplots()
    for index, way in enumerate(dict.fromkeys(cost["method"] for cost in study.costs)):
        costs = [c for c in study.costs if c["method"] == way and c["error"] > 0]
        errors, times = [c["error"] for c in costs], [MILLI * c["median_s"] for c in costs]
        simulated = way in experiments.METHODS
        label, dashes = (f"simulation, SciPy {way}", "--") if simulated else (way, "-")
        _marked(ax, errors, times, index, label, dashes)
        for cost in costs if way == experiments.MANY else ():
            text, at = f"order {cost['setting']}", (cost["error"], 850 * cost["median_s"])
            ax.text(*at, text, ha="center", va="top")
    how = f"median of {study.repeats} interleaved repeats ({study.machine})"
    error = "relative L2 error of the acceleration"
    _panel(ax, f"one set of parameters, {how}", error, "time in ms", xscale="log", yscale="log")
    ax.legend(loc="lower right")
    ax.invert_xaxis()
    ax.margins(y=0.12)
    return figure


@plots.style()
def draw_picture(picture: dict[str, Any], results: StudyResults) -> Figure:
    """Draw one of `PICTURES` by the function that it names."""
    kind, *arguments = picture.get("drawing", [picture["name"]])
    figure: Figure = globals()[f"_draw_{kind}"](*arguments, results)
    for ax, words in zip(figure.axes, picture.get("panels", ()), strict=False):
        _panel(ax, *words)
        if plots.named_handles([ax]):
            ax.legend()
    return figure
