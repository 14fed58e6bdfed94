"""Speeds that change: followed without a tachometer, against angles that are known."""

from __future__ import annotations

import numpy as np
import pytest
from reference.speed_cases import Pattern, make_case, train_of
from reference.synthetic_signals import (
    constant_track,
    lines_on,
    track_of,
    wandering_turns,
    white,
)

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.signals.orders import InAngle, OrderSums
from gearmon.signals.tracking import SpeedScan, follow_lines, integrate_speed, lock_track
from gearmon.signals.tracking.comb import peak_refined
from gearmon.signals.tracking.phases import scan_angle, unwarp
from gearmon.signatures.tracking import machine_comb

RATE, DURATION, NOMINAL = 4000.0, 8.0, 25.0
TIME = np.arange(int(DURATION * RATE)) / RATE
MACHINE = train_of((23, 61))
COMB = machine_comb(kinematics(MACHINE), MACHINE.operating[0].shaft1_hz)
MESHES = 23.0 * np.arange(1, 4)


def ramp(share, off=0.0):
    """Angle of a shaft whose speed rises by a share of nominal, its middle `off` from nominal."""
    middle = NOMINAL * (1 + off)
    return middle * ((1 - share / 2) * TIME + share * TIME**2 / (2 * DURATION))


def vibration(turns, noise=0.3, seed=0):
    """Mesh lines with sidebands of shaft 1, and its own first harmonics."""
    orders = [m + r for m in MESHES for r in (-2, -1, 0, 1, 2)] + [1.0, 2.0]
    levels = [0.1, 0.3, 1.0, 0.25, 0.15] * 3 + [0.3, 0.2]
    phases = np.random.default_rng(seed).uniform(0, 6.28, len(orders))
    return lines_on(turns, orders, levels, phases) + white((1, len(turns)), noise, seed=seed)


def error_of(track, turns, rate=RATE):
    """Departure of a track from the known angle, its mean left out [turns]."""
    time = np.arange(0, len(turns), 20) / rate
    error = track.turns_at(time) - turns[::20]
    return error - error.mean()


def path_of(samples):
    return SpeedScan(samples, RATE, COMB, NOMINAL, 0.25, 8 / NOMINAL, changing=True)


@pytest.mark.parametrize("share", [-0.3, 0.2])
def test_path_follows_a_ramp(share):
    turns = ramp(share)
    path = path_of(vibration(turns)).track()
    true = NOMINAL * (1 + share * (path.time_s / DURATION - 0.5))
    np.testing.assert_allclose(path.speed_hz, true, rtol=2.5e-3)


@pytest.mark.parametrize("seed", range(4))
def test_path_follows_an_engine_that_hunts(seed):
    """A speed that changes by up to 25 % a second."""
    turns = wandering_turns(TIME, NOMINAL, 0.03, seed, slowest_s=4.0)
    path = path_of(vibration(turns)).track()
    true = np.interp(path.time_s, TIME, np.gradient(turns, TIME))
    assert np.abs(path.speed_hz / true - 1).max() < 0.025


def test_lines_stand_still_in_the_angle_of_a_track_however_the_speed_changes():
    turns = wandering_turns(TIME, NOMINAL, 0.03, 5, slowest_s=4.0)
    samples, comb = vibration(turns), COMB.below(60.0)  # within the band at the highest speed
    known = track_of(lambda t: wandering_turns(t, NOMINAL, 0.03, 5, slowest_s=4.0), TIME[-1], 400)
    known = InAngle.of(samples, RATE, known)
    scan, grid = scan_angle(known, comb, 0.012, 20.0), known.grid
    np.testing.assert_allclose(scan.track().speed_hz, 1.0, atol=3e-4)
    assert scan.centre_s[-1] < grid.count / grid.per_turn
    # as clear as of a steady speed; in blocks of as many turns of time they are smeared
    even = constant_track(NOMINAL, TIME[-1])
    even = InAngle.of(vibration(NOMINAL * TIME), RATE, even)
    steady = scan_angle(even, comb, 0.012, 20.0)
    smeared = SpeedScan(samples, RATE, comb, NOMINAL, 0.012, 20 / NOMINAL)
    assert scan.best_score == pytest.approx(steady.best_score, rel=0.1)
    assert smeared.best_score < 0.6 * steady.best_score


