"""The answer in ten seconds: verdict, what, how sure, and what to do next; several in one table.

Everything else that an analysis says is evidence for these sentences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gearmon.diagnosis.decision.words import fault_sentence
from gearmon.diagnosis.history import HistoryTrends
from gearmon.diagnosis.results import Analysis, Flag
from gearmon.report.history_text import moment_text
from gearmon.report.wording import counted, percent, printable
from gearmon.signatures.speed import Speed

#: From the worst to the best.
WORST_FIRST = ("fault", "cannot tell", "no mesh found", "healthy")
# No experiment has counted false alarms rarer than this: 2,000 healthy pairs and their fitted tail.
_RAREST = 1e-6
_SURE = ((1e-5, "practically certain"), (1e-3, "very sure"), (1e-2, "sure"), (1.0, "likely"))
# A slip of an induction motor is a few per cent; more is another speed than that of the file.
_FAR_FROM_NOMINAL = 0.05
_INSPECT = "Inspect {gear} at the next stop"
_NEXT = {
    "tooth damage": "Inspect {tooth} at the next stop; until then record more often.",
    "several teeth": f"{_INSPECT}, all its teeth; until then record more often.",
    "distributed pitting": f"{_INSPECT}, and the oil for particles.",
    "wear": f"{_INSPECT}, and the oil for particles.",
    "eccentricity": "Check the seat and the bearings of {gear}, and the alignment of its shaft.",
    "misalignment": "Check the alignment and the bearings of the shaft of {gear}.",
    "looseness": "Check bolts, fits and bearings about {gear}.",
    "path changed": "Check that the sensor sits where it sat. If it was moved, or the gearbox "
    "opened, learn a new reference.",
    "broadband rise": "Look at bearings, mounts and neighbouring machines; record again.",
    "broadband change": "Look at bearings, mounts and neighbouring machines; record again.",
    "bearing": "Inspect the bearings that the evidence names at the next stop.",
    "electrical": "Look at the motor and its supply; the gears are not to blame.",
    "unknown lines": "Find what turns at these frequencies: a pump, a fan, a neighbour.",
    "mesh lost": "Stop and look at the gearbox, unless it ran at quite another speed.",
}


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a reader has to know of an analysis.

    Parameters
    ----------
    verdict : str
        The verdict.
    what : str
        What is wrong, or that nothing is, in a sentence.
    sure : str
        How sure, in words with one number; "" where there is no number that belongs to it.
    since : str
        Since when, as a history tells; "" without one.
    next : str
        What to do.
    caution : str
        What makes all of this doubtful; "" if nothing.
    because : str
        What the verdict rests on, in sentences.
    """

    verdict: str
    what: str
    sure: str
    since: str
    next: str
    caution: str
    because: str

    def lines(self) -> list[tuple[str, str]]:
        """Return the sentences after the first with their names, those that say something."""
        named = (
            ("how sure", self.sure),
            ("since", self.since),
            ("caution", self.caution),
            ("next", self.next),
        )
        return [(name, text) for name, text in named if text]


def summary(analysis: Analysis, history: HistoryTrends | None = None) -> Summary:
    """Return the answer of an analysis in ten seconds.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    history : HistoryTrends, optional
        Of the machine: tells since when.
    """
    first, _, rest = analysis.reason.partition(". ")
    what, because = f"{first.removesuffix('.')}.", rest
    if analysis.flags:
        what = _with_interval(fault_sentence(analysis.flags), analysis.flags[0])
        because = analysis.reason.removeprefix(fault_sentence(analysis.flags)).strip()
    return Summary(
        verdict=analysis.verdict,
        what=what,
        sure=_sure(analysis),
        since="" if history is None else _since(analysis, history),
        next=_next(analysis),
        caution=_caution(analysis),
        because=because,
    )


def _with_interval(sentence: str, flag: Flag) -> str:
    low, high = flag.stiffness_loss_low, flag.stiffness_loss_high
    if flag.stiffness_loss is None or low is None or high is None:
        return sentence
    span = f"{100 * low:.0f} to {100 * high:.0f} %, right 9 times in 10"
    return f"{sentence.removesuffix('.')} ({span})."


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
    run = 0
    while run < len(entries) and entries[-1 - run].verdict == "fault":
        run += 1
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
    if analysis.verdict == "healthy":
        return "Nothing now; record again as planned."
    if analysis.verdict == "no mesh found":
        speed = 60 * analysis.signature.speed.nominal_hz
        return (
            "Check the sensor and the tooth counts, and whether the machine ran at about "
            f"{speed:.4g} rpm; then record again, under load."
        )
    if analysis.flags:
        flag = analysis.flags[0]
        gear = f"the {flag.gear} of stage {flag.stage}" if flag.gear else "the gearbox"
        tooth = f"tooth {flag.tooth} of {gear}" if flag.tooth else f"every tooth of {gear}"
        other = "Record again at the same load; if it stays, open the gearbox at the next stop."
        return _NEXT.get(flag.kind, other).format(gear=gear, tooth=tooth)
    if analysis.compared_with != "reference":
        return "Record the machine while it is sound, and compare with that (gearmon learn)."
    return (
        "Record again, longer and under steady load. If the answer stays and the machine is sound, "
        "add healthy recordings at this load to the reference."
    )


def _caution(analysis: Analysis) -> str:
    speed = analysis.signature.speed
    if not analysis.signature.found or not far_from_nominal(speed):
        return ""
    off = speed.estimated_hz / speed.nominal_hz - 1.0
    return (
        f"the speed found, {60 * speed.estimated_hz:.0f} rpm, is {percent(abs(off), 0)} "
        f"{'above' if off > 0 else 'below'} the {60 * speed.nominal_hz:.0f} rpm of the machine "
        "file. If the machine did not run so, all of this is wrong: tell the speed by --speed-hint"
    )


def far_from_nominal(speed: Speed) -> bool:
    """Tell whether a speed is so far from that of the machine file that a reader must know."""
    return abs(speed.estimated_hz - speed.nominal_hz) > _FAR_FROM_NOMINAL * speed.nominal_hz


def worst_first(analyses: Sequence[Analysis]) -> list[int]:
    """Return the places of analyses, the worst verdict first, among equals the highest score.

    Parameters
    ----------
    analyses : sequence of Analysis
        In any order.
    """

    def badness(place: int) -> tuple[int, float]:
        own = analyses[place]
        return WORST_FIRST.index(own.verdict), -own.score

    return sorted(range(len(analyses)), key=badness)


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
