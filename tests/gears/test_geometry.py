"""Geometry against published pairs, points in the plane and laws of the involute."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from reference.tooth_generation import path_of_contact, ring_path_of_contact

from gearmon.errors import ArgumentError
from gearmon.gears.geometry import (
    GearTeeth,
    PairGeometry,
    _tip_passage,
    contact_zones,
    inverse_involute,
    involute,
    pair_geometry,
)

DEG = math.pi / 180
RING = {"name": "ring", "internal": True}


def gear(teeth, shift=0.0, **data):
    return GearTeeth(teeth=teeth, profile_shift=shift, **data)


def working_radii_m(pair):
    return [radius / math.cos(pair.working_pressure_angle_rad) for radius in pair.base_radii_m]


@st.composite
def pairs(draw, internal=False):
    """Random pairs that can run."""
    first = gear(draw(st.integers(12, 60)), draw(st.floats(-0.2, 0.8)), name="pinion")
    teeth = first.teeth + draw(st.integers(15, 80)) if internal else draw(st.integers(12, 120))
    second = gear(teeth, draw(st.floats(-0.3, 0.6)), **(RING if internal else {}))
    helix = draw(st.sampled_from([0.0, 10 * DEG, 25 * DEG]))
    try:
        return pair_geometry(
            first,
            second,
            module_m=draw(st.floats(5e-4, 0.03)),
            helix_angle_rad=helix,
            face_width_m=0.05,
        )
    except ArgumentError:
        assume(False)
        raise


# --- published pairs -----------------------------------------------------------------------------
# FZG C14 and H501: public listing of a gear design script; planetary stage: report of a commercial
# gear program; 62/62: test of a public rotor dynamics package

PUBLISHED = [
    (
        pair_geometry(
            gear(16, 0.1817, tip_shortening=0.0),
            gear(24, 0.1715, tip_shortening=0.0),
            module_m=0.0045,
            centre_distance_m=0.0915,
        ),
        (41.318, 59.272, 91.5, 22.439, 19.4291, 1.46253),
    ),
    (
        pair_geometry(
            gear(20, 0.1809),
            gear(30, 0.0891),
            module_m=0.0035,
            helix_angle_rad=15 * DEG,
            face_width_m=0.02,
            centre_distance_m=0.0915,
        ),
        (40.336, 58.132, 91.5, 22.115, 15.5513, 1.45990),
    ),
    (
        pair_geometry(gear(18, 0.3890), gear(36, 0.5039), module_m=0.021, centre_distance_m=0.584),
        (216.419, 407.8315, 584.0, 24.169, 84.9525, 1.37032),
    ),
    (
        pair_geometry(gear(62), gear(62), module_m=0.002),
        (64.0, 64.0, 124.0, 20.0, 10.5673, 1.7897799),
    ),
]


@pytest.mark.parametrize(("pair", "row"), PUBLISHED)
def test_published_pairs(pair, row):
    found = (
        *(1e3 * radius for radius in pair.tip_radii_m),
        1e3 * pair.centre_distance_m,
        pair.working_pressure_angle_rad / DEG,
        1e3 * pair.path_length_m,
        pair.transverse_contact_ratio,
    )
    assert found == pytest.approx(row, rel=1e-4)


def test_contact_ratio_of_unshifted_pair_to_the_last_published_digit():
    pair = pair_geometry(gear(62), gear(62), module_m=0.002)
    assert pair.transverse_contact_ratio == pytest.approx(1.78977987, abs=5e-9)


@pytest.mark.parametrize(
    ("z1", "z2", "module", "expected"),
    [(26, 53, 2.0, 1.692757), (62, 42, 2.0, 1.756360), (19, 48, 3.175, 1.645626)],
)
def test_contact_ratios_of_standard_pairs(z1, z2, module, expected):
    pair = pair_geometry(gear(z1), gear(z2), module_m=1e-3 * module)
    assert pair.transverse_contact_ratio == pytest.approx(expected, abs=1e-6)


def test_contact_ratio_of_another_published_pair():
    """25/30, module 2: 1.6326 in the documentation of the same package."""
    pair = pair_geometry(gear(25), gear(30), module_m=0.002)
    assert pair.transverse_contact_ratio == pytest.approx(1.6326, abs=5e-5)


def test_planet_in_ring_matches_published_contact_ratio():
    """The planet's tips are those of its mesh with the sun."""
    ring = pair_geometry(
        gear(36, 0.5039, tip_shortening=-0.083376),
        gear(93, 0.1171, **RING),
        module_m=0.021,
        centre_distance_m=0.584,
    )
    assert ring.transverse_contact_ratio == pytest.approx(1.618, abs=1e-3)


