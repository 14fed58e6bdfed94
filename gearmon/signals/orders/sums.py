"""Order lines in short stretches of a recording, read once for many angle tracks.

A line of order o in a block of angle is the sum of x_n exp(-2 pi i o a_n) w_n over the samples, a_n
their angles. Within a stretch of some cycles of the highest order the angle is a straight line of
known slope, and the window is constant, so that the sum over the stretch

    R_k = sum over n of x_n exp(-2 pi i o f_k (t_n - t_k)),     t_k its middle, f_k the speed there,

hardly depends on the track: another track only turns it by exp(-2 pi i o a(t_k)). The samples go
through one matrix product, once; blocks of any length in any angle that is sought are then sums of
a hundredth of their number.

A speed that is wrong by a share d within a stretch of c cycles takes (pi c d)^2 / 6 of a line and
lets c d of a line one over the stretch's length away through: beyond a limit of c d the samples are
read again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gearmon.signals.angle import AngleTrack, phasors
from gearmon.signals.array_types import ComplexArray, FloatArray
from gearmon.signals.orders.lines import OrderLines, line_noise, steps_of_block
from gearmon.signals.orders.resampling import AngleGrid
from gearmon.signals.threads import side_by_side

# Tracks whose angle is remembered.
_REMEMBERED = 2
# Edges of stretches whose angles are found together.
_EDGES = 1 << 14
# Cycles a stretch, root mean square, by which another track may differ before it is read anew.
_NEAR = 0.02
# Cycles of the highest order in a stretch, its longest [turns], and the least number of them.
_CYCLES, _LONGEST, _LEAST = 18.0, 0.125, 256
# Stretches that share a speed, steps of its logarithm, and how many are read together.
_SHARING, _SPEED_STEP, _TOGETHER = 8, 2e-4, 1 << 12


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
    near. The angle of the last two tracks is remembered.
    """

    def __init__(self, samples: FloatArray, sampling_rate_hz: float, orders: FloatArray) -> None:
        self.samples = samples
        self.sampling_rate_hz = sampling_rate_hz
        self.orders = orders
        self._read: Stretches | None = None
        self._tracks: list[tuple[AngleTrack, FloatArray]] = []
        self._noise: dict[float, FloatArray] = {}

    def blocks(self, track: AngleTrack, block_turns: float, top: float = np.inf) -> OrderLines:
        """Return the lines in half-overlapped Hann blocks, as `order_lines` does.

        Parameters
        ----------
        track : AngleTrack
            Angle of shaft 1 against time.
        block_turns : float
            Length of a block [turns]; cut to the recording.
        top : float
            Lines above this order are left out; the lowest one never.

        Returns
        -------
        OrderLines
            Amplitudes right to a few thousandths. The noise is that of the first track asked for
            with blocks of this length and near this one.

        Raises
        ------
        ArgumentError
            If the recording holds too few samples.
        """
        top_order = float(self.orders.max())
        grid = AngleGrid.of(self.samples.shape[-1], self.sampling_rate_hz, track, top_order)
        block = steps_of_block(grid, block_turns)
        turns = block / grid.per_turn
        halves = 2 * (grid.count - block) // block + 2
        edges: FloatArray = grid.first_turn + 0.5 * turns * np.arange(halves + 1.0)
        chosen = np.flatnonzero(self.orders <= max(top, float(self.orders.min())))
        angle, read = self._near(track)
        share, sums = _cut(angle, edges)
        rising = np.cos(np.pi * share)

        def half_sums(wave: ComplexArray) -> ComplexArray:
            even, odd = sums(wave), sums(wave * rising)
            return np.asarray(0.5 * (even[:-1] + even[1:] - odd[:-1] + odd[1:]))

        amplitude = self._turned(angle, read, chosen.tolist(), half_sums)
        if block_turns not in self._noise:
            self._noise[block_turns] = line_noise(
                self.samples, self.sampling_rate_hz, track, self.orders, block_turns
            )
        return OrderLines(
            orders=self.orders[chosen],
            amplitude=amplitude * (2.0 / (0.5 * turns)),
            block_turns=turns,
            first_turn=grid.first_turn,
            noise=self._noise[block_turns][:, chosen],
        )

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
        # two hops before the first centre and two after the last one
        edges: FloatArray = low + hop * np.arange(-2.0, count + 2.0)
        share, sums = _cut(angle, edges)
        cosine, sine = np.cos(0.5 * np.pi * share), np.sin(0.5 * np.pi * share)

        def block_sums(wave: ComplexArray) -> ComplexArray:
            # 1/2 + 1/2 cos about the centre, in the two hops before and the two after it
            plain, near, far = sums(wave), sums(wave * cosine), sums(wave * sine)
            total: ComplexArray = plain[:-3] + plain[1:-2] + plain[2:-1] + plain[3:]
            total += near[2:-1] + far[1:-2] - far[3:] - near[:-3]
            return 0.5 * total

        amplitude = self._turned(angle, read, range(len(self.orders)), block_sums)
        steps, middle = np.diff(angle), 0.5 * (angle[1:] + angle[:-1])
        weight = block_sums(_padded(steps)).real
        moment = block_sums(_padded(steps * (middle - low))).real
        return SlidingLines(
            angle=low + moment / weight,
            orders=np.tile(self.orders, len(self.samples)),
            amplitude=(amplitude / weight[:, None, None]).reshape(count, -1),
        )

    def _near(self, track: AngleTrack) -> tuple[FloatArray, Stretches]:
        """Return the angle of a track at the edges of stretches, and sums that suit it."""
        if self._read is not None:
            for known, angle in self._tracks:
                if known is track:
                    return angle, self._read
            angle = self._read.angle_in(track)
            if self._read.departure(angle) < _NEAR:
                self._tracks = [*self._tracks[1 - _REMEMBERED :], (track, angle)]
                return angle, self._read
            self._noise = {}
        self._read = Stretches.of(self.samples, self.sampling_rate_hz, track, self.orders)
        self._tracks = [(track, self._read.angle_in(track))]
        return self._tracks[0][1], self._read

    def _turned(
        self,
        angle: FloatArray,
        read: Stretches,
        lines: Sequence[int],
        sums_of: Callable[[ComplexArray], ComplexArray],
    ) -> ComplexArray:
        """Return what `sums_of` makes of each line in the angle of a track.

        Parameters
        ----------
        angle : ndarray of float
            That of the track at the edges of the stretches [turns].
        read : Stretches
            The sums.
        lines : sequence of int
            Numbers of the lines.
        sums_of : callable
            Takes a line, stretch by stretch, each times the angle that it spans, and a zero.

        Returns
        -------
        ndarray of complex, shape (sums, channels, lines)
        """
        middle, steps = 0.5 * (angle[1:] + angle[:-1]), np.diff(angle) / read.length

        def line(number: int) -> ComplexArray:
            turn = phasors(-self.orders[number] * middle) * steps
            found = []
            for real, imag in read.sums[:, :, number]:
                wave = _padded(real)
                wave.imag[:-1] = imag
                wave[:-1] *= turn
                found.append(sums_of(wave))
            return np.stack(found, axis=-1)

        work = 4 * len(lines) * len(self.samples) * len(steps)
        return np.stack(side_by_side(line, lines, work), axis=-1)


