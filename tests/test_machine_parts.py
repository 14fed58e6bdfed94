"""The parts of a machine built in Python obey the rules of the machine file."""

from __future__ import annotations

import inspect
import math
import pickle
import re
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.machine import (
    Bearing,
    Disc,
    FieldError,
    Machine,
    OperatingPoint,
    ParallelStage,
    PlanetaryStage,
    Sensor,
    ShaftSection,
)
from gearmon.machine.fields import Number, shown_value

POINT = OperatingPoint(speed_rpm=1200.0)
PAIR = ParallelStage(pinion_teeth=8, gear_teeth=42)
KINDS = (OperatingPoint, Bearing, ShaftSection, Disc, Sensor, ParallelStage, PlanetaryStage)
# endings of keys, longer ones first
UNITS = {
    "_nm_per_rad": "Nm/rad",
    "_ns_per_m": "Ns/m",
    "_n_per_m": "N/m",
    "_kgm2": "kg m2",
    "_kgm3": "kg/m3",
    "_nm2": "N m2",
    "_rpm": "rpm",
    "_deg": "deg",
    "_pa": "Pa",
    "_kg": "kg",
    "_mm": "mm",
    "_nm": "Nm",
    "_n": "N",
}


def ranges(kind):
    """Keys that hold numbers, with their rules."""
    rules = {own.name: own.metadata.get("rule") for own in fields(kind)}
    return {name: rule for name, rule in rules.items() if isinstance(rule, Number)}


@pytest.mark.parametrize("kind", KINDS)
def test_a_range_is_told_in_the_unit_that_ends_its_key(kind):
    for name, rule in ranges(kind).items():
        unit = next((unit for ending, unit in UNITS.items() if name.endswith(ending)), "")
        assert (name, rule.unit) == (name, unit)


@pytest.mark.parametrize("kind", KINDS)
def test_a_number_is_held_to_its_range_by_both_ends(kind):
    for name, rule in ranges(kind).items():
        assert rule.low < rule.high, name
        for end, beyond, is_open in (
            (rule.low, -math.inf, rule.open_low),
            (rule.high, math.inf, rule.open_high),
        ):
            inside = (rule.low + rule.high) / 2
            whole = type(rule) is not Number
            step = -1 if beyond < 0 else 1
            outside = int(end) + step if whole else math.nextafter(end, beyond)
            allowed = [int(end)] if whole else [end, math.nextafter(end, inside)][is_open:]
            for value in allowed:
                assert rule.checked(name, value) == value
            for value in [outside, *([end] if is_open else [])]:
                with pytest.raises(FieldError, match=re.escape(f"{name} = {value} must lie in ")):
                    rule.checked(name, value)


NUMBER = r"(-?[\d.]+)"
TOLD = {
    rf"{NUMBER} to {NUMBER}": (False, False),
    rf"{NUMBER} to below {NUMBER}": (False, True),
    rf"above {NUMBER} and up to {NUMBER}": (True, False),
    rf"above {NUMBER} and below {NUMBER}": (True, True),
    rf"above {NUMBER}": (True, False),
    rf"{NUMBER} or more": (False, False),
}


def test_ranges_are_those_that_docstrings_tell():
    found = set()
    for kind in KINDS:
        entries = re.findall(r"^([\w, ]+) : (?:int|float), (.*)$", inspect.getdoc(kind), re.M)
        for names, told in entries:
            told = re.sub(r", optional|optional, |^optional$", "", told)
            if not told:
                continue
            match, opened = next(
                (m, o) for own, o in TOLD.items() if (m := re.fullmatch(own, told))
            )
            for name in names.split(", "):
                rule = ranges(kind)[name]
                ends = [rule.low, rule.high][: len(match.groups())]
                assert (name, ends) == (name, [float(own) for own in match.groups()])
                assert (name, rule.open_low, rule.open_high) == (name, *opened)
                found.add(name)
    assert len(found) >= 12


def test_numpy_numbers_are_numbers():
    stage = ParallelStage(
        pinion_teeth=np.int64(26), gear_teeth=np.int32(53), module_mm=np.float32(2)
    )
    assert type(stage.pinion_teeth) is int
    assert type(stage.module_mm) is float


@pytest.mark.parametrize("value", [True, 26.0, "26", None, np.float64(26), [26], math.nan])
def test_teeth_are_whole_numbers(value):
    with pytest.raises(FieldError, match=r"pinion_teeth = .* must be a whole number"):
        ParallelStage(pinion_teeth=value, gear_teeth=53)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("face_width_mm", 0.0),
        ("poisson_ratio", 0.5),
        ("density_kgm3", 7.85),
        ("elastic_modulus_gear_pa", 206.0),
        ("damping_ratio", 0.0),
        ("stiffness_variation", 1.0),
        ("mesh_stiffness_n_per_m", 20.0),
        ("profile_shift_pinion", 5.0),
    ],
)
def test_out_of_range_names_key_and_value(key, value):
    with pytest.raises(ArgumentError, match=rf"^{key} = {value} must lie in "):
        ParallelStage(pinion_teeth=26, gear_teeth=53, **{key: value})


