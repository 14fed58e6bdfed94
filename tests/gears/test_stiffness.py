"""Mesh stiffness of stages, healthy and damaged, against slow versions and laws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from reference.mesh_curves import damaged_mesh, fft_coefficients, helical_mesh, parabolic_mesh

from gearmon.errors import ArgumentError
from gearmon.gears.faults import Fault, parse_fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.stiffness import FORMS, FourierSum, MeshStiffness, mesh_stiffness, zone_means
from gearmon.machine import ParallelStage, PlanetaryStage

PAPER = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=40.0)
SHORT = replace(PAPER, contact_ratio=1.412)
HELICAL = ParallelStage(
    pinion_teeth=25, gear_teeth=40, module_mm=2.0, face_width_mm=20.0, helix_angle_deg=20.0
)
PLANETARY = PlanetaryStage(
    sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=1.0, face_width_mm=10.0
)
SINGLE = ("stiffness", "crack", "breakage", "pitting", "spall")


def crack(tooth=1, size=0.2, gear="pinion", kind="crack"):
    return Fault(kind=kind, stage=1, gear=gear, tooth=tooth, size=size)


@st.composite
def stages(draw):
    """Random parallel stages whose gears can run."""
    stage = ParallelStage(
        pinion_teeth=draw(st.integers(12, 45)),
        gear_teeth=draw(st.integers(12, 60)),
        module_mm=draw(st.floats(0.5, 12)),
        face_width_mm=draw(st.floats(5, 120)),
        helix_angle_deg=draw(st.sampled_from([0.0, 0.0, 8.0, -20.0])),
        profile_shift_pinion=draw(st.floats(-0.1, 0.6)),
        profile_shift_gear=draw(st.floats(-0.2, 0.5)),
    )
    try:
        mesh_stiffness(stage)
    except ArgumentError:
        assume(False)
    return stage


def faults_of(stage, draw, kinds=SINGLE, most=3):
    teeth = {"pinion": stage.pinion_teeth, "gear": stage.gear_teeth}
    found = []
    for _ in range(draw(st.integers(1, most))):
        gear = draw(st.sampled_from(["pinion", "gear"]))
        found.append(
            Fault(
                kind=draw(st.sampled_from(kinds)),
                stage=1,
                gear=gear,
                tooth=draw(st.integers(1, teeth[gear])),
                size=draw(st.floats(0, 0.999)),
            )
        )
    return found


# --- the mean ------------------------------------------------------------------------------------


def test_mean_is_that_of_the_standard():
    """c_gamma_alpha = 20.40834 N/(mm um) at eps_a = 1.692757, over 40 mm."""
    mesh = mesh_stiffness(PAPER)
    assert mesh.contact_ratio == pytest.approx(1.692757, abs=1e-6)
    assert mesh.mean_n_per_m == pytest.approx(13.430358 * (0.75 * 1.692757 + 0.25) * 4e7, rel=1e-6)
    assert mesh_stiffness(SHORT).mean_n_per_m == pytest.approx(17.5803 * 4e7, rel=1e-5)


def test_maximum_normalisation_puts_the_peak_of_one_pair_at_the_standard():
    """K_max = c' b = 13.43036 N/(mm um) x 40 mm; mean 0.85 eps_a K_max."""
    mesh = mesh_stiffness(SHORT, form="parabolic-maximum")
    assert mesh.at([0.706])[0] == pytest.approx(13.43036e9 * 0.04, rel=1e-6)
    assert mesh.mean_n_per_m == pytest.approx(0.85 * 1.412 * 13.43036e9 * 0.04, rel=1e-6)


@pytest.mark.parametrize("form", sorted(FORMS))
def test_overrides_alone_are_enough(form):
    stage = ParallelStage(
        pinion_teeth=26,
        gear_teeth=53,
        mesh_stiffness_n_per_m=8e8,
        stiffness_variation=0.13,
        contact_ratio=1.412,
    )
    mesh = mesh_stiffness(stage, form=form)
    assert mesh.mean_n_per_m == pytest.approx(8e8)
    assert mesh.variation == 0.13


