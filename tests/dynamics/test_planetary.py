import math

import numpy as np
import pytest

from gearmon.dynamics import steady_state
from gearmon.dynamics.planetary import Body, PlanetarySet
from gearmon.errors import ArgumentError

# Lin and Parker 1999, table 2: natural frequencies [Hz] by the number of planets
ROTATIONAL = {
    3: [0, 1475.7, 1930.3, 2658.3, 7462.8, 11775.3],
    4: [0, 1536.6, 1970.6, 2625.7, 7773.6, 13071.1],
}
TRANSLATIONAL = {
    3: [743.2, 1102.4, 1896.0, 2276.4, 6986.3, 9647.9],
    4: [727.0, 1091.0, 1892.8, 2342.5, 7189.9, 10437.6],
}
PLANET = {3: [], 4: [1808.2, 5963.8, 6981.7]}


def published(planets):
    return PlanetarySet(
        sun=Body(mass_kg=0.4, inertia_kg=0.39, bearing_n_per_m=1e8),
        ring=Body(mass_kg=2.35, inertia_kg=3.0, bearing_n_per_m=1e8, torsion_n_per_m=1e9),
        carrier=Body(mass_kg=5.43, inertia_kg=6.29, bearing_n_per_m=1e8),
        planet=Body(mass_kg=0.66, inertia_kg=0.61, bearing_n_per_m=1e8),
        planets=planets,
        sun_mesh_n_per_m=5e8,
        ring_mesh_n_per_m=5e8,
        sun_pressure_angle_rad=math.radians(24.6),
        ring_pressure_angle_rad=math.radians(24.6),
    )


def loaded(planets, sun_teeth=24, ring_teeth=72, variation=0.1, period_s=1 / 900):
    gears = published(planets)
    force = np.zeros(len(gears.mass))
    # the torque of the sun is taken by the carrier: u_s = 2 cos(a) u_c while the ring stands
    force[8], force[2] = 1000.0, -2000.0 * math.cos(math.radians(24.6))
    quiet = gears.system([0], [0], np.zeros(2 * planets), period_s, force, gears.mass)
    damping = 20.0 * gears.mass + 5e-7 * quiet.mean_stiffness
    phases = gears.mesh_phases(sun_teeth, ring_teeth)
    c = variation * np.array([0.5, 0.2j, -0.1])
    return gears.system(c, 0.8 * c, phases, period_s, force, damping)


@pytest.mark.parametrize("planets", [3, 4])
def test_published_natural_frequencies(planets):
    frequencies = loaded(planets).natural_frequencies_hz
    expected = sorted(ROTATIONAL[planets] + 2 * TRANSLATIONAL[planets] + PLANET[planets])
    np.testing.assert_allclose(frequencies, expected, rtol=5e-4, atol=0.3)


@pytest.mark.parametrize(("sun_teeth", "ring_teeth"), [(24, 72), (25, 71), (26, 70)])
def test_phases_choose_what_moves(sun_teeth, ring_teeth):
    # Parker and Lin: by mod(l z_s, N) harmonic l drives rotation, translation or planets alone
    found = steady_state(loaded(4, sun_teeth, ring_teeth), 1e-8)
    assert found.error_bound <= 1e-8
    central = np.abs(found.displacement[:, :9].reshape(-1, 3, 3))
    largest = np.abs(found.displacement[1:]).max()
    for line in range(1, 9):
        kind = line * sun_teeth % 4
        moves, turns = central[line, :, :2].max(), central[line, :, 2].max()
        assert (turns < 1e-9 * largest) == (kind != 0)
        assert (moves < 1e-9 * largest) == (kind not in (1, 3))


def test_half_widths_of_principal_instabilities():
    # all sun meshes 10 % in phase, undamped, first order of multiple scales:
    # l w = 2 w_p +- (eps/2) |D_pp|/w_p; half widths as printed
    gears = published(4)
    eps = 0.1
    quiet = gears.system([0], [0], np.zeros(8), 1.0, np.zeros(21), 0 * gears.mass)
    sun = gears.mesh_vectors[:4]
    depth = quiet.modes[1].T @ (5e8 * sun.T @ sun) @ quiet.modes[1]
    for mode, expected in ((-1, 648.7), (-2, 491.4)):
        natural = math.sqrt(quiet.modes[0][mode])
        width = eps / 2 * abs(depth[mode, mode]) / natural / (2 * math.pi)
        assert width == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("side", "stable"), [(600.0, False), (700.0, True), (-690.0, True)])
def test_instability_of_a_set(side, stable):
    gears = published(4)
    force = np.zeros(21)
    mesh_hz = 2 * 13071.1 + side
    # the sun meshes in phase with each other, the ring meshes constant
    system = gears.system([0.05], [0.0], np.zeros(8), 1 / mesh_hz, force, 1.0 * gears.mass)
    assert steady_state(system).stable is stable


def test_refusals():
    with pytest.raises(ArgumentError, match="planets=0"):
        published(0)
