"""What an elastic machine is put together of where its file says nothing: closed forms."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from gearmon.gears.assembly import drive_train
from gearmon.machine import load_machine

POINT = {"speed_rpm": 1500.0, "torque_nm": 100.0}
PAIR = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57, "module_mm": 2.5,
        "face_width_mm": 28.0}  # fmt: skip
SET = {"kind": "planetary", "sun_teeth": 20, "planet_teeth": 40, "ring_teeth": 100, "planets": 3,
       "module_mm": 1.5, "face_width_mm": 20.0}  # fmt: skip
SHAFT = {"shaft": 1, "length_mm": 100.0, "diameter_mm": 20.0}
BALLS = {"balls": 9, "ball_diameter_mm": 7.94, "pitch_diameter_mm": 39.04}


def told(train, pattern):
    return [float(own) for own in re.search(pattern, " ".join(train.notes)).groups()]


@pytest.mark.parametrize("angle", [15.0, 40.0])
def test_a_contact_angle_softens_a_ball_bearing_across(angle):
    """Friswell et al., section 5.5.1: as cos^(5/3)."""
    found = []
    for own in (0.0, angle):
        bearing = {"name": "input", "shaft": 1, "contact_angle_deg": own} | BALLS
        train = drive_train(load_machine(operating=POINT, stage=PAIR, bearing=bearing, shaft=SHAFT))
        found += told(train, r"bearing input: (\S+) N/m, a ball bearing's by Hertz")
    assert found[1] / found[0] == pytest.approx(math.cos(math.radians(angle)) ** (5 / 3), rel=0.01)


def test_a_roller_bearing_yields_as_published():
    """ROSS's example after Friswell et al.: 8 rollers of 30 mm, 30 degrees, 500 N, 5.568e8 N/m."""
    rollers = {"balls": 8, "ball_diameter_mm": 6.0, "pitch_diameter_mm": 40.0}
    more = {"contact_angle_deg": 30.0, "roller_length_mm": 30.0, "name": "pin", "planet_stage": 1}
    point = POINT | {"torque_nm": 500.0 * 3 * 0.5e-3 * 1.5 * (20 + 40) / (1 + 100 / 20)}
    machine = load_machine(operating=point, stage=SET, bearing=more | rollers)
    (found,) = told(drive_train(machine), r"bearing pin: (\S+) N/m, a roller bearing's by Hertz")
    assert found == pytest.approx(5.56779444e8, rel=2e-3)


def test_a_bearing_that_tells_only_its_balls_is_rigid_on_a_shaft_without_sections():
    bearing = {"name": "input", "shaft": 1} | BALLS
    told_nothing = drive_train(load_machine(operating=POINT, stage=PAIR, bearing=bearing))
    assert "bearing input is rigid: it has no stiffness_n_per_m" in told_nothing.notes
    modelled = drive_train(load_machine(operating=POINT, stage=PAIR, bearing=bearing, shaft=SHAFT))
    assert len(modelled.coordinates) > len(told_nothing.coordinates)


def test_a_planet_bearing_carries_its_part_of_the_torque_of_the_carrier():
    bearing = {"name": "pin", "planet_stage": 1} | BALLS
    train = drive_train(load_machine(operating=POINT, stage=SET, bearing=bearing))
    (load,) = told(train, r"bearing pin: .* by Hertz at (\S+) N")
    torque, radius = 100.0 * (1 + 100 / 20), 0.5e-3 * 1.5 * (20 + 40)
    assert load == pytest.approx(torque / (3 * radius), rel=1e-3)


def test_a_carrier_turns_as_a_disc_to_the_planet_axes():
    light = {"mass_planet_kg": 1e-9, "inertia_planet_kgm2": 1e-12}
    train = drive_train(load_machine(operating=POINT, stage=SET | light))
    (mass,) = told(train, r"carrier is a disc of (\S+) kg to the planet axes")
    (place,) = [n for n, own in enumerate(train.coordinates) if own.startswith("shaft 2")]
    assert mass == pytest.approx(7850.0 * math.pi * 0.045**2 * 20e-3, rel=5e-3)
    assert train.mass[place, place] == pytest.approx(0.5 * mass * 0.045**2, rel=5e-3)


@pytest.mark.parametrize("driving", ["sun", "carrier"])
@pytest.mark.parametrize("teeth", [(20, 40, 100), (21, 39, 99)])
def test_torques_press_every_mesh_of_a_set_alike_and_turn_nothing(driving, teeth):
    """What pushes a planet on one side is what it pushes with on the other."""
    counts = dict(zip(("sun_teeth", "planet_teeth", "ring_teeth"), teeth, strict=True))
    pins = {"name": "pins", "planet_stage": 1, "stiffness_n_per_m": 1e8}
    stage = SET | counts | {"driving": driving, "fixed_torsion_nm_per_rad": 1e7}
    train = drive_train(load_machine(operating=POINT, stage=stage, bearing=pins))
    load = train.load({1: 800.0})
    moved = np.linalg.pinv(train.stiffness, rcond=1e-11, hermitian=True) @ load
    forces = [own.stiffness[0, 0] * (own.rows[0] @ moved) for own in train.meshes(1)]
    np.testing.assert_allclose(forces, 6 * [800.0], rtol=1e-6)
    free = train.modes[1][:, 0]
    assert abs(free @ load) < 1e-9 * np.linalg.norm(free) * np.linalg.norm(load)


def test_gears_without_a_place_sit_at_equal_parts_of_their_shaft():
    """One in the middle, two at a third and two thirds."""
    shafts = [
        {"shaft": n, "length_mm": 120.0, "torsional_stiffness_nm_per_rad": 1e5} for n in (1, 2, 3)
    ]
    train = drive_train(load_machine(operating=POINT, stage=[PAIR, PAIR], shaft=shafts))
    places = [
        tuple(float(own) for own in re.search(r"shaft (\d) at (\S+) mm: rotation", name).groups())
        for name in train.coordinates
    ]
    between = sorted(own for own in places if 0 < own[1] < 120)
    assert between == [(1, 60), (2, 40), (2, 80), (3, 60)]


@pytest.mark.parametrize("count", [1, 2])
def test_a_shaft_on_one_bearing_is_said_to_swing(count):
    shaft = {"shaft": 1, "length_mm": 200.0, "diameter_mm": 30.0}
    bearings = [
        {"name": f"b{n}", "shaft": 1, "position_mm": 200.0 * n, "stiffness_n_per_m": 2e8}
        for n in range(count)
    ]
    known = load_machine(operating=POINT, stage=PAIR, shaft=shaft, bearing=bearings)
    train = drive_train(known)
    # turning, and swinging up and down and to the sides
    assert sum(square == 0 for square in train.modes[0]) == (3 if count == 1 else 1)
    said = any("shaft 1 swings freely about its only bearing" in own for own in train.notes)
    assert said == (count == 1)
