"""Spectral kurtosis and the fast kurtogram: where in frequency a signal is impulsive.

    K(f) = <|X(t, f)|^4> / <|X(t, f)|^2>^2 - 2

with X the complex envelope of a band about f: 0 for stationary Gaussian noise, -1 for a steady
tone, large where impacts pass. The kurtogram maps K over centre frequency and bandwidth; its
maximum is the band to demodulate. Antoni, Mech. Syst. Signal Process. 20 (2006) 282-307 and 21
(2007) 108-124.

Here one transform of the whole record is cut into bands, each of which is transformed back by
itself: every level costs one batch of short inverse transforms, some at a time in buffers that fit
the cache, and bands of a level neither overlap nor leak.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.signals.transforms import (
    batch,
    fast_length,
    is_smooth,
    quick_length,
    rows_in_cache,
    transform,
)

FloatArray = NDArray[np.float64]

#: Samples of the envelope that a band keeps at least: fewer make a kurtosis meaningless.
LEAST_SAMPLES = 32
_PIECE = 1 << 14


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
        rows = []
        for number, (count, level) in enumerate(zip(self.bands, self.kurtosis, strict=True)):
            width = self.rate / 2 / count
            rows += [
                {
                    "level": number,
                    "bandwidth_hz": width,
                    "low_hz": band * width,
                    "high_hz": (band + 1) * width,
                    "kurtosis": float(value),
                }
                for band, value in enumerate(level)
            ]
        return rows


def kurtogram(samples: FloatArray, rate: float, levels: int | None = None) -> Kurtogram:
    """Fast kurtogram of one signal.

    Parameters
    ----------
    samples : ndarray of float, shape (n,)
        The signal, n >= 64.
    rate : float
        Sampling rate [Hz], > 0.
    levels : int, optional
        Halvings of the bandwidth, 0 to 12, with thirds between: 2 * levels rows and one. By default
        as many as leave 32 samples of every envelope, at most 8.

    Returns
    -------
    Kurtogram

    Raises
    ------
    ArgumentError
        If the signal is too short for that many levels, constant, or an argument is out of range.
    """
    check_positive("rate", rate)
    signal = np.asarray(samples, dtype=float)
    if signal.ndim != 1 or len(signal) < 2 * LEAST_SAMPLES:
        raise ArgumentError(
            f"samples: shape {signal.shape}, one row of at least {2 * LEAST_SAMPLES} is needed"
        )
    half = len(signal) // 2
    possible = min(12, int(np.log2(half / LEAST_SAMPLES)))
    wanted = min(8, possible) if levels is None else int(check_range("levels", levels, 0, 12))
    if wanted > possible:
        raise ArgumentError(
            f"levels={wanted}: {len(signal)} samples allow {possible}; record longer"
        )
    if np.ptp(signal) == 0:
        raise ArgumentError("samples: the signal is constant, it has no kurtosis")
    length = quick_length(len(signal))
    lines = transform((signal - signal.mean())[None, :], length)[0, 1 : length // 2 + 1]
    counts = sorted({1} | {2**k for k in range(wanted + 1)} | {3 * 2**k for k in range(wanted)})
    share = len(signal) / length
    return Kurtogram(
        bands=tuple(counts),
        kurtosis=tuple(_level(lines, count, share) for count in counts),
        rate=float(rate),
    )


def _level(lines: NDArray[np.complex128], count: int, share: float) -> FloatArray:
    """Kurtosis of the envelopes of equal bands; a few lines at the top are left over.

    `share` is that of the record in the transform: what was padded has no say.
    """
    width = len(lines) // count
    # twice as many points as lines: the squared envelope is then sampled without aliasing, and its
    # mean square is exact wherever the impacts fall between the points
    length = 2 * width if is_smooth(width) else fast_length(2 * width)
    rows = min(count, rows_in_cache(length))
    work = batch(length, rows, 2 * len(lines), inverse=True)
    work.input[:, width:] = 0.0
    kept = max(2, int(length * share))
    bands = lines[: width * count].reshape(count, width)
    mean, square = np.empty(count), np.empty(count)
    for first in range(0, count, rows):
        group = slice(first, min(count, first + rows))
        size = group.stop - first
        work.input[:size, :width] = bands[group]
        mean[group], square[group] = _power_sums(work.run()[:size, :kept])
    mean /= kept
    square /= kept
    # an empty band has no kurtosis; rounding noise beside strong bands must not be taken for one
    silent = mean <= 1e-24 * mean.max(initial=0.0)
    ratio = np.divide(square, mean**2, out=np.full(count, 2.0), where=~silent)
    return np.asarray(ratio - 2.0, dtype=np.float64)


def _power_sums(envelopes: NDArray[np.complex128]) -> tuple[FloatArray, FloatArray]:
    """Add up |x|^2 and |x|^4 of each row, in pieces that stay in the cache; spoils the rows."""
    first, second = np.zeros(len(envelopes)), np.zeros(len(envelopes))
    for start in range(0, envelopes.shape[-1], _PIECE):
        parts = envelopes[:, start : start + _PIECE].view(np.float64)
        parts *= parts
        power = parts[:, 0::2] + parts[:, 1::2]
        first += power.sum(axis=-1)
        second += np.einsum("ij,ij->i", power, power)
    return first, second
