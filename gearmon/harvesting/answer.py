"""What a harvester gives and suffers under a vibration, and under a duty cycle of several."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.vibration import Vibration

Real = npt.NDArray[np.float64]

#: Peak over rms of many lines together, exceeded 7e-6 of the time by Gaussian motion.
CREST = 4.5
#: Standard deviations of speed that peaks are looked for in.
PEAK_REACH = 3.0


@dataclass(frozen=True, kw_only=True)
class OperatingShare:
    """One operating point of a duty cycle.

    Parameters
    ----------
    vibration : Vibration
    share : float, > 0 and <= 1
        Of the time.
    """

    vibration: Vibration
    share: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.share <= 1:
            raise ArgumentError(f"share={self.share} must lie in (0, 1]")


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """Of one harvester under one vibration.

    Attributes
    ----------
    power_w : float
        Mean electrical power [W].
    line_power_w : ndarray, shape (n,)
        Share of each line or bin [W].
    travel_m, stress_pa, voltage_v : float
        Peaks: the sum over lines, or 4.5 times the rms if that is less. The stress is scaled to
        the weakest part, see `Gains`.
    """

    power_w: float
    line_power_w: Real
    travel_m: float
    stress_pa: float
    voltage_v: float


def answer(harvester: Harvester, vibration: Vibration) -> Answer:
    """Mean power and peaks of a harvester under a vibration.

    P = sum over lines of 2 G(f) <a^2>, G the power per squared amplitude; lines that wander visit
    their frequencies in turn. Quasi-steady: the speed changes little within a ring-down.

    Raises
    ------
    ArgumentError
        If bins are too wide for the resonance.
    """
    width = 2 * harvester.damping_ratio * harvester.natural_frequency_hz
    if vibration.resolution_hz > 2 * width:
        raise ArgumentError(
            f"{vibration.name or 'vibration'}: its resolution of {vibration.resolution_hz:.3g} Hz "
            f"is too coarse for a resonance {width:.3g} Hz wide; record at least "
            f"{1.5 / width:.3g} s in one piece"
        )
    frequency, weights = vibration.nodes(harvester.damping_ratio)
    gains = harvester.gains(frequency.ravel())
    power = 2 * vibration.mean_square_m2s4 * (weights @ gains.power_w.reshape(frequency.shape))
    near = np.abs(frequency[:, 0] / vibration.frequency_hz[0] - 1)
    near_enough = near <= PEAK_REACH * vibration.wander + 1e-12
    peaks = [
        _peak(gain.reshape(frequency.shape)[near_enough], vibration)
        for gain in (gains.travel_m, gains.stress_pa, gains.voltage_v)
    ]
    return Answer(
        power_w=float(power.sum()),
        line_power_w=power,
        travel_m=peaks[0],
        stress_pa=peaks[1],
        voltage_v=peaks[2],
    )


def _peak(gain: Real, vibration: Vibration) -> float:
    """Largest sum over the lines while they wander together."""
    together = gain @ vibration.amplitude_ms2
    rms = np.sqrt(gain**2 @ vibration.mean_square_m2s4)
    return float(np.minimum(together, CREST * rms).max())


def mean_power_w(harvester: Harvester, duty: Sequence[OperatingShare]) -> float:
    """Mean power over a duty cycle [W]; time that the shares leave out gives none."""
    return math.fsum(point.share * answer(harvester, point.vibration).power_w for point in duty)


def check_duty(duty: Sequence[OperatingShare]) -> tuple[OperatingShare, ...]:
    """Return a duty cycle as a tuple.

    Raises
    ------
    ArgumentError
        If it is empty or its shares sum to more than 1.
    """
    points = tuple(duty)
    if not points:
        raise ArgumentError("duty cycle: no operating point is given")
    total = math.fsum(point.share for point in points)
    if total > 1 + 1e-6:
        raise ArgumentError(f"duty cycle: the shares sum to {total:.6g}, at most 1 is possible")
    return points
