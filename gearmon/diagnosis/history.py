"""Many recordings of one machine: what each of them said, tooth by tooth, in the order of time."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from gearmon.diagnosis.results import VERDICTS, Analysis, Flag, ToothProfile
from gearmon.errors import ArgumentError, check_finite, check_range

#: Half the width of the 90 % interval of a flag, in standard deviations.
HALF_OF_90 = 1.6448536269514722


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

    stage: int
    gear: str
    teeth: int | None = None
    tooth: int | None = None
    statistic: float | None = None
    log10_probability: float | None = None
    loss: float | None = None
    loss_low: float | None = None
    loss_high: float | None = None
    loss_sigma: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in asdict(self).items():
            if isinstance(value, float):
                check_finite(name, value)
        if self.loss_sigma is not None and self.loss_sigma <= 0:
            raise ArgumentError(f"loss_sigma={self.loss_sigma} must be > 0")
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
    machine : str
        Name of the machine.
    recording : str
        The recording.
    time_s : float
        When it was made, in seconds since 1970-01-01 UTC.
    time_source : str
        Where that is from: "given", "modified", "name".
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

    machine: str
    recording: str
    time_s: float
    time_source: str
    verdict: str
    score: float
    false_alarm_probability: float
    speed_hz: float
    findings: tuple[str, ...] = ()
    places: tuple[Place, ...] = ()

    def __post_init__(self) -> None:
        """Check the values."""
        check_finite("time_s", self.time_s, "s")
        check_finite("score", self.score)
        check_finite("speed_hz", self.speed_hz, "Hz")
        check_range("false_alarm_probability", self.false_alarm_probability, 0.0, 1.0)
        if self.verdict not in VERDICTS:
            raise ArgumentError(f"verdict={self.verdict!r} must be one of {', '.join(VERDICTS)}")
        if len({place.key for place in self.places}) < len(self.places):
            raise ArgumentError(f"{self.recording}: a gear or a tooth stands there twice")

    @property
    def when(self) -> str:
        """Time as text, in UTC."""
        return time_text(self.time_s)

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a gear and tooth, built-in types only; one without, if there are none."""
        own = {
            "time": self.when,
            "time_s": self.time_s,
            "time_source": self.time_source,
            "machine": self.machine,
            "recording": self.recording,
            "verdict": self.verdict,
            "score": self.score,
            "false_alarm_probability": self.false_alarm_probability,
            "speed_hz": self.speed_hz,
        }
        empty = dict.fromkeys(Place.__dataclass_fields__)
        return [own | asdict(place) for place in self.places] or [own | empty]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON; without the teeth."""
        row = {k: v for k, v in self.rows()[0].items() if k not in Place.__dataclass_fields__}
        return row | {"findings": list(self.findings)}


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
        where = bisect_left([known.time_s for known in self.entries], entry.time_s)
        after = where
        if where < len(self.entries) and self.entries[where].time_s == entry.time_s:
            if not replace:
                raise ArgumentError(duplicate_text(entry, self.entries[where].recording))
            after += 1
        entries = (*self.entries[:where], entry, *self.entries[after:])
        return History(machine=self.machine, entries=entries)

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a recording, gear and tooth."""
        return [row for entry in self.entries for row in entry.rows()]


def duplicate_text(entry: Entry, known: str) -> str:
    """Say that a recording of the same time is known already, and what to do."""
    return (
        f"{entry.recording}: the history of {entry.machine or 'this machine'!r} has a recording of "
        f"{entry.when} already ({known}); replace it explicitly, or give the right time"
    )


