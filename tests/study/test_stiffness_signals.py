"""The four forms share mean and jump; their spectra are those of their samples."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.benchmark.equations import VARIATION
from gearmon.study.pair import SIGNALS


@pytest.mark.parametrize("key", SIGNALS)
def test_no_mean_and_exact_harmonics(key):
    signal = SIGNALS[key]
    count = 40_000
    samples = signal.shape((np.arange(count) + 0.5) / count)
    assert abs(samples.mean()) < 1e-4
    orders = np.arange(1, 13)
    spectrum = np.fft.rfft(samples)[1:13] / count * np.exp(-1j * np.pi * orders / count)
    np.testing.assert_allclose(signal.shape_harmonics(12), spectrum, atol=2e-4)


def test_levels_of_the_published_table():
    parabola = SIGNALS["parabolic"]
    assert parabola.pulse.area == pytest.approx(1.200200, abs=1e-9)
    assert parabola.level(0.0) == pytest.approx(1.471964, abs=1e-6)
    assert parabola.level(0.206) == pytest.approx(1.548588, abs=1e-6)
    assert parabola.level(1 - 1e-12) == pytest.approx(0.921964, abs=1e-6)


def test_wave_meets_the_parabola_at_ends_and_middles():
    phases = np.array([0.0, 0.206, 0.412, 0.706, 1 - 1e-12])
    np.testing.assert_allclose(
        SIGNALS["wave"].level(phases), SIGNALS["parabolic"].level(phases), atol=1e-9
    )


def test_rectangle_jumps_by_twice_the_variation():
    modulation = SIGNALS["rectangular"].modulation
    high, low = modulation(np.array([0.2, 0.7]))
    assert high - low == pytest.approx(2 * VARIATION)


def test_fourier_sums_have_no_jumps_and_end():
    for key in ("fourier", "fourier-half"):
        beyond = SIGNALS[key].shape_harmonics(60)[41:]
        assert np.abs(beyond).max() < 1e-12
        assert SIGNALS[key].jumps == ()
