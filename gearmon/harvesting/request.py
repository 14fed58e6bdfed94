"""The harvester file: which harvester may be tuned, and what it is to power (TOML).

    kind = "cantilever"           # or "inertial"
    wiring = "series"             # "unimorph", "series" or "parallel"
    piezo = "PZT-5A"              # PZT-5A, PZT-5H, PVDF, AlN
    passive = "brass"             # steel, brass, aluminium
    length_mm = 15.0
    width_mm = 10.0
    passive_thickness_mm = 0.2
    piezo_thickness_mm = 0.2
    most_tip_mass_g = 20.0
    tip_gyration_mm = 5.0         # of the tip mass about the end of the beam; 0 for a point
    damping_ratio = 0.01
    clearance_mm = 2.0

    [budget]                      # all optional, see `SensorBudget`
    duration_s = 10.0

An inertial one has mass_g, damping_ratio, clearance_mm, lowest_hz and highest_hz.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar, cast

from gearmon.errors import ArgumentError, nearest_name
from gearmon.harvesting.budget import SensorBudget
from gearmon.harvesting.cantilever import PiezoCantilever, Wiring
from gearmon.harvesting.inertial import InertialHarvester
from gearmon.harvesting.materials import (
    BEAM_MATERIALS,
    PIEZO_MATERIALS,
    beam_material,
    piezo_material,
)
from gearmon.harvesting.modal_damping import ModalDamping
from gearmon.machine.fields import Choice, Count, FieldError, Number, check_fields, obeys
from gearmon.machine.source import MachineSource, read_source

T = TypeVar("T")

_DAMPING = Number(low=1e-4, high=0.5, why="mechanical damping ratio of the first mode")


def _millimetres(high: float, why: str) -> Number:
    return Number(low=0, high=high, unit="mm", open_low=True, why=why)


@dataclass(frozen=True, kw_only=True)
class CantileverTable:
    """Keys of a file with ``kind = "cantilever"``; defaults are the built-in harvester."""

    wiring: str = field(
        default="series", metadata=obeys(Choice(options=("unimorph", "series", "parallel")))
    )
    piezo: str = field(default="PZT-5A", metadata=obeys(Choice(options=tuple(PIEZO_MATERIALS))))
    passive: str = field(default="brass", metadata=obeys(Choice(options=tuple(BEAM_MATERIALS))))
    length_mm: float = field(default=15.0, metadata=obeys(_millimetres(1000, "free length")))
    width_mm: float = field(default=10.0, metadata=obeys(_millimetres(1000, "width")))
    passive_thickness_mm: float = field(
        default=0.2, metadata=obeys(_millimetres(50, "of the passive layer"))
    )
    piezo_thickness_mm: float = field(
        default=0.2, metadata=obeys(_millimetres(50, "of each piezoelectric layer"))
    )
    most_tip_mass_g: float = field(
        default=20.0, metadata=obeys(Number(low=0, high=1e5, unit="g", why="largest tip mass"))
    )
    tip_gyration_mm: float = field(
        default=0.0,
        metadata=obeys(
            Number(low=0, high=1000, unit="mm", why="radius of gyration of the tip mass")
        ),
    )
    damping_ratio: float = field(default=0.01, metadata=obeys(_DAMPING))
    clearance_mm: float = field(
        default=2.0, metadata=obeys(_millimetres(1000, "room of the tip to either side"))
    )

    def __post_init__(self) -> None:
        check_fields(self)

    def harvester(self) -> PiezoCantilever:
        """Return the beam, without tip mass."""
        return PiezoCantilever(
            wiring=cast("Wiring", self.wiring),
            piezo=piezo_material(self.piezo),
            passive=beam_material(self.passive),
            length_m=self.length_mm * 1e-3,
            width_m=self.width_mm * 1e-3,
            passive_thickness_m=self.passive_thickness_mm * 1e-3,
            piezo_thickness_m=self.piezo_thickness_mm * 1e-3,
            most_tip_mass_kg=self.most_tip_mass_g * 1e-3,
            tip_gyration_m=self.tip_gyration_mm * 1e-3,
            damping=ModalDamping(constant=self.damping_ratio),
            clearance_m=self.clearance_mm * 1e-3,
        )


@dataclass(frozen=True, kw_only=True)
class InertialTable:
    """Keys of a file with ``kind = "inertial"``."""

    mass_g: float = field(
        default=5.0, metadata=obeys(Number(low=0, high=1e6, unit="g", open_low=True))
    )
    damping_ratio: float = field(default=0.01, metadata=obeys(_DAMPING))
    clearance_mm: float = field(
        default=2.0, metadata=obeys(_millimetres(1000, "room of the mass to either side"))
    )
    lowest_hz: float = field(
        default=5.0, metadata=obeys(Number(low=0, high=1e6, unit="Hz", open_low=True))
    )
    highest_hz: float = field(
        default=5000.0, metadata=obeys(Number(low=0, high=1e6, unit="Hz", open_low=True))
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.highest_hz <= self.lowest_hz:
            raise FieldError("highest_hz", f"must be above lowest_hz = {self.lowest_hz:g}")

    def harvester(self) -> InertialHarvester:
        """Return the mass on its spring, tuned to the middle of its range."""
        return InertialHarvester(
            mass_kg=self.mass_g * 1e-3,
            natural_frequency_hz=math.sqrt(self.lowest_hz * self.highest_hz),
            mechanical_damping_ratio=self.damping_ratio,
            electrical_damping_ratio=self.damping_ratio,
            clearance_m=self.clearance_mm * 1e-3,
            lowest_hz=self.lowest_hz,
            highest_hz=self.highest_hz,
        )


@dataclass(frozen=True, kw_only=True)
class _BudgetTable:
    duration_s: float = field(
        default=10.0, metadata=obeys(Number(low=0, high=1e6, unit="s", open_low=True))
    )
    sampling_rate_hz: float = field(
        default=10_000.0, metadata=obeys(Number(low=0, high=1e7, unit="Hz", open_low=True))
    )
    bits: int = field(default=12, metadata=obeys(Count(low=1, high=64)))
    recording_power_w: float = field(
        default=3e-3, metadata=obeys(Number(low=0, high=1e3, unit="W"))
    )
    energy_per_bit_j: float = field(default=100e-9, metadata=obeys(Number(low=0, high=1, unit="J")))
    sleep_power_w: float = field(default=5e-6, metadata=obeys(Number(low=0, high=1e3, unit="W")))
    efficiency: float = field(
        default=0.7, metadata=obeys(Number(low=0, high=1, open_low=True, why="of the electronics"))
    )

    def __post_init__(self) -> None:
        check_fields(self)


_KINDS: dict[str, type[CantileverTable] | type[InertialTable]] = {
    "cantilever": CantileverTable,
    "inertial": InertialTable,
}


def built_in() -> tuple[PiezoCantilever, SensorBudget]:
    """Return the harvester and budget that are taken if no file is given.

    A bimorph of PZT-5A on brass, 15 x 10 x 0.6 mm, in series: 70 Hz with 20 g at the tip, 1.2 kHz
    bare.
    """
    return CantileverTable().harvester(), SensorBudget()


def load_harvester(path: str | Path) -> tuple[PiezoCantilever | InertialHarvester, SensorBudget]:
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
    if kind not in _KINDS:
        raise source.error("kind", f'kind = {kind!r} must be "cantilever" or "inertial"')
    budget = document.pop("budget", {})
    table = _filled(source, _KINDS[kind], document, "")
    if not isinstance(budget, dict):
        raise source.error("budget", "budget must be a table, written [budget]")
    values = _filled(source, _BudgetTable, budget, "budget.")
    try:
        harvester = table.harvester()
    except ArgumentError as error:
        raise source.error("kind", str(error)) from None
    return harvester, SensorBudget(**{f.name: getattr(values, f.name) for f in fields(values)})


def _filled(source: MachineSource, home: type[T], table: dict[str, Any], prefix: str) -> T:
    """Build a table's object; the first wrong key is named with its line."""
    known = [f.name for f in fields(cast("Any", home))]
    for key in table:
        if key not in known:
            near = nearest_name(key, known)
            hint = f"; did you mean {near}?" if near else f"; known: {', '.join(known)}"
            raise source.error(prefix + key, f"{prefix}{key} is not a key of a harvester{hint}")
    try:
        return home(**table)
    except FieldError as error:
        raise source.error(prefix + error.key, error.message(prefix + error.key)) from None
