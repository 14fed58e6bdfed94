"""The law of a whole machine: all gears and levels of a reference, ready to be held against.

The operating state is what a healthy machine may change by itself: its load, heard as the level of
its mesh harmonics, and its speed.

Levels are those of families of order lines and of the broadband spectrum between them. Each is
predicted for the operating state, less what all levels of a channel have in common: the
gain of its sensor. How far healthy levels depart is prior knowledge, widened where the references
depart farther from one another's predictions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.diagnosis.law.gear_lines import GearDeviation, GearLaw, Kriging, in_units, load_unit
from gearmon.diagnosis.law.patterns import turned_alike
from gearmon.errors import ArgumentError
from gearmon.gears.mechanics import load_share
from gearmon.machine import Machine
from gearmon.signatures.measured.reference import Levels, Profile, Reference

# Decibels of a neper.
_DB = float(20.0 / np.log(10.0))
#: Standard deviation from recording to recording [Np], and its growth per unit of state, of
#: families of lines and of broadband levels: a tenth, as a housing that is 60 K warmer or colder
#: moves lines across its modes, and what a factor of e in load leaves after the common gain.
#: Healthy simulated pairs, loads from 40 to 115 %, accuracy grade 6; of 54 sound recordings of 18
#: drawn machines whose natural frequencies were 1 % lower 4 were faults and 29 open with 0.06, the
#: scatter at one temperature; none and 12 are (worn gears: 17 of 24 noticed then, 10 now).
LINES, BROADBAND = (0.1, 0.6), (0.15, 0.6)
_Prior = tuple[float, float]
# Recordings that the prior of the scale is worth, and the least scale.
_WORTH, _LEAST_SCALE = 4.0, 1.0
# Squares of standardised deviations are cut off here, lest one line decide for all.
_MOST_SQUARE = 25.0
# Levels above their noise that tell the gain of a channel, at least.
_LEAST_TOLD = 5
# Median of a squared standard normal variable.
_MEDIAN = 0.4549
# Change of a mesh harmonic [Np] from which on references tell how it follows the load where teeth
# are hardly loaded: those of one load differ by 0.05 to 0.1. Rounds in which loads and that are
# fitted in turn.
_TOLD, _ROUNDS = 0.15, 5
#: Relative change of speed that counts as one unit of state: a modal damping ratio of the path, so
#: that two per cent move lines across the modes as far as a load changed by half moves them. And
#: amplitude by which the speed may swing: it takes lines across the modes and back. Six machines of
#: a model of modulated meshes behind 12 modes, speed swinging by 5 and 10 % beside steady
#: references: 8 of 12 sound ones were called faults without it, none is.
SPEED_UNIT, FLUCTUATION_UNIT = 0.03, 0.05


class StateGauge:
    """Tells the operating state of recordings, relative to the first reference.

    Learns from the references how the mesh harmonics of this machine follow its load: in proportion
    where teeth are loaded fully. Of teeth that are loaded less one factor is fitted to the changes
    from the first reference, with a prior of equal parts: as teeth leave contact some harmonics
    fall to a third and some double while the load is halved.

    Parameters
    ----------
    profiles : sequence of Profile
        The references, in the same channels; the first is at the origin.
    share : float, > 0
        How the teeth are loaded that are loaded least (`gears.mechanics.load_share`).

    Attributes
    ----------
    direction : ndarray of float, shape (channels, families)
        How the level of each mesh harmonic changes with the load, over the root mean square of all.

    Notes
    -----
    Seven simulated machines at 17 and 42 N/mm, loads 0.5 to 1.0: the median of the harmonics was
    off the load by 0.06 to 0.30 Np, and of one machine it was the same at 0.75 and at 0.5. Learned
    from three references it is off by 0.01 to 0.04 Np, at loads between them too, and of the
    healthy pairs told of at `FULL_LOAD` 5 are called faults instead of 17. On a real rig of unknown
    torque harmonics change in all directions, and what two references at neighbouring loads would
    teach is chance.
    """

    def __init__(self, profiles: Sequence[Profile], share: float) -> None:
        self.base = base = profiles[0]
        self.direction = direction = np.ones((len(base.level_db), len(base.family_names)))
        unit = load_unit(share)
        if unit == 1.0:
            return
        changes = np.array([self._changes(profile) for profile in profiles])
        heard = ~np.isnan(changes)
        prior = _TOLD**2 / (1.0 - unit)
        for _ in range(_ROUNDS):
            load = np.array([_slope(change, direction) for change in changes])[:, None, None]
            direction = np.sum(np.where(heard, load * changes, 0.0), axis=0) + prior
            direction /= np.sum(heard * load**2, axis=0) + prior
            direction /= np.sqrt(np.mean(direction[heard[0]] ** 2)) if heard.any() else 1.0
        self.direction = direction

    def state(self, profile: Profile) -> FloatArray:
        """Place a recording in the space of operating states.

        Parameters
        ----------
        profile : Profile
            The recording, in the channels of the base.

        Returns
        -------
        ndarray of float, shape (3,)
            Load, as the level of the mesh harmonics tells it [Np]; speed, in `SPEED_UNIT`; and the
            square of how far it swung, in `FLUCTUATION_UNIT`: to either side of the mean alike, so
            that the mean over both is of second order. The gain of a sensor is taken for load:
            noise follows either.
        """
        load = _slope(self._changes(profile), self.direction)
        speed = (profile.speed_hz / self.base.speed_hz - 1.0) / SPEED_UNIT
        return np.array([load, speed, (profile.speed_fluctuation / FLUCTUATION_UNIT) ** 2])

    def _changes(self, profile: Profile) -> FloatArray:
        """Return changes of the mesh harmonics [Np]; NaN where unheard, and of other families."""
        change, known = np.full(self.direction.shape, np.nan), self.base.family_names
        names = [n for n in known if n.startswith("mesh") and n in profile.family_names]
        own, base = profile.of_families(names), self.base.of_families(names)
        moved = np.where(own.heard & base.heard, own.level_db - base.level_db, np.nan)
        change[:, [known.index(name) for name in names]] = moved
        return change / _DB


def _slope(values: FloatArray, along: FloatArray) -> float:
    """Factor of a direction that leaves the least sum of magnitudes of some values."""
    told = ~np.isnan(values) & (along != 0.0)
    ratio, weight = values[told] / along[told], np.abs(along[told])
    if not ratio.size:
        return 0.0
    # the weighted median, between those from below and from above
    median = partial(np.quantile, q=0.5, weights=weight, method="inverted_cdf")
    return float(0.5 * (median(ratio) - median(-ratio)))


class LevelDeviation(NamedTuple):
    """Deviation of levels from what the references make expect.

    Parameters
    ----------
    expected_db, rest_db, sigma_db : ndarray of float, shape (channels, levels)
        Prediction with the common gain of each channel; what is left; its standard deviation on a
        healthy machine.
    gain_db : ndarray of float, shape (channels,)
        That common gain.
    """

    expected_db: FloatArray
    rest_db: FloatArray
    sigma_db: FloatArray
    gain_db: FloatArray

    @property
    def standardised(self) -> FloatArray:
        """The rest in standard deviations, shape (channels, levels)."""
        return self.rest_db / self.sigma_db

    def mean_square(self) -> float:
        """Mean square of the standardised rest; about 1 on a healthy machine."""
        squares = np.minimum(self.standardised**2, _MOST_SQUARE)
        return float(np.nanmean(squares)) if np.isfinite(squares).any() else 0.0


def level_deviation(
    own: Levels, known: Sequence[Levels], states: FloatArray, at: FloatArray, prior: _Prior = LINES
) -> LevelDeviation:
    """Hold levels against the law.

    Parameters
    ----------
    own : Levels
        Of the recording. A level that does not stand above its noise, and yet lies above what was
        expected, tells of the noise and of nothing else: it is left out (NaN). Nor does such a
        level tell the gain, where enough others do: that of a short recording is the higher for it.
        Where few do, the lower of both is taken: noise that rises hides most lines, and the others
        have not fallen.
    known : sequence of Levels
        The same of the references.
    states : ndarray of float, shape (references, 3)
        Operating states of the references [units].
    at : ndarray of float, shape (3,)
        That of the recording.
    prior : (float, float)
        Standard deviation of healthy departures and its growth per unit of state [Np], `LINES` or
        `BROADBAND`.
    """
    seen = []
    for row, one in enumerate(known if len(known) > 1 else ()):
        others = [n for n in range(len(known)) if n != row]
        mean, spread = _predicted([known[n] for n in others], states[others], states[row], prior)
        left = one.level_db - mean
        left -= channel_gain(left)[:, None]
        square = left**2 / (spread + one.error_db**2)
        seen.append(float(channel_gain(square.reshape(1, -1))[0]) / _MEDIAN)
    # variance over its prior, as the references depart from what the others predict of them
    scale = max((_WORTH + sum(seen)) / (_WORTH + len(seen)), _LEAST_SCALE)
    mean, spread = _predicted(known, states, at, prior)
    rest = own.level_db - mean
    gain, sure = channel_gain(rest), channel_gain(np.where(own.heard, rest, np.nan))
    # what does not stand above its noise tells how high the gain can be
    gain = np.where(own.heard.sum(axis=1) < _LEAST_TOLD, np.fmin(sure, gain), sure)
    expected, rest = mean + gain[:, None], rest - gain[:, None]
    rest = np.where(own.heard | (rest < 0.0), rest, np.nan)
    sigma = np.sqrt(scale * (spread + own.error_db**2))
    return LevelDeviation(expected, rest, sigma, gain)


def _predicted(
    healthy: Sequence[Levels], states: FloatArray, at: FloatArray, prior: _Prior
) -> tuple[FloatArray, FloatArray]:
    """Levels that references let expect at a state, and their variances [dB, dB^2]."""
    kriging = Kriging(states, at, *prior)
    mean = np.tensordot(kriging.weights, [one.level_db for one in healthy], 1)
    error = np.tensordot(kriging.weights**2, [one.error_db**2 for one in healthy], 1)
    return mean, error + _DB**2 * kriging.spread


def channel_gain(moved_db: FloatArray) -> FloatArray:
    """Return what all levels of each channel have in common: their median, NaN where none is.

    Parameters
    ----------
    moved_db : ndarray of float, shape (channels, levels)
        Changes of levels, NaN where unknown.

    Returns
    -------
    ndarray of float, shape (channels,)
        In the unit of the changes.

    Examples
    --------
    >>> channel_gain(np.array([[1.0, np.nan, 3.0], [6.0, 0.0, 5.0]])).tolist()
    [2.0, 5.0]
    """
    if not moved_db.shape[1]:
        return np.full(len(moved_db), np.nan)
    # NumPy's `nanmedian` takes ten times as long
    ordered, count = np.sort(moved_db, axis=1), np.count_nonzero(~np.isnan(moved_db), axis=1)
    middle = np.stack([(count - 1) // 2, count // 2], axis=1)
    return np.asarray(np.take_along_axis(ordered, middle, axis=1).mean(axis=1))


@dataclass(frozen=True, kw_only=True, eq=False)
class MachineDeviation:
    """How a recording departs from the law of its machine.

    Parameters
    ----------
    gap : float
        Distance of its operating state to the nearest reference's.
    heavy : float
        By how much its load is heavier than that of every reference [Np]; negative if it is not.
    speed_off : float, >= 0
        By how much its speed, or how far that swung, is off that of the nearest reference
        [`SPEED_UNIT`].
    length : float, in (0, 1]
        Its length over that of the shortest reference, at most 1.
    gears : tuple of GearDeviation
        One for each gear that recording and reference resolve.
    family_names : tuple of str
        Families of lines that were compared.
    levels : LevelDeviation
        Of those families.
    broadband : LevelDeviation or None
        Of the broadband spectrum; None where the recordings have other bands.
    """

    gap: float
    heavy: float
    speed_off: float
    length: float
    gears: tuple[GearDeviation, ...]
    family_names: tuple[str, ...]
    levels: LevelDeviation
    broadband: LevelDeviation | None


class HealthyMachine:
    """The law of one machine.

    Parameters
    ----------
    reference : Reference
        The healthy recordings.
    machine : Machine
        The machine.

    Attributes
    ----------
    gauge : StateGauge
        Tells operating states.
    states : ndarray of float, shape (references, 3)
        Those of the healthy recordings.
    gears : tuple of GearLaw
        One for each gear that all of them resolve.
    lightest : float, > 0
        How the teeth of the stage that is loaded least are loaded (`gears.mechanics.load_share`).
    """

    def __init__(self, reference: Reference, machine: Machine) -> None:
        self.reference, profiles, gears = reference, reference.profiles, list[GearLaw]()
        loads = [load_share(machine, number + 1) for number in range(len(machine.stages))]
        self.lightest = min(loads)
        self.gauge = StateGauge(profiles, self.lightest)
        self.states = states = np.array([self.gauge.state(profile) for profile in profiles])
        for wheel in profiles[0].wheels:
            same = [found for p in profiles if (found := wheel.same_in(p.wheels))]
            if len(same) < len(profiles) or not all(len(one.number) for one in same):
                continue
            # the tachometer's zero is that of shaft 1: other shafts stand anywhere when it comes
            indexed = all(p.tacho for p in profiles) and abs(wheel.order - 1.0) < 1e-12
            own, load = turned_alike(same, same_zero=indexed), loads[wheel.stage - 1]
            law = GearLaw(wheel=wheel, patterns=own, states=states, load=load, indexed=indexed)
            gears.append(law)
        self.gears = tuple(gears)

    def deviation(self, own: Profile, left_out: Sequence[str] = ()) -> MachineDeviation:
        """Hold a recording against the law.

        Parameters
        ----------
        own : Profile
            The recording, in the channels of the law.
        left_out : sequence of str
            Families of lines not to compare.

        Raises
        ------
        ArgumentError
            If no family of lines is left.
        """
        state = self.gauge.state(own)
        profiles = self.reference.profiles
        gears = [
            law.deviation(wheel, state, same_zero=own.tacho and law.indexed)
            for law in self.gears
            if (wheel := law.wheel.same_in(own.wheels))
        ]
        known = set(self.reference.family_names) - set(left_out)
        names = [name for name in own.family_names if name in known]
        if not names:
            raise ArgumentError(
                f"{own.origin}: shares no family of lines with the reference: sampling rate or "
                "length differ too much"
            )
        # how far the speed swung, in its own unit
        every = np.vstack([state, self.states])
        swing = np.sqrt(every[:, 2]) * (FLUCTUATION_UNIT / SPEED_UNIT)
        off = np.maximum(*(np.abs(one[1:] - one[0]) for one in (every[:, 1], swing)))
        placed = in_units(self.states, self.lightest), in_units(state, self.lightest)
        healthy = [profile.of_families(names) for profile in profiles]
        bands = [profile.bands for profile in profiles]
        shape = own.band_db.shape
        alike = shape[1] > 0 and all(one.level_db.shape == shape for one in bands)
        return MachineDeviation(
            gap=float(np.min(np.linalg.norm(self.states - state, axis=1))),
            heavy=float(state[0] - self.states[:, 0].max()),
            speed_off=float(off.min()),
            length=min(1.0, own.duration_s / min(p.duration_s for p in profiles)),
            gears=tuple(filter(None, gears)),
            family_names=tuple(names),
            levels=level_deviation(own.of_families(names), healthy, *placed),
            broadband=level_deviation(own.bands, bands, *placed, BROADBAND) if alike else None,
        )
