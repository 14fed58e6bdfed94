"""The sampling rate: as the file tells it, from its time column, or as given; never guessed."""

from __future__ import annotations

from dataclasses import dataclass

from gearmon.errors import RecordingError
from gearmon.signals.reading.columns import Column
from gearmon.signals.reading.content import Content
from gearmon.signals.reading.quality import missing_values
from gearmon.signals.reading.rounding import Floats
from gearmon.signals.reading.timebase import Spacing, spacing
from gearmon.signals.reading.units import time_factor

_AGREEMENT = 1e-3
# Stamps without a unit are seconds; but a step this long would be no vibration recording.
_LONGEST_STEP_S = 0.1
_USUAL_UNITS = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60.0))
_REMEDY = (
    "if the samples are evenly spaced all the same, delete the time column and give "
    "--sampling-rate HZ, otherwise resample"
)


@dataclass(frozen=True, kw_only=True)
class Rate:
    """A sampling rate and how it was found.

    Parameters
    ----------
    rate_hz : float > 0
        Samples per second.
    note : str
        What was assumed; "" if nothing.
    """

    rate_hz: float
    note: str = ""


def sampling_rate(
    content: Content, column: Column | None, given_hz: float | None, hint: str = ""
) -> Rate:
    """Return the sampling rate of a recording.

    Parameters
    ----------
    content : Content
        What stands in the file.
    column : Column or None
        The time column.
    given_hz : float > 0 or None
        The sampling rate as the user knows it.
    hint : str
        What else in the file may help, for the message.

    Raises
    ------
    RecordingError
        If there is neither a rate nor a time column in the file and none was given, they contradict
        each other by more than 0.1 %, or the time column is irregular.
    """
    if content.rate_hz is not None:
        return _from_file(content, content.rate_hz, column, given_hz)
    if column is not None:
        return _from_stamps(content, column, given_hz)
    if given_hz is not None:
        return Rate(rate_hz=given_hz)
    help_ = hint or content.rate_hint
    raise RecordingError(
        f"{content.path}: no time column, so the sampling rate is unknown; give "
        f"--sampling-rate HZ{f' ({help_})' if help_ else ''}"
        if content.is_text
        else f"{content.path}: does not say its sampling rate; give --sampling-rate HZ"
        f"{f' ({help_})' if help_ else ''}"
    )


def _from_file(
    content: Content, rate_hz: float, column: Column | None, given_hz: float | None
) -> Rate:
    """Return the rate that the file states, if nothing contradicts it."""
    if given_hz is not None and abs(rate_hz / given_hz - 1.0) > _AGREEMENT:
        raise RecordingError(
            f"{content.path}: the file says {rate_hz:.7g} Hz, but {given_hz:.7g} Hz was given; "
            "leave --sampling-rate out, or correct it"
        )
    if column is not None:
        _from_stamps(content, column, rate_hz, "the file says {:.7g} Hz as well")
    # some formats round the rate; the user may know it better
    return Rate(rate_hz=rate_hz if given_hz is None else given_hz)


def _from_stamps(
    content: Content,
    column: Column,
    given_hz: float | None,
    contradiction: str = "{:.7g} Hz was given",
) -> Rate:
    where = f"{content.path}, {column.label}"
    index = content.columns_by_number[column.number]
    stamps = content.values[index]
    _check_complete(content, column, stamps)
    found = spacing(stamps)
    if found.fault:
        raise RecordingError(
            f"{content.path}, {content.place(found.row)}, {column.label}: the time is irregular: "
            f"{found.fault}; {_REMEDY}"
        )
    if given_hz is not None and column.unit is None and found.step == 1.0:
        return Rate(rate_hz=given_hz, note=f"{column.label} counts samples; the given rate is used")
    is_stamp = content.stamp == index
    factor, note = _unit(where, column, found, given_hz, is_stamp=is_stamp)
    derived_hz = float(f"{1.0 / (found.step * factor):.13g}")  # 1000, not 1000.0000000000001
    _check_fine(where, found, derived_hz, given_hz)
    if given_hz is None:
        return Rate(rate_hz=derived_hz, note=note)
    if abs(derived_hz / given_hz - 1.0) > _AGREEMENT + found.uncertainty:
        raise RecordingError(
            f"{where}: its stamps say {derived_hz:.7g} Hz, but {contradiction.format(given_hz)}; "
            "leave --sampling-rate out, or correct it or the unit of the time column"
        )
    return Rate(rate_hz=given_hz, note=note)


def _check_complete(content: Content, column: Column, stamps: Floats) -> None:
    count, first = missing_values(stamps)
    if count:
        raise RecordingError(
            f"{content.path}, {content.place(first)}, {column.label}: the time is missing (in "
            f"{count} of {len(stamps)} {content.rows_are}); {_REMEDY}"
        )


def _check_fine(where: str, found: Spacing, derived_hz: float, given_hz: float | None) -> None:
    if found.coarse and given_hz is None:
        raise RecordingError(
            f"{where}: its stamps are rounded so much that neighbours can be alike; give "
            f"--sampling-rate HZ (it must be about {derived_hz:.4g})"
        )


def _unit(
    where: str, column: Column, found: Spacing, given_hz: float | None, *, is_stamp: bool
) -> tuple[float, str]:
    """Return the seconds in one unit of the time column, and what was assumed."""
    known = 1.0 if is_stamp else time_factor(column.unit)
    if known is not None:
        return known, ""
    if given_hz is not None:
        for name, factor in _USUAL_UNITS:
            if abs(found.step * factor * given_hz - 1.0) <= _AGREEMENT + found.uncertainty:
                return factor, f"{column.label} has no unit: by the given rate it is in {name}"
        return 1.0, ""
    if found.step >= _LONGEST_STEP_S:
        raise RecordingError(
            f"{where}: it goes up by {found.step:.6g} in an unknown unit; name it with its unit, "
            "such as time_ms, or give --sampling-rate HZ"
        )
    return 1.0, f"{column.label} has no unit: taken as seconds"
