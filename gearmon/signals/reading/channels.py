"""From columns of numbers to channels: what each is, which are used, in which unit, at which rate.

The sampling rate is as the file tells it, from its time column, or as given; it is never guessed.
Time stamps are judged by how they follow each other, rounded as they are printed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any, Protocol

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import RecordingError
from gearmon.signals.reading.columns import Column, Defect, Table, find_columns, find_defect
from gearmon.threads import side_by_side
from gearmon.units import acceleration_factor, plain_unit, time_factor

_ACCELERATION_UNIT = "m/s2"
# Up to this size a copy without gaps between the channels costs nothing worth saving.
_SMALL_BYTES = 32 * 1024 * 1024
# Deviation of a stamp from even spacing, in sampling intervals, beyond what rounding explains.
_JITTER = 0.1
# Rounding to more than this share of an interval hides lost samples.
_COARSE = 0.75
# ... and to more than this share hides them from the differences, though not from a straight line.
_DOUBTFUL = 0.45
# Deviation from a straight line, over all stamps, of a step that changes by 0.1 % at half time.
_DRIFT = 1e-3 / 8
# Steps at either end of a recording whose median tells the usual one.
_MANY = 2**18

_AGREEMENT = 1e-3
# Stamps without a unit are seconds; but a step this long would be no vibration recording.
_LONGEST_STEP_S = 0.1
_USUAL_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
_REMEDY = (
    "if the samples are evenly spaced all the same, delete the time column and give "
    "--sampling-rate HZ, otherwise resample"
)


class SensorLike(Protocol):
    """What a column holds, as the user says."""

    @property
    def column(self) -> str | int:
        """Name or number (counted from 1) of the column."""

    @property
    def unit(self) -> str | None:
        """Unit of the physical quantity."""

    @property
    def sensitivity(self) -> float:
        """Recorded number per unit."""

    @property
    def kind(self) -> str:
        """What it is: vibration, tacho, torque, speed or other."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What the user says about a recording, and wants of its reading.

    Parameters
    ----------
    sampling_rate_hz : float > 0 or None
        Its sampling rate.
    channels : tuple of (str or int)
        Vibration channels to take; all if empty.
    tacho : str, int or None
        The tacho column.
    sensors : tuple of SensorLike
        What columns hold.
    unit : str or None
        Unit of the vibration channels of which nothing else states one.
    room : callable
        Gives an array for the numbers of a file, by its name and their shape.
    """

    sampling_rate_hz: float | None = None
    channels: tuple[str | int, ...] = ()
    tacho: str | int | None = None
    sensors: tuple[SensorLike, ...] = ()
    unit: str | None = None
    room: Callable[[str, tuple[int, int]], FloatArray] = lambda _path, shape: np.empty(shape)


@np.errstate(over="ignore", invalid="ignore")  # numbers that overflow are refused as a recording
def interpret(table: Table, wanted: Wanted) -> dict[str, Any]:
    """Return what makes a `Recording` of what stands in a file; its values are used up.

    Parameters
    ----------
    table : Table
        What stands in the file.
    wanted : Wanted
        What the user says.

    Returns
    -------
    dict
        The arguments of `Recording`.

    Raises
    ------
    RecordingError
        If the channels cannot be used.
    """
    columns, notes, tacho_told = _told(table, wanted)
    hints = []
    timed = table.rate_hz is not None or any(column.kind == "time" for column in columns)
    for index, (column, values) in enumerate(zip(columns, table.values, strict=True)):
        kind, hint = _confirmed(column, values, first=index == 0 and not timed)
        columns[index] = _with_unit(table.path, replace(column, kind=kind), wanted.unit)
        hints += [hint] if hint else []
    table = replace(table, columns=tuple(columns))
    rate_hz, rate_note = _sampling_rate(table, wanted.sampling_rate_hz, "; ".join(hints))
    kept, left_out = _usable(table, named_only=bool(wanted.channels))
    samples, taken = _taken(table.values, kept), [columns[index] for index in kept]
    units, scaled = list[str | None](), False
    for column, row in zip(taken, samples, strict=True):
        factor = acceleration_factor(column.unit) if column.kind == "vibration" else None
        units.append(column.unit if factor is None else _ACCELERATION_UNIT)
        scale = (factor or 1.0) / column.sensitivity
        if scale != 1.0:
            row *= scale
            scaled = True
    others = [f"{column.label} ({column.kind})" for column in taken if column.kind != "vibration"]
    aside = f"not taken as vibration: {', '.join(others)}" if others else ""
    notes = [*table.notes, *hints, rate_note, *notes, aside, *left_out]
    # those of one name are told apart by their columns: results go by the names of channels
    known = Counter(column.name for column in columns)
    names = (own.name if known[own.name] == 1 else f"{own.name} ({own.number})" for own in taken)
    return {
        "samples": samples,
        "sampling_rate_hz": rate_hz,
        "channel_names": tuple(names),
        "channel_kinds": tuple(column.kind for column in taken),
        "units": tuple(units),
        "columns": tuple(column.number for column in taken),
        "origin": table.path,
        # without what names of channels may do to a terminal
        "notes": tuple(
            "".join(sign if sign.isprintable() else " " for sign in note) for note in notes if note
        ),
        "tacho_told": tacho_told,
        "known_finite": not scaled,
    }


def _told(table: Table, wanted: Wanted) -> tuple[list[Column], list[str], bool]:
    """Let what the user says go before what the file says; note sensors that are not in it.

    Returns columns and notes, and whether the user said which column is the tacho.
    """
    index = partial(find_columns, table.path, columns=table.columns)
    columns, absent = list(table.columns), []

    def say(place: int, **what: Any) -> None:
        columns[place] = replace(columns[place], **what)

    for sensor in wanted.sensors:
        try:
            place = index(sensor.column)[0]
        except RecordingError:
            absent.append(f"column '{sensor.column}' of the machine file is not in the recording")
            continue
        unit = sensor.unit or (columns[place].unit if sensor.sensitivity == 1.0 else None)
        say(place, kind=sensor.kind, unit=unit, sensitivity=sensor.sensitivity, told="sensor")
    for place in chain.from_iterable(map(index, wanted.channels)):
        say(place, kind="vibration", told="named")
    if wanted.tacho is not None:
        say(index(wanted.tacho)[0], kind="tacho", told="named")
    tacho_told = any(column.told and column.kind == "tacho" for column in columns)
    if tacho_told:
        # what the user calls a tacho goes before what is named like one
        for place, column in enumerate(columns):
            if column.kind == "tacho" and not column.told:
                say(place, kind="other")
    return columns, absent, tacho_told


def _confirmed(column: Column, values: FloatArray, *, first: bool) -> tuple[str, str]:
    """Check by the numbers what a name only suggests: a counter, or a first column that is time.

    Returns
    -------
    kind : str
        Of the column.
    hint : str
        What may be the time; "" if that is clear.
    """
    unclear = column.kind == "index" or (first and column.kind == "vibration")
    if column.told or not unclear:
        return column.kind, ""
    step = even_step(values)
    if not step:  # named like a counter, it does not count
        return "other" if column.kind == "index" else "vibration", ""
    if column.kind == "index" or step == 1.0:
        return "index", ""
    if not column.cell:
        return "time", f"{column.label} goes up evenly: taken as the time"
    hint = f"{column.label} goes up evenly by {step:.6g}; if that is the time, name it time_s"
    return "other", hint


def _with_unit(path: str, column: Column, unit: str | None) -> Column:
    """Give a vibration channel the unit that the user says, where nothing else states another."""
    if unit is None or column.kind != "vibration":
        return column
    if column.unit is not None and plain_unit(column.unit) != plain_unit(unit):
        raise RecordingError(
            f"{path}, {column.label}: is in {column.unit}, unit={unit!r} was given; leave it out"
        )
    return replace(column, unit=unit)


def _usable(table: Table, *, named_only: bool) -> tuple[list[int], list[str]]:
    """Return the columns to keep, and notes on those left out."""
    columns = table.columns
    aside = ("time", "index", "vibration", "other") if named_only else ("time", "index")
    asked = [column.kind not in aside or column.told == "named" for column in columns]
    looked_at = np.flatnonzero(asked).tolist()
    rows = [table.values[index] for index in looked_at]
    defects = side_by_side(find_defect, rows, table.values.size)
    judged = [(k, *_judged(table, k, own)) for k, own in zip(looked_at, defects, strict=True)]
    kept = [index for index, useless, _ in judged if not useless]
    if any(columns[index].kind == "vibration" for index in kept):
        return kept, [f"{note}: left out" if bad else note for _, bad, note in judged]
    bad = [note for _, useless, note in judged if useless]
    kinds = ", ".join(f"{column.label}: {column.kind}" for column in columns[:10])
    why = f"no vibration channel ({kinds}); name one with --channel"
    if bad:
        more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
        why = f"no usable vibration channel: {bad[0]}{more}; check the sensors, or record again"
    raise RecordingError(f"{table.path}: {why}")


def _judged(table: Table, index: int, defect: Defect | None) -> tuple[bool, str]:
    """Return whether a channel is useless, and what is to be said about it; raise if it matters."""
    column = table.columns[index]
    vibrates, asked = column.kind == "vibration", column.told == "named"
    if defect is None or not (vibrates or defect.missing):
        return False, ""
    place, shown = table.locate(max(0, defect.row), index)
    note = f"{place + ', ' if defect.row >= 0 else ''}{column.label}"
    if defect.missing and not defect.fatal and (asked or vibrates):
        raise RecordingError(
            f"{table.path}, {note}: {shown} is {defect.missing}; the column {defect.text}; "
            "correct the file, or name the channels to use with --channel"
        )
    if column.kind == "speed" and defect.missing and not defect.fatal:
        # a bus tells the speed ten times a second or so, and leaves the rows between empty
        table.go_straight(index)
        return False, f"{column.label} {defect.text}: taken to go straight from each to the next"
    if defect.fatal and asked:
        raise RecordingError(
            f"{table.path}, {note} {defect.text}; check the sensor, or record again"
        )
    return defect.fatal or defect.missing != "", f"{note} {defect.text}"


def _taken(values: FloatArray, kept: Sequence[int]) -> FloatArray:
    """Return the rows that are kept, in place where the array is large."""
    begin = kept[0]
    for row, index in enumerate(kept):
        if begin + row != index:
            values[begin + row] = values[index]
    samples = values[begin : begin + len(kept)]
    return np.ascontiguousarray(samples) if samples.nbytes <= _SMALL_BYTES else samples


@dataclass(frozen=True, kw_only=True)
class Spacing:
    """How time stamps follow each other.

    Parameters
    ----------
    step : float > 0
        Mean difference over the whole span, in the unit of the stamps.
    uncertainty : float
        Relative uncertainty of the step that rounding of the stamps leaves, at most.
    coarse : bool
        Whether the stamps are rounded so much that neighbours are alike or nearly so.
    fault : str
        What is wrong, as the rest of a sentence that begins with the time; "" if nothing.
    row : int
        Index of the stamp where that shows first.
    """

    step: float
    uncertainty: float = 0.0
    coarse: bool = False
    fault: str = ""
    row: int = 0

    def units(self, known: float | None, rate_hz: float) -> list[str]:
        """Units of time in which the stamps tell a sampling rate [Hz], of the known one or all."""
        tried = _USUAL_UNITS if known is None else {"": known}
        told = {name: 1.0 / (self.step * factor) for name, factor in tried.items()}
        within = _AGREEMENT + self.uncertainty
        return [name for name, own_hz in told.items() if abs(own_hz / rate_hz - 1.0) <= within]


def spacing(stamps: FloatArray) -> Spacing:
    """Return the spacing of time stamps, and what is irregular about it.

    Rounding of the stamps when they were printed is allowed for: their resolution is the last
    decimal that any of them uses.

    Parameters
    ----------
    stamps : ndarray of float64, shape (n,), n >= 2
        Time stamps.

    Examples
    --------
    >>> spacing(np.array([0.0, 0.001, 0.002, 0.004])).fault
    'irregular: a step of 0.002 where 0.001 is usual: about 1 sample is missing'
    """
    missing = np.flatnonzero(~np.isfinite(stamps))
    if len(missing):
        told = f"missing (in {len(missing)} of {len(stamps)} rows)"
        return Spacing(step=0.0, fault=told, row=int(missing[0]))
    step = float(stamps[-1] - stamps[0]) / (len(stamps) - 1)
    some = np.append(np.diff(stamps[: 2 * _MANY]), np.diff(stamps[2 * _MANY :][-_MANY:]))
    usual = float(np.median(some))
    slack = 1e-6 * abs(usual) + 4 * np.spacing(np.abs(stamps[[0, -1]]).max())
    # whether nearly all steps are equal to it
    exact = np.count_nonzero(np.abs(some - usual) > slack) <= max(1, 0.01 * len(some))
    resolution = _resolution(stamps)
    if exact and resolution > _DOUBTFUL * step:
        resolution = 0.0  # a step such as 0.001 with three decimals: nothing was rounded
    coarse = resolution > _COARSE * step
    # coarse stamps may repeat, if not all do; of others that mostly do not rise none may
    least = 0.0 if coarse and step > 0 else np.finfo(float).tiny
    tolerance = np.inf if coarse or usual <= 0 else resolution + _JITTER * usual
    fault, row = _fault(stamps, usual, max(usual - tolerance, least), usual + tolerance)
    # the best straight line, of whose slope rounding averages out, and what is left beside it
    count = len(stamps)
    number, off = np.arange(count) - 0.5 * (count - 1), stamps - stamps.mean()
    slope = float(off @ number) * 12.0 / (count * (count**2 - 1.0))
    number *= slope
    off -= number
    drift = 0.0 if resolution > _DOUBTFUL * step else _DRIFT * count
    rounded = resolution if coarse else 0.5 * resolution
    if not fault and max(off.max(), -off.min()) > rounded + (_JITTER + drift) * step:
        row = int(np.abs(off).argmax())
        fault = f"{stamps[row]:.9g} is off the even spacing of {step:.6g}"
    fault = fault and f"irregular: {fault}"
    found = Spacing(step=abs(step), coarse=coarse, fault=fault, row=row)
    if exact or fault:
        return found
    return replace(found, step=slope, uncertainty=resolution / (step * count))


def even_step(values: FloatArray) -> float:
    """Return by what values go up evenly, as time stamps and counters do; 0 if they do not."""
    # the ends decide for nearly every channel
    if len(values) < 3 or not values[1] > values[0] < values[-1] > values[-2]:
        return 0.0
    found = spacing(values)
    return 0.0 if found.fault or found.coarse else found.step


def _fault(stamps: FloatArray, usual: float, least: float, most: float) -> tuple[str, int]:
    """Say which step is the first that is not as usual, and in which row it ends."""
    steps = np.diff(stamps)
    wrong = steps < 0  # tells more than what it does to others
    if not wrong.any():
        wrong = (steps < least) | (steps > most)
    if not wrong.any():
        return "", 0
    row = int(wrong.argmax()) + 1
    before, after = stamps[row - 1], stamps[row]
    if after <= before:
        what = f"comes after {before:.9g}" if after < before else "is repeated"
        return f"{after:.9g} {what}", row
    found = float(after - before)
    lost = round(found / usual) - 1
    text = f"a step of {found:.6g} where {usual:.6g} is usual"
    if lost >= 1 and abs(found / usual - lost - 1) <= 0.2:
        text += f": about {lost} {'sample is' if lost == 1 else 'samples are'} missing"
    return text, row


def _resolution(stamps: FloatArray) -> float:
    """Return the unit of the last decimal of the stamps, or of their single precision."""
    parts = stamps[:1000], stamps[-1000:]
    ends = np.concatenate(parts)
    single = ends.astype(np.float32).astype(np.float64)
    if np.all(np.abs(ends - single) <= 1e-9 * np.abs(ends)):
        return float(np.spacing(np.float32(np.abs(ends).max())))

    def unit(part: FloatArray) -> float:
        decimals = (k for k in range(-3, 16) if np.array_equal(np.round(part, k), part))
        return next((10.0**-k for k in decimals), 0.0)

    return max(map(unit, parts))


def _sampling_rate(table: Table, given_hz: float | None, hint: str) -> tuple[float, str]:
    """Return the sampling rate of a recording, and what was assumed; "" if nothing.

    Parameters
    ----------
    table : Table
        What stands in the file.
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
    stated = table.rate_hz
    if stated and given_hz and abs(stated / given_hz - 1.0) > _AGREEMENT:
        raise RecordingError(
            f"{table.path}: the file says {stated:.7g} Hz, but {given_hz:.7g} Hz was given; "
            "leave --sampling-rate out, or correct it"
        )
    # some formats round the rate; the user may know it better
    rate_hz, note = given_hz or stated, ""
    times = [index for index, column in enumerate(table.columns) if column.kind == "time"]
    if times:
        told = "{:.7g} Hz was given" if given_hz else "the file says {:.7g} Hz as well"
        rate_hz, note = _from_stamps(table, times[0], rate_hz, told)
    if rate_hz is None:
        told = hint or table.rate_hint
        raise RecordingError(
            f"{table.path}: has no time column and does not say its sampling rate; give "
            f"--sampling-rate HZ{f' ({told})' if told else ''}"
        )
    # the channels beside a further time column have the rate that it tells
    for index in times[1:] if given_hz is None else ():
        column, found = table.columns[index], spacing(table.values[index])
        if found.step and not found.fault and not found.units(time_factor(column.unit), rate_hz):
            raise RecordingError(
                f"{table.path}, {column.label}: goes up by {found.step:.6g} {column.unit or ''} a "
                f"row, but another time column says {rate_hz:.7g} Hz; delete the one that is "
                "wrong, or give channels of another rate a file of their own"
            )
    return rate_hz, note


