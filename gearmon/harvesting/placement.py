"""Where a harvester should sit, from a machine or from recordings, and what it powers there.

Positions are ranked by the power of a harvester that is tuned for each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.harvesting.budget import SensorBudget
from gearmon.harvesting.harvester import Harvester
from gearmon.harvesting.power import (
    DutyLines,
    Tuned,
    bandwidth_against_quality,
    evaluate,
    half_power_band,
    response_grid,
    response_rows,
)
from gearmon.harvesting.recorded import (
    FEWEST_STRETCHES,
    Scatter,
    between,
    combined,
    interval_90,
    power_with_stops,
    scatter_of_mean,
)
from gearmon.harvesting.tuning import OverLimitsError, tune_harvester, tune_set, tuned_among
from gearmon.harvesting.vibration import (
    OperatingShare,
    Vibration,
    check_duty,
    line_numbers,
    operating_lines,
    vibration_of_samples,
    vibration_of_signature,
)
from gearmon.machine import Machine
from gearmon.result import Result
from gearmon.signals.recording import Recording
from gearmon.signatures.expected.baseline import expected_signature

#: A place is good only when the gear is damaged if, tuned for that, it loses more than this share
#: of its power when the gear is sound.
LOST_SHARE = 0.5
#: Stretches that a recording is cut into: tuned on all but one, judged on that.
FOLDS = 5
#: Recordings without shares of time are a sample of operation from so many on.
FEWEST_RECORDINGS = 5
#: Peak over limit from which a tuning is one that the limits chose.
BOUND = 0.9
#: Quality factors of the mechanics that the bandwidth is given for.
QUALITY_FACTORS = (10.0, 25.0, 50.0, 100.0, 200.0)


@dataclass(frozen=True, kw_only=True)
class Position:
    """A place and direction, and what shakes there.

    Parameters
    ----------
    name : str
    healthy : tuple of OperatingShare
        Duty cycle with sound gears.
    degraded : tuple of OperatingShare, optional
        The same with a damaged one.
    folds : tuple of tuples of OperatingShare, optional
        The healthy duty cycle in parts, on each of which a tuning from the others is judged.
    sampled : bool
        Whether the parts are blocks of operation, a sample of all there is, not stretches of
        operating points whose shares of time are known.
    share_error : float, 0 to 0.5
        Standard deviation of the shares of time.

    Raises
    ------
    ArgumentError
        If a duty cycle cannot be.
    """

    name: str
    healthy: tuple[OperatingShare, ...]
    degraded: tuple[OperatingShare, ...] = ()
    folds: tuple[tuple[OperatingShare, ...], ...] = ()
    sampled: bool = False
    share_error: float = 0.0

    def __post_init__(self) -> None:
        check_range("share_error", self.share_error, 0.0, 0.5)
        object.__setattr__(self, "healthy", check_duty(self.healthy))
        if self.degraded:
            object.__setattr__(self, "degraded", check_duty(self.degraded))


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """One position with its best harvester.

    Attributes
    ----------
    position : Position
    tuned : Tuned or None
        For sound gears; None where no tuning is possible, see `refusal`.
    supply : dict
        What the sensor gets of it, see `SensorBudget.supply`; empty where nothing.
    power_unseen_w : float
        Mean power on stretches that the tuning did not know; NaN without recordings.
    power_low_w, power_high_w : float
        90 % interval of the long-run mean power, from these stretches and what is not known of the
        shares of time; NaN where there are too few independent ones.
    stretches : float
        Independent stretches that the recordings hold; NaN without.
    line_share : float
        Share of the power that comes from lines which stand out of the noise.
    power_with_stops_w, stops_hz : float
        Where the clearance limits the tuning: mean power of the best one without that limit, its
        mass hitting the stops, and its natural frequency; else NaN.
    degraded_power_w : float
        Of the tuned harvester when the gear is damaged; NaN if unknown.
    tuned_degraded : Tuned or None
        Best for the damaged gear.
    healthy_power_of_degraded_w : float
        What that one gives while the gear is sound.
    refusal : str
        Why nothing can be had here, in one line.
    over_limits : float
        Where a limit of travel or stress is why: peak over limit of the nearest tuning; else NaN.
    """

    position: Position
    tuned: Tuned[Any] | None
    supply: dict[str, Any] = field(default_factory=dict)
    power_unseen_w: float = math.nan
    power_low_w: float = math.nan
    power_high_w: float = math.nan
    stretches: float = math.nan
    line_share: float = math.nan
    power_with_stops_w: float = math.nan
    stops_hz: float = math.nan
    degraded_power_w: float = math.nan
    tuned_degraded: Tuned[Any] | None = None
    healthy_power_of_degraded_w: float = math.nan
    refusal: str = ""
    over_limits: float = math.nan

    @property
    def power_w(self) -> float:
        """Mean power while the gear is sound [W]; 0 where no tuning is possible."""
        return self.tuned.power_w if self.tuned else 0.0

    @property
    def interval_s(self) -> float:
        """Between recordings [s]; infinite if there can be none."""
        found = self.supply.get("interval_s")
        return math.inf if found is None else float(found)

    @property
    def good_only_when_damaged(self) -> bool:
        """Whether its best tuning for the damaged gear is a poor one for the sound gear."""
        if self.tuned_degraded is None:
            return False
        least = (1 - LOST_SHARE) * self.tuned_degraded.power_w
        return max(self.healthy_power_of_degraded_w, self.power_w) < least

    def to_dict(self) -> dict[str, Any]:
        """Return the row in built-in types; what is unknown or infinite is null."""
        best, degraded = (
            {"hz": t.harvester.natural_frequency_hz, "w": t.power_w, "load": t.harvester.load}
            if t
            else dict.fromkeys(("hz", "w", "load"), math.nan)
            for t in (self.tuned, self.tuned_degraded)
        )
        names = ("power_w", "power_low_w", "power_high_w", "power_unseen_w", "line_share")
        others = ("power_with_stops_w", "stops_hz", "interval_s", "degraded_power_w")
        row = {
            "natural_frequency_hz": best["hz"],
            "load": best["load"],
            **{name: getattr(self, name) for name in (*names, *others)},
            "independent_stretches": self.stretches,
            "degraded_best_hz": degraded["hz"],
            "degraded_best_power_w": degraded["w"],
            "degraded_best_power_when_healthy_w": self.healthy_power_of_degraded_w,
        }
        known = {name: x if math.isfinite(x) else None for name, x in row.items()}
        told = {"good_only_when_damaged": self.good_only_when_damaged, "refusal": self.refusal}
        return {"position": self.position.name} | known | told


def rank_positions(
    harvester: Harvester, positions: Sequence[Position], budget: SensorBudget | None = None
) -> list[Placed]:
    """Rank positions by the mean power of a harvester that is tuned for each.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
    positions : sequence of Position
    budget : SensorBudget, optional
        What is to be powered; the default one if not given.

    Returns
    -------
    list of Placed
        The best first. Positions where nothing can be had stand last, with the reason.

    Raises
    ------
    ArgumentError
        If there is no position.
    """
    if not positions:
        raise ArgumentError("positions: none is given")
    task = budget or SensorBudget()
    return sorted((_placed(harvester, p, task) for p in positions), key=lambda p: -p.power_w)


def _placed(harvester: Harvester, position: Position, budget: SensorBudget) -> Placed:
    tuned, refusal, over = _tuned(harvester, position.healthy)
    found = Placed(position=position, tuned=tuned, refusal=refusal, over_limits=over)
    found = replace(found, **_beyond_stops(harvester, position, tuned))
    if tuned is not None:
        shares = [point.share for point in position.healthy]
        found = replace(
            found,
            supply=budget.supply(tuned, shares),
            line_share=_line_share(tuned.harvester, position.healthy),
            **_judged(harvester, tuned, position),
        )
    if not position.degraded:
        return found
    degraded = _tuned(harvester, position.degraded)[0]

    def power_w(of: Tuned[Any] | None, duty: tuple[OperatingShare, ...]) -> float:
        return evaluate(of.harvester, duty).power_w if of else math.nan

    return replace(
        found,
        tuned_degraded=degraded,
        degraded_power_w=power_w(tuned, position.degraded),
        healthy_power_of_degraded_w=power_w(degraded, position.healthy),
    )


def _tuned(
    harvester: Harvester, duty: tuple[OperatingShare, ...]
) -> tuple[Tuned[Any] | None, str, float]:
    try:
        return tune_harvester(harvester, duty), "", math.nan
    except OverLimitsError as error:
        return None, str(error), error.over
    except ArgumentError as error:
        return None, str(error), math.nan


def _limited(tuned: Tuned[Any] | None) -> bool:
    return tuned is None or max(tuned.travel_share, tuned.stress_share) > BOUND


def _beyond_stops(
    harvester: Harvester, position: Position, tuned: Tuned[Any] | None
) -> dict[str, Any]:
    """Tell what the best tuning gives whose mass hits its stops, if they are in the way."""
    points = [p for p in position.healthy if len(p.vibration.samples_ms2)]
    limit = harvester.clearance_m
    if not points or not _limited(tuned) or math.isinf(limit):
        return {}
    try:
        free = tune_harvester(harvester, position.healthy, limited=False)
    except ArgumentError:
        return {}
    if free.travel_share <= 1:
        return {}
    power = math.fsum(
        p.share
        * power_with_stops(free.harvester, p.vibration.samples_ms2, p.vibration.sampling_rate_hz)
        for p in points
    )
    return {"power_with_stops_w": power, "stops_hz": free.harvester.natural_frequency_hz}


def _line_share(harvester: Harvester, duty: tuple[OperatingShare, ...]) -> float:
    """Share of the power that lines give."""

    def power_w(points: list[OperatingShare]) -> float:
        lines = DutyLines.over(points, harvester.damping_ratio)
        return float(lines.power_w(harvester, np.array([harvester.load]))[0])

    clear = []
    for point in duty:
        number = line_numbers(point.vibration)
        if number.any():
            clear.append(replace(point, vibration=point.vibration.only(number > 0)))
    whole = power_w(list(duty))
    return power_w(clear) / whole if clear and whole > 0 else 0.0


def _judged(harvester: Harvester, tuned: Tuned[Any], position: Position) -> dict[str, Any]:
    """Judge on every part what the others would have chosen, and how well the mean is known."""
    if len(position.folds) < 2:
        return {}
    judged = []
    try:
        for number, part in enumerate(position.folds):
            others = position.folds[:number] + position.folds[number + 1 :]
            duty = tuple(
                replace(point, share=point.share / len(others)) for o in others for point in o
            )
            # where the limits chose the tuning, the noise did not
            one = (
                tuned.harvester
                if _limited(tuned)
                else tuned_among(harvester, duty, tuned.rivals_hz)
            )
            judged.append(evaluate(one, part))
    except ArgumentError:
        # a part shorter than the ring-down tells nothing
        return {"stretches": 0.0}
    found = _scatter(judged, position)
    fewest = FEWEST_RECORDINGS if position.sampled else FEWEST_STRETCHES
    low, high = interval_90(found) if found.stretches >= fewest else (math.nan, math.nan)
    return {
        "power_unseen_w": found.mean,
        "power_low_w": low,
        "power_high_w": high,
        "stretches": found.stretches,
    }


def _scatter(judged: Sequence[Tuned[Any]], position: Position) -> Scatter:
    if position.sampled:
        return between([tuned.power_w for tuned in judged])
    parts = []
    for number in range(len(position.healthy)):
        steps = [tuned.answers[number].response for tuned in judged]
        parts.append(scatter_of_mean(np.concatenate([s.power_steps_w for s in steps if s])))
    shares = [point.share for point in position.healthy]
    return combined(parts, shares, position.share_error)


@dataclass(frozen=True, kw_only=True, eq=False)
class Survey(Result):
    """Ranked positions of one machine.

    Attributes
    ----------
    machine : str
    origin : {"expected", "measured"}
    placed : tuple of Placed
        The best first.
    budget : SensorBudget
    notes : tuple of str
        What was assumed, in sentences.
    together : tuple of Tuned
        Best set of several harvesters at the best position, for the worst operating point; empty
        if only one was asked for.
    """

    picture = "harvest_plots.harvest_figures"

    machine: str
    origin: str
    placed: tuple[Placed, ...]
    budget: SensorBudget
    notes: tuple[str, ...] = ()
    together: tuple[Tuned[Any], ...] = ()

    @property
    def best(self) -> Placed:
        """The first position."""
        return self.placed[0]

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each position, the best first."""
        return [place.to_dict() for place in self.placed]

    def lines(self) -> list[dict[str, Any]]:
        """Return the most energetic lines at the best position, by operating point."""
        return [
            {"operating_point": point.vibration.name, "share_of_time": point.share} | row
            for point in self.best.position.healthy
            for row in operating_lines(point.vibration)
        ]

    def response(self) -> list[dict[str, Any]]:
        """Return power, voltage, travel and stress of the best harvester against frequency."""
        tuned = self.best.tuned
        if tuned is None:
            return []
        return response_rows(tuned.harvester, response_grid(tuned.harvester))

    def bandwidths(self) -> list[dict[str, float]]:
        """Return bandwidth and power of the best harvester against its quality factor."""
        tuned = self.best.tuned
        if tuned is None:
            return []
        return bandwidth_against_quality(tuned.harvester, QUALITY_FACTORS, self.wander)

    @property
    def wander(self) -> float:
        """Standard deviation of the line that gives most, over its frequency, at its widest."""
        tuned = self.best.tuned
        points = self.best.position.healthy
        return max(wander_of(p.vibration, tuned.harvester if tuned else None) for p in points)

    def to_dict(self) -> dict[str, Any]:
        """Return everything in built-in types that JSON can hold."""
        best = self.best
        return {
            "machine": self.machine,
            "origin": self.origin,
            "positions": self.rows(),
            "best": _described(best.tuned, best.position.healthy),
            "best_when_damaged": _described(best.tuned_degraded, best.position.degraded),
            "set": [tuned.to_dict() for tuned in self.together],
            "response": self.response(),
            "bandwidth_against_quality": self.bandwidths(),
            "energy_lines": self.lines(),
            "budget": self.budget.to_dict(),
            "notes": list(self.notes),
        }


