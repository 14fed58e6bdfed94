"""Damage of one tooth against a healthy reference: where, how much, how sure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.coherent import coherent_difference
from gearmon.diagnosis.localisation import CONTACT_CENTRE
from gearmon.diagnosis.matched import LOSSES, ToothMatch
from gearmon.diagnosis.noticeable import needed_factor, noticed_from
from gearmon.diagnosis.results import ToothProfile
from gearmon.diagnosis.tooth_search import (
    LossEstimate,
    SearchedGear,
    log_evidence,
    loss_estimate,
    most_likely,
    search_gear,
    share_lines,
)
from gearmon.errors import ArgumentError
from gearmon.machine import Machine
from gearmon.signatures.reference import Profile, WheelPattern
from gearmon.signatures.tooth_response import tooth_response

FloatArray = NDArray[np.float64]

# Misfit beside the blamed tooth below which departures are noise and the matched search is
# believed, and above which the healthy patterns plainly do not fit: then teeth differ by more than
# noise, and only the search by energy knows how much. Of sound simulated machines one in twenty
# exceeds the first.
_NOISE_UP_TO, _NO_NOISE_FROM = 1.1, 1.5
# Healthy pairs of simulated machines, loads, speeds and gains changed, exceed a Bayes factor B with
# a probability of about (B / B_0)^-s; theory bounds it by 1/B.
_LOG_FACTOR, _SLOPE = -1.5, 1.0
# Where a factor is worth asking how much healthy recordings differ from one another, and how many
# are asked at most.
_ASKED_FROM, _ASKED = 2.0, 6
# Losses are not told apart more finely.
_LEAST_SIGMA = 0.005
# Logarithm of odds against damage that are as good as any larger.
_NEVER = 600.0
# Width of a 90 % interval in standard deviations.
_NORMAL_90 = 3.29


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothFinding:
    """The tooth whose damage explains a departure best.

    Parameters
    ----------
    best : SearchedGear
        The gear to blame.
    tooth : int
        Its tooth, from 1.
    counted_from : {"tacho", "reference"}
        Teeth are counted from the one that enters mesh at the tachometer pulse, or about where the
        (first) healthy recording begins.
    position : float
        Middle of the tooth's contact in turns of the gear after the recording's own angle zero.
    loss : LossEstimate
        Loss of stiffness of its pair.
    log10_probability : float
        Logarithm of the probability that a healthy machine shows as much on any tooth.
    trust : float, in [0, 1]
        Share of it that the matched search decides; the rest is the search by energy. 1 where
        healthy recordings were asked, else see `trust_in_noise`.
    rivals : tuple of (str, int, float)
        Gear and stage of others whose patterns show it too, and the logarithm of the factor by
        which the best explains it better.
    searched : tuple of SearchedGear
        All gears looked at.
    among : tuple of float
        Logarithms of the Bayes factor of damage of healthy recordings, each against the others;
        empty where none were asked.
    """

    best: SearchedGear
    tooth: int
    counted_from: str
    position: float
    loss: LossEstimate
    log10_probability: float
    trust: float
    rivals: tuple[tuple[str, int, float], ...]
    searched: tuple[SearchedGear, ...]
    among: tuple[float, ...] = ()


def false_alarm_log10(log_factor: float) -> float:
    """log10 of the probability that a healthy machine reaches a Bayes factor of damage.

    Parameters
    ----------
    log_factor : float
        Natural logarithm of the factor.

    Returns
    -------
    float
        At most 0.
    """
    return min(0.0, -_SLOPE * (log_factor - _LOG_FACTOR) / float(np.log(10.0)))


def false_alarm_among(log_factor: float, healthy: Sequence[float]) -> float:
    """log10 of the probability that a healthy machine reaches a factor, known what others reached.

    Parameters
    ----------
    log_factor : float
        Natural logarithm of the Bayes factor of damage.
    healthy : sequence of float
        The same of healthy recordings of this machine, each against the others. At other loads the
        teeth of a machine with errors depart one by one, far beyond noise.

    Returns
    -------
    float
        At most 0; that of `false_alarm_log10` if there are none.

    Notes
    -----
    The excess x = ln B - ln B_0 is taken as exponential with an unknown mean of no preferred
    size, at least about the 1 of simulated machines. With n healthy excesses x_i >= 1, the mean
    integrated out, P(x) = (1 + x / sum x_i)^-n.
    """
    if not healthy:
        return false_alarm_log10(log_factor)
    excess = [max(1.0, other - _LOG_FACTOR) for other in healthy]
    share = max(0.0, log_factor - _LOG_FACTOR) / sum(excess)
    return -len(excess) * float(np.log10(1.0 + share))


def trust_in_noise(misfit: float) -> float:
    """Share of the matched search in the decision.

    Parameters
    ----------
    misfit : float
        Mean square of a departure beside its best tooth over that of noise.

    Returns
    -------
    float
        1 where the healthy patterns fit to within noise, 0 where they do not.
    """
    return float(np.interp(misfit, [_NOISE_UP_TO, _NO_NOISE_FROM], [1.0, 0.0]))


def find_tooth(
    own: Profile,
    rows: Sequence[int],
    healthy: Sequence[Profile],
    healthy_rows: Sequence[int],
    machine: Machine,
    profiles: Sequence[ToothProfile] = (),
) -> ToothFinding | None:
    """Look for damage of one tooth on all gears of parallel stages.

    Parameters
    ----------
    own : Profile
        The new recording, condensed.
    rows : sequence of int
        Its channels to use.
    healthy : sequence of Profile
        Healthy recordings, at least one.
    healthy_rows : sequence of int
        The same channels there.
    machine : Machine
        The machine.
    profiles : sequence of ToothProfile
        What the search by energy found on the same gears.

    Returns
    -------
    ToothFinding or None
        None if no gear can be searched.
    """
    searched = tuple(_searched(own, rows, healthy, healthy_rows, machine))
    if not searched:
        return None
    best, rivals = most_likely(searched)
    factor = log_evidence(searched)
    among: tuple[float, ...] = ()
    if factor > _ASKED_FROM:
        among = _healthy_factors(healthy, healthy_rows, machine)
    # healthy recordings that misfit each other tell better what a misfit makes than any rule
    trust = 1.0 if among else trust_in_noise(_misfit(best, searched))
    by_energy = min((profile.log10_probability for profile in profiles), default=0.0)
    by_energy = min(0.0, by_energy + float(np.log10(max(1, len(profiles)))))
    matched = false_alarm_among(factor, among)
    numbered = _numbered(own, healthy, best.match.order)
    tooth, position = _place(best, numbered)
    return ToothFinding(
        best=best,
        tooth=tooth,
        counted_from="tacho" if numbered else "reference",
        position=position,
        loss=loss_estimate(best, own.speed_hz),
        log10_probability=trust * matched + (1.0 - trust) * by_energy,
        trust=trust,
        among=among,
        rivals=tuple((gear.match.gear, gear.match.stage, lead) for gear, lead in rivals),
        searched=searched,
    )


def _searched(
    own: Profile,
    rows: Sequence[int],
    healthy: Sequence[Profile],
    healthy_rows: Sequence[int],
    machine: Machine,
) -> Iterator[SearchedGear]:
    for wheel in own.wheels:
        pairs = [(profile, _same(wheel, profile)) for profile in healthy]
        same = [(profile, pattern) for profile, pattern in pairs if pattern is not None]
        if not same:
            continue
        difference = coherent_difference(
            wheel,
            rows,
            [pattern for _, pattern in same],
            healthy_rows,
            same_zero=_numbered(own, healthy, wheel.order),
            moved=[own.speed_hz / profile.speed_hz - 1.0 for profile, _ in same],
        )
        if difference is None:
            continue
        top = max(int(band.number[-1]) for band in difference.bands) + wheel.teeth
        try:
            response = tooth_response(machine, wheel.stage, wheel.gear, top * wheel.order)
        except ArgumentError:
            continue  # planetary sets have no template yet
        found = search_gear(difference, response, own.speed_hz)
        if found is not None:
            yield found


def _healthy_factors(
    healthy: Sequence[Profile], rows: Sequence[int], machine: Machine
) -> tuple[float, ...]:
    """Evidence of damage in healthy recordings, some of them, each against all others."""
    if len(healthy) < 2:
        return ()
    chosen = np.unique(np.linspace(0, len(healthy) - 1, _ASKED).round().astype(int))
    found = []
    for row in chosen:
        others = [*healthy[:row], *healthy[row + 1 :]]
        searched = tuple(_searched(healthy[row], rows, others, rows, machine))
        if searched:
            found.append(log_evidence(searched))
    return tuple(found)


def _same(wheel: WheelPattern, profile: Profile) -> WheelPattern | None:
    for other in profile.wheels:
        if (other.stage, other.gear, other.teeth) == (wheel.stage, wheel.gear, wheel.teeth):
            return other
    return None


def _numbered(own: Profile, healthy: Sequence[Profile], order: float) -> bool:
    """Whether all recordings count the turns of this gear from the same tachometer pulse.

    The tachometer's zero is that of shaft 1: other shafts stand anywhere when it comes.
    """
    return own.tacho and abs(order - 1.0) < 1e-12 and all(profile.tacho for profile in healthy)


def _misfit(best: SearchedGear, searched: Sequence[SearchedGear]) -> float:
    """Largest misfit of the best gear and of those that hear its damage as one event a turn.

    In the others' patterns a large event is spread around the turn, and is no sign of bad fit.
    """
    return max(g.match.misfit for g in searched if g is best or share_lines(g, best))


def _place(best: SearchedGear, numbered: bool) -> tuple[int, float]:
    """Tooth, counted from 1, and the middle of its contact in turns after the angle zero."""
    teeth, index = best.match.teeth, best.match.best
    entry = index + (0.0 if numbered else _between(best.match.log_place, index))
    position = (entry + CONTACT_CENTRE) / teeth % 1.0
    if numbered:
        return index + 1, position
    return round(entry + best.difference.shift_turns * teeth) % teeth + 1, position


def _between(log_place: FloatArray, index: int) -> float:
    """Place of the maximum of a parabola through the best tooth and its neighbours."""
    before, here, after = log_place[[index - 1, index, (index + 1) % len(log_place)]]
    bend = 2.0 * here - before - after
    return float(np.clip(0.5 * (after - before) / bend, -0.5, 0.5)) if bend > 0 else 0.0


def with_finding(
    profiles: Sequence[ToothProfile], finding: ToothFinding | None, log10_limit: float
) -> tuple[ToothProfile, ...]:
    """Put what the matched search found into the profiles of the gears.

    Parameters
    ----------
    profiles : sequence of ToothProfile
        One a gear, of the energy of its departure.
    finding : ToothFinding or None
        What was found.
    log10_limit : float
        log10 of the false-alarm probability below which the search calls a fault.

    Returns
    -------
    tuple of ToothProfile
        With tooth, position, probability, losses by tooth and the loss that would have been noticed
        of the matched search where it looked.
    """
    if finding is None:
        return tuple(profiles)
    needed = needed_factor(lambda factor: false_alarm_among(factor, finding.among), log10_limit)
    by_gear = {(gear.match.stage, gear.match.gear): gear for gear in finding.searched}
    return tuple(
        _with_match(profile, by_gear[profile.stage, profile.gear], finding, needed)
        if (profile.stage, profile.gear) in by_gear
        else profile
        for profile in profiles
    )


def _with_match(
    profile: ToothProfile, gear: SearchedGear, finding: ToothFinding, needed: float
) -> ToothProfile:
    numbered = profile.tooth is not None
    tooth, position = _place(gear, numbered)
    loss, sigma = losses_by_tooth(gear.match)
    if gear is finding.best and 2 * loss[gear.match.best] > loss.sum():
        # one answer for flag and history: the search for damage takes sizes too small
        told = finding.loss
        loss[gear.match.best] = told.loss
        sigma[gear.match.best] = (told.high - told.low) / _NORMAL_90
    factor = gear.match.log_gear - float(np.log(len(finding.searched)))
    matched = false_alarm_among(factor, finding.among)
    matched = finding.trust * matched + (1.0 - finding.trust) * profile.log10_probability
    if not numbered:
        turned = np.roll(np.arange(profile.teeth), tooth - 1 - gear.match.best)
        loss, sigma = loss[turned], sigma[turned]
    return replace(
        profile,
        tooth=tooth,
        counted_from="tacho" if numbered else "reference",
        position=position,
        log10_probability=matched,
        loss_by_tooth=loss,
        loss_sigma_by_tooth=sigma,
        noticed_from=noticed_from(gear.match, needed, len(finding.searched)),
    )


def losses_by_tooth(match: ToothMatch) -> tuple[FloatArray, FloatArray]:
    """Estimate the loss of every tooth of a gear.

    Parameters
    ----------
    match : ToothMatch
        The gear.

    Returns
    -------
    loss, sigma : ndarray of float, shape (teeth,)
        Mean and standard deviation of the loss, damage of one tooth at most and of none held
        equally likely beforehand, and given damage all losses. A large event is heard by the teeth
        beside it too; they are not blamed for it.
    """
    likelihood = np.exp(match.log_likelihood - match.log_likelihood.max(axis=0))
    chance = likelihood * LOSSES[:, None]  # losses stand at equal ratios
    chance /= chance.sum(axis=0)
    mean = LOSSES @ chance
    spread = np.sqrt(np.maximum(LOSSES**2 @ chance - mean**2, 0.0))
    damaged = np.exp(match.log_place - match.log_place.max())
    damaged /= damaged.sum() * (1.0 + np.exp(min(-match.log_gear, _NEVER)))
    least = np.maximum(spread, np.maximum(0.1 * mean, _LEAST_SIGMA))
    sigma: FloatArray = np.sqrt(least**2 + damaged * (1.0 - damaged) * mean**2)
    return damaged * mean, sigma
