"""The integration of geared systems against closed forms and independent solvers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearmon.simulation.integrate import SUBSTEPS, GearedSystem, divided_course, integrate

MASS, DAMPING, STIFFNESS, FORCE = 0.28, 2.0e3, 4.0e8, 4.0e3
PERIOD = 1.6e-3


def single(damping=DAMPING):
    return GearedSystem(
        coupling=np.array([[1 / MASS]]),
        damping=np.array([damping]),
        shaft_stiffness=np.zeros(0),
    )


def two_stage():
    """Two meshes and the shaft between them."""
    return GearedSystem(
        coupling=np.array([[6.8, 0.0, -0.7], [0.0, 3.4, -3.0], [-0.7, -3.0, 3.4]]),
        damping=np.array([1.1e3, 1.9e3, 0.8e3]),
        shaft_stiffness=np.array([2.0e8]),
    )


def constant_course(duration, force=FORCE, step=2e-6, stiffness=STIFFNESS, intervals=7):
    return divided_course(
        np.linspace(0, duration, intervals + 1),
        np.full((1, 1, 1, intervals), stiffness),
        np.zeros((1, 1, intervals)),
        np.full((1, intervals + 1), force / MASS),
        step,
    )


def parabola_course(forces, periods, step, *, seed=None, ratio=1.6, slow=1.7):
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
    forcing = np.repeat(forces[:, None], len(times), axis=1)
    return divided_course(times, stiffness, deviation, forcing, step)


def reference_end(system, course, start):
    """Integrate with an adaptive eighth-order method, interval by interval, written plainly."""
    meshes, size = system.meshes, system.elements
    y = start.ravel().copy()
    edges = np.append(course.times_s[:-1][course.start == 0], course.times_s[-1])
    for i in range(len(edges) - 1):
        t0, t1 = edges[i], edges[i + 1]

        def rate(t, y, i=i, t0=t0, t1=t1):
            x = (t - t0) / (t1 - t0)
            q, v = y[:size], y[size:]
            s = system.damping * v
            s[meshes:] += system.shaft_stiffness * q[meshes:]
            for m in range(meshes):
                elastic = 0.0
                for p in range(course.stiffness.shape[1]):
                    k = np.polynomial.polynomial.polyval(x, course.stiffness[:, p, m, i])
                    elastic += k * max(0.0, q[m] - course.deviation[p, m, i])
                s[m] = max(0.0, elastic + s[m]) if elastic > 0 else 0.0
            g = course.forcing[:, i] + x * (course.forcing[:, i + 1] - course.forcing[:, i])
            return np.concatenate([v, g - system.coupling @ s])

        y = solve_ivp(rate, (t0, t1), y, method="DOP853", rtol=1e-10, atol=1e-14).y[:, -1]
    return y.reshape(2, size)


def test_constant_stiffness_settles_at_force_over_stiffness():
    result = integrate(
        single(8e3), constant_course(0.003), np.array([0.5 * FORCE / STIFFNESS]), run_in=0
    )
    assert result.end_state[0, 0] == pytest.approx(FORCE / STIFFNESS, rel=1e-9)
    assert result.ends_n[0, -1] == pytest.approx(FORCE, rel=1e-6)


def test_free_oscillation_keeps_its_energy_and_phase():
    deflection, amplitude = FORCE / STIFFNESS, 0.4 * FORCE / STIFFNESS
    omega = math.sqrt(STIFFNESS / MASS)
    duration = 8 * 2 * math.pi / omega
    start = np.array([[deflection + amplitude], [0.0]])
    course = constant_course(duration, step=2 * math.pi / omega / 100)
    result = integrate(single(0.0), course, np.array([deflection]), run_in=0, start=start, chunks=1)
    q, v = result.end_state[:, 0]
    energy = (q - deflection) ** 2 + (v / omega) ** 2
    assert energy == pytest.approx(amplitude**2, rel=1e-5)
    assert q - deflection == pytest.approx(amplitude, rel=1e-5)
    assert abs(v) < 1e-4 * amplitude * omega


@pytest.mark.parametrize(("force", "seed"), [(4000.0, None), (4000.0, 1), (600.0, 2)])
def test_agrees_with_an_adaptive_solver(force, seed):
    system = two_stage()
    loads = np.array([force, 1.8 * force, 1.8 * force])
    course = parabola_course(system.coupling @ loads, 3, 1.5e-6, seed=seed)
    static = system.static_deformation(system.coupling @ loads, np.array([5e8, 8e8]))
    start = np.stack([static, np.zeros(3)])
    result = integrate(system, course, static, run_in=0, start=start, chunks=1)
    expected = reference_end(system, course, start)
    scale = np.abs(static).max()
    assert np.abs(result.end_state[0] - expected[0]).max() < 1e-5 * scale
    assert np.abs(result.end_state[1] - expected[1]).max() < 1e-5 * scale * 6e4
    lost = result.starts_n == 0
    assert lost.any() == (force < 1000)


def test_error_falls_with_the_fourth_power_of_the_step():
    system = two_stage()
    forcing = system.coupling @ np.array([4000.0, 7000.0, 7000.0])
    static = system.static_deformation(forcing, np.array([5e8, 8e8]))
    start = np.stack([static, np.zeros(3)])
    ends = {}
    for step in (8e-6, 4e-6, 2e-6, 0.5e-6):
        course = parabola_course(forcing, 2, step, seed=1)
        ends[step] = integrate(system, course, static, run_in=0, start=start, chunks=1).end_state[0]
    errors = [np.abs(ends[step] - ends[0.5e-6]).max() for step in (8e-6, 4e-6, 2e-6)]
    orders = -np.diff(np.log2(errors))
    assert np.all(orders > 3.5)


def test_chunks_side_by_side_give_what_one_gives():
    system = two_stage()
    forcing = system.coupling @ np.array([4000.0, 7000.0, 7000.0])
    static = system.static_deformation(forcing, np.array([5e8, 8e8]))
    course = parabola_course(forcing, 16, 8e-6, seed=1)
    alone = integrate(system, course, static, run_in=0, chunks=1)
    whole = alone.impulses_ns / course_lengths(alone)
    for chunks in (3, 30):
        many = integrate(system, course, static, run_in=700, chunks=chunks)
        split = many.impulses_ns / course_lengths(many)
        assert many.joint_mismatch < 1e-4
        assert np.abs(split - whole).max() < 2e-3 * np.abs(whole).max()
        assert np.abs(split - whole).std() < 1e-4 * np.abs(whole).max()


def course_lengths(result):
    return np.repeat(np.diff(result.course.times_s) / 8, 8)


def test_short_run_in_is_repaired_at_the_joints():
    system = two_stage()
    forcing = system.coupling @ np.array([4000.0, 7000.0, 7000.0])
    static = system.static_deformation(forcing, np.array([5e8, 8e8]))
    course = parabola_course(forcing, 60, 8e-6, seed=1)
    assert integrate(system, course, static, run_in=2, chunks=5).joint_mismatch < 1e-4


def test_periodic_excitation_gives_a_periodic_response():
    system = replace(two_stage(), damping=np.array([4e3, 6e3, 4e3]))
    forcing = system.coupling @ np.array([4000.0, 7000.0, 7000.0])
    static = system.static_deformation(forcing, np.array([5e8, 8e8]))
    # two periods of one mesh are one of the other
    ends = []
    for periods in (8, 10):
        course = parabola_course(forcing, periods, 6e-6, slow=2.0)
        ends.append(integrate(system, course, static, run_in=0).end_state)
    assert np.abs(ends[1][0] - ends[0][0]).max() < 1e-4 * np.abs(static).max()


def test_mesh_never_pulls():
    system = single(200.0)
    course = constant_course(0.01, force=-FORCE)
    start = np.array([[1e-5], [0.0]])
    result = integrate(system, course, np.array([1e-5]), run_in=0, start=start)
    assert result.starts_n.min() == 0
    # once apart it is in free fall
    assert result.end_state[1, 0] < -0.9 * FORCE / MASS * 0.0095


def test_opposite_flanks_push_back_beyond_the_backlash():
    # thrown from side to side without loss, the speed at the same place is the same
    system = replace(single(0.0), backlash_m=np.array([1e-4]), back_stiffness=np.array([STIFFNESS]))
    start = np.array([[-5e-5], [0.4]])
    half = math.pi / math.sqrt(STIFFNESS / MASS)
    period = 2 * half + 2 * 1e-4 / 0.4
    course = constant_course(period, force=0.0, step=5e-7)
    result = integrate(system, course, np.array([1e-5]), run_in=0, start=start)
    assert result.end_state[0, 0] == pytest.approx(-5e-5, abs=1e-9)
    assert result.end_state[1, 0] == pytest.approx(0.4, rel=1e-5)
    force = result.starts_n[0]
    assert force.min() == pytest.approx(-force.max(), rel=1e-3)


def test_forces_are_the_stiffness_times_the_deformation_at_the_ends_of_steps():
    start = np.array([[2e-5], [0.1]])
    result = integrate(
        single(), constant_course(1e-3), np.array([1e-5]), run_in=0, start=start, chunks=1
    )
    assert result.starts_n[0, 0] == pytest.approx(STIFFNESS * 2e-5 + DAMPING * 0.1, rel=1e-6)
    assert result.ends_n[0, -1] == pytest.approx(
        STIFFNESS * result.end_state[0, 0] + DAMPING * result.end_state[1, 0], rel=1e-5
    )


def test_impulse_is_what_changes_the_momentum():
    start = np.array([[2e-5], [0.1]])
    course = constant_course(1e-3)
    result = integrate(single(), course, np.array([1e-5]), run_in=0, start=start, chunks=1)
    total = result.impulses_ns.sum()
    assert FORCE * 1e-3 - total == pytest.approx(MASS * (result.end_state[1, 0] - 0.1), abs=1e-6)


def test_natural_frequency_and_decay_of_one_mesh():
    system = single()
    omega = math.sqrt(STIFFNESS / MASS)
    found = system.natural_frequencies_hz(np.array([STIFFNESS]))
    assert found == pytest.approx([omega / (2 * math.pi)])
    assert system.decay_rate(np.array([STIFFNESS])) == pytest.approx(DAMPING / (2 * MASS))


def test_elements_that_share_their_coordinates_have_one_frequency_less():
    # a wheel between two meshes: one coordinate, two deformations
    rows = np.array([[1.0], [-1.0]])
    system = GearedSystem(
        coupling=rows @ rows.T / MASS, damping=np.full(2, 500.0), shaft_stiffness=np.zeros(0)
    )
    stiffness = np.full(2, STIFFNESS)
    expected = math.sqrt(2 * STIFFNESS / MASS) / (2 * math.pi)
    assert system.natural_frequencies_hz(stiffness) == pytest.approx([expected])
    assert system.decay_rate(stiffness) == pytest.approx(2 * 500.0 / (2 * MASS))
    forcing = system.coupling @ np.array([300.0, 100.0])
    static = system.static_deformation(forcing, stiffness)
    assert static == pytest.approx([100.0 / STIFFNESS, -100.0 / STIFFNESS])


def test_irregular_motion_is_faded_so_that_the_force_stays_continuous(monkeypatch):
    # hardly damped and left after one pass, chunks do not join by themselves
    monkeypatch.setattr("gearmon.simulation.integrate.REPAIR_PASSES", 1)
    system = replace(two_stage(), damping=np.array([20.0, 20.0, 20.0]))
    forcing = system.coupling @ np.array([4000.0, 7000.0, 7000.0])
    static = system.static_deformation(forcing, np.array([5e8, 8e8]))
    course = parabola_course(forcing, 12, 4e-6, seed=1)
    result = integrate(system, course, static, run_in=5, chunks=7)
    assert result.joint_mismatch > 1e-3
    chunk = -(-course.pieces // 7) * SUBSTEPS
    jumps = np.abs(result.starts_n[:, chunk::chunk] - result.ends_n[:, chunk - 1 : -1 : chunk])
    assert jumps.shape == (2, 6)
    assert jumps.max() < 1e-3 * result.ends_n.max()
