"""The variance of a mean over half-overlapped blocks, against what the mean truly does."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.signals.orders import variance_of_mean
from gearmon.signals.spectra import window

HALF = 32
LINES = np.arange(5, 29, 3)


def blocks_of(signal):
    """Amplitudes of lines in half-overlapped Hann blocks, phases counted from the start."""
    count = len(signal) // HALF - 1
    weights = window("hann", 2 * HALF)
    rows = [np.fft.fft(weights * signal[HALF * b : HALF * (b + 2)])[LINES] for b in range(count)]
    return np.array(rows) * np.exp(-1j * np.pi * np.outer(np.arange(count), LINES))


def noise(rng, count):
    return rng.normal(size=HALF * (count + 1))


@pytest.mark.parametrize("count", [2, 3, 5, 8, 9, 12, 18, 40])
def test_white_noise_is_told_without_bias(count):
    rng = np.random.default_rng(count)
    blocks = [blocks_of(noise(rng, count)) for _ in range(600)]
    true = np.mean([np.abs(one.mean(axis=0)) ** 2 for one in blocks])
    told = np.mean([variance_of_mean(one) for one in blocks])
    # 600 x 8 exponential variables tell their mean to 1.5 %
    assert told == pytest.approx(true, rel=0.12)


def test_a_steady_line_beside_the_own_one_does_not_count():
    rng = np.random.default_rng(1)
    count, told, plain, true = 28, [], [], []
    place = np.arange(HALF * (count + 1))
    for _ in range(200):
        hum = 3.0 * np.cos(2 * np.pi * (LINES[3] + 0.37) / (2 * HALF) * place + rng.uniform(0, 6))
        blocks = blocks_of(noise(rng, count) + hum)[:, 3]
        told.append(variance_of_mean(blocks))
        plain.append(np.var(blocks) / count)
        true.append(np.abs(blocks.mean()) ** 2)
    assert np.mean(plain) > 10 * np.mean(true)  # the scatter of the blocks is not the answer
    # what a strong line leaks to the other frequencies of the block series stays in
    assert 0.8 < np.mean(told) / np.mean(true) < 2.0


def test_a_slow_drift_counts_in_full():
    rng = np.random.default_rng(2)
    count = 28
    blocks = blocks_of(noise(rng, count))
    drift = 40.0 * np.cos(2 * np.pi * (np.arange(count) / count + 0.1))[:, None]
    assert np.all(variance_of_mean(blocks + drift) > 10 * variance_of_mean(blocks))


def test_laws():
    rng = np.random.default_rng(3)
    blocks = blocks_of(noise(rng, 20))
    told = variance_of_mean(blocks)
    assert told == pytest.approx(variance_of_mean(blocks + (3 - 4j)), rel=1e-9)
    assert variance_of_mean(1e3j * blocks) == pytest.approx(1e6 * told, rel=1e-12)
    assert variance_of_mean(blocks[:, None, :])[0] == pytest.approx(told, rel=1e-12)
    assert np.all(variance_of_mean(np.full((20, 3), 2 + 1j)) < 1e-25)
    assert np.all(variance_of_mean(blocks[:1]) == 0)
