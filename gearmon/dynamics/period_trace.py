"""Half the trace of the period map of Hill's equation, for many systems at once.

With the damping taken out, y = e^{zeta s} z, s = w0 t, the equation is

    y'' + q(s) y = 0,     q = 1 - zeta^2 + eps f(s/R),

and its period map has determinant one. Free vibrations change over a period by the factors
e^{-2 pi R zeta} times the eigenvalues of that map, which follow from half its trace, H: they lie on
the unit circle for |H| <= 1 and are +-e^{+-arcosh|H|} beyond. H is returned as value * e^log.

For a Fourier stiffness the period is cut into steps of a Magnus expansion of sixth order (Gauss
points; Blanes, Casas and Ros, BIT 40, 2000, 434), whose matrices are exponentials and so exact for
constant q however fast the vibration; halving the step removes the next term of the error.

H is an entire function of R and of eps, so that over a rectangle of both a few Chebyshev nodes tell
all of it (`over`): a chart of 40,000 points takes some 300 period maps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.polynomial import chebyshev

from gearmon.dynamics.fourier import Complex, Real

Integers = np.ndarray[tuple[int, ...], np.dtype[np.int_]]

#: Entries of one array of steps x systems.
BLOCK = 1 << 18
MOST_STEPS = 1 << 20
#: Chebyshev nodes along w0/w and along eps at first, so many more for each unit of w0/w and for
#: each of eps times the largest w0/w, and factor by which they grow.
NODES, NODES_A_UNIT, MORE_NODES = (12, 12), (7.0, 2.0), 1.3
#: Rounding of an interpolated half trace, relative to the largest on the rectangle.
ROUNDING = 1e-14

HalfTraces = Callable[[Real, Real], tuple[Real, Real]]


def of_fourier(
    ratio: Real, variation: Real, zeta: Real, harmonics: Complex, tolerance: float = 1e-12
) -> tuple[Real, Real]:
    """Half traces for k(t) = k0 [1 + eps f(t)] with f given by its Fourier coefficients.

    Parameters
    ----------
    ratio, variation, zeta : float ndarray, broadcasting to (...)
        R = w0/w > 0, eps, and damping ratio >= 0.
    harmonics : complex ndarray, shape (J,)
        f_1..f_J: f = sum (f_j e^{ijwt} + conjugate).
    tolerance : float
        Steps are halved until half the trace changes by less, relative to the larger of one and
        itself; rounding limits it to about 1e-15 times the number of steps.

    Returns
    -------
    value, log : float ndarray, shape (...)
    """
    ratio, variation, zeta = (
        np.asarray(x, dtype=np.float64) for x in np.broadcast_arrays(ratio, variation, zeta)
    )
    shape = ratio.shape
    systems = np.stack([ratio.ravel(), variation.ravel(), zeta.ravel()])
    value, log = np.empty(systems.shape[1]), np.empty(systems.shape[1])
    counts = _first_counts(systems, harmonics)
    for count in np.unique(counts):
        left = np.flatnonzero(counts == count)
        width = max(1, BLOCK // int(count))
        for first in range(0, len(left), width):
            part = left[first : first + width]
            value[part], log[part] = _refined(systems[:, part], harmonics, int(count), tolerance)
    return value.reshape(shape), log.reshape(shape)


def over(
    ratios: Real, variations: Real, zeta: float, harmonics: Complex, tolerance: float, most: int
) -> HalfTraces:
    """Half traces within a rectangle of w0/w and eps, as a function of both.

    Parameters
    ----------
    ratios, variations : float ndarray
        Their extremes span the rectangle.
    zeta, harmonics, tolerance
        As of `of_fourier`.
    most : int
        Period maps beyond which interpolation is not worth while.

    Returns
    -------
    callable
        Takes arrays (E or 1, X) of w0/w and (E, 1) of eps; returns what `of_fourier` does.
    """
    known, share = {"zeta": np.asarray(zeta), "harmonics": harmonics}, 0.1 * tolerance
    centres, halves = zip(*((_middle(v), np.ptp(v) / 2) for v in (ratios, variations)), strict=True)
    spans = 2 * halves[0], 2 * halves[1] * float(ratios.max())
    counts = [
        math.ceil(least + each * span) if span else 1
        for least, each, span in zip(NODES, NODES_A_UNIT, spans, strict=True)
    ]
    while math.prod(counts) <= most:
        points = [chebyshev.chebpts1(n) for n in counts]
        x, y = (c + h * p for c, h, p in zip(centres, halves, points, strict=True))
        value, log = of_fourier(x, y[:, None], **known, tolerance=share)
        if not log.max() + math.log(ROUNDING) < math.log(tolerance):
            break
        terms = _analysis(points[1]) @ (value * np.exp(log)) @ _analysis(points[0]).T
        open_ = [_tail(t) > share for t in (terms.T, terms)]
        if not any(open_):
            return partial(_interpolated, terms, centres, halves)
        counts = [math.ceil(MORE_NODES * n) if o else n for n, o in zip(counts, open_, strict=True)]
    return partial(of_fourier, **known, tolerance=tolerance)


def _middle(values: Real) -> float:
    return float(values.max() + values.min()) / 2


def _analysis(points: Real) -> Real:
    """Matrix that makes coefficients of values at Chebyshev nodes."""
    rows = chebyshev.chebvander(points, len(points) - 1).T * (2 / len(points))
    rows[0] /= 2
    return np.asarray(rows)


def _tail(terms: Real) -> float:
    """Size of the last coefficients: two, since every other one may vanish."""
    return float(np.abs(terms[-2:]).max()) if len(terms) > 1 else 0.0


def _interpolated(
    terms: Real,
    centres: tuple[float, float],
    halves: tuple[float, float],
    ratio: Real,
    variation: Real,
) -> tuple[Real, Real]:
    x, y = (
        chebyshev.chebvander((v - c) / (h or 1.0), n - 1)
        for v, c, h, n in zip((ratio, variation), centres, halves, terms.shape[::-1], strict=True)
    )
    rows = y @ terms
    # one product of matrices where all rows share their w0/w
    made = rows[:, 0] @ x[0].T if len(x) == 1 else (rows @ x.swapaxes(1, 2))[:, 0]
    return np.asarray(made), np.zeros(made.shape)


def _first_counts(systems: Real, harmonics: Complex) -> Integers:
    """Powers of two: about half a radian a step of the vibration and of the highest harmonic."""
    ratio, variation, zeta = systems
    size = 2 * float(np.abs(harmonics).sum())
    radians = 2 * math.pi * ratio * np.sqrt(np.abs(1 - zeta**2) + np.abs(variation) * size)
    least = np.maximum(np.maximum(8, 2 * radians), 2.5 * len(harmonics) + 3)
    return np.asarray(2 ** np.ceil(np.log2(np.minimum(least, MOST_STEPS / 4)))).astype(np.int_)


def _refined(systems: Real, harmonics: Complex, count: int, tolerance: float) -> tuple[Real, Real]:
    """Halve the steps until the extrapolated half traces agree."""
    old, log = _magnus(systems, harmonics, count)
    value, best_log = old.copy(), log.copy()
    open_ = np.arange(len(old))
    best = np.full(len(old), np.inf)
    while len(open_):
        count *= 2
        new, new_log = _magnus(systems[:, open_], harmonics, count)
        change = new - old * np.exp(log - new_log)
        better = new + change / 63
        value[open_], best_log[open_] = better, new_log
        allowed = tolerance * np.maximum(np.abs(new), np.exp(-new_log))
        # the next halving would divide the change by 64, and what extrapolation leaves by more
        error = np.abs(change) / 63
        going = (error > allowed) & (error < best[open_] / 4) & (count < MOST_STEPS)
        best[open_] = np.minimum(best[open_], error)
        old, log, open_ = new[going], new_log[going], open_[going]
    return value, best_log


def _magnus(systems: Real, harmonics: Complex, count: int) -> tuple[Real, Real]:
    """Half traces with `count` equal steps."""
    ratio, variation, zeta = systems
    length = 2 * math.pi * ratio / count
    values = [variation * f[:, None] + (1 - zeta**2) for f in gauss_values(harmonics, count)]
    matrices, logs = magnus_steps(values[0], values[1], values[2], length)
    product, log = scaled_product(matrices, logs)
    return (product[0, 0] + product[1, 1]) / 2, log


def gauss_values(harmonics: Complex, count: int) -> list[Real]:
    """Values of f at the three Gauss points of each of `count` equal steps of the period."""
    found = []
    orders = np.arange(1, len(harmonics) + 1)
    for offset in (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15)):
        half = np.zeros(count // 2 + 1, dtype=complex)
        half[1 : len(harmonics) + 1] = harmonics * np.exp(2j * math.pi * offset / count * orders)
        found.append(np.fft.irfft(half, count, norm="forward"))
    return found


def magnus_steps(left: Real, middle: Real, right: Real, length: Real) -> tuple[Real, Real]:
    """Step matrices of y'' + q y = 0 of sixth order, as e^log * matrix of determinant one.

    Parameters
    ----------
    left, middle, right : float ndarray, shape (n, ...)
        Values q at the Gauss points of each step.
    length : float ndarray, shape (...,)
        Step.
    """
    # elements of Omega = [[d, e], [f, -d]] from the commutators of a1, a2, a3 with
    # a1 = h A_middle, a2 = h sqrt(15)/3 (A_right - A_left),
    # a3 = h 10/3 (A_right - 2 A_middle + A_left)
    h = length
    a2 = -(math.sqrt(15) / 3) * h * (right - left)
    a3 = -(10 / 3) * h * (right - 2 * middle + left)
    f1 = -h * middle
    # C1 = [a1, a2] is diagonal, (h a2) on top
    c1 = h * a2
    # C2 = -[a1, 2 a3 + C1]/60 : diagonal, upper, lower
    c2d = -h * (2 * a3) / 60
    c2e = 2 * h * c1 / 60
    c2f = -2 * f1 * c1 / 60
    # [-20 a1 - a3 + C1, a2 + C2]/240
    xd, xe, xf = c1, -20 * h, -20 * f1 - a3
    yd, ye, yf = c2d, c2e, a2 + c2f
    d = (xe * yf - ye * xf) / 240
    e = h + (xd * ye - xe * yd) / 120
    f = f1 + a3 / 12 + (xf * yd - xd * yf) / 120
    square = -(d**2 + e * f)
    root = np.sqrt(np.abs(square))
    swings = square >= 0
    if root.all() and swings.all():
        even, odd, logs = np.cos(root), np.sin(root) / root, np.zeros(root.shape)
    else:
        grown = np.where(swings, 0.0, root)
        twice = np.where(grown > 0, -2 * grown, 1.0)
        even = np.where(swings, np.cos(root), (1 + np.exp(-2 * grown)) / 2)
        odd = np.where(swings, np.sinc(root / math.pi), np.expm1(twice) / twice)
        odd = np.where(~swings & (grown == 0), 1.0, odd)
        logs = grown
    return np.array([[even + odd * d, odd * e], [odd * f, even - odd * d]]), logs


def growth(value: Real, log: Real) -> Real:
    """Logarithm >= 0 of the larger eigenvalue of the map whose half trace is value * e^log."""
    size = np.abs(value)
    large = log > 30
    safe = np.where(size > 0, size, 1.0)
    with np.errstate(over="ignore"):
        small = np.arccosh(np.maximum(1.0, size * np.exp(np.minimum(log, 30.0))))
    return np.asarray(np.where(large & (size > 0), np.log(2 * safe) + log, small))


def scaled_product(matrices: Real, logs: Real) -> tuple[Real, Real]:
    """Product of e^log * matrix in order along the first axis behind the 2 x 2, by halving.

    Parameters
    ----------
    matrices : float ndarray, shape (2, 2, n, ...)
    logs : float ndarray, shape (n, ...)

    Returns
    -------
    matrix : float ndarray, shape (2, 2, ...)
        Of size about one.
    log : float ndarray, shape (...,)
    """
    while matrices.shape[2] > 1:
        even = matrices.shape[2] // 2 * 2
        a, b = matrices[:, :, 0:even:2], matrices[:, :, 1:even:2]
        pairs = multiply(b, a)
        size = np.abs(pairs).max(axis=(0, 1))
        matrices = np.concatenate([pairs / size, matrices[:, :, even:]], axis=2)
        logs = np.concatenate([logs[1:even:2] + logs[0:even:2] + np.log(size), logs[even:]])
    return matrices[:, :, 0], logs[0]


def multiply(left: Real, right: Real) -> Real:
    """Products of stacks of 2 x 2 matrices, shapes (2, 2, ...)."""
    (a, b), (c, d) = left
    (e, f), (g, h) = right
    return np.array([[a * e + b * g, a * f + b * h], [c * e + d * g, c * f + d * h]])
