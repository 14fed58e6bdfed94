"""From columns of numbers to channels: what each is, which are used, in which unit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any, Protocol

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import RecordingError
from gearmon.signals.reading.columns import DataColumn, Defect, Table, find_columns, find_defect
from gearmon.signals.reading.timebase import even_step, sampling_rate
from gearmon.signals.threads import side_by_side
from gearmon.units import acceleration_factor, plain_unit

#: Told the share of a file that has been read.
Progress = Callable[[float], object]

ACCELERATION_UNIT = "m/s2"
# Up to this size a copy without gaps between the channels costs nothing worth saving.
_SMALL_BYTES = 32 * 1024 * 1024


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
    progress : callable
        Called with the share of the file that has been read, 0 to 1.
    room : callable
        Gives an array for the numbers of a file, by its name and their shape.
    """

    sampling_rate_hz: float | None = None
    channels: tuple[str | int, ...] = ()
    tacho: str | int | None = None
    sensors: tuple[SensorLike, ...] = ()
    unit: str | None = None
    progress: Progress = lambda _share: None
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
    columns, notes = _told(table, wanted)
    hints = []
    timed = table.rate_hz is not None or any(column.kind == "time" for column in columns)
    for index, (column, values) in enumerate(zip(columns, table.values, strict=True)):
        kind, hint = _confirmed(column, values, first=index == 0 and not timed)
        columns[index] = _with_unit(table.path, replace(column, kind=kind), wanted.unit)
        hints += [hint] if hint else []
    time = next((column for column in columns if column.kind == "time"), None)
    rate_hz, rate_note = sampling_rate(table, time, wanted.sampling_rate_hz, "; ".join(hints))
    kept, left_out = _usable(table, columns, named_only=bool(wanted.channels))
    samples, taken = _taken(table.values, kept), [columns[index] for index in kept]
    scaled = [_unit_and_scale(column) for column in taken]
    for row, (_, scale) in enumerate(scaled):
        if scale != 1.0:
            samples[row] *= scale
    others = [f"{column.label} ({column.kind})" for column in taken if column.kind != "vibration"]
    aside = f"not taken as vibration: {', '.join(others)}" if others else ""
    notes = [*table.notes, *hints, rate_note, *notes, aside, *left_out]
    return {
        "samples": samples,
        "sampling_rate_hz": rate_hz,
        "channel_names": tuple(column.name for column in taken),
        "channel_kinds": tuple(column.kind for column in taken),
        "units": tuple(unit for unit, _ in scaled),
        "columns": tuple(column.number for column in taken),
        "origin": table.path,
        "notes": tuple(_one_line(note) for note in notes if note),
        "tacho_told": _tells_tacho(columns),
        "known_finite": all(scale == 1.0 for _, scale in scaled),
    }


def _one_line(note: str) -> str:
    """Leave out what names of channels may do to a terminal."""
    return "".join(sign if sign.isprintable() else " " for sign in note)


def _told(table: Table, wanted: Wanted) -> tuple[list[DataColumn], list[str]]:
    """Let what the user says go before what the file says; note sensors that are not in it."""
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
    if _tells_tacho(columns):
        # what the user calls a tacho goes before what is named like one
        for place, column in enumerate(columns):
            if column.kind == "tacho" and not column.told:
                say(place, kind="other")
    return columns, absent


def _tells_tacho(columns: Sequence[DataColumn]) -> bool:
    """Tell whether the user said which column is the tacho."""
    return any(column.told and column.kind == "tacho" for column in columns)


def _confirmed(column: DataColumn, values: FloatArray, *, first: bool) -> tuple[str, str]:
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


def _with_unit(path: str, column: DataColumn, unit: str | None) -> DataColumn:
    """Give a vibration channel the unit that the user says, where nothing else states another."""
    if unit is None or column.kind != "vibration":
        return column
    if column.unit is not None and plain_unit(column.unit) != plain_unit(unit):
        raise RecordingError(
            f"{path}, {column.label}: is in {column.unit}, unit={unit!r} was given; leave it out"
        )
    return replace(column, unit=unit)


def _usable(
    table: Table, columns: Sequence[DataColumn], *, named_only: bool
) -> tuple[list[int], list[str]]:
    """Return the columns to keep, and notes on those left out."""
    aside = ("time", "index", "vibration", "other") if named_only else ("time", "index")
    looked_at = [
        index
        for index, column in enumerate(columns)
        if column.kind not in aside or (column.kind == "vibration" and column.told == "named")
    ]
    rows = [table.values[index] for index in looked_at]
    defects = side_by_side(find_defect, rows, table.values.size)
    judged = {
        index: _judged(table, index, columns[index], defect)
        for index, defect in zip(looked_at, defects, strict=True)
    }
    kept = [index for index, (useless, _) in judged.items() if not useless]
    if any(columns[index].kind == "vibration" for index in kept):
        return kept, [f"{note}: left out" if bad else note for bad, note in judged.values()]
    bad = [note for useless, note in judged.values() if useless]
    kinds = ", ".join(f"{column.label}: {column.kind}" for column in columns[:10])
    why = f"no vibration channel ({kinds}); name one with --channel"
    if bad:
        more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
        why = f"no usable vibration channel: {bad[0]}{more}; check the sensors, or record again"
    raise RecordingError(f"{table.path}: {why}")


def _judged(
    table: Table, index: int, column: DataColumn, defect: Defect | None
) -> tuple[bool, str]:
    """Return whether a channel is useless, and what is to be said about it; raise if it matters."""
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


def _unit_and_scale(column: DataColumn) -> tuple[str | None, float]:
    """Return the physical unit of a channel, and what its numbers must be multiplied by."""
    factor = acceleration_factor(column.unit) if column.kind == "vibration" else None
    unit = column.unit if factor is None else ACCELERATION_UNIT
    return unit, (factor or 1.0) / column.sensitivity
