"""Modes of cantilevers with tip masses: roots, mass normalisation, limiting cases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.harvesting.beam import beam_modes, mass_ratio_for


def test_bare_beam_has_the_textbook_roots():
    expected = [1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349, 14.1371683910]
    np.testing.assert_allclose(beam_modes(0.0, 0.0, 5).eigenvalue, expected, rtol=1e-10)


def test_forcing_of_bare_beam_is_the_known_series():
    modes = beam_modes(0.0, 0.0, 3)
    root = modes.eigenvalue
    sigma = (np.sinh(root) - np.sin(root)) / (np.cosh(root) + np.cos(root))
    np.testing.assert_allclose(np.abs(modes.forcing), 2 * sigma / root, rtol=1e-10)


def test_heavy_tip_mass_makes_a_massless_spring():
    # a tip mass on a massless beam: w^2 = 3 YI/(M L^3); the beam adds 33/140 of its own mass
    ratio = 1e4
    first = beam_modes(ratio, 0.0, 1).eigenvalue[0]
    assert first**4 == pytest.approx(3 / (ratio + 33 / 140), rel=1e-8)


def test_heavy_tip_mass_pins_the_higher_modes():
    pinned = [3.92660231, 7.06858275]
    np.testing.assert_allclose(beam_modes(1e6, 0.0, 3).eigenvalue[1:], pinned, rtol=1e-6)


@given(ratio=st.floats(1e-3, 1e3), inertia=st.floats(0, 1.0))
def test_effective_masses_add_to_what_moves(ratio, inertia):
    # sum over all modes of F_r^2 is the mass of beam and tip; few modes hold most, never more
    modes = beam_modes(ratio, inertia, 5)
    held = float((modes.forcing**2).sum())
    assert 0.8 * (1 + ratio) < held <= (1 + ratio) * (1 + 1e-9)


@given(ratio=st.floats(0, 1e4))
def test_mass_for_a_root_undoes_the_root_for_a_mass(ratio):
    first = float(beam_modes(ratio, 0.0, 1).eigenvalue[0])
    assert mass_ratio_for(first) == pytest.approx(ratio, rel=1e-9, abs=1e-12)


@given(ratio=st.floats(1e-3, 1e4), gyration=st.floats(0, 1))
def test_mass_for_a_root_undoes_the_root_for_a_body(ratio, gyration):
    first = float(beam_modes(ratio, ratio * gyration**2, 1).eigenvalue[0])
    assert mass_ratio_for(first, lambda mass: (0.0, mass * gyration**2)) == pytest.approx(
        ratio, rel=1e-7
    )


def test_heavy_body_on_a_massless_beam():
    # K = [12, -6; -6, 4] EI/L^3 with M diag(1, g^2)
    ratio, gyration = 1e5, 0.4
    scale = np.outer([1, gyration], [1, gyration])
    stiffness = np.array([[12, -6], [-6, 4]]) / scale
    expected = np.linalg.eigvalsh(stiffness) / ratio
    found = beam_modes(ratio, ratio * gyration**2, 2).eigenvalue ** 4
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_little_inertia_changes_little():
    with_inertia = beam_modes(0.5, 1e-10, 3).eigenvalue
    np.testing.assert_allclose(with_inertia, beam_modes(0.5, 0.0, 3).eigenvalue, rtol=1e-7)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [((-1.0, 0.0, 1), "tip_mass_ratio"), ((0.0, -1.0, 1), "inertia"), ((0.0, 0.0, 13), "count")],
)
def test_impossible_beams_are_refused(arguments, words):
    with pytest.raises(ArgumentError, match=words):
        beam_modes(*arguments)


def test_root_above_the_bare_beam_has_no_mass():
    with pytest.raises(ArgumentError, match="bare beam"):
        mass_ratio_for(math.pi)
