"""What an event adds at the mesh harmonics: how large the damage is, and of which gear.

A mesh harmonic is what the pulses of z equal teeth add up to, and damage changes one of these in
proportion. At the mesh harmonic itself what it adds is loss / z of the healthy line there, in size
and in phase, whichever tooth it is and whatever the form of the pulse, the resonances of the teeth
and the path to the sensor: these are the same for both. It is told by the sidebands around, since
an event that rings for a short while has a smooth spectrum. What the teeth's response adds at each
loss is told by its own sidebands in the same way, so that neither the form of the pulse nor the
smoothing biases the ratio. It corrects for what stiffness does in the square, and for load that the
damaged pair sheds through the dynamics of the mesh. Where that correction is large, the line is not
what the pulses make of it in the first place, and tells little.

The size that the search finds most likely, which takes the path's mean power from the mesh lines,
is the prior: it is all that is known where the path rings too long, where noise hides the
sidebands, and in planetary sets.

Gears on one shaft turn together, and where one turns a whole number of times as often as another
every line of the first is one of the second: damage of one then departs in the pattern of both. Of
the gear that is damaged all harmonics tell one loss, in phase with the mesh; held for damage of the
other gear the same event would have to be ten losses here and a tenth there, at any phase.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES, SearchedGear, log_mean, ringing
from gearmon.diagnosis.law.gear_lines import BandDeviation
from gearmon.machine import Machine
from gearmon.signatures.expected.tooth_response import GROWN, grown_lines

# Logarithms of losses that are told apart; the last is the largest there is.
_FINE = np.log(np.geomspace(LOSSES[0], 0.95, 200))
# Standard deviations of the logarithm of a loss: by the search alone (0.34 and 0.42 on two kinds of
# simulated machines); what all lines have in common, above all the load that this tooth carries by
# its own pitch error; of a mesh harmonic, whose line flank errors make as well; of the response
# over the logarithm of its correction (with droop and run-in of the pairs' stiffness drawn at
# random 0.1 at the first harmonics, where that logarithm is 0.05, and 0.5 where it is 0.45; of a
# Student's law a part); and over that of how far a harmonic grows unlike most others. Of losses of
# 20 % on 80 machines of both kinds (288 analyses) intervals of a factor of 1.9 hold 91 %, on the 26
# of them that were not used to set these 85 %; of 30 % 92 and 93 %. The medians of 10 to 40 % are
# right within 6 % on each kind. A tooth's pitch error weighs the more the less it is loaded: of
# teeth at 0.17 and 0.42 of full load intervals hold 26 of 35 losses of 15 and 30 % if what lines
# have in common is taken as at full load, 29 if its square grows in inverse proportion. Of 210
# losses of 10 and 20 % of a pinion at 127 N/mm (30 simulated machines of accuracy grade 6)
# intervals hold 85 and 91 %; two thirds of the variance is how far the tooth stands off the mean of
# its neighbours (correlation 0.8): 5 % of the loss for each micrometre. A line that is out of phase
# by an angle tells its size no better than that: of 237 losses of 30 % of two-stage drives (two
# simulators) intervals hold 89 % so, 85 % without, of the lightly loaded ones 92 and 71 %.
_SEARCHED, _COMMON, _LINE, _RESPONSE, _GROWTH = 0.35, 0.12, 0.15, 0.2, 0.5
# Share of a departure's mean square that is noise at least: no event is all of it.
_MISFIT = 0.03
# Freedom of Student's law for a mesh harmonic: some are those of another cause.
_FREEDOM = 4.0
# A gear competes for the blame if damage explains its own pattern by this factor (logarithm).
_COMPETES = 2.3
# How a harmonic in one channel tells of the gear: standard deviation of logarithm and phase of its
# ratio over that of the logarithm in the mean of the channels; share of harmonics that are of
# another cause; nepers over which the ratio of those is spread, at any phase. Weight of the
# logarithm of the ratio of two gears' log factors, which count every line of the event as
# independent, beside it. Of 241 analyses called faults of a gear that shares its lines with another
# (41 machines of two simulators; 15, 30 and 60 %; one and three references) the right one of the
# two is blamed in 240, by the power of lines alone in 215. Deviations of 0.35 to 0.6, shares of 0.1
# to 0.4, 6 to 8 nepers and weights of 5 to 10 make it 236 to 240.
_WIDER, _ASTRAY, _NEPERS, _BY_FACTORS = 3.0, 0.2, 8.0, 7.0
# Probability that teeth are as they are computed; and what damage of others, of relieved ones say,
# adds over what the least loss is expected to: any factor, one for all harmonics and channels, up
# to half as much again as the loss of all. Channels hear the same event, and count there as the
# root of their number. Of cracks on either gear of a common shaft the right one is blamed in 23 of
# 25 of `gearmon.simulation` and 71 of 72 of the lumped machines of `gearmon.benchmark`, by computed
# teeth alone in 23 and 72; where a dip in amplitude and phase and impacts stand for the damage (31
# drawn machines with other paths for the impacts) in 109 of 122, by computed teeth alone in 51.
# Probabilities of 0.5 to 0.9 make it 22 to 23, 71 to 72 and 107 to 112.
_AS_COMPUTED = 0.8
_FACTORS = np.exp(np.linspace(0.0, 5.0, 32)[:, None] + 2j * np.pi / 24 * np.arange(24))


class LossEstimate(NamedTuple):
    """Loss of stiffness of a tooth pair.

    Parameters
    ----------
    loss : float
        Median of what the recording leaves possible.
    low, high : float
        5 and 95 per cent points of it.
    """

    loss: float
    low: float
    high: float


def loss_estimate(gear: SearchedGear, machine: Machine) -> LossEstimate:
    """Estimate the loss of the most likely tooth of a gear.

    Parameters
    ----------
    gear : SearchedGear
        The gear to blame.
    machine : Machine
        Its machine.

    Returns
    -------
    LossEstimate
        Of the likelihood over the logarithm of the loss.
    """
    searched = CubicSpline(np.log(LOSSES), gear.log_likelihood[:, gear.best])(_FINE)
    total = np.log(_blurred(searched, _SEARCHED))
    for harmonic in _harmonics(gear, machine):
        # a line that is out of phase is not the event's alone
        each = harmonic.ratio / (np.abs(harmonic.ratio) * harmonic.noise)
        most = 1.0 / np.sum(1.0 / harmonic.noise) + np.angle(np.sum(each, axis=1)) ** 2
        unsure = np.interp(_FINE, _GRID, most + harmonic.unsure)
        off = _apart(harmonic.mean)
        misfit = 0.5 * (_FREEDOM + 1.0) * np.log1p(off**2 / (_FREEDOM * unsure))
        total -= misfit + 0.5 * np.log(unsure)
    loaded = min(1.0, gear.difference.load)
    chance = _blurred(total, _COMMON / np.sqrt(loaded))
    share = np.cumsum(chance) - 0.5 * chance
    low, middle, high = np.exp(np.interp([0.05, 0.5, 0.95], share / chance.sum(), _FINE)).tolist()
    return LossEstimate(loss=middle, low=low, high=high)


def _blurred(logarithm: FloatArray, deviation: float) -> FloatArray:
    """Likelihood of `_FINE` by its logarithm, once they are that unsure."""
    blur = np.exp(-0.5 * ((_FINE[:, None] - _FINE) / deviation) ** 2)
    return np.asarray((blur / blur.sum(axis=0)) @ np.exp(logarithm - logarithm.max()))


_GRID = np.log(GROWN)


def _apart(ratio: FloatArray) -> FloatArray:
    """Logarithm of damage over each of `_FINE`, by that over what `GROWN` add."""
    # below what is told the logarithms of line and loss go together
    return np.asarray(np.interp(_FINE, _GRID, ratio + _GRID) - _FINE)


class _Harmonic(NamedTuple):
    """What an event adds at a mesh harmonic over what each of `GROWN` losses adds.

    `ratio` has the shape (losses, channels); `noise` is the variance of the logarithm of each
    channel's. `mean` is the logarithm of its size, mean over channels, and `unsure` the variance of
    the logarithm of what is expected of it in all channels, both of shape (losses,).
    """

    ratio: ComplexArray
    noise: FloatArray
    mean: FloatArray
    unsure: FloatArray


def _harmonics(gear: SearchedGear, machine: Machine) -> Iterator[_Harmonic]:
    """Mesh harmonics that tell; none of a set, whose planets bring every line together."""
    difference = gear.difference
    if difference.mesh_lines is None or difference.gear not in ("pinion", "gear"):
        return
    own = gear.response
    sound, grown = grown_lines(machine, own.stage, own.gear, len(own.lines) - 1)
    last = min(len(sound), difference.mesh_power.shape[1]) - 1
    rotation_hz, teeth = gear.rotation_hz, difference.teeth
    delay = np.concatenate(gear.delays) + gear.best / (teeth * rotation_hz)
    sizes = np.abs(grown[:, teeth::teeth])
    sizes = sizes[:, sizes[0] > 0]
    usual = np.median(np.log(sizes / sizes[0]), axis=1) if sizes.size else np.zeros(len(GROWN))
    for band in difference.bands:
        k = band.harmonic
        if k > last or sound[k] * grown[0, k * teeth] == 0:
            continue
        mesh = difference.mesh_lines[:, k]
        turned = grown[:, band.number] * np.exp(-2j * np.pi / teeth * gear.best * band.number)
        value, expected, variance = _at_mesh(band, k * teeth, rotation_hz, delay, turned)
        # more than `mesh_power` is heard where the mesh of another stage stands on the same line
        alone = np.abs(mesh) ** 2 <= 1.001 * difference.mesh_power[:, k]
        heard = alone & (np.abs(value * mesh) > 0)
        if not heard.any():
            continue
        ratio = value[heard] / mesh[heard] * sound[k] / expected[:, heard]
        noise = variance[heard] / np.abs(value[heard]) ** 2
        mean = np.average(np.log(np.abs(ratio)), axis=1, weights=1.0 / noise)
        # what the first of the losses adds over loss / z of the mesh; growth unlike most harmonics'
        correction = np.log(np.abs(teeth * grown[0, k * teeth] / (GROWN[0] * sound[k])))
        odd = _GROWTH * (mean[0] - mean - usual)
        yield _Harmonic(ratio, noise, mean, _LINE**2 + (_RESPONSE * correction) ** 2 + odd**2)


def _at_mesh(
    band: BandDeviation, number: int, rotation_hz: float, delay: FloatArray, grown: ComplexArray
) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Line that an event adds at a mesh harmonic in each channel, by its sidebands; its variance.

    The event is a sum of random impulses at the given delays, of the power that the band has.
    Between them what is told in the same way of the lines `grown`, shape (losses, channels).
    """
    lines = ringing(np.append(band.number, number)[None] * rotation_hz, delay)[0]
    white = lines[:-1] / band.deviation[:, :, None]
    energy = np.abs(band.rest) ** 2
    power = np.maximum(np.mean((energy - 1.0) * band.deviation**2, axis=1), 0.0)
    noise = np.maximum(1.0, _MISFIT * energy.mean(axis=1))
    over = noise / np.maximum(power, 1e-9 * np.mean(band.deviation**2, axis=1))
    turned = white.conj().swapaxes(1, 2)
    inverse = np.linalg.inv(turned @ white + over[:, None, None] * np.eye(len(delay)))
    weight = np.einsum("i,cij,cjl->cl", lines[-1], inverse, turned, optimize=True)
    value = np.sum(weight * band.rest, axis=1)
    expected = grown @ (weight / band.deviation).T
    variance = noise * np.einsum("i,cij,j->c", lines[-1], inverse, lines[-1].conj()).real
    return np.where(power > 0, value, 0.0), expected, variance


