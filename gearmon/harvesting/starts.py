"""Where a closer look is worth it: natural frequencies that bring a resonance onto loud lines.

A Lorentzian of the matched width passed over all lines names the places for the first mode; a rough
scan with the full response, and the lines that a higher mode can be brought onto, name the others.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from gearmon.harvesting.duty import OperatingShare
from gearmon.harvesting.gains import Harvester

Real = npt.NDArray[np.float64]

#: Natural frequencies of the rough scan for higher modes.
BROADLY_SCANNED = 60
#: Loud lines that a higher mode is brought onto.
LINES_FOR_HIGHER_MODES = 12
#: Lines more than this many bins an eighth of a resonance apart are merged for the search.
MOST_LINES = 3000


def lightened(
    harvester: Harvester, points: tuple[OperatingShare, ...]
) -> tuple[OperatingShare, ...]:
    """Merge bins that lie within an eighth of a resonance, and drop what no tuning can use."""
    low, high = harvester.frequency_range_hz
    width = harvester.damping_ratio / 8
    kept = []
    for point in points:
        # far below its range a harvester only follows; its third mode lies 30 times above the first
        v = point.vibration.cut(low / 4, high * 40)
        if len(v.frequency_hz) > MOST_LINES:
            group = np.floor(np.log(v.frequency_hz) / width).astype(np.int64)
            starts = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
            power = np.add.reduceat(v.mean_square_m2s4, starts)
            moment = np.add.reduceat(v.mean_square_m2s4 * v.frequency_hz, starts)
            # what is cut holds no bin without power
            v = type(v)(
                frequency_hz=moment / power,
                mean_square_m2s4=power,
                resolution_hz=v.resolution_hz,
                wander=v.wander,
                name=v.name,
            )
        kept.append(OperatingShare(vibration=v, share=point.share))
    return tuple(kept)


def first_mode_starts(
    harvester: Harvester, points: tuple[OperatingShare, ...], places: int
) -> list[float]:
    """Local maxima of the power that a matched resonance would take [Hz], the best first."""
    low, high = harvester.frequency_range_hz
    damping = harvester.damping_ratio
    count = min(20_000, max(2, math.ceil(2 * math.log(high / low) / damping)) + 1)
    near = [p.vibration.frequency_hz for p in points]
    loudest = [
        f[np.argsort(-p.vibration.energy_j_per_kg)[:100]] for f, p in zip(near, points, strict=True)
    ]
    lines = np.concatenate(loudest)
    grid = np.geomspace(low, high, count)
    grid = np.unique(np.concatenate([grid, lines[(lines >= low) & (lines <= high)]]))
    worth = np.zeros(len(grid))
    for point in points:
        worth += point.share * _matched(grid, point, damping)
    worth *= _bounds(harvester, grid)
    inside = np.concatenate([[-1.0], worth, [-1.0]])
    tops = np.flatnonzero((inside[1:-1] >= inside[:-2]) & (inside[1:-1] > inside[2:]))
    order = tops[np.argsort(-worth[tops], kind="stable")]
    return [float(f) for f in grid[order[:places]]]


def other_starts(harvester: Harvester, points: tuple[OperatingShare, ...]) -> list[float]:
    """Best of a rough scan with the full response, and higher modes on loud lines [Hz]."""
    scanned = np.geomspace(*harvester.frequency_range_hz, BROADLY_SCANNED)
    tuned = [harvester.retuned(float(natural)) for natural in scanned]
    power = []
    for candidate in tuned:
        loads = np.geomspace(*candidate.load_range, 9)[2:-2]
        found = np.zeros(len(loads))
        for point in points:
            v = point.vibration
            gains = candidate.power_by_load(loads, v.frequency_hz)
            found += point.share * (gains @ v.mean_square_m2s4)
        power.append(float(found.max()))
    resonances = np.array([candidate.resonances_hz for candidate in tuned])
    return [float(scanned[int(np.argmax(power))]), *_higher_modes(scanned, resonances, points)]


def _higher_modes(
    natural: Real, resonances: Real, points: tuple[OperatingShare, ...]
) -> list[float]:
    """Natural frequencies for which a higher resonance meets one of the loudest lines there."""
    frequency = np.concatenate([p.vibration.frequency_hz for p in points])
    weight = np.concatenate([p.share * p.vibration.mean_square_m2s4 for p in points])
    found: list[float] = []
    for mode in resonances.T[1:]:
        within = np.flatnonzero((frequency >= mode[0]) & (frequency <= mode[-1]))
        loudest = within[np.argsort(-weight[within] / frequency[within])][:LINES_FOR_HIGHER_MODES]
        found += np.interp(frequency[loudest], mode, natural).tolist()
    return found


def _matched(grid: Real, point: OperatingShare, damping: float) -> Real:
    """Sum of the mean squares under a Lorentzian of twice the damping, widened by the wander."""
    v = point.vibration
    width = 2 * damping + 1.2 * v.wander
    height = 2 * damping / width
    found = np.zeros(len(grid))
    for part in np.array_split(
        np.arange(len(grid)), 1 + len(grid) * len(v.frequency_hz) // 4_000_000
    ):
        detuned = (v.frequency_hz / grid[part, None] - 1) / width
        found[part] = (height / (1 + detuned**2)) @ v.mean_square_m2s4
    return found


def _bounds(harvester: Harvester, grid: Real) -> Real:
    """Largest power by natural frequency, read off between a few tunings."""
    few = np.geomspace(grid[0], grid[-1], 12)
    few[0], few[-1] = grid[0], grid[-1]
    known = np.log([harvester.retuned(float(f)).power_bound_w() for f in few])
    return np.asarray(np.exp(np.interp(np.log(grid), np.log(few), known)))
