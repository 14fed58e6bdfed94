"""Fourier transforms of real signals: the lengths at which they are quick, windows and padding."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.fft import next_fast_len, rfft

from gearmon.signals.array_types import ComplexArray, FloatArray

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


def windowed_transforms(
    signals: Iterable[FloatArray], weights: FloatArray | float, length: int
) -> Iterator[ComplexArray]:
    """Give the transform of each signal, windowed and zero-padded, one after the other.

    Parameters
    ----------
    signals : iterable of ndarray of float, shape (n,)
    weights : ndarray of float, shape (n,), or float
        The window.
    length : int, >= n
        Transform length.

    Yields
    ------
    ndarray of complex, shape (length // 2 + 1,)
        Unscaled.
    """
    for signal in signals:
        yield np.asarray(rfft(signal * weights, length))


def transform(signals: FloatArray, length: int, weights: FloatArray | float = 1.0) -> ComplexArray:
    """Return all `windowed_transforms` at once, shape (channels, length // 2 + 1)."""
    return np.asarray(rfft(signals * weights, length, axis=-1))


def window_powers(signals: FloatArray, weights: FloatArray, length: int) -> FloatArray:
    """Squared magnitudes of `windowed_transforms`, shape (channels, length // 2 + 1)."""
    powers = np.empty((len(signals), length // 2 + 1))
    for row, lines in zip(powers, windowed_transforms(signals, weights, length), strict=True):
        np.square(lines.real, out=row)
        row += np.square(lines.imag)
    return powers
