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

from gearmon.errors import ArgumentError, check_positive, check_range
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

    def rahmonics(self, spacing_hz: float, count: int = 5) -> FloatArray:
        """Largest value near the rahmonics of a sideband spacing, shape (channels, count).

        Parameters
        ----------
        spacing_hz : float, > 0
            Distance of the sidebands [Hz] (or orders).
        count : int, >= 1
            Rahmonics, as far as the cepstrum reaches.

        Raises
        ------
        ArgumentError
            If the first rahmonic lies beyond the cepstrum.
        """
        check_positive("spacing_hz", spacing_hz)
        step = float(self.quefrency_s[1])
        last = len(self.quefrency_s) - 1
        places = [round(k / spacing_hz / step) for k in range(1, count + 1)]
        places = [place for place in places if 1 < place < last]
        if not places:
            raise ArgumentError(
                f"spacing_hz={spacing_hz:g}: its quefrency of {1 / spacing_hz:.3g} s lies beyond "
                f"the cepstrum of {self.quefrency_s[-1]:.3g} s; record longer"
            )
        return np.array([self.values[:, p - 1 : p + 2].max(axis=-1) for p in places]).T


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


def power_cepstrum(samples: FloatArray, rate: float) -> Cepstrum:
    """Power cepstrum, the inverse transform of ln|X|^2: twice the real cepstrum."""
    real = real_cepstrum(samples, rate)
    return Cepstrum(quefrency_s=real.quefrency_s, values=2.0 * real.values)


def lifter_sidebands(
    samples: FloatArray,
    rate: float,
    spacing_hz: float,
    *,
    keep: bool = False,
    rahmonics: int | None = None,
    half_width: int = 1,
) -> FloatArray:
    """Take a family of equally spaced lines out of signals, or keep nothing else.

    The cepstrum is set to zero at the rahmonics of the spacing (or everywhere but there and at
    quefrency 0), and the signal made anew with its own phases.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, best against angle, where lines stand still.
    rate : float
        Sampling rate [Hz], or samples a turn.
    spacing_hz : float, > 0
        Distance of the lines [Hz], or orders.
    keep : bool
        Keep the family instead of taking it out.
    rahmonics : int, optional
        How many; by default all.
    half_width : int
        Samples to either side of each rahmonic, 0 to 20; grows with the number of the rahmonic by
        the rounding of the quefrency.

    Returns
    -------
    ndarray of float, shape (channels, n)
        Signals without their mean.

    Raises
    ------
    ArgumentError
        If an argument is out of its range or the spacing is finer than the record resolves.
    """
    signals = _signals(samples, rate)
    check_positive("spacing_hz", spacing_hz)
    check_range("half_width", half_width, 0, 20)
    given = signals.shape[-1]
    count = quick_length(given)
    first = rate / spacing_hz
    if not 2 <= first < count / 2:
        raise ArgumentError(
            f"spacing_hz={spacing_hz:g} must lie in ({2 * rate / count:.3g}, {rate / 2:g}]"
        )
    most = int(count / 2 / first) if rahmonics is None else min(rahmonics, int(count / 2 / first))
    gate = np.zeros(count, dtype=bool)
    for number in range(1, most + 1):
        low = max(1, int(np.floor(number * first)) - half_width)
        high = min(count - 1, int(np.ceil(number * first)) + half_width)
        gate[low : high + 1] = True
        gate[count - high : count - low + 1] = True
    if keep:
        gate = ~gate
        gate[0] = False
    lines = transform(signals, count)
    logarithm = _log_amplitude(lines)
    cepstrum = np.fft.irfft(logarithm, n=count, axis=-1)
    cepstrum[:, gate] = 0.0
    edited = np.fft.rfft(cepstrum, axis=-1).real
    change = np.exp(edited - logarithm)
    result: FloatArray = np.fft.irfft(lines * change, n=count, axis=-1)[:, :given]
    return result


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
