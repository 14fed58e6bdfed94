"""What arrives is analysed once, whoever is killed; what cannot be used is said."""

from __future__ import annotations

import os
import random
import resource
import signal
import sqlite3
import time
from contextlib import closing
from dataclasses import fields, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from reference.fleet_stand_in import (
    PATTERN,
    arrive,
    at_once,
    content,
    made_fleet,
    said,
    standing_in,
)
from scipy.stats import spearmanr
from scipy.stats import t as student

from gearmon.diagnosis.history import read_history, read_latest
from gearmon.errors import ArgumentError, GearmonError, MachineFileError, SignatureError
from gearmon.fleet import alarms, read_fleet, run_fleet, watch_fleet
from gearmon.fleet import run as running
from gearmon.fleet.ledger import compare, rank, write_results
from gearmon.fleet.plan import FleetMachine, Hook, arrived, is_remote
from gearmon.fleet.run import analysed
from gearmon.signals.recording import Recording
from gearmon.threads import THREADS, cores


def test_progress_rises_from_the_first_recording_to_all_of_them(tmp_path):
    fleet, told = made_fleet(tmp_path), []
    for day in range(4):
        arrive(tmp_path, "a_{}.txt", "bad" if day == 2 else "0.1", days=day)
    run_fleet(fleet, at_once, progress=told.append)
    assert told == [0.25, 0.5, 0.75, 1.0]


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


def test_the_answer_of_a_run_tells_all_that_it_did_and_only_alarms_that_stand(tmp_path):
    fleet = made_fleet(tmp_path)
    for day, text in enumerate(("fault 0.1", "fault 0.1", "0.1", "0.1", "0.1")):
        arrive(tmp_path, "a_{}.txt", text, days=day)
        arrive(tmp_path, "b_{}.txt", "bad" if day == 4 else "fault 0.1", days=day)
    arrive(tmp_path, "notes.txt", "0.2")
    growing = arrive(tmp_path, "a_{}.txt", "0.1", days=9)
    before = {job.path: job.state for job in arrived(fleet)[0]} | {str(growing): ("smaller",)}
    run = run_fleet(fleet, at_once, before=before)
    told = run.to_dict(fleet)
    assert (told["fleet"], told["store"]) == (fleet.name, str(fleet.store))
    assert (run.done, told["analysed"]) == (9, 9)
    assert told["failed"] == [
        {"recording": str(tmp_path / "inbox" / "b_2026-03-05.txt"), "why": "cannot be used"}
    ]
    (refused,) = told["not_taken"]
    assert refused["recording"] == str(tmp_path / "inbox" / "notes.txt")
    assert refused["why"] == run.refused[refused["recording"]]
    assert told["being_written"] == [str(growing)]
    assert told["ledger"] == {"being written": 1, "done": 9, "failed": 1}
    assert told["results"] == [str(path) for path in run.results]
    assert {own["machine"]: own["over"] for own in alarms(fleet)} == {"a": True, "b": False}
    assert [own["machine"] for own in told["alarms"]] == ["b"]


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


def test_of_several_gears_the_largest_loss_is_told_with_its_interval(tmp_path):
    pandas = pytest.importorskip("pandas")
    fleet = made_fleet(tmp_path, ("a",))

    def worn(jobs):
        for outcome in map(said, jobs):
            (known,) = outcome.entry.places
            places = [
                replace(known, gear=gear, loss=loss, loss_low=loss - 0.02, loss_high=loss + 0.03)
                for gear, loss in (("pinion", 0.1), ("gear", 0.25))
            ]
            yield replace(outcome, entry=replace(outcome.entry, places=tuple(places)))

    arrive(tmp_path, "a_{}.txt", "fault 0.1")
    run_fleet(fleet, worn)
    (row,) = pandas.read_parquet(fleet.results).to_dict("records")
    assert [row[name] for name in ("loss", "loss_low", "loss_high")] == [0.25, 0.23, 0.28]


def test_two_files_of_one_machine_and_time_are_said(tmp_path):
    fleet = made_fleet(tmp_path)
    first = arrive(tmp_path, "a_{}.txt", "0.1")
    second = arrive(tmp_path, "a_{}_hay.txt", "0.2")
    run = run_fleet(fleet, at_once)
    assert run.done == 1
    assert run.refused == {str(second): f"is of the same machine and time as {first}"}


