"""Rivals of `steady_state`, as strong as they can be made.

The equation is dimensionless, z'' + 2 zeta z' + kappa(s) z = 1 in s = w0 t. SciPy's odeint (quicker
than its solve_ivp) and compiled Runge-Kutta of order four with fixed steps both march three motions
through one period and superpose them to the periodic one, so that nothing has to die out. The first
reads stiffness from a table of cubics made beforehand, its right side is of plain Python numbers.
The second, compiled by numba, is what a hand-written loop can reach: its stiffness is read from
tables at the begin, middle and end of every step, so a jump between two steps costs no accuracy.
Harmonic balance is solved by scipy.linalg.solve_banded.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.benchmark.equations import Case, Lines, Samples, folded

BYTES_ALLOWED = 1e9
#: Why nothing can be compiled; "" if it can.
NOT_COMPILED = "" if find_spec("numba") else "numba is not installed"
#: Without it loops stay as they are, and are not timed.
numba: Any = (
    SimpleNamespace(njit=lambda **_: lambda loop: loop, prange=range)
    if NOT_COMPILED
    else import_module("numba")
)
Read = Callable[[float], float]


def table_of(case: Case) -> CubicHermiteSpline:
    """Kappa of a smooth case as cubics on equal pieces of the period, counted in these."""
    half, count = case.half, len(case.half) - 1
    # relative error of a cubic below 1e-9 times the variation, or what memory allows
    pieces = min(512 * count, max(128 * count, 200_000))
    lines = np.stack([half, 2j * math.pi * np.arange(len(half)) / pieces * half])
    value, slope = np.pad(np.fft.irfft(lines, pieces, norm="forward"), ((0, 0), (0, 1)), "wrap")
    return CubicHermiteSpline(np.arange(pieces + 1), value, slope, extrapolate="periodic")


def reader(table: CubicHermiteSpline, period: float) -> Read:
    """Return what reads a table at one time, as quickly as Python can."""
    powers: list[array[float]] = [array("d", column) for column in table.c]
    d, c, b, a = powers
    pieces, per_time = len(a), len(a) / period

    def at(time: float) -> float:
        place = time * per_time % pieces
        i = int(place)
        x = place - i
        # rounding can give the end of the period for a time just below zero
        return a[i] + x * (b[i] + x * (c[i] + x * d[i])) if i < pieces else a[0]

    return at


def shooter(case: Case, digits: float) -> Callable[[], Samples]:
    """Return what finds the periodic motion of a smooth case, to so many digits a step.

    odeint marches two free motions and a driven one through the period and gives them at 24 times
    a period of w0.
    """
    from scipy.integrate import odeint

    damping, period = 2 * case.problem.damping_ratio, 2 * math.pi * case.problem.frequency_ratio
    table = table_of(case)
    at, start = reader(table, period), (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    time = np.linspace(0.0, period, max(2, math.ceil(12 * period / math.pi)) + 1)
    share, kappa = time[:-1] / period, table(time[:-1] * (table.x[-1] / period))
    known: dict[str, Any] = {"rtol": 10**-digits, "atol": 10 ** -(digits + 1), "tfirst": True}

    def slope(time: float, state: FloatArray) -> list[float]:
        """Two free motions and a driven one, in plain numbers."""
        a, u, b, w, z, v = state.tolist()
        k = at(time)
        free = u, -damping * u - k * a, w, -damping * w - k * b
        return [*free, v, 1.0 - damping * v - k * z]

    def shoot() -> Samples:
        *rows, end = odeint(slope, start, time, mxstep=10_000_000, **known)
        own = np.linalg.solve(np.eye(2) - end[:4].reshape(2, 2).T, end[4:])
        z, v = np.einsum("m,tmi->it", [*own, 1.0], np.reshape(rows, (-1, 3, 2)))
        return Samples(share, 1.0 - damping * v - kappa * z)

    return shoot


def banded_bytes(harmonics: int, highest: int) -> int:
    """Bytes of the band matrix with its fill for one solve."""
    return 16 * (2 * highest + 1) * (3 * min(harmonics, 2 * highest) + 1)


def band(harmonics: ComplexArray, highest: int) -> ComplexArray:
    """Band matrix of the stiffness alone, for harmonics -highest..highest."""
    kept = harmonics[: 2 * highest]
    width = len(kept)
    bands = np.zeros((2 * width + 1, 2 * highest + 1), dtype=np.complex128)
    bands[:width] = kept[::-1].conj()[:, None]
    bands[width + 1 :] = kept[:, None]
    return bands


def solve_band(bands: ComplexArray, ratio: float, zeta: float) -> Lines:
    """Harmonic balance by scipy.linalg.solve_banded; `bands` as `band` gives them.

    Parameters
    ----------
    bands : complex ndarray
        Left as it is.
    ratio, zeta : float
        w0/w and damping ratio.
    """
    from scipy.linalg import solve_banded

    width, size = len(bands) // 2, bands.shape[1]
    highest = size // 2
    matrix = bands.copy()
    x = np.arange(-highest, highest + 1) / ratio
    matrix[width] = (1 - x**2) + 2j * zeta * x
    right = np.zeros(size, dtype=np.complex128)
    right[highest] = 1.0
    solution = solve_banded(
        (width, width), matrix, right, overwrite_ab=True, overwrite_b=True, check_finite=False
    )
    return Lines(solution[highest:])


#: Begin and length of steps through a period, in shares of it, and the stiffness at the begin, in
#: the middle and at the end of each; what jumps between two steps has two values.
Steps = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]


def equal_steps(case: Case, count: int) -> Steps:
    """Return equal steps; of a rectangle their number is divisible by 4."""
    share, length = np.arange(count) / count, np.full(count, 1.0 / count)
    if case.rectangle is not None:
        level = case.level(share + 0.5 / count)
        return share, length, level, level, level
    both = folded(case.half, 2 * count)
    begin = both[::2].copy()
    return share, length, begin, both[1::2].copy(), np.roll(begin, -1)


def march_compiled(steps: Steps, ratio: float, zeta: float) -> Samples:
    """Return the periodic motion; `ratio` and `zeta` are w0/w and the damping ratio."""
    share, *tables = steps
    return Samples(share, shoot(*tables, 2 * math.pi * ratio, 2 * zeta, 1.0)[1])


@numba.njit(fastmath=True)
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


@numba.njit(fastmath=True)
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


@numba.njit(fastmath=True, parallel=True)
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