def _padded(values: FloatArray) -> ComplexArray:
    """Return values as complex numbers, and a zero behind them."""
    padded = np.zeros(len(values) + 1, dtype=np.complex128)
    padded.real[:-1] = values
    return padded


def _cut(
    angle: FloatArray, edges: FloatArray
) -> tuple[FloatArray, Callable[[ComplexArray], ComplexArray]]:
    """Share stretches out among parts of the angle by where their middles lie.

    Returns
    -------
    share : ndarray of float, shape (stretches + 1,)
        Where each lies in its part, 0 to 1, and a zero.
    sums : callable
        Adds up a wave over each part; a zero at its end keeps parts behind the last stretch.
    """
    middle = 0.5 * (angle[1:] + angle[:-1])
    first = np.searchsorted(middle, edges)
    # an edge more has passed from the first stretch behind it on
    sizes = np.diff(np.concatenate([[0], first, [len(middle)]]))
    part = np.repeat(np.clip(np.arange(-1, len(edges)), 0, len(edges) - 2), sizes)
    share = (middle - edges[part]) / (edges[1] - edges[0])

    def sums(wave: ComplexArray) -> ComplexArray:
        total: ComplexArray = np.add.reduceat(wave, first)[:-1]
        total[first[:-1] == first[1:]] = 0.0
        return total

    return np.append(share, 0.0), sums


