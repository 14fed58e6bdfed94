"""Teeth of a ring: outline and energy against slow versions, mesh against the standard and laws."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from reference.ring_reference import ring_tooth_compliances
from reference.tooth_cases import PAPER
from reference.tooth_elements import tooth_compliance

from gearmon.errors import ArgumentError
from gearmon.gears.damage import SOUND_PAIR, TeethInMesh, stiffness_loss
from gearmon.gears.faults import parse_fault
from gearmon.gears.geometry import GearTeeth, pair_geometry
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.gears.tooth_damage import SOUND, tooth_damage
from gearmon.gears.tooth_pairs import (
    PotentialEnergy,
    teeth_of,
    tooth_pair,
    weber_banaschek_compliance,
)
from gearmon.machine import PlanetaryStage
from gearmon.report.teeth_plots import teeth_picture

#: Second stage of a 5 MW wind turbine gearbox (Nejad et al. 2016), rims of its report.
NREL = PlanetaryStage(
    sun_teeth=18,
    planet_teeth=36,
    ring_teeth=93,
    planets=3,
    module_mm=21.0,
    face_width_mm=550.0,
    profile_shift_sun=0.3890,
    profile_shift_planet=0.5039,
    profile_shift_ring=0.1171,
    centre_distance_mm=584.0,
    rim_thickness_ring_mm=3.5 * 21.0,
)


def ring_pair(planet=36, ring=93, shifts=(0.0, 0.0), held=None, geometry=None, **choices):
    """Planet and ring of module 2, 20 mm wide; the ring is held 7 mm outside its roots."""
    pair = pair_geometry(
        GearTeeth(teeth=planet, profile_shift=shifts[0], name="planet"),
        GearTeeth(teeth=ring, profile_shift=shifts[1], name="ring", internal=True),
        module_m=2e-3,
        face_width_m=0.02,
        **(geometry or {}),
    )
    outside = pair.gears[1].root_radius_m + 7e-3 if held is None else held
    bores = (0.4 * pair.gears[0].reference_radius_m, outside)
    return pair, tooth_pair(pair, PotentialEnergy(**choices), bore_radii_m=bores)


@st.composite
def planetary_stages(draw, helix=(0.0,)):
    """Random planetary stages whose planet runs in the ring."""
    sun, planet = draw(st.integers(18, 50)), draw(st.integers(20, 50))
    stage = PlanetaryStage(
        sun_teeth=sun,
        planet_teeth=planet,
        ring_teeth=sun + 2 * planet,
        planets=1,
        module_mm=draw(st.floats(0.5, 12)),
        face_width_mm=draw(st.floats(8, 80)),
        helix_angle_deg=draw(st.sampled_from(helix)),
        tip_factor_ring=draw(st.floats(0.6, 0.9)),
    )
    stage = replace(
        stage,
        bore_diameter_planet_mm=draw(st.floats(0.3, 0.6)) * planet * stage.module_mm,
        rim_thickness_ring_mm=draw(st.floats(2, 8)) * stage.module_mm,
    )
    try:
        mesh_stiffness(mesh_pairs(stage)[1], (), "parabolic")
    except ArgumentError:
        assume(False)
    return stage


def outer(stage, *faults, form="potential-energy", **data):
    return mesh_stiffness(mesh_pairs(stage)[1], [parse_fault(f) for f in faults], form, **data)


# --- one tooth -----------------------------------------------------------------------------------


@pytest.mark.parametrize("shifts", [(0.0, 0.0), (0.4, 0.2), (0.2, -0.3)])
def test_outline_has_the_thickness_of_the_ring(shifts):
    """Polar thickness by ISO 21771 at every radius from the tip to the end of the involute."""
    geometry, pair = ring_pair(shifts=shifts)
    tooth = pair.second
    t = np.linspace(tooth.start, tooth.tip, 40)
    height, half = tooth.height(t), tooth.half_thickness(t)
    radius = np.hypot(height, half)
    assert (np.diff(height) > 0).all()
    assert radius[-1] == pytest.approx(geometry.tip_radii_m[1])
    assert radius[0] == pytest.approx(math.hypot(tooth.base_radius_m, tooth.form_roll_m))
    expected = [geometry.gears[1].thickness_m(r) / (2 * r) for r in radius]
    np.testing.assert_allclose(np.arctan2(half, -height), expected, rtol=1e-9)
    np.testing.assert_allclose(tooth.angle(tooth.roll(t)), t, rtol=1e-12)
    assert tooth.angle_at_height(float(height[7])) == pytest.approx(t[7])


def test_flank_slope_is_that_of_the_force():
    _, pair = ring_pair()
    tooth = pair.second
    t = np.linspace(tooth.start, tooth.tip, 2001)
    slope = np.gradient(tooth.half_thickness(t), -tooth.height(t))
    np.testing.assert_allclose(np.arctan(slope)[1:-1], tooth.slope(t)[1:-1], atol=1e-6)


@pytest.mark.parametrize("alpha", [20.0, 25.0])
def test_fillet_touches_involute_and_root_circle(alpha):
    """At 25 degrees the space has no room for the arc, which then ends in its middle."""
    geometry, pair = ring_pair(geometry={"pressure_angle_rad": math.radians(alpha)})
    tooth = pair.second
    root = tooth.root_part(np.linspace(0, 1, 2001))
    height, half = root.imag, root.real
    assert height[-1] == pytest.approx(float(tooth.height(tooth.start)))
    assert half[-1] == pytest.approx(float(tooth.half_thickness(tooth.start)))
    # smooth into the involute
    end = math.atan2(half[-2] - half[-1], height[-1] - height[-2])
    assert end == pytest.approx(float(tooth.slope(tooth.start)), abs=2e-3)
    # an arc, whose circle touches the root circle from within
    points = np.stack([half, height], axis=-1)[[0, 1000, 2000]]
    rows = 2 * (points[1:] - points[0])
    centre = np.linalg.solve(rows, (points[1:] ** 2).sum(axis=1) - (points[0] ** 2).sum())
    radius = np.hypot(*(points[0] - centre))
    assert np.hypot(*centre) + radius == pytest.approx(geometry.gears[1].root_radius_m, rel=1e-9)
    assert math.atan2(centre[0], -centre[1]) <= math.pi / 93 + 1e-9
    if alpha == 20:
        assert radius == pytest.approx(0.38e-3 * 2, rel=0.1)


@pytest.mark.parametrize("root", ["fillet", "straight"])
@pytest.mark.parametrize("share", [0.05, 0.5, 1.0])
def test_energy_against_a_fine_sum(root, share):
    geometry, pair = ring_pair(shifts=(0.3, 0.1), root=root)
    roll = pair.roll(share * pair.contact_ratio)
    parts = pair.compliances(roll)
    tooth = pair.second
    if root == "fillet":
        root = tooth.root_part(np.linspace(0, 1, 20_001))
        height, half = root.imag, root.real
    else:
        thick = tooth.thickness_m(tooth.root_radius_m) / 2 / tooth.root_radius_m
        height = -tooth.root_radius_m * np.cos([thick])
        half = tooth.root_radius_m * np.sin([thick])
    slow = ring_tooth_compliances(geometry, (-height, half), float(pair.rolls(roll)[1]), 206e9, 0.3)
    fast = [part[1] * 0.02 for part in (parts.bending, parts.shear, parts.axial)]
    np.testing.assert_allclose(fast, slow, rtol=1e-4)


def test_a_large_ring_has_the_teeth_of_a_rack():
    """Flanks of a large external gear and of a large ring become straight: the same beam."""
    t = []
    for internal in (False, True):
        pair = pair_geometry(
            GearTeeth(teeth=30, name="planet"),
            GearTeeth(teeth=8_000, name="ring" if internal else "gear", internal=internal),
            module_m=2e-3,
            face_width_m=0.02,
        )
        root = pair.gears[1].root_radius_m
        held = root + 7e-3 if internal else 0.5 * root
        made = tooth_pair(pair, bore_radii_m=(0.01, held))
        parts = made.compliances(made.roll(0.5 * made.contact_ratio))
        t.append([float(part[1]) for part in (parts.bending, parts.shear, parts.axial)])
    np.testing.assert_allclose(t[0], t[1], rtol=0.01)


def beam_over_elements(pair, index, shares):
    """Compliance of tooth and body in the model over that by finite elements."""
    rolls = pair.rolls(pair.roll(np.array(shares) * pair.contact_ratio))[index]
    tooth, found = pair.teeth[index], []
    for roll, expected in tooth_compliance(tooth, rolls):
        parts = pair.compliances(roll if index == 0 else tooth.sign * (pair.line_m - roll))
        causes = (parts.bending, parts.shear, parts.axial, parts.foundation)
        total = sum(float(cause[index]) for cause in causes)
        found.append(total * tooth.elastic_modulus_pa * tooth.face_width_m / expected)
    return found


@pytest.mark.parametrize("rim", [7e-3, 14e-3])
def test_ring_tooth_and_rim_against_finite_elements(rim):
    """As of external teeth the beam is too compliant: 11 % at the tip, 20 % halfway, 30 % low."""
    root = ring_pair()[0].gears[1].root_radius_m
    _, pair = ring_pair(held=root + rim)
    ratios = beam_over_elements(pair, 1, (0.05, 0.25, 0.5, 0.75))
    assert ratios == pytest.approx([1.11, 1.16, 1.21, 1.28], abs=0.03)


@pytest.mark.parametrize("index", [0, 1])
def test_external_tooth_and_disc_against_finite_elements(index):
    """9 to 18 % too compliant by another mesh; 8 to 12 % by this one."""
    ratios = beam_over_elements(PAPER, index, (0.05, 0.25, 0.5, 0.75, 0.95))
    assert ratios == pytest.approx([1.10] * 5, abs=0.02)


# --- the pair ------------------------------------------------------------------------------------


def test_rolls_of_planet_and_ring():
    """Both contacts lie at one point of the line of action, which both base circles touch."""
    geometry, pair = ring_pair(shifts=(0.3, 0.1))
    one, two = pair.rolls(pair.roll(np.array([0.0, pair.contact_ratio])))
    tips = [math.sqrt(t**2 - b**2) for t, b in zip(geometry.tip_radii_m, geometry.base_radii_m,
                                                   strict=True)]  # fmt: skip
    assert one[1] == pytest.approx(tips[0])
    assert two[0] == pytest.approx(tips[1])
    for phase in (0.2, 1.1):
        angles = pair.angles(np.array(phase))
        for index, angle in enumerate(angles):
            assert pair.phase_of(index, float(angle)) == pytest.approx(phase)


def test_hollow_flanks_flatten_less_under_load():
    """The relative curvature 1/rho_1 - 1/rho_2 of planet and ring makes a wider contact."""
    _, inside = ring_pair(contact="load-dependent")
    roll = inside.roll(0.5 * inside.contact_ratio)
    one, two = (float(r) for r in inside.rolls(roll))
    depths = [
        tooth.half_thickness(a) / np.cos(a)
        for tooth, a in zip(inside.teeth, inside.angles(np.array(0.5 * inside.contact_ratio)),
                            strict=True)
    ]  # fmt: skip
    expected = weber_banaschek_compliance(
        np.array(5e3), 0.02, np.array(1 / (1 / one - 1 / two)), tuple(depths), (206e9, 206e9), 0.3
    )
    found = inside.compliances(roll, force_n=5e3).hertz
    assert float(found) == pytest.approx(float(expected), rel=1e-9)


def test_planet_and_ring_against_the_standard():
    """c' and c_gamma_alpha of solid bodies within the scatter of the standard and of the beam.

    The published 14.053 and 20.563 N/(mm um) contain C_R = 0.8623 of a webbed planet, which the
    model takes as a solid disc: 16.30 and 23.85 without it. Held 3.5 modules outside its roots.
    """
    pair = mesh_pairs(NREL)[1]
    iso = pair.method_b()
    assert iso.single == pytest.approx(14.053 / 0.8623, rel=5e-4)
    teeth = teeth_of(pair)
    phase = np.linspace(0, teeth.contact_ratio, 201)
    single = teeth.compliances(teeth.roll(phase)).stiffness.max() / 0.55 / 1e9
    mean = outer(NREL).mean_n_per_m / 0.55 / 1e9
    assert single == pytest.approx(iso.single, rel=0.05)
    assert mean == pytest.approx(iso.mesh_alpha, rel=0.10)


def test_planet_and_ring_step_and_couple():
    """A ring held all round its outside couples neighbours less than a disc on its bore does."""
    _, pair = ring_pair(shifts=(0.3, 0.1))
    _, apart = ring_pair(shifts=(0.3, 0.1), is_coupled=False)
    mesh, loose = TeethInMesh(teeth=pair), TeethInMesh(teeth=apart)
    phase = np.linspace(0.02, pair.contact_ratio - 1.02, 5)[:, None]
    pairs = [SOUND_PAIR] * (2 * mesh.reach + 1)
    both, sums = (np.asarray(m.loads(phase, pairs)).sum(axis=0) for m in (mesh, loose))
    parts = [pair.compliances(pair.roll(phase + n)) for n in (0, 1)]
    shared = sum(np.minimum(parts[0].foundation[g], parts[1].foundation[g]) for g in (0, 1))
    c1, c2 = parts[0].total, parts[1].total
    full = (c1 + c2 - 2 * shared) / (c1 * c2 - shared**2)
    assert (full <= both * (1 + 1e-9)).all()
    assert (both < sums).all()
    ring = pair.foundations[1]
    middle = np.array(0.5 * (pair.second.start + pair.second.tip))
    reach = [ring.coupling(n, middle, middle) for n in (1, 2, 3, 10)]
    assert reach == sorted(reach, reverse=True)


def test_contacts_yield_to_each_other_alike():
    """Maxwell: tooth ahead by the load on the one behind, and the other way round."""
    ring = ring_pair()[1].foundations[1]
    a, b = np.array([-0.35]), np.array([-0.42])
    there, back = ring.deflection(a, b, -0.07), ring.deflection(b, a, 0.07)
    np.testing.assert_allclose(there, back, rtol=1e-9)


@given(planetary_stages(), st.floats(0.3, 3), st.floats(0.3, 3), st.floats(0.3, 3))
def test_scaling(stage, modulus, width, module):
    other = replace(
        stage,
        elastic_modulus_planet_pa=modulus * 206e9,
        elastic_modulus_ring_pa=modulus * 206e9,
        face_width_mm=width * stage.face_width_mm,
        module_mm=module * stage.module_mm,
        bore_diameter_planet_mm=module * stage.bore_diameter_planet_mm,
        rim_thickness_ring_mm=module * stage.rim_thickness_ring_mm,
    )
    x = np.linspace(0.013, 1.013, 30)
    np.testing.assert_allclose(outer(other).at(x), modulus * width * outer(stage).at(x), rtol=1e-7)


@given(planetary_stages(helix=(0.0, 12.0)))
def test_stiffness_of_both_meshes_is_of_the_order_of_the_standard(stage):
    for pair in mesh_pairs(stage):
        iso = pair.method_b()
        found = mesh_stiffness(pair, (), "potential-energy").mean_n_per_m
        ratio = found / iso.mean_n_per_m(1e-3 * stage.face_width_mm)
        assert 0.7 < ratio < 1.45


def test_helical_planet_and_ring():
    stage = replace(NREL, helix_angle_deg=8.0, centre_distance_mm=590.0)
    mesh = outer(stage)
    assert mesh.overlap_ratio > 0.5
    assert mesh.variation < outer(NREL).variation


# --- damage --------------------------------------------------------------------------------------


@given(
    st.sampled_from(["crack", "spall", "pitting"]),
    st.floats(0, 1),
    st.floats(0, 1),
)
def test_loss_on_a_ring_tooth_grows_with_size(kind, one, two):
    texts = {
        "crack": lambda s: f"crack:1:ring:3:{1.5 * s}mm",
        "spall": lambda s: f"spall:1:ring:3:{18 * s}x1.2x0.3mm",
        "pitting": lambda s: f"pitting:1:ring:3:{0.4 * s}flank",
    }
    _, pair = ring_pair()
    small, large = (
        stiffness_loss(parse_fault(texts[kind](size)), pair, 1).mean for size in sorted((one, two))
    )
    assert -1e-12 <= small <= large + 1e-9
    assert stiffness_loss(parse_fault(texts[kind](0.0)), pair, 1).mean == 0


def test_a_crack_in_the_ring_hurts_most_under_its_tip():
    """The tip of the ring's tooth is loaded first."""
    _, pair = ring_pair()
    hurt = pair.beams(SOUND, tooth_damage([parse_fault("crack:1:ring:1:2mm")], pair.second))
    roll = pair.roll(np.linspace(0.01, 0.99, 9) * pair.contact_ratio)
    loss = 1 - pair.compliances(roll).total / pair.compliances(roll, hurt).total
    assert (np.diff(loss) < 0).all()
    assert 0.05 < loss[0] < 0.5


