"""Damage of one tooth: which gear and which tooth, how much, and how much of it is believed.

A mesh harmonic is what the pulses of z equal teeth add up to, and damage changes one of these in
proportion. At the mesh harmonic itself what it adds is loss / z of the healthy line there,
whatever the form of the pulse, the resonances of the teeth and the path to the sensor: these are
the same for both. It is told by the sidebands around, since an event that rings for a short while
has a smooth spectrum. What the teeth's response adds at each loss is told by its own sidebands in
the same way, so that neither the form of the pulse nor the smoothing biases the ratio. It corrects
for what stiffness does in the square, and for load that the damaged pair sheds through the dynamics
of the mesh. Where that correction is large, the line is not what the pulses make of it in the first
place, and tells little.

The size that the search finds most likely, which takes the path's mean power from the mesh lines,
is the prior: it is all that is known where the path rings too long, where noise hides the
sidebands, and in planetary sets.

What could be measured, the depth of a crack, follows from the loss by the teeth's stiffness.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.diagnosis.hypotheses.several_teeth import DepartureSpread, departure_spread
from gearmon.diagnosis.hypotheses.tooth_match import (
    DECAY_S,
    LOSSES,
    SearchedGear,
    event_delays,
    most_likely,
    ringing,
    search_gear,
    share_lines,
)
from gearmon.diagnosis.law.gear_lines import CONTACT_CENTRE, FULL_LOAD, BandDeviation, GearDeviation
from gearmon.diagnosis.law.machine import MachineDeviation
from gearmon.errors import ArgumentError, GearmonError
from gearmon.gears.damage import size_for_loss
from gearmon.gears.faults import Fault
from gearmon.gears.kinematics import kinematics
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.tooth_pairs import teeth_of
from gearmon.machine import Machine, PlanetaryStage
from gearmon.signatures.expected.tooth_response import (
    GROWN,
    ToothResponse,
    grown_lines,
    tooth_response,
)
from gearmon.signatures.measured.reference import Profile

# The likelihood takes the law at its word, line by line. What departs on a healthy machine, beyond
# noise, departs by teeth: energies about single teeth scatter like gamma variables of this shape.
# Single references of five simulated machines, loads up to a factor of 2.5 apart: 61 of 162 healthy
# pairs were called faults without it, 5 are with it (loads below two thirds of the reference's),
# one instead of 12 of 63 with three references. Where healthy ones stayed healthy before, it costs
# one of the 36 losses of 15 % that were found.
_TEETH_SCATTER = 2.0
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
# Losses that are told apart; the last is the largest there is.
_FINE = np.geomspace(LOSSES[0], 0.95, 200)
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
# its neighbours (correlation 0.8): 5 % of the loss for each micrometre.
_SEARCHED, _COMMON, _LINE, _RESPONSE, _GROWTH = 0.35, 0.12, 0.2, 0.2, 0.5
# Share of a departure's mean square that is noise at least: no event is all of it.
_MISFIT = 0.03
# Freedom of Student's law for a mesh harmonic: some are those of another cause.
_FREEDOM = 4.0


@dataclass(frozen=True, kw_only=True, eq=False)
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
    """

    deviation: GearDeviation
    search: SearchedGear | None
    shown: bool = True

    @property
    def key(self) -> tuple[int, str]:
        """Stage and gear."""
        return self.deviation.stage, self.deviation.gear

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
    def loaded(self) -> float:
        """How nearly the teeth are loaded as much as the response supposes, at most 1."""
        return min(1.0, self.deviation.load)

    @property
    def load_unlearned(self) -> bool:
        """Whether nothing tells what the load changes: teeth loaded lightly, one reference."""
        return self.deviation.load < FULL_LOAD and not len(self.deviation.bands[0].known)

    @property
    def tooth(self) -> int:
        """The tooth that is most likely damaged, from 0, as the recording counts them."""
        if self.search is not None:
            return self.search.best
        return int(np.argmax(self.deviation.by_tooth))

    @cached_property
    def place(self) -> tuple[int, float]:
        """That tooth, counted from 1, and the middle of its contact in turns after the angle zero.

        Teeth are counted as `counted_from` tells.
        """
        deviation, entry = self.deviation, float(self.tooth)
        if self.search is not None and not deviation.same_zero:
            entry += _between(self.search.log_place, self.tooth)
        turned = 0.0 if deviation.same_zero else deviation.shift_turns * deviation.teeth
        position = (entry + CONTACT_CENTRE) / deviation.teeth % 1.0
        return round(entry + turned) % deviation.teeth + 1, position

    @property
    def counted_from(self) -> str:
        """Where teeth are counted from in all recordings.

        "tacho": from the one that enters mesh at the tachometer pulse; "reference": from about
        where the first healthy recording begins.
        """
        return "tacho" if self.deviation.same_zero else "reference"

    @cached_property
    def spread(self) -> DepartureSpread | None:
        """How far the departure is one tooth's; None without a template."""
        return departure_spread(self.search) if self.search is not None else None

    @property
    def log_factor(self) -> float:
        """Logarithm of the Bayes factor of damage of some tooth against none.

        Without a template that of an event of unknown form: the likelihood ratio of the energy at
        the best tooth, as a gamma variable, over the teeth that it may be.
        """
        if self.search is not None:
            return self.search.log_gear
        lines = sum(band.rest.size for band in self.deviation.bands)
        shape = max(0.5, 2.0 * lines / self.deviation.teeth / _OVERDISPERSION)
        # the meetings of one turn depart together on a healthy machine, too: however many there
        # are, the largest mean over them scatters as one of them would
        return self._of_gamma(shape, self.deviation.peak)

    @property
    def believed(self) -> float:
        """`log_factor`, as far as it is believed."""
        return self.believes(self.log_factor, self.deviation.peak)

    def believes(self, log_factor: float, peak: float) -> float:
        """Return how much is believed of a log Bayes factor.

        Parameters
        ----------
        log_factor : float
            By the likelihood.
        peak : float
            Energy at the tooth over that of the median.

        Returns
        -------
        float
            At most what the energy at one tooth, beyond noise, tells among teeth that all depart.
        """
        departs = max(self.deviation.departs, _NOISE_ALONE)
        shape = _TEETH_SCATTER / (1.0 + _LIGHTER_SCATTER * self.deviation.light)
        by_teeth = self._of_gamma(shape, 1.0 + max(0.0, peak - 1.0) / departs)
        return min(log_factor, by_teeth) if log_factor > 0 else log_factor

    def _of_gamma(self, shape: float, peak: float) -> float:
        """Log likelihood ratio of the largest of gamma variables, the tooth unknown."""
        teeth = self.deviation.teeth / self.deviation.meetings
        return float(shape * (peak - 1.0 - np.log(peak)) - np.log(max(1.0, teeth)))


