"""Piecewise constant stiffness in 64-bit mantissas: power series of exponentials, plain sums."""

import numpy as np

LONG, CLONG = np.longdouble, np.clongdouble
PI = np.arccos(LONG(-1))


def exponential(matrix):
    """exp of a small matrix by squaring a power series."""
    squarings = max(0, int(np.ceil(np.log2(float(np.abs(matrix).sum(axis=1).max()) + 1e-300))) + 6)
    small = matrix / LONG(2) ** squarings
    # e^M - 1 is squared, so that small steps keep their digits
    term, total = np.eye(len(matrix), dtype=LONG), np.zeros_like(matrix)
    for n in range(1, 24):
        term = term @ small / n
        total = total + term
    for _ in range(squarings):
        total = 2 * total + total @ total
    return total


def step(h, s, tau, g):
    """exp less one of the augmented system (z, v/scale, 1); the scale balances the matrix."""
    h, s, tau, g = map(LONG, (h, s, tau, g))
    scale = 1 / tau
    matrix = np.array([[0, scale, 0], [-s / scale, -2 * h, g / scale], [0, 0, 0]], dtype=LONG)
    moved = exponential(matrix * tau)
    balance = np.array([1, scale, 1], dtype=LONG)
    return moved * balance[:, None] / balance


def periodic_states(h, s, tau, g):
    """Displacement and velocity at the start of each piece, shape (P, 2)."""
    steps = [step(h, *x) for x in zip(s, tau, g, strict=True)]
    whole = np.zeros((3, 3), dtype=LONG)
    for one in steps:
        whole = whole + one + one @ whole
    a, b, c, d = -whole[0, 0], -whole[0, 1], -whole[1, 0], -whole[1, 1]
    right, determinant = whole[:2, 2], a * d - b * c
    state = np.array([d * right[0] - b * right[1], a * right[1] - c * right[0]]) / determinant
    states = [state]
    for one in steps[:-1]:
        old = np.array([*states[-1], LONG(1)])
        states.append((old + one @ old)[:2])
    return np.array(states)


def acceleration_lines(h, s, tau, g, orders):
    """Harmonics of z'' [m/s2] by parts, one piece after the other."""
    states = periodic_states(h, s, tau, g)
    s, tau, g = (np.asarray(x, dtype=LONG) for x in (s, tau, g))
    h = LONG(h)
    nodes = np.concatenate([[LONG(0)], np.cumsum(tau)])
    period = nodes[-1]
    total = np.zeros(len(orders), dtype=CLONG)
    w = 2 * PI / period * np.asarray(orders, dtype=LONG)
    for i in range(len(s)):
        (z0, v0), (z1, v1) = states[i], states[(i + 1) % len(s)]
        a0, a1 = g[i] - 2 * h * v0 - s[i] * z0, g[i] - 2 * h * v1 - s[i] * z1
        e0, e1 = np.exp(-1j * w * nodes[i]), np.exp(-1j * w * nodes[i + 1])
        top = s[i] * (v1 * e1 - v0 * e0) - 1j * w * (a1 * e1 - a0 * e0)
        total += top / (s[i] - w**2 + 2j * h * w)
    return total / period
