"""Contenders of a benchmark of the equations of motion: run in turn, one row each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from gearmon.benchmark.equations import Lines, Reference, Samples
from gearmon.benchmark.timing import Timing, interleaved

Row = dict[str, Any]

#: Relative error at which methods are set side by side.
TARGET = 1e-6
OURS, SETS_AT_ONCE, COMPILED = "steady_state", "sweep", "compiled RK4"
CHART, FAMILY = "stability_chart", "fault_family"
#: What others are compared with: the first of these that a case has.
BASES = (SETS_AT_ONCE, OURS, CHART, FAMILY)
CUT_OFF = "the error is that against the true jumps; a bound would be that of the sum"
NOT_INSTALLED = "numba is not installed"


@dataclass(frozen=True, eq=False)
class Contender:
    """One method with one setting.

    Parameters
    ----------
    method : str
        Name in tables and pictures.
    setting : str
        Tolerance, order, steps or harmonics, in words.
    wanted : float or None
        Relative error aimed at, where the setting was made for one.
    run : callable or None
        What is timed; None if it cannot run, for the reason in `note`.
    motion : callable
        Takes what `run` returned and gives what its error is measured on; not timed.
    note : str
    sets : int
        How many solutions one run makes.
    error, error_bound, unknowns : float, float, int or None
        Where they are known before the run.
    """

    method: str
    setting: str = ""
    wanted: float | None = None
    run: Callable[[], Any] | None = None
    motion: Callable[[Any], Lines | Samples] = lambda found: found
    note: str = ""
    sets: int = 1
    error: float | None = None
    error_bound: float | None = None
    unknowns: int | None = None


def measured(
    listed: Sequence[Contender], most: int, budget_s: float, reference: Reference | None = None
) -> list[Row]:
    """Run contenders in turn; one row each, with the errors against a reference if there is one.

    Parameters
    ----------
    listed : sequence of Contender
    most : int
        Runs of each at most.
    budget_s : float
        Time for each [s].
    reference : Reference, optional
    """
    running = [one for one in listed if one.run is not None]
    timings = interleaved([one.run for one in running if one.run is not None], most, budget_s)
    timed = dict(zip(map(id, running), timings, strict=True))
    return [_row(one, timed.get(id(one)), reference) for one in listed]


def _row(one: Contender, timing: Timing | None, reference: Reference | None) -> Row:
    known = ("method", "setting", "wanted", "error", "error_bound", "unknowns", "sets", "note")
    row: Row = {name: getattr(one, name) for name in known}
    row |= {
        "median_s": timing.median_s / one.sets if timing else None,
        "fastest_s": timing.fastest_s / one.sets if timing else None,
        "repeats": timing.repeats if timing else 0,
        "exponent": None,
    }
    if timing is None or reference is None:
        return row
    motion = one.motion(timing.result)
    values = motion.displacement if isinstance(motion, Lines) else motion.share
    bound = getattr(timing.result, "error_bound", None)
    if one.note == CUT_OFF or bound is None or math.isinf(bound):
        bound = None  # an endless bound is no number in JSON
    return row | {"error": reference.error(motion), "error_bound": bound, "unknowns": len(values)}


def with_ratios(rows: list[Row]) -> list[Row]:
    """Add the run time over ours, and mark each method's cheapest row at the target."""
    at_target = {row["method"]: row for row in rows if row["wanted"] == TARGET}
    ours = next((at_target[name] for name in BASES if name in at_target), None)
    cheapest: dict[str, Row] = {}
    # of ours the row that a user gets who asks for this error, not one that is lucky
    judged = [
        row
        for row in rows
        if row["median_s"] is not None
        and row["error"] is not None
        and row["error"] <= TARGET
        and (row["method"] != OURS or row["wanted"] == TARGET)
    ]
    for row in sorted(judged, key=lambda row: float(row["median_s"])):
        cheapest.setdefault(row["method"], row)

    def over_ours(row: Row, column: str) -> float | None:
        return row[column] / ours[column] if ours and ours[column] and row[column] else None

    return [
        row
        | {
            "times_ours": over_ours(row, "median_s"),
            "times_ours_fastest": over_ours(row, "fastest_s"),
            "at_target": cheapest.get(row["method"]) is row,
        }
        for row in rows
    ]
