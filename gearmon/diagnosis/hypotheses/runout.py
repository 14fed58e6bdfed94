"""Runout and wobble that have grown: sidebands once and twice a turn of a gear away from the mesh.

Eccentricity, or a gear that stands askew, changes the mesh smoothly over the turn of the gear: the
first sidebands of its mesh harmonics grow and those farther away hardly do. Load, gain, noise and
damage of teeth move both alike. So the growth of the first (or second) sidebands is taken over that
of the fourth to sixth, and held against what it does between healthy recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.signatures.measured.reference import WheelPattern

#: Sidebands that are looked at one by one.
SIDEBANDS = 6
#: A line this many dB or less above its own noise in both recordings says nothing about a gain.
_CLEAR_DB = 6.0
#: Standard error of the level of a line that noise drowns [dB].
_UNHEARD_DB = 10.0 / np.log(10.0) * (1.0 - 1e-9)
# What the growth of a healthy gear scatters by before any is seen [dB], and the gears that this is
# worth. Simulated healthy machines at loads, speeds and gains of their own: 0.75 dB.
PRIOR_DB, PRIOR_WORTH = 1.2, 10.0
#: Its growth with the distance from the nearest healthy state [dB per unit of state]: of healthy
#: pairs of `gearmon.simulation` at loads 0.4 to 0.7 Np lighter 95 % grow by less than 15 dB.
SLOPE_DB = 8.0
# Sidebands held against the first and the second.
_OTHERS = slice(3, 6)
_KINDS = ("eccentricity", "misalignment")


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
        gain of the channels and beyond what the mesh harmonic between them rose by [dB].
    """

    stage: int
    gear: str
    change_db: FloatArray


def turn_changes(
    wheels: Sequence[WheelPattern], healthy: Sequence[Sequence[WheelPattern]]
) -> tuple[TurnChange, ...]:
    """Compare single sidebands of every gear with those of healthy recordings.

    Parameters
    ----------
    wheels : sequence of WheelPattern
        Gears of the new recording.
    healthy : sequence of sequences of WheelPattern
        Gears of each healthy recording, at least one, in the same channels.

    Returns
    -------
    tuple of TurnChange
        One for each gear that all recordings resolve.

    Notes
    -----
    The power of the lines on both sides, less their variance and never below it, is compared in
    decibels, mesh harmonic by mesh harmonic and channel by channel; the median of the clear ones in
    a channel is its gain. Sidebands modulate their mesh harmonic: what a heavier load or worn teeth
    add to it comes back in them, in proportion, and is no growth of theirs. Means are weighted by
    ``1/(scatter^2 + 1 dB^2)``; lines below the noise in all recordings count as unchanged. No
    alignment is needed.
    """
    found: list[tuple[WheelPattern, FloatArray, FloatArray]] = []
    for wheel in wheels:
        known = [own for patterns in healthy if (own := wheel.same_in(patterns))]
        if len(known) < len(healthy) or not known:
            continue
        new_db, new_scatter = _levels(wheel)
        old = [_levels(pattern) for pattern in known]
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
    gain = _gains(found)
    return tuple(
        TurnChange(
            stage=wheel.stage,
            gear=wheel.gear,
            change_db=np.average(
                _beyond_mesh(change - gain[:, None, None]),
                axis=(0, 1),
                weights=1.0 / (spread[..., 1:] ** 2 + 1.0),
            ),
        )
        for wheel, change, spread in found
    )


def _beyond_mesh(change: FloatArray) -> FloatArray:
    """Take the rise of the mesh harmonic, the first column, off that of its sidebands."""
    rise = np.maximum(np.nan_to_num(change[..., :1]), 0.0)
    return np.nan_to_num(np.clip(change[..., 1:] - rise, -30.0, 30.0))


