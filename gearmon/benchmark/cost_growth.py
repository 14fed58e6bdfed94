"""Run time of one steady vibration over its number of unknowns.

The stiffness dips once in P mesh periods, P growing; natural frequency, damping and harmonics a
mesh stay, so the number of unknowns grows in proportion to P and nothing else changes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from gearmon.benchmark import rivals
from gearmon.benchmark.contenders import OURS, TARGET
from gearmon.benchmark.dynamics_cases import growing_turn
from gearmon.benchmark.timing import Timing, interleaved
from gearmon.dynamics import HillProblem, Response, steady_state

Row = dict[str, Any]
MESHES = tuple(2**power for power in range(12))
QUICK = (1, 8, 32)
#: Below, the run time is that of calls and not of numbers.
FIRST_FITTED = 2000
BANDED_BYTES = 3e8


def growth_rows(quick: bool = False) -> list[Row]:
    """Time `steady_state` and solve_banded on the same harmonics over growing periods.

    Parameters
    ----------
    quick : bool
        Three small sizes.

    Returns
    -------
    list of dict
        The columns of `gearmon.benchmark.dynamics.case_rows`, and `exponent`: that of a power of
        the unknowns fitted to the run times of a method at 2,000 unknowns and above.
    """
    tasks: list[tuple[str, str, int, Callable[[], Any]]] = []
    bounds: list[Response | None] = []
    for meshes in QUICK if quick else MESHES:
        problem = growing_turn(meshes)
        response = steady_state(problem, TARGET)
        unknowns = len(response.displacement)
        setting = f"{meshes} meshes"
        tasks.append((OURS, setting, unknowns, partial(steady_state, problem, TARGET)))
        bounds.append(response)
        if rivals.banded_bytes(len(problem.stiffness_harmonics), unknowns) < BANDED_BYTES:
            tasks.append(("solve_banded", setting, unknowns, _banded(problem, unknowns - 1)))
            bounds.append(None)
    timings = interleaved(
        [run for *_, run in tasks], most=3 if quick else 15, budget_s=0.05 if quick else 2.0
    )
    rows = [
        _row(task, timing, bound)
        for task, timing, bound in zip(tasks, timings, bounds, strict=True)
    ]
    exponents = {
        method: fitted_exponent([row for row in rows if row["method"] == method])
        for method in (OURS, "solve_banded")
    }
    return [row | {"exponent": exponents[row["method"]]} for row in rows]


def _banded(problem: HillProblem, highest: int) -> Callable[[], Any]:
    bands = rivals.band(problem.stiffness_harmonics, highest)
    return partial(rivals.solve_band, bands, problem.frequency_ratio, problem.damping_ratio)


def _row(
    task: tuple[str, str, int, Callable[[], Any]], timing: Timing, response: Response | None
) -> Row:
    method, setting, unknowns, _ = task
    return {
        "method": method,
        "group": "gearmon" if method == OURS else "banded",
        "setting": setting,
        "wanted": TARGET if response is not None else None,
        "error": None,
        "error_bound": response.error_bound if response is not None else None,
        "median_s": timing.median_s,
        "fastest_s": timing.fastest_s,
        "repeats": timing.repeats,
        "unknowns": unknowns,
        "sets": 1,
        "exponent": None,
        "note": "",
    }


def fitted_exponent(rows: Sequence[Row], least: int = FIRST_FITTED) -> float | None:
    """Exponent p of median_s ~ unknowns^p, or None with fewer than three rows to fit.

    Examples
    --------
    >>> rows = [{"unknowns": n, "median_s": 1e-6 * n**1.5} for n in (3000, 9000, 30000)]
    >>> round(fitted_exponent(rows), 6)
    1.5
    """
    kept = [(row["unknowns"], row["median_s"]) for row in rows if row["unknowns"] >= least]
    if len(kept) < 3:
        return None
    x, y = np.log(np.array(kept)).T
    return float(np.polyfit(x, y, 1)[0])
