"""`gearmon history`: exit codes, store, files and refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gearmon.cli import main

TIMES = "2026-03-01T08:00:00Z,2026-03-02T08:00:00Z"


@pytest.fixture(scope="module")
def folder(shop, tmp_path_factory):
    """A machine file, a reference, and two recordings whose names hold their times."""
    made = tmp_path_factory.mktemp("history")
    names = {
        "2026-03-01T08-00-00.csv": "new.csv",
        "2026-03-02T08-00-00.csv": "cracked.csv",
        "machine.toml": "machine.toml",
        "healthy.ref": "healthy.ref",
    }
    for name, original in names.items():
        (made / name).symlink_to(shop / original)
    return made


def run(folder, *arguments, recordings=2):
    names = ["2026-03-01T08-00-00.csv", "2026-03-02T08-00-00.csv"][:recordings]
    known = ["--machine", str(folder / "machine.toml"), "--reference", str(folder / "healthy.ref")]
    return main(["history", *(str(folder / name) for name in names), *known, *arguments])


def test_store_grows_and_files_are_written(folder, tmp_path, capsys):
    store, table = tmp_path / "history.db", tmp_path / "h.csv"
    options = ("--time-from", "name", "--store", str(store), "--limit", "20%")
    assert run(folder, *options, recordings=1) == 0
    capsys.readouterr()
    # the time of the first is known already
    assert run(folder, *options) == 2
    assert "already" in capsys.readouterr().err
    assert run(folder, *options, "--replace", "-o", str(table), "--json") == 1
    result = json.loads(capsys.readouterr().out)
    assert [r["time"] for r in result["recordings"]] == [
        "2026-03-01T08:00:00Z",
        "2026-03-02T08:00:00Z",
    ]
    assert [r["verdict"] for r in result["recordings"]] == ["healthy", "fault"]
    assert result["replaced"] == 1
    assert result["limit"] == pytest.approx(0.2)
    assert result["raised"]
    assert table.read_text().startswith("time,")
    assert table.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert run(folder, *options, "--replace", recordings=1) == 1
    assert "replaced: 1" in capsys.readouterr().out.splitlines()
    # and it can be looked at without any recording
    assert main(["history", "--machine", str(folder / "machine.toml"), "--store", str(store)]) == 1
    assert "2 recordings" in capsys.readouterr().out
    # but not by a name that it does not know
    asked = ["--machine", str(folder / "machine.toml"), "--store", str(store), "--name", "other"]
    assert main(["history", *asked]) == 2
    assert "machine 'other' is not one of " in capsys.readouterr().err


def test_a_recording_that_cannot_be_used_is_told_among_the_others(folder, tmp_path, capsys):
    missing = tmp_path / "2026-03-03T08-00-00.csv"
    names = [str(folder / "2026-03-01T08-00-00.csv"), str(missing)]
    known = ["--machine", str(folder / "machine.toml"), "--reference", str(folder / "healthy.ref")]
    assert main(["history", *names, *known, "--time-from", "name"]) == 2
    shown = capsys.readouterr()
    assert f"{missing}: not analysed" in shown.out.splitlines()
    assert f"{missing}: " in shown.err


def test_of_two_recordings_of_one_time_the_later_counts_where_that_is_asked_for(folder, capsys):
    one_time = ("--times", f"{TIMES.split(',')[0]},{TIMES.split(',')[0]}")
    assert run(folder, *one_time) == 2
    assert "already" in capsys.readouterr().err
    assert run(folder, *one_time, "--replace", "--json") == 1
    (entry,) = json.loads(capsys.readouterr().out)["recordings"]
    assert entry["verdict"] == "fault"
    assert entry["recording"].endswith("2026-03-02T08-00-00.csv")


def test_a_recording_of_which_nothing_can_be_said_ends_in_three(folder, capsys):
    """Without healthy recordings no machine is called healthy."""
    sound = str(folder / "2026-03-01T08-00-00.csv")
    known = ["--machine", str(folder / "machine.toml"), "--time-from", "name", "--json"]
    assert main(["history", sound, *known]) == 3
    (entry,) = json.loads(capsys.readouterr().out)["recordings"]
    assert entry["verdict"] == "cannot tell"


def test_a_bad_recording_is_named_and_the_others_are_kept(folder, tmp_path, capsys):
    bad = tmp_path / "bad.csv"
    np.savetxt(bad, [1.0])
    known = ["--machine", str(folder / "machine.toml"), "--reference", str(folder / "healthy.ref")]
    good = str(folder / "2026-03-01T08-00-00.csv")
    code = main(["history", str(bad), good, *known, "--times", TIMES, "--json"])
    assert code == 2
    result = json.loads(capsys.readouterr().out)
    assert [entry["recording"] for entry in result["errors"]] == [str(bad)]
    assert len(result["recordings"]) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "when were the recordings made"),
        (("--times", "2026-01-01"), "1 times for 2 recordings"),
        (("--times", TIMES, "--time-from", "name"), "not both"),
        (("--times", TIMES, "-o", "h.txt"), "must end in one of"),
        (("--times", TIMES, "--store", ""), "--store: the name is empty"),
    ],
)
def test_wrong_arguments_are_refused_before_any_work(folder, capsys, options, message):
    assert run(folder, *options) == 2
    assert message in capsys.readouterr().err


def test_a_history_that_is_not_there_or_of_other_machines_cannot_be_looked_at(
    folder, tmp_path, capsys
):
    store = tmp_path / "history.db"
    look = ["history", "--machine", str(folder / "machine.toml"), "--store", str(store)]
    assert main(look) == 2
    assert "there is no such history file" in capsys.readouterr().err
    assert not store.exists()
    assert run(folder, "--times", TIMES, "--store", str(store)) == 1
    capsys.readouterr()
    assert main([*look, "--name", "another"]) == 2
    assert f"{store}: machine 'another'" in capsys.readouterr().err


@pytest.mark.parametrize("limit", ["200%", "much"])
def test_a_limit_that_is_no_loss_is_refused(folder, capsys, limit):
    with pytest.raises(SystemExit) as stop:
        run(folder, "--times", TIMES, "--limit", limit)
    assert stop.value.code == 2
    assert f"--limit: {limit}: must be a loss" in capsys.readouterr().err


def test_the_store_must_be_a_file_of_its_own(folder, capsys):
    path = str(folder / "healthy.ref")
    assert run(folder, "--times", TIMES, "--store", path) == 2
    assert "healthy.ref: is read as well" in capsys.readouterr().err
    assert main(["history", "--machine", str(folder / "machine.toml")]) == 2
    assert "name recordings" in capsys.readouterr().err
