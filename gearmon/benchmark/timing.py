"""Tasks taken in turn, so that a drifting machine speed hits all, and methods tuned to an error."""

from __future__ import annotations

import ctypes
import math
import os
import platform
import re
import statistics
import sys
import time
import warnings
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gearmon import __version__

if TYPE_CHECKING:
    from gearmon.benchmark.equations import Motion, Reference

Row = dict[str, Any]
Task = Callable[[], Any]
#: Takes what a task gave, and tells what is known of it.
Judge = Callable[[Any], Row]
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
    """Import a module of a competitor, quietly.

    Such libraries and their parts, some of them compiled, print on import: what goes past Python is
    turned away from where results are printed, and C must not keep it for later.
    """
    sys.stdout.flush()
    printed = os.dup(1)
    os.dup2(2, 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return import_module(module)
    finally:
        ctypes.CDLL(None).fflush(None)
        os.dup2(printed, 1)
        os.close(printed)


def absent(name: str) -> str:
    """Say why there is no figure of a competitor."""
    return f"{name} not run: it is not installed; the extra gearmon[benchmark] brings it"


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
    judge : callable
        Takes what `run` returned and gives the columns error, error_bound, unknowns or note, as
        far as they are known; not timed.
    note : str
    sets : int
        How many solutions one run makes.
    """

    method: str
    setting: str = ""
    wanted: float | None = None
    run: Callable[[], Any] | None = None
    judge: Judge = lambda _: {}
    note: str = ""
    sets: int = 1


def against(reference: Reference, motion: Callable[[Any], Motion] = lambda found: found) -> Judge:
    """Return what judges an answer, of which `motion` gives the motion, by an accurate motion."""

    def judge(found: Any) -> Row:
        own, bound = motion(found), getattr(found, "error_bound", math.inf)
        # an endless bound is no number in JSON
        row: Row = {"error_bound": bound if math.isfinite(bound) else None}
        return row | {"error": reference.error(own), "unknowns": len(own[0])}

    return judge


def measured(listed: Sequence[Contender], most: int, budget_s: float) -> list[Row]:
    """Run contenders in turn; one row each.

    Parameters
    ----------
    listed : sequence of Contender
    most : int
        Runs of each at most.
    budget_s : float
        Time for each [s].
    """
    tasks = {place: one.run for place, one in enumerate(listed) if one.run is not None}
    timed = dict(zip(tasks, interleaved(list(tasks.values()), most, budget_s), strict=True))
    unknown = dict.fromkeys(("error", "error_bound", "unknowns", "median_s", "fastest_s"))
    rows = []
    for place, one in enumerate(listed):
        row: Row = {"method": one.method, "setting": one.setting, "wanted": one.wanted} | unknown
        row |= {"exponent": None, "sets": one.sets, "note": one.note, "repeats": 0}
        if place in timed:
            median_s, fastest_s, repeats, result = timed[place]
            row |= {"median_s": median_s / one.sets, "fastest_s": fastest_s / one.sets}
            row |= {"repeats": repeats} | one.judge(result)
        rows.append(row)
    return rows


@dataclass(frozen=True, eq=False)
class Rival:
    """A method with one setting to be tuned: the greater, the smaller its error.

    Parameters
    ----------
    method, words : str
        Its name, and the setting in words.
    settings : sequence of float
        What may be set, ascending.
    ready : callable
        Takes a setting and gives the task, with all made that may be made beforehand.
    note : str
        Why it cannot run.
    """

    method: str
    words: str
    settings: Sequence[float]
    ready: Callable[[float], Callable[[], Any]]
    note: str = ""

    def tuned(self, wanted: float, judge: Judge, sets: int = 1) -> Contender:
        """Return the contender with the least setting whose error is within `wanted`."""
        if self.note:
            return Contender(self.method, wanted=wanted, note=self.note, sets=sets)

        def within(setting: float) -> bool:
            return bool(judge(self.ready(setting)())["error"] <= wanted)

        setting = self.settings[bisect_left(self.settings[:-1], True, key=within)]
        words, task = self.words.format(setting), self.ready(setting)
        return Contender(self.method, words, wanted, task, judge, sets=sets)


def about(first: float, whole: int = 0) -> list[float]:
    """Return settings three per cent apart, from a twentieth of one to twenty times it.

    Parameters
    ----------
    first : float, > 0
        What a search begins with.
    whole : int
        Settings are multiples of this; 0: any number.
    """
    settings = first * 1.03 ** np.arange(-102.0, 103.0)
    found: list[float] = (
        np.unique(whole * np.ceil(settings / whole)) if whole else settings
    ).tolist()
    return found
