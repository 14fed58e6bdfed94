"""What a harvester is to the rest of the room: its answers to a shaken base, and what bounds them.

For a motion of the base with the acceleration amplitude A at one frequency, everything follows from
complex answers per unit acceleration. The first is the root of the power, a time function whose
square is the power at every instant: the voltage over the root of the load, or its like where there
is no circuit. So the mean power is half its squared size times A^2 at one frequency, and the mean
square of the filtered recording in general.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_positive, check_range

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Self_ = TypeVar("Self_")

#: Rows of `transfer`: root of the power [W^(1/2)], travel [m], and the stresses of both layers,
#: each over its safe stress and times that of the first [Pa]; zero where they are not modelled.
OUTPUTS = ("root_power", "travel_m", "stress_pa", "other_stress_pa")


@dataclass(frozen=True, eq=False)
class Gains:
    """Answers of a harvester to a unit acceleration amplitude of its base, by frequency.

    Attributes
    ----------
    frequency_hz : ndarray, shape (n,)
    power_w : ndarray, shape (n,)
        Mean electrical power per squared acceleration amplitude [W/(m/s2)^2].
    travel_m : ndarray, shape (n,)
        Amplitude of the moving mass against the base [m/(m/s2)].
    stress_pa : ndarray, shape (n,)
        Amplitude of the largest stress, each part over its safe stress and times that of the
        weakest: zero for harvesters whose spring is not modelled [Pa/(m/s2)].
    voltage_v : ndarray, shape (n,)
        Amplitude of the voltage at the load [V/(m/s2)]; zero where there is no circuit.
    """

    frequency_hz: Real
    power_w: Real
    travel_m: Real
    stress_pa: Real
    voltage_v: Real


@dataclass(frozen=True, kw_only=True)
class Oscillator:
    """One mode and its circuit, with x the travel [m] and the power worth v^2 [W].

    x'' + 2 z w x' + w^2 x + back v = -push a,   store v' + leak v = drive x'.
    """

    natural_rad_s: float
    damping_ratio: float
    push: float
    back: float
    drive: float
    store: float
    leak: float
    worth: float


class Harvester(Protocol):
    """A linear harvester on a moving base."""

    @property
    def natural_frequency_hz(self) -> float:
        """Frequency of the first mode, short-circuited [Hz]."""

    @property
    def damping_ratio(self) -> float:
        """Mechanical damping ratio of the first mode."""

    @property
    def load(self) -> float:
        """Load: resistance [ohm], or electrical damping ratio where there is no circuit."""

    @property
    def load_ohm(self) -> float:
        """Load resistance [ohm]; NaN where there is no circuit."""

    @property
    def load_kept(self) -> bool:
        """Whether the load is given, not tuned."""

    @property
    def load_range(self) -> tuple[float, float]:
        """Loads to tune within, low and high."""

    @property
    def usual_loads(self) -> tuple[float, float]:
        """Loads that may be worth trying, low and high."""

    @property
    def frequency_range_hz(self) -> tuple[float, float]:
        """Natural frequencies that `retuned` can reach [Hz]."""

    @property
    def weight_ms2(self) -> float:
        """Gravity along the motion [m/s2]."""

    @property
    def restitution(self) -> float:
        """Speed after a blow at the end of the clearance over that before."""

    @property
    def clearance_m(self) -> float:
        """Room of the moving mass to either side [m]; infinite if none is given."""

    @property
    def stress_limit_pa(self) -> float:
        """Safe stress of the weakest part [Pa]; infinite where no stress is modelled."""

    def retuned(self: Self_, frequency_hz: float) -> Self_:
        """Return the same harvester with another natural frequency."""

    def with_load(self: Self_, load: float) -> Self_:
        """Return the same harvester with another load."""

    def with_damping_ratio(self: Self_, ratio: float) -> Self_:
        """Return the same harvester with another mechanical damping ratio, of every mode."""

    def root_power(self, loads: Real, frequency_hz: Real) -> Complex:
        """Root of the power per unit acceleration, shape (loads, n)."""

    def transfer(self, loads: Real, frequency_hz: Real) -> Complex:
        """Answers per unit acceleration, shape (4, loads, n), see `OUTPUTS`."""

    def power_bound_w(self) -> float:
        """Mean power per squared acceleration amplitude that nothing exceeds."""

    def single_mode(self) -> Oscillator:
        """First mode with its circuit."""

    def to_dict(self) -> dict[str, Any]:
        """Dimensions and values in built-in types."""

    def power_by_load(self, loads: Real, frequency_hz: Real) -> Real:
        """Mean power per squared acceleration amplitude, shape (loads, frequencies)."""

    def gains(self, frequency_hz: npt.ArrayLike) -> Gains:
        """Answers at these frequencies."""


H = TypeVar("H", bound=Harvester)


@dataclass(frozen=True, kw_only=True)
class OneLoad:
    """What all kinds share: the room about the mass, and what follows from their `transfer`.

    Parameters
    ----------
    clearance_m : float, > 0
        Room of the moving mass to either side [m].
    weight_ms2 : float
        Gravity along the motion: 9.81 m/s2 for a motion up and down.
    restitution : float, 0 to 1
        Speed after a blow at the end of the clearance over that before. It depends on the stop, so
        that it has to be measured; 0.5 is no more than the middle of what is possible.
    load_kept : bool
        Whether the load is given, not tuned.
    """

    clearance_m: float = math.inf
    weight_ms2: float = 0.0
    restitution: float = 0.5
    load_kept: bool = False

    def __post_init__(self) -> None:
        check_range("restitution", self.restitution, 0.0, 1.0)
        check_range("weight_ms2", self.weight_ms2, -1e3, 1e3, "m/s2")
        if not self.clearance_m > 0:
            raise ArgumentError(f"clearance_m={self.clearance_m} m must be > 0")

    @property
    def load_range(self: Harvester) -> tuple[float, float]:
        """Loads to tune within: the usual ones, or the one that is kept."""
        return (self.load, self.load) if self.load_kept else self.usual_loads

    def power_by_load(self: Harvester, loads: Real, frequency_hz: Real) -> Real:
        """Mean power per squared acceleration amplitude, shape (loads, frequencies)."""
        return np.asarray(np.abs(self.root_power(loads, frequency_hz)) ** 2 / 2)

    def gains(self: Harvester, frequency_hz: npt.ArrayLike) -> Gains:
        """Answers to a unit acceleration amplitude of the base, with the load as it is.

        Parameters
        ----------
        frequency_hz : float array, shape (n,) or a number, >= 0
        """
        frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        root_power, travel, *stress = np.abs(self.transfer(np.array([self.load]), frequency)[:, 0])
        voltage = np.nan_to_num(root_power * math.sqrt(self.load_ohm))
        return Gains(frequency, root_power**2 / 2, travel, np.maximum(*stress), voltage)


def settling_s(harvester: Harvester) -> float:
    """Time constant of the ring-down of the first mode, open or short [s]."""
    rate = harvester.damping_ratio * 2 * math.pi * harvester.natural_frequency_hz
    return 1 / check_positive("damping", rate)
