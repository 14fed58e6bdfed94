"""What a linear harvester gives: power from a spectrum of base acceleration, peaks, bandwidth.

The mean power is P = sum over lines of 2 G(f) <a^2>, G the power per squared amplitude; lines that
wander visit their frequencies in turn. Quasi-steady: the speed changes little within a ring-down.
Several loads are worked out at once, and one load is the first of one.

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
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.harvesting.vibration import OperatingShare, Shaking, Vibration, check_duty
from gearmon.result import Result

Real = npt.NDArray[np.float64]
Self_ = TypeVar("Self_")

#: Peak over rms of many lines together, exceeded 7e-6 of the time by Gaussian motion.
CREST = 4.5
#: Standard deviations of speed that peaks are looked for in.
PEAK_REACH = 3.0
#: Loads tried at once, over the whole range of loads and then about the best of them.
LOADS = 13
#: Points of a response table, half of them about the resonance.
POINTS = 240


@dataclass(frozen=True, eq=False)
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

    def gains_by_load(self, loads: Real, frequency_hz: Real) -> Gains:
        """Answers at several loads, every array but the frequencies of shape (loads, n)."""

    def power_by_load(self, loads: Real, frequency_hz: Real) -> Real:
        """Mean power per squared acceleration amplitude, shape (loads, frequencies)."""

    def power_bound_w(self) -> float:
        """Largest mean power per squared acceleration amplitude at any frequency and load."""

    def to_dict(self) -> dict[str, Any]:
        """Dimensions and values in built-in types."""

    def gains(self, frequency_hz: npt.ArrayLike) -> Gains:
        """Answers at these frequencies."""


class OneLoad:
    """Gains with the load as it is, as the first of one load."""

    def gains(self: Harvester, frequency_hz: npt.ArrayLike) -> Gains:
        """Answers to a unit acceleration amplitude of the base, with the load as it is.

        Parameters
        ----------
        frequency_hz : float array, shape (n,) or a number, >= 0
        """
        frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        one = self.gains_by_load(np.array([self.load]), frequency)
        rows = (one.power_w[0], one.travel_m[0], one.stress_pa[0], one.voltage_v[0])
        return Gains(frequency, *rows)


H = TypeVar("H", bound=Harvester)


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """Of one harvester under one vibration.

    Attributes
    ----------
    power_w : float
        Mean electrical power [W].
    travel_m, stress_pa, voltage_v : float
        Peaks: the sum over lines, or 4.5 times the rms if that is less. The stress is scaled to
        the weakest part, see `Gains`.
    """

    power_w: float
    travel_m: float
    stress_pa: float
    voltage_v: float


def answer(harvester: Harvester, vibration: Vibration) -> Answer:
    """Mean power and peaks of a harvester under a vibration.

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
    found = _by_load(harvester, np.array([harvester.load]), vibration)
    power, travel, stress, voltage = (float(values[0]) for values in found)
    return Answer(power_w=power, travel_m=travel, stress_pa=stress, voltage_v=voltage)


def peaks_by_load(
    harvester: Harvester, loads: Real, duty: Sequence[OperatingShare]
) -> tuple[Real, Real, Real]:
    """Mean power [W], peak travel [m] and stress [Pa], each of shape (operating points, loads)."""
    found = [_by_load(harvester, loads, point.vibration)[:3] for point in duty]
    power, travel, stress = np.array(found).swapaxes(0, 1)
    return power, travel, stress


def _by_load(
    harvester: Harvester, loads: Real, vibration: Vibration
) -> tuple[Real, Real, Real, Real]:
    """Power, travel, stress and voltage under one vibration, each of shape (loads,)."""
    frequency, weights = vibration.nodes(harvester.damping_ratio)
    gains = harvester.gains_by_load(loads, frequency.ravel())
    shape = (len(loads), *frequency.shape)
    power = 2 * (gains.power_w.reshape(shape) @ vibration.mean_square_m2s4) @ weights
    away = np.abs(frequency[:, 0] / vibration.frequency_hz[0] - 1)
    near = away <= PEAK_REACH * vibration.wander + 1e-12
    travel, stress, voltage = (
        _peak(gain.reshape(shape)[:, near], vibration)
        for gain in (gains.travel_m, gains.stress_pa, gains.voltage_v)
    )
    return power, travel, stress, voltage


