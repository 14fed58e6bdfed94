"""Pictures of spectra: a strip a channel, the lines of the machine marked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.markers import TICKUP
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

from gearmon.diagnosis.results import Analysis
from gearmon.report import curves, plots, wording
from gearmon.signals.recording import Recording
from gearmon.signals.spectra.demodulation import Kurtogram
from gearmon.signatures.measured.line_plan import NEAR_SIDEBANDS, Family, Mark
from gearmon.signatures.measured.measurement import MeasuredSignature, MeshFinding
from gearmon.signatures.recording_spectrum import OrderSpectra, RecordingSpectrum
from gearmon.signatures.speed import SPEED_TOLERANCE

FloatArray = NDArray[np.float64]

# More channels than this get no readable strip each: the report says which are shown.
MOST_STRIPS = 8
# A close-up shows this many sidebands of the fastest shaft, and some air.
_CLOSE_UP_SPACINGS = NEAR_SIDEBANDS + 0.7
# It never reaches the neighbouring mesh harmonics.
_CLOSE_UP_MESHES = 0.6
# Where no mesh was found, a close-up shows twice the range that was searched.
_SEARCH_SHOWN = 2.0 * SPEED_TOLERANCE
# One line that vanished does not outweigh a whole row of sidebands that rose [std deviations].
_MOST_COUNTED = 6.0
# A picture shows at most so many decades below the highest line.
_DECADES = 6.0
# Marks of mesh harmonics that a spectrum as wide as the page bears with their names.
_MOST_MARKS = 32
# Marks nearer than this share of the axis cannot be told apart; width of a line of a label.
_LEAST_GAP, _LABEL_WIDTH = 0.012, 0.014
# Share of the page that axes usually take: on narrower ones a label takes a larger share.
_USUAL_WIDTH = 0.86
# Heights of strips in a report, of many and of few: two pictures of four channels, with their
# words, fit on a page [inch].
_REPORT_IN = (0.74, 1.2)
_AXES = {
    "frequency_hz": "Frequency (Hz)",
    "quefrency_s": "Quefrency (s)",
    "cyclic_frequency_hz": "Modulation frequency (Hz)",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Sidebands:
    """Sidebands of one spacing about a mesh harmonic.

    Parameters
    ----------
    name : str
        What repeats so: a shaft or a gear.
    place : ndarray of float, shape (lines,)
        In the unit of the axis.
    number : list of int
        How many spacings each is off the mesh harmonic.
    amplitude : ndarray of float, shape (channels, lines)
        Measured peak amplitudes, NaN of lines that were not detected.
    """

    name: str
    place: FloatArray
    number: list[int]
    amplitude: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Strips:
    """Spectra of channels over a common axis, with the lines of the machine.

    Parameters
    ----------
    names : sequence of str
        Of the channels.
    units : sequence of (str or None)
        Of their values.
    axis, what : str
        What the horizontal axis and the values are.
    place : ndarray of float, shape (points,)
    values : ndarray of float, shape (channels, points)
    marks : sequence of Mark
        Mesh and shaft harmonics.
    reach : float
        Half of the range about each mark that was searched, as a share of its place.
    sidebands : sequence of Sidebands
        In a close-up.
    linear : bool
        Whether the values stand on a linear scale.
    """

    names: Sequence[str]
    units: Sequence[str | None]
    axis: str
    what: str = "Peak amplitude"
    place: FloatArray
    values: FloatArray
    marks: Sequence[Mark]
    reach: float = 0.0
    sidebands: Sequence[Sidebands] = ()
    linear: bool = False


@plots.style()
def amplitude_figure(analysis: Analysis, recording: Recording) -> plots.Picture:
    """Draw the amplitude spectrum of every channel with the mesh harmonics of all stages.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    recording : Recording
        Its recording.

    Returns
    -------
    Picture
    """
    signature = analysis.signature
    vibration = curves.vibration_of(analysis, recording)
    spectrum, blocks = curves.time_spectrum(vibration.samples, vibration.sampling_rate_hz)
    nyquist = 0.5 * vibration.sampling_rate_hz
    high = min(nyquist, curves.last_harmonic_hz(signature))
    marks = [mark for mark in curves.mesh_marks(signature) if mark.place < 0.999 * high]
    if len(marks) > _MOST_MARKS:
        marks = _wide_apart(marks, high / _MOST_MARKS)
    place, values = spectrum.frequency_hz, spectrum.values
    strips = _strips(analysis, place, values, (2 * float(place[1]), high), marks)
    peaks = [
        {"name": name, "unit": unit, "value": own.max(), "hertz": strips.place[np.argmax(own)]}
        for name, unit, own in zip(strips.names, strips.units, strips.values, strict=True)
        if len(own)
    ]
    return _strips_figure(strips, _REPORT_IN).told(
        "spectrum",
        found=signature.found,
        tolerance=SPEED_TOLERANCE,
        blocks=blocks,
        resolution_hz=spectrum.resolution_hz,
        high_hz=high,
        nyquist_hz=nyquist,
        channels=len(strips.names),
        most=MOST_STRIPS,
        peaks=peaks,
    )


@plots.style()
def close_up_figure(
    analysis: Analysis, recording: Recording, mesh: MeshFinding
) -> plots.Picture | None:
    """Draw the surroundings of one mesh harmonic, or where it was looked for, in every channel.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    recording : Recording
        Its recording.
    mesh : MeshFinding
        The mesh. The harmonic is the one whose sidebands changed most, if a reference tells; else
        the strongest; the first where no mesh was found.

    Returns
    -------
    Picture or None
        None where the recording does not reach so high.
    """
    found = analysis.signature.found
    harmonic = close_up_harmonic(analysis, mesh.stage) if found else 1
    strips = (
        _sideband_strips(analysis, recording, mesh, harmonic)
        if found
        else _searched_strips(analysis, recording, mesh)
    )
    if not len(strips.place):
        return None
    changes = analysis.changes
    return _strips_figure(strips, _REPORT_IN).told(
        f"{'sidebands' if found else 'searched'}-mesh-{mesh.stage}",
        mesh=mesh,
        harmonic=harmonic,
        hertz=harmonic * mesh.frequency_hz,
        changed=any(c.stage == mesh.stage and c.kind == "sidebands" for c in changes),
        reach=NEAR_SIDEBANDS,
        channels=len(strips.names),
        most=MOST_STRIPS,
    )


@plots.style()
def spectrum_figure(found: RecordingSpectrum, ax: Sequence[Axes] = ()) -> Figure:
    """Draw a spectrum of any kind, a strip a channel; of a kurtogram a map a channel.

    Parameters
    ----------
    found : RecordingSpectrum
    ax : sequence of Axes
        Where to draw the first channels, in the place of a new figure.

    Returns
    -------
    Figure
        A new one, or that of the axes given.
    """
    if found.kurtograms:
        return _kurtogram_figure(found)
    strips = Strips(
        names=found.channel_names,
        units=found.units,
        axis=_AXES[found.axis],
        what=found.value_name[0].upper() + found.value_name[1:],
        place=found.place,
        values=found.values,
        marks=line_marks(found.marks, float(found.place[0]), float(found.place[-1])),
        linear=found.kind in ("cepstrum", "coherence"),
    )
    return _on_given(strips, ax) if ax else _strips_figure(strips)


@plots.style()
def order_figure(found: OrderSpectra, ax: Sequence[Axes] = ()) -> Figure:
    """Draw peak amplitudes against the orders of a shaft, a strip a channel.

    Parameters
    ----------
    found : OrderSpectra
    ax : sequence of Axes
        Where to draw the first channels, in the place of a new figure.

    Returns
    -------
    Figure
        A new one, or that of the axes given.
    """
    # the mean and what leaks from it are no lines
    order = found.order[2:]
    strips = Strips(
        names=found.channel_names,
        units=found.units,
        axis=order_axis(found),
        place=order,
        values=found.amplitude[:, 2:],
        marks=line_marks(found.marks, float(order[0]), float(order[-1])),
    )
    return _on_given(strips, ax) if ax else _strips_figure(strips)


def order_axis(found: OrderSpectra) -> str:
    """Return what the axis of orders counts."""
    return f"Order (cycles a turn of shaft {found.shaft})"


def _strips_figure(strips: Strips, heights_in: tuple[float, float] = (0.9, 1.5)) -> plots.Picture:
    """Draw one strip above the other with a common axis; `heights_in`: of many, of few strips."""
    count = min(len(strips.names), MOST_STRIPS)
    height = heights_in[0] if count > 3 else heights_in[1]
    # room above for a legend, or for the names of the lines, sideways
    top = 0.45 if strips.sidebands else 0.7 if strips.marks else 0.26
    figure, axes = plots.new_figure([height] * count, top_in=top, sharex=True)
    for channel, ax in enumerate(axes):
        ax.set_ylabel(_plot_strip(strips, channel, ax), fontsize=7)
    if len(set(strips.units)) == 1:
        # one scale shows which channel is loud and which is not
        lows, highs = zip(*(ax.get_ylim() for ax in axes), strict=True)
        for ax in axes:
            ax.set_ylim(min(lows), max(highs))
    if strips.sidebands:
        # the numbers of the sidebands of the widest spacing
        series, widest = max(enumerate(strips.sidebands), key=lambda own: np.ptp(own[1].place))
        for place, number in zip(widest.place, widest.number, strict=True):
            name = f"{number:+d}".replace("-", "−")
            plots.above(axes[0], place, name, 1.5, fontsize=6.5, color=plots.series_colour(series))
        plots.legend(figure, axes)
    else:
        label_marks(strips.marks, axes[0])
    axes[-1].set_xlabel(strips.axis)
    plots.left_label(figure, axes, strips.what)
    return figure


def _on_given(strips: Strips, axes: Sequence[Axes]) -> Figure:
    """Draw strips on axes of the caller's, who has made room for their letters."""
    for channel, ax in zip(range(len(strips.names)), axes, strict=False):
        label = _plot_strip(strips, channel, ax)
        ax.set_xlabel(strips.axis)
        size = ax.xaxis.label.get_fontsize()
        ax.set_ylabel(f"{strips.what}, {label}".replace("\n", " "), fontsize=size)
    return cast(Figure, axes[0].get_figure(root=True))