def test_paper_square_wave():
    """k = k_g [1 + eps f], f = (4/pi) sum (-1)^j cos((2j+1) Omega t)/(2j+1), eps = 0.13."""
    stage = ParallelStage(
        pinion_teeth=26,
        gear_teeth=53,
        mesh_stiffness_n_per_m=8e8,
        stiffness_variation=0.13,
        contact_ratio=1.412,
    )
    mesh = mesh_stiffness(stage, form=FourierSum(terms=15))
    t = np.linspace(0, 1, 257)
    j = np.arange(15)[:, None]
    f = 4 / np.pi * ((-1.0) ** j * np.cos(2 * np.pi * (2 * j + 1) * t) / (2 * j + 1)).sum(axis=0)
    # the one representation of pulses interpolates the sum: 1.7e-12 where the wave crosses its mean
    np.testing.assert_allclose(mesh.at(t + 0.25), 8e8 * (1 + 0.13 * f), rtol=4e-12)
    c = mesh.harmonics(31)
    expected = np.zeros(31)
    expected[0:30:2] = 0.13 * 2 / np.pi / (2 * np.arange(15) + 1)
    np.testing.assert_allclose(np.abs(c), expected, atol=1e-14)


def test_low_load_lowers_the_mean():
    full, low = mesh_stiffness(PAPER, force_n=50e3), mesh_stiffness(PAPER, force_n=2e3)
    load = 2e3 * math.cos(math.radians(20)) / 40
    assert low.mean_n_per_m == pytest.approx(full.mean_n_per_m * (load / 100) ** 0.25)
    assert any("low-load branch" in text for text in low.warnings)


@given(stages(), st.floats(0.2, 4))
def test_mean_is_proportional_to_modulus_and_face_width(stage, factor):
    base = mesh_stiffness(stage)
    stiffer = replace(
        stage,
        elastic_modulus_pinion_pa=factor * 206e9,
        elastic_modulus_gear_pa=factor * 206e9,
    )
    assert mesh_stiffness(stiffer).mean_n_per_m == pytest.approx(factor * base.mean_n_per_m)
    if stage.helix_angle_deg == 0:
        wider = replace(stage, face_width_mm=factor * stage.face_width_mm)
        assert mesh_stiffness(wider).mean_n_per_m == pytest.approx(factor * base.mean_n_per_m)


@given(stages(), st.floats(0.3, 3))
def test_stiffness_is_independent_of_the_module_of_similar_spur_gears(stage, factor):
    stage = replace(stage, helix_angle_deg=0.0)
    try:
        base = mesh_stiffness(stage)
    except ArgumentError:
        assume(False)
    scaled = mesh_stiffness(replace(stage, module_mm=factor * stage.module_mm))
    x = np.linspace(0.013, 1.013, 40)
    np.testing.assert_allclose(scaled.at(x), base.at(x), rtol=1e-9)


# --- the curve -----------------------------------------------------------------------------------


def test_spur_curve_is_the_sum_of_parabolas():
    mesh = mesh_stiffness(SHORT)
    x = np.linspace(0, 1, 57)
    slow = np.array([parabolic_mesh(p % 1, 1.412) for p in x]) / (0.85 * 1.412)
    np.testing.assert_allclose(mesh.at(x), slow * mesh.mean_n_per_m, rtol=1e-12)


def test_helical_curve_is_the_mean_over_sections():
    mesh = mesh_stiffness(HELICAL)
    assert mesh.overlap_ratio == pytest.approx(1.0887, abs=1e-4)
    x = np.linspace(0, 1, 9)
    slow = [helical_mesh(p, mesh.contact_ratio, mesh.overlap_ratio) for p in x]
    scale = mesh.mean_n_per_m / (0.85 * mesh.contact_ratio)
    np.testing.assert_allclose(mesh.at(x), np.array(slow) * scale, rtol=1e-4)


