"""Smallest value and first zero of a trigonometric polynomial, none missed between samples.

Between two points at distance h a function lies at most h^2 max|f''|/8 below the lower of its two
values. Intervals that cannot matter for this reason are dropped, the others divided again.
"""

from __future__ import annotations

import math

import numpy as np

from gearmon.dynamics.fourier import Complex, Real, fast_length, samples

PARTS = 8
FINEST = 1e-12
MOST_TERMS = 4_000_000


class Curve:
    """y(x) = y_0 + sum_{n>=1} (y_n e^{inx} + conjugate), 0 <= x < 2 pi.

    Parameters
    ----------
    half : complex ndarray, shape (N+1,)
        y_0..y_N.
    """

    def __init__(self, half: Complex) -> None:
        self.half = half
        orders = np.arange(len(half))
        self.orders = orders
        self.size = float(2 * np.abs(half).sum())
        self.bend = float(2 * (orders**2 * np.abs(half)).sum())

    def at(self, x: Real) -> Real:
        """Values at x, shape of x."""
        phases = np.exp(1j * x[..., None] * self.orders[1:])
        values: Real = self.half[0].real + 2 * (phases @ self.half[1:]).real
        return values

    def lowest(self) -> float:
        """Return min y(x), to 1e-12 of the sum of all amplitudes."""
        left, low, high, width = self._grid()
        best = float(low.min())
        while self.bend * width**2 / 8 > FINEST * self.size:
            open_ = np.minimum(low, high) - self.bend * width**2 / 8 < best
            if not open_.any() or self._too_many(int(open_.sum())):
                break
            left, low, high, width = self._divided(left[open_], low[open_], high[open_], width)
            best = min(best, float(low.min()))
        return best

    def first_not_positive(self) -> float | None:
        """Return the smallest x in [0, 2 pi) with y(x) <= 0, to 1e-12 of a turn, or None."""
        left, low, high, width = self._grid()
        while True:
            lost = np.flatnonzero(low <= 0)
            if len(lost):
                # what follows the first known loss does not matter, what comes before might
                first = int(lost[0])
                if first == 0 and left[0] == 0.0:
                    return 0.0
                keep = slice(0, first)
                left, low, high = left[keep], low[keep], high[keep]
            slack = self.bend * width**2 / 8
            open_ = np.minimum(low, high) <= slack
            if not open_.any():
                return None
            left, low, high = left[open_], low[open_], high[open_]
            if slack <= FINEST * self.size or width <= FINEST or self._too_many(len(left)):
                crossed = np.flatnonzero(high <= 0)
                if not len(crossed):
                    return None
                at = int(crossed[0])
                return float(left[at] + width * low[at] / (low[at] - high[at]))
            left, low, high, width = self._divided(left, low, high, width)

    def _too_many(self, intervals: int) -> bool:
        """Whether dividing would take longer than it is worth, as for a curve that hugs zero."""
        return intervals * PARTS * len(self.half) > MOST_TERMS

    def _grid(self) -> tuple[Real, Real, Real, float]:
        length = fast_length(max(256, 16 * len(self.half)))
        low = samples(self.half, length)
        return 2 * math.pi * np.arange(length) / length, low, np.roll(low, -1), 2 * math.pi / length

    def _divided(
        self, left: Real, low: Real, high: Real, width: float
    ) -> tuple[Real, Real, Real, float]:
        """Cut every interval into equal parts."""
        part = width / PARTS
        starts = left[:, None] + part * np.arange(PARTS)
        values = np.empty((len(left), PARTS + 1))
        values[:, 0] = low
        values[:, -1] = high
        values[:, 1:-1] = self.at(starts[:, 1:])
        return starts.ravel(), values[:, :-1].ravel(), values[:, 1:].ravel(), part
