"""What a hand-written loop can reach: Runge-Kutta of order four, compiled by numba where it is.

The equation is dimensionless, z'' + 2 zeta z' + kappa(s) z = force.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np

#: Without it loops stay as they are; `rivals.numba_is_missing` keeps them from being timed.
numba: Any = (
    import_module("numba")
    if find_spec("numba")
    else SimpleNamespace(njit=lambda **_: lambda loop: loop, prange=range)
)


def _compiled(**options: Any) -> Callable[[Any], Any]:
    made: Callable[[Any], Any] = numba.njit(fastmath=True, **options)
    return made


@_compiled()
def move(z, v, force, k1, k2, k3, damping, h):  # type: ignore[no-untyped-def]
    """Take one step; it is written out, so that nothing is called within."""
    a1 = force - damping * v - k1 * z
    v2 = v + 0.5 * h * a1
    a2 = force - damping * v2 - k2 * (z + 0.5 * h * v)
    v3 = v + 0.5 * h * a2
    a3 = force - damping * v3 - k2 * (z + 0.5 * h * v2)
    v4 = v + h * a3
    a4 = force - damping * v4 - k3 * (z + h * v3)
    sixth = h / 6
    return z + sixth * (v + 2 * (v2 + v3) + v4), v + sixth * (a1 + 2 * (a2 + a3) + a4)


@_compiled()
def shoot(length, begin, middle, end, unit, damping, force):  # type: ignore[no-untyped-def]
    """Return velocity and acceleration of the periodic motion at the begin of every step."""
    count = len(begin)
    kept, velocity, acceleration = np.empty((count, 6)), np.empty(count), np.empty(count)
    a, b, c, d, z, v = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
    for i in range(count):
        h, k1, k2, k3 = unit * length[i], begin[i], middle[i], end[i]
        row = kept[i]
        row[0], row[1], row[2], row[3], row[4], row[5] = a, b, c, d, z, v
        a, b = move(a, b, 0.0, k1, k2, k3, damping, h)
        c, d = move(c, d, 0.0, k1, k2, k3, damping, h)
        z, v = move(z, v, force, k1, k2, k3, damping, h)
        if i % 256 == 255 and abs(a) + abs(b) + abs(c) + abs(d) < 1e-40:
            # numbers below the smallest normal one would slow every step down
            a = b = c = d = 0.0
    scale = (1 - a) * (1 - d) - b * c
    one, two = ((1 - d) * z + c * v) / scale, (b * z + (1 - a) * v) / scale
    for i in range(count):
        row = kept[i]
        velocity[i] = one * row[1] + two * row[3] + row[5]
        deflection = one * row[0] + two * row[2] + row[4]
        acceleration[i] = force - damping * velocity[i] - begin[i] * deflection
    return velocity, acceleration


@_compiled(parallel=True)
def growth(ratios, variations, zeta, values):  # type: ignore[no-untyped-def]
    """Return the growth a period, ln of the larger multiplier, at every point of a chart."""
    steps, found = (len(values) - 1) // 2, np.empty(ratios.shape)
    for i in numba.prange(ratios.shape[0]):
        for j in range(ratios.shape[1]):
            eps, h = variations[i, j], 2 * math.pi * ratios[i, j] / steps
            a, b, c, d = 1.0, 0.0, 0.0, 1.0
            for n in range(steps):
                k1, k2 = 1 + eps * values[2 * n], 1 + eps * values[2 * n + 1]
                k3 = 1 + eps * values[2 * n + 2]
                a, b = move(a, b, 0.0, k1, k2, k3, 2 * zeta, h)
                c, d = move(c, d, 0.0, k1, k2, k3, 2 * zeta, h)
            half, product = abs(a + d) / 2, a * d - b * c
            root = half * half - product
            if root > 0:
                found[i, j] = math.log(half + math.sqrt(root))
            else:
                found[i, j] = math.log(product) / 2
    return found
