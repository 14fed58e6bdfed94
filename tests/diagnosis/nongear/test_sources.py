"""Lines at multiples of one another have one source; others keep to themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.diagnosis.nongear import Naming
from gearmon.gears.kinematics import kinematics
from gearmon.machine import load_machine
from gearmon.signatures.measured.nongear_lines import NonGearLine, harmonic_sources

WIDTH = 0.005
WIDTHS = {"spectrum": WIDTH, "envelope": WIDTH}


def lines(orders, kind="spectrum", locked="shaft"):
    """Lines at some orders, all alike."""
    return [
        NonGearLine(
            kind=kind,
            order=float(order),
            frequency_hz=25.0 * float(order),
            locked=locked,
            level_db=(0.0,),
            over_noise_db=(30.0,),
            low_order=float(order),
            high_order=float(order),
        )
        for order in orders
    ]


@pytest.mark.parametrize("fundamental", [1.6917, 3.5771, 9.0151])
def test_harmonics_read_to_half_a_width_have_one_source(fundamental):
    generator = np.random.default_rng(3)
    numbers = np.array([1, 2, 3, 5, 6, 8, 11])
    read = fundamental * numbers + generator.uniform(-0.5, 0.5, len(numbers)) * WIDTH
    order = generator.permutation(len(numbers))
    found = harmonic_sources(lines(read[order]), WIDTHS)
    assert [[int(order[i]) for i in group] for group in found] == [list(range(len(numbers)))]


def test_kinds_and_locks_are_held_apart():
    both = lines([4.21, 8.42]) + lines([4.21, 8.42], kind="envelope") + lines([8.42], locked="time")
    assert sorted(map(sorted, harmonic_sources(both, WIDTHS))) == [[0, 1], [2, 3], [4]]


def test_two_series_are_told_apart():
    first, second = 4.2107 * np.arange(1, 6), 5.1313 * np.arange(1, 6)
    found = harmonic_sources(lines(np.concatenate([first, second])), WIDTHS)
    assert sorted(map(sorted, found)) == [[0, 1, 2, 3, 4], [5, 6, 7, 8, 9]]


def test_unrelated_lines_seldom_share_a_source():
    generator = np.random.default_rng(4)
    joined = 0
    for _ in range(200):
        unrelated = lines(generator.uniform(1.0, 60.0, 15))
        joined += len(unrelated) - len(harmonic_sources(unrelated, WIDTHS))
    # each of 15 fundamentals finds a partner by chance with less than 1 %
    assert joined <= 0.01 * 15 * 200


@given(st.lists(st.floats(0.01, 200.0), max_size=40), st.floats(1e-3, 0.1))
def test_every_line_has_one_source(orders, width):
    found = harmonic_sources(lines(orders), {"spectrum": width, "envelope": width})
    assert sorted(i for group in found for i in group) == list(range(len(orders)))
    for group in found:
        assert group[0] == min(group, key=lambda i: (orders[i], group.index(i)))


def test_sidebands_of_a_bearing_are_named_by_their_side():
    """Its inner race at a slip of 1 %, with lines one turn below and above the second harmonic."""
    bearing = {"name": "input", "shaft": 1, "balls": 9, "ball_diameter_mm": 7.94,
               "pitch_diameter_mm": 39.04}  # fmt: skip
    stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
    train = kinematics(load_machine(operating={"speed_rpm": 1500.0}, stage=stage, bearing=bearing))
    (race,) = [line.order for line in train.lines if "inner race" in line.name]
    slipped = 0.99 * race
    heard = lines([slipped, 2 * slipped - 1.0, 2 * slipped, 2 * slipped + 1.0])
    (found,) = Naming(heard, train, WIDTH, 100.0).series()
    assert list(found.labels.values()) == ["1 x", "2 x - 1 x shaft", "2 x", "2 x + 1 x shaft"]
    assert found.slip == pytest.approx(-0.01, abs=1e-6)


def with_bearing():
    """A pair with a bearing, and the order of its outer race."""
    bearing = {"name": "input", "shaft": 1, "balls": 9, "ball_diameter_mm": 7.94,
               "pitch_diameter_mm": 39.04}  # fmt: skip
    stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
    train = kinematics(load_machine(operating={"speed_rpm": 1500.0}, stage=stage, bearing=bearing))
    return train, next(line.order for line in train.lines if "outer race" in line.name)


@pytest.mark.parametrize(
    ("apart", "named"), [(-0.9, True), (0.9, True), (-4.5, False), (4.5, False)]
)
@pytest.mark.parametrize("harmonic", [3, 5])
def test_harmonics_that_tell_a_bearing_agree_on_its_slip_to_a_thousandth_of_their_order(
    apart, named, harmonic
):
    """Where the fundamental itself is not heard."""
    train, race = with_bearing()
    slipped = 0.99 * race
    heard = lines([2 * slipped, harmonic * slipped * (1.0 + 1e-3 * apart)])
    found = Naming(heard, train, 1e-4, 100.0).series()
    assert [one.kind for one in found] == (["bearing"] if named else 2 * ["unknown lines"])
    if named:
        assert found[0].labels == {0: "2 x", 1: f"{harmonic} x"}


@pytest.mark.parametrize("locked", ["shaft", "time", "either"])
def test_knocks_that_scatter_are_one_bearing_however_many_lines_they_show(locked):
    """Once a bearing is told, what stands within 0.8 % of its multiples is its own."""
    train, race = with_bearing()
    slipped = 0.99 * race
    beside = [number * slipped * (1.0 + 1e-3 * e) for number in (1, 2, 5) for e in (-4, -2, 1, 4)]
    heard = lines([slipped, 2 * slipped]) + lines(beside, locked=locked)
    (found,) = Naming(heard, train, 1e-4, 100.0).series()
    assert found.kind == "bearing"
    assert sorted(found.labels) == list(range(len(heard)))
    assert set(found.labels.values()) == {"1 x", "2 x", "5 x"}
    far = lines([slipped, 1.009 * slipped, 0.991 * slipped])
    (own, *others) = Naming(far, train, 1e-4, 100.0).series()
    assert own.labels == {0: "1 x"}
    assert [one.kind for one in others] == ["unknown lines"] * 2


def test_the_mains_are_one_thing_whether_their_lines_surely_stand_still_or_not():
    train, _ = with_bearing()
    heard = lines([4.0, 8.0], locked="time") + lines([12.0, 16.0], locked="either")
    (found,) = Naming(heard, train, WIDTH, 100.0).series()
    assert (found.kind, found.name) == ("electrical", "mains, multiples of 50 Hz")
    assert found.labels == {0: "2 x 50 Hz", 1: "4 x 50 Hz", 2: "6 x 50 Hz", 3: "8 x 50 Hz"}


@pytest.mark.parametrize(("kind", "knocks"), [("spectrum", False), ("envelope", True)])
def test_what_repeats_without_a_name_is_one_thing(kind, knocks):
    """Told by the order at which it repeats; of several about a multiple by their middle."""
    stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
    train = kinematics(load_machine(operating={"speed_rpm": 1500.0}, stage=stage))
    scattered = [4.71 * n * (1 + e) for n in (1, 2, 3, 4) for e in (-4e-3, 0.0, 4e-3)]
    alone = [17.3, 29.9]
    found = Naming(lines([*alone, *scattered], kind=kind), train, 1e-3, 100.0).series()
    assert [one.kind for one in found] == ["unknown lines"] * 3
    assert sorted(found[0].labels) == list(range(2, 14))
    assert found[0].name.startswith("lines at multiples of order 4.71 of shaft 1")
    assert ("knocks of a rolling bearing" in found[0].name) is knocks
    assert [found[0].labels[i] for i in (2, 5, 13)] == ["1 x", "2 x", "4 x"]
    assert {one.name for one in found[1:]} == {
        "unknown line at order 17.3 of shaft 1",
        "unknown line at order 29.9 of shaft 1",
    }


@pytest.mark.parametrize("shaft", [1, 2])
def test_what_is_modulated_by_a_shaft_is_one_thing_with_its_sidebands(shaft):
    """Of an inner race that nobody named, of which one multiple is heard."""
    stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
    train = kinematics(load_machine(operating={"speed_rpm": 1500.0}, stage=stage))
    turn = train.shaft(shaft).order
    beside = [5.43 + turn, 5.43 - turn, 2 * 5.43 - turn, 2 * 5.43 + 2 * turn]
    found, alone = Naming(lines([5.43, *beside, 30.9]), train, 1e-3, 100.0).series()
    told = [
        "1 x",
        *(f"{own} x shaft {shaft}" for own in ("1 x + 1", "1 x - 1", "2 x - 1", "2 x + 2")),
    ]
    assert found.labels == dict(enumerate(told))
    assert found.name.startswith("lines at multiples of order 5.43 of shaft 1")
    assert list(alone.labels) == [5]


@pytest.mark.parametrize("named", [True, False])
def test_knocks_that_do_not_scatter_are_one_thing_far_up(named):
    """Each line tells the order more finely: it is known to half a width of the highest."""
    train, _ = with_bearing()
    (race,) = [line.order for line in train.lines if "inner race" in line.name]
    if not named:
        stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
        train = kinematics(load_machine(operating={"speed_rpm": 1500.0}, stage=stage))
    generator = np.random.default_rng(7)
    read = [0.997 * race * n + r for n in (1, 2, 4, 7, 12, 13, 19, 22, 30, 33) for r in (-1, 0, 2)]
    read = read[1:] + generator.uniform(-0.4, 0.4, len(read) - 1) * WIDTH
    alone = [0.997 * race * 20.31, 0.997 * race * 24.4]
    found, *others = Naming(lines([*read, *alone]), train, WIDTH, 200.0).series()
    assert found.kind == ("bearing" if named else "unknown lines")
    assert sorted(found.labels) == list(range(len(read)))
    by = "shaft" if named else "shaft 1"
    assert [found.labels[i] for i in (0, 28, 27)] == ["1 x", f"33 x + 2 x {by}", "33 x"]
    assert [list(one.labels) for one in others] == [[len(read)], [len(read) + 1]]


def test_knocks_of_an_inner_race_are_one_bearing_with_their_sidebands():
    train, _ = with_bearing()
    (race,) = [line.order for line in train.lines if "inner race" in line.name]
    slipped = 0.99 * race
    spread = [
        slipped * h * (1 + e) + r for h in (1, 2, 3) for r in (-1, 0, 1) for e in (-3e-3, 4e-3)
    ]
    (found,) = Naming(lines([slipped, *spread]), train, 1e-4, 100.0).series()
    assert (found.kind, found.name) == ("bearing", "input: inner race (BPFI)")
    assert sorted(found.labels) == list(range(19))
    assert found.labels[1] == "1 x - 1 x shaft"


def test_unrelated_lines_are_seldom_taken_for_something_that_repeats():
    """One base in a hundred may: of 12 lines each is one that may be tried."""
    train, _ = with_bearing()
    generator = np.random.default_rng(5)
    joined = 0
    for _ in range(200):
        unrelated = lines(generator.uniform(1.0, 60.0, 12))
        joined += bool(Naming(unrelated, train, WIDTH, 100.0).repeating(set(range(12))))
    assert joined <= 0.01 * 12 * 200


@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
def test_a_plant_has_one_mains_frequency(mains_hz):
    """300 and 600 Hz are multiples of both."""
    orders = mains_hz / 25.0 * np.array([1, 2, 3, 4, 6, 8, 10, 12])
    train = kinematics(
        load_machine(
            stage={"kind": "parallel", "pinion_teeth": 20, "gear_teeth": 41},
            operating={"speed_rpm": 1500.0},
        )
    )
    (series,) = Naming(lines(orders, locked="time"), train, WIDTH, 60.0).series()
    assert series.name == f"mains, multiples of {mains_hz:g} Hz"
    assert sorted(series.labels) == list(range(len(orders)))
