"""What users of such tools stumble over, one after the other: each has a behaviour, and a test.

Where a behaviour has tests of its own elsewhere, the one here shows the stumble itself.
"""

from __future__ import annotations

import sys
import tracemalloc

import numpy as np
import pytest
from reference import small_gearbox
from reference.synthetic_signals import lines_on, track_of, wandering_turns, white

from gearmon.errors import ArgumentError, RecordingError
from gearmon.gears.faults import parse_fault
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.signals.angle import AngleTrack
from gearmon.signals.indicators import describe_waveform
from gearmon.signals.orders import (
    AngleGrid,
    angular_waveform,
    resample_to_angle,
    time_synchronous_average,
)
from gearmon.signals.recording import open_recording, read_recording
from gearmon.signals.spectra import amplitude_spectrum, band_envelope, line_amplitude
from gearmon.signals.tracking import find_pulses, track_from_pulses
from gearmon.signatures.measured.indicators import indicator_table
from gearmon.signatures.measured.measurement import measure_signature

RATE = 4000.0
TIME = np.arange(40_000) / RATE


def shaft(time_s=TIME):
    """20 Hz with one per cent of wander."""
    return 0.25 + wandering_turns(time_s, 20.0, 0.01, seed=4)


def pulse_times():
    """Instants at which the shaft completes its turns, to a nanosecond."""
    fine = np.linspace(0.0, TIME[-1], 2_000_001)
    angle = shaft(fine)
    return np.interp(np.arange(1, int(angle[-1]) + 1), angle, fine)


def tacho_waveform(times, width_s=0.004):
    """A tacho channel that is at 5 V for a while after each pulse, its edges one sample long."""
    after = TIME - times[np.searchsorted(times, TIME, side="right") - 1]
    before = times[np.minimum(np.searchsorted(times, TIME), len(times) - 1)] - TIME
    high = np.where((after >= 0) & (after < width_s), 5.0, 0.0)
    near = (before >= 0) & (before < 1 / RATE)
    return np.where(near, 5.0 * (1 - before * RATE), high)


def csv(tmp_path, stamps, name="time_s"):
    path = tmp_path / "recording.csv"
    rows = [f"{stamp},{np.sin(0.3 * k):.5f}\n" for k, stamp in enumerate(stamps)]
    path.write_text(f"{name},a1\n" + "".join(rows), encoding="utf-8")
    return path


def test_01_a_tacho_waveform_is_not_taken_for_pulse_times_nor_the_other_way_round():
    times = pulse_times()
    waveform = tacho_waveform(times)
    found = find_pulses(waveform, RATE)
    np.testing.assert_allclose(found.time_s[-100:], times[-100:], atol=0.7 / RATE)
    turns = np.arange(float(len(waveform)))
    with pytest.raises(ArgumentError, match=r"looks like a tacho waveform.*find_pulses"):
        AngleTrack(time_s=waveform, turns=turns, method="tacho", uncertainty_turns=0.0)
    with pytest.raises(RecordingError, match="pulses found"):
        find_pulses(times, RATE)


def test_02_repeated_time_stamps_are_told_with_their_line(tmp_path):
    stamps = [f"{k / 2000:.6f}" for k in range(3000)]
    stamps[100] = stamps[99]
    with pytest.raises(RecordingError, match=r"line 102, .*is repeated.*--sampling-rate"):
        read_recording(csv(tmp_path, stamps))
    # and pulses that come twice do not stop the angle: one is left out
    times = np.sort([*pulse_times(), pulse_times()[50] + 1e-4])
    assert find_pulses(tacho_waveform(times), RATE).missing == 0


def test_03_the_angular_waveform_itself_is_to_be_had():
    track = track_of(shaft, TIME[-1], 400)
    samples = lines_on(shaft(), [3.0, 23.0], [1.0, 0.5], 0.2)
    found = angular_waveform(samples, RATE, track, 100)
    assert found.values.shape == (1, 100 * found.turns)
    truth = lines_on(found.angle_turns, [3.0, 23.0], [1.0, 0.5], 0.2)[0]
    np.testing.assert_allclose(found.values[0, 100:-100], truth[100:-100], atol=1e-3)


