import numpy as np
import pytest
from reference.hill_cases import scaled_problem

from gearmon.dynamics import steady_state
from gearmon.dynamics.fourier import Modulation, rms
from gearmon.dynamics.mesh_equations import least_residual


def equation_of(problem, highest):
    """K, and the right side of (1 + K) u = -phi."""
    stiffness = problem.dynamic_stiffness(highest)
    modulate = Modulation(problem.stiffness_harmonics, highest, highest)
    right = np.zeros(highest + 1, dtype=complex)
    right[1 : len(problem.stiffness_harmonics) + 1] = problem.stiffness_harmonics
    return lambda u: modulate(u / stiffness), right


def test_residual_falls_to_the_target():
    coupling, right = equation_of(scaled_problem(4.0, 0.005, [0.1, 0.05j]), 20)
    before, fewer = rms(right), 0
    for target in (1e-2, 1e-5, 1e-9):
        u, orders = least_residual(coupling, right, target * rms(right), 100)
        left = rms(right - u - coupling(u))
        assert left <= target * rms(right) * 1.01
        assert left < before
        assert orders > fewer
        before, fewer = left, orders


def test_no_combination_of_the_orders_is_better():
    coupling, right = equation_of(scaled_problem(4.0, 0.01, [0.2, 0.05j]), 15)
    orders = [right]
    for _ in range(3):
        orders.append(-coupling(orders[-1]))
    basis = np.array([(o + coupling(o)) for o in orders])
    weights = np.sqrt(np.r_[1.0, np.full(15, 2.0)])
    real = (weights * basis).view(float)
    shares = np.linalg.lstsq(real.T, (weights * right).view(float), rcond=None)[0]
    best = rms(right - shares @ basis)
    u, used = least_residual(coupling, right, 0.0, 4)
    assert used == 4
    assert rms(right - u - coupling(u)) == pytest.approx(best, rel=1e-8)


@pytest.mark.parametrize("size", [20, 40, 70])
def test_as_many_orders_are_kept_as_a_hard_equation_needs(size):
    """A real map of which all directions differ: the residual falls to nothing with the last."""
    generator = np.random.default_rng(size)
    full = generator.normal(size=(size, size)) / np.sqrt(size)
    right = generator.normal(size=size) + 0j

    def coupling(half):
        return (full @ half.real) + 0j

    u, orders = least_residual(coupling, right, 1e-9, 10 * size)
    direct = np.linalg.solve(np.eye(size) + full, right.real)
    assert orders > 0.8 * size
    np.testing.assert_allclose(u.real, direct, atol=1e-6 * np.abs(direct).max())


def test_it_ends_when_the_space_is_exhausted():
    coupling, right = equation_of(scaled_problem(2.0, 0.1, [0.1]), 4)
    u, orders = least_residual(coupling, right, 0.0, 100)
    assert rms(right - u - coupling(u)) < 1e-14 * rms(right)
    assert orders <= 10


def test_the_number_of_orders_is_limited():
    coupling, right = equation_of(scaled_problem(4.0, 0.005, [0.1, 0.05j]), 20)
    u, orders = least_residual(coupling, right, 1e-12, 3)
    assert rms(right - u - coupling(u)) > 1e-12
    assert orders == 3


def test_directions_do_not_grow_where_rounding_is_left():
    # beside a stiffness that hardly varies; once they grew beyond all numbers
    c = [
        -0.00018536126090865583 + 7.840086461792987e-05j,
        6.419297375842089e-06 + 1.496100177266749e-06j,
        3.7894736009424002e-06 + 8.767545993469313e-06j,
    ]
    r = steady_state(scaled_problem(43.946821818426784, 0.5752567034856342, c), 1e-13)
    assert r.method == "msm least residual"
    assert r.order < 20
    assert r.error_bound < 1e-11
