"""Measured signatures: levels in closed form, laws, simulated machines and real recordings."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from reference.simulated_machines import planetary, two_stages
from reference.synthetic_signals import (
    as_recording,
    lines_on,
    track_of,
    wandering_turns,
    white,
)
from scipy.signal import iirpeak, lfilter, welch

from gearmon.benchmark.detection_machines import Condition, Setting, draw_machine
from gearmon.errors import RecordingError
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, OperatingPoint, ParallelStage, Sensor, load_machine
from gearmon.signals.orders import OrderBlocks
from gearmon.signals.recording import Recording, read_recording
from gearmon.signatures.measured.line_plan import line_plan
from gearmon.signatures.measured.measurement import (
    _held,
    broadband_levels,
    family_levels,
    level_and_error_db,
    measure_signature,
)
from gearmon.signatures.tracking import mesh_combs
from gearmon.simulation import simulate

SIGNATURES = Path(__file__).parents[2] / "signatures"
PAIR = SIGNATURES / "reference_pair.toml"

RATE, SPEED, DURATION = 4000.0, 24.7, 16.0
TIME = np.arange(int(DURATION * RATE)) / RATE
WANDER = 0.001


def one_pair(pinion=23, gear=61, *speeds_rpm):
    speeds = speeds_rpm or (1500.0,)
    points = tuple(OperatingPoint(speed_rpm=speed, share=1 / len(speeds)) for speed in speeds)
    stage = ParallelStage(pinion_teeth=pinion, gear_teeth=gear)
    return Machine(name="pair", operating=points, stages=(stage,))


MACHINE = one_pair()
TURNS = wandering_turns(TIME, SPEED, WANDER, 1)
# sidebands of the pinion about mesh harmonics 1 and 2, unequal as on real machines
SIDES = {1: {-2: 0.05, -1: 0.2, 1: 0.3, 2: 0.1}, 2: {-1: 0.15, 1: 0.1}}
MESH = {1: 1.0, 2: 0.6, 3: 0.3}


def modulated(noise=0.05, seed=0, factor=1.0):
    """Two channels of a pair with known mesh harmonics and sidebands, the second half as loud."""
    orders, levels = [1.0], [0.3]
    for k, level in MESH.items():
        orders.append(23.0 * k)
        levels.append(level)
        for r, side in SIDES.get(k, {}).items():
            orders.append(23.0 * k + r)
            levels.append(side)
    phases = np.random.default_rng(5).uniform(0, 6.28, len(orders))
    clean = lines_on(TURNS, orders, levels, phases)
    samples = np.vstack([clean, 0.5 * clean]) + white((2, len(TIME)), noise, seed=seed)
    return Recording(samples=factor * samples, sampling_rate_hz=RATE, origin="synthetic")


@pytest.fixture(scope="module")
def signature():
    return measure_signature(modulated(), MACHINE)


def column(measured, kind, harmonic, gear=""):
    for index, family in enumerate(measured.plan.families):
        if (family.kind, family.harmonic, family.gear) == (kind, harmonic, gear):
            return index
    raise AssertionError((kind, harmonic, gear))


def decibels(*amplitudes):
    return 10 * np.log10(np.sum(np.square(amplitudes)))


@pytest.mark.parametrize("harmonic", [1, 2, 3])
def test_mesh_levels_equal_the_closed_form(signature, harmonic):
    index = column(signature, "mesh", harmonic)
    expected = decibels(MESH[harmonic])
    assert signature.level_db[0, index] == pytest.approx(expected, abs=0.2)
    assert signature.level_db[1, index] == pytest.approx(expected - 6.02, abs=0.2)
    assert signature.heard[:, index].all()


@pytest.mark.parametrize("harmonic", [1, 2])
def test_sideband_levels_equal_the_closed_form(signature, harmonic):
    index = column(signature, "sidebands", harmonic, "pinion")
    expected = decibels(*SIDES[harmonic].values())
    assert signature.level_db[0, index] == pytest.approx(expected, abs=0.2)
    assert signature.heard[:, index].all()


def test_families_without_lines_are_not_heard(signature):
    silent = [column(signature, "sidebands", harmonic, "gear") for harmonic in (1, 2, 3)] + [
        column(signature, "residual", harmonic, "pinion") for harmonic in (1, 2)
    ]
    assert signature.heard[:, silent].mean() < 0.25
    assert signature.level_db[0, silent].max() < -20


def test_speed_and_mesh_are_right(signature):
    true = (TURNS[-1] - TURNS[0]) / TIME[-1]
    assert signature.speed.nominal_hz == 25.0
    assert signature.speed.estimated_hz == pytest.approx(true, rel=2e-5)
    assert signature.speed.lowest_hz <= true <= signature.speed.highest_hz
    assert signature.speed.method == "comb"
    (mesh,) = signature.meshes
    assert mesh.found
    # where its line stands in one spectrum: at a speed that was run for long, near the mean
    assert mesh.frequency_hz == pytest.approx(23 * true, rel=1.1e-3)
    assert signature.speed.lowest_hz <= mesh.frequency_hz / 23 <= signature.speed.highest_hz
    assert mesh.snr_db > 20
    assert signature.found


@pytest.mark.parametrize("noise", [0.05, 0.2])
def test_a_mesh_stands_above_white_noise_by_its_clearest_harmonic(noise):
    """A Hann block of n samples leaves 6 sigma^2/n of the noise at a line, by squared amplitude."""
    found = measure_signature(modulated(noise), MACHINE)
    samples = RATE * found.lines.block_turns / SPEED
    expected = 10 * np.log10(max(MESH.values()) ** 2 * samples / (6 * noise**2))
    assert found.meshes[0].snr_db == pytest.approx(expected, abs=0.5)


def test_ten_times_the_signal_is_twenty_decibels_more(signature):
    louder = measure_signature(modulated(factor=10.0), MACHINE)
    np.testing.assert_allclose(louder.level_db, signature.level_db + 20, atol=0.01)
    np.testing.assert_allclose(louder.scatter_db, signature.scatter_db, rtol=1e-3)
    np.testing.assert_array_equal(louder.heard, signature.heard)
    assert louder.speed.estimated_hz == pytest.approx(signature.speed.estimated_hz, rel=1e-9)


def test_channels_stay_apart(signature):
    plain = modulated()
    swapped = Recording(samples=plain.samples[::-1].copy(), sampling_rate_hz=RATE)
    other = measure_signature(swapped, MACHINE)
    np.testing.assert_allclose(other.level_db, signature.level_db[::-1], atol=1e-6)


@pytest.mark.parametrize("seed", [1, 2])
def test_asynchronous_noise_moves_levels_within_their_scatter(signature, seed):
    # ten times the noise: the lines stay where they were, within what the scatter allows
    noisy = measure_signature(modulated(noise=0.5, seed=seed), MACHINE)
    loud = [column(signature, "mesh", k) for k in MESH]
    loud += [column(signature, "sidebands", k, "pinion") for k in SIDES]
    moved = np.abs(noisy.level_db[:, loud] - signature.level_db[:, loud])
    assert np.all(moved < 4 * noisy.scatter_db[:, loud] + 0.2)
    assert moved.max() < 1.5


def test_scatter_is_the_standard_error_of_the_level():
    turns = wandering_turns(TIME, SPEED, WANDER, 1)
    track = track_of(lambda t: wandering_turns(t, SPEED, WANDER, 1), TIME[-1], 400)
    plan = line_plan(kinematics(MACHINE), 75.0, 0.09)
    levels, scatters = [], []
    for seed in range(20):
        samples = lines_on(turns, [23.0], [0.1]) + white((1, len(TIME)), seed=seed)
        lines = OrderBlocks(samples, RATE, track, plan.orders, 20.0).lines()
        level, scatter, _ = family_levels(lines, plan)
        levels.append(level[0, 0])
        scatters.append(scatter[0, 0])
    assert plan.families[0].kind == "mesh"
    assert 0.5 < np.mean(scatters) / np.std(levels) < 2.0
    assert np.mean(levels) == pytest.approx(-20, abs=0.5)


@pytest.mark.parametrize("share", [1e-4, 0.03])
def test_an_error_in_decibels_is_that_of_the_power(share):
    """As far as the level moves when the power moves by its error; of what is drowned, a neper."""
    power = np.array([1e-6, 0.2, 40.0])
    level, error = level_and_error_db(power, share * power)
    moved, _ = level_and_error_db((1 + share) * power, 0 * power)
    np.testing.assert_allclose(moved - level, error, rtol=share)
    np.testing.assert_allclose(level, 10 * np.log10(power))
    level, error = level_and_error_db(0.01 * power, power)
    np.testing.assert_allclose(level, 10 * np.log10(power))
    np.testing.assert_allclose(error, 10 * np.log10(np.e))


def test_noise_alone_is_rarely_heard():
    track = track_of(lambda t: SPEED * t, TIME[-1], 3)
    plan = line_plan(kinematics(MACHINE), 75.0, 0.09)
    samples = white((6, len(TIME)), seed=9)
    lines = OrderBlocks(samples, RATE, track, plan.orders, 20.0).lines()
    _, _, heard = family_levels(lines, plan)
    assert heard.mean() < 0.06  # twice the standard error, one side


def test_signature_of_a_recording_goes_into_json(signature):
    known = {"speed": signature.speed.to_dict(), "mesh": [m.to_dict() for m in signature.meshes]}
    assert json.loads(json.dumps(known)) == known


def test_shapes_fit_together(signature):
    channels, families = 2, len(signature.plan.families)
    for table in (signature.level_db, signature.scatter_db, signature.heard):
        assert table.shape == (channels, families)
    assert np.isfinite(signature.level_db).all()
    assert (signature.scatter_db >= 0).all()
    assert signature.channel_names == ("channel 1", "channel 2")
    assert len(signature.units) == channels
    assert signature.lines.amplitude.shape[1:] == (channels, len(signature.plan.orders))


@pytest.mark.parametrize("nominal", [24.0, 25.4])
def test_wrong_nominal_speed_does_not_matter(signature, nominal):
    other = measure_signature(modulated(), one_pair(23, 61, 60 * nominal))
    assert other.speed.estimated_hz == pytest.approx(signature.speed.estimated_hz, rel=2e-5)
    assert other.found


def test_the_operating_point_that_fits_is_taken():
    measured = measure_signature(modulated(), one_pair(23, 61, 1000.0, 1500.0, 1800.0))
    assert measured.speed.nominal_hz == 25.0


@pytest.mark.parametrize(("rpm", "seed"), [(1906.0, 2), (950.0, 3)])
def test_twice_the_speed_is_told_from_once(rpm, seed):
    stage = ParallelStage(pinion_teeth=17, gear_teeth=60, module_mm=4.0, face_width_mm=36.0)
    machine = replace(one_pair(17, 60, 1906.0, 950.0), stages=(stage,))
    point = replace(machine.operating[0], speed_rpm=rpm, torque_nm=100.0)
    made = simulate(machine, point=point, machine_seed=seed, recording_seed=seed, duration_s=6.0)
    found = measure_signature(made, machine)
    assert found.found
    assert found.speed.estimated_hz == pytest.approx(rpm / 60, rel=0.03)


@pytest.mark.parametrize("seed", range(6))
def test_a_path_through_noise_is_no_mesh(seed):
    """Whatever a path that may change by 30 % a second gathers on its way."""
    recording = Recording(samples=white((1, len(TIME)), seed=20 + seed), sampling_rate_hz=RATE)
    assert not measure_signature(recording, MACHINE).held


def test_an_engine_that_hunts_is_followed():
    """A speed that wanders by 3 %, up to 19 % a second, in noise, bearing tones and mains hum."""
    made = simulate(
        load_machine(PAIR),
        machine_seed=911,
        recording_seed=7,
        channels=2,
        load=0.9,
        speed_drift=0.03,
        load_drift=0.1,
        snr_db=10.0,
        mains_hz=50.0,
        bearing_tones=0.3,
        tacho_shaft=1,
    )
    recording = read_recording(made)
    true, found = (
        measure_signature(own, load_machine(PAIR)) for own in (recording, recording.vibration())
    )
    assert found.found
    assert not found.angle_lost
    assert (true.speed.method, found.speed.method) == ("tacho", "comb")
    assert found.speed.estimated_hz == pytest.approx(true.speed.estimated_hz, rel=2e-4)


@pytest.mark.parametrize(("spacing", "found"), [(None, False), (1.0, False), (23 / 61, True)])
def test_one_mesh_line_counts_with_sidebands_of_the_gear_on_another_shaft(spacing, found):
    """Lines a turn of shaft 1 apart stand about anything on a machine without gears as well."""
    orders, levels = [23.0], [1.0]
    if spacing:
        orders += [23.0 + spacing * r for r in (-4, -3, -2, -1, 1, 2, 3, 4)]
        levels += [0.3] * 8
    phases = np.random.default_rng(4).uniform(0, 6.28, len(orders))
    samples = lines_on(TURNS, orders, levels, phases) + white((1, len(TIME)), 0.3, seed=4)
    recording = Recording(samples=samples, sampling_rate_hz=RATE, origin="synthetic")
    assert measure_signature(recording, MACHINE).meshes[0].found == found


def test_noise_is_a_result_and_not_an_error():
    recording = Recording(samples=white((1, len(TIME)), seed=3), sampling_rate_hz=RATE)
    measured = measure_signature(recording, MACHINE)
    assert not measured.found
    assert "standard deviations" in measured.meshes[0].reason


def test_recording_shorter_than_two_turns_is_refused():
    short = Recording(samples=white((1, 700), seed=4), sampling_rate_hz=RATE, origin="short.csv")
    with pytest.raises(RecordingError, match=r"short\.csv: 0\.175 s are too short: the slowest"):
        measure_signature(short, MACHINE)


def test_recording_without_vibration_is_refused():
    recording = Recording(
        samples=white((1, 8000)), sampling_rate_hz=RATE, channel_kinds=("torque",), origin="t.csv"
    )
    with pytest.raises(RecordingError, match=r"t\.csv: no vibration channel"):
        measure_signature(recording, MACHINE)


def test_mesh_above_half_the_sampling_rate_is_not_found_and_said_so():
    recording = Recording(samples=white((1, 8000), seed=5), sampling_rate_hz=1000.0)
    measured = measure_signature(recording, MACHINE)
    assert not measured.found
    assert any("Nyquist" in note for note in measured.notes)


def test_combs_are_plain_orders_of_the_meshes():
    (pair,) = mesh_combs(kinematics(MACHINE), 30.0)
    assert pair.order == 23.0
    assert pair.groups[1] == (46.0,)
    assert pair.spacings == pytest.approx((1.0, 23 / 61))
    (sets,) = mesh_combs(kinematics(planetary()), 30.0)
    assert sets.order == pytest.approx(100 / 6)
    assert sets.spacings == pytest.approx((1 / 6,))
    assert sets.groups[0] == pytest.approx((99 / 6, 100 / 6, 101 / 6, 102 / 6))


def with_tones(seed, count=12, rate=5000.0, duration=8.0):
    """Noise and tones that belong to no gear."""
    generator = np.random.default_rng(seed)
    time = np.arange(int(rate * duration)) / rate
    samples = generator.standard_normal((2, len(time)))
    for _ in range(count):
        level, frequency = generator.uniform(0.1, 2), generator.uniform(50, 2300)
        samples += level * np.cos(2 * np.pi * frequency * time + generator.uniform(0, 6))
    return Recording(samples=samples, sampling_rate_hz=rate)


@pytest.mark.parametrize(
    ("seed", "teeth"),
    [(1000, (32, 43)), (1004, (23, 61)), (1006, (17, 43)), (1026, (45, 40))],
)
def test_tones_of_another_origin_are_no_mesh(seed, teeth):
    assert not measure_signature(with_tones(seed), one_pair(*teeth)).found


# -- simulated machines ---------------------------------------------------------------------------


def test_tacho_gives_angle_speed_and_a_note(two_stage_recording):
    measured = measure_signature(as_recording(two_stage_recording), two_stages())
    truth = two_stage_recording.truth["speed"]
    assert measured.speed.method == "tacho"
    assert measured.speed.estimated_hz == pytest.approx(truth["mean_hz"], rel=2e-5)
    assert measured.channel_names == ("a1", "a2")
    assert "tacho tacho: 1 pulse a turn" in measured.notes
    times = np.array(truth["turn_times_s"])[2:-2]
    error = measured.track.turns_at(times) - np.arange(len(times))
    assert (error - error.mean()).std() * 26 < 0.02


def squared(turns, per_turn):
    """The waveform of a tachometer that is high for half of each pitch."""
    return np.where((turns * per_turn) % 1.0 < 0.5, 5.0, 0.0)


@pytest.mark.parametrize("column", ["pulses", 3])
def test_sensor_says_what_the_tacho_sits_on(column):
    # 61 pulses in a turn of shaft 2 look like 23 in a turn of shaft 1
    sensor = Sensor(column=column, kind="tacho", shaft=2, pulses_per_turn=61)
    machine = Machine(
        name="pair", operating=MACHINE.operating, stages=MACHINE.stages, sensors=(sensor,)
    )
    plain = modulated()
    pulses = squared(TURNS * 23 / 61, 61)
    recording = Recording(
        samples=np.vstack([plain.samples, pulses]),
        sampling_rate_hz=RATE,
        channel_names=("a1", "a2", "pulses"),
        channel_kinds=("vibration", "vibration", "tacho"),
    )
    measured = measure_signature(recording, machine)
    true = (TURNS[-1] - TURNS[0]) / TIME[-1]
    assert measured.speed.estimated_hz == pytest.approx(true, rel=1e-3)
    assert "tacho pulses: 61 pulses a turn" in measured.notes


def with_column(row, told):
    """The pair with a column that is called tacho."""
    plain = modulated()
    return Recording(
        samples=np.vstack([plain.samples, row]),
        sampling_rate_hz=RATE,
        channel_names=("a1", "a2", "tacho"),
        channel_kinds=("vibration", "vibration", "tacho"),
        tacho_told=told,
    )


def test_pulses_and_mesh_lines_give_the_angle_together():
    measured = measure_signature(with_column(squared(TURNS, 1), told=False), MACHINE)
    assert measured.speed.method == "tacho"
    assert measured.track.indexed
    error = measured.track.turns_at(TIME) - TURNS
    # an edge between two samples is 0.04 mesh periods off; angle zero is that of the pulses
    assert np.std(error) * 23 < 0.005
    assert abs(error.mean() - round(error.mean())) * 23 < 0.01


@pytest.mark.parametrize(("count", "nominal_rpm"), [(1, 1350), (2, 1290), (8, 1720), (20, 1350)])
def test_far_from_nominal_speed_the_mesh_tells_how_pulses_are_counted(count, nominal_rpm):
    # 14 % below the nominal speed eight pulses a turn come as seven would
    recording = with_column(squared(TURNS, count), told=True)
    measured = measure_signature(recording, one_pair(23, 61, nominal_rpm))
    assert measured.speed.method == "tacho"
    assert f"tacho tacho: {count} pulse{'s' * (count > 1)} a turn" in measured.notes
    assert measured.speed.estimated_hz == pytest.approx(SPEED, rel=1e-3)


@pytest.mark.parametrize("share", [0.45, 0.6, 1.25])
@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_a_machine_may_run_far_from_its_nominal_speed_with_a_tachometer(count, share):
    recording = with_column(squared(TURNS, count), told=False)
    measured = measure_signature(recording, one_pair(23, 61, 60 * SPEED / share))
    assert f"tacho tacho: {count} pulse{'s' * (count > 1)} a turn" in measured.notes
    assert measured.speed.estimated_hz == pytest.approx(SPEED, rel=1e-3)
    assert measured.found


def test_teeth_that_alternate_are_no_second_pulse_a_turn():
    # cutting with two starts: every other tooth alike, so that a comb stands at half the mesh order
    orders = 12.0 * np.arange(1, 13)
    levels = np.where(np.arange(1, 13) % 2, 0.6, 1.0)
    clean = lines_on(TURNS, orders, levels, np.random.default_rng(7).uniform(0, 6.28, 12))
    recording = Recording(
        samples=np.vstack([clean + white(len(TIME), 0.1, seed=3), squared(TURNS, 1)]),
        sampling_rate_hz=RATE,
        channel_names=("a1", "tacho"),
        channel_kinds=("vibration", "tacho"),
        tacho_told=False,
    )
    measured = measure_signature(recording, one_pair(24, 61))
    assert "tacho tacho: 1 pulse a turn" in measured.notes
    assert measured.speed.estimated_hz == pytest.approx(SPEED, rel=1e-3)


def run_up(slowest, fastest):
    """Angle of a shaft that is run up and down between two shares of the nominal 25 Hz."""
    last = TIME[-1]
    places = [0.0, 0.2 * last, 0.5 * last, 0.6 * last, 0.9 * last, last]
    speed = 25.0 * np.interp(TIME, places, [slowest, slowest, fastest, fastest, slowest, slowest])
    return np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / RATE])


@pytest.mark.parametrize(("slowest", "fastest"), [(0.6, 1.1), (0.5, 1.0), (0.7, 0.9)])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_tachometer_holds_the_angle_of_a_machine_that_is_run_up(slowest, fastest, count):
    turns = run_up(slowest, fastest)
    orders = np.array([23.0, 46.0, 69.0, 92.0, 115.0, 24.0, 45.0])
    levels = np.array([1.0, 0.6, 0.8, 0.3, 0.5, 0.3, 0.2])
    clean = lines_on(turns, orders, levels, np.arange(7.0))
    # a housing with three modes turns the lines as they pass
    for mode_hz in 400.0, 900.0, 1500.0:
        clean = clean + lfilter(*iirpeak(mode_hz, 30, fs=RATE), clean)
    recording = Recording(
        samples=np.vstack([clean + white(len(TIME), 0.1, seed=3), squared(turns, count)]),
        sampling_rate_hz=RATE,
        channel_names=("a1", "tacho"),
        channel_kinds=("vibration", "tacho"),
        tacho_told=False,
    )
    measured = measure_signature(recording, MACHINE)
    assert f"tacho tacho: {count} pulse{'s' * (count > 1)} a turn" in measured.notes
    assert measured.found
    assert measured.speed_swings
    assert not measured.angle_lost
    assert measured.lines.knocked == 0.0
    error = 23 * (measured.track.turns_at(TIME) - turns)
    assert np.std(error) < 0.03
    # what the pulses are said to scatter by covers it, and is no alarm
    assert np.std(error) < 3 * 23 * measured.track.uncertainty_turns < 0.2


# of a generator that a slow rotor drives: 0.6 turns a second, and 11.5 at the other end
STEPPED_UP = Machine(
    name="step-up drive",
    operating=(OperatingPoint(speed_rpm=36.0),),
    stages=(
        ParallelStage(pinion_teeth=83, gear_teeth=19),
        ParallelStage(pinion_teeth=79, gear_teeth=18),
    ),
)


def stepped_up(wander, seed):
    """Angle of its slow shaft, and vibration with lines of both meshes and all its gears."""
    time = np.arange(int(30 * RATE)) / RATE
    turns = wandering_turns(time, 0.6, wander, seed)
    shafts = np.array([1.0, 83 / 19, 83 / 19 * 79 / 18])
    told = [
        (k * teeth * shafts[stage] + side * shafts[gear], level / k * (0.1 if side else 1.0))
        for stage, teeth, level in ((0, 83, 0.3), (1, 79, 1.0))
        for k in range(1, 6)
        for side, gear in ((0, stage), *((s, stage + n) for s in (-1, 1) for n in (0, 1)))
    ]
    orders, levels = np.transpose(told)
    phases = np.random.default_rng(seed).uniform(0, 6.28, len(told))
    return turns, lines_on(turns, orders, levels, phases)


@pytest.mark.parametrize(("wander", "seed"), [(0.001, 1), (0.001, 2), (0.005, 2), (0.005, 3)])
def test_a_slow_input_is_tracked_by_the_meshes_of_the_fast_shafts(wander, seed):
    turns, clean = stepped_up(wander, seed)
    samples = clean + white(len(clean), 0.2, seed=seed)
    recording = Recording(samples=samples, sampling_rate_hz=RATE)
    measured = measure_signature(recording, STEPPED_UP)
    assert [mesh.found for mesh in measured.meshes] == [True, True]
    assert not measured.angle_lost
    error = measured.track.turns_at(np.arange(len(turns)) / RATE) - turns
    assert np.std(error) * STEPPED_UP.stages[1].pinion_teeth * 83 / 19 < 0.03
    assert measured.speed.nominal_hz == pytest.approx(0.6)
    mean_hz = (turns[-1] - turns[0]) / (len(turns) - 1) * RATE
    assert measured.speed.estimated_hz == pytest.approx(mean_hz, rel=1e-5)


@pytest.mark.parametrize("slow", [True, False])
def test_a_tachometer_on_either_end_of_a_slow_input_gives_the_same_angle(slow):
    turns, clean = stepped_up(0.003, 4)
    ratio = 1.0 if slow else 83 / 19 * 79 / 18
    sensor = Sensor(column="tacho", kind="tacho", shaft=1 if slow else 3)
    recording = Recording(
        samples=np.vstack([clean + white(len(clean), 0.2, seed=4), squared(ratio * turns, 1)]),
        sampling_rate_hz=RATE,
        channel_names=("a1", "tacho"),
        channel_kinds=("vibration", "tacho"),
    )
    measured = measure_signature(recording, replace(STEPPED_UP, sensors=(sensor,)))
    assert measured.speed.method == "tacho"
    assert measured.track.indexed == slow
    assert [mesh.found for mesh in measured.meshes] == [True, True]
    error = measured.track.turns_at(np.arange(len(turns)) / RATE) - turns
    assert np.std(error) * STEPPED_UP.stages[1].pinion_teeth * 83 / 19 < 0.03


USELESS = {
    "constant": (np.full(len(TIME), 0.2), "0 pulses found between 0.2 and 0.2"),
    "noise": (white(len(TIME), 1.0, seed=3), "pulses missing and"),
    "too few": (np.where(np.abs(TIME % 8.0 - 4.0) < 0.1, 1.0, 0.0), "2 pulses found"),
    "another shaft": (squared(0.8 * TURNS, 1), "pulses a second are 0.79 a turn"),
    "an engine nearby": (squared(23.9 * TIME, 1), "the mesh lines stand out less at the 23.9 Hz"),
}


@pytest.mark.parametrize("content", USELESS)
def test_a_name_alone_makes_no_tachometer(content):
    row, why = USELESS[content]
    measured = measure_signature(with_column(row, told=False), MACHINE)
    told = [note for note in measured.notes if "though its name suggests one" in note]
    assert len(told) == 1
    assert why in told[0]
    assert measured.speed.method == "comb"
    assert measured.found
    assert measured.speed.estimated_hz == pytest.approx(SPEED, rel=1e-3)


@pytest.mark.parametrize("content", [name for name in USELESS if name != "an engine nearby"])
def test_a_tachometer_that_somebody_named_must_be_one(content):
    row, why = USELESS[content]
    with pytest.raises(RecordingError, match=why):
        measure_signature(with_column(row, told=True), MACHINE)


def test_both_meshes_of_a_simulated_machine_are_found(two_stage_recording):
    measured = measure_signature(as_recording(two_stage_recording), two_stages())
    assert [mesh.found for mesh in measured.meshes] == [True, True]


def test_speed_of_a_simulated_planetary_set_is_right(planetary_recording):
    measured = measure_signature(as_recording(planetary_recording), planetary())
    true = planetary_recording.truth["speed"]["mean_hz"]
    assert measured.meshes[0].found
    assert measured.speed.estimated_hz == pytest.approx(true, rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_simulated_pair_is_measured(seed):
    machine = Machine(
        name="one pair",
        operating=(OperatingPoint(speed_rpm=1500.0, torque_nm=98.0),),
        stages=(ParallelStage(pinion_teeth=23, gear_teeth=61, module_mm=2.0, face_width_mm=20.0),),
    )
    simulated = simulate(machine, (), 6.0, 5000.0, seed=seed, channels=1)
    measured = measure_signature(as_recording(simulated), machine)
    true = simulated.truth["speed"]["mean_hz"]
    assert measured.found
    assert measured.speed.estimated_hz == pytest.approx(true, rel=1e-3)


def test_pitch_errors_that_alternate_do_not_disown_a_mesh():
    # a pinion of 26 teeth whose order 13 is as clear as its mesh
    machine = load_machine(PAIR)
    made = simulate(machine, (), 5.0, 10_000.0, machine_seed=6, recording_seed=2, load=0.75)
    assert measure_signature(made, machine).found


@pytest.mark.parametrize("seed", [4, 7, 8, 11])
def test_no_mesh_is_heard_less_with_a_tachometer_than_without(seed):
    # about the one speed of the pulses few combs of other teeth are left to stand out of
    drawn = draw_machine(np.random.default_rng([5, seed]), seed, channels=1)
    taken = drawn.take(Condition(), Setting(seed=seed, duration_s=3.0)).recording
    alone = measure_signature(taken.vibration(), drawn.machine)
    with_pulses = measure_signature(taken, drawn.machine)
    assert alone.found
    assert with_pulses.track.uncertainty_turns < alone.track.uncertainty_turns
    assert [m.found for m in with_pulses.meshes] >= [m.found for m in alone.meshes]


def broadband(seconds=10.0, knocks=0, tone=0.0):
    """White noise of density 1e-4 (-40 dB) at 20 kHz, knocks of 20 dB above it for 40 ms each."""
    chance = np.random.default_rng(5)
    count = int(seconds * 20_000)
    values = chance.normal(size=(1, count))
    for start in chance.integers(0, count - 800, knocks):
        values[:, start : start + 800] += 10.0 * chance.normal(size=800)
    return values + tone * np.sin(2 * np.pi * 997.0 * np.arange(count) / 20_000)


@pytest.mark.parametrize("seconds", [1.0, 10.0, 60.0])
def test_levels_between_the_lines_are_the_density_of_noise(seconds):
    levels = broadband_levels(broadband(seconds), 20_000.0)[0]
    # bins of a band are averaged by their median: the lowest bands have one or two
    assert np.nanmedian(levels) == pytest.approx(-40.0, abs=0.3)
    assert levels[-10:] == pytest.approx(np.full(10, -40.0), abs=0.4 if seconds > 1.0 else 1.0)


def test_levels_between_the_lines_are_those_of_welchs_median():
    values = broadband(knocks=15)
    frequency, density = welch(values[0], 20_000.0, nperseg=2048, average="median")
    low, high = np.geomspace(2.0 / 2048, 0.475, 41)[-2:] * 20_000.0
    last = (frequency >= low) & (frequency < high)
    levels = broadband_levels(values, 20_000.0)[0]
    # SciPy takes off what the median of 194 segments is beyond that of many: 0.016 dB
    assert levels[-1] == pytest.approx(10 * np.log10(np.median(density[last])), abs=0.05)


def test_a_tone_leaves_the_levels_between_the_lines():
    with_tone, without = (broadband_levels(broadband(tone=a), 20_000.0) for a in (10.0, 0.0))
    assert np.nanmax(np.abs(with_tone - without)[:, 20:]) < 1.0


@pytest.mark.parametrize("per_second", [1, 2])
def test_knocks_leave_the_levels_between_the_lines(per_second):
    quiet = broadband_levels(broadband(), 20_000.0)
    knocked = broadband_levels(broadband(knocks=10 * per_second), 20_000.0)
    # where a share s of the blocks is knocked the median is the quantile 1 / (2 - 2 s) of the noise
    # at most, whose power is exponential; a knock of 40 ms reaches into 142 ms of blocks of 102 ms
    share = 1.0 - (1.0 - 0.0142) ** (10 * per_second)
    most = 10 * np.log10(-np.log(1.0 - 0.5 / (1.0 - share)) / np.log(2.0))
    assert 0.2 * most < np.nanmedian(knocked - quiet) < most < 2.1  # of their mean: 7 and 10 dB


@cache
def of_the_catalogue(name, share):
    """A machine, and a recording of it at this share of its first nominal speed."""
    machine = load_machine(SIGNATURES / f"{name}.toml")
    nominal = machine.operating[0]
    point = replace(nominal, speed_rpm=share * nominal.speed_rpm)
    return machine, simulate(machine, (), 10.0, 10_000.0, seed=8, point=point, channels=2)


@pytest.mark.parametrize("share", [0.8, 0.95, 1.08, 1.2])
@pytest.mark.parametrize(
    ("name", "run"), [("combine_gearbox", 1.2), ("planetary_final_drive", 0.8)]
)
def test_speed_and_angle_are_found_far_from_nominal_without_a_tachometer(name, run, share):
    """One recording, beside machine files whose nominal speeds it is ever so far from."""
    machine, recording = of_the_catalogue(name, run)
    points = (replace(p, speed_rpm=p.speed_rpm * run / share) for p in machine.operating)
    measured = measure_signature(recording, replace(machine, operating=tuple(points)))
    assert measured.found
    truth = recording.truth["speed"]
    assert measured.speed.estimated_hz == pytest.approx(truth["mean_hz"], rel=3e-4)
    # one turn of shaft 1 after the other, but for where they are counted from
    turns = measured.track.turns_at(np.array(truth["turn_times_s"]))
    error = turns - np.arange(len(turns))
    mesh = max(one.order for one in kinematics(machine).meshes)
    assert np.quantile(np.abs(error - np.median(error)), 0.9) * mesh < 0.1


@pytest.mark.parametrize("speeds", [(1500.0,), (1500.0, 600.0)])
@pytest.mark.parametrize(("rate", "shown"), [(26.0, False), (47.0, False), (50.0, True)])
def test_a_rate_below_two_samples_a_turn_of_the_fastest_point_is_refused(speeds, rate, shown):
    """Of 25 Hz, 3 % slower at most."""
    noise = white((1, round(60 * rate)), 1.0, seed=1)
    given = Recording(samples=noise, sampling_rate_hz=rate, origin="slow.csv")
    known = one_pair(23, 46, *speeds)
    try:
        measure_signature(given, known)
        told = ""
    except RecordingError as error:
        told = str(error)
    assert ("show nothing of a shaft at 25 Hz" in told) == (not shown)


@pytest.mark.parametrize("speeds", [(1500.0,), (1500.0, 60.0), (60.0, 1500.0)])
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_two_turns_of_the_slowest_shaft_at_the_slowest_point_are_needed(speeds, share):
    """The wheel turns at half the speed; what is slow is asked whether it is told in Hz."""
    slowest_hz = 0.5 * min(speeds) / 60
    noise = white((1, round(share * 2 / slowest_hz * 2000)), 1.0, seed=1)
    given = Recording(samples=noise, sampling_rate_hz=2000.0, origin="short.csv")
    if share < 1:
        with pytest.raises(RecordingError, match="two turns need") as told:
            measure_signature(given, one_pair(23, 46, *speeds))
        asked = "speed_rpm is 60 turns a minute: did you mean 3600 (60 Hz)?"
        assert (asked in str(told.value)) == (min(speeds) == 60)
    else:
        measure_signature(given, one_pair(23, 46, *speeds))


@pytest.mark.parametrize("speeds", [(1500.0,), (300.0, 1500.0), (1500.0, 300.0)])
def test_phases_hold_an_angle_over_25_periods_of_the_fastest_mesh_and_pulses_over_any(speeds):
    """Unless the recorder stood still; a run of shorter gaps is no longer one."""
    known = one_pair(23, 61, *speeds)
    periods = RATE / (23 * 25.0)
    samples = white((2, 8000), seed=1)
    samples[1] = np.arange(8000) % 160 < 50
    for length, held in ((24, True), (26, False), (3 * 26, False)):
        gap = (2000, 2000 + round(length * periods))
        given = Recording(
            samples=samples,
            sampling_rate_hz=RATE,
            channel_kinds=("vibration", "tacho"),
            left_out=((100, 130), gap, (5000, 5030)),
        )
        assert _held(given, known, tacho=False) == held
        assert _held(given, known, tacho=True)
        still = samples.copy()
        still[1, slice(*gap)] = still[1, gap[0]]
        assert _held(replace(given, samples=still), known, tacho=True) == held
