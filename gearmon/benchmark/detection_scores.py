"""Figures of merit of detectors: areas under ROC curves, shares and their intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.errors import ArgumentError

FloatArray = NDArray[np.float64]

RESAMPLES = 400
_NORMAL_95 = 1.959964


def roc_area(healthy: ArrayLike, faulty: ArrayLike) -> float:
    """Area under the ROC curve: the probability that a faulty score exceeds a healthy one.

    Parameters
    ----------
    healthy, faulty : array_like of float, shape (n,), (m,)
        At least one each; ties count half.

    Examples
    --------
    >>> roc_area([0.0, 1.0], [1.0, 2.0])
    0.875
    """
    low = np.sort(np.asarray(healthy, dtype=float))
    high = np.asarray(faulty, dtype=float)
    if not len(low) or not len(high):
        raise ArgumentError("roc_area needs at least one healthy and one faulty score")
    below = np.searchsorted(low, high, "left") + np.searchsorted(low, high, "right")
    return float(below.mean() / (2 * len(low)))


def roc_area_interval(
    healthy: Sequence[FloatArray], faulty: Sequence[FloatArray], seed: int = 0
) -> tuple[float, float, float]:
    """Area under the ROC curve with a 95 % interval by resampling of machines.

    Recordings of one machine resemble one another, so that whole machines are drawn.

    Parameters
    ----------
    healthy, faulty : sequence of ndarray
        Scores, machine by machine; of a machine there may be none.
    seed : int

    Returns
    -------
    (float, float, float)
        Area, lower and upper limit.
    """
    rng = np.random.default_rng(seed)
    area = roc_area(np.concatenate(healthy), np.concatenate(faulty))
    drawn = []
    for _ in range(RESAMPLES):
        chosen = rng.integers(0, len(healthy), len(healthy))
        low = np.concatenate([healthy[i] for i in chosen])
        high = np.concatenate([faulty[i] for i in chosen])
        if len(low) and len(high):
            drawn.append(roc_area(low, high))
    return area, *np.quantile(drawn, (0.025, 0.975)).tolist()


def share_interval(hits: int, trials: int) -> tuple[float, float, float]:
    """Share with its 95 % interval by Wilson.

    Parameters
    ----------
    hits, trials : int
        trials >= 1.

    Examples
    --------
    >>> [round(x, 3) for x in share_interval(0, 10)]
    [0.0, 0.0, 0.278]
    """
    if trials < 1:
        raise ArgumentError(f"trials={trials} must be at least 1")
    share, z2 = hits / trials, _NORMAL_95**2
    centre = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = math.sqrt(share * (1 - share) / trials + z2 / (4 * trials**2)) / (1 + z2 / trials)
    return share, max(0.0, centre - _NORMAL_95 * half), min(1.0, centre + _NORMAL_95 * half)
