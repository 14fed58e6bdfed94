"""Whether a departure is one tooth's: the share of it that the best tooth explains.

A damaged tooth answers with one short event a turn, so that the lines about a mesh harmonic keep
step with one another. Damage of many teeth, or a mesh that changes over the whole turn (a gear that
stands askew or runs out), fills the same lines without that step. The departure of a band is taken
as Gaussian with the covariance

    I + P [(1 - u) S_j + u D],

S_j that of the event at tooth j and D that of unrelated lines of the same powers, both of mean
diagonal 1. The power P of each band and channel is its own, the share u common to all of them: its
likelihood tells how much of the departure one tooth leaves unexplained, whatever its size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.tooth_search import SearchedGear

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Shares of a departure that one tooth may leave unexplained, at equal steps.
SHARES = np.concatenate([[0.003, 0.01, 0.03], np.arange(0.1, 1.01, 0.1)])
#: One tooth leaves less than this unexplained: its event is not known better, and a machine departs
#: a little all around its turn.
ONE_TOOTH_BELOW = 0.45
# How long the path rings, in mesh periods: from a tenth of one to several.
_RINGING = (0.05, 0.3, 1.0, 3.0)
# Steps of the delay and how far a ringing is followed.
_STEP, _REACH = 0.5, 3.0
# Where within the contact of a tooth its damage speaks is known to a third of a mesh period.
_SLACK = 0.3
# Directions with less than this share of the event's power are not looked at.
_LEFT_OUT = 1e-3
# Powers that are tried, over the excess of the band's mean square; and the least of these.
_POWERS = np.geomspace(1.0 / 16.0, 16.0, 13)
_LEAST_POWER = 0.05
# Teeth that are tried: those that the search found the likeliest.
_TRIED = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class DepartureSpread:
    """How far a departure is that of one tooth.

    Parameters
    ----------
    log_likelihood : ndarray of float, shape (len(SHARES),)
        Logarithm of the likelihood that one tooth leaves each of `SHARES` unexplained.
    by_tooth : ndarray of float, shape (teeth,)
        Energy of the departure at each tooth over that of noise, as a mean square.
    """

    log_likelihood: FloatArray
    by_tooth: FloatArray

    @cached_property
    def _chance(self) -> FloatArray:
        chance = np.exp(self.log_likelihood - self.log_likelihood.max())
        one = SHARES < ONE_TOOTH_BELOW
        chance /= np.where(one, one.sum(), (~one).sum())
        return np.asarray(chance / chance.sum())

    @property
    def one_tooth(self) -> float:
        """Probability that the departure is one tooth's, both held equally likely before."""
        return float(self._chance[SHARES < ONE_TOOTH_BELOW].sum())

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
    """
    tried = np.argsort(-gear.match.log_tooth, kind="stable")[:_TRIED]
    total: FloatArray = np.zeros((len(SHARES), len(tried)))
    by_tooth = np.zeros(gear.match.teeth)
    freedom = 0.0
    for band in _bands(gear):
        parts = []
        for ringing in _RINGING:
            power, direction = _event(band, gear.response.contact_ratio, ringing)
            energy = np.abs((band.place * band.rest) @ direction.conj()) ** 2
            parts.append(_log_likelihood(band, power, energy[tried]))
            if ringing == _RINGING[1]:
                by_tooth += energy @ (power / power.sum())
                freedom += 1.0
        total += _log_mean(np.array(parts))
    if not freedom:
        return None
    return DepartureSpread(log_likelihood=_log_mean(total.T.copy()), by_tooth=by_tooth / freedom)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Band:
    """The departure about one mesh harmonic in one channel."""

    rest: ComplexArray
    level: FloatArray
    offset: FloatArray
    place: ComplexArray


def _bands(gear: SearchedGear) -> Iterator[_Band]:
    teeth, difference = gear.match.teeth, gear.difference
    for band in difference.bands:
        inside = band.number < len(gear.response.lines)
        number = band.number[inside]
        if len(number) < 2:
            continue
        heard = np.sqrt(gear.response.band_power(number.astype(np.float64)))
        place = np.exp(2j * np.pi / teeth * np.outer(np.arange(teeth), number))
        for rest, deviation in zip(band.rest, band.deviation, strict=True):
            level = heard / deviation[inside]
            mean = float(np.sqrt(np.mean(level**2)))
            if mean > 0:
                yield _Band(
                    rest=rest[inside],
                    level=level / mean,
                    offset=(number - teeth * band.harmonic) / teeth,
                    place=place,
                )


def _event(band: _Band, contact_ratio: float, ringing: float) -> tuple[FloatArray, ComplexArray]:
    """Powers and directions of the covariance of an event at tooth 1, of trace `lines`.

    The damage speaks at any moment of the contact, which takes `contact_ratio` mesh periods, and
    the path rings after it.
    """
    delay = np.arange(-_SLACK, contact_ratio + _REACH * ringing + _STEP, _STEP)
    early = np.clip(delay - contact_ratio - _SLACK, 0.0, None) / ringing
    late = np.clip(delay + _SLACK, 0.0, None) / ringing
    weight = np.exp(-early) - np.exp(-late)
    weight = np.maximum(weight, 1e-6 * float(weight.max()))
    root = band.level[:, None] * np.exp(-2j * np.pi * np.outer(band.offset, delay))
    root *= np.sqrt(weight / weight.sum())
    power, vector = np.linalg.eigh(root.conj().T @ root)
    kept = power > _LEFT_OUT * float(power.sum())
    power = power[kept]
    return power, np.asarray(root @ vector[:, kept] / np.sqrt(power))


def _log_likelihood(band: _Band, power: FloatArray, energy: FloatArray) -> FloatArray:
    """Logarithm of the likelihood of a band, shape (shares, teeth), its power averaged over."""
    lines = len(band.rest)
    whole = float(np.sum(np.abs(band.rest) ** 2))
    size = max(whole / lines - 1.0, _LEAST_POWER) * _POWERS[:, None]
    spread = 1.0 + size * SHARES
    along = spread[:, :, None] + size[:, :, None] * (1.0 - SHARES[:, None]) * power
    told = np.einsum("pum,tm->put", 1.0 / along, energy) + np.log(along).sum(axis=2)[:, :, None]
    rest = np.maximum(whole - energy.sum(axis=1), 0.0)
    told += rest / spread[:, :, None] + (lines - len(power)) * np.log(spread)[:, :, None]
    return _log_mean(-told)


def _log_mean(logarithms: FloatArray) -> FloatArray:
    largest = logarithms.max(axis=0)
    mean: FloatArray = largest + np.log(np.mean(np.exp(logarithms - largest), axis=0))
    return mean
