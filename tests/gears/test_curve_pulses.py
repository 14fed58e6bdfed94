"""Legendre panels and pulses against scipy, polynomials and quadrature."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import spherical_jn

from gearmon.gears.pulses import CurvePulse, PanelCurves, panel_nodes, product, spherical_bessel
from gearmon.gears.stiffness_forms import FORMS

EDGES = np.array([0.0, 0.4, 1.0, 1.4])


def curve(x):
    return np.where(x < 0.4, np.exp(x), np.where(x < 1.0, 3 + np.sin(4 * x), 1 / (0.5 + np.abs(x))))


PULSE = CurvePulse.of(EDGES, curve)


def integral(low, high, function):
    x, w = np.polynomial.legendre.leggauss(150)
    parts = np.clip(EDGES, low, high)
    total = 0
    for a, b in pairwise(parts):
        total = total + 0.5 * (b - a) * np.sum(w * function(0.5 * (a + b) + 0.5 * (b - a) * x))
    return total


@pytest.mark.parametrize("count", [1, 5, 16])
def test_spherical_bessel_functions(count):
    x = np.concatenate(
        [
            [0.0],
            np.geomspace(1e-8, 1e5, 400),
            -np.geomspace(1e-3, 50, 30),
            np.pi * np.arange(1, 8),
            [4.493409457909064, 1.0, 16.0],
        ]
    )
    found = spherical_bessel(count, x)
    expected = np.array([spherical_jn(n, np.abs(x)) * np.sign(x) ** n for n in range(count)])
    expected[0] = spherical_jn(0, np.abs(x))
    np.testing.assert_allclose(found, expected, atol=3e-14)


def test_running_integrals():
    x = panel_nodes(EDGES)
    curves = PanelCurves.through(EDGES, np.stack([curve(x), np.ones_like(x)], axis=-1))
    where = np.array([[0.0, 0.13], [0.4, 0.77], [1.0, 1.4]])
    running = curves.integral([0.0, 2.0]).at(where)
    slow = [[integral(0, w, curve) for w in row] for row in where]
    np.testing.assert_allclose(running[0], slow, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(running[1], 2 + where, rtol=1e-13)
    np.testing.assert_allclose(curves.totals, [integral(0, 1.4, curve), 1.4])


def test_values_integral_and_area():
    x = np.array([[-0.5, 0.0, 0.2], [0.399, 0.4, 0.9], [1.2, 1.4, 7.0]])
    inside = (x >= 0) & (x < 1.4)
    np.testing.assert_allclose(PULSE.value(x), np.where(inside, curve(x), 0.0), rtol=1e-12)
    slow = [[integral(0, min(max(v, 0), 1.4), curve) for v in row] for row in x]
    np.testing.assert_allclose(PULSE.integral(x), slow, rtol=1e-12, atol=1e-15)
    assert PULSE.area == pytest.approx(integral(0, 1.4, curve))
    assert PULSE.length == 1.4
    assert PULSE.limits_of(1) == pytest.approx((float(curve(0.4)), 3 + np.sin(4.0)))


@settings(max_examples=30, deadline=None)
@given(st.floats(-40, 40))
def test_transform_is_the_fourier_integral(order):
    slow = integral(0, 1.4, lambda x: curve(x) * np.exp(-2j * np.pi * order * x))
    assert abs(PULSE.transform([order])[0] - slow) < 1e-10


def test_parts_of_a_pulse():
    window = PULSE.window(0.2, 1.1)
    x = np.linspace(0.21, 1.09, 50)
    np.testing.assert_allclose(window.value(x), PULSE.value(x), rtol=1e-11)
    assert (window.starts[0], window.ends[-1]) == (0.2, 1.1)
    cut = PULSE.cut([0.1, 0.4, 0.7])
    assert len(cut.starts) == 5
    np.testing.assert_allclose(cut.value(x), PULSE.value(x), rtol=1e-11)
    np.testing.assert_allclose(PULSE.scaled(-2.0).transform([1.3]), -2 * PULSE.transform([1.3]))
    empty = PULSE.window(2.0, 3.0)
    assert empty.value([0.5]) == 0
    assert empty.integral([0.5]) == 0
    assert empty.transform([1.0]) == 0


@pytest.mark.parametrize("name", sorted(FORMS))
def test_products_with_every_form(name):
    """A pulse times 1 is the pulse, however fast it oscillates; corners are kept."""
    pulse = FORMS[name].pulse(1.6)
    same = product(pulse, np.ones_like, [0.3])
    orders = np.linspace(0, 60, 101)
    np.testing.assert_allclose(same.transform(orders), pulse.transform(orders), atol=1e-10)
    step = product(pulse, lambda x: np.where(x < 0.3, 0.5, 1.0), [0.3])
    x = np.array([0.1, 0.5, 1.3])
    np.testing.assert_allclose(step.value(x), pulse.value(x) * [0.5, 1, 1], rtol=1e-9)
