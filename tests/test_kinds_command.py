"""`gearmon kinds`: training, storing, judging, and refusals."""

from __future__ import annotations

import argparse
import json
import re

import pytest

from gearmon.commands.command import Command, check_names, machine_of
from gearmon.commands.recordings import kinds
from gearmon.diagnosis.fault_types import KINDS as FAULT_TYPES
from gearmon.errors import ArgumentError


def run(*words):
    """Run the command by itself, as the command line does."""
    parser = argparse.ArgumentParser()
    kinds.add_to(parser.add_subparsers(dest="command"))
    arguments = parser.parse_args(["kinds", *map(str, words)])
    check_names(arguments)
    arguments.machine, arguments.progress = machine_of(arguments.machine), None
    return kinds.run(arguments)


@pytest.fixture(scope="module")
def trained(shop, tmp_path_factory):
    path = tmp_path_factory.mktemp("kinds") / "drive.kinds"
    assert run("--machine", shop / "machine.toml", "--trained", path, "--examples", 240) == 0
    return path


def test_a_classifier_is_trained_once_and_judges(shop, trained, tmp_path, capsys, fits_schema):
    known = ("--machine", shop / "machine.toml", "--reference", shop / "healthy.ref")
    written = tmp_path / "kinds.json"
    names = (shop / "new.csv", shop / "cracked.csv")
    capsys.readouterr()
    assert run(*names, *known, "--trained", trained, "--json", "-o", written) == 1
    result = json.loads(capsys.readouterr().out)
    fits_schema("kinds", result)
    assert result.pop("tables") == [str(written)]
    assert result == json.loads(written.read_text())
    assert not result["classifier"]["trained_now"]
    sound, cracked = result["recordings"]
    assert (sound["verdict"], sound["kind"]) == ("healthy", None)
    assert cracked["verdict"] == "fault"
    told = cracked["kind"]
    assert told["method"] == "classifier"
    assert set(told["probabilities"]) == set(FAULT_TYPES)
    assert sum(told["probabilities"].values()) == pytest.approx(1.0)
    assert told["kind"] in ("tooth damage", "several teeth")


def test_it_is_told_in_words(shop, trained, tmp_path, capsys):
    known = ("--machine", shop / "machine.toml", "--reference", shop / "healthy.ref")
    missing = tmp_path / "missing.csv"
    assert run(shop / "cracked.csv", missing, *known, "--trained", trained) == 2
    shown = capsys.readouterr()
    assert "cracked.csv: FAULT" in shown.out
    assert "most like" in shown.out
    assert "missing.csv: not analysed" in shown.out
    assert "missing.csv" in shown.err


def test_another_machine_is_refused(shop, trained, tmp_path):
    text = (shop / "machine.toml").read_text()
    other = tmp_path / "other.toml"
    teeth = next(line for line in text.splitlines() if line.startswith("pinion_teeth"))
    other.write_text(text.replace(teeth, "pinion_teeth = 19", 1))
    with pytest.raises(ArgumentError) as caught:
        run("--machine", other, "--trained", trained)
    known, found = re.search(
        r"was trained for teeth (.+), the machine file has (.+); name", str(caught.value)
    ).groups()
    assert "19" not in known
    assert known.replace(teeth.split()[-1], "19", 1) == found


def test_what_is_missing_is_said(shop, tmp_path):
    machine = ("--machine", shop / "machine.toml")
    with pytest.raises(ArgumentError, match="--reference is missing"):
        run(shop / "new.csv", *machine)
    with pytest.raises(ArgumentError, match="name recordings"):
        run(*machine)
    with pytest.raises(ArgumentError, match="--examples=8 must lie in"):
        run(*machine, "--trained", tmp_path / "x.kinds", "--examples", 8)
    with pytest.raises(ArgumentError, match="--seed=-1 must lie in"):
        run(*machine, "--trained", tmp_path / "x.kinds", "--seed", -1)


def test_it_is_a_command():
    assert isinstance(kinds, Command)
    assert kinds.example.startswith("gearmon kinds ")
