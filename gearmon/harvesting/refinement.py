"""The largest power in natural frequency and load around one place, without regard to limits.

The load is found for every frequency from the answers to many loads at once, so that only the
frequency is searched.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from gearmon.harvesting.duty import OperatingShare
from gearmon.harvesting.gains import Harvester

Real = npt.NDArray[np.float64]
H = TypeVar("H", bound=Harvester)

#: Loads tried at once, over the whole range of loads and then about the best of them.
LOADS = 13
#: Natural frequencies about a place, in damping ratios from it.
OFFSETS = (-2.4, -1.2, -0.6, 0.6, 1.2)
#: Step at which the search for the natural frequency ends, in damping ratios.
LAST_STEP = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class Start(Generic[H]):
    """A tuned harvester with its best load, and its mean power without regard to limits [W]."""

    harvester: H
    power_w: float


@dataclass(frozen=True, eq=False)
class Heard:
    """All that shakes over a duty cycle in one row: frequencies, and mean squares times shares."""

    frequency_hz: Real
    weight_m2s4: Real

    @classmethod
    def over(cls, points: tuple[OperatingShare, ...], damping_ratio: float) -> Heard:
        """Gather all lines at all frequencies that they visit."""
        frequencies, weights = [], []
        for point in points:
            frequency, likely = point.vibration.nodes(damping_ratio)
            frequencies.append(frequency.ravel())
            weights.append(np.outer(likely, point.share * point.vibration.mean_square_m2s4).ravel())
        return cls(np.concatenate(frequencies), np.concatenate(weights))


def with_best_load(harvester: H, heard: Heard) -> Start[H]:
    """Choose the load that takes most, by a parabola through the best of many."""
    least, most = harvester.load_range
    exponent = np.linspace(math.log(least), math.log(most), LOADS)
    for _ in range(2):
        loads = np.exp(exponent)
        power = 2 * harvester.power_by_load(loads, heard.frequency_hz) @ heard.weight_m2s4
        top = int(np.argmax(power))
        step = exponent[1] - exponent[0]
        # the range is not left
        near = exponent[max(top - 1, 0)], exponent[min(top + 1, LOADS - 1)]
        exponent = np.linspace(*near, LOADS)
    load, power_w = float(loads[top]), float(power[top])
    if 0 < top < LOADS - 1:
        left, middle, right = (float(p) for p in power[top - 1 : top + 2])
        bend = left - 2 * middle + right
        if bend < 0:
            shift = 0.5 * (left - right) / bend
            load *= math.exp(shift * step)
            power_w = middle - 0.25 * (left - right) * shift
    return Start(harvester=harvester.with_load(load), power_w=power_w)


def begin(harvester: H, heard: Heard, frequency_hz: float) -> Start[H]:
    """Best of the resonance and, where it lies well apart, the antiresonance on a line."""
    low, high = harvester.frequency_range_hz
    stiffer = stiffening(harvester, frequency_hz)
    places = [frequency_hz]
    if stiffer > harvester.damping_ratio:
        places.append(frequency_hz / (1 + stiffer))
    tried = [
        with_best_load(harvester.retuned(min(max(place, low), high)), heard) for place in places
    ]
    return max(tried, key=lambda start: start.power_w)


def refined(start: Start[H], heard: Heard) -> Start[H]:
    """Move the natural frequency to where the power with the best load is largest nearby."""
    low, high = start.harvester.frequency_range_hz
    damping = start.harvester.damping_ratio
    middle = start.harvester.natural_frequency_hz

    def at(offset: float) -> Start[H]:
        frequency = min(max(middle * math.exp(damping * offset), low), high)
        return with_best_load(start.harvester.retuned(frequency), heard)

    tried = {0.0: start} | {offset: at(offset) for offset in OFFSETS}
    step = 0.6
    while step > LAST_STEP:
        best = max(tried, key=lambda offset: tried[offset].power_w)
        if best in (min(tried), max(tried)):
            step = 1.2
        else:
            step /= 2
        for offset in (best - step, best + step):
            if offset not in tried:
                tried[offset] = at(offset)
        if len(tried) > 40:
            break
    return max(tried.values(), key=lambda found: found.power_w)


def stiffening(harvester: Harvester, frequency_hz: float) -> float:
    """How far an open circuit raises the natural frequency, relative; 0 without a circuit."""
    low, high = harvester.frequency_range_hz
    tuned = harvester.retuned(min(max(frequency_hz, low), high))
    raised = getattr(tuned, "open_circuit_hz", tuned.natural_frequency_hz)
    return float(raised / tuned.natural_frequency_hz - 1)
