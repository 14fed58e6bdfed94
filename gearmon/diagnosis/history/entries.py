"""Recordings of one machine in the order of time: what each said of every gear and tooth.

When a recording was made the user says, or its file: it is never invented.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.diagnosis.results import VERDICTS, Analysis, Flag, ToothProfile
from gearmon.errors import ArgumentError, check_type, check_word
from gearmon.files import table_cell
from gearmon.machine.fields import Choice, Count, Text, check_fields, held, optional, within

if TYPE_CHECKING:
    import pandas as pd

#: Half the width of the 90 % interval of a loss, in standard deviations.
HALF_OF_90 = 1.6448536269514722

_REMEDY = "name it as pump_2026-11-21T10-30-00.csv, or give the times"
_DATE = r"(?<!\d)(\d{4})([-_.]?)(\d{2})\2(\d{2})"
_CLOCK = (
    r"(?:[T_ -]?(\d{2})[:\-.h]?(\d{2})(?:[:\-.m]?(\d{2}))?)?(Z|[+-]\d{2}:?\d{2}|)"
    r"(?![T_ \-.:]?\d)"
)
# What an entry takes from an analysis as it is.
_TOLD = ("machine", "recording", "verdict", "score", "false_alarm_probability")
# Years 1 to 9999; and what no evidence, no estimate, no number of teeth reaches.
_TIMES_S = -6.21e10, 2.53e11
_MUCH = 1e9


@dataclass(frozen=True, kw_only=True)
class Place:
    """What one recording said about a gear, or about one of its teeth.

    Parameters
    ----------
    stage : int, >= 1
        Stage.
    gear : str
        Gear.
    teeth : int or None
        Teeth of the gear, where known.
    tooth : int or None
        Tooth; None for the gear as a whole.
    statistic : float or None
        Energy of the departure over that of the median tooth.
    log10_probability : float or None
        Of the gear: logarithm of the probability of as much on a healthy one.
    loss, loss_low, loss_high, loss_sigma : float or None
        Estimated loss of the pair's stiffness as a fraction, its 90 % interval and its standard
        deviation; None without an estimate, which does not mean that nothing is lost.

    Raises
    ------
    ArgumentError
        If a number is not finite or a sigma not above zero.
    """

    stage: int = held(Count(1, _MUCH))
    gear: str = held(Text())
    teeth: int | None = held(Count(1, _MUCH), None)
    tooth: int | None = held(Count(1, _MUCH), None)
    statistic: float | None = optional(-_MUCH, _MUCH)
    log10_probability: float | None = optional(-_MUCH, _MUCH)
    loss: float | None = optional(-_MUCH, _MUCH)
    loss_low: float | None = optional(-_MUCH, _MUCH)
    loss_high: float | None = optional(-_MUCH, _MUCH)
    loss_sigma: float | None = optional(0, _MUCH, open_low=True)

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_fields(self)
        if self.loss is not None and self.loss_sigma is None:
            raise ArgumentError(f"loss={self.loss} needs loss_sigma beside it: how sure is it?")

    @property
    def key(self) -> tuple[int, str, int | None]:
        """Stage, gear and tooth."""
        return self.stage, self.gear, self.tooth


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One recording of a machine, as its history keeps it.

    Parameters
    ----------
    time_s : float
        When it was made, in seconds since 1970-01-01 UTC.
    time_source : str
        Where that is from: "given", "modified", "name".
    machine : str
        Name of the machine.
    recording : str
        The recording.
    verdict : str
        The verdict.
    score : float
        The score.
    false_alarm_probability : float, in [0, 1]
        Probability of as much evidence on a healthy machine.
    speed_hz : float
        Estimated speed of shaft 1 [Hz].
    findings : tuple of str
        Flags in words, strongest first.
    places : tuple of Place
        Gears and teeth.

    Raises
    ------
    ArgumentError
        If a value has no meaning.
    """

    time_s: float = within(*_TIMES_S, "s")
    time_source: str
    machine: str
    recording: str
    verdict: str = held(Choice(options=VERDICTS))
    score: float = within(-_MUCH, _MUCH)
    false_alarm_probability: float = within(0, 1)
    speed_hz: float = within(0, _MUCH, "Hz")
    findings: tuple[str, ...] = ()
    places: tuple[Place, ...] = ()

    def __post_init__(self) -> None:
        """Check the values."""
        check_fields(self)
        for text in (self.time_source, self.machine, self.recording, *self.findings):
            check_type(f"{text!r}", text, str, "a text")
        if len({place.key for place in self.places}) < len(self.places):
            raise ArgumentError(f"{self.recording}: a gear or a tooth stands there twice")

    @property
    def when(self) -> str:
        """Time as text, in UTC."""
        return time_text(self.time_s)

    def _own(self) -> dict[str, Any]:
        return {"time": self.when} | {name: getattr(self, name) for name in ENTRY}

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a gear and tooth, built-in types only; one without, if there are none."""
        places = [asdict(place) for place in self.places] or [dict.fromkeys(PLACE)]
        return [self._own() | place for place in places]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON; without the teeth."""
        return self._own() | {"findings": list(self.findings)}


