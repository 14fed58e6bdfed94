"""Spectra, kurtogram, indicators and reading beside named competitors, taken in turn."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.benchmark.timing import Timing, interleaved, task_time
from gearmon.benchmark.whole_process import machine_facts
from gearmon.errors import ArgumentError
from gearmon.files import write_atomically
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, load_machine
from gearmon.machine.example import EXAMPLE
from gearmon.signals.envelope import envelope_spectrum
from gearmon.signals.fine_spectrum import fine_order_spectrum
from gearmon.signals.kurtogram import kurtogram
from gearmon.signals.order_lines import order_lines
from gearmon.signals.recording import Recording, read_recording
from gearmon.signals.spectrum import amplitude_spectrum, power_density
from gearmon.signals.transforms import batch
from gearmon.signatures.measured.indicators import indicator_table
from gearmon.signatures.measured.measurement import LEAKAGE, PIECES_HEARD, MeasuredSignature
from gearmon.signatures.measured.nongear_lines import nongear_lines
from gearmon.signatures.speed import scan_nominal_speeds
from gearmon.signatures.tracking import track_recording
from gearmon.terminal import Progress

FloatArray = NDArray[np.float64]

#: Names the interpreter of an environment with PySDKit.
VARIABLE = "GEARMON_PYSDKIT_PYTHON"
NEEDS = "PySDKit 0.5.0"
SCRIPT = Path(__file__).with_name("signals_kurtogram.py")
LEVELS = 8
RATE_HZ = 20_000.0
SPEED_HZ = 24.5
AFTER_READING = "from samples to all indicators"


def run_signals(progress: Progress | None = None, *, quick: bool = False) -> list[dict[str, Any]]:
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
    count = 1 << (16 if quick else 20)
    long = 500_000 if quick else 10_000_000
    repeats = 3 if quick else 15
    steps: list[Callable[[], Iterator[dict[str, Any]]]] = [
        lambda: _spectrum(count, repeats),
        lambda: _awkward(count, repeats),
        lambda: _welch(count, repeats),
        lambda: _envelope(count, repeats),
        lambda: _kurtogram(count, min(repeats, 7)),
        lambda: _after_reading(long, 2 if quick else 3),
        lambda: _reading(long, 1, 2 if quick else 4),
        lambda: _reading(long, 4, 1 if quick else 3),
    ]
    rows: list[dict[str, Any]] = []
    for number, step in enumerate(steps, start=1):
        rows += step()
        if progress is not None:
            progress(number / len(steps))
    facts = machine_facts()
    return [{**row, **facts} for row in rows]


def _noise(count: int) -> FloatArray:
    return np.random.default_rng(0).normal(size=count)


def _rows(
    case: str, names: list[str], timings: list[Timing], samples: int, channels: int = 1
) -> Iterator[dict[str, Any]]:
    """Rows of methods taken in turn; the first is gearmon's."""
    for name, timing in zip(names, timings, strict=True):
        yield _row(
            case,
            name,
            samples,
            channels,
            (timing.median_s, timing.fastest_s, timing.repeats),
            timing.median_s / timings[0].median_s,
        )


def _row(
    case: str,
    name: str,
    samples: int,
    channels: int,
    times: tuple[float | None, float | None, int],
    times_own: float | None,
    note: str = "",
) -> dict[str, Any]:
    return {
        "case": case,
        "method": name,
        "samples": samples,
        "channels": channels,
        "median_s": times[0],
        "fastest_s": times[1],
        "repeats": times[2],
        "times_own": times_own,
        "note": note,
    }