def test_another_file_of_a_time_that_the_history_knows_is_refused(tmp_path):
    fleet = made_fleet(tmp_path)
    first = arrive(tmp_path, "a_{}.txt", "0.1")
    run_fleet(fleet, at_once)
    first.unlink()
    arrive(tmp_path, "a_{}_hay.txt", "0.2")
    (why,) = run_fleet(fleet, at_once).failed.values()
    assert "already" in why
    assert [own.score for own in read_history(fleet.store, "a").entries] == [0.1]


def test_a_recording_that_the_history_lacks_is_said(tmp_path):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    run_fleet(fleet, at_once)
    with closing(sqlite3.connect(fleet.store)) as store:
        store.execute("DELETE FROM recordings")
        store.commit()
    with pytest.raises(SignatureError, match="a recording of 'a' is missing"):
        rank(fleet)


NAMES = (b"\xff\xfe", b"new\nline", b"$HOME", b"<script>", b"'; DROP TABLE ledger;--", b"x" * 230)


def test_hostile_names_are_taken_or_refused(tmp_path):
    made_fleet(tmp_path)
    inbox, hour_ago = os.fsencode(tmp_path / "inbox"), time.time() - 3600
    taken = [b"a_2026-03-%02d%s.txt" % (day, name) for day, name in enumerate(NAMES, 1)]
    refused = [b"evil.txt", b"\n\xff.txt", b"a_2026-02-31.txt", b"a_2026-03-01.txt"]
    for name in (*taken, *refused, b".a_2026-03-20.txt"):  # hidden ones are passed over
        path = os.path.join(inbox, name)
        with open(path, "w") as file:
            file.write("0.1")
        os.utime(path, (hour_ago, hour_ago))
    text = (tmp_path / "fleet.toml").read_text()
    any_name = r"(?s)(?P<machine>a)_(?P<time>[\d-]+).*\.txt"
    (tmp_path / "fleet.toml").write_text(text.replace(PATTERN, any_name))
    fleet = read_fleet(tmp_path / "fleet.toml")
    run = run_fleet(fleet, at_once)
    # of two of the same machine and time one is taken
    assert (run.done, len(run.refused)) == (len(NAMES), len(refused))
    assert run_fleet(fleet, at_once).done == 0
    assert len(read_history(fleet.store, "a").entries) == len(NAMES)


def test_ten_thousand_files_in_a_folder_are_looked_through(tmp_path):
    fleet, every = made_fleet(tmp_path), 10_000
    for number in range(every):
        day = np.datetime64("2000-01-01") + number
        (tmp_path / "inbox" / f"a_{day}.txt").touch()
    jobs, refused = arrived(fleet)
    assert (len(jobs), refused) == (every, {})
    run = run_fleet(fleet, lambda ready: map(said, ready[:0]), before={})
    assert len(run.growing) == every


def test_a_recording_larger_than_memory_is_said_at_once(tmp_path):
    fleet = made_fleet(tmp_path)
    path = tmp_path / "inbox" / "a_2026-03-01.txt"
    with path.open("w") as file:
        file.truncate(1 << 43)
    os.utime(path, (0, 0))
    (why,) = run_fleet(fleet, lambda jobs: map(analysed, jobs)).failed.values()
    assert "8796.1 GB of recording take more memory than there is" in why


@pytest.mark.parametrize(("size_gb", "fits"), [(0.6, True), (0.7, False)])
def test_a_recording_takes_three_times_its_size_of_the_memory_of_a_process(
    tmp_path, monkeypatch, size_gb, fits
):
    """Eight gigabytes for four processes are two for each."""
    monkeypatch.setattr(running, "free_bytes", lambda: 8e9)
    monkeypatch.setattr(running.os, "cpu_count", lambda: 4)
    monkeypatch.setattr(running, "judged", stopped)
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    (job,), _ = arrived(fleet)
    why = analysed(replace(job, size=round(size_gb * 1e9))).why
    told = f"{size_gb} GB of recording take more memory than there is (8.0 GB free for 4 processes)"
    assert why.startswith("stopped here" if fits else told)


def stopped(*_):
    raise GearmonError("stopped here")


