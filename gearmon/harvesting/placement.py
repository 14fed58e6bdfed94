"""Where a harvester should sit, from a machine or from recordings, and what it powers there.

Positions are ranked by the power of a harvester that is tuned for each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.harvesting import response, tuning, vibration
from gearmon.harvesting.harvester import Harvester, Real, response_rows
from gearmon.harvesting.response import SensorBudget, Tuned
from gearmon.harvesting.vibration import OperatingShare, Points
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
USUAL_BUDGET = SensorBudget()


@dataclass(frozen=True)
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
    share_error : float
        Standard deviation of the shares of time.
    """

    name: str
    healthy: Points
    degraded: Points = ()
    folds: tuple[Points, ...] = ()
    sampled: bool = False
    share_error: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """One position with its best harvester.

    Attributes
    ----------
    position : Position
    tuned : Tuned or None
        For sound gears; None where no tuning is possible, see `refusal`.
    tuned_degraded : Tuned or None
        Best for the damaged gear.
    supply : dict
        What the sensor gets of it, see `SensorBudget.supply`; empty where nothing.
    error : ArgumentError or None
        Why nothing can be had here; with peak over limit of the nearest tuning, `over`, where a
        limit of travel or stress is why.
    power_unseen_w : float
        Mean power on stretches of the recordings by tunings that did not know them; NaN without.
    power_low_w, power_high_w : float
        90 % interval of the long-run mean power, from these stretches and what is not known of the
        shares of time; NaN where there are too few independent ones.
    independent_stretches : float
        Those that the recordings hold; NaN without.
    line_share : float
        Share of the power that comes from lines which stand out of the noise.
    power_with_stops_w, stops_hz : float
        Where the clearance limits the tuning: mean power of the best one without that limit, its
        mass hitting the stops, and its natural frequency; else NaN.
    degraded_power_w : float
        Of the tuned harvester when the gear is damaged; NaN if unknown.
    degraded_best_power_when_healthy_w : float
        What the best one for the damaged gear gives while the gear is sound.
    """

    position: Position
    tuned: Tuned[Any] | None = None
    tuned_degraded: Tuned[Any] | None = None
    supply: dict[str, Any] = field(default_factory=dict)
    error: ArgumentError | None = None
    power_unseen_w: float = math.nan
    power_low_w: float = math.nan
    power_high_w: float = math.nan
    independent_stretches: float = math.nan
    line_share: float = math.nan
    power_with_stops_w: float = math.nan
    stops_hz: float = math.nan
    degraded_power_w: float = math.nan
    degraded_best_power_when_healthy_w: float = math.nan

    @property
    def power_w(self) -> float:
        """Mean power to expect while the gear is sound [W]; 0 where no tuning is possible.

        Of recordings that on stretches which the tuning did not know: on its own ones the tuned
        harvester does better than it will again, for it was fitted to their noise as well.
        """
        own = self.tuned.power_w if self.tuned else 0.0
        return own if math.isnan(self.power_unseen_w) else self.power_unseen_w

    @property
    def interval_s(self) -> float:
        """Between recordings [s]; infinite if there can be none."""
        return self.supply.get("interval_s") or math.inf

    @property
    def good_only_when_damaged(self) -> bool:
        """Whether its best tuning for the damaged gear is a poor one for the sound gear."""
        best, sound_w = self.tuned_degraded, self.degraded_best_power_when_healthy_w
        return best is not None and max(sound_w, self.power_w) < (1 - LOST_SHARE) * best.power_w

    def to_dict(self) -> dict[str, Any]:
        """Return the row in built-in types; what is unknown or infinite is null."""
        own = {name: value for name, value in vars(self).items() if isinstance(value, float)}
        row = own | {"power_w": self.power_w, "interval_s": self.interval_s}
        unknown = (math.nan, math.nan, math.nan)
        best, degraded = (
            (t.harvester.natural_frequency_hz, t.harvester.load, t.power_w) if t else unknown
            for t in (self.tuned, self.tuned_degraded)
        )
        row |= {"natural_frequency_hz": best[0], "load": best[1]}
        row |= {"power_on_recordings_w": best[2] if self.position.folds else math.nan}
        row |= {"degraded_best_hz": degraded[0], "degraded_best_power_w": degraded[2]}
        row |= {"over_limits": getattr(self.error, "over", math.nan)}
        known = {name: x if math.isfinite(x) else None for name, x in row.items()}
        told = {"position": self.position.name, "refusal": str(self.error or "")}
        return told | known | {"good_only_when_damaged": self.good_only_when_damaged}


