import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from reference.hill_cases import published_pair, random_problem, scaled_problem
from reference.hill_reference import periodic_solution, stiffness_at

from gearmon.dynamics import HillProblem, steady_state
from gearmon.errors import ArgumentError


def test_derived_numbers_of_the_published_pair():
    p = published_pair()
    assert 2 * math.pi * p.natural_frequency_hz == pytest.approx(53452.25, abs=0.01)
    assert p.natural_frequency_hz == pytest.approx(8507.19, abs=0.01)
    assert p.angular_frequency == pytest.approx(3926.99, abs=0.01)
    assert p.frequency_ratio == pytest.approx(13.6115, abs=1e-4)
    assert p.damping_ratio == pytest.approx(0.300669, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mass_kg": 0.0}, "mass_kg=0.0 kg must be > 0"),
        ({"damping_ns_per_m": -1.0}, "must be >= 0"),
        ({"stiffness_n_per_m": math.nan}, "must be a finite number"),
        ({"period_s": -1.0}, "period_s=-1.0 s must be > 0"),
        ({"force_n": math.inf}, "must be a finite number"),
        ({"mass_kg": 0.28 + 1j}, "mass_kg=.* must be a finite number"),
        ({"mass_kg": np.complex128(0.28 + 1j)}, "mass_kg=.* must be a finite number"),
        ({"damping_ns_per_m": "9e3"}, r"damping_ns_per_m='9e3' \(a text\)"),
        ({"force_n": None}, "force_n=None"),
        ({"force_n": 1e300}, "force over stiffness=.* must lie in"),
        ({"force_n": -1e300}, "force over stiffness=.* must lie in"),
        ({"stiffness_harmonics": [60.0, 60.0j]}, "would swing by 120 times its mean"),
        ({"stiffness_harmonics": [1e300]}, r"would swing by 1e\+300 times its mean"),
        ({"stiffness_harmonics": [[1.0]]}, "must be one row"),
        ({"stiffness_harmonics": [0.1, math.nan]}, r"harmonics\[1\]=\(nan\+0j\) must be a finite"),
    ],
)
def test_bad_values_are_refused(change, words):
    with pytest.raises(ArgumentError, match=words):
        replace(published_pair(), **change)


def test_values_cannot_be_changed():
    p = published_pair()
    with pytest.raises(FrozenInstanceError):
        p.mass_kg = 1.0
    with pytest.raises(ValueError, match="read-only"):
        p.stiffness_harmonics[0] = 1


def test_arguments_may_be_given_by_position():
    p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    assert p.stiffness_harmonics.dtype == complex
    assert len(p.force_harmonics_n) == 0


def test_time_histories_obey_the_equation():
    p = random_problem(np.random.default_rng(2), 6, ratios=(2, 5), zetas=(0.02, 0.1))
    r = steady_state(p, 1e-12)
    time = np.linspace(0, 2 * p.period_s, 37)
    z, v, a, force = (
        r.at(time, kind) for kind in ("displacement", "velocity", "acceleration", "mesh_force")
    )
    stiffness = np.array([stiffness_at(p, t) for t in time])
    np.testing.assert_allclose(force, stiffness * z + p.damping_ns_per_m * v, rtol=1e-9)
    np.testing.assert_allclose(p.mass_kg * a + force, p.force_n, rtol=1e-8)
    with pytest.raises(ArgumentError, match="kind='jerk' is not one of"):
        r.at(0.0, "jerk")


def test_energy_lines():
    r = steady_state(published_pair(), harmonics=15)
    amplitude = 2 * np.abs(r.displacement)
    expected = (2 * math.pi * r.frequency_hz * amplitude) ** 2 / 2
    np.testing.assert_allclose(r.energy_lines, expected)
    # published energies of 625, 1875, ... 9375 Hz, from the same data
    np.testing.assert_allclose(
        r.energy_lines[1:16:2] * 1e6, [5.5, 5.9, 6.9, 8.6, 11.3, 14.4, 14.6, 10.8], atol=0.06
    )


