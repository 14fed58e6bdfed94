"""The demos of a growing crack, of kinds of faults and of a day, in short versions."""

from __future__ import annotations

import numpy as np
import pytest
from reference.small_gearbox import as_json

from gearmon.demos import DEMOS, monitoring, run_demo
from gearmon.diagnosis.history import read_history
from gearmon.machine import load_machine
from gearmon.signatures.measured.reference import read_reference

#: What functions of the demos were last given and returned, by their names.
KEPT = {}


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
    return run_demo("growth", tmp_path_factory.mktemp("growth"))


@pytest.fixture(scope="module")
def told_apart(tmp_path_factory):
    return run_demo("kinds", tmp_path_factory.mktemp("kinds"))


@pytest.fixture(scope="module")
def through_a_day(tmp_path_factory):
    demo = run_demo("day", tmp_path_factory.mktemp("day"))
    KEPT["day"] = KEPT["_monitored"]
    return demo


@pytest.mark.parametrize("name", ["growing", "told_apart", "through_a_day"])
def test_picture_story_and_inputs_are_written(name, request):
    demo = request.getfixturevalue(name)
    folder, picture = demo.files["folder"], demo.files["picture"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert demo.files["story"].read_text().splitlines() == "\n".join(demo.story).splitlines()
    assert load_machine(folder / "machine.toml").name == "conveyor drive"
    assert read_reference(folder / "healthy.ref").profiles
    assert as_json(demo.to_dict()) == demo.to_dict()
    assert {"folder", "picture", "story"} < set(demo.to_dict())
    assert str(picture) in "\n".join(demo.lines())


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
    for one in judged:
        assert (one["kind"] is not None) == (one["analysis"]["verdict"] == "fault")
        assert set(one["features_db"]) == set(monitoring.FEATURES)


def test_a_day_counts_its_alarms_itself(through_a_day):
    facts = through_a_day.facts
    assert facts["alarms"] == [one["verdict"] for one in facts["recordings"]].count("fault")
    assert f"False alarms: {facts['alarms']}," in through_a_day.files["story"].read_text()
    assert max(facts["load"]) > 1.1 * min(facts["load"])


@pytest.mark.usefixtures("through_a_day")
def test_a_day_is_drawn_by_the_hour_and_its_level_re_the_mean_of_the_reference():
    (day, limit_db), _ = KEPT["day_figure"]
    _, (healthy, _, judged) = KEPT["day"]
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
