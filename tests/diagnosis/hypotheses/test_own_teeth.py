"""Finding the departing tooth: planted damage, laws, and gears that are sound."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from reference.gear_patterns import CONTACT_CENTRE, Gear
from scipy.stats import gamma as gamma_law

from gearmon.diagnosis.hypotheses.turns import (
    _log10_gamma,
    aligned,
    departure_energy,
    locate,
)
from gearmon.signatures.measured.reference import taken

BOTH = (0, 1)


def departed(new, old, *, channels=BOTH, same_zero=False):
    """Energy around the turn beside a healthy recording."""
    return departure_energy(*aligned(new, taken(old, channels), same_zero=same_zero))


def apart(one, other, teeth=23):
    """Distance of two places of a gear, in teeth, the shorter way round."""
    return abs((one - other + teeth / 2) % teeth - teeth / 2)


@pytest.mark.parametrize("teeth", [17, 23, 57])
@pytest.mark.parametrize("share", [0.0, 0.35, 1.0])
def test_planted_tooth_departs_most(teeth, share):
    gear = Gear(teeth, seed=teeth)
    tooth = 1 + round(share * (teeth - 1))
    energy = departed(gear.recording(1, tooth=tooth, spread_db=1.0), gear.recording(50))
    assert energy.shape == (teeth,)
    assert np.median(energy) == pytest.approx(1.0)
    # the energies are given at the teeth's entries into contact
    assert apart(int(np.argmax(energy)), tooth - 1 + CONTACT_CENTRE, teeth) < 1.7
    assert energy.max() > 8.0


@pytest.mark.parametrize("start", [0.0, 0.123, 0.5, 0.987])
def test_planted_tooth_is_found_whatever_the_angle_of_the_reference(start):
    # the reference starts anywhere; the zero is that of the new recording
    gear = Gear(23, seed=4)
    energy = departed(gear.recording(1, tooth=9), gear.recording(50, start=start))
    assert apart(int(np.argmax(energy)), 8 + CONTACT_CENTRE) < 1.7


@pytest.mark.parametrize("start", [0.0, 0.123, 0.5, 0.987])
def test_a_reference_is_turned_onto_what_is_compared_with_it(start):
    gear = Gear(23, seed=4)
    new, turned = gear.recording(1), gear.recording(2, start=start)
    one, two = (own.amplitude for own in aligned(new, turned))
    alike = np.vdot(one, two) / np.linalg.norm(one) / np.linalg.norm(two)
    assert alike.real > 0.95
    # told that both count from one pulse it stays where it is
    _, kept = aligned(new, turned, same_zero=True)
    assert np.array_equal(kept.amplitude, turned.amplitude)


def test_known_zero_is_believed():
    # a turned reference, said to share the zero, no longer cancels: the damage is buried
    gear = Gear(23, seed=4)
    new, old = gear.recording(1, tooth=9, size=0.15), gear.recording(50)
    turned = gear.recording(50, start=0.3)
    fixed = departed(new, old, same_zero=True).max()
    assert fixed == pytest.approx(departed(new, old).max(), rel=0.2)
    assert departed(new, turned, same_zero=True).max() < 0.5 * fixed


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_unit_and_order_of_channels_do_not_matter(factor):
    gear = Gear(23, seed=4)
    new, old = gear.recording(1, tooth=9), gear.recording(50)
    energy = departed(new, old)
    np.testing.assert_allclose(departed(_scaled(new, factor), _scaled(old, factor)), energy)
    np.testing.assert_allclose(departed(new, _swapped(old), channels=(1, 0)), energy)


def test_lines_that_both_have_count():
    gear = Gear(23, seed=4)
    short = gear.recording(50, lines=slice(0, 80))
    energy = departed(gear.recording(1, tooth=9), short)
    assert apart(int(np.argmax(energy)), 8 + CONTACT_CENTRE) < 1.7
    np.testing.assert_allclose(
        energy, departed(gear.recording(1, tooth=9, lines=slice(0, 80)), short), rtol=0.5
    )


def test_near_sidebands_can_be_left_out():
    # an eccentricity, one turn about every mesh harmonic
    gear = Gear(23, seed=4)
    new, old = gear.recording(1), gear.recording(50)
    beside = np.abs(new.number - 23 * np.rint(new.number / 23)) == 1
    new = _changed(new, amplitude=new.amplitude + 3 * beside)
    pairs = aligned(new, old, same_zero=True)
    # its beat rises and falls twice a turn
    twice = np.exp(4j * np.pi * np.arange(23) / 23)
    with_near, without = (departure_energy(*pairs, near) for near in (0, 3))
    assert abs(twice @ with_near) / with_near.sum() > 2 * abs(twice @ without) / without.sum()


def test_healthy_gears_are_not_flagged():
    alarms = 0
    for seed in range(60):
        found = locate(Gear(23, seed=seed).recording(seed), numbered=True)
        assert found.against == "other teeth"
        alarms += found.log10_probability < -2
    assert alarms <= 1


@pytest.mark.parametrize("start", [0, 4])
def test_a_gross_tooth_shows_against_the_other_teeth(start):
    gear = Gear(23, seed=4)
    new = gear.recording(1, tooth=9, size=5.0, start=start / 23)
    found = locate(new, numbered=True)
    assert apart(found.tooth, 9 - start) <= 1
    assert apart(found.position * 23, 8 - start + CONTACT_CENTRE) < 1.2
    assert apart(int(np.argmax(found.energy)), 8 - start + CONTACT_CENTRE) < 1.7
    assert found.log10_probability < -2
    one = locate(taken(_scaled(new, 1e6), [1, 0]), numbered=True)
    assert one.log10_probability == pytest.approx(found.log10_probability, rel=1e-6)


def test_without_a_tacho_no_tooth_is_numbered():
    found = locate(Gear(23, seed=4).recording(1, tooth=9), numbered=False)
    assert found.tooth is None
    assert 0 <= found.position < 1


def test_more_damage_is_more_evidence():
    gear = Gear(23, seed=4)
    logs = [
        locate(gear.recording(1, tooth=9, size=size), numbered=True).log10_probability
        for size in (0.5, 2.0, 4.0, 8.0)
    ]
    assert logs == sorted(logs, reverse=True)
    peaks = [
        departed(gear.recording(1, tooth=9, size=size), gear.recording(50)).max()
        for size in (0.0, 0.1, 0.2, 0.3)
    ]
    assert peaks == sorted(peaks)


@pytest.mark.parametrize("teeth", [17, 40])
def test_of_lines_alike_the_law_has_as_many_and_as_many_places_as_teeth(teeth):
    """Lines of unit size and much the same phase, beyond three sidebands; windows of two teeth."""
    rng = np.random.default_rng(teeth)
    number = np.arange(teeth - teeth // 2, 6 * teeth - teeth // 2)
    wheel = Gear(teeth, seed=1).recording(1)
    phase = rng.uniform(-2.0, 2.0, (1, len(number)))
    alike = {"number": number, "mesh": number % teeth == 0, "amplitude": np.exp(1j * phase)}
    found = locate(replace(wheel, **alike, variance=np.zeros(phase.shape)), numbered=True)
    far = np.abs((number + teeth // 2) % teeth - teeth // 2) > 3
    shape = 2 * far.sum() / teeth / 9
    tail = gamma_law.logsf(found.ratio, shape, scale=1 / shape) / math.log(10)
    assert found.log10_probability == pytest.approx(min(0.0, tail + math.log10(teeth)), rel=1e-6)
    assert found.log10_probability < 0.0


def test_too_few_lines_are_no_profile():
    gear = Gear(23, seed=4)
    assert locate(gear.recording(1, lines=slice(0, 12)), numbered=True) is None
    assert locate(gear.recording(1, lines=slice(0, 0)), numbered=True) is None


@pytest.mark.parametrize("shape", [0.5, 1.0, 3.7, 20.0])
@pytest.mark.parametrize("ratio", [0.3, 1.0, 4.0, 20.0])
def test_gamma_law(shape, ratio):
    expected = gamma_law.logsf(ratio, shape, scale=1 / shape) / math.log(10)
    assert _log10_gamma(shape, ratio) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_gamma_law_goes_on_where_floats_end():
    # continued: between the two branches nothing jumps, and the score goes on rising
    ratios = np.linspace(600, 700, 201)
    values = np.array([_log10_gamma(1.0, ratio) for ratio in ratios])
    np.testing.assert_allclose(values, -ratios / math.log(10), rtol=1e-9)
    assert _log10_gamma(3.0, 1e4) < _log10_gamma(3.0, 1e3) < -500


def _scaled(pattern, factor):
    return _changed(
        pattern, amplitude=pattern.amplitude * factor, variance=pattern.variance * factor**2
    )


def _swapped(pattern):
    return _changed(pattern, amplitude=pattern.amplitude[::-1], variance=pattern.variance[::-1])


def _changed(pattern, **changes):
    return replace(pattern, **changes)
