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
from scipy.special import ndtri_exp

from gearmon.diagnosis.history.entries import History, Place
from gearmon.diagnosis.history.onset import FEWEST, permuted_probability
from gearmon.diagnosis.history.shapes import ChangePoint, Series
from gearmon.diagnosis.history.tooth import ToothTrend, follow_tooth
from gearmon.diagnosis.history.trend import Crossing, Trend, fit_trend
from gearmon.errors import check_range
from gearmon.result import Result

FloatArray = NDArray[np.float64]

#: Share of the false-alarm probability given to all losses together; the score gets the rest.
_LOSS_SHARE = 0.5
#: Newest recordings for which it is told what could be forecast at their time.
FORECASTS = 20
_Key = tuple[int, str, int | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class HistoryTrends(Result):
    """What a history shows.

    Parameters
    ----------
    history : History
    teeth : tuple of ToothTrend
        Those whose loss stands clear of noise and zero first, then by the clearness of changes.
    evidence : Trend or None
        Of the scores, as standard deviations of a normal variable; None for a short history.
    evidence_probability : float
        Bound on the probability of a change as clear without one.
    limit : float or None
        Limit of the loss.
    level : float
        Of all intervals.
    forecasts : dict of float to Crossing
        By the time of a recording: when the limit is reached by the first tooth to do so, as told
        by the recordings up to that time; of the newest `FORECASTS` and where it can be said.
    notes : tuple of str
        What limits the answer.
    """

    picture = "history_plots.history_figure"

    history: History
    teeth: tuple[ToothTrend, ...]
    evidence: Trend | None
    evidence_probability: float
    limit: float | None
    level: float
    forecasts: dict[float, Crossing]
    notes: tuple[str, ...]

    @property
    def shown(self) -> tuple[ToothTrend, ...]:
        """Teeth whose loss stands clear of its noise and of zero over several recordings."""
        return tuple(tooth for tooth in self.teeth if tooth.stands)

    @property
    def began(self) -> ChangePoint | None:
        """The latest rise of the evidence."""
        changes = self.evidence.changes if self.evidence is not None else ()
        return changes[-1] if changes and changes[-1].size > 0 else None

    @property
    def raised(self) -> bool:
        """Whether a person should look: a fault, a loss or evidence that rose, a limit reached."""
        entries, crossings = self.history.entries, [tooth.crossing for tooth in self.shown]
        return (
            bool(entries and entries[-1].verdict == "fault")
            or self.began is not None
            or any(tooth.risen for tooth in self.shown)
            or any(crossing and crossing.status == "reached" for crossing in crossings)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        changes = self.evidence.changes if self.evidence is not None else ()
        reached = {time_s: crossing.to_dict() for time_s, crossing in self.forecasts.items()}
        return {
            "machine": self.history.machine,
            "recordings": [
                entry.to_dict() | {"limit_reached": reached.get(entry.time_s)}
                for entry in self.history.entries
            ],
            "level": self.level,
            "limit": self.limit,
            "teeth": [tooth.to_dict() for tooth in self.shown],
            "teeth_followed": len(self.teeth),
            "evidence": {
                "false_alarm_probability": self.evidence_probability,
                "changes": [change.to_dict() for change in changes],
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
    followed = _followed(history)

    def follow(key: _Key, until: float = np.inf) -> ToothTrend:
        known = [(time, place) for time, place in followed[key] if time <= until]
        return follow_tooth(
            [time for time, _ in known],
            [place for _, place in known],
            followed=len(followed),
            below=_LOSS_SHARE * below,
            level=level,
            recordings=sum(entry.time_s <= until for entry in history.entries),
            limit=limit,
        )

    teeth = [follow(key) for key in followed]
    evidence, chance = _evidence(history, (1 - _LOSS_SHARE) * below, level)
    ranked = sorted(teeth, key=lambda t: (not t.stands, t.false_alarm_probability))
    standing = [key for key, tooth in zip(followed, teeth, strict=True) if tooth.stands]
    forecasts: dict[float, Crossing] = {}
    for entry in history.entries[-FORECASTS:] if limit is not None else ():
        keys = {place.key for place in entry.places if place.loss is not None}
        told = [follow(key, entry.time_s) for key in standing if key in keys]
        known = [c for tooth in told if (c := _forecast(tooth)) is not None]
        if known:
            # a limit that is reached stands before any that lies ahead
            first = min(known, key=lambda c: (c.status != "reached", c.time_s or 0.0))
            forecasts[entry.time_s] = first
    return HistoryTrends(
        history=history,
        teeth=tuple(ranked),
        evidence=evidence,
        evidence_probability=min(1.0, chance / (1 - _LOSS_SHARE)),
        limit=limit,
        level=level,
        forecasts=forecasts,
        notes=tuple(_notes(history, ranked)),
    )


def _forecast(tooth: ToothTrend) -> Crossing | None:
    """Say when a tooth reaches the limit, as its newest recording's own time could tell."""
    crossing = tooth.crossing if tooth.stands and tooth.low[-1] > 0 else None
    return None if crossing is None or crossing.status == "not extrapolated" else crossing


def _followed(history: History) -> dict[_Key, list[tuple[float, Place]]]:
    """Estimates of each tooth with their times; of gears as a whole where teeth have none."""
    found: dict[_Key, list[tuple[float, Place]]] = {}
    for entry in history.entries:
        for place in entry.places:
            if place.loss is not None and place.loss_sigma is not None:
                found.setdefault(place.key, []).append((entry.time_s, place))
    whole = {(stage, gear) for stage, gear, tooth in found if tooth is None}
    numbered = {
        (stage, gear)
        for (stage, gear, tooth), points in found.items()
        if tooth is not None and (len(points) >= FEWEST or (stage, gear) not in whole)
    }
    return {
        key: points
        for key, points in found.items()
        if (key[:2] in numbered) == (key[2] is not None)
    }


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
