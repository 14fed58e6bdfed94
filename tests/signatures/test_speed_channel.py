"""The angle where a channel tells the speed: over duty cycles no comb can be followed by itself."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from reference.simulated_machines import two_stages
from reference.speed_cases import make_case
from scipy.signal import lfilter

from gearmon.gears.kinematics import kinematics
from gearmon.machine import Sensor
from gearmon.signals.recording import Recording, read_recording
from gearmon.signatures.speed_channels import _courses_told, _is_pulsed, track_recording
from gearmon.units import speed_factor

CYCLE = (0.45, 0.45, 1.0, 1.05, 0.6, 0.9, 0.9)


def with_speed(case, *, name="speed", unit="rpm", factor=60.0, lag_s=0.06, step=1.0, held_s=0.01):
    """The case with a channel of speed: it lags, rounds, and stands between its values."""
    recording, rate = case.recording, case.recording.sampling_rate_hz
    true = factor * np.gradient(case.turns) * rate
    share = np.exp(-1.0 / (lag_s * rate))
    told, _ = lfilter([1 - share], [1, -share], true, zi=[share * true[0]])
    held = round(held_s * rate)
    told = np.repeat(told[::held], held)[: len(told)]
    return replace(
        recording,
        samples=np.vstack([recording.samples, step * np.round(told / step)]),
        channel_names=(*recording.channel_names, name),
        channel_kinds=(*recording.channel_kinds, "speed"),
        units=(*recording.units, unit),
        columns=(),
    )


def error(case, found):
    """Departure from the true angle: mesh periods of the fastest mesh, 95 % of the time within."""
    time_s = np.arange(0, len(case.turns), 40) / case.recording.sampling_rate_hz
    away = found.track.turns_at(time_s) - case.turns[::40]
    order = max(float(mesh.order) for mesh in kinematics(case.machine).meshes)
    return float(np.quantile(np.abs(away - np.median(away)), 0.95) * order)


@cache
def over_the_cycle(seed):
    return make_case(seed, law=CYCLE, path_s=1e-4, duration_s=14.0, amount=0.0)


@pytest.fixture(params=[0, 1])
def cycle(request):
    """A machine over a duty cycle, through a path that hardly turns its lines."""
    return over_the_cycle(request.param)


def test_without_the_channel_a_duty_cycle_cannot_be_followed(cycle):
    assert error(cycle, track_recording(cycle.recording, cycle.machine)) > 10


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"lag_s": 0.12},
        {"held_s": 0.1, "step": 5.0},
        {"factor": 61.5},
        {"unit": "rad/s", "factor": 2 * np.pi, "step": 0.1},
        {"name": "engine", "unit": None, "factor": 1.0, "step": 0.02},
    ],
    ids=["usual", "late", "slow", "wrong scale", "rad/s", "no unit"],
)
def test_about_a_speed_that_is_told_the_lines_tell_the_angle(cycle, how):
    found = track_recording(with_speed(cycle, **how), cycle.machine)
    assert error(cycle, found) < 0.2
    assert "tells the speed about which the mesh lines were looked for" in found.notes[0]
    assert "shaft 1" in found.notes[0]
    assert all(seen.stands_out for seen in found.evidence)


@pytest.mark.parametrize("cycle", [0], indirect=True)
def test_a_channel_of_another_shaft_is_known_by_its_speed_or_by_the_machine_file(cycle):
    order = float(kinematics(cycle.machine).shafts[1].order)
    recording = with_speed(cycle, factor=60.0 * order, name="output", step=0.1)
    found = track_recording(recording, cycle.machine)
    assert "shaft 2" in found.notes[0]
    assert error(cycle, found) < 0.15
    sensor = Sensor(column="output", kind="speed", unit="rpm", shaft=2)
    again = track_recording(recording, replace(cycle.machine, sensors=(sensor,)))
    assert error(cycle, again) < 0.15


def test_lines_that_tell_the_angle_alone_need_no_channel_and_no_wrong_one_spoils_them():
    case = make_case(2, amount=0.005)
    alone = track_recording(case.recording, case.machine)
    for factor in (60.0, 61.0, 45.0, 30.0, 200.0):
        found = track_recording(with_speed(case, factor=factor), case.machine)
        assert np.array_equal(found.track.turns, alone.track.turns), factor
        assert found.notes == alone.notes


@pytest.mark.parametrize("cycle", [1], indirect=True)
def test_a_speed_told_ten_times_a_second_with_empty_rows_between_tells_the_angle(cycle):
    told = with_speed(cycle, held_s=0.1)
    rate = told.sampling_rate_hz
    frame = pd.DataFrame(told.samples.T, columns=told.channel_names)
    every = round(0.1 * rate)
    frame.loc[np.arange(len(frame)) % every != 0, "speed"] = np.nan
    recording = read_recording(frame.rename(columns={"speed": "speed_rpm"}), rate)
    assert any("taken to go straight" in note for note in recording.notes)
    found = track_recording(recording, cycle.machine)
    assert error(cycle, found) < 0.2
    assert found.notes[0].startswith("channel speed_rpm")


def test_speeds_below_a_fifth_of_nominal_do_no_harm():
    case = make_case(3, law=(0.0, 0.0, 1.0, 1.0, 1.0, 0.8), path_s=1e-4, amount=0.0)
    found = track_recording(with_speed(case), case.machine)
    inside = slice(round(0.5 * len(case.turns)), None)
    time_s = np.arange(len(case.turns))[inside] / case.recording.sampling_rate_hz
    away = found.track.turns_at(time_s) - case.turns[inside]
    order = max(float(mesh.order) for mesh in kinematics(case.machine).meshes)
    assert np.std(away) * order < 0.15


@pytest.mark.parametrize("cycle", [0], indirect=True)
def test_a_channel_called_speed_that_holds_pulses_is_a_tachometer(cycle):
    told = with_speed(cycle, name="speed", unit=None)
    pulses = 5.0 * (cycle.turns % 1.0 < 0.3)
    recording = replace(told, samples=np.vstack([cycle.recording.samples, pulses]))
    found = track_recording(recording, cycle.machine)
    assert found.track.method == "tacho"
    assert error(cycle, found) < 0.1


@pytest.mark.parametrize("cycle", [1], indirect=True)
def test_a_column_in_another_unit_is_left_alone(cycle):
    told = with_speed(cycle, name="ground speed", unit="km/h", factor=0.5, step=0.1)
    alone = track_recording(cycle.recording, cycle.machine)
    assert np.array_equal(track_recording(told, cycle.machine).track.turns, alone.track.turns)


def test_units_of_speed_and_columns_in_hz(tmp_path):
    assert speed_factor("1/min") == speed_factor("rpm") == pytest.approx(1 / 60)
    assert speed_factor("rad/s") == pytest.approx(1 / (2 * np.pi))
    assert speed_factor("Hz") == 1.0
    assert speed_factor("Nm") is None
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{k % 7 - 3},{24.5 + k % 2},{50.0 + k % 3}" for k in range(64))
    path.write_text(f"acc [m/s2],shaft speed [Hz],grid [Hz]\n{rows}\n")
    found = read_recording(path, 1000.0)
    assert found.channel_kinds == ("vibration", "speed", "other")


@pytest.mark.parametrize("cycle", [1], indirect=True)
def test_rough_pulses_are_pulses(cycle):
    told, generator = with_speed(cycle, name="speed", unit=None), np.random.default_rng(7)
    pulses = 5.0 * (cycle.turns % 1.0 < 0.3) + 0.1 * generator.standard_normal(len(cycle.turns))
    recording = replace(told, samples=np.vstack([cycle.recording.samples, pulses]))
    assert track_recording(recording, cycle.machine).track.method == "tacho"


def with_pulses(case, pulses):
    """The case with a tachometer that the machine file may tell of."""
    recording = case.recording
    return replace(
        recording,
        samples=np.vstack([recording.samples, 5.0 * pulses]),
        channel_names=(*recording.channel_names, "tacho"),
        channel_kinds=(*recording.channel_kinds, "tacho"),
        units=(*recording.units, "V"),
        columns=(),
    )


def test_a_tachometer_is_known_to_the_machine_file_by_name_or_number_and_turns_its_own_shaft():
    case = make_case(4, amount=0.003, duration_s=4.0)
    order = float(kinematics(case.machine).shafts[1].order)
    recording = with_pulses(case, order * case.turns % 1.0 < 0.3)
    true_hz = np.ptp(case.turns) / recording.duration_s
    for column in ("tacho", 2):
        sensor = Sensor(column=column, kind="tacho", shaft=2, pulses_per_turn=1)
        found = track_recording(recording, replace(case.machine, sensors=(sensor,)))
        assert found.track.method == "tacho"
        assert found.track.mean_hz == pytest.approx(true_hz, rel=1e-3)


def test_pulses_that_are_mended_are_told_as_they_are():
    case = make_case(4, amount=0.003, duration_s=8.0)
    turn, place = np.floor(case.turns) - np.floor(case.turns[0]), case.turns % 1.0
    gone, more = np.isin(turn, [30, 60]), (turn == 90) & (place > 0.6) & (place < 0.7)
    found = track_recording(with_pulses(case, (place < 0.3) & ~gone | more), case.machine)
    assert "tacho tacho: 2 pulses filled in, 1 left out" in found.notes


def test_one_pulse_a_turn_counts_turns_at_half_the_nominal_speed():
    case = make_case(5, amount=0.003, off=-0.5, duration_s=6.0)
    found = track_recording(with_pulses(case, case.turns % 1.0 < 0.3), case.machine)
    true_hz = np.ptp(case.turns) / case.recording.duration_s
    assert found.track.mean_hz == pytest.approx(true_hz, rel=1e-3)
    assert "tacho tacho: 1 pulse a turn" in found.notes


@pytest.mark.parametrize(("first", "cycle"), [(0, 1), (1, 0)], indirect=["cycle"])
def test_of_several_nominal_speeds_that_is_meant_near_which_the_machine_ran(cycle, first):
    point = cycle.machine.operating[0]
    point = replace(point, share=0.5)
    slow = replace(point, speed_rpm=0.25 * point.speed_rpm)
    points = (slow, point) if first else (point, slow)
    machine = replace(cycle.machine, operating=points)
    found = track_recording(with_speed(cycle), machine)
    true_hz = np.ptp(cycle.turns) / cycle.recording.duration_s
    assert found.track.mean_hz == pytest.approx(true_hz, rel=1e-3)
    assert found.speed().nominal_hz == pytest.approx(point.shaft1_hz)


@pytest.mark.parametrize("seed", [5, 6])
def test_half_the_nominal_speed_is_believed_where_lines_stand_between(seed):
    case = make_case(seed, amount=0.003, off=-0.5)
    found = track_recording(with_speed(case), case.machine)
    true_hz = (case.turns[-1] - case.turns[0]) / case.recording.duration_s
    assert found.track.mean_hz == pytest.approx(true_hz, rel=1e-3)
    assert error(case, found) < 0.1


def test_a_speed_that_is_held_is_that_of_the_middle_of_its_time():
    """Then a channel that stands still between its values tells a steady run-up as it is."""
    rate, held = 1000.0, 250
    time = np.arange(20_000) / rate
    true = 20.0 + 0.5 * time
    middles = 20.0 + 0.5 * (np.arange(0, len(time), held) + 0.5 * held) / rate
    told = Recording(
        samples=np.stack([np.zeros(len(time)), 60.0 * np.repeat(middles, held)]),
        sampling_rate_hz=rate,
        channel_names=("a1", "speed"),
        channel_kinds=("vibration", "speed"),
        units=("m/s2", "rpm"),
    )
    signal = SimpleNamespace(machine=two_stages(), nominal_hz=25.0, rate=rate, pace=1.0)
    courses = [own for name, own in _courses_told(told, signal) if "shaft 1" in name]
    (course,) = courses
    inner = slice(2, -2)
    expected = np.interp(course.time_s, time, true)
    np.testing.assert_allclose(course.speed_hz[inner], expected[inner], rtol=2e-3)
    assert abs(np.mean(course.speed_hz[inner] - expected[inner])) < 0.01


@pytest.mark.parametrize("value", [0.0, 25.0, -3.0])
def test_a_channel_that_stands_still_holds_no_pulses_and_one_of_two_levels_does(value):
    assert not _is_pulsed(np.full(1000, value))
    assert _is_pulsed(value + (np.arange(1000) % 10 < 2))


@pytest.mark.parametrize("volts", [1e-3, 0.5, 5.0, 24.0, 3000.0])
def test_pulses_and_speeds_are_told_apart_whatever_their_size_and_offset(volts):
    swinging = np.clip(2.0 * np.sin(0.05 * np.arange(4000) + 0.1), -1.0, 1.0)
    run_up = np.linspace(-1.0, 1.0, 4000)
    for offset in (0.0, -7.0 * volts):
        assert _is_pulsed(offset + volts * np.sign(swinging))
        assert not _is_pulsed(offset + volts * swinging)
        assert not _is_pulsed(offset + volts * run_up)
