"""Where a harvester should sit: positions ranked by the power it would give there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearmon.errors import ArgumentError
from gearmon.harvesting.budget import SensorBudget
from gearmon.harvesting.duty import OperatingShare, check_duty
from gearmon.harvesting.evaluation import Tuned, evaluate
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.tuning import OverLimitsError, tune_harvester

#: A place is good only when the gear is damaged if, tuned for that, it loses more than this share
#: of its power when the gear is sound.
LOST_SHARE = 0.5
#: Half-width of a 90 % interval by Student's t, for 1, 2, ... degrees of freedom.
STUDENT_90 = (6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833, 1.812)


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
        degraded = self.tuned_degraded
        row = {
            "position": self.position.name,
            "natural_frequency_hz": self.tuned.harvester.natural_frequency_hz
            if self.tuned
            else math.nan,
            "load": self.tuned.harvester.load if self.tuned else math.nan,
            "power_w": self.power_w,
            "power_low_w": self.power_low_w,
            "power_high_w": self.power_high_w,
            "interval_s": self.interval_s,
            "degraded_power_w": self.degraded_power_w,
            "degraded_best_hz": degraded.harvester.natural_frequency_hz if degraded else math.nan,
            "degraded_best_power_w": degraded.power_w if degraded else math.nan,
            "degraded_best_power_when_healthy_w": self.healthy_power_of_degraded_w,
        }
        clean = {k: v if isinstance(v, str) or math.isfinite(v) else None for k, v in row.items()}
        return clean | {
            "good_only_when_damaged": self.good_only_when_damaged,
            "refusal": self.refusal,
        }


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
    degraded = _tuned(harvester, position.degraded)[0] if position.degraded else None
    low, high = _interval(tuned, position)
    return Placed(
        position=position,
        tuned=tuned,
        power_low_w=low,
        power_high_w=high,
        degraded_power_w=evaluate(tuned.harvester, position.degraded).power_w
        if tuned and position.degraded
        else math.nan,
        tuned_degraded=degraded,
        healthy_power_of_degraded_w=evaluate(degraded.harvester, position.healthy).power_w
        if degraded
        else math.nan,
        interval_s=budget.interval_s(tuned.power_w) if tuned else math.inf,
        refusal=refusal,
        over_limits=over,
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
    if tuned is None or len(position.pieces) < 2:
        return math.nan, math.nan
    try:
        powers = np.array([evaluate(tuned.harvester, piece).power_w for piece in position.pieces])
    except ArgumentError:
        # too short a stretch resolves no resonance
        return math.nan, math.nan
    degrees = len(powers) - 1
    student = STUDENT_90[min(degrees, len(STUDENT_90)) - 1]
    half = student * float(powers.std(ddof=1)) / math.sqrt(len(powers))
    return max(0.0, tuned.power_w - half), tuned.power_w + half
