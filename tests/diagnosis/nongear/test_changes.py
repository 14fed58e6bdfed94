"""What is new and no gear's: named by its lines, never called on healthy machines."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.nongear_cases import SPEED_HZ, bearing_order, heard, impacts, train
from reference.small_gearbox import machine as small_machine
from reference.small_gearbox import recording, reference
from scipy.special import stdtrit

from gearmon.diagnosis.nongear import (
    PRIOR_CHANGE_DB,
    PRIOR_WORTH,
    LineComparison,
    Naming,
    NonGearFinding,
    disturbed,
    family_gain_db,
    nongear_findings,
)
from gearmon.gears.kinematics import kinematics
from gearmon.machine import load_machine
from gearmon.signatures.measured.measurement import measure_signature
from gearmon.signatures.measured.nongear_lines import NoiseGrid, NonGearLine, NonGearLines
from gearmon.signatures.measured.reference import Profile

BELOW = 0.01
CHANNELS, NOISE_DB, LEAST_DB = 2, -60.0, 12.0


def flagged(new, healthy, **given):
    found = LineComparison(new, healthy, train(), **given).findings()
    return [one for one in found if one.false_alarm_probability < BELOW]


@pytest.fixture(scope="module")
def healthy():
    """Two recordings of a sound machine at two loads, with lines of its own."""
    own = {"orders": (7.61, 40.37), "tones_hz": (333.0,)}
    return [heard(seed, load=load, **own) for seed, load in ((100, 0.85), (101, 1.1))]


def test_other_healthy_recordings_are_not_flagged(healthy):
    own = {"orders": (7.61, 40.37), "tones_hz": (333.0,)}
    cases = (
        {"load": 0.8},
        {"load": 1.2, "speed_hz": 1.02 * SPEED_HZ},
        {"noise": 0.05},
        {"noise": 0.3, "speed_hz": 0.98 * SPEED_HZ},
    )
    for seed, case in enumerate(cases):
        assert flagged(heard(seed, **own, **case), healthy) == [], case


def test_gain_is_taken_off(healthy):
    own = {"orders": (7.61, 40.37), "tones_hz": (333.0,)}
    louder = heard(1, **own, gain=4.0)
    assert flagged(louder, healthy, gain_db=np.full(2, 20 * np.log10(4.0))) == []


def test_bearing_is_named_by_its_slipping_lines(healthy):
    ring = 0.988 * bearing_order("BPFO")
    found = flagged(heard(1, orders=(7.61, 40.37, ring, 2 * ring), level=0.05), healthy)
    assert [one.kind for one in found] == ["bearing"]
    assert found[0].name == "input: outer race (BPFO)"
    assert len(found[0].lines) == 2
    assert "1 x" in found[0].evidence[0] or "1 x" in found[0].evidence[1]
    assert "is in no healthy recording" in found[0].evidence[0]
    # the clearest line first, and its change is that of the finding
    told = [float(re.search(r"(\S+) dB over what could", own)[1]) for own in found[0].evidence]
    assert told == sorted(told, reverse=True)
    assert found[0].change_db == pytest.approx(max(told), abs=0.06)
    json.dumps(found[0].to_dict(), allow_nan=False)


def test_impacts_of_a_bearing_are_named(healthy):
    own = {"orders": (7.61, 40.37), "tones_hz": (333.0,)}
    found = flagged(heard(1, **own, added=impacts("BPFO", 0.7)), healthy)
    assert found[0].kind == "bearing"
    assert "BPFO" in found[0].name
    assert found[0].lines[0].kind == "envelope"
    assert all(one.kind == "bearing" for one in found)


def test_a_line_of_the_shaft_is_not_a_tone_that_stood_at_its_frequency():
    """At a lower speed, so at another order."""
    place, slower = 40.37, {"wander": 0.01, "speed_hz": 0.93 * SPEED_HZ}
    new = heard(1, orders=(place,), wander=0.01)
    assert [line.locked for line in new] == ["shaft"]
    assert len(flagged(new, [heard(100, tones_hz=(place * SPEED_HZ,), **slower)])) == 1
    assert flagged(new, [heard(100, orders=(place,), **slower)]) == []


@pytest.mark.parametrize("wander", [0.0, 0.005])
@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_mains_are_electrical(healthy, mains, wander):
    new = heard(1, tones_hz=(2 * mains, 333.0), orders=(7.61, 40.37), wander=wander)
    found = flagged(new, healthy)
    assert [one.kind for one in found] == ["electrical"]
    assert f"{mains:g} Hz" in found[0].name


@pytest.mark.parametrize("wander", [0.0, 0.005])
def test_mains_that_stood_under_a_line_of_a_gear_are_not_new(wander):
    """At 150 Hz stood the thirteenth harmonic of the second shaft; now it turns faster."""
    speed_hz = 150.0 / (13 * float(train().shafts[1].order))
    loud, found = {"level": 0.1, "wander": wander}, {}
    new = heard(1, tones_hz=(150.0,), **loud)
    for tones_hz in ((150.0,), ()):
        hidden = {"tones_hz": tones_hz, "speed_hz": speed_hz, "level": 0.1, "wander": 0.0}
        known = [heard(seed, **hidden) for seed in (100, 101)]
        near = [line for own in known for line in own if abs(line.frequency_hz - 150.0) < 1.0]
        assert near == []
        found[tones_hz] = [one.kind for one in flagged(new, known)]
    assert found == {(150.0,): [], (): ["electrical"]}


def test_half_orders_are_looseness(healthy):
    new = heard(1, orders=(0.5, 1.5, 2.5, 3.5, 7.61, 40.37))
    found = flagged(new, healthy)
    assert [one.kind for one in found] == ["looseness"]
    assert found[0].name == "half orders of shaft 1"


def test_what_has_no_name_is_unknown(healthy):
    found = flagged(heard(1, orders=(16.9, 7.61, 40.37), tones_hz=(777.0, 333.0)), healthy)
    assert {one.kind for one in found} == {"unknown lines"}
    names = " ".join(one.name for one in found)
    assert "order 16.9" in names
    assert "777 Hz" in names


def test_a_line_that_grew_is_told_with_its_rise(healthy):
    found = flagged(heard(1, orders=(7.61, 40.37), level=[1.0, 0.05]), healthy)
    assert len(found) == 1
    assert found[0].change_db == pytest.approx(26.0, abs=2.0)
    assert "rose 2" in found[0].evidence[0]
    quieter = heard(1, orders=(7.61, 40.37), level=[0.05, 0.02])
    assert flagged(quieter, healthy) == []


def test_gears_changes_are_no_foreign_lines(healthy):
    # another machine of the same make: its shafts, meshes and sidebands have other levels
    for seed in (1, 2):
        assert flagged(heard(seed, machine_seed=7, load=3.0, orders=(7.61, 40.37)), healthy) == []


def test_disturbed_orders_hold_seen_and_hidden_lines(healthy):
    ring = 0.988 * bearing_order("BPFO")
    found = flagged(heard(1, orders=(7.61, 40.37, ring, 2 * ring), level=0.05), healthy)
    orders = np.array([ring, 2 * ring, 3 * ring, 4 * ring, 1.0, 11.28])
    assert disturbed(orders, found, 0.02).tolist() == [True] * 4 + [False] * 2
    assert not disturbed(orders, (), 0.02).any()


def found_lines(*lines):
    """What is found where these lines are new."""
    return NonGearFinding(
        kind="unknown lines",
        name="unknown line",
        lines=lines,
        change_db=20.0,
        orders=(),
        width=0.005,
        log10_probability=-4.0,
        evidence=(),
    )


@given(order=st.floats(0.1, 100.0), resolution=st.floats(1e-3, 1.0), smear=st.floats(0.0, 0.02))
def test_orders_near_a_line_are_disturbed(order, resolution, smear):
    line = NonGearLine(
        kind="spectrum",
        order=order,
        frequency_hz=order,
        locked="time",
        level_db=(0.0,),
        over_noise_db=(20.0,),
        low_order=order * (1 - smear),
        high_order=order * (1 + smear),
    )
    grid = np.array([order, order + 0.9 * resolution, order * (1 + smear) + 1.1 * resolution])
    assert disturbed(grid, [found_lines(line)], resolution).tolist() == [True, True, False]


def test_lines_of_the_envelope_disturb_nothing():
    beats = [x for x in heard(2, added=impacts("BPFO", 0.5)) if x.kind == "envelope"]
    assert beats
    orders = np.array([line.order for line in beats])
    assert not disturbed(orders, [found_lines(*beats)], 1.0).any()


def listed(orders, level_db, over_db):
    """Lines as if they had been heard, in noise that hides nothing else."""
    lines = tuple(
        NonGearLine(
            kind="spectrum",
            order=order,
            frequency_hz=25.0 * order,
            locked="shaft",
            level_db=(level,) * CHANNELS,
            over_noise_db=(over,) * CHANNELS,
            low_order=order,
            high_order=order,
        )
        for order, level, over in zip(orders, level_db, over_db, strict=True)
    )
    return NonGearLines(
        lines=lines, grids=even_grids(), speed_hz=25.0, cell_hz=1.25, in_time_db=EVEN_CELLS
    )


def test_what_hunts_is_a_gears_but_what_repeats_beside_it_is_not():
    """A line at a multiple of the turn in which two teeth meet again, alone and in a series."""
    stage = {"kind": "parallel", "pinion_teeth": 33, "gear_teeth": 69}
    pair = kinematics(load_machine(operating={"speed_rpm": 1500.0}, stage=stage))
    hunting = 1 / 23
    # the base is 82 such turns and a third of the width at which it would be one; the others are
    # farther off
    repeats = [(82 * hunting + 0.0008) * n for n in (1, 4, 5, 6, 7)]
    nothing = [listed([], [], [])] * 2

    def told(*orders):
        new = listed(orders, [-20.0] * len(orders), [40.0] * len(orders))
        return LineComparison(new, nothing, pair).findings()

    assert told(82 * hunting) == told(82 * hunting, 91 * hunting) == ()
    (found,) = told(*repeats)
    assert found.kind == "unknown lines"
    assert len(found.lines) == 5
    (alone,) = told(82.4 * hunting)
    assert alone.lines[0].order == pytest.approx(82.4 * hunting)


EVEN_CELLS = np.full((CHANNELS, 800), NOISE_DB, dtype=np.float32)


@cache
def even_grids():
    return tuple(
        NoiseGrid(
            kind=kind,
            width=0.005,
            top=100.0,
            pieces=1,
            least_db=LEAST_DB,
            looked_at=6e4,
            noise_db=np.full((CHANNELS, 4), NOISE_DB),
            hidden_db=np.full((CHANNELS, 4), NOISE_DB, dtype=np.float32),
        )
        for kind in ("spectrum", "envelope")
    )


def scatters(generator, references, shape):
    """Levels as the prior has them: machines differ in how much theirs move."""
    variance = PRIOR_CHANGE_DB**2 * PRIOR_WORTH / generator.chisquare(PRIOR_WORTH)
    return generator.normal(scale=np.sqrt(variance / 2), size=(references + 1, *shape))


@pytest.mark.parametrize("references", [1, 3])
def test_false_alarms_come_as_often_as_stated(references):
    generator = np.random.default_rng(11 + references)
    pairs, lines, alarms = 1000, 10, 0
    orders = np.linspace(5.07, 90.33, lines)
    for _ in range(pairs):
        over = generator.uniform(30.0, 50.0, lines)
        moved = scatters(generator, references, (lines,))
        new, *before = (listed(orders, NOISE_DB + over + m, over + m) for m in moved)
        alarms += bool(flagged(new, before))
    assert 0.005 * pairs <= alarms <= 0.02 * pairs


def test_false_alarms_of_sources_with_harmonics_come_as_often_as_stated():
    generator = np.random.default_rng(17)
    pairs, alarms = 800, 0
    harmonics = np.arange(1, 5)
    orders = np.concatenate([harmonics * f for f in (5.072, 6.118, 7.341, 8.657, 10.329)])
    source = np.repeat(np.arange(5), len(harmonics))
    for _ in range(pairs):
        over = generator.uniform(30.0, 50.0, len(orders))
        # a quarter of the variance is every line's own
        both = scatters(generator, 1, (5 + len(orders),))
        moved = np.sqrt(0.75) * both[:, source] + np.sqrt(0.25) * both[:, 5:]
        new, before = (listed(orders, NOISE_DB + over + m, over + m) for m in moved)
        alarms += bool(flagged(new, [before]))
    assert 0.003 * pairs <= alarms <= 0.02 * pairs


def test_sources_that_come_out_of_the_noise_alarm_no_more_often_than_stated():
    generator = np.random.default_rng(23)
    pairs, alarms = 1000, 0
    orders = np.array([11.37, 17.61])
    for _ in range(pairs):
        # both just hidden in the reference
        over = LEAST_DB + np.diff(scatters(generator, 1, (2,)), axis=0)[0]
        seen = over > LEAST_DB
        new = listed(orders[seen], NOISE_DB + over[seen], over[seen])
        alarms += bool(flagged(new, [listed([], [], [])]))
    assert alarms <= 0.02 * pairs


def test_harmonics_are_fewer_chances_than_unrelated_lines():
    harmonics = 5.07 * np.arange(1, 9)
    odd = 5.07 * np.sqrt(np.arange(1, 9) ** 2 + 0.7)
    risen = np.array([16.0] + [0.0] * 7)
    found = []
    for others in (harmonics, odd):
        over = np.full(8, 40.0)
        before = listed(others, NOISE_DB + over, over)
        new = listed(others, NOISE_DB + over + risen, over + risen)
        found.append(LineComparison(new, [before], train()).findings()[0].log10_probability)
    # with two hidden ones
    assert found[1] - found[0] == pytest.approx(np.log10((8 + 2) / (8**0.7 + 2)), abs=0.01)


def test_lines_that_only_other_channels_hear_are_no_chances_of_a_rise():
    over = np.array([40.0])
    new = listed([5.07], NOISE_DB + over + 16.0, over + 16.0)
    found = []
    for others in (0, 30):
        odd = 7.31 + 1.77 * np.sqrt(np.arange(others))
        levels = np.concatenate([over, np.full(others, -50.0)])
        before = listed([5.07, *odd], NOISE_DB + levels, levels)
        found.append(LineComparison(new, [before], train()).findings()[0].log10_probability)
    assert found[1] == pytest.approx(found[0], abs=1e-3)


@pytest.mark.parametrize("lines", [2, 4, 8, 16])
def test_chances_of_lines_that_have_three_quarters_in_common(lines):
    generator = np.random.default_rng(29)
    common, own = generator.normal(size=(50_000, 1)), generator.normal(size=(50_000, lines))
    scale = np.sqrt(15 / generator.chisquare(15, size=(50_000, 1)))
    alike = (scale * (np.sqrt(0.75) * common + np.sqrt(0.25) * own)).max(axis=1)
    # where one line in a thousand stands
    limit = stdtrit(15, 0.999)
    assert lines**0.7 == pytest.approx(np.mean(alike > limit) / 1e-3, rel=0.25)


def test_noise_alone_never_alarms_above_the_stated_probability():
    generator = np.random.default_rng(5)
    alarms = 0
    for _ in range(600):
        # the highest of as many exponential powers as were looked at
        highest = -np.log(-np.log(generator.uniform()) / 6e4)
        over = 10 * np.log10(highest)
        new = listed([33.33], [NOISE_DB + over], [over]) if over > LEAST_DB else listed([], [], [])
        alarms += bool(flagged(new, [listed([], [], [])]))
    assert alarms <= 0.02 * 600


def test_a_series_needs_more_than_chance():
    lines = listed([2 * 0.99 * bearing_order("BPFI"), 1.5], [-20.0] * 2, [30.0] * 2).lines
    assert {one.kind for one in Naming(lines, train(), 0.005, 100.0).series()} == {"unknown lines"}


def test_every_line_stands_in_one_series():
    generator = np.random.default_rng(8)
    orders = np.sort(generator.uniform(0.3, 90.0, 40))
    lines = listed(orders, [-20.0] * 40, [30.0] * 40).lines
    series = Naming(lines, train(), 0.005, 100.0).series()
    assert sorted(i for one in series for i in one.labels) == list(range(40))


def test_measured_signatures_compare_with_a_reference():
    train_ = kinematics(small_machine())
    base = recording(load=0.9)
    healthy = measure_signature(base, small_machine())
    assert [
        one
        for one in nongear_findings(Profile.of(healthy), reference(), train_)
        if one.false_alarm_probability < BELOW
    ] == []
    gains = family_gain_db(Profile.of(healthy), reference())
    assert np.abs(gains).max() < 3.0
    own, known = Profile.of(healthy), reference()
    lost = np.arange(len(known.family_names)) % 3 > 0  # families that one healthy one hardly hears
    names = [name for name, gone in zip(known.family_names, lost, strict=True) if gone]
    first = known.profiles[0]
    faint = np.isin(first.family_names, names)
    first = replace(
        first, heard=first.heard & ~faint, level_db=np.where(faint, -300.0, first.level_db)
    )
    known = replace(known, profiles=(first, *known.profiles[1:]))
    assert np.abs(family_gain_db(own, known)).max() < 3.0
    time_s = np.arange(base.samples.shape[-1]) / base.sampling_rate_hz
    samples = base.samples.copy()
    samples[:2] += 0.2 * samples[:2].std() * np.cos(2 * np.pi * 100.0 * time_s)
    humming = measure_signature(replace(base, samples=samples), small_machine())
    found = nongear_findings(Profile.of(humming), reference(), train_)
    assert found[0].kind == "electrical"
    assert found[0].false_alarm_probability < BELOW


def beside(ratio, seed, size=0.05):
    """Mesh harmonics of a gearbox of the same kind that turns at a speed of its own."""
    orders = np.array([k * mesh.order for mesh in train().meshes for k in (1, 2, 3, 4)])
    phases = np.random.default_rng([5, seed]).uniform(0, 6.28, orders.size)

    def added(_time_s, turns, _generator):
        return size * sum(
            np.cos(2 * np.pi * ratio * order * turns + phase)
            for order, phase in zip(orders, phases, strict=True)
        )

    return added


def test_a_gearbox_of_the_same_kind_beside_it_may_turn_at_any_speed():
    known = [heard(20 + n, added=beside(ratio, n)) for n, ratio in enumerate((0.983, 1.021))]
    for seed, ratio in enumerate((1.012, 0.975, 1.034)):
        assert flagged(heard(30 + seed, added=beside(ratio, 9)), known) == [], ratio


def test_one_that_was_never_heard_before_and_one_that_grew_are_told(healthy):
    assert flagged(heard(40, added=beside(1.012, 9, size=0.3)), healthy)
    known = [heard(20 + n, added=beside(ratio, n)) for n, ratio in enumerate((0.983, 1.021))]
    assert flagged(heard(41, added=beside(1.012, 9, size=0.8)), known)


def test_beside_a_neighbour_a_bearing_is_still_told():
    known = [heard(20 + n, added=beside(ratio, n)) for n, ratio in enumerate((0.983, 1.021))]
    order = bearing_order("outer race")

    def both(time_s, turns, generator):
        waves = [np.cos(2 * np.pi * k * 0.99 * order * turns + k) for k in range(1, 6)]
        return beside(1.012, 9)(time_s, turns, generator) + 0.05 * np.sum(waves, axis=0)

    found = flagged(heard(42, added=both), known)
    assert [one.kind for one in found][:1] == ["bearing"]
