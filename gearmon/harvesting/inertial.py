"""A single mass on a spring whose motion is damped by a generator: in general, and with a coil.

    m z'' + 2 m (zm + ze) wn z' + m wn^2 z = -m a(t),   P = 2 m ze wn <z'^2>

with zm the mechanical and ze the electrical damping ratio. For a = A cos(wt), r = w/wn:

    P = m ze A^2 r^2 / (wn [(1 - r^2)^2 + (2 (zm + ze) r)^2])   (electrical, mean)

At r = 1, ze = zm this is m A^2/(16 zm wn), the most that any load takes. Valid for a generator
that acts as a viscous damper, as a coil does below the corner of its inductance. Williams and
Yates, Sensors and Actuators A 52 (1996) 8-11; Roundy, J. Intell. Mater. Syst. Struct. 16 (2005)
809-823.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.harvesting.harvester import OneLoad, Oscillator

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class _MassOnSpring(OneLoad, ABC):
    """What harvesters with a stiff mass share; the electrical side is theirs."""

    mass_kg: float
    natural_frequency_hz: float
    mechanical_damping_ratio: float = 0.01
    lowest_hz: float = 5.0
    highest_hz: float = 20_000.0

    def __post_init__(self) -> None:
        super().__post_init__()
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

    @property
    def damping_ratio(self) -> float:
        """Mechanical damping ratio."""
        return self.mechanical_damping_ratio

    @property
    def frequency_range_hz(self) -> tuple[float, float]:
        """Natural frequencies that the spring may be built for [Hz]."""
        return self.lowest_hz, self.highest_hz

    @property
    def stress_limit_pa(self) -> float:
        """Infinite: the spring is not modelled."""
        return math.inf

    @property
    def stiffness_n_per_m(self) -> float:
        """Spring stiffness m wn^2 [N/m]."""
        return self.mass_kg * self._natural**2

    def retuned(self: M, frequency_hz: float) -> M:
        """Return the same mass on a spring for another natural frequency [Hz].

        Raises
        ------
        ArgumentError
            If it lies outside `frequency_range_hz`.
        """
        return replace(self, natural_frequency_hz=float(frequency_hz))

    def with_damping_ratio(self: M, ratio: float) -> M:
        """Return the same with another mechanical damping ratio."""
        return replace(self, mechanical_damping_ratio=float(ratio))

    def root_power(self, loads: Real, frequency_hz: Real) -> Complex:
        """Root of the power per unit acceleration [W^(1/2)/(m/s2)], shape (loads, n)."""
        return np.asarray(self.transfer(loads, frequency_hz)[0])

    def transfer(self, loads: Real, frequency_hz: Real) -> Complex:
        """Answers per unit acceleration of the base, shape (4, loads, n), see `OUTPUTS`."""
        rate = 2j * math.pi * frequency_hz
        damper, worth = self._electrical(loads[:, None], np.asarray(rate))
        heat = 2 * self.mechanical_damping_ratio * self._natural
        travel = -1 / (self._natural**2 + rate**2 + (heat + damper) * rate)
        nothing = np.zeros_like(travel)
        return np.array([worth * rate * travel, travel, nothing, nothing])

    def power_bound_w(self) -> float:
        """m/(16 zm wn): matched load at resonance [W/(m/s2)^2]."""
        return self.mass_kg / (16 * self.mechanical_damping_ratio * self._natural)

    def to_dict(self) -> dict[str, Any]:
        """Return the values in built-in types; no clearance is null."""
        kind = type(self).__name__.removesuffix("Harvester").lower()
        values = asdict(self) | {"kind": kind, "stiffness_n_per_m": self.stiffness_n_per_m}
        return values | {"clearance_m": None if math.isinf(self.clearance_m) else self.clearance_m}

    @property
    def _natural(self) -> float:
        return 2 * math.pi * self.natural_frequency_hz

    @abstractmethod
    def _electrical(self, loads: Real, rate: Complex) -> tuple[Any, Any]:
        """Damping over mass [1/s] and root of power over velocity [W^(1/2)/(m/s)]."""


M = TypeVar("M", bound=_MassOnSpring)


@dataclass(frozen=True, kw_only=True)
class InertialHarvester(_MassOnSpring):
    """A mass on a spring with mechanical and electrical damping.

    Parameters
    ----------
    mass_kg : float, > 0
    natural_frequency_hz : float, > 0
        Of mass and spring.
    mechanical_damping_ratio : float, > 0 and < 1
        What is lost to heat.
    electrical_damping_ratio : float, >= 0 and <= 10
        What the load takes.
    lowest_hz, highest_hz : float, > 0
        Natural frequencies that the spring may be built for.
    clearance_m, weight_ms2, restitution, load_kept
        See `OneLoad`.

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

    electrical_damping_ratio: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range("electrical_damping_ratio", self.electrical_damping_ratio, 0.0, 10.0)

    @property
    def load(self) -> float:
        """Electrical damping ratio."""
        return self.electrical_damping_ratio

    @property
    def load_ohm(self) -> float:
        """NaN: there is no circuit."""
        return math.nan

    @property
    def usual_loads(self) -> tuple[float, float]:
        """Electrical damping ratios worth trying: from a hundredth of the mechanical one to 3."""
        return self.mechanical_damping_ratio / 100, 3.0

    def with_load(self, load: float) -> InertialHarvester:
        """Return the same with another electrical damping ratio."""
        return replace(self, electrical_damping_ratio=float(load))

    def single_mode(self) -> Oscillator:
        """Mass, spring and damper; what stands for a voltage is the velocity."""
        damper = 2 * self.electrical_damping_ratio * self._natural
        return Oscillator(
            natural_rad_s=self._natural,
            damping_ratio=self.mechanical_damping_ratio,
            push=1.0,
            back=damper,
            drive=1.0,
            store=0.0,
            leak=1.0,
            worth=self.mass_kg * damper,
        )

    def _electrical(self, loads: Real, rate: Complex) -> tuple[Any, Any]:  # noqa: ARG002
        damper = 2 * loads * self._natural
        return damper, np.sqrt(self.mass_kg * damper)


