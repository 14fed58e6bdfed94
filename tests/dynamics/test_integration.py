"""Time integration against exact and certified answers, with and without contact loss."""

import math

import numpy as np
import pytest
from reference.hill_cases import random_problem, scaled_problem
from scipy.linalg import expm

from gearmon.dynamics import HillProblem, steady_state
from gearmon.dynamics.integration import Integrator, settle, shoot, transient
from gearmon.dynamics.piecewise import PiecewiseProblem, multipliers, solve_exactly
from gearmon.dynamics.time_marching import fourier_sum
from gearmon.errors import ArgumentError

MASS, STIFFNESS, FORCE = 0.28, 8e8, 4e3
FINE = Integrator(solver="DOP853", relative_tolerance=1e-12, absolute_tolerance=1e-14)


def rectangle(damping=9e3, period=1.6e-3, variation=0.13, duty=0.412):
    return PiecewiseProblem.rectangular(MASS, damping, STIFFNESS, variation, duty, period, FORCE)


def relative(found, exact):
    return np.linalg.norm(found - exact) / np.linalg.norm(exact)


@pytest.mark.parametrize("solver", ["RK23", "RK45", "DOP853", "LSODA", "Radau", "BDF"])
def test_every_solver_settles_on_the_certified_answer(solver):
    p = HillProblem(MASS, 9e3, STIFFNESS, [0.065, 0.01j, 0.02], 4e-4, FORCE)
    exact = steady_state(p, 1e-10, harmonics=8)
    found = settle(p, 8, 1e-5, integrator=Integrator(solver, 1e-6, 1e-8))
    assert relative(found.acceleration, exact.acceleration) < 3e-4
    assert found.stable
    assert found.method == f"integration ({solver})"


@pytest.mark.parametrize("solver", ["RK45", "DOP853", "LSODA", "Radau"])
def test_jumps_do_not_spoil_the_order(solver):
    p = rectangle()
    exact = solve_exactly(p, 30)
    errors = []
    for tolerance in (1e-5, 1e-8):
        found = shoot(p, 30, Integrator(solver, tolerance, tolerance / 100))
        errors.append(relative(found.acceleration, exact.acceleration))
    assert errors[1] < 5e-7
    assert errors[1] < errors[0] / 50


