"""Shapes of a change over time: growth of any course, and steps, as columns of a model.

A crack grows faster the larger it is: besides the straight line there are powers of time and
exponentials.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.history.recording_times import time_text
from gearmon.errors import ArgumentError, check_range

FloatArray = NDArray[np.float64]

# Exponents beyond which an exponential is as good as without end, and its square still finite.
_MOST_FOLDS = 200.0
_TINY = np.finfo(float).tiny


@dataclass(frozen=True, kw_only=True)
class Growth:
    """Course of a change from 0 before it began to 1 at the last recording.

    Parameters
    ----------
    exponent : float, 0 or in [1, 10]
        p of ``x^p``; 1 is straight, 0 a step.
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
        if self.exponent:
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
        return np.where(share > 0, since**self.exponent, 0.0)

    def rate(self, share: FloatArray) -> FloatArray:
        """Return the derivative of `at`; 0 up to where it began."""
        since = np.maximum(share, _TINY)
        if self.folds:
            grown = np.exp(np.minimum(self.folds * since, _MOST_FOLDS))
            rate = self.folds * grown / np.expm1(self.folds)
        else:
            rate = self.exponent * since ** (self.exponent - 1.0)
        return np.where(share > 0, rate, 0.0)

    def bend(self, share: FloatArray) -> FloatArray:
        """Return the direction in which `at` moves with the exponent; 0 up to where it began."""
        since = np.maximum(share, _TINY)
        if self.folds:
            grown = since * np.exp(np.minimum(self.folds * since, _MOST_FOLDS))
            return np.where(share > 0, grown, 0.0)
        return np.asarray(since**self.exponent * np.log(since))


STEP, STRAIGHT = Growth(exponent=0.0), Growth()
#: Courses of growth that are tried, the straight one first.
GROWTHS = (
    STRAIGHT,
    *(Growth(exponent=p) for p in (1.5, 2.0, 2.5, 3.0, 4.0)),
    *(Growth(folds=g) for g in (1.5, 3.0, 4.5, 6.0)),
)
#: How likely each is held beforehand: that growth is straight as likely as that it is not.
CHANCES = np.array([0.5] + [0.05] * 5 + [0.0625] * 4)


def growth_rows(
    time_s: FloatArray, places_s: FloatArray, end_s: float, growth: Growth, *, rates: bool = False
) -> FloatArray:
    """Return a course that began at some places, as rows.

    Parameters
    ----------
    time_s : ndarray of float, shape (n,)
        Times [s].
    places_s : ndarray of float, shape (places,)
        Where it began [s], before `end_s`.
    end_s : float
        Time of the last recording [s].
    growth : Growth
    rates : bool
        Whether derivatives [1/s] are asked for.

    Returns
    -------
    ndarray of float, shape (places, n)
        Of growth ``L growth((t - tau) / L)`` with ``L = end_s - tau``: of mean slope 1 up to the
        last one. A step has the height 1.
    """
    span = np.maximum(end_s - places_s, _TINY)[:, None]
    share = (time_s - places_s[:, None]) / span
    if rates:
        return growth.rate(share)
    return np.asarray(growth.at(share) * (span if growth.exponent else 1.0))


@dataclass(frozen=True, kw_only=True)
class ChangePoint:
    """One change of a series.

    Parameters
    ----------
    growth : Growth
        Its course.
    time_s : float
        Of growth when it began; of a step the middle between the two recordings [s].
    end_s : float
        Time of the last recording [s].
    low_s, high_s : float
        Interval of `time_s` [s], at the level asked for; see `open_before`.
    open_before : bool
        Whether the interval begins with the first recording: it may have begun before.
    size : float
        Growth: change of slope, mean up to the last recording [1/s]. Step: its height.
    false_alarm_probability : float
        Bound on the probability that noise gives as clear a change anywhere in the series.
    """

    growth: Growth
    time_s: float
    end_s: float
    low_s: float = -math.inf
    high_s: float = math.inf
    open_before: bool = True
    size: float = 0.0
    false_alarm_probability: float = 1.0

    @property
    def kind(self) -> str:
        """``growth`` from some time on, or a ``step`` between two recordings."""
        return "growth" if self.growth.exponent else "step"

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "kind": self.kind,
            "course": self.growth.kind if self.growth.exponent else None,
            "time": time_text(self.time_s),
            "time_low": time_text(self.low_s),
            "time_high": time_text(self.high_s),
            "may_have_begun_before": self.open_before,
            "direction": "rise" if self.size > 0 else "fall",
            "false_alarm_probability": self.false_alarm_probability,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Series:
    """Values over time with their standard deviations.

    Parameters
    ----------
    time_s : ndarray of float, shape (n,)
        Strictly increasing [s].
    value : ndarray of float, shape (n,)
    sigma : ndarray of float, shape (n,)
        Standard deviations, > 0.
    sigma_known : bool
        Whether they are known in size and not only relative to one another: noise is then never
        held to be smaller, whatever the scatter.

    Raises
    ------
    ArgumentError
        If shapes, order or values are wrong.
    """

    time_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    sigma_known: bool = True

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        for name in ("time_s", "value", "sigma"):
            own = np.array(getattr(self, name), dtype=float)
            if own.ndim != 1 or len(own) != len(self.time_s) or not np.isfinite(own).all():
                raise ArgumentError(
                    f"{name}: must be a row of finite numbers, as many as times; shape {own.shape}"
                )
            own.flags.writeable = False
            object.__setattr__(self, name, own)
        if np.any(np.diff(self.time_s) <= 0):
            raise ArgumentError("time_s: times must increase strictly")
        if np.any(self.sigma <= 0):
            raise ArgumentError("sigma: standard deviations must be > 0")

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.time_s)


def change_columns(
    time_s: FloatArray,
    changes: Sequence[ChangePoint],
    *,
    tangents: bool = False,
    rates: bool = False,
) -> FloatArray:
    """Return a constant and the shapes of some changes as columns.

    Parameters
    ----------
    time_s : ndarray of float, shape (n,)
        Times [s].
    changes : sequence of ChangePoint
    tangents : bool
        Whether growth brings the directions in which it would move and bend as well: what growth
        that is a little off leaves behind must not be taken for another change.
    rates : bool
        Whether derivatives [1/s] are asked for.

    Returns
    -------
    ndarray of float, shape (n, columns)
    """
    columns = [np.full(len(time_s), 0.0 if rates else 1.0)]
    for change in changes:
        place, growth = np.array([change.time_s]), change.growth
        columns.append(growth_rows(time_s, place, change.end_s, growth, rates=rates)[0])
        if tangents and growth.exponent:
            share = (time_s - change.time_s) / (change.end_s - change.time_s)
            columns += [growth.rate(share), growth.bend(share)]
    return np.column_stack(columns)
