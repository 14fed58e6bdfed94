"""Floquet theory of the homogeneous equation: multipliers, and how strongly it can amplify.

In the dimensionless time s = w0 t the equation is z'' + 2 zeta z' + (1 + phi(s)) z = r with
phi(s) = sum_j (c_j e^{ijs/R} + conjugate) and R = w0/w. The multipliers follow from the trace of
the period map (`period_trace`).

For the gain of the inverse operator the period is cut into steps, at the same angles for all sets
that share phi. Within a step phi is split into its mean and a rest kappa = q' whose integral q
vanishes at both ends. With v = z' + q z the state x = (z, v) obeys

    x' = [ -q             1        ] x + [0, r]
         [ -(1 + mean) + 2 zeta q - q^2,  -2 zeta + q ]

so that the rest enters through q = O(step^2) only. Keeping the mean of q in the constant part
makes the step matrix accurate to the fourth order; what is left is bounded by
A = step^2 max|phi'|/8 and added by a Neumann argument. Step matrices are closed form, with
e^{-zeta s} split off so that their determinant is one.

With the periodic change of variables x = P(s) y that makes the matrix constant, each component of y
is a scalar equation whose gain is 1/|in/R - exponent| exactly, and the gain of the inverse is at
most cond(P) times the larger of the two. The columns of P are the real and imaginary part of one
free vibration where the two multipliers have equal moduli, and else both free vibrations, each with
its mean growth taken out.

Arrays have the steps on axis 2 behind the 2 x 2 matrices, and the sets behind them.
"""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING

import numpy as np

from gearmon.dynamics import period_trace
from gearmon.dynamics.fourier import Complex, Real, samples, with_zero_mean
from gearmon.errors import ArgumentError

if TYPE_CHECKING:
    from gearmon.dynamics.compliance import SystemCompliance
    from gearmon.dynamics.error_bound import Pattern

MOST_STEPS = 1 << 21
#: Steps times sets that are followed together.
BLOCK = 1 << 16
#: Sets from which on their common cost counts more than the sharpness of each bound.
FEWEST_TOGETHER = 16
#: Steps multiplied one after another before their products are, pair by pair.
IN_A_ROW = 16
#: e to this is the largest number.
LARGEST_EXPONENT = 709.0


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
    one = np.ones(())
    value, log = period_trace.of_fourier(ratio * one, one, zeta * one, harmonics, tolerance)
    decay = 2 * math.pi * ratio * zeta
    growth = float(period_trace.growth(value, log))
    angle = math.pi if value < 0 else 0.0
    if growth == 0:
        angle = math.acos(min(1.0, max(-1.0, float(value) * math.exp(min(float(log), 30.0)))))
    exponent = complex(growth, angle)
    return _exponential(exponent - decay), _exponential(-exponent - decay)


def _exponential(exponent: complex) -> complex:
    """e^exponent, infinite where that exceeds the largest number."""
    if exponent.real > LARGEST_EXPONENT:
        return complex(math.inf, 0.0)
    return cmath.exp(exponent)


