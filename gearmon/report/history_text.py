"""A history in words: a line a recording, a line a tooth, when it began and what is left."""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import UTC, datetime

from gearmon.diagnosis.history.changes import FEWEST, STRAIGHT, ChangePoint
from gearmon.diagnosis.history.entries import Entry
from gearmon.diagnosis.history.trends import SECONDS_PER_DAY, Crossing, HistoryTrends, ToothTrend
from gearmon.report import wording

#: Histories shorter than this are told by the minute, longer ones by the day.
_BY_MINUTE_S = 10 * SECONDS_PER_DAY
#: After the year 9999 is never.
_NEVER_S = 2.5e11


def history_lines(found: HistoryTrends) -> list[str]:
    """Tell what a history shows.

    Parameters
    ----------
    found : HistoryTrends

    Returns
    -------
    list of str
    """
    entries, fine, told = found.history.entries, _fine(found), told_teeth(found)
    name = wording.printable(found.history.machine) or "machine without a name"
    rows = [
        {
            "time": moment_text(entry.time_s),
            "recording": wording.printable(entry.recording),
            "verdict": entry.verdict,
            "score": round(entry.score, 2) + 0.0,
            "finding": wording.printable(finding_text(found, entry)),
        }
        for entry in entries
    ]
    return [
        f"{name}: {wording.counted(len(entries), 'recording')}, times in UTC",
        *wording.table_lines(rows),
        "",
        began_line(found),
        *(line for tooth in told for line in tooth_lines(tooth, fine=fine)),
        *_others_lines(found, len(told)),
        *(f"note: {note}" for note in found.notes),
    ]


def finding_text(found: HistoryTrends, entry: Entry) -> str:
    """Tell the strongest finding of a recording, and when by then a limit was to be reached.

    Parameters
    ----------
    found : HistoryTrends
    entry : Entry
        One of its recordings.

    Returns
    -------
    str
        Empty if nothing was found.
    """
    crossing = found.forecasts.get(entry.time_s)
    if crossing is None:
        return "".join(entry.findings[:1])
    when = "reached"
    if crossing.status != "reached" and crossing.time_s is not None:
        when = f"about {moment_text(crossing.time_s, _fine(found))}"
    return f"{[*entry.findings, 'trend of a tooth'][0]}; limit {when}"


def told_teeth(found: HistoryTrends) -> list[ToothTrend]:
    """Return the teeth that the words are about: of every gear the clearest and any at its limit.

    What one damaged tooth does to a gear raises the estimates of its other teeth too.
    """
    most: dict[tuple[int, str], ToothTrend] = {}
    for tooth in sorted(found.shown, key=lambda tooth: (tooth.risen, tooth.now[0]), reverse=True):
        most.setdefault((tooth.stage, tooth.gear), tooth)
    return [tooth for tooth in found.shown if tooth in most.values() or tooth.reached]


def _others_lines(found: HistoryTrends, told: int) -> Iterator[str]:
    """Tell of the teeth that are not told of one by one."""
    left_out, sound = len(found.shown) - told, len(found.teeth) - len(found.shown)
    if left_out:
        yield (
            f"{wording.counted(left_out, 'other tooth', 'other teeth')} of the same gears stand "
            "out too, as they do where one tooth is damaged; --json and the files of -o have them "
            "all"
        )
    if sound:
        whole = all(tooth.tooth is None for tooth in found.teeth)
        words = ("gear", "gears") if whole else ("tooth", "teeth")
        yield (
            f"{wording.counted(sound, *words)} followed without a loss that stands clear of its "
            "noise and of zero over several recordings"
        )


def began_line(found: HistoryTrends) -> str:
    """Tell when the evidence began to rise."""
    if len(found.evidence.series) < FEWEST:
        return "evidence: too few recordings to say whether it changed"
    if not found.evidence.changes:
        return "evidence: no change that chance would not make as well"
    (change,) = found.evidence.changes  # one at most is looked for
    older = "; what causes it may be older than what shows" if found.began else ""
    words = change_text(change, fine=_fine(found), growth=("rises", "falls"))
    return f"evidence: {words}{older}"


