"""Run times of mesh stiffness: contact positions of a sound pair, a turn with a cracked tooth."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

from gearmon.benchmark.beside_ross import NEEDS, VARIABLE, RossRun, ross_python, run_against_ross
from gearmon.gears.faults import Fault, parse_fault
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
#: A pair with published stiffness by ROSS.
PUBLISHED = ParallelStage(
    pinion_teeth=25,
    gear_teeth=30,
    module_mm=2.0,
    face_width_mm=20.0,
    bore_diameter_pinion_mm=20.0,
    bore_diameter_gear_mm=20.0,
)
CRACK = "crack:1:pinion:5:1.5mm"
FORM = "potential-energy"
POSITIONS = 1000


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
        Median over that of one healthy mesh period taken in turn, where that is the measure.
    ross_median_s : float or None
        The same positions by ROSS, taken in turn [s].
    ross_times_slower : float or None
        Ratio of the medians.
    ross_difference : float or None
        Greatest relative difference of the stiffness, at the same contacts.
    note : str
    """

    case: str
    positions: int
    median_s: float
    fastest_s: float
    repeats: int
    positions_per_s: float
    times_healthy: float | None = None
    ross_median_s: float | None = None
    ross_times_slower: float | None = None
    ross_difference: float | None = None
    note: str = ""

    def to_dict(self) -> dict[str, object]:
        """Return the row in built-in types."""
        return asdict(self)


def time_stiffness(repeats: int = 25, python: str | None = None) -> tuple[StiffnessTiming, ...]:
    """Return the run times of mesh stiffness by the energy of the teeth.

    Parameters
    ----------
    repeats : int, >= 1
    python : str, optional
        Interpreter of an environment with ROSS; by default the environment variable
        GEARMON_ROSS_PYTHON. Without one the rows say so.

    Returns
    -------
    tuple of StiffnessTiming
        One healthy mesh period at 200 positions; one turn of the pinion with a cracked tooth at
        200 positions a mesh; 1,000 harmonics of that; then 1,000 positions of a healthy mesh
        period, for two pairs, beside ROSS.

    Raises
    ------
    ArgumentError
        If `python` is no interpreter with ROSS.
    """
    other = ross_python(python)
    crack = [parse_fault(CRACK)]
    healthy, cracked = _in_turn(lambda: _sample([]), lambda: _sample(crack), repeats)
    ratio = statistics.median(cracked) / statistics.median(healthy)
    turn = 200 * STAGE.pinion_teeth
    harmonics = _times(lambda: _harmonics(crack), repeats)
    return (
        _row("healthy mesh period", 200, healthy),
        replace(_row("pinion turn, one cracked tooth", turn, cracked), times_healthy=ratio),
        _row("harmonics, one cracked tooth", 1000, harmonics),
        *(_beside_ross(stage, other, repeats) for stage in (STAGE, PUBLISHED)),
    )


def _beside_ross(stage: ParallelStage, python: str | None, repeats: int) -> StiffnessTiming:
    case = f"contact positions, sound pair {stage.pinion_teeth}/{stage.gear_teeth}"
    if python is None:
        row = _row(case, POSITIONS, _times(lambda: _positions(stage), repeats))
        note = f"ROSS not run: {VARIABLE} names no interpreter of an environment with {NEEDS}"
        return replace(row, note=note)
    run = run_against_ross(python, stage, _positions, max(1, min(repeats, 7)))
    return replace(
        _row(case, run.positions, list(run.own_s)),
        ross_median_s=statistics.median(run.ross_s),
        ross_times_slower=run.ratio,
        ross_difference=run.difference,
        note=_ross_note(run),
    )


def _ross_note(run: RossRun) -> str:
    theirs, own = run.contact_ratios
    return (
        f"ROSS {run.version}: contact ratio {theirs:.6g}, one pair {run.single_n_per_m:.4g} N/m, "
        f"two pairs {run.double_n_per_m:.4g} N/m by the classical sum; here {own:.6g}, "
        f"{run.own_single_n_per_m:.4g} and {run.own_double_n_per_m:.4g} N/m with shared bodies"
    )


def _positions(stage: ParallelStage) -> int:
    return len(mesh_stiffness(stage, (), FORM).sample(POSITIONS))


def _sample(faults: list[Fault]) -> int:
    return len(mesh_stiffness(STAGE, faults, FORM).sample(200))


def _harmonics(faults: list[Fault]) -> int:
    return len(mesh_stiffness(STAGE, faults, FORM).harmonics(1000))


def _in_turn(
    one: Callable[[], int], other: Callable[[], int], repeats: int
) -> tuple[list[float], list[float]]:
    """Time two tasks in turn, so that a drifting machine speed hits both."""
    one(), other()
    first, second = [], []
    for _ in range(max(1, repeats)):
        first.append(_elapsed(one))
        second.append(_elapsed(other))
    return first, second


def _times(task: Callable[[], int], repeats: int) -> list[float]:
    task()
    return [_elapsed(task) for _ in range(max(1, repeats))]


def _elapsed(task: Callable[[], int]) -> float:
    start = time.perf_counter()
    task()
    return time.perf_counter() - start


def _row(case: str, positions: int, times: list[float]) -> StiffnessTiming:
    median = statistics.median(times)
    return StiffnessTiming(
        case=case,
        positions=positions,
        median_s=median,
        fastest_s=min(times),
        repeats=len(times),
        positions_per_s=positions / median,
    )
