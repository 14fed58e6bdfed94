"""Spacing of the lines about a mesh: a rotation that this mesh needs, or that of something else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from gearmon.signals.array_types import BoolArray, FloatArray
from gearmon.signals.orders.spectra import FineSpectrum
from gearmon.signals.tracking.mesh_detection import FOUND_FROM, MeshComb

# A finer comb, such as a bearing's. Set on five meshes invented for simulated bearings and 103 of a
# real two-stage gearbox with sound and broken teeth: ratios of 0.70 to 1.09, and below 0.41.
_AS_CLEAR, _SURE = 0.5, 5.0
# Lines between those of the mesh that a spacing must have to be judged.
_LINES = 4
# Spacings tried: so many times a part of the mesh order; and bins averaged before lines are sought:
# those of a bearing that slips are smeared.
_PARTS, _TIMES, _AVERAGED = 40, (1, 2, 3), (1, 4)
_RATIOS = np.array([t / n for n in range(2, _PARTS + 1) for t in _TIMES if gcd(n, t) == 1])
# Mesh harmonics looked at, and the share of the bins that is highest: a harmonic is clear.
_HARMONICS, _CLEAREST = 12, 0.02


@dataclass(frozen=True, kw_only=True)
class SidebandSpacing:
    """How clearly the sidebands of a mesh stand at a shaft's spacing, and at another one.

    Parameters
    ----------
    support : float
        Height of the expected spacing in robust standard deviations over all spacings tried; 0 if
        another spacing is clearer by more than one of them. The harmonics of a mesh alone fit any
        tooth count at some speed; the spacing of its sidebands does not.
    excess : float
        How much better the best other spacing does, in the same; 0 if the expected one is best. A
        tone of another origin can be taken for a mesh harmonic at a wrong speed: its sidebands, if
        it has any, then stand at the true rotation frequency.
    departure : float
        That other spacing's relative departure.
    """

    support: float
    excess: float
    departure: float


def sideband_spacing(
    quality: FloatArray, bin_order: float, mesh: MeshComb, spacing: float, tolerance: float = 0.03
) -> SidebandSpacing:
    """Compare the sidebands at a shaft's spacing with those at slightly different spacings.

    Parameters
    ----------
    quality : ndarray of float, shape (bins,)
        log(1 + signal-to-noise ratio) against order, resolved as finely as the recording allows.
    bin_order : float
        Spacing of the bins [orders].
    mesh : MeshComb
        The mesh, at its place in this spectrum. Departures at which the sidebands of its other
        spacings stand are left out.
    spacing : float
        Order of the shaft.
    tolerance : float
        Departures of the spacing to try, as a fraction.

    Returns
    -------
    SidebandSpacing
    """
    top = (len(quality) - 1) * bin_order
    # a line width at the second sideband: finer departures cannot be told from none
    near = max(2 * bin_order / spacing, 1e-3)
    departures = np.linspace(-tolerance, tolerance, 2 * max(20, int(4 * tolerance / near)) + 1)
    # where the second sideband of one gear nearly meets the first of the other, it is that one's
    others, small = [other for other in mesh.spacings if other != spacing], range(1, 5)
    for ratio in (j * other / (i * spacing) for other in others for i in small for j in small):
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
    expected = float(standard[np.abs(departures) <= near].max())
    best = int(np.argmax(standard))
    found = standard[best] >= FOUND_FROM
    return SidebandSpacing(
        support=expected if expected > standard[best] - 1.0 else 0.0,
        excess=max(0.0, float(standard[best]) - max(expected, 0.0)) if found else 0.0,
        departure=float(departures[best]) if found else 0.0,
    )


def foreign_spacing(
    spectrum: FineSpectrum, mesh: MeshComb, turning: Sequence[float], meshing: Sequence[float]
) -> float | None:
    """Return the spacing of a finer comb to which the lines of a mesh belong, None if to none.

    The harmonics of a bearing fault are many lines at one spacing. Every multiple of it is the mesh
    of some tooth count at some speed; but then the lines between stand out as clearly as those of
    the mesh.

    Parameters
    ----------
    spectrum : FineSpectrum
        Of the whole recording against the angle of shaft 1.
    mesh : MeshComb
        The mesh, at its place in this spectrum.
    turning : sequence of float
        Orders at which shafts, gears and planets turn and pass one another.
    meshing : sequence of float
        Orders of the other meshes: lines at their multiples are theirs.

    Returns
    -------
    float or None
        The spacing [orders].

    Notes
    -----
    Spacings of a whole part, or two or three times that, of the mesh order are tried. How far a
    line stands out is its log(1 + signal-to-noise ratio) less the mean of its neighbours at the
    distance of each shaft: a faulty tooth, too, fills the orders between those of the mesh, but all
    multiples of its shaft alike.
    """
    quality = spectrum.quality[: int((_HARMONICS + 1) * mesh.order / spectrum.step)]
    found = [
        _finer_comb(_Lines.of(quality, spectrum, averaged), mesh, turning, meshing)
        for averaged in _AVERAGED
    ]
    return min((spacing for spacing in found if spacing is not None), default=None)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Lines:
    """How high lines stand at any order, their width, and what is usual."""

    height: FloatArray
    step: float
    width: float
    usual: float

    @classmethod
    def of(cls, quality: FloatArray, spectrum: FineSpectrum, averaged: int) -> _Lines:
        if averaged > 1:
            quality = np.log1p(uniform_filter1d(np.expm1(quality), averaged))
        width = spectrum.width * max(1.0, averaged / 2)
        reach = max(1, round(0.5 * width / spectrum.step))
        return cls(
            height=maximum_filter1d(quality, 2 * reach + 1),
            step=spectrum.step,
            width=width,
            usual=float(np.median(quality)),
        )

    def at(self, orders: FloatArray) -> FloatArray:
        """Heights at orders, NaN beyond the spectrum."""
        bins = np.rint(orders / self.step).astype(np.intp)
        inside = (bins > 0) & (bins < len(self.height))
        return np.asarray(np.where(inside, self.height[np.where(inside, bins, 0)], np.nan))

    def on(self, orders: FloatArray, spacing: float) -> BoolArray:
        """Which orders are multiples of a spacing."""
        away = np.abs(orders - spacing * np.rint(orders / spacing))
        return np.asarray(away <= 1.5 * self.width)

    def standing(
        self, orders: FloatArray, shafts: Sequence[float], combs: Sequence[float]
    ) -> FloatArray:
        """How far lines stand above those a few turns of any shaft away that are on no comb."""
        below = np.full(len(orders), self.usual)
        for shaft in shafts:
            around = orders + shaft * np.array([-3, -2, -1, 1, 2, 3])[:, None]
            beside = self.at(around)
            for comb in combs:
                beside[self.on(around, comb)] = np.nan
            count = np.sum(~np.isnan(beside), axis=0)
            mean = np.nansum(beside, axis=0) / np.maximum(count, 1)
            below = np.where(count >= 2, np.maximum(below, mean), below)
        return np.asarray(self.at(orders) - below)


def _finer_comb(
    lines: _Lines, mesh: MeshComb, turning: Sequence[float], meshing: Sequence[float]
) -> float | None:
    """Coarsest spacing whose lines between those of the mesh are as clear as these."""
    harmonics = np.arange(1.0, _HARMONICS + 1) * mesh.order
    clear = np.flatnonzero(lines.at(harmonics) >= np.quantile(lines.height, 1 - _CLEAREST))
    if len(clear) == 0:
        return None
    top = harmonics[clear[-1]] + 0.5 * mesh.order
    told_apart = [shaft for shaft in turning if shaft > 2.5 * lines.width]
    tried = mesh.order * _RATIOS
    known = np.any([np.abs(tried - one) <= lines.width for one in (*turning, *meshing)], axis=0)
    tried = tried[(tried >= 4 * lines.width) & ~known]
    # the lines of all spacings, one after the other
    sizes = (top / tried).astype(np.intp)
    of = np.repeat(np.arange(len(tried)), sizes)
    orders = (np.arange(len(of)) - np.repeat(np.cumsum(sizes) - sizes, sizes) + 1.0) * tried[of]
    meshed = lines.on(orders, mesh.order)
    between = ~meshed & ~np.any([lines.on(orders, other) for other in meshing], axis=0)
    above = lines.at(orders) - lines.usual

    def mean(chosen: BoolArray) -> tuple[FloatArray, NDArray[np.intp]]:
        kept = chosen & ~np.isnan(above)
        count = np.bincount(of[kept], minlength=len(tried))
        return np.bincount(of[kept], above[kept], len(tried)) / np.maximum(count, 1), count

    # most spacings are out already before their neighbours are looked at
    (off, count), (own, harmonics_on) = mean(between), mean(meshed)
    told = (count >= _LINES) & (harmonics_on > 0)
    told &= (off >= _AS_CLEAR * own) & (off * np.sqrt(count) >= _SURE)
    for number in np.flatnonzero(told).tolist():
        mine, spacing = of == number, float(tried[number])
        standing = lines.standing(orders[mine], told_apart, (spacing, mesh.order))
        stands = float(np.nanmean(standing[between[mine]]))
        clear_by = float(np.nanmean(standing[meshed[mine]]))
        if stands > _AS_CLEAR * clear_by and stands * np.sqrt(count[number]) > _SURE:
            return spacing
    return None
