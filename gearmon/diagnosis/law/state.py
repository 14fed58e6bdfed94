"""The operating state of recordings, and prediction from one state to another.

The state is what a healthy machine may change by itself: its load, heard as the level of its mesh
harmonics against all else, and its speed. Every healthy quantity is taken as a Gaussian process of
it, of unknown mean, with a scatter from recording to recording and a slope per unit of state: from
one reference the prediction is that reference, with a variance that grows with the distance; from
several it is interpolated between them (universal kriging; Matheron 1963), and the change with load
is explained instead of counted as scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.signatures.measured.reference import Profile

_NEPER = float(np.log(10.0) / 20.0)
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
    parts : ndarray of float, shape (2,)
        Variance of the quantity about the prediction: by scatter from recording to recording, and
        by what changes with the state. Noise of the measurement comes on top.
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
        known : ndarray of float, shape (references, 2)
            Their states [units].
        state : ndarray of float, shape (2,)
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
        changed = size - 2.0 * weights @ right[:count] + weights @ shared(known, known) @ weights
        parts = [scatter**2 * (1.0 + weights @ weights), max(float(changed), 0.0)]
        return cls(weights=weights, parts=np.array(parts))


def operating_states(
    profiles: Sequence[Profile],
    base: Profile,
    rows: Sequence[Sequence[int]],
    base_rows: Sequence[int],
) -> FloatArray:
    """Place recordings in the space of operating states, relative to one of them.

    Parameters
    ----------
    profiles : sequence of Profile
        Recordings.
    base : Profile
        The recording at the origin.
    rows, base_rows : sequence of int
        The same channels in each.

    Returns
    -------
    ndarray of float, shape (recordings, 2)
        Load: level of the mesh harmonics [Np], what all lines and the noise floor have in common
        (the gain of a sensor) left out; and speed, in units of `SPEED_UNIT`.
    """
    return np.array(
        [
            [
                _load(profile, base, own, base_rows),
                (profile.speed_hz / base.speed_hz - 1) / SPEED_UNIT,
            ]
            for profile, own in zip(profiles, rows, strict=True)
        ]
    )


def _load(profile: Profile, base: Profile, rows: Sequence[int], base_rows: Sequence[int]) -> float:
    shared = [name for name in base.family_names if name in profile.family_names]
    own = np.ix_(rows, [profile.family_names.index(name) for name in shared])
    its = np.ix_(base_rows, [base.family_names.index(name) for name in shared])
    change = _NEPER * (profile.level_db[own] - base.level_db[its])
    heard = profile.heard[own] & base.heard[its]
    of_mesh = np.array([name.startswith("mesh") for name in shared])
    parts = [_middle(change[heard & of_mesh]), _middle(change[heard & ~of_mesh])]
    if profile.band_db.shape[1:] == base.band_db.shape[1:]:
        parts.append(
            _middle(_NEPER * (profile.band_db[list(rows)] - base.band_db[list(base_rows)]))
        )
    # a gain moves lines and floor alike; what moves them apart is the load
    same_way = all(part > 0 for part in parts) or all(part < 0 for part in parts)
    gain = min(parts, key=abs) if same_way else 0.0
    return parts[0] - gain


def _middle(values: FloatArray) -> float:
    return float(np.median(values)) if values.size else 0.0
