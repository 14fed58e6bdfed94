"""Whether a second tooth of a gear is damaged beside the one that departs most.

What two teeth do in turn repeats after as many tooth pitches as they stand apart, whatever the path
makes of it: the power of the lines then comes and goes with their number. Where it does so is
looked for first; whether a second event explains the departure better than one and noise is then
told by the likelihood of both, see `event_likelihood`. Two neighbours are another matter: one event
that lasts longer is nearly as good an explanation as two that follow each other at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.event_likelihood import (
    RINGING,
    SHARES,
    Band,
    event,
    log_likelihood,
    weighted,
)
from gearmon.diagnosis.matched import log_mean

FloatArray = NDArray[np.float64]

#: Sizes of the second event over the first that are tried: what is smaller, the imperfect model of
#: the first leaves behind as well.
SIZES = (0.4, 0.7, 1.0)
# Distances that are tried beside the two nearest teeth on either side.
_DISTANCES, _NEAR = 3, 2
# Logarithm of the factor by which a second tooth has to explain a departure better than one does:
# for teeth apart (beside the number of places and sizes it may have) and for neighbours; and the
# least that it has to be as a share of what speaks for the first, since what the imperfect model of
# the first leaves behind grows with it. Of 275 simulated single teeth, a sixth of them at another
# load, speed and gain, one goes beyond the first and two beyond the second.
_CLEAR, _CLEAR_OF_NEIGHBOUR = 8.0, 25.0
_SHARE, _SHARE_OF_NEIGHBOUR = 0.2, 0.08


@dataclass(frozen=True, kw_only=True, eq=False)
class SecondTooth:
    """The second tooth that explains a departure best beside the first.

    Parameters
    ----------
    log_likelihood : ndarray of float, shape (len(SHARES),)
        Logarithm of the likelihood that both leave each of `SHARES` unexplained, less what is asked
        of a second tooth before it is believed.
    distance : int
        Teeth that it enters mesh after the first; negative before.
    size : float
        Its event over that of the first, one of `SIZES`.
    """

    log_likelihood: FloatArray
    distance: int
    size: float


def second_tooth(
    bands: Sequence[Band],
    contact_ratio: float,
    first: int,
    by_tooth: FloatArray,
    log_first: float,
) -> SecondTooth | None:
    """Look for a second damaged tooth.

    Parameters
    ----------
    bands : sequence of Band
        The departure.
    contact_ratio : float
        Of the mesh.
    first : int
        Tooth that explains it best, from 0.
    by_tooth : ndarray of float, shape (teeth,)
        Energy of the departure at each tooth.
    log_first : float
        Logarithm of the Bayes factor of damage of the gear.

    Returns
    -------
    SecondTooth or None
        None for gears of too few teeth to tell.
    """
    teeth = len(by_tooth)
    if teeth < 2 * (_NEAR + 1):
        return None
    distances = _distances(bands, first, by_tooth)
    tried = [(distance, size) for distance in distances for size in SIZES]
    distance, size = (np.array(each) for each in zip(*tried, strict=True))
    total = np.zeros((len(SHARES), len(tried)))
    for band in bands:
        turn = np.exp(-2j * np.pi / teeth * np.outer(distance, band.number))
        factor = np.asarray(1.0 + size[:, None] * turn, dtype=np.complex128)
        parts = []
        for ringing in RINGING:
            power, direction = event(band, contact_ratio, ringing)
            parts.append(log_likelihood(band, *weighted(band, power, direction, first, factor)))
        total += log_mean(np.array(parts))
    apart = max(_CLEAR + float(np.log(teeth * len(SIZES))), _SHARE * log_first)
    beside = max(_CLEAR_OF_NEIGHBOUR, _SHARE_OF_NEIGHBOUR * log_first)
    total -= np.where(np.abs(distance) > 1, apart, beside)
    best = int(np.argmax(total.max(axis=0)))
    return SecondTooth(
        log_likelihood=total[:, best], distance=int(distance[best]), size=float(size[best])
    )


def _distances(bands: Sequence[Band], first: int, by_tooth: FloatArray) -> list[int]:
    """Distances of a second tooth from the first: the nearest, and those after which it repeats."""
    teeth = len(by_tooth)
    farther = np.argsort(-repetition(bands, teeth)[_NEAR + 1 : teeth // 2 + 1], kind="stable")
    found = [sign * near for near in range(1, _NEAR + 1) for sign in (1, -1)]
    for distance in (farther[:_DISTANCES] + _NEAR + 1).tolist():
        # the sooner of two events alike is as far from the later as that from the next turn's
        after, before = by_tooth[(first + distance) % teeth], by_tooth[(first - distance) % teeth]
        found.append(distance if after >= before else -distance)
    return found


def repetition(bands: Sequence[Band], teeth: int) -> FloatArray:
    """Return how much of a departure comes again so many teeth later, shape (teeth,).

    Parameters
    ----------
    bands : sequence of Band
    teeth : int

    Returns
    -------
    ndarray of float
        Autocorrelation of the departure at whole tooth pitches, bands of equal weight, less what
        the gaps between the lines would make of a single event: a / (1 + a^2) for two events of
        which one is a times the other.
    """
    total = np.zeros(teeth)
    lines = 0
    for band in bands:
        power = np.abs(band.rest) ** 2
        beyond = power / max(float(power.mean()), np.finfo(float).tiny) - 1.0
        total += np.bincount(band.number % teeth, beyond, minlength=teeth)
        lines += len(power)
    return np.asarray(np.fft.fft(total).real / max(1, lines))
