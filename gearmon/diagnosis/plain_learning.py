"""A plain machine-learning detector: novelty among indicators, without any physics.

What many monitoring systems do, as a yardstick: an isolation forest that has seen how the
indicators of healthy machines change from one recording to the next.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError

FloatArray = NDArray[np.float64]

TREES = 100


def novelty(healthy: FloatArray, candidates: FloatArray, seed: int = 0) -> FloatArray:
    """Return how unlike healthy rows of features each candidate is.

    Parameters
    ----------
    healthy : ndarray of float, shape (n, features), n >= 2
        Features of healthy recordings, such as logarithms of indicators over those of a reference.
    candidates : ndarray of float, shape (m, features)
    seed : int

    Returns
    -------
    ndarray of float, shape (m,)
        In (0, 1); rises with novelty.

    Raises
    ------
    ArgumentError
        If the shapes do not fit or a feature is not finite.

    References
    ----------
    Liu, Ting and Zhou, Isolation forest, ICDM 2008.
    """
    known, new = np.asarray(healthy, dtype=float), np.asarray(candidates, dtype=float)
    if known.ndim != 2 or new.ndim != 2 or len(known) < 2 or known.shape[1] != new.shape[1]:
        raise ArgumentError(
            f"healthy {known.shape} and candidates {new.shape} must be tables with the same "
            "features, and at least two healthy rows"
        )
    if not (np.isfinite(known).all() and np.isfinite(new).all()):
        raise ArgumentError("features must be finite numbers")
    if not len(new):
        return np.zeros(0)
    from sklearn.ensemble import IsolationForest

    forest = IsolationForest(n_estimators=TREES, random_state=seed).fit(known)
    return -np.asarray(forest.score_samples(new), dtype=np.float64)
