"""The picture of `gearmon orders`: amplitude against the orders of a shaft, a strip a channel."""

from __future__ import annotations

from pathlib import Path

from gearmon.files import write_atomically
from gearmon.report.curves import max_hold
from gearmon.report.plots import as_png, left_label, new_figure, style
from gearmon.report.plots_spectrum import plot_spectrum
from gearmon.report.spectrum_command_plots import MOST_STRIPS, label_marks, line_marks
from gearmon.report.views import LineMark, SpectrumView
from gearmon.report.wording import unit_text
from gearmon.signatures.order_spectra import OrderSpectra


def save_order_picture(found: OrderSpectra, path: Path) -> Path:
    """Draw order spectra and write the picture.

    Parameters
    ----------
    found : OrderSpectra
    path : Path
        Name of the PNG.

    Returns
    -------
    Path
        `path`.
    """
    with style():
        png = _strips(found)
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
    axes[-1].set_xlabel(order_axis(found))
    left_label(figure, axes, "Peak amplitude")
    return as_png(figure)


def order_axis(found: OrderSpectra) -> str:
    """Return what the axis of orders counts."""
    return f"Order (cycles a turn of shaft {found.shaft})"


def _view(found: OrderSpectra, row: int, marks: tuple[LineMark, ...]) -> SpectrumView:
    # the mean and what leaks from it are no lines
    x, y = max_hold(found.order[2:], found.amplitude[row, 2:])
    return SpectrumView(
        channel=found.channel_names[row],
        unit=unit_text(found.units[row]),
        axis=order_axis(found),
        frequency_hz=x,
        amplitude=y,
        meshes=marks,
    )
