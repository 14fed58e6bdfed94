"""Fourier transforms of real signals; the only module that chooses a library for them.

Short or single transforms go through NumPy, many or long ones through FFTW with plans that are
held: loading FFTW costs more than it saves until some millions of samples are transformed.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.array_types import ComplexArray, FloatArray

# Samples in equal transforms from which the import of FFTW (a quarter of a second) pays off, and
# those of windowed pieces of one recording: so long a one loads it for its order lines as well.
_PLANS_PAY_FROM, _WINDOWED_PAYS_FROM = 1 << 20, 1 << 22
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


def windowed_transforms(
    signals: FloatArray, weights: FloatArray, length: int, total: int
) -> Iterator[ComplexArray]:
    """Give the transform of each signal, windowed and zero-padded; valid until the next one.

    Parameters
    ----------
    signals : ndarray of float, shape (channels, n)
    weights : ndarray of float, shape (n,)
        The window.
    length : int, >= n
        Transform length.
    total : int
        Samples that the caller will transform in all at this length; decides which library is
        worth loading.

    Yields
    ------
    ndarray of complex, shape (length // 2 + 1,)
        Unscaled.
    """
    one = batch(length, 1, total if total >= _WINDOWED_PAYS_FROM else 0)
    for signal in signals:
        fill(one, signal, len(weights), weights)
        yield one.run()[0]


def window_powers(signals: FloatArray, weights: FloatArray, length: int, total: int) -> FloatArray:
    """Squared magnitudes of `windowed_transforms`, shape (channels, length // 2 + 1)."""
    powers = np.empty((len(signals), length // 2 + 1))
    for row, lines in zip(
        powers, windowed_transforms(signals, weights, length, total), strict=True
    ):
        np.square(lines.real, out=row)
        row += np.square(lines.imag)
    return powers


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
    planned : bool
        Whether to use FFTW, if it is there.
    """

    def __init__(self, length: int, rows: int, *, inverse: bool, planned: bool) -> None:
        backend: Any = _pyfftw() if planned else None
        bins = length if inverse else length // 2 + 1
        kind = np.complex128 if inverse else np.float64
        empty: Callable[..., Any] = np.empty if backend is None else backend.empty_aligned
        self.input: NDArray[Any] = empty((rows, length), dtype=kind)
        self.output: ComplexArray = empty((rows, bins), dtype=np.complex128)
        self._inverse = inverse
        self._length = length
        self._plan = None
        if backend is not None:
            self._plan = backend.FFTW(
                self.input,
                self.output,
                axes=(-1,),
                direction="FFTW_BACKWARD" if inverse else "FFTW_FORWARD",
                flags=("FFTW_ESTIMATE",),
                threads=1,
            )

    def run(self) -> ComplexArray:
        """Transform what stands in `input` and return `output`."""
        if self._plan is not None:
            self._plan.execute()
        elif self._inverse:
            self.output[:] = np.fft.ifft(self.input, axis=-1, norm="forward")
        else:
            self.output[:] = np.fft.rfft(self.input, axis=-1)
        return self.output


_HELD = threading.local()


def batch(length: int, rows: int, total: int, *, inverse: bool = False) -> Batch:
    """Return the buffers and the plan for equal transforms; this thread's own, used again.

    Parameters
    ----------
    length, rows : int
        Transform length, and transforms at a time.
    total : int
        Samples that will be transformed in all; decides which library is worth loading.
    inverse : bool
        As for `Batch`.
    """
    planned = total >= _PLANS_PAY_FROM
    if length * rows > _LARGEST_HELD:
        return Batch(length, rows, inverse=inverse, planned=planned)
    held: OrderedDict[tuple[int, int, bool, bool], Batch]
    held = _HELD.__dict__.setdefault("batches", OrderedDict())
    key = (length, rows, inverse, planned)
    if key not in held:
        held[key] = Batch(length, rows, inverse=inverse, planned=planned)
        if len(held) > _PLANS_HELD:
            held.popitem(last=False)
    held.move_to_end(key)
    return held[key]


def rows_in_cache(length: int) -> int:
    """Return how many transforms of a length to take at a time."""
    return max(1, _CACHED // length)


def _pyfftw() -> Any:
    try:
        import pyfftw
    except ImportError:  # FFTW is GPL: whoever removes it keeps a complete product
        return None
    return pyfftw


def transform(signals: FloatArray, length: int, weights: FloatArray | None = None) -> ComplexArray:
    """Return the Fourier transform of whole signals, windowed and zero-padded.

    Parameters
    ----------
    signals : ndarray of float, shape (channels, n)
    length : int, >= n
    weights : ndarray of float, shape (n,), optional
        The window.

    Returns
    -------
    ndarray of complex, shape (channels, length // 2 + 1)
        Unscaled.
    """
    count = signals.shape[-1]
    result = np.empty((len(signals), length // 2 + 1), dtype=np.complex128)
    one = batch(length, 1, signals.size)
    for row, signal in enumerate(signals):
        fill(one, signal, count, weights)
        result[row] = one.run()[0]
    return result


def fill(one: Batch, signal: FloatArray, count: int, weights: FloatArray | None) -> None:
    """Put `count` samples, weighted, into the first row of a batch, and zeros behind them."""
    one.input[0, count:] = 0.0
    if weights is None:
        one.input[0, :count] = signal
    else:
        np.multiply(signal, weights, out=one.input[0, :count])
