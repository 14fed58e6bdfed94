"""Several recordings on several cores: the same answers, in the order of the files."""

from __future__ import annotations

import os
from functools import partial

import pytest

from gearmon.cli import main
from gearmon.commands.command import each_of
from gearmon.errors import ArgumentError, GearmonError
from gearmon.threads import THREADS, cores


def named(path, ending):
    """What is done with each path; processes take functions of modules only."""
    if "bad" in path:
        raise GearmonError(f"{path}: bad")
    return path + ending


@pytest.mark.parametrize("threads", ["1", "3"])
def test_results_come_in_the_order_of_the_paths(monkeypatch, threads):
    monkeypatch.setenv(THREADS, threads)
    paths = [f"{number}.csv" for number in range(9)]
    found = each_of(paths, None, partial(named, ending="!"), side_by_side=True)
    assert found == [p + "!" for p in paths]


@pytest.mark.parametrize("threads", ["1", "2"])
def test_an_error_of_a_task_is_reported_in_its_place(monkeypatch, capsys, threads):
    monkeypatch.setenv(THREADS, threads)
    paths = ["1", "2", "bad.csv", "3", "4"]
    found = each_of(paths, None, partial(named, ending=""), side_by_side=True)
    told = {"recording": "bad.csv", "error": "bad.csv: bad"}
    assert found == ["1", "2", told, "3", "4"]
    assert capsys.readouterr().err == "gearmon: bad.csv: bad\n"


@pytest.mark.parametrize("bad", [2, 3])
def test_more_than_two_bad_recordings_are_counted_in_the_last_line(capsys, bad):
    each_of(["good.csv", *(f"bad-{n}.csv" for n in range(bad))], None, partial(named, ending=""))
    told = capsys.readouterr().err.splitlines()
    counted = [f"gearmon: {bad} of {bad + 1} recordings could not be used; the lines above say why"]
    assert told[bad:] == (counted if bad > 2 else [])


def test_cores_are_those_that_are_told(monkeypatch):
    monkeypatch.setenv(THREADS, "3")
    assert cores() == 3
    monkeypatch.setenv(THREADS, "")
    assert cores() >= 1


@pytest.mark.parametrize("wrong", ["0", "-2", "many", "1.5", "²"])
def test_a_number_of_cores_that_is_none_is_refused(monkeypatch, capsys, wrong):
    monkeypatch.setenv(THREADS, wrong)
    with pytest.raises(ArgumentError, match=f"{THREADS}={wrong}: must be a whole number"):
        cores()
    # before the machine file is looked for, and in one line
    assert main(["analyse", "a.csv", "--machine", "nowhere.toml"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert told.startswith(f"gearmon: {THREADS}={wrong}: must be")


def test_a_process_that_dies_is_told_in_one_line(monkeypatch):
    monkeypatch.setenv(THREADS, "2")
    with pytest.raises(GearmonError, match="a process was killed"):
        each_of(["1", "2", "3", "4"], None, die, side_by_side=True)


def die(path):  # noqa: ARG001
    """End the process as the system does that is out of memory."""
    os._exit(9)
