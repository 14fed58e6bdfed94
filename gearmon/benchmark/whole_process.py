"""Whole processes against each other: what a user waits for, and what the machine must hold."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearmon.benchmark.timing import machine_facts, task_time
from gearmon.files import write_atomically
from gearmon.gears.faults import parse_fault
from gearmon.machine import Machine, load_machine
from gearmon.machine.example import EXAMPLE
from gearmon.simulation import simulate, write_simulation
from gearmon.terminal import Progress

RATE_HZ = 4266.6667
DURATION_S = 12.0


def analysis_against_reading(
    repeats: int = 7, progress: Progress | None = None
) -> list[dict[str, Any]]:
    """Time one analysis, start of process to JSON, against pandas reading the same CSV.

    A recording of 12 s and four channels is simulated, a reference learned; then both processes run
    in turn, so that a drifting machine speed hits both.

    Parameters
    ----------
    repeats : int
        Counted runs of each, after one warm-up.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row a process, with median, least and largest time and the ratio of the medians.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        command, reading = _prepared(place)
        times: dict[str, list[float]] = {"analyse": [], "pandas.read_csv": []}
        for run in range(repeats + 1):
            for taken, arguments in zip(times.values(), (command, reading), strict=True):
                process = partial(subprocess.run, arguments, capture_output=True, check=False)
                taken.append(task_time(process)[0])
            if progress is not None:
                progress((run + 1) / (repeats + 1))
    # the first run of each warms the caches of the system up
    medians = {name: statistics.median(taken[1:]) for name, taken in times.items()}
    return [
        {
            "process": name,
            "rows": round(RATE_HZ * DURATION_S),
            "channels": 4,
            "median_s": medians[name],
            "least_s": min(taken[1:]),
            "largest_s": max(taken[1:]),
            "ratio_to_pandas": medians[name] / medians["pandas.read_csv"],
            **machine_facts(),
        }
        for name, taken in times.items()
    ]


def _prepared(place: Path) -> tuple[list[str], list[str]]:
    """Write machine, recordings and reference; return both processes' arguments."""
    machine = example_machine(place)
    for number, (name, fault) in enumerate((("healthy", ""), ("new", "crack:1:pinion:7:30%"))):
        faults = [parse_fault(fault)] if fault else []
        recording = simulate(
            machine, faults, DURATION_S, RATE_HZ, channels=4, recording_seed=number
        )
        write_simulation(recording, place / f"{name}.csv", with_time=False)
    common = ["--machine", str(place / "machine.toml"), "--sampling-rate", str(RATE_HZ)]
    start = [sys.executable, "-m", "gearmon"]
    healthy, new = str(place / "healthy.csv"), str(place / "new.csv")
    reference = str(place / "healthy.ref")
    subprocess.run(
        [*start, "learn", healthy, *common, "-o", reference], check=True, capture_output=True
    )
    command = [*start, "analyse", new, *common, "--reference", reference, "--json"]
    reading = [sys.executable, "-c", f"import pandas; pandas.read_csv({new!r})"]
    return command, reading


def memory_of_long_recording(
    rows: int = 10_000_000, columns: Sequence[int] = (1, 4), progress: Progress | None = None
) -> list[dict[str, Any]]:
    """Measure the peak memory of analysing a long CSV against the size of its numbers.

    Parameters
    ----------
    rows : int
        Rows of the CSV.
    columns : sequence of int
        Numbers of channels to try.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row a number of channels.
    """
    results = []
    for number, count in enumerate(columns):
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            machine, path = example_machine(place), place / "long.csv"
            # ten simulated seconds, over and over: the seams do not matter for memory and time
            made = simulate(machine, duration_s=10.0, sampling_rate_hz=2e4, channels=count)
            long_csv(path, made.samples.T, rows, ",".join(made.channel_names) + "\n")
            known = ["--machine", str(place / "machine.toml"), "--sampling-rate", "20000"]
            command = [sys.executable, "-m", "gearmon", "analyse", str(path), *known, "--json"]
            peak, elapsed = _peak_memory(command)
        numbers = 8 * rows * count
        sizes = {"numbers_mib": numbers / 2**20, "peak_mib": peak / 2**20, "ratio": peak / numbers}
        row = {"rows": rows, "channels": count, **sizes, "elapsed_s": elapsed, **machine_facts()}
        results.append(row)
        if progress is not None:
            progress((number + 1) / len(columns))
    return results


def example_machine(folder: Path | None = None) -> Machine:
    """Return the gearbox of the first demo, and write its file into a folder if one is given."""
    if folder is None:
        with tempfile.TemporaryDirectory() as place:
            return example_machine(Path(place))
    write_atomically(folder / "machine.toml", EXAMPLE)
    return load_machine(folder / "machine.toml")


def long_csv(path: Path, table: ArrayLike, rows: int, header: str = "") -> None:
    """Write a long CSV by writing the rows of a table over and over, as finely as a logger."""
    lines = [",".join(f"{value:.6g}" for value in row) for row in np.asarray(table)]
    block = "\n".join(lines) + "\n"
    with path.open("w", encoding="ascii") as file:
        file.write(header)
        for _ in range(rows // len(lines)):
            file.write(block)


def _peak_memory(command: Sequence[str]) -> tuple[float, float]:
    """Peak resident memory of a process [bytes] and its elapsed time [s].

    Measured by a small process in between, whose only child it is.
    """
    script = (
        "import resource, subprocess, sys, time\n"
        "start = time.perf_counter()\n"
        "subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)\n"
        "usage = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(usage.ru_maxrss, time.perf_counter() - start)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script, *command], capture_output=True, text=True, check=True
    )
    kibibytes, elapsed = result.stdout.split()
    return float(kibibytes) * 1024, float(elapsed)
