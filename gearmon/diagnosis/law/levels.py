"""The law of healthy levels: families of order lines, and the broadband spectrum between them.

Every level is predicted for the operating state (`state`), less what all levels of a channel have
in common: the gain of its sensor. How far healthy levels depart is prior knowledge, widened where
the references depart farther from one another's predictions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.law.state import Kriging

FloatArray = NDArray[np.float64]

_DB = float(20.0 / np.log(10.0))
# Standard deviation from recording to recording [Np], and its growth per unit of state, of families
# of lines and of broadband levels: half a decibel, and what a factor of e in load leaves after the
# common gain. Healthy simulated pairs, loads from 40 to 115 %, gears of accuracy grade 6.
_LINES, _BROADBAND = (0.06, 0.6), (0.15, 0.6)
# Recordings that the prior of the scale is worth, and the least scale.
_WORTH, _LEAST_SCALE = 4.0, 1.0
#: Squares of standardised deviations are cut off here, lest one line decide for all.
MOST_SQUARE = 25.0
# Median of a squared standard normal variable.
_MEDIAN = 0.4549


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelDeviation:
    """Deviation of levels from what the references make expect.

    Parameters
    ----------
    expected_db, rest_db, sigma_db : ndarray of float, shape (channels, levels)
        Prediction with the common gain of each channel; what is left; its standard deviation on a
        healthy machine.
    gain_db : ndarray of float, shape (channels,)
        That common gain.
    """

    expected_db: FloatArray
    rest_db: FloatArray
    sigma_db: FloatArray
    gain_db: FloatArray

    @property
    def standardised(self) -> FloatArray:
        """The rest in standard deviations, shape (channels, levels)."""
        return self.rest_db / self.sigma_db

    def mean_square(self, columns: Sequence[int] | slice = slice(None)) -> float:
        """Mean square of the standardised rest of some levels; about 1 on a healthy machine."""
        squares = np.minimum(self.standardised[:, columns] ** 2, MOST_SQUARE)
        return float(np.nanmean(squares)) if np.isfinite(squares).any() else 0.0


def level_deviation(
    level_db: FloatArray,
    error_db: FloatArray,
    known_db: FloatArray,
    known_error_db: FloatArray,
    states: FloatArray,
    state: FloatArray,
    *,
    told: NDArray[np.bool_] | None = None,
    broadband: bool = False,
) -> LevelDeviation:
    """Hold levels against the law.

    Parameters
    ----------
    level_db, error_db : ndarray of float, shape (channels, levels)
        Levels and their standard errors.
    known_db, known_error_db : ndarray of float, shape (references, channels, levels)
        The same of the references.
    states : ndarray of float, shape (references, 2)
        Operating states of the references.
    state : ndarray of float, shape (2,)
        That of the recording.
    told : ndarray of bool, shape (channels, levels), optional
        Whether the level stands above its noise. One that does not, and yet lies above what was
        expected, tells of the noise and of nothing else: it is left out (NaN).
    broadband : bool
        Whether these are levels of the broadband spectrum.
    """
    scatter, slope = _BROADBAND if broadband else _LINES

    def departure(
        level: FloatArray, error: FloatArray, rows: Sequence[int], at: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Gain, rest and variance, predicted from some of the references."""
        kriging = Kriging.of(states[rows], at, scatter, slope)
        mean = np.tensordot(kriging.weights, known_db[rows], 1)
        variance = error**2 + np.tensordot(kriging.weights**2, known_error_db[rows] ** 2, 1)
        gain = _median(level - mean)
        return gain, level - mean - gain[:, None], variance + _DB**2 * kriging.spread

    every = list(range(len(known_db)))
    scale = _scale(known_db, known_error_db, states, departure)
    gain, rest, variance = departure(level_db, error_db, every, state)
    expected = level_db - rest
    if told is not None:
        rest = np.where(told | (rest < 0.0), rest, np.nan)
    return LevelDeviation(
        expected_db=expected, rest_db=rest, sigma_db=np.sqrt(scale * variance), gain_db=gain
    )


def _median(rows: FloatArray) -> FloatArray:
    """Median of the numbers of each row: NumPy's `nanmedian` takes ten times as long."""
    ordered, count = np.sort(rows, axis=1), np.count_nonzero(~np.isnan(rows), axis=1)
    middle = np.stack([(count - 1) // 2, count // 2], axis=1)
    return np.asarray(np.take_along_axis(ordered, middle, axis=1).mean(axis=1))


_Departure = Callable[
    [FloatArray, FloatArray, Sequence[int], FloatArray], tuple[FloatArray, FloatArray, FloatArray]
]


def _scale(
    known_db: FloatArray, known_error_db: FloatArray, states: FloatArray, departure: _Departure
) -> float:
    """Variance over its prior, as the references depart from what the others predict of them."""
    count = len(known_db)
    if count < 2:
        return 1.0
    seen = []
    for row in range(count):
        rest = [n for n in range(count) if n != row]
        _, left, variance = departure(known_db[row], known_error_db[row], rest, states[row])
        seen.append(float(_median((left**2 / variance).reshape(1, -1))[0]) / _MEDIAN)
    return max((_WORTH + sum(seen)) / (_WORTH + count), _LEAST_SCALE)
