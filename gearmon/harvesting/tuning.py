"""The natural frequency and load that yield most over a whole spectrum and duty cycle.

Places worth a closer look (`starts`) are refined with the full response of the harvester
(`refinement`). Where the best breaks a limit of travel or stress, the best within is
sought (`limited`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.harvesting.answer import answer
from gearmon.harvesting.duty import OperatingShare, Shaking, check_duty
from gearmon.harvesting.evaluation import Tuned, evaluate
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.limited import largest_allowed
from gearmon.harvesting.refinement import Heard, Start, begin, refined
from gearmon.harvesting.starts import first_mode_starts, lightened, other_starts

Real = npt.NDArray[np.float64]
H = TypeVar("H", bound=Harvester)

#: Places that are refined.
PLACES = 6
#: A place is passed over if its power with the best load, this many times, is below the best.
PRUNED_FROM = 1.6
#: What peaks are multiplied by, in turn, since the search merges bins that the answer does not.
MARGINS = (1.0, 1.01, 1.05)


class OverLimitsError(ArgumentError):
    """No tuning keeps within the limits of travel and stress.

    Attributes
    ----------
    over : float, > 1
        Peak over limit of the nearest: with that much less vibration it would hold.
    """

    def __init__(self, message: str, over: float) -> None:
        super().__init__(message)
        self.over = over


def tune_harvester(harvester: H, duty: Shaking, *, places: int = PLACES) -> Tuned[H]:
    """Tune natural frequency and load for the largest mean power over a duty cycle.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
        What is to be tuned; of its natural frequency only the allowed range matters.
    duty : Vibration, Signature, OperatingShare or sequence of OperatingShare
        What shakes it: one vibration, the lines of a signature, or several with their shares of
        the time.
    places : int, 1 to 50
        Most promising frequencies that are looked at closely.

    Returns
    -------
    Tuned
        The tuned harvester with its load, mean power [W], and its peaks over their limits.

    Raises
    ------
    ArgumentError
        If nothing vibrates within reach, or no tuning keeps travel and stress within their limits;
        the message names the nearest that does.

    Examples
    --------
    >>> from gearmon.harvesting import InertialHarvester, vibration_of_lines
    >>> shaking = vibration_of_lines([120.0, 312.0], acceleration_ms2=[0.2, 0.8])
    >>> found = tune_harvester(InertialHarvester(mass_kg=5e-3, natural_frequency_hz=100.0), shaking)
    >>> round(found.harvester.natural_frequency_hz), round(1e6 * found.power_w)
    (312, 10)
    """
    return candidates(harvester, duty, places=places)[0]


def candidates(harvester: H, duty: Shaking, *, places: int = PLACES) -> list[Tuned[H]]:
    """All closely looked-at tunings, the best first; same arguments and errors as above."""
    check_range("places", places, 1, 50)
    points = check_duty(duty)
    light = lightened(harvester, points)
    heard = Heard.over(light, harvester.damping_ratio)
    free = _free(harvester, light, heard, int(places))
    tuned = [evaluate(start.harvester, points) for start in free]
    allowed = [t for t in tuned if t.within_limits]
    # limits only take power away
    if not tuned[0].within_limits:
        for margin in MARGINS:
            limited = largest_allowed(harvester, light, heard, free, margin)
            found = [evaluate(one.harvester, points) for one in limited]
            tuned += found
            allowed += [t for t in found if t.within_limits]
            if any(t.within_limits for t in found):
                break
    if not allowed:
        raise OverLimitsError(*_refusal(tuned))
    return sorted(allowed, key=lambda t: -t.power_w)


def power_against_tuning(harvester: H, duty: Shaking, frequency_hz: npt.ArrayLike) -> Real:
    """Mean power [W] of the harvester retuned to each frequency, its load as it is.

    Parameters
    ----------
    frequency_hz : array, shape (n,)
        Within the range that the harvester can reach.
    """
    points = lightened(harvester, check_duty(duty))
    wanted = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return np.array([_mean(harvester.retuned(float(f)), points) for f in wanted])


def _free(
    harvester: H, light: tuple[OperatingShare, ...], heard: Heard, places: int
) -> list[Start[H]]:
    """Refine the promising places without regard to limits, the best first."""
    frequencies = [*first_mode_starts(harvester, light, places), *other_starts(harvester, light)]
    begun = sorted((begin(harvester, heard, f) for f in frequencies), key=lambda s: -s.power_w)
    found: list[Start[H]] = []
    for start in begun[: places + 1]:
        best = max((f.power_w for f in found), default=0.0)
        if PRUNED_FROM * start.power_w >= best or len(found) < 2:
            found.append(refined(start, heard))
    return sorted(found, key=lambda s: -s.power_w)


def _mean(harvester: Harvester, points: tuple[OperatingShare, ...]) -> float:
    return math.fsum(point.share * answer(harvester, point.vibration).power_w for point in points)


def _refusal(tuned: Sequence[Tuned[Any]]) -> tuple[str, float]:
    """Name the nearest tuning, and how far it is over its limit."""
    nearest = min(tuned, key=lambda t: max(t.travel_share, t.stress_share))
    harvester = nearest.harvester
    over = max(nearest.travel_share, nearest.stress_share)
    if nearest.travel_share >= nearest.stress_share:
        limit = 1e3 * harvester.travel_limit_m
        return (
            f"no tuning keeps the mass within its clearance of {limit:.3g} mm: the nearest, "
            f"{harvester.natural_frequency_hz:.4g} Hz, travels {over * limit:.3g} mm; allow that, "
            "or a smaller mass",
            over,
        )
    limit = harvester.stress_limit_pa / 1e6
    return (
        f"no tuning keeps the stress within {limit:.3g} MPa: the nearest, "
        f"{harvester.natural_frequency_hz:.4g} Hz, reaches {over * limit:.3g} MPa; use a thicker "
        "or shorter beam, or a lighter tip mass",
        over,
    )
