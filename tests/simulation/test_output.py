"""The CSV and the truth beside it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from reference.simulated_machines import one_pair

from gearmon.errors import ArgumentError
from gearmon.simulation import simulate, write_simulation


@pytest.fixture(scope="module")
def recording():
    return simulate(one_pair(), (), 0.2, 4_266.6667, tacho_shaft=1, channels=2)


def test_csv_holds_names_units_times_and_values(recording, tmp_path):
    csv, _ = write_simulation(recording, tmp_path / "run.csv")
    assert csv.read_text().splitlines()[0] == "time (s),a1 (m/s2),a2 (m/s2),tacho (V)"
    rows = np.loadtxt(csv, delimiter=",", skiprows=1)
    assert rows.shape == (recording.samples.shape[1], 4)
    written = rows[:, 1:].T
    assert written == pytest.approx(recording.samples, rel=1e-5)
    assert np.diff(rows[:, 0]) == pytest.approx(1 / 4_266.6667, abs=2e-9)
    assert (len(rows) - 1) / rows[-1, 0] == pytest.approx(4_266.6667, rel=1e-7)


def test_time_may_be_left_out(recording, tmp_path):
    csv, _ = write_simulation(recording, tmp_path / "run.csv", with_time=False)
    lines = csv.read_text().splitlines()
    assert lines[0] == "a1 (m/s2),a2 (m/s2),tacho (V)"
    assert len(lines[1].split(",")) == 3


def test_truth_stands_beside_it(recording, tmp_path):
    csv, truth = write_simulation(recording, tmp_path / "run.csv")
    assert truth == csv.with_suffix(".json")
    assert json.loads(truth.read_text()) == recording.truth


def test_rows_are_written_in_parts_without_a_seam(recording, tmp_path, monkeypatch):
    whole = write_simulation(recording, tmp_path / "whole.csv")[0].read_text()
    monkeypatch.setattr("gearmon.simulation.recorder.ROWS_AT_A_TIME", 100)
    assert write_simulation(recording, tmp_path / "parts.csv")[0].read_text() == whole


def test_other_suffix_is_refused(recording, tmp_path):
    with pytest.raises(ArgumentError, match=r"must end in \.csv"):
        write_simulation(recording, tmp_path / "run.json")


def test_missing_folder_is_refused(recording, tmp_path):
    with pytest.raises(ArgumentError, match="cannot write there"):
        write_simulation(recording, tmp_path / "nowhere" / "run.csv")