@pytest.mark.parametrize("seed", range(6))
def test_shooting_matches_the_exact_pieces(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    shares = rng.dirichlet(np.full(count, 3.0)) + 0.02
    ratio, zeta = math.exp(rng.uniform(-1.5, 2.0)), math.exp(rng.uniform(-3.5, 0.8))
    w0 = math.sqrt(STIFFNESS / MASS)
    p = PiecewiseProblem(
        mass_kg=MASS,
        damping_ns_per_m=2 * zeta * math.sqrt(STIFFNESS * MASS),
        stiffness_n_per_m=STIFFNESS * rng.uniform(0.7, 1.3, count),
        durations_s=shares / shares.sum() * 2 * math.pi * ratio / w0,
        force_n=FORCE * rng.uniform(0.5, 1.5, count),
        start_s=rng.uniform(-1, 1) * ratio / w0,
    )
    exact, found = solve_exactly(p, 20), shoot(p, 20, FINE, points=37)
    for kind in ("displacement", "velocity", "acceleration", "mesh_force"):
        right = getattr(exact, kind)
        assert relative(getattr(found, kind)[1:], right[1:]) < 1e-8
        history = getattr(found.history, kind)
        expected = exact.at(found.history.time_s, kind)
        np.testing.assert_allclose(history, expected, atol=1e-8 * np.abs(expected).max())
    for one, other in zip(found.floquet_multipliers, multipliers(p), strict=True):
        assert abs(one) == pytest.approx(abs(other), abs=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_shooting_matches_the_certified_answer(seed):
    rng = np.random.default_rng(seed)
    p = random_problem(rng, 40, largest=0.5, ratios=(0.3, 8.0), zetas=(0.01, 2.0))
    p = scaled_problem(p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics, [300.0, 80j])
    exact = steady_state(p, 1e-11, harmonics=12)
    found = shoot(p, 12, FINE)
    assert relative(found.acceleration, exact.acceleration) < 1e-8


def test_settling_by_marching_and_by_shooting_agree():
    p = rectangle(damping=3e3)
    marched, shot = settle(p, 20, 1e-9, integrator=FINE), shoot(p, 20, FINE)
    assert relative(marched.acceleration, shot.acceleration) < 1e-8
    assert marched.periods > shot.periods == 1
    assert marched.defect < 1e-9
    assert not marched.contact_lost
    np.testing.assert_allclose(
        marched.energy_lines[1:], 2 * np.abs(marched.velocity[1:]) ** 2, rtol=1e-14
    )


def test_transient_of_a_constant_spring_is_the_step_response():
    p = HillProblem(MASS, 2e3, STIFFNESS, [], 2e-4, FORCE)
    h = transient(p, 5, integrator=FINE, points=50)
    zeta, w0 = p.damping_ratio, 2 * math.pi * p.natural_frequency_hz
    wd = w0 * math.sqrt(1 - zeta**2)
    fade = np.exp(-zeta * w0 * h.time_s)
    exact = (
        FORCE
        / STIFFNESS
        * (1 - fade * (np.cos(wd * h.time_s) + zeta * w0 / wd * np.sin(wd * h.time_s)))
    )
    np.testing.assert_allclose(h.displacement, exact, atol=1e-11 * exact.max())
    push = p.mass_kg * h.acceleration + h.mesh_force
    np.testing.assert_allclose(push, FORCE, rtol=1e-12)
    assert h.time_s[-1] == pytest.approx(5 * 2e-4)


def test_transient_from_any_state_of_a_rectangular_spring():
    p = rectangle(damping=500.0, period=3e-4)
    start = (2e-6, -0.1)
    h = transient(p, 2, start, FINE, points=40)
    state, time = np.array([*start, 1.0]), 0.0
    # the exact state, one sample after the other, by exponentials across each jump
    edges = np.mod(np.cumsum(p.durations_s) + p.start_s, p.period_s)
    cuts = np.unique(np.concatenate([h.time_s, edges, edges + p.period_s]))
    for end in cuts[cuts > 0]:
        middle = np.mod((time + end) / 2 - p.start_s, p.period_s)
        k = p.stiffness_n_per_m[int(middle >= p.durations_s[0])]
        matrix = [[0, 1, 0], [-k / MASS, -500.0 / MASS, FORCE / MASS], [0, 0, 0]]
        state, time = expm(np.array(matrix) * (end - time)) @ state, end
        near = np.flatnonzero(np.abs(h.time_s - end) < 1e-15)
        if len(near):
            assert h.displacement[near[0]] == pytest.approx(state[0], abs=1e-15)
            assert h.velocity[near[0]] == pytest.approx(state[1], abs=1e-10)


def test_static_start_begins_at_the_static_deflection():
    h = transient(rectangle(), 1, "static", points=4)
    assert h.displacement[0] == pytest.approx(FORCE / STIFFNESS)
    assert h.velocity[0] == 0.0


def test_one_sided_contact_that_never_parts_is_the_linear_one():
    p = rectangle()
    tied, free = (settle(p, 10, 1e-9, "static", FINE, c) for c in ("tied", "one-sided"))
    np.testing.assert_allclose(free.acceleration, tied.acceleration, rtol=1e-6, atol=1e-3)
    assert free.parted_at_rad is None
    assert not free.history.apart.any()


def test_parted_teeth_fly_freely():
    # no damping: dropped on the spring from above, the mass bounces for ever
    p = HillProblem(1.0, 0.0, 100.0, [], 1.0, 5.0)
    h = transient(p, 3, (-0.2, 0.0), FINE, "one-sided", points=400)
    flying = h.displacement < -1e-9
    assert h.apart[flying].all()
    np.testing.assert_allclose(h.acceleration[flying], 5.0)
    assert (h.mesh_force >= -1e-9).all()
    energy = 0.5 * h.velocity**2 + 50 * np.maximum(h.displacement, 0) ** 2 - 5 * h.displacement
    np.testing.assert_allclose(energy, 1.0, rtol=1e-9)
    fall = math.sqrt(2 * 0.2 / 5)
    first = np.flatnonzero(~h.apart)[0]
    assert h.time_s[first] == pytest.approx(fall, abs=1 / 400)


def test_parting_starts_where_the_linear_force_vanishes():
    p = rectangle(damping=300.0, period=1.6e-3 / 13.6, variation=0.03)
    linear = solve_exactly(p)
    assert linear.contact_lost
    start = (float(linear.at(0.0)), float(linear.at(0.0, "velocity")))
    h = transient(p, 1, start, FINE, "one-sided", points=20000)
    angle = 2 * math.pi * h.time_s[np.flatnonzero(h.apart)[0]] / p.period_s
    assert angle == pytest.approx(linear.contact_loss_angle_rad, abs=1e-3)
    assert (h.mesh_force >= -1e-6 * FORCE).all()


def test_beyond_contact_loss_the_motion_stays_bounded_where_the_linear_one_grows():
    p = HillProblem(MASS, 500.0, STIFFNESS, [0.1], 1.6e-3 / 27.0, FORCE)
    assert steady_state(p).stable is False
    found = settle(p, 4, 1e-4, contact="one-sided", most_periods=600)
    assert found.history.apart.any()
    assert found.parted_at_rad > 0
    assert np.abs(found.history.displacement).max() < 100 * FORCE / STIFFNESS


def test_what_does_not_settle_is_said():
    p = scaled_problem(0.5, 1e-3, [0.05])
    found = settle(p, 3, 1e-6, most_periods=30)
    assert found.stable is None
    assert "still changes" in found.message
    shot = shoot(p, 3)
    assert shot.stable is False
    assert "unstable: free vibrations grow by" in shot.message
    assert math.isinf(shot.error_bound)


@pytest.mark.parametrize("count", [0, 3, 60])
def test_fourier_sums(count):
    rng = np.random.default_rng(count)
    c = rng.normal(size=count) + 1j * rng.normal(size=count)
    total = fourier_sum(1.5, c, 0.7)
    for s in (0.0, 0.4, 11.0):
        expected = 1.5 + 2 * sum((c[j] * np.exp(0.7j * (j + 1) * s)).real for j in range(count))
        assert (total(s) if callable(total) else total) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Integrator(solver="Euler"), "solver='Euler' must be one of"),
        (lambda: Integrator(relative_tolerance=1e-16), "relative_tolerance"),
        (lambda: transient(rectangle(), 0), "periods=0"),
        (lambda: transient(rectangle(), 1, "moving"), "start='moving'"),
        (lambda: transient(rectangle(), 1, (math.nan, 0.0)), "start=nan m"),
        (lambda: transient(rectangle(), 1, contact="glued"), "contact='glued'"),
        (lambda: settle(rectangle(damping=0.0), 3), "never die out"),
        (lambda: settle(rectangle(), 0), "harmonics=0"),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
