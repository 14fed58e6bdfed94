"""Modulation and impacts: band envelopes, kurtogram and cepstrum.

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

References
----------
Antoni, Mech. Syst. Signal Process. 20 (2006) 282-307 and 21 (2007) 108-124, kurtogram. Randall,
Mech. Syst. Signal Process. 97 (2017) 3-19, cepstrum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import ifft, next_fast_len

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.signals.spectra.spectrum import (
    Spectrum,
    amplitude_spectrum,
    checked,
    fast_length,
    quick_length,
    rows_in_cache,
    transform,
)

#: Samples of the envelope that a band keeps at least: fewer make a kurtosis meaningless.
LEAST_SAMPLES = 32
# Samples of an envelope over the lines of its band. Two tones of one band beat at up to its width
# B; sampled at B the modulus would fold from B/2 on.
_OVERSAMPLED = 4
#: Spectral lines this far below the strongest are taken as that: the logarithm of zero is none.
FLOOR_DB = 200.0


@dataclass(frozen=True, kw_only=True)
class Envelope:
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
    signals = checked(samples, rate, 8)
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
    return Envelope(
        # of a record that was padded the padding is left out again
        values=values[:, : -(-length * samples_in // count)],
        rate=length * rate / count,
        low=first * rate / count,
        high=last * rate / count,
    )


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
        tops = [float(level.max()) for level in self.kurtosis]
        level = int(np.argmax(tops))
        band = int(np.argmax(self.kurtosis[level]))
        width = self.rate / 2 / self.bands[level]
        return band * width, (band + 1) * width, tops[level]

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
    if signal.ndim != 1 or len(signal) < 2 * LEAST_SAMPLES:
        raise ArgumentError(
            f"samples: shape {signal.shape}, one row of at least {2 * LEAST_SAMPLES} is needed"
        )
    deepest = int(np.log2(len(signal) // 2 / LEAST_SAMPLES))
    wanted = min(int(check_range("levels", levels, 0, 12)), deepest)
    if np.ptp(signal) == 0:
        raise ArgumentError("samples: the signal is constant, it has no kurtosis")
    length = quick_length(len(signal))
    lines = transform((signal - signal.mean())[None, :], length)[0, 1 : length // 2 + 1]
    counts = sorted({1} | {2**k for k in range(wanted + 1)} | {3 * 2**k for k in range(wanted)})
    share = len(signal) / length
    return Kurtogram(
        bands=tuple(counts),
        kurtosis=tuple(_band_kurtosis(lines, count, share) for count in counts),
        rate=float(rate),
    )


def _band_kurtosis(lines: ComplexArray, count: int, share: float) -> FloatArray:
    """Kurtosis of the envelopes of equal bands; a few lines at the top are left over.

    `share` is that of the record in the transform: what was padded has no say.
    """
    width = len(lines) // count
    # twice as many points as lines: the squared envelope is then sampled without aliasing, and its
    # mean square is exact wherever the impacts fall between the points
    length = next_fast_len(2 * width)
    rows = min(count, rows_in_cache(length))
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
    ratio = np.divide(square, mean**2, out=np.full(count, 2.0), where=~silent)
    return np.asarray(ratio - 2.0)


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
    signals = checked(samples, rate, 16)
    count = quick_length(signals.shape[-1])
    size = np.abs(transform(signals - signals.mean(axis=-1, keepdims=True), count))
    largest = size.max(axis=-1, keepdims=True)
    if (largest == 0).any():
        raise ArgumentError("samples: a signal is constant, it has no cepstrum")
    logarithm = np.log(np.maximum(size, largest * 10.0 ** (-FLOOR_DB / 20)))
    values = np.fft.irfft(logarithm, n=count, axis=-1)[:, : count // 2 + 1]
    return np.arange(count // 2 + 1) / rate, values
