"""A harvester marched through its coupled equations under a recording: slow and obvious.

The acceleration is set denser by its Fourier series first, then taken for straight between two
instants, and every step is an exact exponential of the whole state.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter


def denser(samples, times):
    """The same band-limited recording with more instants."""
    spectrum = np.fft.rfft(samples)
    return times * np.fft.irfft(spectrum, times * len(samples))


def matrices(harvester):
    """State rates, push and the rows of power root, travel, and both stresses."""
    if hasattr(harvester, "piezo"):
        return _beam(harvester)
    natural = 2 * np.pi * harvester.natural_frequency_hz
    heat = 2 * harvester.mechanical_damping_ratio * natural
    if hasattr(harvester, "turns"):
        theta = harvester.turns * harvester.field_length_tm
        around = harvester.coil_ohm + harvester.load_ohm
        if harvester.coil_henry == 0:
            damper = theta**2 / around / harvester.mass_kg
            root = np.sqrt(harvester.load_ohm) * theta / around
            rates = np.array([[0, 1], [-(natural**2), -heat - damper]])
            return rates, np.array([0.0, -1.0]), np.array([[0, root], [1, 0]])
        coil = harvester.coil_henry
        rates = np.array(
            [
                [0, 1, 0],
                [-(natural**2), -heat, -theta / harvester.mass_kg],
                [0, theta / coil, -around / coil],
            ]
        )
        rows = np.array([[0, 0, np.sqrt(harvester.load_ohm)], [1, 0, 0]])
        return rates, np.array([0.0, -1.0, 0.0]), rows
    damper = 2 * harvester.electrical_damping_ratio * natural
    rates = np.array([[0, 1], [-(natural**2), -heat - damper]])
    rows = np.array([[0, np.sqrt(harvester.mass_kg * damper)], [1, 0]])
    return rates, np.array([0.0, -1.0]), rows


def _beam(beam):
    natural, ratios, chi = beam.natural_rad_s, beam.damping_ratios, beam.coupling
    count = len(natural)
    size = 2 * count + 1
    rates, push = np.zeros((size, size)), np.zeros(size)
    rates[:count, count:-1] = np.eye(count)
    rates[count:-1, :count] = -np.diag(natural**2)
    rates[count:-1, count:-1] = -np.diag(2 * ratios * natural)
    rates[count:-1, -1] = -chi
    rates[-1, count:-1] = chi / beam.capacitance_f
    rates[-1, -1] = -1 / (beam.load_ohm * beam.capacitance_f)
    push[count:-1] = -beam.forcing
    shapes = beam._shapes
    tip = shapes.tip / np.sqrt(beam.beam_mass_kg)
    curved = shapes.root_curvature / np.sqrt(beam.beam_mass_kg) / beam.length_m**2
    hs, hp, axis = beam.passive_thickness_m, beam.piezo_thickness_m, beam.neutral_axis_m
    layer = beam.piezo.youngs_modulus_pa * (hs + hp - axis) * curved
    e31 = beam.piezo.d31_m_per_v * beam.piezo.youngs_modulus_pa
    field = -e31 / hp * (0.5 if beam.wiring == "series" else 1.0)
    plate = beam.passive.youngs_modulus_pa * max(axis, hs - axis) * curved
    plate = plate * beam.piezo.safe_stress_pa / beam.passive.safe_stress_pa
    nothing = np.zeros(count)
    rows = [
        np.concatenate([nothing, nothing, [1 / np.sqrt(beam.load_ohm)]]),
        np.concatenate([tip, nothing, [0.0]]),
        np.concatenate([layer, nothing, [field]]),
        np.concatenate([plate, nothing, [0.0]]),
    ]
    return rates, push, np.array(rows)


def marched(harvester, samples, rate, *, times=16):
    """Outputs (power root, travel, stresses) at dense instants, and their rate; from rest."""
    push = denser(samples, times)
    rates, force, rows = matrices(harvester)
    step, size = 1 / (rate * times), len(force)
    whole = np.zeros((size + 2, size + 2))
    whole[:size, :size], whole[:size, size] = rates * step, force * step
    whole[size, size + 1] = 1.0
    exact = expm(whole)
    driven = np.outer(exact[:size, size] - exact[:size, size + 1], push[:-1])
    driven += np.outer(exact[:size, size + 1], push[1:])
    # one recursion for every eigenvector of the exact step
    values, vectors = np.linalg.eig(exact[:size, :size])
    inputs = np.linalg.solve(vectors, driven.astype(complex))
    states = np.array(
        [lfilter([1.0], [1.0, -v], row) for v, row in zip(values, inputs, strict=True)]
    )
    return np.real((rows @ vectors) @ states), rate * times


def marched_answer(harvester, samples, rate, *, times=16, settled=5.0):
    """Mean power and peaks after the start has been forgotten."""
    outputs, dense = marched(harvester, samples, rate, times=times)
    fade = settled / (harvester.damping_ratio * 2 * np.pi * harvester.natural_frequency_hz)
    kept = outputs[:, min(int(fade * dense), outputs.shape[1] // 2) :]
    return float(np.mean(kept[0] ** 2)), np.abs(kept).max(axis=1)


def marched_with_stops(harvester, samples, rate, restitution, *, per_period=400):
    """Mean power of the first mode with stops, in small steps of classical Runge-Kutta."""
    natural = 2 * np.pi * harvester.natural_frequency_hz
    times = int(np.ceil(per_period * harvester.natural_frequency_hz / rate))
    push = denser(samples, 2 * times)
    step = 1 / (rate * times)
    heat = 2 * harvester.damping_ratio * natural
    if hasattr(harvester, "piezo"):
        tip = float(harvester._shapes.tip[0]) / np.sqrt(harvester.beam_mass_kg)
        force, chi = float(harvester.forcing[0]) * tip, float(harvester.coupling[0])
        back, drive, leak = chi * tip, chi / tip / harvester.capacitance_f, 0.0
        leak = 1 / (harvester.load_ohm * harvester.capacitance_f)
        worth = 1 / harvester.load_ohm
    else:
        force, back, drive, leak = 1.0, 0.0, 0.0, 0.0
        damper = 2 * harvester.electrical_damping_ratio * natural
        heat, worth = heat + damper, harvester.mass_kg * damper

    def slope(x, v, u, a):
        return v, -force * a - heat * v - natural**2 * x - back * u, drive * v - leak * u

    x = v = u = 0.0
    powers, limit = [], harvester.clearance_m
    weight = harvester.weight_ms2
    for k in range(0, len(push) - 2, 2):
        a0, a1, a2 = push[k] + weight, push[k + 1] + weight, push[k + 2] + weight
        k1 = slope(x, v, u, a0)
        k2 = slope(x + step / 2 * k1[0], v + step / 2 * k1[1], u + step / 2 * k1[2], a1)
        k3 = slope(x + step / 2 * k2[0], v + step / 2 * k2[1], u + step / 2 * k2[2], a1)
        k4 = slope(x + step * k3[0], v + step * k3[1], u + step * k3[2], a2)
        x += step / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        v += step / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        u += step / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
        if abs(x) > limit and x * v > 0:
            x, v = np.sign(x) * limit, -restitution * v
        powers.append(worth * (u if drive else v) ** 2)
    fade = int(5 / (harvester.damping_ratio * natural) / step)
    return float(np.mean(powers[min(fade, len(powers) // 2) :]))
