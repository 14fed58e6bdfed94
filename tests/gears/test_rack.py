"""Fillet and undercut against a rack that cuts step by step."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.tooth_generation import half_angle_after_cutting

from gearmon.errors import ArgumentError
from gearmon.gears.geometry import RackTooth

ALPHA = math.radians(20)


def rack(teeth=17, shift=0.0, dedendum=1.25, alpha=ALPHA, helix=0.0, internal=False):
    return RackTooth(
        teeth=teeth,
        profile_shift=shift,
        root_factor=dedendum,
        pressure_angle_rad=alpha,
        helix_angle_rad=helix,
        internal=internal,
    )


def flank_half_angle(basic, radius):
    base = 0.5 * basic.teeth * math.cos(basic.transverse_pressure_angle_rad)
    base /= math.cos(basic.helix_angle_rad)
    tangent = math.sqrt(max((radius / base) ** 2 - 1, 0.0))
    return basic.base_half_angle - (tangent - math.atan(tangent))


def test_standard_rack():
    assert rack().rounding == pytest.approx(0.37995, abs=5e-6)
    assert rack().straight_depth == pytest.approx(1.0)
    assert rack().least_shift == pytest.approx(1 - 8.5 * math.sin(ALPHA) ** 2)
    assert rack().least_teeth == 18
    assert rack().least_teeth == math.ceil(2 / math.sin(ALPHA) ** 2)


def test_little_room_rounds_the_rack_tip_fully():
    full = rack(alpha=math.radians(25))
    middle = math.pi / 4 + full.straight_depth * math.tan(full.pressure_angle_rad)
    middle += full.rounding * math.cos(full.pressure_angle_rad)
    assert middle == pytest.approx(math.pi / 2)
    with pytest.raises(ArgumentError, match=r"root_factor=2\.2 makes the rack pointed"):
        _ = rack(dedendum=2.2).rounding


@pytest.mark.parametrize(("teeth", "shift"), [(18, 0.0), (26, 0.0), (53, 0.3), (20, -0.05)])
@pytest.mark.parametrize("helix", [0.0, 0.4])
def test_fillet_runs_from_root_circle_to_involute(teeth, shift, helix):
    basic = rack(teeth, shift, helix=helix)
    points = basic.fillet([ALPHA, math.pi / 2])
    radii = np.abs(points)
    pitch = 0.5 * teeth / math.cos(helix)
    assert radii[1] == pytest.approx(pitch + shift - 1.25)
    base = pitch * math.cos(basic.transverse_pressure_angle_rad)
    form = basic.form_roll
    assert radii[0] == pytest.approx(math.hypot(base, form))
    angle = math.atan2(points[0].real, points[0].imag)
    assert angle == pytest.approx(flank_half_angle(basic, radii[0]))


@pytest.mark.parametrize(("teeth", "shift"), [(26, 0.0), (53, 0.0), (18, 0.4), (12, 0.0), (9, 0.1)])
def test_tooth_is_what_the_rack_leaves_standing(teeth, shift):
    """Fillet, involute and, for few teeth, the undercut between them."""
    basic = rack(teeth, shift)
    points = basic.fillet(np.linspace(ALPHA, math.pi / 2, 400))
    points = points[np.argsort(np.abs(points))]
    base = 0.5 * teeth * math.cos(ALPHA)
    form = math.hypot(base, basic.form_roll)
    for radius in np.linspace(0.5 * teeth + shift - 1.2, 0.5 * teeth + shift + 0.8, 9):
        slow = half_angle_after_cutting(radius, teeth, shift, basic)
        if radius >= form:
            fast = flank_half_angle(basic, radius)
        else:
            # an undercut fillet turns back beyond the form circle: take the part below it
            radii, angles = np.abs(points), np.arctan2(points.real, points.imag)
            below = radii <= form + 1e-9
            fast = np.interp(radius, radii[below], angles[below])
        assert fast == pytest.approx(slow, abs=2e-5)


def test_form_circle_grows_continuously_into_undercut():
    limit = rack(15).least_shift
    above, below = (rack(15, limit + step).form_roll for step in (1e-6, -1e-6))
    assert above == pytest.approx(0.0, abs=1e-4)
    assert below < 0.05
    assert rack(15, limit - 0.3).form_roll > rack(15, limit - 0.1).form_roll > below


def test_ring_involute_ends_near_its_root():
    roll = rack(90, internal=True).form_roll
    assert roll == pytest.approx(math.sqrt(46**2 - (45 * math.cos(ALPHA)) ** 2))
