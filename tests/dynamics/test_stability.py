"""Floquet multipliers over grids, boundaries and margins: Mathieu, Meissner, laws, integration."""

import math
from dataclasses import replace

import numpy as np
import pytest
from reference.hill_cases import random_problem, scaled_problem
from reference.hill_reference import period_map
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

from gearmon.dynamics import HillProblem, floquet
from gearmon.dynamics.stability import (
    FourierShape,
    certainly_stable_up_to,
    shape_of,
    stability_chart,
    stability_map,
    stability_map_of,
    stability_margin,
    tongue_edges,
)
from gearmon.errors import ArgumentError

COSINE = FourierShape(np.array([0.5]))


def rectangle(duty, count=600):
    """+1 for a share of the period, -D/(1-D) for the rest, without what is above `count`."""
    n = np.arange(1, count + 1)
    return FourierShape(np.sin(n * math.pi * duty) / (n * math.pi * (1 - duty)))


def growth_of(shape, ratio, variation, zeta, tolerance=1e-12):
    return floquet.growth_of(ratio, variation, np.asarray(zeta), shape.harmonics, tolerance)


def damped_trace(ratio, zeta, harmonics, tolerance=1e-13):
    value, log = floquet.half_traces(
        np.array(ratio), np.array(1.0), np.array(zeta), harmonics, tolerance
    )
    return 2 * float(value) * math.exp(float(log) - 2 * math.pi * ratio * zeta)


@pytest.mark.parametrize("seed", range(8))
def test_traces_match_time_integration(seed):
    rng = np.random.default_rng(seed)
    p = random_problem(rng, 20, ratios=(0.2, 10.0), zetas=(1e-3, 0.5))
    exact = np.trace(period_map(p))
    found = damped_trace(p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics)
    # the integration is good to a few 1e-12 of its largest intermediate values
    assert found == pytest.approx(exact, abs=2e-10)


@pytest.mark.parametrize("seed", range(6))
def test_a_chart_from_few_period_maps_is_that_of_every_point(seed):
    rng = np.random.default_rng(seed)
    c = (rng.normal(size=7) + 1j * rng.normal(size=7)) / np.arange(1, 8)
    shape, zeta = FourierShape(c / np.abs(c).sum()), float(rng.choice([0.0, 0.03, 1.2]))
    low, tolerance = rng.uniform(0.4, 2), 10 ** rng.uniform(-11, -6)
    x, eps = np.linspace(low, 1.5 * low, 60), np.linspace(-0.3, 0.4, 50)
    chart = stability_chart(shape, x, eps, zeta, tolerance)
    each = growth_of(shape, 1 / x, eps[:, None], zeta, 1e-13)
    traces = (np.cosh(growth + 2 * math.pi * zeta / x) for growth in (chart.growth, each))
    np.testing.assert_allclose(*traces, rtol=tolerance)


@pytest.mark.parametrize(("ratio", "count"), [(0.05, 1), (3.3, 5), (50.0, 64), (120.0, 3)])
def test_traces_match_floquet_steps(ratio, count):
    rng = np.random.default_rng(count)
    c = (rng.normal(size=count) + 1j * rng.normal(size=count)) / np.arange(1, count + 1)
    c *= 0.5 / (2 * np.abs(c).sum())
    for zeta in (0.0, 0.02, 0.9, 1.5):
        pair = floquet.multipliers(ratio, zeta, c, 1e-12)
        exact = (pair[0] + pair[1]).real
        found = damped_trace(ratio, zeta, c)
        assert found == pytest.approx(exact, rel=1e-8, abs=1e-9 * max(1e-9, abs(pair[0])))


def test_magnus_steps_are_of_sixth_order():
    c = np.array([0.2, 0.05j])
    system = np.array([[3.3], [1.0], [0.05]])
    values = []
    for count in (16, 32, 64, 128, 2048):
        value, log = floquet._magnus(system, c, count)
        values.append(float(value[0] * np.exp(log[0])))
    errors = np.abs(np.array(values[:4]) - values[4])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 6, atol=0.2)


