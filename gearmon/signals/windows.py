"""Windows of a Fourier transform: weights, spectra, and what they do to amplitude and noise.

All are sums of cosines, w_n = sum_k (-1)^k a_k cos(2 pi k n / N), periodic in N. Their spectra are
then a few shifted Dirichlet kernels in closed form, from which a line that falls between the bins
of a transform is read without error.

References
----------
Harris, Proc. IEEE 66 (1978) 51-83 (Hann, Blackman-Harris with four terms, noise bandwidth).
D'Antona and Ferrero, Digital Signal Processing for Measurement Systems, Springer 2006 (flat-top
with five terms).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, nearest_name

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Coefficients a_0, a_1, ... of each window.
TERMS = {
    "hann": (0.5, 0.5),
    "flat-top": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
    "blackman-harris": (0.35875, 0.48829, 0.14128, 0.01168),
    "rectangular": (1.0,),
}
# Longer windows are made anew each time instead of being held in memory.
_LONGEST_HELD = 1 << 21


def window(name: str, length: int) -> FloatArray:
    """Return the weights of a window, periodic in `length`; read-only.

    Parameters
    ----------
    name : {"hann", "flat-top", "blackman-harris", "rectangular"}
    length : int, >= 1

    Returns
    -------
    ndarray of float, shape (length,)

    Raises
    ------
    ArgumentError
        If there is no such window.
    """
    terms = window_terms(name)
    return _held(terms, length) if length <= _LONGEST_HELD else _weights(terms, length)


def window_terms(name: str) -> tuple[float, ...]:
    """Return the coefficients of a window.

    Raises
    ------
    ArgumentError
        If there is no such window.
    """
    if name not in TERMS:
        near = nearest_name(name, TERMS)
        hint = f"; did you mean {near!r}?" if near else ""
        raise ArgumentError(f"window={name!r} must be one of {', '.join(TERMS)}{hint}")
    return TERMS[name]


def window_sums(name: str, length: int) -> tuple[float, float]:
    """Return the sum of the weights and the sum of their squares."""
    terms = window_terms(name)
    if length <= 2 * len(terms):  # a cosine may then stand on its own image
        weights = window(name, length)
        return float(weights.sum()), float(weights @ weights)
    return length * terms[0], length * (terms[0] ** 2 + 0.5 * sum(a**2 for a in terms[1:]))


def noise_bandwidth(name: str) -> float:
    """Return the equivalent noise bandwidth of a window in bins: 1.5 for Hann, 1 for none."""
    terms = window_terms(name)
    return (terms[0] ** 2 + 0.5 * sum(a**2 for a in terms[1:])) / terms[0] ** 2


def half_lobe(name: str) -> int:
    """Return half the width of the main lobe of a window in bins: as many as it has terms."""
    return len(window_terms(name))


def window_spectrum(name: str, offset: FloatArray, length: int) -> ComplexArray:
    """Transform of a window at any distance from its middle, 1 at none.

    Parameters
    ----------
    name : str
        The window.
    offset : ndarray of float
        Distance in bins, of any shape.
    length : int
        Length of the window.

    Returns
    -------
    ndarray of complex, shape of `offset`
        sum_n w_n exp(-2 pi i offset n / N) / sum_n w_n.
    """
    terms = window_terms(name)
    result = terms[0] * _dirichlet(offset, length)
    for k, term in enumerate(terms[1:], start=1):
        half = 0.5 * term * (-1) ** k
        result = result + half * (_dirichlet(offset - k, length) + _dirichlet(offset + k, length))
    return np.asarray(result / terms[0], dtype=np.complex128)


def _dirichlet(offset: FloatArray, length: int) -> ComplexArray:
    """Mean of exp(-2 pi i offset n / N) over n = 0 ... N-1."""
    # reduced to half a period about zero, so that sin(pi x / N) vanishes at x = 0 only
    x = offset - length * np.round(offset / length)
    size = np.sinc(x) / np.sinc(x / length)
    return np.asarray(size * np.exp(-1j * np.pi * x * (length - 1) / length), dtype=np.complex128)


@lru_cache(maxsize=4)
def _held(terms: tuple[float, ...], length: int) -> FloatArray:
    return _weights(terms, length)


def _weights(terms: tuple[float, ...], length: int) -> FloatArray:
    weights = np.full(length, terms[0])
    turn = 2 * np.pi * np.arange(length) / length
    for k, term in enumerate(terms[1:], start=1):
        weights += (-1) ** k * term * np.cos(k * turn)
    weights.flags.writeable = False
    return weights
