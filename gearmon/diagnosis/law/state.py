"""The operating state of recordings, and prediction from one state to another.

The state is what a healthy machine may change by itself: its load, heard as the level of its mesh
harmonics, and its speed. Every healthy quantity is taken as a Gaussian process of
it, of unknown mean, with a scatter from recording to recording and a slope per unit of state: from
one reference the prediction is that reference, with a variance that grows with the distance; from
several it is interpolated between them (universal kriging; Matheron 1963), and the change with load
is explained instead of counted as scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.signatures.measured.reference import Profile

_NEPER = float(np.log(10.0) / 20.0)
# Change of a mesh harmonic [Np] from which on references tell how it follows the load where teeth
# are hardly loaded: those of one load differ by 0.05 to 0.1. Rounds in which loads and that are
# fitted in turn.
_TOLD, _ROUNDS = 0.15, 5
#: Distance [units of state: nepers of the mesh] over which a slope may turn: loads a factor of two
#: apart. Healthy pairs of simulated machines from 40 to 115 % load.
LENGTH = 0.7
#: Relative change of speed that counts as one unit of state: a modal damping ratio of the path, so
#: that two per cent move lines across the modes as far as a load changed by half moves them.
SPEED_UNIT = 0.03
#: Load (`gears.mechanics.load_share` at the largest torque) of which a neper is one unit of state.
#: Teeth that are loaded less change faster with it, in proportion: at two thirds of the torque
#: their stiffness falls, at half of it those that are off leave contact. 2,394 healthy pairs of
#: simulated drives at 17 to 196 N/mm, loads 1.0 to 0.5, one to three references: 118 were called
#: faults without it, nearly all by levels, 17 are with it. Of 28 cracks of 30 % at 17 and 42 N/mm,
#: learned at 1.0, 0.75 and 0.5 of the load, 12 were found without it, 17 are.
FULL_LOAD = 1.5


def load_unit(share: float) -> float:
    """Return the nepers of load that are one unit of state, for teeth loaded so (`FULL_LOAD`)."""
    return min(1.0, share / FULL_LOAD)


@dataclass(frozen=True, kw_only=True, eq=False)
class Kriging:
    """Prediction of a healthy quantity at a state.

    Parameters
    ----------
    weights : ndarray of float, shape (references,)
        Of each reference in the prediction; their sum is 1.
    parts : ndarray of float, shape (1 + coordinates,)
        Variance of the quantity about the prediction: by scatter from recording to recording, and
        by what changes with each coordinate of the state. Noise of the measurement comes on top.
    """

    weights: FloatArray
    parts: FloatArray

    @property
    def spread(self) -> float:
        """Variance of the quantity about the prediction."""
        return float(self.parts.sum())

    @classmethod
    def of(
        cls, known: FloatArray, state: FloatArray, scatter: float = 0.06, slope: float = 0.5
    ) -> Kriging:
        """Predict at a state from references.

        Parameters
        ----------
        known : ndarray of float, shape (references, coordinates)
            Their states [units].
        state : ndarray of float, shape (coordinates,)
            Where to predict.
        scatter : float, > 0
            Standard deviation from one healthy recording to the next at the same state.
        slope : float, >= 0
            Standard deviation of the change per unit of state.
        """
        count = len(known)
        size = (slope * LENGTH) ** 2

        def shared(a: FloatArray, b: FloatArray) -> FloatArray:
            far = np.sum((a[:, None] - b[None]) ** 2, axis=-1)
            return np.asarray(size * np.exp(-0.5 * far / LENGTH**2))

        system = np.ones((count + 1, count + 1))
        system[:count, :count] = shared(known, known) + scatter**2 * np.eye(count)
        system[count, count] = 0.0
        right = np.append(shared(known, state[None])[:, 0], 1.0)
        weights = np.linalg.solve(system, right)[:count]

        def changed(which: FloatArray) -> float:
            own, here = known * which, state * which
            between = weights @ shared(own, here[None])[:, 0]
            return float(size - 2.0 * between + weights @ shared(own, own) @ weights)

        each = np.array([max(changed(which), 0.0) for which in np.eye(len(state))])
        each *= max(changed(np.ones(len(state))), 0.0) / max(each.sum(), np.finfo(float).tiny)
        parts = [scatter**2 * (1.0 + weights @ weights), *each]
        return cls(weights=weights, parts=np.array(parts))


@dataclass(frozen=True, kw_only=True, eq=False)
class StateGauge:
    """Tells the operating state of recordings, relative to the first reference.

    Parameters
    ----------
    base : Profile
        The first reference, at the origin.
    direction : ndarray of float, shape (channels, families)
        How the level of each mesh harmonic changes with the load, over the root mean square of all.
    """

    base: Profile
    direction: FloatArray

    @classmethod
    def of(cls, profiles: Sequence[Profile], share: float) -> StateGauge:
        """Learn from the references how the mesh harmonics of this machine follow its load.

        In proportion where teeth are loaded fully. Of teeth that are loaded less one factor is
        fitted to the changes from the first reference, with a prior of equal parts: as teeth leave
        contact some harmonics fall to a third and some double while the load is halved.

        Parameters
        ----------
        profiles : sequence of Profile
            The references, in the same channels.
        share : float, > 0
            How the teeth are loaded that are loaded least (`gears.mechanics.load_share`).

        Notes
        -----
        Seven simulated machines at 17 and 42 N/mm, loads 0.5 to 1.0: the median of the harmonics
        was off the load by 0.06 to 0.30 Np, and of one machine it was the same at 0.75 and at 0.5.
        Learned from three references it is off by 0.01 to 0.04 Np, at loads between them too, and
        of the healthy pairs told of at `FULL_LOAD` 5 are called faults instead of 17. On a real rig
        of unknown torque harmonics change in all directions, and what two references at
        neighbouring loads would teach is chance.
        """
        base = profiles[0]
        direction = np.ones((len(base.level_db), len(base.family_names)))
        gauge = cls(base=base, direction=direction)
        unit = load_unit(share)
        if unit == 1.0:
            return gauge
        changes = np.array([gauge._changes(profile) for profile in profiles])
        heard = ~np.isnan(changes)
        prior = _TOLD**2 / (1.0 - unit)
        for _ in range(_ROUNDS):
            load = np.array([_slope(change, direction) for change in changes])[:, None, None]
            direction = np.sum(np.where(heard, load * changes, 0.0), axis=0) + prior
            direction /= np.sum(heard * load**2, axis=0) + prior
            direction /= np.sqrt(np.mean(direction[heard[0]] ** 2)) if heard.any() else 1.0
        return replace(gauge, direction=direction)

    def state(self, profile: Profile) -> FloatArray:
        """Place a recording in the space of operating states.

        Parameters
        ----------
        profile : Profile
            The recording, in the channels of the base.

        Returns
        -------
        ndarray of float, shape (2,)
            Load, as the level of the mesh harmonics tells it [Np]; and speed, in units of
            `SPEED_UNIT`. The gain of a sensor is taken for load: noise follows either.
        """
        speed = (profile.speed_hz / self.base.speed_hz - 1) / SPEED_UNIT
        return np.array([_slope(self._changes(profile), self.direction), speed])

    def _changes(self, profile: Profile) -> FloatArray:
        """Return changes of the mesh harmonics [Np]; NaN where unheard, and of other families."""
        base, change = self.base, np.full(self.direction.shape, np.nan)
        its = [
            n
            for n, name in enumerate(base.family_names)
            if name.startswith("mesh") and name in profile.family_names
        ]
        own = [profile.family_names.index(base.family_names[n]) for n in its]
        heard = profile.heard[:, own] & base.heard[:, its]
        change[:, its] = np.where(heard, profile.level_db[:, own] - base.level_db[:, its], np.nan)
        return _NEPER * change


def _slope(values: FloatArray, along: FloatArray) -> float:
    """Factor of a direction that leaves the least sum of magnitudes of some values."""
    told = ~np.isnan(values) & (along != 0.0)
    ratio, weight = values[told] / along[told], np.abs(along[told])
    if not ratio.size:
        return 0.0
    order = np.argsort(ratio)
    below = np.cumsum(weight[order])
    middle = [int(np.searchsorted(below, 0.5 * below[-1], side)) for side in ("left", "right")]
    return float(np.mean(ratio[order][middle]))
