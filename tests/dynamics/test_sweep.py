import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.dense_harmonic_balance import steady_displacement
from reference.hill_cases import balanced, published_pair, random_problem
from reference.hill_reference import acceleration_error, period_map

from gearmon.dynamics import steady_state
from gearmon.dynamics.sweep import _Work, sweep
from gearmon.errors import ArgumentError

SEEDS = st.integers(0, 2**32 - 1)
SQUARE = published_pair(10).stiffness_harmonics


def published_values(rng, count, weak=False):
    """Stiffness, mass and damping over the published ranges."""
    k = np.exp(rng.uniform(*np.log((2e8, 1.2e9)), count))
    m = np.exp(rng.uniform(*np.log((0.2, 3.0)), count))
    d = np.exp(rng.uniform(*np.log((3e3, 9e4)), count))
    if weak:
        d = 2 * np.sqrt(k * m) * np.exp(rng.uniform(*np.log((0.005, 0.02)), count))
    return m, d, k


def exact(problem, highest):
    reach = highest + 2 * len(problem.stiffness_harmonics) + 30
    return balanced(problem, min(reach, 250))


@pytest.mark.parametrize("weak", [False, True])
def test_published_ranges_meet_the_tolerance(weak):
    m, d, k = published_values(np.random.default_rng(0), 400, weak)
    found = sweep(m, d, k, SQUARE, 1.6e-3, 4e3)
    assert found.met[found.stable].all()
    assert found.stable.mean() > 0.99
    ratios = []
    for i in range(0, 400, 8):
        if not found.stable[i]:
            continue
        r = found.response(i)
        error = acceleration_error(r, exact(r.problem, len(r.displacement) - 1))
        assert error <= r.error_bound + 3e-13
        ratios.append(r.error_bound / error)
    assert np.median(ratios) < 100


def test_against_a_dense_matrix_written_plainly():
    found = sweep(0.28, [3e3, 9e3, 9e4], 8e8, SQUARE, 1.6e-3, 4e3, tolerance=1e-10)
    relative = np.append(SQUARE, np.zeros(150))
    for damping, z in zip([3e3, 9e3, 9e4], found.displacement, strict=True):
        full = steady_displacement(0.28, damping, 8e8, relative, 1.6e-3, 4e3)
        weights = np.arange(len(full)) ** 2
        full[: len(z)] -= z
        assert np.linalg.norm(weights * full) < 1e-10 * np.linalg.norm(weights[: len(z)] * z)


@given(SEEDS, st.sampled_from([1e-3, 1e-6, 1e-10]))
def test_bound_holds_on_random_sets(seed, tolerance):
    rng = np.random.default_rng(seed)
    p = random_problem(rng, 12)
    ratio = np.exp(rng.uniform(math.log(0.1), math.log(12), 20))
    zeta = np.exp(rng.uniform(math.log(1e-3), math.log(3), 20))
    scale = rng.uniform(0, 1.1, 20)
    period = 2 * math.pi * ratio / math.sqrt(8e8 / 0.28)
    damping = 2 * zeta * math.sqrt(8e8 * 0.28)
    c = p.stiffness_harmonics
    found = sweep(0.28, damping, 8e8, c, period, 4e3, scale, tolerance)
    for i in range(20):
        q = found.problem(i)
        if not found.stable[i]:
            assert math.isinf(found.error_bound[i])
            assert "unstable" in found.reason[i] or "no error bound" in found.reason[i]
            assert not steady_state(q).stable
            continue
        assert found.met[i] or found.reason[i]
        if found.scale[i] > 0:
            error = acceleration_error(found.response(i), exact(q, found.displacement.shape[1]))
            assert error <= found.error_bound[i] + 3e-13


@given(SEEDS)
def test_own_patterns_equal_one_at_a_time(seed):
    rng = np.random.default_rng(seed)
    c = rng.normal(size=(5, 4)) + 1j * rng.normal(size=(5, 4))
    c *= 0.3 / (2 * np.abs(c).sum(axis=1, keepdims=True))
    m, d, k = published_values(rng, 5)
    found = sweep(m, d, k, c, 1.6e-3, 4e3)
    for i in range(5):
        alone = steady_state(found.problem(i), 1e-10)
        assert found.met[i]
        error = acceleration_error(found.response(i), alone.displacement)
        assert error <= found.error_bound[i] + 2e-10


