"""Damage of one tooth: which gear and which tooth, and how much of it is believed.

Every gear is searched (`tooth_match`); the one is blamed whose mesh harmonics suit the event best,
and they tell its size (`mesh_harmonics`). What could be measured, the depth of a crack, follows
from the loss by the teeth's stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
from scipy.ndimage import convolve1d

from gearmon.arrays import FloatArray
from gearmon.diagnosis.hypotheses import mesh_harmonics
from gearmon.diagnosis.hypotheses.mesh_harmonics import LossEstimate, share_lines
from gearmon.diagnosis.hypotheses.several_teeth import DepartureSpread, departure_spread
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES, SearchedGear, search_gear
from gearmon.diagnosis.law.gear_lines import CONTACT_CENTRE, FULL_LOAD, GearDeviation
from gearmon.diagnosis.law.machine import MachineDeviation
from gearmon.errors import ArgumentError, GearmonError
from gearmon.gears import damage, faults, tooth_pairs
from gearmon.gears.kinematics import kinematics
from gearmon.gears.pairs import mesh_pairs
from gearmon.machine import Machine, PlanetaryStage
from gearmon.signatures.expected.tooth_response import (
    ToothResponse,
    tooth_response,
    with_floating_sun,
)
from gearmon.signatures.measured.reference import Profile

# The likelihood takes the law at its word, line by line. What departs on a healthy machine, beyond
# noise, departs by teeth: energies about single teeth scatter like gamma variables of this shape.
# Single references of five simulated machines, loads up to a factor of 2.5 apart: 61 of 162 healthy
# pairs were called faults without it, 5 are with it (loads below two thirds of the reference's),
# one instead of 12 of 63 with three references. Where healthy ones stayed healthy before, it costs
# one of the 36 losses of 15 % that were found.
_TEETH_SCATTER = 2.0
# The same for energies along what damage would add, for each direction that tells of them: what
# departs elsewhere hides damage less there. Of 570 healthy pairs (51 machines of two simulators,
# a real rig) the one in a hundred that is believed most reads 10 to 12 with and without it (a fault
# is 26); with a quarter instead of a sixth the rig's reach 18. Of 96 cracks of 30 % of a lightly
# loaded simulated rig 33 are found, 27 without it.
_DIRECTIONS_SCATTER = 1.0 / 6.0
# Growth of the inverse of that shape with each neper by which the load is lighter than all that
# were learned, over its value: pairs of teeth that are off lose their contact one by one. At loads
# 0.1 to 0.7 Np lighter the largest energy over the median is up to 19 and 28 on two of fourteen
# machines of three simulators (90 % points), 10 on a third and 6 elsewhere; of 32 such pairs of
# eight of them 4 were called faults, none is with it, with the slopes of levels and runout.
_LIGHTER_SCATTER = 5.0
# Healthy departures scatter like noise with a fraction of its degrees of freedom.
_OVERDISPERSION = 3.0
# Lines that a band must keep to tell of a meeting with every planet.
_LEAST_LINES = 4
# Share of departures from which on noise alone is left.
_NOISE_ALONE = 1e-9
# Losses are not told apart more finely.
_LEAST_SIGMA = 0.005
# Logarithm of odds against damage that are as good as any larger.
_NEVER = 600.0
# Power of a mesh harmonic over that of the lines about it from which it stands out of them. Of two
# drawn machines whose first stage, helical, is so quiet that a loss of 40 % moves nothing by a
# hundredth, 18 to 33 % of the larger gear's harmonics do, of 14 others 71 % and more.
_FAR_STRONGER = 10.0
# Ratios of mesh orders at which harmonics are looked for that fall together.
_FINEST_RATIO = 40
# Share of the strongest gear's evidence from which another may be to blame.
_COMPETES = 0.1
# Share of its likelihood from which one with the same lines may be: where the pinion of the next
# stage is damaged, gears on its shaft have up to 1.5 times as much, those beside it a fifth.
_AS_LOUD = 0.5
# Width of a 90 % interval in standard deviations.
_NORMAL_90 = 3.29


@dataclass(eq=False)
class GearEvidence:
    """What speaks for damage of one tooth of a gear.

    Parameters
    ----------
    deviation : GearDeviation
        The gear's deviation from the healthy law.
    search : SearchedGear or None
        The matched search of its teeth; None where there is no template of the response: of a
        planetary set whose file says too little.
    shown : bool
        Whether the gear's mesh is heard by itself (`mesh_shown`).
    instead : SearchedGear, optional
        The less likely search of a set of which nothing tells whether its sun floats.

    Attributes
    ----------
    key : tuple of (int, str)
        Stage and gear.
    tooth : int
        The tooth that is most likely damaged, from 0, as the recording counts them.
    counted_from : {"tacho", "reference"}
        Where teeth are counted from in all recordings: from the one that enters mesh at the
        tachometer pulse, or from about where the first healthy recording begins.
    place : tuple of (int, float)
        That tooth, so counted, from 1, and the middle of its contact in turns after the angle zero.
    log_factor, believed : float
        Logarithm of the Bayes factor of damage of some tooth against none, and as far as it is
        believed. Without a template that of an event of unknown form: the likelihood ratio of the
        energy at the best tooth, as a gamma variable, over the teeth that it may be.
    """

    deviation: GearDeviation
    search: SearchedGear | None
    shown: bool = True
    instead: SearchedGear | None = None

    def __post_init__(self) -> None:
        """Tell the tooth, and how much is believed."""
        deviation, search, teeth = self.deviation, self.search, self.deviation.teeth
        self.key = (deviation.stage, deviation.gear)
        self.counted_from = "tacho" if deviation.same_zero else "reference"
        shift = 0.0
        if search is None:
            self.tooth, matched = int(np.argmax(deviation.by_tooth)), (1.0, 0.0)
            # the meetings of one turn depart together on a healthy machine, too: however many there
            # are, the largest mean over them scatters as one of them would
            shape = max(0.5, 2.0 * deviation.lines / teeth / _OVERDISPERSION)
            self.log_factor = self._of_gamma(shape, deviation.peak)
        else:
            self.tooth, self.log_factor = search.best, search.log_gear
            matched = search.matched_event
            # the maximum of a parabola through the best tooth and its neighbours
            told = np.take(search.log_place, self.tooth + np.arange(-1, 2), mode="wrap")
            bend = -np.diff(told, 2)[0]
            if bend > 0 and not deviation.same_zero:
                shift = float(np.clip(0.5 * (told[2] - told[0]) / bend, -0.5, 0.5))
        entry = self.tooth + shift
        turned = 0.0 if deviation.same_zero else deviation.shift_turns * teeth
        self.place = round(entry + turned) % teeth + 1, (entry + CONTACT_CENTRE) / teeth % 1.0
        self.believed = self.believes(self.log_factor, deviation.peak, *matched)

    @property
    def mesh_stands_out(self) -> bool:
        """Whether most mesh harmonics are far stronger than the median line about them."""
        own, told = self.deviation, []
        for band in own.bands:
            if band.harmonic < own.mesh_power.shape[1]:
                between = band.number != own.teeth * band.harmonic
                usual = np.median(np.abs(band.pattern * band.deviation)[:, between] ** 2, axis=1)
                told.append(own.mesh_power[:, band.harmonic] > _FAR_STRONGER * usual)
        return not told or bool(np.mean(told) > 0.5)

    @property
    def load_unlearned(self) -> bool:
        """Whether nothing tells what the load changes: teeth loaded lightly, one reference."""
        return self.deviation.load < FULL_LOAD and not len(self.deviation.bands[0].known)

    @cached_property
    def spread(self) -> DepartureSpread | None:
        """How far the departure is one tooth's; None without a template."""
        return departure_spread(self.search) if self.search is not None else None

    def believes(self, log_factor: float, peak: float, matched: float, directions: float) -> float:
        """Return how much is believed of a log Bayes factor.

        Parameters
        ----------
        log_factor : float
            By the likelihood.
        peak : float
            Energy at the tooth over that of the median.
        matched, directions : float
            The same along what damage would add, and in how many directions.

        Returns
        -------
        float
            At most what the energy at one tooth, beyond noise, tells among teeth that all depart.
        """
        departs = max(self.deviation.departs, _NOISE_ALONE)
        sure = 1.0 / (1.0 + _LIGHTER_SCATTER * self.deviation.light)
        if self.deviation.mesh_lines is None:
            # what planets add is known less: 14 instead of 9 of 192 losses read `healthy` with it
            directions = 0.0
        by_teeth = self._of_gamma(sure * _TEETH_SCATTER, 1.0 + max(0.0, peak - 1.0) / departs)
        along = self._of_gamma(sure * _DIRECTIONS_SCATTER * directions, max(matched, 1.0))
        return min(log_factor, max(by_teeth, along)) if log_factor > 0 else log_factor

    def _of_gamma(self, shape: float, peak: float) -> float:
        """Log likelihood ratio of the largest of gamma variables, the tooth unknown."""
        teeth = self.deviation.teeth / self.deviation.meetings
        return float(shape * (peak - 1.0 - np.log(peak)) - np.log(max(1.0, teeth)))


