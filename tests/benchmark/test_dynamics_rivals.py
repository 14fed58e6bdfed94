"""Rivals converge at their order, meet what they are tuned to, and stand on the same equation."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.benchmark import rivals
from gearmon.benchmark.equations import CASES, growing_turn, named_case, solve_reference
from gearmon.dynamics import steady_state
from gearmon.errors import ArgumentError


@pytest.fixture(scope="module", params=["resonance 2w", "rectangle"])
def case(request):
    return named_case(request.param)


@pytest.fixture(scope="module")
def reference(case):
    return solve_reference(case)


@pytest.mark.parametrize("solver", rivals.SOLVERS)
def test_scipy_from_rest(case, reference, solver):
    oscillator = rivals.Oscillator(case)
    loose, tight = 1e-6, 1e-9
    motion = rivals.integrate(oscillator, solver, loose, settling=reference.settling(1e-4))
    assert np.all(np.diff(motion.share) > 0)
    assert motion.share[0] >= 0
    assert motion.share[-1] < 1
    assert reference.error(motion) < 1e-3
    finer = rivals.integrate(oscillator, solver, tight, settling=reference.settling(1e-7))
    assert reference.error(finer) < 0.1 * reference.error(motion)


def test_shooting(case, reference):
    assert reference.error(rivals.shoot(rivals.Oscillator(case), 1e-9)) < 1e-6


def test_table_of_cubics():
    case = named_case("64 harmonics")
    oscillator = rivals.Oscillator(case)
    time = oscillator.period * np.random.default_rng(0).uniform(-2, 2, 50)
    orders = np.arange(1, 65)
    phase = np.exp(1j * np.outer(time / oscillator.ratio, orders))
    exact = 1 + 2 * (phase @ case.problem.stiffness_harmonics).real
    np.testing.assert_allclose(oscillator.stiffness_at(time), exact, rtol=1e-9)
    np.testing.assert_allclose([oscillator.stiffness(t) for t in time], exact, rtol=1e-9)
    assert oscillator.stiffness(-1e-18) == pytest.approx(oscillator.stiffness(0.0))


def test_plain_right_side_is_the_same_equation():
    case = named_case("pair")
    state = np.array([1.1, -0.3])
    for time in (0.0, 1.3, -7.0):
        plain = rivals.PlainOscillator(case).slope(None)(time, state)
        assert plain == pytest.approx(rivals.Oscillator(case).slope(None)(time, state), rel=1e-8)


def test_stretches_end_at_the_jumps():
    oscillator = rivals.Oscillator(named_case("rectangle"))
    period = oscillator.period
    found = list(oscillator.stretches(-0.6 * period, period))
    edges = [left / period for left, _, _ in found]
    np.testing.assert_allclose(edges, [-0.6, -0.25, 0.25, 0.75], atol=1e-12)
    np.testing.assert_allclose([kappa for *_, kappa in found], [0.87, 1.13, 0.87, 1.13])


def test_banded_balance():
    case = named_case("pair")
    reference = solve_reference(case)
    p = case.problem
    bands = rivals.band(p.stiffness_harmonics, 60)
    before = bands.copy()
    found = rivals.solve_band(bands, p.frequency_ratio, p.damping_ratio)
    assert reference.error(found) < 1e-12
    np.testing.assert_array_equal(bands, before)


@pytest.mark.parametrize("first", [5, 50])
def test_least_setting_is_the_least(first):
    assert rivals.least_within(0.1, first, lambda n: 3.0 / n, 1) == 30
    found = rivals.least_within(0.1, first, lambda n: 3.0 / n)
    assert 30 <= found < 30 * 1.04


def test_tuned_tolerance_meets_the_error():
    class Error:
        def error(self, motion):
            return 40 * motion

    found = rivals.tolerance_within(1e-6, lambda tolerance: tolerance, Error())
    assert 0.6e-6 < 40 * found <= 1e-6


def test_tuned_steps_meet_the_error():
    steps = rivals.least_within(1e-6, 100.0, lambda n: (15.0 / n) ** 4, 4)
    assert steps % 4 == 0
    assert (15.0 / steps) ** 4 <= 1e-6
    assert steps < 1.05 * 15.0 / 1e-6**0.25


@pytest.mark.skipif(not rivals.numba_is_installed(), reason="numba is not installed")
def test_compiled_loop_has_order_four(case, reference, monkeypatch):
    p = case.problem
    settling = reference.settling(1e-12)
    errors = []
    for steps in (400, 800):
        table = rivals.tables(case, steps)
        known = (table, p.frequency_ratio, p.damping_ratio)
        monkeypatch.setattr(rivals, "shooting_periods", lambda: np.inf)
        errors.append(reference.error(rivals.march_compiled(*known, settling)))
        monkeypatch.setattr(rivals, "shooting_periods", lambda: 0.0)
        shot = reference.error(rivals.march_compiled(*known, settling))
        assert shot == pytest.approx(errors[-1], rel=0.05)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.15)


def test_every_case_has_a_problem():
    for name in set(CASES) - {"hunting period"}:
        case = named_case(name)
        assert case.name == name
        assert case.problem.damping_ratio > 0
    assert named_case("cracked tooth").meshes == 26


def test_unknown_case_is_refused():
    with pytest.raises(ArgumentError, match="case 'x' must be one of: pair"):
        named_case("x")
    with pytest.raises(ArgumentError, match="no rectangle"):
        named_case("pair").relative_stiffness(0.1)


def test_growing_turn_grows_in_proportion():
    sizes = [len(steady_state(growing_turn(meshes)).displacement) for meshes in (4, 16)]
    assert sizes[1] == pytest.approx(4 * sizes[0], rel=0.2)


def test_steps_that_all_meet_the_error_end_at_the_fewest():
    assert rivals.least_within(1.0, 20.0, lambda n: 1 / n, 4) == 4
