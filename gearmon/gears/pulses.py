"""Stiffness of one tooth pair over its contact, as pieces with exact Fourier integrals.

A pair that enters contact at mesh phase 0 contributes a pulse of finite length. Every curve of
the mesh stiffness is a sum of such pulses, one per tooth, and every Fourier coefficient of it is
the transform of one pulse: at whole mesh orders for teeth that are all alike, at the orders r/z
for one tooth of z that differs. Phases are in mesh periods throughout.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Gauss points of a panel.
POINTS = 16


@lru_cache(maxsize=8)
def gauss(points: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Gauss points and weights on [-1, 1] and the matrix from values to coefficients.

    Parameters
    ----------
    points : int, >= 1

    Returns
    -------
    nodes, weights : ndarray, shape (points,)
    analysis : ndarray, shape (points, points)
        Legendre coefficients are ``analysis @ values``; exact for polynomials of lower degree.
    """
    nodes, weights = np.polynomial.legendre.leggauss(points)
    values = np.polynomial.legendre.legvander(nodes, points - 1)
    analysis = (np.arange(points)[:, None] + 0.5) * values.T * weights
    for array in (nodes, weights, analysis):
        array.setflags(write=False)
    return nodes, weights, analysis


def panel_nodes(edges: FloatArray, points: int = POINTS) -> FloatArray:
    """Return the Gauss points of each panel, shape (panels, points)."""
    half = 0.5 * np.diff(edges)
    return np.asarray(edges[:-1, None] + half[:, None] * (1 + gauss(points)[0]))


@dataclass(frozen=True, kw_only=True, eq=False)
class PanelCurves:
    """Several curves over the same panels.

    Parameters
    ----------
    edges : ndarray, shape (panels + 1,)
        Increasing.
    coefficients : ndarray, shape (panels, degree + 1, curves)
        Legendre coefficients on each panel.
    """

    edges: FloatArray
    coefficients: FloatArray

    @classmethod
    def through(cls, edges: FloatArray, values: FloatArray) -> PanelCurves:
        """Return the curves with these values, shape (panels, points, curves), at `panel_nodes`."""
        analysis = gauss(values.shape[1])[2]
        return cls(edges=edges, coefficients=np.asarray(analysis @ values))

    def integral(self, start: ArrayLike = 0.0) -> PanelCurves:
        """Return the running integrals from the first edge, plus `start` of each curve."""
        c = self.coefficients
        half = 0.5 * np.diff(self.edges)[:, None, None]
        degree = c.shape[1]
        total = np.zeros((c.shape[0], degree + 1, c.shape[2]))
        # integral of P_n from -1 is (P_{n+1} - P_{n-1})/(2n + 1), and x + 1 for n = 0
        share = c / (2 * np.arange(degree) + 1)[:, None]
        total[:, 1:] += share
        total[:, 0] += c[:, 0]
        total[:, : degree - 1] -= share[:, 1:]
        total *= half
        whole = np.cumsum(2 * half[:, 0] * c[:, 0], axis=0)
        total[1:, 0] += whole[:-1]
        total[:, 0] += np.asarray(start)
        return PanelCurves(edges=self.edges, coefficients=total)

    @property
    def totals(self) -> FloatArray:
        """Integrals over all panels, shape (curves,)."""
        return np.asarray(np.diff(self.edges) @ self.coefficients[:, 0])

    def at(self, x: ArrayLike) -> FloatArray:
        """Return the curves at `x` (any shape), shape (curves, *x.shape).

        Outside the panels the curve of the nearest one is continued.
        """
        where = np.asarray(x, dtype=np.float64)
        flat = where.ravel()
        edges = self.edges
        panel = np.searchsorted(edges[1:-1], flat, side="right")
        low, high = edges[panel], edges[panel + 1]
        series = legendre(self.coefficients.shape[1], (2 * flat - low - high) / (high - low))
        values = np.empty((self.coefficients.shape[2], len(flat)))
        for number, coefficients in enumerate(self.coefficients):
            inside = np.flatnonzero(panel == number)
            if len(inside) == len(flat):
                values[:] = coefficients.T @ series
            elif len(inside):
                values[:, inside] = coefficients.T @ series[:, inside]
        return values.reshape((len(values), *where.shape))


