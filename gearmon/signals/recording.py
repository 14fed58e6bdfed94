"""Recordings: samples with their sampling rate, names, kinds and units; read from files."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import InitVar, dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, RecordingError, check_range, check_word
from gearmon.result import Result, sample_rows, with_units
from gearmon.signals.reading import Wanted, interpret, read_file, read_memory
from gearmon.signals.reading.channels import SensorLike
from gearmon.signals.reading.columns import Column, all_finite, find_columns
from gearmon.units import KNOWN_UNITS, is_unit

#: Vibration is sampled no slower and no faster [Hz].
RATES_HZ = 1e-3, 1e10
CHANNEL_KINDS = ("vibration", "tacho", "torque", "speed", "other")


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording(Result):
    """Samples of one or more channels, taken at the same instants at an even rate.

    Parameters
    ----------
    samples : ndarray of float64, shape (channels, n), n >= 2
        The samples, all finite; read-only. Accelerations are in m/s2 where their unit is known.
    sampling_rate_hz : float, in [0.001, 1e10]
        Samples per second.
    channel_names : tuple of str, optional
        One name for each channel; "channel 1" and so on if not given.
    channel_kinds : tuple of str, optional
        For each channel "vibration" (if not given), "tacho", "torque", "speed" or "other".
    units : tuple of (str or None), optional
        The unit of each channel; None where it is unknown.
    origin : str
        The file, or where else the samples come from.
    notes : tuple of str
        What was assumed or left out on reading, in sentences for the user.
    columns : tuple of int, optional
        The column of each channel in its file, counted from 1 and counting every column.
    tacho_told : bool
        Whether somebody said that a tacho channel is one, not its name alone: then it must be
        usable.
    left_out : tuple of (int, int) or None
        First sample, and the one behind the last, of stretches that no machine made and that hold
        zeros instead; None as long as nobody looked for them (`gearmon.signals.bad_samples`).
    known_finite : bool
        Whether the samples were looked at already and are finite; they are not looked at again.

    Raises
    ------
    RecordingError
        If the samples are not finite or fewer than two.
    ArgumentError
        If shapes, numbers of names, kinds or units, or the rate are impossible.

    Examples
    --------
    >>> samples = np.array([[0.0, 1.0, 0.0, -1.0]])
    >>> recording = Recording(samples=samples, sampling_rate_hz=8.0, channel_names=("a1",))
    >>> recording.duration_s
    0.5
    >>> recording = gearmon.read_recording(new)
    >>> recording.vibration().channel_names, recording.select("a2").channel_names
    (('a1', 'a2'), ('a2',))
    >>> recording.row_of("a2"), recording.row_of(recording.columns[2])
    (1, 2)
    >>> recording.part([2]).channel_kinds, len(recording.frame_rows()) == recording.samples.shape[1]
    (('tacho',), True)
    """

    samples: FloatArray
    sampling_rate_hz: float
    channel_names: tuple[str, ...] = ()
    channel_kinds: tuple[str, ...] = ()
    units: tuple[str | None, ...] = ()
    origin: str = ""
    notes: tuple[str, ...] = ()
    columns: tuple[int, ...] = ()
    tacho_told: bool = True
    left_out: tuple[tuple[int, int], ...] | None = None
    known_finite: InitVar[bool] = False

    def __post_init__(self, known_finite: bool) -> None:
        check_range("sampling_rate_hz", self.sampling_rate_hz, *RATES_HZ, "Hz")
        samples = np.asarray(self.samples, dtype=np.float64)
        if samples.ndim != 2:
            raise ArgumentError(f"samples have shape {samples.shape}, must be (channels, n)")
        count, view = len(samples), samples.view()
        view.flags.writeable = False
        object.__setattr__(self, "samples", view)
        defaults: dict[str, tuple[object, ...]] = {
            "channel_names": tuple(f"channel {number}" for number in range(1, count + 1)),
            "channel_kinds": ("vibration",) * count,
            "units": (None,) * count,
            "columns": tuple(range(1, count + 1)),
        }
        for name, default in defaults.items():
            given = tuple(getattr(self, name)) or default
            if len(given) != count:
                raise ArgumentError(f"{name} has {len(given)} entries for {count} channels")
            object.__setattr__(self, name, given)
        for kind in self.channel_kinds:
            check_word("kind=", kind, CHANNEL_KINDS)
        where = f"{self.origin}: " if self.origin else ""
        if samples.shape[1] < 2:
            raise RecordingError(
                f"{where}{samples.shape[1]} sample(s) per channel; at least 2 are needed"
            )
        for name, channel in zip(self.channel_names, samples, strict=True):
            if not (known_finite or all_finite(channel)):
                raise RecordingError(
                    f"{where}channel '{name}' has values that are no finite numbers, or above 1e30"
                )

    def frame_rows(self) -> list[dict[str, Any]]:
        """Return a row a sample: the time, and every channel."""
        heads = with_units(self.channel_names, self.units)
        return sample_rows(self.samples, self.sampling_rate_hz, heads)

    @property
    def duration_s(self) -> float:
        """Duration in seconds: number of samples over sampling rate."""
        return float(self.samples.shape[1] / self.sampling_rate_hz)

    def select(self, channels: str | int | Iterable[str | int]) -> Recording:
        """Return the recording with these channels only, in the order given.

        Parameters
        ----------
        channels : str, int or iterable of these
            Names, or column numbers counted from 1 as in the file.

        Raises
        ------
        RecordingError
            If there is no such channel, or several have the name.
        """
        keys = [channels] if isinstance(channels, str | int) else list(channels)
        return self.part([self.row_of(key) for key in keys])

    def row_of(self, channel: str | int) -> int:
        """Return the row of a channel, by its name or column number as in `select`.

        Raises
        ------
        RecordingError
            As `select`.
        """
        named = zip(self.columns, self.channel_names, strict=True)
        known = [Column(number=number, name=name) for number, name in named]
        return find_columns(self.origin, channel, known)[0]

    def vibration(self) -> Recording:
        """Return the recording with its vibration channels only.

        Raises
        ------
        RecordingError
            If there is none.
        """
        found = [index for index, own in enumerate(self.channel_kinds) if own == "vibration"]
        if not found:
            raise RecordingError(f"{self.origin}: no vibration channel; name one with --channel")
        return self.part(found)

    def part(self, indices: Sequence[int]) -> Recording:
        """Return the recording with these channels only, by their rows."""
        in_a_row = list(indices) == list(range(indices[0], indices[0] + len(indices)))
        chosen = slice(indices[0], indices[0] + len(indices)) if in_a_row else list(indices)
        own: dict[str, Any] = {
            name: tuple(getattr(self, name)[index] for index in indices)
            for name in ("channel_names", "channel_kinds", "units", "columns")
        }
        # a view where the channels are neighbours
        return replace(self, samples=self.samples[chosen], known_finite=True, **own)


#: What `read_recording` takes: a file, an array, a DataFrame or Series, what `gearmon.simulate`
#: made, or a `Recording`. (Arrays and frames have no type in common.)
RecordingLike: TypeAlias = Any


def read_recording(
    source: RecordingLike,
    sampling_rate_hz: float | None = None,
    channels: str | int | Iterable[str | int] | None = None,
    tacho: str | int | None = None,
    sensors: Iterable[SensorLike] = (),
    *,
    unit: str | None = None,
    on_disk: bool = False,
) -> Recording:
    """Return the recording in a file, an array or a DataFrame.

    Text (CSV, TSV, TXT; plain or gzip): separator, decimal character, lines above the numbers,
    names, units and the time column are found out; every number is exactly what ``float`` makes of
    its text. WAV, npy, npz and MATLAB files up to version 7 are read as they are; FLAC, HDF5 and
    MATLAB 7.3, TDMS, UFF 58 and Parquet with the extra of that name. Rate, names and units are
    taken from the file where it states them. What is not certain is refused with one line that says
    why, and nothing is repaired; only a speed that few rows hold, as a bus tells it, is taken to go
    straight from each to the next, with a note.

    Parameters
    ----------
    source : str, Path, array, DataFrame, Series, SimulatedRecording or Recording
        The file; or the samples themselves: an array of shape (n,), (channels, n) or (n, channels),
        of which the longer axis is time; a frame with a channel a column, named with its unit, as
        "a1 [m/s2]", and the time as its index or a column; a Recording is returned as it is.
    sampling_rate_hz : float > 0, optional
        Sampling rate [Hz]. Needed for an array, and where the file or frame neither states it nor
        has the time; otherwise both must agree within 0.1 %.
    channels : str, int or iterable of these, optional
        Names, or column numbers counted from 1 (the time column counts), of the vibration channels
        to take; all by default. A named channel that is dead, clipped or incomplete is an error;
        of unnamed ones it is left out with a note. Channels stay in the order of the file. Of a
        file with several arrays the names pick those that are the recording.
    tacho : str or int, optional
        The column that holds tacho pulses; by default one whose name says so.
    sensors : iterable, optional
        What the columns hold: anything with `column`, `unit`, `sensitivity` and `kind`, such as
        `gearmon.machine.Sensor`. It goes before what the file says. Samples are divided by the
        sensitivity, which is the recorded number per `unit`.
    unit : str, optional
        Unit of the vibration channels, such as "m/s2", "g" or "mm/s", where nothing else states it.
    on_disk : bool
        Whether the samples are to lie in a temporary file instead of in memory; see
        `open_recording`.

    Returns
    -------
    Recording
        Accelerations in m/s2 where the unit is known; other units as they stand in the file.

    Raises
    ------
    RecordingError
        If the file cannot be read as a recording.
    ArgumentError
        If an argument is out of its range, or the source is none of these.

    Examples
    --------
    >>> samples = np.random.default_rng(1).normal(size=(2, 1000))
    >>> recording = read_recording(samples, 8000.0, unit="g")
    >>> recording.duration_s, recording.units
    (0.125, ('m/s2', 'm/s2'))
    """
    if sampling_rate_hz is not None:
        check_range("sampling_rate_hz", sampling_rate_hz, *RATES_HZ, "Hz")
    if unit is not None and not is_unit(str(unit)):
        raise ArgumentError(
            f"unit={unit!r}: is no known unit; give {KNOWN_UNITS}, or leave it out: "
            "then levels are in the numbers of the recording"
        )
    wanted = Wanted(
        sampling_rate_hz=sampling_rate_hz,
        channels=(channels,) if isinstance(channels, str | int) else tuple(channels or ()),
        tacho=tacho,
        sensors=tuple(sensors),
        unit=unit,
        room=_room_on_disk if on_disk else _room_in_memory,
    )
    if isinstance(source, Recording) or hasattr(source, "channel_kinds"):
        return _recording_of(source, wanted)
    if not isinstance(source, str | Path):
        try:
            return Recording(**interpret(read_memory(source, wanted), wanted))
        except RecordingError as error:  # whoever has a frame has no command line
            told = re.sub("--sampling-rate( HZ)?", "sampling_rate_hz", str(error))
            raise RecordingError(told.replace("--channel", "channels")) from None
    return Recording(**interpret(read_file(source, wanted), wanted))


def read_recordings(
    sources: RecordingLike | Iterable[RecordingLike], **options: Any
) -> list[Recording]:
    """Return one or several recordings as `read_recording` does; those in memory get numbers.

    Parameters
    ----------
    sources : one of what `read_recording` takes, or a list or tuple of them
    **options
        Of `read_recording`, for all.
    """
    several = sources if isinstance(sources, list | tuple) else [sources]
    found = [read_recording(source, **options) for source in several]
    for k, one in enumerate(found):
        if one.origin in ("", "array", "DataFrame", "simulated"):
            found[k] = replace(one, origin=f"{one.origin or 'unnamed'} {k + 1}", known_finite=True)
    return found


def _recording_of(made: Any, wanted: Wanted) -> Recording:
    """Return a recording as it is, or one that was simulated; refuse options that contradict it."""
    rate = wanted.sampling_rate_hz
    if rate is not None and rate != made.sampling_rate_hz:
        raise ArgumentError(
            f"sampling_rate_hz={rate:g} Hz, but the recording has {made.sampling_rate_hz:g} Hz; "
            "leave it out"
        )
    if not isinstance(made, Recording):
        known = ("samples", "sampling_rate_hz", "channel_names", "channel_kinds", "units")
        made = Recording(**{name: getattr(made, name) for name in known}, origin="simulated")
    recording: Recording = made
    return recording.select(wanted.channels) if wanted.channels else recording


def open_recording(
    path: str | Path,
    sampling_rate_hz: float | None = None,
    channels: str | int | Iterable[str | int] | None = None,
    tacho: str | int | None = None,
    sensors: Iterable[SensorLike] = (),
) -> Recording:
    """Return the recording in a file of any size, its samples in a temporary file on disk.

    Parameters
    ----------
    path, sampling_rate_hz, channels, tacho, sensors
        As of `read_recording`.

    Returns
    -------
    Recording
        As that of `read_recording`, for every analysis alike. The system keeps as much of the
        samples in memory as there is room for, and takes the file away with the recording.

    Raises
    ------
    RecordingError, ArgumentError
        As `read_recording`.

    Examples
    --------
    >>> from gearmon.simulation import write_simulation
    >>> _ = write_simulation(half, "half.csv")
    >>> gearmon.open_recording("half.csv").channel_names
    ('a1', 'a2', 'tacho')
    """
    return read_recording(path, sampling_rate_hz, channels, tacho, sensors, on_disk=True)


def _room_in_memory(path: str, shape: tuple[int, int]) -> FloatArray:
    """Return an array of this shape if there is memory for it: the system would give it anyway."""
    needed = 8 * math.prod(shape)
    if needed > free_bytes():
        raise RecordingError(
            f"{path}: its numbers need {1e-9 * needed:.3g} GB of memory; cut the recording, or "
            "take open_recording"
        )
    return np.empty(shape)


def free_bytes() -> float:
    """Return the memory that is free, or given to this group of processes, if Linux tells."""
    free = math.inf
    with suppress(OSError, StopIteration):
        lines = Path("/proc/meminfo").read_text().splitlines()
        free = 1024.0 * next(int(own.split()[1]) for own in lines if own.startswith("MemAvail"))
    with suppress(OSError, ValueError):  # "max" where it is not limited
        free = min(free, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return free


def _room_on_disk(_path: str, shape: tuple[int, int]) -> FloatArray:
    """Return an array of this shape that lies in a nameless temporary file."""
    from tempfile import TemporaryFile  # most recordings fit into memory

    with TemporaryFile() as file:
        return np.memmap(file, np.float64, "w+", shape=shape).view(np.ndarray)
