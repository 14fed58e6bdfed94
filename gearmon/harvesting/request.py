"""What is asked for: which harvester may be tuned and what it is to power, by its file (TOML).

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
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar, cast, get_args

from gearmon.errors import ArgumentError, nearest_name
from gearmon.harvesting.cantilever import (
    BEAM_MATERIALS,
    PIEZO_MATERIALS,
    ModalDamping,
    PiezoCantilever,
    Wiring,
)
from gearmon.harvesting.inertial import InertialHarvester
from gearmon.machine.fields import Choice, Count, FieldError, Number, check_fields, obeys
from gearmon.machine.source import MachineSource, read_source

T = TypeVar("T")


def _number(default: float, high: float, unit: str = "", why: str = "") -> Any:
    """Return a field from 0 on."""
    return field(default=default, metadata=obeys(Number(low=0, high=high, unit=unit, why=why)))


def _above_zero(default: float, high: float, unit: str = "", why: str = "") -> Any:
    rule = Number(low=0, high=high, unit=unit, why=why, open_low=True)
    return field(default=default, metadata=obeys(rule))


_DAMPING: Any = field(
    default=0.01,
    metadata=obeys(Number(low=1e-4, high=0.5, why="mechanical damping ratio of the first mode")),
)


@dataclass(frozen=True, kw_only=True)
class SensorBudget:
    """Energy that one recording takes, from sampling to sending it.

    The defaults are round figures of a battery-free node with a low-power radio: 12 bit at 10 kHz
    for 10 s, a front end and processor of 3 mW while they record, 100 nJ for each bit sent (radio
    and protocol), 5 uW asleep, and a rectifier with store that passes 70 %.

    Parameters
    ----------
    duration_s, sampling_rate_hz : float, > 0
        Of one recording.
    bits : int, 1 to 64
        Of a sample.
    recording_power_w : float, >= 0
        While it records [W].
    energy_per_bit_j : float, >= 0
        To send a bit [J].
    sleep_power_w : float, >= 0
        All the time [W].
    efficiency : float, > 0 and <= 1
        Of rectifier, converter and store together.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    duration_s: float = _above_zero(10.0, 1e6, "s")
    sampling_rate_hz: float = _above_zero(10_000.0, 1e7, "Hz")
    bits: int = field(default=12, metadata=obeys(Count(low=1, high=64)))
    recording_power_w: float = _number(3e-3, 1e3, "W")
    energy_per_bit_j: float = _number(100e-9, 1, "J")
    sleep_power_w: float = _number(5e-6, 1e3, "W")
    efficiency: float = _above_zero(0.7, 1, why="of the electronics")

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def energy_j(self) -> float:
        """Of one recording, made and sent [J]."""
        sent = self.duration_s * self.sampling_rate_hz * self.bits * self.energy_per_bit_j
        return self.duration_s * self.recording_power_w + sent

    def interval_s(self, power_w: float) -> float:
        """Time between recordings that a mean harvested power allows [s]; infinite if none.

        Parameters
        ----------
        power_w : float, >= 0
            Electrical, before the rectifier.
        """
        left = self.efficiency * power_w - self.sleep_power_w
        return max(self.duration_s, self.energy_j / left) if left > 0 else math.inf

    def to_dict(self) -> dict[str, Any]:
        """Return all values, and the energy of a recording, in built-in types."""
        return asdict(self) | {"energy_per_recording_j": self.energy_j}


@dataclass(frozen=True, kw_only=True)
class CantileverTable:
    """Keys of a file with ``kind = "cantilever"``; defaults are the built-in harvester."""

    wiring: str = field(default="series", metadata=obeys(Choice(options=get_args(Wiring))))
    piezo: str = field(default="PZT-5A", metadata=obeys(Choice(options=tuple(PIEZO_MATERIALS))))
    passive: str = field(default="brass", metadata=obeys(Choice(options=tuple(BEAM_MATERIALS))))
    length_mm: float = _above_zero(15.0, 1000, "mm", "free length")
    width_mm: float = _above_zero(10.0, 1000, "mm", "width")
    passive_thickness_mm: float = _above_zero(0.2, 50, "mm", "of the passive layer")
    piezo_thickness_mm: float = _above_zero(0.2, 50, "mm", "of each piezoelectric layer")
    most_tip_mass_g: float = _number(20.0, 1e5, "g", "largest tip mass")
    tip_gyration_mm: float = _number(0.0, 1000, "mm", "radius of gyration of the tip mass")
    damping_ratio: float = _DAMPING
    clearance_mm: float = _above_zero(2.0, 1000, "mm", "room of the tip to either side")

    def __post_init__(self) -> None:
        check_fields(self)

    def harvester(self) -> PiezoCantilever:
        """Return the beam, without tip mass."""
        return PiezoCantilever(
            wiring=cast("Wiring", self.wiring),
            piezo=PIEZO_MATERIALS[self.piezo],
            passive=BEAM_MATERIALS[self.passive],
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

    mass_g: float = _above_zero(5.0, 1e6, "g")
    damping_ratio: float = _DAMPING
    clearance_mm: float = _above_zero(2.0, 1000, "mm", "room of the mass to either side")
    lowest_hz: float = _above_zero(5.0, 1e6, "Hz")
    highest_hz: float = _above_zero(5000.0, 1e6, "Hz")

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
    task = _filled(source, SensorBudget, budget, "budget.")
    try:
        harvester = table.harvester()
    except ArgumentError as error:
        raise source.error("kind", str(error)) from None
    return harvester, task


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
