"""The natural frequency and load that yield most over a whole spectrum and duty cycle.

A Lorentzian of the matched width passed over all lines names the places worth a closer look for the
first mode; a rough scan with the full response, and the lines that a higher mode can be brought
onto, name the others. They are refined with the full response; the load is found for every
frequency from the answers to many loads at once, so that only the frequency is searched. Where the
best breaks a limit of travel or stress, the best place may be one beside a line, so that the whole
range is scanned: the power without limits, which is cheap and never less, says in which order and
when to stop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.harvesting.power import (
    DutyLines,
    H,
    Harvester,
    Start,
    Tuned,
    evaluate,
    peaks_by_load,
    with_best_load,
)
from gearmon.harvesting.vibration import OperatingShare, Shaking, check_duty

Real = npt.NDArray[np.float64]
Points = tuple[OperatingShare, ...]

#: Places that are refined.
PLACES = 6
#: A place is passed over if its power with the best load, this many times, is below the best.
PRUNED_FROM = 1.6
#: What peaks are multiplied by, in turn, since the search merges bins that the answer does not.
MARGINS = (1.0, 1.01, 1.05)
#: Natural frequencies of the rough scan for higher modes.
BROADLY_SCANNED = 60
#: Loud lines that a higher mode is brought onto.
LINES_FOR_HIGHER_MODES = 12
#: Lines more than this many bins an eighth of a resonance apart are merged for the search.
MOST_LINES = 3000
#: Natural frequencies about a place, in damping ratios from it.
OFFSETS = (-2.4, -1.2, -0.6, 0.6, 1.2)
#: Step at which the search for the natural frequency ends, in damping ratios.
LAST_STEP = 0.05
#: Natural frequencies tried over the whole range.
SCANNED = 200
#: Natural frequencies about a promising place, in damping ratios from it.
ABOUT = np.concatenate([-np.geomspace(12, 0.2, 12), [0.0], np.geomspace(0.2, 12, 12)])
#: Loads over the whole range where limits bind, and again between the neighbours of the best.
LOADS, ZOOMED = 25, 9
ZOOMS = 4
#: Frequencies that are refined within limits, and the step at which that ends [damping ratios].
REFINED, LAST_LIMITED_STEP = 3, 0.005


class OverLimitsError(ArgumentError):
    """No tuning keeps within the limits of travel and stress.

    Attributes
    ----------
    over : float, > 1
        Peak over limit of the nearest: with that much less vibration it would hold.
    """

    def __init__(self, message: str, over: float) -> None:
        super().__init__(message)
        self.over = over


def tune_harvester(harvester: H, duty: Shaking, *, places: int = PLACES) -> Tuned[H]:
    """Tune natural frequency and load for the largest mean power over a duty cycle.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
        What is to be tuned; of its natural frequency only the allowed range matters.
    duty : Vibration, Signature, OperatingShare or sequence of OperatingShare
        What shakes it: one vibration, the lines of a signature, or several with their shares of
        the time.
    places : int, 1 to 50
        Most promising frequencies that are looked at closely.

    Returns
    -------
    Tuned
        The tuned harvester with its load, mean power [W], and its peaks over their limits.

    Raises
    ------
    ArgumentError
        If nothing vibrates within reach, or no tuning keeps travel and stress within their limits;
        the message names the nearest that does.

    Examples
    --------
    >>> from gearmon.harvesting import InertialHarvester, vibration_of_lines
    >>> shaking = vibration_of_lines([120.0, 312.0], acceleration_ms2=[0.2, 0.8])
    >>> found = tune_harvester(InertialHarvester(mass_kg=5e-3, natural_frequency_hz=100.0), shaking)
    >>> round(found.harvester.natural_frequency_hz), round(1e6 * found.power_w)
    (312, 10)
    """
    return candidates(harvester, duty, places=places)[0]


def candidates(harvester: H, duty: Shaking, *, places: int = PLACES) -> list[Tuned[H]]:
    """All closely looked-at tunings, the best first; same arguments and errors as above."""
    check_range("places", places, 1, 50)
    points = check_duty(duty)
    light = lightened(harvester, points)
    lines = DutyLines.over(light, harvester.damping_ratio)
    free = _free(harvester, light, lines, int(places))
    tuned = [evaluate(start.harvester, points) for start in free]
    allowed = [t for t in tuned if t.within_limits]
    # limits only take power away
    if not tuned[0].within_limits:
        for margin in MARGINS:
            limited = _largest_allowed(harvester, light, lines, free, margin)
            found = [evaluate(one.harvester, points) for one in limited]
            tuned += found
            allowed += [t for t in found if t.within_limits]
            if any(t.within_limits for t in found):
                break
    if not allowed:
        raise OverLimitsError(*_refusal(tuned))
    return sorted(allowed, key=lambda t: -t.power_w)


def power_against_tuning(harvester: H, duty: Shaking, frequency_hz: npt.ArrayLike) -> Real:
    """Mean power [W] of the harvester retuned to each frequency, its load as it is.

    Parameters
    ----------
    frequency_hz : array, shape (n,)
        Within the range that the harvester can reach.
    """
    points = lightened(harvester, check_duty(duty))
    wanted = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return np.array([evaluate(harvester.retuned(float(f)), points).power_w for f in wanted])


def _free(harvester: H, light: Points, lines: DutyLines, places: int) -> list[Start[H]]:
    """Refine the promising places without regard to limits, the best first."""
    frequencies = [*first_mode_starts(harvester, light, places), *_other_starts(harvester, light)]
    begun = sorted((_begun(harvester, lines, f) for f in frequencies), key=lambda s: -s.power_w)
    found: list[Start[H]] = []
    for start in begun[: places + 1]:
        best = max((f.power_w for f in found), default=0.0)
        if PRUNED_FROM * start.power_w >= best or len(found) < 2:
            found.append(_refined(start, lines))
    return sorted(found, key=lambda s: -s.power_w)


def _refusal(tuned: Sequence[Tuned[Any]]) -> tuple[str, float]:
    """Name the nearest tuning, and how far it is over its limit."""
    nearest = min(tuned, key=lambda t: max(t.travel_share, t.stress_share))
    harvester = nearest.harvester
    over = max(nearest.travel_share, nearest.stress_share)
    if nearest.travel_share >= nearest.stress_share:
        limit = 1e3 * harvester.travel_limit_m
        return (
            f"no tuning keeps the mass within its clearance of {limit:.3g} mm: the nearest, "
            f"{harvester.natural_frequency_hz:.4g} Hz, travels {over * limit:.3g} mm; allow that, "
            "or a smaller mass",
            over,
        )
    limit = harvester.stress_limit_pa / 1e6
    return (
        f"no tuning keeps the stress within {limit:.3g} MPa: the nearest, "
        f"{harvester.natural_frequency_hz:.4g} Hz, reaches {over * limit:.3g} MPa; use a thicker "
        "or shorter beam, or a lighter tip mass",
        over,
    )


def lightened(harvester: Harvester, points: Points) -> Points:
    """Merge bins that lie within an eighth of a resonance, and drop what no tuning can use."""
    low, high = harvester.frequency_range_hz
    width = harvester.damping_ratio / 8
    kept = []
    for point in points:
        # far below its range a harvester only follows; its third mode lies 30 times above the first
        v = point.vibration.cut(low / 4, high * 40)
        if len(v.frequency_hz) > MOST_LINES:
            group = np.floor(np.log(v.frequency_hz) / width).astype(np.int64)
            starts = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
            power = np.add.reduceat(v.mean_square_m2s4, starts)
            moment = np.add.reduceat(v.mean_square_m2s4 * v.frequency_hz, starts)
            # what is cut holds no bin without power
            v = replace(v, frequency_hz=moment / power, mean_square_m2s4=power)
        kept.append(replace(point, vibration=v))
    return tuple(kept)


def first_mode_starts(harvester: Harvester, points: Points, places: int) -> list[float]:
    """Local maxima of the power that a matched resonance would take [Hz], the best first."""
    low, high = harvester.frequency_range_hz
    damping = harvester.damping_ratio
    count = min(20_000, max(2, math.ceil(2 * math.log(high / low) / damping)) + 1)
    shaking = [p.vibration for p in points]
    loudest = [v.frequency_hz[np.argsort(-v.energy_j_per_kg)[:100]] for v in shaking]
    lines = np.concatenate(loudest)
    grid = np.geomspace(low, high, count)
    grid = np.unique(np.concatenate([grid, lines[(lines >= low) & (lines <= high)]]))
    worth = np.zeros(len(grid))
    for point in points:
        worth += point.share * _matched(grid, point, damping)
    worth *= _bounds(harvester, grid)
    inside = np.concatenate([[-1.0], worth, [-1.0]])
    tops = np.flatnonzero((worth >= inside[:-2]) & (worth > inside[2:]))
    order = tops[np.argsort(-worth[tops], kind="stable")]
    return [float(f) for f in grid[order[:places]]]


def _other_starts(harvester: Harvester, points: Points) -> list[float]:
    """Best of a rough scan with the full response, and higher modes on loud lines [Hz]."""
    scanned = np.geomspace(*harvester.frequency_range_hz, BROADLY_SCANNED)
    tuned = [harvester.retuned(float(natural)) for natural in scanned]
    power = []
    for candidate in tuned:
        loads = np.geomspace(*candidate.load_range, 9)[2:-2]
        found = np.zeros(len(loads))
        for point in points:
            v = point.vibration
            gains = candidate.power_by_load(loads, v.frequency_hz)
            found += point.share * (gains @ v.mean_square_m2s4)
        power.append(float(found.max()))
    resonances = np.array([candidate.resonances_hz for candidate in tuned])
    return [float(scanned[int(np.argmax(power))]), *_higher_modes(scanned, resonances, points)]


def _higher_modes(natural: Real, resonances: Real, points: Points) -> list[float]:
    """Natural frequencies for which a higher resonance meets one of the loudest lines there."""
    frequency = np.concatenate([p.vibration.frequency_hz for p in points])
    weight = np.concatenate([p.share * p.vibration.mean_square_m2s4 for p in points])
    found: list[float] = []
    for mode in resonances.T[1:]:
        within = np.flatnonzero((frequency >= mode[0]) & (frequency <= mode[-1]))
        loudest = within[np.argsort(-weight[within] / frequency[within])][:LINES_FOR_HIGHER_MODES]
        found += np.interp(frequency[loudest], mode, natural).tolist()
    return found


def _matched(grid: Real, point: OperatingShare, damping: float) -> Real:
    """Sum of the mean squares under a Lorentzian of twice the damping, widened by the wander."""
    v = point.vibration
    width = 2 * damping + 1.2 * v.wander
    height = 2 * damping / width
    found = np.zeros(len(grid))
    for part in np.array_split(
        np.arange(len(grid)), 1 + len(grid) * len(v.frequency_hz) // 4_000_000
    ):
        detuned = (v.frequency_hz / grid[part, None] - 1) / width
        found[part] = (height / (1 + detuned**2)) @ v.mean_square_m2s4
    return found


def _bounds(harvester: Harvester, grid: Real) -> Real:
    """Largest power by natural frequency, read off between a few tunings."""
    few = np.geomspace(grid[0], grid[-1], 12)
    few[0], few[-1] = grid[0], grid[-1]
    known = np.log([harvester.retuned(float(f)).power_bound_w() for f in few])
    return np.asarray(np.exp(np.interp(np.log(grid), np.log(few), known)))


def _begun(harvester: H, lines: DutyLines, frequency_hz: float) -> Start[H]:
    """Best of the resonance and, where it lies well apart, the antiresonance on a line."""
    low, high = harvester.frequency_range_hz
    stiffer = stiffening(harvester, frequency_hz)
    places = [frequency_hz]
    if stiffer > harvester.damping_ratio:
        places.append(frequency_hz / (1 + stiffer))
    tried = [
        with_best_load(harvester.retuned(min(max(place, low), high)), lines) for place in places
    ]
    return max(tried, key=lambda start: start.power_w)


def _refined(start: Start[H], lines: DutyLines) -> Start[H]:
    """Move the natural frequency to where the power with the best load is largest nearby."""
    low, high = start.harvester.frequency_range_hz
    damping = start.harvester.damping_ratio
    middle = start.harvester.natural_frequency_hz

    def at(offset: float) -> Start[H]:
        frequency = min(max(middle * math.exp(damping * offset), low), high)
        return with_best_load(start.harvester.retuned(frequency), lines)

    tried = {0.0: start} | {offset: at(offset) for offset in OFFSETS}
    step = 0.6
    while step > LAST_STEP:
        best = max(tried, key=lambda offset: tried[offset].power_w)
        if best in (min(tried), max(tried)):
            step = 1.2
        else:
            step /= 2
        for offset in (best - step, best + step):
            if offset not in tried:
                tried[offset] = at(offset)
        if len(tried) > 40:
            break
    return max(tried.values(), key=lambda found: found.power_w)


def stiffening(harvester: Harvester, frequency_hz: float) -> float:
    """How far an open circuit raises the natural frequency, relative; 0 without a circuit."""
    low, high = harvester.frequency_range_hz
    tuned = harvester.retuned(min(max(frequency_hz, low), high))
    raised = getattr(tuned, "open_circuit_hz", tuned.natural_frequency_hz)
    return float(raised / tuned.natural_frequency_hz - 1)


def _largest_allowed(
    harvester: H,
    points: Points,
    lines: DutyLines,
    places: list[Start[H]],
    margin: float = 1.0,
) -> list[Start[H]]:
    """Up to three best tunings within the limits, the best first.

    Where none keeps them, the one that comes nearest. Peaks are multiplied by `margin`.
    """
    free = [with_best_load(harvester.retuned(float(f)), lines) for f in _grid(harvester, places)]
    free.sort(key=lambda start: -start.power_w)
    found: list[Start[H]] = []
    best = -1.0
    for start in free:
        if start.power_w <= best:
            break
        found.append(_with_allowed_load(start.harvester, points, margin, 0))
        best = max(best, found[-1].power_w)
    allowed = sorted((f for f in found if f.power_w >= 0), key=lambda f: -f.power_w)
    if not allowed:
        return [min(found, key=lambda f: f.share)]
    chosen = [_refined_within(one, points, margin) for one in _apart(allowed)]
    return sorted(chosen, key=lambda f: -f.power_w)


def _grid(harvester: H, places: list[Start[H]]) -> Real:
    low, high = harvester.frequency_range_hz
    about = [
        place.harvester.natural_frequency_hz * (1 + place.harvester.damping_ratio * ABOUT)
        for place in places
    ]
    grid = np.concatenate([np.geomspace(low, high, SCANNED), *about])
    return np.unique(np.clip(grid, low, high))


def _apart(allowed: list[Start[H]]) -> list[Start[H]]:
    """Best ones that lie more than a damping ratio from each other."""
    chosen: list[Start[H]] = []
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


def _refined_within(start: Start[H], points: Points, margin: float) -> Start[H]:
    """Step the natural frequency to where the allowed power is largest, halving the step."""
    low, high = start.harvester.frequency_range_hz
    damping = start.harvester.damping_ratio
    best = _with_allowed_load(start.harvester, points, margin, ZOOMS)
    step = 0.5
    while step > LAST_LIMITED_STEP:
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


def _with_allowed_load(harvester: H, points: Points, margin: float, zooms: int) -> Start[H]:
    """Choose the load that takes most among those that keep the limits."""
    least, most = harvester.load_range
    exponent = np.linspace(math.log(least), math.log(most), LOADS)
    shares = np.array([point.share for point in points])
    best: tuple[float, float, float] = (-1.0, math.inf, math.sqrt(least * most))
    for _ in range(zooms + 1):
        loads = np.exp(exponent)
        power, travel, stress = peaks_by_load(harvester, loads, points)
        over = np.maximum(travel / harvester.travel_limit_m, stress / harvester.stress_limit_pa)
        share = margin * over.max(axis=0)
        worth = np.where(share <= 1, shares @ power, -1.0)
        # without any that fits, go where the limits are least broken
        top = int(np.argmax(worth)) if worth.max() >= 0 else int(np.argmin(share))
        if (worth[top], -share[top]) > (best[0], -best[1]):
            best = float(worth[top]), float(share[top]), float(loads[top])
        near = exponent[max(top - 1, 0)], exponent[min(top + 1, len(exponent) - 1)]
        exponent = np.linspace(*near, ZOOMED)
    return Start(harvester=harvester.with_load(best[2]), power_w=best[0], share=best[1])
