"""How fast the machine runs and how hard it is loaded while a recording is made.

Speed and load wander slowly about their nominal values, as a random walk that is limited to a
band does: a sum of cosines whose power falls with the square of the frequency. As such it is known
at every instant, and so is its integral, the angle of the input shaft.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.errors import check_positive

FloatArray = NDArray[np.float64]

#: Band of the wander [Hz].
WANDER_BAND_HZ = (0.05, 2.0)
#: Cosines in the sum.
WANDER_LINES = 16
# Newton's method doubles its digits: four steps for the usual wander, more for a wild one.
_NEWTON_STEPS, _TIME_ERROR_S = 60, 1e-11


@dataclass(frozen=True, kw_only=True, eq=False)
class Wander:
    """A slow random departure from a nominal value, relative to it.

    Parameters
    ----------
    amplitudes, frequencies_hz, phases_rad : ndarray, shape (lines,)
        Cosines whose sum it is.
    """

    amplitudes: FloatArray
    frequencies_hz: FloatArray
    phases_rad: FloatArray

    def value(self, time_s: ArrayLike) -> FloatArray:
        """Departure at the given times (any shape)."""
        time = np.asarray(time_s, dtype=np.float64)
        total = np.zeros(time.shape)
        for amplitude, rate, phase in self._lines():
            total += amplitude * np.cos(rate * time + phase)
        return total

    def integral(self, time_s: ArrayLike) -> FloatArray:
        """Integral of the departure from time 0 [s]."""
        time = np.asarray(time_s, dtype=np.float64)
        total = np.zeros(time.shape)
        for amplitude, rate, phase in self._lines():
            total += amplitude / rate * (np.sin(rate * time + phase) - math.sin(phase))
        return total

    def _lines(self) -> list[tuple[float, float, float]]:
        rates = 2 * math.pi * self.frequencies_hz
        rows = zip(self.amplitudes, rates, self.phases_rad, strict=True)
        return [(float(a), float(rate), float(phase)) for a, rate, phase in rows if a]


def random_wander(deviation: float, generator: np.random.Generator) -> Wander:
    """Draw a wander with the given standard deviation over a long time.

    Parameters
    ----------
    deviation : float, 0 to 0.1
        Standard deviation relative to the nominal value.
    generator : numpy.random.Generator

    Notes
    -----
    A random walk has a power density that falls as 1/f^2; lines at equal ratios of frequency then
    carry powers that fall as 1/f.
    """
    low, high = np.log(WANDER_BAND_HZ)
    place = (np.arange(WANDER_LINES) + generator.random(WANDER_LINES)) / WANDER_LINES
    frequencies = np.exp(low + (high - low) * place)
    amplitudes = 1 / np.sqrt(frequencies)
    amplitudes *= deviation * math.sqrt(2) / np.linalg.norm(amplitudes)
    phases = generator.uniform(0, 2 * math.pi, WANDER_LINES)
    return Wander(amplitudes=amplitudes, frequencies_hz=frequencies, phases_rad=phases)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShaftMotion:
    """Motion of shaft 1.

    Parameters
    ----------
    mean_hz : float
        Speed about which it wanders [Hz].
    wander : Wander
        Departure of the speed, always above -1.
    start_turns : float
        Angle at time 0 [turns].
    """

    mean_hz: float
    wander: Wander
    start_turns: float = 0.0

    def __post_init__(self) -> None:
        check_positive("mean_hz", self.mean_hz, "Hz")

    def speed_hz(self, time_s: ArrayLike) -> FloatArray:
        """Speed at the given times [Hz]."""
        return self.mean_hz * (1.0 + self.wander.value(time_s))

    def turns(self, time_s: ArrayLike) -> FloatArray:
        """Angle at the given times [turns]."""
        time = np.asarray(time_s, dtype=np.float64)
        return self.start_turns + self.mean_hz * (time + self.wander.integral(time))

    def times_s(self, turns: ArrayLike) -> FloatArray:
        """Return the times at which the angle is `turns` [s]."""
        wanted = np.asarray(turns, dtype=np.float64)
        time = (wanted - self.start_turns) / self.mean_hz
        for _ in range(_NEWTON_STEPS):
            change = (self.turns(time) - wanted) / self.speed_hz(time)
            time = time - change
            if not np.any(np.abs(change) > _TIME_ERROR_S):
                break
        return time
