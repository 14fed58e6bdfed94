"""Order lines: complex amplitudes at known orders, block by block (a short-time order transform).

An *order* is a number of cycles a turn of shaft 1; angles are counted in turns of shaft 1. Time is
the last axis everywhere, channels the one before. Half-overlapped Hann blocks share their halves:
each half is spread onto equal steps of angle and transformed once, under the rising and under the
falling half of the window.

How far the mean of a line over the blocks may be off, the blocks themselves tell: not by their
scatter, for half-overlapped blocks share noise, a line of another stage beside the own one turns
from block to block and all but cancels in the mean, and a slow drift hardly cancels at all. What
tells is the spectrum of the block series near zero (`variance_of_mean`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.signals.angle import AngleTrack, phasors
from gearmon.signals.orders.nonuniform_fft import Kernel, Spreading
from gearmon.signals.orders.resampling import AngleGrid
from gearmon.signals.spectra.spectrum import hann, local_floor
from gearmon.signals.threads import side_by_side
from gearmon.signals.transforms import batch, fast_length, window_powers

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# What a line may add elsewhere where only the phase of strong ones is followed.
_QUICK_ERROR = 1e-3
# Blocks whose spectra tell the noise between the lines; more would only take time.
_FLOOR_BLOCKS = 32
# Width of the kernel, steps a cycle of the highest order, and a sample, at the least: what
# spreading adds is below 1e-6 where there are twice as many steps a cycle, 1e-4 or some 1e-3.
_PRECISE, _MIDDLE, _QUICK = (8, 2.6, 1.0), (6, 3.2, 0.25), (4, 2.6, 0.25)
_MIDDLE_FROM, _QUICK_FROM = 1e-4, 1e-3
# Up to so many lines a matrix product is quicker than a transform.
_FEW_LINES, _LARGEST_MATRIX = 20, 1 << 21
# Steps taken at a time.
_TOGETHER = 1 << 18
# Lines and bins whose weights make one matrix.
_MOST_LINES, _MOST_BINS = 24, 64
# Correlation of the amplitudes of noise in neighbouring half-overlapped Hann blocks (Harris 1978).
_SHARED = 1 / 6
# Fewer blocks than this tell a mean, but no median and no slow drift.
_FEW = 9
# Slowest frequencies of the block series to either side that drift and near lines fill, and excess
# over the median from which they are believed: six values of noise reach it in 2 % of cases.
_SLOW, _EXCESS = 3, 2.0


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
    error: float = 1e-6,
) -> OrderLines:
    """Measure complex line amplitudes at arbitrary orders in half-overlapped Hann blocks of angle.

    The samples are spread onto equal steps of angle (`nonuniform_fft`) half a block at a time, so
    that memory stays bounded, by all cores. Each half is transformed once: its transform at the
    orders comes from a non-uniform transform (zero padding to twice the length, Kaiser-Bessel
    kernel of eight bins), those of the rising and of the falling half of the Hann window from the
    bins next to it. Relative error below `error` at a steady speed, for orders below half the
    sampling rate; a speed that changes leaves more, as the kernel's weights follow it only to first
    order.

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
    error : float
        What a line may add elsewhere, relative to it: 1e-6; 1e-4 in two thirds of the time if the
        orders lie in the lower 60 % of the band; or 1e-3, enough to follow the phase of strong
        lines.

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
    grid, halves, count = _halves(samples, sampling_rate_hz, track, orders, block_turns, error)
    turns, sampled = 2 * halves.turns, _floor_blocks(count - 1)
    rising, falling, kept = halves.transforms(grid.first_turn, count, sampled)
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
        noise=_noise(halves, kept, sampled),
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
    grid, halves, count = _halves(
        samples, sampling_rate_hz, track, orders, block_turns, _QUICK_ERROR
    )
    sampled = _floor_blocks(count - 1)
    wanted = sorted({half for block in sampled for half in (block, block + 1)})
    return _noise(halves, halves.some(grid.first_turn, wanted), sampled)


