"""The comb finds the speed whose orders stand on lines, and only that one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.slow_orders import comb_score, hann_values, slow_floor
from reference.synthetic_signals import lines_on, wandering_turns, white

from gearmon.errors import ArgumentError
from gearmon.signals.tracking import Comb, MeshComb, SpeedScan, SpeedTrack, comb
from gearmon.signals.tracking.mesh_detection import combined_comb

RATE, NOMINAL = 4000.0, 25.0
MESH = MeshComb(order=23.0, groups=tuple((23.0 * k,) for k in range(1, 7)), spacings=(1.0, 23 / 61))
COMB = combined_comb([MESH], [1.0, 23 / 61])


def machine(turns, noise=1.0, seed=0, level=0.5):
    """Three mesh harmonics with sidebands of shaft 1, two shaft lines, white noise."""
    orders = [1.0, 2.0, *(23.0 * k + r for k in (1, 2, 3) for r in (-1, 0, 1))]
    levels = [level, level / 2, *(level * share for _ in range(3) for share in (0.3, 1.0, 0.3))]
    phases = np.random.default_rng(seed).uniform(0, 6.28, len(orders))
    clean = lines_on(turns, orders, levels, phases)
    return clean + white(clean.shape, noise, seed=seed)


def steady(speed_hz, duration_s=8.0):
    return speed_hz * np.arange(int(duration_s * RATE)) / RATE


@pytest.mark.parametrize(("orders", "weights"), [([], []), ([1.0, 2.0], [1.0])])
def test_comb_needs_one_weight_an_order(orders, weights):
    with pytest.raises(ArgumentError, match="one weight each"):
        Comb(orders=np.array(orders), weights=np.array(weights))


@pytest.mark.parametrize(("order", "weight"), [(0.0, 1.0), (-1.0, 1.0), (1.0, -0.1)])
def test_comb_lies_above_zero(order, weight):
    with pytest.raises(ArgumentError, match="orders must be > 0 and its weights >= 0"):
        Comb(orders=np.array([order]), weights=np.array([weight]))


def test_part_of_a_comb_keeps_at_least_its_lowest_line():
    whole = Comb(orders=np.array([1.0, 5.0, 9.0]), weights=np.array([0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(whole.below(5.0).orders, [1.0, 5.0])
    np.testing.assert_array_equal(whole.below(5.0).weights, [0.1, 0.2])
    np.testing.assert_array_equal(whole.below(0.5).orders, [1.0])


def test_speed_is_linear_between_blocks_and_constant_outside():
    track = SpeedTrack(time_s=np.array([1.0, 3.0]), speed_hz=np.array([20.0, 22.0]))
    np.testing.assert_allclose(track.at(np.array([0.0, 1.5, 9.0])), [20.0, 20.5, 22.0])
    assert track.mean_hz == pytest.approx(21.0)


@pytest.mark.parametrize("error", [-0.03, -0.0123, 0.0, 0.008, 0.0299])
def test_speed_is_found_though_the_nominal_one_is_wrong(error):
    true = NOMINAL * (1 + error)
    scan = SpeedScan(machine(steady(true)), RATE, COMB, NOMINAL)
    assert scan.track().mean_hz == pytest.approx(true, rel=2e-4)
    np.testing.assert_allclose(scan.track().speed_hz, true, rtol=1e-3)


def test_a_speed_is_read_finer_than_candidates_stand_apart():
    apart = float(np.diff(SpeedScan(machine(steady(NOMINAL)), RATE, COMB, NOMINAL).ratio).max())
    off = []
    for share in (0.0, 0.2, 0.4, 0.6, 0.8):
        true = NOMINAL * (1 + share * apart)
        track = SpeedScan(machine(steady(true), noise=0.5), RATE, COMB, NOMINAL).track()
        off.append((track.speed_hz / true - 1) / apart)
    assert np.sqrt(np.mean(np.square(off))) < 0.45


@pytest.mark.parametrize("seed", range(4))
def test_drifting_speed_is_followed(seed):
    time = np.arange(int(10 * RATE)) / RATE
    turns = wandering_turns(time, 0.99 * NOMINAL, 0.005, seed, slowest_s=20.0)
    track = SpeedScan(machine(turns, noise=0.3, seed=seed), RATE, COMB, NOMINAL).track()
    half = 0.5  # mean speed over a block weighted like its window
    true = [
        np.interp(at + half / 2, time, turns) - np.interp(at - half / 2, time, turns)
        for at in track.time_s
    ]
    assert np.std(track.speed_hz / (np.array(true) / half) - 1) < 1.5e-3


def test_slow_ramp_of_five_per_cent_is_followed():
    time = np.arange(int(10 * RATE)) / RATE
    turns = NOMINAL * (0.975 * time + 0.0025 * time**2)
    track = SpeedScan(machine(turns, noise=0.3), RATE, COMB, NOMINAL, block_s=0.5).track()
    np.testing.assert_allclose(track.speed_hz, NOMINAL * (0.975 + 0.005 * track.time_s), rtol=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_loud_lines_of_another_origin_do_not_decide(seed):
    # mains and a bearing, ten times as loud, one of them beside a mesh line at a wrong speed
    true = 0.985 * NOMINAL
    samples = machine(steady(true), seed=seed)
    time = np.arange(samples.shape[1]) / RATE
    samples += lines_on(time, [100.0, 23 * 1.013 * NOMINAL, 741.3], 5.0, 0.1)
    found = SpeedScan(samples, RATE, COMB, NOMINAL).track()
    assert found.mean_hz == pytest.approx(true, rel=5e-4)


def test_the_best_path_elsewhere_keeps_away_from_the_best_of_all():
    time = np.arange(int(8.0 * RATE)) / RATE
    samples = machine(25.0 * time, level=0.5) + machine(25.5 * time, noise=0.0, level=0.3)
    scan = SpeedScan(samples, RATE, COMB, 25.2)
    assert scan.track().mean_hz == pytest.approx(25.0, abs=0.02)
    assert scan.elsewhere(0.005).mean_hz == pytest.approx(25.5, abs=0.02)


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_scale_and_order_of_channels_do_not_matter(factor):
    samples = np.vstack([machine(steady(24.8), seed=1), machine(steady(24.8), seed=2)])
    plain = SpeedScan(samples, RATE, COMB, NOMINAL)
    other = SpeedScan(samples[::-1] * [[factor], [3.0]], RATE, COMB, NOMINAL)
    np.testing.assert_allclose(other.scores, plain.scores, rtol=1e-9, atol=1e-9)


def test_scores_equal_a_sum_over_lines_one_by_one():
    samples = np.vstack([machine(steady(24.8, 2.0), seed=1), white((1, 8000), seed=2)])
    scan = SpeedScan(samples, RATE, COMB, NOMINAL, tolerance=0.0107, block_s=0.5)
    used = COMB.orders < 0.49 * RATE / (NOMINAL * 1.0107)
    bins = scan.quality.shape[1]
    for row in (0, 3):
        block = samples[:, row * 1000 : row * 1000 + 2000] * hann_values(2000)
        power = np.abs(np.fft.rfft(block, 4000))[:, :bins] ** 2
        quality = np.mean([np.log1p(p / slow_floor(p, 96)) for p in power], axis=0)
        slow = [
            comb_score(quality, 1.0, COMB.orders[used], COMB.weights[used], NOMINAL * ratio)
            for ratio in scan.ratio
        ]
        np.testing.assert_allclose(scan.scores[row], slow, rtol=1e-9)
    assert scan.bin_hz == pytest.approx(1.0)
    np.testing.assert_allclose(scan.centre_s[:2], [0.25, 0.5])


def test_kept_blocks_do_not_overlap_and_hold_their_own_spectra():
    samples = machine(steady(24.8))
    scan = SpeedScan(samples, RATE, COMB, NOMINAL)
    assert np.all(np.diff(scan.kept) >= 2 * scan.stride)
    assert scan.quality.shape[0] == len(scan.kept)
    block = samples[:, scan.kept[0] * 2000 : scan.kept[0] * 2000 + 4000] * hann_values(4000)
    power = np.abs(np.fft.rfft(block[0], 8000))[: scan.quality.shape[1]] ** 2
    np.testing.assert_allclose(
        scan.quality[0], np.log1p(power / slow_floor(power, 96)), rtol=1e-5, atol=1e-6
    )


def test_right_one_of_several_nominal_speeds_scores_best():
    samples = machine(steady(24.6))
    scores = [SpeedScan(samples, RATE, COMB, at).best_score for at in (20.0, 25.0, 30.0)]
    assert np.argmax(scores) == 1


def test_recording_shorter_than_a_block_is_one_block():
    scan = SpeedScan(machine(steady(24.9, 0.7)), RATE, COMB, NOMINAL, block_s=5.0)
    assert scan.scores.shape[0] == 1
    assert scan.track().mean_hz == pytest.approx(24.9, rel=2e-3)


@given(st.integers(0, 10_000))
def test_best_path_is_the_best_of_all_where_moves_are_free_of_charge(seed):
    # one block: the greatest score; constant scores but for one candidate: that candidate
    scores = white((1, 30), seed=seed)
    assert comb.best_path(scores, 3)[0] == np.argmax(scores[0])
    same = np.zeros((6, 30))
    same[:, seed % 30] = 1.0
    np.testing.assert_array_equal(comb.best_path(same, 3), seed % 30)


def test_best_path_equals_trying_all_paths():
    scores = white((5, 6), seed=8)
    reach = 2
    contrast = np.mean(scores.max(axis=1) - np.median(scores, axis=1))
    best, chosen = -np.inf, None
    for path in np.ndindex(*(6,) * 5):
        moves = np.diff(path)
        if np.abs(moves).max() <= reach:
            total = scores[np.arange(5), path].sum() - contrast * np.sum((moves / reach) ** 2)
            if total > best:
                best, chosen = total, path
    np.testing.assert_array_equal(comb.best_path(scores, reach), chosen)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"nominal_hz": 0.0}, "nominal_hz"),
        ({"nominal_hz": 25.0, "tolerance": 0.5}, "tolerance"),
        ({"nominal_hz": 25.0, "tolerance": 0.0}, "tolerance"),
        ({"nominal_hz": 25.0, "block_s": -1.0}, "block_s"),
    ],
)
def test_arguments_out_of_range_are_refused(changes, named):
    with pytest.raises(ArgumentError, match=named):
        SpeedScan(np.zeros((1, 4000)), RATE, COMB, **changes)


def test_path_of_many_moves_is_the_best_of_all_steps_one_by_one():
    # more candidates within reach than moves: each step of the path is one of them, and the best
    scores, reach = white((40, 900), seed=3), 400
    scores[np.arange(40), 300 + 7 * np.arange(40)] += 8.0
    contrast = np.mean(scores.max(axis=1) - np.median(scores, axis=1))
    count = max(24, -(-reach // 12))
    moves = np.unique(np.round(np.linspace(-reach, reach, 2 * count + 1)).astype(int))
    total, came = scores[0].copy(), []
    for row in scores[1:]:
        before = np.clip(np.arange(900)[:, None] - moves, 0, 899)
        each = total[before] - contrast * (moves / reach) ** 2
        came.append(before[np.arange(900), each.argmax(axis=1)])
        total = row + each.max(axis=1)
    path = [int(np.argmax(total))]
    for before in reversed(came):
        path.append(int(before[path[-1]]))
    np.testing.assert_array_equal(comb.best_path(scores, reach), path[::-1])


def test_blocks_of_a_long_recording_stand_end_to_end(monkeypatch):
    time = np.arange(int(20.0 * RATE)) / RATE
    turns = wandering_turns(time, 24.8, 0.004, 2)
    samples = machine(turns, seed=4)
    plain = SpeedScan(samples, RATE, COMB, NOMINAL)
    monkeypatch.setattr(comb, "_MANY_BLOCKS", 30)
    apart = SpeedScan(samples, RATE, COMB, NOMINAL)
    assert (plain.stride, apart.stride) == (2, 1)
    assert len(plain.centre_s) == 39
    np.testing.assert_allclose(np.diff(apart.centre_s), 1.0)
    assert np.all(np.diff(apart.kept) >= 2)
    # every second one of the others: the same blocks, heard alike
    np.testing.assert_allclose(apart.scores, plain.scores[::2], rtol=1e-12)
    turned = np.interp(np.array([-0.5, 0.5]) + apart.centre_s[:, None], time, turns)
    assert np.std(apart.track().speed_hz / np.diff(turned)[:, 0] - 1) < 1.5e-3
