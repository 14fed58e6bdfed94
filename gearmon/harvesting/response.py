"""What a harvester makes of what shakes it, and what a sensor gets of that.

A harvester is linear, so that its answers to a recording are the recording through its filter,
block by block in the frequency domain: exact for what the recording holds, lines and noise alike,
steady or not. The power needs no spectrum, no line and no window; its mean over the recording is
the mean over time.

Under lines the mean power is the sum over lines of 2 G(f) <a^2>, G the power per squared amplitude;
lines that wander share their power among the frequencies that they visit. Several loads are worked
out at once.

To the sensor (`SensorBudget`):

rectifier   a bridge passes current only while the voltage at the load exceeds its drop D: of the
            power under a sine of amplitude V it passes 1 - 2/pi (asin k + k sqrt(1 - k^2)) with
            k = D/V, none below (the mean of |v| (|v| - D) over that of v^2)
regulator   one that tracks the maximum power point presents the best load and takes what it
            needs itself; without one the store holds the voltage, and a source whose open
            voltage is twice that at its best gives 4 x (1 - x) of its best at the share x
store       leaks at its voltage, and must once be charged from nothing: only when the rectified
            voltage reaches what the regulator starts at
part        loses with temperature, and with every tenfold of its age
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any, Generic, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from gearmon.errors import ArgumentError, check_positive
from gearmon.harvesting.harvester import Complex, H, Harvester, Real, half_power_band
from gearmon.harvesting.vibration import DRIFT_HZ, Points, Shaking, Vibration, check_duty
from gearmon.machine.fields import Checked, Choice, Count, held, within
from gearmon.result import Result

#: Time constants of the ring-down that are let pass before anything counts: what the unknown past
#: left has fallen to 1/150 then.
SETTLED = 5.0
#: A recording shorter than so many time constants tells nothing.
SHORTEST = 4.0
#: Length of a block of samples.
BLOCK = 1 << 16
#: The power is kept as means over this time [s], at least so many of them.
STEP_S, FEWEST_STEPS = 0.05, 64
#: Samples are set so many times denser where a peak is looked for.
DENSER = 8
#: Cosine weights of the long-run variance for each independent stretch: the spectrum of a power
#: that is forgotten exponentially has then fallen by a tenth over them.
WEIGHTS_A_STRETCH, MOST_WEIGHTS = 0.2, 40
#: Fewer independent stretches give no interval.
FEWEST_STRETCHES = 8.0
#: Draws behind the interval of blocks of operation.
DRAWN = 4000
#: Steps of a natural period while the mass may hit its stops, and the most that are taken.
STRIKE_STEPS, MOST_STRIKE_STEPS = 120, 2_000_000
#: Standard deviations of speed that peaks are looked for in.
PEAK_REACH = 3.0
#: Shares of the steps of a recording whose peaks stay below what is told.
QUANTILES = (0.5, 0.99)


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """Of one harvester under one vibration.

    Attributes
    ----------
    power_w : float
        Mean electrical power [W]; of a recording the settling time is left out.
    travel_m, stress_pa, voltage_v : float
        Largest sizes without gravity: in the recording; of lines their sum, or 4.5 times the rms if
        that is less. The stress is scaled to the weakest part, see `Gains`.
    peaks : ndarray, shape (4,)
        The same as `harvester.OUTPUTS` has them.
    power_steps_w : ndarray, shape (n,)
        Means over steps of some 0.05 s of a recording; of lines their mean alone.
    quantiles : dict of str to list of float
        Peaks that steps of a recording stay below, half of them and 99 %; empty for lines.
    """

    power_w: float
    travel_m: float
    stress_pa: float
    voltage_v: float
    peaks: Real
    power_steps_w: Real
    quantiles: dict[str, list[float]]


def answer(harvester: Harvester, vibration: Vibration) -> Answer:
    """Mean power and peaks of a harvester under a vibration.

    Raises
    ------
    ArgumentError
        If a recording is too short for the harvester.
    """
    if len(samples := vibration.samples_ms2):
        return respond(harvester, samples, vibration.sampling_rate_hz, vibration.name)
    power, peaks = by_load(harvester, np.array([harvester.load]), vibration)
    return _answer(harvester, power, peaks[:, 0], np.empty((4, 0)))


def respond(harvester: Harvester, samples_ms2: Real, rate: float, name: str = "") -> Answer:
    """Send a recording through a harvester.

    Parameters
    ----------
    harvester : Harvester
    samples_ms2 : ndarray, shape (n,)
        Acceleration of the base without its mean [m/s2].
    rate : float, > 0
        Sampling rate [Hz].
    name : str
        Of the recording.

    Raises
    ------
    ArgumentError
        If the recording is too short for the ring-down.
    """
    settling, count = harvester.settling_s, len(samples_ms2)
    if count / rate < SHORTEST * settling:
        raise ArgumentError(
            f"{name or 'vibration'}: a recording of {count / rate:.3g} s is too short for a ring-"
            f"down of {settling:.3g} s; record at least {2 * SETTLED * settling:.3g} s in one piece"
        )
    lead = min(math.ceil(SETTLED * settling * rate), count // 2)
    step = max(1, min(round(STEP_S * rate), (count - lead) // FEWEST_STEPS))
    power, peaks = [], []
    # in blocks of whole steps, each led in by the samples before
    whole = (count - lead) // step * step
    taken = min(whole, max(1, max(BLOCK, 3 * lead) // step) * step)
    filtering = _transfer(harvester, lead + taken, rate)
    for start in range(0, whole, taken):
        # the last block reaches back, for its length to be that of the others
        begin = min(start, whole - taken)
        rows = _filtered(filtering, samples_ms2[begin : begin + lead + taken])
        steps = np.abs(rows[:, lead + start - begin :]).reshape(len(rows), -1, step)
        power.append(np.mean(steps[0] ** 2, axis=-1))
        peaks.append(steps.max(axis=-1))
    highest, between = np.concatenate(peaks, axis=1), []
    for row, number in enumerate(np.argmax(highest, axis=1).tolist()):
        # room behind: the transform takes the block for periodic
        block = samples_ms2[step * number : lead + step * (number + 1) + min(lead, 64)]
        dense = _filtered(_transfer(harvester, len(block), rate)[row], block, DENSER)
        between.append(np.abs(dense[DENSER * lead : DENSER * (lead + step)]).max())
    found = np.maximum(between, highest.max(axis=1))
    return _answer(harvester, np.concatenate(power), found, highest)


def _answer(harvester: Harvester, power_steps_w: Real, peaks: Real, steps: Real) -> Answer:
    quantiles = np.quantile(steps, QUANTILES, axis=-1).T if steps.size else steps
    rows = harvester.sizes(np.column_stack([peaks, quantiles]))
    told = {name: row[1:].tolist() for name, row in rows.items() if steps.size and row[-1] > 0}
    return Answer(
        power_w=float(power_steps_w.mean()),
        peaks=peaks,
        power_steps_w=power_steps_w,
        quantiles=told,
        **{name: float(row[0]) for name, row in rows.items()},
    )


def _transfer(harvester: Harvester, length: int, rate: float) -> Complex:
    frequency: Real = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)
    found = harvester.transfer(np.array([harvester.load]), frequency)[:, 0]
    found[:, frequency < DRIFT_HZ] = 0.0
    return found


def _filtered(filtering: Complex, block: Real, denser: int = 1) -> Real:
    """Answers to a block, at so many times as many instants."""
    answers = scipy.fft.irfft(filtering * scipy.fft.rfft(block), denser * len(block))
    return np.asarray(answers * denser)


def by_load(
    harvester: Harvester, loads: Real, vibration: Vibration, *, peaks: bool = True
) -> tuple[Real, Real]:
    """Mean power [W], shape (loads,), and peaks, shape (4, loads), under samples if there are any.

    Otherwise from lines or a spectrum, with peaks as `OUTPUTS` has them: the largest sum over lines
    while they wander together, or the crest of the vibration times the rms if that is less, as it
    always is for the bins of a spectrum; 0 where they are not asked for, which takes a quarter of
    the time.
    """
    if len(vibration.samples_ms2):
        heard = [answer(harvester.with_load(load), vibration) for load in loads]
        return np.array([a.power_w for a in heard]), np.array([a.peaks for a in heard]).T
    frequency, weights = vibration.nodes(harvester.damping_ratio)
    answers = np.abs(harvester.transfer(loads, frequency.ravel(), 4 if peaks else 1))
    weights = (weights * vibration.mean_square_m2s4 * np.ones_like(frequency)).ravel()
    power = answers[0] ** 2 @ weights
    if not peaks:
        return power, np.zeros((4, len(loads)))
    answers = answers.reshape(4, len(loads), *frequency.shape)
    away = np.abs(frequency[:, 0] / vibration.frequency_hz[0] - 1)
    near = answers[..., away <= PEAK_REACH * vibration.wander + 1e-12, :]
    peak = vibration.crest * np.sqrt(near**2 @ vibration.mean_square_m2s4)
    if vibration.resolution_hz == 0:
        peak = np.minimum(peak, near @ vibration.amplitude_ms2)
    return power, np.asarray(peak.max(axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Tuned(Result, Generic[H]):
    """A harvester at its best.

    Attributes
    ----------
    harvester : Harvester
        Tuned, with its load.
    duty : tuple of OperatingShare
        What shakes it.
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
    duty: Points
    power_w: float
    answers: tuple[Answer, ...]
    static_travel_m: float
    static_stress_pa: float
    travel_share: float
    stress_share: float
    rivals_hz: tuple[float, ...] = ()

    @property
    def over(self) -> float:
        """Largest peak over its limit."""
        return max(self.travel_share, self.stress_share)

    @property
    def within_limits(self) -> bool:
        """Whether travel and stress stay within their limits."""
        return self.over <= 1 + 1e-9

    def to_dict(self) -> dict[str, Any]:
        """Return values in built-in types; the band is null where there is none."""
        peaks = ("travel_m", "stress_pa", "voltage_v")
        told = {name: max(getattr(a, name) for a in self.answers) for name in peaks}
        own = ("power_w", "static_travel_m", "static_stress_pa", "travel_share", "stress_share")
        told |= {name: getattr(self, name) for name in own} | {"half_power_band": None}
        with suppress(ArgumentError):  # so heavily loaded that there is none
            told["half_power_band"] = half_power_band(self.harvester)
        return told | {
            "harvester": self.harvester.to_dict(),
            "operating_points": [point.vibration.name for point in self.duty],
            "power_by_operating_point_w": [a.power_w for a in self.answers],
            "peaks_half_and_99_percent_of_steps": [a.quantiles for a in self.answers],
        }