def legendre(count: int, x: FloatArray) -> FloatArray:
    """Return the Legendre polynomials P_0 ... P_{count-1} at `x`, shape (count, len(x))."""
    total = np.empty((count, len(x)))
    total[0] = 1.0
    if count > 1:
        total[1] = x
    for n in range(2, count):
        np.multiply(total[n - 1], x, out=total[n])
        total[n] *= (2 * n - 1) / n
        total[n] -= ((n - 1) / n) * total[n - 2]
    return total


def spherical_bessel(count: int, x: FloatArray) -> FloatArray:
    """Return the spherical Bessel functions j_0 ... j_{count-1} at `x`, shape (count, *x.shape).

    By recurrence upwards where that is stable (|x| above the order), downwards elsewhere.
    """
    size = np.abs(x)
    if size.size and size.min() > count:
        return _bessel_up(count, x)
    total = np.empty((count, *x.shape))
    large, small = size > count, size < 1
    middle = ~(large | small)
    total[:, large] = _bessel_up(count, x[large])
    total[:, middle] = _bessel_down(count, x[middle])
    total[:, small] = _bessel_small(count, x[small])
    return total


def _bessel_up(count: int, x: FloatArray) -> FloatArray:
    total = np.empty((count, *x.shape))
    inverse = 1 / x
    np.multiply(np.sin(x), inverse, out=total[0])
    if count > 1:
        np.multiply(total[0] - np.cos(x), inverse, out=total[1])
    for n in range(2, count):
        np.multiply(total[n - 1], inverse, out=total[n])
        total[n] *= 2 * n - 1
        total[n] -= total[n - 2]
    return total


def _bessel_down(count: int, x: FloatArray) -> FloatArray:
    # Miller: any start far above decays into the wanted solution
    later, now = np.zeros(len(x)), np.full(len(x), 1e-200)
    total = np.empty((max(count, 2), len(x)))
    for n in range(count + 20, 0, -1):
        later, now = now, (2 * n + 1) / x * now - later
        if n <= len(total):
            total[n - 1] = now
    zeroth = np.sin(x) / x
    first = (zeroth - np.cos(x)) / x
    # j_0 and j_1 are never small together
    by_first = np.abs(first) > np.abs(zeroth)
    known, found = np.where(by_first, first, zeroth), np.where(by_first, total[1], total[0])
    return np.asarray(total[:count] * (known / found))


def _bessel_small(count: int, x: FloatArray) -> FloatArray:
    # j_0 is near 1; the ratios j_n/j_{n-1} follow from a continued fraction
    ratio = np.zeros(len(x))
    total = np.zeros((count, len(x)))
    for n in range(count + 12, 0, -1):
        ratio = x / (2 * n + 1 - x * ratio)
        if n < count:
            total[n] = ratio
    total[0] = np.sinc(x / np.pi)
    for n in range(1, count):
        total[n] *= total[n - 1]
    return total


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


IntArray = NDArray[np.intp]

