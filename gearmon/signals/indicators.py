"""Condition indicators of waveforms and synchronous averages.

All are plain functions of arrays with time (or angle) on the last axis and return one value a
channel. Kurtosis is not in excess form: Gaussian noise has 3, 15 and 105 for the normalised fourth,
sixth and eighth moments.

What each wants: FM0, the sideband indicators and NB4 a synchronous average; NA4 the residual
signal (the average less shaft and mesh harmonics); FM4, M6A, M8A and the energy ratio the
difference signal (the residual less the first sidebands).

NA4 and NB4 look back over a run. NA4 is the fourth moment of the residual signal of the newest
record over the square of the variance averaged over the run so far: unlike FM4 it goes on rising
when damage spreads from one tooth to many, for the mean variance lags behind. NB4 is the same of
the envelope of the band about a mesh harmonic. NA4* and NB4* divide by the variance of the healthy
baseline at the start of the run.

The history is explicit: a value object that each record extends by one row of variances. Nothing is
remembered elsewhere.

References
----------
Lebold, McClintic, Campbell, Byington and Maynard, Review of vibration analysis methods for gearbox
diagnostics and prognostics, MFPT 54 (2000) 623-634.
Zakrajsek, Townsend and Decker, NASA TM-105950 (1993), NA4; Zakrajsek, Handschuh and Decker, NASA
TM-106043 (1994), NB4; Decker, Handschuh and Zakrajsek, NASA TM-106553 (1994), NA4*.
"""

from __future__ import annotations

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError

# Pieces that stay in the cache of a processor core: a long recording is read twice, never copied.
_PIECE = 1 << 15


def rms(signal: FloatArray) -> FloatArray:
    """Root mean square of the signal less its mean, shape (...,)."""
    return np.asarray(np.std(signal, axis=-1))


def peak_to_peak(signal: FloatArray) -> FloatArray:
    """Largest less smallest value, shape (...,)."""
    return np.asarray(np.ptp(signal, axis=-1))


def crest_factor(signal: FloatArray) -> FloatArray:
    """Largest departure from the mean over the root mean square; 0 for a constant signal."""
    return _ratio(np.max(np.abs(_centred(signal)), axis=-1), rms(signal))


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
    standard = _ratio(_centred(signal), np.std(signal, axis=-1, keepdims=True))
    # of squares: 2 ns a value, where other powers take 45
    return np.asarray(np.mean((standard**2) ** (order // 2), axis=-1))


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


def sideband_index(first_sidebands: FloatArray) -> FloatArray:
    """Mean amplitude of the sidebands +-1 of the mesh fundamental, in the signal's unit.

    Parameters
    ----------
    first_sidebands : ndarray of float, shape (..., 2)
        Amplitudes of the lines -1 and +1.
    """
    return np.asarray(np.mean(first_sidebands, axis=-1))


def sideband_level_factor(first_sidebands: FloatArray, average: FloatArray) -> FloatArray:
    """Sum of the amplitudes of the sidebands +-1 over the standard deviation of the average.

    Parameters
    ----------
    first_sidebands : ndarray of float, shape (..., 2)
        Amplitudes of the lines -1 and +1 of the mesh fundamental.
    average : ndarray of float, shape (..., n)
        Synchronous average.

    Returns
    -------
    ndarray of float, shape (...,)
        Invariant to scale.
    """
    return _ratio(np.sum(first_sidebands, axis=-1), rms(average))


def describe_waveform(signal: FloatArray) -> dict[str, float]:
    """Describe one long signal in two passes, piece by piece.

    Parameters
    ----------
    signal : ndarray of float, shape (n,)
        The signal, n >= 1.

    Returns
    -------
    dict of str to float
        "rms", "peak to peak", "crest factor" and "kurtosis", as the functions of these names.
    """
    pieces = [signal[start : start + _PIECE] for start in range(0, len(signal), _PIECE)]
    total, least, most = zip(*((own.sum(), own.min(), own.max()) for own in pieces), strict=True)
    mean, low, high = float(np.sum(total)) / len(signal), float(min(least)), float(max(most))
    peak = max(high - mean, mean - low)
    # scaled by the peak, so that no power overflows or vanishes
    scale = 1.0 / peak if peak > 0 else 1.0
    second = fourth = 0.0
    for piece in pieces:
        square = piece - mean
        square *= scale
        square *= square
        second += float(square.sum())
        # no product of vectors: BLAS would wake its threads for each piece
        fourth += float(np.square(square).sum())
    size = float(np.sqrt(second / len(signal))) / scale
    return {
        "rms": size,
        "peak to peak": high - low,
        "crest factor": peak / size if size > 0 else 0.0,
        "kurtosis": fourth * len(signal) / second**2 if second > 0 else 0.0,
    }


def _centred(signal: FloatArray) -> FloatArray:
    return np.asarray(signal - np.mean(signal, axis=-1, keepdims=True))


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    above, below = np.asarray(above, dtype=float), np.asarray(below, dtype=float)
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)


def na4(residual: FloatArray, variances: FloatArray, baseline: int | None = None) -> FloatArray:
    """NA4 of the newest record of a run; of an envelope this is NB4, with a baseline NA4*.

    Parameters
    ----------
    residual : ndarray of float, shape (channels, n)
        Residual signal of the newest record (NB4: envelope of the band about a mesh harmonic).
    variances : ndarray of float, shape (records, channels)
        Of these signals of the records so far, oldest first, the newest one included.
    baseline : int, optional
        Records at the start of the run that were healthy: later ones do not enter the denominator.

    Returns
    -------
    ndarray of float, shape (channels,)
        mean (r - rbar)^4 / (mean over records of the variance)^2: 3 for Gaussian noise of unchanged
        size, the kurtosis in the first record; 0 where nothing has vibrated.

    Raises
    ------
    ArgumentError
        If `baseline` is below 1, the run is empty or has other channels.

    Examples
    --------
    >>> residual = np.array([[1.0, -1.0, 1.0, -1.0], [3.0, 0.0, -3.0, 0.0]])
    >>> na4(residual, np.var(residual, axis=-1)[None])
    array([1., 2.])
    """
    if baseline is not None and baseline < 1:
        raise ArgumentError(f"baseline={baseline} records must be at least 1")
    if not len(variances) or variances.shape[1] != len(residual):
        raise ArgumentError(
            f"variances: shape {np.shape(variances)}, must be (records, {len(residual)}), one "
            "record or more"
        )
    # scaled first, so that the fourth power cannot overflow
    standard = _ratio(_centred(residual), np.sqrt(variances[:baseline].mean(axis=0))[:, None])
    return np.asarray(np.mean((standard**2) ** 2, axis=-1), dtype=np.float64)
