"""The tasks beside competitors run, say what they timed, and what they could not.

No test asserts on seconds.
"""

from __future__ import annotations

import json
import os
import sys
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest
from reference.small_gearbox import MACHINE_FILE

from gearmon.benchmark import run_case, tasks, timing
from gearmon.benchmark.tasks import time_harvesting, time_stiffness
from gearmon.benchmark.timing import Timing, facts_of_run
from gearmon.errors import ArgumentError
from gearmon.simulation import simulate


def shortly(machine, **settings):
    """A second is repeated, not ten."""
    return simulate(machine, **(settings | {"duration_s": 1.0}))


@pytest.fixture
def rows(monkeypatch):
    monkeypatch.setattr(tasks, "find_spec", lambda _: None)
    monkeypatch.setattr(tasks, "simulate", shortly)
    # simulated faster than the example
    monkeypatch.setattr(tasks, "example_machine", lambda: MACHINE_FILE)
    steps = [
        tasks._spectra(16_384, 1),
        tasks._kurtogram(1 << 15, 1),
        tasks._reading(20_000, 2, 1),
        tasks._reading(60_000, 1, 1),
    ]
    return [row for step in steps for row in step]


def test_rows_have_times(rows):
    assert all(row["median_s"] > 0 for row in rows)
    assert {row["case"] for row in rows} >= {"amplitude spectrum", "reading CSV"}
    (alone,) = [row for row in rows if row["method"] == "kurtogram"]
    assert "PySDKit not run" in alone["note"]
    for case in {row["case"] for row in rows}:
        assert next(row for row in rows if row["case"] == case)["times_own"] == 1.0


def test_times_of_others_are_in_those_of_ours(monkeypatch):
    """Counted in seconds that a clock of our own tells: of three runs the middle and the least."""
    took = iter([9.0, 9.0, 2.0, 6.0, 3.0, 8.0, 4.0, 10.0])
    monkeypatch.setattr(timing, "task_time", lambda _: (next(took), "made"))
    ours, theirs = tasks._timed("case", {"ours": len, "theirs": len}, 3, 100.0, 7)
    assert (ours["median_s"], ours["fastest_s"], ours["repeats"]) == (3.0, 2.0, 3)
    assert (theirs["median_s"], theirs["fastest_s"], theirs["repeats"]) == (8.0, 6.0, 3)
    assert (ours["times_own"], theirs["times_own"]) == (1.0, pytest.approx(8 / 3))


def test_what_solves_many_sets_at_once_is_told_for_one(monkeypatch):
    monkeypatch.setattr(timing, "task_time", lambda _: (0.8, "made"))
    many = timing.Contender("way", run=len, judge=lambda made: {"error": len(made)}, sets=4)
    missing = timing.Contender("other", note="not run")
    row, other = timing.measured([many, missing], 3, 10.0)
    assert (row["median_s"], row["fastest_s"], row["sets"]) == (0.2, 0.2, 4)
    assert (row["error"], row["repeats"]) == (4, 3)
    assert (other["median_s"], other["repeats"], other["note"]) == (None, 0, "not run")


def test_every_way_is_told_by_its_own_time_and_result(monkeypatch):
    monkeypatch.setattr(timing, "task_time", lambda run: (run(), run()))
    listed = [
        timing.Contender(f"way {n}", run=partial(float, n), judge=lambda made: {"error": 10 * made})
        for n in (1, 2, 3)
    ]
    listed.insert(1, timing.Contender("missing", note="not run"))
    rows = timing.measured(listed, 2, 100.0)
    assert [row["method"] for row in rows] == ["way 1", "missing", "way 2", "way 3"]
    assert [row["median_s"] for row in rows] == [1.0, None, 2.0, 3.0]
    assert [row["error"] for row in rows] == [10.0, None, 20.0, 30.0]


