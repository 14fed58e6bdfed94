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

An inertial one has mass_g, damping_ratio, clearance_mm, restitution, tilt_deg, lowest_hz,
highest_hz and, as its load, electrical_damping_ratio; one with a coil has load_ohm instead, and
turns, field_length_tm (B l of a turn), coil_ohm and coil_mh.

From the harvester to the sensor (`SensorBudget`):

rectifier   a bridge passes current only while the voltage at the load exceeds its drop D: of the
            power under a sine of amplitude V it passes 1 - 2/pi (asin k + k sqrt(1 - k^2)) with
            k = D/V, none below (the mean of |v| (|v| - D) over that of v^2)
regulator   one that tracks the maximum power point presents the best load and takes what it
            needs itself; without one the store holds the voltage, and a source whose open
            voltage is twice that at its best gives 4 x (1 - x) of its best at the share x
store       leaks at its voltage, and must once be charged from nothing: only when the rectified
            voltage reaches what the regulator starts at
part        loses with temperature, and with every tenfold of its age
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.harvesting.cantilever import BEAM_MATERIALS, PIEZO_MATERIALS, PiezoCantilever, known
from gearmon.harvesting.harvester import FREQUENCY, CoilHarvester, Harvester, InertialHarvester
from gearmon.harvesting.response import Tuned
from gearmon.machine.fields import Checked, Choice, Count, FieldError, Number, held, within
from gearmon.machine.reading import read_part, read_source, read_table, refuse_unknown_keys

GRAVITY_MS2 = 9.81
#: Degrees Celsius at which parts are measured, and the age from which tenfolds count [years].
REFERENCE_C, FIRST_YEARS = 20.0, 1.0 / 365.0
#: Units of keys that are a thousandth of those that a harvester takes.
_THOUSANDTHS = {"mm": "m", "g": "kg", "mh": "henry"}
#: What the words of a file stand for, by key.
_WORDS: dict[str, dict[str, Any]] = {
    "piezo": PIEZO_MATERIALS,
    "passive": BEAM_MATERIALS,
    "tip_block_material": BEAM_MATERIALS,
    "air": {"included": False, "added": True},
}
_KINDS = {own.kind: own for own in (PiezoCantilever, InertialHarvester, CoilHarvester)}