def _described(tuned: Tuned[Any] | None, duty: Sequence[OperatingShare]) -> dict[str, Any] | None:
    """Return a tuning with its operating points and its band; null if there is none."""
    if tuned is None:
        return None
    return tuned.to_dict() | {
        "operating_points": [point.vibration.name for point in duty],
        "half_power_band": _band(tuned.harvester),
    }


def _band(harvester: Harvester) -> dict[str, float] | None:
    try:
        return half_power_band(harvester).to_dict()
    except ArgumentError:
        # so heavily loaded that there is none
        return None


def wander_of(vibration: Vibration, harvester: Harvester | None) -> float:
    """Return the relative standard deviation of the line that a harvester takes most from.

    That of the mean squares over the bins that belong to it; what the model says of given lines.
    """
    if vibration.resolution_hz == 0 or harvester is None:
        return vibration.wander
    number = line_numbers(vibration)
    if not number.any():
        return 0.0
    frequency, power = vibration.frequency_hz, vibration.mean_square_m2s4
    taken = np.bincount(number, power * harvester.gains(frequency).power_w)
    own = number == 1 + int(np.argmax(taken[1:]))
    frequency, power = frequency[own], power[own]
    mean = np.average(frequency, weights=power)
    variance = np.average((frequency - mean) ** 2, weights=power)
    # less what the tapers spread a line that does not wander
    spread = vibration.resolution_hz**2 / 3
    return float(min(0.2, math.sqrt(max(0.0, variance - spread)) / mean))


