"""The largest power that keeps travel and stress within their limits.

A limit can make the best place one beside a line, so that the whole range is scanned: the power
without limits, which is cheap and never less, says in which order and when to stop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from gearmon.harvesting.answer import peaks_by_load
from gearmon.harvesting.duty import OperatingShare
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.refinement import Heard, Start, with_best_load

Real = npt.NDArray[np.float64]
H = TypeVar("H", bound=Harvester)

#: Natural frequencies tried over the whole range.
SCANNED = 200
#: Natural frequencies about a promising place, in damping ratios from it.
ABOUT = np.concatenate([-np.geomspace(12, 0.2, 12), [0.0], np.geomspace(0.2, 12, 12)])
#: Loads over the whole range, and again between the neighbours of the best.
LOADS, ZOOMED = 25, 9
ZOOMS = 4
#: Frequencies that are refined, and the step at which that ends, in damping ratios.
REFINED, LAST_STEP = 3, 0.005


@dataclass(frozen=True, kw_only=True, eq=False)
class Limited(Generic[H]):
    """A tuned harvester with the load that takes most within the limits.

    Attributes
    ----------
    harvester : Harvester
    power_w : float
        Mean power [W]; -1 if no load keeps within the limits.
    share : float
        Largest peak over its limit.
    """

    harvester: H
    power_w: float
    share: float


def largest_allowed(
    harvester: H,
    points: tuple[OperatingShare, ...],
    heard: Heard,
    places: list[Start[H]],
    margin: float = 1.0,
) -> list[Limited[H]]:
    """Find the best tunings within the limits.

    Parameters
    ----------
    harvester : Harvester
    points : tuple of OperatingShare
    heard : Heard
        The same in one row.
    places : list of Start
        Where the power without limits is large.
    margin : float, >= 1
        What peaks are multiplied by.

    Returns
    -------
    list of Limited
        Up to three, the best first; if none keeps the limits, the one that comes nearest.
    """
    free = [with_best_load(harvester.retuned(float(f)), heard) for f in _grid(harvester, places)]
    free.sort(key=lambda start: -start.power_w)
    found: list[Limited[H]] = []
    best = -1.0
    for start in free:
        if start.power_w <= best:
            break
        found.append(_with_allowed_load(start.harvester, points, margin, 0))
        best = max(best, found[-1].power_w)
    allowed = sorted((f for f in found if f.power_w >= 0), key=lambda f: -f.power_w)
    if not allowed:
        return [min(found, key=lambda f: f.share)]
    chosen = [_refined(one, points, margin) for one in _apart(allowed)]
    return sorted(chosen, key=lambda f: -f.power_w)


def _grid(harvester: H, places: list[Start[H]]) -> Real:
    low, high = harvester.frequency_range_hz
    about = [
        place.harvester.natural_frequency_hz * (1 + place.harvester.damping_ratio * ABOUT)
        for place in places
    ]
    grid = np.concatenate([np.geomspace(low, high, SCANNED), *about])
    return np.unique(np.clip(grid, low, high))


def _apart(allowed: list[Limited[H]]) -> list[Limited[H]]:
    """Best ones that lie more than a damping ratio from each other."""
    chosen: list[Limited[H]] = []
    for one in allowed:
        ratios = [
            abs(math.log(one.harvester.natural_frequency_hz / c.harvester.natural_frequency_hz))
            for c in chosen
        ]
        if all(ratio > one.harvester.damping_ratio for ratio in ratios):
            chosen.append(one)
        if len(chosen) == REFINED:
            break
    return chosen


def _refined(start: Limited[H], points: tuple[OperatingShare, ...], margin: float) -> Limited[H]:
    """Step the natural frequency to where the allowed power is largest, halving the step."""
    low, high = start.harvester.frequency_range_hz
    damping = start.harvester.damping_ratio
    best = _with_allowed_load(start.harvester, points, margin, ZOOMS)
    step = 0.5
    while step > LAST_STEP:
        middle = best.harvester.natural_frequency_hz
        beside = [
            _with_allowed_load(start.harvester.retuned(float(f)), points, margin, ZOOMS)
            for f in np.clip(middle * np.exp(damping * step * np.array([-1.0, 1.0])), low, high)
        ]
        better = max(beside, key=lambda f: f.power_w)
        if better.power_w > best.power_w * (1 + 1e-6):
            best = better
        else:
            step /= 2
    return best


def _with_allowed_load(
    harvester: H, points: tuple[OperatingShare, ...], margin: float, zooms: int
) -> Limited[H]:
    """Choose the load that takes most among those that keep the limits."""
    least, most = harvester.load_range
    exponent = np.linspace(math.log(least), math.log(most), LOADS)
    best: tuple[float, float, float] = (-1.0, math.inf, math.sqrt(least * most))
    for _ in range(zooms + 1):
        loads = np.exp(exponent)
        power, travel, stress = peaks_by_load(harvester, loads, points)
        share = margin * np.maximum(
            travel / harvester.travel_limit_m, stress / harvester.stress_limit_pa
        )
        worth = np.where(share <= 1, power, -1.0)
        # without any that fits, go where the limits are least broken
        top = int(np.argmax(worth)) if worth.max() >= 0 else int(np.argmin(share))
        if (worth[top], -share[top]) > (best[0], -best[1]):
            best = float(worth[top]), float(share[top]), float(loads[top])
        near = exponent[max(top - 1, 0)], exponent[min(top + 1, len(exponent) - 1)]
        exponent = np.linspace(*near, ZOOMED)
    return Limited(harvester=harvester.with_load(best[2]), power_w=best[0], share=best[1])
