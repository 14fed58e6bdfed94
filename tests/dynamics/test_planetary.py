import math

import numpy as np
import pytest
from reference.planetary_set import Body, PlanetarySet

from gearmon.dynamics import steady_state
from gearmon.dynamics.system import combination_tongues

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


def in_phase(eps, period=1.0, damping=0.0):
    """All sun meshes modulated in phase, eps cos(w t)."""
    gears = published(4)
    quiet = np.zeros(21)
    return gears.system([eps / 2], [0.0], np.zeros(8), period, quiet, damping * gears.mass)


def test_half_widths_as_printed():
    tongues = combination_tongues(in_phase(0.1))
    principal = {t.modes[0]: t.half_width_hz for t in tongues if t.modes[0] == t.modes[1]}
    natural = in_phase(0.1).natural_frequencies_hz
    for frequency, width in ((13071.1, 648.7), (10437.6, 491.4), (6981.7, 172.4)):
        mode = int(np.flatnonzero(np.abs(natural - frequency) < 1)[0])
        assert principal[mode] == pytest.approx(width, rel=1e-3)


@pytest.mark.parametrize("number", range(4))
def test_half_widths_against_the_multipliers(number):
    # 2 % modulation: first order is good to 1 % of the width, both edges taken together
    tongue = combination_tongues(in_phase(0.02))[number]

    def edge(side):
        inner, outer = 0.8, 1.2
        for _ in range(7):
            middle = (inner + outer) / 2
            frequency = tongue.frequency_hz + side * middle * tongue.half_width_hz
            grows = not steady_state(in_phase(0.02, 1 / frequency, 1e-3)).stable
            inner, outer = (middle, outer) if grows else (inner, middle)
        return inner

    assert (edge(1) + edge(-1)) / 2 == pytest.approx(1, rel=0.01)


def test_damping_closes_a_tongue():
    open_ = combination_tongues(in_phase(0.02))[0]
    limit = 2 * open_.coupling_per_s
    near, shut = (combination_tongues(in_phase(0.02, damping=d * limit)) for d in (0.99, 1.01))
    assert near[0].modes == open_.modes
    assert 0 < near[0].half_width_hz < 0.2 * open_.half_width_hz
    assert all(t.half_width_hz == 0 for t in shut if t.modes == open_.modes)


@pytest.mark.parametrize(("side", "stable"), [(600.0, False), (700.0, True), (-690.0, True)])
def test_instability_of_a_set(side, stable):
    assert steady_state(in_phase(0.1, 1 / (2 * 13071.1 + side), 1.0)).stable is stable
