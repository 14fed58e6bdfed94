"""The housing, noise and other things that sensors hear."""

from __future__ import annotations

import numpy as np
import pytest
from reference.simulated_machines import one_pair

from gearmon.gears.faults import parse_error
from gearmon.simulation.contact import Drive, ShaftMotion, random_wander
from gearmon.simulation.train import Settings, build_train
from gearmon.simulation.vibration import (
    MODE_BAND_HZ,
    ROTOR_SHARE,
    mesh_vibration,
    noise,
    random_path,
    shaft_lines,
    tacho_pulses,
    through_path,
    tones,
)


def test_force_at_rest_is_not_heard():
    path = random_path(1, 2, 2, 0.4)
    assert path.accelerance(np.zeros(1), 0, 1)[0] == 0


def test_path_rises_with_the_square_of_frequency_below_its_modes():
    path = random_path(1, 1, 1, 0.4)
    low = np.abs(path.accelerance(np.array([2.0, 4.0]), 0, 0))
    assert low[1] / low[0] == pytest.approx(4.0, rel=0.01)


def test_modes_lie_in_their_band_and_peak():
    path = random_path(3, 1, 1, 0.4)
    assert path.frequencies_hz.min() >= MODE_BAND_HZ[0]
    assert path.frequencies_hz.max() <= MODE_BAND_HZ[1]
    strongest = np.argmax(np.abs(path.sensor_shapes[0] * path.stage_shapes[0])[:6])
    own = path.frequencies_hz[strongest]
    at = np.abs(path.accelerance(own * np.array([0.8, 1.0]), 0, 0))
    assert at[1] > at[0]


def test_a_sensor_hears_a_force_as_loud_however_many_modes_there_are():
    """Shapes of sensors have a mean square of one over all modes together."""
    sizes = [float(np.sum(random_path(seed, 2, 1, 0.4).sensor_shapes ** 2)) for seed in range(60)]
    assert np.mean(sizes) / 2 == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("channel", "stage"), [(0, 0), (1, 2)])
def test_path_is_a_sum_of_modes_behind_a_bearing_that_passes_slow_forces_whole(channel, stage):
    """Number by number: w^2/(W^2 - w^2 + 2 i z W w) of every mode, over the mass."""
    path = random_path(4, 2, 3, 0.4)
    bearing = float(path.bearing_hz[stage])
    for hertz in (0.02 * bearing, 0.7 * bearing, bearing, 4.0 * bearing):
        total = 0j
        modes = zip(path.frequencies_hz, path.damping_ratios, strict=True)
        for number, (own, damping) in enumerate(modes):
            shapes = path.sensor_shapes[channel, number] * path.stage_shapes[stage, number]
            total -= shapes * hertz**2 / (own**2 - hertz**2 + 2j * damping * own * hertz)
        passed = 1 / (1 - (hertz / bearing) ** 2 + 0.2j * hertz / bearing)
        expected = passed * total / path.housing_mass_kg
        assert path.accelerance(np.array([hertz]), channel, stage)[0] == pytest.approx(expected)


def test_channels_that_are_added_do_not_change_the_others():
    few, many = random_path(5, 2, 1, 0.4), random_path(5, 4, 1, 0.4)
    assert np.array_equal(few.sensor_shapes, many.sensor_shapes[:2])
    assert np.array_equal(few.stage_shapes, many.stage_shapes)


