"""`gearmon fleet`: exit codes, JSON, refusals, and real recordings from beginning to end."""

from __future__ import annotations

import json
import shutil
import sys

import pytest

from gearmon.cli import main, parsed
from gearmon.commands.recordings import _engine
from gearmon.errors import ArgumentError
from gearmon.fleet import in_processes, on_dask, read_fleet, run_fleet


@pytest.fixture(scope="module")
def folder(shop, tmp_path_factory):
    """Six recordings of one machine: two sound ones, then cracked."""
    made = tmp_path_factory.mktemp("fleet")
    for name in ("machine.toml", "healthy.ref", "fleet.toml"):
        shutil.copy(shop / name, made / name)
    for day, name in enumerate(["new", "new", "cracked", "cracked"], 1):
        shutil.copy(shop / f"{name}.csv", made / f"drive-2026-03-0{day}.csv")
    (made / "drive-2026-03-09.csv").write_text("Dear reader,\n")
    return made


def test_a_fleet_from_recordings_to_report(folder, capsys):
    path = str(folder / "fleet.toml")
    # one that cannot be used goes before the alarm
    assert main(["fleet", "run", path, "--json"]) == 2
    result = json.loads(capsys.readouterr().out)
    assert (result["analysed"], len(result["failed"])) == (4, 1)
    assert result["alarms"]
    for alarm in result["alarms"]:
        assert (alarm["machine"], alarm["since"]) == ("drive", "2026-03-03T00:00:00Z")
        assert "pinion" in alarm["finding"]
    (folder / "drive-2026-03-09.csv").unlink()
    assert main(["fleet", "run", path]) == 1
    assert "ALARM drive: " in capsys.readouterr().out
    store, machine = str(folder / "fleet.db"), str(folder / "machine.toml")
    assert main(["history", "--machine", machine, "--store", store, "--name", "drive"]) == 1
    assert "4 recordings" in capsys.readouterr().out
    pytest.importorskip("starlette")
    from gearmon.fleet.pages import _report

    fleet = read_fleet(path)
    made = _report(fleet, fleet.machines[0], str(folder / "drive-2026-03-04.csv"), "")
    assert "uPlot" in made
    assert "Content-Security-Policy" in made


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "none.toml"], "no such file"),
        (["run", "-"], "give the name of a TOML file, standard input is not taken"),
        (["rum", "fleet.toml"], "did you mean run"),
        (["run", "fleet.toml", "--engine", "dask"], "--scheduler"),
        (["run", "fleet.toml", "--engine", "desk"], "did you mean dask"),
        (["watch", "fleet.toml", "--every", "0"], "--every"),
        (["serve", "fleet.toml", "--port", "0"], "--port"),
        (["compare", "fleet.toml"], "it takes 4 machines with the same gears"),
        (["rank", "fleet.toml"], "it takes 6 recordings of a machine"),
    ],
)
def test_what_makes_no_sense_is_refused(folder, monkeypatch, capsys, words, message):
    monkeypatch.chdir(folder)
    assert main(["fleet", *words]) == 2
    assert message in capsys.readouterr().err


def test_pages_without_their_libraries_are_refused(folder, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "gearmon.fleet.pages", None)
    assert main(["fleet", "serve", str(folder / "fleet.toml")]) == 2
    assert "pip install 'gearmon[web]'" in capsys.readouterr().err


def test_a_folder_that_fsspec_reaches(folder, tmp_path):
    pytest.importorskip("fsspec")
    path = tmp_path / "fleet.toml"
    text = (
        (folder / "fleet.toml")
        .read_text()
        .replace('recordings = "."', f'recordings = "file://{folder}"')
    )
    path.write_text(
        text.replace('"machine', f'"{folder}/machine').replace('"healthy', f'"{folder}/healthy')
    )
    fleet = read_fleet(path)
    run = run_fleet(fleet, lambda jobs: in_processes(jobs[:1]))
    assert run.done == 1


def test_the_cluster_and_the_patience_with_it_are_those_that_are_told():
    words = ["fleet", "run", "fleet.toml", "--engine"]
    given = parsed([*words, "dask", "--scheduler", "tcp://10.0.0.1:8786", "--patience", "7"])
    engine = _engine(given)
    assert engine.func is on_dask
    assert engine.keywords == {"scheduler": "tcp://10.0.0.1:8786", "patience_s": 7.0}
    assert _engine(parsed([*words, "processes"])) is in_processes
    with pytest.raises(ArgumentError, match="needs --scheduler ADDRESS"):
        _engine(parsed([*words, "dask"]))
