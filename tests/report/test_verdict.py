"""The answer in ten seconds: what, how sure, what to do; the worst of several first."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from gearmon.report.html import Failure, write_report
from gearmon.report.text import overall, overview_lines, running_text, summary, worst_first


def slowed(analysis, factor):
    speed = replace(
        analysis.signature.speed, nominal_hz=analysis.signature.speed.estimated_hz / factor
    )
    return replace(analysis, signature=replace(analysis.signature, speed=speed))


def test_a_fault_says_what_how_sure_and_what_to_do(faulty):
    own, flag = summary(faulty.analysis), faulty.analysis.flags[0]
    assert own.what.startswith(f"Damage of tooth {flag.tooth} of the pinion of stage 1")
    assert "a sound machine shows as much in " in own.more["how sure"]
    assert own.more["next"].startswith(f"Inspect tooth {flag.tooth} of the pinion of stage 1")
    assert own.because not in own.what
    assert "σ" not in own.what + own.more["next"]


def test_no_rarity_is_claimed_that_nobody_has_counted(faulty):
    flag = replace(faulty.analysis.flags[0], false_alarm_probability=1e-30)
    told = summary(replace(faulty.analysis, flags=(flag,))).more["how sure"]
    assert told.startswith("practically certain")
    assert told.endswith("in less than 1 of 1,000,000 recordings")
    flag = replace(flag, false_alarm_probability=0.004)
    assert summary(replace(faulty.analysis, flags=(flag,))).more["how sure"] == (
        "sure: a sound machine shows as much in 1 of 250 recordings"
    )


def test_probabilities_stand_beside_faults_only(healthy, alone, gearless):
    assert "would have been noticed" in summary(healthy.analysis).more["how sure"]
    assert summary(healthy.analysis).more["next"] == "Nothing now; record again as planned."
    for case in (alone, gearless):
        assert "how sure" not in summary(case.analysis).more
    assert "gearmon learn" in summary(alone.analysis).more["next"]
    check = summary(gearless.analysis).more["next"]
    assert check.startswith("Check the sensor and the tooth counts")
    # the speed that the machine file states, whatever was found in noise
    assert "ran at about 1200 rpm" in check


@pytest.mark.parametrize("kind", ["wear", "bearing", "path changed", "changed mesh", "mesh lost"])
def test_every_kind_of_fault_says_what_to_do(faulty, kind):
    flag = replace(faulty.analysis.flags[0], kind=kind)
    told = summary(replace(faulty.analysis, flags=(flag,))).more["next"]
    assert told.endswith(".")
    assert "{" not in told


@pytest.mark.parametrize(
    "doubt",
    [
        "teeth 2, 25 meet a planet at the same moments: it may be any of them",
        "the gear of stage 1 shows it too and may be the cause as well",
    ],
)
def test_what_to_inspect_leaves_open_what_the_evidence_leaves_open(faulty, doubt):
    flag = replace(faulty.analysis.flags[0], evidence=("one", doubt))
    told = summary(replace(faulty.analysis, flags=(flag,))).more["next"]
    assert told.startswith("Inspect tooth")
    assert told.endswith(f". {doubt.capitalize()}.")


def test_a_speed_far_from_nominal_is_a_caution(healthy):
    assert "caution" not in summary(healthy.analysis).more
    told = summary(slowed(healthy.analysis, 0.8)).more["caution"]
    assert told.startswith("the speed found, 1194 rpm, is 20 % below the 1492 rpm")
    assert "above" in summary(slowed(healthy.analysis, 1.2)).more["caution"]


@pytest.mark.parametrize(
    ("lowest", "highest", "far"),
    [(0.9, 1.4, False), (0.6, 1.1, False), (1.02, 1.4, False), (1.1, 1.4, True), (0.6, 0.9, True)],
)
def test_a_range_is_as_far_from_nominal_as_its_nearest_end(healthy, lowest, highest, far):
    speed = healthy.analysis.signature.speed
    ends = {"lowest_hz": lowest * speed.nominal_hz, "highest_hz": highest * speed.nominal_hz}
    told = replace(healthy.analysis.signature, speed=replace(speed, **ends))
    assert ("caution" in summary(replace(healthy.analysis, signature=told)).more) == far


def test_a_machine_that_is_run_up_through_its_nominal_speed_is_not_far_from_it(healthy):
    slow = slowed(healthy.analysis, 0.8)
    speed = replace(slow.signature.speed, highest_hz=1.01 * slow.signature.speed.nominal_hz)
    told = replace(slow, signature=replace(slow.signature, speed=speed))
    assert "caution" not in summary(told).more
    wide = f", between {speed.lowest_hz:.4g} and {speed.highest_hz:.4g} Hz"
    assert running_text(speed).endswith(wide)
    assert "between" not in running_text(healthy.analysis.signature.speed)


def test_of_several_the_worst_comes_first(faulty, healthy, alone, gearless):
    analyses = [case.analysis for case in (healthy, gearless, faulty, alone)]
    assert worst_first(analyses) == [2, 3, 1, 0]
    # of equals the one with the highest score
    alike = [replace(faulty.analysis, score=score) for score in (3.0, 9.0, 5.0)]
    assert worst_first([healthy.analysis, *alike]) == [2, 3, 1, 0]
    assert overall(analyses, 1) == (
        "fault",
        "5 recordings: 1 fault, 1 cannot tell, 1 no mesh found, 1 healthy, 1 not analysed",
    )
    lines = overview_lines(analyses)
    assert lines[0].startswith("FAULT (4 recordings: 1 fault")
    assert lines[1].split()[:2] == ["made-7.csv", "FAULT"]
    assert lines[4].split()[:2] == ["made-8.csv", "HEALTHY"]
    # what was found stands under one another, however long the names
    short = replace(healthy.analysis, recording="a")
    _, *rows, _ = overview_lines([short, faulty.analysis])
    places = {line.index(word) for line, word in zip(rows, ("FAULT", "HEALTHY"), strict=True)}
    assert len(places) == 1


def test_the_page_opens_with_the_worst_and_folds_the_evidence(tmp_path, healthy, faulty):
    write_report(
        [healthy.analysis, faulty.analysis],
        [None, None],
        healthy.reference,
        healthy.machine,
        tmp_path / "report.html",
        failures=[Failure(recording="bad.csv", message="bad.csv: is empty")],
    )
    text = (tmp_path / "report.html").read_text("utf-8")
    body = text[text.index("<body>") :]
    assert body.index("3 recordings: 1 fault, 1 healthy, 1 not analysed") < body.index("Overview")
    assert body.index('<section id="recording-2">') < body.index('<section id="recording-1">')
    assert body.count("<details") == body.count("</details>") >= 6
    assert "<details open" not in body
    assert "default-src 'none'" in text


def test_since_when_is_what_the_history_tells(faulty, healthy):
    from gearmon.diagnosis.history import History, entry_of, history_trends

    history = History(machine=faulty.machine.name)
    for day, case in enumerate((healthy, healthy, faulty), start=1):
        history = history.with_entry(
            entry_of(case.analysis, datetime(2026, 3, day, tzinfo=UTC), "given")
        )
    told = summary(faulty.analysis, history_trends(history)).more
    assert told["since"].startswith("2026-03-03, in the last 1 of 3 recordings")
    assert "since" not in summary(faulty.analysis).more
    assert "since" not in summary(healthy.analysis, history_trends(history)).more


def test_what_a_loss_has_become_is_told_by_its_trend_and_not_by_the_end_of_its_interval(faulty):
    from gearmon.diagnosis.history import Entry, History, Place, history_trends

    flag = faulty.analysis.flags[0]
    noise = np.random.default_rng(2).normal(0.0, 0.003, 16)
    places = [
        Place(
            stage=flag.stage, gear=flag.gear, tooth=flag.tooth, loss_sigma=0.02,
            loss=float(0.02 + 0.02 * max(0, day - 5) + noise[day]),
        )
        for day in range(16)
    ]  # fmt: skip
    entries = [
        Entry(
            machine="m", recording=f"{day}.csv", time_s=1.7e9 + 86400.0 * day, time_source="given",
            verdict="fault" if day > 9 else "healthy", score=0.5 + day, speed_hz=20.0,
            false_alarm_probability=0.5, places=(place,),
        )
        for day, place in enumerate(places)
    ]  # fmt: skip
    trends = history_trends(History(machine="m", entries=tuple(entries)))
    value, _, high = trends.shown[0].now
    assert high > value + 0.015
    said = summary(faulty.analysis, trends).more["since"]
    first, now = re.search(r"its loss went from (\d+) % to (\d+) %", said).groups()
    assert abs(int(first) - 2) <= 1
    assert abs(int(now) - 22) <= 1
    first = datetime.fromtimestamp(entries[10].time_s, UTC)
    assert said.startswith(f"{first:%Y-%m-%d}, in the last 6 of 16 recordings")