@dataclass(frozen=True, kw_only=True)
class SensorBudget(Checked):
    """Energy that one recording takes, from sampling to sending it, and what is lost on the way.

    The defaults are round figures of a battery-free node with a low-power radio: 12 bit at 10 kHz
    for 10 s, a front end and processor of 3 mW while they record, 100 nJ for each bit sent (radio
    and protocol), 5 uW asleep, a converter that passes 70 % at microwatts: replace them by those of
    the parts chosen. Two Schottky diodes of a bridge take 0.6 V: at most 0.24 V each at 0.1 mA and
    0.32 V at 1 mA (BAT54, alike in the data sheets of its makers). What else depends on the parts
    counts as nothing until it is given.

    Parameters
    ----------
    duration_s, sampling_rate_hz : float, > 0
        Of one recording.
    bits : int, 1 to 64
        Of a sample.
    recording_power_w, sleep_power_w : float, >= 0
        While it records; all the time [W].
    energy_per_bit_j : float, >= 0
        To send a bit [J].
    efficiency : float, > 0 and <= 1
        Share of the power that the converter passes.
    rectifier_drop_v : float, >= 0
        Of all diodes in series [V].
    regulator : {"tracking", "none"}
        Whether the maximum power point is tracked.
    quiescent_power_w : float, >= 0
        What the regulator takes [W].
    store_f, store_v : float, > 0
        Capacitance and voltage of the store [F], [V].
    leakage_a : float, >= 0
        Of the store [A].
    cold_start_v : float, >= 0
        Rectified voltage at which the regulator starts from nothing [V].
    temperature_c : float, -60 to 200
    loss_per_k : float, 0 to 0.05
        Share of the power that is lost for each degree from 20 degrees C.
    years, loss_per_decade : float, >= 0
        Age, and share of the power that is lost with each tenfold of it from the first day on.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    duration_s: float = within(0, 1e6, "s", open_low=True, default=10.0)
    sampling_rate_hz: float = within(0, 1e7, "Hz", open_low=True, default=10_000.0)
    bits: int = held(Count(low=1, high=64), 12)
    recording_power_w: float = within(0, 1e3, "W", default=3e-3)
    energy_per_bit_j: float = within(0, 1, "J", default=100e-9)
    sleep_power_w: float = within(0, 1e3, "W", default=5e-6)
    efficiency: float = within(0, 1, open_low=True, default=0.7)
    rectifier_drop_v: float = within(0, 100, "V", default=0.6)
    regulator: str = held(Choice(options=("tracking", "none")), "tracking")
    quiescent_power_w: float = within(0, 1e3, "W", default=0.0)
    store_f: float = within(0, 1e4, "F", open_low=True, default=1e-3)
    store_v: float = within(0, 1e3, "V", open_low=True, default=3.0)
    leakage_a: float = within(0, 1, "A", default=0.0)
    cold_start_v: float = within(0, 1e3, "V", default=0.0)
    temperature_c: float = within(-60, 200, "degrees C", default=REFERENCE_C)
    loss_per_k: float = within(0, 0.05, "1/K", default=0.0)
    years: float = within(0, 100, "years", default=0.0)
    loss_per_decade: float = within(0, 0.5, default=0.0)

    @property
    def energy_j(self) -> float:
        """Of one recording, made and sent [J]."""
        sent = self.duration_s * self.sampling_rate_hz * self.bits * self.energy_per_bit_j
        return self.duration_s * self.recording_power_w + sent

    @property
    def constant_power_w(self) -> float:
        """What is taken all the time: sleep, regulator and leakage [W]."""
        return self.sleep_power_w + self.quiescent_power_w + self.leakage_a * self.store_v

    @property
    def kept_share(self) -> float:
        """What temperature and age leave of the power."""
        decades = math.log10(max(self.years / FIRST_YEARS, 1.0))
        warm = 1 - self.loss_per_k * abs(self.temperature_c - REFERENCE_C)
        return max(0.0, warm * (1 - self.loss_per_decade * decades))

    def interval_s(self, power_w: float) -> float:
        """Time between recordings that a mean rectified power allows [s]; infinite if none.

        Parameters
        ----------
        power_w : float, >= 0
            Electrical, behind the rectifier.
        """
        left = self.efficiency * power_w - self.constant_power_w
        return max(self.duration_s, self.energy_j / left) if left > 0 else math.inf

    def rectified_w(self, power_w: npt.ArrayLike, load_ohm: float) -> npt.NDArray[np.float64]:
        """Power behind rectifier (and store, without a regulator) of sines of several powers [W].

        Parameters
        ----------
        power_w : array, >= 0
            In the load.
        load_ohm : float
            NaN where there is no circuit: then nothing is lost here.
        """
        power = self.kept_share * np.asarray(power_w, dtype=np.float64)
        if math.isnan(load_ohm):
            return power
        amplitude = np.maximum(np.sqrt(2 * power * load_ohm), 1e-300)
        if self.regulator == "none":
            held = self.store_v + self.rectifier_drop_v
            share = np.minimum(held / (2 * amplitude), 1.0)
            return np.asarray(power * 4 * share * (1 - share) * self.store_v / held)
        dead = np.minimum(self.rectifier_drop_v / amplitude, 1.0)
        lost = np.arcsin(dead) + dead * np.sqrt(1 - dead**2)
        return np.asarray(power * (1 - 2 / math.pi * lost))

    def supply(
        self, tuned: Tuned[Any], steps_w: Sequence[npt.NDArray[np.float64]]
    ) -> dict[str, Any]:
        """Follow the power of a tuned harvester over a duty cycle to the sensor.

        Parameters
        ----------
        tuned : Tuned
        steps_w : sequence of ndarray, shape (n,)
            Steps of the power at every operating point [W], the duty cycle's own or others.

        Returns
        -------
        dict
            harvested_w, rectified_w, regulated_w, constant_w, left_w, interval_s (None if
            infinite), starts (whether the cold start is reached) and charging_s (of the empty
            store; None if never).
        """
        load, shares = tuned.harvester.resistance_ohm, [point.share for point in tuned.duty]
        rectified = float(np.dot(shares, [self.rectified_w(own, load).mean() for own in steps_w]))
        volts = math.sqrt(2 * self.kept_share * max(float(own.max()) for own in steps_w) * load)
        starts = not volts - self.rectifier_drop_v < self.cold_start_v
        interval = self.interval_s(rectified) if starts else math.inf
        regulated = self.efficiency * rectified
        left = regulated - self.constant_power_w
        spare = left + self.sleep_power_w
        charging = 0.5 * self.store_f * self.store_v**2 / spare if starts and spare > 0 else None
        return {
            "harvested_w": float(np.dot(shares, [own.mean() for own in steps_w])),
            "rectified_w": rectified,
            "regulated_w": regulated,
            "constant_w": self.constant_power_w,
            "left_w": left,
            "interval_s": interval if math.isfinite(interval) else None,
            "starts": starts,
            "charging_s": charging,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return all values, and the energy of a recording, in built-in types."""
        return asdict(self) | {"energy_per_recording_j": self.energy_j}


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
    kind = source.document.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise source.error("kind", f'kind = {kind!r} must be "cantilever" or "inertial" or "coil"')
    document = {key: own for key, own in source.document.items() if key not in ("kind", "budget")}
    keys = (*known()[kind], _KINDS[kind].load_name)
    refuse_unknown_keys(source, document, keys, "", homes={})
    try:
        harvester = _built(kind, document)
    except FieldError as error:
        key = next((key for key in keys if _in_si(key)[0] == error.key), error.key)
        said = FieldError(key, error.reason, document.get(key, error.value)).message(key)
        raise source.error(key, said) from None
    except ArgumentError as error:
        raise source.error("kind", str(error)) from None
    return harvester, read_part(source, SensorBudget, "budget", read_table(source, "budget"))


