"""What a gear's turn shows beside healthy recordings, without a law: a place, and single sidebands.

A damaged tooth is met once a turn: its response is a short event, spread over many sidebands of
every mesh harmonic, while what load or mounting change is spread over the turn. So what a gear
shows, or what a complex gain for each band (the path to the sensor) leaves of it beside a healthy
recording, is whitened, put back into angle, and its energy over windows of two teeth compared with
their median. A machine's own pitch errors and eccentricities cancel beside a healthy recording.
Without one the other teeth of the same gear are the reference, and nothing cancels: at a
false-alarm probability of 1 % (seen: 1 of 52 machines) a loss of 20 % of one pair's stiffness was
found in 21 of 76 recordings of 52 simulated machines, one of 40 % in 52 of 76.

Eccentricity, or a gear that stands askew, changes the mesh smoothly over the turn of the gear: the
first sidebands of its mesh harmonics grow and those farther away hardly do. Load, gain, noise and
damage of teeth move both alike. So the growth of the first (or second) sidebands is taken over that
of the fourth to sixth, and held against what it does between healthy recordings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.special import gammaincc, gammaln, stdtr

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.diagnosis.law.gear_lines import CONTACT_CENTRE, which_gear
from gearmon.diagnosis.law.machine import channel_gain
from gearmon.diagnosis.law.patterns import GearPattern, turn_energy, turning
from gearmon.diagnosis.results import ToothProfile
from gearmon.signatures.measured.reference import WheelPattern

#: Sidebands this near to a mesh harmonic belong to eccentricity and misalignment, not to one tooth.
NEAR = 3
# A healthy pattern departs from its fit by this share of its amplitude, besides noise.
_DEPARTURE = 0.1
# Healthy departures are not Gaussian noise: their windows scatter like a fraction of the degrees of
# freedom that noise of the same spectrum would have; the teeth of one gear differ from one another
# by their pitch errors. Read off simulated healthy machines, and rounded to the safe side: half of
# it would find 50 instead of 43 of 88 losses of 20 and 40 %, with two false alarms instead of one
# in 44 machines.
_OVERDISPERSION = 9.0
_WINDOW_TEETH = 2.0
_LEAST_LINES, _LEAST_OF_BAND = 8, 4
#: Sidebands that are looked at one by one.
SIDEBANDS = 6
#: A line this many dB or less above its own noise in both recordings says nothing about a gain.
_CLEAR_DB = 6.0
#: Standard error of the level of a line that noise drowns [dB].
_UNHEARD_DB = 10.0 / np.log(10.0) * (1.0 - 1e-9)
# What the growth of a healthy gear scatters by before any is seen [dB], and the gears that this is
# worth. Simulated healthy machines at loads, speeds and gains of their own: 0.75 dB.
PRIOR_DB, PRIOR_WORTH = 1.2, 10.0
#: Its growth with the distance from the nearest healthy state [dB per unit of state]: of healthy
#: pairs of `gearmon.simulation` at loads 0.4 to 0.7 Np lighter 95 % grow by less than 15 dB.
SLOPE_DB = 8.0
# Sidebands held against the first and the second.
_OTHERS = slice(3, 6)
# What growth once or twice a turn away from the mesh is most like.
_KINDS = (("once", "eccentricity"), ("twice", "misalignment"))
_TINY = np.finfo(float).tiny


def locate(wheel: WheelPattern, *, numbered: bool) -> ToothProfile | None:
    """Look for the tooth at which a gear departs from its other teeth.

    Parameters
    ----------
    wheel : WheelPattern
        The gear in the recording.
    numbered : bool
        Whether the recording's angle zero is a tachometer pulse of this gear's own shaft.

    Returns
    -------
    ToothProfile or None
        None if the recording resolves too few sidebands of this gear.

    Notes
    -----
    With n_eff the effective number of lines (participation ratio of their powers), the energy in a
    window of w of z teeth over the median is compared with a gamma law of shape n_eff w / (z v),
    v the overdispersion, and the probability multiplied by z, the number of places.
    """
    departure = _departure(wheel, None, NEAR)
    power = np.sum(np.abs(departure) ** 2, axis=0)
    if np.count_nonzero(power) < _LEAST_LINES:
        return None
    energy = _around(departure, wheel.number, wheel.teeth)
    place = int(np.argmax(energy)) / len(energy)
    ratio = float(energy.max())
    effective = float(power.sum() ** 2 / max(float(np.sum(power**2)), _TINY))
    # channels are not counted: what departs on a healthy machine is heard by all of them
    shape = max(effective * _WINDOW_TEETH / wheel.teeth / _OVERDISPERSION, 0.5)
    return ToothProfile(
        **which_gear(wheel),
        energy=_by_tooth(energy, wheel.teeth),
        tooth=round(place * wheel.teeth - CONTACT_CENTRE) % wheel.teeth + 1 if numbered else None,
        position=place,
        ratio=ratio,
        log10_probability=min(0.0, _log10_gamma(shape, ratio) + float(np.log10(wheel.teeth))),
        against="other teeth",
    )


def departure_energy(new: WheelPattern, old: WheelPattern, near: int = NEAR) -> FloatArray:
    """Return the energy of a departure from a healthy recording around a gear's turn, by tooth.

    Parameters
    ----------
    new, old : WheelPattern
        Of the new recording and of the healthy one, at the same angle: the same lines.
    near : int
        Sidebands about each mesh harmonic that are left out on both sides.

    Returns
    -------
    ndarray of float, shape (teeth,)
        Over windows of two teeth, median 1.

    Notes
    -----
    About each mesh harmonic one complex gain per channel is fitted; the rest is divided by the
    scatter to expect, that is noise and a tenth of the amplitude.
    """
    energy = _by_tooth(_around(_departure(new, old, near), new.number, new.teeth), new.teeth)
    middle = float(np.median(energy))
    return np.asarray(energy / middle if middle > 0 else np.ones(new.teeth))


def aligned(
    new: WheelPattern, old: WheelPattern, *, same_zero: bool = False
) -> tuple[WheelPattern, WheelPattern]:
    """Return the lines that two recordings share of a gear, the second turned to the first.

    Parameters
    ----------
    new, old : WheelPattern
        In the same channels.
    same_zero : bool
        Whether both count from the same pulse: then nothing needs to be turned.
    """
    common = np.intersect1d(new.number, old.number)
    one, two = (own.only(np.isin(own.number, common)) for own in (new, old))
    if same_zero or not len(common):
        return one, two
    top = int(common[-1])
    angle = turning(GearPattern.of(two, top), GearPattern.of(one, top), new.teeth)
    return one, replace(two, amplitude=two.amplitude * np.exp(2j * np.pi * angle * common))


def _departure(new: WheelPattern, old: WheelPattern | None, near: int) -> ComplexArray:
    """Whitened departure of a gear's lines, 0 where none counts, shape (channels, lines)."""
    band = (new.number + new.teeth // 2) // new.teeth
    member = ((band[:, None] == np.unique(band)) & ~new.mesh[:, None]).astype(float)
    # a gain fitted to three lines leaves nothing of them, and about the mean is no mesh harmonic
    member = member[:, (member.sum(axis=0) >= _LEAST_OF_BAND) & (np.unique(band) > 0)]
    usual = np.abs(new.amplitude) ** 2 @ (member / member.sum(axis=0)) @ member.T
    spread = new.variance + _DEPARTURE**2 * usual
    rest = new.amplitude
    if old is not None:
        power = np.abs(old.amplitude) ** 2 @ member
        gain = (new.amplitude * old.amplitude.conj()) @ member / np.maximum(power, _TINY)
        rest = rest - (gain @ member.T) * old.amplitude
        spread = spread + old.variance
    counted = (member.sum(axis=1) > 0) & (np.abs(new.number - band * new.teeth) > near)
    return np.where(counted, rest / np.sqrt(np.maximum(spread, _TINY)), 0.0)


def _around(departure: ComplexArray, number: NDArray[np.int64], teeth: int) -> FloatArray:
    """Energy in windows of two teeth about places of the turn, over that of the median place."""
    steps = 1 << int(np.ceil(np.log2(4 * number.max(initial=1))))
    energy = turn_energy(departure, number, steps)
    width = max(1, round(steps * _WINDOW_TEETH / teeth))
    windows = np.maximum(uniform_filter1d(energy, width, mode="wrap"), 0.0)
    return np.asarray(windows / max(float(np.median(windows)), _TINY))


def _by_tooth(energy: FloatArray, teeth: int) -> FloatArray:
    """Energies about the places where teeth enter contact."""
    return np.asarray(energy[np.rint(np.arange(teeth) / teeth * len(energy)).astype(int)])


def _log10_gamma(shape: float, ratio: float) -> float:
    """log10 of the probability that a gamma variable of unit mean exceeds a ratio."""
    argument = shape * ratio
    value = float(gammaincc(shape, argument))
    if value > 1e-280:
        return float(np.log10(value))
    # leading term of the asymptotic series, for scores that go on rising
    natural = (shape - 1) * np.log(argument) - argument - float(gammaln(shape))
    return float(natural / np.log(10))


#: Of gears by stage and name: changes of the lines 1 ... 6 turns of the gear away from the mesh
#: harmonics, freed of the gain of the channels and beyond what the mesh harmonic between them rose
#: by, shape (6,) [dB].
Sidebands = Mapping[tuple[int, str], FloatArray]
_Wheels = Sequence[WheelPattern]


def turn_changes(wheels: _Wheels, healthy: Sequence[_Wheels]) -> Sidebands:
    """Compare single sidebands of every gear with those of healthy recordings.

    Parameters
    ----------
    wheels : sequence of WheelPattern
        Gears of the new recording.
    healthy : sequence of sequences of WheelPattern
        Gears of each healthy recording, at least one, in the same channels.

    Returns
    -------
    mapping of (int, str) to ndarray of float, shape (6,)
        Of each gear that all recordings resolve.

    Notes
    -----
    The power of the lines on both sides, less their variance and never below it, is compared in
    decibels, mesh harmonic by mesh harmonic and channel by channel; the median of the clear ones in
    a channel is its gain. Sidebands modulate their mesh harmonic: what a heavier load or worn teeth
    add to it comes back in them, in proportion, and is no growth of theirs. Means are weighted by
    ``1/(scatter^2 + 1 dB^2)``; lines below the noise in all recordings, or risen into it, count as
    unchanged. No alignment is needed.
    """
    found: dict[tuple[int, str], tuple[FloatArray, FloatArray]] = {}
    for wheel in wheels:
        known = [own for patterns in healthy if (own := wheel.same_in(patterns))]
        if len(known) < len(healthy) or not known:
            continue
        tops = [int(own.number.max(initial=0)) for own in (wheel, *known)]
        harmonics = (min(tops) - SIDEBANDS) // wheel.teeth
        if harmonics < 1:
            continue
        new_db, new_scatter = _levels(wheel, harmonics)
        old_db, old_scatter = np.mean([_levels(own, harmonics) for own in known], axis=0)
        # a line that noise drowns tells of the noise, not of the gear, unless it has fallen so far
        unheard = (old_scatter >= _UNHEARD_DB**2) | (new_db > old_db)
        change = np.where(unheard & (new_scatter >= _UNHEARD_DB**2), np.nan, new_db - old_db)
        found[wheel.stage, wheel.gear] = change, np.sqrt(new_scatter + old_scatter)
    if not found:
        return {}
    # the gain of each channel is the median change of its clear lines
    limit = 10 / np.log(10) * 10 ** (-_CLEAR_DB / 20) * np.sqrt(2)
    clear = [np.where(spread < limit, change, np.nan)[..., 1:] for change, spread in found.values()]
    rows = np.concatenate([own.reshape(len(own), -1) for own in clear], axis=1)
    gain = np.nan_to_num(channel_gain(rows))[:, None, None]
    grown = {}
    for gear, (change, spread) in found.items():
        # the mesh harmonic is the first column
        mesh, sides = np.split(change - gain, [1], axis=2)
        beyond = np.clip(sides - np.maximum(np.nan_to_num(mesh), 0.0), -30.0, 30.0)
        weight = 1.0 / (spread[..., 1:] ** 2 + 1.0)
        grown[gear] = np.average(np.nan_to_num(beyond), axis=(0, 1), weights=weight)
    return grown


def _levels(wheel: WheelPattern, harmonics: int) -> tuple[FloatArray, FloatArray]:
    """Levels by channel, mesh harmonic and distance from it, 0 to 6, and their variances."""
    lines = GearPattern.of(wheel, int(wheel.number.max()))
    power, variance = np.abs(lines.amplitude[0]) ** 2, lines.variance[0]
    usable = lines.usable[0].copy()
    centre = wheel.teeth * np.arange(1, harmonics + 1)
    usable[centre] = True
    sides = np.multiply.outer([-1, 1], np.arange(SIDEBANDS + 1))
    place = np.maximum(centre[:, None] + sides[:, None], 0)
    total, noise = (np.sum(usable[place] * each[:, place], axis=1) for each in (power, variance))
    noise = np.maximum(noise, _TINY)
    clean = np.maximum(total - noise, noise)
    scatter = 10 / np.log(10) * np.minimum(np.sqrt(2 * noise / clean), 1.0)
    # lines that do not exist, such as those of another mesh, carry no weight
    scatter = np.where(total > _TINY, scatter, 1e3)
    return 10 * np.log10(clean), scatter**2


class RunoutGrowth:
    """Growth of the sidebands of one gear that are once or twice a turn away from the mesh.

    Parameters
    ----------
    key : (int, str)
        Stage, from 1, and gear.
    change : ndarray of float, shape (6,)
        Changes of its sidebands, see `turn_changes` [dB].
    sigma_db : float
        Standard deviation of the growth on a healthy machine [dB].
    worth : float
        Degrees of freedom of that.
    places : int
        How many such growths are looked at.

    Attributes
    ----------
    stage, gear, sigma_db
        As given.
    kind : str
        What it is most like.
    change_db, others_db : float
        Change of these sidebands, and of the fourth to sixth [dB].
    log10_probability : float
        Logarithm of the probability that any gear of a healthy machine shows as much.
    evidence : tuple of str
        Sentences that can be checked on the pictures.
    """

    def __init__(
        self, key: tuple[int, str], change: FloatArray, sigma_db: float, worth: float, places: int
    ) -> None:
        (self.stage, self.gear), self.sigma_db = key, sigma_db
        contrast = _contrast(change)
        first = int(np.argmax(contrast))
        self.change_db, self.others_db = float(change[first]), float(np.mean(change[_OTHERS]))
        chance = places * max(float(stdtr(worth, -contrast[first] / sigma_db)), 1e-300)
        self.log10_probability = min(0.0, float(np.log10(chance)))
        once, self.kind = _KINDS[first]
        self.evidence = (
            f"sidebands {once} the rotation of the {self.gear} of stage {self.stage} away from the "
            f"mesh harmonics changed by {self.change_db:+.1f} dB, those four to six turns away by "
            f"{self.others_db:+.1f} dB; scatter {sigma_db:.1f} dB",
        )


def runout_growth(
    sidebands: Sidebands, healthy: Sequence[Sidebands] = (), gap: float = 0.0
) -> tuple[RunoutGrowth, ...]:
    """Judge how far the first and second sidebands of every gear have grown.

    Parameters
    ----------
    sidebands : mapping of (int, str) to ndarray of float, shape (6,)
        Of the new recording against all healthy ones, see `turn_changes`.
    healthy : sequence of such mappings
        Of each healthy recording against the others, see `healthy_turns`.
    gap : float, >= 0
        Distance of the new recording's operating state to the nearest healthy one's.

    Returns
    -------
    tuple of RunoutGrowth
        One a gear, most striking first.

    Notes
    -----
    The growth is ``change[q] - max(mean change[4..6], 0)``, q = 1 or 2. Its square among healthy
    recordings joins a prior of 1.2 dB that ten gears are worth; growth over that standard deviation
    follows Student's law of as many degrees of freedom. The probability is multiplied by two for
    each gear looked at.
    """
    seen = [_contrast(change) for others in healthy for change in others.values()]
    # gears of one recording move together: they count as one
    worth = PRIOR_WORTH + len(healthy)
    square = PRIOR_WORTH * PRIOR_DB**2
    square += len(healthy) * float(np.mean(np.square(seen))) if seen else 0.0
    sigma = float(np.sqrt(square / worth + (SLOPE_DB * gap) ** 2))
    places = 2 * len(sidebands)
    found = (RunoutGrowth(key, own, sigma, worth, places) for key, own in sidebands.items())
    return tuple(sorted(found, key=lambda growth: growth.log10_probability))


def healthy_turns(healthy: Sequence[_Wheels]) -> tuple[Sidebands, ...]:
    """Compare each healthy recording with the others.

    Parameters
    ----------
    healthy : sequence of sequences of WheelPattern
        Gears of each healthy recording.

    Returns
    -------
    tuple of mappings
        One for each recording, see `turn_changes`; none if there is but one.
    """
    others = ([*healthy[:place], *healthy[place + 1 :]] for place in range(len(healthy)))
    return tuple(filter(None, map(turn_changes, healthy, others)))


def _contrast(change: FloatArray) -> FloatArray:
    """Growth of the first and the second sidebands beyond that of farther ones [dB]."""
    return np.asarray(change[:2] - max(float(np.mean(change[_OTHERS])), 0.0))
