"""Fourier transforms of real signals, their windows, and calibrated spectra.

All windows are sums of cosines, w_n = sum_k (-1)^k a_k cos(2 pi k n / N), periodic in N. Their
spectra are then a few shifted Dirichlet kernels in closed form, from which a line that falls
between the bins of a transform is read without error: a line of amplitude A, frequency f and phase
p shows at every bin as

    X_k = A/2 e^{ip} W(k - b) + A/2 e^{-ip} W(k + b),    b = f n / rate,

with W the spectrum of the window. The bins about a peak are fitted by this and a mean, by least
squares, the place b by search: a single sine is read without error at any frequency and with any
window, also where it meets its own image at 0.

References
----------
Harris, Proc. IEEE 66 (1978) 51-83 (Hann, Blackman-Harris with four terms, noise bandwidth).
D'Antona and Ferrero, Digital Signal Processing for Measurement Systems, Springer 2006 (flat-top
with five terms).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import next_fast_len, rfft

from gearmon.arrays import ComplexArray, FloatArray
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


def quick_length(length: int) -> int:
    """Return a transform length >= `length` that is never slow, `length` itself where it is not.

    Short lengths and those without a prime factor above eleven are kept; others are rounded up to
    the next 5-smooth even number, by a few parts in a thousand.

    Examples
    --------
    >>> quick_length(1009), quick_length(1_000_000), quick_length(1_000_003)
    (1009, 1000000, 1012500)
    """
    if length < _ANY_LENGTH_BELOW or is_smooth(length):
        return length
    return fast_length(length)


def is_smooth(length: int) -> bool:
    """Return whether a number has no prime factor above eleven: transforms of it are quick."""
    return int(next_fast_len(length)) == length


def fast_length(length: int) -> int:
    """Return the smallest even 5-smooth number >= `length`: a length that transforms quickly.

    Examples
    --------
    >>> fast_length(10007)
    10240
    """
    return 2 * int(next_fast_len(max(1, -(-length // 2)), real=True))


def rows_in_cache(length: int) -> int:
    """Return how many transforms of a length to take at a time."""
    return max(1, _CACHED // length)


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


def window_powers(signals: FloatArray, weights: FloatArray, length: int) -> FloatArray:
    """Squared magnitudes of the `transform` of every signal, one after the other."""
    powers = np.empty((len(signals), length // 2 + 1))
    for row, signal in zip(powers, signals, strict=True):
        lines = transform(signal, length, weights)
        np.add(np.square(lines.real, out=row), lines.imag**2, out=row)
    return powers


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
    return made(window_terms(name), length)


def window_terms(name: str) -> tuple[float, ...]:
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
    return len(window_terms(name))


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
    terms = window_terms(name)
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


def hann(length: int) -> FloatArray:
    """Return the periodic Hann window of `length` samples (mean 1/2); read-only."""
    return window("hann", length)


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
    signals = checked(samples, sampling_rate_hz)
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
    signals = checked(samples, sampling_rate_hz)
    if not 2 <= block <= signals.shape[-1]:
        raise ArgumentError(f"block={block} samples must lie in [2, {signals.shape[-1]}]")
    return _spectrum(signals, sampling_rate_hz, window_name, "density", block, quick_length(block))


def _spectrum(
    signals: FloatArray, rate: float, name: str, quantity: str, block: int, length: int
) -> Spectrum:
    """Mean square of half-overlapped blocks line by line, scaled to what is asked for."""
    weights, rows = window(name, block), rows_in_cache(length)
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
    return Spectrum(
        frequency_hz=rate / length * np.arange(length // 2 + 1.0),
        values=values,
        quantity=quantity,
        resolution_hz=noise_bandwidth(name) * rate / block,
    )


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
    # by sorting in place: quicker than a search in some hundred
    windows.sort(axis=-1)
    medians = 0.5 * (windows[..., (width - 1) // 2] + windows[..., width // 2])
    places, middles = np.arange(bins), starts + 0.5 * (width - 1)
    rows = [np.interp(places, middles, row) for row in medians.reshape(-1, len(starts))]
    return np.maximum(np.reshape(rows, power.shape), np.finfo(float).tiny)


def checked(samples: FloatArray, sampling_rate_hz: float, fewest: int = 2) -> FloatArray:
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


@dataclass(frozen=True)
class FittedLines:
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
    within_bins: float = 1.5,
) -> FittedLines:
    """Measure lines near given frequencies, wherever they stand between the bins.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, n >= 16.
    sampling_rate_hz : float
        Sampling rate [Hz], > 0.
    frequency_hz : array of float, shape (lines,)
        Where to look [Hz], above 0 and below half the rate.
    window_name : {"hann", "flat-top", "blackman-harris", "rectangular"}
        The window.
    within_bins : float
        How far from there the highest bin is looked for [bins of rate/n], 0 to 1000; with 0 the
        frequency is taken as given and only amplitude and phase are fitted.

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

    signals = checked(samples, sampling_rate_hz, 16)
    check_range("within_bins", within_bins, 0.0, 1000.0)
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
        if within_bins:
            near = np.flatnonzero((np.abs(place - at) <= within_bins) & (place > 0))
            near = near if len(near) else np.array([np.argmin(np.abs(place - max(at, 1.0)))])
            at = float(place[near[np.argmax(np.abs(own[near]))]])
        # the bins about the place, as far as the main lobe reaches
        seen = np.abs(place - at) <= lobe

        def misfit(beside: float) -> float:
            return _fitted(own[seen], place[seen], at + beside, window_name, count)[1]

        if within_bins:
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
