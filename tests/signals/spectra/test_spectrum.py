"""Spectra: amplitudes and powers are calibrated, and every library gives the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.slow_orders import hann_values, slow_floor, smallest_smooth
from reference.synthetic_signals import white

from gearmon.errors import ArgumentError
from gearmon.signals.spectra import (
    amplitude_spectrum,
    fast_length,
    local_floor,
    power_density,
    quick_length,
    transform,
    window,
)

LENGTHS = [1024, 1000, 1001, 1009, 7, 2]


@pytest.mark.parametrize("length", [2, 3, 8, 101, 1024])
def test_hann_window_equals_its_definition(length):
    np.testing.assert_allclose(window("hann", length), hann_values(length), atol=1e-15)
    assert window("hann", length).mean() == pytest.approx(0.5, abs=1e-15)


@given(st.integers(1, 200_000))
def test_fast_length_is_the_smallest_even_smooth_one(length):
    assert fast_length(length) == smallest_smooth(length)


@pytest.mark.parametrize("length", [1000, 1001, 1009])
@pytest.mark.parametrize("line", [3, 100, 400])
def test_sine_on_a_line_reads_its_amplitude(length, line):
    time = np.arange(length) / 2000.0
    found = amplitude_spectrum(3.0 * np.sin(2 * np.pi * line * 2000.0 / length * time), 2000.0)
    assert found.values.shape == (1, length // 2 + 1)
    assert found.values[0, line] == pytest.approx(3.0, rel=1e-12)
    assert found.frequency_hz[line] == pytest.approx(line * 2000.0 / length)
    assert found.quantity == "amplitude"
    assert found.resolution_hz == pytest.approx(1.5 * 2000.0 / length)


@given(st.floats(5.0, 490.0), st.floats(0.0, 6.28))
def test_sine_between_lines_loses_at_most_the_scalloping_of_hann(line, phase):
    # half way between two lines a Hann window reads 8 / (3 pi) = 0.8488
    time = np.arange(1000)
    values = amplitude_spectrum(np.cos(2 * np.pi * line * time / 1000 + phase), 1.0).values
    assert 8 / (3 * np.pi) - 1e-3 <= values.max() <= 1 + 1e-3


def test_mean_and_nyquist_line_are_not_doubled():
    values = amplitude_spectrum(2.0 + 3.0 * (-1.0) ** np.arange(64), 64.0).values[0]
    assert values[0] == pytest.approx(2.0)
    assert values[-1] == pytest.approx(3.0)


@pytest.mark.parametrize("length", LENGTHS)
def test_density_of_one_block_keeps_the_windowed_power(length):
    samples = white((2, length), 3.0, seed=length) + 1.0
    found = power_density(samples, 500.0, length)
    weights = window("hann", length)
    power = np.sum((samples * weights) ** 2, axis=1) / np.sum(weights**2)
    total = found.values.sum(axis=1) * 500.0 / length
    np.testing.assert_allclose(total, power, rtol=1e-12)


@pytest.mark.parametrize("block", [256, 255, 251])
def test_density_of_white_noise_is_flat_and_right(block):
    level, rate, count = 2.0, 800.0, 200_000
    found = power_density(white((1, count), level, seed=1), rate, block)
    expected = 2 * level**2 / rate
    independent = 2 * count / block / (1 + 2 / 36)
    inner = found.values[0, 2:-2] / expected
    assert inner.mean() == pytest.approx(1, abs=4 / np.sqrt(independent * len(inner) / 1.5))
    assert inner.std() == pytest.approx(1 / np.sqrt(independent), rel=0.3)
    assert found.quantity == "density"


def test_density_of_a_sine_holds_half_its_squared_amplitude():
    time = np.arange(100_000) / 1000.0
    found = power_density(3.0 * np.sin(2 * np.pi * 123.4 * time), 1000.0, 1000)
    assert found.values.sum() * 1.0 == pytest.approx(4.5, rel=1e-3)


def test_padding_of_an_awkward_block_resolves_nothing_more():
    found = power_density(white((1, 20_000)), 1000.0, 16_411)
    assert len(found.frequency_hz) > 16_411 // 2 + 1
    assert found.resolution_hz == pytest.approx(1.5 * 1000.0 / 16_411)


@given(
    st.floats(1e-6, 1e6),
    st.integers(0, 2**32 - 1),
    st.sampled_from([64, 81, 97]),
)
def test_amplitudes_scale_and_channels_stay_apart(factor, seed, length):
    samples = white((3, length), seed=seed)
    order = np.random.default_rng(seed).permutation(3)
    plain = amplitude_spectrum(samples, 10.0).values
    other = amplitude_spectrum(factor * samples[order], 10.0).values
    np.testing.assert_allclose(other, factor * plain[order], rtol=1e-9, atol=1e-12 * factor)
    density = power_density(samples, 10.0, 32).values
    other = power_density(factor * samples[order], 10.0, 32).values
    np.testing.assert_allclose(other, factor**2 * density[order], rtol=1e-9)


def test_amplitudes_do_not_depend_on_a_circular_shift_of_a_periodic_signal():
    samples = np.cos(2 * np.pi * 7 * np.arange(240) / 240)
    shifted = amplitude_spectrum(np.roll(samples, 31), 1.0).values
    np.testing.assert_allclose(shifted, amplitude_spectrum(samples, 1.0).values, atol=1e-12)


def direct_transform(block, length, bins):
    number = np.arange(len(block))
    return np.array([block @ np.exp(-2j * np.pi * k * number / length) for k in bins])


def test_transform_equals_the_direct_sum():
    blocks = white((2, 3000), seed=4)
    bins = [0, 1, 77, 2047, 2048]
    found = transform(blocks, 4096)[:, bins]
    expected = [direct_transform(block, 4096, bins) for block in blocks]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_transform_leaves_its_input_alone():
    blocks = white((2, 4096), seed=5)
    kept = blocks.copy()
    transform(blocks, 4096)
    np.testing.assert_array_equal(blocks, kept)


@given(st.integers(2, 60), st.integers(1, 80), st.integers(0, 1000))
def test_floor_equals_the_slow_version(bins, width, seed):
    power = white(bins, seed=seed) ** 2
    np.testing.assert_allclose(local_floor(power, width), slow_floor(power, width), rtol=1e-12)


def test_floor_of_noise_lies_at_its_median():
    power = np.random.default_rng(7).exponential(2.0, (3, 20_000))
    floor = local_floor(power, 128)
    assert floor.mean() == pytest.approx(2 * np.log(2), rel=0.03)
    assert floor.shape == power.shape


def test_lines_in_less_than_half_of_a_window_do_not_lift_the_floor():
    power = np.ones(1000)
    power[::3] = 1e9
    np.testing.assert_allclose(local_floor(power, 64), 1.0)


def test_floor_of_nothing_is_above_zero():
    assert np.all(local_floor(np.zeros(50), 8) > 0)


@pytest.mark.parametrize("block", [1, 0, 101])
def test_impossible_blocks_are_refused(block):
    with pytest.raises(ArgumentError, match=rf"block={block} samples must lie in \[2, 100\]"):
        power_density(white(100), 1.0, block)


@pytest.mark.parametrize("rate", [0.0, -5.0, np.nan])
def test_impossible_rates_are_refused(rate):
    with pytest.raises(ArgumentError, match="sampling_rate_hz"):
        amplitude_spectrum(white(100), rate)


def test_single_samples_are_refused():
    with pytest.raises(ArgumentError, match="at least 2 values"):
        amplitude_spectrum(np.ones((3, 1)), 1.0)


# a sum over lines equals a sum over samples: even, odd, prime, padded
PARSEVAL = [2, 3, 1000, 1001, 997, 16_384, 16_411, 50_021]


@pytest.mark.parametrize("length", PARSEVAL)
@pytest.mark.parametrize("name", ["rectangular", "hann", "flat-top", "blackman-harris"])
def test_energies_of_all_lines_add_up_to_the_mean_square(length, name):
    samples = white((2, length), 3.0, seed=length) + 1.0
    found = amplitude_spectrum(samples, 500.0, window_name=name, quantity="energy")
    weights = window(name, length)
    expected = np.sum((samples * weights) ** 2, axis=1) / np.sum(weights**2)
    np.testing.assert_allclose(found.values.sum(axis=1), expected, rtol=1e-12)
    if name == "rectangular":
        np.testing.assert_allclose(
            found.values.sum(axis=1), np.mean(samples**2, axis=1), rtol=1e-12
        )


@pytest.mark.parametrize("name", ["rectangular", "hann", "flat-top", "blackman-harris"])
@pytest.mark.parametrize("length", [1000, 1001, 997])
def test_every_window_reads_a_line_right(name, length):
    time = np.arange(length)
    samples = 1.5 + 3.0 * np.sin(2 * np.pi * 100 * time / length)
    peak = amplitude_spectrum(samples, 1.0, window_name=name).values[0]
    root = amplitude_spectrum(samples, 1.0, window_name=name, quantity="rms").values[0]
    assert peak[100] == pytest.approx(3.0, rel=1e-12)
    assert root[100] == pytest.approx(3.0 / np.sqrt(2), rel=1e-12)
    assert peak[0] == pytest.approx(1.5, rel=1e-12)
    assert root[0] == pytest.approx(1.5, rel=1e-12)


def test_flat_top_loses_next_to_nothing_between_lines():
    time = np.arange(1000)
    samples = np.cos(2 * np.pi * 100.5 * time / 1000)
    values = amplitude_spectrum(samples, 1.0, window_name="flat-top").values
    assert values.max() == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("name", ["hann", "flat-top", "blackman-harris", "rectangular"])
def test_density_of_noise_does_not_depend_on_the_window(name):
    values = power_density(white((1, 200_000), 2.0, seed=2), 800.0, 256, window_name=name).values
    assert values[0, 5:-5].mean() == pytest.approx(2 * 4.0 / 800.0, rel=0.02)


def test_long_awkward_lengths_are_padded_and_others_kept():
    assert quick_length(997) == 997
    assert quick_length(1 << 20) == 1 << 20
    assert quick_length(3 * 7**6) == 3 * 7**6
    assert quick_length(50_021) == 51_200
    samples = white(50_021)
    assert amplitude_spectrum(samples, 1.0).values.shape[-1] == quick_length(50_021) // 2 + 1
    whole = amplitude_spectrum(samples, 1.0, length=50_021)
    assert whole.values.shape[-1] == 50_021 // 2 + 1


@given(st.integers(1 << 14, 1 << 18) | st.sampled_from([2**14, 11**4 * 2, 3**9, 13 * 2**11]))
def test_lengths_without_a_large_prime_factor_are_kept(number):
    rest = number
    for prime in (2, 3, 5, 7, 11):
        while rest % prime == 0:
            rest //= prime
    assert (quick_length(number) == number) == (rest == 1)


def test_spectra_are_those_of_the_definition():
    samples = white((2, 3000), seed=9)
    expected = np.abs(np.fft.rfft(samples * window("hann", 3000))) * 2 / 1500
    expected[:, [0, -1]] *= 0.5
    np.testing.assert_allclose(amplitude_spectrum(samples, 1.0).values, expected, atol=1e-13)
    blocks = [samples[:, s : s + 500] * window("hann", 500) for s in range(0, 2501, 250)]
    power = np.mean([np.abs(np.fft.rfft(b)) ** 2 for b in blocks], axis=0) / np.sum(
        window("hann", 500) ** 2
    )
    power[:, 1:-1] *= 2
    np.testing.assert_allclose(power_density(samples, 1.0, 500).values, power, rtol=1e-10)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: amplitude_spectrum(white(64), 1.0, window_name="hamming"), "window='hamming'"),
        (lambda: amplitude_spectrum(white(64), 1.0, quantity="power"), "quantity='power'"),
        (lambda: amplitude_spectrum(white(64), 1.0, length=63), "length=63"),
        (lambda: amplitude_spectrum(np.full(64, np.inf), 1.0), "finite"),
        (lambda: power_density(np.full(64, np.nan), 1.0, 8), "finite"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_impossible_spectra_are_refused(call, words):
    with pytest.raises(ArgumentError, match=words):
        call()
