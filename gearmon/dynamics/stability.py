"""Stability of the periodic vibration: Floquet multipliers over grids, and how far off they are.

Free vibrations of m z'' + c z' + k0 [1 + eps f(t)] z = 0 are multiplied by the Floquet multipliers
from period to period; their product is e^{-4 pi R zeta}, so only a real multiplier can leave the
unit circle: through +1 (the growing vibration has the period of the mesh) or through -1 (it has
twice that period).

Source: Magnus and Winkler, Hill's Equation, 1966, chapters 1 and 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import period_trace
from gearmon.dynamics.fourier import Complex, Real, fast_length, samples, with_zero_mean
from gearmon.dynamics.hill import HillProblem, frozen_vector
from gearmon.dynamics.piecewise import PiecewiseProblem
from gearmon.errors import ArgumentError, check_range


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


@dataclass(frozen=True, kw_only=True, eq=False)
class StabilityChart:
    """Growth of free vibrations over a grid.

    Attributes
    ----------
    shape : FourierShape or PiecewiseShape
        f(t).
    speeds : float ndarray, shape (X,)
        w/w0: mesh frequency over natural frequency.
    variations : float ndarray, shape (E,)
        eps.
    damping_ratio : float
    growth : float ndarray, shape (E, X)
        ln of the larger modulus of the two multipliers, per period; > 0 is unstable.
    """

    shape: FourierShape | PiecewiseShape
    speeds: Real
    variations: Real
    damping_ratio: float
    growth: Real

    @property
    def largest_multiplier(self) -> Real:
        """Modulus of the larger multiplier, shape (E, X)."""
        return np.asarray(np.exp(self.growth))

    @property
    def growth_per_vibration(self) -> Real:
        """Growth over one undamped period of the mean stiffness, growth w/w0, shape (E, X)."""
        return self.growth * self.speeds

    @property
    def unstable(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Where free vibrations grow, shape (E, X)."""
        return np.asarray(self.growth > 0)


def stability_chart(
    shape: FourierShape | PiecewiseShape,
    speeds: npt.ArrayLike,
    variations: npt.ArrayLike,
    damping_ratio: float = 0.0,
    tolerance: float = 1e-10,
) -> StabilityChart:
    """Largest Floquet multiplier over (w/w0, eps).

    Parameters
    ----------
    shape : FourierShape or PiecewiseShape
        f(t) of k0 [1 + eps f(t)].
    speeds : float array, shape (X,)
        w/w0, 0.001 to 1000.
    variations : float array, shape (E,)
        eps, -100 to 100.
    damping_ratio : float
        zeta, 0 to 100.
    tolerance : float
        Of half the trace, for a Fourier shape, 1e-15 to 0.1; a piecewise one is exact.

    Returns
    -------
    StabilityChart

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> chart = stability_chart(FourierShape([0.5]), [1.9, 2.0, 2.1], [0.1, 0.4])
    >>> chart.unstable.tolist()
    [[False, True, False], [True, True, True]]
    """
    x, eps = (np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in (speeds, variations))
    for name, row, low, high in (("speeds", x, 1e-3, 1e3), ("variations", eps, -100.0, 100.0)):
        if row.ndim != 1:
            raise ArgumentError(f"{name}: shape {row.shape} must be one row")
        for value in (row.min(), row.max()):
            check_range(name, float(value), low, high)
    check_range("damping_ratio", damping_ratio, 0.0, 100.0)
    check_range("tolerance", tolerance, 1e-15, 0.1)
    growth = growth_of(shape, 1 / x[None, :], eps[:, None], damping_ratio, tolerance)
    return StabilityChart(
        shape=shape, speeds=x, variations=eps, damping_ratio=float(damping_ratio), growth=growth
    )


def growth_of(
    shape: FourierShape | PiecewiseShape,
    ratio: Real,
    variation: Real,
    zeta: Real | float,
    tolerance: float = 1e-12,
) -> Real:
    """Natural logarithm of the largest multiplier's modulus per period; arguments broadcast."""
    value, log = shape.half_trace(ratio, variation, np.asarray(zeta), tolerance)
    return period_trace.growth(value, log) - 2 * math.pi * zeta * ratio


def excess(
    shape: FourierShape | PiecewiseShape,
    ratio: Real,
    variation: Real,
    zeta: Real | float,
    tolerance: float = 1e-12,
) -> tuple[Real, Real]:
    """Smooth measure of instability, by which of +1 and -1 it comes.

    Returns
    -------
    plus, minus : float ndarray
        e^{-u} (+-H - cosh u), u = 2 pi R zeta: above zero where a multiplier lies beyond +1, or
        beyond -1.
    """
    value, log = shape.half_trace(ratio, variation, np.asarray(zeta), tolerance)
    decay = 2 * math.pi * zeta * ratio
    with np.errstate(over="ignore"):
        scaled = value * np.exp(np.minimum(log - decay, 700.0))
    level = (1 + np.exp(-2 * decay)) / 2
    return scaled - level, -scaled - level
