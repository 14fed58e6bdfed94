"""Displacement excitation by errors and by lost profile."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.gears.excitation import displacement_excitation, tip_corner_gap
from gearmon.gears.faults import ERROR_KINDS, parse_error, parse_fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.gears.tooth_pairs import teeth_of
from gearmon.machine import ParallelStage, PlanetaryStage

STAGE = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)
HELICAL = replace(STAGE, helix_angle_deg=15.0)
PLANETARY = PlanetaryStage(
    sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=1.0, face_width_mm=10.0
)


def excite(*errors, stage=STAGE, faults=(), form="parabolic"):
    known = [parse_fault(text) for text in faults]
    mesh = mesh_stiffness(stage, known, form)
    (pair,) = mesh_pairs(stage)
    return displacement_excitation(pair, mesh, [*map(parse_error, errors), *known])


@pytest.mark.parametrize("stage", [STAGE, HELICAL])
def test_eccentricity_is_one_line_at_the_shaft(stage):
    """All pairs in contact are shifted alike, so the sharing does not matter."""
    found = excite("eccentricity:1:gear:all:20um", stage=stage)
    assert found.period_mesh == 53
    x = np.linspace(0, 53, 77)
    np.testing.assert_allclose(found.at(x), 2e-5 * np.cos(2 * np.pi * x / 53), atol=1e-18)


def test_wobble_acts_twice_a_turn():
    found = excite("misalignment:1:pinion:all:30um").at(np.arange(26 * 512) / 512)
    # |cos| = 2/pi + (4/(3 pi)) cos 2x ...
    expected = [1.5e-5 * 2 / math.pi, 0, 1.5e-5 * 2 / (3 * math.pi), 0]
    np.testing.assert_allclose(np.abs(np.fft.rfft(found)[:4]) / len(found), expected, atol=1e-12)


def test_pitch_error_is_shared_with_the_neighbours():
    """Alone in contact the pair gives its whole error, with a neighbour its share of the load."""
    found = excite("pitch:1:pinion:7:8um")
    mesh = found.stiffness
    eps = mesh.contact_ratio
    assert found.at(6 + eps / 2) == pytest.approx(8e-6)
    both = float(mesh.at(0.3))
    own = float(mesh.healthy.terms[0].pulse.value(0.3))
    assert found.at(6.3) == pytest.approx(8e-6 * own / both)
    x = np.linspace(0, 26, 2600, endpoint=False)
    where = x[np.abs(found.at(x)) > 0]
    assert (where.min(), where.max()) == pytest.approx((6.0, 6 + eps), abs=0.011)


def test_profile_error_repeats_with_the_mesh():
    found = excite("profile:1:pinion:all:10um")
    x = np.linspace(0.01, 1.01, 50)
    np.testing.assert_allclose(found.at(x + 5), found.at(x), atol=1e-18)
    assert found.at(found.stiffness.contact_ratio / 2) == pytest.approx(0.0, abs=1e-18)


@given(st.floats(-50, 50), st.floats(0.1, 5), st.sampled_from(sorted(ERROR_KINDS)))
def test_excitation_is_linear_in_the_errors(size, factor, kind):
    tooth = 3 if kind == "pitch" else "all"
    one = excite(f"{kind}:1:pinion:{tooth}:{size}um", "pitch:1:gear:5:4um")
    other = excite(f"{kind}:1:pinion:{tooth}:{factor * size}um", f"pitch:1:gear:5:{4 * factor}um")
    x = np.linspace(0.03, 60.03, 200)
    np.testing.assert_allclose(other.at(x), factor * one.at(x), rtol=1e-9, atol=1e-15)


def test_damage_of_both_gears_and_a_pitch_error():
    faults = ["crack:1:pinion:2:20%", "crack:1:gear:3:20%"]
    stage = replace(STAGE, pinion_teeth=19, gear_teeth=23)
    found = excite("pitch:1:pinion:2:8um", stage=stage, faults=faults)
    assert found.period_mesh == 19 * 23
    mesh, sound = found.stiffness, mesh_stiffness(stage)
    # alone the pair gives its whole error, whatever it has lost
    alone = 1 + mesh.contact_ratio / 2
    assert found.at(alone) == pytest.approx(8e-6)
    # with a neighbour its share of the load: tooth 2 of the pinion has lost a fifth of its own
    own = 0.8 * float(sound.healthy.terms[0].pulse.value(0.3))
    assert found.at(19 + 1.3) == pytest.approx(8e-6 * own / float(mesh.at(19 + 1.3)))


def test_wear_is_the_same_for_all_pairs():
    found = excite(faults=["wear:1:gear:all:0.02mm"], form="potential-energy")
    assert found.period_mesh == 1
    np.testing.assert_allclose(found.at(np.linspace(0, 3, 9)), 2e-5)


def test_no_errors_no_excitation():
    assert excite().period_mesh == 1
    np.testing.assert_array_equal(excite().at(np.linspace(0, 3, 9)), 0.0)


def test_through_spall_takes_profile_and_a_narrower_one_does_not():
    through = excite(faults=["spall:1:pinion:5:20x1x0.05mm"], form="potential-energy")
    part = excite(faults=["spall:1:pinion:5:10x1x0.05mm"], form="potential-energy")
    x = np.linspace(4, 6, 400)
    assert through.at(x).max() == pytest.approx(5e-5)
    assert part.at(x).max() == 0.0


def test_missing_tooth_opens_a_gap():
    gone = excite(faults=["missing:1:pinion:5"], form="potential-energy")
    eps = gone.stiffness.contact_ratio
    assert gone.at(4 + eps - 1 - 0.01) == 0.0
    assert 5e-6 < gone.at(np.linspace(4 + eps - 1, 5, 99)).max() < 5e-5


def test_a_gap_between_helical_teeth_is_about_that_of_their_transverse_section():
    """Spur teeth of that section; the virtual ones that stand for helical teeth come near it."""
    beta, alpha = math.radians(20.0), math.radians(STAGE.pressure_angle_deg)
    section = {"module_mm": 2.0 / math.cos(beta)}
    section["pressure_angle_deg"] = math.degrees(math.atan(math.tan(alpha) / math.cos(beta)))
    for name in ("tip_factor_pinion", "tip_factor_gear", "root_factor_pinion", "root_factor_gear"):
        section[name] = getattr(STAGE, name) * math.cos(beta)
    oblique, straight = (
        excite(faults=["missing:1:pinion:5"], stage=stage, form="potential-energy").errors[0].gap
        for stage in (replace(STAGE, helix_angle_deg=20.0), replace(STAGE, **section))
    )
    np.testing.assert_allclose(oblique.edges, straight.edges, rtol=1e-4)
    x = np.linspace(*straight.edges[[0, -1]], 41)[1:-1]
    np.testing.assert_allclose(oblique.value(x), straight.value(x), rtol=0.025)


def test_tip_corner_gap_against_points_in_the_plane():
    """The arc on the mate's base circle through which its flank must turn to meet the corner."""
    pair = teeth_of(mesh_pairs(STAGE)[0])
    one, two = pair.first, pair.second
    centres = math.hypot(pair.line_m, one.base_radius_m + two.base_radius_m)
    working = math.acos((one.base_radius_m + two.base_radius_m) / centres)
    mate = np.array([0.0, centres])

    def involute(string):
        """Point at the end of a string along the line of action, from the mate's base circle."""
        foot = mate - two.base_radius_m * np.array([-math.sin(working), math.cos(working)])
        return foot - string * np.array([math.cos(working), math.sin(working)])

    def turned(point, centre, angle):
        c, s = math.cos(angle), math.sin(angle)
        return centre + np.array([[c, -s], [s, c]]) @ (point - centre)

    # at the end of the path both touch there; then both turn on by the same arc
    corner = involute(pair.line_m - pair.path_m[1])
    assert np.hypot(*corner) == pytest.approx(one.tip_radius_m, rel=1e-9)
    for beyond in (0.2e-3, 0.8e-3):
        moved = turned(corner, np.zeros(2), -beyond / one.base_radius_m)
        # the flank that touched at the end, as points that the string draws when unwound
        start = pair.line_m - pair.path_m[1]
        strings = np.linspace(1e-9, 4 * start + 4e-3, 200_001)
        points = np.array(
            [turned(involute(s), mate, (s - start) / two.base_radius_m) for s in strings[::50]]
        )
        radii = np.hypot(*(points - mate).T)
        own = np.hypot(*(moved - mate))
        x, y = (np.interp(own, radii, axis) for axis in (points - mate).T)
        flank = math.atan2(y, x) + beyond / two.base_radius_m
        seen = math.atan2(*(moved - mate)[::-1])
        found = float(tip_corner_gap(pair, np.array([beyond]), leaving=True)[0])
        assert found == pytest.approx(two.base_radius_m * abs(flank - seen), rel=2e-3)


