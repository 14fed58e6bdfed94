"""How far a mesh is from instability: multipliers, and what stiffness variation it would take."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics import floquet
from gearmon.dynamics.fourier import Real
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.piecewise import PiecewiseProblem
from gearmon.dynamics.stability import FourierShape, PiecewiseShape, excess, variation_of

#: Systems tried at once when a number is narrowed down, and how often.
ZOOM, ZOOMS = 9, 18
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
    growth_per_period : float
        ln |larger multiplier|: > 0 grows, < 0 decays.
    growth_rate_per_s : float
        The same over the period [1/s].
    variation_factor : float
        The stiffness variation k(t)/k0 - 1 may be multiplied by this before free vibrations grow;
        below 1 if they do already. Infinite if none does while k(t) stays > 0; NaN if not
        searched for.
    positive_factor : float
        Factor at which k(t) first touches zero: beyond it there is no spring.
    doubles_period : bool or None
        Whether the vibration that grows at `variation_factor` has twice the mesh period; None if
        there is none.
    stable : bool
    message : str
        One line with the numbers.
    """

    multipliers: tuple[complex, complex]
    growth_per_period: float
    growth_rate_per_s: float
    variation_factor: float
    positive_factor: float
    doubles_period: bool | None
    stable: bool
    message: str


def stability_margin(
    problem: HillProblem | PiecewiseProblem, search: bool = True
) -> StabilityMargin:
    """Multipliers of a problem, and the factor on its stiffness variation that makes it unstable.

    Parameters
    ----------
    problem : HillProblem or PiecewiseProblem
        Of a piecewise problem all is exact; of the other to about 1e-12.
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
    shape = variation_of(problem)
    ratio, zeta = problem.frequency_ratio, problem.damping_ratio
    value, log = shape.half_trace(np.array(ratio), np.array(1.0), np.array(zeta))
    pair = floquet.exponents(np.diag([float(value)] * 2), float(log))
    decay = 2 * math.pi * ratio * zeta
    growth = pair[0].real - decay
    low = -shape.extremes[0]
    positive = 1 / low if low > 0 else math.inf
    factor, doubles = math.nan, None
    if search:
        factor, doubles = _first_unstable(shape, ratio, zeta, positive)
    stable = growth < 0
    return StabilityMargin(
        multipliers=(cmath.exp(pair[0] - decay), cmath.exp(pair[1] - decay)),
        growth_per_period=growth,
        growth_rate_per_s=growth / problem.period_s,
        variation_factor=factor,
        positive_factor=positive,
        doubles_period=doubles,
        stable=stable,
        message=_margin_message(growth, zeta, factor, positive),
    )


def _margin_message(growth: float, zeta: float, factor: float, positive: float) -> str:
    if zeta == 0 and growth <= 0:
        text = "undamped: free vibrations neither grow nor die out"
    else:
        verb = "grow" if growth > 0 else "shrink"
        text = f"free vibrations {verb} by the factor {math.exp(growth):.6g} a period"
    if math.isnan(factor):
        return text
    if math.isinf(factor):
        return f"{text}; no variation that keeps k(t) > 0 (up to {positive:.4g} times) is unstable"
    return f"{text}; unstable from {factor:.6g} times the stiffness variation on"


def _first_unstable(
    shape: FourierShape | PiecewiseShape, ratio: float, zeta: float, most: float
) -> tuple[float, bool | None]:
    """Smallest factor in (0, most) with a multiplier beyond the unit circle, and which."""
    if not math.isfinite(most):
        return math.inf, None
    least = certainly_stable_up_to(shape, ratio, zeta, most)
    if least >= most:
        return math.inf, None
    if ratio > MOST_SEARCHED:
        return math.nan, None
    count = 64 + 16 * math.ceil(2 * ratio)
    grid = np.linspace(least, most, count + 1)

    def both(s: Real, tolerance: float = 1e-12) -> Real:
        return np.array(excess(shape, np.array(ratio), s, zeta, tolerance))

    values = both(grid, SCAN_TOLERANCE)
    plus = _first_crossing(lambda s: both(s)[0], grid, values[0])
    minus = _first_crossing(lambda s: both(s)[1], grid, values[1])
    first = min(plus, minus)
    return first, None if math.isinf(first) else minus < plus


def certainly_stable_up_to(
    shape: FourierShape | PiecewiseShape, ratio: float, zeta: float, most: float
) -> float:
    """Return a factor on f(t) below which damping outdoes any growth, at most `most`.

    With q = 1 - zeta^2 + s f, y'' + q y = 0 cannot grow by more than ln: int s|f| dt/(2 sqrt(1 -
    zeta^2)) per period (from y'^2 + (1 - zeta^2) y^2), nor by more than a quarter of the total
    variation of ln q (from (y'^2 + q y^2)/sqrt q).
    """
    if not 0 < zeta < 1:
        return 0.0
    values, shares = shape.over_a_period()
    rest = 1 - zeta**2
    by_size = 2 * zeta * math.sqrt(rest) / float(np.abs(values) @ shares)
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


def _first_crossing(function: Callable[[Real], Real], grid: Real, values: Real) -> float:
    """Smallest s with function(s) > 0, also between grid points where it has a maximum."""
    # a system without variation is on the boundary at most
    above = np.flatnonzero(values[1:] > 1e-14) + 1
    first = int(above[0]) if len(above) else len(grid)
    inner = np.arange(1, min(first, len(grid) - 1))
    peaks = inner[(values[inner] >= values[inner - 1]) & (values[inner] >= values[inner + 1])]
    for peak in peaks:
        top = maximum(function, grid[peak - 1], grid[peak + 1])
        if function(np.array([top]))[0] > 1e-14:
            return crossing(function, grid[peak - 1], top)
    return crossing(function, grid[first - 1], grid[first]) if first < len(grid) else math.inf


def maximum(function: Callable[[Real], Real], left: float, right: float) -> float:
    """Place of the largest value between two points, for a function with one maximum there."""
    for _ in range(8):
        places = np.linspace(left, right, ZOOM)
        best = int(np.argmax(function(places)))
        left, right = places[max(0, best - 1)], places[min(ZOOM - 1, best + 1)]
    return float((left + right) / 2)


def crossing(function: Callable[[Real], Real], low: float, high: float) -> float:
    """Place where a function passes zero upwards from `low` to `high`, to rounding."""
    for _ in range(ZOOMS):
        places = np.linspace(low, high, ZOOM)
        first = int(np.argmax(function(places) > 0))
        if first == 0:
            break
        low, high = float(places[first - 1]), float(places[first])
    return (low + high) / 2