def test_ring_and_planet_are_drawn_in_contact():
    _, pair = ring_pair()
    for phase in (0.1, 0.9, 1.5):
        picture = teeth_picture(pair, (), phase)
        planet, ring = picture.gears
        for gear in (planet, ring):
            assert np.hypot(*(gear.outline - picture.contact).T).min() < 0.1
        assert ring.outline[:, 1].min() > planet.outline[:, 1].min()
        assert 0 < ring.flank_start < ring.tip


# --- refusals and notes --------------------------------------------------------------------------


def test_rim_must_lie_outside_the_roots():
    inside = ring_pair()[0].gears[1].root_radius_m - 5e-3
    with pytest.raises(ArgumentError, match="rim thickness -5 mm of the ring"):
        ring_pair(held=inside)


def test_what_is_assumed_of_the_ring_is_said():
    told = outer(NREL).warnings
    assert any("held all round its outer diameter of 2147.6 mm" in text for text in told)
    assert not any("rim_thickness_ring_mm would say" in text for text in told)
    silent = outer(replace(NREL, rim_thickness_ring_mm=None))
    assert any("rim_thickness_ring_mm would say how thick" in text for text in silent.warnings)
    assert silent.mean_n_per_m == pytest.approx(outer(NREL).mean_n_per_m)
    thin = outer(replace(NREL, rim_thickness_ring_mm=30.0))
    assert any("1.43 modules thick" in text for text in thin.warnings)


