"""Errors of manufacture against the tolerances of ISO 1328-1."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.simulation.contact import (
    ideal,
    random_errors,
    runout_tolerance_m,
    single_pitch_tolerance_m,
)


@pytest.mark.parametrize(
    ("diameter", "module", "grade", "pitch", "runout"),
    [
        # f_pT = 0.001 d + 0.4 m + 5 and F_rT = 0.9 (0.002 d + 0.55 sqrt d + 0.7 m + 12), by hand
        (100.0, 3.0, 5, 6.3, 17.82),
        (100.0, 3.0, 7, 12.6, 35.64),
        (400.0, 10.0, 5, 9.4, 27.72),
    ],
)
def test_tolerances(diameter, module, grade, pitch, runout):
    d, m = 1e-3 * diameter, 1e-3 * module
    assert 1e6 * single_pitch_tolerance_m(d, m, grade) == pytest.approx(pitch, abs=1e-9)
    assert 1e6 * runout_tolerance_m(d, m, grade) == pytest.approx(runout, abs=1e-9)


def test_a_grade_is_a_factor_of_root_two():
    ratio = single_pitch_tolerance_m(0.1, 0.002, 8) / single_pitch_tolerance_m(0.1, 0.002, 7)
    assert ratio == pytest.approx(2**0.5)


def test_gears_stay_mostly_within_their_tolerance():
    worst, runouts = [], []
    for seed in range(200):
        errors = random_errors(53, 0.106, 0.002, 6, np.random.default_rng(seed))
        single = np.diff(errors.pitch_m, append=errors.pitch_m[0])
        worst.append(np.abs(single).max())
        runouts.append(2 * errors.eccentricity_m)
        assert errors.pitch_m.mean() == pytest.approx(0, abs=1e-15)
    tolerance = single_pitch_tolerance_m(0.106, 0.002, 6)
    assert 0.5 * tolerance < np.median(worst) < 1.0 * tolerance
    assert max(runouts) < runout_tolerance_m(0.106, 0.002, 6)


def test_ideal_gear_has_none():
    errors = ideal(20)
    assert not errors.pitch_m.any()
    assert errors.eccentricity_m == 0


def test_deviations_cannot_be_changed():
    errors = ideal(20)
    with pytest.raises(ValueError, match="read-only"):
        errors.pitch_m[0] = 1.0


def test_grade_out_of_range():
    with pytest.raises(ArgumentError, match=r"accuracy_grade=12.*\[1, 11\]"):
        random_errors(20, 0.04, 0.002, 12, np.random.default_rng(0))