def test_rows_without_the_other_library(monkeypatch):
    monkeypatch.setattr(tasks, "find_spec", lambda _: None)
    rows = time_stiffness(repeats=1)
    assert [row["positions"] for row in rows] == [200, 5200, 1000, 1000, 1000]
    assert all(row["median_s"] > 0 and row["fastest_s"] <= row["median_s"] for row in rows)
    for row in rows:
        assert row["positions_per_s"] * row["median_s"] == pytest.approx(row["positions"])
    assert [row["times_healthy"] is not None for row in rows] == [False, True, False, False, False]
    for row in rows[3:]:
        assert row["ross_times_slower"] is None
        assert "ROSS not run" in row["note"]
        assert "gearmon[benchmark]" in row["note"]
    json.dumps(rows)


@pytest.mark.skipif(find_spec("ross") is None, reason="ROSS is not installed")
def test_beside_ross():
    bench, published = time_stiffness(repeats=3)[3:]
    for row in (bench, published):
        assert row["ross_times_slower"] > 200
        # G of its steel is rounded to three digits
        assert row["ross_difference"] < 1e-6
    assert "contact ratio 1.63258, one pair 2.767e+08" in published["note"]


@pytest.mark.skipif(find_spec("pysdkit") is None, reason="PySDKit is not installed")
def test_beside_pysdkit():
    ours, theirs = tasks._kurtogram(1 << 15, 1)
    assert theirs["method"].startswith("PySDKit")
    assert min(ours["median_s"], theirs["median_s"]) > 0


@pytest.fixture(scope="module")
def tuned():
    seen = []
    found = time_harvesting(seen.append, quick=True)
    assert seen[-1] == 1.0
    return found


def test_tuning_finds_what_time_integration_finds(tuned):
    assert tuned[0]["power_ratio"] == pytest.approx(1.0, abs=0.02)
    assert min(tuned[0]["time_s"], tuned[0]["rival_time_s"]) > 0


def test_the_power_of_lines_is_held_against_that_of_marching(monkeypatch):
    monkeypatch.setattr(tasks, "_tuned_power", lambda _: 3.0)
    monkeypatch.setattr(tasks, "_integrated", lambda _: 2.0)
    assert tasks._pairs_row(1)["power_ratio"] == 1.5


def test_ratios_are_times_of_the_rival_over_ours(tuned):
    for row in tuned:
        assert row["ratio"] == pytest.approx(row["rival_time_s"] / row["time_s"])


def test_optimum_is_that_of_brute_force_and_not_below(tuned):
    for row in tuned[1:]:
        # the coarse grid is up to half a step away from the top of a narrow resonance
        assert 0.995 < row["power_ratio"] < 1.2


def test_facts_of_run():
    facts = facts_of_run()
    assert set(facts) >= {"processor", "model", "cores", "python", "numpy", "scipy", "pandas"}
    assert facts["cores"] == os.cpu_count()
    assert facts["python"] == sys.version.split()[0]
    for name in ("gearmon", "numpy", "scipy", "pandas"):
        assert facts[name] == import_module(name).__version__


def test_indicators_are_timed_on_as_many_samples_as_are_told(monkeypatch):
    """They last their number over the sampling rate."""
    asked = []

    def take(_condition, setting):
        asked.append(setting.duration_s)
        return SimpleNamespace(recording=SimpleNamespace(vibration=lambda: None))

    drawn = SimpleNamespace(take=take, machine=None)
    monkeypatch.setattr(tasks, "find_spec", lambda _: None)
    monkeypatch.setattr(tasks, "example_machine", lambda: MACHINE_FILE)
    monkeypatch.setattr(tasks, "simulate", shortly)
    monkeypatch.setattr(tasks, "draw_machine", lambda *_, **__: drawn)
    monkeypatch.setattr(tasks, "indicator_table", lambda *_: None)
    rows = tasks._reading(30_000, 1, 1)
    assert asked == [pytest.approx(30_000 / tasks.RATE_HZ)]
    assert {row["samples"] for row in rows} == {30_000}


