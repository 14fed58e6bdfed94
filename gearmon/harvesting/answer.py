"""What a harvester gives and suffers under a vibration, and under a duty cycle of several."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.harvesting.duty import OperatingShare
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.vibration import Vibration

Real = npt.NDArray[np.float64]

#: Peak over rms of many lines together, exceeded 7e-6 of the time by Gaussian motion.
CREST = 4.5
#: Standard deviations of speed that peaks are looked for in.
PEAK_REACH = 3.0


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
    near = _near(frequency, vibration)
    peaks = [
        float(_peak(gain.reshape(frequency.shape)[near], vibration))
        for gain in (gains.travel_m, gains.stress_pa, gains.voltage_v)
    ]
    return Answer(
        power_w=float(power.sum()),
        line_power_w=power,
        travel_m=peaks[0],
        stress_pa=peaks[1],
        voltage_v=peaks[2],
    )


def _near(frequency: Real, vibration: Vibration) -> npt.NDArray[np.bool_]:
    """Tell which of the nodes are near enough for peaks."""
    away = np.abs(frequency[:, 0] / vibration.frequency_hz[0] - 1)
    return np.asarray(away <= PEAK_REACH * vibration.wander + 1e-12)


def _peak(gain: Real, vibration: Vibration) -> Real:
    """Largest sum over the lines while they wander together; gain (..., nodes, lines)."""
    together = gain @ vibration.amplitude_ms2
    rms = np.sqrt(gain**2 @ vibration.mean_square_m2s4)
    return np.asarray(np.minimum(together, CREST * rms).max(axis=-1))


def peaks_by_load(
    harvester: Harvester, loads: Real, duty: Sequence[OperatingShare]
) -> tuple[Real, Real, Real]:
    """Mean power [W], largest travel [m] and stress [Pa] over a duty cycle, for several loads.

    Parameters
    ----------
    harvester : Harvester
    loads : ndarray, shape (loads,)
    duty : sequence of OperatingShare

    Returns
    -------
    power_w, travel_m, stress_pa : ndarray, shape (loads,)
    """
    power, travel, stress = (np.zeros(len(loads)) for _ in range(3))
    for point in duty:
        vibration = point.vibration
        frequency, weights = vibration.nodes(harvester.damping_ratio)
        gains = harvester.gains_by_load(loads, frequency.ravel())
        shape = (len(loads), *frequency.shape)
        by_node = gains.power_w.reshape(shape) @ vibration.mean_square_m2s4
        power += 2 * point.share * (by_node @ weights)
        near = _near(frequency, vibration)
        travel = np.maximum(travel, _peak(gains.travel_m.reshape(shape)[:, near], vibration))
        stress = np.maximum(stress, _peak(gains.stress_pa.reshape(shape)[:, near], vibration))
    return power, travel, stress


def mean_power_w(harvester: Harvester, duty: Sequence[OperatingShare]) -> float:
    """Mean power over a duty cycle [W]; time that the shares leave out gives none."""
    return math.fsum(point.share * answer(harvester, point.vibration).power_w for point in duty)
