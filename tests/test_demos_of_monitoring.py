"""The demos of a growing crack, of kinds of faults and of a day, in short versions."""

from __future__ import annotations

import pytest
from reference.small_gearbox import as_json

from gearmon.demos import DEMOS, monitoring, run_demo
from gearmon.diagnosis.history import read_history
from gearmon.machine import load_machine
from gearmon.signatures.measured.reference import read_reference


@pytest.fixture(scope="module", autouse=True)
def shortened():
    """Fewer recordings; a full demo takes half a minute of computing."""
    patch = pytest.MonkeyPatch()
    patch.setattr(monitoring, "RECORDINGS", 5)
    patch.setattr(monitoring, "SOUND", 2)
    patch.setattr(monitoring, "GROWTH_LOADS", (0.7, 0.85, 1.0))
    patch.setattr(monitoring, "HOURS", 2)
    patch.setattr(monitoring, "DAY_LEARNED", monitoring.DAY_LEARNED[1:4])
    patch.setattr(monitoring, "NEW_LOADS", (0.93,))
    patch.setattr(monitoring, "KIND_LOADS", (0.7, 0.85, 1.0))
    patch.setattr(monitoring, "EXAMPLES", 160)
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
    return run_demo("day", tmp_path_factory.mktemp("day"))


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
