"""Slow and obvious solutions of Hill's equation: shooting in time, a matrix by its elements."""

import math

import numpy as np
from scipy.integrate import solve_ivp


def stiffness_at(problem, time):
    """k(t), term by term."""
    value = 1.0
    for j, c in enumerate(problem.stiffness_harmonics, start=1):
        value += 2 * (c * np.exp(2j * math.pi * j * time / problem.period_s)).real
    return problem.stiffness_n_per_m * value


def force_at(problem, time):
    value = problem.force_n
    for n, f in enumerate(problem.force_harmonics_n, start=1):
        value += 2 * (f * np.exp(2j * math.pi * n * time / problem.period_s)).real
    return value


def _slope(problem, with_force):
    m, c = problem.mass_kg, problem.damping_ns_per_m

    def slope(time, state):
        force = force_at(problem, time) if with_force else 0.0
        z, v = state
        return [v, (force - c * v - stiffness_at(problem, time) * z) / m]

    return slope


def _integrate(problem, state, with_force, times=None):
    # velocities of about w0 z would spoil a common absolute tolerance
    scale = max(1e-30, abs(problem.force_n) / problem.stiffness_n_per_m)
    w0 = 2 * math.pi * problem.natural_frequency_hz
    absolute = 1e-13 * np.array([scale, scale * w0]) if with_force else 1e-13 * np.array([1, w0])
    return solve_ivp(
        _slope(problem, with_force),
        (0.0, problem.period_s),
        state,
        method="DOP853",
        rtol=3e-13,
        atol=absolute,
        t_eval=times,
    ).y


def period_map(problem):
    """Matrix that takes (z, v) of the free vibration over one period."""
    w0 = 2 * math.pi * problem.natural_frequency_hz
    first = _integrate(problem, [1.0, 0.0], with_force=False)[:, -1]
    second = _integrate(problem, [0.0, w0], with_force=False)[:, -1] / w0
    return np.array([first, second]).T


def periodic_solution(problem, count):
    """z, z' and z'' at `count` equal steps of the period, by shooting for the periodic state."""
    moved = _integrate(problem, [0.0, 0.0], with_force=True)[:, -1]
    start = np.linalg.solve(np.eye(2) - period_map(problem), moved)
    times = problem.period_s * np.arange(count) / count
    z, v = _integrate(problem, start, with_force=True, times=times)
    a = [_slope(problem, True)(t, (x, y))[1] for t, x, y in zip(times, z, v, strict=True)]
    return z, v, np.array(a)


def harmonic_balance(problem, highest):
    """z_0..z_highest from the full matrix, written element by element."""
    size = 2 * highest + 1
    w = 2 * math.pi / problem.period_s
    matrix = np.zeros((size, size), dtype=complex)
    right = np.zeros(size, dtype=complex)
    for row in range(size):
        n = row - highest
        matrix[row, row] = (
            problem.stiffness_n_per_m
            - problem.mass_kg * (n * w) ** 2
            + 1j * n * w * problem.damping_ns_per_m
        )
        for j, c in enumerate(problem.stiffness_harmonics, start=1):
            if row >= j:
                matrix[row, row - j] += problem.stiffness_n_per_m * c
            if row + j < size:
                matrix[row, row + j] += problem.stiffness_n_per_m * np.conj(c)
        if n == 0:
            right[row] = problem.force_n
        elif abs(n) <= len(problem.force_harmonics_n):
            f = problem.force_harmonics_n[abs(n) - 1]
            right[row] = f if n > 0 else np.conj(f)
    return np.linalg.solve(matrix, right)[highest:]


def acceleration_error(response, exact):
    """Relative L2 error of the acceleration of a response, against displacement coefficients."""
    size = max(len(exact), len(response.displacement))
    w = 2 * math.pi / response.problem.period_s
    difference = np.zeros(size, dtype=complex)
    difference[: len(exact)] = exact
    whole = np.linalg.norm(difference * (np.arange(size) * w) ** 2)
    difference[: len(response.displacement)] -= response.displacement
    return np.linalg.norm(difference * (np.arange(size) * w) ** 2) / whole
