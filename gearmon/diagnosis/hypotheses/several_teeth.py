"""Whether a departure is one tooth's: the share of it that the best tooth explains.

A damaged tooth answers with one short event a turn, so that the lines about a mesh harmonic keep
step with one another. Damage of many teeth, or a mesh that changes over the whole turn (a gear that
stands askew or runs out), fills the same lines without that step; a second damaged tooth makes
their power come and go. The share of a departure that one tooth leaves unexplained is common to all
bands, and so is how long the path rings; its power is not: the likelihood of the share tells how
much of a departure one tooth leaves unexplained, whatever its size, and that of two teeth whether a
second one explains it.

What two teeth do in turn repeats after as many tooth pitches as they stand apart, whatever the path
makes of it: the power of the lines then comes and goes with their number. Where it does so is
looked for first. Two neighbours are not told from one: an event that lasts longer explains them
nearly as well.

Whatever path an event took, the lines that it leaves about one mesh harmonic are taken as Gaussian
with the covariance

    I + P [(1 - u) S + u D],

S that of an event at one tooth and D that of unrelated lines of the same powers, both of mean
diagonal 1; P is the power of the band, u the share that the event leaves unexplained. Teeth that
lost stiffness alike sound alike: an event at a second tooth, d teeth after the first and a times as
large, multiplies every line n by 1 + a exp(-2 pi i n d / z) and asks for no other path.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.diagnosis.hypotheses.tooth_match import SearchedGear, log_mean

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


class Band(NamedTuple):
    """The departure about one mesh harmonic in one channel.

    Parameters
    ----------
    number : ndarray of int, shape (lines,)
        Multiples of the gear's rotation.
    rest : ndarray of complex, shape (lines,)
        The departure, in units of its noise.
    place : ndarray of complex, shape (teeth, lines)
        Factors that turn each tooth in turn to where tooth 1 would stand.
    events : list of (ndarray, ndarray)
        Powers and directions of an event for each of `RINGING`, see `event`.
    """

    number: IntArray
    rest: ComplexArray
    place: ComplexArray
    events: list[tuple[FloatArray, ComplexArray]]


def bands_of(gear: SearchedGear) -> Iterator[Band]:
    """Return the departure of a gear about each mesh harmonic in each channel."""
    teeth = gear.difference.teeth
    for number, rest, level, _ in gear.heard:
        mean = float(np.sqrt(np.mean(level**2)))
        if len(number) > 1 and mean > 0:
            place = np.exp(2j * np.pi / teeth * np.outer(np.arange(teeth), number))
            known = level / mean, number / teeth, gear.response.contact_ratio
            yield Band(number, rest, place, [event(*known, ringing) for ringing in RINGING])


def event(
    level: FloatArray, order: FloatArray, contact_ratio: float, ringing: float
) -> tuple[FloatArray, ComplexArray]:
    """Return powers and directions of the covariance of an event at tooth 1, of trace `lines`.

    Parameters
    ----------
    level : ndarray of float, shape (lines,)
        Amplitude of the event in units of the noise, up to a constant: of mean square 1.
    order : ndarray of float, shape (lines,)
        Multiples of the mesh frequency, whole ones left out or not.
    contact_ratio : float
        Mesh periods of the contact of a tooth.
    ringing : float
        Mesh periods that the path rings after the contact; the damage speaks at any moment of it.

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
    root = level[:, None] * np.exp(-2j * np.pi * np.outer(order, delay))
    root *= np.sqrt(weight / weight.sum())
    power, vector = np.linalg.eigh(root.conj().T @ root)
    kept = power > _LEFT_OUT * float(power.sum())
    power = power[kept]
    return power, np.asarray(root @ vector[:, kept] / np.sqrt(power))


