"""Rivals converge at their order, meet what they are tuned to, and stand on the same equation."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.benchmark import rivals
from gearmon.benchmark.equations import CASES, growing_turn, solve_reference
from gearmon.benchmark.timing import Rival, about
from gearmon.dynamics import steady_state
from gearmon.dynamics.floquet import multipliers


@pytest.fixture(scope="module", params=["resonance 2w", "rectangle"])
def case(request):
    return CASES[request.param]()


@pytest.fixture(scope="module")
def reference(case):
    return solve_reference(case)


def test_scipy_meets_what_it_is_asked_for():
    case = CASES["resonance 2w"]()
    reference = solve_reference(case)
    motion, finer = (rivals.shooter(case, digits)() for digits in (5.0, 9.0))
    assert np.all(np.diff(motion.share) > 0)
    assert motion.share[0] == 0
    assert motion.share[-1] < 1
    assert reference.error(motion) < 1e-3
    assert reference.error(finer) < min(1e-6, 0.1 * reference.error(motion))


def test_table_of_cubics():
    case = CASES["64 harmonics"]()
    ratio, table = case.problem.frequency_ratio, rivals.table_of(case)
    period = 2 * np.pi * ratio
    time = period * np.random.default_rng(0).uniform(-2, 2, 50)
    phase = np.exp(1j * np.outer(time / ratio, np.arange(1, 65)))
    exact = 1 + 2 * (phase @ case.problem.stiffness_harmonics).real
    np.testing.assert_allclose(table(time * (table.x[-1] / period)), exact, rtol=1e-9)
    at = rivals.reader(table, period)
    np.testing.assert_allclose([at(t) for t in time], exact, rtol=1e-9)
    assert at(-1e-18) == pytest.approx(at(0.0))


def test_rectangle_jumps_at_quarters():
    levels = CASES["rectangle"]().level([-0.3, -0.2, 0.2, 0.3, 0.7, 0.8])
    np.testing.assert_allclose(levels, [0.87, 1.13, 1.13, 0.87, 0.87, 1.13])


def test_banded_balance():
    case = CASES["pair"]()
    reference = solve_reference(case)
    p = case.problem
    bands = rivals.band(p.stiffness_harmonics, 60)
    before = bands.copy()
    found = rivals.solve_band(bands, p.frequency_ratio, p.damping_ratio)
    assert reference.error(found) < 1e-12
    np.testing.assert_array_equal(bands, before)


def least_within(wanted, first, error_at, whole=0):
    """The least setting that is found, of a method whose error at a setting is known."""
    rival = Rival("some", "{}", about(first, whole), lambda n: lambda: n)
    return rival.tuned(wanted, lambda n: {"error": error_at(n)}).run()


@pytest.mark.parametrize("first", [5, 50])
def test_least_setting_is_the_least(first):
    assert least_within(0.1, first, lambda n: 3.0 / n, 1) == 30
    found = least_within(0.1, first, lambda n: 3.0 / n)
    assert 30 <= found < 30 * 1.04


def test_tuned_contender_meets_the_error():
    rival = Rival("some", "{:.1f} digits", about(7.0), lambda digits: lambda: 10**-digits)
    one = rival.tuned(1e-6, lambda motion: {"error": 40 * motion}, sets=3)
    assert 0.6e-6 < 40 * one.run() <= 1e-6
    assert (one.method, one.wanted, one.sets) == ("some", 1e-6, 3)


def test_tuned_steps_meet_the_error():
    steps = least_within(1e-6, 100.0, lambda n: (15.0 / n) ** 4, 4)
    assert steps % 4 == 0
    assert (15.0 / steps) ** 4 <= 1e-6
    assert steps < 1.05 * 15.0 / 1e-6**0.25


@pytest.mark.skipif(bool(rivals.NOT_COMPILED), reason="numba is not installed")
def test_compiled_loop_has_order_four(case, reference):
    p = case.problem
    errors = [
        reference.error(
            rivals.march_compiled(
                rivals.equal_steps(case, steps), p.frequency_ratio, p.damping_ratio
            )
        )
        for steps in (400, 800)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.15)


@pytest.mark.skipif(bool(rivals.NOT_COMPILED), reason="numba is not installed")
def test_compiled_loop_gives_velocities_of_its_accelerations():
    case = CASES["pair"]()
    steps, unit = rivals.equal_steps(case, 4000), 2 * np.pi * case.problem.frequency_ratio
    velocity, acceleration = rivals.shoot(*steps[1:], unit, 2 * case.problem.damping_ratio, 1.0)
    rate = 2j * np.pi * np.arange(2001) / unit
    found = np.fft.irfft(rate * np.fft.rfft(velocity), 4000)
    np.testing.assert_allclose(found, acceleration, atol=1e-6 * np.abs(acceleration).max())


def test_every_case_has_a_problem():
    for name in set(CASES) - {"hunting period"}:
        case = CASES[name]()
        assert case.problem.damping_ratio > 0
    assert CASES["cracked tooth"]().meshes == 26


def test_growing_turn_grows_in_proportion():
    sizes = [len(steady_state(growing_turn(meshes)).displacement) for meshes in (4, 16)]
    assert sizes[1] == pytest.approx(4 * sizes[0], rel=0.2)


def test_steps_that_all_meet_the_error_end_at_the_fewest():
    assert least_within(1.0, 20.0, lambda n: 1 / n, 4) == 4


@pytest.mark.parametrize("highest", [2, 5])
def test_the_band_matrix_multiplies_by_the_stiffness(highest):
    """Row n, column m holds c of n - m, of a real stiffness the conjugate below zero."""
    harmonics = np.array([0.2 + 0.1j, -0.05j, 0.01 + 0.3j])
    bands = rivals.band(harmonics, highest)
    width, count = len(bands) // 2, 2 * highest + 1
    dense = np.zeros((count, count), dtype=complex)
    for row in range(count):
        for column in range(max(0, row - width), min(count, row + width + 1)):
            dense[row, column] = bands[width + row - column, column]
    known = np.zeros(2 * count, dtype=complex)
    known[1 : 1 + len(harmonics)] = harmonics
    known[-1 : -1 - len(harmonics) : -1] = harmonics.conj()
    places = np.arange(count)
    np.testing.assert_array_equal(dense, known[np.subtract.outer(places, places)])
    # what LAPACK takes beside the lines themselves: as many again as lie to one side
    filled = np.zeros((3 * width + 1, count), dtype=complex)
    assert rivals.banded_bytes(len(harmonics), highest) == filled.nbytes


@pytest.mark.skipif(bool(rivals.NOT_COMPILED), reason="numba is not installed")
@pytest.mark.parametrize("zeta", [0.0, 0.03, 0.2])
def test_growth_is_that_of_the_larger_multiplier(zeta):
    """Of k = 1 + eps cos(w t), damped and not, where it is stable and where it is not."""
    ratios, variations = np.meshgrid([0.4, 0.53, 0.9, 1.3], [0.0, 0.3, 0.8], indexing="ij")
    values = np.cos(2 * np.pi * np.arange(2 * 600 + 1) / (2 * 600))
    found = rivals.growth(ratios, variations, zeta, values)
    known = [
        np.log(abs(multipliers(ratio, zeta, np.array([0.5 * eps + 0j]), 1e-12)[0]))
        for ratio, eps in zip(ratios.ravel(), variations.ravel(), strict=True)
    ]
    np.testing.assert_allclose(found.ravel(), known, atol=1e-7)
    assert (found > 0.1).any() == (zeta < 0.2)
