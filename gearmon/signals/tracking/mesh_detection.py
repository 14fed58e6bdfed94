"""Is the mesh there? Its lines against the lines that other tooth counts would have.

A comb always finds some speed that suits it, even in noise. So the mesh of z teeth is put beside
decoys, meshes of z +- j teeth, each allowed the same search for its best speed: a mesh is found if
its lines stand out from those of the decoys. Shaft harmonics (a loose or electrical machine without
gears has plenty) fall on the decoys as well and prove nothing. The speed track, which fits noise
best of all, is made from other blocks of the recording than those that are judged.

The spacing of the lines about a mesh tells more: they stand at a rotation that this mesh needs, or
at that of something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import gcd

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from gearmon.arrays import BoolArray, FloatArray
from gearmon.signals.orders.spectra import FineSpectrum
from gearmon.signals.tracking.comb import Comb, SpeedScan, SpeedTrack
from gearmon.threads import side_by_side

Orders = Sequence[float]

_DECOYS_A_SIDE = 14
# Decoy scores scatter about like a normal law: 3 is one false mesh in about a thousand machines. Of
# a mesh with two clear harmonics less is asked, two together being rare enough: of many harmonics,
# as a slow mesh has them, a share that chance (one in twenty) does not reach.
FOUND_FROM = 3.0
FOUND_FROM_SEVERAL, _SHARE = 2.0, 1.0 / 6.0
# Deviations above the decoys from which one harmonic counts as clear.
_CLEAR = 2.0
# A finer comb, such as a bearing's. Set on five meshes invented for simulated bearings and 103 of a
# real two-stage gearbox with sound and broken teeth: ratios of 0.70 to 1.09, and below 0.41.
_AS_CLEAR, _SURE = 0.5, 5.0
# Lines between those of the mesh that a spacing must have to be judged.
_LINES = 4
# Spacings tried: so many times a part of the mesh order; and bins averaged before lines are sought:
# those of a bearing that slips are smeared.
_PARTS, _TIMES, _AVERAGED = 40, (1, 2, 3), (1, 4)
_RATIOS = np.array([t / n for n in range(2, _PARTS + 1) for t in _TIMES if gcd(n, t) == 1])
# Sidebands to either side by which a spacing is told.
_SIDEBANDS = 4
# Height from which sidebands stand at a spacing that no number of teeth of this gear would have: of
# 41 to 71 spacings tried in noise, the highest is above 3 in one of six recordings, above 4.4 in
# one of a hundred. Tooth counts near the one that is meant are few.
_ELSEWHERE_FROM = 4.4
# Departures of a spacing at which any sideband of the other gear may stand.
_NEARBY = 0.03
# Mesh harmonics between which a finer comb is looked for at least, all that show the mesh where it
# is slow; and the share of the bins that is highest: a harmonic is clear.
_HARMONICS, _CLEAREST = 12, 0.02


@dataclass(frozen=True, kw_only=True)
class MeshComb:
    """The lines of one gear mesh as plain orders.

    Parameters
    ----------
    order : float
        Order of the mesh frequency, in cycles a turn of shaft 1.
    groups : tuple of tuple of float
        For each mesh harmonic k = 1, 2, ... the orders where it may show: k * order for parallel
        shafts, with its neighbours for a planetary set.
    spacings : tuple of float
        Rotation orders of the gears in mesh: sideband spacings, and the steps of the decoys.
    turning : tuple of float
        Orders at which shafts, gears and planets of the machine turn and pass one another.
    meshing : tuple of float
        Orders of its other meshes: lines at their multiples are theirs.
    """

    order: float
    groups: tuple[tuple[float, ...], ...]
    spacings: tuple[float, ...]
    turning: tuple[float, ...] = ()
    meshing: tuple[float, ...] = ()

    def shifted(self, shift: float) -> MeshComb:
        """Return the comb of a mesh whose order is higher by `shift`."""
        groups = tuple(tuple(x + k * shift for x in own) for k, own in enumerate(self.groups, 1))
        return replace(self, order=self.order + shift, groups=groups)


@dataclass(frozen=True, kw_only=True)
class MeshEvidence:
    """How clearly a mesh stands out.

    Parameters
    ----------
    score : float
        Distance of the quadratic mean of its harmonics' log signal-to-noise ratios from those of
        the decoys, in robust standard deviations of the decoys.
    decoys_above : int
        Decoys that score at least as much.
    decoys : int
        Decoys tried.
    clear : int
        Harmonics that stand two deviations above the decoys.
    visible : int
        Harmonics that could be judged.
    """

    score: float = 0.0
    decoys_above: int
    decoys: int
    clear: int = 0
    visible: int = 0

    @property
    def stands_out(self) -> bool:
        """Whether the mesh stands out from the decoys."""
        enough = FOUND_FROM_SEVERAL if self.clear >= max(2, _SHARE * self.visible) else FOUND_FROM
        return self.score >= enough and self.decoys_above <= self.decoys // 10


def combined_comb(meshes: Sequence[MeshComb], shaft_orders: Orders) -> Comb:
    """Join meshes, their first sidebands and the first shaft harmonics into one comb.

    Parameters
    ----------
    meshes : sequence of MeshComb
        The meshes, weight 1 a harmonic and 0.4 each sideband at +-1 spacing.
    shaft_orders : sequence of float
        Rotation orders, the input first; harmonics 1 to 8 of the first and 1 to 3 of the others
        get weight 0.3.

    Returns
    -------
    Comb
        Each order once, with its largest weight.
    """
    found: list[tuple[float, float]] = []
    for mesh in meshes:
        for k, group in enumerate(mesh.groups, start=1):
            found += [(order, 1.0) for order in group]
            for spacing in mesh.spacings:
                found += [(k * mesh.order + spacing, 0.4), (k * mesh.order - spacing, 0.4)]
    for number, order in enumerate(shaft_orders):
        found += [(harmonic * order, 0.3) for harmonic in range(1, 9 if number == 0 else 4)]
    # of lines that coincide the last one has the largest weight
    weights = dict(sorted((round(order, 9), weight) for order, weight in found if order > 1e-9))
    return Comb(orders=np.array(list(weights)), weights=np.array(list(weights.values())))


def mesh_evidence(
    scan: SpeedScan, meshes: Sequence[MeshComb], shaft_orders: Orders
) -> tuple[MeshEvidence, ...]:
    """Judge for each mesh whether its lines stand out from those of decoys.

    Parameters
    ----------
    scan : SpeedScan
        Scan of a recording with the comb of all these meshes and shafts, at evenly spaced speeds.
    meshes : sequence of MeshComb
        The meshes of all stages.
    shaft_orders : sequence of float
        Rotation orders of the shafts.

    Returns
    -------
    tuple of MeshEvidence
        One a mesh.
    """
    # the speed is told by blocks that share no sample with the kept ones, all if there are too few
    blocks, centre = np.arange(len(scan.centre_s)), scan.centre_s
    if len(blocks) >= 4:
        # in time, not in numbers: the last block may stand closer to its neighbour than the others
        distance = np.abs(centre[:, None] - centre[scan.kept][None, :]).min(axis=1)
        blocks = blocks[distance >= 0.999 * scan.stride * float(np.median(np.diff(centre)))]
    judged = _JudgedSpectrum(scan, scan.track(blocks))

    def evidence(index: int) -> MeshEvidence:
        others = [mesh for i, mesh in enumerate(meshes) if i != index]
        known = others or shaft_orders
        shared = judged.comb_score(combined_comb(others, shaft_orders)) if known else 0
        rivals = _rivals(meshes[index], tuple(meshes))
        strengths = np.array([judged.best(*rival, shared) for rival in rivals])
        seen = ~np.isnan(strengths)
        decoys, common = int(seen[1:].any(axis=1).sum()), seen[0] & (seen[1:].sum(axis=0) >= 8)
        if not common.any():
            return MeshEvidence(decoys_above=decoys, decoys=decoys)
        strengths = strengths[seen[:, common].any(axis=1)][:, common]
        # quadratic mean: a mesh that shows in half of its harmonics is there
        size = np.sqrt(np.nanmean(strengths**2, axis=1))
        return MeshEvidence(
            score=float(_above(size[0], size[1:])),
            decoys_above=int(np.sum(size[1:] >= size[0])),
            decoys=decoys,
            clear=int(np.sum(_above(strengths[0], strengths[1:]) >= _CLEAR)),
            visible=int(np.sum(common)),
        )

    return tuple(side_by_side(evidence, range(len(meshes)), scan.scores.size))


def _above(values: FloatArray, others: FloatArray) -> FloatArray:
    """How far values lie above the middle of others, in robust standard deviations of these."""
    middle = np.nanmedian(others, axis=0)
    spread = 1.4826 * np.nanmedian(np.abs(others - middle), axis=0)
    return np.asarray((values - middle) / np.maximum(spread, 1e-12))


# of one machine the same for every recording
@lru_cache(maxsize=64)
def _rivals(mesh: MeshComb, meshes: tuple[MeshComb, ...]) -> tuple[tuple[MeshComb, Comb], ...]:
    """Return a mesh and its decoys, each with its comb.

    Decoys are meshes with some teeth more or less, beyond the reach of the true mesh's sidebands.
    """
    reach = max(max(group) - min(group) for group in mesh.groups)
    found = [mesh]
    for spacing in mesh.spacings:
        nearest = 3 + round(reach / spacing)
        steps = np.arange(nearest, nearest + _DECOYS_A_SIDE)
        for step in (*-steps, *steps):
            decoy = mesh.shifted(float(step * spacing))
            away = min(abs(decoy.order - true.order) for true in meshes)
            if decoy.order > 2 * spacing and away >= 1.5 * spacing:
                found.append(decoy)
    return tuple((one, combined_comb([one], ())) for one in found)


class _JudgedSpectrum:
    """Mean log signal-to-noise ratio against order, and the speed corrections to be tried.

    The kept blocks are averaged at speeds that were told by others.
    """

    def __init__(self, scan: SpeedScan, track: SpeedTrack) -> None:
        mean, tolerance = track.mean_hz, float(scan.ratio[-1]) - 1
        self.bin_order = scan.bin_hz / mean
        bins = scan.quality.shape[1]
        self.top_order = (bins - 1) * self.bin_order / (1 + tolerance)
        steps = int(np.ceil(2 * tolerance * self.top_order / self.bin_order))
        corrections = tolerance * np.arange(-steps, steps + 1) / max(1, steps)
        inside = np.abs(mean * (1 + corrections) / scan.nominal_hz - 1) <= tolerance
        self.corrections = corrections[inside] if inside.any() else np.zeros(1)
        grid, quality = np.arange(bins) * self.bin_order, np.zeros(bins)
        for row, speed in zip(scan.quality, track.at(scan.centre_s[scan.kept]), strict=True):
            quality += row[np.minimum(np.rint(grid * speed / scan.bin_hz).astype(int), bins - 1)]
        self.quality = quality / len(scan.kept)

    def comb_score(self, comb: Comb) -> FloatArray:
        """Weighted sum of the comb's lines for every correction."""
        used = comb.orders < self.top_order
        orders = (1 + self.corrections)[:, None] * comb.orders[used]
        return np.asarray(self._at(orders) @ comb.weights[used])

    def best(self, mesh: MeshComb, comb: Comb, shared: FloatArray | int) -> FloatArray:
        """Log strength of each harmonic's group at the speed that suits comb and mesh best.

        NaN of those that reach beyond the spectrum.
        """
        correction = 1 + self.corrections[int(np.argmax(self.comb_score(comb) + shared))]
        orders, sizes = np.concatenate(mesh.groups), np.array([len(own) for own in mesh.groups])
        powers = np.exp(self._at(correction * orders))
        powers[(orders >= self.top_order) | (orders <= 0)] = np.nan
        return np.asarray(np.log(np.add.reduceat(powers, np.cumsum(sizes) - sizes) / sizes))

    def _at(self, orders: FloatArray) -> FloatArray:
        index = np.rint(orders / self.bin_order).astype(np.intp)
        # beyond the last bin its value stands
        return np.asarray(self.quality.take(index, mode="clip"))


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
    spectrum: FineSpectrum, mesh: MeshComb, spacing: float, reach: float, broken: bool = False
) -> SidebandSpacing:
    """Compare the sidebands at a shaft's spacing with those at slightly different spacings.

    Parameters
    ----------
    spectrum : FineSpectrum
        Of the whole recording against the angle of shaft 1.
    mesh : MeshComb
        The mesh, at its place in this spectrum. Departures at which the sidebands of its other
        spacings stand are left out.
    spacing : float
        Order of the shaft.
    reach : float
        Departures of the spacing to try, as a fraction.
    broken : bool
        Whether the other gear may have a broken tooth, whose lines fill all of its orders.

    Returns
    -------
    SidebandSpacing
    """
    quality, step = spectrum.quality, spectrum.step
    # a line width at the second sideband: finer departures cannot be told from none
    near = max(2 * step / spacing, 1e-3)
    departures = np.linspace(-reach, reach, 2 * max(20, int(4 * reach / near)) + 1)
    # where the second sideband of one gear nearly meets the first of the other, it is that one's,
    # as are the skirts of its lines (of a sound 25/118 pair each fifth turn of the gear stood
    # highest, 5.9 % beside the pinion's)
    others, low = [other for other in mesh.spacings if other != spacing], np.arange(1, 5)
    parts = np.unique(np.outer(low, 1 / low))
    for other in others:
        for ratio in (*parts, *range(5, int((1 + reach) * spacing / other) + 1)):
            away = np.abs(1 + departures - ratio * other / spacing)
            departures = departures[(away > 2 * near) | (np.abs(departures) <= near)]
    total, usual = np.zeros(len(departures)), float(np.median(quality))
    for k in range(1, len(mesh.groups) + 1):
        for r in (*range(-_SIDEBANDS, 0), *range(1, _SIDEBANDS + 1)):
            orders = k * mesh.order + r * spacing * (1 + departures)
            if orders.min() > 0 and orders.max() < (len(quality) - 1) * step:
                heard = quality[np.rint(orders / step).astype(int)]
                for other in mesh.meshing:
                    heard[np.abs(orders - other * np.rint(orders / other)) <= 4 * step] = usual
                total += heard
    standard = _above(total, total)
    expected = float(standard[np.abs(departures) <= near].max())
    for share in (other / (spacing * i) for other in others if broken for i in low):
        ratio = share * np.rint(1 / share)
        if abs(ratio - 1) <= _NEARBY:
            its = np.abs(1 + departures - ratio) <= 2 * near
            standard[its & (np.abs(departures) > near)] = -np.inf
    teeth = mesh.order / spacing
    counted = np.abs(1 + departures - teeth / np.rint(teeth / (1 + departures))) <= near / 2
    best = int(np.argmax(standard))
    found = standard[best] >= (FOUND_FROM if counted[best] else _ELSEWHERE_FROM)
    return SidebandSpacing(
        support=expected if expected > standard[best] - 1.0 else 0.0,
        excess=max(0.0, float(standard[best]) - max(expected, 0.0)) if found else 0.0,
        departure=float(departures[best]) if found else 0.0,
    )


