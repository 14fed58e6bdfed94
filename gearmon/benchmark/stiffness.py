"""Run times of mesh stiffness: contact positions of a sound pair, a turn with a cracked tooth."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from gearmon.gears.faults import Fault, parse_fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.potential_energy import teeth_of
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.machine import ParallelStage

#: The pair that is timed.
STAGE = ParallelStage(
    pinion_teeth=26,
    gear_teeth=53,
    module_mm=2.0,
    face_width_mm=20.0,
    bore_diameter_pinion_mm=20.8,
    bore_diameter_gear_mm=42.4,
)
CRACK = "crack:1:pinion:5:1.5mm"
FORM = "potential-energy"


@dataclass(frozen=True, kw_only=True)
class StiffnessTiming:
    """Run time of one task.

    Parameters
    ----------
    case : str
        What was computed, from gear data to numbers.
    positions : int
        Contact positions or samples that came out.
    median_s, fastest_s : float
        Over `repeats`, after a warm-up [s].
    repeats : int
    positions_per_s : float
    times_healthy : float or None
        Median over that of one healthy mesh period, where that is the measure.
    """

    case: str
    positions: int
    median_s: float
    fastest_s: float
    repeats: int
    positions_per_s: float
    times_healthy: float | None = None

    def to_dict(self) -> dict[str, object]:
        """Return the row in built-in types."""
        return asdict(self)


def time_stiffness(repeats: int = 25) -> tuple[StiffnessTiming, ...]:
    """Return the run times of mesh stiffness by the energy of the teeth.

    Parameters
    ----------
    repeats : int, >= 1

    Returns
    -------
    tuple of StiffnessTiming
        1,000 contact positions of a sound pair; one healthy mesh period at 200 positions; one
        turn of the pinion with a cracked tooth at 200 positions a mesh; 1,000 harmonics of that.
    """
    crack = [parse_fault(CRACK)]
    healthy = _timed("healthy mesh period", lambda: _sample([]), repeats)
    cracked = _timed("pinion turn, one cracked tooth", lambda: _sample(crack), repeats)
    ratio = cracked.median_s / healthy.median_s
    return (
        _timed("contact positions, sound pair", _positions, repeats),
        healthy,
        StiffnessTiming(**(asdict(cracked) | {"times_healthy": ratio})),
        _timed("harmonics, one cracked tooth", lambda: _harmonics(crack), repeats),
    )


def _positions() -> int:
    pair = teeth_of(mesh_pairs(STAGE)[0])
    phase = np.linspace(0.0, pair.contact_ratio, 1000)
    return len(pair.compliances(pair.roll(phase)).stiffness)


def _sample(faults: list[Fault]) -> int:
    return len(mesh_stiffness(STAGE, faults, FORM).sample(200))


def _harmonics(faults: list[Fault]) -> int:
    return len(mesh_stiffness(STAGE, faults, FORM).harmonics(1000))


def _timed(case: str, task: Callable[[], int], repeats: int) -> StiffnessTiming:
    positions = task()
    times = []
    for _ in range(max(1, repeats)):
        start = time.perf_counter()
        task()
        times.append(time.perf_counter() - start)
    median = statistics.median(times)
    return StiffnessTiming(
        case=case,
        positions=positions,
        median_s=median,
        fastest_s=min(times),
        repeats=len(times),
        positions_per_s=positions / median,
    )
