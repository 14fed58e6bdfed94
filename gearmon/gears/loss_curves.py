"""Loss of stiffness of a pair as a function of where it is in contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Share = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class LossCurve:
    """A share of the stiffness along the contact.

    Parameters
    ----------
    share : callable
        Maps phases [mesh periods from the entry of the pair], any shape, to shares.
    corners : tuple of float
        Phases at which the share is not smooth.
    """

    share: Share
    corners: tuple[float, ...] = ()

    def times(self, other: LossCurve) -> LossCurve:
        """Return the product of two curves."""
        one, two = self.share, other.share
        return LossCurve(
            share=lambda phase: one(phase) * two(phase),
            corners=tuple(sorted({*self.corners, *other.corners})),
        )

    def stretched(self, factor: float) -> LossCurve:
        """Return the same curve over a contact that is `factor` times as long."""
        share = self.share
        return LossCurve(
            share=lambda phase: share(phase / factor),
            corners=tuple(factor * corner for corner in self.corners),
        )
