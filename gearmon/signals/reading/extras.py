"""Files that a library beyond the core reads, each an extra of gearmon.

HDF5 (MATLAB 7.3 among them), Parquet, TDMS (LabVIEW), UFF 58 and FLAC.
"""

from __future__ import annotations

import faulthandler
import logging
import os
import re
import resource
import struct
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.files import most_unpacked
from gearmon.signals.reading.arrays import (
    Array,
    Holding,
    as_array,
    floats,
    hold,
    numbers_in,
    plain_text,
    unit_in,
)

# MATLAB stores text as numbers, and cells as references to what lies in #refs#.
_NO_SIGNALS = ("char", "cell", "struct", "function_handle")
# Processor time to look through a file that may crash its library; a tenth of what zlib unpacks.
_TRIAL_S, _TRIAL_BYTES_A_S = 10, 10_000_000
# Of UFF: functions (of time, if the code says so), and directions of a sensor.
_FUNCTION_SET = 58
_GENERAL, _TIME_RESPONSE = 0, 1
_TIME_AXIS = 17
_BIG_ENDIAN = 1 << 6  # of a segment of TDMS
_SET_MARK = re.compile(rb"(?m)^ {4}-1[ \r]*$")  # begins a data set, and ends it
_SET_TYPE = re.compile(rb"\n *[0-9]{1,4}b?[ \r\n]")  # stands in the line below the first mark
_AXES = ("", "X", "Y", "Z", "RX", "RY", "RZ")  # a direction is the place of one, with its sign


def try_out(path: str, task: Callable[[], object]) -> None:
    """Raise if a process of its own does not outlive a task, or needs more memory than it may.

    Of 1,000 damaged files three crash the library of HDF5, and gearmon with all that was still to
    be analysed. What else the task raises does not matter here.

    Raises
    ------
    ValueError
        If it does not.
    """
    with warnings.catch_warnings():
        # threads that draw a progress bar hold nothing that is needed here
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if not pid:
        outcome = 0
        try:
            faulthandler.disable()
            held = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
            size = os.path.getsize(path)
            resource.setrlimit(resource.RLIMIT_DATA, (held + most_unpacked(size),) * 2)
            resource.setrlimit(resource.RLIMIT_CPU, (_TRIAL_S + size // _TRIAL_BYTES_A_S,) * 2)
            task()
        except MemoryError:
            outcome = 1
        finally:
            os._exit(outcome)
    if os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]):
        raise ValueError("it unpacks to more than any, or crashes its reader")


@contextmanager
def read_hdf5(path: str) -> Iterator[Holding]:
    """Give what an HDF5 file holds: all its arrays and single numbers, by their paths.

    Attributes of an array tell its unit (`units`) and its sampling rate (`fs`, `sampling_rate`
    ...); attributes of the file and of groups count as single numbers.

    Raises
    ------
    ValueError
        If the file is damaged.
    """
    import h5py

    def held() -> Holding:
        with h5py.File(path, "r") as file:
            return _hdf5_arrays(file)

    try_out(path, held)
    with h5py.File(path, "r") as file:
        yield _hdf5_arrays(file)


def _hdf5_arrays(file: Any) -> Holding:
    items: dict[str, Any] = {}
    facts, others, found = numbers_in(file.attrs), [], []
    file.visititems(lambda name, item: found.append((name, item)))
    for name, item in found:
        kind = plain_text(item.attrs.get("MATLAB_class"))
        if re.search("(^|/)#", name):  # what MATLAB keeps aside
            continue
        if not hasattr(item, "dtype"):  # a group
            facts |= numbers_in(item.attrs, f"{name}.")
        elif item.shape is None or kind in _NO_SIGNALS:
            others.append(f"{name} ({kind or item.dtype})")
        else:
            items[name] = item
            if item.chunks and item.id.get_num_chunks():
                # their index may be damaged; what they hold is unpacked by zlib
                item.id.get_chunk_info(item.id.get_num_chunks() - 1)
    held = hold(items, others)
    return replace(held, facts=facts | dict(held.facts))


@contextmanager
def read_parquet(path: str) -> Iterator[Holding]:
    """Give what a Parquet table holds: its columns of numbers and times.

    The metadata of a column may tell its unit (`unit`), that of the table the sampling rate (`fs`,
    `sampling_rate` ...).

    Raises
    ------
    ValueError
        If the file is damaged.
    """
    import pyarrow.parquet as parquet

    with parquet.ParquetFile(path, page_checksum_verification=True) as file:
        _check_pages(path, file.metadata)
        yield _parquet_columns(file)


