"""From a machine, or recordings at several places, to the best place and tuning."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_positive
from gearmon.harvesting.answer import OperatingShare
from gearmon.harvesting.budget import SensorBudget
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.placement import Placed, Position, rank_positions
from gearmon.harvesting.vibration import (
    Vibration,
    operating_lines,
    standing_out,
    vibration_of_lines,
    vibration_of_samples,
)
from gearmon.machine import Machine
from gearmon.signals.recording import Recording
from gearmon.signatures.expected import expected_signature

#: Stretches that a recording is cut into for the uncertainty.
PIECES = 4


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
    """

    machine: str
    origin: str
    placed: tuple[Placed, ...]
    budget: SensorBudget
    notes: tuple[str, ...] = ()

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

    def to_dict(self) -> dict[str, Any]:
        """Return everything in built-in types that JSON can hold."""
        tuned = self.best.tuned
        return {
            "machine": self.machine,
            "origin": self.origin,
            "positions": self.rows(),
            "best": tuned.to_dict() if tuned else None,
            "energy_lines": self.lines(),
            "budget": self.budget.to_dict(),
            "notes": list(self.notes),
        }


def survey_expected(
    machine: Machine,
    harvester: Harvester,
    budget: SensorBudget | None = None,
    *,
    faults: Iterable[str] = (),
    path_gain: float = 1.0,
    wander: float = 0.005,
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

    Raises
    ------
    ArgumentError
        If the machine lacks data, or nothing can be tuned (with the reason).
    """
    check_positive("path_gain", path_gain)
    damage = tuple(faults)
    position = Position(
        name="at the mesh",
        healthy=_expected_duty(machine, (), path_gain, wander),
        degraded=_expected_duty(machine, damage, path_gain, wander) if damage else (),
    )
    notes = (
        f"lines are those of the teeth along the line of action, times a path gain of {path_gain:g}"
        "; only recordings tell what reaches a place on the housing",
        f"the speed of each operating point wanders by {100 * wander:g} % (standard deviation)",
    )
    try:
        return _survey(machine, "expected", harvester, [position], budget, notes)
    except ArgumentError as error:
        raise ArgumentError(
            f"{error}; these are the lines at the teeth times a path gain of {path_gain:g}; "
            "less reaches the housing"
        ) from None


def survey_measured(
    machine: Machine,
    harvester: Harvester,
    recordings: Sequence[Recording],
    budget: SensorBudget | None = None,
    *,
    shares: Sequence[float] = (),
    degraded: Sequence[Recording] = (),
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
    positions = [
        _position(machine, name, recordings, parts, degraded) for name in _channels(recordings)
    ]
    notes = ["only lines that stand out of the noise count: broadband shaking may add to them"]
    if not shares:
        notes.append("every recording counts for an equal share of the time")
    return _survey(machine, "measured", harvester, positions, budget, tuple(notes))


def _survey(
    machine: Machine,
    origin: str,
    harvester: Harvester,
    positions: list[Position],
    budget: SensorBudget | None,
    notes: tuple[str, ...],
) -> Survey:
    task = budget or SensorBudget()
    placed = rank_positions(harvester, positions, task)
    if placed[0].tuned is None:
        raise ArgumentError(placed[0].refusal)
    return Survey(
        machine=machine.name,
        origin=origin,
        placed=tuple(placed),
        budget=task,
        notes=(*notes, *_at_the_end(placed)),
    )


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


def _shares(shares: Sequence[float], count: int) -> list[float]:
    if not shares:
        return [1 / count] * count
    if len(shares) != count:
        raise ArgumentError(f"{len(shares)} shares for {count} recordings; give one for each")
    return [float(share) for share in shares]


def _channels(recordings: Sequence[Recording]) -> list[str]:
    """Names of the vibration channels, the same in all recordings."""
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


def _position(
    machine: Machine,
    name: str,
    recordings: Sequence[Recording],
    shares: list[float],
    degraded: Sequence[Recording],
) -> Position:
    places = {str(s.column): s.position for s in machine.sensors if s.position}
    heard = _duty([_vibration_of(recording, name) for recording in recordings], shares)
    refusal = ""
    if not heard:
        refusal = (
            "no line stands out of the noise; there is nothing to tune to (record longer, or "
            "nearer to the gears)"
        )
        heard = tuple(
            OperatingShare(vibration=_vibration_of(recording, name), share=share)
            for recording, share in zip(recordings, shares, strict=True)
        )
    return Position(
        name=f"{name}: {places[name]}" if name in places else name,
        healthy=heard,
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
