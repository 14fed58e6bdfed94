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