def _plot_strip(strips: Strips, channel: int, ax: Axes) -> str:
    """Draw the spectrum of a channel with its marks; return what its values are."""
    for mark in strips.marks:
        colour = _colour(mark)
        if strips.reach:
            low, high = mark.place * (1 - strips.reach), mark.place * (1 + strips.reach)
            ax.axvspan(low, high, color=colour, alpha=0.13, linewidth=0)
        ax.axvline(mark.place, color=colour, linewidth=0.8, linestyle=plots.DASHED, alpha=0.8)
    place, values = curves.max_hold(strips.place, strips.values[channel])
    ax.plot(place, values, color=plots.BLACK, linewidth=0.55)
    for series, own in enumerate(strips.sidebands):
        _plot_sidebands(own, channel, series, ax)
    if len(place) > 1:
        ax.set_xlim(place[0], place[-1])
    plots.light_grid(ax)
    name = strips.names[channel]
    if strips.linear:
        return wording.shortened(name, 12)
    detected = [own.amplitude[channel] for own in strips.sidebands]
    _decades(values, np.concatenate([values, *detected]), ax)
    return wording.strip_label(name, wording.unit_text(strips.units[channel]))


def _decades(values: FloatArray, everything: FloatArray, ax: Axes) -> None:
    """Show so many decades of a spectrum, and all that is drawn over it."""
    ax.set_yscale("log")
    shown = values[values > 0]
    if len(shown):
        high = float(np.nanmax(everything))
        low = max(float(np.percentile(shown, 1)) / 2, high * 10**-_DECADES)
        ax.set_ylim(low, 2.5 * high)
    ax.yaxis.set_major_locator(LogLocator(numticks=6))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter(
        FuncFormatter(lambda v, _: wording.power_of_ten(round(float(np.log10(v)))) if v > 0 else "")
    )