def gain(ratio: Real, zeta: Real, scale: Real, shape: Pattern) -> tuple[Real, Real]:
    """Gains of many sets that share phi; all arrays have the shape (B,).

    Parameters
    ----------
    ratio, zeta, scale : float ndarray
        R, damping ratio > 0, and the factor of phi.
    shape : Pattern
        Of phi.

    Returns
    -------
    gain : float ndarray
        ||(L^-1 r)''|| <= gain ||r||; infinite where nothing is proven or free vibrations grow.
    growth : float ndarray
        ln of the larger multiplier's modulus if it is above one for certain, else nan.
    """
    found, growth = np.full(len(ratio), np.inf), np.full(len(ratio), np.nan)
    counts = _step_counts(ratio, zeta, scale, shape)
    most = np.minimum(MOST_STEPS, 30 * counts)
    waiting = np.arange(len(ratio))
    for _ in range(4):
        waiting = waiting[counts[waiting] <= most[waiting]]
        waiting = waiting[np.argsort(counts[waiting])]
        planned, start = counts[waiting], 0
        while start < len(waiting):
            alike = int(np.searchsorted(planned, 1.5 * planned[start], side="right"))
            end = min(start + max(1, BLOCK // int(planned[start])), alike)
            part, count = waiting[start:end], int(planned[end - 1])
            start = end
            found[part], growth[part], loop = _gain_of_steps(
                ratio[part], zeta[part], scale[part], shape, count
            )
            # the loop falls with the square of the step
            factor = np.where(np.isfinite(loop), 1.2 * np.sqrt(np.clip(loop, 1.0, 64.0)), 9.0)
            counts[part] = _in_rows(count * np.maximum(1.5, factor))
        waiting = waiting[np.isinf(found[waiting]) & np.isnan(growth[waiting])]
    return found, growth


def _step_counts(ratio: Real, zeta: Real, scale: Real, shape: Pattern) -> Real:
    """Count steps short enough for the rest to be small beside a resonance at this damping."""
    for_rest = np.sqrt(scale * shape.slope / ratio * (1 + zeta) / np.maximum(zeta, 1e-6))
    # most of many sets need no more; for a few, a sharp bound spares harmonics
    fewer = 0.6 if len(ratio) >= FEWEST_TOGETHER else 1.0
    steps = fewer * 2 * math.pi * ratio * np.maximum(3 * (1 + zeta), for_rest)
    return _in_rows(np.maximum(max(16, 2 * len(shape.harmonics) + 2), steps))


def _in_rows(counts: Real) -> Real:
    return np.asarray(IN_A_ROW * np.ceil(counts / IN_A_ROW))


def _gain_of_steps(
    ratio: Real, zeta: Real, scale: Real, shape: Pattern, count: int
) -> tuple[Real, Real, Real]:
    """Gains, certain growths, and twice the Neumann loop of sets cut into `count` steps."""
    period = 2 * math.pi * ratio
    length = period / count
    # sets that grow too fast give nonsense here, and are left unsettled
    with np.errstate(all="ignore"):
        products, logs, matrices = _steps(ratio, zeta, scale, shape, count)
        half_trace = (products[0, 0, -1] + products[1, 1, -1]) / 2
        growth = period_trace.growth(half_trace, logs[-1])
        turned = np.arccos(np.clip(half_trace * np.exp(np.minimum(logs[-1], 30.0)), -1, 1))
        margin = zeta - growth / period
        rest = scale * shape.slope / ratio * length**2 / 8
        within = zeta + np.hypot(zeta + rest, scale * shape.highest / 2 + zeta * rest)
        columns = _swinging_columns(products, logs)
        if growth.any():
            grown = _growing_columns(matrices, products, logs, growth)
            columns = np.where(growth > 0, grown, columns)
        state = _condition(columns) * np.exp(2 * length * within)
        state /= np.hypot(margin, np.where(growth > 0, 0.0, turned) / period)
        loop = state * (2 * rest * (1 + 2 * zeta) + rest**2)
        force = np.hypot(1 + scale * shape.highest + 2 * zeta * rest, 2 * zeta)
        found = 1 + force * state / (1 - loop)
        proven = (margin > 0) & (loop < 0.5) & np.isfinite(found)
        # close to the boundary the steps are not exact enough to tell
        excess = growth - zeta * period
        growing = excess > 1e-2 * (1 + zeta * period)
    return np.where(proven, found, np.inf), np.where(growing, excess, np.nan), 2 * loop


def _steps(
    ratio: Real, zeta: Real, scale: Real, shape: Pattern, count: int
) -> tuple[Real, Real, Real]:
    """Products up to each step and ln of their scale, and the step matrices themselves."""
    mean, offset = _step_averages(shape.harmonics, count)
    mean, offset = scale * mean[:, None], scale * ratio * offset[:, None]
    matrices = _exponentials(
        zeta - offset, -(1 + mean) + 2 * zeta * offset, 2 * math.pi * ratio / count
    )
    return *running_products(matrices), matrices


def _step_averages(harmonics: Complex, count: int) -> tuple[Real, Real]:
    """Means over each of `count` steps of phi, and of q over R; needs count > 2 J."""
    orders = np.arange(1, len(harmonics) + 1)
    step = 2 * math.pi / count
    half = orders * step / 2
    middle = harmonics * np.exp(1j * half)
    # integral of a e^{i j a} over a step about its middle; the series where it would cancel
    series = step * half * (1 / 6 - half**2 / 60 * (1 - half**2 / 28))
    closed = 2 * (np.sin(half) - half * np.cos(half)) / (orders**2 * step)
    spectra = np.zeros((2, count // 2 + 1), dtype=complex)
    spectra[0, 1 : len(harmonics) + 1] = middle * np.sinc(half / math.pi)
    spectra[1, 1 : len(harmonics) + 1] = -1j * middle * np.where(half < 0.05, series, closed)
    mean, offset = np.fft.irfft(spectra, count, norm="forward")
    return mean, offset


def _exponentials(diagonal: Real, lower: Real, length: Real) -> Real:
    """exp(B h) for B = [[d, 1], [l, -d]]: B^2 = (d^2 + l) I."""
    square = (diagonal**2 + lower) * length**2
    root = np.sqrt(np.abs(square))
    even, odd = np.cos(root), np.sinc(root / math.pi)
    slow = square > 0
    if slow.any():
        even[slow] = np.cosh(root[slow])
        odd[slow] = np.sinh(np.maximum(root[slow], 1e-9)) / np.maximum(root[slow], 1e-9)
    odd *= length
    return np.array([[even + odd * diagonal, odd], [odd * lower, even - odd * diagonal]])


def running_products(matrices: Real) -> tuple[Real, Real]:
    """S_i ... S_2 S_1 for all i, as (matrices of norm about one, natural logarithms of scale).

    Parameters
    ----------
    matrices : float ndarray, shape (2, 2, n, B)
        n a multiple of `IN_A_ROW`.
    """
    _, _, count, sets = matrices.shape
    rows = matrices.reshape(2, 2, count // IN_A_ROW, IN_A_ROW, sets).copy()
    for i in range(1, IN_A_ROW):
        rows[:, :, :, i] = period_trace.multiply(rows[:, :, :, i], rows[:, :, :, i - 1])
    ends, logs = rows[:, :, :, -1].copy(), np.zeros((count // IN_A_ROW, sets))
    shift = 1
    while shift < len(logs):
        ends[:, :, shift:] = period_trace.multiply(ends[:, :, shift:], ends[:, :, :-shift])
        logs[shift:] += logs[:-shift].copy()
        size = np.abs(ends).max(axis=(0, 1))
        ends /= size
        logs += np.log(size)
        shift *= 2
    rows[:, :, 1:] = period_trace.multiply(rows[:, :, 1:], ends[:, :, :-1, None])
    shifted = np.concatenate([np.zeros((1, sets)), logs[:-1]])
    return rows.reshape(matrices.shape), np.repeat(shifted, IN_A_ROW, axis=0)


def _swinging_columns(products: Real, logs: Real) -> Real:
    """Both multipliers on the unit circle: P = (real, imaginary part) of one complex vector."""
    last = products[:, :, -1] * np.exp(logs[-1])
    half_trace = (last[0, 0] + last[1, 1]) / 2
    swing = 1j * np.sqrt(np.maximum(0.0, 1 - half_trace**2))
    upper = np.abs(last[0, 1]) >= np.abs(last[1, 0])
    one = np.stack([last[0, 1] + 0j, half_trace + swing - last[0, 0]])
    other = np.stack([half_trace + swing - last[1, 1], last[1, 0] + 0j])
    vector = np.where(upper, one, other)
    # where the period map is +-1 every vector returns, and (1, i) is the roundest choice
    vector = np.where(np.abs(vector).max(axis=0) < 1e-14, np.array([[1], [1j]]), vector)
    moved = products[:, 0] * vector[0] + products[:, 1] * vector[1]
    moved *= np.exp(logs)
    return np.stack([moved.real, moved.imag], axis=1)


def _growing_columns(matrices: Real, products: Real, logs: Real, growth: Real) -> Real:
    """Real multipliers: both vectors that return after a period, their mean growth taken out.

    One is followed forwards and the other backwards, each where it outgrows rounding errors.
    """
    last = products[:, :, -1]
    trace = last[0, 0] + last[1, 1]
    shrink = np.copysign(np.exp(-growth - logs[-1]), trace)
    unit = np.eye(2)[:, :, None]
    first = _largest_column(last - shrink * unit)
    second = _largest_column(last - (trace - shrink) * unit)
    forward = products[:, 0] * first[0] + products[:, 1] * first[1]
    after, after_logs = running_products(matrices[:, :, ::-1].transpose(1, 0, 2, 3))
    # inverse of what is still to come after a step: the adjugate, its determinant being one
    inverse = np.array([[after[1, 1], -after[1, 0]], [-after[0, 1], after[0, 0]]])
    backward = (inverse[:, 0] * second[0] + inverse[:, 1] * second[1])[:, -2::-1]
    backward = np.concatenate([backward, second[:, None]], axis=1)
    columns = np.stack([forward, backward], axis=1)
    lengths = np.hypot(columns[0], columns[1])
    sizes = np.log(lengths)
    sizes[0] += logs
    sizes[1] += np.concatenate([after_logs[-2::-1], np.zeros((1, len(growth)))]) - growth
    shares = (np.arange(1, sizes.shape[1] + 1) / sizes.shape[1])[:, None]
    sizes -= shares * sizes[:, -1:]
    sizes -= sizes.mean(axis=1, keepdims=True)
    return np.asarray(columns / lengths * np.exp(sizes))


def _largest_column(matrix: Real) -> Real:
    lengths = np.hypot(matrix[0], matrix[1])
    best = lengths[0] >= lengths[1]
    return np.asarray(np.where(best, matrix[:, 0], matrix[:, 1]) / np.where(best, *lengths))


def _condition(columns: Real) -> Real:
    """max|P| max|P^-1| over stacks of 2 x 2 matrices, shape (2, 2, n, B)."""
    areas = np.abs(columns[0, 0] * columns[1, 1] - columns[0, 1] * columns[1, 0])
    squares = (columns**2).sum(axis=(0, 1))
    largest = np.sqrt((squares + np.sqrt(np.maximum(0.0, squares**2 - 4 * areas**2))) / 2)
    return np.asarray(largest.max(axis=0) * (largest / areas).max(axis=0))


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
    rows = [[_period_map(compliance, harmonics, count)]]
    old = math.nan
    while True:
        count *= 2
        row = [_period_map(compliance, harmonics, count)]
        for k, before in enumerate(rows[-1][:3], start=1):
            row.append(row[-1] + (row[-1] - before) / (4**k - 1))
        rows.append(row)
        values = np.linalg.eigvals(row[-1])
        radius = float(np.abs(values).max(initial=0.0))
        settled = abs(radius - old) <= max(SETTLED, 1e-3 * abs(1 - radius))
        if settled or count >= MOST_SYSTEM_STEPS:
            return np.asarray(values[np.argsort(-np.abs(values))], dtype=complex)
        old = radius


def _period_map(compliance: SystemCompliance, harmonics: Complex, count: int) -> Real:
    """Map of the modal state over a period in `count` steps, free rigid motions left out."""
    from scipy.linalg import expm

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
    state = _kicked(begun, expm(rate * step), seen, pushed, kicks[1:])
    matters = np.concatenate([held[kept], np.ones(n, dtype=bool)])
    return np.asarray(state[np.ix_(matters, matters)])


def _kicked(state: Real, drift: Real, seen: Real, pushed: Real, kicks: Real) -> Real:
    """Return the state after steps of free vibration, at the end of each a kick by every mesh.

    What the meshes see in a block of steps follows from the state before it by one triangular
    system, for a kick is felt by those after it only: far less work than step by step.
    """
    from scipy.linalg import solve_triangular

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
    whole = np.linalg.matrix_power(drift, steps)
    for strengths in kicks.reshape(-1, steps * meshes):
        places = solve_triangular(
            np.eye(len(between)) + between * strengths,
            unkicked @ state,
            lower=True,
            unit_diagonal=True,
            check_finite=False,
        )
        state = whole @ state - left @ (strengths[:, None] * places)
    return state
