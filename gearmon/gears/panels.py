"""Curves on panels, each a Legendre series: values, running integrals and Fourier integrals.

A smooth curve is taken at a few Gauss points of each panel and is then known everywhere to nearly
all digits; corners and jumps belong on panel edges. Running integrals cost nothing more, which is
what makes the energy integrals of a tooth cheap for many contact positions at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

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
