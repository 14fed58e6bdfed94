"""Spectra of signals against time: calibrated lines and densities, modulation and impacts.

Windows are sums of cosines, w_n = sum_k (-1)^k a_k cos(2 pi k n / N), periodic in N. Their
spectra are then a few shifted Dirichlet kernels in closed form, from which a line that falls
between the bins of a transform is read without error: a line of amplitude A, frequency f and phase
p shows at every bin as

    X_k = A/2 e^{ip} W(k - b) + A/2 e^{-ip} W(k + b),    b = f n / rate,

with W the spectrum of the window. The bins about a peak are fitted by this and a mean, by least
squares, the place b by search: a single sine is read without error at any frequency and with any
window, also where it meets its own image at 0.

Envelope. A band is picked out of the Fourier transform and shifted to zero, which is an ideal
band-pass and the Hilbert transform in one step: no phase lag, and the envelope comes out at the low
rate that the band needs. Ends: the record is taken as periodic, so the first and last 3/bandwidth
seconds of a record that is not are smeared.

Kurtogram. The kurtosis of the envelope x of a band,

    K = <|x|^4> / <|x|^2>^2 - 2,

is 0 for stationary Gaussian noise, -1 for a steady tone, large where impacts pass. Mapped over
centre frequency and bandwidth its maximum is the band to demodulate. One transform of the whole
record is cut into bands, each of which is transformed back by itself: every level costs one batch
of short inverse transforms, some at a time in buffers that fit the cache, and bands of a level
neither overlap nor leak.

Cepstrum. The real cepstrum is the inverse transform of ln|X(f)|. Sidebands that stand at equal
distances f_r in the spectrum make a line at the quefrency 1/f_r and its multiples (rahmonics).
Lines at negative amplitude mean nothing by themselves.

>>> time_s = np.arange(1000) / 1000
>>> found = amplitude_spectrum(3.0 * np.sin(2 * np.pi * 50 * time_s), 1000.0)
>>> found.values[0, 50].round(6), found.frequency_hz[50]
(np.float64(3.0), np.float64(50.0))

References
----------
Harris, Proc. IEEE 66 (1978) 51-83 (Hann, Blackman-Harris with four terms, noise bandwidth).
D'Antona and Ferrero, Digital Signal Processing for Measurement Systems, Springer 2006 (flat-top
with five terms). Antoni, Mech. Syst. Signal Process. 20 (2006) 282-307 and 21 (2007) 108-124,
kurtogram. Randall, Mech. Syst. Signal Process. 97 (2017) 3-19, cepstrum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from operator import itemgetter
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import ifft, next_fast_len, rfft

from gearmon.arrays import ComplexArray, FloatArray, median_along
from gearmon.errors import ArgumentError, check_positive, check_range, check_word

#: Coefficients a_0, a_1, ... of each window.
TERMS = {
    "hann": (0.5, 0.5),
    "flat-top": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
    "blackman-harris": (0.35875, 0.48829, 0.14128, 0.01168),
    "rectangular": (1.0,),
}
# Longer windows are made anew each time instead of being held in memory.
_LONGEST_HELD = 1 << 19
# Buffers of so many numbers stay in the cache of a processor core.
_CACHED = 1 << 15
# Up to here any length transforms in milliseconds; above, awkward ones take ten times as long.
_ANY_LENGTH_BELOW = 1 << 14
# Samples of the envelope that a band keeps at least: fewer make a kurtosis meaningless.
_LEAST_SAMPLES = 32
# Samples of an envelope over the lines of its band. Two tones of one band beat at up to its width
# B; sampled at B the modulus would fold from B/2 on.
_OVERSAMPLED = 4
# Spectral lines this far below the strongest are taken as that: the logarithm of zero is none.
_FLOOR_DB = 200.0


def quick_length(length: int) -> int:
    """Return a transform length >= `length` that is never slow, `length` itself where it is not.

    Short lengths and those without a prime factor above eleven are kept; others are rounded up to
    the next 5-smooth even number, by a few parts in a thousand.

    Examples
    --------
    >>> quick_length(1009), quick_length(1_000_000), quick_length(1_000_003)
    (1009, 1000000, 1012500)
    """
    # its own fast length if it has no prime factor above eleven
    quick = length < _ANY_LENGTH_BELOW or next_fast_len(length) == length
    return length if quick else fast_length(length)


def fast_length(length: int) -> int:
    """Return the smallest even 5-smooth number >= `length`: a length that transforms quickly.

    Examples
    --------
    >>> fast_length(10007)
    10240
    """
    return 2 * int(next_fast_len(max(1, -(-length // 2)), real=True))


def _rows_in_cache(length: int) -> int:
    """Return how many transforms of a length to take at a time.

    Two at least: SciPy takes them side by side, in 0.6 of the time that one after the other take.
    """
    return max(2, _CACHED // length)


def transform(signals: FloatArray, length: int, weights: FloatArray | float = 1.0) -> ComplexArray:
    """Return the transforms of signals, windowed and zero-padded.

    Parameters
    ----------
    signals : ndarray of float, shape (..., n)
    length : int, >= n
        Transform length.
    weights : ndarray of float, shape (n,), or float
        The window.

    Returns
    -------
    ndarray of complex, shape (..., length // 2 + 1)
        Unscaled.
    """
    return np.asarray(rfft(signals * weights, length, axis=-1))


def window_powers(
    signals: FloatArray, weights: FloatArray, length: int, centred: bool = True
) -> FloatArray:
    """Squared magnitudes of the `transform` of every signal, some at a time.

    Parameters
    ----------
    signals, weights, length
        As of `transform`.
    centred : bool
        Whether the signals are taken less their means.

    Returns
    -------
    ndarray of float, shape (..., length // 2 + 1)
    """
    every, rows = signals.reshape(-1, signals.shape[-1]), _rows_in_cache(length)
    powers = np.empty((len(every), length // 2 + 1))
    for first in range(0, len(every), rows):
        own, power = every[first : first + rows], powers[first : first + rows]
        # an offset as large as the signal must not hide it behind its own side lobes
        own = own - own.mean(axis=-1, keepdims=True) if centred else own
        lines = transform(own, length, weights)
        np.add(np.square(lines.real, out=power), lines.imag**2, out=power)
    return powers.reshape(*signals.shape[:-1], -1)


def window(name: str, length: int) -> FloatArray:
    """Return the weights of a window, periodic in `length`; read-only.

    Parameters
    ----------
    name : {"hann", "flat-top", "blackman-harris", "rectangular"}
    length : int, >= 1

    Returns
    -------
    ndarray of float, shape (length,)

    Raises
    ------
    ArgumentError
        If there is no such window.
    """
    made = _weights if length <= _LONGEST_HELD else _weights.__wrapped__
    return made(_window_terms(name), length)


def _window_terms(name: str) -> tuple[float, ...]:
    """Return the coefficients of a window.

    Raises
    ------
    ArgumentError
        If there is no such window.
    """
    check_word("window=", name, TERMS)
    return TERMS[name]


def noise_bandwidth(name: str) -> float:
    """Return the equivalent noise bandwidth of a window in bins: 1.5 for Hann, 1 for none."""
    weights = window(name, 100)
    return float(100 * (weights @ weights) / weights.sum() ** 2)


def half_lobe(name: str) -> int:
    """Return half the width of the main lobe of a window in bins: as many as it has terms."""
    return len(_window_terms(name))


def window_spectrum(name: str, offset: FloatArray, length: int) -> ComplexArray:
    """Transform of a window at any distance from its middle, 1 at none.

    Parameters
    ----------
    name : str
        The window.
    offset : ndarray of float
        Distance in bins, of any shape.
    length : int
        Length of the window.

    Returns
    -------
    ndarray of complex, shape of `offset`
        sum_n w_n exp(-2 pi i offset n / N) / sum_n w_n.
    """
    terms = _window_terms(name)
    result = terms[0] * _dirichlet(offset, length)
    for k, term in enumerate(terms[1:], start=1):
        half = 0.5 * term * (-1) ** k
        result = result + half * (_dirichlet(offset - k, length) + _dirichlet(offset + k, length))
    return np.asarray(result / terms[0], dtype=np.complex128)


def _dirichlet(offset: FloatArray, length: int) -> ComplexArray:
    """Mean of exp(-2 pi i offset n / N) over n = 0 ... N-1."""
    # reduced to half a period about zero, so that sin(pi x / N) vanishes at x = 0 only
    x = offset - length * np.round(offset / length)
    size = np.sinc(x) / np.sinc(x / length)
    return np.asarray(size * np.exp(-1j * np.pi * x * (length - 1) / length), dtype=np.complex128)


@lru_cache(maxsize=16)
def _weights(terms: tuple[float, ...], length: int) -> FloatArray:
    weights = np.full(length, terms[0])
    turn = 2 * np.pi * np.arange(length) / length
    for k, term in enumerate(terms[1:], start=1):
        weights += (-1) ** k * term * np.cos(k * turn)
    weights.flags.writeable = False
    return weights


@dataclass(frozen=True, kw_only=True)
class Spectrum:
    """One-sided spectrum of real signals.

    Parameters
    ----------
    frequency_hz : ndarray of float, shape (bins,)
        Line frequencies from 0 to half the sampling rate [Hz].
    values : ndarray of float, shape (channels, bins)
        In the signal's unit, its square, or unit^2/Hz.
    quantity : {"amplitude", "rms", "energy", "density"}
        Peak amplitude; root mean square of the line; its mean square; power density.
    resolution_hz : float
        Noise bandwidth of one line, window included [Hz].
    """

    frequency_hz: FloatArray
    values: FloatArray
    quantity: str
    resolution_hz: float


def amplitude_spectrum(
    samples: FloatArray,
    sampling_rate_hz: float,
    *,
    window_name: str = "hann",
    quantity: Literal["amplitude", "rms", "energy"] = "amplitude",
    length: int | None = None,
) -> Spectrum:
    """Amplitude spectrum of whole signals, calibrated for the window.

    A sine of amplitude A on a line reads exactly A. Between two lines it reads less, by at most
    15 % with a Hann window, 36 % with none, 9 % with Blackman-Harris, 0.2 % with flat-top;
    `line_amplitude` reads it without that loss.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, n >= 2.
    sampling_rate_hz : float
        Sampling rate [Hz], > 0.
    window_name : {"hann", "flat-top", "blackman-harris", "rectangular"}
        The window.
    quantity : {"amplitude", "rms", "energy"}
        Peak amplitude A of each line, its root mean square A / sqrt(2), or its energy: the mean
        square that it adds to the signal, scaled for noise. Energies of all lines add up to the
        mean square of the signal (weighted by the squared window).
    length : int, optional
        Transform length, >= n; the signal is padded with zeros. By default `quick_length(n)`: n
        itself unless n is above 16,384 and has a prime factor above eleven.

    Returns
    -------
    Spectrum
        length // 2 + 1 lines.

    Raises
    ------
    ArgumentError
        If there are fewer than two samples, an argument is out of its range, or a sample is not
        finite.

    Notes
    -----
    Energy: |X_k|^2 / (length sum w^2), times two but at 0 and half the rate (Parseval).
    """
    signals = _checked(samples, sampling_rate_hz)
    count = signals.shape[-1]
    check_word("quantity=", quantity, ("amplitude", "rms", "energy"))
    length = quick_length(count) if length is None else length
    if length < count:
        raise ArgumentError(f"length={length} must be at least the {count} samples")
    return _spectrum(signals, sampling_rate_hz, window_name, quantity, count, length)


def power_density(
    samples: FloatArray, sampling_rate_hz: float, block: int, *, window_name: str = "hann"
) -> Spectrum:
    """Welch's estimate of the power spectral density, half overlap.

    The integral over frequency equals the mean square of a stationary signal (each block is taken
    with its mean).

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz], > 0.
    block : int
        Samples a block, 2 <= block <= n. An awkward one above 16,384 is padded, see `quick_length`.
    window_name : {"hann", "flat-top", "blackman-harris", "rectangular"}
        The window.

    Returns
    -------
    Spectrum
        Density [unit^2/Hz].

    Raises
    ------
    ArgumentError
        If `block` is out of its range, the rate is not > 0, or a sample is not finite.

    References
    ----------
    Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73.
    """
    signals = _checked(samples, sampling_rate_hz)
    if not 2 <= block <= signals.shape[-1]:
        raise ArgumentError(f"block={block} samples must lie in [2, {signals.shape[-1]}]")
    return _spectrum(signals, sampling_rate_hz, window_name, "density", block, quick_length(block))


def _spectrum(
    signals: FloatArray, rate: float, name: str, quantity: str, block: int, length: int
) -> Spectrum:
    """Mean square of half-overlapped blocks line by line, scaled to what is asked for."""
    weights, rows = window(name, block), _rows_in_cache(length)
    blocks = np.lib.stride_tricks.sliding_window_view(signals, block, axis=-1)
    blocks = blocks[:, :: max(1, block // 2)]
    values = np.zeros((len(signals), length // 2 + 1))
    for power, own in zip(values, blocks, strict=True):
        for first in range(0, len(own), rows):
            lines = transform(own[first : first + rows], length, weights)
            power += (lines.real**2 + lines.imag**2).sum(axis=0)
    scale = {"density": rate, "energy": length}.get(quantity)
    values /= blocks.shape[1] * (scale * (weights @ weights) if scale else weights.sum() ** 2)
    values = values if scale else np.sqrt(values)
    # lines count with their mirror images at negative frequencies, where there are such
    values[:, 1 : (length + 1) // 2] *= np.sqrt(2.0) if quantity == "rms" else 2.0
    _check_finite(values)
    place, wide = rate / length * np.arange(length // 2 + 1.0), noise_bandwidth(name) * rate / block
    return Spectrum(frequency_hz=place, values=values, quantity=quantity, resolution_hz=wide)


def local_floor(power: FloatArray, width: int) -> FloatArray:
    """Take the running median of a power spectrum: the noise under its lines.

    The median of windows of `width` bins, half overlapped, interpolated between their centres;
    lines that fill less than half of a window do not lift it.

    Parameters
    ----------
    power : ndarray of float, shape (..., bins)
        Power spectrum, >= 0.
    width : int
        Bins a window, >= 2; cut to the number of bins.

    Returns
    -------
    ndarray of float, shape (..., bins)
        The floor, > 0 wherever any bin of the window is.
    """
    bins = power.shape[-1]
    width = min(max(2, width), bins)
    last = bins - width
    starts = np.append(np.arange(0, last, max(1, width // 2)), last)
    windows = np.lib.stride_tricks.sliding_window_view(power, width, axis=-1)[..., starts, :]
    medians = median_along(windows, -1)
    places, middles = np.arange(bins), starts + 0.5 * (width - 1)
    rows = [np.interp(places, middles, row) for row in medians.reshape(-1, len(starts))]
    return np.maximum(np.reshape(rows, power.shape), np.finfo(float).tiny)


def _checked(samples: FloatArray, sampling_rate_hz: float, fewest: int = 2) -> FloatArray:
    """Return signals as rows, of at least so many samples."""
    check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    signals = np.atleast_2d(np.asarray(samples, dtype=float))
    if signals.ndim != 2 or signals.shape[-1] < fewest:
        raise ArgumentError(f"samples: shape {signals.shape}, at least {fewest} values are needed")
    return signals


def _check_finite(values: FloatArray) -> None:
    # one number that is none spoils whole rows: the sum tells at no cost
    if not np.isfinite(values.sum()):
        raise ArgumentError("samples: not all are finite numbers, or they are too large to square")


class FittedLines(NamedTuple):
    """Sinusoidal lines A cos(2 pi f t + p) of signals.

    Parameters
    ----------
    frequency_hz, amplitude, phase_rad : ndarray of float, shape (channels, lines)
        f [Hz], A (peak, in the signal's unit) and p at the first sample [rad].
    """

    frequency_hz: FloatArray
    amplitude: FloatArray
    phase_rad: FloatArray


def line_amplitude(
    samples: FloatArray,
    sampling_rate_hz: float,
    frequency_hz: ArrayLike,
    *,
    window_name: str = "hann",
) -> FittedLines:
    """Measure lines near given frequencies, wherever they stand between the bins.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, n >= 16.
    sampling_rate_hz : float
        Sampling rate [Hz], > 0.
    frequency_hz : array of float, shape (lines,)
        Where to look [Hz], above 0 and below half the rate; the line is sought about the highest
        bin within rate/n of there.
    window_name : {"hann", "flat-top", "blackman-harris", "rectangular"}
        The window.

    Returns
    -------
    FittedLines

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    Exact for one line, or lines more than a main lobe apart, as far as side lobes of the others do
    not reach (none: -13 dB, Hann: -31 dB, flat-top: -93 dB, Blackman-Harris: -92 dB). Lines nearer
    than the main lobe are read as one.
    """
    from scipy.optimize import minimize_scalar

    signals = _checked(samples, sampling_rate_hz, 16)
    wanted = np.atleast_1d(np.asarray(frequency_hz, dtype=float))
    for value in wanted:
        if not 0 < value < sampling_rate_hz / 2:
            raise ArgumentError(
                f"frequency_hz={value:g} must lie between 0 and {sampling_rate_hz / 2:g} Hz"
            )
    count, weights = signals.shape[-1], window(window_name, signals.shape[-1])
    bins = transform(signals, quick_length(count), weights) / weights.sum()
    _check_finite(np.abs(bins))
    place = np.arange(bins.shape[-1]) * (count / quick_length(count))
    lobe = max(2, half_lobe(window_name))

    def line(own: ComplexArray, at: float) -> tuple[float, float, float]:
        """Place, amplitude and phase of the line of a channel near a place [bins]."""
        near = np.flatnonzero((np.abs(place - at) <= 1.0) & (place > 0))
        at = float(place[near[np.argmax(np.abs(own[near]))]])
        # the bins about the place, as far as the main lobe reaches
        seen = np.abs(place - at) <= lobe

        def misfit(beside: float) -> float:
            return _fitted(own[seen], place[seen], at + beside, window_name, count)[1]

        ends = max(0.25 - at, -1.5), min(count / 2 - 1e-3 - at, 1.5)
        at += minimize_scalar(misfit, bounds=ends, options={"xatol": 1e-9}).x
        value, _ = _fitted(own[seen], place[seen], at, window_name, count)
        return at * sampling_rate_hz / count, 2 * abs(value), float(np.angle(value))

    found = np.array([[line(own, at) for at in wanted * count / sampling_rate_hz] for own in bins])
    return FittedLines(*np.moveaxis(found.reshape(len(bins), -1, 3), -1, 0))


def _fitted(
    bins: ComplexArray, place: FloatArray, tried: float, name: str, count: int
) -> tuple[complex, float]:
    """A/2 e^{ip} of a line at a place, and the misfit that it leaves in some bins."""
    own, image, mean = (window_spectrum(name, place - k * tried, count) for k in (1, -1, 0))
    columns = np.stack([own + image, 1j * (own - image), mean], axis=-1)
    matrix = np.concatenate([columns.real, columns.imag])
    wanted = np.concatenate([bins.real, bins.imag])
    solution = np.linalg.lstsq(matrix, wanted, rcond=1e-12)[0]
    left = wanted - matrix @ solution
    return complex(solution[0], solution[1]), float(left @ left)


class Envelope(NamedTuple):
    """Complex envelope of one band: signal = Re[values exp(2 pi i low t)] within the band.

    Parameters
    ----------
    values : ndarray of complex, shape (channels, m)
        Modulus is the amplitude (peak), angle the phase against the lower edge.
    rate : float
        Samples per unit of time or angle.
    low, high : float
        Edges of the band, per unit of time or angle; the lower one is what was shifted to zero.
    """

    values: ComplexArray
    rate: float
    low: float
    high: float

    @property
    def amplitude(self) -> FloatArray:
        """|values|, shape (channels, m)."""
        return np.abs(self.values)


def band_envelope(samples: FloatArray, rate: float, low: float, high: float) -> Envelope:
    """Complex envelope of a band.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, n >= 8.
    rate : float
        Samples per unit of time or angle, > 0.
    low, high : float
        Edges of the band, 0 <= low < high <= rate/2; rounded to lines of the transform.

    Returns
    -------
    Envelope
        At a rate of four times the width of the band or a little more: its modulus reaches beyond
        that width, lines of what beats in the band and their harmonics.

    Raises
    ------
    ArgumentError
        If the band is out of its range or holds fewer than two lines.
    """
    signals = _checked(samples, rate, 8)
    check_range("low", low, 0.0, rate / 2)
    check_range("high", high, 0.0, rate / 2)
    samples_in, count = signals.shape[-1], quick_length(signals.shape[-1])
    first, last = round(low * count / rate), round(high * count / rate)
    last = min(last, (count - 1) // 2)
    if last - first < 2:
        raise ArgumentError(
            f"band {low:g} to {high:g} holds fewer than two lines; its width must be at least "
            f"{2 * rate / count:.3g}"
        )
    lines = (2.0 / count) * transform(signals, count)[:, first : last + 1]
    if first == 0:
        lines[:, 0] *= 0.5  # the mean has no conjugate to be folded in
    # the lowest line is shifted to zero
    length = fast_length(_OVERSAMPLED * (last - first + 1))
    values = ifft(lines, length, axis=-1, norm="forward")
    # of a record that was padded the padding is left out again
    kept, line = values[:, : -(-length * samples_in // count)], rate / count
    return Envelope(values=kept, rate=length * line, low=first * line, high=last * line)


def envelope_spectrum(samples: FloatArray, rate: float, low: float, high: float) -> Spectrum:
    """Amplitude spectrum of the envelope of a band.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
    rate : float
        Sampling rate [Hz], or samples a turn.
    low, high : float
        Edges of the band [Hz], or orders.

    Returns
    -------
    Spectrum
        Peak amplitudes in the signal's unit, Hann window, mean removed; up to the
        width of the band: a band of width B carries no modulation faster than B.

    Raises
    ------
    ArgumentError
        As `band_envelope`.
    """
    envelope = band_envelope(samples, rate, low, high)
    size = envelope.amplitude
    size = size - size.mean(axis=-1, keepdims=True)
    found = amplitude_spectrum(size, envelope.rate, length=size.shape[-1])
    kept = found.frequency_hz <= (envelope.high - envelope.low) * (1 + 1e-12)
    return replace(found, frequency_hz=found.frequency_hz[kept], values=found.values[:, kept])


@dataclass(frozen=True, kw_only=True)
class Kurtogram:
    """Kurtosis of the envelope by band, of one channel.

    Parameters
    ----------
    bands : tuple of int
        Number of bands of each level: 1, 2, 3, 4, 6, 8, 12, ...
    kurtosis : tuple of ndarray of float
        K of each band, one array of shape (bands,) a level.
    rate : float
        Sampling rate [Hz] (or samples a turn).
    """

    bands: tuple[int, ...]
    kurtosis: tuple[FloatArray, ...]
    rate: float

    @property
    def best(self) -> tuple[float, float, float]:
        """Lower and upper edge [Hz] and kurtosis of the most impulsive band."""
        band = max(self.rows(), key=itemgetter("kurtosis"))
        return band["low_hz"], band["high_hz"], band["kurtosis"]

    def rows(self) -> list[dict[str, float]]:
        """Return level, bandwidth_hz, low_hz, high_hz and kurtosis of every band."""
        names = ("level", "bandwidth_hz", "low_hz", "high_hz", "kurtosis")
        widths = [self.rate / 2 / count for count in self.bands]
        return [
            dict(zip(names, (level, width, k * width, (k + 1) * width, float(value)), strict=True))
            for level, (width, own) in enumerate(zip(widths, self.kurtosis, strict=True))
            for k, value in enumerate(own)
        ]


def kurtogram(samples: FloatArray, rate: float, levels: int = 8) -> Kurtogram:
    """Fast kurtogram of one signal.

    Parameters
    ----------
    samples : ndarray of float, shape (n,)
        The signal, n >= 64.
    rate : float
        Sampling rate [Hz], > 0.
    levels : int
        Halvings of the bandwidth, 0 to 12, with thirds between: 2 * levels rows and one; at most as
        many as leave 32 samples of every envelope.

    Returns
    -------
    Kurtogram

    Raises
    ------
    ArgumentError
        If the signal is too short or constant, or an argument is out of range.
    """
    check_positive("rate", rate)
    signal = np.asarray(samples, dtype=float)
    if signal.ndim != 1 or len(signal) < 2 * _LEAST_SAMPLES:
        raise ArgumentError(
            f"samples: shape {signal.shape}, one row of at least {2 * _LEAST_SAMPLES} is needed"
        )
    deepest = int(np.log2(len(signal) // 2 / _LEAST_SAMPLES))
    wanted = min(int(check_range("levels", levels, 0, 12)), deepest)
    if np.ptp(signal) == 0:
        raise ArgumentError("samples: the signal is constant, it has no kurtosis")
    length = quick_length(len(signal))
    lines = transform((signal - signal.mean())[None, :], length)[0, 1 : length // 2 + 1]
    counts = sorted({1} | {2**k for k in range(wanted + 1)} | {3 * 2**k for k in range(wanted)})
    found = tuple(_band_kurtosis(lines, count, len(signal) / length) for count in counts)
    return Kurtogram(bands=tuple(counts), kurtosis=found, rate=float(rate))


def _band_kurtosis(lines: ComplexArray, count: int, share: float) -> FloatArray:
    """Kurtosis of the envelopes of equal bands; a few lines at the top are left over.

    `share` is that of the record in the transform: what was padded has no say.
    """
    width = len(lines) // count
    # twice as many points as lines: the squared envelope is then sampled without aliasing, and its
    # mean square is exact wherever the impacts fall between the points
    length = next_fast_len(2 * width)
    rows = min(count, _rows_in_cache(length))
    kept = max(2, int(length * share))
    bands = lines[: width * count].reshape(count, width)
    mean, square = np.empty(count), np.empty(count)
    for first in range(0, count, rows):
        group = slice(first, first + rows)
        envelopes = ifft(bands[group], length, axis=-1, norm="forward")[:, :kept]
        power = envelopes.real**2 + envelopes.imag**2
        mean[group], square[group] = power.mean(axis=-1), (power**2).mean(axis=-1)
    # an empty band has no kurtosis; rounding noise beside strong bands must not be taken for one
    silent = mean <= 1e-24 * mean.max(initial=0.0)
    return np.asarray(np.divide(square, mean**2, out=np.full(count, 2.0), where=~silent) - 2.0)


def real_cepstrum(samples: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Real cepstrum, the inverse transform of ln|X|.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, n >= 16; the mean is taken off.
    rate : float
        Sampling rate [Hz], or samples a turn.

    Returns
    -------
    quefrency_s : ndarray of float, shape (n // 2 + 1,)
        Quefrencies [s] (or turns).
    values : ndarray of float, shape (channels, n // 2 + 1)
        The cepstrum [1]; the value at quefrency 0 is the mean logarithm.

    Raises
    ------
    ArgumentError
        If there are too few samples or a signal is constant.
    """
    signals = _checked(samples, rate, 16)
    count = quick_length(signals.shape[-1])
    size = np.abs(transform(signals - signals.mean(axis=-1, keepdims=True), count))
    largest = size.max(axis=-1, keepdims=True)
    if (largest == 0).any():
        raise ArgumentError("samples: a signal is constant, it has no cepstrum")
    logarithm = np.log(np.maximum(size, largest * 10.0 ** (-_FLOOR_DB / 20)))
    values = np.fft.irfft(logarithm, n=count, axis=-1)[:, : count // 2 + 1]
    return np.arange(count // 2 + 1) / rate, values
