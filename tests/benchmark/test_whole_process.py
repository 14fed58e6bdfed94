"""The benchmark of whole processes: quick runs with the columns that it promises."""

from __future__ import annotations

import json
import sys

import pytest
from reference.small_gearbox import MACHINE_FILE

from gearmon.benchmark import run_case, signals
from gearmon.benchmark.timing import Timing, facts_of_run
from gearmon.errors import ArgumentError
from gearmon.simulation import simulate


def test_facts_of_run():
    facts = facts_of_run()
    assert set(facts) >= {"processor", "model", "cores", "python", "numpy", "scipy", "pandas"}
    assert facts["cores"] >= 1


@pytest.fixture
def quick_machine(monkeypatch):
    """A gearbox that is simulated faster than the example."""
    monkeypatch.setattr(signals, "example_machine", lambda: MACHINE_FILE)


@pytest.mark.usefixtures("quick_machine")
def test_analysis_against_reading(monkeypatch):
    monkeypatch.setattr(signals, "WHOLE_S", 2.0)
    seen = []
    rows = signals.analysis_against_reading(repeats=1, progress=seen.append)
    assert [row["process"] for row in rows] == ["analyse", "pandas.read_csv"]
    for row in rows:
        assert set(row) == {
            "process",
            "rows",
            "channels",
            "median_s",
            "fastest_s",
            "repeats",
            "ratio_to_pandas",
        }
        assert 0 < row["fastest_s"] <= row["median_s"]
    assert rows[1]["ratio_to_pandas"] == 1.0
    assert seen == [0.5, 1.0]
    json.dumps(rows, allow_nan=False)


@pytest.mark.usefixtures("quick_machine")
def test_memory_of_a_long_recording(monkeypatch):
    def shortly(machine, **settings):
        return simulate(machine, **(settings | {"duration_s": 1.0}))

    monkeypatch.setattr(signals, "simulate", shortly)
    seen = []
    (row,) = signals.memory_of_long_recording(60_000, (1,), seen.append)
    assert set(row) == {
        "rows",
        "channels",
        "numbers_mib",
        "peak_mib",
        "ratio",
        "elapsed_s",
    }
    assert row["numbers_mib"] == pytest.approx(8 * 60_000 / 2**20)
    assert row["peak_mib"] > 20  # no Python process with NumPy is smaller
    assert row["ratio"] == pytest.approx(row["peak_mib"] / row["numbers_mib"])
    assert seen == [1.0]


def test_peak_memory_counts_what_a_process_takes():
    """200 MB more are 200 MB more, in units of 1024 bytes as the system counts."""
    peaks = [
        signals._peak_memory([sys.executable, "-c", f"held = b'x' * {size}"])[0]
        for size in (100_000_000, 300_000_000)
    ]
    assert peaks[1] - peaks[0] == pytest.approx(2e8, rel=0.01)


def test_timings_tell_the_median_and_the_fastest():
    timing = Timing.of([3.0, 1.0, 8.0])
    assert timing.columns() == {"median_s": 3.0, "fastest_s": 1.0, "repeats": 3}


def test_unknown_case_is_refused():
    with pytest.raises(ArgumentError, match="case='speed' must be one of analyse, memory"):
        run_case("speed")
