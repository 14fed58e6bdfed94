"""Kinds of files: told by their first bytes, never by their names; one table of all at the end.

A loader gives a `Holding` while its file is open: arrays that may be signals, read in blocks, and
the facts beside them. its `table` picks the arrays that are the recording. WAV, NumPy's files
(npy, npz) and MATLAB's up to version 7 need no further library; HDF5 (MATLAB 7.3 among them),
Parquet, TDMS (LabVIEW), UFF 58 and FLAC one each, an extra of gearmon.

WAV files may be plain RIFF, RF64 or BW64 (beyond 4 GiB), integers of 8, 16, 24 and 32 bits, floats
of 32 and 64 bits, plain or with an extended format. Their chunks must fill the file: libraries give
a shorter recording where the header announces more samples than there are (soundfile), or take half
a minute over 8 MB behind a header that was never completed (SciPy 1.17).

MATLAB files are read by SciPy, first in a process of its own that has as much memory as a file of
that size may take: SciPy 1.17 crashed on 6 of 1,400 that were changed at random. HDF5 likewise.

References
----------
EBU Tech 3306, "MBWF / RF64: an extended file format for audio", 2009; Microsoft, "Multiple channel
audio data and WAVE files", 2007.
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
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import GearmonError, RecordingError
from gearmon.files import archive_swells, most_unpacked
from gearmon.signals.reading.arrays import Array, Holding, floats, numbers_in, plain_text, unit_in
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.columns import Table, shortened
from gearmon.signals.reading.text import Source, open_source, read_table

# Kinds of files that are read, for messages.
_READ = "text, WAV, FLAC, npy, npz, MATLAB, HDF5, TDMS, UFF 58, Parquet"
_NO_UNIT = "tells no unit: state unit and sensitivity in a [[sensor]] of the machine file"
_FLOATS, _EXTENSIBLE = 3, 0xFFFE
_UNKNOWN_SIZE = 0xFFFFFFFF
# Format and bits of a sample -> its type; three bytes are taken as the upper ones of four, so that
# sign and full scale come out right.
_WAV_SAMPLES = {(1, 8): "<u1", (1, 16): "<i2", (1, 24): "<i4", (1, 32): "<i4"}
_WAV_SAMPLES |= {(_FLOATS, 32): "<f4", (_FLOATS, 64): "<f8"}
_CONTROL = bytes(set(range(32)) - set(b"\t\n\v\f\r\x1a\x1b")) + b"\x7f"
_BLANK = b"\x00 \t\r\n\xef\xbb\xbf\xff\xfe"
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


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Parameters
    ----------
    what : str
        What it is, for messages.
    magic : bytes
        Regular expression of how it begins.
    loader : callable or None
        Yields once what it holds, and closes it behind that; None if it is not read.
    extra : str
        The extra of gearmon that installs the library that the loader needs.
    remedy : str
        What to do if it is not read.
    """

    what: str
    magic: bytes
    loader: Callable[[str], Iterator[Holding]] | None = None
    extra: str = ""
    remedy: str = "export it as CSV"


def identify(source: Source) -> Format | None:
    """Return what kind of file it is; None for a text.

    Parameters
    ----------
    source : Source
        The file.

    Raises
    ------
    RecordingError
        If the file is empty.
    """
    head = source.head(64 * 1024)
    if not head.strip(_BLANK):
        zeros = " (only zero bytes: was the recorder switched off while it wrote?)"
        of_what = zeros if b"\x00" in head else " (only blanks)" if head else ""
        raise RecordingError(f"{source.path}: is empty{of_what}; nothing to analyse")
    known = next((own for own in _FORMATS if re.match(own.magic, head, re.DOTALL)), None)
    # binary if more than one byte in a hundred of the beginning is no character
    sample = head[:4096]
    controls = len(sample) - len(sample.translate(None, _CONTROL))
    binary = controls > max(2, 0.01 * len(sample)) and source.encoding in ("", "utf-8-sig")
    unknown = Format("a binary file of unknown kind, or UTF-16 without its mark", b"")
    return known or (unknown if binary else None)


