"""Errors of manufacture against the tolerances of ISO 1328-1."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference.simulated_machines import one_pair

from gearmon.errors import ArgumentError
from gearmon.gears.faults import GearError
from gearmon.simulation.contact import (
    TOLERANCE_USED,
    ideal,
    random_errors,
    runout_tolerance_m,
    single_pitch_tolerance_m,
)
from gearmon.simulation.train import build_train


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


@pytest.mark.parametrize("seed", range(6))
def test_errors_that_are_added_are_largest_where_their_phase_says(seed):
    """At the negated angle from the entry of tooth 1; two eccentricities add as arrows do."""
    rng = np.random.default_rng(seed)
    teeth, phase = int(rng.integers(15, 60)), rng.uniform(-np.pi, np.pi)
    error = GearError(kind="cumulative", stage=1, gear="gear", size_m=1e-5, phase_rad=phase)
    angle = 2 * np.pi * np.arange(teeth) / teeth
    arrow = (ideal(teeth).with_error(error).pitch_m * np.exp(1j * angle)).mean() * 2
    assert arrow == pytest.approx(1e-5 * np.exp(-1j * phase))
    sizes, phases = rng.uniform(1e-6, 1e-5, 2), rng.uniform(-np.pi, np.pi, 2)
    own = ideal(teeth)
    for size, turned in zip(sizes, phases, strict=True):
        error = replace(error, kind="eccentricity", size_m=size, phase_rad=turned)
        own = own.with_error(error)
    added = own.eccentricity_m * np.exp(1j * own.eccentricity_phase_rad)
    assert added == pytest.approx((sizes * np.exp(1j * phases)).sum())


def test_gears_of_a_train_have_the_tolerance_of_their_own_diameter():
    """Runout between 0.4 and 1 of the share used, of module times teeth over the cosine."""
    machine = one_pair(13, 97, helix_angle_deg=20.0, face_width_mm=20.0)
    diameters = 0.002 * np.array([13, 97]) / np.cos(np.radians(20.0))
    most = [
        0.5 * TOLERANCE_USED * runout_tolerance_m(diameter, 0.002, 6.0) for diameter in diameters
    ]
    drawn = np.array(
        [
            [own.eccentricity_m for own in build_train(machine, seed=seed).meshes[0].errors]
            for seed in range(80)
        ]
    )
    shares = drawn / most
    assert shares.max() <= 1.0
    assert shares.min() >= 0.4
    np.testing.assert_allclose(shares.max(axis=0), 1.0, atol=0.03)
    np.testing.assert_allclose(shares.min(axis=0), 0.4, atol=0.03)
