"""Histories: entries, times, the file they are kept in, and what they show."""

from __future__ import annotations

import csv
import json
import os
import sqlite3
import threading
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from types import SimpleNamespace

import numpy as np
import pytest
from reference.small_gearbox import as_json

from gearmon.diagnosis.history import (
    Entry,
    History,
    Place,
    append,
    entry_of,
    export_history,
    history_trends,
    read_history,
    recording_times,
    time_text,
)
from gearmon.diagnosis.history.entries import read_time, time_from_name
from gearmon.diagnosis.history.store import append_to, opened
from gearmon.diagnosis.history.trends import Crossing, normal_equivalent
from gearmon.diagnosis.results import Flag, ToothProfile
from gearmon.errors import ArgumentError, SignatureError
from gearmon.report.text import crossing_text, history_lines

WEEK = 7 * 86400.0


def entry(number=0, places=(), **changes):
    known = {
        "machine": "conveyor",
        "recording": f"r{number}.csv",
        "time_s": 1.7e9 + number * WEEK,
        "time_source": "given",
        "verdict": "healthy",
        "score": 0.25 * (number % 4),
        "false_alarm_probability": 0.5,
        "speed_hz": 24.5,
        "places": tuple(places),
    }
    return Entry(**(known | changes))


def tooth(number, loss, sigma=0.01, teeth=5):
    half = 1.6448536 * sigma
    return Place(
        stage=1,
        gear="pinion",
        teeth=teeth,
        tooth=number,
        loss=loss,
        loss_low=loss - half,
        loss_high=loss + half,
        loss_sigma=sigma,
    )


def cracked(count=20, begin=8, step=0.012, seed=3):
    """A history in which tooth 2 of five loses stiffness from some recording on."""
    generator = np.random.default_rng(seed)
    entries = []
    for number in range(count):
        true = max(0, number - begin) * step
        places = [
            tooth(j, float(generator.normal(true if j == 2 else 0.0, 0.01))) for j in range(1, 6)
        ]
        entries.append(entry(number, places, score=float(generator.exponential(0.4) + 50 * true)))
    return History(machine="conveyor", entries=tuple(entries))


def analysis(flags=(), profiles=(), verdict="fault"):
    return SimpleNamespace(
        machine="conveyor",
        recording="new.csv",
        verdict=verdict,
        score=3.0,
        false_alarm_probability=1e-3,
        flags=tuple(flags),
        profiles=tuple(profiles),
        signature=SimpleNamespace(speed=SimpleNamespace(estimated_hz=24.4)),
    )


def profile(**changes):
    known = {
        "stage": 1,
        "gear": "pinion",
        "teeth": 5,
        "order": 1.0,
        "energy": np.array([1.0, 9.0, 1.0, 1.0, 0.5]),
        "tooth": 2,
        "position": 0.3,
        "ratio": 9.0,
        "log10_probability": -3.0,
        "against": "reference",
    }
    return ToothProfile(**(known | changes))


def with_losses(profile_, losses, sigmas):
    return SimpleNamespace(
        **{name: getattr(profile_, name) for name in ToothProfile.__dataclass_fields__}
        | {"loss_by_tooth": np.array(losses), "loss_sigma_by_tooth": np.array(sigmas)}
    )


def flag(**changes):
    known = {
        "kind": "tooth damage",
        "stage": 1,
        "gear": "pinion",
        "tooth": 2,
        "stiffness_loss": 0.1,
        "stiffness_loss_low": 0.0,
        "stiffness_loss_high": 0.14,
        "false_alarm_probability": 1e-3,
        "evidence": (),
    }
    return Flag(**(known | changes))


NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)


# entries


