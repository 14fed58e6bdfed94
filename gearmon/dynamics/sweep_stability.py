"""Which of many sets have a steady state, and how large a residual they can bear.

The cheapest bound of the inverse operator that is not loose is kept for each set; what none of the
bounds for many sets settles is settled by `error_bound.best_gain` alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import error_bound, floquet
from gearmon.dynamics.fourier import Real
from gearmon.dynamics.sweep_bounds import Swing, energy_gain, small_gain
from gearmon.dynamics.sweep_floquet import floquet_gain

# a gain this many times the response of the mean spring is worth improving
LOOSE = 1e3


@dataclass(frozen=True, kw_only=True)
class Settled:
    """Gains of many sets; all arrays have the shape (B,).

    Attributes
    ----------
    gain : float ndarray
        As in `error_bound.Gain`; infinite where there is none.
    stable : bool ndarray
        Whether free vibrations die out for certain.
    growth : float ndarray
        ln of the larger multiplier's modulus where free vibrations grow, infinite where they
        neither grow nor die out, nan elsewhere.
    """

    gain: Real
    stable: npt.NDArray[np.bool_]
    growth: Real


def settle(ratio: Real, zeta: Real, scale: Real, swing: Swing) -> Settled:
    """Gain and stability of every set.

    Parameters
    ----------
    ratio, zeta, scale : float ndarray, shape (B,)
        R, damping ratio >= 0, factor of phi.
    swing : Swing
        Of the phi that all share.
    """
    damped = zeta > 0
    gain, growth = np.full(len(ratio), np.inf), np.where(damped, np.nan, np.inf)
    at = np.flatnonzero(damped)
    values = ratio[at], zeta[at], scale[at]
    highest, variation = (scale * size for size in (swing.highest, swing.variation))
    neumann, response = small_gain(values[0], values[1], highest[at])
    gain[at] = np.minimum(neumann, energy_gain(values[0], values[1], highest[at], variation[at]))
    loose = at[gain[at] > LOOSE * response]
    if len(loose):
        better, growth[loose] = floquet_gain(ratio[loose], zeta[loose], scale[loose], swing)
        gain[loose] = np.minimum(gain[loose], better)
    stable = np.isfinite(gain)
    for i in np.flatnonzero(~stable & np.isnan(growth)):
        harmonics = scale[i] * swing.harmonics
        alone = error_bound.best_gain(float(ratio[i]), float(zeta[i]), harmonics)
        gain[i], stable[i] = alone.acceleration, bool(alone.stable)
        if alone.stable is False:
            growth[i] = _growth(float(ratio[i]), float(zeta[i]), harmonics)
    return Settled(gain=gain, stable=stable, growth=growth)


def _growth(ratio: float, zeta: float, harmonics: npt.NDArray[np.complex128]) -> float:
    return float(np.log(abs(floquet.multipliers(ratio, zeta, harmonics)[0])))
