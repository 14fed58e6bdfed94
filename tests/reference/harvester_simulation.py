"""Harvesters by direct integration of their equations: slow and obvious."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp


def integrated_power(harvester, lines, load, *, periods=140, kept=30):
    """Mean electrical power of a piezoelectric cantilever under lines (frequency, amplitude).

    All lines must be multiples of the lowest, so that the motion repeats.
    """
    natural = harvester.natural_rad_s
    damping = harvester.damping_ratios
    chi, force, capacitance = harvester.coupling, harvester.forcing, harvester.capacitance_f
    count = len(natural)
    base = min(frequency for frequency, _ in lines)

    def acceleration(t):
        return sum(a * np.cos(2 * np.pi * f * t + 0.3 * f / base) for f, a in lines)

    def rates(t, state):
        eta, speed, volt = state[:count], state[count : 2 * count], state[-1]
        second = -force * acceleration(t) - chi * volt
        second = second - 2 * damping * natural * speed - natural**2 * eta
        return np.concatenate([speed, second, [(chi @ speed - volt / load) / capacitance]])

    end, start = periods / base, (periods - kept) / base
    times = np.linspace(start, end, kept * 200, endpoint=False)
    found = solve_ivp(
        rates, (0, end), np.zeros(2 * count + 1), "DOP853", times, rtol=1e-8, atol=1e-12
    )
    return float(np.mean(found.y[-1] ** 2) / load)


def integrated_inertial_power(harvester, lines, *, periods=140, kept=30):
    """The same of a mass on a spring with a damper as load."""
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
