"""Signals read between their samples by a short kernel, as quickly as memory allows.

The kernel is a windowed sinc of twelve samples, every weight of which is a polynomial of the place
between two samples: one matrix product gives all weights of many instants.

References
----------
J. F. Kaiser, Nonrecursive digital filter design using the I0-sinh window function, Proc. IEEE Int.
Symp. Circuits and Systems (1974) 20-23: length and shape of the window.
C. W. Farrow, A continuously variable digital delay element, Proc. IEEE Int. Symp. Circuits and
Systems (1988) 2641-2645: weights as polynomials of the place.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.angle import AngleTrack

FloatArray = NDArray[np.float64]

#: Samples that the kernel reaches from either side of an instant.
REACH = 6
# Kaiser's shape, for what is told of tones below, and the degree at which more changes nothing.
_SHAPE, _DEGREE = 12.0, 8
# Instants taken at a time: their weights stay in the cache of a processor core.
_PIECE = 1 << 12
# Instants of which the place of one in so many is computed; the others lie on cubics through four.
_COARSE = 16
# Instants a knot of the track from which on that is as good.
_SPARSE = 2 * _COARSE


def read_between(samples: FloatArray, position: FloatArray) -> FloatArray:
    """Read signals at fractional samples.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    position : ndarray of float, shape (count,)
        Ascending, from 0 to n - 1.

    Returns
    -------
    ndarray of float, shape (channels, count)
        A constant is read exactly; tones up to 0.15 of the sampling rate to 1e-5 of their
        amplitude, one at 0.2 to 1e-4, at 0.3 to 3 %; above they fade. At the ends the signals go
        on oddly about their first and last sample.
    """
    found = np.empty((len(samples), len(position)))
    rows = np.empty((2 * REACH, min(_PIECE, len(position))))
    for start in range(0, len(position), _PIECE):
        own = position[start : start + _PIECE]
        index = np.floor(own)
        weights = _polynomials() @ _powers(own - index)
        first = int(index[0]) - REACH + 1
        place = index.astype(np.intp)
        place -= int(index[0])
        for row, channel in enumerate(samples):
            near = _stretch(channel, first, first + int(place[-1]) + 2 * REACH)
            taken = rows[:, : len(own)]
            for tap in range(2 * REACH):
                np.take(near[tap:], place, out=taken[tap], mode="clip")
            np.einsum("kn,kn->n", taken, weights, out=found[row, start : start + _PIECE])
    return found


def positions(
    track: AngleTrack, first_turn: float, per_turn: int, count: int, sampling_rate_hz: float
) -> FloatArray:
    """Return the samples at which equal steps of angle are reached.

    Parameters
    ----------
    track : AngleTrack
        Angle against time.
    first_turn : float
        Angle of the first step [turns].
    per_turn : int
        Steps a turn.
    count : int
        Steps wanted.
    sampling_rate_hz : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of float, shape (count,)
    """
    ends = np.searchsorted(track.turns, [first_turn, first_turn + count / per_turn])
    if (ends[1] - ends[0] + 1) * _SPARSE > count:
        turns = first_turn + np.arange(count) / per_turn
        return track.time_at(turns) * sampling_rate_hz
    whole = -(-count // _COARSE)
    nodes = first_turn + np.arange(-1.0, whole + 2.0) * (_COARSE / per_turn)
    at = track.time_at(nodes) * sampling_rate_hz
    four = np.stack([at[k : k + whole] for k in range(4)], axis=1)
    return (four @ _cubic()).reshape(-1)[:count]


def _powers(offset: FloatArray) -> FloatArray:
    """Return the powers of twice the distance from half way between two samples."""
    powers = np.empty((_DEGREE + 1, len(offset)))
    powers[0] = 1.0
    np.multiply(offset - 0.5, 2.0, out=powers[1])
    for k in range(2, _DEGREE + 1):
        np.multiply(powers[k // 2], powers[k - k // 2], out=powers[k])
    return powers


@cache
def _polynomials() -> FloatArray:
    """Return the polynomials of the weights, shape (taps, degree + 1); read-only."""
    nodes = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
    distance = 0.5 + 0.5 * nodes - np.arange(1 - REACH, REACH + 1)[:, None]
    window = np.i0(_SHAPE * np.sqrt(np.maximum(0.0, 1 - (distance / REACH) ** 2)))
    weights = np.sinc(distance) * window
    weights /= weights.sum(axis=0)  # a constant stays as it is
    fitted = np.linalg.solve(np.vander(nodes, increasing=True), weights.T).T
    fitted.flags.writeable = False
    return np.ascontiguousarray(fitted)


@cache
def _cubic() -> FloatArray:
    """Return the cubic through four points at all steps between the middle two."""
    at = np.arange(_COARSE) / _COARSE
    fitted = np.linalg.inv(np.vander(np.arange(-1.0, 3.0), increasing=True))
    return np.ascontiguousarray((np.vander(at, 4, increasing=True) @ fitted).T)


def _stretch(channel: FloatArray, begin: int, end: int) -> FloatArray:
    """Return samples from `begin` to before `end`, odd about the first and last one beyond."""
    last = len(channel) - 1
    if begin >= 0 and end <= last + 1:
        return channel[begin:end]
    index = np.arange(begin, end)
    inside = np.clip(index, 0, last)
    beyond = np.clip(2 * inside - index, 0, last)
    return np.where(index == inside, channel[inside], 2.0 * channel[inside] - channel[beyond])
