"""A stability chart with its boundaries, exact and by multiple scales, and a machine's place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.fourier import Real
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.period_trace import HalfTraces
from gearmon.dynamics.stability import (
    FourierShape,
    StabilityChart,
    shape_of,
    stability_chart,
)
from gearmon.dynamics.tongues import (
    MOST_TONGUE,
    expanded_tongue,
    is_open,
    tongue_edges,
    traces_around,
)
from gearmon.errors import ArgumentError, check_range
from gearmon.result import Result

#: Part of the variation that brings k(t) to zero up to which a map is drawn.
HIGHEST_SHARE = 0.98
MOST_TONGUES = 14
TIP_HALVINGS = 8
#: Harmonics of the stiffness, beyond the tongue's number, that multiple scales gets.
HARMONICS = 24
#: n max|phi| beyond which neighbouring tongues mix and multiple scales is no boundary at all.
MOST_COUPLED = 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Tongue(Result):
    """Boundaries of one unstable tongue.

    Attributes
    ----------
    number : int
        n: it starts from w/w0 = 2/n.
    variations : float ndarray, shape (E,)
        eps.
    exact : float ndarray, shape (E, 2)
        Lower and upper w/w0; NaN where the tongue is closed.
    expanded : dict of int to float ndarray, shape (E, 2)
        The same by multiple scales, by order; NaN also where n max|phi| > 3, far beyond its range.
    """

    number: int
    variations: Real
    exact: Real
    expanded: dict[int, Real]


@dataclass(frozen=True, kw_only=True, eq=False)
class StabilityMap(Result):
    """All that a picture of stability shows.

    Attributes
    ----------
    chart : StabilityChart
    tongues : tuple of Tongue
    mark : (float, float) or None
        w/w0 and eps of a machine.
    """

    chart: StabilityChart
    tongues: tuple[Tongue, ...]
    mark: tuple[float, float] | None


def stability_map(
    shape: FourierShape,
    damping_ratio: float = 0.0,
    speeds: tuple[float, float] = (0.45, 2.6),
    highest_variation: float | None = None,
    orders: tuple[int, ...] = (1, 2),
    mark: tuple[float, float] | None = None,
    points: tuple[int, int] = (320, 120),
) -> StabilityMap:
    """Compute chart and boundaries over a rectangle of w/w0 and eps >= 0.

    Parameters
    ----------
    shape : FourierShape
        f(t) of k0 [1 + eps f(t)].
    damping_ratio : float
        zeta, 0 to below 1.
    speeds : (float, float)
        Range of w/w0, > 0. The fourteen tongues with the lowest numbers in it are followed.
    highest_variation : float, optional
        Largest eps; by default 0.98 of what brings k(t) to zero, at most 1.
    orders : tuple of int
        Orders of multiple scales to show, 1 to 12; empty for none.
    mark : (float, float), optional
        w/w0 and eps of a machine.
    points : (int, int)
        Grid points along w/w0 and eps, >= 2.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    """
    low, high = (check_range("speeds", x, 2 / MOST_TONGUE, 1e3) for x in speeds)
    if low >= high:
        raise ArgumentError(f"speeds={speeds}: the first must be smaller than the second")
    for count in points:
        check_range("points", count, 2, 20_000)
    limit = HIGHEST_SHARE / -shape.extremes[0]
    if highest_variation is None:
        highest_variation = min(1.0, limit)
    check_range("highest_variation", highest_variation, 1e-6, limit)
    chart = stability_chart(
        shape,
        np.linspace(low, high, points[0]),
        np.linspace(0.0, highest_variation, points[1]),
        damping_ratio,
    )
    # tongues bend to lower speeds, so that some begin outside
    first, last = max(1, math.ceil(1.7 / high)), math.floor(2 / low)
    numbers = range(first, min(last, first + MOST_TONGUES - 1, MOST_TONGUE) + 1)
    coarse = highest_variation * np.linspace(0.0, 1.0, 49)
    traces = traces_around(shape, numbers, coarse, damping_ratio) if numbers else None
    tongues = tuple(_tongue(shape, n, coarse[1:], damping_ratio, orders, traces) for n in numbers)
    return StabilityMap(chart=chart, tongues=tongues, mark=mark)


def _tongue(
    shape: FourierShape,
    number: int,
    coarse: Real,
    zeta: float,
    orders: tuple[int, ...],
    traces: HalfTraces | None,
) -> Tongue:
    """Boundaries on a grid of eps that is fine at the tips."""
    eps = np.unique(np.concatenate([coarse, _near_tips(shape, number, coarse, zeta, traces)]))
    return Tongue(
        number=number,
        variations=eps,
        exact=tongue_edges(shape, number, eps, zeta, traces),
        expanded={k: _expanded(shape, number, eps, zeta, k) for k in orders},
    )


def _expanded(shape: FourierShape, number: int, eps: Real, zeta: float, order: int) -> Real:
    """Edges by multiple scales, shape (E, 2); NaN where they find none, or mean nothing."""
    harmonics = shape.harmonics[: number + HARMONICS]
    largest = max(shape.extremes[1], -shape.extremes[0])
    edges = np.full((len(eps), 2), np.nan)
    for row, variation in enumerate(eps):
        if number * variation * largest > MOST_COUPLED:
            continue
        try:
            found = expanded_tongue(variation * harmonics, number, zeta, order)
        except ArgumentError:
            # the iteration of a high order does not settle: there is nothing to show
            found = None
        if found is not None:
            edges[row] = found
    return edges


def _near_tips(
    shape: FourierShape, number: int, coarse: Real, zeta: float, traces: HalfTraces | None
) -> Real:
    """Variations that crowd towards where the tongue opens or closes."""
    grid = np.concatenate([[0.0], coarse])
    wide_open = is_open(shape, number, grid, zeta, traces)
    change = np.flatnonzero(wide_open[1:] != wide_open[:-1])
    shut, wide = (
        np.where(wide_open[change], grid[change + 1], grid[change]),
        np.where(wide_open[change], grid[change], grid[change + 1]),
    )
    if not len(change):
        return np.zeros(0)
    away = wide.copy()
    for _ in range(TIP_HALVINGS):
        middle = (shut + wide) / 2
        opened = is_open(shape, number, middle, zeta, traces)
        wide, shut = np.where(opened, middle, wide), np.where(opened, shut, middle)
    # edges leave a tip like a square root
    share = np.linspace(0.0, 1.0, 9)[:-1] ** 2
    return np.asarray((wide[:, None] + (away - wide)[:, None] * share).ravel())


def stability_map_of(
    problem: HillProblem,
    orders: tuple[int, ...] = (1, 2),
    points: tuple[int, int] = (320, 120),
) -> StabilityMap:
    """Map around a problem, with its own stiffness form and damping, and a mark at its place.

    Parameters
    ----------
    problem : HillProblem
        Damping ratio below 1 and w/w0 from 0.01; eps is max k(t)/k0 - 1.
    orders, points
        As of `stability_map`.

    Raises
    ------
    ArgumentError
        If the stiffness does not vary, or the problem lies outside of what can be drawn.
    """
    shape, eps = shape_of(problem)
    x = 1 / problem.frequency_ratio
    usual = (0.45, 2.6)
    speeds = usual if usual[0] < x < usual[1] else (0.85 * x, 1.2 * x)
    limit = HIGHEST_SHARE / -shape.extremes[0]
    highest = min(limit, max(1.2 * eps, min(1.0, limit)))
    return stability_map(shape, problem.damping_ratio, speeds, highest, orders, (x, eps), points)
