"""Shapes f(t) of a periodic stiffness k0 [1 + eps f(t)], for questions of stability."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.dynamics import period_trace
from gearmon.dynamics.fourier import Complex, Real, fast_length, samples, with_zero_mean
from gearmon.dynamics.hill import HillProblem, frozen_vector
from gearmon.dynamics.piecewise_problem import PiecewiseProblem
from gearmon.errors import ArgumentError


@dataclass(frozen=True, eq=False)
class FourierShape:
    """Shape f(t) of a stiffness k0 [1 + eps f(t)] by its Fourier coefficients.

    Parameters
    ----------
    harmonics : complex array, shape (J,)
        f_1..f_J, J >= 1: f = sum (f_j e^{ijwt} + conjugate). cos wt is [0.5].
    """

    harmonics: Complex

    def __post_init__(self) -> None:
        vector = frozen_vector("harmonics", self.harmonics)
        if not len(vector):
            raise ArgumentError("harmonics: give at least one coefficient")
        object.__setattr__(self, "harmonics", vector)

    def half_trace(
        self, ratio: Real, variation: Real, zeta: Real, tolerance: float = 1e-12
    ) -> tuple[Real, Real]:
        """Half the trace of the undamped period map as value * e^log; see `period_trace`."""
        return period_trace.of_fourier(ratio, variation, zeta, self.harmonics, tolerance)

    def first_harmonics(self, count: int) -> Complex:
        """f_1..f_count, without the zeros beyond the last."""
        return self.harmonics[:count]

    def over_a_period(self) -> tuple[Real, Real]:
        """Values of f on equal steps, and the share of the period of each."""
        half = with_zero_mean(self.harmonics)
        values = samples(half, fast_length(max(512, 16 * len(half))))
        return values, np.full(len(values), 1 / len(values))

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Smallest and largest f."""
        values, _ = self.over_a_period()
        return float(values.min()), float(values.max())

    def times(self, factor: float) -> FourierShape:
        """Return factor * f(t)."""
        return FourierShape(factor * self.harmonics)


@dataclass(frozen=True, eq=False)
class PiecewiseShape:
    """Shape f(t) of a stiffness k0 [1 + eps f(t)] that is constant piece by piece.

    Parameters
    ----------
    levels, shares : float array, shape (P,)
        f_i, and the share of the period that each lasts, > 0 and together 1. The mean of f must
        be 0.
    """

    levels: Real
    shares: Real

    def __post_init__(self) -> None:
        levels, shares = (np.array(x, dtype=np.float64) for x in (self.levels, self.shares))
        if levels.ndim != 1 or levels.shape != shares.shape or not len(levels):
            raise ArgumentError(
                f"levels and shares: shapes {levels.shape} and {shares.shape} must be one row "
                "each, of the same length"
            )
        if not np.isfinite(levels).all() or not (shares > 0).all():
            raise ArgumentError("levels must be finite and shares > 0")
        if abs(shares.sum() - 1) > 1e-9 or abs(levels @ shares) > 1e-9 * np.abs(levels).max():
            raise ArgumentError(
                f"shares add up to {shares.sum():.9g} and the mean level is {levels @ shares:.3g}; "
                "they must be 1 and 0"
            )
        for name, values in (("levels", levels), ("shares", shares)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @classmethod
    def rectangle(cls, duty: float) -> PiecewiseShape:
        """+1 for a share D = `duty` of the period, -D/(1-D) for the rest."""
        if not 0 < duty < 1:
            raise ArgumentError(f"duty={duty} must lie between 0 and 1")
        return cls(np.array([1.0, -duty / (1 - duty)]), np.array([duty, 1 - duty]))

    def half_trace(
        self,
        ratio: Real,
        variation: Real,
        zeta: Real,
        tolerance: float = 0.0,  # noqa: ARG002
    ) -> tuple[Real, Real]:
        """Half the trace of the undamped period map as value * e^log, exact at any tolerance."""
        return period_trace.of_pieces(ratio, variation, zeta, self.levels, self.shares)

    def first_harmonics(self, count: int) -> Complex:
        """f_1..f_count, counted from the middle of the first piece: a rectangle's are real."""
        orders = np.arange(1, count + 1)
        begins = np.cumsum(self.shares) - self.shares - self.shares[0] / 2
        jumps = self.levels - np.roll(self.levels, 1)
        turns = np.exp(-2j * math.pi * np.outer(orders, begins))
        return np.asarray(turns @ jumps / (2j * math.pi * orders))

    def over_a_period(self) -> tuple[Real, Real]:
        """Values of f, and the share of the period of each."""
        return self.levels, self.shares

    @property
    def extremes(self) -> tuple[float, float]:
        """Smallest and largest f."""
        return float(self.levels.min()), float(self.levels.max())

    def times(self, factor: float) -> PiecewiseShape:
        """Return factor * f(t)."""
        return PiecewiseShape(factor * self.levels, self.shares)


def shape_of(
    problem: HillProblem | PiecewiseProblem,
) -> tuple[FourierShape | PiecewiseShape, float]:
    """Shape f(t) of a problem's stiffness with max f = 1, and the variation eps that belongs to it.

    Returns
    -------
    shape, variation
        eps = max k(t)/k0 - 1, so that an f of cos wt has the usual meaning.

    Raises
    ------
    ArgumentError
        If the stiffness does not vary.
    """
    shape = variation_of(problem)
    top = shape.extremes[1]
    if not top > 0:
        raise ArgumentError("the stiffness does not vary: there is no shape to speak of")
    return shape.times(1 / top), top


def variation_of(problem: HillProblem | PiecewiseProblem) -> FourierShape | PiecewiseShape:
    """k(t)/k0 - 1 itself."""
    if isinstance(problem, PiecewiseProblem):
        levels = problem.relative_levels - 1
        return PiecewiseShape(levels - levels @ problem.shares, problem.shares)
    c = problem.stiffness_harmonics
    return FourierShape(c if len(c) else np.zeros(1, dtype=complex))
