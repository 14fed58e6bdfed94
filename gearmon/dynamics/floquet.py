"""Floquet theory of the homogeneous equation: multipliers, and how strongly it can amplify.

In the dimensionless time s = w0 t the equation is z'' + 2 zeta z' + (1 + phi(s)) z = r with
phi(s) = sum_j (c_j e^{ijs/R} + conjugate) and R = w0/w. The period is cut into steps. Within a
step phi is split into its mean and a rest kappa = q' whose integral q vanishes at both ends. With
v = z' + q z the state x = (z, v) obeys

    x' = [ -q             1        ] x + [0, r]
         [ -(1 + mean) + 2 zeta q - q^2,  -2 zeta + q ]

so that the rest enters through q = O(step^2) only. Keeping the mean of q in the constant part
makes the step matrix accurate to the fourth order; what is left is bounded by
A = step^2 max|phi'|/8 and absorbed in the bound of the gain. Step matrices are closed form, with
e^{-zeta s} split off so that their determinant is one.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.fourier import Complex, Real, supremum, with_zero_mean

MOST_STEPS = 1 << 21
NEGLIGIBLE = 1e-18
#: e to this is the largest number.
LARGEST_EXPONENT = 709.0


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Step matrices over one period, with the damping e^{-zeta s} taken out.

    Attributes
    ----------
    matrices : float ndarray, shape (2, 2, n)
        Unit-determinant transfer matrix of each step.
    length : float
        Step in the dimensionless time s.
    rest : float
        A, the bound of |q|.
    """

    matrices: Real
    length: float
    rest: float


def slope(ratio: float, harmonics: Complex) -> float:
    """Bound of max |dphi/ds|, from a grid."""
    orders = np.arange(1, len(harmonics) + 1)
    return supremum(with_zero_mean(1j * orders * harmonics / ratio))


def make_steps(ratio: float, zeta: float, harmonics: Complex, count: int) -> Steps:
    """Closed-form step matrices for `count` equal steps of the period 2 pi R; count > 2J."""
    length = 2 * math.pi * ratio / count
    mean, offset = _step_averages(harmonics, length, ratio, count)
    matrices = _exponentials(zeta - offset, -(1 + mean) + 2 * zeta * offset, length)
    rest = length**2 * slope(ratio, harmonics) / 8 if len(harmonics) else 0.0
    return Steps(matrices=matrices, length=length, rest=rest)


