"""What a harvester gives against frequency, and how broad its resonance is.

Bandwidth is that of half the largest power. For a mass on a spring with the damping ratios zm
(heat) and ze (load) it is 2 (zm + ze) fn exactly, so that bandwidth times quality factor is fn with
Q = 1/(2 (zm + ze)); with a matched load twice that of the mass by itself. The largest power rises
with Q and the bandwidth falls as 1/Q: their product stays, so that a line which wanders further
than the bandwidth yields no more from a higher Q.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.refinement import Heard, with_best_load
from gearmon.harvesting.vibration import Vibration

Real = npt.NDArray[np.float64]

#: Points of a response table, half of them about the resonance.
POINTS = 240


@dataclass(frozen=True, kw_only=True)
class HalfPowerBand:
    """The band about the first mode with at least half of its largest power.

    Attributes
    ----------
    peak_hz, low_hz, high_hz : float
        Where the power is largest, and the ends of the band around it [Hz].
    power_w : float
        Largest mean power per squared acceleration amplitude [W/(m/s2)^2].
    """

    peak_hz: float
    low_hz: float
    high_hz: float
    power_w: float

    @property
    def width_hz(self) -> float:
        """Bandwidth [Hz]."""
        return self.high_hz - self.low_hz

    @property
    def quality_factor(self) -> float:
        """Peak frequency over bandwidth, with the load."""
        return self.peak_hz / self.width_hz

    def to_dict(self) -> dict[str, float]:
        """Return all values."""
        return asdict(self) | {"width_hz": self.width_hz, "quality_factor": self.quality_factor}


def half_power_band(harvester: Harvester) -> HalfPowerBand:
    """Find the half-power band of the first mode with the load as it is.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever

    Raises
    ------
    ArgumentError
        If the power does not fall to a half on both sides, as with a very large load damping.

    Examples
    --------
    >>> from gearmon.harvesting import InertialHarvester
    >>> h = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=100.0)   # zm = ze = 0.01
    >>> round(half_power_band(h).width_hz, 9)
    4.0
    """
    from scipy.optimize import brentq, minimize_scalar

    natural = harvester.natural_frequency_hz
    grid = natural * np.exp(np.linspace(-1.2, 1.2, 24_001))
    power = harvester.gains(grid).power_w
    # higher modes have bands of their own
    top = int(np.argmax(np.where(np.abs(np.log(grid / natural)) < 0.7, power, 0.0)))
    bracket = grid[max(top - 1, 0)], grid[min(top + 1, len(grid) - 1)]
    peak = float(
        minimize_scalar(
            lambda f: -float(harvester.gains(f).power_w[0]),
            bounds=bracket,
            method="bounded",
            options={"xatol": 1e-9 * natural},
        ).x
    )
    largest = float(harvester.gains(peak).power_w[0])
    below = np.flatnonzero(power < largest / 2)
    left, right = below[below < top], below[below > top]
    if not (len(left) and len(right)):
        raise ArgumentError(
            f"load={harvester.load:g}: the power does not fall to a half within a factor of 3 of "
            f"{natural:.4g} Hz; there is no band"
        )

    def over_half(frequency: float) -> float:
        return float(harvester.gains(frequency).power_w[0]) - largest / 2

    ends = [
        float(brentq(over_half, grid[i], grid[j], xtol=1e-12 * natural))
        for i, j in ((left[-1], left[-1] + 1), (right[0] - 1, right[0]))
    ]
    return HalfPowerBand(peak_hz=peak, low_hz=ends[0], high_hz=ends[1], power_w=largest)


def bandwidth_against_quality(
    harvester: Harvester, quality_factors: Sequence[float], wander: float = 0.0
) -> list[dict[str, float]]:
    """Bandwidth and power of a harvester against the quality factor of its mechanics.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
        As tuned; its load is chosen anew for every quality factor.
    quality_factors : sequence of float, 0.51 to 10,000
        Of the mechanics alone, 1/(2 zm).
    wander : float, 0 to 0.2
        Standard deviation of the frequency of the one line of 1 m/s2 that drives it, over its mean.

    Returns
    -------
    list of dict
        quality_factor, loaded_quality_factor, load, width_hz, peak_power_w (1 m/s2 at the best
        frequency) and power_w (1 m/s2 about the natural frequency, wandering).

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """
    rows = []
    for quality in quality_factors:
        check_range("quality_factor", quality, 0.51, 1e4)
        damped = harvester.with_damping_ratio(1 / (2 * quality))
        line = Vibration(
            frequency_hz=np.array([harvester.natural_frequency_hz]),
            mean_square_m2s4=np.array([0.5]),
            wander=wander,
        )
        frequency, likely = line.nodes(damped.damping_ratio)
        found = with_best_load(damped, Heard(frequency.ravel(), 0.5 * likely))
        band = half_power_band(found.harvester)
        rows.append(
            {
                "quality_factor": float(quality),
                "loaded_quality_factor": band.quality_factor,
                "load": found.harvester.load,
                "width_hz": band.width_hz,
                "peak_power_w": band.power_w,
                "power_w": found.power_w,
            }
        )
    return rows


def response_rows(harvester: Harvester, frequency_hz: npt.ArrayLike) -> list[dict[str, Any]]:
    """Power, voltage, tip displacement and peak stress at 1 m/s2 against frequency.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
    frequency_hz : array, shape (n,), >= 0

    Returns
    -------
    list of dict
        frequency_hz, power_w, voltage_v, travel_m and stress_pa for an amplitude of 1 m/s2: the
        power goes with its square, the others with it. Voltage and stress are None where they are
        not modelled.
    """
    gains = harvester.gains(frequency_hz)
    modelled = not math.isinf(harvester.stress_limit_pa)
    return [
        {
            "frequency_hz": float(gains.frequency_hz[i]),
            "power_w": float(gains.power_w[i]),
            "voltage_v": float(gains.voltage_v[i]) if modelled else None,
            "travel_m": float(gains.travel_m[i]),
            "stress_pa": float(gains.stress_pa[i]) if modelled else None,
        }
        for i in range(len(gains.frequency_hz))
    ]


def response_grid(harvester: Harvester) -> Real:
    """Frequencies worth a table: a third to three times the first mode, dense about it [Hz]."""
    natural, damping = harvester.natural_frequency_hz, harvester.damping_ratio
    near = natural * np.exp(20 * damping * np.linspace(-1, 1, POINTS // 2) ** 3)
    broad = natural * np.geomspace(1 / 3, 3, POINTS // 2)
    return np.unique(np.concatenate([near, broad]))
