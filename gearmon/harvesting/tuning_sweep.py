"""One kind of harvester tuned for many spectra that share their lines, such as a design sweep.

The answers of all candidate tunings to all lines are worked out once; the power of every candidate
for every spectrum is then one product of matrices. The best places are looked at again more finely.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.refinement import stiffening

Real = npt.NDArray[np.float64]

#: Natural frequencies tried about each line at first, in mechanical damping ratios from it.
DETUNINGS = np.array([-2.4, -0.8, 0.0, 0.8, 2.4])
#: Step between a line and what an open circuit reaches, in mechanical damping ratios.
DENSEST = 0.8
#: Ratio of neighbouring loads at first.
LOAD_STEP = 2.0
#: Then about the best of these: natural frequencies in damping ratios, and factors of the load.
NEARBY = np.linspace(-1.2, 1.2, 17)
NEAR_LOADS = np.geomspace(1 / LOAD_STEP, LOAD_STEP, 11)
#: Places further apart than this, in damping ratios, are looked at each.
APART = 2.0
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
        Within 0.5 % of the best power: of candidates about every line the two best places of each
        spectrum are looked at in steps of an eighth of a damping ratio and 15 % of the load.

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
    spectra = power.reshape(-1, len(frequency))
    rough = _candidates(harvester, frequency, _tunings(harvester, frequency))
    rows = max(1, int(BYTES_AT_ONCE / 8 / len(rough.load)))
    parts = [
        _best(harvester, frequency, spectra[begin : begin + rows], rough)
        for begin in range(0, len(spectra), rows)
    ]
    natural, load, best = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    shape = power.shape[:-1]
    return SweepTuning(
        natural_frequency_hz=natural.reshape(shape),
        load=load.reshape(shape),
        power_w=best.reshape(shape),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Candidates:
    """Natural frequency, load, and power by line per mean square, shape (c, n)."""

    natural_hz: Real
    load: Real
    gains: Real


def _best(
    harvester: Harvester, frequency: Real, spectra: Real, rough: _Candidates
) -> tuple[Real, Real, Real]:
    """Natural frequency, load and power of the best of each spectrum."""
    found = spectra @ rough.gains.T
    rows = np.arange(len(spectra))
    first = found.argmax(axis=-1)
    best = found[rows, first]
    natural, load = rough.natural_hz[first].copy(), rough.load[first].copy()
    distance = np.abs(np.log(rough.natural_hz[:, None] / rough.natural_hz[np.unique(first)]))
    elsewhere = distance > APART * harvester.damping_ratio
    apart = elsewhere.T[np.searchsorted(np.unique(first), first)]
    second = np.where(apart, found, -1.0).argmax(axis=-1)
    for winners in (first, second):
        for winner in np.unique(winners):
            own = np.flatnonzero(winners == winner)
            near = _nearby(harvester, frequency, rough, int(winner))
            power = spectra[own] @ near.gains.T
            top = power.argmax(axis=-1)
            value = power[np.arange(len(own)), top]
            better = value > best[own]
            best[own[better]] = value[better]
            natural[own[better]] = near.natural_hz[top[better]]
            load[own[better]] = near.load[top[better]]
    return natural, load, best


def _tunings(harvester: Harvester, frequency: Real) -> Real:
    low, high = harvester.frequency_range_hz
    damping = harvester.damping_ratio
    # with its load open a beam is stiffer: it may be tuned that much below a line as well
    below = -stiffening(harvester, math.sqrt(low * high))
    between = np.arange(below - 3 * damping, 0.0, DENSEST * damping) if below else np.empty(0)
    shifts = 1 + np.concatenate([damping * DETUNINGS, between])
    wanted = np.unique((frequency[:, None] * shifts).ravel())
    wanted = wanted[(wanted >= low) & (wanted <= high)]
    if not len(wanted):
        raise ArgumentError(
            f"no line lies between {low:g} and {high:g} Hz, which this harvester can be tuned to"
        )
    return wanted


def _candidates(harvester: Harvester, frequency: Real, tunings: Real) -> _Candidates:
    """Every tuning with loads over the whole range."""
    natural, loads, gains = [], [], []
    for wanted in tunings:
        tuned = harvester.retuned(float(wanted))
        least, most = tuned.load_range
        count = int(math.log(most / least) / math.log(LOAD_STEP)) + 2
        tried = np.geomspace(least, most, count)
        natural.append(np.full(count, wanted))
        loads.append(tried)
        gains.append(2 * tuned.power_by_load(tried, frequency))
    return _Candidates(
        natural_hz=np.concatenate(natural), load=np.concatenate(loads), gains=np.concatenate(gains)
    )


def _nearby(harvester: Harvester, frequency: Real, rough: _Candidates, number: int) -> _Candidates:
    """Candidates in small steps about one of the rough ones."""
    low, high = harvester.frequency_range_hz
    wanted = rough.natural_hz[number] * (1 + harvester.damping_ratio * NEARBY)
    natural, loads, gains = [], [], []
    for tuning in np.unique(np.clip(wanted, low, high)):
        tuned = harvester.retuned(float(tuning))
        tried = np.clip(rough.load[number] * NEAR_LOADS, *tuned.load_range)
        natural.append(np.full(len(tried), tuning))
        loads.append(tried)
        gains.append(2 * tuned.power_by_load(tried, frequency))
    return _Candidates(
        natural_hz=np.concatenate(natural), load=np.concatenate(loads), gains=np.concatenate(gains)
    )
