"""The integration of geared systems against closed forms and independent solvers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearmon.simulation.integrate import (
    SUBSTEPS,
    GearedSystem,
    March,
    divided_course,
    integrate,
)

MASS, DAMPING, STIFFNESS, FORCE = 0.28, 2.0e3, 4.0e8, 4.0e3
PERIOD = 1.6e-3


def single(damping=DAMPING, force=FORCE, **more):
    """One mesh; p is the deflection times the root of the mass."""
    row = np.array([[1 / math.sqrt(MASS)]])
    none = np.zeros((1, 1))
    return GearedSystem(
        vectors=row,
        stiffness=none,
        damping=none,
        means=np.array([STIFFNESS]),
        dampers=np.array([damping]),
        inputs=force * row,
        **more,
    )


def two_stage(force=4000.0, damping=(1.1e3, 1.9e3, 0.8e3)):
    """Two meshes and the shaft between them."""
    coupling = np.array([[6.8, 0.0, -0.7], [0.0, 3.4, -3.0], [-0.7, -3.0, 3.4]])
    base = np.linalg.cholesky(coupling)
    shaft = np.outer(base[2], base[2])
    return GearedSystem(
        vectors=base[:2],
        stiffness=2.0e8 * shaft,
        damping=damping[2] * shaft,
        means=np.array([5e8, 8e8]),
        dampers=np.array(damping[:2]),
        inputs=force * base.T @ np.array([[1.0], [1.75], [1.75]]),
    )


def constant_course(duration, step=2e-6, stiffness=STIFFNESS, intervals=7):
    return divided_course(
        np.linspace(0, duration, intervals + 1),
        np.full((1, 1, 1, intervals), stiffness),
        np.zeros((1, 1, intervals)),
        np.ones((1, intervals + 1)),
        step,
    )


def parabola_course(periods, step, *, seed=None, ratio=1.6, slow=1.7):
    """Two meshes of different periods, each a sum of parabolas, with pitch deviations."""
    meshes = ((PERIOD, 4.0e8), (PERIOD * slow, 6.0e8))
    end = periods * PERIOD
    events = [np.array([0.0, end])]
    for period, _ in meshes:
        events += [np.arange(place, end, period) for place in (0.0, (ratio % 1) * period)]
    times = np.unique(np.concatenate(events))
    times = times[times <= end]
    generator = np.random.default_rng(seed)
    errors = generator.normal(0, 2e-6, (2, 1000)) if seed is not None else np.zeros((2, 1000))
    before, after = times[:-1], times[1:]
    stiffness = np.zeros((3, 2, 2, len(before)))
    deviation = np.zeros((2, 2, len(before)))
    for m, (period, top) in enumerate(meshes):
        count = np.floor(0.5 * (before + after) / period).astype(int)
        for p in range(2):
            start, width = before / period - count + p, (after - before) / period
            inside = start + 0.5 * width < ratio
            # 1 - q s^2 with s = 2 u / ratio - 1 and u = start + width x
            s0, s1 = 2 * start / ratio - 1, 2 * width / ratio
            stiffness[0, p, m] = inside * top * (1 - 0.45 * s0**2)
            stiffness[1, p, m] = inside * top * (-0.9 * s0 * s1)
            stiffness[2, p, m] = inside * top * (-0.45 * s1**2)
            deviation[p, m] = errors[m, count - p + 10]
    return divided_course(times, stiffness, deviation, np.ones((1, len(times))), step)


def reference_end(system, course, start):
    """Integrate with an adaptive eighth-order method, interval by interval, written plainly."""
    y = start.ravel().copy()
    edges = np.append(course.times_s[:-1][course.start == 0], course.times_s[-1])
    for i in range(len(edges) - 1):
        t0, t1 = edges[i], edges[i + 1]

        def rate(t, y, i=i, t0=t0, t1=t1):
            x = (t - t0) / (t1 - t0)
            p, v = np.split(y, 2)
            g = course.inputs[:, i] + x * (course.inputs[:, i + 1] - course.inputs[:, i])
            a = system.inputs @ g - system.stiffness @ p - system.damping @ v
            for m, row in enumerate(system.vectors):
                elastic = 0.0
                for pair in range(course.stiffness.shape[1]):
                    k = np.polynomial.polynomial.polyval(x, course.stiffness[:, pair, m, i])
                    elastic += k * max(0.0, row @ p - course.deviation[pair, m, i])
                pushed = max(0.0, elastic + system.dampers[m] * (row @ v))
                a -= row * (pushed if elastic > 0 else 0.0)
            return np.concatenate([v, a])

        y = solve_ivp(rate, (t0, t1), y, method="DOP853", rtol=1e-10, atol=1e-14).y[:, -1]
    return y.reshape(2, -1)


def moving(place, speed):
    """State of `single` at a deflection [m] and its rate [m/s]."""
    return math.sqrt(MASS) * np.array([[place], [speed]])


def deflection(result):
    """Deflection [m] of `single` and its rate [m/s] at the end."""
    return result.end_state[:, 0] / math.sqrt(MASS)


def test_constant_stiffness_settles_at_force_over_stiffness():
    start = moving(0.5 * FORCE / STIFFNESS, 0.0)
    result = integrate(single(8e3), constant_course(0.003), run_in=0, start=start)
    assert deflection(result)[0] == pytest.approx(FORCE / STIFFNESS, rel=1e-9)
    assert result.ends_n[0, -1] == pytest.approx(FORCE, rel=1e-6)


def test_free_oscillation_keeps_its_energy_and_phase():
    static, amplitude = FORCE / STIFFNESS, 0.4 * FORCE / STIFFNESS
    omega = math.sqrt(STIFFNESS / MASS)
    duration = 8 * 2 * math.pi / omega
    course = constant_course(duration, step=2 * math.pi / omega / 100)
    start = moving(static + amplitude, 0.0)
    q, v = deflection(integrate(single(0.0), course, run_in=0, start=start, chunks=1))
    energy = (q - static) ** 2 + (v / omega) ** 2
    assert energy == pytest.approx(amplitude**2, rel=1e-5)
    assert q - static == pytest.approx(amplitude, rel=1e-5)
    assert abs(v) < 1e-4 * amplitude * omega


@pytest.mark.parametrize(("force", "seed"), [(4000.0, None), (4000.0, 1), (600.0, 2)])
def test_agrees_with_an_adaptive_solver(force, seed):
    system = two_stage(force)
    course = parabola_course(3, 1.5e-6, seed=seed)
    start = np.stack([system.at_rest, np.zeros(3)])
    result = integrate(system, course, run_in=0, start=start, chunks=1)
    expected = reference_end(system, course, start)
    scale = np.abs(system.at_rest).max()
    assert np.abs(result.end_state[0] - expected[0]).max() < 1e-5 * scale
    assert np.abs(result.end_state[1] - expected[1]).max() < 1e-5 * scale * 6e4
    lost = result.starts_n == 0
    assert lost.any() == (force < 1000)


def test_error_falls_with_the_fourth_power_of_the_step():
    ends = {}
    for step in (8e-6, 4e-6, 2e-6, 0.5e-6):
        course = parabola_course(2, step, seed=1)
        ends[step] = integrate(two_stage(), course, run_in=0, chunks=1).end_state[0]
    errors = [np.abs(ends[step] - ends[0.5e-6]).max() for step in (8e-6, 4e-6, 2e-6)]
    orders = -np.diff(np.log2(errors))
    assert np.all(orders > 3.5)


def test_chunks_side_by_side_give_what_one_gives():
    course = parabola_course(16, 8e-6, seed=1)
    alone = integrate(two_stage(), course, run_in=0, chunks=1)
    whole = alone.impulses_ns / course_lengths(alone)
    for chunks in (3, 30):
        many = integrate(two_stage(), course, run_in=700, chunks=chunks)
        split = many.impulses_ns / course_lengths(many)
        assert many.joint_mismatch < 1e-4
        assert np.abs(split - whole).max() < 2e-3 * np.abs(whole).max()
        assert np.abs(split - whole).std() < 1e-4 * np.abs(whole).max()


def course_lengths(result):
    return np.repeat(np.diff(result.course.times_s) / 8, 8)


def test_short_run_in_is_repaired_at_the_joints():
    course = parabola_course(60, 8e-6, seed=1)
    assert integrate(two_stage(), course, run_in=2, chunks=5).joint_mismatch < 1e-4


def test_what_slow_modes_remember_is_carried_from_joint_to_joint():
    # the mode of the shaft hardly strains the meshes and takes 20 s to die out, the course 0.2 s
    base = two_stage(damping=(1.1e3, 1.9e3, 2.0))
    system = replace(base, stiffness=1e-3 * base.stiffness)
    course = parabola_course(120, 8e-6, seed=1)
    run_in = round(15 / system.decay_rate / course.times_s[-1] * course.pieces)
    assert system.mesh_decay_rate > 50 * system.decay_rate
    assert run_in > 1.5 * course.pieces
    alone = integrate(system, course, run_in=0, chunks=1)
    many = integrate(system, course, run_in=run_in)
    assert many.joint_mismatch < 1.01e-7
    assert np.abs(many.end_state - alone.end_state).max() > 0  # they are chunks
    for one, other in ((many.starts_n, alone.starts_n), (many.impulses_ns, alone.impulses_ns)):
        assert np.abs(one - other).max() < 1e-5 * np.abs(other).max()


def test_periodic_excitation_gives_a_periodic_response():
    system = two_stage(damping=(4e3, 6e3, 4e3))
    # two periods of one mesh are one of the other
    one, two = (
        integrate(system, parabola_course(periods, 6e-6, slow=2.0), run_in=0).end_state[0]
        for periods in (8, 10)
    )
    assert np.abs(two - one).max() < 1e-4 * np.abs(system.at_rest).max()


def test_mesh_never_pulls():
    system, course = single(200.0, -FORCE), constant_course(0.01)
    result = integrate(system, course, run_in=0, start=moving(1e-5, 0.0))
    assert result.starts_n.min() == 0
    # once apart it is in free fall
    assert deflection(result)[1] < -0.9 * FORCE / MASS * 0.0095


def test_opposite_flanks_push_back_beyond_the_backlash():
    # thrown from side to side without loss, the speed at the same place is the same
    system = single(0.0, 0.0, backlash_m=np.array([1e-4]))
    half = math.pi / math.sqrt(STIFFNESS / MASS)
    course = constant_course(2 * half + 2 * 1e-4 / 0.4, step=5e-7)
    result = integrate(system, course, run_in=0, start=moving(-5e-5, 0.4))
    place, speed = deflection(result)
    assert place == pytest.approx(-5e-5, abs=1e-9)
    assert speed == pytest.approx(0.4, rel=1e-5)
    force = result.starts_n[0]
    assert force.min() == pytest.approx(-force.max(), rel=1e-3)


def test_both_flanks_take_as_much_of_a_blow():
    """Thrown from the middle of the backlash to either side, what follows is mirrored."""
    system = single(force=0.0, backlash_m=np.array([1e-4]))
    course = constant_course(3e-4, step=5e-7)
    driving, opposite = (
        deflection(integrate(system, course, run_in=0, start=moving(-5e-5, speed)))
        for speed in (0.4, -0.4)
    )
    assert driving[0] + opposite[0] == pytest.approx(-1e-4, abs=1e-9)
    assert driving[1] == pytest.approx(-opposite[1], rel=1e-6)
    # apart again, and slower by what the damper took
    assert -1e-4 < driving[0] < 0
    assert 0.5 * 0.4 < -driving[1] < 0.9 * 0.4


def test_forces_are_the_stiffness_times_the_deformation_at_the_ends_of_steps():
    start = moving(2e-5, 0.1)
    result = integrate(single(), constant_course(1e-3), run_in=0, start=start, chunks=1)
    assert result.starts_n[0, 0] == pytest.approx(STIFFNESS * 2e-5 + DAMPING * 0.1, rel=1e-6)
    place, speed = deflection(result)
    assert result.ends_n[0, -1] == pytest.approx(STIFFNESS * place + DAMPING * speed, rel=1e-5)


def test_impulse_is_what_changes_the_momentum():
    course = constant_course(1e-3)
    result = integrate(single(), course, run_in=0, start=moving(2e-5, 0.1), chunks=1)
    gained = MASS * (deflection(result)[1] - 0.1)
    assert FORCE * 1e-3 - result.impulses_ns.sum() == pytest.approx(gained, abs=1e-6)


def test_natural_frequency_and_decay_of_one_mesh():
    omega = math.sqrt(STIFFNESS / MASS)
    assert single().natural_frequencies_hz() == pytest.approx([omega / (2 * math.pi)])
    assert single().decay_rate == pytest.approx(DAMPING / (2 * MASS))


def test_a_wheel_between_two_meshes():
    rows = np.array([[1.0], [-1.0]]) / math.sqrt(MASS)
    two = np.ones(2)
    system = GearedSystem(
        vectors=rows,
        stiffness=np.zeros((1, 1)),
        damping=np.zeros((1, 1)),
        means=STIFFNESS * two,
        dampers=500.0 * two,
        inputs=rows.T @ np.array([[300.0], [100.0]]),
    )
    expected = math.sqrt(2 * STIFFNESS / MASS) / (2 * math.pi)
    assert system.natural_frequencies_hz() == pytest.approx([expected])
    assert system.decay_rate == pytest.approx(2 * 500.0 / (2 * MASS))
    assert rows @ system.at_rest == pytest.approx([100.0 / STIFFNESS, -100.0 / STIFFNESS])


def test_slow_modes_of_motion_that_rattles_forget_by_themselves(monkeypatch):
    taken, run = [], March.run

    def counted(march, first, count, *args, **named):
        taken.append(count)
        return run(march, first, count, *args, **named)

    monkeypatch.setattr(March, "run", counted)
    base = two_stage(force=1.0, damping=(1.1e3, 1.9e3, 2.0))
    system = replace(base, stiffness=1e-3 * base.stiffness)
    integrate(system, parabola_course(10, 8e-6, seed=1), run_in=1000)
    assert max(taken[:3]) < 10  # tried without waiting for the slow mode
    assert taken[-3:-1] == [650, 350]  # and then with all of the run-in, coarse and fine


def test_motion_that_rattles_throughout_is_not_tried_again_and_again(monkeypatch):
    runs, run = [], March.run

    def counted(*args, **named):
        runs.append(1)
        return run(*args, **named)

    monkeypatch.setattr(March, "run", counted)
    # pitch deviations of 2 um over a static deflection of 2 nm
    course = parabola_course(40, 8e-6, seed=1)
    result = integrate(two_stage(force=1.0), course, run_in=100, chunks=20)
    assert result.joint_mismatch > 1e-3
    assert len(runs) <= 3 + 2  # run-in by coarse and fine steps, the record, two passes


def test_irregular_motion_is_faded_so_that_the_force_stays_continuous(monkeypatch):
    # hardly damped and left after one pass, chunks do not join by themselves
    monkeypatch.setattr("gearmon.simulation.integrate.REPAIR_PASSES", 1)
    course = parabola_course(12, 4e-6, seed=1)
    result = integrate(two_stage(damping=(20.0, 20.0, 20.0)), course, run_in=5, chunks=7)
    assert result.joint_mismatch > 1e-3
    chunk = -(-course.pieces // 7) * SUBSTEPS
    jumps = np.abs(result.starts_n[:, chunk::chunk] - result.ends_n[:, chunk - 1 : -1 : chunk])
    assert jumps.shape == (2, 6)
    assert jumps.max() < 1e-3 * result.ends_n.max()


@pytest.mark.parametrize("seed", range(3))
def test_inputs_that_change_within_a_piece_are_met_where_they_are(seed):
    """Loads drawn anew at every event, straight between: as an adaptive solver has them."""
    system, course = two_stage(), parabola_course(2, 1.5e-6, seed=seed)
    loads = np.random.default_rng(seed).uniform(0.5, 1.5, course.inputs.shape)
    course = replace(course, inputs=loads)
    start = np.stack([system.at_rest, np.zeros(3)])
    found = integrate(system, course, run_in=0, start=start, chunks=1).end_state
    expected = reference_end(system, course, start)
    scale = np.abs(system.at_rest).max() * np.array([[1.0], [6e4]])
    assert np.abs((found - expected) / scale).max() < 1e-5


def test_modes_that_strain_one_mesh_decay_with_its_damper():
    assert single().mesh_decay_rate == pytest.approx(DAMPING / (2 * MASS))
    assert single().mesh_decay_rate == pytest.approx(single().decay_rate)


def test_chunks_within_the_run_in_begin_with_the_start_that_is_given():
    """Then all of them ring from one blow and nothing is left to repair at their joints."""
    system, start = single(50.0), moving(2e-5, 0.3)
    course = constant_course(2e-3)
    one = integrate(system, course, run_in=0, start=start, chunks=1)
    several = integrate(system, course, run_in=course.pieces, start=start, chunks=4)
    assert several.joint_mismatch < 1e-2
    assert deflection(several) == pytest.approx(deflection(one), rel=1e-3)
