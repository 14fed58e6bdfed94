"""An analysis and a history in words: the lines of a terminal, the facts and tables of a report.

First the answer in ten seconds (verdict, what, how sure, what to do next), then the evidence for it
and what that rests on: the reference, and the lines of a machine. Of a history a line a recording,
a line a tooth, when it began and what is left.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from itertools import takewhile
from typing import TYPE_CHECKING

from gearmon.diagnosis.results import Analysis, Change, Flag
from gearmon.diagnosis.verdict import fault_sentence, left_open
from gearmon.errors import counted
from gearmon.gears.kinematics import LineTable
from gearmon.report import wording
from gearmon.report.wording import gear_text, percent, printable, probability_text
from gearmon.signatures.measured.reference import Reference
from gearmon.signatures.tracking import Speed

if TYPE_CHECKING:  # an analysis without a history does without these
    from gearmon.diagnosis.history.changes import ChangePoint
    from gearmon.diagnosis.history.entries import Entry
    from gearmon.diagnosis.history.trends import Crossing, HistoryTrends, ToothTrend

# Changes of more than this many standard deviations are highlighted in pictures and tables.
BEYOND = 3.0
# Sentences of evidence that a terminal shows of each flag; the report has them all.
_SENTENCES = 2
#: From the worst to the best.
WORST_FIRST = ("fault", "cannot tell", "no mesh found", "healthy")
# No experiment has counted false alarms rarer than this: 2,000 healthy pairs and their fitted tail.
_RAREST = 1e-6
_SURE = ((1e-5, "practically certain"), (1e-3, "very sure"), (1e-2, "sure"), (1.0, "likely"))
# A slip of an induction motor is a few per cent; more is another speed than that of the file.
_FAR_FROM_NOMINAL = 0.05
# Range of the speed within a recording, over its mean, from which it is told.
_CHANGES = 0.05
#: Histories shorter than this are told by the minute, longer ones by the day: ten days.
_BY_MINUTE_S = 864_000.0


@lru_cache(maxsize=1)
def words() -> dict[str, dict[str, str]]:
    """Return words.toml: definitions of "indicators", and by kind of fault what to do "next"."""
    return tomllib.loads(wording.shipped("words.toml"))


def is_beyond(change: Change) -> bool:
    """Tell whether a change exceeds `BEYOND` standard deviations."""
    return abs(change.standardised) > BEYOND


def analysis_text(
    analysis: Analysis, history: HistoryTrends | None = None, most_changes: int = 5
) -> str:
    """Return an analysis in some lines: verdict, how sure, what to do; then the evidence.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    history : HistoryTrends, optional
        Of the machine: tells since when.
    most_changes : int
        Largest number of changes to list, the most significant first.

    Returns
    -------
    str
        Lines without a final line break.
    """
    own = summary(analysis, history)
    lines = [f"{printable(analysis.recording)}: {analysis.verdict.upper()}", f"  {own.what}"]
    lines += [f"  {name}: {text}" for name, text in own.more.items()]
    lines += ["  evidence:", *([f"  {own.because}"] if own.because else [])]
    score = wording.score_text(analysis.score)
    lines.append(f"  score {score}, compared with {analysis.compared_with}")
    if analysis.signature.found:
        lines.append(f"  shaft 1 at {running_text(analysis.signature.speed)}")
    lines += [f"  {sentence}" for sentence in mesh_sentences(analysis)]
    for flag in analysis.flags:
        loss = flag_loss(flag)
        lost = f", loss of stiffness {loss}" if loss else ""
        chance = f"false-alarm probability {probability_text(flag.false_alarm_probability)}"
        place = gear_text(flag.stage, flag.gear, flag.tooth)
        lines.append(f"  flag: {flag.kind}, {place}{lost}, {chance}")
        lines += [f"    {sentence}" for sentence in flag.evidence[:_SENTENCES]]
    if analysis.changes:
        changed = [change for change in strongest_changes(analysis) if is_beyond(change)]
        # the flags' own evidence names the strongest ones already
        shown = [] if analysis.flags else changed[: max(0, most_changes)]
        every = counted(len(analysis.changes), "level")
        head = f"{len(changed)} of {every} changed by more than {BEYOND:g} standard deviations"
        ending = ", first of all:" if len(changed) > len(shown) else ":"
        lines.append(f"  {head}{ending if shown else ''}")
        lines += [
            f"    {change.channel}: {change.family} {change.change_db:+.1f} dB "
            f"(scatter {change.scatter_db:.1f} dB)"
            for change in shown
        ]
    lines += [f"  note: {warning}" for warning in analysis.warnings]
    return "\n".join(lines)


def reference_text(reference: Reference) -> str:
    """Return what a reference holds.

    Parameters
    ----------
    reference : Reference
        The reference.

    Returns
    -------
    str
        Of several lines.
    """
    lines = [
        f"{reference.machine or 'machine'} ({reference.teeth}): reference of "
        f"{counted(len(reference.profiles), 'healthy recording')}",
        f"  channels {', '.join(reference.channel_names)}; "
        f"{counted(len(reference.family_names), 'family', 'families')} of lines",
    ]
    lines += [
        f"  {printable(profile.origin)}: {profile.duration_s:.4g} s, shaft 1 at "
        f"{profile.speed_hz:.4f} Hz{', tacho' if profile.tacho else ''}"
        for profile in reference.profiles
    ]
    lines += [f"  note: {printable(note)}" for note in reference.notes]
    return "\n".join(lines)


def line_table_text(lines: LineTable) -> str:
    """Return the lines of a machine as a table in columns, with its notes.

    Parameters
    ----------
    lines : LineTable
        The lines.

    Returns
    -------
    str
        Of several lines.
    """
    several = len({row["operating"] for row in lines.rows}) > 1
    rows = [
        ({"operating": row["operating"]} if several else {})
        | {
            "stage": "–" if row["stage"] is None else str(row["stage"]),
            "kind": row["kind"],
            "line": row["name"],
            "shaft": "–" if row["shaft"] is None else str(row["shaft"]),
            "order": f"{row['order']:.5f}",
            "Hz": f"{row['frequency_hz']:.3f}",
        }
        for row in lines.rows
    ]
    table = wording.table_lines(rows, "l" * several + "rllrrr")
    notes = [f"note: {note}" for note in lines.notes]
    return "\n".join([lines.machine or "machine", *table, *notes])


def running_text(speed: Speed) -> str:
    """Return a speed with its uncertainty, and how it was found."""
    running = wording.with_uncertainty(speed.estimated_hz, speed.uncertainty_hz, "Hz")
    told = f"{running} ({60 * speed.estimated_hz:.1f} rpm), by {speed.method}"
    if speed.highest_hz - speed.lowest_hz < _CHANGES * speed.estimated_hz:
        return told
    return f"{told}, between {speed.lowest_hz:.4g} and {speed.highest_hz:.4g} Hz"


def mesh_sentences(analysis: Analysis) -> list[str]:
    """Return one short statement for each mesh."""
    sentences = []
    for mesh in analysis.signature.meshes:
        if mesh.found:
            height = f", {mesh.snr_db:.0f} dB above the floor" if mesh.snr_db is not None else ""
            sentences.append(f"mesh {mesh.stage} found at {mesh.frequency_hz:.2f} Hz{height}")
        else:
            sentences.append(f"mesh {mesh.stage} not found")
    return sentences


def flag_loss(flag: Flag) -> str:
    """Return the estimated loss of stiffness with its interval, "" if there is none."""
    return wording.loss_text(flag.stiffness_loss, flag.stiffness_loss_low, flag.stiffness_loss_high)


def indicator_definitions(analysis: Analysis) -> list[tuple[str, str]]:
    """Return the condition indicators of an analysis that are known, and what they are."""
    # what comes after a comma only says of which gear
    names = dict.fromkeys(
        own.split(",")[0].replace("_", " ").strip() for own in analysis.indicators
    )
    defined = words()["indicators"]
    return [(name, defined[name.lower()]) for name in names if name.lower() in defined]


def strongest_changes(analysis: Analysis) -> list[Change]:
    """Return all changes, the most significant first."""
    return sorted(analysis.changes, key=lambda change: -abs(change.standardised))


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a reader has to know of an analysis.

    Parameters
    ----------
    what : str
        What is wrong, or that nothing is, in a sentence.
    because : str
        What the verdict rests on, in sentences.
    more : dict of str to str
        Further sentences, those that say something: "how sure", in words with one number; "since",
        as a history tells; "caution", what makes all of this doubtful; "next", what to do.
    """

    what: str
    because: str
    more: dict[str, str]