@dataclass(frozen=True, kw_only=True)
class Stretches:
    """Sums of samples under waves of each order, stretch by stretch.

    `sums` has shape (channels, 2, lines, stretches), real and imaginary parts; `length` is the
    samples of a stretch, `slopes` the logarithms of the turns that each was made with, `cycles` the
    cycles of the highest order in one.
    """

    edges_s: FloatArray
    length: int
    sums: FloatArray
    slopes: FloatArray
    cycles: float

    @classmethod
    def of(
        cls, samples: FloatArray, rate: float, track: AngleTrack, orders: FloatArray
    ) -> Stretches:
        """Read a recording in the angle of a track."""
        top, fastest = float(orders.max()), float(track.speed_hz.max())
        turns = min(_CYCLES / top, _LONGEST)
        length = max(1, int(min(turns * rate / fastest, samples.shape[-1] / _LEAST)))
        count = samples.shape[-1] // length
        edges_s = (length * np.arange(count + 1) - 0.5) / rate
        # some stretches share a speed, rounded to whole steps of its logarithm
        shared = np.arange(0, count, _SHARING)
        sizes = np.diff(np.append(shared, count))
        mean = np.add.reduceat(np.diff(track.turns_at(edges_s)), shared) / sizes
        number = np.repeat(np.rint(np.log(mean) / _SPEED_STEP), sizes)
        sums = np.empty((len(samples), 2, len(orders), count))
        starts = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1, [count]])
        runs = [
            (first, min(first + _TOGETHER, int(end)))
            for begin, end in pairwise(starts)
            for first in range(int(begin), int(end), _TOGETHER)
        ]
        place = (np.arange(length) - 0.5 * (length - 1)) / length
        known: dict[float, FloatArray] = {}

        def waves_at(speed: float) -> FloatArray:
            if speed not in known:
                wave = 2 * np.pi * np.exp(speed * _SPEED_STEP) * np.outer(orders, place)
                known[speed] = np.concatenate([np.cos(wave), -np.sin(wave)])
            return known[speed]

        def read(row: int) -> None:
            begin, end = runs[row]
            waves = waves_at(float(number[begin]))
            for channel, out in zip(samples, sums, strict=True):
                part = channel[begin * length : end * length].reshape(end - begin, length)
                np.matmul(waves, part.T, out=out.reshape(len(waves), count)[:, begin:end])

        side_by_side(read, range(len(runs)), samples.size)
        return cls(
            edges_s=edges_s,
            length=length,
            sums=sums,
            slopes=number * _SPEED_STEP,
            cycles=top * float(np.exp(np.mean(number) * _SPEED_STEP)),
        )

    def angle_in(self, track: AngleTrack) -> FloatArray:
        """Angle of a track at the edges of the stretches [turns]."""
        parts = np.split(self.edges_s, range(_EDGES, len(self.edges_s), _EDGES))
        return np.concatenate(side_by_side(track.turns_at, parts, 16 * len(self.edges_s)))

    def departure(self, angle: FloatArray) -> float:
        """Cycles a stretch that a track differs by from the one these sums were made with."""
        change = np.log(np.diff(angle)) - self.slopes
        return float(np.sqrt(np.mean(change**2))) * self.cycles
