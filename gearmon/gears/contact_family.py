"""Stiffness of a pair whose contact grows and shrinks: a pulse for every length of contact.

The pulse of a pair is a smooth function of what its contact ratio has lost, piece by piece, with
edges that move. It is interpolated in Chebyshev points of that loss.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.gears.curve_pulses import LARGEST_TURN, CurvePulse
from gearmon.gears.panels import (
    POINTS,
    ComplexArray,
    FloatArray,
    gauss,
    legendre,
    panel_nodes,
)
from gearmon.gears.pulse_trains import LEAST_OVERLAP
from gearmon.gears.pulses import Pulse

IntArray = NDArray[np.integer]

#: Chebyshev points tried one after the other, until the pulses have converged.
NODES = (3, 5, 9, 17)
CONVERGED = 1e-10
#: Phases evaluated together; bounds the memory.
PHASES_PER_BLOCK = 16_384


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactFamily:
    """Pulses of one pair over the loss of contact ratio.

    Parameters
    ----------
    largest : float
        Loss of contact ratio reached to either side [mesh periods].
    edges : ndarray, shape (nodes, pieces + 1)
        Chebyshev coefficients of the edges of the pieces, from the entry of the pair.
    series : ndarray, shape (nodes, pieces, degree + 1)
        Chebyshev coefficients of the Legendre coefficients on each piece [N/m].
    overlap_ratio : float
    """

    largest: float
    edges: FloatArray
    series: FloatArray
    overlap_ratio: float

    @classmethod
    def of(
        cls, member: Callable[[float], Pulse], largest: float, overlap_ratio: float
    ) -> ContactFamily | None:
        """Return the family through the pulses that `member` gives for losses of contact ratio.

        None where the pulses have not the same pieces: a zone of contact vanishes.
        """
        sound = member(0.0)
        parts = _parts(sound)
        found = None
        for count in NODES if largest else (1,):
            x = np.cos(np.pi * (np.arange(count) + 0.5) / count)
            pulses = [member(float(largest * value)) for value in x]
            if any(len(pulse.starts) != len(sound.starts) for pulse in pulses):
                return None
            edges = np.array([_edges(pulse, parts) for pulse in pulses])
            if np.diff(edges, axis=1).min(initial=1.0) <= 0:
                return None
            series = np.array(
                [_series(pulse, own) for pulse, own in zip(pulses, edges, strict=True)]
            )
            analysis = _chebyshev(count, x).T * np.where(np.arange(count) == 0, 1, 2)[:, None]
            found = cls(
                largest=largest,
                edges=np.tensordot(analysis / count, edges, 1),
                series=np.tensordot(analysis / count, series, 1),
                overlap_ratio=overlap_ratio,
            )
            size = np.abs(found.series[0]).max(initial=0.0)
            if np.abs(found.series[-1]).max(initial=0.0) <= CONVERGED * size:
                break
        return found

    @classmethod
    def rigid(cls, pulse: Pulse, overlap_ratio: float) -> ContactFamily:
        """Return the family of a contact that keeps its length."""
        edges = _edges(pulse, _parts(pulse))
        series = _series(pulse, edges)
        return cls(largest=0.0, edges=edges[None], series=series[None], overlap_ratio=overlap_ratio)

    def pulse(self, lost: float) -> CurvePulse:
        """Return the pulse for one loss of contact ratio."""
        edges, series = self._members(np.array([lost]))
        return CurvePulse(
            starts=edges[0, :-1],
            ends=edges[0, 1:],
            polynomial=np.zeros((len(edges[0]) - 1, 3)),
            series=series[0],
        )

    def entry(self, leaving: FloatArray, entering: FloatArray) -> FloatArray:
        """Return when a pair enters [mesh periods]: the middle of its contact shifts by (b - a)/2.

        A contact whose length is nominal, as that of the half-duty forms, keeps it.
        """
        lengths = self._terms(leaving + entering) @ self.edges[:, -1]
        sound = float((self._terms(np.zeros(1)) @ self.edges[:, -1])[0])
        return np.asarray(0.5 * (entering - leaving + sound - lengths))

    def coefficients(
        self, orders: IntArray, leaving: FloatArray, entering: FloatArray
    ) -> ComplexArray:
        """Return the coefficients [N/m] of a mesh whose contact stays as in each state.

        Parameters
        ----------
        orders : ndarray of int, shape (m,)
        leaving, entering : ndarray, shape (n,)

        Returns
        -------
        ndarray of complex, shape (n, m)
        """
        entry = self.entry(leaving, entering)
        lost, place = np.unique(np.round(leaving + entering, 15), return_inverse=True)
        own = np.array([self.pulse(float(value)).transform(orders) for value in lost])
        eps = self.overlap_ratio
        spread = np.sinc(orders * eps) * np.exp(-1j * np.pi * orders * eps)
        turned = np.exp(-2j * np.pi * orders * entry[:, None])
        return np.asarray(own[place.reshape(-1)] * turned * spread)

    def at(self, phase: FloatArray, leaving: FloatArray, entering: FloatArray) -> FloatArray:
        """Return the mesh stiffness [N/m] at phases with a contact each, shape (n,)."""
        total = np.zeros(len(phase))
        for low in range(0, len(phase), PHASES_PER_BLOCK):
            block = slice(low, low + PHASES_PER_BLOCK)
            total[block] = self._at(phase[block], leaving[block], entering[block])
        return total

    def _at(self, phase: FloatArray, leaving: FloatArray, entering: FloatArray) -> FloatArray:
        terms = self._terms(leaving + entering)
        edges = terms @ self.edges
        eps = self.overlap_ratio
        since = np.mod(phase - self.entry(leaving, entering), 1.0)
        total = np.zeros(len(phase))
        for turn in range(math.ceil(float(edges[:, -1].max()) + eps)):
            x = since + turn
            if eps < LEAST_OVERLAP:
                total += self._value(terms, edges, x)
            else:
                late = self._integral(terms, edges, x - eps)
                total += (self._integral(terms, edges, x) - late) / eps
        return total

    def _value(self, terms: FloatArray, edges: FloatArray, x: FloatArray) -> FloatArray:
        total = np.zeros(len(x))
        for piece in range(self.series.shape[1]):
            here = np.flatnonzero((x >= edges[:, piece]) & (x < edges[:, piece + 1]))
            if len(here):
                series = terms[here] @ self.series[:, piece]
                own = legendre(series.shape[1], _local(edges[here], x[here], piece))
                total[here] = np.einsum("np,pn->p", own, series)
        return total

    def _integral(self, terms: FloatArray, edges: FloatArray, x: FloatArray) -> FloatArray:
        """Integral of each pulse from its start to `x`."""
        total = np.zeros(len(x))
        for piece in range(self.series.shape[1]):
            width = edges[:, piece + 1] - edges[:, piece]
            past = x >= edges[:, piece + 1]
            total += np.where(past, width * (terms @ self.series[:, piece, 0]), 0.0)
            here = np.flatnonzero((x >= edges[:, piece]) & ~past)
            if len(here):
                series = terms[here] @ self.series[:, piece]
                own = legendre(series.shape[1] + 1, _local(edges[here], x[here], piece))
                # integral of P_n from -1 is (P_{n+1} - P_{n-1})/(2n + 1), and x + 1 for n = 0
                part = series[:, 0] * (1 + own[1])
                for n in range(1, series.shape[1]):
                    part += series[:, n] * (own[n + 1] - own[n - 1]) / (2 * n + 1)
                total[here] += 0.5 * width[here] * part
        return total

    def _members(self, lost: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return edges and series for losses of contact ratio, shape (n,)."""
        terms = self._terms(lost)
        return terms @ self.edges, np.tensordot(terms, self.series, 1)

    def _terms(self, lost: FloatArray) -> FloatArray:
        return _chebyshev(len(self.edges), lost / self.largest if self.largest else lost)


