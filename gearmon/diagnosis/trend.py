"""The trend of a series: levels and growth, with intervals, and when it reaches a limit.

Everything uncertain about the latest growth enters the intervals, when it began and how it bends
too: they are profiles of the likelihood over all places and courses of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.change_growth import GROWTHS, growth_rates, growth_rows
from gearmon.diagnosis.change_points import FEWEST, MOST_CHANGES, find_changes
from gearmon.diagnosis.change_shapes import ChangePoint, Series, base_columns
from gearmon.diagnosis.noise_bounds import kink_quantile
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

    @property
    def scatter(self) -> float:
        """Scatter about the trend, in standard deviations of the values; nan if none is left."""
        freedom = self._freedom
        if freedom < 1:
            return math.nan
        return math.sqrt(float(self._fits.rss.min()) / freedom)

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
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        which = self._allowed[0]
        parts = [
            self._functional(self._columns(part, which))
            for part in np.split(times, range(_AT_ONCE, len(times), _AT_ONCE))
        ]
        value, low, high = (np.concatenate(each) for each in zip(*parts, strict=True))
        return value, low, high

    def rate(self) -> tuple[float, float, float]:
        """Slope at the last recording with its interval [1/s]; zeros for a level series."""
        if not self.grows:
            return 0.0, 0.0, 0.0
        rows = self._columns(self.series.time_s[-1:], self._allowed[0], rates=True)
        value, low, high = self._functional(rows)
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
        if value >= limit:
            sure = "" if low >= limit else "; its interval reaches below the limit"
            time, early, late = self.when(limit) if self.grows else (None, None, None)
            return Crossing(
                status="reached",
                reason=f"the trend is at or above the limit{sure}",
                time_s=time,
                low_s=early,
                high_s=late,
            )
        if len(self.series) < FEWEST:
            return _refused(
                f"{len(self.series)} estimates are too few for a trend, {FEWEST} needed"
            )
        if not self.grows:
            return _refused("no growth that noise would not make as well")
        slope, least, _ = self.rate()
        if slope <= 0 or least <= 0:
            return _refused("the present rate is not surely above zero")
        time, early, late = self.when(limit)
        if time is None:
            return _refused("the present rate does not lead to the limit")
        last = self._last
        straight = last is None or last.growth.straight
        return Crossing(
            status="ahead",
            reason="if the present rate lasts; cracks grow faster the larger they are"
            if straight
            else "if growth goes on speeding up as it has",
            time_s=time,
            low_s=None if early is None else max(early, float(self.series.time_s[-1])),
            high_s=late,
        )

    @property
    def _span(self) -> float:
        return float(self.series.time_s[-1] - self.series.time_s[0])

    @property
    def _last(self) -> ChangePoint | None:
        """The latest growth, whose time is uncertain in all intervals."""
        growths = [change for change in self.changes if change.kind == "growth"]
        return growths[-1] if growths else (self.changes[-1] if self.changes else None)

    @property
    def _freedom(self) -> int:
        return len(self.series) - 1 - 2 * len(self.changes)

    @cached_property
    def _candidates(self) -> tuple[FloatArray, IntArray]:
        """Places and courses of the latest growth, or places of a step; those told come first.

        Both empty where nothing changed.
        """
        last, times = self._last, self.series.time_s
        if last is None:
            return np.zeros(0), np.zeros(0, dtype=np.int64)
        if last.kind == "step":
            places = np.concatenate([[last.time_s], 0.5 * (times[1:] + times[:-1])])
            return places, np.zeros(len(places), dtype=np.int64)
        count = max(_LEAST_PLACES, min(_PLACES, _MOST_NUMBERS // len(times)))
        spread = np.union1d(np.linspace(times[0], times[-2], count), [last.time_s])
        places = np.concatenate([[last.time_s], np.tile(spread, len(GROWTHS))])
        courses = np.repeat(np.arange(len(GROWTHS)), len(spread))
        return places, np.concatenate([[GROWTHS.index(last.growth)], courses])

    def _columns(self, times: FloatArray, which: IntArray, *, rates: bool = False) -> FloatArray:
        """Columns of the model at some times, or their rates, of some of the candidates.

        Shape (candidates, times, columns), that of the latest growth last.
        """
        last = self._last
        others = [change for change in self.changes if change is not last]
        if rates:
            known = [np.zeros(len(times)), *(change.rate(times) for change in others)]
            fixed = np.column_stack(known)
        else:
            fixed = base_columns(times, others, with_tangents=False)
        columns = np.repeat(fixed[None], len(which), axis=0)
        if last is None:
            return columns
        return np.concatenate([columns, self._moved(last, times, which, rates)[..., None]], axis=2)

    def _moved(
        self, last: ChangePoint, times: FloatArray, which: IntArray, rates: bool
    ) -> FloatArray:
        """Return the latest growth as each candidate has it, shape (candidates, times)."""
        places, courses = (each[which] for each in self._candidates)
        if last.kind == "step":
            since = times > places[:, None]
            return np.asarray(since & (not rates), dtype=float)
        moved = np.empty((len(which), len(times)))
        end = float(self.series.time_s[-1])
        for number, growth in enumerate(GROWTHS):
            own = courses == number
            rows = growth_rates if rates else growth_rows
            moved[own] = rows(times, places[own], end, growth)
        return moved

    @cached_property
    def _fits(self) -> _Fits:
        series = self.series
        weight = 1.0 / series.sigma
        every = np.arange(max(1, len(self._candidates[0])))
        matrix = self._columns(series.time_s, every)
        matrix *= weight[:, None]
        # columns of equal size: seconds of years stand beside ones
        size = np.maximum(np.linalg.norm(matrix, axis=1), np.finfo(float).tiny)
        scaled = matrix / size[:, None, :]
        normal = scaled.transpose(0, 2, 1) @ scaled
        inverse = np.linalg.pinv(normal, hermitian=True, rcond=1e-12)
        inverse /= size[:, :, None] * size[:, None, :]
        target = series.value * weight
        coefficients = np.einsum("pij,pj->pi", inverse, matrix.transpose(0, 2, 1) @ target)
        rest = target - np.einsum("pnj,pj->pn", matrix, coefficients)
        return _Fits(
            rss=np.einsum("pn,pn->p", rest, rest), coefficients=coefficients, inverse=inverse
        )

    def _budget(self, fits: _Fits) -> FloatArray:
        """Return how far, squared, each fit may be strained; negative where it is excluded."""
        if self._freedom < 1:
            return np.full(len(fits.rss), math.inf)
        least = float(fits.rss.min())
        variance = least / self._freedom
        if self.series.sigma_known:
            # an agreement better than the stated uncertainties allow is not taken at its word
            variance = max(variance, 1.0)
        return variance * kink_quantile(self.level, self._freedom) - (fits.rss - least)

    @cached_property
    def _allowed(self) -> tuple[IntArray, FloatArray]:
        """Candidates that the data allow, that which is told first, and their budgets."""
        budget = self._budget(self._fits)
        others = 1 + np.flatnonzero(budget[1:] >= 0)
        which = np.concatenate([[0], others])
        return which, np.maximum(budget[which], 0.0)

    def _reach(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and half widths of linear functions, shape (allowed, functions)."""
        which, budget = self._allowed
        centre = (rows @ self._fits.coefficients[which][:, :, None])[..., 0]
        strain = np.sum(rows @ self._fits.inverse[which] * rows, axis=2)
        finite = np.where(np.isfinite(budget), budget, 0.0)[:, None]
        half = np.sqrt(np.maximum(strain, 0.0) * finite)
        half[~np.isfinite(budget)] = math.inf
        return centre, half

    def _functional(self, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value and interval of linear functions, shape (allowed, functions, columns)."""
        centre, half = self._reach(rows)
        low: FloatArray = (centre - half).min(axis=0)
        high: FloatArray = (centre + half).max(axis=0)
        return centre[0].copy(), low, high

    def when(self, limit: float) -> tuple[float | None, float | None, float | None]:
        """Time at which the trend is at a limit that it rises to, with its interval.

        Parameters
        ----------
        limit : float

        Returns
        -------
        time_s, low_s, high_s : float or None
            All None where it does not rise to it; `high_s` None where it may never get there.
        """
        time = self.time_at(limit)
        if time is None:
            return None, None, None
        times, which = self._followed, self._allowed[0]
        parts = [
            self._reach(self._columns(part, which))
            for part in np.split(times, range(_AT_ONCE, len(times), _AT_ONCE))
        ]
        centre, half = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
        early = _reached(times, (centre + half).max(axis=0), limit)
        rate, unsure = self._reach(self._columns(self.series.time_s[-1:], which, rates=True))
        # what may not rise now may never get there
        never = bool(np.any(rate <= unsure))
        late = None if never else _reached(times, (centre - half).min(axis=0), limit)
        return (
            time,
            time if early is None else min(early, time),
            None if late is None else max(late, time),
        )

    def time_at(self, limit: float) -> float | None:
        """Time at which the trend as told is at a limit that it rises to; None where it never is.

        Before the first recording it is not followed.
        """
        if self.rate()[0] <= 0:
            return None
        told = np.zeros(1, dtype=np.int64)
        rows = self._columns(self._followed, told)[0]
        return _reached(self._followed, rows @ self._fits.coefficients[0], limit)

    @property
    def _followed(self) -> FloatArray:
        """Times at which a trend is held against a limit."""
        times = self.series.time_s
        ahead = times[-1] + self._span * np.geomspace(_NEAREST, _FARTHEST, _STEPS[1])
        behind = np.linspace(times[0], times[-1], _STEPS[0])
        return np.concatenate([behind, ahead])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fits:
    """Least squares for every candidate of the latest growth."""

    rss: FloatArray
    coefficients: FloatArray
    inverse: FloatArray


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


def _refused(reason: str) -> Crossing:
    return Crossing(status="not extrapolated", reason=reason)