def _step_averages(c: Complex, length: float, ratio: float, count: int) -> tuple[Real, Real]:
    """Means over each step of phi and of q, exact for the given harmonics."""
    beta = np.arange(1, len(c) + 1) / ratio
    half = beta * length / 2
    middle = c * np.exp(1j * half)
    # integral of s e^{i beta s} over a step about its middle; the series where it would cancel
    series = length * half * (1 / 6 - half**2 / 60 * (1 - half**2 / 28))
    closed = 2 * (np.sin(half) - half * np.cos(half)) / (beta**2 * length)
    moment = np.where(half < 0.05, series, closed)
    spectra = np.zeros((2, count // 2 + 1), dtype=complex)
    spectra[0, 1 : len(c) + 1] = middle * np.sinc(half / math.pi)
    spectra[1, 1 : len(c) + 1] = -1j * middle * moment
    mean, offset = np.fft.irfft(spectra, count, norm="forward")
    return mean, offset


def _exponentials(diagonal: Real, lower: Real, length: float) -> Real:
    """exp(B h) for B = [[d, 1], [l, -d]]: B^2 = (d^2 + l) I."""
    square = diagonal**2 + lower
    root = np.sqrt(np.abs(square)) * length
    swings = square < 0
    with np.errstate(over="raise"):
        even = np.where(swings, np.cos(root), np.cosh(np.where(swings, 0.0, root)))
        odd = np.where(swings, np.sinc(root / math.pi), _sinhc(np.where(swings, 0.0, root)))
    odd *= length
    return np.array([[even + odd * diagonal, odd], [odd * lower, even - odd * diagonal]])


def _sinhc(x: Real) -> Real:
    safe = np.where(x < 1e-4, 1.0, x)
    return np.where(x < 1e-4, 1 + x**2 / 6, np.sinh(safe) / safe)


def multiply(left: Real, right: Real) -> Real:
    """Products of stacks of 2 x 2 matrices, shapes (2, 2, n)."""
    product: Real = np.einsum("ijn,jkn->ikn", left, right)
    return product


def running_products(matrices: Real) -> tuple[Real, Real]:
    """S_i ... S_2 S_1 for all i, as (matrices of norm about one, natural logarithms of scale)."""
    products = matrices.copy()
    logs = np.zeros(matrices.shape[-1])
    shift = 1
    while shift < matrices.shape[-1]:
        products[:, :, shift:] = multiply(products[:, :, shift:], products[:, :, :-shift])
        logs[shift:] += logs[:-shift].copy()
        size = np.abs(products).max(axis=(0, 1))
        products /= size
        logs += np.log(size)
        shift *= 2
    return products, logs


def total_product(matrices: Real) -> tuple[Real, float]:
    """S_n ... S_2 S_1 as (matrix of norm about one, natural logarithm of its scale)."""
    logs = np.zeros(matrices.shape[-1])
    while matrices.shape[-1] > 1:
        even = matrices.shape[-1] // 2 * 2
        pairs = multiply(matrices[:, :, 1:even:2], matrices[:, :, 0:even:2])
        size = np.abs(pairs).max(axis=(0, 1))
        matrices = np.concatenate([pairs / size, matrices[:, :, even:]], axis=-1)
        logs = np.concatenate([logs[1:even:2] + logs[0:even:2] + np.log(size), logs[even:]])
    return matrices[:, :, 0], float(logs[0])


def exponents(product: Real, log: float) -> tuple[complex, complex]:
    """Logarithms of the two eigenvalues of a unit-determinant matrix e^log * product, sum zero."""
    half_trace = float(product[0, 0] + product[1, 1]) / 2
    turn = math.pi if half_trace < 0 else 0.0
    if log > 30:
        if half_trace == 0:
            return complex(0, math.pi / 2), complex(0, -math.pi / 2)
        growth = math.log(2 * abs(half_trace)) + log
        return complex(growth, turn), complex(-growth, -turn)
    value = half_trace * math.exp(log)
    if abs(value) <= 1:
        angle = math.acos(value)
        return complex(0, angle), complex(0, -angle)
    growth = math.acosh(abs(value))
    return complex(growth, turn), complex(-growth, -turn)


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
        Steps are halved until e^{zeta T} times the multipliers changes by less than this,
        relative to their size; or by less than 1e-18.

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
    decay = 2 * math.pi * ratio * zeta
    count = _first_count(ratio, zeta, harmonics)
    old = _trace(ratio, zeta, harmonics, count)
    while count < MOST_STEPS:
        count *= 2
        new = _trace(ratio, zeta, harmonics, count)
        change = abs(new[0] - old[0] * math.exp(old[1] - new[1]))
        # the error falls by 16 with each halving of a fourth-order step
        allowed = 15 * tolerance * max(abs(new[0]), math.exp(-new[1]))
        if change <= allowed or math.log(change) + new[1] - decay < math.log(NEGLIGIBLE):
            break
        old = new
    pair = exponents(np.diag([new[0], new[0]]), new[1])
    return _exponential(pair[0] - decay), _exponential(pair[1] - decay)


def _exponential(exponent: complex) -> complex:
    """e^exponent, infinite where that exceeds the largest number."""
    if exponent.real > LARGEST_EXPONENT:
        return complex(math.inf, 0.0)
    return cmath.exp(exponent)


def _trace(ratio: float, zeta: float, harmonics: Complex, count: int) -> tuple[float, float]:
    product, log = total_product(make_steps(ratio, zeta, harmonics, count).matrices)
    return float(product[0, 0] + product[1, 1]) / 2, log


def _first_count(ratio: float, zeta: float, harmonics: Complex) -> int:
    """Enough steps for one radian each of the free vibration and of the highest harmonic."""
    return 2 * max(8, len(harmonics) + 1, math.ceil(math.pi * ratio * (1 + zeta)))


@dataclass(frozen=True, kw_only=True)
class FloquetForm:
    """The periodic change of variables x = P(s) y that makes the equation two scalar ones.

    Attributes
    ----------
    margin : float
        Decay rate of the slowest free vibration, per unit of s; <= 0 means unstable.
    state_gain : float
        Bound of ||x||/||f|| over all periodic f in x' = A x + f, on the steps.
    length, rest : float
        As in `Steps`.
    """

    margin: float
    state_gain: float
    length: float
    rest: float


def floquet_form(ratio: float, zeta: float, harmonics: Complex, count: int) -> FloquetForm:
    """Floquet form on `count` steps of the period; arguments as in `multipliers`."""
    steps = make_steps(ratio, zeta, harmonics, count)
    products, logs = running_products(steps.matrices)
    pair = exponents(products[:, :, -1], float(logs[-1]))
    period = 2 * math.pi * ratio
    margin = zeta - pair[0].real / period
    distance = math.hypot(margin, pair[0].imag / period)
    gain = math.inf
    if margin > 0 and pair[0].real == 0:
        gain = _condition(_swinging_columns(products, logs)) / distance
    elif margin > 0:
        columns, sizes = _growing_columns(steps.matrices, products, logs, pair[0].real)
        gain = _growing_gain(columns, sizes, zeta * steps.length, steps.length, distance)
    return FloquetForm(margin=margin, state_gain=gain, length=steps.length, rest=steps.rest)


def _swinging_columns(products: Real, logs: Real) -> Real:
    """Both multipliers on the unit circle: P = (real, imaginary part) of one complex vector."""
    last = products[:, :, -1] * math.exp(logs[-1])
    half_trace = (last[0, 0] + last[1, 1]) / 2
    swing = 1j * math.sqrt(max(0.0, 1 - half_trace**2))
    if abs(last[0, 1]) >= abs(last[1, 0]):
        vector = np.array([last[0, 1], half_trace + swing - last[0, 0]])
    else:
        vector = np.array([half_trace + swing - last[1, 1], last[1, 0]])
    if np.abs(vector).max() < 1e-14:
        # the period map is +-1: every vector returns, and (1, i) is the roundest choice
        vector = np.array([1, 1j])
    moved = np.einsum("ijn,j->in", products, vector) * np.exp(logs)
    return np.stack([moved.real, moved.imag], axis=1)


def _growing_columns(
    matrices: Real, products: Real, logs: Real, growth: float
) -> tuple[Real, Real]:
    """Real multipliers: unit vectors that return after a period, and ln of how they have grown.

    One is followed forwards and the other backwards, each where it outgrows rounding errors.
    """
    last = products[:, :, -1]
    trace = last[0, 0] + last[1, 1]
    shrink = math.copysign(math.exp(-growth - logs[-1]), trace)
    first = _largest_column(last - shrink * np.eye(2))
    second = _largest_column(last - (trace - shrink) * np.eye(2))
    forward = np.einsum("ijn,j->in", products, first)
    after, after_logs = running_products(matrices[:, :, ::-1].transpose(1, 0, 2))
    # inverse of what is still to come after a step: the adjugate, its determinant being one
    inverse = np.array([[after[1, 1], -after[1, 0]], [-after[0, 1], after[0, 0]]])
    backward = np.einsum("ijn,j->in", inverse, second)[:, -2::-1]
    backward = np.concatenate([backward, second[:, None]], axis=1)
    columns = np.stack([forward, backward], axis=1)
    lengths = np.hypot(columns[0], columns[1])
    sizes = np.log(lengths)
    sizes[0] += logs
    sizes[1] += np.concatenate([after_logs[-2::-1], [0.0]]) - growth
    return columns / lengths, sizes


def _largest_column(matrix: Real) -> Real:
    lengths = np.hypot(matrix[0], matrix[1])
    best = int(lengths.argmax())
    column: Real = matrix[:, best] / lengths[best]
    return column


def _growing_gain(
    columns: Real, sizes: Real, decay: float, length: float, distance: float
) -> float:
    """Return the better of two bounds: sizes averaged over the period, or followed step by step."""
    share = np.arange(1, sizes.shape[1] + 1) / sizes.shape[1] * sizes[:, -1:]
    even = sizes - share
    even -= even.mean(axis=1, keepdims=True)
    with np.errstate(over="ignore", invalid="ignore"):
        averaged = _condition(columns * np.exp(even)) / distance
        followed = _condition(columns) * _scalar_gain(
            np.exp(np.diff(sizes, prepend=0.0) - decay), length
        )
    return float(np.fmin(averaged, followed))


def _scalar_gain(factors: Real, length: float) -> float:
    """Gain of y' = a(s) y + f for factors e^(a h) of each step, shape (2, n): Schur's test."""
    weights = length * np.maximum(1.0, factors)
    ahead = _periodic_sums(factors, weights)
    back = _periodic_sums(factors[:, ::-1], weights[:, ::-1])
    return float(np.sqrt(ahead.max(axis=1) * back.max(axis=1)).max())


def _periodic_sums(factors: Real, weights: Real) -> Real:
    """Periodic solution of y_i = factor_i y_{i-1} + weight_i, last axis."""
    gain, total = factors.copy(), weights.copy()
    shift = 1
    while shift < gain.shape[-1]:
        total[:, shift:] += gain[:, shift:] * total[:, :-shift].copy()
        gain[:, shift:] = gain[:, shift:] * gain[:, :-shift]
        shift *= 2
    start = total[:, -1:] / (1 - gain[:, -1:])
    return total + gain * start


def _condition(columns: Real) -> float:
    """max|P| max|P^-1| over a stack of 2 x 2 matrices, shape (2, 2, n)."""
    areas = np.abs(columns[0, 0] * columns[1, 1] - columns[0, 1] * columns[1, 0])
    squares = (columns**2).sum(axis=(0, 1))
    largest = np.sqrt((squares + np.sqrt(np.maximum(0.0, squares**2 - 4 * areas**2))) / 2)
    with np.errstate(divide="ignore"):
        return float(largest.max() * (largest / areas).max())