def survey_expected(
    machine: Machine,
    harvester: Harvester,
    budget: SensorBudget | None = None,
    *,
    faults: Iterable[str] = (),
    path_gain: float = 1.0,
    wander: float = 0.005,
    wander_time_s: float = math.inf,
    count: int = 1,
) -> Survey:
    """Tune a harvester for the lines that the gear data lead to expect.

    Parameters
    ----------
    machine : Machine
        With what a baseline needs; its operating points are the duty cycle.
    harvester : InertialHarvester or PiezoCantilever
    budget : SensorBudget, optional
    faults : iterable of str
        Damage for the degraded state, such as "crack:1:pinion:5:20%".
    path_gain : float, > 0
        Ratio of the acceleration at the harvester over that along the line of action.
    wander : float, 0 to 0.2
        Standard deviation of the speed over its mean.
    wander_time_s : float, > 0
        Correlation time of that; infinite if slow beside the ring-down.
    count : int, 1 to 3
        Harvesters of a set that serve the worst operating point, see `tune_set`.

    Returns
    -------
    Survey

    Raises
    ------
    ArgumentError
        If the machine lacks data, or nothing can be tuned (with the reason).
    """
    check_positive("path_gain", path_gain)
    damage = tuple(faults)
    how = {"gain": path_gain, "wander": wander, "wander_time_s": wander_time_s}
    position = Position(
        name="the mesh",
        healthy=_expected_duty(machine, (), **how),
        degraded=_expected_duty(machine, damage, **how) if damage else (),
    )
    notes = (
        f"lines are those of the teeth along the line of action, times a path gain of {path_gain:g}"
        "; only recordings tell what reaches a place on the housing",
        f"the speed of each operating point wanders by {100 * wander:g} % (standard deviation)",
    )
    try:
        return _survey(machine, "expected", harvester, [position], budget, notes, count)
    except ArgumentError as error:
        hint = (
            f"a path gain of {_rounded_down(path_gain / error.over)} would be within"
            if isinstance(error, OverLimitsError)
            else "less reaches the housing"
        )
        raise ArgumentError(
            f"{error}; these are the lines at the teeth times a path gain of {path_gain:g}; {hint}"
        ) from None