def test_without_room_on_the_disk_it_is_said_and_gone_on_with_later(tmp_path):
    fleet = made_fleet(tmp_path)
    for day in range(28):
        arrive(tmp_path, "a_{}.txt", "fault 0.1", days=day)
    runner = os.fork()
    if not runner:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, resource.RLIM_INFINITY))
        try:
            run_fleet(fleet, at_once)
        except GearmonError as error:
            os._exit(2 if "cannot write" in str(error) and "\n" not in str(error) else 70)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(runner, 0)[1]) == 2
    assert 0 < run_fleet(fleet, at_once).done < 28
    disturbed = content(fleet)
    emptied(fleet)
    run_fleet(fleet, at_once)
    assert content(fleet) == disturbed


@pytest.mark.parametrize("jump_s", [-1e6, 1e6])
def test_a_clock_that_jumps_hides_nothing_and_does_nothing_twice(tmp_path, monkeypatch, jump_s):
    fleet, clock = made_fleet(tmp_path), time.time
    monkeypatch.setattr(running.time, "sleep", lambda _: None)
    arrive(tmp_path, "a_{}.txt", "0.1")
    looks = []
    watch_fleet(fleet, at_once, every_s=1.0, told=looks.append, rounds=2)
    monkeypatch.setattr(running.time, "time", lambda: clock() + jump_s)
    arrive(tmp_path, "b_{}.txt", "0.2")
    watch_fleet(fleet, at_once, every_s=1.0, told=looks.append, rounds=2)
    assert [look.done for look in looks] == [1, 1]
    assert run_fleet(fleet, at_once).done == 0


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


@pytest.mark.parametrize("scheme", ["", "file://"])
def test_a_folder_among_the_recordings_is_none(tmp_path, scheme):
    if scheme:
        pytest.importorskip("fsspec")
    made_fleet(tmp_path)
    text = (tmp_path / "fleet.toml").read_text()
    (tmp_path / "fleet.toml").write_text(text.replace("'inbox'", f"'{scheme}{tmp_path}/inbox'"))
    path, seen = arrive(tmp_path, "a_{}.txt", "0.1"), []
    (tmp_path / "inbox" / "b_2026-03-01.txt").mkdir()
    run = run_fleet(read_fleet(tmp_path / "fleet.toml"), lambda jobs: seen.extend(jobs) or ())
    assert [str(job.path) for job in seen] == [f"{scheme}{path}"]
    assert not run.refused


def test_a_folder_that_cannot_be_reached_is_said(tmp_path):
    pytest.importorskip("fsspec")
    made_fleet(tmp_path)
    text = (tmp_path / "fleet.toml").read_text().replace("'inbox'", "'nowhere://inbox'")
    (tmp_path / "fleet.toml").write_text(text)
    with pytest.raises(ArgumentError, match=r'"nowhere://inbox": cannot be read \(Protocol'):
        run_fleet(read_fleet(tmp_path / "fleet.toml"), at_once)


@pytest.mark.parametrize("place", ["inbox", "a:b/inbox", r"C:\recordings", "/var//log:1"])
def test_only_what_names_a_scheme_is_elsewhere(place):
    assert not is_remote(place)
    assert is_remote(f"s3://{place}")


def test_a_link_in_a_circle_is_said_with_the_recordings_that_cannot_be_used(tmp_path):
    fleet = made_fleet(tmp_path)
    (tmp_path / "inbox" / "a_2026-03-01.txt").symlink_to("a_2026-03-01.txt")
    (tmp_path / "inbox" / "b_2026-03-01.txt").symlink_to("gone.txt")
    run = run_fleet(fleet, lambda jobs: map(analysed, jobs))
    assert "symbolic links" in "".join(run.failed.values())
    assert len(run.failed) == 1
    assert not run_fleet(fleet, at_once).failed


def test_a_folder_that_is_gone_by_now_is_said(tmp_path):
    fleet = made_fleet(tmp_path)
    (tmp_path / "inbox").rmdir()
    with pytest.raises(ArgumentError, match=r'inbox": cannot be read \(No such file'):
        run_fleet(fleet, at_once)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("results", "machine.toml", r"machine.toml: cannot make this folder \(File exists\)"),
        ("store", "nowhere/fleet.db", "fleet.db.lock: cannot write there"),
    ],
)
def test_places_that_cannot_be_written_are_said(tmp_path, key, value, message):
    made_fleet(tmp_path)
    path = tmp_path / "fleet.toml"
    path.write_text(f"{key} = '{value}'\n{path.read_text()}")
    arrive(tmp_path, "a_{}.txt", "0.1")
    with pytest.raises(ArgumentError, match=message):
        run_fleet(read_fleet(path), at_once)