def energies(band: Band, direction: ComplexArray) -> FloatArray:
    """Return the energy of the departure along directions turned to teeth, shape (teeth, m)."""
    return np.asarray(np.abs((band.place * band.rest) @ direction.conj()) ** 2)


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
    lines, whole = len(band.rest), float(np.sum(np.abs(band.rest) ** 2))
    size = max(whole / lines - 1.0, _LEAST_POWER) * _POWERS[:, None]
    spread = 1.0 + size * SHARES
    across = (size * (1.0 - SHARES))[:, :, None, None] * np.atleast_2d(power)
    along = spread[:, :, None, None] + across
    told = np.sum(energy / along + np.log(along), axis=3)
    rest = np.maximum(whole - energy.sum(axis=1), 0.0)
    told = told + rest / spread[:, :, None]
    told = told + (lines - energy.shape[1]) * np.log(spread)[:, :, None]
    return log_mean(-told)


#: One tooth leaves less than this unexplained: its event is not known better, and a machine departs
#: a little all around its turn.
ONE_TOOTH_BELOW = 0.45
# Teeth that are tried: those that the search found the likeliest.
_TRIED = 4
# Ringing of the path for which the energy at each tooth is told.
_TOLD = 1
#: Sizes of the second event over the first that are tried: what is smaller, the imperfect model of
#: the first leaves behind as well.
SIZES = (0.4, 0.7, 1.0)
# Distances that are tried beside the teeth two before and after. A neighbour is not asked for: an
# event that rings on is explained by two in a row, at 20 % of one tooth of a drawn machine with 15
# to spare where 40 were asked.
_DISTANCES, _NEAR = 3, 2
# Logarithm of the factor by which a second tooth of the least size has to explain a departure
# better than one does, beside the number of places and sizes it may have; the least that factor has
# to be as a share of what speaks for the first: what the imperfect model of the first leaves behind
# grows with it, and looks like a small second one. A larger second tooth needs hardly any: of 327
# simulated single teeth (46 machines, losses of 10 to 40 %) two are explained better by one, of 220
# pairs of damaged teeth two apart 186 are. Of cracks of 20 % on 22 machine seeds of README's pair a
# least second one would explain three of 80 by 27 to 46 more than one does, and a larger one by 4
# at most; of 12 pairs of such cracks a larger one explains all by 60 and more. Of single cracks of
# 15 to 30 % on 16 machine seeds of the catalogue's pair a second one of 0.7, more than two teeth
# away, would explain six of 168 by 11 to 26 more; of 140 pairs five teeth apart it explains two by
# 14 and 29, all others by 32 and more.
_CLEAR, _SHARE_OF_FIRST, _CLEAR_IF_LARGE, _CLEAR_IF_FAR = 30.0, 0.2, 8.0, 30.0
# Probability of a second tooth, and most that both leave, at which no other kind is asked for. Two
# teeth of lumped machines, two apart, leave 0.003 to 0.1; of smooth runout two teeth leave 0.2 at
# the least, of pits on many teeth 0.4. Of 160 findings on two such teeth (12 machines, 20 %) 119
# were named "several teeth" where the classifier of kinds decided, 139 are; of 120 on 12 machines
# that were looked at afterwards 75 were, 102 are. Single teeth are named as before.
_SURE, _LEFT_BY_TWO = 0.99, 0.1


class SecondTooth(NamedTuple):
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


