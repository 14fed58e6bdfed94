"""Samples spread onto equal steps of angle by a short kernel, for transforms at orders.

A line of order o is the sum of x_n exp(-2 pi i o a_n) over the samples, a_n their angles. Spreading
every sample onto the nearest steps of an even grid of angle,

    g_j = sum over n of phi((j - P a_n)) x_n P da/dn,      P steps a turn,

turns that sum into the transform of g over that of the kernel, at every order at once. Unlike
interpolation this needs no band limit of the samples and no filter before; what is left is the
share of order P - o that the kernel lets through, below exp(-pi w sqrt(1 - 2 o / P)) with a kernel
of w steps.

The kernel is that of Kaiser and Bessel, phi(u) = I0(b sqrt(1 - (2 u / w)^2)) / I0(b), read through
one polynomial a sample of its reach, so that two matrix products give all weights.

References
----------
Fessler and Sutton, Nonuniform fast Fourier transforms using min-max interpolation, IEEE Trans.
Signal Processing 51 (2003) 560-574; Beatty, Nishimura and Pauly, Rapid gridding reconstruction with
a minimal oversampling ratio, IEEE Trans. Medical Imaging 24 (2005) 799-808.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gearmon.signals.angle import AngleTrack
from gearmon.signals.array_types import FloatArray
from gearmon.signals.orders.resampling import odd_stretch

# Steps taken at a time: their weights stay in the cache of a processor core.
_PIECE = 1 << 13
# Relative change of speed over which weights are linear in the speed.
_STEADY = 5e-4
_SPEED_STEP = 2.5e-4
# By the kernel's width: up to so many steps a sample, the degree of the polynomials and of their
# slopes against the speed. With few steps a sample's reach sees less of the kernel. What all
# weights of a step together miss is below 5e-4 of it with the short kernel, below 1e-5 with the
# middle one and 5e-7 with the long one up to 1.3 steps a sample.
_DEGREES = {
    4: ((0.6, 4, 2), (1.15, 5, 3), (np.inf, 6, 3)),
    6: ((0.7, 6, 3), (0.85, 6, 4), (1.05, 7, 4), (np.inf, 8, 5)),
    8: ((0.8, 6, 4), (1.1, 7, 4), (np.inf, 8, 5)),
}
# Steps whose places are found together, and those between two that the track is asked for.
_PLACED, _STRIDE = 1 << 16, 16


# Cubic of Hermite at the steps of a stretch, from its rise and its slopes a stretch.
_V = np.arange(_STRIDE) / _STRIDE
_CUBIC = np.stack([_V**2 * (3 - 2 * _V), _V * (1 - _V) ** 2, _V**2 * (_V - 1)])
_CUBIC_SLOPE = np.stack([6 * _V * (1 - _V), (1 - _V) * (1 - 3 * _V), _V * (3 * _V - 2)]) / _STRIDE


@dataclass(frozen=True, kw_only=True)
class Kernel:
    """The kernel of Kaiser and Bessel for a share of the grid's bandwidth.

    Parameters
    ----------
    width : int
        Reach w [steps].
    beta : float
        Shape b.
    """

    width: int
    beta: float

    @classmethod
    def of(cls, width: int, oversampling: float) -> Kernel:
        """Return the kernel for orders up to half the steps a turn over `oversampling`."""
        sigma = float(np.clip(oversampling, 1.05, 3.0))
        return cls(width=width, beta=float(0.97 * np.pi * width * (1 - 0.5 / sigma)))

    def at(self, u: FloatArray) -> FloatArray:
        """Value at a distance u [steps], continued smoothly beyond its reach."""
        from scipy.special import i0, j0

        inside = 1 - (2 * u / self.width) ** 2
        argument = self.beta * np.sqrt(np.abs(inside))
        # beyond the reach no larger than the kernel at its end
        return np.asarray(np.where(inside < 0, j0(argument), i0(argument)) / i0(self.beta))

    def transform(self, x: FloatArray) -> FloatArray:
        """Fourier transform at x cycles a step."""
        inside = self.beta**2 - (np.pi * self.width * np.asarray(x)) ** 2
        if inside.min(initial=np.inf) > 1.0:  # real throughout, ten times as fast
            root = np.sqrt(inside)
            return np.asarray(self.width * np.sinh(root) / root / np.i0(self.beta))
        argument = np.sqrt(inside + 0j)
        small = np.abs(argument) < 1e-6
        safe = np.where(small, 1.0, argument)
        shape = np.where(small, 1.0, np.sinh(safe) / safe)
        return np.asarray(np.real(self.width * shape) / np.i0(self.beta))


class Spreading:
    """Spreads samples onto equal steps of angle, any stretch of them, by any thread.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    per_turn : float
        Steps a turn, at least as many as samples at the slowest speed.
    kernel : Kernel
        The kernel.
    """

    def __init__(
        self,
        samples: FloatArray,
        sampling_rate_hz: float,
        track: AngleTrack,
        per_turn: float,
        kernel: Kernel,
    ) -> None:
        self._samples = samples
        self._rate = sampling_rate_hz
        self._track = track
        self._per_turn = per_turn
        self._kernel = kernel
        most = per_turn * float(track.speed_hz.max()) / sampling_rate_hz
        self._degree, self._slope_degree = next(
            (degree, slope) for limit, degree, slope in _DEGREES[kernel.width] if most <= limit
        )
        self._held = threading.local()
        self._tables: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}

    def spread(self, first_turn: float, out: FloatArray) -> None:
        """Fill `out`, shape (channels, steps), from the angle `first_turn` [turns] on."""
        count = out.shape[-1]
        for first in range(0, count, _PLACED):
            size = min(_PLACED, count - first)
            position, steps = self._positions(first_turn + first / self._per_turn, size)
            for begin in range(0, size, _PIECE):
                own = slice(begin, min(begin + _PIECE, size))
                part = out[:, first + own.start : first + own.stop]
                self._piece(position[own], steps[own], part)

    def _positions(self, first_turn: float, count: int) -> tuple[FloatArray, FloatArray]:
        """Places [samples] of equal steps of angle, and steps a sample there.

        Between two knots the track is one cubic, which its values and slopes at every sixteenth
        step tell; only the stretches with a knot inside are asked for step by step.
        """
        number = -(-count // _STRIDE)
        stretches = np.arange(number + 1, dtype=np.float64)
        ends: FloatArray = first_turn + stretches * (_STRIDE / self._per_turn)
        place, slope = self._placed(ends)
        told = np.empty((number, 3))
        np.subtract(place[1:], place[:-1], out=told[:, 0])
        np.multiply(slope[:-1], _STRIDE, out=told[:, 1])
        np.multiply(slope[1:], _STRIDE, out=told[:, 2])
        position = told @ _CUBIC
        position += place[:-1, None]
        slopes = told @ _CUBIC_SLOPE
        knots = self._track.turns
        low, high = np.searchsorted(knots, ends[[0, -1]])
        inside = (knots[low:high] - first_turn) * (self._per_turn / _STRIDE)
        crossed = np.unique(np.minimum(inside.astype(np.intp), number - 1))
        if len(crossed):
            wanted = (crossed[:, None] * _STRIDE + np.arange(_STRIDE)).reshape(-1)
            place, slope = self._placed(first_turn + wanted / self._per_turn)
            position[crossed], slopes[crossed] = (
                place.reshape(-1, _STRIDE),
                slope.reshape(-1, _STRIDE),
            )
        np.reciprocal(slopes, out=slopes)
        return position.reshape(-1)[:count], slopes.reshape(-1)[:count]

    def _placed(self, turns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places [samples] of ascending angles, and samples a step there."""
        time_s, slope = self._track.time_and_slope_at(turns)
        time_s *= self._rate
        slope *= self._rate / self._per_turn
        return time_s, slope

    def _piece(self, position: FloatArray, steps: FloatArray, out: FloatArray) -> None:
        low, high = float(steps.min()), float(steps.max())
        taps = int(np.ceil(self._kernel.width / low))
        count = len(position)
        terms = self._degree + self._slope_degree + 2
        rows = self._rows(terms + 2 * taps + 2, count)
        powers, rest = rows[:terms], rows[terms:]
        weights, taken, first, spare = rest[:taps], rest[taps:-2], rest[-2], rest[-1]
        begin = round(float(position[0]) - 0.5 * (taps - 1))
        np.subtract(position, begin + 0.5 * (taps - 1), out=spare)
        np.rint(spare, out=first)
        powers[0] = 1.0
        np.subtract(spare, first, out=powers[1])
        for k in range(2, self._degree + 1):
            np.multiply(powers[k // 2], powers[k - k // 2], out=powers[k])
        self._weigh(powers, steps, high / low - 1, weights)
        index = spare.view(np.intp)
        np.copyto(index, first, casting="unsafe")
        end = begin + int(index[-1]) + taps
        for row, channel in enumerate(self._samples):
            near = odd_stretch(channel, begin, end)
            for k in range(taps):
                near[k:].take(index, out=taken[k], mode="clip")
            np.einsum("kn,kn->n", taken, weights, out=out[row])
            out[row] *= steps

    def _rows(self, number: int, count: int) -> FloatArray:
        """Memory for arrays of one piece, held by each thread: new pages cost as much as the work.

        Rows are apart by more than a power of two, which would map them onto the same cache lines.
        """
        held: FloatArray | None = getattr(self._held, "rows", None)
        if held is None or held.shape[0] < number:
            held = np.empty((number, _PIECE + 72))
            self._held.rows = held
        return held[:number, :count]

    def _weigh(
        self, powers: FloatArray, steps: FloatArray, change: float, weights: FloatArray
    ) -> None:
        count = len(steps)
        parts = int(min(np.ceil(change / _STEADY), max(1, count // 64)))
        length = -(-count // max(1, parts))
        begins = range(0, count, length)
        middles = [steps[first : first + length] for first in begins]
        numbers = [round(math.log(own[len(own) // 2]) / _SPEED_STEP) for own in middles]
        self._add_tables(len(weights), numbers)
        for begin, own, number in zip(begins, middles, numbers, strict=True):
            both, bend = self._tables[len(weights), number]
            # the speed changes by this much a sample: the angles of neighbours are no straight line
            drift = (own[-1] - own[0]) * own[len(own) // 2] / max(1, len(own) - 1)
            near = powers[:, begin : begin + length]
            sloped = near[self._degree + 1 :]
            np.subtract(own, math.exp(number * _SPEED_STEP), out=sloped[0])
            np.multiply(near[1 : self._slope_degree + 1], sloped[0], out=sloped[1:])
            np.matmul(both + drift * bend, near, out=weights[:, begin : begin + length])

    def _add_tables(self, taps: int, numbers: Sequence[int]) -> None:
        """Tabulate polynomials of the weights, and of their slopes, at speeds that are new.

        Shape (taps, terms): the weights at a speed [steps a sample] and their slopes against it;
        then what their change a sample adds to both: with r' the change, a sample at the distance d
        is r d - r' d^2 / 2 steps away, and stands for r - r' d of them.
        """
        new = [number for number in dict.fromkeys(numbers) if (taps, number) not in self._tables]
        if not new:
            return
        speed, step = np.exp(np.array(new) * _SPEED_STEP)[:, None, None], 1e-3
        away, fit = _nodes(taps, self._degree)
        near, fit_slope = _nodes(taps, self._slope_degree)
        places = [(speed, away), (speed + step, away), (speed - step, away)]
        places += [(speed + step, near), (speed - step, near)]
        asked = np.concatenate([steps * where for steps, where in places], axis=2)
        cuts = np.cumsum([where.shape[1] for _, where in places[:-1]])
        own, more, less, high, low = np.split(self._kernel.at(asked), cuts, axis=2)
        bend = (-0.25 / step * away * (more - less) - away / speed * own) @ fit
        none = np.zeros((*bend.shape[:2], self._slope_degree + 1))
        both = np.concatenate([own @ fit, (high - low) @ fit_slope / (2 * step)], axis=2)
        bends = np.concatenate([bend, none], axis=2)
        for row, number in enumerate(new):
            self._tables[taps, number] = both[row], bends[row]


@lru_cache(maxsize=64)
def _nodes(taps: int, degree: int) -> tuple[FloatArray, FloatArray]:
    """Distances from every tap at which its weight is asked for, and what makes polynomials of it.

    The polynomials are in the distance from the middle tap. Read-only.
    """
    nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    away = 0.5 * nodes + (0.5 * (taps - 1) - np.arange(taps))[:, None]
    fit = np.linalg.inv(np.vander(nodes, increasing=True)).T * 2.0 ** np.arange(degree + 1)
    for held in (away, fit):
        held.flags.writeable = False
    return away, fit
