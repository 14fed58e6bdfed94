"""The natural frequency and load that yield most over a whole spectrum and duty cycle.

The full response, all modes and loads, is looked at over the whole range of natural frequencies;
the best places are refined by a bounded search, the load being found anew for every frequency.
Limits of travel and stress are held to the peaks of the recordings themselves: the search takes a
peak for the rms times a crest, which the recordings then correct until it is theirs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations_with_replacement
from typing import Any, Generic

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.harvesting.harvester import H, Harvester
from gearmon.harvesting.power import (
    LOADS,
    DutyLines,
    Tuned,
    best_load,
    by_load,
    evaluate,
    static_peaks,
)
from gearmon.harvesting.vibration import OperatingShare, Shaking, check_duty

Real = npt.NDArray[np.float64]
Points = tuple[OperatingShare, ...]

#: Step of the first look, in damping ratios, and the most natural frequencies looked at.
STEP, MOST_SCANNED = 0.7, 4000
#: Loud lines that are looked at as well, where the steps would have to be larger.
LOUDEST = 40
#: Bins are merged over these shares of a damping ratio, for the first look and for the search.
ROUGH_BINS, FINE_BINS = 0.5, 0.2
#: Places that are refined; one whose first look, this many times, is below the best is not.
PLACES, PRUNED_FROM = 6, 1.3
#: End of the search for the natural frequency, in damping ratios.
LAST_STEP = 0.02
#: Zooms on the load where limits bind, since the power is not flat there, and where they do not.
LIMITED_ZOOMS, FREE_ZOOMS = 4, 3
#: Corrections of the crest by the recordings, and the peak that they aim at.
CORRECTIONS, AIMED = 6, 0.995
#: Tunings that sets are made of: 180,000 sets of three.
MOST_KEPT = 100


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


def tune_harvester(harvester: H, duty: Shaking, *, limited: bool = True) -> Tuned[H]:
    """Tune natural frequency and load for the largest mean power over a duty cycle.

    Parameters
    ----------
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever
        What is to be tuned; of its natural frequency only the allowed range matters.
    duty : Vibration, Signature, OperatingShare or sequence of OperatingShare
        What shakes it: one vibration, the lines of a signature, or several with their shares of
        the time.
    limited : bool
        Whether limits of travel and stress are kept.

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
    points = check_duty(duty)
    free = _Search(harvester, points)
    tuned = replace(evaluate(free.best().harvester, points), rivals_hz=tuple(free.places_hz))
    if tuned.within_limits or not limited:
        return tuned
    crests = [point.vibration.crest for point in points]
    allowed, nearest = [], tuned
    for _ in range(CORRECTIONS):
        start = _Search(harvester, points, crests).best(free.first_look)
        tuned = evaluate(start.harvester, points)
        nearest = min(nearest, tuned, key=_over)
        if tuned.within_limits:
            allowed.append(tuned)
        wanted = _crests(tuned, points)
        if start.power_w <= 0 or np.allclose(wanted, crests, rtol=1 - AIMED):
            break
        crests = wanted
    if not allowed:
        raise OverLimitsError(*_refusal(nearest))
    return max(allowed, key=lambda t: t.power_w)


def tuned_among(harvester: H, duty: Shaking, places_hz: Sequence[float]) -> H:
    """Return the harvester tuned near one of a few natural frequencies, whatever its limits."""
    return _Search(harvester, check_duty(duty)).best(places_hz=places_hz).harvester


def power_against_tuning(harvester: H, duty: Shaking, frequency_hz: npt.ArrayLike) -> Real:
    """Mean power [W] of the harvester retuned to each frequency, its load as it is.

    Parameters
    ----------
    frequency_hz : array, shape (n,)
        Within the range that the harvester can reach.
    """
    points = _lightened(harvester, check_duty(duty), FINE_BINS)
    lines, load = DutyLines.over(points, harvester.damping_ratio), np.array([harvester.load])
    wanted = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return np.array([lines.power_w(harvester.retuned(float(f)), load)[0] for f in wanted])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Start(Generic[H]):
    """A harvester with its best load; power -1 where every load breaks a limit by `share`."""

    harvester: H
    power_w: float
    share: float = 0.0

    @property
    def rank(self) -> tuple[float, float]:
        return self.power_w, -self.share


