"""Order lines: complex amplitudes at known orders, block by block (a short-time order transform).

An *order* is a number of cycles a turn of shaft 1; angles are counted in turns of shaft 1. Time is
the last axis everywhere, channels the one before. Half-overlapped Hann blocks share their halves:
each half is spread onto equal steps of angle and transformed once, under the rising and under the
falling half of the window.

How far the mean of a line over the blocks may be off, the blocks themselves tell: not by their
scatter, for half-overlapped blocks share noise, a line of another stage beside the own one turns
from block to block and all but cancels in the mean, and a slow drift hardly cancels at all. What
tells is the spectrum of the block series near zero (`variance_of_mean`).

Where the angle is still sought the same lines are asked for in many tracks (`OrderSums`). A line of
order o in a block of angle is the sum of x_n exp(-2 pi i o a_n) w_n over the samples, a_n their
angles. Within a stretch of some cycles of the highest order the angle is a straight line of known
slope, and the window is constant, so that the sum over the stretch

    R_k = sum over n of x_n exp(-2 pi i o f_k (t_n - t_k)),     t_k its middle, f_k the speed there,

hardly depends on the track: another track only turns it by exp(-2 pi i o a(t_k)). The samples go
through one matrix product, once; blocks of any length in any angle that is sought are then sums of
a hundredth of their number.

A speed that is wrong by a share d within a stretch of c cycles takes (pi c d)^2 / 6 of a line and
lets c d of a line one over the stretch's length away through: beyond a limit of c d the samples are
read again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csc_array, csr_array

from gearmon.arrays import ComplexArray, FloatArray, IntArray, median_along
from gearmon.errors import ArgumentError
from gearmon.signals.angle import AngleTrack, phasors
from gearmon.signals.orders.resampling import AngleGrid, InAngle, Kernel
from gearmon.signals.spectra import fast_length, local_floor, transform, window, window_powers
from gearmon.threads import side_by_side

# What a line may add elsewhere where only the phase of strong ones is followed.
_QUICK_ERROR = 1e-3
# Blocks whose spectra tell the noise between the lines, and where it only weighs phases: each is a
# median over some hundred lines, right to 3 and 5 %; more would only take time.
_FLOOR_BLOCKS, _QUICK_BLOCKS = 32, 8
# Width of the kernel, steps a cycle of the highest order, and a sample, at the least: what
# spreading adds is below 1e-6 where there are twice as many steps a cycle, 1e-4 or some 1e-3.
_PRECISE, _MIDDLE, _QUICK = (8, 2.6, 1.0), (6, 3.2, 0.25), (4, 2.6, 0.25)
_MIDDLE_FROM, _QUICK_FROM = 1e-4, 1e-3
# Steps taken at a time.
_STEPS_TOGETHER = 1 << 18
# Correlation of the amplitudes of noise in neighbouring half-overlapped Hann blocks (Harris 1978).
_SHARED = 1 / 6
# Fewer blocks than this tell a mean, but no median and no slow drift.
_FEW = 9
# Fewest blocks whose median tells of a knock, and what comes with every turn; power of a block's
# departures over that of the median block from which there is one (without knocks 1.6 at most, with
# one of twice the peak 9 and more), and where blocks are too few to be clipped (in four blocks of
# 17 simulated planetary sets 1.3 to 2.9 without, with one of twice the peak 3.1 and more in 14);
# standard deviations to which departures around the turn are clipped (median of a normal variable's
# size: 0.6745); blocks that a long recording has compared.
_FEWEST_BLOCKS, _CLIPPED_FROM, _FARTHEST, _NORMAL_MEDIAN = 4, 8, 4.0, 0.6745
_KNOCKED, _BESIDE_KNOCK = (2.0, 3.0), 64
# Slowest frequencies of the block series to either side that drift and near lines fill, and excess
# over the median from which they are believed: six values of noise reach it in 2 % of cases.
_SLOW, _EXCESS = 3, 2.0
# Cycles a stretch, root mean square, by which another track may differ before it is read anew.
_NEAR = 0.02
# Cycles of the highest order in a stretch, its longest [turns], and the least number of them.
_CYCLES, _LONGEST, _LEAST = 18.0, 0.125, 256
# Stretches that share a speed, steps of its logarithm, and how many are read or summed together.
_SHARING, _SPEED_STEP, _TOGETHER = 8, 2e-4, 1 << 14


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
    knocked : float, in [0, 1]
        Share of the blocks that bear a knock from outside, see `without_knocks`.
    """

    orders: FloatArray
    amplitude: ComplexArray
    block_turns: float
    first_turn: float
    noise: FloatArray
    knocked: float = 0.0

    @property
    def mean(self) -> ComplexArray:
        """Synchronous mean over the blocks, shape (channels, lines)."""
        return np.asarray(self.amplitude.mean(axis=0))

    @property
    def independent_blocks(self) -> float:
        """Blocks counted as independent: half overlapped Hann blocks lose about a tenth of them.

        Welch's variance of the mean of half-overlapped Hann blocks is 1.056 of that of as many
        blocks end to end as there is record per half block (Harris 1978, correlation 1/6).
        """
        count = self.amplitude.shape[0]
        return float(count / (1 + 2 * _SHARED**2 * (count - 1) / count))

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
        return np.asarray(self.block_powers()[0].mean(axis=0))


