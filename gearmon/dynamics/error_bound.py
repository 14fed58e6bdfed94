"""How large the error of an approximate vibration can be, from its residual; many sets at once.

Write the equation as L z = z'' + 2 zeta z' + (1 + phi) z = g in the dimensionless time s = w0 t,
the approximation y, its residual r = g - L y and its error e = z - y = L^{-1} r. All of r is
known. A number `gain` with ||(L^{-1} r)''|| <= gain ||r|| for every periodic r then bounds the
error of the acceleration. The cheapest of three such numbers that is not loose is taken:

small gain
    L = (D + b) + (phi - b) with D diagonal over the harmonics and b midway between the extremes of
    phi. If max|phi - b| max 1/|D_n + b| < 1 the Neumann series of L^{-1} converges and gives the
    gain; the same with all real frequencies instead of the harmonics proves stability (circle
    criterion).
energy
    With v = z' + zeta z, q = 1 - zeta^2 + phi > 0 and E = q^{1/2} z^2 + q^{-1/2} v^2 (the adiabatic
    invariant of a slowly varying spring), (E^{1/2})' <= (|q'|/(4 q) - zeta) E^{1/2} + q^{-1/4} |r|.
    If the total variation V of ln q in a period stays below 8 pi R zeta, every free vibration dies
    out and, with margin = zeta - V/(8 pi R),

        ||E^{1/2}|| <= e^{V/4} max q^{-1/4} ||r||/margin.

    So light damping is enough where the natural vibration is fast beside the mesh.
Floquet
    The period is cut into steps, at the same angles for all sets that share phi. Within a step phi
    is split into its mean and a rest kappa = q' whose integral q vanishes at both ends. With
    v = z' + q z the state x = (z, v) obeys

        x' = [ -q             1        ] x + [0, r]
             [ -(1 + mean) + 2 zeta q - q^2,  -2 zeta + q ]

    so that the rest enters through q = O(step^2) only. Keeping the mean of q in the constant part
    makes the step matrix accurate to the fourth order; what is left is bounded by
    A = step^2 max|phi'|/8 and added by a Neumann argument. Step matrices are closed form, with
    e^{-zeta s} split off so that their determinant is one.

    With the periodic change of variables x = P(s) y that makes the matrix constant, each component
    of y is a scalar equation whose gain is 1/|in/R - exponent| exactly, and the gain of the inverse
    is at most cond(P) times the larger of the two. The columns of P are the real and imaginary part
    of one free vibration where the two multipliers have equal moduli, and else both free
    vibrations, each with its mean growth taken out.

Sizes are those of exact arithmetic; rounding enters through the residual, see `mesh_equations`.
Numbers of the sets have the shape (B,); all of them share phi but for a factor `scale`. Arrays of
the Floquet form have the steps on axis 2 behind the 2 x 2 matrices, and the sets behind them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.floquet import LARGE, exponentials, growth, growth_of, multiply
from gearmon.dynamics.fourier import (
    Complex,
    Real,
    extremes,
    fast_length,
    rms,
    rms_of_each,
    samples,
    supremum,
    with_zero_mean,
)
from gearmon.dynamics.hill import stiffness_at

#: A gain this many times the response of the mean spring is worth improving.
LOOSE = 1e3
#: Sets from which on their common cost counts more than the sharpness of each bound.
FEWEST_TOGETHER = 16
MOST_STEPS = 1 << 21
#: Steps times sets that are followed together.
BLOCK = 1 << 16
#: Steps multiplied one after another before their products are, pair by pair.
IN_A_ROW = 16


@dataclass(frozen=True, eq=False)
class Pattern:
    """Sizes of phi over the angle x = w t, each proven for all angles.

    Parameters
    ----------
    harmonics : complex ndarray, shape (J,), or (meshes, J)
        c_1..c_J. Of several meshes only `highest` and `size` are known.
    """

    harmonics: Complex

    @cached_property
    def half(self) -> Complex:
        """Half spectrum of phi."""
        return with_zero_mean(self.harmonics)

    @cached_property
    def _extremes(self) -> tuple[float, float, float]:
        return extremes(self.half)

    @cached_property
    def highest(self) -> float:
        """Bound of max|phi|, of all meshes."""
        low, high, share = self._extremes
        return max(high, -low) / share

    @cached_property
    def size(self) -> Real:
        """Rms of phi, shape (1,) or (meshes, 1)."""
        return rms_of_each(self.half)[..., None]

    @cached_property
    def middle_and_swing(self) -> tuple[float, float]:
        """A number b about midway between the extremes of phi, and a bound of max|phi - b|."""
        low, high, share = self._extremes
        return (high + low) / 2, (high - low) / 2 / share

    @cached_property
    def _slopes(self) -> Complex:
        return 1j * np.arange(len(self.half)) * self.half

    @cached_property
    def slope(self) -> float:
        """Bound of max |dphi/dx|."""
        return supremum(self._slopes)

    @cached_property
    def variation(self) -> float:
        """Bound of the total variation of phi in a period."""
        count = len(self.harmonics)
        curvature = supremum(1j * np.arange(count + 1) * self._slopes)
        length = fast_length(max(512, 32 * count))
        grid = samples(self.half, length)
        # phi' has at most 2 J zeros, and only a step with a zero varies more than its ends show
        seen = float(np.abs(np.diff(grid, append=grid[:1])).sum())
        proven = seen + count * (2 * math.pi / length) ** 2 * curvature
        return min(proven, 2 * math.pi * rms(self._slopes))


@dataclass(frozen=True, kw_only=True, eq=False)
class Gain:
    """Bounds of the inverse operators of some sets; arrays have the shape (B,).

    Attributes
    ----------
    acceleration : float ndarray
        ||(L^{-1} r)''|| <= acceleration ||r||, rms over the period, in units of w0^2 z. Infinite if
        none is known.
    stable : bool ndarray
        Whether free vibrations die out: proven where the gain is finite, else by the multipliers.
    growth : float ndarray
        ln of the larger multiplier's modulus where free vibrations grow, infinite where nothing
        damps them, else nan.
    """

    acceleration: Real
    stable: npt.NDArray[np.bool_]
    growth: Real = field(default_factory=lambda: np.array(math.nan))


def best_gain(ratio: Real, zeta: Real, scale: Real, pattern: Pattern) -> Gain:
    """Cheapest gain of every set that is of use.

    Parameters
    ----------
    ratio, zeta, scale : float ndarray, shape (B,)
        R = w0/w > 0, damping ratio >= 0, factor of phi >= 0.
    pattern : Pattern
        Of phi.
    """
    damped = zeta > 0
    grown = np.where(damped, np.nan, np.inf)
    gain, response = small_gain(ratio, zeta, scale, pattern)
    # a few are worth a sharp bound wherever the cheapest fails: it spares orders and harmonics
    few = len(ratio) < FEWEST_TOGETHER
    allowed = np.where(np.isfinite(gain), gain, 0.0) if few else LOOSE * response
    loose = np.flatnonzero(damped & (gain > allowed))
    if len(loose):
        energy = energy_gain(ratio[loose], zeta[loose], scale[loose], pattern)
        gain[loose] = np.minimum(gain[loose], energy)
        loose = loose[gain[loose] > allowed[loose]]
    if len(loose):
        better, grown[loose] = floquet_gain(ratio[loose], zeta[loose], scale[loose], pattern)
        gain[loose] = np.minimum(gain[loose], better)
    gain = np.where(damped & np.isnan(grown), gain, np.inf)
    left = np.flatnonzero(np.isinf(gain) & np.isnan(grown))
    if len(left):
        known = ratio[left], scale[left], zeta[left], pattern.harmonics
        excess = growth_of(*known, tolerance=1e-9)
        grown[left] = np.where(excess < 0, np.nan, excess)
    return Gain(acceleration=gain, stable=np.isnan(grown), growth=grown)


def small_gain(ratio: Real, zeta: Real, scale: Real, pattern: Pattern) -> tuple[Real, Real]:
    """Gains by the Neumann series, infinite where it fails to prove stability, and bare responses.

    Parameters
    ----------
    ratio, zeta, scale, pattern
        As in `best_gain`.

    Returns
    -------
    (float ndarray, float ndarray)
        Gain; and max (n/R)^2/|D_n + b|, the gain without variation.

    Examples
    --------
    >>> one = np.ones(1)
    >>> bool(np.isfinite(small_gain(13.6 * one, 0.3 * one, one, Pattern(np.array([0.08])))[0]))
    True
    """
    middle, swing = (scale * size for size in pattern.middle_and_swing)
    # (1 + b) times the operator of this stiffness and of the R and zeta that go with it
    rest = np.where(middle > -1, 1 + middle, 1.0)
    ratio, zeta, swing = ratio * np.sqrt(rest), zeta / np.sqrt(rest), swing / rest
    # |D|^2 and |D|^2/x^4 are parabolas in x^2 and 1/x^2: least at a neighbour of their vertex, or
    # where there is none at the line 0 and far above
    middles = 1 - 2 * zeta**2
    vertices = ratio * np.sqrt([np.maximum(middles, 0), 1 / np.where(middles > 0, middles, 1)])
    below = np.floor(vertices)
    x = np.array([below, below + 1]) / ratio
    with np.errstate(divide="ignore", invalid="ignore"):
        compliance = 1 / np.abs(stiffness_at(x, zeta))
        softest = compliance[:, 0].max(axis=0)
        response = np.maximum(1.0, (x[:, 1] ** 2 * compliance[:, 1]).max(axis=0))
        # over the lines, and over all frequencies
        inner = np.minimum(zeta, math.sqrt(0.5))
        peak = 1 / (2 * inner * np.sqrt(1 - inner * inner))
        loop, around = (np.where(swing > 0, swing * most, 0.0) for most in (softest, peak))
    proven = (middle > -1) & (loop < 1) & (around < 1)
    gain = np.where(proven, response / np.where(proven, 1 - loop, 1.0), np.inf)
    return gain, response


def energy_gain(ratio: Real, zeta: Real, scale: Real, pattern: Pattern) -> Real:
    """Gains by the adiabatic invariant, infinite where it proves nothing; as in `best_gain`."""
    swing, variation = scale * pattern.highest, scale * pattern.variation
    low, high = 1 - zeta**2 - swing, 1 - zeta**2 + swing
    useful = low > 0
    low, high = np.where(useful, low, 1.0), np.where(useful, high, 1.0)
    margin = zeta - variation / (8 * math.pi * ratio * low)
    useful &= margin > 0
    with np.errstate(over="ignore"):
        state = np.exp(variation / (4 * low)) * low**-0.25 / np.where(useful, margin, 1.0)
        force = np.hypot(
            2 * zeta * high**0.25,
            np.maximum(np.abs(low - zeta**2) * low**-0.25, np.abs(high - zeta**2) * high**-0.25),
        )
        return np.where(useful, 1 + force * state, np.inf)


def floquet_gain(ratio: Real, zeta: Real, scale: Real, pattern: Pattern) -> tuple[Real, Real]:
    """Gains by the Floquet form, of many sets; all arrays have the shape (B,).

    Parameters
    ----------
    ratio, zeta, scale : float ndarray
        R, damping ratio > 0, and the factor of phi.
    pattern : Pattern
        Of phi.

    Returns
    -------
    gain : float ndarray
        ||(L^-1 r)''|| <= gain ||r||; infinite where nothing is proven or free vibrations grow.
    growth : float ndarray
        ln of the larger multiplier's modulus if it is above one for certain, else nan.
    """
    found, grown = np.full(len(ratio), np.inf), np.full(len(ratio), np.nan)
    counts = _step_counts(ratio, zeta, scale, pattern)
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
            found[part], grown[part], loop = _gain_of_steps(
                ratio[part], zeta[part], scale[part], pattern, count
            )
            # the loop falls with the square of the step
            factor = np.where(np.isfinite(loop), 1.2 * np.sqrt(np.clip(loop, 1.0, 64.0)), 9.0)
            counts[part] = _in_rows(count * np.maximum(1.5, factor))
        waiting = waiting[np.isinf(found[waiting]) & np.isnan(grown[waiting])]
    return found, grown


def _step_counts(ratio: Real, zeta: Real, scale: Real, pattern: Pattern) -> Real:
    """Count steps short enough for the rest to be small beside a resonance at this damping."""
    for_rest = np.sqrt(scale * pattern.slope / ratio * (1 + zeta) / np.maximum(zeta, 1e-6))
    # most of many sets need no more; for a few, a sharp bound spares harmonics
    fewer = 0.6 if len(ratio) >= FEWEST_TOGETHER else 1.0
    steps = fewer * 2 * math.pi * ratio * np.maximum(3 * (1 + zeta), for_rest)
    return _in_rows(np.maximum(max(16, 2 * len(pattern.harmonics) + 2), steps))


def _in_rows(counts: Real) -> Real:
    return np.asarray(IN_A_ROW * np.ceil(counts / IN_A_ROW))


def _gain_of_steps(
    ratio: Real, zeta: Real, scale: Real, pattern: Pattern, count: int
) -> tuple[Real, Real, Real]:
    """Gains, certain growths, and twice the Neumann loop of sets cut into `count` steps."""
    period = 2 * math.pi * ratio
    length = period / count
    # sets that grow too fast give nonsense here, and are left unsettled
    with np.errstate(all="ignore"):
        products, logs, matrices = _steps(ratio, zeta, scale, pattern, count)
        half_trace = (products[0, 0, -1] + products[1, 1, -1]) / 2
        grown = growth(half_trace, logs[-1])
        turned = np.arccos(np.clip(half_trace * np.exp(np.minimum(logs[-1], LARGE)), -1, 1))
        margin = zeta - grown / period
        rest = scale * pattern.slope / ratio * length**2 / 8
        within = zeta + np.hypot(zeta + rest, scale * pattern.highest / 2 + zeta * rest)
        columns = _swinging_columns(products, logs)
        if grown.any():
            real = _growing_columns(matrices, products, logs, grown)
            columns = np.where(grown > 0, real, columns)
        state = _condition(columns) * np.exp(2 * length * within)
        state /= np.hypot(margin, np.where(grown > 0, 0.0, turned) / period)
        loop = state * (2 * rest * (1 + 2 * zeta) + rest**2)
        force = np.hypot(1 + scale * pattern.highest + 2 * zeta * rest, 2 * zeta)
        found = 1 + force * state / (1 - loop)
        proven = (margin > 0) & (loop < 0.5) & np.isfinite(found)
        # close to the boundary the steps are not exact enough to tell
        excess = grown - zeta * period
        growing = excess > 1e-2 * (1 + zeta * period)
    return np.where(proven, found, np.inf), np.where(growing, excess, np.nan), 2 * loop


def _steps(
    ratio: Real, zeta: Real, scale: Real, pattern: Pattern, count: int
) -> tuple[Real, Real, Real]:
    """Products up to each step and ln of their scale, and the step matrices themselves."""
    mean, offset = _step_averages(pattern.harmonics, count)
    mean, offset = scale * mean[:, None], scale * ratio * offset[:, None]
    h, lower = 2 * math.pi * ratio / count, -(1 + mean) + 2 * zeta * offset
    diagonal = zeta - offset
    matrices, log = exponentials(diagonal * h, h, lower * h, (diagonal**2 + lower) * h**2)
    if log.any():
        matrices *= np.exp(log)
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
    shares = [np.sinc(half / math.pi), -1j * np.where(half < 0.05, series, closed)]
    mean, offset = samples(with_zero_mean(middle * np.array(shares)), count)
    return mean, offset


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
        rows[:, :, :, i] = multiply(rows[:, :, :, i], rows[:, :, :, i - 1])
    ends, logs = rows[:, :, :, -1].copy(), np.zeros((count // IN_A_ROW, sets))
    shift = 1
    while shift < len(logs):
        ends[:, :, shift:] = multiply(ends[:, :, shift:], ends[:, :, :-shift])
        logs[shift:] += logs[:-shift].copy()
        size = np.abs(ends).max(axis=(0, 1))
        ends /= size
        logs += np.log(size)
        shift *= 2
    rows[:, :, 1:] = multiply(rows[:, :, 1:], ends[:, :, :-1, None])
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
