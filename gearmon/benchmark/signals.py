"""Spectra, kurtogram, indicators and reading beside named competitors, taken in turn."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.benchmark.timing import Timing, competitor, interleaved, machine_facts, other_python
from gearmon.benchmark.whole_process import example_machine, long_csv
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine
from gearmon.signals.orders import fine_order_spectrum, order_lines
from gearmon.signals.recording import Recording, read_recording
from gearmon.signals.spectra import amplitude_spectrum, envelope_spectrum, kurtogram, power_density
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


def signals_summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the columns of the rows that a terminal has room for."""
    shown = ("case", "method", "samples", "channels", "median_s", "times_own", "note")
    return [{name: row[name] for name in shown} for row in rows]


def _noise(count: int) -> FloatArray:
    return np.random.default_rng(0).normal(size=count)


def _in_turn(
    case: str,
    tasks: dict[str, Callable[[], Any]],
    samples: int,
    repeats: int,
    budget_s: float = 5.0,
    channels: int = 1,
) -> Iterator[dict[str, Any]]:
    """Take methods in turn, the first gearmon's, and yield their rows."""
    timings = interleaved(list(tasks.values()), repeats, budget_s)
    yield from _rows(case, dict(zip(tasks, timings, strict=True)), samples, channels)


def _rows(
    case: str, timings: dict[str, Timing], samples: int, channels: int = 1
) -> Iterator[dict[str, Any]]:
    own = next(iter(timings.values())).median_s
    for name, timing in timings.items():
        yield _row(case, name, samples, timing, timing.median_s / own, channels=channels)


def _row(
    case: str,
    name: str,
    samples: int,
    timing: Timing | None,
    times_own: float | None,
    note: str = "",
    channels: int = 1,
) -> dict[str, Any]:
    none = {"median_s": None, "fastest_s": None, "repeats": 0}
    times = timing.columns() if timing else none
    sizes = {"samples": samples, "channels": channels}
    return {"case": case, "method": name, **sizes, **times, "times_own": times_own, "note": note}


