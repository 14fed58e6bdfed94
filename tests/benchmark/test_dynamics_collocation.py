"""The reference of the dynamics benchmark against closed forms, shooting and refined balance."""

from __future__ import annotations

import numpy as np
import pytest
from reference.exact_pieces import PiecewiseProblem, solve_exactly
from reference.hill_cases import random_problem
from reference.hill_reference import periodic_solution
from reference.refined_balance import refined_balance

from gearmon.benchmark.equations import (
    CASES,
    Case,
    Lines,
    Samples,
    as_lines,
    folded,
    pair,
    rule,
    solve_reference,
    square_wave,
)
from gearmon.dynamics import steady_state


def case_of(problem):
    return Case(problem=problem)


def unit_acceleration(problem):
    """w0^2 F/k0 [m/s2]."""
    return problem.force_n / problem.mass_kg


def test_rule_integrates_polynomials():
    r = rule(5)
    for power in range(5):
        np.testing.assert_allclose(
            r.integral @ r.nodes**power, r.nodes ** (power + 1) / (power + 1)
        )
    for power in range(10):
        assert r.weights @ r.nodes**power == pytest.approx(1 / (power + 1))


@pytest.mark.parametrize("seed", range(3))
def test_against_shooting_in_time(seed):
    problem = random_problem(np.random.default_rng(seed), ratios=(0.3, 6.0), zetas=(0.01, 1.0))
    reference = solve_reference(case_of(problem))
    _, _, acceleration = periodic_solution(problem, 64)
    samples = Samples(np.arange(64) / 64, acceleration / unit_acceleration(problem))
    assert reference.error(samples) < 2e-10  # what shooting reaches


@pytest.mark.parametrize("seed", range(4))
def test_against_balance_in_extended_precision(seed):
    problem = random_problem(np.random.default_rng(seed), zetas=(0.003, 1.0))
    exact = refined_balance(problem)
    assert exact.uncertainty < 1e-17
    found = solve_reference(case_of(problem)).error(Lines(exact.displacement.astype(complex)))
    assert found < 1e-12


def test_true_rectangle_against_exact_pieces():
    case = CASES["rectangle"]()
    share = np.arange(400) / 400  # with samples on the jumps
    p = case.problem
    known = p.mass_kg, p.damping_ns_per_m, p.stiffness_n_per_m, case.rectangle, 0.5
    true = PiecewiseProblem.rectangular(*known, p.period_s, p.force_n)
    acceleration = solve_exactly(true).at(share * p.period_s, "acceleration")
    samples = Samples(share, acceleration / unit_acceleration(case.problem))
    assert solve_reference(case).error(samples) < 1e-12


def test_error_of_a_known_fault():
    """A line wrong by a hundredth of the whole is an error of a hundredth."""
    case = CASES["pair"]()
    reference = solve_reference(case)
    good = as_lines(steady_state(case.problem, 1e-11)).displacement.copy()
    orders = np.arange(len(good))
    size = np.sqrt(2 * (np.abs((orders / reference.ratio) ** 2 * good) ** 2).sum())
    assert reference.size == pytest.approx(size, rel=1e-9)
    good[2] += 0.01 * size / np.sqrt(2) / (2 / reference.ratio) ** 2
    assert reference.error(Lines(good)) == pytest.approx(0.01, rel=1e-6)


def test_unevenly_sampled_error():
    case = CASES["pair"]()
    reference = solve_reference(case)
    share = np.sort(np.random.default_rng(3).random(700))
    response = steady_state(case.problem, 1e-11)
    acceleration = response.at(share * case.problem.period_s, "acceleration")
    acceleration /= unit_acceleration(case.problem)
    assert reference.error(Samples(share, acceleration)) < 1e-10
    assert reference.error(Samples(share, 1.01 * acceleration)) == pytest.approx(0.01, rel=0.1)


def test_decay_rate():
    reference = solve_reference(CASES["pair"]())
    assert reference.decay_rate == pytest.approx(0.300669, abs=1e-6)  # damping ratio


def test_a_long_period_does_not_underflow():
    problem = pair(square_wave(2), zeta=3.0, ratio=300.0)
    assert 0.1 < solve_reference(case_of(problem)).decay_rate < 0.2


def test_folding_samples_any_number_of_harmonics():
    rng = np.random.default_rng(0)
    half = rng.normal(size=23) + 1j * rng.normal(size=23)
    half[0] = half[0].real
    long = np.fft.irfft(half, 60, norm="forward")
    np.testing.assert_allclose(folded(half, 60), long, atol=1e-12)
    np.testing.assert_allclose(folded(half, 12), long[::5], atol=1e-12)