def summary(analysis: Analysis, history: HistoryTrends | None = None) -> Summary:
    """Return the answer of an analysis in ten seconds.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    history : HistoryTrends, optional
        Of the machine: tells since when.
    """
    first, _, because = analysis.reason.partition(". ")
    what, caution, speed = f"{first.removesuffix('.')}.", "", analysis.signature.speed
    if analysis.flags:
        flag, what = analysis.flags[0], fault_sentence(analysis.flags)
        because = analysis.reason.removeprefix(what).strip()
        low, high = flag.stiffness_loss_low, flag.stiffness_loss_high
        if flag.stiffness_loss is not None and low is not None and high is not None:
            span = f"{100 * low:.0f} to {100 * high:.0f} %, right 9 times in 10"
            what = f"{what.removesuffix('.')} ({span})."
    if analysis.signature.found and far_from_nominal(speed):
        off = speed.estimated_hz / speed.nominal_hz - 1.0
        caution = (
            f"the speed found, {60 * speed.estimated_hz:.0f} rpm, is {percent(abs(off), 0)} "
            f"{'above' if off > 0 else 'below'} the {60 * speed.nominal_hz:.0f} rpm of the machine "
            "file. If the machine did not run so, all of this is wrong: tell the speed by "
            "--speed-hint"
        )
    more = {
        "how sure": _sure(analysis),
        "since": "" if history is None else _since(analysis, history),
        "caution": caution,
        "next": _next(analysis),
    }
    told = {name: sentence for name, sentence in more.items() if sentence}
    return Summary(what=what, because=because, more=told)


