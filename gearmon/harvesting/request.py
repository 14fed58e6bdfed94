"""What is asked for: which harvester may be tuned and what it is to power, by its file (TOML).

    kind = "cantilever"           # or "inertial", "coil"
    wiring = "series"             # "unimorph", "series" or "parallel"
    piezo = "PZT-5A"              # PZT-5A, PZT-5H, PVDF, AlN
    passive = "brass"             # steel, brass, aluminium
    length_mm = 15.0
    width_mm = 10.0
    passive_thickness_mm = 0.2
    piezo_thickness_mm = 0.2
    most_tip_mass_g = 20.0
    tip_gyration_mm = 5.0         # of the tip mass about the end of the beam; 0 for a point
    tip_block_height_mm = 4.0     # instead: a block as wide as the beam, longer the heavier it is
    tip_block_material = "steel"
    damping_ratio = 0.01
    air = "included"              # in the damping ratio, or "added" to it
    clearance_mm = 2.0
    restitution = 0.5             # speed behind a blow at the stop over that before
    tilt_deg = 0.0                # of the motion against the plumb line: 90 for a level motion
    load_ohm = 1e5                # only if the load is given: else it is tuned

    [budget]                      # all optional, see `SensorBudget`
    duration_s = 10.0

An inertial one has mass_g, damping_ratio, clearance_mm, restitution, tilt_deg, lowest_hz and
highest_hz; one with a coil also turns, field_length_tm (B l of a turn), coil_ohm and coil_mh.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path
from typing import Any, cast, get_args

from gearmon.errors import ArgumentError, nearest_name
from gearmon.harvesting.budget import SensorBudget
from gearmon.harvesting.cantilever import (
    BEAM_MATERIALS,
    PIEZO_MATERIALS,
    ModalDamping,
    PiezoCantilever,
    TipBlock,
    Wiring,
)
from gearmon.harvesting.harvester import Harvester
from gearmon.harvesting.inertial import CoilHarvester, InertialHarvester
from gearmon.machine.fields import Choice, FieldError, Number, Rule
from gearmon.machine.source import MachineSource, read_source

GRAVITY_MS2 = 9.81

Convert = Callable[[Any], Any]


@dataclass(frozen=True)
class _Key:
    """A key of a file: the field it sets, its default (None: not set), rule and conversion."""

    name: str
    default: Any
    rule: Rule
    convert: Convert = lambda value: value


def _up_to(high: float, unit: str = "", why: str = "", *, zero: bool = False) -> Number:
    return Number(low=0, high=high, unit=unit, why=why, open_low=not zero)


def _milli(value: float) -> float:
    return value * 1e-3


def _weight(tilt_deg: float) -> float:
    return GRAVITY_MS2 * math.cos(math.radians(tilt_deg))


_DAMPING = Number(low=1e-4, high=0.5, why="mechanical damping ratio of the first mode")
_SHARED = {
    "clearance_mm": _Key("clearance_m", 2.0, _up_to(1000, "mm", "room to either side"), _milli),
    "restitution": _Key("restitution", 0.5, _up_to(1, zero=True)),
    "tilt_deg": _Key("weight_ms2", 0.0, Number(low=0, high=90, unit="degrees"), _weight),
}
_SPRING = {
    "mass_g": _Key("mass_kg", 5.0, _up_to(1e6, "g"), _milli),
    "damping_ratio": _Key("mechanical_damping_ratio", 0.01, _DAMPING),
    "lowest_hz": _Key("lowest_hz", 5.0, _up_to(1e6, "Hz")),
    "highest_hz": _Key("highest_hz", 5000.0, _up_to(1e6, "Hz")),
    **_SHARED,
}
_LOAD = _Key("load_ohm", None, _up_to(1e12, "ohm"))
_KEYS: dict[str, dict[str, _Key]] = {
    "cantilever": {
        "wiring": _Key("wiring", "series", Choice(options=get_args(Wiring))),
        "piezo": _Key(
            "piezo", "PZT-5A", Choice(options=tuple(PIEZO_MATERIALS)), PIEZO_MATERIALS.get
        ),
        "passive": _Key(
            "passive", "brass", Choice(options=tuple(BEAM_MATERIALS)), BEAM_MATERIALS.get
        ),
        "length_mm": _Key("length_m", 15.0, _up_to(1000, "mm", "free length"), _milli),
        "width_mm": _Key("width_m", 10.0, _up_to(1000, "mm", "width"), _milli),
        "passive_thickness_mm": _Key(
            "passive_thickness_m", 0.2, _up_to(50, "mm", "of the passive layer"), _milli
        ),
        "piezo_thickness_mm": _Key(
            "piezo_thickness_m", 0.2, _up_to(50, "mm", "of each piezoelectric layer"), _milli
        ),
        "most_tip_mass_g": _Key(
            "most_tip_mass_kg", 20.0, _up_to(1e5, "g", "largest tip mass", zero=True), _milli
        ),
        "tip_gyration_mm": _Key(
            "tip_gyration_m", 0.0, _up_to(1000, "mm", "of the tip mass", zero=True), _milli
        ),
        "tip_block_height_mm": _Key("height_m", None, _up_to(1000, "mm"), _milli),
        "tip_block_material": _Key("block", "steel", Choice(options=tuple(BEAM_MATERIALS))),
        "damping_ratio": _Key(
            "damping", 0.01, _DAMPING, lambda ratio: ModalDamping(constant=ratio)
        ),
        "air": _Key("in_air", "included", Choice(options=("included", "added")), "added".__eq__),
        "load_ohm": _LOAD,
        **_SHARED,
    },
    "inertial": _SPRING,
    "coil": {
        "turns": _Key("turns", 1000.0, _up_to(1e7)),
        "field_length_tm": _Key("field_length_tm", 5e-3, _up_to(1e3, "T m")),
        "coil_ohm": _Key("coil_ohm", 100.0, _up_to(1e9, "ohm")),
        "coil_mh": _Key("coil_henry", 0.0, _up_to(1e6, "mH", zero=True), _milli),
        "load_ohm": _LOAD,
        **_SPRING,
    },
}


def built_in() -> tuple[PiezoCantilever, SensorBudget]:
    """Return the harvester and budget that are taken if no file is given.

    A bimorph of PZT-5A on brass, 15 x 10 x 0.6 mm, in series, its motion up and down: 70 Hz with
    20 g at the tip, 1.2 kHz bare.
    """
    return cast("PiezoCantilever", _built("cantilever", {})), SensorBudget()


def load_harvester(path: str | Path) -> tuple[Harvester, SensorBudget]:
    """Read a harvester file.

    Parameters
    ----------
    path : str or Path
        TOML as shown in the docstring of this module.

    Returns
    -------
    harvester, budget

    Raises
    ------
    MachineFileError
        If the file cannot be read, or a key is unknown or out of its range; with file and line.
    """
    source = read_source(path)
    document = dict(source.document)
    kind = document.pop("kind", None)
    if not isinstance(kind, str) or kind not in _KEYS:
        raise source.error("kind", f'kind = {kind!r} must be "cantilever" or "inertial" or "coil"')
    budget = document.pop("budget", {})
    if not isinstance(budget, dict):
        raise source.error("budget", "budget must be a table, written [budget]")
    harvester = _told(source, "", list(_KEYS[kind]), document, lambda: _built(kind, document))
    known = [f.name for f in fields(SensorBudget)]
    return harvester, _told(source, "budget.", known, budget, lambda: SensorBudget(**budget))


def published_harvesters() -> list[dict[str, Any]]:
    """Return harvesters from the literature, to compare one's own with.

    Returns
    -------
    list of dict
        name, source, and what was measured with it in SI units; "harvester" where its dimensions
        are published in full, else None.
    """
    source = read_source(str(files("gearmon.harvesting").joinpath("published.toml")))
    rows = []
    for table in source.document["harvester"]:
        row = {key: value for key, value in table.items() if key != "model"}
        model = dict(table.get("model", {}))
        kind = model.pop("kind", None)
        rows.append(row | {"harvester": _built(kind, model) if kind else None})
    return rows


def _built(kind: str, table: dict[str, Any]) -> Harvester:
    """Build a harvester from the keys of its file; what is left out has its default."""
    values = {}
    for name, key in _KEYS[kind].items():
        value = table.get(name, key.default)
        if value is not None:
            values[key.name] = key.convert(key.rule.checked(name, value))
    if kind != "cantilever" and values["highest_hz"] <= values["lowest_hz"]:
        raise FieldError("highest_hz", f"must be above lowest_hz = {values['lowest_hz']:g}")
    values |= {"load_kept": True} if "load_ohm" in values else {}
    if kind == "cantilever":
        density = BEAM_MATERIALS[values.pop("block")].density_kg_m3
        if "height_m" in values:
            height = values.pop("height_m")
            values["tip_block"] = TipBlock(density_kg_m3=density, height_m=height)
        return PiezoCantilever(**values)
    values["natural_frequency_hz"] = math.sqrt(values["lowest_hz"] * values["highest_hz"])
    return InertialHarvester(**values) if kind == "inertial" else CoilHarvester(**values)


def _told(
    source: MachineSource, prefix: str, known: list[str], table: dict[str, Any], build: Any
) -> Any:
    """Build what a table says; the first wrong key is named with its line."""
    for key in table:
        if key not in known:
            near = nearest_name(key, known)
            hint = f"; did you mean {near}?" if near else f"; known: {', '.join(known)}"
            raise source.error(prefix + key, f"{prefix}{key} is not a key of a harvester{hint}")
    try:
        return build()
    except FieldError as error:
        raise source.error(prefix + error.key, error.message(prefix + error.key)) from None
    except ArgumentError as error:
        raise source.error("kind", str(error)) from None
