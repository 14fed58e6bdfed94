"""The natural frequency and load that yield most over a whole spectrum and duty cycle.

A scan with a Lorentzian of the matched width over all lines names the places worth a closer look;
each is then refined in both variables with the full response of the harvester.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.harvesting.answer import Answer, OperatingShare, answer, check_duty
from gearmon.harvesting.gains import Harvester

Real = npt.NDArray[np.float64]
H = TypeVar("H", bound=Harvester)

#: Places that are refined.
PLACES = 6
#: A place is passed over if its estimate, this many times, does not reach the best found.
PRUNED_FROM = 2.0
#: Natural frequencies of the rough scan for higher modes.
BROADLY_SCANNED = 60
#: Natural frequencies tried where no resonance on a line keeps within the limits.
SCANNED = 200
#: Lines more than this many bins an eighth of a resonance apart are merged for the search.
MOST_LINES = 3000


@dataclass(frozen=True, kw_only=True, eq=False)
class Tuned(Generic[H]):
    """A harvester at its best.

    Attributes
    ----------
    harvester : Harvester
        Tuned, with its load.
    power_w : float
        Mean over the duty cycle [W].
    answers : tuple of Answer
        Of each operating point.
    travel_share, stress_share : float
        Largest peak over its limit; 0 where there is no limit.
    """

    harvester: H
    power_w: float
    answers: tuple[Answer, ...]
    travel_share: float
    stress_share: float

    @property
    def within_limits(self) -> bool:
        """Whether travel and stress stay within their limits."""
        return self.travel_share <= 1 + 1e-9 and self.stress_share <= 1 + 1e-9

    def to_dict(self) -> dict[str, Any]:
        """Return values in built-in types."""
        return {
            "harvester": self.harvester.to_dict(),
            "power_w": self.power_w,
            "power_by_operating_point_w": [a.power_w for a in self.answers],
            "travel_m": max(a.travel_m for a in self.answers),
            "stress_pa": max(a.stress_pa for a in self.answers),
            "voltage_v": max(a.voltage_v for a in self.answers),
            "travel_share": self.travel_share,
            "stress_share": self.stress_share,
        }


def evaluate(harvester: H, duty: Sequence[OperatingShare]) -> Tuned[H]:
    """Tell what a harvester yields over a duty cycle as it stands, and how near its limits."""
    points = check_duty(duty)
    answers = tuple(answer(harvester, point.vibration) for point in points)
    return Tuned(
        harvester=harvester,
        power_w=math.fsum(p.share * a.power_w for p, a in zip(points, answers, strict=True)),
        answers=answers,
        travel_share=max(a.travel_m for a in answers) / harvester.travel_limit_m,
        stress_share=max(a.stress_pa for a in answers) / harvester.stress_limit_pa,
    )


def tune_harvester(
    harvester: H, duty: Sequence[OperatingShare], *, places: int = PLACES
) -> Tuned[H]:
    """Tune natural frequency and load for the largest mean power over a duty cycle.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
        What is to be tuned; of its natural frequency only the allowed range matters.
    duty : sequence of OperatingShare
        Vibrations and their shares of time.
    places : int, 1 to 50
        Most promising frequencies that are looked at closely.

    Returns
    -------
    Tuned

    Raises
    ------
    ArgumentError
        If nothing vibrates within reach, or no tuning keeps travel and stress within their limits;
        the message names the nearest that does.
    """
    return candidates(harvester, duty, places=places)[0]


def candidates(
    harvester: H, duty: Sequence[OperatingShare], *, places: int = PLACES
) -> list[Tuned[H]]:
    """All closely looked-at tunings, the best first; same arguments and errors as above."""
    check_range("places", places, 1, 50)
    points = check_duty(duty)
    light = _lightened(harvester, points)
    tuned: list[Tuned[H]] = []
    starts = [(_broad_start(harvester, light), math.inf), *_starts(harvester, light, places)]
    for number, (start, worth) in enumerate(starts):
        # what a matched resonance could take here does not reach what was found elsewhere
        if number > 1 and any(t.within_limits and t.power_w > PRUNED_FROM * worth for t in tuned):
            continue
        tuned.append(evaluate(_refined(harvester, light, start), points))
    allowed = [t for t in tuned if t.within_limits] or _beside_the_lines(harvester, light, points)
    if not allowed:
        raise ArgumentError(_refusal(tuned))
    return sorted(allowed, key=lambda t: -t.power_w)


def tune_set(
    harvester: H,
    duty: Sequence[OperatingShare],
    count: int = 3,
    objective: str = "worst",
) -> list[Tuned[H]]:
    """Best set of harvesters of one kind, each with its own tuning and load.

    Powers add, since a harvester of a few grams does not move a gearbox and each has its own
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
    pool = _pool(harvester, points)
    powers = np.array([[a.power_w for a in tuned.answers] for tuned in pool])
    shares = np.array([point.share for point in points])
    weights = shares if objective == "mean" else None
    best = max(
        combinations_with_replacement(range(len(pool)), int(count)),
        key=lambda chosen: _worth(powers[list(chosen)].sum(axis=0), weights),
    )
    return [pool[i] for i in best]


