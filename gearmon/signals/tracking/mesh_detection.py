"""Is the mesh there? Its lines against the lines that other tooth counts would have.

A comb always finds some speed that suits it, even in noise. So the mesh of z teeth is put beside
decoys, meshes of z +- j teeth, each allowed the same search for its best speed: a mesh is found if
its lines stand out from those of the decoys. Shaft harmonics (a loose or electrical machine without
gears has plenty) fall on the decoys as well and prove nothing. The speed track, which fits noise
best of all, is made from other blocks of the recording than those that are judged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import zip_longest

import numpy as np

from gearmon.signals.array_types import FloatArray, IntArray
from gearmon.signals.threads import side_by_side
from gearmon.signals.tracking.comb import Comb, SpeedScan, SpeedTrack

_DECOYS_A_SIDE = 14
# Decoy scores scatter about like a normal law: 3 is one false mesh in about a thousand machines. Of
# a mesh with two clear harmonics less is asked, two together being rare enough.
FOUND_FROM = 3.0
FOUND_FROM_SEVERAL = 2.0
# Deviations above the decoys from which one harmonic counts as clear.
_CLEAR = 2.0


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
    """

    order: float
    groups: tuple[tuple[float, ...], ...]
    spacings: tuple[float, ...]

    def shifted(self, shift: float) -> MeshComb:
        """Return the comb of a mesh whose order is higher by `shift`."""
        return MeshComb(
            order=self.order + shift,
            groups=tuple(
                tuple(order + k * shift for order in group)
                for k, group in enumerate(self.groups, start=1)
            ),
            spacings=self.spacings,
        )


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

    score: float
    decoys_above: int
    decoys: int
    clear: int
    visible: int

    @classmethod
    def none(cls, decoys: int) -> MeshEvidence:
        """Return the evidence of a mesh that cannot be judged."""
        return cls(score=0.0, decoys_above=decoys, decoys=decoys, clear=0, visible=0)

    @property
    def stands_out(self) -> bool:
        """Whether the mesh stands out from the decoys."""
        enough = FOUND_FROM_SEVERAL if self.clear >= 2 else FOUND_FROM
        return self.score >= enough and self.decoys_above <= self.decoys // 10


def combined_comb(meshes: Sequence[MeshComb], shaft_orders: Sequence[float]) -> Comb:
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
    weighed = sorted([(round(order, 9), weight) for order, weight in found])
    # of lines that coincide the last one has the largest weight
    weights = {order: weight for order, weight in weighed if order > 0}
    return Comb(orders=np.array(list(weights)), weights=np.array(list(weights.values())))


def mesh_evidence(
    scan: SpeedScan,
    meshes: Sequence[MeshComb],
    shaft_orders: Sequence[float],
    nominal_hz: float,
    tolerance: float = 0.03,
    known: SpeedTrack | None = None,
) -> tuple[MeshEvidence, ...]:
    """Judge for each mesh whether its lines stand out from those of decoys.

    Parameters
    ----------
    scan : SpeedScan
        Scan of a recording with the comb of all these meshes and shafts.
    meshes : sequence of MeshComb
        The meshes of all stages.
    shaft_orders : sequence of float
        Rotation orders of the shafts.
    nominal_hz : float
        Nominal rotation frequency of shaft 1 [Hz].
    tolerance : float
        How far the true speed may be from it, as a fraction.
    known : SpeedTrack, optional
        The speed, if a tachometer tells it; else it is tracked in the scan.

    Returns
    -------
    tuple of MeshEvidence
        One a mesh.
    """
    track = scan.track(_unseen(scan)) if known is None else known
    judged = _JudgedSpectrum.of(scan, track, nominal_hz, tolerance)

    def evidence(index: int) -> MeshEvidence:
        return _evidence(judged, meshes, shaft_orders, index)

    return tuple(side_by_side(evidence, range(len(meshes)), scan.scores.size))


def _evidence(
    judged: _JudgedSpectrum, meshes: Sequence[MeshComb], shaft_orders: Sequence[float], index: int
) -> MeshEvidence:
    others = [mesh for i, mesh in enumerate(meshes) if i != index]
    mesh = meshes[index]
    shared = judged.comb_score(combined_comb(others, shaft_orders)) if others or shaft_orders else 0
    own, *decoys = judged.best(_rivals(mesh, tuple(meshes)), shared)
    decoys = [strength for strength in decoys if len(strength)]
    if len(own) == 0 or len(decoys) < 8:
        return MeshEvidence.none(len(decoys))
    strengths = np.array(list(zip_longest(own, *decoys, fillvalue=np.nan))).T
    rivals = strengths[1:, : len(own)]
    common = np.sum(~np.isnan(rivals), axis=0) >= 8
    if not common.any():
        return MeshEvidence.none(len(decoys))
    strengths, rivals = strengths[:, : len(own)][:, common], rivals[:, common]
    middle = np.nanmedian(rivals, axis=0)
    spread = np.maximum(1.4826 * np.nanmedian(np.abs(rivals - middle), axis=0), 1e-12)
    clear = (strengths[0] - middle) / spread >= _CLEAR
    # quadratic mean: a mesh that shows in half of its harmonics is there
    size = np.sqrt(np.nanmean(strengths**2, axis=1))
    typical = float(np.median(size[1:]))
    width = 1.4826 * float(np.median(np.abs(size[1:] - typical)))
    return MeshEvidence(
        score=float((size[0] - typical) / max(width, 1e-12)),
        decoys_above=int(np.sum(size[1:] >= size[0])),
        decoys=len(rivals),
        clear=int(np.sum(clear)),
        visible=int(np.sum(common)),
    )


