"""Families of lines: every line once, coincidences exactly, nothing cut short."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from gearmon.errors import GearmonError
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, group_orders, line_plan


def train(*stages):
    """Kinematics of parallel stages given as pairs, or of stages given as such."""
    made = tuple(
        ParallelStage(pinion_teeth=stage[0], gear_teeth=stage[1])
        if isinstance(stage, tuple)
        else stage
        for stage in stages
    )
    return kinematics(Machine(name="m", operating=(OperatingPoint(speed_rpm=1800.0),), stages=made))


def planetary(sun=20, planet=40, ring=100, planets=3, **changes):
    return PlanetaryStage(
        sun_teeth=sun, planet_teeth=planet, ring_teeth=ring, planets=planets, **changes
    )


def family(plan, kind, stage, harmonic, gear=None):
    """The one family with these properties."""
    (found,) = [
        f
        for f in plan.families
        if (f.kind, f.stage, f.harmonic) == (kind, stage, harmonic) and gear in (None, f.gear)
    ]
    return found


def orders_of(plan, kind, stage, harmonic, gear=None):
    return plan.orders[list(family(plan, kind, stage, harmonic, gear).lines)]


def test_single_pair_has_the_lines_of_the_textbook():
    plan = line_plan(train((23, 61)), 100.0, 0.01)
    assert orders_of(plan, "mesh", 1, 1) == pytest.approx([23.0])
    near = orders_of(plan, "sidebands", 1, 1, "pinion")
    assert near == pytest.approx([17, 18, 19, 20, 21, 22, 24, 25, 26, 27, 28, 29])
    far = orders_of(plan, "residual", 1, 1, "pinion")
    assert far == pytest.approx([*range(12, 17), *range(30, 35)])
    spacing = 23 / 61
    gear = orders_of(plan, "sidebands", 1, 2, "gear")
    expected = [46 + r * spacing for r in range(-6, 7) if r]
    assert gear == pytest.approx(expected)
    assert family(plan, "sidebands", 1, 2, "gear").spacing == pytest.approx(spacing)
    assert family(plan, "sidebands", 1, 2, "gear").shaft == 2


def test_names_say_what_a_family_is():
    plan = line_plan(train((23, 61)), 100.0, 0.01)
    assert family(plan, "mesh", 1, 2).name == "mesh 1 harmonic 2"
    near = family(plan, "sidebands", 1, 1, "pinion")
    assert near.name == "sidebands of shaft 1 around mesh 1 harmonic 1"
    far = family(plan, "residual", 1, 1, "gear")
    assert far.name == "synchronous residual of shaft 2 around mesh 1 harmonic 1"


def test_coinciding_meshes_are_counted_once():
    # 32/96 then 32/80: the third harmonic of mesh 2 is exactly the first of mesh 1
    gears = train((32, 96), (32, 80))
    assert 3 * gears.meshes[1].exact == gears.meshes[0].exact
    plan = line_plan(gears, 70.0, 0.01)
    assert orders_of(plan, "mesh", 1, 1) == pytest.approx([32.0])
    assert sum(np.isclose(plan.orders, 32.0)) == 1
    held = {(f.stage, f.harmonic) for f in plan.families if f.kind == "mesh"}
    assert held == {(1, 1), (1, 2), *((2, k) for k in (1, 2, 4, 5))}


def test_no_family_takes_a_mesh_harmonic_of_another_stage_for_a_sideband():
    plan = line_plan(train((32, 96), (32, 80)), 70.0, 0.01)
    meshes = {32.0, 64.0, *(32 / 3 * k for k in range(1, 9) if 32 / 3 * k < 70)}
    for found in plan.families:
        if found.kind != "mesh":
            inside = plan.orders[list(found.lines)]
            assert not any(np.isclose(inside, order).any() for order in meshes)


def test_lines_of_a_faster_gear_alone_tell_nothing_of_a_tooth():
    # the first stage reaches to higher orders than the second, whose pinion turns thrice as often
    plan = line_plan(train((57, 42), (18, 54)), 1000.0, 0.01)
    wheel = next(own for own in plan.wheels if (own.stage, own.gear) == (2, "gear"))
    assert wheel.number.max() <= 8 * 54 + 27
    assert np.all(np.diff(wheel.number) == 1)


def test_families_cut_by_the_sampling_rate_are_left_out():
    # mesh 2 at 46 lies below 50, its sidebands reach beyond
    plan = line_plan(train((23, 61)), 50.0, 0.01)
    kinds = {(f.kind, f.gear, f.harmonic) for f in plan.families}
    assert ("mesh", "", 2) in kinds
    assert ("sidebands", "pinion", 2) not in kinds
    assert ("residual", "gear", 2) not in kinds
    assert ("sidebands", "gear", 2) in kinds  # 46 + 6 * 0.377 = 48.3
    assert plan.orders.max() < 50.0


def test_gears_that_turn_too_slowly_get_no_sidebands():
    plan = line_plan(train((23, 61)), 100.0, 0.5)
    assert {f.gear for f in plan.families} == {"", "pinion"}
    assert [wheel.gear for wheel in plan.wheels] == ["pinion"]


def test_spacings_are_never_wider_than_half_a_mesh():
    # a pinion with eight teeth: sidebands up to the fourth only, or they would meet the next mesh's
    plan = line_plan(train((8, 42)), 100.0, 0.01)
    near = orders_of(plan, "sidebands", 1, 2, "pinion")
    assert near.min() >= 12.0
    assert near.max() <= 20.0


def test_nothing_below_the_highest_order_is_no_family():
    plan = line_plan(train((23, 61)), 5.0, 0.01)
    assert plan.families == ()


@pytest.mark.parametrize(
    ("ring", "sun", "harmonic", "shifts"),
    [
        # N = 3: McFadden and Smith's k z_r + s divisible by N; neighbours one carrier turn away
        (99, 21, 1, {-1, 0, 1}),
        (100, 20, 1, {-1, 0, 1, 2}),
        (101, 19, 1, {-2, -1, 0, 1}),
        (100, 20, 2, {-2, -1, 0, 1}),
        (100, 20, 3, {-1, 0, 1}),
    ],
)
def test_planetary_groups_hold_the_lines_that_the_planets_leave(ring, sun, harmonic, shifts):
    (mesh,) = train(planetary(sun, (ring - sun) // 2, ring)).meshes
    found = {
        (order - harmonic * mesh.exact) / mesh.carrier for order in group_orders(mesh, harmonic)
    }
    assert found == shifts
    left = {s for s in found if (harmonic * ring + s) % 3 == 0}
    assert left  # at least one line that equal planets do not cancel
    near = {s for s in range(-2, 3) if (harmonic * ring + s) % 3 == 0}
    assert left == near


def test_healthy_lines_of_the_kinematics_lie_in_the_groups():
    (mesh,) = train(planetary(20, 40, 100, 4)).meshes
    for k in range(1, 5):
        group = {float(order) for order in group_orders(mesh, k)}
        nearest = min(mesh.healthy_orders(k, 1), key=lambda order: abs(order - k * mesh.order))
        assert any(np.isclose(nearest, order) for order in group)


def test_parallel_groups_are_the_harmonic_itself():
    (mesh,) = train((23, 61)).meshes
    assert group_orders(mesh, 4) == (Fraction(92),)


def test_carrier_that_stands_still_is_like_a_parallel_stage():
    (mesh,) = train(planetary(fixed="carrier", driving="sun")).meshes
    assert group_orders(mesh, 2) == (2 * mesh.exact,)


def test_wheels_hold_all_multiples_of_their_rotation():
    # half a mesh order about each mesh harmonic; below, shaft lines may be held as well
    plan = line_plan(train((23, 61)), 60.0, 0.01)
    pinion, gear = plan.wheels
    np.testing.assert_array_equal(pinion.number[pinion.number > 3], range(12, 58))
    np.testing.assert_allclose(plan.orders[pinion.lines], pinion.number)
    np.testing.assert_allclose(plan.orders[gear.lines], gear.number * 23 / 61)
    np.testing.assert_array_equal(pinion.number[pinion.mesh], [23, 46])
    np.testing.assert_array_equal(gear.number[gear.mesh], [61, 122])


PAIRS = st.tuples(st.integers(8, 90), st.integers(8, 90))
PARALLEL = st.lists(PAIRS, min_size=1, max_size=3)


def check_plan(gears, top, finest):
    plan = line_plan(gears, top, finest)
    assert np.all(np.diff(plan.orders) > 0)
    assert np.all((plan.orders > 0) & (plan.orders < top))
    uses = Counter(line for found in plan.families for line in found.lines)
    assert all(count == 1 for count in uses.values())
    assert all(found.lines for found in plan.families)
    assert all(0 <= line < len(plan.orders) for line in uses)
    assert len({f.name + f.gear + f"{f.spacing}" for f in plan.families}) == len(plan.families)
    for found in plan.families:
        mesh = gears.mesh(found.stage)
        centre = found.harmonic * mesh.order
        assert 1 <= found.harmonic <= MESH_HARMONICS
        inside = plan.orders[list(found.lines)]
        if found.kind == "mesh":
            allowed = [float(order) for order in group_orders(mesh, found.harmonic)]
            assert np.isclose(inside[:, None], allowed).any(axis=1).all()
            continue
        assert found.spacing >= finest
        steps = (inside - centre) / found.spacing
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
        near = np.abs(np.rint(steps)) <= 6
        assert near.all() if found.kind == "sidebands" else not near.any()
        assert np.abs(inside - centre).max() <= mesh.order / 2 * (1 + 1e-12)
    for wheel in plan.wheels:
        np.testing.assert_allclose(plan.orders[wheel.lines], wheel.number * wheel.order, rtol=1e-9)
        assert len(wheel.mesh) == len(wheel.lines) == len(wheel.number)


@given(PARALLEL, st.floats(1.0, 150.0), st.floats(0.005, 0.5))
def test_plans_of_any_parallel_train_hold_together(pairs, top, finest):
    check_plan(train(*pairs), top, finest)


@given(
    st.integers(12, 40),
    st.integers(12, 40),
    st.integers(3, 4),
    st.sampled_from(["ring", "sun", "carrier"]),
    st.booleans(),
)
def test_plans_with_planetary_sets_hold_together(sun, planet, planets, fixed, first):
    try:
        stage = planetary(sun, planet, sun + 2 * planet, planets, fixed=fixed)
    except GearmonError:  # so many planets do not fit
        reject()
    stages = (stage, (17, 43)) if first else ((43, 17), stage)
    check_plan(train(*stages), 80.0, 0.02)


@given(PARALLEL, st.floats(40.0, 120.0))
def test_higher_rate_adds_families_and_changes_no_mesh(pairs, top):
    gears = train(*pairs)
    low, high = line_plan(gears, top, 0.05), line_plan(gears, 1.5 * top, 0.05)
    held = {f.name for f in low.families if f.kind == "mesh"}
    assert held <= {f.name for f in high.families if f.kind == "mesh"}
