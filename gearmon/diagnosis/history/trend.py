"""The trend of a series: levels and growth, with intervals, and when it reaches a limit.

Everything uncertain about the latest growth enters the intervals, when it began and how it bends
too: they are profiles of the likelihood over all places and courses of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.history.noise_bounds import kink_quantile
from gearmon.diagnosis.history.onset import FEWEST, MOST_CHANGES, find_changes
from gearmon.diagnosis.history.recording_times import time_text
from gearmon.diagnosis.history.shapes import (
    GROWTHS,
    STEP,
    ChangePoint,
    Series,
    change_columns,
    growth_rows,
)
from gearmon.errors import ArgumentError, check_finite, check_range

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Places of the latest growth over which intervals are profiled; fewer of long series.
_PLACES, _LEAST_PLACES, _MOST_NUMBERS = 160, 20, 200_000
#: Times at once, so that memory stays small.
_AT_ONCE = 256
#: How far a trend is followed to a limit, in lengths of the series (beyond is as good as never),
#: and in how many steps up to the last recording and from there.
_NEAREST, _FARTHEST, _STEPS = 1e-3, 100.0, (100, 150)
#: Seconds since 1970 beyond the calendar, which are as good as never.
NEVER_S = 2.5e11
_COURSES = (STEP, *GROWTHS)
_Times = tuple[float | None, float | None, float | None]


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """When a trend reaches a limit, or why that is not said.

    Parameters
    ----------
    status : {"reached", "ahead", "not extrapolated"}
    reason : str
        In words.
    time_s, low_s, high_s : float or None
        When, with its interval [s]; None where not said. `high_s` None with a `time_s`: the data do
        not exclude that it is never reached.
    """

    status: str
    reason: str
    time_s: float | None = None
    low_s: float | None = None
    high_s: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        named = {"time": self.time_s, "time_low": self.low_s, "time_high": self.high_s}
        times = {
            name: None if time is None or not 0 <= time < NEVER_S else time_text(time)
            for name, time in named.items()
        }
        return {"status": self.status, "reason": self.reason} | times


@dataclass(frozen=True, kw_only=True, eq=False)
class Trend:
    """A series with its changes.

    Parameters
    ----------
    series : Series
    changes : tuple of ChangePoint
        In the order of time; none: the series is constant as far as can be told.
    level : float
        Of all intervals.
    """

    series: Series
    changes: tuple[ChangePoint, ...]
    level: float

    @property
    def grows(self) -> bool:
        """Whether any straight piece rises or falls."""
        return any(change.kind == "growth" for change in self.changes)

    def at(self, time_s: FloatArray | Sequence[float]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value of the trend with its interval.

        Parameters
        ----------
        time_s : array_like of float, shape (k,)
            Times [s].

        Returns
        -------
        value, low, high : ndarray of float, shape (k,)
        """
        centre, half = self._allowed(np.atleast_1d(np.asarray(time_s, dtype=float)))
        return centre[0].copy(), (centre - half).min(axis=0), (centre + half).max(axis=0)

    def rate(self) -> tuple[float, float, float]:
        """Slope at the last recording with its interval [1/s]; zeros for a level series."""
        if not self.grows:
            return 0.0, 0.0, 0.0
        centre, half = self._allowed(self.series.time_s[-1:], rates=True)
        return float(centre[0, 0]), float((centre - half).min()), float((centre + half).max())

    def crossing(self, limit: float) -> Crossing:
        """When the trend reaches a limit from below.

        Parameters
        ----------
        limit : float

        Returns
        -------
        Crossing
            Nothing is extrapolated from a trend that noise could make, nor from one that does not
            rise.

        Notes
        -----
        Fieller's interval, as a profile over the time and the course of growth: those times at
        which the limit lies within what the data allow. It takes growth to go on in its course,
        straight or faster and faster.
        """
        check_finite("limit", limit)
        end = self.series.time_s[-1:]
        value, low, _ = (float(x[0]) for x in self.at(end))
        time, early, late = self._when(limit)
        if value >= limit:
            status, reason = "reached", "the trend is at or above the limit"
            reason += "" if low >= limit else "; its interval reaches below the limit"
        elif refused := self._refused(time):
            return Crossing(status="not extrapolated", reason=refused)
        else:
            status, reason = "ahead", "if growth goes on speeding up as it has"
            if self._last is not None and self._last.growth.straight:
                reason = "if the present rate lasts; cracks grow faster the larger they are"
            early = None if early is None else max(early, float(end[0]))
        return Crossing(status=status, reason=reason, time_s=time, low_s=early, high_s=late)

    def _refused(self, time: float | None) -> str:
        """Say why nothing is extrapolated; nothing if it is."""
        if len(self.series) < FEWEST:
            return f"{len(self.series)} estimates are too few for a trend, {FEWEST} needed"
        if not self.grows:
            return "no growth that noise would not make as well"
        slope, least, _ = self.rate()
        if slope <= 0 or least <= 0:
            return "the present rate is not surely above zero"
        return "the present rate does not lead to the limit" if time is None else ""

    def time_at(self, limit: float) -> float | None:
        """Time at which the trend as told is at a limit that it rises to; None where it never is.

        Before the first recording it is not followed.
        """
        if self.rate()[0] <= 0:
            return None
        centre, _ = self._allowed(self._followed, only=slice(1))
        return _reached(self._followed, centre[0], limit)

    def _when(self, limit: float) -> _Times:
        """Return that time with its interval; its end None where it may never get there."""
        time = self.time_at(limit)
        if time is None:
            return None, None, None
        centre, half = self._allowed(self._followed)
        early = _reached(self._followed, (centre + half).max(axis=0), limit)
        late = _reached(self._followed, (centre - half).min(axis=0), limit)
        # what may not rise now may never get there
        never = late is None or self.rate()[1] <= 0
        low = time if early is None else min(early, time)
        return time, low, None if never or late is None else max(late, time)

    @property
    def _followed(self) -> FloatArray:
        """Times at which a trend is held against a limit."""
        first, last = self.series.time_s[[0, -1]]
        ahead = last + (last - first) * np.geomspace(_NEAREST, _FARTHEST, _STEPS[1])
        return np.concatenate([np.linspace(first, last, _STEPS[0]), ahead])

    @property
    def _last(self) -> ChangePoint | None:
        """The latest growth, whose time is uncertain in all intervals."""
        growths = [change for change in self.changes if change.kind == "growth"]
        return growths[-1] if growths else (self.changes[-1] if self.changes else None)

    @cached_property
    def _candidates(self) -> tuple[FloatArray, IntArray]:
        """Places and courses of the latest growth, or places of a step; those told come first."""
        last, times = self._last, self.series.time_s
        if last is None:  # it takes no part
            return times[:1], np.zeros(1, dtype=np.int64)
        told = _COURSES.index(last.growth)
        if last.kind == "step":
            places = np.concatenate([[last.time_s], 0.5 * (times[1:] + times[:-1])])
            return places, np.full(len(places), told)
        count = max(_LEAST_PLACES, min(_PLACES, _MOST_NUMBERS // len(times)))
        spread = np.union1d(np.linspace(times[0], times[-2], count), [last.time_s])
        courses = np.repeat(np.arange(1, len(_COURSES)), len(spread))
        places = np.tile(spread, len(GROWTHS))
        return np.concatenate([[last.time_s], places]), np.concatenate([[told], courses])

    def _columns(self, times: FloatArray, which: IntArray, rates: bool = False) -> FloatArray:
        """Columns of the model for some candidates, shape (candidates, times, columns)."""
        last, end = self._last, float(self.series.time_s[-1])
        others = [change for change in self.changes if change is not last]
        fixed = change_columns(times, others, rates=rates)
        columns = np.repeat(fixed[None], len(which), axis=0)
        if last is None:
            return columns
        places, courses = (each[which] for each in self._candidates)
        moved = np.empty((len(which), len(times), 1))
        for number in np.unique(courses):
            own, course = courses == number, _COURSES[number]
            moved[own, :, 0] = growth_rows(times, places[own], end, course, rates=rates)
        return np.concatenate([columns, moved], axis=2)

    @cached_property
    def _fits(self) -> _Fits:
        """Least squares for every candidate that the data allow, that which is told first."""
        series, every = self.series, np.arange(len(self._candidates[0]))
        matrix = self._columns(series.time_s, every) / series.sigma[:, None]
        # columns of equal size: seconds of years stand beside ones
        size = np.maximum(np.linalg.norm(matrix, axis=1), np.finfo(float).tiny)
        scaled = matrix / size[:, None, :]
        normal = scaled.transpose(0, 2, 1) @ scaled
        inverse = np.linalg.pinv(normal, hermitian=True, rcond=1e-12)
        inverse /= size[:, :, None] * size[:, None, :]
        target = series.value / series.sigma
        found = np.einsum("pij,pj->pi", inverse, matrix.transpose(0, 2, 1) @ target)
        rest = target - np.einsum("pnj,pj->pn", matrix, found)
        budget = self._budget(np.einsum("pn,pn->p", rest, rest))
        which = np.flatnonzero((budget >= 0) | (every == 0))
        return _Fits(
            which=which,
            coefficients=found[which],
            inverse=inverse[which],
            budget=np.maximum(budget[which], 0.0),
        )

    def _budget(self, left: FloatArray) -> FloatArray:
        """Return how far, squared, each fit may be strained; negative where it is excluded."""
        freedom = len(self.series) - 1 - 2 * len(self.changes)
        if freedom < 1:
            return np.full(len(left), math.inf)
        # an agreement better than the stated uncertainties allow is not taken at its word
        least = 1.0 if self.series.sigma_known else 0.0
        variance = max(float(left.min()) / freedom, least)
        return np.asarray(variance * kink_quantile(self.level, freedom) - (left - left.min()))

    def _allowed(
        self, times: FloatArray, *, rates: bool = False, only: slice = slice(None)
    ) -> tuple[FloatArray, FloatArray]:
        """Values, or rates, of the allowed fits and their half widths, shape (fits, times)."""
        fits, found = self._fits, []
        budget = fits.budget[only, None]
        for part in np.split(times, range(_AT_ONCE, len(times), _AT_ONCE)):
            rows = self._columns(part, fits.which[only], rates)
            centre = (rows @ fits.coefficients[only, :, None])[..., 0]
            strain = np.sum(rows @ fits.inverse[only] * rows, axis=2)
            # where any strain is allowed, none is as well: without end
            found.append((centre, np.sqrt(np.maximum(strain, np.finfo(float).tiny) * budget)))
        centres, halves = zip(*found, strict=True)
        return np.concatenate(centres, axis=1), np.concatenate(halves, axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fits:
    which: IntArray
    coefficients: FloatArray
    inverse: FloatArray
    budget: FloatArray


def fit_trend(
    series: Series, *, below: float = 0.01, level: float = 0.9, most: int = MOST_CHANGES
) -> Trend:
    """Fit the trend of a series.

    Parameters
    ----------
    series : Series
    below : float, in (0, 0.5]
        Probability of calling any change in a series without one.
    level : float, in (0, 1)
        Of all intervals.
    most : int
        Changes looked for.

    Returns
    -------
    Trend

    Raises
    ------
    ArgumentError
        If the series is empty or a level is out of its range.
    """
    check_range("level", level, 0.0, 1.0)
    if not len(series):
        raise ArgumentError("series: is empty; a trend needs at least one value")
    changes = find_changes(series, below=below, level=level, most=most)
    return Trend(series=series, changes=changes, level=level)


def _reached(times: FloatArray, values: FloatArray, limit: float) -> float | None:
    """Time from which on values stay at or above a limit; None if they end below it."""
    below = np.flatnonzero(values < limit)
    if not len(below):
        return float(times[0])
    last = int(below[-1])
    if last + 1 >= len(times):
        return None
    one, two = values[last], values[last + 1]
    share = (limit - one) / (two - one) if math.isfinite(one) and math.isfinite(two) else 1.0
    return float(times[last] + share * (times[last + 1] - times[last]))
