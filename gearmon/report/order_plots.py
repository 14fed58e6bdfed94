"""The picture of `gearmon orders`: a spectrum or a map against the orders of a shaft."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.image import AxesImage

from gearmon.files import write_atomically
from gearmon.report.curves import max_hold
from gearmon.report.plots import as_png, left_label, new_figure, style
from gearmon.report.plots_spectrum import plot_spectrum
from gearmon.report.spectrum_command_plots import MOST_STRIPS, label_marks, line_marks
from gearmon.report.views import LineMark, SpectrumView
from gearmon.report.wording import shortened, unit_text
from gearmon.signatures.order_spectra import OrderSpectra

# Columns of a map: more than a page shows.
_COLUMNS = 900
_DECADES = 4.0


def save_order_picture(found: OrderSpectra, path: Path, *, as_map: bool) -> Path:
    """Draw order spectra or an order map and write the picture.

    Parameters
    ----------
    found : OrderSpectra
    path : Path
        Name of the PNG.
    as_map : bool
        Whether to draw along the recording.

    Returns
    -------
    Path
        `path`.
    """
    with style():
        png = _maps(found) if as_map else _strips(found)
    write_atomically(path, png)
    return path


def _strips(found: OrderSpectra) -> bytes:
    marks = line_marks(found.marks, float(found.order[2]), float(found.order[-1]))
    names = found.channel_names[:MOST_STRIPS]
    height = 0.9 if len(names) > 3 else 1.5
    figure, axes = new_figure([height] * len(names), top_in=0.72, sharex=True)
    for row, ax in enumerate(axes):
        plot_spectrum(_view(found, row, marks), ax)
    if len(set(found.units)) == 1:
        limits = [ax.get_ylim() for ax in axes]
        for ax in axes:
            ax.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
    label_marks(marks, axes[0])
    axes[-1].set_xlabel(_axis(found))
    left_label(figure, axes, "Peak amplitude")
    return as_png(figure)


def _axis(found: OrderSpectra) -> str:
    return f"Order (cycles a turn of shaft {found.shaft})"


def _view(found: OrderSpectra, row: int, marks: tuple[LineMark, ...]) -> SpectrumView:
    # the mean and what leaks from it are no lines
    x, y = max_hold(found.order[2:], found.amplitude[row, 2:])
    return SpectrumView(
        channel=found.channel_names[row],
        unit=unit_text(found.units[row]),
        axis=_axis(found),
        frequency_hz=x,
        amplitude=y,
        meshes=marks,
    )


def _maps(found: OrderSpectra) -> bytes:
    names = found.channel_names[:MOST_STRIPS]
    marks = line_marks(found.marks, float(found.order[2]), float(found.order[-1]))
    heights = [2.2 if len(names) < 3 else 1.3] * len(names)
    figure, axes = new_figure(
        heights, top_in=0.72, right_in=1.15, gap_in=0.3 if len(names) > 1 else 0.12
    )
    for row, (name, ax) in enumerate(zip(names, axes, strict=True)):
        image = plot_order_map(found, row, ax)
        place = ax.get_position()
        scale = figure.add_axes((place.x1 + 0.015, place.y0, 0.014, place.height))
        bar = figure.colorbar(image, cax=scale, extend="min")
        unit = unit_text(found.units[row])
        bar.set_label(f"{shortened(name)}\npeak amplitude ({unit})", fontsize=6.5)
    label_marks(marks, axes[0])
    axes[-1].set_xlabel(_axis(found))
    left_label(figure, axes, "Time (s)")
    return as_png(figure, many_colours=True)


def plot_order_map(found: OrderSpectra, row: int, ax: Axes) -> AxesImage:
    """Draw amplitude over order and time of one channel."""
    values = found.map_amplitude[:, row, 2:]
    columns = min(_COLUMNS, values.shape[1])
    edges = np.linspace(0, values.shape[1], columns + 1).astype(int)[:-1]
    held = np.maximum.reduceat(values, edges, axis=1)
    top = max(float(held.max()), np.finfo(float).tiny)
    time = found.map_time_s
    step = float(time[1] - time[0]) if len(time) > 1 else 1.0
    return ax.imshow(
        np.maximum(held, top * 10**-_DECADES),
        aspect="auto",
        origin="lower",
        extent=(
            float(found.order[2]),
            float(found.order[-1]),
            float(time[0]) - step / 2,
            float(time[-1]) + step / 2,
        ),
        cmap="viridis",
        norm=LogNorm(vmin=top * 10**-_DECADES, vmax=top),
        interpolation="nearest",
    )