def _spectrum(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    samples = _noise(count)
    bare = batch(count, 1, max(count, 1 << 20))
    bare.input[0] = samples
    tasks = {
        "amplitude_spectrum": lambda: amplitude_spectrum(samples, 1.0),
        "bare FFTW, planned by estimate": bare.run,
    }
    yield from _in_turn("amplitude spectrum", tasks, count, repeats)


def _awkward(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    # 999,983 and 65,521 are primes
    prime = 999_983 if count > 1 << 18 else 65_521
    samples = _noise(prime + 17)
    tasks: dict[str, Callable[[], Any]] = {
        "prime length": lambda: amplitude_spectrum(samples[:prime], 1.0),
        "smooth neighbour": lambda: amplitude_spectrum(samples[: prime // 1000 * 1000], 1.0),
        "numpy.fft.rfft, prime length": lambda: np.fft.rfft(samples[:prime]),
    }
    yield from _in_turn("amplitude spectrum of a prime length", tasks, prime, repeats)


def _welch(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    from scipy.signal import welch

    samples = _noise(count)
    for block in (1024, 8192):
        tasks: dict[str, Callable[[], Any]] = {
            "power_density": partial(power_density, samples, 1.0, block),
            "scipy.signal.welch": partial(welch, samples, nperseg=block),
        }
        yield from _in_turn(f"power density, blocks of {block}", tasks, count, repeats)


def _envelope(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    from scipy.signal import butter, hilbert, sosfiltfilt

    samples = _noise(count)
    sections = butter(4, (0.2, 0.4), btype="bandpass", output="sos")

    def usual() -> FloatArray:
        size = np.abs(hilbert(sosfiltfilt(sections, samples)))
        return np.abs(np.fft.rfft(size - size.mean()))

    tasks: dict[str, Callable[[], Any]] = {
        "envelope_spectrum": lambda: envelope_spectrum(samples, 1.0, 0.1, 0.2),
        "SciPy: Butterworth, hilbert, rfft": usual,
    }
    yield from _in_turn("envelope spectrum", tasks, count, min(repeats, 7))


def _kurtogram(count: int, repeats: int) -> Iterator[dict[str, Any]]:
    samples = _noise(count)
    case = f"kurtogram, {LEVELS} levels"
    own = sys.executable if find_spec("pysdkit") else None
    python = other_python(VARIABLE, NEEDS) or own
    if python is None:
        own_task = partial(kurtogram, samples, 1.0, LEVELS)
        yield from _in_turn(case, {"kurtogram": own_task}, count, repeats)
        note = f"not run: {VARIABLE} names no interpreter of an environment with {NEEDS}"
        yield _row(case, "PySDKit", count, None, None, note)
        return
    data = {"count": count, "levels": min(LEVELS, int(np.log2(count)) - 7)}
    with competitor(python, NEEDS, "pysdkit", data) as other:
        theirs, ours = other.in_turn(lambda: kurtogram(samples, 1.0, LEVELS), repeats)
        timings = {"kurtogram": ours, f"PySDKit {other.known['version']}": theirs}
        yield from _rows(case, timings, count)


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

    machine = example_machine()
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
    names = "indicator_table of samples in memory", "pandas.read_csv of the same samples"
    yield from _rows(AFTER_READING, dict(zip(names, timings, strict=True)), count)
    signature = timings[0].result.signature
    stages = _stages(recording, machine, signature)
    own = interleaved([task for _, task in stages], repeats, 600.0)
    case, note = f"{AFTER_READING}, by stage", "times_own is the share of all"
    for (name, _), timing in zip(stages, own, strict=True):
        yield _row(case, name, count, timing, timing.median_s / timings[0].median_s, note)


def _stages(
    recording: Recording, machine: Machine, found: MeasuredSignature
) -> list[tuple[str, Callable[[], Any]]]:
    """Return the parts of the way from samples to indicators; the second holds the first."""
    train, samples, rate = kinematics(machine), recording.samples, recording.sampling_rate_hz
    pieces = max(1, samples.shape[-1] >> 18)
    orders, block_turns = found.plan.orders, found.lines.block_turns
    fine = partial(fine_order_spectrum, samples, rate, found.track, pieces, most=PIECES_HEARD)
    lines = partial(order_lines, samples, rate, found.track, orders, block_turns, error=LEAKAGE)
    others = partial(nongear_lines, samples, rate, found.track, train, fine())
    return [
        ("speed by the comb", lambda: scan_nominal_speeds(samples, rate, train, machine)),
        ("speed by the comb, angle by phases", lambda: track_recording(recording, machine, train)),
        ("order lines", lines),
        ("spectrum against angle", fine),
        ("lines that no gear explains", others),
        ("indicators of the raw vibration", lambda: indicator_table(recording)),
    ]


def _write_csv(path: Path, part: FloatArray, count: int, channels: int) -> None:
    """Write a long CSV by repeating a part: only its size matters for reading."""
    long_csv(path, np.stack([np.roll(part, 997 * k) for k in range(channels)], axis=1), count)


def _reading(count: int, channels: int, repeats: int) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.csv"
        _write_csv(path, gearbox_signal(min(count, 200_000)), count, channels)
        yield from _in_turn("reading CSV", _readers(path), count, repeats, 60.0, channels)


def _readers(path: Path) -> dict[str, Callable[[], Any]]:
    """Readers of CSV that are installed, gearmon's first; no result is kept."""
    import pandas as pd

    found: dict[str, Callable[[], Any]] = {
        "read_recording": lambda: len(read_recording(path, sampling_rate_hz=RATE_HZ).samples),
        "pandas.read_csv": lambda: len(pd.read_csv(path, header=None)),
    }
    if find_spec("pyarrow"):
        from pyarrow import csv

        options = csv.ReadOptions(autogenerate_column_names=True)
        found["pyarrow"] = lambda: len(csv.read_csv(path, read_options=options))
    if find_spec("polars"):
        polars: Any = import_module("polars")
        found["polars"] = lambda: len(polars.read_csv(path, has_header=False))
    return found
