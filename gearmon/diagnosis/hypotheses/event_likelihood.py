"""How likely an event at a tooth leaves the lines of a departure, whatever path they took.

The lines about one mesh harmonic are taken as Gaussian with the covariance

    I + P [(1 - u) S + u D],

S that of an event at one tooth and D that of unrelated lines of the same powers, both of mean
diagonal 1; P is the power of the band, u the share that the event leaves unexplained. Teeth that
lost stiffness alike sound alike: an event at a second tooth, d teeth after the first and a times as
large, multiplies every line n by 1 + a exp(-2 pi i n d / z) and asks for no other path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.hypotheses.tooth_match import log_mean
from gearmon.diagnosis.hypotheses.tooth_search import SearchedGear

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

#: Shares of a departure that an event may leave unexplained, at equal steps.
SHARES = np.concatenate([[0.003, 0.01, 0.03], np.arange(0.1, 1.01, 0.1)])
#: How long the path rings, in mesh periods: from a tenth of one to several.
RINGING = (0.05, 0.3, 1.0, 3.0)
# Steps of the delay and how far a ringing is followed.
_STEP, _REACH = 0.5, 3.0
# Where within the contact of a tooth its damage speaks is known to a third of a mesh period.
_SLACK = 0.3
# Directions with less than this share of the event's power are not looked at; with less than this
# share nothing can be told of them.
_LEFT_OUT, _NOTHING = 1e-3, 1e-9
# Powers that are tried, over the excess of the band's mean square; and the least of these.
_POWERS = np.geomspace(1.0 / 16.0, 16.0, 13)
_LEAST_POWER = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class Band:
    """The departure about one mesh harmonic in one channel.

    Parameters
    ----------
    number : ndarray of int, shape (lines,)
        Multiples of the gear's rotation.
    rest : ndarray of complex, shape (lines,)
        The departure, in units of its noise.
    level : ndarray of float, shape (lines,)
        Amplitude of an event in the same unit, up to a constant: of mean square 1.
    offset : ndarray of float, shape (lines,)
        Distance from the mesh harmonic, in mesh orders.
    place : ndarray of complex, shape (teeth, lines)
        Factors that turn each tooth in turn to where tooth 1 would stand.
    """

    number: IntArray
    rest: ComplexArray
    level: FloatArray
    offset: FloatArray
    place: ComplexArray

    @property
    def whole(self) -> float:
        """Energy of the departure."""
        return float(np.sum(np.abs(self.rest) ** 2))


def bands_of(gear: SearchedGear) -> Iterator[Band]:
    """Return the departure of a gear about each mesh harmonic in each channel."""
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
                yield Band(
                    number=number,
                    rest=rest[inside],
                    level=level / mean,
                    offset=(number - teeth * band.harmonic) / teeth,
                    place=place,
                )


def event(band: Band, contact_ratio: float, ringing: float) -> tuple[FloatArray, ComplexArray]:
    """Return powers and directions of the covariance of an event at tooth 1, of trace `lines`.

    Parameters
    ----------
    band : Band
    contact_ratio : float
        Mesh periods of the contact: the damage speaks at any moment of it.
    ringing : float
        Mesh periods that the path rings after it.

    Returns
    -------
    power : ndarray of float, shape (directions,)
    direction : ndarray of complex, shape (lines, directions)
        Orthonormal.
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


def energies(band: Band, direction: ComplexArray, teeth: IntArray | slice) -> FloatArray:
    """Return the energy of the departure along directions turned to some teeth, shape (t, m)."""
    return np.asarray(np.abs((band.place[teeth] * band.rest) @ direction.conj()) ** 2)


def weighted(
    band: Band, power: FloatArray, direction: ComplexArray, tooth: int, factor: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Return powers and energies of an event at a tooth whose lines are multiplied by factors.

    Parameters
    ----------
    band : Band
    power, direction
        Of the event without them, see `event`.
    tooth : int
        From 0.
    factor : ndarray of complex, shape (events, lines)

    Returns
    -------
    power, energy : ndarray of float, shape (events, directions)
    """
    root = direction * np.sqrt(power)
    gram = root.conj().T @ ((np.abs(factor) ** 2)[:, :, None] * root)
    scale = len(root) / np.trace(gram, axis1=1, axis2=2).real
    along, vector = np.linalg.eigh(gram)
    told = (factor.conj() * (band.place[tooth] * band.rest)) @ root.conj()
    energy = np.abs(np.sum(vector.conj() * told[:, :, None], axis=1)) ** 2
    known = along > _NOTHING * along[:, -1:]
    energy = np.where(known, energy / np.where(known, along, 1.0), 0.0)
    return np.where(known, along * scale[:, None], 0.0), energy


def log_likelihood(band: Band, power: FloatArray, energy: FloatArray) -> FloatArray:
    """Logarithm of the likelihood of a band, the power of the departure averaged over.

    Parameters
    ----------
    band : Band
    power : ndarray of float, shape (directions,) or (events, directions)
        Of the event along its directions.
    energy : ndarray of float, shape (events, directions)
        Of the departure along them.

    Returns
    -------
    ndarray of float, shape (len(SHARES), events)
        Up to a constant of the band.
    """
    lines, whole = len(band.rest), band.whole
    size = max(whole / lines - 1.0, _LEAST_POWER) * _POWERS[:, None]
    spread = 1.0 + size * SHARES
    across = (size * (1.0 - SHARES))[:, :, None, None] * np.atleast_2d(power)
    along = spread[:, :, None, None] + across
    told = np.sum(energy / along + np.log(along), axis=3)
    rest = np.maximum(whole - energy.sum(axis=1), 0.0)
    told = told + rest / spread[:, :, None]
    told = told + (lines - energy.shape[1]) * np.log(spread)[:, :, None]
    return log_mean(-told)
