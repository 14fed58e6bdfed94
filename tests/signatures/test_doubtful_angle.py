"""What is said of an angle found tacholess: how far it may be off, where it may have slipped."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from reference.simulated_machines import two_stages
from reference.speed_cases import make_case
from reference.synthetic_signals import lines_on, track_of

from gearmon.gears.kinematics import kinematics
from gearmon.machine import load_machine
from gearmon.signals.angle import AngleTrack
from gearmon.signatures.speed_channels import track_recording
from gearmon.signatures.tracking import GearVibration, Tracking, _with_doubt


def slipped(track, turns, at_s, lasting_s=0.4):
    """A track that slips once."""
    knots = np.linspace(track.time_s[0], track.time_s[-1], 500)
    error = turns * np.clip((knots - at_s) / lasting_s, 0, 1)
    return AngleTrack(
        time_s=knots,
        turns=track.turns_at(knots) + error,
        method="comb",
        uncertainty_turns=track.uncertainty_turns,
    )


def drowned(case, at_s, lasting_s):
    """The case with nothing but noise in a stretch: no line tells the angle there."""
    recording = case.recording
    samples, rate = recording.samples.copy(), recording.sampling_rate_hz
    inside = slice(round(at_s * rate), round((at_s + lasting_s) * rate))
    noise = np.random.default_rng(3).standard_normal(samples[:, inside].shape)
    samples[:, inside] = noise * samples.std(axis=1, keepdims=True)
    return replace(case, recording=replace(recording, samples=samples))


def told_of(case, periods, at_s, lasting_s):
    """What is said of the case's angle after it is made to slip by mesh periods."""
    found = track_recording(case.recording, case.machine)
    order = float(kinematics(case.machine).meshes[0].order)
    track = slipped(found.track, periods / order, at_s, lasting_s)
    sums = found.signal.sums(float(track.speed_hz.max()))
    return order, _with_doubt(replace(found, track=track, notes=(), coherent=0.9), sums)


@pytest.mark.parametrize("periods", [0, 1, -3])
def test_an_angle_that_slips_quickly_is_mended(periods):
    case = make_case(0, amount=0.002)
    order, told = told_of(case, periods, 4.0, 0.3)
    assert told.notes == ()
    assert told.track.uncertainty_turns * order < 0.02
    time = np.arange(0, len(case.turns), 40) / case.recording.sampling_rate_hz
    assert np.std(told.track.turns_at(time) - case.turns[::40]) * order < 0.02


@pytest.mark.parametrize(("periods", "at_s", "lasting_s"), [(-5, 6.0, 3.0), (-9, 3.0, 5.0)])
def test_a_slow_slip_is_found_again_by_the_comb(periods, at_s, lasting_s):
    case = make_case(0, amount=0.002)
    order, told = told_of(case, periods, at_s, lasting_s)
    assert told.notes == ()
    assert told.held_s is None
    time = np.arange(0, len(case.turns), 40) / case.recording.sampling_rate_hz
    assert np.std(told.track.turns_at(time) - case.turns[::40]) * order < 0.02


@pytest.mark.parametrize("periods", [-5, 6])
def test_what_lies_beyond_a_slow_slip_is_left_out(periods):
    case = drowned(make_case(0, amount=0.002), 6.0, 3.0)
    order, told = told_of(case, periods, 6.0, 3.0)
    (note,) = told.notes
    assert "are looked at: beyond, the mesh lines do not hold the angle" in note
    start, stop = told.held_s
    time = np.arange(start, stop, 0.05)
    error = told.track.turns_at(time) - np.interp(
        time, np.arange(len(case.turns)) / case.recording.sampling_rate_hz, case.turns
    )
    assert stop - start > 0.5 * case.recording.duration_s
    assert np.std(error) * order < 0.05
    assert told.track.uncertainty_turns * order < 0.05


