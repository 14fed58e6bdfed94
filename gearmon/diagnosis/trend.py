"""The trend of a series: piecewise straight, with intervals, and when it reaches a limit.

Everything uncertain about a straight piece enters its intervals, the time of its kink too: they are
profiles of the likelihood over all places of that kink.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.change_points import FEWEST, MOST_CHANGES, find_changes
from gearmon.diagnosis.change_shapes import ChangePoint, Series, base_columns
from gearmon.diagnosis.noise_bounds import kink_quantile
from gearmon.errors import ArgumentError, check_finite, check_range

FloatArray = NDArray[np.float64]
_Rows = Callable[[float | None], FloatArray]

#: Places of the latest kink over which intervals are profiled.
_PLACES = 200


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
        return self._functional(lambda row: self._columns(times, row))

    def rate(self) -> tuple[float, float, float]:
        """Slope at the last recording with its interval [1/s]; zeros for a level series."""
        if not self.grows:
            return 0.0, 0.0, 0.0
        ends = self.series.time_s[-1] + np.array([0.0, self._span])
        value, low, high = self._functional(
            lambda place: np.diff(self._columns(ends, place), axis=0) / self._span
        )
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
        Fieller's interval, as a profile over the time of the kink: those times at which the limit
        lies within what the data allow. It takes the present rate to last.
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
        return Crossing(
            status="ahead",
            reason="if the present rate lasts; cracks grow faster the larger they are",
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

    def _columns(self, times: FloatArray, place: float | None) -> FloatArray:
        """Columns of the model at some times, with the latest growth at `place`."""
        last = self._last
        others = [change for change in self.changes if change is not last]
        columns = base_columns(times, others, with_tangents=False)
        if last is None or place is None:
            return columns
        moved = replace(last, time_s=place)
        return np.column_stack([columns, moved.column(times)])

    @cached_property
    def _fits(self) -> _Fits:
        series, last = self.series, self._last
        places: list[float | None] = [None]
        if last is not None and last.kind == "growth":
            spread = np.linspace(series.time_s[0], series.time_s[-2], _PLACES)
            places = [float(p) for p in np.union1d(spread, [last.time_s])]
        elif last is not None:
            places = [float(p) for p in 0.5 * (series.time_s[1:] + series.time_s[:-1])]
        weight = 1.0 / series.sigma
        matrix = np.array([self._columns(series.time_s, place) for place in places])
        matrix *= weight[:, None]
        # columns of equal size: seconds of years stand beside ones
        size = np.maximum(np.linalg.norm(matrix, axis=1), np.finfo(float).tiny)
        scaled = matrix / size[:, None, :]
        normal = scaled.transpose(0, 2, 1) @ scaled
        inverse = np.linalg.pinv(normal, hermitian=True, rcond=1e-12)
        inverse /= size[:, :, None] * size[:, None, :]
        target = series.value * weight
        coefficients = np.einsum("pij,pnj,n->pi", inverse, matrix, target)
        rest = target - np.einsum("pnj,pj->pn", matrix, coefficients)
        return _Fits(
            rss=np.einsum("pn,pn->p", rest, rest),
            places=places,
            coefficients=coefficients,
            inverse=inverse,
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

    def _functional(self, rows_at: _Rows) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value and interval of linear functions of the coefficients, one a row."""
        fits = self._fits
        budget = self._budget(fits)
        best = int(np.argmin(fits.rss))
        value = rows_at(fits.places[best]) @ fits.coefficients[best]
        low, high = value.copy(), value.copy()
        for number in np.flatnonzero(budget >= 0):
            rows = rows_at(fits.places[number])
            centre = rows @ fits.coefficients[number]
            strain = np.einsum("ij,jk,ik->i", rows, fits.inverse[number], rows)
            half = np.sqrt(np.maximum(strain, 0.0) * budget[number])
            low, high = np.minimum(low, centre - half), np.maximum(high, centre + half)
        return value, low, high

    def when(self, limit: float) -> tuple[float | None, float | None, float | None]:
        """Time at which the straight line through the last piece is at a limit, with its interval.

        Parameters
        ----------
        limit : float

        Returns
        -------
        time_s, low_s, high_s : float or None
            All None where the line does not rise; `high_s` None where it may never get there.
        """
        fits = self._fits
        budget = self._budget(fits)
        now, span = float(self.series.time_s[-1]), self._span
        best = int(np.argmin(fits.rss))
        start, slope = self._line(fits, best)
        if slope @ fits.coefficients[best] <= 0:
            return None, None, None
        time = (limit - start @ fits.coefficients[best]) / (slope @ fits.coefficients[best])
        early, late = float(time), float(time)
        for number in np.flatnonzero(budget >= 0):
            start, slope = self._line(fits, int(number))
            inverse, own = fits.inverse[number], budget[number]
            gap, rate = start @ fits.coefficients[number] - limit, slope @ fits.coefficients[number]
            # (gap + rate s)^2 <= budget * variance(s), a quadratic in s
            a = rate**2 - own * (slope @ inverse @ slope)
            b = gap * rate - own * (start @ inverse @ slope)
            c = gap**2 - own * (start @ inverse @ start)
            if a <= 0 or rate <= 0 or not np.isfinite(own):
                late = math.inf
                continue
            root = math.sqrt(max(b * b - a * c, 0.0))
            early, late = min(early, (-b - root) / a), max(late, (-b + root) / a)
        high = now + span * late if math.isfinite(late) else None
        return now + span * float(time), now + span * early, high

    def _line(self, fits: _Fits, number: int) -> tuple[FloatArray, FloatArray]:
        """Columns at the last recording, and their change over a length of the series."""
        now = float(self.series.time_s[-1])
        ends = self._columns(np.array([now, now + self._span]), fits.places[number])
        return ends[0], ends[1] - ends[0]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fits:
    """Least squares for every place of the latest growth."""

    rss: FloatArray
    places: list[float | None]
    coefficients: FloatArray
    inverse: FloatArray


def fit_trend(
    series: Series, *, below: float = 0.01, level: float = 0.9, most: int = MOST_CHANGES
) -> Trend:
    """Fit the piecewise straight trend of a series.

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


def _refused(reason: str) -> Crossing:
    return Crossing(status="not extrapolated", reason=reason)