def test_an_entry_keeps_every_tooth_and_the_gear():
    kept = entry_of(
        analysis([flag()], [with_losses(profile(), [0, 0.1, 0, np.nan, 0], [0.01] * 5)]), NOW
    )
    assert kept.time_s == NOW.timestamp()
    assert kept.findings == ("tooth damage, stage 1, pinion, tooth 2: loss 10 % (0 to 14 %)",)
    by_tooth = {place.tooth: place for place in kept.places}
    assert set(by_tooth) == {None, 1, 2, 3, 4, 5}
    assert by_tooth[2].loss == 0.1
    assert by_tooth[2].statistic == 9.0
    assert by_tooth[4].loss is None
    # the tooth and the gear as a whole have the interval that was flagged
    assert (by_tooth[2].loss_low, by_tooth[2].loss_high) == (0.0, 0.14)
    assert by_tooth[1].loss_low == pytest.approx(-0.0164485, abs=1e-6)
    # its wider side counts
    assert by_tooth[None].loss_sigma == pytest.approx(0.1 / 1.6448536)


def test_without_estimates_or_numbers_only_the_gear_is_kept():
    kept = entry_of(analysis([], [profile()], "healthy"), NOW)
    assert [place.tooth for place in kept.places] == [None]
    assert kept.places[0].loss is None
    loose = with_losses(profile(tooth=None), [0, 0.1, 0, 0, 0], [0.01] * 5)
    kept = entry_of(analysis([], [loose]), NOW)
    assert [(place.tooth, place.loss) for place in kept.places] == [(None, 0.1)]
    unsure = flag(stiffness_loss=None, stiffness_loss_low=None, stiffness_loss_high=None)
    assert entry_of(analysis([unsure], [profile()]), NOW).places[0].loss is None


@pytest.mark.parametrize("hours", [-7, 2, 5.5])
def test_one_moment_is_the_same_entry_wherever_it_is_told(hours):
    elsewhere = NOW.astimezone(timezone(timedelta(hours=hours)))
    assert entry_of(analysis(), elsewhere) == entry_of(analysis(), NOW)


def test_a_time_without_offset_is_refused():
    with pytest.raises(ArgumentError, match="offset"):
        entry_of(analysis(), datetime(2026, 3, 1))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"verdict": "fine"}, "verdict"),
        ({"score": float("nan")}, "score"),
        ({"false_alarm_probability": 1.5}, "false_alarm_probability"),
        ({"places": (tooth(1, 0.1), tooth(1, 0.2))}, "twice"),
    ],
)
def test_impossible_entries_are_refused(changes, message):
    with pytest.raises(ArgumentError, match=message):
        entry(**changes)
    with pytest.raises(ArgumentError, match="how sure"):
        Place(stage=1, gear="pinion", loss=0.1)


def test_history_is_in_the_order_of_time_and_knows_each_time_once():
    history = History(machine="conveyor")
    for number in (2, 0, 1):
        history = history.with_entry(entry(number))
    assert [e.recording for e in history.entries] == ["r0.csv", "r1.csv", "r2.csv"]
    with pytest.raises(ArgumentError, match="already"):
        history.with_entry(entry(1, recording="again.csv"))
    replaced = history.with_entry(entry(1, recording="again.csv"), replace=True)
    assert [e.recording for e in replaced.entries] == ["r0.csv", "again.csv", "r2.csv"]
    with pytest.raises(ArgumentError, match="machine"):
        history.with_entry(entry(5, machine="other"))


# times


@pytest.mark.parametrize(
    ("name", "time"),
    [
        ("pump_2026-11-21T10-30-00.csv", "2026-11-21T10:30:00Z"),
        ("20261121_1030.wav", "2026-11-21T10:30:00Z"),
        ("a1 2026.11.21.csv", "2026-11-21T00:00:00Z"),
        ("x20261121T103000+0100.h5", "2026-11-21T09:30:00Z"),
        ("12345678-20261121.csv", "2026-11-21T00:00:00Z"),
    ],
)
def test_times_in_names(name, time):
    assert time_text(time_from_name(f"/somewhere/1999-01-01/{name}").timestamp()) == time


@pytest.mark.parametrize(
    "name",
    [
        "new.csv",
        "20261341.csv",
        "2026-01-01_2026-01-02.csv",
        "2026-01-01 to 2026-01-02.csv",
        "20261121_3.csv",
    ],
)
def test_names_without_one_time_are_refused(name):
    with pytest.raises(ArgumentError, match="in the name"):
        time_from_name(name)


