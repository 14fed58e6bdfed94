import numpy as np
import pytest
from reference.hill_cases import scaled_problem

from gearmon.dynamics import steady_state
from gearmon.dynamics.fourier import Modulation, rms
from gearmon.dynamics.mesh_equations import LeastResidual


def space_of(problem, highest, most=100):
    stiffness = problem.dynamic_stiffness(highest)
    modulate = Modulation(problem.stiffness_harmonics, highest, highest)
    right = np.zeros(highest + 1, dtype=complex)
    right[1 : len(problem.stiffness_harmonics) + 1] = problem.stiffness_harmonics
    return LeastResidual(lambda u: modulate(u / stiffness), right, most), right


def test_residual_is_the_one_it_claims_and_falls():
    space, right = space_of(scaled_problem(4.0, 0.005, [0.1, 0.05j]), 20)
    before = rms(right)
    for target in (1e-2, 1e-5, 1e-9):
        assert space.extend(target * rms(right))
        u = space.solution()
        left = rms(right - u - space.coupling(u))
        assert left == pytest.approx(space.residual, rel=1e-4, abs=1e-14)
        assert left <= target * rms(right) * 1.01
        assert left < before
        before = left


def test_no_combination_of_the_orders_is_better():
    problem = scaled_problem(4.0, 0.01, [0.2, 0.05j])
    space, right = space_of(problem, 15)
    orders = [right]
    for _ in range(3):
        orders.append(-space.coupling(orders[-1]))
    basis = np.array([(o + space.coupling(o)) for o in orders])
    weights = np.sqrt(np.r_[1.0, np.full(15, 2.0)])
    real = (weights * basis).view(float)
    shares = np.linalg.lstsq(real.T, (weights * right).view(float), rcond=None)[0]
    best = rms(right - shares @ basis)
    for _ in range(4):
        space._add()
    assert space.residual == pytest.approx(best, rel=1e-8)


def test_it_ends_when_the_space_is_exhausted():
    space, right = space_of(scaled_problem(2.0, 0.1, [0.1]), 4)
    assert space.extend(0.0) or space.residual < 1e-14 * rms(right)
    assert space.orders <= 10


def test_the_number_of_orders_is_limited():
    space, _ = space_of(scaled_problem(4.0, 0.005, [0.1, 0.05j]), 20, most=3)
    assert not space.extend(1e-12)
    assert space.orders == 3


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
