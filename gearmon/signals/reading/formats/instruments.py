"""Files of measuring programs: TDMS (LabVIEW), read in blocks, and UFF 58, read whole."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.fields import Floats
from gearmon.signals.reading.formats.arrays import Array, Holding, as_array, reading

_FEWEST_SAMPLES = 2
# Of UFF: functions (of time, if the code says so), and directions of a sensor.
_FUNCTION_SETS = (58,)
_GENERAL, _TIME_RESPONSE = 0, 1
_TIME_AXIS = 17
_COMPLEX = (5, 6)
_DIRECTIONS = {
    0: "", 1: "+X", -1: "-X", 2: "+Y", -2: "-Y", 3: "+Z", -3: "-Z",
    4: "+RX", -4: "-RX", 5: "+RY", -5: "-RY", 6: "+RZ", -6: "-RZ",
}  # fmt: skip


def read_tdms(path: str, what: str) -> Holding:
    """Return what a TDMS file holds: its channels, with unit and sampling rate where stated.

    Raises
    ------
    RecordingError
        If the file is damaged, or its last part is incomplete.
    """
    import nptdms

    stream = open(path, "rb")  # noqa: SIM115 - here, as the library leaves a damaged file open
    try:
        with reading(path, what), _quiet():
            file = nptdms.TdmsFile.open(stream)
            return _held(path, what, file, stream.close)
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


def _held(path: str, what: str, file: Any, close: Callable[[], object]) -> Holding:
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
        what=what,
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


def read_universal(path: str, what: str) -> Holding:
    """Return what a universal file holds: its functions of time, with unit and spacing.

    Raises
    ------
    RecordingError
        If the file is damaged.
    """
    import pyuff

    with reading(path, what):
        file = pyuff.UFF(path)
        types = [int(kind) for kind in file.get_set_types()]
        sets = [file.read_sets(k) for k, kind in enumerate(types) if kind in _FUNCTION_SETS]
        arrays: list[Array] = []
        others = [f"a data set of type {kind}" for kind in types if kind not in _FUNCTION_SETS]
        taken: set[str] = set()
        for number, one in enumerate(sets, 1):
            if _is_signal(one):
                arrays.extend(_functions(path, number, one, taken))
            else:
                others.append(f"a function of type {one.get('func_type')}")
    return Holding(
        path=path, what=what, arrays=tuple(arrays), together=True, left_out=tuple(others)
    )


def _is_signal(one: dict[str, Any]) -> bool:
    over_time = one["func_type"] == _TIME_RESPONSE or (
        one["func_type"] == _GENERAL and one["abscissa_spec_data_type"] == _TIME_AXIS
    )
    return over_time and one["ord_data_type"] not in _COMPLEX


def _functions(path: str, number: int, one: dict[str, Any], taken: set[str]) -> list[Array]:
    samples = np.asarray(one["data"], dtype=np.float64).reshape(-1)
    if len(samples) != one["num_pts"]:
        raise RecordingError(
            f"{path}: function {number} has {len(samples)} samples where its header announces "
            f"{one['num_pts']}; copy the file again"
        )
    name = _place(number, one, taken)
    unit = _label(one["ordinate_axis_units_lab"])
    if one["abscissa_spacing"]:
        step = float(one["abscissa_inc"])
        if not step > 0:
            raise RecordingError(f"{path}: function {number} has a spacing of {step:g} s")
        # single precision spacing: seven digits are told, no more
        rate = float(f"{1.0 / step:.13g}")
        found = [as_array(name, samples, unit=unit, rate_hz=rate)]
    else:
        times = np.asarray(one["x"], dtype=np.float64).reshape(-1)
        found = [
            as_array(f"time of {name}", times, unit=_label(one["abscissa_axis_units_lab"]) or "s"),
            as_array(name, samples, unit=unit),
        ]
    return [array for array in found if array is not None]


def _place(number: int, one: dict[str, Any], taken: set[str]) -> str:
    """Return a name that says where the signal was taken, as far as the file tells."""
    direction = _DIRECTIONS.get(int(one["rsp_dir"]), "")
    entity = _label(one["rsp_ent_name"]) or ""
    node = str(one["rsp_node"]) if one["rsp_node"] else ""
    name = " ".join(part for part in (entity, node, direction) if part)
    name = name or _label(one["id1"]) or f"function {number}"
    name = name if name not in taken else f"{name} ({number})"
    taken.add(name)
    return name


def _label(text: Any) -> str | None:
    stripped = str(text or "").strip()
    return stripped if stripped and stripped.upper() != "NONE" else None
