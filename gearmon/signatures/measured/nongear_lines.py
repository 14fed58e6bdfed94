"""Lines of a recording that no gear explains: found and kept as value objects.

Such lines come from bearings, the mains, loose parts, other machines: they stand at no order that
the gears and shafts of the machine can have. On which of two grids one is sharper, angle or time,
tells whether it follows the shafts or stays where it is when the speed wanders.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc, gammainccinv, pdtrc

from gearmon.arrays import FloatArray, IntArray
from gearmon.gears.kinematics import Kinematics
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders import spectra
from gearmon.signals.orders.resampling import InAngle
from gearmon.signals.orders.spectra import FineSpectrum, highest_between
from gearmon.signatures.measured.line_plan import distance_to, known_orders

# Peaks of mere noise that a list of lines may hold, on average.
_NOISE_PEAKS = 0.05
# Most lines kept of a recording: those that stand highest over the noise.
MOST_LINES = 200
# Periods of a line in a piece, at least: what is slower cannot be told from the drift of a sensor.
_PERIODS = 8.0
# Distance from a gear's order at which a line counts as its own [widths of the spectrum].
OWN_WIDTHS = 1.5
# Delay of a mode of the housing [s], 1 % damped at 1.6 kHz: as the speed changes it moves orders
# heard through it. Of 7 lumped machines run up from 0.4 to 1.05 of their speed, three references,
# one showed a gear's own line 0.008 orders away as an unknown one in each sound recording.
_DELAY_S, _COURSE_PARTS = 1e-2, 16
# Load and speed that wander slowly set a skirt about every line: so far [Hz], at most so high.
_SKIRT_HZ, _SKIRT_WIDTHS, _SKIRT_SHARE = 2.0, 16.0, 4e-3
# What the errors of the angle add to it; where nothing is said of them [turns].
_UNKNOWN_ANGLE = 1e-3
# A line that stands still in time must have this share of what follows the shafts about it.
_TIME_SHARE = 0.05
# A line is the sharper one on the grid on which its power is so many times the other's.
_SHARPER = 2.0
# A pair of lines about one so many times stronger, as far as that [orders], and that much alike.
_FAR_STRONGER, _MIRROR, _ALIKE = 4.0, 0.3, 0.25
# Cells an order in which it is remembered what strong lines can hide.
_CELLS_AN_ORDER = 20
# Bands in which the noise is remembered.
_BANDS = 128
# The envelope is looked at up to this order, or this multiple of the highest order of a bearing.
_ENVELOPE_ORDER, _ENVELOPE_HARMONICS = 20.0, 3.5
# Highest multiple of a fundamental that is looked for; unrelated lines stand at as many multiples
# by chance with less than this probability.
_MULTIPLES, _CHANCE = 20, 0.01
KINDS = ("spectrum", "envelope")
LOCKS = ("shaft", "time", "either")


@dataclass(frozen=True, kw_only=True)
class NonGearLine:
    """A line that no gear explains.

    Parameters
    ----------
    kind : {"spectrum", "envelope"}
        Where it stands: in the spectrum, or in that of the squared envelope.
    order : float
        Its mean place [cycles a turn of shaft 1].
    frequency_hz : float
        The same [Hz].
    locked : {"shaft", "time", "either"}
        Whether it follows the speed, stays at its frequency, or the speed is too even to tell.
    level_db : tuple of float
        Level in each channel [dB re 1 unit^2, peak amplitude; of an envelope: dB re 1].
    over_noise_db : tuple of float
        Power over the mean of the noise about it, each channel [dB].
    low_order, high_order : float
        Orders that it sweeps while the speed wanders.
    """

    kind: str
    order: float
    frequency_hz: float
    locked: str
    level_db: tuple[float, ...]
    over_noise_db: tuple[float, ...]
    low_order: float
    high_order: float


@dataclass(frozen=True, kw_only=True, eq=False)
class NoiseGrid:
    """What a spectrum could have shown: its noise, resolution and reach.

    Parameters
    ----------
    kind : {"spectrum", "envelope"}
        Which spectrum.
    width : float
        One over the turns in a piece [orders].
    top : float
        Highest order.
    pieces : int
        Pieces whose powers were averaged.
    least_db : float
        Power over noise from which lines were listed [dB].
    looked_at : float
        Independent values, all channels.
    noise_db : ndarray of float, shape (channels, bands)
        Mean noise power of a bin in equal bands from 0 to `top` [dB, as the levels].
    hidden_db : ndarray of float32, shape (channels, cells)
        Level up to which a line about a far stronger one is taken for a part of that and not
        listed, in equal cells from 0 to `top` [dB].
    """

    kind: str
    width: float
    top: float
    pieces: int
    least_db: float
    looked_at: float
    noise_db: FloatArray
    hidden_db: NDArray[np.float32]

    def unseen_at(self, order: FloatArray) -> FloatArray:
        """Level up to which lines would not be listed, shape (channels, orders) [dB]."""
        cells, bands = self.hidden_db.shape[-1], self.noise_db.shape[-1]
        cell = np.minimum((order * cells / self.top).astype(int), cells - 1)
        middles = (np.arange(bands) + 0.5) * self.top / bands
        noise = np.array([np.interp(order, middles, row) for row in self.noise_db])
        return np.maximum(noise + self.least_db, self.hidden_db[:, cell])


@dataclass(frozen=True, kw_only=True, eq=False)
class NonGearLines:
    """The lines of no gear of one recording and what else could have been seen.

    Parameters
    ----------
    lines : tuple of NonGearLine
        Strongest over the noise first.
    grids : tuple of NoiseGrid
        Of the spectrum and of the envelope.
    speed_hz : float
        Mean speed of shaft 1 [Hz].
    cell_hz : float
        Width of the cells of `in_time_db` [Hz].
    in_time_db : ndarray of float32, shape (channels, cells)
        Highest power in the spectrum against time, gears included, in cells from 0 Hz on: no line
        of the mains was stronger, even where a gear's line hid it [dB].
    """

    lines: tuple[NonGearLine, ...]
    grids: tuple[NoiseGrid, ...]
    speed_hz: float
    cell_hz: float
    in_time_db: NDArray[np.float32]

    def __iter__(self) -> Iterator[NonGearLine]:
        """Go through the lines."""
        return iter(self.lines)

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.lines)

    @cached_property
    def columns(self) -> dict[str, NDArray[np.void]]:
        """Lines as arrays with fields, by their kind: places in the list, and what they are."""
        levels = [(name, float, (len(self.in_time_db),)) for name in ("level_db", "over_noise_db")]
        single = [("kind", "U8"), ("locked", "U6"), ("order", float), ("frequency_hz", float)]
        fields: list[Any] = [*single, *levels]
        told = ((getattr(line, name) for name, *_ in fields) for line in self.lines)
        every = np.array([(i, *own) for i, own in enumerate(told)], [("place", int), *fields])
        return {kind: every[every["kind"] == kind] for kind in KINDS}

    def grid(self, kind: str) -> NoiseGrid:
        """Return the grid of the spectrum or of the envelope."""
        return next(grid for grid in self.grids if grid.kind == kind)

    def highest_in_time(self, low_hz: FloatArray, high_hz: FloatArray) -> FloatArray:
        """Highest powers in time between frequencies [dB], shape (channels, ranges); NaN beyond."""
        first, last = (np.array([low_hz, high_hz]) / self.cell_hz).astype(int)
        end = self.in_time_db.shape[-1] - 1
        found = highest_between(self.in_time_db, np.clip(first, 0, end), np.clip(last, 0, end) + 1)
        return np.where(last <= end, found, np.nan)


def nongear_lines(
    vibration: InAngle, train: Kinematics, order_spectrum: FineSpectrum
) -> NonGearLines:
    """List the lines of a recording that no gear explains.

    Parameters
    ----------
    vibration : InAngle
    train : Kinematics
        What gears, shafts and bearings the machine has.
    order_spectrum : FineSpectrum
        `fine_order_spectrum` of the vibration.

    Returns
    -------
    NonGearLines

    Notes
    -----
    Lines within 1.5 widths of a gear's order, and what the path moves it by as the speed changes,
    are left out, also those of bearings, for nothing can tell them apart there; so is what slow
    wander of load and speed sets about strong lines.
    """
    course, turns = _Course(vibration.track), vibration.track.turns
    # pieces of the whole recording: of very many only some were looked at
    pieces = max(1, round(float(turns[-1] - turns[0]) * order_spectrum.width))
    by_time = spectra.fine_spectrum(vibration.samples, vibration.sampling_rate_hz, pieces)
    cell_hz = course.mean / _CELLS_AN_ORDER
    in_time = _highest_in_cells(by_time, cell_hz)
    grid = _noise_grid("spectrum", order_spectrum, course, in_time)
    in_angle = _Standing(grid, order_spectrum, course, train)
    found = [*_sharp_in_angle(in_angle, by_time)]
    found += _sharp_in_time(_Standing(grid, by_time, course), order_spectrum)
    bearings = [line.order for line in train.lines if line.kind == "bearing"]
    top = max([_ENVELOPE_ORDER] + [_ENVELOPE_HARMONICS * order for order in bearings])
    envelope = spectra.fine_envelope_spectrum(vibration, top, pieces)
    beats = _noise_grid("envelope", envelope, course)
    modulations = _Standing(beats, envelope, course, train)
    reach, power = course.reach(envelope.width), modulations.power
    # slow wander of load and speed modulates everything
    kept = power > course.skirt(modulations.places) * modulations.about(reach)
    for i in np.flatnonzero(kept & (modulations.places > reach)):
        found.append(modulations.line(i, [modulations.places[i]] * 3, "shaft"))
    found.sort(key=lambda line: -max(line.over_noise_db))
    # lines are listed from the level of those left out
    left_out = {own.kind: own.least_db for own in (grid, beats)}
    for line in found[MOST_LINES:]:
        left_out[line.kind] = max(left_out[line.kind], *line.over_noise_db)
    return NonGearLines(
        lines=tuple(found[:MOST_LINES]),
        grids=tuple(replace(own, least_db=left_out[own.kind]) for own in (grid, beats)),
        speed_hz=course.mean,
        cell_hz=cell_hz,
        in_time_db=_decibels(in_time),
    )


def noise_exceeds(ratio: float | FloatArray, pieces: int) -> FloatArray:
    """Probability that a noise power exceeds `ratio` times its mean.

    Parameters
    ----------
    ratio : float or ndarray of float
        Power over mean noise power, >= 0.
    pieces : int
        Pieces whose powers were averaged: a gamma law of that shape.

    Returns
    -------
    ndarray of float
    """
    return np.asarray(gammaincc(pieces, pieces * np.asarray(ratio)), dtype=np.float64)


def _mean_over_median(pieces: int) -> float:
    """Mean over median of a gamma law of shape `pieces`."""
    return pieces / float(gammainccinv(pieces, 0.5))


def _highest_in_cells(spectrum: FineSpectrum, cell: float) -> FloatArray:
    """Highest power of each cell, shape (channels, cells)."""
    bins = spectrum.power.shape[-1]
    edges = np.arange(int(bins * spectrum.step / cell) + 1) * (cell / spectrum.step)
    # cells finer than the bins share them
    first = np.minimum(edges.astype(int), bins - 1)
    return np.asarray(np.maximum.reduceat(spectrum.power, first, axis=-1), dtype=np.float64)


def _decibels(power: FloatArray) -> NDArray[np.float32]:
    return np.asarray(10 * np.log10(np.maximum(power, np.finfo(float).tiny)), dtype=np.float32)


def _highest_within(values: FloatArray, reach: IntArray) -> FloatArray:
    """Return the highest within so many places to either side of each, fewer at the ends."""
    place = np.arange(len(reach))
    ends = np.clip([place - reach, place + reach + 1], 0, values.shape[-1])
    return highest_between(values, *ends)


def _noise_grid(
    kind: str, spectrum: FineSpectrum, course: _Course, in_time: FloatArray | None = None
) -> NoiseGrid:
    channels, bins = spectrum.floor.shape
    # the floor is a running median already
    middles = (np.arange(min(_BANDS, bins)) + 0.5) * bins / min(_BANDS, bins)
    noise = spectrum.floor[:, middles.astype(int)] * _mean_over_median(spectrum.pieces)
    # peaks between the independent lines of a Hann window: half as many again
    looked_at = 1.5 * channels * spectrum.top / spectrum.width
    # so few peaks of noise stand so far above its mean
    least = gammainccinv(spectrum.pieces, min(0.5, _NOISE_PEAKS / looked_at)) / spectrum.pieces
    # up to a share of stronger lines about it a line is taken for a part of these
    highest = _highest_in_cells(spectrum, 1 / _CELLS_AN_ORDER)
    orders = (np.arange(highest.shape[-1]) + 0.5) / _CELLS_AN_ORDER
    reach = 1 + int(np.ceil(course.reach(spectrum.width) * _CELLS_AN_ORDER))
    hidden = course.skirt(orders) * _highest_within(highest, np.full(len(orders), reach))
    if in_time is not None:
        # so is what was smeared over angle, or is near enough to what was not
        swing = max(course.high / course.mean - 1, 1 - course.low / course.mean)
        cells = 1 + np.ceil((swing * orders + 2 * spectrum.width) * _CELLS_AN_ORDER)
        count = min(in_time.shape[-1], hidden.shape[-1])
        wide = _highest_within(in_time, 2 ** np.ceil(np.log2(cells[:count])).astype(int))
        hidden[:, :count] = np.maximum(hidden[:, :count], wide / _SHARPER)
    return NoiseGrid(
        kind=kind,
        width=spectrum.width,
        top=spectrum.top,
        pieces=spectrum.pieces,
        least_db=float(10 * np.log10(least)),
        looked_at=looked_at,
        noise_db=10 * np.log10(noise),
        hidden_db=_decibels(hidden),
    )


class _Course:
    """Speed of shaft 1 while recording [Hz], and how surely its angle is known [turns].

    And by what share at most the path moves orders as the speed changes.
    """

    def __init__(self, track: AngleTrack) -> None:
        self.low, self.high = 0.999 * track.speed_hz.min(), 1.001 * track.speed_hz.max()
        self.mean, known = track.mean_hz, track.uncertainty_turns
        self.angle = float(known) if np.isfinite(known) else _UNKNOWN_ANGLE
        parts = np.linspace(track.time_s[0], track.time_s[-1], _COURSE_PARTS + 1)
        change = np.diff(np.log(np.diff(track.turns_at(parts)))) / (parts[1] - parts[0])
        self.moved = _DELAY_S * float(np.max(np.abs(change)))

    def skirt(self, orders: FloatArray) -> FloatArray:
        """Share of a line's power that may stand about it: slow wander, and errors of the angle."""
        swing = 2 * np.pi * orders * self.angle
        return np.asarray(np.minimum(_SKIRT_SHARE + swing**2, 0.5), dtype=np.float64)

    def reach(self, width: float) -> float:
        """How far that goes [orders], in a spectrum of this resolution."""
        return max(_SKIRT_WIDTHS * width, _SKIRT_HZ / self.mean)


