"""The gap of a tip corner outside the path of contact, in an external pair and in a ring."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.tooth_cases import PAPER

from gearmon.gears.excitation import tip_corner_gap
from gearmon.gears.geometry import GearTeeth, pair_geometry
from gearmon.gears.tooth_pairs import tooth_pair


def pair(teeth, *, internal):
    geometry = pair_geometry(
        GearTeeth(teeth=36, name="planet"),
        GearTeeth(
            teeth=teeth, tip_factor=0.9, name="ring" if internal else "gear", internal=internal
        ),
        module_m=2e-3,
        face_width_m=0.02,
    )
    root = geometry.gears[1].root_radius_m
    return tooth_pair(geometry, bore_radii_m=(0.0144, root + 7e-3 if internal else 0.4 * root))


@pytest.mark.parametrize("gears", [PAPER, pair(93, internal=True)])
@pytest.mark.parametrize("leaving", [True, False])
def test_gap_opens_with_the_square_of_the_distance(gears, leaving):
    beyond = np.array([0.0, 1e-4, 2e-4, 4e-4])
    gap = tip_corner_gap(gears, beyond, leaving=leaving)
    assert gap[0] == pytest.approx(0.0, abs=1e-12)
    assert gap[2:] / gap[1:-1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("leaving", [True, False])
def test_a_rack_is_the_limit_of_both(leaving):
    beyond = np.array([2e-4, 1e-3])
    outside, inside = (
        tip_corner_gap(pair(6000, internal=internal), beyond, leaving=leaving)
        for internal in (False, True)
    )
    np.testing.assert_allclose(inside, outside, rtol=0.03)


@pytest.mark.parametrize("leaving", [True, False])
def test_ring_against_points_of_both_flanks(leaving):
    """Both flanks as strings unwound from their base circles, in the plane."""
    gears = pair(93, internal=True)
    base = gears.first.base_radius_m, gears.second.base_radius_m
    centres = math.hypot(gears.line_m, base[1] - base[0])
    working = math.acos((base[1] - base[0]) / centres)
    middles = np.array([0.0, 0.0]), np.array([-centres, 0.0])
    beyond = 4e-4
    first = gears.path_m[1] + beyond if leaving else gears.path_m[0] - beyond
    rolls = first, first + gears.line_m
    own, mate = (0, 1) if leaving else (1, 0)

    def flank(index, strings):
        # foot of the string; at the present roll the foot lies on the line of action
        angle = -working + rolls[index] / base[index] - strings / base[index]
        foot = np.stack([np.cos(angle), np.sin(angle)], axis=-1) * base[index]
        along = np.stack([-np.sin(angle), np.cos(angle)], axis=-1) * strings[:, None]
        return middles[index] + foot + along

    tip = gears.teeth[own].tip_radius_m
    corner = flank(own, np.array([math.sqrt(tip**2 - base[own] ** 2)]))[0]
    strings = rolls[mate] + np.linspace(-3e-3, 3e-3, 6001)
    points = flank(mate, strings) - middles[mate]
    radii, angles = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    seen = corner - middles[mate]
    there = np.interp(np.hypot(*seen), radii, angles)
    slow = base[mate] * abs(there - math.atan2(seen[1], seen[0]))
    fast = tip_corner_gap(gears, np.array([beyond]), leaving=leaving)[0]
    assert fast == pytest.approx(slow, rel=1e-2)
