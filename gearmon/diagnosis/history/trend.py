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
from scipy.special import ndtri

from gearmon.arrays import FloatArray, IntArray
from gearmon.diagnosis.history.changes import (
    COURSES,
    FEWEST,
    MOST_CHANGES,
    ChangePoint,
    Fits,
    Series,
    find_changes,
    kink_quantile,
)
from gearmon.diagnosis.history.entries import time_text
from gearmon.errors import ArgumentError, check_finite, check_range

#: How far a trend is followed to a limit, in lengths of the series (beyond is as good as never),
#: and in how many steps up to the last recording and from there.
_NEAREST, _FARTHEST, _STEPS = 1e-3, 100.0, (100, 150)
#: Seconds since 1970 beyond the calendar, which are as good as never.
NEVER_S = 2.5e11


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
    common : float, >= 0
        Standard deviation of the logarithm of the values that all of them share: no number of
        recordings averages it out.
    missed : float
        Size up to which something may have been missed wherever nothing was found.
    """

    series: Series
    changes: tuple[ChangePoint, ...]
    level: float
    common: float = 0.0
    missed: float = -math.inf

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
            `high` is nowhere below `missed`, however often nothing was found.
        """
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        value, low, high = self._allowed(times)
        missed = np.where(value < self.missed, self._most * self.missed, high)
        return value, low, np.maximum(high, missed)

    def rate(self) -> tuple[float, float, float]:
        """Slope at the last recording with its interval [1/s]; zeros for a level series."""
        if not self.grows:
            return 0.0, 0.0, 0.0
        value, low, high = self._allowed(self.series.time_s[-1:], rates=True)
        return float(value[0]), float(low[0]), float(high[0])

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
        value, low, _ = (float(x[0]) for x in self.at(self.series.time_s[-1:]))
        times = self.series.time_s
        time, early, late = self._when(limit, float(times[0 if value >= limit else -1]))
        if value >= limit:
            reason = "the trend is at or above the limit"
            reason += "" if low >= limit else "; its interval reaches below the limit"
            return Crossing(status="reached", reason=reason, time_s=time, low_s=early, high_s=late)
        if refused := self._refused(time):
            return Crossing(status="not extrapolated", reason=refused)
        reason = "if growth goes on speeding up as it has"
        if self._last is not None and self._last.growth.straight:
            reason = "if the present rate lasts; cracks grow faster the larger they are"
        return Crossing(status="ahead", reason=reason, time_s=time, low_s=early, high_s=late)

    def _refused(self, time: float | None) -> str:
        """Say why nothing is extrapolated; nothing if it is."""
        if len(self.series) < FEWEST:
            return f"{len(self.series)} estimates are too few for a trend, {FEWEST} needed"
        if not self.grows:
            return "no growth that noise would not make as well"
        if self.rate()[1] <= 0:
            return "the present rate is not surely above zero"
        return "the present rate does not lead to the limit" if time is None else ""

    def _when(self, limit: float, start: float) -> tuple[float | None, float | None, float | None]:
        """Time from which on a rising trend is at a limit, with its interval, which has a start.

        Nothing before the first recording; no end where it may never get there.
        """
        if self.rate()[0] <= 0:
            return None, None, None
        first, last = self.series.time_s[[0, -1]]
        ahead = last + (last - first) * np.geomspace(_NEAREST, _FARTHEST, _STEPS[1])
        times = np.concatenate([np.linspace(first, last, _STEPS[0]), ahead])
        time, late, early = (_reached(times, x, limit) for x in self.at(times))
        if time is None:
            return None, None, None
        early = max(start, time if early is None else min(early, time))
        # what may not rise now may never get there
        late = max(late, time) if late is not None and self.rate()[1] > 0 else None
        return time, early, late

    @property
    def _last(self) -> ChangePoint | None:
        """The latest growth, whose time is uncertain in all intervals."""
        growths = [change for change in self.changes if change.kind == "growth"]
        return growths[-1] if growths else self.changes[-1] if self.changes else None

    @property
    def _most(self) -> float:
        """How many times larger all values may be, or smaller, by what they share."""
        return math.exp(float(ndtri(0.5 + 0.5 * self.level)) * self.common)

    def _allowed(
        self, times: FloatArray, *, rates: bool = False
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value of the trend, or its rate, and the ends of what the data allow."""
        fits, which, room = self._candidates
        value, variance = fits.at(times, which, rates=rates)
        # where any strain is allowed, none is as well: without end
        half = np.sqrt(np.maximum(variance, np.finfo(float).tiny) * room[:, None])
        told, size = value[0], np.maximum(value[0], 0.0)
        below, above = told - (value - half).min(axis=0), (value + half).max(axis=0) - told
        # and what all values share
        below = np.hypot(below, (1.0 - 1.0 / self._most) * size)
        return told, told - below, told + np.hypot(above, (self._most - 1.0) * size)

    @cached_property
    def _candidates(self) -> tuple[Fits, IntArray, FloatArray]:
        """Fits, which of them the data allow, that told first, and how far, squared, each strains.

        They are those of the latest growth, or of a step, from all places. That growth comes to a
        halt is taken only from data that say so: no limit would be sure.
        """
        last = self._last
        others = tuple(change for change in self.changes if change is not last)
        if last is None:
            # a step before the first recording is none
            before, step = self.series.time_s[:1] - 1.0, np.zeros(1, dtype=np.int64)
            fits = Fits(series=self.series, known=others, places=before, courses=step)
            kept = own = np.ones(1, dtype=np.bool_)
        else:
            fits = Fits.of_all(self.series, others)
            own = fits.courses == COURSES.index(last.growth)
            own &= fits.places == last.time_s
            lasting = np.array([growth.folds >= 0 for growth in COURSES])[fits.courses]
            kept = lasting & (fits.courses > 0) if last.kind == "growth" else fits.courses == 0
        which = np.concatenate([np.flatnonzero(own), np.flatnonzero(kept & ~own)])
        if fits.freedom < 1:
            return fits, which, np.full(len(which), math.inf)
        most = fits.variance * kink_quantile(self.level, fits.freedom)
        room = most - (fits.left[which] - fits.left[which].min())
        allowed = room >= 0
        allowed[0] = True
        return fits, which[allowed], np.maximum(room[allowed], 0.0)


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