def tooth_lines(tooth: ToothTrend, *, fine: bool) -> Iterator[str]:
    """Tell the trend of a tooth: loss now, when it began, rate, margin and limit.

    Parameters
    ----------
    tooth : ToothTrend
    fine : bool
        Whether times are told by the minute.

    Yields
    ------
    str
    """
    place = wording.gear_text(tooth.stage, tooth.gear, tooth.tooth)
    yield f"{place}: loss of pair stiffness now {_interval(*tooth.now)}"
    changes, unseen = tooth.trend.changes, tooth.low[0] <= 0
    for number, change in enumerate(changes):
        # growth that starts slowly is older than what shows of it
        rise = "shows and grows" if number == 0 and unseen else "grows"
        yield f"  {change_text(change, fine=fine, growth=(rise, 'shrinks'))}"
    if unseen and any(change.size > 0 for change in changes):
        missed = wording.percent(tooth.trend.missed, 1)
        yield (
            f"  where none was found, a loss of up to {missed} may have been missed: it may have "
            "begun earlier"
        )
    if not changes:
        yield "  no change that chance would not make as well"
    if tooth.trend.grows:
        rate = [SECONDS_PER_DAY * x for x in tooth.trend.rate()]
        yield f"  rate {_interval(*rate, signed=True)} a day"
    margin, crossing = tooth.margin, tooth.crossing
    if margin is not None and crossing is not None and tooth.limit is not None:
        yield f"  margin to the limit of {100 * tooth.limit:.3g} %: {_interval(*margin)}"
        yield f"  limit: {crossing_text(crossing, fine=fine)}"


def change_text(change: ChangePoint, *, fine: bool, growth: tuple[str, str]) -> str:
    """Tell a change: what, since when, with interval and probability."""
    (up, down), since = (
        (growth, "since") if change.kind == "growth" else (("jumped up", "fell"), "at")
    )
    low = "before the first recording" if change.open_before else moment_text(change.low_s, fine)
    course = change.growth if change.kind == "growth" else STRAIGHT
    bent = ", at once and then on" if course.jump else ""
    if not course.straight:
        slower = course.folds < 0 or (course.exponent < 1 and not course.folds)
        bent += ", slower and slower" if slower else ", faster and faster"
    return (
        f"{up if change.size > 0 else down} {since} {moment_text(change.time_s, fine)}{bent} "
        f"(between {low} and {moment_text(change.high_s, fine)}; false-alarm probability "
        f"{wording.probability_text(change.false_alarm_probability)})"
    )


def crossing_text(crossing: Crossing, *, fine: bool) -> str:
    """Tell when a limit is reached, or why that is not said."""
    if crossing.time_s is None:
        return f"{crossing.status}: {crossing.reason}"
    early = moment_text(crossing.low_s, fine) if crossing.low_s is not None else "now"
    late = moment_text(crossing.high_s, fine) if crossing.high_s is not None else "never"
    return (
        f"{crossing.status}, {moment_text(crossing.time_s, fine)} ({early} to {late}): "
        f"{crossing.reason}"
    )


def moment_text(time_s: float, fine: bool = True) -> str:
    """Return a time as text, by the minute or by the day.

    Examples
    --------
    >>> moment_text(0.0), moment_text(0.0, fine=False)
    ('1970-01-01 00:00', '1970-01-01')
    """
    if not -6e10 < time_s < _NEVER_S:
        return "beyond the calendar"
    form = "%Y-%m-%d %H:%M" if fine else "%Y-%m-%d"
    return datetime.fromtimestamp(time_s, UTC).strftime(form)


def _fine(found: HistoryTrends) -> bool:
    entries = found.history.entries
    return not entries or entries[-1].time_s - entries[0].time_s < _BY_MINUTE_S


def _interval(value: float, low: float, high: float, *, signed: bool = False) -> str:
    width = high - low
    decimals = 1 if width >= 0.01 or not math.isfinite(width) else 2 if width >= 1e-3 else 3
    one, two, three = (wording.percent(x, decimals, signed=signed) for x in (value, low, high))
    return f"{one} ({two} to {three})"