def test_a_tip_corner_touches_at_the_end_of_the_path():
    pair = teeth_of(mesh_pairs(STAGE)[0])
    for leaving in (True, False):
        gap = tip_corner_gap(pair, np.array([0.0, 1e-4, 2e-4, 1e-3]), leaving=leaving)
        assert gap[0] == pytest.approx(0.0, abs=1e-15)
        # the gap opens with the square of the distance
        assert gap[2] / gap[1] == pytest.approx(4.0, rel=0.05)
        assert (np.diff(gap) > 0).all()


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("eccentricity:1:pinion:all", "has 4 parts and not 5"),
        ("excentricity:1:pinion:all:20um", "did you mean eccentricity"),
        ("eccentricity:1:pinon:all:20um", 'did you mean "pinion"'),
        ("eccentricity:1:pinion:all:20", "SIZE must be a number in um or mm"),
        ("eccentricity:1:pinion:3:20um", "eccentricity: TOOTH must be 'all'"),
        ("pitch:1:pinion:all:20um", "pitch: TOOTH must be one tooth number"),
        ("pitch:1:pinion:0:20um", r"tooth = 0 must lie in \[1, "),
        ("pitch:0:pinion:1:20um", r"stage = 0 must lie in \[1, 1000\]"),
        ("pitch:1:pinion:1:nanum", "SIZE must be a number"),
    ],
)
def test_errors_without_meaning_are_refused(text, match):
    with pytest.raises(ArgumentError, match=match):
        parse_error(text)


def test_errors_that_do_not_fit_the_mesh():
    with pytest.raises(ArgumentError, match="tooth 27 does not exist"):
        excite("pitch:1:pinion:27:5um")
    with pytest.raises(ArgumentError, match="gear 'sun' is not one of pinion, gear"):
        excite("pitch:1:sun:2:5um")
    inner, outer = mesh_pairs(PLANETARY, 1)
    wrong = [parse_error("pitch:1:sun:2:5um"), parse_fault("spall:1:planet:3:10x2x0.5mm")]
    told = mesh_stiffness(outer, wrong)
    notes = [words for words in told.warnings if "does not act" in words]
    assert notes == [f"{own.word} {own} does not act in the planet-ring mesh" for own in wrong]
    assert displacement_excitation(outer, told, wrong).errors == ()
    # a spall across the face moves the flank that meets the sun
    assert len(displacement_excitation(inner, mesh_stiffness(inner, wrong), wrong).errors) == 2


@pytest.mark.parametrize("text", ["eccentricity:1:pinion:all:20um", "pitch:2:gear:7:8um"])
def test_written_and_read_again(text):
    assert str(parse_error(text)) == text