def _levels(wheel: WheelPattern) -> tuple[FloatArray, FloatArray]:
    """Levels by channel, mesh harmonic and distance from it, 0 to 6, and their standard errors."""
    top = int(wheel.number.max(initial=0))
    power = np.zeros((len(wheel.amplitude), top + 1))
    variance = np.zeros_like(power)
    power[:, wheel.number] = np.abs(wheel.amplitude) ** 2
    variance[:, wheel.number] = wheel.variance
    usable = np.zeros(top + 1, dtype=bool)
    usable[wheel.number] = ~wheel.mesh
    centre = wheel.teeth * np.arange(1, max(1, (top - SIDEBANDS) // wheel.teeth + 1))
    usable[centre[centre <= top]] = True
    distance = np.arange(SIDEBANDS + 1)
    total = np.zeros((len(power), len(centre), len(distance)))
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


def _gains(found: Sequence[tuple[WheelPattern, FloatArray, FloatArray]]) -> FloatArray:
    """Return the median change of the clear lines of each channel [dB]."""
    limit = 10 / np.log(10) * 10 ** (-_CLEAR_DB / 20) * np.sqrt(2)
    clear = [np.where(spread < limit, change, np.nan)[..., 1:] for _, change, spread in found]
    channels = zip(*clear, strict=True)
    rows = [np.concatenate([own.ravel() for own in channel]) for channel in channels]
    told = [row[~np.isnan(row)] for row in rows]
    return np.array([float(np.median(row)) if len(row) else 0.0 for row in told])


@dataclass(frozen=True, kw_only=True)
class RunoutGrowth:
    """Growth of the sidebands of one gear that are once or twice a turn away from the mesh.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : str
        Gear.
    times : {1, 2}
        Turns away from the mesh harmonics of what grew most.
    change_db : float
        Change of these sidebands [dB].
    others_db : float
        Change of the fourth to sixth [dB].
    sigma_db : float
        Standard deviation of the difference on a healthy machine [dB].
    log10_probability : float
        Logarithm of the probability that any gear of a healthy machine shows as much.
    """

    stage: int
    gear: str
    times: int
    change_db: float
    others_db: float
    sigma_db: float
    log10_probability: float

    @property
    def kind(self) -> str:
        """What it is most like."""
        return _KINDS[self.times - 1]

    @property
    def evidence(self) -> tuple[str, ...]:
        """Sentences that can be checked on the pictures."""
        once = ("once", "twice")[self.times - 1]
        return (
            f"sidebands {once} the rotation of the {self.gear} of stage {self.stage} away from the "
            f"mesh harmonics changed by {self.change_db:+.1f} dB, those four to six turns away by "
            f"{self.others_db:+.1f} dB; scatter {self.sigma_db:.1f} dB",
        )


def runout_growth(
    turns: Sequence[TurnChange],
    healthy: Sequence[Sequence[TurnChange]] = (),
    gap: float = 0.0,
) -> tuple[RunoutGrowth, ...]:
    """Judge how far the first and second sidebands of every gear have grown.

    Parameters
    ----------
    turns : sequence of TurnChange
        Of the new recording against all healthy ones, see `turn_changes`.
    healthy : sequence of sequences of TurnChange
        Of each healthy recording against the others, see `healthy_turns`.
    gap : float, >= 0
        Distance of the new recording's operating state to the nearest healthy one's.

    Returns
    -------
    tuple of RunoutGrowth
        One a gear, most striking first.

    Notes
    -----
    The growth is ``change[q] - max(mean change[4..6], 0)``, q = 1 or 2. Its square among healthy
    recordings joins a prior of 1.2 dB that ten gears are worth; growth over that standard deviation
    follows Student's law of as many degrees of freedom. The probability is multiplied by two for
    each gear looked at.
    """
    if not turns:
        return ()
    seen = [_contrast(turn) for others in healthy for turn in others]
    # gears of one recording move together: they count as one
    worth = PRIOR_WORTH + len(healthy)
    square = PRIOR_WORTH * PRIOR_DB**2
    if seen:
        square += len(healthy) * float(np.mean(np.square(seen)))
    sigma = float(np.sqrt(square / worth + (SLOPE_DB * gap) ** 2))
    found = [_growth(turn, sigma, worth, 2 * len(turns)) for turn in turns]
    return tuple(sorted(found, key=lambda growth: growth.log10_probability))


def healthy_turns(
    healthy: Sequence[Sequence[WheelPattern]],
) -> tuple[tuple[TurnChange, ...], ...]:
    """Compare each healthy recording with the others.

    Parameters
    ----------
    healthy : sequence of sequences of WheelPattern
        Gears of each healthy recording.

    Returns
    -------
    tuple of tuples of TurnChange
        One for each recording; none if there is but one.
    """
    if len(healthy) < 2:
        return ()
    return tuple(
        turn_changes(own, [*healthy[:place], *healthy[place + 1 :]])
        for place, own in enumerate(healthy)
    )


def _contrast(turn: TurnChange) -> FloatArray:
    """Growth of the first and the second sidebands beyond that of farther ones [dB]."""
    return np.asarray(turn.change_db[:2] - max(float(np.mean(turn.change_db[_OTHERS])), 0.0))


def _growth(turn: TurnChange, sigma: float, worth: float, places: int) -> RunoutGrowth:
    contrast = _contrast(turn)
    first = int(np.argmax(contrast))
    log10 = _log10_student(float(contrast[first]) / sigma, worth) + float(np.log10(places))
    return RunoutGrowth(
        stage=turn.stage,
        gear=turn.gear,
        times=first + 1,
        change_db=float(turn.change_db[first]),
        others_db=float(np.mean(turn.change_db[_OTHERS])),
        sigma_db=sigma,
        log10_probability=min(0.0, log10),
    )


def _log10_student(value: float, freedom: float) -> float:
    """log10 of the probability that Student's t exceeds a value."""
    from scipy.special import stdtr

    return float(np.log10(max(float(stdtr(freedom, -value)), 1e-300)))
