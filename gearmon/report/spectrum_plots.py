"""Pictures of spectra: a strip a channel, the lines of the machine marked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import TICKUP
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, NullLocator

from gearmon.arrays import FloatArray
from gearmon.diagnosis.results import Analysis
from gearmon.report import curves, plots, wording
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.line_plan import NEAR_SIDEBANDS, Family, Mark
from gearmon.signatures.measured.measurement import MeasuredSignature, MeshFinding
from gearmon.signatures.recording_spectrum import OrderSpectra, RecordingSpectrum
from gearmon.signatures.tracking import SPEED_TOLERANCE

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
# Share of the page that axes take before their letters are known; on narrower ones a label takes a
# larger share.
_USUAL_WIDTH = 0.775
# Heights of strips in a report, of many and of few: two pictures of four channels, with their
# words, fit on a page [inch].
_REPORT_IN = (0.74, 1.2)
_AXES = {
    "frequency_hz": "Frequency (Hz)",
    "quefrency_s": "Quefrency (s)",
}


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
    named : bool
        Whether the marks are named above the first strip.
    linear : bool
        Whether the values stand on a linear scale.
    """

    names: Sequence[str]
    units: Sequence[str | None]
    axis: str = "Frequency (Hz)"
    what: str = "Peak amplitude"
    place: FloatArray
    values: FloatArray
    marks: Sequence[Mark]
    reach: float = 0.0
    named: bool = True
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
    place, values = spectrum.frequency_hz, spectrum.values
    strips = _strips(analysis, place, values, (2 * float(place[1]), high))
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
    signature, speed_hz = analysis.signature, analysis.signature.speed.estimated_hz
    harmonic, families = 1, list[Family]()
    look: dict[str, Any] = {}
    if signature.found:
        harmonic = close_up_harmonic(analysis, mesh.stage)
        wanted = ("sidebands", mesh.stage, harmonic)
        every = signature.plan.families
        families = [own for own in every if (own.kind, own.stage, own.harmonic) == wanted]
        # sampled at equal angles: a wandering speed smears no line
        mesh_order = mesh.frequency_hz / speed_hz
        spacing = max((family.spacing for family in families), default=1.0)
        half = min(_CLOSE_UP_SPACINGS * spacing, _CLOSE_UP_MESHES * mesh_order)
        low = max(harmonic * mesh_order - half, 0.0)
        order, values = curves.angle_spectrum(analysis, recording, harmonic * mesh_order + half)
        place, band = speed_hz * order, (low * speed_hz, float(order[-1]) * speed_hz)
        look = {"axis": "Frequency at the mean speed (Hz)", "named": False}
    else:
        # the spectrum about the place where the mesh was looked for
        vibration = curves.vibration_of(analysis, recording)
        spectrum, _ = curves.time_spectrum(vibration.samples, vibration.sampling_rate_hz)
        place, values = spectrum.frequency_hz, spectrum.values
        at = curves.mesh_marks(replace(signature, meshes=(mesh,)))[0].place
        band = (at * (1 - _SEARCH_SHOWN), at * (1 + _SEARCH_SHOWN))
    strips, hertz = _strips(analysis, place, values, band, **look), harmonic * mesh.frequency_hz
    if not len(strips.place):
        return None
    figure = _strips_figure(strips, _REPORT_IN)
    _plot_sidebands(signature, hertz, families, figure)
    return figure.told(
        f"{'sidebands' if signature.found else 'searched'}-mesh-{mesh.stage}",
        mesh=mesh,
        harmonic=harmonic,
        hertz=hertz,
        changed=any(c.stage == mesh.stage and c.kind == "sidebands" for c in analysis.changes),
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
    what = found.value_name[0].upper() + found.value_name[1:]
    return _recorded(found, 0, _AXES[found.axis], ax, what=what, linear=found.kind == "cepstrum")


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
    return _recorded(found, 2, order_axis(found), ax)


def _recorded(
    found: RecordingSpectrum | OrderSpectra, first: int, axis: str, ax: Sequence[Axes], **look: Any
) -> plots.Picture:
    """Draw what a recording holds, from the first place on, with the lines of the machine."""
    place = found.place[first:]
    strips = Strips(
        names=found.channel_names,
        units=found.units,
        axis=axis,
        place=place,
        values=found.values[:, first:],
        marks=line_marks(found.marks, float(place[0]), float(place[-1])),
        **look,
    )
    return _strips_figure(strips, given=ax)


def order_axis(found: OrderSpectra) -> str:
    """Return what the axis of orders counts."""
    return f"Order (cycles a turn of shaft {found.shaft})"


def _strips_figure(
    strips: Strips, heights_in: tuple[float, float] = (0.9, 1.5), given: Sequence[Axes] = ()
) -> plots.Picture:
    """Draw one strip above the other with a common axis, or on axes of the caller's.

    `heights_in`: of many, of few strips.
    """
    if given:
        # the caller has made room for their letters
        for channel, ax in zip(range(len(strips.names)), given, strict=False):
            label = _plot_strip(strips, channel, ax)
            ax.set_xlabel(strips.axis)
            size = ax.xaxis.label.get_fontsize()
            ax.set_ylabel(f"{strips.what}, {label}".replace("\n", " "), fontsize=size)
        return cast(plots.Picture, given[0].get_figure(root=True))
    count = min(len(strips.names), MOST_STRIPS)
    # room above for the names of the lines, sideways
    room = 1.1 if strips.marks and strips.named else 0.75
    heights = [heights_in[0] if count > 3 else heights_in[1]] * count
    figure, axes = plots.stack(heights, room_in=room, sharex=True)
    for channel, ax in enumerate(axes):
        ax.set_ylabel(_plot_strip(strips, channel, ax), fontsize=7)
    if len(set(strips.units)) == 1:
        # one scale shows which channel is loud and which is not
        lows, highs = zip(*(ax.get_ylim() for ax in axes), strict=True)
        for ax in axes:
            ax.set_ylim(min(lows), max(highs))
    if strips.named:
        label_marks(strips.marks, axes[0])
    axes[-1].set_xlabel(strips.axis)
    figure.supylabel(strips.what, fontsize=7.5)
    return figure


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
    if len(place) > 1:
        ax.set_xlim(place[0], place[-1])
    plots.light_grid(ax)
    name = strips.names[channel]
    if strips.linear:
        return wording.shortened(name, 12)
    ax.set_yscale("log")
    shown = values[values > 0]
    if len(shown):
        high = float(np.nanmax(values))
        low = max(float(np.percentile(shown, 1)) / 2, high * 10**-_DECADES)
        ax.set_ylim(low, 2.5 * high)
    ax.yaxis.set_major_locator(LogLocator(numticks=6))
    ax.yaxis.set_minor_locator(NullLocator())
    return wording.strip_label(name, wording.unit_text(strips.units[channel]))


def label_marks(marks: Sequence[Mark], ax: Axes) -> None:
    """Write the names of marks above the axes, sideways, each with a line to its place."""
    low, high = ax.get_xlim()
    share = [(mark.place - low) / (high - low) for mark in marks]
    labels = [curves.mark_label(mark) for mark in marks]
    widest = max((label.count("\n") + 1 for label in labels), default=1)
    narrow = min(1.0, ax.get_position().width / _USUAL_WIDTH)
    places = plots.spread(share, widest * _LABEL_WIDTH / narrow, 0.0, 1.0)
    line = {"arrowstyle": "-", "color": plots.GREY, "linewidth": 0.4, "shrinkA": 0, "shrinkB": 0}
    how: dict[str, Any] = {"rotation": 90, "linespacing": 0.95, "fontsize": 6.5}
    how |= {"xycoords": "axes fraction", "textcoords": ("axes fraction", "offset points")}
    how |= {"ha": "center", "va": "bottom", "arrowprops": line | {"relpos": (0.5, 0)}}
    for mark, label, at, place in zip(marks, labels, share, places, strict=True):
        ax.annotate(label, (at, 1.0), (place, 8), color=_colour(mark), **how)


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


def _plot_sidebands(
    signature: MeasuredSignature, hertz: float, families: Sequence[Family], figure: plots.Picture
) -> None:
    """Mark the sidebands of every spacing about a mesh harmonic in the strips of a figure."""
    power, noise = signature.lines.cross_power(), signature.lines.noise
    amplitude = np.sqrt(np.where(power > noise, power, np.nan))
    shafts = [wording.shaft_text(family.shaft, family.gear) for family in families]
    names = wording.told_apart(shafts, [family.spacing for family in families])
    widest, axes = max((family.spacing for family in families), default=0.0), figure.axes
    for series, (name, family) in enumerate(zip(names, families, strict=True)):
        lines, colour = list(family.lines), plots.series_colour(series)
        place = signature.plan.orders[lines] * signature.speed.estimated_hz
        for ax, size in zip(axes, amplitude[:, lines], strict=False):
            marker = plots.series_marker(series)
            label = f"sidebands of {name}"
            open_ = {"markerfacecolor": "none", "markeredgewidth": 1.0, "label": label}
            known = np.isfinite(size)
            plots.plot_marks(ax, place[known], size[known], marker, 4.2, colour, **open_)
            # ticks at the bottom show every place, detected or not
            foot = {"transform": ax.get_xaxis_transform(), "clip_on": False}
            height = 4 if series % 2 else 6
            plots.plot_marks(ax, place, 0 * place, TICKUP, height, colour, **foot)
        if family.spacing == widest:
            spacing_hz = family.spacing * signature.speed.estimated_hz
            for number, at in zip(np.rint((place - hertz) / spacing_hz), place, strict=True):
                text = f"{number:+.0f}".replace("-", "−")
                plots.above(axes[0], at, text, 1.5, fontsize=6.5, color=colour)
    if families:
        plots.legend(figure, axes)


def _strips(
    analysis: Analysis,
    place: FloatArray,
    values: FloatArray,
    band: tuple[float, float],
    **look: Any,
) -> Strips:
    """Return what lies in a band [Hz], with the mesh harmonics that it has room for."""
    signature, (low, high) = analysis.signature, band
    inside = (place >= low) & (place <= high)
    marks = [mark for mark in curves.mesh_marks(signature) if low < mark.place < high]
    if len(marks) > _MOST_MARKS:
        marks = _wide_apart(marks, (high - low) / _MOST_MARKS)
    return Strips(
        names=signature.channel_names,
        units=signature.units,
        place=place[inside],
        values=values[:, inside],
        marks=marks,
        reach=0.0 if signature.found else SPEED_TOLERANCE,
        **look,
    )


def _kurtogram_figure(found: RecordingSpectrum) -> plots.Picture:
    shown = found.kurtograms[:MOST_STRIPS]
    heights = [0.55 + 0.135 * len(own.bands) for own in shown]
    figure, axes = plots.stack(heights, room_in=0.2)
    for own, channel, ax in zip(shown, found.channel_names, axes, strict=False):
        # a row a bandwidth; the quietest bands set the lowest colour, but for a few
        values, nyquist = np.concatenate(own.kurtosis), own.rate / 2
        ends = {"vmin": min(0.0, float(np.percentile(values, 5))), "vmax": max(values.max(), 1e-3)}
        for row, (bands, level) in enumerate(zip(own.bands, own.kurtosis, strict=True)):
            edges = np.linspace(0.0, nyquist, bands + 1)
            image = ax.pcolormesh(edges, [row, row + 1], level[None], cmap="viridis", **ends)
        figure.colorbar(image, ax=ax, label="Kurtosis", aspect=15)
        ax.invert_yaxis()
        # the most impulsive band is framed
        low, high, top = own.best
        row = int(np.argmax([float(level.max()) for level in own.kurtosis]))
        look: dict[str, Any] = {"fill": False, "edgecolor": plots.VERMILLION, "linewidth": 1.4}
        ax.add_patch(Rectangle((low, row), high - low, 1, **look)).set_clip_on(False)
        widths = [nyquist / bands for bands in own.bands[::2]]
        names = [f"{w:.0f}" if w > 1 else f"{w:.3g}" for w in widths]
        ax.set_yticks(np.arange(len(own.bands))[::2] + 0.5, names)
        band = f"{low:.6g} to {high:.6g} Hz"
        ax.set_title(f"{wording.shortened(channel)}: most impulsive {band}, K = {top:.3g}")
    axes[-1].set_xlabel("Frequency (Hz)")
    figure.supylabel("Bandwidth (Hz)", fontsize=7.5)
    return figure