def test_shapes_broadcast():
    c = np.reshape([0.065, 0.03 + 0.01j], (2, 1, 1, 1))
    damping, mass = np.array([3e3, 9e3, 4e4]), np.array([[0.2], [0.28], [1.0], [3.0]])
    found = sweep(mass, damping, 8e8, c, 1.6e-3, 4e3)
    assert found.displacement.shape[:3] == (2, 4, 3)
    assert found.acceleration.shape == found.displacement.shape
    assert found.method.shape == found.reason.shape == found.met.shape == (2, 4, 3)
    alone = steady_state(found.problem((1, 2, 0)), 1e-10).displacement
    count = min(len(alone), found.displacement.shape[-1])
    np.testing.assert_allclose(
        found.displacement[1, 2, 0, :count], alone[:count], atol=1e-7 * abs(alone[1])
    )
    again = sweep(mass, damping, 8e8, c, 1.6e-3, 8e3)
    np.testing.assert_allclose(again.displacement, 2 * found.displacement)
    single = sweep(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    assert single.displacement.ndim == 1
    assert bool(single.met)


def test_many_sets_equal_each_by_itself():
    m, d, k = published_values(np.random.default_rng(5), 60)
    together = sweep(m, d, k, SQUARE, 1.6e-3, 4e3, tolerance=1e-9)
    for i in range(0, 60, 6):
        alone = sweep(m[i], d[i], k[i], SQUARE, 1.6e-3, 4e3, tolerance=1e-9)
        count = min(alone.displacement.shape[-1], together.displacement.shape[-1])
        scale = np.abs(alone.displacement[1:]).max()
        np.testing.assert_allclose(
            together.displacement[i, :count], alone.displacement[:count], atol=1e-8 * scale
        )


def test_only_the_harmonics_asked_for_are_handed_out():
    m, d, k = published_values(np.random.default_rng(2), 40)
    full = sweep(m, d, k, SQUARE, 1.6e-3, 4e3, tolerance=1e-10)
    some = sweep(m, d, k, SQUARE, 1.6e-3, 4e3, harmonics=5)
    assert some.displacement.shape == (40, 6)
    weights = np.arange(6) ** 2
    error = np.linalg.norm(weights * (some.displacement - full.displacement[:, :6]), axis=1)
    size = np.linalg.norm(weights * full.displacement[:, :6], axis=1)
    assert (error <= (some.error_bound + 1e-9) * size).all()
    assert some.met.all()


@pytest.mark.parametrize("times", [1, 8])
def test_unstable_and_undamped_sets_are_refused_with_the_number(times):
    # w = 2 w0 with 4 zeta below the variation, and without damping
    period = math.pi * math.sqrt(0.28 / 8e8)
    found = sweep(0.28, [1e2, 0.0, 9e3] * times, 8e8, [0.1], period, 4e3)
    assert list(found.stable) == [False, False, True] * times
    assert list(found.met) == [False, False, True] * times
    assert np.isnan(found.displacement[0]).all()
    assert found.reason[1].startswith("undamped")
    growth = float(found.reason[0].split(" by ")[1].split()[0])
    largest = np.abs(np.linalg.eigvals(period_map(found.problem(0)))).max()
    assert growth == pytest.approx(largest, rel=1e-2)
    with pytest.raises(ArgumentError, match="no steady state here: unstable"):
        found.response(0)


@pytest.mark.parametrize(
    "changes", [{"damping": 1e16}, {"damping": 1e200}, {"mass": 1e-30}, {"mass": 1e30}]
)
def test_a_set_that_no_pair_can_have_is_refused_among_many_as_by_itself(changes):
    known = {"mass": np.full(20, 0.28), "damping": np.full(20, 9e3), "scale": np.ones(20)}
    for name, value in changes.items():
        known[name][7] = value
    found = sweep(known["mass"], known["damping"], 8e8, SQUARE, 1.6e-3, 4e3, scale=known["scale"])
    assert np.delete(found.met, 7).all()
    assert not found.met[7]
    with pytest.raises(ArgumentError) as alone:
        steady_state(found.problem(7))
    assert found.reason[7] == str(alone.value)


def test_no_work_is_spent_by_itself_on_sets_known_to_be_unstable(monkeypatch):
    period, alone = math.pi * math.sqrt(0.28 / 8e8), []
    usual = _Work._alone
    monkeypatch.setattr(_Work, "_alone", lambda self, i, c: (alone.append(i), usual(self, i, c))[1])
    found = sweep(0.28, [1e2, 0.0, 9e3] * 8, 8e8, [0.1], period, 4e3)
    assert not found.stable[::3].any()
    assert not set(alone) & set(np.flatnonzero(~found.stable).tolist())


@pytest.mark.parametrize("largest", [0.5, 0.9])
def test_strong_variation_falls_back_and_stays_right(largest):
    rng = np.random.default_rng(1)
    zeta = np.array([0.01, 0.05, 0.2, 1.0])
    period = 2 * math.pi * rng.uniform(0.5, 12, (6, 1)) / math.sqrt(8e8 / 0.28)
    c = largest / 2 * np.array([0.6, 0.4j])
    found = sweep(0.28, 2 * zeta * math.sqrt(8e8 * 0.28), 8e8, c, period, 4e3)
    assert found.met[found.stable].all()
    assert set(found.method.ravel()) - {"msm", "refused"}
    for index in np.argwhere(found.stable):
        r = found.response(tuple(index))
        assert acceleration_error(r, exact(r.problem, 60)) <= r.error_bound + 3e-13


def test_no_variation_no_vibration():
    stiffness = np.linspace(2e8, 8e8, 20)
    found = sweep(0.28, 9e3, stiffness, SQUARE, 1.6e-3, 4e3, scale=0.0)
    np.testing.assert_allclose(found.displacement[:, 0], 4e3 / stiffness)
    assert not found.displacement[:, 1:].any()
    assert not found.error_bound.any()
    assert sweep([0.28], 9e3, 8e8, [], 1.6e-3, 4e3).met.all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass_kg": [0.28, -1.0]}, r"mass_kg\[1\]=-1.0 kg must be > 0"),
        ({"damping_ns_per_m": -1.0}, "damping_ns_per_m=-1.0 N s/m must be >= 0"),
        ({"period_s": math.nan}, "period_s=nan s must be a finite number"),
        ({"scale": -1.0}, "scale=-1.0 must be >= 0"),
        ({"stiffness_harmonics": [0.1, math.inf]}, r"stiffness_harmonics\[1\]=\(inf\+0j\) must"),
        ({"stiffness_harmonics": 0.1}, "must be one row of coefficients"),
        ({"force_n": [1.0, 2.0, 3.0], "mass_kg": [0.2, 0.3]}, "do not broadcast together"),
        ({"tolerance": 2.0}, "tolerance=2.0 must lie in"),
        ({"harmonics": 0}, "harmonics=0 must lie in"),
    ],
)
def test_bad_input_is_refused(change, message):
    values = {
        "mass_kg": 0.28,
        "damping_ns_per_m": 9e3,
        "stiffness_n_per_m": 8e8,
        "stiffness_harmonics": [0.065],
        "period_s": 1.6e-3,
        "force_n": 4e3,
    }
    with pytest.raises(ArgumentError, match=message):
        sweep(**(values | change))