def _peak(gain: Real, vibration: Vibration) -> Real:
    """Largest sum over the lines while they wander together; gain (..., nodes, lines)."""
    together = gain @ vibration.amplitude_ms2
    rms = np.sqrt(gain**2 @ vibration.mean_square_m2s4)
    return np.asarray(np.minimum(together, CREST * rms).max(axis=-1))


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
    travel_share, stress_share : float
        Largest peak over its limit; 0 where there is no limit.
    """

    harvester: H
    power_w: float
    answers: tuple[Answer, ...]
    travel_share: float
    stress_share: float

    @property
    def within_limits(self) -> bool:
        """Whether travel and stress stay within their limits."""
        return self.travel_share <= 1 + 1e-9 and self.stress_share <= 1 + 1e-9

    def to_dict(self) -> dict[str, Any]:
        """Return values in built-in types."""
        peaks = ("travel_m", "stress_pa", "voltage_v")
        return {
            "harvester": self.harvester.to_dict(),
            "power_w": self.power_w,
            "power_by_operating_point_w": [a.power_w for a in self.answers],
            **{name: max(getattr(a, name) for a in self.answers) for name in peaks},
            "travel_share": self.travel_share,
            "stress_share": self.stress_share,
        }


def evaluate(harvester: H, duty: Shaking) -> Tuned[H]:
    """Tell what a harvester yields over a duty cycle as it stands, and how near its limits."""
    points = check_duty(duty)
    answers = tuple(answer(harvester, point.vibration) for point in points)
    return Tuned(
        harvester=harvester,
        power_w=math.fsum(p.share * a.power_w for p, a in zip(points, answers, strict=True)),
        answers=answers,
        travel_share=max(a.travel_m for a in answers) / harvester.travel_limit_m,
        stress_share=max(a.stress_pa for a in answers) / harvester.stress_limit_pa,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Start(Generic[H]):
    """A tuned harvester with its best load.

    Attributes
    ----------
    harvester : Harvester
    power_w : float
        Mean power [W]; -1 if limits are looked at and no load keeps within them.
    share : float
        Largest peak over its limit; 0 where limits are not looked at.
    """

    harvester: H
    power_w: float
    share: float = 0.0


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
            weights.append(np.outer(likely, point.share * point.vibration.mean_square_m2s4).ravel())
        return cls(np.concatenate(frequencies), np.concatenate(weights))


def with_best_load(harvester: H, lines: DutyLines) -> Start[H]:
    """Choose the load that takes most, by a parabola through the best of many."""
    least, most = harvester.load_range
    exponent = np.linspace(math.log(least), math.log(most), LOADS)
    for _ in range(2):
        loads = np.exp(exponent)
        power = 2 * harvester.power_by_load(loads, lines.frequency_hz) @ lines.weight_m2s4
        top = int(np.argmax(power))
        step = exponent[1] - exponent[0]
        # the range is not left
        near = exponent[max(top - 1, 0)], exponent[min(top + 1, LOADS - 1)]
        exponent = np.linspace(*near, LOADS)
    load, power_w = float(loads[top]), float(power[top])
    if 0 < top < LOADS - 1:
        left, middle, right = (float(p) for p in power[top - 1 : top + 2])
        bend = left - 2 * middle + right
        if bend < 0:
            shift = 0.5 * (left - right) / bend
            load *= math.exp(shift * step)
            power_w = middle - 0.25 * (left - right) * shift
    return Start(harvester=harvester.with_load(load), power_w=power_w)


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
        point = OperatingShare(vibration=line)
        found = with_best_load(damped, DutyLines.over([point], damped.damping_ratio))
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
    names = ["frequency_hz", "power_w", "voltage_v", "travel_m", "stress_pa"]
    columns = {name: getattr(gains, name).tolist() for name in names}
    if math.isinf(harvester.stress_limit_pa):
        columns |= dict.fromkeys(("voltage_v", "stress_pa"), [None] * len(gains.frequency_hz))
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def response_grid(harvester: Harvester) -> Real:
    """Frequencies worth a table: a third to three times the first mode, dense about it [Hz]."""
    natural, damping = harvester.natural_frequency_hz, harvester.damping_ratio
    near = natural * np.exp(20 * damping * np.linspace(-1, 1, POINTS // 2) ** 3)
    broad = natural * np.geomspace(1 / 3, 3, POINTS // 2)
    return np.unique(np.concatenate([near, broad]))
