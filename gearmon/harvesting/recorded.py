"""What a harvester makes of a recording: power, peaks, scatter of the mean, blows at its stops.

A harvester is linear, so that its answers are the recording through its filter, block by block in
the frequency domain: exact for what the recording holds, lines and noise alike, steady or not. The
power needs no spectrum, no line and no window; its mean over the recording is the mean over time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_positive
from gearmon.harvesting.harvester import Harvester, Oscillator, settling_s

Real = npt.NDArray[np.float64]

#: Time constants of the ring-down that are let pass before anything counts: what the unknown past
#: left has fallen to 1/150 then.
SETTLED = 5.0
#: A recording shorter than so many time constants tells nothing.
SHORTEST = 4.0
#: Length of a block of samples, and what is lower than this is drift of the sensor [Hz].
BLOCK, DRIFT_HZ = 1 << 16, 2.0
#: The power is kept as means over this time [s], at least so many of them.
STEP_S, FEWEST_STEPS = 0.05, 64
#: Samples are set so many times denser where a peak is looked for.
DENSER = 8
#: Cosine weights of the long-run variance for each independent stretch: the spectrum of a power
#: that is forgotten exponentially has then fallen by less than a twentieth over them.
WEIGHTS_A_STRETCH, MOST_WEIGHTS = 0.2, 40
#: Fewer independent stretches give no interval.
FEWEST_STRETCHES = 8.0
#: Steps of a natural period while the mass may hit its stops, and the most that are taken.
STRIKE_STEPS, MOST_STRIKE_STEPS = 60, 2_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Of one harvester to one recording.

    Attributes
    ----------
    power_w : float
        Mean electrical power [W], the settling time left out.
    power_steps_w : ndarray, shape (n,)
        Means over steps of some 0.05 s.
    peaks : ndarray, shape (4,)
        Largest sizes of root of power, travel and both stresses, see `harvester.OUTPUTS`.
    step_peaks : ndarray, shape (4, n)
        Those of each step, between samples not looked for.
    step_s : float
        Length of a step [s].
    """

    power_w: float
    power_steps_w: Real
    peaks: Real
    step_peaks: Real
    step_s: float


