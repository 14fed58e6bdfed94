"""Rings under loads on an arc, against finite elements, closed forms and a published fit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.ring_reference import arc_compliance_slow

from gearmon.errors import ArgumentError
from gearmon.gears.tooth import arc_compliance, sainsot


@pytest.mark.parametrize(
    ("ratio", "half", "apart"),
    [(0.4, 0.3, 0.0), (0.4, 0.25, 0.7), (1.3, 0.25, 0.0), (1.15, 0.3, -0.6)],
)
def test_against_finite_elements_of_each_order(ratio, half, apart):
    slow = arc_compliance_slow(ratio, half, 0.3, apart)
    fast = arc_compliance(ratio, half, 0.3, apart)
    own = np.sqrt(np.diag(arc_compliance(ratio, half, 0.3)))
    assert (np.abs(fast - slow) <= 3e-4 * np.outer(own, own)).all()


@pytest.mark.parametrize(("ratio", "angle"), [(3.0, 0.05), (2.0, 0.10), (5.0, 0.03), (1.7, 0.06)])
def test_discs_have_the_shear_and_push_of_the_published_foundation(ratio, angle):
    """P and P Q of Sainsot, Velex & Duverger; their L is larger than the mean rotation."""
    lower, middle, upper, slope = sainsot(ratio, angle)
    found = arc_compliance(1 / ratio, angle, 0.3)
    assert found[1, 1] == pytest.approx(upper, rel=0.05)
    assert found[2, 2] == pytest.approx(upper * slope, rel=0.08)
    assert (2 * angle) ** 2 * found[0, 0] == pytest.approx(0.815 * lower, rel=0.02)
    assert 0 < 2 * 2 * angle * found[0, 1] < middle


def test_torsion_of_a_disc_far_from_the_load():
    """On the far side what is left of the shear is the wind-up, and the shift of the disc."""
    ratio, nu = 0.05, 0.3
    stiff = (1 + nu) / (2 * math.pi) * (ratio**-2 - 1)
    assert arc_compliance(ratio, 0.05, nu, math.pi)[1, 1] == pytest.approx(stiff, rel=0.02)


@given(
    st.one_of(st.floats(0.15, 0.8), st.floats(1.05, 3.0)),
    st.floats(0.02, 0.2),
    st.floats(0.0, 0.45),
    st.floats(0.1, 3.0),
)
def test_reciprocity_and_energy(ratio, half, nu, apart):
    own, there = arc_compliance(ratio, half, nu), arc_compliance(ratio, half, nu, apart)
    back = arc_compliance(ratio, half, nu, -apart)
    scale = np.abs(own).max()
    np.testing.assert_allclose(own, own.T, atol=1e-9 * scale)
    np.testing.assert_allclose(there, back.T, atol=1e-9 * scale)
    # two arcs together store positive energy
    both = np.block([[own, there], [back, own]])
    assert np.linalg.eigvalsh(both).min() > -1e-9 * scale


def test_more_orders_change_nothing(monkeypatch):
    coarse = arc_compliance(1.2, 0.031, 0.3)
    monkeypatch.setattr("gearmon.gears.tooth.ARC_PHASE", 400.0)
    fine = arc_compliance.__wrapped__(1.2, 0.031, 0.3)
    np.testing.assert_allclose(coarse, fine, rtol=1e-3, atol=1e-9)


def test_impossible_rings_are_refused():
    with pytest.raises(ArgumentError, match="half_angle_rad"):
        arc_compliance(1.2, 2.0, 0.3)
    with pytest.raises(ArgumentError, match="ratio=0"):
        arc_compliance(0.0, 0.1, 0.3)
    with pytest.raises(ArgumentError, match="ratio=1"):
        arc_compliance(1.0, 0.1, 0.3)
