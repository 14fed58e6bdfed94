"""The best set of up to three harvesters."""

from __future__ import annotations

import math
from itertools import combinations_with_replacement, product

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.harvesting.power import H, Harvester, Tuned, evaluate, peaks_by_load
from gearmon.harvesting.tuning import ABOUT, first_mode_starts, lightened, tune_harvester
from gearmon.harvesting.vibration import OperatingShare, Shaking, check_duty

Real = npt.NDArray[np.float64]

#: Loads of each natural frequency; natural frequencies, more of them where there are few lines.
LOADS = 24
FEWEST, MOST_FREQUENCIES, WORK = 200, 1500, 4e7
#: Tunings that sets are made of, sets that are tried together, and where the last steps end.
MOST_KEPT, TOGETHER, LAST_STEP = 250, 1_000_000, 0.01
#: Single ones that are refined.
SINGLES = 8


def tune_set(
    harvester: H,
    duty: Shaking,
    count: int = 3,
    objective: str = "worst",
) -> list[Tuned[H]]:
    """Best set of harvesters of one kind, each with its own tuning and load.

    Found among tunings on a grid that no other beats at every operating point, and refined by
    steps. Powers add, since a harvester of a few grams does not move a gearbox and each has its own
    rectifier. For the mean over the duty cycle, copies of the best single one cannot be beaten; for
    the worst operating point, different tunings share the work.

    Parameters
    ----------
    harvester, duty
        As for `tune_harvester`.
    count : int, 1 to 3
        Size of the set.
    objective : {"worst", "mean"}
        Power of the worst operating point, or the mean over the cycle.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or as in `tune_harvester`.
    """
    check_range("count", count, 1, 3)
    if objective not in ("worst", "mean"):
        raise ArgumentError(f"objective={objective!r} must be worst or mean")
    points = check_duty(duty)
    best = tune_harvester(harvester, points)
    if objective == "mean":
        return [best] * int(count)
    light = lightened(harvester, points)
    natural, loads, powers = _candidates(harvester, light, best)
    if count == 1:
        sets = _apart(natural, powers.min(axis=1), harvester.damping_ratio)
    else:
        sets = [_best_set(powers, int(count))]
    polished = [
        _polished(
            [harvester.retuned(float(natural[i])).with_load(float(loads[i])) for i in chosen], light
        )
        for chosen in sets
    ]
    found = [[evaluate(member, points) for member in members] for members in polished]

    def worst_w(group: list[Tuned[H]]) -> float:
        return min(
            math.fsum(tuned.answers[k].power_w for tuned in group) for k in range(len(points))
        )

    return max(found, key=worst_w)


def _apart(natural: Real, worst: Real, damping_ratio: float) -> list[list[int]]:
    """Best single ones that lie at different places, since each may have a higher top beside it."""
    chosen: list[int] = []
    for i in np.argsort(-worst, kind="stable"):
        if all(abs(math.log(natural[i] / natural[c])) > damping_ratio for c in chosen):
            chosen.append(int(i))
        if len(chosen) == SINGLES:
            break
    return [[i] for i in chosen]


def _candidates(
    harvester: H, points: tuple[OperatingShare, ...], best: Tuned[H]
) -> tuple[Real, Real, Real]:
    """Tunings within the limits that no other beats everywhere: frequency, load, power by point."""
    low, high = harvester.frequency_range_hz
    lines = sum(p.vibration.nodes(harvester.damping_ratio)[0].size for p in points)
    count = int(np.clip(WORK / (LOADS * lines), FEWEST, MOST_FREQUENCIES))
    centres = [best.harvester.natural_frequency_hz]
    for point in points:
        centres += first_mode_starts(harvester, (point,), 6)
    about = np.outer(centres, 1 + harvester.damping_ratio * ABOUT).ravel()
    grid = np.unique(np.clip(np.concatenate([np.geomspace(low, high, count), about]), low, high))
    natural, loads, powers = [], [], []
    for frequency in grid:
        tuned = harvester.retuned(float(frequency))
        tried = np.geomspace(*tuned.load_range, LOADS)
        power, fits = _by_point(tuned, tried, points)
        natural.append(np.full(int(fits.sum()), frequency))
        loads.append(tried[fits])
        powers.append(power[fits])
    natural.append(np.array([best.harvester.natural_frequency_hz]))
    loads.append(np.array([best.harvester.load]))
    powers.append(np.array([[a.power_w for a in best.answers]]))
    found = np.concatenate(powers)
    kept = _unbeaten(found)
    return np.concatenate(natural)[kept], np.concatenate(loads)[kept], found[kept]


