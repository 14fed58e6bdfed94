"""Run times of several tasks taken in turn, so that a drifting machine speed hits all of them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from gearmon.errors import check_range


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Run times of one task.

    Parameters
    ----------
    median_s, fastest_s : float
        Over `repeats` runs [s].
    repeats : int
    result : object
        What the last run returned.
    """

    median_s: float
    fastest_s: float
    repeats: int
    result: Any


def interleaved(
    tasks: Sequence[Callable[[], Any]], most: int = 15, budget_s: float = 1.0
) -> list[Timing]:
    """Run every task once a round, round after round.

    Parameters
    ----------
    tasks : sequence of callables
        Without arguments. Each is run once before, unless that one run takes the whole budget.
    most : int, >= 1
        Rounds.
    budget_s : float, > 0
        A task that has used this up runs no more; it has run at least once.

    Returns
    -------
    list of Timing
        In the order of the tasks.
    """
    check_range("most", most, 1, 10_000)
    results = [task_time(task) for task in tasks]
    first = [elapsed for elapsed, _ in results]
    # a first run also fills caches: it counts only where it is too dear to repeat
    times: list[list[float]] = [[t] if t > budget_s else [] for t in first]
    spent = [t if t > budget_s else 0.0 for t in first]
    for _ in range(most):
        for number, task in enumerate(tasks):
            if spent[number] < budget_s:
                elapsed, _ = task_time(task)
                times[number].append(elapsed)
                spent[number] += elapsed
    return [
        Timing(
            median_s=statistics.median(taken),
            fastest_s=min(taken),
            repeats=len(taken),
            result=result,
        )
        for taken, (_, result) in zip(times, results, strict=True)
    ]


def task_time(task: Callable[[], Any]) -> tuple[float, Any]:
    """Return the run time [s] of one run, and what it returned."""
    start = time.perf_counter()
    result = task()
    return time.perf_counter() - start, result
