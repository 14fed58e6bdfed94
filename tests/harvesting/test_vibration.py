"""Mean squares of lines and of samples: Parseval, energy, wander."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.dynamics import HillProblem, steady_state
from gearmon.errors import ArgumentError
from gearmon.harvesting.harvester import InertialHarvester
from gearmon.harvesting.response import answer
from gearmon.harvesting.vibration import (
    Vibration,
    line_numbers,
    operating_lines,
    vibration_of_lines,
    vibration_of_samples,
)


def test_energy_is_half_the_squared_velocity_amplitude():
    v = vibration_of_lines([100.0, 50.0, 0.0], displacement_m=[1e-6, 2e-6, 5e-6])
    np.testing.assert_allclose(v.frequency_hz, [50.0, 100.0])
    expected = 0.5 * (2 * np.pi * np.array([50.0, 100.0]) * np.array([2e-6, 1e-6])) ** 2
    np.testing.assert_allclose(v.energy_j_per_kg, expected, rtol=1e-12)


def test_acceleration_and_displacement_say_the_same():
    f = np.array([30.0, 70.0])
    a = vibration_of_lines(f, acceleration_ms2=[1.0, 2.0])
    d = vibration_of_lines(f, displacement_m=[1.0, 2.0] / (2 * np.pi * f) ** 2)
    np.testing.assert_allclose(a.mean_square_m2s4, d.mean_square_m2s4, rtol=1e-12)


@pytest.mark.parametrize("count", [1000, 1001, 997])
def test_mean_square_of_noise_is_kept(count):
    rng = np.random.default_rng(count)
    samples = rng.normal(size=(200, count))
    total = [vibration_of_samples(row, 1000.0).mean_square_m2s4.sum() for row in samples]
    assert np.mean(total) == pytest.approx(1.0, rel=0.02)


def test_a_tone_keeps_its_mean_square_wherever_it_lies():
    t = np.arange(4000) / 1000.0
    for frequency in (100.0, 100.1, 333.33):
        v = vibration_of_samples(3.0 * np.cos(2 * np.pi * frequency * t), 1000.0)
        assert v.mean_square_m2s4.sum() == pytest.approx(4.5, rel=2e-3)


def test_wander_averages_the_resonance():
    # the mean of a Lorentzian over a Gaussian by a very fine sum
    h = InertialHarvester(mass_kg=1e-3, natural_frequency_hz=200.0)
    wandering = vibration_of_lines([200.0], acceleration_ms2=[1.0], wander=0.02)
    shift = np.linspace(-6, 6, 200_001) * 0.02
    weight = np.exp(-0.5 * (shift / 0.02) ** 2)
    fine = float((h.gains(200.0 * (1 + shift)).power_w * weight).sum() / weight.sum())
    assert answer(h, wandering).power_w == pytest.approx(fine, rel=2e-4)


def test_little_wander_is_no_wander():
    h = InertialHarvester(mass_kg=1e-3, natural_frequency_hz=200.0)
    still = vibration_of_lines([199.0], acceleration_ms2=[1.0])
    moving = vibration_of_lines([199.0], acceleration_ms2=[1.0], wander=1e-6)
    assert answer(h, moving).power_w == pytest.approx(answer(h, still).power_w, rel=1e-6)


def test_samples_and_lines_give_the_same_power():
    h = InertialHarvester(mass_kg=1e-3, natural_frequency_hz=150.0)
    t = np.arange(40_000) / 2000.0
    tone = 2.0 * np.cos(2 * np.pi * 151.0 * t) + 0.5 * np.cos(2 * np.pi * 420.3 * t)
    lines = vibration_of_lines([151.0, 420.3], acceleration_ms2=[2.0, 0.5])
    measured = answer(h, vibration_of_samples(tone, 2000.0)).power_w
    assert measured == pytest.approx(answer(h, lines).power_w, rel=5e-3)


def test_reference_pair_has_the_operating_lines_of_the_source():
    # m 0.28 kg, c 9e3 N s/m, k 8e8 N/m, T 1.6 ms, eps 0.13, square wave with odd harmonics to 41
    odd = np.arange(1, 42, 2)
    harmonics = np.zeros(41)
    harmonics[odd - 1] = 0.13 * (2 / np.pi) * (-1.0) ** ((odd - 1) // 2) / odd
    z = steady_state(HillProblem(0.28, 9e3, 8e8, harmonics, 1.6e-3, 4e3), 1e-9).displacement
    v = vibration_of_lines(np.arange(len(z)) / 1.6e-3, displacement_m=2 * np.abs(z))
    found = {
        round(row["frequency_hz"]): 1e6 * row["energy_j_per_kg"] for row in operating_lines(v, 14)
    }
    printed = [5.5, 5.9, 6.9, 8.6, 11.3, 14.4, 14.6, 10.8]
    assert list(found)[:3] == [8125, 6875, 5625]
    for number, energy in enumerate(printed):
        assert found[625 * (2 * number + 1)] == pytest.approx(energy, abs=0.06)
    assert operating_lines(v)[0]["relative"] == 1.0


def test_only_what_stands_out_of_noise_is_a_line():
    rng = np.random.default_rng(5)
    noise = rng.normal(size=20_000)
    assert not line_numbers(vibration_of_samples(noise, 1000.0)).any()
    t = np.arange(20_000) / 1000.0
    heard = vibration_of_samples(noise + 0.3 * np.cos(2 * np.pi * 123.4 * t), 1000.0)
    (row,) = operating_lines(heard)
    assert row["frequency_hz"] == pytest.approx(123.4, abs=0.05)
    assert row["acceleration_ms2"] == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize("spread", [0.0, 0.01])
def test_wander_of_a_line_is_that_of_its_tone(spread):
    """A steady tone is spread by the tapers alone, which is taken off again."""
    rng, rate, block = np.random.default_rng(6), 1000.0, 1000
    frequency = 100.0 * (1 + spread * rng.normal(size=60))
    turns = np.cumsum(np.repeat(frequency, block)) / rate
    samples = np.cos(2 * np.pi * turns) + 0.01 * rng.normal(size=len(turns))
    row = operating_lines(vibration_of_samples(samples, rate))[0]
    assert row["frequency_hz"] == pytest.approx(100.0, rel=0.01)
    steady = 0.2 * vibration_of_samples(samples, rate).resolution_hz / 100.0
    assert row["wander"] == pytest.approx(np.std(frequency) / 100.0, rel=0.3, abs=steady)


@pytest.mark.parametrize(("widths", "within"), [(1.5, 0.1), (3.0, 0.03)])
def test_wander_hardly_wider_than_the_tapers_is_told(widths, within):
    """The spectrum of a tone that wanders slowly is the mean of those of steady ones."""
    rate, count, middle = 1000.0, 12_000, 100.0
    t, noise = np.arange(count) / rate, 0.01 * np.random.default_rng(0).normal(size=count)
    width = 2.5 * rate / count
    shift = np.linspace(-3.5, 3.5, 57)
    likely = np.exp(-0.5 * shift**2)
    heard = [
        vibration_of_samples(np.cos(2 * np.pi * (middle + own) * t) + noise, rate)
        for own in widths * width * shift
    ]
    power = np.average([own.mean_square_m2s4 for own in heard], axis=0, weights=likely)
    about = {"frequency_hz": heard[0].frequency_hz, "resolution_hz": heard[0].resolution_hz}
    (row, *_) = operating_lines(Vibration(mean_square_m2s4=power, **about))
    assert row["wander"] == pytest.approx(widths * width / middle, rel=within)


@pytest.mark.parametrize("frequency_hz", [50.0, 400.0])
def test_wander_that_is_soon_forgotten_leaves_a_narrow_line(frequency_hz):
    """Kubo: a Lorentzian of the half-width (2 pi f w)^2 times the memory, half of it inside."""
    wander, narrowing = 0.01, 0.1
    memory_s = narrowing / (2 * np.pi * frequency_hz * wander)
    line = vibration_of_lines(
        [frequency_hz], acceleration_ms2=[1.0], wander=wander, wander_time_s=memory_s
    )
    shifted, share = line.nodes(2e-4)
    away = np.abs(shifted[:, 0] / frequency_hz - 1)
    half_width = narrowing * wander
    inside = float(share[away <= half_width, 0].sum())
    assert inside == pytest.approx(0.5, rel=0.07)
    assert float(share[away <= 3 * half_width, 0].sum()) == pytest.approx(0.8, rel=0.03)


@pytest.mark.parametrize("frequency_hz", [50.0, 400.0])
def test_wander_that_is_long_remembered_is_normal(frequency_hz):
    wander, memory_s = 0.01, 30.0 / (2 * np.pi * frequency_hz * 0.01)
    line = vibration_of_lines(
        [frequency_hz], acceleration_ms2=[1.0], wander=wander, wander_time_s=memory_s
    )
    shifted, share = line.nodes(2e-4)
    away = np.abs(shifted[:, 0] / frequency_hz - 1)
    for reach, known in ((1.0, 0.6827), (2.0, 0.9545)):
        inside = float(share[away <= reach * wander, 0].sum())
        assert inside == pytest.approx(known, abs=0.01)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"frequency_hz": [2.0, 1.0]}, "rising"),
        ({"mean_square_m2s4": [1.0]}, "one length"),
        ({"mean_square_m2s4": [0.0, 0.0]}, "no line"),
        ({"mean_square_m2s4": [-1.0, 1.0]}, "negative"),
        ({"mean_square_m2s4": [np.nan, 1.0]}, "finite"),
        ({"wander": 0.5}, "wander"),
    ],
)
def test_impossible_vibration_is_refused(changes, words):
    values = {"frequency_hz": [1.0, 2.0], "mean_square_m2s4": [1.0, 1.0]}
    with pytest.raises(ArgumentError, match=words):
        Vibration(**(values | changes))


def test_too_short_a_recording_is_refused_with_the_length_it_takes():
    h = InertialHarvester(mass_kg=1e-3, natural_frequency_hz=20.0, mechanical_damping_ratio=0.002)
    short = vibration_of_samples(np.random.default_rng(1).normal(size=500), 1000.0)
    with pytest.raises(ArgumentError, match="record at least"):
        answer(h, short)


def test_amplitudes_must_be_of_one_kind():
    with pytest.raises(ArgumentError, match="one of the two"):
        vibration_of_lines([1.0], acceleration_ms2=[1.0], displacement_m=[1.0])
    with pytest.raises(ArgumentError, match="amplitudes for"):
        vibration_of_lines([1.0, 2.0], acceleration_ms2=[1.0])
