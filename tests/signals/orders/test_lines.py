"""Order lines and averages: what a direct sum gives, calibrated, with the noise they would show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.slow_orders import direct_lines, naive_average
from reference.synthetic_signals import constant_track, lines_on, track_of, wandering_turns, white

from gearmon.errors import ArgumentError
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders import AngleGrid, OrderBlocks, OrderLines, one_turn, without_knocks
from gearmon.signals.orders import lines as lines_module

RATE = 2000.0


def track(time_s, turns):
    return AngleTrack(
        time_s=np.array(time_s, dtype=float),
        turns=np.array(turns, dtype=float),
        method="tacho",
        uncertainty_turns=0.0,
    )


def wandering(duration_s=10.0, speed_hz=20.0, wander=0.01, seed=0):
    """A known angle, and a track through 400 of its points."""

    def turns(time_s):
        return wandering_turns(time_s, speed_hz, wander, seed)

    return turns, track_of(turns, duration_s, 400)


@pytest.mark.parametrize("block_turns", [5.0, 20.0, 37.3, 1e9])
def test_order_lines_equal_a_direct_sum(block_turns):
    duration, speed = 10.0, 20.0
    time = np.arange(int(duration * RATE)) / RATE
    curve = constant_track(speed, time[-1])
    tones, levels = np.array([0.731, 3.0, 5.37, 9.9]), np.array([0.5, 2.0, 1.0, 1.5])
    samples = np.vstack(
        [lines_on(speed * time, tones, levels, 0.4), lines_on(speed * time, tones[::-1], levels)]
    )
    orders = np.array([0.0, 0.05, 0.731, 1.0, 3.0, 5.3, 5.37, 9.9001, 10.0])
    found = OrderBlocks(samples, RATE, curve, orders, block_turns).lines()
    per_turn = AngleGrid.of(len(time), RATE, curve, orders.max()).per_turn
    count = AngleGrid.of(len(time), RATE, curve, orders.max()).count
    at = np.arange(count) / per_turn
    exact = np.vstack([lines_on(at, tones, levels, 0.4), lines_on(at, tones[::-1], levels)])
    slow = direct_lines(exact, per_turn, 0.0, orders, round(found.block_turns * per_turn))
    assert found.amplitude.shape == slow.shape
    np.testing.assert_allclose(found.amplitude, slow, atol=2e-6)


def test_transform_at_any_bin_equals_a_direct_sum():
    # the transforms by themselves, on noise: every bin, also next to 0 and half the rate
    part = white((3, 500), seed=2)
    bins = np.array([0.0, 0.3, 1.0, 17.77, 125.5, 249.6, 250.0])
    none = np.ones((2, len(bins)))
    halves = lines_module.GriddedPlan(250, 0.5 * bins, none)
    rising, falling = (halves.lines(half) for half in (part[:, :250], part[:, 250:]))
    found = rising[:, 0] + falling[:, 1] * np.exp(-1j * np.pi * bins)
    slow = direct_lines(part, 500, 0.0, bins, 500)[0]
    scale = np.where(bins > 0, 2.0, 1.0) / 250.0
    assert np.abs(found * scale - slow).max() < 1e-6 * np.abs(slow).max()


def test_line_reads_its_complex_amplitude():
    turns, curve = wandering()
    samples = lines_on(turns(np.arange(20_000) / RATE), [12.0], [3.0], 0.7) + 5.0
    found = OrderBlocks(samples, RATE, curve, np.array([0.0, 12.0]), 10.0).lines()
    np.testing.assert_allclose(found.amplitude[:, 0, 1], 3 * np.exp(0.7j), rtol=1e-4)
    np.testing.assert_allclose(found.amplitude[:, 0, 0], 5.0, rtol=1e-4)
    np.testing.assert_allclose(found.mean[0, 1], 3 * np.exp(0.7j), rtol=1e-4)


def test_quick_resampling_follows_the_phase_as_well():
    turns, curve = wandering()
    samples = lines_on(turns(np.arange(20_000) / RATE), [12.0], [3.0], 0.7)
    found = OrderBlocks(samples, RATE, curve, np.array([12.0]), 10.0, error=1e-3).lines()
    np.testing.assert_allclose(found.amplitude, 3 * np.exp(0.7j), rtol=2e-3)


@given(st.floats(1e-3, 1e3), st.floats(-3.0, 3.0), st.integers(0, 1000))
def test_lines_scale_and_turn_with_the_angle(factor, shift, seed):
    samples = white((3, 6000), seed=seed)
    orders = np.array([0.7, 2.0, 9.3])
    plain = OrderBlocks(samples, RATE, constant_track(20.0, 3.0), orders, 8.0).lines()
    later = track([0.0, 3.0], [shift, 60.0 + shift])
    other = OrderBlocks(factor * samples[[2, 0, 1]], RATE, later, orders, 8.0).lines()
    turned = factor * plain.amplitude[:, [2, 0, 1]] * np.exp(-2j * np.pi * orders * shift)
    np.testing.assert_allclose(other.amplitude, turned, atol=1e-6 * factor)
    np.testing.assert_allclose(other.noise, factor**2 * plain.noise[[2, 0, 1]], rtol=1e-5)


@pytest.mark.parametrize("orders", [[], [1.0, -0.5]])
def test_lines_need_orders_that_are_not_negative(orders):
    with pytest.raises(ArgumentError, match="at least one, all >= 0"):
        OrderBlocks(
            np.zeros((1, 2000)), RATE, constant_track(20.0, 1.0), np.array(orders), 5.0
        ).lines()


def noise_lines(block_turns, seeds=6, duration_s=60.0, signal=0.0):
    """Lines of white noise at orders well apart, several recordings."""
    orders = np.arange(2.0, 40.0, 1.5)
    time = np.arange(int(duration_s * RATE)) / RATE
    curve = constant_track(20.0, time[-1])
    samples = white((seeds, len(time)), seed=3)
    if signal:
        samples += lines_on(20.0 * time, orders, signal)
    return OrderBlocks(samples, RATE, curve, orders, block_turns).lines()


@pytest.mark.parametrize("block_turns", [20.0, 100.0, 1e9])
def test_noise_is_the_power_that_noise_shows_at_a_line(block_turns):
    lines = noise_lines(block_turns)
    blocks = lines.amplitude.shape[0]
    # Hann: noise bandwidth of 1.5 bins, peak amplitudes, white noise of unit variance
    samples_a_block = lines.block_turns / 20.0 * RATE
    expected = 4 * 1.5 / samples_a_block
    # its floor is a median over 128 bins, the mean of which is taken over 26 lines and 6 channels
    assert lines.noise.mean() == pytest.approx(expected, rel=0.06)
    if blocks > 10:
        assert np.mean(np.abs(lines.amplitude) ** 2) == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize("signal", [0.0, 0.05])
def test_cross_power_has_no_share_of_noise(signal):
    lines = noise_lines(20.0, signal=signal)
    samples_a_block = lines.block_turns / 20.0 * RATE
    power, noise = lines.cross_power(), 6 / samples_a_block
    independent = lines.block_powers()[1] * power.size
    scatter = np.sqrt((noise**2 / 2 + 2 * noise * signal**2) / independent)
    assert abs(power.mean() - signal**2) < 4 * scatter
    assert scatter < 0.1 * noise  # and so the test would notice a tenth of the noise


@pytest.mark.parametrize(("signal", "share"), [(0.0, 18 / 19), (2.0, 3 / 8)])
def test_pairs_of_blocks_are_worth_half_of_them(signal, share):
    """Between what they are worth in noise alone, and where a strong line stands in it.

    Neighbouring Hann blocks correlate by 1/6. In noise alone so do products of pairs by 1/36: n of
    them are worth n/(1 + 2/36). In a product with a strong line each block's noise counts twice,
    and its mean over the blocks varies by 1 + 2/6: they are worth 3n/8.
    """
    lines = noise_lines(20.0, seeds=20, signal=signal)
    powers, independent = lines.block_powers()
    stated = powers.var(axis=0, ddof=1).mean() / independent
    true = powers.mean(axis=0).var()
    assert true / stated == pytest.approx(0.5 / share, rel=0.15)


def test_line_that_turns_slowly_keeps_its_cross_power():
    blocks = np.exp(0.05j * np.arange(40))[:, None, None] * np.ones((1, 1, 1))
    assert made(blocks).cross_power()[0, 0] == pytest.approx(np.cos(0.1), rel=1e-12)
    assert np.abs(made(blocks).mean[0, 0]) ** 2 < 0.75


def made(amplitude, noise=0.0):
    shape = amplitude.shape[1:]
    return OrderLines(
        orders=np.arange(1.0, shape[1] + 1),
        amplitude=amplitude,
        block_turns=10.0,
        first_turn=0.0,
        noise=np.full(shape, noise),
    )


@pytest.mark.parametrize("blocks", [1, 2])
def test_noise_is_subtracted_where_blocks_are_too_few(blocks):
    lines = made(np.full((blocks, 2, 3), 2.0 + 0j), noise=0.5)
    powers, independent = lines.block_powers()
    np.testing.assert_allclose(powers, 3.5)
    assert independent == blocks


@pytest.mark.parametrize("blocks", [1, 2, 5, 60])
def test_count_of_independent_blocks_is_that_of_half_overlapped_hann_windows(blocks):
    # variance of the mean of powers whose neighbours correlate by (1/6)^2
    correlation = np.eye(blocks) + (np.eye(blocks, k=1) + np.eye(blocks, k=-1)) / 36
    expected = blocks**2 / correlation.sum()
    lines = made(np.ones((blocks, 1, 1), dtype=complex))
    assert lines.independent_blocks == pytest.approx(expected, rel=1e-12)


def test_neighbouring_hann_blocks_correlate_by_a_sixth():
    lines = noise_lines(10.0)
    here, there = lines.amplitude[:-1], lines.amplitude[1:]
    turned = np.exp(0j)  # phases count from the start of the recording: nothing to be turned
    correlation = np.mean(here * np.conj(there) * turned) / np.mean(np.abs(lines.amplitude) ** 2)
    assert correlation.real == pytest.approx(1 / 6, abs=0.02)
    assert abs(correlation.imag) < 0.02


@pytest.mark.parametrize(("order", "per_turn"), [(1.0, 128), (0.25, 256), (2.5, 63)])
def test_average_equals_cutting_turns_and_averaging_them(order, per_turn):
    turns, curve = wandering(20.0, wander=0.005)
    count = 40_000
    time = np.arange(count) / RATE
    numbers = np.array([1, 3, 4, 9])
    levels, phases = np.array([1.0, 0.5, 0.8, 0.3]), np.array([0.3, 2.0, -1.0, 0.9])
    samples = lines_on(turns(time), order * numbers, levels, phases)
    samples = samples + lines_on(turns(time), [3.33], [1.0]) + white((1, count), 0.1, seed=4) + 2.0
    # up to the eleventh multiple: what the pattern holds
    orders = order * np.arange(1.0, 12.0)
    lines = OrderBlocks(samples, RATE, curve, orders, 40.0 / order).lines()
    average = one_turn(np.pad(lines.mean, ((0, 0), (1, 0))), per_turn)
    number = np.arange(per_turn) / per_turn
    truth = lines_on(number, numbers, levels, phases)
    assert average.shape == (1, per_turn)
    assert np.corrcoef(average[0], truth[0])[0, 1] > 0.9995
    last = int(order * turns(time[-1]))
    starts = curve.time_at(np.arange(0, last + 1) / order)
    slow = naive_average(samples[0], RATE, starts, per_turn)
    assert np.corrcoef(average[0], slow)[0, 1] > 0.99
    assert average.mean() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("count", [30, 400])
def test_many_lines_in_any_order_equal_a_direct_sum(count):
    # near and far from one another, some twice, in no order: they share matrices in groups
    rng = np.random.default_rng(count)
    bins = np.concatenate([rng.uniform(0.0, 250.0, count), 40 + 0.01 * np.arange(count)])
    bins[5] = bins[3]
    part = white((2, 500), seed=3)
    halves = lines_module.GriddedPlan(250, 0.5 * bins, np.ones((2, len(bins))))
    rising, falling = (halves.lines(half) for half in (part[:, :250], part[:, 250:]))
    found = rising[:, 0] + falling[:, 1] * np.exp(-1j * np.pi * bins)
    slow = direct_lines(part, 500, 0.0, bins, 500)[0]
    scale = np.where(bins > 0, 2.0, 1.0) / 250.0
    assert np.abs(found * scale - slow).max() < 1e-6 * np.abs(slow).max()


@pytest.mark.parametrize("tone", [0.7, 11.0, 24.3, 37.0, 46.0])
def test_error_that_is_allowed_is_not_exceeded(tone):
    # a strong line within the orders or above them, read all over
    speed, orders = 20.0, np.append(np.linspace(0.3, 25.0, 80), tone)
    orders = orders[orders <= 25.0]
    samples = lines_on(speed * np.arange(20_000) / RATE, [tone], [1.0], 0.3)
    curve = constant_track(speed, 20_000 / RATE)
    exact, quicker = (
        OrderBlocks(samples, RATE, curve, orders, 20.0, error=error).lines().amplitude
        for error in (1e-6, 1e-4)
    )
    # what is read besides the line itself stands as far off as a Hann window sees
    slow = np.zeros(len(orders), dtype=complex)
    far = np.abs(orders - tone) > 2.0
    slow[orders == tone] = np.exp(0.3j)
    known = far | (orders == tone)
    assert np.abs(exact[:, 0] - slow)[:, known].max() < 3e-5
    assert np.abs(quicker - exact).max() < 1e-4
    assert np.abs(quicker - exact).max() > 0.0  # another kernel


def blocks_of_a_turn(count, knock_at=(), event=0.0, seed=0):
    """Lines 1 to 60 of unit noise, an event in every block, a knock of 30 times it in some."""
    noise, number = np.random.default_rng(seed), np.arange(1, 61)
    blocks = noise.normal(size=(count, 1, 60)) + 1j * noise.normal(size=(count, 1, 60))
    blocks += event * np.exp(-2j * np.pi * 0.25 * number)
    for block in knock_at:
        blocks[block] += 30 * np.exp(-2j * np.pi * noise.uniform() * number)
    lines = OrderLines(
        orders=number * 1.0,
        amplitude=blocks,
        block_turns=5.0,
        first_turn=0.0,
        noise=np.full((1, 60), 2.0),
    )
    return lines, number


def test_a_knock_is_clipped_and_an_event_of_every_turn_is_not():
    places = np.arange(60)
    quiet, number = blocks_of_a_turn(16, event=3.0)
    assert np.array_equal(without_knocks(quiet, places, number).amplitude, quiet.amplitude)
    knocked, _ = blocks_of_a_turn(16, knock_at=(2, 9), event=3.0)
    told = without_knocks(knocked, places, number)
    assert told.knocked == pytest.approx(2 / 16)

    def around(lines):
        half = np.zeros(257, dtype=complex)
        half[number] = lines.mean[0]
        return np.fft.irfft(half)

    # what is left of a knock is as large as noise; the event at a quarter of the turn stands
    clean = around(quiet)
    assert int(np.argmax(around(told))) == int(np.argmax(clean)) == 128
    assert np.abs(around(told) - clean).max() < 0.5 * np.abs(around(knocked) - clean).max()
    assert around(told).max() == pytest.approx(clean.max(), rel=0.15)


def test_too_few_blocks_are_told_of_but_not_clipped():
    few, number = blocks_of_a_turn(5, knock_at=(1,))
    told = without_knocks(few, np.arange(60), number)
    assert told.knocked == pytest.approx(0.2)
    assert np.array_equal(told.amplitude, few.amplitude)


@pytest.mark.parametrize(("count", "knocked"), [(5, 0), (16, 1)])
def test_of_few_blocks_one_that_is_a_little_louder_was_not_knocked(count, knocked):
    lines, number = blocks_of_a_turn(count)
    lines.amplitude[1] *= 1.6
    told = without_knocks(lines, np.arange(60), number)
    assert told.knocked == pytest.approx(knocked / count)


@pytest.mark.parametrize("seed", range(3))
def test_of_a_knock_however_loud_four_deviations_of_noise_are_left(seed):
    """At every place of the turn, and so in the root mean square over all of it."""
    quiet, number = blocks_of_a_turn(60, event=3.0, seed=seed)
    middle = np.median(quiet.amplitude.real, axis=0) + 1j * np.median(quiet.amplitude.imag, axis=0)
    knocked, usual = [2, 9], np.sqrt(np.mean(np.abs(quiet.amplitude - middle) ** 2))
    for size in (30.0, 300.0, 3000.0):
        blocks = quiet.amplitude.copy()
        for block, place in zip(knocked, (0.31, 0.777), strict=True):
            blocks[block] += size * np.exp(-2j * np.pi * place * number)
        told = without_knocks(replace(quiet, amplitude=blocks), np.arange(60), number).amplitude
        others = np.delete(np.arange(60), knocked)
        # of thousands of places of noise alone one or the other is as far out
        assert np.abs(told - quiet.amplitude)[others].max() < 0.1 * usual
        left = np.sqrt(np.mean(np.abs(told[knocked] - middle) ** 2, axis=(1, 2)))
        assert left.max() < 4 * usual
