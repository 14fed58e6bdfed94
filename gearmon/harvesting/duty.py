"""A duty cycle: vibrations and the share of time of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from gearmon.errors import ArgumentError
from gearmon.harvesting.vibration import Vibration, vibration_of_lines
from gearmon.signatures.signature import Signature


@dataclass(frozen=True, kw_only=True)
class OperatingShare:
    """One operating point of a duty cycle.

    Parameters
    ----------
    vibration : Vibration
    share : float, > 0 and <= 1
        Of the time.

    Raises
    ------
    ArgumentError
        If the share is out of its range.
    """

    vibration: Vibration
    share: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.share <= 1:
            raise ArgumentError(f"share={self.share} must lie in (0, 1]")


#: What may shake a harvester: one vibration, the lines of a signature, or several with their share.
Shaking = Vibration | Signature | OperatingShare | Sequence[OperatingShare]


def check_duty(duty: Shaking) -> tuple[OperatingShare, ...]:
    """Return what shakes a harvester as a duty cycle; one vibration alone lasts all the time.

    Raises
    ------
    ArgumentError
        If it is empty, its shares sum to more than 1, or something else stands in it.
    """
    points = _points(duty)
    if not points:
        raise ArgumentError("duty cycle: no operating point is given")
    for point in points:
        if not isinstance(point, OperatingShare):
            raise ArgumentError(
                f"duty cycle: {type(point).__name__} must be an OperatingShare, which gives a "
                "vibration its share of the time"
            )
    total = math.fsum(point.share for point in points)
    if total > 1 + 1e-6:
        raise ArgumentError(f"duty cycle: the shares sum to {total:.6g}, at most 1 is possible")
    return points


def _points(duty: Shaking) -> tuple[OperatingShare, ...]:
    if isinstance(duty, Vibration):
        return (OperatingShare(vibration=duty),)
    if isinstance(duty, Signature):
        return (OperatingShare(vibration=vibration_of_signature(duty)),)
    return (duty,) if isinstance(duty, OperatingShare) else tuple(duty)


def vibration_of_signature(
    signature: Signature, *, gain: float = 1.0, wander: float = 0.0, name: str = ""
) -> Vibration:
    """Vibration of the lines of a signature, expected or measured.

    Parameters
    ----------
    signature : Signature
    gain, wander, name
        See `vibration_of_lines`; the name is that of the machine if none is given.
    """
    return vibration_of_lines(
        signature["frequency_hz"],
        acceleration_ms2=signature["acceleration_ms2"],
        gain=gain,
        wander=wander,
        name=name or signature.machine,
    )
