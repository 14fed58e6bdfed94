"""Spectral kurtosis and kurtogram: Gaussian limit, tones, impacts, an obvious version."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.signals.spectra import kurtogram

RATE = 20_000.0


def impacts(count, centre=5200.0, every=400, height=6.0, seed=0):
    rng = np.random.default_rng(seed)
    comb = np.zeros(count)
    comb[::every] = 1.0
    t = np.arange(200)
    ring = np.exp(-t / 15) * np.sin(2 * np.pi * centre / RATE * t)
    return rng.normal(size=count) + height * np.convolve(comb, ring)[:count]


def slow_band_kurtosis(signal, low_line, width):
    """Envelope of one band at the full rate, by a plain sum over lines."""
    count = len(signal)
    lines = np.fft.fft(signal - signal.mean())
    kept = np.zeros(count, dtype=complex)
    kept[low_line : low_line + width] = lines[low_line : low_line + width]
    power = np.abs(np.fft.ifft(kept)) ** 2
    return np.mean(power**2) / np.mean(power) ** 2 - 2


def test_every_band_equals_the_slow_one():
    signal = impacts(4096)
    found = kurtogram(signal, RATE, 3)
    for count, level in zip(found.bands, found.kurtosis, strict=True):
        width = 2048 // count
        for band in range(count):
            # a band that ends below half the rate is sampled fully at the full rate
            if (band + 1) * width > 1024:
                continue
            slow = slow_band_kurtosis(signal, 1 + band * width, width)
            assert level[band] == pytest.approx(slow, rel=1e-9, abs=1e-9)


def test_band_of_impacts_is_found():
    low, high, kurtosis = kurtogram(impacts(1 << 17), RATE).best
    assert low < 5200 < high
    assert kurtosis > 2


@pytest.mark.parametrize("seed", range(3))
def test_gaussian_noise_has_none(seed):
    noise = np.random.default_rng(seed).normal(size=1 << 17)
    found = kurtogram(noise, RATE)
    for count, level in zip(found.bands, found.kurtosis, strict=True):
        width = (1 << 16) // count
        # the variance of K is 4/m for m complex samples; six deviations over all bands
        assert np.abs(level).max() < 6 * 2 / np.sqrt(width)


def test_a_tone_has_minus_one():
    t = np.arange(1 << 14) / RATE
    level = kurtogram(np.cos(2 * np.pi * 1234.5 * t), RATE, 0).kurtosis[0]
    assert level[0] == pytest.approx(-1.0, abs=0.02)


def test_scale_changes_nothing():
    signal = impacts(1 << 13)
    small, large = kurtogram(signal, RATE), kurtogram(1000 * signal, RATE)
    for a, b in zip(small.kurtosis, large.kurtosis, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_rows_cover_the_band_at_every_level():
    found = kurtogram(impacts(1 << 12), RATE, 3)
    rows = found.rows()
    assert found.bands == (1, 2, 3, 4, 6, 8, 12)
    assert {r["level"] for r in rows} == set(range(7))
    assert max(r["high_hz"] for r in rows) == RATE / 2


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: kurtogram(np.ones(1000), RATE), "constant"),
        (lambda: kurtogram(np.arange(10.0), RATE), "at least 64"),
        (lambda: kurtogram(np.arange(256.0), RATE, 13), "levels"),
        (lambda: kurtogram(np.arange(256.0), 0.0), "rate"),
    ],
)
def test_impossible_requests_are_refused(call, words):
    with pytest.raises(ArgumentError, match=words):
        call()


@pytest.mark.parametrize(("count", "bands"), [(64, 1), (127, 1), (128, 3), (255, 3), (256, 6)])
def test_every_envelope_keeps_32_samples(count, bands):
    found = kurtogram(impacts(1 << 12)[:count], RATE)
    assert found.bands[-1] == bands
    assert count // 2 // 2 ** (len(found.bands) // 2) >= 32


@pytest.mark.parametrize("count", [16_411, 20_011])
def test_awkward_lengths_give_the_same_map(count):
    # these lengths are primes and padded; the neighbour is not
    signal = impacts(count)
    odd, even = kurtogram(signal, RATE, 4), kurtogram(signal[: count // 256 * 256], RATE, 4)
    for a, b, bands in zip(odd.kurtosis, even.kurtosis, odd.bands, strict=True):
        np.testing.assert_allclose(a, b, rtol=0.1, atol=20 / np.sqrt(count / bands))
