"""Arrays in a file or in memory: those that may be signals, and the facts that stand beside them.

Taken are the arrays that the user names, or the only ones that can be the recording.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, RecordingError
from gearmon.files import most_unpacked
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.columns import Column, Table, describe_columns, find_columns, shortened

Read = Callable[[int, int], FloatArray]

# Names in plain letters, without "hz" behind them.
_RATE = re.compile("fs|sampl(e|ing)(rate|freq|frequency)|abtast(rate|frequenz)")
# Names that mean it nearly always, and between which numbers they are believed: a shaft of 30,000
# 1/min turns at 500 Hz, so what is slower may be a speed and can sample no mesh; nothing that is
# recorded as vibration is faster than 100 MHz.
_LIKELY = re.compile("sr|sampfreq|samprate")
_PLAUSIBLE_HZ = (500.0, 1e8)
# What may be the rate or the interval, and may be something else, such as the rate of a shaft.
_HINT = re.compile("rate|dt|ts|deltat|timestep|sampletime|f")
# Kinds of numpy: moments and durations, and what may be samples.
_MOMENTS = "mM"
_NUMBERS = "fiub" + _MOMENTS
_BLOCK = 1 << 18
_LISTED = 12
_SAME_RATE = 1e-9
_HALF_SAMPLE = 0.5
_UNIT_NAMES = ("unit", "units", "Unit", "Units", "unit_string")
# What is taken of arrays and frames in memory.
_ACCEPTED = (
    "give the name of a file, an array of shape (n,) or (channels, n) with sampling_rate_hz=, a "
    "DataFrame (columns are channels), or a Recording"
)


@dataclass(frozen=True, kw_only=True)
class Array:
    """One array of a file, as signals of one or more channels.

    Parameters
    ----------
    name : str
        Its name in the file; "" if it has none.
    names : tuple of str
        The name of each channel; "" where there is none.
    count : int
        Samples of each channel.
    read : callable
        Gives the samples from a first to before a last one: float64, shape (channels, n).
    unit : str or None
        The unit of its channels; None where the file states none.
    rate_hz : float > 0 or None
        The sampling rate, if the file states one for this array.
    start_s : float
        When the first sample was taken, by the clock that the arrays of the file share.
    columns : tuple of Column
        Its channels, once those of all arrays are numbered.
    """

    name: str = ""
    names: tuple[str, ...]
    count: int
    read: Read
    unit: str | None = None
    rate_hz: float | None = None
    start_s: float = 0.0
    columns: tuple[Column, ...] = ()

    def __str__(self) -> str:
        """How messages list it: name, columns, samples."""
        first, last = self.columns[0].number, self.columns[-1].number
        place = f"{first}; " if first == last else f"{first} to {last}; {len(self.columns)} x "
        return f"{shortened(self.name) or 'the array'} ({place}{self.count} samples)"

    def has(self, kind: str) -> bool:
        """Tell whether a channel is of that kind, by its name or unit."""
        return any(column.kind == kind for column in self.columns)

    def differs(self, other: Array) -> str:
        """Say why both are not channels of one recording; "" if they may be."""
        if other.count != self.count:
            return "are not equally long"
        rate, another = self.rate_hz or 0.0, other.rate_hz or 0.0
        if abs(rate - another) > _SAME_RATE * rate:
            return "have different sampling rates"
        late = abs(self.start_s - other.start_s) * rate >= _HALF_SAMPLE
        return "do not start at the same time" if late else ""

    @classmethod
    def of(
        cls, name: str, data: Any, *, unit: str | None = None, rate_hz: float | None = None
    ) -> Array | None:
        """Return numbers of shape (n,), (n, 1), (1, n), (channels, n) or (n, channels) as signals.

        The longer axis is time.

        Parameters
        ----------
        name : str
            The name in the file.
        data : array-like with `shape` or length, `dtype` and slicing
            The numbers; they are read only when samples are asked for.
        unit : str, optional
            Their unit.
        rate_hz : float > 0, optional
            Their sampling rate.

        Returns
        -------
        Array or None
            None if it can be no signal: no real numbers, one number only, other shapes.
        """
        shape = data.shape if hasattr(data, "shape") else (len(data),)
        long_axes = [axis for axis, size in enumerate(shape) if size != 1]
        sizes = sorted(int(shape[axis]) for axis in long_axes)
        told_apart = len(sizes) in (1, 2) and len({0, *sizes}) > len(sizes)
        if data.dtype.kind not in "fiub" or not told_apart:
            return None
        count, channels = sizes[-1], math.prod(sizes[:-1])
        time = next(axis for axis in long_axes if shape[axis] == count)

        def read(start: int, stop: int) -> FloatArray:
            own = (*[slice(None)] * time, slice(start, stop))
            part = np.asarray(data[own if time else own[0]], dtype=np.float64)
            return np.moveaxis(part, time, -1).reshape(channels, -1)

        numbered = tuple(f"{name} {k}" if name else "" for k in range(1, channels + 1))
        names = (name,) if channels == 1 else numbered
        return cls(name=name, names=names, count=count, read=read, unit=unit, rate_hz=rate_hz)


@dataclass(frozen=True, kw_only=True)
class Holding:
    """What a file holds.

    Parameters
    ----------
    arrays : tuple of Array
        Everything that may be a signal, in the order of the file.
    together : bool
        Whether arrays of one length and rate are channels of one recording.
    facts : mapping of str to float
        Single numbers that stand in the file.
    notes : tuple of str
        What the reader has to tell the user.
    left_out : tuple of str
        What else stands in the file, for messages.
    path, what : str
        The file and its kind, for messages.
    size : int
        Bytes of the file.
    """

    arrays: tuple[Array, ...]
    together: bool = False
    facts: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    path: str = ""
    what: str = ""
    size: int = 1 << 62

    @classmethod
    def of(cls, items: Mapping[str, Any], left_out: Sequence[str] = ()) -> Holding:
        """Return named arrays and single numbers as what a file holds.

        Parameters
        ----------
        items : mapping of str to array-like
            Arrays and single numbers by name.
        left_out : sequence of str
            What else is in the file.
        """
        arrays, facts, others = [], {}, [*left_out]
        for name, data in items.items():
            kind, beside = data.dtype.kind, getattr(data, "attrs", {})
            if kind in "fiu" and all(size == 1 for size in data.shape):
                facts[name] = float(np.asarray(data[()]).reshape(-1)[0])
            elif array := Array.of(name, data, unit=unit_in(beside)):
                rate_hz, _ = _stated_rate(numbers_in(beside))
                names = _names_in(beside, array.names)
                arrays.append(replace(array, rate_hz=rate_hz, names=names))
            else:
                what = f" of shape {data.shape}" if kind in "fiubc" and data.shape else ""
                others.append(f"{name or 'numbers'}{what}")
        return cls(arrays=tuple(arrays), facts=facts, left_out=tuple(others))

    @classmethod
    def of_channels(
        cls, found: Sequence[tuple[str, Array | None]], facts: Mapping[str, float]
    ) -> Holding:
        """Return channels of one recording by their names, those that are none being left out."""
        arrays = tuple(array for _, array in found if array)
        left_out = tuple(name for name, array in found if not array)
        return cls(arrays=arrays, together=True, facts=facts, left_out=left_out)

    def table(self, wanted: Wanted) -> Table:
        """Return the columns that make up the recording.

        A name with --channel, --tacho or in a [[sensor]] picks an array or one channel of it.
        Without any, the file must leave no choice: one array that may be vibration, or, in formats
        whose channels belong together, all of one length and rate. Arrays that are called like a
        time, a tacho, a speed or a torque and have the same length come along.

        Parameters
        ----------
        wanted : Wanted
            What the user says.

        Raises
        ------
        RecordingError
            If there is no signal, several may be meant, or those named do not fit together.
        """
        if not self.arrays:
            others = ", ".join(map(shortened, self.left_out[:_LISTED]))
            raise RecordingError(
                f"{self.path}: {self.what} without a signal in it"
                f"{f' (it holds {others})' if others else ''}; an array of real numbers is needed, "
                "with more samples than channels"
            )
        # columns are described, and numbered through all arrays
        arrays, number = [], 1
        for array in self.arrays:
            units = [array.unit] * len(array.names) if array.unit else ()
            columns = describe_columns(array.names, units, first=number, array=array.name)
            arrays.append(replace(array, columns=columns))
            number += len(columns)
        holding = replace(self, arrays=tuple(arrays))
        named = holding._named(wanted)
        chosen = named or [own for own in holding.arrays if own.has("vibration")] or holding.arrays
        first = chosen[0]
        for other in chosen[1:]:
            what = first.differs(other)
            why = what and f"'{shortened(first.name)}' and '{shortened(other.name)}' {what}"
            if not (named or holding.together):
                why = f"holds {len(chosen)} arrays that may be the recording"
            if why:
                raise RecordingError(
                    f"{holding.path}: {why}; name with --channel what belongs together: "
                    f"{_listed(chosen)}"
                )
        taken = [own for own in holding.arrays if own in chosen or holding._accompanies(own, first)]
        return holding._table(taken, holding._filled(taken, wanted))

    def _named(self, wanted: Wanted) -> list[Array]:
        """Return the arrays that hold what the user named; the tacho alone names no vibration."""
        columns = [column for array in self.arrays for column in array.columns]

        def numbers(*keys: str | int) -> set[int]:
            places = (k for key in keys for k in find_columns(self.path, key, columns))
            return {columns[k].number for k in places}

        found = numbers(*wanted.channels)
        tacho = set() if wanted.tacho is None else numbers(wanted.tacho)
        for sensor in () if found else wanted.sensors:
            with suppress(RecordingError):  # a sensor of the machine need not be in every recording
                found |= numbers(sensor.column)
        found |= tacho if found else set()
        return [one for one in self.arrays if found & {column.number for column in one.columns}]

    def _accompanies(self, one: Array, chosen: Array) -> bool:
        """Tell whether an array goes with the chosen one: by its name no vibration, and as long."""
        if one.has("vibration") or one.has("index") or one.count != chosen.count:
            return False
        return not self.together or not chosen.differs(one)

    def _filled(self, arrays: Sequence[Array], wanted: Wanted) -> FloatArray:
        """Read arrays of one length into one, block by block."""
        rows, total = sum(len(array.names) for array in arrays), arrays[0].count
        if 8 * total * rows > most_unpacked(self.size):
            raise RecordingError(
                f"{self.path}: announces {total} samples of {rows} channels in "
                f"{self.size / 1e6:.2g} MB, as no recording does; is it damaged, or are its "
                "samples in another file?"
            )
        values, ends = wanted.room(self.path, (rows, total)), [len(own.names) for own in arrays]
        for array, own in zip(arrays, np.split(values, np.cumsum(ends)[:-1]), strict=True):
            for start in range(0, total, _BLOCK):
                stop = min(total, start + _BLOCK)
                part = array.read(start, stop)
                if part.shape[1] != stop - start:
                    raise ValueError("it is cut off: fewer samples than it announces")
                own[:, start:stop] = part
        return values

    def _table(self, taken: Sequence[Array], values: FloatArray) -> Table:
        rate, remark = _stated_rate(self.facts)
        own = next((one.rate_hz for one in taken if one.rate_hz is not None), None)
        notes = [*self.notes, remark if rate is not None and own is None else ""]
        speeds = (name for name in self.facts if _plain(name).endswith("rpm"))
        notes += [f"the file states {shortened(name)} = {self.facts[name]:g}" for name in speeds]
        if self.together:
            notes += [f"{shortened(own)} holds no numbers: left out" for own in self.left_out]
        elif len(taken) < len(self.arrays):
            notes.append(f"taken from the file: {_listed(taken)}")
        return Table(
            path=self.path,
            values=values,
            columns=tuple(column for one in taken for column in one.columns),
            rate_hz=rate if own is None else own,
            rate_hint=remark,
            notes=tuple(notes),
        )


def plain_text(value: Any) -> str:
    """Return a text without blanks around it; "" for what is none or says NONE."""
    text = value.decode(errors="replace") if isinstance(value, bytes) else value
    stripped = text.strip() if isinstance(text, str) else ""
    return "" if stripped.upper() == "NONE" else stripped


def unit_in(metadata: Mapping[Any, Any] | None) -> str | None:
    """Return the unit that stands beside an array."""
    named = {plain_text(key): plain_text(value) for key, value in (metadata or {}).items()}
    return next((named[key] for key in _UNIT_NAMES if named.get(key)), None)


def numbers_in(metadata: Mapping[Any, Any] | None, prefix: str = "") -> dict[str, float]:
    """Return the single numbers that stand beside the arrays."""
    found = {}
    for key, value in (metadata or {}).items():
        single = np.asarray(value).reshape(-1)
        with suppress(TypeError, ValueError):  # a text, a moment
            if single.size == 1:
                found[f"{prefix}{plain_text(key)}"] = float(single[0])
    return found


def _names_in(beside: Mapping[Any, Any], usual: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of channels that an attribute lists, if there is one for each."""
    for key in ("channel_names", "channels", "names"):
        value = np.asarray(beside.get(key, ()))
        if value.shape == (len(usual),) and value.dtype.kind in "OSU":
            return tuple(map(plain_text, value.tolist()))
    return usual


