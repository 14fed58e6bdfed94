"""The published data agree with each other, and the square wave with the rectangle it is of."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.study.pair import (
    REFERENCE,
    SIGNALS,
    decoded,
    square_wave_harmonics,
    varied,
)


def test_gear_data_under_their_true_labels():
    gears = decoded()
    assert (gears["pinion_mm"], gears["gear_mm"]) == pytest.approx((48.86402, 99.60742), abs=5e-6)
    assert gears["contact_ratio"] == pytest.approx(1.41220, abs=1e-5)
    assert gears["printed_hz"] == pytest.approx(632.667, abs=1e-3)
    assert gears["force_n"] == pytest.approx(4016, abs=0.5)


def test_consequences_of_the_model_parameters():
    problem = REFERENCE
    assert 2 * np.pi * problem.natural_frequency_hz == pytest.approx(53452.25, abs=0.01)
    assert problem.natural_frequency_hz == pytest.approx(8507.19, abs=0.01)
    assert problem.frequency_ratio == pytest.approx(13.6115, abs=1e-4)
    assert problem.damping_ratio == pytest.approx(0.300669, abs=1e-6)
    decay = problem.damping_ns_per_m / (2 * problem.mass_kg)
    assert decay == pytest.approx(16071.4, abs=0.1)
    assert problem.static_forcing(0)[0].real == pytest.approx(5e-6)


def test_square_wave_is_the_fourier_sum_at_half_duty():
    signal = SIGNALS["fourier-half"]
    np.testing.assert_allclose(square_wave_harmonics(41), signal.shape_harmonics(41), atol=1e-12)


@pytest.mark.parametrize("name", ["mass_kg", "stiffness_n_per_m", "period_s"])
def test_parameters_are_checked(name):
    with pytest.raises(ArgumentError, match=name):
        varied(REFERENCE, name, -1.0)
