"""Waveform indicators of a recording of any size, in one pass and bounded memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.streaming import BLOCK, RecordingStream

FloatArray = NDArray[np.float64]

_HIGHEST = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class WaveformIndicators:
    """Indicators of the waveform of each channel, as defined in `gearmon.signals.indicators`.

    Parameters
    ----------
    mean, rms, peak_to_peak : ndarray of float, shape (channels,)
        Mean; root mean square about it; range. In the unit of the channel.
    crest_factor : ndarray of float, shape (channels,)
        Largest departure from the mean over the root mean square; 0 for a constant.
    kurtosis, sixth_moment, eighth_moment : ndarray of float, shape (channels,)
        Normalised central moments of order 4, 6 and 8 (Gaussian: 3, 15, 105); 0 for a constant. Of
        a difference signal these are FM4, M6A and M8A.
    """

    mean: FloatArray
    rms: FloatArray
    peak_to_peak: FloatArray
    crest_factor: FloatArray
    kurtosis: FloatArray
    sixth_moment: FloatArray
    eighth_moment: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Moments:
    """Count, mean, extremes and sums of powers about the mean of samples seen so far.

    Parameters
    ----------
    count : int
        Samples of each channel.
    mean, low, high : ndarray of float, shape (channels,)
        Mean, smallest and largest sample.
    sums : ndarray of float, shape (9, channels)
        Sum of (x - mean)^p for p = 0 to 8.
    """

    count: int
    mean: FloatArray
    low: FloatArray
    high: FloatArray
    sums: FloatArray

    @classmethod
    def of(cls, block: FloatArray) -> Moments:
        """Return the moments of one block, shape (channels, n)."""
        count = block.shape[1]
        mean = block.mean(axis=1)
        away = block - mean[:, None]
        square = away * away
        cube, fourth = square * away, square * square
        sums = np.zeros((_HIGHEST + 1, len(block)))
        sums[0] = count
        # that of the first power is zero
        for power, left, right in (
            (2, away, away),
            (3, square, away),
            (4, square, square),
            (5, square, cube),
            (6, cube, cube),
            (7, cube, fourth),
            (8, fourth, fourth),
        ):
            sums[power] = np.einsum("cn,cn->c", left, right)
        return cls(count=count, mean=mean, low=block.min(axis=1), high=block.max(axis=1), sums=sums)

    def joined(self, other: Moments) -> Moments:
        """Return the moments of both together.

        Notes
        -----
        The binomial theorem moves the sums of either part to the joint mean. Central sums stay of
        the size of the result, so nothing cancels, however far the signal is from zero.
        """
        count = self.count + other.count
        distance = other.mean - self.mean
        mean = self.mean + distance * (other.count / count)
        sums = self._about(mean) + other._about(mean)
        return Moments(
            count=count,
            mean=mean,
            low=np.minimum(self.low, other.low),
            high=np.maximum(self.high, other.high),
            sums=sums,
        )

    def _about(self, centre: FloatArray) -> FloatArray:
        """Return the sums of powers about another centre."""
        shift = self.mean - centre
        moved = np.empty_like(self.sums)
        for power in range(_HIGHEST + 1):
            moved[power] = sum(
                comb(power, k) * shift ** (power - k) * self.sums[k] for k in range(power + 1)
            )
        return moved

    def indicators(self) -> WaveformIndicators:
        """Return the indicators of the samples seen so far."""
        variance = self.sums[2] / self.count
        rms = np.sqrt(variance)
        largest = np.maximum(self.high - self.mean, self.mean - self.low)
        return WaveformIndicators(
            mean=self.mean,
            rms=rms,
            peak_to_peak=self.high - self.low,
            crest_factor=_ratio(largest, rms),
            kurtosis=self._normalised(4),
            sixth_moment=self._normalised(6),
            eighth_moment=self._normalised(8),
        )

    def _normalised(self, order: int) -> FloatArray:
        rms = np.sqrt(self.sums[2] / self.count)
        # root by root: the eighth power of a large signal would overflow
        root = _ratio((self.sums[order] / self.count) ** (1.0 / order), rms)
        return root**order


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)


def stream_indicators(
    stream: RecordingStream,
    *,
    samples: int = BLOCK,
    progress: Callable[[float], object] | None = None,
) -> WaveformIndicators:
    """Return the waveform indicators of all channels of a stream, in one pass.

    Parameters
    ----------
    stream : RecordingStream
        The recording.
    samples : int > 0
        Samples of each channel in memory at a time.
    progress : callable, optional
        Called with the share done, from 0 to 1.

    Returns
    -------
    WaveformIndicators
        Equal to those of the whole recording but for rounding.

    Raises
    ------
    RecordingError
        If the file is damaged.
    """
    total: Moments | None = None
    for first, block in stream.blocks(samples):
        own = Moments.of(block)
        total = own if total is None else total.joined(own)
        if progress is not None:
            progress((first + block.shape[1]) / stream.shape[1])
    assert total is not None, "a stream has samples"
    return total.indicators()
