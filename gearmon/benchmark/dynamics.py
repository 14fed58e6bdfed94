"""Methods for the steady vibration of a gear mesh: run time against error on named cases.

Each method runs with several settings on each case; the error is the relative L2 error of the
acceleration against an accurate motion that no method shares. At one error all are set side by
side. Rivals know more than a user would: their steps and tolerances are tuned on the accurate
motion, the time that free vibrations need to settle is told to them, and (but for SciPy "as usually
written") they begin in the static deflection and read stiffness from tables made beforehand.
`steady_state` knows its tolerance only, and its time contains its error bound.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from gearmon import __version__
from gearmon.benchmark.collocation import Lines, Reference, solve_reference
from gearmon.benchmark.contenders import (
    AS_USUAL,
    CUT_OFF,
    FROM_REST,
    OURS,
    TARGET,
    Contender,
    contenders,
)
from gearmon.benchmark.cost_growth import growth_rows
from gearmon.benchmark.dynamics_cases import CASES, QUICK, Case, named_case
from gearmon.benchmark.dynamics_sweep import SETS_AT_ONCE, sweep_rows
from gearmon.benchmark.rivals import ODEINT, SOLVERS
from gearmon.benchmark.timing import Timing, interleaved
from gearmon.benchmark.whole_process import machine_facts
from gearmon.terminal import Progress

Row = dict[str, Any]

#: What others are compared with: the first of these that a case has.
BASES = (SETS_AT_ONCE, "exact pieces", OURS)
WANTED = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
SWEEP = "parameter sets"
GROWTH = "cost growth"


def run_dynamics(
    quick: bool = False,
    cases: Sequence[str] | None = None,
    seed: int = 0,
    sets: int = 10_000,
    progress: Progress | None = None,
) -> list[Row]:
    """Time all methods on named cases, on many parameter sets, and over growing sizes.

    Parameters
    ----------
    quick : bool
        Few cases, settings and repeats: seconds in place of minutes. The figures are then rough.
    cases : sequence of str, optional
        Names of cases, "parameter sets" or "cost growth"; all by default.
    seed : int
        Of the parameter sets.
    sets : int, >= 1
        Number of parameter sets.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row a method and setting, with machine and versions in each. `median_s` is the run time
        [s] of one solution, of a sweep that of one set; `times_ours` is it over ours at 1e-6 in the
        same case (of the true rectangle the exact pieces, of parameter sets `sweep`), and
        `times_ours_fastest` the same of the fastest runs, which a busy machine disturbs less;
        `at_target` marks each method's cheapest row with an error within 1e-6.

    Raises
    ------
    ArgumentError
        If there is no such case.
    """
    names = list(cases) if cases is not None else _default_names(quick)
    facts = facts_of_run()
    rows: list[Row] = []
    for number, name in enumerate(names):
        if name == SWEEP:
            found = sweep_rows(200 if quick else sets, seed, quick=quick)
        elif name == GROWTH:
            found = growth_rows(quick=quick)
        else:
            found = case_rows(named_case(name), quick=quick)
        for group in _by_size(found) if name == GROWTH else [found]:
            rows += [{"case": name, **row, **facts} for row in _with_ratios(group)]
        if progress is not None:
            progress((number + 1) / len(names))
    return rows


def _by_size(rows: list[Row]) -> list[list[Row]]:
    """Group rows of the same setting: sizes are compared each by itself."""
    settings = dict.fromkeys(row["setting"] for row in rows)
    return [[row for row in rows if row["setting"] == setting] for setting in settings]


def _default_names(quick: bool) -> list[str]:
    return [*(QUICK if quick else CASES), SWEEP, GROWTH]


def case_rows(case: Case, quick: bool = False) -> list[Row]:
    """Time all methods on one case; see `run_dynamics`.

    Parameters
    ----------
    case : Case
    quick : bool
        Two errors wanted, two solvers, three repeats.
    """
    reference = solve_reference(case)
    solvers = (ODEINT, "DOP853") if quick else (*SOLVERS, ODEINT)
    wanted = (1e-3, TARGET) if quick else WANTED
    listed = contenders(case, reference, wanted, solvers)
    running = [one for one in listed if one.run is not None]
    timings = interleaved(
        [one.run for one in running if one.run is not None],
        most=3 if quick else 31,
        budget_s=0.05 if quick else 0.6,
    )
    timed = dict(zip(map(id, running), timings, strict=True))
    return [_row(one, timed.get(id(one)), reference) for one in listed]


def _row(one: Contender, timing: Timing | None, reference: Reference) -> Row:
    row: Row = {
        "method": one.method,
        "group": one.group,
        "setting": one.setting,
        "wanted": one.wanted,
        "error": None,
        "error_bound": None,
        "median_s": None,
        "fastest_s": None,
        "repeats": 0,
        "unknowns": None,
        "sets": 1,
        "exponent": None,
        "note": one.note,
    }
    if timing is None:
        return row
    motion = one.motion(timing.result)
    values = motion.displacement if isinstance(motion, Lines) else motion.share
    bound = getattr(timing.result, "error_bound", None)
    if one.note == CUT_OFF or bound is None or math.isinf(bound):
        bound = None  # an endless bound is no number in JSON
    return row | {
        "error": reference.error(motion),
        "error_bound": bound,
        "median_s": timing.median_s,
        "fastest_s": timing.fastest_s,
        "repeats": timing.repeats,
        "unknowns": len(values),
    }


def _with_ratios(rows: list[Row]) -> list[Row]:
    """Add the run time over ours, and mark each method's cheapest row at the target."""
    at_target = {row["method"]: row for row in rows if row["wanted"] == TARGET}
    ours = next((at_target[name] for name in BASES if name in at_target), None)

    def over_ours(row: Row, column: str) -> float | None:
        return row[column] / ours[column] if ours and ours[column] and row[column] else None

    cheapest: dict[str, Row] = {}
    for row in rows:
        if row["median_s"] is None or row["error"] is None or row["error"] > TARGET:
            continue
        # of ours the row that a user gets who asks for this error, not one that is lucky
        if row["method"] == OURS and row["wanted"] != TARGET:
            continue
        known = cheapest.get(row["method"])
        if known is None or row["median_s"] < known["median_s"]:
            cheapest[row["method"]] = row
    chosen = {id(row) for row in cheapest.values()}
    return [
        row
        | {
            "times_ours": over_ours(row, "median_s"),
            "times_ours_fastest": over_ours(row, "fastest_s"),
            "at_target": id(row) in chosen,
        }
        for row in rows
    ]


