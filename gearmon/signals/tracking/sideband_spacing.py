"""Spacing of the sidebands about a mesh: is it the rotation that this mesh would need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.tracking.mesh_detection import FOUND_FROM, MeshComb

FloatArray = NDArray[np.float64]


def spacing_mismatch(
    quality: FloatArray,
    bin_order: float,
    mesh: MeshComb,
    spacing: float,
    tolerance: float = 0.03,
    others: Sequence[float] = (),
) -> tuple[float, float]:
    """Compare the sidebands at a shaft's spacing with those at a slightly different spacing.

    A tone of another origin can be taken for a mesh harmonic at a wrong speed. Its sidebands, if it
    has any, then stand at the true rotation frequency and not where this speed wants them.

    Parameters
    ----------
    quality : ndarray of float, shape (bins,)
        log(1 + signal-to-noise ratio) against order, resolved as finely as the recording allows.
    bin_order : float
        Spacing of the bins [orders].
    mesh : MeshComb
        The mesh, at its place in this spectrum.
    spacing : float
        Order of the shaft.
    tolerance : float
        Departures of the spacing to try, as a fraction.
    others : sequence of float
        Orders of the other shafts: departures at which their sidebands stand are left out.

    Returns
    -------
    excess : float
        How much better the best other spacing does, in robust standard deviations over all
        spacings tried; 0 if the expected one is best.
    departure : float
        That other spacing's relative departure.
    """
    departures, standard, near = _spacing_scores(
        quality, bin_order, mesh, spacing, tolerance, others
    )
    expected = float(standard[np.abs(departures) <= near].max())
    best = int(np.argmax(standard))
    if standard[best] < FOUND_FROM:
        return 0.0, 0.0
    return max(0.0, float(standard[best]) - max(expected, 0.0)), float(departures[best])


def spacing_support(
    quality: FloatArray,
    bin_order: float,
    mesh: MeshComb,
    spacing: float,
    tolerance: float = 0.03,
    others: Sequence[float] = (),
) -> float:
    """How clearly sidebands stand at a shaft's spacing: what fixes the speed besides the mesh.

    The harmonics of a mesh alone fit any tooth count at some speed; the spacing of its sidebands
    does not.

    Parameters
    ----------
    quality, bin_order, mesh, spacing, tolerance, others
        As for `spacing_mismatch`.

    Returns
    -------
    float
        Height of the expected spacing in robust standard deviations over all spacings tried; 0 if
        another spacing is clearer by more than one of them.
    """
    departures, standard, near = _spacing_scores(
        quality, bin_order, mesh, spacing, tolerance, others
    )
    expected = float(standard[np.abs(departures) <= near].max())
    return expected if expected > float(standard.max()) - 1.0 else 0.0


def _spacing_scores(
    quality: FloatArray,
    bin_order: float,
    mesh: MeshComb,
    spacing: float,
    tolerance: float,
    others: Sequence[float],
) -> tuple[FloatArray, FloatArray, float]:
    """Departures of the spacing, how far each stands out, and what cannot be told from none."""
    top = (len(quality) - 1) * bin_order
    # a line width at the second sideband: finer departures cannot be told from none
    near = max(2 * bin_order / spacing, 1e-3)
    departures = np.linspace(-tolerance, tolerance, 2 * max(20, int(4 * tolerance / near)) + 1)
    # where the second sideband of one gear nearly meets the first of the other, it is that one's
    small = range(1, 5)
    ratios = [j * other / (i * spacing) for other in others for i in small for j in small]
    for ratio in ratios:
        elsewhere = np.abs(1 + departures - ratio) > 2 * near  # and the skirts of its lines
        departures = departures[elsewhere | (np.abs(departures) <= near)]
    total = np.zeros(len(departures))
    for k in range(1, len(mesh.groups) + 1):
        for r in (-4, -3, -2, -1, 1, 2, 3, 4):
            orders = k * mesh.order + r * spacing * (1 + departures)
            if orders.min() > 0 and orders.max() < top:
                total += quality[np.rint(orders / bin_order).astype(int)]
    middle = float(np.median(total))
    spread = 1.4826 * float(np.median(np.abs(total - middle)))
    standard = (total - middle) / spread if spread > 0 else np.zeros(len(total))
    return departures, standard, near
