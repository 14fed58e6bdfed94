"""Vibration of one mesh with errors and damage, for the benchmark of detection.

A solution of its own, so that what is judged is not judged by itself: ``m z'' + c z' + k z = F +
c e' + k e`` over one turn of a gear, in the orders of that gear. The healthy stiffness repeats with
the mesh, so that orders couple only a whole number of mesh orders apart: one small matrix for each
distance from the mesh harmonics. Damage is added by GMRES on top of them. What marks the two gears
of a mesh is added up; what the marks of one do to those of the other is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

#: Mesh harmonics that are solved for at most, and relative residual of the damaged motion.
MOST_HARMONICS = 40
RESIDUAL = 1e-6
_FINE = 2048


@dataclass(frozen=True, kw_only=True)
class PairShape:
    """Stiffness of one tooth pair along its contact.

    Parameters
    ----------
    length : float
        Length of the contact [mesh periods].
    overlap : float
        Overlap ratio of helical teeth, 0 for spur gears.
    droop : float
        Share of the middle's stiffness that is missing at the ends.
    edge : float
        Over how much of a mesh period the load is taken on and given up.
    """

    length: float
    overlap: float
    droop: float
    edge: float

    @property
    def reach(self) -> float:
        """Length of the contact over the whole face [mesh periods]."""
        return self.length + self.overlap

    def at(self, phase: FloatArray, band: float | None = None) -> FloatArray:
        """Return the stiffness, 1 in the middle, `phase` mesh periods after the entry.

        Parameters
        ----------
        phase : ndarray
        band : float, optional
            Only in this share of the contact, about its middle: what pitting takes.
        """
        slices = max(1, math.ceil(16 * self.overlap))
        total = np.zeros_like(phase)
        for number in range(slices):
            total += self._slice(phase - self.overlap * (number + 0.5) / slices, band)
        return total / slices

    def _slice(self, phase: FloatArray, band: float | None) -> FloatArray:
        place = 2 * phase / self.length - 1
        inside = np.clip(np.minimum(phase, self.length - phase) / self.edge, 0, 1)
        value: FloatArray = (1 - self.droop * place**2) * inside * inside * (3 - 2 * inside)
        if band is not None:
            value = value * (np.abs(place) < band)
        return value


@dataclass(frozen=True, kw_only=True, eq=False)
class GearMotion:
    """Motion of a mesh over one turn of a gear, in orders 0, 1, ... of it.

    Parameters
    ----------
    per_force : ndarray of complex
        What goes with the load: motion over static force [m/N].
    of_errors : ndarray of complex
        What errors make at any load [m].
    """

    per_force: ComplexArray
    of_errors: ComplexArray


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshModel:
    """One mesh at one speed.

    Parameters
    ----------
    shape : PairShape
    stiffness_n_per_m : float
        Mean over the mesh period [N/m].
    mass_kg, damping_ns_per_m : float
    mesh_hz : float
        Mesh frequency [Hz].
    highest_hz : float
        Highest frequency that is of interest [Hz].
    """

    shape: PairShape
    stiffness_n_per_m: float
    mass_kg: float
    damping_ns_per_m: float
    mesh_hz: float
    highest_hz: float

    @property
    def harmonics(self) -> int:
        """Mesh harmonics to solve for."""
        return min(MOST_HARMONICS, math.ceil(1.25 * self.highest_hz / self.mesh_hz) + 2)

    @property
    def points(self) -> int:
        """Grid points of a mesh period; products of two waves keep their harmonics apart."""
        return 1 << math.ceil(math.log2(3 * self.harmonics + 1))

    @cached_property
    def pair_n_per_m(self) -> float:
        """Stiffness of one pair in the middle of its contact [N/m]."""
        phase = np.arange(math.ceil(self.shape.reach) * _FINE) / _FINE
        return self.stiffness_n_per_m / (float(self.shape.at(phase).sum()) / _FINE)

    @cached_property
    def _stiffness_lines(self) -> ComplexArray:
        """Fourier coefficients 0, 1, ... of the healthy stiffness [N/m]."""
        phase = np.arange(_FINE) / _FINE
        wave = sum(self.shape.at(phase + n) for n in range(math.ceil(self.shape.reach)))
        lines: ComplexArray = np.fft.rfft(self.pair_n_per_m * np.asarray(wave)) / _FINE
        return lines

    def wave(self, per_tooth: FloatArray, band: float | None = None) -> FloatArray:
        """Return the sum over the teeth of a value times the stiffness of the tooth's pair [N/m].

        Parameters
        ----------
        per_tooth : ndarray, shape (teeth,)
        band : float, optional
            See `PairShape.at`.

        Returns
        -------
        ndarray, shape (teeth * points,)
            Over one turn; tooth j enters contact j - 1 mesh periods after its start.
        """
        teeth = len(per_tooth)
        count = math.ceil(self.shape.reach)
        pulse = self.shape.at(np.arange(count * self.points) / self.points, band)
        total = np.zeros((teeth, self.points))
        for n in range(count):
            piece = pulse[n * self.points : (n + 1) * self.points]
            total += np.roll(per_tooth, n)[:, None] * piece
        return self.pair_n_per_m * total.ravel()

    def turn(self, teeth: int) -> Turn:
        """Return the solver for marks of a gear with so many teeth."""
        return Turn(model=self, teeth=teeth)


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """Solver of one mesh over the turn of one of its gears.

    Parameters
    ----------
    model : MeshModel
    teeth : int
    """

    model: MeshModel
    teeth: int

    @property
    def size(self) -> int:
        """Grid points of a turn."""
        return self.teeth * self.model.points

    @cached_property
    def _orders(self) -> IntArray:
        """Orders that couple: a row for each distance from the mesh harmonics."""
        meshes = np.arange(-self.model.harmonics, self.model.harmonics + 1)
        return np.arange(self.teeth // 2 + 1)[:, None] + self.teeth * meshes

    @cached_property
    def _inverse(self) -> ComplexArray:
        model = self.model
        count = 2 * model.harmonics + 1
        away = np.arange(count)[:, None] - np.arange(count)
        lines = model._stiffness_lines
        matrix = np.where(away >= 0, lines[np.abs(away)], np.conj(lines[np.abs(away)]))
        angular = 2 * np.pi * model.mesh_hz / self.teeth * self._orders
        diagonal = 1j * angular * model.damping_ns_per_m - model.mass_kg * angular**2
        blocks = np.tile(matrix, (len(diagonal), 1, 1))
        index = np.arange(count)
        blocks[:, index, index] += diagonal
        inverse: ComplexArray = np.linalg.inv(blocks)
        return inverse

    def _healthy(self, force: FloatArray) -> FloatArray:
        """Motion of the healthy mesh under a force over one turn."""
        lines = np.fft.rfft(force)
        orders = self._orders
        known = np.abs(orders)
        right = np.where(orders >= 0, lines[known], np.conj(lines[known]))
        solved = np.matmul(self._inverse, right[:, :, None])[:, :, 0]
        result = np.zeros_like(lines)
        result[known] = np.where(orders >= 0, solved, np.conj(solved))
        motion: FloatArray = np.fft.irfft(result, self.size)
        return motion

    def motion(self, error: FloatArray | None = None, loss: FloatArray | None = None) -> GearMotion:
        """Return what errors and lost stiffness of the gear make of the motion.

        Parameters
        ----------
        error : ndarray, shape (size,), optional
            Displacement of the flanks over one turn [m].
        loss : ndarray, shape (size,), optional
            Stiffness lost over one turn [N/m].
        """
        per_force = self._with_loss(self._healthy(np.ones(self.size)), loss)
        of_errors = np.zeros(self.size)
        if error is not None:
            model = self.model
            lines = np.fft.rfft(error)
            angular = 2 * np.pi * model.mesh_hz / self.teeth * np.arange(len(lines))
            rate = np.fft.irfft(1j * angular * lines, self.size)
            whole = model.wave(np.ones(self.teeth))
            if loss is not None:
                whole = whole - loss
            force = model.damping_ns_per_m * rate + whole * error
            of_errors = self._with_loss(self._healthy(force), loss)
        return GearMotion(
            per_force=np.fft.rfft(per_force) / self.size,
            of_errors=np.fft.rfft(of_errors) / self.size,
        )

    def _with_loss(self, motion: FloatArray, loss: FloatArray | None) -> FloatArray:
        """Add to a motion of the healthy mesh what lost stiffness changes of it."""
        if loss is None or not loss.any():
            return motion
        from scipy.sparse.linalg import LinearOperator, gmres

        def left(guess: FloatArray) -> FloatArray:
            return guess - self._healthy(loss * guess)

        operator = LinearOperator((self.size, self.size), matvec=left, dtype=np.float64)
        right = self._healthy(loss * motion)
        change, failed = gmres(operator, right, rtol=RESIDUAL, restart=100, maxiter=10)
        if failed:
            raise ArithmeticError(f"the motion with damage was not found in {failed} steps")
        return motion + np.asarray(change, dtype=np.float64)
