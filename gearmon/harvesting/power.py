"""What a linear harvester gives: power from what shakes it, peaks, bandwidth.

Under a recording power and peaks come from the recording itself, through the harvester's filter.
Under lines the mean power is the sum over lines of 2 G(f) <a^2>, G the power per squared amplitude;
lines that wander share their power among the frequencies that they visit. Several loads are worked
out at once.

Bandwidth is that of half the largest power. For a mass on a spring with the damping ratios zm
(heat) and ze (load) it is 2 (zm + ze) fn exactly, so that bandwidth times quality factor is fn with
Q = 1/(2 (zm + ze)); with a matched load twice that of the mass by itself. The largest power rises
with Q and the bandwidth falls as 1/Q: their product stays, so that a line which wanders further
than the bandwidth yields no more from a higher Q.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, Generic

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.harvesting.harvester import H, Harvester
from gearmon.harvesting.recorded import Response, respond
from gearmon.harvesting.vibration import OperatingShare, Shaking, Vibration, check_duty
from gearmon.result import Result

Real = npt.NDArray[np.float64]

#: Standard deviations of speed that peaks are looked for in.
PEAK_REACH = 3.0
#: Loads tried at once, over their whole range and then about the best of them, so many times.
LOADS, ZOOMED, ZOOMS = 11, 7, 6
#: Points of a response table, half of them about the resonance.
POINTS = 240
#: Shares of the steps of a recording whose peaks stay below what is told.
QUANTILES = (0.5, 0.99)


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """Of one harvester under one vibration.

    Attributes
    ----------
    power_w : float
        Mean electrical power [W].
    travel_m, stress_pa, voltage_v : float
        Largest sizes without gravity: in the recording; of lines their sum, or 4.5 times the rms if
        that is less. The stress is scaled to the weakest part, see `Gains`.
    response : Response or None
        Of a recording.
    """

    power_w: float
    travel_m: float
    stress_pa: float
    voltage_v: float
    response: Response | None = None

    def quantiles(self, load_ohm: float) -> dict[str, list[float]]:
        """Peaks that steps of a recording stay below, half of them and 99 %; empty for lines."""
        if self.response is None:
            return {}
        found = np.quantile(self.response.step_peaks, QUANTILES, axis=-1)
        rows = (found[:, 0] * math.sqrt(load_ohm), found[:, 1], found[:, 2:].max(axis=1))
        names = ("voltage_v", "travel_m", "stress_pa")
        return {n: row.tolist() for n, row in zip(names, rows, strict=True) if row[-1] > 0}


def answer(harvester: Harvester, vibration: Vibration) -> Answer:
    """Mean power and peaks of a harvester under a vibration.

    Raises
    ------
    ArgumentError
        If a recording is too short for the harvester.
    """
    if len(vibration.samples_ms2):
        try:
            found = respond(harvester, vibration.samples_ms2, vibration.sampling_rate_hz)
        except ArgumentError as error:
            raise ArgumentError(f"{vibration.name or 'vibration'}: {error}") from None
        power, highest = found.power_w, found.peaks
    else:
        found = None
        powers, peaks = by_load(harvester, np.array([harvester.load]), vibration)
        power, highest = float(powers[0]), peaks[:, 0]
    root, travel, *stress = highest
    return Answer(
        power_w=power,
        travel_m=float(travel),
        stress_pa=float(max(stress)),
        voltage_v=float(np.nan_to_num(root * math.sqrt(harvester.load_ohm))),
        response=found,
    )


def by_load(harvester: Harvester, loads: Real, vibration: Vibration) -> tuple[Real, Real]:
    """Mean power [W], shape (loads,), and peaks, shape (4, loads), from lines or a spectrum.

    Peaks as `OUTPUTS` has them: the largest sum over lines while they wander together, or the crest
    of the vibration times the rms if that is less, as it always is for the bins of a spectrum.
    """
    frequency, weights = vibration.nodes(harvester.damping_ratio)
    answers = np.abs(harvester.transfer(loads, frequency.ravel()))
    answers = answers.reshape(4, len(loads), *frequency.shape)
    mean_square = np.einsum(
        "...kn,kn,n->...", answers**2, weights * np.ones_like(frequency), vibration.mean_square_m2s4
    )
    away = np.abs(frequency[:, 0] / vibration.frequency_hz[0] - 1)
    near = away <= PEAK_REACH * vibration.wander + 1e-12
    rms = np.sqrt(answers[..., near, :] ** 2 @ vibration.mean_square_m2s4)
    peak = vibration.crest * rms
    if vibration.resolution_hz == 0:
        peak = np.minimum(peak, answers[..., near, :] @ vibration.amplitude_ms2)
    return mean_square[0], np.asarray(peak.max(axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Tuned(Result, Generic[H]):
    """A harvester at its best.

    Attributes
    ----------
    harvester : Harvester
        Tuned, with its load.
    power_w : float
        Mean over the duty cycle [W].
    answers : tuple of Answer
        Of each operating point.
    static_travel_m, static_stress_pa : float
        From its own weight.
    travel_share, stress_share : float
        Largest peak with that of the weight over its limit; 0 where there is no limit.
    rivals_hz : tuple of float
        Natural frequencies that were looked at more closely.
    """

    harvester: H
    power_w: float
    answers: tuple[Answer, ...]
    static_travel_m: float
    static_stress_pa: float
    travel_share: float
    stress_share: float
    rivals_hz: tuple[float, ...] = ()

    @property
    def within_limits(self) -> bool:
        """Whether travel and stress stay within their limits."""
        return self.travel_share <= 1 + 1e-9 and self.stress_share <= 1 + 1e-9

    def to_dict(self) -> dict[str, Any]:
        """Return values in built-in types."""
        peaks = ("travel_m", "stress_pa", "voltage_v")
        own = ("static_travel_m", "static_stress_pa", "travel_share", "stress_share")
        load_ohm = self.harvester.load_ohm
        return {
            "harvester": self.harvester.to_dict(),
            "power_w": self.power_w,
            "power_by_operating_point_w": [a.power_w for a in self.answers],
            **{name: max(getattr(a, name) for a in self.answers) for name in peaks},
            "peaks_half_and_99_percent_of_steps": [a.quantiles(load_ohm) for a in self.answers],
            **{name: getattr(self, name) for name in own},
        }


def static_peaks(harvester: Harvester) -> tuple[float, float]:
    """Travel [m] and stress [Pa] from the harvester's own weight."""
    at_rest = harvester.gains(0.0)
    weight = abs(harvester.weight_ms2)
    return weight * float(at_rest.travel_m[0]), weight * float(at_rest.stress_pa[0])


