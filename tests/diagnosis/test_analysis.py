"""From recording to verdict, on a simulated gearbox whose condition is known."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from reference.simulated_machines import planetary
from reference.small_gearbox import (
    CRACK,
    HEALTHY_LOADS,
    RATE_HZ,
    analysis,
    as_json,
    machine,
    recording,
    reference,
)
from reference.synthetic_signals import as_recording, lines_on, wandering_turns, white
from scipy.interpolate import CubicSpline

from gearmon.diagnosis.alone import own_teeth
from gearmon.diagnosis.analysis import analyse, evidence_against, learn
from gearmon.diagnosis.evidence import LIMITS, false_alarm_probability
from gearmon.diagnosis.law.machine import HealthyMachine
from gearmon.diagnosis.results import VERDICTS
from gearmon.diagnosis.verdict import left_open
from gearmon.errors import ArgumentError, RecordingError
from gearmon.gears.faults import parse_fault
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, OperatingPoint, ParallelStage, load_machine
from gearmon.signals.recording import Recording
from gearmon.signals.tracking import find_pulses
from gearmon.signatures.measured.measurement import measure_signature
from gearmon.signatures.measured.reference import Profile
from gearmon.simulation import simulate

GEAR_CRACK = "crack:1:gear:30:40%"
KEYS = {"verdict", "score", "speed", "mesh", "indicators", "flags", "warnings"}
FLAG_KEYS = {
    "kind",
    "stage",
    "gear",
    "tooth",
    "stiffness_loss",
    "stiffness_loss_low",
    "stiffness_loss_high",
    "false_alarm_probability",
    "evidence",
}


@pytest.fixture(scope="module")
def noise():
    samples = white((2, 40_000), seed=8)
    return analyse(Recording(samples=samples, sampling_rate_hz=RATE_HZ), machine(), None)


def every():
    return [
        analysis(),
        analysis(CRACK),
        analysis(GEAR_CRACK),
        analysis(with_reference=False),
        analysis(CRACK, with_reference=False),
    ]


def test_healthy_at_another_load_is_healthy():
    told = analysis()
    assert told.verdict == "healthy"
    assert told.flags == ()
    assert told.compared_with == "reference"


def test_score_and_probability_are_of_the_strongest_test_on_a_common_scale():
    told = analysis()
    strengths = evidence_against(told.signature, machine(), reference()).strengths
    tooth = strengths.pop("tooth")
    strongest = max(tooth, *(2.0 - 1.6 * (2.0 - value) for value in strengths.values()))
    assert strongest < 1.0
    assert told.score == pytest.approx(math.log10(1.0 + 10.0**strongest))
    chance = false_alarm_probability(strongest, len(HEALTHY_LOADS), 0.0)
    assert told.false_alarm_probability == pytest.approx(chance)


def test_planetary_set_is_compared_with_its_own_reference(planetary_recording):
    # its gears are followed relative to the carrier, as the reference knows them
    own = as_recording(planetary_recording)
    half = own.samples.shape[1] // 2
    first, second = (
        replace(own, samples=samples) for samples in (own.samples[:, :half], own.samples[:, half:])
    )
    told = analyse(second, planetary(), learn([first], planetary()))
    assert told.compared_with == "reference"
    assert told.verdict != "fault"


@pytest.mark.parametrize("seed", [31, 32, 33])
def test_other_healthy_recordings_are_not_flagged(seed):
    assert analysis(load=0.75 + 0.05 * (seed - 31), seed=seed).verdict == "healthy"


@pytest.mark.parametrize(
    ("fault", "gear", "tooth"), [(CRACK, "pinion", 7), (GEAR_CRACK, "gear", 30)]
)
def test_cracked_tooth_is_a_fault_of_its_gear(fault, gear, tooth):
    told = analysis(fault)
    assert told.verdict == "fault"
    first = told.flags[0]
    assert (first.kind, first.stage, first.gear) == ("tooth damage", 1, gear)
    assert first.false_alarm_probability < LIMITS.rare
    assert f"tooth {first.tooth}" in first.evidence[0]
    if gear == "pinion":  # the tacho stands on its shaft
        assert first.tooth == tooth
        assert "tachometer pulse" in first.evidence[2]
    else:
        assert "where the first healthy recording begins" in first.evidence[2]


@pytest.mark.parametrize("fault", [CRACK, GEAR_CRACK])
def test_stiffness_loss_comes_with_an_interval(fault):
    first = analysis(fault).flags[0]
    assert 0 < first.stiffness_loss_low < first.stiffness_loss < first.stiffness_loss_high < 1
    assert 0.2 < first.stiffness_loss < 0.6
    profile = next(p for p in analysis(fault).profiles if p.gear == first.gear)
    assert np.argmax(profile.loss_by_tooth) + 1 == first.tooth
    assert len(profile.loss_sigma_by_tooth) == profile.teeth
    assert profile.loss_by_tooth[first.tooth - 1] == first.stiffness_loss


@pytest.mark.parametrize("tacho", [True, False])
def test_a_tooth_counted_from_the_reference_keeps_its_number(tacho):
    found = [
        analysis(GEAR_CRACK, seed=seed, tacho=tacho, known_tacho=tacho).flags[0].tooth
        for seed in (17, 18, 19)
    ]
    apart = [(one - found[0] + 28) % 57 - 28 for one in found]
    assert max(map(abs, apart)) <= 1


def test_many_damaged_teeth_of_one_gear_are_a_fault_of_it():
    """Each of half the teeth has lost some of its stiffness: none of them stands out."""
    random = np.random.default_rng(3)
    losses = {t: random.uniform(0.05, 0.25) for t in range(1, 24) if random.uniform() < 0.5}
    pits = [parse_fault(f"crack:1:pinion:{tooth}:{loss:.3f}") for tooth, loss in losses.items()]
    seeds = {"machine_seed": 1, "recording_seed": 17}
    made = simulate(machine(), pits, 4.0, RATE_HZ, **seeds, channels=2, load=0.9)
    found = analyse(as_recording(made), machine(), reference(False))
    assert found.verdict == "fault"
    assert (found.flags[0].gear, found.flags[0].tooth) == ("pinion", None)


@pytest.fixture(scope="module")
def train():
    """Two stages, and what three healthy recordings of them teach."""
    second = ParallelStage(pinion_teeth=19, gear_teeth=62, module_mm=3.5, face_width_mm=36.0)
    two = replace(machine(), stages=(*machine().stages, second))
    parts = [heard(two, load=load, recording_seed=seed) for seed, load in enumerate(HEALTHY_LOADS)]
    return two, learn(parts, two)


def heard(two, fault=None, load=0.9, recording_seed=17):
    faults = [parse_fault(fault)] if fault else []
    return as_recording(
        simulate(
            two,
            faults,
            4.0,
            RATE_HZ,
            machine_seed=2,
            recording_seed=recording_seed,
            channels=2,
            load=load,
            tacho_shaft=1,
        )
    )


def test_healthy_train_is_healthy_and_says_what_would_not_have_been(train):
    told = analyse(heard(train[0]), *train)
    assert told.verdict == "healthy"
    ((fault, sooner),) = re.findall(
        r"called a fault from a loss of (\S+) % of its pair's stiffness"
        r"(?:, and have left the answer open from (\S+) %)?\.",
        told.reason,
    )
    largest = max(own.noticed_from for own in told.profiles)
    assert float(fault) == pytest.approx(100 * largest, rel=0.06)
    # a broken tooth is excluded
    assert float(sooner or fault) <= 44.0


def test_the_angle_is_as_well_known_as_its_fastest_mesh_asks(train):
    machine, known = train
    signature = measure_signature(heard(machine), machine)
    cycles = [signature.track.uncertainty_turns * own.order for own in kinematics(machine).meshes]
    assert len(cycles) == 2
    assert evidence_against(signature, machine, known).angle == pytest.approx(max(cycles))


def test_crack_of_the_second_stage_is_flagged_there(train):
    told = analyse(heard(train[0], "crack:2:gear:7:40%"), *train)
    assert told.verdict == "fault"
    assert told.flags[0].kind == "tooth damage"
    assert (told.flags[0].stage, told.flags[0].gear) == (2, "gear")


def test_of_two_gears_on_a_shaft_the_wrong_one_is_not_blamed(train):
    told = analyse(heard(train[0], "crack:2:pinion:7:40%"), *train)
    assert told.verdict == "fault"
    assert told.flags[0].kind == "tooth damage"
    assert told.flags[0].stage in (2, None)


def test_without_a_tacho_the_verdict_is_the_same():
    healthy = analysis(tacho=False, known_tacho=False)
    cracked = analysis(GEAR_CRACK, tacho=False, known_tacho=False)
    assert healthy.verdict == "healthy"
    assert cracked.verdict == "fault"
    assert "where the first healthy recording begins" in cracked.flags[0].evidence[2]
    assert healthy.signature.speed.method == "comb"


def with_pulses(given, per_turn, first=0):
    """The recording with a tacho of several pulses a turn, the first of them anywhere."""
    row = given.channel_kinds.index("tacho")
    times = find_pulses(given.samples[row], given.sampling_rate_hz).time_s
    now = np.arange(given.samples.shape[1]) / given.sampling_rate_hz
    turns = CubicSpline(times, np.arange(len(times)))(now)
    samples = given.samples.copy()
    samples[row] = np.where((turns * per_turn) % 1 < 0.2, 5.0, 0.0)
    start = int(np.searchsorted(turns, (first + 0.5) / per_turn))
    return replace(given, samples=samples[:, start:])


@pytest.fixture(scope="module")
def four_a_turn():
    """The reference, with four pulses a turn of which any may come first."""
    parts = [
        with_pulses(recording(load=load, seed=seed), 4, seed)
        for seed, load in enumerate(HEALTHY_LOADS)
    ]
    return learn(parts, machine())


@pytest.mark.parametrize("first", [0, 1, 2, 3])
def test_no_tooth_is_counted_from_one_of_several_pulses(four_a_turn, first):
    # which of the four pulses comes first differs from recording to recording
    told = analyse(with_pulses(recording(CRACK), 4, first), machine(), four_a_turn)
    assert told.verdict == "fault"
    assert "where the first healthy recording begins" in told.flags[0].evidence[2]
    one = analysis(CRACK)
    assert told.score == pytest.approx(one.score, rel=0.35)


def test_a_recording_is_heavy_by_what_it_is_beyond_the_heaviest_learned():
    law = HealthyMachine(reference(), machine())
    loads = law.states[:, 0]
    assert np.ptp(loads) > 0.2
    heavy = [law.deviation(own).heavy for own in law.reference.profiles]
    np.testing.assert_allclose(heavy, loads - loads.max(), atol=1e-12)


def test_a_recording_counts_by_its_length_beside_the_shortest_learned():
    known = reference().profiles
    learned = [replace(p, duration_s=s) for p, s in zip(known, (4.0, 8.0, 6.0), strict=True)]
    law = HealthyMachine(replace(reference(), profiles=tuple(learned)), machine())
    for seconds, length in ((1.0, 0.25), (3.0, 0.75), (4.0, 1.0), (10.0, 1.0)):
        own = replace(known[0], duration_s=seconds)
        assert law.deviation(own).length == pytest.approx(length)


@pytest.mark.parametrize("fault", [CRACK, GEAR_CRACK])
@pytest.mark.parametrize("tacho", [True, False])
def test_losses_by_tooth_are_numbered_as_the_flag_is(fault, tacho):
    told = analysis(fault, tacho=tacho, known_tacho=tacho)
    (flag,) = told.flags
    (own,) = (p for p in told.profiles if (p.stage, p.gear) == (flag.stage, flag.gear))
    assert flag.tooth == own.tooth
    assert len(own.loss_by_tooth) == own.teeth
    assert int(np.argmax(own.loss_by_tooth)) + 1 == flag.tooth
    assert own.loss_by_tooth.max() == pytest.approx(flag.stiffness_loss)


def test_without_a_reference_a_healthy_machine_cannot_be_told():
    told = analysis(with_reference=False)
    assert told.verdict == "cannot tell"
    assert told.flags == ()
    assert told.changes == ()
    assert told.compared_with == "expected signature"
    assert told.expected is not None
    # as far as the recording reaches
    half_rate = 0.5 * told.signature.sampling_rate_hz
    assert 0.8 * half_rate < told.expected["frequency_hz"].max() <= half_rate
    assert "no healthy reference" in told.reason


@pytest.mark.parametrize(("fault", "flags"), [(CRACK, 1), ("", 0)])
def test_without_a_reference_every_gear_looked_at_raises_the_chance(fault, flags):
    told = analysis(fault, with_reference=False)
    rarest = min(own.log10_probability for own in told.profiles)
    chance = min(1.0, len(told.profiles) * 10.0**rarest)
    assert told.false_alarm_probability == pytest.approx(chance)
    assert told.score == pytest.approx(-np.log10(chance))
    assert [own.false_alarm_probability for own in told.flags] == pytest.approx(flags * [chance])


def test_without_gear_data_there_is_nothing_to_compare_with():
    bare = Machine(
        name="bare",
        operating=(OperatingPoint(speed_rpm=2960.0),),
        stages=(ParallelStage(pinion_teeth=23, gear_teeth=57),),
    )
    told = analyse(recording(), bare)
    assert told.verdict == "cannot tell"
    assert told.compared_with == "nothing"
    assert any("no expected signature" in warning for warning in told.warnings)


def test_noise_has_no_mesh_and_no_flag(noise):
    assert noise.verdict == "no mesh found"
    assert noise.flags == ()
    assert noise.score == 0.0
    assert not noise.signature.found


def test_other_gears_are_not_found_in_a_recording():
    other = Machine(
        name="other",
        operating=(OperatingPoint(speed_rpm=2960.0),),
        stages=(ParallelStage(pinion_teeth=31, gear_teeth=44),),
    )
    told = analyse(recording(), other)
    assert told.verdict == "no mesh found"
    assert told.flags == ()


def test_speed_and_mesh_are_those_simulated():
    told, truth = analysis(), 2960.0 / 60 * 0.99
    assert told.signature.speed.estimated_hz == pytest.approx(truth, rel=0.01)
    assert [mesh.found for mesh in told.signature.meshes] == [True]
    # where the line is seen: with the speed at which lines peak, which is near the mean
    speed = told.signature.speed
    assert told.signature.meshes[0].frequency_hz == pytest.approx(23 * speed.peak_hz)
    assert speed.peak_hz == pytest.approx(speed.estimated_hz, rel=1.1e-3)


@pytest.mark.parametrize("number", range(6))
def test_json_keeps_the_contract(number, noise):
    told = [*every(), noise][number].to_dict()
    assert as_json(told) == told
    assert set(told) >= KEYS
    assert told["verdict"] in VERDICTS
    assert set(told["speed"]) >= {"nominal_hz", "estimated_hz", "uncertainty_hz", "method"}
    assert all(set(mesh) >= {"stage", "frequency_hz", "found", "snr_db"} for mesh in told["mesh"])
    assert all(set(flag) == FLAG_KEYS for flag in told["flags"])
    assert all(isinstance(flag["evidence"], list) and flag["evidence"] for flag in told["flags"])
    assert told["score"] >= 0
    assert 0 <= told["false_alarm_probability"] <= 1


def test_flags_and_verdict_agree():
    for told in every():
        assert bool(told.flags) == (told.verdict == "fault")
        assert all(0 <= flag.false_alarm_probability < LIMITS.rare for flag in told.flags)


def test_score_and_false_alarm_probability_go_together():
    for told in every():
        # a score of 2 is called a fault; on simulated machines it is rarer than that
        if told.score >= 2:
            assert -math.log10(told.false_alarm_probability) >= 1.8
        elif told.compared_with == "reference":
            assert told.false_alarm_probability > 1e-3
    assert analysis(GEAR_CRACK).score > analysis(CRACK).score > analysis().score


def test_score_rises_with_the_crack():
    scores = [analysis(f"crack:1:gear:30:{size}").score for size in ("5%", "15%", "40%")]
    assert scores == sorted(scores)


def test_indicators_name_gear_and_channel():
    table = analysis().to_dict()["indicators"]
    for name in ("rms", "kurtosis", "FM0, pinion of stage 1", "FM4, gear of stage 1"):
        assert set(table[name]) == {"a1", "a2"}
    samples = recording().vibration().samples
    assert table["rms"]["a1"] == pytest.approx(float(np.std(samples[0])), rel=1e-9)


def test_changes_hold_every_family_and_channel_once():
    told = analysis(CRACK)
    places = [(change.channel, change.family) for change in told.changes]
    # those that noise raised tell nothing and are left out
    assert len(set(places)) == len(places)
    assert 1.5 * len(reference().family_names) < len(places) <= 2 * len(reference().family_names)
    for change in told.changes[:5]:
        entry = change.to_dict()
        assert entry["change_db"] == pytest.approx(entry["level_db"] - entry["reference_db"])


def test_the_unit_of_the_sensor_does_not_matter():
    # references and recording in another unit: the same answer
    loads = enumerate(HEALTHY_LOADS)
    parts = [recording(load=load, seed=seed) for seed, load in loads]
    scaled = learn([_times(part, 1000.0) for part in parts], machine())
    one, two = analysis(CRACK), analyse(_times(recording(CRACK), 1000.0), machine(), scaled)
    assert two.verdict == one.verdict
    assert two.score == pytest.approx(one.score, rel=1e-6)


def test_one_sensor_twice_as_loud_is_no_fault():
    louder = recording()
    samples = louder.samples.copy()
    samples[0] *= 2
    assert analyse(replace(louder, samples=samples), machine(), reference()).verdict == "healthy"


def test_channels_are_found_by_name_not_by_place():
    given = recording(CRACK)
    turned = given.select(["a2", "a1", "tacho"])
    one, two = analysis(CRACK), analyse(turned, machine(), reference())
    assert two.score == pytest.approx(one.score, rel=1e-6)


def test_order_of_the_references_does_not_matter():
    loads = list(enumerate(HEALTHY_LOADS))[::-1]
    turned = learn([recording(load=load, seed=seed) for seed, load in loads], machine())
    assert analyse(recording(CRACK), machine(), turned).score == pytest.approx(
        analysis(CRACK).score, rel=0.02
    )


def test_a_loss_is_told_at_the_speed_that_was_recorded():
    """Whichever operating point of the machine file comes first."""
    (own,) = machine().operating
    slow = replace(own, speed_rpm=0.4 * own.speed_rpm, share=0.5)
    points = slow, replace(own, share=0.5)
    told = [
        analyse(recording(CRACK), replace(machine(), operating=order), reference()).flags[0]
        for order in (points, points[::-1])
    ]
    assert (
        told[0].stiffness_loss == told[1].stiffness_loss == analysis(CRACK).flags[0].stiffness_loss
    )


def test_a_channel_the_reference_lacks_is_left_out_and_said_so():
    only = learn([recording(load=0.85, seed=1).select(["a1", "tacho"])], machine())
    told = analyse(recording(), machine(), only)
    assert {change.channel for change in told.changes} == {"a1"}
    assert any("left out: a2" in warning for warning in told.warnings)
    assert any("the reference is one recording" in warning for warning in told.warnings)


def test_a_channel_not_looked_at_is_said_so():
    told = analyse(recording().select(["a2", "tacho"]), machine(), reference())
    assert any("not looked at: a1" in warning for warning in told.warnings)


def test_what_the_reference_is_of_is_said_where_the_mesh_is_lost_too():
    stranger = replace(machine(), name="stranger")
    noise = replace(recording(), samples=white(recording().samples.shape, seed=5)).vibration()
    told = analyse(noise, stranger, reference())
    assert told.verdict != "healthy"
    assert any("is it the same machine?" in warning for warning in told.warnings)


def test_a_speed_outside_the_reference_is_said_so():
    own_hz = reference().profiles[0].speed_hz

    def against(share):
        profiles = [replace(own, speed_hz=share * own_hz) for own in reference().profiles]
        return analyse(recording(), machine(), replace(reference(), profiles=tuple(profiles)))

    assert any(
        "off that of every healthy recording" in warning for warning in against(0.94).warnings
    )
    # where lines lie elsewhere on resonances the reference tells nothing
    far = against(0.8)
    assert far.verdict == "cannot tell"
    assert "in the reference at" in far.reason


def heard_at(speed_hz, orders, levels, seed, seconds=6):
    """A recording of some lines at this mean speed, in noise."""
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    clean = lines_on(wandering_turns(time, speed_hz, 1e-3, seed), orders, levels)
    samples = clean + white((1, len(time)), 0.1, seed=seed)
    return Recording(samples=samples, sampling_rate_hz=RATE_HZ, origin=f"{speed_hz} Hz, {seed}")


def driven(*stages):
    gears = [ParallelStage(pinion_teeth=one, gear_teeth=two) for one, two in stages]
    return Machine(name="driven", operating=(OperatingPoint(speed_rpm=1200),), stages=tuple(gears))


def test_the_only_mesh_that_is_heard_passes_for_no_other():
    # 5 % below the order of the first mesh stands the second, which alone is heard
    box, order = driven((29, 50), (48, 95)), 48 * 29 / 50
    lines = [order, 2 * order, 3 * order, 4 * order], [1.0, 0.6, 0.3, 0.3]
    known = learn([heard_at(20.0, *lines, seed, 10) for seed in (1, 2, 3)], box)
    fast = heard_at(20.8, *lines, 4, 10)
    assert abs(measure_signature(fast, box).speed.estimated_hz - 20.8) > 0.5
    told = analyse(fast, box, known)
    assert told.signature.speed.estimated_hz == pytest.approx(20.8, rel=1e-3)
    assert [mesh.found for mesh in told.signature.meshes] == [False, True]
    assert told.verdict != "fault"


def test_a_known_mesh_is_found_far_off_without_sidebands():
    # alone it may be that of other teeth at another speed
    box, lines = driven((23, 61)), ([23.0, 46.0, 69.0, 92.0], [1.0, 0.6, 0.3, 0.3])
    known = learn([heard_at(20.0, *lines, seed) for seed in (1, 2, 3)], box)
    fast = heard_at(22.8, *lines, 4)
    assert not measure_signature(fast, box).found
    told = analyse(fast, box, known)
    assert told.signature.speed.estimated_hz == pytest.approx(22.8, rel=1e-3)
    assert told.verdict == "cannot tell"
    assert "levels change with speed" in told.reason
    # nor is it unknown where another healthy recording shows it
    both = learn([fast, heard_at(20.0, *lines, 1)], box)
    assert [own.speed_hz for own in both.profiles] == pytest.approx([22.8, 20.0], rel=1e-3)
    with pytest.raises(ArgumentError, match="no mesh found"):
        learn([fast], box)


def test_what_healthy_teeth_show_as_well_is_no_damage():
    one, other = (Profile.of(analysis(CRACK, seed=seed).signature) for seed in (1, 2))
    assert min(own.log10_probability for own in own_teeth(one)) < -3
    assert min(own.log10_probability for own in own_teeth(one, [other])) > -2
    sound = Profile.of(analysis(seed=3).signature)
    assert min(own.log10_probability for own in own_teeth(one, [sound])) < -3


def test_foreign_reference_is_refused():
    foreign = replace(reference(), teeth="32/96, 32/80")
    with pytest.raises(ArgumentError, match=r"learned for teeth 32/96.*23/57"):
        analyse(recording(), machine(), foreign)


def test_reference_without_these_channels_is_refused():
    other = replace(reference(), channel_names=("x", "y"))
    with pytest.raises(ArgumentError, match="a1, a2 are not in the reference, which has x, y"):
        analyse(recording(), machine(), other)


def test_reference_without_these_families_is_refused():
    other = replace(reference(), family_names=())
    with pytest.raises(ArgumentError, match="shares no family"):
        analyse(recording(), machine(), other)


def test_recording_without_vibration_is_refused():
    with pytest.raises(RecordingError, match="no vibration channel"):
        analyse(recording().select(["tacho"]), machine(), None)


def test_too_short_a_recording_is_refused():
    short = Recording(samples=white((1, 200)), sampling_rate_hz=RATE_HZ)
    with pytest.raises(RecordingError, match="too short"):
        analyse(short, machine(), None)


def test_silence_has_no_mesh():
    quiet = Recording(samples=np.zeros((1, 40_000)), sampling_rate_hz=RATE_HZ)
    told = analyse(quiet, machine(), None)
    assert told.verdict == "no mesh found"
    assert as_json(told.to_dict()) == told.to_dict()


def _times(part, factor):
    scale = np.where(np.array(part.channel_kinds) == "vibration", factor, 1.0)
    return replace(part, samples=part.samples * scale[:, None])


def test_without_a_reference_every_gear_is_a_place_to_look_at():
    told = analysis(CRACK, with_reference=False)
    rarest = min(profile.log10_probability for profile in told.profiles)
    assert len(told.profiles) == 2
    assert told.score == pytest.approx(-(rarest + math.log10(2)))


@pytest.mark.parametrize(("knocks", "seconds"), [(4, None), (3, 2.0)])
def test_knocks_from_outside_are_no_fault_of_a_gear(knocks, seconds):
    own, chance = recording(), np.random.default_rng(5)
    count = own.samples.shape[1] if seconds is None else int(seconds * RATE_HZ)
    samples = own.samples[:, :count].copy()
    rings = np.exp(-np.arange(2000) / 150) * np.sin(0.6 * np.arange(2000))
    vibrates = [kind == "vibration" for kind in own.channel_kinds]
    for start in chance.integers(2000, count - 2000, knocks):
        samples[vibrates, start : start + 2000] += 3 * np.abs(own.samples[vibrates]).max() * rings
    told = analyse(replace(own, samples=samples), machine(), reference())
    assert told.verdict in ("healthy", "cannot tell")
    assert not told.flags


def test_a_tooth_is_found_between_knocks():
    own = recording(CRACK)
    samples = own.samples.copy()
    rings = np.exp(-np.arange(2000) / 150) * np.sin(0.6 * np.arange(2000))
    vibrates = [kind == "vibration" for kind in own.channel_kinds]
    samples[vibrates, 30_000:32_000] += 3 * np.abs(own.samples[vibrates]).max() * rings
    told = analyse(replace(own, samples=samples), machine(), reference())
    assert told.verdict == "fault"
    assert (told.flags[0].gear, told.flags[0].tooth) == ("pinion", 7)


def test_a_tooth_that_few_lines_tell_of_is_no_knock():
    # most lines of this pinion are noise: its own scatter there is that of everywhere
    combine = load_machine(Path(__file__).parents[2] / "signatures" / "combine_gearbox.toml")
    own = {"machine_seed": 2, "duration_s": 6.0}
    healthy = learn([simulate(combine, load=0.8, recording_seed=1, **own)], combine)
    cracked = simulate(combine, "crack:1:pinion:3:30%", load=0.9, recording_seed=2, **own)
    told = analyse(cracked, combine, healthy)
    assert told.verdict == "fault"
    assert (told.flags[0].stage, told.flags[0].gear) == (1, "pinion")


@pytest.mark.parametrize("gear", ["pinion", "gear"])
def test_of_gears_that_turn_alike_either_may_be_the_cause(gear):
    # the bevel gears of a T box: what one of them does once a turn, the other does as well
    stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 23, "module_mm": 4.0}
    stage |= {"face_width_mm": 30.0}
    box = load_machine({"operating": [{"speed_rpm": 540, "torque_nm": 300}], "stage": [stage]})
    driven = partial(simulate, box, duration_s=3.0, channels=1, machine_seed=3)
    cracked = driven(f"crack:1:{gear}:9:25%", recording_seed=6, load=0.9)
    told = analyse(cracked, box, learn([driven(recording_seed=1)], box))
    assert told.flags[0].kind == "tooth damage"
    other = {"pinion": "gear", "gear": "pinion"}[told.flags[0].gear]
    assert left_open(told.flags[0]) == [
        f"the {other} of stage 1 shows it too and may be the cause as well"
    ]


@cache
def tractor():
    """Six seconds of a sensor on a tractor as they are simulated, and what a sound one teaches."""
    known = load_machine("signatures/tractor_pto.toml")
    driven = partial(simulate, known, duration_s=6.0, channels=1)
    return known, driven, learn([driven(recording_seed=1)], known)


@pytest.mark.parametrize(("gear", "loss"), [("pinion", 60), ("pinion", 90), ("gear", 90)])
def test_a_broken_tooth_fills_all_orders_of_its_gear_and_is_still_found(gear, loss):
    # its lines drown the mesh, and suit the lower of the machine's two speeds as well
    known, driven, healthy = tractor()
    broken = driven(f"crack:1:{gear}:5:{loss}%", recording_seed=5)
    told = analyse(broken, known, healthy)
    assert told.verdict == "fault"
    assert [(flag.kind, flag.gear) for flag in told.flags[:1]] == [("tooth damage", gear)]
    assert told.score > 10
    assert told.signature.speed.estimated_hz == pytest.approx(31.4, rel=0.01)