def _stated_rate(facts: Mapping[str, float]) -> tuple[float | None, str]:
    """Return the sampling rate among the facts, and a remark where that is not certain.

    A name that means nothing else counts if all such names agree; else the plausible number under
    such a name, or one that nearly always means it, if there is one only.

    Examples
    --------
    >>> _stated_rate({"data.Fs": 12000.0, "rpm": 1796.0})
    (12000.0, '')
    >>> _stated_rate({"sr": 97656.0})
    (97656.0, 'sampling rate 97656 Hz taken from sr')
    >>> _stated_rate({"sr": 48828.0, "SampFreq": 97656.0})
    (None, 'sr = 48828, SampFreq = 97656 may be it')
    """

    def told(*names: re.Pattern[str]) -> dict[str, float]:
        own = {shortened(k): value for k, value in facts.items()}
        return {k: own[k] for k in own if any(name.fullmatch(_plain(k)) for name in names)}

    def shown(rates: Mapping[str, float]) -> str:
        return ", ".join(f"{name} = {value:g}" for name, value in rates.items())

    sure, every, (low, high) = told(_RATE), told(_RATE, _LIKELY, _HINT), _PLAUSIBLE_HZ
    if len({*sure.values()}) == 1 and 0 < min(sure.values()) < math.inf:
        return next(iter(sure.values())), ""
    plausible = {name: own for name, own in every.items() if low <= own <= high}
    believed = {name: own for name, own in told(_RATE, _LIKELY).items() if name in plausible}
    if len({*believed.values()}) == 1:
        name, rate = next(iter(believed.items()))
        others = shown({k: own for k, own in every.items() if k not in believed})
        beside = f", not {others}" if others else ""
        return rate, f"sampling rate {rate:g} Hz taken from {name}{beside}"
    return None, f"{shown(plausible or every)} may be it" if every else ""


