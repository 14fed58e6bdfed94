"""What arrives is analysed once, whoever is killed; what cannot be used is said."""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from reference.fleet_stand_in import (
    PATTERN,
    arrive,
    at_once,
    content,
    made_fleet,
    standing_in,
)

from gearmon.diagnosis.history import read_history, read_latest
from gearmon.errors import ArgumentError, MachineFileError, SignatureError
from gearmon.fleet import alarms, read_fleet, run_fleet, watch_fleet
from gearmon.fleet import run as running


def test_what_is_new_is_analysed_once_and_kept_in_one_store(tmp_path):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.2")
    arrive(tmp_path, "b_{}_maize.txt", "fault 0.1")
    arrive(tmp_path, "b_{}_maize.txt", "bad", days=1)
    arrive(tmp_path, "notes.txt", "0.2")
    run = run_fleet(fleet, at_once)
    assert (run.done, list(run.failed.values())) == (2, ["cannot be used"])
    assert [Path(path).name for path in run.refused] == ["notes.txt"]
    assert run_fleet(fleet, at_once).done == 0
    assert [own.verdict for own in read_history(fleet.store, "b").entries] == ["fault"]
    latest = {own["machine"]: own for own in read_latest(fleet.store)}
    assert latest["b"]["loss"] == 0.1
    assert latest["a"]["verdict"] == "healthy"
    # one that failed is tried again once it has changed, or on demand
    assert len(run_fleet(fleet, at_once, again=True).failed) == 1
    arrive(tmp_path, "b_{}_maize.txt", "0.3", days=1)
    assert run_fleet(fleet, at_once).done == 1
    arrive(tmp_path, "a_{}.txt", "0.25")
    assert run_fleet(fleet, at_once).done == 1
    assert [own.score for own in read_history(fleet.store, "a").entries] == [0.25]