def test_constant_stiffness_and_strong_growth():
    value, log = floquet.half_traces(
        np.array([0.7, 40.0]), np.array(0.0), np.array(0.3), np.array([0.5])
    )
    angle = 2 * math.pi * np.array([0.7, 40.0]) * math.sqrt(1 - 0.09)
    np.testing.assert_allclose(value * np.exp(log), np.cos(angle), atol=1e-12)
    # a spring of negative stiffness most of the time: growth far beyond the range of doubles
    value, log = floquet.half_traces(
        np.array(300.0), np.array(40.0), np.array(0.0), np.array([0.5])
    )
    assert np.isfinite(value).all()
    assert floquet.growth(value, log) > 1000


@pytest.mark.parametrize("tongue", [1, 2, 3, 4])
@pytest.mark.parametrize("eps", [0.1, 0.4, 0.8])
def test_edges_of_mathieu(tongue, eps):
    # a = 4 w0^2/w^2, q = 2 eps w0^2/w^2
    low, high = tongue_edges(COSINE, tongue, [eps])[0]

    def equation(function):
        return lambda x: function(tongue, 2 * eps / x**2) - 4 / x**2

    wide = (high - low) / 2 + 1e-6
    for edge, function in ((low, mathieu_a), (high, mathieu_b)):
        exact = brentq(equation(function), edge - wide, edge + wide, xtol=1e-15, rtol=1e-14)
        assert edge == pytest.approx(exact, rel=1e-13)


def test_published_edges_of_mathieu():
    published = [
        (1.974923167, 2.024920721),
        (1.949698438, 2.049678773),
        (1.898848110, 2.098687561),
        (1.795989323, 2.194599747),
    ]
    np.testing.assert_allclose(
        tongue_edges(COSINE, 1, [0.05, 0.1, 0.2, 0.4]), published, atol=6e-10
    )


@pytest.mark.parametrize(
    ("duty", "eps", "edges"),
    [
        (0.5, 0.13, [(1.916507, 2.081913), (0.993654, 1.002099), (0.656588, 0.674168)]),
        (0.412, 0.13, [(1.931515, 2.067451), (0.992041, 1.005049), (0.659347, 0.672215)]),
        (0.5, 0.3, [(1.805814, 2.186257), (0.966032, 1.010882), (0.643444, 0.675744)]),
    ],
)
def test_published_edges_of_meissner(duty, eps, edges):
    shape = rectangle(duty)
    levels, shares = np.array([1.0, -duty / (1 - duty)]), np.array([duty, 1 - duty])
    for tongue, published in enumerate(edges, start=1):
        found = tongue_edges(shape, tongue, [eps])[0]
        np.testing.assert_allclose(found, published, atol=6e-7)
        # on the edge the trace of Meissner's formula is +-2, up to what the series leaves out
        for x in found:
            w = np.sqrt(1 + eps * levels)
            angle = w * 2 * math.pi / x * shares
            trace = 2 * math.cos(angle[0]) * math.cos(angle[1])
            trace -= (w[0] / w[1] + w[1] / w[0]) * math.sin(angle[0]) * math.sin(angle[1])
            assert trace == pytest.approx(2 * (-1) ** tongue, abs=1e-9)


def test_first_order_of_meissner():
    # w/w0 = (2 +- eps c_n/2)/n with c_n the real amplitude of the n-th harmonic
    for duty, tongue, amplitude in ((0.5, 1, 1.273240), (0.5, 3, 0.424413), (0.412, 1, 1.041575)):
        shape = rectangle(duty, 20)
        assert 2 * abs(shape.harmonics[tongue - 1]) == pytest.approx(amplitude, abs=1e-6)
        low, high = tongue_edges(shape, tongue, [1e-4])[0]
        assert (high - low) / 1e-4 == pytest.approx(amplitude / tongue, rel=1e-4)