def test_load_dependent_contact_in_a_ring():
    form = PotentialEnergy(contact="load-dependent")
    low, high = (outer(NREL, form=form, force_n=force).mean_n_per_m for force in (1e5, 2e6))
    assert low < high


@pytest.mark.parametrize(
    "reach",
    [
        {},
        {"tip_factor_ring": 1.2},
        {"tip_diameter_ring_mm": 98.0},
        {"tip_diameter_ring_mm": 97.5},
    ],
)
def test_ring_tips_that_reach_too_far_are_told_what_they_may(reach):
    """In the key that the file gives; with that value nothing has to go any more."""
    counts = {"sun_teeth": 20, "planet_teeth": 40, "ring_teeth": 100, "planets": 3}
    stage = PlanetaryStage(**counts, module_mm=1.0, face_width_mm=20.0, **reach)
    try:
        told = mesh_pairs(stage)[1].geometry.warnings[0]
    except ArgumentError as error:
        told = str(error)
    may = dict(re.findall(r"(tip_\w+_ring\w*) [<>]= ([\d.]+)", told))
    key = next(iter(reach), "tip_factor_ring")
    heeded = mesh_pairs(replace(stage, **{key: float(may[key])}))[1].geometry
    assert heeded.warnings == ()
    assert heeded.path_m[0] == pytest.approx(heeded.gears[0].form_roll, abs=3e-6)
