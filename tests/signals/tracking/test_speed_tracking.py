"""The angle of shaft 1 without a tachometer, from recordings whose tooth patterns are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference.simulated_machines import two_stages
from reference.speed_cases import make_case, random_train, train_of
from reference.synthetic_signals import as_recording, lines_on, wandering_turns, white

from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signals.angle import AngleTrack
from gearmon.signals.recording import Recording
from gearmon.signals.tracking.mesh_detection import MeshEvidence
from gearmon.signatures.measured.measurement import measure_signature
from gearmon.signatures.speed_channels import track_recording
from gearmon.signatures.tracking import GearVibration
from gearmon.simulation import simulate


def tracked(case):
    return track_recording(case.recording, case.machine)


def true_track(case):
    """The known angle as a track."""
    time = np.arange(len(case.turns)) / case.recording.sampling_rate_hz
    knots = np.unique(np.append(np.arange(0, len(time), 80), len(time) - 1))
    return AngleTrack(
        time_s=time[knots], turns=case.turns[knots], method="tacho", uncertainty_turns=0.0
    )


def phase_error(case, track):
    """RMS departure from the true angle without its offset, in periods of the highest mesh."""
    time = np.arange(0, len(case.turns), 40) / case.recording.sampling_rate_hz
    error = track.turns_at(time) - case.turns[::40]
    order = max(float(mesh.order) for mesh in kinematics(case.machine).meshes)
    return float(np.std(error) * order)


def average(samples, rate, track, per_turn=1024):
    """Synchronous average of shaft 1, slowly: a spline of the signal read at each angle."""
    from scipy.interpolate import CubicSpline

    time = np.arange(samples.shape[-1]) / rate
    first, last = track.turns_at(time[[0, -1]])
    turns = np.arange(np.ceil(first), np.floor(last))
    angle = (turns[:, None] + np.arange(per_turn) / per_turn).ravel()
    read = CubicSpline(time, samples[0])(track.time_at(angle))
    return read.reshape(len(turns), per_turn).mean(axis=0)


def pattern_correlation(case, track):
    """Correlation of the recovered tooth pattern with the true one, at the best angle."""
    rate = case.recording.sampling_rate_hz
    vibration = case.recording.vibration().samples
    found = average(vibration, rate, track)
    true = average(case.clean, rate, true_track(case))
    a, b = np.fft.rfft(found - found.mean()), np.fft.rfft(true - true.mean())
    both = 16 * np.fft.irfft(a * np.conj(b), 16 * len(found))  # at sixteenths of a sample
    return float(both.max() / (found.std() * true.std()) / len(found))


@pytest.mark.parametrize("seed", range(2))
def test_one_per_cent_of_wander_is_followed(seed):
    case = make_case(seed, amount=0.01, memory_s=(0.6, 0.3)[seed % 2])
    found = tracked(case)
    assert phase_error(case, found.track) < 0.02
    assert pattern_correlation(case, found.track) > 0.99
    assert all(seen.score > 3 for seen in found.evidence)


@pytest.mark.parametrize("seed", [0, 1])
def test_one_stage_that_wanders_among_tones_of_others_is_followed(seed):
    case = make_case(seed, amount=0.01, stages=1, tones=3)
    track = tracked(case).track
    assert phase_error(case, track) < 0.02
    assert pattern_correlation(case, track) > 0.99


@pytest.mark.parametrize(("seed", "share"), [(1, -0.2), (3, 0.2)])
def test_ramps_of_a_fifth_in_ten_seconds_are_followed(seed, share):
    # a path so short that its delay does not change with the frequency of the lines
    case = make_case(seed, law="ramp", amount=share, path_s=1e-4)
    found = tracked(case)
    assert pattern_correlation(case, found.track) > 0.97
    assert phase_error(case, found.track) < 0.05
    assert any("followed over the recording" in note for note in found.notes)


@pytest.mark.parametrize(("seed", "off"), [(1, -0.12), (2, 0.15)])
def test_a_wrong_nominal_speed_is_found_out_and_told(seed, off):
    case = make_case(seed, amount=0.002, off=off)
    found = tracked(case)
    assert phase_error(case, found.track) < 0.02
    assert any("nominal is 25 Hz" in note for note in found.notes)


@pytest.mark.parametrize("seed", range(3))
def test_a_louder_comb_of_lines_that_do_not_keep_their_phases_is_not_followed(seed):
    rng, time = np.random.default_rng([31, seed]), np.arange(80_000) / 8000.0
    turns = wandering_turns(time, 25.0, 0.002, seed)
    orders = [23 * k + r for k in range(1, 7) for r in (-1, 0, 1)]
    samples = lines_on(turns, orders, [0.3 if order % 23 == 0 else 0.1 for order in orders])
    samples += white((1, len(time)), 0.5, seed=seed)
    for order in orders:
        restless = np.cumsum(rng.normal(size=len(time))) * 0.03
        samples += 0.5 * np.cos(2 * np.pi * order * 1.021 * turns + restless)
    stage = ParallelStage(pinion_teeth=23, gear_teeth=61, module_mm=2.0, face_width_mm=20.0)
    point = OperatingPoint(speed_rpm=1500.0, torque_nm=50.0)
    machine = Machine(name="pair", operating=(point,), stages=(stage,))
    found = track_recording(Recording(samples=samples, sampling_rate_hz=8000.0), machine)
    mean_hz = (turns[-1] - turns[0]) / time[-1]
    assert found.track.mean_hz == pytest.approx(mean_hz, rel=1e-4)
    assert found.coherent > 0.8


def test_a_ramp_is_measured_to_the_end():
    case = make_case(4, law="ramp", amount=0.2, path_s=1e-4)
    measured = measure_signature(case.recording, case.machine)
    assert measured.found
    assert measured.speed.lowest_hz == pytest.approx(22.5, rel=0.01)
    assert measured.speed.highest_hz == pytest.approx(27.5, rel=0.01)
    assert measured.speed.estimated_hz == pytest.approx(25.0, rel=1e-4)


def with_tacho(case, per_turn, spacing):
    """The case with a tacho channel on shaft 1, its pulses spaced as told."""
    rate = case.recording.sampling_rate_hz
    speed = np.gradient(case.turns, 1 / rate)
    wave = np.zeros(len(case.turns))
    for share in spacing:
        past = (case.turns - share + 0.5) % 1.0 - 0.5
        rise = np.clip(0.5 + past * rate / (2 * speed), 0, 1)
        fall = np.clip(0.5 + (past - 0.05 / per_turn) * rate / (2 * speed), 0, 1)
        wave += np.where(np.abs(past) < 0.4, rise - fall, 0.0)
    recording = case.recording
    return replace(
        case,
        recording=Recording(
            samples=np.vstack([recording.samples, wave]),
            sampling_rate_hz=rate,
            channel_names=(*recording.channel_names, "tach"),
            channel_kinds=(*recording.channel_kinds, "tacho"),
            units=(*recording.units, "V"),
            origin="case",
        ),
    )


@pytest.mark.parametrize("spacing", [(0.0,), (0.0, 0.45)])
@pytest.mark.parametrize("law", ["wander", "ramp"])
def test_with_a_tacho_the_pattern_is_the_true_one(law, spacing):
    amount = 0.01 if law == "wander" else 0.2
    case = make_case(2, law=law, amount=amount, path_s=(0.002 if law == "wander" else 1e-4))
    case = with_tacho(case, len(spacing), spacing)
    found = tracked(case)
    assert found.track.method == "tacho"
    assert pattern_correlation(case, found.track) > 0.999
    assert any(seen.stands_out for seen in found.evidence)


@pytest.mark.parametrize("seed", [3])
def test_simulated_wander_of_one_per_cent_is_followed(seed):
    simulated = simulate(
        two_stages(), (), 8.0, 8000.0, seed=seed, channels=2, speed_drift=0.01, snr_db=20.0
    )
    recording = as_recording(simulated).select(["a1", "a2"])
    track = track_recording(recording, two_stages()).track
    times = np.array(simulated.truth["speed"]["turn_times_s"])
    error = track.turns_at(times) - np.arange(len(times))
    assert error.std() * 26 < 0.02


def silent(samples, machine, seed=0):
    case = make_case(seed, duration_s=0.5, machine=machine)
    recording = replace(case.recording, samples=samples)
    return measure_signature(recording, machine)


@pytest.mark.parametrize("seed", [0])
def test_no_mesh_is_found_in_noise(seed):
    machine = random_train(np.random.default_rng(seed))
    assert not silent(white((1, 60_000), seed=seed), machine).found


@pytest.mark.parametrize("seed", [0])
def test_no_mesh_is_found_on_a_shaft_without_gears_that_speeds_up(seed):
    generator = np.random.default_rng(seed)
    time = np.arange(60_000) / 8000.0
    turns = 22.5 * time + 0.5 * 5.0 / 7.5 * time**2
    samples = white((1, len(time)), 0.3, seed=seed)
    for k in range(1, 12):
        level, phase = generator.uniform(0.1, 1) / k, generator.uniform(0, 6.28)
        samples += level * np.cos(2 * np.pi * k * turns + phase)
    assert not silent(samples, random_train(generator)).found


@pytest.mark.parametrize("more", [1, -2])
def test_a_machine_of_other_tooth_counts_is_not_taken_for_this_one(more):
    case = make_case(0, machine=train_of((30, 71)), amount=0.001)
    wrong = train_of((30 + more, 71 + more))
    assert not measure_signature(case.recording, wrong).found


def test_one_slow_mesh_of_many_harmonics_does_not_outweigh_a_mesh_that_is_clear_in_all_of_its():
    """Lines of the fast mesh are multiples of the slow one's at another speed, 12 % off."""
    machine = train_of((27, 77), (23, 50))
    samples = white((1, 8000), seed=1)
    first = GearVibration(samples=samples, rate=4000.0, machine=machine, nominal_hz=25.0).first
    few = {"decoys": 56, "decoys_above": 0}

    def told(*evidence):
        each = tuple(MeshEvidence(score=s, clear=c, visible=v, **few) for s, c, v in evidence)
        return replace(first, evidence=each, coherent=1.0)

    right, wrong = told((10.6, 8, 8), (1.7, 4, 20)), told((-1.4, 0, 8), (3.8, 13, 20))
    assert right.shown == pytest.approx((1 + 4 / 20) / 2)
    assert right.shown > wrong.shown
    assert told((-1.4, 0, 8), (0.5, 2, 20)).shown == 0
