"""The orders of the expansion as a basis: recombined so that the residual is least.

Multiple scales with the damped zeroth-order operator writes z = sum Z^(k) with D Z^(k+1) = -phi
Z^(k). The partial sums diverge where the variation of stiffness is large beside the damping, yet
the orders still span a good space: the combination of least residual is found here by a recurrence
on (1 + phi/D) that keeps the images of its directions orthonormal (generalised conjugate residuals,
GMRES in exact arithmetic), with D as preconditioner.

Sources: Eisenstat, Elman and Schultz, SIAM J. Numer. Anal. 20 (1983) 345; the choice of the next
direction is that of Jiranek and Rozloznik, J. Comput. Appl. Math. 214 (2008) 303.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gearmon.dynamics.certificate import UNIT_ROUNDOFF, Approximation, Certifier
from gearmon.dynamics.fourier import Complex, Real, rms

BYTES_FOR_BASIS = 400e6
MOST_ORDERS = 400
#: A residual that falls by less makes a poor next direction: the last image is taken.
STALLED = 0.95
#: Sizes below are not divided by.
SMALLEST = 1e-200


class LeastResidual:
    """Grow a basis of orders for (1 + K) u = right side, and recombine them.

    Parameters
    ----------
    coupling : callable
        Half spectra u -> K u, real-linear, same shape.
    right_side : complex ndarray, shape (..., N+1)
        Half spectrum, or one of every mesh; not zero.
    most : int
        Largest number of orders.
    """

    def __init__(
        self, coupling: Callable[[Complex], Complex], right_side: Complex, most: int
    ) -> None:
        self.coupling, self.shape = coupling, right_side.shape
        # scaled so that the dot product of real views is the mean product over the period
        self.weights = np.full(right_side.shape[-1], math.sqrt(2.0))
        self.weights[0] = 1.0
        self.rest = self._flat(right_side)
        size = len(self.rest)
        self.most = max(1, min(most, size - 1, int(BYTES_FOR_BASIS / (16 * size))))
        #: orthonormal images (1 + K) p, and the directions p
        self.images = np.empty((min(self.most, 15), size))
        self.directions = np.empty_like(self.images)
        self.sum = np.zeros(size)
        self.orders = 0
        self.residual = _length(self.rest)
        self._least = UNIT_ROUNDOFF * self.residual
        self._stalled = False

    def extend(self, target: float) -> bool:
        """Add orders until the rms residual is <= `target`; True if it was reached."""
        while self.residual > max(target, self._least):
            if self.orders >= self.most or not self._add():
                break
        return self.residual <= target

    def solution(self) -> Complex:
        """Least-residual u."""
        return self._half(self.sum)

    def _flat(self, half: Complex) -> Real:
        return np.asarray((self.weights * half).view(float)).ravel()

    def _half(self, row: Real) -> Complex:
        return np.asarray(row.view(complex).reshape(self.shape) / self.weights)

    def _add(self) -> bool:
        """One more order; False when the space is exhausted."""
        direction = (self.images[self.orders - 1] if self._stalled else self.rest).copy()
        image = direction + self._flat(self.coupling(self._half(direction)))
        whole = _length(image)
        length = self._orthogonalise(image, direction)
        if length < 0.5 * whole:
            # where much cancelled, a second pass keeps the basis orthogonal to rounding
            length = self._orthogonalise(image, direction)
        if not length > max(1e-14 * whole, SMALLEST):
            return False
        image, direction = image / length, direction / length
        self._store(image, direction)
        share = float(image @ self.rest)
        self.sum += share * direction
        self.rest -= share * image
        before, self.residual = self.residual, _length(self.rest)
        self._stalled = self.residual > STALLED * before
        return True

    def _orthogonalise(self, image: Real, direction: Real) -> float:
        """Take the known images out of one, and its direction along; length that is left."""
        known = self.images[: self.orders]
        shares = known @ image
        image -= shares @ known
        direction -= shares @ self.directions[: self.orders]
        return _length(image)

    def _store(self, image: Real, direction: Real) -> None:
        if self.orders == len(self.images):
            empty = np.empty((min(self.most, 2 * self.orders) - self.orders, len(image)))
            self.images = np.concatenate([self.images, empty])
            self.directions = np.concatenate([self.directions, empty])
        self.images[self.orders], self.directions[self.orders] = image, direction
        self.orders += 1


def _length(row: Real) -> float:
    return math.sqrt(float(row @ row))


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
    compliance = 1 / certifier.stiffness(core)
    space = LeastResidual(
        lambda u: certifier.modulate(u * compliance, core), right_side, most - orders
    )
    space.extend(_target(certifier, known, right_side, tolerance))
    dynamic = known.dynamic.copy()
    dynamic[: core + 1] += space.solution() * compliance
    return certifier.judge(dynamic, orders + space.orders)


def _target(
    certifier: Certifier, known: Approximation, right_side: Complex, tolerance: float
) -> float:
    """Rms residual of the core that leaves 0.4 of the tolerance."""
    core = right_side.shape[-1] - 1
    gain = float(certifier.gain.acceleration)
    if gain == math.inf:
        return 1e-3 * tolerance * rms(right_side)
    z = known.start + known.dynamic
    z[: core + 1] += right_side / certifier.stiffness(core)
    return 0.4 * tolerance * max(float(known.bound.size), float(certifier.size(z))) / gain
