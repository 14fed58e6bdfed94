import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.hill_cases import published_pair, random_problem
from reference.system_reference import (
    lines_at_once,
    periodic_motion,
    random_system,
    relative,
    stiffness_at,
)

from gearmon.dynamics import HillSystem, steady_state
from gearmon.dynamics.compliance import core_norm, coupling_matrix
from gearmon.dynamics.mesh_equations import equations_of
from gearmon.errors import ArgumentError

SEEDS = st.integers(0, 2**32 - 1)
# what one matrix leaves to rounding
ROUNDING = 1e-11


def as_system(p):
    return HillSystem(
        p.mass_kg,
        0.0,
        0.0,
        1.0,
        p.stiffness_n_per_m,
        p.stiffness_harmonics,
        p.period_s,
        p.force_n,
        mesh_damping_ns_per_m=p.damping_ns_per_m,
    )


@pytest.mark.parametrize("method", ["auto", "msm", "msm least residual", "harmonic balance"])
def test_a_pair_is_a_system_of_one_mesh(method):
    p = published_pair(11)
    pair, system = steady_state(p, 1e-11), steady_state(as_system(p), 1e-9, method)
    assert relative(pair.displacement[:, None], system) <= 1e-9
    assert system.error_bound <= 1e-9
    assert system.stable
    np.testing.assert_allclose(
        np.sort_complex(system.floquet_multipliers), np.sort_complex(pair.floquet_multipliers)
    )
    assert system.mesh_force_margin[0] == pytest.approx(pair.mesh_force_margin, rel=1e-6)
    assert not system.contact_lost.any()


@given(SEEDS)
def test_pairs_near_resonance_and_instability(seed):
    p = random_problem(np.random.default_rng(seed), 8, ratios=(0.2, 6.0))
    pair, system = steady_state(p, 1e-11), steady_state(as_system(p), 1e-7)
    assert system.stable == pair.stable
    if pair.stable:
        error = relative(pair.displacement[:, None], system)
        assert error <= system.error_bound + pair.error_bound


@given(SEEDS, st.sampled_from([1e-3, 1e-6, 1e-9]))
def test_bound_of_random_systems_holds(seed, tolerance):
    system = random_system(np.random.default_rng(seed))
    found = steady_state(system, tolerance)
    if not found.stable:
        assert math.isinf(found.error_bound)
        return
    assert found.error_bound <= tolerance
    exact = lines_at_once(system, min(45, len(found.displacement) + 8))
    assert relative(exact, found) <= found.error_bound + ROUNDING


@pytest.mark.parametrize("seed", range(6))
def test_against_integration_in_time(seed):
    system = random_system(np.random.default_rng(seed), 8, 3)
    found = steady_state(system, 1e-9)
    acceleration, whole = periodic_motion(system, 64)
    times = system.period_s * np.arange(64) / 64
    apart = np.abs(found.at(times, "acceleration") - acceleration).max()
    assert apart < 1e-6 * np.abs(acceleration).max()
    exact = np.linalg.eigvals(whole)
    for value in found.floquet_multipliers[:2]:
        assert np.abs(exact - value).min() < 1e-6


def test_many_meshes_meet_the_tolerance():
    rng = np.random.default_rng(12)
    refused = stable = 0
    for _ in range(6):
        found = steady_state(random_system(rng, 40, 12, 10, 0.6), 1e-6)
        stable += found.stable
        refused += found.stable and not found.error_bound <= 1e-6
    assert stable >= 4
    assert not refused


@given(SEEDS, st.integers(1, 30))
def test_norm_of_a_core_lies_closely_above_that_of_its_matrix(seed, core):
    equations = equations_of(random_system(np.random.default_rng(seed), 12, 5, 8, 0.8))
    matrices, harmonics = equations.compliance.matrices(core + 1), equations.pattern.harmonics
    values = np.linalg.svd(coupling_matrix(matrices, harmonics), compute_uv=False)
    assert 1 <= core_norm(matrices, harmonics) * values[-1] <= 1.5


def test_norm_of_a_core_that_squares_would_hide():
    """The spring pulls for a third of the period: an answer a million times its cause."""
    stiff = replace(published_pair(2), stiffness_harmonics=np.array([0.9, 0.3j]))
    matrices = equations_of(stiff).compliance.matrices(61)
    harmonics = stiff.stiffness_harmonics[None]
    values = np.linalg.svd(coupling_matrix(matrices, harmonics), compute_uv=False)
    assert values[0] > 1e6 * values[-1]
    assert 1 <= core_norm(matrices, harmonics) * values[-1] <= 1.5