class ToothFinding:
    """The tooth whose damage explains a deviation best.

    Parameters
    ----------
    searched : sequence of GearEvidence
        All gears looked at, at least one.
    machine : Machine
        The machine.

    Attributes
    ----------
    searched, machine
        As given.
    best : GearEvidence
        The gear to blame.
    evidence : float
        The logarithm of the Bayes factor that is believed, largest of all gears.
    rivals : tuple of (str, int, float)
        Gear and stage of others whose patterns show it too, and the logarithm of the factor by
        which the best explains it better.
    """

    def __init__(self, searched: Sequence[GearEvidence], machine: Machine) -> None:
        self.searched, self.machine = tuple(searched), machine
        self.best = first = max(searched, key=lambda one: one.believed)
        self.evidence, rivals = first.believed, list[tuple[str, int, float]]()
        # those with a template compete by what either should sound like
        if first.search is not None and first.believed > 0.0:
            # a gear whose evidence is hardly believed does not compete, however loud it is, unless
            # it has its lines in common with the first: what stands out in the turn of one does in
            # either's
            competing = []
            for one in searched:
                sure = one.believed >= _COMPETES * first.believed
                loud = one.log_factor >= _AS_LOUD * first.log_factor
                if one.search and (sure or (loud and share_lines(one.search, first.search))):
                    competing.append(one.search)
            blamed, others = mesh_harmonics.most_likely(competing, machine)
            self.best = next(one for one in searched if one.search is blamed)
            rivals += [(g.difference.gear, g.difference.stage, lead) for g, lead in others]
        self.rivals = tuple(rivals)

    @cached_property
    def loss(self) -> LossEstimate | None:
        """Loss of stiffness of its pair; None without a template."""
        search = self.best.search
        return mesh_harmonics.loss_estimate(search, self.machine) if search is not None else None


