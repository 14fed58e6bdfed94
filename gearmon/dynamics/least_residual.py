"""The orders of the expansion as a basis: recombined so that the residual is least.

Multiple scales with the damped zeroth-order operator writes z = sum Z^(k) with D Z^(k+1) = -phi
Z^(k). The partial sums diverge where the variation of stiffness is large beside the damping, yet
the orders still span a good space: the combination of least residual is found here by Arnoldi's
recurrence on (1 + phi/D), that is GMRES with D as preconditioner. (Saad and Schultz, SIAM J. Sci.
Stat. Comput. 7, 1986.)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gearmon.dynamics.certificate import Approximation, Certifier
from gearmon.dynamics.fourier import Complex, Modulation, Real, rms

BYTES_FOR_BASIS = 400e6
MOST_ORDERS = 400


class LeastResidual:
    """Grow a basis of orders for (1 + K) u = right side, and recombine them.

    Parameters
    ----------
    coupling : callable
        Half spectrum u -> K u, real-linear, same length.
    right_side : complex ndarray, shape (N+1,)
        Half spectrum, not zero.
    most : int
        Largest number of orders.
    """

    def __init__(
        self, coupling: Callable[[Complex], Complex], right_side: Complex, most: int
    ) -> None:
        self.coupling = coupling
        size = 2 * len(right_side)
        self.most = max(1, min(most, size - 1, int(BYTES_FOR_BASIS / (8 * size))))
        # scaled so that the dot product of real views is the mean product over the period
        self.weights = np.full(len(right_side), math.sqrt(2.0))
        self.weights[0] = 1.0
        start = (self.weights * right_side).view(float)
        self.residual = math.sqrt(float(start @ start))
        self.basis = np.empty((min(self.most, 15) + 1, size))
        self.basis[0] = start / self.residual
        self.columns: list[Real] = []
        self.rotations: list[tuple[float, float]] = []
        self.projected = [self.residual]

    @property
    def orders(self) -> int:
        """How many orders are in the basis."""
        return len(self.columns)

    def extend(self, target: float) -> bool:
        """Add orders until the rms residual is <= `target`; True if it was reached."""
        while self.residual > target:
            if self.orders >= self.most or not self._add():
                return self.residual <= target
        return True

    def solution(self) -> Complex:
        """Least-residual u, shape (N+1,)."""
        count = self.orders
        triangle = np.zeros((count, count))
        for number, column in enumerate(self.columns):
            triangle[: number + 1, number] = column
        shares = np.linalg.solve(triangle, np.array(self.projected[:count]))
        combined: Complex = (shares @ self.basis[:count]).view(complex) / self.weights
        return combined

    def _add(self) -> bool:
        """One more order; False when the space is exhausted."""
        count = self.orders
        last = self.basis[count]
        image = (self.weights * self.coupling(last.view(complex) / self.weights)).view(float) + last
        known = self.basis[: count + 1]
        column = known @ image
        image -= column @ known
        length = math.sqrt(float(image @ image))
        if length < 0.5 * math.sqrt(float(column @ column)):
            # where much cancelled, a second pass keeps the basis orthogonal to rounding
            again = known @ image
            image -= again @ known
            column += again
            length = math.sqrt(float(image @ image))
        fresh = length > 1e-14 * float(np.abs(column).max())
        self._rotate(column, length)
        if fresh:
            self._store(image / length)
        return fresh

    def _store(self, vector: Real) -> None:
        if self.orders == len(self.basis):
            larger = np.empty((min(self.most + 1, 2 * len(self.basis)), len(vector)))
            larger[: len(self.basis)] = self.basis
            self.basis = larger
        self.basis[self.orders] = vector

    def _rotate(self, column: Real, below: float) -> None:
        """Bring the new column of the Hessenberg matrix to triangular form (Givens)."""
        for row, (cosine, sine) in enumerate(self.rotations):
            upper, lower = column[row], column[row + 1]
            column[row] = cosine * upper + sine * lower
            column[row + 1] = cosine * lower - sine * upper
        corner = math.hypot(column[-1], below)
        cosine, sine = (column[-1] / corner, below / corner) if corner else (1.0, 0.0)
        column[-1] = corner if corner else 1e-300
        self.rotations.append((cosine, sine))
        self.columns.append(column)
        self.projected.append(-sine * self.projected[-1])
        self.projected[-2] *= cosine
        self.residual = abs(self.projected[-1])


def recombine(certifier: Certifier, dynamic: Complex, tolerance: float, most: int) -> Approximation:
    """Improve z = g/D + dynamic by one least-residual combination of at most `most` orders.

    Parameters
    ----------
    certifier : Certifier
        Of the problem.
    dynamic : complex ndarray, shape (N+1,)
        What is known so far, zeros to begin with.
    tolerance : float
        Relative error of the acceleration aimed at: the residual is reduced to 0.4 of what it
        allows.
    most : int
        Largest number of orders.

    Notes
    -----
    Only the core harmonics take part in the combination. Above them a plain order gains a digit,
    and one is taken before.
    """
    known = certifier.judge(dynamic)
    stiffness = certifier.problem.dynamic_stiffness(known.highest)
    core = min(certifier.core, known.highest)
    if most < 1:
        return known
    orders = 0
    if core < known.highest:
        above = certifier.answer(known.residual[: known.highest + 1], core)
        known = certifier.judge(known.dynamic + above)
        orders = 1
    right_side = known.residual[: core + 1]
    if orders >= most or not right_side.any():
        return replace(known, orders=orders)
    modulate = Modulation(certifier.problem.stiffness_harmonics, core, core)
    inner = stiffness[: core + 1]
    space = LeastResidual(lambda u: modulate(u / inner), right_side, most - orders)
    space.extend(_target(certifier, known, tolerance))
    dynamic = known.dynamic.copy()
    dynamic[: core + 1] += space.solution() / inner
    return certifier.judge(dynamic, orders + space.orders)


def _target(certifier: Certifier, known: Approximation, tolerance: float) -> float:
    """Rms residual of the core that leaves 0.4 of the tolerance."""
    core = min(certifier.core, known.highest)
    right_side = known.residual[: core + 1]
    gain = certifier.gain.acceleration
    if gain == math.inf:
        return 1e-3 * tolerance * rms(right_side)
    z = known.start + known.dynamic
    z[: core + 1] += right_side / certifier.problem.dynamic_stiffness(core)
    first = rms((certifier.weights(known.highest) * z)[: certifier.last_shown(known.highest) + 1])
    return 0.4 * tolerance * max(known.bound.size, first) / gain
