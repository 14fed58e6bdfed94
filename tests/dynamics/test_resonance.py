import math

import numpy as np
import pytest
from reference.hill_cases import scaled_problem
from reference.hill_reference import harmonic_balance

from gearmon.dynamics.amplitude_equations import (
    amplitude_equations,
    forced_resonance,
    free_vibration,
    parametric_resonance,
)
from gearmon.dynamics.floquet import multipliers
from gearmon.dynamics.multiple_scales import expand
from gearmon.errors import ArgumentError

SHAPE = np.array([0.5, 0.2j, -0.15])

# (ratio, zeta, harmonics, force harmonics) as functions of the small parameter
FORCED = {
    "n w = w0, n = 1": lambda e: scaled_problem(1 + 0.4 * e, 0.5 * e, e * SHAPE),
    "n w = w0, n = 3": lambda e: scaled_problem(3 + 0.4 * e, 0.5 * e, e * SHAPE),
    "with a force": lambda e: scaled_problem(2 - 0.3 * e, 0.4 * e, e * SHAPE, [300.0, 2e3j * e]),
    "n + m with w0": lambda e: scaled_problem(4 + 0.4 * e**2, 0.5 * e**2, [0.5 * e, 0, -0.3j * e]),
    "n - m with w0": lambda e: scaled_problem(2 + 0.4 * e**2, 0.5 * e**2, [0.3 * e, 0, -0.3j * e]),
    "finite damping": lambda e: scaled_problem(3.0, 0.05, e * SHAPE),
}


def error_of_steady_state(problem, found):
    exact = harmonic_balance(problem, 30)
    exact[: len(found)] -= found[:31]
    return np.abs(exact).max()


# damping that does not vanish with the variation is not small
CASES = [(case, small) for case in FORCED for small in (False, True)]
CASES.remove(("finite damping", True))


@pytest.mark.parametrize(("case", "small_damping"), CASES)
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_error_falls_with_the_next_power(case, order, small_damping):
    sizes = np.array([0.005, 0.01, 0.02])
    errors = []
    for size in sizes:
        p = FORCED[case](size)
        found = forced_resonance(p, order, small_damping=small_damping)
        errors.append(error_of_steady_state(p, found.steady_displacement()))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(order + 1, abs=0.1)


def test_first_order_amplitude_in_closed_form():
    # a = eps w0 delta c_n / (2 sqrt(h^2 + (n w - w0)^2)), real amplitude eps c_n = 2 |c_2|
    p = scaled_problem(2.03, 0.01, [0.1, 0.04j])
    e = forced_resonance(p, 0, rate_order=1, small_damping=True)
    w0 = 2 * math.pi * p.natural_frequency_hz
    still = p.force_n / p.stiffness_n_per_m
    amplitude = 2 * abs(e.steady_amplitudes()[0])
    distance = math.hypot(0.01 * w0, 2 * p.angular_frequency - w0)
    assert amplitude == pytest.approx(0.08 * w0 * still / (2 * distance), rel=1e-12)


def test_half_way_between_two_lines_both_are_taken():
    p = scaled_problem(3.5, 0.01, [0.04, 0.03j, 0.01])
    errors = [
        error_of_steady_state(p, forced_resonance(p, order).steady_displacement())
        for order in range(5)
    ]
    assert [n for _, n in forced_resonance(p, 0).slow] == [3, -3, 4, -4]
    assert (np.array(errors[1:]) < 0.2 * np.array(errors[:-1])).all()
    # line 3 alone would share its frequency with that of opposite sign on line 4
    with pytest.raises(ArgumentError, match="same frequency"):
        forced_resonance(scaled_problem(3.5, 0.0, [0.04]), 2, [3])


def test_odd_harmonics_with_ratio_sixteen():
    # no harmonic is resonant by itself, products c_1 c_15, c_3 c_13, ... are: b starts at order two
    c = 0.02 * np.where(np.arange(1, 16) % 2, 1.0, 0.0) / np.arange(1, 16)
    p = scaled_problem(16.0, 0.002, c)
    forcing = np.abs(forced_resonance(p, 0, [16], rate_order=3).rate_terms[:, 0, -1])
    assert (forcing[:2] < 1e-14 * forcing[2]).all()
    coupling = np.abs(parametric_resonance(p, 0, rate_order=3).rate_terms[:, 0, 1])
    assert not coupling.any()