def find_tooth(own: Profile, deviation: MachineDeviation, machine: Machine) -> ToothFinding | None:
    """Look for damage of one tooth on all gears.

    Parameters
    ----------
    own : Profile
        The recording.
    deviation : MachineDeviation
        How it departs from the law.
    machine : Machine
        The machine.

    Returns
    -------
    ToothFinding or None
        None if no gear was resolved.
    """
    # what the teeth make of a loss is told at the speed that comes nearest
    near = min(machine.operating, key=lambda point: abs(point.shaft1_hz - own.speed_hz))
    machine = replace(machine, operating=(replace(near, share=1.0),))
    searched: list[GearEvidence] = []
    for gear in deviation.gears:
        shown = mesh_shown(gear, deviation.gears, machine)
        if not shown:
            # what drowns in another mesh on the same lines tells neither size nor gear
            gear = replace(gear, mesh_lines=None)
        alone = as_heard(gear, machine)
        if not alone.bands:
            continue
        found, top = [], max(int(band.number[-1]) for band in alone.bands) + gear.teeth
        # nothing may tell how a sun is held
        for seat in filter(None, (machine, with_floating_sun(machine, gear.stage))):
            # of a set whose file says too little, only an event of unknown form is looked for
            with suppress(ArgumentError):
                response = tooth_response(seat, gear.stage, gear.gear, top * gear.order)
                power = own_mesh_power(alone, response, deviation.gears)
                heard = replace(as_heard(gear, machine, response), mesh_power=power)
                found.append(search_gear(heard, response, own.speed_hz))
        ranked = sorted(filter(None, found), key=lambda search: -search.log_gear)
        if ranked or alone.meetings > 1:
            best, instead = (*ranked, None, None)[:2]
            alone = best.difference if best is not None else alone
            searched.append(GearEvidence(alone, best, shown, instead))
    return ToothFinding(searched, machine) if searched else None