def survey_measured(
    machine: Machine,
    harvester: Harvester,
    recordings: Sequence[Recording],
    budget: SensorBudget | None = None,
    *,
    shares: Sequence[float] = (),
    share_error: float = 0.0,
    degraded: Sequence[Recording] = (),
    count: int = 1,
) -> Survey:
    """Rank the places of the vibration channels of recordings.

    Parameters
    ----------
    machine : Machine
        Names its sensors' positions.
    harvester : InertialHarvester or PiezoCantilever
    recordings : sequence of Recording
        One an operating point, with the same channels, in m/s2.
    budget : SensorBudget, optional
    shares : sequence of float, optional
        Share of time of each recording, summing to at most 1. Without, five recordings or more are
        a sample of all operation; fewer count for an equal share.
    share_error : float, 0 to 0.5
        Standard deviation of these shares.
    degraded : sequence of Recording, optional
        The same operating points with a damaged gear.
    count : int, 1 to 3
        Harvesters of a set that serve the worst operating point, see `tune_set`.

    Returns
    -------
    Survey

    Raises
    ------
    ArgumentError
        If channels or units do not fit, or no place yields anything.
    """
    if not recordings:
        raise ArgumentError("recordings: none is given")
    parts = _shares(shares, len(recordings))
    if degraded and len(degraded) != len(recordings):
        raise ArgumentError(
            f"{len(degraded)} degraded recordings for {len(recordings)} healthy ones; give one for "
            "each, in the same order"
        )
    sampled = not shares and len(recordings) >= FEWEST_RECORDINGS
    positions = []
    for name in _channels(recordings):
        heard = _recorded(machine, name, recordings, parts, degraded, sampled)
        positions.append(replace(heard, share_error=share_error))
    notes = []
    if not shares and len(recordings) > 1:
        how = "a block of operation like any other" if sampled else "an equal share of the time"
        notes.append(f"every recording counts for {how}")
    return _survey(machine, "measured", harvester, positions, budget, tuple(notes), count)


