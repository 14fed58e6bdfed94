"""The demos of a growing crack, of kinds of faults and of a day, in short versions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference.small_gearbox import as_json

from gearmon.demos import DEMOS, monitoring, run_demo
from gearmon.diagnosis.history import read_history
from gearmon.machine import load_machine
from gearmon.report.analysis_plots import day_figure
from gearmon.signatures.measured.reference import read_reference

#: What functions of the demos were last given and returned, by their names.
KEPT = {}
LEARNED = monitoring.DAY_LEARNED


def noting(function, kept):
    """The same function, whose last use is kept."""

    def noted(*given):
        returned = function(*given)
        kept[function.__name__] = given, returned
        return returned

    return noted


@pytest.fixture(scope="module", autouse=True)
def shortened():
    """Fewer and shorter recordings; a full demo takes half a minute of computing."""
    patch = pytest.MonkeyPatch()
    patch.setattr(monitoring, "DURATION_S", 3.0)
    patch.setattr(monitoring, "RECORDINGS", 5)
    patch.setattr(monitoring, "SOUND", 2)
    patch.setattr(monitoring, "GROWTH_LOADS", (0.7, 0.85, 1.0))
    patch.setattr(monitoring, "HOURS", 2)
    patch.setattr(monitoring, "DAY_LEARNED", monitoring.DAY_LEARNED[1:4])
    patch.setattr(monitoring, "NEW_LOADS", (0.93,))
    patch.setattr(monitoring, "KIND_LOADS", (0.7, 0.85, 1.0))
    patch.setattr(monitoring, "EXAMPLES", 120)
    for name in ("day_figure", "kind_figure", "_monitored"):
        patch.setattr(monitoring, name, noting(getattr(monitoring, name), KEPT))
    yield
    patch.undo()


@pytest.fixture(scope="module")
def growing(tmp_path_factory):
    demo = run_demo("growth", tmp_path_factory.mktemp("growth"))
    KEPT["growing"] = KEPT["_monitored"]
    return demo


@pytest.fixture(scope="module")
def told_apart(tmp_path_factory):
    demo = run_demo("kinds", tmp_path_factory.mktemp("kinds"))
    KEPT["told_apart"] = KEPT["_monitored"]
    return demo


@pytest.fixture(scope="module")
def through_a_day(tmp_path_factory):
    demo = run_demo("day", tmp_path_factory.mktemp("day"))
    KEPT["through_a_day"] = KEPT["_monitored"]
    return demo


@pytest.mark.parametrize("name", ["growing", "told_apart", "through_a_day"])
def test_picture_story_and_inputs_are_written(name, request):
    demo = request.getfixturevalue(name)
    folder, picture = demo.files["folder"], demo.files["picture"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert demo.files["story"].read_text() == "\n".join(demo.story) + "\n"
    assert load_machine(folder / "machine.toml").name == "conveyor drive"
    assert read_reference(folder / "healthy.ref").profiles
    assert as_json(demo.to_dict()) == demo.to_dict()
    assert {"folder", "picture", "story"} < set(demo.to_dict())
    assert str(picture) in "\n".join(demo.lines())


@pytest.mark.parametrize("name", ["growing", "told_apart", "through_a_day"])
def test_every_recording_of_a_demo_is_made_once_sound_ones_are_learned(name, request):
    request.getfixturevalue(name)
    (_, _, _, learned, new, _), (healthy, _, judged) = KEPT[name]
    seeds = [own["recording_seed"] for own in (*learned, *new)]
    assert len(set(seeds)) == len(seeds)
    assert not any("faults" in own for own in learned)
    assert [own["name"] for own in learned] == [own.origin for own in healthy]
    assert [own["name"] for own in new] == [own.origin for own, _ in judged]
    assert [analysis.recording for _, analysis in judged] == [own.origin for own, _ in judged]
    for recording in (*healthy, *(own for own, _ in judged)):
        assert recording.duration_s == monitoring.DURATION_S
        assert recording.sampling_rate_hz == monitoring.RATE_HZ
        assert recording.channel_kinds == ("vibration", "vibration", "tacho")


def test_a_crack_grows_by_the_week_and_is_flagged_for_good_since_the_last_sound_verdict(growing):
    (_, _, _, _, new, _), (_, _, judged) = KEPT["growing"]
    losses = growing.facts["true_loss"]
    for own, loss in zip(new, losses, strict=True):
        assert own["faults"] == ([f"crack:1:pinion:{monitoring.TOOTH}:{loss!r}"] if loss else [])
        assert 0.7 <= own["load"] <= 1.0
    entries = read_history(growing.files["folder"] / "history.db", "conveyor drive").entries
    week_s = 7 * 86_400
    assert np.diff([entry.time_s for entry in entries]).tolist() == [week_s] * 4
    assert entries[0].time_s == monitoring.START.timestamp()
    assert [entry.verdict for entry in entries] == [own.verdict for _, own in judged]
    number = len(entries)
    while number and entries[number - 1].verdict == "fault":
        number -= 1
    assert growing.facts["first_flagged"] == number + 1
    story = growing.files["story"].read_text()
    since = f"{monitoring.START + number * monitoring.WEEK:%Y-%m-%d}"
    assert f"since {since}, at a true loss of {losses[number]:.1%}: " in story
    # the second recording is the last sound one
    assert f"sound until {monitoring.START + monitoring.WEEK:%Y-%m-%d}, then a loss" in story
    assert f"that grows to {losses[-1]:.0%}." in story
    flags = sum(bool(entry.findings) for entry in entries[:2])
    assert f"Flags in the 2 sound recordings: {flags}." in story


def test_pits_stand_on_teeth_of_their_own():
    faults = [own.split(":") for own in monitoring.STATES["distributed pitting"][0]]
    teeth, losses = ([kind(own[place]) for own in faults] for kind, place in ((int, 3), (float, 4)))
    assert {tuple(own[:3]) for own in faults} == {("pitting", "1", "pinion")}
    assert len(set(teeth)) == len(teeth) == monitoring.PITTED
    assert set(teeth) <= set(range(1, 24))
    low, high = monitoring.PIT_LOSS
    assert low <= min(losses) <= max(losses) <= high


def test_a_day_has_two_shifts_of_eight_hours_with_a_break_between(monkeypatch):
    monkeypatch.setattr(monitoring, "HOURS", 16)
    loads, slips = (np.array(own).reshape(2, 8) for own in monitoring._day())
    assert loads.min() >= 0.5
    assert loads.max() <= 1.1
    for shift in loads:
        assert shift[2:5].min() > 0.85 > 0.75 > max(shift[0], *shift[6:])
    # within a percent of the speed, as far as those learned the day before
    known = [slip for _, slip in LEARNED]
    assert min(known) <= slips.min() < 0 < slips.max() <= max(known)


def test_the_story_of_a_day_tells_its_loads_speeds_and_levels(through_a_day):
    (day, limit_db), _ = KEPT["day_figure"]
    (_, _, _, _, new, _), _ = KEPT["through_a_day"]
    assert [own["load"] for own in new] == day["load"].tolist() == through_a_day.facts["load"]
    story = " ".join(through_a_day.story)
    assert f"through a day: {len(new)} recordings" in story
    assert f"load {day['load'].min():.0%} to {day['load'].max():.0%} of nominal" in story
    assert f"speed {day['speed_hz'].min():.2f} to {day['speed_hz'].max():.2f} Hz" in story
    levels = day[list(monitoring.LEVELS)].to_numpy()
    moved = (levels.max(axis=0) - levels.min(axis=0)).max()
    assert f"moves by {moved:.1f} dB; a limit {limit_db:g} dB above" in story
    crossed = int((levels > limit_db).any(axis=1).sum())
    assert f"crossed in {crossed} of {len(new)} recordings" in story


def test_demos_have_names_of_their_own():
    assert {"crack", "growth", "kinds", "day"} <= set(DEMOS)


def test_a_growing_crack_is_flagged_and_a_sound_gear_is_not(growing):
    losses, first = growing.facts["true_loss"], growing.facts["first_flagged"]
    assert losses == [monitoring.true_loss(number) for number in range(5)]
    assert losses[1] == 0 < losses[2]
    assert losses[-1] == pytest.approx(monitoring.LAST_LOSS)
    entries = read_history(growing.files["folder"] / "history.db", "conveyor drive").entries
    assert [entry.verdict for entry in entries][-1] == "fault"
    assert first is not None
    assert first >= 3
    assert "Flagged in every recording since" in growing.files["story"].read_text()


def test_every_state_is_judged_and_the_sound_one_is_sound(told_apart):
    judged = told_apart.facts["recordings"]
    assert [one["truth"] for one in judged] == list(monitoring.STATES)
    assert judged[0]["told"] == "sound"
    right = sum(one["told"] == one["truth"] for one in judged)
    assert told_apart.facts["right"] == right
    assert f"Right: {right} of 4." in told_apart.story
    head = next(
        n for n, line in enumerate(told_apart.story) if line.split()[:2] == ["truth", "load"]
    )
    for one, line in zip(judged, told_apart.story[head + 1 :], strict=False):
        kind = one["kind"]
        known = [one["truth"], f"{one['load']:.0%}".replace("%", " %"), one["analysis"]["verdict"]]
        known += [one["told"]]
        known += [kind["gear"] or "", f"{100 * kind['probability']:.0f} %"] if kind else []
        assert line.split() == " ".join(known).split()
    for one in judged:
        assert (one["kind"] is not None) == (one["analysis"]["verdict"] == "fault")
        assert set(one["features_db"]) == set(monitoring.FEATURES)


def test_a_day_counts_its_alarms_itself(through_a_day):
    facts = through_a_day.facts
    assert facts["alarms"] == [one["verdict"] for one in facts["recordings"]].count("fault")
    assert f"False alarms: {facts['alarms']}," in through_a_day.files["story"].read_text()
    assert max(facts["load"]) > 1.1 * min(facts["load"])


@pytest.mark.usefixtures("through_a_day")
def test_of_a_day_only_faults_are_alarms(tmp_path, monkeypatch):
    _, (healthy, reference, judged) = KEPT["through_a_day"]
    verdicts = ("fault", "cannot tell")
    found = [(r, replace(a, verdict=v)) for (r, a), v in zip(judged, verdicts, strict=True)]
    monkeypatch.setattr(monitoring, "_monitored", lambda *_: (healthy, reference, found))
    monkeypatch.setattr(monitoring, "day_figure", day_figure)
    demo = monitoring.day_demo(tmp_path)
    assert demo.facts["alarms"] == 1
    story = "\n".join(demo.story)
    assert "False alarms: 1, where" in story
    assert "Verdicts: fault 1, cannot tell 1." in story
    for _, own in found:
        assert f"{own.recording}: {own.verdict} ({own.reason})" in story


@pytest.mark.usefixtures("through_a_day")
def test_a_day_is_drawn_by_the_hour_and_its_level_re_the_mean_of_the_reference():
    (day, limit_db), _ = KEPT["day_figure"]
    _, (healthy, _, judged) = KEPT["through_a_day"]
    assert limit_db == monitoring.LEVEL_LIMIT_DB
    assert day.index.tolist() == [6.0, 7.0]

    def level_db(recording):
        return 10 * np.log10(np.square(recording.vibration().samples).mean(axis=1))

    usual = np.mean([level_db(recording) for recording in healthy], axis=0)
    for row, (recording, analysis) in zip(day.itertuples(index=False), judged, strict=True):
        speed = analysis.signature.speed.estimated_hz
        assert row[1:4] == (speed, analysis.score, analysis.verdict)
        np.testing.assert_allclose(row[4:], level_db(recording) - usual, atol=0.05)


def test_changes_of_a_state_are_those_of_its_own_recordings(told_apart):
    (changes,), _ = KEPT["kind_figure"]
    judged = told_apart.facts["recordings"]
    for (title, frame), one in zip(changes.items(), judged, strict=True):
        assert title == f"Truth: {one['truth']}. Told: {one['told']}."
        assert frame.index.tolist() == ["93% load"]
        assert frame.iloc[0].tolist() == list(one["features_db"].values())
        assert frame.columns.tolist() == list(monitoring.FEATURES.values())
