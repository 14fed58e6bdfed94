"""Fixed-step Runge-Kutta of order four, compiled by numba: what a hand-written loop can reach.

Stiffness is read from tables at the begin, middle and end of every step, made beforehand; so a jump
between two steps costs no accuracy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np

from gearmon.benchmark.collocation import Real, Samples, folded
from gearmon.benchmark.dynamics_cases import Case


def is_installed() -> bool:
    """Whether numba can be imported."""
    return find_spec("numba") is not None


@dataclass(frozen=True, eq=False)
class Tables:
    """Relative stiffness at begin, middle and end of `steps` equal steps of the period."""

    begin: Real
    middle: Real
    end: Real

    @property
    def steps(self) -> int:
        """Steps in the period."""
        return len(self.begin)


def tables(case: Case, steps: int) -> Tables:
    """Return the stiffness of a case at its steps; of a rectangle `steps` is divisible by 4."""
    if case.rectangle is not None:
        level = case.relative_stiffness((np.arange(steps) + 0.5) / steps)
        return Tables(level, level, level)
    half = np.concatenate([[1.0 + 0j], case.problem.stiffness_harmonics])
    both = folded(half, 2 * steps)
    begin = both[::2].copy()
    return Tables(begin, both[1::2].copy(), np.roll(begin, -1))


def march(
    table: Tables,
    ratio: float,
    zeta: float,
    settling: float = 0.0,
    state: tuple[float, float] = (1.0, 0.0),
) -> Samples:
    """Integrate from `state` at -settling to the end of the period, and keep the period.

    Parameters
    ----------
    table : Tables
    ratio, zeta : float
        w0/w and damping ratio.
    settling : float
        Time before the period begins [1/w0].
    state : tuple of two floats
        z and z' to begin with.
    """
    step = 2 * math.pi * ratio / table.steps
    before = math.ceil(settling / step)
    out = np.empty(table.steps)
    _kernels()[0](table.begin, table.middle, table.end, zeta, step, before, *state, out)
    return Samples(_shares(table.steps), out)


def shoot(table: Tables, ratio: float, zeta: float) -> Samples:
    """Find the periodic state from one period of three motions, then march once more."""
    step = 2 * math.pi * ratio / table.steps
    out = np.empty(table.steps)
    _kernels()[1](table.begin, table.middle, table.end, zeta, step, out)
    return Samples(_shares(table.steps), out)


@lru_cache(maxsize=64)
def _shares(steps: int) -> Real:
    return np.arange(steps) / steps


@lru_cache(maxsize=1)
def _kernels() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Compile both loops; the step is written out, so that nothing is called within."""
    from numba import njit  # type: ignore[import-not-found,import-untyped,unused-ignore]

    @njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def move(z, v, force, k1, k2, k3, damping, h):  # type: ignore[no-untyped-def]
        a1 = force - damping * v - k1 * z
        v2 = v + 0.5 * h * a1
        a2 = force - damping * v2 - k2 * (z + 0.5 * h * v)
        v3 = v + 0.5 * h * a2
        a3 = force - damping * v3 - k2 * (z + 0.5 * h * v2)
        v4 = v + h * a3
        a4 = force - damping * v4 - k3 * (z + h * v3)
        sixth = h / 6
        return z + sixth * (v + 2 * (v2 + v3) + v4), v + sixth * (a1 + 2 * (a2 + a3) + a4)

    @njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def from_rest(begin, middle, end, zeta, h, before, z, v, out):  # type: ignore[no-untyped-def]
        steps, damping = len(begin), 2 * zeta
        i = (-before) % steps
        for _ in range(before):
            z, v = move(z, v, 1.0, begin[i], middle[i], end[i], damping, h)
            i += 1
            if i == steps:
                i = 0
        for i in range(steps):
            out[i] = 1.0 - damping * v - begin[i] * z
            z, v = move(z, v, 1.0, begin[i], middle[i], end[i], damping, h)

    @njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def shooting(begin, middle, end, zeta, h, out):  # type: ignore[no-untyped-def]
        steps, damping = len(begin), 2 * zeta
        a, b, c, d, z, v = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
        for i in range(steps):
            a, b = move(a, b, 0.0, begin[i], middle[i], end[i], damping, h)
            c, d = move(c, d, 0.0, begin[i], middle[i], end[i], damping, h)
            z, v = move(z, v, 1.0, begin[i], middle[i], end[i], damping, h)
            if i % 256 == 255 and abs(a) + abs(b) + abs(c) + abs(d) < 1e-40:
                # numbers below the smallest normal one would slow every step down
                a = b = c = d = 0.0
        scale = (1 - a) * (1 - d) - b * c
        z, v = ((1 - d) * z + c * v) / scale, (b * z + (1 - a) * v) / scale
        for i in range(steps):
            out[i] = 1.0 - damping * v - begin[i] * z
            z, v = move(z, v, 1.0, begin[i], middle[i], end[i], damping, h)

    return from_rest, shooting
