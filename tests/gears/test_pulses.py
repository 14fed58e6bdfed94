"""Pieces of curves, their integrals and their Fourier integrals."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import spherical_jn

from gearmon.gears.pulses import (
    Pulse,
    PulseTerm,
    PulseTrain,
    panel_nodes,
    spherical_bessel,
)
from gearmon.gears.stiffness import FORMS

NUMBERS = st.floats(-3, 3)


@st.composite
def pulses(draw):
    """One to three pieces, of parabolas and oscillations that need not join."""
    count = draw(st.integers(1, 3))
    edges = np.cumsum([draw(st.floats(0.05, 0.8)) for _ in range(count + 1)])
    table = np.array([[draw(NUMBERS) for _ in range(5)] for _ in range(count)])[..., None]
    rate = draw(st.floats(0.5, 40))

    def curve(x):
        smooth = table[:, 0] + table[:, 1] * x + table[:, 2] * x * x
        return smooth + table[:, 3] * np.cos(rate * x) + table[:, 4] * np.sin(rate * x)

    return Pulse.of(edges, curve, 48)


def gauss(pulse, nodes=60):
    """Gauss points and weights on all pieces."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    starts, ends = pulse.edges[:-1], pulse.edges[1:]
    half = 0.5 * (ends - starts)[:, None]
    points = 0.5 * (ends + starts)[:, None] + half * x
    return points.ravel(), (half * w).ravel()


@given(pulses(), st.lists(st.floats(-12, 12), min_size=1, max_size=5))
def test_transform_against_quadrature(pulse, orders):
    x, w = gauss(pulse)
    slow = np.exp(-2j * np.pi * np.outer(orders, x)) @ (w * pulse.value(x))
    np.testing.assert_allclose(pulse.transform(orders), slow, atol=1e-12)


@given(pulses(), st.floats(-1, 6))
def test_integral_against_quadrature(pulse, end):
    part = pulse * Pulse.constant(-1.0, end)
    x, w = gauss(part) if len(part.series) else (np.zeros(0), np.zeros(0))
    assert pulse.integral(end) == pytest.approx(float(w @ pulse.value(x)), abs=1e-12)
    assert pulse.integral(pulse.length + 1) == pytest.approx(pulse.area, abs=1e-12)


@given(pulses(), st.floats(0, 4), st.floats(0, 4))
def test_windows_and_cuts(pulse, one, two):
    low, high = min(one, two), max(one, two)
    x = np.linspace(0, 5, 301)
    inside = (x >= low) & (x < high)
    part = (pulse * Pulse.constant(low, high)).value(x) if low < high else 0 * x
    np.testing.assert_allclose(part, np.where(inside, pulse.value(x), 0), atol=1e-12)
    cut = pulse * Pulse(np.array([-1.0, low, high + 0.1, 9.0]), np.ones((3, 1)))
    np.testing.assert_allclose(cut.value(x), pulse.value(x), atol=1e-12)
    np.testing.assert_allclose(pulse.scaled(-2).value(x), -2 * pulse.value(x), atol=1e-12)


@given(st.floats(1e-12, 1.0))
def test_transform_is_smooth_at_order_zero(order):
    """Where the closed forms 0/0 are replaced by series nothing jumps."""
    pulse = Pulse.of([0.2, 1.7], lambda x: 0.3 - x + 2 * x * x)
    x, w = gauss(pulse)
    slow = np.exp(-2j * np.pi * order * x) @ (w * pulse.value(x))
    np.testing.assert_allclose(pulse.transform([order])[0], slow, rtol=1e-13, atol=1e-14)


def test_an_empty_window_is_zero():
    pulse = Pulse.of([0.0, 1.0], lambda x: 1 + x + x * x)
    empty = pulse * Pulse.constant(2.0, 3.0)
    assert (empty.length, empty.area) == (0.0, 0.0)
    assert empty.value([0.5, 2.5]).tolist() == [0.0, 0.0]
    assert empty.integral([0.5, 2.5]).tolist() == [0.0, 0.0]


# a mean over a narrower part is the difference of two integrals over next to nothing: rounding
OVERLAPS = st.just(0.0) | st.floats(1e-4, 2.5)


@given(pulses(), st.integers(1, 4), st.floats(0, 3), OVERLAPS, st.floats(0.1, 0.9))
def test_trains_repeat_and_their_coefficients_are_those_of_the_curve(
    pulse, period, offset, overlap, face
):
    """Pulses longer than the period overlap; sections of the face width lag behind."""
    term = PulseTerm(pulse=pulse, weight=-0.7, offset=offset, face_end=face)
    train = PulseTrain(gear="pinion", period_mesh=period, overlap_ratio=overlap, terms=(term,))
    # not where a plain number is the phase of a jump, which rounding moves to one of its sides
    x = np.linspace(0, period, 50) + 0.01 * np.sqrt(2)
    np.testing.assert_allclose(train.at(x + 3 * period), train.at(x), atol=1e-9)
    # coefficients of the sum = transform of one pulse: check with a slow sum over sections
    orders = np.arange(4)
    sections = face * (np.arange(2000) + 0.5) / 2000
    lag = np.exp(-2j * np.pi * np.outer(orders / period, sections * overlap + offset)).mean(axis=1)
    slow = -0.7 * face * lag * pulse.transform(orders / period) / period
    np.testing.assert_allclose(train.coefficients(orders), slow, atol=1e-5)


