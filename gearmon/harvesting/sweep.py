"""One kind of harvester tuned for many spectra that share their lines, such as a design sweep.

The answers of all candidate tunings to all lines are worked out once; the power of every candidate
for every spectrum is then one product of matrices. The best places are looked at again more finely.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.sweep import sweep
from gearmon.errors import ArgumentError, check_positive
from gearmon.harvesting.harvester import Harvester
from gearmon.harvesting.tuning import stiffening

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


def _candidates(
    harvester: Harvester,
    frequency: Real,
    tunings: Real,
    loads_of: Callable[[Harvester], Real] | None = None,
) -> _Candidates:
    """Every tuning with loads over the whole range, or as wanted."""
    natural, loads, gains = [], [], []
    for wanted in tunings:
        tuned = harvester.retuned(float(wanted))
        least, most = tuned.load_range
        count = int(math.log(most / least) / math.log(LOAD_STEP)) + 2
        tried = loads_of(tuned) if loads_of else np.geomspace(least, most, count)
        natural.append(np.full(len(tried), wanted))
        loads.append(tried)
        gains.append(2 * tuned.power_by_load(tried, frequency))
    return _Candidates(
        natural_hz=np.concatenate(natural), load=np.concatenate(loads), gains=np.concatenate(gains)
    )


def _nearby(harvester: Harvester, frequency: Real, rough: _Candidates, number: int) -> _Candidates:
    """Candidates in small steps about one of the rough ones."""
    wanted = rough.natural_hz[number] * (1 + harvester.damping_ratio * NEARBY)
    tunings = np.unique(np.clip(wanted, *harvester.frequency_range_hz))
    return _candidates(
        harvester,
        frequency,
        tunings,
        lambda tuned: np.clip(rough.load[number] * NEAR_LOADS, *tuned.load_range),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignSweep:
    """Energy lines of many designs, and the best tuning for each.

    Attributes
    ----------
    mass_kg, damping_ns_per_m, stiffness_n_per_m : ndarray, shape (...)
        Of each design.
    frequency_hz : ndarray, shape (n,)
        Mesh harmonics.
    energy_j_per_kg : ndarray, shape (..., n)
        E_i = (2 pi f_i A_i)^2/2.
    tuning : SweepTuning
        Best natural frequency, load and power of each design.
    """

    mass_kg: Real
    damping_ns_per_m: Real
    stiffness_n_per_m: Real
    frequency_hz: Real
    energy_j_per_kg: Real
    tuning: SweepTuning

    @property
    def total_j_per_kg(self) -> Real:
        """Sum of the lines of each design [J/kg], shape (...)."""
        return np.asarray(self.energy_j_per_kg.sum(axis=-1))

    def operating_lines(self, count: int = 3) -> tuple[Real, Real]:
        """Most energetic lines of each design, the best first.

        Parameters
        ----------
        count : int, 1 to n

        Returns
        -------
        frequency_hz, share : ndarray, shape (..., count)
            Frequency [Hz] and share of the energy of all lines.

        Raises
        ------
        ArgumentError
            If there are not so many lines.
        """
        if not 1 <= count <= len(self.frequency_hz):
            raise ArgumentError(f"count={count} must lie in [1, {len(self.frequency_hz)}]")
        largest = np.argsort(-self.energy_j_per_kg, axis=-1, kind="stable")[..., :count]
        energy = np.take_along_axis(self.energy_j_per_kg, largest, axis=-1)
        return self.frequency_hz[largest], energy / self.total_j_per_kg[..., None]


def sweep_designs(
    harvester: Harvester,
    *,
    mass_kg: npt.ArrayLike,
    damping_ns_per_m: npt.ArrayLike,
    stiffness_n_per_m: npt.ArrayLike,
    stiffness_harmonics: npt.ArrayLike,
    period_s: float,
    force_n: float,
    highest_hz: float = 12_000.0,
    gain: float = 1.0,
    tolerance: float = 1e-6,
) -> DesignSweep:
    """Solve gear pairs over a grid of values and tune a harvester for each.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
    mass_kg, damping_ns_per_m, stiffness_n_per_m : array
        As in `HillProblem`, of shapes that broadcast together to (...).
    stiffness_harmonics : complex array, shape (J,)
        c_1..c_J.
    period_s, force_n : float, > 0
        Mesh period [s] and mean force [N].
    highest_hz : float, > 0
        Mesh harmonics above it are left out.
    gain : float, > 0
        Acceleration at the harvester over that along the line of action.
    tolerance : float
        Relative error of the acceleration.

    Raises
    ------
    ArgumentError
        If a value is out of its range, a design has no steady state, or no line is within reach.
    """
    check_positive("gain", gain)
    check_positive("highest_hz", highest_hz, "Hz")
    found = sweep(
        mass_kg,
        damping_ns_per_m,
        stiffness_n_per_m,
        stiffness_harmonics,
        period_s,
        force_n,
        tolerance=tolerance,
    )
    if not np.isfinite(found.displacement[..., 0]).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(found.displacement[..., 0]))[0])
        raise ArgumentError(
            f"design {first} (mass {found.mass_kg[first]:g} kg, damping "
            f"{found.damping_ns_per_m[first]:g} N s/m, stiffness "
            f"{found.stiffness_n_per_m[first]:g} N/m): {found.reason[first]}"
        )
    count = min(found.displacement.shape[-1] - 1, math.floor(highest_hz * period_s))
    if count < 2:
        raise ArgumentError(
            f"highest_hz={highest_hz:g} Hz must hold two mesh harmonics, {2 / period_s:.6g} Hz"
        )
    frequency = np.arange(1, count + 1) / period_s
    power = 2 * np.abs(gain * found.acceleration[..., 1 : count + 1]) ** 2
    return DesignSweep(
        mass_kg=found.mass_kg,
        damping_ns_per_m=found.damping_ns_per_m,
        stiffness_n_per_m=found.stiffness_n_per_m,
        frequency_hz=frequency,
        energy_j_per_kg=power / (2 * math.pi * frequency) ** 2,
        tuning=tune_sweep(harvester, frequency, power),
    )
