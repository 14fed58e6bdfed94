"""Tasks taken in turn, so that a drifting machine speed hits all."""

from __future__ import annotations

import io
import os
import platform
import re
import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from gearmon import __version__

Row = dict[str, Any]
Task = Callable[[], Any]
#: Packages whose versions are told.
_PACKAGES = ("numpy", "scipy", "pandas", "numba")
#: For rounds of long tasks, which are not cut short [s].
NO_LIMIT_S = 3600.0


class Timing(NamedTuple):
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
    result: Any = None

    @classmethod
    def of(cls, times_s: Sequence[float], result: Any = None) -> Timing:
        """Sum up run times [s]."""
        return cls(statistics.median(times_s), min(times_s), len(times_s), result)

    def columns(self) -> Row:
        """Return the columns median_s, fastest_s and repeats of a row."""
        return dict(zip(self._fields[:3], self[:3], strict=True))


def interleaved(tasks: Sequence[Task], most: int = 15, budget_s: float = 1.0) -> list[Timing]:
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
    first = [task_time(task) for task in tasks]
    # a first run also fills caches: it counts only where it is too dear to repeat
    times = [[elapsed] if elapsed > budget_s else [] for elapsed, _ in first]
    for _ in range(most):
        for task, taken in zip(tasks, times, strict=True):
            if sum(taken) < budget_s:
                taken.append(task_time(task)[0])
    return [Timing.of(taken, result) for taken, (_, result) in zip(times, first, strict=True)]


def task_time(task: Task) -> tuple[float, Any]:
    """Return the run time [s] of one run, and what it returned."""
    start = time.perf_counter()
    result = task()
    return time.perf_counter() - start, result


def facts_of_run() -> Row:
    """Return what the figures were measured on: processor, versions, threads of linear algebra."""
    told = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*:\s*(.+)", told.read_text("utf-8") if told.exists() else "")
    return {
        "processor": platform.machine(),
        "model": model[1] if model else "",
        "cores": os.cpu_count(),
        "blas_threads": os.environ.get("OPENBLAS_NUM_THREADS", "default"),
        "python": platform.python_version(),
        "gearmon": __version__,
        **{name: version(name) if find_spec(name) else "not installed" for name in _PACKAGES},
    }


def competitor(module: str) -> Any:
    """Import a module of a competitor, quietly: such libraries and their parts print on import."""
    nowhere = io.StringIO()
    with redirect_stdout(nowhere), redirect_stderr(nowhere), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return import_module(module)


def absent(name: str) -> str:
    """Say why there is no figure of a competitor."""
    return f"{name} not run: it is not installed; the extra gearmon[benchmark] brings it"
