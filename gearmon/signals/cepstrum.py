"""Cepstra: families of sidebands gathered into single lines, and taken out again.

The real cepstrum is the inverse transform of ln|X(f)|, the power cepstrum that of ln|X(f)|^2, twice
as large. Sidebands that stand at equal distances f_r in the spectrum make a line at the quefrency
1/f_r and its multiples (rahmonics). Lines at negative amplitude mean nothing by themselves.
Randall, Mech. Syst. Signal Process. 97 (2017) 3-19.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, check_positive
from gearmon.signals.transforms import quick_length, transform

FloatArray = NDArray[np.float64]

#: Spectral lines this far below the strongest are taken as that: the logarithm of zero is none.
FLOOR_DB = 200.0


@dataclass(frozen=True, kw_only=True)
class Cepstrum:
    """Cepstrum of real signals.

    Parameters
    ----------
    quefrency_s : ndarray of float, shape (n // 2 + 1,)
        Quefrencies [s] (or turns).
    values : ndarray of float, shape (channels, n // 2 + 1)
        Real or power cepstrum [1]; the value at quefrency 0 is the mean logarithm.
    """

    quefrency_s: FloatArray
    values: FloatArray


def real_cepstrum(samples: FloatArray, rate: float) -> Cepstrum:
    """Real cepstrum, the inverse transform of ln|X|.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, n >= 16; the mean is taken off.
    rate : float
        Sampling rate [Hz], or samples a turn.

    Raises
    ------
    ArgumentError
        If there are too few samples or a signal is constant.
    """
    signals = _signals(samples, rate)
    count = quick_length(signals.shape[-1])
    values = np.fft.irfft(_log_amplitude(transform(signals, count)), n=count, axis=-1)
    return Cepstrum(
        quefrency_s=np.arange(count // 2 + 1) / rate, values=values[:, : count // 2 + 1]
    )


def _log_amplitude(lines: NDArray[np.complex128]) -> FloatArray:
    size = np.abs(lines)
    largest = size.max(axis=-1, keepdims=True)
    if (largest == 0).any():
        raise ArgumentError("samples: a signal is constant, it has no cepstrum")
    floor = largest * 10.0 ** (-FLOOR_DB / 20)
    return np.asarray(np.log(np.maximum(size, floor)), dtype=np.float64)


def _signals(samples: FloatArray, rate: float) -> FloatArray:
    check_positive("rate", rate)
    signals = np.atleast_2d(np.asarray(samples, dtype=float))
    if signals.ndim != 2 or signals.shape[-1] < 16:
        raise ArgumentError(f"samples: shape {signals.shape}, at least 16 values are needed")
    centred: FloatArray = signals - signals.mean(axis=-1, keepdims=True)
    return centred
