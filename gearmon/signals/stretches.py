"""Short stretches of a recording under waves of some orders, for `order_sums`."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.angle import AngleTrack
from gearmon.signals.threads import side_by_side

FloatArray = NDArray[np.float64]

# Cycles of the highest order in a stretch, its longest [turns], and the least number of them.
_CYCLES, _LONGEST, _LEAST = 18.0, 0.125, 256
# Stretches that share a speed, steps of its logarithm, and how many are read together.
_SHARING, _SPEED_STEP, _TOGETHER = 8, 2e-4, 1 << 12


@dataclass(frozen=True, kw_only=True)
class Stretches:
    """Sums of samples under waves of each order, stretch by stretch.

    `sums` has shape (channels, 2, lines, stretches), real and imaginary parts; `length` is the
    samples of a stretch, `slopes` the logarithms of the turns that each was made with, `cycles` the
    cycles of the highest order in one.
    """

    edges_s: FloatArray
    length: int
    sums: FloatArray
    slopes: FloatArray
    cycles: float

    @classmethod
    def of(
        cls, samples: FloatArray, rate: float, track: AngleTrack, orders: FloatArray
    ) -> Stretches:
        """Read a recording in the angle of a track."""
        top, fastest = float(orders.max()), float(track.speed_hz.max())
        turns = min(_CYCLES / top, _LONGEST)
        length = int(min(turns * rate / fastest, samples.shape[-1] / _LEAST))
        length = max(1, length)
        count = samples.shape[-1] // length
        edges_s = (length * np.arange(count + 1) - 0.5) / rate
        number = _speed_numbers(np.diff(track.turns_at(edges_s)))
        sums = np.empty((len(samples), 2, len(orders), count))
        starts = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1, [count]])
        runs = [
            (first, min(first + _TOGETHER, int(end)))
            for begin, end in pairwise(starts)
            for first in range(int(begin), int(end), _TOGETHER)
        ]
        place = (np.arange(length) - 0.5 * (length - 1)) / length
        known: dict[float, FloatArray] = {}

        def waves_at(speed: float) -> FloatArray:
            if speed not in known:
                wave = 2 * np.pi * np.exp(speed * _SPEED_STEP) * np.outer(orders, place)
                known[speed] = np.concatenate([np.cos(wave), -np.sin(wave)])
            return known[speed]

        def read(row: int) -> None:
            begin, end = runs[row]
            waves = waves_at(float(number[begin]))
            for channel, out in zip(samples, sums, strict=True):
                part = channel[begin * length : end * length].reshape(end - begin, length)
                np.matmul(waves, part.T, out=out.reshape(len(waves), count)[:, begin:end])

        side_by_side(read, range(len(runs)), samples.size)
        return cls(
            edges_s=edges_s,
            length=length,
            sums=sums,
            slopes=number * _SPEED_STEP,
            cycles=top * float(np.exp(np.mean(number) * _SPEED_STEP)),
        )

    def departure(self, angle: FloatArray) -> float:
        """Cycles a stretch that a track differs by from the one these sums were made with."""
        change = np.log(np.diff(angle)) - self.slopes
        return float(np.sqrt(np.mean(change**2))) * self.cycles


def _speed_numbers(steps: FloatArray) -> FloatArray:
    """Round the steps of some stretches each to whole multiples of a step of their logarithm."""
    count = len(steps)
    starts = np.arange(0, count, _SHARING)
    sizes = np.diff(np.append(starts, count))
    mean = np.add.reduceat(steps, starts) / sizes
    return np.repeat(np.rint(np.log(mean) / _SPEED_STEP), sizes)
