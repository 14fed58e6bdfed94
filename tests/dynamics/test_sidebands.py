import math

import numpy as np
import pytest
from reference.hill_cases import scaled_problem
from reference.hill_reference import acceleration_error

from gearmon.dynamics import harmonic_balance, steady_state
from gearmon.dynamics.sidebands import first_order_sidebands
from gearmon.errors import ArgumentError

TEETH = 11


def turn(loss, count=90):
    """One soft tooth of eleven."""
    phase = np.arange(TEETH * 64) / 64
    shape = np.where(phase < 1, 1 - loss * np.sin(math.pi * phase) ** 2, 1.0)
    c = np.fft.rfft(shape * (1 + 0.15 * np.cos(2 * math.pi * phase)))
    return scaled_problem(4.3 * TEETH, 0.07, c[1 : count + 1] / c[0].real)


def test_error_is_of_second_order_in_the_loss():
    sizes = np.array([0.005, 0.01, 0.02])
    errors = []
    for loss in sizes:
        p = turn(loss)
        r = first_order_sidebands(p, TEETH, 1e-9).response()
        error = acceleration_error(r, harmonic_balance.solve(p, 300))
        assert error <= r.error_bound
        errors.append(error)
    assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] == pytest.approx(2, abs=0.1)


def test_families_are_proportional_to_the_loss():
    found = first_order_sidebands(turn(0.01), TEETH)
    single, double = found.response(), found.response(2.0)
    lines = np.arange(len(found.sidebands)) % TEETH != 0
    np.testing.assert_allclose(double.displacement[lines], 2 * single.displacement[lines])
    np.testing.assert_allclose(double.displacement[~lines], single.displacement[~lines])
    assert double.error_bound > 1.5 * single.error_bound
    assert single.method == "sidebands"


@pytest.mark.parametrize("teeth", [2, 3, 8, 11])
def test_each_family_solves_its_own_equation(teeth):
    rng = np.random.default_rng(teeth)
    even = np.zeros(6 * teeth, dtype=complex)
    even[teeth - 1 :: teeth] = 0.1 / np.arange(1, 7) ** 2
    odd = 1e-7 * (rng.normal(size=6 * teeth) + 1j * rng.normal(size=6 * teeth))
    odd[teeth - 1 :: teeth] = 0
    p = scaled_problem(2.2 * teeth, 0.1, even + odd)
    r = first_order_sidebands(p, teeth, 1e-12).response()
    full = steady_state(p, 1e-12, harmonics=5 * teeth)
    lines = np.arange(1, 5 * teeth) % teeth != 0
    found = r.displacement[1 : 5 * teeth][lines]
    exact = full.displacement[1 : 5 * teeth][lines]
    np.testing.assert_allclose(found, exact, atol=2e-5 * np.abs(exact).max())


def test_forces_off_the_mesh_are_refused():
    p = scaled_problem(9.0, 0.1, np.full(12, 0.01), force_harmonics=[1.0])
    with pytest.raises(ArgumentError, match="only multiples of meshes=4"):
        first_order_sidebands(p, 4)
