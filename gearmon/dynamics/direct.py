"""All lines of a small problem solved together: one band factorisation, certified by itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from gearmon.dynamics import inverse_bound
from gearmon.dynamics.band_system import MOST_LINES, BandSystem
from gearmon.dynamics.fourier import Complex

if TYPE_CHECKING:
    from gearmon.dynamics.hill import HillProblem

# N J^2 up to which factors take less time than orders, of which few do where they converge fast
MOST_WORK_BESIDE_FEW_ORDERS = 4e5
MOST_WORK = 4e6
MOST_SWEEPS = 6
QUICK = 0.7
MOST_INVERTED = 300


class Solution(NamedTuple):
    """A steady vibration found directly.

    Attributes
    ----------
    displacement : complex ndarray, shape (N+1,)
        z_0..z_N [m].
    bound : float
        Guaranteed relative L2 error of the acceleration.
    stable : bool
        Whether free vibrations die out.
    solved : int
        Highest harmonic of the matrix; those above were added one by one.
    sweeps : int
        How often they and the core were corrected.
    pressed : bool
        Whether the acceleration is so small that the teeth stay in contact for certain.
    """

    displacement: Complex
    bound: float
    stable: bool
    solved: int
    sweeps: int
    pressed: bool


def solve(
    problem: HillProblem, tolerance: float, shown: int | None = None, *, thorough: bool = False
) -> Solution | None:
    """Steady vibration of a small problem, or None where another way is called for.

    None is returned for problems too large to be cheap, without damping or coupling, too close to
    instability for the determinant to tell, and where the tolerance is not met.

    Parameters
    ----------
    problem : HillProblem
        The equation.
    tolerance : float
        Relative L2 error of the acceleration aimed at.
    shown : int, optional
        Harmonics 0..shown are handed out, others dropped; default all.
    thorough : bool
        Bound the inverse by computing it, which takes a hundred times as long, and return the best
        there is even if it misses the tolerance.
    """
    count = len(problem.stiffness_harmonics)
    if not count or problem.damping_ns_per_m <= 0 or count > MOST_LINES:
        return None
    system = BandSystem(problem)
    if not system.scale:
        return None
    solved = system.enough_lines(tolerance)
    if thorough:
        return _solve_thoroughly(system, solved, tolerance, shown)
    if not _affordable(system, solved, MOST_LINES) or not system.factorise(solved):
        return None
    inverse = inverse_bound.cheap(system)
    if inverse is not None:
        found = _refine(system, inverse, tolerance, shown)
        if found.bound <= tolerance or not found.stable:
            return found
    if not _affordable(system, solved, MOST_INVERTED):
        return None
    inverse = inverse_bound.by_inverse(system, inverse_bound.crude_norm)
    if inverse is None:
        return None
    found = _refine(system, inverse, tolerance, shown)
    return found if found.bound <= tolerance or not found.stable else None


def _solve_thoroughly(
    system: BandSystem, solved: int, tolerance: float, shown: int | None
) -> Solution | None:
    """Solve with as many lines as it takes to bound the inverse."""
    for _ in range(4):
        if not _affordable(system, solved, MOST_INVERTED) or not system.factorise(solved):
            return None
        inverse = inverse_bound.by_inverse(system, inverse_bound.norm)
        if inverse is not None:
            return _refine(system, inverse, tolerance, shown)
        solved = solved + solved // 2 + system.band
    return None


def _affordable(system: BandSystem, solved: int, most: int) -> bool:
    work = MOST_WORK_BESIDE_FEW_ORDERS if system.loop < QUICK else MOST_WORK
    return solved <= most and solved * system.band**2 <= work


def _refine(
    system: BandSystem, inverse: inverse_bound.InverseBound, tolerance: float, shown: int | None
) -> Solution:
    """Sweep until the bound meets the tolerance or rounding keeps it from falling."""
    system.begin()
    bound = math.inf
    if not inverse.stable:
        return Solution(system.vibration(shown)[0], bound, False, system.solved, 0, False)
    for sweep in range(MOST_SWEEPS + 1):
        if sweep:
            system.sweep()
        displacement, last = system.vibration(shown)
        before, bound = bound, inverse_bound.relative_bound(system, inverse, last)
        if bound <= tolerance or bound > 0.5 * before < math.inf:
            break
    return Solution(displacement, bound, inverse.stable, system.solved, sweep, system.pressed)
