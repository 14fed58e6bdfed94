"""What a history shows: the loss of each tooth over time, when it began, and what margin is left.

A trend is levels and growth, with intervals, and tells when it reaches a limit. Everything
uncertain about the latest growth enters the intervals, when it began and how it bends too: they are
profiles of the likelihood over all places and courses of it.

Losses are followed tooth by tooth where recordings estimate them. The score of the recordings is
followed as well: it tells when something began even where no loss can be estimated. The scores of
sound machines follow no known law, so whether they changed is tested by permutation.

What recordings of one machine say of the size of a loss is not independent: all pass the same path
to the sensor and are held against the same response. That part of their uncertainty no number of
recordings averages out. And a recording in which no loss was found does not say that there was
none: only that it was too small to be found.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import bdtrc, ndtri_exp, stdtrit

from gearmon.arrays import FloatArray, IntArray
from gearmon.diagnosis.history import changes as onsets
from gearmon.diagnosis.history.changes import BELOW, FEWEST, LEVEL, ChangePoint, Fits, Series
from gearmon.diagnosis.history.entries import HALF_OF_90, History, Place, time_text
from gearmon.errors import check_range
from gearmon.result import Result

SECONDS_PER_DAY = 86400.0
#: Fewest recordings in which a loss has to stand clear of zero by itself to be listed.
SEVERAL = 3
# Probability that a sound tooth stands clear in one recording: its own interval is one of 90 %.
_CLEAR_BY_CHANCE = 0.05
# What differs from recording to recording besides noise, load above all, as a share of the loss.
_OWN_SHARE = 0.05
# Against a reference larger losses are hardly ever missed.
_MOST_MISSED = 0.1
# Share of the false-alarm probability given to all losses together, and what that makes; the score
# gets the rest.
_LOSS_SHARE = 0.5
_LOSS_BELOW = _LOSS_SHARE * BELOW
#: Newest recordings for which it is told what could be forecast at their time.
FORECASTS = 20
#: How far a trend is followed to a limit, in lengths of the series (beyond is as good as never),
#: and in how many steps up to the last recording and from there.
_NEAREST, _FARTHEST, _STEPS = 1e-3, 100.0, (100, 150)
# Time over which the present rate is read, in lengths of the series.
_RATE_OVER = 1e-4
#: Seconds since 1970 beyond the calendar, which are as good as never.
NEVER_S = 2.5e11
_Key = tuple[int, str, int | None]
_Changes = tuple[ChangePoint, ...]
_Points = list[tuple[float, Place]]


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
        times = {"time": self.time_s, "time_low": self.low_s, "time_high": self.high_s}
        return {"status": self.status, "reason": self.reason} | {
            name: time_text(time) if time is not None and 0 <= time < NEVER_S else None
            for name, time in times.items()
        }


class Trend:
    """A series with its changes.

    Parameters
    ----------
    series : Series
    changes : tuple of ChangePoint
        In the order of time; none: the series is constant as far as can be told.
    common : float, >= 0
        Standard deviation of the logarithm of the values that all of them share: no number of
        recordings averages it out.
    missed : float
        Size up to which something may have been missed wherever nothing was found.

    Attributes
    ----------
    grows : bool
        Whether any straight piece rises or falls.
    """

    def __init__(
        self, series: Series, changes: _Changes, common: float = 0.0, missed: float = -math.inf
    ) -> None:
        self.series, self.changes, self.common, self.missed = series, changes, common, missed
        growths = [change for change in changes if change.kind == "growth"]
        self.grows = bool(growths)
        # the latest growth, whose time is uncertain in all intervals
        self._last = next(reversed(growths or changes), None)
        # how many times larger all values may be, or smaller, by what they share
        self._most = math.exp(HALF_OF_90 * common)

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
        times = self.series.time_s
        if not self.grows:
            return 0.0, 0.0, 0.0
        # the derivative of a parabola through three times from the last recording on
        step = _RATE_OVER * (times[-1] - times[0])
        weights = np.array([[-1.5, 2.0, -0.5]]) / step
        value, low, high = self._allowed(times[-1] + step * np.arange(3), weights)
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
        first, last = self.series.time_s[[0, -1]].tolist()
        value, low, _ = (float(x[0]) for x in self.at([last]))
        rate, slowest, _ = self.rate()
        when: dict[str, float | None] = {}
        if rate > 0:
            ahead = last + (last - first) * np.geomspace(_NEAREST, _FARTHEST, _STEPS[1])
            times = np.concatenate([np.linspace(first, last, _STEPS[0]), ahead])
            time, late, early = (_reached(times, x, limit) for x in self.at(times))
            if time is not None:
                # nothing before the recordings, or before the last where it is not yet there
                start = first if value >= limit else last
                early = max(start, time if early is None else min(early, time))
                # what may not rise now may never get there
                late = max(late, time) if late is not None and slowest > 0 else None
                when = {"time_s": time, "low_s": early, "high_s": late}
        status = "not extrapolated"
        if value >= limit:
            status, reason = "reached", "the trend is at or above the limit"
            reason += "" if low >= limit else "; its interval reaches below the limit"
        elif len(self.series) < FEWEST:
            reason = f"{len(self.series)} estimates are too few for a trend, {FEWEST} needed"
        elif not self.grows:
            reason = "no growth that noise would not make as well"
        elif slowest <= 0:
            reason = "the present rate is not surely above zero"
        elif not when:
            reason = "the present rate does not lead to the limit"
        else:
            status, reason = "ahead", "if growth goes on speeding up as it has"
            if self._last is not None and self._last.growth.straight:
                reason = "if the present rate lasts; cracks grow faster the larger they are"
        told = {} if status == "not extrapolated" else when
        return Crossing(status=status, reason=reason, **told)

    def _allowed(
        self, times: FloatArray, weights: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value of the trend, or sums of it, and the ends of what the data allow."""
        fits, which, room = self._candidates
        value, variance = fits.at(times, which, weights)
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
            fits = Fits.of(self.series, others, bent=True)
            own = fits.courses == onsets.COURSES.index(last.growth)
            own &= fits.places == last.time_s
            lasting = np.array([growth.folds >= 0 for growth in onsets.COURSES])[fits.courses]
            kept = lasting & (fits.courses > 0) if last.kind == "growth" else fits.courses == 0
        which = np.concatenate([np.flatnonzero(own), np.flatnonzero(kept & ~own)])
        if fits.freedom < 1:
            return fits, which, np.full(len(which), math.inf)
        most = fits.variance * float(stdtrit(fits.freedom, 0.5 + 0.5 * LEVEL)) ** 2
        room = most - (fits.left[which] - fits.left[which].min())
        allowed = room >= 0
        allowed[0] = True
        return fits, which[allowed], np.maximum(room[allowed], 0.0)


