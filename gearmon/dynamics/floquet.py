"""Floquet multipliers: factors by which free vibrations change over a period.

With the damping taken out, y = e^{zeta s} z, s = w0 t, the equation of a pair is

    y'' + q(s) y = 0,     q = 1 - zeta^2 + eps f(s/R),

and its period map has determinant one. Free vibrations change over a period by the factors
e^{-2 pi R zeta} times the eigenvalues of that map, which follow from half its trace, H: they lie on
the unit circle for |H| <= 1 and are +-e^{+-arcosh|H|} beyond. H is returned as value * e^log.

For a Fourier stiffness the period is cut into steps of a Magnus expansion of sixth order (Gauss
points; Blanes, Casas and Ros, BIT 40, 2000, 434), whose matrices are exponentials and so exact for
constant q however fast the vibration; halving the step removes the next term of the error.

H is an entire function of R and of eps, so that over a rectangle of both a few Chebyshev nodes tell
all of it (`half_traces_over`): a chart of 40,000 points takes some 250 period maps.

The period map of a machine of several meshes is made of its free vibrations between kicks
(`system_multipliers`).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.polynomial import chebyshev

from gearmon.dynamics.fourier import Complex, Real, samples, with_zero_mean
from gearmon.errors import ArgumentError

if TYPE_CHECKING:
    from gearmon.dynamics.compliance import SystemCompliance

#: Entries of one array of steps x systems.
BLOCK = 1 << 14
MOST_STEPS = 1 << 20
#: Chebyshev nodes along w0/w and along eps at first, for each digit of the tolerance, for each unit
#: of w0/w and for each of eps times the largest w0/w, and factor by which they grow.
NODES_A_DIGIT, NODES_A_UNIT, MORE_NODES = (1.3, 0.8), (5.5, 2.5), 1.3
#: Rounding of an interpolated half trace, relative to the largest on the rectangle.
ROUNDING = 1e-14
#: e to this is the largest number; beyond e to the other |H| + 1 is |H|.
LARGEST_EXPONENT, LARGE = 709.0, 30.0

Numbers = Real | float
HalfTraces = Callable[[Real, Real], tuple[Real, Real]]


def half_traces(
    ratio: Numbers, variation: Numbers, zeta: Numbers, harmonics: Complex, tolerance: float = 1e-12
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
    given = np.array(np.broadcast_arrays(ratio, variation, zeta), dtype=np.float64)
    systems = given.reshape(3, -1)
    found = np.empty((2, systems.shape[1]))
    # powers of two: at 1e-7 a step a radian of the vibration or more, which the next doubles
    stiffest = np.abs(1 - systems[2] ** 2) + np.abs(systems[1]) * 2 * np.abs(harmonics).sum()
    each = (1e-7 / max(tolerance, 1e-12)) ** (1 / 6)
    least = each * 2 * math.pi * systems[0] * np.sqrt(stiffest)
    least = np.clip(least, 2.5 * len(harmonics) + 3, MOST_STEPS / 4)
    counts = (2 ** np.ceil(np.log2(least))).astype(np.int_)
    for count in np.unique(counts):
        left = np.flatnonzero(counts == count)
        width = max(1, BLOCK // int(count))
        for first in range(0, len(left), width):
            part = left[first : first + width]
            found[:, part] = _refined(systems[:, part], harmonics, int(count), tolerance)
    value, log = found.reshape(2, *given.shape[1:])
    return value, log


def half_traces_over(
    ratios: Real, variations: Real, zeta: float, harmonics: Complex, tolerance: float, most: int
) -> HalfTraces:
    """Half traces within a rectangle of w0/w and eps, as a function of both.

    Parameters
    ----------
    ratios, variations : float ndarray
        Their extremes span the rectangle.
    zeta, harmonics, tolerance
        As of `half_traces`.
    most : int
        Period maps beyond which interpolation is not worth while.

    Returns
    -------
    callable
        Takes arrays (E or 1, X) of w0/w and (E, 1) of eps; returns what `half_traces` does.
    """
    known, share = {"zeta": np.asarray(zeta), "harmonics": harmonics}, 0.1 * tolerance
    # middle and half of the extent of both
    sides = [((v.max() + v.min()) / 2, (v.max() - v.min()) / 2) for v in (ratios, variations)]
    spans = 2 * sides[0][1], 2 * sides[1][1] * float(ratios.max())
    counts = [
        math.ceil(1 - least * math.log10(share) + each * span) if span else 1
        for least, each, span in zip(NODES_A_DIGIT, NODES_A_UNIT, spans, strict=True)
    ]
    while math.prod(counts) <= most:
        points = [chebyshev.chebpts1(n) for n in counts]
        x, y = (c + h * p for (c, h), p in zip(sides, points, strict=True))
        value, log = half_traces(x, y[:, None], **known, tolerance=share)
        with np.errstate(over="ignore"):
            traces = value * np.exp(log)
        if not ROUNDING * np.abs(traces).max() < tolerance:
            break
        along, across = (np.linalg.inv(chebyshev.chebvander(p, len(p) - 1)) for p in points)
        terms = across @ traces @ along.T
        # by the last coefficients: two, since every other one may vanish
        open_ = [len(t) > 1 and bool((np.abs(t[-2:]) > share).any()) for t in (terms.T, terms)]
        if not any(open_):
            return partial(_interpolated, terms, sides)
        counts = [math.ceil(MORE_NODES * n) if o else n for n, o in zip(counts, open_, strict=True)]
    return partial(half_traces, **known, tolerance=tolerance)


def _interpolated(
    terms: Real, sides: list[tuple[float, float]], ratio: Real, variation: Real
) -> tuple[Real, Real]:
    x, y = (
        chebyshev.chebvander((v - c) / (h or 1.0), n - 1)
        for v, (c, h), n in zip((ratio, variation), sides, terms.shape[::-1], strict=True)
    )
    rows = y @ terms
    # one product of matrices where all rows share their w0/w
    made = rows[:, 0] @ x[0].T if len(x) == 1 else (rows @ x.swapaxes(1, 2))[:, 0]
    return np.asarray(made), np.zeros(1)


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
    turns = 2j * math.pi / count * np.arange(1, len(harmonics) + 1)
    # f at the three Gauss points of every step
    offsets = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15))
    at = [samples(with_zero_mean(harmonics * np.exp(turns * x)), count) for x in offsets]
    values = [known[0] * f[:, None] + known[1] for f in at]
    matrices, log = _steps(values, length)
    for left in range(count.bit_length() - 2, -1, -1):
        matrices = multiply(matrices[:, :, 1::2], matrices[:, :, ::2])
        if left % 4 == 0:
            size = np.abs(matrices).max(axis=(0, 1))
            matrices /= size
            log += np.log(size).sum(axis=0)
    return (matrices[0, 0, 0] + matrices[1, 1, 0]) / 2, log


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
    matrices, log = exponentials(d, e * length, f / length, d**2 + e * f)
    return matrices, log.sum(axis=0)


def exponentials(d: Real, e: Real, f: Real, square: Real) -> tuple[Real, Real]:
    """exp([[d, e], [f, -d]]) less its growth, and the logarithm of that; `square` is d^2 + e f."""
    root = np.sqrt(np.maximum(np.abs(square), 1e-300))
    even, odd = np.cos(root), np.sin(root) / root
    grows = square > 0
    if grows.any():
        own = root[grows]
        even[grows], odd[grows] = (1 + np.exp(-2 * own)) / 2, -np.expm1(-2 * own) / (2 * own)
    d = odd * d
    return np.array([[even + d, odd * e], [odd * f, even - d]]), np.where(grows, root, 0.0)


def growth(value: Real, log: Real) -> Real:
    """Logarithm >= 0 of the larger eigenvalue of the map whose half trace is value * e^log."""
    size = np.abs(value)
    found = np.arccosh(np.maximum(1.0, size * np.exp(np.minimum(log, LARGE))))
    if not (log > LARGE).any():
        return np.asarray(found)
    with np.errstate(divide="ignore"):
        known = np.maximum(found, np.log(2 * size) + log)
    return np.asarray(np.where(log > LARGE, known, found))


def multiply(left: Real, right: Real) -> Real:
    """Products of stacks of 2 x 2 matrices, shapes (2, 2, ...)."""
    (a, b), (c, d) = left
    (e, f), (g, h) = right
    return np.array([[a * e + b * g, a * f + b * h], [c * e + d * g, c * f + d * h]])


def multipliers(
    ratio: float, zeta: float, harmonics: Complex, tolerance: float = 1e-9
) -> tuple[complex, complex]:
    """Floquet multipliers: factors by which a free vibration changes over one period.

    Parameters
    ----------
    ratio : float
        R = w0/w > 0.
    zeta : float
        Damping ratio >= 0.
    harmonics : complex ndarray, shape (J,)
        c_1..c_J of phi.
    tolerance : float
        Of e^{zeta T} times the multipliers, relative to the larger of one and their size.

    Returns
    -------
    (complex, complex)
        The larger modulus first, infinite if too large a number; their product is
        e^{-4 pi zeta R}. The equation is stable if the first is smaller than one in modulus.

    Examples
    --------
    >>> import numpy as np
    >>> first, second = multipliers(0.5, 0.0, np.array([0.1 + 0j]))  # w = 2 w0, eps = 0.2
    >>> abs(first) > 1, round(abs(first * second), 9)
    (True, 1.0)
    """
    value, log = half_traces(ratio, 1.0, zeta, harmonics, tolerance)
    decay = 2 * math.pi * ratio * zeta
    angle = math.acos(max(-1.0, min(1.0, float(value * np.exp(np.minimum(log, LARGE))))))
    exponent = complex(float(growth(value, log)), angle)
    return _exponential(exponent - decay), _exponential(-exponent - decay)


def _exponential(exponent: complex) -> complex:
    """e^exponent, infinite where that exceeds the largest number."""
    return cmath.exp(exponent) if exponent.real <= LARGEST_EXPONENT else complex(math.inf, 0.0)


def growth_of(
    ratio: Numbers, variation: Numbers, zeta: Numbers, harmonics: Complex, tolerance: float = 1e-12
) -> Real:
    """Logarithm of the largest multiplier's modulus per period, as `half_traces`."""
    traces = half_traces(ratio, variation, zeta, harmonics, tolerance)
    return np.asarray(growth(*traces) - 2 * math.pi * ratio * zeta)


