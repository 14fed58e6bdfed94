import cmath
import math

import numpy as np
import pytest
from reference.hill_cases import random_problem, scaled_problem
from reference.hill_reference import period_map
from scipy.special import mathieu_a, mathieu_b

from gearmon.dynamics import error_bound
from gearmon.dynamics.floquet import multipliers


@pytest.mark.parametrize("seed", range(6))
def test_multipliers_match_time_integration(seed):
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 12, ratios=(0.2, 6.0), zetas=(1e-3, 0.1))
    exact = np.linalg.eigvals(period_map(problem))
    found = multipliers(problem.frequency_ratio, problem.damping_ratio, problem.stiffness_harmonics)
    for value in found:
        assert np.abs(exact - value).min() < 1e-7 * abs(value)


@pytest.mark.parametrize(
    ("w0", "eps", "h", "frequency", "second_order"),
    [
        (3.3, 0.1, 0.0, 3.29788361, 3.29788904),
        (3.3, 0.2, 0.0, 3.29146788, 3.29155616),
        (3.3, 0.2, 0.05, 3.29108604, 3.29117737),
        (0.7, 0.1, 0.0, 0.69910633, 0.69910677),
    ],
)
def test_free_frequency_under_a_cosine(w0, eps, h, frequency, second_order):
    # w = 1, k = k0 (1 + eps cos t); published exponents and their second-order expansion
    first, _ = multipliers(w0, h / w0, np.array([eps / 2 + 0j]), tolerance=1e-12)
    angle = abs(cmath.phase(first)) / (2 * math.pi)
    nearest = min((abs(n + s * angle - w0), n + s * angle) for n in range(5) for s in (-1, 1))[1]
    assert nearest == pytest.approx(frequency, abs=6e-9)
    series = w0 - h**2 / (2 * w0) - eps**2 * w0**3 * 0.25 / (4 * w0**2 - 1)
    assert series == pytest.approx(second_order, abs=1.1e-8)


@pytest.mark.parametrize("eps", [0.05, 0.1, 0.2, 0.4])
def test_principal_tongue_of_mathieu(eps):
    edges = {
        0.05: (1.974923167, 2.024920721),
        0.1: (1.949698438, 2.049678773),
        0.2: (1.898848110, 2.098687561),
        0.4: (1.795989323, 2.194599747),
    }[eps]
    for edge, inwards in zip(edges, (1, -1), strict=True):
        for side in (-1, 1):
            omega = edge + side * inwards * 2e-8
            size = abs(multipliers(1 / omega, 0.0, np.array([eps / 2 + 0j]), 1e-13)[0])
            assert (size > 1 + 1e-6) == (side > 0)


@pytest.mark.parametrize(
    ("function", "order", "q"),
    [
        (mathieu_a, 1, 0.3),
        (mathieu_a, 1, 1.0),
        (mathieu_b, 1, 0.3),
        (mathieu_a, 2, 1.0),
        (mathieu_b, 2, 1.0),
        (mathieu_b, 2, 2.5),
    ],
)
def test_boundaries_of_mathieu(function, order, q):
    # a = 4 R^2, q = 2 R^2 eps: on the boundaries the trace of the period map is +-2
    a = float(function(order, q))
    ratio = math.sqrt(a) / 2
    eps = q / (2 * ratio**2)
    first, second = multipliers(ratio, 0.0, np.array([eps / 2 + 0j]), 1e-13)
    assert (first + second).real == pytest.approx((-1) ** order * 2, abs=1e-7)


@pytest.mark.parametrize(
    ("duty", "eps", "edges"),
    [
        (0.5, 0.13, [(1.916507, 2.081913), (0.993654, 1.002099), (0.656588, 0.674168)]),
        (0.412, 0.13, [(1.931515, 2.067451), (0.992041, 1.005049), (0.659347, 0.672215)]),
        (0.5, 0.3, [(1.805814, 2.186257), (0.966032, 1.010882), (0.643444, 0.675744)]),
    ],
)
def test_tongues_of_meissner(duty, eps, edges):
    n = np.arange(1, 401)
    c = eps * np.sin(n * math.pi * duty) / (n * math.pi * (1 - duty)) + 0j
    for low, high in edges:
        for edge, inwards in ((low, 1), (high, -1)):
            for side in (-1, 1):
                omega = edge + side * inwards * 6e-6
                size = abs(multipliers(1 / omega, 0.0, c, 1e-10)[0])
                assert (size > 1 + 1e-6) == (side > 0)


def test_product_of_multipliers_is_the_damping():
    rng = np.random.default_rng(5)
    for _ in range(20):
        p = random_problem(rng, 8, zetas=(1e-3, 0.5), ratios=(0.1, 5.0))
        first, second = multipliers(p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics)
        decay = 4 * math.pi * p.damping_ratio * p.frequency_ratio
        assert first * second == pytest.approx(math.exp(-decay), rel=1e-9)
        assert abs(first) >= abs(second)


def test_running_products_do_not_overflow():
    grow = np.zeros((2, 2, 3008, 1))
    grow[0, 0], grow[1, 1] = 3.0, 1 / 3
    products, logs = error_bound.running_products(grow)
    assert np.isfinite(products).all()
    assert logs[-1, 0] + math.log(products[0, 0, -1, 0]) == pytest.approx(3008 * math.log(3))


def test_multipliers_of_a_response_are_reported():
    from gearmon.dynamics import steady_state

    problem = scaled_problem(0.5, 0.01, [0.1])
    response = steady_state(problem)
    assert response.stable is False
    assert abs(response.floquet_multipliers[0]) == pytest.approx(
        abs(np.linalg.eigvals(period_map(problem))).max(), rel=1e-7
    )