def fit_trend(series: Series, *, below: float = BELOW, most: int = onsets.MOST_CHANGES) -> Trend:
    """Fit the trend of a series.

    Parameters
    ----------
    series : Series
    below : float, in (0, 0.5]
        Probability of calling any change in a series without one.
    most : int
        Changes looked for.

    Returns
    -------
    Trend
    """
    return Trend(series, onsets.find_changes(series, below=below, most=most))


def _reached(times: FloatArray, values: FloatArray, limit: float) -> float | None:
    """Time from which on values stay at or above a limit; None if they end below it."""
    last = int(np.max(np.flatnonzero(values < limit), initial=-1))
    if last + 1 >= len(times):
        return None
    about = slice(max(last, 0), last + 2)
    return float(np.interp(limit, values[about], times[about]))


class ToothTrend:
    """The loss of one tooth, or the largest of one gear, through the recordings of a machine.

    Parameters
    ----------
    key : tuple of (int, str, int or None)
        Stage, gear and tooth.
    points : list of (float, Place)
        What recordings said of it, with their times [s].
    followed : int
        Teeth of the machine that are followed.
    limit : float or None
        What the loss is held against.

    Attributes
    ----------
    stage : int
    gear : str
    tooth : int or None
        None: the largest loss of the gear, where teeth cannot be told from one recording to
        another.
    trend : Trend
        Of the loss as a fraction. What may have been missed is the smallest that was found, 10 % at
        most; nothing if none was.
    low, high : ndarray of float, shape (estimates,)
        The recordings' own 90 % intervals.
    stands : bool
        Whether the loss stands clear of its noise and of zero, over several recordings.
    false_alarm_probability : float
        Bound on the probability of a change as clear on any tooth of a machine without one.
    risen : bool
        Whether its latest change is a rise.
    now : tuple of float
        Loss at the newest recording with its interval.
    margin : tuple of float or None
        What is left to the limit at the newest recording, with its interval.
    limit : float or None

    Notes
    -----
    Whether the loss changed is tested with the uncertainties as stated: those of a sound tooth.
    Once it has, the trend is fitted with what differs between recordings, and how it went on is no
    longer a question of how many teeth there are.
    """

    def __init__(self, key: _Key, points: _Points, followed: int, limit: float | None) -> None:
        (self.stage, self.gear, self.tooth), self.limit = key, limit
        rows = [[time, p.loss, p.loss_sigma, p.loss_low, p.loss_high] for time, p in points]
        time_s, value, sigma, low, high = np.array(rows, dtype=float).T
        stated = Series(time_s=time_s, value=value, sigma=sigma)
        own, common, missed = sigma, 0.0, 0.0
        found = value > HALF_OF_90 * sigma
        if found.any():
            # no recording is surer of the size than what all share: the relative uncertainty of the
            # surest is taken for that, which errs to the safe side
            common = float(np.min(sigma[found] / value[found]))
            own = np.sqrt(np.maximum(sigma**2 - (common * value) ** 2, 0.0))
            own = np.maximum(own, np.maximum(sigma.min(), _OWN_SHARE * np.abs(value)))
            # where none was found, one as large as the smallest that was may have been missed, but
            # hardly one of more than 10 %
            missed = min(_MOST_MISSED, float(value[found].min()))
            own[~found] = np.maximum(own[~found], missed / HALF_OF_90)
        trend = fit_trend(stated, below=_LOSS_BELOW / followed)
        if trend.changes:
            refined = fit_trend(replace(stated, sigma=own), below=_LOSS_BELOW)
            # a loss that came at once may hide behind what could have been missed before it
            trend = refined if refined.changes else trend
        self.trend = trend = Trend(trend.series, trend.changes, common, missed)
        chances = [change.false_alarm_probability for change in trend.changes]
        chances.append(onsets.change_probability(stated))
        self.low = np.where(np.isnan(low), value - HALF_OF_90 * sigma, low)
        self.high = np.where(np.isnan(high), value + HALF_OF_90 * sigma, high)
        clear = self.low > 0
        by_chance = float(bdtrc(np.count_nonzero(clear) - 1.0, len(stated), _CLEAR_BY_CHANCE))
        course = trend.at(time_s)
        several = int(np.count_nonzero(clear & (course[1] > 0))) >= SEVERAL
        self.stands = several and (bool(trend.changes) or by_chance * followed < _LOSS_BELOW)
        self.false_alarm_probability = min(1.0, min(chances) * followed)
        self.risen = bool(trend.changes) and trend.changes[-1].size > 0
        now, least, most = (float(own[-1]) for own in course)
        self.now = now, least, most
        self.margin = None if limit is None else (limit - now, limit - most, limit - least)

    @cached_property
    def crossing(self) -> Crossing | None:
        """When the limit is reached."""
        return None if self.limit is None else self.trend.crossing(self.limit)

    @property
    def reached(self) -> bool:
        """Whether it is at its limit."""
        return self.crossing is not None and self.crossing.status == "reached"

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        crossing, per_day = self.crossing, np.multiply(SECONDS_PER_DAY, self.trend.rate())
        return {
            **{name: getattr(self, name) for name in ("stage", "gear", "tooth")},
            "estimates": len(self.trend.series),
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


@dataclass(frozen=True, kw_only=True, eq=False)
class HistoryTrends(Result):
    """What a history shows.

    Parameters
    ----------
    history : History
    teeth : tuple of ToothTrend
        Those whose loss stands clear of noise and zero first, then by the clearness of changes.
    evidence : Trend
        Of the scores, as standard deviations of a normal variable.
    evidence_probability : float
        Bound on the probability of a change as clear without one.
    limit : float or None
        Limit of the loss.
    forecasts : dict of float to Crossing
        By the time of a recording: when the limit is reached by the first tooth to do so, as told
        by the recordings up to that time; of the newest `FORECASTS` and where it can be said.
    notes : tuple of str
        What limits the answer.
    """

    picture = "analysis_plots.history_figure"

    history: History
    teeth: tuple[ToothTrend, ...]
    evidence: Trend
    evidence_probability: float
    limit: float | None
    forecasts: dict[float, Crossing]
    notes: tuple[str, ...]

    @property
    def shown(self) -> tuple[ToothTrend, ...]:
        """Teeth whose loss stands clear of its noise and of zero over several recordings."""
        return tuple(tooth for tooth in self.teeth if tooth.stands)

    @property
    def began(self) -> ChangePoint | None:
        """The rise of the evidence."""
        return next((change for change in self.evidence.changes if change.size > 0), None)

    @property
    def raised(self) -> bool:
        """Whether a person should look: a fault, a loss or evidence that rose, a limit reached."""
        fault = any(entry.verdict == "fault" for entry in self.history.entries[-1:])
        grown = any(tooth.risen or tooth.reached for tooth in self.shown)
        return fault or grown or self.began is not None

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        reached = {time_s: crossing.to_dict() for time_s, crossing in self.forecasts.items()}
        entries = self.history.entries
        told = [own.to_dict() | {"limit_reached": reached.get(own.time_s)} for own in entries]
        return {
            "machine": self.history.machine,
            "recordings": told,
            "level": LEVEL,
            "limit": self.limit,
            # those beyond the estimates had none
            "teeth": [tooth.to_dict() | {"recordings": len(told)} for tooth in self.shown],
            "teeth_followed": len(self.teeth),
            "evidence": {
                "false_alarm_probability": self.evidence_probability,
                "changes": [change.to_dict() for change in self.evidence.changes],
            },
            "raised": self.raised,
            "warnings": list(self.notes),
        }


def history_trends(history: History, *, limit: float | None = None) -> HistoryTrends:
    """Follow every tooth of a machine through its history.

    Parameters
    ----------
    history : History
    limit : float, in (0, 1], optional
        Loss of pair stiffness at which something has to be done, as a fraction.

    Returns
    -------
    HistoryTrends

    Raises
    ------
    ArgumentError
        If the limit is out of its range.
    """
    if limit is not None:
        check_range("limit", limit, 1e-6, 1.0)
    places = _followed(history)
    teeth = {key: ToothTrend(key, places[key], len(places), limit) for key in places}
    evidence, chance = _evidence(history, BELOW - _LOSS_BELOW)
    # when the first tooth reaches the limit, as could be told at each recording
    forecasts: dict[float, Crossing] = {}
    standing = [key for key, tooth in teeth.items() if tooth.stands and limit is not None]
    for now in (entry.time_s for entry in history.entries[-FORECASTS:]):
        by_then = {key: [point for point in places[key] if point[0] <= now] for key in standing}
        known = [(key, p) for key, p in by_then.items() if p and p[-1][0] == now]
        told = [ToothTrend(key, points, len(places), limit) for key, points in known]
        ahead = [own.crossing for own in told if own.stands and own.low[-1] > 0]
        said = [c for c in ahead if c is not None and c.status != "not extrapolated"]
        if said:
            # a limit that is reached stands before any that lies ahead
            forecasts[now] = min(said, key=lambda c: (c.status != "reached", c.time_s or 0.0))
    ranked = sorted(teeth.values(), key=lambda t: (not t.stands, t.false_alarm_probability))
    return HistoryTrends(
        history=history,
        teeth=tuple(ranked),
        evidence=evidence,
        evidence_probability=min(1.0, chance / (1 - _LOSS_SHARE)),
        limit=limit,
        forecasts=forecasts,
        notes=tuple(_notes(history, ranked)),
    )


def _followed(history: History) -> Mapping[_Key, _Points]:
    """Estimates of each tooth with their times; of gears as a whole where teeth have none."""
    found: dict[_Key, _Points] = {}
    for entry in history.entries:
        for place in entry.places:
            if place.loss is not None:
                found.setdefault(place.key, []).append((entry.time_s, place))
    often = {key for key, points in found.items() if len(points) >= FEWEST}
    whole = {key[:2] for key in found if key[2] is None}
    numbered = {k[:2] for k in found if k[2] is not None and (k in often or k[:2] not in whole)}
    return {key: found[key] for key in found if (key[:2] in numbered) == (key[2] is not None)}


def _evidence(history: History, below: float) -> tuple[Trend, float]:
    """Trend of the scores, and the probability of a change as clear without one."""
    judged = [(e.time_s, e.score) for e in history.entries if e.verdict != "no mesh found"]
    time_s, score = np.array(judged, dtype=float).reshape(-1, 2).T
    value, equal = normal_equivalent(score), np.ones(len(score))
    series = Series(time_s=time_s, value=value, sigma=equal, sigma_known=False)
    probability = onsets.permuted_probability(series)
    # scores that tests cut off scatter less: only when they began to change can be told from them
    found = fit_trend(series, below=below, most=int(probability < below))
    changes = tuple(
        replace(c, false_alarm_probability=max(probability, c.false_alarm_probability))
        for c in found.changes
    )
    return Trend(series, changes), probability


def normal_equivalent(score: FloatArray) -> FloatArray:
    """Return how many standard deviations a normal variable would be out at the same probability.

    Parameters
    ----------
    score : ndarray of float, shape (n,)
        -log10 of probabilities.

    Returns
    -------
    ndarray of float, shape (n,)
        At least -1.28: probabilities near one, from tests that are cut off there, say no more.

    Examples
    --------
    >>> normal_equivalent(np.array([0.0, 2.0])).round(3)
    array([-1.282,  2.326])
    """
    log = np.minimum(-np.log(10.0) * np.asarray(score, dtype=float), np.log(0.9))
    return np.asarray(-ndtri_exp(log), dtype=np.float64)


def _notes(history: History, teeth: list[ToothTrend]) -> Iterator[str]:
    """Name what limits the answer."""
    count = len(history.entries)
    if count < FEWEST:
        yield f"{count} recordings are too few to look for changes; {FEWEST} are needed"
    lost = sum(entry.verdict == "no mesh found" for entry in history.entries)
    if lost:
        yield f"{lost} of {count} recordings showed no mesh and were left out of the score"
    if not teeth and count:
        yield "no recording estimates a loss of stiffness: only the evidence is followed"
    for tooth in teeth:
        estimates = len(tooth.trend.series)
        if tooth.tooth is None and estimates < count:
            yield (
                f"the loss on the {tooth.gear} of stage {tooth.stage} was estimated in {estimates} "
                f"of {count} recordings; the others are not taken for zero, so its trend begins "
                "later than the damage may have"
            )
