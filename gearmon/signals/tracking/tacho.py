"""Pulses of a tachometer, and the angle of its shaft: by them alone or with phases of order lines.

A train of pulses is followed from where it repeats best, forwards and backwards: each is expected
where the last turns put it. What fits is kept, what is missing is filled in, what is left over is
left out. Where repairs crowd, or the train is not even after its repair, nothing is decided: the
caller refuses. Painted stripes, bolt heads and zebra tapes with a joint give several pulses a turn,
unevenly spaced, whose intervals repeat from turn to turn. What repeats tells a missing or an extra
pulse from an uneven one; the spacing is learned.

Pulses count the turns and tell where angle zero is, but each comes as late as the sampling and the
mark let it: half a sample is 0.03 mesh periods of a gear of 30 teeth at 25 Hz and 12 kHz. The lines
tell the angle between the pulses a hundred times finer, but only up to an offset, and to a slow
drift that the path gives them as the speed changes. The angle sought is that of the lines, put
where the pulses are in the mean; what the pulses say of the drift beyond their scatter is kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.ndimage import maximum_filter1d, median_filter

from gearmon.arrays import FloatArray, IntArray
from gearmon.errors import RecordingError, check_positive
from gearmon.signals.angle import AngleTrack, phasors
from gearmon.signals.orders.lines import OrderSums
from gearmon.signals.tracking.phases import FLOOR_CYCLES, lock_track, roughness

# Thresholds divide what `test_pulse_repair` and `test_uneven_pulses` (trains with pulses taken out,
# put in and moved, at changing speeds) and `test_tacho_phases` (edges that jitter or are quantised)
# hold apart.
# Fewest pulses that are believed, and the share of them that may be repaired.
_FEWEST_PULSES, _REPAIRABLE = 4, 0.02
# Part of the distance between the extremes that a waveform must pass the threshold by.
_HYSTERESIS = 0.1
# How far a nominal speed may be off, and the rate of pulses from a whole number of them a turn.
_NOMINAL_OFF, _NOT_WHOLE = 0.03, 0.05
# Stretches whose rates tell between which speeds a shaft runs, and the fewest pulses in each.
_STRETCHES, _STRETCH = 16, 32

# Intervals over the typical one below which a pulse is extra, and from which on some are missing;
# intervals on either side whose median tells what is typical.
_SHORT, _LONG, _NEIGHBOURS = 0.6, 1.5, 7
# How far off the cubic through its neighbours a pulse may be: smaller intervals beside it, and
# robust deviations.
_OFF, _DEVIATIONS = 0.08, 8.0
# How far from its place a pulse may come, as a share of the smaller interval beside it, and how far
# the shares of a turn may differ for pulses to be called even.
_EARLY_OR_LATE, _EVEN = 0.35, 0.05

# How often a train is followed, at last without a pulse that is off.
_ROUNDS = 8
# Repairs within so many intervals, more than which are too many.
_CROWD, _WITHIN = 4, 8
# Fewer pulses have no neighbours on both sides to be judged by.
_FEWEST_JUDGED = 5
# Turns from which the spacing is first learned.
_FIRST_TURNS = 6


@dataclass(frozen=True, kw_only=True)
class TachoPulses:
    """Times of the pulses of a tachometer.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Edges [s], ascending, missing ones filled in, extra ones left out.
    missing, extra : int
        Pulses that were filled in and left out.

    Raises
    ------
    RecordingError
        If these are no times of pulses: fewer than four, not finite, or they do not ascend (a
        waveform, perhaps).
    """

    time_s: FloatArray
    missing: int = 0
    extra: int = 0

    def __post_init__(self) -> None:
        """Check the times."""
        times = self.time_s
        if times.ndim != 1 or len(times) < _FEWEST_PULSES:
            raise RecordingError(
                f"pulse times: an array of shape {times.shape}; a row of at least "
                f"{_FEWEST_PULSES} times is needed"
            )
        if len(odd := np.flatnonzero(~np.isfinite(times))):
            raise RecordingError(f"pulse times: pulse {odd[0] + 1} has no finite time")
        if len(falls := np.flatnonzero(np.diff(times) <= 0)):
            first = falls[0]
            raise RecordingError(
                f"pulse times: pulse {first + 2} at {times[first + 1]:g} s does not come after "
                f"pulse {first + 1} at {times[first]:g} s, nor do {len(falls) - 1} others after "
                "theirs; if this is the waveform of a tachometer, give it to find_pulses with its "
                "sampling rate"
            )


def find_pulses(
    waveform: FloatArray, sampling_rate_hz: float, per_turn: int | None = None
) -> TachoPulses:
    """Find the rising edges of a tachometer waveform.

    The threshold is half way between the extremes; the waveform must pass it by a tenth of their
    distance, on either side, before a next edge counts. Edges are interpolated between samples.
    Missing pulses are filled in and extra ones left out; of several pulses a turn the spacing is
    learned first, so that uneven ones are left alone.

    Parameters
    ----------
    waveform : ndarray of float, shape (n,)
        The channel, any unit.
    sampling_rate_hz : float
        Sampling rate [Hz].
    per_turn : int, optional
        Pulses a turn, if known.

    Returns
    -------
    TachoPulses

    Raises
    ------
    RecordingError
        If there are fewer than four pulses, or more than 2 % have to be repaired.
    """
    low, high = float(np.min(waveform)), float(np.max(waveform))
    middle, margin = 0.5 * (low + high), _HYSTERESIS * (high - low)
    state = np.zeros(len(waveform), dtype=np.int8)
    state[waveform > middle + margin] = 1
    state[waveform < middle - margin] = -1
    known = np.flatnonzero(state)
    rises = np.flatnonzero((state[known[1:]] == 1) & (state[known[:-1]] == -1))
    # of each rise the first sample above the middle, and how far before it
    ups = np.flatnonzero((waveform[:-1] <= middle) & (waveform[1:] > middle))
    before = ups[np.searchsorted(ups, known[rises])]
    height = waveform[before]
    raw = (before + (middle - height) / (waveform[before + 1] - height)) / sampling_rate_hz
    if len(raw) < _FEWEST_PULSES:
        times = len(waveform) > _FEWEST_PULSES and bool(np.all(np.diff(waveform) > 0))
        rise = "; its values only rise, as times of pulses do: give those to track_from_pulse_times"
        hint = rise if times else ""
        raise RecordingError(
            f"tacho channel: {len(raw)} pulses found between {low:g} and {high:g}; at least 4 are "
            f"needed. Name the right channel with --tacho, or leave the tacho out{hint}"
        )
    return repair(raw, per_turn)


def repair(time_s: ArrayLike, per_turn: int | None = None) -> TachoPulses:
    """Fill in missing pulses and leave out extra ones, up to 2 %.

    Parameters
    ----------
    time_s : array_like of float, shape (pulses,)
        Times of the pulses as they were found, or measured by a counter board [s], ascending; at
        least four.
    per_turn : int, optional
        Pulses a turn, if known: where they are not even their spacing is learned.

    Returns
    -------
    TachoPulses
        Pulses that are sound keep their times; one at a wrong time counts as missing and extra.

    Raises
    ------
    RecordingError
        As `TachoPulses`; or if more than 2 % have to be repaired, or it is unclear how.

    Notes
    -----
    The spacing is first learned from the few consecutive turns whose intervals repeat best; each
    next pulse is then expected where the duration of the last turns puts it. One that comes within
    0.35 of the smaller interval beside its place is taken for it. What is filled in stands on the
    cubic through its neighbours. What departs from that by 0.08 of the smaller interval and eight
    robust standard deviations, or at an end from the parabola of the next three, is left out and
    the train followed again, until nothing does. Where more than four repairs come within eight
    intervals, or pulses are still off, it is unclear what is right.
    """
    found = TachoPulses(time_s=np.asarray(time_s, dtype=np.float64))
    times = found.time_s
    per_turn = 1 if per_turn is None or is_even(times, per_turn) else per_turn
    if len(times) < 3 * per_turn + 1 or (per_turn == 1 and _sound(times)):
        return found
    whole = _followed(times, per_turn)
    if per_turn > 1 and np.array_equal(whole, times):
        return found
    # where repairs crowd, counted in pulses
    repaired_s = np.setxor1d(whole, times)
    number = np.searchsorted(whole, repaired_s, "right")
    unclear_s = repaired_s[_CROWD:][number[_CROWD:] - number[:-_CROWD] <= _WITHIN]
    kept = times
    for _ in range(_ROUNDS):
        filled = np.isin(whole, kept, invert=True)
        whole[filled] = _expected(whole, per_turn)[filled]
        rises = np.all(np.diff(whole) > 0)
        off_s = whole[_misplaced(whole, _expected(whole, per_turn)) if rises else filled]
        missing, extra = len(np.setdiff1d(whole, times)), len(np.setdiff1d(times, whole))
        if missing + extra > max(2, _REPAIRABLE * len(whole)):
            raise RecordingError(
                f"tacho channel: {missing} pulses missing and {extra} too many among {len(whole)}; "
                "at most 2 % can be repaired. Check the sensor, or leave the tacho out"
            )
        # the pulse that belongs there may be another one: what is off is left out from now on
        kept = np.setdiff1d(kept, off_s)
        if not len(off_s) or len(kept) <= 3 * per_turn:
            break
        whole = _followed(kept, per_turn)
    unclear_s = np.append(unclear_s, off_s)
    if len(unclear_s):
        raise RecordingError(
            f"tacho channel: pulses about {unclear_s[0]:.4g} s come at times that fit no steady "
            "or slowly changing speed, and it is unclear which are missing or too many. Check the "
            "sensor, or leave the tacho out"
        )
    return TachoPulses(time_s=whole, missing=missing, extra=extra)


def _sound(time_s: FloatArray) -> bool:
    """Whether no interval and no place of an even train is out of the ordinary."""
    interval = np.diff(time_s)
    half = min(2 * _NEIGHBOURS + 1, len(interval)) // 2
    ratio = interval / median_filter(interval, 2 * half + 1, mode="mirror")
    usual = bool(np.all((ratio > _SHORT) & (ratio < _LONG)))
    return usual and not len(_misplaced(time_s, _expected(time_s, 1)))


def _repeating(time_s: FloatArray, per_turn: int) -> tuple[int, FloatArray]:
    """Where intervals repeat best from turn to turn, and the shares of a turn that they take."""
    # of a short train not all turns need be sound
    turns = int(np.clip((len(time_s) - 1) // per_turn // 3, 3, _FIRST_TURNS))
    interval = np.diff(time_s)
    change = np.abs(np.log(interval[per_turn:] / interval[:-per_turn]))
    width = (turns - 1) * per_turn
    total = np.convolve(change, np.ones(width), "valid")
    start = int(np.argmin(total))
    chosen = interval[start : start + turns * per_turn].reshape(turns, per_turn)
    shares = np.median(chosen / chosen.sum(axis=1, keepdims=True), axis=0)
    return start, shares / shares.sum()


def _followed(time_s: FloatArray, per_turn: int) -> FloatArray:
    """Follow a train forwards from the turns that repeat best, and backwards from their end."""
    start, gaps = _repeating(time_s, per_turn)
    both = start + 3 * per_turn + 1
    behind = -_walk(-time_s[:both][::-1], gaps[::-1])[::-1]
    return np.append(behind[: start - both], _walk(time_s[start:], gaps))


def _walk(time_s: FloatArray, gaps: FloatArray) -> FloatArray:
    """Follow a train whose first three turns are sound; pulse 0 is followed by the first gap.

    Returns the times of its pulses; a missing one has that at which it is expected.
    """
    times, shares, per_turn = time_s.tolist(), gaps.tolist(), len(gaps)
    index = 3 * per_turn + 1
    found = times[:index]
    # a train that is mostly filled in is refused however it goes on
    while index < len(times) and len(found) < 2 * len(times):
        step = (len(found) - 1) % per_turn
        # the middle of three: one pulse at a wrong time does not count
        turn = sorted(found[-k] - found[-k - per_turn] for k in (1, 2, 3))[1]
        reach = _EARLY_OR_LATE * turn * min(shares[step], shares[(step + 1) % per_turn])
        place = found[-1] + shares[step] * turn
        # those before the nearest one are too many
        while index + 1 < len(times) and abs(times[index + 1] - place) < abs(times[index] - place):
            index += 1
        late = times[index] - place
        if abs(late) <= reach:
            found.append(times[index])
        elif late > 0:
            found.append(place)
        index += late <= reach
    return np.array(found)


def _expected(time_s: FloatArray, per_turn: int) -> FloatArray:
    """Where the two pulses before and the two after want each; the outermost the next three."""
    number, angle = np.arange(len(time_s)), _turns(time_s, per_turn)
    expected = time_s.copy()
    if len(time_s) < _FEWEST_JUDGED:
        return expected
    inner, first, last = number[2:-2], number[:2], number[-2:]
    for own, away in ((inner, (-2, -1, 1, 2)), (first, (1, 2, 3)), (last, (-1, -2, -3))):
        near = [own + k for k in away]
        expected[own] = _curve_at(angle[own], [angle[k] for k in near], [time_s[k] for k in near])
    return expected


def _misplaced(time_s: FloatArray, expected: FloatArray) -> IntArray:
    """Return the pulses farthest off where they are expected, those at the ends last."""
    interval = np.diff(time_s)
    beside = np.minimum(np.append(interval, np.inf), np.insert(interval, 0, np.inf))
    off = np.abs(time_s - expected) / beside
    spread = float(np.median(off[2:-2])) / 0.6745 if len(off) > _FEWEST_JUDGED else 0.0
    limit = min(max(_OFF, _DEVIATIONS * spread), _EARLY_OR_LATE)
    # a pulse that is off makes its neighbours appear so
    inner = off[2:-2]
    wrong = 2 + np.flatnonzero((inner > limit) & (inner == maximum_filter1d(inner, 5)))
    if len(wrong):
        return wrong
    # the parabola beyond an end errs three times as much as the cubic between neighbours
    far = max(_OFF, 3 * _DEVIATIONS * spread)
    ends = (1, len(off) - 2, 0, len(off) - 1)
    return np.array([end for end in ends if off[end] > far][:1], dtype=np.int64)


def is_even(time_s: FloatArray, per_turn: int) -> bool:
    """Tell whether the intervals of a turn are alike, judged where they repeat best.

    Of fewer than three turns it is asked whether most intervals are like the next one.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Times of the pulses [s], ascending.
    per_turn : int
        Pulses a turn.
    """
    if len(time_s) < 3 * per_turn + 1:
        # too few turns to see intervals repeat
        return bool(np.median(np.abs(np.diff(np.log(np.diff(time_s))))) < 2 * _EVEN)
    _, shares = _repeating(time_s, per_turn)
    return bool(np.max(np.abs(shares * per_turn - 1)) < _EVEN)


def learn_spacing(time_s: FloatArray, per_turn: int) -> FloatArray:
    """Learn at which angles of its turn the pulses of a sequence come.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Times of the pulses [s], complete and ascending.
    per_turn : int
        Pulses a turn.

    Returns
    -------
    ndarray of float, shape (per_turn,)
        Angles of the first `per_turn` pulses [turns], 0 for the first; ascending, below 1.

    Notes
    -----
    Pulses a turn apart are exactly a turn apart, whatever the spacing: the cubic through the first
    pulse of four turns gives the angle at the times of the others; the median over all turns is
    taken. A speed that pulsates once a turn is taken for spacing: no tachometer can tell them
    apart.
    """
    turns = len(time_s) // per_turn
    table = time_s[: turns * per_turn].reshape(turns, per_turn)
    # the angles -1, 0, 1, 2 of the same pulse; of few turns a straight line from 0 to 1 does
    near = range(-1, 3) if turns >= 4 else range(2)
    chosen = np.arange(-near[0], turns - near[-1])
    nodes = [table[chosen + k, :1] for k in near]
    return np.asarray(np.median(_curve_at(table[chosen], nodes, near), axis=0))


def _turns(time_s: FloatArray, per_turn: int) -> FloatArray:
    """Angles of the pulses [turns], as their spacing is learned."""
    number = np.arange(len(time_s))
    return number // per_turn + learn_spacing(time_s, per_turn)[number % per_turn]


def _curve_at(
    x: FloatArray, nodes: Sequence[FloatArray], values: Sequence[FloatArray | float]
) -> FloatArray:
    """Return Lagrange's polynomial through the values at some nodes."""
    curve = np.zeros(x.shape)
    for own, value in zip(nodes, values, strict=True):
        others = [(x - other) / (own - other) for other in nodes if other is not own]
        curve += math.prod(others, start=value)
    return curve


