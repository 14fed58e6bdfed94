"""Samples spread onto equal steps of angle by a short kernel, for transforms at orders.

A line of order o is the sum of x_n exp(-2 pi i o a_n) over the samples, a_n their angles. Spreading
every sample onto the nearest steps of an even grid of angle,

    g_j = sum over n of phi((j - P a_n)) x_n P da/dn,      P steps a turn,

turns that sum into the transform of g over that of the kernel, at every order at once. Unlike
interpolation this needs no band limit of the samples and no filter before; what is left is the
share of order P - o that the kernel lets through, below exp(-pi w sqrt(1 - 2 o / P)) with a kernel
of w steps.

The kernel is that of Kaiser and Bessel, phi(u) = I0(b sqrt(1 - (2 u / w)^2)) / I0(b), read from a
table that is straight from one of its places to the next.

References
----------
Fessler and Sutton, Nonuniform fast Fourier transforms using min-max interpolation, IEEE Trans.
Signal Processing 51 (2003) 560-574; Beatty, Nishimura and Pauly, Rapid gridding reconstruction with
a minimal oversampling ratio, IEEE Trans. Medical Imaging 24 (2005) 799-808.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.signals.angle import AngleTrack
from gearmon.signals.array_types import FloatArray
from gearmon.signals.orders.resampling import odd_stretch

# Steps taken at a time: their weights stay in the cache of a processor core.
_PIECE = 1 << 12
# Places a step at which a kernel is held: straight lines between them are off by 6e-8 at most, an
# eighth of the square of their distance times the curvature 4 b / w^2.
_HELD = 2048
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
        """Value at a distance u [steps], zero beyond its reach."""
        from scipy.special import i0

        inside = 1 - (2 * u / self.width) ** 2
        value = i0(self.beta * np.sqrt(np.maximum(inside, 0.0))) / i0(self.beta)
        return np.where(inside < 0, 0.0, value)

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Values at distances of so many to a step, and their rises from one to the next."""
        values = self.at(np.arange(self.width * _HELD // 2 + 1) / _HELD)
        rises = np.diff(values, append=0.0)
        values[-1] = rises[-1] = 0.0
        return values, rises

    def read(self, place: FloatArray) -> FloatArray:
        """Values at places of the table, of either sign, written where these stand."""
        values, rises = self._table
        np.abs(place, out=place)
        cell = place.astype(np.intp)
        place -= cell
        place *= rises.take(cell, mode="clip")
        place += values.take(cell, mode="clip")
        return place

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
        taps = int(np.ceil(self._kernel.width / float(steps.min())))
        first = np.rint(position - 0.5 * (taps - 1))
        begin, away = int(first[0]), first - position
        # the speed changes by this much a sample: of tap k the angle is a parabola in k, and how
        # densely samples lie there a straight line
        drift = np.gradient(steps) * steps if len(steps) > 1 else 0.0 * steps
        powers = np.vander(np.arange(float(taps)), 3, increasing=True)
        density = steps + drift * away
        steps_away = np.stack([0.5 * away * (density + steps), density, 0.5 * drift])
        weights = self._kernel.read(powers @ (_HELD * steps_away))
        weights *= powers[:, :2] @ np.stack([density, drift])
        index = (first - begin).astype(np.intp) + np.arange(taps)[:, None]
        for row, channel in enumerate(self._samples):
            near = odd_stretch(channel, begin, begin + int(index[-1, -1]) + 1)
            np.einsum("kn,kn->n", near.take(index, mode="clip"), weights, out=out[row])
