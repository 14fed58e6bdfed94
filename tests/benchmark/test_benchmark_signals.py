"""The benchmark of signals runs; no test asserts on seconds."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.benchmark import case_figures, signals
from gearmon.errors import ArgumentError
from gearmon.report.plots import save_all


@pytest.fixture
def rows(monkeypatch):
    monkeypatch.setenv(signals.VARIABLE, "")
    monkeypatch.setattr(signals, "find_spec", lambda _: None)
    steps = [
        signals._spectrum(4096, 1),
        signals._awkward(4096, 1),
        signals._welch(16_384, 1),
        signals._envelope(4096, 1),
        signals._kurtogram(1 << 15, 1),
        signals._reading(20_000, 2, 1),
        signals._after_reading(200_000, 1),
    ]
    return [row for step in steps for row in step]


def test_rows_have_times_and_a_picture(rows, tmp_path):
    timed = [row for row in rows if row["median_s"] is not None]
    assert all(row["median_s"] > 0 for row in timed)
    assert {row["case"] for row in rows} >= {"amplitude spectrum", "reading CSV"}
    stages = [row for row in rows if row["case"].endswith("by stage")]
    assert {"speed by the comb", "order lines"} <= {row["method"] for row in stages}
    absent = [row for row in rows if row["method"] == "PySDKit"]
    assert "not run" in absent[0]["note"]
    (path,) = save_all(case_figures("signals", rows), tmp_path / "b.png")
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_wrong_interpreter_is_refused(monkeypatch):
    monkeypatch.setenv(signals.VARIABLE, "/nowhere/python")
    with pytest.raises(ArgumentError, match="is no file"):
        next(signals._kurtogram(1 << 15, 1))


def test_signal_has_its_mesh_lines():
    samples = signals.gearbox_signal(1 << 16)
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    frequency = np.arange(len(spectrum)) * signals.RATE_HZ / len(samples)
    mesh = 23 * signals.SPEED_HZ
    near = np.abs(frequency - mesh) < 0.01 * mesh
    assert spectrum[near].max() > 20 * np.median(spectrum)
