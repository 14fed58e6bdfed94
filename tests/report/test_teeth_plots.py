"""Teeth are drawn to scale, in contact, with their damage."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from gearmon.gears.faults import parse_fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.tooth_damage import tooth_damage
from gearmon.gears.tooth_pairs import teeth_of
from gearmon.machine import ParallelStage, PlanetaryStage
from gearmon.report.teeth_plots import POINTS, half_profile, plot_flank, plot_teeth, teeth_picture

STAGE = ParallelStage(
    pinion_teeth=26,
    gear_teeth=53,
    module_mm=2.0,
    face_width_mm=20.0,
    bore_diameter_pinion_mm=20.8,
    bore_diameter_gear_mm=42.4,
)
PLANETARY = PlanetaryStage(
    sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=2.0, face_width_mm=20.0
)
BOTH_PAIRS = pytest.mark.parametrize("pair", [mesh_pairs(STAGE)[0], mesh_pairs(PLANETARY)[1]])


def test_teeth_touch_and_do_not_overlap():
    """The contact lies on both profiles, on the line of action, and nothing else touches."""
    pair = teeth_of(mesh_pairs(STAGE)[0])
    for phase in (0.2, 0.8, 1.5):
        picture = teeth_picture(pair, phase=phase)
        one, two = (gear.outline for gear in picture.gears)
        for outline in (one, two):
            away = np.hypot(*(outline - picture.contact).T).min()
            assert away < 0.06
        radius = np.hypot(*(one - [0.0, 0.0]).T)
        assert radius.max() == pytest.approx(1e3 * pair.first.tip_radius_m, rel=1e-3)
        beyond = np.hypot(*(two - [0.0, 79.0]).T)
        assert beyond.max() == pytest.approx(1e3 * pair.second.tip_radius_m, rel=1e-3)


@BOTH_PAIRS
def test_the_contact_moves_evenly_along_a_line_and_is_drawn_in_its_middle_by_default(pair):
    pair = teeth_of(pair)
    first, last = (teeth_picture(pair, phase=own).contact for own in (0.0, pair.contact_ratio))
    assert teeth_picture(pair).contact == pytest.approx((first + last) / 2)


@BOTH_PAIRS
def test_teeth_and_spaces_of_the_picture_are_equally_wide_on_the_reference_circle(pair):
    pair = teeth_of(pair)
    centres = 0.0, 1e3 * pair.centres_m[0]
    for gear, tooth, centre in zip(teeth_picture(pair).gears, pair.teeth, centres, strict=True):
        points = gear.outline @ [1, 1j] - 1j * centre
        radius, angle = np.abs(points), np.unwrap(np.angle(points))
        over = radius - 1e3 * tooth.reference_radius_m
        last = np.flatnonzero(np.diff(over > 0))
        share = over[last] / (over[last] - over[last + 1])
        crossed = angle[last] + share * (angle[last + 1] - angle[last])
        assert np.abs(np.diff(crossed)) == pytest.approx(np.full(9, np.pi / tooth.teeth), rel=1e-3)


def test_bodies_are_filled_on_the_side_of_their_centres():
    picture = teeth_picture(teeth_of(mesh_pairs(STAGE)[0]))
    ax = Figure().add_subplot()
    plot_teeth(picture, ax)
    below, above = (patch.get_path().vertices[:, 1] for patch in ax.patches[:2])
    one, two = (gear.outline[:, 1] for gear in picture.gears)
    assert below.max() == one.max()
    assert below.min() < one.min() - np.ptp(one)
    assert above.min() == two.min()
    assert above.max() > two.max() + np.ptp(two)


def test_the_loaded_tooth_stands_in_the_middle_of_five():
    pair = teeth_of(mesh_pairs(STAGE)[0])
    picture = teeth_picture(pair, phase=0.8)
    for gear in picture.gears:
        loaded = np.hypot(*(gear.outline - picture.contact).T).argmin()
        assert 0.4 < loaded / len(gear.outline) < 0.6


def test_profile_runs_from_root_to_tip():
    tooth = teeth_of(mesh_pairs(STAGE)[0]).first
    radius = np.abs(half_profile(tooth))
    assert radius[0] == pytest.approx(tooth.root_radius_m, rel=1e-9)
    assert radius[-1] == pytest.approx(tooth.tip_radius_m, rel=1e-9)
    assert (np.diff(radius) > -1e-12).all()


def test_crack_is_drawn_to_scale():
    pair = teeth_of(mesh_pairs(STAGE)[0])
    picture = teeth_picture(pair, [parse_fault("crack:1:pinion:5:1.5mm,width=8,from=3")])
    (crack,) = picture.gears[0].damage
    assert np.hypot(*np.diff(crack.section, axis=0).T) == pytest.approx(1.5)
    assert (crack.face_start, crack.face_width) == pytest.approx((3.0, 8.0))
    for deepest in ("1mm,far=1.5", "1.5mm,far=1"):
        (crack,) = teeth_picture(pair, [parse_fault(f"crack:1:gear:5:{deepest}")]).gears[1].damage
        assert np.hypot(*np.diff(crack.section, axis=0).T) == pytest.approx(1.5)


def test_a_broken_tip_is_drawn_down_from_the_tip():
    pair = teeth_of(mesh_pairs(STAGE)[0])
    for height in (0.5, 1.5):
        fault = parse_fault(f"breakage:1:pinion:5:6mm,height={height},from=3")
        gear = teeth_picture(pair, [fault]).gears[0]
        (gone,) = gear.damage
        assert (gone.low, gone.high) == pytest.approx((gear.tip - height, gear.tip))
        assert (gone.face_start, gone.face_width) == pytest.approx((3.0, 6.0))
    (gone,) = teeth_picture(pair, [parse_fault("missing:1:pinion:5")]).gears[0].damage
    assert (gone.face_start, gone.face_width, gone.low) == pytest.approx((0.0, 20.0, 0.0))


def test_spall_is_drawn_to_scale():
    pair = teeth_of(mesh_pairs(STAGE)[0])
    picture = teeth_picture(pair, [parse_fault("spall:1:gear:5:6x1.5x0.5mm,from=2")])
    (spall,) = picture.gears[1].damage
    assert (spall.face_start, spall.face_width) == pytest.approx((2.0, 6.0))
    assert spall.high - spall.low == pytest.approx(1.5)
    # the middle of its floor lies half a millimetre inside the tooth: the outline goes round it
    surface, floor = spall.section[[30, -31]] @ [1, 1j]
    assert abs(surface - floor) == pytest.approx(0.5)
    around = picture.gears[1].outline @ [1, 1j] - floor
    turns = np.angle(np.roll(around, -1) / around).sum() / (2 * np.pi)
    assert abs(turns) == pytest.approx(1.0)


@pytest.mark.parametrize("fault", ["spall:1:gear:5:6x0.8x0.2mm", "pitting:1:gear:5:20%flank"])
def test_a_spall_is_cut_as_a_rectangle_and_a_pit_as_half_an_ellipse(fault):
    """By their areas; the curve of the flank takes little of them."""
    gear = teeth_picture(teeth_of(mesh_pairs(STAGE)[0]), [parse_fault(fault)]).gears[1]
    hole, drawn = tooth_damage(gear.faults, gear.tooth).holes[0], gear.damage[0]
    x, y = drawn.section.T
    area = abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2
    long = np.hypot(*np.diff(drawn.section[:POINTS], axis=0).T).sum()
    box = 1e3 * hole.depth_m * long
    assert area == pytest.approx(box * np.pi / 4 if hole.round else box, rel=0.03)


@pytest.mark.parametrize("percent", [10, 40])
def test_pits_cover_the_share_of_the_flank_that_is_told(percent):
    pair = teeth_of(mesh_pairs(STAGE)[0])
    fault = parse_fault(f"pitting:1:gear:5:{percent}%flank")
    gear = teeth_picture(pair, [fault]).gears[1]
    ax = Figure().add_subplot()
    plot_flank(gear, ax)
    pits = [patch for patch in ax.patches if isinstance(patch, Circle)]
    area = sum(np.pi * pit.radius**2 for pit in pits)
    assert area / (20.0 * (gear.tip - gear.flank_start)) == pytest.approx(percent / 100, rel=0.03)
    assert 0 <= min(pit.center[0] - pit.radius for pit in pits) < 0.3
    assert 19.7 < max(pit.center[0] + pit.radius for pit in pits) <= 20.0
