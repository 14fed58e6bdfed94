"""The loss of one tooth over time, and what may be said of it.

What recordings of one machine say of the size of a loss is not independent: all pass the same path
to the sensor and are held against the same response. That part of their uncertainty no number of
recordings averages out. And a recording in which no loss was found does not say that there was
none: only that it was too small to be found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.change_points import change_probability
from gearmon.diagnosis.change_shapes import ChangePoint, Series
from gearmon.diagnosis.history import HALF_OF_90, Place, time_text
from gearmon.diagnosis.trend import Crossing, Trend, fit_trend

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
        value, low, high = self._widened(*(np.array([x]) for x in self.trend.rate()))
        return float(value[0]), float(low[0]), float(high[0])

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
        down, up = self._factors
        early, late = (self.trend.time_at(self.limit * factor) for factor in (down, up))
        times = self.trend.series.time_s
        first = times[-1] if found.status == "ahead" else times[0]
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
        from scipy.special import ndtri

        up = math.exp(float(ndtri(0.5 + 0.5 * self.trend.level)) * self.common)
        return 1.0 / up, up

    def _widened(
        self, value: FloatArray, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Add what all recordings share to the interval of a loss, or of its rate."""
        down, up = self._factors
        size = np.maximum(value, 0.0)
        below = np.hypot(value - low, (1.0 - down) * size)
        above = np.hypot(high - value, (up - 1.0) * size)
        return value, value - below, value + above

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        value, low, high = self.now
        rate = [SECONDS_PER_DAY * x for x in self.rate()]
        crossing, margin = self.crossing, self.margin
        return {
            "stage": self.stage,
            "gear": self.gear,
            "tooth": self.tooth,
            "estimates": len(self.trend.series),
            "recordings": self.recordings,
            "loss": _number(value),
            "loss_low": _number(low),
            "loss_high": _number(high),
            "rate_per_day": _number(rate[0]),
            "rate_per_day_low": _number(rate[1]),
            "rate_per_day_high": _number(rate[2]),
            "false_alarm_probability": self.false_alarm_probability,
            "changes": [change_dict(change) for change in self.trend.changes],
            "limit": self.limit,
            "margin": None if margin is None else _number(margin[0]),
            "margin_low": None if margin is None else _number(margin[1]),
            "margin_high": None if margin is None else _number(margin[2]),
            "limit_reached": None if crossing is None else crossing_dict(crossing),
        }


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
    probability = min(
        [change_probability(stated), *(c.false_alarm_probability for c in trend.changes)]
    )
    reach = HALF_OF_90 * stated.sigma
    ends = zip(places, stated.value - reach, stated.value + reach, strict=True)
    bounds = [
        (
            low if place.loss_low is None else place.loss_low,
            high if place.loss_high is None else place.loss_high,
        )
        for place, low, high in ends
    ]
    found = ToothTrend(
        stage=places[0].stage,
        gear=places[0].gear,
        tooth=places[0].tooth,
        trend=trend,
        low=np.array([low for low, _ in bounds], dtype=float),
        high=np.array([high for _, high in bounds], dtype=float),
        common=common,
        missed=missed,
        stands=False,
        false_alarm_probability=min(1.0, probability * followed),
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
    from scipy.special import bdtrc

    clear = found.low > 0
    _, trend_low, _ = found.at(stated.time_s)
    count = int(np.count_nonzero(clear))
    if np.count_nonzero(clear & (trend_low > 0)) < SEVERAL:
        return False
    by_chance = float(bdtrc(count - 1, len(stated), _CLEAR_BY_CHANCE))
    return bool(found.trend.changes) or by_chance * followed < below


def change_dict(change: ChangePoint) -> dict[str, Any]:
    """Return a change as built-in types, ready for JSON."""
    return {
        "kind": change.kind,
        "course": change.growth.kind if change.kind == "growth" else None,
        "time": time_text(change.time_s),
        "time_low": time_text(change.low_s),
        "time_high": time_text(change.high_s),
        "may_have_begun_before": change.open_before,
        "direction": "rise" if change.size > 0 else "fall",
        "false_alarm_probability": change.false_alarm_probability,
    }


def crossing_dict(crossing: Crossing) -> dict[str, Any]:
    """Return when a limit is reached as built-in types, ready for JSON."""
    return {
        "status": crossing.status,
        "reason": crossing.reason,
        "time": _moment(crossing.time_s),
        "time_low": _moment(crossing.low_s),
        "time_high": _moment(crossing.high_s),
    }


def _moment(time_s: float | None) -> str | None:
    # a slow trend may reach its limit after the year 9999, which is as good as never
    return None if time_s is None or not 0 <= time_s < 2.5e11 else time_text(time_s)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