def test_files_of_others_hide_no_results_and_are_left_as_they_are(tmp_path):
    fleet = made_fleet(tmp_path)
    fleet.results.mkdir()
    for other in (fleet.results / "x-2026.parquet", Path(f"{fleet.store}.lock")):
        other.write_text("of somebody else")
    arrive(tmp_path, "a_{}.txt", "0.1")
    assert len(run_fleet(fleet, at_once).results) == 1
    assert Path(f"{fleet.store}.lock").read_text() == "of somebody else"


def test_watching_takes_what_is_the_same_in_two_looks(tmp_path, monkeypatch):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.1")
    looks = []
    late = iter([lambda: arrive(tmp_path, "b_{}.txt", "0.2"), lambda: None, lambda: None])
    monkeypatch.setattr(running.time, "sleep", lambda _: next(late)())
    watch_fleet(fleet, at_once, every_s=1.0, told=looks.append, rounds=3)
    assert [look.done for look in looks] == [1, 1]


@pytest.mark.parametrize("text", ["0.1", "bad", None])
def test_a_look_is_told_of_if_it_did_anything_be_it_in_vain(tmp_path, monkeypatch, text):
    fleet, told, waited = made_fleet(tmp_path), [], []
    monkeypatch.setattr(running.time, "sleep", waited.append)
    if text:
        arrive(tmp_path, "a_{}.txt", text)
    watch_fleet(fleet, at_once, every_s=7.0, told=told.append, rounds=3)
    # what is the same in two looks is ready at the second; nothing is waited for after the last
    assert [(run.done, len(run.failed)) for run in told] == (
        [] if text is None else [(1, 0)] if text == "0.1" else [(0, 1)]
    )
    assert waited == [7.0, 7.0]


def test_a_worker_of_a_cluster_keeps_to_one_core(monkeypatch):
    monkeypatch.setenv(THREADS, "3")
    assert running._batch([None, None], lambda _: cores()) == [1, 1]


def test_two_runners_do_not_share_a_fleet(tmp_path):
    fleet = made_fleet(tmp_path)
    with running._alone(fleet), pytest.raises(ArgumentError, match="another gearmon fleet"):
        run_fleet(fleet, at_once)


def test_a_recording_that_kills_its_process_is_isolated(tmp_path, monkeypatch):
    monkeypatch.setattr("gearmon.fleet.run._FORGIVEN", 1)
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
        ("[defaults]", "store = 's3://b/fleet.db'\n[defaults]", "and lie on this computer"),
        ("[defaults]", "results = 3\n[defaults]", "results = 3 must be text in quotes"),
        ("recordings = 'inbox'", "recordings = ''", "is no folder"),
        ("[defaults]", "[[defaults]]\n[[defaults]]", "defaults must be one table"),
        (PATTERN, "(?P<day>.*)", "must have the group"),
        (PATTERN, "(?P<machine>.*)", "must have the group"),
        (PATTERN, "(?P<time>", "no regular expression"),
        (PATTERN, "(?P<time>.*)(?P<day>.*)", "may have machine and class, no others"),
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


OF_A_MACHINE = {own.name for own in fields(FleetMachine)}
OF_A_HOOK = {own.name for own in fields(Hook)}
TABLES = {
    "": {"name", "store", "results", "defaults", "machine", "alarm"},
    "[defaults]": OF_A_MACHINE - {"name"},
    "[[machine]]": OF_A_MACHINE,
    "[[alarm]]": OF_A_HOOK,
}


