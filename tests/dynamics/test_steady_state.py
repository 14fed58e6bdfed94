import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.hill_cases import balanced, published_pair, random_problem, scaled_problem
from reference.hill_reference import acceleration_error, periodic_solution

from gearmon.dynamics import HillProblem, steady_state
from gearmon.dynamics.steady_state import METHODS
from gearmon.errors import ArgumentError

SEEDS = st.integers(0, 2**32 - 1)


def exact(problem, response):
    """Displacement coefficients from a matrix larger than was needed."""
    reach = len(response.displacement) + 3 * len(problem.stiffness_harmonics) + 30
    return balanced(problem, min(reach, 250))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-10])
def test_bound_holds_and_is_met_on_random_systems(tolerance):
    rng = np.random.default_rng(int(-math.log10(tolerance)))
    ratios, met = [], 0
    for _ in range(50):
        p = random_problem(rng, 16, ratios=(0.1, 12.0))
        r = steady_state(p, tolerance)
        if not r.stable:
            assert math.isinf(r.error_bound)
            continue
        # the matrix is itself exact to about 1e-13
        error = acceleration_error(r, exact(p, r))
        assert error <= r.error_bound + 3e-13
        met += r.error_bound <= tolerance
        ratios.append(r.error_bound / max(error, 1e-14))
    assert len(ratios) >= 45
    assert met >= len(ratios) - 1
    assert np.median(ratios) < 10


@pytest.mark.parametrize("order", [0, 1, 2, 4])
@pytest.mark.parametrize("method", ["msm", "msm least residual"])
def test_bound_holds_where_orders_are_few(method, order):
    rng = np.random.default_rng(order)
    for _ in range(15):
        p = random_problem(rng, 10, zetas=(3e-3, 1.0))
        r = steady_state(p, method=method, order=order)
        assert r.order <= order
        if r.stable:
            assert acceleration_error(r, exact(p, r)) <= r.error_bound * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_against_time_integration(seed):
    p = random_problem(np.random.default_rng(seed + 7), 6, ratios=(0.5, 8), zetas=(0.005, 0.3))
    r = steady_state(p, 1e-8)
    *_, acceleration = periodic_solution(p, 128)
    found = r.at(p.period_s * np.arange(128) / 128, "acceleration")
    assert np.linalg.norm(found - acceleration) < 1e-6 * np.linalg.norm(acceleration)


@pytest.mark.parametrize("zeta", [0.3, 0.02, 0.005, 0.003])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0, 13.6, 13.0])
def test_resonances_and_weak_damping(ratio, zeta):
    n = np.arange(1, 31)
    c = 0.13 * np.sin(n * math.pi * 0.412) / (n * math.pi * 0.588) + 0j
    r = steady_state(scaled_problem(ratio, zeta, c))
    if r.stable:
        assert r.error_bound < 1e-6
        assert acceleration_error(r, exact(r.problem, r)) <= r.error_bound
    else:
        assert abs(r.floquet_multipliers[0]) > 1
        assert "largest Floquet multiplier" in r.message


@given(SEEDS, st.floats(0.01, 1e5), st.booleans())
def test_linear_in_the_force(seed, factor, negative):
    p = random_problem(np.random.default_rng(seed), 8, zetas=(0.01, 1.0))
    factor = -factor if negative else factor
    r, s = steady_state(p), steady_state(replace(p, force_n=factor * p.force_n))
    np.testing.assert_allclose(
        s.displacement / factor, r.displacement, atol=1e-9 * np.abs(r.displacement).max()
    )
    assert s.contact_lost == r.contact_lost


@given(SEEDS, st.floats(1e-3, 1e3))
def test_scaling_of_time(seed, factor):
    # t -> factor t: m -> factor^2 m, c -> factor c leaves z(t/T) as it is
    p = random_problem(np.random.default_rng(seed), 8, zetas=(0.01, 1.0))
    q = replace(
        p,
        mass_kg=p.mass_kg * factor**2,
        damping_ns_per_m=p.damping_ns_per_m * factor,
        period_s=p.period_s * factor,
    )
    r, s = steady_state(p), steady_state(q)
    n = min(len(r.displacement), len(s.displacement))
    scale = np.abs(r.displacement).max()
    np.testing.assert_allclose(s.displacement[:n], r.displacement[:n], atol=1e-6 * scale)


@given(SEEDS, st.floats(0, 1))
def test_shift_of_time(seed, share):
    # k(t + share T): every coefficient turns by its own phase
    p = random_problem(np.random.default_rng(seed), 8, zetas=(0.01, 1.0))
    turn = np.exp(2j * math.pi * share * np.arange(1, len(p.stiffness_harmonics) + 1))
    q = replace(p, stiffness_harmonics=p.stiffness_harmonics * turn)
    r, s = steady_state(p), steady_state(q)
    n = min(len(r.displacement), len(s.displacement))
    turned = r.displacement[:n] * np.exp(2j * math.pi * share * np.arange(n))
    scale = np.abs(r.displacement).max()
    np.testing.assert_allclose(s.displacement[:n], turned, atol=1e-6 * scale)


@given(SEEDS)
def test_mean_force_is_carried_by_the_mesh(seed):
    p = random_problem(np.random.default_rng(seed), 8, zetas=(0.01, 1.0))
    r = steady_state(p, 1e-9)
    if r.stable:
        assert r.mesh_force[0].real == pytest.approx(p.force_n, rel=1e-6)