class DepartureSpread:
    """How far a departure is that of one tooth.

    Parameters
    ----------
    gear : SearchedGear
        Searched for a damaged tooth.
    bands : sequence of Band
        Its departure, see `bands_of`; at least one.

    Attributes
    ----------
    log_likelihood : ndarray of float, shape (len(SHARES),)
        Logarithm of the likelihood that one tooth leaves each of `SHARES` unexplained.
    by_tooth : ndarray of float, shape (teeth,)
        Energy of the departure at each tooth over that of noise, as a mean square.
    second : SecondTooth or None
        The second tooth that explains it best beside the first.
    one_tooth, several_teeth : float
        Probability that the departure is one tooth's, and that a second one is damaged beside the
        first, these and a departure of the whole turn held equally likely before.
    of_two_teeth : bool
        Whether two teeth explain nearly all of it, and one does not.
    explained : float
        Share of the departure that one tooth explains, 0 to 1.
    teeth_involved : float
        Number of teeth that would share the departure's energy equally.
    """

    def __init__(self, gear: SearchedGear, bands: Sequence[Band]) -> None:
        tried = np.argsort(-gear.log_tooth, kind="stable")[:_TRIED]
        by_ringing: FloatArray = np.zeros((len(RINGING), len(SHARES), len(tried)))
        self.by_tooth = np.zeros(gear.difference.teeth)
        for band in bands:
            for number, (power, direction) in enumerate(band.events):
                energy = energies(band, direction)
                by_ringing[number] += log_likelihood(band, power, energy[tried])
                if number == _TOLD:
                    self.by_tooth += energy @ (power / power.sum()) / len(bands)
        total, one = log_mean(by_ringing), SHARES < ONE_TOOTH_BELOW
        # the tooth that explains most of it, which may be another than the likeliest to be damaged
        first = int(tried[np.argmax(log_mean(total[one]))])
        self.log_likelihood = told = log_mean(total.T.copy())
        self.second = second_tooth(bands, first, self.by_tooth, gear.log_gear)
        two = self.second.log_likelihood if self.second else np.full(len(SHARES), -np.inf)
        kinds = told[one], two[one], told[~one]
        largest = max(float(part.max()) for part in kinds)
        chance = np.array([np.mean(np.exp(part - largest)) for part in kinds])
        self.one_tooth, self.several_teeth, _ = (chance / chance.sum()).tolist()
        left_by_two = SHARES[np.argmax(two)]
        self.of_two_teeth = bool(self.several_teeth >= _SURE and left_by_two <= _LEFT_BY_TWO)
        likely = np.exp(told - told.max()) / np.where(one, one.sum(), (~one).sum())
        self.explained = float(1.0 - likely @ SHARES / likely.sum())
        excess = np.maximum(self.by_tooth - 1.0, 0.0)
        whole, square = float(excess.sum()), float(np.sum(excess**2))
        self.teeth_involved = whole**2 / square if square > 0 else float(len(excess))


def departure_spread(gear: SearchedGear) -> DepartureSpread | None:
    """Judge whether the departure of a gear is that of one tooth.

    Parameters
    ----------
    gear : SearchedGear
        Searched for a damaged tooth.

    Returns
    -------
    DepartureSpread or None
        None if none of its lines is known, or in a planetary set, where teeth that meet planets at
        the same moments cannot be parted.

    Notes
    -----
    A second tooth is told where its event is about half of the first's or more and two or more
    teeth away; a damaged neighbour passes for the same tooth.
    """
    bands = [] if gear.difference.meetings > 1 else list(bands_of(gear))
    return DepartureSpread(gear, bands) if bands else None


def second_tooth(
    bands: Sequence[Band], first: int, by_tooth: FloatArray, log_first: float
) -> SecondTooth | None:
    """Look for a second damaged tooth.

    Parameters
    ----------
    bands : sequence of Band
        The departure.
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
    # on either side, and those after which the departure repeats
    distances = [_NEAR, -_NEAR]
    farther = np.argsort(-repetition(bands, teeth)[_NEAR + 1 : teeth // 2 + 1], kind="stable")
    for away in (farther[:_DISTANCES] + _NEAR + 1).tolist():
        # the sooner of two events alike is as far from the later as that from the next turn's
        after, before = by_tooth[(first + away) % teeth], by_tooth[(first - away) % teeth]
        distances.append(away if after >= before else -away)
    distance, size = np.array([(away, size) for away in distances for size in SIZES]).T
    by_ringing = np.zeros((len(RINGING), len(SHARES), len(size)))
    for band in bands:
        turn = np.exp(-2j * np.pi / teeth * np.outer(distance, band.number))
        factor = np.asarray(1.0 + size[:, None] * turn, dtype=np.complex128)
        for number, (power, direction) in enumerate(band.events):
            told = weighted(band, power, direction, first, factor)
            by_ringing[number] += log_likelihood(band, *told)
    small = max(_CLEAR, _SHARE_OF_FIRST * log_first)
    far = (np.abs(distance) > _NEAR) & (size < SIZES[-1])
    large = np.where(far, _CLEAR_IF_FAR, _CLEAR_IF_LARGE)
    asked = np.where(size > SIZES[0], large, small)
    total = log_mean(by_ringing) - asked - float(np.log(teeth * len(SIZES)))
    best = int(np.argmax(total.max(axis=0)))
    return SecondTooth(total[:, best], int(distance[best]), float(size[best]))


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
