"""What a harvested power will run: recordings sent by radio, and how often."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from gearmon.errors import ArgumentError, check_positive, check_range


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

    duration_s: float = 10.0
    sampling_rate_hz: float = 10_000.0
    bits: int = 12
    recording_power_w: float = 3e-3
    energy_per_bit_j: float = 100e-9
    sleep_power_w: float = 5e-6
    efficiency: float = 0.7

    def __post_init__(self) -> None:
        check_positive("duration_s", self.duration_s, "s")
        check_positive("sampling_rate_hz", self.sampling_rate_hz, "Hz")
        check_range("bits", self.bits, 1, 64)
        check_range("recording_power_w", self.recording_power_w, 0.0, 1e3, "W")
        check_range("energy_per_bit_j", self.energy_per_bit_j, 0.0, 1.0, "J")
        check_range("sleep_power_w", self.sleep_power_w, 0.0, 1e3, "W")
        if not 0 < self.efficiency <= 1:
            raise ArgumentError(f"efficiency={self.efficiency} must lie in (0, 1]")

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

    def power_for_w(self, interval_s: float) -> float:
        """Mean harvested power that a recording every so often takes [W]."""
        check_positive("interval_s", interval_s, "s")
        return (self.energy_j / interval_s + self.sleep_power_w) / self.efficiency

    def to_dict(self) -> dict[str, Any]:
        """Return all values, and the energy of a recording, in built-in types."""
        return {
            "duration_s": self.duration_s,
            "sampling_rate_hz": self.sampling_rate_hz,
            "bits": self.bits,
            "recording_power_w": self.recording_power_w,
            "energy_per_bit_j": self.energy_per_bit_j,
            "sleep_power_w": self.sleep_power_w,
            "efficiency": self.efficiency,
            "energy_per_recording_j": self.energy_j,
        }
