import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.hill_cases import balanced, published_pair, random_problem, scaled_problem
from reference.hill_reference import acceleration_error, periodic_solution

from gearmon.dynamics import (
    HillProblem,
    direct,
    floquet,
    steady_state,
)
from gearmon.dynamics.direct import BandSystem, peak
from gearmon.dynamics.hill import largest_responses
from gearmon.dynamics.mesh_equations import equations_of
from gearmon.errors import ArgumentError


def true_gain(problem, highest):
    """Norm of the acceleration operator from the inverse of a large matrix."""
    n = np.arange(-highest, highest + 1)
    x = n / problem.frequency_ratio
    matrix = np.diag(1 - x**2 + 2j * problem.damping_ratio * x)
    for j, c in enumerate(problem.stiffness_harmonics, start=1):
        matrix += c * np.eye(len(n), k=-j) + np.conj(c) * np.eye(len(n), k=j)
    return np.linalg.norm(x[:, None] ** 2 * np.linalg.inv(matrix), 2)


def bounds_of(problem):
    """Both ways to bound the inverse, where they tell."""
    system = BandSystem(problem)
    assert system.factorise(system.enough_lines(1e-6))
    return direct.cheap(system), float(equations_of(problem).gain_by_inverse)


def test_gains_bound_the_inverse_and_stability_is_that_of_floquet():
    rng = np.random.default_rng(5)
    told = unstable = bounded = 0
    for _ in range(60):
        p = random_problem(rng, 8, largest=2.0, ratios=(0.1, 6.0), zetas=(2e-3, 1.0))
        first = floquet.multipliers(p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics)[0]
        true = true_gain(p, math.ceil(5 * p.frequency_ratio) + 40)
        inverse, computed = bounds_of(p)
        assert computed >= true * (1 - 1e-9)
        bounded += math.isfinite(computed)
        if inverse is not None:
            told += 1
            assert inverse.stable == (abs(first) < 1)
            unstable += not inverse.stable
            assert inverse.gain >= true * (1 - 1e-9)
    assert told > 40
    assert bounded > 55
    assert unstable >= 1


def test_determinant_is_that_of_the_period_map():
    # Mathieu: q = det(1 - M) = 1 - trace + product of the multipliers
    for ratio, zeta, c in ((0.7, 0.02, 0.1), (3.3, 0.01, 0.2), (1.5, 0.1, 0.05)):
        p = scaled_problem(ratio, zeta, [c])
        system = BandSystem(p)
        assert system.factorise(60)
        determinant = direct.determinant(system, 2 * c * c)
        s = np.emath.sqrt(zeta**2 - 1)
        period = 2 * math.pi * ratio
        constant = ((1 - np.exp((s - zeta) * period)) * (1 - np.exp((-s - zeta) * period))).real
        assert 4 * math.exp(determinant.constant - zeta * period) == pytest.approx(constant)
        found = determinant.value * constant
        one, two = floquet.multipliers(ratio, zeta, np.array([c + 0j]))
        expected = ((1 - one) * (1 - two)).real
        assert found == pytest.approx(expected, rel=1e-4)
        # far above resonance the inverse is smaller than one
        beyond = direct.beyond_lines(system, 1.0, 2 * c * c)
        assert abs(math.log(found / expected)) <= beyond


