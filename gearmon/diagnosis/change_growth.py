"""How a loss grows once it has begun: straight, as a power of time, or exponentially.

A crack grows faster the larger it is. A straight line through such growth meets the level before it
far too late: when it began can only be told along with how it bends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import check_range

FloatArray = NDArray[np.float64]

# Exponents beyond which an exponential is as good as without end, and its square still finite.
_MOST_FOLDS = 200.0


@dataclass(frozen=True, kw_only=True)
class Growth:
    """Course of growth from 0 where it began to 1 at the last recording.

    Parameters
    ----------
    exponent : float, in [1, 10]
        p of ``x^p``; 1 is straight.
    folds : float, in [0, 50]
        g of ``(e^(g x) - 1) / (e^g - 1)``, which is taken if it is above 0.

    Raises
    ------
    ArgumentError
        If a number is out of its range.

    Examples
    --------
    >>> Growth(exponent=2.0).at(np.array([-1.0, 0.5, 1.0, 2.0]))
    array([0.  , 0.25, 1.  , 4.  ])
    """

    exponent: float = 1.0
    folds: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_range("exponent", self.exponent, 1.0, 10.0)
        check_range("folds", self.folds, 0.0, 50.0)

    @property
    def straight(self) -> bool:
        """Whether it does not speed up."""
        return self.exponent == 1.0 and self.folds == 0.0

    @property
    def kind(self) -> str:
        """``straight``, ``power`` or ``exponential``."""
        return "straight" if self.straight else "exponential" if self.folds else "power"

    def at(self, share: FloatArray) -> FloatArray:
        """Return values at shares of the time from its begin to the last recording; 0 before."""
        since = np.maximum(share, 0.0)
        if self.folds:
            grown = np.expm1(np.minimum(self.folds * since, _MOST_FOLDS))
            return np.asarray(grown / np.expm1(self.folds))
        return np.asarray(since**self.exponent)

    def rate(self, share: FloatArray) -> FloatArray:
        """Return the derivative of `at`; 0 up to where it began."""
        since = np.maximum(share, 0.0)
        if self.folds:
            grown = np.exp(np.minimum(self.folds * since, _MOST_FOLDS))
            rate = self.folds * grown / np.expm1(self.folds)
        else:
            rate = self.exponent * since ** (self.exponent - 1.0)
        return np.where(share > 0, rate, 0.0)

    def bend(self, share: FloatArray) -> FloatArray:
        """Return the direction in which `at` moves with the exponent; 0 up to where it began."""
        since = np.maximum(share, 0.0)
        if self.folds:
            return np.asarray(since * np.exp(np.minimum(self.folds * since, _MOST_FOLDS)))
        inside = np.maximum(since, np.finfo(float).tiny)
        return np.asarray(since**self.exponent * np.log(inside))


STRAIGHT = Growth()
#: Courses that are tried, the straight one first.
GROWTHS = (
    STRAIGHT,
    *(Growth(exponent=p) for p in (1.5, 2.0, 2.5, 3.0, 4.0)),
    *(Growth(folds=g) for g in (1.5, 3.0, 4.5, 6.0)),
)
#: How likely each is held beforehand: that growth is straight as likely as that it is not.
CHANCES = np.array([0.5] + [0.05] * 5 + [0.0625] * 4)


def growth_rows(
    time_s: FloatArray, places_s: FloatArray, end_s: float, growth: Growth
) -> FloatArray:
    """Return courses of growth that began at some places, as rows.

    Parameters
    ----------
    time_s : ndarray of float, shape (n,)
        Times [s].
    places_s : ndarray of float, shape (places,)
        Where it began [s], before `end_s`.
    end_s : float
        Time of the last recording [s].
    growth : Growth

    Returns
    -------
    ndarray of float, shape (places, n)
        ``L growth((t - tau) / L)`` with ``L = end_s - tau``: of mean slope 1 up to the last one.
    """
    span = np.maximum(end_s - places_s, np.finfo(float).tiny)[:, None]
    return np.asarray(span * growth.at((time_s - places_s[:, None]) / span))


def growth_rates(
    time_s: FloatArray, places_s: FloatArray, end_s: float, growth: Growth
) -> FloatArray:
    """Return the derivatives of `growth_rows` [1/s], for the same arguments."""
    span = np.maximum(end_s - places_s, np.finfo(float).tiny)[:, None]
    return growth.rate((time_s - places_s[:, None]) / span)