def test_whole_overlap_ratio_leaves_no_variation():
    width = math.pi * 2 / math.sin(math.radians(20))
    mesh = mesh_stiffness(replace(HELICAL, face_width_mm=width))
    assert mesh.overlap_ratio == pytest.approx(1)
    assert mesh.variation < 1e-12
    assert np.abs(mesh.harmonics(20)).max() < 1e-14


@given(stages())
def test_mirrored_pair_gives_the_curve_mirrored_in_time(stage):
    mirror = replace(
        stage,
        pinion_teeth=stage.gear_teeth,
        gear_teeth=stage.pinion_teeth,
        profile_shift_pinion=stage.profile_shift_gear,
        profile_shift_gear=stage.profile_shift_pinion,
    )
    there = mesh_stiffness(stage, [crack(1, 0.3), crack(1, 0.4, "gear", "pitting")])
    back = mesh_stiffness(mirror, [crack(1, 0.3, "gear"), crack(1, 0.4, "pinion", "pitting")])
    x = np.linspace(0.0101, there.period_mesh + 0.0101, 400)
    total = there.total_contact_ratio
    np.testing.assert_allclose(back.at(total - x), there.at(x), rtol=1e-7)


# --- variation -----------------------------------------------------------------------------------


def test_variation_is_half_the_peak_to_peak_over_the_mean():
    high, low = zone_means(1.412)
    square = mesh_stiffness(SHORT, form="rectangular-half")
    assert square.variation == pytest.approx((high - low) / (high + low))
    assert square.variation == pytest.approx(0.2199, abs=5e-5)
    assert mesh_stiffness(SHORT, form="fourier").variation == pytest.approx(square.variation)
    parabola = mesh_stiffness(SHORT)
    assert parabola.variation == pytest.approx(0.5 * (1.548588 - 0.921964) / 1.2002, rel=1e-6)


@given(
    st.sampled_from(["parabolic", "wave", "rectangular", "rectangular-half"]),
    st.floats(1.05, 2.9).filter(lambda r: 0.05 < r % 1 < 0.95),
    st.floats(0, 0.5),
)
def test_imposed_variation(form, ratio, wanted):
    """The curve keeps its mean and its shape and gets the variation."""
    plain = replace(PAPER, contact_ratio=ratio)
    natural = mesh_stiffness(plain, form=form)
    lowest = natural.at(np.arange(2000) / 2000).min() / natural.mean_n_per_m - 1
    assume(1 + lowest * wanted / natural.variation > 0.01)
    mesh = mesh_stiffness(replace(plain, stiffness_variation=wanted), form=form)
    x = np.linspace(0.00013, 1.00013, 1000)
    k = mesh.at(x)
    assert mesh.variation == wanted
    assert mesh.mean_n_per_m == pytest.approx(natural.mean_n_per_m)
    assert 0.5 * np.ptp(k) / mesh.mean_n_per_m == pytest.approx(wanted, abs=2e-3)
    shape = (natural.at(x) / natural.mean_n_per_m - 1) * wanted / natural.variation
    np.testing.assert_allclose(k / mesh.mean_n_per_m - 1, shape, atol=1e-9)


def test_impossible_variations_are_refused():
    deep = replace(PAPER, contact_ratio=1.9, stiffness_variation=0.7)
    with pytest.raises(ArgumentError, match=r"stiffness_variation=0.7 makes the rectangular stiff"):
        mesh_stiffness(deep, form="rectangular")
    width = math.pi * 2 / math.sin(math.radians(20))
    flat = replace(HELICAL, face_width_mm=width, stiffness_variation=0.1)
    with pytest.raises(ArgumentError, match="has no curve to stretch"):
        mesh_stiffness(flat)


