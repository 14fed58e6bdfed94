"""Spectra against the angle of a shaft: of whole recordings, and along them as order maps.

Fine spectra resolve as much as a recording allows, against angle or against time. Where the speed
wanders, a line that follows the shaft is sharp against angle and smeared against time; a line of
the mains is the reverse. Both spectra are calibrated alike, so that the power of a peak tells on
which of the two grids it is the sharper one.

An order map is calibrated amplitude against order, along a recording's time or speed.
Half-overlapped windowed blocks of equal angle are transformed one by one; their powers are averaged
in rows of equal time or equal speed. A line locked to a shaft stands upright in the map whatever
the speed does; a resonance or an electrical line slants.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft

from gearmon.arrays import FloatArray, IntArray
from gearmon.errors import ArgumentError, check_positive, check_word
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack, check_track
from gearmon.signals.orders.resampling import READ_UP_TO, AngleGrid, InAngle, resample_to_angle
from gearmon.signals.spectra import (
    fast_length,
    local_floor,
    noise_bandwidth,
    transform,
    window,
    window_powers,
)
from gearmon.threads import side_by_side

# Bins of the running median that tells the noise under the lines.
_FLOOR_BINS, _NARROWEST = 384, 24
# Pieces of a long recording that are looked at, spread over all of it.
_MOST_PIECES = 8
# Places between 0 and half a step at which what it takes of a line is computed.
_SHARES = 4096
# Power of a Hann window's side lobes over that of its main lobe, with 8 dB to spare: the share not
# exceeded within so many widths once those of the row before are left out (18 dB an octave).
_LOBES = ((2.0, 1.0), (4.0, 4e-3), (16.0, 6e-5))
#: Most rows of a map along time, and along speed.
TIME_ROWS, SPEED_ROWS = 200, 60
# Rows of speed are no finer than this share of the mean, and hold some blocks each.
_FINEST_SPEED, _BLOCKS_A_ROW = 1e-3, 3


@dataclass(frozen=True, kw_only=True, eq=False)
class FineSpectrum:
    """Power of whole signals on a fine grid of orders or of frequencies.

    Parameters
    ----------
    power : ndarray of float, shape (channels, bins)
        Squared peak amplitude that a line on the bin has [unit^2].
    floor : ndarray of float, shape (channels, bins)
        Running median of the power, > 0 [unit^2].
    step : float
        Distance of the bins [orders or Hz].
    width : float
        One over the length of the pieces [orders or Hz]: a line fills twice that on either side.
    pieces : int
        Pieces whose powers were averaged, >= 1.
    """

    power: FloatArray
    floor: FloatArray
    step: float
    width: float
    pieces: int

    @cached_property
    def quality(self) -> FloatArray:
        """log(1 + power over floor), mean over the channels, shape (bins,)."""
        return np.asarray(np.log1p(self.power / self.floor).mean(axis=0))

    @property
    def top(self) -> float:
        """Place of the last bin [orders or Hz]."""
        return float((self.power.shape[-1] - 1) * self.step)

    def highest_near(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """Highest power between two places each, shape (channels, places).

        Parameters
        ----------
        low, high : ndarray of float, shape (places,)
            Ends of the ranges [orders or Hz], low <= high; at least the nearest bin is taken.

        Returns
        -------
        ndarray of float, shape (channels, places)
        """
        last = self.power.shape[-1] - 1
        first = np.clip(np.rint(low / self.step).astype(int), 0, last)
        stop = np.clip(np.rint(high / self.step).astype(int), first, last) + 1
        return highest_between(self.power, first, stop)


def highest_between(values: NDArray[np.floating], first: IntArray, stop: IntArray) -> FloatArray:
    """Highest of the values from each first one to before each stop, along the last axis.

    Examples
    --------
    >>> highest_between(np.array([3.0, 1.0, 2.0]), np.array([0, 1]), np.array([2, 3]))
    array([3., 2.])
    """
    # what lies between two ranges is looked through as well, and left out
    ends = np.stack([first, stop], axis=-1).ravel()
    padded = np.concatenate([values, values[..., :1]], axis=-1)
    return np.asarray(np.maximum.reduceat(padded, ends, axis=-1)[..., ::2])


def fine_order_spectrum(signals: InAngle, pieces: int = 1) -> FineSpectrum:
    """Spectrum of whole signals against the angle of shaft 1.

    Parameters
    ----------
    signals : InAngle
        On as many steps a turn as samples.
    pieces : int
        Consecutive pieces whose powers are averaged, >= 1; of more than eight, eight that are
        spread evenly.

    Returns
    -------
    FineSpectrum
        Over orders; Hann window, zero padding to twice the length.
    """
    grid, block = signals.grid, signals.grid.count // pieces
    rate, kernel = grid.per_turn, signals.kernel.transform
    return _of_pieces(lambda k: signals.steps(k * block, block), block, pieces, rate, kernel)


def fine_spectrum(samples: FloatArray, sampling_rate_hz: float, pieces: int = 1) -> FineSpectrum:
    """Spectrum of whole signals against time, made like `fine_order_spectrum`.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz], > 0.
    pieces : int
        As for `fine_order_spectrum`.

    Returns
    -------
    FineSpectrum
        Over frequencies [Hz].
    """
    check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    block = samples.shape[-1] // pieces
    return _of_pieces(lambda k: samples[:, k * block :][:, :block], block, pieces, sampling_rate_hz)


def fine_envelope_spectrum(signals: InAngle, top_order: float, pieces: int = 1) -> FineSpectrum:
    """Spectrum of the squared envelope of whitened signals against the angle of shaft 1.

    Impacts that slip against the shafts, as a rolling bearing's do, leave few sharp lines in the
    spectrum, but repeat in the envelope. All lines of the signal are first given one amplitude
    (cepstrum pre-whitening), so that no strong line, as of a gear, rules the envelope.

    Parameters
    ----------
    signals : InAngle
    top_order : float
        Highest order wanted, > 0; cut to an eighth of the sampling rate.
    pieces : int
        As for `fine_order_spectrum`.

    Returns
    -------
    FineSpectrum
        Over orders; powers are squared relative amplitudes: a squared envelope 1 + a cos(x) gives
        a^2, whatever the gain of the sensor.

    Notes
    -----
    The envelope is averaged over a quarter of the shortest period wanted and read at equal angles
    along straight lines: a modulation at the top order loses a fifth of its power.

    References
    ----------
    Borghesani, Pennacchi, Randall, Sawalhi and Ricci, Application of cepstrum pre-whitening for
    the diagnosis of bearing faults under variable speed conditions, Mech. Syst. Signal Process. 36
    (2013) 370-384.
    """
    check_positive("top_order", top_order)
    samples, rate, track = signals.samples, signals.sampling_rate_hz, signals.track
    fastest = float(track.speed_hz.max())
    top_order = min(top_order, rate / 8 / fastest)
    together = 2 * max(1, int(rate / (8 * top_order * fastest)))
    block = samples.shape[-1] // pieces // together * together
    per_turn = int(np.ceil(4 * top_order))
    middle_s = (0.5 * together - 1 + together * np.arange(block // together)) / rate
    ends = np.array([[p * block / rate] for p in range(pieces)]) + middle_s[[0, -1]]
    turns = track.turns_at(ends.ravel()).reshape(pieces, 2)
    count = int(np.floor(np.diff(turns, axis=-1).min() * per_turn))

    def part(piece: int) -> FloatArray:
        squared = _whitened_envelope(samples[:, piece * block : (piece + 1) * block])
        slow = squared.reshape(len(samples), -1, together // 2).mean(axis=-1)
        angle = turns[piece, 0] + np.arange(count) / per_turn
        at_s = track.time_at(angle) - piece * block / rate
        read = np.array([np.interp(at_s, middle_s, row) for row in slow])
        # a channel in which nothing vibrates has no envelope
        mean = np.maximum(read.mean(axis=-1, keepdims=True), np.finfo(float).tiny)
        return np.asarray(read / mean)

    spectrum = _of_pieces(part, count, pieces, per_turn)
    last = int(top_order / spectrum.step) + 1
    return replace(spectrum, power=spectrum.power[:, :last], floor=spectrum.floor[:, :last])


def _whitened_envelope(samples: FloatArray) -> FloatArray:
    """Squared envelope, at every other sample, of signals given one amplitude at all frequencies.

    The analytic signal has no negative frequencies: half as many values hold it. Its square is
    twice as wide, so that what beats at the whole band's width comes on top of the slow beats: few
    lines are that far apart.
    """
    count = samples.shape[-1]
    length = fast_length(count)
    squared = np.empty((len(samples), count // 2))
    for row, signal in zip(squared, samples, strict=True):
        lines = transform(signal - signal.mean(), length)[: length // 2]
        lines /= np.maximum(np.abs(lines), np.finfo(float).tiny)
        lines[0] = 0.0
        analytic = ifft(lines, norm="forward", overwrite_x=True)[: count // 2]
        np.square(analytic.real, out=row)
        row += np.square(analytic.imag)
    return squared


def _of_pieces(
    part: Callable[[int], FloatArray],
    block: int,
    pieces: int,
    rate: float,
    kernel: Callable[[FloatArray], FloatArray] | None = None,
) -> FineSpectrum:
    """Average the powers of pieces, less what a kernel, by its transform, took of them."""
    if pieces < 1 or block < 8:
        raise ArgumentError(f"pieces={pieces}: each must hold 8 samples or more, got {block}")
    length = fast_length(2 * block)
    weights = window("hann", block)
    sampled = np.unique(np.linspace(0, pieces - 1, min(pieces, _MOST_PIECES)).astype(int)).tolist()
    work = 2 * len(sampled) * block
    powers = side_by_side(lambda k: window_powers(part(k), weights, length), sampled, work)
    power = np.asarray(sum(powers)) * ((2.0 / weights.sum()) ** 2 / len(sampled))
    if kernel is not None:
        # it falls so smoothly that straight lines between these are right to 1e-6
        places = np.linspace(0.0, 0.5, _SHARES)
        shares = kernel(places) ** 2
        power /= np.interp(np.arange(power.shape[-1]) / length, places, shares)
    # noise under the lines; near zero, where the drift of a sensor rises steeply, seen closer
    floor, bins = local_floor(power, _FLOOR_BINS), _FLOOR_BINS // 2
    while bins >= _NARROWEST:
        # from the middle of its first window on the wider one tells
        floor[..., :bins] = local_floor(power[..., : 2 * bins], bins)[..., :bins]
        bins //= 2
    step, width = rate / length, rate / block
    return FineSpectrum(power=power, floor=floor, step=step, width=width, pieces=len(sampled))


def clear_peaks(spectrum: FineSpectrum, least_ratio: float) -> NDArray[np.intp]:
    """Bins of the peaks that stand above the floor and are no side lobes of higher ones.

    Parameters
    ----------
    spectrum : FineSpectrum
        Against angle or time.
    least_ratio : float
        Least power over floor, in at least one channel, > 1.

    Returns
    -------
    ndarray of int, shape (peaks,)
        Ascending.

    Notes
    -----
    A peak is the highest value within the main lobe of a Hann window, two widths on either side,
    of the channel in which it is clearest.
    """
    ratio = spectrum.power / spectrum.floor
    per_width, found = spectrum.width / spectrum.step, []
    for level, own in zip(spectrum.power, ratio, strict=True):
        high = np.flatnonzero(own > least_ratio)
        high = high[high > 2 * per_width]
        # those that are no part and no side lobe of another one
        value, kept = level[high], np.ones(len(high), dtype=bool)
        for widths, share in _LOBES:
            reach = round(widths * per_width)
            first, stop = np.searchsorted(high, [high - reach, high + reach + 1])
            kept &= value >= share * highest_between(value, first, stop)
        found.append(high[kept])
    places = np.unique(np.concatenate(found))
    # of peaks that channels place a little differently, the clearest of each heap
    heap = np.cumsum(np.diff(places, prepend=places[:1]) > round(_LOBES[0][0] * per_width))
    order = np.lexsort((-ratio[:, places].max(axis=0), heap))
    return places[order[np.searchsorted(heap, np.unique(heap))]]


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderMap(Result):
    """Amplitude against order of a shaft, row by row.

    Parameters
    ----------
    against : {"time", "speed"}
        What the rows run along.
    shaft_order : float
        Turns of the shaft a turn of shaft 1.
    order : ndarray of float, shape (bins,)
        Cycles a turn of the shaft, from 0.
    amplitude : ndarray of float, shape (rows, channels, bins)
        Peak amplitude in the units of the channels, root mean square over the row's blocks. A
        steady sine on a bin reads its amplitude.
    time_s, speed_hz : ndarray of float, shape (rows,)
        Mean over the blocks of each row: middle of the block [s], speed of the shaft [Hz].
    low, high : ndarray of float, shape (rows,)
        From where to where each row reaches, in s or Hz by `against`; ascending.
    blocks : ndarray of int, shape (rows,)
        Blocks in each row, at least 1.
    block_turns : float
        Length of a block [turns of the shaft].
    resolution : float
        Noise bandwidth of a bin [orders of the shaft].
    """

    against: str
    shaft_order: float
    order: FloatArray
    amplitude: FloatArray
    time_s: FloatArray
    speed_hz: FloatArray
    low: FloatArray
    high: FloatArray
    blocks: IntArray
    block_turns: float
    resolution: float

    @property
    def mean(self) -> FloatArray:
        """Order spectrum: root mean square over all blocks, shape (channels, bins)."""
        power = np.einsum("rcb,r->cb", self.amplitude**2, self.blocks.astype(float))
        return np.asarray(np.sqrt(power / self.blocks.sum()))


def order_map(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    *,
    shaft_order: float = 1.0,
    top: float | None = None,
    block_turns: float = 40.0,
    window_name: str = "hann",
    against: str = "time",
    rows: int | None = None,
) -> OrderMap:
    """Compute an order map.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals, in any unit.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    shaft_order : float > 0
        Turns a turn of shaft 1 of the shaft whose orders are counted.
    top : float > 0, optional
        Highest order of that shaft; by default, and at most, 0.45 of the sampling rate at the
        highest speed.
    block_turns : float > 0
        Length of a block [turns of the shaft]; cut to a quarter of the recording.
    window_name : {"hann", "flat-top", "blackman-harris", "rectangular"}
    against : {"time", "speed"}
        Rows of equal time, or of equal speed (a speed-order waterfall).
    rows : int >= 1, optional
        At most so many; 200 along time; 60 along speed, and a third of the blocks.

    Returns
    -------
    OrderMap
        Rows of speed in which the recording never was are left out.

    Raises
    ------
    ArgumentError
        If an argument is out of its range or the recording is too short.

    Examples
    --------
    >>> vibration = gearmon.read_recording(new).vibration()
    >>> found = gearmon.order_map(vibration.samples, 8000.0, analysis.signature.track, top=100.0)
    >>> found.amplitude.shape, found.order[:3]
    ((6, 2, 1874), array([0.        , 0.05338542, 0.10677083]))
    """
    check_track(track)
    check_word("against=", against, ("time", "speed"))
    most = rows if rows is not None else TIME_ROWS if against == "time" else SPEED_ROWS
    if most < 1:
        raise ArgumentError(f"rows={rows} must be at least 1")
    ratio = check_positive("shaft_order", shaft_order)
    wanted = check_positive("block_turns", block_turns) / ratio
    limit = READ_UP_TO * sampling_rate_hz / float(track.speed_hz.max())
    highest = limit if top is None else top * ratio
    if not 0 < highest <= limit * (1 + 1e-9):
        raise ArgumentError(f"highest order {top} must lie in (0, {limit / ratio:.4g}]")
    grid = AngleGrid.of(samples.shape[-1], sampling_rate_hz, track, highest)
    turns = min(wanted, grid.count / grid.per_turn / 4)
    block = min(grid.count, fast_length(max(16, int(turns * grid.per_turn))))
    # of every block its middle [s] and the mean speed of shaft 1 within it [Hz]
    length, hop = block / grid.per_turn, max(1, block // 2)
    begin = grid.first_turn + np.arange(0, grid.count - block + 1, hop) / grid.per_turn
    ends = track.time_at(begin), track.time_at(begin + length)
    middle, speed = 0.5 * (ends[0] + ends[1]), length / (ends[1] - ends[0])
    row, low, high = _rows(middle if against == "time" else ratio * speed, against, most)
    bins = int(highest * block / grid.per_turn) + 1
    used, row, blocks = np.unique(row, return_inverse=True, return_counts=True)
    powers = np.zeros((len(used), len(samples), bins))
    weights, part = window(window_name, block), samples[:, :0]
    for number, turn in zip(row, begin, strict=True):
        # its first half is the second of the block before
        part = part[:, hop:]
        ahead, count = turn + part.shape[1] / grid.per_turn, block - part.shape[1]
        missing = replace(grid, first_turn=ahead, count=count)
        fresh = resample_to_angle(samples, sampling_rate_hz, track, missing)
        part = np.hstack([part, fresh])
        powers[number] += window_powers(part, weights, block)[:, :bins]
    powers *= (2.0 / weights.sum()) ** 2
    powers[..., 0] *= 0.25  # the line at zero has no mirror image
    return OrderMap(
        against=against,
        shaft_order=ratio,
        order=np.arange(float(bins)) * float(grid.per_turn / block / ratio),
        amplitude=np.sqrt(powers / blocks[:, None, None]),
        time_s=np.bincount(row, middle) / blocks,
        speed_hz=ratio * np.bincount(row, speed) / blocks,
        low=low[used],
        high=high[used],
        blocks=blocks,
        block_turns=block / grid.per_turn * ratio,
        resolution=noise_bandwidth(window_name) * float(grid.per_turn / block / ratio),
    )


def _rows(place: FloatArray, against: str, most: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Row of each block by its place, and where the rows begin and end."""
    low, high = float(place.min()), float(place.max())
    if against == "time":
        # blocks follow one another: a row takes as many as there are, each within its own bounds
        together = -(-len(place) // most)
        row = np.arange(len(place)) // together
        step = (high - low) / max(1, len(place) - 1) if high > low else 1.0
        edges: FloatArray = low - step / 2 + step * together * np.arange(row[-1] + 2.0)
        edges[-1] = high + step / 2
        return row, edges[:-1], edges[1:]
    least = _FINEST_SPEED * float(place.mean())
    count = int(max(1, min(most, len(place) // _BLOCKS_A_ROW, np.ceil((high - low) / least))))
    width = max((high - low) / count, least)
    begin = 0.5 * (low + high) - 0.5 * count * width
    row = np.clip(((place - begin) / width).astype(np.int64), 0, count - 1)
    edges = begin + width * np.arange(count + 1.0)
    return row, edges[:-1], edges[1:]
