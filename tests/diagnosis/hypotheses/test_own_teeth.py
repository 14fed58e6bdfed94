"""Finding the departing tooth: planted damage, laws, and gears that are sound."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from reference.gear_patterns import CONTACT_CENTRE, Gear
from scipy.stats import gamma as gamma_law

from gearmon.diagnosis.hypotheses.own_teeth import _log10_gamma, locate

BOTH = (0, 1)


def search(new, healthy, *, numbered=True, same_zero=False, channels=BOTH):
    return locate(new, channels, healthy, channels, numbered=numbered, same_zero=same_zero)


def apart(one, other, teeth=23):
    """Distance of two places of a gear, in teeth, the shorter way round."""
    return abs((one - other + teeth / 2) % teeth - teeth / 2)


def three(gear, seed=50, **changes):
    return [gear.recording(seed + i, **changes) for i in range(3)]


@pytest.mark.parametrize("teeth", [17, 23, 57])
@pytest.mark.parametrize("share", [0.0, 0.35, 1.0])
def test_planted_tooth_is_found(teeth, share):
    gear = Gear(teeth, seed=teeth)
    tooth = 1 + round(share * (teeth - 1))
    found = search(gear.recording(1, tooth=tooth, spread_db=1.0), three(gear, spread_db=1.0))
    assert apart(found.tooth, tooth, teeth) <= 1
    assert found.log10_probability < -3
    assert found.against == "reference"
    assert found.energy.shape == (teeth,)
    assert apart(found.position * teeth, tooth - 1 + CONTACT_CENTRE, teeth) < 1.2
    # the energies are given at the teeth's entries into contact
    assert apart(int(np.argmax(found.energy)), tooth - 1 + CONTACT_CENTRE, teeth) < 1.7


@pytest.mark.parametrize("start", [0.0, 0.123, 0.5, 0.987])
def test_planted_tooth_is_found_whatever_the_angle_of_the_references(start):
    # the references start anywhere; only the new recording's zero is that of the tacho
    gear = Gear(23, seed=4)
    healthy = [gear.recording(50 + i, start=start + 0.31 * i) for i in range(3)]
    found = search(gear.recording(1, tooth=9), healthy)
    assert apart(found.tooth, 9) <= 1
    assert found.log10_probability < -3


def test_known_zero_needs_no_alignment():
    gear = Gear(23, seed=4)
    new, healthy = gear.recording(1, tooth=9, size=0.6), three(gear)
    free, fixed = search(new, healthy), search(new, healthy, same_zero=True)
    assert apart(fixed.tooth, 9) <= 1
    assert fixed.log10_probability == pytest.approx(free.log10_probability, rel=0.2)


def test_known_zero_is_believed():
    # turned references, said to share the zero, no longer cancel: the damage is buried
    gear = Gear(23, seed=4)
    new = gear.recording(1, tooth=9)
    turned = search(new, three(gear, start=0.3), same_zero=True)
    assert turned.log10_probability > search(new, three(gear), same_zero=True).log10_probability


def test_start_of_the_new_recording_moves_its_tooth():
    gear = Gear(23, seed=4)
    found = search(gear.recording(1, tooth=9, start=4 / 23), three(gear))
    assert apart(found.tooth, 5) <= 1


def test_without_a_tacho_no_tooth_is_numbered():
    gear = Gear(23, seed=4)
    found = search(gear.recording(1, tooth=9), three(gear), numbered=False)
    assert found.tooth is None
    assert 0 <= found.position < 1


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_healthy_gears_are_not_flagged(count):
    # noise, start and the gain of each band differ; everything else is the machine's
    alarms = 0
    for seed in range(60):
        gear = Gear(23, seed=seed)
        healthy = [
            gear.recording(1000 + 10 * seed + i, spread_db=1.0, start=0.1 * i) for i in range(count)
        ]
        found = search(gear.recording(5000 + seed, spread_db=1.0, start=0.77), healthy)
        alarms += found.log10_probability < -2
    assert alarms <= 1


def test_healthy_gears_are_not_flagged_without_a_reference():
    alarms = 0
    for seed in range(60):
        found = search(Gear(23, seed=seed).recording(seed), [])
        assert found.against == "other teeth"
        alarms += found.log10_probability < -2
    assert alarms <= 1


def test_a_gross_tooth_shows_against_the_other_teeth():
    gear = Gear(23, seed=4)
    found = search(gear.recording(1, tooth=9, size=5.0), [])
    assert apart(found.tooth, 9) <= 1
    assert found.against == "other teeth"
    assert found.log10_probability < -2


def test_a_reference_shows_what_the_other_teeth_do_not():
    gear = Gear(23, seed=4)
    new = gear.recording(1, tooth=9, size=0.3)
    assert search(new, three(gear)).log10_probability < search(new, []).log10_probability - 1


def test_more_damage_is_more_evidence():
    gear = Gear(23, seed=4)
    healthy = three(gear)
    logs = [
        search(gear.recording(1, tooth=9, size=size), healthy).log10_probability
        for size in (0.0, 0.2, 0.4, 0.8)
    ]
    assert logs == sorted(logs, reverse=True)
    assert logs[0] > -1


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_unit_does_not_matter(factor):
    gear = Gear(23, seed=4)
    one = search(gear.recording(1, tooth=9), three(gear))
    scaled = [_scaled(p, factor) for p in (gear.recording(1, tooth=9), *three(gear))]
    two = search(scaled[0], scaled[1:])
    assert two.tooth == one.tooth
    assert two.log10_probability == pytest.approx(one.log10_probability, rel=1e-6)


def test_channels_may_stand_elsewhere_in_the_reference():
    gear = Gear(23, seed=4)
    new, healthy = gear.recording(1, tooth=9), three(gear)
    swapped = [_swapped(pattern) for pattern in healthy]
    one = locate(new, (0, 1), healthy, (0, 1), numbered=True, same_zero=False)
    two = locate(new, (0, 1), swapped, (1, 0), numbered=True, same_zero=False)
    three_ = locate(_swapped(new), (1, 0), swapped, (1, 0), numbered=True, same_zero=False)
    for other in (two, three_):
        assert other.log10_probability == pytest.approx(one.log10_probability, rel=1e-9)
        np.testing.assert_allclose(other.energy, one.energy, rtol=1e-9)


def test_order_of_the_references_does_not_matter():
    gear = Gear(23, seed=4)
    new, healthy = gear.recording(1, tooth=9), three(gear, spread_db=1.0)
    one, two = search(new, healthy), search(new, healthy[::-1])
    assert two.log10_probability == pytest.approx(one.log10_probability, rel=1e-6)


def test_the_lower_top_of_two_recordings_counts():
    gear = Gear(23, seed=4)
    short = [gear.recording(50 + i, lines=slice(0, 80)) for i in range(3)]
    assert apart(search(gear.recording(1, tooth=9), short).tooth, 9) <= 1


def test_too_few_lines_are_no_profile():
    gear = Gear(23, seed=4)
    few, none = slice(0, 12), slice(0, 0)
    assert search(gear.recording(1, lines=few), []) is None
    assert search(gear.recording(1, lines=none), []) is None
    assert search(gear.recording(1), [gear.recording(2, lines=none)]) is None


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