def _between(log_place: FloatArray, index: int) -> float:
    """Place of the maximum of a parabola through the best tooth and its neighbours."""
    before, here, after = log_place[[index - 1, index, (index + 1) % len(log_place)]]
    bend = 2.0 * here - before - after
    return float(np.clip(0.5 * (after - before) / bend, -0.5, 0.5)) if bend > 0 else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothFinding:
    """The tooth whose damage explains a deviation best.

    Parameters
    ----------
    best : GearEvidence
        The gear to blame.
    machine : Machine
        The machine.
    speed_hz : float
        Speed of shaft 1 [Hz].
    evidence : float
        The logarithm of the Bayes factor that is believed, largest of all gears.
    rivals : tuple of (str, int, float)
        Gear and stage of others whose patterns show it too, and the logarithm of the factor by
        which the best explains it better.
    searched : tuple of GearEvidence
        All gears looked at.
    """

    best: GearEvidence
    machine: Machine
    speed_hz: float
    evidence: float
    rivals: tuple[tuple[str, int, float], ...]
    searched: tuple[GearEvidence, ...]

    @cached_property
    def loss(self) -> LossEstimate | None:
        """Loss of stiffness of its pair; None without a template."""
        search = self.best.search
        return loss_estimate(search, self.machine, self.speed_hz) if search is not None else None

    def of(self, stage: int, gear: str) -> GearEvidence | None:
        """Return the evidence of one gear."""
        return next((one for one in self.searched if one.key == (stage, gear)), None)


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
    searched = tuple(_searched(own, deviation, machine))
    if not searched:
        return None
    best, rivals = _blamed(searched)
    return ToothFinding(
        best=best,
        machine=machine,
        speed_hz=own.speed_hz,
        evidence=max(one.believed for one in searched),
        rivals=rivals,
        searched=searched,
    )


