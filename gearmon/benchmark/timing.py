"""Tasks taken in turn, so that a drifting machine speed hits all; here or in another Python."""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gearmon import __version__
from gearmon.errors import ArgumentError, check_range

#: Run by path with the interpreter of another environment.
SCRIPT = Path(__file__).with_name("other_python.py")


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
    result: Any = None

    @classmethod
    def of(cls, times_s: Sequence[float], result: Any = None) -> Timing:
        """Sum up run times [s]."""
        median, fastest = statistics.median(times_s), min(times_s)
        return cls(median_s=median, fastest_s=fastest, repeats=len(times_s), result=result)

    def columns(self) -> dict[str, Any]:
        """Return the columns median_s, fastest_s and repeats of a row."""
        return {"median_s": self.median_s, "fastest_s": self.fastest_s, "repeats": self.repeats}


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
    first = [task_time(task) for task in tasks]
    # a first run also fills caches: it counts only where it is too dear to repeat
    times = [[elapsed] if elapsed > budget_s else [] for elapsed, _ in first]
    for _ in range(most):
        for task, taken in zip(tasks, times, strict=True):
            if sum(taken) < budget_s:
                taken.append(task_time(task)[0])
    return [Timing.of(taken, result) for taken, (_, result) in zip(times, first, strict=True)]


def task_time(task: Callable[[], Any]) -> tuple[float, Any]:
    """Return the run time [s] of one run, and what it returned."""
    start = time.perf_counter()
    result = task()
    return time.perf_counter() - start, result


def facts_of_run() -> dict[str, Any]:
    """Return what the figures were measured on: processor, versions, threads of linear algebra."""
    packages = ("numpy", "scipy", "pandas", "numba")
    return {
        "processor": platform.machine(),
        "model": _processor_model(),
        "cores": os.cpu_count(),
        "blas_threads": os.environ.get("OPENBLAS_NUM_THREADS", "default"),
        "python": platform.python_version(),
        "gearmon": __version__,
        **{name: version(name) if find_spec(name) else "not installed" for name in packages},
    }


def _processor_model() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return ""
    named = [line.partition(":")[2].strip() for line in text.splitlines() if "model name" in line]
    return named[0] if named else ""


def other_python(variable: str, needs: str, given: str | None = None) -> str | None:
    """Return the interpreter of an environment with a competitor, or None if none is named.

    Parameters
    ----------
    variable : str
        Environment variable that names it.
    needs : str
        What the environment must hold, in words.
    given : str, optional
        By default the value of the variable.

    Raises
    ------
    ArgumentError
        If the name is not that of a file.
    """
    name = given if given is not None else os.environ.get(variable)
    if name and not Path(name).is_file():
        raise ArgumentError(
            f"{variable}={name!r} is no file; it must name the Python interpreter of an "
            f"environment with {needs}"
        )
    return name or None


@contextmanager
def competitor(
    python: str, needs: str, what: str, data: dict[str, Any]
) -> Iterator[tuple[dict[str, Any], Callable[[], float]]]:
    """Start a competitor of `other_python.py`.

    Parameters
    ----------
    python : str
        Interpreter.
    needs : str
        What its environment must hold, in words.
    what : str
        Name of the task.
    data : dict
        What the task needs, in built-in types.

    Yields
    ------
    dict
        What it tells of itself.
    callable
        Runs it once more and returns its run time there [s].

    Raises
    ------
    ArgumentError
        If the other environment does not answer.
    """
    with subprocess.Popen(
        [python, "-I", str(SCRIPT), what, json.dumps(data)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        requests, answers = other.stdin, other.stdout

        def answer() -> Any:
            line = answers.readline()
            if not line.strip():
                raise ArgumentError(f"{python} gives no answer: its environment must hold {needs}")
            return json.loads(line)

        def run() -> float:
            print(file=requests, flush=True)
            return float(answer())

        yield answer(), run
        requests.close()


def in_turn(
    other: Callable[[], float], task: Callable[[], Any], rounds: int
) -> tuple[Timing, Timing]:
    """Time a competitor and a task here, one after the other, round after round."""
    task()
    pairs = [(other(), task_time(task)[0]) for _ in range(max(1, rounds))]
    theirs, own = zip(*pairs, strict=True)
    return Timing.of(theirs), Timing.of(own)
