"""What a file of arrays holds: arrays that may be signals, and facts that stand beside them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gearmon.errors import GearmonError, RecordingError
from gearmon.signals.reading.fields import Floats, shortened

Read = Callable[[int, int], Floats]

_RATE_NAMES = frozenset(
    {"fs", "fshz", "samplingrate", "samplingratehz", "samplerate", "sampleratehz"}
    | {"samplingfrequency", "samplingfrequencyhz", "samplefrequency", "samplefrequencyhz"}
    | {"samplingfreq", "samplefreq", "abtastrate", "abtastfrequenz"}
)
# What may be the rate or the interval, and may be something else, such as the rate of a shaft.
_HINT_NAMES = frozenset({"sr", "rate", "dt", "ts", "deltat", "timestep", "sampletime", "f"})
_MOST_AXES = 2
_FEWEST_SAMPLES = 2


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
    units : tuple of (str or None)
        The unit of each channel; None where the file states none.
    rate_hz : float > 0 or None
        The sampling rate, if the file states one for this array.
    start_s : float or None
        When the first sample was taken, if the file tells.
    """

    name: str
    names: tuple[str, ...]
    count: int
    read: Read
    units: tuple[str | None, ...]
    rate_hz: float | None = None
    start_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class Holding:
    """What a file holds.

    Parameters
    ----------
    path : str
        The file.
    what : str
        What kind of file it is, for messages.
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
    close : callable
        Closes the file.
    """

    path: str
    what: str
    arrays: tuple[Array, ...]
    together: bool = False
    facts: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    close: Callable[[], object] = field(default=lambda: None)


@contextmanager
def reading(path: str, what: str) -> Iterator[None]:
    """Turn whatever a library raises about a damaged file into one line.

    Raises
    ------
    RecordingError
        If anything is raised inside.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a library's remarks on a file that it can read
            yield
    except GearmonError:
        raise
    except MemoryError:
        raise RecordingError(
            f"{path}: {what} whose content does not fit into memory; cut it into parts"
        ) from None
    # what a library raises about a damaged file is anything but documented
    except Exception as error:
        first = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise RecordingError(
            f"{path}: looks like {what} and cannot be read as such ({shortened(first)}); is it "
            "damaged? Copy it again"
        ) from None


def as_array(
    name: str,
    data: Any,
    *,
    unit: str | None = None,
    rate_hz: float | None = None,
) -> Array | None:
    """Return numbers of shape (n,), (n, 1), (1, n), (channels, n) or (n, channels) as signals.

    The longer axis is time.

    Parameters
    ----------
    name : str
        The name in the file.
    data : array-like with `shape`, `dtype` and slicing
        The numbers; they are read only when samples are asked for.
    unit : str, optional
        Their unit.
    rate_hz : float > 0, optional
        Their sampling rate.

    Returns
    -------
    Array or None
        None if it can be no signal: no real numbers, one number only, other shapes.

    Raises
    ------
    RecordingError
        If both axes are equally long.
    """
    long_axes = [axis for axis, size in enumerate(data.shape) if size != 1]
    if data.dtype.kind not in "fiub" or not long_axes or len(long_axes) > _MOST_AXES:
        return None
    time = max(long_axes, key=lambda axis: data.shape[axis])
    others = [axis for axis in long_axes if axis != time]
    count, channels = int(data.shape[time]), math.prod(int(data.shape[a]) for a in others)
    if count < _FEWEST_SAMPLES or channels == 0 or (others and channels == count):
        return None

    def read(start: int, stop: int) -> Floats:
        index = [slice(None) if axis in long_axes else 0 for axis in range(len(data.shape))]
        index[time] = slice(start, stop)
        part = np.asarray(data[tuple(index)], dtype=np.float64)
        part = part.T if others and time < others[0] else part
        return part.reshape(channels, -1)

    numbered = tuple(f"{name} {k}" if name else "" for k in range(1, channels + 1))
    return Array(
        name=name,
        names=(name,) if channels == 1 else numbered,
        count=count,
        read=read,
        units=(unit,) * channels,
        rate_hz=rate_hz,
    )


def stated_rate(facts: Mapping[str, float]) -> tuple[float | None, str]:
    """Return the sampling rate among the facts, and a hint where nothing is certain.

    Only a name that means nothing else counts, and only if all of them agree.

    Examples
    --------
    >>> stated_rate({"data.Fs": 12000.0, "rpm": 1796.0})
    (12000.0, '')
    >>> stated_rate({"sr": 97656.0})
    (None, 'sr = 97656 may be it')
    """
    named = {name: value for name, value in facts.items() if _plain(name) in _RATE_NAMES}
    usable = {value for value in named.values() if math.isfinite(value) and value > 0}
    if len(usable) == 1 and len(usable) == len(set(named.values())):
        return usable.pop(), ""
    if named:
        listed = ", ".join(f"{shortened(name)} = {value:g}" for name, value in named.items())
        return None, f"in the file: {listed}"
    for name, value in facts.items():
        if _plain(name) in _HINT_NAMES:
            return None, f"{shortened(name)} = {value:g} may be it"
    return None, ""


def stated_speed(facts: Mapping[str, float]) -> tuple[float | None, str]:
    """Return the speed in rpm among the facts, and its name; None if none or several are there.

    Examples
    --------
    >>> stated_speed({"X097RPM": 1796.0})
    (1796.0, 'X097RPM')
    """
    named = [
        (name, value)
        for name, value in facts.items()
        if _plain(name).endswith("rpm") and math.isfinite(value) and value > 0
    ]
    if len({value for _, value in named}) != 1:
        return None, ""
    return named[0][1], named[0][0]


def _plain(name: str) -> str:
    last = name.replace("/", ".").rpartition(".")[2].lower()
    return "".join(character for character in last if character.isalnum())
