"""What shakes the harvester: the mean square of acceleration by frequency, from lines or samples.

A line of acceleration amplitude A has the mean square A^2/2; a bin of a measured density S has
S df. Its energy is E_i = (2 pi f_i A_i)^2/2 with the displacement amplitude A_i [J/kg], which is
half of its squared velocity amplitude.

A duty cycle is several vibrations with their shares of the time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_finite, check_positive, check_range
from gearmon.signatures.signature import Signature

Real = npt.NDArray[np.float64]

#: Standard deviations of speed to either side that wander is followed over.
WANDER_REACH = 4.0
#: Chance that noise alone has a bin that is taken for a line.
CHANCE = 0.01
#: Bins over which the noise floor is taken.
FLOOR_BINS = 401


@dataclass(frozen=True, kw_only=True, eq=False)
class Vibration:
    """Acceleration at one place and one operating point.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,), > 0, rising
    mean_square_m2s4 : ndarray, shape (n,), >= 0
        Mean square of the acceleration of each line or bin [(m/s2)^2].
    resolution_hz : float, >= 0
        Width of a bin; 0 for lines.
    wander : float, 0 to 0.2
        Standard deviation of the speed over its mean, by which all lines move together, slowly
        beside the ring-down of a harvester. Bins of a recording hold theirs already.
    name : str
        Place or origin.

    Raises
    ------
    ArgumentError
        If shapes differ, values are out of range, or nothing vibrates.
    """

    frequency_hz: Real
    mean_square_m2s4: Real
    resolution_hz: float = 0.0
    wander: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        frequency = np.array(self.frequency_hz, dtype=np.float64)
        power = np.array(self.mean_square_m2s4, dtype=np.float64)
        if frequency.ndim != 1 or frequency.shape != power.shape:
            raise ArgumentError(
                f"vibration: {frequency.shape} frequencies for {power.shape} mean squares; "
                "both must be rows of one length"
            )
        if not (np.isfinite(frequency).all() and np.isfinite(power).all()):
            raise ArgumentError("vibration: frequencies and mean squares must be finite numbers")
        if (frequency <= 0).any() or (np.diff(frequency) < 0).any():
            raise ArgumentError("vibration: frequencies must be above 0 and rising")
        if (power < 0).any():
            raise ArgumentError("vibration: a mean square is negative")
        if not power.any():
            raise ArgumentError(f"{self.name or 'vibration'}: no line at all; nothing to harvest")
        check_range("resolution_hz", self.resolution_hz, 0.0, 1e6, "Hz")
        check_range("wander", self.wander, 0.0, 0.2)
        for name, values in (("frequency_hz", frequency), ("mean_square_m2s4", power)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def amplitude_ms2(self) -> Real:
        """Acceleration amplitude of each line [m/s2]."""
        return np.asarray(np.sqrt(2 * self.mean_square_m2s4))

    @property
    def energy_j_per_kg(self) -> Real:
        """E_i = (2 pi f_i A_i)^2/2 of each line [J/kg], A_i its displacement amplitude."""
        return np.asarray(self.mean_square_m2s4 / (2 * math.pi * self.frequency_hz) ** 2)

    def nodes(self, damping_ratio: float) -> tuple[Real, Real]:
        """Frequencies that each line visits, and how likely.

        Steps are half a damping ratio or two thirds of a standard deviation: the trapezoidal sum
        over a Gaussian times a resonance is then right to 1e-5.

        Parameters
        ----------
        damping_ratio : float, > 0
            Of the narrowest resonance in play.

        Returns
        -------
        frequency_hz : ndarray, shape (k, n)
        weights : ndarray, shape (k,)
            Summing to 1.
        """
        if self.wander == 0:
            return self.frequency_hz[None, :], np.ones(1)
        reach = WANDER_REACH * self.wander
        step = min(damping_ratio / 2, self.wander / 1.5)
        count = 2 * math.ceil(reach / step) + 1
        shift = np.linspace(-reach, reach, count)
        weights = np.exp(-0.5 * (shift / self.wander) ** 2)
        return (1 + shift)[:, None] * self.frequency_hz, weights / weights.sum()

    def cut(self, low_hz: float, high_hz: float) -> Vibration:
        """Return only what vibrates between two frequencies.

        Raises
        ------
        ArgumentError
            If nothing does.
        """
        kept = (self.frequency_hz >= low_hz) & (self.frequency_hz <= high_hz)
        kept &= self.mean_square_m2s4 > 0
        if not kept.any():
            raise ArgumentError(
                f"{self.name or 'vibration'}: nothing vibrates between {low_hz:g} and {high_hz:g} "
                f"Hz; it holds {self.frequency_hz[0]:g} to {self.frequency_hz[-1]:g} Hz"
            )
        kept_power = self.mean_square_m2s4[kept]
        return replace(self, frequency_hz=self.frequency_hz[kept], mean_square_m2s4=kept_power)


def vibration_of_lines(
    frequency_hz: npt.ArrayLike,
    *,
    acceleration_ms2: npt.ArrayLike | None = None,
    displacement_m: npt.ArrayLike | None = None,
    gain: float = 1.0,
    wander: float = 0.0,
    name: str = "",
) -> Vibration:
    """Vibration of lines given by their peak amplitudes, in any order.

    Parameters
    ----------
    frequency_hz : array, shape (n,), >= 0
        A line at 0 Hz is left out: nothing moves there.
    acceleration_ms2, displacement_m : array, shape (n,)
        Peak amplitudes, one of the two.
    gain : float, > 0
        Amplitude at the harvester over the given one: the path through shaft and housing.
    wander, name
        See `Vibration`.

    Raises
    ------
    ArgumentError
        If not exactly one amplitude is given, or a value is out of its range.
    """
    check_positive("gain", gain)
    frequency = _row(frequency_hz)
    if (acceleration_ms2 is None) == (displacement_m is None):
        raise ArgumentError("lines: give acceleration_ms2 or displacement_m, one of the two")
    if acceleration_ms2 is not None:
        amplitude = _row(acceleration_ms2)
    else:
        assert displacement_m is not None
        amplitude = _row(displacement_m) * (2 * math.pi * frequency) ** 2
    if amplitude.shape != frequency.shape:
        raise ArgumentError(f"lines: {amplitude.size} amplitudes for {frequency.size} frequencies")
    order = np.argsort(frequency, kind="stable")
    order = order[frequency[order] > 0]
    power = (gain * amplitude[order]) ** 2 / 2
    return Vibration(
        frequency_hz=frequency[order], mean_square_m2s4=power, wander=wander, name=name
    )


def _row(values: npt.ArrayLike) -> Real:
    row: Real = np.atleast_1d(np.asarray(values, dtype=np.float64))
    return row


def vibration_of_signature(
    signature: Signature, *, gain: float = 1.0, wander: float = 0.0, name: str = ""
) -> Vibration:
    """Vibration of the lines of a signature, expected or measured.

    Parameters
    ----------
    signature : Signature
    gain, wander, name
        See `vibration_of_lines`; the name is that of the machine if none is given.
    """
    return vibration_of_lines(
        signature["frequency_hz"],
        acceleration_ms2=signature["acceleration_ms2"],
        gain=gain,
        wander=wander,
        name=name or signature.machine,
    )


def vibration_of_samples(
    acceleration_ms2: npt.ArrayLike, sampling_rate_hz: float, name: str = "", low_hz: float = 2.0
) -> Vibration:
    """Vibration of a measured stretch, by its Hann-windowed periodogram (Parseval holds).

    Parameters
    ----------
    acceleration_ms2 : array, shape (n,), n >= 16
        Samples [m/s2]; the mean is taken off.
    sampling_rate_hz : float, > 0
    name : str
    low_hz : float, >= 0
        Lower bins are left out: drift of the sensor.

    Raises
    ------
    ArgumentError
        If there are too few samples or the rate is not > 0.
    """
    from scipy.signal import periodogram

    check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    check_finite("low_hz", low_hz, "Hz")
    samples = np.asarray(acceleration_ms2, dtype=np.float64)
    if samples.ndim != 1 or len(samples) < 16:
        raise ArgumentError(f"samples: shape {samples.shape}, one row of at least 16 is needed")
    frequency, density = periodogram(samples, sampling_rate_hz, "hann", detrend="constant")
    step = sampling_rate_hz / len(samples)
    first = max(1, math.ceil(low_hz / step))
    return Vibration(
        frequency_hz=frequency[first:],
        mean_square_m2s4=step * density[first:],
        resolution_hz=1.5 * step,
        name=name,
    )


def clear_lines(vibration: Vibration) -> tuple[npt.NDArray[np.intp], float]:
    """Tell which bins are lines that stand out of the noise around them.

    A bin of Gaussian noise exceeds t times its median power with the probability 2^-t, so that of
    n bins one exceeds log2(n/p) with the probability p, here 1 %.

    Parameters
    ----------
    vibration : Vibration
        Of bins; of lines all that are not 0 are clear.

    Returns
    -------
    numbers : ndarray of int
        Of the clear bins that are higher than their neighbours.
    highest : float
        Largest power over what is needed to be clear.
    """
    power = vibration.mean_square_m2s4
    if vibration.resolution_hz == 0:
        return np.flatnonzero(power), math.inf
    floor, needed = _noise(power)
    above = power / (needed * floor)
    inside = np.concatenate([[0.0], power, [0.0]])
    top = (power >= inside[:-2]) & (power > inside[2:])
    return np.flatnonzero(top & (above > 1)), float(above.max())


def _noise(power: Real) -> tuple[Real, float]:
    """Floor of the noise around each bin, and how many times that a clear line exceeds."""
    from gearmon.signals.spectra import local_floor

    return local_floor(power, min(len(power), FLOOR_BINS)), math.log2(len(power) / CHANCE)


def standing_out(vibration: Vibration) -> Vibration | None:
    """Keep only what stands out of the noise, which may be that of the sensor.

    Kept are bins that are clear lines and, down to twice the floor, the bins beside them: a line
    that wanders fills many.

    Parameters
    ----------
    vibration : Vibration

    Returns
    -------
    Vibration or None
        None if nothing stands out.
    """
    if vibration.resolution_hz == 0:
        return vibration
    power = vibration.mean_square_m2s4
    floor, needed = _noise(power)
    clear = power > needed * floor
    if not clear.any():
        return None
    # runs of raised bins that hold a clear one
    raised = power > 2 * floor
    run = np.cumsum(np.diff(raised, prepend=False) & raised)
    kept = raised & np.isin(run, run[clear])
    return replace(vibration, mean_square_m2s4=np.where(kept, power, 0.0))


def operating_lines(vibration: Vibration, most: int = 8) -> list[dict[str, Any]]:
    """Lines by energy, the best one first.

    Parameters
    ----------
    vibration : Vibration
        Of lines, or of bins: then of those that are clear of the noise, each with the bins beside
        it that belong to its window.
    most : int, >= 1

    Returns
    -------
    list of dict
        frequency_hz, acceleration_ms2, energy_j_per_kg, share (of the energy of all such lines)
        and relative (to the best). Empty if no line is clear.
    """
    clear, _ = clear_lines(vibration)
    if not len(clear):
        return []
    power = vibration.mean_square_m2s4
    if vibration.resolution_hz > 0:
        # a line under a Hann window fills three bins
        power = np.convolve(power, np.ones(3), mode="same")
    energy = np.zeros(len(power))
    energy[clear] = power[clear] / (2 * math.pi * vibration.frequency_hz[clear]) ** 2
    amplitude = np.sqrt(2 * power)
    largest = np.argsort(-energy, kind="stable")[:most]
    total, best = float(energy.sum()), float(energy.max())
    return [
        {
            "frequency_hz": float(vibration.frequency_hz[i]),
            "acceleration_ms2": float(amplitude[i]),
            "energy_j_per_kg": float(energy[i]),
            "share": float(energy[i]) / total,
            "relative": float(energy[i]) / best,
        }
        for i in largest
        if energy[i] > 0
    ]


@dataclass(frozen=True, kw_only=True)
class OperatingShare:
    """One operating point of a duty cycle.

    Parameters
    ----------
    vibration : Vibration
    share : float, > 0 and <= 1
        Of the time.

    Raises
    ------
    ArgumentError
        If the share is out of its range.
    """

    vibration: Vibration
    share: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.share <= 1:
            raise ArgumentError(f"share={self.share} must lie in (0, 1]")


#: What may shake a harvester: one vibration, the lines of a signature, or several with their share.
Shaking = Vibration | Signature | OperatingShare | Sequence[OperatingShare]


def check_duty(duty: Shaking) -> tuple[OperatingShare, ...]:
    """Return what shakes a harvester as a duty cycle; one vibration alone lasts all the time.

    Raises
    ------
    ArgumentError
        If it is empty, its shares sum to more than 1, or something else stands in it.
    """
    if isinstance(duty, Signature):
        duty = vibration_of_signature(duty)
    if isinstance(duty, Vibration):
        duty = OperatingShare(vibration=duty)
    points = (duty,) if isinstance(duty, OperatingShare) else tuple(duty)
    if not points:
        raise ArgumentError("duty cycle: no operating point is given")
    for point in points:
        if not isinstance(point, OperatingShare):
            raise ArgumentError(
                f"duty cycle: {type(point).__name__} must be an OperatingShare, which gives a "
                "vibration its share of the time"
            )
    total = math.fsum(point.share for point in points)
    if total > 1 + 1e-6:
        raise ArgumentError(f"duty cycle: the shares sum to {total:.6g}, at most 1 is possible")
    return points
