"""Work on recordings beside its competitors: single steps, and whole processes.

Single steps are spectra, kurtogram, indicators and reading, taken in turn with the methods they
replace. Of whole processes the figures are what a user waits for, and what the machine must hold.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.benchmark.timing import Competitor, Timing, interleaved
from gearmon.files import write_atomically
from gearmon.gears.faults import parse_fault
from gearmon.machine import Machine, load_machine
from gearmon.machine.reading import example_machine
from gearmon.signals.recording import Recording, read_recording
from gearmon.signals.spectra.demodulation import envelope_spectrum, kurtogram
from gearmon.signals.spectra.spectrum import amplitude_spectrum, power_density
from gearmon.signatures.measured.indicators import indicator_table
from gearmon.simulation import simulate, write_simulation
from gearmon.terminal import Progress, followed

Row = dict[str, Any]
#: The first is gearmon's.
Tasks = dict[str, Callable[[], Any]]

PYSDKIT = Competitor("PySDKit", "GEARMON_PYSDKIT_PYTHON", "PySDKit 0.5.0")
LEVELS = 8
RATE_HZ = 20_000.0
AFTER_READING = "from samples to all indicators"
#: Of the recording that is analysed as a whole.
WHOLE_RATE_HZ, WHOLE_S = 4266.6667, 12.0
#: Rounds of long tasks are not cut short.
NO_LIMIT_S = 3600.0


def run_signals(progress: Progress | None = None, *, quick: bool = False) -> list[Row]:
    """Time the work on signals beside its competitors.

    Parameters
    ----------
    progress : callable, optional
        Called with the share done, 0 to 1.
    quick : bool
        A sixteenth of the samples and fewer repeats: rough figures in seconds.

    Returns
    -------
    list of dict
        Rows with case, method, samples, channels, median_s, fastest_s, repeats,
        times_own (median of the method over that of gearmon in the same turns) and a note.

    Raises
    ------
    ArgumentError
        If the environment variable GEARMON_PYSDKIT_PYTHON names no interpreter with PySDKit.
    """
    count, repeats = 1 << (16 if quick else 20), 3 if quick else 15
    long = 500_000 if quick else 10_000_000
    steps: list[Callable[[], Iterator[Row]]] = [
        lambda: _spectra(count, repeats),
        lambda: _kurtogram(count, min(repeats, 7)),
        lambda: _after_reading(long, 2 if quick else 3),
        lambda: _reading(long, 1, 2 if quick else 4),
        lambda: _reading(long, 4, 1 if quick else 3),
    ]
    return [row for step in followed(steps, len(steps), progress) for row in step()]


def signals_summary(rows: Sequence[Row]) -> list[Row]:
    """Return the columns of the rows that a terminal has room for."""
    shown = ("case", "method", "samples", "channels", "median_s", "times_own", "note")
    return [{name: row[name] for name in shown} for row in rows]


def _timed(
    case: str, tasks: Tasks, repeats: int, budget_s: float, samples: int, channels: int = 1
) -> Iterator[Row]:
    timings = interleaved(list(tasks.values()), repeats, budget_s)
    return _rows(case, dict(zip(tasks, timings, strict=True)), samples, channels)


def _rows(
    case: str, timings: dict[str, Timing], samples: int, channels: int = 1, note: str = ""
) -> Iterator[Row]:
    """Yield one row a method; the first is gearmon's."""
    own = next(iter(timings.values())).median_s
    sizes = {"samples": samples, "channels": channels}
    for name, timing in timings.items():
        times = {**timing.columns(), "times_own": timing.median_s / own}
        yield {"case": case, "method": name, **sizes, **times, "note": note}