def evaluate(harvester: H, duty: Shaking) -> Tuned[H]:
    """Tell what a harvester yields over a duty cycle as it stands, and how near its limits.

    Parameters
    ----------
    harvester, duty
        As for `tune_harvester`.

    Returns
    -------
    Tuned
        With the harvester as it was given.
    """
    points = check_duty(duty)
    answers = tuple(answer(harvester, point.vibration) for point in points)
    travel, stress = static_peaks(harvester)
    return Tuned(
        harvester=harvester,
        power_w=math.fsum(p.share * a.power_w for p, a in zip(points, answers, strict=True)),
        answers=answers,
        static_travel_m=travel,
        static_stress_pa=stress,
        travel_share=(travel + max(a.travel_m for a in answers)) / harvester.clearance_m,
        stress_share=(stress + max(a.stress_pa for a in answers)) / harvester.stress_limit_pa,
    )


@dataclass(frozen=True, eq=False)
class DutyLines:
    """All that shakes over a duty cycle in one row: frequencies, and mean squares times shares."""

    frequency_hz: Real
    weight_m2s4: Real

    @classmethod
    def over(cls, points: Sequence[OperatingShare], damping_ratio: float) -> DutyLines:
        """Gather all lines at all frequencies that they visit."""
        frequencies, weights = [], []
        for point in points:
            frequency, likely = point.vibration.nodes(damping_ratio)
            frequencies.append(frequency.ravel())
            weights.append((likely * (point.share * point.vibration.mean_square_m2s4)).ravel())
        return cls(np.concatenate(frequencies), np.concatenate(weights))

    def power_w(self, harvester: Harvester, loads: Real) -> Real:
        """Mean power at several loads [W], shape (loads,)."""
        return 2 * harvester.power_by_load(loads, self.frequency_hz) @ self.weight_m2s4


def best_load(
    harvester: Harvester, worth: Callable[[Real], Real], zooms: int = ZOOMS
) -> tuple[float, float]:
    """Choose the load that is worth most, closing in on the best of many.

    Parameters
    ----------
    harvester : Harvester
    worth : callable
        Gives the worth of each of several loads.
    zooms : int, >= 0
        Each divides the step between loads by three.

    Returns
    -------
    load, worth : float
    """
    low, high = harvester.load_range
    exponent = np.linspace(math.log(low), math.log(high), LOADS)
    best = (-math.inf, math.nan)
    for _ in range(zooms + 1):
        loads = np.exp(exponent)
        found = worth(loads)
        top = int(np.argmax(found))
        best = max(best, (float(found[top]), float(loads[top])))
        # the range is not left
        near = exponent[max(top - 1, 0)], exponent[min(top + 1, len(exponent) - 1)]
        exponent = np.linspace(*near, ZOOMED)
    return best[1], best[0]


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

    Returns
    -------
    HalfPowerBand

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
        Of the mechanics alone, dimensionless, 1/(2 zm).
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
        point = OperatingShare(vibration=line)
        lines = DutyLines.over([point], damped.damping_ratio)
        load, power = best_load(damped, partial(lines.power_w, damped))
        band = half_power_band(damped.with_load(load))
        rows.append(
            {
                "quality_factor": float(quality),
                "loaded_quality_factor": band.quality_factor,
                "load": load,
                "width_hz": band.width_hz,
                "peak_power_w": band.power_w,
                "power_w": power,
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
    names = ["frequency_hz", "power_w", "voltage_v", "travel_m", "stress_pa"]
    columns = {name: getattr(gains, name).tolist() for name in names}
    nothing = [None] * len(gains.frequency_hz)
    columns |= {name: nothing for name in ("voltage_v", "stress_pa") if not any(columns[name])}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def response_grid(harvester: Harvester) -> Real:
    """Frequencies worth a table: a third to three times the first mode, dense about it [Hz]."""
    natural, damping = harvester.natural_frequency_hz, harvester.damping_ratio
    near = natural * np.exp(20 * damping * np.linspace(-1, 1, POINTS // 2) ** 3)
    broad = natural * np.geomspace(1 / 3, 3, POINTS // 2)
    return np.unique(np.concatenate([near, broad]))
