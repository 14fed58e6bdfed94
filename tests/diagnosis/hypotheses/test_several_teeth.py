"""The share of a departure that one tooth explains, on departures whose content is known."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.gear_departures import TEETH, beside_others, complex_noise, gear, weights

from gearmon import analyse, read_recording, simulate
from gearmon.diagnosis.hypotheses.several_teeth import (
    RINGING,
    SHARES,
    Band,
    bands_of,
    departure_spread,
    energies,
    event,
    log_likelihood,
    repetition,
    second_tooth,
    weighted,
)
from gearmon.diagnosis.hypotheses.tooth_match import log_mean
from gearmon.machine import Machine, OperatingPoint, ParallelStage


@pytest.mark.parametrize("height", [2.0, 10.0, 300.0])
@pytest.mark.parametrize("tooth", [0, 17])
def test_one_tooth_explains_its_own_departure_at_any_height(height, tooth):
    spread = departure_spread(gear(weights(tooth), seed=tooth, height=height))
    assert spread.one_tooth > 0.99
    assert spread.explained > 0.8


@pytest.mark.parametrize("height", [2.0, 10.0, 300.0])
@pytest.mark.parametrize("seed", range(4))
def test_random_losses_of_all_teeth_are_not_one_tooth(height, seed):
    rng = np.random.default_rng([4, seed])
    weight = np.where(rng.random(TEETH) < 0.6, rng.uniform(0, 2, TEETH), 0.0)
    spread = departure_spread(gear(weight, seed=seed, height=height))
    assert spread.one_tooth < 0.05
    assert spread.explained < 0.5
    assert spread.teeth_involved > 0.4 * TEETH


@pytest.mark.parametrize("meetings", [2, 3])
def test_where_a_tooth_meets_several_planets_at_once_teeth_cannot_be_parted(meetings):
    own = gear(weights(3))
    assert departure_spread(own) is not None
    met = copy(own)
    met.difference = replace(own.difference, meetings=meetings)
    assert departure_spread(met) is None


@pytest.mark.parametrize("smooth", [0.3, 0.6, 0.9])
def test_sidebands_that_fall_off_are_not_one_tooth(smooth):
    spread = departure_spread(gear(None, seed=7, smooth=smooth))
    assert spread.one_tooth < 0.05


def test_three_teeth_are_neither_one_nor_all():
    several = departure_spread(gear(weights(2, 11, 22), seed=1))
    assert several.one_tooth < 0.5
    one = departure_spread(gear(weights(2), seed=1))
    everywhere = departure_spread(gear(np.random.default_rng(5).normal(size=TEETH), seed=1))
    assert one.teeth_involved < several.teeth_involved < everywhere.teeth_involved


def test_the_share_left_unexplained_comes_back():
    """Unrelated lines of a known share of the power beside the event of one tooth."""
    for share in (0.1, 0.5, 0.9):
        found = []
        for seed in range(6):
            event = gear(weights(5), seed=seed, height=100.0 * np.sqrt(1 - share), noise=0.0)
            both = beside_others(event, 100.0 * np.sqrt(share), 6, seed)
            found.append(1.0 - departure_spread(both).explained)
        assert np.median(found) == pytest.approx(share, abs=0.12)


def test_noise_alone_has_a_mean_square_of_one_at_every_tooth():
    found = [departure_spread(gear(None, seed=seed, height=0.0)).by_tooth for seed in range(6)]
    assert np.mean(found) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_noise_involves_no_teeth(seed):
    """An event as loud as the noise is on as many teeth as one that drowns it."""
    quiet, loud = (departure_spread(gear(weights(5), seed=seed, height=h)) for h in (1.0, 300.0))
    assert quiet.teeth_involved == pytest.approx(loud.teeth_involved, rel=0.1)


@given(st.integers(0, TEETH - 1))
def test_which_tooth_it_is_does_not_matter(tooth):
    plain = departure_spread(gear(weights(0), noise=0.0))
    moved = departure_spread(gear(weights(tooth), noise=0.0))
    assert moved.log_likelihood == pytest.approx(plain.log_likelihood, rel=1e-6, abs=1e-3)
    assert moved.by_tooth == pytest.approx(np.roll(plain.by_tooth, tooth), rel=1e-6, abs=1e-6)


def band_of(rest, teeth=TEETH):
    number = np.arange(-9, 10) + 3 * teeth
    place = np.exp(2j * np.pi / teeth * np.outer(np.arange(teeth), number))
    return Band(number=number, rest=rest, place=place, events=[])


def event_of(lines, ringing):
    """Lines that are heard alike, centred on the mesh harmonic."""
    return event(np.ones(lines), (np.arange(lines) - lines // 2) / TEETH, 1.6, ringing)


def slow_likelihood(band, matrix_of_event, tooth):
    """Of the Gaussian law with the matrix written out, powers averaged."""
    excess = max(float(np.mean(np.abs(band.rest) ** 2)) - 1.0, 0.05)
    turned = band.place[tooth] * band.rest
    found = []
    for share in SHARES:
        each = []
        for factor in np.geomspace(1 / 16, 16, 13):
            matrix = np.eye(len(turned)) * (1 + factor * excess * share)
            matrix = matrix + factor * excess * (1 - share) * matrix_of_event
            logarithm = np.linalg.slogdet(matrix)[1]
            told = turned.conj() @ np.linalg.solve(matrix, turned)
            each.append(-float(told.real) - logarithm)
        found.append(np.logaddexp.reduce(each) - np.log(len(each)))
    return np.array(found)


def test_likelihood_is_that_of_the_covariance():
    band = band_of(3.0 * complex_noise(np.random.default_rng(8), 19))
    power, direction = event_of(19, 0.3)
    fast = log_likelihood(band, power, energies(band, direction))
    matrix = (direction * power) @ direction.conj().T
    slow = np.array([slow_likelihood(band, matrix, tooth) for tooth in range(TEETH)]).T
    assert fast == pytest.approx(slow, rel=1e-6)


def test_likelihood_of_two_teeth_is_that_of_the_covariance():
    band = band_of(3.0 * complex_noise(np.random.default_rng(9), 19))
    power, direction = event_of(19, 0.3)
    factor = np.array(
        [1 + a * np.exp(-2j * np.pi * d * band.number / TEETH) for d, a in ((5, 0.4), (-1, 1.0))]
    )
    fast = log_likelihood(band, *weighted(band, power, direction, 4, factor))
    for number, own in enumerate(factor):
        root = own[:, None] * direction * np.sqrt(power)
        matrix = root @ root.conj().T
        matrix *= len(root) / np.trace(matrix).real
        assert fast[:, number] == pytest.approx(slow_likelihood(band, matrix, 4), rel=1e-6)


def test_factors_of_one_change_nothing():
    band = band_of(3.0 * complex_noise(np.random.default_rng(10), 19))
    power, direction = event_of(19, 1.0)
    plain = log_likelihood(band, power, energies(band, direction)[[7]])
    same = log_likelihood(band, *weighted(band, power, direction, 7, np.ones((1, 19))))
    # a loudness of no direction is a matter of the trace, which `event` leaves a thousandth short
    assert same == pytest.approx(plain, abs=0.02)


def test_events_have_a_trace_of_the_lines():
    for ringing in (0.05, 1.0, 3.0):
        power, direction = event_of(21, ringing)
        assert power.sum() == pytest.approx(21, rel=0.01)
        assert direction.conj().T @ direction == pytest.approx(np.eye(len(power)), abs=1e-6)


# several teeth


@pytest.mark.parametrize("height", [3.0, 10.0, 300.0])
@pytest.mark.parametrize("distance", [3, 5, 11, -7, TEETH // 2])
@pytest.mark.parametrize("size", [0.7, 1.0])
def test_a_second_tooth_is_told_where_it_is(height, distance, size):
    weight = weights(9)
    weight[(9 + distance) % TEETH] = size
    spread = departure_spread(gear(weight, seed=3, height=height))
    assert spread.one_tooth < 0.01
    assert spread.several_teeth > 0.9
    assert spread.of_two_teeth
    # either may be called the first
    assert spread.second.distance in (distance, -distance)
    assert spread.second.size == pytest.approx(size, abs=0.35)


@pytest.mark.parametrize(
    ("distance", "size", "asked"), [(5, 0.7, 30.0), (2, 0.7, 8.0), (5, 1.0, 8.0)]
)
def test_more_is_asked_of_a_smaller_tooth_farther_off(distance, size, asked):
    """The likelihood of that tooth less what is asked, and less its places and sizes."""
    weight = weights(9)
    weight[9 + distance] = size
    searched = gear(weight, seed=3, height=10.0)
    bands, by_tooth = list(bands_of(searched)), departure_spread(searched).by_tooth
    told = second_tooth(bands, 9, by_tooth, searched.log_gear)
    assert (told.distance, told.size) == (distance, size)
    plain = np.zeros((len(RINGING), len(SHARES), 1))
    for band in bands:
        turn = 1.0 + size * np.exp(-2j * np.pi / TEETH * distance * band.number[None])
        for number, event_of in enumerate(band.events):
            plain[number] += log_likelihood(band, *weighted(band, *event_of, 9, turn))
    rest = log_mean(plain)[:, 0] - told.log_likelihood
    assert np.allclose(rest, asked + np.log(3 * TEETH), atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_one_tooth_has_no_second(seed):
    spread = departure_spread(gear(weights(5 * seed), seed=seed, height=30.0))
    assert spread.one_tooth > 0.99
    assert spread.several_teeth < 0.01
    assert not spread.of_two_teeth


@pytest.mark.parametrize("seed", range(4))
def test_damage_of_all_teeth_is_not_two(seed):
    weight = np.random.default_rng([8, seed]).normal(size=TEETH)
    spread = departure_spread(gear(weight, seed=seed, height=30.0))
    assert spread.one_tooth < 0.05


def test_what_repeats_is_the_autocorrelation_at_whole_teeth():
    """With all lines there and a path that says nothing: a / (1 + a^2)."""
    number = np.arange(4 * TEETH)
    lines = 1.0 + 0.5 * np.exp(-2j * np.pi * 6 * number / TEETH)
    band = Band(number=number, rest=lines, place=np.ones((1, len(lines))), events=[])
    expected = np.zeros(TEETH)
    expected[[6, -6]] = 0.5 / 1.25
    assert repetition([band], TEETH) == pytest.approx(expected, abs=1e-12)


def test_gears_of_hardly_any_teeth_are_not_judged():
    assert second_tooth([], 0, np.ones(5), 10.0) is None


def test_what_one_tooth_leaves_behind_is_no_second_one():
    # README's pair on a machine whose path makes the power of the lines come and go
    stage = ParallelStage(pinion_teeth=23, gear_teeth=57, module_mm=2.5, face_width_mm=28.0)
    point = OperatingPoint(speed_rpm=1480.0, torque_nm=120.0)
    machine = Machine(name="conveyor drive", operating=(point,), stages=(stage,))

    def recorded(recording_seed, load, *faults):
        seeds = {"machine_seed": 46, "recording_seed": recording_seed}
        return read_recording(simulate(machine, faults, **seeds, channels=2, load=load))

    found = analyse(recorded(4620, 0.9, "crack:1:pinion:5:20%"), machine, [recorded(4601, 0.7)])
    assert [(flag.kind, flag.gear) for flag in found.flags] == [("tooth damage", "pinion")]