def power_against_tuning(
    harvester: H, duty: Sequence[OperatingShare], frequency_hz: npt.ArrayLike
) -> Real:
    """Mean power [W] of the harvester retuned to each frequency, its load as it is.

    Parameters
    ----------
    frequency_hz : array, shape (n,)
        Within the range that the harvester can reach.
    """
    points = _lightened(harvester, check_duty(duty))
    wanted = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return np.array([_mean(harvester.retuned(float(f)), points) for f in wanted])


def _worth(powers: Real, weights: Real | None) -> float:
    """Mean over the duty cycle, or the worst of its points."""
    return float(powers.min() if weights is None else powers @ weights)


def _beside_the_lines(
    harvester: H, light: tuple[OperatingShare, ...], points: tuple[OperatingShare, ...]
) -> list[Tuned[H]]:
    """Scan for a tuning within the limits where every resonance on a line breaks them."""
    best: list[Tuned[H]] = []
    for frequency in np.geomspace(*harvester.frequency_range_hz, SCANNED):
        tuned = harvester.retuned(float(frequency))
        for load in np.geomspace(*tuned.load_range, 7):
            found = evaluate(tuned.with_load(float(load)), light)
            if found.within_limits and (not best or found.power_w > best[0].power_w):
                best = [found]
    final = [evaluate(found.harvester, points) for found in best]
    return [found for found in final if found.within_limits]


def _pool(harvester: H, points: tuple[OperatingShare, ...]) -> list[Tuned[H]]:
    """Tunings for the whole cycle and for each operating point by itself."""
    pool = candidates(harvester, points)
    for point in points:
        alone = [OperatingShare(vibration=point.vibration)]
        try:
            found = candidates(harvester, alone, places=3)
        except ArgumentError:
            continue
        pool += [t for t in (evaluate(f.harvester, points) for f in found) if t.within_limits]
    return pool


def _mean(harvester: Harvester, points: tuple[OperatingShare, ...]) -> float:
    return math.fsum(point.share * answer(harvester, point.vibration).power_w for point in points)


def _lightened(
    harvester: Harvester, points: tuple[OperatingShare, ...]
) -> tuple[OperatingShare, ...]:
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
            middle = np.where(power > 0, moment / np.where(power > 0, power, 1.0), 0.0)
            middle = np.where(power > 0, middle, v.frequency_hz[starts])
            v = type(v)(
                frequency_hz=middle,
                mean_square_m2s4=power,
                resolution_hz=v.resolution_hz,
                wander=v.wander,
                name=v.name,
            )
        kept.append(OperatingShare(vibration=v, share=point.share))
    return tuple(kept)


def _starts(
    harvester: Harvester, points: tuple[OperatingShare, ...], places: int
) -> list[tuple[float, float]]:
    """Local maxima of the power that a matched resonance would take: frequency [Hz] and power."""
    low, high = harvester.frequency_range_hz
    damping = harvester.damping_ratio
    count = min(20_000, max(2, math.ceil(2 * math.log(high / low) / damping)) + 1)
    grid = np.geomspace(low, high, count)
    near = [p.vibration.frequency_hz for p in points]
    loudest = [
        f[np.argsort(-p.vibration.energy_j_per_kg)[:100]] for f, p in zip(near, points, strict=True)
    ]
    lines = np.concatenate(loudest)
    grid = np.unique(np.concatenate([grid, lines[(lines >= low) & (lines <= high)]]))
    worth = np.zeros(len(grid))
    for point in points:
        worth += point.share * _matched(grid, point, damping)
    worth *= _bounds(harvester, grid)
    inside = np.concatenate([[-1.0], worth, [-1.0]])
    tops = np.flatnonzero((inside[1:-1] >= inside[:-2]) & (inside[1:-1] > inside[2:]))
    order = tops[np.argsort(-worth[tops], kind="stable")]
    return [(float(grid[i]), 2 * float(worth[i])) for i in order[:places]]


def _broad_start(harvester: Harvester, points: tuple[OperatingShare, ...]) -> float:
    """Best of a rough scan with the full response: higher modes and the ends of the range."""
    best, where = -1.0, 0.0
    for natural in np.geomspace(*harvester.frequency_range_hz, BROADLY_SCANNED):
        tuned = harvester.retuned(float(natural))
        low, high = tuned.load_range
        loads = np.geomspace(low, high, 9)[2:-2]
        power = np.zeros(len(loads))
        for point in points:
            v = point.vibration
            power += point.share * (tuned.power_by_load(loads, v.frequency_hz) @ v.mean_square_m2s4)
        if power.max() > best:
            best, where = float(power.max()), float(natural)
    return where


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