def test_times_are_given_or_read_but_never_invented(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("")
    os.utime(path, (1.7e9, 1.7e9))
    assert recording_times([str(path)], source="modified")[0].timestamp() == 1.7e9
    assert recording_times(["a"], "2026-01-01T00:00:00+02:00")[0] == read_time(
        "2025-12-31T22:00:00Z"
    )
    for given, source, message in (
        (None, None, "when were the recordings made"),
        ("2026-01-01", "name", "not both"),
        ("2026-01-01,2026-01-02", None, "2 times for 1"),
        ("yesterday", None, "ISO 8601"),
        (None, "guess", "one of modified, name"),
    ):
        with pytest.raises(ArgumentError, match=message):
            recording_times(["a.csv"], given, source)
    with pytest.raises(ArgumentError, match="cannot be looked at"):
        recording_times([str(tmp_path / "none.csv")], source="modified")


# the file


def test_what_is_written_is_read_back(tmp_path):
    path, history = tmp_path / "history.db", cracked(5)
    assert append(path, history.entries[:3]) == 0
    assert append(path, history.entries[3:]) == 0
    append(path, [entry(0, machine="other")])
    assert read_history(path, "conveyor").entries == history.entries
    assert len(read_history(path, "other").entries) == 1
    assert read_history(path, "unknown").entries == ()
    with pytest.raises(ArgumentError, match="'conveyor', 'other'"):
        read_history(path)
    with sqlite3.connect(path) as store:
        assert store.execute("PRAGMA journal_mode").fetchone()[0] == "wal"
    store.close()


@pytest.mark.parametrize("asked", [None, "drive \udcff", "drive \\udcff"])
def test_a_machine_whose_name_is_not_utf8_is_found_again(tmp_path, asked):
    path = tmp_path / "history.db"
    append(path, [entry(number, machine="drive \udcff") for number in range(3)])
    assert len(read_history(path, asked).entries) == 3


def test_where_nothing_can_be_written_it_is_read_unless_changes_are_still_beside(
    tmp_path, monkeypatch
):
    path = tmp_path / "history.db"
    append(path, cracked(3).entries)
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=0))
    assert len(read_history(path).entries) == 3
    (tmp_path / "history.db-wal").write_text("not yet in the file")
    with pytest.raises(SignatureError, match=r"changes are still in history\.db-wal"):
        read_history(path)


def test_duplicates_are_refused_or_replaced_and_nothing_is_half_written(tmp_path):
    path = tmp_path / "history.db"
    append(path, [entry(0), entry(1)])
    with pytest.raises(ArgumentError, match=r"r1\.csv.*already"):
        append(path, [entry(2), entry(1)])
    assert len(read_history(path).entries) == 2  # the third was not kept either
    assert append(path, [entry(1, [tooth(1, 0.2)], recording="new.csv")], replace=True) == 1
    found = read_history(path).entries
    assert [e.recording for e in found] == ["r0.csv", "new.csv"]
    assert len(found[1].places) == 1


@pytest.mark.parametrize("begun", [False, True])
def test_of_two_that_write_at_once_the_second_waits_for_the_first(tmp_path, begun):
    """Both look first whether a recording is there already, in a new file and in one of others."""
    path, looked = tmp_path / "history.db", threading.Event()
    if begun:
        append(path, [entry(0)])

    def second():
        with opened(path, create=True) as store:
            looked.set()
            append_to(store, entry(2))

    other = threading.Thread(target=second)
    with opened(path, create=True) as store:
        other.start()
        # one that did not wait would have looked by now
        looked.wait(0.2)
        append_to(store, entry(1))
    other.join()
    with opened(path, create=False) as store:
        told = [row["recording"] for row in store.execute("SELECT recording FROM recordings")]
    assert sorted(told) == ["r0.csv", "r1.csv", "r2.csv"][not begun :]


def test_another_machine_under_the_same_name_is_refused(tmp_path):
    path = tmp_path / "history.db"
    append(path, [entry(0, [tooth(1, 0.0)])])
    with pytest.raises(ArgumentError, match="has 7 teeth, and 5"):
        append(path, [entry(1, [tooth(1, 0.0, teeth=7)])])