def _limits(harvester: Harvester) -> tuple[Real, Real]:
    """Travel and both stresses from the harvester's own weight, and what they may be."""
    at_rest = harvester.transfer(np.array([harvester.load]), np.zeros(1))[1:, 0, 0]
    limits = (harvester.clearance_m, harvester.stress_limit_pa, harvester.stress_limit_pa)
    return abs(harvester.weight_ms2) * np.abs(at_rest), np.array(limits)


def evaluate(harvester: H, duty: Shaking) -> Tuned[H]:
    """Tell what a harvester yields over a duty cycle as it stands, and how near its limits.

    Parameters
    ----------
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever
    duty : Vibration, Signature, OperatingShare, or sequence of OperatingShare
        What shakes it.

    Returns
    -------
    Tuned
        The harvester unchanged, its mean power [W], and its peaks over their limits.

    Raises
    ------
    ArgumentError
        If the duty cycle is empty, or its shares sum to more than 1.
    """
    points = check_duty(duty)
    answers = tuple(answer(harvester, point.vibration) for point in points)
    static, limits = _limits(harvester)
    travel, *stress = (static + np.max([a.peaks[1:] for a in answers], axis=0)) / limits
    return Tuned(
        harvester=harvester,
        duty=points,
        power_w=math.fsum(p.share * a.power_w for p, a in zip(points, answers, strict=True)),
        answers=answers,
        static_travel_m=float(static[0]),
        static_stress_pa=float(static[1:].max()),
        travel_share=float(travel),
        stress_share=float(max(stress)),
    )


