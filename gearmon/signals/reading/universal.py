"""Universal files: data sets of type 58 that hold functions of time."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearmon.errors import RecordingError
from gearmon.signals.reading.arrays import Array, Holding, as_array, load_library, reading

WHAT = "a universal file (UFF)"
EXTRA = "uff"
_FUNCTION_SETS = (58,)
_GENERAL, _TIME_RESPONSE = 0, 1
_TIME_AXIS = 17
_COMPLEX = (5, 6)
_DIRECTIONS = {
    0: "", 1: "+X", -1: "-X", 2: "+Y", -2: "-Y", 3: "+Z", -3: "-Z",
    4: "+RX", -4: "-RX", 5: "+RY", -5: "-RY", 6: "+RZ", -6: "-RZ",
}  # fmt: skip


def read_universal(path: str) -> Holding:
    """Return what a universal file holds: its functions of time, with unit and spacing.

    Raises
    ------
    RecordingError
        If pyuff is not installed, or the file is damaged.
    """
    pyuff = load_library("pyuff", EXTRA, path, WHAT)
    with reading(path, WHAT):
        file = pyuff.UFF(path)
        types = [int(kind) for kind in file.get_set_types()]
        sets = [file.read_sets(k) for k, kind in enumerate(types) if kind in _FUNCTION_SETS]
        arrays: list[Array] = []
        others = [f"a data set of type {kind}" for kind in types if kind not in _FUNCTION_SETS]
        taken: set[str] = set()
        for number, one in enumerate(sets, 1):
            if _is_signal(one):
                arrays.extend(_arrays(path, number, one, taken))
            else:
                others.append(f"a function of type {one.get('func_type')}")
    return Holding(
        path=path, what=WHAT, arrays=tuple(arrays), together=True, left_out=tuple(others)
    )


def _is_signal(one: dict[str, Any]) -> bool:
    over_time = one["func_type"] == _TIME_RESPONSE or (
        one["func_type"] == _GENERAL and one["abscissa_spec_data_type"] == _TIME_AXIS
    )
    return over_time and one["ord_data_type"] not in _COMPLEX


def _arrays(path: str, number: int, one: dict[str, Any], taken: set[str]) -> list[Array]:
    samples = np.asarray(one["data"], dtype=np.float64).reshape(-1)
    if len(samples) != one["num_pts"]:
        raise RecordingError(
            f"{path}: function {number} has {len(samples)} samples where its header announces "
            f"{one['num_pts']}; copy the file again"
        )
    name = _name(number, one, taken)
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


def _name(number: int, one: dict[str, Any], taken: set[str]) -> str:
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