def _sure(analysis: Analysis) -> str:
    """Say how sure the verdict is, by the number that belongs to it."""
    if analysis.verdict == "fault":
        own = analysis.flags[0].false_alarm_probability if analysis.flags else None
        probability = analysis.false_alarm_probability if own is None else own
        word = next(word for most, word in _SURE if probability <= most)
        once = max(probability, _RAREST)
        than = "less than " if probability < _RAREST else ""
        seen = f"in {than}1 of {1 / once:,.0f} recordings" if once < 0.5 else "as often as not"
        return f"{word}: a sound machine shows as much {seen}"
    if analysis.verdict == "healthy":
        noticed = [own.noticed_from for own in analysis.profiles if own.noticed_from is not None]
        if noticed:
            most = percent(max(noticed), 0)
            return f"a tooth that had lost {most} of its pair's stiffness would have been noticed"
    return ""


def _since(analysis: Analysis, found: HistoryTrends) -> str:
    """Say when what is flagged now was first seen, and since when it grows."""
    entries = found.history.entries
    if analysis.verdict != "fault" or not entries:
        return ""
    run = len(list(takewhile(lambda own: own.verdict == "fault", reversed(entries))))
    said = ["new: the last recording of the history shows none"]
    if run:
        every = counted(len(entries), "recording")
        these = "all" if run == len(entries) else f"the last {run}"
        said = [f"{moment_text(entries[-run].time_s, fine=False)}, in {these} of {every}"]
    flag = analysis.flags[0] if analysis.flags else None
    for tooth in found.shown:
        if flag and (tooth.stage, tooth.gear, tooth.tooth) == (flag.stage, flag.gear, flag.tooth):
            start, now = tooth.trend.series.value[0], tooth.now[0]
            said.append(f"its loss went from {percent(start, 0)} to {percent(now, 0)}")
    return "; ".join(said)


def _next(analysis: Analysis) -> str:
    told = words()["next"]
    if analysis.verdict in ("healthy", "no mesh found"):
        return told[analysis.verdict].format(rpm=60 * analysis.signature.speed.nominal_hz)
    if not analysis.flags:
        return told["unclear" if analysis.compared_with == "reference" else "no reference"]
    flag = analysis.flags[0]
    gear = f"the {flag.gear} of stage {flag.stage}" if flag.gear else "the gearbox"
    tooth = f"tooth {flag.tooth} of {gear}" if flag.tooth else f"every tooth of {gear}"
    doubts = (f"{own[:1].upper()}{own[1:]}." for own in left_open(flag))
    return " ".join([told.get(flag.kind, told["fault"]).format(gear=gear, tooth=tooth), *doubts])


def far_from_nominal(speed: Speed) -> bool:
    """Tell whether a speed never comes so near that of the machine file: a reader must know."""
    nearest_hz = min(max(speed.nominal_hz, speed.lowest_hz), speed.highest_hz)
    return abs(nearest_hz - speed.nominal_hz) > _FAR_FROM_NOMINAL * speed.nominal_hz


def worst_first(analyses: Sequence[Analysis]) -> list[int]:
    """Return the places of analyses, the worst verdict first, among equals the highest score.

    Parameters
    ----------
    analyses : sequence of Analysis
        In any order.
    """
    ranks = [(WORST_FIRST.index(own.verdict), -own.score) for own in analyses]
    return sorted(range(len(analyses)), key=ranks.__getitem__)


