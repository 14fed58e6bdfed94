"""The benchmark of signals runs; no test asserts on seconds."""

from __future__ import annotations

import pytest
from reference.small_gearbox import MACHINE_FILE

from gearmon.benchmark import signals
from gearmon.errors import ArgumentError
from gearmon.simulation import simulate


def shortly(machine, **settings):
    """A second is repeated, not ten."""
    return simulate(machine, **(settings | {"duration_s": 1.0}))


@pytest.fixture
def rows(monkeypatch):
    monkeypatch.setenv(signals.PYSDKIT.variable, "")
    monkeypatch.setattr(signals, "find_spec", lambda _: None)
    monkeypatch.setattr(signals, "simulate", shortly)
    # simulated faster than the example
    monkeypatch.setattr(signals, "example_machine", lambda: MACHINE_FILE)
    steps = [
        signals._spectra(16_384, 1),
        signals._kurtogram(1 << 15, 1),
        signals._reading(20_000, 2, 1),
        signals._after_reading(60_000, 1),
    ]
    return [row for step in steps for row in step]


def test_rows_have_times(rows):
    assert all(row["median_s"] > 0 for row in rows)
    assert {row["case"] for row in rows} >= {"amplitude spectrum", "reading CSV"}
    (alone,) = [row for row in rows if row["method"] == "kurtogram"]
    assert "PySDKit not run" in alone["note"]
    for case in {row["case"] for row in rows}:
        assert next(row for row in rows if row["case"] == case)["times_own"] == 1.0


def test_a_wrong_interpreter_is_refused(monkeypatch):
    monkeypatch.setenv(signals.PYSDKIT.variable, "/nowhere/python")
    with pytest.raises(ArgumentError, match="is no file"):
        signals._kurtogram(1 << 15, 1)
