"""Recordings that are in memory already: arrays, and frames of named columns with their index."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearmon.errors import ArgumentError, RecordingError
from gearmon.signals.reading.columns import Content, DataColumn, describe_columns
from gearmon.signals.reading.fields import Floats
from gearmon.signals.reading.formats.arrays import as_array
from gearmon.signals.reading.layout import Header

_ACCEPTED = (
    "give the name of a file, an array of shape (n,) or (channels, n) with sampling_rate_hz=, a "
    "DataFrame (columns are channels), or a Recording"
)


def content_of(data: Any, rate_hz: float | None) -> Content:
    """Return what stands in an array or a frame, as if it had been read from a file.

    Parameters
    ----------
    data : array-like, DataFrame or Series
        An array of shape (n,), (channels, n) or (n, channels), the longer axis being time; or
        anything of pandas, whose columns may be named with their units, as "a1 [m/s2]", and whose
        index, of moments, durations or numbers, is the time.
    rate_hz : float > 0 or None
        Sampling rate of an array.

    Returns
    -------
    Content
        With copies of the numbers.

    Raises
    ------
    ArgumentError
        If it is none of these, or the sampling rate is not known.
    RecordingError
        If there are no numbers in it.
    """
    if hasattr(data, "to_frame") and hasattr(data, "index"):
        data = data.to_frame("" if data.name is None else data.name)  # a series is one column
    if hasattr(data, "columns") and hasattr(data, "iloc"):
        return _of_frame(data, rate_hz)
    if not hasattr(data, "__array__"):
        raise ArgumentError(f"recording: {type(data).__name__} is no recording; {_ACCEPTED}")
    return _of_array(np.asarray(data), rate_hz)


def _of_array(data: Any, rate_hz: float | None) -> Content:
    found = as_array("", data)
    if found is None:
        raise ArgumentError(
            f"recording: an array of shape {data.shape} and type {data.dtype} is none; "
            f"{_ACCEPTED}, with more samples than channels"
        )
    if rate_hz is None:
        raise ArgumentError(
            f"recording: the sampling rate of an array of shape {data.shape} cannot be known; give "
            "sampling_rate_hz="
        )
    numbers = range(1, len(found.names) + 1)
    return Content(
        path="array",
        values=np.array(found.read(0, found.count)),
        columns=tuple(DataColumn(number=number, name=f"channel {number}") for number in numbers),
        rate_hz=rate_hz,
    )


def _of_frame(frame: Any, rate_hz: float | None) -> Content:
    """Take the columns of numbers, and the index as one more where it may be the time."""
    kinds = [getattr(dtype, "kind", "O") for dtype in frame.dtypes]
    taken = [number for number, kind in enumerate(kinds) if kind in "fiub"]
    if not taken or len(frame) < 2:
        raise RecordingError(
            f"DataFrame of shape {frame.shape}: holds no recording; columns of numbers are channels"
        )
    names = [str(frame.columns[number]) for number in taken]
    rows = [frame.iloc[:, number].to_numpy(np.float64, na_value=np.nan) for number in taken]
    name, stamps = _time_of(frame.index)
    columns = describe_columns(Header(names=(*names, name)), len(names) + 1)
    timed = any(column.kind == "time" for column in columns[:-1])
    if stamps is not None and not timed:
        rows.append(stamps)
    elif rate_hz is None and not timed:
        raise ArgumentError(
            f"DataFrame of shape {frame.shape}: its sampling rate is not known; give "
            "sampling_rate_hz=, or the time as index"
        )
    left_out = [str(name) for name, kind in zip(frame.columns, kinds, strict=True) if kind == "O"]
    return Content(
        path="DataFrame",
        values=np.array(rows),
        columns=columns[: len(rows)],
        notes=(f"no numbers, left out: {', '.join(left_out)}",) if left_out else (),
    )


def _time_of(index: Any) -> tuple[str, Floats | None]:
    """Return name and numbers of an index that may be the time."""
    kind = getattr(index.dtype, "kind", "O")
    if kind in "mM":
        # whole nanoseconds, as pandas has them: seconds would not show where they were rounded
        return "time_ns", np.asarray((index - index[0]) / np.timedelta64(1, "ns"), np.float64)
    if kind not in "fiu" or type(index).__name__ == "RangeIndex":
        return "", None
    return str(index.name or "time"), index.to_numpy(np.float64)
