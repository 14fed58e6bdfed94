"""The loss of one tooth over time, and what may be said of it.

What recordings of one machine say of the size of a loss is not independent: all pass the same path
to the sensor and are held against the same response. That part of their uncertainty no number of
recordings averages out. And a recording in which no loss was found does not say that there was
none: only that it was too small to be found.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc, ndtri

from gearmon.diagnosis.history.entries import HALF_OF_90, Place
from gearmon.diagnosis.history.onset import change_probability
from gearmon.diagnosis.history.shapes import Series
from gearmon.diagnosis.history.trend import Crossing, Trend, fit_trend

FloatArray = NDArray[np.float64]

SECONDS_PER_DAY = 86400.0
#: Fewest recordings in which a loss has to stand clear of zero by itself to be listed.
SEVERAL = 3
# Probability that a sound tooth stands clear in one recording: its own interval is one of 90 %.
_CLEAR_BY_CHANCE = 0.05
# What differs from recording to recording besides noise, load above all, as a share of the loss.
_OWN_SHARE = 0.05
# Against a reference larger losses are hardly ever missed.
_MOST_MISSED = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothTrend:
    """The loss of one tooth, or the largest of one gear, over time.

    Parameters
    ----------
    stage : int
    gear : str
    tooth : int or None
        None: the largest loss of the gear, where teeth cannot be told from one recording to
        another.
    trend : Trend
        Of the loss as a fraction; its intervals are those of what differs between recordings.
    low, high : ndarray of float, shape (estimates,)
        The recordings' own 90 % intervals.
    common : float, >= 0
        Standard deviation of the logarithm of the loss that all recordings share.
    missed : float, >= 0
        Loss up to which one may have been missed wherever none was found: the smallest that was
        found, 10 % at most; 0 if none was.
    stands : bool
        Whether the loss stands clear of its noise and of zero, over several recordings.
    false_alarm_probability : float
        Bound on the probability of a change as clear on any tooth of a machine without one.
    recordings : int
        Recordings in the history; those beyond the trend's had no estimate.
    limit : float or None
        What the loss is held against.
    """

    stage: int
    gear: str
    tooth: int | None
    trend: Trend
    low: FloatArray
    high: FloatArray
    common: float
    missed: float
    stands: bool
    false_alarm_probability: float
    recordings: int
    limit: float | None

    def at(self, time_s: FloatArray | Sequence[float]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Loss at some times with its interval, what all recordings share included.

        Parameters
        ----------
        time_s : array_like of float, shape (k,)
            Times [s].

        Returns
        -------
        value, low, high : ndarray of float, shape (k,)
            `high` is nowhere below `missed`, however often nothing was found.
        """
        value, low, high = self._widened(*self.trend.at(time_s))
        missed = np.where(value < self.missed, self._factors[1] * self.missed, high)
        return value, low, np.maximum(high, missed)

    def rate(self) -> tuple[float, float, float]:
        """Rise of the loss at the newest recording with its interval [1/s]."""
        value, low, high = self._widened(*np.array(self.trend.rate()))
        return float(value), float(low), float(high)

    @property
    def now(self) -> tuple[float, float, float]:
        """Loss at the newest recording with its interval."""
        value, low, high = self.at(self.trend.series.time_s[-1:])
        return float(value[0]), float(low[0]), float(high[0])

    @property
    def margin(self) -> tuple[float, float, float] | None:
        """What is left to the limit at the newest recording, with its interval."""
        if self.limit is None:
            return None
        value, low, high = self.now
        return self.limit - value, self.limit - high, self.limit - low

    @property
    def crossing(self) -> Crossing | None:
        """When the limit is reached, what all recordings share included in the interval."""
        if self.limit is None:
            return None
        found = self.trend.crossing(self.limit)
        if found.status == "reached" and self.now[1] < self.limit:
            reason = "the trend is at or above the limit; its interval reaches below the limit"
            found = replace(found, reason=reason)
        if found.time_s is None:
            return found
        early, late = (self.trend.time_at(self.limit * factor) for factor in self._factors)
        first = self.trend.series.time_s[-1 if found.status == "ahead" else 0]
        low, high = found.low_s, found.high_s
        if low is not None and early is not None:
            low = found.time_s - math.hypot(found.time_s - low, found.time_s - early)
            low = max(low, float(first))
        if high is not None and late is not None:
            high = found.time_s + math.hypot(high - found.time_s, late - found.time_s)
        return replace(found, low_s=low, high_s=high)

    @property
    def risen(self) -> bool:
        """Whether its latest change is a rise."""
        return bool(self.trend.changes) and self.trend.changes[-1].size > 0

    @property
    def _factors(self) -> tuple[float, float]:
        """How much smaller and larger all losses may be, at the level of the trend."""
        up = math.exp(float(ndtri(0.5 + 0.5 * self.trend.level)) * self.common)
        return 1.0 / up, up

    def _widened(
        self, value: FloatArray, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Add what all recordings share to the interval of a loss, or of its rate."""
        (down, up), size = self._factors, np.maximum(value, 0.0)
        below = np.hypot(value - low, (1.0 - down) * size)
        above = np.hypot(high - value, (up - 1.0) * size)
        return value, value - below, value + above

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        crossing, per_day = self.crossing, np.multiply(SECONDS_PER_DAY, self.rate())
        return {
            "stage": self.stage,
            "gear": self.gear,
            "tooth": self.tooth,
            "estimates": len(self.trend.series),
            "recordings": self.recordings,
            **_with_interval("loss", self.now),
            **_with_interval("rate_per_day", per_day),
            "false_alarm_probability": self.false_alarm_probability,
            "changes": [change.to_dict() for change in self.trend.changes],
            "limit": self.limit,
            **_with_interval("margin", self.margin or [math.nan] * 3),
            "limit_reached": None if crossing is None else crossing.to_dict(),
        }


def _with_interval(name: str, values: Iterable[float]) -> dict[str, float | None]:
    names = (name, f"{name}_low", f"{name}_high")
    return {n: float(x) if np.isfinite(x) else None for n, x in zip(names, values, strict=True)}


def follow_tooth(
    time_s: Sequence[float],
    places: Sequence[Place],
    *,
    followed: int,
    below: float,
    level: float,
    recordings: int,
    limit: float | None,
) -> ToothTrend:
    """Follow one tooth, or one gear as a whole, through its recordings.

    Parameters
    ----------
    time_s : sequence of float
        Times of the recordings that estimate its loss, strictly increasing [s].
    places : sequence of Place
        What they say, as many.
    followed : int, >= 1
        Teeth followed in all, for which probabilities are corrected.
    below : float, in (0, 0.5]
        Probability of calling a change on any of them if there is none.
    level : float, in (0, 1)
        Of all intervals.
    recordings : int
        Recordings in the history.
    limit : float or None
        What the loss is held against.

    Returns
    -------
    ToothTrend

    Notes
    -----
    Whether the loss changed is tested with the uncertainties as stated: those of a sound tooth.
    Once it has, the trend is fitted with `own_series`, and how it went on is no longer a question
    of how many teeth there are.
    """
    stated = Series(
        time_s=np.array(time_s, dtype=float),
        value=np.array([place.loss for place in places], dtype=float),
        sigma=np.array([place.loss_sigma for place in places], dtype=float),
    )
    own, common, missed = own_series(stated)
    trend = fit_trend(stated, below=below / followed, level=level)
    if trend.changes:
        refined = fit_trend(own, below=below, level=level)
        # a loss that came at once may hide behind what could have been missed before it
        trend = refined if refined.changes else trend
    chances = [change_probability(stated), *(c.false_alarm_probability for c in trend.changes)]
    low, high = (
        np.array([getattr(place, name) for place in places], dtype=float)
        for name in ("loss_low", "loss_high")
    )
    reach = HALF_OF_90 * stated.sigma
    found = ToothTrend(
        stage=places[0].stage,
        gear=places[0].gear,
        tooth=places[0].tooth,
        trend=trend,
        low=np.where(np.isnan(low), stated.value - reach, low),
        high=np.where(np.isnan(high), stated.value + reach, high),
        common=common,
        missed=missed,
        stands=False,
        false_alarm_probability=min(1.0, min(chances) * followed),
        recordings=recordings,
        limit=limit,
    )
    return replace(found, stands=_stands(found, stated, followed, below))


def own_series(stated: Series) -> tuple[Series, float, float]:
    """Split the uncertainty of losses into what all recordings share and what each has by itself.

    Parameters
    ----------
    stated : Series
        Losses with their standard deviations.

    Returns
    -------
    own : Series
        With standard deviations of what differs between recordings.
    common : float
        Standard deviation, relative to the loss, of what they share.
    missed : float
        Loss up to which one may have been missed where none was found; 0 if none was found at all.

    Notes
    -----
    No recording is surer of the size than what all share, so the relative uncertainty of the surest
    is taken for that; it errs to the safe side. Estimates that do not stand clear of zero may have
    missed a loss as large as the smallest that was found, but hardly one of more than 10 %.
    """
    value, sigma = stated.value, stated.sigma
    clear = value > HALF_OF_90 * sigma
    if not clear.any():
        return stated, 0.0, 0.0
    common = float(np.min(sigma[clear] / value[clear]))
    own = np.sqrt(np.maximum(sigma**2 - (common * value) ** 2, 0.0))
    own = np.maximum(own, np.maximum(sigma.min(), _OWN_SHARE * np.abs(value)))
    missed = min(_MOST_MISSED, float(value[clear].min()))
    own[~clear] = np.maximum(own[~clear], missed / HALF_OF_90)
    return replace(stated, sigma=own), common, missed


def _stands(found: ToothTrend, stated: Series, followed: int, below: float) -> bool:
    """Tell whether a loss stands clear of zero in its trend and in several recordings."""
    clear = found.low > 0
    _, trend_low, _ = found.at(stated.time_s)
    if np.count_nonzero(clear & (trend_low > 0)) < SEVERAL:
        return False
    by_chance = bdtrc(np.count_nonzero(clear) - 1.0, len(stated), _CLEAR_BY_CHANCE)
    return bool(found.trend.changes) or float(by_chance) * followed < below
