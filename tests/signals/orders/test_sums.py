"""Lines from short sums: what blocks read, in any track, and their sums in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.synthetic_signals import constant_track, lines_on, track_of, wandering_turns, white

from gearmon.arrays import median_along
from gearmon.signals.angle import AngleTrack, phasors
from gearmon.signals.orders import OrderBlocks, OrderSums

RATE, DURATION, SPEED = 8000.0, 12.0, 25.0
TIME = np.arange(int(DURATION * RATE)) / RATE
ORDERS = np.array([9.3, 23.0, 46.0, 69.0, 115.0])
LEVELS = np.array([0.5, 1.0, 0.3, 0.7, 0.2])


def turns_of(wander=0.003, seed=0):
    def turns(time):
        return wandering_turns(time, SPEED, wander, seed)

    return turns


def recording(wander=0.003, noise=0.02, channels=1, seed=0):
    """Lines with a sideband on either side, and the track through 300 of their angles."""
    turns = turns_of(wander, seed)
    angle = turns(TIME)
    orders = np.concatenate([ORDERS, ORDERS + 1.0, ORDERS - 1.0])
    levels = np.concatenate([LEVELS, 0.3 * LEVELS, 0.2 * LEVELS])
    phases = np.random.default_rng(seed).uniform(0, 6.28, len(orders))
    clean = lines_on(angle, orders, levels, phases)
    samples = np.vstack([clean] * channels) + white((channels, len(TIME)), noise, seed=seed)
    return samples, track_of(turns, TIME[-1], 300)


@pytest.mark.parametrize("block_turns", [5.0, 20.0])
@pytest.mark.parametrize("channels", [1, 2])
def test_noise_is_that_of_blocks(block_turns, channels):
    samples, track = recording(channels=channels)
    found = OrderSums(samples, RATE, ORDERS).noise(track, block_turns)
    quick = OrderBlocks(samples, RATE, track, ORDERS, block_turns, error=1e-3).lines()
    # of a wave both of whose sides count, a sliding sum reads half the peak
    np.testing.assert_allclose(found, 0.25 * quick.noise, rtol=1e-4)


def other_tracks(track):
    """Tracks about another one: turned, a little and far faster, and one that wanders else."""
    time = track.time_s
    for turns in (
        track.turns + 0.02,
        track.turns * 1.0005,
        track.turns * 1.02,
        track.turns + 0.01 * np.sin(2 * np.pi * time),
    ):
        yield AngleTrack(time_s=time, turns=turns, method="comb", uncertainty_turns=0.0)


def test_another_track_is_heard_as_if_it_had_been_the_first():
    samples, track = recording()
    sums = OrderSums(samples, RATE, ORDERS)
    sums.sliding(track, 8.0)
    for other in other_tracks(track):
        found, fresh = (
            sums.sliding(other, 8.0),
            OrderSums(samples, RATE, ORDERS).sliding(other, 8.0),
        )
        np.testing.assert_allclose(found.amplitude, fresh.amplitude, atol=0.01)


def test_samples_are_read_again_only_for_a_track_that_is_not_near():
    samples, track = recording()
    sums = OrderSums(samples, RATE, ORDERS)
    sums.sliding(track, 8.0)
    first = sums._read
    turned, near, far, _ = other_tracks(track)
    for other, same in ((turned, True), (near, True), (far, False)):
        sums.sliding(other, 8.0)
        assert (sums._read is first) == same


def test_sliding_blocks_are_direct_sums_of_their_windows():
    samples, track = recording()
    found = OrderSums(samples, RATE, ORDERS).sliding(track, 4.0)
    angle = track.turns_at(TIME)
    density = np.gradient(angle)
    hop = float(np.median(np.diff(found.angle)))
    assert hop == pytest.approx(1.0, rel=1e-5)
    for number in (0, 1, 2, 57, len(found.angle) - 2, len(found.angle) - 1):
        centre = angle[0] + number
        away = angle - centre
        window = np.where(np.abs(away) < 2, 0.5 + 0.5 * np.cos(np.pi * away / 2), 0.0) * density
        wave = np.exp(-2j * np.pi * np.outer(ORDERS, angle))
        slow = (wave * samples[0]) @ window / window.sum()
        # at the ends, where a window is cut, a stretch more or less counts
        cut = number < 2 or number > len(found.angle) - 3
        np.testing.assert_allclose(found.amplitude[number], slow, atol=0.03 if cut else 8e-3)
        middle = (window @ angle) / window.sum()
        assert found.angle[number] == pytest.approx(middle, abs=0.06 if cut else 5e-3)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_scale_does_not_matter(factor):
    samples, track = recording(noise=0.5)
    one = OrderSums(samples, RATE, ORDERS).sliding(track, 8.0)
    other = OrderSums(factor * samples, RATE, ORDERS).sliding(track, 8.0)
    np.testing.assert_allclose(other.amplitude, factor * one.amplitude, rtol=1e-9)


def test_a_recording_of_a_few_turns_is_heard_in_blocks_of_a_quarter_of_it():
    samples, _ = recording(wander=0.0)
    short = samples[:, :900]
    track = constant_track(SPEED, 899 / RATE)
    found = OrderSums(short, RATE, ORDERS).sliding(track, 4.0)
    assert np.isfinite(found.amplitude).all()
    assert found.angle[-1] < 900 / RATE * SPEED
    hop = 899 / RATE * SPEED / 16
    np.testing.assert_allclose(np.diff(found.angle)[2:-2], hop, rtol=0.02)


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=40))
def test_phasors_are_the_exponential(cycles):
    phases = np.array(cycles)
    exact = np.exp(2j * np.pi * (phases - np.rint(phases)))
    np.testing.assert_allclose(phasors(phases), exact, atol=3e-14)


@given(st.integers(1, 9), st.integers(0, 1000))
def test_medians_are_those_of_numpy(count, seed):
    values = white((count, 5), seed=seed)
    np.testing.assert_array_equal(median_along(values), np.median(values, axis=0))
    np.testing.assert_array_equal(median_along(values, 1), np.median(values, axis=1))


def test_phasors_keep_the_shape():
    phases = np.random.default_rng(0).uniform(-3, 3, (7, 1300))
    np.testing.assert_allclose(phasors(phases.T), np.exp(2j * np.pi * phases.T), atol=3e-14)


def test_multiples_of_an_order_are_heard_as_if_each_were_alone():
    samples, track = recording()
    orders = np.array([7.0, 23.0, 46.0, 69.0, 70.1, 115.0])
    found = OrderSums(samples, RATE, orders).sliding(track, 8.0)
    for column, order in enumerate(orders):
        # as few cycles a stretch as with all of them
        alone = OrderSums(samples, RATE, np.array([order, 115.0001])).sliding(track, 8.0)
        np.testing.assert_allclose(found.amplitude[:, column], alone.amplitude[:, 0], atol=1e-4)