def test_reference_pair_decoded():
    """Base diameters and base pitch of 26/53, module 2: published to 1e-3 mm."""
    pair = pair_geometry(gear(26), gear(53), module_m=0.002)
    assert 2e3 * pair.base_radii_m[0] == pytest.approx(48.86402, abs=1e-5)
    assert 2e3 * pair.base_radii_m[1] == pytest.approx(99.60742, abs=1e-5)
    assert 1e3 * pair.base_pitch_m == pytest.approx(5.904263, abs=1e-6)
    assert 1e3 * pair.path_length_m == pytest.approx(9.99448, abs=1e-5)


@pytest.mark.parametrize(
    "data",
    [
        {"first": gear(26, tip_factor=0.8154), "second": gear(53, tip_factor=0.8154)},
        {"first": gear(26), "second": gear(53), "centre_distance_m": 0.079582},
        {"first": gear(26, 0.59), "second": gear(53, 0.59)},
    ],
)
def test_three_ways_to_the_published_contact_ratio(data):
    first, second = data.pop("first"), data.pop("second")
    pair = pair_geometry(first, second, module_m=0.002, **data)
    assert pair.transverse_contact_ratio == pytest.approx(1.4122, abs=2e-4)


@pytest.mark.parametrize(("beta", "base"), [(5, 49.029), (10, 49.528), (15, 50.377)])
def test_base_diameters_of_the_reference_pinion_if_it_were_helical(beta, base):
    helical = pair_geometry(
        gear(26), gear(53), module_m=0.002, helix_angle_rad=beta * DEG, face_width_m=0.02
    )
    assert 2e3 * helical.base_radii_m[0] == pytest.approx(base, abs=6e-4)


def test_working_circles_of_the_ways_to_the_published_contact_ratio():
    wide = pair_geometry(gear(26), gear(53), module_m=0.002, centre_distance_m=0.079582)
    assert wide.working_pressure_angle_rad / DEG == pytest.approx(21.121, abs=1e-3)
    shifted = pair_geometry(gear(26, 0.59), gear(53, 0.59), module_m=0.002)
    assert 1e3 * shifted.centre_distance_m == pytest.approx(81.157, abs=1e-3)
    assert shifted.working_pressure_angle_rad / DEG == pytest.approx(23.834, abs=1e-3)


@pytest.mark.parametrize(("teeth", "inside"), [(41, True), (42, False)])
def test_root_circle_passes_the_base_circle_above_41_teeth(teeth, inside):
    pair = pair_geometry(gear(teeth), gear(60), module_m=0.002)
    assert (pair.gears[0].root_radius_m < pair.base_radii_m[0]) == inside


def test_circle_on_which_the_involute_begins():
    """r_C = sqrt((R_b tan alpha - h_a m/sin alpha)^2 + R_b^2) of the standard rack."""
    pair = pair_geometry(gear(26), gear(53), module_m=0.002)
    for index in (0, 1):
        base = pair.base_radii_m[index]
        start = math.hypot(base * math.tan(20 * DEG) - 0.002 / math.sin(20 * DEG), base)
        assert math.hypot(base, pair.gears[index].form_roll) == pytest.approx(start, rel=1e-12)


def test_profile_shift_follows_from_centre_distance():
    """The published 500 mm of 17/103 takes a sum of shifts of 0.145222."""
    shifted = pair_geometry(
        gear(17, 0.145222, root_factor=1.4),
        gear(103, root_factor=1.4),
        module_m=0.008,
        helix_angle_rad=15.8 * DEG,
        face_width_m=0.1,
    )
    assert 1e3 * shifted.centre_distance_m == pytest.approx(500, abs=2e-5)


