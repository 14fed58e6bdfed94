"""Pieces of curves, their integrals and their Fourier integrals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearmon.gears.pulses import Pulse, PulseTerm, PulseTrain

NUMBERS = st.floats(-3, 3)


@st.composite
def pulses(draw):
    """Two or three pieces with a gap or none, polynomial and oscillating."""
    count = draw(st.integers(1, 3))
    edges = np.cumsum([draw(st.floats(0.05, 0.8)) for _ in range(2 * count)])
    starts, ends = edges[0::2], edges[1::2]
    if draw(st.booleans()):
        starts[1:] = ends[:-1]
    table = [[draw(NUMBERS) for _ in range(3)] for _ in range(count)]
    modes = draw(st.integers(0, 2))
    weights = [[complex(draw(NUMBERS), draw(NUMBERS)) for _ in range(modes)] for _ in range(count)]
    rates = [[draw(st.floats(0.5, 40)) for _ in range(modes)] for _ in range(count)]
    return Pulse(
        starts=starts,
        ends=ends,
        polynomial=np.array(table),
        weights=np.array(weights, dtype=complex).reshape(count, modes),
        rates=np.array(rates).reshape(count, modes),
    )


def gauss(pulse, nodes=60):
    """Gauss points and weights on all pieces."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    half = 0.5 * (pulse.ends - pulse.starts)[:, None]
    points = 0.5 * (pulse.ends + pulse.starts)[:, None] + half * x
    return points.ravel(), (half * w).ravel()


@settings(max_examples=60, deadline=None)
@given(pulses(), st.lists(st.floats(-12, 12), min_size=1, max_size=5))
def test_transform_against_quadrature(pulse, orders):
    x, w = gauss(pulse)
    slow = np.exp(-2j * np.pi * np.outer(orders, x)) @ (w * pulse.value(x))
    np.testing.assert_allclose(pulse.transform(orders), slow, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(pulses(), st.floats(-1, 6))
def test_integral_against_quadrature(pulse, end):
    part = pulse.window(-1.0, end)
    x, w = gauss(part) if len(part.starts) else (np.zeros(0), np.zeros(0))
    assert pulse.integral(end) == pytest.approx(float(w @ pulse.value(x)), abs=1e-12)
    assert pulse.integral(pulse.length + 1) == pytest.approx(pulse.area, abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(pulses(), st.floats(0, 4), st.floats(0, 4))
def test_windows_and_cuts(pulse, one, two):
    low, high = min(one, two), max(one, two)
    x = np.linspace(0, 5, 301)
    inside = (x >= low) & (x < high)
    part = pulse.window(low, high).value(x)
    np.testing.assert_allclose(part, np.where(inside, pulse.value(x), 0), atol=1e-12)
    np.testing.assert_allclose(pulse.cut([low, high]).value(x), pulse.value(x), atol=1e-12)
    np.testing.assert_allclose(pulse.scaled(-2).value(x), -2 * pulse.value(x), atol=1e-12)


@given(st.floats(1e-12, 1.0))
def test_transform_is_smooth_at_order_zero(order):
    """Where the closed forms 0/0 are replaced by series nothing jumps."""
    pulse = Pulse(
        starts=np.array([0.2]), ends=np.array([1.7]), polynomial=np.array([[0.3, -1.0, 2.0]])
    )
    x, w = gauss(pulse)
    slow = np.exp(-2j * np.pi * order * x) @ (w * pulse.value(x))
    np.testing.assert_allclose(pulse.transform([order])[0], slow, rtol=1e-13, atol=1e-14)


def test_an_empty_window_is_zero():
    pulse = Pulse(starts=np.array([0.0]), ends=np.array([1.0]), polynomial=np.ones((1, 3)))
    empty = pulse.window(2.0, 3.0)
    assert (empty.length, empty.area) == (0.0, 0.0)
    assert empty.value([0.5, 2.5]).tolist() == [0.0, 0.0]
    assert empty.integral([0.5, 2.5]).tolist() == [0.0, 0.0]


@settings(max_examples=30, deadline=None)
@given(pulses(), st.integers(1, 4), st.floats(0, 3), st.floats(0, 2.5), st.floats(0.1, 0.9))
def test_trains_repeat_and_their_coefficients_are_those_of_the_curve(
    pulse, period, offset, overlap, face
):
    """Pulses longer than the period overlap; sections of the face width lag behind."""
    term = PulseTerm(pulse=pulse, weight=-0.7, offset=offset, face_end=face)
    train = PulseTrain(gear="pinion", period_mesh=period, overlap_ratio=overlap, terms=(term,))
    x = np.linspace(0, period, 50)
    np.testing.assert_allclose(train.at(x + 3 * period), train.at(x), atol=1e-9)
    # coefficients of the sum = transform of one pulse: check with a slow sum over sections
    orders = np.arange(4)
    sections = face * (np.arange(2000) + 0.5) / 2000
    lag = np.exp(-2j * np.pi * np.outer(orders / period, sections * overlap + offset)).mean(axis=1)
    slow = -0.7 * face * lag * pulse.transform(orders / period) / period
    np.testing.assert_allclose(train.coefficients(orders), slow, atol=1e-5)


def test_sections_of_a_pulse_are_averaged():
    box = Pulse(starts=np.array([0.0]), ends=np.array([1.0]), polynomial=np.array([[1.0, 0, 0]]))
    train = PulseTrain(gear="gear", period_mesh=9, overlap_ratio=2.0, terms=(PulseTerm(pulse=box),))
    # a box seen through a window of two mesh periods is a trapezoid of height 1/2
    x = [0.0, 0.5, 1.0, 1.7, 2.0, 2.5, 3.0, 5.0]
    expected = [0.0, 0.25, 0.5, 0.5, 0.5, 0.25, 0.0, 0.0]
    np.testing.assert_allclose(train.at(x), expected, atol=1e-14)
