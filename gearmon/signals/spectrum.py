"""Calibrated spectra of real signals; the only module that chooses a Fourier transform library.

Short or single transforms go through NumPy, many long ones through FFTW with cached plans: loading
FFTW costs more than it saves until some millions of samples are transformed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, check_positive

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# Above this many samples in equal transforms the import of FFTW (a quarter of a second) pays off.
_FFTW_PAYS_FROM = 1 << 23


@dataclass(frozen=True, kw_only=True)
class Spectrum:
    """One-sided spectrum of real signals.

    Parameters
    ----------
    frequency_hz : ndarray of float, shape (bins,)
        Line frequencies from 0 to half the sampling rate [Hz].
    values : ndarray of float, shape (channels, bins)
        Amplitude (peak, not RMS) in the signal's unit, or its power density in unit^2/Hz.
    quantity : {"amplitude", "density"}
        What `values` holds.
    resolution_hz : float
        Noise bandwidth of one line, window included [Hz].
    """

    frequency_hz: FloatArray
    values: FloatArray
    quantity: str
    resolution_hz: float


def hann(length: int) -> FloatArray:
    """Return the periodic Hann window of `length` samples (mean 1/2)."""
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)


def fast_length(length: int) -> int:
    """Return the smallest even 5-smooth number >= `length`: a length that transforms quickly.

    Examples
    --------
    >>> fast_length(10007)
    10240
    """
    best = 1 << max(1, (length - 1).bit_length())
    five = 1
    while five < 2 * length:
        three = five
        while three < 2 * length:
            quotient = -(-length // three)
            candidate = three << max(1, (quotient - 1).bit_length())
            best = min(best, candidate)
            three *= 3
        five *= 5
    return best


def real_fft(blocks: FloatArray, length: int, *, total: int | None = None) -> ComplexArray:
    """Fourier transform of real blocks along the last axis, zero-padded to `length`.

    Parameters
    ----------
    blocks : ndarray of float, shape (..., n)
        The blocks, n <= length.
    length : int
        Transform length.
    total : int, optional
        Samples that the caller will transform in all at this length; decides which library is
        worth loading.

    Returns
    -------
    ndarray of complex, shape (..., length // 2 + 1)
        Unscaled coefficients, sum over n of x_n exp(-2 pi i k n / length).
    """
    if (total or blocks.size) >= _FFTW_PAYS_FROM and length >= 1 << 12:
        return _fftw(blocks, length)
    return np.fft.rfft(blocks, n=length, axis=-1)


def _fftw(blocks: FloatArray, length: int) -> ComplexArray:
    try:
        import pyfftw.interfaces.numpy_fft as backend
        from pyfftw.interfaces import cache
    except ImportError:  # FFTW is GPL: whoever removes it keeps a complete product
        return np.fft.rfft(blocks, n=length, axis=-1)
    cache.enable()
    cache.set_keepalive_time(30.0)
    result: ComplexArray = backend.rfft(
        blocks, n=length, axis=-1, planner_effort="FFTW_ESTIMATE", threads=1
    )
    return result


def amplitude_spectrum(samples: FloatArray, sampling_rate_hz: float) -> Spectrum:
    """Hann-windowed amplitude spectrum of whole signals.

    A sine of amplitude A between two lines reads at least 0.85 A (the scalloping of a Hann
    window), on a line exactly A.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, n >= 2.
    sampling_rate_hz : float
        Sampling rate [Hz], > 0.

    Returns
    -------
    Spectrum
        Peak amplitudes, n // 2 + 1 lines.

    Raises
    ------
    ArgumentError
        If there are fewer than two samples or the rate is not > 0.
    """
    signals = _checked(samples, sampling_rate_hz)
    count = signals.shape[-1]
    window = hann(count)
    values = np.abs(real_fft(signals * window, count)) / window.sum()
    values[:, 1 : (count + 1) // 2] *= 2.0
    return Spectrum(
        frequency_hz=sampling_rate_hz / count * np.arange(count // 2 + 1.0),
        values=values,
        quantity="amplitude",
        resolution_hz=1.5 * sampling_rate_hz / count,
    )


def power_density(samples: FloatArray, sampling_rate_hz: float, block: int) -> Spectrum:
    """Welch's estimate of the power spectral density, Hann window, half overlap.

    The integral over frequency equals the mean square of a stationary signal (each block is taken
    with its mean).

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz], > 0.
    block : int
        Samples a block, 2 <= block <= n.

    Returns
    -------
    Spectrum
        Density [unit^2/Hz], block // 2 + 1 lines.

    Raises
    ------
    ArgumentError
        If `block` is out of its range or the rate is not > 0.

    References
    ----------
    Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73.
    """
    signals = _checked(samples, sampling_rate_hz)
    if not 2 <= block <= signals.shape[-1]:
        raise ArgumentError(f"block={block} samples must lie in [2, {signals.shape[-1]}]")
    window = hann(block)
    powers, _ = block_powers(signals, block, max(1, block // 2), window, block)
    values = powers.mean(axis=0) / (sampling_rate_hz * np.sum(window**2))
    values[:, 1 : (block + 1) // 2] *= 2.0
    return Spectrum(
        frequency_hz=sampling_rate_hz / block * np.arange(block // 2 + 1.0),
        values=values,
        quantity="density",
        resolution_hz=1.5 * sampling_rate_hz / block,
    )


def block_powers(
    signals: FloatArray, block: int, hop: int, window: FloatArray, length: int
) -> tuple[FloatArray, FloatArray]:
    """Squared magnitudes of windowed blocks.

    Parameters
    ----------
    signals : ndarray of float, shape (channels, n)
        The signals, n >= block.
    block, hop : int
        Samples a block and between the starts of blocks.
    window : ndarray of float, shape (block,)
        The window.
    length : int
        Transform length, >= block (zero padding between).

    Returns
    -------
    powers : ndarray of float, shape (blocks, channels, length // 2 + 1)
        |X|^2, unscaled.
    centres : ndarray of float, shape (blocks,)
        Centres of the blocks [samples].
    """
    starts = np.arange(0, signals.shape[-1] - block + 1, hop)
    powers = np.empty((len(starts), signals.shape[0], length // 2 + 1))
    total = len(starts) * signals.shape[0] * length
    for row, start in enumerate(starts):
        transform = real_fft(signals[:, start : start + block] * window, length, total=total)
        powers[row] = transform.real**2 + transform.imag**2
    return powers, starts + block / 2.0


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
    step = max(1, width // 2)
    starts = np.unique(np.append(np.arange(0, bins - width + 1, step), bins - width))
    windows = np.lib.stride_tricks.sliding_window_view(power, width, axis=-1)[..., starts, :]
    medians = np.median(windows, axis=-1)
    centres = starts + (width - 1) / 2.0
    flat = medians.reshape(-1, len(starts))
    grid = np.arange(bins)
    floor = np.array([np.interp(grid, centres, row) for row in flat])
    result: FloatArray = np.maximum(floor.reshape(power.shape), np.finfo(float).tiny)
    return result


def _checked(samples: FloatArray, sampling_rate_hz: float) -> FloatArray:
    check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    signals = np.atleast_2d(np.asarray(samples, dtype=float))
    if signals.shape[-1] < 2:
        raise ArgumentError(f"samples: {signals.shape[-1]} values, at least 2 are needed")
    return signals
