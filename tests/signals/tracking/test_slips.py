"""Slips of an angle that was heard: planted ones are found, and the stated uncertainty holds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.speed_cases import make_case
from reference.synthetic_signals import lines_on, wandering_turns, white

from gearmon.benchmark.detection_machines import Condition, Setting, draw_machine
from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders import OrderSums
from gearmon.signals.tracking import check_slips
from gearmon.signals.tracking.comb import Comb
from gearmon.signals.tracking.phases import (
    LostStretch,
    SlipCheck,
    _led_over,
    _stretches,
    mend_slips,
)
from gearmon.signatures.speed_channels import track_recording

RATE, DURATION, SPEED = 5000.0, 12.0, 25.0
TIME = np.arange(int(RATE * DURATION)) / RATE
FIRST, SECOND = 31.0, 31.0 / 64.0 * 23.0
MESH = np.array([1.0, 2.0, 3.0])
LOW = np.arange(1.0, 7.0)


def machine(turns, meshes=(FIRST, SECOND), shaft=0.0, noise=0.2, seed=0):
    """Harmonics of meshes with sidebands of shaft 1, low harmonics of the shaft, and noise."""
    generator = np.random.default_rng(seed)
    orders = [h * mesh + r for mesh in meshes for h in MESH for r in (-1, 0, 1)]
    levels = [level / h for _ in meshes for h in MESH for level in (0.2, 1.0, 0.2)]
    orders, levels = [*orders, *LOW], [*levels, *([shaft] * len(LOW))]
    signal = lines_on(turns, orders, levels, generator.uniform(0, 6.28, len(orders)))
    return signal + white((1, len(turns)), noise, seed=seed)


def track_with(turns, slip_turns=0.0, at_s=6.0, lasting_s=0.6):
    """The true angle, on which a slip comes evenly."""
    knots = np.linspace(0.0, TIME[-1], 600)
    error = slip_turns * np.clip((knots - at_s) / lasting_s, 0, 1)
    return AngleTrack(
        time_s=knots,
        turns=np.interp(knots, TIME, turns) + error,
        method="comb",
        uncertainty_turns=0.0,
    )


def sums_of(samples, meshes=(FIRST, SECOND)):
    return OrderSums(samples, RATE, np.sort(np.outer(meshes, MESH).ravel()))


@pytest.mark.parametrize("wander", [0.0, 0.01])
def test_the_true_angle_is_locked(wander):
    turns = wandering_turns(TIME, SPEED, wander, seed=1)
    check = check_slips(sums_of(machine(turns)), track_with(turns))
    assert check.locked
    assert check.lost == ()
    assert check.coherence.min() > 0.7
    assert check.typical_turns() * FIRST < 0.02


@pytest.mark.parametrize(
    "beside", [FIRST + 0.01, SECOND - 0.01], ids=["drowned by a followed line", "by none followed"]
)
def test_a_line_that_is_another_ones_does_not_make_the_angle_unsure(beside):
    """What is read a hundredth of an order beside a line turns on and on, three cycles here."""
    turns = wandering_turns(TIME, SPEED, 0.002, seed=2)
    samples, track = machine(turns), track_with(turns)
    orders = np.outer((FIRST,), MESH).ravel()
    alone = check_slips(OrderSums(samples, RATE, orders), track).typical_turns()
    both = OrderSums(samples, RATE, np.sort(np.append(orders, beside)))
    assert check_slips(both, track).typical_turns() == pytest.approx(alone, rel=0.1)
    assert FIRST * alone < 0.01


@given(
    periods=st.integers(1, 6),
    sign=st.sampled_from([-1, 1]),
    lasting_s=st.floats(0.2, 0.8),
    at_s=st.floats(2.0, 9.0),
    seed=st.integers(0, 5),
)
def test_a_slip_anywhere_is_found_and_never_measured_wrong(periods, sign, lasting_s, at_s, seed):
    turns = wandering_turns(TIME, SPEED, 0.005, seed)
    slip = sign * periods / FIRST
    # an error of the speed of 4 % at the most, as a track can have it
    lasting_s = max(lasting_s, periods / FIRST / (0.04 * SPEED))
    track = track_with(turns, slip, at_s, lasting_s)
    check = check_slips(sums_of(machine(turns, seed=seed)), track)
    assert not check.locked
    (lost,) = check.lost
    assert lost.start_s - 0.1 < at_s + 0.5 * lasting_s < lost.end_s + 0.1
    if lost.slipped_turns is not None:
        assert lost.slipped_turns == pytest.approx(slip, abs=0.1 / FIRST)
    # what is beyond the slip is as uncertain as the slip is large, what is before is not
    ends = np.sort(check.uncertainty_turns[[0, -1]])
    assert ends[0] < 0.2 / FIRST
    assert ends[1] > 0.5 * abs(slip)


@pytest.mark.parametrize("periods", [-2, 1, 3])
def test_a_second_mesh_tells_how_far_it_slipped(periods):
    turns = wandering_turns(TIME, SPEED, 0.005, seed=2)
    track = track_with(turns, periods / FIRST, lasting_s=0.2)
    check = check_slips(sums_of(machine(turns)), track)
    assert check.lost[0].slipped_turns == pytest.approx(periods / FIRST, abs=0.1 / FIRST)


@pytest.mark.parametrize("periods", [-2, 1, 3])
def test_one_mesh_alone_does_not_tell_how_far(periods):
    turns = wandering_turns(TIME, SPEED, 0.005, seed=2)
    samples = machine(turns, (FIRST,), shaft=0.3)
    track = track_with(turns, periods / FIRST, lasting_s=0.4)
    sums = sums_of(samples, (FIRST,))
    alone = check_slips(sums, track)
    assert not alone.locked
    assert alone.lost[0].slipped_turns is None


def test_lines_that_vanish_for_a_while_are_no_slip():
    turns = wandering_turns(TIME, SPEED, 0.005, seed=3)
    samples = machine(turns, noise=0.0)
    samples[:, (TIME > 5.0) & (TIME < 5.2)] *= 0.01
    check = check_slips(sums_of(samples + white(samples.shape, 0.2)), track_with(turns))
    assert len(check.lost) == 1
    assert check.lost[0].slipped_turns == 0.0
    assert check.locked
    inside = np.abs(check.time_s - 5.1) < 0.05
    assert check.uncertainty_turns[inside].min() > 5 * check.uncertainty_turns[~inside].min()
    assert check.uncertainty_turns[[0, -1]].max() * FIRST < 0.05


def fading(turns, level, seed):
    """The machine, loud lines of either mesh a fraction of an order beside its own added."""
    own = np.sort(np.outer((FIRST, SECOND), MESH).ravel())
    orders = np.concatenate([own + 0.22, own - 0.17])
    phases = np.random.default_rng(seed).uniform(0, 6.28, len(orders))
    return machine(turns, seed=seed) + lines_on(turns, orders, np.full(len(orders), level), phases)


def test_lines_that_beat_with_others_are_no_slip():
    turns = wandering_turns(TIME, SPEED, 0.005, seed=4)
    sound = 0
    for seed in range(5):
        samples = fading(turns, 0.5, seed)
        plain = check_slips(sums_of(samples), track_with(turns))
        assert np.quantile(plain.coherence, 0.1) < 0.75  # the case is one
        sound += plain.locked
    assert sound >= 4


def test_a_slip_at_the_end_is_lost():
    turns = wandering_turns(TIME, SPEED, 0.005, seed=4)
    check = check_slips(sums_of(machine(turns)), track_with(turns, 2 / FIRST, 11.6, 0.5))
    assert not check.locked
    assert check.lost[-1].end_s == pytest.approx(TIME[-1], abs=0.1)
    assert check.uncertainty_turns[-1] > 0.5 / FIRST
    assert check.uncertainty_turns[0] < 0.02 / FIRST


def test_noise_holds_no_angle():
    check = check_slips(sums_of(white((1, len(TIME)))), track_with(SPEED * TIME))
    assert not check.locked
    assert check.lost[0].turns > 0.95 * SPEED * DURATION
    assert check.typical_turns() > 1.0


@pytest.mark.parametrize(
    ("slipped", "blocks", "told"), [(0.0, 3, 1e-3), (None, 3, 8e-3), (0.0, 50, 35e-3)]
)
def test_a_short_loss_that_does_no_harm_makes_no_angle_doubtful(slipped, blocks, told):
    time_s, doubt = 0.05 * np.arange(200), np.full(200, 1e-3)
    doubt[100 : 100 + blocks] = 0.07
    lost = LostStretch(
        start_s=time_s[100], end_s=time_s[99 + blocks], turns=1.0, slipped_turns=slipped
    )
    check = SlipCheck(time_s=time_s, coherence=np.ones(200), uncertainty_turns=doubt, lost=(lost,))
    assert check.typical_turns() == pytest.approx(told, rel=0.1)


def test_the_scale_of_the_samples_does_not_matter():
    turns = wandering_turns(TIME, SPEED, 0.005, seed=5)
    samples, track = machine(turns), track_with(turns, 1 / FIRST)
    one, other = (check_slips(sums_of(factor * samples), track) for factor in (1.0, 1e5))
    np.testing.assert_allclose(other.coherence, one.coherence, atol=1e-9)
    np.testing.assert_allclose(other.uncertainty_turns, one.uncertainty_turns, rtol=1e-6)


def test_a_few_turns_are_refused():
    track = AngleTrack(
        time_s=np.array([0.0, 0.2]),
        turns=np.array([0.0, 5.0]),
        method="comb",
        uncertainty_turns=0.0,
    )
    with pytest.raises(ArgumentError, match="5 turns of shaft 1: slips show in 8 and more"):
        check_slips(sums_of(white((1, 1001))), track)


def covered(recording, machine_, turns):
    """Share of the 90 % interval that holds, of the time and of the typical uncertainty."""
    train = kinematics(machine_)
    track = track_recording(recording, machine_).track
    top = 0.45 * recording.sampling_rate_hz / float(track.speed_hz.max())
    found = {float(h * mesh.order) for mesh in train.meshes for h in range(1, 7)}
    orders = np.array(sorted(order for order in found if order < top))
    vibration = recording.vibration().samples
    check = check_slips(OrderSums(vibration, recording.sampling_rate_hz, orders), track)
    time = np.arange(len(turns)) / recording.sampling_rate_hz
    error = track.turns_at(check.time_s) - np.interp(check.time_s, time, turns)
    error -= np.median(error)
    if np.abs(error).max() * max(float(mesh.order) for mesh in train.meshes) > 0.3:
        assert not check.locked
        return None
    assert check.locked
    return np.mean(np.abs(error) < 1.645 * check.uncertainty_turns), np.sqrt(
        np.mean(error**2)
    ) / check.typical_turns()


def test_the_stated_uncertainty_covers_the_error():
    found = []
    for seed in (0, 3, 5):
        drawn = draw_machine(np.random.default_rng([seed, 5]))
        taken = drawn.take(Condition(), Setting(seed=seed))
        found.append(covered(taken.recording.vibration(), drawn.machine, taken.turns))
    for seed in range(2):
        case = make_case(seed, amount=0.01)
        found.append(covered(case.recording, case.machine, case.turns))
    shares, sizes = zip(*(one for one in found if one is not None), strict=True)
    assert len(shares) >= 3
    assert np.mean(shares) > 0.8
    assert 0.15 < np.median(sizes) < 1.5


@given(
    st.integers(-3, 3),
    st.floats(0.0, 11.0),
    st.floats(0.05, 0.35),
    st.sampled_from([(FIRST,), (FIRST, SECOND)]),
    st.integers(0, 5),
)
def test_a_slip_of_a_few_turns_is_mended_wherever_it_is(periods, at_s, lasting_s, meshes, seed):
    turns = wandering_turns(TIME, SPEED, 0.005, seed=seed)
    sums = sums_of(machine(turns, meshes, seed=seed), meshes)
    track = track_with(turns, periods / FIRST, at_s, lasting_s)
    comb = Comb(orders=sums.orders, weights=np.ones(len(sums.orders)))
    mended, check = mend_slips(sums, track, check_slips(sums, track), comb)
    assert check.locked
    at = TIME[:: int(RATE / 10)]
    error = (mended.turns_at(at) - turns[:: int(RATE / 10)]) * FIRST
    # where an end is lost too near to the edge to show, that end alone is off
    assert np.std(error[5:-5]) < 0.03


@pytest.mark.parametrize("slip_turns", [-0.3, 0.05, 0.4])
@pytest.mark.parametrize("told", [False, True])
def test_an_angle_that_is_a_cubic_is_led_over_a_slip_exactly(slip_turns, told):
    def turns(time_s):
        return SPEED * time_s + 0.1 * (time_s - 6) ** 2 + 0.05 * (time_s - 6) ** 3

    lost = LostStretch(
        start_s=6.0, end_s=6.2, turns=5.0, slipped_turns=slip_turns if told else None
    )
    led = _led_over(track_with(turns(TIME), slip_turns, lasting_s=0.2), lost)
    at = np.linspace(5.0, 7.5, 100)
    np.testing.assert_allclose(led.turns_at(at), turns(at), atol=1e-3)


def test_a_long_lost_stretch_does_not_hide_a_short_slip_elsewhere():
    coherence = np.full(200, 0.95)
    coherence[60:64], coherence[170:200] = -0.2, 0.1
    assert _stretches(coherence, 0.5) == [(60, 64), (170, 200)]


def test_of_lines_that_fade_again_and_again_only_long_stretches_are_lost():
    coherence = np.full(200, 0.95)
    coherence[5:160:20] = coherence[6:160:20] = coherence[7:160:20] = 0.2
    coherence[170:200] = 0.1
    assert _stretches(coherence, 0.5) == [(170, 200)]
    assert _stretches(np.zeros(200), 0.5) == [(0, 200)]


@given(
    at_s=st.floats(0.5, 11.0),
    turns_lost=st.floats(0.5, 8.0),
    swings=st.lists(st.tuples(st.floats(0.0, 0.25), st.floats(3.0, 20.0), st.floats(0.0, 6.3))),
    slipped=st.none() | st.floats(-0.5, 0.5),
)
def test_an_angle_that_is_led_over_a_stretch_rises_and_is_as_it_was_elsewhere(
    at_s, turns_lost, swings, slipped
):
    """However it swings beside the stretch, by less than distances of the knots or by more."""
    steady = np.arange(0.0, 300.0, 0.06)
    swinging = sum((a * np.sin(2 * np.pi * steady / b + c) for a, b, c in swings[:2]), 0.0)
    turns = np.maximum.accumulate(steady + swinging) + 1e-6 * steady
    track = AngleTrack(time_s=steady / SPEED, turns=turns, method="comb", uncertainty_turns=0.0)
    end_s = at_s + turns_lost / SPEED
    lost = LostStretch(start_s=at_s, end_s=end_s, turns=turns_lost, slipped_turns=slipped)
    led = _led_over(track, lost)
    if led is None:
        return
    before = np.linspace(0.0, at_s - 6.0 / SPEED, 50)
    np.testing.assert_allclose(led.turns_at(before), track.turns_at(before), atol=1e-6)
    behind = np.linspace(end_s + 6.0 / SPEED, 11.9, 50)
    moved = led.turns_at(behind) - track.turns_at(behind)
    np.testing.assert_allclose(moved, moved[0], atol=1e-6)