@pytest.mark.parametrize("head", TABLES)
def test_a_key_that_belongs_elsewhere_is_refused(tmp_path, head):
    """Keys of other tables, and words that a person may take for a key."""
    made_fleet(tmp_path, more='[[alarm]]\ncommand = ["true"]\n')
    path = tmp_path / "fleet.toml"
    text = path.read_text()
    words = {"hook", "hooks", "alarms", "machines", "operating", "stage", "sensor", "email", "url"}
    for key in sorted(set().union(words, *TABLES.values()) - TABLES[head]):
        line = f"{key} = 1\n"
        path.write_text(text.replace(f"{head}\n", f"{head}\n{line}", 1) if head else line + text)
        with pytest.raises(MachineFileError, match=rf"{key} is not a known key"):
            read_fleet(path)


def test_what_a_machine_says_itself_goes_before_what_all_say(tmp_path):
    own = "limit = 0.2\nalarm_after = 5\ntags = ['old']"
    fleet = made_fleet(tmp_path, ("a",), per_machine=own)
    path = tmp_path / "fleet.toml"
    shared = "limit = 0.4\nalarm_after = 9\nalarm_clear = 7\ntags = ['new']\n"
    more = '[[machine]]\nname = "b"\n'
    path.write_text(path.read_text().replace("[defaults]\n", f"[defaults]\n{shared}") + more)
    a, b = read_fleet(path).machines
    assert (a.limit, a.alarm_after, a.alarm_clear, a.tags) == (0.2, 5, 7, ("old",))
    assert (b.limit, b.alarm_after, b.alarm_clear, b.tags) == (0.4, 9, 7, ("new",))
    assert fleet.machines[0].alarm_clear == 3


def test_a_recording_is_judged_as_its_machine_says(tmp_path, monkeypatch):
    """By its own name, at its rate, in its columns, and with its reference if it has one."""
    asked = {}

    def read(file, **settings):
        asked.update(settings, file=file)
        return made_recording

    def analyse(*given):
        asked["analysed"] = given
        return "analysis"

    made_recording = Recording(samples=np.eye(2, 20), sampling_rate_hz=100.0)
    monkeypatch.setattr(running, "read_recording", read)
    monkeypatch.setattr("gearmon.diagnosis.analysis.analyse", analyse)
    monkeypatch.setattr(running, "read_reference", lambda path: f"read from {path}")
    (tmp_path / "healthy.ref").touch()
    known = "sampling_rate_hz = 5120.0\nsensors = ['a2', 1]\nreference = 'healthy.ref'"
    for settings, columns, rate in ((known, ["a2", 1], 5120.0), ("", None, None)):
        (machine,) = made_fleet(tmp_path, ("tractor7",), per_machine=settings).machines
        judged = running.judged(machine, "copy", "s3://bucket/original")
        analysis, recording, reference, own = judged
        assert asked["file"] == "copy"
        assert asked["channels"] in (None, tuple(columns or ()))
        assert bool(asked["channels"]) == bool(columns)
        assert (asked["sampling_rate_hz"], asked["sensors"]) == (rate, own.sensors)
        assert recording.origin == "s3://bucket/original"
        assert own.name == "tractor7"
        assert reference == (f"read from {tmp_path / 'healthy.ref'}" if settings else None)
        assert (analysis, asked["analysed"]) == ("analysis", (recording, own, reference))


# -- kills


@pytest.mark.parametrize("kills", [12])
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
    for day, tooth in enumerate((5, 16, 105)):
        arrive(tmp_path, "a_{}.txt", f"tooth {tooth} 0.1", days=day)
    run_fleet(fleet, at_once)
    assert [own["finding"] for own in alarms(fleet)] == ["tooth damage, stage 1, pinion"]


# -- damage


CELLS = [
    ("ledger", "time_s", 1e9),
    ("ledger", "state", "failed"),
    ("ledger", "indicators", b"\xff\xfe"),
    ("alarms", "since_s", b"\xff\xfe"),
    ("alarms", "told", "[1]"),
    ("latest", "verdict", "healthy"),
    ("latest", "scores", 1 << 60),
    ("recordings", "verdict", "healthy"),
    ("recordings", "places", "[]"),
]


def looked_at(fleet):
    """Everything that is told of a fleet."""
    for path in fleet.results.glob("*.parquet"):
        path.unlink()
    return rank(fleet), alarms(fleet), read_latest(fleet.store), write_results(fleet)


