"""Verdicts on real recordings, where these lie beside the checkout; they are no part of it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from reference.small_gearbox import as_json

from gearmon.diagnosis.analysis import analyse
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signals.recording import read_recording
from gearmon.signatures.measured.measurement import measure_signature
from gearmon.signatures.measured.reference import make_reference

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "recordings"
pytestmark = pytest.mark.skipif(
    not (FOLDER / "metadata.csv").is_file(), reason="no real recordings beside the checkout"
)

LEARNED = (0, 40, 80)
NEW = [("h", load) for load in (20, 60)] + [("b", load) for load in (0, 20, 40, 60, 80)]
EXPECTED = {"h": "healthy", "b": "fault"}


def machine(*teeth):
    """Parallel stages at a nominal 30 Hz."""
    stages = tuple(ParallelStage(pinion_teeth=z1, gear_teeth=z2) for z1, z2 in teeth)
    point = OperatingPoint(speed_rpm=1800.0)
    return Machine(name="rig", operating=(point,), stages=stages)


TWO_STAGES = machine((32, 96), (32, 80))


@cache
def taken(state, load):
    """One recording of the two-stage rig: healthy or with a broken tooth."""
    return read_recording(FOLDER / "gfd" / f"{state}30hz{load}.csv", sampling_rate_hz=4266.6667)


@cache
def signature(load):
    return measure_signature(taken("h", load), TWO_STAGES)


@cache
def healthy():
    return make_reference([signature(load) for load in LEARNED], TWO_STAGES)


@cache
def told(state, load, channel=None):
    given = taken(state, load)
    return analyse(given.select(channel) if channel else given, TWO_STAGES, healthy())


@pytest.mark.parametrize(("state", "load"), NEW)
def test_four_channels_together(state, load):
    answer = told(state, load)
    assert answer.verdict == EXPECTED[state]
    assert bool(answer.flags) == (state == "b")
    assert as_json(answer.to_dict()) == answer.to_dict()


@pytest.mark.parametrize("channel", ["a1", "a2", "a3"])
@pytest.mark.parametrize(("state", "load"), NEW)
def test_one_channel_alone(state, load, channel):
    verdict = told(state, load, channel).verdict
    # one of four channels cannot vouch for what the others hear
    assert verdict == "fault" if state == "b" else verdict in ("healthy", "cannot tell")


@pytest.mark.parametrize("load", [20, 60])
def test_the_channel_that_hears_little_raises_no_alarm(load):
    assert told("h", load, "a4").verdict in ("healthy", "cannot tell")


@pytest.mark.parametrize("load", [0, 20, 40, 60, 80])
def test_the_channel_that_hears_little_gives_no_clean_bill(load):
    assert told("b", load, "a4").verdict in ("fault", "cannot tell")


def test_every_broken_one_scores_above_every_healthy_one():
    scores = {state: [told(s, load).score for s, load in NEW if s == state] for state in EXPECTED}
    assert min(scores["b"]) > max(scores["h"])


@pytest.mark.parametrize("left_out", LEARNED)
def test_a_healthy_load_between_learned_ones_or_beyond(left_out):
    rest = [signature(load) for load in (0, 20, 40, 60, 80) if load != left_out]
    known = make_reference(rest, TWO_STAGES)
    assert analyse(taken("h", left_out), TWO_STAGES, known).verdict != "fault"


@pytest.mark.parametrize(("name", "teeth"), [("normal_0", (23, 57)), ("IR007_0", (31, 44))])
def test_a_rig_without_gears_has_no_mesh_and_no_flag(name, teeth):
    given = read_recording(FOLDER / "cwru" / f"{name}.csv", sampling_rate_hz=12_000.0)
    answer = analyse(given, machine(teeth))
    assert answer.verdict == "no mesh found"
    assert answer.flags == ()