@dataclass(frozen=True, kw_only=True, eq=False)
class History:
    """Recordings of one machine in the order of time.

    Parameters
    ----------
    machine : str
        Name of the machine.
    entries : tuple of Entry
        Of this machine, their times strictly increasing.

    Raises
    ------
    ArgumentError
        If an entry is of another machine or two have the same time.
    """

    machine: str
    entries: tuple[Entry, ...] = ()

    def __post_init__(self) -> None:
        """Check machine and order."""
        for entry in self.entries:
            if entry.machine != self.machine:
                raise ArgumentError(
                    f"{entry.recording}: is of machine {entry.machine!r}, the history of "
                    f"{self.machine!r}"
                )
        for one, other in zip(self.entries, self.entries[1:], strict=False):
            if one.time_s >= other.time_s:
                raise ArgumentError(
                    f"{one.recording} and {other.recording} are both of {one.when}, or out of order"
                )

    def with_entry(self, entry: Entry, *, replace: bool = False) -> History:
        """Return the history with one more recording, in its place in time.

        Parameters
        ----------
        entry : Entry
        replace : bool
            Whether it may take the place of one of the same time.

        Raises
        ------
        ArgumentError
            If there is one of the same time and `replace` is false.
        """
        if not replace:
            self.check_new(entry.recording, entry.time_s)
        entries = {one.time_s: one for one in self.entries} | {entry.time_s: entry}
        return History(machine=self.machine, entries=tuple(entries[t] for t in sorted(entries)))

    def check_new(self, recording: str, time_s: float) -> None:
        """Refuse a recording if there is one of the same time.

        Raises
        ------
        ArgumentError
            If there is.
        """
        for entry in self.entries:
            if entry.time_s == time_s:
                raise duplicate_time(recording, self.machine, time_s, entry.recording)

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a recording, gear and tooth."""
        return [row for entry in self.entries for row in entry.rows()]

    def to_frame(self) -> pd.DataFrame:
        """Return these rows, fit for a table on disk: texts are no formulas of a spreadsheet."""
        import pandas as pd

        kinds = dict.fromkeys(("time", *ENTRY, *PLACE), "float")
        kinds |= dict.fromkeys(("stage", "teeth", "tooth"), "Int64")
        kinds |= dict.fromkeys(("time", "time_source", "machine", "recording", "verdict"), "str")
        kinds["gear"] = "object"  # there is none where nothing was looked at
        rows = [{name: table_cell(v) for name, v in row.items()} for row in self.rows()]
        return pd.DataFrame(rows, columns=list(kinds)).astype(kinds)


#: Columns of an entry, and of a place.
ENTRY = tuple(f.name for f in fields(Entry) if f.name not in ("findings", "places"))
PLACE = tuple(f.name for f in fields(Place))


def duplicate_time(recording: str, machine: str, time_s: float, known: str) -> ArgumentError:
    """Say that a recording of the same time is known already, and what to do."""
    return ArgumentError(
        f"{recording}: the history of {machine or 'this machine'!r} has a recording of "
        f"{time_text(time_s)} already ({known}); replace it (--replace, replace=True), or give the "
        "right time"
    )


def entry_of(analysis: Analysis, time: datetime, time_source: str = "given") -> Entry:
    """Return what a history keeps of an analysis.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    time : datetime
        When the recording was made; with its offset from UTC.
    time_source : str
        Where that is from.

    Returns
    -------
    Entry

    Raises
    ------
    ArgumentError
        If the time has no offset.
    """
    if time.tzinfo is None:
        raise ArgumentError(f"time={time.isoformat()} has no offset from UTC; give one, such as Z")
    places = (_places(profile, analysis.flags) for profile in analysis.profiles)
    return Entry(
        time_s=time.timestamp(),
        time_source=time_source,
        **{name: getattr(analysis, name) for name in _TOLD},
        speed_hz=float(analysis.signature.speed.estimated_hz),
        findings=tuple(_finding(flag) for flag in analysis.flags),
        places=tuple(chain.from_iterable(places)),
    )


def _places(profile: ToothProfile, flags: Sequence[Flag]) -> Iterator[Place]:
    """Give the gear as a whole, then its teeth where they can be told between recordings.

    Loss estimates are those of the profile; where there are none, those of the flags.
    """
    gear: dict[str, Any] = {"stage": profile.stage, "gear": profile.gear, "teeth": profile.teeth}
    on_gear = (f for f in flags if (f.stage, f.gear) == (profile.stage, profile.gear))
    flagged = next((flag for flag in on_gear if flag.stiffness_loss is not None), None)
    told = _estimate(*_loss(flagged)) if flagged else {}
    teeth: list[dict[str, Any]] = []
    if profile.loss_by_tooth is not None and profile.loss_sigma_by_tooth is not None:
        loss, half = profile.loss_by_tooth, HALF_OF_90 * profile.loss_sigma_by_tooth
        teeth = list(map(_estimate, loss, loss - half, loss + half))
    worst: dict[str, Any] = max(filter(None, teeth), key=lambda told: told["loss"], default={})
    yield Place(
        **gear,
        statistic=_finite(profile.ratio),
        log10_probability=_finite(profile.log10_probability),
        **(told or worst),
    )
    # without a numbered tooth the same number is another tooth in the next recording
    for number, own in enumerate(teeth if profile.tooth is not None else [], 1):
        if told and flagged and (flagged.tooth, told["loss"]) == (number, own.get("loss")):
            # the same estimate, whose interval is not the same to both sides
            own = told | {"loss_sigma": own["loss_sigma"]}
        yield Place(**gear, tooth=number, statistic=_finite(profile.energy[number - 1]), **own)


def _loss(flag: Flag) -> list[float]:
    """Loss of a flag with its interval; NaN where there is none."""
    told = (flag.stiffness_loss, flag.stiffness_loss_low, flag.stiffness_loss_high)
    return [math.nan if x is None else x for x in told]


def _estimate(loss: float, low: float, high: float) -> dict[str, Any]:
    """Return an estimate with its 90 % interval; nothing where there is none."""
    # an interval cut off at zero says more on its other side
    sigma = max(high - loss, loss - low) / HALF_OF_90
    told = {"loss": loss, "loss_low": low, "loss_high": high, "loss_sigma": sigma}
    known = sigma > 0 and all(map(math.isfinite, told.values()))
    return {name: float(value) for name, value in told.items()} if known else {}


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _finding(flag: Flag) -> str:
    stage = f"stage {flag.stage}" if flag.stage else None
    tooth = f"tooth {flag.tooth}" if flag.tooth else None
    text = ", ".join(filter(None, (flag.kind, stage, flag.gear, tooth)))
    loss, low, high = _loss(flag)
    if not math.isfinite(high - low):
        return text
    least, middle, most = (f"{100 * x:.{0 if high >= 0.1 else 1}f}" for x in (low, loss, high))
    return f"{text}: loss {middle} % ({least} to {most} %)"


def read_time(text: str) -> datetime:
    """Read a time in ISO 8601; one without an offset is taken as UTC.

    Parameters
    ----------
    text : str
        As "2026-11-21T10:30:00+01:00" or "2026-11-21".

    Returns
    -------
    datetime
        With its offset.

    Raises
    ------
    ArgumentError
        If it is no time.

    Examples
    --------
    >>> read_time("2026-11-21T10:30:00+01:00").astimezone(UTC).hour
    9
    """
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        raise ArgumentError(
            f"time {text!r} is not ISO 8601; write it as 2026-11-21T10:30:00Z"
        ) from None
    return moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)


def time_text(time_s: float) -> str:
    """Return seconds since 1970 as ISO 8601 text in UTC.

    Raises
    ------
    ArgumentError
        If the year lies outside 1 to 9999.

    Examples
    --------
    >>> time_text(0.0)
    '1970-01-01T00:00:00Z'
    """
    try:
        moment = datetime.fromtimestamp(time_s, UTC)
    except (OverflowError, ValueError, OSError):
        raise ArgumentError(f"time_s={time_s} s is no time between the years 1 and 9999") from None
    return moment.isoformat().replace("+00:00", "Z")


def time_from_name(path: str | Path) -> datetime:
    """Read the time that stands in the name of a file; without an offset it is taken as UTC.

    Parameters
    ----------
    path : str or Path
        As "pump_2026-11-21T10-30-00.csv" or "20261121_1030.wav".

    Raises
    ------
    ArgumentError
        If no date, or more than one, stands in the name.

    Examples
    --------
    >>> time_from_name("run 20261121_1030.csv").isoformat()
    '2026-11-21T10:30:00+00:00'
    """
    name = Path(path).name
    # eight digits that are no date are a number
    dates = [match for match in re.finditer(_DATE, name) if _moment(match)]
    if len(dates) != 1:
        what = "no date stands" if not dates else f"{len(dates)} dates stand"
        raise ArgumentError(f"{path}: {what} in the name of the file; {_REMEDY}")
    whole = re.compile(_DATE + _CLOCK).match(name, dates[0].start())
    found = _moment(whole) if whole else None
    if found is None:
        raise ArgumentError(
            f"{path}: what follows the date in the name of the file is no time; {_REMEDY}"
        )
    return found


def _moment(match: re.Match[str]) -> datetime | None:
    """Return the time of a date with or without its clock time; None if it is none."""
    year, _, month, day, *clock = match.groups("00")
    hour, minute, second, offset = clock or ["00", "00", "00", ""]
    try:
        return read_time(f"{year}-{month}-{day}T{hour}:{minute}:{second}{offset}")
    except ArgumentError:
        return None


def time_modified(path: str | Path) -> datetime:
    """Return when a file was last written.

    Raises
    ------
    ArgumentError
        If there is no such file.
    """
    try:
        return datetime.fromtimestamp(Path(path).stat().st_mtime, UTC)
    except OSError as error:
        raise ArgumentError(f"{path}: cannot be looked at ({error.strerror})") from None


def recording_times(
    paths: Sequence[str], given: str | None = None, source: str | None = None
) -> list[datetime]:
    """Return when each of some recordings was made.

    Parameters
    ----------
    paths : sequence of str
        The recordings.
    given : str, optional
        Times in ISO 8601, separated by commas, one for each recording.
    source : {"modified", "name"}, optional
        Where to take them from otherwise.

    Raises
    ------
    ArgumentError
        If neither or both are given, or they do not fit.
    """
    if given is not None and source is not None:
        raise ArgumentError("--times and --time-from: give one of them, not both")
    if given is not None:
        times = [read_time(text) for text in given.split(",")]
        if len(times) != len(paths):
            raise ArgumentError(
                f"--times: {len(times)} times for {len(paths)} recordings; give one for each"
            )
        return times
    if source is None:
        raise ArgumentError(
            "when were the recordings made? Their samples do not tell: give --times "
            "2026-11-21T10:30:00Z,... or --time-from name (or modified)"
        )
    check_word("--time-from ", source, _SOURCES)
    return [_SOURCES[source](path) for path in paths]


_SOURCES = {"modified": time_modified, "name": time_from_name}