def _built(kind: str, given: dict[str, Any]) -> Harvester:
    """Build a harvester from the keys of its file; what is left out has its default."""
    table = known()[kind] | given
    for key, options in _WORDS.items():
        if key in table:
            table[key] = options[Choice(options=tuple(options)).checked(key, table[key])]
    tilt = Number(low=0, high=90, unit="degrees").checked("tilt_deg", table.pop("tilt_deg"))
    values = dict(_in_si(key, value) for key, value in table.items())
    values["weight_ms2"] = GRAVITY_MS2 * math.cos(math.radians(tilt))
    values["load_kept"] = _KINDS[kind].load_name in values
    if kind == "cantilever":
        values["in_air"] = values.pop("air")
        values["tip_block_density_kg_m3"] = values.pop("tip_block_material").density_kg_m3
    else:
        ends = [FREQUENCY.checked(key, values[key]) for key in ("lowest_hz", "highest_hz")]
        values["natural_frequency_hz"] = math.sqrt(math.prod(ends))
    return _KINDS[kind](**values)


def _in_si(key: str, value: Any = 0.0) -> tuple[str, Any]:
    """Return the field of a harvester that a key stands for, and its value there."""
    name, _, unit = key.rpartition("_")
    if unit in _THOUSANDTHS:
        # the range is that of the field itself
        any_number = Number(low=-math.inf, high=math.inf)
        return f"{name}_{_THOUSANDTHS[unit]}", 1e-3 * any_number.checked(key, value)
    return {"damping_ratio": "mechanical_damping_ratio"}.get(key, key), value
