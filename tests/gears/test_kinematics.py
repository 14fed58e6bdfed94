"""Orders of shafts, meshes and bearings against published figures, laws and slow versions."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics, line_table, planetary_speeds
from gearmon.machine import Bearing, Machine, OperatingPoint, ParallelStage, PlanetaryStage

TEETH = st.integers(5, 300)
ROLES = list(permutations(("sun", "ring", "carrier"), 2))  # fixed, driving


def machine(*stages, speed_rpm=1800.0, bearings=()):
    point = OperatingPoint(speed_rpm=speed_rpm)
    return Machine(name="box", operating=(point,), stages=stages, bearings=bearings)


def pair(pinion, gear):
    return ParallelStage(pinion_teeth=pinion, gear_teeth=gear)


def planetary(sun=20, planet=40, ring=100, planets=4, **roles):
    return PlanetaryStage(
        sun_teeth=sun, planet_teeth=planet, ring_teeth=ring, planets=planets, **roles
    )


@st.composite
def planetary_stages(draw):
    sun, planet = draw(st.integers(10, 80)), draw(st.integers(10, 80))
    planets = draw(st.integers(1, 5))
    assume((sun + planet) * math.sin(math.pi / max(planets, 2)) > planet + 2)
    fixed, driving = draw(st.sampled_from(ROLES))
    ring = sun + 2 * planet + draw(st.integers(-3, 3))
    return planetary(sun, planet, ring, planets, fixed=fixed, driving=driving)


stages = st.one_of(st.builds(pair, TEETH, TEETH), planetary_stages())


# --- published figures


def test_eight_and_forty_two_teeth():
    """Golden: 20 Hz in gives 3.8095 (output), 80 (assembly phase) and 160 Hz (mesh)."""
    table = line_table(machine(pair(8, 42), speed_rpm=1200.0))
    frequencies = [(row["kind"], row["shaft"], round(row["frequency_hz"], 4)) for row in table.rows]
    assert frequencies == [
        ("shaft", 1, 20.0),
        ("shaft", 2, 3.8095),
        ("mesh", None, 160.0),
        ("assembly phase", None, 80.0),
        ("hunting tooth", None, 0.9524),
    ]


def test_planetary_simulator():
    """Sun 20, ring 100: ratio 6, mesh at 100/6 orders, 500 Hz at 1800 rpm."""
    train = kinematics(machine(planetary()))
    assert train.shaft(2).exact == Fraction(1, 6)
    assert train.mesh(1).exact == Fraction(100, 6)
    rows = {row["name"]: row["frequency_hz"] for row in line_table(machine(planetary())).rows}
    assert rows["20/40/100"] == 500.0
    # local fault rates N f_m / z_s, 2 f_m / z_p, N f_m / z_r
    assert rows["sun fault"] == 4 * 500 / 20
    assert rows["planet fault"] == 2 * 500 / 40
    assert rows["ring fault"] == 4 * 500 / 100
    assert rows["planet pass"] == 4 * 5.0


def test_two_stage_simulator():
    train = kinematics(machine(pair(32, 96), pair(32, 80)))
    assert [shaft.exact for shaft in train.shafts] == [1, Fraction(1, 3), Fraction(2, 15)]
    assert [mesh.exact for mesh in train.meshes] == [32, Fraction(32, 3)]
    assert [shaft.name for shaft in train.shafts] == ["input", "intermediate", "output"]
    assert train.coincidences() == (((1, 1), (2, 3)),)


def test_speed_increasing_stage():
    train = kinematics(machine(pair(60, 20)))
    assert train.shaft(2).exact == 3
    assert train.mesh(1).exact == 60
    assert [w.shaft for w in train.mesh(1).wheels] == [1, 2]


@pytest.mark.parametrize(
    ("ring", "planets", "orders"),
    [
        (99, 3, [96, 99, 102]),
        (100, 3, [96, 99, 102, 105]),
        (101, 3, [96, 99, 102, 105]),
    ],
)
def test_sidebands_of_a_healthy_planetary_set(ring, planets, orders):
    """McFadden and Smith 1985: with a fixed ring only multiples of N carrier turns remain."""
    sun = next(s for s in range(20, 40) if (s + ring) % planets == 0 and (ring - s) % 2 == 0)
    stage = planetary(sun, (ring - sun) // 2, ring, planets)
    mesh = kinematics(machine(stage)).mesh(1)
    seen = [order / float(mesh.carrier) for order in mesh.healthy_orders(1)]
    assert set(orders) <= {round(order) for order in seen}
    assert all(round(order) % planets == 0 for order in seen)
    assert seen == pytest.approx(np.round(seen), abs=1e-9)


def test_bearing_of_a_motor_test_rig():
    """SKF 6205-2RS as published with its test rig: 3.5848, 5.4152, 4.7135/2, 0.39828 orders."""
    bearing = Bearing(
        name="drive end", shaft=1, balls=9, ball_diameter_mm=7.94004, pitch_diameter_mm=39.0398
    )
    lines = kinematics(machine(pair(23, 57), bearings=(bearing,))).lines
    orders = {line.name.partition("(")[2]: line.order for line in lines if line.kind == "bearing"}
    assert orders["BPFO)"] == pytest.approx(3.5848, abs=2e-4)
    assert orders["BPFI)"] == pytest.approx(5.4152, abs=2e-4)
    # the published cage and outer-race figures, 0.39828 and 3.5848 / 9, differ by 3e-5
    assert orders["FTF)"] == pytest.approx(0.39828, abs=5e-5)
    assert orders["BSF)"] == pytest.approx(4.7135 / 2, abs=2e-4)


# --- laws


@given(teeth=st.tuples(TEETH, TEETH))
def test_parallel_identities(teeth):
    mesh = kinematics(machine(pair(*teeth))).mesh(1)
    lines = {line.kind: line.exact for line in kinematics(machine(pair(*teeth))).lines}
    common = math.gcd(*teeth)
    assert lines["assembly phase"] * common == mesh.exact
    assert lines["hunting tooth"] == mesh.exact * common / (teeth[0] * teeth[1])
    # the hunting tooth is the slowest: every other line of the pair is a multiple of it
    multiples = [lines[kind] / lines["hunting tooth"] for kind in ("assembly phase", "shaft")]
    assert all(ratio.denominator == 1 for ratio in multiples)


@given(train=st.lists(stages, min_size=1, max_size=4))
def test_every_wheel_passes_its_teeth_at_the_mesh_order(train):
    for mesh in kinematics(machine(*train)).meshes:
        assert {wheel.teeth * wheel.exact_relative for wheel in mesh.wheels} == {mesh.exact}


@given(train=st.lists(stages, min_size=1, max_size=4))
def test_orders_multiply_along_the_train(train):
    """Each stage alone, its input at order 1, gives a factor of the whole."""
    orders = [shaft.exact for shaft in kinematics(machine(*train)).shafts]
    alone = [kinematics(machine(stage)).shaft(2).exact for stage in train]
    assert orders[-1] == math.prod(alone)
    assert all(order > 0 for order in orders)


@given(stage=planetary_stages())
def test_planetary_speeds_agree_with_linear_equations(stage):
    """Slow version: rolling without slip at both meshes, the fixed and the driving member."""
    members = ("sun", "planet", "ring", "carrier")
    zs, zp, zr = stage.sun_teeth, stage.planet_teeth, stage.ring_teeth
    equations = np.array(
        [
            [zs, zp, 0, -(zs + zp)],  # external mesh, relative to the carrier
            [0, -zp, zr, zp - zr],  # internal mesh
            [float(member == stage.fixed) for member in members],
            [float(member == stage.driving) for member in members],
        ]
    )
    expected = np.linalg.solve(equations, [0, 0, 0, 1])
    speeds = planetary_speeds(stage)
    assert [float(speeds[member]) for member in members] == pytest.approx(expected, abs=1e-12)


@given(stage=planetary_stages())
def test_planetary_set_driven_backwards_is_the_inverse(stage):
    backwards = planetary(
        stage.sun_teeth,
        stage.planet_teeth,
        stage.ring_teeth,
        stage.planets,
        fixed=stage.fixed,
        driving=stage.driven,
    )
    there = planetary_speeds(stage)[stage.driven]
    back = planetary_speeds(backwards)[stage.driving]
    assert there * back == 1


@given(train=st.lists(stages, min_size=1, max_size=4))
def test_lines_are_positive_and_floats_are_their_fractions(train):
    for line in kinematics(machine(*train)).lines:
        assert line.exact > 0
        assert line.order == float(line.exact)


@given(stage=planetary_stages())
def test_planetary_modulations_name_members_and_shafts(stage):
    mesh = kinematics(machine(stage)).mesh(1)
    by_name = {m.name: m for m in mesh.modulations}
    assert by_name["sun fault"].exact == stage.planets * mesh.exact / stage.sun_teeth
    assert by_name["planet fault"].exact == 2 * mesh.exact / stage.planet_teeth
    assert by_name["ring fault"].exact == stage.planets * mesh.exact / stage.ring_teeth
    turning = {m.gear: m.shaft for m in mesh.modulations if m.shaft is not None}
    assert turning == {stage.driving: 1, stage.driven: 2}
    assert ("planet pass" in by_name) == (stage.fixed != "carrier")


# --- slow version: N planets pass a sensor on the housing


def passing_planets(stage, turns, samples):
    """Return what a sensor at angle 0 sees: each planet's ring mesh, weighted by nearness."""
    speeds = {name: float(speed) for name, speed in planetary_speeds(stage).items()}
    t = np.arange(samples) * turns / samples
    total = np.zeros(samples)
    for planet in range(stage.planets):
        angle = speeds["carrier"] * t + planet / stage.planets
        near = np.exp(3 * np.cos(2 * np.pi * angle))
        total += near * np.cos(2 * np.pi * stage.ring_teeth * (angle - speeds["ring"] * t))
    return np.abs(np.fft.rfft(total)) / samples