class _Standing:
    """Peaks that stand out of a spectrum, each in the channel in which it is clearest.

    Where the machine is given, those at orders of its gears and shafts are left out.
    """

    def __init__(
        self,
        grid: NoiseGrid,
        spectrum: FineSpectrum,
        course: _Course,
        train: Kinematics | None = None,
    ) -> None:
        self.kind, self.spectrum, self.course = grid.kind, spectrum, course
        self.over_median = _mean_over_median(spectrum.pieces)
        peaks = spectra.clear_peaks(spectrum, self.over_median * 10 ** (grid.least_db / 10))
        places = np.asarray(spectrum.step * peaks, dtype=np.float64)
        kept = places > _PERIODS * spectrum.width
        if train is not None:
            known = known_orders(train, spectrum.top, spectrum.width)
            own = OWN_WIDTHS * spectrum.width + course.moved * places
            kept &= distance_to(known, places) > own
        self.peaks, self.places = peaks[kept], places[kept]
        power = spectrum.power[:, self.peaks]
        self.rows = np.argmax(power / spectrum.floor[:, self.peaks], axis=0)
        self.power = power[self.rows, np.arange(len(self.peaks))]

    def highest(self, spectrum: FineSpectrum, low: FloatArray, high: FloatArray) -> FloatArray:
        """Highest power of a spectrum between two places a peak, in the peak's channel."""
        found = spectrum.highest_near(low, high)[self.rows, np.arange(len(self.peaks))]
        return np.asarray(found, dtype=np.float64)

    def about(self, reach: float) -> FloatArray:
        """Highest power of the same spectrum so far about each peak."""
        return self.highest(self.spectrum, self.places - reach, self.places + reach)

    def mirrored(self, i: np.intp) -> bool:
        """Whether a peak is one of a pair about a far stronger line: a modulation of it.

        A track of the angle that swings about the true one sets such pairs about every strong line.
        """
        power, peak = self.spectrum.power[self.rows[i]], int(self.peaks[i])
        reach = round(_MIRROR / self.spectrum.step)
        first = max(0, peak - reach)
        centre = first + int(np.argmax(power[first : peak + reach + 1]))
        image = 2 * centre - peak
        if power[centre] < _FAR_STRONGER * power[peak] or not 2 <= image < len(power) - 2:
            return False
        return bool(power[image - 2 : image + 3].max() > _ALIKE * power[peak])

    def line(self, i: np.intp, orders: Sequence[float], locked: str) -> NonGearLine:
        """Return a peak as a line, given its mean, lowest and highest order."""
        power = np.maximum(self.spectrum.power[:, self.peaks[i]], np.finfo(float).tiny)
        noise = self.spectrum.floor[:, self.peaks[i]] * self.over_median
        order, low, high = map(float, orders)
        return NonGearLine(
            kind=self.kind,
            order=order,
            frequency_hz=order * self.course.mean,
            locked=locked,
            level_db=tuple((10 * np.log10(power)).tolist()),
            over_noise_db=tuple((10 * np.log10(power / noise)).tolist()),
            low_order=low,
            high_order=high,
        )


