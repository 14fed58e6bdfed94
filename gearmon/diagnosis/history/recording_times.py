"""When a recording was made: as the user says, or from its file. It is never invented."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from gearmon.errors import ArgumentError

#: Where times may be taken from if they are not given.
SOURCES = ("modified", "name")

_REMEDY = "name it as pump_2026-11-21T10-30-00.csv, or give the times"
_DATE = r"(?<!\d)(\d{4})([-_.]?)(\d{2})\2(\d{2})"
_CLOCK = (
    r"(?:[T_ -]?(\d{2})[:\-.h]?(\d{2})(?:[:\-.m]?(\d{2}))?)?(Z|[+-]\d{2}:?\d{2})?"
    r"(?![T_ \-.:]?\d)"
)


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
    dates = [match for match in re.finditer(_DATE, name) if _moment(match) is not None]
    if len(dates) != 1:
        what = "no date stands" if not dates else f"{len(dates)} dates stand"
        raise ArgumentError(f"{path}: {what} in the name of the file; {_REMEDY}")
    found = _moment(re.compile(_DATE + _CLOCK).match(name, dates[0].start()))
    if found is None:
        raise ArgumentError(
            f"{path}: what follows the date in the name of the file is no time; {_REMEDY}"
        )
    return found


def _moment(match: re.Match[str] | None) -> datetime | None:
    if match is None:
        return None
    year, _, month, day, *clock = (part or "" for part in match.groups())
    hour, minute, second, offset = clock or ("", "", "", "")
    time = f"{hour or '00'}:{minute or '00'}:{second or '00'}{offset}"
    try:
        return read_time(f"{year}-{month}-{day}T{time}")
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
    if source not in SOURCES:
        raise ArgumentError(f"--time-from {source}: must be one of {', '.join(SOURCES)}")
    return [(time_from_name if source == "name" else time_modified)(path) for path in paths]
