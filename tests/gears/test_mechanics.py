"""Mass, damping, force and natural frequency against closed forms and the published example."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.gears.faults import parse_error, parse_fault
from gearmon.gears.mechanics import (
    DAMPING_RATIO,
    disc_body,
    gear_disc,
    load_share,
    stage_mechanics,
)
from gearmon.gears.pairs import mesh_pairs
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage

PAPER = ParallelStage(
    pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=40.0, contact_ratio=1.412
)
KNOWN = ParallelStage(
    pinion_teeth=26,
    gear_teeth=53,
    mesh_stiffness_n_per_m=8e8,
    stiffness_variation=0.13,
    equivalent_mass_kg=0.28,
    damping_ns_per_m=9e3,
    contact_ratio=1.412,
    force_n=4e3,
)
PLANETARY = PlanetaryStage(
    sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=1.0, face_width_mm=10.0
)


def machine(*stages, torque=98.12, speed=1460.0):
    point = OperatingPoint(speed_rpm=speed, torque_nm=torque)
    return Machine(name="box", operating=(point,), stages=stages)


# --- the published example -----------------------------------------------------------------------


def test_published_force_and_mesh_frequency():
    """98.12 Nm on a base radius of 24.432 mm: 4016 N; 26 teeth at 1460 rpm: 632.667 Hz."""
    found = stage_mechanics(machine(PAPER), 1)
    assert found.force_n == pytest.approx(4016, abs=0.1)
    assert found.mesh_frequency_hz == pytest.approx(632.667, abs=1e-3)
    assert 1e3 * found.period_s == pytest.approx(1.58061, abs=1e-5)
    radii = mesh_pairs(PAPER)[0].base_radii_m
    assert radii == pytest.approx((0.02443201, 0.04980371), abs=1e-8)


def test_published_dynamics():
    """w0 = 53452.25 rad/s, zeta = 0.300669, delta = 5.0 um from k, m, c, F alone."""
    found = stage_mechanics(machine(KNOWN, torque=None), 1)
    assert 2 * math.pi * found.natural_frequency_hz == pytest.approx(53452.25, abs=0.01)
    assert found.natural_frequency_hz == pytest.approx(8507.19, abs=0.01)
    assert found.damping_ratio == pytest.approx(0.300669, abs=1e-6)
    assert found.force_n / found.stiffness.mean_n_per_m == pytest.approx(5e-6)
    mesh = 2 * math.pi * found.mesh_frequency_hz
    assert 53452.25 / mesh == pytest.approx(13.4466, abs=1e-4)
    assert 53452.25 / (2 * math.pi * 625.0) == pytest.approx(13.6115, abs=1e-4)
    damping = found.damping_ns_per_m / found.equivalent_mass_kg
    assert damping == pytest.approx(32142.9, abs=0.05)
    natural = 2 * math.pi * found.natural_frequency_hz
    assert found.damping_ratio * natural == pytest.approx(16071.4, abs=0.05)
    assert (found.equivalent_mass_kg, found.damping_ns_per_m) == (0.28, 9e3)
    assert found.assumptions == ()
    assert found.stiffness.warnings == ()


def test_mass_of_the_published_pair():
    """0.2815 kg at 37 mm for discs of the reference diameters; ISO's mean diameters are less."""
    whole = replace(PAPER, face_width_mm=37.0, root_factor_pinion=1.0, root_factor_gear=1.0)
    assert stage_mechanics(machine(whole), 1).equivalent_mass_kg == pytest.approx(0.2815, abs=5e-5)
    wide = stage_mechanics(machine(replace(whole, face_width_mm=40.0)), 1)
    assert wide.equivalent_mass_kg == pytest.approx(0.3044, abs=1e-4)
    usual = stage_mechanics(machine(replace(PAPER, face_width_mm=37.0)), 1)
    assert usual.equivalent_mass_kg == pytest.approx(0.2815 * (25.75 / 26) ** 4, rel=1e-2)


# --- mass ----------------------------------------------------------------------------------------


