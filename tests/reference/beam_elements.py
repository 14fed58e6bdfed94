"""A layered piezoelectric cantilever by finite elements: slow and obvious."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh


def layers(beam):
    """Bottom, top, modulus, density and field per volt over thickness of every layer."""
    hs, hp = beam.passive_thickness_m, beam.piezo_thickness_m
    ys, yp = beam.passive.youngs_modulus_pa, beam.piezo.youngs_modulus_pa
    rs, rp = beam.passive.density_kg_m3, beam.piezo.density_kg_m3
    found = [(0.0, hs, ys, rs, 0.0), (hs, hs + hp, yp, rp, 1.0)]
    if beam.wiring != "unimorph":
        # fields such that bending drives both layers the same way
        found.append((-hp, 0.0, yp, rp, -1.0))
        if beam.wiring == "series":
            found = [(*layer[:4], layer[4] / 2) for layer in found]
    return found


def tip_body(beam):
    """Offset and radius of gyration of the tip mass about the end of the beam."""
    height = beam.tip_block_height_m
    if height == 0:
        return 0.0, beam.tip_gyration_m
    long = beam.tip_mass_kg / (beam.tip_block_density_kg_m3 * height * beam.width_m)
    # a plane block from 0 to `long` along the beam
    return long / 2, np.sqrt(long**2 / 3 + height**2 / 12)


def assembled(beam, elements=40):
    """Stiffness, mass, electrical forces per volt and base forces of Hermite elements."""
    parts = layers(beam)
    axis = sum(y * (t**2 - b**2) / 2 for b, t, y, *_ in parts)
    axis /= sum(y * (t - b) for b, t, y, *_ in parts)
    width, size = beam.width_m, beam.length_m / elements
    bending = width * sum(y * ((t - axis) ** 3 - (b - axis) ** 3) / 3 for b, t, y, *_ in parts)
    per_length = width * sum(r * (t - b) for b, t, _, r, _ in parts)
    # stress e31 E, E = v/hp, times the lever arm over the section
    e31 = beam.piezo.d31_m_per_v * beam.piezo.youngs_modulus_pa
    moment = width * e31 / beam.piezo_thickness_m
    moment *= sum(f * ((t - axis) ** 2 - (b - axis) ** 2) / 2 for b, t, *_, f in parts)
    h = size
    k = np.array(
        [
            [12, 6 * h, -12, 6 * h],
            [6 * h, 4 * h**2, -6 * h, 2 * h**2],
            [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h**2, -6 * h, 4 * h**2],
        ]
    )
    m = np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h**2, 13 * h, -3 * h**2],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
        ]
    )
    count = 2 * (elements + 1)
    stiffness, mass = np.zeros((count, count)), np.zeros((count, count))
    for i in range(elements):
        own = slice(2 * i, 2 * i + 4)
        stiffness[own, own] += bending / h**3 * k
        mass[own, own] += per_length * h / 420 * m
    mass[-2, -2] += beam.tip_mass_kg
    offset, gyration = tip_body(beam)
    mass[-1, -1] += beam.tip_mass_kg * gyration**2
    mass[-2, -1] += beam.tip_mass_kg * offset
    mass[-1, -2] += beam.tip_mass_kg * offset
    base = mass[:, ::2].sum(axis=1)
    electric = np.zeros(count)
    electric[-1] = moment
    return stiffness[2:, 2:], mass[2:, 2:], electric[2:], base[2:]


def natural_hz(beam, count=3):
    """First natural frequencies, short-circuited and open [Hz]."""
    stiffness, mass, electric, _ = assembled(beam)
    stiff = stiffness + np.outer(electric, electric) / beam.capacitance_f
    return tuple(
        np.sqrt(eigh(k, mass, eigvals_only=True)[:count]) / (2 * np.pi) for k in (stiffness, stiff)
    )


def stress(beam, curvature, voltage):
    """Largest stress at the clamp over the outer fibres, the passive one's scaled to its limit."""
    parts = layers(beam)
    axis = sum(y * (t**2 - b**2) / 2 for b, t, y, *_ in parts)
    axis /= sum(y * (t - b) for b, t, y, *_ in parts)
    e31, hp = beam.piezo.d31_m_per_v * beam.piezo.youngs_modulus_pa, beam.piezo_thickness_m
    found = []
    for low, high, modulus, _, field in parts:
        for z in (low - axis, high - axis):
            # strain is -z w''; the stresses of the field make the moment that `assembled` has
            at = -modulus * z * curvature - field * e31 * voltage / hp
            scale = 1.0 if field else beam.piezo.safe_stress_pa / beam.passive.safe_stress_pa
            found.append(abs(at) * scale)
    return max(found)


def ratios(beam, natural):
    """Damping ratios of modes, without air."""
    rates = beam.mass_rate_per_s / natural + beam.stiffness_time_s * natural
    return beam.mechanical_damping_ratio + rates / 2


def modal(beam, kept=4):
    """First modes, and what all others answer at rest.

    Natural frequencies, damping ratios, forcing, and rows of charge per volt, tip travel and root
    curvature; then these rows for the rest, by an acceleration and by a volt.
    """
    stiffness, mass, electric, base = assembled(beam)
    squares, shapes = eigh(stiffness, mass)
    h = beam.length_m / (len(base) // 2)
    rows = np.array([electric @ shapes, shapes[-2], 6 / h**2 * shapes[0] - 2 / h * shapes[1]])
    inputs = np.array([base @ shapes, electric @ shapes])
    rest = (rows[:, kept:] / squares[kept:]) @ inputs[:, kept:].T
    natural = np.sqrt(squares[:kept])
    return natural, ratios(beam, natural), inputs[0, :kept], rows[:, :kept], rest


def answers(beam, frequency_hz):
    """Voltage, tip travel and largest stress per unit acceleration, damped as mode by mode."""
    stiffness, mass, electric, base = assembled(beam)
    squares, shapes = eigh(stiffness, mass)
    natural = np.sqrt(squares)
    damping = mass @ shapes @ np.diag(2 * ratios(beam, natural) * natural)
    damping = damping @ shapes.T @ mass
    found = []
    for frequency in frequency_hz:
        w = 2 * np.pi * frequency
        dynamic = stiffness - w**2 * mass + 1j * w * damping
        size = len(base)
        whole = np.zeros((size + 1, size + 1), dtype=complex)
        # bending drives charge; charge and load current close the circuit
        whole[:size, :size] = dynamic
        whole[:size, size] = electric
        whole[size, :size] = -1j * w * electric
        whole[size, size] = 1j * w * beam.capacitance_f + 1 / beam.load_ohm
        solved = np.linalg.solve(whole, np.concatenate([-base, [0.0]]))
        h = beam.length_m / (size // 2)
        curvature = 6 / h**2 * solved[0] - 2 / h * solved[1]
        found.append(
            [abs(solved[size]), abs(solved[size - 2]), stress(beam, curvature, solved[size])]
        )
    return np.array(found).T