def test_a_machine_is_put_beside_the_others_with_the_same_gears(tmp_path):
    values = dict(zip("abcde", (0.1, 0.12, 0.11, 0.13, 0.9), strict=True))
    fleet = made_fleet(tmp_path, tuple(values))
    for day in range(3):
        for name, value in values.items():
            arrive(tmp_path, f"{name}_{{}}.txt", str(value), days=day)
    run_fleet(fleet, at_once)
    rows = compare(fleet)
    assert rows[0]["machine"] == "e"
    ends = np.array([-1.0, 1.0])
    logs = {name: np.log(1 + value) for name, value in values.items()}
    for row in rows:
        others = [own for name, own in logs.items() if name != row["machine"]]
        spread = np.std(others, ddof=1) * np.sqrt(1 + 1 / 4)
        away = (logs[row["machine"]] - np.mean(others)) / spread
        assert row["others"] == 4
        assert row["value"] == pytest.approx(1 + values[row["machine"]])
        assert row["usual"] == pytest.approx(np.exp(np.mean(others)))
        assert row["probability"] == pytest.approx(2 * student.sf(abs(away), 3))
        reach = student.ppf(0.95, 3) * spread
        assert np.log([row["low"], row["high"]]) == pytest.approx(np.mean(others) + reach * ends)
        assert row["false_discoveries"] >= row["probability"]
    assert rows == compare(fleet, fleet.machines[0])
    with pytest.raises(ArgumentError, match="it takes 4 machines with the same gears"):
        compare(replace(fleet, machines=fleet.machines[:3]))


def test_what_another_version_analysed_is_done_again_on_demand(tmp_path, monkeypatch):
    fleet = made_fleet(tmp_path)
    arrive(tmp_path, "a_{}.txt", "0.2")
    with monkeypatch.context() as older:
        older.setattr("gearmon.fleet.ledger.__version__", "0.0.1")
        assert run_fleet(fleet, at_once).done == 1
    assert run_fleet(fleet, at_once).done == 0
    assert run_fleet(fleet, at_once, again=True).done == 1
    assert run_fleet(fleet, at_once, again=True).done == 0


def test_machines_are_compared_by_their_latest_recordings(tmp_path):
    """What a machine was like before its last twenty recordings does not count."""
    fleet = made_fleet(tmp_path, tuple("abcd"))
    for day in range(31):
        arrive(tmp_path, "a_{}.txt", "0.9" if day < 11 else "0.2", days=day)
    for name in "bcd":
        arrive(tmp_path, f"{name}_{{}}.txt", "0.1")
    run_fleet(fleet, at_once)
    (own,) = (row for row in compare(fleet) if row["machine"] == "a")
    assert own["value"] == pytest.approx(1.2)


def test_among_machines_alike_the_probability_is_uniform(tmp_path):
    seeded, fleet = np.random.default_rng(5), made_fleet(tmp_path, ("a", "b", "c", "d", "e"))

    def drawn(jobs):
        for job in jobs:
            levels = {f"a{k}": float(x) for k, x in enumerate(seeded.lognormal(size=400))}
            yield replace(said(job), indicators={"rms": levels})

    for machine in fleet.machines:
        arrive(tmp_path, f"{machine.name}_{{}}.txt", "0.1")
    run_fleet(fleet, drawn)
    found = np.array([row["probability"] for row in compare(fleet)])
    assert found.size == 2000
    # five machines share their values: a scatter of at most that of 400 draws
    for level in (0.05, 0.2, 0.5, 0.8):
        assert abs(np.mean(found < level) - level) < 4 * np.sqrt(level * (1 - level) / 400)