def test_helical_gears_may_have_a_transverse_contact_ratio_below_one():
    stage = ParallelStage(pinion_teeth=20, gear_teeth=60, helix_angle_deg=30, contact_ratio=0.95)
    assert stage.contact_ratio == 0.95


def test_profile_shifted_centre_distance_is_accepted():
    # 26/53 teeth of module 2 at a working pressure angle of 23.834 degrees
    stage = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, centre_distance_mm=81.157)
    assert stage.centre_distance_mm == 81.157


def test_transverse_pressure_angle():
    stage = ParallelStage(pinion_teeth=20, gear_teeth=30, helix_angle_deg=15)
    # tan 20 / cos 15 = 0.376808
    assert math.degrees(stage.transverse_pressure_angle_rad) == pytest.approx(20.6469, abs=1e-4)


@pytest.mark.parametrize(
    ("fixed", "driving", "driven"),
    [
        ("ring", "sun", "carrier"),
        ("carrier", "sun", "ring"),
        ("sun", "carrier", "ring"),
    ],
)
def test_driving_member_by_default(fixed, driving, driven):
    stage = PlanetaryStage(sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, fixed=fixed)
    assert (stage.driving, stage.driven) == (driving, driven)


@given(
    sun=st.integers(12, 100),
    planet=st.integers(12, 100),
    deviation=st.integers(-3, 3),
    planets=st.integers(3, 6),
)
def test_planets_fit_when_their_tips_are_clear(sun, planet, deviation, planets):
    """Every set that can be built passes, and notes appear exactly where the teeth are unusual."""
    if (sun + planet) * math.sin(math.pi / planets) <= planet + 2:
        return
    ring = sun + 2 * planet + deviation
    stage = PlanetaryStage(sun_teeth=sun, planet_teeth=planet, ring_teeth=ring, planets=planets)
    assert stage.tooth_deviation == deviation
    assert stage.equally_spaced == ((sun + ring) % planets == 0)
    assert len(stage.notes) == (deviation != 0) + (not stage.equally_spaced)


@given(sun=st.integers(5, 100), planet=st.integers(5, 100), planets=st.integers(1, 8))
def test_planets_overlap_where_their_circles_drawn_round_the_sun_do(sun, planet, planets):
    radius, turns = (sun + planet) / 2, np.arange(planets) / planets
    centres = radius * np.exp(2j * np.pi * turns)
    apart = np.abs(centres[:, None] - centres)[~np.eye(planets, dtype=bool)].min(initial=np.inf)
    known = {"sun_teeth": sun, "planet_teeth": planet, "ring_teeth": sun + 2 * planet}
    if apart > planet * (1 + 1e-9):
        assert PlanetaryStage(**known, planets=planets).planets == planets
    elif apart < planet * (1 - 1e-9):
        with pytest.raises(FieldError, match=rf"planets = {planets} is more than fits"):
            PlanetaryStage(**known, planets=planets)


def test_planets_may_touch_with_shortened_tips_but_not_overlap():
    # distance of neighbouring planet axes: 58 sin 45 deg = 41.01 and 56 sin 45 deg = 39.6 modules
    stage = PlanetaryStage(sun_teeth=18, planet_teeth=40, ring_teeth=98, planets=4)
    assert stage.planets == 4
    with pytest.raises(FieldError, match="planets = 4 is more than fits"):
        PlanetaryStage(sun_teeth=16, planet_teeth=40, ring_teeth=96, planets=4)


@pytest.mark.parametrize(("excess", "accepted"), [(5e-7, True), (5e-6, False)])
def test_shares_sum_to_one_within_a_millionth(excess, accepted):
    points = [OperatingPoint(speed_rpm=900, share=share) for share in (0.5 + excess, 0.5)]
    if accepted:
        assert len(Machine(operating=points, stages=[PAIR]).operating) == 2
    else:
        with pytest.raises(FieldError, match="must sum to 1"):
            Machine(operating=points, stages=[PAIR])


def test_planet_bearing_turns_with_its_outer_ring():
    bearing = Bearing(
        name="pin", planet_stage=1, balls=18, ball_diameter_mm=8, pitch_diameter_mm=54
    )
    assert bearing.rotating == "outer"


def test_machine_needs_parts():
    with pytest.raises(FieldError, match="operating must hold at least one"):
        Machine(operating=(), stages=(PAIR,))


def test_machine_needs_stages():
    with pytest.raises(FieldError, match="stage is given 0 times"):
        Machine(operating=(POINT,), stages=())


def test_shares_must_sum_to_one():
    with pytest.raises(FieldError, match="the sum is 2"):
        Machine(operating=(POINT, POINT), stages=(PAIR,))


def test_lists_become_tuples():
    machine = Machine(operating=[POINT], stages=[PAIR])
    assert machine.stages == (PAIR,)
    assert hash(machine) == hash(Machine(operating=(POINT,), stages=(PAIR,)))


