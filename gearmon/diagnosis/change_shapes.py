"""Shapes of changes over time: kinks and steps, as columns of a model and directions of noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.change_growth import STRAIGHT, Growth
from gearmon.errors import ArgumentError

FloatArray = NDArray[np.float64]

#: Fewest recordings that must bear a change: one that stands out is not yet a change.
BORNE_BY = 2
#: Most places of a change that are tried between two recordings and in all; of long series fewer,
#: for the sake of time.
_BETWEEN, _MOST_PLACES, _LEAST_PLACES = 16, 4000, 200
_MOST_NUMBERS = 400_000


@dataclass(frozen=True, kw_only=True)
class ChangePoint:
    """One change of a series.

    Parameters
    ----------
    kind : {"growth", "step"}
        Growth from some time on, or a jump between two recordings.
    time_s : float
        Of growth when it began; of a step the middle between the two recordings [s].
    low_s, high_s : float
        Interval of that time [s], at the level asked for; see `open_before`.
    open_before : bool
        Whether the interval begins with the first recording: it may have begun before.
    size : float
        Growth: change of slope, mean up to the last recording [1/s]. Step: its height.
    false_alarm_probability : float
        Bound on the probability that noise gives as clear a change anywhere in the series.
    growth : Growth
        Of growth: its course.
    span_s : float, > 0
        Of growth: from `time_s` to the last recording [s].
    """

    kind: str
    time_s: float
    low_s: float
    high_s: float
    open_before: bool
    size: float
    false_alarm_probability: float
    growth: Growth = STRAIGHT
    span_s: float = 1.0

    def column(self, time_s: FloatArray) -> FloatArray:
        """Return the shape of the change at some times, for unit size."""
        since = np.asarray(time_s, dtype=float) - self.time_s
        if self.kind == "growth":
            return np.asarray(self.span_s * self.growth.at(since / self.span_s))
        return np.asarray(since > 0, dtype=float)

    def rate(self, time_s: FloatArray) -> FloatArray:
        """Return the derivative of `column`; 0 for a step."""
        since = np.asarray(time_s, dtype=float) - self.time_s
        if self.kind == "growth":
            return self.growth.rate(since / self.span_s)
        return np.zeros(len(since))

    def tangents(self, time_s: FloatArray) -> list[FloatArray]:
        """Return the directions in which `column` moves with the time and the course of growth."""
        if self.kind != "growth":
            return []
        share = (np.asarray(time_s, dtype=float) - self.time_s) / self.span_s
        return [self.growth.rate(share), self.growth.bend(share)]


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


def base_columns(
    time_s: FloatArray, changes: Sequence[ChangePoint], *, with_tangents: bool
) -> FloatArray:
    """Return a constant and the shapes of some changes as columns.

    Parameters
    ----------
    time_s : ndarray of float, shape (n,)
        Times [s].
    changes : sequence of ChangePoint
    with_tangents : bool
        Whether growth brings the directions in which it would move and bend as well: what growth
        that is a little off leaves behind must not be taken for another change.

    Returns
    -------
    ndarray of float, shape (n, columns)
    """
    columns = [np.ones(len(time_s))]
    for change in changes:
        columns.append(change.column(time_s))
        if with_tangents:
            columns += change.tangents(time_s)
    return np.column_stack(columns)


def kinks(time_s: FloatArray, borne_by: int = BORNE_BY) -> tuple[FloatArray, FloatArray]:
    """Return the places of a kink that are tried, and its shapes as rows."""
    knots = time_s[: len(time_s) - borne_by]
    most = _most_places(len(time_s))
    between = max(1, min(_BETWEEN, most // max(1, len(knots))))
    numbers = np.linspace(0, len(knots) - 1, min(most, between * (len(knots) - 1) + 1))
    places = np.interp(numbers, np.arange(len(knots)), knots)
    return places, np.maximum(time_s[None, :] - places[:, None], 0.0)


def _most_places(count: int) -> int:
    return min(_MOST_PLACES, max(_LEAST_PLACES, _MOST_NUMBERS // count))


def steps(time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the middles between recordings at which a step is tried, and its shapes as rows."""
    middles = 0.5 * (time_s[1:] + time_s[:-1])[BORNE_BY - 1 : len(time_s) - BORNE_BY]
    most = _most_places(len(time_s))
    if len(middles) > most:
        middles = middles[np.linspace(0, len(middles) - 1, most).astype(int)]
    return middles, np.asarray(time_s[None, :] > middles[:, None], dtype=float)


def directions(rows: FloatArray, basis: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return unit directions of shapes beside a basis, and which shapes have one."""
    before = np.linalg.norm(rows, axis=1)
    rest = rows - (rows @ basis) @ basis.T
    after = np.linalg.norm(rest, axis=1)
    kept = after > 1e-7 * np.maximum(before, np.finfo(float).tiny)
    return rest[kept] / after[kept, None], kept


def path_length(path: FloatArray) -> float:
    """Length of a path through directions, which may be turned round."""
    inner = np.abs(np.sum(path[1:] * path[:-1], axis=1))
    return float(np.arccos(np.minimum(inner, 1.0)).sum())
