"""The law of a healthy gear's lines, and how a new recording deviates from it.

Synchronous averages of the references, as complex lines, are turned to the same angle and predicted
for the state of the new recording. About each mesh harmonic the healthy pattern may
change by a complex gain that varies slowly across the band: load, sensor gain and mounting change
the gain, a small change of speed moves every line to another place of the path's response and makes
the gain vary. Gains have a prior about one: they explain little that no healthy machine would do.
Beyond that, every line departs by a share of how loud the pattern is about it: the prior of the
state's law, sharpened band by band by how far the references depart from one another. Pitch errors
and eccentricities of the machine itself cancel. Where an engine or a joint drives the gear
unevenly, in another phase each time, the healthy pattern is modulated as the new one is
(`patterns`).

Every healthy quantity is taken as a Gaussian process of the operating state, of unknown mean, with
a scatter from recording to recording and a slope per unit of state: from one reference the
prediction is that reference, with a variance that grows with the distance; from several it is
interpolated between them (universal kriging; Matheron 1963), and the change with load is explained
instead of counted as scatter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from scipy.ndimage import convolve1d, uniform_filter1d

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.diagnosis.law import patterns as gear_patterns
from gearmon.diagnosis.law.patterns import AROUND, GearPattern, mesh_bands, turn_energy
from gearmon.signals.orders.lines import variance_of_mean
from gearmon.signatures.measured.line_plan import WheelLines
from gearmon.signatures.measured.reference import WheelPattern

#: Distance [units of state: nepers of the mesh] over which a slope may turn: loads a factor of two
#: apart. Healthy pairs of simulated machines from 40 to 115 % load.
LENGTH = 0.7
#: Load (`gears.mechanics.load_share` at the largest torque) of which a neper is one unit of state.
#: Teeth that are loaded less change faster with it, in proportion: at two thirds of the torque
#: their stiffness falls, at half of it those that are off leave contact. 2,394 healthy pairs of
#: simulated drives at 17 to 196 N/mm, loads 1.0 to 0.5, one to three references: 118 were called
#: faults without it, nearly all by levels, 17 are with it. Of 28 cracks of 30 % at 17 and 42 N/mm,
#: learned at 1.0, 0.75 and 0.5 of the load, 12 were found without it, 17 are.
FULL_LOAD = 1.5
# A band's gain has a slope and a bend across it, of the same standard deviation, where it has so
# many lines for each of them: with fewer they would follow what one tooth does.
_GAINS, _LINES_A_GAIN = 3, 4
# Departure of a line from recording to recording and per unit of state, over the loudness about it.
_SCATTER, _SLOPE = 0.03, 0.5
# Recordings that the prior of the scale of departures is worth, and the least scale.
_WORTH, _LEAST_SCALE, _MOST_SCALE = 4.0, 0.25, 1e4
# Lines to either side that tell how loud the pattern is about a line.
_BESIDE = 2
# Turns of the carrier beside the lines, by row of a pattern.
_SIDES = (0, -1, 1)
# Where the rest beside the event tells of the noise, it takes no more of the turn: of a pinion of
# 14 teeth nothing would be left, and a healthy one seem to stand out 20 times.
_EVENT_OF_TURN = 0.25
# Share of the lines that the fit must leave to tell of anything beside the event: one in N lines of
# a sun that meets N planets are too few.
_LEAST_LEFT = 0.1
# Quantile of the energy around the turn that tells how much departs everywhere: of a healthy sun of
# four planets, of which one line in four is heard, at another load 0.8 of the largest, and it was
# called damaged in three of twelve recordings; of a damaged one 0.17 to 0.63 on thirteen of sixteen
# simulated sets.
_QUIET = 0.25
#: Mean square of the rest that noise leaves at least: of 1,500 healthy gears one in a thousand has
#: left less than 0.12.
LEAST_MISFIT = 0.1
# Energy of what is left over that of its median place from which there is a second event. On 14
# foreign machines a second tooth, five after the first, has 5 to 80 times where it hides the first;
# 46 sound gears have 4.2 at most (184 comparisons), and 6.9 driven unevenly by 0.6 per cent. Both
# teeth are a fault in 49 of 56 comparisons, in 45 beside one event.
_SECOND_EVENT = 8.0
# Least misfit of a gear that others are held against: of 2,398 sound gears of drawn machines one in
# six leaves less. It tells something where it would leave more than the second number.
_LEAST_BESIDE, _WOULD_SHOW = 0.5, 2.0
# Mean square of the rest, beside several references, below which the noise that blocks tell is too
# much to be believed. On 49 foreign trains integrated in time, loads rippling at 0.1 to 6 Hz, 3 of
# 377 comparisons of sound ones with loads of 0.6, 0.8 and 1.0 were believed as a fault is, by gears
# that leave 0.40 to 0.52 of it, and none is; of 104 cracks of 15 and 30 % 50 are instead of 51,
# with 1 instead of this number 44. Beside one reference none of 80 sound ones was.
_TRUSTED = 0.6
# Share of an event's energy that is left at every other tooth when all that can be followed of it
# is taken off: a crack that grows from 10 to 60 % raises the rest by 0.006 to 0.01 of its own.
_LEFT_BY_EVENT = 0.01
#: Steps of the waveform for each tooth, and the middle of the contact of tooth 1 [teeth] after the
#: angle zero: tooth j is in contact from j - 1 to about j + 0.6 mesh periods after it.
STEPS, CONTACT_CENTRE = 8, 0.8
# Blocks by which it is told whether an event comes again, at most.
_MOST_BLOCKS = 256
_TINY = np.finfo(float).tiny
# Step at which the window of two teeth about that middle begins.
_WINDOW = round((CONTACT_CENTRE - 1.0) * STEPS)


def which_gear(own: WheelPattern | GearDeviation) -> dict[str, Any]:
    """Return what tells which gear it is, by the names of its fields."""
    return {name: getattr(own, name) for name in ("stage", "gear", "teeth", "order")}


def load_unit(share: float) -> float:
    """Return the nepers of load that are one unit of state, for teeth loaded so (`FULL_LOAD`)."""
    return min(1.0, share / FULL_LOAD)


def in_units(states: FloatArray, share: float) -> FloatArray:
    """Return operating states, shape (..., coordinates), with their load in units of state."""
    unit = np.ones(states.shape[-1])
    unit[0] = load_unit(share)
    return np.asarray(states / unit)


class Kriging:
    """Prediction of a healthy quantity at a state from references.

    Parameters
    ----------
    known : ndarray of float, shape (references, coordinates)
        Their states [units].
    state : ndarray of float, shape (coordinates,)
        Where to predict.
    scatter : float, > 0
        Standard deviation from one healthy recording to the next at the same state.
    slope : float, >= 0
        Standard deviation of the change per unit of state.

    Attributes
    ----------
    weights : ndarray of float, shape (references,)
        Of each reference in the prediction; their sum is 1.
    parts : ndarray of float, shape (1 + coordinates,)
        Variance of the quantity about the prediction: by scatter from recording to recording, and
        by what changes with each coordinate of the state. Noise of the measurement comes on top.
    spread : float
        Their sum.
    """

    def __init__(self, known: FloatArray, state: FloatArray, scatter: float, slope: float) -> None:
        count, size = len(known), (slope * LENGTH) ** 2
        # the state itself stands last
        states = np.vstack([known, state])
        far = ((states[:, None] - states) / LENGTH).T ** 2
        shared = size * np.exp(-0.5 * far.sum(axis=0))
        system = shared + scatter**2 * np.eye(count + 1)
        system[count], system[:, count], system[count, count] = 1.0, 1.0, 0.0
        right = np.append(shared[:count, count], 1.0)
        self.weights = weights = np.linalg.solve(system, right)[:count]
        # variance of the prediction less the truth, and what each coordinate alone would make of it
        apart = np.append(weights, -1.0)
        each = np.maximum(apart @ (size * np.exp(-0.5 * far)) @ apart, 0.0)
        each *= max(apart @ shared @ apart, 0.0) / max(each.sum(), _TINY)
        self.parts = np.array([scatter**2 * (1.0 + weights @ weights), *each])
        self.spread = float(self.parts.sum())


@dataclass(frozen=True, kw_only=True, eq=False)
class BandDeviation:
    """What the law leaves of the lines about one mesh harmonic.

    Parameters
    ----------
    harmonic : int
        Mesh harmonic, from 1.
    number : ndarray of int, shape (lines,)
        Multiples of the gear's rotation.
    rest : ndarray of complex, shape (channels, lines)
        What is left, over `deviation`: of mean square 1 on a healthy machine.
    deviation : ndarray of float, shape (channels, lines)
        Standard deviation of the line about the prediction, in the recording's unit.
    noise : ndarray of float, shape (channels, lines)
        The same for the noise of the recordings alone, healthy departures left out.
    pattern : ndarray of complex, shape (channels, lines)
        The healthy pattern, over `deviation`.
    side : {0, -1, 1}
        Turns of the carrier beside the multiples.
    known : ndarray of complex, shape (references, channels, lines)
        `rest` of each reference against what the others predict; without rows for one reference.
    changing : float, in [0, 1]
        Share of healthy departures, noise left out, that is change with the state.
    """

    harmonic: int
    number: IntArray
    rest: ComplexArray
    deviation: FloatArray
    noise: FloatArray
    pattern: ComplexArray
    known: ComplexArray
    changing: float = 0.0
    side: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class GearDeviation:
    """Deviation of one gear's lines from the law.

    Parameters
    ----------
    stage, gear, teeth, order
        Which gear; `order` is its rotation in turns of shaft 1.
    bands : tuple of BandDeviation
        One for each mesh harmonic, and side of the lines, that bears enough of them.
    mesh_power : ndarray of float, shape (channels, harmonics)
        |A|^2 of the recording's mesh harmonics 0, 1, ...
    shift_turns : float
        Turns by which the references were turned to the new recording.
    meetings : int, >= 1
        How often a damaged tooth is heard in a turn, at equal distances: energies are means over
        these.
    mesh_lines : ndarray of complex, shape (channels, harmonics), or None
        The mesh harmonics themselves; None where planets may put them elsewhere.
    light : float, >= 0
        By how much the load is lighter than that of every reference [Np].
    load : float, > 0
        How the teeth are loaded (`gears.mechanics.load_share`).
    same_zero : bool
        Whether its turns are counted from the same pulse as those of the references.
    """

    stage: int
    gear: str
    teeth: int
    order: float
    bands: tuple[BandDeviation, ...]
    mesh_power: FloatArray
    shift_turns: float
    meetings: int = 1
    mesh_lines: ComplexArray | None = None
    light: float = 0.0
    load: float = np.inf
    same_zero: bool = False

    @property
    def lines(self) -> int:
        """Number of lines, each channel's counted."""
        return sum(band.rest.size for band in self.bands)

    @cached_property
    def misfit(self) -> float:
        """Mean square of the rest beside the greatest event: about 1 where the law holds.

        The event is all that the lines about one place of the turn can follow, from two teeth
        before to five after it, a quarter of the turn at most; it draws the gain of the healthy
        pattern too. Where another one stands out as clearly of what is left, it is beside both.
        """
        place = int(np.argmax(self._energy))
        left, freedom, rest = self._beside([place])
        energy = self._around(rest) if self.meetings == 1 else np.ones(1)
        if energy.max() > _SECOND_EVENT * np.median(energy):
            both = self._beside([place, int(np.argmax(energy))])
            if both[1] >= _LEAST_LEFT * self.lines:
                left, freedom, _ = both
        if freedom < _LEAST_LEFT * self.lines:
            # of a small pinion all lines tell, and ring on
            if self.meetings == 1:
                return 1.0
            # one line in N tells of a sun's places: the quietest quarter of the turn tells, less
            # what the lines that are heard let leak of the event to the median place
            turn = np.exp(-2j * np.pi * CONTACT_CENTRE / self.teeth)
            one = [np.broadcast_to(turn**band.number, band.rest.shape) for band in self.bands]
            alone = self._around(one)
            leak = float(np.median(alone) / alone.max() * self._energy.max())
            return max(1.0, (float(np.quantile(self._energy, _QUIET)) - leak) / self.lines)
        left /= max(freedom, 1.0)
        leaked = _LEFT_BY_EVENT * float(self._energy.max()) / self.lines
        return max(left - leaked, min(left, 1.0), LEAST_MISFIT)

    def _beside(self, places: Sequence[int]) -> tuple[float, float, list[ComplexArray]]:
        """Energy, degrees of freedom and lines of what events at steps of the turn leave."""
        reach = min(1.0, _EVENT_OF_TURN * self.teeth / np.ptp(AROUND) / self.meetings)
        after = np.add.outer(np.array(places) / STEPS + CONTACT_CENTRE, reach * AROUND) / self.teeth
        delay = np.add.outer(np.arange(self.meetings) / self.meetings, after).ravel()
        freedom, rest = 0.0, list[ComplexArray]()
        for band in self.bands:
            waves = np.exp(-2j * np.pi * np.outer(band.number, delay))
            gains = _powers((band.number - self.teeth * band.harmonic) / self.teeth).T
            event = waves / band.deviation[:, :, None]
            columns = np.concatenate([event, gains * band.pattern[:, :, None]], axis=2)
            columns /= np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), _TINY)
            followed, rank = gear_patterns.spanned(columns)
            rest.append(band.rest - gear_patterns.along(followed, band.rest))
            freedom += band.rest.size - rank
        return float(sum(np.sum(np.abs(own) ** 2) for own in rest)), freedom, rest

    @cached_property
    def peak(self) -> float:
        """Highest energy over two teeth, over that beside it and by what is expected there."""
        return float(self._standing_out.max())

    @cached_property
    def by_tooth(self) -> FloatArray:
        """Energy about each tooth's contact over that beside the largest, by what is expected."""
        return self._standing_out[::STEPS]

    @cached_property
    def expected_around(self) -> FloatArray:
        """Energy at each place of the turn over that of the median, as healthy departures have it.

        Load, speed and wear of the healthy machine change its pattern in proportion to what it is:
        where a gear is loud it departs most. Noise is alike all around. Of neither is counted on
        less than the median. Steps as those of `by_tooth`, from the first tooth's contact on.

        Where several references tell, by what the others leave of each, how unevenly the healthy
        machine departs around the turn, no less is expected of what changes with the state: a tooth
        that stands off its neighbours comes into contact at some load, which neither its loudness
        nor a neighbouring load tells.

        Notes
        -----
        A simulated rig at 7 to 17 N/mm, learned at 1.0, 0.75 and 0.5 of its load, departs at 0.85
        by 8.6 times the median at one tooth, where the references show 6.4 to 9.2; its loudness
        alone let expect 1.6, and it was called a fault. Of 250 healthy gears of 24 drawn machines
        and 60 of the catalogue's, learned so, the largest energy over what is expected is 2.6.
        Of 290 healthy pairs of simulated gears whose teeth lose contact (four of the catalogue's
        machines, loads a tenth to a half apart) the largest energy over the median falls by this
        from 4 to 25 to 2.3 to 9.7 (95 % points), at a correlation of 0.3 to 0.6 of the logarithms
        of either energy; of 1,036 whose pattern is in proportion to the load it grows by a tenth.
        """
        loud = np.maximum(1.0, self._uneven([band.pattern for band in self.bands]))
        expected = 1.0 + self.departs * (loud - 1.0)
        learned = self._uneven([band.known for band in self.bands])
        if not len(learned):
            return expected
        changing = float(np.mean([band.changing for band in self.bands]))
        return np.asarray(np.maximum(expected, 1.0 + changing * (np.mean(learned, axis=0) - 1.0)))

    def _uneven(self, lines_of_bands: Sequence[ComplexArray]) -> FloatArray:
        """Energy around the turn over that of the median place."""
        energy = self._around(lines_of_bands)
        middle = np.median(energy, axis=-1, keepdims=True)
        return np.asarray(energy / np.maximum(middle, _TINY))

    @cached_property
    def noise_share(self) -> float:
        """Share of noise in the variance that the law expects of its lines, 0 to 1."""
        noise = sum(float(np.sum((band.noise / band.deviation) ** 2)) for band in self.bands)
        return noise / self.lines

    @cached_property
    def departs(self) -> float:
        """Share of what is left beside the greatest event that is departure, not noise, 0 to 1.

        Blocks scatter by what a rippling load does, too, which cancels in their mean. Where far
        less is left than the noise that they tell, how much of it is noise is known the less.
        Beside one reference the prior allows for more than that.
        """
        several = any(len(band.known) for band in self.bands)
        trusted = min(1.0, self.misfit / _TRUSTED) if several else 1.0
        return 1.0 - self.noise_share * trusted / max(1.0, self.misfit)

    def beyond(self, other: GearDeviation) -> float:
        """How much more this gear departs all around its turn than another one does.

        Parameters
        ----------
        other : GearDeviation
            A gear of another shaft.

        Returns
        -------
        float
            Misfit over that of the other, or what the other's would be if it departed by as many
            times its prior, over what it is; the smaller of both. 1 where noise hides the other.
        """
        told, hidden = 1.0 - self.noise_share, other.noise_share
        times = max(0.0, self.misfit - self.noise_share) / max(told, _TINY)
        alike = hidden + (1.0 - hidden) * times
        if alike <= _WOULD_SHOW:
            return 1.0
        return min(alike, self.misfit) / max(other.misfit, _LEAST_BESIDE)

    def recurrence(
        self, tooth: int, blocks: ComplexArray, wheel: WheelLines, swings: bool = False
    ) -> tuple[float, float]:
        """Tell whether what is at a tooth comes again with every turn.

        Parameters
        ----------
        tooth : int
            From 0.
        blocks : ndarray of complex, shape (blocks, channels, lines)
            The recording's lines, block by block.
        wheel : WheelLines
            Which of them are this gear's.
        swings : bool
            Whether the speed swings, so that the path turns the lines from block to block.

        Returns
        -------
        again : float
            Energy over what the scatter of the blocks leaves there: about 1 for what came in one
            block alone, however loud, k for what came in k of many. Low, too, where few of the
            lines tell of a weak event. Where the speed swings the number of blocks that it comes
            in, (sum E)^2 / sum E^2 of their energies E there beyond the median tooth's.
        scatter : float
            That scatter over the one at the median tooth: knocks scatter where they are.

        Notes
        -----
        Lines of another stage, which turn from block to block, cancel in the mean as
        `variance_of_mean` has it.
        """
        if len(blocks) < 2:
            return float("inf"), 1.0
        together = -(-len(blocks) // _MOST_BLOCKS)
        some = blocks[: len(blocks) // together * together]
        some = some.reshape(-1, together, *blocks.shape[1:]).mean(axis=1)
        steps = np.add.outer(np.arange(self.teeth) * STEPS + _WINDOW, np.arange(0, 2 * STEPS, 4))
        met = np.add.outer(np.arange(self.meetings) / self.meetings, steps / STEPS / self.teeth)
        sides = dict(zip(_SIDES, (wheel.lines, *wheel.beside), strict=False))
        scatter, energy = np.zeros(self.teeth), np.zeros((len(some), self.teeth))
        for band in self.bands:
            own = some[:, :, sides[band.side][np.searchsorted(wheel.number, band.number)]]
            waves = np.exp(2j * np.pi * np.outer(band.number, met.ravel()))
            seen = (own / band.deviation) @ waves
            told = variance_of_mean(seen).reshape(-1, *met.shape)
            scatter += told.sum(axis=0).mean(axis=(0, 2))
            if swings:
                power = (np.abs(seen) ** 2).sum(axis=1).reshape(-1, *met.shape)
                energy += power.mean(axis=(1, 3))
        again = float(self._energy[tooth * STEPS] / scatter[tooth])
        if swings:
            beyond = np.maximum(energy[:, tooth] - np.median(energy, axis=1), 0.0)
            again = float(beyond.sum() ** 2 / max((beyond**2).sum(), _TINY))
        return again, float(scatter[tooth] / np.median(scatter))

    @cached_property
    def _energy(self) -> FloatArray:
        """Energy of the rest around the turn."""
        return self._around([band.rest for band in self.bands])

    @cached_property
    def _standing_out(self) -> FloatArray:
        """Energy around the turn over what is expected at each place."""
        return np.asarray(self._energy / self.expected_around / (self.misfit * self.lines))

    def _around(self, lines_of_bands: Sequence[ComplexArray]) -> FloatArray:
        """Energy in windows of two teeth around the turn, centred on each step.

        Of several recordings, lines of shape (recordings, channels, lines), that of each.
        """
        steps = STEPS * self.teeth
        both = zip(self.bands, lines_of_bands, strict=True)
        energy = np.sum([turn_energy(lines, band.number, steps) for band, lines in both], axis=0)
        window = uniform_filter1d(energy, 2 * STEPS, mode="wrap")
        again = np.rint(np.arange(self.meetings) * steps / self.meetings).astype(int)
        met = np.arange(steps)[:, None] + again + STEPS + _WINDOW
        return np.asarray(window[..., met % steps].mean(axis=-1))


# Departures of references, and variances of such departures by side and harmonic of their bands.
_Learned = tuple[ComplexArray, dict[tuple[int, int], FloatArray]]


@dataclass(frozen=True, kw_only=True, eq=False)
class GearLaw:
    """The law of one gear's healthy lines.

    Parameters
    ----------
    wheel : WheelPattern
        The gear, as the first reference has it.
    patterns : tuple of GearPattern
        Of the references, turned alike.
    states : ndarray of float, shape (references, 3)
        Their operating states.
    load : float, > 0
        How the teeth are loaded (`gears.mechanics.load_share`).
    indexed : bool
        Whether their angle zero is that of a tachometer.
    """

    wheel: WheelPattern
    patterns: tuple[GearPattern, ...]
    states: FloatArray
    load: float = np.inf
    indexed: bool = False

    @cached_property
    def _learned(self) -> _Learned:
        """How each reference departs from what the others predict; nothing of one reference.

        Returns
        -------
        departures : ndarray of complex, shape (references, sides, channels, top + 1)
            Whitened, on the grid of their patterns.
        scales : dict of (int, int) to ndarray of float, shape (parts, channels)
            Variances of departures over their priors, by side and harmonic of the band. Where they
            depart less than the prior has it, the machine is steady in all parts, scatter and
            change with the state. Where they depart more, each tells of the parts by their shares
            in it: a machine that changes much with its load need not scatter much beside a
            reference of the same load, nor change with its speed.
        """
        grid, every = self.patterns[0], np.arange(len(self.patterns))
        references = len(every) if len(every) > 1 else 0
        departures = np.zeros((references, *grid.amplitude.shape), dtype=complex)
        found: dict[tuple[int, int], list[tuple[FloatArray, FloatArray]]] = {}
        for row, own in enumerate(departures):
            rest = np.delete(every, row)
            known = tuple(self.patterns[n] for n in rest)
            others = replace(self, patterns=known, states=self.states[rest])
            pattern, parts = others._predicted(self.states[row], grid.top)
            for band in others._bands(self.patterns[row], pattern, parts, (departures[:0], {})):
                own[_SIDES.index(band.side)][:, band.number] = band.rest
                told = parts / parts.sum(), np.mean(np.abs(band.rest) ** 2, axis=1)
                found.setdefault((band.side, band.harmonic), []).append(told)
        scales = {}
        for place, each in found.items():
            share, seen = (np.array(column) for column in zip(*each, strict=True))
            common = (_WORTH + seen.sum(axis=0)) / (_WORTH + len(seen))
            parts = (_WORTH + share.T @ seen) / (_WORTH + share.sum(axis=0)[:, None])
            scales[place] = np.clip(np.minimum(common, parts), _LEAST_SCALE, _MOST_SCALE)
        return departures, scales

    def deviation(
        self, wheel: WheelPattern, state: FloatArray, *, same_zero: bool
    ) -> GearDeviation | None:
        """Hold a new recording against the law.

        Parameters
        ----------
        wheel : WheelPattern
            The gear's lines in the new recording, in the channels of the law.
        state : ndarray of float, shape (3,)
            Its operating state.
        same_zero : bool
            Whether the angle zero of this gear is that of the references.

        Returns
        -------
        GearDeviation or None
            None if too few lines are shared.
        """
        top = min(self.patterns[0].top, int(wheel.number.max(initial=0)))
        new = GearPattern.of(wheel, top)
        known, parts = self._predicted(state, top)
        known, angle = (known, 0.0) if same_zero else known.turned_to(new, wheel.teeth)
        known = known.modulated_as(new, wheel.teeth)
        turn = np.exp(2j * np.pi * angle * np.arange(top + 1))
        departures, scales = self._learned
        learned = departures[..., : top + 1] * turn, scales
        bands = tuple(self._bands(new, known, parts, learned))
        lines = new.amplitude[..., :: wheel.teeth]
        if not bands:
            return None
        return GearDeviation(
            **which_gear(wheel),
            bands=bands,
            # planets may put a mesh harmonic a turn of the carrier beside its place
            mesh_power=(np.abs(lines) ** 2).sum(axis=0),
            shift_turns=angle,
            mesh_lines=None if len(wheel.beside) else lines[0],
            light=max(0.0, float(self.states[:, 0].min() - state[0])),
            load=self.load,
            same_zero=same_zero,
        )

    def _predicted(self, state: FloatArray, top: int) -> tuple[GearPattern, FloatArray]:
        """Healthy pattern at a state up to a line, and the parts of the variance beside it."""
        known, new = in_units(self.states, self.load), in_units(state, self.load)
        kriging = Kriging(known, new, _SCATTER, _SLOPE)
        return GearPattern.combined(self.patterns, kriging.weights, top), kriging.parts

    def _bands(
        self, new: GearPattern, known: GearPattern, parts: FloatArray, learned: _Learned
    ) -> Iterator[BandDeviation]:
        """Give what the law leaves about each mesh harmonic, on each side of the lines."""
        teeth, (departures, scales) = self.wheel.teeth, learned
        harmonics = enumerate(mesh_bands(teeth, new.top), start=1)
        every = product(enumerate(known.usable & new.usable), harmonics)
        for (place, usable), (harmonic, band) in every:
            use, side = band[usable[band]], _SIDES[place]
            offset = use - teeth * harmonic
            far = np.abs(offset) > gear_patterns.NEAR
            if far.sum() < gear_patterns.LEAST_LINES:
                continue
            scale = scales.get((side, harmonic), np.ones((len(parts), new.amplitude.shape[1])))
            healthy = known.amplitude[place][:, use]
            noise = new.variance[place][:, use] + known.variance[place][:, use]
            # mean power of the lines about each, the mesh harmonic left out
            told, window = (offset != 0).astype(float), np.ones(2 * _BESIDE + 1)
            total = convolve1d(told * np.abs(healthy) ** 2, window, mode="constant")
            loudness = total / np.maximum(convolve1d(told, window, mode="constant"), 1.0)
            deviation = np.sqrt(noise + (parts @ scale)[:, None] * loudness)
            pattern = healthy / deviation
            rest = new.amplitude[place][:, use] / deviation - pattern
            yield BandDeviation(
                harmonic=harmonic,
                number=use[far],
                rest=_without_gain(rest, pattern, offset / teeth)[:, far],
                deviation=deviation[:, far],
                noise=np.sqrt(noise[:, far]),
                pattern=pattern[:, far],
                known=departures[:, place][..., use[far]],
                changing=1.0 - float(parts[0] * scale[0].sum() / (parts @ scale).sum()),
                side=side,
            )


def _without_gain(rest: ComplexArray, pattern: ComplexArray, place: FloatArray) -> ComplexArray:
    """Whitened rest after a gain, its slope and its bend across the band have been fitted.

    Ridge regression with the gains' prior; what it takes away of the degrees of freedom is made up.
    """
    columns = gear_patterns.GAIN * _powers(place) * pattern[:, None, :]
    gram = columns.conj() @ columns.swapaxes(1, 2)
    inverse = np.linalg.inv(gram + np.eye(gram.shape[1]))
    gain = np.einsum("cij,cjn,cn->ci", inverse, columns.conj(), rest)
    left = rest - np.einsum("ci,cin->cn", gain, columns)
    freedom = np.einsum("cij,cji->c", inverse, gram).real
    lines = rest.shape[1]
    return np.asarray(left * np.sqrt(lines / np.maximum(1.0, lines - freedom))[:, None])


def _powers(place: FloatArray) -> FloatArray:
    """Course of a gain, its slope and its bend across a band, as far as its lines bear them."""
    told = max(1, min(_GAINS, len(place) // _LINES_A_GAIN))
    return np.asarray(place ** np.arange(told)[:, None])
