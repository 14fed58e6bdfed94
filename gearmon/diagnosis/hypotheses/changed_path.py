"""Whether the path from the gears to the sensor changed, rather than the gears.

A sensor that was moved, or a housing that was opened, colours every line anew: all that stands
about one mesh harmonic, the harmonic itself and the sidebands of either gear, rises or falls
together in each channel, differently from harmonic to harmonic and from channel to channel. A gear
at fault moves its own sidebands, or the mesh, against the rest of the band, and does so in all
channels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.diagnosis.law import LevelDeviation
from gearmon.signatures.measured.line_plan import Family

# Share of the change that has to be common to the bands where there is one channel: 39 of 42
# simulated sensors that were moved, 28 of them to another place altogether, exceed it, none of 26
# misaligned or pitted gears does (largest 0.22); and by which channels have to differ where there
# are several: all of 56 moved sensors exceed it (least 0.08), 64 gears at fault have 0.00.
_COMMON, _APART = 0.25, 0.04


@dataclass(frozen=True, kw_only=True)
class PathChange:
    """How far levels changed band by band.

    Parameters
    ----------
    common : float, in [0, 1]
        Share of the change that all families about one mesh harmonic have in common, what chance
        makes of it taken off.
    apart : float or None
        Share of the change by which mesh harmonics changed otherwise in one channel than in
        another, 0 to 1: what the gears do, all channels hear. None for one channel.
    together : float
        Mean square of the changes of whole bands: 1 where the families of each change alone, of
        the healthy variance.
    bands : int
        Mesh harmonics and channels looked at.
    """

    common: float
    apart: float | None
    together: float
    bands: int

    @property
    def likely(self) -> bool:
        """Whether a changed path explains most of it."""
        told = self.common > _COMMON if self.apart is None else self.apart > _APART
        return self.bands >= 4 and told


#: Nothing was compared.
UNCHANGED = PathChange(common=0.0, apart=None, together=0.0, bands=0)


def path_change(levels: LevelDeviation, families: Sequence[Family]) -> PathChange:
    """Tell how much of changed levels is common to the bands about the mesh harmonics.

    Parameters
    ----------
    levels : LevelDeviation
        Of those families.
    families : sequence of Family
        One for each column.
    """
    columns: dict[tuple[int, int], list[int]] = {}
    for column, family in enumerate(families):
        columns.setdefault((family.stage, family.harmonic), []).append(column)
    parts = [levels.standardised[:, members] for members in columns.values() if len(members) > 1]
    counts = [np.isfinite(part).sum(axis=1) for part in parts]
    # of unrelated changes the mean of `count` has a variance of one part in `count`
    between = within = together = 0.0
    for part, count in zip(parts, counts, strict=True):
        part, count = part[count > 1], count[count > 1]
        mean = np.nansum(part, axis=1) / count
        spread = np.nansum(part**2, axis=1) - count * mean**2
        together += float(np.sum(count * mean**2))
        between += float(np.sum(np.maximum(count * mean**2 - spread / (count - 1), 0.0)))
        within += float(np.sum(spread * count / (count - 1)))
    bands = sum(int(np.sum(count > 1)) for count in counts)
    return PathChange(
        common=between / max(between + within, np.finfo(float).tiny),
        apart=_apart(levels, families),
        together=together / max(bands, 1),
        bands=bands,
    )


def _apart(levels: LevelDeviation, families: Sequence[Family]) -> float | None:
    """Share of the change by which mesh harmonics differ between channels, beyond chance."""
    mesh = levels.standardised[:, [family.kind == "mesh" for family in families]]
    if len(mesh) < 2:
        return None
    mesh = mesh[:, np.isfinite(mesh).all(axis=0)]
    differ = np.sum((mesh - mesh.mean(axis=0)) ** 2) - (len(mesh) - 1) * mesh.shape[1]
    whole = np.nansum(levels.standardised**2)
    return float(max(differ, 0.0) / max(whole, np.finfo(float).tiny))
