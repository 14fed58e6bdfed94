"""Which arrays of a file are the recording: those named, or the only ones that can be."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.columns import Column, Content, describe_columns, find_column
from gearmon.signals.reading.fields import Floats, shortened
from gearmon.signals.reading.formats.arrays import (
    Array,
    Holding,
    Read,
    reading,
    stated_rate,
    stated_speed,
)
from gearmon.signals.reading.header import Header
from gearmon.signals.reading.roles import Wanted

_BLOCK = 1 << 18
_LISTED = 12
_SAME_RATE = 1e-9
_HALF_SAMPLE = 0.5


@dataclass(frozen=True, kw_only=True)
class Frames:
    """Columns of a file that can be read from any sample to any other.

    Parameters
    ----------
    path : str
        The file, for messages.
    columns : tuple of Column
        What the file says about them.
    count : int
        Samples of each column.
    read : callable
        Gives the samples from a first to before a last one: float64, shape (columns, n).
    rate_hz : float > 0 or None
        The sampling rate, if the file states it.
    rate_hint : str
        What else in the file may tell the sampling rate.
    speed_rpm : float > 0 or None
        The speed, if the file states one.
    notes : tuple of str
        What the reader has to tell the user.
    """

    path: str
    columns: tuple[Column, ...]
    count: int
    read: Read
    rate_hz: float | None = None
    rate_hint: str = ""
    speed_rpm: float | None = None
    notes: tuple[str, ...] = ()

    def content(
        self,
        progress: Callable[[float], object] | None = None,
        room: Callable[[tuple[int, int]], Floats] = np.empty,
    ) -> Content:
        """Return the samples, in an array that `room` gives, with what is known of them."""
        return Content(
            path=self.path,
            values=self._filled(progress, room),
            columns=self.columns,
            rate_hz=self.rate_hz,
            rate_hint=self.rate_hint,
            notes=self.notes,
        )

    def _filled(
        self,
        progress: Callable[[float], object] | None,
        room: Callable[[tuple[int, int]], Floats],
    ) -> Floats:
        total = self.count
        try:
            values = room((len(self.columns), total))
        except MemoryError:
            gigabytes = 8e-9 * total * len(self.columns)
            raise RecordingError(
                f"{self.path}: {total} samples of {len(self.columns)} channels need "
                f"{gigabytes:.3g} GB of memory; cut the recording, or take open_recording"
            ) from None
        for start in range(0, total, _BLOCK):
            stop = min(total, start + _BLOCK)
            values[:, start:stop] = self.read(start, stop)
            if progress is not None:
                progress(stop / total)
        return values


@dataclass(frozen=True, kw_only=True)
class _Candidate:
    array: Array
    columns: tuple[Column, ...]

    @property
    def kinds(self) -> frozenset[str]:
        return frozenset(column.kind for column in self.columns)

    @property
    def shown(self) -> str:
        numbers = [column.number for column in self.columns]
        place = f"{numbers[0]}" if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"
        name = shortened(self.array.name) or "the array"
        channels = "" if len(numbers) == 1 else f"{len(numbers)} x "
        return f"{name} ({place}; {channels}{self.array.count} samples)"


def choose(holding: Holding, wanted: Wanted) -> tuple[Frames, Wanted]:
    """Return the columns that make up the recording, and what the user says about these.

    A name with --channel, --tacho or in a [[sensor]] picks an array or one channel of it. Without
    any, the file must leave no choice: one array that may be vibration, or, in formats whose
    channels belong together, all of one length and rate. Arrays that are called like a time, a
    tacho, a speed or a torque and have the same length come along.

    Parameters
    ----------
    holding : Holding
        What the file holds.
    wanted : Wanted
        What the user says.

    Raises
    ------
    RecordingError
        If there is no signal, several may be meant, or those named do not fit together.
    """
    candidates = _candidates(holding)
    if not candidates:
        others = ", ".join(map(shortened, holding.left_out[:_LISTED]))
        raise RecordingError(
            f"{holding.path}: {holding.what} without a signal in it"
            f"{f' (it holds {others})' if others else ''}; an array of real numbers is needed"
        )
    wanted = _expanded(holding, candidates, wanted)
    named = _named(holding, candidates, wanted)
    chosen = named or _only(holding, candidates)
    _check_alike(holding, chosen)
    companions = [
        one for one in candidates if one not in chosen and _accompanies(one, chosen[0], holding)
    ]
    taken = [one for one in candidates if one in chosen or one in companions]
    return _frames(holding, taken, len(candidates) > len(taken)), wanted


def _candidates(holding: Holding) -> list[_Candidate]:
    found, number = [], 1
    for array in holding.arrays:
        units = array.units if any(array.units) else None
        cells = tuple(unit or "" for unit in units) if units else None
        described = describe_columns(Header(names=array.names, units=cells), len(array.names))
        columns = tuple(replace(c, number=c.number + number - 1) for c in described)
        unnamed = tuple(
            column if column.cell else replace(column, name=f"channel {column.number}")
            for column in columns
        )
        found.append(_Candidate(array=array, columns=unnamed))
        number += len(columns)
    return found


def _expanded(holding: Holding, candidates: Sequence[_Candidate], wanted: Wanted) -> Wanted:
    """Put column numbers in the place of names, and all columns of an array for its name."""
    keys: list[str | int] = []
    for key in wanted.channels:
        whole = [one for one in candidates if one.array.name == key]
        if len(whole) == 1:
            keys.extend(column.number for column in whole[0].columns)
        else:
            keys.append(_number(holding, candidates, key))
    tacho = None if wanted.tacho is None else _number(holding, candidates, wanted.tacho)
    return replace(wanted, channels=tuple(keys), tacho=tacho)


def _number(holding: Holding, candidates: Sequence[_Candidate], key: str | int) -> int:
    columns = [column for one in candidates for column in one.columns]
    names = [(column.name, column.cell) for column in columns]
    numbers = [column.number for column in columns]
    return numbers[find_column(holding.path, key, names, numbers)]


def _named(holding: Holding, candidates: Sequence[_Candidate], wanted: Wanted) -> list[_Candidate]:
    """Return the arrays that hold what the user named; the tacho alone names no vibration."""
    numbers = {key for key in wanted.channels if isinstance(key, int)}
    if not numbers:
        for sensor in wanted.sensors:
            try:
                numbers.add(_number(holding, candidates, sensor.column))
            except RecordingError:
                continue  # a sensor of the machine need not be in every recording
    if not numbers:
        return []
    if isinstance(wanted.tacho, int):
        numbers.add(wanted.tacho)
    return [one for one in candidates if numbers & {column.number for column in one.columns}]


def _only(holding: Holding, candidates: Sequence[_Candidate]) -> list[_Candidate]:
    """Return the arrays that may be vibration if there is no choice among them."""
    possible = [one for one in candidates if "vibration" in one.kinds] or list(candidates)
    if len(possible) == 1:
        return possible
    if not holding.together:
        raise RecordingError(
            f"{holding.path}: holds {len(possible)} arrays that may be the recording; name one "
            f"with --channel: {_listed(possible)}"
        )
    return possible


def _check_alike(holding: Holding, chosen: Sequence[_Candidate]) -> None:
    first = chosen[0].array
    for one in chosen[1:]:
        other = one.array
        if other.count != first.count:
            what = "are not equally long"
        elif not _same_rate(first, other):
            what = "have different sampling rates"
        elif not _same_start(first, other):
            what = "do not start at the same time"
        else:
            continue
        raise RecordingError(
            f"{holding.path}: '{shortened(first.name)}' and '{shortened(other.name)}' {what}; name "
            f"with --channel what belongs together: {_listed(chosen)}"
        )


def _same_rate(first: Array, other: Array) -> bool:
    if first.rate_hz is None or other.rate_hz is None:
        return first.rate_hz == other.rate_hz
    return abs(first.rate_hz - other.rate_hz) <= _SAME_RATE * first.rate_hz


def _same_start(first: Array, other: Array) -> bool:
    if first.start_s is None or other.start_s is None or first.rate_hz is None:
        return True
    return abs(first.start_s - other.start_s) * first.rate_hz < _HALF_SAMPLE


def _accompanies(one: _Candidate, chosen: _Candidate, holding: Holding) -> bool:
    """Tell whether an array goes with the chosen one: by its name no vibration, and as long."""
    if "vibration" in one.kinds or "index" in one.kinds or one.array.count != chosen.array.count:
        return False
    alike = _same_rate(chosen.array, one.array) and _same_start(chosen.array, one.array)
    return alike or not holding.together


def _listed(candidates: Iterable[_Candidate]) -> str:
    shown = [one.shown for one in candidates]
    return ", ".join(shown[:_LISTED]) + (", ..." if len(shown) > _LISTED else "")


def _frames(holding: Holding, taken: Sequence[_Candidate], others: bool) -> Frames:
    arrays = [one.array for one in taken]
    rate, hint = stated_rate(holding.facts)
    own = next((array.rate_hz for array in arrays if array.rate_hz is not None), None)
    speed, name = stated_speed(holding.facts)
    notes = list(holding.notes)
    if speed is not None:
        notes.append(f"the file states a speed of {speed:g} rpm ({shortened(name)})")
    if others and not holding.together:
        notes.append(f"taken from the file: {_listed(taken)}")

    def read(start: int, stop: int) -> Floats:
        with reading(holding.path, holding.what):
            parts = [array.read(start, stop) for array in arrays]
            if any(part.shape[1] != stop - start for part in parts):
                raise RecordingError(
                    f"{holding.path}: is cut off: fewer samples than it announces; copy it again"
                )
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    return Frames(
        path=holding.path,
        columns=tuple(column for one in taken for column in one.columns),
        count=arrays[0].count,
        read=read,
        rate_hz=rate if own is None else own,
        rate_hint=hint,
        speed_rpm=speed,
        notes=tuple(notes),
    )