@pytest.mark.parametrize("zeta", [0.003, 0.05, 0.3])
def test_damping_by_substitution(zeta):
    # z = e^{-h t} y: the growth of y at w0^2 - h^2 is that of z and h together
    rest = 1 - zeta**2
    x = np.array([0.9, 1.7, 2.02])
    damped = growth_of(COSINE, 1 / x, np.array(0.6), zeta)
    plain = growth_of(COSINE, math.sqrt(rest) / x, np.array(0.6 / rest), 0.0)
    np.testing.assert_allclose(damped, plain - 2 * math.pi * zeta / x, atol=1e-11)


@pytest.mark.parametrize("shape", [COSINE, rectangle(0.412, 12)])
def test_damped_edges_have_no_growth(shape):
    eps = np.array([0.05, 0.2, 0.5, 0.9])
    for tongue in (1, 2, 3):
        edges = tongue_edges(shape, tongue, eps, 0.02)
        for variation, (low, high) in zip(eps, edges, strict=True):
            if math.isnan(low):
                around = np.linspace(1.8, 2.1, 400) / tongue
                assert (growth_of(shape, 1 / around, np.array(variation), 0.02) <= 1e-12).all()
                continue
            assert low < high
            for edge, inwards in ((low, 1), (high, -1)):
                near = edge + inwards * np.array([-1e-7, 0, 1e-7])
                outside, on, inside = growth_of(shape, 1 / near, np.array(variation), 0.02)
                assert outside < 0 < inside
                assert abs(on) < 1e-11


def test_principal_tongue_opens_at_four_times_the_damping_ratio():
    zeta = 1e-4
    shape = rectangle(0.5, 20)
    threshold = 4 * zeta / 1.2732395447
    closed, opened = tongue_edges(shape, 1, [0.995 * threshold, 1.005 * threshold], zeta)
    assert np.isnan(closed).all()
    assert np.isfinite(opened).all()


def test_chart_equals_single_answers():
    rng = np.random.default_rng(2)
    c = (rng.normal(size=6) + 1j * rng.normal(size=6)) / 30
    x, eps = np.array([0.3, 0.97, 2.05]), np.array([0.2, 1.0])
    chart = stability_chart(FourierShape(c), x, eps, 0.01)
    assert chart.growth.shape == (2, 3)
    for row, variation in enumerate(eps):
        for column, speed in enumerate(x):
            largest = abs(floquet.multipliers(1 / speed, 0.01, variation * c, 1e-12)[0])
            assert chart.largest_multiplier[row, column] == pytest.approx(largest, rel=1e-7)


@pytest.mark.parametrize("ratio", [0.5, 0.97, 1.5, 4.03])
@pytest.mark.parametrize("zeta", [0.002, 0.02])
def test_margin_is_the_boundary(ratio, zeta):
    p = scaled_problem(ratio, zeta, [0.06, 0.03j, 0.02])
    m = stability_margin(p)
    assert m.multipliers[0] == pytest.approx(
        floquet.multipliers(ratio, zeta, p.stiffness_harmonics, 1e-12)[0], rel=1e-8
    )
    assert m.stable == (abs(m.multipliers[0]) < 1) == (m.variation_factor > 1)
    if math.isinf(m.variation_factor):
        factors = np.linspace(0, 0.999 * m.positive_factor, 400)
        shape = FourierShape(p.stiffness_harmonics)
        assert (growth_of(shape, np.array(ratio), factors, zeta) < 0).all()
        return
    for factor, grows in (
        (m.variation_factor * (1 - 1e-8), False),
        (m.variation_factor * (1 + 1e-8), True),
    ):
        scaled = replace(p, stiffness_harmonics=factor * p.stiffness_harmonics)
        found = stability_margin(scaled, search=False)
        assert (abs(found.multipliers[0]) > 1) == grows
        assert math.isnan(found.variation_factor)


