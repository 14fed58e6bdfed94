"""Tasks taken in turn, so that a drifting machine speed hits all; here or in another Python.

Run by path with the interpreter of another environment, this file is a competitor: it answers with
what is known first, then after one run for every line that it reads, as JSON. What it imports
of gearmon it therefore imports where it is needed.
"""

from __future__ import annotations

import json
import os
import platform
import re
import statistics
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

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
    from gearmon import __version__

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


class Competitor(NamedTuple):
    """A task that needs an environment of its own.

    Parameters
    ----------
    name : str
        Of the competitor, see `_COMPETITORS`.
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
        from gearmon.errors import ArgumentError

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
        lacks = f"{self.variable} names no interpreter of an environment with {self.needs}"
        return f"{self.name} not run: {lacks}"

    @contextmanager
    def running(self, python: str, data: Row) -> Iterator[tuple[Row, Task]]:
        """Start the competitor, to be timed as a task like any other.

        Parameters
        ----------
        python : str
            Interpreter.
        data : dict
            What the competitor needs, in built-in types.

        Yields
        ------
        (dict, callable)
            What it tells of itself, and what makes it run once.

        Raises
        ------
        ArgumentError
            If the other environment does not answer.
        """
        from gearmon.errors import ArgumentError

        command, pipe = [python, "-I", __file__, self.name, json.dumps(data)], subprocess.PIPE
        with subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True
        ) as other:
            requests, answers = other.stdin, other.stdout
            assert requests is not None
            assert answers is not None

            def answer(asked: str = "") -> Any:
                print(asked, end="", file=requests, flush=True)
                line = answers.readline()
                if not line.strip():
                    held = f"its environment must hold {self.needs}"
                    raise ArgumentError(f"{python} gives no answer: {held}")
                return json.loads(line)

            yield answer(), partial(answer, "\n")


def _ross(data: Row) -> tuple[Row, Task]:
    """Mesh stiffness of a pair; where the first and the last position lie, as pressure angles."""
    gear_element, steel = import_module("ross.gear_element"), import_module("ross.materials").steel
    gears = [
        gear_element.GearElementTVMS(n=n, material=steel, **own, **data["both"])
        for n, own in enumerate(data["gears"])
    ]
    mesh = gear_element.Mesh(*gears)
    one, two = mesh.driving_gear.pr_angles_dict, mesh.driven_gear.pr_angles_dict
    known = {
        "version": version("ross-rotordynamics"),
        "elastic_modulus_pa": float(steel.E),
        "poisson_ratio": float(steel.Poisson),
        "contact_ratio": float(mesh.contact_ratio),
        "stiffness_n_per_m": [float(k) for k in mesh.stiffness_range],
        "pressure_angles_rad": [float(one["start_point"]), float(two["addendum"])],
        "step_rad": float(one["addendum"] - one["start_point"]) / float(mesh.contact_ratio),
        "gear_ratio": float(mesh.gear_ratio),
        "mesh_angles_rad": [float(angle) for angle in mesh.theta_range],
    }
    count = data["positions"]
    return known, lambda: mesh.get_stiffness_for_mesh_period(n_mesh_period=1, n_points=count)


def _pysdkit(data: Row) -> tuple[Row, Task]:
    """Kurtogram of noise."""
    fast_kurtogram = import_module("pysdkit.utils._kurtogram").fast_kurtogram
    samples = import_module("numpy").random.default_rng(0).normal(size=data["count"])
    fast_kurtogram(samples, data["levels"], 1.0)
    return {"version": version("PySDKit")}, lambda: fast_kurtogram(samples, data["levels"], 1.0)


#: What is known, and the task to be timed, of the data in the arguments.
_COMPETITORS = {"ROSS": _ross, "PySDKit": _pysdkit}


def _compete(name: str, data: str) -> None:
    """Be the competitor of this name."""
    warnings.simplefilter("ignore")
    # the libraries and their parts, some of them compiled, print on import
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    os.environ.setdefault("MPLBACKEND", "agg")
    known, task = _COMPETITORS[name](json.loads(data))
    print(json.dumps(known), file=answers, flush=True)
    for _ in sys.stdin:
        task()
        print("true", file=answers, flush=True)


if __name__ == "__main__":
    _compete(*sys.argv[1:])