def read_file(path: str | Path, wanted: Wanted) -> Table:
    """Return the recording in a file.

    Parameters
    ----------
    path : str or Path
        The file, or a pipe such as ``/dev/stdin``.
    wanted : Wanted
        What the user says.

    Raises
    ------
    RecordingError
        If there is no such file or it holds no recording, its kind is not read or its library is
        not installed, or it is packed, comes through a pipe or is damaged.
    """
    source = open_source(path)
    found = identify(source)
    if found is None:
        return read_table(source, wanted)
    if found.loader is None:
        raise RecordingError(
            f"{source.path}: looks like {found.what}, which is not read here; {found.remedy} "
            f"(read are: {_READ}; text plain or gzip)"
        )
    if source.zipped or source.content is not None:
        pipe = "cannot be read through a pipe; give the file itself"
        how = "packed with gzip; unpack it first" if source.zipped else pipe
        raise RecordingError(f"{source.path}: {found.what} {how}")
    try:
        with warnings.catch_warnings(), contextmanager(found.loader)(source.path) as loaded:
            warnings.simplefilter("ignore")  # a library's remarks on a file that it can read
            holding = replace(loaded, path=source.path, what=found.what, size=source.size())
            return holding.table(wanted)
    except GearmonError:
        raise
    # what a library raises about a damaged file is anything but documented
    except Exception as error:
        first = next(iter(str(error).splitlines()), "") or type(error).__name__
        why = f" and cannot be read as such ({shortened(first)}); is it damaged? Copy it again"
        if isinstance(error, ImportError):
            why = f"; to read it install gearmon[{found.extra}], or export it as CSV"
        raise RecordingError(f"{source.path}: looks like {found.what}{why}") from None