class OrderBlocks:
    """Half-overlapped Hann blocks of a recording: complex line amplitudes at arbitrary orders.

    The samples are spread onto equal steps of angle (`resampling.InAngle`) half a block at a
    time, so that memory stays bounded, by all cores. Each half is transformed once: its transform
    at the orders comes from a non-uniform transform (zero padding to twice the length,
    Kaiser-Bessel kernel of eight bins), those of the rising and of the falling half of the Hann
    window from the bins next to it. Relative error below `error` at a steady speed, for orders
    below half the sampling rate; a speed that changes leaves more, as the kernel's weights follow
    it only to first order.

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
    left_out : sequence of (int, int)
        First samples and ends of stretches; blocks that hold some of one are left out.
    held : bool
        Whether `signals` is to hold all steps, enough of them for the whole band.

    Raises
    ------
    ArgumentError
        If an order is negative, the recording holds too few samples, or no block is left.
    """

    def __init__(
        self,
        samples: FloatArray,
        sampling_rate_hz: float,
        track: AngleTrack,
        orders: FloatArray,
        block_turns: float,
        error: float = 1e-6,
        left_out: Sequence[tuple[int, int]] = (),
        held: bool = False,
    ) -> None:
        if len(orders) == 0 or orders.min() < 0:
            raise ArgumentError("orders: at least one, all >= 0, are needed")
        top, rate = float(orders.max()), sampling_rate_hz
        whole = rate / float(track.speed_hz.min())
        grid = AngleGrid.of(samples.shape[-1], rate, track, top)
        # rounded down: the last of the blocks that just fill a recording must not fall off its end
        block = min(grid.count, max(8, int(block_turns * grid.per_turn + 1e-6)))
        self.orders, self.first_turn = orders, grid.first_turn
        self.block_turns, self.count = block / grid.per_turn, 2 * (grid.count - block) // block + 2
        # steps that last no longer than a sample hold the whole band; fewer of them do for lines
        # low in it, and what is folded onto these the kernel has taken out before
        # of the kernels by what it may add, the highest order and samples a turn; close to half
        # the sampling rate the middle one would need more steps than the longest
        middle = error >= _MIDDLE_FROM and _MIDDLE[1] * top <= whole
        slow = _MIDDLE if middle else _PRECISE
        width, room, coarsest = _QUICK if error >= _QUICK_FROM else slow
        least = max(room * top, whole if held else coarsest * whole)
        self.steps = fast_length(int(np.ceil(self.block_turns * least))) // 2  # of a half
        per_turn = 2 * self.steps / self.block_turns
        kernel = Kernel.of(width, per_turn / (2 * max(top, 1e-3 * per_turn)))
        # what spreading leaves of a line, over that one bin of a block below and above
        near = (orders + k / self.block_turns for k in (-1, 0, 1))
        below, response, above = (kernel.transform(own / per_turn) for own in near)
        self.beside = np.stack([response / below, response / above])
        self.scale = np.where(orders > 0, 2.0, 1.0) / (self.steps * response)
        steps = int(grid.count / grid.per_turn * per_turn + 1e-6)
        grid = AngleGrid(per_turn=per_turn, first_turn=grid.first_turn, count=steps)
        signals = InAngle(samples, rate, track, grid, kernel)
        self.signals = signals.holding() if held else signals
        self.starts = self.first_turn + 0.5 * self.block_turns * np.arange(self.count)
        sound = np.ones(self.count - 1, dtype=bool)
        for stretch in left_out:
            begin, end = track.turns_at(np.array(stretch) / rate)
            sound &= (self.starts[:-1] + self.block_turns <= begin) | (self.starts[:-1] >= end)
        self.sound = np.flatnonzero(sound)
        if not len(self.sound):
            raise ArgumentError(f"no block of {block_turns:.4g} turns is sound")
        # blocks whose spectra tell the noise
        most = _QUICK_BLOCKS if error >= _QUICK_FROM else _FLOOR_BLOCKS
        every = max(1, len(self.sound) // most)
        self.sampled = self.sound[every - 1 :: every].tolist()

    def lines(self) -> OrderLines:
        """Return the lines in all blocks that are sound; phases count from the start."""
        plan = GriddedPlan(self.steps, 0.5 * self.orders * self.block_turns, self.beside)
        together, samples = max(1, _STEPS_TOGETHER // self.steps), self.signals.samples

        def part(first: int) -> ComplexArray:
            """Transform halves under the rising and the falling half of the window."""
            begin = self.starts[first : first + together]
            cut = self.signals.steps(first * self.steps, len(begin) * self.steps)
            found = plan.lines(cut.reshape(-1, self.steps))
            waves = phasors(np.outer(begin, -self.orders)) * self.scale
            return found.reshape(len(samples), len(begin), 2, -1) * waves[:, None]

        parts = side_by_side(part, range(0, self.count, together), samples.size)
        halves = np.concatenate(parts, axis=1).swapaxes(0, 1)
        rows = halves[:-1, :, 0] + halves[1:, :, 1]
        return OrderLines(
            orders=self.orders,
            amplitude=rows if len(self.sound) == len(rows) else rows[self.sound],
            block_turns=self.block_turns,
            first_turn=self.first_turn,
            noise=self.noise(),
        )

    def noise(self) -> FloatArray:
        """Noise power at each line, shape (channels, lines), from the blocks between the lines.

        The mean of n noise powers follows a gamma law of shape n, whose median over its mean is
        about 1 - 1/(3 n) + 0.02/n^2; half overlapped Hann blocks are worth a twentieth less.
        """
        size, weights, length = 2 * self.steps, window("hann", 2 * self.steps), 4 * self.steps
        work = len(self.sampled) * length * len(self.signals.samples)

        def power(number: int) -> FloatArray:
            return window_powers(self.signals.steps(number * self.steps, size), weights, length)

        powers = side_by_side(power, self.sampled, work)
        mean: FloatArray = sum(powers, np.zeros(1)) / len(powers)
        worth = max(1.0, 0.95 * len(self.sampled))
        median = 1 - 1 / (3 * worth) + 0.02 / worth**2
        floor = local_floor(mean, min(mean.shape[-1], 256)) / median
        bins = np.rint(self.orders * (2 * self.block_turns)).astype(int)
        return np.asarray(floor[:, np.minimum(bins, mean.shape[-1] - 1)] * self.scale**2)


class GriddedPlan:
    """Non-uniform Fourier transform of halves of blocks at many fractional bins.

    In the bins of a half that is padded to twice its length the Hann window of the block is
    (-1/4, 1/2, -1/4) where it rises and (1/4, 1/2, 1/4) where it falls, each bin over what
    spreading left of it: so the window is that of the samples, not of the steps.
    """

    _KERNEL = Kernel(width=8, beta=2.30 * 8)

    def __init__(self, steps: int, bins: FloatArray, beside: FloatArray) -> None:
        self.length, self.steps = 2 * steps, steps
        width = self._KERNEL.width
        self._flat = 1 / self._KERNEL.transform((np.arange(steps) - steps / 2) / self.length)
        target = 2.0 * bins
        base = np.floor(target).astype(int) - width // 2 + 1
        # the kernel acts on the spectrum of the half centred at zero: undo the shift on the grid
        away = base[:, None] + np.arange(width) - target[:, None]
        weight = self._KERNEL.at(away) * np.exp(0.5j * np.pi * away)
        # phases turn by a quarter from bin to bin on the way there and back: none is left
        middle, below, above = (np.pad(weight, ((0, 0), (k, 2 - k))) for k in (1, 0, 2))
        next_to = 0.25 * (beside[0][:, None] * below + beside[1][:, None] * above)
        both = np.concatenate([0.5 * middle - next_to, 0.5 * middle + next_to])
        # bins from the lowest to the highest that is asked for, also below 0 and above the middle
        first = int(base.min(initial=1)) - 1
        wanted = first + np.arange(int(base.max(initial=1)) + width - first + 1)
        wrapped = wanted % self.length
        self._mirrored = np.flatnonzero(wrapped > steps)
        self._taken = np.where(wrapped > steps, self.length - wrapped, wrapped)
        place = np.tile(base - 1 - first, 2)[:, None] + np.arange(both.shape[1])
        ends = both.shape[1] * np.arange(len(both) + 1)
        shape = len(both), len(wanted)
        self._weights = csr_array((both.ravel(), place.ravel(), ends), shape=shape)

    def lines(self, halves: FloatArray) -> ComplexArray:
        """Return the transforms under the rising and the falling half of the window."""
        bins = transform(halves, self.length, self._flat).take(self._taken, axis=1)
        bins[:, self._mirrored] = np.conj(bins[:, self._mirrored])
        return np.asarray((self._weights @ bins.T).T.reshape(len(halves), 2, -1))


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
    shape = (1 + shared) / (1 + shared * np.cos(2 * np.pi * np.arange(1, count) / count))
    power = np.abs(np.fft.fft(blocks, axis=0)[1:] / count) ** 2
    told: FloatArray = power * shape.reshape(-1, *[1] * (blocks.ndim - 1))
    if count < _FEW:
        return np.asarray(told.mean(axis=0))
    # mean of the median of exponential variables of mean 1, by the waits from one to the next
    reached = np.cumsum(1.0 / np.arange(count - 1, 0, -1))
    usual = median_along(told) / np.median(reached)
    slow = 0.5 * (told[:_SLOW].mean(axis=0) + told[-_SLOW:].mean(axis=0))
    return np.where(slow > _EXCESS * usual, slow, usual)


def without_knocks(lines: OrderLines, chosen: IntArray, number: IntArray) -> OrderLines:
    """Clip what comes in single turns: of a knock from outside the mean would keep an event.

    Parameters
    ----------
    lines : OrderLines
    chosen : ndarray of int, shape (k,)
        Places of the multiples of one rotation among the lines.
    number : ndarray of int, shape (k,)
        Which multiple each is.

    Returns
    -------
    OrderLines
        The same where there is no knock.

    Notes
    -----
    Noise is alike around the turn; a knock is at one place of it, and would pass for a damaged
    tooth. What departs from the median of the blocks is put together around the turn, each line in
    units of its own scatter, and clipped where it is farther out than noise reaches. An event that
    comes again with every turn stands in the median and is not touched.
    """
    count, amplitude, knocked = len(lines.amplitude), lines.amplitude, 0
    edges = np.linspace(0, count, max(1, count // _BESIDE_KNOCK) + 1).astype(int).tolist()
    for start, stop in pairwise(edges):
        blocks, few = lines.amplitude[start:stop][:, :, chosen], stop - start < _CLIPPED_FROM
        if len(blocks) < _FEWEST_BLOCKS or not len(number):
            continue
        middle = median_along(blocks.real) + 1j * median_along(blocks.imag)
        scale = np.sqrt(median_along(np.abs(blocks - middle) ** 2)).clip(np.finfo(float).tiny)
        rest = (blocks - middle) / scale
        power = np.mean(np.abs(rest) ** 2, axis=2)
        hit = int(np.sum((power > _KNOCKED[few] * np.median(power)).any(axis=1)))
        knocked += hit
        if not hit or few:
            continue
        size = fast_length(2 * (int(number.max()) + 1))
        half = np.zeros((*blocks.shape[:2], size // 2 + 1), dtype=complex)
        half[..., number] = rest
        around = np.fft.irfft(half, n=size)
        limit = _FARTHEST * float(np.median(np.abs(around))) / _NORMAL_MEDIAN
        beyond = np.fft.rfft(around - np.clip(around, -limit, limit))
        amplitude = lines.amplitude.copy() if amplitude is lines.amplitude else amplitude
        amplitude[start:stop, :, chosen] -= scale * beyond[..., number]
    return replace(lines, amplitude=amplitude, knocked=max(lines.knocked, knocked / max(count, 1)))


@dataclass(frozen=True, kw_only=True)
class SlidingLines:
    """Complex amplitudes of order lines in sliding blocks.

    Parameters
    ----------
    angle : ndarray of float, shape (blocks,)
        Centres of gravity of the blocks' windows [turns].
    orders : ndarray of float, shape (votes,)
        Order of each vote: every line in every channel.
    amplitude : ndarray of complex, shape (blocks, votes)
        Amplitudes; their phases count from angle zero.
    """

    angle: FloatArray
    orders: FloatArray
    amplitude: ComplexArray

    @property
    def hop(self) -> float:
        """Distance of the blocks [turns]."""
        return float(np.median(np.diff(self.angle)))


class OrderSums:
    """Lines of a recording at some orders, in the angle of any track.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    sampling_rate_hz : float
        Sampling rate [Hz].
    orders : ndarray of float, shape (lines,)
        Orders of shaft 1, > 0, ascending.

    Notes
    -----
    It keeps the sums of the track that was asked for last, and makes others for one that is not
    near.
    """

    def __init__(self, samples: FloatArray, sampling_rate_hz: float, orders: FloatArray) -> None:
        self.samples, self.sampling_rate_hz, self.orders = samples, sampling_rate_hz, orders
        self._read: Stretches | None = None
        self._noise: dict[float, FloatArray] = {}

    def noise(self, track: AngleTrack, block_turns: float) -> FloatArray:
        """Return the power that noise alone shows at the lines in `sliding` blocks.

        Parameters
        ----------
        track : AngleTrack
            Angle of shaft 1 against time.
        block_turns : float
            Length of a block [turns]; at most a quarter of the recording.

        Returns
        -------
        ndarray of float, shape (channels, lines)
            Medians of the spectrum about each line, in the first track asked for near this one.
        """
        if block_turns not in self._noise:
            turns = min(block_turns, 0.25 * float(track.turns[-1] - track.turns[0]))
            samples, rate = self.samples, self.sampling_rate_hz
            blocks = OrderBlocks(samples, rate, track, self.orders, turns, _QUICK_ERROR)
            # of a wave both of whose sides count, a sliding sum reads half the peak
            self._noise[block_turns] = 0.25 * blocks.noise()
        return self._noise[block_turns]

    def sliding(self, track: AngleTrack, block_turns: float) -> SlidingLines:
        """Return the lines in Hann blocks a quarter of their length apart, cut at the ends.

        Parameters
        ----------
        track : AngleTrack
            Angle of shaft 1 against time.
        block_turns : float
            Length of a block [turns]; at most a quarter of the recording.

        Returns
        -------
        SlidingLines
        """
        angle, read = self._near(track)
        low, high = float(angle[0]), float(angle[-1])
        hop = min(block_turns, 0.25 * (high - low)) / 4
        count = int((high - low) / hop + 1e-9) + 1
        middle, steps = 0.5 * (angle[1:] + angle[:-1]), np.diff(angle)

        def part(first: int) -> FloatArray:
            """Sum weights, angles and waves, as pairs of reals, over some stretches."""
            own = slice(first, first + _TOGETHER)
            # Hann windows four hops long about each hop, over stretches at ascending places [hops];
            # the angles that these span are their weights
            place = (middle[own] - low) / hop
            number = np.floor(place).astype(np.intp)[:, None] + np.arange(-1, 3)
            weight = 0.5 + 0.5 * np.cos(0.5 * np.pi * (place[:, None] - number))
            weight *= steps[own, None] * ((number >= 0) & (number < count))
            inside, ends = number.clip(0, count - 1), 4 * np.arange(len(place) + 1)
            entries = weight.ravel(), inside.ravel(), ends
            window = csc_array(entries, shape=(count, len(place)))
            waves = phasors(np.outer(middle[own], -self.orders))
            columns = [np.ones(len(waves)), middle[own]]
            columns += [(sums[own] * waves).view(float) for sums in read.sums]
            return np.asarray(window @ np.column_stack(columns))

        parts = side_by_side(part, range(0, len(steps), _TOGETHER), 2 * read.sums.size)
        found: FloatArray = sum(parts[1:], parts[0])
        return SlidingLines(
            angle=found[:, 1] / found[:, 0],
            orders=np.tile(self.orders, len(self.samples)),
            amplitude=found[:, 2:].copy().view(np.complex128) / (read.length * found[:, :1]),
        )

    def _near(self, track: AngleTrack) -> tuple[FloatArray, Stretches]:
        """Return the angle of a track at the edges of stretches, and sums that suit it."""
        if self._read is not None:
            angle = track.turns_at(self._read.edges_s)
            # cycles a stretch by which it differs from the one that the sums were made with
            change = np.log(np.diff(angle)) - self._read.slopes
            if np.sqrt(np.mean(change**2)) * self._read.cycles < _NEAR:
                return angle, self._read
        self._noise = {}
        self._read = Stretches(self.samples, self.sampling_rate_hz, track, self.orders)
        return track.turns_at(self._read.edges_s), self._read


class Stretches:
    """Sums of samples under waves of each order, stretch by stretch, in the angle of a track.

    `sums` has shape (channels, stretches, lines); `length` is the samples of a stretch, `slopes`
    the logarithms of the turns that each was made with, `cycles` the cycles of the highest order in
    one.
    """

    def __init__(
        self, samples: FloatArray, rate: float, track: AngleTrack, orders: FloatArray
    ) -> None:
        top, fastest = float(orders.max()), float(track.speed_hz.max())
        turns = min(_CYCLES / top, _LONGEST)
        self.length = max(1, int(min(turns * rate / fastest, samples.shape[-1] / _LEAST)))
        length, count = self.length, samples.shape[-1] // self.length
        self.edges_s = (length * np.arange(count + 1) - 0.5) / rate
        # some stretches share a speed, rounded to whole steps of its logarithm
        shared = np.arange(0, count, _SHARING)
        sizes = np.diff(np.append(shared, count))
        mean = np.add.reduceat(np.diff(track.turns_at(self.edges_s)), shared) / sizes
        number = np.repeat(np.rint(np.log(mean) / _SPEED_STEP), sizes)
        self.slopes = number * _SPEED_STEP
        self.cycles = top * float(np.exp(np.mean(number) * _SPEED_STEP))
        place = (np.arange(length) - 0.5 * (length - 1)) / length
        parts = samples[:, : count * length].reshape(len(samples), count, length)
        self.sums = np.empty((len(samples), count, len(orders)), dtype=np.complex128)

        def read(own: IntArray) -> None:
            wave = 2 * np.pi * np.exp(self.slopes[own[0]]) * np.outer(place, orders)
            for part, out in zip(parts, self.sums, strict=True):
                out.real[own] = part[own] @ np.cos(wave)
                out.imag[own] = part[own] @ -np.sin(wave)

        order, ends = np.argsort(number, kind="stable"), np.cumsum(np.unique_counts(number).counts)
        alike = np.split(order, np.union1d(ends[:-1], np.arange(_TOGETHER, count, _TOGETHER)))
        side_by_side(read, alike, samples.size)