@pytest.mark.parametrize(
    "stage",
    [
        planetary(20, 40, 100, 4),
        planetary(19, 41, 101, 3),
        planetary(18, 27, 72, 3, driving="carrier"),
        planetary(19, 41, 101, 3, fixed="sun", driving="carrier"),
        planetary(19, 41, 101, 3, fixed="sun", driving="ring"),
    ],
)
def test_healthy_orders_are_what_a_sensor_sees(stage):
    turns = (
        planetary_speeds(stage)["carrier"].denominator * planetary_speeds(stage)["ring"].denominator
    )
    spectrum = passing_planets(stage, turns, 2 ** int(np.ceil(np.log2(turns * 600))))
    mesh = kinematics(machine(stage)).mesh(1)
    near = 2 * stage.planets * float(abs(mesh.carrier)) + 1e-9
    orders = np.arange(spectrum.size) / turns
    present = (spectrum > 1e-6 * spectrum.max()) & (abs(orders - mesh.order) <= near)
    assert mesh.healthy_orders(1) == pytest.approx(list(orders[present]), abs=1e-9)


def test_stationary_carrier_and_parallel_stages_show_the_mesh_alone():
    star = kinematics(machine(planetary(fixed="carrier"))).mesh(1)
    assert star.healthy_orders(2) == (2 * star.order,)
    assert kinematics(machine(pair(8, 42))).mesh(1).healthy_orders(3) == (24.0,)


