"""Methods for the steady vibration of a gear mesh: run time against error.

On named cases each method runs with several settings; the error is the relative L2 error of the
acceleration against an accurate motion that no method shares. At one error all are set side by
side. Rivals know more than a user would: their steps and tolerances are tuned on the accurate
motion, the time that free vibrations need to settle is told to them, and (but for SciPy "as usually
written") they begin in the static deflection and read stiffness from tables made beforehand.
`steady_state` knows its tolerance only, and its time contains its error bound.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from gearmon.benchmark.contenders import (
    AS_USUAL,
    CUT_OFF,
    FROM_REST,
    OURS,
    PROBES,
    SETS_AT_ONCE,
    TARGET,
    Contender,
    contenders,
    draw_sweep,
    growing_contenders,
    sweep_contenders,
)
from gearmon.benchmark.equations import CASES, QUICK, Case, named_case
from gearmon.benchmark.references import Lines, Reference, solve_reference
from gearmon.benchmark.rivals import ODEINT, SOLVERS
from gearmon.benchmark.timing import Timing, facts_of_run, interleaved
from gearmon.terminal import Progress

Row = dict[str, Any]

#: What others are compared with: the first of these that a case has.
BASES = (SETS_AT_ONCE, "exact pieces", OURS)
WANTED = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
SWEEP = "parameter sets"
GROWTH = "cost growth"
#: Below, the run time is that of calls and not of numbers.
FIRST_FITTED = 2000


def run_dynamics(
    quick: bool = False,
    cases: Sequence[str] | None = None,
    seed: int = 0,
    count: int = 10_000,
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
    count : int, >= 1
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
            found = sweep_rows(200 if quick else count, seed, quick=quick)
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
    listed = contenders(case, reference, (1e-3, TARGET) if quick else WANTED, solvers)
    return _measured(listed, 3 if quick else 31, 0.05 if quick else 0.6, reference)


def sweep_rows(count: int, seed: int, quick: bool = False) -> list[Row]:
    """Time all methods over the same parameter sets; run times are told a set.

    Parameters
    ----------
    count : int, >= 1
        Number of sets.
    seed : int
    quick : bool
        Few sets and repeats.
    """
    listed = sweep_contenders(draw_sweep(count, seed, 6 if quick else PROBES))
    return _measured(listed, 2 if quick else 9, 0.1 if quick else 3.0)


def growth_rows(quick: bool = False) -> list[Row]:
    """Time `steady_state` and solve_banded on the same harmonics over growing periods.

    Parameters
    ----------
    quick : bool
        Three small sizes.

    Returns
    -------
    list of dict
        The columns of `case_rows`, and `exponent`: that of a power of the unknowns fitted to the
        run times of a method at 2,000 unknowns and above.
    """
    listed = list(growing_contenders(quick))
    rows = _measured(listed, 3 if quick else 15, 0.05 if quick else 2.0)
    methods = {row["method"] for row in rows}
    fitted = {m: fitted_exponent([row for row in rows if row["method"] == m]) for m in methods}
    return [row | {"exponent": fitted[row["method"]]} for row in rows]


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


def _measured(
    listed: Sequence[Contender], most: int, budget_s: float, reference: Reference | None = None
) -> list[Row]:
    """Run contenders in turn; one row each, with the errors against a reference if there is one."""
    running = [one for one in listed if one.run is not None]
    timings = interleaved([one.run for one in running if one.run is not None], most, budget_s)
    timed = dict(zip(map(id, running), timings, strict=True))
    return [_row(one, timed.get(id(one)), reference) for one in listed]


def _row(one: Contender, timing: Timing | None, reference: Reference | None) -> Row:
    known = ("method", "group", "setting", "wanted", "error", "error_bound")
    row: Row = {name: getattr(one, name) for name in known}
    row |= {
        "median_s": timing.median_s / one.sets if timing else None,
        "fastest_s": timing.fastest_s / one.sets if timing else None,
        "repeats": timing.repeats if timing else 0,
    }
    row |= {"unknowns": one.unknowns, "sets": one.sets, "exponent": None, "note": one.note}
    if timing is None or reference is None:
        return row
    motion = one.motion(timing.result)
    values = motion.displacement if isinstance(motion, Lines) else motion.share
    bound = getattr(timing.result, "error_bound", None)
    if one.note == CUT_OFF or bound is None or math.isinf(bound):
        bound = None  # an endless bound is no number in JSON
    return row | {"error": reference.error(motion), "error_bound": bound, "unknowns": len(values)}


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
