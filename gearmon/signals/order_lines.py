"""Order lines: complex amplitudes at known orders, synchronous averages and order spectra.

An *order* is a number of cycles a turn of shaft 1; angles are counted in turns of shaft 1. Time is
the last axis everywhere, channels the one before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.signals.angle import AngleGrid, AngleTrack
from gearmon.signals.angle_phasors import phasors
from gearmon.signals.gridding import quick_gridding
from gearmon.signals.half_blocks import HalfBlocks
from gearmon.signals.spectrum import hann, local_floor
from gearmon.signals.threads import side_by_side
from gearmon.signals.transforms import fast_length, window_powers

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# What a line may add elsewhere where only the phase of strong ones is followed.
_QUICK = 1e-3
# Blocks whose spectra tell the noise between the lines; more would only take time.
_FLOOR_BLOCKS = 32
# Pieces of a long recording that `order_quality` hears, spread over all of it.
_MOST_PIECES = 16


@dataclass(frozen=True, kw_only=True)
class OrderLines:
    """Complex amplitudes of order lines, block by block.

    Parameters
    ----------
    orders : ndarray of float, shape (lines,)
        Orders, in cycles a turn of shaft 1.
    amplitude : ndarray of complex, shape (blocks, channels, lines)
        Complex peak amplitude A: the line is Re(A exp(2 pi i order angle)), angle in turns.
    block_turns : float
        Length of the Hann blocks [turns]; they overlap by half.
    first_turn : float
        Angle at which the first block starts [turns].
    noise : ndarray of float, shape (channels, lines)
        Mean power |A|^2 that noise alone would show at each line: median of the off-line spectrum.
    """

    orders: FloatArray
    amplitude: ComplexArray
    block_turns: float
    first_turn: float
    noise: FloatArray

    @property
    def mean(self) -> ComplexArray:
        """Synchronous mean over the blocks, shape (channels, lines)."""
        mean: ComplexArray = self.amplitude.mean(axis=0)
        return mean

    @property
    def independent_blocks(self) -> float:
        """Blocks counted as independent: half overlapped Hann blocks lose about a tenth of them.

        Welch's variance of the mean of half-overlapped Hann blocks is 1.056 of that of as many
        blocks end to end as there is record per half block (Harris 1978, correlation 1/6).
        """
        count = self.amplitude.shape[0]
        return float(count / (1 + 2 * (1 / 6) ** 2 * (count - 1) / count))

    def block_powers(self) -> tuple[FloatArray, float]:
        """Power of each line, pair of blocks by pair of blocks, without the share of noise.

        Re(A_b conj A_b+2) of blocks that share no sample: noise, independent from block to block,
        averages out, while a line whose phase drifts slowly keeps its power. With fewer than three
        blocks the noise is subtracted instead.

        Returns
        -------
        powers : ndarray of float, shape (pairs, channels, lines)
            Powers |A|^2; their mean is the estimate.
        independent : float
            Number of independent pairs they are worth.
        """
        blocks = self.amplitude
        if blocks.shape[0] < 3:
            return np.abs(blocks) ** 2 - self.noise, float(blocks.shape[0])
        product = (blocks[:-2] * np.conj(blocks[2:])).real
        return product, max(1.0, 0.5 * len(product))

    def cross_power(self) -> FloatArray:
        """Power of each line without the share of noise, shape (channels, lines)."""
        mean: FloatArray = self.block_powers()[0].mean(axis=0)
        return mean


def order_lines(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    orders: FloatArray,
    block_turns: float,
    *,
    precise: bool = True,
    error: float = 1e-6,
) -> OrderLines:
    """Measure complex line amplitudes at arbitrary orders in half-overlapped Hann blocks of angle.

    The samples are spread onto equal steps of angle (`gridding`) half a block at a time, so that
    memory stays bounded, by all cores. Each half is transformed once: its transform at the orders
    comes from a non-uniform transform (zero padding to twice the length, Kaiser-Bessel kernel of
    eight bins), those of the rising and of the falling half of the Hann window from the bins next
    to it. Relative error below `error` at a steady speed, for orders below half the sampling rate;
    a speed that changes leaves more, as the kernel's weights follow it only to first order.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    orders : ndarray of float, shape (lines,)
        Orders, cycles a turn of shaft 1, >= 0.
    block_turns : float
        Length of a block [turns]; cut to the recording.
    precise : bool
        Whether to be exact to `error`, or to some ten-thousandths in less time (enough to follow
        the phase of strong lines).
    error : float
        What a line may add elsewhere, relative to it: 1e-6, or 1e-4 in two thirds of the time if
        the orders lie in the lower 60 % of the band.

    Returns
    -------
    OrderLines
        Amplitudes a block; phases count from the start of the recording.

    Raises
    ------
    ArgumentError
        If an order is negative or the recording holds too few samples.
    """
    if len(orders) == 0 or orders.min() < 0:
        raise ArgumentError("orders: at least one, all >= 0, are needed")
    grid, halves, count = _halves(
        samples, sampling_rate_hz, track, orders, block_turns, error if precise else _QUICK
    )
    turns, heard = 2 * halves.turns, _heard(count - 1)
    rising, falling, kept = halves.transforms(grid.first_turn, count, heard)
    starts = grid.first_turn + 0.5 * turns * np.arange(count - 1)
    shift = phasors(-orders * starts[:, None])[:, None, :]
    half_turn = phasors(-orders * (0.5 * turns))
    rows = (rising[:-1] + falling[1:] * half_turn) * shift
    scale = np.where(orders > 0, 2.0, 1.0) / (halves.steps * halves.response)
    return OrderLines(
        orders=orders,
        amplitude=rows * scale,
        block_turns=turns,
        first_turn=grid.first_turn,
        noise=_noise(halves, kept, heard),
    )


def line_noise(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    orders: FloatArray,
    block_turns: float,
) -> FloatArray:
    """Return the noise that `order_lines` tells, without the lines.

    Parameters
    ----------
    samples, sampling_rate_hz, track, orders, block_turns
        As for `order_lines`.

    Returns
    -------
    ndarray of float, shape (channels, lines)
        Mean power |A|^2 that noise alone would show at each line.
    """
    grid, halves, count = _halves(samples, sampling_rate_hz, track, orders, block_turns, _QUICK)
    heard = _heard(count - 1)
    wanted = sorted({half for block in heard for half in (block, block + 1)})
    return _noise(halves, halves.some(grid.first_turn, wanted), heard)


def _halves(
    samples: FloatArray,
    rate: float,
    track: AngleTrack,
    orders: FloatArray,
    block_turns: float,
    error: float,
) -> tuple[AngleGrid, HalfBlocks, int]:
    """Halves of blocks, and how many of them the recording holds."""
    grid = AngleGrid.of(samples.shape[-1], rate, track, float(orders.max()))
    block = steps_of_block(grid, block_turns)
    turns = block / grid.per_turn
    halves = HalfBlocks.of(samples, rate, track, orders, turns, error=error)
    return grid, halves, 2 * (grid.count - block) // block + 2


def steps_of_block(grid: AngleGrid, block_turns: float) -> int:
    """Return the steps of a block of so many turns, cut to the recording."""
    # rounded down: the last of the blocks that just fill a recording must not fall off its end
    return min(grid.count, max(8, int(block_turns * grid.per_turn + 1e-6)))


def _heard(blocks: int) -> range:
    """Blocks whose spectra tell the noise."""
    every = max(1, blocks // _FLOOR_BLOCKS)
    return range(every - 1, blocks, every)


def _noise(halves: HalfBlocks, kept: dict[int, FloatArray], heard: range) -> FloatArray:
    """Noise power at each line, from the blocks between whose lines it is heard."""
    floor = _floor_at(halves.powers(kept, heard), halves.orders / halves.bin_order, len(heard))
    scale = np.where(halves.orders > 0, 2.0, 1.0) / (halves.steps * halves.response)
    noise: FloatArray = floor * scale**2
    return noise


def _floor_at(power: FloatArray, bins: FloatArray, blocks: int) -> FloatArray:
    """Noise power at fractional bins: running median, over the median of averaged noise powers.

    The mean of n noise powers follows a gamma law of shape n, whose median over its mean is about
    1 - 1/(3 n) + 0.02/n^2; half overlapped Hann blocks are worth a twentieth less.
    """
    worth = max(1.0, 0.95 * blocks)
    median = 1 - 1 / (3 * worth) + 0.02 / worth**2
    floor = local_floor(power, min(power.shape[-1], 256)) / median
    nearest = np.minimum(np.rint(bins).astype(int), power.shape[-1] - 1)
    taken: FloatArray = floor[:, nearest]
    return taken


def synchronous_average(lines: OrderLines, rotation_order: float, per_turn: int) -> FloatArray:
    """Waveform of one turn of a shaft from its order lines.

    Parameters
    ----------
    lines : OrderLines
        Lines that contain all multiples of `rotation_order`.
    rotation_order : float
        Turns of the shaft a turn of shaft 1.
    per_turn : int
        Samples wanted a turn of this shaft.

    Returns
    -------
    ndarray of float, shape (channels, per_turn)
        The time-synchronous average (TSA), without its mean.
    """
    ratio = lines.orders / rotation_order
    number = np.rint(ratio).astype(int)
    chosen = (np.abs(ratio - number) < 1e-9 * np.maximum(1, ratio)) & (number > 0)
    chosen &= number < per_turn / 2
    spectrum = np.zeros((lines.amplitude.shape[1], per_turn // 2 + 1), dtype=complex)
    spectrum[:, number[chosen]] = lines.mean[:, chosen]
    result: FloatArray = np.fft.irfft(spectrum, n=per_turn, axis=-1) * per_turn / 2
    return result


def order_quality(
    samples: FloatArray, sampling_rate_hz: float, track: AngleTrack, pieces: int = 1
) -> tuple[FloatArray, float]:
    """Log signal-to-noise ratio against order, as finely resolved as the recording allows.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    pieces : int
        Consecutive pieces whose powers are averaged; of more than 16 so many, spread evenly.

    Returns
    -------
    quality : ndarray of float, shape (bins,)
        log(1 + power over local floor), mean over channels.
    bin_order : float
        Spacing of the bins [orders].
    """
    grid = AngleGrid.of(samples.shape[-1], sampling_rate_hz, track, 0.0)
    block = grid.count // pieces
    length = fast_length(2 * block)
    window = hann(block)
    per_turn = float(grid.per_turn)
    # the floor tells what spreading takes of an order as well as what the noise has there
    gridding = quick_gridding(samples, sampling_rate_hz, track, per_turn)

    def power(piece: int) -> FloatArray:
        part = np.empty((samples.shape[0], block))
        gridding.spread(grid.first_turn + piece * block / per_turn, part)
        return window_powers(part, window, length, pieces * length)

    heard = np.unique(np.linspace(0, pieces - 1, min(pieces, _MOST_PIECES)).astype(int))
    powers = side_by_side(power, [int(piece) for piece in heard], 2 * len(heard) * block)
    total: FloatArray = sum(powers, np.zeros(1))
    quality: FloatArray = np.log1p(total / local_floor(total, 384)).mean(axis=0)
    return quality, grid.per_turn / length