def _spectra(count: int, repeats: int) -> Iterator[Row]:
    from scipy.fft import rfft
    from scipy.signal import butter, hilbert, sosfiltfilt, welch

    samples = np.random.default_rng(0).normal(size=count)
    # 999,983 and 65,521 are primes
    prime = 999_983 if count > 1 << 18 else 65_521
    sections = butter(4, (0.2, 0.4), btype="bandpass", output="sos")

    def usual_envelope() -> FloatArray:
        size = np.abs(hilbert(sosfiltfilt(sections, samples)))
        return np.abs(np.fft.rfft(size - size.mean()))

    cases: dict[str, Tasks] = {
        "amplitude spectrum": {
            "amplitude_spectrum": lambda: amplitude_spectrum(samples, 1.0),
            "scipy.fft.rfft": lambda: rfft(samples),
        },
        "amplitude spectrum of a prime length": {
            "prime length": lambda: amplitude_spectrum(samples[:prime], 1.0),
            "smooth neighbour": lambda: amplitude_spectrum(samples[: prime // 1000 * 1000], 1.0),
            "numpy.fft.rfft, prime length": lambda: np.fft.rfft(samples[:prime]),
        },
        "envelope spectrum": {
            "envelope_spectrum": lambda: envelope_spectrum(samples, 1.0, 0.1, 0.2),
            "SciPy: Butterworth, hilbert, rfft": usual_envelope,
        },
    }
    for block in (1024, 8192):
        cases[f"power density, blocks of {block}"] = {
            "power_density": partial(power_density, samples, 1.0, block),
            "scipy.signal.welch": partial(welch, samples, nperseg=block),
        }
    for case, tasks in cases.items():
        yield from _timed(case, tasks, repeats, 5.0, count)


def _kurtogram(count: int, repeats: int) -> Iterator[Row]:
    task = partial(kurtogram, np.random.default_rng(0).normal(size=count), 1.0, LEVELS)
    case = f"kurtogram, {LEVELS} levels"
    python = PYSDKIT.python() or (sys.executable if find_spec("pysdkit") else None)
    if python is None:
        (alone,) = interleaved([task], repeats, 5.0)
        return _rows(case, {"kurtogram": alone}, count, note=PYSDKIT.absent)
    data = {"count": count, "levels": min(LEVELS, int(np.log2(count)) - 7)}
    known, theirs, ours = PYSDKIT.in_turn(python, data, lambda _: task, repeats)
    timings = {"kurtogram": ours, f"{PYSDKIT.name} {known['version']}": theirs}
    return _rows(case, timings, count)


@contextmanager
def _long_recording(count: int, channels: int = 1) -> Iterator[tuple[Path, FloatArray]]:
    """Write the example gearbox and so many rows of its vibration, as a logger would.

    Ten seconds are simulated and repeated: the seams do not matter for memory and time.
    """
    with tempfile.TemporaryDirectory() as folder:
        machine = _example(Path(folder))
        made = simulate(machine, duration_s=10.0, sampling_rate_hz=RATE_HZ, channels=channels)
        samples = made.samples[:, :count]
        block = "\n".join(",".join(f"{value:.6g}" for value in row) for row in samples.T) + "\n"
        with (Path(folder) / "long.csv").open("w", encoding="ascii") as file:
            file.write(",".join(f"a{n + 1}" for n in range(channels)) + "\n")
            for _ in range(count // samples.shape[1]):
                file.write(block)
        yield Path(folder), samples


def _example(folder: Path) -> Machine:
    """Write the file of the example gearbox into a folder and load it."""
    write_atomically(folder / "machine.toml", example_machine())
    return load_machine(folder / "machine.toml")


def _after_reading(count: int, repeats: int) -> Iterator[Row]:
    import pandas as pd

    with _long_recording(count) as (folder, samples):
        machine = load_machine(folder / "machine.toml")
        long = np.resize(samples[0], (1, count))
        recording = Recording(samples=long, sampling_rate_hz=RATE_HZ, origin="memory")
        tasks: Tasks = {
            "indicator_table of samples in memory": lambda: indicator_table(recording, machine),
            "pandas.read_csv of the same samples": lambda: pd.read_csv(folder / "long.csv"),
        }
        return _timed(AFTER_READING, tasks, repeats, NO_LIMIT_S, count)


def _rows_read(read: Callable[[Path], Any], path: Path) -> int:
    return len(read(path))


def _reading(count: int, channels: int, repeats: int) -> Iterator[Row]:
    """Readers of CSV that are installed; no result is kept."""
    import pandas as pd

    with _long_recording(count, channels) as (folder, _):
        path = folder / "long.csv"
        tasks: Tasks = {
            "read_recording": lambda: len(read_recording(path, sampling_rate_hz=RATE_HZ).samples),
            "pandas.read_csv": partial(_rows_read, pd.read_csv, path),
        }
        for name, module in (("pyarrow", "pyarrow.csv"), ("polars", "polars")):
            if find_spec(name):
                tasks[name] = partial(_rows_read, import_module(module).read_csv, path)
        return _timed("reading CSV", tasks, repeats, 60.0, count, channels)


def analysis_against_reading(repeats: int = 7, progress: Progress | None = None) -> list[Row]:
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
        One row a process, with median and least time and the ratio of the medians.
    """
    with tempfile.TemporaryDirectory() as folder:
        processes = _prepared(Path(folder))
        tasks = [
            partial(subprocess.run, arguments, capture_output=True, check=False)
            for arguments in processes.values()
        ]
        timings = interleaved(tasks, repeats, NO_LIMIT_S)
    sizes = {"rows": round(WHOLE_RATE_HZ * WHOLE_S), "channels": 4}
    pandas_s, measured = timings[-1].median_s, zip(processes, timings, strict=True)
    return [
        {"process": name, **sizes, **own.columns(), "ratio_to_pandas": own.median_s / pandas_s}
        for name, own in followed(measured, len(timings), progress)
    ]


def _prepared(place: Path) -> dict[str, list[str]]:
    """Write machine, recordings and reference; return the arguments of both processes."""
    machine = _example(place)
    for number, (name, fault) in enumerate((("healthy", ""), ("new", "crack:1:pinion:7:30%"))):
        faults = [parse_fault(fault)] if fault else []
        made = simulate(machine, faults, WHOLE_S, WHOLE_RATE_HZ, channels=4, recording_seed=number)
        write_simulation(made, place / f"{name}.csv", with_time=False)
    common = ["--machine", str(place / "machine.toml"), "--sampling-rate", str(WHOLE_RATE_HZ)]
    start = [sys.executable, "-m", "gearmon"]
    healthy, new = str(place / "healthy.csv"), str(place / "new.csv")
    reference = str(place / "healthy.ref")
    subprocess.run(
        [*start, "learn", healthy, *common, "-o", reference], check=True, capture_output=True
    )
    return {
        "analyse": [*start, "analyse", new, *common, "--reference", reference, "--json"],
        "pandas.read_csv": [sys.executable, "-c", f"import pandas; pandas.read_csv({new!r})"],
    }


def memory_of_long_recording(
    rows: int = 10_000_000, columns: Sequence[int] = (1, 4), progress: Progress | None = None
) -> list[Row]:
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
    for count in followed(columns, len(columns), progress):
        with _long_recording(rows, count) as (folder, _):
            known = ["--machine", str(folder / "machine.toml"), "--sampling-rate", str(RATE_HZ)]
            command = [sys.executable, "-m", "gearmon", "analyse", str(folder / "long.csv")]
            peak, elapsed = _peak_memory([*command, *known, "--json"])
        numbers = 8 * rows * count
        sizes = {"numbers_mib": numbers / 2**20, "peak_mib": peak / 2**20, "ratio": peak / numbers}
        results.append({"rows": rows, "channels": count, **sizes, "elapsed_s": elapsed})
    return results


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
