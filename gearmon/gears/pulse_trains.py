"""Trains of pulses: the parts of a mesh stiffness, each with a period of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gearmon.gears.pulses import ComplexArray, FloatArray, Pulse

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
