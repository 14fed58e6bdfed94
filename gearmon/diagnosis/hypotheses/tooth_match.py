"""Matched detection: how well damage on each tooth explains what is left of a gear's pattern.

The expected lines of a loss on tooth j, T_n exp(-2 pi i n (j - 1)/z), pass an unknown path to the
sensor. Its mean power about each mesh harmonic is calibrated by the mesh harmonics of the same
recording; its course between the lines is not known and is taken as that of a reverberant body: a
Gaussian process whose impulse response decays exponentially,

    E[H(f) H*(f')] = P / (1 + 2 pi i (f - f') tau).

The rest of the pattern is then Gaussian under either hypothesis, and the logarithm of the ratio of
their likelihoods is a weighted energy: of the departure at this tooth and shortly after it, bands
and channels weighted by what they should hear of it. Averaged over decay times, losses and teeth
(all held equally likely) it is a Bayes factor, which a healthy gear exceeds by a factor x with a
probability of at most 1/x.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.diagnosis.law.gear_lines import LEAST_MISFIT, STEPS, GearDeviation
from gearmon.signatures.expected.tooth_response import ToothResponse

# Decay times of the energy in a housing [s]: damping ratios of 1 to 6 per cent between 700 Hz and
# 7 kHz have 1/(4 pi zeta f) of 0.2 to 10 ms, the loudest modes being the better damped ones.
DECAY_S = (0.0002, 0.0006, 0.002)
# Losses that are tried: a factor of 1.19 apart.
LOSSES = np.geomspace(0.005, 0.9, 31)
# Losses that are held possible before the recording is heard.
_LEAST_LOSS, _LARGEST_LOSS = 0.01, 0.7
# Standard deviations of the logarithm of the path's amplitude about one mesh harmonic: of lines so
# far apart that the path is another one, logarithms of three complex Gaussian values, weighted as
# in `path_power`, leave 0.39 (0.64 each); the expected harmonics less than that beside it. Of 30 %
# of one tooth of a final drive whose mesh harmonics stand 47 Hz apart (three drawn machines, one
# and three references) sun, planet and ring are told 0.97, 0.94 and 0.87 of it, with the deviation
# of far lines 0.89, 0.89 and 0.80 on five.
_PATH_DEVIATION, _TOLD_DEVIATION = 0.39, 0.22
# Points a mesh period at which the decaying impulse response is taken, how far, and at most.
_POINTS, _REACH, _MOST_POINTS = 2.0, 3.0, 40
# Share of a departure's mean square that counts as noise, since even the right tooth does not
# explain all of it: when damage is looked for, and when one tooth is held against its neighbours.
# Those differ in detail, and in detail the model is wrong: however strong a departure, it then
# tells the place no better than one that just stands out of the noise.
SEARCH_MISFIT, PLACE_MISFIT = 0.3, 1.0
# Where logarithms of likelihoods are cut off, below the largest.
_FAR_BELOW = -600.0
# Numbers that are worked on at once.
_TOGETHER = 1 << 21
# Share of the teeth that are taken for sound.
_MOST_TEETH = 0.8
# Share of the signal's energy in directions that are not worth looking at.
_LEFT_OUT = 0.01

# Probability that each tooth met by a damaged one of a faster gear stands out too, where one does:
# of 12 cracks of 30 % of a pinion that meets three teeth (six lightly loaded machines, one or three
# references) 20 of the 24 others do, of 8 such cracks of the gear none.
_MEETS_AGAIN = 0.8


class SearchedGear:
    """How well damage on each tooth of a gear explains its departure.

    Parameters
    ----------
    difference : GearDeviation
        The departure.
    response : ToothResponse
        Expected lines of the gear.
    speed_hz : float
        Speed of shaft 1 [Hz].
    heard : sequence of tuple of ndarray
        What departs in each band and channel, see `_heard`; at least one.

    Attributes
    ----------
    rotation_hz : float
        Turns of the gear a second.
    delays : list of ndarray of float
        When events are heard, for each of `DECAY_S`, see `event_delays` [s].
    log_likelihood : ndarray of float, shape (losses, teeth)
        Logarithm of the likelihood of each of `LOSSES` on each tooth over that of no damage.
    log_place : ndarray of float, shape (teeth,)
        Logarithm of the likelihood of each tooth if one is damaged, up to a constant: the same with
        more of the departure held for noise, see `PLACE_MISFIT`.
    expected : ndarray of float, shape (losses,)
        What the first would be on average at a tooth that has lost as much.
    stands_out : ndarray of float, shape (losses,)
        The same if nothing of the damage itself counted as noise: as its energy grows.
    matched : ndarray of float, shape (losses, teeth)
        Energy of the departure about each tooth along what each of `LOSSES` would add, over what is
        expected there.
    matched_peak, directions : ndarray of float, shape (losses,)
        What that would be over the one at sound teeth, on average, at a tooth that has lost as
        much, and the directions that tell of it: 1 / sum of squares of their shares.
    log_tooth : ndarray of float, shape (teeth,)
        Logarithm of the Bayes factor of each tooth.
    log_gear : float
        Logarithm of the Bayes factor of damage on some tooth.
    best : int
        Tooth where damage is most likely if there is any, from 0.
    matched_event : tuple of (float, float)
        Matched energy at that tooth over that of the median, at the likeliest loss, and its
        directions.
    """

    def __init__(
        self, difference: GearDeviation, response: ToothResponse, speed_hz: float, heard: _Heard
    ) -> None:
        self.difference, self.response, self.heard = difference, response, heard
        teeth = difference.teeth
        self.rotation_hz = rotation_hz = difference.order * speed_hz
        self.delays = [event_delays(response, rotation_hz, decay_s) for decay_s in DECAY_S]
        turns = np.exp(2j * np.pi / teeth * np.arange(teeth))
        size, around = response.amplitude(LOSSES), difference.expected_around[::STEPS]
        total, expected = np.zeros((2, len(LOSSES), teeth)), np.zeros((5, len(LOSSES)))
        self.matched, unsure = np.zeros(total.shape[1:]), _unsure_path(rotation_hz * teeth)
        for number, rest, signal, noise in _alike(heard, len(LOSSES) * teeth):
            place = turns[np.arange(teeth)[:, None] * number[:, None] % teeth]
            turned = place * rest[:, None]
            unit = signal[:, :, None]
            roots = (unit * ringing(number * rotation_hz, delay) for delay in self.delays)
            each = [_log_likelihood(turned, number, root, size, around, noise) for root in roots]
            told, mean, energy = zip(*each, strict=True)
            total += _with_unsure_path(log_mean(np.array(told)), unsure).sum(axis=0)
            expected += np.mean(mean, axis=0)
            self.matched += np.mean(energy, axis=0)
        self.log_likelihood, self.log_place = total[0], _any_loss(total[1])
        self.expected, self.stands_out, ratio, weight, squares = expected
        tiny = np.finfo(float).tiny
        self.matched_peak = ratio / np.maximum(weight, tiny)
        self.directions = weight**2 / np.maximum(squares, tiny)
        self.log_tooth = _any_loss(self.log_likelihood)
        self.log_gear = float(log_mean(self.log_tooth[:, None])[0])
        self.best = int(np.argmax(self.log_place))
        likeliest = int(np.argmax(self.log_likelihood.max(axis=1)))
        energy = self.matched[likeliest]
        stands_out = float(energy[self.best]) / max(float(np.median(energy)), tiny)
        self.matched_event = stands_out, float(self.directions[likeliest])

    def log_again(self, times: int) -> float:
        """Logarithm of the Bayes factor of events at equal distances in a turn over one alone.

        Parameters
        ----------
        times : int
            Events a turn; each may be as loud as it likes.
        """
        told = self.log_tooth
        others = np.argmax(told) + np.arange(1, times) * len(told) / times
        nearest = np.array([np.floor(others), np.ceil(others)]).astype(int) % len(told)
        heard = told[nearest].max(axis=0)
        chance = np.log(_MEETS_AGAIN) + heard
        return float(np.logaddexp(chance, np.log1p(-_MEETS_AGAIN)).sum())


def _any_loss(log_likelihood: FloatArray) -> FloatArray:
    """Average over the losses held possible, shape (losses, teeth) to (teeth,)."""
    possible = (LOSSES >= _LEAST_LOSS) & (LOSSES <= _LARGEST_LOSS)
    return log_mean(log_likelihood[possible])


def log_mean(logarithms: FloatArray) -> FloatArray:
    """Logarithm of the mean over the first axis of numbers given by their logarithms."""
    largest = logarithms.max(axis=0)
    return np.asarray(largest + np.log(np.exp(logarithms - largest).mean(axis=0)))


def search_gear(
    difference: GearDeviation, response: ToothResponse, speed_hz: float
) -> SearchedGear | None:
    """Compare the departure of a gear with what damage on each of its teeth should leave.

    Parameters
    ----------
    difference : GearDeviation
        The departure.
    response : ToothResponse
        Expected lines of this gear.
    speed_hz : float
        Speed of shaft 1 [Hz].

    Returns
    -------
    SearchedGear or None
        None if no mesh harmonic calibrates the path.
    """
    path = path_power(difference.mesh_power, response.mesh)
    heard = list(_heard(difference, response, path))
    return SearchedGear(difference, response, speed_hz, heard) if heard else None


_Lines = tuple[NDArray[Any], ...]
_Heard = Sequence[_Lines]


def _heard(deviation: GearDeviation, response: ToothResponse, path: FloatArray) -> Iterator[_Lines]:
    """Numbers of the lines of each band and channel, what departs, and what a unit loss adds.

    Last the share of noise in the variance of what departs.
    """
    for band in deviation.bands:
        inside = band.number < len(response.lines)
        if band.harmonic >= path.shape[1] or not inside.any():
            continue
        number = band.number[inside]
        level = np.sqrt(response.band_power(number, band.side))
        for channel in np.flatnonzero(path[:, band.harmonic] > 0):
            signal = level * np.sqrt(path[channel, band.harmonic])
            unit = band.deviation[channel, inside]
            noise = np.mean((band.noise[channel, inside] / unit) ** 2)
            yield number, band.rest[channel, inside], signal / unit, np.asarray(noise)


def _alike(heard: _Heard, places: int) -> Iterator[_Lines]:
    """Stack those of equally many lines, some at a time; `places` are tried in each."""
    for lines in sorted({len(number) for number, *_ in heard}):
        same = [one for one in heard if len(one[0]) == lines]
        some = max(1, _TOGETHER // (places * lines))
        for first in range(0, len(same), some):
            yield tuple(np.array(a) for a in zip(*same[first : first + some], strict=True))


def path_power(measured: FloatArray, expected: ComplexArray, *, mean: bool = False) -> FloatArray:
    """Power of the path about each mesh harmonic: the typical one, or its mean.

    Parameters
    ----------
    measured : ndarray of float, shape (channels, harmonics)
        |A|^2 of the mesh harmonics 0.. in a recording.
    expected : ndarray of complex, shape (harmonics,)
        The same lines before the path.
    mean : bool
        Whether the mean is wanted, which energies follow, resonances included.

    Returns
    -------
    ndarray of float, shape (channels, harmonics)
        Of a harmonic and its two neighbours, each weighted (1 and 1/2): the geometric mean of
        measured over expected power, since a line that happens to stand on a resonance tells of
        that line and not of those about it; or the sum of measured over the sum of expected power.

    Notes
    -----
    Told by the geometric mean, losses are right in the median (0.9 to 1.05 of the true ones from 5
    to 40 %, 191 losses on 21 machines of the detection benchmark); told by the sums, a quarter too
    small.
    """
    count = min(measured.shape[1], len(expected))
    power, heard = np.abs(expected[:count]) ** 2, measured[:, :count]
    told = (power > 0) & np.all(heard > 0, axis=0) & (np.arange(count) > 0)
    around = _near(np.where(told, power, 0.0))
    if mean:
        result = _near(np.where(told, heard, 0.0)) / np.where(around > 0, around, 1.0)
    else:
        ratio = np.log(np.where(told, heard, 1.0) / np.where(told, power, 1.0))
        result = np.exp(_near(ratio) / np.maximum(_near(told), 0.5))
    return np.where((around > 0) & (np.arange(count) > 0), result, 0.0)


def _near(values: NDArray[Any]) -> FloatArray:
    """Sum of each value and half of its neighbours along the last axis."""
    return np.asarray(convolve1d(values, [0.5, 1.0, 0.5], mode="constant", output=float))


def event_delays(response: ToothResponse, rotation_hz: float, decay_s: float) -> FloatArray:
    """Delays [s] of equal probability: of a moment of contact, any being likely, and of the path.

    That of the path has the density exp(-t/tau)/tau. A tooth of a planet meets the ring half a turn
    after the sun.
    """
    contact_s = response.contact_ratio / (rotation_hz * response.teeth)
    span = contact_s + _REACH * decay_s
    count = min(_MOST_POINTS, 2 + int(np.ceil(_POINTS * span * rotation_hz * response.teeth)))
    time = np.linspace(0.0, span, 400)
    # integral of the density of the sum over its first argument
    below = _ramp(time, decay_s) - _ramp(time - contact_s, decay_s)
    share = (np.arange(count) + 0.5) / count
    # delays of equal probability, so that the likely ones lie densest
    delay: FloatArray = np.interp(share * below[-1], below, time)
    again = response.gear == "planet"
    return np.concatenate([delay, delay + 0.5 / rotation_hz]) if again else delay


def ringing(frequency_hz: FloatArray, delay_s: FloatArray) -> ComplexArray:
    """Square roots of the covariances of bands at unit power, shape (bands, lines, delays).

    The covariance is a mean over delays of rank-one parts: as few numbers as delays tell the same
    as a matrix of all lines.
    """
    root: ComplexArray = np.exp(-2j * np.pi * frequency_hz[:, :, None] * delay_s)
    return np.asarray(root / np.sqrt(len(delay_s)))


def _ramp(time: FloatArray, decay_s: float) -> FloatArray:
    """Integral from 0 of 1 - exp(-t/tau), 0 before."""
    late = np.maximum(time, 0.0)
    return np.asarray(late + decay_s * np.expm1(-late / decay_s))


def _log_likelihood(
    turned: ComplexArray,
    number: IntArray,
    root: ComplexArray,
    size: FloatArray,
    around: FloatArray,
    noise: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Logarithm of the likelihood ratio of each band, shape (bands, 2, losses, teeth).

    The first to tell whether there is damage or how much, the second to tell where. With it, all
    bands together, shape (5, losses): the mean of the first at a tooth that has lost as much, as
    far as it counts and in full, and sums over the directions of the power that it adds over that
    of the noise, of their weights and of the squares of these. Last `SearchedGear.matched`.

    Parameters
    ----------
    turned : ndarray of complex, shape (bands, teeth, lines)
        The rest, turned so that each tooth in turn stands where tooth 1 would.
    number : ndarray of int, shape (bands, lines)
        Multiples of the gear's rotation.
    root : ndarray of complex, shape (bands, lines, delays)
        Square root of the covariance of the response to a unit loss.
    size : ndarray of float, shape (losses,)
        Size of the response to each loss.
    around : ndarray of float, shape (teeth,)
        Mean square of healthy departures at each tooth over that of the median.
    noise : ndarray of float, shape (bands,)
        Share of noise in the variance of departures. What else is expected to depart may not: that
        is told by the teeth beside the event.
    """
    spread, projection = _directions(root)
    energy = np.abs(turned @ projection) ** 2
    whole = np.mean(np.abs(turned[:, 0]) ** 2, axis=1)
    leak = _leak(projection, spread, number, turned.shape[1])
    beside = _beside(energy / around[:, None], spread, leak)
    beside = np.maximum(beside, np.maximum(noise, LEAST_MISFIT))
    least = np.maximum(beside, SEARCH_MISFIT * whole)
    power = size[:, None] ** 2 * spread[:, None]
    told = _beside_noise(power, energy, least)
    less = np.log1p(power / least[:, None, None]).sum(axis=(0, 2))
    matched = (told.sum(axis=0) + less[:, None]) / around
    expected = beside[:, None] * around
    # most places are as quiet as the quietest
    band, tooth = np.nonzero(expected > least[:, None])
    there = _beside_noise(power[band], energy[band, tooth, None], expected[band, tooth])
    told[band, :, tooth] = there[:, :, 0]
    mostly = 1.0 / np.mean(1.0 / np.maximum(expected, least[:, None]), axis=1)
    # beside the tooth that speaks, its neighbours are held against each other on equal terms
    place = _beside_noise(power, energy, np.maximum(least, PLACE_MISFIT * whole))
    # a share of what the damage itself adds will count as noise
    added = whole[:, None] + power.sum(axis=2) / turned.shape[2]
    counted = np.maximum(mostly[:, None], SEARCH_MISFIT * added)
    ratio = power / np.stack(np.broadcast_arrays(counted, mostly[:, None]))[..., None]
    mean = np.sum(ratio - np.log1p(ratio), axis=3).sum(axis=1)
    weight = ratio[1] / (1.0 + ratio[1])
    sums = [each.sum(axis=(0, 2)) for each in (ratio[1], weight, weight**2)]
    return np.stack([told, place], axis=1), np.vstack([mean, sums]), matched


