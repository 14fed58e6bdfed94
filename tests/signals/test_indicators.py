"""Condition indicators: closed forms, invariance to scale, and sums written out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference import slow_indicators

from gearmon.signals.indicators import (
    crest_factor,
    describe_waveform,
    energy_ratio,
    fm0,
    kurtosis,
    normalised_moment,
    peak_to_peak,
    rms,
    sideband_energy_ratio,
    sideband_index,
    sideband_level_factor,
)

TURN = 2 * np.pi * np.arange(4096) / 4096
SINE = 3.0 * np.sin(5 * TURN + 0.3)
SQUARE = np.where(np.arange(4096) % 64 < 32, 2.0, -2.0)
NOISE = np.random.default_rng(1).standard_normal((2, 4096))


@pytest.mark.parametrize(("order", "expected"), [(4, 3.0), (6, 15.0), (8, 105.0)])
def test_moments_of_gaussian_noise(order, expected):
    # standard error of the mean of x^p of n Gaussian numbers, less for the fitted variance
    count = 4_000_000
    noise = np.random.default_rng(0).standard_normal(count)
    error = math.sqrt(math.prod(range(1, 2 * order, 2)) / count)
    assert float(normalised_moment(noise, order)) == pytest.approx(expected, abs=4 * error)


@pytest.mark.parametrize(("order", "expected"), [(4, 1.5), (6, 2.5), (8, 35 / 8)])
def test_moments_of_a_sine(order, expected):
    # mean of sin^p over that of sin^2 to the power p/2: 2^(p/2) (p-1)!!/p!!
    assert float(normalised_moment(SINE, order)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("order", [4, 6, 8])
def test_moments_of_a_square_wave_are_one(order):
    assert float(normalised_moment(SQUARE, order)) == pytest.approx(1.0, rel=1e-12)


def test_m8a_has_the_count_to_the_third_power():
    # one impulse among n samples tells N^3 from the N^2 of a common slip
    signal = np.zeros(1000)
    signal[17] = 5.0
    x = signal - signal.mean()
    written_out = len(x) ** 3 * np.sum(x**8) / np.sum(x**2) ** 4
    assert float(normalised_moment(signal, 8)) == pytest.approx(written_out, rel=1e-12)
    assert written_out == pytest.approx(1000**3, rel=0.01)


@pytest.mark.parametrize("order", [4, 6, 8])
def test_moments_of_a_repeated_signal_stay(order):
    once, thrice = NOISE, np.tile(NOISE, 3)
    np.testing.assert_allclose(
        normalised_moment(thrice, order), normalised_moment(once, order), rtol=1e-12
    )


def test_sine_and_square_in_closed_form():
    assert float(rms(SINE)) == pytest.approx(3 / math.sqrt(2), rel=1e-12)
    assert float(peak_to_peak(SINE)) == pytest.approx(6.0, rel=1e-5)
    assert float(crest_factor(SINE)) == pytest.approx(math.sqrt(2), rel=1e-5)
    assert float(crest_factor(SQUARE)) == pytest.approx(1.0, rel=1e-12)
    assert float(kurtosis(SINE)) == pytest.approx(1.5, rel=1e-12)


def test_fm0_of_one_mesh_line_is_two():
    assert float(fm0(SINE, np.array([3.0]))) == pytest.approx(2.0, rel=1e-5)


def test_fm0_rises_when_mesh_lines_fall_and_when_an_impact_comes():
    lines = np.array([3.0, 1.0])
    impact = SINE.copy()
    impact[100] += 20
    assert fm0(SINE, 0.5 * lines) > fm0(SINE, lines)
    assert fm0(impact, lines) > fm0(SINE, lines)


def test_ratios_in_closed_form():
    assert float(energy_ratio(0.1 * SINE, SINE)) == pytest.approx(0.1, rel=1e-12)
    sidebands = np.array([[1.0, 2.0, 3.0], [0.5, 0.5, 0.0]])
    np.testing.assert_allclose(
        sideband_energy_ratio(sidebands, np.array([12.0, 4.0])), [0.5, 0.25], rtol=1e-15
    )


INVARIANT = {
    "crest factor": lambda x: crest_factor(x),
    "FM4": lambda x: normalised_moment(x, 4),
    "M6A": lambda x: normalised_moment(x, 6),
    "M8A": lambda x: normalised_moment(x, 8),
    "FM0": lambda x: fm0(x, np.abs(np.fft.rfft(x))[..., 5:50:5]),
    "energy ratio": lambda x: energy_ratio(x, np.roll(x, 3, axis=-1)[..., ::2]),
    "SER": lambda x: sideband_energy_ratio(
        np.abs(np.fft.rfft(x))[..., 3:5], np.abs(np.fft.rfft(x))[..., 5]
    ),
}


@pytest.mark.parametrize("name", INVARIANT)
@pytest.mark.parametrize("factor", [1000.0, 1e-3, 1e60, 1e-60, -7.0])
def test_indicators_do_not_depend_on_scale(name, factor):
    indicator = INVARIANT[name]
    np.testing.assert_allclose(indicator(factor * NOISE), indicator(NOISE), rtol=1e-12)


@pytest.mark.parametrize("indicator", [rms, peak_to_peak])
def test_sizes_are_proportional_to_scale(indicator):
    np.testing.assert_allclose(indicator(1000 * NOISE), 1000 * indicator(NOISE), rtol=1e-12)


@pytest.mark.parametrize("name", ["crest factor", "FM4", "M6A", "M8A"])
def test_an_offset_does_not_matter(name):
    np.testing.assert_allclose(INVARIANT[name](NOISE + 10), INVARIANT[name](NOISE), rtol=1e-10)


@pytest.mark.parametrize("indicator", [crest_factor, kurtosis, rms, peak_to_peak])
def test_a_constant_gives_zero_and_no_warning(indicator):
    np.testing.assert_array_equal(indicator(np.full((2, 64), 4.0)), [0.0, 0.0])


def test_no_mesh_line_gives_zero_and_no_warning():
    assert float(fm0(SINE, np.zeros(3))) == 0.0
    assert float(fm0(SINE, np.zeros(0))) == 0.0
    assert float(energy_ratio(SINE, np.zeros(8))) == 0.0
    assert float(sideband_energy_ratio(np.ones(4), np.float64(0.0))) == 0.0


@given(st.permutations(range(4)), st.integers(0, 63))
def test_channels_and_start_do_not_matter(order, start):
    signal = np.random.default_rng(3).standard_normal((4, 64))
    turned = np.roll(signal[list(order)], start, axis=-1)
    for indicator in (kurtosis, crest_factor, rms, peak_to_peak):
        np.testing.assert_allclose(indicator(turned), indicator(signal)[list(order)], rtol=1e-12)


@given(st.integers(0, 1000), st.integers(8, 60))
def test_indicators_equal_the_sums_written_out(seed, count):
    rng = np.random.default_rng(seed)
    x, d, g = rng.normal(size=(3, count)) + rng.normal(size=(3, 1))
    lines = rng.uniform(0.1, 1.0, 6)
    pairs = [
        (fm0(x, lines), slow_indicators.fm0(x, lines)),
        (normalised_moment(d, 4), slow_indicators.fm4(d)),
        (normalised_moment(d, 6), slow_indicators.m6a(d)),
        (normalised_moment(d, 8), slow_indicators.m8a(d)),
        (energy_ratio(d, g), slow_indicators.energy_ratio(d, g)),
        (
            sideband_energy_ratio(lines, np.float64(0.7)),
            slow_indicators.sideband_energy_ratio(lines, 0.7),
        ),
        (sideband_index(lines[:2]), slow_indicators.sideband_index(lines[:2])),
        (
            sideband_level_factor(lines[:2], x),
            slow_indicators.sideband_level_factor(lines[:2], x),
        ),
        (crest_factor(x), slow_indicators.crest_factor(x)),
    ]
    for found, expected in pairs:
        assert float(found) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("count", [1, 7, 32_768, 100_003])
def test_description_in_pieces_equals_the_formulas(count):
    signal = np.random.default_rng(count).normal(size=count) + 5
    found = describe_waveform(signal)
    assert found["rms"] == pytest.approx(float(rms(signal)), rel=1e-9)
    assert found["peak to peak"] == float(peak_to_peak(signal))
    assert found["crest factor"] == pytest.approx(float(crest_factor(signal)), rel=1e-9)
    assert found["kurtosis"] == pytest.approx(float(kurtosis(signal)), rel=1e-9)


@pytest.mark.parametrize("factor", [1000.0, 1e-3])
def test_description_follows_scale(factor):
    one, other = describe_waveform(NOISE[0]), describe_waveform(factor * NOISE[0])
    assert other["rms"] == pytest.approx(factor * one["rms"], rel=1e-12)
    assert other["crest factor"] == pytest.approx(one["crest factor"], rel=1e-12)
    assert other["kurtosis"] == pytest.approx(one["kurtosis"], rel=1e-12)
    first = np.array([0.2, 0.3])
    assert sideband_level_factor(factor * first, factor * NOISE[0]) == pytest.approx(
        sideband_level_factor(first, NOISE[0]), rel=1e-12
    )
