"""Pulses of any smooth shape: Legendre series on each piece, with exact Fourier integrals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.gears.panels import PanelCurves, gauss, legendre, panel_nodes, spherical_bessel
from gearmon.gears.pulses import ComplexArray, FloatArray, Pulse

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
