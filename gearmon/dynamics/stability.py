"""Stability of the periodic vibration: Floquet multipliers over grids, and how far off they are.

Free vibrations of m z'' + c z' + k0 [1 + eps f(t)] z = 0 are multiplied by the Floquet multipliers
from period to period; their product is e^{-4 pi R zeta}, so only a real multiplier can leave the
unit circle: through +1 (the growing vibration has the period of the mesh) or through -1 (it has
twice that period).

Source: Magnus and Winkler, Hill's Equation, 1966, chapters 1 and 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import floquet
from gearmon.dynamics.fourier import Complex, Real, fast_length, samples, with_zero_mean
from gearmon.dynamics.hill import HillProblem, frozen_vector
from gearmon.errors import ArgumentError, check_range
from gearmon.result import Result


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

    @cached_property
    def values(self) -> Real:
        """F on equal steps of the period, 512 or more."""
        half = with_zero_mean(self.harmonics)
        return samples(half, fast_length(max(512, 16 * len(half))))

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Smallest and largest f."""
        return float(self.values.min()), float(self.values.max())


def shape_of(problem: HillProblem) -> tuple[FourierShape, float]:
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
    c = problem.stiffness_harmonics
    top = _variation_of(problem).extremes[1]
    if not top > 0:
        raise ArgumentError("the stiffness does not vary: there is no shape to speak of")
    return FourierShape(c / top), top


def _variation_of(problem: HillProblem) -> FourierShape:
    """k(t)/k0 - 1 itself."""
    c = problem.stiffness_harmonics
    return FourierShape(c if len(c) else np.zeros(1, dtype=complex))