def _placed(harvester: Harvester, position: Position, budget: SensorBudget) -> Placed:
    found: dict[str, Any]
    try:
        tuned = tuning.tune_harvester(harvester, position.healthy)
        judged, steps = _judged(harvester, tuned, position)
        supply, share = budget.supply(tuned, steps), _line_share(tuned)
        found = {"tuned": tuned, "supply": supply, "line_share": share, **judged}
    except ArgumentError as error:
        found = {"error": error}
    with suppress(ArgumentError):
        found |= _beyond_stops(harvester, position.healthy, found.get("tuned"))
    if position.degraded:
        found["degraded_power_w"] = _power_w(found.get("tuned"), position.degraded)
        with suppress(ArgumentError):
            found["tuned_degraded"] = tuning.tune_harvester(harvester, position.degraded)
        sound_w = _power_w(found.get("tuned_degraded"), position.healthy)
        found["degraded_best_power_when_healthy_w"] = sound_w
    return Placed(position=position, **found)


def _power_w(tuned: Tuned[Any] | None, duty: Points) -> float:
    """Power of a tuned harvester over another duty cycle; NaN where none can be told."""
    with suppress(ArgumentError):
        return response.evaluate(tuned.harvester, duty).power_w if tuned else math.nan
    return math.nan


def _beyond_stops(harvester: Harvester, duty: Points, tuned: Tuned[Any] | None) -> dict[str, Any]:
    """Tell what the best tuning gives whose mass hits its stops, if they are in the way."""
    points = [point for point in duty if len(point.vibration.samples_ms2)]
    if not points or (tuned and tuned.over <= BOUND) or math.isinf(harvester.clearance_m):
        return {}
    free = tuning.tune_harvester(harvester, duty, limited=False)
    if free.travel_share <= 1:
        return {}
    heard = [(p.vibration.samples_ms2, p.vibration.sampling_rate_hz) for p in points]
    powers = [response.power_with_stops(free.harvester, *samples) for samples in heard]
    power = float(np.dot([p.share for p in points], powers))
    return {"power_with_stops_w": power, "stops_hz": free.harvester.natural_frequency_hz}


def _line_share(tuned: Tuned[Any]) -> float:
    """Share of the power that lines give."""
    own = whole = 0.0
    for point in tuned.duty:
        heard = point.vibration
        gains = tuned.harvester.gains(heard.frequency_hz).power_w
        power = point.share * gains * heard.mean_square_m2s4
        whole += float(power.sum())
        own += float(power[vibration.line_numbers(heard) > 0].sum())
    return own / whole if whole > 0 else 0.0


def _judged(
    harvester: Harvester, tuned: Tuned[Any], position: Position
) -> tuple[dict[str, float], list[Real]]:
    """Judge on every part what the others would have chosen, and how well the mean is known.

    Returned with the steps of the power at every operating point, as they give it.
    """
    folds, known = position.folds, [a.power_steps_w for a in tuned.answers]
    if len(folds) < 2:
        return {}, known
    # of every operating point the stretches that a tuning did not know, or of every block all of it
    heard: list[list[Real]] = [[] for _ in position.healthy]
    try:
        for number, fold in enumerate(folds):
            others = folds[:number] + folds[number + 1 :]
            # the best tuning is the same whatever the shares of time add up to
            duty = tuple(point for own in others for point in own)
            # where the limits chose the tuning, the noise did not
            kept = tuned.over > BOUND or not duty
            one = tuned.harvester if kept else tuning.tuned_among(harvester, duty, tuned.rivals_hz)
            judged = response.evaluate(one, fold if position.sampled else position.healthy).answers
            if position.sampled:
                heard[number].append(judged[0].power_steps_w)
                continue
            for part, found in zip(heard, judged, strict=True):
                part.append(np.array_split(found.power_steps_w, len(folds))[number])
    except ArgumentError:
        # shorter than the ring-down: that tells nothing
        return {"independent_stretches": 0.0}, known
    steps = [np.concatenate(parts) for parts in heard]
    if position.sampled:
        scatter = response.between([own.mean() for own in steps])
        enough = scatter.stretches >= FEWEST_RECORDINGS
    else:
        own, shares = map(response.scatter_of_mean, steps), [p.share for p in position.healthy]
        scatter = response.combined(list(own), shares, position.share_error)
        enough = scatter.stretches >= response.FEWEST_STRETCHES
    low, high = response.interval_90(scatter) if enough else (math.nan, math.nan)
    powers = {"power_unseen_w": scatter.mean, "power_low_w": low, "power_high_w": high}
    return powers | {"independent_stretches": scatter.stretches}, steps