def _from_stamps(
    table: Table, index: int, given_hz: float | None, contradiction: str
) -> tuple[float, str]:
    """Return the rate that time stamps tell, or the given one that agrees, and what was assumed."""
    column, stamps = table.columns[index], table.values[index]
    where = f"{table.path}, {column.label}"

    if len(stamps) < 2:
        raise RecordingError(f"{where}: a single sample is no recording; it tells no sampling rate")
    found, known = spacing(stamps), time_factor(column.unit)
    if found.fault:
        place = f"{table.path}, {table.locate(found.row, index)[0]}, {column.label}"
        raise RecordingError(f"{place}: the time is {found.fault}; {_REMEDY}")
    derived_hz = float(f"{1.0 / (found.step * (known or 1.0)):.13g}")  # not 1000.0000000000001
    if given_hz is not None:
        if column.unit is None and found.step == 1.0:
            return given_hz, f"{column.label} counts samples; the given rate is used"
        fitting = found.units(known, given_hz)
        if not fitting:
            raise RecordingError(
                f"{where}: its stamps say {derived_hz:.7g} Hz, but "
                f"{contradiction.format(given_hz)}; leave --sampling-rate out, or correct it or "
                "the unit of the time column"
            )
        assumed = f"{column.label} has no unit: by the given rate it is in {fitting[0]}"
        return given_hz, assumed if known is None else ""
    if known is None and found.step >= _LONGEST_STEP_S:
        raise RecordingError(
            f"{where}: it goes up by {found.step:.6g} in an unknown unit; name it with its unit, "
            "such as time_ms, or give --sampling-rate HZ"
        )
    if found.coarse:
        raise RecordingError(
            f"{where}: its stamps are rounded so much that neighbours can be alike; give "
            f"--sampling-rate HZ (it must be about {derived_hz:.4g})"
        )
    return derived_hz, f"{column.label} has no unit: taken as seconds" if known is None else ""