def as_heard(
    gear: GearDeviation, machine: Machine, response: ToothResponse | None = None
) -> GearDeviation:
    """Return a gear's deviation at the lines in which a damaged tooth is heard.

    Parameters
    ----------
    gear : GearDeviation
        Of every line of its turn and beside it.
    machine : Machine
        Its machine.
    response : ToothResponse, optional
        What the damage adds, if it is known.

    Returns
    -------
    GearDeviation
        Of a pair all lines. Where planets pass the sensor those beside the multiples of the
        gear's turn, and of these themselves about mesh harmonics where the response is louder
        there: of a sun or ring that meets N planets at equal distances one in N. Of a gear that
        stands still those at multiples of N. `meetings` tells how often an event comes again in a
        turn: a tooth of a planet meets sun and ring. Where planets cancel in a mesh harmonic of the
        response its neighbours do not tell the path, which falls below its resonances: it is left
        out.
    """
    mesh = kinematics(machine).mesh(gear.stage)
    if not mesh.planets:
        return gear
    bands, beside = [], any(band.side for band in gear.bands)
    for band in gear.bands:
        step, first = mesh.brought_alike(gear.gear, band.side)
        met = band.number % step == first
        # where nothing is beside a gear, its own turn is the carrier's, or the carrier stands
        heard = (band.side != 0) == beside
        if response is not None:
            if not heard:
                sides = [float(response.band_power(band.number, s).sum()) for s in (0, -1, 1)]
                heard = sides[0] > max(sides[1:])
            heard &= bool(np.all(response.mesh[band.harmonic :][:1]))
        if heard and np.count_nonzero(met) >= _LEAST_LINES:
            names = ("rest", "deviation", "noise", "pattern", "known")
            kept = {name: getattr(band, name)[..., met] for name in names}
            bands.append(replace(band, number=band.number[met], **kept))
    others = mesh.planets if mesh.equally_spaced else 1
    return replace(gear, bands=tuple(bands), meetings=2 if gear.gear == "planet" else others)


def own_mesh_power(
    gear: GearDeviation, response: ToothResponse, gears: Sequence[GearDeviation]
) -> FloatArray:
    """Power of a gear's mesh harmonics without what another stage puts on the same lines.

    Parameters
    ----------
    gear : GearDeviation
        The gear.
    response : ToothResponse
        Its expected lines.
    gears : sequence of GearDeviation
        All gears of the machine.

    Returns
    -------
    ndarray of float, shape (channels, harmonics)
        At most `mesh_power`.

    Notes
    -----
    Where every so many harmonics of a mesh fall on another's, the path would be told by lines of
    both. Those have then what the neighbouring harmonics, which stand alone, let expect of them. A
    mesh all of whose harmonics are another's, too, keeps the power of both: its path may be taken
    for too good.
    """
    # in a set the turns of some gears miss the lines where planets put the mesh harmonics
    power, told = gear.mesh_power.copy(), _by_neighbours(gear.mesh_power, response)
    for alike in (one.mesh_power for one in gears if one.stage == gear.stage):
        both = slice(min(power.shape[1], alike.shape[1]))
        power[:, both] = np.maximum(power[:, both], alike[:, both])
    for other in gears:
        ratio = Fraction(gear.order * gear.teeth / (other.order * other.teeth))
        near = ratio.limit_denominator(_FINEST_RATIO)
        step = near.denominator
        if other.stage == gear.stage or step == 1 or abs(near / ratio - 1) > 1e-9:
            continue
        both = slice(step, told.shape[1], step)
        power[:, both] = np.minimum(told[:, both], power[:, both])
    return power


def mesh_shown(gear: GearDeviation, gears: Sequence[GearDeviation], machine: Machine) -> bool:
    """Whether a mesh is louder than the mesh of another stage makes expect on the same lines.

    Parameters
    ----------
    gear : GearDeviation
        The gear whose mesh it is.
    gears : sequence of GearDeviation
        All gears of the machine.
    machine : Machine

    Returns
    -------
    bool
        False where all its harmonics are every so many of another mesh, and in no channel louder
        than the neighbours of those, which stand alone: then nothing tells how it is heard.

    Notes
    -----
    On a rig of 32/96 and 32/80 teeth one of four sensors shows the first stage in all of ten
    recordings, two in none; with a broken tooth one of the two sounds as it did when healthy.
    """
    for other in gears:
        ratio = gear.order * gear.teeth / (other.order * other.teeth)
        step = round(ratio)
        # planets put their mesh harmonics, or cancel them, as their phases have it
        of_set = isinstance(machine.stages[other.stage - 1], PlanetaryStage)
        if other.stage == gear.stage or of_set or step < 2 or abs(ratio / step - 1) > 1e-9:
            continue
        top = (other.mesh_power.shape[1] - 1) * other.order * other.teeth
        response = tooth_response(machine, other.stage, other.gear, top)
        told = _by_neighbours(other.mesh_power, response)
        both = slice(step, told.shape[1] - 1, step)
        if not np.any(other.mesh_power[:, both] > told[:, both]):
            return False
    return True