def log_caused(gear: SearchedGear, machine: Machine) -> float:
    """Tell how well the mesh harmonics suit damage of the most likely tooth of a gear.

    Parameters
    ----------
    gear : SearchedGear
        The gear.
    machine : Machine
        Its machine.

    Returns
    -------
    float
        Logarithm of the Bayes factor of damage over lines that have nothing to do with the mesh; 0
        where no harmonic tells. Damage is mostly one loss, any being likely, that makes every
        harmonic in each channel in size and phase as computed; else it makes them what the least
        loss would, times one complex factor that nobody knows: teeth may be unlike the computed.
    """
    near = np.abs(_FINE[:, None] - _GRID).argmin(axis=1)
    known, unknown = np.zeros(_FINE.shape), np.zeros(_FACTORS.shape)
    for harmonic in _harmonics(gear, machine):
        unsure, weight = _WIDER**2 * harmonic.unsure, len(harmonic.noise) ** -0.5
        for ratio, noise in zip(harmonic.ratio.T, harmonic.noise, strict=True):
            away = _apart(np.log(np.abs(ratio))) + 1j * np.angle(ratio)[near]
            known += _log_suits(away, np.interp(_FINE, _GRID, noise + unsure))
            unknown += weight * _log_suits(np.log(ratio[0] / _FACTORS), noise + unsure[0])
    computed = np.log(_AS_COMPUTED) + log_mean(known)
    return float(np.logaddexp(computed, np.log1p(-_AS_COMPUTED) + log_mean(unknown.ravel())))