class _Search(Generic[H]):
    """Look over all natural frequencies, and refine the best places."""

    def __init__(self, harvester: H, points: Points, crests: Sequence[float] | None = None) -> None:
        self.harvester, self.limited = harvester, crests is not None
        if crests is not None:
            points = tuple(
                replace(p, vibration=replace(p.vibration, crest=c))
                for p, c in zip(points, crests, strict=True)
            )
        self.rough, self.fine = (
            _lightened(harvester, points, width) for width in (ROUGH_BINS, FINE_BINS)
        )
        self.first_look: list[tuple[float, float]] = []
        self.places_hz: list[float] = []

    def best(
        self, known: Sequence[tuple[float, float]] = (), places_hz: Sequence[float] = ()
    ) -> _Start[H]:
        """Refine the best places of a first look, of a known one without limits, or given ones."""
        look = partial(self._start, points=self.rough, zooms=0)
        if self.limited:
            starts = self._within(look, known)
        elif places_hz:
            starts = [look(place) for place in sorted(places_hz)]
        else:
            starts = [look(float(f)) for f in _grid(self.harvester, self.rough)]
            self.first_look = [(s.power_w, s.harvester.natural_frequency_hz) for s in starts]
        found: list[_Start[H]] = []
        tops = sorted(starts, key=lambda s: s.rank)[::-1] if places_hz else _tops(starts)
        self.places_hz = [s.harvester.natural_frequency_hz for s in tops[:PLACES]]
        for start in tops[:PLACES]:
            if not found or PRUNED_FROM * start.power_w >= found[0].power_w:
                found.append(self._refined(start))
                found.sort(key=lambda s: s.rank, reverse=True)
        return found[0]

    def _within(self, look: Any, known: Sequence[tuple[float, float]]) -> list[_Start[H]]:
        """First look within limits; limits only take power away, which says when to stop."""
        starts: list[_Start[H]] = []
        best = 0.0
        for free, frequency in sorted(known, reverse=True):
            if starts and PRUNED_FROM * free < best:
                break
            starts.append(look(frequency))
            best = max(best, starts[-1].power_w)
        return sorted(starts, key=lambda s: s.harvester.natural_frequency_hz)

    def _start(self, frequency: float, points: Points, zooms: int) -> _Start[H]:
        low, high = self.harvester.frequency_range_hz
        tuned = self.harvester.retuned(min(max(frequency, low), high))
        if self.limited:
            worth = partial(_allowed, tuned, points)
            load, power = best_load(tuned, worth, zooms + 2)
            return _Start(
                harvester=tuned.with_load(load), power_w=max(power, -1.0), share=max(0.0, -power)
            )
        lines = DutyLines.over(points, tuned.damping_ratio)
        load, power = best_load(tuned, partial(lines.power_w, tuned), zooms)
        return _Start(harvester=tuned.with_load(load), power_w=power)

    def _refined(self, start: _Start[H]) -> _Start[H]:
        """Move the natural frequency to where the best load gives most."""
        from scipy.optimize import minimize_scalar

        middle, damping = start.harvester.natural_frequency_hz, start.harvester.damping_ratio
        seen: list[_Start[H]] = []

        def cost(offset: float) -> float:
            frequency = middle * math.exp(damping * offset)
            zooms = LIMITED_ZOOMS if self.limited else FREE_ZOOMS
            seen.append(self._start(frequency, self.fine, zooms))
            return -seen[-1].power_w if seen[-1].power_w >= 0 else seen[-1].share

        for reach in ((-1.2, 0.1), (-0.1, 1.2)):
            minimize_scalar(cost, bounds=reach, method="bounded", options={"xatol": LAST_STEP})
        cost(0.0)
        return max(seen, key=lambda s: s.rank)


def _allowed(harvester: Harvester, points: Points, loads: Real) -> Real:
    """Mean power of loads that keep the limits, less than -1 by how far the others break them."""
    power, share = _powers_and_shares(harvester, points, loads)
    total = np.array([point.share for point in points]) @ power
    return np.where(share <= 1, total, -share)


