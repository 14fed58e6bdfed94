"""Harmonic balance whose residual is computed in extended precision: a slow, exact motion.

The residual is taken term by term in extended precision (64 bits of mantissa on x86) from mass,
damping, stiffness and period as they are given; a banded factorisation in double precision answers
it, again and again until nothing changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import zgbtrf, zgbtrs

ROUNDS = 8
TAIL = 1e-20
#: 2 pi beyond double precision.
FULL_TURN = np.longdouble("6.283185307179586476925286766559005768")


@dataclass(frozen=True, kw_only=True, eq=False)
class RefinedBalance:
    """Harmonics of one system, and how well they are known.

    Attributes
    ----------
    displacement : extended complex ndarray, shape (N+1,)
        z_0..z_N [F/k0].
    uncertainty : float
        Relative: the last correction of the acceleration and the highest lines.
    """

    displacement: np.ndarray
    uncertainty: float

    def error(self, displacement_m, problem):
        """Relative L2 error of the acceleration of given harmonics [m]."""
        size = max(len(self.displacement), len(displacement_m))
        exact = np.zeros(size, dtype=np.clongdouble)
        exact[: len(self.displacement)] = self.displacement
        unit = np.longdouble(problem.force_n) / np.longdouble(problem.stiffness_n_per_m)
        difference = exact.copy()
        difference[: len(displacement_m)] -= displacement_m.astype(np.clongdouble) / unit
        squares = np.arange(size, dtype=np.longdouble) ** 2
        return float(_norm(squares * difference) / _norm(squares * exact))


def refined_balance(problem):
    """Solve the harmonic balance with as many harmonics as extended precision can tell.

    Parameters
    ----------
    problem : HillProblem
        With a constant force.
    """
    count = len(problem.stiffness_harmonics)
    reach = 1 + 2 * float(np.abs(problem.stiffness_harmonics).sum())
    highest = math.ceil(1.3 * problem.frequency_ratio * math.sqrt(reach)) + 2 * count + 8
    while True:
        found, change = _refined(problem, highest)
        weighted = np.arange(highest + 1) ** 2 * np.abs(found)
        tail = float(weighted[-count:].max() / weighted.max())
        if tail < TAIL or highest > 20_000:
            return RefinedBalance(displacement=found, uncertainty=change + tail)
        highest = math.ceil(1.3 * highest) + count


def _refined(problem, highest):
    """Harmonics 0..highest and the relative size of the last correction."""
    equation = _Equation(problem, highest)
    z = np.zeros(2 * highest + 1, dtype=np.clongdouble)
    squares = np.arange(-highest, highest + 1) ** 2
    change = math.inf
    for _ in range(ROUNDS):
        correction = equation.answer(equation.residual(z))
        z = z + correction
        last, change = change, float(_norm(squares * correction) / _norm(squares * z))
        if change < 1e-19 or change > 0.5 * last:
            break
    return z[highest:], change


class _Equation:
    """D z + phi z = 1 for harmonics -N..N, in units of k0 and F/k0."""

    def __init__(self, problem, highest):
        p = problem
        mass, damping, stiffness = (
            np.longdouble(value) for value in (p.mass_kg, p.damping_ns_per_m, p.stiffness_n_per_m)
        )
        turn = FULL_TURN / np.longdouble(p.period_s) * np.arange(-highest, highest + 1)
        real = (stiffness - mass * turn**2) / stiffness
        self.diagonal = real + 1j * (damping * turn / stiffness)
        c = p.stiffness_harmonics[: 2 * highest].astype(np.clongdouble)
        self.modulation = np.concatenate([c[::-1].conj(), np.zeros(1), c])
        self.highest = highest
        self.width = len(c)
        size, width = 2 * highest + 1, self.width
        bands = np.zeros((3 * width + 1, size), dtype=np.complex128)
        bands[width:] = self.modulation.astype(np.complex128)[:, None]
        bands[2 * width] = self.diagonal.astype(np.complex128)
        self.factors, self.pivots, _ = zgbtrf(bands, width, width)

    def residual(self, z):
        """Return what is left of the constant force."""
        size = len(z)
        left = -self.diagonal * z
        left -= np.convolve(self.modulation, z)[self.width : self.width + size]
        left[self.highest] += 1
        return np.asarray(left)

    def answer(self, residual):
        """Return the correction, to double precision of itself."""
        size = float(np.abs(residual).max()) or 1.0
        right = (residual / size).astype(np.complex128)
        solution, _ = zgbtrs(self.factors, self.width, self.width, right, self.pivots)
        return np.asarray(solution.astype(np.clongdouble) * size)


def _norm(values):
    return np.sqrt((values.real**2 + values.imag**2).sum())
