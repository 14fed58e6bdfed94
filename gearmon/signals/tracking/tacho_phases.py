"""Pulses of a tachometer and phases of order lines together: never worse than the pulses alone.

Pulses count the turns and tell where angle zero is, but each comes as late as the sampling and the
mark let it: half a sample is 0.03 mesh periods of a gear of 30 teeth at 25 Hz and 12 kHz. The lines
tell the angle between the pulses a hundred times finer, but only up to an offset, and to a slow
drift that the path gives them as the speed changes. The angle sought is that of the lines, put
where the pulses are in the mean; what the pulses say of the drift beyond their scatter is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders import OrderSums
from gearmon.signals.tracking.phases import lock_track
from gearmon.signals.tracking.tacho import track_through

FloatArray = NDArray[np.float64]

# Fewest pulses and turns with which it is tried: below, no mean of a line stands for anything.
_PULSES, _TURNS = 16, 16.0
# Scatter of the pulses [cycles of the highest line] that the phases of lines do not better: what
# even the clearest of them err (`phases`).
_FINE_CYCLES = 0.005
# Blocks in which lines are judged [turns]: those that they are locked in.
_BLOCK_TURNS = 4.0
# Stiffness that smooths pulses over a block before lines are locked: what they scatter faster than
# that no line mends. Of a spline through even pulses, half of a wave of 1 / 8^(1/4) rad a turn.
_STIFF = 8.0
# Stiffnesses that are tried, powers of two.
_TRIED = np.arange(-4.0, 31.0, 2.0)
# Twice the log likelihood that a drift of the lines must gain to be believed: chance gains as much
# in one recording of a thousand, half of chi square of one degree of freedom.
_DRIFTS = 10.0
# Coherence of the fractions of a sample by which edges advance a turn, from which on quantisation
# beats with the rotation and passes for a drift; of white ones 200 turns give 0.07.
_BEATS = 0.25
# Pulses over which the angle must keep to their mean, and standard deviations of that mean.
_MEAN_OF, _DEVIATIONS = 25, 4.0


@dataclass(frozen=True, kw_only=True)
class Joined:
    """The angle from pulses and lines together, or that of the pulses.

    Parameters
    ----------
    track : AngleTrack
        The angle of shaft 1.
    used : bool
        Whether the lines had a part in it.
    beyond : float
        By how much the lines would move the angle, over what the scatter of the pulses allows;
        lines that would move it by more than 1 are not believed.
    """

    track: AngleTrack
    used: bool = False
    beyond: float = 0.0


def join(sums: OrderSums, known: AngleTrack, time_s: FloatArray, turns: FloatArray) -> Joined:
    """Refine the angle of a tachometer by the phases of order lines.

    Parameters
    ----------
    sums : OrderSums
        Mesh lines of the recording.
    known : AngleTrack
        The angle from the pulses alone; its uncertainty is the jitter of single pulses.
    time_s, turns : ndarray of float, shape (pulses,)
        Times of the pulses [s] and the angles that they mark [turns of shaft 1], ascending.

    Returns
    -------
    Joined
        With the angle of the pulses if the lines stand no stiller in the other one, or if that
        departs from the pulses by more than their scatter allows: over any 25 pulses in the mean by
        more than half a sample and four standard deviations of the mean of so many.

    Notes
    -----
    The times of the pulses are smoothed over the angle, as stiffly as their likelihood wants under
    a random walk of the speed, and at least over the blocks that lines are heard in. The lines are
    locked from there on (`lock_track`). What the pulses then lie beside the angle is their scatter
    and a drift, of which the likelihood under a random walk tells whether it is
    there at all; without, the mean is taken: so the quantisation of n pulses goes down by sqrt(n).
    At a speed so steady that edges beat with the samples, quantisation is not white and would pass
    for a drift: none is looked for while the mean explains the pulses.
    """
    pulses = _Pulses.of(known, time_s, turns, sums.sampling_rate_hz)
    if not pulses.enough or pulses.scatter * float(sums.orders.max()) < _FINE_CYCLES:
        return Joined(track=known)
    course = pulses.course()
    if np.any(np.diff(course) <= 0):
        return Joined(track=known)
    try:
        track = lock_track(sums, track_through(course, turns, float(known.time_s[-1])))
    except ArgumentError:  # lines that would turn the shaft back
        return Joined(track=known)
    beside = turns - track.turns_at(time_s)
    moved = track.turns + np.interp(track.turns, turns - beside, pulses.drift(course, beside))
    if not np.isfinite(track.uncertainty_turns) or np.any(np.diff(moved) <= 0):
        return Joined(track=known)
    doubt = min(track.uncertainty_turns, known.uncertainty_turns)
    joined = replace(track, turns=moved, uncertainty_turns=doubt, indexed=known.indexed)
    if _stillness(sums, joined) <= _stillness(sums, known):
        return Joined(track=known)
    beyond = pulses.departure(turns - joined.turns_at(time_s))
    if beyond > 1.0:
        return Joined(track=known, beyond=beyond)
    return Joined(track=joined, used=True, beyond=beyond)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pulses:
    """Pulses, their jitter and the length of a sample [turns], and the sampling rate [Hz]."""

    time_s: FloatArray
    turns: FloatArray
    jitter: float
    sample: float
    rate: float

    @classmethod
    def of(cls, known: AngleTrack, time_s: FloatArray, turns: FloatArray, rate: float) -> _Pulses:
        speed_hz = float((turns[-1] - turns[0]) / (time_s[-1] - time_s[0]))
        jitter = known.uncertainty_turns
        return cls(time_s=time_s, turns=turns, jitter=jitter, sample=speed_hz / rate, rate=rate)

    @property
    def enough(self) -> bool:
        return len(self.turns) >= _PULSES and self.turns[-1] - self.turns[0] >= _TURNS

    @property
    def scatter(self) -> float:
        """Standard deviation of a pulse [turns]; an edge is somewhere between two samples."""
        return max(self.jitter, self.sample / math.sqrt(12))

    @property
    def a_turn(self) -> float:
        return (len(self.turns) - 1) / float(self.turns[-1] - self.turns[0])

    def course(self) -> FloatArray:
        """Return the times of the pulses [s] as a smooth course of the speed has them."""
        return _smoothed(self.turns, self.time_s, 2, _STIFF * self.a_turn**4)

    def drift(self, course: FloatArray, beside: FloatArray) -> FloatArray:
        """Return what of the distance between pulses and lines is no scatter [turns]."""
        mean = np.full(len(beside), beside.mean())
        if self._beats(course) and self.departure(beside - mean) <= 1.0:
            return mean
        return _smoothed(self.turns, beside, 1)

    def _beats(self, course: FloatArray) -> bool:
        """Whether edges fall at the same place between two samples turn after turn."""
        lag = max(1, round(self.a_turn))
        samples = self.rate * (course[lag:] - course[:-lag])
        return self.jitter < self.sample and abs(np.mean(np.exp(2j * np.pi * samples))) > _BEATS

    def departure(self, beside: FloatArray) -> float:
        """By how much means of pulses lie beside an angle, over what they may."""
        count = min(_MEAN_OF, len(beside) // 4)
        means = np.convolve(beside, np.full(count, 1.0 / count), "valid")
        allowed = 0.5 * self.sample + _DEVIATIONS * self.jitter / np.sqrt(count)
        return float(np.max(np.abs(means)) / allowed)


def _stillness(sums: OrderSums, track: AngleTrack) -> float:
    """Mean over the lines of the share of their power that stands still, noise included."""
    amplitude = sums.sliding(track, _BLOCK_TURNS).amplitude
    power = np.maximum(np.mean(np.abs(amplitude) ** 2, axis=0), np.finfo(float).tiny)
    return float(np.mean(np.abs(amplitude.mean(axis=0)) ** 2 / power))


def _smoothed(x: FloatArray, y: FloatArray, order: int, least: float = 0.0) -> FloatArray:
    """Smooth values as stiffly as their likelihood wants, and at least as stiffly as `least`.

    The curve f minimises sum (y - f)^2 + stiffness * sum (difference quotient of f)^2, its steps in
    units of their mean: white scatter about a random walk (order 1) or a summed one (order 2). The
    polynomial that no stiffness bends is what others must outdo in likelihood.
    """
    from scipy.linalg import cho_solve_banded, cholesky_banded

    rough = _roughness(x, order)
    plain = np.polynomial.Polynomial.fit(x, y, order - 1)(x)
    rest, free = y - plain, len(x) - order
    found = []
    tried = 2.0**_TRIED
    for stiff in tried[tried >= min(least, tried[-1])]:
        band = stiff * rough
        band[0] += 1.0
        root = cholesky_banded(band, lower=True)
        curve = cho_solve_banded((root, True), rest)
        misfit = max(float(rest @ (rest - curve)), np.finfo(float).tiny)
        determinant = 2 * np.log(root[0]).sum() - free * np.log(stiff)
        found.append((free * np.log(misfit) + determinant, curve))
    likeliest = min(found, key=lambda one: one[0])
    believed = likeliest[0] + _DRIFTS < found[-1][0]
    return np.asarray(plain + likeliest[1] if believed else plain)


def _roughness(x: FloatArray, order: int) -> FloatArray:
    """Lower diagonals of the squared difference quotients of first or second order."""
    step = np.diff(x) / np.mean(np.diff(x))
    if order == 1:
        rows, over = np.stack([-1 / step, 1 / step]), step
    else:
        over = 0.5 * (step[1:] + step[:-1])
        rows = np.stack([1 / step[:-1], -1 / step[:-1] - 1 / step[1:], 1 / step[1:]]) / over
    band = np.zeros((order + 1, len(x)))
    for low in range(order + 1):
        for high in range(low, order + 1):
            band[high - low, low : low + rows.shape[1]] += over * rows[low] * rows[high]
    return band