@pytest.mark.parametrize("count", [3, 40])
def test_a_bad_cell_leaves_the_others_alone(count):
    mass = np.full(count, 0.28)
    mass[:2] = 1e12, 1e-12
    found = sweep(mass, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    assert found.met.tolist() == [True, False, *[True] * (count - 2)]
    assert found.method[1] == "refused"
    assert "7.203e+06 times that of the mesh" in found.reason[1]
    assert np.isnan(found.displacement[1]).all()


def test_complex_values_are_refused():
    with pytest.raises(ArgumentError, match="mass_kg: complex"):
        sweep(0.28 + 0.1j, 9e3, 8e8, [0.065], 1.6e-3, 4e3)


def test_one_cell_of_nonsense_does_not_stop_a_sweep():
    found = sweep([0.28, 1e12, 1e-12], 9e3, 8e8, [0.065], 1.6e-3, 4e3, scale=[1.0, 1.0, 1.0])
    assert [bool(reason) for reason in found.reason] == [False, False, True]
    found = sweep(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3, scale=[1.0, 1e12])
    assert "would swing by 6.5e+10 times" in found.reason[1]
    assert found.stable[0]


def test_dampers_beyond_all_sense_overflow_nothing():
    dampings = 2 * np.sqrt(0.28 * 8e8) * np.geomspace(1.0, 3e6, 40)
    many = sweep(0.28, dampings, 8e8, [0.065, 0.0, -0.022], 1.6e-3, 4e3)
    assert many.met.all()
    for index in (0, 20, 39):
        alone = steady_state(many.problem(index), 1e-7, "harmonic balance", harmonics=20)
        apart = np.linalg.norm(many.acceleration[index, :21] - alone.acceleration)
        most = many.error_bound[index] + alone.error_bound
        assert apart <= 2 * most * np.linalg.norm(alone.acceleration)
