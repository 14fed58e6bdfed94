"""What shakes the harvester: the mean square of acceleration by frequency, from lines or samples.

A line of acceleration amplitude A has the mean square A^2/2; a bin of a measured density S has
S df. Its energy is E_i = (2 pi f_i A_i)^2/2 with the displacement amplitude A_i [J/kg], which is
half of its squared velocity amplitude.

A measured vibration keeps its samples: they say what a harvester makes of it (`response`), while
the mean squares serve to search for a tuning and to name the lines.

A duty cycle is several vibrations with their shares of the time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from gearmon.errors import ArgumentError, check_positive, check_type
from gearmon.harvesting.harvester import Real
from gearmon.machine.fields import Checked, check_fields, within
from gearmon.signatures.signature import Signature

#: Standard deviations of speed to either side that wander is followed over.
WANDER_REACH = 4.0
#: Steps of the integral over the memory of a wandering line, and the shortest memory told apart.
LAG_STEP, SHORTEST_MEMORY = 0.2, 0.02
#: What is lower than this in a recording is drift of the sensor [Hz].
DRIFT_HZ = 2.0
#: Sine tapers of a spectrum: nearly even weight over the recording, little leakage (Riedel and
#: Sidorenko, IEEE Trans. Signal Process. 43 (1995) 188-195).
TAPERS = 4
#: Relative width of the bins that are kept: a fifth of the damping ratio of a very sharp harvester.
BIN = 2e-4
#: Chance that noise alone has a bin that is taken for a line.
CHANCE = 0.01
#: The noise floor is a median over so many cells of relative width `CELL`: 20 % to either side,
#: that a line which wanders by 2 % of its frequency does not become its own floor.
CELL, FLOOR_CELLS = 0.01, 41
#: A line ends where it has fallen to twice the floor; two are told apart by a dip to a quarter.
RAISED, DIP = 2.0, 4.0


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
        Standard deviation of the speed over its mean, by which all lines move together. Bins of a
        recording hold theirs already.
    wander_time_s : float, > 0
        Correlation time of that; infinite if it is slow beside the ring-down of a harvester.
    name : str
        Place or origin.
    samples_ms2 : ndarray, shape (m,)
        Of a recording, what was measured; empty otherwise.
    sampling_rate_hz : float
        Of these; 0 without.
    crest : float, > 0
        Ratio of peak to rms of the answer of a harvester; 4.5 is exceeded 7e-6 of the time by
        Gaussian motion.

    Raises
    ------
    ArgumentError
        If shapes differ, values are out of range, or nothing vibrates.
    """

    frequency_hz: Real
    mean_square_m2s4: Real
    resolution_hz: float = 0.0
    wander: float = within(0, 0.2, default=0.0)
    wander_time_s: float = within(0, math.inf, "s", default=math.inf, open_low=True)
    name: str = ""
    samples_ms2: Real = field(default_factory=lambda: np.empty(0))
    sampling_rate_hz: float = 0.0
    crest: float = 4.5

    def __post_init__(self) -> None:
        check_fields(self)
        names, name = ("frequency_hz", "mean_square_m2s4"), self.name or "vibration"
        frequency, power = (np.array(getattr(self, own), dtype=np.float64) for own in names)
        if frequency.ndim != 1 or frequency.shape != power.shape:
            raise ArgumentError(f"{name}: frequencies and mean squares must be rows of one length")
        known = np.isfinite([frequency, power]).all()
        rising = frequency.all() and (np.diff(frequency, prepend=0.0) >= 0).all()
        wrong = {
            "frequencies and mean squares must be finite": not known,
            "frequencies must be above 0 and rising": not rising,
            "a mean square is negative": (power < 0).any(),
            "no line at all; nothing to harvest": not power.any(),
        }
        for why, found in wrong.items():
            if found:
                raise ArgumentError(f"{name}: {why}")
        for own, values in zip(names, (frequency, power), strict=True):
            values.flags.writeable = False
            object.__setattr__(self, own, values)

    @property
    def amplitude_ms2(self) -> Real:
        """Acceleration amplitude of each line [m/s2]."""
        return np.asarray(np.sqrt(2 * self.mean_square_m2s4))

    @property
    def energy_j_per_kg(self) -> Real:
        """E_i = (2 pi f_i A_i)^2/2 of each line [J/kg], A_i its displacement amplitude."""
        return np.asarray(self.mean_square_m2s4 / (2 * math.pi * self.frequency_hz) ** 2)

    @lru_cache(maxsize=256)  # noqa: B019 - a search asks for them thousands of times
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
        weights : ndarray, shape (k, n) or (k, 1)
            Summing to 1.
        """
        if self.wander == 0:
            return self.frequency_hz[None, :], np.ones((1, 1))
        reach = WANDER_REACH * self.wander
        step = min(damping_ratio / 2, self.wander / 1.5)
        count = 2 * math.ceil(reach / step) + 1
        shift = np.linspace(-reach, reach, count)
        if math.isinf(self.wander_time_s):
            weights = np.exp(-0.5 * (shift / self.wander) ** 2)[:, None]
        else:
            weights = self._remembered(shift)
        return (1 + shift)[:, None] * self.frequency_hz, weights / weights.sum(axis=0)

    def _remembered(self, shift: Real) -> Real:
        """Share of each line's power about each shift, where the wander is forgotten in time.

        With s = (2 pi f wander) wander_time and the lag in units of 1/(2 pi f wander), the
        autocorrelation of a line is exp(-s t + s^2 (1 - exp(-t/s))): a Gaussian for large s, a
        narrow Lorentzian for small (R. Kubo, 1954). Its distribution function follows from it by
        the inversion of Gil-Pelaez.
        """
        memory = 2 * math.pi * self.frequency_hz * self.wander * self.wander_time_s
        memory = np.maximum(memory, SHORTEST_MEMORY)
        lag = np.arange(LAG_STEP / 2, 8 + 20 / memory.min(), LAG_STEP)[:, None]
        kept = np.exp(-memory * lag - memory**2 * np.expm1(-lag / memory))
        step = shift[1] - shift[0]
        edges = np.append(shift - step / 2, shift[-1] + step / 2) / self.wander
        below = 0.5 + LAG_STEP / math.pi * (np.sin(edges[:, None] * lag[:, 0]) / lag[:, 0]) @ kept
        return np.maximum(np.diff(below, axis=0), 0.0)

    def only(self, kept: npt.NDArray[np.bool_]) -> Vibration:
        """Return these lines or bins, without samples."""
        frequency, power = self.frequency_hz[kept], self.mean_square_m2s4[kept]
        heard = replace(self, frequency_hz=frequency, mean_square_m2s4=power)
        return replace(heard, samples_ms2=np.empty(0))

    def merged(self, width: float) -> Vibration:
        """Return it with bins within a relative width of each other as one; lines stay apart."""
        if self.resolution_hz == 0:
            return self
        group = np.floor(np.log(self.frequency_hz) / width).astype(np.int64)
        starts = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
        power = np.add.reduceat(self.mean_square_m2s4, starts)
        moment = np.add.reduceat(self.mean_square_m2s4 * self.frequency_hz, starts)
        loud = power > 0
        return replace(self, frequency_hz=moment[loud] / power[loud], mean_square_m2s4=power[loud])


def vibration_of_lines(
    frequency_hz: npt.ArrayLike,
    *,
    acceleration_ms2: npt.ArrayLike | None = None,
    displacement_m: npt.ArrayLike | None = None,
    gain: float = 1.0,
    **about: Any,
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
    **about : float or str
        wander (relative), wander_time_s and name, see `Vibration`.

    Returns
    -------
    Vibration

    Raises
    ------
    ArgumentError
        If not exactly one amplitude is given, or a value is out of its range.
    """
    check_positive("gain", gain)
    if (acceleration_ms2 is None) == (displacement_m is None):
        raise ArgumentError("lines: give acceleration_ms2 or displacement_m, one of the two")
    given = displacement_m if acceleration_ms2 is None else acceleration_ms2
    frequency, amplitude = (np.atleast_1d(np.array(x, float)) for x in (frequency_hz, given))
    if amplitude.shape != frequency.shape:
        raise ArgumentError(f"lines: {amplitude.size} amplitudes for {frequency.size} frequencies")
    if (frequency < 0).any():
        raise ArgumentError(f"lines: frequency {frequency.min():g} Hz must be >= 0")
    if acceleration_ms2 is None:
        amplitude = amplitude * (2 * math.pi * frequency) ** 2
    order = np.argsort(frequency, kind="stable")
    order = order[frequency[order] != 0]
    power = (gain * amplitude[order]) ** 2 / 2
    return Vibration(frequency_hz=frequency[order], mean_square_m2s4=power, **about)


