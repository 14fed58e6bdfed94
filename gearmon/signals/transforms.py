"""Fourier transforms of real signals; the only module that chooses a library for them.

They go through FFTW with plans that are held, one and a half times to twice as fast as NumPy's.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.array_types import ComplexArray, FloatArray

# Buffers of so many numbers stay in the cache of a processor core.
_CACHED = 1 << 15
# Plans held by each thread, and the largest buffer that is held [numbers].
_PLANS_HELD, _LARGEST_HELD = 12, 1 << 22
# Up to here any length transforms in milliseconds; above, awkward ones take ten times as long.
_ANY_LENGTH_BELOW = 1 << 14


def quick_length(length: int) -> int:
    """Return a transform length >= `length` that is never slow, `length` itself where it is not.

    Short lengths and those without a prime factor above seven are kept; others are rounded up to
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
    """Return whether a number has no prime factor above seven: transforms of it are quick."""
    for prime in (2, 3, 5, 7):
        while length % prime == 0:
            length //= prime
    return length == 1


def fast_length(length: int) -> int:
    """Return the smallest even 5-smooth number >= `length`: a length that transforms quickly.

    Examples
    --------
    >>> fast_length(10007)
    10240
    """
    from scipy.fft import next_fast_len

    return 2 * int(next_fast_len(max(1, -(-length // 2)), real=True))


def rows_in_cache(length: int) -> int:
    """Return how many transforms of a length to take at a time."""
    return max(1, _CACHED // length)


class Batch:
    """Equal Fourier transforms, some at a time, between two buffers of their own.

    Parameters
    ----------
    length : int
        Transform length.
    rows : int
        Transforms at a time.
    inverse : bool
        Whether these are complex inverse transforms (unscaled), not forward ones of real numbers.
    """

    def __init__(self, length: int, rows: int, inverse: bool) -> None:
        backend = _pyfftw()
        kind = np.complex128 if inverse else np.float64
        empty: Callable[..., Any] = np.empty if backend is None else backend.empty_aligned
        self.input: NDArray[Any] = empty((rows, length), dtype=kind)
        bins = length if inverse else length // 2 + 1
        self.output: ComplexArray = empty((rows, bins), dtype=np.complex128)
        self._inverse, self._plan = inverse, None
        if backend is not None:
            way = "FFTW_BACKWARD" if inverse else "FFTW_FORWARD"
            self._plan = backend.FFTW(
                self.input, self.output, axes=(-1,), direction=way, flags=("FFTW_ESTIMATE",)
            )

    def fill(self, signal: FloatArray, weights: FloatArray | float = 1.0) -> None:
        """Put a weighted signal into the first row, and zeros behind it."""
        np.multiply(signal, weights, out=self.input[0, : len(signal)])
        self.input[0, len(signal) :] = 0.0

    def run(self) -> ComplexArray:
        """Transform what stands in `input` and return `output`."""
        if self._plan is not None:
            self._plan.execute()
        elif self._inverse:
            self.output[:] = np.fft.ifft(self.input, axis=-1, norm="forward")
        else:
            self.output[:] = np.fft.rfft(self.input, axis=-1)
        return self.output


def _pyfftw() -> Any:
    try:
        import pyfftw
    except ImportError:  # FFTW is GPL: whoever removes it keeps a complete product
        return None
    return pyfftw


_HELD = threading.local()


def batch(length: int, rows: int = 1, *, inverse: bool = False) -> Batch:
    """Return the buffers and the plan for equal transforms; this thread's own, used again.

    Parameters
    ----------
    length, rows : int
        Transform length, and transforms at a time.
    inverse : bool
        As for `Batch`.
    """
    if length * rows > _LARGEST_HELD:
        return Batch(length, rows, inverse)
    own = _HELD.__dict__.setdefault("made", lru_cache(maxsize=_PLANS_HELD)(Batch))
    return cast(Batch, own(length, rows, inverse))


def windowed_transforms(
    signals: Iterable[FloatArray], weights: FloatArray | float, length: int
) -> Iterator[ComplexArray]:
    """Give the transform of each signal, windowed and zero-padded; valid until the next one.

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
    one = batch(length)
    for signal in signals:
        one.fill(signal, weights)
        yield one.run()[0]


def transform(signals: FloatArray, length: int, weights: FloatArray | float = 1.0) -> ComplexArray:
    """Return all `windowed_transforms`, shape (channels, length // 2 + 1)."""
    result = np.empty((len(signals), length // 2 + 1), dtype=np.complex128)
    for row, lines in zip(result, windowed_transforms(signals, weights, length), strict=True):
        row[:] = lines
    return result


def window_powers(signals: FloatArray, weights: FloatArray, length: int) -> FloatArray:
    """Squared magnitudes of `windowed_transforms`, shape (channels, length // 2 + 1)."""
    powers = np.empty((len(signals), length // 2 + 1))
    for row, lines in zip(powers, windowed_transforms(signals, weights, length), strict=True):
        np.square(lines.real, out=row)
        row += np.square(lines.imag)
    return powers
