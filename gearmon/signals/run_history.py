"""Indicators that look back over a run: NA4 and NB4, with the history that they divide by.

NA4 is the fourth moment of the residual signal of the newest record over the square of the variance
averaged over the run so far: unlike FM4 it goes on rising when damage spreads from one tooth to
many, for the mean variance lags behind. NB4 is the same of the envelope of the band about a mesh
harmonic. NA4* and NB4* divide by the variance of the healthy baseline at the start of the run.

The history is explicit: a value object that each record extends by one row of variances. Nothing is
remembered elsewhere.

References
----------
Zakrajsek, Townsend and Decker, NASA TM-105950 (1993), NA4; Zakrajsek, Handschuh and Decker, NASA
TM-106043 (1994), NB4; Decker, Handschuh and Zakrajsek, NASA TM-106553 (1994), NA4*.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class RunHistory:
    """Variances of the records of a run, oldest first.

    Parameters
    ----------
    variances : ndarray of float, shape (records, channels)
        Mean square departure of each record from its mean, >= 0.

    Raises
    ------
    ArgumentError
        If the shape is wrong or a variance is negative or not finite.

    Examples
    --------
    >>> history = RunHistory.of(2)
    >>> residual = np.array([[1.0, -1.0, 1.0, -1.0], [3.0, 0.0, -3.0, 0.0]])
    >>> history = history.with_record(residual)
    >>> na4(residual, history)
    array([1., 2.])
    """

    variances: FloatArray

    def __post_init__(self) -> None:
        """Check the variances."""
        own = np.array(self.variances, dtype=float)
        if own.ndim != 2 or own.shape[1] == 0:
            raise ArgumentError(f"variances: shape {own.shape}, must be (records, channels)")
        if own.size and not (np.isfinite(own).all() and own.min() >= 0):
            raise ArgumentError("variances: each must be a finite number >= 0")
        own.flags.writeable = False
        object.__setattr__(self, "variances", own)

    @classmethod
    def of(cls, channels: int) -> RunHistory:
        """Return the history of a run that has not begun, for so many channels."""
        return cls(variances=np.empty((0, channels)))

    @property
    def records(self) -> int:
        """Records so far."""
        return len(self.variances)

    def with_record(self, signal: FloatArray) -> RunHistory:
        """Return the history with one more record.

        Parameters
        ----------
        signal : ndarray of float, shape (channels, n)
            Its residual signal (for NA4) or envelope (for NB4); n may differ from record to record.

        Raises
        ------
        ArgumentError
            If the number of channels differs.
        """
        rows = np.atleast_2d(np.asarray(signal, dtype=float))
        if len(rows) != self.variances.shape[1]:
            raise ArgumentError(
                f"signal: {len(rows)} channels, the history has {self.variances.shape[1]}"
            )
        return RunHistory(variances=np.vstack([self.variances, np.var(rows, axis=-1)]))

    def mean_variance(self, records: int | None = None) -> FloatArray:
        """Mean variance of the first so many records, of all by default; shape (channels,).

        Raises
        ------
        ArgumentError
            If the history has no or not so many records.
        """
        wanted = self.records if records is None else records
        if not 1 <= wanted <= self.records:
            raise ArgumentError(
                f"records={wanted} must lie in [1, {self.records}], the records of the run"
            )
        return np.asarray(self.variances[:wanted].mean(axis=0), dtype=np.float64)


def na4(residual: FloatArray, history: RunHistory) -> FloatArray:
    """NA4 of the newest record of a run; of an envelope this is NB4.

    Parameters
    ----------
    residual : ndarray of float, shape (channels, n)
        Residual signal of the newest record (NB4: envelope of the band about a mesh harmonic).
    history : RunHistory
        The run up to and with this record.

    Returns
    -------
    ndarray of float, shape (channels,)
        mean (r - rbar)^4 / (mean over records of the variance)^2: 3 for Gaussian noise of unchanged
        size, the kurtosis in the first record; 0 where nothing has vibrated.

    Raises
    ------
    ArgumentError
        If the history is empty.
    """
    return _fourth(residual, history.mean_variance())


def na4_frozen(residual: FloatArray, history: RunHistory, baseline: int) -> FloatArray:
    """NA4* of the newest record: the denominator stays that of a healthy baseline.

    Parameters
    ----------
    residual : ndarray of float, shape (channels, n)
        As for `na4`.
    history : RunHistory
        The run up to and with this record.
    baseline : int
        Records at the start of the run that were healthy; within them NA4* is NA4.

    Returns
    -------
    ndarray of float, shape (channels,)

    Raises
    ------
    ArgumentError
        If `baseline` is below 1 or the history is empty.
    """
    if baseline < 1:
        raise ArgumentError(f"baseline={baseline} records must be at least 1")
    return _fourth(residual, history.mean_variance(min(baseline, max(1, history.records))))


def _fourth(signal: FloatArray, variance: FloatArray) -> FloatArray:
    rows = np.atleast_2d(np.asarray(signal, dtype=float))
    if len(rows) != len(variance):
        raise ArgumentError(f"signal: {len(rows)} channels, the history has {len(variance)}")
    # scaled first, so that the fourth power cannot overflow
    scale = np.sqrt(variance)[:, None]
    centred = rows - rows.mean(axis=-1, keepdims=True)
    standard = np.divide(centred, scale, out=np.zeros_like(centred), where=scale > 0)
    return np.asarray(np.mean(standard**4, axis=-1), dtype=np.float64)