@dataclass(frozen=True, kw_only=True)
class CoilHarvester(_MassOnSpring):
    """A magnet on a spring that moves through a coil.

        m z'' + c z' + k z + theta i = -m a(t),     L i' + (R_coil + R) i = theta z'

    Parameters
    ----------
    mass_kg, natural_frequency_hz, mechanical_damping_ratio, lowest_hz, highest_hz
        As of an `InertialHarvester`.
    turns : float, > 0
    field_length_tm : float, > 0
        Flux density across the wire times the length of a turn in it, B l [T m]; theta is this
        times the turns [N/A = V s/m].
    coil_ohm : float, > 0
    coil_henry : float, >= 0
        [H].
    load_ohm : float, > 0
    clearance_m, weight_ms2, restitution, load_kept
        See `OneLoad`.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    turns: float
    field_length_tm: float
    coil_ohm: float
    coil_henry: float = 0.0
    load_ohm: float = 100.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("turns", "field_length_tm", "coil_ohm", "load_ohm"):
            check_positive(name, getattr(self, name))
        check_range("coil_henry", self.coil_henry, 0.0, 1e3, "H")

    @property
    def transduction_n_per_a(self) -> float:
        """Turns times B l, theta [N/A]."""
        return self.turns * self.field_length_tm

    @property
    def load(self) -> float:
        """Load resistance [ohm]."""
        return self.load_ohm

    @property
    def usual_loads(self) -> tuple[float, float]:
        """From a hundredth of the coil to a hundred times it with what the motion stands for."""
        motional = self.transduction_n_per_a**2 / (
            2 * self.mass_kg * self.mechanical_damping_ratio * self._natural
        )
        return self.coil_ohm / 100, 100 * (self.coil_ohm + motional)

    def with_load(self, load: float) -> CoilHarvester:
        """Return the same with another load resistance [ohm]."""
        return replace(self, load_ohm=float(load))

    def single_mode(self) -> Oscillator:
        """Mass, spring and coil; what stands for a voltage is the current."""
        return Oscillator(
            natural_rad_s=self._natural,
            damping_ratio=self.mechanical_damping_ratio,
            push=1.0,
            back=self.transduction_n_per_a / self.mass_kg,
            drive=self.transduction_n_per_a,
            store=self.coil_henry,
            leak=self.coil_ohm + self.load_ohm,
            worth=self.load_ohm,
        )

    def _electrical(self, loads: Real, rate: Complex) -> tuple[Any, Any]:
        current = self.transduction_n_per_a / (loads + self.coil_ohm + self.coil_henry * rate)
        damper = self.transduction_n_per_a * current / self.mass_kg
        return damper, current * np.sqrt(loads)