@given(st.integers(18, 60), st.integers(18, 90), st.floats(0, 0.6))
def test_mass_of_discs(z1, z2, hollow):
    """1/m = r_b1^2/J1 + r_b2^2/J2 with J = (pi/2) rho b (r^4 - r_i^4), r half of (d_a + d_f)/2."""
    bores = [hollow * z for z in (z1, z2)]
    stage = ParallelStage(
        pinion_teeth=z1,
        gear_teeth=z2,
        module_mm=1.0,
        face_width_mm=10.0,
        bore_diameter_pinion_mm=bores[0] or None,
        bore_diameter_gear_mm=bores[1] or None,
    )
    yielding = 0.0
    for z, bore in zip((z1, z2), bores, strict=True):
        mean, base = 0.5e-3 * (z - 0.25), 0.5e-3 * z * math.cos(math.radians(20))
        inertia = math.pi / 2 * 7850 * 0.01 * (mean**4 - (0.5e-3 * bore) ** 4)
        yielding += base**2 / inertia
    found = stage_mechanics(machine(stage), 1)
    assert found.equivalent_mass_kg == pytest.approx(1 / yielding)


def test_mass_agrees_with_the_standard():
    """m_red = (pi/8)(d_m1/d_b1)^2 d_m1^2 rho/(1 + 1/u^2) takes d_m2/d_m1 = u: within 1 %."""
    found = stage_mechanics(machine(PAPER), 1)
    base = 2 * mesh_pairs(PAPER)[0].base_radii_m[0]
    standard = math.pi / 8 * (0.0515 / base) ** 2 * 0.0515**2 * 7850 / (1 + (26 / 53) ** 2)
    assert found.equivalent_mass_kg == pytest.approx(0.04 * standard, rel=1e-2)
    mesh = mesh_pairs(PAPER)[0].method_b(found.force_n).mesh_alpha
    natural_hz = math.sqrt(1e9 * mesh / standard) / (2 * math.pi)
    assert found.natural_frequency_hz == pytest.approx(natural_hz, rel=5e-3)


def test_solid_discs_are_said_to_be_assumed():
    plain = stage_mechanics(machine(PAPER), 1)
    assert any("pinion and gear taken as solid discs" in text for text in plain.assumptions)
    bored = replace(PAPER, bore_diameter_pinion_mm=20.0)
    found = stage_mechanics(machine(bored), 1)
    assert any(text.startswith("gear taken as solid") for text in found.assumptions)


def test_a_web_is_lighter_than_a_disc():
    """Rim at full width, web at its own: J = (pi/2) rho [b (r^4 - r_i^4) + b_s (r_i^4 - r_b^4)]."""
    stage = replace(
        PAPER, bore_diameter_gear_mm=30.0, web_width_gear_mm=10.0, rim_thickness_gear_mm=8.0
    )
    inner, mean, base = 0.053 - 0.0025 - 0.008, 0.053 - 0.00025, 0.053 * math.cos(math.radians(20))
    inertia = 0.04 * (mean**4 - inner**4) + 0.01 * (inner**4 - 0.015**4)
    pinion = 0.04 * (0.026 - 0.00025) ** 4
    yielding = [
        (0.026 * math.cos(math.radians(20))) ** 2 / pinion,
        base**2 / inertia,
    ]
    expected = math.pi / 2 * 7850 / sum(yielding)
    assert stage_mechanics(machine(stage), 1).equivalent_mass_kg == pytest.approx(expected)


# --- damping -------------------------------------------------------------------------------------


def test_damping_ratio_taken_is_said():
    found = stage_mechanics(machine(PAPER), 1)
    k, m = found.stiffness.mean_n_per_m, found.equivalent_mass_kg
    assert found.damping_ratio == DAMPING_RATIO
    assert found.damping_ns_per_m == pytest.approx(2 * 0.07 * math.sqrt(k * m))
    assert any("damping ratio of the mesh taken as 0.07" in text for text in found.assumptions)
    told = stage_mechanics(machine(replace(PAPER, damping_ratio=0.1)), 1)
    assert told.damping_ratio == 0.1
    assert not any("damping" in text for text in told.assumptions)


