"""Gains and error bounds of many sets at once.

The theory is that of `error_bound`: ||error of acceleration|| <= gain ||residual||. Three bounds of
the inverse operator are computed for all sets together.

small gain
    As in `error_bound`, with the exact extrema of |D_n| over the harmonics.
energy
    With v = z' + zeta z, q = 1 - zeta^2 + phi > 0 and E = q^{1/2} z^2 + q^{-1/2} v^2 (the adiabatic
    invariant of a slowly varying spring), (E^{1/2})' <= (|q'|/(4 q) - zeta) E^{1/2} + q^{-1/4} |r|.
    If the total variation V of ln q in a period stays below 8 pi R zeta, every free vibration dies
    out and, with margin = zeta - V/(8 pi R),

        ||E^{1/2}|| <= e^{V/4} max q^{-1/4} ||r||/margin.

    So light damping is enough where the natural vibration is fast beside the mesh.
Floquet
    As in `error_bound`; see `sweep_floquet`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.certificate import UNIT_ROUNDOFF
from gearmon.dynamics.fourier import (
    Complex,
    Real,
    fast_length,
    rms,
    samples,
    supremum,
    with_zero_mean,
)

FLOQUET_CHUNK = 512
# a bound this many times the largest response of the mean spring is worth improving
LOOSE = 100.0


@dataclass(frozen=True, kw_only=True)
class Swing:
    """Sizes of phi over the angle x = w t, for scale 1.

    Attributes
    ----------
    harmonics : complex ndarray, shape (J,)
        c_1..c_J.
    highest : float
        Bound of max|phi|.
    variation : float
        Bound of the total variation of phi in a period.
    slope : float
        Bound of max |dphi/dx|.
    """

    harmonics: Complex
    highest: float
    variation: float
    slope: float

    def scaled(self, factor: float) -> Swing:
        """Bounds of `factor` phi; factor >= 0."""
        return Swing(
            harmonics=factor * self.harmonics,
            highest=factor * self.highest,
            variation=factor * self.variation,
            slope=factor * self.slope,
        )


def swing_of(harmonics: Complex) -> Swing:
    """Bounds of phi from its values on a grid, each proven for all angles."""
    count = len(harmonics)
    if not count:
        return Swing(harmonics=harmonics, highest=0.0, variation=0.0, slope=0.0)
    orders = np.arange(1, count + 1)
    slope = with_zero_mean(1j * orders * harmonics)
    curvature = supremum(with_zero_mean(-(orders**2) * harmonics))
    length = fast_length(max(512, 32 * count))
    grid = samples(with_zero_mean(harmonics), length)
    # phi' has at most 2 J zeros, and only a step with a zero varies more than its ends show
    seen = float(np.abs(np.diff(grid, append=grid[:1])).sum())
    variation = seen + count * (2 * math.pi / length) ** 2 * curvature
    return Swing(
        harmonics=harmonics,
        highest=supremum(with_zero_mean(harmonics)),
        variation=min(variation, 2 * math.pi * rms(slope)),
        slope=supremum(slope),
    )


def small_gain(ratio: Real, zeta: Real, swing: Real) -> tuple[Real, Real]:
    """Gains by the Neumann series, infinite where it fails to prove stability, and bare responses.

    Parameters
    ----------
    ratio, zeta, swing : float ndarray, shape (B,)
        R, damping ratio, bound of max|phi|.

    Returns
    -------
    (float ndarray, float ndarray)
        Gain; and max (n/R)^2/|D_n|, the gain without variation.
    """
    bend = 1 - 2 * zeta**2
    softest = np.zeros_like(ratio)
    response = np.ones_like(ratio)
    # |D|^2 and |D|^2/x^4 are parabolas in x^2 and 1/x^2: least at a neighbour of their vertex
    for side in (np.floor, np.ceil):
        x = side(ratio * np.sqrt(np.maximum(bend, 0.0))) / ratio
        softest = np.maximum(softest, 1 / _size(x, zeta))
        x = side(ratio / np.sqrt(np.where(bend > 0, bend, 1.0))) / ratio
        response = np.maximum(response, np.where(bend > 0, x**2 / _size(x, zeta), 1.0))
    peak = 1 / (2 * zeta * np.sqrt(np.maximum(0.5, 1 - zeta**2)))
    loop = swing * softest
    proven = (loop < 1) & (swing * np.where(bend > 0, peak, 1.0) < 1)
    gain = np.where(proven, response / np.where(proven, 1 - loop, 1.0), np.inf)
    return gain, response


def _size(x: Real, zeta: Real) -> Real:
    return np.asarray(np.hypot(1 - x**2, 2 * zeta * x))


def energy_gain(
    ratio: Real, zeta: Real, swing: Real, variation: Real, oscillation: Real | None = None
) -> Real:
    """Gains by the adiabatic invariant, infinite where it proves nothing; arguments shape (B,).

    Parameters
    ----------
    ratio, zeta, swing, variation : float ndarray, shape (B,)
        R, damping ratio, bounds of max|phi| and of the total variation of phi in a period.
    oscillation : float ndarray, shape (B,), optional
        Bound of how far the variation runs ahead of its mean rate; by default that of one period.
    """
    low, high = 1 - zeta**2 - swing, 1 - zeta**2 + swing
    useful = low > 0
    low, high = np.where(useful, low, 1.0), np.where(useful, high, 1.0)
    margin = zeta - variation / (8 * math.pi * ratio * low)
    useful &= margin > 0
    ahead = variation if oscillation is None else oscillation
    with np.errstate(over="ignore"):
        state = np.exp(ahead / (4 * low)) * low**-0.25 / np.where(useful, margin, 1.0)
        force = np.hypot(
            2 * zeta * high**0.25,
            np.maximum(np.abs(low - zeta**2) * low**-0.25, np.abs(high - zeta**2) * high**-0.25),
        )
        return np.where(useful, 1 + force * state, np.inf)


@dataclass(frozen=True, kw_only=True)
class Sets:
    """Numbers of the sets of one group, each shape (B,), and how far the inverse reaches.

    Attributes
    ----------
    ratio, zeta, scale : float ndarray
        R, damping ratio, factor of phi.
    gain : float ndarray
        Bound of the inverse operator.
    """

    ratio: Real
    zeta: Real
    scale: Real
    gain: Real

    @property
    def numbers(self) -> tuple[Real, Real, Real]:
        """Ratio, zeta and scale."""
        return self.ratio, self.zeta, self.scale

    def __getitem__(self, part: npt.NDArray[np.int_]) -> Sets:
        values = (self.ratio, self.zeta, self.scale, self.gain)
        ratio, zeta, scale, gain = (v[part] for v in values)
        return Sets(ratio=ratio, zeta=zeta, scale=scale, gain=gain)


def relative_bounds(
    sets: Sets, y: Real, product: Real, forcing: Real, sizes: tuple[Real, Real], shown: int
) -> Real:
    """Guaranteed relative L2 error of the acceleration of every set, shape (B,).

    Parameters
    ----------
    sets : Sets
        Whose the columns are.
    y : float ndarray, shape (2 N + 2, B)
        Rows of the approximation.
    product : float ndarray, shape (2 (N + J) + 2, B)
        phi y, all of it.
    forcing : float ndarray, shape (2 (N + J) + 2, 1 or B)
        Coefficients 0, c_1, ... of phi.
    sizes : (float ndarray, float ndarray)
        Bound of max|phi| and sum of 2|c_j|, for scale 1, shape () or (B,).
    shown : int
        Harmonics above this are not handed out.

    Notes
    -----
    Harmonics N+1..N+J of the residual r are answered by r_n/D_n; the rest of the argument is that
    of `certificate`.
    """
    count, reach = len(y) // 2, len(product) // 2
    swing, total_size = sets.scale * sizes[0], sets.scale * sizes[1]
    left = product + forcing
    left *= -sets.scale
    x = np.arange(reach)[:, None] / sets.ratio
    squares = x * x
    real, imaginary = 1 - squares, 2 * sets.zeta * x
    re, im = y[:count], y[count:]
    inside_re = left[:count] - (real[:count] * re - imaginary[:count] * im)
    inside_im = left[reach : reach + count] - (imaginary[:count] * re + real[:count] * im)
    lines = re * re + im * im
    inside = _mean_square(inside_re * inside_re + inside_im * inside_im)
    size = _mean_square((squares[:count] ** 2 * lines)[: shown + 1])
    stiffness = real[count:] ** 2 + imaginary[count:] ** 2
    outside = (left[count:reach] ** 2 + left[reach + count :] ** 2) / stiffness
    spread = swing * np.sqrt(2 * outside.sum(axis=0))
    drawn = max(0, shown + 1 - count)
    direct = np.sqrt(2 * (squares[count:] ** 2 * outside)[:drawn].sum(axis=0))
    # each entry of the product sums at most 4 J terms, at least one rounding each
    terms = 4 * (reach - count) + 8
    scaled = (1 + squares[:count] + np.abs(imaginary[:count])) ** 2 * lines
    rounding = terms * total_size * (_mean_square(lines) + 1) + 8 * _mean_square(scaled)
    error = direct + sets.gain * (inside + spread + UNIT_ROUNDOFF * rounding)
    with np.errstate(all="ignore"):
        bound = np.where(error < size, error / (size - error), np.inf)
    return np.where((error == 0) | (sets.scale == 0), 0.0, bound)


def _mean_square(squares: Real) -> Real:
    """Rms over the period from squared moduli of harmonics 0.. on the first axis."""
    return np.asarray(np.sqrt(2 * squares.sum(axis=0) - squares[0]))
