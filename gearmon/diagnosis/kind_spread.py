"""Whether a departure is one tooth's: the share of it that the best tooth explains.

A damaged tooth answers with one short event a turn, so that the lines about a mesh harmonic keep
step with one another. Damage of many teeth, or a mesh that changes over the whole turn (a gear that
stands askew or runs out), fills the same lines without that step; a second damaged tooth makes
their power come and go. The share of a departure that one tooth leaves unexplained is common to all
bands, its power is not: the likelihood of the share, see `event_likelihood`, tells how much of a
departure one tooth leaves unexplained, whatever its size, and that of two teeth whether a second
one explains it, see `kind_second`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.event_likelihood import (
    RINGING,
    SHARES,
    bands_of,
    energies,
    event,
    log_likelihood,
)
from gearmon.diagnosis.kind_second import SecondTooth, second_tooth
from gearmon.diagnosis.matched import log_mean
from gearmon.diagnosis.tooth_search import SearchedGear

FloatArray = NDArray[np.float64]

#: One tooth leaves less than this unexplained: its event is not known better, and a machine departs
#: a little all around its turn.
ONE_TOOTH_BELOW = 0.45
# Teeth that are tried: those that the search found the likeliest.
_TRIED = 4
# Ringing of the path for which the energy at each tooth is told.
_TOLD = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class DepartureSpread:
    """How far a departure is that of one tooth.

    Parameters
    ----------
    log_likelihood : ndarray of float, shape (len(SHARES),)
        Logarithm of the likelihood that one tooth leaves each of `SHARES` unexplained.
    by_tooth : ndarray of float, shape (teeth,)
        Energy of the departure at each tooth over that of noise, as a mean square.
    second : SecondTooth or None
        The second tooth that explains it best beside the first.
    """

    log_likelihood: FloatArray
    by_tooth: FloatArray
    second: SecondTooth | None = None

    @cached_property
    def _chance(self) -> FloatArray:
        chance = np.exp(self.log_likelihood - self.log_likelihood.max())
        one = SHARES < ONE_TOOTH_BELOW
        chance /= np.where(one, one.sum(), (~one).sum())
        return np.asarray(chance / chance.sum())

    @cached_property
    def _kinds(self) -> FloatArray:
        """Probabilities of one tooth, of two or more that stand out, and of the whole turn."""
        one = SHARES < ONE_TOOTH_BELOW
        second = self.second.log_likelihood[one] if self.second else np.full(one.sum(), -np.inf)
        told = (self.log_likelihood[one], second, self.log_likelihood[~one])
        largest = max(float(part.max()) for part in told)
        chance = np.array([np.mean(np.exp(part - largest)) for part in told])
        return np.asarray(chance / chance.sum())

    @property
    def one_tooth(self) -> float:
        """Probability that the departure is one tooth's, all kinds held equally likely before."""
        return float(self._kinds[0])

    @property
    def several_teeth(self) -> float:
        """Probability that a second tooth is damaged beside the first."""
        return float(self._kinds[1])

    @property
    def explained(self) -> float:
        """Share of the departure that one tooth explains, 0 to 1."""
        return float(1.0 - self._chance @ SHARES)

    @property
    def teeth_involved(self) -> float:
        """Number of teeth that would share the departure's energy equally."""
        excess = np.maximum(self.by_tooth - 1.0, 0.0)
        square = float(np.sum(excess**2))
        return float(excess.sum()) ** 2 / square if square > 0 else float(len(excess))


def departure_spread(gear: SearchedGear) -> DepartureSpread | None:
    """Judge whether the departure of a gear is that of one tooth.

    Parameters
    ----------
    gear : SearchedGear
        A gear of parallel stages, searched for a damaged tooth.

    Returns
    -------
    DepartureSpread or None
        None if none of its lines is known.

    Notes
    -----
    A second tooth is told where its event is about half of the first's or more and three or more
    teeth away; a damaged neighbour mostly passes for the same tooth.
    """
    tried = np.argsort(-gear.match.log_tooth, kind="stable")[:_TRIED]
    total: FloatArray = np.zeros((len(SHARES), len(tried)))
    by_tooth = np.zeros(gear.match.teeth)
    bands = list(bands_of(gear))
    if not bands:
        return None
    contact_ratio = gear.response.contact_ratio
    for band in bands:
        parts = []
        for number, ringing in enumerate(RINGING):
            power, direction = event(band, contact_ratio, ringing)
            parts.append(log_likelihood(band, power, energies(band, direction, tried)))
            if number == _TOLD:
                energy = energies(band, direction, slice(None))
                by_tooth += energy @ (power / power.sum()) / len(bands)
        total += log_mean(np.array(parts))
    # the tooth that explains most of it, which may be another than the likeliest to be damaged
    first = int(tried[np.argmax(log_mean(total[SHARES < ONE_TOOTH_BELOW]))])
    return DepartureSpread(
        log_likelihood=log_mean(total.T.copy()),
        by_tooth=by_tooth,
        second=second_tooth(bands, contact_ratio, first, by_tooth, gear.match.log_gear),
    )