@dataclass(frozen=True, kw_only=True, eq=False)
class Survey(Result):
    """Ranked positions of one machine.

    Attributes
    ----------
    machine : str
    origin : {"expected", "measured"}
    budget : SensorBudget
    notes : tuple of str
        What was assumed, in sentences.
    placed : tuple of Placed
        The best on the recordings first.
    together : tuple of Tuned
        Best set of several harvesters at the best position, for the worst operating point; empty
        if only one was asked for.
    """

    picture = "survey_plots.harvest_figures"

    machine: str
    origin: str
    budget: SensorBudget
    notes: tuple[str, ...] = ()
    placed: tuple[Placed, ...] = ()
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
            for row in vibration.operating_lines(point.vibration)
        ]

    @property
    def tuned(self) -> Tuned[Any]:
        """The best tuning at the first position; there is no survey without any."""
        assert self.best.tuned is not None
        return self.best.tuned

    def response(self) -> list[dict[str, Any]]:
        """Return power, voltage, travel and stress of the best harvester against frequency."""
        return response_rows(self.tuned.harvester)

    def bandwidths(self) -> list[dict[str, float]]:
        """Return bandwidth and power of the best harvester against its quality factor."""
        return tuning.bandwidth_against_quality(self.tuned.harvester, QUALITY_FACTORS, self.wander)

    def published(self) -> list[dict[str, Any]]:
        """Return published harvesters with the best one here beside them."""
        return tuning.beside_published(self.tuned.harvester)

    @property
    def wander(self) -> float:
        """Standard deviation over its frequency of the line that gives most, where that is most."""
        tuned = self.tuned
        powers = [p.share * a.power_w for p, a in zip(tuned.duty, tuned.answers, strict=True)]
        shaking = tuned.duty[int(np.argmax(powers))].vibration
        lines = vibration.operating_lines(shaking, len(shaking.frequency_hz))
        gains = tuned.harvester.gains([line["frequency_hz"] for line in lines]).power_w
        taken = [g * line["acceleration_ms2"] ** 2 for g, line in zip(gains, lines, strict=True)]
        return float(lines[int(np.argmax(taken))]["wander"]) if lines else shaking.wander

    def to_dict(self) -> dict[str, Any]:
        """Return everything in built-in types that JSON can hold."""
        told, damaged = super().to_dict(), self.best.tuned_degraded
        return {
            "positions": told.pop("placed"),
            "best": self.tuned.to_dict(),
            "best_when_damaged": damaged.to_dict() if damaged else None,
            "set": told.pop("together"),
            "response": self.response(),
            "bandwidth_against_quality": self.bandwidths(),
            "energy_lines": self.lines(),
            "published": self.published(),
        } | told