def _check_pages(path: str, told: Any) -> None:
    """Refuse pages that do not end where what stands behind them begins: later values are moved."""
    groups = map(told.row_group, range(told.num_row_groups))
    chunks = [group.column(k) for group in groups for k in range(told.num_columns)]
    ends = [
        (own.dictionary_page_offset or own.data_page_offset) + own.total_compressed_size
        for own in chunks
    ]
    indexed = any(own.has_offset_index or own.has_column_index for own in chunks)
    end = os.path.getsize(path) - 8 - told.serialized_size
    if ends and not indexed and max(ends) != end:
        raise ValueError(f"the pages of its table end at byte {max(ends)}, not {end}")


def _parquet_columns(file: Any) -> Holding:
    from pyarrow import types

    schema, rows = file.schema_arrow, file.metadata.num_rows
    numeric = types.is_integer, types.is_floating, types.is_decimal, types.is_timestamp
    kept = [field for field in schema if any(is_such(field.type) for is_such in numeric)]
    whole = lru_cache(maxsize=1)(lambda name: floats(file.read([name]).column(0).to_pandas()))

    def column(field: Any) -> Array:
        def read(start: int, stop: int) -> FloatArray:
            return np.asarray(whole(field.name)[None, start:stop])

        unit = "ns" if types.is_timestamp(field.type) else unit_in(field.metadata)
        return Array(name=field.name, names=(field.name,), count=rows, read=read, units=(unit,))

    # the row labels of a data frame are no channel
    channels = [field for field in kept if not field.name.startswith("__index_level_")]
    return Holding(
        arrays=tuple(map(column, channels)) if rows > 1 else (),
        together=True,
        facts=numbers_in(schema.metadata),
        left_out=tuple(f"{field.name} ({field.type})" for field in schema if field not in kept),
    )


@contextmanager
def read_tdms(path: str) -> Iterator[Holding]:
    """Give what a TDMS file holds: its channels, with unit and sampling rate where stated.

    Raises
    ------
    ValueError
        If the file is damaged, or its last part is incomplete.
    """
    import nptdms

    stored = _bytes_of_segments(path)
    # opened here, as the library leaves a damaged file open
    with ExitStack() as after, open(path, "rb") as stream:
        # it writes remarks on damage to the terminal
        after.callback(logging.disable, logging.root.manager.disable)
        logging.disable()
        file = nptdms.TdmsFile.open(stream)
        status = file.file_status
        if status.incomplete_final_segment or status.channel_statuses:
            raise ValueError("it is cut off: its last part is incomplete")
        channels = [channel for group in file.groups() for channel in group.channels()]
        told = [own for own in channels if len(own)]
        sizes = [own.data_type.size and own.data_type.size * len(own) for own in told]
        # of text, and of what a driver packs, the size is not known
        if None not in sizes and sum(sizes) != stored:
            raise ValueError(f"its channels take {sum(sizes)} bytes, and it holds {stored}")
        facts = numbers_in(file.properties)
        for group in file.groups():
            facts |= numbers_in(group.properties, f"{group.name}.")
        once = Counter(own.name for own in channels)
        names = [
            own.name if once[own.name] == 1 else f"{own.group_name}/{own.name}" for own in channels
        ]
        found = [(name, _tdms_array(name, own)) for name, own in zip(names, channels, strict=True)]
        yield Holding(
            arrays=tuple(array for _, array in found if array),
            together=True,
            facts=facts,
            left_out=tuple(name for name, array in found if not array),
        )


def _bytes_of_segments(path: str) -> int:
    """Return how many bytes are samples; raise if the file goes on behind its last segment."""
    size, end, stored = os.path.getsize(path), 0, 0
    with open(path, "rb") as stream:
        while end < size:
            stream.seek(end)
            tag, flags, rest = struct.unpack("<4sI20s", stream.read(28).ljust(28, b"\0"))
            if tag != b"TDSm":
                raise ValueError(f"{size - end} bytes belong to no segment")
            _, own, begin = struct.unpack(">IQQ" if flags & _BIG_ENDIAN else "<IQQ", rest)
            end, stored = end + 28 + own, stored + own - begin
    return stored