def time_text(time_s: float) -> str:
    """Return seconds since 1970 as ISO 8601 text in UTC.

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
    places: dict[tuple[int, str, int | None], Place] = {}
    for place in _places(analysis.profiles, analysis.flags):
        places.setdefault(place.key, place)
    return Entry(
        machine=analysis.machine,
        recording=analysis.recording,
        time_s=time.timestamp(),
        time_source=time_source,
        verdict=analysis.verdict,
        score=analysis.score,
        false_alarm_probability=analysis.false_alarm_probability,
        speed_hz=float(analysis.signature.speed.estimated_hz),
        findings=tuple(_finding(flag) for flag in analysis.flags),
        places=tuple(places.values()),
    )


def _places(profiles: Iterable[ToothProfile], flags: Sequence[Flag]) -> Iterable[Place]:
    """Every gear as a whole, then its teeth where they can be told from one recording to another.

    Loss estimates are those of the profiles; where there are none, those of the flags.
    """
    for profile in profiles:
        own = [flag for flag in flags if (flag.stage, flag.gear) == (profile.stage, profile.gear)]
        flagged = next((flag for flag in own if flag.stiffness_loss is not None), None)
        yield _whole_gear(profile, flagged)
        # without a numbered tooth the same number is another tooth in the next recording
        losses = getattr(profile, "loss_by_tooth", None) if profile.tooth is not None else None
        sigmas = getattr(profile, "loss_sigma_by_tooth", None)
        if losses is None or sigmas is None:
            continue
        for number, (loss, sigma) in enumerate(zip(losses, sigmas, strict=True)):
            energy = float(profile.energy[number]) if len(profile.energy) == len(losses) else None
            place = _tooth(profile, number + 1, energy, float(loss), float(sigma))
            told = (flagged.tooth, flagged.stiffness_loss) if flagged is not None else None
            if flagged is not None and told == (number + 1, loss):
                # the same estimate, whose interval is not the same to both sides
                place = replace(
                    place,
                    loss_low=flagged.stiffness_loss_low,
                    loss_high=flagged.stiffness_loss_high,
                )
            yield place


def _whole_gear(profile: ToothProfile, flagged: Flag | None) -> Place:
    estimate = _flag_loss(flagged) if flagged is not None else {}
    losses = getattr(profile, "loss_by_tooth", None)
    sigmas = getattr(profile, "loss_sigma_by_tooth", None)
    if not estimate and losses is not None and sigmas is not None and np.isfinite(losses).any():
        worst = int(np.nanargmax(losses))
        estimate = _loss(float(losses[worst]), float(sigmas[worst]))
    return Place(
        stage=profile.stage,
        gear=profile.gear,
        teeth=profile.teeth,
        statistic=_finite(profile.ratio),
        log10_probability=_finite(profile.log10_probability),
        **estimate,
    )


def _tooth(
    profile: ToothProfile, tooth: int, energy: float | None, loss: float, sigma: float
) -> Place:
    return Place(
        stage=profile.stage,
        gear=profile.gear,
        teeth=profile.teeth,
        tooth=tooth,
        statistic=_finite(energy),
        **_loss(loss, sigma),
    )


def _loss(loss: float, sigma: float) -> dict[str, Any]:
    """Return an estimate with its 90 % interval; nothing where there is none."""
    if not (math.isfinite(loss) and math.isfinite(sigma) and sigma > 0):
        return {}
    half = HALF_OF_90 * sigma
    return {"loss": loss, "loss_low": loss - half, "loss_high": loss + half, "loss_sigma": sigma}


def _flag_loss(flag: Flag) -> dict[str, Any]:
    loss, low, high = flag.stiffness_loss, flag.stiffness_loss_low, flag.stiffness_loss_high
    if loss is None or low is None or high is None:
        return {}
    # an interval cut off at zero says more on its other side
    half = max(high - loss, loss - low)
    if not math.isfinite(half) or half <= 0:
        return {}
    return {"loss": loss, "loss_low": low, "loss_high": high, "loss_sigma": half / HALF_OF_90}


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _finding(flag: Flag) -> str:
    parts = [flag.kind]
    parts += [f"stage {flag.stage}"] if flag.stage else []
    parts += [flag.gear] if flag.gear else []
    parts += [f"tooth {flag.tooth}"] if flag.tooth else []
    text = ", ".join(parts)
    loss, low, high = flag.stiffness_loss, flag.stiffness_loss_low, flag.stiffness_loss_high
    if loss is None or low is None or high is None:
        return text
    least, middle, most = (f"{100 * x:.{0 if high >= 0.1 else 1}f}" for x in (low, loss, high))
    return f"{text}: loss {middle} % ({least} to {most} %)"
