"""What a history shows: the loss of each tooth over time, when it began, and what margin is left.

Losses are followed tooth by tooth where recordings estimate them. The score of the recordings is
followed as well: it tells when something began even where no loss can be estimated. The scores of
sound machines follow no known law, so whether they changed is tested by permutation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.change_points import FEWEST, change_probability, permuted_probability
from gearmon.diagnosis.change_shapes import ChangePoint, Series
from gearmon.diagnosis.history import History, time_text
from gearmon.diagnosis.trend import Crossing, Trend, fit_trend
from gearmon.errors import check_range

FloatArray = NDArray[np.float64]

#: Share of the false-alarm probability given to all losses together; the score gets the rest.
_LOSS_SHARE = 0.5
SECONDS_PER_DAY = 86400.0


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
        Of the loss as a fraction.
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
    false_alarm_probability: float
    recordings: int
    limit: float | None

    @property
    def now(self) -> tuple[float, float, float]:
        """Loss at the newest recording with its interval."""
        value, low, high = self.trend.at(self.trend.series.time_s[-1:])
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
        """When the limit is reached."""
        return None if self.limit is None else self.trend.crossing(self.limit)

    @property
    def risen(self) -> bool:
        """Whether its latest change is a rise."""
        return bool(self.trend.changes) and self.trend.changes[-1].size > 0

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        value, low, high = self.now
        rate = [SECONDS_PER_DAY * x for x in self.trend.rate()]
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
            "limit_reached": None if crossing is None else _crossing_dict(crossing),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class HistoryTrends:
    """What a history shows.

    Parameters
    ----------
    history : History
    teeth : tuple of ToothTrend
        Clearest change first.
    evidence : Trend or None
        Of the scores, as standard deviations of a normal variable; None for a short history.
    evidence_probability : float
        Bound on the probability of a change as clear without one.
    limit : float or None
        Limit of the loss.
    level : float
        Of all intervals.
    notes : tuple of str
        What limits the answer.
    """

    history: History
    teeth: tuple[ToothTrend, ...]
    evidence: Trend | None
    evidence_probability: float
    limit: float | None
    level: float
    notes: tuple[str, ...]

    @property
    def shown(self) -> tuple[ToothTrend, ...]:
        """Teeth worth a line: those that changed, and the largest loss of every other gear."""
        changed = [tooth for tooth in self.teeth if tooth.trend.changes]
        gears = {(tooth.stage, tooth.gear) for tooth in changed}
        for tooth in sorted(self.teeth, key=lambda tooth: -tooth.now[0]):
            if (tooth.stage, tooth.gear) not in gears:
                gears.add((tooth.stage, tooth.gear))
                changed.append(tooth)
        return tuple(changed)

    @property
    def began(self) -> ChangePoint | None:
        """The latest rise of the evidence."""
        changes = self.evidence.changes if self.evidence is not None else ()
        return changes[-1] if changes and changes[-1].size > 0 else None

    @property
    def raised(self) -> bool:
        """Whether a person should look: a fault, a loss or evidence that rose, a limit reached."""
        entries = self.history.entries
        return (
            bool(entries and entries[-1].verdict == "fault")
            or self.began is not None
            or any(tooth.risen for tooth in self.teeth)
            or any(
                c is not None and c.status == "reached" for c in (t.crossing for t in self.teeth)
            )
        )

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        changes = self.evidence.changes if self.evidence is not None else ()
        return {
            "machine": self.history.machine,
            "recordings": [entry.to_dict() for entry in self.history.entries],
            "level": self.level,
            "limit": self.limit,
            "teeth": [tooth.to_dict() for tooth in self.shown],
            "teeth_followed": len(self.teeth),
            "evidence": {
                "false_alarm_probability": self.evidence_probability,
                "changes": [change_dict(change) for change in changes],
            },
            "raised": self.raised,
            "warnings": list(self.notes),
        }


def history_trends(
    history: History, *, limit: float | None = None, below: float = 0.01, level: float = 0.9
) -> HistoryTrends:
    """Follow every tooth of a machine through its history.

    Parameters
    ----------
    history : History
    limit : float, in (0, 1], optional
        Loss of pair stiffness at which something has to be done, as a fraction.
    below : float, in (0, 0.5]
        Probability of calling any change on a machine that does not change.
    level : float, in (0, 1)
        Of all intervals.

    Returns
    -------
    HistoryTrends

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    """
    check_range("below", below, 1e-9, 0.5)
    check_range("level", level, 0.01, 0.999)
    if limit is not None:
        check_range("limit", limit, 1e-6, 1.0)
    followed = _loss_series(history)
    teeth = []
    for (stage, gear, tooth), series in followed.items():
        allowed = _LOSS_SHARE * below / len(followed)
        trend = fit_trend(series, below=allowed, level=level)
        probability = min(
            [change_probability(series), *(c.false_alarm_probability for c in trend.changes)]
        )
        teeth.append(
            ToothTrend(
                stage=stage,
                gear=gear,
                tooth=tooth,
                trend=trend,
                false_alarm_probability=min(1.0, probability * len(followed) / _LOSS_SHARE),
                recordings=len(history.entries),
                limit=limit,
            )
        )
    evidence, chance = _evidence(history, (1 - _LOSS_SHARE) * below, level)
    return HistoryTrends(
        history=history,
        teeth=tuple(sorted(teeth, key=lambda tooth: tooth.false_alarm_probability)),
        evidence=evidence,
        evidence_probability=min(1.0, chance / (1 - _LOSS_SHARE)),
        limit=limit,
        level=level,
        notes=tuple(_notes(history, teeth)),
    )


def _loss_series(history: History) -> dict[tuple[int, str, int | None], Series]:
    """Estimates of each tooth; of gears as a whole where teeth have none."""
    found: dict[tuple[int, str, int | None], list[tuple[float, float, float]]] = {}
    for entry in history.entries:
        for place in entry.places:
            if place.loss is not None and place.loss_sigma is not None:
                found.setdefault(place.key, []).append((entry.time_s, place.loss, place.loss_sigma))
    whole = {(stage, gear) for stage, gear, tooth in found if tooth is None}
    numbered = {
        (stage, gear)
        for (stage, gear, tooth), points in found.items()
        if tooth is not None and (len(points) >= FEWEST or (stage, gear) not in whole)
    }
    chosen = {}
    for key, points in found.items():
        if (key[:2] in numbered) == (key[2] is not None):
            time_s, value, sigma = np.array(points).T
            chosen[key] = Series(time_s=time_s, value=value, sigma=sigma)
    return chosen


def _evidence(history: History, below: float, level: float) -> tuple[Trend | None, float]:
    """Trend of the scores, and the probability of a change as clear without one."""
    judged = [entry for entry in history.entries if entry.verdict != "no mesh found"]
    if len(judged) < FEWEST:
        return None, 1.0
    score = normal_equivalent(np.array([entry.score for entry in judged]))
    time_s = np.array([entry.time_s for entry in judged])
    series = Series(time_s=time_s, value=score, sigma=np.ones(len(score)), sigma_known=False)
    probability = permuted_probability(series)
    if probability >= below:
        return Trend(series=series, changes=(), level=level), probability
    # scores that tests cut off scatter less: only when they began to change can be told from them
    found = fit_trend(series, below=below, level=level, most=1)
    changes = tuple(
        replace(c, false_alarm_probability=max(probability, c.false_alarm_probability))
        for c in found.changes
    )
    return Trend(series=series, changes=changes, level=level), probability


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
    from scipy.special import ndtri_exp

    log = np.minimum(-np.log(10.0) * np.asarray(score, dtype=float), np.log(0.9))
    return np.asarray(-ndtri_exp(log), dtype=np.float64)


def _notes(history: History, teeth: list[ToothTrend]) -> list[str]:
    """Name what limits the answer."""
    count = len(history.entries)
    notes = []
    if count < FEWEST:
        notes.append(f"{count} recordings are too few to look for changes; {FEWEST} are needed")
    lost = sum(entry.verdict == "no mesh found" for entry in history.entries)
    if lost:
        notes.append(f"{lost} of {count} recordings showed no mesh and were left out of the score")
    if not teeth and count:
        notes.append("no recording estimates a loss of stiffness: only the evidence is followed")
    for tooth in teeth:
        estimates = len(tooth.trend.series)
        if tooth.tooth is None and estimates < count:
            notes.append(
                f"the loss on the {tooth.gear} of stage {tooth.stage} was estimated in {estimates} "
                f"of {count} recordings; the others are not taken for zero, so its trend begins "
                "later than the damage may have"
            )
    return notes


def change_dict(change: ChangePoint) -> dict[str, Any]:
    """Return a change as built-in types, ready for JSON."""
    return {
        "kind": change.kind,
        "time": time_text(change.time_s),
        "time_low": time_text(change.low_s),
        "time_high": time_text(change.high_s),
        "may_have_begun_before": change.open_before,
        "direction": "rise" if change.size > 0 else "fall",
        "false_alarm_probability": change.false_alarm_probability,
    }


def _crossing_dict(crossing: Crossing) -> dict[str, Any]:
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
