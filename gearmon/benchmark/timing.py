"""Tasks taken in turn, so that a drifting machine speed hits all; here or in another Python."""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
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


@dataclass(frozen=True)
class Competitor:
    """A task of `other_python.py`, which needs an environment of its own.

    Parameters
    ----------
    name : str
        Of the competitor; in lower case that of its task.
    variable : str
        Environment variable that names the interpreter.
    needs : str
        What the environment must hold, in words.
    """

    name: str
    variable: str
    needs: str

    def python(self, given: str | None = None) -> str | None:
        """Return the interpreter that is given or named, or None if none is.

        Raises
        ------
        ArgumentError
            If the name is not that of a file.
        """
        name = given if given is not None else os.environ.get(self.variable)
        if name and not Path(name).is_file():
            raise ArgumentError(
                f"{self.variable}={name!r} is no file; it must name the Python interpreter of an "
                f"environment with {self.needs}"
            )
        return name or None

    @property
    def absent(self) -> str:
        """Why there is no figure of it."""
        return (
            f"{self.name} not run: {self.variable} names no interpreter of an environment with "
            f"{self.needs}"
        )

    def in_turn(
        self,
        python: str,
        data: dict[str, Any],
        prepare: Callable[[dict[str, Any]], Callable[[], Any]],
        rounds: int,
    ) -> tuple[dict[str, Any], Timing, Timing]:
        """Time the competitor and a task here, one after the other, round after round.

        Parameters
        ----------
        python : str
            Interpreter.
        data : dict
            What the competitor needs, in built-in types.
        prepare : callable
            Makes the task of what the competitor tells of itself.
        rounds : int

        Returns
        -------
        (dict, Timing, Timing)
            What it tells, its run times and ours.

        Raises
        ------
        ArgumentError
            If the other environment does not answer.
        """
        command = [python, "-I", str(SCRIPT), self.name.lower(), json.dumps(data)]
        pipe = subprocess.PIPE
        with subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True
        ) as other:
            requests, answers = other.stdin, other.stdout
            assert requests is not None
            assert answers is not None

            def answer() -> Any:
                line = answers.readline()
                if not line.strip():
                    held = f"its environment must hold {self.needs}"
                    raise ArgumentError(f"{python} gives no answer: {held}")
                return json.loads(line)

            def run() -> float:
                print(file=requests, flush=True)
                return float(answer())

            known = answer()
            task = prepare(known)
            task()
            pairs = [(run(), task_time(task)[0]) for _ in range(max(1, rounds))]
            requests.close()
        theirs, own = zip(*pairs, strict=True)
        return known, Timing.of(theirs), Timing.of(own)
