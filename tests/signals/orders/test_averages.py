"""Synchronous averages: planted patterns come back, and the stated scatter is the real one."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.synthetic_signals import (
    band_limited,
    constant_track,
    lines_on,
    track_of,
    wandering_turns,
    white,
)

from gearmon.errors import ArgumentError, RecordingError
from gearmon.signals.orders import AngleGrid, one_turn, resample_to_angle, time_synchronous_average
from gearmon.signals.tracking import find_pulses, track_from_pulses

RATE = 10_000.0


def average(samples, track, rate=RATE, **options):
    return time_synchronous_average(samples, rate, track, **options)


def tooth_pattern(teeth, seed, harmonics=4):
    """Lines of a gear: mesh harmonics, and what makes every tooth another."""
    rng = np.random.default_rng(seed)
    number = np.arange(1, harmonics * teeth + teeth // 2)
    lines = 0.05 * (rng.standard_normal(len(number)) + 1j * rng.standard_normal(len(number)))
    lines[number % teeth == 0] *= 15
    return number, lines


def heard(number, lines, turns):
    return lines_on(turns, number, np.abs(lines), np.angle(lines))


def tacho(turns, time_s):
    """A waveform that is high for a tenth of every turn."""
    distance = (turns + 0.5) % 1.0 - 0.5
    speed = np.gradient(turns, time_s)
    edge = np.clip(0.5 + distance / speed * RATE / 2, 0, 1)
    back = np.clip(0.5 + (distance - 0.1) / speed * RATE / 2, 0, 1)
    return np.where(np.abs(distance) < 0.45, edge - back, 0.0)


def correlation(found, truth):
    return float(np.corrcoef(found, truth)[0, 1])


# one per cent wander, a second stage as loud as the first, noise 20 dB down, a tacho
TIME = np.arange(int(12 * RATE)) / RATE
SECOND, OUTPUT = Fraction(23, 59), Fraction(23 * 19, 59 * 64)


@pytest.fixture(scope="module")
def train():
    """Samples and track of a train 23/59, 19/64, and the lines of its four gears."""
    turns = 0.3 + wandering_turns(TIME, 25.0, 0.01, seed=3)
    gears = [tooth_pattern(23, 1), tooth_pattern(59, 2, 2), tooth_pattern(19, 3)]
    gears.append(tooth_pattern(64, 4, 2))
    for (number, lines), teeth in ((gears[1], 59), (gears[3], 64)):
        lines[number % teeth == 0] = 0.0  # mesh harmonics stand with the mate already
    orders = (1.0, float(SECOND), float(SECOND), float(OUTPUT))
    clean = sum(heard(*own, order * turns) for own, order in zip(gears, orders, strict=True))
    samples = clean + white(clean.shape, 0.1 * clean.std(), seed=5)
    pulses = find_pulses(tacho(turns, TIME), RATE)
    return samples, track_from_pulses(pulses, 1, 1.0, TIME[-1]), gears


def truth_of(gears, rotation, found):
    """Everything that repeats with a rotation, at the angles of its average.

    A line of another gear does if it is a multiple of the rotation, as a mesh harmonic is on both
    its shafts. The track begins at the first pulse, when shaft 1 has turned once.
    """
    angle = np.arange(found.per_turn) / found.per_turn + found.first_turn + float(rotation)
    total = np.zeros(found.per_turn)
    for (number, lines), order in zip(gears, (Fraction(1), SECOND, SECOND, OUTPUT), strict=True):
        ratio = order / rotation
        chosen = number % ratio.denominator == 0
        multiple = (number[chosen] * ratio.numerator) // ratio.denominator
        total += heard(multiple, lines[chosen], angle)[0]
    return total


@pytest.mark.parametrize(
    ("rotation", "turns", "bar"), [(Fraction(1), 298, 0.999), (SECOND, 115, 0.999), (OUTPUT, 34, 0)]
)
def test_planted_pattern_comes_back(train, rotation, turns, bar):
    samples, track, gears = train
    found = average(samples, track, rotation_order=rotation)
    truth = truth_of(gears, rotation, found)
    assert found.turns >= turns
    # of few turns other shafts leave more than the bar allows; what is left is what is stated
    deviation = np.sqrt(np.mean((found.waveform[0] - truth) ** 2))
    assert deviation < 1.2 * np.sqrt(np.mean(found.waveform_error**2))
    assert correlation(found.waveform[0], truth) > bar


def test_lines_lie_within_their_errors(train):
    samples, track, gears = train
    found = average(samples, track)
    own = Fraction(1)
    number = np.arange(1, found.top)
    truth = np.fft.rfft(truth_of(gears, own, found))[number] * 2 / found.per_turn
    away = np.abs(found.lines[0, number] - truth) / found.line_error[0, number]
    assert np.sqrt(np.mean(away**2)) < 1.3


@pytest.mark.parametrize("order", [Fraction(1), Fraction(31, 12), Fraction(20, 82), 0.3777])
def test_planets_and_any_other_rotation(order):
    time = np.arange(40_000) / 4000.0
    turns = wandering_turns(time, 12.0, 0.01, seed=8)
    track = track_of(lambda t: wandering_turns(t, 12.0, 0.01, seed=8), time[-1], 600)
    number, lines = tooth_pattern(17, 7, 2)
    found = average(heard(number, lines, float(order) * turns), track, 4000.0, rotation_order=order)
    np.testing.assert_allclose(found.lines[0, number], lines, atol=2e-3)
    assert found.rotation_order == float(order)


class TestEqualsTheSlowVersion:
    def turns(self, samples, track, steps, order=1.0, rate=RATE):
        shaft = track.of_shaft(order)
        found = average(samples, track, rate, rotation_order=order)
        values = resample_to_angle(
            samples,
            rate,
            shaft,
            AngleGrid(
                per_turn=steps, first_turn=float(found.first_turn), count=found.turns * steps
            ),
        )
        return found, values.reshape(len(samples), found.turns, steps)

    def test_mean_over_the_turns(self):
        track = track_of(lambda t: wandering_turns(t, 25.0, 0.01), 4.0, 200)
        samples = band_limited(2, 40_000, 0.4)
        steps = average(samples, track).per_turn
        found, turns = self.turns(samples, track, steps)
        lines = np.fft.rfft(turns.mean(axis=1)) / steps * 2
        lines[:, 0] /= 2
        np.testing.assert_allclose(found.lines, lines[:, : found.top + 1], atol=1e-12)

    @pytest.mark.parametrize("turns", [2, 3, 9, 16])
    def test_scatter_over_few_turns(self, turns):
        # whole turns and nothing but whole lines below the top: the record is periodic
        count = 400 * turns
        record = np.fft.irfft(
            np.where(np.arange(count // 2 + 1) < 0.4 * count, np.fft.rfft(white(count, seed=3)), 0)
        )
        samples = np.concatenate([record, record[:1]])[None]
        track = constant_track(25.0, (len(samples[0]) - 1) / RATE)
        found, each = self.turns(samples, track, 400)
        assert found.turns == turns
        expected = each.std(axis=1, ddof=1) / np.sqrt(turns)
        np.testing.assert_allclose(found.waveform_error, expected, rtol=0.02, atol=1e-3)


class TestScatterIsTheRealOne:
    """Monte Carlo: what repeated recordings scatter by is what each of them states."""

    def repeated(self, make, count=80, rate=2000.0, seconds=8.0, order=1):
        track = constant_track(20.0, seconds)
        size = int(seconds * rate) + 1
        found = [average(make(k, size), track, rate, rotation_order=order) for k in range(count)]
        lines = np.array([own.lines[0] for own in found])
        waves = np.array([own.waveform[0] for own in found])
        line_error = np.sqrt(np.mean([own.line_error[0] ** 2 for own in found], axis=0))
        wave_error = np.sqrt(np.mean([own.waveform_error[0] ** 2 for own in found], axis=0))
        return lines.std(axis=0), line_error, waves.std(axis=0), wave_error

    def test_of_white_noise(self):
        seen, stated, wave, wave_stated = self.repeated(lambda k, n: white((1, n), seed=k))
        # 2 degrees of freedom a line and recording: 80 of them scatter by 1/sqrt(4 * 80)
        np.testing.assert_allclose(stated[1:], seen[1:], rtol=0.3)
        assert stated[1:].mean() == pytest.approx(seen[1:].mean(), rel=0.03)
        assert stated[0] == pytest.approx(seen[0], rel=0.3)
        assert wave_stated.mean() == pytest.approx(wave.mean(), rel=0.03)
        # 91 of 100 lines a turn are kept
        assert wave_stated.mean() == pytest.approx(np.sqrt(0.91 / 159), rel=0.03)

    def test_of_noise_in_one_part_of_the_turn(self):
        # impacts of random size at one angle: the error is large there and nowhere else
        def make(k, n):
            phase = 20.0 * np.arange(n) / 2000.0 % 1.0
            return white((1, n), seed=k) * np.where(np.abs(phase - 0.5) < 0.1, 1.0, 0.05)

        _, _, wave, stated = self.repeated(make, count=60)
        quiet, loud = np.r_[0:30, 75:100], np.arange(45, 55)
        assert stated[loud].mean() == pytest.approx(wave[loud].mean(), rel=0.1)
        assert stated[quiet].mean() == pytest.approx(wave[quiet].mean(), rel=0.15)
        assert stated[quiet].mean() < 0.15 * stated[loud].mean()

    def test_of_a_load_that_drifts_over_many_turns(self):
        # turns are not independent: the usual s / sqrt(N) would state a third of the truth
        def make(k, n):
            rng = np.random.default_rng(k)
            steps = rng.standard_normal(n // 400 + 2)
            slow = np.interp(np.arange(n), 400 * np.arange(len(steps)), steps)
            return ((1 + 0.3 * slow) * np.cos(2 * np.pi * 5 * 20.0 * np.arange(n) / 2000.0))[None]

        seen, stated, _, _ = self.repeated(make, count=60)
        usual = 0.3 * np.sqrt(2 / 3) / np.sqrt(159)
        assert seen[5] > 1.6 * usual
        assert stated[5] == pytest.approx(seen[5], rel=0.35)

    def test_a_line_of_another_shaft_leaks_no_more_than_is_stated(self):
        def make(k, n):
            angle = 20.0 * np.arange(n) / 2000.0
            return lines_on(angle, 7.03, 1.0, k) + white((1, n), 0.01, seed=k)

        seen, stated, _, _ = self.repeated(make, count=40)
        assert stated[7] > 0.5 * seen[7]


def test_own_multiples_do_not_scatter():
    track = constant_track(20.0, 10.0)
    samples = lines_on(20.0 * np.arange(20_001) / 2000.0, [3, 7], [1.0, 2.0])
    found = average(samples, track, 2000.0)
    np.testing.assert_allclose(found.amplitude[0, [3, 7]], [1.0, 2.0], rtol=1e-9)
    assert found.line_error.max() < 1e-9
    assert found.waveform_error.max() < 1e-9


def test_waveform_is_its_lines():
    track = constant_track(20.0, 4.0)
    found = average(white((2, 8001), seed=1), track, 2000.0)
    angle = np.arange(found.per_turn) / found.per_turn
    number = np.arange(found.top + 1)
    direct = (found.lines[:, :, None] * np.exp(2j * np.pi * number[:, None] * angle)).sum(1).real
    np.testing.assert_allclose(found.waveform, direct, atol=1e-12)
    np.testing.assert_allclose(one_turn(found.lines, 501).mean(axis=1), found.lines[:, 0].real)


def test_fewer_values_a_turn_leave_lines_out_and_fold_none():
    track = constant_track(20.0, 4.0)
    samples = white((1, 8001), seed=2)
    whole, coarse = average(samples, track, 2000.0), average(samples, track, 2000.0, per_turn=31)
    assert coarse.waveform.shape == (1, 31)
    assert coarse.top == 15
    np.testing.assert_allclose(coarse.lines, whole.lines[:, :16], atol=1e-12)
    np.testing.assert_allclose(coarse.line_error, whole.line_error[:, :16], rtol=1e-9)
    # the lower band has its share of the power of white noise
    share = np.mean(coarse.waveform_error**2) / np.mean(whole.waveform_error**2)
    assert share == pytest.approx(31 / 91, rel=0.1)


@given(st.floats(-1e3, 1e3).filter(lambda v: abs(v) > 1e-3), st.integers(0, 1000))
def test_scale_and_channels(factor, seed):
    track = constant_track(20.0, 1.0)
    samples = white((2, 2001), seed=seed)
    one = average(samples, track, 2000.0)
    two = average(factor * samples[::-1], track, 2000.0)
    np.testing.assert_allclose(two.waveform, factor * one.waveform[::-1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(two.line_error, abs(factor) * one.line_error[::-1], rtol=1e-7)


def test_too_few_turns_for_a_scatter_are_refused():
    track = constant_track(20.0, 160 / 2000.0)
    with pytest.raises(RecordingError, match="1; an average with its scatter needs 2"):
        average(np.zeros((1, 161)), track, 2000.0)


def test_lines_of_other_rotations_leak_as_equal_turns_let_them():
    track = constant_track(20.0, 10.0)
    angle = 20.0 * np.arange(20_001) / 2000.0
    found = average(lines_on(angle, [3, 7.3037], [1.0, 5.0], 0.4), track, 2000.0)
    bound = 5.0 / (found.turns * np.sin(np.pi * 0.3037))
    assert 1e-3 < abs(found.amplitude[0, 7]) < bound
    assert found.amplitude[0, 3] == pytest.approx(1.0, abs=bound)


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        ({"rotation_order": 0}, "shaft_order"),
        ({"rotation_order": -1.0}, "shaft_order"),
        ({"per_turn": 3}, "per_turn=3"),
        ({"per_turn": 99.5}, "per_turn=99.5"),
    ],
)
def test_impossible_requests_are_refused(given_, words):
    with pytest.raises(ArgumentError, match=words):
        average(np.zeros((1, 4001)), constant_track(20.0, 2.0), 2000.0, **given_)


@pytest.mark.parametrize("away", [1, 3, 5])
def test_what_stands_below_a_line_tells_its_error_as_what_stands_above(away):
    turns = 64
    place = np.arange(64 * 250) / 250
    pair = [2.0 * np.cos(2 * np.pi * (7 + side * away / turns) * place) for side in (-1, 1)]
    found = average(np.array(pair), constant_track(40.0, turns / 40.0), rate=40.0 * 250)
    assert found.turns >= turns - 1
    below, above = found.line_error[:, 7]
    assert below == pytest.approx(above, rel=0.05)
    # of eight neighbours on either side one holds the tone: 2^2 / 16 is the mean power
    assert below == pytest.approx(0.5, rel=0.1)
