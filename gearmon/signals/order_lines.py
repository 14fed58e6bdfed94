"""Order lines: complex amplitudes at known orders, synchronous averages and order spectra.

An *order* is a number of cycles a turn of shaft 1; angles are counted in turns of shaft 1. Time is
the last axis everywhere, channels the one before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.signals.angle import AngleGrid, AngleTrack, angle_blocks, resample_to_angle
from gearmon.signals.spectrum import hann, local_floor
from gearmon.signals.transforms import fast_length, real_fft

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# Blocks whose spectra tell the noise between the lines; more would only take time.
_FLOOR_BLOCKS = 32


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
) -> OrderLines:
    """Measure complex line amplitudes at arbitrary orders in half-overlapped Hann blocks of angle.

    The recording is resampled to equal steps of angle piece by piece, so that memory stays bounded,
    and each block's discrete-time Fourier transform is evaluated exactly at the orders by a
    non-uniform transform (zero padding to twice the length, Kaiser-Bessel kernel of eight bins,
    relative error below 1e-6).

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
        Whether to resample to full accuracy (needed above a tenth of the sampling rate) or quickly
        (enough to follow the phase of strong lines).

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
    grid = AngleGrid.of(samples.shape[-1], sampling_rate_hz, track, float(orders.max()))
    block = min(grid.count, max(8, round(block_turns * grid.per_turn)))
    plan = _LinePlan(block, orders * block / grid.per_turn)
    rows = []
    off_line = np.zeros((samples.shape[0], plan.length // 2 + 1))
    every = max(1, (grid.count // max(1, block // 2)) // _FLOOR_BLOCKS)
    seen = 0
    for start, part in angle_blocks(samples, sampling_rate_hz, track, grid, block, precise=precise):
        shift = grid.first_turn + start / grid.per_turn
        rows.append(plan.lines(part) * np.exp(-2j * np.pi * orders * shift))
        if len(rows) % every == 0:
            off_line += plan.power(part)
            seen += 1
    scale = np.where(orders > 0, 2.0, 1.0) / plan.window.sum()
    floor = _floor_at(off_line / seen, orders * plan.length / grid.per_turn, seen)
    return OrderLines(
        orders=orders,
        amplitude=np.array(rows) * scale,
        block_turns=block / grid.per_turn,
        first_turn=grid.first_turn,
        noise=floor * scale**2,
    )


class _LinePlan:
    """Non-uniform Fourier transform of Hann blocks of one length at fixed fractional bins."""

    _REACH = 8
    _BETA = 2.30 * 8

    def __init__(self, block: int, bins: FloatArray) -> None:
        self.window = hann(block)
        self.length = fast_length(2 * block)
        self.block = block
        centred = (np.arange(block) - block / 2) / self.length
        self._apodised = self.window / _kernel_transform(centred, self._REACH, self._BETA)
        target = bins * self.length / block
        base = np.floor(target).astype(int) - self._REACH // 2 + 1
        self._index = base[:, None] + np.arange(self._REACH)
        offset = (target[:, None] - self._index) / (self._REACH / 2)
        kernel = np.i0(self._BETA * np.sqrt(np.maximum(0.0, 1 - offset**2)))
        # the kernel acts on the spectrum of the block centred at zero: undo the shift on the grid
        shift = np.exp(2j * np.pi * self._index * (block / 2) / self.length)
        self._weight = kernel * shift
        self._back = np.exp(-2j * np.pi * target * (block / 2) / self.length)

    def lines(self, part: FloatArray) -> ComplexArray:
        """Return transforms at the wanted bins, (channels, lines), phase from the block's start."""
        spectrum = real_fft(part * self._apodised, self.length)
        half = self.length // 2
        wrapped = self._index % self.length
        mirrored = wrapped > half
        taken = np.where(mirrored, self.length - wrapped, wrapped)
        values = spectrum[:, taken]
        values = np.where(mirrored, np.conj(values), values)
        result: ComplexArray = np.einsum("cln,ln->cl", values, self._weight) * self._back
        return result

    def power(self, part: FloatArray) -> FloatArray:
        """Power of the plain Hann spectrum of a block, shape (channels, length // 2 + 1)."""
        level = part.mean(axis=-1, keepdims=True)
        spectrum = real_fft((part - level) * self.window, self.length)
        result: FloatArray = spectrum.real**2 + spectrum.imag**2
        return result


def _kernel_transform(x: FloatArray, reach: int, beta: float) -> FloatArray:
    """Fourier transform of the kernel I0(beta sqrt(1 - (2 u / reach)^2)) at x cycles a bin."""
    argument = np.emath.sqrt(beta**2 - (np.pi * reach * x) ** 2)
    value: FloatArray = np.real(reach * np.sinh(argument) / argument)
    return value


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
        Consecutive pieces whose powers are averaged.

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
    power = np.zeros((samples.shape[0], length // 2 + 1))
    for piece in range(pieces):
        first = grid.first_turn + piece * block / grid.per_turn
        part = resample_to_angle(
            samples, sampling_rate_hz, track, grid.per_turn, first, block, precise=False
        )
        spectrum = real_fft(part * window, length)
        power += spectrum.real**2 + spectrum.imag**2
    quality: FloatArray = np.log1p(power / local_floor(power, 384)).mean(axis=0)
    return quality, grid.per_turn / length