def _sharp_in_angle(found: _Standing, by_time: FineSpectrum) -> Iterator[NonGearLine]:
    orders, course, margin = found.places, found.course, 2 * by_time.width
    about = found.about(course.reach(found.spectrum.width))
    other = found.highest(by_time, orders * course.low - margin, orders * course.high + margin)
    # a line that stands still in time is smeared over angle: what is left of it there is no line
    kept = (found.power > course.skirt(orders) * about) & (_SHARPER * found.power > other)
    # what leaves the band as the speed changes cannot be looked for in time
    kept &= orders * course.high < by_time.top
    for i in np.flatnonzero(kept):
        if not found.mirrored(i):
            locked = "shaft" if found.power[i] > _SHARPER * other[i] else "either"
            yield found.line(i, [orders[i]] * 3, locked)


def _sharp_in_time(found: _Standing, by_angle: FineSpectrum) -> Iterator[NonGearLine]:
    hertz, course = found.places, found.course
    low, high = hertz / course.high, hertz / course.low
    margin, reach = 2 * by_angle.width, course.reach(by_angle.width)
    kept = found.power > _SHARPER * found.highest(by_angle, low - margin, high + margin)
    kept &= found.power > _TIME_SHARE * found.highest(by_angle, low - reach, high + reach)
    # of the lines in time only the even skirts of their own kind can be taken for others
    kept &= found.power > _SKIRT_SHARE * found.about(reach * course.mean)
    for i in np.flatnonzero(kept):
        yield found.line(i, [hertz[i] / course.mean, low[i], high[i]], "time")


