"""From a machine, or recordings at several places, to the best place and tuning."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.harvesting.budget import SensorBudget
from gearmon.harvesting.duty import OperatingShare
from gearmon.harvesting.evaluation import Tuned
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.harvester_sets import tune_set
from gearmon.harvesting.placement import Placed, Position, rank_positions
from gearmon.harvesting.recorded_positions import (
    check_shares,
    recorded_position,
    vibration_channels,
)
from gearmon.harvesting.response import (
    bandwidth_against_quality,
    half_power_band,
    response_grid,
    response_rows,
)
from gearmon.harvesting.tuning import OverLimitsError
from gearmon.harvesting.vibration import operating_lines, vibration_of_lines
from gearmon.machine import Machine
from gearmon.signals.recording import Recording
from gearmon.signatures.expected.baseline import expected_signature

#: Quality factors of the mechanics that the bandwidth is given for.
QUALITY_FACTORS = (10.0, 25.0, 50.0, 100.0, 200.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Survey:
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
    parts = check_shares(shares, len(recordings))
    if degraded and len(degraded) != len(recordings):
        raise ArgumentError(
            f"{len(degraded)} degraded recordings for {len(recordings)} healthy ones; give one for "
            "each, in the same order"
        )
    positions = [
        recorded_position(machine, name, recordings, parts, degraded)
        for name in vibration_channels(recordings)
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
        signature = expected_signature(machine, faults, operating=number)
        vibration = vibration_of_lines(
            signature["frequency_hz"],
            acceleration_ms2=signature["acceleration_ms2"],
            gain=gain,
            wander=wander,
            name=point.name or f"{point.speed_rpm:g} rpm",
        )
        points.append(OperatingShare(vibration=vibration, share=point.share))
    return tuple(points)
