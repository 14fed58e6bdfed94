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
all of it (`over`): a chart of 40,000 points takes some 250 period maps.
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
BLOCK = 1 << 14
MOST_STEPS = 1 << 20
#: Chebyshev nodes along w0/w and along eps at first, for each digit of the tolerance, for each unit
#: of w0/w and for each of eps times the largest w0/w, and factor by which they grow.
NODES_A_DIGIT, NODES_A_UNIT, MORE_NODES = (1.3, 0.8), (5.5, 2.5), 1.3
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
    counts = _first_counts(systems, harmonics, tolerance)
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
        math.ceil(1 - least * math.log10(share) + each * span) if span else 1
        for least, each, span in zip(NODES_A_DIGIT, NODES_A_UNIT, spans, strict=True)
    ]
    while math.prod(counts) <= most:
        points = [chebyshev.chebpts1(n) for n in counts]
        x, y = (c + h * p for c, h, p in zip(centres, halves, points, strict=True))
        value, log = of_fourier(x, y[:, None], **known, tolerance=share)
        with np.errstate(over="ignore"):
            traces = value * np.exp(log)
        if not ROUNDING * np.abs(traces).max() < tolerance:
            break
        terms = _analysis(points[1]) @ traces @ _analysis(points[0]).T
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
    return np.asarray(made), np.zeros(1)


def _first_counts(systems: Real, harmonics: Complex, tolerance: float) -> Integers:
    """Powers of two: at 1e-7 a step a radian of the vibration or more, which the next doubles."""
    ratio, variation, zeta = systems
    size = 2 * float(np.abs(harmonics).sum())
    radians = 2 * math.pi * ratio * np.sqrt(np.abs(1 - zeta**2) + np.abs(variation) * size)
    each = (1e-7 / max(tolerance, 1e-12)) ** (1 / 6)
    least = np.maximum(each * radians, 2.5 * len(harmonics) + 3)
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
    """Half traces with `count` equal steps, a power of two."""
    ratio, variation, zeta = systems
    length = 2 * math.pi * ratio / count
    known = variation * length**2, (1 - zeta**2) * length**2
    values = [known[0] * f[:, None] + known[1] for f in _at_gauss(harmonics, count)]
    matrices, log = _steps(values, length)
    for left in range(count.bit_length() - 2, -1, -1):
        matrices = multiply(matrices[:, :, 1::2], matrices[:, :, ::2])
        if left % 4 == 0:
            size = np.abs(matrices).max(axis=(0, 1))
            matrices /= size
            log += np.log(size).sum(axis=0)
    return (matrices[0, 0, 0] + matrices[1, 1, 0]) / 2, log


def _at_gauss(harmonics: Complex, count: int) -> list[Real]:
    """Values of f at the three Gauss points of each of `count` equal steps of the period."""
    found = []
    orders = np.arange(1, len(harmonics) + 1)
    for offset in (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15)):
        half = np.zeros(count // 2 + 1, dtype=complex)
        half[1 : len(harmonics) + 1] = harmonics * np.exp(2j * math.pi * offset / count * orders)
        found.append(np.fft.irfft(half, count, norm="forward"))
    return found


def _steps(values: list[Real], length: Real) -> tuple[Real, Real]:
    """Step matrices of sixth order, less the growth of all steps, and its logarithm.

    Parameters
    ----------
    values : list of float ndarray, shape (n, ...)
        h^2 q at the three Gauss points of each step.
    length : float ndarray, shape (...)
        h.
    """
    left, middle, right = values
    first, second = math.sqrt(15) / 3 * (right - left), 10 / 3 * (right - 2 * middle + left)
    # Omega = [[d, h e], [f/h, -d]], its commutators written out
    d = first * (20 + 4 / 3 * middle + second / 30) / 240
    e = 1 + (first**2 + 20 * second) / 3600
    f = (20 * middle + second) * second / 3600 - first**2 * (1 / 120 + middle / 3600)
    f -= middle + second / 12
    square = d**2 + e * f
    root = np.sqrt(np.maximum(np.abs(square), 1e-300))
    even, odd = np.cos(root), np.sin(root) / root
    grows = square > 0
    if grows.any():
        own = root[grows]
        even[grows], odd[grows] = (1 + np.exp(-2 * own)) / 2, -np.expm1(-2 * own) / (2 * own)
    e, f = odd * e * length, odd * f / length
    matrices = np.array([[even + odd * d, e], [f, even - odd * d]])
    return matrices, np.where(grows, root, 0.0).sum(axis=0)


def growth(value: Real, log: Real) -> Real:
    """Logarithm >= 0 of the larger eigenvalue of the map whose half trace is value * e^log."""
    large = log > 30
    size = np.maximum(1.0, np.abs(value) * np.exp(np.minimum(log, 30.0)))
    small = np.log(size + np.sqrt((size - 1) * (size + 1)))
    if not large.any():
        return np.asarray(small)
    known = np.log(np.where(value == 0, 1.0, 2 * np.abs(value)))
    return np.asarray(np.where(large & (value != 0), known + log, small))


def multiply(left: Real, right: Real) -> Real:
    """Products of stacks of 2 x 2 matrices, shapes (2, 2, ...)."""
    (a, b), (c, d) = left
    (e, f), (g, h) = right
    return np.array([[a * e + b * g, a * f + b * h], [c * e + d * g, c * f + d * h]])