def test_unequally_spaced_planets_cancel_nothing():
    mesh = kinematics(machine(planetary(22, 40, 102, 3))).mesh(1)
    step = float(mesh.carrier)
    expected = [mesh.order + s * step for s in (-2, -1, 0, 1, 2)]
    assert mesh.healthy_orders(1) == pytest.approx(expected)


def test_lines_below_zero_are_heard_at_as_many_turns_above_it():
    mesh = kinematics(machine(planetary(20, 40, 100, 4))).mesh(1)
    seen = np.array(mesh.healthy_orders(1, reach=60)) / float(abs(mesh.carrier))
    shifts = [s for s in range(-240, 241) if (100 + s) % 4 == 0]
    np.testing.assert_allclose(seen, sorted(abs(100 + s) for s in shifts), atol=1e-9)


# --- bearings


@given(
    balls=st.integers(5, 12),
    ball=st.floats(1, 10),
    angle=st.floats(0, 60),
    rotating=st.sampled_from(("inner", "outer")),
)
def test_bearing_identities(balls, ball, angle, rotating):
    bearing = Bearing(
        name="b",
        shaft=2,
        balls=balls,
        ball_diameter_mm=ball,
        pitch_diameter_mm=50,
        contact_angle_deg=angle,
        rotating=rotating,
    )
    train = kinematics(machine(pair(20, 40), bearings=(bearing,)))
    cage, spin, outer, inner = (line.order for line in train.lines if line.kind == "bearing")
    shaft = train.shaft(2).order
    assert outer + inner == pytest.approx(balls * shaft)
    # the outer race is passed by balls with the cage's speed relative to it
    assert outer == pytest.approx(balls * (cage if rotating == "inner" else shaft - cage))
    assert 0 < spin < inner * 50 / ball


