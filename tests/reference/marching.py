"""A harvester marched through its coupled equations under a recording: slow and obvious.

The acceleration is set denser by its Fourier series first, then taken for straight between two
instants, and every step is an exact exponential of the whole state.
"""

from __future__ import annotations

import numpy as np
from reference.beam_elements import modal
from scipy.linalg import expm
from scipy.signal import lfilter

#: Instants that are marched at once.
STRETCH = 200_000


def denser(samples, times):
    """The same band-limited recording with more instants."""
    spectrum = np.fft.rfft(samples)
    return times * np.fft.irfft(spectrum, times * len(samples))


def matrices(harvester):
    """State rates, push, rows of power root, travel, and both stresses, and what the push adds."""
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
            return rates, np.array([0.0, -1.0]), np.array([[0, root], [1, 0]]), np.zeros(2)
        coil = harvester.coil_henry
        rates = np.array(
            [
                [0, 1, 0],
                [-(natural**2), -heat, -theta / harvester.mass_kg],
                [0, theta / coil, -around / coil],
            ]
        )
        rows = np.array([[0, 0, np.sqrt(harvester.load_ohm)], [1, 0, 0]])
        return rates, np.array([0.0, -1.0, 0.0]), rows, np.zeros(2)
    damper = 2 * harvester.electrical_damping_ratio * natural
    rates = np.array([[0, 1], [-(natural**2), -heat - damper]])
    rows = np.array([[0, np.sqrt(harvester.mass_kg * damper)], [1, 0]])
    return rates, np.array([0.0, -1.0]), rows, np.zeros(2)


def _beam(beam):
    """Modes of finite elements, which owe nothing to the package but dimensions.

    The last state is the charge s = C v + q a, with C the capacitance and q the charge per
    acceleration of the modes left out: s' = sum chi eta' - v/R.
    """
    natural, ratios, forcing, shapes, rest = modal(beam)
    chi, tip, bent = shapes
    capacitance, charge = beam.capacitance_f + rest[0, 1], rest[0, 0]
    count = len(natural)
    size = 2 * count + 1
    rates, push = np.zeros((size, size)), np.zeros(size)
    rates[:count, count:-1] = np.eye(count)
    rates[count:-1, :count] = -np.diag(natural**2)
    rates[count:-1, count:-1] = -np.diag(2 * ratios * natural)
    rates[count:-1, -1] = -chi / capacitance
    push[count:-1] = -forcing + chi * charge / capacitance
    rates[-1, count:-1] = chi
    rates[-1, -1] = -1 / (beam.load_ohm * capacitance)
    push[-1] = charge / (beam.load_ohm * capacitance)
    nothing = np.zeros(count)
    volts, by_push = np.append(np.zeros(2 * count), 1 / capacitance), -charge / capacitance
    travel, curvature = (
        (np.concatenate([row, nothing, [0]]) - more[1] * volts, -more[0] - more[1] * by_push)
        for row, more in ((tip, rest[1]), (bent, rest[2]))
    )
    hs, hp, axis = beam.passive_thickness_m, beam.piezo_thickness_m, beam.neutral_axis_m
    e31 = beam.piezo.d31_m_per_v * beam.piezo.youngs_modulus_pa
    # the elements count the voltage the other way round, see `beam_elements.stress`
    field = e31 / hp * (0.5 if beam.wiring == "series" else 1.0)
    layer = beam.piezo.youngs_modulus_pa * (hs + hp - axis)
    plate = beam.passive.youngs_modulus_pa * max(axis, hs - axis)
    plate = plate * beam.piezo.safe_stress_pa / beam.passive.safe_stress_pa
    root = 1 / np.sqrt(beam.load_ohm)
    rows = [root * volts, travel[0], layer * curvature[0] + field * volts, plate * curvature[0]]
    direct = [root * by_push, travel[1], layer * curvature[1] + field * by_push]
    return rates, push, np.array(rows), np.array([*direct, plate * curvature[1]])