def _spectrum(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    samples = _noise(count)
    bare = batch(count, 1, max(count, 1 << 20))
    bare.input[0] = samples
    timings = interleaved([lambda: amplitude_spectrum(samples, 1.0), bare.run], repeats, 5.0)
    names = ["amplitude_spectrum", "bare FFTW, planned by estimate"]
    yield from _rows("amplitude spectrum", names, timings, count)


def _awkward(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    # 999,983 and 65,521 are primes
    prime = 999_983 if count > 1 << 18 else 65_521
    samples = _noise(prime + 17)
    timings = interleaved(
        [
            lambda: amplitude_spectrum(samples[:prime], 1.0),
            lambda: amplitude_spectrum(samples[: prime // 1000 * 1000], 1.0),
            lambda: np.fft.rfft(samples[:prime]),
        ],
        repeats,
        5.0,
    )
    names = ["prime length", "smooth neighbour", "numpy.fft.rfft, prime length"]
    yield from _rows("amplitude spectrum of a prime length", names, timings, prime)


def _welch(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    from scipy.signal import welch

    samples = _noise(count)
    for block in (1024, 8192):
        timings = interleaved(
            [
                lambda block=block: power_density(samples, 1.0, block),  # type: ignore[misc]
                lambda block=block: welch(samples, nperseg=block),  # type: ignore[misc]
            ],
            repeats,
            5.0,
        )
        names = ["power_density", "scipy.signal.welch"]
        yield from _rows(f"power density, blocks of {block}", names, timings, count)


def _envelope(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    from scipy.signal import butter, hilbert, sosfiltfilt

    samples = _noise(count)
    sections = butter(4, (0.2, 0.4), btype="bandpass", output="sos")

    def usual() -> FloatArray:
        size = np.abs(hilbert(sosfiltfilt(sections, samples)))
        return np.abs(np.fft.rfft(size - size.mean()))

    timings = interleaved(
        [lambda: envelope_spectrum(samples, 1.0, 0.1, 0.2), usual], min(repeats, 7), 5.0
    )
    names = ["envelope_spectrum", "SciPy: Butterworth, hilbert, rfft"]
    yield from _rows("envelope spectrum", names, timings, count)


def _kurtogram(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    samples = _noise(count)
    case = f"kurtogram, {LEVELS} levels"
    python = _pysdkit_python()
    if python is None:
        (own,) = interleaved([lambda: kurtogram(samples, 1.0, LEVELS)], repeats, 5.0)
        yield from _rows(case, ["kurtogram"], [own], count)
        note = f"not run: {VARIABLE} names no interpreter of an environment with {NEEDS}"
        yield _row(case, "PySDKit", count, 1, (None, None, 0), None, note)
        return
    version, own_s, theirs = _in_turn(
        python, count, lambda: kurtogram(samples, 1.0, LEVELS), repeats
    )
    middle = statistics.median(own_s)
    yield _row(case, "kurtogram", count, 1, (middle, min(own_s), len(own_s)), 1.0)
    other = statistics.median(theirs)
    times = (other, min(theirs), len(theirs))
    yield _row(case, f"PySDKit {version}", count, 1, times, other / middle)


def _pysdkit_python() -> str | None:
    """Interpreter of an environment with PySDKit, None if there is none."""
    name = os.environ.get(VARIABLE)
    if not name:
        return sys.executable if find_spec("pysdkit") else None
    if not Path(name).is_file():
        raise ArgumentError(
            f"{VARIABLE}={name!r} is no file; it must name the Python interpreter of an "
            f"environment with {NEEDS}"
        )
    return name


def _in_turn(
    python: str, count: int, task: Callable[[], Any], repeats: int
) -> tuple[str, list[float], list[float]]:
    """Time a task here and the kurtogram there, one after the other, round after round."""
    with subprocess.Popen(
        [python, "-I", str(SCRIPT), str(count), str(min(LEVELS, int(np.log2(count)) - 7))],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as other:
        if other.stdin is None or other.stdout is None:  # pragma: no cover - both are pipes
            raise ArgumentError(f"{python}: no pipes to the other interpreter")

        def answer() -> Any:
            line = other.stdout.readline() if other.stdout else ""
            if not line.strip():
                raise ArgumentError(f"{python} gives no answer: its environment must hold {NEEDS}")
            return json.loads(line)

        version = str(answer()["version"])
        task()
        own, theirs = [], []
        for _ in range(repeats):
            print(file=other.stdin, flush=True)
            theirs.append(float(answer()))
            own.append(task_time(task)[0])
        other.stdin.close()
    return version, own, theirs


def gearbox_signal(count: int, seed: int = 0) -> FloatArray:
    """Return vibration of the example gearbox as plain lines: two meshes, sidebands, noise.

    Parameters
    ----------
    count : int
        Samples at 20 kHz.
    seed : int

    Returns
    -------
    ndarray of float, shape (count,)
        Speed 24.5 Hz with half a per cent of slow wander.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(count) / RATE_HZ
    waves = rng.uniform(0.02, 0.1, 4), rng.uniform(0, 2 * np.pi, 4)
    turns = SPEED_HZ * time
    for rate, phase in zip(*waves, strict=True):
        turns += 0.0015 * SPEED_HZ / (2 * np.pi * rate) * np.sin(2 * np.pi * rate * time + phase)
    signal = rng.normal(scale=0.3, size=count)
    second = 23 / 57
    for teeth, shaft in ((23, 1.0), (19, second)):
        for k in range(1, 6):
            for sideband, size in ((0, 1.0), (-1, 0.15), (1, 0.2)):
                order = k * teeth * shaft + sideband * shaft
                signal += size / k * np.cos(2 * np.pi * order * turns + rng.uniform(0, 2 * np.pi))
    return signal


def _after_reading(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    import pandas as pd

    machine = _example()
    signal = gearbox_signal(count)
    recording = Recording(samples=signal[None, :], sampling_rate_hz=RATE_HZ, origin="memory")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.csv"
        _write_csv(path, signal[: min(count, 200_000)], count, 1)
        timings = interleaved(
            [lambda: indicator_table(recording, machine), lambda: pd.read_csv(path, header=None)],
            repeats,
            600.0,
        )
    names = ["indicator_table of samples in memory", "pandas.read_csv of the same samples"]
    yield from _rows(AFTER_READING, names, timings, count)
    signature = timings[0].result.signature
    stages = _stages(recording, machine, signature)
    own = interleaved([task for _, task in stages], repeats, 600.0)
    for (name, _), timing in zip(stages, own, strict=True):
        yield _row(
            f"{AFTER_READING}, by stage",
            name,
            count,
            1,
            (timing.median_s, timing.fastest_s, timing.repeats),
            timing.median_s / timings[0].median_s,
            "times_own is the share of all",
        )


def _stages(
    recording: Recording, machine: Machine, found: MeasuredSignature
) -> list[tuple[str, Callable[[], Any]]]:
    """Return the parts of the way from samples to indicators; the second holds the first."""
    train, samples, rate = kinematics(machine), recording.samples, recording.sampling_rate_hz
    pieces = max(1, samples.shape[-1] >> 18)
    spectrum = fine_order_spectrum(samples, rate, found.track, pieces, most=PIECES_HEARD)
    orders, block_turns = found.plan.orders, found.lines.block_turns
    return [
        ("speed by the comb", lambda: scan_nominal_speeds(samples, rate, train, machine)),
        ("speed by the comb, angle by phases", lambda: track_recording(recording, machine, train)),
        (
            "order lines",
            lambda: order_lines(samples, rate, found.track, orders, block_turns, error=LEAKAGE),
        ),
        (
            "spectrum against angle",
            lambda: fine_order_spectrum(samples, rate, found.track, pieces, most=PIECES_HEARD),
        ),
        (
            "lines that no gear explains",
            lambda: nongear_lines(samples, rate, found.track, train, spectrum),
        ),
        ("indicators of the raw vibration", lambda: indicator_table(recording)),
    ]


def _example() -> Machine:
    with tempfile.TemporaryDirectory() as folder:
        write_atomically(Path(folder) / "machine.toml", EXAMPLE)
        return load_machine(Path(folder) / "machine.toml")


def _write_csv(path: Path, part: FloatArray, count: int, channels: int) -> None:
    """Write a long CSV by repeating a part: only its size matters for reading."""
    table = np.stack([np.roll(part, 997 * k) for k in range(channels)], axis=1)
    block = "\n".join(",".join(f"{value:.6g}" for value in row) for row in table) + "\n"
    with path.open("w", encoding="ascii") as file:
        for _ in range(count // len(part)):
            file.write(block)


def _reading(count: int, channels: int, repeats: int) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.csv"
        _write_csv(path, gearbox_signal(min(count, 200_000)), count, channels)
        readers = _readers(path)
        timings = interleaved([task for _, task in readers], repeats, 60.0)
        names = [name for name, _ in readers]
        yield from _rows("reading CSV", names, timings, count, channels)


def _readers(path: Path) -> list[tuple[str, Callable[[], Any]]]:
    """Readers of CSV that are installed, gearmon's first."""
    import pandas as pd

    def rows_of(result: Any) -> int:
        return len(result)

    found: list[tuple[str, Callable[[], Any]]] = [
        (
            "read_recording",
            lambda: read_recording(path, sampling_rate_hz=RATE_HZ).samples.shape[-1],
        ),
        ("pandas.read_csv", lambda: rows_of(pd.read_csv(path, header=None))),
    ]
    if find_spec("pyarrow"):
        from pyarrow import csv

        options = csv.ReadOptions(autogenerate_column_names=True)
        found.append(("pyarrow", lambda: rows_of(csv.read_csv(path, read_options=options))))
    if find_spec("polars"):
        import importlib

        polars: Any = importlib.import_module("polars")
        found.append(("polars", lambda: rows_of(polars.read_csv(path, has_header=False))))
    return found