def test_a_recording_is_spread_block_by_block_with_the_same_result():
    turns = wandering_turns(TIME, NOMINAL, 0.01, 5, slowest_s=4.0)
    known = track_of(lambda t: wandering_turns(t, NOMINAL, 0.01, 5, slowest_s=4.0), TIME[-1], 400)
    known = InAngle.of(vibration(turns), RATE, known)
    held, spread = (scan_angle(own, COMB, 0.012, 20.0) for own in (known.holding(), known))
    np.testing.assert_allclose(spread.scores, held.scores, rtol=1e-9)


@pytest.mark.parametrize("together", [1, 20_000])
def test_scores_do_not_depend_on_how_many_blocks_are_looked_at_together(together, monkeypatch):
    samples = vibration(wandering_turns(TIME, NOMINAL, 0.01, 5, slowest_s=4.0))
    usual = SpeedScan(samples, RATE, COMB, NOMINAL, 0.012, 20 / NOMINAL)
    monkeypatch.setattr("gearmon.signals.tracking.comb._TOGETHER", together)
    other = SpeedScan(samples, RATE, COMB, NOMINAL, 0.012, 20 / NOMINAL)
    np.testing.assert_allclose(other.scores, usual.scores, rtol=1e-12)
    np.testing.assert_array_equal(other.quality, usual.quality)


@pytest.mark.parametrize("off", [-0.006, 0.003])
def test_a_scan_in_the_angle_of_a_track_tells_by_what_its_speed_is_off(off):
    wrong = constant_track(NOMINAL * (1 + off), TIME[-1])
    wrong = InAngle.of(vibration(NOMINAL * TIME), RATE, wrong)
    scan = scan_angle(wrong, COMB, 0.012, 10.0)
    np.testing.assert_allclose(scan.track().speed_hz, 1 / (1 + off), atol=3e-4)


@pytest.mark.parametrize("off", [-0.15, 0.2])
def test_path_finds_a_speed_far_from_nominal(off):
    path = path_of(vibration(ramp(0.0, off))).track()
    np.testing.assert_allclose(path.speed_hz, NOMINAL * (1 + off), rtol=1e-3)


def test_path_does_not_hear_how_loud_a_channel_is():
    samples = vibration(ramp(0.1))
    one = path_of(samples)
    other = path_of(1e5 * samples)
    np.testing.assert_allclose(other.track().speed_hz, one.track().speed_hz, rtol=1e-9)
    assert other.best_score == pytest.approx(one.best_score, rel=1e-9)


@pytest.mark.parametrize("changes", [{"nominal_hz": 0.0}, {"tolerance": 0.0}, {"tolerance": 0.7}])
def test_path_refuses_what_is_out_of_range(changes):
    known = {"comb": COMB, "nominal_hz": NOMINAL} | changes
    with pytest.raises(ArgumentError, match=r"nominal_hz|tolerance"):
        SpeedScan(white((1, 8000)), RATE, **known, changing=True)


def test_peak_between_uneven_candidates_is_that_of_the_parabola():
    speeds = np.exp(0.01 * np.arange(20))
    peak = speeds[7] + 0.3 * 0.5 * (speeds[8] - speeds[6])
    step = 0.5 * (speeds[8] - speeds[6])
    scores = 5 - ((np.arange(20) - 7.3) * step) ** 2
    found = peak_refined(scores[None, :], np.array([7]), speeds)
    assert found[0] == pytest.approx(peak, rel=1e-9)


def test_unwarping_sharpens_a_speed_that_is_slightly_wrong():
    turns = ramp(0.02)
    first = constant_track(NOMINAL, TIME[-1])
    better = unwarp(OrderSums(vibration(turns), RATE, MESHES), first, COMB)
    assert error_of(better, turns).std() < 0.2 * error_of(first, turns).std()


@pytest.mark.parametrize(("speed_hz", "block_turns"), [(6.0, 4.0), (15.0, 6.0), (40.0, 10.0)])
def test_blocks_in_which_a_track_is_unwarped_last_two_fifths_of_a_second(speed_hz, block_turns):
    """But four turns at the least, and no more than ten."""
    turns = speed_hz / NOMINAL * ramp(0.02)
    sums = OrderSums(vibration(turns), RATE, MESHES)
    first = constant_track(speed_hz, TIME[-1])
    usual, told = (unwarp(sums, first, COMB, turns=own) for own in (None, block_turns))
    np.testing.assert_allclose(usual.turns_at(TIME[::100]), told.turns_at(TIME[::100]), atol=1e-9)