def test_damage_leaves_damping_and_natural_frequency():
    healthy = stage_mechanics(machine(PAPER), 1)
    hurt = stage_mechanics(machine(PAPER), 1, faults=[parse_fault("crack:1:gear:3:40%")])
    assert hurt.stiffness.mean_n_per_m < healthy.stiffness.mean_n_per_m
    assert hurt.natural_frequency_hz == healthy.natural_frequency_hz
    assert hurt.damping_ns_per_m == healthy.damping_ns_per_m
    assert hurt.period_s == pytest.approx(53 * healthy.period_s)


# --- torque through the train --------------------------------------------------------------------


def test_load_of_the_teeth_is_the_tangential_force_over_the_face():
    """2 T/(d b) over 100 N/mm at the largest torque that is told; infinite where none is."""
    told = [None, 49.06, 98.12]
    points = [OperatingPoint(speed_rpm=1460.0, torque_nm=torque, share=1 / 3) for torque in told]
    assert load_share(replace(machine(PAPER), operating=points), 1) == pytest.approx(
        2 * 98.12 / (0.052 * 40.0) / 100.0
    )
    assert load_share(machine(replace(PAPER, application_factor=1.5)), 1) == pytest.approx(
        1.5 * load_share(machine(PAPER), 1)
    )
    assert math.isinf(load_share(machine(PAPER, torque=None), 1))
    assert math.isinf(load_share(machine(replace(PAPER, face_width_mm=None)), 1))


def test_torque_grows_as_the_speed_falls():
    train = machine(PAPER, PAPER)
    second = stage_mechanics(train, 2)
    torque = second.force_n * mesh_pairs(PAPER)[0].base_radii_m[0]
    assert torque == pytest.approx(98.12 * 53 / 26)
    assert second.mesh_frequency_hz == pytest.approx(632.66667 * 26 / 53)


def test_faults_of_other_stages_are_left_aside():
    faults = [parse_fault("crack:1:pinion:3:40%"), parse_fault("crack:2:gear:50:40%")]
    faults += [parse_error("pitch:1:gear:7:8um"), parse_fault("wear:1:gear:all:0.02mm")]
    found = stage_mechanics(machine(PAPER, PAPER), 2, faults=faults)
    assert found.stiffness.period_mesh == 53
    assert not found.excitation.at(np.linspace(0.0, 53.0, 300)).any()


def test_faults_of_stages_that_do_not_exist_are_refused():
    with pytest.raises(ArgumentError, match="stage 3 does not exist, the machine has 1"):
        stage_mechanics(machine(PAPER), 1, faults=[parse_fault("crack:3:pinion:3:40%")])


def test_operating_point():
    point = OperatingPoint(speed_rpm=730.0, torque_nm=49.06)
    half = stage_mechanics(machine(PAPER), 1, point)
    assert half.force_n == pytest.approx(4016.043 / 2)
    assert half.mesh_frequency_hz == pytest.approx(632.66667 / 2)


@pytest.mark.parametrize("mesh", [0, 1])
@pytest.mark.parametrize(
    ("fixed", "driving"),
    [
        ("ring", "sun"),
        ("ring", "carrier"),
        ("sun", "carrier"),
        ("sun", "ring"),
        ("carrier", "sun"),
        ("carrier", "ring"),
    ],
)
def test_power_is_conserved_in_a_planetary_stage(fixed, driving, mesh):
    """Power through the planets' meshes, seen from the carrier, balances torque by torque."""
    stage = replace(PLANETARY, fixed=fixed, driving=driving)
    found = stage_mechanics(machine(stage, torque=50.0), 1, mesh=mesh)
    sun, ring = 20, 100
    share = {"sun": sun, "ring": ring, "carrier": sun + ring}
    sun_torque = 50.0 * sun / share[driving]
    base = 0.5e-3 * sun * math.cos(math.radians(20))
    # the same in both meshes of a planet: its torques balance
    assert found.force_n == pytest.approx(sun_torque / 4 / base)


