"""Condition indicators of waveforms and synchronous averages.

All are plain functions of arrays with time (or angle) on the last axis and return one value a
channel. Kurtosis is not in excess form: Gaussian noise has 3, 15 and 105 for the normalised fourth,
sixth and eighth moments.

References
----------
Lebold, McClintic, Campbell, Byington and Maynard, Review of vibration analysis methods for gearbox
diagnostics and prognostics, MFPT 54 (2000) 623-634.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def rms(signal: FloatArray) -> FloatArray:
    """Root mean square of the signal less its mean, shape (...,)."""
    result: FloatArray = np.std(signal, axis=-1)
    return result


def peak_to_peak(signal: FloatArray) -> FloatArray:
    """Largest less smallest value, shape (...,)."""
    result: FloatArray = np.ptp(signal, axis=-1)
    return result


def crest_factor(signal: FloatArray) -> FloatArray:
    """Largest departure from the mean over the root mean square; 0 for a constant signal."""
    centred = _centred(signal)
    peak = np.max(np.abs(centred), axis=-1)
    return _ratio(peak, rms(signal))


def normalised_moment(signal: FloatArray, order: int) -> FloatArray:
    """Central moment of even order over the matching power of the variance.

    Parameters
    ----------
    signal : ndarray of float, shape (..., n)
        The signal.
    order : int
        4 (kurtosis, FM4 of a difference signal), 6 (M6A) or 8 (M8A).

    Returns
    -------
    ndarray of float, shape (...,)
        N^(order/2 - 1) sum x^order / (sum x^2)^(order/2); invariant to scale; 0 for a constant.
    """
    # scaled first, so that the eighth power of a large signal cannot overflow
    centred = _centred(signal)
    scale = np.std(signal, axis=-1, keepdims=True)
    standard = np.divide(centred, scale, out=np.zeros_like(centred), where=scale > 0)
    result: FloatArray = np.mean(standard**order, axis=-1)
    return result


def kurtosis(signal: FloatArray) -> FloatArray:
    """Normalised fourth moment: 3 for Gaussian noise, 1.5 for a sine."""
    return normalised_moment(signal, 4)


def fm0(average: FloatArray, mesh_amplitude: FloatArray) -> FloatArray:
    """Peak to peak of the synchronous average over the sum of its mesh harmonics' amplitudes.

    Parameters
    ----------
    average : ndarray of float, shape (..., n)
        Synchronous average.
    mesh_amplitude : ndarray of float, shape (..., harmonics)
        Amplitudes (peak, not power) of the mesh harmonics.

    Returns
    -------
    ndarray of float, shape (...,)
        Invariant to scale; rises with impacts and when the mesh harmonics fall.
    """
    return _ratio(peak_to_peak(average), np.sum(mesh_amplitude, axis=-1))


def energy_ratio(difference: FloatArray, regular: FloatArray) -> FloatArray:
    """Root mean square of the difference signal over that of the regular meshing signal."""
    return _ratio(rms(difference), rms(regular))


def sideband_energy_ratio(sideband_amplitude: FloatArray, mesh_amplitude: FloatArray) -> FloatArray:
    """Sum of the sideband amplitudes (+-1 to +-6) over that of the mesh fundamental (SER)."""
    return _ratio(np.sum(sideband_amplitude, axis=-1), mesh_amplitude)


def _centred(signal: FloatArray) -> FloatArray:
    result: FloatArray = signal - np.mean(signal, axis=-1, keepdims=True)
    return result


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    above, below = np.asarray(above, dtype=float), np.asarray(below, dtype=float)
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)