def headlines(rows: Sequence[Row]) -> list[Row]:
    """One line a case: our run time at 1e-6, and how many times longer the best rivals take.

    Parameters
    ----------
    rows : sequence of dict
        From `run_dynamics`.

    Returns
    -------
    list of dict
        Columns case, ours_us, error, then a factor a kind of rival (None where it has none), the
        name of SciPy's fastest solver, and `exponent` of the cost over the unknowns.
    """
    return [
        _headline(name, [row for row in rows if row["case"] == name])
        for name in dict.fromkeys(row["case"] for row in rows)
    ]


def _headline(name: str, rows: list[Row]) -> Row:
    at_target = [row for row in rows if row["at_target"]]
    ours = next((row for row in at_target if row["times_ours"] == 1.0), None)

    def best(chosen: list[Row]) -> Row | None:
        return min(chosen, key=lambda row: float(row["median_s"]), default=None)

    def factor(row: Row | None) -> float | None:
        return None if row is None else row["times_ours"]

    rest = [row for row in at_target if row["group"] == FROM_REST]
    # odeint drives its solver by compiled code and is listed apart from solve_ivp
    general = best([row for row in rest if not row["method"].endswith(ODEINT)])
    named = {row["method"]: row for row in at_target}
    return {
        "case": name,
        "ours_us": 1e6 * ours["median_s"] if ours else None,
        "error": ours["error"] if ours else None,
        "as_usual": factor(best([row for row in at_target if row["group"] == AS_USUAL])),
        "solve_ivp": factor(general),
        "solver": general["method"] if general else "",
        "odeint": factor(best([row for row in rest if row["method"].endswith(ODEINT)])),
        "scipy_shooting": factor(named.get("SciPy DOP853, shooting")),
        "rk4_from_rest": factor(named.get("compiled RK4 from rest")),
        "rk4_shooting": factor(named.get("compiled RK4, shooting")),
        "solve_banded": factor(named.get("solve_banded")),
        "exponent": next((row["exponent"] for row in rows if row.get("exponent")), None),
    }


def facts_of_run() -> Row:
    """Return machine and versions, as in every row."""
    return {
        **machine_facts(),
        "model": _processor_model(),
        "numba": _version_of("numba"),
        "gearmon": __version__,
        "blas_threads": os.environ.get("OPENBLAS_NUM_THREADS", "default"),
    }


def _processor_model() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return ""
    named = [line.partition(":")[2].strip() for line in text.splitlines() if "model name" in line]
    return named[0] if named else ""


def _version_of(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
