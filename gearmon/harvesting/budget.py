"""From the harvester to the sensor: what is left behind rectifier, regulator and store.

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
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.harvesting.power import Tuned
from gearmon.machine.fields import Choice, Count, Number, check_fields, obeys

#: Degrees Celsius at which parts are measured, and the age from which tenfolds count [years].
REFERENCE_C, FIRST_YEARS = 20.0, 1.0 / 365.0


def _number(default: float, high: float, unit: str = "", *, zero: bool = True) -> Any:
    """Return a field from 0 on, or above it."""
    rule = Number(low=0, high=high, unit=unit, open_low=not zero)
    return field(default=default, metadata=obeys(rule))


@dataclass(frozen=True, kw_only=True)
class SensorBudget:
    """Energy that one recording takes, from sampling to sending it, and what is lost on the way.

    The defaults are round figures of a battery-free node with a low-power radio: 12 bit at 10 kHz
    for 10 s, a front end and processor of 3 mW while they record, 100 nJ for each bit sent (radio
    and protocol), 5 uW asleep, a converter that passes 70 % at microwatts: replace them by those of
    the parts chosen. Two Schottky diodes of a bridge take 0.6 V: at most 0.24 V each at 0.1 mA and
    0.32 V at 1 mA (BAT54, data sheet). What else depends on the parts counts as nothing until it is
    given.

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
        Of the converter, as a share.
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

    duration_s: float = _number(10.0, 1e6, "s", zero=False)
    sampling_rate_hz: float = _number(10_000.0, 1e7, "Hz", zero=False)
    bits: int = field(default=12, metadata=obeys(Count(low=1, high=64)))
    recording_power_w: float = _number(3e-3, 1e3, "W")
    energy_per_bit_j: float = _number(100e-9, 1, "J")
    sleep_power_w: float = _number(5e-6, 1e3, "W")
    efficiency: float = _number(0.7, 1, zero=False)
    rectifier_drop_v: float = _number(0.6, 100, "V")
    regulator: str = field(default="tracking", metadata=obeys(Choice(options=("tracking", "none"))))
    quiescent_power_w: float = _number(0.0, 1e3, "W")
    store_f: float = _number(1e-3, 1e4, "F", zero=False)
    store_v: float = _number(3.0, 1e3, "V", zero=False)
    leakage_a: float = _number(0.0, 1, "A")
    cold_start_v: float = _number(0.0, 1e3, "V")
    temperature_c: float = field(
        default=REFERENCE_C, metadata=obeys(Number(low=-60, high=200, unit="degrees C"))
    )
    loss_per_k: float = _number(0.0, 0.05, "1/K")
    years: float = _number(0.0, 100, "years")
    loss_per_decade: float = _number(0.0, 0.5)

    def __post_init__(self) -> None:
        check_fields(self)

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

    def supply(self, tuned: Tuned[Any], shares: Sequence[float]) -> dict[str, Any]:
        """Follow the power of a tuned harvester over a duty cycle to the sensor.

        Parameters
        ----------
        tuned : Tuned
        shares : sequence of float
            Share of time of each operating point.

        Returns
        -------
        dict
            harvested_w, rectified_w, regulated_w, constant_w, left_w, interval_s (None if
            infinite), starts (whether the cold start is reached) and charging_s (of the empty
            store; None if never).
        """
        load = tuned.harvester.load_ohm
        steps = [
            np.array([a.power_w]) if a.response is None else a.response.power_steps_w
            for a in tuned.answers
        ]
        rectified = math.fsum(
            share * float(self.rectified_w(step, load).mean())
            for share, step in zip(shares, steps, strict=True)
        )
        volts = max(math.sqrt(2 * self.kept_share * float(s.max()) * load) for s in steps)
        starts = not volts - self.rectifier_drop_v < self.cold_start_v
        interval = self.interval_s(rectified) if starts else math.inf
        regulated = self.efficiency * rectified
        spare = regulated - self.quiescent_power_w - self.leakage_a * self.store_v
        charging = 0.5 * self.store_f * self.store_v**2 / spare if starts and spare > 0 else None
        return {
            "harvested_w": tuned.power_w,
            "rectified_w": rectified,
            "regulated_w": regulated,
            "constant_w": self.constant_power_w,
            "left_w": regulated - self.constant_power_w,
            "interval_s": interval if math.isfinite(interval) else None,
            "starts": starts,
            "charging_s": charging,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return all values, and the energy of a recording, in built-in types."""
        return asdict(self) | {"energy_per_recording_j": self.energy_j}