@pytest.fixture
def quick_machine(monkeypatch):
    """A gearbox that is simulated faster than the example."""
    monkeypatch.setattr(tasks, "example_machine", lambda: MACHINE_FILE)


@pytest.mark.usefixtures("quick_machine")
def test_analysis_against_reading(monkeypatch):
    monkeypatch.setattr(tasks, "WHOLE_S", 2.0)
    seen = []
    rows = tasks.analysis_against_reading(repeats=1, progress=seen.append)
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
    pandas_s = rows[1]["median_s"]
    assert [row["ratio_to_pandas"] for row in rows] == [row["median_s"] / pandas_s for row in rows]
    # of whole rows, in four channels
    assert {(row["rows"], row["channels"]) for row in rows} == {(round(4266.6667 * 2.0), 4)}
    assert seen == [0.5, 1.0]
    json.dumps(rows, allow_nan=False)


@pytest.mark.usefixtures("quick_machine")
def test_memory_of_a_long_recording(monkeypatch):
    monkeypatch.setattr(tasks, "simulate", shortly)
    seen = []
    (row,) = tasks.memory_of_long_recording(60_000, (1,), seen.append)
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


def test_the_memory_of_a_recording_is_told_in_that_of_the_numbers_of_its_file(monkeypatch):
    """What takes eight bytes a number takes once the numbers, whatever the channels."""

    def held(command):
        table = np.loadtxt(command[4], delimiter=",", skiprows=1, ndmin=2)
        return 8.0 * table.size, 1.0

    monkeypatch.setattr(tasks, "simulate", shortly)
    monkeypatch.setattr(tasks, "example_machine", lambda: MACHINE_FILE)
    monkeypatch.setattr(tasks, "_peak_memory", held)
    rows = tasks.memory_of_long_recording(30_000, (1, 2))
    assert [row["ratio"] for row in rows] == [1.0, 1.0]
    assert [row["numbers_mib"] for row in rows] == [row["peak_mib"] for row in rows]
    assert rows[1]["numbers_mib"] == 2 * rows[0]["numbers_mib"]


def test_finer_samples_of_a_stiffness_hold_the_coarser_ones():
    coarse, fine = (tasks._sample(tasks.STAGE, points) for points in (10, 20))
    np.testing.assert_allclose(fine[::2], coarse, rtol=1e-12)


def test_peak_memory_counts_what_a_process_takes():
    """200 MB more are 200 MB more, in units of 1024 bytes as the system counts."""
    peaks = [
        tasks._peak_memory([sys.executable, "-c", f"held = b'x' * {size}"])[0]
        for size in (100_000_000, 300_000_000)
    ]
    assert peaks[1] - peaks[0] == pytest.approx(2e8, rel=0.01)


def test_timings_tell_the_median_and_the_fastest():
    timing = Timing.of([3.0, 1.0, 8.0])
    assert timing.columns() == {"median_s": 3.0, "fastest_s": 1.0, "repeats": 3}


def test_unknown_case_is_refused():
    with pytest.raises(ArgumentError, match="case='speed' must be one of analyse, memory"):
        run_case("speed")


def test_rivals_work_on_the_same_samples(monkeypatch):
    """But for the smooth neighbour of a prime, which is shorter by next to nothing."""
    timed = {}
    monkeypatch.setattr(tasks, "_timed", lambda case, own, *_: timed.update({case: own}) or [])
    tasks._spectra(1 << 16, 1)
    assert len(timed) == 5
    for case, own in timed.items():
        sizes = {name: len(task.args[0]) for name, task in own.items() if isinstance(task, partial)}
        smooth = sizes.pop("smooth neighbour", None)
        (size,) = set(sizes.values())
        if smooth is None:
            assert size == 1 << 16
        else:
            assert "prime" in case
            assert all(size % own for own in range(2, 257))
            assert 0.98 * size < smooth < size
            assert smooth % 1000 == 0
