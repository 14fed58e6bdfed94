"""TDMS files (LabVIEW): waveform channels with their unit and spacing, read in blocks."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.arrays import Array, Holding, load_library, reading
from gearmon.signals.reading.rounding import Floats

WHAT = "a TDMS file (LabVIEW)"
EXTRA = "tdms"
_FEWEST_SAMPLES = 2


def read_tdms(path: str) -> Holding:
    """Return what a TDMS file holds: its channels, with unit and sampling rate where stated.

    Raises
    ------
    RecordingError
        If npTDMS is not installed, the file is damaged, or its last part is incomplete.
    """
    library = load_library("nptdms", EXTRA, path, WHAT)
    stream = open(path, "rb")  # noqa: SIM115 - here, as the library leaves a damaged file open
    try:
        with reading(path, WHAT), _quiet():
            file = library.TdmsFile.open(stream)
            return _held(path, file, stream.close)
    except BaseException:
        stream.close()
        raise


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the library from writing its remarks on damaged files to the terminal."""
    logger = logging.getLogger("nptdms")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


def _held(path: str, file: Any, close: Callable[[], object]) -> Holding:
    status = file.file_status
    if status.incomplete_final_segment:
        raise RecordingError(
            f"{path}: is cut off: its last part is incomplete (was the recorder switched off while "
            "it wrote?); copy it again, or open and save it in its own program"
        )
    channels = [channel for group in file.groups() for channel in group.channels()]
    often = Counter(channel.name for channel in channels)
    arrays, others = [], []
    for channel in channels:
        name = channel.name
        shown = name if often[name] == 1 else f"{channel.group_name}/{name}"
        numeric = channel.dtype is not None and np.dtype(channel.dtype).kind in "fiu"
        if numeric and len(channel) >= _FEWEST_SAMPLES:
            arrays.append(_array(shown, channel))
        else:
            others.append(shown)
    facts = _numbers(file.properties)
    for group in file.groups():
        facts |= {f"{group.name}.{key}": v for key, v in _numbers(group.properties).items()}
    return Holding(
        path=path,
        what=WHAT,
        arrays=tuple(arrays),
        together=True,
        facts=facts,
        left_out=tuple(others),
        close=close,
    )


def _array(name: str, channel: Any) -> Array:
    def read(start: int, stop: int) -> Floats:
        part = channel.read_data(offset=start, length=stop - start)
        return np.asarray(part, dtype=np.float64).reshape(1, -1)

    step = _number(channel.properties.get("wf_increment"))
    # LabVIEW's frequency spectra are waveforms as well; only those over time are signals
    over = str(channel.properties.get("wf_xname", "Time") or "Time").strip().lower()
    timed = step is not None and step > 0 and over in ("time", "zeit")
    unit = str(channel.properties.get("unit_string", "") or "").strip()
    return Array(
        name=name,
        names=(name,),
        count=len(channel),
        read=read,
        units=(unit or None,),
        rate_hz=float(f"{1.0 / step:.13g}") if step and timed else None,
        start_s=_start(channel.properties),
    )


def _start(properties: Any) -> float | None:
    offset = _number(properties.get("wf_start_offset")) or 0.0
    begin = properties.get("wf_start_time")
    if begin is None:
        return offset
    return float(np.datetime64(begin, "us").astype(np.int64)) * 1e-6 + offset


def _numbers(properties: Any) -> dict[str, float]:
    found = {key: _number(value) for key, value in properties.items()}
    return {key: value for key, value in found.items() if value is not None}


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float | np.number) else None