def _powers_and_shares(harvester: Harvester, points: Points, loads: Real) -> tuple[Real, Real]:
    """Power of each point, shape (points, loads), and the largest peak over its limit, (loads,)."""
    travel, stress = static_peaks(harvester)
    limits = harvester.clearance_m, harvester.stress_limit_pa, harvester.stress_limit_pa
    static = np.array([travel, stress, stress])[:, None]
    powers, shares = [], []
    for point in points:
        power, peaks = by_load(harvester, loads, point.vibration)
        powers.append(power)
        shares.append(((peaks[1:] + static) / np.array(limits)[:, None]).max(axis=0))
    return np.array(powers), np.max(shares, axis=0)


def _crests(tuned: Tuned[Any], points: Points) -> list[float]:
    """Crests with which the search would have had the peaks of the recordings."""
    loads = np.array([tuned.harvester.load])
    found = []
    for point, answer in zip(points, tuned.answers, strict=True):
        if answer.response is None:
            found.append(point.vibration.crest)
            continue
        (light,) = _lightened(tuned.harvester, (point,), FINE_BINS)
        _, peaks = by_load(tuned.harvester, loads, light.vibration)
        ratios = answer.response.peaks[1:] / np.maximum(peaks[1:, 0], np.finfo(float).tiny)
        limits = np.array([tuned.harvester.clearance_m, *2 * [tuned.harvester.stress_limit_pa]])
        # that of the peak which is nearest to its limit
        binding = int(np.argmax(answer.response.peaks[1:] / limits))
        found.append(light.vibration.crest * float(ratios[binding]) / AIMED)
    return found


def _over(tuned: Tuned[Any]) -> float:
    return max(tuned.travel_share, tuned.stress_share)


def _refusal(nearest: Tuned[Any]) -> tuple[str, float]:
    """Name the nearest tuning, and how far it is over its limit."""
    harvester, over = nearest.harvester, _over(nearest)
    if nearest.travel_share >= nearest.stress_share:
        limit = 1e3 * harvester.clearance_m
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


def _lightened(harvester: Harvester, points: Points, bins: float) -> Points:
    """Merge bins within a share of a resonance, and drop what no tuning can use."""
    low, high = harvester.frequency_range_hz
    kept = []
    for point in points:
        # far below its range a harvester only follows; its third mode lies 30 times above the first
        vibration = point.vibration.cut(low / 4, high * 40)
        if vibration.resolution_hz > 0:
            vibration = vibration.merged(harvester.damping_ratio * bins)
        kept.append(replace(point, vibration=vibration))
    return tuple(kept)


def _grid(harvester: Harvester, points: Points) -> Real:
    """Natural frequencies of the first look: even steps, and the loudest lines."""
    low, high = harvester.frequency_range_hz
    count = math.ceil(math.log(high / low) / (STEP * harvester.damping_ratio)) + 2
    even = np.geomspace(low, high, min(count, MOST_SCANNED))
    loudest = [
        p.vibration.frequency_hz[np.argsort(-p.vibration.energy_j_per_kg)[:LOUDEST]] for p in points
    ]
    lines = np.concatenate(loudest)
    # an open circuit may raise the natural frequency to a line
    middle = harvester.retuned(math.sqrt(low * high))
    raised = getattr(middle, "open_circuit_hz", middle.natural_frequency_hz)
    softer = lines * (middle.natural_frequency_hz / raised)
    return np.unique(np.clip(np.concatenate([even, lines, softer]), low, high))


def _tops(starts: Sequence[_Start[H]]) -> list[_Start[H]]:
    """Return starts that are no worse than their neighbours in frequency, the best first."""
    ranks = [(-math.inf, 0.0), *(s.rank for s in starts), (-math.inf, 0.0)]
    tops = [s for i, s in enumerate(starts) if ranks[i] <= ranks[i + 1] >= ranks[i + 2]]
    return sorted(tops, key=lambda s: s.rank, reverse=True)


