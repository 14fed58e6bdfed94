"""Piecewise constant stiffness: closed forms, long precision, harmonic balance, laws."""

import math

import numpy as np
import pytest
from reference import piecewise_reference as reference
from reference.exact_pieces import PiecewiseProblem, solve_exactly
from reference.hill_cases import balanced

from gearmon.dynamics import steady_state
from gearmon.errors import ArgumentError

MASS, STIFFNESS, FORCE = 0.28, 8e8, 4e3
W0 = math.sqrt(STIFFNESS / MASS)


def scaled(ratio, zeta, levels, shares, start=0.0):
    """Pieces with these levels and shares and the frequency ratio w0/w."""
    shares = np.asarray(shares) / np.sum(shares)
    levels = np.asarray(levels) / (np.asarray(levels) @ shares)
    return PiecewiseProblem(
        mass_kg=MASS,
        damping_ns_per_m=2 * zeta * math.sqrt(STIFFNESS * MASS),
        stiffness_n_per_m=STIFFNESS * levels,
        durations_s=shares * 2 * math.pi * ratio / W0,
        force_n=FORCE,
        start_s=start,
    )


def random_pieces(rng, most=7, zetas=(1e-3, 5.0), ratios=(0.02, 60.0)):
    count = int(rng.integers(2, most + 1))
    low, high = [(0.05, 2), (0.9, 1.1), (0.5, 1.5)][rng.integers(3)]
    return scaled(
        math.exp(rng.uniform(*np.log(ratios))),
        math.exp(rng.uniform(*np.log(zetas))),
        rng.uniform(low, high, count),
        rng.dirichlet(np.full(count, 3.0)) + 1e-3,
    )


def pair(damping=9e3, variation=0.13, duty=0.5):
    return PiecewiseProblem.rectangular(MASS, damping, STIFFNESS, variation, duty, 1.6e-3, FORCE)


def exact_acceleration(p, count):
    m, pieces = p.mass_kg, len(p.durations_s)
    return reference.acceleration_lines(
        p.damping_ns_per_m / (2 * m),
        p.stiffness_n_per_m / m,
        p.durations_s,
        np.full(pieces, p.force_n / m),
        np.arange(count + 1),
    ).astype(complex)


@pytest.mark.parametrize("seed", range(12))
def test_lines_against_long_precision(seed):
    rng = np.random.default_rng(seed)
    solved = 0
    while solved < 8:
        p = random_pieces(rng)
        motion = solve_exactly(p)
        if not motion.stable:
            continue
        solved += 1
        exact = exact_acceleration(p, 40)
        found = motion.lines(40, "acceleration")
        assert np.linalg.norm(found - exact) <= 1e-9 * np.linalg.norm(exact)


def test_published_pair():
    motion = solve_exactly(pair())
    half = motion.lines(13)
    assert 1e6 * half[0].real == pytest.approx(5.083524, abs=4e-5)
    lines = 2 * np.abs(half[[1, 3, 5, 7, 13, 2, 12]])
    published = [8.4559e-7, 2.9217e-7, 1.8862e-7, 1.5056e-7, 1.0597e-7, 5.182e-9, 2.486e-8]
    # those come from odd harmonics up to 41 only
    np.testing.assert_allclose(lines, published, rtol=2e-2)
    np.testing.assert_allclose(lines[:4], published[:4], rtol=6e-5)
    assert 2 * np.abs(motion.lines(60, "acceleration")).max() == pytest.approx(276.2, abs=0.2)


def test_uniform_stiffness_only_deflects():
    found = solve_exactly(scaled(3.3, 0.05, [1.0, 1.0, 1.0], [0.2, 0.5, 0.3])).lines(10)
    assert found[0].real == pytest.approx(FORCE / STIFFNESS, rel=1e-13)
    assert np.abs(found[1:]).max() < 1e-13 * FORCE / STIFFNESS


def test_many_harmonics_approach_the_exact_lines_at_second_order():
    p = pair(damping=3e3, duty=0.412)
    exact = solve_exactly(p).lines(10)
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
    t, ends = phase * period, np.cumsum(p.durations_s / period)
    piece = np.searchsorted(ends, phase, side="right")
    z, v, a, f = (
        r.at(t, kind) for kind in ("displacement", "velocity", "acceleration", "mesh_force")
    )
    force = p.mass_kg * a + p.damping_ns_per_m * v + p.stiffness_n_per_m[piece] * z
    np.testing.assert_allclose(force, FORCE, rtol=1e-11)
    np.testing.assert_allclose(f, FORCE - p.mass_kg * a, rtol=1e-9)
    np.testing.assert_allclose(r.at(t + 3 * period), z, rtol=1e-9)
    step = 1e-5 * period
    slope = (r.at(t + step) - r.at(t - step)) / (2 * step)
    scale = np.abs(v).max()
    assert np.median(np.abs(slope - v)) < 1e-6 * scale
    # state and velocity pass the jumps without a jump
    jumps = ends[:-1] * period
    np.testing.assert_allclose(r.at(jumps - 1e-9 * period), r.at(jumps + 1e-9 * period), rtol=1e-6)


