from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearmon.diagnosis.history.changes import ChangePoint, Growth
from gearmon.gears.kinematics import line_table
from gearmon.report.text import (
    analysis_text,
    change_text,
    line_table_text,
    reference_text,
)


def test_the_verdict_comes_first(faulty):
    lines = analysis_text(faulty.analysis).splitlines()
    assert lines[0] == "made-7.csv: FAULT"
    assert any(line.startswith("  flag: tooth damage, stage 1, pinion, tooth ") for line in lines)
    rpm = 60 * faulty.analysis.signature.speed.estimated_hz
    assert any(f"({rpm:.1f} rpm), by tacho" in line for line in lines)


def test_a_healthy_machine_has_few_words(healthy):
    text = analysis_text(healthy.analysis)
    assert text.startswith("made-8.csv: HEALTHY")
    assert "flag" not in text
    assert len(text.splitlines()) < 12


def test_without_a_mesh_no_speed_is_claimed(gearless):
    text = analysis_text(gearless.analysis)
    assert "NO MESH FOUND" in text
    assert "shaft 1 at" not in text


def test_the_strongest_changes_are_listed_where_no_flag_tells(faulty):
    text = analysis_text(replace(faulty.analysis, flags=()), most_changes=1)
    strongest = max(faulty.analysis.changes, key=lambda change: abs(change.standardised))
    change, scatter = strongest.change_db, strongest.scatter_db
    told = f"{strongest.channel}: {strongest.family} {change:+.1f} dB (scatter {scatter:.1f} dB)"
    assert told in text
    assert text.count("(scatter ") == 1


def test_a_name_cannot_steer_the_terminal(healthy):
    assert "\x1b" not in analysis_text(replace(healthy.analysis, recording="\x1b[2Jx"))


def test_reference_and_lines_as_text(healthy):
    assert "3 healthy recordings" in reference_text(healthy.reference)
    assert "made-2.csv" in reference_text(healthy.reference)
    families = len(healthy.reference.family_names)
    assert families > 3
    assert f"; {families} families of lines" in reference_text(healthy.reference)
    table = line_table_text(line_table(healthy.machine)).splitlines()
    assert table[1].split() == ["stage", "kind", "line", "shaft", "order", "Hz"]
    assert any("460.000" in line for line in table)


COURSES = [
    Growth(exponent=0.0),
    Growth(),
    Growth(exponent=2.0),
    Growth(exponent=0.5),
    Growth(folds=3.0),
    Growth(folds=-3.0),
    Growth(jump=0.4),
]


@pytest.mark.parametrize("size", [0.1, -0.1])
@pytest.mark.parametrize("course", COURSES)
def test_a_change_is_told_by_its_direction_and_the_bend_of_its_course(course, size):
    times = {"time_s": 1.7e9, "low_s": 1.6e9, "high_s": 1.8e9, "open_before": False}
    change = ChangePoint(growth=course, size=size, false_alarm_probability=0.01, **times)
    text, step = change_text(change, fine=False, growth=("rises", "falls")), change.kind == "step"
    verbs = ("jumped up at", "fell at") if step else ("rises since", "falls since")
    assert text.startswith(f"{verbs[size < 0]} 2023-11-14")
    assert "(between 2020-09-13 and 2027-01-15; false-alarm probability" in text
    bend = 0.0 if step else float(np.diff(course.at(np.array([0.25, 0.5, 0.75])), 2)[0])
    assert ("faster and faster" in text) == (bend > 1e-9)
    assert ("slower and slower" in text) == (bend < -1e-9)
    assert ("at once and then on" in text) == (course.jump > 0)
    before = change_text(replace(change, open_before=True), fine=False, growth=("", ""))
    assert "(between before the first recording and 2027-01-15;" in before