def test_overlap_ratio():
    pair = pair_geometry(
        gear(25), gear(40), module_m=0.002, helix_angle_rad=20 * DEG, face_width_m=0.02
    )
    assert pair.overlap_ratio == pytest.approx(20 * math.sin(20 * DEG) / (2 * math.pi))
    total = pair.transverse_contact_ratio + pair.overlap_ratio
    assert pair.total_contact_ratio == pytest.approx(total)


# worked examples of gear makers' handbooks (KHK; Stock Drive Products): 12/24 with both shifts,
# helical 12/60, and 16 teeth in a ring of 24; a_w, alpha_wt, d_a, d_w and contact ratio
HANDBOOK = [
    (
        (gear(12, 0.6), gear(24, 0.36), {}),
        (56.4999, 26.0886, 44.840, 79.400, 37.667, 75.333, 1.202),
    ),
    (
        (gear(12, 0.09809), gear(60), {"helix_angle_rad": 30 * DEG, "face_width_m": 0.03}),
        (125.0, 23.1126, 48.153, 213.842, 41.667, 208.333, 1.2939),
    ),
    (
        (gear(16), gear(24, -0.5, **RING), {"check": False}),
        (13.1683, 31.0937, 54.0, 69.0, 52.673, 79.010, 1.679),
    ),
]


@pytest.mark.parametrize(("data", "row"), HANDBOOK)
def test_handbook_pairs(data, row):
    first, second, choices = data
    pair = pair_geometry(first, second, module_m=0.003, **choices)
    found = (
        1e3 * pair.centre_distance_m,
        pair.working_pressure_angle_rad / DEG,
        *(2e3 * radius for radius in (*pair.tip_radii_m, *working_radii_m(pair))),
        pair.transverse_contact_ratio,
    )
    assert found[:-1] == pytest.approx(row[:-1], rel=2e-5)
    assert found[-1] == pytest.approx(row[-1], abs=6e-4)


# --- slow versions and laws ----------------------------------------------------------------------


@given(pairs())
def test_path_of_contact_is_cut_off_by_the_tip_circles(pair: PairGeometry):
    distance = pair.centre_distance_m
    slow = path_of_contact(pair.base_radii_m, pair.tip_radii_m, distance)
    assert pair.path_m == pytest.approx(slow, rel=1e-9, abs=1e-12)


@given(pairs(internal=True))
def test_path_of_contact_in_a_ring(pair: PairGeometry):
    slow = ring_path_of_contact(pair.base_radii_m, pair.tip_radii_m, pair.centre_distance_m)
    assert pair.path_m == pytest.approx(slow, rel=1e-9, abs=1e-12)


@given(pairs())
def test_a_pair_and_its_mirror_image(pair: PairGeometry):
    mirror = pair_geometry(
        *reversed(pair.gears),
        module_m=pair.gears[0].module_m,
        helix_angle_rad=pair.helix_angle_rad,
        face_width_m=pair.face_width_m,
    )
    assert mirror.transverse_contact_ratio == pytest.approx(pair.transverse_contact_ratio)
    across = pair.transverse_contact_ratio - pair.pitch_point_phase
    assert mirror.pitch_point_phase == pytest.approx(across, abs=1e-9)


@given(pairs(), st.floats(0.2, 5.0))
def test_similar_gears_have_similar_geometry(pair: PairGeometry, scale):
    similar = pair_geometry(
        *pair.gears,
        module_m=scale * pair.gears[0].module_m,
        helix_angle_rad=pair.helix_angle_rad,
        face_width_m=scale * pair.face_width_m,
    )
    assert similar.total_contact_ratio == pytest.approx(pair.total_contact_ratio)
    assert similar.path_length_m == pytest.approx(scale * pair.path_length_m)


@given(pairs())
def test_teeth_fill_the_working_circle_without_backlash(pair: PairGeometry):
    """Without backlash the thicknesses on the working circles add up to the pitch there."""
    radii = working_radii_m(pair)
    sum_ = sum(own.thickness_m(radius) for own, radius in zip(pair.gears, radii, strict=True))
    pitch = 2 * math.pi * radii[0] / pair.gears[0].teeth
    assert sum_ == pytest.approx(pitch, rel=1e-9)