def powers_and_shares(
    harvester: Harvester, points: Points, loads: Real, *, limited: bool = True
) -> tuple[Real, Real]:
    """Power of each point, shape (points, loads), and the largest peak over its limit, (loads,).

    The latter is 0 where limits do not count.
    """
    told = [by_load(harvester, loads, p.vibration, peaks=limited) for p in points]
    powers, peaks = (np.array(column) for column in zip(*told, strict=True))
    if not limited:
        return powers, np.zeros(len(loads))
    static, limits = _limits(harvester)
    over = (peaks.max(axis=0)[1:] + static[:, None]) / limits[:, None]
    return powers, over.max(axis=0)


def mean_power_w(harvester: Harvester, points: Points, loads: Real) -> Real:
    """Mean power over a duty cycle from lines or spectra [W], shape (loads,)."""
    powers = (p.share * by_load(harvester, loads, p.vibration, peaks=False)[0] for p in points)
    return sum(powers, np.zeros(len(loads)))


class Scatter(NamedTuple):
    """How well a mean over time is known.

    Attributes
    ----------
    mean, variance : float
        Of the steps, and of their mean as an estimate of the long-run one.
    freedom : float
        Degrees of freedom of that variance.
    stretches : float
        Independent stretches that the time holds.
    blocks : int
        Blocks of operation that the mean is one of; 0 for a mean over time.
    """

    mean: float
    variance: float
    freedom: float
    stretches: float
    blocks: int = 0


