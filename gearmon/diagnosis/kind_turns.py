"""Change of single sidebands: one, two, three ... turns of a gear away from the mesh harmonics.

Families of lines join the first six sidebands. Which of them changed says whether a gear runs out
(the first), wobbles (the second) or has something that repeats more often.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.signatures.reference import WheelPattern

FloatArray = NDArray[np.float64]

#: Sidebands that are looked at one by one.
SIDEBANDS = 6
#: A line this many dB or less above its own noise in both recordings says nothing about a gain.
_CLEAR_DB = 6.0
#: Standard error of the level of a line that noise drowns [dB].
_UNHEARD_DB = 10.0 / np.log(10.0) * (1.0 - 1e-9)


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnChange:
    """Change of the sidebands of one gear against the reference, by their distance.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : str
        Gear.
    change_db : ndarray of float, shape (6,)
        Change of the lines 1 ... 6 turns of the gear away from the mesh harmonics, freed of the
        gain of the channels [dB].
    """

    stage: int
    gear: str
    change_db: FloatArray


def turn_changes(
    wheels: Sequence[WheelPattern],
    rows: Sequence[int],
    healthy: Sequence[Sequence[WheelPattern]],
    healthy_rows: Sequence[int],
) -> tuple[TurnChange, ...]:
    """Compare single sidebands of every gear with those of healthy recordings.

    Parameters
    ----------
    wheels : sequence of WheelPattern
        Gears of the new recording.
    rows : sequence of int
        Its channels to use.
    healthy : sequence of sequences of WheelPattern
        Gears of each healthy recording, at least one.
    healthy_rows : sequence of int
        The same channels there.

    Returns
    -------
    tuple of TurnChange
        One for each gear that all recordings resolve.

    Notes
    -----
    The power of the lines on both sides, less their variance and never below it, is compared in
    decibels, mesh harmonic by mesh harmonic and channel by channel; the median of the clear ones in
    a channel is its gain. Means are weighted by ``1/(scatter^2 + 1 dB^2)``; lines below the noise
    in all recordings count as unchanged. No alignment is needed.
    """
    found: list[tuple[WheelPattern, FloatArray, FloatArray]] = []
    for wheel in wheels:
        match = [_same(wheel, patterns) for patterns in healthy]
        known = [pattern for pattern in match if pattern is not None]
        if len(known) < len(healthy) or not known:
            continue
        new_db, new_scatter = _levels(wheel, rows)
        old = [_levels(pattern, healthy_rows) for pattern in known]
        harmonics = min(new_db.shape[1], *(level.shape[1] for level, _ in old))
        if harmonics == 0:
            continue
        reference = np.mean([level[:, :harmonics] for level, _ in old], axis=0)
        scatter = np.mean([own[:, :harmonics] ** 2 for _, own in old], axis=0)
        change = new_db[:, :harmonics] - reference
        # a line below the noise in all recordings would tell of the noise, not of the gear
        unheard = (new_scatter[:, :harmonics] >= _UNHEARD_DB) & (scatter >= _UNHEARD_DB**2)
        spread = np.sqrt(new_scatter[:, :harmonics] ** 2 + scatter)
        found.append((wheel, np.where(unheard, np.nan, change), spread))
    gain = _gains(found, len(rows))
    return tuple(
        TurnChange(
            stage=wheel.stage,
            gear=wheel.gear,
            change_db=np.average(
                np.nan_to_num(np.clip(change - gain[:, None, None], -30.0, 30.0)),
                axis=(0, 1),
                weights=1.0 / (spread**2 + 1.0),
            ),
        )
        for wheel, change, spread in found
    )


def _same(wheel: WheelPattern, patterns: Sequence[WheelPattern]) -> WheelPattern | None:
    key = (wheel.stage, wheel.gear, wheel.teeth)
    return next((p for p in patterns if (p.stage, p.gear, p.teeth) == key), None)


def _levels(wheel: WheelPattern, rows: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Levels by channel, mesh harmonic and distance, and their standard errors [dB]."""
    top = int(wheel.number.max(initial=0))
    power = np.zeros((len(rows), top + 1))
    variance = np.zeros((len(rows), top + 1))
    power[:, wheel.number] = np.abs(wheel.amplitude[list(rows)]) ** 2
    variance[:, wheel.number] = wheel.variance[list(rows)]
    usable = np.zeros(top + 1, dtype=bool)
    usable[wheel.number] = ~wheel.mesh
    centre = wheel.teeth * np.arange(1, max(1, (top - SIDEBANDS) // wheel.teeth + 1))
    distance = np.arange(1, SIDEBANDS + 1)
    total = np.zeros((len(rows), len(centre), SIDEBANDS))
    noise = np.zeros_like(total)
    for sign in (-1, 1):
        place = centre[:, None] + sign * distance
        place = np.where((place > 0) & (place <= top), place, 0)
        total += np.where(usable[place], power[:, place], 0.0)
        noise += np.where(usable[place], variance[:, place], 0.0)
    tiny = np.finfo(float).tiny
    noise = np.maximum(noise, tiny)
    clean = np.maximum(total - noise, noise)
    scatter = 10 / np.log(10) * np.minimum(np.sqrt(2 * noise / clean), 1.0)
    # lines that do not exist, such as those of another mesh, carry no weight
    scatter = np.where(total > tiny, scatter, 1e3)
    return 10 * np.log10(clean), scatter


def _gains(
    found: Sequence[tuple[WheelPattern, FloatArray, FloatArray]], channels: int
) -> FloatArray:
    """Return the median change of the clear lines of each channel [dB]."""
    limit = 10 / np.log(10) * 10 ** (-_CLEAR_DB / 20) * np.sqrt(2)
    gains = np.zeros(channels)
    for channel in range(channels):
        moved = [change[channel][spread[channel] < limit] for _, change, spread in found]
        joined = np.concatenate(moved) if moved else np.zeros(0)
        gains[channel] = float(np.median(joined)) if len(joined) else 0.0
    return gains
