"""When growth began and how it bends; the interval of the time of a change.

Along the courses of growth (straight, powers of time, exponentials) the time at which it began
trades off against how it bends, so that the likelihood is flat along a ridge. Its interval is the
profile over all courses, joined with the credible interval of even chances: the first alone ends
a little too soon where the courses tried lie far apart for the noise. The time itself is the
median of what the courses and places leave possible, whose bias is a small part of that of a
kink.

References
----------
Y.-C. Yao, Approximating the distribution of the maximum likelihood estimate of the change-point,
Ann. Statist. 15 (1987), for the two-sided walk about a step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.change_growth import CHANCES, GROWTHS, Growth, growth_rows
from gearmon.diagnosis.change_shapes import (
    ChangePoint,
    Series,
    base_columns,
    directions,
    steps,
)
from gearmon.diagnosis.noise_bounds import kink_quantile, step_quantile

FloatArray = NDArray[np.float64]

# Places between two recordings at which growth may have begun, about so many in all, and at most.
_BETWEEN, _PLACES, _MOST_PLACES = 16, 320, 1000


@dataclass(frozen=True, kw_only=True, eq=False)
class _Table:
    """What growth of every course from every place, and every step, leave of a series."""

    places: FloatArray
    growth: FloatArray
    middles: FloatArray
    step: FloatArray
    variance: float

    @classmethod
    def of(cls, series: Series, others: Sequence[ChangePoint]) -> _Table:
        places = _places(series.time_s)
        middles, rows = steps(series.time_s)
        end = float(series.time_s[-1])
        grown = [growth_rows(series.time_s, places, end, course) for course in GROWTHS]
        growth = profile(series, np.concatenate(grown), others).reshape(len(GROWTHS), -1)
        step = profile(series, rows, others)
        variance = min(growth.min(), step.min()) / max(1, _freedom(series, others))
        if series.sigma_known:
            variance = max(variance, 1.0)
        return cls(places=places, growth=growth, middles=middles, step=step, variance=variance)

    @property
    def least(self) -> float:
        return float(min(self.growth.min(), self.step.min()))

    @property
    def chance(self) -> FloatArray:
        """Chance of each course from each place, shape (courses, places)."""
        scale = max(self.variance, np.finfo(float).tiny)
        told = np.exp(-0.5 * (self.growth - self.growth.min()) / scale)
        # places stand closer together where recordings do
        chance = CHANCES[:, None] * told * np.gradient(self.places)
        return np.asarray(chance / chance.sum())


def _places(time_s: FloatArray) -> FloatArray:
    """Return the places at which growth may have begun: any before the last recording but one."""
    knots = time_s[:-1]
    between = int(np.clip(_PLACES // len(knots), 1, _BETWEEN))
    count = min(_MOST_PLACES, between * (len(knots) - 1) + 1)
    return np.interp(np.linspace(0, len(knots) - 1, count), np.arange(len(knots)), knots)


def _freedom(series: Series, others: Sequence[ChangePoint]) -> int:
    return len(series) - 3 - len(others)


def shaped(series: Series, change: ChangePoint, others: Sequence[ChangePoint]) -> ChangePoint:
    """Return a change with the course and place of growth that fit best.

    Parameters
    ----------
    series : Series
    change : ChangePoint
        Growth as a kink, or a step; a step that growth explains better, by more than one fitted
        number is worth, becomes growth.
    others : sequence of ChangePoint
        Known changes.

    Returns
    -------
    ChangePoint
    """
    table = _Table.of(series, others)
    worth = table.variance * math.log(len(series))
    if change.kind == "step" and table.growth.min() + worth > table.step.min():
        return change
    course, place = np.unravel_index(int(np.argmin(table.growth)), table.growth.shape)
    return _grown(series, change, float(table.places[place]), GROWTHS[course])


def _grown(series: Series, change: ChangePoint, time_s: float, growth: Growth) -> ChangePoint:
    span = float(series.time_s[-1]) - time_s
    return replace(change, kind="growth", time_s=time_s, growth=growth, span_s=span)


def with_interval(
    series: Series, change: ChangePoint, others: Sequence[ChangePoint], level: float
) -> ChangePoint:
    """Return a change with its time and the interval of that.

    Parameters
    ----------
    series : Series
    change : ChangePoint
    others : sequence of ChangePoint
        Known changes.
    level : float, in (0, 1)
        Of the interval.

    Returns
    -------
    ChangePoint
        A small change may be a step as well as growth: places of both count.
    """
    times, freedom = series.time_s, _freedom(series, others)
    if freedom < 1:
        return change
    table = _Table.of(series, others)
    quantile = kink_quantile(level, freedom)
    if change.kind == "step":
        quantile = max(quantile, step_quantile(level, freedom))
    most = table.least + table.variance * quantile + np.finfo(float).tiny
    # a step lies anywhere between the recordings on its two sides
    later = np.searchsorted(times, table.middles[table.step <= most])
    kept = [table.places[table.growth.min(axis=0) <= most], times[later - 1], times[later]]
    if change.kind == "growth":
        chance = table.chance.sum(axis=0)
        below = np.cumsum(chance) - 0.5 * chance
        inside = [0.5 - 0.5 * level, 0.5, 0.5 + 0.5 * level]
        low, middle, high = np.interp(inside, below, table.places)
        near = int(np.argmin(np.abs(table.places - middle)))
        course = GROWTHS[int(np.argmax(table.chance[:, near]))]
        change = _grown(series, change, float(table.places[near]), course)
        kept.append(np.array([low, high]))
    else:
        change = replace(change, time_s=float(table.middles[np.argmin(table.step)]))
    reach = np.concatenate(kept)
    return replace(
        change,
        low_s=float(reach.min()),
        high_s=float(reach.max()),
        open_before=bool(reach.min() <= times[0]),
    )


def profile(series: Series, rows: FloatArray, others: Sequence[ChangePoint]) -> FloatArray:
    """Return the weighted sum of squares that each of some shapes leaves, beside known changes.

    Parameters
    ----------
    series : Series
    rows : ndarray of float, shape (places, n)
        Shapes of the change at each place.
    others : sequence of ChangePoint

    Returns
    -------
    ndarray of float, shape (places,)
    """
    weight = 1.0 / series.sigma
    base = base_columns(series.time_s, others, with_tangents=False)
    basis = np.linalg.qr(base * weight[:, None])[0]
    rest = series.value * weight
    rest = rest - basis @ (basis.T @ rest)
    paths, kept = directions(rows * weight, basis)
    rss = np.full(len(rows), float(rest @ rest))
    rss[kept] -= (paths @ rest) ** 2
    return np.asarray(np.maximum(rss, 0.0))