def _halves(
    samples: FloatArray,
    rate: float,
    track: AngleTrack,
    orders: FloatArray,
    block_turns: float,
    error: float,
) -> tuple[AngleGrid, OrderSTFT, int]:
    """Halves of blocks, and how many of them the recording holds."""
    grid = AngleGrid.of(samples.shape[-1], rate, track, float(orders.max()))
    block = steps_of_block(grid, block_turns)
    turns = block / grid.per_turn
    halves = OrderSTFT.of(samples, rate, track, orders, turns, error=error)
    return grid, halves, 2 * (grid.count - block) // block + 2


def steps_of_block(grid: AngleGrid, block_turns: float) -> int:
    """Return the steps of a block of so many turns, cut to the recording."""
    # rounded down: the last of the blocks that just fill a recording must not fall off its end
    return min(grid.count, max(8, int(block_turns * grid.per_turn + 1e-6)))


def _floor_blocks(blocks: int) -> range:
    """Blocks whose spectra tell the noise."""
    every = max(1, blocks // _FLOOR_BLOCKS)
    return range(every - 1, blocks, every)


def _noise(halves: OrderSTFT, kept: dict[int, FloatArray], sampled: range) -> FloatArray:
    """Noise power at each line, from the blocks between whose lines it is measured."""
    floor = _floor_at(halves.powers(kept, sampled), halves.orders / halves.bin_order, len(sampled))
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


@dataclass(frozen=True, kw_only=True)
class OrderSTFT:
    """Half blocks of a recording at equal steps of angle, and their transforms."""

    spreading: Spreading
    channels: int
    orders: FloatArray
    turns: float  # of a half
    steps: int  # of a half
    response: FloatArray  # of the spreading, at the orders
    beside: FloatArray  # the same over that one bin of a block below and above, (2, lines)

    @classmethod
    def of(
        cls,
        samples: FloatArray,
        rate: float,
        track: AngleTrack,
        orders: FloatArray,
        block_turns: float,
        *,
        error: float,
    ) -> OrderSTFT:
        """Return the halves of blocks of `block_turns` turns, for lines at the given orders.

        Of a line, spreading adds `error` elsewhere: 1e-3, 1e-4, or else 1e-6.
        """
        top = float(orders.max())
        whole = rate / float(track.speed_hz.min())
        # steps that last no longer than a sample hold the whole band; fewer of them do for lines
        # low in it, and what is folded onto these the kernel has taken out before
        width, room, coarsest = _choice(error, top, whole)
        least = max(room * top, coarsest * whole)
        steps = fast_length(int(np.ceil(block_turns * least))) // 2
        per_turn = 2 * steps / block_turns
        kernel = Kernel.of(width, per_turn / (2 * max(top, 1e-3 * per_turn)))
        bin_order = 1 / block_turns
        below, response, above = (
            kernel.transform((orders + k * bin_order) / per_turn) for k in (-1, 0, 1)
        )
        return cls(
            spreading=Spreading(samples, rate, track, per_turn, kernel),
            channels=samples.shape[0],
            orders=orders,
            turns=0.5 * block_turns,
            steps=steps,
            response=response,
            beside=np.stack([response / below, response / above]),
        )

    @property
    def bin_order(self) -> float:
        """Spacing of the bins of `powers` [orders]."""
        return 0.25 / self.turns

    def transforms(
        self, first_turn: float, count: int, sampled: range
    ) -> tuple[ComplexArray, ComplexArray, dict[int, FloatArray]]:
        """Transform all halves under the rising and the falling half of the window.

        Parameters
        ----------
        first_turn : float
            Where the first half begins [turns].
        count : int
            How many halves there are.
        sampled : range
            Blocks whose halves are to be kept.

        Returns
        -------
        rising, falling : ndarray of complex, shape (count, channels, lines)
            The transforms.
        kept : dict
            Number of a half -> the half, shape (channels, steps).
        """
        total = 2 * count * self.steps * self.channels
        plan = line_plan(self.steps, self.orders * self.turns, self.beside, total)
        wanted = {half for block in sampled for half in (block, block + 1)}
        together = max(1, _TOGETHER // self.steps)

        def part(first: int) -> tuple[ComplexArray, ComplexArray, dict[int, FloatArray]]:
            number = min(together, count - first)
            values = np.empty((self.channels, number * self.steps))
            self.spreading.spread(first_turn + first * self.turns, values)
            cut = values.reshape(self.channels, number, self.steps)
            rising, falling = plan.lines(cut.reshape(-1, self.steps))
            shape = (self.channels, number, len(self.orders))
            kept = {k: cut[:, k - first].copy() for k in wanted if first <= k < first + number}
            return (
                rising.reshape(shape).transpose(1, 0, 2),
                falling.reshape(shape).transpose(1, 0, 2),
                kept,
            )

        firsts = range(0, count, together)
        found = side_by_side(part, firsts, total // 2)
        kept = {k: half for one in found for k, half in one[2].items()}
        return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found]), kept

    def some(self, first_turn: float, wanted: Sequence[int]) -> dict[int, FloatArray]:
        """Return some halves by their numbers, each of shape (channels, steps)."""

        def half(number: int) -> FloatArray:
            values = np.empty((self.channels, self.steps))
            self.spreading.spread(first_turn + number * self.turns, values)
            return values

        work = len(wanted) * self.steps * self.channels
        return dict(zip(wanted, side_by_side(half, wanted, work), strict=True))

    def powers(self, kept: dict[int, FloatArray], sampled: range) -> FloatArray:
        """Mean power of the plain Hann spectra of blocks, (channels, bins)."""
        window = hann(2 * self.steps)
        length = 4 * self.steps

        work = len(sampled) * length * self.channels

        def power(number: int) -> FloatArray:
            block = np.concatenate([kept[number], kept[number + 1]], axis=-1)
            block -= block.mean(axis=-1, keepdims=True)
            return window_powers(block, window, length, work)

        total: FloatArray = sum(side_by_side(power, sampled, work), np.zeros(1)) / len(sampled)
        return total


def _choice(error: float, top: float, whole: float) -> tuple[int, float, float]:
    """Choose the kernel by what it may add, the highest order and samples a turn."""
    if error >= _QUICK_FROM:
        return _QUICK
    # close to half the sampling rate it would need more steps than the longer kernel
    return _MIDDLE if error >= _MIDDLE_FROM and _MIDDLE[1] * top <= whole else _PRECISE


class MatrixPlan:
    """Fourier sums of halves of one length at few fractional bins: one matrix product."""

    def __init__(self, steps: int, bins: FloatArray, beside: FloatArray) -> None:
        angle = np.arange(steps) / steps
        waves = np.exp(-2j * np.pi * np.outer(angle, bins))
        turn = np.exp(1j * np.pi * angle)[:, None]
        wave = 0.25 * (turn * beside[0] + np.conj(turn) * beside[1])
        matrix = np.concatenate([(0.5 - wave) * waves, (0.5 + wave) * waves], axis=1)
        self._real, self._imag = matrix.real.copy(), matrix.imag.copy()

    def lines(self, halves: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the transforms under the rising and the falling half of the window."""
        value = np.empty((len(halves), self._real.shape[1]), dtype=np.complex128)
        value.real = halves @ self._real
        value.imag = halves @ self._imag
        middle = value.shape[1] // 2
        return value[:, :middle], value[:, middle:]


class GriddedPlan:
    """Non-uniform Fourier transform of halves of blocks at many fractional bins.

    In the bins of a half that is padded to twice its length the Hann window of the block is
    (-1/4, 1/2, -1/4) where it rises and (1/4, 1/2, 1/4) where it falls, each bin over what
    spreading left of it: so the window is that of the samples, not of the steps.
    """

    _REACH = 8
    _BETA = 2.30 * 8

    def __init__(self, steps: int, bins: FloatArray, beside: FloatArray, total: int = 0) -> None:
        self.length = 2 * steps
        self.steps = steps
        self._total = total
        centred = (np.arange(steps) - steps / 2) / self.length
        self._flat = 1 / _kernel_transform(centred, self._REACH, self._BETA)
        ascending = np.argsort(bins, kind="stable")
        self._place = 2 * np.argsort(ascending)
        target = 2.0 * bins[ascending]
        base = np.floor(target).astype(int) - self._REACH // 2 + 1
        near = base[:, None] + np.arange(self._REACH)
        offset = (target[:, None] - near) / (self._REACH / 2)
        kernel = np.i0(self._BETA * np.sqrt(np.maximum(0.0, 1 - offset**2)))
        # the kernel acts on the spectrum of the half centred at zero: undo the shift on the grid
        weight = kernel * np.exp(0.5j * np.pi * (near - target[:, None]))
        share = 0.25 * beside[:, ascending]
        both = [_with_neighbours(weight, -share), _with_neighbours(weight, share)]
        # bins from the lowest to the highest that is asked for, also below 0 and above the middle
        self._first = int(base.min(initial=1)) - 1
        wanted = self._first + np.arange(int(base.max(initial=1)) + self._REACH - self._first + 1)
        wrapped = wanted % self.length
        self._mirrored = np.flatnonzero(wrapped > steps)
        self._taken = np.where(wrapped > steps, self.length - wrapped, wrapped)
        self._groups = _groups(base - 1 - self._first, np.stack(both, axis=-1))

    def lines(self, halves: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the transforms under the rising and the falling half of the window."""
        bins = np.empty((len(halves), len(self._taken)), dtype=np.complex128)
        one = batch(self.length, 1, max(self._total, len(halves) * self.length))
        one.input[0, self.steps :] = 0.0
        for row, half in zip(bins, halves, strict=True):
            np.multiply(half, self._flat, out=one.input[0, : self.steps])
            one.run()[0].take(self._taken, out=row, mode="clip")
        bins[:, self._mirrored] = np.conj(bins[:, self._mirrored])
        found = np.empty((len(halves), 2 * len(self._place)), dtype=np.complex128)
        for begin, first, weights in self._groups:
            own = bins[:, first : first + len(weights)]
            np.matmul(own, weights, out=found[:, begin : begin + weights.shape[1]])
        return found[:, self._place], found[:, self._place + 1]


def _groups(base: NDArray[np.intp], weights: ComplexArray) -> list[tuple[int, int, ComplexArray]]:
    """Join lines next to one another: one matrix of weights of the bins about them.

    Parameters
    ----------
    base : ndarray of int, shape (lines,)
        First bin of each line, ascending.
    weights : ndarray of complex, shape (lines, bins of a line, 2)
        Weights of two sums.

    Returns
    -------
    list of tuple
        First sum, first bin, weights of shape (bins, sums).
    """
    groups, begin, width = [], 0, weights.shape[1]
    while begin < len(base):
        first = int(base[begin])
        near = int(np.searchsorted(base, first + _MOST_BINS - width, side="right"))
        end = min(near, begin + _MOST_LINES)
        own = (base[begin:end] - first)[:, None] + np.arange(width)
        joined = np.zeros((int(own[-1, -1]) + 1, end - begin, 2), dtype=np.complex128)
        joined[own, np.arange(end - begin)[:, None]] = weights[begin:end]
        groups.append((2 * begin, first, joined.reshape(len(joined), -1)))
        begin = end
    return groups


def line_plan(
    steps: int, bins: FloatArray, beside: FloatArray, total: int = 0
) -> MatrixPlan | GriddedPlan:
    """Return the transform of halves of so many steps at bins [cycles a half].

    Parameters
    ----------
    steps : int
        Steps of a half.
    bins : ndarray of float, shape (lines,)
        Cycles a half, >= 0.
    beside : ndarray of float, shape (2, lines)
        What spreading leaves of a line, over that of one a bin of the whole block below and above.
    total : int
        Samples that the caller will transform in all, as for `batch`.
    """
    if len(bins) <= _FEW_LINES and steps * len(bins) <= _LARGEST_MATRIX:
        return MatrixPlan(steps, bins, beside)
    return GriddedPlan(steps, bins, beside, total)


def _with_neighbours(weight: ComplexArray, share: FloatArray) -> ComplexArray:
    """Weights of the bins that give half of a transform and a share of both its neighbours.

    Phases turn by a quarter from bin to bin on the way there and back: none is left.
    """
    wide = np.zeros((len(weight), weight.shape[1] + 2), dtype=np.complex128)
    wide[:, 1:-1] += 0.5 * weight
    wide[:, :-2] += share[0][:, None] * weight
    wide[:, 2:] += share[1][:, None] * weight
    return wide


def _kernel_transform(x: FloatArray, reach: int, beta: float) -> FloatArray:
    """Fourier transform of the kernel I0(beta sqrt(1 - (2 u / reach)^2)) at x cycles a bin."""
    argument = np.emath.sqrt(beta**2 - (np.pi * reach * x) ** 2)
    value: FloatArray = np.real(reach * np.sinh(argument) / argument)
    return value


def variance_of_mean(blocks: ComplexArray) -> FloatArray:
    """Variance of the mean of complex line amplitudes over half-overlapped Hann blocks.

    Parameters
    ----------
    blocks : ndarray of complex, shape (blocks, ...)
        Amplitudes, block by block.

    Returns
    -------
    ndarray of float, shape (...)
        E|mean - truth|^2 [unit of the amplitudes, squared]; 0 of a single block, which tells
        nothing of it.

    Notes
    -----
    Noise fills the periodogram P_k = |sum_b A_b exp(-2 pi i b k/n)|^2/n^2 of n blocks in
    proportion to 1 + 2 rho (1 - 1/n) cos(2 pi k/n), rho = 1/6; divided by that and multiplied by
    its value at k = 0, every P_k, k > 0, estimates the variance of the mean. Taken is the median
    over k, an exponential variable's median set right: lines beside the own one fill few k, as they
    turn at a steady rate. Where the mean of the six slowest k is twice as large or more, it is
    taken instead: then the line drifts, or another is too near to cancel. Of fewer than nine blocks
    the mean over all k is taken. White noise is told without bias to within about 6 %.
    """
    count = len(blocks)
    if count < 2:
        return np.zeros(blocks.shape[1:])
    shared = 2 * _SHARED * (1 - 1 / count)
    turns = np.arange(1, count) / count
    shape = (1 + shared) / (1 + shared * np.cos(2 * np.pi * turns))
    power = np.abs(np.fft.fft(blocks, axis=0)[1:] / count) ** 2
    told: FloatArray = power * shape.reshape(-1, *[1] * (blocks.ndim - 1))
    if count < _FEW:
        whole: FloatArray = told.mean(axis=0)
        return whole
    usual = np.median(told, axis=0) / _median_of_exponentials(count - 1)
    slow = 0.5 * (told[:_SLOW].mean(axis=0) + told[-_SLOW:].mean(axis=0))
    return np.where(slow > _EXCESS * usual, slow, usual)


def _median_of_exponentials(count: int) -> float:
    """Mean of the median of so many exponential variables of mean 1."""
    waits = 1.0 / np.arange(count, 0, -1)  # between one of them and the next larger
    reached = np.cumsum(waits)
    return float(0.5 * (reached[(count - 1) // 2] + reached[count // 2]))
