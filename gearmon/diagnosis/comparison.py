"""A recording's levels against healthy ones: what changed beyond load, gain and scatter.

Levels of a healthy machine move together with load and with the gain of a sensor. The healthy
recordings span those movements (their mean, their one or two main directions, one common gain a
channel); what is left of a new recording after the best fit within that span is its change. How
much healthy recordings themselves depart is learned by leaving each out in turn, together with a
prior that two recordings are worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.signatures.families import Family

FloatArray = NDArray[np.float64]

# What a healthy line is taken to move by from recording to recording before any is seen [dB], and
# the recordings that this prior is worth.
PRIOR_SCATTER_DB = 2.0
PRIOR_WORTH = 2.0
# Prior standard deviation of a channel's common gain [dB]: a factor of two, there and back.
GAIN_DB = 6.0
# How far along its main directions, in standard deviations seen, a healthy machine may go.
SPAN = 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelChange:
    """Change of every family of lines against healthy recordings.

    Parameters
    ----------
    expected_db : ndarray of float, shape (channels, families)
        Level to expect of the healthy machine at this load and gain [dB].
    residual_db : ndarray of float, shape (channels, families)
        Measured less expected level [dB].
    sigma_db : ndarray of float, shape (channels, families)
        Standard deviation of that difference on a healthy machine [dB].
    worth : float
        Recordings, prior included, that the scatter was learned from.
    """

    expected_db: FloatArray
    residual_db: FloatArray
    sigma_db: FloatArray
    worth: float

    @property
    def standardised(self) -> FloatArray:
        """Residual over its standard deviation, shape (channels, families)."""
        return self.residual_db / self.sigma_db


def compare_levels(
    level_db: FloatArray,
    scatter_db: FloatArray,
    healthy_db: FloatArray,
    healthy_scatter_db: FloatArray,
) -> LevelChange:
    """Compare levels with those of healthy recordings.

    Parameters
    ----------
    level_db, scatter_db : ndarray of float, shape (channels, families)
        Levels of the new recording and their standard errors [dB].
    healthy_db, healthy_scatter_db : ndarray of float, shape (recordings, channels, families)
        The same of the healthy recordings, at least one.

    Returns
    -------
    LevelChange
    """
    between_db, worth = healthy_scatter(healthy_db, healthy_scatter_db)
    return _fitted(level_db, scatter_db, healthy_db, healthy_scatter_db, between_db, worth)


def healthy_scatter(healthy_db: FloatArray, healthy_scatter_db: FloatArray) -> tuple[float, float]:
    """Learn how far a healthy recording departs from the span of the others.

    Each recording is left out in turn and fitted by the rest. The median of its squared residuals
    (robust against single lines) joins the prior.

    Parameters
    ----------
    healthy_db, healthy_scatter_db : ndarray of float, shape (recordings, channels, families)
        Levels and their standard errors [dB].

    Returns
    -------
    between_db : float
        Standard deviation between healthy recordings [dB].
    worth : float
        Recordings that it rests on, prior included.
    """
    count = len(healthy_db)
    squares = []
    for left_out in range(count if count > 1 else 0):
        rest = [row for row in range(count) if row != left_out]
        change = _fitted(
            healthy_db[left_out],
            healthy_scatter_db[left_out],
            healthy_db[rest],
            healthy_scatter_db[rest],
            PRIOR_SCATTER_DB,
            PRIOR_WORTH,
        )
        # 0.455 is the median of a squared standard normal variable
        squares.append(float(np.median(change.residual_db**2)) / 0.455)
    total = PRIOR_WORTH * PRIOR_SCATTER_DB**2 + sum(squares)
    worth = PRIOR_WORTH + len(squares)
    return float(np.sqrt(total / worth)), worth


def _fitted(
    level_db: FloatArray,
    scatter_db: FloatArray,
    healthy_db: FloatArray,
    healthy_scatter_db: FloatArray,
    between_db: float,
    worth: float,
) -> LevelChange:
    """Fit the span of the healthy recordings to new levels by reweighted least squares."""
    mean = healthy_db.mean(axis=0)
    shared = np.mean(healthy_scatter_db**2, axis=0) / len(healthy_db)
    sigma = np.sqrt(scatter_db**2 + shared + between_db**2)
    directions, prior = _span(healthy_db)
    target = (level_db - mean).ravel()
    weight = 1.0 / sigma.ravel() ** 2
    robust = np.ones_like(weight)
    for _ in range(8):
        weighted = directions * (weight * robust)[:, None]
        normal = directions.T @ weighted + np.diag(1.0 / prior**2)
        fit = directions @ np.linalg.solve(normal, weighted.T @ target)
        standard = np.abs(target - fit) / sigma.ravel()
        # a fault changes some families a lot: those must not pull the fit towards themselves
        robust = np.minimum(1.0, 1.5 / np.maximum(standard, 1e-12))
    expected = mean + fit.reshape(mean.shape)
    return LevelChange(
        expected_db=expected,
        residual_db=level_db - expected,
        sigma_db=sigma,
        worth=worth,
    )


def _span(healthy_db: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Directions in which healthy levels move, and how far they may go along each."""
    recordings, channels, families = healthy_db.shape
    gains = np.repeat(np.eye(channels), families, axis=1).T
    priors: list[float] = [GAIN_DB] * channels
    columns: list[FloatArray] = [gains]
    if recordings > 1:
        centred = (healthy_db - healthy_db.mean(axis=0)).reshape(recordings, -1)
        _, size, direction = np.linalg.svd(centred, full_matrices=False)
        scale = 1.0 / np.sqrt(recordings - 1)
        for row in range(min(recordings - 1, 2)):
            columns.append((direction[row] * size[row] * scale)[:, None])
            priors.append(SPAN)
    return np.hstack(columns), np.array(priors)