def test_margin_of_what_cannot_grow():
    paper = HillProblem(0.28, 9e3, 8e8, [0.0828], 1.6e-3, 4e3)
    assert math.isinf(stability_margin(paper).variation_factor)
    still = stability_margin(HillProblem(0.28, 9e3, 8e8, [], 1.6e-3, 4e3))
    assert still.stable
    assert math.isinf(still.variation_factor)
    assert "undamped" in stability_margin(HillProblem(1.0, 0.0, 1.0, [0.01], 1.0, 1.0)).message


@pytest.mark.parametrize("seed", range(5))
def test_certain_stability_is_certain(seed):
    rng = np.random.default_rng(seed)
    p = random_problem(rng, 5, ratios=(0.3, 20.0), zetas=(0.003, 0.5))
    shape = FourierShape(p.stiffness_harmonics)
    most = 1 / -shape.extremes[0]
    for ratio in np.linspace(0.3, 8, 60):
        safe = certainly_stable_up_to(shape, ratio, p.damping_ratio, most)
        assert 0 < safe <= most
        factors = safe * np.linspace(0.05, 1, 6)
        growth = growth_of(shape, np.array(ratio), factors, p.damping_ratio, 1e-8)
        assert (growth < 0).all()


def test_shape_of_a_problem():
    p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    shape, eps = shape_of(p)
    assert eps == pytest.approx(0.13)
    np.testing.assert_allclose(shape.harmonics, [0.5])


def test_map_holds_exact_and_expanded_boundaries():
    found = stability_map(COSINE, 0.02, (0.8, 2.4), 0.6, orders=(1, 2), points=(40, 20))
    assert [t.number for t in found.tongues] == [1, 2]
    first = found.tongues[0]
    opened = np.isfinite(first.exact[:, 0])
    assert first.variations[opened][0] == pytest.approx(0.08, abs=1e-3)
    errors = {
        k: np.nanmax(np.abs(edges - first.exact)[first.variations < 0.25])
        for k, edges in first.expanded.items()
    }
    assert errors[2] < 0.3 * errors[1] < 1e-3
    p = HillProblem(0.28, 300.0, 8e8, [0.065], 6e-5, 4e3)
    assert stability_map_of(p, orders=(), points=(4, 4)).mark == pytest.approx(
        (1 / p.frequency_ratio, 0.13)
    )


@pytest.mark.parametrize("zeta", [1.0, 1.4, 5.0])
def test_an_overdamped_map_has_no_tongues_and_is_stable(zeta):
    found = stability_map(COSINE, zeta, points=(8, 6))
    assert found.tongues == ()
    assert not found.chart.unstable.any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: FourierShape(np.zeros(0)), "at least one"),
        (lambda: stability_chart(COSINE, [0.0], [0.1]), "speeds=0.0"),
        (lambda: stability_chart(COSINE, [1.0], [0.1], -0.1), "damping_ratio=-0.1"),
        (lambda: tongue_edges(COSINE, 0, [0.1]), "tongue=0"),
        (lambda: tongue_edges(COSINE, 1, [1.2]), "must stay > 0"),
        (lambda: stability_map(COSINE, speeds=(2.0, 1.0)), "the first must be smaller"),
        (lambda: stability_map(COSINE, highest_variation=2.0), "highest_variation=2.0"),
        (lambda: shape_of(HillProblem(1.0, 1.0, 1.0, [], 1.0, 1.0)), "does not vary"),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_k_touches_zero_where_the_deepest_dip_reaches_its_mean():
    """f = 0.2 cos x + 0.1 cos 2x lies between -0.15 at cos x = -1/2 and 0.3."""
    problem = HillProblem(0.28, 9e3, 8e8, [0.1, 0.05], 1.6e-3, 4e3)
    assert stability_margin(problem).positive_factor == pytest.approx(1 / 0.15, rel=1e-3)