#: Largest turn of an oscillating part across one piece when it is sampled [rad].
LARGEST_TURN = 6.0
#: Coefficients below this share of the greatest are left out.
TRIM = 1e-14
#: Orders whose Fourier integrals are computed together; bounds the memory.
ORDERS_PER_BLOCK = 8192


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvePulse(Pulse):
    """A pulse whose pieces join one another and are Legendre series.

    Parameters
    ----------
    starts, ends : ndarray, shape (pieces,)
        Limits of the pieces [mesh periods].
    polynomial : ndarray, shape (pieces, 3)
        Not used: the series takes its place.
    series : ndarray, shape (pieces, degree + 1)
        Legendre coefficients on each piece.
    """

    series: FloatArray = field(repr=False)

    @classmethod
    def of(cls, edges: ArrayLike, curve: Callable[[FloatArray], FloatArray]) -> CurvePulse:
        """Return the pulse that follows a curve, smooth between `edges`.

        Parameters
        ----------
        edges : array_like, shape (pieces + 1,)
            Increasing [mesh periods].
        curve : callable
            Maps phases, shape (pieces, points), to values; row i lies inside piece i.
        """
        limits = np.asarray(edges, dtype=np.float64)
        values = curve(panel_nodes(limits))
        return cls.through(limits, values)

    @classmethod
    def through(cls, edges: FloatArray, values: FloatArray) -> CurvePulse:
        """Return the pulse with these values, shape (pieces, points), at `panel_nodes(edges)`."""
        series = np.asarray(values @ gauss(values.shape[1])[2].T)
        return cls(
            starts=edges[:-1],
            ends=edges[1:],
            polynomial=np.zeros((len(edges) - 1, 3)),
            series=series[:, : _used(series, np.abs(series).max(initial=0.0))],
        )

    def value(self, phase: ArrayLike) -> FloatArray:
        """Curve at `phase` (any shape); pieces include their start and not their end."""
        x = np.asarray(phase, dtype=np.float64)
        if not len(self.starts):
            return np.zeros_like(x)
        piece = np.clip(np.searchsorted(self.starts, x, side="right") - 1, 0, None)
        inside = (x >= self.starts[piece]) & (x < self.ends[piece])
        total = np.zeros(x.shape)
        total[inside] = self._each(self.series, piece[inside], x[inside])
        return total

    def integral(self, phase: ArrayLike) -> FloatArray:
        """Integral of the curve from before its start to `phase` (any shape)."""
        x = np.asarray(phase, dtype=np.float64)
        if not len(self.starts):
            return np.zeros_like(x)
        widths = self.ends - self.starts
        low = np.concatenate([[0.0], np.cumsum(widths * self.series[:, 0])])
        piece = np.clip(np.searchsorted(self.starts, x, side="right") - 1, 0, None)
        stop = np.clip(x, self.starts[piece], self.ends[piece])
        # each piece on panels of its own, for they need not join
        unit = PanelCurves(edges=np.array([-1.0, 1.0]), coefficients=self.series.T[None])
        primitive = unit.integral().coefficients[0].T * (0.5 * widths)[:, None]
        return np.asarray(low[piece] + self._each(primitive, piece, stop))

    def transform(self, orders: ArrayLike) -> ComplexArray:
        """Fourier integral of p(x) exp(-2 pi i v x) over the pulse, at the orders v.

        Parameters
        ----------
        orders : array_like, shape (n,)
            Orders v in cycles per mesh period.

        Returns
        -------
        ndarray of complex, shape (n,)

        Notes
        -----
        ``int P_n(x) exp(-i w x) dx = 2 (-i)^n j_n(w)`` over [-1, 1].
        """
        v = np.atleast_1d(np.asarray(orders, dtype=np.float64))
        total = np.zeros(len(v), dtype=np.complex128)
        for low in range(0, len(v), ORDERS_PER_BLOCK):
            block = slice(low, low + ORDERS_PER_BLOCK)
            total[block] = self._transform(v[block])
        return total

    def scaled(self, factor: float) -> CurvePulse:
        """Return the same pulse times `factor`."""
        return self._like(self.starts, self.ends, factor * self.series)

    def window(self, start: float, end: float) -> CurvePulse:
        """Return the part of the pulse with start <= phase < end."""
        starts, ends = np.maximum(self.starts, start), np.minimum(self.ends, end)
        kept = np.flatnonzero(ends > starts)
        return self._parts(kept, starts[kept], ends[kept])

    def cut(self, limits: ArrayLike) -> CurvePulse:
        """Return the same pulse with its pieces cut at `limits`."""
        cuts = np.asarray(limits, dtype=np.float64)
        pieces, starts, ends = [], [], []
        for i, (low, high) in enumerate(zip(self.starts, self.ends, strict=True)):
            inner = np.unique(cuts[(cuts > low + 1e-13) & (cuts < high - 1e-13)])
            edges = np.concatenate([[low], inner, [high]])
            pieces += [i] * (len(edges) - 1)
            starts += edges[:-1].tolist()
            ends += edges[1:].tolist()
        return self._parts(np.array(pieces, dtype=np.intp), np.array(starts), np.array(ends))

    def limits_of(self, piece: int) -> tuple[float, float]:
        """Values at the start of a piece and just before its end."""
        ends = np.array([self.starts[piece], self.ends[piece]])
        low, high = self._each(self.series, np.full(2, piece, dtype=np.intp), ends)
        return float(low), float(high)

    def _each(self, series: FloatArray, piece: IntArray, x: FloatArray) -> FloatArray:
        """Evaluate the series of the pieces given at `x`."""
        flat, number = x.ravel(), np.broadcast_to(piece, x.shape).ravel()
        low, high = self.starts[number], self.ends[number]
        terms = legendre(series.shape[1], (2 * flat - low - high) / (high - low))
        return np.asarray(np.einsum("np,pn->p", terms, series[number]).reshape(x.shape))

    def _transform(self, v: FloatArray) -> ComplexArray:
        total = np.zeros(len(v), dtype=np.complex128)
        signs = np.where(np.arange(self.series.shape[1]) % 4 < 2, 1.0, -1.0)
        scale = np.abs(self.series).max(initial=0.0)
        for low, high, signed in zip(self.starts, self.ends, self.series * signs, strict=True):
            series = signed[: _used(signed[None], scale)]
            j = spherical_bessel(len(series), np.pi * (high - low) * v)
            smooth = series[0::2] @ j[0::2] - 1j * (series[1::2] @ j[1::2])
            total += (high - low) * smooth * np.exp(-1j * np.pi * (low + high) * v)
        return total

    def _parts(self, piece: IntArray, starts: FloatArray, ends: FloatArray) -> CurvePulse:
        if not len(piece):
            return self._like(starts, ends, np.zeros((0, self.series.shape[1])))
        nodes, _, analysis = gauss(self.series.shape[1])
        x = 0.5 * (starts + ends)[:, None] + 0.5 * (ends - starts)[:, None] * nodes
        values = self._each(self.series, np.broadcast_to(piece[:, None], x.shape), x)
        return self._like(starts, ends, values @ analysis.T)

    def _like(self, starts: FloatArray, ends: FloatArray, series: FloatArray) -> CurvePulse:
        polynomial = np.zeros((len(starts), 3))
        return CurvePulse(starts=starts, ends=ends, polynomial=polynomial, series=series)


