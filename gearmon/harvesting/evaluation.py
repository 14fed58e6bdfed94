"""What a harvester yields over a duty cycle as it stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from gearmon.harvesting.answer import Answer, answer
from gearmon.harvesting.duty import Shaking, check_duty
from gearmon.harvesting.gains import Harvester

H = TypeVar("H", bound=Harvester)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tuned(Generic[H]):
    """A harvester at its best.

    Attributes
    ----------
    harvester : Harvester
        Tuned, with its load.
    power_w : float
        Mean over the duty cycle [W].
    answers : tuple of Answer
        Of each operating point.
    travel_share, stress_share : float
        Largest peak over its limit; 0 where there is no limit.
    """

    harvester: H
    power_w: float
    answers: tuple[Answer, ...]
    travel_share: float
    stress_share: float

    @property
    def within_limits(self) -> bool:
        """Whether travel and stress stay within their limits."""
        return self.travel_share <= 1 + 1e-9 and self.stress_share <= 1 + 1e-9

    def to_dict(self) -> dict[str, Any]:
        """Return values in built-in types."""
        return {
            "harvester": self.harvester.to_dict(),
            "power_w": self.power_w,
            "power_by_operating_point_w": [a.power_w for a in self.answers],
            "travel_m": max(a.travel_m for a in self.answers),
            "stress_pa": max(a.stress_pa for a in self.answers),
            "voltage_v": max(a.voltage_v for a in self.answers),
            "travel_share": self.travel_share,
            "stress_share": self.stress_share,
        }


def evaluate(harvester: H, duty: Shaking) -> Tuned[H]:
    """Tell what a harvester yields over a duty cycle as it stands, and how near its limits."""
    points = check_duty(duty)
    answers = tuple(answer(harvester, point.vibration) for point in points)
    return Tuned(
        harvester=harvester,
        power_w=math.fsum(p.share * a.power_w for p, a in zip(points, answers, strict=True)),
        answers=answers,
        travel_share=max(a.travel_m for a in answers) / harvester.travel_limit_m,
        stress_share=max(a.stress_pa for a in answers) / harvester.stress_limit_pa,
    )
