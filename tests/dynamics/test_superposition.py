import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.hill_cases import scaled_problem

from gearmon.dynamics import harmonic_balance, steady_state
from gearmon.dynamics.shaft_faults import ShaftFault, joined, split_fault
from gearmon.dynamics.sideband_bounds import rms_of_product, turn_gain
from gearmon.dynamics.superposition import sidebands, sidebands_of_sizes
from gearmon.dynamics.sweep_bounds import swing_of
from gearmon.errors import ArgumentError

SEEDS = st.integers(0, 2**32 - 1)


def turn(teeth, loss, ratio=4.3, zeta=0.07, count=6):
    """One soft tooth of several, the mean stiffness taken out."""
    phase = np.arange(teeth * 64) / 64
    shape = np.where(phase < 1, 1 - loss * np.sin(math.pi * phase) ** 2, 1.0)
    c = np.fft.rfft(shape * (1 + 0.15 * np.cos(2 * math.pi * phase)))
    return scaled_problem(ratio * teeth, zeta, c[1 : count * teeth + 1] / c[0].real)


def parts(first=5, second=7, losses=(0.01, 0.02), **how):
    mesh, pinion = split_fault(turn(first, losses[0], **how), first)
    return mesh, [pinion, split_fault(turn(second, losses[1], **how), second)[1]]


def true_error(found, faults):
    """Rms acceleration of all errors over that of the sidebands, against a dense matrix."""
    common = math.lcm(*(f.meshes for f in faults))
    orders, lines = found.lines()
    places = np.round(orders * common).astype(int)
    exact = harmonic_balance.solve(joined(found.mesh, faults), int(places.max()) + 3 * common)
    apart = exact.copy()
    apart[places] -= lines
    weights = np.arange(len(exact)) ** 2
    beside = np.arange(len(exact)) % common != 0
    return np.linalg.norm(weights * apart) / np.linalg.norm((weights * exact)[beside])


@pytest.mark.parametrize("method", ["first order", "shafts apart", "coupled"])
@pytest.mark.parametrize("loss", [0.003, 0.05, 0.4])
def test_bound_of_one_fault_holds(method, loss):
    mesh, fault = split_fault(turn(11, loss), 11)
    found = sidebands(mesh, [fault], 1e-3, method)
    error = true_error(found, [fault])
    assert error <= found.error_bound
    assert found.method == method
    if method == "first order":
        assert found.error_bound < 3 * error or error > 0.3
    else:
        assert found.error_bound <= 1e-3


@settings(max_examples=12, deadline=None)
@given(SEEDS)
def test_bound_of_two_shafts_holds(seed):
    rng = np.random.default_rng(seed)
    teeth = [(3, 4), (4, 6), (5, 7), (2, 9)][rng.integers(4)]
    losses = 10 ** rng.uniform(-4, -0.5, 2)
    how = {"ratio": rng.uniform(0.7, 9), "zeta": 10 ** rng.uniform(-1.7, -0.3), "count": 5}
    mesh, faults = parts(*teeth, losses, **how)
    for method in ("first order", "shafts apart", "coupled"):
        found = sidebands(mesh, faults, 1e-4, method)
        assert true_error(found, faults) <= found.error_bound
        if method != "coupled":
            assert found.cross_bound <= found.error_bound


def test_cross_terms_shrink_with_the_faults_and_their_bound_with_them():
    errors, bounds = [], []
    sizes = np.array([5e-5, 1e-4, 2e-4])
    for size in sizes:
        mesh, faults = parts(losses=(size, size))
        found = sidebands(mesh, faults, 1e-5, "shafts apart")
        errors.append(true_error(found, faults))
        bounds.append(found.cross_bound)
        assert errors[-1] <= found.error_bound
    for values in (errors, bounds):
        slope = np.polyfit(np.log(sizes), np.log(values), 1)[0]
        assert slope == pytest.approx(1, abs=0.15)
    assert bounds[0] < 60 * errors[0]


def test_auto_says_which_and_meets_the_tolerance():
    mesh, faults = parts(losses=(0.05, 0.05))
    assert sidebands(mesh, faults[:1]).method == "coupled"
    # 35 meshes together are solved at once, 13 x 17 only where superposing will not do
    assert sidebands(mesh, faults).method == "coupled"
    mesh, small = parts(13, 17, (1e-4, 1e-4), count=3)
    apart = sidebands(mesh, small, 0.05)
    assert apart.method == "shafts apart"
    assert 0 < apart.cross_bound <= apart.error_bound <= 0.05
    mesh, large = parts(13, 17, (0.1, 0.1), count=3)
    coupled = sidebands(mesh, large, 0.05)
    assert coupled.method == "coupled"
    assert coupled.error_bound <= 0.05
    assert "221 meshes" in coupled.message


