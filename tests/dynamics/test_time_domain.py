"""Integration in time against certified answers and closed forms, with and without contact."""

import math

import numpy as np
import pytest
from reference.hill_cases import random_problem, scaled_problem
from reference.system_reference import random_system

from gearmon.dynamics import HillProblem, integrate, steady_state
from gearmon.errors import ArgumentError

MASS, STIFFNESS, FORCE = 0.28, 8e8, 4e3
FINE = 1e-12


def start_of(response):
    """State of a steady vibration at t = 0."""
    return np.concatenate(
        [np.atleast_1d(response.at(0.0, kind)) for kind in ("displacement", "velocity")]
    )


@pytest.mark.parametrize("seed", range(5))
def test_a_pair_stays_on_the_certified_vibration(seed):
    rng = np.random.default_rng(seed)
    p = random_problem(rng, 40, largest=0.5, ratios=(0.3, 8.0), zetas=(0.01, 2.0))
    p = scaled_problem(p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics, [300.0, 80j])
    exact = steady_state(p, 1e-11)
    time = np.linspace(0.0, p.period_s, 50)
    h = integrate(p, time, start_of(exact), relative_tolerance=FINE)
    for kind in ("displacement", "velocity", "acceleration"):
        right = exact.at(time, kind)
        np.testing.assert_allclose(getattr(h, kind)[:, 0], right, atol=1e-7 * np.abs(right).max())
    assert not h.apart.any()
    np.testing.assert_allclose(
        h.mesh_force[:, 0], exact.at(time, "mesh_force"), atol=1e-7 * np.abs(h.mesh_force).max()
    )


@pytest.mark.parametrize("seed", range(6))
def test_a_machine_stays_on_the_certified_vibration(seed):
    rng = np.random.default_rng(seed)
    while True:
        s = random_system(rng, most_coordinates=6)
        exact = steady_state(s, 1e-10)
        if exact.stable and not s.rigid.any():
            break
    time = np.linspace(0.0, s.period_s, 30)
    h = integrate(s, time, start_of(exact), relative_tolerance=FINE)
    for found, kind in ((h.displacement, "displacement"), (h.mesh_force, "mesh_force")):
        right = exact.at(time, kind)
        np.testing.assert_allclose(found, right, atol=1e-7 * np.abs(right).max())


def test_a_constant_spring_answers_a_step():
    p = HillProblem(MASS, 2e3, STIFFNESS, [], 2e-4, FORCE)
    h = integrate(p, np.linspace(0, 1e-3, 250), relative_tolerance=FINE)
    zeta, w0 = p.damping_ratio, 2 * math.pi * p.natural_frequency_hz
    wd = w0 * math.sqrt(1 - zeta**2)
    turned = np.cos(wd * h.time_s) + zeta * w0 / wd * np.sin(wd * h.time_s)
    exact = FORCE / STIFFNESS * (1 - np.exp(-zeta * w0 * h.time_s) * turned)
    np.testing.assert_allclose(h.displacement[:, 0], exact, atol=1e-11 * exact.max())
    np.testing.assert_allclose(MASS * h.acceleration + h.mesh_force, FORCE, rtol=1e-12)


@pytest.mark.parametrize("force", [5.0, -5.0])
def test_parted_teeth_fly_freely(force):
    # no damping: dropped on the spring from above, the mass bounces for ever
    p, sign = HillProblem(1.0, 0.0, 100.0, [], 1.0, force), math.copysign(1.0, force)
    h = integrate(p, np.linspace(0, 3, 1200), (-0.2 * sign, 0.0), math.inf, FINE)
    z = sign * h.displacement[:, 0]
    flying = z < -1e-9
    assert h.apart[flying].all()
    np.testing.assert_allclose(h.acceleration[flying], force)
    assert (sign * h.mesh_force >= -1e-9).all()
    energy = 0.5 * h.velocity[:, 0] ** 2 + 50 * np.maximum(z, 0) ** 2 - 5 * z
    np.testing.assert_allclose(energy, 1.0, rtol=1e-9)
    first = np.flatnonzero(~h.apart[:, 0])[0]
    assert h.time_s[first] == pytest.approx(math.sqrt(2 * 0.2 / 5), abs=1 / 400)


def test_the_back_flank_throws_the_mass_forward_again():
    p = HillProblem(1.0, 0.0, 100.0, [], 1.0, 5.0)
    h = integrate(p, np.linspace(0, 3, 1200), (-0.05, -3.0), 0.1, FINE)
    z = h.displacement[:, 0]
    assert h.mesh_force.min() < -10
    spring = 50 * np.maximum(z, 0) ** 2 + 50 * np.minimum(z + 0.1, 0) ** 2
    energy = 0.5 * h.velocity[:, 0] ** 2 + spring - 5 * z
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def test_contact_that_never_parts_is_the_linear_one():
    p = HillProblem(MASS, 9e3, STIFFNESS, [0.065], 1.6e-3, FORCE)
    exact = steady_state(p, 1e-11)
    time = np.linspace(0.0, 1.6e-3, 40)
    tied, free = (integrate(p, time, start_of(exact), b, FINE) for b in (None, 0.0))
    np.testing.assert_array_equal(free.acceleration, tied.acceleration)


def test_beyond_contact_loss_the_motion_stays_bounded_where_the_linear_one_grows():
    p = HillProblem(MASS, 500.0, STIFFNESS, [0.1], 1.6e-3 / 27.0, FORCE)
    assert steady_state(p).stable is False
    h = integrate(p, np.linspace(0, 60 * p.period_s, 1200), backlash_m=math.inf)
    assert h.apart.any()
    assert np.abs(h.displacement).max() < 100 * FORCE / STIFFNESS
    tied = integrate(p, [0.0, 60 * p.period_s])
    assert np.abs(tied.displacement[-1, 0]) > 50 * np.abs(h.displacement).max()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"relative_tolerance": 1e-16}, "relative_tolerance"),
        ({"backlash_m": -1.0}, "backlash_m=-1.0"),
        ({"state": (0.0, math.nan)}, "2 finite numbers"),
        ({"time_s": [1.0, 0.0]}, "ascending"),
    ],
)
def test_bad_arguments(given, message):
    p = HillProblem(MASS, 9e3, STIFFNESS, [0.065], 1.6e-3, FORCE)
    with pytest.raises(ArgumentError, match=message):
        integrate(p, **{"time_s": [0.0, 1.0], **given})