def overall(analyses: Sequence[Analysis], failures: int = 0) -> tuple[str, str]:
    """Return the worst verdict of several recordings, and how many have which.

    Parameters
    ----------
    analyses : sequence of Analysis
        At least one.
    failures : int
        Recordings that could not be analysed.
    """
    verdicts = [own.verdict for own in analyses]
    counts = [f"{verdicts.count(own)} {own}" for own in WORST_FIRST if own in verdicts]
    counts += [f"{failures} not analysed"] if failures else []
    every = counted(len(verdicts) + failures, "recording")
    return min(verdicts, key=WORST_FIRST.index), f"{every}: {', '.join(counts)}"


def overview_lines(analyses: Sequence[Analysis]) -> list[str]:
    """Return the overall verdict, and one line a recording, worst first, for a terminal.

    Parameters
    ----------
    analyses : sequence of Analysis
        Two or more.
    """
    worst, counts = overall(analyses)
    shown = [analyses[place] for place in worst_first(analyses)]
    names = [printable(own.recording) for own in shown]
    width = max(map(len, names))
    lines = [
        f"  {name:{width}}  {own.verdict.upper():13}  {summary(own).what}"
        for name, own in zip(names, shown, strict=True)
    ]
    return [f"{worst.upper()} ({counts})", *lines, ""]


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
    name = printable(found.history.machine) or "machine without a name"
    rows = [
        {
            "time": moment_text(entry.time_s),
            "recording": printable(entry.recording),
            "verdict": entry.verdict,
            "score": round(entry.score, 2) + 0.0,
            "finding": printable(finding_text(found, entry)),
        }
        for entry in entries
    ]
    lines = [
        f"{name}: {counted(len(entries), 'recording')}, times in UTC",
        *wording.table_lines(rows),
        "",
        began_line(found),
        *(line for tooth in told for line in tooth_lines(tooth, fine=fine)),
    ]
    # the teeth that are not told of one by one
    left_out, sound = len(found.shown) - len(told), len(found.teeth) - len(found.shown)
    if left_out:
        lines.append(
            f"{counted(left_out, 'other tooth', 'other teeth')} of the same gears stand out too, "
            "as they do where one tooth is damaged; --json and the files of -o have them all"
        )
    if sound:
        whole = all(tooth.tooth is None for tooth in found.teeth)
        words = ("gear", "gears") if whole else ("tooth", "teeth")
        lines.append(
            f"{counted(sound, *words)} followed without a loss that stands clear of its noise and "
            "of zero over several recordings"
        )
    return [*lines, *(f"note: {note}" for note in found.notes)]


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


def began_line(found: HistoryTrends) -> str:
    """Tell when the evidence began to rise."""
    from gearmon.diagnosis.history.changes import FEWEST

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
    from gearmon.diagnosis.history.trends import SECONDS_PER_DAY

    place = gear_text(tooth.stage, tooth.gear, tooth.tooth)
    yield f"{place}: loss of pair stiffness now {_interval(*tooth.now)}"
    changes, unseen = tooth.trend.changes, tooth.low[0] <= 0
    for number, change in enumerate(changes):
        # growth that starts slowly is older than what shows of it
        rise = "shows and grows" if number == 0 and unseen else "grows"
        yield f"  {change_text(change, fine=fine, growth=(rise, 'shrinks'))}"
    if unseen and any(change.size > 0 for change in changes):
        missed = percent(tooth.trend.missed, 1)
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
    course = change.growth
    bent = ", at once and then on" if course.jump else ""
    if change.kind == "growth" and not course.straight:
        slower = course.folds < 0 or (course.exponent < 1 and not course.folds)
        bent += ", slower and slower" if slower else ", faster and faster"
    return (
        f"{up if change.size > 0 else down} {since} {moment_text(change.time_s, fine)}{bent} "
        f"(between {low} and {moment_text(change.high_s, fine)}; false-alarm probability "
        f"{probability_text(change.false_alarm_probability)})"
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
    from gearmon.diagnosis.history.trends import NEVER_S

    if not -6e10 < time_s < NEVER_S:
        return "beyond the calendar"
    form = "%Y-%m-%d %H:%M" if fine else "%Y-%m-%d"
    return datetime.fromtimestamp(time_s, UTC).strftime(form)


def _fine(found: HistoryTrends) -> bool:
    entries = found.history.entries
    return not entries or entries[-1].time_s - entries[0].time_s < _BY_MINUTE_S


def _interval(value: float, low: float, high: float, *, signed: bool = False) -> str:
    width = high - low
    decimals = 1 if width >= 0.01 or not math.isfinite(width) else 2 if width >= 1e-3 else 3
    one, two, three = (percent(x, decimals, signed=signed) for x in (value, low, high))
    return f"{one} ({two} to {three})"
