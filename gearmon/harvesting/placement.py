"""Where a harvester should sit, from a machine or from recordings, and what it powers there.

Positions are ranked by the power of a harvester that is tuned for each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.harvesting.power import (
    Harvester,
    Tuned,
    bandwidth_against_quality,
    evaluate,
    half_power_band,
    response_grid,
    response_rows,
)
from gearmon.harvesting.request import SensorBudget
from gearmon.harvesting.sets import tune_set
from gearmon.harvesting.tuning import OverLimitsError, tune_harvester
from gearmon.harvesting.vibration import (
    OperatingShare,
    Vibration,
    check_duty,
    operating_lines,
    standing_out,
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
#: Stretches that a recording is cut into for the uncertainty.
PIECES = 4
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
    pieces : tuple of tuples of OperatingShare, optional
        The healthy duty cycle again from shorter stretches: their scatter gives the uncertainty.
    refusal : str, optional
        Why there is nothing to tune to here, where that is so.

    Raises
    ------
    ArgumentError
        If a duty cycle cannot be.
    """

    name: str
    healthy: tuple[OperatingShare, ...]
    degraded: tuple[OperatingShare, ...] = ()
    pieces: tuple[tuple[OperatingShare, ...], ...] = ()
    refusal: str = ""

    def __post_init__(self) -> None:
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
    power_low_w, power_high_w : float
        90 % interval of the mean power, from the scatter between pieces; NaN without pieces. It
        holds for changes that are quicker than a piece is long, a quarter of the recording.
    degraded_power_w : float
        Of that harvester when the gear is damaged; NaN if unknown.
    tuned_degraded : Tuned or None
        Best for the damaged gear.
    healthy_power_of_degraded_w : float
        What that one gives while the gear is sound.
    interval_s : float
        Between recordings.
    refusal : str
        Why nothing can be had here, in one line.
    over_limits : float
        Where a limit of travel or stress is why: peak over limit of the nearest tuning; else NaN.
    """

    position: Position
    tuned: Tuned[Any] | None
    power_low_w: float = math.nan
    power_high_w: float = math.nan
    degraded_power_w: float = math.nan
    tuned_degraded: Tuned[Any] | None = None
    healthy_power_of_degraded_w: float = math.nan
    interval_s: float = math.inf
    refusal: str = ""
    over_limits: float = math.nan

    @property
    def power_w(self) -> float:
        """Mean power while the gear is sound [W]; 0 where no tuning is possible."""
        return self.tuned.power_w if self.tuned else 0.0

    @property
    def good_only_when_damaged(self) -> bool:
        """Whether its best tuning for the damaged gear is a poor one for the sound gear."""
        if self.tuned_degraded is None:
            return False
        kept = self.healthy_power_of_degraded_w
        return (
            kept < (1 - LOST_SHARE) * self.tuned_degraded.power_w
            and self.power_w < (1 - LOST_SHARE) * self.tuned_degraded.power_w
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the row in built-in types; what is unknown or infinite is null."""
        best, degraded = (
            {"hz": t.harvester.natural_frequency_hz, "w": t.power_w, "load": t.harvester.load}
            if t
            else dict.fromkeys(("hz", "w", "load"), math.nan)
            for t in (self.tuned, self.tuned_degraded)
        )
        row = {
            "natural_frequency_hz": best["hz"],
            "load": best["load"],
            "power_w": self.power_w,
            "power_low_w": self.power_low_w,
            "power_high_w": self.power_high_w,
            "interval_s": self.interval_s,
            "degraded_power_w": self.degraded_power_w,
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
    if position.refusal:
        return Placed(position=position, tuned=None, refusal=position.refusal)
    tuned, refusal, over = _tuned(harvester, position.healthy)
    low, high = _interval(tuned, position)
    found = Placed(
        position=position,
        tuned=tuned,
        power_low_w=low,
        power_high_w=high,
        interval_s=budget.interval_s(tuned.power_w) if tuned else math.inf,
        refusal=refusal,
        over_limits=over,
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


def _interval(tuned: Tuned[Any] | None, position: Position) -> tuple[float, float]:
    """90 % interval of the mean from the scatter of the pieces, by Student's t.

    Pieces count as independent: what changes more slowly than a piece lasts is not in it.
    """
    from scipy.stats import t as student_t

    if tuned is None or len(position.pieces) < 2:
        return math.nan, math.nan
    try:
        powers = np.array([evaluate(tuned.harvester, piece).power_w for piece in position.pieces])
    except ArgumentError:
        # too short a stretch resolves no resonance
        return math.nan, math.nan
    half = float(student_t.ppf(0.95, len(powers) - 1) * powers.std(ddof=1)) / math.sqrt(len(powers))
    return max(0.0, tuned.power_w - half), tuned.power_w + half


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
        wander = max(point.vibration.wander for point in self.best.position.healthy)
        return bandwidth_against_quality(tuned.harvester, QUALITY_FACTORS, wander)

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


def survey_expected(
    machine: Machine,
    harvester: Harvester,
    budget: SensorBudget | None = None,
    *,
    faults: Iterable[str] = (),
    path_gain: float = 1.0,
    wander: float = 0.005,
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
        Acceleration at the harvester over that along the line of action.
    wander : float, 0 to 0.2
        Standard deviation of the speed over its mean.
    count : int, 1 to 3
        Harvesters of a set that serve the worst operating point, see `tune_set`.

    Raises
    ------
    ArgumentError
        If the machine lacks data, or nothing can be tuned (with the reason).
    """
    check_positive("path_gain", path_gain)
    check_range("count", count, 1, 3)
    damage = tuple(faults)
    position = Position(
        name="the mesh",
        healthy=_expected_duty(machine, (), path_gain, wander),
        degraded=_expected_duty(machine, damage, path_gain, wander) if damage else (),
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
        Share of time of each recording, summing to at most 1; equal ones by default.
    degraded : sequence of Recording, optional
        The same operating points with a damaged gear.
    count : int, 1 to 3
        Harvesters of a set that serve the worst operating point, see `tune_set`.

    Raises
    ------
    ArgumentError
        If channels or units do not fit, or no place yields anything.
    """
    check_range("count", count, 1, 3)
    if not recordings:
        raise ArgumentError("recordings: none is given")
    parts = _shares(shares, len(recordings))
    if degraded and len(degraded) != len(recordings):
        raise ArgumentError(
            f"{len(degraded)} degraded recordings for {len(recordings)} healthy ones; give one for "
            "each, in the same order"
        )
    positions = [
        _recorded(machine, name, recordings, parts, degraded) for name in _channels(recordings)
    ]
    notes = [
        "only lines that stand out of the noise count: broadband shaking may add to them",
        "intervals hold for changes that are quicker than a quarter of a recording",
    ]
    if not shares and len(recordings) > 1:
        notes.append("every recording counts for an equal share of the time")
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
    return Survey(
        machine=machine.name,
        origin=origin,
        placed=tuple(placed),
        budget=task,
        notes=(*notes, *_at_the_end(placed)),
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


def _expected_duty(
    machine: Machine, faults: tuple[str, ...], gain: float, wander: float
) -> tuple[OperatingShare, ...]:
    points = []
    for number, point in enumerate(machine.operating):
        lines = expected_signature(machine, faults, operating=number)
        name = point.name or f"{point.speed_rpm:g} rpm"
        vibration = vibration_of_signature(lines, gain=gain, wander=wander, name=name)
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
) -> Position:
    """Gather what the recordings tell of one channel: duty cycles, sound and damaged, and pieces.

    Raises
    ------
    ArgumentError
        If a recording lacks the channel or its unit.
    """
    places = {str(s.column): s.position for s in machine.sensors if s.position}
    shaking = _duty([_vibration_of(recording, name) for recording in recordings], shares)
    refusal = ""
    if not shaking:
        refusal = (
            "no line stands out of the noise; there is nothing to tune to (record longer, or "
            "nearer to the gears)"
        )
        shaking = tuple(
            OperatingShare(vibration=_vibration_of(recording, name), share=share)
            for recording, share in zip(recordings, shares, strict=True)
        )
    return Position(
        name=f"{name}: {places[name]}" if name in places else name,
        healthy=shaking,
        degraded=_duty([_vibration_of(recording, name) for recording in degraded], shares),
        pieces=() if refusal else _pieces(recordings, name, shares),
        refusal=refusal,
    )


def _duty(vibrations: Sequence[Vibration], shares: list[float]) -> tuple[OperatingShare, ...]:
    """Operating points with what stands out of the noise; one where nothing does gives no power."""
    clear = [standing_out(vibration) for vibration in vibrations]
    return tuple(
        OperatingShare(vibration=vibration, share=share)
        for vibration, share in zip(clear, shares, strict=False)
        if vibration is not None
    )


def _vibration_of(recording: Recording, name: str) -> Vibration:
    return vibration_of_samples(
        _row(recording, name), recording.sampling_rate_hz, name=recording.origin
    )


def _row(recording: Recording, name: str) -> npt.NDArray[np.float64]:
    if name not in recording.channel_names:
        raise ArgumentError(f"{recording.origin}: lacks channel '{name}'")
    number = recording.channel_names.index(name)
    unit = recording.units[number]
    if unit != "m/s2":
        raise ArgumentError(
            f"{recording.origin}: channel '{name}' has the unit {unit or 'unknown'}, m/s2 is "
            'needed for a power; say unit = "m/s2" or "g" in a [[sensor]] of the machine file'
        )
    row: npt.NDArray[np.float64] = recording.samples[number]
    return row


def _pieces(
    recordings: Sequence[Recording], name: str, shares: list[float]
) -> tuple[tuple[OperatingShare, ...], ...]:
    """Cut every recording into equal stretches."""
    rows = [np.array_split(_row(recording, name), PIECES) for recording in recordings]
    if min(len(row[0]) for row in rows) < 16:
        return ()
    rates = [recording.sampling_rate_hz for recording in recordings]
    pieces = []
    for number in range(PIECES):
        cut = [
            vibration_of_samples(row[number], rate) for row, rate in zip(rows, rates, strict=True)
        ]
        duty = _duty(cut, shares)
        if not duty:
            return ()
        pieces.append(duty)
    return tuple(pieces)