def _survey(
    machine: Machine,
    origin: str,
    harvester: Harvester,
    positions: list[Position],
    budget: SensorBudget | None,
    notes: tuple[str, ...],
    count: int,
) -> Survey:
    task = budget or SensorBudget()
    placed = rank_positions(harvester, positions, task)
    if placed[0].tuned is None:
        if math.isfinite(placed[0].over_limits):
            raise OverLimitsError(placed[0].refusal, placed[0].over_limits)
        raise ArgumentError(placed[0].refusal)
    if count not in (1, 2, 3):
        raise ArgumentError(f"count={count} must be 1, 2 or 3")
    return Survey(
        machine=machine.name,
        origin=origin,
        placed=tuple(placed),
        budget=task,
        notes=(*notes, *_at_the_end(placed), *_doubts(placed[0])),
        together=tuple(tune_set(harvester, placed[0].position.healthy, count)) if count > 1 else (),
    )


def _rounded_down(value: float) -> str:
    """Two digits, never more than the value."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.floor(0.999 * value / step) * step:.2g}"


def _at_the_end(placed: Sequence[Placed]) -> tuple[str, ...]:
    """Say where the best tuning is only the last one that the harvester reaches."""
    notes = []
    for place in placed:
        if place.tuned is None:
            continue
        best = place.tuned.harvester
        for end, which in zip(best.frequency_range_hz, ("lower", "upper"), strict=True):
            if abs(best.natural_frequency_hz / end - 1) < best.damping_ratio / 5:
                notes.append(
                    f"{place.position.name}: {end:.4g} Hz is the {which} end of what this "
                    "harvester can be tuned to; another size might yield more"
                )
    return tuple(notes)


def _doubts(best: Placed) -> list[str]:
    """Say what the best place's figures do not hold."""
    told = []
    if best.position.folds and not math.isfinite(best.power_low_w):
        told.append(
            f"the recordings hold {best.stretches:.2g} independent stretches, too few for an "
            "interval; record longer or more often"
        )
    if best.line_share < 0.5:
        told.append(
            f"{100 * (1 - best.line_share):.0f} % of the power comes from what no line stands out "
            "of: make sure that it is not the noise of the sensor"
        )
    if best.power_unseen_w < 0.9 * best.power_w:
        told.append(
            f"on stretches that it was not tuned on it gives {1e6 * best.power_unseen_w:.3g} uW"
        )
    return told