@pytest.mark.parametrize("detuning", [-0.06, -0.02, 0.0, 0.02, 0.06])
def test_principal_parametric_growth(detuning):
    # |n w - 2 w0| < 2 sqrt((eps w0 c_n/4)^2 - h^2) with eps c_n = 0.1, h = 0.01 w0
    p = scaled_problem(1 / (2 + detuning), 0.01, [0.05])
    w0 = 2 * math.pi * p.natural_frequency_hz
    first = parametric_resonance(p, 0, rate_order=1, small_damping=True)
    inside = abs(detuning) < 2 * math.sqrt(0.025**2 - 0.01**2)
    assert (first.growth_per_s > 0) == inside
    if abs(detuning) < 0.05:
        growth = math.sqrt(0.025**2 - detuning**2 / 4) - 0.01
        assert first.growth_per_s == pytest.approx(growth * w0, rel=1e-9)
    exact = math.log(abs(multipliers(p.frequency_ratio, 0.01, p.stiffness_harmonics, 1e-12)[0]))
    high = parametric_resonance(p, 0, rate_order=8)
    assert high.growth_per_s * p.period_s == pytest.approx(exact, abs=2e-9)


def test_second_order_parametric_growth():
    # harmonics 1 and 4 together feed line 5
    p = scaled_problem(2.5, 0.0, [0.1, 0, 0, 0.08])
    beta = np.abs(parametric_resonance(p, 0, rate_order=2).rate_terms[:, 0, 1])
    assert (beta[:2] < 1e-14 * beta[2]).all()
    exact = math.log(abs(multipliers(2.5, 0.0, p.stiffness_harmonics, 1e-12)[0])) / p.period_s
    found = parametric_resonance(p, 0, rate_order=10)
    assert found.growth_per_s == pytest.approx(exact, rel=1e-2)


@pytest.mark.parametrize("rate_order", [1, 2, 3, 4])
def test_growth_error_falls_with_the_next_power(rate_order):
    sizes = np.array([0.04, 0.08, 0.16])
    errors = []
    for size in sizes:
        p = scaled_problem(0.5 - 0.05 * size, 0.1 * size, size * SHAPE)
        found = parametric_resonance(p, 0, rate_order=rate_order, small_damping=True)
        c = p.stiffness_harmonics
        exact = math.log(abs(multipliers(p.frequency_ratio, p.damping_ratio, c, 1e-13)[0]))
        errors.append(abs(found.growth_per_s * p.period_s - exact))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(rate_order + 1, abs=0.2)


def test_refusals():
    p = scaled_problem(2.0, 0.0, [0.05, 0.05])
    with pytest.raises(ArgumentError, match="lines=-1"):
        forced_resonance(p, 1, [-1])
    with pytest.raises(ArgumentError, match="overdamped"):
        forced_resonance(scaled_problem(2.0, 1.2, [0.05]))
    with pytest.raises(ArgumentError, match="same frequency"):
        amplitude_equations(p, [(1, 2.0)], 1, 4)
    with pytest.raises(ArgumentError, match="same frequency"):
        forced_resonance(p, 1, [3])
    with pytest.raises(ArgumentError, match=r"lies on the natural frequency.*lines=\[2\]"):
        expand(p, 1)
    with pytest.raises(ArgumentError, match=r"lies on the natural frequency.*lines=\[2\]"):
        free_vibration(scaled_problem(2.0, 0.0, [], [0, 1.0]), 1)
    with pytest.raises(ArgumentError, match="whole or on half"):
        amplitude_equations(p, [(1, 0.3)], 1, 1)
    for slow in ([], [(1, 2.0), (1, 2.0)], [(1, 2.0), (1, 2.5)]):
        with pytest.raises(ArgumentError, match="must be different states, all on whole or on"):
            amplitude_equations(p, slow, 1, 1)
    undamped = scaled_problem(3.0, 0.0, [0, 0, 0.05])
    flat = amplitude_equations(undamped, [(1, 3.0), (-1, -3.0)], 0, 1)
    with pytest.raises(ArgumentError, match="singular"):
        flat.steady_amplitudes()