def survey_expected(
    machine: Machine,
    harvester: Harvester,
    budget: SensorBudget = USUAL_BUDGET,
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
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever
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

    def expected(broken: tuple[str, ...]) -> Iterator[OperatingShare]:
        about = {"gain": path_gain, "wander": wander, "wander_time_s": wander_time_s}
        for number, point in enumerate(machine.operating):
            lines = expected_signature(machine, broken, operating=number)
            name = point.name or f"{point.speed_rpm:g} rpm"
            shaking = vibration.vibration_of_signature(lines, name=name, **about)
            yield OperatingShare(vibration=shaking, share=point.share)

    degraded = tuple(expected(damage)) if damage else ()
    position = Position(name="the mesh", healthy=tuple(expected(())), degraded=degraded)
    told = (
        f"lines are those of the teeth along the line of action, times a path gain of {path_gain:g}"
        "; only recordings tell what reaches a place on the housing",
        f"the speed of each operating point wanders by {100 * wander:g} % (standard deviation)",
    )
    survey = Survey(machine=machine.name, origin="expected", budget=budget, notes=told)
    try:
        return _surveyed(survey, harvester, [position], count)
    except ArgumentError as error:
        hint = "less reaches the housing"
        if isinstance(error, tuning.OverLimitsError):
            # rounded to two digits it stays within
            hint = f"a path gain of {0.9 * path_gain / error.over:.2g} would be within"
        raise ArgumentError(
            f"{error}; these are the lines at the teeth times a path gain of {path_gain:g}; {hint}"
        ) from None


def survey_measured(
    machine: Machine,
    harvester: Harvester,
    recordings: Sequence[Recording],
    budget: SensorBudget = USUAL_BUDGET,
    *,
    shares: Sequence[float] = (),
    share_error: float = 0.0,
    degraded: Sequence[Recording] = (),
    count: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Survey:
    """Rank the places of the vibration channels of recordings.

    Parameters
    ----------
    machine : Machine
        Names its sensors' positions.
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever
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
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    Survey

    Raises
    ------
    ArgumentError
        If channels or units do not fit, or no place yields anything.
    """
    check_range("share_error", share_error, 0.0, 0.5)
    number = len(recordings)
    if not number:
        raise ArgumentError("recordings: none is given")
    for what, given in (("shares", shares), ("degraded recordings", degraded)):
        if given and len(given) != number:
            told = f"{len(given)} {what} for {number} healthy recordings"
            raise ArgumentError(f"{told}; give one for each, in the same order")
    parts = [float(share) for share in shares] or [1 / number] * number
    sampled = not shares and number >= FEWEST_RECORDINGS
    places = {str(s.column): f": {s.position}" for s in machine.sensors if s.position}
    positions = []
    for name in recordings[0].vibration().channel_names:
        healthy, damaged = (tuple(_duty(name, own, parts)) for own in (recordings, degraded))
        folds = tuple((replace(p, share=1.0),) for p in healthy) if sampled else _cut(healthy)
        title = name + places.get(name, "")
        positions.append(Position(title, healthy, damaged, folds, sampled, share_error))
    how = "a block of operation like any other" if sampled else "an equal share of the time"
    notes = (f"every recording counts for {how}",) if not shares and number > 1 else ()
    survey = Survey(machine=machine.name, origin="measured", budget=budget, notes=notes)
    return _surveyed(survey, harvester, positions, count, progress)


def _surveyed(
    survey: Survey, harvester: Harvester, positions: list[Position], count: int, tell: Any = None
) -> Survey:
    """Place and rank, and complete a survey by that."""
    placed = []
    for number, position in enumerate(positions, start=1):
        placed.append(_placed(harvester, position, survey.budget))
        if tell is not None:
            tell(number / len(positions))
    # on the same recordings: of what is to be expected every place errs by itself
    placed.sort(key=lambda own: -own.tuned.power_w if own.tuned else 0.0)
    best = placed[0]
    if best.error:
        raise best.error
    sets = tuning.tune_set(harvester, best.position.healthy, count) if count != 1 else ()
    notes = (*survey.notes, *_doubts(placed))
    return replace(survey, placed=tuple(placed), together=tuple(sets), notes=notes)


def _doubts(placed: Sequence[Placed]) -> Iterator[str]:
    """Say where a tuning is only the last one in reach, and what the best figures do not hold."""
    for name, own in [(p.position.name, p.tuned.harvester) for p in placed if p.tuned]:
        for end, which in zip(own.frequency_range_hz, ("lower", "upper"), strict=True):
            if abs(own.natural_frequency_hz / end - 1) < own.damping_ratio / 5:
                yield (
                    f"{name}: {end:.4g} Hz is the {which} end of what this harvester can be tuned "
                    "to; another size might yield more"
                )
    best = placed[0]
    if best.position.folds and not math.isfinite(best.power_low_w):
        yield (
            f"the recordings hold {best.independent_stretches:.2g} independent stretches, too few "
            "for an interval; record longer or more often"
        )
    if best.line_share < 0.5:
        yield (
            f"{100 * (1 - best.line_share):.0f} % of the power comes from what no line stands out "
            "of: make sure that it is not the noise of the sensor"
        )


def _duty(name: str, given: Sequence[Recording], shares: list[float]) -> Iterator[OperatingShare]:
    """Gather what recordings tell of one channel.

    Raises
    ------
    ArgumentError
        If a recording lacks the channel or its unit.
    """
    for recording, share in zip(given, shares, strict=False):
        own, origin = recording.select(name), recording.origin
        if own.units[0] != "m/s2":
            raise ArgumentError(
                f"{origin}: channel '{name}' has the unit {own.units[0] or 'unknown'}, m/s2 is "
                'needed for a power; say unit = "m/s2" or "g" in a [[sensor]] of the machine file'
            )
        heard = vibration.vibration_of_samples(own.samples[0], own.sampling_rate_hz, name=origin)
        yield OperatingShare(vibration=heard, share=share)


def _cut(points: Points) -> tuple[Points, ...]:
    """Cut a duty cycle into stretches; what is silent in one is left out of it."""
    found: list[list[OperatingShare]] = [[] for _ in range(FOLDS)]
    for point in points:
        own = point.vibration
        for part, heard in zip(np.array_split(own.samples_ms2, FOLDS), found, strict=True):
            if len(part) >= 16 and part.any():
                cut = vibration.vibration_of_samples(part, own.sampling_rate_hz, own.name)
                heard.append(replace(point, vibration=cut))
    return tuple(map(tuple, found))