def test_04_speed_wander_does_not_blur_the_average_as_it_blurs_blocks_of_time():
    samples = lines_on(shaft(), [23.0], [1.0])
    found = time_synchronous_average(samples, RATE, track_of(shaft, TIME[-1], 400))
    assert found.amplitude[0, 23] == pytest.approx(1.0, rel=1e-3)
    # 200 samples are a turn at the mean speed
    naive = samples[0, : len(TIME) // 200 * 200].reshape(-1, 200).mean(axis=0)
    assert np.ptp(naive) < 1.0


def test_05_missing_tacho_pulses_are_filled_in_counted_and_leave_the_angle_right():
    times = pulse_times()
    pulses = find_pulses(tacho_waveform(np.delete(times, [60, 120])), RATE)
    assert (pulses.missing, pulses.extra) == (2, 0)
    track = track_from_pulses(pulses, 1, 1.0, TIME[-1])
    inner = slice(int(times[0] * RATE) + 1, int(times[-1] * RATE))
    error = track.turns_at(TIME[inner]) - shaft()[inner]
    assert np.ptp(error) < 0.02


def test_06_without_a_tacho_the_speed_comes_from_the_vibration():
    simulated = small_gearbox.simulated(tacho=False)
    found = measure_signature(small_gearbox.recording(tacho=False), small_gearbox.machine())
    assert simulated.channel_kinds.count("tacho") == 0
    assert found.speed.method == "comb"
    assert found.speed.uncertainty_hz > 0
    with_tacho = measure_signature(small_gearbox.recording(), small_gearbox.machine())
    assert found.speed.estimated_hz == pytest.approx(with_tacho.speed.estimated_hz, rel=1e-4)


def test_07_every_indicator_says_of_which_signal_it_is_and_what_was_taken_out():
    table = indicator_table(small_gearbox.recording(), small_gearbox.machine())
    inputs = {row.indicator: row.input for row in table.rows if row.gear}
    assert inputs["FM4"] == "difference"
    assert inputs["NA4"] == "residual"
    assert inputs["FM0"] == "average"
    for row in table.rows:
        assert row.input
        assert row.removed
        if row.input in ("residual", "difference"):
            assert row.removed_orders


def test_08_one_weak_tooth_weakens_the_mesh_once_a_turn():
    stage = small_gearbox.machine().stages[0]
    weak = mesh_stiffness(stage, [parse_fault("crack:1:pinion:5:20%")])
    healthy = mesh_stiffness(stage)
    phase = np.arange(23 * 200) / 200
    ratio = weak.at(phase) / healthy.at(phase)
    weaker = phase[ratio < 1 - 1e-6]
    # one contact of one tooth among the 23 of a turn of the pinion
    assert 0 < np.ptp(weaker) < 2.5
    assert ratio.min() > 0.79
    np.testing.assert_allclose(weak.at(phase + 23), weak.at(phase), rtol=1e-9)


def test_09_irregular_time_stamps_are_refused_with_a_way_out(tmp_path):
    stamps = [k / 2000 for k in range(3000)]
    stamps[1500] += 2e-4
    path = csv(tmp_path, [f"{stamp:.6f}" for stamp in stamps])
    with pytest.raises(RecordingError, match=r"line 1502, .*--sampling-rate"):
        read_recording(path)


def test_10_the_sampling_interval_is_that_of_the_whole_span_not_of_two_rounded_stamps(tmp_path):
    rate = 4267.0
    path = csv(tmp_path, [f"{k / rate:.4f}" for k in range(3000)])
    # the first two stamps say 5000 Hz
    assert read_recording(path).sampling_rate_hz == pytest.approx(rate, rel=1e-5)


@pytest.mark.parametrize("name", ["hann", "flat-top", "blackman-harris", "rectangular"])
@pytest.mark.parametrize("frequency", [0.37, 100.0, 123.456, 777.77, 1999.1])
def test_11_a_sine_of_amplitude_three_reads_three(name, frequency):
    samples = 3.0 * np.sin(2 * np.pi * frequency * TIME + 0.4)
    found = line_amplitude(samples, RATE, [frequency], window_name=name)
    assert found.amplitude[0, 0] == pytest.approx(3.0, rel=1e-3)
    # peak and root mean square are said, not guessed
    rms = amplitude_spectrum(samples, RATE, window_name=name, quantity="rms")
    peak = amplitude_spectrum(samples, RATE, window_name=name)
    np.testing.assert_allclose(peak.values[0, 1:-1], np.sqrt(2) * rms.values[0, 1:-1], rtol=1e-12)
    assert (peak.quantity, rms.quantity) == ("amplitude", "rms")


def test_12_fewer_samples_a_turn_do_not_fold_what_they_cannot_hold():
    track = track_of(shaft, TIME[-1], 400)
    samples = lines_on(shaft(), [3.0, 40.0], [1.0, 1.0])
    found = angular_waveform(samples, RATE, track, 32)
    spectrum = np.abs(np.fft.rfft(found.values[0, 64:-64])) * 2 / (found.values.shape[1] - 128)
    order = np.fft.rfftfreq(found.values.shape[1] - 128, 1 / 32)
    assert spectrum[np.abs(order - 3) < 0.1].max() == pytest.approx(1.0, rel=0.01)
    assert spectrum[np.abs(order - 8) < 0.5].max() < 1e-3  # where order 40 would fold to
    naive = resample_to_angle(
        samples, RATE, track, AngleGrid(per_turn=32, first_turn=1.0, count=32 * 190)
    )
    assert np.abs(np.fft.rfft(naive[0]) * 2 / (32 * 190))[8 * 190] > 0.9


def test_13_indicators_of_a_long_recording_take_little_memory(tmp_path):
    path = tmp_path / "long.npy"
    np.save(path, white((1, 4_000_000), seed=1))
    tracemalloc.start()
    recording = open_recording(path, RATE)
    found = describe_waveform(recording.samples[0])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found["kurtosis"] == pytest.approx(3.0, abs=0.02)
    assert peak < 4_000_000 * 8 / 2


def test_14_files_of_other_systems_open_or_say_what_to_install(tmp_path, monkeypatch):
    from scipy.io import savemat

    samples = white(5000, seed=2)
    savemat(tmp_path / "a.mat", {"a1": samples})
    found = read_recording(tmp_path / "a.mat", RATE)
    np.testing.assert_array_equal(found.samples[0], samples)
    for head, module, extra in (
        (b"TDSm", "nptdms", "tdms"),
        (b"    -1\n    58\n", "pyuff", "uff"),
    ):
        monkeypatch.setitem(sys.modules, module, None)
        path = tmp_path / f"a.{extra}"
        path.write_bytes(head + bytes(600))
        with pytest.raises(RecordingError, match=rf"install gearmon\[{extra}\]"):
            read_recording(path, RATE)


def test_15_another_load_is_no_fault():
    # references at 0.7, 0.85 and 1.0 of the nominal torque
    told = small_gearbox.analysis(load=0.75 + 0.05, seed=32)
    assert told.verdict == "healthy"
    assert told.flags == ()


def test_16_modulations_of_amplitude_and_phase_are_told_apart_where_a_sideband_cancels():
    # equal depths in quadrature: one sideband vanishes, the other is twice as high
    turn = 2 * np.pi * 20.0 * TIME
    amplitude, phase = 0.1 * np.cos(turn), 0.1 * np.sin(turn)
    samples = (1 + amplitude) * np.cos(2 * np.pi * 460.0 * TIME + phase)
    lower, upper = line_amplitude(samples, RATE, [440.0, 480.0]).amplitude[0]
    assert min(lower, upper) < 0.03 * max(lower, upper)
    found = band_envelope(samples, RATE, 360.0, 560.0)
    time_s = np.arange(found.values.shape[-1]) / found.rate
    place = 2 * np.pi * 20.0 * time_s
    np.testing.assert_allclose(found.amplitude[0] - 1, 0.1 * np.cos(place), atol=2e-3)
    turned = np.unwrap(np.angle(found.values[0])) - 2 * np.pi * (460.0 - found.low) * time_s
    np.testing.assert_allclose(turned - turned.mean(), 0.1 * np.sin(place), atol=2e-3)
