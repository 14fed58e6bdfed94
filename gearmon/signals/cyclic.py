"""Cyclic spectral coherence: which carriers are modulated at which rate.

    gamma(alpha, f) = S(f + alpha/2, f - alpha/2) / sqrt(S(f + alpha/2) S(f - alpha/2))

with S averaged over short transforms: |gamma|^2 is 0 where the bands alpha apart have nothing to do
with one another and 1 where one is the other shifted. Antoni, Mech. Syst. Signal Process. 21 (2007)
597-630; averaged cyclic periodogram.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.errors import ArgumentError, check_positive
from gearmon.signals.spectrum import hann
from gearmon.signals.transforms import batch, rows_in_cache

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class CyclicCoherence:
    """Squared modulus of the cyclic coherence of one signal.

    Parameters
    ----------
    cyclic_hz : ndarray of float, shape (a,)
        Modulation frequencies alpha [Hz] (or orders).
    frequency_hz : ndarray of float, shape (b,)
        Carrier frequencies f [Hz] (or orders).
    values : ndarray of float, shape (a, b)
        |gamma|^2, 0 to 1.
    threshold : float
        99.9 % point at one place for a signal without modulation.
    """

    cyclic_hz: FloatArray
    frequency_hz: FloatArray
    values: FloatArray
    threshold: float

    @property
    def enhanced_envelope_spectrum(self) -> FloatArray:
        """Mean of |gamma|^2 over carriers, shape (a,)."""
        return np.asarray(self.values.mean(axis=-1), dtype=np.float64)


def cyclic_coherence(
    samples: FloatArray, rate: float, cyclic_hz: ArrayLike, block: int
) -> CyclicCoherence:
    """Squared cyclic spectral coherence at chosen modulation frequencies.

    Parameters
    ----------
    samples : ndarray of float, shape (n,)
        One signal.
    rate : float
        Sampling rate [Hz], or samples a turn.
    cyclic_hz : array of float, shape (a,)
        Modulation frequencies, |alpha| < rate/2. They are resolved to rate/n.
    block : int
        Samples a block, 8 <= block <= n/8: carriers are resolved to 1.5 rate/block. Hann window,
        three quarters of overlap.

    Returns
    -------
    CyclicCoherence

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    """
    check_positive("rate", rate)
    signal = np.asarray(samples, dtype=float)
    if signal.ndim != 1:
        raise ArgumentError(f"samples: shape {signal.shape}, one row is needed")
    alphas = np.atleast_1d(np.asarray(cyclic_hz, dtype=float))
    if alphas.ndim != 1 or not np.isfinite(alphas).all() or (np.abs(alphas) >= rate / 2).any():
        raise ArgumentError(f"cyclic_hz must be numbers between -{rate / 2:g} and {rate / 2:g}")
    if not 8 <= block <= len(signal) // 8:
        raise ArgumentError(f"block={block} samples must lie in [8, {len(signal) // 8}]")
    signal = signal - signal.mean()
    hop = max(1, block // 4)
    blocks = np.lib.stride_tricks.sliding_window_view(signal, block)[::hop]
    values = np.array([_squared(blocks, hop, alpha / rate) for alpha in alphas])
    # three quarters of overlap count as half as many independent blocks
    independent = max(2.0, len(blocks) / 2)
    return CyclicCoherence(
        cyclic_hz=alphas,
        frequency_hz=rate / block * np.arange(block // 2 + 1.0),
        values=values,
        threshold=float(1 - 0.001 ** (1 / (independent - 1))),
    )


def _squared(blocks: FloatArray, hop: int, alpha: float) -> FloatArray:
    """|gamma|^2 at the carriers 0 to half the rate; alpha in cycles a sample."""
    count, block = blocks.shape
    half = block // 2 + 1
    shift = hann(block) * np.exp(-1j * np.pi * alpha * np.arange(block))
    rows = min(count, rows_in_cache(block))
    # the conjugate of an inverse transform is the forward one of the conjugate
    work = batch(block, rows, count * block, inverse=True)
    conjugate = shift.conj()
    mirrored = -np.arange(half) % block
    cross = np.zeros(half, dtype=np.complex128)
    first, second = np.zeros(half), np.zeros(half)
    for start in range(0, count, rows):
        group = blocks[start : start + rows]
        np.multiply(group, conjugate, out=work.input[: len(group)])
        lines = work.run()[: len(group)].conj()
        # f - alpha/2 of a real signal is the conjugate of the same shift at -f
        upper, lower = lines[:, :half], lines[:, mirrored]
        turn = np.exp(-2j * np.pi * alpha * hop * np.arange(start, start + len(group)))
        cross += turn @ (upper * lower)
        first += np.einsum("ij,ij->j", upper.real, upper.real)
        first += np.einsum("ij,ij->j", upper.imag, upper.imag)
        second += np.einsum("ij,ij->j", lower.real, lower.real)
        second += np.einsum("ij,ij->j", lower.imag, lower.imag)
    size = first * second
    squared = cross.real**2 + cross.imag**2
    ratio: FloatArray = np.divide(squared, size, out=np.zeros(half), where=size > 0)
    return ratio