def _parts(pulse: Pulse) -> list[int]:
    """Return into how many parts each piece is cut, so that none oscillates much."""
    fastest = float(np.abs(pulse.rates).max(initial=0.0))
    longest = LARGEST_TURN / fastest if fastest else np.inf
    return [max(1, math.ceil(width / longest)) for width in pulse.ends - pulse.starts]


def _edges(pulse: Pulse, parts: list[int]) -> FloatArray:
    cut = [
        np.linspace(low, high, count + 1)[:-1]
        for low, high, count in zip(pulse.starts, pulse.ends, parts, strict=True)
    ]
    return np.concatenate([*cut, pulse.ends[-1:]])


def _series(pulse: Pulse, edges: FloatArray) -> FloatArray:
    if isinstance(pulse, CurvePulse) or pulse.rates.size:
        points = POINTS
    else:
        points = pulse.polynomial.shape[1]
    values = pulse.value(panel_nodes(edges, points))
    return np.asarray(values @ gauss(points)[2].T)


def _chebyshev(count: int, x: FloatArray) -> FloatArray:
    return np.cos(np.arange(count) * np.arccos(np.clip(x, -1.0, 1.0))[:, None])


def _local(edges: FloatArray, x: FloatArray, piece: int) -> FloatArray:
    low, high = edges[:, piece], edges[:, piece + 1]
    return np.asarray((2 * np.clip(x, low, high) - low - high) / (high - low))
