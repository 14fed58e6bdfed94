"""Named and random cases of Hill's equation."""

import math

import numpy as np

from gearmon.dynamics import HillProblem
from gearmon.dynamics.compliance import solve_band


def published_pair(harmonics=41, damping=9e3, variation=0.13):
    """k = 8e8 N/m, m = 0.28 kg, T = 1.6 ms, F = 4 kN and a square wave of odd cosines."""
    j = np.arange(1, harmonics + 1)
    square = np.where(j % 2 == 1, 2 / (math.pi * j) * (-1.0) ** ((j - 1) // 2), 0.0)
    return HillProblem(0.28, damping, 8e8, variation * square, 1.6e-3, 4e3)


def scaled_problem(ratio, zeta, harmonics, force_harmonics=(), force=4e3):
    """The problem with w0/w = ratio and damping ratio zeta."""
    mass, stiffness = 0.28, 8e8
    w0 = math.sqrt(stiffness / mass)
    return HillProblem(
        mass,
        2 * zeta * math.sqrt(stiffness * mass),
        stiffness,
        np.asarray(harmonics, dtype=complex),
        2 * math.pi * ratio / w0,
        force,
        np.asarray(force_harmonics, dtype=complex),
    )


def random_problem(rng, most_harmonics=30, largest=0.95, ratios=(0.1, 20.0), zetas=(1e-3, 3.0)):
    """A random system whose stiffness stays positive."""
    ratio = math.exp(rng.uniform(*np.log(ratios)))
    zeta = math.exp(rng.uniform(*np.log(zetas)))
    count = int(rng.integers(1, most_harmonics + 1))
    c = rng.normal(size=count) + 1j * rng.normal(size=count)
    c /= np.arange(1, count + 1) ** rng.uniform(0, 2)
    c *= 10 ** rng.uniform(-2.5, math.log10(largest)) / (2 * np.abs(c).sum())
    return scaled_problem(ratio, zeta, c)


def balanced(problem, highest):
    """All harmonics of a problem by one band matrix [m]."""
    stiffness, right = problem.dynamic_stiffness(highest), problem.static_forcing(highest)
    return solve_band(stiffness, problem.stiffness_harmonics, right)