def _refined(harvester: H, points: tuple[OperatingShare, ...], start: float) -> H:
    """Largest power in natural frequency and load around one place, within the limits."""
    from scipy.optimize import minimize

    low, high = harvester.frequency_range_hz
    reach = 8 * harvester.damping_ratio + 2 * max(p.vibration.wander for p in points)
    lowest = max(low, start * (1 - reach - stiffening(harvester, start)))
    highest = min(high, start * (1 + reach))

    damping = harvester.damping_ratio

    def at(x: Real) -> H:
        # detuning counts in damping ratios, so that both variables matter alike
        frequency = min(max(start * math.exp(damping * x[0]), lowest), highest)
        tuned = harvester.retuned(frequency)
        least, most = tuned.load_range
        return tuned.with_load(min(max(math.exp(x[1]), least), most))

    best: tuple[float, Any] = (math.inf, None)
    for frequency, load in _first_guesses(harvester, points, start, (lowest, highest)):
        corner = np.array([math.log(frequency / start) / damping, math.log(load)])
        power = _allowed_power(at(corner), points)
        found = minimize(
            lambda x: -_allowed_power(at(x), points),
            corner,
            method="Nelder-Mead",
            options={
                "initial_simplex": corner + np.array([[0.0, 0.0], [-0.7, 0.2], [0.3, 0.7]]),
                "xatol": 0.02,
                "fatol": 1e-5 * power,
                "maxfev": 150,
            },
        )
        best = min(best, (float(found.fun), found.x), key=lambda pair: pair[0])
    return _within(at(best[1]), points)


def stiffening(harvester: Harvester, frequency: float) -> float:
    """How far an open circuit raises the natural frequency, relative; 0 without a circuit."""
    tuned = harvester.retuned(frequency)
    raised = getattr(tuned, "open_circuit_hz", tuned.natural_frequency_hz)
    return float(raised / tuned.natural_frequency_hz - 1)


def _first_guesses(
    harvester: Harvester,
    points: tuple[OperatingShare, ...],
    start: float,
    window: tuple[float, float],
) -> list[tuple[float, float]]:
    """Resonance and, where it lies well apart, antiresonance on the line, each with a good load."""
    stiffer = stiffening(harvester, start)
    places = [start]
    if stiffer > harvester.damping_ratio:
        places.append(max(window[0], start / (1 + stiffer)))
    guesses = []
    for place in places:
        tuned = harvester.retuned(min(max(place, window[0]), window[1]))
        loads = np.geomspace(*tuned.load_range, 9)[1:-1]
        powers = [_allowed_power(tuned.with_load(float(load)), points) for load in loads]
        guesses.append((tuned.natural_frequency_hz, float(loads[int(np.argmax(powers))])))
    return guesses


def _allowed_power(harvester: Harvester, points: tuple[OperatingShare, ...]) -> float:
    """Mean power, taken down steeply beyond the limits so that the best lies on or within them."""
    tuned = evaluate(harvester, points)
    over = max(1.0, tuned.travel_share, tuned.stress_share)
    return tuned.power_w / over**8


def _within(harvester: H, points: tuple[OperatingShare, ...]) -> H:
    """Move the load by the little that brings an answer at the limit within it."""
    for factor in np.geomspace(1, 1.5, 40):
        for load in (harvester.load * factor, harvester.load / factor):
            low, high = harvester.load_range
            if not low <= load <= high:
                continue
            moved = harvester.with_load(load)
            if evaluate(moved, points).within_limits:
                return moved
    return harvester


def _refusal(tuned: Sequence[Tuned[Any]]) -> str:
    nearest = min(tuned, key=lambda t: max(t.travel_share, t.stress_share))
    frequency = nearest.harvester.natural_frequency_hz
    limit = nearest.harvester.travel_limit_m
    if nearest.travel_share >= nearest.stress_share:
        travel = nearest.travel_share * limit
        return (
            f"no tuning keeps the mass within its clearance of {1e3 * limit:.3g} mm: the nearest, "
            f"{frequency:.4g} Hz, travels {1e3 * travel:.3g} mm; allow that, or a smaller mass"
        )
    stress = nearest.stress_share * nearest.harvester.stress_limit_pa
    return (
        f"no tuning keeps the stress within {nearest.harvester.stress_limit_pa / 1e6:.3g} MPa: the "
        f"nearest, {frequency:.4g} Hz, reaches {stress / 1e6:.3g} MPa; use a thicker or shorter "
        "beam, or a lighter tip mass"
    )
