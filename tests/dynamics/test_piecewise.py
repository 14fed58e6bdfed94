"""Piecewise constant stiffness: closed forms, long precision, harmonic balance, laws."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference import piecewise_reference as reference
from reference.hill_cases import balanced

from gearmon.dynamics import piecewise_motion
from gearmon.dynamics.piecewise import PiecewiseProblem, multipliers, solve_exactly
from gearmon.errors import ArgumentError

MASS, STIFFNESS, FORCE = 0.28, 8e8, 4e3
W0 = math.sqrt(STIFFNESS / MASS)


def scaled(ratio, zeta, levels, shares, force=FORCE, start=0.0):
    """Pieces with these levels and shares and the frequency ratio w0/w."""
    shares = np.asarray(shares) / np.sum(shares)
    levels = np.asarray(levels) / (np.asarray(levels) @ shares)
    return PiecewiseProblem(
        mass_kg=MASS,
        damping_ns_per_m=2 * zeta * math.sqrt(STIFFNESS * MASS),
        stiffness_n_per_m=STIFFNESS * levels,
        durations_s=shares * 2 * math.pi * ratio / W0,
        force_n=force,
        start_s=start,
    )


def random_pieces(rng, most=7, zetas=(1e-3, 5.0), ratios=(0.02, 60.0)):
    count = int(rng.integers(2, most + 1))
    low, high = [(0.05, 2), (0.9, 1.1), (0.5, 1.5)][rng.integers(3)]
    force = FORCE if rng.random() < 0.5 else FORCE * rng.uniform(0.2, 2, count)
    return scaled(
        math.exp(rng.uniform(*np.log(ratios))),
        math.exp(rng.uniform(*np.log(zetas))),
        rng.uniform(low, high, count),
        rng.dirichlet(np.full(count, 3.0)) + 1e-3,
        force,
    )


def pair(damping=9e3, variation=0.13, duty=0.5):
    return PiecewiseProblem.rectangular(MASS, damping, STIFFNESS, variation, duty, 1.6e-3, FORCE)


@pytest.mark.parametrize(
    ("h", "s", "tau"),
    [
        (0.3, 1.0, 7.0),
        (0.3, 1.0, 1e-3),
        (1e-9, 1.0, 1e-7),
        (1.0, 1.0, 2.0),
        (1.0, 1.0 + 1e-13, 2.0),
        (1.0, 1.0 - 1e-13, 0.4),
        (1.0, 1.0, 1e-5),
        (30.0, 1.0, 5.0),
        (30.0, 1e-8, 5.0),
        (30.0, 1.0, 1e-4),
        (0.2, 1e4, 3.0),
        (0.5, -2.0, 3.0),
        (0.0, 1e-12, 1.0),
        (2.0, 0.0, 1.0),
        (0.0, 0.0, 1.0),
    ],
)
def test_steps_keep_their_digits(h, s, tau):
    exact = reference.step(h, s, tau, 0.7).astype(float)
    found = piecewise_motion.step(*(np.array([x]) for x in (h, s, tau, 0.7)))
    expected = [exact[0, 0], exact[0, 1], exact[1, 0], exact[1, 1], exact[0, 2], exact[1, 2]]
    # many swings turn rounding of the angle into an error of the state
    near = 4e-15 * (1 + math.sqrt(abs(s)) * tau)
    for value, right in zip(found, expected, strict=True):
        assert value[0] == pytest.approx(right, rel=near, abs=near * 1e-3 * max(1e-12, abs(right)))


@given(
    st.floats(0, 50), st.floats(-2, 50), st.floats(1e-6, 3), st.floats(1e-6, 3), st.floats(-2, 2)
)
def test_two_steps_are_one(h, s, first, second, g):
    one, two, both = (
        piecewise_motion.step(*(np.array([x]) for x in (h, s, tau, g)))
        for tau in (first, second, first + second)
    )
    moved = piecewise_motion.composed(one, two)
    size = max(np.abs(x).max() for x in (*one, *two, 1.0 + 0 * one.b1))
    for a, b in zip(moved, both, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13 * size**2)


@pytest.mark.parametrize("seed", range(12))
def test_lines_against_long_precision(seed):
    rng = np.random.default_rng(seed)
    solved = 0
    while solved < 8:
        p = random_pieces(rng)
        r = solve_exactly(p, 40)
        if not r.stable:
            continue
        solved += 1
        m = p.mass_kg
        exact = reference.acceleration_lines(
            p.damping_ns_per_m / (2 * m),
            p.stiffness_n_per_m / m,
            p.durations_s,
            p.force_pieces_n / m,
            np.arange(41),
        )
        error = np.linalg.norm((r.acceleration - exact).astype(complex))
        assert error <= r.error_bound * np.linalg.norm(exact.astype(complex))
        assert r.error_bound < 1e-7


def test_published_pair():
    r = solve_exactly(pair())
    assert 1e6 * r.displacement[0].real == pytest.approx(5.083524, abs=4e-5)
    lines = 2 * np.abs(r.displacement[[1, 3, 5, 7, 13, 2, 12]])
    published = [8.4559e-7, 2.9217e-7, 1.8862e-7, 1.5056e-7, 1.0597e-7, 5.182e-9, 2.486e-8]
    # those come from odd harmonics up to 41 only
    np.testing.assert_allclose(lines, published, rtol=2e-2)
    np.testing.assert_allclose(lines[:4], published[:4], rtol=6e-5)
    assert 2 * np.abs(r.acceleration).max() == pytest.approx(276.2, abs=0.2)


def test_uniform_stiffness_only_deflects():
    p = scaled(3.3, 0.05, [1.0, 1.0, 1.0], [0.2, 0.5, 0.3])
    r = solve_exactly(p)
    assert r.displacement[0].real == pytest.approx(FORCE / STIFFNESS, rel=1e-13)
    assert np.abs(r.displacement[1:]).max() < 1e-13 * FORCE / STIFFNESS


def test_force_steps_on_a_uniform_spring_are_a_linear_oscillator():
    p = scaled(2.2, 0.03, [1.0, 1.0], [0.3, 0.7], force=[6e3, 2e3], start=1e-5)
    r = solve_exactly(p, 30)
    n = np.arange(31) / 2.2
    expected = p.harmonics_of(p.force_n, 30) / STIFFNESS / (1 - n**2 + 2j * 0.03 * n)
    np.testing.assert_allclose(r.displacement, expected, rtol=1e-11, atol=1e-22)


def test_undamped_piece_that_swings_at_a_line():
    # each half lasts whole swings at the frequencies 2 w and 4 w: the denominators vanish
    p = PiecewiseProblem(
        mass_kg=1.0,
        damping_ns_per_m=1e-9,
        stiffness_n_per_m=[4.0, 16.0],
        durations_s=[0.3 * 2 * math.pi, 0.7 * 2 * math.pi],
        force_n=1.0,
    )
    r = solve_exactly(p, 12)
    count = 40
    x, weights = np.polynomial.legendre.leggauss(count)
    for n in range(13):
        total = 0j
        for low, share in ((0.0, 0.3), (0.3, 0.7)):
            phase = low + share * (x + 1) / 2
            z = r.at(phase * p.period_s)
            total += share / 2 * (weights * z) @ np.exp(-2j * math.pi * n * phase)
        assert abs(total - r.displacement[n]) < 1e-14 * abs(r.displacement[0]) * 10


def test_many_harmonics_approach_the_exact_lines_at_second_order():
    p = pair(damping=3e3, duty=0.412)
    exact = solve_exactly(p, 10).displacement
    errors = []
    for harmonics in (100, 200, 400, 800):
        found = balanced(p.hill(harmonics), harmonics + 60)[:11]
        errors.append(np.linalg.norm(found - exact))
    slope = np.polyfit(np.log([100, 200, 400, 800]), np.log(errors), 1)[0]
    assert slope < -1.7
    assert errors[-1] < 1e-4 * np.linalg.norm(exact[1:])


@pytest.mark.parametrize("seed", range(4))
def test_motion_obeys_the_equation(seed):
    rng = np.random.default_rng(seed)
    p = random_pieces(rng, zetas=(0.01, 1.0), ratios=(0.3, 10.0))
    r = solve_exactly(p)
    period = p.period_s
    phase = np.sort(rng.random(50))
    t = phase * period
    ends = np.cumsum(p.shares)
    piece = np.searchsorted(ends, phase, side="right")
    z, v, a, f = (
        r.at(t, kind) for kind in ("displacement", "velocity", "acceleration", "mesh_force")
    )
    force = p.mass_kg * a + p.damping_ns_per_m * v + p.stiffness_n_per_m[piece] * z
    np.testing.assert_allclose(force, p.force_pieces_n[piece], rtol=1e-11)
    np.testing.assert_allclose(f, p.force_pieces_n[piece] - p.mass_kg * a, rtol=1e-9)
    np.testing.assert_allclose(r.at(t + 3 * period), z, rtol=1e-9)
    step = 1e-5 * period
    slope = (r.at(t + step) - r.at(t - step)) / (2 * step)
    scale = np.abs(v).max()
    assert np.median(np.abs(slope - v)) < 1e-6 * scale
    # state and velocity pass the jumps without a jump
    jumps = ends[:-1] * period
    np.testing.assert_allclose(r.at(jumps - 1e-9 * period), r.at(jumps + 1e-9 * period), rtol=1e-6)


def test_a_shift_of_time_turns_the_lines():
    still, moved = (scaled(5.5, 0.1, [1.2, 0.8], [0.4, 0.6], start=x) for x in (0.0, 7e-5))
    turn = np.exp(-1j * np.arange(31) * still.angular_frequency * 7e-5)
    a, b = (solve_exactly(p, 30).displacement for p in (still, moved))
    np.testing.assert_allclose(b, a * turn, rtol=1e-10, atol=1e-24)


def test_cut_pieces_change_nothing():
    whole = scaled(8.0, 0.02, [1.3, 0.8], [0.3, 0.7])
    cut = scaled(8.0, 0.02, [1.3, 1.3, 0.8, 0.8, 0.8], [0.1, 0.2, 0.3, 0.1, 0.3])
    a, b = (solve_exactly(p, 40) for p in (whole, cut))
    np.testing.assert_allclose(a.displacement, b.displacement, rtol=1e-10)
    assert abs(a.floquet_multipliers[0] - b.floquet_multipliers[0]) < 1e-12


def test_repeated_teeth_give_mesh_lines_only():
    one = solve_exactly(scaled(13.6, 0.1, [1.13, 0.87], [0.412, 0.588]), 20).displacement
    turn = solve_exactly(
        scaled(13.6 * 26, 0.1, [1.13, 0.87] * 26, [0.412, 0.588] * 26), 20 * 26
    ).displacement
    np.testing.assert_allclose(turn[::26], one, rtol=1e-8)
    between = np.delete(turn, np.s_[::26])
    assert np.abs(between).max() < 1e-13 * abs(one[0])


def test_one_cracked_tooth_against_piece_by_piece_sums():
    levels = np.array([1.13, 0.87] * 13)
    levels[2] *= 0.8
    p = scaled(60.0, 0.05, levels, [0.412, 0.588] * 13)
    found = solve_exactly(p, 300)
    m = p.mass_kg
    exact = reference.acceleration_lines(
        p.damping_ns_per_m / (2 * m),
        p.stiffness_n_per_m / m,
        p.durations_s,
        p.force_pieces_n / m,
        np.arange(301),
    ).astype(complex)
    assert np.linalg.norm(found.acceleration - exact) < 1e-10 * np.linalg.norm(exact)


@pytest.mark.parametrize("variation", [0.13, 0.3])
@pytest.mark.parametrize("duty", [0.5, 0.412])
def test_multipliers_are_those_of_meissner(variation, duty):
    p = pair(damping=400.0, variation=variation, duty=duty)
    h = p.damping_ns_per_m / (2 * p.mass_kg)
    w = np.sqrt(p.stiffness_n_per_m / p.mass_kg - h**2)
    angle = w * p.durations_s
    trace = 2 * math.cos(angle[0]) * math.cos(angle[1])
    trace -= (w[0] / w[1] + w[1] / w[0]) * math.sin(angle[0]) * math.sin(angle[1])
    first, second = multipliers(p)
    fade = math.exp(-h * p.period_s)
    assert first + second == pytest.approx(fade * trace, rel=1e-12)
    assert first * second == pytest.approx(fade**2, rel=1e-12)
    assert abs(first) >= abs(second)


def test_stable_says_the_same_as_the_multipliers():
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(100):
        p = random_pieces(rng, zetas=(1e-4, 0.02), ratios=(0.3, 3.0))
        r = solve_exactly(p, 4)
        assert r.stable == (abs(r.floquet_multipliers[0]) < 1)
        seen.add(r.stable)
    assert seen == {True, False}


def test_unstable_and_undamped_are_said_with_the_number():
    unstable = solve_exactly(scaled(0.5, 1e-3, [1.3, 0.7], [0.5, 0.5]))
    assert not unstable.stable
    assert math.isinf(unstable.error_bound)
    assert f"{abs(unstable.floquet_multipliers[0]):.6g}" in unstable.message
    undamped = solve_exactly(scaled(3.3, 0.0, [1.1, 0.9], [0.5, 0.5]))
    assert not undamped.stable
    assert "undamped" in undamped.message


@pytest.mark.parametrize("seed", range(5))
def test_least_mesh_force_against_a_fine_grid(seed):
    rng = np.random.default_rng(seed)
    for _ in range(10):
        p = random_pieces(rng, zetas=(0.005, 2.0), ratios=(0.3, 15.0))
        r = solve_exactly(p, 1)
        grid = np.linspace(0, p.period_s, 40001)
        force = r.at(grid, "mesh_force")
        span = np.ptp(force)
        assert r.least_mesh_force_n <= force.min() + 1e-9 * span
        assert r.least_mesh_force_n >= force.min() - 2e-3 * span


def test_first_angle_of_contact_loss():
    p = scaled(1.0, 0.004, [1.03, 0.97], [0.45, 0.55], start=-3e-5)
    r = solve_exactly(p)
    assert r.stable
    assert r.contact_lost
    grid = np.linspace(0, p.period_s, 200001)[:-1]
    lost = np.flatnonzero(r.at(grid, "mesh_force") <= 0)[0]
    assert r.contact_loss_angle_rad == pytest.approx(2 * math.pi * lost / 200000, abs=4e-5)
    assert abs(r.at(r.contact_loss_angle_rad / p.angular_frequency, "mesh_force")) < 1e-6 * FORCE
    assert solve_exactly(pair()).contact_loss_angle_rad is None


def test_lines_sum_to_the_motion_and_to_parseval():
    p = pair()
    r = solve_exactly(p, 4000)
    t = np.linspace(0, p.period_s, 33)
    phase = np.exp(1j * p.angular_frequency * t[:, None] * np.arange(1, 4001))
    z = r.displacement[0].real + 2 * (phase @ r.displacement[1:]).real
    np.testing.assert_allclose(z, r.at(t), rtol=5e-9)
    x, weights = np.polynomial.legendre.leggauss(120)
    square = sum(
        0.25 * weights @ r.at((low + (x + 1) / 4) * p.period_s + p.start_s, "velocity") ** 2
        for low in (0.0, 0.5)
    )
    assert 2 * np.sum(np.abs(r.velocity) ** 2) == pytest.approx(square, rel=1e-9)
    assert r.energy_lines[3] == pytest.approx(2 * abs(r.velocity[3]) ** 2)
    np.testing.assert_allclose(
        r.mesh_force[1:], -p.mass_kg * r.acceleration[1:], rtol=1e-12, atol=1e-9
    )


def test_harmonics_of_the_pieces():
    p = pair(duty=0.412)
    n = np.arange(1, 8)
    expected = 0.13 * np.sin(n * math.pi * 0.412) / (n * math.pi * (1 - 0.412))
    np.testing.assert_allclose(p.hill(7).stiffness_harmonics, expected, atol=1e-15)
    assert piecewise_motion._repeats(np.tile([0.3, 0.7, 0.2], 5)) == 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass_kg": 0.0}, "mass_kg=0.0 kg must be > 0"),
        ({"damping_ns_per_m": -1.0}, "must be >= 0"),
        ({"stiffness_n_per_m": [1.0, 0.0]}, "piece 2 is 0.0 N/m, must be finite and > 0"),
        ({"stiffness_n_per_m": [[1.0]]}, "one row"),
        ({"durations_s": [1.0]}, "1 values for 2 pieces"),
        ({"durations_s": [1.0, math.nan]}, "piece 2 is nan s"),
        ({"force_n": [1.0, 2.0, 3.0]}, "3 values for 2 pieces"),
        ({"start_s": math.inf}, "finite"),
    ],
)
def test_bad_problems_are_refused(change, message):
    good = {
        "mass_kg": 1.0,
        "damping_ns_per_m": 1.0,
        "stiffness_n_per_m": [1.0, 2.0],
        "durations_s": [1.0, 1.0],
        "force_n": 1.0,
    }
    with pytest.raises(ArgumentError, match=message):
        PiecewiseProblem(**{**good, **change})


def test_other_refusals():
    with pytest.raises(ArgumentError, match="must stay > 0"):
        pair(variation=1.2)
    with pytest.raises(ArgumentError, match="duty=1"):
        pair(duty=1.0)
    with pytest.raises(ArgumentError, match="harmonics"):
        solve_exactly(pair(), 0)
    with pytest.raises(ArgumentError, match="kind='jerk'"):
        solve_exactly(pair()).at(0.0, "jerk")
