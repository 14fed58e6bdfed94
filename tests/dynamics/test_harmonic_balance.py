import numpy as np
import pytest
from reference.hill_cases import balanced, published_pair, random_problem, scaled_problem
from reference.hill_reference import harmonic_balance as slow
from reference.hill_reference import periodic_solution

from gearmon.dynamics import steady_state
from gearmon.errors import ArgumentError


def test_published_pair():
    z = balanced(published_pair(), 200)
    amplitude = 2 * np.abs(z)
    exact = {
        1: 8.4559e-7,
        3: 2.9217e-7,
        5: 1.8862e-7,
        7: 1.5056e-7,
        13: 1.0597e-7,
    }
    assert z[0].real == pytest.approx(5.083524e-6, abs=5e-13)
    for n, size in exact.items():
        assert amplitude[n] == pytest.approx(size, abs=0.6e-11)
    assert amplitude[2] == pytest.approx(5.182e-9, abs=0.6e-12)
    assert amplitude[12] == pytest.approx(2.486e-8, abs=0.6e-11)


def test_published_waveform():
    r = steady_state(published_pair(), 1e-9, method="harmonic balance")
    wave = r.at(np.arange(4000) / 4000 * 1.6e-3)
    assert wave.min() == pytest.approx(3.9045e-6, abs=1e-10)
    assert wave.max() == pytest.approx(6.2005e-6, abs=1e-10)
    assert (wave - wave.mean()).std() == pytest.approx(0.67721e-6, abs=1e-11)
    lines = 2 * np.abs(r.acceleration)
    assert lines.argmax() == 13
    assert lines.max() == pytest.approx(276.2, abs=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_matches_the_matrix_written_element_by_element(seed):
    p = random_problem(np.random.default_rng(seed), 10)
    np.testing.assert_allclose(balanced(p, 40), slow(p, 40), rtol=1e-10, atol=1e-20)


def test_banded_and_dense_agree():
    p = scaled_problem(60.0, 0.02, [0.1, 0.05j, 0.02])
    np.testing.assert_allclose(balanced(p, 200), slow(p, 200), atol=1e-16)


@pytest.mark.parametrize("seed", range(3))
def test_against_time_integration(seed):
    p = random_problem(np.random.default_rng(seed + 20), 5, ratios=(0.5, 6), zetas=(0.01, 0.3))
    r = steady_state(p, 1e-9, method="harmonic balance")
    *_, exact = periodic_solution(p, 96)
    found = r.at(p.period_s * np.arange(96) / 96, "acceleration")
    assert np.linalg.norm(found - exact) < 1e-6 * np.linalg.norm(exact)
    assert r.order == 0


def test_matrices_too_large_for_memory_are_refused():
    p = scaled_problem(300.0, 0.05, np.full(3000, 1e-5))
    with pytest.raises(ArgumentError, match="GB; use method='auto'"):
        balanced(p, 20_000)
