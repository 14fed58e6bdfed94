import math

import numpy as np
import pytest
from reference.hill_cases import random_problem, scaled_problem
from reference.hill_reference import period_map

from gearmon.dynamics import HillProblem
from gearmon.dynamics.amplitude_equations import free_vibration
from gearmon.errors import ArgumentError

PUBLISHED = [
    # w0, eps, h under k0 (1 + eps cos t); exact frequency; second order
    (3.3, 0.1, 0.0, 3.29788361, 3.29788904),
    (3.3, 0.2, 0.0, 3.29146788, 3.29155616),
    (3.3, 0.2, 0.05, 3.29108604, 3.29117737),
    (0.7, 0.1, 0.0, 0.69910633, 0.69910677),
]


def cosine(w0, eps, h):
    return HillProblem(1.0, 2 * h, w0**2, [eps / 2], 2 * math.pi, 0.0)


def distance_to_floquet(problem, exponent):
    """|lambda - mu| over both Floquet exponents mu, up to multiples of i w, per w0."""
    exact = np.log(np.linalg.eigvals(period_map(problem)).astype(complex)) / problem.period_s
    away = (exponent - exact) / problem.angular_frequency
    away -= 1j * np.rint(away.imag)
    return np.abs(away).min() / problem.frequency_ratio


@pytest.mark.parametrize(("w0", "eps", "h", "exact", "second_order"), PUBLISHED)
def test_published_frequencies(w0, eps, h, exact, second_order):
    p = cosine(w0, eps, h)
    second = free_vibration(p, 2, small_damping=True)
    # the second line of the source is rounded to the next digit but one
    assert second.exponent.imag == pytest.approx(second_order, abs=0.6e-8)
    assert free_vibration(p, 12).exponent.imag == pytest.approx(exact, abs=0.6e-8)
    assert free_vibration(p, 12).decay_per_s == pytest.approx(h, abs=1e-12)


def test_second_order_is_the_closed_form():
    c = np.array([0.05 + 0.02j, 0.03j, -0.04])
    p = scaled_problem(3.3, 0.02, c)
    w0 = 2 * math.pi * p.natural_frequency_hz
    found = free_vibration(p, 2, small_damping=True)
    n = np.arange(1, 4)
    shifts = -w0 * np.abs(c) ** 2 / (4 - (n / 3.3) ** 2)
    assert found.exponent.imag == pytest.approx(w0 * (1 - 0.02**2 / 2) + shifts.sum(), rel=1e-12)
    assert found.decay_per_s == pytest.approx(0.02 * w0, rel=1e-12)
    # D_1 A = -h A, D_2 A = i (shift) A
    np.testing.assert_allclose(found.rate_terms[:2, 0, 0], [1j * w0, -0.02 * w0], atol=1e-9 * w0)


def test_first_order_side_lines():
    p = scaled_problem(3.3, 0.0, [0.05 + 0.02j, 0.03j])
    e = free_vibration(p, 1)
    for n in (-2, -1, 1, 2):
        c = p.stiffness_harmonics[abs(n) - 1]
        c = c if n > 0 else c.conjugate()
        x = n / 3.3
        at = int(np.flatnonzero(e.lines == n)[0])
        assert e.shape_terms[1, at, 0] == pytest.approx(c / (x * (2 + x)), rel=1e-12)


@pytest.mark.parametrize(("ratio", "zeta"), [(1.37, 0.3), (3.3, 0.02), (0.6, 0.9), (1.3, 1.6)])
def test_exponents_converge_to_floquet(ratio, zeta):
    c = np.array([0.1, 0.05j, 0.03]) / max(1.0, ratio)
    p = scaled_problem(ratio, zeta, c)
    errors = [
        distance_to_floquet(p, free_vibration(p, 0, order).exponent) for order in (0, 4, 8, 16)
    ]
    assert errors[0] > 1e-4
    assert errors[1] < 0.2 * errors[0]
    assert errors[2] < 0.2 * errors[1]
    assert errors[3] < 1e-9


@pytest.mark.parametrize("small_damping", [False, True])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_exponent_error_falls_with_the_next_power(order, small_damping):
    sizes = np.array([0.02, 0.04, 0.08])
    c = np.array([0.4, 0.25 + 0.1j, 0.1])
    errors = []
    for size in sizes:
        zeta = 0.5 * size if small_damping else 0.1
        p = scaled_problem(3.3, zeta, size * c)
        found = free_vibration(p, 0, order, small_damping)
        errors.append(distance_to_floquet(p, found.exponent))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(order + 1, abs=0.2)


def test_overdamped_exponents_are_real():
    found = free_vibration(scaled_problem(1.3, 1.6, [0.1, 0.05j]), 6)
    exponents = found.exponents
    assert np.abs(exponents.imag).max() < 1e-9 * np.abs(exponents).max()
    assert found.frequency_hz == pytest.approx(0, abs=1e-6)
    assert found.exponent.real > found.rate[1, 1].real


def test_sum_of_exponents_is_the_damping():
    rng = np.random.default_rng(4)
    for _ in range(10):
        p = random_problem(rng, 5, largest=0.1, ratios=(0.3, 2.2), zetas=(0.05, 0.6))
        found = free_vibration(p, 6)
        w0 = 2 * math.pi * p.natural_frequency_hz
        assert np.trace(found.rate) == pytest.approx(-2 * p.damping_ratio * w0, rel=1e-9)


def test_refusals():
    with pytest.raises(ArgumentError, match="parametric_resonance"):
        free_vibration(scaled_problem(1.0, 0.0, [0.1, 0.1]), 2)
    with pytest.raises(ArgumentError, match="critical"):
        free_vibration(scaled_problem(1.2, 1.0, [0.1]), 2)
    with pytest.raises(ArgumentError, match="order=-1"):
        free_vibration(scaled_problem(1.2, 0.1, [0.1]), -1)
