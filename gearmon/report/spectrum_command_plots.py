"""The picture of `gearmon spectrum`: a strip a channel, the lines of the machine marked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage

from gearmon.files import write_atomically
from gearmon.report.curves import max_hold
from gearmon.report.palette import BLACK, GREY, VERMILLION, series_colour
from gearmon.report.plots import as_png, left_label, light_grid, new_figure, spread, style
from gearmon.report.plots_spectrum import plot_spectrum
from gearmon.report.views import LineMark, SpectrumView
from gearmon.report.wording import shortened, strip_label, unit_text
from gearmon.signals.kurtogram import Kurtogram
from gearmon.signatures.line_marks import Mark
from gearmon.signatures.recording_spectrum import RecordingSpectrum

# More channels than this get no readable strip each.
MOST_STRIPS = 8
# Marks nearer than this share of the axis cannot be told apart; width of a line of a label.
LEAST_GAP, _LABEL_WIDTH = 0.012, 0.014
_AXES = {
    "frequency_hz": "Frequency (Hz)",
    "quefrency_s": "Quefrency (s)",
    "cyclic_frequency_hz": "Modulation frequency (Hz)",
}


def save_spectrum_picture(found: RecordingSpectrum, path: Path) -> Path:
    """Draw a spectrum and write the picture.

    Parameters
    ----------
    found : RecordingSpectrum
    path : Path
        Name of the PNG.

    Returns
    -------
    Path
        `path`.
    """
    with style():
        png = _kurtograms(found) if found.kurtograms else _strips(found)
    write_atomically(path, png)
    return path


def line_marks(marks: tuple[Mark, ...], low: float, high: float) -> tuple[LineMark, ...]:
    """Return the marks that can be told apart on an axis: meshes first, then shafts.

    Meshes have the colour of their stage, shafts are grey.
    """
    kept: list[Mark] = []
    for kind in ("mesh", "shaft"):
        for mark in marks:
            apart = all(abs(mark.place - other.place) >= LEAST_GAP * (high - low) for other in kept)
            if mark.kind == kind and low <= mark.place <= high and apart:
                kept.append(mark)
    return tuple(
        LineMark(
            frequency_hz=mark.place,
            label=mark.name.replace("mesh ", "GMF").replace(" = ", "\n"),
            series=mark.number - 1 if mark.kind == "mesh" else 7,
        )
        for mark in sorted(kept, key=lambda mark: mark.place)
    )


def label_marks(marks: tuple[LineMark, ...], ax: Axes) -> None:
    """Write the names of marks above the axes, sideways, each with a line to its place."""
    low, high = ax.get_xlim()
    share = [(mark.frequency_hz - low) / (high - low) for mark in marks]
    widest = max((mark.label.count("\n") + 1 for mark in marks), default=1)
    places = spread(share, widest * _LABEL_WIDTH, 0.0, 1.0)
    up = 0.1 / (ax.get_position().height * ax.get_figure(root=True).get_figheight())  # type: ignore[union-attr]
    for mark, at, place in zip(marks, share, places, strict=True):
        ax.plot(
            [at, place],
            [1.0, 1.0 + up],
            transform=ax.transAxes,
            color=GREY,
            linewidth=0.4,
            clip_on=False,
        )
        ax.text(
            place,
            1.0 + 1.2 * up,
            mark.label,
            transform=ax.transAxes,
            rotation=90,
            linespacing=0.95,
            ha="center",
            va="bottom",
            fontsize=6.5,
            color=series_colour(mark.series),
        )


def _strips(found: RecordingSpectrum) -> bytes:
    names = found.channel_names[:MOST_STRIPS]
    height = 0.9 if len(names) > 3 else 1.5
    marks = line_marks(found.marks, float(found.place[0]), float(found.place[-1]))
    top = 0.72 if marks else 0.26
    figure, axes = new_figure([height] * len(names), top_in=top, sharex=True)
    for row, (name, ax) in enumerate(zip(names, axes, strict=True)):
        view = _view(found, row, name, marks)
        if found.kind in ("cepstrum", "coherence"):
            _linear(view, ax)
        else:
            plot_spectrum(view, ax)
    if marks:
        label_marks(marks, axes[0])
    axes[-1].set_xlabel(_AXES[found.axis])
    left_label(figure, axes, found.value_name[0].upper() + found.value_name[1:])
    _common_scale(found, axes)
    return as_png(figure)


def _common_scale(found: RecordingSpectrum, axes: list[Axes]) -> None:
    """One scale for channels of one unit shows which is loud."""
    if len(set(found.units)) > 1:
        return
    limits = [ax.get_ylim() for ax in axes]
    for ax in axes:
        ax.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))


def _view(
    found: RecordingSpectrum, row: int, name: str, marks: tuple[LineMark, ...]
) -> SpectrumView:
    x, y = max_hold(found.place, found.values[row])
    return SpectrumView(
        channel=name,
        unit=_unit(found.units[row]),
        axis=_AXES[found.axis],
        frequency_hz=x,
        amplitude=y,
        meshes=marks,
    )


def _unit(unit: str) -> str:
    if unit == "1":
        return "1"
    return unit_text(unit or None).replace(")^2", ")²")


def _linear(view: SpectrumView, ax: Axes) -> None:
    for mark in view.meshes:
        ax.axvline(
            mark.frequency_hz,
            color=series_colour(mark.series),
            linewidth=0.7,
            linestyle=(0, (4, 2)),
        )
    ax.plot(view.frequency_hz, view.amplitude, color=BLACK, linewidth=0.55)
    if len(view.frequency_hz) > 1:
        ax.set_xlim(view.frequency_hz[0], view.frequency_hz[-1])
    light_grid(ax)
    ax.set_ylabel(strip_label(view.channel, "").splitlines()[0], fontsize=7)


def _kurtograms(found: RecordingSpectrum) -> bytes:
    count = min(MOST_STRIPS, len(found.kurtograms))
    heights = [0.135 * len(own.bands) for own in found.kurtograms[:count]]
    figure, axes = new_figure(heights, gap_in=0.55, right_in=0.85, left_in=1.0)
    for own, name, ax in zip(found.kurtograms, found.channel_names, axes, strict=False):
        image = plot_kurtogram(own, ax)
        low, high, top = own.best
        ax.set_title(f"{shortened(name)}: most impulsive {low:.6g} to {high:.6g} Hz, K = {top:.3g}")
        place = ax.get_position()
        scale = figure.add_axes((place.x1 + 0.015, place.y0, 0.014, place.height))
        figure.colorbar(image, cax=scale).set_label("Kurtosis")
    axes[-1].set_xlabel("Frequency (Hz)")
    left_label(figure, axes, "Bandwidth (Hz)")
    return as_png(figure, many_colours=True)


def plot_kurtogram(own: Kurtogram, ax: Axes) -> AxesImage:
    """Draw a kurtogram: a row a bandwidth, the most impulsive band framed."""
    columns = int(np.lcm.reduce(own.bands))
    columns = min(columns, 3 * max(own.bands))
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
    ax.plot(
        [low, high, high, low, low],
        [row, row, row + 1, row + 1, row],
        color=VERMILLION,
        linewidth=1.4,
        clip_on=False,
    )
    ax.set_yticks(np.arange(rows)[::2] + 0.5)
    ax.set_yticklabels(
        [
            f"{own.rate / 2 / bands:.0f}" if own.rate > 2 * bands else f"{own.rate / 2 / bands:.3g}"
            for bands in own.bands[::2]
        ]
    )
    return image