def test_many_meshes_and_a_slow_period_leave_a_bound():
    """Twelve meshes and a highest mode at line 150: 5,500 unknowns, some in resonance."""
    rng = np.random.default_rng(8)
    n, meshes = 20, 12
    shapes = np.linalg.qr(rng.normal(size=(n, n)))[0]
    vectors = rng.normal(size=(meshes, n))
    squares = np.geomspace(1.0, 150.0, n) ** 2
    stiffness = shapes @ np.diag(squares) @ shapes.T
    damping = shapes @ np.diag(0.01 * np.sqrt(squares)) @ shapes.T
    c = rng.normal(size=(meshes, 3)) * 0.1 / 3
    means = np.full(meshes, 30.0)
    force = rng.normal(size=n)
    system = HillSystem(np.eye(n), damping, stiffness, vectors, means, c, 2 * np.pi, force)
    found = steady_state(system, 1e-6)
    assert found.stable
    assert found.error_bound <= 1e-6
    exact = lines_at_once(system, len(found.displacement) + 7)
    assert relative(exact, found) <= found.error_bound + ROUNDING


def test_forces_and_deflections_belong_together():
    system = random_system(np.random.default_rng(3), 6, 3)
    r = steady_state(system, 1e-10)
    time = 0.37 * system.period_s
    q, v, a = (r.at(time, kind) for kind in ("displacement", "velocity", "acceleration"))
    turning = 0 if system.gyroscopic is None else system.gyroscopic
    left = system.mass @ a + (system.damping + turning) @ v + stiffness_at(system, time) @ q
    scale = np.abs(system.mean_stiffness @ q).max()
    np.testing.assert_allclose(left, system.force_n, atol=1e-8 * scale)
    pressing = (stiffness_at(system, time) - system.stiffness) @ q
    np.testing.assert_allclose(
        system.mesh_vectors.T @ r.at(time, "mesh_force"), pressing, atol=1e-8 * scale
    )
    np.testing.assert_allclose(r.mesh_deflection, r.displacement @ system.mesh_vectors.T)
    spring = r.spring_force(np.eye(len(q))[:1], [5.0])
    np.testing.assert_allclose(spring[:, 0], 5 * r.displacement[:, 0])


def test_orders_approach_the_answer():
    system = random_system(np.random.default_rng(5), 6, 3, variation=0.1)
    exact = steady_state(system, 1e-10).displacement
    errors = []
    for order in (1, 2, 3, 4):
        found = steady_state(system, method="msm", order=order)
        assert found.order == order
        errors.append(relative(exact, found))
        assert errors[-1] <= found.error_bound + 1e-10
    assert (np.diff(np.log(errors)) < 0).all()


def test_order_k_errs_by_the_next_power_of_the_variation():
    system = random_system(np.random.default_rng(5), 6, 3, variation=0.1)
    sizes, errors = np.array([0.1, 0.2, 0.4]), []
    for size in sizes:
        p = scaled(system, size)
        found = steady_state(p, method="msm", order=2)
        lines = steady_state(p, 1e-12).displacement
        count = max(len(lines), len(found.displacement))
        both = np.zeros((2, count, lines.shape[1]), dtype=complex)
        both[0, : len(lines)], both[1, : len(found.displacement)] = lines, found.displacement
        errors.append(np.linalg.norm((both[0] - both[1])[1:]))
    assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] == pytest.approx(3, abs=0.25)


def scaled(system, factor):
    return HillSystem(
        system.mass,
        system.damping,
        system.stiffness,
        system.mesh_vectors,
        system.mesh_stiffness_n_per_m,
        factor * system.mesh_harmonics,
        system.period_s,
        system.force_n,
        system.gyroscopic,
    )


def test_geared_torsion_systems():
    # Friswell et al., Dynamics of Rotating Machines: motor, gears of ratio 1, two rotors
    inertia = np.diag([4e-4, 5e-5, 7e-4, 7e-4])
    links = np.array([[1, -1, 0, 0], [0, 1, -1, 0], [0, 1, 0, -1]], dtype=float)
    shafts = links.T @ np.diag([1e4, 5e3, 5e3]) @ links
    found = torsional(inertia, shafts)
    np.testing.assert_allclose(found, [0, 425.4, 634.1, 3247.2], rtol=1e-4, atol=1e-3)
    inertia = np.diag([3.5e-3, 3.5e-3, 3.5e-3, 0.15, 0.05])
    links = -np.diff(np.eye(5), axis=0)
    shafts = links.T @ np.diag([12e3, 12e3, 14e3, 10e3]) @ links
    found = torsional(inertia, shafts)
    np.testing.assert_allclose(found, [0, 81.21, 141.21, 378.95, 536.36], rtol=1e-4, atol=1e-3)


def torsional(inertia, shafts):
    """Natural frequencies with a mesh so soft that it does not count."""
    n = len(inertia)
    vector = np.zeros(n)
    vector[:2] = 1, -1
    return HillSystem(
        inertia, 0 * inertia, shafts, vector, 1e-9, [[0.0]], 1.0, np.zeros(n)
    ).natural_frequencies_hz