def test_results_are_parquet_that_pandas_and_others_read(tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    fleet = made_fleet(tmp_path)
    for day in range(3):
        arrive(tmp_path, "a_{}_hay.txt", f"0.{day}", days=day)
    first = run_fleet(fleet, at_once).results
    arrive(tmp_path, "b_{}.txt", "fault 0.2")
    second = run_fleet(fleet, at_once).results
    assert len(first) == len(second) == 1
    table = pandas.read_parquet(fleet.results)
    assert table["machine"].tolist() == ["a", "a", "a", "b"]
    assert table["class"].tolist() == ["hay"] * 3 + [""]
    assert table["loss"].tolist()[3] == 0.2
    assert dict(table["indicators"][0]) == {"rms, a1": 1.0}
    assert run_fleet(fleet, at_once).results == ()


def test_places_that_cannot_be_written_to_are_refused_and_circles_passed_by(tmp_path):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    (tmp_path / "inbox" / "circle").symlink_to(tmp_path / "inbox" / "circle")
    fleet.results.write_text("mine")
    with pytest.raises(ArgumentError, match="is no folder"):
        run_fleet(fleet, at_once)
    with pytest.raises(ArgumentError, match="cannot write there"):
        run_fleet(replace(fleet, store=tmp_path / "nowhere" / "f.db"), at_once)


def test_files_of_others_beside_the_results_stay_and_hide_nothing(tmp_path):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    fleet.results.mkdir()
    others = fleet.results / "other-2026.parquet", Path(f"{fleet.store}.lock")
    for path in others:
        path.write_text("mine")
    assert len(run_fleet(fleet, at_once).results) == 1
    assert [path.read_text() for path in others] == ["mine", "mine"]


def test_a_row_of_the_ledger_that_was_changed_is_refused(tmp_path):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    run_fleet(fleet, at_once)
    for path in fleet.results.glob("*.parquet"):
        path.unlink()
    with closing(sqlite3.connect(fleet.store)) as store:
        store.execute("UPDATE ledger SET indicators = replace(indicators, '1.1', '9.1')")
        store.commit()
    with pytest.raises(SignatureError, match="not what was written"):
        run_fleet(fleet, at_once)


def test_two_files_of_one_machine_and_time_are_said(tmp_path):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    arrive(tmp_path, "a_{}_hay.txt", "0.2")
    run = run_fleet(fleet, at_once)
    assert run.done == 1
    assert "same machine and time" in next(iter(run.refused.values()))


def test_hostile_names_are_taken_or_refused(tmp_path):
    fleet = made_fleet(tmp_path)
    inbox = os.fsencode(tmp_path / "inbox")
    for name in (b"a_2026-03-01\xff.txt", b"a_2026-03-01\n.txt", b"'; DROP TABLE ledger;--.txt"):
        with open(os.path.join(inbox, name), "w") as file:
            file.write("0.1")
    (tmp_path / "inbox" / "a_2026-02-31.txt").write_text("0.1")
    fleet = made_fleet(tmp_path, more="").__class__(
        **{**vars(fleet), "machines": tuple(_any_name(own) for own in fleet.machines)}
    )
    run = run_fleet(fleet, at_once)
    assert run.done == 1
    assert len(run.refused) == 3
    assert run_fleet(fleet, at_once).done == 0


def _any_name(machine):
    return replace(machine, pattern=r"(?s)(?P<machine>a)_(?P<time>[\d-]+).*\.txt")


def test_files_being_written_are_waited_for(tmp_path, monkeypatch):
    fleet = made_fleet(tmp_path)
    path = tmp_path / "inbox" / "a_2026-03-01.txt"
    path.write_text("0.1")

    def grow(_):
        path.write_text("0.1" + "0" * path.stat().st_size)

    monkeypatch.setattr(running.time, "sleep", grow)
    run = run_fleet(fleet, at_once)
    assert (run.done, run.growing) == (0, (str(path),))
    # a clock that was set back makes no file younger than it is
    os.utime(path, (time.time() + 1e6,) * 2)
    monkeypatch.setattr(running.time, "sleep", lambda _: None)
    assert run_fleet(fleet, at_once).done == 1


def test_watching_takes_what_is_the_same_in_two_looks(tmp_path, monkeypatch):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    looks = []
    late = iter([lambda: arrive(tmp_path, "b_{}.txt", "0.2"), lambda: None, lambda: None])
    monkeypatch.setattr(running.time, "sleep", lambda _: next(late)())
    watch_fleet(fleet, at_once, every_s=1.0, told=looks.append, rounds=3)
    assert [look.done for look in looks] == [1, 1]


def test_two_runners_do_not_share_a_fleet(tmp_path):
    fleet = made_fleet(tmp_path)
    with running._alone(fleet), pytest.raises(ArgumentError, match="another gearmon fleet"):
        run_fleet(fleet, at_once)


def test_a_recording_that_kills_its_process_is_isolated(tmp_path, monkeypatch):
    monkeypatch.setattr("gearmon.fleet.engines._FORGIVEN", 1)
    fleet = made_fleet(tmp_path)
    for day in range(6):
        arrive(tmp_path, "a_{}.txt", "kill" if day == 2 else "0.1", days=day)
    run = run_fleet(fleet, standing_in)
    assert run.done == 5
    (path,) = run.failed
    assert "2026-03-03" in path
    assert "killed" in run.failed[path]


# -- the fleet file


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("recordings = 'inbox'", "recording = 'inbox'", "did you mean recordings?"),
        ("recordings = 'inbox'", "recordings = 'outbox'", "is no folder"),
        ("file = 'machine.toml'", "file = 'none.toml'", "no such file"),
        ("file = 'machine.toml'", "file = 3", "must be text in quotes"),
        (PATTERN, "(?P<day>.*)", "must have the group"),
        (PATTERN, "(?P<time>", "no regular expression"),
        ('name = "b"', 'name = "a"', "another machine"),
        ('name = "b"', 'name = "b"\nlimit = 20', "must lie in"),
        ('name = "b"', 'name = "b"\nalarm_on = ["fualt"]', 'did you mean "fault"'),
        ('name = "b"', 'name = "b"\n[[alarm]]\nwebhook = "ftp://x"', "must begin with"),
        ('name = "b"', 'name = "b"\nreference = "none.ref"', "gearmon learn makes it"),
    ],
)
def test_mistakes_are_said_with_file_key_and_value(tmp_path, old, new, message):
    made_fleet(tmp_path)
    path = tmp_path / "fleet.toml"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(MachineFileError) as caught:
        read_fleet(path)
    assert message in str(caught.value)
    assert "toml" in str(caught.value)


