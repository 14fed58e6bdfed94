"""The benchmark of mesh stiffness runs, says what it timed, and what it could not."""

from __future__ import annotations

import json
import os
import sys

import pytest

from gearmon.benchmark import run_case
from gearmon.benchmark.stiffness import ROSS, time_stiffness
from gearmon.errors import ArgumentError


def test_rows_without_the_other_environment(monkeypatch):
    monkeypatch.delenv(ROSS.variable, raising=False)
    rows = time_stiffness(repeats=1)
    assert [row["positions"] for row in rows] == [200, 5200, 1000, 1000, 1000]
    assert all(row["median_s"] > 0 and row["fastest_s"] <= row["median_s"] for row in rows)
    assert [row["times_healthy"] is not None for row in rows] == [False, True, False, False, False]
    for row in rows[3:]:
        assert row["ross_times_slower"] is None
        assert "ROSS not run: GEARMON_ROSS_PYTHON" in row["note"]
        assert "plotly below 6" in row["note"]
    json.dumps(rows)


def test_another_environment_must_be_one(tmp_path, monkeypatch):
    monkeypatch.setenv(ROSS.variable, str(tmp_path / "python"))
    with pytest.raises(ArgumentError, match="is no file; it must name the Python interpreter"):
        ROSS.python()
    monkeypatch.setenv(ROSS.variable, "")
    assert ROSS.python() is None
    mute = tmp_path / "mute"
    mute.write_text("#!/bin/sh\nexit 1\n", encoding="ascii")
    mute.chmod(0o755)
    with pytest.raises(ArgumentError, match="gives no answer: its environment must hold ross"):
        run_case("stiffness", ross_python=str(mute))


def test_an_environment_without_ross_is_told_apart():
    with pytest.raises(ArgumentError, match="gives no answer"):
        time_stiffness(1, sys.executable)


@pytest.mark.skipif(
    not os.environ.get(ROSS.variable), reason=f"{ROSS.variable} names no environment"
)
def test_beside_ross():
    bench, published = time_stiffness(repeats=3)[3:]
    for row in (bench, published):
        assert row["ross_times_slower"] > 200
        # G of its steel is rounded to three digits
        assert row["ross_difference"] < 1e-6
    assert "contact ratio 1.63258, one pair 2.767e+08" in published["note"]