def _read_wav(path: str) -> Iterator[Holding]:
    """Give what a WAV file holds: one array, its sampling rate, no unit.

    Raises
    ------
    RecordingError
        If the header is damaged, the samples are compressed, or fewer are there than announced.
    """
    chunks = _wav_chunks(np.memmap(path, np.uint8, "r"))
    form, data = bytes(chunks[b"fmt "]), chunks[b"data"]
    if len(form) < 16:
        raise ValueError("it does not say what its samples are")
    tag, channels, rate, a_second, frame, bits = struct.unpack("<HHIIHH", form[:16])
    tag = int.from_bytes(form[24:26], "little") if tag == _EXTENSIBLE else tag
    if (tag, bits) not in _WAV_SAMPLES:
        raise RecordingError(
            f"{path}: a WAV file with {bits}-bit samples of format {tag:#06x}; read are integers "
            "of 8, 16, 24 or 32 bits and floats of 32 or 64: export it as one of these"
        )
    if not channels or not rate or frame != channels * bits // 8 or len(data) % frame:
        raise ValueError(f"{len(data)} bytes, {channels} channels, {bits} bits, {rate} Hz")
    kind = np.dtype(_WAV_SAMPLES[tag, bits])
    full_scale = 1.0 if tag == _FLOATS else 2.0 ** (8 * kind.itemsize - 1)
    frames = data.reshape(-1, channels, bits // 8)

    def read(start: int, stop: int) -> FloatArray:
        part = np.pad(frames[start:stop], ((0, 0), (0, 0), (kind.itemsize - bits // 8, 0)))
        values = part.view(kind)[..., 0].T.astype(np.float64)
        values -= full_scale if kind.kind == "u" else 0.0
        values /= full_scale  # a power of two: exact
        return values

    how = "float" if tag == _FLOATS else "integer"
    # some writers leave out how many bytes a second has; one that contradicts leaves the rate open
    rate_hz = float(rate) if a_second in (0, rate * frame) else None
    array = Array(names=("",) * channels, count=len(frames), read=read, rate_hz=rate_hz)
    yield _sound("WAV", f"{bits}-bit {how}", array)


def _sound(kind: str, samples: str, array: Array) -> Holding:
    """Return what a sound file holds, with a note on what its numbers mean."""
    scale = ", full scale is taken as 1" if samples.endswith("integer") else ""
    note = f"{samples}{scale}; a {kind} file {_NO_UNIT}"
    return Holding(arrays=(array,), together=True, notes=(note,))


def _wav_chunks(raw: Any) -> dict[bytes, Any]:
    """Return the chunks of a WAV file by their names; nothing may lie beside them but zeros."""
    chunks, place = {b"fmt ": raw[:0], b"data": raw[:0]}, 12
    while place < len(raw):
        name, size = bytes(raw[place:][:4]), int.from_bytes(raw[place + 4 :][:4], "little")
        if not any(name) and not raw[place:].any():
            break
        begin, there = place + 8, max(0, len(raw) - place - 8)
        if name == b"data" and b"ds64" in chunks and size == _UNKNOWN_SIZE:
            size = int.from_bytes(chunks[b"ds64"][8:16], "little")
        if name == b"data" and size in (0, _UNKNOWN_SIZE):
            raise ValueError(f"its header was never completed; {there} bytes follow it")
        if size > there or not name.isascii():
            raise ValueError(f"a chunk of {size} bytes where {there} are left")
        chunks[name], place = raw[begin : begin + size], begin + size + size % 2
    return chunks


def _read_mat(path: str) -> Iterator[Holding]:
    """Give what a MATLAB file holds: its arrays and single numbers, those of structs by a dot.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    from scipy.io import loadmat

    load = partial(loadmat, path, simplify_cells=True)
    _try_out(path, load)
    items: dict[str, Any] = {}
    left = [(name, own) for name, own in load().items() if not name.startswith("__")]
    while left:
        name, own = left.pop(0)
        if isinstance(own, dict):
            left = [(f"{name}.{key}", value) for key, value in own.items()] + left
        else:
            items[name] = np.asarray(own)
    yield Holding.of(items)


def _read_npy(path: str) -> Iterator[Holding]:
    """Give what an npy file holds: one array, or one channel for each field of its records.

    Raises
    ------
    ValueError
        If it is damaged or holds Python objects.
    """
    stored = np.load(path, mmap_mode="r", allow_pickle=False)
    if stored.offset + stored.nbytes != os.path.getsize(path):
        raise ValueError("bytes behind its numbers")
    # the fields of records are channels
    items = {name: stored[name] for name in stored.dtype.names or ()} or {"": stored}
    yield replace(Holding.of(items), together=True)


def _read_npz(path: str) -> Iterator[Holding]:
    """Give what an npz file holds: its arrays and single numbers by name.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
        if archive_swells(archive):
            raise ValueError("it unpacks to more than any")
        items: dict[str, Any] = {}
        others: list[str] = []
        for name in archive.files:
            try:
                items[name] = archive[name]
            except ValueError:  # an array of Python objects
                others.append(name)
    yield Holding.of(items, others)


def _try_out(path: str, task: Callable[[], object]) -> None:
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


def _read_hdf5(path: str) -> Iterator[Holding]:
    """Give what an HDF5 file holds: all its arrays and single numbers, by their paths.

    Attributes of an array tell its unit (`units`) and its sampling rate (`fs`, `sampling_rate`
    ...); attributes of the file and of groups count as single numbers.

    Raises
    ------
    ValueError
        If the file is damaged.
    """
    import h5py

    _try_out(path, lambda: _hdf5_arrays(h5py.File(path, "r")))
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
    held = Holding.of(items, others)
    return replace(held, facts=facts | dict(held.facts))


def _read_parquet(path: str) -> Iterator[Holding]:
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
        # pages that do not end where what stands behind them begins: later values are moved
        told = file.metadata
        groups = map(told.row_group, range(told.num_row_groups))
        chunks = [group.column(k) for group in groups for k in range(told.num_columns)]
        begins = (own.dictionary_page_offset or own.data_page_offset for own in chunks)
        ends = [at + own.total_compressed_size for at, own in zip(begins, chunks, strict=True)]
        indexed = any(own.has_offset_index or own.has_column_index for own in chunks)
        end = os.path.getsize(path) - 8 - told.serialized_size
        if ends and not indexed and max(ends) != end:
            raise ValueError(f"the pages of its table end at byte {max(ends)}, not {end}")
        yield _parquet_columns(file)


def _parquet_columns(file: Any) -> Holding:
    from pyarrow import types

    schema, rows = file.schema_arrow, file.metadata.num_rows
    numeric = types.is_integer, types.is_floating, types.is_decimal, types.is_timestamp
    whole = lru_cache(maxsize=1)(lambda name: floats(file.read([name]).column(0).to_pandas()))

    def column(field: Any) -> Array | None:
        def read(start: int, stop: int) -> FloatArray:
            return np.asarray(whole(field.name)[None, start:stop])

        if rows < 2 or not any(is_such(field.type) for is_such in numeric):
            return None
        unit = "ns" if types.is_timestamp(field.type) else unit_in(field.metadata)
        return Array(name=field.name, names=(field.name,), count=rows, read=read, unit=unit)

    told = [(f"{field.name} ({field.type})", column(field)) for field in schema]
    # the row labels of a data frame are no channel
    found = [(name, own) for name, own in told if not (own and name.startswith("__index_level_"))]
    return Holding.of_channels(found, numbers_in(schema.metadata))


def _read_tdms(path: str) -> Iterator[Holding]:
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
        yield Holding.of_channels(found, facts)


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
    found = Array.of(name, channel, unit=unit_in(channel.properties), rate_hz=rate_hz)
    return found and replace(found, start_s=start + told.get("wf_start_offset", 0.0))


def _read_universal(path: str) -> Iterator[Holding]:
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
    # where the signal was taken, as far as the file tells
    way, node = int(one["rsp_dir"]), str(one["rsp_node"]) if one["rsp_node"] else ""
    direction = "+-"[way < 0] + _AXES[abs(way)] if 0 < abs(way) < len(_AXES) else ""
    name = " ".join(filter(None, (plain_text(one["rsp_ent_name"]), node, direction)))
    name = name or plain_text(one["id1"]) or f"function {number}"
    name = name if all(own.name != name for own in taken) else f"{name} ({number})"
    unit = plain_text(one["ordinate_axis_units_lab"]) or None
    # single precision spacing: seven digits are told, no more
    return Array.of(name, samples, unit=unit, rate_hz=float(f"{1.0 / step:.13g}"))


def _read_flac(path: str) -> Iterator[Holding]:
    """Give what a FLAC file holds: one array, its sampling rate, no unit."""
    import soundfile

    with soundfile.SoundFile(path) as file:

        def read(start: int, stop: int) -> FloatArray:
            file.seek(start)
            return np.asarray(file.read(stop - start, dtype="float64", always_2d=True)).T

        names, count, rate_hz = ("",) * file.channels, int(file.frames), float(file.samplerate)
        array = Array(names=names, count=count, read=read, rate_hz=rate_hz)
        yield _sound("FLAC", f"{file.subtype.removeprefix('PCM_')}-bit integer", array)


_BEGIN = rb"(?i:(?:\xef\xbb\xbf)?\s*"
_PACKED = rb"PK[\x03\x05]|BZh|\xfd7zXZ\0|\x28\xb5\x2f\xfd|7z\xbc\xaf|Rar!|\x1f\x8b|.{257}ustar"
_HDF5 = rb"\x89HDF\r\n\x1a\n|MATLAB 7\.3 MAT-file"
_UFF = rb" {4}-1\s*\r?\n {0,4}(?:15|55|58|58b|82|151|164|24\d\d)\s"
_PAGE = "save the file itself, not the page that offers it"
# First match wins.
_FORMATS = (
    Format("a WAV sound file", rb"R(IFF|F64)|BW64", _read_wav),
    Format("a FLAC sound file", rb"fLaC", _read_flac, "flac"),
    Format("a NumPy array (npy)", rb"\x93NUMPY", _read_npy),
    Format("a NumPy archive (npz)", rb"PK\x03\x04.{26}[^\0]*?\.npy", _read_npz),
    Format("a MATLAB file", rb"MATLAB 5\.0 MAT-file", _read_mat),
    Format("an HDF5 or MATLAB 7.3 file", _HDF5, _read_hdf5, "hdf5"),
    Format("an Apache Parquet table", rb"PAR1", _read_parquet, "parquet"),
    Format("a TDMS file (LabVIEW)", rb"TDSm", _read_tdms, "tdms"),
    Format("a universal file (UFF)", _UFF, _read_universal, "uff"),
    Format("an Excel workbook", rb"PK\x03\x04.*(\[Content_Types\]\.xml|xl/)|\xd0\xcf\x11\xe0"),
    Format("an archive or a compressed file", _PACKED, remedy="unpack it first"),
    Format("an Ogg sound file", rb"OggS"),
    Format("an MDF measurement file", rb"MDF "),
    Format("a PDF document", rb"%PDF-"),
    Format("a JSON document", _BEGIN + rb"\{)"),
    Format("a pointer left by Git LFS", rb"version https://git-lfs", remedy="fetch the data"),
    Format("a web page", _BEGIN + rb"<(!doctype )?html)", remedy=_PAGE),
)