#: Steps of the period map of a machine at most, and change of the multiplier that is small.
MOST_SYSTEM_STEPS, SETTLED = 1 << 15, 1e-9
#: Kicks followed together; the number of steps, a power of two, is a multiple of it.
KICKS_TOGETHER = 64


def system_multipliers(compliance: SystemCompliance, harmonics: Complex) -> Complex:
    """Floquet multipliers of a machine of several meshes, the largest modulus first.

    The map over a period is made of free vibrations of the mean machine in closed form between
    kicks by the meshes; steps are halved and extrapolated (errors of a symmetric step are even
    powers of it).

    Parameters
    ----------
    compliance : SystemCompliance
        Modes of the machine.
    harmonics : complex ndarray, shape (meshes, J)
        c_1..c_J of every mesh.
    """
    meshes, squares = compliance.meshes, compliance.squares
    felt = np.linalg.norm(meshes, axis=1) > 1e-6 * np.linalg.norm(meshes)
    fastest = math.sqrt(float(squares[felt].max(initial=0.0))) * compliance.system.period_s
    count = 1 << math.ceil(math.log2(max(32, 4 * harmonics.shape[1], 2 * fastest)))
    row, old = [_period_map(compliance, harmonics, count)], math.nan
    while True:
        count *= 2
        coarser, row = row, [_period_map(compliance, harmonics, count)]
        for k, before in enumerate(coarser[:3], start=1):
            row.append(row[-1] + (row[-1] - before) / (4**k - 1))
        values = np.linalg.eigvals(row[-1])
        radius = float(np.abs(values).max(initial=0.0))
        settled = abs(radius - old) <= max(SETTLED, 1e-3 * abs(1 - radius))
        if settled or count >= MOST_SYSTEM_STEPS:
            return np.asarray(values[np.argsort(-np.abs(values))], dtype=complex)
        old = radius