def _searched(
    own: Profile, deviation: MachineDeviation, machine: Machine
) -> Iterator[GearEvidence]:
    for gear in deviation.gears:
        alone = as_heard(gear, machine)
        if not alone.bands:
            continue
        top = max(int(band.number[-1]) for band in alone.bands) + gear.teeth
        found = None
        # of a set whose file says too little, only an event of unknown form is looked for
        with suppress(ArgumentError):
            response = tooth_response(machine, gear.stage, gear.gear, top * gear.order)
            power = own_mesh_power(gear, response, deviation.gears)
            # where planets cancel, neighbours do not tell the path: it falls below its resonances
            told = tuple(b for b in alone.bands if np.all(response.mesh[b.harmonic :][:1]))
            found = search_gear(
                replace(alone, bands=told, mesh_power=power), response, own.speed_hz
            )
            alone = found.difference if found is not None else alone
        if found is not None or alone.meetings > 1:
            shown = mesh_shown(gear, deviation.gears, machine)
            yield GearEvidence(deviation=alone, search=found, shown=shown)


def as_heard(gear: GearDeviation, machine: Machine) -> GearDeviation:
    """Return a gear's deviation at the lines in which a damaged tooth is heard.

    Parameters
    ----------
    gear : GearDeviation
        Of every line of its turn and beside it.
    machine : Machine
        Its machine.

    Returns
    -------
    GearDeviation
        Of a pair all lines. Where planets pass the sensor those beside the multiples of the
        gear's turn: of a sun or ring that meets N planets at equal distances one in N. Of a gear
        that stands still those at multiples of N. `meetings` tells how often an event comes again
        in a turn: a tooth of a planet meets sun and ring.

    Notes
    -----
    These lines have 97 to 99 % of the power of what 30 % on a tooth adds (simulated sets of
    18/27/72 and 19/26/71 teeth).
    """
    mesh = kinematics(machine).mesh(gear.stage)
    if not mesh.planets:
        return gear
    bands, beside = [], any(band.side for band in gear.bands)
    for band in gear.bands:
        step, first = mesh.brought_alike(gear.gear, band.side)
        met = band.number % step == first
        # where nothing is beside a gear, its own turn is the carrier's, or the carrier stands
        if (band.side != 0) == beside and np.count_nonzero(met) >= _LEAST_LINES:
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
    alike = [one.mesh_power for one in gears if one.stage == gear.stage]
    known = min(one.shape[1] for one in alike)
    power: FloatArray = np.max([one[:, :known] for one in alike], axis=0)
    expected = np.abs(response.mesh) ** 2
    last = min(len(expected), power.shape[1]) - 1
    for other in gears:
        ratio = Fraction(gear.order * gear.teeth / (other.order * other.teeth))
        near = ratio.limit_denominator(_FINEST_RATIO)
        step = near.denominator
        if other.stage == gear.stage or step == 1 or abs(near / ratio - 1) > 1e-9:
            continue
        for k in range(step, last + 1, step):
            told = _by_neighbours(gear.mesh_power[:, :known], expected, k)
            power[:, k] = np.minimum(told, power[:, k])
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
        top = other.mesh_power.shape[1] - 1
        response = tooth_response(machine, other.stage, other.gear, top * other.order * other.teeth)
        expected = np.abs(response.mesh) ** 2
        power, last = other.mesh_power, min(top, len(expected) - 1)
        louder = [power[:, k] > _by_neighbours(power, expected, k) for k in range(step, last, step)]
        if not np.any(louder):
            return False
    return True


def _by_neighbours(power: FloatArray, expected: FloatArray, harmonic: int) -> FloatArray:
    """Power of a mesh harmonic as those beside it, which stand alone, let expect it."""
    last = min(len(expected), power.shape[1]) - 1
    alone = [k for k in (harmonic - 1, harmonic + 1) if k <= last]
    told = power[:, alone].sum(axis=1) / expected[alone].sum()
    return np.asarray(told * expected[harmonic])


