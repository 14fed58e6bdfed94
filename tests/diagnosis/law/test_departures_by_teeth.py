"""Where a healthy gear departs when its load changes, and what is believed beside it."""

from dataclasses import replace

import numpy as np
import pytest
from reference.gear_departures import (
    HARMONICS,
    TEETH,
    complex_noise,
    gear,
    held_against,
    weights,
)

from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence
from gearmon.diagnosis.law.gear_lines import STEPS, GearDeviation
from gearmon.signatures.measured.reference import WheelPattern


def uneven(seed):
    """A gear of uneven teeth, and what is left where all of them changed in proportion."""
    own = np.random.default_rng(seed).normal(size=31)
    own[7] = 4.0
    # by another path than the pattern: what is in proportion to it, line by line, is a gain
    return own, gear(own, seed=seed + 50, height=3.0)


def of(searched, pattern, noise_share):
    """The same departure beside a healthy pattern and that share of noise in its variance."""
    bands = [
        replace(one, pattern=5.0 * same.rest, noise=np.sqrt(noise_share) * one.deviation)
        for one, same in zip(searched.difference.bands, pattern.difference.bands, strict=True)
    ]
    return replace(searched.difference, bands=tuple(bands))


def test_a_departure_is_held_against_what_the_healthy_pattern_lets_expect_there():
    for seed in range(5):
        own, changed = uneven(seed)
        healthy = gear(own, seed=seed, height=10.0, noise=0.0)
        blind = of(changed, gear(np.zeros(31), seed=seed, noise=0.0), 0.1)
        told = of(changed, healthy, 0.1)
        expected = told.expected_around[::STEPS]
        assert expected.min() >= 1.0
        assert abs(int(np.argmax(expected)) - 7) <= 1
        assert expected.max() > 2.0
        energy = [one.by_tooth * one.misfit for one in (blind, told)]
        np.testing.assert_allclose(energy[0], energy[1] * expected, rtol=1e-9)


def test_beside_noise_alone_the_place_does_not_matter():
    own, _ = uneven(1)
    healthy = gear(own, seed=1, height=10.0, noise=0.0)
    quiet = of(gear(np.zeros(31), seed=1), healthy, 1.0)
    assert quiet.departs == pytest.approx(0.0)
    np.testing.assert_allclose(quiet.expected_around, 1.0, atol=0.05)


def test_a_tooth_that_no_healthy_pattern_explains_still_stands_out():
    own, _ = uneven(2)
    healthy = gear(own, seed=2, height=10.0, noise=0.0)
    damaged = of(gear(weights(20), seed=2), healthy, 0.5)
    assert int(np.argmax(damaged.by_tooth)) == 20
    assert damaged.peak > 20.0


def beside(searched, others, changing=1.0):
    """The same departure where references depart from one another so, by change of their state."""
    bands = tuple(
        replace(
            one,
            known=np.array([other.difference.bands[n].rest for other in others]),
            changing=changing,
        )
        for n, one in enumerate(searched.difference.bands)
    )
    return replace(searched.difference, bands=bands)


def test_noise_is_trusted_the_less_the_less_is_left_of_it_beside_several_references():
    """Blocks scatter by what a rippling load does, too: of 0.6 of their noise on all is trusted."""
    own, others = np.zeros(TEETH), [gear(np.zeros(TEETH), seed=k, noise=0.0) for k in (1, 2)]
    trusted = []
    for hiss in (0.3, 0.6, 1.0):
        quiet = gear(own, seed=3, noise=hiss)
        several, one = beside(quiet, others), quiet.difference
        assert one.departs == pytest.approx(0.0, abs=0.1)
        assert several.misfit == pytest.approx(hiss**2, rel=0.15)
        assert 1.0 - several.departs == pytest.approx(min(1.0, several.misfit / 0.6), abs=0.1)
        trusted.append(1.0 - several.departs)
    assert trusted[0] < 0.5 * trusted[1] < 0.5 * trusted[2]


def test_a_tooth_that_departs_among_the_references_is_expected_to():
    own, changed = uneven(3)
    references = [gear(own, seed=seed, height=3.0) for seed in (90, 91, 92)]
    told = beside(changed, references)
    assert abs(int(np.argmax(told.expected_around[::STEPS])) - 7) <= 1
    assert changed.difference.peak > 2.0 * told.peak
    damaged = beside(gear(weights(20), seed=3), references)
    assert int(np.argmax(damaged.by_tooth)) == 20
    assert damaged.peak > 20.0


