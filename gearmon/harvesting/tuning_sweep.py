"""One kind of harvester tuned for many spectra that share their lines, such as a design sweep.

The answers of all candidate tunings to all lines are worked out once; the power of every candidate
for every spectrum is then one product of matrices.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.tuning import stiffening

Real = npt.NDArray[np.float64]

#: Natural frequencies tried about each line, in mechanical damping ratios from it.
DETUNINGS = (-3.0, -2.0, -1.3, -0.8, -0.4, -0.15, 0.0, 0.15, 0.4, 0.8, 1.3, 2.0, 3.0)
#: Step between a line and what an open circuit reaches, in mechanical damping ratios.
DENSEST = 0.3
#: Ratio of neighbouring loads.
LOAD_STEP = 1.2
#: Bytes of one product.
BYTES_AT_ONCE = 2e8


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepTuning:
    """Best tuning of each spectrum.

    Attributes
    ----------
    natural_frequency_hz, load, power_w : ndarray, shape (...,)
        Natural frequency [Hz], load (see `Harvester`) and mean power [W]; travel and stress limits
        are not looked at.
    """

    natural_frequency_hz: Real
    load: Real
    power_w: Real


def tune_sweep(
    harvester: Harvester, frequency_hz: npt.ArrayLike, mean_square_m2s4: npt.ArrayLike
) -> SweepTuning:
    """Tune a harvester for many spectra of the same lines at once.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
        Only its allowed range of frequencies matters, not its tuning.
    frequency_hz : array, shape (n,), > 0
        Of the lines, the same for all spectra.
    mean_square_m2s4 : array, shape (..., n), >= 0
        Mean square of the acceleration of each line.

    Returns
    -------
    SweepTuning
        Within 0.5 % of the best power: candidates stand at steps of a fraction of a damping ratio
        about every line, loads at steps of 20 %.

    Raises
    ------
    ArgumentError
        If shapes do not fit, or no line lies within reach of the harvester.
    """
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    power = np.asarray(mean_square_m2s4, dtype=np.float64)
    if frequency.ndim != 1 or power.shape[-1:] != frequency.shape:
        raise ArgumentError(
            f"{frequency.shape} frequencies for mean squares of shape {power.shape}; the last axis "
            "must be that of the frequencies"
        )
    tunings = _tunings(harvester, frequency)
    spectra = power.reshape(-1, len(frequency))
    best = np.full(len(spectra), -1.0)
    natural, load = np.zeros(len(spectra)), np.zeros(len(spectra))
    together = max(1, int(BYTES_AT_ONCE / 8 / max(1, len(spectra))))
    for group in _groups(harvester, frequency, tunings, together):
        found = spectra @ group.gains.T
        top = found.argmax(axis=-1)
        value = found[np.arange(len(spectra)), top]
        better = value > best
        best[better] = value[better]
        natural[better] = group.natural_hz[top[better]]
        load[better] = group.load[top[better]]
    shape = power.shape[:-1]
    return SweepTuning(
        natural_frequency_hz=natural.reshape(shape),
        load=load.reshape(shape),
        power_w=best.reshape(shape),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Group:
    """Candidates: natural frequency, load, and power by line per mean square, shape (c, n)."""

    natural_hz: Real
    load: Real
    gains: Real


def _tunings(harvester: Harvester, frequency: Real) -> Real:
    low, high = harvester.frequency_range_hz
    damping = harvester.damping_ratio
    # with its load open a beam is stiffer: it may be tuned that much below a line as well
    below = -stiffening(harvester, math.sqrt(low * high))
    between = np.arange(below, 0.0, DENSEST * damping)
    shifts = 1 + np.concatenate(
        [damping * np.array(DETUNINGS), between, below - DENSEST * damping * np.arange(1, 7)]
    )
    wanted = np.unique((frequency[:, None] * shifts).ravel())
    wanted = wanted[(wanted >= low) & (wanted <= high)]
    if not len(wanted):
        raise ArgumentError(
            f"no line lies between {low:g} and {high:g} Hz, which this harvester can be tuned to"
        )
    return wanted


def _groups(
    harvester: Harvester, frequency: Real, tunings: Real, together: int
) -> Iterator[_Group]:
    """Yield candidates, as many at once as one product may hold."""
    natural: list[Real] = []
    loads: list[Real] = []
    gains: list[Real] = []
    for number, wanted in enumerate(tunings):
        tuned = harvester.retuned(float(wanted))
        least, most = tuned.load_range
        count = int(np.log(most / least) / np.log(LOAD_STEP)) + 1
        tried = np.geomspace(least, most, count)
        natural.append(np.full(count, wanted))
        loads.append(tried)
        gains.append(2 * tuned.power_by_load(tried, frequency))
        if count * len(gains) >= together or number == len(tunings) - 1:
            yield _Group(
                natural_hz=np.concatenate(natural),
                load=np.concatenate(loads),
                gains=np.concatenate(gains),
            )
            natural, loads, gains = [], [], []