def harmonic_sources(lines: Sequence[NonGearLine], widths: dict[str, float]) -> list[list[int]]:
    """Group lines that are multiples of one another.

    Parameters
    ----------
    lines : sequence of NonGearLine
        Of one recording.
    widths : dict of str to float
        Resolution of the spectrum and of the envelope [orders], by the kind of line.

    Returns
    -------
    list of list of int
        Positions of the lines of each source, fundamental first. Each line stands in one source;
        those of the spectrum and of the envelope, and those that follow the shafts and that keep
        their frequency, are held apart.

    Notes
    -----
    A line is a multiple of a fundamental if it stands within a width of it, and as many lines would
    hardly stand so near to multiples by chance: unrelated ones fall on them as a Poisson law has
    it, each with the share of the axis that the widths about the multiples cover. A source whose
    fundamental is not listed is not put together.
    """
    apart: dict[tuple[str, bool], list[int]] = {}
    for i in sorted(range(len(lines)), key=lambda i: lines[i].order):
        apart.setdefault((lines[i].kind, lines[i].locked == "time"), []).append(i)
    found = []
    for (kind, _), left in sorted(apart.items()):
        while left:
            group = [0, *_multiples([lines[i].order for i in left], widths[kind])]
            found.append([left[place] for place in group])
            left = [i for place, i in enumerate(left) if place not in group]
    return found


def _multiples(orders: Sequence[float], width: float) -> list[int]:
    """Return which rising orders are multiples of the first, none if that may be chance."""
    base = orders[0]
    # a fundamental is known to half a width; each multiple found tells it more finely
    known, at, found, expected = base, 1, list[int](), 0.0
    for place in range(1, bisect_left(orders, (_MULTIPLES + 0.5) * base)):
        number = round(orders[place] / known)
        reach = width * max(1.0, number / at)
        expected += min(1.0, 2 * reach / base)
        if number > 1 and abs(orders[place] - number * known) <= reach:
            found.append(place)
            if number > at:
                known, at = orders[place] / number, number
    return found if found and pdtrc(len(found) - 1, expected) <= _CHANCE else []