def test_what_only_changes_with_the_state_is_not_expected_at_a_state_that_was_learned():
    own, changed = uneven(3)
    references = [gear(own, seed=seed, height=3.0) for seed in (90, 91, 92)]
    none, half, all_ = (
        beside(changed, references, changing).expected_around[::STEPS][7]
        for changing in (0.0, 0.5, 1.0)
    )
    assert none == pytest.approx(changed.difference.expected_around[::STEPS][7])
    assert half == pytest.approx(max(none, 0.5 * (1.0 + all_)))


def test_references_that_depart_alike_all_around_change_nothing():
    alike = [gear(np.zeros(31), seed=seed) for seed in (90, 91, 92)]
    damaged = gear(weights(20), seed=3)
    np.testing.assert_allclose(
        beside(damaged, alike).by_tooth, damaged.difference.by_tooth, rtol=0.25
    )


def lines_of(own, seed):
    """A gear's measured lines, with noise."""
    rng = np.random.default_rng([5, seed])
    number = np.arange(1, own.shape[1] + 1)
    hiss = 1e-3 * complex_noise(rng, *own.shape)
    return WheelPattern(
        stage=1,
        gear="pinion",
        teeth=TEETH,
        order=1.0,
        number=number,
        mesh=number % TEETH == 0,
        amplitude=own + hiss,
        variance=np.full(own.shape, 1e-6),
    )