# Pulses and lines together: the fewest pulses and turns, below which no mean of a line stands for
# anything.
_JOINED_PULSES, _JOINED_TURNS = 16, 16.0
# Twice the log likelihood that a drift of the lines must gain to be believed: chance gains as much
# in one recording of a thousand, half of chi square of one degree of freedom.
_DRIFT = 10.0
# Coherence of the fractions of a sample by which edges advance a turn, from which on quantisation
# beats with the rotation and passes for a drift; of white ones 200 turns give 0.07.
_BEATING = 0.25
# Pulses over which the angle must keep to their mean, and standard deviations of that mean.
_MEAN_OF, _MEAN_DEVIATIONS = 25, 4.0
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
        As `repair` and `track_from_pulses`.
    """
    return track_from_pulses(repair(time_s, per_turn), per_turn, shaft_order, duration_s)


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
        Angle zero at the first pulse; knots at the pulses, of an encoder's many at the means of
        neighbours. Its uncertainty is the jitter of single pulses: by how much they come off what
        an even change of speed lets their neighbours expect.

    Raises
    ------
    RecordingError
        If there are fewer than three turns, or the pulses begin late or end early.
    """
    check_positive("pulses_per_turn", pulses_per_turn)
    check_positive("shaft_order", shaft_order)
    count, time_s = int(pulses_per_turn), pulses.time_s
    whole = (len(time_s) - 1) // count + 1
    if whole < 3:
        raise RecordingError(f"tacho channel: {whole} turns recorded, at least 3 are needed")
    # of the rest of the recording nobody knows the speed
    before = time_s[0] / (time_s[count] - time_s[0])
    after = (duration_s - time_s[-1]) / (time_s[-1] - time_s[-1 - count])
    missing = int(count * before) + int(count * after)
    if missing > max(2, _REPAIRABLE * len(time_s)):
        raise RecordingError(
            f"tacho channel: pulses from {time_s[0]:.4g} to {time_s[-1]:.4g} s of {duration_s:.4g} "
            f"s only, {missing} are missing beside them; at most 2 % can be. Check the sensor, cut "
            "the recording, or leave the tacho out"
        )
    turns = _turns(time_s, count) / shaft_order
    slope = float((turns[-1] - turns[0]) / (time_s[-1] - time_s[0]))
    # less jitter of an encoder, and fewer knots
    together = max(1, count // _KNOTS_PER_TURN)
    cut = len(time_s) // together * together
    knots_s, angle = (own[:cut].reshape(-1, together).mean(axis=1) for own in (time_s, turns))
    # of several pulses a turn nobody knows which one came first
    indexed, doubt = count == 1 and shaft_order == 1.0, _jitter(time_s, turns) * slope
    track = track_through(knots_s, angle, duration_s)
    return replace(track, indexed=indexed, uncertainty_turns=doubt)


def track_through(time_s: FloatArray, turns: FloatArray, duration_s: float) -> AngleTrack:
    """Return the track through known angles, continued straight to the ends of a recording.

    Parameters
    ----------
    time_s, turns : ndarray of float, shape (knots,)
        Times [s] and angles [turns], ascending.
    duration_s : float
        Where the recording ends [s].
    """
    from scipy.interpolate import make_interp_spline

    inside = time_s[(time_s > 0) & (time_s < duration_s)]
    knots = np.concatenate([[0.0], inside, [duration_s]])
    angle = make_interp_spline(time_s, turns, k=1)(knots)
    return AngleTrack(time_s=knots, turns=angle, method="tacho", uncertainty_turns=float("nan"))


def _jitter(time_s: FloatArray, turns: FloatArray) -> float:
    """Return the standard deviation of a pulse's time about its neighbours' parabola [s].

    A shaft that speeds up evenly has none: divided differences of third order are left.
    """
    points = min(4, len(turns))
    x, t = (sliding_window_view(own, points) for own in (turns, time_s))
    weights = 1 / np.prod(x[:, :, None] - x[:, None, :] + np.eye(points), axis=2)
    return float(np.std((weights * t).sum(axis=1) / np.linalg.norm(weights, axis=1)))


def pulses_per_turn(
    pulses: TachoPulses, shaft_hz: float, off: float = _NOMINAL_OFF
) -> tuple[int, ...]:
    """Tell how many pulses a turn a tachometer may give, from a speed that the shaft runs at.

    Parameters
    ----------
    pulses : TachoPulses
        The pulses.
    shaft_hz : float
        Rotation frequency of the shaft at some time of the recording: nominal [Hz].
    off : float
        Share by which the speed may differ from it.

    Returns
    -------
    tuple of int
        Pulses a turn with which the speed, as it changes, comes within 5 % of that one: at least
        one number, one alone while the speed is steady.

    Raises
    ------
    RecordingError
        If the rate of the pulses fits no whole number of pulses a turn.
    """
    times = pulses.time_s
    # over stretches: of uneven pulses no single interval tells the rate
    stretches = int(np.clip(len(times) // _STRETCH, 1, _STRETCHES))
    passed = np.interp(
        np.linspace(times[0], times[-1], stretches + 1), times, np.arange(len(times))
    )
    rates = np.diff(passed) * stretches / float(times[-1] - times[0])
    slowest, fastest = rates.min() / shaft_hz, rates.max() / shaft_hz
    most = max(1, round(fastest))
    if most * off > 0.25:
        raise RecordingError(
            f"tacho channel: about {fastest:.3g} pulses a turn at the nominal "
            f"{shaft_hz:.4g} Hz, too many to count while the speed may be "
            f"{100 * off:g}% off; give pulses_per_turn in a [[sensor]] of the machine file"
        )
    least = max(1, math.ceil(slowest / (1 + _NOT_WHOLE)))
    counts = range(least, math.floor(fastest / (1 - _NOT_WHOLE)) + 1)
    if not counts:
        mean = len(times[1:]) / float(times[-1] - times[0])
        raise RecordingError(
            f"tacho channel: {mean:.4g} pulses a second are {mean / shaft_hz:.3g} a turn at the "
            f"nominal {shaft_hz:.4g} Hz, not within {_NOT_WHOLE:.0%} of a whole number; give shaft "
            "and pulses_per_turn in a [[sensor]] of the machine file"
        )
    return tuple(counts)


def join(sums: OrderSums, known: AngleTrack) -> tuple[AngleTrack, float]:
    """Refine the angle of a tachometer by the phases of order lines.

    Parameters
    ----------
    sums : OrderSums
        Mesh lines of the recording.
    known : AngleTrack
        The angle from the pulses alone, as `track_from_pulses` makes it: its knots within the
        recording are the pulses.

    Returns
    -------
    track : AngleTrack
        The angle from pulses and lines together; that of the pulses if the lines are no more
        coherent in the other one, or if that departs from the pulses by more than their scatter
        allows: over any 25 pulses in the mean by more than half a sample and four standard
        deviations of the mean of so many.
    beyond : float
        By how much the lines would move the angle, over what the scatter of the pulses allows;
        lines that would move it by more than 1 are not believed.

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
    time_s, turns = known.time_s[1:-1], known.turns[1:-1]
    sample = float((turns[-1] - turns[0]) / (time_s[-1] - time_s[0])) / rate
    enough = len(turns) >= _JOINED_PULSES and turns[-1] - turns[0] >= _JOINED_TURNS
    # an edge is somewhere between two samples
    scatter = max(jitter, sample / math.sqrt(12))
    if not enough or scatter * float(sums.orders.max()) < FLOOR_CYCLES:
        return known, 0.0
    count = min(_MEAN_OF, len(turns) // 4)
    allowed = 0.5 * sample + _MEAN_DEVIATIONS * jitter / math.sqrt(count)

    def departure(beside: FloatArray) -> float:
        """By how much means of pulses lie beside an angle, over what they may."""
        means = np.convolve(beside, np.full(count, 1.0 / count), "valid")
        return float(np.max(np.abs(means)) / allowed)

    a_turn = (len(turns) - 1) / float(turns[-1] - turns[0])
    course = _smoothed(turns, time_s, 2, _STIFF * a_turn**4)
    with suppress(ValueError):  # the shaft would turn back
        track, _ = lock_track(sums, track_through(course, turns, float(known.time_s[-1])))
        beside = turns - track.turns_at(time_s)
        drift = np.full(len(beside), beside.mean())
        # whether edges fall at the same place between two samples turn after turn
        place, lag = rate * course, max(1, round(a_turn))
        alike = abs(phasors(place[lag:] - place[:-lag]).mean())
        beats = jitter < sample and alike > _BEATING
        if not beats or departure(beside - drift) > 1.0:
            drift = _smoothed(turns, beside, 1)
        moved = track.turns + np.interp(track.turns, turns - beside, drift)
        doubt = min(track.uncertainty_turns, jitter)
        joined = replace(track, turns=moved, uncertainty_turns=doubt, indexed=known.indexed)
        clear = np.isfinite(track.uncertainty_turns)
        if clear and _coherence(sums, joined) > _coherence(sums, known):
            beyond = departure(turns - joined.turns_at(time_s))
            return (joined if beyond <= 1.0 else known), beyond
    return known, 0.0


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
    return np.asarray(plain + likeliest[1] if likeliest[0] + _DRIFT < found[-1][0] else plain)
