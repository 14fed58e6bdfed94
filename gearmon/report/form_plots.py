"""Pictures of the forms of the mesh stiffness: curve and spectrum of each, side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gearmon.files import replacing
from gearmon.gears.stiffness_report import FormComparison, FormCurve

#: Colours that can be told apart by everyone (Okabe & Ito): a form, and its variant.
COLOURS = ("#0072B2", "#D55E00")
GREY = "#777777"
GN = 1e-9
LABELS = {
    "parabolic": "parabola (reference)",
    "wave": "half-sine arches",
    "rectangular": "rectangle, true duty",
    "rectangular-half": "rectangle, duty 1/2",
    "fourier-true": "Fourier sum, true duty",
    "fourier": "Fourier sum, duty 1/2",
}


def plot_curves(comparison: FormComparison, group: str, ax: Axes) -> Axes:
    """Draw the curves of one form over the mesh periods, the first form of all in grey.

    Parameters
    ----------
    comparison : FormComparison
    group : str
    ax : Axes
    """
    reference = comparison.curves[0]
    own = _of(comparison, group)
    if reference not in own:
        ax.plot(
            comparison.phase,
            GN * reference.stiffness_n_per_m,
            color=GREY,
            linewidth=0.9,
            alpha=0.7,
            label="reference",
        )
    for curve, colour, width in zip(own, COLOURS, (1.6, 1.1), strict=False):
        ax.plot(
            comparison.phase,
            GN * curve.stiffness_n_per_m,
            color=colour,
            linewidth=width,
            label=LABELS.get(curve.name, curve.name),
        )
    least = min(curve.stiffness_n_per_m.min() for curve in comparison.curves)
    most = max(curve.stiffness_n_per_m.max() for curve in comparison.curves)
    ax.set_xlim(comparison.phase[0], comparison.phase[-1])
    # room for the names of the curves above them
    ax.set_ylim(GN * (least - 0.08 * (most - least)), GN * (most + 0.55 * (most - least)))
    ax.set_ylabel("stiffness in GN/m")
    ax.legend(fontsize=8, loc="upper right", ncols=3)
    return ax


def plot_lines(comparison: FormComparison, group: str, ax: Axes) -> Axes:
    """Draw the spectrum of one form: amplitudes of the mesh harmonics, without the mean."""
    own = _of(comparison, group)
    shifts = [0.0] if len(own) == 1 else [-0.13, 0.13]
    for curve, colour, shift in zip(own, COLOURS, shifts, strict=False):
        orders = np.arange(1, len(curve.lines) + 1) + shift
        height = 1e-6 * curve.amplitudes_n_per_m
        ax.vlines(orders, 0, height, color=colour, linewidth=1.4)
        ax.plot(orders, height, "o", color=colour, markersize=3.5)
    top = max(float(curve.amplitudes_n_per_m.max()) for curve in comparison.curves)
    ax.set_xlim(0.3, len(own[0].lines) + 0.7)
    ax.set_ylim(0, 1.08e-6 * top if top else 1.0)
    ax.set_ylabel("amplitude in MN/m")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return ax


def form_figure(comparison: FormComparison) -> Figure:
    """Return one sheet: a row for each form, its curve on the left, its spectrum on the right."""
    groups = list(dict.fromkeys(curve.group for curve in comparison.curves))
    figure = Figure(figsize=(11.5, 0.9 + 2.0 * len(groups)), layout="constrained")
    axes = figure.subplots(len(groups), 2, sharex="col", squeeze=False)
    for group, (left, right) in zip(groups, axes, strict=True):
        plot_curves(comparison, group, left)
        plot_lines(comparison, group, right)
    axes[-1][0].set_xlabel("mesh phase in mesh periods")
    axes[-1][1].set_xlabel(_harmonic_label(comparison))
    figure.suptitle(
        f"{comparison.machine}, stage {comparison.stage}, {comparison.mesh}: forms of the mesh "
        f"stiffness, contact ratio {comparison.contact_ratio:.4g}",
        fontsize=11,
    )
    return figure


def save_form_figure(comparison: FormComparison, path: str | Path) -> Path:
    """Write the sheet as a picture; the format follows the suffix of `path`."""
    target = Path(path)
    with replacing(target) as temporary:
        form_figure(comparison).savefig(temporary, dpi=130)
    return target


def _of(comparison: FormComparison, group: str) -> list[FormCurve]:
    return [curve for curve in comparison.curves if curve.group == group]


def _harmonic_label(comparison: FormComparison) -> str:
    if comparison.mesh_frequency_hz is None:
        return "mesh harmonic"
    return f"mesh harmonic (times {comparison.mesh_frequency_hz:.5g} Hz)"