def test_repeating_the_period_changes_nothing():
    p = published_pair(15)
    c = np.zeros(45, dtype=complex)
    c[2::3] = p.stiffness_harmonics
    tripled = replace(p, stiffness_harmonics=c, period_s=3 * p.period_s)
    r, s = steady_state(p, 1e-9), steady_state(tripled, 1e-9)
    n = min(len(r.displacement), (len(s.displacement) + 2) // 3)
    scale = np.abs(r.displacement).max()
    np.testing.assert_allclose(s.displacement[::3][:n], r.displacement[:n], atol=1e-9 * scale)
    assert np.abs(np.delete(s.displacement, np.s_[::3])).max() < 1e-12 * scale


def test_only_the_harmonics_asked_for_are_handed_out():
    p = published_pair(30)
    full = steady_state(p, 1e-10)
    for count in (1, 5, 20, 400):
        r = steady_state(p, 1e-7, harmonics=count)
        assert len(r.displacement) == count + 1
        assert r.error_bound < 1e-7
        n = min(count + 1, len(full.displacement))
        weights = np.arange(n) ** 2
        error = np.linalg.norm(weights * (r.displacement[:n] - full.displacement[:n]))
        assert error <= r.error_bound * np.linalg.norm(weights * full.displacement[:n]) * 1.001


def test_unstable_systems_are_refused_with_their_multiplier():
    p = scaled_problem(0.5, 0.005, [0.1])
    r = steady_state(p)
    assert r.stable is False
    assert math.isinf(r.error_bound)
    assert f"{abs(r.floquet_multipliers[0]):.6g}" in r.message


@pytest.mark.parametrize("harmonics", [[], [0.1], [0.2, 0.1j]])
@pytest.mark.parametrize("method", METHODS)
def test_without_damping_no_way_finds_a_steady_state(method, harmonics):
    undamped = steady_state(scaled_problem(3.3, 0.0, harmonics), method=method)
    assert undamped.stable is False
    assert math.isinf(undamped.error_bound)
    assert "undamped" in undamped.message
    with pytest.raises(ArgumentError, match=r"just 3 times that of the mesh, .*give damping"):
        steady_state(HillProblem(1.0, 0.0, 9.0, harmonics, 2 * math.pi, 1.0), method=method)


def test_constant_stiffness_stands_still():
    r = steady_state(scaled_problem(3.3, 0.1, []))
    assert r.error_bound == 0
    assert r.displacement[0].real == pytest.approx(5e-6)
    assert np.abs(r.acceleration).max() == 0


def test_forced_oscillator_in_closed_form():
    p = scaled_problem(3.3, 0.1, [], force_harmonics=[0, 50.0 - 20j])
    r = steady_state(p)
    expected = (50 - 20j) / p.stiffness_n_per_m / p.dynamic_stiffness(2)[2]
    assert r.displacement[2] == pytest.approx(expected, rel=1e-12)
    assert r.error_bound < 1e-12


def test_tiny_variation_keeps_its_digits():
    p = scaled_problem(3.3, 0.1, [1e-9, 2e-10j])
    r = steady_state(p, 1e-6)
    first = -5e-6 * p.stiffness_harmonics / p.dynamic_stiffness(2)[1:]
    np.testing.assert_allclose(r.displacement[1:3], first, rtol=1e-7)
    assert r.error_bound < 1e-6


def test_a_turn_with_a_weak_tooth():
    # 8 meshes, one of them 20 % softer
    phase = np.arange(8 * 64) / 64
    softer = np.where(phase < 1.4, 0.8, 1.0) * (1 + 0.2 * np.cos(2 * math.pi * phase))
    c = np.fft.rfft(softer) / softer.sum()
    p = scaled_problem(5.3 * 8, 0.05, c[1:100])
    r = steady_state(p)
    assert r.error_bound < 1e-6
    assert acceleration_error(r, balanced(p, 600)) <= r.error_bound


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tolerance": 0.0}, "tolerance=0.0 must lie in"),
        ({"method": "magic"}, "method='magic' is not one of auto, msm"),
        ({"order": -1}, "order=-1 must lie in"),
        ({"harmonics": 0}, "harmonics=0 must lie in"),
        ({"method": "harmonic balance", "order": 2}, "harmonic balance has no orders"),
    ],
)
def test_bad_arguments_are_refused(arguments, words):
    with pytest.raises(ArgumentError, match=words):
        steady_state(published_pair(), **arguments)


def test_the_message_tells_of_lost_contact_wherever_there_is_some():
    """Near resonance, from variations that lose none to those that lose all."""
    told = []
    for ratio in (1.0, 2.05, 3.1):
        for variation in np.geomspace(0.02, 0.5, 16):
            problem = replace(
                published_pair(), stiffness_harmonics=np.array([variation / 2]),
                period_s=2 * math.pi * ratio * math.sqrt(0.28 / 8e8), damping_ns_per_m=2e3,
            )  # fmt: skip
            found = steady_state(problem)
            if found.stable and found.error_bound < 1:
                assert found.contact_lost == ("teeth lose contact" in found.message)
                told.append(found.contact_lost)
    assert 5 < sum(told) < len(told) - 5


@pytest.mark.parametrize("method", ["auto", "harmonic balance"])
@pytest.mark.parametrize("ratio", [8.0, 20.0])
@pytest.mark.parametrize("size", [0.2, 0.6, 1.0])
def test_teeth_that_a_slow_force_parts_are_told_though_hardly_anything_swings(size, ratio, method):
    """Far below resonance the mesh carries the forces as they come: F + 2 f cos(w t)."""
    p = scaled_problem(ratio, 0.1, [0.01])
    p = replace(p, force_harmonics_n=[size * p.force_n])
    found = steady_state(p, method=method)
    assert found.mesh_force_margin == pytest.approx(1 - 2 * size, abs=0.05)
    assert ("teeth lose contact" in found.message) == found.contact_lost == (size > 0.5)