def _period_map(compliance: SystemCompliance, harmonics: Complex, count: int) -> Real:
    """Map of the modal state over a period in `count` steps, free rigid motions left out."""
    if count <= 2 * harmonics.shape[1]:
        raise ArgumentError(f"mesh_harmonics: more than {MOST_SYSTEM_STEPS // 2} of them")
    values, step = samples(with_zero_mean(harmonics), count), compliance.system.period_s / count
    # nothing depends on the place of a rigid-body motion, and on its speed only if it is damped
    sizes, held = np.abs(compliance.damping), ~compliance.system.rigid
    kept = held | (sizes.max(axis=1) > 1e-12 * sizes.max())
    squares, damping = compliance.squares[kept], compliance.damping[np.ix_(kept, kept)]
    meshes, n = compliance.meshes[kept], int(kept.sum())
    # velocities over w0, so that all entries are of one size
    scale = math.sqrt(float(squares.max(initial=1.0)))
    rate = np.block([[np.zeros((n, n)), scale * np.eye(n)], [-np.diag(squares) / scale, -damping]])
    # half a kick at both ends
    kicks = np.concatenate([values, values[:, :1]], axis=1).T * (step / scale)
    kicks[[0, -1]] /= 2
    seen = np.hstack([meshes.T, np.zeros_like(meshes.T)])
    pushed = np.vstack([np.zeros_like(meshes), meshes])
    begun = np.eye(2 * n) - pushed @ (kicks[0][:, None] * seen)
    state = _kicked(begun, scipy.linalg.expm(rate * step), seen, pushed, kicks[1:])
    matters = np.concatenate([held[kept], np.ones(n, dtype=bool)])
    return np.asarray(state[np.ix_(matters, matters)])