def followed(samples):
    """Track by the path, the mesh lines and the comb, as a recording is tracked."""
    path = path_of(samples).track()
    track = integrate_speed(path, TIME[-1])
    within = MESHES[0.45 * RATE / path.speed_hz.max() > MESHES]
    sums = OrderSums(samples, RATE, within)
    for reach in (0.015, 0.008):
        track = unwarp(sums, track, COMB, reach)
    return lock_track(sums, track)[0]


@pytest.mark.parametrize("share", [-0.2, 0.2])
@pytest.mark.parametrize("seed", [1])
def test_followed_ramp_is_right_to_two_per_cent_of_a_mesh_period(share, seed):
    turns = ramp(share)
    samples = vibration(turns, seed=seed)
    track = followed(samples)
    error = error_of(track, turns)
    assert error.std() * 23 < 0.02
    assert np.abs(error).max() * 23 < 0.1
    assert error.std() < 3 * track.uncertainty_turns + 1e-4


def with_tones(turns, *tones_hz):
    """The vibration among lines of others, each as strong as the strongest of its own."""
    samples = vibration(turns) + sum(lines_on(TIME, hz, 1.0) for hz in tones_hz)
    return followed(samples)


def test_tones_that_stand_still_do_not_capture_the_path():
    turns = ramp(0.2)
    track = with_tones(turns, 433.0, 791.3, 1003.0, 1210.7)
    assert error_of(track, turns).std() * 23 < 0.02


@pytest.mark.parametrize("tone_hz", [600.0, 610.5, 620.0])
def test_a_tone_that_mesh_lines_cross_hardly_moves_the_angle(tone_hz):
    turns = ramp(0.2)
    error = error_of(with_tones(turns, tone_hz), turns)
    assert error.std() * 23 < 0.005
    assert np.abs(error).max() * 23 < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_lock_is_right_to_the_ends_of_the_recording(seed):
    turns = wandering_turns(TIME, NOMINAL, 0.003, seed)
    mean = (turns[-1] - turns[0]) / TIME[-1]
    first = constant_track(mean, TIME[-1])  # its speed is wrong by some tenths of a per cent
    track = lock_track(OrderSums(vibration(turns, seed=seed), RATE, MESHES), first)[0]
    error = error_of(track, turns)
    assert np.abs(error[:20]).max() * 23 < 0.06
    assert np.abs(error[-20:]).max() * 23 < 0.06
    assert error.std() * 23 < 0.01


def test_lock_of_a_true_track_keeps_it():
    turns = NOMINAL * TIME
    track = lock_track(
        OrderSums(vibration(turns), RATE, MESHES), constant_track(NOMINAL, TIME[-1])
    )[0]
    assert error_of(track, turns).std() * 23 < 0.005
    assert 0 < track.uncertainty_turns * 23 < 0.01


def test_lock_hears_channels_together():
    turns = wandering_turns(TIME, NOMINAL, 0.002, 5)
    first = constant_track(turns[-1] / TIME[-1], TIME[-1])
    loud = vibration(turns, 2.0, 1)
    several = np.vstack([vibration(turns, 2.0, seed) for seed in range(1, 7)])
    one = error_of(lock_track(OrderSums(loud, RATE, MESHES), first)[0], turns).std()
    six = error_of(lock_track(OrderSums(several, RATE, MESHES), first)[0], turns).std()
    assert six < 0.7 * one


@pytest.mark.parametrize("seed", range(3))
def test_lock_to_noise_changes_nothing_and_knows_nothing(seed):
    first = constant_track(NOMINAL, TIME[-1])
    track = lock_track(OrderSums(white((1, len(TIME)), seed=seed), RATE, MESHES), first)[0]
    assert track.uncertainty_turns == float("inf")
    np.testing.assert_allclose(track.turns_at(TIME[::99]), NOMINAL * TIME[::99], atol=1e-9)


