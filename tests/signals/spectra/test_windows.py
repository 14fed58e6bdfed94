"""Windows: sums, noise bandwidth and spectra in closed form against direct sums."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.signals.spectra import (
    TERMS,
    half_lobe,
    noise_bandwidth,
    window,
    window_powers,
    window_spectrum,
)


@pytest.mark.parametrize(
    # Harris 1978, table 1; flat-top with five terms: 3.77 (Heinzel et al. 2002)
    ("name", "bins"),
    [("rectangular", 1.0), ("hann", 1.5), ("blackman-harris", 2.0), ("flat-top", 3.77)],
)
def test_noise_bandwidth_is_the_published_one(name, bins):
    assert noise_bandwidth(name) == pytest.approx(bins, abs=0.006)


@pytest.mark.parametrize("name", TERMS)
@pytest.mark.parametrize("length", [16, 101])
def test_spectrum_equals_the_direct_sum(name, length):
    offset = np.linspace(-1.3 * length, 1.3 * length, 257)
    weights = window(name, length)
    phase = np.exp(-2j * np.pi * np.outer(offset, np.arange(length)) / length)
    expected = phase @ weights / weights.sum()
    np.testing.assert_allclose(window_spectrum(name, offset, length), expected, atol=1e-11)


@pytest.mark.parametrize("name", TERMS)
def test_spectrum_vanishes_from_the_edge_of_the_main_lobe_on(name):
    bins = np.arange(half_lobe(name), 60.0)
    assert np.abs(window_spectrum(name, bins, 256)).max() < 1e-12


def test_unknown_windows_are_refused_with_the_nearest_name():
    with pytest.raises(ArgumentError, match="did you mean flat-top"):
        window("flattop", 8)


def test_weights_are_shared_and_therefore_read_only():
    with pytest.raises(ValueError, match="read-only"):
        window("hann", 16)[0] = 1.0


@pytest.mark.parametrize("length", [64, 100])
def test_an_offset_does_not_hide_a_signal_behind_its_side_lobes(length):
    """Whatever the window, and filled up with zeros or not."""
    signals = np.random.default_rng(length).normal(size=(3, 64))
    weights = window("hann", 64)
    plain = window_powers(signals, weights, length)
    np.testing.assert_allclose(window_powers(signals + 1e3, weights, length), plain, rtol=1e-6)
    direct = (signals - signals.mean(axis=1, keepdims=True)) * weights
    turned = np.exp(-2j * np.pi * np.outer(np.arange(64), np.arange(length // 2 + 1)) / length)
    np.testing.assert_allclose(plain, np.abs(direct @ turned) ** 2, rtol=1e-9, atol=1e-12)
    kept = window_powers(signals + 1e3, weights, length, centred=False)
    assert kept[:, 0] == pytest.approx((1e3 * weights.sum()) ** 2, rel=1e-2)