@pytest.mark.parametrize("kind", ["text", "other", "earlier", "later", "cut", "broken", "empty"])
def test_unusable_files_give_one_clear_line(tmp_path, kind):
    path = tmp_path / "history.db"
    if kind == "text":
        path.write_text("no database at all, but long enough to look at" * 10)
    elif kind == "empty":
        path.write_text("")
    elif kind == "other":
        with sqlite3.connect(path) as store:
            store.execute("CREATE TABLE cats (name)")
        store.close()
    else:
        append(path, cracked(20).entries)
        with sqlite3.connect(path) as store:
            if kind in ("earlier", "later"):
                store.execute(f"PRAGMA user_version = {4 if kind == 'earlier' else 99}")
            store.execute("PRAGMA journal_mode = DELETE")
        store.close()
        data = path.read_bytes()
        if kind == "cut":
            path.write_bytes(data[: len(data) // 2])
        if kind == "broken":
            path.write_bytes(data[:4096] + b"\x55" * 4096 + data[8192:])
    with pytest.raises(SignatureError) as caught:
        read_history(path, "conveyor")
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_places_that_cannot_hold_a_history_are_refused(tmp_path):
    with pytest.raises(SignatureError, match="no such history"):
        read_history(tmp_path / "none.db", "conveyor")
    with pytest.raises(ArgumentError, match="folder"):
        append(tmp_path, [entry(0)])
    with pytest.raises(ArgumentError, match="folder does not exist"):
        append(tmp_path / "no" / "history.db", [entry(0)])
    assert list(tmp_path.iterdir()) == []


def test_tables_hold_the_same_rows(tmp_path):
    pyarrow = pytest.importorskip("pyarrow.parquet")
    history = History(machine="conveyor", entries=(*cracked(3).entries, entry(9)))
    with export_history(history, tmp_path / "h.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(history.rows()) == 3 * 5 + 1
    assert [float(r["loss"]) if r["loss"] else None for r in rows] == [
        r["loss"] for r in history.rows()
    ]
    table = pyarrow.read_table(export_history(history, tmp_path / "h.parquet"))
    assert table.to_pylist() == history.rows()
    with pytest.raises(ArgumentError, match=r"\.csv or \.parquet"):
        export_history(history, tmp_path / "h.txt")
    assert export_history(History(machine="x"), tmp_path / "e.csv").read_text().count("\n") == 1


# what it shows


def test_a_growing_loss_is_followed_to_its_limit():
    found = history_trends(cracked(), limit=0.2)
    first = found.teeth[0]
    assert (first.stage, first.gear, first.tooth) == (1, "pinion", 2)
    assert first.risen
    assert found.raised
    value, low, high = first.now
    assert low <= 0.132 <= high
    assert first.margin == pytest.approx((0.2 - value, 0.2 - high, 0.2 - low))
    begin = first.trend.changes[0]
    assert begin.low_s <= 1.7e9 + 8 * WEEK <= begin.high_s
    assert first.crossing.status == "ahead"
    assert first.crossing.low_s < first.crossing.time_s < first.crossing.high_s
    assert all(not tooth_.trend.changes for tooth_ in found.teeth[1:])
    assert found.began is not None
    told = "\n".join(history_lines(found))
    assert "pinion, tooth 2: loss of pair stiffness now" in told
    assert "grows since" in told
    assert "ahead" in told
    assert as_json(found.to_dict()) == found.to_dict()
    json.dumps(found.to_dict())
    assert "evidence=<Trend>" in repr(found)


def test_begin_and_limit_of_growing_losses_lie_in_their_intervals():
    """Of 90 %: three standard deviations of the count of ten histories below."""
    true, covered = 1.7e9 + (8 + 0.2 / 0.012) * WEEK, []
    for seed in range(10):
        history = cracked(seed=seed)
        alone = tuple(
            replace(e, places=tuple(p for p in e.places if p.tooth == 2)) for e in history.entries
        )
        (tooth_,) = history_trends(History(machine="conveyor", entries=alone)).teeth
        crossing, begin = tooth_.trend.crossing(0.2), tooth_.trend.changes[0]
        covered.append(
            (
                begin.low_s <= 1.7e9 + 8 * WEEK <= begin.high_s,
                crossing.low_s <= true <= crossing.high_s,
            )
        )
    assert np.sum(covered, axis=0).min() >= 7


def test_a_limit_is_told_with_the_interval_of_its_time():
    day = 86400.0
    known = Crossing(status="ahead", reason="on average", time_s=9 * day, low_s=5 * day)
    told = {fine: crossing_text(replace(known, high_s=20 * day), fine=fine) for fine in (0, 1)}
    assert told[0] == "ahead, 1970-01-10 (1970-01-06 to 1970-01-21): on average"
    assert told[1].startswith("ahead, 1970-01-10 00:00 (1970-01-06 00:00 to 1970-01-21 00:00): ")
    assert "(1970-01-06 to never)" in crossing_text(known, fine=False)
    assert "(now to never)" in crossing_text(replace(known, low_s=None), fine=False)
    unsaid = Crossing(status="not extrapolated", reason="too few")
    assert crossing_text(unsaid, fine=True) == "not extrapolated: too few"


def test_a_sound_machine_raises_nothing():
    found = history_trends(cracked(step=0.0), limit=0.2)
    assert not found.raised
    assert found.began is None
    assert found.shown == ()
    assert found.teeth[0].crossing.status == "not extrapolated"
    told = "\n".join(history_lines(found))
    assert "no change that chance" in told
    assert "5 teeth followed without a loss that stands clear" in told


def test_a_fault_is_for_a_person_while_it_is_the_last_that_was_heard():
    sound = cracked(step=0.0)
    for last, place in ((True, -1), (False, 0), (False, 10)):
        entries = list(sound.entries)
        entries[place] = replace(entries[place], verdict="fault")
        assert history_trends(replace(sound, entries=tuple(entries))).raised == last


@pytest.mark.parametrize("missing", ["loss_low", "loss_high"])
def test_an_interval_that_was_not_stated_is_that_of_the_uncertainty(missing):
    history = cracked()
    cut = replace(
        history,
        entries=tuple(
            replace(own, places=tuple(replace(place, **{missing: None}) for place in own.places))
            for own in history.entries
        ),
    )
    whole, found = (history_trends(own).teeth[0] for own in (history, cut))
    np.testing.assert_allclose(found.low, whole.low, atol=1e-8)
    np.testing.assert_allclose(found.high, whole.high, atol=1e-8)


def with_loss(losses, sigmas, teeth=(1,)):
    """A history of the same losses on some teeth."""
    return History(
        machine="conveyor",
        entries=tuple(
            entry(n, [tooth(j, float(loss), float(sigma)) for j in teeth])
            for n, (loss, sigma) in enumerate(zip(losses, sigmas, strict=True))
        ),
    )


def test_estimates_far_below_their_uncertainty_show_nothing_however_orderly():
    # what a search gives for sound teeth: next to nothing, and never zero
    growing = 1e-6 * np.exp(0.3 * np.arange(20))
    found = history_trends(with_loss(growing, np.full(20, 0.005), range(1, 80)), limit=0.2)
    assert found.shown == ()
    assert not found.raised
    assert all(not tooth_.trend.changes for tooth_ in found.teeth)


@pytest.mark.parametrize("seed", range(8))
def test_noise_on_many_teeth_lists_none(seed):
    generator = np.random.default_rng(seed)
    entries = tuple(
        entry(n, [tooth(j, float(generator.normal(0.0, 0.01)), teeth=60) for j in range(1, 61)])
        for n in range(12)
    )
    assert history_trends(History(machine="conveyor", entries=entries)).shown == ()


def test_a_loss_in_two_recordings_is_no_trend():
    losses = np.r_[np.zeros(10), 0.3, 0.3]
    found = history_trends(with_loss(losses, np.full(12, 0.01)))
    assert found.shown == ()
    found = history_trends(with_loss(np.r_[losses, 0.3, 0.3], np.full(14, 0.01)))
    assert [tooth_.tooth for tooth_ in found.shown] == [1]
    assert found.shown[0].trend.changes[0].kind == "step"


@pytest.mark.parametrize(("teeth", "listed"), [(5, True), (39, True), (41, False), (80, False)])
def test_a_steady_loss_is_listed_unless_so_many_teeth_show_it_by_chance(teeth, listed):
    """Clear thrice of thrice, a sound tooth has 0.05^3; of all no more than 0.005 is allowed."""
    places = [tooth(j, 0.03 if j == 2 else 0.0, teeth=teeth) for j in range(1, teeth + 1)]
    entries = tuple(entry(n, places) for n in range(3))
    found = history_trends(History(machine="conveyor", entries=entries))
    assert [own.tooth for own in found.shown] == ([2] if listed else [])
    assert all(not own.trend.changes for own in found.teeth)


def test_what_all_recordings_share_is_not_averaged_out():
    # the scale of all losses is off by a third, and each recording says that it may be
    true = 0.02 * np.maximum(np.arange(20) - 6.0, 0.0)
    generator = np.random.default_rng(1)
    losses = 0.7 * true + generator.normal(0.0, 0.004, 20)
    sigmas = np.hypot(0.26 * np.abs(losses), 0.005)
    found = history_trends(with_loss(losses, sigmas), limit=0.4).shown[0]
    value, low, high = found.now
    assert low <= true[-1] <= high
    assert high - low < 1.2 * 2 * 1.645 * sigmas[-1]
    assert found.crossing.low_s <= 1.7e9 + 26 * WEEK <= found.crossing.high_s
    rate = 0.02 / WEEK
    assert found.trend.rate()[1] <= rate <= found.trend.rate()[2]
    # more recordings of the same make the trend surer, its size not
    again = history_trends(with_loss(np.repeat(losses, 4), np.repeat(sigmas, 4)), limit=0.4).shown[
        0
    ]
    assert (again.now[2] - again.now[1]) / again.now[0] > 0.9 * 2 * 1.645 * 0.26
    assert value == pytest.approx(0.7 * true[-1], abs=0.01)


def test_losses_too_small_to_be_found_are_not_taken_for_none():
    # nothing is found below 4 %, and then at once nearly all of it
    true = 0.01 * np.arange(20.0)
    losses = np.where(true < 0.04, 0.0, true)
    sigmas = np.where(true < 0.04, 0.005, 0.2 * true)
    found = history_trends(with_loss(losses, sigmas)).shown[0]
    assert found.trend.missed == pytest.approx(0.04)
    times = found.trend.series.time_s
    _, low, high = found.trend.at(times)
    assert np.all((low <= true) & (true <= high))
    assert "may have begun earlier" in "\n".join(
        history_lines(history_trends(with_loss(losses, sigmas)))
    )


def test_a_loss_that_came_at_once_was_hardly_missed_before():
    losses, sigmas = np.repeat([0.0, 0.4], 8), np.repeat([0.005, 0.1], 8)
    found = history_trends(with_loss(losses, sigmas)).shown[0]
    assert found.trend.changes[0].kind == "step"
    _, _, high = found.trend.at(found.trend.series.time_s)
    assert np.all(high[:8] < 0.2)
    assert np.all(high[8:] > 0.4)


def test_forecasts_are_those_of_their_time():
    history = cracked(24)
    whole = history_trends(history, limit=0.25)
    for count in (18, 24):
        known = History(machine="conveyor", entries=history.entries[:count])
        crossing = history_trends(known, limit=0.25).shown[0].crossing
        assert whole.forecasts[known.entries[-1].time_s] == crossing
    assert history.entries[3].time_s not in whole.forecasts
    assert history_trends(history).forecasts == {}
    rows = as_json(whole.to_dict())["recordings"]
    assert rows[3]["limit_reached"] is None
    assert rows[-1]["limit_reached"]["status"] == whole.forecasts[history.entries[-1].time_s].status
    told = history_lines(whole)
    dated = [line for line in told if "limit about 202" in line]
    assert len(dated) == sum(c.status == "ahead" for c in whole.forecasts.values()) > 3


def test_a_limit_that_one_tooth_has_reached_stands_before_that_of_another():
    times = np.arange(24.0)
    entries = []
    for one, other in zip(0.02 * times, 0.008 * times, strict=True):
        places = [tooth(1, float(one), 0.01), tooth(2, float(other), 0.01)]
        entries.append(entry(len(entries), places))
    found = history_trends(History(machine="conveyor", entries=tuple(entries)), limit=0.25)
    status = {own.tooth: own.crossing.status for own in found.shown}
    assert status == {1: "reached", 2: "ahead"}
    assert found.forecasts[entries[-1].time_s].status == "reached"


def test_evidence_is_followed_where_no_loss_is_estimated():
    history = cracked()
    bare = History(
        machine="conveyor", entries=tuple(replace(e, places=()) for e in history.entries)
    )
    found = history_trends(bare, limit=0.2)
    assert found.teeth == ()
    assert found.began is not None
    assert found.raised
    assert "no recording estimates a loss" in " ".join(found.notes)


def test_recordings_without_an_estimate_are_not_taken_for_zero():
    entries = []
    for number in range(16):
        loss = 0.02 * (number - 4)
        estimated = number >= 8
        place = tooth(None, loss) if estimated else Place(stage=1, gear="pinion", teeth=5)
        entries.append(entry(number, [place]))
    found = history_trends(History(machine="conveyor", entries=tuple(entries)), limit=0.5)
    (gear,) = found.teeth
    assert gear.tooth is None
    assert len(gear.trend.series) == 8
    assert gear.trend.changes[0].open_before
    assert "8 of 16 recordings" in " ".join(found.notes)


def test_more_teeth_make_the_same_change_less_sure():
    few = cracked()
    alone = History(
        machine="conveyor",
        entries=tuple(
            replace(e, places=tuple(p for p in e.places if p.tooth == 2)) for e in few.entries
        ),
    )
    one, five = (history_trends(h).teeth[0].false_alarm_probability for h in (alone, few))
    assert five == pytest.approx(5 * one)


def test_short_and_empty_histories_say_so():
    found = history_trends(cracked(3), limit=0.2)
    assert not found.raised
    assert "too few" in " ".join(found.notes)
    assert "too few" in found.teeth[0].crossing.reason
    empty = history_trends(History(machine="conveyor"))
    assert as_json(empty.to_dict())["teeth"] == []
    assert history_lines(empty)


def test_a_reached_limit_raises_and_is_told_of_every_tooth():
    losses = {1: 0.3, 2: 0.4, 3: 0.1}
    entries = tuple(
        entry(n, [tooth(j, loss + 0.001 * (n % 3)) for j, loss in losses.items()]) for n in range(8)
    )
    found = history_trends(History(machine="conveyor", entries=entries), limit=0.2)
    assert {tooth_.tooth: tooth_.reached for tooth_ in found.shown} == {1: True, 2: True, 3: False}
    assert found.raised
    told = history_lines(found)
    assert told[9].endswith("trend of a tooth; limit reached")
    assert [line[:25] for line in told if ": loss of" in line] == [
        "stage 1, pinion, tooth 1:",
        "stage 1, pinion, tooth 2:",
    ]
    assert any(line.startswith("1 other tooth of the same gears") for line in told)


@pytest.mark.parametrize("limit", [0.0, 1.5])
def test_a_limit_out_of_range_is_refused(limit):
    with pytest.raises(ArgumentError, match="limit"):
        history_trends(cracked(3), limit=limit)


def test_normal_equivalent_inverts_the_tail():
    from scipy.special import ndtr

    z = np.array([0.0, 1.0, 3.0, 30.0])
    score = -np.log10(ndtr(-z))
    assert normal_equivalent(score) == pytest.approx(z, abs=1e-9)
    assert np.isfinite(normal_equivalent(np.array([1e4]))).all()


def test_times_of_a_history_are_text_in_utc():
    assert entry(0, time_s=0.0).when == "1970-01-01T00:00:00Z"
    with pytest.raises(ArgumentError, match="no time"):
        time_text(1e20)
    step = timedelta(hours=1)
    assert read_time((NOW + step).isoformat()) == NOW + step