def test_patterns_of_the_cases_are_their_harmonics():
    generator = np.random.default_rng(1)
    amplitude = generator.standard_normal(12) + 1j * generator.standard_normal(12)
    turns = np.sort(generator.uniform(0, 5, 200))
    slow = sum((a * np.exp(2j * np.pi * 0.4 * k * turns)).real for k, a in enumerate(amplitude, 1))
    found = Pattern(order=0.4, amplitude=amplitude).at(turns)
    np.testing.assert_allclose(found, slow, atol=2e-3 * np.abs(amplitude).sum())


@pytest.mark.parametrize("law", ["wander", "ramp"])
def test_angle_of_the_cases_rises_as_told(law):
    case = make_case(3, law=law, amount=0.05, duration_s=30.0, rate=2000.0, off=0.05)
    speed = np.diff(case.turns) * 2000.0
    assert speed.mean() == pytest.approx(25.0 * 1.05, rel=0.08)
    expected = 0.05 if law == "wander" else 0.05 / np.sqrt(12)
    assert speed.std() / speed.mean() == pytest.approx(expected, rel=0.4)


def rippling(rng, time, share):
    """Angle of a shaft whose speed ripples at 2 to 6 Hz, its standard deviation a share of it."""
    tones = [(rng.normal(), rng.uniform(2, 6), rng.uniform(0, 6.28)) for _ in range(5)]
    speed = sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in tones)
    speed = NOMINAL * (1 + share * speed / speed.std())
    return np.concatenate([[0.0], np.cumsum(speed[1:] * np.diff(time))])


@pytest.mark.parametrize("share", [0.005, 0.01])
@pytest.mark.parametrize("seed", range(4))
def test_a_load_that_ripples_fast_is_followed_by_high_harmonics_alone(seed, share):
    """Long blocks smear them, and the low ones that would bear it are drowned."""
    rng, rate, meshes = np.random.default_rng(seed), 10_000.0, 23.0 * np.arange(1, 7)
    time = np.arange(int(DURATION * rate)) / rate
    turns = rippling(rng, time, share)
    orders = [m + r for m in meshes for r in (-2, -1, 0, 1, 2)]
    levels = np.repeat([0.02, 0.02, 0.1, 0.6, 1.0, 0.5], 5) * np.tile([0.1, 0.2, 1, 0.2, 0.1], 6)
    samples = lines_on(turns, orders, levels, rng.uniform(0, 6.28, 30))
    sums = OrderSums(samples + white((1, len(turns)), 0.7, seed=seed), rate, meshes)
    track, coherent = follow_lines(sums, constant_track(NOMINAL, time[-1]))
    assert coherent > 0.9
    error = error_of(track, turns, rate)
    assert np.quantile(np.abs(error - np.median(error)), 0.9) * 23 < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_an_angle_followed_from_far_off_is_nearly_as_good_as_one_locked_from_the_truth(
    seed,
):
    """What short blocks follow beside the speed, sidebands of slow shafts say, is left out."""
    rng, rate, meshes = np.random.default_rng(seed), 10_000.0, 23.0 * np.arange(1, 7)
    time = np.arange(int(DURATION * rate)) / rate
    turns = rippling(rng, time, 0.003)
    orders = [m + r for m in meshes for r in (-2, -1, -0.5, 0, 0.5, 1, 2)]
    beside = [0.1, 0.2, 0.3, 1, 0.3, 0.2, 0.1]
    levels = np.repeat([0.02, 0.02, 0.1, 0.6, 1.0, 0.5], 7) * np.tile(beside, 6)
    samples = lines_on(turns, orders, levels, rng.uniform(0, 6.28, 42))
    sums = OrderSums(samples + white((1, len(turns)), 0.7, seed=seed), rate, meshes)
    right = track_of(lambda time_s: np.interp(time_s, time, turns), time[-1], 400)
    tracks = follow_lines(sums, constant_track(NOMINAL, time[-1]))[0], lock_track(sums, right)[0]
    errors = [error_of(track, turns, rate) for track in tracks]
    far, near = (np.median(np.abs(error - np.median(error))) for error in errors)
    assert far < 1.6 * near


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_not_made_coherent_by_following_it(seed):
    sums = OrderSums(white((1, len(TIME)), 1.0, seed=seed), RATE, MESHES)
    assert follow_lines(sums, constant_track(NOMINAL, TIME[-1]))[1] < 0.5