def _plot_sidebands(own: Sidebands, channel: int, series: int, ax: Axes) -> None:
    colour, detected = plots.series_colour(series), np.isfinite(own.amplitude[channel])
    places, sizes = own.place[detected], own.amplitude[channel, detected]
    open_ = {"markerfacecolor": "none", "markeredgewidth": 1.0, "label": f"sidebands of {own.name}"}
    plots.plot_marks(ax, places, sizes, plots.series_marker(series), 4.2, colour, **open_)
    # ticks at the bottom show every place, detected or not
    foot = {"transform": ax.get_xaxis_transform(), "clip_on": False}
    plots.plot_marks(ax, own.place, 0 * own.place, TICKUP, 4 if series % 2 else 6, colour, **foot)


def label_marks(marks: Sequence[Mark], ax: Axes) -> None:
    """Write the names of marks above the axes, sideways, each with a line to its place."""
    low, high = ax.get_xlim()
    share = [(mark.place - low) / (high - low) for mark in marks]
    labels = [curves.mark_label(mark) for mark in marks]
    widest = max((label.count("\n") + 1 for label in labels), default=1)
    narrow = min(1.0, ax.get_position().width / _USUAL_WIDTH)
    places = plots.spread(share, widest * _LABEL_WIDTH / narrow, 0.0, 1.0)
    up = 0.1 / (ax.get_position().height * ax.get_figure(root=True).get_figheight())  # type: ignore[union-attr]
    line: dict[str, Any] = {"transform": ax.transAxes, "color": plots.GREY, "linewidth": 0.4}
    text: dict[str, Any] = {"transform": ax.transAxes, "rotation": 90, "linespacing": 0.95}
    text |= {"ha": "center", "va": "bottom", "fontsize": 6.5}
    for mark, label, at, place in zip(marks, labels, share, places, strict=True):
        ax.plot([at, place], [1.0, 1.0 + up], clip_on=False, **line)
        ax.text(place, 1.0 + 1.2 * up, label, color=_colour(mark), **text)


