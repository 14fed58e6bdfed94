"""Wander of speed and load, and the angle that belongs to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.simulation.contact import WANDER_BAND_HZ, ShaftMotion, random_wander
from gearmon.simulation.train import stream


def wander(deviation=0.005, seed=0):
    return random_wander(deviation, np.random.default_rng(seed))


def test_deviation_is_met_over_a_long_time():
    values = wander(0.01).value(np.linspace(0, 2000, 100_001))
    assert values.std() == pytest.approx(0.01, rel=0.05)
    assert abs(values.mean()) < 0.001


def test_integral_is_that_of_the_value():
    one, h, times = wander(), 1e-4, np.linspace(0, 20, 201)
    slope = (one.integral(times + h) - one.integral(times - h)) / (2 * h)
    assert slope == pytest.approx(one.value(times), abs=1e-8)
    assert one.integral(0.0) == pytest.approx(0.0)


def test_wander_is_slow():
    times = np.linspace(0, 100, 20_001)
    spectrum = np.abs(np.fft.rfft(wander().value(times) * np.hanning(len(times)))) ** 2
    frequency = np.fft.rfftfreq(len(times), times[1])
    assert spectrum[frequency > 2.1].sum() < 1e-6 * spectrum.sum()


def test_wander_is_a_random_walk_in_its_band():
    """A power density that falls as 1/f^2: half the power in every higher octave."""
    own = [wander(0.01, seed) for seed in range(20)]
    frequency, amplitude = (
        np.concatenate([getattr(one, name) for one in own])
        for name in ("frequencies_hz", "amplitudes")
    )
    octave = np.floor(np.log2(frequency / WANDER_BAND_HZ[0]) + 1e-9).astype(int)
    power = np.bincount(octave, amplitude**2 / 2)
    whole = int(np.log2(WANDER_BAND_HZ[1] / WANDER_BAND_HZ[0]))
    assert whole >= 3
    assert power[1:whole] / power[: whole - 1] == pytest.approx(0.5, rel=0.1)


def test_a_wander_begins_anywhere():
    begun = [wander(0.01, seed).value(0.0) for seed in range(400)]
    assert np.std(begun) == pytest.approx(0.01, rel=0.1)
    assert abs(np.mean(begun)) < 0.0015


def test_no_deviation_is_a_constant_speed():
    motion = ShaftMotion(mean_hz=25.0, wander=wander(0.0), start_turns=3.0)
    times = np.linspace(0, 5, 11)
    assert motion.speed_hz(times) == pytest.approx(25.0)
    assert motion.turns(times) == pytest.approx(3 + 25 * times)


@given(
    seed=st.integers(0, 1000),
    mean_hz=st.floats(0.01, 500),
    deviation=st.floats(0, 0.1),
    start=st.floats(-1000, 1000),
)
def test_times_are_the_inverse_of_turns(seed, mean_hz, deviation, start):
    motion = ShaftMotion(mean_hz=mean_hz, wander=wander(deviation, seed), start_turns=start)
    times = np.linspace(-1, 60, 101)
    assert np.all(np.diff(motion.turns(times)) > 0)
    # angles of a thousand turns carry thirteen digits
    assert motion.times_s(motion.turns(times)) == pytest.approx(times, abs=1e-9 + 1e-11 / mean_hz)


def test_speed_must_be_positive():
    with pytest.raises(ArgumentError, match=r"mean_hz=0.*must be > 0"):
        ShaftMotion(mean_hz=0.0, wander=wander())


def test_streams_of_different_purposes_are_independent():
    first, second = stream(1, "noise", 0).normal(size=1000), stream(1, "noise", 1).normal(size=1000)
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.1
    assert np.array_equal(first, stream(1, "noise", 0).normal(size=1000))
