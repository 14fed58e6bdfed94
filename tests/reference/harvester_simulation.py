"""Harvesters by direct integration of their equations: slow and obvious."""

from __future__ import annotations

import numpy as np
from reference.beam_elements import modal
from scipy.integrate import solve_ivp


def marched_power(beam, lines, base_hz, *, steps=8192, settled=1e-3):
    """Mean electrical power of a piezoelectric cantilever, marched period by period of `base_hz`.

    Every step is exact for an acceleration that is straight between two samples.
    """
    from scipy.linalg import expm

    natural, ratios, force, (chi, _, _), _ = modal(beam)
    capacitance = beam.capacitance_f
    count = len(natural)
    size = 2 * count + 1
    rates = np.zeros((size, size))
    rates[:count, count : 2 * count] = np.eye(count)
    rates[count : 2 * count, :count] = -np.diag(natural**2)
    rates[count : 2 * count, count : 2 * count] = -np.diag(2 * ratios * natural)
    rates[count : 2 * count, -1] = -chi
    rates[-1, count : 2 * count] = chi / capacitance
    rates[-1, -1] = -1 / (beam.load_ohm * capacitance)
    push = np.zeros(size)
    push[count : 2 * count] = -force
    step = 1 / base_hz / steps
    # state, acceleration and its slope in one
    whole = np.zeros((size + 2, size + 2))
    whole[:size, :size], whole[:size, size] = rates * step, push * step
    whole[size, size + 1] = step
    map_of = expm(whole)
    t = np.arange(steps) * step
    samples = sum(a * np.cos(2 * np.pi * f * t + 0.7 * f / base_hz) for f, a in lines)
    slopes = (np.roll(samples, -1) - samples) / step
    driven = np.outer(samples, map_of[:size, size]) + np.outer(slopes, map_of[:size, size + 1])
    state, power = np.zeros(size), 0.0
    for _ in range(400):
        volts = np.empty(steps)
        for k in range(steps):
            volts[k] = state[-1]
            state = map_of[:size, :size] @ state + driven[k]
        before, power = power, float(np.mean(volts**2) / beam.load_ohm)
        if abs(power - before) < settled * power:
            return power
    raise AssertionError("did not settle")


def integrated_inertial_power(harvester, lines, *, periods=140, kept=30):
    """Mean electrical power of a mass on a spring with a damper as load, under lines.

    All lines must be multiples of the lowest, so that the motion repeats.
    """
    natural = 2 * np.pi * harvester.natural_frequency_hz
    total = harvester.mechanical_damping_ratio + harvester.electrical_damping_ratio
    base = min(frequency for frequency, _ in lines)

    def rates(t, state):
        push = sum(a * np.cos(2 * np.pi * f * t + 0.3 * f / base) for f, a in lines)
        return [state[1], -push - 2 * total * natural * state[1] - natural**2 * state[0]]

    end, start = periods / base, (periods - kept) / base
    times = np.linspace(start, end, kept * 200, endpoint=False)
    found = solve_ivp(rates, (0, end), [0.0, 0.0], "DOP853", times, rtol=1e-9, atol=1e-14)
    damper = 2 * harvester.mass_kg * harvester.electrical_damping_ratio * natural
    return float(damper * np.mean(found.y[1] ** 2))
