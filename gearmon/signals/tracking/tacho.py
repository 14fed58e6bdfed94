"""Angle of a shaft from the pulses of a tachometer, alone or with the phases of order lines.

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
from numpy.typing import ArrayLike

from gearmon.errors import ArgumentError, RecordingError, check_positive
from gearmon.signals.angle import AngleTrack
from gearmon.signals.array_types import FloatArray
from gearmon.signals.orders.lines import OrderSums
from gearmon.signals.tracking.phases import lock_track, roughness
from gearmon.signals.tracking.pulses import TachoPulses, learn_spacing, pulses_from_times
from gearmon.signals.tracking.thresholds import LIMITS

# Knots a turn that an angle track gets; of an encoder's many pulses neighbours are averaged.
_KNOTS_PER_TURN = 16

# Blocks in which lines are judged [turns]: those that they are locked in.
_JUDGED_TURNS = 4.0
# Stiffness that smooths pulses over a block before lines are locked: what they scatter faster than
# that no line mends. Of a spline through even pulses, half of a wave of 1 / 8^(1/4) rad a turn.
_STIFF = 8.0
# Stiffnesses that are tried, powers of two.
_TRIED = np.arange(-4.0, 31.0, 2.0)


def track_from_pulse_times(
    time_s: ArrayLike, duration_s: float, per_turn: int = 1, shaft_order: float = 1.0
) -> AngleTrack:
    """Turn measured times of pulses into the angle of shaft 1.

    Parameters
    ----------
    time_s : array_like of float, shape (pulses,)
        Times of the pulses [s], ascending, on the clock of the recording.
    duration_s : float
        Duration of the recording [s].
    per_turn : int
        Pulses a turn of the shaft that carries them.
    shaft_order : float
        Turns of that shaft a turn of shaft 1.

    Returns
    -------
    AngleTrack
        Angle zero at the first pulse.

    Raises
    ------
    RecordingError
        As `pulses_from_times` and `track_from_pulses`.
    """
    pulses = pulses_from_times(time_s, per_turn)
    return track_from_pulses(pulses, per_turn, shaft_order, duration_s)


def track_from_pulses(
    pulses: TachoPulses, pulses_per_turn: int, shaft_order: float, duration_s: float
) -> AngleTrack:
    """Turn tachometer pulses into the angle of shaft 1.

    Parameters
    ----------
    pulses : TachoPulses
        The pulses.
    pulses_per_turn : int
        Pulses a turn of the shaft that carries them, > 0. Of several the spacing is learned and
        corrected, see `learn_spacing`.
    shaft_order : float
        Turns of that shaft a turn of shaft 1, > 0.
    duration_s : float
        Duration of the recording [s]; the track is continued to its ends.

    Returns
    -------
    AngleTrack
        Angle zero at the first pulse. Its uncertainty is the jitter of single pulses: by how much
        they come off the straight line between their neighbours, which counts three half times.

    Raises
    ------
    RecordingError
        If there are fewer than three turns.
    """
    time, turns, jitter = pulse_angles(pulses, pulses_per_turn, shaft_order)
    # of several pulses a turn nobody knows which one came first
    indexed = int(pulses_per_turn) == 1 and shaft_order == 1.0
    track = track_through(time, turns, duration_s)
    return replace(track, indexed=indexed, uncertainty_turns=jitter)


def pulse_angles(
    pulses: TachoPulses, pulses_per_turn: int, shaft_order: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return the times of pulses, the angles of shaft 1 that they mark, and their scatter.

    Parameters
    ----------
    pulses : TachoPulses
        The pulses.
    pulses_per_turn : int
        Pulses a turn of the shaft that carries them, > 0; the spacing of several is learned.
    shaft_order : float
        Turns of that shaft a turn of shaft 1, > 0.

    Returns
    -------
    time_s, turns : ndarray of float, shape (knots,)
        Times [s] and angles [turns], 0 for the first pulse; of an encoder's many pulses neighbours
        are averaged.
    jitter_turns : float
        Standard deviation of single pulses about the line through their neighbours [turns].

    Raises
    ------
    RecordingError
        If there are fewer than three turns.
    """
    check_positive("pulses_per_turn", pulses_per_turn)
    check_positive("shaft_order", shaft_order)
    count = int(pulses_per_turn)
    whole = (len(pulses.time_s) - 1) // count + 1
    if whole < 3:
        raise RecordingError(f"tacho channel: {whole} turns recorded, at least 3 are needed")
    spacing = learn_spacing(pulses.time_s, count)
    number = np.arange(len(pulses.time_s))
    turns = (number // count + spacing[number % count]) / shaft_order
    slope = float((turns[-1] - turns[0]) / (pulses.time_s[-1] - pulses.time_s[0]))
    jitter = _jitter(pulses.time_s, turns) * slope
    return *_thinned(pulses.time_s, turns, max(1, count // _KNOTS_PER_TURN)), jitter


def track_through(time_s: FloatArray, turns: FloatArray, duration_s: float) -> AngleTrack:
    """Return the track through known angles, continued straight to the ends of a recording.

    Parameters
    ----------
    time_s, turns : ndarray of float, shape (knots,)
        Times [s] and angles [turns], ascending.
    duration_s : float
        Where the recording ends [s].
    """
    slope = np.diff(turns) / np.diff(time_s)
    first = turns[0] - time_s[0] * slope[0]
    last = turns[-1] + (duration_s - time_s[-1]) * slope[-1]
    inside = (time_s > 0) & (time_s < duration_s)
    return AngleTrack(
        time_s=np.concatenate([[0.0], time_s[inside], [duration_s]]),
        turns=np.concatenate([[first], turns[inside], [last]]),
        method="tacho",
        uncertainty_turns=float("nan"),
    )


def _jitter(time_s: FloatArray, turns: FloatArray) -> float:
    """Return the standard deviation of a pulse's time about its neighbours' line [s]."""
    if len(time_s) < LIMITS.fewest_pulses:
        return 0.0
    share = (turns[1:-1] - turns[:-2]) / (turns[2:] - turns[:-2])
    off = time_s[1:-1] - (1 - share) * time_s[:-2] - share * time_s[2:]
    return float(np.std(off / np.sqrt(1 + share**2 + (1 - share) ** 2)))


def _thinned(time_s: FloatArray, turns: FloatArray, together: int) -> tuple[FloatArray, FloatArray]:
    """Average neighbouring pulses of an encoder: less jitter, and fewer knots."""
    if together == 1:
        return time_s, turns
    cut = len(time_s) // together * together
    means = np.stack([time_s[:cut], turns[:cut]]).reshape(2, -1, together).mean(axis=-1)
    return means[0], means[1]


def pulses_per_turn(pulses: TachoPulses, shaft_hz: float, tolerance: float = 0.05) -> int:
    """Tell how many pulses a turn a tachometer gives from the nominal speed.

    Parameters
    ----------
    pulses : TachoPulses
        The pulses.
    shaft_hz : float
        Nominal rotation frequency of the shaft [Hz].
    tolerance : float
        How far the speed may be from nominal.

    Returns
    -------
    int
        Pulses a turn, at least 1.

    Raises
    ------
    RecordingError
        If the rate of the pulses fits no whole number of pulses a turn.
    """
    times = pulses.time_s
    # the mean rate: of uneven pulses no single interval tells it
    rate = (len(times) - 1) / float(times[-1] - times[0])
    count = max(1, round(rate / shaft_hz))
    if count * LIMITS.nominal > 0.25:
        raise RecordingError(
            f"tacho channel: about {rate / shaft_hz:.3g} pulses a turn at the nominal "
            f"{shaft_hz:.4g} Hz, too many to count while the speed may be "
            f"{LIMITS.nominal:.0%} off; give pulses_per_turn in a [[sensor]] of the machine file"
        )
    if abs(rate / shaft_hz / count - 1) > tolerance:
        raise RecordingError(
            f"tacho channel: {rate:.4g} pulses a second are {rate / shaft_hz:.3g} a turn at the "
            f"nominal {shaft_hz:.4g} Hz, not within {tolerance:.0%} of a whole number; give shaft "
            "and pulses_per_turn in a [[sensor]] of the machine file"
        )
    return count


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
        With the angle of the pulses if the lines are no more coherent in the other one, or if that
        departs from the pulses by more than their scatter allows: over any 25 pulses in the mean by
        more than half a sample and four standard deviations of the mean of so many.

    Notes
    -----
    The times of the pulses are smoothed over the angle, as stiffly as their likelihood wants under
    a random walk of the speed, and at least over the blocks that lines are judged in. The lines are
    locked from there on (`lock_track`). What the pulses then lie beside the angle is their scatter
    and a drift, of which the likelihood under a random walk tells whether it is
    there at all; without, the mean is taken: so the quantisation of n pulses goes down by sqrt(n).
    At a speed so steady that edges beat with the samples, quantisation is not white and would pass
    for a drift: none is looked for while the mean explains the pulses.
    """
    rate, jitter = sums.sampling_rate_hz, known.uncertainty_turns
    sample = float((turns[-1] - turns[0]) / (time_s[-1] - time_s[0])) / rate
    enough = len(turns) >= LIMITS.pulses and turns[-1] - turns[0] >= LIMITS.turns
    # an edge is somewhere between two samples
    scatter = max(jitter, sample / math.sqrt(12))
    if not enough or scatter * float(sums.orders.max()) < LIMITS.floor_cycles:
        return Joined(track=known)
    count = min(LIMITS.mean_of, len(turns) // 4)
    allowed = 0.5 * sample + LIMITS.mean_deviations * jitter / math.sqrt(count)

    def departure(beside: FloatArray) -> float:
        """By how much means of pulses lie beside an angle, over what they may."""
        means = np.convolve(beside, np.full(count, 1.0 / count), "valid")
        return float(np.max(np.abs(means)) / allowed)

    a_turn = (len(turns) - 1) / float(turns[-1] - turns[0])
    course = _smoothed(turns, time_s, 2, _STIFF * a_turn**4)
    if np.any(np.diff(course) <= 0):
        return Joined(track=known)
    try:
        track = lock_track(sums, track_through(course, turns, float(known.time_s[-1])))
    except ArgumentError:  # lines that would turn the shaft back
        return Joined(track=known)
    beside = turns - track.turns_at(time_s)
    drift = np.full(len(beside), beside.mean())
    beats = jitter < sample and _beats(rate * course, max(1, round(a_turn)))
    if not beats or departure(beside - drift) > 1.0:
        drift = _smoothed(turns, beside, 1)
    moved = track.turns + np.interp(track.turns, turns - beside, drift)
    if not np.isfinite(track.uncertainty_turns) or np.any(np.diff(moved) <= 0):
        return Joined(track=known)
    doubt = min(track.uncertainty_turns, jitter)
    joined = replace(track, turns=moved, uncertainty_turns=doubt, indexed=known.indexed)
    if _coherence(sums, joined) <= _coherence(sums, known):
        return Joined(track=known)
    beyond = departure(turns - joined.turns_at(time_s))
    if beyond > 1.0:
        return Joined(track=known, beyond=beyond)
    return Joined(track=joined, used=True, beyond=beyond)


def _beats(place: FloatArray, lag: int) -> bool:
    """Whether edges fall at the same place between two samples turn after turn."""
    steps = place[lag:] - place[:-lag]
    return bool(abs(np.mean(np.exp(2j * np.pi * steps))) > LIMITS.beats)


def _coherence(sums: OrderSums, track: AngleTrack) -> float:
    """Mean over the lines of the share of their power that is phase-coherent, noise included."""
    amplitude = sums.sliding(track, _JUDGED_TURNS).amplitude
    power = np.maximum(np.mean(np.abs(amplitude) ** 2, axis=0), np.finfo(float).tiny)
    return float(np.mean(np.abs(amplitude.mean(axis=0)) ** 2 / power))


def _smoothed(x: FloatArray, y: FloatArray, order: int, least: float = 0.0) -> FloatArray:
    """Smooth values as stiffly as their likelihood wants, and at least as stiffly as `least`.

    The curve f minimises sum (y - f)^2 + stiffness * sum (difference quotient of f)^2, its steps in
    units of their mean: white scatter about a random walk (order 1) or a summed one (order 2). The
    polynomial that no stiffness bends is what others must outdo in likelihood.
    """
    from scipy.linalg import cho_solve_banded, cholesky_banded

    rough = roughness(x, order)
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
    believed = likeliest[0] + LIMITS.drift < found[-1][0]
    return np.asarray(plain + likeliest[1] if believed else plain)
