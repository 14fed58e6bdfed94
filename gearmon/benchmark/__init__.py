"""Run time, memory and error, measured side by side with named competitors.

A table of cases, and one way to run each, to tell it in few rows, and to draw it. What all of them
share, taking tasks in turn, is in `timing`.

>>> from gearmon.benchmark import CASES, PICTURED
>>> list(CASES)[:3], PICTURED
(['analyse', 'memory', 'stiffness'], ('dynamics', 'detection'))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from inspect import signature
from typing import Any

from gearmon.benchmark.timing import Row, facts_of_run
from gearmon.errors import ArgumentError
from gearmon.terminal import Progress

__all__ = ["CASES", "PICTURED", "case_figures", "run_case", "summary_rows"]


@dataclass(frozen=True)
class _Case:
    """Where a benchmark is made: "module:function" within this room.

    Parameters
    ----------
    run : str
        Takes those of the options that it names, and gives rows.
    summary : str
        Takes rows and gives those that a terminal shows; "" shows all, without what they ran on.
    figures : str
        Function of `plots` that takes rows and gives matplotlib figures by name ("" for the only
        one); "" has none.
    """

    run: str
    summary: str = ""
    figures: str = ""


CASES = {
    "analyse": _Case("tasks:analysis_against_reading"),
    "memory": _Case("tasks:memory_of_long_recording"),
    "stiffness": _Case("tasks:time_stiffness"),
    "harvesting": _Case("tasks:time_harvesting"),
    "dynamics": _Case("dynamics:run_dynamics", "dynamics:headlines", "dynamics_figures"),
    "stress": _Case("dynamics:run_stress", "dynamics:stress_summary"),
    "signals": _Case("tasks:run_signals"),
    "detection": _Case(
        "detection:run_detection", "detection:detection_summary", "detection_figures"
    ),
}
#: Cases that have pictures.
PICTURED = tuple(name for name, case in CASES.items() if case.figures)


def run_case(
    case: str,
    progress: Progress | None = None,
    *,
    quick: bool = False,
    seed: int = 0,
    count: int | None = None,
) -> list[Row]:
    """Run one benchmark.

    Parameters
    ----------
    case : str
        One of `CASES`.
    progress : callable, optional
        Called with the share done, 0 to 1.
    quick : bool
        Rough figures in seconds, for "harvesting", "dynamics", "stress", "signals" and
        "detection".
    seed : int
        Of what "dynamics", "stress" and "detection" draw.
    count : int, optional
        Number of random systems of "stress" (5,000 by default), of parameter sets of "dynamics"
        (10,000 by default), of machines of "detection" (60 by default).

    Returns
    -------
    list of dict
        Rows of figures, with machine and versions in each.

    Raises
    ------
    ArgumentError
        If there is no such case.
    """
    if case not in CASES:
        raise ArgumentError(f"benchmark case={case!r} must be one of {', '.join(CASES)}")
    run = _function(CASES[case].run)
    given = {"progress": progress, "quick": quick, "seed": seed}
    given |= {} if count is None else {"count": count}
    facts, names = facts_of_run(), signature(run).parameters
    rows = run(**{name: value for name, value in given.items() if name in names})
    return [row | facts for row in rows]


def summary_rows(case: str, rows: Sequence[Row]) -> list[Row]:
    """Return the few rows that a terminal shows of a benchmark.

    Parameters
    ----------
    case : str
        As given to `run_case`.
    rows : sequence of dict
        What it returned.

    Returns
    -------
    list of dict
    """
    if CASES[case].summary:
        return list(_function(CASES[case].summary)(rows))
    hidden = {*facts_of_run(), "fastest_s", "repeats"}
    return [{name: row[name] for name in row if name not in hidden} for row in rows]


def case_figures(case: str, rows: Sequence[Row]) -> dict[str, Any]:
    """Return the pictures of a benchmark, by what is added to the name of a file.

    Parameters
    ----------
    case : str
        As given to `run_case`.
    rows : sequence of dict
        What it returned.

    Returns
    -------
    dict of str to Figure

    Raises
    ------
    ArgumentError
        If this benchmark has no pictures.
    """
    if case not in PICTURED:
        raise ArgumentError(f"benchmark case={case!r} has no pictures; {', '.join(PICTURED)} have")
    drawn: dict[str, Any] = _function(f"plots:{CASES[case].figures}")(rows)
    return {f"-{name}" if name else "": figure for name, figure in drawn.items()}


def _function(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(":")
    found: Callable[..., Any] = getattr(import_module(f"gearmon.benchmark.{module}"), name)
    return found