def _tdms_array(name: str, channel: Any) -> Array | None:
    """Return a channel; None if it holds no numbers."""
    told = numbers_in(channel.properties)
    step = told.get("wf_increment", 0.0)
    # LabVIEW's frequency spectra are waveforms as well; only those over time are signals
    over = str(channel.properties.get("wf_xname", "Time") or "Time").strip().lower()
    rate_hz = float(f"{1.0 / step:.13g}") if step > 0 and over in ("time", "zeit") else None
    begin = channel.properties.get("wf_start_time", None)
    start = 0.0 if begin is None else float(np.datetime64(begin, "us").astype(np.int64)) * 1e-6
    unit = unit_in(channel.properties)
    found = as_array(name, channel, unit=unit, rate_hz=rate_hz)
    return found and replace(found, start_s=start + told.get("wf_start_offset", 0.0))


@contextmanager
def read_universal(path: str) -> Iterator[Holding]:
    """Give what a universal file holds: its functions of time, with unit and spacing.

    One that was cut off exactly between two data sets holds fewer channels: nothing in it says how
    many there were. A reference that was learned from more of them says which are missing.

    Raises
    ------
    ValueError
        If the file is damaged.
    """
    import pyuff

    text = Path(path).read_bytes()
    marks = [mark.end() for mark in _SET_MARK.finditer(text)]
    if len(marks) % 2 or not all(_SET_TYPE.match(text, begin) for begin in marks[::2]):
        raise ValueError("a data set has no type at its beginning, or no end")
    file = pyuff.UFF(path)
    types = [int(kind) for kind in file.get_set_types()]
    sets = [file.read_sets(k) for k, kind in enumerate(types) if kind == _FUNCTION_SET]
    arrays: list[Array] = []
    others = [f"a data set of type {kind}" for kind in types if kind != _FUNCTION_SET]
    for number, one in enumerate(sets, 1):
        general = one["func_type"] == _GENERAL and one["abscissa_spec_data_type"] == _TIME_AXIS
        over_time = general or one["func_type"] == _TIME_RESPONSE
        if over_time and (array := _function(number, one, arrays)):
            arrays.append(array)
        else:
            others.append(f"a function of type {one.get('func_type')}")
    yield Holding(arrays=tuple(arrays), together=True, left_out=tuple(others))


def _function(number: int, one: dict[str, Any], taken: Sequence[Array]) -> Array | None:
    samples = np.asarray(one["data"]).reshape(-1)
    step, told = float(one["abscissa_inc"]), one["num_pts"]
    if len(samples) != told:
        raise ValueError(f"function {number}: {len(samples)} samples where {told} are announced")
    if not (one["abscissa_spacing"] and step > 0):
        raise ValueError(f"function {number} is not evenly spaced, or by {step:g} s")
    name, unit = _place(number, one, taken), plain_text(one["ordinate_axis_units_lab"]) or None
    # single precision spacing: seven digits are told, no more
    return as_array(name, samples, unit=unit, rate_hz=float(f"{1.0 / step:.13g}"))


def _place(number: int, one: dict[str, Any], taken: Sequence[Array]) -> str:
    """Return a name that says where the signal was taken, as far as the file tells."""
    way = int(one["rsp_dir"])
    direction = "+-"[way < 0] + _AXES[abs(way)] if 0 < abs(way) < len(_AXES) else ""
    node = str(one["rsp_node"]) if one["rsp_node"] else ""
    name = " ".join(filter(None, (plain_text(one["rsp_ent_name"]), node, direction)))
    name = name or plain_text(one["id1"]) or f"function {number}"
    return name if all(own.name != name for own in taken) else f"{name} ({number})"


@contextmanager
def read_flac(path: str) -> Iterator[Holding]:
    """Give what a FLAC file holds: one array, its sampling rate, no unit."""
    import soundfile

    with soundfile.SoundFile(path) as file:

        def read(start: int, stop: int) -> FloatArray:
            file.seek(start)
            return np.asarray(file.read(stop - start, dtype="float64", always_2d=True)).T

        array = Array(
            name="",
            names=("",) * file.channels,
            count=int(file.frames),
            read=read,
            rate_hz=float(file.samplerate),
        )
        note = (
            f"{file.subtype.replace('PCM_', '')}-bit integer, full scale is taken as 1; a FLAC "
            "file tells no unit: state unit and sensitivity in a [[sensor]] of the machine file"
        )
        yield Holding(arrays=(array,), together=True, notes=(note,))