def respond(harvester: Harvester, samples_ms2: Real, sampling_rate_hz: float) -> Response:
    """Send a recording through a harvester.

    Parameters
    ----------
    harvester : Harvester
    samples_ms2 : ndarray, shape (n,)
        Acceleration of the base without its mean [m/s2].
    sampling_rate_hz : float, > 0

    Raises
    ------
    ArgumentError
        If the recording is too short for the ring-down.
    """
    lead = _lead(harvester, len(samples_ms2), sampling_rate_hz)
    left = len(samples_ms2) - lead
    step = max(1, min(round(STEP_S * sampling_rate_hz), left // FEWEST_STEPS))
    power, peaks = [], []
    for rows in _blocks(harvester, samples_ms2, sampling_rate_hz, lead, step):
        steps = np.abs(rows).reshape(len(rows), -1, step)
        power.append(np.mean(steps[0] ** 2, axis=-1))
        peaks.append(steps.max(axis=-1))
    found, highest = np.concatenate(power), np.concatenate(peaks, axis=1)
    about = lead + step * np.argmax(highest, axis=1)
    denser = [
        _peak_near(harvester, samples_ms2, sampling_rate_hz, row, int(start), lead, step)
        for row, start in enumerate(about)
    ]
    return Response(
        power_w=float(found.mean()),
        power_steps_w=found,
        peaks=np.maximum(denser, highest.max(axis=1)),
        step_peaks=highest,
        step_s=step / sampling_rate_hz,
    )


def _lead(harvester: Harvester, count: int, rate: float) -> int:
    """Count the samples that are left out at the start."""
    settling = settling_s(harvester)
    if count / rate < SHORTEST * settling:
        raise ArgumentError(
            f"a recording of {count / rate:.3g} s is too short for a ring-down of {settling:.3g} "
            f"s; record at least {2 * SETTLED * settling:.3g} s in one piece"
        )
    return min(math.ceil(SETTLED * settling * rate), count // 2)


def _transfer(harvester: Harvester, length: int, rate: float) -> npt.NDArray[np.complex128]:
    frequency: Real = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)
    found = harvester.transfer(np.array([harvester.load]), frequency)[:, 0]
    found[:, frequency < DRIFT_HZ] = 0.0
    return found


def _blocks(
    harvester: Harvester, samples: Real, rate: float, lead: int, step: int
) -> Iterator[Real]:
    """Yield the answers in whole steps after the lead; each block is led in by the samples before.

    The transform takes a block for periodic: that is forgotten within the lead.
    """
    from scipy.fft import irfft, rfft

    whole = (len(samples) - lead) // step * step
    taken = min(whole, max(1, max(BLOCK, 3 * lead) // step) * step)
    filtering = _transfer(harvester, lead + taken, rate)
    for start in range(0, whole, taken):
        # the last block reaches back, for its length to be that of the others
        begin = min(start, whole - taken)
        block = rfft(samples[begin : begin + lead + taken])
        yield irfft(filtering * block, lead + taken)[:, lead + start - begin :]


def _peak_near(
    harvester: Harvester, samples: Real, rate: float, row: int, start: int, lead: int, step: int
) -> float:
    """Largest size of an answer within a step, between the samples as well."""
    from scipy.fft import irfft, rfft

    # room behind: the transform takes the block for periodic
    end = min(len(samples), start + step + min(lead, 64))
    block = samples[start - lead : end]
    answer = _transfer(harvester, len(block), rate)[row] * rfft(block)
    dense = irfft(answer, DENSER * len(block)) * DENSER
    return float(np.abs(dense[DENSER * lead : DENSER * (lead + step)]).max())


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """How well a mean over time is known.

    Attributes
    ----------
    mean, variance : float
        Of the steps, and of their mean as an estimate of the long-run one.
    freedom : float
        Degrees of freedom of that variance.
    stretches : float
        Independent stretches that the time holds.
    """

    mean: float
    variance: float
    freedom: float
    stretches: float


def scatter_of_mean(steps: Real) -> Scatter:
    """Scatter of the mean of a stationary series, whose steps hang together.

    The long-run variance is the mean square of the lowest cosine sums of the series, each nearly
    independent of the others, so that the mean over its root follows Student's t (U. K. Mueller,
    J. Econometrics 141 (2007) 1331-1352). How many may be taken follows from the time over which
    the series is forgotten, by the first autocorrelations that are positive in pairs (C. J. Geyer,
    Statist. Sci. 7 (1992) 473-483).

    Parameters
    ----------
    steps : array, shape (n,)
    """
    from scipy.fft import dct

    count = len(steps)
    stretches = count / _memory(steps)
    weights = int(min(WEIGHTS_A_STRETCH * stretches, MOST_WEIGHTS, count / 4))
    weights = max(weights, 2)
    sums = dct(steps - steps.mean())[1 : weights + 1] / math.sqrt(2 * count)
    variance = float(np.mean(sums**2)) / count
    return Scatter(
        mean=float(steps.mean()), variance=variance, freedom=float(weights), stretches=stretches
    )


def _memory(steps: Real) -> float:
    """Time over which the slow part of a series is forgotten [steps], >= 1.

    Twice the sum of its autocorrelation, over that at the first lag: what changes from step to step
    by chance is no part of it, and would make it look shorter.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    count = len(steps)
    length = next_fast_len(2 * count, real=True)
    spectrum = np.abs(rfft(steps - steps.mean(), length)) ** 2
    correlation = irfft(spectrum, length)[: count // 2 * 2 + 1]
    first = correlation[1]
    # two standard deviations of the first one without any memory
    if first <= 2 / math.sqrt(count) * correlation[0]:
        return 1.0
    pairs = correlation[1:-1:2] + correlation[2::2]
    negative = np.flatnonzero(pairs <= 0)
    kept = pairs[: negative[0]] if len(negative) else pairs
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
    means = np.array([part.mean for part in parts])
    own = weights**2 * np.array([part.variance for part in parts])
    still = 1 - weights.sum() > 1e-6
    powers = np.append(means, 0.0) if still else means
    # shares err so that their sum stays 1
    by_share = 0.0
    if len(powers) > 1:
        by_share = share_error**2 * float(powers.var(ddof=0)) * len(powers) ** 2
        by_share /= len(powers) - 1
    spread = float((own**2 / np.array([part.freedom for part in parts])).sum())
    variance = float(own.sum()) + by_share
    return Scatter(
        mean=float(weights @ means),
        variance=variance,
        # Welch and Satterthwaite; the shares' own error counts as known
        freedom=variance**2 / spread if spread > 0 else math.inf,
        stretches=min(part.stretches for part in parts),
    )


def between(means: Sequence[float]) -> Scatter:
    """Scatter of a mean over blocks of operation that are a sample of all operation.

    Parameters
    ----------
    means : sequence of float, two or more
        Of each block.
    """
    known = np.asarray(means, dtype=np.float64)
    return Scatter(
        mean=float(known.mean()),
        variance=float(known.var(ddof=1)) / len(known),
        freedom=len(known) - 1.0,
        stretches=float(len(known)),
    )


def interval_90(scatter: Scatter) -> tuple[float, float]:
    """90 % interval of a mean that is above 0, by Student's t on its logarithm.

    Parameters
    ----------
    scatter : Scatter
    """
    from scipy.stats import t as student_t

    if scatter.mean <= 0:
        return math.nan, math.nan
    quantile = float(student_t.ppf(0.95, scatter.freedom))
    # the logarithm of a mean of few, skewed powers is nearer to normal than the mean
    half = quantile * math.sqrt(math.log1p(scatter.variance / scatter.mean**2))
    return scatter.mean * math.exp(-half), scatter.mean * math.exp(half)


def power_with_stops(harvester: Harvester, samples_ms2: Real, sampling_rate_hz: float) -> float:
    """Mean power [W] of the first mode of a harvester whose mass hits a stop on either side.

    Marched step by step, exactly between two steps for an acceleration that is straight there; at
    the end of its clearance the mass turns with a share of its speed, `harvester.restitution`,
    which should be measured. Where the mass stays within the clearance this is the linear answer.

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
        [W].

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """
    from scipy.signal import resample

    rate = check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    denser = math.ceil(STRIKE_STEPS * harvester.natural_frequency_hz / rate)
    kept = np.asarray(samples_ms2)[: MOST_STRIKE_STEPS // denser]
    push = resample(kept, denser * len(kept)) + harvester.weight_ms2
    power = _marched(harvester, push, denser * rate)
    settled = round(SETTLED * settling_s(harvester) * denser * rate)
    return float(power[min(settled, len(power) // 2) :].mean())


def _marched(harvester: Harvester, push: Real, rate: float) -> Real:
    """Power at every step; with no store what stands for the voltage follows the velocity."""
    mode, limit, kept = harvester.single_mode(), harvester.clearance_m, harvester.restitution
    stored = mode.store > 0
    (a, b, c, p, q), (d, e, f, r, s), (g, h, i, t, w) = _step(mode, 1 / rate).tolist()
    x = v = u = 0.0
    out = np.empty(len(push) - 1)
    for number, (now, then) in enumerate(zip(push.tolist(), push[1:].tolist(), strict=False)):
        x, v, u = (
            a * x + b * v + c * u + p * now + q * then,
            d * x + e * v + f * u + r * now + s * then,
            g * x + h * v + i * u + t * now + w * then,
        )
        if (x > limit and v > 0) or (x < -limit and v < 0):
            x, v = math.copysign(limit, x), -kept * v
        out[number] = u if stored else v
    return mode.worth * (out if stored else out * mode.drive / mode.leak) ** 2


def _step(mode: Oscillator, step_s: float) -> Real:
    """Map of travel, velocity, voltage and two accelerations to the next three, shape (3, 5)."""
    from scipy.linalg import expm

    w, heat = mode.natural_rad_s, 2 * mode.damping_ratio * mode.natural_rad_s
    rates = np.zeros((5, 5))
    rates[0, 1], rates[1, :3] = 1.0, (-(w**2), -heat, -mode.back)
    if mode.store > 0:
        rates[2, 1:3] = mode.drive / mode.store, -mode.leak / mode.store
    else:
        rates[1, 1:3] = -heat - mode.back * mode.drive / mode.leak, 0.0
    # the acceleration and its change over the step
    rates[1, 3], rates[3, 4] = -mode.push, 1 / step_s
    whole = expm(rates * step_s)[:3]
    return np.column_stack([whole[:, :3], whole[:, 3] - whole[:, 4], whole[:, 4]])
