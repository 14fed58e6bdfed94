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
    From the Floquet form of the equation, see `floquet`.

Sizes are those of exact arithmetic; rounding enters through the residual, see `mesh_equations`.
Numbers of the sets have the shape (B,); all of them share phi but for a factor `scale`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import floquet, period_trace
from gearmon.dynamics.fourier import (
    Complex,
    Real,
    fast_length,
    middle_and_swing,
    rms,
    rms_of_each,
    samples,
    supremum,
    with_zero_mean,
)

#: A gain this many times the response of the mean spring is worth improving.
LOOSE = 1e3


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
    def highest(self) -> float:
        """Bound of max|phi|, of all meshes."""
        return supremum(with_zero_mean(self.harmonics)) if self.harmonics.size else 0.0

    @cached_property
    def size(self) -> Real:
        """Rms of phi, shape (1,) or (meshes, 1)."""
        return rms_of_each(with_zero_mean(self.harmonics))[..., None]

    @cached_property
    def middle_and_swing(self) -> tuple[float, float]:
        """A number b midway between the extremes of phi, and a bound of max|phi - b|."""
        return middle_and_swing(self.harmonics) if len(self.harmonics) else (0.0, 0.0)

    @cached_property
    def _slopes(self) -> Complex:
        return with_zero_mean(1j * np.arange(1, len(self.harmonics) + 1) * self.harmonics)

    @cached_property
    def slope(self) -> float:
        """Bound of max |dphi/dx|."""
        return supremum(self._slopes) if len(self.harmonics) else 0.0

    @cached_property
    def variation(self) -> float:
        """Bound of the total variation of phi in a period."""
        count = len(self.harmonics)
        if not count:
            return 0.0
        curvature = supremum(1j * np.arange(count + 1) * self._slopes)
        length = fast_length(max(512, 32 * count))
        grid = samples(with_zero_mean(self.harmonics), length)
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
    growth = np.where(damped, np.nan, np.inf)
    gain, response = small_gain(ratio, zeta, scale, pattern)
    # a few are worth a sharp bound wherever the cheapest fails: it spares orders and harmonics
    few = len(ratio) < floquet.FEWEST_TOGETHER
    allowed = np.where(np.isfinite(gain), gain, 0.0) if few else LOOSE * response
    loose = np.flatnonzero(damped & (gain > allowed))
    if len(loose):
        energy = energy_gain(ratio[loose], zeta[loose], scale[loose], pattern)
        gain[loose] = np.minimum(gain[loose], energy)
        loose = loose[gain[loose] > allowed[loose]]
    if len(loose):
        better, growth[loose] = floquet.gain(ratio[loose], zeta[loose], scale[loose], pattern)
        gain[loose] = np.minimum(gain[loose], better)
    gain = np.where(damped & np.isnan(growth), gain, np.inf)
    left = np.flatnonzero(np.isinf(gain) & np.isnan(growth))
    if len(left):
        value, log = period_trace.of_fourier(
            ratio[left], scale[left], zeta[left], pattern.harmonics, 1e-9
        )
        excess = period_trace.growth(value, log) - 2 * math.pi * ratio[left] * zeta[left]
        growth[left] = np.where(excess < 0, np.nan, excess)
    return Gain(acceleration=gain, stable=np.isnan(growth), growth=growth)


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
    bend = 1 - 2 * zeta**2
    softest, response = np.zeros_like(ratio), np.ones_like(ratio)
    # |D|^2 and |D|^2/x^4 are parabolas in x^2 and 1/x^2: least at a neighbour of their vertex
    with np.errstate(divide="ignore"):
        for side in (np.floor, np.ceil):
            x = side(ratio * np.sqrt(np.maximum(bend, 0.0))) / ratio
            softest = np.maximum(softest, 1 / _stiffness(x, zeta))
            x = side(ratio / np.sqrt(np.where(bend > 0, bend, 1.0))) / ratio
            response = np.maximum(response, np.where(bend > 0, x**2 / _stiffness(x, zeta), 1.0))
        # over the lines, and over all frequencies
        loop, around = (np.where(swing > 0, swing * most, 0.0) for most in (softest, peak(zeta)))
    proven = (middle > -1) & (loop < 1) & (around < 1)
    gain = np.where(proven, response / np.where(proven, 1 - loop, 1.0), np.inf)
    return gain, response


def peak(zeta: Real | float) -> Real:
    """Largest 1/|D|, and largest x^2/|D|, over all real frequencies.

    Parameters
    ----------
    zeta : float or float ndarray
        Damping ratio >= 0; without damping the peak is infinite.
    """
    inner = np.minimum(zeta, math.sqrt(0.5))
    with np.errstate(divide="ignore"):
        return np.asarray(1 / (2 * inner * np.sqrt(1 - inner * inner)))


def _stiffness(x: Real, zeta: Real) -> Real:
    square = x * x
    return np.asarray(np.sqrt((1 - square) ** 2 + 4 * zeta * zeta * square))


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
