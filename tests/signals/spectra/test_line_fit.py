"""Lines between bins are read without scalloping: any frequency, window and length."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.signals.spectra import TERMS, line_amplitude


@given(
    st.sampled_from(sorted(TERMS)),
    st.sampled_from([64, 1000, 997, 1001, 16_411]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 6.28),
)
def test_a_sine_reads_its_amplitude_frequency_and_phase(name, count, where, phase):
    bins = 0.8 + where * (count / 2 - 1.6)
    rate = 2000.0
    time = np.arange(count) / rate
    samples = 3.0 * np.cos(2 * np.pi * bins * rate / count * time + phase)
    near = round(bins) * rate / count
    found = line_amplitude(samples, rate, near, window_name=name)
    assert found.amplitude[0, 0] == pytest.approx(3.0, abs=1e-5)
    assert found.frequency_hz[0, 0] == pytest.approx(bins * rate / count, abs=1e-5 * rate / count)
    turned = np.angle(np.exp(1j * (found.phase_rad[0, 0] - phase)))
    assert turned == pytest.approx(0.0, abs=1e-4)


def test_a_mean_does_not_matter():
    time = np.arange(1000)
    samples = 50.0 + 3.0 * np.cos(2 * np.pi * 0.00234 * time)
    found = line_amplitude(samples, 1.0, 0.002)
    assert found.amplitude[0, 0] == pytest.approx(3.0, abs=1e-5)


def test_several_lines_and_channels_at_once():
    time = np.arange(4096) / 1000.0
    first = 2.0 * np.cos(2 * np.pi * 100.37 * time) + 0.5 * np.cos(2 * np.pi * 210.11 * time + 1)
    second = 0.1 * np.cos(2 * np.pi * 100.5 * time)
    found = line_amplitude(
        np.stack([first, second + 1e-9 * first]),
        1000.0,
        [100.4, 210.0],
        window_name="blackman-harris",
    )
    np.testing.assert_allclose(found.amplitude[0], [2.0, 0.5], rtol=1e-4)
    np.testing.assert_allclose(found.frequency_hz[0], [100.37, 210.11], atol=1e-3)
    assert found.amplitude[1, 0] == pytest.approx(0.1, rel=1e-4)


def test_a_louder_line_farther_than_a_bin_away_is_left_alone():
    time = np.arange(1000) / 1000.0
    samples = np.cos(2 * np.pi * 100.2 * time) + 5.0 * np.cos(2 * np.pi * 106.3 * time + 1)
    # the skirt of the louder one rises towards it
    found = line_amplitude(samples, 1000.0, 100.0, window_name="blackman-harris")
    assert found.frequency_hz[0, 0] == pytest.approx(100.2, abs=0.1)
    assert found.amplitude[0, 0] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: line_amplitude(np.ones(8), 1.0, 0.2), "at least 16"),
        (lambda: line_amplitude(np.ones(64), 1.0, 0.7), "between 0 and 0.5"),
        (lambda: line_amplitude(np.full(64, np.nan), 1.0, 0.2), "finite"),
    ],
)
def test_impossible_requests_are_refused(call, words):
    with pytest.raises(ArgumentError, match=words):
        call()