@given(pairs(internal=True))
def test_ring_teeth_fill_the_working_circle_too(pair: PairGeometry):
    radii = working_radii_m(pair)
    sum_ = sum(own.thickness_m(radius) for own, radius in zip(pair.gears, radii, strict=True))
    pitch = 2 * math.pi * radii[0] / pair.gears[0].teeth
    assert sum_ == pytest.approx(pitch, rel=1e-9)


def test_thickness_on_the_reference_circle():
    pair = pair_geometry(gear(20, 0.3), gear(40), module_m=0.001)
    expected = 1e-3 * (math.pi / 2 + 2 * 0.3 * math.tan(20 * DEG))
    assert pair.gears[0].thickness_m(pair.gears[0].reference_radius_m) == pytest.approx(expected)


def test_a_large_ring_is_a_rack():
    """With growing tooth number external and internal mates come to the same path of contact."""
    data = {"module_m": 0.001}
    outer = pair_geometry(gear(30), gear(2_000_000), **data)
    inner = pair_geometry(gear(30), gear(2_000_000, **RING), **data)
    ratio = pytest.approx(outer.transverse_contact_ratio, abs=1e-4)
    assert inner.transverse_contact_ratio == ratio


@given(st.floats(0.05, 1.5))
def test_inverse_involute(angle):
    assert inverse_involute(involute(angle)) == pytest.approx(angle, rel=1e-9)


def test_inverse_involute_of_zero_and_below():
    assert inverse_involute(0.0) == 0.0
    with pytest.raises(ArgumentError, match="must be >= 0"):
        inverse_involute(-0.1)


@given(st.floats(1.0, 5.0))
def test_zones_cover_the_contact(ratio):
    edges, pairs = contact_zones(ratio)
    assert edges[0] == 0
    assert edges[-1] == pytest.approx(ratio, abs=1e-12)
    assert (np.diff(edges) > 0).all()
    middle = 0.5 * (edges[:-1] + edges[1:])
    entries = np.arange(-6, 7)
    since = middle[:, None] - entries
    carrying = ((since >= 0) & (since < ratio)).sum(axis=1)
    assert pairs.tolist() == carrying.tolist()


def test_zones_of_a_helical_pair_count_all_pairs_that_touch():
    pair = pair_geometry(
        gear(30), gear(50), module_m=0.002, helix_angle_rad=30 * DEG, face_width_m=0.04
    )
    assert pair.total_contact_ratio > 4
    assert contact_zones(pair.total_contact_ratio)[1].max() == math.ceil(pair.total_contact_ratio)


@pytest.mark.parametrize(("tip", "root", "fewest"), [(1.3, 1.6, 2), (1.0, 1.25, 1)])
def test_zones_of_a_spur_pair_say_how_many_pairs_carry(tip, root, fewest):
    """Long addenda: two and three pairs in turn, over eps - 2 and 3 - eps of the mesh period."""
    pair = pair_geometry(
        gear(40, tip_factor=tip, root_factor=root),
        gear(60, tip_factor=tip, root_factor=root),
        module_m=0.002,
    )
    eps = pair.transverse_contact_ratio
    assert math.floor(eps) == fewest
    edges, pairs = contact_zones(pair.total_contact_ratio)
    assert set(pairs.tolist()) == {fewest, fewest + 1}
    many = np.diff(edges)[pairs == fewest + 1].sum()
    assert many == pytest.approx((fewest + 1) * (eps - fewest))


