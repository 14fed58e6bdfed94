"""Lines between the bins of a transform: amplitude, frequency and phase without scalloping.

A line of amplitude A, frequency f and phase p shows at every bin as

    X_k = A/2 e^{ip} W(k - b) + A/2 e^{-ip} W(k + b),    b = f n / rate,

with W the spectrum of the window in closed form (`spectrum.window_spectrum`). The bins about a peak
are fitted by this and a mean, by least squares, the place b by search: a single sine is read
without error at any frequency and with any window, also where it meets its own image at 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.signals.spectra.spectrum import half_lobe, window, window_spectrum, window_sums
from gearmon.signals.transforms import quick_length, transform

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# The search narrows to three steps of the grid before; eight times come to 1e-7 bins.
_GRID = np.linspace(-1.0, 1.0, 21)
_NARROWER, _SEARCHES = 0.15, 8


@dataclass(frozen=True, kw_only=True)
class Lines:
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
) -> Lines:
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
    Lines

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
    fit = _Fit(samples, sampling_rate_hz, window_name)
    check_range("within_bins", within_bins, 0.0, 1000.0)
    wanted = np.atleast_1d(np.asarray(frequency_hz, dtype=float))
    for value in wanted:
        if not 0 < value < sampling_rate_hz / 2:
            raise ArgumentError(
                f"frequency_hz={value:g} must lie between 0 and {sampling_rate_hz / 2:g} Hz"
            )
    rows = [
        [fit.line(channel, value, within_bins) for value in wanted]
        for channel in range(fit.channels)
    ]
    return _lines(rows)


def _lines(rows: list[list[tuple[float, float, float]]]) -> Lines:
    table = np.array(rows, dtype=float).reshape(len(rows), -1, 3)
    return Lines(frequency_hz=table[..., 0], amplitude=table[..., 1], phase_rad=table[..., 2])


class _Fit:
    """Transforms of signals and the fit of lines to their bins."""

    def __init__(self, samples: FloatArray, rate: float, name: str) -> None:
        check_positive("sampling_rate_hz", rate, "Hz")
        signals = np.atleast_2d(np.asarray(samples, dtype=float))
        self.count = signals.shape[-1]
        if signals.ndim != 2 or self.count < 16:
            raise ArgumentError(f"samples: shape {signals.shape}, at least 16 values are needed")
        self.length = quick_length(self.count)
        self.rate, self.name = rate, name
        weights = window(name, self.count)
        self.bins = transform(signals, self.length, weights) / window_sums(name, self.count)[0]
        if not np.isfinite(self.bins.sum()):
            raise ArgumentError("samples: not all are finite numbers")
        self.channels = len(signals)

    def line(self, channel: int, frequency: float, within: float) -> tuple[float, float, float]:
        place = frequency * self.count / self.rate
        if within == 0.0:
            return self._at(channel, place, self._near(place))
        per_bin = self.length / self.count
        low = max(1, int(np.ceil((place - within) * per_bin)))
        high = min(self.bins.shape[-1] - 1, int((place + within) * per_bin))
        return self._peak(channel, low, max(low, high))

    def _peak(self, channel: int, low: int, high: int) -> tuple[float, float, float]:
        size = np.abs(self.bins[channel, low : high + 1])
        place = (low + int(np.argmax(size))) * self.count / self.length
        near = self._near(place)
        width = 1.5
        for _ in range(_SEARCHES):
            tried = np.clip(place + width * _GRID, 0.25, self.count / 2 - 1e-3)
            misfit = self._fitted(channel, tried, near)[1]
            place = float(tried[int(np.argmin(misfit))])
            width *= _NARROWER
        return self._at(channel, place, near)

    def _near(self, place: float) -> NDArray[np.intp]:
        """Bins about a place, as far as the main lobe reaches."""
        reach = max(2, half_lobe(self.name)) * self.length / self.count
        middle = place * self.length / self.count
        low = max(0, int(np.ceil(middle - reach)))
        high = min(self.bins.shape[-1] - 1, int(middle + reach))
        return np.arange(low, high + 1)

    def _at(self, channel: int, place: float, near: NDArray[np.intp]) -> tuple[float, float, float]:
        value = complex(self._fitted(channel, np.array([place]), near)[0][0])
        return place * self.rate / self.count, 2 * abs(value), float(np.angle(value))

    def _fitted(
        self, channel: int, places: FloatArray, near: NDArray[np.intp]
    ) -> tuple[ComplexArray, FloatArray]:
        """A/2 e^{ip} of a line at each of the places, and the misfit that it leaves."""
        at, place = near * self.count / self.length, places[:, None]
        own = window_spectrum(self.name, at - place, self.count)
        image = window_spectrum(self.name, at + place, self.count)
        mean = np.broadcast_to(window_spectrum(self.name, at, self.count), own.shape)
        columns = np.stack([own + image, 1j * (own - image), mean], axis=-1)
        matrix = np.concatenate([columns.real, columns.imag], axis=1)
        right = self.bins[channel, near]
        stacked = np.concatenate([right.real, right.imag])
        solution = np.linalg.pinv(matrix, rcond=1e-12) @ stacked
        left = stacked - np.einsum("pij,pj->pi", matrix, solution)
        return solution[:, 0] + 1j * solution[:, 1], np.einsum("pi,pi->p", left, left)