def test_sections_of_a_pulse_are_averaged():
    box = Pulse.of([0.0, 1.0], np.ones_like)
    train = PulseTrain(gear="gear", period_mesh=9, overlap_ratio=2.0, terms=(PulseTerm(pulse=box),))
    # a box seen through a window of two mesh periods is a trapezoid of height 1/2
    x = [0.0, 0.5, 1.0, 1.7, 2.0, 2.5, 3.0, 5.0]
    expected = [0.0, 0.25, 0.5, 0.5, 0.5, 0.25, 0.0, 0.0]
    np.testing.assert_allclose(train.at(x), expected, atol=1e-14)


# --- Legendre series -----------------------------------------------------------------------------

EDGES = np.array([0.0, 0.4, 1.0, 1.4])


def curve(x):
    return np.where(x < 0.4, np.exp(x), np.where(x < 1.0, 3 + np.sin(4 * x), 1 / (0.5 + np.abs(x))))


PULSE = Pulse.of(EDGES, curve)


def integral(low, high, function):
    x, w = np.polynomial.legendre.leggauss(150)
    parts = np.clip(EDGES, low, high)
    total = 0
    for a, b in pairwise(parts):
        total = total + 0.5 * (b - a) * np.sum(w * function(0.5 * (a + b) + 0.5 * (b - a) * x))
    return total


@pytest.mark.parametrize("count", [1, 5, 16, 140, 900])
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
    curves = Pulse.through(EDGES, np.stack([curve(x), np.ones_like(x)], axis=-1))
    where = np.array([[0.0, 0.13], [0.4, 0.77], [1.0, 1.4]])
    running = curves.running([0.0, 2.0]).at(where)
    slow = [[integral(0, w, curve) for w in row] for row in where]
    np.testing.assert_allclose(running[0], slow, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(running[1], 2 + where, rtol=1e-13)
    np.testing.assert_allclose(curves.running().at(1.4), [integral(0, 1.4, curve), 1.4])


def test_values_integral_and_area():
    x = np.array([[-0.5, 0.0, 0.2], [0.399, 0.4, 0.9], [1.2, 1.4, 7.0]])
    inside = (x >= 0) & (x < 1.4)
    np.testing.assert_allclose(PULSE.value(x), np.where(inside, curve(x), 0.0), rtol=1e-12)
    slow = [[integral(0, min(max(v, 0), 1.4), curve) for v in row] for row in x]
    np.testing.assert_allclose(PULSE.integral(x), slow, rtol=1e-12, atol=1e-15)
    assert PULSE.area == pytest.approx(integral(0, 1.4, curve))
    assert PULSE.length == 1.4
    assert PULSE.limits[1] == pytest.approx((float(curve(0.4)), 3 + np.sin(4.0)))


@given(st.floats(-40, 40))
def test_transform_is_the_fourier_integral(order):
    slow = integral(0, 1.4, lambda x: curve(x) * np.exp(-2j * np.pi * order * x))
    assert abs(PULSE.transform([order])[0] - slow) < 1e-10


def test_parts_of_a_pulse():
    window = PULSE * Pulse.constant(0.2, 1.1)
    x = np.linspace(0.21, 1.09, 50)
    np.testing.assert_allclose(window.value(x), PULSE.value(x), rtol=1e-11)
    assert (window.edges[0], window.edges[-1]) == (0.2, 1.1)
    cut = PULSE * Pulse(np.array([0.0, 0.1, 0.4, 0.7, 2.0]), np.ones((4, 1)))
    assert len(cut.series) == 5
    np.testing.assert_allclose(cut.value(x), PULSE.value(x), rtol=1e-11)
    np.testing.assert_allclose(PULSE.scaled(-2.0).transform([1.3]), -2 * PULSE.transform([1.3]))
    empty = PULSE * Pulse.constant(2.0, 3.0)
    assert empty.value([0.5]) == 0
    assert empty.integral([0.5]) == 0
    assert empty.transform([1.0]) == 0


@pytest.mark.parametrize("name", sorted(FORMS))
def test_products_with_every_form(name):
    """A pulse times 1 is the pulse, however fast it oscillates; corners are kept."""
    pulse = FORMS[name].pulse(1.6)
    same = pulse * Pulse(np.array([0.0, 0.3, 9.0]), np.ones((2, 1)))
    orders = np.linspace(0, 60, 101)
    np.testing.assert_allclose(same.transform(orders), pulse.transform(orders), atol=1e-10)
    step = pulse * Pulse(np.array([0.0, 0.3, 9.0]), np.array([[0.5], [1.0]]))
    x = np.array([0.1, 0.5, 1.3])
    np.testing.assert_allclose(step.value(x), pulse.value(x) * [0.5, 1, 1], rtol=1e-9)