@pytest.mark.parametrize("zeta", [1e-3, 0.3, 0.9, 1.5, 40.0])
@pytest.mark.parametrize("ratio", [0.3, 4.0, 13.6])
@pytest.mark.parametrize("power", [1e-8, 0.02, 3.0])
def test_column_sizes_and_their_product_are_those_of_many_lines(zeta, ratio, power):
    p = scaled_problem(ratio, zeta, [math.sqrt(power / 2)])
    system = BandSystem(p)
    assert system.factorise(30)
    n = np.arange(200_000)
    x = (n / p.frequency_ratio) ** 2
    magnitudes = (1 - x) ** 2 + 4 * p.damping_ratio**2 * x
    sizes = np.sqrt(magnitudes + power)
    static, largest = largest_responses(p.frequency_ratio, p.damping_ratio, power)
    assert static == pytest.approx((1 / sizes).max(), rel=1e-9)
    # the limit of infinite frequency is 1
    assert largest == pytest.approx(max(1.0, (x / sizes).max()), rel=1e-9)
    product = 0.5 * math.log1p(power) + np.log1p(power / magnitudes[1:]).sum()
    determinant = direct.determinant(system, power)
    assert math.log(determinant.growth) - 0.5 == pytest.approx(product, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(
    ("ratio", "harmonics", "solved"),
    [(3.0, [0.2, 0.1j], 12), (3.0, [0.2, 0.1j], 9), (5.0, [0.1, 0.05, 0.02j], 13), (0.7, [0.3], 4)],
)
def test_a_sweep_divides_the_residual_by_the_edge_over_the_swing(ratio, harmonics, solved):
    system = BandSystem(scaled_problem(ratio, 0.1, harmonics))
    assert system.factorise(solved)
    system.begin()
    sizes = []
    for _ in range(4):
        sizes.append(np.linalg.norm(system.excess))
        system.sweep()
    assert sizes[0] > 1e-13
    falls = np.divide(sizes[:-1], sizes[1:])[np.array(sizes[1:]) > 1e-15]
    assert len(falls)
    assert falls.min() > system.nearest(solved) / system.swing


@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_stress(tolerance):
    """A hundred systems over the whole range: met or refused, and the bound holds."""
    rng = np.random.default_rng(17)
    ratios, refused = [], 0
    for _ in range(100):
        p = random_problem(rng, 40, largest=1.2, ratios=(0.1, 30.0))
        r = steady_state(p, tolerance)
        if r.stable is False:
            assert abs(r.floquet_multipliers[0]) >= 1
            continue
        reach = len(r.displacement) + 2 * len(p.stiffness_harmonics) + 20
        error = acceleration_error(r, balanced(p, reach))
        assert error <= r.error_bound + 1e-12
        refused += r.error_bound > tolerance
        ratios.append(r.error_bound / max(error, 1e-15))
    assert refused <= 1
    assert np.median(ratios) < 100


@pytest.mark.parametrize("zeta", [0.3, 0.02, 0.005])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0, 13.6])
def test_resonances_with_64_harmonics(ratio, zeta):
    j = np.arange(1, 65)
    rectangle = 0.13 * np.sin(j * math.pi * 0.412) / (j * math.pi * 0.588)
    r = steady_state(scaled_problem(ratio, zeta, rectangle))
    if not r.stable:
        assert abs(r.floquet_multipliers[0]) > 1
        return
    assert r.error_bound <= 1e-6
    exact = balanced(r.problem, 400)
    assert acceleration_error(r, exact) <= r.error_bound


def test_forces_and_harmonics_shown():
    p = scaled_problem(4.2, 0.05, [0.1, 0.03j, -0.02], force_harmonics=[300.0, 100j, 50.0, 20.0])
    found = direct.solve(p, 1e-10)
    *_, acceleration = periodic_solution(p, 64)
    r = steady_state(p, 1e-10)
    np.testing.assert_array_equal(r.displacement, found.displacement)
    times = p.period_s * np.arange(64) / 64
    limit = 1e-8 * np.abs(acceleration).max()
    np.testing.assert_allclose(r.at(times, "acceleration"), acceleration, atol=limit)
    for shown in (1, 4, 300):
        few = direct.solve(p, 1e-7, shown)
        assert len(few.displacement) == shown + 1
        assert few.bound <= 1e-7
        count = min(shown + 1, len(found.displacement))
        np.testing.assert_allclose(
            few.displacement[:count],
            found.displacement[:count],
            atol=1e-7 * np.abs(found.displacement[1:]).max(),
        )