def _colour(mark: Mark) -> str:
    """Meshes have the colour of their stage, shafts are grey."""
    return plots.series_colour(mark.number - 1) if mark.kind == "mesh" else plots.GREY


def line_marks(marks: Sequence[Mark], low: float, high: float) -> list[Mark]:
    """Return the marks that can be told apart on an axis: meshes first, then shafts."""
    inside = [mark for mark in marks if low <= mark.place <= high]
    return _wide_apart(inside, _LEAST_GAP * (high - low))


def _wide_apart(marks: Sequence[Mark], gap: float) -> list[Mark]:
    """Return the marks that stand so far from one another, those of a first mesh before others."""
    kept: list[Mark] = []
    for mark in sorted(marks, key=lambda mark: (mark.kind, mark.number * (mark.kind == "mesh"))):
        if all(abs(mark.place - other.place) >= gap for other in kept):
            kept.append(mark)
    return sorted(kept, key=lambda mark: mark.place)


def close_up_harmonic(analysis: Analysis, stage: int) -> int:
    """Return the mesh harmonic of a stage whose surroundings are worth a close look."""
    changed: dict[int, float] = {}
    for change in analysis.changes:
        if change.stage == stage and change.kind == "sidebands":
            size = min(abs(change.standardised), _MOST_COUNTED)
            changed[change.harmonic] = changed.get(change.harmonic, 0.0) + size
    if changed:
        return max(changed, key=lambda harmonic: changed[harmonic])
    level = analysis.signature.level_db.max(axis=0)
    strong = [
        (float(level[column]), family.harmonic)
        for column, family in enumerate(analysis.signature.plan.families)
        if family.kind == "mesh" and family.stage == stage
    ]
    return max(strong)[1] if strong else 1


def _searched_strips(analysis: Analysis, recording: Recording, mesh: MeshFinding) -> Strips:
    vibration = curves.vibration_of(analysis, recording)
    spectrum, _ = curves.time_spectrum(vibration.samples, vibration.sampling_rate_hz)
    mark = curves.mesh_marks(replace(analysis.signature, meshes=(mesh,)))[0]
    band = (mark.place * (1 - _SEARCH_SHOWN), mark.place * (1 + _SEARCH_SHOWN))
    return _strips(analysis, spectrum.frequency_hz, spectrum.values, band, [mark])