@pytest.mark.parametrize("form", ["parabolic", "rectangular"])
def test_a_mesh_of_a_whole_overlap_is_flat_whether_its_file_says_so_or_not(form):
    flat = replace(HELICAL, face_width_mm=math.pi * 2 / math.sin(math.radians(20)))
    for own in (flat, replace(flat, stiffness_variation=0.0)):
        found = mesh_stiffness(own, form=form)
        assert found.variation == pytest.approx(0.0, abs=1e-9)
        values = found.at(np.linspace(0.0, 1.0, 50)) / found.mean_n_per_m
        np.testing.assert_allclose(values, 1.0, rtol=1e-9)


def test_a_stretched_mesh_still_loses_what_its_damaged_tooth_carries():
    stage = replace(SHORT, stiffness_variation=0.4)
    healthy, hurt = mesh_stiffness(stage), mesh_stiffness(stage, [crack(3, 0.25)])
    single = np.linspace(2.42, 2.99, 9)
    np.testing.assert_allclose(hurt.at(single), 0.75 * healthy.at(single), rtol=1e-9)
    x = np.linspace(0, 26, 2000)
    assert (hurt.at(x) <= healthy.at(x) * (1 + 1e-12)).all()


# --- damage --------------------------------------------------------------------------------------


def test_damaged_spur_mesh_against_pair_by_pair():
    """Two teeth of the pinion, one of the gear; where they meet the rests multiply."""
    faults = [crack(1, 0.3), crack(7, 0.5), crack(4, 0.4, "gear", "pitting")]
    stage = replace(SHORT, pinion_teeth=10, gear_teeth=13, mesh_stiffness_n_per_m=1e8)
    mesh = mesh_stiffness(stage, faults)
    assert mesh.period_mesh == 130
    x = np.linspace(0.0031, 130.0031, 3001)
    half, middle = 0.15 * 1.412, 0.706
    losses = (
        {1: lambda _: 0.3, 7: lambda _: 0.5},
        {4: lambda s: 0.4 * (middle - half <= s < middle + half)},
    )
    slow = [damaged_mesh(p, 1.412, losses, (10, 13)) for p in x]
    np.testing.assert_allclose(mesh.at(x), 1e8 * np.array(slow) / (0.85 * 1.412), rtol=1e-12)


def test_tooth_numbers_and_phases():
    """Tooth j enters contact at phase j - 1 and is back after one turn of its gear."""
    for gear, turn in (("pinion", 26), ("gear", 53)):
        healthy, hurt = mesh_stiffness(SHORT), mesh_stiffness(SHORT, [crack(9, 0.2, gear)])
        assert hurt.period_mesh == turn
        x = np.linspace(0, turn, turn * 100, endpoint=False)
        where = x[healthy.at(x) - hurt.at(x) > 1.0]
        assert where.min() == pytest.approx(8.0, abs=0.011)
        assert where.max() == pytest.approx(9.412, abs=0.011)


@pytest.mark.parametrize("form", sorted(FORMS))
@pytest.mark.parametrize("stage", [SHORT, replace(SHORT, helix_angle_deg=15.0)])
def test_harmonics_of_a_damaged_mesh_are_the_fft_of_its_curve(form, stage):
    """Contact ratio, overlap and band on a grid: Gauss FFT is exact."""
    stage = replace(
        stage,
        pinion_teeth=6,
        gear_teeth=9,
        contact_ratio=1.5,
        face_width_mm=0.25 * math.pi * 2 / math.sin(math.radians(15.0)),
        mesh_stiffness_n_per_m=1e8,
    )
    faults = [crack(2, 0.3), crack(5, 0.2, "gear"), crack(5, 0.5, "gear", "breakage")]
    mesh = mesh_stiffness(stage, faults, form)
    assert mesh.period_mesh == 18
    count = 90
    slow = fft_coefficients(mesh.at, 18.0, count, 18 * 16, nodes=20)
    assert mesh.mean_n_per_m == pytest.approx(slow[0].real, rel=1e-12)
    np.testing.assert_allclose(mesh.harmonics(count), slow[1:] / slow[0].real, atol=1e-12)