def product(
    pulse: Pulse, factor: Callable[[FloatArray], FloatArray], corners: ArrayLike
) -> CurvePulse:
    """Return the pulse times a factor that is smooth between `corners`.

    Parameters
    ----------
    pulse : Pulse
        Its pieces join one another.
    factor : callable
        Maps phases, shape (pieces, points), to factors.
    corners : array_like
        Phases at which the factor is not smooth [mesh periods].
    """
    inner = np.asarray(corners, dtype=np.float64)
    inner = inner[(inner > pulse.starts[0] + 1e-13) & (inner < pulse.ends[-1] - 1e-13)]
    edges = np.unique(np.concatenate([pulse.starts, pulse.ends[-1:], inner]))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-13])]
    fastest = float(np.abs(pulse.rates).max()) if pulse.rates.size else 0.0
    edges = subdivided(edges, LARGEST_TURN / fastest if fastest else np.inf)
    return CurvePulse.of(edges, lambda phase: pulse.value(phase) * factor(phase))


def subdivided(edges: FloatArray, longest: float) -> FloatArray:
    """Return edges between which no piece is longer than `longest`."""
    parts = [
        np.linspace(low, high, max(1, int(np.ceil((high - low) / longest))) + 1)[:-1]
        for low, high in pairwise(edges)
    ]
    return np.concatenate([*parts, edges[-1:]])


def _used(series: FloatArray, scale: float) -> int:
    """Return how many coefficients are more than rounding error."""
    used = np.flatnonzero(np.abs(series).max(axis=0, initial=0.0) > TRIM * scale)
    return max(2, int(used[-1]) + 1) if len(used) else 2