@pytest.mark.parametrize("amount", [0.2, -0.3])
def test_what_lies_beyond_a_drowned_part_of_a_ramp_is_left_out(amount):
    """Of a speed that was followed far from nominal as of a steady one."""
    case = drowned(make_case(0, law="ramp", amount=amount, rate=4000.0), 6.0, 3.0)
    found = track_recording(case.recording, case.machine)
    assert any("the speed was followed" in note for note in found.notes)
    time = np.arange(0, len(case.turns), 40) / case.recording.sampling_rate_hz
    error = found.track.turns_at(time) - case.turns[::40]
    start, stop = found.held_s
    inside = (time >= start) & (time <= stop)
    assert stop - start > 0.5 * case.recording.duration_s
    assert np.std(error[inside]) < 2 * found.track.uncertainty_turns
    assert np.std(error) * float(kinematics(case.machine).meshes[0].order) > 1.0


def test_an_angle_that_slips_slowly_in_the_middle_is_doubtful():
    order, told = told_of(drowned(make_case(0, amount=0.002), 3.0, 5.0), -9, 3.0, 5.0)
    (note,) = told.notes
    assert note.startswith("the angle is doubtful: the mesh lines do not hold it from ")
    assert told.held_s is None
    assert told.track.uncertainty_turns * order > 0.3 * 9


def test_the_stated_uncertainty_of_a_wandering_speed_is_that_of_its_error():
    ratios = []
    for seed in range(3):
        case = make_case(seed, amount=0.01)
        track = track_recording(case.recording, case.machine).track
        time = np.arange(0, len(case.turns), 40) / case.recording.sampling_rate_hz
        error = track.turns_at(time) - case.turns[::40]
        ratios.append(float(np.std(error)) / track.uncertainty_turns)
    assert 0.2 < np.median(ratios) < 1.7


def test_both_ends_of_the_angle_make_the_speed_uncertain():
    track = AngleTrack(
        time_s=np.array([0.0, 10.0]),
        turns=np.array([0.0, 250.0]),
        method="comb",
        uncertainty_turns=1e-3,
    )
    stage = {"kind": "parallel", "pinion_teeth": 21, "gear_teeth": 50}
    machine = load_machine({"operating": {"speed_rpm": 1440.0}, "stage": stage})
    noise = np.random.default_rng(0).normal(size=(1, 2000))
    signal = GearVibration(samples=noise, rate=200.0, machine=machine, nominal_hz=24.0)
    found = Tracking(signal=signal, track=track, scan=None, evidence=()).speed()
    assert found.estimated_hz == pytest.approx(25.0)
    assert found.uncertainty_hz == pytest.approx(np.hypot(1e-3, 1e-3) / 10.0)


def test_beyond_the_pulses_the_speed_goes_on_changing_as_between_them():
    """By c more from each turn to the next: c + 2 c + 3 c ... turns until an end is reached."""
    gaps = np.exp(0.002 * np.random.default_rng(5).standard_normal(40).cumsum()) / 25.0
    beyond = 3
    steps = np.array([beyond, *[1] * 40, beyond])
    time_s = np.cumsum([0.0, beyond * gaps[0], *gaps, beyond * gaps[-1]])
    turns = np.cumsum([0.0, *steps])
    track = AngleTrack(time_s=time_s, turns=turns, method="tacho", uncertainty_turns=1e-9)
    change = np.std(np.diff(np.log(track.speed_hz[1:-1])))
    rate = 2000.0
    noise = np.random.default_rng(0).normal(size=(1, round(time_s[-1] * rate)))
    signal = GearVibration(samples=noise, rate=rate, machine=two_stages(), nominal_hz=25.0)
    found = Tracking(signal=signal, track=track, scan=None, evidence=()).speed()
    off = change * sum(range(1, beyond + 1))
    assert found.uncertainty_hz == pytest.approx(np.hypot(off, off) / time_s[-1], rel=1e-3)


@pytest.mark.parametrize("order", [1.0, 0.2, 7.5])
def test_wander_is_that_of_the_speed_whichever_shaft_is_counted(order):
    """Of a speed that rises evenly by r about its mean: r over the root of 12."""
    rise, last_s = 0.04, 100.0
    track = track_of(
        lambda time: order * 25.0 * time * (1 + rise * (time / last_s - 1) / 2), last_s, 2000
    )
    assert track.wander == pytest.approx(rise / np.sqrt(12), rel=0.01)


