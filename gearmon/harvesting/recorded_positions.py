"""A place and direction as its recordings tell it: what shakes there, and how it scatters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.harvesting.duty import OperatingShare
from gearmon.harvesting.placement import Position
from gearmon.harvesting.vibration import Vibration, standing_out, vibration_of_samples
from gearmon.machine import Machine
from gearmon.signals.recording import Recording

#: Stretches that a recording is cut into for the uncertainty.
PIECES = 4


def check_shares(shares: Sequence[float], count: int) -> list[float]:
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


def vibration_channels(recordings: Sequence[Recording]) -> list[str]:
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


def recorded_position(
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
