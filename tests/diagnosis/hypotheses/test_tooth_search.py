"""Deviation from the law and matched search on patterns of lines whose content is known."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.gear_departures import complex_noise, held_against, weights
from reference.gear_departures import gear as departing
from scipy.stats import gamma as gamma_law

from gearmon.diagnosis.hypotheses.mesh_harmonics import (
    _at_mesh,
    log_caused,
    loss_estimate,
    most_likely,
    share_lines,
)
from gearmon.diagnosis.hypotheses.tooth_damage import (
    GearEvidence,
    losses_by_tooth,
    mesh_shown,
    own_mesh_power,
)
from gearmon.diagnosis.hypotheses.tooth_match import (
    LOSSES,
    event_delays,
    log_mean,
    path_power,
    search_gear,
)
from gearmon.diagnosis.law.gear_lines import GearDeviation
from gearmon.errors import ArgumentError
from gearmon.gears.faults import Fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.signatures.expected.tooth_response import GROWN, grown_lines, tooth_response
from gearmon.signatures.measured.reference import WheelPattern

SPEED_HZ, TEETH, HARMONICS = 25.0, {"pinion": 27, "gear": 41}, 6
SIGMA, COUNTS = 0.05, {"pinion_teeth": 27, "gear_teeth": 41}


@cache
def machine(**data):
    stage = ParallelStage(**COUNTS, **data)
    return Machine(name="pair", operating=(OperatingPoint(speed_rpm=1500.0),), stages=(stage,))


@cache
def response(gear):
    top = (HARMONICS + 1) * 27.0
    return tooth_response(machine(), 1, gear, top)


def added(gear, loss):
    """Lines that a loss adds, straight between those that are told."""
    top = len(response(gear).lines) - 1
    rows = np.vstack([np.zeros(top + 1), grown_lines(machine(), 1, gear, top)[1]])
    place = np.interp(loss, [0.0, *GROWN], np.arange(len(rows)))
    under = min(int(place), len(rows) - 2)
    return rows[under] + (place - under) * (rows[under + 1] - rows[under])


def estimate(found):
    return loss_estimate(found, machine())


def order(gear):
    return 1.0 if gear == "pinion" else 27 / 41


def path(gear, seed, speed_hz=SPEED_HZ):
    """Transfer function at the multiples of the rotation: decaying noise, two channels."""
    rng = np.random.default_rng([1, seed])
    hz = order(gear) * speed_hz * np.arange(len(response(gear).lines))
    delay = np.sort(rng.exponential(4e-4, 60))
    weight = rng.normal(size=(2, 60, 2)) @ np.array([1.0, 1j]) / np.sqrt(120)
    return weight @ np.exp(-2j * np.pi * np.outer(delay, hz))


def patterns(gear, seed, loss=0.0, tooth=1, gain=1.0, turn=0.0, noise=True, size=0.03, **path_at):
    """A healthy pattern with errors of its own, and a new one with a loss on a tooth."""
    z, known = TEETH[gear], response(gear)
    rng = np.random.default_rng([2, seed])
    number = np.arange(1, HARMONICS * z + z // 2)
    place = path(gear, seed, **path_at)[:, number]
    # in units in which the healthy mesh has a mean square line of 1
    unit = np.sqrt(np.mean(np.abs(known.mesh[1:]) ** 2))
    errors = rng.normal(size=(len(number), 2)) @ np.array([1.0, 1j])
    own = size * errors * np.sqrt(known.band_power(number.astype(float))) / unit
    meshes = number % z == 0
    own[meshes] = known.mesh[number[meshes] // z] / unit
    event = added(gear, loss)[number] / unit * np.exp(-2j * np.pi * number * (tooth - 1) / z)
    scatter = SIGMA * 0.1 if noise else 0.0

    def pattern(lines):
        hiss = rng.normal(size=(2, len(number), 2)) @ np.array([1.0, 1j]) / np.sqrt(2)
        return WheelPattern(
            stage=1,
            gear=gear,
            teeth=z,
            order=order(gear),
            number=number,
            mesh=meshes,
            amplitude=lines + scatter * hiss,
            variance=np.full((2, len(number)), max(scatter, 1e-9) ** 2),
        )

    turned = np.exp(2j * np.pi * number * turn)
    return pattern(own * place), pattern(gain * (own + event) * place * turned)


def searched(gear, seed, same_zero=True, **changes):
    healthy, new = patterns(gear, seed, **changes)
    difference = held_against(new, [healthy], same_zero=same_zero)
    return search_gear(difference, response(gear), SPEED_HZ)


@pytest.mark.parametrize("gain", [1.0, 0.8 - 0.3j])
def test_a_gain_that_a_load_may_change_leaves_next_to_nothing(gain):
    healthy, new = patterns("pinion", 1, gain=gain, noise=False)
    difference = held_against(new, [healthy], same_zero=True)
    left = max(np.abs(b.rest * b.deviation).max() for b in difference.bands)
    # the prior of the gain draws it towards one by as little as the lines are clear
    assert left < 1e-4 * np.abs(new.amplitude).max()


def test_a_gain_that_bends_across_the_band_leaves_nothing():
    healthy, new = patterns("pinion", 1, noise=False)
    x = new.number / 27 - np.rint(new.number / 27)
    bent = WheelPattern(**{**vars(new), "amplitude": new.amplitude * (1 + 0.2j * x - 0.2 * x**2)})
    difference = held_against(bent, [healthy], same_zero=True)
    left = max(np.abs(b.rest * b.deviation).max() for b in difference.bands)
    assert left < 1e-4 * np.abs(bent.amplitude).max()


def test_the_rest_of_noise_has_unit_variance():
    squares = []
    for seed in range(40):
        healthy, new = patterns("gear", seed, size=0.5)
        difference = held_against(new, [healthy], same_zero=True)
        squares += [np.mean(np.abs(band.rest) ** 2) for band in difference.bands]
    # noise alone, without the healthy departures that the law allows for, leaves a little less
    assert 0.8 < np.mean(squares) < 1.05


@pytest.mark.parametrize("turn", [0.0, 0.137, 0.71])
def test_patterns_are_turned_to_one_another(turn):
    healthy, new = patterns("gear", 3, turn=turn, size=0.5)
    difference = held_against(new, [healthy], same_zero=False)
    apart = (difference.shift_turns - turn + 0.5) % 1.0 - 0.5
    assert abs(apart) < 1e-3


def test_the_bayes_factor_of_noise_is_one_in_the_mean_at_most():
    factors = np.exp([searched("pinion", seed).log_gear for seed in range(120)])
    assert factors.mean() < 1.0
    assert np.mean(factors > 10.0) <= 0.1


@pytest.mark.parametrize("gear", ["pinion", "gear"])
@pytest.mark.parametrize("seed", range(5))
def test_a_planted_loss_is_found_on_its_tooth(gear, seed):
    tooth = 5 + 4 * seed
    found = searched(gear, seed, loss=0.2, tooth=tooth)
    assert found.best + 1 == tooth
    assert found.log_gear > 20
    loss, sigma = losses_by_tooth(found)
    assert np.argmax(loss) + 1 == tooth
    assert np.delete(loss, tooth - 1).max() < 0.02
    assert (sigma > 0).all()


def test_the_size_of_planted_losses_is_told():
    for loss in (0.1, 0.2, 0.4):
        told = [estimate(searched("gear", s, loss=loss, tooth=9)) for s in range(16)]
        # of the model's own responses the likelihood tells the size as it is
        assert np.median([one.loss for one in told]) == pytest.approx(loss, rel=0.15)
        inside = [one.low <= loss <= one.high for one in told]
        assert np.mean(inside) >= 0.75


@pytest.mark.parametrize("speed_hz", [1.0, 100.0])
def test_the_size_is_told_by_the_path_at_slow_and_fast_meshes_alike(speed_hz):
    """Slow meshes put their harmonics so near that the path is the same at all of them."""
    told = []
    for seed in range(16):
        healthy, new = patterns("gear", seed, loss=0.2, tooth=9, speed_hz=speed_hz)
        difference = held_against(new, [healthy], same_zero=True)
        found = search_gear(replace(difference, mesh_lines=None), response("gear"), speed_hz)
        told.append(estimate(found).loss)
    assert np.median(told) == pytest.approx(0.2, rel=0.15)


def test_noise_that_is_stated_too_large_makes_no_loss_too_small():
    """Variances of the patterns stated 2.5 times what they are."""
    loss, told = 0.2, []
    for seed in range(16):
        pair = [
            WheelPattern(**{**vars(p), "variance": 2.5 * p.variance})
            for p in patterns("gear", seed, loss=loss, tooth=9)
        ]
        difference = held_against(pair[1], pair[:1], same_zero=True)
        told.append(estimate(search_gear(difference, response("gear"), SPEED_HZ)))
    assert np.median([one.loss for one in told]) == pytest.approx(loss, rel=0.15)


def stating(bands, size):
    """The same lines, departures stated so many times as large, and next to no noise."""
    told = [(b, size * b.deviation) for b in bands]
    return tuple(replace(b, deviation=d, rest=b.rest / size, noise=1e-3 * d) for b, d in told)


@pytest.mark.parametrize("gear", ["pinion", "gear"])
def test_departures_that_are_stated_too_large_hide_no_loss(gear):
    """Twice the deviation of every line, where noise is next to none: the recording tells it."""
    for seed in range(4):
        healthy, new = patterns(gear, seed, loss=0.1, tooth=9)
        own = held_against(new, [healthy], same_zero=True)
        usual = np.median(np.abs(np.concatenate([b.rest.ravel() for b in own.bands])))
        narrow, stated = (
            search_gear(replace(own, bands=stating(own.bands, size)), response(gear), SPEED_HZ)
            for size in (usual, 2 * usual)
        )
        assert stated.best == narrow.best == 8
        assert stated.log_gear == pytest.approx(narrow.log_gear, rel=1e-6)


def test_matched_energy_at_a_tooth_is_what_its_loss_lets_expect():
    told = {loss: [searched("gear", s, loss=loss, tooth=9) for s in range(32)] for loss in (0, 0.2)}
    events = {loss: np.array([one.matched_event for one in own]) for loss, own in told.items()}
    at = int(np.argmin(np.abs(LOSSES - 0.2)))
    expected = np.median([one.matched_peak[at] for one in told[0.2]])
    # the path about the lines is known to a factor of 1.6: 2.5 of power
    assert 0.4 < np.median(events[0.2][:, 0]) / expected < 2.5
    assert events[0][:, 0].max() < 4.0
    assert events[0.2][:, 0].min() > 10.0
    assert (events[0.2][:, 1] > 2.0).all()


def test_a_recording_held_against_itself_has_lost_nothing():
    healthy = patterns("gear", 3)[0]
    difference = held_against(healthy, [healthy], same_zero=True)
    found = search_gear(difference, response("gear"), SPEED_HZ)
    assert found.log_gear < 0
    told = estimate(found)
    assert 0 < told.low <= told.loss <= told.high < 0.02


def test_units_do_not_matter():
    healthy, new = patterns("pinion", 2, loss=0.1, tooth=4)
    one = searched("pinion", 2, loss=0.1, tooth=4)
    large = [
        WheelPattern(**{**vars(p), "amplitude": 1e3 * p.amplitude, "variance": 1e6 * p.variance})
        for p in (healthy, new)
    ]
    difference = held_against(large[1], large[:1], same_zero=True)
    two = search_gear(difference, response("pinion"), SPEED_HZ)
    assert two.log_likelihood == pytest.approx(one.log_likelihood, rel=1e-9, abs=1e-9)


def test_turning_the_recording_turns_the_tooth():
    plain = searched("pinion", 6, loss=0.2, tooth=3)
    turned = searched("pinion", 6, loss=0.2, tooth=3, turn=-5 / 27, same_zero=False)
    assert (turned.best - plain.best) % 27 in (4, 5, 6)


def test_the_more_likely_gear_is_blamed():
    sound, hurt = searched("pinion", 7), searched("gear", 8, loss=0.2, tooth=30)
    best, rivals = most_likely([sound, hurt], machine())
    assert best is hurt
    assert rivals == ()
    assert not share_lines(sound, hurt)


def test_gears_on_one_shaft_share_lines_and_are_told_apart_by_what_they_should_sound_like():
    hurt = searched("gear", 9, loss=0.3, tooth=11)
    assert share_lines(hurt, hurt)
    again = searched("gear", 9, loss=0.3, tooth=11)
    _best, rivals = most_likely([hurt, again], machine())
    assert len(rivals) == 1
    assert rivals[0][1] == pytest.approx(0.0, abs=1e-9)


@cache
def whole_ratio():
    stage = ParallelStage(pinion_teeth=20, gear_teeth=60)
    return Machine(name="3:1", operating=(OperatingPoint(speed_rpm=1500.0),), stages=(stage,))


def of_whole_ratio(sizes, seed, loss=0.3, tooth=7):
    """Pinion and gear of 20/60 teeth, searched; events at every 20th tooth of the gear."""
    rng = np.random.default_rng([3, seed])
    number = np.arange(1, HARMONICS * 60 + 30)
    delay, weight = rng.exponential(4e-4, 60), rng.normal(size=(2, 60, 2)) @ [1.0, 1j]
    place = weight @ np.exp(-2j * np.pi * np.outer(delay, SPEED_HZ / 3 * number)) / np.sqrt(120)
    known = {g: tooth_response(whole_ratio(), 1, g, (HARMONICS + 1) * 20.0) for g in TEETH}
    mesh = number % 60 == 0
    unit = np.sqrt(np.mean(np.abs(known["gear"].mesh[1:]) ** 2))
    own = 0.03 * np.sqrt(known["gear"].band_power(number.astype(float))) / unit
    own = own * (rng.normal(size=(len(number), 2)) @ [1.0, 1j])
    own[mesh] = known["gear"].mesh[number[mesh] // 60] / unit
    entry = (tooth - 1 + 20 * np.arange(3)) / 60
    events = np.asarray(sizes) @ np.exp(-2j * np.pi * np.outer(entry, number))
    added = known["gear"].lines[number] / unit * known["gear"].amplitude(np.array([loss]))[0]

    def found(gear, step):
        def pattern(lines):
            hiss = 0.07 * SIGMA * (rng.normal(size=(*place.shape, 2)) @ [1.0, 1j])
            told = number % step == 0
            return WheelPattern(
                stage=1,
                gear=gear,
                teeth=60 // step,
                order=step / 3,
                number=number[told] // step,
                mesh=mesh[told],
                amplitude=(lines * place + hiss)[:, told],
                variance=np.full((2, told.sum()), (0.1 * SIGMA) ** 2),
            )

        difference = held_against(pattern(own + events * added), [pattern(own)], same_zero=True)
        return search_gear(difference, known[gear], SPEED_HZ)

    return {"pinion": found("pinion", 3), "gear": found("gear", 1)}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("sizes", "blamed"),
    [
        ((1.0, 0.0, 0.0), "gear"),
        ((1.0, 1.0, 1.0), "pinion"),
        # the three teeth that a pinion's tooth meets answer as they are pressed against it
        ((1.0, 0.3, 0.25), "pinion"),
        ((0.4, 1.0, 0.6), "pinion"),
    ],
)
def test_events_at_every_tooth_that_a_pinion_s_meets_are_the_pinion_s(sizes, blamed, seed):
    found = of_whole_ratio(sizes, seed)
    assert share_lines(*found.values())
    best, _ = most_likely(list(found.values()), whole_ratio())
    assert best is found[blamed]
    assert best.best + 1 == 7


@cache
def one_shaft():
    first = ParallelStage(pinion_teeth=27, gear_teeth=41)
    second = ParallelStage(pinion_teeth=23, gear_teeth=50)
    point = OperatingPoint(speed_rpm=1500.0)
    return Machine(name="two stages", operating=(point,), stages=(first, second))


def of_one_shaft(cause, seed, loss=0.3, tooth=7, sense=1.0):
    """Gear of stage 1 and pinion of stage 2, searched; what the tooth of one adds in either."""
    rng, turn_hz = np.random.default_rng([4, seed]), SPEED_HZ * 27 / 41
    gears = {"gear": (1, 41), "pinion": (2, 23)}
    number = np.arange(1, 5 * 41)
    own = 0.02 * (rng.normal(size=(2, len(number), 2)) @ [1.0, 1j])
    for gear, (stage, teeth) in gears.items():
        # either mesh has a path of its own to each of two sensors
        delay, weight = rng.exponential(4e-4, 60), rng.normal(size=(2, 60, 2)) @ [1.0, 1j]
        place = weight @ np.exp(-2j * np.pi * np.outer(delay, turn_hz * number)) / np.sqrt(120)
        mesh, grown = grown_lines(one_shaft(), stage, gear, number[-1])
        unit = np.sqrt(np.mean(np.abs(mesh[1:]) ** 2))
        own[:, teeth - 1 :: teeth] += (
            mesh[1 : 1 + number[-1] // teeth] / unit * place[:, teeth - 1 :: teeth]
        )
        if gear == cause:
            turned = np.exp(-2j * np.pi * number * (tooth - 1) / teeth)
            event = sense * grown[GROWN.index(loss)][number] / unit * turned * place

    def found(stage, gear, teeth):
        def pattern(lines):
            hiss = 0.002 * (rng.normal(size=(*own.shape, 2)) @ [1.0, 1j])
            return WheelPattern(
                stage=stage,
                gear=gear,
                teeth=teeth,
                order=27 / 41,
                number=number,
                mesh=(number % 41 == 0) | (number % 23 == 0),
                amplitude=lines + hiss,
                variance=np.full(own.shape, 0.003**2),
            )

        difference = held_against(pattern(own + event), [pattern(own)], same_zero=True)
        expected = tooth_response(one_shaft(), stage, gear, 6.0 * 27)
        return search_gear(difference, expected, SPEED_HZ)

    return {gear: found(stage, gear, teeth) for gear, (stage, teeth) in gears.items()}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("cause", ["gear", "pinion"])
def test_the_gear_of_a_shaft_is_blamed_whose_mesh_harmonics_all_tell_one_loss(cause, seed):
    found = of_one_shaft(cause, seed)
    best, rivals = most_likely(list(found.values()), one_shaft())
    assert best is found[cause]
    assert rivals[0][1] > 10.0
    told = {gear: log_caused(own, one_shaft()) for gear, own in found.items()}
    assert told.pop(cause) > 5.0 + max(told.values())


@pytest.mark.parametrize("turned", [0.2, 0.5, 0.85])
@pytest.mark.parametrize("cause", ["gear", "pinion"])
def test_one_factor_of_all_harmonics_blames_their_gear_though_no_loss_makes_it(cause, turned):
    found = of_one_shaft(cause, 0, sense=1.5 * np.exp(2j * np.pi * turned))
    best, rivals = most_likely(list(found.values()), one_shaft())
    assert best is found[cause]
    assert rivals[0][1] > 5.0
    assert log_caused(found[cause], one_shaft()) > 5.0


def test_an_event_that_comes_again_tells_as_much_as_each_of_its_places():
    """Bayes factors: 0.8 that a place answers, 0.2 that it does not, beside no answer at all."""
    match = of_whole_ratio((1.0, 0.0, 0.0), 0)["gear"]
    told = np.full(60, -30.0)
    told[[4, 24, 44]] = 50.0, 9.0, 2.0
    places = copy(match)
    places.log_tooth = told
    assert places.log_again(3) == pytest.approx(
        np.log([0.8 * np.exp(v) + 0.2 for v in (9, 2)]).sum()
    )
    assert places.log_again(2) == pytest.approx(np.log(0.2))
    assert places.log_again(1) == 0.0


def test_small_losses_add_in_proportion():
    known = response("pinion")
    assert known.amplitude(np.array([1e-5]))[0] == pytest.approx(1e-5, rel=1e-4)
    grown = known.amplitude(LOSSES) / LOSSES
    assert (np.diff(grown) > 0).all()
    # a pair that carries all by itself gives way as 1/(1 - loss)
    alone = replace(known, pair_share=np.ones(5))
    assert alone.amplitude(np.array([0.5]))[0] == pytest.approx(1.0)


def test_gear_data_make_hills_equation_the_source():
    full = machine(module_mm=2.5, face_width_mm=25.0)
    told = Machine(
        name="pair",
        operating=(OperatingPoint(speed_rpm=1500.0, torque_nm=100.0),),
        stages=full.stages,
    )
    assert tooth_response(machine(), 1, "pinion", 60.0).from_teeth_alone
    known = tooth_response(told, 1, "pinion", 60.0)
    assert not known.from_teeth_alone
    # far below resonance Hill's equation gives what the deflection F/k does
    slow = Machine(
        name="pair",
        operating=(OperatingPoint(speed_rpm=15.0, torque_nm=100.0),),
        stages=full.stages,
    )
    dynamic = tooth_response(slow, 1, "pinion", 60.0)
    static = tooth_response(machine(), 1, "pinion", 60.0)
    ratio = dynamic.lines[5:50] / dynamic.mesh[1] / (static.lines[5:50] / static.mesh[1])
    assert np.abs(ratio) == pytest.approx(1.0, rel=0.03)


def test_the_power_about_a_line_is_the_mean_over_one_mesh_order():
    power = np.where(np.arange(200) < 80, 1.0, 9.0)
    power[1::2] = 0.0  # what no planet brings is not heard
    known = replace(response("pinion"), teeth=20, lines=np.sqrt(power))
    assert known.band_power(np.array([60.0, 70.0, 80.0, 90.0, 150.0, 300.0])).tolist() == [
        1.0, 1.0, 5.0, 9.0, 9.0, 0.0,
    ]  # fmt: skip


def test_lines_of_teeth_alone_are_of_the_deflection_that_a_loss_adds():
    """F/k(t) with a loss of a millionth, less that without, on a grid eight times as fine."""
    (pair,), z = mesh_pairs(ParallelStage(**COUNTS, module_mm=1.0, face_width_mm=10.0)), 27
    x, small = (np.arange(4096 * z) + 0.5) / 4096, 1e-6
    fault = Fault(kind="stiffness", stage=1, gear="pinion", tooth=1, size=small)
    soft, hurt = (1 / mesh_stiffness(pair, own, number=1).at(x) for own in ([], [fault]))
    known, n = response("pinion"), np.array([1, 20, 60, 100, 150])
    waves = np.exp(-2j * np.pi / z * np.outer(np.append(n, z), x)) / len(x)
    expected = n**2 * (waves[:-1] @ (hurt - soft)) / small / (z**2 * (waves[-1] @ soft))
    assert known.lines[n] / known.mesh[1] == pytest.approx(expected, rel=0.02)


def test_sets_of_tooth_counts_alone_have_a_template_of_the_ring_only():
    stage = PlanetaryStage(sun_teeth=20, planet_teeth=30, ring_teeth=80, planets=3, fixed="ring")
    train = Machine(name="set", operating=(OperatingPoint(speed_rpm=900.0),), stages=(stage,))
    with pytest.raises(ArgumentError, match="bears no baseline"):
        tooth_response(train, 1, "sun", 100.0)
    # teeth of standard proportions, as for a pair: the share of the pair and its contact ratio
    ring = tooth_response(train, 1, "ring", 200.0)
    assert ring.teeth == 80
    assert ring.from_teeth_alone
    assert 1.7 < ring.contact_ratio < 2.0
    assert ring.pair_share.max() == pytest.approx(1.0)


def test_the_path_is_told_by_neighbours_where_a_harmonic_is_silent():
    expected = np.array([0.0, 2.0, 0.0, 2.0], dtype=complex)
    measured = np.array([[0.0, 12.0, 0.0, 12.0]])
    assert path_power(measured, expected)[0, 1:] == pytest.approx([3.0, 3.0, 3.0])


@given(st.integers(0, 1000), st.booleans())
def test_the_path_is_a_weighted_mean_of_a_harmonic_and_its_neighbours(seed, mean):
    """One harmonic after another; the mean load, which stands at harmonic 0, tells nothing."""
    rng, weights = np.random.default_rng([5, seed]), {-1: 0.5, 0: 1.0, 1: 0.5}
    expected = rng.normal(size=8) + 1j * rng.normal(size=8)
    measured = rng.exponential(size=(2, 9))
    expected[rng.uniform(size=8) < 0.2] = 0.0
    found = path_power(measured, expected, mean=mean)
    known = [k for k in range(1, 8) if expected[k] != 0]
    for channel, row in zip(measured, found, strict=True):
        assert row[0] == 0.0
        for k in range(1, 8):
            near = [(channel[j], abs(expected[j]) ** 2, weights.get(j - k, 0.0)) for j in known]
            heard, power, weight = np.array(near).reshape(-1, 3).T
            if not weight.any():
                assert row[k] == 0.0
            elif mean:
                assert row[k] == pytest.approx(heard @ weight / (power @ weight))
            else:
                ratio = np.log(heard / power) @ weight / weight.sum()
                assert row[k] == pytest.approx(np.exp(ratio))


def test_a_resonance_on_one_harmonic_hardly_tells_the_path_of_the_next():
    expected = np.ones(6, dtype=complex)
    expected[0] = 0.0
    flat = np.array([[0.0, 2.0, 2.0, 2.0, 2.0, 2.0]])
    peak = flat.copy()
    peak[0, 3] = 200.0
    grown = path_power(peak, expected)[0] / np.maximum(path_power(flat, expected)[0], 1e-9)
    # geometric mean of weights 1/2, 1, 1/2: the square root at the peak, the fourth root beside it
    assert grown[1:] == pytest.approx([1.0, 100**0.25, 10.0, 100**0.25, 1.0])


def one_of(stage, gear, teeth, turns, power):
    return GearDeviation(
        stage=stage,
        gear=gear,
        teeth=teeth,
        order=turns,
        bands=(),
        mesh_power=np.array([power]),
        shift_turns=0.0,
    )


def test_meshes_that_stand_on_one_another_are_told_apart_by_the_harmonics_that_stand_alone():
    # 32 orders, and 32/3: every third harmonic of the second stage falls on the first
    train = Machine(
        name="train",
        operating=(OperatingPoint(speed_rpm=1500.0),),
        stages=(
            ParallelStage(pinion_teeth=32, gear_teeth=96),
            ParallelStage(pinion_teeth=32, gear_teeth=80),
        ),
    )
    responses = [tooth_response(train, stage, "pinion", 200.0) for stage in (1, 2)]
    own = [np.abs(one.mesh) ** 2 for one in responses]
    quick, slow = 500.0 * own[0][:5], 7.0 * own[1][:16]
    # where lines of both fall together they add up in power
    heard = [quick.copy(), slow.copy()]
    heard[0][1:5] += slow[3:13:3]
    heard[1][3:13:3] += quick[1:5]
    gears = [
        one_of(1, "pinion", 32, 1.0, heard[0]),
        one_of(2, "pinion", 32, 1 / 3, heard[1]),
    ]
    told = [own_mesh_power(one, own, gears)[0] for one, own in zip(gears, responses, strict=True)]
    assert told[1][1:] == pytest.approx(slow[1:], rel=0.5)
    assert np.max(heard[1][1:] / slow[1:]) > 10
    # the first stage has no harmonic of its own
    assert told[0] == pytest.approx(heard[0])
    assert mesh_shown(gears[0], gears, train)
    assert mesh_shown(gears[1], gears, train)
    slow[3::3] *= 0.9
    hidden = [gears[0], one_of(2, "pinion", 32, 1 / 3, slow)]
    # what stands out of the second stage's harmonics there is not louder than they let expect
    assert not mesh_shown(hidden[0], hidden, train)
    assert mesh_shown(hidden[1], hidden, train)


def test_a_mesh_that_stands_alone_keeps_its_power():
    power = np.arange(1.0, 6.0)
    gears = [
        one_of(1, "pinion", 27, 1.0, power),
        one_of(2, "pinion", 31, 27 / 41, power),
    ]
    assert own_mesh_power(gears[0], response("pinion"), gears)[0] == pytest.approx(power)


def test_a_gear_keeps_the_harmonics_that_its_mate_is_not_heard_at():
    # of a pinion lines are planned with the other gear of its shaft as well, up to higher orders
    power = np.arange(1.0, 10.0)
    gears = [one_of(1, "pinion", 27, 1.0, power), one_of(1, "gear", 41, 27 / 41, 2 * power[:5])]
    told = own_mesh_power(gears[0], response("pinion"), gears)[0]
    assert told == pytest.approx([*2 * power[:5], *power[5:]])


def test_means_of_logarithms_do_not_overflow():
    assert log_mean(np.array([[1000.0], [1000.0]]))[0] == pytest.approx(1000.0)
    assert log_mean(np.array([[0.0], [np.log(3.0)]]))[0] == pytest.approx(np.log(2.0))


def test_where_a_pair_carries_more_its_loss_counts_more():
    known = response("pinion")
    half = replace(known, pair_share=np.array([1.0, 0.5]))
    # grown by s loss/(1 - s loss): 1 and 1/3, here told per share
    expected = np.sqrt((1.0**2 * 1.0 + (0.5 / 0.75) ** 2 * 0.25) / 1.25)
    assert half.amplitude(np.array([0.5]))[0] == pytest.approx(expected)


def test_a_loss_is_told_whatever_the_path_does_at_the_mesh_harmonics():
    """Through a path that halves or doubles from one harmonic to the next, as resonances do."""
    loss, told = 0.2, []
    for seed in range(8):
        found = searched("gear", seed, loss=loss, tooth=9)
        difference = found.difference
        gain = np.exp(np.log(2.0) * np.random.default_rng(seed).choice([-1.0, 1.0], HARMONICS + 1))
        bands = tuple(
            replace(b, deviation=gain[b.harmonic] * b.deviation) for b in difference.bands
        )
        known = {
            "mesh_lines": gain * difference.mesh_lines[:, : HARMONICS + 1],
            "mesh_power": gain**2 * difference.mesh_power[:, : HARMONICS + 1],
        }
        through = search_gear(replace(difference, bands=bands, **known), response("gear"), SPEED_HZ)
        one = estimate(through)
        plain = estimate(found)
        told.append(one.loss / plain.loss)
        assert one.low <= loss <= one.high
    assert told == pytest.approx(np.ones(8), rel=0.15)


def test_damage_grows_faster_at_mesh_harmonics_than_over_all_lines():
    known, z = response("gear"), TEETH["gear"]
    rows = np.abs(grown_lines(machine(), 1, "gear", len(known.lines) - 1)[1])[:, z : 3 * z : z]
    assert rows[0] == pytest.approx(GROWN[0] * np.abs(known.lines[z : 3 * z : z]), rel=0.02)
    large = rows[GROWN.index(0.2)] / np.abs(known.lines[z : 3 * z : z])
    # a pair that carries all alone where the mesh is softest: (0.25 - 0.111) / 0.1 of the loss
    assert large == pytest.approx([0.2 * 1.39] * 2, rel=0.1)
    assert (large > known.amplitude(np.array([0.2]))[0]).all()


@given(st.floats(0.5, 40.0), st.floats(1.0, 30.0), st.integers(1, 3))
def test_the_largest_of_gamma_variables_has_the_likelihood_ratio_of_that_law(shape, peak, meetings):
    """Of mean `peak` against mean 1, where it is found; over the teeth that it may be."""
    own = SimpleNamespace(deviation=SimpleNamespace(teeth=36, meetings=meetings))
    found = GearEvidence._of_gamma(own, shape, peak)
    ratio = gamma_law.logpdf(peak, shape, scale=peak / shape) - gamma_law.logpdf(
        peak, shape, scale=1.0 / shape
    )
    assert found == pytest.approx(ratio - np.log(36 / meetings), abs=1e-9 * max(1.0, abs(ratio)))


@pytest.mark.parametrize("count", [2, 3, 8])
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_what_comes_in_some_blocks_comes_again_as_often(count, share):
    """An event in so many of the blocks counts so many where the speed swings; one tells none."""
    own = departing(weights(5), seed=2).difference
    number = np.unique(np.concatenate([band.number for band in own.bands]))
    wheel = SimpleNamespace(lines=np.arange(number.size), beside=(), number=number)
    rng = np.random.default_rng([count, round(10 * share)])
    event = np.zeros((2, number.size), dtype=complex)
    for band in own.bands:
        event[:, np.searchsorted(number, band.number)] = band.rest * band.deviation
    there = np.arange(count) < max(1, round(share * count))
    # the same mean over all blocks, however few of them it is in
    event *= count / there.sum()
    noise = 1e-3 * np.abs(event).max() * complex_noise(rng, count, *event.shape)
    blocks = rng.permutation(there[:, None, None] * event + noise)
    tooth = int(np.argmax(own.by_tooth))
    again, _ = own.recurrence(tooth, blocks, wheel, swings=True)
    assert again == pytest.approx(there.sum(), rel=0.05)
    steady, scatter = own.recurrence(tooth, blocks, wheel)
    # of m of n blocks m (n - 1)/(n - m), less what half-overlapped blocks share
    assert (steady > 1e3) == there.all()
    assert (scatter < 2.0) == there.all()
    if not there.all():
        assert 0.5 < steady * (count - there.sum()) / (there.sum() * (count - 1)) < 1.0
    assert own.recurrence(tooth, blocks[:1], wheel) == (np.inf, 1.0)


@pytest.mark.parametrize("name", ["pinion", "planet"])
@pytest.mark.parametrize("decay_s", [2e-4, 2e-3])
def test_delays_of_an_event_are_quantiles_of_its_contact_and_of_the_ringing(name, decay_s):
    """Any moment of contact, and then an exponential one; of a planet half a turn later again."""
    tooth = SimpleNamespace(contact_ratio=1.6, teeth=24, gear=name)
    found = event_delays(tooth, 20.0, decay_s)
    once = found[: len(found) // 2] if name == "planet" else found
    if name == "planet":
        np.testing.assert_allclose(found[len(once) :], once + 0.5 / 20.0)
    rng, contact_s = np.random.default_rng(2), 1.6 / (20.0 * 24)
    drawn = contact_s * rng.random(200_000) + rng.exponential(decay_s, 200_000)
    # what is heard after three times of decay is left out
    drawn = drawn[drawn < contact_s + 3 * decay_s]
    shares = (np.arange(len(once)) + 0.5) / len(once)
    np.testing.assert_allclose(once, np.quantile(drawn, shares), rtol=0.03, atol=2e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_mesh_line_is_told_by_its_sidebands_as_a_gaussian_law_has_it(seed):
    """Lines of impulses at some delays, in noise: mean and variance on condition of the others."""
    rng = np.random.default_rng(seed)
    number, mesh, rotation_hz = np.array([19, 20, 22, 24, 25]), 23, 5.0
    delay = rng.uniform(0.0, 0.03, 7)
    deviation = rng.uniform(0.5, 2.0, (2, 5))
    rest = 3.0 * complex_noise(rng, 2, 5)
    grown = complex_noise(rng, 4, 5)
    band = SimpleNamespace(number=number, rest=rest, deviation=deviation)
    value, expected, variance = _at_mesh(band, mesh, rotation_hz, delay, grown)
    each = np.append(number, mesh)
    lag = np.subtract.outer(each, each)[:, :, None] * rotation_hz * delay
    alike = np.exp(-2j * np.pi * lag).mean(axis=2)
    for row, (own, size) in enumerate(zip(rest, deviation, strict=True)):
        power = np.mean((np.abs(own) ** 2 - 1) * size**2)
        assert power > 0
        of_lines = power * alike[:-1, :-1] + np.diag(size**2)
        told = power * alike[-1, :-1] @ np.linalg.inv(of_lines)
        assert value[row] == pytest.approx(told @ (size * own))
        assert variance[row] == pytest.approx((power - told @ (power * alike[:-1, -1])).real)
        np.testing.assert_allclose(expected[:, row], grown @ told)


@pytest.mark.parametrize("louder", [True, False])
def test_a_mesh_shows_on_the_lines_of_a_slower_mesh_whose_gears_turn_faster(louder):
    """Of 96 teeth on 32, whose shaft turns three times as fast and drives by 16."""
    stages = ({"pinion_teeth": 96, "gear_teeth": 32}, {"pinion_teeth": 16, "gear_teeth": 40})
    point = OperatingPoint(speed_rpm=1500.0)
    train = Machine(
        name="train", operating=(point,), stages=tuple(ParallelStage(**own) for own in stages)
    )
    heard = np.abs(tooth_response(train, 2, "pinion", 8 * 48.0).mesh[:9]) ** 2
    heard[2::2] *= 30.0 if louder else 0.1
    gears = [one_of(1, "pinion", 96, 1.0, heard[::2]), one_of(2, "pinion", 16, 3.0, heard)]
    assert mesh_shown(gears[0], gears, train) == louder
    assert mesh_shown(gears[1], gears, train)
