"""Cyclic coherence: limits 0 and 1, noise, the place of a modulation, a slow version."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.signals.spectra import cyclic_coherence

RATE = 2048.0


def slow_coherence(signal, alpha, block):
    """Shift the whole signal both ways, then average cross and auto spectra block by block."""
    t = np.arange(len(signal)) / RATE
    signal = signal - signal.mean()
    up = signal * np.exp(-1j * np.pi * alpha * t)
    down = signal * np.exp(1j * np.pi * alpha * t)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(block) / block)
    cross, first, second = 0, 0, 0
    for start in range(0, len(signal) - block + 1, block // 4):
        a = np.fft.fft(window * up[start : start + block])
        b = np.fft.fft(window * down[start : start + block])
        cross, first, second = cross + a * b.conj(), first + abs(a) ** 2, second + abs(b) ** 2
    return (abs(cross) ** 2 / (first * second))[: block // 2 + 1]


def modulated(seed=0, seconds=16):
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    noise = rng.normal(size=len(t))
    lines = np.fft.rfft(noise)
    frequency = np.arange(len(lines)) / seconds
    lines[(frequency < 500) | (frequency > 600)] = 0
    band = np.fft.irfft(lines, len(t))
    return 3 * (1 + np.cos(2 * np.pi * 12.5 * t)) * band + 0.3 * rng.normal(size=len(t))


def test_equals_the_slow_version():
    signal = modulated(seconds=4)
    found = cyclic_coherence(signal, RATE, [12.5, 20.0, -7.3], 64)
    for row, alpha in zip(found.values, found.cyclic_hz, strict=True):
        np.testing.assert_allclose(row, slow_coherence(signal, alpha, 64), atol=1e-12)


def test_modulation_stands_at_its_rate_and_carrier():
    found = cyclic_coherence(modulated(), RATE, np.arange(2.5, 40, 0.5), 64)
    best = np.unravel_index(found.values.argmax(), found.values.shape)
    assert found.cyclic_hz[best[0]] == 12.5
    assert 480 < found.frequency_hz[best[1]] < 620
    enhanced = found.enhanced_envelope_spectrum
    assert found.cyclic_hz[enhanced.argmax()] == 12.5


def test_limits():
    found = cyclic_coherence(modulated(), RATE, [0.0, 9.0], 64)
    np.testing.assert_allclose(found.values[0], 1.0, atol=1e-12)
    assert (found.values >= 0).all()
    assert (found.values <= 1 + 1e-12).all()


def test_stationary_noise_keeps_the_threshold():
    noise = np.random.default_rng(3).normal(size=1 << 16)
    found = cyclic_coherence(noise, RATE, np.arange(5.0, 105.0), 64)
    # three quarters of overlap count as half as many independent blocks: 99.9 % point
    independent = ((len(noise) - 64) // 16 + 1) / 2
    assert np.mean(found.values > 1 - 0.001 ** (1 / (independent - 1))) < 0.004


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: cyclic_coherence(s, RATE, [2000.0], 64), "cyclic_hz"),
        (lambda s: cyclic_coherence(s, RATE, [10.0], 4096), "block=4096"),
        (lambda s: cyclic_coherence(s[None], RATE, [10.0], 64), "one row"),
    ],
)
def test_impossible_requests_are_refused(call, words):
    with pytest.raises(ArgumentError, match=words):
        call(np.random.default_rng(1).normal(size=8192))