def tune_set(harvester: H, duty: Shaking, count: int = 3) -> list[Tuned[H]]:
    """Best set of harvesters of one kind for the worst operating point, each with its own tuning.

    Found among tunings on a grid that no other beats at every operating point, and refined
    together. Powers add, since a harvester of a few grams does not move a gearbox and each has its
    own rectifier. For the mean over the duty cycle, copies of the best single one cannot be beaten.

    Parameters
    ----------
    harvester, duty
        As for `tune_harvester`.
    count : int, 1 to 3
        Size of the set.

    Returns
    -------
    list of Tuned

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or as in `tune_harvester`.
    """
    if count not in (1, 2, 3):
        raise ArgumentError(f"count={count} must be 1, 2 or 3")
    points = check_duty(duty)
    best = tune_harvester(harvester, points)
    if len(points) == 1:
        return [best] * count
    light = tuple(
        replace(p, vibration=replace(p.vibration, crest=c))
        for p, c in zip(points, _crests(best, points), strict=True)
    )
    candidates, powers = _candidates(harvester, light, best)
    sets_of = np.array(list(combinations_with_replacement(range(len(powers)), count)))
    chosen = [candidates[i] for i in sets_of[powers[sets_of].sum(axis=1).min(axis=1).argmax()]]
    sets = [[best] * count, [evaluate(one, points) for one in _polished(chosen, light)]]

    def worst_w(group: list[Tuned[H]]) -> float:
        if not all(tuned.within_limits for tuned in group):
            return -1.0
        return min(sum(t.answers[k].power_w for t in group) for k in range(len(points)))

    return max(sets, key=worst_w)


def _candidates(harvester: H, points: Points, best: Tuned[H]) -> tuple[list[H], Real]:
    """Tunings within the limits that no other beats at every point, and their powers by point."""
    light = _lightened(harvester, points, ROUGH_BINS)
    found, powers = [best.harvester], [np.array([a.power_w for a in best.answers])]
    for frequency in _grid(harvester, light):
        tuned = harvester.retuned(float(frequency))
        loads = np.geomspace(*tuned.load_range, 2 * LOADS)
        power, share = _powers_and_shares(tuned, light, loads)
        for index in np.flatnonzero(share <= 1):
            found.append(tuned.with_load(float(loads[index])))
            powers.append(power[:, index])
    table = np.array(powers)
    kept: list[int] = []
    for i in np.argsort(-table.min(axis=1), kind="stable"):
        if not kept or not (table[kept] >= table[i]).all(axis=1).any():
            kept.append(int(i))
    # evenly through the trade-off between the first point and the others
    share_of_first = table[kept, 0] / table[kept].sum(axis=1)
    even = np.linspace(0, len(kept) - 1, min(MOST_KEPT, len(kept))).astype(int)
    chosen = {kept[0], *(kept[i] for i in np.argsort(share_of_first)[even])}
    return [found[i] for i in sorted(chosen)], table[sorted(chosen)]


def _polished(members: list[H], points: Points) -> list[H]:
    """Move all frequencies and loads together to where the worst point is best served."""
    from scipy.optimize import minimize

    light = _lightened(members[0], points, FINE_BINS)
    low, high = members[0].frequency_range_hz

    def moved(offsets: Real) -> list[H]:
        pairs = zip(members, offsets.reshape(-1, 2), strict=True)
        found = []
        for member, (shift, factor) in pairs:
            frequency = member.natural_frequency_hz * math.exp(member.damping_ratio * shift)
            tuned = member.retuned(min(max(frequency, low), high))
            load = np.clip(member.load * math.exp(factor), *tuned.load_range)
            found.append(tuned.with_load(float(load)))
        return found

    def cost(offsets: Real) -> float:
        together: Real = np.zeros(len(points))
        for member in moved(offsets):
            power, share = _powers_and_shares(member, light, np.array([member.load]))
            if share[0] > 1:
                return 0.0
            together = together + power[:, 0]
        return -float(together.min()) / scale

    scale = 1.0
    scale = max(-cost(np.zeros(2 * len(members))), 1e-300)
    found = minimize(
        cost,
        np.zeros(2 * len(members)),
        method="Nelder-Mead",
        options={"xatol": LAST_STEP, "fatol": 1e-5, "maxfev": 300 * len(members)},
    )
    return moved(found.x)