@pytest.mark.parametrize("fastest", [0.9, 1.03, 1.1, 1.4])
def test_orders_are_planned_for_a_band_that_none_leaves_at_the_highest_speed(fastest):
    samples = np.random.default_rng(0).normal(size=(1, 8000))
    signal = GearVibration(samples=samples, rate=4000.0, machine=two_stages(), nominal_hz=25.0)
    track = track_of(lambda time: 25.0 * fastest * time, 2.0, 100)
    planned = Tracking(signal=signal, track=track, scan=None, evidence=()).plan_hz
    # `measure_signature` plans up to 0.48 of the rate, 3 % above this speed
    assert 0.48 / planned / 1.03 * 25.0 * fastest < 0.5
    assert planned == 25.0 or fastest > 1.05


@pytest.mark.parametrize("heard", [(True, False), (True, True)])
@pytest.mark.parametrize("part", [0.5, 1.0])
def test_lines_between_those_of_any_mesh_that_is_heard_are_of_another_speed(part, heard):
    """At half the spacing of the mesh of 26 teeth; whatever the other mesh says."""
    time_s = np.arange(24_000) / 4000.0
    orders = part * 26.0 * np.arange(1, 6 / part)
    samples = lines_on(25.0 * time_s, orders, 1.0)
    samples = samples + 0.3 * np.random.default_rng(1).normal(size=samples.shape)
    signal = GearVibration(samples=samples, rate=4000.0, machine=two_stages(), nominal_hz=25.0)
    evidence = tuple(SimpleNamespace(stands_out=own) for own in heard)
    track = track_of(lambda time: 25.0 * time, float(time_s[-1]), 100)
    found = Tracking(signal=signal, track=track, scan=None, evidence=evidence)
    assert found.finer((0.5,)) == (part == 0.5)
    assert not found.finer(())
    assert not replace(found, evidence=(SimpleNamespace(stands_out=False),) * 2).finer((0.5,))


def test_what_stands_out_beside_a_track_is_the_same_from_whichever_turn_it_is_counted():
    """A short record, whose quarter sets the blocks; angles are counted from anywhere."""
    case = make_case(0, duration_s=2.0, amount=0.0)
    signal = track_recording(case.recording, case.machine).signal
    time = np.linspace(0.0, 2.0, 401)
    turns = np.interp(
        time, np.arange(len(case.turns)) / case.recording.sampling_rate_hz, case.turns
    )
    turns -= turns[0]
    near, far = (
        signal.judged(
            AngleTrack(time_s=time, turns=turns + begun, method="comb", uncertainty_turns=0.0)
        )
        for begun in (0.0, 4096.0)
    )
    assert far.detected == near.detected
    for one, other in zip(near.evidence, far.evidence, strict=True):
        assert other.score == pytest.approx(one.score, rel=1e-3)
        assert (other.clear, other.visible) == (one.clear, one.visible)
    assert far.scan.scores.shape == near.scan.scores.shape


@pytest.mark.parametrize("counted", [1.0, 25.0, 0.2])
def test_a_speed_of_which_no_line_tells_the_angle_is_known_to_half_of_what_was_told_apart(counted):
    """A fraction of the speed, whatever the scan counted: hertz, or orders of a shaft."""
    track = replace(track_of(lambda time: 24.0 * time, 10.0, 50, "comb"), uncertainty_turns=np.inf)
    noise = np.random.default_rng(0).normal(size=(1, 2000))
    signal = GearVibration(samples=noise, rate=200.0, machine=two_stages(), nominal_hz=25.0)
    scan = SimpleNamespace(nominal_hz=counted, resolution_hz=1e-3 * counted)
    found = Tracking(signal=signal, track=track, scan=scan, evidence=()).speed()
    assert found.uncertainty_hz == pytest.approx(0.5 * 1e-3 * 24.0)


@pytest.mark.parametrize("speed_hz", [0.1, 1.0, 30.0, 400.0])
def test_speeds_are_the_same_within_one_percent_of_each_other_however_fast(speed_hz):
    signal = SimpleNamespace()

    def at(own_hz):
        track = track_of(lambda time: own_hz * time, 3.0, 20)
        return Tracking(signal=signal, track=track, scan=None, evidence=())

    for off, same in ((0.0, True), (0.008, True), (-0.008, True), (0.02, False), (-0.02, False)):
        one, other = at(speed_hz), at(speed_hz * (1 + off))
        assert one.is_near(other) == other.is_near(one) == same