def _sideband_strips(
    analysis: Analysis, recording: Recording, mesh: MeshFinding, harmonic: int
) -> Strips:
    """Return the spectrum in angle about a mesh harmonic, with the sidebands of every spacing."""
    signature = analysis.signature
    speed = signature.speed.estimated_hz
    families = [
        family
        for family in signature.plan.families
        if family.kind == "sidebands" and family.stage == mesh.stage and family.harmonic == harmonic
    ]
    mesh_order = mesh.frequency_hz / speed
    spacing = max((family.spacing for family in families), default=1.0)
    half = min(_CLOSE_UP_SPACINGS * spacing, _CLOSE_UP_MESHES * mesh_order)
    centre = harmonic * mesh_order
    order, values = curves.angle_spectrum(analysis, recording, centre + half)
    band = (max(centre - half, 0.0) * speed, float(order[-1]) * speed)
    marks = [mark for mark in curves.mesh_marks(signature) if band[0] < mark.place < band[1]]
    return replace(
        _strips(analysis, speed * order, values, band, marks),
        axis="Frequency at the mean speed (Hz)",
        sidebands=_sidebands(signature, centre, families),
    )


def _sidebands(
    signature: MeasuredSignature, centre: float, families: Sequence[Family]
) -> list[Sidebands]:
    power, noise = signature.lines.cross_power(), signature.lines.noise
    amplitude = np.sqrt(np.where(power > noise, power, np.nan))
    names = wording.told_apart(
        [wording.shaft_text(family.shaft, family.gear) for family in families],
        [family.spacing for family in families],
    )
    result = []
    for name, family in zip(names, families, strict=True):
        lines = list(family.lines)
        orders = signature.plan.orders[lines]
        own = Sidebands(
            name=name,
            place=orders * signature.speed.estimated_hz,
            number=np.rint((orders - centre) / family.spacing).astype(int).tolist(),
            amplitude=amplitude[:, lines],
        )
        result.append(own)
    return result


def _strips(
    analysis: Analysis,
    place: FloatArray,
    values: FloatArray,
    band: tuple[float, float],
    marks: Sequence[Mark],
) -> Strips:
    inside = (place >= band[0]) & (place <= band[1])
    return Strips(
        names=analysis.signature.channel_names,
        units=analysis.signature.units,
        axis="Frequency (Hz)",
        place=place[inside],
        values=values[:, inside],
        marks=marks,
        reach=0.0 if analysis.signature.found else SPEED_TOLERANCE,
    )


def _kurtogram_figure(found: RecordingSpectrum) -> plots.Picture:
    shown = found.kurtograms[:MOST_STRIPS]
    figure, axes = plots.new_figure(
        [0.135 * len(own.bands) for own in shown],
        gap_in=0.55,
        right_in=0.85,
        left_in=1.0,
        many_colours=True,
    )
    for own, name, ax in zip(shown, found.channel_names, axes, strict=False):
        image = _plot_kurtogram(own, ax)
        low, high, top = own.best
        ax.set_title(
            f"{wording.shortened(name)}: most impulsive {low:.6g} to {high:.6g} Hz, K = {top:.3g}"
        )
        plots.colour_scale(figure, ax, image).set_label("Kurtosis")
    axes[-1].set_xlabel("Frequency (Hz)")
    plots.left_label(figure, axes, "Bandwidth (Hz)")
    return figure


def _plot_kurtogram(own: Kurtogram, ax: Axes) -> AxesImage:
    """Draw a row a bandwidth, the most impulsive band framed."""
    columns = min(int(np.lcm.reduce(own.bands)), 3 * max(own.bands))
    centres = (np.arange(columns) + 0.5) / columns
    grid = np.array(
        [
            level[np.minimum((centres * bands).astype(int), bands - 1)]
            for bands, level in zip(own.bands, own.kurtosis, strict=True)
        ]
    )
    rows = len(own.bands)
    image = ax.imshow(
        grid,
        aspect="auto",
        origin="upper",
        extent=(0.0, own.rate / 2, rows, 0.0),
        cmap="viridis",
        vmin=min(0.0, float(np.percentile(grid, 5))),
        vmax=max(float(grid.max()), 1e-3),
        interpolation="nearest",
    )
    low, high, _ = own.best
    row = int(np.argmax([float(level.max()) for level in own.kurtosis]))
    frame = Rectangle(
        (low, row), high - low, 1, fill=False, edgecolor=plots.VERMILLION, linewidth=1.4
    )
    ax.add_patch(frame).set_clip_on(False)
    widths = [own.rate / 2 / bands for bands in own.bands[::2]]
    ax.set_yticks(np.arange(rows)[::2] + 0.5, [f"{w:.0f}" if w > 1 else f"{w:.3g}" for w in widths])
    return image