@dataclass(frozen=True, kw_only=True, eq=False)
class StabilityChart(Result):
    """Growth of free vibrations over a grid.

    Attributes
    ----------
    shape : FourierShape
        f(t).
    speeds : float ndarray, shape (X,)
        w/w0: mesh frequency over natural frequency.
    variations : float ndarray, shape (E,)
        eps.
    damping_ratio : float
    growth : float ndarray, shape (E, X)
        ln of the larger modulus of the two multipliers, per period; > 0 is unstable.
    """

    shape: FourierShape
    speeds: Real
    variations: Real
    damping_ratio: float
    growth: Real

    @property
    def largest_multiplier(self) -> Real:
        """Modulus of the larger multiplier, shape (E, X)."""
        return np.asarray(np.exp(self.growth))

    @property
    def unstable(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Where free vibrations grow, shape (E, X)."""
        return np.asarray(self.growth > 0)


def stability_chart(
    shape: FourierShape,
    speeds: npt.ArrayLike,
    variations: npt.ArrayLike,
    damping_ratio: float = 0.0,
    tolerance: float = 1e-10,
) -> StabilityChart:
    """Largest Floquet multiplier over (w/w0, eps).

    Parameters
    ----------
    shape : FourierShape
        f(t) of k0 [1 + eps f(t)].
    speeds : float array, shape (X,)
        Ratios w/w0, 0.001 to 1000.
    variations : float array, shape (E,)
        Relative eps, -100 to 100.
    damping_ratio : float
        zeta, 0 to 100.
    tolerance : float
        Of half the trace, 1e-15 to 0.1.

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
    most = x.size * eps.size // 2
    traces = floquet.half_traces_over(1 / x, eps, damping_ratio, shape.harmonics, tolerance, most)
    grown = floquet.growth(*traces(1 / x[None, :], eps[:, None])) - 2 * math.pi * damping_ratio / x
    return StabilityChart(
        shape=shape, speeds=x, variations=eps, damping_ratio=float(damping_ratio), growth=grown
    )


def excess(
    traces: floquet.HalfTraces, ratio: Real, variation: Real, zeta: float
) -> tuple[Real, Real]:
    """Smooth measure of instability, by which of +1 and -1 it comes.

    Returns
    -------
    plus, minus : float ndarray
        e^{-u} (+-H - cosh u), u = 2 pi R zeta: above zero where a multiplier lies beyond +1, or
        beyond -1.
    """
    value, log = traces(ratio, variation)
    decay = 2 * math.pi * zeta * ratio
    with np.errstate(over="ignore"):
        scaled = value * np.exp(np.minimum(log - decay, 700.0))
    level = (1 + np.exp(-2 * decay)) / 2
    return scaled - level, -scaled - level


SCAN_TOLERANCE = 1e-8
#: Highest w0/w for which the search is worth its time.
MOST_SEARCHED = 200.0


@dataclass(frozen=True, kw_only=True)
class StabilityMargin:
    """How far a system is from instability.

    Attributes
    ----------
    multipliers : (complex, complex)
        Floquet multipliers, the larger modulus first.
    variation_factor : float
        The stiffness variation k(t)/k0 - 1 may be multiplied by this before free vibrations grow;
        below 1 if they do already. Infinite if none does while k(t) stays > 0; NaN if not
        searched for.
    positive_factor : float
        Factor at which k(t) first touches zero: beyond it there is no spring.
    stable : bool
        Whether free vibrations die out.
    message : str
        One line with the numbers.
    """

    multipliers: tuple[complex, complex]
    variation_factor: float
    positive_factor: float
    stable: bool
    message: str


def stability_margin(problem: HillProblem, search: bool = True) -> StabilityMargin:
    """Multipliers of a problem, and the factor on its stiffness variation that makes it unstable.

    Parameters
    ----------
    problem : HillProblem
    search : bool
        Whether to look for `variation_factor`; where damping does not settle it at once, its cost
        grows as (w0/w)^2, and above w0/w = 200 it is not looked for.

    Notes
    -----
    The factor is the first at which a smooth function of it passes zero, looked for on a grid of
    16 points to each swing of the half trace and at all its maxima, above the variation that
    damping outdoes for certain.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> m = stability_margin(p)
    >>> m.stable, m.variation_factor, round(m.positive_factor, 3)
    (True, inf, 7.692)
    """
    shape = _variation_of(problem)
    ratio, zeta = problem.frequency_ratio, problem.damping_ratio
    pair = floquet.multipliers(ratio, zeta, shape.harmonics, 1e-12)
    grown = float(floquet.growth_of(ratio, 1.0, zeta, shape.harmonics))
    low = -shape.extremes[0]
    positive = 1 / low if low > 0 else math.inf
    factor = _first_unstable(shape, ratio, zeta, positive) if search else math.nan
    return StabilityMargin(
        multipliers=pair,
        variation_factor=factor,
        positive_factor=positive,
        stable=grown < 0,
        message=_margin_message(grown, zeta, factor, positive),
    )


def _margin_message(grown: float, zeta: float, factor: float, positive: float) -> str:
    verb = "grow" if grown > 0 else "shrink"
    text = f"free vibrations {verb} by the factor {math.exp(min(grown, 700.0)):.6g} a period"
    if zeta == 0 and grown <= 0:
        text = "undamped: free vibrations neither grow nor die out"
    if math.isnan(factor):
        return text
    if math.isinf(factor):
        return f"{text}; no variation that keeps k(t) > 0 (up to {positive:.4g} times) is unstable"
    return f"{text}; unstable from {factor:.6g} times the stiffness variation on"


def _first_unstable(shape: FourierShape, ratio: float, zeta: float, most: float) -> float:
    """Smallest factor in (0, most) with a multiplier beyond the unit circle."""
    if not math.isfinite(most):
        return math.inf
    least = certainly_stable_up_to(shape, ratio, zeta, most)
    if least >= most:
        return math.inf
    if ratio > MOST_SEARCHED:
        return math.nan
    grid = np.linspace(least, most, 64 + 16 * math.ceil(2 * ratio) + 1)

    def values(factors: Real | float, tolerance: float = 1e-12) -> Real:
        known = partial(floquet.half_traces, zeta=zeta, harmonics=shape.harmonics)
        traces = partial(known, tolerance=tolerance)
        return np.maximum(*excess(traces, np.array(ratio), np.asarray(factors), zeta))

    return _first_crossing(lambda s: float(values(s)), grid, values(grid, SCAN_TOLERANCE))


def certainly_stable_up_to(shape: FourierShape, ratio: float, zeta: float, most: float) -> float:
    """Return a factor on f(t) below which damping outdoes any growth, at most `most`.

    With q = 1 - zeta^2 + s f, y'' + q y = 0 cannot grow by more than ln: int s|f| dt/(2 sqrt(1 -
    zeta^2)) per period (from y'^2 + (1 - zeta^2) y^2), nor by more than a quarter of the total
    variation of ln q (from (y'^2 + q y^2)/sqrt q).
    """
    if not 0 < zeta < 1:
        return 0.0
    values, rest = shape.values, 1 - zeta**2
    by_size = 2 * zeta * math.sqrt(rest) / float(np.abs(values).mean())
    low, high = 0.0, min(most, 0.999 * rest / max(1e-300, -float(values.min())))
    for _ in range(40):
        middle = (low + high) / 2
        logs = np.log(rest + middle * values)
        total = float(np.abs(logs - np.roll(logs, 1)).sum())
        if 1.02 * total / 4 < 2 * math.pi * ratio * zeta:
            low = middle
        else:
            high = middle
    return min(most, max(0.99 * by_size, low))


def _first_crossing(function: Callable[[float], float], grid: Real, values: Real) -> float:
    """Smallest s with function(s) > 0, also between grid points where it has a maximum."""
    from scipy.optimize import brentq, minimize_scalar

    # a system without variation is on the boundary at most
    above = np.flatnonzero(values[1:] > 1e-14) + 1
    first = int(above[0]) if len(above) else len(grid)
    inner = np.arange(1, min(first, len(grid) - 1))
    peaks = inner[(values[inner] >= values[inner - 1]) & (values[inner] >= values[inner + 1])]
    low, high = grid[first - 1], grid[first] if first < len(grid) else math.inf
    for peak in peaks:
        ends = grid[peak - 1], grid[peak + 1]
        top = minimize_scalar(
            lambda s: -function(s), bounds=ends, options={"xatol": 1e-9 * ends[1]}
        )
        if -top.fun > 1e-14:
            low, high = ends[0], float(top.x)
            break
    if math.isinf(high):
        return math.inf
    return float(brentq(function, low, high, xtol=1e-15 * high, rtol=1e-14))