# --- pairs that cannot run -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "second", "data", "match"),
    [
        (gear(10, name="pinion"), gear(40), {}, r"undercut at profile_shift_pinion=0; give at "),
        (gear(40), gear(10, name="gear"), {}, "10 teeth are undercut"),
        (gear(200, tip_factor=1.2, name="pinion"), gear(30), {}, r"of the gear \(interference\)"),
        (gear(30, name="pinion"), gear(200, tip_factor=1.2), {}, r"pinion \(interference\)"),
        (gear(12, 1.2, name="pinion"), gear(80), {}, "teeth of the pinion are pointed"),
        (gear(20, tip_factor=0.5), gear(30, tip_factor=0.5), {}, "contact ratio 0.* is below 1"),
        (gear(20), gear(30), {"centre_distance_m": 0.0245}, "jams the teeth"),
        (gear(20), gear(30), {"centre_distance_m": 0.0230}, "sum of the base radii"),
        (gear(20, root_factor=1.0), gear(30, tip_factor=1.05), {}, "run .* mm into the roots"),
        (gear(30), gear(30, internal=True), {}, "must be > gear_teeth"),
        (gear(30), gear(33, **RING), {}, "ring"),
        (gear(30), gear(60, tip_factor=1.5, **RING), {}, "tip_factor_ring <="),
        (gear(20, -1.9), gear(20, -1.9), {}, "no working pressure angle"),
        (gear(20), gear(30), {"module_m": -1.0}, "module_m=-1.0 m must be > 0"),
        (gear(20), gear(30), {"helix_angle_rad": 1.0}, "helix_angle_rad"),
    ],
)
def test_pairs_that_cannot_run_are_refused(first, second, data, match):
    with pytest.raises(ArgumentError, match=match):
        pair_geometry(first, second, **{"module_m": 0.001, "face_width_m": 0.01, **data})


def test_the_cure_in_the_message_cures():
    with pytest.raises(ArgumentError, match=r"give at least 0\.4151, or 18 teeth"):
        pair_geometry(gear(10, name="pinion"), gear(40), module_m=0.001)
    assert pair_geometry(gear(10, 0.4152), gear(40), module_m=0.001).warnings == ()
    assert pair_geometry(gear(18), gear(40), module_m=0.001).warnings == ()


def test_undercut_outside_the_path_of_contact_is_a_warning():
    """FZG type A, a standard test gear, has a slightly undercut wheel that runs well."""
    pair = pair_geometry(
        gear(16, 0.8532, name="pinion", tip_shortening=0.0),
        gear(24, -0.5, name="gear", tip_shortening=0.0),
        module_m=0.0045,
        centre_distance_m=0.0915,
    )
    assert any("gear are undercut below the path of contact" in text for text in pair.warnings)


@pytest.mark.parametrize(("teeth", "shift"), [(13, 0.0), (24, -0.62), (12, 0.05)])
def test_deep_undercut_is_refused_though_the_mate_stays_clear_of_it(teeth, shift):
    """Beyond the practical limit of 14 teeth; the cure in the message cures."""
    short = gear(22, 0.5, tip_factor=0.75, name="pinion")
    with pytest.raises(ArgumentError, match=r"undercut at profile_shift_gear=.*practical limit"):
        pair_geometry(short, gear(teeth, shift, name="gear"), module_m=0.001)
    least = 1 - 0.5 * teeth * math.sin(20 * DEG) ** 2
    cured = pair_geometry(short, gear(teeth, least + 1e-4, name="gear"), module_m=0.001)
    assert not any("undercut" in text for text in cured.warnings)


@pytest.mark.parametrize("teeth", [15, 16, 17])
def test_practical_limit_of_undercut(teeth):
    """15 equal teeth run, with a warning, where 18 are needed in theory: no tip comes so deep."""
    pair = pair_geometry(gear(teeth, name="pinion"), gear(teeth), module_m=0.001)
    assert any("undercut below the path of contact" in text for text in pair.warnings)


@pytest.mark.parametrize("teeth", [20, 30, 50])
def test_tips_of_standard_teeth_pass_from_nine_more_in_the_ring_on(teeth):
    """The handbooks' limit of trochoid interference at 20 degrees."""
    for more in (8, 9):
        pair = pair_geometry(gear(teeth), gear(teeth + more, **RING), module_m=0.001, check=False)
        assert (_tip_passage(pair) >= 0) == (more == 9)


def test_a_planet_that_only_goes_in_along_its_axis_is_a_warning():
    pair = pair_geometry(
        gear(40, name="planet"),
        gear(50, tip_factor=0.6, **RING),
        module_m=0.001,
    )
    assert any("cannot be put into the ring radially" in text for text in pair.warnings)
    roomy = pair_geometry(
        gear(40, name="planet"), gear(100, tip_factor=0.9, **RING), module_m=0.001
    )  # fmt: skip
    assert roomy.warnings == ()


