"""The benchmark of detection runs, and its figures follow from its rows."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from reference import small_gearbox
from sklearn.ensemble import IsolationForest

from gearmon.benchmark import detection, run_case, summary_rows
from gearmon.benchmark.detection import (
    FOLDS,
    LOCALISED,
    NOTHING,
    TEXTBOOK,
    _around,
    detection_summary,
    rises,
    tooth_error,
    with_learning,
)
from gearmon.benchmark.detection_machines import Condition, Setting, draw_machine
from gearmon.errors import ArgumentError

TRUTH = {"machine": 0, "tacho": True, "variant": "same", "stage": 1, "gear": "pinion"}


def row(condition="healthy", size=0.0, **changes):
    return {**NOTHING, **TRUTH, "condition": condition, "size": size, "tooth": 3} | changes


def value(rows, figure, of, detector="gearmon"):
    (found,) = [
        r
        for r in rows
        if (r["figure"], r["of"], r["detector"]) == (figure, of, detector) and r["tacho"]
    ]
    return found["value"], found["count"]


def test_quick_run():
    seen = []
    rows = run_case("detection", progress=seen.append, quick=True, count=1, seed=0)
    assert seen == [1.0]
    assert len(rows) == 6
    assert len({tuple(row) for row in rows}) == 1
    assert {row["condition"] for row in rows} == {"healthy", "tooth", "pitting"}
    assert all(0 <= row["probability"] <= 1 for row in rows)
    assert all(row["run_time_s"] > 0 for row in rows)
    # logarithms of probabilities: what found no mesh is not judged
    assert all((row["localised difference"] or 0.0) >= 0 for row in rows)
    figures = {row["figure"] for row in summary_rows("detection", rows)}
    assert {"ROC area", "false alarms", "called a fault", "run time in s"} <= figures


def test_a_run_is_the_trials_of_as_many_machines_as_are_asked_for_all_with_its_seed(monkeypatch):
    monkeypatch.setattr(detection, "machine_trials", lambda *given: [given])
    monkeypatch.setattr(detection, "with_learning", lambda rows, seed: [*rows, seed])
    assert detection.run_detection(3, 7) == [(0, 7, False), (1, 7, False), (2, 7, False), 7]
    assert detection.run_detection(3, 7, quick=True) == [(0, 7, True), (1, 7, True), 7]


def test_machine_whose_reference_is_refused(monkeypatch):
    """Every row tells why, and keeps its truth and its columns."""

    def refused(*_):
        raise ArgumentError("too short")

    monkeypatch.setattr(detection, "analyse", refused)
    rows = list(detection.machine_trials(0, 0, quick=True))
    assert {(row["verdict"], row["note"]) for row in rows} == {("refused", "too short")}
    assert {tuple(row) for row in rows} == {(*rows[0],)}
    assert set(NOTHING) < set(rows[0])
    (hurt, _) = [row for row in rows if row["condition"] == "tooth"]
    assert (hurt["stage"], hurt["size"], hurt["score"]) == (1, 0.4, None)
    assert hurt["tooth"] >= 1
    assert all(row["stage"] is row["gear"] is None for row in rows if row["condition"] == "healthy")


@pytest.mark.parametrize(("name", "wrong"), [("count", 0), ("seed", -1)])
def test_arguments_are_checked(name, wrong):
    with pytest.raises(ArgumentError, match=name):
        run_case("detection", quick=True, **{name: wrong})


def test_areas_are_those_of_the_scores():
    rows = [row(score=s, FM4=-s, machine=m) for m, s in enumerate((0.0, 1.0, 2.0, 3.0))]
    rows += [row("tooth", 0.1, score=s, FM4=-s) for s in (2.5, 4.0)]
    # another operating point is no part of it
    rows.append(row(score=9.0, variant="load"))
    found = detection_summary(rows)
    assert value(found, "ROC area", "loss 0.1") == (7 / 8, 2)
    assert value(found, "ROC area", "loss 0.1", "FM4") == (1 / 8, 2)


def test_refused_recording_counts_as_unseen():
    rows = [row(score=1.0), row("tooth", 0.1, score=2.0), row("tooth", 0.1, verdict="refused")]
    assert value(detection_summary(rows), "ROC area", "loss 0.1") == (0.5, 2)


def test_false_alarms_are_counted():
    rows = [row(probability=p) for p in (0.005, 0.02, 0.2, 0.9)]
    rows.append(row(probability=0.01, variant="gain"))
    found = detection_summary(rows)
    assert value(found, "false alarms", "stated 0.01") == (2 / 5, 5)
    assert value(found, "false alarms", "stated 0.01, gain") == (1.0, 1)
    assert value(found, "false alarms", "stated 0.03") == (3 / 5, 5)


def test_findings_are_counted():
    right = {"verdict": "fault", "tooth_flag": True, "gear_right": True, "tooth_error": 0.2}
    sized = {"loss": 0.25, "loss_low": 0.15, "loss_high": 0.3}
    rows = [
        row("tooth", 0.2, **right, **sized),
        row("tooth", 0.2, **right, **sized | {"loss": 0.17, "loss_high": 0.19}),
        row("tooth", 0.2, **right | {"gear_right": False, "tooth_error": None}),
        row("tooth", 0.2, verdict="healthy"),
        row("eccentricity", 1.0, verdict="fault", tooth_flag=True),
        row("eccentricity", 1.0, verdict="fault"),
    ]
    found = detection_summary(rows)
    assert value(found, "called a fault", "loss 0.2") == (0.75, 4)
    assert value(found, "gear right", "loss 0.2") == (2 / 3, 3)
    assert value(found, "tooth right", "loss 0.2") == (2 / 3, 3)
    assert value(found, "interval covers", "loss 0.2") == (0.5, 2)
    assert value(found, "loss error, quartiles", "loss 0.2") == (pytest.approx(0.05), 2)
    assert value(found, "called a tooth", "eccentricity") == (0.5, 2)
    rows = [row(run_time_s=0.5, alone_s=0.2), row(run_time_s=0.7, alone_s=0.2), row(machine=1)]
    timed = detection_summary(rows)
    assert value(timed, "run time in s", "with reference") == (pytest.approx(0.6), 2)
    assert value(timed, "run time in s", "without") == (0.2, 1)
    (called,) = (r for r in found if (r["figure"], r["of"]) == ("called a fault", "loss 0.2"))
    # Wilson: where the share lies 1.96 standard deviations of the unknown one away
    for end, side in ((called["low"], 1), (called["high"], -1)):
        assert 0.75 - end == pytest.approx(side * 1.95996 * (end * (1 - end) / 4) ** 0.5, rel=1e-4)
    (error,) = (r for r in found if (r["figure"], r["of"]) == ("loss error, quartiles", "loss 0.2"))
    # relative: 0.25 and -0.15
    assert (error["low"], error["high"]) == pytest.approx((-0.05, 0.15))
    for told in found:
        assert told["low"] <= told["value"] <= told["high"]


def test_rises_are_those_of_the_indicators():
    """Greatest rise over gears and channels, as natural logarithm; back and forth it is a fall."""
    new, sound = (small_gearbox.analysis(fault) for fault in (small_gearbox.CRACK, ""))
    there, back = rises(new, sound), rises(sound, new)
    for name in ("FM4", "energy ratio", "SER", "kurtosis"):
        known = TEXTBOOK.get(name, name) if name != "SER" else "SER"
        grown = [
            np.log(value / sound.indicators[key][channel])
            for key, values in new.indicators.items()
            if key.partition(", ")[0] == known
            for channel, value in values.items()
        ]
        told = next(own for own, of in TEXTBOOK.items() if of == known)
        assert there[told] == pytest.approx(max(grown))
        assert back[told] == pytest.approx(-min(grown))


def test_what_is_twice_as_loud_rises_where_loudness_counts():
    """Energy by four, NA4* over the healthy variance by sixteen; shapes do not rise."""
    sound = small_gearbox.analysis()
    lines = sound.signature.lines
    louder = replace(lines, amplitude=2.0 * lines.amplitude)
    found = rises(replace(sound, signature=replace(sound.signature, lines=louder)), sound)
    shapes = dict.fromkeys(("FM4", "energy ratio", "sideband energy ratio", "kurtosis"), 0.0)
    expected = shapes | {"residual energy": np.log(4.0), "NA4*": np.log(16.0)}
    assert {name: found[name] for name in TEXTBOOK} == pytest.approx(expected, abs=1e-9)


def test_learning_is_trained_on_other_machines():
    rng = np.random.default_rng(0)
    rows = [row(verdict="refused")]
    for machine in range(15):
        for kind, shift in (("healthy", 0.0), ("healthy", 0.0), ("tooth", 6.0)):
            told = dict(zip((*TEXTBOOK, LOCALISED), rng.normal(shift, 1.0, 7), strict=True))
            rows.append(row(kind, 0.2, machine=machine, **told))
    scored = with_learning(rows)
    assert scored[0]["plain learning"] is None
    assert value(detection_summary(scored), "ROC area", "loss 0.2", "plain learning")[0] > 0.95
    # another forest that has never seen the machines of its fold
    told = [[one[name] for name in TEXTBOOK] for one in rows[1:]]
    others = [
        own
        for own, one in zip(told, rows[1:], strict=True)
        if one["machine"] % FOLDS != 3 and one["condition"] == "healthy"
    ]
    expected = -IsolationForest(random_state=0).fit(others).score_samples(told)
    for one, score in zip(scored[1:], expected, strict=True):
        if one["machine"] % FOLDS == 3:
            assert one["plain learning"] == pytest.approx(score)


def test_damage_falls_on_every_tooth_of_every_gear():
    drawn, rng, seen = draw_machine(np.random.default_rng(0)), np.random.default_rng(3), {}
    assert len(drawn.stages) == 2
    for _ in range(3000):
        found = detection._somewhere(rng, drawn, "tooth", 0.1)
        seen.setdefault((found.stage, found.gear), set()).add(found.tooth)
    teeth = {
        (number, name): set(range(1, gear.teeth + 1))
        for number, stage in enumerate(drawn.stages, 1)
        for name, gear in zip(("pinion", "gear"), stage.gears, strict=True)
    }
    assert set(seen) == set(teeth)
    for place, own in seen.items():
        assert own <= teeth[place]
        assert {1, max(teeth[place])} <= own


@pytest.mark.parametrize("variant", [*detection.VARIANTS, detection.WARM])
def test_a_variant_changes_what_it_is_called_after_and_nothing_else(variant):
    """Load by a fifth, speed by a fiftieth, gain by two, each way alike; else as operators can."""
    rng = np.random.default_rng(4)
    drawn = [detection._setting(rng, variant, 7.0) for _ in range(600)]
    told = {name: [getattr(own, name) for own in drawn] for name in ("load", "speed", "warmth")}
    told["gain"] = np.log2([own.gain for own in drawn])
    reach = {"load": 0.02, "speed": 0.002, "gain": 0.0, "warmth": 0.0}
    wide = {"load": 0.2, "speed": 0.02, "gain": 1.0}
    reach |= wide if variant == "all" else {variant: wide[variant]} if variant in wide else {}
    reach |= {"warmth": 0.01} if variant == "warm" else {}
    middle = {"load": 1.0, "speed": 1.0, "gain": 0.0, "warmth": 0.0}
    for name, values in told.items():
        off = np.array(values) - middle[name]
        assert 0.9 * reach[name] <= off.max() <= reach[name]
        assert -reach[name] <= off.min() <= -0.9 * reach[name]
    assert {own.duration_s for own in drawn} == {7.0}
    assert len({own.seed for own in drawn}) == 600


@pytest.mark.parametrize("tacho", [True, False])
def test_a_row_tells_the_first_flag_and_the_first_that_blames_a_tooth(monkeypatch, tacho):
    def flag(**told):
        names = ("stage", "gear", "tooth", "false_alarm_probability", "stiffness_loss")
        known = dict.fromkeys((*names, "stiffness_loss_low", "stiffness_loss_high"))
        return SimpleNamespace(**known | told)

    wear = flag(kind="wear", stage=1, gear="gear", false_alarm_probability=1e-3)
    hurt = {"stiffness_loss": 0.2, "stiffness_loss_low": 0.1, "stiffness_loss_high": 0.4}
    tooth = flag(kind="tooth damage", stage=1, gear="pinion", tooth=7, **hurt)
    seen = []

    def analysed(recording, machine, reference=None):
        seen.append((recording, machine, reference))
        known = {"flags": (wear, tooth), "verdict": "fault", "score": 5.0}
        signature = SimpleNamespace(found=False)
        return SimpleNamespace(**known, false_alarm_probability=1e-4, signature=signature)

    monkeypatch.setattr(detection, "analyse", analysed)
    monkeypatch.setattr(detection, "learn", lambda recordings, machine: (recordings, machine))
    monkeypatch.setattr(detection, "tooth_error", lambda *given: (given, 0.25)[1])
    recordings = [SimpleNamespace(vibration=lambda own=own: own) for own in ("first", "new")]
    first, new = (SimpleNamespace(recording=own) for own in recordings)
    judge = detection._judge(SimpleNamespace(machine="machine"), first, tacho)
    told = judge(Condition(kind="tooth", stage=1, gear="pinion", tooth=7, size=0.3), new)
    heard = recordings if tacho else ["first", "new"]
    # once without a reference, once with what was learned of the first
    assert seen == [
        (heard[0], "machine", None),
        (heard[1], "machine", ([heard[0]], "machine")),
    ]
    expected = {
        "verdict": "fault",
        "score": 5.0,
        "probability": 1e-4,
        "flags": "wear; tooth damage",
    }
    expected |= {"found_kind": "wear", "flag_probability": 1e-3, "tooth_flag": True, "loss": 0.2}
    expected |= {"found_stage": 1, "found_gear": "pinion", "found_tooth": 7}
    expected |= {"loss_low": 0.1, "loss_high": 0.4, "gear_right": True, "tooth_error": 0.25}
    assert {key: own for key, own in told.items() if not key.endswith("_s")} == expected
    told = judge(Condition(kind="tooth", stage=1, gear="gear", tooth=7, size=0.3), new)
    assert (told["gear_right"], told["tooth_error"]) == (False, None)
    told = judge(Condition(kind="wear", stage=1, gear="pinion", size=0.3), new)
    assert "gear_right" not in told


def test_distance_on_a_gear_goes_the_shorter_way():
    assert _around(18.5, 19) == 0.5
    assert _around(-3.0, 19) == 3.0
    assert _around(40.0, 19) == 2.0


@pytest.mark.parametrize("away", [0.0, 1.5])
def test_a_place_without_a_number_is_the_middle_of_the_contact(away):
    """The tooth enters at its number less one; a place is where its contact has its middle."""
    drawn = draw_machine(np.random.default_rng(2), channels=1)
    taken = drawn.take(Condition(), Setting(seed=1, duration_s=0.5))
    teeth = drawn.stages[0].gears[0].teeth
    truth = Condition(kind="tooth", stage=1, gear="pinion", tooth=5, size=0.1)
    track = SimpleNamespace(time_at=lambda _: np.array([0.1]))
    place = 4 - taken.turns_at(0.1) * teeth + 0.5 * drawn.stages[0].model.reach + away
    profile = SimpleNamespace(stage=1, gear="pinion", position=place / teeth % 1.0)
    analysis = SimpleNamespace(signature=SimpleNamespace(track=track), profiles=(profile,))
    flag = SimpleNamespace(stage=1, gear="pinion", tooth=None)
    found = tooth_error(drawn, truth, flag, [(taken, analysis)])
    assert found == pytest.approx(away, abs=1e-6)
    flag.tooth, entered = 5, taken.turns_at(0.1) * teeth
    found = tooth_error(drawn, truth, flag, [(taken, analysis)])
    assert found == pytest.approx(_around(entered, teeth), abs=1e-6)
