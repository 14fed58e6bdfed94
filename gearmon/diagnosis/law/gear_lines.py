"""The law of a healthy gear's lines, and how a new recording deviates from it.

Synchronous averages of the references, as complex lines, are turned to the same angle and predicted
for the state of the new recording (`state`). About each mesh harmonic the healthy pattern may
change by a complex gain that varies slowly across the band: load, sensor gain and mounting change
the gain, a small change of speed moves every line to another place of the path's response and makes
the gain vary. Gains have a prior about one: they explain little that no healthy machine would do.
Beyond that, every line departs by a share of how loud the pattern is about it: the prior of the
state's law, sharpened band by band by how far the references depart from one another. Pitch errors
and eccentricities of the machine itself cancel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.diagnosis.law.state import Kriging, load_unit
from gearmon.signals.orders.lines import variance_of_mean
from gearmon.signatures.measured.line_plan import WheelLines
from gearmon.signatures.measured.reference import WheelPattern

#: Sidebands this near to a mesh harmonic belong to eccentricity and misalignment, not to one tooth.
NEAR = 2
# Standard deviations of a band's complex gain about one, and of its slope and bend across the band:
# healthy simulated pairs from 40 to 115 % load with sensor gains left alone stay within 0.2.
_GAIN = np.array([0.3, 0.3, 0.3])
# Lines of a band for each of them: with fewer they would follow what one tooth does.
_LINES_A_GAIN = 4
# Departure of a line from recording to recording and per unit of state, over the loudness about it.
_SCATTER, _SLOPE = 0.03, 0.5
# Recordings that the prior of the scale of departures is worth, and the least scale.
_WORTH, _LEAST_SCALE, _MOST_SCALE = 4.0, 0.25, 1e4
# Lines to either side that tell how loud the pattern is about a line.
_BESIDE = 2
_LEAST_LINES = 4
# Turns of the carrier beside the lines, by row of a pattern.
_SIDES = (0, -1, 1)
# Angles that are tried, a good half of a tooth apart, and the share of the teeth, the quietest,
# that choose among them: a damaged tooth and those about it must not.
_ANGLES, _APART, _SOUND_TEETH = 8, 0.4, 0.7
# Where the new pattern is so many times as loud as the healthy one, in power, an event drowns the
# sound teeth by what leaks of it and is taken out: of simulated ones up to 10 times as loud as the
# other teeth (a ratio of 3) none turns the gear, of those 20 times as loud (14) a quarter does.
_DROWNED = 8.0
# It counts from this energy over that of the median place on. All that is heard is fitted so many
# teeth before and after its middle, the ringing of the housing included, by waves so many teeth
# apart; directions below this share of the largest singular value are noise. Its energy is summed
# over so many teeth, at so many places a tooth.
_EVENT = 6.0
_BEFORE, _AFTER, _STEP, _RANK = 2, 5, 0.5, 1e-2
# Where the rest beside the event tells of the noise, it takes no more of the turn: of a pinion of
# 14 teeth nothing would be left, and a healthy one seem to stand out 20 times.
_EVENT_OF_TURN = 0.25
_EVENT_TEETH, _PLACES = 3, 8
# Share of the lines that the fit must leave to tell of anything beside the event: one in N lines of
# a sun that meets N planets are too few.
_LEAST_LEFT = 0.1
# Mean square of the rest that noise leaves at least: of 1,500 healthy gears one in a thousand has
# left less than 0.12.
_LEAST_MISFIT = 0.1
# Share of an event's energy that is left at every other tooth when all that can be followed of it
# is taken off: a crack that grows from 10 to 60 % raises the rest by 0.006 to 0.01 of its own.
_LEFT_BY_EVENT = 0.01
# Times that event and angle are sought, and change of the angle [teeth] at which that ends.
_ROUNDS, _SETTLED = 2, 0.25


@dataclass(frozen=True, kw_only=True, eq=False)
class GearPattern:
    """A gear's lines on a full grid 0..top of multiples of its rotation.

    Parameters
    ----------
    amplitude : ndarray of complex, shape (rows, top + 1)
        Lines; 0 where none was measured. A row for each channel or, where planets pass the sensor,
        three: of the lines themselves, then of those beside them (`WheelPattern.beside`).
    variance : ndarray of float, shape (rows, top + 1)
        Mean square error of each.
    usable : ndarray of bool, shape (1 or 3, top + 1)
        Whether the line was measured there and is no mesh harmonic of any stage.
    channels : int
        Number of channels.
    """

    amplitude: ComplexArray
    variance: FloatArray
    usable: NDArray[np.bool_]
    channels: int

    @classmethod
    def of(cls, wheel: WheelPattern, top: int) -> GearPattern:
        """Return the pattern up to a multiple of the rotation."""
        inside = wheel.number <= top
        number = wheel.number[inside]
        lines = np.concatenate([own[:, inside] for own in (wheel.amplitude, *wheel.beside)])
        beside = [own[:, inside] for own in wheel.beside_variance]
        own = np.maximum(wheel.variance[:, inside], np.finfo(float).tiny)
        amplitude = np.zeros((len(lines), top + 1), dtype=complex)
        variance = np.ones((len(lines), top + 1))
        usable = np.zeros((1 + len(beside), top + 1), dtype=bool)
        amplitude[:, number] = lines
        variance[:, number] = np.concatenate([own, *(np.where(e > 0, e, 1.0) for e in beside)])
        usable[:, number] = [~wheel.mesh[inside], *(np.all(e > 0, axis=0) for e in beside)]
        return cls(amplitude=amplitude, variance=variance, usable=usable, channels=len(own))

    @property
    def top(self) -> int:
        """Highest multiple of the rotation."""
        return int(self.usable.shape[1]) - 1

    def turned(self, angle: float) -> GearPattern:
        """Return the same pattern `angle` turns later."""
        turn = np.exp(2j * np.pi * angle * np.arange(self.top + 1))
        return replace(self, amplitude=self.amplitude * turn)

    def turned_to(self, new: GearPattern, teeth: int) -> tuple[GearPattern, float]:
        """Return the same pattern at the angles of another, and by how many turns it is later.

        The carrier stands anywhere when the gear comes to the same angle again: that turns all
        lines at one place beside the gear's by one phase.
        """
        angle = turning(self, new, teeth)
        found = self.turned(angle)
        told = found.amplitude.conj() * new.amplitude / (found.variance + new.variance)
        told = told.reshape(len(self.usable), self.channels, -1).sum(axis=1)
        phase = np.where(self.usable & new.usable, told, 0.0).sum(axis=1)
        phase[0] = 1.0
        phase /= np.maximum(np.abs(phase), np.finfo(float).tiny)
        turned = found.amplitude * np.repeat(phase, self.channels)[:, None]
        return replace(found, amplitude=turned), angle


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

    @cached_property
    def misfit(self) -> float:
        """Mean square of the rest beside the greatest event: about 1 where the law holds.

        The event is all that the lines about one place of the turn can follow, from two teeth
        before to five after it, a quarter of the turn at most; it draws the gain of the healthy
        pattern too.
        """
        place = int(np.argmax(self._energy)) / _STEPS + CONTACT_CENTRE
        reach = min(1.0, _EVENT_OF_TURN * self.teeth / (_BEFORE + _AFTER) / self.meetings)
        after = (place + reach * np.arange(-_BEFORE, _AFTER + 0.25, _STEP)) / self.teeth
        delay = (np.arange(self.meetings)[:, None] / self.meetings + after).ravel()
        left = freedom = 0.0
        for band in self.bands:
            waves = np.exp(-2j * np.pi * np.outer(band.number, delay))
            offset = (band.number - self.teeth * band.harmonic) / self.teeth
            told = max(1, min(len(_GAIN), len(offset) // _LINES_A_GAIN))
            gains = offset[:, None] ** np.arange(told)
            for rest, deviation, pattern in zip(
                band.rest, band.deviation, band.pattern, strict=True
            ):
                columns = np.hstack([waves / deviation[:, None], gains * pattern[:, None]])
                columns /= np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
                side, size, _ = np.linalg.svd(columns, full_matrices=False)
                event = side[:, size > _RANK * size[0]]
                followed = float(np.sum(np.abs(event.conj().T @ rest) ** 2))
                left += float(np.sum(np.abs(rest) ** 2)) - followed
                freedom += len(rest) - event.shape[1]
        lines = sum(band.rest.size for band in self.bands)
        if freedom < _LEAST_LEFT * lines:
            return 1.0
        left /= max(freedom, 1.0)
        leaked = _LEFT_BY_EVENT * float(self._energy.max()) / lines
        return max(left - leaked, min(left, 1.0), _LEAST_MISFIT)

    @cached_property
    def peak(self) -> float:
        """Highest energy over two teeth, over that beside it and by what is expected there."""
        return float(self._standing_out.max())

    @cached_property
    def by_tooth(self) -> FloatArray:
        """Energy about each tooth's contact over that beside the largest, by what is expected."""
        return self._standing_out[np.arange(self.teeth) * _STEPS]

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
        rests = [[band.known[r] for band in self.bands] for r in range(len(self.bands[0].known))]
        learned = [self._uneven(rest) for rest in rests]
        if not learned:
            return expected
        changing = float(np.mean([band.changing for band in self.bands]))
        return np.asarray(np.maximum(expected, 1.0 + changing * (np.mean(learned, axis=0) - 1.0)))

    def _uneven(self, lines_of_bands: Sequence[ComplexArray]) -> FloatArray:
        """Energy around the turn over that of the median place."""
        energy = self._around(lines_of_bands)
        return energy / max(float(np.median(energy)), np.finfo(float).tiny)

    @cached_property
    def departs(self) -> float:
        """Share of what is left beside the greatest event that is departure, not noise, 0 to 1."""
        lines = sum(band.rest.size for band in self.bands)
        noise = sum(float(np.sum((band.noise / band.deviation) ** 2)) for band in self.bands)
        return 1.0 - noise / lines / max(1.0, self.misfit)

    @cached_property
    def expected_by_tooth(self) -> FloatArray:
        """`expected_around` at each tooth's contact, shape (teeth,)."""
        return self.expected_around[np.arange(self.teeth) * _STEPS]

    def recurrence(
        self, tooth: int, blocks: ComplexArray, wheel: WheelLines
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

        Returns
        -------
        again : float
            Energy over what the scatter of the blocks leaves there: about 1 for what came in one
            block alone, however loud, k for what came in k of many. Low, too, where few of the
            lines tell of a weak event.
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
        steps = np.add.outer(np.arange(self.teeth) * _STEPS + _WINDOW, np.arange(0, 2 * _STEPS, 4))
        met = np.add.outer(np.arange(self.meetings) / self.meetings, steps / _STEPS / self.teeth)
        sides = dict(zip(_SIDES, (wheel.lines, *wheel.beside), strict=False))
        scatter = np.zeros(self.teeth)
        for band in self.bands:
            own = some[:, :, sides[band.side][np.searchsorted(wheel.number, band.number)]]
            waves = np.exp(2j * np.pi * np.outer(band.number, met.ravel()))
            told = variance_of_mean((own / band.deviation) @ waves).reshape(-1, *met.shape)
            scatter += told.sum(axis=0).mean(axis=(0, 2))
        again = float(self._energy[tooth * _STEPS] / scatter[tooth])
        return again, float(scatter[tooth] / np.median(scatter))

    @cached_property
    def _energy(self) -> FloatArray:
        """Energy of the rest around the turn."""
        return self._around([band.rest for band in self.bands])

    @cached_property
    def _standing_out(self) -> FloatArray:
        """Energy around the turn over what is expected at each place."""
        lines = sum(band.rest.size for band in self.bands)
        return np.asarray(self._energy / self.expected_around / (self.misfit * lines))

    def _around(self, lines_of_bands: Sequence[ComplexArray]) -> FloatArray:
        """Energy in windows of two teeth around the turn, centred on each step."""
        steps = _STEPS * self.teeth
        energy = np.zeros(steps)
        for band, values in zip(self.bands, lines_of_bands, strict=True):
            lines = np.zeros((len(values), steps), dtype=complex)
            lines[:, band.number % steps] = values
            energy += np.sum(np.abs(np.fft.ifft(lines, axis=1) * steps) ** 2, axis=0)
        wide = 2 * _STEPS
        ends = np.concatenate([[0.0], np.cumsum(np.tile(energy, 3))])
        first = steps + np.arange(steps) + _WINDOW
        window: FloatArray = (ends[first + wide] - ends[first]) / wide
        again = np.rint(np.arange(self.meetings) * steps / self.meetings).astype(int)
        met: FloatArray = window[(np.arange(steps)[:, None] + again) % steps].mean(axis=1)
        return met


#: Steps of the waveform for each tooth, and the middle of the contact of tooth 1 [teeth] after the
#: angle zero: tooth j is in contact from j - 1 to about j + 0.6 mesh periods after it.
_STEPS, CONTACT_CENTRE = 8, 0.8
# Blocks by which it is told whether an event comes again, at most.
_MOST_BLOCKS = 256
# Step at which the window of two teeth about that middle begins.
_WINDOW = round((CONTACT_CENTRE - 1.0) * _STEPS)


@dataclass(frozen=True, kw_only=True, eq=False)
class GearLaw:
    """The law of one gear's healthy lines.

    Parameters
    ----------
    wheel : WheelPattern
        The gear, as the first reference has it.
    patterns : tuple of GearPattern
        Of the references, turned alike.
    states : ndarray of float, shape (references, 2)
        Their operating states.
    load : float, > 0
        How the teeth are loaded (`gears.mechanics.load_share`).
    """

    wheel: WheelPattern
    patterns: tuple[GearPattern, ...]
    states: FloatArray
    load: float = np.inf

    @cached_property
    def _left_out(self) -> list[tuple[list[BandDeviation], FloatArray]]:
        """How each reference departs from what the others predict; nothing of one reference."""
        count, found = len(self.patterns), []
        nothing = np.zeros((0, *self.patterns[0].amplitude.shape), dtype=complex)
        for row in range(count if count > 1 else 0):
            rest = [n for n in range(count) if n != row]
            others = replace(
                self, patterns=tuple(self.patterns[n] for n in rest), states=self.states[rest]
            )
            pattern, parts = others._predicted(self.states[row])
            found.append((others._bands(self.patterns[row], pattern, parts, {}, nothing), parts))
        return found

    @cached_property
    def _scales(self) -> dict[tuple[int, int], FloatArray]:
        """Variances of departures over their priors, by band: how references depart from another.

        Where they depart less than the prior has it, the machine is steady in all parts, scatter
        and change with the state. Where they depart more, each tells of the parts by their
        shares in it: a machine that changes much with its load need not scatter much beside a
        reference of the same load, nor change with its speed. Shape (parts, channels).
        """
        found: dict[tuple[int, int], list[tuple[FloatArray, FloatArray]]] = {}
        for bands, parts in self._left_out:
            for band in bands:
                seen = np.mean(np.abs(band.rest) ** 2, axis=1)
                found.setdefault((band.side, band.harmonic), []).append((parts / parts.sum(), seen))
        scales = {}
        for place, told in found.items():
            share, seen = (np.array(each) for each in zip(*told, strict=True))
            common = (_WORTH + seen.sum(axis=0)) / (_WORTH + len(seen))
            parts = (_WORTH + share.T @ seen) / (_WORTH + share.sum(axis=0)[:, None])
            scales[place] = np.clip(np.minimum(common, parts), _LEAST_SCALE, _MOST_SCALE)
        return scales

    @cached_property
    def _departures(self) -> ComplexArray:
        """Departures of the references, whitened, on the grid of their patterns."""
        grid = self.patterns[0].amplitude
        found = np.zeros((len(self._left_out), *grid.shape), dtype=complex)
        for own, (bands, _) in zip(found, self._left_out, strict=True):
            for band in bands:
                first = _SIDES.index(band.side) * self.patterns[0].channels
                own[first : first + len(band.rest), band.number] = band.rest
        return found

    def deviation(
        self, wheel: WheelPattern, state: FloatArray, *, same_zero: bool
    ) -> GearDeviation | None:
        """Hold a new recording against the law.

        Parameters
        ----------
        wheel : WheelPattern
            The gear's lines in the new recording, in the channels of the law.
        state : ndarray of float, shape (2,)
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
        law = self._cut(top)
        known, parts = law._predicted(state)
        known, angle = (known, 0.0) if same_zero else known.turned_to(new, wheel.teeth)
        turn = np.exp(2j * np.pi * angle * np.arange(top + 1))
        left_out = self._departures[:, :, : top + 1] * turn
        bands = tuple(law._bands(new, known, parts, self._scales, left_out))
        lines = new.amplitude[:, :: wheel.teeth]
        meshes = np.abs(lines) ** 2
        if not bands:
            return None
        return GearDeviation(
            stage=wheel.stage,
            gear=wheel.gear,
            teeth=wheel.teeth,
            order=wheel.order,
            bands=bands,
            # planets may put a mesh harmonic a turn of the carrier beside its place
            mesh_power=meshes.reshape(-1, new.channels, meshes.shape[1]).sum(axis=0),
            shift_turns=angle,
            mesh_lines=None if len(wheel.beside) else lines,
            light=max(0.0, float(self.states[:, 0].min() - state[0])),
            load=self.load,
        )

    def _cut(self, top: int) -> GearLaw:
        short = slice(0, top + 1)
        return replace(
            self,
            patterns=tuple(
                replace(
                    p,
                    amplitude=p.amplitude[:, short],
                    variance=p.variance[:, short],
                    usable=p.usable[:, short],
                )
                for p in self.patterns
            ),
        )

    def _predicted(self, state: FloatArray) -> tuple[GearPattern, FloatArray]:
        """Healthy pattern at a state, and the parts of the variance of departures from it."""
        unit = np.array([load_unit(self.load), 1.0])
        kriging = Kriging.of(self.states / unit, state / unit, _SCATTER, _SLOPE)
        weights = kriging.weights
        pattern = replace(
            self.patterns[0],
            amplitude=np.tensordot(weights, [p.amplitude for p in self.patterns], 1),
            variance=np.tensordot(weights**2, [p.variance for p in self.patterns], 1),
            usable=np.logical_and.reduce([p.usable for p in self.patterns]),
        )
        return pattern, kriging.parts

    def _bands(
        self,
        new: GearPattern,
        known: GearPattern,
        parts: FloatArray,
        scales: dict[tuple[int, int], FloatArray],
        left_out: ComplexArray,
    ) -> list[BandDeviation]:
        teeth, found = self.wheel.teeth, []
        harmonics = list(enumerate(mesh_bands(teeth, new.top), start=1))
        for (place, usable), (harmonic, band) in product(
            enumerate(known.usable & new.usable), harmonics
        ):
            use, side = band[usable[band]], _SIDES[place]
            offset = use - teeth * harmonic
            far = np.abs(offset) > NEAR
            if far.sum() < _LEAST_LINES:
                continue
            rows = slice(place * new.channels, (place + 1) * new.channels)
            scale = scales.get((side, harmonic), np.ones((len(parts), new.channels)))
            pattern = known.amplitude[rows, use]
            noise = new.variance[rows, use] + known.variance[rows, use]
            variance = noise + (parts @ scale)[:, None] * _loudness(pattern, offset)
            rest = _without_gain(
                new.amplitude[rows, use] - pattern, pattern, variance, offset / teeth
            )
            found.append(
                BandDeviation(
                    harmonic=harmonic,
                    number=use[far],
                    rest=rest[:, far],
                    deviation=np.sqrt(variance[:, far]),
                    noise=np.sqrt(noise[:, far]),
                    pattern=(pattern / np.sqrt(variance))[:, far],
                    known=left_out[:, rows, use[far]],
                    changing=1.0 - float(parts[0] * scale[0].sum() / (parts @ scale).sum()),
                    side=side,
                )
            )
        return found


def _without_gain(
    rest: ComplexArray, pattern: ComplexArray, variance: FloatArray, place: FloatArray
) -> ComplexArray:
    """Whitened rest after a gain, its slope and its bend across the band have been fitted.

    Ridge regression with the gains' prior; what it takes away of the degrees of freedom is made up.
    """
    weight = 1.0 / np.sqrt(variance)
    told = max(1, min(len(_GAIN), len(place) // _LINES_A_GAIN))
    powers = place ** np.arange(told)[:, None]
    columns = _GAIN[:told, None] * powers * (pattern * weight)[:, None, :]
    value = rest * weight
    gram = columns.conj() @ columns.swapaxes(1, 2)
    inverse = np.linalg.inv(gram + np.eye(told))
    gain = np.einsum("cij,cjn,cn->ci", inverse, columns.conj(), value)
    left = value - np.einsum("ci,cin->cn", gain, columns)
    freedom = np.einsum("cij,cji->c", inverse, gram).real
    lines = value.shape[1]
    return np.asarray(left * np.sqrt(lines / np.maximum(1.0, lines - freedom))[:, None])


def _loudness(pattern: ComplexArray, offset: IntArray) -> FloatArray:
    """Mean power of the lines about each, the mesh harmonic left out."""
    told = (offset != 0).astype(float)
    window = np.ones(2 * _BESIDE + 1)
    # cut by hand: of a band shorter than the window numpy would return the window's length
    own = slice(_BESIDE, _BESIDE + len(told))
    count = np.maximum(np.convolve(told, window)[own], 1.0)
    rows = [np.convolve(told * row, window)[own] / count for row in np.abs(pattern) ** 2]
    return np.array(rows)


def mesh_bands(teeth: int, top: int) -> list[IntArray]:
    """Return multiples of the rotation about each mesh harmonic, half a mesh order either way."""
    bands: list[IntArray] = []
    for k in range(1, (top + teeth // 2) // teeth + 1):
        low, high = max(1, k * teeth - teeth // 2), min(top, k * teeth + (teeth - 1) // 2)
        if high - low >= 3:
            bands.append(np.arange(low, high + 1))
    return bands


def turning(known: GearPattern, new: GearPattern, teeth: int) -> float:
    """Angle by which a healthy pattern must be turned, whatever one tooth does.

    Parameters
    ----------
    known, new : GearPattern
        A healthy pattern and a new one, of the same lines.
    teeth : int
        z of the gear.

    Returns
    -------
    float
        Turns. Of the angles at which the healthy pattern explains most of the new one, that which
        leaves least at most of the teeth: a damaged tooth may be louder than all else and draws the
        pattern to whichever healthy tooth departs most.
    """
    usable = new.usable[0] & known.usable[0]
    bands = [band[usable[band]] for band in mesh_bands(teeth, new.top)]
    bands = [band for band in bands if len(band) >= _LEAST_LINES]
    if not bands:
        return 0.0
    angle = _best_angle(known, new, bands, teeth)
    for _ in range(_ROUNDS if _louder(known, new, bands) > _DROWNED else 0):
        event = _event(known.turned(angle), new, bands, teeth)
        if event is None:
            break
        beside = replace(new, amplitude=new.amplitude - event)
        # a loud event leaks to all teeth: what is left at them tells nothing then
        moved = float(_likely_angles(known, beside, bands, teeth)[0])
        step = abs((moved - angle + 0.5) % 1.0 - 0.5) * teeth
        angle = moved
        if step < _SETTLED:
            break
    return angle


def _louder(known: GearPattern, new: GearPattern, bands: Sequence[IntArray]) -> float:
    """Power of a new pattern over that of the healthy one, median of bands and channels."""
    own, healthy = (
        np.array([np.sum(np.abs(one.amplitude[:, band]) ** 2, axis=1) for band in bands])
        for one in (new, known)
    )
    told = healthy > 0
    return float(np.median(own[told] / healthy[told])) if told.any() else 0.0


def _best_angle(
    known: GearPattern, new: GearPattern, bands: Sequence[IntArray], teeth: int
) -> float:
    """Of the likely angles that which leaves least at most of the teeth."""
    angles = _likely_angles(known, new, bands, teeth)
    left = _left_at_teeth(known, new, bands, teeth, angles)
    quiet = np.sort(left, axis=1)[:, : max(1, int(_SOUND_TEETH * teeth))].mean(axis=1)
    return float(angles[int(np.argmin(quiet))])


def _event(
    known: GearPattern, new: GearPattern, bands: Sequence[IntArray], teeth: int
) -> ComplexArray | None:
    """Lines of the greatest event in what the healthy pattern leaves; None if there is none.

    All that is heard there is fitted, not what the healthy pattern leaves of it: that would put the
    pattern in its place, at the very angle that is in doubt.
    """
    places = _PLACES * teeth
    energy = np.zeros(places)
    deviations = []
    for band in bands:
        variance = new.variance[:, band] + known.variance[:, band]
        old, value = known.amplitude[:, band], new.amplitude[:, band]
        power = np.sum(np.abs(old) ** 2 / variance, axis=1)
        gain = np.sum(old.conj() * value / variance, axis=1)
        gain /= np.maximum(power, np.finfo(float).tiny)
        deviations.append(np.sqrt(variance))
        folded = np.zeros((len(value), places), dtype=complex)
        folded[:, band % places] = (value - gain[:, None] * old) / deviations[-1]
        energy += np.sum(np.abs(np.fft.ifft(folded, axis=1) * places) ** 2, axis=0)
    wide = _EVENT_TEETH * _PLACES
    ends = np.cumsum(np.tile(energy, 2))
    window = ends[wide : wide + places] - ends[:places]
    if float(window.max()) < _EVENT * float(np.median(window)):
        return None
    middle = (int(np.argmax(window)) + 1 + wide // 2) / _PLACES
    delay = (middle + np.arange(-_BEFORE, _AFTER + 0.25, _STEP)) / teeth
    event = np.zeros_like(new.amplitude)
    for band, deviation in zip(bands, deviations, strict=True):
        waves = np.exp(-2j * np.pi * np.outer(band, delay))
        for channel, scale in enumerate(deviation):
            told = new.amplitude[channel, band] / scale
            size = np.linalg.lstsq(waves / scale[:, None], told, rcond=_RANK)[0]
            event[channel, band] = waves @ size
    return event


def _likely_angles(
    known: GearPattern, new: GearPattern, bands: Sequence[IntArray], teeth: int
) -> FloatArray:
    """Angles [turns] at which the healthy pattern explains most of the new one, best first."""
    top = new.top
    # eight steps per cycle of the highest line: the best angle is met within 3 per cent of power
    steps = 1 << int(np.ceil(np.log2(8 * (top + 1))))
    explained = np.zeros(steps)
    for band in bands:
        weight = 1.0 / (new.variance[:, band] + known.variance[:, band])
        healthy = known.amplitude[:, band]
        product = np.zeros((len(weight), steps), dtype=complex)
        product[:, band] = weight * np.conj(healthy) * new.amplitude[:, band]
        power = np.sum(weight * np.abs(healthy) ** 2, axis=1)
        match = np.abs(np.fft.fft(product, axis=1)) ** 2
        explained += (match / np.maximum(power, np.finfo(float).tiny)[:, None]).sum(axis=0)
    angles, apart = [], max(1, int(_APART * steps / teeth))
    for _ in range(_ANGLES):
        best = int(np.argmax(explained))
        angles.append(best / steps)
        explained[np.arange(best - apart, best + apart + 1) % steps] = -1.0
    return np.array(angles)


def _left_at_teeth(
    known: GearPattern,
    new: GearPattern,
    bands: Sequence[IntArray],
    teeth: int,
    angles: FloatArray,
) -> FloatArray:
    """Energy left at each tooth for each angle, one gain a band fitted, shape (angles, teeth)."""
    left = np.zeros((len(angles), teeth))
    for band in bands:
        turn = np.exp(2j * np.pi * np.outer(angles, band))[:, None]
        variance = new.variance[:, band] + known.variance[:, band]
        healthy, value = known.amplitude[:, band] * turn, new.amplitude[:, band]
        power = np.sum(np.abs(known.amplitude[:, band]) ** 2 / variance, axis=1)
        gain = np.sum(healthy.conj() * (value - healthy) / variance, axis=2)
        gain = 1.0 + gain / (power + 1.0 / _GAIN[0] ** 2)
        rest = (value - gain[:, :, None] * healthy) / np.sqrt(variance)
        folded = np.zeros((*rest.shape[:2], teeth), dtype=complex)
        folded[:, :, band % teeth] = rest
        left += np.sum(np.abs(np.fft.ifft(folded, axis=2) * teeth) ** 2, axis=1)
    return left


def turned_alike(wheels: Sequence[WheelPattern], *, same_zero: bool) -> tuple[GearPattern, ...]:
    """Turn the patterns of one gear in several healthy recordings to the angle of the first.

    Parameters
    ----------
    wheels : sequence of WheelPattern
        The same gear in each, in the same channels.
    same_zero : bool
        Whether they have the same angle zero already.
    """
    top = min(int(wheel.number.max(initial=0)) for wheel in wheels)
    found: list[GearPattern] = []
    for wheel in wheels:
        pattern = GearPattern.of(wheel, top)
        if found and not same_zero:
            # the mean of those that are turned already: it is surer than any one
            mean = replace(
                found[0],
                amplitude=np.mean([p.amplitude for p in found], axis=0),
                variance=np.mean([p.variance for p in found], axis=0) / len(found),
                usable=np.logical_and.reduce([p.usable for p in found]),
            )
            pattern, _ = pattern.turned_to(mean, wheel.teeth)
        found.append(pattern)
    return tuple(found)
