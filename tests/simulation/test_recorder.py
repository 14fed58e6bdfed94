"""Simulated recordings: what is in them must be what their truth says."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from reference.simulated_machines import one_pair, planetary, two_stages
from scipy.interpolate import CubicSpline

from gearmon.errors import ArgumentError
from gearmon.gears.faults import parse_fault
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, OperatingPoint
from gearmon.simulation import Settings, record, simulate

#: Nothing but the meshes: no wander, no errors of manufacture, no noise.
PURE = {
    "slip": 0.0,
    "speed_drift": 0.0,
    "load_drift": 0.0,
    "torque_ripple": 0.0,
    "snr_db": None,
    "accuracy_grade": None,
    "unbalance": 0.0,
}
QUIET = PURE | {"channels": 1}
CRACK = parse_fault("crack:1:pinion:9:20%")


def spectrum(recording, channel=0):
    """Amplitudes of lines, with a window whose side lobes fall fast."""
    row = recording.samples[channel]
    window = np.hanning(len(row)) ** 2
    amplitude = 2 * np.abs(np.fft.rfft(row * window)) / window.sum()
    return np.arange(len(amplitude)) * recording.sampling_rate_hz / len(row), amplitude


def synchronous_average(recording, channel, points=1024):
    """Mean over the turns of shaft 1, whose times the truth gives."""
    times = np.array(recording.truth["speed"]["turn_times_s"])
    angle = np.arange((len(times) - 1) * points) / points
    at = np.interp(angle, np.arange(len(times)), times) * recording.sampling_rate_hz
    row = np.interp(at, np.arange(recording.samples.shape[1]), recording.samples[channel])
    return row.reshape(-1, points).mean(axis=0)


def test_ideal_pair_shows_mesh_harmonics_only():
    recording = simulate(one_pair(), (), 1.0, 20_000.0, channels=1, **PURE)
    frequency, amplitude = spectrum(recording)
    distance = np.abs(frequency - 625.0 * np.round(frequency / 625.0))
    assert amplitude[distance > 10].max() < 3e-5 * amplitude.max()
    lines = amplitude[[625 * n for n in range(1, 12)]]
    assert np.all(lines > 1e-3 * amplitude.max())


def test_one_soft_tooth_makes_sidebands_of_its_shaft():
    fault = parse_fault("crack:1:pinion:4:20%")
    recording = simulate(one_pair(), [fault], 1.0, 20_000.0, channels=1, **PURE)
    frequency, amplitude = spectrum(recording)
    shaft = 625.0 / 13
    distance = np.abs(frequency - shaft * np.round(frequency / shaft))
    assert amplitude[distance > 10].max() < 3e-5 * amplitude.max()
    sidebands = [amplitude[round(625 + n * shaft)] for n in (-2, -1, 1, 2)]
    assert min(sidebands) > 1e-4 * amplitude.max()


def test_errors_of_manufacture_make_sidebands_of_a_healthy_pair():
    pure = {**PURE, "accuracy_grade": 6.0}
    recording = simulate(one_pair(), (), 1.0, 20_000.0, channels=1, **pure)
    _, amplitude = spectrum(recording)
    for shaft in (625.0 / 13, 625.0 / 17):
        assert amplitude[round(625 + shaft)] > 1e-4 * amplitude.max()


@cache
def two_seconds(seed, *faults):
    common = {"machine_seed": 3, "channels": 2, "speed_drift": 0.001}
    return simulate(two_stages(), faults, 2.0, 10_000.0, recording_seed=seed, **common)


@pytest.mark.parametrize("tooth", [4, 17])
def test_difference_of_averages_points_at_the_tooth(tooth):
    fault = parse_fault(f"crack:1:pinion:{tooth}:25%")
    healthy, faulty = two_seconds(1), two_seconds(2, fault)
    energy = np.zeros(1024)
    for channel in range(2):
        change = synchronous_average(faulty, channel) - synchronous_average(healthy, channel)
        spectrum = np.fft.rfft(change)
        # mesh harmonics follow the speed and the load, which differ
        spectrum[::26] = 0
        energy += np.fft.irfft(spectrum) ** 2
    # the window of two teeth with the most energy; tooth j is in contact from (j - 1) / z on
    window = np.cumsum(np.concatenate([energy, energy]))
    width = round(2 / 26 * 1024)
    first = np.argmax(window[width : width + 1024] - window[:1024]) / 1024 * 26
    assert -0.5 < first - (tooth - 1) < 2.5


def test_same_seed_same_recording():
    one, other = (simulate(one_pair(), (), 0.5, 5_000.0, seed=4) for _ in range(2))
    assert np.array_equal(one.samples, other.samples)
    assert one.truth == other.truth


def test_recordings_of_one_machine_share_its_errors_and_nothing_else():
    one, two = (
        simulate(one_pair(), (), 0.5, 5_000.0, machine_seed=4, recording_seed=s) for s in (1, 2)
    )
    assert one.truth["meshes"][0]["errors"] == two.truth["meshes"][0]["errors"]
    assert one.truth["speed"]["mean_hz"] != two.truth["speed"]["mean_hz"]
    assert not np.allclose(one.samples, two.samples)


def test_longer_recording_begins_like_the_shorter():
    short, long = (
        simulate(one_pair(), (), s, 5_000.0, channels=1, snr_db=None) for s in (0.5, 1.0)
    )
    kept = short.samples.shape[1] - 10
    difference = short.samples[0, :kept] - long.samples[0, :kept]
    assert np.abs(difference).max() < 0.01 * short.samples.std()


def test_blocks_of_a_long_record_join_without_a_trace(monkeypatch):
    monkeypatch.setattr("gearmon.simulation.vibration.STEPS_PER_FAST_PERIOD", 40)
    whole = simulate(one_pair(), (), 0.12, 5_000.0, snr_db=None, channels=1)
    monkeypatch.setattr("gearmon.simulation.vibration.STEPS_PER_BLOCK", 20_000)
    blocks = simulate(one_pair(), (), 0.12, 5_000.0, snr_db=None, channels=1)
    assert np.abs(blocks.samples - whole.samples).max() < 1e-3 * whole.samples.std()


def test_speed_of_the_truth_is_that_of_the_tacho():
    recording = simulate(two_stages(), (), 2.0, 5_000.0, tacho_shaft=1, channels=1, seed=2)
    pulses, rate = recording.samples[-1], recording.sampling_rate_hz
    up = np.flatnonzero((pulses[:-1] < 2.5) & (pulses[1:] >= 2.5))
    times = (up + (2.5 - pulses[up]) / (pulses[up + 1] - pulses[up])) / rate
    speed = recording.truth["speed"]
    assert times == pytest.approx(speed["turn_times_s"], abs=1e-6)
    inside = (len(times) - 1) / (times[-1] - times[0])
    assert inside == pytest.approx(speed["mean_hz"], rel=1e-3)
    assert speed["min_hz"] <= inside <= speed["max_hz"]
    assert recording.channel_kinds == ("vibration", "tacho")


def test_tacho_may_stand_on_another_shaft():
    recording = simulate(two_stages(), (), 2.0, 5_000.0, tacho_shaft=3, channels=1)
    pulses = recording.samples[-1]
    turns = np.count_nonzero((pulses[:-1] < 2.5) & (pulses[1:] >= 2.5))
    assert turns == pytest.approx(2 * recording.truth["shafts"][2]["mean_hz"], abs=1)


def test_signal_to_noise_ratio_is_met():
    clean = simulate(one_pair(), (), 1.0, 5_000.0, snr_db=None)
    noisy = simulate(one_pair(), (), 1.0, 5_000.0, snr_db=12.0)
    power = (clean.samples**2).mean(axis=1) / ((noisy.samples - clean.samples) ** 2).mean(axis=1)
    assert 10 * np.log10(power) == pytest.approx(12.0, abs=0.3)


def test_sampling_rate_does_not_change_what_is_below_it():
    high = simulate(one_pair(), (), 1.0, 20_000.0, channels=1, **PURE)
    low = simulate(one_pair(), (), 1.0, 5_000.0, channels=1, **PURE)
    one, other = spectrum(high)[1], spectrum(low)[1]
    lines = [625, 1250, 1875]
    assert other[lines] == pytest.approx(one[lines], rel=2e-3)


def test_planetary_set_shows_the_sidebands_of_its_carrier():
    machine = planetary()
    recording = simulate(machine, (), 1.0, 8_000.0, channels=1, **PURE)
    frequency, amplitude = spectrum(recording)
    carrier = 30.0 / 6
    # only multiples of the planet pass frequency are heard: 500 Hz is 100 turns of the carrier
    others = np.abs(frequency / (3 * carrier) - np.round(frequency / (3 * carrier))) > 0.25
    heard = np.flatnonzero(amplitude > 0.1 * amplitude.max())
    assert not others[heard].any()
    near = amplitude[[495, 510]]
    assert near.max() > 3 * amplitude[500]


def test_light_load_that_rattles_is_survived():
    recording = simulate(one_pair(), (), 0.5, 5_000.0, load=0.02, channels=1)
    assert np.isfinite(recording.samples).all()


def amplitude_at(row, frequency_hz, rate):
    """Of one line that may lie between the bins."""
    window = np.hanning(len(row))
    turned = np.exp(-2j * np.pi * frequency_hz * np.arange(len(row)) / rate)
    return 2 * abs((window * row) @ turned) / window.sum()


def test_bearing_tones_and_mains_are_added_on_request():
    """Half of the rms on the fundamentals, which slip by 1 %, and a tenth at twice the mains."""
    rate, machine = 5_000.0, two_stages()
    plain, tones, mains = (
        simulate(machine, (), 1.0, rate, channels=1, **PURE, **more).samples[0]
        for more in ({}, {"bearing_tones": 0.5}, {"mains_hz": 50.0})
    )
    rms = np.sqrt(np.mean(plain**2))
    lines = [line.order for line in kinematics(machine).lines if line.kind == "bearing"]
    assert min(abs(own - 4.5 * (1 - 7.94 / 39.04)) for own in lines) < 1e-9
    for order in lines:
        for harmonic in (1, 2, 3):
            told = amplitude_at(tones - plain, 0.99 * 25.0 * order * harmonic, rate)
            assert told == pytest.approx(0.5 * rms / harmonic, rel=0.15)
    assert amplitude_at(mains - plain, 100.0, rate) == pytest.approx(0.1 * rms, rel=1e-3)
    assert np.sqrt(2) * np.std(mains - plain) == pytest.approx(0.1 * rms, rel=1e-3)


def test_a_rate_is_refused_below_2_56_times_the_mesh():
    machine, point = one_pair(), one_pair().operating[0]
    Settings(sampling_rate_hz=1602.0, slip=0.0).check_against(machine, point)
    with pytest.raises(ArgumentError, match=r"1598 Hz is too low .* at 625 Hz; .* 160[01] Hz"):
        Settings(sampling_rate_hz=1598.0, slip=0.0).check_against(machine, point)


def test_truth_is_ready_for_json_and_says_what_was_asked():
    faults = [CRACK, parse_fault("spall:2:gear:7:0.1")]
    recording = simulate(two_stages(), faults, 1.0, 5_000.0, seed=7)
    truth = json.loads(json.dumps(recording.to_dict()))
    assert truth["condition"] == "fault"
    assert [f["stiffness_loss"] for f in truth["faults"]] == [0.2, 0.1]
    assert truth["faults"][0]["tooth"] == 9
    assert [m["frequency_hz"] for m in truth["mesh"]] == pytest.approx(
        [26 * truth["speed"]["mean_hz"], 26 * 23 / 53 * truth["speed"]["mean_hz"]]
    )
    assert truth["speed"]["nominal_hz"] == 25.0
    assert truth["samples"] == recording.samples.shape[1] == 5000
    assert truth["integration"]["joint_mismatch"] < 1e-3
    assert "torsion" in truth["model"]


def test_natural_frequencies_of_the_truth_are_those_of_the_mesh_as_it_says():
    truth = simulate(one_pair(), (), 0.5, 10_000.0, channels=1).truth
    (mesh,) = truth["meshes"]
    angular = math.sqrt(mesh["mean_stiffness_n_per_m"] / mesh["equivalent_mass_kg"])
    assert truth["natural_frequencies_hz"] == pytest.approx([angular / (2 * math.pi)])


def test_sizes_are_those_of_a_gearbox():
    recording = simulate(two_stages(), (), 0.5, 10_000.0, seed=1)
    assert np.all(recording.samples.std(axis=1) > 0.1)
    assert np.all(recording.samples.std(axis=1) < 500)


def test_progress_is_told():
    shares = []
    simulate(one_pair(), (), 0.5, 5_000.0, progress=shares.append)
    assert shares == sorted(shares)
    assert 0 <= shares[0] <= shares[-1] <= 1


def test_settings_can_be_given_as_one_value():
    settings = Settings(duration_s=0.5, sampling_rate_hz=5_000.0, channels=2)
    one = record(one_pair(), (), settings)
    two = simulate(one_pair(), (), 0.5, 5_000.0, channels=2)
    assert np.array_equal(one.samples, two.samples)


def test_another_operating_point_may_be_taken():
    point = OperatingPoint(speed_rpm=600.0, torque_nm=50.0)
    recording = simulate(two_stages(), (), 1.0, 5_000.0, point=point, channels=1, slip=0.0)
    assert recording.truth["speed"]["nominal_hz"] == 10.0
    assert recording.truth["load"]["nominal_torque_nm"] == 50.0


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"duration_s": 0.2}, r"duration_s=0.2 s is less than one turn of shaft 3, 0.2184 s"),
        ({"sampling_rate_hz": 1000.0}, r"sampling_rate_hz=1000 Hz is too low .* stage 1 at 643"),
        ({"sampling_rate_hz": -1.0}, r"sampling_rate_hz = -1.0 must lie in \(0, inf\) Hz"),
        ({"duration_s": math.inf}, r"duration_s = inf must lie in \(0, inf\) s"),
        ({"channels": 0}, r"channels = 0 must lie in \[1, 64\]"),
        ({"load": 0.0}, r"load = 0.0 must lie in \(0, 10\]"),
        ({"slip": 0.5}, r"slip = 0.5 must lie in \[-0.2, 0.2\]"),
        ({"speed_drift": 0.2}, r"speed_drift = 0.2 must lie in \[0, 0.1\]"),
        ({"snr_db": math.nan}, "snr_db=nan dB must be a finite number"),
        ({"accuracy_grade": 0.0}, r"accuracy_grade=0.0 must lie in \[1, 11\]"),
        ({"seed": -1}, "^machine_seed = -1 must lie in"),
        ({"recording_seed": 1.5}, "^recording_seed = 1.5 must be a whole number"),
        ({"machine_seed": True}, "^machine_seed = true must be a whole number"),
        ({"duration_s": 1e6}, "duration_s=1e.06 s makes more than 100000000 samples"),
        ({"tacho_shaft": 4}, r"tacho_shaft=4 must lie in \[1, 3\]"),
        ({"mains_hz": 3000.0}, "mains_hz=3000 Hz: its double must lie below"),
        ({"mains_hz": 1010.0}, "mains_hz=1010 Hz: its double must lie below 0.4 of"),
        ({"noise_db": 20.0}, "^setting 'noise_db' is not one of .*, snr_db,"),
    ],
)
def test_bad_input_is_refused_in_one_line(changes, match):
    arguments = {"duration_s": 1.0, "sampling_rate_hz": 5_000.0, **changes}
    with pytest.raises(ArgumentError, match=match) as caught:
        simulate(two_stages(), (), **arguments)
    assert "\n" not in str(caught.value)


def test_machine_without_torque_is_refused():
    machine = Machine(operating=(OperatingPoint(speed_rpm=1500.0),), stages=two_stages().stages)
    with pytest.raises(ArgumentError, match="torque_nm"):
        simulate(machine, (), 1.0, 5_000.0)


def test_an_eccentric_gear_makes_sidebands_of_its_own_shaft():
    recording = simulate(one_pair(), "eccentricity:1:gear:all:20um", 1.0, 20_000.0, **QUIET)
    _, amplitude = spectrum(recording)
    driving, driven = (amplitude[round(625 + 625.0 / teeth)] for teeth in (13, 17))
    assert driven > 2e-4 * amplitude.max() > 20 * driving


def test_errors_come_to_those_of_manufacture():
    errors = ["eccentricity:1:gear:all:20um", "pitch:1:pinion:5:8um", "cumulative:1:gear:all:15um"]
    made, known = (
        simulate(one_pair(), faults, 0.3, 5_000.0, channels=1).truth for faults in ((), errors)
    )
    (pinion, gear), (own, other) = (own["meshes"][0]["errors"] for own in (made, known))
    added = np.array(own["pitch_m"]) - pinion["pitch_m"]
    np.testing.assert_allclose(added, 8e-6 * (np.arange(13) == 4), atol=1e-11)
    wave = 15e-6 * np.cos(2 * np.pi * np.arange(17) / 17)
    np.testing.assert_allclose(np.subtract(other["pitch_m"], gear["pitch_m"]), wave, atol=1e-11)
    one, two = (
        e["eccentricity_m"] * np.exp(1j * e["eccentricity_phase_rad"]) for e in (gear, other)
    )
    assert two - one == pytest.approx(20e-6, abs=1e-11)
    assert known["condition"] == "fault"
    assert [own["fault"] for own in known["faults"]] == errors
    assert all(own["stiffness_loss"] is None for own in known["faults"])


def test_the_load_that_is_told_wanders_about_the_share_asked_for():
    steady, moving, half = (
        simulate(one_pair(), (), 0.5, 5_000.0, **QUIET | {"load": load, "load_drift": drift})
        for load, drift in ((0.5, 0.0), (1.0, 0.05), (0.5, 0.05))
    )
    names = ("min_share", "mean_share", "max_share")
    shares = [[own.truth["load"][name] for name in names] for own in (steady, moving, half)]
    assert shares[0] == pytest.approx([0.5] * 3)
    assert shares[1][0] < shares[1][1] < shares[1][2]
    assert shares[2] == pytest.approx([0.5 * own for own in shares[1]])


def test_load_and_speed_wander_each_by_itself():
    """Over many recordings of half a wander each, the mean of one tells nothing of the other."""
    wander = PURE | {"channels": 1, "speed_drift": 0.02, "load_drift": 0.02}
    told = [simulate(one_pair(), (), 0.05, 4_000.0, seed=n, **wander).truth for n in range(16)]
    speeds = [own["speed"]["mean_hz"] for own in told]
    loads = [own["load"]["mean_share"] for own in told]
    assert np.std(speeds) > 0
    assert np.std(loads) > 0
    assert abs(np.corrcoef(speeds, loads)[0, 1]) < 0.7


def test_worn_profiles_move_the_mesh_in_proportion():
    sound, worn, twice = (
        simulate(one_pair(), faults, 1.0, 20_000.0, **QUIET)
        for faults in ((), ["profile:1:gear:all:5um"], ["profile:1:gear:all:10um"])
    )
    added = worn.samples - sound.samples
    np.testing.assert_allclose(twice.samples - sound.samples, 2 * added, atol=1e-6 * added.max())
    frequency, amplitude = spectrum(replace(worn, samples=added))
    distance = np.abs(frequency - 625.0 * np.round(frequency / 625.0))
    assert amplitude[distance > 10].max() < 1e-4 * amplitude.max()


@pytest.mark.parametrize(
    ("error", "told"),
    [
        ("misalignment:1:gear:all:20um", "are simulated"),
        ("profile:1:gear:3:20um", "are simulated"),
        ("pitch:1:pinion:14:8um", "13 teeth"),
        ("pitch:2:pinion:1:8um", "no such gear"),
        ("eccentricity:1:sun:all:8um", "no such gear"),
    ],
)
def test_errors_that_cannot_be_simulated_are_refused(error, told):
    with pytest.raises(ArgumentError, match=told):
        simulate(one_pair(), error, 0.3, 5_000.0)


def test_truth_of_a_mesh_is_that_of_the_sound_pair_whatever_single_teeth_lose():
    faults = ["spall:1:pinion:2:40%", "crack:1:gear:3:30%"]
    sound, hurt = (
        simulate(one_pair(), own, 0.1, 5_000.0, **QUIET).truth["meshes"][0] for own in ((), faults)
    )
    assert hurt == sound
    assert sound["mean_stiffness_n_per_m"] == pytest.approx(8e8)


def test_mean_speed_is_the_turns_over_the_time():
    """By the instants of whole turns, joined by a spline to both ends of the record."""
    for seed in range(3):
        told = simulate(
            one_pair(), (), 1.0, 4_000.0, seed=seed, **QUIET | {"speed_drift": 0.05}
        ).truth["speed"]
        times = np.array(told["turn_times_s"])
        turns = CubicSpline(times, np.arange(len(times)))
        assert told["mean_hz"] == pytest.approx(turns(1.0) - turns(0.0), rel=3e-5)
        assert told["min_hz"] < told["mean_hz"] < told["max_hz"]


@pytest.mark.parametrize("shaft", [1, 2, 3])
def test_flanks_of_the_tacho_last_two_samples_on_every_shaft(shaft):
    wander = PURE | {"channels": 1, "tacho_shaft": shaft}
    recording = simulate(two_stages(), (), 1.0, 5_000.0, **wander)
    volts = recording.samples[-1]
    rising = np.diff(volts) > 0
    begun = np.flatnonzero(rising[1:] & ~rising[:-1])
    climbed = rising.sum() / len(begun)
    assert climbed == pytest.approx(2.5, abs=0.6)


@pytest.mark.parametrize(
    ("name", "low", "high"), [("snr_db", -60, 200), ("accuracy_grade", 1, 11), ("slip", -0.2, 0.2)]
)
def test_settings_are_taken_up_to_their_ends_and_no_further(name, low, high):
    for end, beyond in ((low, low - 0.01), (high, high + 0.01)):
        assert getattr(Settings(**{name: end}), name) == end
        with pytest.raises(ArgumentError, match=name):
            Settings(**{name: beyond})
