from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.told_numbers import disordered, numbers, untold, with_units

from gearmon.diagnosis.history.changes import ChangePoint, Growth
from gearmon.diagnosis.history.trends import NEVER_S
from gearmon.gears.kinematics import line_table
from gearmon.report.analysis_plots import analysis_figures
from gearmon.report.text import (
    analysis_text,
    change_text,
    line_table_text,
    moment_text,
    reference_text,
    strongest_changes,
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


def test_what_falls_is_as_strong_as_what_rises_by_as_much(faulty):
    changes = faulty.analysis.changes
    fallen = [replace(own, level_db=2 * own.reference_db - own.level_db) for own in changes]
    both = [strongest_changes(replace(faulty.analysis, changes=own)) for own in (changes, fallen)]
    for rise, fall in zip(*both, strict=True):
        assert (rise.family, rise.channel) == (fall.family, fall.channel)


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


CASES = ("faulty", "healthy", "alone", "gearless")


def measured_by_hand(case):
    """What words tell that no field of the analysis holds: spectra, multiples, departures."""
    analysis, recording = case.analysis, case.recording.vibration()
    speed, meshes = analysis.signature.speed, analysis.signature.meshes
    count = recording.samples.shape[1]
    window = np.hanning(count + 1)[:-1]
    lines = 2 * np.abs(np.fft.rfft(recording.samples * window)) / window.sum()
    highest = lines[:, 2:].argmax(axis=1) + 2
    hertz = np.array([mesh.frequency_hz for mesh in meshes])
    # a Hann window is one and a half bins wide
    return {
        "peak_ms2": lines.max(axis=1),
        "peak_hz": highest / recording.duration_s,
        "resolution_hz": 1.5 / recording.duration_s,
        "harmonics_hz": np.outer(hertz, np.arange(1, 9)),
        "off_share": speed.estimated_hz / speed.nominal_hz - 1,
        "wander_share": (speed.highest_hz - speed.lowest_hz) / speed.estimated_hz,
        "change_db": [change.change_db for change in analysis.changes],
        # searched about the nominal speed; found on simulated machines without a reference
        "constant_share": [0.03, 0.4, 0.2],
    }


@pytest.mark.parametrize("name", CASES)
def test_numbers_in_words_are_those_of_the_analysis_in_their_units(name, request):
    case = request.getfixturevalue(name)
    figures = list(analysis_figures(case.analysis, case.recording))
    words = [analysis_text(case.analysis)]
    words += [reference_text(case.reference)] if case.reference else []
    words += [text for own in figures for text in (own.heading, own.caption, own.alt)]
    text = "\n".join(words)
    assert all(own.heading and own.caption and own.alt for own in figures)
    assert len(with_units(text)) > 5
    noticed = [{"noticed_share": own.noticed_from} for own in case.analysis.profiles]
    # a loss of all teeth alike is told in the reason alone
    reason = {f"{n}_share": float(own) / 100 for n, own in enumerate(percents(case.analysis))}
    known = [case.analysis, case.reference, measured_by_hand(case), noticed, reason]
    assert untold(text, known) == []
    assert disordered(text) == []


def percents(analysis):
    told = with_units(analysis.reason)
    return [number for number, unit in told if unit == "%"]


def test_words_hold_what_an_analysis_holds_number_by_number(faulty):
    """With numbers of its own in every field it is plain where each word has its number from."""
    analysis = faulty.analysis
    known = {"estimated_hz": 17.1234, "uncertainty_hz": 0.0123, "nominal_hz": 19.5}
    speed = replace(analysis.signature.speed, **known, lowest_hz=15.9, highest_hz=17.9)
    meshes = (replace(analysis.signature.meshes[0], frequency_hz=393.838, snr_db=41.7),)
    lost = {"stiffness_loss": 0.437, "stiffness_loss_low": 0.312, "stiffness_loss_high": 0.561}
    flag = replace(analysis.flags[0], **lost, tooth=9, false_alarm_probability=3.4e-5)
    own = replace(
        analysis,
        signature=replace(analysis.signature, speed=speed, meshes=meshes),
        flags=(flag,),
        score=7.894,
    )
    lines = [line.strip() for line in analysis_text(own).splitlines()]
    for told in (
        "score 7.89, compared with reference",
        "shaft 1 at 17.123 ± 0.012 Hz (1027.4 rpm), by tacho, between 15.9 and 17.9 Hz",
        "mesh 1 found at 393.84 Hz, 42 dB above the floor",
        "flag: tooth damage, stage 1, pinion, tooth 9, loss of stiffness 44 % (31 to 56 %), "
        "false-alarm probability 3.4·10⁻⁵",
    ):
        assert told in lines
    (sure,) = (line for line in lines if line.startswith("how sure: "))
    assert sure.endswith(": a sound machine shows as much in 1 of 29,412 recordings")
    (caution,) = (line for line in lines if line.startswith("caution: "))
    assert "the speed found, 1027 rpm, is 12 % below the 1170 rpm of the machine" in caution
    for most, word in ((0.4, "in 1 of 2 "), (0.5, "as often as not"), (2e-7, "less than 1 of 1,0")):
        unsure = replace(own, flags=(replace(flag, false_alarm_probability=most),))
        assert word in analysis_text(unsure)


def test_of_a_sound_machine_the_loss_is_told_that_would_have_been_noticed_on_any_gear(healthy):
    known = healthy.analysis
    noticed = (0.021, 0.078)
    profiles = [replace(p, noticed_from=n) for p, n in zip(known.profiles, noticed, strict=True)]
    for own in (profiles, profiles[::-1]):
        text = analysis_text(replace(known, profiles=tuple(own)))
        assert "a tooth that had lost 8 % of its pair's stiffness would have been noticed" in text


def test_a_reference_is_told_recording_by_recording(healthy):
    profiles = tuple(
        replace(own, speed_hz=10.0 + number, duration_s=5.5 + number, tacho=number == 1)
        for number, own in enumerate(healthy.reference.profiles)
    )
    told = reference_text(replace(healthy.reference, profiles=profiles)).splitlines()
    assert told[2:5] == [
        "  made-1.csv: 5.5 s, shaft 1 at 10.0000 Hz",
        "  made-2.csv: 6.5 s, shaft 1 at 11.0000 Hz, tacho",
        "  made-3.csv: 7.5 s, shaft 1 at 12.0000 Hz",
    ]


def test_intervals_in_words_are_told_in_order():
    assert disordered("42 % (30 to 56 %), between 3 to 2, 5 m (6 to 7)") == [
        "3 to 2",
        "5 m (6 to 7",
    ]
    assert dict(numbers({"a": {"b_hz": [1, True, float("nan")]}})) == {("a", "b_hz"): 1.0}


@given(st.floats() | st.floats(0.0, NEVER_S, exclude_max=True))
def test_any_time_has_a_text_that_is_right_to_the_minute(time_s):
    text = moment_text(time_s)
    if 0.0 <= time_s < NEVER_S:
        told = datetime.strptime(text, "%Y-%m-%d %H:%M").replace(tzinfo=UTC)
        assert -1e-3 <= time_s - told.timestamp() < 60.001
        assert moment_text(time_s, fine=False) == text.split()[0]
    elif not abs(time_s) < NEVER_S:
        assert text == "beyond the calendar"
