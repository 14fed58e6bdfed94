"""Demodulation: planted modulations are read back, bands are exact, ends are periodic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.signals.spectra import band_envelope, envelope_spectrum

RATE, COUNT = 1024.0, 4096
TIME = np.arange(COUNT) / RATE


def modulated(depth=0.3, phase=0.2, carrier=200.0, rate=5.0):
    a = depth * np.cos(2 * np.pi * rate * TIME)
    b = phase * np.cos(2 * np.pi * rate * TIME + 0.7)
    return 2.5 * (1 + a) * np.cos(2 * np.pi * carrier * TIME + 0.4 + b)


def test_envelope_equals_the_hilbert_transform():
    from scipy.signal import hilbert

    rng = np.random.default_rng(3)
    signal = rng.normal(size=COUNT)
    lines = np.fft.rfft(signal)
    frequency = np.arange(len(lines)) * RATE / COUNT
    lines[(frequency < 100) | (frequency > 355)] = 0
    filtered = np.fft.irfft(lines, COUNT)
    expected = np.abs(hilbert(filtered))
    found = band_envelope(signal, RATE, 100, 355)
    step = COUNT // found.values.shape[-1]
    assert step == 1
    np.testing.assert_allclose(found.amplitude[0], expected[::step], atol=1e-10)


@given(low=st.integers(1, 200), width=st.integers(2, 200), seed=st.integers(0, 99))
def test_mean_square_of_the_band_is_kept(low, width, seed):
    signal = np.random.default_rng(seed).normal(size=COUNT)
    lines = np.fft.rfft(signal) / COUNT
    high = low + width
    step = RATE / COUNT
    expected = 2 * np.sum(np.abs(lines[low : high + 1]) ** 2)
    envelope = band_envelope(signal, RATE, low * step, high * step)
    assert np.mean(envelope.amplitude**2) / 2 == pytest.approx(expected, rel=1e-10)


def test_a_band_from_zero_keeps_the_mean():
    signal = 1.5 + np.cos(2 * np.pi * 40.0 * TIME + 0.3)
    found = band_envelope(signal, RATE, 0.0, 100.0)
    time = np.arange(found.values.shape[-1]) / found.rate
    back = (found.values[0] * np.exp(2j * np.pi * found.low * time)).real
    np.testing.assert_allclose(back, 1.5 + np.cos(2 * np.pi * 40.0 * time + 0.3), atol=1e-10)


def test_envelope_spectrum_reads_the_depth():
    signal = modulated(depth=0.3, phase=0.0)
    found = envelope_spectrum(signal, RATE, 150, 250)
    line = int(np.argmax(found.values[0]))
    assert found.frequency_hz[line] == pytest.approx(5.0, abs=found.resolution_hz / 2)
    # of a Hann window: 1.5 over the duration
    assert found.resolution_hz == pytest.approx(1.5 * RATE / COUNT)
    assert found.values[0, line] == pytest.approx(2.5 * 0.3, rel=1e-3)
    assert found.frequency_hz[-1] <= 100.0


@pytest.mark.parametrize("beat_hz", [20.0, 45.0, 70.0, 95.0])
def test_beats_up_to_the_width_of_the_band_stand_where_they_are(beat_hz):
    # |1 + a e^{iwt}| = 1 + a cos(wt) + O(a^2)
    signal = np.cos(2 * np.pi * 152.0 * TIME) + 0.05 * np.cos(2 * np.pi * (152.0 + beat_hz) * TIME)
    found = envelope_spectrum(signal, RATE, 150.0, 250.0)
    line = int(np.argmax(found.values[0]))
    assert found.frequency_hz[line] == pytest.approx(beat_hz, abs=found.resolution_hz / 2)
    assert found.values[0, line] == pytest.approx(0.05, rel=0.02)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: band_envelope(s, RATE, 300, 200), "fewer than two lines"),
        (lambda s: band_envelope(s, RATE, 0, 900), "high"),
        (lambda s: band_envelope(s[:4], RATE, 0, 100), "at least 8"),
        (lambda s: band_envelope(s, -1.0, 0, 100), "rate"),
    ],
)
def test_impossible_bands_are_refused(call, words):
    with pytest.raises(ArgumentError, match=words):
        call(np.ones(COUNT) + np.cos(2 * np.pi * 200 * TIME))


def test_a_padded_record_keeps_its_envelope_and_length():
    # 20,011 is a prime above the lengths that are transformed as they are
    rate, count = 10_000.0, 20_011
    t = np.arange(count) / rate
    samples = (1 + 0.5 * np.cos(2 * np.pi * 7 * t)) * np.cos(2 * np.pi * 2000 * t)
    found = band_envelope(samples, rate, 1500.0, 2500.0)
    time = np.arange(found.values.shape[-1]) / found.rate
    assert time[-1] <= count / rate
    assert time[-1] == pytest.approx(count / rate, abs=2 / found.rate)
    inner = (time > 0.02) & (time < time[-1] - 0.02)
    expected = 1 + 0.5 * np.cos(2 * np.pi * 7 * time)
    np.testing.assert_allclose(found.amplitude[0, inner], expected[inner], atol=0.02)
