"""What every harvester offers: gains by frequency, a frequency to tune and a load to choose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

Real = npt.NDArray[np.float64]
Self_ = TypeVar("Self_")


@dataclass(frozen=True, kw_only=True, eq=False)
class Gains:
    """Answers of a harvester to a unit acceleration amplitude of its base, by frequency.

    Attributes
    ----------
    frequency_hz : ndarray, shape (n,)
    power_w : ndarray, shape (n,); this and the others (loads, n) from `gains_by_load`
        Mean electrical power per squared acceleration amplitude [W/(m/s2)^2].
    travel_m : ndarray, shape (n,)
        Amplitude of the moving mass against the base [m/(m/s2)].
    stress_pa : ndarray, shape (n,)
        Amplitude of the largest stress, each part over its safe stress and times that of the
        weakest: zero for harvesters whose spring is not modelled [Pa/(m/s2)].
    voltage_v : ndarray, shape (n,)
        Amplitude of the voltage at the load [V/(m/s2)]; zero where it is not modelled.
    """

    frequency_hz: Real
    power_w: Real
    travel_m: Real
    stress_pa: Real
    voltage_v: Real


class Harvester(Protocol):
    """A linear harvester on a moving base."""

    @property
    def natural_frequency_hz(self) -> float:
        """Frequency of the first mode, short-circuited [Hz]."""

    @property
    def resonances_hz(self) -> Real:
        """Natural frequencies of all modes, short-circuited [Hz]."""

    @property
    def damping_ratio(self) -> float:
        """Mechanical damping ratio of the first mode."""

    @property
    def load(self) -> float:
        """Load: resistance [ohm], or electrical damping ratio where there is no circuit."""

    @property
    def load_range(self) -> tuple[float, float]:
        """Sensible loads, low and high."""

    @property
    def frequency_range_hz(self) -> tuple[float, float]:
        """Natural frequencies that `retuned` can reach [Hz]."""

    @property
    def travel_limit_m(self) -> float:
        """Clearance of the moving mass [m]; infinite if none is given."""

    @property
    def stress_limit_pa(self) -> float:
        """Safe stress of the weakest part [Pa]; infinite where no stress is modelled."""

    def retuned(self: Self_, frequency_hz: float) -> Self_:
        """Return the same harvester with another natural frequency."""

    def with_load(self: Self_, load: float) -> Self_:
        """Return the same harvester with another load."""

    def with_damping_ratio(self: Self_, ratio: float) -> Self_:
        """Return the same harvester with another mechanical damping ratio, of every mode."""

    def gains(self, frequency_hz: npt.ArrayLike) -> Gains:
        """Answers at these frequencies."""

    def gains_by_load(self, loads: Real, frequency_hz: Real) -> Gains:
        """Answers at several loads, every array but the frequencies of shape (loads, n)."""

    def power_by_load(self, loads: Real, frequency_hz: Real) -> Real:
        """Mean power per squared acceleration amplitude, shape (loads, frequencies)."""

    def power_bound_w(self) -> float:
        """Largest mean power per squared acceleration amplitude at any frequency and load."""

    def to_dict(self) -> dict[str, Any]:
        """Dimensions and values in built-in types."""