def test_planet_bearing_turns_with_the_planet_relative_to_its_pin():
    bearing = Bearing(
        name="pin", planet_stage=1, balls=18, ball_diameter_mm=8, pitch_diameter_mm=54
    )
    train = kinematics(machine(planetary(), bearings=(bearing,)))
    orders = [line.order for line in train.lines if line.kind == "bearing"]
    assert orders[2] + orders[3] == pytest.approx(18 * train.mesh(1).wheel("planet").relative_order)


# --- table


def test_table_has_every_operating_point_and_is_ready_for_json():
    points = (
        OperatingPoint(speed_rpm=1000.0, share=0.5, name="slow"),
        OperatingPoint(speed_rpm=2000.0, share=0.5),
    )
    box = Machine(name="box", operating=points, stages=(pair(32, 96), pair(32, 80)))
    table = line_table(box)
    count = len(kinematics(box).lines)
    slow, fast = table.rows[:count], table.rows[count:]
    assert {row["operating"] for row in slow} == {"slow"}
    assert {row["operating"] for row in fast} == {"2000 rpm"}
    assert [2 * row["frequency_hz"] for row in slow] == [row["frequency_hz"] for row in fast]
    read_back = json.loads(json.dumps(table.to_dict()))
    assert read_back["rows"][0]["frequency_hz"] == pytest.approx(1000 / 60)
    assert "mesh harmonic 1 of stage 1 is exactly mesh harmonic 3 of stage 2" in table.notes[0]


def test_table_of_one_operating_point():
    table = line_table(machine(pair(8, 42), speed_rpm=60.0))
    assert [row["frequency_hz"] for row in table.rows] == [row["order"] for row in table.rows]


@pytest.mark.parametrize("number", [0, 3])
def test_no_such_shaft(number):
    train = kinematics(machine(pair(8, 42)))
    with pytest.raises(ArgumentError, match=rf"shaft={number} must lie in \[1, 2\]"):
        train.shaft(number)


def test_no_such_gear():
    mesh = kinematics(machine(pair(8, 42))).mesh(1)
    with pytest.raises(ArgumentError, match="gear of stage 1: 'sun' is not one of pinion, gear"):
        mesh.wheel("sun")


def test_no_such_harmonic():
    mesh = kinematics(machine(pair(8, 42))).mesh(1)
    with pytest.raises(ArgumentError, match="harmonic=0"):
        mesh.healthy_orders(0)


@given(train=st.lists(st.builds(pair, TEETH, TEETH), min_size=2, max_size=3))
def test_coincidences_are_exact(train):
    box = kinematics(machine(*train))
    for (stage, harmonic), (other, another) in box.coincidences(100):
        assert harmonic * box.mesh(stage).exact == another * box.mesh(other).exact
