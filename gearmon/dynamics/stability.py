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

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import period_trace
from gearmon.dynamics.fourier import Real
from gearmon.dynamics.stiffness_shapes import FourierShape, PiecewiseShape, shape_of
from gearmon.errors import ArgumentError, check_range

__all__ = [
    "FourierShape",
    "PiecewiseShape",
    "StabilityChart",
    "excess",
    "growth_of",
    "shape_of",
    "stability_chart",
]


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