@given(st.integers(20, 60), st.integers(9, 40), st.floats(0.55, 0.85), st.floats(-0.2, 0.5))
def test_radial_assembly_against_moving_the_planet_in(teeth, more, tip, shift):
    """Corners of the planet's tips must pass those of the ring's on the way to its place."""
    try:
        pair = pair_geometry(
            gear(teeth, shift, tip_factor=0.9),
            gear(teeth + more, shift, tip_factor=tip, **RING),
            module_m=0.001,
        )
    except ArgumentError:
        assume(False)
    room = radial_room(pair)
    assume(abs(room) > 2e-3)
    assert any("radially" in text for text in pair.warnings) == (room < 0)


def radial_room(pair):
    """Least angle on the ring between corners of tips at equal distance from the line of centres.

    The flanks touch on the line of centres' side of the drive; away from there the planet turns
    in step with the ring, tooth by tooth, and moves straight along the line of centres.
    """
    working = involute(pair.working_pressure_angle_rad)
    inner, outer = pair.tip_radii_m
    corners = [
        involute(math.acos(base / tip)) - working
        for base, tip in zip(pair.base_radii_m, pair.tip_radii_m, strict=True)
    ]
    angle = np.linspace(1e-3, math.pi / 2 - 1e-9, 20_001)
    reach = inner * np.sin(angle) / outer
    angle, reach = angle[reach < 1], reach[reach < 1]
    # a corner of the planet at `angle` from the centres stands for a turn of angle + corner
    ratio = pair.gears[0].teeth / pair.gears[1].teeth
    gap = (angle + corners[0]) * ratio - (np.arcsin(reach) + corners[1])
    return float(gap.min() / ratio)


def test_tips_of_a_planet_that_meet_the_roots_of_its_ring_are_refused():
    ring = gear(100, tip_factor=0.9, root_factor=0.9, **RING)
    with pytest.raises(
        ArgumentError, match=r"of the planet run 0\.1 mm into the roots of the ring"
    ):
        pair_geometry(gear(40, name="planet"), ring, module_m=0.001)


def test_ring_tips_are_relieved_with_a_warning():
    pair = pair_geometry(gear(40, name="planet"), gear(100, **RING), module_m=0.001)
    assert "taken as relieved by 0.077 modules" in pair.warnings[0]
    assert pair.path_m[0] == pytest.approx(pair.gears[0].form_roll)
    told = pair_geometry(
        gear(40, name="planet"),
        gear(100, tip_factor=0.9, **RING),
        module_m=0.001,
    )
    assert told.warnings == ()


@pytest.mark.parametrize("shortening", [None, 0.03, -0.03])
def test_ring_tips_are_relieved_to_where_the_involute_of_the_planet_begins(shortening):
    """However far they reach by themselves."""
    planet, ring = gear(40, name="planet"), gear(100, tip_shortening=shortening, **RING)
    pair = pair_geometry(planet, ring, module_m=0.001)
    assert pair.path_m[0] == pytest.approx(pair.gears[0].form_roll, rel=1e-12)
    assert len(pair.warnings) == 1


def test_backlash_of_a_wide_centre_distance_is_a_warning():
    pair = pair_geometry(gear(26), gear(53), module_m=0.002, centre_distance_m=0.079582)
    assert "much backlash" in pair.warnings[0]


def test_unchecked_pair_has_circles_whatever_its_teeth():
    pair = pair_geometry(gear(10), gear(40), module_m=0.001, check=False)
    assert pair.base_radii_m[0] == pytest.approx(0.005 * math.cos(20 * DEG))


def test_gear_teeth_are_checked():
    with pytest.raises(ArgumentError, match="sun_teeth=4 must be a whole number >= 5"):
        GearTeeth(teeth=4, name="sun")


def test_no_thickness_inside_the_base_circle():
    pair = pair_geometry(gear(20), gear(30), module_m=0.001)
    with pytest.raises(ArgumentError, match="must be >= base radius"):
        pair.gears[0].thickness_m(0.009)