#: Below this overlap ratio a helical mesh is a spur mesh within rounding error.
LEAST_OVERLAP = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class PulseTerm:
    """A pulse that starts at a phase and is spread over a part of the face width.

    Parameters
    ----------
    pulse : Pulse
        Stiffness [N/m] of one transverse section, times the face width.
    weight : float
        Factor; negative where stiffness is lost.
    offset : float
        Mesh phase at which the pair enters contact.
    face_start, face_end : float, in [0, 1]
        Part of the face width.
    """

    pulse: Pulse
    weight: float = 1.0
    offset: float = 0.0
    face_start: float = 0.0
    face_end: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class PulseTrain:
    """Pulses that repeat together: a part of the mesh stiffness with a period of its own.

    Parameters
    ----------
    gear : str
        "all teeth", the damaged gear ("pinion", "sun" ...), or both for the contacts in which two
        damaged teeth meet ("pinion and gear").
    period_mesh : int
        Period [mesh periods]: 1, the teeth of the damaged gear, or the hunting period.
    overlap_ratio : float
        eps_beta.
    terms : tuple of PulseTerm
    """

    gear: str
    period_mesh: int
    overlap_ratio: float
    terms: tuple[PulseTerm, ...]

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return this part of the stiffness [N/m] at `phase` [mesh periods], any shape."""
        x = np.asarray(phase, dtype=np.float64)
        total = np.zeros(x.shape)
        for term in self.terms:
            turned = np.mod(x - term.offset, self.period_mesh)
            support = self._support(term)
            # pulses that are longer than the period overlap with those before them
            for _ in range(math.ceil(support / self.period_mesh)):
                inside = turned < support
                total[inside] += term.weight * self._spread(term, turned[inside])
                turned = turned + self.period_mesh
        return total

    def coefficients(self, orders: ArrayLike) -> ComplexArray:
        """Return the Fourier coefficients [N/m] of this part at whole orders of its period.

        Parameters
        ----------
        orders : array_like of int, shape (n,)
            r: order r/period_mesh of the mesh frequency; 0 gives the mean.

        Returns
        -------
        ndarray of complex, shape (n,)
        """
        v = np.atleast_1d(np.asarray(orders, dtype=np.float64)) / self.period_mesh
        total = np.zeros(len(v), dtype=np.complex128)
        for term in self.terms:
            part = term.face_end - term.face_start
            middle = term.offset + 0.5 * (term.face_end + term.face_start) * self.overlap_ratio
            turned = np.exp(-2j * np.pi * v * middle) * np.sinc(v * part * self.overlap_ratio)
            total += term.weight * part * turned * term.pulse.transform(v)
        return total / self.period_mesh

    def windows(self, points_per_mesh: int) -> list[tuple[int, FloatArray]]:
        """Return, for each pulse, the first sample in it and the stiffness [N/m] from there on.

        Parameters
        ----------
        points_per_mesh : int, >= 1
            Samples are at the phases i/points_per_mesh.
        """
        parts = []
        for term in self.terms:
            # the margin keeps a sample that falls on the start of the pulse
            first = math.ceil(term.offset * points_per_mesh - 1e-9)
            points = math.ceil(self._support(term) * points_per_mesh) + 1
            points = min(points, self.period_mesh * points_per_mesh)
            alone = replace(self, terms=(term,))
            parts.append((first, alone.at((first + np.arange(points)) / points_per_mesh)))
        return parts

    def _support(self, term: PulseTerm) -> float:
        return term.pulse.length + term.face_end * self.overlap_ratio

    def _spread(self, term: PulseTerm, phase: FloatArray) -> FloatArray:
        """Return the pulse averaged over the sections, which lag behind one another."""
        eps = self.overlap_ratio
        if eps < LEAST_OVERLAP:
            return (term.face_end - term.face_start) * term.pulse.value(phase)
        early = term.pulse.integral(phase - term.face_start * eps)
        late = term.pulse.integral(phase - term.face_end * eps)
        return np.asarray((early - late) / eps)
