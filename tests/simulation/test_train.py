"""The model of the drive train: masses, forces, natural frequencies."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from reference.simulated_machines import one_pair, planetary, two_stages

from gearmon.errors import ArgumentError
from gearmon.gears.faults import parse_fault
from gearmon.gears.mechanics import stage_mechanics
from gearmon.gears.pairs import mesh_pairs
from gearmon.machine import Machine, OperatingPoint, load_machine
from gearmon.simulation.train import build_train


def deflections(train):
    """Of the meshes, under the mean load [m]."""
    return train.system.vectors @ train.system.at_rest


def held_rigidly(**second):
    """Two stages whose shafts do not move across their axes."""
    return replace(two_stages(**second), bearings=())


def test_one_stage_is_its_equivalent_mass_on_its_spring():
    machine = one_pair()
    train = build_train(machine)
    mechanics = stage_mechanics(machine, 1)
    assert train.system.vectors**2 == pytest.approx(np.array([[1 / 0.28]]))
    assert deflections(train) == pytest.approx(
        [mechanics.force_n / mechanics.stiffness.mean_n_per_m]
    )
    assert train.system.natural_frequencies_hz() == pytest.approx([mechanics.natural_frequency_hz])


def test_meshes_of_a_train_keep_their_equivalent_masses():
    system = build_train(held_rigidly()).system
    masses = [stage_mechanics(held_rigidly(), n).equivalent_mass_kg for n in (1, 2)]
    assert 1 / np.sum(system.vectors**2, axis=1) == pytest.approx(masses)


def test_static_forces_follow_the_torque_through_the_train():
    for machine in (two_stages(), held_rigidly()):
        train = build_train(machine)
        first, second = deflections(train) * train.system.means
        levers = [mesh_pairs(stage)[0].base_radii_m for stage in machine.stages]
        assert first * levers[0][0] == pytest.approx(98.0)
        assert second * levers[1][0] == pytest.approx(98.0 * 53 / 26)


def test_stiff_shaft_joins_the_discs_at_its_ends():
    thin = build_train(held_rigidly())
    thick = build_train(held_rigidly(bore_diameter_pinion_mm=50.0))
    told = [
        float(re.search(r"shaft 2: .* ([\d.e+]+) Nm", " ".join(t.notes))[1]) for t in (thin, thick)
    ]
    assert told[1] / told[0] == pytest.approx((50.0 / (0.6 * 57.5)) ** 4, rel=0.02)
    assert "50 mm in diameter (the bore of its gear)" in "".join(thick.notes)
    lowest = [train.system.natural_frequencies_hz()[0] for train in (thin, thick)]
    assert lowest[1] > 1.2 * lowest[0]


def test_load_scales_forces_whether_from_torque_or_given():
    for machine in (two_stages(), one_pair()):
        full, half = build_train(machine), build_train(machine, load=0.5)
        assert half.static_force == pytest.approx(0.5 * full.static_force)


@pytest.mark.parametrize("count", [1, 3, 4])
def test_planetary_set_has_as_many_frequencies_as_members_that_turn(count):
    frequencies = build_train(planetary(planets=count)).system.natural_frequencies_hz()
    # sun, carrier and planets, less the rotation of the whole set
    assert len(frequencies) == 2 + count - 1
    # planets that swing against one another leave sun and carrier at rest
    repeated = np.sum(np.isclose(frequencies, np.median(frequencies), rtol=1e-6))
    assert repeated >= max(count - 1, 1) or count == 1


def test_planets_swing_on_their_two_meshes():
    train = build_train(planetary(planets=4))
    inner, outer = train.meshes[0].mechanics, train.meshes[4].mechanics
    stiffness = train.system.means[0] + train.system.means[4]
    expected = math.sqrt(stiffness / outer.equivalent_mass_kg) / (2 * math.pi)
    frequencies = train.system.natural_frequencies_hz()
    assert np.sum(np.isclose(frequencies, expected, rtol=1e-3)) == 3
    assert inner.force_n == pytest.approx(outer.force_n)


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
def test_planetary_set_presses_all_flanks_whichever_member_drives(fixed, driving):
    train = build_train(planetary(fixed=fixed, driving=driving))
    carried = deflections(train) * train.system.means
    assert carried == pytest.approx(train.static_force)


def test_planets_meet_the_ring_in_the_phases_of_assembly():
    meshes = build_train(planetary()).meshes
    assert [m.name for m in meshes[:2]] == ["sun-planet 1", "sun-planet 2"]
    sun = np.array([m.offset for m in meshes[:3]])
    ring = np.array([m.offset for m in meshes[3:]])
    assert sun == pytest.approx([0, -20 / 3, -40 / 3])
    # the same fraction for each planet, as (sun + ring) / planets is whole
    apart = ring - sun - (ring - sun)[0]
    assert apart == pytest.approx(np.round(apart))


def test_crack_of_a_planet_is_on_the_first_and_opens_under_the_sun():
    # the ring loads the other flank, which presses the crack shut
    train = build_train(planetary(), [parse_fault("crack:1:planet:3:20%")])
    assert [len(m.mechanics.stiffness.pulses) for m in train.meshes] == [1, 0, 0, 0, 0, 0]


def test_every_flank_of_every_planet_has_deviations_of_its_own():
    train = build_train(planetary(), seed=3)
    sun, ring, planets = [], [], []
    for mesh in train.meshes:
        first, second = (own.pitch_m.tobytes() for own in mesh.errors)
        if "ring" in mesh.name:
            planets.append(first)
            ring.append(second)
        else:
            sun.append(first)
            planets.append(second)
    assert len(planets) == 6
    assert len(set(planets)) == 6
    # but all planets roll on the same sun and the same ring
    assert len(set(sun)) == len(set(ring)) == 1


def test_damage_of_the_sun_is_met_by_every_planet():
    train = build_train(planetary(), [parse_fault("crack:1:sun:3:20%")])
    assert [len(m.mechanics.stiffness.pulses) for m in train.meshes] == [1, 1, 1, 0, 0, 0]


@pytest.mark.parametrize(
    ("module", "teeth", "backlash"),
    [(2.0, (20, 30), 0.10), (2.0, (40, 60), 0.12), (3.0, (40, 93), 0.17), (5.0, (30, 50), 0.21)],
)
def test_backlash_is_that_of_the_table(module, teeth, backlash):
    """ISO/TR 10064-2, table A.1 [mm], for centre distances of 50, 100, 200 and 200 mm."""
    stage = {"kind": "parallel", "pinion_teeth": teeth[0], "gear_teeth": teeth[1],
             "module_mm": module, "face_width_mm": 20.0}  # fmt: skip
    machine = load_machine(operating={"speed_rpm": 1500.0, "torque_nm": 50.0}, stage=stage)
    assert 1e3 * build_train(machine).meshes[0].backlash_m == pytest.approx(backlash, abs=0.007)


def test_every_planet_counts_in_the_mass_of_the_gears():
    one, three = (build_train(planetary(planets=count)).gear_mass_kg for count in (1, 3))
    disc = 7850.0 * 20e-3 * math.pi * (0.5 * 1.5e-3 * 40) ** 2
    sun = 7850.0 * 20e-3 * math.pi * (0.5 * 1.5e-3 * 20) ** 2
    assert one == pytest.approx(sun + disc)
    assert three - one == pytest.approx(2 * disc)


def test_trains_of_all_kinds_can_be_built():
    parallel, sun = two_stages().stages[0], planetary().stages[0]
    point = (OperatingPoint(speed_rpm=1500.0, torque_nm=50.0),)
    for stages in ((parallel, sun), (sun, parallel), (sun, sun, parallel)):
        train = build_train(Machine(operating=point, stages=stages))
        assert np.all(deflections(train) > 0)
        assert sum("torsional stiffness" in note for note in train.notes) == len(stages) - 1
        assert train.system.decay_rate > 0


def test_same_seed_same_gears_with_and_without_a_fault():
    healthy = build_train(two_stages(), seed=5)
    faulty = build_train(two_stages(), [parse_fault("crack:1:pinion:2:10%")], seed=5)
    for one, other in zip(healthy.meshes, faulty.meshes, strict=True):
        for a, b in zip(one.errors, other.errors, strict=True):
            assert np.array_equal(a.pitch_m, b.pitch_m)
    other = build_train(two_stages(), seed=6).meshes[0].errors[0].pitch_m
    assert not np.array_equal(other, healthy.meshes[0].errors[0].pitch_m)


@pytest.mark.parametrize(
    ("fault", "match"),
    [
        ("crack:3:pinion:2:10%", "stage 3 does not exist, the machine has 2"),
        ("crack:1:pinion:27:10%", "tooth 27 does not exist"),
        ("crack:1:sun:2:10%", "gear 'sun' is not one of pinion, gear"),
    ],
)
def test_fault_that_does_not_fit_is_refused(fault, match):
    faults = [parse_fault(fault)]
    with pytest.raises(ArgumentError, match=match):
        build_train(two_stages(), faults)


def test_machine_without_mechanics_is_refused_with_the_key_to_add():
    machine = two_stages(module_mm=None)
    with pytest.raises(ArgumentError, match=r"\[\[stage\]\] 2.*module_mm"):
        build_train(machine)


def test_machine_without_torque_is_refused():
    machine = Machine(operating=(OperatingPoint(speed_rpm=1500.0),), stages=two_stages().stages)
    with pytest.raises(ArgumentError, match="torque_nm"):
        build_train(machine)


def test_a_planet_of_odd_teeth_meets_sun_and_ring_half_a_period_apart():
    """Parker and Lin: half the teeth of the planet lie between its two contacts."""
    for sun, planet, ring, apart in ((20, 40, 100, 0.0), (21, 39, 99, 0.5)):
        machine = planetary(sun_teeth=sun, planet_teeth=planet, ring_teeth=ring)
        meshes = build_train(machine).meshes
        assert (meshes[3].offset - meshes[0].offset) % 1.0 == pytest.approx(apart)