def _expected_duty(
    machine: Machine, faults: tuple[str, ...], **how: float
) -> tuple[OperatingShare, ...]:
    points = []
    for number, point in enumerate(machine.operating):
        lines = expected_signature(machine, faults, operating=number)
        name = point.name or f"{point.speed_rpm:g} rpm"
        vibration = vibration_of_signature(lines, name=name, **how)
        points.append(OperatingShare(vibration=vibration, share=point.share))
    return tuple(points)


def _shares(shares: Sequence[float], count: int) -> list[float]:
    """Return the share of time of each recording, equal ones if none are given.

    Raises
    ------
    ArgumentError
        If there is not one for each recording.
    """
    if not shares:
        return [1 / count] * count
    if len(shares) != count:
        raise ArgumentError(f"{len(shares)} shares for {count} recordings; give one for each")
    return [float(share) for share in shares]


def _channels(recordings: Sequence[Recording]) -> list[str]:
    """Return the names of the vibration channels, the same in all recordings.

    Raises
    ------
    ArgumentError
        If there is none, or a recording lacks one.
    """
    wanted = _vibration(recordings[0])
    if not wanted:
        raise ArgumentError(f"{recordings[0].origin}: holds no vibration channel")
    for recording in recordings:
        missing = [name for name in wanted if name not in _vibration(recording)]
        if missing:
            raise ArgumentError(
                f"{recording.origin}: lacks channel '{missing[0]}', which "
                f"{recordings[0].origin} has"
            )
    return wanted


def _vibration(recording: Recording) -> list[str]:
    pairs = zip(recording.channel_names, recording.channel_kinds, strict=True)
    return [name for name, kind in pairs if kind == "vibration"]


def _recorded(
    machine: Machine,
    name: str,
    recordings: Sequence[Recording],
    shares: list[float],
    degraded: Sequence[Recording],
    sampled: bool,
) -> Position:
    """Gather what the recordings tell of one channel: duty cycles, sound and damaged, and parts.

    Raises
    ------
    ArgumentError
        If a recording lacks the channel or its unit.
    """
    places = {str(s.column): s.position for s in machine.sensors if s.position}
    healthy = _duty([_vibration_of(recording, name) for recording in recordings], shares)
    folds: tuple[tuple[OperatingShare, ...], ...]
    if sampled:
        folds = tuple((replace(point, share=1.0),) for point in healthy)
    else:
        cut = [np.array_split(p.vibration.samples_ms2, FOLDS) for p in healthy]
        rates = [p.vibration.sampling_rate_hz for p in healthy]
        folds = tuple(
            _duty([vibration_of_samples(*two) for two in zip(part, rates, strict=True)], shares)
            for part in zip(*cut, strict=True)
            if min(map(len, part)) >= 16 and all(p.any() for p in part)
        )
    return Position(
        name=f"{name}: {places[name]}" if name in places else name,
        healthy=healthy,
        degraded=_duty([_vibration_of(recording, name) for recording in degraded], shares),
        folds=folds,
        sampled=sampled,
    )


def _duty(vibrations: Sequence[Vibration], shares: list[float]) -> tuple[OperatingShare, ...]:
    return tuple(
        OperatingShare(vibration=vibration, share=share)
        for vibration, share in zip(vibrations, shares, strict=False)
    )


def _vibration_of(recording: Recording, name: str) -> Vibration:
    if name not in recording.channel_names:
        raise ArgumentError(f"{recording.origin}: lacks channel '{name}'")
    number = recording.channel_names.index(name)
    unit = recording.units[number]
    if unit != "m/s2":
        raise ArgumentError(
            f"{recording.origin}: channel '{name}' has the unit {unit or 'unknown'}, m/s2 is "
            'needed for a power; say unit = "m/s2" or "g" in a [[sensor]] of the machine file'
        )
    row = recording.samples[number]
    return vibration_of_samples(row, recording.sampling_rate_hz, name=recording.origin)