def test_the_certified_answer_approaches_the_exact_one():
    p = pair(damping=3e3, duty=0.412)
    exact = solve_exactly(p).lines(10)
    errors = [
        np.linalg.norm(steady_state(p.hill(count), 1e-9).displacement[:11] - exact)
        for count in (50, 400)
    ]
    assert errors[1] < errors[0] / 30


def test_a_shift_of_time_turns_the_lines():
    still, moved = (scaled(5.5, 0.1, [1.2, 0.8], [0.4, 0.6], start=x) for x in (0.0, 7e-5))
    turn = np.exp(-2j * math.pi * np.arange(31) / still.period_s * 7e-5)
    a, b = (solve_exactly(p).lines(30) for p in (still, moved))
    np.testing.assert_allclose(b, a * turn, rtol=1e-10, atol=1e-20)


def test_cut_pieces_change_nothing():
    whole = scaled(8.0, 0.02, [1.3, 0.8], [0.3, 0.7])
    cut = scaled(8.0, 0.02, [1.3, 1.3, 0.8, 0.8, 0.8], [0.1, 0.2, 0.3, 0.1, 0.3])
    a, b = (solve_exactly(p) for p in (whole, cut))
    np.testing.assert_allclose(a.lines(40), b.lines(40), rtol=1e-9)
    assert abs(a.floquet_multipliers[0] - b.floquet_multipliers[0]) < 1e-12


def test_one_cracked_tooth_against_piece_by_piece_sums():
    levels = np.array([1.13, 0.87] * 13)
    levels[2] *= 0.8
    p = scaled(60.0, 0.05, levels, [0.412, 0.588] * 13)
    found, exact = solve_exactly(p).lines(300, "acceleration"), exact_acceleration(p, 300)
    assert np.linalg.norm(found - exact) < 1e-10 * np.linalg.norm(exact)


@pytest.mark.parametrize("variation", [0.13, 0.3])
@pytest.mark.parametrize("duty", [0.5, 0.412])
def test_multipliers_are_those_of_meissner(variation, duty):
    p = pair(damping=400.0, variation=variation, duty=duty)
    h = p.damping_ns_per_m / (2 * p.mass_kg)
    w = np.sqrt(p.stiffness_n_per_m / p.mass_kg - h**2)
    angle = w * p.durations_s
    trace = 2 * math.cos(angle[0]) * math.cos(angle[1])
    trace -= (w[0] / w[1] + w[1] / w[0]) * math.sin(angle[0]) * math.sin(angle[1])
    first, second = solve_exactly(p).floquet_multipliers
    fade = math.exp(-h * p.period_s)
    assert first + second == pytest.approx(fade * trace, rel=1e-12)
    assert first * second == pytest.approx(fade**2, rel=1e-12)
    assert abs(first) >= abs(second)


def test_what_grows_and_what_has_no_periodic_motion():
    assert not solve_exactly(scaled(0.5, 1e-3, [1.3, 0.7], [0.5, 0.5])).stable
    with pytest.raises(ArgumentError, match="no periodic solution"):
        solve_exactly(scaled(3.0, 0.0, [1.0, 1.0], [0.5, 0.5]))


def test_lines_sum_to_the_motion():
    p = pair()
    r = solve_exactly(p)
    half = r.lines(3000)
    t = np.linspace(0, p.period_s, 33)
    phase = np.exp(2j * math.pi / p.period_s * t[:, None] * np.arange(1, 3001))
    z = half[0].real + 2 * (phase @ half[1:]).real
    np.testing.assert_allclose(z, r.at(t), rtol=5e-9)


def test_harmonics_of_the_pieces():
    n = np.arange(1, 8)
    expected = 0.13 * np.sin(n * math.pi * 0.412) / (n * math.pi * (1 - 0.412))
    found = pair(duty=0.412).hill(7).stiffness_harmonics
    np.testing.assert_allclose(found, expected, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass_kg": 0.0}, "mass_kg=0.0 kg must be > 0"),
        ({"damping_ns_per_m": -1.0}, "must be >= 0"),
        ({"stiffness_n_per_m": [1.0, 0.0]}, "piece 2 is 0.0 N/m, must be finite and > 0"),
        ({"stiffness_n_per_m": [[1.0]]}, "one row"),
        ({"durations_s": [1.0]}, "1 values for 2 pieces"),
        ({"durations_s": [1.0, math.nan]}, "piece 2 is nan s"),
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
        pair().hill(0)
    with pytest.raises(ArgumentError, match="kind='jerk'"):
        solve_exactly(pair()).at(0.0, "jerk")