# -- kills


@pytest.mark.parametrize("kills", [30])
def test_killed_at_random_moments_the_store_is_that_of_an_undisturbed_run(tmp_path, kills):
    generator = random.Random(5)
    fleet = made_fleet(tmp_path)
    for number in range(60):
        text = generator.choice(["slow 0.1", "fault 0.2", "bad", "slow 0.3"])
        arrive(tmp_path, f"a_{{}}_c{number % 2}.txt", text, days=number % 28)
        arrive(tmp_path, f"b_{{}}_c{number % 2}.txt", text, days=number % 28)
    done = 0
    while done < kills:
        runner = os.fork()
        if not runner:
            run_fleet(fleet, at_once)
            os._exit(0)
        time.sleep(generator.uniform(0.0, 0.3))
        os.kill(runner, signal.SIGKILL)
        if os.waitpid(runner, 0)[1] == 0:  # it was done before: once more, from the beginning
            assert run_fleet(fleet, at_once).done == 0
            emptied(fleet)
        done += 1
    run_fleet(fleet, at_once)
    disturbed, results = content(fleet), rows_of(fleet)
    emptied(fleet)
    run_fleet(fleet, at_once)
    assert disturbed == content(fleet)
    assert results == rows_of(fleet)


def emptied(fleet):
    for path in (*fleet.store.parent.glob("fleet.db*"), *fleet.results.glob("*.parquet")):
        path.unlink()


def rows_of(fleet):
    """What the Parquet files say, whatever the order."""
    pandas = pytest.importorskip("pandas")
    table = pandas.read_parquet(fleet.results).drop(columns="ledger_id")
    return sorted(map(repr, table.to_dict("records")))


# -- alarms


def test_alarms_are_raised_and_cleared_by_class(tmp_path):
    fleet = made_fleet(tmp_path, ("a",))
    texts = ["0.1", "fault 0.1", "0.1", "fault 0.1", "fault 0.2", "0.1", "fault 0.1", "0.1"]
    for day, text in enumerate(texts):
        arrive(tmp_path, "a_{}_hay.txt", text, days=day)
    arrive(tmp_path, "a_{}_maize.txt", "fault 0.1", days=20)
    run_fleet(fleet, at_once)
    (alarm,) = alarms(fleet)
    assert (alarm["class"], alarm["finding"]) == ("hay", "wear, stage 1, pinion")
    assert alarm["since"] == "2026-03-04T00:00:00Z"
    assert not alarm["over"]
    for day in (10, 11):
        arrive(tmp_path, "a_{}_hay.txt", "0.1", days=day)
    run_fleet(fleet, at_once)
    (alarm,) = alarms(fleet)
    assert alarm["until"] == "2026-03-08T00:00:00Z"


def test_an_alarm_does_not_hang_on_the_tooth(tmp_path):
    fleet = made_fleet(tmp_path, ("a",))
    for day, tooth in enumerate((5, 6, 5)):
        arrive(tmp_path, "a_{}.txt", f"tooth {tooth} 0.1", days=day)
    run_fleet(fleet, at_once)
    assert [own["finding"] for own in alarms(fleet)] == ["tooth damage, stage 1, pinion"]


def test_an_old_history_is_made_new_when_it_is_added_to(tmp_path):
    from gearmon.diagnosis.history import append

    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    run_fleet(fleet, at_once)
    entries = read_history(fleet.store, "a").entries
    with closing(sqlite3.connect(fleet.store)) as store:
        store.executescript("DROP TABLE latest; PRAGMA user_version = 2;")
    assert read_history(fleet.store, "a").entries == entries
    append(fleet.store, entries, replace=True)
    assert [own["recordings"] for own in read_latest(fleet.store)] == [1]