@pytest.mark.parametrize("speed", [0.0, 0.1])
@pytest.mark.parametrize(
    ("change", "least", "most", "away"), [(3.0, 0.9, 1.6, 15.0), (0.0, 0.5, 1.0, 2.0)]
)
def test_a_machine_that_changes_with_its_load_is_as_sure_beside_a_reference_of_that_load(
    change, least, most, away, speed
):
    """Two references at the load of the recording, two others, and deviations beside the first."""
    rng = np.random.default_rng(6)
    own, other = complex_noise(rng, 2, 2, HARMONICS * TEETH)
    own[:, TEETH - 1 :: TEETH] = 10.0
    near = [lines_of(own, seed) for seed in (1, 2)]
    far = [lines_of(own + change * other * part, seed) for part, seed in ((1, 3), (-1, 4))]
    states = [(0.0, 0.0), (0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]
    new = lines_of(own, 5)
    beside, among, learned, between = (
        np.median(np.concatenate([b.deviation.ravel() for b in told.bands]))
        for told in (
            held_against(new, near, states=states[:2], state=(0.0, speed)),
            held_against(new, [*near, *far], states=states, state=(0.0, speed)),
            held_against(new, [*near, *far], states=states),
            held_against(new, [*near, *far], states=states, state=(0.5, 0.0)),
        )
    )
    assert least < among / beside < most
    # where nothing was learned it is as unsure as the change has it
    assert between > away * learned


# along what damage would add nothing stands out
NOTHING = (1.0, 40.0)


def evidence(deviation: GearDeviation) -> GearEvidence:
    return GearEvidence(deviation=deviation, search=None)


def test_what_departs_by_teeth_bounds_what_is_believed_of_a_likelihood():
    _, changed = uneven(3)
    flat = gear(np.zeros(31), seed=3, noise=0.0)
    noisy, departing = (evidence(of(changed, flat, share)) for share in (0.999, 0.3))
    # a peak four times the median: proof among teeth that are alike, chance among such as depart
    assert noisy.believes(60.0, 4.0, *NOTHING) > 3.0 * departing.believes(60.0, 4.0, *NOTHING)
    # gamma variables of shape two: 2 (r - 1 - ln r) - ln z
    r = 1.0 + 3.0 / departing.deviation.departs
    most = 2.0 * (r - 1.0 - np.log(r)) - np.log(31)
    quiet = replace(departing.deviation, bands=departing.deviation.bands)
    assert evidence(quiet).believes(1e9, 4.0, *NOTHING) == pytest.approx(most)
    # evidence against damage is believed as it is
    assert departing.believes(-7.0, 4.0, *NOTHING) == -7.0


def test_more_is_believed_of_a_higher_peak_and_of_a_larger_factor():
    _, changed = uneven(4)
    one = evidence(of(changed, gear(np.zeros(31), seed=4, noise=0.0), 0.5))
    peaks = [one.believes(200.0, peak, *NOTHING) for peak in np.geomspace(1.0, 100.0, 25)]
    factors = [one.believes(factor, 6.0, *NOTHING) for factor in np.geomspace(0.1, 1e4, 25)]
    assert np.all(np.diff(peaks) >= 0)
    assert np.all(np.diff(factors) >= 0)


def test_what_departs_along_what_damage_adds_is_believed_by_the_directions_that_tell_it():
    _, changed = uneven(3)
    own = of(changed, gear(np.zeros(31), seed=3, noise=0.0), 0.3)
    lines = np.ones((1, 4), dtype=complex)
    alone = evidence(replace(own, mesh_lines=lines))
    # gamma variables of a shape of one sixth for each direction: 40/6 (r - 1 - ln r) - ln z
    most = 40.0 / 6.0 * (5.0 - 1.0 - np.log(5.0)) - np.log(31)
    assert alone.believes(1e9, 1.0, 5.0, 40.0) == pytest.approx(most)
    assert alone.believes(3.0, 1.0, 5.0, 40.0) == 3.0
    # at another load than all learned teeth scatter more, and of planets less is known
    lighter = evidence(replace(own, mesh_lines=lines, light=0.4))
    assert lighter.believes(1e9, 1.0, 5.0, 40.0) < 0.5 * most
    planets = evidence(replace(own, mesh_lines=None))
    assert planets.believes(1e9, 1.0, 5.0, 40.0) == planets.believes(1e9, 1.0, *NOTHING)


@pytest.mark.parametrize("distance", [9, 15, -11])
@pytest.mark.parametrize("height", [3.0, 30.0])
def test_a_second_damaged_tooth_hides_the_first_no_more_than_noise_does(height, distance):
    """What is left beside both is noise, of mean square 1, however loud they are."""
    both = gear(weights(10, (10 + distance) % TEETH), seed=7, height=height).difference
    assert 0.6 < both.misfit < 1.7
    alone = gear(weights(10), seed=7, height=height).difference
    assert 0.8 < alone.misfit < 1.3
    assert both.peak > 0.2 * alone.peak


def test_what_departs_all_around_is_no_second_event():
    """Neither noise nor a departure of every tooth is taken off with one that stands out."""
    assert 0.8 < gear(np.zeros(TEETH), seed=3).difference.misfit < 1.2
    everywhere = np.random.default_rng(4).uniform(0.7, 1.3, TEETH)
    spread = gear(everywhere, seed=4, height=10.0).difference
    assert spread.misfit > 20.0
    assert spread.peak < 8.0


def shared(weight, noise_share, order=1.0, height=10.0):
    """A gear that departs so, of whose expected variance noise has this share."""
    own = gear(weight, seed=5, height=height).difference
    bands = [replace(one, noise=np.sqrt(noise_share) * one.deviation) for one in own.bands]
    return replace(own, bands=tuple(bands), order=order)


EVERYWHERE = np.random.default_rng(6).uniform(0.7, 1.3, TEETH)


def test_a_gear_departs_beyond_another_by_the_ratio_of_what_is_left_of_both():
    one, other = shared(EVERYWHERE, 0.1), shared(np.zeros(TEETH), 0.1)
    assert one.beyond(other) == pytest.approx(one.misfit / other.misfit)
    assert other.beyond(one) == 1.0
    half = shared(EVERYWHERE, 0.1, height=5.0)
    assert one.beyond(half) == pytest.approx(one.misfit / half.misfit)
    assert 2.5 < one.beyond(half) < 4.5


def test_where_noise_hides_the_other_nothing_is_told():
    """It would show no more if it departed as much."""
    one = shared(EVERYWHERE, 0.1)
    assert one.beyond(shared(np.zeros(TEETH), 1.0)) == 1.0
    told = [one.beyond(shared(np.zeros(TEETH), share)) for share in (0.2, 0.9, 0.97, 0.99)]
    assert told == sorted(told, reverse=True)
    faint = shared(np.zeros(TEETH), 0.97)
    times = (one.misfit - one.noise_share) / (1.0 - one.noise_share)
    assert one.beyond(faint) == pytest.approx((0.97 + 0.03 * times) / faint.misfit)