def marched(harvester, samples, rate, *, times=16):
    """Yield outputs (power root, travel, stresses) at dense instants, stretch by stretch."""
    push = denser(samples, times)
    rates, force, rows, direct = matrices(harvester)
    step, size = 1 / (rate * times), len(force)
    whole = np.zeros((size + 2, size + 2))
    whole[:size, :size], whole[:size, size] = rates * step, force * step
    whole[size, size + 1] = 1.0
    exact = expm(whole)
    # one recursion for every eigenvector of the exact step
    values, vectors = np.linalg.eig(exact[:size, :size])
    now, then = np.linalg.solve(
        vectors,
        np.column_stack([exact[:size, size] - exact[:size, size + 1], exact[:size, size + 1]]),
    ).T
    seen, kept = rows @ vectors, np.zeros((size, 1), dtype=complex)
    for start in range(0, len(push) - 1, STRETCH):
        own = push[start : start + STRETCH + 1]
        states = np.empty((size, len(own) - 1), dtype=complex)
        for i, value in enumerate(values):
            driven = now[i] * own[:-1] + then[i] * own[1:]
            states[i], kept[i] = lfilter([1.0], [1.0, -value], driven, zi=kept[i])
        yield np.real(seen @ states) + direct[:, None] * own[1:]


def marched_answer(harvester, samples, rate, *, times=16, settled=5.0):
    """Mean power and peaks after the start, from rest, has been forgotten."""
    fade = settled / (harvester.damping_ratio * 2 * np.pi * harvester.natural_frequency_hz)
    skipped = min(int(fade * rate * times), len(samples) * times // 2)
    total, count, peaks = 0.0, 0, 0.0
    for outputs in marched(harvester, samples, rate, times=times):
        own, skipped = outputs[:, skipped:], max(0, skipped - outputs.shape[1])
        if own.size:
            total, count = total + float(np.sum(own[0] ** 2)), count + own.shape[1]
            peaks = np.maximum(peaks, np.abs(own).max(axis=1))
    return total / count, peaks


def marched_with_stops(harvester, samples, rate, restitution, *, per_period=120, finer=64):
    """Mean power of the first mode with stops, in small steps of classical Runge-Kutta.

    A step with a blow is gone through again in steps that are so many times finer.
    """
    natural = 2 * np.pi * harvester.natural_frequency_hz
    times = int(np.ceil(per_period * harvester.natural_frequency_hz / rate))
    push = denser(samples, 2 * times) + harvester.weight_ms2
    step, limit = 1 / (rate * times), harvester.clearance_m
    heat = 2 * harvester.damping_ratio * natural
    if hasattr(harvester, "piezo"):
        _, _, forcing, (chi, tip, _), rest = modal(harvester, 1)
        capacitance = harvester.capacitance_f + rest[0, 1]
        force, back, drive = forcing[0] * tip[0], chi[0] * tip[0], chi[0] / tip[0] / capacitance
        leak = 1 / (harvester.load_ohm * capacitance)
        worth = 1 / harvester.load_ohm
    elif hasattr(harvester, "turns"):
        theta, worth = harvester.turns * harvester.field_length_tm, harvester.load_ohm
        force, back, drive = 1.0, theta / harvester.mass_kg, theta / harvester.coil_henry
        leak = (harvester.coil_ohm + harvester.load_ohm) / harvester.coil_henry
    else:
        force, back, drive, leak = 1.0, 0.0, 0.0, 0.0
        damper = 2 * harvester.electrical_damping_ratio * natural
        heat, worth = heat + damper, harvester.mass_kg * damper

    def slope(state, a):
        x, v, u = state
        return np.array(
            [v, -force * a - heat * v - natural**2 * x - back * u, drive * v - leak * u]
        )

    def stepped(state, a0, a1, a2, h):
        k1 = slope(state, a0)
        k2 = slope(state + h / 2 * k1, a1)
        k3 = slope(state + h / 2 * k2, a1)
        k4 = slope(state + h * k3, a2)
        return state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def beyond(state):
        return abs(state[0]) > limit and state[0] * state[1] > 0

    state, powers = np.zeros(3), []
    for k in range(0, len(push) - 2, 2):
        after = stepped(state, *push[k : k + 3], step)
        if beyond(after):
            after, at = (
                state,
                np.interp(np.arange(2 * finer + 1) / finer, range(3), push[k : k + 3]),
            )
            for j in range(0, 2 * finer, 2):
                after = stepped(after, *at[j : j + 3], step / finer)
                if beyond(after):
                    turned = [np.sign(after[0]) * limit, -restitution * after[1], after[2]]
                    after = np.array(turned)
        state = after
        powers.append(worth * (state[2] if drive else state[1]) ** 2)
    fade = int(5 / (harvester.damping_ratio * natural) / step)
    return float(np.mean(powers[min(fade, len(powers) // 2) :]))