@pytest.mark.parametrize("shown", [1, 2, 3])
def test_the_bound_is_relative_to_the_harmonics_that_are_shown(shown):
    """Without a sweep the absolute error is bounded alike, however many harmonics are shown."""
    p = scaled_problem(6.3, 0.02, [0.01, 0.03j, -0.02, 0.01, 0.02, 0.05])
    whole, part = direct.solve(p, 0.9), direct.solve(p, 0.9, shown)
    size = np.arange(len(whole.displacement)) ** 2 * np.abs(whole.displacement)
    assert np.linalg.norm(size[: shown + 1]) < 0.3 * np.linalg.norm(size)

    def absolute(found, count):
        """bound = error / (size - error)."""
        return np.linalg.norm(size[:count]) * found.bound / (1 + found.bound)

    assert absolute(part, shown + 1) == pytest.approx(absolute(whole, len(size)), rel=1e-6)


def test_pure_oscillating_force_needs_no_mean():
    p = scaled_problem(2.2, 0.1, [0.1], force_harmonics=[200.0 - 30j], force=0.0)
    r = steady_state(p, 1e-9)
    exact = balanced(p, 80)
    assert acceleration_error(r, exact) <= r.error_bound <= 1e-9


def test_peak_bounds_both_responses_at_all_frequencies():
    x = np.linspace(0, 10, 200_001)
    for zeta in (0.01, 0.3, 0.6, 0.8, 2.0):
        stiffness = np.abs(1 - x**2 + 2j * zeta * x)
        assert peak(zeta) >= (1 / stiffness).max() * (1 - 1e-12)
        assert peak(zeta) >= (x**2 / stiffness).max() * (1 - 1e-12)


def extreme(seed):
    rng = np.random.default_rng(seed)

    def power(low, high):
        return 10 ** rng.uniform(low, high)

    count = int(rng.integers(1, 12))
    c = rng.normal(size=count) + 1j * rng.normal(size=count)
    c *= power(-12, 0.5) / np.abs(c).sum()
    stiffness, ratio = power(-150, 150), power(-4, 3)
    mass = stiffness * power(-6, 6)
    w0 = math.sqrt(stiffness / mass)
    damping = 2 * power(-6, 4) * math.sqrt(stiffness) * math.sqrt(mass)
    force = stiffness * power(-80, 5) * rng.choice([-1, 0, 1], p=[0.2, 0.05, 0.75])
    return HillProblem(mass, damping, stiffness, c, 2 * math.pi * ratio / w0, force)


@given(st.integers(0, 2**32 - 1))
def test_extreme_numbers_neither_overflow_nor_warn(seed):
    p = extreme(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        r = steady_state(p)
    assert np.isfinite(r.displacement).all()
    assert r.error_bound >= 0
    if r.stable is False:
        assert math.isinf(r.error_bound)


def test_harmonics_next_to_nothing_change_nothing():
    r = steady_state(replace(published_pair(), stiffness_harmonics=[1e-320]))
    assert r.error_bound <= 1e-6
    assert abs(r.displacement[0] - 5e-6) < 1e-20


def test_a_heavy_mass_stands_still_and_a_tiny_one_is_refused():
    heavy = steady_state(replace(published_pair(), mass_kg=1e12))
    assert heavy.stable
    assert heavy.error_bound <= 1e-6
    with pytest.raises(ArgumentError, match=r"natural frequency is 7\.203e\+06 times"):
        steady_state(replace(published_pair(), mass_kg=1e-12))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mass_kg": 1e-300, "stiffness_n_per_m": 1e300}, "natural over mesh frequency"),
        ({"damping_ns_per_m": 1e300}, "damping ratio"),
        ({"force_n": 1e30}, "force over stiffness"),
    ],
)
def test_numbers_beyond_any_gear_are_refused(change, words):
    with pytest.raises(ArgumentError, match=words):
        replace(published_pair(), **change)