def test_all_sizes_from_one_basis():
    mesh, fault = split_fault(turn(11, 0.1), 11)
    factors = np.array([0.1, 1.0, -0.5, 4.0])
    for factor, found in zip(factors, sidebands_of_sizes(mesh, fault, factors, 1e-3), strict=True):
        sized = fault.scaled(factor)
        assert true_error(found, [sized]) <= found.error_bound <= 1e-3
        assert found.method == "families"


def test_faults_of_one_shaft_add_up():
    mesh, fault = split_fault(turn(7, 0.05), 7)
    shift = np.exp(2j * math.pi * 3 * np.arange(1, len(fault.stiffness_harmonics) + 1) / 7)
    other = ShaftFault(7, 0.5 * shift * fault.stiffness_harmonics)
    found = sidebands(mesh, [fault, other], 1e-6)
    assert len(found.faults) == 1
    assert true_error(found, [fault, other]) <= found.error_bound <= 1e-6


def test_joined_undoes_split():
    p = turn(7, 0.1)
    mesh, fault = split_fault(p, 7)
    again = joined(mesh, [fault])
    np.testing.assert_array_equal(again.stiffness_harmonics, p.stiffness_harmonics)
    assert again.period_s == pytest.approx(p.period_s)
    z = steady_state(mesh, 1e-10).displacement
    even = steady_state(joined(mesh, [fault.scaled(0.0)]), 1e-10).displacement
    count = min(len(z), (len(even) + 6) // 7)
    np.testing.assert_allclose(even[::7][:count], z[:count], atol=1e-12 * abs(z[0]))


@pytest.mark.parametrize(("first", "second"), [(3, 5), (4, 6), (6, 6), (2, 8)])
def test_rms_of_product_equals_that_over_the_common_turn(first, second):
    rng = np.random.default_rng(first)
    halves = [rng.normal(size=9) + 1j * rng.normal(size=9) for _ in range(2)]
    common = math.lcm(first, second)
    time = np.arange(common * 200) / 200
    values = [
        half[0].real
        + 2 * (np.exp(2j * math.pi * time[:, None] / meshes * np.arange(1, 9)) @ half[1:]).real
        for half, meshes in zip(halves, (first, second), strict=True)
    ]
    for half in halves:
        half[0] = half[0].real
    found = rms_of_product(halves[0], first, halves[1], second)
    assert found == pytest.approx(np.sqrt(np.mean((values[0] * values[1]) ** 2)))


def test_gain_over_any_turn_is_not_below_that_of_a_common_turn():
    for zeta in (0.02, 0.1, 0.5):
        mesh, faults = parts(3, 5, (0.02, 0.05), zeta=zeta, count=3)
        gain = turn_gain(
            mesh.frequency_ratio,
            zeta,
            swing_of(mesh.stiffness_harmonics),
            [(f.swing, f.meshes) for f in faults],
        )
        p = joined(mesh, faults)
        highest = math.ceil(4 * p.frequency_ratio)
        columns = []
        for line in range(0, highest, 7):
            right = np.zeros(highest + 1, dtype=complex)
            right[line] = 1.0
            answer = harmonic_balance.solve(p, highest, right)
            weights = (np.arange(highest + 1) / p.frequency_ratio) ** 2
            columns.append(np.linalg.norm(weights * answer))
        assert gain.acceleration >= max(columns)


def test_bad_input_is_refused():
    mesh, faults = parts()
    with pytest.raises(ArgumentError, match="multiples of meshes=4 must be 0"):
        ShaftFault(4, np.ones(4))
    with pytest.raises(ArgumentError, match="at least one is needed"):
        sidebands(mesh, [])
    with pytest.raises(ArgumentError, match="method='families' must be one of"):
        sidebands(mesh, faults, method="families")
    with pytest.raises(ArgumentError, match="finite numbers other than 0"):
        sidebands_of_sizes(mesh, faults[0], [1.0, 0.0])
    forced = scaled_problem(9.0, 0.1, np.full(12, 0.01), force_harmonics=[1.0])
    with pytest.raises(ArgumentError, match="only multiples of meshes=4"):
        split_fault(forced, 4)