def test_parametric_instability_of_a_combination():
    # two oscillators coupled by one mesh: l w = w_p + w_q, first order of multiple scales
    eps = 0.04
    modes = HillSystem(
        np.eye(2),
        np.zeros((2, 2)),
        np.diag([1.0, 3.0]),
        [[1.0, 0.6]],
        0.5,
        [[0.0]],
        1.0,
        np.zeros(2),
    )
    squares, shapes = modes.modes
    p, q = np.sqrt(squares)
    depth = 0.5 * (shapes.T @ np.outer([1.0, 0.6], [1.0, 0.6]) @ shapes)[0, 1]
    half_width = eps / 2 * abs(depth) / math.sqrt(p * q)
    for side in (-1.0, 1.0):
        for share, stable in ((0.97, False), (1.03, True)):
            w = p + q + side * share * half_width
            found = steady_state(
                HillSystem(
                    np.eye(2),
                    1e-7 * np.eye(2),
                    np.diag([1.0, 3.0]),
                    [[1.0, 0.6]],
                    0.5,
                    [[eps / 2]],
                    2 * math.pi / w,
                    [1.0, 0.0],
                )
            )
            assert found.stable is stable


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass": [[1.0, 0.0], [0.0, -1.0]]}, "mass: the matrix must be positive definite"),
        ({"damping": [[1.0, 2.0], [0.0, 1.0]]}, "damping: must be symmetric"),
        ({"damping": -np.eye(2)}, "damping: its least eigenvalue"),
        ({"stiffness": np.full((2, 2), np.nan)}, r"stiffness\[0, 0\]=nan must be a finite"),
        ({"stiffness": np.diag([1.0, -30.0])}, "has a mode of negative stiffness"),
        ({"mesh_vectors": [[1.0, 0.0, 0.0]]}, r"mesh_vectors: shape \(1, 3\) must be \(1, 2\)"),
        ({"mesh_stiffness_n_per_m": [-1.0]}, "mesh_stiffness_n_per_m: all values must be > 0"),
        ({"mesh_damping_ns_per_m": [-1.0]}, "mesh_damping_ns_per_m: all values must be >= 0"),
        ({"gyroscopic": np.eye(2)}, "gyroscopic: must be skew-symmetric"),
        ({"period_s": 0.0}, "period_s"),
        ({"force_n": [1.0]}, r"force_n: shape \(1,\) must be \(2,\)"),
        ({"stiffness": np.zeros((2, 2)), "force_n": [1.0, 0.0]}, "does work on a rigid-body"),
    ],
)
def test_bad_systems_are_refused(change, message):
    values = {
        "mass": np.eye(2),
        "damping": 0.1 * np.eye(2),
        "stiffness": np.eye(2),
        "mesh_vectors": [[1.0, -1.0]],
        "mesh_stiffness_n_per_m": [1.0],
        "mesh_harmonics": [[0.1]],
        "period_s": 3.0,
        "force_n": [1.0, -1.0],
    }
    with pytest.raises(ArgumentError, match=message):
        HillSystem(**(values | change))


def test_a_machine_has_a_mesh():
    none = {"mesh_vectors": np.zeros((0, 2)), "mesh_harmonics": np.zeros((0, 1))}
    bare = {"mass": np.eye(2), "damping": np.eye(2), "stiffness": np.eye(2), "period_s": 1.0}
    with pytest.raises(ArgumentError, match="one at least"):
        HillSystem(**bare, **none, mesh_stiffness_n_per_m=[], force_n=[0.0, 0.0])


def test_without_damping_nothing_is_said_to_grow():
    system = replace(as_system(published_pair(2)), mesh_damping_ns_per_m=np.zeros(1))
    found = steady_state(system)
    assert not found.stable
    assert found.message.startswith("some free vibration never dies out")


def test_no_variation_no_vibration():
    system = scaled(random_system(np.random.default_rng(1)), 0.0)
    found = steady_state(system)
    assert found.error_bound == 0
    assert not np.abs(found.displacement[1:]).any()
    np.testing.assert_allclose(
        system.mean_stiffness @ found.displacement[0].real, system.force_n, atol=1e-9
    )


def test_only_the_harmonics_asked_for():
    system = random_system(np.random.default_rng(2))
    full, some = steady_state(system, 1e-9), steady_state(system, 1e-6, harmonics=3)
    assert some.displacement.shape[0] == some.mesh_force.shape[0] == 4
    weights = (np.arange(4) ** 2)[:, None]
    apart = np.linalg.norm(weights * (some.displacement - full.displacement[:4]))
    assert apart <= (some.error_bound + 1e-9) * np.linalg.norm(weights * some.displacement)