def _log_suits(away: ComplexArray, width: FloatArray) -> FloatArray:
    """Log Bayes factor of lines whose logarithms are so far from those that an event makes."""
    # Student's law of two variables, over that of lines of another cause
    least = 1.0 + np.abs(away) ** 2 / (_FREEDOM * width)
    factor = _NEPERS / width * least ** (-0.5 * _FREEDOM - 1.0)
    return np.asarray(np.log((1.0 - _ASTRAY) * factor + _ASTRAY))


def share_lines(one: SearchedGear, other: SearchedGear) -> bool:
    """Tell whether one gear turns a whole number of times as often as the other.

    Damage of suns and planets stands beside the lines of their turn, which nobody shares.
    """
    if {one.difference.gear, other.difference.gear} & {"sun", "planet"}:
        return False
    slow, fast = sorted((one.difference.order, other.difference.order))
    ratio = fast / slow
    return abs(ratio - round(ratio)) <= 1e-9 * ratio


def most_likely(
    gears: Sequence[SearchedGear], machine: Machine
) -> tuple[SearchedGear, tuple[tuple[SearchedGear, float], ...]]:
    """Choose the gear to blame.

    Parameters
    ----------
    gears : sequence of SearchedGear
        At least one.
    machine : Machine
        Their machine.

    Returns
    -------
    best : SearchedGear
    rivals : tuple of (SearchedGear, float)
        Gears whose patterns show the same event, with the logarithm of the factor by which the best
        explains it better.

    Notes
    -----
    What the mesh harmonics tell of either gear (`log_caused`) decides, and the ratio of their log
    factors. But a damaged tooth of the faster gear meets the same teeth of the slower in every
    turn, and they answer unequally as they are pressed together: where an event comes again at
    those teeth it is the faster gear's, equal or not.
    """

    def lead(one: SearchedGear, other: SearchedGear) -> float:
        base, faster = sorted((one, other), key=lambda gear: gear.difference.order)
        again = base.log_again(round(faster.difference.order / base.difference.order))
        if again > 0:
            return -again if base is one else again
        by_factors = float(np.log(one.log_gear / other.log_gear))
        first, second = (log_caused(gear, machine) for gear in (one, other))
        return first - second + _BY_FACTORS * by_factors

    ranked = sorted(gears, key=lambda gear: -gear.log_gear)
    best = ranked[0]
    rivals: list[tuple[SearchedGear, float]] = []
    for other in ranked[1:]:
        if other.log_gear < _COMPETES:
            break
        if not share_lines(best, other):
            continue
        ahead = lead(best, other)
        if ahead < 0:
            rivals = [(gear, value - ahead) for gear, value in rivals]
            best, other, ahead = other, best, -ahead
        rivals.append((other, ahead))
    return best, tuple(rivals)