@dataclass(frozen=True, kw_only=True)
class LevelTest:
    """Test whether some families of lines changed.

    Parameters
    ----------
    rms : float
        Root mean square of the standardised changes, each cut at five.
    log10_probability : float
        Logarithm of the probability of as much on a healthy machine.
    """

    rms: float
    log10_probability: float


def judge_levels(standardised: FloatArray, worth: float, independent: float) -> LevelTest:
    """Test standardised changes against a healthy machine's.

    Parameters
    ----------
    standardised : ndarray of float
        Changes over their standard deviations, any shape.
    worth : float
        Recordings that the standard deviation rests on.
    independent : float
        Changes counted as independent: families about one mesh harmonic move together.

    Returns
    -------
    LevelTest

    Notes
    -----
    The mean square follows an F law with `independent` and `worth * independent` degrees of
    freedom if every recording, like those left out while learning, scatters alike.
    """
    if standardised.size == 0:
        return LevelTest(rms=0.0, log10_probability=0.0)
    square = float(np.mean(np.minimum(standardised**2, 25.0)))
    return LevelTest(
        rms=float(np.sqrt(square)),
        log10_probability=_log10_f(square, independent, worth * independent),
    )


def _log10_f(value: float, above: float, below: float) -> float:
    """log10 of the probability that F(above, below) exceeds a value."""
    from scipy.special import betainc

    x = below / (below + above * value)
    return float(np.log10(max(float(betainc(below / 2, above / 2, x)), 1e-300)))


@dataclass(frozen=True, kw_only=True)
class GroupTest:
    """Test of the families of one kind, stage and gear.

    Parameters
    ----------
    kind : {"mesh", "sidebands", "residual"}
        Kind of the families.
    stage : int
        Stage, from 1.
    gear : str
        Gear that their spacing belongs to ("" for the mesh itself).
    rms : float
        Root mean square of the standardised changes.
    log10_probability : float
        Logarithm of the probability of as much in any of the groups of a healthy machine.
    """

    kind: str
    stage: int
    gear: str
    rms: float
    log10_probability: float


def judge_groups(change: LevelChange, families: Sequence[Family]) -> tuple[GroupTest, ...]:
    """Test each group of families by itself: a weak tooth moves the sidebands of one gear only.

    Parameters
    ----------
    change : LevelChange
        Changes of the families.
    families : sequence of Family
        What its columns are.

    Returns
    -------
    tuple of GroupTest
        Strongest first, probabilities corrected for the number of groups.
    """
    columns: dict[tuple[str, int, str], list[int]] = {}
    for column, family in enumerate(families):
        columns.setdefault((family.kind, family.stage, family.gear), []).append(column)
    channels = float(np.sqrt(change.residual_db.shape[0]))
    tests = []
    for (kind, stage, gear), members in columns.items():
        harmonics = len({families[column].harmonic for column in members})
        test = judge_levels(change.standardised[:, members], change.worth, harmonics * channels)
        corrected = min(0.0, test.log10_probability + float(np.log10(len(columns))))
        tests.append(
            GroupTest(kind=kind, stage=stage, gear=gear, rms=test.rms, log10_probability=corrected)
        )
    return tuple(sorted(tests, key=lambda test: test.log10_probability))
