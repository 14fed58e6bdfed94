"""Stiffness of one tooth pair over its contact, as pieces with exact Fourier integrals.

A pair that enters contact at mesh phase 0 contributes a pulse of finite length. Every curve of
the mesh stiffness is a sum of such pulses, one per tooth, and every Fourier coefficient of it is
the transform of one pulse: at whole mesh orders for teeth that are all alike, at the orders r/z
for one tooth of z that differs. Phases are in mesh periods throughout.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Orders whose Fourier integrals are computed together; bounds the memory.
ORDERS_PER_BLOCK = 4096

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pulse:
    """A piecewise curve p(phase) that is zero outside its pieces.

    On piece i the curve is ``c0 + c1 phase + c2 phase^2 + Re sum_m w_m exp(i o_m phase)``.

    Parameters
    ----------
    starts, ends : ndarray, shape (pieces,)
        Limits of the pieces [mesh periods]; increasing, not overlapping, each start >= 0.
    polynomial : ndarray, shape (pieces, 3)
        Coefficients c0, c1, c2.
    weights : ndarray of complex, shape (pieces, modes)
        Weights w_m of the oscillating part; no columns when there is none.
    rates : ndarray, shape (pieces, modes)
        Circular rates o_m [rad per mesh period], not 0.
    """

    starts: FloatArray
    ends: FloatArray
    polynomial: FloatArray = field(repr=False)
    weights: ComplexArray = field(
        default_factory=lambda: np.zeros((0, 0), dtype=np.complex128), repr=False
    )
    rates: FloatArray = field(default_factory=lambda: np.zeros((0, 0)), repr=False)

    def __post_init__(self) -> None:
        pieces = len(self.starts)
        if self.weights.size == 0:
            object.__setattr__(self, "weights", np.zeros((pieces, 0), dtype=np.complex128))
            object.__setattr__(self, "rates", np.zeros((pieces, 0)))

    @property
    def length(self) -> float:
        """End of the last piece [mesh periods]."""
        return float(self.ends[-1]) if len(self.ends) else 0.0

    @property
    def area(self) -> float:
        """Integral over the whole pulse."""
        return float(self.transform(np.zeros(1))[0].real)

    def value(self, phase: ArrayLike) -> FloatArray:
        """Curve at `phase` (any shape); pieces include their start and not their end."""
        x = np.asarray(phase, dtype=np.float64)
        if not len(self.starts):
            return np.zeros_like(x)
        piece = np.clip(np.searchsorted(self.starts, x, side="right") - 1, 0, None)
        inside = (x >= self.starts[piece]) & (x < self.ends[piece])
        return np.where(inside, self._smooth(piece, x), 0.0)

    def integral(self, phase: ArrayLike) -> FloatArray:
        """Integral of the curve from before its start to `phase` (any shape)."""
        x = np.asarray(phase, dtype=np.float64)
        if not len(self.starts):
            return np.zeros_like(x)
        pieces = np.arange(len(self.starts))
        low = self._primitive(pieces, self.starts)
        whole = np.concatenate([[0.0], np.cumsum(self._primitive(pieces, self.ends) - low)])
        piece = np.clip(np.searchsorted(self.starts, x, side="right") - 1, 0, None)
        stop = np.clip(x, self.starts[piece], self.ends[piece])
        return np.asarray(whole[piece] + self._primitive(piece, stop) - low[piece])

    def transform(self, orders: ArrayLike) -> ComplexArray:
        """Fourier integral of p(x) exp(-2 pi i v x) over the pulse, at the orders v.

        Parameters
        ----------
        orders : array_like, shape (n,)
            Orders v in cycles per mesh period; they need not be whole.

        Returns
        -------
        ndarray of complex, shape (n,)
        """
        v = np.atleast_1d(np.asarray(orders, dtype=np.float64))[:, None]
        if not len(self.starts):
            return np.zeros(len(v), dtype=np.complex128)
        middle, half = 0.5 * (self.starts + self.ends), 0.5 * (self.ends - self.starts)
        c0, c1, c2 = self.polynomial.T
        # about the middle of the piece, where the integrals are spherical Bessel functions
        centred = c0 + (c1 + c2 * middle) * middle, (c1 + 2 * c2 * middle) * half, c2 * half**2
        j0, j1, j2 = _spherical_bessel(2 * np.pi * v * half)
        even, odd = centred[0] * j0 + centred[2] * (j0 - 2 * j2) / 3, centred[1] * j1
        smooth = 2 * half * (even - 1j * odd)
        total = (smooth * np.exp(-2j * np.pi * v * middle)).sum(axis=1)
        return np.asarray(total + self._modes_transform(v[:, 0]))

    def scaled(self, factor: float) -> Pulse:
        """Return the same pulse times `factor`."""
        return Pulse(
            starts=self.starts,
            ends=self.ends,
            polynomial=factor * self.polynomial,
            weights=factor * self.weights,
            rates=self.rates,
        )

    def window(self, start: float, end: float) -> Pulse:
        """Return the part of the pulse with start <= phase < end."""
        starts, ends = np.maximum(self.starts, start), np.minimum(self.ends, end)
        kept = ends > starts
        return Pulse(
            starts=starts[kept],
            ends=ends[kept],
            polynomial=self.polynomial[kept],
            weights=self.weights[kept],
            rates=self.rates[kept],
        )

    def cut(self, limits: ArrayLike) -> Pulse:
        """Return the same pulse with its pieces cut at `limits`."""
        pieces = [
            (low, high, i)
            for i, (start, end) in enumerate(zip(self.starts, self.ends, strict=True))
            for low, high in _intervals(start, end, np.asarray(limits, dtype=np.float64))
        ]
        origin = np.array([i for _, _, i in pieces], dtype=np.intp)
        return Pulse(
            starts=np.array([low for low, _, _ in pieces]),
            ends=np.array([high for _, high, _ in pieces]),
            polynomial=self.polynomial[origin],
            weights=self.weights[origin],
            rates=self.rates[origin],
        )

    def limits_of(self, piece: int) -> tuple[float, float]:
        """Values at the start of a piece and just before its end."""
        ends = np.array([self.starts[piece], self.ends[piece]])
        low, high = self._smooth(np.full(2, piece, dtype=np.intp), ends)
        return float(low), float(high)

    def _smooth(self, piece: NDArray[np.intp], x: FloatArray) -> FloatArray:
        c0, c1, c2 = np.moveaxis(self.polynomial[piece], -1, 0)
        total = c0 + (c1 + c2 * x) * x
        for mode in range(self.weights.shape[1]):
            turned = self.weights[piece, mode] * np.exp(1j * self.rates[piece, mode] * x)
            total = total + turned.real
        return np.asarray(total)

    def _primitive(self, piece: NDArray[np.intp], x: FloatArray) -> FloatArray:
        c0, c1, c2 = np.moveaxis(self.polynomial[piece], -1, 0)
        total = (c0 + (c1 / 2 + c2 / 3 * x) * x) * x
        for mode in range(self.weights.shape[1]):
            rate = self.rates[piece, mode]
            turned = self.weights[piece, mode] * np.exp(1j * rate * x) / (1j * rate)
            total = total + turned.real
        return np.asarray(total)

    def _modes_transform(self, v: FloatArray) -> ComplexArray:
        """Fourier integrals of the oscillating parts at the orders `v`, a block at a time."""
        total = np.zeros(len(v), dtype=np.complex128)
        if not self.weights.shape[1]:
            return total
        for i, (start, end) in enumerate(zip(self.starts, self.ends, strict=True)):
            # each mode is half of itself and half of its conjugate, which turns the other way
            pair = [self.weights[i], self.weights[i].conj()]
            weights = np.asarray(np.concatenate(pair) / 2, dtype=np.complex128)
            rates = np.concatenate([self.rates[i], -self.rates[i]])
            for low in range(0, len(v), ORDERS_PER_BLOCK):
                block = slice(low, low + ORDERS_PER_BLOCK)
                total[block] += _turning_integral(weights, rates, start, end, v[block])
        return total


def _turning_integral(
    weights: ComplexArray, rates: FloatArray, start: float, end: float, v: FloatArray
) -> ComplexArray:
    """Integral of sum_m w_m exp(i (o_m - 2 pi v) x) from `start` to `end`, at the orders `v`.

    The difference of the values at both ends over i (o_m - 2 pi v); that is one product of
    matrices, because the values are products of a factor of the mode and one of the order.
    """
    slip = rates - 2 * np.pi * v[:, None]
    near = np.abs(slip) * (end - start) < 0.1
    inverse = np.where(near, 0.0, 1.0 / np.where(near, 1.0, slip))
    low, high = (weights * np.exp(1j * rates * x) for x in (start, end))
    # real times real: the product with complex numbers would copy the matrix first
    sums = inverse @ np.stack([low.real, low.imag, high.real, high.imag], axis=1)
    turned = np.exp(-2j * np.pi * v[:, None] * np.array([start, end]))
    leaving = turned[:, 1] * (sums[:, 2] + 1j * sums[:, 3])
    total = -1j * (leaving - turned[:, 0] * (sums[:, 0] + 1j * sums[:, 1]))
    # close to an order of a mode the difference cancels: the integral itself does not
    row, mode = np.nonzero(near)
    lobe = (end - start) * np.sinc(slip[row, mode] * (end - start) / (2 * np.pi))
    close = weights[mode] * np.exp(0.5j * slip[row, mode] * (start + end)) * lobe
    np.add.at(total, row, close)
    return np.asarray(total)


def _intervals(start: float, end: float, limits: FloatArray) -> list[tuple[float, float]]:
    # cuts closer than rounding error to an end would make pieces of no length
    inner = limits[(limits > start + 1e-13) & (limits < end - 1e-13)]
    edges = np.concatenate([[start], np.unique(inner), [end]])
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def _spherical_bessel(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Spherical Bessel functions j0, j1, j2; below |x| = 0.6 by series against cancellation."""
    small = np.abs(x) < 0.6
    safe = np.where(small, 1.0, x)
    sine, cosine = np.sin(safe) / safe, np.cos(safe)
    j1 = (sine - cosine) / safe
    j2 = 3 * j1 / safe - sine
    s = np.where(small, x, 0.0)
    series = [_bessel_series(n, s) for n in range(3)]
    exact = (sine, j1, j2)
    j0, j1, j2 = (np.where(small, a, b) for a, b in zip(series, exact, strict=True))
    return j0, j1, j2


def _bessel_series(degree: int, x: FloatArray) -> FloatArray:
    # x^n / (2n+1)!! times 1 - (x^2/2)/(1!(2n+3)) + (x^2/2)^2/(2!(2n+3)(2n+5)) - ...
    square = -0.5 * x * x
    term = x**degree / (1.0, 3.0, 15.0)[degree]
    total = term
    for k in range(1, 10):
        term = term * square / (k * (2 * degree + 2 * k + 1))
        total = total + term
    return total