def test_sine_force_is_heard_with_the_gain_of_the_path():
    path = random_path(2, 1, 2, 0.4)
    samples, rate, line = 1000, 10_000.0, 120
    spectra = np.zeros((2, samples // 2 + 1), dtype=complex)
    spectra[1, line] = samples / 2
    heard = through_path(path, spectra, samples, rate)[0]
    gain = path.accelerance(np.array([line * rate / samples]), 0, 1)[0]
    angle = 2 * np.pi * line * np.arange(samples) / samples
    assert heard == pytest.approx((gain * np.exp(1j * angle)).real, abs=1e-12)


def test_missing_profile_moves_the_mesh_and_is_heard_through_the_path():
    """Line by line: |sin| has the harmonics 4/(pi (4 k^2 - 1)), the mesh is mass on spring."""
    machine, settings = one_pair(), Settings(duration_s=0.08, channels=2, speed_drift=0.0)
    still = random_wander(0.0, np.random.default_rng(0))
    speed_hz = machine.operating[0].speed_rpm / 60
    drive = Drive(motion=ShaftMotion(mean_hz=speed_hz, wander=still), load=still, ripples=())

    def lines(*errors):
        """Amplitudes of the first mesh harmonics: 0.08 s are 50 periods of the mesh."""
        train = build_train(machine, [parse_error(own) for own in errors], accuracy_grade=None)
        heard, _ = mesh_vibration(train, drive, settings, None)
        return 2 * np.fft.rfft(heard, axis=1)[:, 50:250:50] / heard.shape[1], train

    perfect, train = lines()
    one, both = (
        lines(*own)[0] - perfect
        for own in (
            ["profile:1:gear:all:6um"],
            ["profile:1:pinion:all:4um", "profile:1:gear:all:6um"],
        )
    )
    path = random_path(settings.machine_seed, 2, 1, train.gear_mass_kg)
    k = np.arange(1, 5)
    w = 2 * np.pi * 625.0 * k
    stiff, mass = 8e8 + 4e3j * w, 0.28
    # m q'' + c (q' - e') + k (q - e) = 0, of which the force is m w^2 q
    force = mass * w**2 * stiff / (stiff - mass * w**2)
    missing = 4 / np.pi / (4 * k**2 - 1)
    for channel in range(2):
        gain = np.abs(path.accelerance(625.0 * k, channel, 0) * force * missing)
        np.testing.assert_allclose(np.abs(one[channel]), 6e-6 * gain, rtol=0.01)
        np.testing.assert_allclose(np.abs(both[channel]), 10e-6 * gain, rtol=0.01)


def test_noise_has_the_wanted_rms_half_of_it_coloured():
    row = noise(np.random.default_rng(0), 100_000, 3.0)
    assert row.std() == pytest.approx(3.0, rel=0.01)
    power = np.abs(np.fft.rfft(row)) ** 2
    assert power[: len(power) // 50].mean() > 10 * power[len(power) // 2 :].mean()


def test_coloured_noise_falls_as_a_low_pass_of_first_order():
    """White and coloured halves: 1/2 + c / (1 + (f / 0.02)^2), c by the same whole power."""
    row = noise(np.random.default_rng(1), 1_000_000, 1.0)
    share = np.fft.rfftfreq(len(row))
    power, shape = np.abs(np.fft.rfft(row)) ** 2 / len(row), 1 / (1 + (share / 0.02) ** 2)
    shape[0] = 0.0
    expected = 0.5 + 0.5 * shape / shape.mean()
    for low, high in ((0.0, 0.005), (0.015, 0.025), (0.06, 0.1), (0.3, 0.5)):
        band = (share > low) & (share <= high)
        assert power[band].mean() == pytest.approx(expected[band].mean(), rel=0.06)


def test_unbalance_of_every_shaft_pulls_with_its_own_speed():
    turns = np.arange(400) / 100.0
    rows = shaft_lines(1, [1.0, 3.0], turns, np.full(400, 20.0), 1500)
    sizes = np.sqrt(np.mean(np.abs(np.fft.rfft(rows)) ** 2, axis=0))
    assert sizes[12] / sizes[4] == pytest.approx(3.0, rel=0.1)


def test_shaft_lines_turn_with_their_shafts():
    turns = np.arange(4000) / 100.0
    lines = shaft_lines(1, [1.0, 0.25], turns, np.full(4000, 20.0), 2)
    spectrum = np.abs(np.fft.rfft(lines[0]))
    assert set(np.flatnonzero(spectrum > 1e-6 * spectrum.max())) == {10, 20, 40, 80}


def test_tones_stand_at_their_orders():
    turns = np.arange(4000) / 100.0
    row = tones(1, [3.5], turns, np.array([2.0]), 2)[0]
    spectrum = np.abs(np.fft.rfft(row)) / 2000
    assert spectrum[140] == pytest.approx(2.0)
    assert spectrum[280] == pytest.approx(1.0)


def test_tacho_crosses_half_its_height_at_every_whole_turn():
    rate, speed = 1000.0, np.full(3000, 17.3)
    times = np.arange(3000) / rate
    turns = 0.37 + 17.3 * times
    pulses = tacho_pulses(turns, rate, speed, 5.0, 0.05)
    assert pulses.min() == 0
    assert pulses.max() == 5.0
    up = np.flatnonzero((pulses[:-1] < 2.5) & (pulses[1:] >= 2.5))
    crossing = times[up] + (2.5 - pulses[up]) / (pulses[up + 1] - pulses[up]) / rate
    found = 0.37 + 17.3 * crossing
    assert found == pytest.approx(np.round(found), abs=1e-9)
    assert len(found) == 52
    assert np.mean(pulses) / 5 == pytest.approx(0.05, rel=0.02)


def test_an_unbalance_of_grade_6_3_pulls_with_its_speed():
    turns = np.arange(400) / 100.0
    rows = shaft_lines(1, [1.0], turns, np.full(400, 20.0), 4000)
    # m e w^2 of a rotor of a tenth of the housing, e w = 6.3 mm/s; both phases drawn with size 1
    amplitude = np.abs(np.fft.rfft(rows)[:, 4]) / 200
    force = ROTOR_SHARE * 6.3e-3 * 2 * np.pi * 20.0
    assert np.sqrt(np.mean(amplitude**2)) == pytest.approx(np.sqrt(2) * force, rel=0.05)


def test_unbalance_lies_at_any_angle():
    """Both quadratures of a shaft line are drawn, alike and each by itself."""
    turns = np.arange(400) / 100.0
    lines = np.fft.rfft(shaft_lines(1, [1.0], turns, np.full(400, 20.0), 2000))[:, 4]
    assert np.std(lines.real) == pytest.approx(np.std(lines.imag), rel=0.1)
    assert abs(np.corrcoef(lines.real, lines.imag)[0, 1]) < 0.1


def test_forces_of_several_stages_are_heard_together():
    """What the sensors hear of all is the sum of what they hear of each."""
    path = random_path(3, 2, 3, 5.0)
    rng = np.random.default_rng(0)
    spectra = rng.normal(size=(3, 501)) + 1j * rng.normal(size=(3, 501))
    together = through_path(path, spectra, 1000, 5000.0)
    alone = sum(
        through_path(path, spectra * (np.arange(3) == own)[:, None], 1000, 5000.0)
        for own in range(3)
    )
    np.testing.assert_allclose(together, alone, atol=1e-9 * np.abs(alone).max())
    assert all(
        through_path(path, spectra * (np.arange(3) == own)[:, None], 1000, 5000.0).std() > 0
        for own in range(3)
    )