def _by_neighbours(power: FloatArray, response: ToothResponse) -> FloatArray:
    """Power of each mesh harmonic as those beside it, if they stand alone, let expect it."""
    count = min(len(response.mesh), power.shape[1])
    expected = np.abs(response.mesh[:count]) ** 2
    both, sides = (power[:, :count], expected), [1.0, 0.0, 1.0]
    told, beside = (convolve1d(own, sides, mode="constant") for own in both)
    return np.asarray(told * np.divide(expected, beside, out=np.zeros(count), where=beside > 0))


def losses_by_tooth(gear: SearchedGear) -> tuple[FloatArray, FloatArray]:
    """Estimate the loss of every tooth of a gear.

    Parameters
    ----------
    gear : SearchedGear
        The gear.

    Returns
    -------
    loss, sigma : ndarray of float, shape (teeth,)
        Mean and standard deviation of the loss, damage of one tooth at most and of none held
        equally likely beforehand, and given damage all losses. A large event is heard by the teeth
        beside it too; they are not blamed for it.
    """
    likelihood = np.exp(gear.log_likelihood - gear.log_likelihood.max(axis=0))
    chance = likelihood * LOSSES[:, None]  # losses stand at equal ratios
    chance /= chance.sum(axis=0)
    mean = LOSSES @ chance
    spread = np.sqrt(np.maximum(LOSSES**2 @ chance - mean**2, 0.0))
    damaged = np.exp(gear.log_place - gear.log_place.max())
    damaged /= damaged.sum() * (1.0 + np.exp(min(-gear.log_gear, _NEVER)))
    least = np.maximum(spread, np.maximum(0.1 * mean, _LEAST_SIGMA))
    sigma: FloatArray = np.sqrt(least**2 + damaged * (1.0 - damaged) * mean**2)
    return damaged * mean, sigma


def told_losses(
    finding: ToothFinding, gear: GearEvidence
) -> tuple[FloatArray | None, FloatArray | None]:
    """Losses of a gear's teeth and their standard deviations, in the order of the tooth numbers.

    Of the tooth to blame the estimate of the finding stands, so that flag and history say the same:
    the search for damage takes sizes too small. None without a template.
    """
    search = gear.search
    if search is None:
        return None, None
    loss, sigma = losses_by_tooth(search)
    # of a sound gear no tooth stands out, and none is sized
    if gear is finding.best and 2 * loss[search.best] > loss.sum() and finding.loss is not None:
        loss[search.best] = finding.loss.loss
        sigma[search.best] = (finding.loss.high - finding.loss.low) / _NORMAL_90
    number = gear.place[0] - 1 - search.best
    return np.roll(loss, number), np.roll(sigma, number)


def crack_depth_mm(machine: Machine, stage: int, gear: str, loss: float) -> float | None:
    """Return the depth of a root crack through the face width that costs its pair so much.

    Parameters
    ----------
    machine : Machine
        The machine.
    stage : int, >= 1
        Stage.
    gear : str
        Gear with the damaged tooth.
    loss : float, in [0, 1)
        Mean loss of the stiffness of the pair over its contact.

    Returns
    -------
    float or None
        None where the machine file lacks the geometry (module, face width), where its teeth cannot
        be cut, or where no crack costs so much.

    Notes
    -----
    The forward conversion `gears.damage.stiffness_loss` (potential energy of the tooth with a
    flat limit line of the crack) rises with the size, and is inverted by bracketing. Against finite
    elements that line costs shallow cracks too little stiffness, by up to 45 %: the depth given is
    then too large.

    Examples
    --------
    >>> from gearmon.machine import Machine, OperatingPoint, ParallelStage
    >>> stage = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)
    >>> machine = Machine(
    ...     name="pair", operating=(OperatingPoint(speed_rpm=1460.0),), stages=(stage,)
    ... )
    >>> small, large = (crack_depth_mm(machine, 1, "pinion", loss) for loss in (0.05, 0.1))
    >>> 0 < small < large
    True
    """
    # of a planet the mesh with the sun
    pairs = mesh_pairs(machine.stages[stage - 1], stage, machine.path)
    named = [(pair, [member.name for member in pair.members]) for pair in pairs]
    pair, names = next(own for own in named if gear in own[1])
    if pair.stage.module_mm is None or pair.stage.face_width_mm is None:
        return None
    crack = faults.Fault(kind="crack", stage=stage, gear=gear, tooth=1, size=0.1, unit="mm")
    with suppress(GearmonError):
        teeth = tooth_pairs.teeth_of(pair)
        return float(damage.size_for_loss(crack, loss, teeth, names.index(gear)).size)
    return None