def test_contact_loss_is_found_at_its_first_angle():
    p = scaled_problem(3.0, 0.01, [0.12, 0.05j])
    r = steady_state(p)
    time = p.period_s * np.arange(100_000) / 100_000
    lost = np.flatnonzero(r.at(time, "mesh_force") <= 0)
    assert r.contact_lost
    assert r.contact_loss_angle_rad == pytest.approx(2 * math.pi * lost[0] / 100_000, abs=2e-4)
    gentle = steady_state(scaled_problem(3.0, 0.3, [0.02]))
    assert not gentle.contact_lost
    assert gentle.contact_loss_angle_rad is None


def test_mesh_force_margin_and_what_the_message_says_of_contact():
    lost = steady_state(scaled_problem(3.0, 0.01, [0.12, 0.05j]))
    time = lost.problem.period_s * np.arange(20_000) / 20_000
    least = lost.at(time, "mesh_force").min() / lost.mesh_force[0].real
    assert lost.mesh_force_margin == pytest.approx(least, abs=1e-4)
    assert f"w t = {lost.contact_loss_angle_rad:.4g} rad" in lost.message
    assert f"least mesh force {lost.mesh_force_margin:.3g} of its mean" in lost.message
    gentle = steady_state(scaled_problem(3.0, 0.3, [0.02]))
    assert 0.9 < gentle.mesh_force_margin < 1
    assert "contact" not in gentle.message
    still = steady_state(scaled_problem(3.0, 0.3, []))
    assert still.mesh_force_margin == pytest.approx(1.0)
    # a pull instead of a push: contact is the same, mirrored
    pulled = steady_state(scaled_problem(3.0, 0.01, [0.12, 0.05j], force=-4e3))
    assert pulled.mesh_force_margin == pytest.approx(lost.mesh_force_margin)


def test_margin_without_a_mean_force():
    unloaded = steady_state(scaled_problem(3.0, 0.1, [0.1], force=0.0))
    assert unloaded.mesh_force_margin == 0
    assert unloaded.contact_lost
    shaken = steady_state(scaled_problem(3.0, 0.1, [0.1], force_harmonics=[10.0], force=0.0))
    assert shaken.mesh_force_margin == -math.inf


def test_transmission_error_is_a_shift_of_the_coordinate():
    p = scaled_problem(2.3, 0.1, [0.1, 0.02j])
    e = np.array([2e-6, 1e-6j])
    forces = p.mass_kg * (np.arange(1, 3) * p.angular_frequency) ** 2 * e
    r = steady_state(replace(p, force_harmonics_n=forces), 1e-11)
    # the same by hand: m z'' + c (z - e)' + k(t) (z - e) = F with z = deflection + e
    time = p.period_s * np.arange(50) / 50
    deflection, velocity = r.at(time), r.at(time, "velocity")
    wave = 2 * (
        -((np.arange(1, 3) * p.angular_frequency) ** 2)
        * e
        * np.exp(1j * p.angular_frequency * time[:, None] * np.arange(1, 3))
    ).real.sum(axis=1)
    absolute = r.at(time, "acceleration") + wave
    stiffness = np.array([stiffness_at(p, t) for t in time])
    left = p.mass_kg * absolute + p.damping_ns_per_m * velocity + stiffness * deflection
    np.testing.assert_allclose(left, p.force_n, rtol=1e-7)


def test_against_time_integration_with_forces():
    p = scaled_problem(4.2, 0.05, [0.1, 0.03j, -0.02], force_harmonics=[300.0, 100j, 50.0, 20.0])
    z, v, a = periodic_solution(p, 64)
    r = steady_state(p, 1e-10)
    time = p.period_s * np.arange(64) / 64
    for exact, kind in ((z, "displacement"), (v, "velocity"), (a, "acceleration")):
        np.testing.assert_allclose(r.at(time, kind), exact, atol=1e-8 * np.abs(exact).max())