def vibration_of_signature(signature: Signature, **about: Any) -> Vibration:
    """Vibration of the lines of a signature, expected or measured.

    Parameters
    ----------
    signature : Signature
    **about : float or str
        name (that of the machine if none is given), gain (a ratio), wander and wander_time_s, see
        `vibration_of_lines`.

    Returns
    -------
    Vibration
    """
    frequency, amplitude = signature["frequency_hz"], signature["acceleration_ms2"]
    about = {"name": signature.machine} | about
    return vibration_of_lines(frequency, acceleration_ms2=amplitude, **about)


def vibration_of_samples(
    acceleration_ms2: npt.ArrayLike, sampling_rate_hz: float, name: str = ""
) -> Vibration:
    """Vibration of a measured stretch: its samples and their spectrum (Parseval holds).

    Parameters
    ----------
    acceleration_ms2 : array, shape (n,), n >= 16
        Samples [m/s2]; the mean is taken off, and what lies below 2 Hz left out.
    sampling_rate_hz : float, > 0
    name : str

    Returns
    -------
    Vibration

    Raises
    ------
    ArgumentError
        If there are too few samples or the rate is not > 0.
    """
    rate = check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    samples = np.asarray(acceleration_ms2, dtype=np.float64)
    if samples.ndim != 1 or len(samples) < 16:
        raise ArgumentError(f"samples: shape {samples.shape}, one row of at least 16 is needed")
    samples = samples - samples.mean()
    count = len(samples)
    length = scipy.fft.next_fast_len(count, real=True)
    power = np.zeros(length // 2 + 1)
    turn = math.pi * np.arange(1, count + 1) / (count + 1)
    for order in range(1, TAPERS + 1):
        tapered = math.sqrt(2 / (count + 1)) * np.sin(order * turn) * samples
        power += np.abs(scipy.fft.rfft(tapered, length)) ** 2 * (2 / length / TAPERS)
    power[-1] /= 1 + (length % 2 == 0)  # the bin at half the rate stands for itself
    step = rate / length
    first = max(1, math.ceil(DRIFT_HZ / step))
    if not power[first:].any():
        raise ArgumentError(f"{name or 'samples'}: nothing vibrates above {DRIFT_HZ:g} Hz")
    whole = Vibration(
        frequency_hz=step * np.arange(first, len(power)),
        mean_square_m2s4=power[first:],
        resolution_hz=(TAPERS + 1) / 2 * rate / count,
        name=name,
    ).merged(BIN)
    return replace(whole, samples_ms2=samples, sampling_rate_hz=rate)


def line_numbers(vibration: Vibration) -> npt.NDArray[np.int64]:
    """Tell which line each bin belongs to: 1 and on; 0 for what does not stand out of the noise.

    A bin of noise under k tapers has 2k degrees of freedom, which says how far it must stand above
    the median around it that noise alone has none in 99 of 100 spectra.

    Parameters
    ----------
    vibration : Vibration
        Of bins; of lines each is its own, but for those of no power.
    """
    power = vibration.mean_square_m2s4
    if vibration.resolution_hz == 0:
        return np.where(power > 0, np.cumsum(power > 0), 0)
    place = np.log(vibration.frequency_hz) / CELL
    cells, starts = np.unique(np.floor(place), return_index=True)
    medians = np.array([np.median(part) for part in np.split(power, starts[1:])])
    medians = scipy.ndimage.median_filter(medians, FLOOR_CELLS, mode="nearest")
    floor = np.interp(place, cells + 0.5, medians)
    above = power / np.maximum(floor, np.finfo(float).tiny)
    freedom, chi2 = 2 * TAPERS, scipy.stats.chi2
    needed = float(chi2.isf(CHANCE / len(power), freedom) / chi2.median(freedom))
    smooth = np.log(scipy.ndimage.uniform_filter1d(above, 5))
    peaks, _ = scipy.signal.find_peaks(smooth, prominence=math.log(DIP))
    found = np.zeros(len(power), dtype=np.int64)
    dips = [a + int(np.argmin(smooth[a:b])) for a, b in pairwise(peaks)]
    for line, (low, high) in enumerate(pairwise([0, *dips, len(power)]), 1):
        if len(peaks) and above[low:high].max() > needed:
            found[low:high][above[low:high] > RAISED] = line
    return found


def operating_lines(vibration: Vibration, most: int = 8) -> list[dict[str, Any]]:
    """Lines by energy, the best one first.

    Parameters
    ----------
    vibration : Vibration
        Of lines, or of bins: then of those that stand out of the noise, a line and all that its
        wander fills as one.
    most : int, >= 1

    Returns
    -------
    list of dict
        frequency_hz, acceleration_ms2, energy_j_per_kg, share (of the energy of all such lines),
        relative (to the best) and wander (standard deviation of its frequency over that; 0.2 at
        most). Empty if no line is clear.
    """
    numbers, heard = line_numbers(vibration), vibration.mean_square_m2s4
    lines = np.unique(numbers[numbers > 0])

    def summed(column: Real) -> Real:
        return np.asarray(np.bincount(numbers, column)[lines])

    # by squares, for sidebands and noise beside a line to count little: of a Gaussian their spread
    # is smaller by the root of 2
    weight, power, energy = (summed(x) for x in (heard**2, heard, vibration.energy_j_per_kg))
    middle = summed(heard**2 * vibration.frequency_hz) / weight
    away = vibration.frequency_hz - np.append(middle, 0.0)[np.searchsorted(lines, numbers)]
    # less what the tapers spread a line that does not wander
    spread = summed((heard * away) ** 2) / weight - vibration.resolution_hz**2 / 3
    measured = np.minimum(0.2, np.sqrt(2 * np.maximum(spread, 0.0)) / middle)
    columns = {
        "frequency_hz": middle,
        "wander": measured if vibration.resolution_hz else np.full(len(lines), vibration.wander),
        "acceleration_ms2": np.sqrt(2 * power),
        "energy_j_per_kg": energy,
        "share": energy / energy.sum(),
        "relative": energy / energy.max(initial=0.0),
    }
    order = np.argsort(-energy, kind="stable")[:most]
    return [{name: float(column[i]) for name, column in columns.items()} for i in order]


@dataclass(frozen=True, kw_only=True)
class OperatingShare(Checked):
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
    share: float = within(0, 1, open_low=True, default=1.0)


Points = tuple[OperatingShare, ...]
#: What may shake a harvester: one vibration, the lines of a signature, or several with their share.
Shaking = Vibration | Signature | OperatingShare | Sequence[OperatingShare]


def check_duty(duty: Shaking) -> Points:
    """Return what shakes a harvester as a duty cycle; one vibration alone lasts all the time.

    Raises
    ------
    ArgumentError
        If it is empty, its shares sum to more than 1, or something else stands in it.
    """
    duty = vibration_of_signature(duty) if isinstance(duty, Signature) else duty
    duty = OperatingShare(vibration=duty) if isinstance(duty, Vibration) else duty
    points = (duty,) if isinstance(duty, OperatingShare) else duty
    check_type("duty cycle", points, Iterable, "a Vibration, a Signature or OperatingShares")
    if not (points := tuple(points)):
        raise ArgumentError("duty cycle: no operating point is given")
    for point in points:
        check_type("duty cycle", point, OperatingShare, "OperatingShares, each with its share")
    if (total := math.fsum(point.share for point in points)) > 1 + 1e-6:
        raise ArgumentError(f"duty cycle: the shares sum to {total:.6g}, at most 1 is possible")
    return points