def _kicked(state: Real, drift: Real, seen: Real, pushed: Real, kicks: Real) -> Real:
    """Return the state after steps of free vibration, at the end of each a kick by every mesh.

    What the meshes see in a block of steps follows from the state before it by one triangular
    system, for a kick is felt by those after it only: far less work than step by step.
    """
    steps, meshes = min(KICKS_TOGETHER, len(kicks)), len(seen)
    freely, after = [seen @ drift], [pushed]
    for _ in range(steps - 1):
        freely.append(freely[-1] @ drift)
        after.append(drift @ after[-1])
    # how one kick is felt at the ends of later steps
    felt = np.stack([seen @ response for response in after])
    lag = np.subtract.outer(np.arange(steps), np.arange(steps))
    tensor = np.where((lag > 0)[..., None, None], felt[np.maximum(lag, 0)], 0.0)
    between = tensor.swapaxes(1, 2).reshape(steps * meshes, -1)
    unkicked, left = np.concatenate(freely), np.concatenate(after[::-1], axis=1)
    whole, kicked = np.linalg.matrix_power(drift, steps), np.empty_like(between)
    for strengths in kicks.reshape(-1, steps * meshes):
        places = scipy.linalg.solve_triangular(
            np.multiply(between, strengths, out=kicked),
            unkicked @ state,
            lower=True,
            unit_diagonal=True,
            check_finite=False,
        )
        state = whole @ state - left @ (strengths[:, None] * places)
    return state
