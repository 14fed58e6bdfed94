import math
from dataclasses import replace

import numpy as np
import pytest
from reference.hill_cases import published_pair, scaled_problem
from reference.hill_reference import harmonic_balance

from gearmon.dynamics import steady_state
from gearmon.dynamics.multiple_scales import expand
from gearmon.errors import ArgumentError


def test_published_pair_to_second_order():
    p = published_pair()
    z = expand(p, 2).displacement
    assert z[0].real == pytest.approx(5.082153e-6, abs=5e-13)
    amplitude = 2 * np.abs(z)
    first = {1: 8.3128e-7, 3: 2.8718e-7, 5: 1.8539e-7, 7: 1.4818e-7, 13: 1.0957e-7}
    for n, size in first.items():
        assert amplitude[n] == pytest.approx(size, abs=0.6e-11)
    assert amplitude[2] == pytest.approx(5.006e-9, abs=0.6e-12)
    assert amplitude[12] == pytest.approx(2.533e-8, abs=0.6e-11)


def test_first_two_orders_in_closed_form():
    p = scaled_problem(3.7, 0.1, [0.1 + 0.02j, -0.03j])
    terms = expand(p, 2).terms
    c, d = p.stiffness_harmonics, p.dynamic_stiffness(4)
    still = p.force_n / p.stiffness_n_per_m
    np.testing.assert_allclose(terms[1][1:3], -still * c / d[1:3], rtol=1e-12)
    mean = 2 * still * sum((abs(c[n - 1]) ** 2 / d[n]).real for n in (1, 2))
    assert terms[2][0].real == pytest.approx(mean, rel=1e-12)


def test_waveform_error_of_the_published_pair():
    p = published_pair()
    exact = harmonic_balance(p, 150)
    time = np.arange(400) / 400
    phase = np.exp(2j * math.pi * time[:, None] * np.arange(151))
    for order, error in ((1, 0.033), (2, 0.0051)):
        z = np.zeros(151, dtype=complex)
        found = expand(p, order).displacement
        z[: len(found)] = found
        difference, whole = exact - z, exact.copy()
        difference[0] /= 2
        whole[0] /= 2
        wave = 2 * (phase @ whole).real
        largest = np.abs(2 * (phase @ difference).real).max() / wave.max()
        assert largest == pytest.approx(error, rel=0.03)


@pytest.mark.parametrize("ratio", [0.7, 2.0, 3.0, 5.3])
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_error_falls_with_the_next_power_of_the_variation(ratio, order):
    # 2.0 and 3.0 are resonances: a harmonic of the mesh lies on the natural frequency
    p = scaled_problem(ratio, 0.1, [1.0, 0.4j, -0.3])
    sizes = np.array([0.002, 0.004, 0.008])
    errors = []
    for size in sizes:
        small = replace(p, stiffness_harmonics=size * p.stiffness_harmonics)
        exact = harmonic_balance(small, 30)
        z = np.zeros(31, dtype=complex)
        found = expand(small, order, highest=30).displacement
        z[: len(found)] = found
        errors.append(np.linalg.norm(exact - z))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(order + 1, abs=0.1)


@pytest.mark.parametrize("ratio", [0.7, 2.4, 3.3])
@pytest.mark.parametrize("order", [0, 1, 2, 3, 4])
def test_small_damping_error_falls_with_the_next_power(ratio, order):
    shape = scaled_problem(ratio, 0.5, [0.5, 0.2j, -0.15], [400.0])
    sizes = np.array([0.005, 0.01, 0.02])
    errors = []
    for size in sizes:
        small = replace(
            shape,
            stiffness_harmonics=size * shape.stiffness_harmonics,
            damping_ns_per_m=size * shape.damping_ns_per_m,
        )
        exact = harmonic_balance(small, 30)
        found = expand(small, order, highest=30, small_damping=True).displacement
        errors.append(np.linalg.norm(exact - found))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(order + 1, abs=0.1)


def test_small_damping_moves_damping_one_order_up():
    p = scaled_problem(3.3, 0.02, [0.1j])
    terms = expand(p, 2, small_damping=True).terms
    stiffness = 1 - (1 / 3.3) ** 2
    still = p.force_n / p.stiffness_n_per_m
    assert terms[1][1] == pytest.approx(-still * 0.1j / stiffness, rel=1e-12)
    damped = -2j * 0.02 / 3.3 * terms[1][1] / stiffness
    assert terms[2][1] == pytest.approx(damped, rel=1e-12)


def test_secular_terms_are_refused():
    p = scaled_problem(1.0, 0.0, [0.1])
    p = replace(p, mass_kg=1.0, stiffness_n_per_m=(2 * math.pi) ** 2, period_s=1.0)
    with pytest.raises(ArgumentError, match=r"forced_resonance\(problem, lines=\[1\]\)"):
        expand(p, 1)
    with pytest.raises(ArgumentError, match="order=-1"):
        expand(published_pair(), -1)


def test_other_variation_is_a_substitution():
    p = scaled_problem(3.3, 0.2, [0.1, 0.05])
    doubled = replace(p, stiffness_harmonics=1.7 * p.stiffness_harmonics)
    np.testing.assert_allclose(
        expand(p, 4).substitute(variation=1.7),
        expand(doubled, 4).displacement,
        rtol=1e-12,
        atol=1e-25,
    )


def test_orders_reach_their_harmonics_and_no_further():
    p = scaled_problem(3.3, 0.2, [0.1, 0.05])
    terms = expand(p, 3).terms
    assert terms.shape == (4, 7)
    for order, term in enumerate(terms):
        assert np.abs(term[2 * order + 1 :]).max(initial=0) < 1e-14 * np.abs(term).max()


def test_plain_sum_converges_slowly_diverges_and_says_so():
    converging = steady_state(published_pair(), 1e-6, method="msm")
    assert converging.method == "msm"
    assert converging.error_bound < 1e-6
    diverging = steady_state(scaled_problem(4.0, 0.005, [0.15, 0.1]), 1e-6, method="msm")
    assert diverging.error_bound > 1e-6
    assert "misses" in diverging.message or "no error bound" in diverging.message


@pytest.mark.parametrize(("order", "error"), [(1, 2e-1), (2, 4e-2), (3, 8e-3), (4, 2e-3)])
def test_errors_of_the_rectangle_by_order(order, error):
    # 30 harmonics of a rectangle of duty 0.412
    n = np.arange(1, 31)
    c = 0.13 * np.sin(n * math.pi * 0.412) / (n * math.pi * 0.588)
    p = replace(published_pair(), stiffness_harmonics=c + 0j)
    r = steady_state(p, method="msm", order=order)
    assert error / 2.5 < r.error_bound < 2.5 * error
