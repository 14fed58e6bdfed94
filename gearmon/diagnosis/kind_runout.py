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
from numpy.typing import NDArray

from gearmon.diagnosis.kind_turns import TurnChange, turn_changes
from gearmon.signatures.reference import WheelPattern

FloatArray = NDArray[np.float64]

# What the growth of a healthy gear scatters by before any is seen [dB], and the gears that this is
# worth. Simulated healthy machines at loads, speeds and gains of their own: 0.75 dB.
PRIOR_DB, PRIOR_WORTH = 1.2, 10.0
# Sidebands held against the first and the second.
_OTHERS = slice(3, 6)
_KINDS = ("eccentricity", "misalignment")


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
    turns: Sequence[TurnChange], healthy: Sequence[Sequence[TurnChange]] = ()
) -> tuple[RunoutGrowth, ...]:
    """Judge how far the first and second sidebands of every gear have grown.

    Parameters
    ----------
    turns : sequence of TurnChange
        Of the new recording against all healthy ones, see `kind_turns.turn_changes`.
    healthy : sequence of sequences of TurnChange
        Of each healthy recording against the others, see `healthy_turns`.

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
    sigma = float(np.sqrt(square / worth))
    found = [_growth(turn, sigma, worth, 2 * len(turns)) for turn in turns]
    return tuple(sorted(found, key=lambda growth: growth.log10_probability))


def healthy_turns(
    healthy: Sequence[Sequence[WheelPattern]], rows: Sequence[int]
) -> tuple[tuple[TurnChange, ...], ...]:
    """Compare each healthy recording with the others.

    Parameters
    ----------
    healthy : sequence of sequences of WheelPattern
        Gears of each healthy recording.
    rows : sequence of int
        Channels to use.

    Returns
    -------
    tuple of tuples of TurnChange
        One for each recording; none if there is but one.
    """
    if len(healthy) < 2:
        return ()
    return tuple(
        turn_changes(own, rows, [*healthy[:place], *healthy[place + 1 :]], rows)
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