def test_published_mesh_frequency_of_a_planetary_stage():
    """Sun 20, ring 100, ring fixed: f_m = z_r f_c = 100 f_s/6."""
    found = stage_mechanics(machine(PLANETARY, speed=1800.0), 1)
    assert found.mesh_frequency_hz == pytest.approx(30.0 * 100 / 6)
    assert found.mesh == "sun-planet"


def test_mass_of_a_planetary_stage():
    """The sun carries all planets: 1/m = N r_bs^2/J_s + r_bp^2/J_p; the ring does not yield."""
    inner, outer = (stage_mechanics(machine(PLANETARY), 1, mesh=i) for i in (0, 1))

    def yielding(z):
        mean, base = 0.5e-3 * (z - 0.25), 0.5e-3 * z * math.cos(math.radians(20))
        return base**2 / (math.pi / 2 * 7850 * 0.01 * mean**4)

    assert inner.equivalent_mass_kg == pytest.approx(1 / (4 * yielding(20) + yielding(40)))
    assert outer.equivalent_mass_kg == pytest.approx(1 / yielding(40))
    assert any("ring is taken as rigid" in text for text in outer.assumptions)


@pytest.mark.parametrize("stage", [PAPER, PLANETARY])
def test_the_equivalent_mass_of_discs_gives_back_their_density_at_any_width(stage):
    """And with it every gear's inertia: density and width in proportion to one another."""
    known = stage_mechanics(machine(stage), 1).equivalent_mass_kg
    given = [replace(stage, equivalent_mass_kg=known, face_width_mm=own) for own in (40.0, 10.0)]
    for own in given:
        for found, solid in zip(mesh_pairs(own), mesh_pairs(stage), strict=True):
            width, density = disc_body(found, "", "")
            assert width * density == pytest.approx(7850.0 * 1e-3 * stage.face_width_mm)
            for index in range(2):
                assert gear_disc(found, index) == pytest.approx(gear_disc(solid, index))


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "torque", "match"),
    [
        ({"module_mm": None}, 10.0, "module_mm is missing: the base circle needs it"),
        ({"face_width_mm": None}, 10.0, "face_width_mm is missing: the mean stiffness needs it"),
        ({}, None, r"torque_nm of \[operating\] is missing.*or force_n in this stage"),
        ({}, 0.0, r"torque_nm of \[operating\] = 0 leaves the teeth unloaded"),
    ],
)
def test_missing_data_are_asked_for(change, torque, match):
    with pytest.raises(ArgumentError, match=match):
        stage_mechanics(machine(replace(PAPER, **change), torque=torque), 1)


def test_missing_mass_data_are_asked_for():
    stage = replace(KNOWN, equivalent_mass_kg=None)
    with pytest.raises(ArgumentError, match=r"face_width_mm is missing.*equivalent_mass_kg"):
        stage_mechanics(machine(stage), 1)


def test_a_bore_that_meets_the_roots_is_refused():
    # the stage checks the bore against the roots without knowing the module of an override
    with pytest.raises(ArgumentError, match="bore_diameter_pinion_mm"):
        stage_mechanics(machine(replace(PAPER, bore_diameter_pinion_mm=47.5)), 1)


def test_stages_and_meshes_that_do_not_exist():
    with pytest.raises(ArgumentError, match=r"stage=2 must lie in \[1, 1\]"):
        stage_mechanics(machine(PAPER), 2)
    with pytest.raises(ArgumentError, match=r"mesh=1 of stage 1 must be one of 0 \(pinion-gear\)"):
        stage_mechanics(machine(PAPER), 1, mesh=1)


def test_messages_name_the_file():
    box = Machine(
        name="box",
        operating=(OperatingPoint(speed_rpm=100.0),),
        stages=(PAPER,),
        path="box.toml",
    )
    with pytest.raises(ArgumentError, match=r"^box.toml: \[\[stage\]\] 1: torque_nm"):
        stage_mechanics(box, 1)