def foreign_spacing(
    spectrum: FineSpectrum, mesh: MeshComb, own: Orders = (), parts: Orders = ()
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
    own : sequence of float, optional
        Rotations of gears whose sidebands show them. Pitch errors put the same line of their
        pattern between all mesh harmonics, so a spacing of so many turns may be theirs, beyond
        those sidebands: with an even number of teeth errors that alternate are a comb at half the
        mesh order.
    parts : sequence of float, optional
        The only parts of the mesh order that are tried, as of another speed; then one line between
        those of the mesh is enough, four otherwise.

    Returns
    -------
    float or None
        The spacing [orders].

    Notes
    -----
    Spacings of a whole part, or two or three times that, of the mesh order are tried. How far a
    line stands out is its log(1 + signal-to-noise ratio) less the mean of its neighbours at the
    distance of each shaft: a faulty tooth, too, fills the orders between those of the mesh, but all
    multiples of its shaft alike. Of 18 teeth every third is the same few lines of their pattern,
    which chance may put above the rest: where a spacing is so many turns of a gear of its own, the
    lines between are another thing's only if half of their height is above those neighbours.
    """
    last = max(_HARMONICS, len(mesh.groups))
    quality = spectrum.quality[: int((last + 1) * mesh.order / spectrum.step)]
    lines = (_Lines(quality, spectrum, averaged) for averaged in _AVERAGED)
    tried, least = (mesh.order * np.array(parts), 1) if parts else (mesh.order * _RATIOS, _LINES)
    for turns in own:
        times = tried / turns
        tried = tried[(np.abs(times - np.rint(times)) > 1e-6) | (times <= _SIDEBANDS + 0.5)]
    found = [_finer_comb(one, mesh, tried, least, own) for one in lines]
    return min((spacing for spacing in found if spacing is not None), default=None)


class _Lines:
    """How high lines stand at any order, their width, and what is usual."""

    def __init__(self, quality: FloatArray, spectrum: FineSpectrum, averaged: int) -> None:
        if averaged > 1:
            quality = np.log1p(uniform_filter1d(np.expm1(quality), averaged))
        self.step, self.width = spectrum.step, spectrum.width * max(1.0, averaged / 2)
        self.height = maximum_filter1d(quality, 2 * max(1, round(0.5 * self.width / self.step)) + 1)
        self.usual = float(np.median(quality))

    def at(self, orders: FloatArray) -> FloatArray:
        """Heights at orders, NaN beyond the spectrum."""
        bins = np.rint(orders / self.step).astype(np.intp)
        inside = (bins > 0) & (bins < len(self.height))
        return np.asarray(np.where(inside, self.height[np.where(inside, bins, 0)], np.nan))

    def on(self, orders: FloatArray, spacing: float) -> BoolArray:
        """Which orders are multiples of a spacing."""
        return np.asarray(np.abs(orders - spacing * np.rint(orders / spacing)) <= 1.5 * self.width)

    def standing(self, orders: FloatArray, shafts: Orders, combs: Orders) -> FloatArray:
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
    lines: _Lines, mesh: MeshComb, tried: FloatArray, least: int, own: Orders
) -> float | None:
    """Coarsest spacing whose lines between those of the mesh are as clear as these."""
    harmonics = np.arange(1.0, max(_HARMONICS, len(mesh.groups)) + 1) * mesh.order
    clear = np.flatnonzero(lines.at(harmonics) >= np.quantile(lines.height, 1 - _CLEAREST))
    if len(clear) == 0:
        return None
    # where a line is no more than rounded to the last bin
    last = (len(lines.height) - 0.5) * lines.step * (1 - 1e-12)
    top = min(harmonics[clear[-1]] + 0.5 * mesh.order, last)
    told_apart = [shaft for shaft in mesh.turning if shaft > 2.5 * lines.width]
    others = (*mesh.turning, *mesh.meshing)
    known = np.any([np.abs(tried - one) <= lines.width for one in others], axis=0)
    tried = tried[(tried >= 4 * lines.width) & ~known & (tried <= top)]
    # the lines of all spacings, one after the other
    sizes = (top / tried).astype(int)
    start = np.cumsum(sizes) - sizes
    orders = np.arange(1.0, sizes.sum() + 1) - np.repeat(start, sizes)
    orders *= np.repeat(tried, sizes)
    above, meshed = lines.at(orders) - lines.usual, lines.on(orders, mesh.order)
    between = ~meshed & ~np.any([lines.on(orders, other) for other in mesh.meshing], axis=0)
    columns = np.array([above * between, between, above * meshed, meshed])
    off, many, on, harmonics_on = np.add.reduceat(columns, start, axis=1)
    # most spacings are out already before their neighbours are looked at
    told = (many >= least) & (harmonics_on > 0) & (off >= _SURE * np.sqrt(many))
    told &= off * harmonics_on >= _AS_CLEAR * on * many
    for number in np.flatnonzero(told).tolist():
        mine = slice(start[number], start[number] + sizes[number])
        standing = lines.standing(orders[mine], told_apart, (tried[number], mesh.order))
        stands, clear_by = standing[between[mine]].mean(), standing[meshed[mine]].mean()
        times = tried[number] / np.array(own)
        if np.any(np.abs(times - np.rint(times)) < 1e-6):
            clear_by = max(clear_by, off[number] / many[number])
        if stands > _AS_CLEAR * clear_by and stands * np.sqrt(many[number]) > _SURE:
            return float(tried[number])
    return None