def scatter_of_mean(steps: Real) -> Scatter:
    """Scatter of the mean of a stationary series, whose steps hang together.

    The long-run variance is the mean square of the lowest cosine sums of the series, each nearly
    independent of the others, so that the mean over its root follows Student's t (U. K. Mueller,
    J. Econometrics 141 (2007) 1331-1352). How many may be taken follows from the time over which
    the series is forgotten, by the first autocorrelations that are positive in pairs (C. J. Geyer,
    Statist. Sci. 7 (1992) 473-483). If that is exponential with the time T, the spectrum falls as
    1/(1 + x^2), x = 2 pi f T, and its mean up to there is the share atan(x)/x of what it is at 0.

    Parameters
    ----------
    steps : array, shape (n,)
    """
    count = len(steps)
    stretches = count / _memory(steps)
    weights = max(2, int(min(WEIGHTS_A_STRETCH * stretches, MOST_WEIGHTS, count / 4)))
    sums = scipy.fft.dct(steps - steps.mean())[1 : weights + 1] / math.sqrt(2 * count)
    fallen = math.pi * weights / (2 * stretches)
    variance = float(np.mean(sums**2)) / count * fallen / math.atan(fallen)
    return Scatter(float(steps.mean()), variance, weights, stretches)


def _memory(steps: Real) -> float:
    """Time over which the slow part of a series is forgotten [steps], >= 1.

    Twice the sum of its autocorrelation, over that at the first lag: what changes from step to step
    by chance is no part of it, and would make it look shorter.
    """
    count, own = len(steps), steps - steps.mean()
    correlation = scipy.signal.correlate(own, own)[count - 1 :][: count // 2 * 2 + 1]
    first = correlation[1]
    # two standard deviations of the first one without any memory
    if first <= 2 / math.sqrt(count) * correlation[0]:
        return 1.0
    pairs = correlation[1:-1:2] + correlation[2::2]
    kept = pairs[: np.flatnonzero(np.append(pairs, 0.0) <= 0)[0]]
    return max(1.0, 1 + 2 * float(np.minimum.accumulate(kept).sum() / first))


def combined(parts: Sequence[Scatter], shares: Sequence[float], share_error: float) -> Scatter:
    """Scatter of a mean over operating points that have shares of the time.

    Parameters
    ----------
    parts : sequence of Scatter
    shares : sequence of float
    share_error : float, >= 0
        Standard deviation of every share, that of standing still included.
    """
    weights = np.asarray(shares, dtype=np.float64)
    means, variances, freedoms, stretches, _ = np.array(parts).T
    own = weights**2 * variances
    # shares err so that their sum stays 1, that of standing still included
    powers = np.append(means, 0.0) if 1 - weights.sum() > 1e-6 else means
    many = len(powers)
    by_share = share_error**2 * float(powers.var()) * many**2 / max(many - 1, 1)
    variance, spread = float(own.sum()) + by_share, float((own**2 / freedoms).sum())
    # Welch and Satterthwaite; the shares' own error counts as known
    freedom = variance**2 / spread if spread > 0 else math.inf
    return Scatter(float(weights @ means), variance, freedom, float(stretches.min()))


def between(means: Sequence[float]) -> Scatter:
    """Scatter of a mean over blocks of operation that are a sample of all operation.

    Parameters
    ----------
    means : sequence of float, two or more
        Of each block.
    """
    known = np.asarray(means, dtype=np.float64)
    count, variance = len(known), float(known.var(ddof=1)) / len(known)
    return Scatter(float(known.mean()), variance, count - 1, float(count), count)


def interval_90(scatter: Scatter) -> tuple[float, float]:
    """90 % interval of a mean that is above 0, by Student's t on its logarithm.

    Of blocks of operation the quantiles are those of a parametric bootstrap-t: few skewed powers
    that happen to be low show too little scatter as well, so that t lies below the truth too often.
    As many are drawn as there are, lognormal, for levels in dB scatter nearly normally (B. Efron
    and R. Tibshirani, An Introduction to the Bootstrap, 1993, sections 6.5 and 12.5). Their true
    scatter is not the one found: each draw takes another, which the found one allows by its
    chi-square (the fiducial draws of K. Krishnamoorthy and T. Mathew, J. Stat. Plann. Inference 115
    (2003) 103-121). The found one is that of the mean, not of the logarithms, which a block of
    standing still would throw off. Of two kinds of operation with few blocks of the quieter one it
    holds less often (81 % of 300 days of ten blocks, three idle ones in the mean at a sixth of the
    power): a duty cycle that is known should be given by its shares.

    Parameters
    ----------
    scatter : Scatter
    """
    if scatter.mean <= 0:
        return math.nan, math.nan
    relative = scatter.variance / scatter.mean**2
    ends = scipy.stats.t.ppf([0.05, 0.95], scatter.freedom)
    if scatter.blocks:
        rng, found = np.random.default_rng(0), math.log1p(max(relative * scatter.blocks, 1e-12))
        logs = found * scatter.freedom / rng.chisquare(scatter.freedom, (DRAWN, 1))
        drawn = np.exp(np.sqrt(logs) * rng.normal(size=(DRAWN, scatter.blocks)) - logs / 2)
        mean, error = drawn.mean(axis=1), drawn.var(axis=1, ddof=1) / scatter.blocks
        ends = np.quantile(np.log(mean) / np.sqrt(np.log1p(error / mean**2)), [0.05, 0.95])
    # the logarithm of a mean of few, skewed powers is nearer to normal than the mean
    high, low = scatter.mean * np.exp(-ends * math.sqrt(math.log1p(relative)))
    return float(low), float(high)


def power_with_stops(harvester: Harvester, samples_ms2: Real, sampling_rate_hz: float) -> float:
    """Mean power [W] of the first mode of a harvester whose mass hits a stop on either side.

    Marched step by step, exactly for the mean acceleration of a step; at the end of its clearance,
    within the step, the mass turns with a share of its speed, `harvester.restitution`, which should
    be measured. Where the mass stays within the clearance this is the linear answer.

    Parameters
    ----------
    harvester : Harvester
        Its clearance, restitution and weight count.
    samples_ms2 : array, shape (n,)
        Acceleration of the base; of a long recording only the start is marched.
    sampling_rate_hz : float, > 0

    Returns
    -------
    float
        Mean power [W], once what the unknown past left has died away.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """
    rate = check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    denser = math.ceil(STRIKE_STEPS * harvester.natural_frequency_hz / rate)
    kept = np.asarray(samples_ms2)[: MOST_STRIKE_STEPS // denser]
    push = scipy.signal.resample(kept, denser * len(kept)) + harvester.weight_ms2
    power = _marched(harvester, push, denser * rate)
    settled = round(SETTLED * harvester.settling_s * denser * rate)
    return float(power[min(settled, len(power) // 2) :].mean())


def _marched(harvester: Harvester, push: Real, rate: float) -> Real:
    """Power at every step of the first mode; with no store u follows the velocity."""
    limit, kept, modes = harvester.clearance_m, harvester.restitution, harvester.modes
    leak, worth = harvester.circuit(harvester.load)
    drive = float(modes.rows[0, 0] / modes.rows[1, 0])
    # the modes above follow at once
    store = modes.store + float(np.sum((modes.rows[0] / modes.natural_rad_s)[1:] ** 2))
    natural, back = modes.natural_rad_s[0], modes.rows[0, 0] * modes.rows[1, 0]
    lost, force = 2 * modes.damping_ratio[0] * natural, -modes.forcing[0] * modes.rows[1, 0]
    rates = np.array([[0.0, 1.0, 0.0], [-(natural**2), -lost, -back], [0.0, drive, -leak]])
    if store > 0:
        rates[2] /= store
    else:
        rates[1:, 1:] = (-lost - back * drive / leak, 0.0), (0.0, 0.0)
    system = rates, np.array([[0.0], [force], [0.0]]), np.eye(3), np.zeros((3, 1))
    step, pushed, *_ = scipy.signal.cont2discrete(system, 1 / rate)
    (a, b, c), (d, e, f), (g, h, i) = step.tolist()
    p, q, r = pushed[:, 0].tolist()
    x = v = u = 0.0
    out = np.empty(len(push) - 1)
    for number, now in enumerate(((push[1:] + push[:-1]) / 2).tolist()):
        before = v
        x, v, u = (
            a * x + b * v + c * u + p * now,
            d * x + e * v + f * u + q * now,
            g * x + h * v + i * u + r * now,
        )
        if abs(x) > limit and x * v > 0:
            # the blow fell within the step: what is beyond it, of way and of speed, is put back
            beyond = x - math.copysign(limit, x)
            gained = (v - before) * min(beyond / v * rate, 1.0)
            x, v = x - (1 + kept) * beyond, gained - kept * (v - gained)
        out[number] = u if store > 0 else v * drive / leak
    return np.asarray((worth * out) ** 2)


#: Degrees Celsius at which parts are measured, and the age from which tenfolds count [years].
REFERENCE_C, FIRST_YEARS = 20.0, 1.0 / 365.0


@dataclass(frozen=True, kw_only=True)
class SensorBudget(Checked):
    """Energy that one recording takes, from sampling to sending it, and what is lost on the way.

    The defaults are round figures of a battery-free node with a low-power radio: 12 bit at 10 kHz
    for 10 s, a front end and processor of 3 mW while they record, 100 nJ for each bit sent (radio
    and protocol), 5 uW asleep, a converter that passes 70 % at microwatts: replace them by those of
    the parts chosen. Two Schottky diodes of a bridge take 0.6 V: at most 0.24 V each at 0.1 mA and
    0.32 V at 1 mA (BAT54, alike in the data sheets of its makers). What else depends on the parts
    counts as nothing until it is given.

    Parameters
    ----------
    duration_s, sampling_rate_hz : float, > 0
        Of one recording.
    bits : int, 1 to 64
        Of a sample.
    recording_power_w, sleep_power_w : float, >= 0
        While it records; all the time [W].
    energy_per_bit_j : float, >= 0
        To send a bit [J].
    efficiency : float, > 0 and <= 1
        Share of the power that the converter passes.
    rectifier_drop_v : float, >= 0
        Of all diodes in series [V].
    regulator : {"tracking", "none"}
        Whether the maximum power point is tracked.
    quiescent_power_w : float, >= 0
        What the regulator takes [W].
    store_f, store_v : float, > 0
        Capacitance and voltage of the store [F], [V].
    leakage_a : float, >= 0
        Of the store [A].
    cold_start_v : float, >= 0
        Rectified voltage at which the regulator starts from nothing [V].
    temperature_c : float, -60 to 200
    loss_per_k : float, 0 to 0.05
        Share of the power that is lost for each degree from 20 degrees C.
    years, loss_per_decade : float, >= 0
        Age, and share of the power that is lost with each tenfold of it from the first day on.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    duration_s: float = within(0, 1e6, "s", open_low=True, default=10.0)
    sampling_rate_hz: float = within(0, 1e7, "Hz", open_low=True, default=10_000.0)
    bits: int = held(Count(low=1, high=64), 12)
    recording_power_w: float = within(0, 1e3, "W", default=3e-3)
    energy_per_bit_j: float = within(0, 1, "J", default=100e-9)
    sleep_power_w: float = within(0, 1e3, "W", default=5e-6)
    efficiency: float = within(0, 1, open_low=True, default=0.7)
    rectifier_drop_v: float = within(0, 100, "V", default=0.6)
    regulator: str = held(Choice(options=("tracking", "none")), "tracking")
    quiescent_power_w: float = within(0, 1e3, "W", default=0.0)
    store_f: float = within(0, 1e4, "F", open_low=True, default=1e-3)
    store_v: float = within(0, 1e3, "V", open_low=True, default=3.0)
    leakage_a: float = within(0, 1, "A", default=0.0)
    cold_start_v: float = within(0, 1e3, "V", default=0.0)
    temperature_c: float = within(-60, 200, "degrees C", default=REFERENCE_C)
    loss_per_k: float = within(0, 0.05, "1/K", default=0.0)
    years: float = within(0, 100, "years", default=0.0)
    loss_per_decade: float = within(0, 0.5, default=0.0)

    @property
    def energy_j(self) -> float:
        """Of one recording, made and sent [J]."""
        sent = self.duration_s * self.sampling_rate_hz * self.bits * self.energy_per_bit_j
        return self.duration_s * self.recording_power_w + sent

    @property
    def constant_power_w(self) -> float:
        """What is taken all the time: sleep, regulator and leakage [W]."""
        return self.sleep_power_w + self.quiescent_power_w + self.leakage_a * self.store_v

    @property
    def kept_share(self) -> float:
        """What temperature and age leave of the power."""
        decades = math.log10(max(self.years / FIRST_YEARS, 1.0))
        warm = 1 - self.loss_per_k * abs(self.temperature_c - REFERENCE_C)
        return max(0.0, warm * (1 - self.loss_per_decade * decades))

    def interval_s(self, power_w: float) -> float:
        """Time between recordings that a mean rectified power allows [s]; infinite if none.

        Parameters
        ----------
        power_w : float, >= 0
            Electrical, behind the rectifier.
        """
        left = self.efficiency * power_w - self.constant_power_w
        return max(self.duration_s, self.energy_j / left) if left > 0 else math.inf

    def rectified_w(self, power_w: npt.ArrayLike, load_ohm: float) -> Real:
        """Power behind rectifier (and store, without a regulator) of sines of several powers [W].

        Parameters
        ----------
        power_w : array, >= 0
            In the load.
        load_ohm : float
            NaN where there is no circuit: then nothing is lost here.
        """
        power = self.kept_share * np.asarray(power_w, dtype=np.float64)
        if math.isnan(load_ohm):
            return power
        amplitude = np.maximum(np.sqrt(2 * power * load_ohm), 1e-300)
        if self.regulator == "none":
            held = self.store_v + self.rectifier_drop_v
            share = np.minimum(held / (2 * amplitude), 1.0)
            return np.asarray(power * 4 * share * (1 - share) * self.store_v / held)
        dead = np.minimum(self.rectifier_drop_v / amplitude, 1.0)
        lost = np.arcsin(dead) + dead * np.sqrt(1 - dead**2)
        return np.asarray(power * (1 - 2 / math.pi * lost))

    def supply(self, tuned: Tuned[Any], steps_w: Sequence[Real]) -> dict[str, Any]:
        """Follow the power of a tuned harvester over a duty cycle to the sensor.

        Parameters
        ----------
        tuned : Tuned
        steps_w : sequence of ndarray, shape (n,)
            Steps of the power at every operating point [W], the duty cycle's own or others.

        Returns
        -------
        dict
            harvested_w, rectified_w, regulated_w, constant_w, left_w, interval_s (None if
            infinite), starts (whether the cold start is reached) and charging_s (of the empty
            store; None if never).
        """
        load, shares = tuned.harvester.resistance_ohm, [point.share for point in tuned.duty]
        rectified = float(np.dot(shares, [self.rectified_w(own, load).mean() for own in steps_w]))
        volts = math.sqrt(2 * self.kept_share * max(float(own.max()) for own in steps_w) * load)
        starts = not volts - self.rectifier_drop_v < self.cold_start_v
        interval = self.interval_s(rectified) if starts else math.inf
        regulated = self.efficiency * rectified
        left = regulated - self.constant_power_w
        spare = left + self.sleep_power_w
        charging = 0.5 * self.store_f * self.store_v**2 / spare if starts and spare > 0 else None
        return {
            "harvested_w": float(np.dot(shares, [own.mean() for own in steps_w])),
            "rectified_w": rectified,
            "regulated_w": regulated,
            "constant_w": self.constant_power_w,
            "left_w": left,
            "interval_s": interval if math.isfinite(interval) else None,
            "starts": starts,
            "charging_s": charging,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return all values, and the energy of a recording, in built-in types."""
        return asdict(self) | {"energy_per_recording_j": self.energy_j}
