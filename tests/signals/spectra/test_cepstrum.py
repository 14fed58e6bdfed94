"""Cepstra: echoes, sideband families, liftering that leaves the rest alone."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.signals.spectra import real_cepstrum

RATE, COUNT = 4096.0, 16384


def echo(delay, share=0.5, seed=1):
    rng = np.random.default_rng(seed)
    pulse = rng.normal(size=COUNT)
    return pulse + share * np.roll(pulse, delay)


def cepstrum(signal):
    return real_cepstrum(signal, RATE)[1]


def test_an_echo_makes_the_series_of_its_logarithm():
    # ln|1 + a e^{-iwd}| = a cos(wd) - a^2/2 cos(2wd) + a^3/3 cos(3wd) - ...
    change = cepstrum(echo(700)) - cepstrum(echo(0, 0.0))
    for number in (1, 2, 3):
        expected = (-1.0) ** (number + 1) * 0.5**number / number / 2
        assert change[0, 700 * number] == pytest.approx(expected, abs=2e-4)


def test_mean_logarithm_stands_at_zero():
    signal = echo(300)
    lines = np.abs(np.fft.fft(signal - signal.mean()))
    lines[0] = lines.max() * 1e-10
    assert cepstrum(signal)[0, 0] == pytest.approx(np.log(lines).mean(), abs=1e-9)


def sidebands(spacing=16.0, seed=2):
    rng = np.random.default_rng(seed)
    t = np.arange(COUNT) / RATE
    family = sum(
        np.cos(2 * np.pi * (900 + spacing * k) * t + rng.uniform(0, 6.28)) / (1 + 0.05 * abs(k))
        for k in range(-30, 31)
    )
    return family, family + 0.3 * rng.normal(size=COUNT)


def test_sideband_spacing_stands_out():
    _, signal = sidebands()
    quefrency_s, found = real_cepstrum(signal, RATE)
    np.testing.assert_allclose(quefrency_s, np.arange(COUNT // 2 + 1) / RATE)

    def rahmonics(spacing):
        places = [round(k * RATE / spacing) for k in (1, 2, 3)]
        return sum(found[0, place - 1 : place + 2].max() for place in places)

    right = rahmonics(16.0)
    wrong = [rahmonics(spacing) for spacing in np.arange(10.3, 15.5, 0.31)]
    assert right > 2 * max(wrong)


def test_gain_changes_only_the_first_value():
    _, signal = sidebands()
    change = cepstrum(50 * signal) - cepstrum(signal)
    assert change[0, 0] == pytest.approx(np.log(50), abs=1e-12)
    np.testing.assert_allclose(change[0, 1:], 0, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: real_cepstrum(np.ones(100), RATE), "constant"),
        (lambda: real_cepstrum(np.ones(4), RATE), "at least 16"),
    ],
)
def test_impossible_requests_are_refused(call, words):
    with pytest.raises(ArgumentError, match=words):
        call()