@pytest.mark.parametrize("balls", [3, 4, 7, 12, 40])
def test_as_many_balls_fit_as_touch_on_the_pitch_circle(balls):
    """n balls that touch have their centres d = D sin(pi/n) apart."""
    touching = 50.0 * math.sin(math.pi / balls)
    known = {"name": "left", "shaft": 1, "balls": balls, "pitch_diameter_mm": 50.0}
    assert Bearing(**known, ball_diameter_mm=touching).balls == balls
    with pytest.raises(FieldError, match=rf"balls = {balls} must lie in \[1, {balls - 1}\]"):
        Bearing(**known, ball_diameter_mm=1.005 * touching)


def test_sensor_column_of_white_space():
    with pytest.raises(FieldError, match="must be a column name"):
        Sensor(column="  ")


def test_errors_cross_process_borders():
    with pytest.raises(FieldError) as caught:
        ParallelStage(pinion_teeth=2, gear_teeth=53)
    copy = pickle.loads(pickle.dumps(caught.value))
    assert (str(copy), copy.key, copy.value) == (str(caught.value), "pinion_teeth", 2)
    bare = pickle.loads(pickle.dumps(FieldError("shaft", "must be given")))
    assert str(bare) == "shaft must be given"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        ("it's", '"it\'s"'),
        ("two\nlines", '"two\\nlines"'),
        ("x" * 100, '"' + "x" * 56 + "..."),
        (-2.5, "-2.5"),
    ],
)
def test_values_are_shown_on_one_short_line(value, text):
    assert shown_value(value) == text


PAIR_MM = {"pinion_teeth": 26, "gear_teeth": 53, "module_mm": 2.0}
SET_MM = {"sun_teeth": 20, "planet_teeth": 40, "ring_teeth": 100, "planets": 3, "module_mm": 2.0}


@pytest.mark.parametrize("shift", [-0.5, 0.5])
def test_a_tip_lies_beyond_the_root_that_the_shift_raises(shift):
    root = 26 * 2.0 - 2 * 2.0 * (1.25 - shift)
    own = PAIR_MM | {"profile_shift_pinion": shift, "face_width_mm": 20.0}
    ParallelStage(**own, tip_diameter_pinion_mm=max(root + 0.1, 48.0))
    with pytest.raises(FieldError, match=r"beyond the root|must lie in \[48, 68\]"):
        ParallelStage(**own, tip_diameter_pinion_mm=root - 0.1)


@pytest.mark.parametrize(
    ("data", "match"),
    [
        ({"tip_diameter_pinion_mm": 156.0}, r"tip_diameter_pinion_mm = 156.0 must lie in \[48, 68"),
        ({"root_diameter_gear_mm": 10.1}, r"root_diameter_gear_mm = 10.1 must lie in \[90, 110"),
        (
            {"tip_diameter_pinion_mm": 50.0, "root_diameter_pinion_mm": 51.0},
            r"must lie in \(51, 50000\) mm: beyond the root",
        ),
        ({"web_width_gear_mm": 10.0}, "give rim_thickness_gear_mm too"),
        ({"rim_thickness_pinion_mm": 4.0}, "give web_width_pinion_mm too"),
        (
            {"web_width_gear_mm": 10.0, "rim_thickness_gear_mm": 60.0},
            r"must lie in \[0, 50\.5\) mm: from the root",
        ),
        ({"application_factor": 0.8}, r"application_factor = 0.8 must lie in \[1, 10\]"),
        ({"tip_shortening": 1.0}, r"tip_shortening = 1.0 must lie in \[-1, 0.5\]"),
        ({"bore_diameter_pinion_mm": 47.0}, r"must lie in \[0, 47\) mm: less than the root"),
    ],
)
def test_bodies_and_diameters_that_cannot_be(data, match):
    with pytest.raises(FieldError, match=match):
        ParallelStage(**PAIR_MM, **data)


def test_ring_has_its_tips_inside_its_roots():
    stage = PlanetaryStage(**SET_MM, tip_diameter_ring_mm=196.4, rim_thickness_ring_mm=9.0)
    assert stage.tip_diameter_ring_mm == 196.4
    with pytest.raises(FieldError, match=r"must lie in \(0, 202\) mm: beyond the root"):
        PlanetaryStage(**SET_MM, tip_diameter_ring_mm=195.0 + 8, root_diameter_ring_mm=202.0)


def test_what_sits_on_a_shaft_lies_within_the_length_of_that_shaft():
    """Sections of a shaft add up to its length; those of another are no part of it."""
    lengths = ((1, 60.0), (1, 90.0), (2, 40.0))
    sections = tuple(
        ShaftSection(shaft=shaft, length_mm=length, diameter_mm=30.0) for shaft, length in lengths
    )

    def built(shaft, position):
        seat = Bearing(name="seat", shaft=shaft, position_mm=position, stiffness_n_per_m=1e8)
        parts = {"operating": (POINT,), "stages": (PAIR,), "sections": sections}
        return Machine(name="m", bearings=(seat,), **parts)

    for shaft, length in ((1, 150.0), (2, 40.0)):
        assert built(shaft, length).bearings[0].position_mm == length
        told = rf"must lie in \[0, {length:g}\] mm: the length of shaft {shaft}"
        with pytest.raises(FieldError, match=told):
            built(shaft, length + 1.0)