def _plain(name: str) -> str:
    last = name.replace("/", ".").rpartition(".")[2].lower()
    return "".join(character for character in last if character.isalnum()).removesuffix("hz")


def _listed(arrays: Sequence[Array]) -> str:
    return ", ".join(map(str, arrays[:_LISTED])) + (", ..." if len(arrays) > _LISTED else "")


def read_memory(data: Any, wanted: Wanted) -> Table:
    """Return the recording in an array or a frame, as if it stood in a file.

    Parameters
    ----------
    data : array-like, DataFrame or Series
        An array of shape (n,), (channels, n) or (n, channels), the longer axis being time; or
        anything of pandas, whose columns may be named with their units, as "a1 [m/s2]", and whose
        index, of moments, durations or numbers, is the time.
    wanted : Wanted
        What the user says.

    Raises
    ------
    ArgumentError
        If it is none of these.
    RecordingError
        If there is no signal in it.
    """
    if hasattr(data, "to_frame") and hasattr(data, "index"):
        data = data.to_frame("" if data.name is None else data.name)  # a series is one column
    if hasattr(data, "columns") and hasattr(data, "iloc"):
        return _of_frame(data).table(wanted)
    if not hasattr(data, "__array__"):
        raise ArgumentError(f"recording: {type(data).__name__} is no recording; {_ACCEPTED}")
    values = np.asarray(data)
    what = f"an array of shape {values.shape} and type {values.dtype}"
    return replace(Holding.of({"": values}), path="array", what=what).table(wanted)


