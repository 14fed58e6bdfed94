"""A single mass on a spring whose motion is damped by a generator (Williams and Yates).

    m z'' + 2 m (zm + ze) wn z' + m wn^2 z = -m a(t),   P = 2 m ze wn <z'^2>

with zm the mechanical and ze the electrical damping ratio. For a = A cos(wt), r = w/wn:

    P = m ze A^2 r^2 / (wn [(1 - r^2)^2 + (2 (zm + ze) r)^2])   (electrical, mean)

At r = 1, ze = zm this is m A^2/(16 zm wn), the most that any load takes. Valid for a generator
that acts as a viscous damper (electromagnetic, below the corner of its coil). Williams and Yates,
Sensors and Actuators A 52 (1996) 8-11; Roundy, J. Intell. Mater. Syst. Struct. 16 (2005) 809-823.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.harvesting.power import Gains, OneLoad


@dataclass(frozen=True, kw_only=True)
class InertialHarvester(OneLoad):
    """A mass on a spring with mechanical and electrical damping.

    Parameters
    ----------
    mass_kg : float, > 0
    natural_frequency_hz : float, > 0
        Of mass and spring.
    mechanical_damping_ratio : float, > 0 and < 1
        What is lost to heat.
    electrical_damping_ratio : float, >= 0 and <= 10
        What the load takes; a coil takes ``theta^2/(2 m w_n (R_coil + R_load))``.
    clearance_m : float, > 0
        Room of the mass to either side [m].
    lowest_hz, highest_hz : float, > 0
        Natural frequencies that the spring may be built for.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> h = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=625.0)
    >>> h = h.with_load(h.mechanical_damping_ratio)   # matched
    >>> round(float(h.gains(625.0).power_w[0]) / h.power_bound_w(), 12)
    1.0
    """

    mass_kg: float
    natural_frequency_hz: float
    mechanical_damping_ratio: float = 0.01
    electrical_damping_ratio: float = 0.01
    clearance_m: float = math.inf
    lowest_hz: float = 5.0
    highest_hz: float = 20_000.0

    def __post_init__(self) -> None:
        check_positive("mass_kg", self.mass_kg, "kg")
        check_positive("lowest_hz", self.lowest_hz, "Hz")
        check_positive("highest_hz", self.highest_hz, "Hz")
        if self.highest_hz < self.lowest_hz:
            raise ArgumentError(
                f"highest_hz={self.highest_hz:g} Hz must be >= lowest_hz={self.lowest_hz:g} Hz"
            )
        check_range(
            "natural_frequency_hz", self.natural_frequency_hz, self.lowest_hz, self.highest_hz, "Hz"
        )
        check_range("mechanical_damping_ratio", self.mechanical_damping_ratio, 1e-6, 0.999)
        check_range("electrical_damping_ratio", self.electrical_damping_ratio, 0.0, 10.0)
        if not self.clearance_m > 0:
            raise ArgumentError(f"clearance_m={self.clearance_m} m must be > 0")

    @property
    def resonances_hz(self) -> npt.NDArray[np.float64]:
        """The natural frequency, in a row of one [Hz]."""
        return np.array([self.natural_frequency_hz])

    @property
    def damping_ratio(self) -> float:
        """Mechanical damping ratio."""
        return self.mechanical_damping_ratio

    @property
    def load(self) -> float:
        """Electrical damping ratio."""
        return self.electrical_damping_ratio

    @property
    def load_range(self) -> tuple[float, float]:
        """Electrical damping ratios worth trying: from a hundredth of the mechanical one to 3."""
        return self.mechanical_damping_ratio / 100, 3.0

    @property
    def frequency_range_hz(self) -> tuple[float, float]:
        """Natural frequencies that the spring may be built for [Hz]."""
        return self.lowest_hz, self.highest_hz

    @property
    def travel_limit_m(self) -> float:
        """Clearance [m]."""
        return self.clearance_m

    @property
    def stress_limit_pa(self) -> float:
        """Infinite: the spring is not modelled."""
        return math.inf

    @property
    def stiffness_n_per_m(self) -> float:
        """Spring stiffness m wn^2 [N/m]."""
        return self.mass_kg * (2 * math.pi * self.natural_frequency_hz) ** 2

    def retuned(self, frequency_hz: float) -> InertialHarvester:
        """Return the same mass on a spring for another natural frequency [Hz].

        Raises
        ------
        ArgumentError
            If it lies outside `frequency_range_hz`.
        """
        return replace(self, natural_frequency_hz=float(frequency_hz))

    def with_load(self, load: float) -> InertialHarvester:
        """Return the same with another electrical damping ratio."""
        return replace(self, electrical_damping_ratio=float(load))

    def with_damping_ratio(self, ratio: float) -> InertialHarvester:
        """Return the same with another mechanical damping ratio."""
        return replace(self, mechanical_damping_ratio=float(ratio))

    def gains_by_load(
        self, loads: npt.NDArray[np.float64], frequency_hz: npt.NDArray[np.float64]
    ) -> Gains:
        """Answers at several electrical damping ratios, arrays of shape (loads, n)."""
        total = self.mechanical_damping_ratio + loads[:, None]
        travel = 1 / np.sqrt(self._squared(total, frequency_hz))
        power, nothing = self.power_by_load(loads, frequency_hz), np.zeros_like(travel)
        return Gains(frequency_hz, power, travel, nothing, nothing)

    def power_by_load(
        self, loads: npt.NDArray[np.float64], frequency_hz: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """Power gains at several electrical damping ratios, shape (loads, frequencies)."""
        loads = loads[:, None]
        natural = 2 * math.pi * self.natural_frequency_hz
        ratio = frequency_hz / self.natural_frequency_hz
        squared = self._squared(self.mechanical_damping_ratio + loads, frequency_hz)
        power: npt.NDArray[np.float64] = self.mass_kg * loads * natural**3 * ratio**2 / squared
        return power

    def _squared(
        self, total: float | npt.NDArray[np.float64], frequency_hz: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """|wn^2 - w^2 + 2 i z wn w|^2."""
        ratio = frequency_hz / self.natural_frequency_hz
        natural = 2 * math.pi * self.natural_frequency_hz
        squared = ((1 - ratio**2) ** 2 + (2 * total * ratio) ** 2) * natural**4
        return np.asarray(squared, dtype=np.float64)

    def power_bound_w(self) -> float:
        """m/(16 zm wn): matched load at resonance [W/(m/s2)^2]."""
        natural = 2 * math.pi * self.natural_frequency_hz
        return self.mass_kg / (16 * self.mechanical_damping_ratio * natural)

    def to_dict(self) -> dict[str, Any]:
        """Return the values in built-in types; no clearance is null."""
        values = asdict(self) | {"kind": "inertial", "stiffness_n_per_m": self.stiffness_n_per_m}
        if math.isinf(self.clearance_m):
            values["clearance_m"] = None
        return values
