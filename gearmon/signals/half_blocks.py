"""Half blocks of a recording at equal steps of angle, and their transforms at given orders.

Half-overlapped Hann blocks share their halves: each half is spread onto the steps and transformed
once, under the rising and under the falling half of the window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.angle import AngleTrack
from gearmon.signals.gridding import Gridding, Kernel
from gearmon.signals.spectrum import hann
from gearmon.signals.threads import side_by_side
from gearmon.signals.transforms import batch, fast_length, window_powers

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

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


@dataclass(frozen=True, kw_only=True)
class HalfBlocks:
    """Half blocks of a recording at equal steps of angle, and their transforms."""

    gridding: Gridding
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
    ) -> HalfBlocks:
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
            gridding=Gridding(samples, rate, track, per_turn, kernel),
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
        self, first_turn: float, count: int, heard: range
    ) -> tuple[ComplexArray, ComplexArray, dict[int, FloatArray]]:
        """Transform all halves under the rising and the falling half of the window.

        Parameters
        ----------
        first_turn : float
            Where the first half begins [turns].
        count : int
            How many halves there are.
        heard : range
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
        wanted = {half for block in heard for half in (block, block + 1)}
        together = max(1, _TOGETHER // self.steps)

        def part(first: int) -> tuple[ComplexArray, ComplexArray, dict[int, FloatArray]]:
            number = min(together, count - first)
            values = np.empty((self.channels, number * self.steps))
            self.gridding.spread(first_turn + first * self.turns, values)
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
            self.gridding.spread(first_turn + number * self.turns, values)
            return values

        work = len(wanted) * self.steps * self.channels
        return dict(zip(wanted, side_by_side(half, wanted, work), strict=True))

    def powers(self, kept: dict[int, FloatArray], heard: range) -> FloatArray:
        """Mean power of the plain Hann spectra of blocks, (channels, bins)."""
        window = hann(2 * self.steps)
        length = 4 * self.steps

        work = len(heard) * length * self.channels

        def power(number: int) -> FloatArray:
            block = np.concatenate([kept[number], kept[number + 1]], axis=-1)
            block -= block.mean(axis=-1, keepdims=True)
            return window_powers(block, window, length, work)

        total: FloatArray = sum(side_by_side(power, heard, work), np.zeros(1)) / len(heard)
        return total


def _choice(error: float, top: float, whole: float) -> tuple[int, float, float]:
    """Choose the kernel by what it may add, the highest order and samples a turn."""
    if error >= _QUICK_FROM:
        return _QUICK
    # close to half the sampling rate it would need more steps than the longer kernel
    return _MIDDLE if error >= _MIDDLE_FROM and _MIDDLE[1] * top <= whole else _PRECISE


class SumPlan:
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


class LinePlan:
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
) -> SumPlan | LinePlan:
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
        return SumPlan(steps, bins, beside)
    return LinePlan(steps, bins, beside, total)


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
