"""Order maps: lines locked to a shaft stand upright and read their amplitude in every row."""

from __future__ import annotations

import numpy as np
import pytest
from reference.synthetic_signals import constant_track, lines_on, track_of, white

from gearmon.errors import ArgumentError
from gearmon.signals.orders import AngleGrid, order_map, resample_to_angle
from gearmon.signals.orders import spectra as module
from gearmon.signals.spectra import amplitude_spectrum

RATE, DURATION = 4000.0, 30.0
TIME = np.arange(int(RATE * DURATION)) / RATE


def ramp(time_s):
    """From 20 to 40 Hz in half a minute."""
    return 20.0 * time_s + time_s**2 / 3


TRACK = track_of(ramp, TIME[-1], 2000)
LOCKED = lines_on(ramp(TIME), [7.0, 20.5], [3.0, 1.0])


@pytest.mark.parametrize("against", ["time", "speed"])
@pytest.mark.parametrize("name", ["hann", "flat-top"])
def test_locked_line_reads_its_amplitude_at_every_speed(against, name):
    found = order_map(LOCKED, RATE, TRACK, top=30.0, against=against, window_name=name)
    for order, amplitude in ((7.0, 3.0), (20.5, 1.0)):
        near = np.abs(found.order - order) < 0.2
        peak = found.amplitude[:, 0, near].max(axis=1)
        # a Hann window reads up to 15 % less between two bins, a flat-top next to nothing
        lowest = 0.84 if name == "hann" else 0.99
        assert peak.min() > lowest * amplitude
        assert peak.max() < 1.005 * amplitude


def test_time_and_speed_of_the_rows():
    found = order_map(LOCKED, RATE, TRACK, top=30.0)
    np.testing.assert_allclose(found.speed_hz, 20.0 + 2 / 3 * found.time_s, rtol=1e-3)
    # evenly in angle is not evenly in time: rows are as long as their blocks, not as their mean
    assert np.all(np.diff(found.time_s) > 0)
    np.testing.assert_allclose(found.low[1:], found.high[:-1], rtol=1e-9)
    assert np.all(found.blocks == 1)
    for most in (200, 7):
        found = order_map(LOCKED, RATE, TRACK, top=30.0, rows=most)
        assert len(found.low) <= most
        lasting = (found.high - found.low) / found.blocks
        np.testing.assert_allclose(lasting, lasting[0], rtol=1e-9)


def test_rows_of_speed_are_equal_and_hold_their_blocks():
    found = order_map(LOCKED, RATE, TRACK, top=30.0, against="speed", block_turns=10.0)
    assert 20 < len(found.low) <= 60
    np.testing.assert_allclose(found.high - found.low, found.high[0] - found.low[0], rtol=1e-9)
    assert np.all((found.low <= found.speed_hz) & (found.speed_hz <= found.high))
    assert found.low[0] == pytest.approx(20.0, rel=0.02)
    assert found.high[-1] == pytest.approx(40.0, rel=0.02)
    over_time = order_map(LOCKED, RATE, TRACK, top=30.0, block_turns=10.0)
    assert found.blocks.sum() == over_time.blocks.sum()
    np.testing.assert_allclose(found.mean, over_time.mean, rtol=1e-9)


def test_a_line_of_fixed_frequency_slants():
    samples = np.cos(2 * np.pi * 300.0 * TIME)[None]
    found = order_map(samples, RATE, TRACK, top=30.0, against="speed", block_turns=4.0)
    top = found.order[found.amplitude[:, 0].argmax(axis=1)]
    np.testing.assert_allclose(top, 300.0 / found.speed_hz, rtol=0.03)


def test_speeds_never_driven_have_no_row():
    def turns(time_s):
        return np.where(time_s < 15.0, 20.0 * time_s, 300.0 + 30.0 * (time_s - 15.0))

    track = track_of(turns, TIME[-1], 3000)
    samples = lines_on(turns(TIME), [5.0], [1.0])
    found = order_map(samples, RATE, track, top=10.0, against="speed", block_turns=8.0)
    assert len(found.low) < (found.high[-1] - found.low[0]) / (found.high[0] - found.low[0]) - 3
    assert np.all(found.blocks > 0)


def test_steady_speed_is_one_row():
    track = constant_track(20.0, TIME[-1])
    found = order_map(LOCKED, RATE, track, top=30.0, against="speed")
    assert len(found.low) == 1
    assert found.low[0] < 20.0 < found.high[0]


@pytest.mark.parametrize("ratio", [0.4, 1.0, 57 / 23])
def test_orders_of_another_shaft(ratio):
    found = order_map(LOCKED, RATE, TRACK, shaft_order=ratio, top=18.0)
    peak = found.order[found.mean[0].argmax()]
    assert peak == pytest.approx(7.0 / ratio, abs=found.order[1])
    np.testing.assert_allclose(found.speed_hz, ratio * (20.0 + 2 / 3 * found.time_s), rtol=1e-3)
    assert found.order[-1] == pytest.approx(18.0, abs=found.order[1])


def test_equals_blocks_taken_one_by_one(monkeypatch):
    monkeypatch.setattr(module, "TIME_ROWS", 4)
    samples = white((2, 40_000), seed=1)
    track = track_of(ramp, 10.0, 500)
    found = order_map(samples, RATE, track, top=30.0, block_turns=20.0)
    grid = AngleGrid.of(40_000, RATE, track, 30.0)
    block = round(found.block_turns * grid.per_turn)
    powers = []
    for start in range(0, grid.count - block + 1, block // 2):
        turn = grid.first_turn + start / grid.per_turn
        part = resample_to_angle(
            samples, RATE, track, AngleGrid(per_turn=grid.per_turn, first_turn=turn, count=block)
        )
        centred = part - part.mean(axis=-1, keepdims=True)
        powers.append(amplitude_spectrum(centred, 1.0, length=block).values ** 2)
    bins = len(found.order)
    together = -(-len(powers) // 4)
    for row, amplitude in enumerate(found.amplitude):
        own = powers[row * together : (row + 1) * together]
        np.testing.assert_allclose(amplitude, np.sqrt(np.mean(own, axis=0))[:, :bins], rtol=1e-10)
    assert found.blocks.sum() == len(powers)


@pytest.mark.parametrize("ratio", [0.4, 1.0, 57 / 23])
@pytest.mark.parametrize("name", ["hann", "flat-top", "rectangular"])
def test_level_of_noise_follows_the_resolution(name, ratio):
    # amplitude of a bin of white noise: sqrt(2 * density * noise bandwidth * 2)
    track = constant_track(20.0, TIME[-1])
    noise = white((1, len(TIME)), seed=2)
    found = order_map(noise, RATE, track, top=90.0 / ratio, shaft_order=ratio, window_name=name)
    bandwidth_hz = found.resolution * ratio * 20.0
    expected = np.sqrt(2 * (2 / RATE) * bandwidth_hz)
    assert np.sqrt(np.mean(found.mean[0, 5:] ** 2)) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"against": "load"}, "against='load'"),
        ({"rows": 0}, "rows=0"),
        ({"top": 1e4}, "highest order 10000.0 must"),
        ({"top": -1.0}, "highest order -1.0 must"),
        ({"block_turns": 0.0}, "block_turns"),
        ({"shaft_order": 0.0}, "shaft_order"),
        ({"window_name": "hamming"}, "hamming"),
    ],
)
def test_impossible_maps_are_refused(given, words):
    with pytest.raises(ArgumentError, match=words):
        order_map(LOCKED, RATE, TRACK, **given)