def _blamed(
    searched: Sequence[GearEvidence],
) -> tuple[GearEvidence, tuple[tuple[str, int, float], ...]]:
    """Choose the gear to blame; those with a template compete by what either should sound like."""
    first = max(searched, key=lambda one: one.believed)
    if first.search is None:
        return first, ()
    # a gear whose evidence is hardly believed does not compete, however loud it is, unless it has
    # its lines in common with the first: what stands out in the turn of one does in either's
    competing = [
        one.search
        for one in searched
        if one.search is not None
        and (
            one.believed >= _COMPETES * first.believed
            or (
                share_lines(one.search, first.search)
                and one.log_factor >= _AS_LOUD * first.log_factor
            )
        )
    ]
    best, rivals = most_likely(competing or [first.search])
    blamed = next(one for one in searched if one.search is best)
    return blamed, tuple(
        (gear.difference.gear, gear.difference.stage, lead) for gear, lead in rivals
    )


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


@dataclass(frozen=True, kw_only=True)
class LossEstimate:
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


def loss_estimate(gear: SearchedGear, machine: Machine, speed_hz: float) -> LossEstimate:
    """Estimate the loss of the most likely tooth of a gear.

    Parameters
    ----------
    gear : SearchedGear
        The gear to blame.
    machine : Machine
        Its machine.
    speed_hz : float
        Speed of shaft 1 [Hz].

    Returns
    -------
    LossEstimate
        Of the likelihood over the logarithm of the loss.
    """
    steps, fine = np.log(LOSSES), np.log(_FINE)
    likely = _blurred(gear.log_likelihood[:, gear.best], steps, _SEARCHED)
    total = np.interp(fine, steps, np.log(likely))
    # of a set, whose planets bring every line together, the search has to do
    if gear.difference.mesh_lines is not None and gear.difference.gear in ("pinion", "gear"):
        own = gear.response
        expected = grown_lines(machine, own.stage, own.gear, len(own.lines) - 1)
        grid = np.log(GROWN)
        for apart, variance in _at_harmonics(gear, *expected, speed_hz):
            # below what is told the logarithms of line and loss go together
            off = np.interp(fine, grid, apart + grid) - fine
            unsure = np.interp(fine, grid, variance)
            misfit = 0.5 * (_FREEDOM + 1.0) * np.log1p(off**2 / (_FREEDOM * unsure))
            total -= misfit + 0.5 * np.log(unsure)
    loaded = min(1.0, gear.difference.load)
    chance = _blurred(total, fine, _COMMON / np.sqrt(loaded))
    share = np.cumsum(chance) - 0.5 * chance
    low, middle, high = np.exp(np.interp([0.05, 0.5, 0.95], share / chance.sum(), fine)).tolist()
    return LossEstimate(loss=middle, low=low, high=high)


def _blurred(logarithm: FloatArray, steps: FloatArray, deviation: float) -> FloatArray:
    """Likelihood by its logarithm over even steps, once the steps are that unsure."""
    blur = np.exp(-0.5 * ((steps[:, None] - steps) / deviation) ** 2)
    return np.asarray((blur / blur.sum(axis=0)) @ np.exp(logarithm - logarithm.max()))


def _at_harmonics(
    gear: SearchedGear, sound: ComplexArray, grown: ComplexArray, speed_hz: float
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Logarithm of the damage by each mesh harmonic over what `GROWN` losses add; its variance."""
    difference = gear.difference
    assert difference.mesh_lines is not None
    last = min(len(sound), difference.mesh_lines.shape[1]) - 1
    rotation_hz, teeth = difference.order * speed_hz, difference.teeth
    entry_s = gear.best / (teeth * rotation_hz)
    delay = np.concatenate([event_delays(gear.response, rotation_hz, t) for t in DECAY_S]) + entry_s
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
        weight = np.abs(value[heard]) ** 2 / variance[heard]
        ratio = value[heard] / mesh[heard] * sound[k] / expected[:, heard]
        corrected = teeth * grown[0, k * teeth] / (GROWN[0] * sound[k])
        unsure = _RESPONSE * float(np.abs(np.log(np.abs(corrected))))
        told = np.average(np.log(np.abs(ratio)), axis=1, weights=weight)
        odd = _GROWTH * (told[0] - told - usual)
        yield told, 1.0 / weight.sum() + _LINE**2 + unsure**2 + odd**2


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
    pair, index = next(
        (pair, number)
        for pair in pairs
        for number, member in enumerate(pair.members)
        if member.name == gear
    )
    if pair.stage.module_mm is None or pair.stage.face_width_mm is None:
        return None
    crack = Fault(kind="crack", stage=stage, gear=gear, tooth=1, size=0.1, unit="mm")
    with suppress(GearmonError):
        return float(size_for_loss(crack, loss, teeth_of(pair), index).size)
    return None
