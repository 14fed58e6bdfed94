"""What terminals and stories say, in the cases that runs of the other tests do not meet."""

from __future__ import annotations

from types import SimpleNamespace

from gearmon.commands.command import words
from gearmon.demos import story_of
from gearmon.report.text import moment_text


def test_a_crack_that_was_not_found_is_told_as_such(tmp_path):
    entries = [SimpleNamespace(time_s=86400.0 * n, findings=("x",) * (n == 0)) for n in range(3)]
    known = {"tooth": 7, "moment": moment_text, "history": ["drive: 3 recordings"]}
    known |= {"entries": entries, "losses": [0.0, 0.0, 0.345], "flagged": 3, "within": [2]}
    story = story_of(tmp_path, "growth", sound=2, **known)
    assert story == (
        "A crack on tooth 7 of the pinion, in 3 recordings a week apart.",
        "The truth: sound until 1970-01-02, then a loss of pair stiffness that grows to 34%.",
        "Flags in the 2 sound recordings: 1.",
        "The last recording is not flagged: this crack was not found.",
        "The truth lies within the 90 % interval of the trend in 2 of 3 recordings;",
        "what the pitch deviation of this one tooth adds to its loss, or takes from it, is the "
        "same in all of them.",
        "",
        "drive: 3 recordings",
    )
    assert (tmp_path / "growth.txt").read_text().splitlines() == list(story)


def test_a_run_over_a_fleet_tells_the_first_of_many():
    alarm = {"machine": "a\n1", "class": "", "finding": "wear", "since": "2026-03-01"}
    alarms = [alarm | {"acknowledged": False}, alarm | {"class": "maize", "acknowledged": True}]
    run = {
        "fleet": "farm", "analysed": 1,
        "failed": [{"recording": f"{n}.csv", "why": "bad"} for n in range(3)], "not_taken": [],
        "being_written": ["x.csv"], "ledger": {"failed": 3, "done": 1}, "results": ["r.parquet"],
        "alarms": alarms,
    }  # fmt: skip
    assert words("fleet", run, most=2) == [
        "farm: 1 recording analysed",
        "0.csv: not analysed: bad",
        "1.csv: not analysed: bad",
        "1 more not analysed; --json has them all",
        "1 recording still being written",
        "ledger: 1 done, 3 failed",
        "ALARM a�1: wear, since 2026-03-01",
        "ALARM a�1 maize: wear, since 2026-03-01, acknowledged",
        "wrote r.parquet",
    ]


def test_a_kind_that_the_flags_do_not_name_is_told():
    told = {"kind": "wear", "stage": 1, "gear": "gear", "evidence": ["the mesh fell"]}
    told |= {"probabilities": {"sound": 0.004, "pitting": 0.3, "wear": 0.696}}
    entries = [
        {"recording": "a.csv", "verdict": "fault", "flagged": ["looseness"] * 2, "kind": told},
        {"recording": "b.csv", "verdict": "healthy", "flagged": [], "kind": None},
        {"recording": "c.csv", "error": "c.csv: no such file"},
    ]
    known = {"classifier": {"file": "x.kinds", "trained_now": True}, "recordings": entries}
    lines = words("kinds", known, least_shown=0.01)
    assert lines[:5] == [
        "wrote: x.kinds",
        "a.csv: FAULT",
        "  most like wear, stage 1, gear",
        "  wear 70 %, pitting 30 %",
        "  the mesh fell",
    ]
    assert lines[5].startswith("  gearmon analyse flags looseness: it looks at the turn")
    assert lines[6:] == [
        "b.csv: HEALTHY",
        "  no fault called, so no kind judged",
        "c.csv: not analysed",
    ]


def test_a_gear_of_which_no_loss_is_noticed_is_told():
    gears = [{"gear": "gear", "stage": 2, "noticed_from": own} for own in (None, 0.123)]
    known = {"headline": "covers little", "advice": ["one", "two"], "gears": gears}
    assert words("check", known, rows=[{"recording": "a.csv"}]) == [
        "covers little", "also: two", "", "recording", "a.csv",
        "gear of stage 2: no loss of a tooth is sure to be noticed",
        "gear of stage 2: a weak tooth is noticed from 12 % on",
    ]  # fmt: skip


def test_many_orders_are_told_by_the_first_and_the_last():
    removed = {"residual": [float(n) for n in range(1, 9)], "difference": [1.5]}
    average = {"gear": "pinion", "stage": 1, "removed_orders": removed}
    known = {"peaks": [{"order": 1.0}], "averages": [average], "warnings": ["short"]}
    assert words("peaks", known, title="a.csv", rows=[{"gear": "pinion"}])[-2:] == [
        "pinion of stage 1: residual less 8 orders (1, 2, 3, 4, ..., 8), difference less 1 (1.5)",
        "note: short",
    ]
