import math

import numpy as np
import pytest
from reference.hill_cases import published_pair, scaled_problem
from reference.hill_reference import force_at, stiffness_at
from scipy.integrate import solve_ivp

from gearmon.dynamics import forced_resonance, parametric_resonance, transient
from gearmon.dynamics.amplitude_equations import Motion, free_vibration
from gearmon.errors import ArgumentError

W0 = math.sqrt(8e8 / 0.28)
SHAPE = np.array([0.5, 0.2j, -0.15])


def moving(equations, displacement, velocity):
    return Motion(equations=equations, displacement_m=displacement, velocity_ms=velocity)


def integrated(problem, start, times):
    """z and z' by time integration."""

    def slope(time, state):
        force = force_at(problem, time) - problem.damping_ns_per_m * state[1]
        return [state[1], (force - stiffness_at(problem, time) * state[0]) / problem.mass_kg]

    return solve_ivp(
        slope,
        (0.0, times[-1]),
        start,
        method="DOP853",
        rtol=3e-14,
        atol=1e-19 * np.array([1, W0]),
        t_eval=times,
    ).y


def unforced_start(problem, order):
    return moving(free_vibration(problem, order), 1e-6, 0.01)


# problem and times as functions of the small parameter, and the motion of some order
CASES = {
    "damped": (
        lambda e: scaled_problem(1.37, 0.1, e * SHAPE, [500j]),
        lambda _: 10 / W0,
        unforced_start,
    ),
    "overdamped": (
        lambda e: scaled_problem(1.3, 1.6, e * SHAPE),
        lambda _: 3 / W0,
        unforced_start,
    ),
    "nearly critical": (
        lambda e: scaled_problem(1.3, 1.001, e * SHAPE),
        lambda _: 3 / W0,
        lambda p, order: transient(p, 1e-6, 0.01, order),
    ),
    "long times": (
        lambda e: scaled_problem(1.37, 0.1 * e, e * SHAPE),
        lambda e: 1 / e / W0,
        lambda p, order: moving(free_vibration(p, order, order + 1, True), 1e-6, 0.01),
    ),
    "principal parametric": (
        lambda e: scaled_problem(0.5 + 0.1 * e, 0.1 * e, e * SHAPE),
        lambda e: 2 / e / W0,
        lambda p, order: transient(p, 1e-6, 0.01, order),
    ),
    "principal parametric, small damping": (
        lambda e: scaled_problem(0.5 + 0.1 * e, 0.1 * e, e * SHAPE),
        lambda e: 2 / e / W0,
        lambda p, order: transient(p, 1e-6, 0.01, order, small_damping=True),
    ),
    "forced parametric": (
        lambda e: scaled_problem(2 + 0.4 * e, 0.3 * e, e * SHAPE),
        lambda e: 2 / e / W0,
        lambda p, order: transient(p, 1e-6, 0.01, order),
    ),
}
SIZES = np.array([0.01, 0.02, 0.04])


@pytest.mark.parametrize("case", CASES)
def test_error_falls_with_the_next_power(case):
    make, length, move = CASES[case]
    errors = np.zeros((4, len(SIZES)))
    for i, size in enumerate(SIZES):
        p = make(size)
        times = np.linspace(0, length(size), 40)
        exact = integrated(p, [1e-6, 0.01], times)[0]
        for order in range(4):
            errors[order, i] = np.abs(move(p, order).at(times) - exact).max()
    for order in range(4):
        slope = np.polyfit(np.log(SIZES), np.log(errors[order]), 1)[0]
        # the largest error is taken over a window that changes with eps
        assert slope == pytest.approx(order + 1, abs=0.2)


def test_mesh_force_obeys_newton():
    p = scaled_problem(2.3, 0.05, [0.002, 0.001j], [200.0])
    motion = transient(p, 1e-6, 0.01, 6)
    times = np.linspace(0, 40 / W0, 11)
    driving = np.array([force_at(p, t) for t in times])
    moved = driving - p.mass_kg * motion.at(times, "acceleration")
    np.testing.assert_allclose(motion.at(times, "mesh_force"), moved, atol=1e-9 * p.force_n)


def test_start_is_met_exactly():
    p = scaled_problem(2.3, 0.05, [0.05, 0.02j], [200.0])
    for motion in (moving(free_vibration(p, 3), 2e-6, -0.03), transient(p, 2e-6, -0.03, 2)):
        assert float(motion.at(0.0)) == pytest.approx(2e-6, rel=1e-12)
        assert float(motion.at(0.0, "velocity")) == pytest.approx(-0.03, rel=1e-12)


def test_published_pair_from_rest():
    p = published_pair(9)
    times = np.linspace(0, 5e-4, 30)
    z, v = integrated(p, [0.0, 0.0], times)
    motion = transient(p, order=8)
    assert np.abs(motion.at(times) - z).max() < 2e-3 * z.max()
    assert np.abs(motion.at(times, "velocity") - v).max() < 5e-3 * np.abs(v).max()


def test_derivatives_are_consistent():
    motion = transient(scaled_problem(2.02, 0.01, [0.05, 0.02j]), 1e-6, 0.01, 2)
    times = np.linspace(0, 30 / W0, 7)
    step = 1e-4 / W0
    for kind, derivative in (("displacement", "velocity"), ("velocity", "acceleration")):
        slope = (motion.at(times + step, kind) - motion.at(times - step, kind)) / (2 * step)
        exact = motion.at(times, derivative)
        assert np.abs(slope - exact).max() < 1e-6 * np.abs(exact).max()


def test_transient_ends_in_the_steady_state():
    p = scaled_problem(3.01, 0.05, [0.04, 0.02j, 0.02])
    late = 12 / (0.05 * W0)
    times = late + np.linspace(0, p.period_s, 9)
    steady = forced_resonance(p, 3).steady_displacement()
    n = np.arange(1, len(steady))
    wave = (
        steady[0].real
        + 2 * (np.exp(1j * p.angular_frequency * np.multiply.outer(times, n)) @ steady[1:]).real
    )
    np.testing.assert_allclose(
        transient(p, 1e-5, 0.1, 3).at(times), wave, atol=1e-4 * np.abs(wave).max()
    )


def test_edge_of_a_tongue_grows_linearly():
    # both exponents coincide at the edge: A(t) = (1 + L t) A(0)
    p = scaled_problem(1 / (2 + 0.1), 0.0, [0.1], force=0.0)
    e = parametric_resonance(p, 0, rate_order=1)
    motion = Motion(equations=e, displacement_m=1e-6, velocity_ms=0.0)
    times = np.array([0.0, 1.0, 2.0, 4.0]) * 50 / W0
    found = motion.amplitudes(times)
    start = motion.start_amplitudes
    expected = start + times[:, None] * (e.rate @ start)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_refusals():
    p = scaled_problem(3.5, 0.01, [0.04])
    with pytest.raises(ArgumentError, match="two amplitudes"):
        Motion(equations=forced_resonance(p, 1, [3, 4]), displacement_m=0.0, velocity_ms=0.0)
    with pytest.raises(ArgumentError, match="kind='force'"):
        transient(p, order=1).at(0.0, "force")
    with pytest.raises(ArgumentError, match="velocity_ms"):
        transient(p, 0.0, math.nan)
