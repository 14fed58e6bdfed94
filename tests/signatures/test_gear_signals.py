"""Signals of a gear: what is in each, from lines that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.signatures.measured.indicators import gear_signals
from gearmon.signatures.measured.line_plan import WheelLines

TEETH = 20
NUMBER = np.arange(1, 71)


def wheel(meshes=(20, 40, 60)):
    return WheelLines(
        stage=1,
        gear="pinion",
        teeth=TEETH,
        shaft=1,
        order=1.0,
        number=NUMBER,
        lines=np.arange(len(NUMBER)),
        mesh=np.isin(NUMBER, meshes),
        beside=np.zeros((0, len(NUMBER)), dtype=int),
    )


def lines(**amplitude):
    mean = np.zeros((1, len(NUMBER)), dtype=complex)
    for number, value in amplitude.items():
        mean[0, int(number[1:]) - 1] = value
    return mean


def test_every_line_is_in_the_average_and_in_regular_or_difference():
    rng = np.random.default_rng(0)
    mean = rng.normal(size=(2, len(NUMBER))) + 1j * rng.normal(size=(2, len(NUMBER)))
    own = gear_signals(mean, wheel())
    np.testing.assert_allclose(own.regular + own.difference, own.average, atol=1e-12)
    turn = np.arange(own.average.shape[-1]) / own.average.shape[-1]
    expected = (mean[:, :, None] * np.exp(2j * np.pi * NUMBER[:, None] * turn)).sum(axis=1).real
    np.testing.assert_allclose(own.average, expected, atol=1e-10)


def test_what_is_taken_out():
    own = gear_signals(lines(n20=1.0), wheel())
    assert own.multiples("shaft") == (1, 2)
    assert own.multiples("mesh") == (20, 40, 60)
    assert own.multiples("first sideband") == (19, 21, 39, 41, 59, 61)
    assert own.band == (10, 30)


def test_first_sidebands_of_another_mesh_on_the_same_shaft_go_too():
    own = gear_signals(lines(n20=1.0), wheel(meshes=(20, 33, 40, 60, 66)))
    assert {32, 34, 65, 67} <= set(own.multiples("first sideband"))
    assert not {32, 33, 34} - set(own.multiples("first sideband", "mesh"))
    # yet the gear's own mesh amplitudes are those of its own mesh
    assert own.mesh_amplitude.shape == (1, 3)


@pytest.mark.parametrize(
    ("number", "in_residual", "in_difference"),
    [("n1", 0, 0), ("n2", 0, 0), ("n3", 1, 1), ("n20", 0, 0), ("n21", 1, 0), ("n22", 1, 1)],
)
def test_where_a_line_goes(number, in_residual, in_difference):
    own = gear_signals(lines(**{number: 2.0}), wheel())
    size = np.sqrt(2.0)
    assert np.std(own.residual) == pytest.approx(in_residual * size, abs=1e-12)
    assert np.std(own.difference) == pytest.approx(in_difference * size, abs=1e-12)
    assert np.std(own.regular) == pytest.approx((1 - in_difference) * size, abs=1e-12)


@given(st.floats(0.0, 0.9), st.integers(1, 9))
def test_envelope_of_an_amplitude_modulation_is_that_modulation(depth, rate):
    turn = np.arange(4096) / 4096
    mean = lines(n20=1.0, **{f"n{20 - rate}": depth / 2, f"n{20 + rate}": depth / 2})
    own = gear_signals(mean, wheel())
    turn = np.arange(own.envelope.shape[-1]) / own.envelope.shape[-1]
    expected = 1 + depth * np.cos(2 * np.pi * rate * turn)
    np.testing.assert_allclose(own.envelope[0], expected, atol=1e-12)


def test_sums_of_eighth_powers_are_exact():
    # a single line at the top: mean of cos^8 is 35/128 whatever its phase
    own = gear_signals(lines(n70=np.exp(0.7j)), wheel())
    assert np.mean(own.average**8) == pytest.approx(35 / 128, rel=1e-12)
