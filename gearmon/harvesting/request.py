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
    restitution = 0.5             # speed behind a blow at the stop over that before: a guess
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
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

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
#: Units of keys that are a thousandth of those that a harvester takes.
_THOUSANDTHS = {"mm": "m", "g": "kg", "mh": "henry"}


def _up_to(high: float, unit: str = "", why: str = "", *, zero: bool = False) -> Number:
    return Number(low=0, high=high, unit=unit, why=why, open_low=not zero)


#: Keys of each kind with their defaults (None: not set) and rules.
_Keys = dict[str, tuple[Any, Rule]]
_SHARED: _Keys = {
    "damping_ratio": (0.01, Number(low=1e-4, high=0.5, why="mechanical, of the first mode")),
    "clearance_mm": (2.0, _up_to(1000, "mm", "room to either side")),
    "restitution": (0.5, _up_to(1, zero=True)),
    "tilt_deg": (0.0, Number(low=0, high=90, unit="degrees")),
}
_SPRING: _Keys = {
    "mass_g": (5.0, _up_to(1e6, "g")),
    "lowest_hz": (5.0, _up_to(1e6, "Hz")),
    "highest_hz": (5000.0, _up_to(1e6, "Hz")),
    **_SHARED,
}
_LOAD: _Keys = {"load_ohm": (None, _up_to(1e12, "ohm"))}
_KEYS: dict[str, _Keys] = {
    "cantilever": {
        "wiring": ("series", Choice(options=get_args(Wiring))),
        "piezo": ("PZT-5A", Choice(options=tuple(PIEZO_MATERIALS))),
        "passive": ("brass", Choice(options=tuple(BEAM_MATERIALS))),
        "length_mm": (15.0, _up_to(1000, "mm", "free length")),
        "width_mm": (10.0, _up_to(1000, "mm", "width")),
        "passive_thickness_mm": (0.2, _up_to(50, "mm", "of the passive layer")),
        "piezo_thickness_mm": (0.2, _up_to(50, "mm", "of each piezoelectric layer")),
        "most_tip_mass_g": (20.0, _up_to(1e5, "g", "largest tip mass", zero=True)),
        "tip_gyration_mm": (0.0, _up_to(1000, "mm", "of the tip mass", zero=True)),
        "tip_block_height_mm": (None, _up_to(1000, "mm")),
        "tip_block_material": ("steel", Choice(options=tuple(BEAM_MATERIALS))),
        "air": ("included", Choice(options=("included", "added"))),
        **_LOAD,
        **_SHARED,
    },
    "inertial": _SPRING,
    "coil": {
        "turns": (1000.0, _up_to(1e7)),
        "field_length_tm": (5e-3, _up_to(1e3, "T m")),
        "coil_ohm": (100.0, _up_to(1e9, "ohm")),
        "coil_mh": (0.0, _up_to(1e6, "mH", zero=True)),
        **_LOAD,
        **_SPRING,
    },
}


def built_in() -> tuple[Harvester, SensorBudget]:
    """Return the harvester and budget that are taken if no file is given.

    A bimorph of PZT-5A on brass, 15 x 10 x 0.6 mm, in series, its motion up and down: 70 Hz with
    20 g at the tip, 1.2 kHz bare.
    """
    return _built("cantilever", {}), SensorBudget()


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


def _built(kind: str, table: dict[str, Any]) -> Harvester:
    """Build a harvester from the keys of its file; what is left out has its default."""
    values: dict[str, Any] = {}
    for key, (default, rule) in _KEYS[kind].items():
        if (value := table.get(key, default)) is not None:
            name, _, unit = key.rpartition("_")
            checked: Any = rule.checked(key, value)
            if unit in _THOUSANDTHS:
                values[f"{name}_{_THOUSANDTHS[unit]}"] = 1e-3 * checked
            else:
                values[key] = checked
    values["weight_ms2"] = GRAVITY_MS2 * math.cos(math.radians(values.pop("tilt_deg")))
    values |= {"load_kept": True} if "load_ohm" in values else {}
    damping = values.pop("damping_ratio")
    if kind == "cantilever":
        return _cantilever(ModalDamping(constant=damping), **values)
    if values["highest_hz"] <= values["lowest_hz"]:
        raise FieldError("highest_hz", f"must be above lowest_hz = {values['lowest_hz']:g}")
    values["natural_frequency_hz"] = math.sqrt(values["lowest_hz"] * values["highest_hz"])
    build = InertialHarvester if kind == "inertial" else CoilHarvester
    return build(mechanical_damping_ratio=damping, **values)


def _cantilever(
    damping: ModalDamping,
    piezo: str,
    passive: str,
    air: str,
    tip_block_material: str,
    tip_block_height_m: float | None = None,
    **values: Any,
) -> PiezoCantilever:
    block = None
    if tip_block_height_m is not None:
        density = BEAM_MATERIALS[tip_block_material].density_kg_m3
        block = TipBlock(density_kg_m3=density, height_m=tip_block_height_m)
    return PiezoCantilever(
        damping=damping,
        piezo=PIEZO_MATERIALS[piezo],
        passive=BEAM_MATERIALS[passive],
        in_air=air == "added",
        tip_block=block,
        **values,
    )


def _told(
    source: MachineSource,
    prefix: str,
    known: list[str],
    table: dict[str, Any],
    build: Callable[[], Any],
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