# of one machine the same for every recording
@lru_cache(maxsize=64)
def _rivals(mesh: MeshComb, meshes: tuple[MeshComb, ...]) -> tuple[tuple[MeshComb, Comb], ...]:
    """Return a mesh and its decoys, each with its comb."""
    decoys = [
        decoy
        for spacing in mesh.spacings
        for decoy in _decoys(mesh, spacing)
        if decoy.order > 2 * spacing
        and all(abs(decoy.order - true.order) >= 1.5 * spacing for true in meshes)
    ]
    return tuple((one, combined_comb([one], ())) for one in (mesh, *decoys))


def _decoys(mesh: MeshComb, spacing: float) -> list[MeshComb]:
    """Meshes with some teeth more or less, beyond the reach of the true mesh's own sidebands."""
    reach = max(max(group) - min(group) for group in mesh.groups)
    nearest = 3 + round(reach / spacing)
    steps = range(nearest, nearest + _DECOYS_A_SIDE)
    return [mesh.shifted(sign * j * spacing) for sign in (-1, 1) for j in steps]


@dataclass(frozen=True, kw_only=True)
class _JudgedSpectrum:
    """Mean log signal-to-noise ratio against order, and the speed corrections to be tried."""

    quality: FloatArray
    bin_order: float
    corrections: FloatArray
    top_order: float

    @classmethod
    def of(
        cls, scan: SpeedScan, track: SpeedTrack, nominal_hz: float, tolerance: float
    ) -> _JudgedSpectrum:
        """Average the kept blocks at speeds that were told by others."""
        mean = track.mean_hz
        if len(track.time_s) == 1:  # one block for both: at least its speed is constant
            mean = float(track.speed_hz[0])
        bin_order = scan.bin_hz / mean
        bins = scan.quality.shape[1]
        top = (bins - 1) * bin_order / (1 + tolerance)
        steps = int(np.ceil(2 * tolerance * top / bin_order))
        corrections = tolerance * np.arange(-steps, steps + 1) / max(1, steps)
        inside = np.abs(mean * (1 + corrections) / nominal_hz - 1) <= tolerance
        grid, quality = np.arange(bins) * bin_order, np.zeros(bins)
        for row, speed in zip(scan.quality, track.at(scan.centre_s[scan.kept]), strict=True):
            quality += row[np.minimum(np.rint(grid * speed / scan.bin_hz).astype(int), bins - 1)]
        return cls(
            quality=quality / len(scan.kept),
            bin_order=bin_order,
            corrections=corrections[inside] if inside.any() else np.zeros(1),
            top_order=top,
        )

    def comb_score(self, comb: Comb) -> FloatArray:
        """Weighted sum of the comb's lines for every correction."""
        used = comb.orders < self.top_order
        orders = (1 + self.corrections)[:, None] * comb.orders[used]
        return self._at(orders) @ comb.weights[used]

    def best(
        self, meshes: Sequence[tuple[MeshComb, Comb]], shared: FloatArray | int
    ) -> list[FloatArray]:
        """Log strength of each harmonic's group at the speed that suits comb and mesh best.

        One array a mesh, of the groups within the spectrum.
        """
        # the groups of each that lie within the spectrum
        seen = [
            [group for group in mesh.groups if max(group) < self.top_order and min(group) > 0]
            for mesh, _ in meshes
        ]
        corrections = [
            1 + self.corrections[int(np.argmax(self.comb_score(comb) + shared))]
            for _, comb in meshes
        ]
        orders = [
            correction * order
            for groups, correction in zip(seen, corrections, strict=True)
            for group in groups
            for order in group
        ]
        sizes = np.array([len(group) for groups in seen for group in groups], dtype=int)
        if len(sizes) == 0:
            return [np.zeros(0) for _ in meshes]
        powers = np.add.reduceat(np.exp(self._at(np.array(orders))), np.cumsum(sizes) - sizes)
        strengths = np.log(powers / sizes)
        return np.split(strengths, np.cumsum([len(groups) for groups in seen])[:-1])

    def _at(self, orders: FloatArray) -> FloatArray:
        place = orders / self.bin_order
        index = np.rint(place, out=place).astype(np.intp)
        # beyond the last bin its value stands
        return np.asarray(self.quality.take(index, mode="clip"))


def _unseen(scan: SpeedScan) -> IntArray:
    """Blocks that share no sample with the kept ones; all of them if there are too few."""
    blocks = np.arange(len(scan.centre_s))
    if len(blocks) < 4:
        return blocks
    # in time, not in numbers: the last block may stand closer to its neighbour than the others
    centre = scan.centre_s
    distance = np.abs(centre[:, None] - centre[scan.kept][None, :]).min(axis=1)
    needed = 0.999 * scan.stride * float(np.median(np.diff(centre)))
    return np.asarray(blocks[distance >= needed])
