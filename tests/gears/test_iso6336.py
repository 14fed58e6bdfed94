"""ISO 6336-1 Method B against published calculations and the laws of the standard."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.gears.geometry import GearTeeth
from gearmon.gears.mechanics import equivalent_mass
from gearmon.gears.pairs import blank_factor, mesh_pairs, method_b
from gearmon.machine import ParallelStage, PlanetaryStage

DEG = math.pi / 180


def tooth(teeth, shift=0.0, root=1.25, **data):
    return GearTeeth(teeth=teeth, profile_shift=shift, root_factor=root, **data)


# Row 1: ISO/TR 6336-30 example 1; row 2: DIN 3990 example; rows 3 and 5: reports of a commercial
# gear program on a planetary stage of a wind turbine. Columns: c'_th, C_R, C_B, c', c_ga, c_gb.
ROWS = {
    "ISO/TR 6336-30, example 1": (
        tooth(17, 0.145, 1.4),
        tooth(103, 0.0, 1.4),
        {"contact_ratio": 1.5491, "helix_angle_rad": 15.8 * DEG},
        (17.85584, 1.0, 0.90, 12.37047, 17.46485, 14.84512),
        1e-4,
    ),
    "DIN 3990 helical": (
        tooth(25, 0.0, 1.3),
        tooth(40, 0.0, 1.3),
        {"contact_ratio": 1.527, "helix_angle_rad": 20 * DEG},
        (17.270, 1.0, 0.95, 12.33, 17.21, 14.63),
        5e-4,
    ),
    "sun and planet": (
        tooth(18, 0.3890),
        tooth(36, 0.5039),
        {"contact_ratio": 1.370, "web": (0.25, 3.5)},
        (18.1986, 0.8623, 0.975, 12.240, 15.640, 13.294),
        5e-4,
    ),
    "planet and ring": (
        tooth(36, 0.5039),
        tooth(93, 0.1171, internal=True),
        {"contact_ratio": 1.618, "web": (0.25, 3.5)},
        (20.8939, 0.8623, 0.975, 14.053, 20.563, 17.479),
        5e-4,
    ),
}


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("swapped", [False, True])
def test_published_calculations(name, swapped):
    one, two, data, row, tolerance = ROWS[name]
    found = method_b(*((two, one) if swapped else (one, two)), **data)
    values = (
        found.theoretical,
        found.blank,
        found.rack,
        found.single,
        found.mesh_alpha,
        found.mesh_beta,
    )
    assert values == pytest.approx(row, rel=tolerance)


def test_virtual_teeth_of_the_first_published_pair():
    one, two, data, _, _ = ROWS["ISO/TR 6336-30, example 1"]
    assert method_b(one, two, **data).virtual_teeth == pytest.approx((18.905, 114.543), abs=5e-4)


@pytest.mark.parametrize(
    ("root", "ratio", "single", "mesh"),
    [
        (1.25, 1.412, 13.43036, 17.5803),
        (1.25, 1.693, 13.43036, 20.4108),
        (1.2, 1.412, 13.77473, 18.0311),
    ],
)
def test_reference_pair(root, ratio, single, mesh):
    found = method_b(tooth(26, root=root), tooth(53, root=root), contact_ratio=ratio)
    assert found.theoretical == pytest.approx(17.21841, rel=1e-6)
    assert found.single == pytest.approx(single, rel=1e-6)
    assert found.mesh_alpha == pytest.approx(mesh, rel=1e-5)
    assert found.mesh_beta == pytest.approx(0.85 * mesh, rel=1e-5)


# --- laws ----------------------------------------------------------------------------------------

TEETH = st.integers(12, 200)
SHIFT = st.floats(-0.4, 1.0)


@given(TEETH, TEETH, SHIFT, SHIFT, st.floats(1.0, 2.5))
def test_it_does_not_matter_which_gear_drives(z1, z2, x1, x2, ratio):
    one, two = tooth(z1, x1), tooth(z2, x2, root=1.4, elastic_modulus_pa=180e9)
    assert method_b(one, two, contact_ratio=ratio) == method_b(two, one, contact_ratio=ratio)


@given(TEETH, TEETH, SHIFT, st.floats(0.1, 3.0))
def test_stiffness_is_proportional_to_the_modulus(z1, z2, x, factor):
    steel = method_b(tooth(z1, x), tooth(z2), contact_ratio=1.5)
    other = [tooth(z, s, elastic_modulus_pa=factor * 206e9) for z, s in ((z1, x), (z2, 0.0))]
    assert method_b(*other, contact_ratio=1.5).single == pytest.approx(factor * steel.single)


@given(st.floats(0.1, 99.9))
def test_low_load(load):
    data = {"contact_ratio": 1.5}
    full = method_b(tooth(20), tooth(40), **data, load_n_per_mm=100.0)
    low = method_b(tooth(20), tooth(40), **data, load_n_per_mm=load)
    assert low.single == pytest.approx(full.single * (load / 100) ** 0.25)
    assert low.load == pytest.approx((load / 100) ** 0.25)


@given(TEETH, SHIFT)
def test_a_ring_is_the_limit_of_many_teeth(teeth, shift):
    ring = method_b(tooth(teeth, shift), tooth(200, 0.2, internal=True), contact_ratio=1.6)
    wheel = method_b(tooth(teeth, shift), tooth(10**9, 0.2), contact_ratio=1.6)
    assert ring.single == pytest.approx(wheel.single, rel=1e-7)


def test_pressure_angle_and_rack_factor():
    sharp = method_b(tooth(30), tooth(40), contact_ratio=1.5, pressure_angle_rad=25 * DEG)
    assert sharp.rack == pytest.approx(0.975 * 1.1)
    mixed = method_b(tooth(30, root=1.2), tooth(40, root=1.4), contact_ratio=1.5)
    assert mixed.rack == pytest.approx(0.5 * (1.0 + 0.9))


@pytest.mark.parametrize(("web", "rim"), [(0.1, 2.0), (0.2, 0.5), (2.0, 3.0)])
def test_blank_factor_stays_in_its_range(web, rim):
    found = method_b(tooth(20), tooth(40), contact_ratio=1.5, web=(web, rim)).blank
    expected = 1 + math.log(min(max(web, 0.2), 1.2)) / (5 * math.exp(max(rim, 1.0) / 5))
    assert found == pytest.approx(expected)


@pytest.mark.parametrize("side", [0.99, 1.01])
@pytest.mark.parametrize(("web", "rim"), [(0.2, 2.0), (1.2, 2.0), (0.6, 1.0)])
def test_a_blank_factor_is_said_to_be_cut_where_it_is(web, rim, side):
    web, rim = (web, side) if rim == 1.0 else (side * web, rim)
    factor, notes = blank_factor(web, rim)
    formula = 1 + math.log(web) / (5 * math.exp(rim / 5))
    assert (factor == pytest.approx(formula, rel=1e-12)) == (not notes)
    assert bool(notes) == (not 0.2 <= web <= 1.2 or rim < 1)


# --- published rows from a machine file's data ---------------------------------------------------

HELICAL = ParallelStage(
    pinion_teeth=17,
    gear_teeth=103,
    module_mm=8.0,
    helix_angle_deg=15.8,
    face_width_mm=100.0,
    profile_shift_pinion=0.145,
    root_factor_pinion=1.4,
    root_factor_gear=1.4,
    centre_distance_mm=500.0,
)
PRINTED_TIPS = {"tip_diameter_pinion_mm": 159.66, "tip_diameter_gear_mm": 872.35}
TURBINE = PlanetaryStage(
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
    web_width_planet_mm=0.25 * 550.0,
    rim_thickness_planet_mm=3.5 * 21.0,
)


def row(pair):
    found = pair.method_b()
    return (
        found.theoretical,
        found.blank,
        found.rack,
        found.single,
        found.mesh_alpha,
        found.mesh_beta,
    )


def test_first_published_row_from_its_printed_diameters():
    """ISO/TR 6336-30, example 1: d_a 159.66 and 872.35 mm; every figure of its row."""
    (pair,) = mesh_pairs(replace(HELICAL, **PRINTED_TIPS))
    assert row(pair) == pytest.approx((17.85584, 1, 0.9, 12.37047, 17.46485, 14.84512), rel=1e-6)
    assert pair.contact_ratio == pytest.approx(1.5491, abs=2e-5)


@pytest.mark.parametrize(("k", "mesh"), [(0.0, 17.4672), (None, 17.4550)])
def test_first_published_row_by_tip_shortening(k, mesh):
    """Tips of full height come within 1.4e-4 of the printed row, shortened ones within 6e-4."""
    (pair,) = mesh_pairs(replace(HELICAL, tip_shortening=k))
    assert pair.method_b().mesh_alpha == pytest.approx(mesh, abs=5e-5)
    assert pair.method_b().mesh_alpha == pytest.approx(17.46485, rel=6e-4)


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (0, (18.1986, 0.8623, 0.975, 12.240, 15.640, 13.294)),
        (1, (20.8939, 0.8623, 0.975, 14.053, 20.563, 17.479)),
    ],
)
def test_published_planetary_stage_with_its_webbed_planet(mesh, expected):
    assert row(mesh_pairs(TURBINE)[mesh]) == pytest.approx(expected, rel=5e-4)


@pytest.mark.parametrize("gear", ["sun", "planet", "ring"])
def test_given_diameters_go_before_factors(gear):
    """The circles of a gear, told as diameters beside factors that say something else."""
    helical = {"helix_angle_deg": 8.0, "centre_distance_mm": 590.0}
    stage = replace(TURBINE, tip_shortening=-0.02, **helical)
    mesh, index = {"sun": (0, 0), "planet": (1, 0), "ring": (1, 1)}[gear]
    known = mesh_pairs(stage)[mesh].geometry
    for circle in ("tip", "root"):
        radius_m = getattr(known.gears[index], f"{circle}_radius_m")
        diameter = {f"{circle}_diameter_{gear}_mm": 2e3 * radius_m}
        told = replace(stage, **diameter, **{f"{circle}_factor_{gear}": 1.1})
        found = mesh_pairs(told)[mesh].geometry
        assert found.tip_radii_m == pytest.approx(known.tip_radii_m, rel=1e-12)
        roots = [own.root_radius_m for own in known.gears]
        assert [own.root_radius_m for own in found.gears] == pytest.approx(roots, rel=1e-12)


def test_the_shortening_of_a_stage_is_that_of_sun_and_planet_alone():
    inner, outer = (pair.geometry for pair in mesh_pairs(replace(TURBINE, tip_shortening=-0.05)))
    assert [own.tip_shortening for own in inner.gears] == [-0.05, -0.05]
    assert [own.tip_shortening for own in outer.gears] == [-0.05, 0.0]


@pytest.mark.parametrize("shortening", [None, 0.0, -0.03])
@pytest.mark.parametrize(
    "told", [{}, {"tip_diameter_planet_mm": 2.0}, {"tip_diameter_sun_mm": 2.0}]
)
def test_a_planet_is_one_body_in_both_of_its_meshes(shortening, told):
    """Its tips reach as far in the mesh with the ring as in that with the sun."""
    helical = {"helix_angle_deg": 8.0, "centre_distance_mm": 590.0, "tip_shortening": shortening}
    stage = replace(TURBINE, **helical)
    sun, planet = mesh_pairs(stage)[0].geometry.gears
    radii = {"tip_diameter_sun_mm": sun.tip_radius_m, "tip_diameter_planet_mm": planet.tip_radius_m}
    cut = {key: 2e3 * radii[key] - less for key, less in told.items()}
    inner, outer = (pair.geometry for pair in mesh_pairs(replace(stage, **cut)))
    assert outer.tip_radii_m[0] == pytest.approx(inner.tip_radii_m[1], rel=1e-12)
    for key, diameter in cut.items():
        index = 0 if "sun" in key else 1
        assert 2e3 * inner.tip_radii_m[index] == pytest.approx(diameter, rel=1e-12)


def test_speed_increasing_stage_has_the_same_stiffness():
    """Index 1 is the gear with fewer teeth, whichever drives."""
    swapped = replace(
        HELICAL,
        pinion_teeth=103,
        gear_teeth=17,
        profile_shift_pinion=0.0,
        profile_shift_gear=0.145,
        tip_diameter_pinion_mm=872.35,
        tip_diameter_gear_mm=159.66,
    )
    (there,), (back,) = (mesh_pairs(s) for s in (replace(HELICAL, **PRINTED_TIPS), swapped))
    assert row(back) == pytest.approx(row(there), rel=1e-12)
    assert equivalent_mass(back, []) == pytest.approx(equivalent_mass(there, []))


def test_the_more_flexible_body_decides():
    stage = replace(HELICAL, web_width_gear_mm=30.0, rim_thickness_gear_mm=24.0)
    expected = 1 + math.log(0.3) / (5 * math.exp(3 / 5))
    assert mesh_pairs(stage)[0].method_b().blank == pytest.approx(expected)
    both = replace(stage, web_width_pinion_mm=80.0, rim_thickness_pinion_mm=24.0)
    assert mesh_pairs(both)[0].method_b().blank == pytest.approx(expected)


def test_application_factor_decides_on_the_low_load_branch():
    (calm,), (rough,) = (mesh_pairs(replace(HELICAL, application_factor=f)) for f in (1.0, 1.5))
    force = 9000 / math.cos(calm.stage.transverse_pressure_angle_rad)
    assert calm.method_b(force).load == pytest.approx(0.9**0.25)
    assert rough.method_b(force).load == 1.0


def test_resonance_speed_of_the_published_helical_pair():
    """DIN 3990 example, 0.0074 kg/mm and n_E1 = 18419 1/min: d_m1 = 53.628 mm, d_m2 = u d_m1."""
    stage = ParallelStage(
        pinion_teeth=25,
        gear_teeth=40,
        module_mm=2.0,
        helix_angle_deg=20.0,
        face_width_mm=20.0,
        root_factor_pinion=1.3,
        root_factor_gear=1.3,
        tip_diameter_pinion_mm=2 * 53.628 - (50 / math.cos(20 * DEG) - 5.2),
        tip_diameter_gear_mm=2 * 1.6 * 53.628 - (80 / math.cos(20 * DEG) - 5.2),
        contact_ratio=1.527,
        density_kgm3=7800.0,
    )
    (pair,) = mesh_pairs(stage)
    mass, stiffness = equivalent_mass(pair, []) / 0.02, pair.method_b().mesh_alpha
    assert mass == pytest.approx(7.4, abs=0.05)
    natural_hz = math.sqrt(1e9 * stiffness / mass) / (2 * math.pi)
    assert 60 * natural_hz / 25 == pytest.approx(18419, rel=3e-3)
    assert stiffness == pytest.approx(17.21, rel=5e-4)


# --- limits of validity --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "data", "match"),
    [
        ({}, {"helix_angle_rad": 35 * DEG}, "above 30 deg"),
        ({}, {"contact_ratio": 1.1}, "below 1.2"),
        ({"profile_shift": -0.1}, {}, "smaller gear is below"),
        ({"profile_shift": 2.3}, {}, "outside -0.5 ... 2"),
        ({}, {"load_n_per_mm": 50.0}, "below 100 N/mm"),
        ({}, {"load_n_per_mm": 2000.0}, "above 1600 N/mm"),
        ({}, {"web": (0.1, 2.0)}, "b_s/b = 0.1 is outside 0.2 ... 1.2"),
        ({}, {"web": (0.3, 0.6)}, "s_R/m_n = 0.6 is below 1"),
    ],
)
def test_limits_that_are_left_are_reported(change, data, match):
    one = replace(tooth(20, 0.1), **change)
    found = method_b(one, tooth(40), **{"contact_ratio": 1.5, **data})
    assert any(match in text for text in found.warnings)


def test_no_warning_within_the_limits():
    assert method_b(tooth(20, 0.1), tooth(40), contact_ratio=1.5).warnings == ()


def test_impossible_data_are_refused():
    ring = tooth(90, internal=True)
    with pytest.raises(ArgumentError, match="do not mesh with each other"):
        method_b(ring, ring, contact_ratio=1.5)
    with pytest.raises(ArgumentError, match="contact_ratio=0"):
        method_b(tooth(20), tooth(40), contact_ratio=0)
    with pytest.raises(ArgumentError, match="load_n_per_mm"):
        method_b(tooth(20), tooth(40), contact_ratio=1.5, load_n_per_mm=0.0)
    with pytest.raises(ArgumentError, match="outside the range of the stiffness polynomial"):
        method_b(tooth(5, 3.0), tooth(6, 2.9), contact_ratio=1.5)