def sampled(mesh, points):
    """Stiffness over the true period, so many points a mesh."""
    return mesh.at(np.arange(mesh.period_mesh * points) / points)


@given(stages(), st.data())
def test_stiffness_stays_positive_and_harmonics_rebuild_the_mean_square(stage, data):
    """Parseval: sum of |c_r|^2 comes up to the variance of the curve from below."""
    faults = faults_of(stage, data.draw)
    mesh = mesh_stiffness(stage, faults, data.draw(st.sampled_from(sorted(FORMS))))
    k = sampled(mesh, max(3, 20_000 // mesh.period_mesh))
    assert k.min() > 0
    if mesh.period_mesh < 200:
        c = mesh.harmonics(40 * mesh.period_mesh)
        variance = np.var(sampled(mesh, 2000)) / mesh.mean_n_per_m**2
        assert 2 * np.sum(np.abs(c) ** 2) == pytest.approx(variance, rel=0.1, abs=1e-3)


@given(stages(), st.data())
def test_faults_of_size_zero_change_nothing(stage, data):
    faults = [replace(fault, size=0.0) for fault in faults_of(stage, data.draw)]
    faults.append(Fault(kind="wear", stage=1, gear="gear", tooth=None, size=0.0))
    mesh, healthy = mesh_stiffness(stage, faults), mesh_stiffness(stage)
    assert mesh.period_mesh == 1
    assert mesh.pulses == ()
    assert mesh.mean_n_per_m == healthy.mean_n_per_m
    np.testing.assert_array_equal(mesh.harmonics(30), healthy.harmonics(30))


@given(
    stages(),
    st.sampled_from(SINGLE),
    st.sampled_from(["pinion", "gear"]),
    st.floats(0, 0.99),
    st.floats(0, 0.99),
)
def test_loss_grows_with_size(stage, kind, gear, one, two):
    less, more = sorted((one, two))
    small = mesh_stiffness(stage, [crack(3, less, gear, kind)])
    large = mesh_stiffness(stage, [crack(3, more, gear, kind)])
    x = np.linspace(1.5, 6, 300)
    assert (large.at(x) <= small.at(x) * (1 + 1e-9)).all()
    assert large.mean_n_per_m <= small.mean_n_per_m * (1 + 1e-12)


def test_wear_lowers_all_pairs_alike():
    worn = mesh_stiffness(PAPER, [parse_fault("wear:1:pinion:all:10%")])
    healthy = mesh_stiffness(PAPER)
    assert worn.period_mesh == 1
    assert worn.mean_n_per_m == pytest.approx(0.9 * healthy.mean_n_per_m)
    np.testing.assert_allclose(worn.harmonics(9), healthy.harmonics(9), atol=1e-15)
    both = [parse_fault("wear:1:pinion:all:10%"), parse_fault("wear:1:gear:all:20%")]
    assert mesh_stiffness(PAPER, both).mean_n_per_m == pytest.approx(0.72 * healthy.mean_n_per_m)


@pytest.mark.parametrize("form", ["parabolic", "rectangular", "wave"])
@pytest.mark.parametrize("worn", [("pinion",), ("gear",), ("pinion", "gear")])
def test_worn_flanks_take_from_any_curve_what_they_take_from_the_teeth(worn, form):
    """Where one pair carries alone; elsewhere each form shares the load in its own way."""
    stage = replace(PAPER, contact_ratio=None)
    faults = [parse_fault(f"wear:1:{gear}:all:0.1mm") for gear in worn]
    left = []
    for own in (form, "potential-energy"):
        new, old = mesh_stiffness(stage, form=own), mesh_stiffness(stage, faults, own)
        x = np.linspace(new.contact_ratio % 1 + 0.01, 0.99, 9)
        left.append(old.at(x) / new.at(x))
        assert old.mean_n_per_m < new.mean_n_per_m
    np.testing.assert_allclose(1 - left[0], 1 - left[1], rtol=0.02)


def test_all_teeth_damaged_alike_is_wear():
    many = [crack(tooth, 0.1) for tooth in range(1, 27)]
    hurt = mesh_stiffness(PAPER, many)
    worn = mesh_stiffness(PAPER, [parse_fault("wear:1:pinion:all:10%")])
    x = np.linspace(0, 26, 500)
    np.testing.assert_allclose(hurt.at(x), worn.at(x), rtol=1e-12)
    families = np.abs(hurt.harmonics(26 * 5))
    assert np.delete(families, np.arange(25, 130, 26)).max() < 1e-14


def test_sidebands_of_one_damaged_tooth():
    """A pulse once per turn: its lines are the transform of one contact at fractional orders."""
    mesh = mesh_stiffness(SHORT, [crack(1, 0.2)])
    (train,) = mesh.pulses
    assert (train.gear, train.period_mesh) == ("pinion", 26)
    r = np.arange(1, 26 * 4)
    loss = mesh.healthy.terms[0].pulse.transform(r / 26) * -0.2 / 26
    np.testing.assert_allclose(train.coefficients(r), loss, rtol=1e-12)
    c = mesh.harmonics(26 * 4)
    sidebands = np.delete(np.arange(1, 26 * 4), np.arange(25, 26 * 3, 26))
    np.testing.assert_allclose(
        c[sidebands - 1], loss[sidebands - 1] / mesh.mean_n_per_m, rtol=1e-12
    )
    whole = mesh.healthy.coefficients([1, 2, 3]) / mesh.healthy_mean_n_per_m
    np.testing.assert_allclose(whole, mesh_stiffness(SHORT).harmonics(3))


def test_helical_breakage_hits_one_end_of_the_face_first():
    healthy, hurt = (
        mesh_stiffness(HELICAL, faults) for faults in ([], [crack(5, 0.2, kind="breakage")])
    )
    x = np.linspace(4, 9, 2000)
    lost = healthy.at(x) - hurt.at(x)
    end = 4 + healthy.contact_ratio + 0.2 * healthy.overlap_ratio
    assert lost[x < end].max() > 0
    np.testing.assert_allclose(lost[x > end + 0.01], 0, atol=1e-3)
    share = 1 - hurt.mean_n_per_m / healthy.mean_n_per_m
    assert share == pytest.approx(0.2 / 25)


def test_damaged_teeth_that_never_meet():
    """20 and 30 teeth share 10: pinion tooth 1 meets gear teeth 1, 11 and 21 only."""
    stage = replace(PAPER, pinion_teeth=20, gear_teeth=30)
    apart = mesh_stiffness(stage, [crack(1, 0.5), crack(2, 0.5, "gear")])
    assert [train.gear for train in apart.pulses] == ["pinion", "gear"]
    meet = mesh_stiffness(stage, [crack(1, 0.5), crack(11, 0.5, "gear")])
    assert [train.gear for train in meet.pulses] == ["pinion", "gear", "pinion and gear"]
    assert meet.period_mesh == 60
    k, healthy = meet.at([40.85]), mesh_stiffness(stage).at([0.85])
    assert k / healthy == pytest.approx(0.25)


def test_published_pair_from_its_machine_data():
    """ISO/TR 6336-30 example 1: 17.46485 with tips that are not shortened by 3 um as ours are."""
    stage = ParallelStage(
        pinion_teeth=17,
        gear_teeth=103,
        module_mm=8.0,
        face_width_mm=100.0,
        helix_angle_deg=15.8,
        profile_shift_pinion=0.145,
        centre_distance_mm=500.0,
        root_factor_pinion=1.4,
        root_factor_gear=1.4,
    )
    mesh = mesh_stiffness(stage)
    assert mesh.mean_n_per_m == pytest.approx(17.46485e9 * 0.1, rel=6e-4)
    increasing = replace(
        stage,
        pinion_teeth=103,
        gear_teeth=17,
        profile_shift_pinion=0.0,
        profile_shift_gear=0.145,
    )
    assert mesh_stiffness(increasing).mean_n_per_m == pytest.approx(mesh.mean_n_per_m)


def test_narrow_helical_gears_carry_by_their_overlap():
    stage = replace(HELICAL, contact_ratio=0.8)
    mesh = mesh_stiffness(stage)
    assert mesh.at(np.linspace(0, 1, 500)).min() > 0
    with pytest.raises(ArgumentError, match=r"total contact ratio 0.9.* is below 1"):
        mesh_stiffness(replace(stage, face_width_mm=2.0))


# --- planetary stages ----------------------------------------------------------------------------


def test_both_meshes_of_a_planetary_stage():
    inner, outer = (mesh_stiffness(pair) for pair in mesh_pairs(PLANETARY, 1))
    assert inner.mean_n_per_m == mesh_stiffness(PLANETARY).mean_n_per_m
    assert outer.contact_ratio > inner.contact_ratio
    assert outer.mean_n_per_m > inner.mean_n_per_m
    assert any("taken as relieved" in text for text in outer.warnings)


def test_faults_act_in_the_meshes_of_their_gear():
    inner, outer = mesh_pairs(PLANETARY, 1)
    sun, planet, ring = (
        Fault(kind="crack", stage=1, gear=gear, tooth=2, size=0.3)
        for gear in ("sun", "planet", "ring")
    )
    assert mesh_stiffness(inner, [sun, planet, ring]).period_mesh == 40
    assert mesh_stiffness(outer, [sun, planet, ring]).period_mesh == 100
    assert any(
        "does not act in the sun-planet" in t for t in mesh_stiffness(inner, [ring]).warnings
    )
    for kind in ("pitting", "spall", "crack"):
        one = replace(planet, kind=kind)
        assert mesh_stiffness(inner, [one]).period_mesh == 40
        assert mesh_stiffness(outer, [one]).period_mesh == 1
    assert any("is pressed shut" in t for t in mesh_stiffness(outer, [planet]).warnings)
    broken = replace(planet, kind="breakage")
    assert {mesh_stiffness(p, [broken]).period_mesh for p in (inner, outer)} == {40}


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"module_mm": None}, r"^\[\[stage\]\] 2: module_mm is missing: the contact ratio needs"),
        ({"face_width_mm": None}, "face_width_mm is missing.* mesh_stiffness_n_per_m"),
        ({"contact_ratio": 1.5, "module_mm": None, "helix_angle_deg": 9.0}, "overlap ratio needs"),
        ({"pinion_teeth": 9}, r"^\[\[stage\]\] 2: .* undercut at profile_shift_pinion=0"),
    ],
)
def test_missing_data_are_asked_for(change, match):
    with pytest.raises(ArgumentError, match=match):
        mesh_stiffness(replace(PAPER, **change), number=2)


@pytest.mark.parametrize(
    ("fault", "match"),
    [
        (crack(27), "tooth 27 does not exist, the pinion of .* has 26 teeth"),
        (crack(1, gear="sun"), "gear 'sun' is not one of pinion, gear"),
    ],
)
def test_faults_that_do_not_fit_are_refused(fault, match):
    with pytest.raises(ArgumentError, match=match):
        mesh_stiffness(PAPER, [fault])


def test_value_object():
    mesh = mesh_stiffness(PAPER)
    assert isinstance(mesh, MeshStiffness)
    assert mesh.at(0.3).shape == ()
    assert mesh.at(np.zeros((2, 3))).shape == (2, 3)
    assert mesh.harmonics(0).shape == (0,)
    assert mesh.total_contact_ratio == mesh.contact_ratio
