"""How far the mean of a line over overlapping blocks may be off, told by the blocks themselves.

The scatter of the blocks is not what scatters their mean: half-overlapped blocks share noise, a
line of another stage beside the own one turns from block to block and all but cancels in the mean,
and a slow drift hardly cancels at all. What tells is the spectrum of the block series near zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# Correlation of the amplitudes of noise in neighbouring half-overlapped Hann blocks (Harris 1978).
_SHARED = 1 / 6
# Fewer blocks than this tell a mean, but no median and no slow drift.
_FEW = 9
# Slowest frequencies of the block series to either side that drift and near lines fill, and excess
# over the median from which they are believed: six values of noise reach it in 2 % of cases.
_SLOW, _EXCESS = 3, 2.0


def variance_of_mean(blocks: ComplexArray) -> FloatArray:
    """Variance of the mean of complex line amplitudes over half-overlapped Hann blocks.

    Parameters
    ----------
    blocks : ndarray of complex, shape (blocks, ...)
        Amplitudes, block by block.

    Returns
    -------
    ndarray of float, shape (...)
        E|mean - truth|^2 [unit of the amplitudes, squared]; 0 of a single block, which tells
        nothing of it.

    Notes
    -----
    Noise fills the periodogram P_k = |sum_b A_b exp(-2 pi i b k/n)|^2/n^2 of n blocks in
    proportion to 1 + 2 rho (1 - 1/n) cos(2 pi k/n), rho = 1/6; divided by that and multiplied by
    its value at k = 0, every P_k, k > 0, estimates the variance of the mean. Taken is the median
    over k, an exponential variable's median set right: lines beside the own one fill few k, as they
    turn at a steady rate. Where the mean of the six slowest k is twice as large or more, it is
    taken instead: then the line drifts, or another is too near to cancel. Of fewer than nine blocks
    the mean over all k is taken. White noise is told without bias to within about 6 %.
    """
    count = len(blocks)
    if count < 2:
        return np.zeros(blocks.shape[1:])
    shared = 2 * _SHARED * (1 - 1 / count)
    turns = np.arange(1, count) / count
    shape = (1 + shared) / (1 + shared * np.cos(2 * np.pi * turns))
    power = np.abs(np.fft.fft(blocks, axis=0)[1:] / count) ** 2
    told: FloatArray = power * shape.reshape(-1, *[1] * (blocks.ndim - 1))
    if count < _FEW:
        whole: FloatArray = told.mean(axis=0)
        return whole
    usual = np.median(told, axis=0) / _median_of_exponentials(count - 1)
    slow = 0.5 * (told[:_SLOW].mean(axis=0) + told[-_SLOW:].mean(axis=0))
    return np.where(slow > _EXCESS * usual, slow, usual)


def _median_of_exponentials(count: int) -> float:
    """Mean of the median of so many exponential variables of mean 1."""
    waits = 1.0 / np.arange(count, 0, -1)  # between one of them and the next larger
    reached = np.cumsum(waits)
    return float(0.5 * (reached[(count - 1) // 2] + reached[count // 2]))
