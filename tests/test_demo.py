"""The demo does what the README promises."""

from __future__ import annotations

import json

import pytest
from reference.small_gearbox import as_json

from gearmon.cli import main
from gearmon.demos import run_demo
from gearmon.demos.monitoring import FAULT
from gearmon.errors import ArgumentError
from gearmon.files import as_json as written_as_json
from gearmon.machine import load_machine
from gearmon.machine.parts import example_machine
from gearmon.signatures.measured.reference import read_reference


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    return run_demo("crack", tmp_path_factory.mktemp("demo") / "new" / "folder")


def test_healthy_is_healthy_and_cracked_is_a_fault(ran):
    healthy, cracked = ran.facts["recordings"]
    assert healthy["verdict"] == "healthy"
    assert cracked["verdict"] == "fault"
    assert cracked["flags"][0]["stage"] == int(FAULT.split(":")[1])
    assert cracked["flags"][0]["gear"] == FAULT.split(":")[2]


def test_its_files_are_those_of_a_user(ran):
    folder = ran.files["folder"]
    assert ran.files["report"].is_file()
    assert load_machine(folder / "machine.toml").name == "demo gearbox"
    assert len(read_reference(folder / "healthy.ref").profiles) == 3
    truth = json.loads((folder / "new-cracked.json").read_text())
    assert truth["faults"]
    assert (folder / "new-cracked.csv").is_file()


def test_it_tells_what_it_did(ran, fits_schema):
    told = "\n".join(ran.lines())
    assert "HEALTHY" in told
    assert "FAULT" in told
    assert str(ran.files["report"]) in told
    assert as_json(ran.to_dict()) == ran.to_dict()
    fits_schema("demo", json.loads(written_as_json(ran.to_dict())))
    assert set(ran.to_dict()) == {"folder", "report", "recordings"}


@pytest.mark.parametrize(
    ("words", "folder"),
    [
        ([], "gearmon-demo"),
        (["crack"], "gearmon-demo"),
        (["exposure"], "gearmon-exposure"),
        (["exposure", "-o", "here"], "here"),
    ],
)
def test_a_demo_is_put_where_it_is_told_or_where_its_name_says(
    ran, monkeypatch, capsys, words, folder
):
    def noted(name, path, _):
        put.append((name, str(path)))
        return ran

    put = []
    monkeypatch.setattr("gearmon.demos.run_demo", noted)
    assert main(["demo", *words]) == 0
    assert put == [(words[0] if words else "crack", folder)]
    assert capsys.readouterr().out == "\n".join(ran.lines()) + "\n"


def test_unknown_demo_is_refused_and_makes_nothing(tmp_path):
    with pytest.raises(ArgumentError, match="demo='bearing' must be one of crack"):
        run_demo("bearing", tmp_path / "x")
    assert list(tmp_path.iterdir()) == []


def test_a_file_where_the_folder_should_be_is_refused(tmp_path):
    (tmp_path / "x").write_text("")
    with pytest.raises(ArgumentError, match="cannot make this folder"):
        run_demo("crack", tmp_path / "x")


def test_example_machine_has_a_baseline(tmp_path, capsys):
    path = tmp_path / "machine.toml"
    path.write_text(example_machine())
    assert main(["baseline", str(path), "--max-hz", "2000", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"]
