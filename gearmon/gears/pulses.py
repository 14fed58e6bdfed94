"""Pulses: what one tooth pair has or loses over its contact, and the trains that they make.

A smooth curve is taken at a few Gauss points between its corners; as a Legendre series it is then
known everywhere to nearly all digits, with its running and its Fourier integrals. Every curve of
the mesh stiffness is a sum of such pulses, one per tooth, and every Fourier coefficient of it is
the transform of one pulse: at whole mesh orders for teeth that are all alike, at the orders r/z
for one tooth of z that differs. Phases are in mesh periods throughout.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise, product

import numpy as np
from numpy.polynomial.legendre import legint, legvander
from numpy.typing import ArrayLike, NDArray
from scipy.special import roots_legendre

from gearmon.arrays import ComplexArray, FloatArray

IntArray = NDArray[np.integer]

#: Gauss points between two corners of a curve.
POINTS = 16
#: Coefficients below this share of the greatest are left out.
TRIM = 1e-14
#: Numbers that a Fourier integral holds at a time; bounds the memory.
BLOCK = 262_144
#: Below this overlap ratio a helical mesh is a spur mesh within rounding error.
LEAST_OVERLAP = 1e-9
#: Corners closer than this are one [mesh periods].
LEAST_PIECE = 1e-13


@lru_cache(maxsize=32)
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
    nodes, weights = roots_legendre(points)
    analysis = (np.arange(points)[:, None] + 0.5) * legvander(nodes, points - 1).T * weights
    for array in (nodes, weights, analysis):
        array.setflags(write=False)
    return nodes, weights, analysis


def panel_nodes(edges: FloatArray, points: int = POINTS) -> FloatArray:
    """Return the Gauss points of each panel, shape (panels, points)."""
    half = 0.5 * np.diff(edges)
    return np.asarray(edges[:-1, None] + half[:, None] * (1 + gauss(points)[0]))


def distinct(edges: ArrayLike, apart: float) -> FloatArray:
    """Return edges in order, of those closer than `apart` the first."""
    found = np.sort(np.asarray(edges, dtype=np.float64), axis=None)
    apart_enough = np.ones(len(found), dtype=bool)
    np.greater(found[1:] - found[:-1], apart, out=apart_enough[1:])
    return np.asarray(found[apart_enough])


def spherical_bessel(count: int, x: FloatArray) -> FloatArray:
    """Return the spherical Bessel functions j_0 ... j_{count-1} at `x`, shape (count, *x.shape).

    Orders below |x| by recurrence upwards, those above by the ratio of neighbours; either is stable
    there, and one run gives all orders, where SciPy begins anew for each.
    """
    size, ratios = np.abs(x), np.zeros((count, *x.shape))
    if size.min(initial=np.inf) < count:
        # j_n/j_{n-1} for the orders n from |x| on: a continued fraction, from an order downwards
        # where its rest no longer matters; the rest is forgotten within a number of orders that
        # grows with the cube root of x
        ratio = np.zeros(x.shape)
        for n in range(count + math.ceil(7 * math.cbrt(count)), 0, -1):
            ratio = np.where(n < size, 0.0, x / (2 * n + 1 - x * ratio))
            if n < count:
                ratios[n] = ratio
    total = np.empty((count, *x.shape))
    total[0] = np.sinc(x / np.pi)
    inverse = 1 / np.where(size < 1, 1.0, x)
    before = np.cos(x) * inverse
    for n in range(1, count):
        upwards = (2 * n - 1) * inverse * total[n - 1] - before
        total[n] = np.where(n < size, upwards, ratios[n] * total[n - 1])
        before = total[n - 1]
    return total


@dataclass(frozen=True, eq=False)
class Pulse:
    """A curve p(phase) that is zero outside its pieces, a Legendre series on each of them.

    Parameters
    ----------
    edges : ndarray, shape (pieces + 1,)
        Increasing limits of the pieces [mesh periods]; the first >= 0.
    series : ndarray, shape (pieces, degree + 1) or (pieces, degree + 1, curves)
        Legendre coefficients on each piece; of several curves over the same pieces side by side.
    fastest : float
        Circular rate of the fastest part of an oscillating curve [rad per mesh period].
    """

    edges: FloatArray
    series: FloatArray = field(repr=False)
    fastest: float = 0.0

    @classmethod
    def of(
        cls, edges: ArrayLike, curve: Callable[[FloatArray], FloatArray], points: int = POINTS
    ) -> Pulse:
        """Return the pulse that follows a curve, smooth between `edges`.

        Parameters
        ----------
        edges : array_like, shape (pieces + 1,)
            Increasing [mesh periods].
        curve : callable
            Maps phases, shape (pieces, points), to values; row i lies inside piece i.
        points : int
            Gauss points on each piece.
        """
        limits = np.asarray(edges, dtype=np.float64)
        return cls.through(limits, curve(panel_nodes(limits, points)))

    @classmethod
    def through(cls, edges: FloatArray, values: FloatArray, fastest: float = 0.0) -> Pulse:
        """Return the pulse with these values at `panel_nodes(edges)`.

        Parameters
        ----------
        edges : ndarray, shape (pieces + 1,)
        values : ndarray, shape (pieces, points) or (pieces, points, curves)
        fastest : float
            See `Pulse`.
        """
        series = np.moveaxis(np.tensordot(gauss(values.shape[1])[2], values, (1, 1)), 0, 1)
        scale = np.abs(series).max(axis=(0, 1), initial=0.0)
        return cls(edges, series[:, : _used(series, scale)], fastest)

    @classmethod
    def constant(cls, start: float, end: float, value: float = 1.0) -> Pulse:
        """Return one level from `start` to `end` [mesh periods]."""
        return cls(np.array([start, end]), np.array([[value]]))

    @property
    def points(self) -> int:
        """Gauss points on a piece that follow the curve times another smooth one."""
        return POINTS + (self.series.shape[1] if self.fastest else 0)

    @property
    def length(self) -> float:
        """End of the last piece [mesh periods]."""
        return float(self.edges[-1]) if len(self.series) else 0.0

    @cached_property
    def area(self) -> float:
        """Integral over the whole pulse."""
        return float(np.diff(self.edges) @ self.series[:, 0])

    @property
    def limits(self) -> FloatArray:
        """Values at the start of each piece and just before its end, shape (pieces, 2)."""
        signs = (-1.0) ** np.arange(self.series.shape[1])
        return np.stack([self.series @ signs, self.series.sum(axis=1)], axis=1)

    def running(self, start: ArrayLike = 0.0) -> Pulse:
        """Return the integral from the first edge on, plus `start` of each curve."""
        half = 0.5 * np.diff(self.edges).reshape(-1, *[1] * (self.series.ndim - 1))
        total = half * legint(self.series, lbnd=-1, axis=1)
        total[1:, 0] += np.cumsum(2 * half[:, 0] * self.series[:, 0], axis=0)[:-1]
        total[:, 0] += np.asarray(start)
        return Pulse(self.edges, total)

    def at(self, x: ArrayLike) -> FloatArray:
        """Return the curves at `x` (any shape), shape (*curves, *x.shape).

        Outside the pieces the curve of the nearest one is continued.
        """
        where = np.asarray(x, dtype=np.float64)
        flat, edges, count = where.ravel(), self.edges, self.series.shape[1]
        panel = np.searchsorted(edges[1:-1], flat, side="right")
        low, high = edges[panel], edges[panel + 1]
        t = ((2 * flat - low - high) / (high - low)).reshape(-1, *[1] * (self.series.ndim - 2))
        # by Clenshaw's recurrence, a coefficient at a time
        values, after = self.series[:, count - 1][panel], np.zeros(1)
        for n in range(count - 1, 0, -1):
            before = self.series[:, n - 1][panel] - n / (n + 1) * after
            values, after = before + (2 * n - 1) / n * t * values, values
        return values.T.reshape((*values.shape[1:], *where.shape))

    def value(self, phase: ArrayLike) -> FloatArray:
        """Curve at `phase` (any shape); pieces include their start and not their end."""
        x = np.asarray(phase, dtype=np.float64)
        total = np.zeros(x.shape)
        inside = (x >= self.edges[0]) & (x < self.edges[-1])
        if inside.any():
            total[inside] = self.at(x[inside])
        return total

    def integral(self, phase: ArrayLike) -> FloatArray:
        """Integral of the curve from before its start to `phase` (any shape)."""
        x = np.asarray(phase, dtype=np.float64)
        if not len(self.series):
            return np.zeros(x.shape)
        return self._running.at(np.clip(x, self.edges[0], self.edges[-1]))

    @cached_property
    def _running(self) -> Pulse:
        return self.running()

    def transform(self, orders: ArrayLike) -> ComplexArray:
        """Fourier integral of p(x) exp(-2 pi i v x) over the pulse, at the orders v.

        Parameters
        ----------
        orders : array_like, shape (n,)
            Orders v in cycles per mesh period; they need not be whole.

        Returns
        -------
        ndarray of complex, shape (n,)

        Notes
        -----
        ``int P_n(x) exp(-i w x) dx = 2 (-i)^n j_n(w)`` over [-1, 1].
        """
        v = np.atleast_1d(np.asarray(orders, dtype=np.float64))
        total = np.zeros(len(v), dtype=np.complex128)
        signs = np.where(np.arange(self.series.shape[1]) % 4 < 2, 1.0, -1.0)
        scale = np.abs(self.series).max(initial=0.0)
        for (low, high), signed in zip(pairwise(self.edges), self.series * signs, strict=True):
            series = signed[: _used(signed[None], scale)]
            step = max(1, BLOCK // len(series))
            for start in range(0, len(v), step):
                own = v[start : start + step]
                j = spherical_bessel(len(series), np.pi * (high - low) * own)
                smooth = series[0::2] @ j[0::2] - 1j * (series[1::2] @ j[1::2])
                turned = np.exp(-1j * np.pi * (low + high) * own)
                total[start : start + step] += (high - low) * smooth * turned
        return total

    def scaled(self, factor: float) -> Pulse:
        """Return the same pulse times `factor`."""
        return replace(self, series=factor * self.series)

    def stretched(self, factor: float) -> Pulse:
        """Return the same pulse over a contact that is `factor` times as long."""
        return replace(self, edges=factor * self.edges, fastest=self.fastest / factor)

    def __mul__(self, other: Pulse) -> Pulse:
        """Return the product of two pulses: zero where either is, perhaps without any pieces."""
        low = max(self.edges[0], other.edges[0])
        high = min(self.edges[-1], other.edges[-1])
        if high <= low:
            return Pulse(self.edges[:1], self.series[:0])
        edges = np.concatenate([self.edges, other.edges])
        inner = edges[(edges > low + LEAST_PIECE) & (edges < high - LEAST_PIECE)]
        limits = np.concatenate([[low], distinct(inner, LEAST_PIECE), [high]])
        # as many as the degree of the product takes: it is exact
        points = self.series.shape[1] + other.series.shape[1] - 1
        return Pulse.of(limits, lambda x: self.at(x) * other.at(x), points)


def _used(series: FloatArray, scale: ArrayLike) -> int:
    """Return how many coefficients are more than rounding error, beside the scale of each curve."""
    large = np.abs(series) > TRIM * np.asarray(scale)
    used = np.flatnonzero(large.any(axis=(0, *range(2, series.ndim))))
    return int(used[-1]) + 1 if len(used) else 1


@dataclass(frozen=True)
class PulseTerm:
    """A pulse that starts at a phase and is spread over a part of the face width.

    Parameters
    ----------
    pulse : Pulse
        Stiffness [N/m] of one transverse section, times the face width; or the share of the
        stiffness of a pair that is lost.
    weight : float
        Factor; negative where stiffness is lost, and in the overlap of two losses, which do not
        add up.
    offset : float
        Mesh phase at which the pair enters contact.
    face_start, face_end : float, in [0, 1]
        Part of the face width, from the side that enters contact first.
    """

    pulse: Pulse
    weight: float = 1.0
    offset: float = 0.0
    face_start: float = 0.0
    face_end: float = 1.0

    def corners(self, overlap_ratio: float) -> FloatArray:
        """Return the mesh phases at which it is not smooth."""
        faces = {face * overlap_ratio for face in (self.face_start, self.face_end)}
        return np.concatenate([self.offset + face + self.pulse.edges for face in faces])


#: Shares of its stiffness that a pair loses, each over a part of its contact and of its face.
Losses = tuple[PulseTerm, ...]


def overlap(one: Sequence[PulseTerm], other: Sequence[PulseTerm]) -> Losses:
    """Return the product of two losses of one pair, part by part."""
    found = []
    for a, b in product(one, other):
        low, high = max(a.face_start, b.face_start), min(a.face_end, b.face_end)
        both = a.pulse * b.pulse
        if len(both.series) and low < high:
            found.append(PulseTerm(both, a.weight * b.weight, 0.0, low, high))
    return tuple(found)


def union(one: Sequence[PulseTerm], other: Sequence[PulseTerm]) -> Losses:
    """Return the loss of two faults of one pair: what is left after both is multiplied."""
    return (*one, *other, *(replace(p, weight=-p.weight) for p in overlap(one, other)))


def lost_share(losses: Sequence[PulseTerm], phase: FloatArray) -> FloatArray:
    """Return the share of the stiffness lost at phases of the contact, of the whole face width."""
    total = np.zeros(phase.shape)
    for p in losses:
        total += (p.face_end - p.face_start) * p.weight * p.pulse.value(phase)
    return total


@dataclass(frozen=True)
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

    @classmethod
    def healthy(cls, pulse: Pulse, overlap_ratio: float) -> PulseTrain:
        """Return the train of a pair that meets again after every mesh period."""
        return cls("all teeth", 1, overlap_ratio, (PulseTerm(pulse),))

    def scaled(self, factor: float) -> PulseTrain:
        """Return the same train times `factor`, of the same pulses."""
        terms = (replace(term, weight=factor * term.weight) for term in self.terms)
        return replace(self, terms=tuple(terms))

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return this part of the stiffness [N/m] at `phase` [mesh periods], any shape."""
        x = np.asarray(phase, dtype=np.float64)
        total = np.zeros(x.shape)
        for term in self.terms:
            turned = np.mod(x - term.offset, self.period_mesh)
            support = term.pulse.length + term.face_end * self.overlap_ratio
            # pulses that are longer than the period overlap with those before them
            for _ in range(math.ceil(support / self.period_mesh)):
                inside = turned < support
                total[inside] += term.weight * self._spread(term, turned[inside])
                turned = turned + self.period_mesh
        return total

    @property
    def mean(self) -> float:
        """Mean [N/m] of this part."""
        areas = (t.weight * (t.face_end - t.face_start) * t.pulse.area for t in self.terms)
        return sum(areas) / self.period_mesh

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

    def _spread(self, term: PulseTerm, phase: FloatArray) -> FloatArray:
        """Return the pulse averaged over the sections, which lag behind one another."""
        eps = self.overlap_ratio
        if eps < LEAST_OVERLAP:
            return (term.face_end - term.face_start) * term.pulse.value(phase)
        early = term.pulse.integral(phase - term.face_start * eps)
        late = term.pulse.integral(phase - term.face_end * eps)
        return np.asarray((early - late) / eps)