def _by_point(
    harvester: Harvester, loads: Real, points: tuple[OperatingShare, ...]
) -> tuple[Real, npt.NDArray[np.bool_]]:
    """Power at each operating point, shape (loads, points), and which loads keep the limits."""
    power, travel, stress = peaks_by_load(harvester, loads, points)
    fits = (travel <= harvester.travel_limit_m) & (stress <= harvester.stress_limit_pa)
    return power.T, np.asarray(fits.all(axis=0))


def _unbeaten(powers: Real) -> npt.NDArray[np.intp]:
    """Rows that no other row beats in every column, at most as many as pairs can be made of."""
    order = np.argsort(-powers.min(axis=1), kind="stable")
    kept: list[int] = []
    for i in order:
        if not kept or not (powers[kept] >= powers[i]).all(axis=1).any():
            kept.append(int(i))
    if len(kept) > MOST_KEPT:
        # evenly through the trade-off between the first point and the others
        share = powers[kept, 0] / powers[kept].sum(axis=1)
        even = np.argsort(share)[np.linspace(0, len(kept) - 1, MOST_KEPT).astype(int)]
        kept = [kept[0], *(kept[i] for i in even)]
    return np.array(kept)


def _best_set(powers: Real, count: int) -> list[int]:
    """Rows whose sum is largest in its smallest column."""
    pairs = np.array(list(combinations_with_replacement(range(len(powers)), 2)))
    together = powers[pairs[:, 0]] + powers[pairs[:, 1]]
    if count == 2:
        return [int(i) for i in pairs[together.min(axis=1).argmax()]]
    best: tuple[float, list[int]] = (-1.0, [])
    for part in np.array_split(np.arange(len(pairs)), 1 + len(pairs) * len(powers) // TOGETHER):
        worst = (together[part, None] + powers).min(axis=2)
        pair, third = np.unravel_index(int(worst.argmax()), worst.shape)
        chosen = [*(int(i) for i in pairs[part[pair]]), int(third)]
        best = max(best, (float(worst[pair, third]), chosen))
    return best[1]


def _polished(members: list[H], points: tuple[OperatingShare, ...]) -> list[H]:
    """Step frequencies and loads to where the worst point is best served, halving the steps."""
    powers = [_powers(member, points) for member in members]
    step = 0.5
    while step > LAST_STEP:
        moved = False
        for place, member in enumerate(members):
            others = sum(powers) - powers[place]
            for other in _steps(member, step):
                found = _powers(other, points)
                if (others + found).min() > (others + powers[place]).min() * (1 + 1e-6):
                    members[place], powers[place], moved = other, found, True
        if not moved:
            step /= 2
    return members


def _steps(member: H, step: float) -> list[H]:
    """Step in frequency, in load and in both: the best often lies on a ridge across the two."""
    low, high = member.frequency_range_hz
    least, most = member.load_range
    found = []
    for shift, factor in product((-1, 0, 1), (-1, -0.3, 0, 0.3, 1)):
        frequency = member.natural_frequency_hz * math.exp(member.damping_ratio * step * shift)
        load = member.load * math.exp(step * factor)
        tuned = member.retuned(min(max(frequency, low), high)) if shift else member
        found.append(tuned.with_load(min(max(load, least), most)))
    return found


def _powers(member: Harvester, points: tuple[OperatingShare, ...]) -> Real:
    """Power at each operating point; nothing where a limit is broken."""
    power, fits = _by_point(member, np.array([member.load]), points)
    return np.asarray(power[0] if fits[0] else np.full(len(points), -1.0))