def _directions(root: ComplexArray) -> tuple[FloatArray, ComplexArray]:
    """Directions that carry the signal, and their powers; 0 where a band has fewer than others.

    No more of them than half of the lines: the others tell the noise.
    """
    spread, vector = np.linalg.eigh(root.conj().swapaxes(1, 2) @ root)
    kept = np.cumsum(spread, axis=1) > _LEFT_OUT * spread.sum(axis=1, keepdims=True)
    kept[:, : -max(1, root.shape[1] // 2)] = False
    first = int(np.argmax(kept.any(axis=0)))
    kept, spread, vector = kept[:, first:], spread[:, first:], vector[:, :, first:]
    over = np.where(kept, 1.0 / np.sqrt(np.where(kept, spread, 1.0)), 0.0)
    return np.where(kept, spread, 0.0), ((root @ vector) * over[:, None]).conj()


def _beside_noise(power: FloatArray, energy: FloatArray, noise: FloatArray) -> FloatArray:
    """Logarithm of the likelihood ratio, shape (bands, losses, teeth).

    Parameters
    ----------
    power : ndarray of float, shape (bands, losses, directions)
        Mean power of the response along each direction.
    energy : ndarray of float, shape (bands, teeth, directions)
        Energy of the departure along them.
    noise : ndarray of float, shape (bands,)
        Mean square of the noise.
    """
    ratio = power / noise[:, None, None]
    less = np.log1p(ratio).sum(axis=2)
    told = (ratio / (1.0 + ratio) / noise[:, None, None]) @ energy.swapaxes(1, 2)
    return np.asarray(told - less[:, :, None])


def _unsure_path(mesh_hz: float) -> FloatArray:
    """Chances of one loss passing for another by the path's power, which mesh harmonics tell.

    They tell it the better the nearer they stand: powers of a reverberant path that decays within
    tau, half of a mesh frequency f apart, correlate by 1 / (1 + (pi f tau)^2) (Schroeder 1962).
    """
    apart = 1.0 - 1.0 / (1.0 + (np.pi * mesh_hz * DECAY_S[1]) ** 2)
    steps = np.log(LOSSES)[:, None] - np.log(LOSSES)
    variance = _TOLD_DEVIATION**2 + apart * _PATH_DEVIATION**2
    unsure = np.exp(-0.5 * steps**2 / variance)
    return np.asarray(unsure / unsure.sum(axis=1)[:, None])


def _with_unsure_path(log_likelihood: FloatArray, unsure: FloatArray) -> FloatArray:
    """Average over the path's power in a band."""
    largest = log_likelihood.max(axis=-2, keepdims=True)
    share = np.exp(np.maximum(log_likelihood - largest, _FAR_BELOW))
    return np.asarray(largest + np.log(unsure @ share))


def _leak(projection: ComplexArray, spread: FloatArray, number: IntArray, teeth: int) -> FloatArray:
    """Share of an event's energy that is seen so many teeth after it, shape (bands, teeth).

    Neighbours hear it because the path rings on; all teeth do because lines are missing about the
    mesh harmonics, most where a gear has few teeth.
    """
    # summed over directions, the energy of an event along all of them is a sum over pairs of lines
    power = np.abs((projection * spread[:, None]) @ projection.conj().swapaxes(1, 2)) ** 2
    bands = np.arange(len(number))[:, None, None]
    apart = bands * teeth + (number[:, :, None] - number[:, None]) % teeth
    pairs = np.bincount(apart.ravel(), power.ravel(), minlength=len(number) * teeth)
    energy = np.fft.fft(pairs.reshape(-1, teeth), axis=1).real
    return np.asarray(energy / energy[:, :1])


def _beside(energy: FloatArray, spread: FloatArray, leak: FloatArray) -> FloatArray:
    """Mean square of bands' departure at most other teeth, what leaks from the largest taken off.

    A departure around much of the turn is no damage of one tooth; what is left of it after the fit
    of the healthy pattern counts as noise. Told by a high quantile over the teeth, over that of a
    gamma law of as many degrees as the weights are worth.
    """
    from scipy.special import gammaincinv

    weight = (spread / spread.sum(axis=1, keepdims=True))[:, :, None]
    level = (energy @ weight)[:, :, 0]
    largest = np.argmax(level, axis=1)[:, None]
    after = np.arange(level.shape[1]) - largest
    # a tooth before the largest is as good a neighbour as one after it
    row = np.arange(len(level))[:, None]
    heard = np.maximum(leak[row, after], leak[row, -after]) * level[row, largest]
    # each component leaks more or less than the mean: what exceeds it stays, to be on the safe side
    beside = (np.maximum(energy - heard[:, :, None], 0.0) @ weight)[:, :, 0]
    degrees = 1.0 / np.sum(weight[:, :, 0] ** 2, axis=1)
    expected = gammaincinv(degrees, _MOST_TEETH) / degrees
    return np.asarray(np.quantile(beside, _MOST_TEETH, axis=1) / expected)