def _of_frame(frame: Any) -> Holding:
    """Take the columns of numbers and moments of a data frame, and its index if it tells more.

    That is one of numbers or moments that does not only count.
    """
    columns = [(str(name), frame.iloc[:, number]) for number, name in enumerate(frame.columns)]
    if _kind(frame.index) in _NUMBERS and type(frame.index).__name__ != "RangeIndex":
        columns.append((str(frame.index.name or "time"), frame.index.to_series()))
    # one row is no signal, and of none there is no first moment
    long = len(frame) > 1
    taken = [(name, own) for name, own in columns if long and _kind(own) in _NUMBERS]
    rows = [floats(own) for _, own in taken]
    array = Array(
        names=tuple(name + "_ns" * (_kind(own) in _MOMENTS) for name, own in taken),
        count=len(frame),
        read=lambda start, stop: np.array([row[start:stop] for row in rows]),
    )
    others = [(name, None) for name, own in columns if _kind(own) not in _NUMBERS]
    told = [("", array)] if rows else []
    holding = Holding.of_channels([*told, *others], {})
    return replace(holding, path="DataFrame", what=f"a frame of shape {frame.shape}")


def _kind(column: Any) -> str:
    return getattr(column.dtype, "kind", "O")


def floats(column: Any) -> FloatArray:
    """Return a column of pandas as numbers; moments in ns from the first one on.

    Seconds would not show where they were rounded, and those since 1970 lose microseconds.
    """
    if _kind(column) in _MOMENTS:
        column = (column - column.iloc[0]) / np.timedelta64(1, "ns")
    return np.asarray(column.to_numpy(np.float64, na_value=np.nan))
