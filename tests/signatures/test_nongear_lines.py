"""Lines that no gear explains: found where they are, nowhere else, locked to the right thing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.nongear_cases import (
    RATE_HZ,
    SPEED_HZ,
    bearing_order,
    heard,
    impacts,
    recorded,
    train,
)
from reference.simulated_machines import planetary
from reference.synthetic_signals import track_of, white
from scipy.signal import bilinear, lfilter

from gearmon.files import restored, stored
from gearmon.gears.kinematics import kinematics
from gearmon.signals.orders import InAngle, fine_order_spectrum
from gearmon.signatures.measured.line_plan import distance_to, known_orders
from gearmon.signatures.measured.nongear_lines import (
    _DELAY_S,
    NonGearLines,
    _Course,
    _highest_within,
    _noise_grid,
    noise_exceeds,
    nongear_lines,
)
from gearmon.signatures.measured.reference import taken

TURNING = (3.27, 7.61, 40.37)


def test_a_machine_of_gears_alone_has_none():
    cases = [(seed, wander) for seed in range(3) for wander in (0.0, 0.005)]
    found = [heard(seed, machine_seed=seed, wander=wander) for seed, wander in cases]
    # a peak of mere noise is listed once in twenty spectra, and never stands high
    assert sum(map(len, found)) <= 2
    for lines in found:
        for line in lines:
            assert max(line.over_noise_db) < lines.grid(line.kind).least_db + 2.0


@pytest.mark.parametrize("seed", range(2))
def test_lines_are_found_at_their_places_with_their_levels(seed):
    found = heard(seed, orders=TURNING, level=0.05)
    assert sorted(round(line.order, 1) for line in found) == [3.3, 7.6, 40.4]
    for line in found:
        assert np.min(np.abs(line.order - np.array(TURNING))) < 0.01
        np.testing.assert_allclose(line.level_db, 20 * np.log10(0.05), atol=1.5)
        assert line.frequency_hz == pytest.approx(line.order * found.speed_hz)


def test_what_follows_the_shaft_is_told_from_what_does_not():
    found = heard(1, orders=(40.37, 23.77), tones_hz=(777.7, 100.0), wander=0.01)
    locks = {round(line.frequency_hz / SPEED_HZ): line.locked for line in found}
    assert locks[40] == locks[24] == "shaft"
    assert locks[4] == locks[31] == "time"
    assert len(found) == 4
    for line in found:
        if line.locked == "time":
            assert min(abs(line.frequency_hz - hertz) for hertz in (777.7, 100.0)) < 0.1
            assert line.low_order < line.order < line.high_order


def test_an_even_speed_leaves_the_lock_open():
    found = heard(1, orders=(40.37,), tones_hz=(100.0,), wander=0.0)
    assert {line.locked for line in found} == {"either"}


def test_a_line_that_modes_move_while_the_speed_rises_is_its_gears_own():
    """Two modes that beat answer most after a while: on a ramp the line comes late."""
    rate, last_s = 6000.0, 20.0
    time_s = np.arange(round(rate * last_s)) / rate

    def turns(at_s):
        return 18.0 * at_s + 0.3 * at_s**2

    order = 3 * float(train().meshes[0].order)
    source, moved = np.cos(2 * np.pi * order * turns(time_s)), np.zeros(len(time_s))
    for sign, mode_hz in ((1.0, 1600.0), (-1.0, 1640.0)):
        w = 2 * rate * np.tan(np.pi * mode_hz / rate)  # as the bilinear transform warps it
        moved += sign * lfilter(*bilinear([w * w], [1, 2 * 0.02 * w, w * w], rate), source)
    samples = np.stack([moved, moved]) + 0.1 * white((2, len(time_s)), seed=2)
    vibration = InAngle.of(samples, rate, track_of(turns, last_s, 400))
    spectrum = fine_order_spectrum(vibration)
    away = abs(spectrum.step * np.argmax(spectrum.power[0]) - order)
    assert away > 3 * spectrum.width
    found = nongear_lines(vibration, train(), spectrum)
    assert [line.order for line in found if line.kind == "spectrum"] == []


def drift(size):
    """Random walk of a sensor: its spectrum falls with the square of the frequency."""

    def added(time_s, _, generator):
        walk = np.cumsum(generator.standard_normal(len(time_s)))
        return size * (walk - walk.mean()) / walk.std()

    return added


def test_drift_of_a_sensor_is_no_line_and_hides_none_above_it():
    found = [heard(seed, machine_seed=seed, added=drift(3.0)) for seed in range(4)]
    assert sum(line.kind == "spectrum" for lines in found for line in lines) <= 1
    slow = [heard(seed, added=drift(3.0), tones_hz=(6.9,), level=0.7) for seed in range(4)]
    for lines in slow:
        [tone] = [line for line in lines if line.kind == "spectrum"]
        # half a width, and the drift under it
        assert tone.frequency_hz == pytest.approx(6.9, abs=1 / 12)
        np.testing.assert_allclose(tone.level_db, 20 * np.log10(0.7), atol=2.5)


def test_impacts_that_slip_show_in_the_envelope():
    found = heard(2, added=impacts("BPFO", 0.5))
    orders = [line.order for line in found if line.kind == "envelope"]
    wanted = 0.99 * bearing_order("BPFO")
    assert min(abs(order - wanted) for order in orders) < 0.01 * wanted


def test_gain_moves_levels_alone():
    one, other = (heard(1, orders=TURNING, gain=gain) for gain in (1.0, 100.0))
    assert [line.order for line in one] == [line.order for line in other]
    for line, louder in zip(one, other, strict=True):
        np.testing.assert_allclose(np.subtract(louder.level_db, line.level_db), 40.0, atol=1e-6)
        np.testing.assert_allclose(louder.over_noise_db, line.over_noise_db, atol=1e-6)


@pytest.mark.parametrize("of_train", [train(), kinematics(planetary())])
def test_known_orders_hold_shafts_meshes_and_sidebands(of_train):
    known = known_orders(of_train, 200.0, 0.005)
    assert np.all(np.diff(known) > 0)
    for shaft in of_train.shafts:
        assert distance_to(known, np.array([shaft.order, 7 * shaft.order])).max() < 1e-6
    for mesh in of_train.meshes:
        for family in mesh.modulations:
            near = [k * mesh.order + r * float(family.exact) for k in (1, 2) for r in (-2, 3)]
            assert distance_to(known, np.array([x for x in near if x > 0])).max() < 1e-6


@pytest.mark.parametrize("pieces", [1, 4])
def test_noise_law(pieces):
    generator = np.random.default_rng(4)
    power = generator.exponential(size=(pieces, 200_000)).mean(axis=0)
    for ratio in (0.5, 2.0, 4.0):
        assert np.mean(power > ratio) == pytest.approx(noise_exceeds(ratio, pieces), abs=3e-3)


def test_storage_gives_back_every_bit():
    for known in (heard(1, orders=TURNING, tones_hz=(100.0,)), heard(3)):
        arrays = {}
        back = restored(NonGearLines, stored(known, arrays), arrays)
        assert back.lines == known.lines
        assert (back.speed_hz, back.cell_hz) == (known.speed_hz, known.cell_hz)
        np.testing.assert_array_equal(back.in_time_db, known.in_time_db)
        for one, other in zip(back.grids, known.grids, strict=True):
            np.testing.assert_array_equal(one.noise_db, other.noise_db)
            np.testing.assert_array_equal(one.hidden_db, other.hidden_db)
            assert (one.kind, one.width, one.pieces) == (other.kind, other.width, other.pieces)
            assert (one.least_db, one.looked_at) == (other.least_db, other.looked_at)


@pytest.mark.parametrize("kind", [np.float32, np.int64, np.complex128])
def test_numbers_of_another_kind_are_not_restored(kind):
    arrays = {}
    told = stored(heard(3), arrays)
    name = next(name for name, own in arrays.items() if own.dtype == np.float64)
    with pytest.raises(ValueError, match="cannot be"):
        restored(NonGearLines, told, arrays | {name: arrays[name].astype(kind)})


def test_a_silent_channel_changes_nothing():
    samples, track = recorded(1, orders=TURNING)
    silent = np.vstack([samples, np.zeros(samples.shape[-1])])
    one, other = (
        nongear_lines(x, train(), fine_order_spectrum(x))
        for x in (InAngle.of(own, RATE_HZ, track) for own in (samples, silent))
    )
    assert [line.order for line in one] == [line.order for line in other]
    assert all(np.isfinite(line.level_db).all() for line in other)


def test_a_line_is_judged_in_the_channel_in_which_it_is_clear():
    """Beside a far louder one that hears noise alone, as of a sensor in another unit."""
    samples, track = recorded(1, orders=(40.37,), tones_hz=(777.7,), wander=0.01)
    noise = np.random.default_rng(3).standard_normal(samples.shape[-1])
    found = []
    for size in (0.1, 1e4):
        x = InAngle.of(np.vstack([samples[:1], size * noise]), RATE_HZ, track)
        found.append(nongear_lines(x, train(), fine_order_spectrum(x)))
    quiet, loud = ([(line.order, line.locked) for line in own] for own in found)
    assert quiet == loud
    assert {locked for _, locked in loud} == {"shaft", "time"}


def test_of_very_many_lines_the_clearest_are_listed(monkeypatch):
    everything = heard(1, orders=TURNING, level=[0.2, 0.05, 0.02])
    monkeypatch.setattr("gearmon.signatures.measured.nongear_lines.MOST_LINES", 2)
    known = heard(1, orders=TURNING, level=[0.2, 0.05, 0.02])
    assert known.lines == everything.lines[:2]
    assert known.grid("spectrum").least_db == max(everything.lines[2].over_noise_db)


def test_pairs_about_a_far_stronger_line_are_its_modulation_and_no_lines():
    """A swing of the angle sets such pairs; of one line alone something else is the source."""
    beside = {"pair": (41.6, 41.4), "above": (41.6,), "below": (41.4,)}
    for name, orders in beside.items():
        found = heard(2, orders=(41.5, *orders), level=[0.5] + [0.08] * len(orders), wander=0.0)
        shown = [round(line.order, 1) for line in found if line.kind == "spectrum"]
        assert sorted(shown) == sorted({41.5, *(orders if name != "pair" else ())}), name


def test_what_the_angle_does_not_tell_hides_lines_beside_strong_ones():
    """Of a line of order n an angle off by e turns sets (2 pi n e)^2 of its power about it."""
    samples, track = recorded(1, orders=(33.3,), level=2.0, wander=0.0)
    found = {}
    for turns in (1e-6, 1e-3):
        x = InAngle.of(samples, RATE_HZ, replace(track, uncertainty_turns=turns))
        (grid, _) = nongear_lines(x, train(), fine_order_spectrum(x)).grids
        cell = int(33.45 * grid.hidden_db.shape[-1] / grid.top)
        found[turns] = 10 ** (grid.hidden_db[0, cell] / 10)
    more = (2 * np.pi * 33.45 * 1e-3) ** 2 * 2.0**2
    assert found[1e-3] - found[1e-6] == pytest.approx(more, rel=0.1)


@pytest.mark.parametrize("duration_s", [0.3, 1.0])
def test_short_recordings_do(duration_s):
    known = heard(1, orders=TURNING, duration_s=duration_s)
    assert known.in_time_db.shape[-1] * known.cell_hz < RATE_HZ / 2 + 2 * known.cell_hz
    assert np.isfinite(known.in_time_db).all()


def test_channels_can_be_taken_out():
    known = heard(1, orders=TURNING)
    turned = taken(known, [1, 0])
    assert [line.level_db[::-1] for line in turned] == [line.level_db for line in known]
    assert len(taken(known, [1]).lines[0].level_db) == 1
    assert taken(known, [1]).grid("envelope").noise_db.shape[0] == 1


def test_every_channel_is_one_more_place_where_noise_may_peak():
    samples, track = recorded(3)
    one, two = (
        nongear_lines(part, train(), fine_order_spectrum(part)).grids[0]
        for part in (InAngle.of(own, RATE_HZ, track) for own in (samples[:1], samples))
    )
    assert two.looked_at == pytest.approx(2 * one.looked_at)
    assert two.least_db > one.least_db


@given(st.lists(st.integers(0, 40), min_size=1, max_size=30), st.integers(0, 20))
def test_the_highest_about_a_place_is_that_of_the_places_within_reach(reach, more):
    values = np.random.default_rng(len(reach)).normal(size=(2, len(reach) + more))
    found = _highest_within(values, np.array(reach))
    parts = [values[:, max(0, k - own) : k + own + 1] for k, own in enumerate(reach)]
    np.testing.assert_array_equal(found, np.array([part.max(axis=1) for part in parts]).T)


@pytest.mark.parametrize("seed", range(4))
def test_lines_are_moved_by_the_rate_at_which_the_speed_changes_whatever_the_duration(seed):
    """A speed that grows as exp(a t) changes by the share a each second throughout."""
    rng = np.random.default_rng(seed)
    rate, speed, duration = rng.uniform(0.01, 0.1), rng.uniform(5, 50), rng.uniform(1, 20)

    def turns(time_s):
        return speed * np.expm1(rate * time_s) / rate

    course = _Course(track_of(turns, duration, 4001))
    assert course.moved == pytest.approx(rate * _DELAY_S, rel=1e-2)
    assert course.low == pytest.approx(speed, rel=3e-3)
    assert course.high == pytest.approx(speed * np.exp(rate * duration), rel=3e-3)
    assert course.mean == pytest.approx(turns(duration) / duration, rel=1e-6)


def test_a_speed_that_dips_hides_as_much_as_one_that_rises_as_far():
    track = track_of(lambda time_s: 25.0 * time_s, 4.0, 401)
    samples = white((2, 24_000), 1.0, seed=2)
    spectrum = fine_order_spectrum(InAngle.of(samples, RATE_HZ, track), 1)
    in_time = np.zeros_like(_noise_grid("spectrum", spectrum, _Course(track)).hidden_db)
    in_time[:, :: max(1, in_time.shape[1] // 7)] = 1e3
    hidden = []
    for low, high in ((0.8, 1.0), (1.0, 1.2), (1.0, 1.0)):
        course = _Course(track)
        course.low, course.high = low * course.mean, high * course.mean
        hidden.append(_noise_grid("spectrum", spectrum, course, in_time).hidden_db)
    np.testing.assert_array_equal(hidden[0], hidden[1])
    assert hidden[0].mean() > hidden[2].mean()


@pytest.mark.parametrize("order", [6.0, 30.0, 90.0])
@pytest.mark.parametrize("swing", [0.02, 0.1])
def test_a_line_that_stands_still_in_time_hides_the_orders_that_it_sweeps(order, swing):
    """Those of its order times the swing of the speed to both sides, and at most twice as far."""
    track = track_of(lambda time_s: 25.0 * time_s, 4.0, 401)
    samples = white((1, 24_000), 1.0, seed=2)
    spectrum = fine_order_spectrum(InAngle.of(samples, RATE_HZ, track), 1)
    course = _Course(track)
    course.low, course.high = (1 - swing) * course.mean, (1 + swing) * course.mean
    plain = _noise_grid("spectrum", spectrum, course).hidden_db
    cells = plain.shape[-1] / spectrum.top
    in_time = np.zeros_like(plain)
    in_time[:, int(order * cells)] = 1e6
    hidden = _noise_grid("spectrum", spectrum, course, in_time).hidden_db
    (swept,) = np.nonzero(hidden[0] > plain[0])
    np.testing.assert_allclose(hidden[0, swept], 10 * np.log10(1e6 / 2), atol=1e-3)
    low, high = (swept[0] / cells, (swept[-1] + 1) / cells)
    assert low <= order / (1 + swing) + 1 / cells
    assert high >= order / (1 - swing) - 1 / cells
    margin = 2 * (1 / cells + 2 * spectrum.width) + 2 / cells
    assert low >= order / (1 + 2 * swing) - margin
    assert high <= order / (1 - 2 * swing) + margin