def ranked_by_hand(values, classes, late, early):
    """Monotonicity, trend and separation, number by number."""
    usual = {own: np.median(values[classes == own]) for own in set(classes)}
    course = values - np.array([usual[own] for own in classes])
    part = [10 * place // len(course) for place in range(len(course))]
    middle = [np.median(course[np.equal(part, own)]) for own in range(10)]
    steps = np.sign(np.diff(middle))
    wins = np.mean([0.5 + 0.5 * np.sign(b - a) for b in course[late] for a in course[early]])
    trend = spearmanr(course, np.arange(len(course))).statistic
    return abs(steps.sum()) / 9, abs(trend), abs(2 * wins - 1), wins > 0.5


@pytest.mark.parametrize("faults", [(), (5, 9, 11, 14)])
def test_indicators_are_ranked_by_how_clearly_they_change(tmp_path, faults):
    """Without a fault the last third is held against the first; levels of classes are taken off."""
    fleet, seeded = made_fleet(tmp_path, ("a",)), np.random.default_rng(3)
    classes = np.array(["hay", "maize", "hay"] * 5)
    level = np.where(classes == "maize", 40.0, 1.0)
    courses = {
        "falls": level - 0.3 * np.arange(15) + seeded.normal(size=15),
        # heavy tails, on one side: neither a mean nor a plain correlation tells their course
        "rises": level + np.exp(0.4 * np.arange(15) + seeded.normal(size=15)),
        "stays": level + seeded.normal(size=15),
    }

    def drawn(jobs):
        for job in jobs:
            day = round((job.time_s - datetime(2026, 3, 1, tzinfo=UTC).timestamp()) / 86400)
            levels = {name: float(course[day]) for name, course in courses.items()}
            yield replace(said(job), indicators={"rms": levels})

    for day, own in enumerate(classes):
        text = "fault 0.1" if day in faults else "0.1"
        arrive(tmp_path, f"a_{{}}_{own}.txt", text, days=day)
    run_fleet(fleet, drawn)
    rows = {row["indicator"]: row for row in rank(fleet)}
    late = np.isin(np.arange(15), faults or range(10, 15))
    early = ~late if faults else np.arange(15) < 5
    for name, course in courses.items():
        row = rows[f"rms, {name}"]
        *measures, rises = ranked_by_hand(course, classes, late, early)
        found = [row[key] for key in ("monotonicity", "trend", "separation")]
        assert found == pytest.approx(measures)
        assert row["clearness"] == pytest.approx(np.mean(measures))
        assert (row["rises"], row["recordings"]) == (rises, 15)
    assert list(rows) == sorted(rows, key=lambda name: -rows[name]["clearness"])


@pytest.mark.parametrize(("table", "column", "value"), CELLS)
def test_damaged_cells_are_said(tmp_path, table, column, value):
    fleet = made_fleet(tmp_path, ("a",))
    for day in range(6):
        arrive(tmp_path, "a_{}.txt", "fault 0.1", days=day)
    run_fleet(fleet, at_once)
    looked_at(fleet)
    with closing(sqlite3.connect(fleet.store)) as store:
        store.execute(f"UPDATE {table} SET {column} = ? WHERE rowid = 1", (value,))
        store.commit()
    with pytest.raises(SignatureError, match=r"damaged one \(.*restore a copy"):
        looked_at(fleet)


def test_numbers_of_many_digits_are_written_once(tmp_path):
    fleet = made_fleet(tmp_path, ("a",))
    arrive(tmp_path, "a_{}.txt", "0.1")
    run_fleet(fleet, at_once)
    with closing(sqlite3.connect(fleet.store)) as store:
        store.execute("UPDATE ledger SET id = ?", (1 << 60,))
        store.commit()
    assert len(write_results(fleet)) == 1
    assert write_results(fleet) == []


def test_an_index_that_hides_rows_is_said(tmp_path):
    fleet = made_fleet(tmp_path, ("a",))
    for day in range(6):
        arrive(tmp_path, "a_{}.txt", "fault 0.1", days=day)
    run_fleet(fleet, at_once)
    with closing(sqlite3.connect(fleet.store)) as store:
        # an index of only some rows, which is then said to be of all
        store.executescript(
            "DROP INDEX ledger_by_machine;"
            "CREATE INDEX ledger_by_machine ON ledger (machine, time_s) WHERE id > 3;"
            "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, "
            "' WHERE id > 3', '') WHERE name = 'ledger_by_machine';"
        )
    with pytest.raises(SignatureError, match="missing from index"):
        rank(fleet)


def test_a_store_of_an_earlier_version_is_refused(tmp_path):
    fleet = made_fleet(tmp_path, ("a",))
    arrive(tmp_path, "a_{}.txt", "fault 0.1")
    run_fleet(fleet, at_once)
    with closing(sqlite3.connect(fleet.store)) as store:
        store.execute("PRAGMA user_version = 4")
        store.commit()
    for again in (rank, lambda own: run_fleet(own, at_once)):
        with pytest.raises(SignatureError, match=r"has schema 4.*analyse the recordings anew"):
            again(fleet)
