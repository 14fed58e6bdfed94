"""The quantified facts of the study's pair, to the digits they are known to."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.study.experiments import HIGHEST_ORDER
from gearmon.study.pair import LAST_PERIOD, PHASE, waveform_error

# amplitudes 2|z_n| in m: exact, and first or (for even lines) second order
LINES = {
    1: (8.4559e-7, 8.3128e-7),
    2: (5.182e-9, 5.006e-9),
    3: (2.9217e-7, 2.8718e-7),
    5: (1.8862e-7, 1.8539e-7),
    7: (1.5056e-7, 1.4818e-7),
    12: (2.486e-8, 2.533e-8),
    13: (1.0597e-7, 1.0957e-7),
}


@pytest.mark.parametrize("line", LINES)
def test_lines_exact_and_by_second_order(results, line):
    exact, second = LINES[line]
    # half a unit of the last digit known
    digits = 5e-5 if line % 2 else 3e-4
    assert 2 * abs(results.reference.response.displacement[line]) == pytest.approx(
        exact, rel=digits
    )
    sums = results.orders.expansion.terms[:3].sum(axis=0)
    assert 2 * abs(sums[line]) == pytest.approx(second, rel=digits)


def test_waveform_of_the_reference(results):
    point = results.reference
    z = point.response.at(np.arange(8192) / 8192 * 1.6e-3)
    assert 1e6 * z.mean() == pytest.approx(5.083524, abs=1e-6)
    assert 1e6 * z.min() == pytest.approx(3.9045, abs=1e-4)
    assert 1e6 * z.max() == pytest.approx(6.2005, abs=1e-4)
    assert 1e6 * z.std() == pytest.approx(0.67721, abs=1e-5)
    assert point.figures["peak_harmonic"] == 13
    assert point.figures["peak_acceleration_ms2"] == pytest.approx(276.2, abs=0.05)


def test_errors_of_the_orders(results):
    errors = results.orders.displacement_errors
    assert 100 * errors[1] == pytest.approx(3.3, abs=0.05)
    assert 100 * errors[2] == pytest.approx(0.51, abs=0.005)
    np.testing.assert_allclose(results.orders.slopes, np.arange(1, HIGHEST_ORDER + 2), rtol=0.02)


def test_peak_acceleration_stays_over_stiffness(results):
    sweep = results.sweeps["stiffness_n_per_m"]
    peaks = sweep.take(lambda p: p.figures["peak_acceleration_ms2"])
    assert (round(peaks.min()), round(peaks.max())) == (276, 291)
    harmonics = sweep.take(lambda p: p.figures["peak_harmonic"])
    assert (harmonics[0], harmonics[-1]) == (7, 17)


def test_peak_acceleration_over_damping(results):
    sweep = results.sweeps["damping_ns_per_m"]
    found = [round(p.figures["peak_acceleration_ms2"]) for p in sweep.points]
    expected = [646, 388, 276, 213, 172, 145, 88, 44, 29]
    # 144.55 is printed as 145
    assert np.abs(np.subtract(found, expected)).max() <= 1
    assert sum(a == b for a, b in zip(found, expected, strict=True)) >= 8


def test_energy_lines_of_the_reference(results):
    found = 1e6 * results.reference.response.energy_lines[1:16:2]
    expected = [5.5, 5.9, 6.9, 8.6, 11.3, 14.4, 14.6, 10.8]
    np.testing.assert_allclose(found, expected, atol=0.05)


def test_total_energy_over_mass(results):
    sweep = results.sweeps["mass_kg"]
    at = {
        float(m): p.figures["total_energy_j_per_kg"]
        for m, p in zip(sweep.values, sweep.points, strict=True)
    }
    assert 0.2 * at[0.2] == pytest.approx(1.9e-5, abs=0.05e-5)
    assert 1.0 * at[1.0] == pytest.approx(9.8e-5, abs=0.05e-5)
    for mass in (0.2, 0.28, 0.4, 0.6, 1.0):
        assert at[mass] == pytest.approx(9.7e-5, rel=0.015)


def test_total_energy_is_what_the_damping_spends(results):
    """Mean power balance: the work of the varying spring is what c z'^2 takes away."""
    for sweep in results.sweeps.values():
        for point in sweep.points:
            p, motion = point.response.problem, point.waveform
            velocity, force = motion.velocity_ms, motion.mesh_force_n
            spring = force - p.damping_ns_per_m * velocity
            supplied = -(spring * velocity).mean()
            spent = p.damping_ns_per_m * point.figures["total_energy_j_per_kg"]
            assert supplied == pytest.approx(spent, rel=1e-6)


def test_no_contact_loss_at_3_kg(results):
    heavy = results.sweeps["mass_kg"].points[-1]
    assert 1e6 * heavy.waveform.displacement_m.min() == pytest.approx(3.61, abs=0.01)
    assert not heavy.response.contact_lost


def test_every_steady_state_meets_its_tolerance(results):
    for sweep in results.sweeps.values():
        for point in sweep.points:
            assert point.response.error_bound <= 1e-9
            assert point.start_error < 0.01


def test_waveform_error_of_the_exact_solution_is_none(results):
    exact = results.reference.response
    assert waveform_error(exact.displacement, exact) < 1e-14


def test_settling_ends_where_the_motion_stays_near_the_quasi_static_one(results):
    """Sample by sample from the end of each zone of one settled period."""
    for key in ("wave", "rectangular", "fourier"):
        form, step = results.forms[key], 2 * 0.13 * 5e-6
        settled = 5e-6 / (1 + 0.13 * form.signal.shape(PHASE, smooth=True))
        off = np.abs(form.simulated.displacement_m[LAST_PERIOD] - settled) > 0.05 * step
        lags, phase = [], PHASE
        for start, end in ((0.0, 0.412), (0.412, 1.0)):
            zone = np.flatnonzero((phase >= start) & (phase < end) & off)
            lags.append(PHASE[zone[-1]] - start if len(zone) else 0.0)
        assert form.longest_settling_s == pytest.approx(1.6e-3 * max(lags), abs=1e-9)
