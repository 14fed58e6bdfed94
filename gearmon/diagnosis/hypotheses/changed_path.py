"""Whether the path from the gears to the sensor changed, rather than the gears.

A sensor that was moved, or a housing that was opened, colours every line anew: all that stands
about one mesh harmonic, the harmonic itself and the sidebands of either gear, rises or falls
together in each channel, and differently from harmonic to harmonic. A gear at fault moves its own
sidebands, or the mesh, against the rest of the band.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.diagnosis.law import LevelDeviation
from gearmon.signatures.measured.line_plan import Family

# Share of the levels' change that has to be common to the bands: 39 of 42 simulated sensors that
# were moved, 28 of them to another place altogether, exceed it, none of 26 misaligned or pitted
# gears does (largest 0.22).
_COMMON = 0.25


@dataclass(frozen=True, kw_only=True)
class PathChange:
    """How far levels changed band by band.

    Parameters
    ----------
    common : float, in [0, 1]
        Share of the change that all families about one mesh harmonic have in common, what chance
        makes of it taken off.
    bands : int
        Mesh harmonics and channels looked at.
    """

    common: float
    bands: int

    @property
    def likely(self) -> bool:
        """Whether a changed path explains most of it."""
        return self.bands >= 4 and self.common > _COMMON


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
    between = within = 0.0
    bands = 0
    for members in columns.values():
        if len(members) < 2:
            continue
        part = levels.standardised[:, members]
        seen = np.isfinite(part)
        count = seen.sum(axis=1)
        part = np.where(seen, part, 0.0)[count >= 2]
        count = count[count >= 2]
        mean = part.sum(axis=1) / np.maximum(count, 1)
        spread = np.sum(part**2, axis=1) - count * mean**2
        # of unrelated changes the mean has a variance of one part in `count`
        between += float(
            np.sum(np.maximum(mean**2 - spread / np.maximum(count - 1, 1) / count, 0.0) * count)
        )
        within += float(np.sum(spread * count / np.maximum(count - 1, 1)))
        bands += len(count)
    whole = between + within
    return PathChange(common=between / whole if whole > 0 else 0.0, bands=bands)
