"""Pulses of a tachometer: found in its waveform, missing ones filled in, extra ones left out.

Even pulses: those that the spacing of their neighbours does not explain form stretches between
sound ones. The sound pulses on either side of a stretch tell where its pulses belong: those that
are there are kept, the others filled in, what is left over is left out. Where no whole number of
intervals fits, or the train is not even after its repair, nothing is decided: the caller refuses.
Stretches are few and short, so that the work grows with the number of pulses alone.

Several pulses a turn that are not evenly spaced: painted stripes, bolt heads and zebra tapes with a
joint give pulses whose intervals repeat from turn to turn. What repeats tells a missing or an extra
pulse from an uneven one; the spacing is learned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from gearmon.errors import RecordingError, check_range
from gearmon.signals.array_types import BoolArray, FloatArray, IntArray
from gearmon.signals.tracking.thresholds import LIMITS

# Intervals on either side whose median tells what is typical.
_NEIGHBOURS = 7
# Sound intervals beside a stretch whose median counts, and sound pulses that are continued.
_BESIDE, _CONTINUED = 5, 8
# Repairs one after the other, the last of which must find nothing.
_ROUNDS = 4
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
        If these are no times of pulses: they do not ascend (a waveform, perhaps), or are not
        finite.
    """

    time_s: FloatArray
    missing: int = 0
    extra: int = 0

    def __post_init__(self) -> None:
        """Check the times."""
        times = self.time_s
        if times.ndim != 1:
            raise RecordingError(
                f"pulse times: an array of shape {times.shape}; a row of times is needed"
            )
        if not np.all(np.isfinite(times)):
            place = int(np.argmin(np.isfinite(times)))
            raise RecordingError(f"pulse times: pulse {place + 1} has no finite time")
        falls = np.flatnonzero(np.diff(times) <= 0)
        if len(falls):
            first = int(falls[0])
            raise RecordingError(
                f"pulse times: pulse {first + 2} at {times[first + 1]:g} s does not come after "
                f"pulse {first + 1} at {times[first]:g} s, nor do {len(falls) - 1} others after "
                "theirs; if this is the waveform of a tachometer, give it to find_pulses with its "
                "sampling rate"
            )


def find_pulses(
    waveform: FloatArray,
    sampling_rate_hz: float,
    per_turn: int | None = None,
    hysteresis: float = 0.1,
) -> TachoPulses:
    """Find the rising edges of a tachometer waveform.

    The threshold is half way between the extremes, with a hysteresis on either side; edges are
    interpolated between samples. Missing pulses are filled in and extra ones left out; of several
    pulses a turn the spacing is learned first, so that uneven ones are left alone.

    Parameters
    ----------
    waveform : ndarray of float, shape (n,)
        The channel, any unit.
    sampling_rate_hz : float
        Sampling rate [Hz].
    per_turn : int, optional
        Pulses a turn, if known.
    hysteresis : float
        Part of the distance between the extremes that the waveform must pass the threshold by,
        on either side, before a next edge counts; in [0.001, 0.45].

    Returns
    -------
    TachoPulses

    Raises
    ------
    RecordingError
        If there are fewer than four pulses, or more than 2 % have to be repaired.
    ArgumentError
        If the hysteresis is out of its range.
    """
    check_range("hysteresis", hysteresis, 1e-3, 0.45)
    low, high = float(np.min(waveform)), float(np.max(waveform))
    raw = _edges(waveform, 0.5 * (low + high), hysteresis * (high - low)) / sampling_rate_hz
    if len(raw) < LIMITS.fewest_pulses:
        times = len(waveform) > LIMITS.fewest_pulses and bool(np.all(np.diff(waveform) > 0))
        rise = "; its values only rise, as times of pulses do: give those to track_from_pulse_times"
        hint = rise if times else ""
        raise RecordingError(
            f"tacho channel: {len(raw)} pulses found between {low:g} and {high:g}; at least 4 are "
            f"needed. Name the right channel with --tacho, or leave the tacho out{hint}"
        )
    return _repaired_pulses(raw, per_turn)


def _edges(waveform: FloatArray, middle: float, margin: float) -> FloatArray:
    """Fractional samples at which the waveform rises through the middle, with hysteresis."""
    state = np.zeros(len(waveform), dtype=np.int8)
    state[waveform > middle + margin] = 1
    state[waveform < middle - margin] = -1
    known = np.flatnonzero(state)
    rises = np.flatnonzero((state[known[1:]] == 1) & (state[known[:-1]] == -1))
    # of each rise the first sample above the middle, and how far before it
    ups = np.flatnonzero((waveform[:-1] <= middle) & (waveform[1:] > middle))
    before = ups[np.searchsorted(ups, known[rises])]
    height = waveform[before]
    return np.asarray(before + (middle - height) / (waveform[before + 1] - height))


def _repaired_pulses(raw: FloatArray, per_turn: int | None) -> TachoPulses:
    """Fill in and leave out pulses up to the limit, refuse beyond it.

    Parameters
    ----------
    raw : ndarray of float, shape (pulses,)
        Times as they were found [s], ascending.
    per_turn : int, optional
        Pulses a turn, if known: the spacing of several is learned.

    Raises
    ------
    RecordingError
        If more than 2 % have to be repaired, or it is unclear how.
    """
    if per_turn is None or is_even(raw, per_turn):
        found = repair_even(raw)
    else:
        found = repair_uneven(raw, per_turn)
    if found.missing + found.extra > max(2, LIMITS.repairable * len(found.time_s)):
        raise RecordingError(
            f"tacho channel: {found.missing} pulses missing and {found.extra} too many among "
            f"{len(found.time_s)}; at most 2 % can be repaired. Check the sensor, or leave the "
            "tacho out"
        )
    if found.unclear_s is not None:
        raise RecordingError(
            f"tacho channel: pulses about {found.unclear_s:.4g} s come at times that fit no steady "
            "or slowly changing speed, and it is unclear which are missing or too many. Check the "
            "sensor, or leave the tacho out"
        )
    return TachoPulses(time_s=found.time_s, missing=found.missing, extra=found.extra)


def pulses_from_times(time_s: ArrayLike, per_turn: int | None = None) -> TachoPulses:
    """Take pulses whose times were measured already, as a counter board gives them.

    Parameters
    ----------
    time_s : array_like of float, shape (pulses,)
        Times of the pulses [s], ascending.
    per_turn : int, optional
        Pulses a turn, if known.

    Returns
    -------
    TachoPulses
        Repaired as those of a waveform.

    Raises
    ------
    RecordingError
        If these are no times of pulses (they do not ascend: a waveform, perhaps), there are fewer
        than four, or more than 2 % have to be repaired.
    """
    times = np.asarray(time_s, dtype=np.float64)
    if times.ndim != 1 or len(times) < LIMITS.fewest_pulses:
        raise RecordingError(
            f"pulse times: an array of shape {times.shape}; a row of at least 4 times is needed"
        )
    return _repaired_pulses(TachoPulses(time_s=times).time_s, per_turn)


@dataclass(frozen=True, kw_only=True)
class Repaired:
    """A train of pulses after its repair.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Times of the pulses [s], ascending.
    missing, extra : int
        Pulses that were filled in and left out; one at a wrong time counts as both.
    unclear_s : float, optional
        Time [s] near which it cannot be told which pulses are missing or extra.
    """

    time_s: FloatArray
    missing: int = 0
    extra: int = 0
    unclear_s: float | None = None


def repair_even(time_s: FloatArray) -> Repaired:
    """Fill in missing pulses and leave out extra ones of an even sequence.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Times of the pulses [s], ascending; at least four.

    Returns
    -------
    Repaired
        Pulses that are sound keep their times. Nothing is repaired where it is unclear how.

    Notes
    -----
    A pulse is doubtful if an interval beside it is below 0.6 or from 1.5 on of the median of its 15
    neighbours, or if it departs from (4 t[-1] + 4 t[1] - t[-2] - t[2]) / 6, the cubic through its
    neighbours, by 0.08 of an interval and eight robust standard deviations. Between two sound
    pulses the train has as many intervals as the mean of the rates on both sides gives; a cubic
    with these rates at its ends tells their places. Before the first sound pulse and after the last
    one the angle goes on as a parabola through the next eight. Where no whole number of intervals
    fits within a quarter, or the speed changes by a factor of 1.3 over a stretch, it is unclear
    what is right.
    """
    found = Repaired(time_s=time_s)
    # a repair lets the cubics judge the pulses about it: what they find is repaired in turn
    for _ in range(_ROUNDS):
        interval = np.diff(found.time_s)
        typical = _typical(interval)
        doubtful, off = _doubtful(found.time_s, interval, typical)
        if not doubtful.any() or found.unclear_s is not None:
            return found
        if doubtful.mean() > LIMITS.hopeless or doubtful.all():
            return _counted(time_s, np.diff(time_s) / _typical(np.diff(time_s)))
        more = _Repair(found.time_s, typical, doubtful, min(off, LIMITS.near)).done()
        found = replace(more, missing=found.missing + more.missing, extra=found.extra + more.extra)
    return replace(found, unclear_s=float(found.time_s[int(np.argmax(doubtful))]))


def _typical(interval: FloatArray) -> FloatArray:
    """Median interval among each one's neighbours: the speed may change along the recording."""
    from scipy.ndimage import median_filter

    half = min(2 * _NEIGHBOURS + 1, len(interval)) // 2
    return np.asarray(median_filter(interval, 2 * half + 1, mode="mirror"))


def _doubtful(
    time_s: FloatArray, interval: FloatArray, typical: FloatArray
) -> tuple[BoolArray, float]:
    """Return which pulses are in doubt, and how far off their place the others may be [1]."""
    ratio = interval / typical
    wrong = (ratio < LIMITS.short) | (ratio >= LIMITS.long)
    doubtful = np.zeros(len(time_s), dtype=np.bool_)
    doubtful[:-1] |= wrong
    doubtful[1:] |= wrong
    # how far each pulse is off the cubic through its neighbours, two at either end left out
    near = 4 * (time_s[1:-3] + time_s[3:-1])
    inner = np.abs(time_s[2:-2] - (near - time_s[:-4] - time_s[4:]) / 6) / typical[2:][: len(near)]
    # where an interval is wrong already, it alone makes the pulses about it depart
    about = np.convolve(wrong, np.ones(4))[3:-3] > 0 if len(time_s) > 4 else wrong[:0]
    spread = float(np.median(inner[~about])) / 0.6745 if not about.all() else 0.0
    off = max(LIMITS.off, LIMITS.deviations * spread)
    doubtful[2:-2] |= (inner > off) & ~about
    # the parabola beyond an end errs three times as much as the cubic between neighbours
    far = max(LIMITS.off, 3 * LIMITS.deviations * spread)
    for way in (1, -1):
        last = _beyond(time_s[::way], typical[::way], wrong[::way], far)
        doubtful[::way][: last + 1] = True
    # sound pulses that stand alone are doubted as well: nothing beside them tells the speed
    padded = np.concatenate([[True], doubtful, [True]])
    return np.asarray(doubtful | (padded[:-2] & padded[2:])), off


def _beyond(time_s: FloatArray, typical: FloatArray, wrong: BoolArray, far: float) -> int:
    """Return which of the first two pulses is off the parabola of the next three; -1 if none."""
    for first in (1, 0):
        part = time_s[first : first + 4]
        if len(part) == 4 and not wrong[first : first + 3].any():
            off = abs(part[0] - 3 * part[1] + 3 * part[2] - part[3])
            if off > far * typical[first]:
                return first
    return -1


def _counted(time_s: FloatArray, ratio: FloatArray) -> Repaired:
    """Count what is wrong with a train that is far beyond repair."""
    steps = np.rint(ratio[ratio >= LIMITS.long])
    return Repaired(
        time_s=time_s,
        missing=int(np.sum(np.maximum(steps, 2) - 1)),
        extra=int(np.count_nonzero(ratio < LIMITS.short)),
        unclear_s=float(time_s[int(np.argmax(np.abs(np.log(ratio))))]),
    )


class _Repair:
    """The repair of one train, stretch by stretch."""

    def __init__(
        self, time_s: FloatArray, typical: FloatArray, doubtful: BoolArray, near: float
    ) -> None:
        self.time_s, self.typical, self.doubtful, self.near = time_s, typical, doubtful, near
        self.kept = np.ones(len(time_s), dtype=np.bool_)
        self.filled: list[float] = []
        self.unclear_s: float | None = None

    def done(self) -> Repaired:
        """Repair all stretches."""
        edges = np.flatnonzero(np.diff(self.doubtful, prepend=False, append=False))
        count = len(self.time_s)
        for start, stop in edges.reshape(-1, 2).tolist():
            if start == 0:
                self._end(np.arange(stop - 1, -1, -1), np.arange(stop, count))
            elif stop == count:
                self._end(np.arange(start, stop), np.arange(start - 1, -1, -1))
            else:
                self._between(start - 1, stop)
        return Repaired(
            time_s=np.sort(np.concatenate([self.time_s[self.kept], self.filled])),
            missing=len(self.filled),
            extra=int(np.count_nonzero(~self.kept)),
            unclear_s=self.unclear_s,
        )

    def _between(self, before: int, after: int) -> None:
        """Repair what lies between two sound pulses."""
        start, length = self.time_s[before], self.time_s[after] - self.time_s[before]
        first, last = self._beside(before, -1), self._beside(after, 1)
        fits = 0.5 * length * (1 / first + 1 / last)
        number = round(fits)
        steady = 1 / LIMITS.change < last / first < LIMITS.change
        if number < 1 or abs(fits - number) > LIMITS.near or not steady:
            self.unclear_s = float(start)
            return
        u = np.arange(1, number) / number
        # a cubic from sound pulse to sound pulse, with the intervals beside them as slopes
        place = u * u * (3 - 2 * u) * length
        place += number * u * (1 - u) * ((1 - u) * first - u * last)
        reach = self.near * (first + (last - first) * u)
        self._settle(np.arange(before + 1, after), start + place, reach)

    def _end(self, inner: IntArray, sound: IntArray) -> None:
        """Repair what lies beyond the first or the last sound pulse; both go away from it."""
        known = sound[:_CONTINUED]
        if self.doubtful[known].any():
            known = known[: int(np.argmax(self.doubtful[known]))]
        origin = self.time_s[known[0]]
        # time and number count outwards from the outermost sound pulse, in typical intervals
        step = self.typical[min(int(known[0]), len(self.typical) - 1)]
        step *= np.sign(self.time_s[inner[0]] - origin)
        at, past = (self.time_s[inner] - origin) / step, (self.time_s[known] - origin) / step
        degree = 2 if len(known) >= 4 else 1
        # through the last sound pulse exactly: of one alone the typical interval is all we know
        powers = past[1:, None] ** np.arange(1, degree + 1)
        number = -np.arange(1.0, len(known))
        course = np.linalg.lstsq(powers, number)[0] if len(known) > degree else np.ones(1)
        course = np.pad(course, (0, 2 - len(course)))
        fits = course[0] * at + course[1] * at**2
        met = fits[(np.abs(fits - np.rint(fits)) <= self.near) & (np.rint(fits) >= 1)]
        # beyond the outermost pulse that is where it belongs nothing is known to be missing
        wanted = np.arange(1.0, 1 + (np.rint(met.max()) if len(met) else 0))
        place = wanted / course[0]
        for _ in range(4):
            slope = np.maximum(course[0] + 2 * course[1] * place, 0.2)
            place -= (course[0] * place + course[1] * place**2 - wanted) / slope
        reach = np.full(len(place), self.near * abs(step))
        self._settle(inner, origin + place * step, reach)

    def _beside(self, pulse: int, way: int) -> float:
        """Median of the intervals on the sound side of a sound pulse [s]."""
        stop = pulse
        while 0 <= stop + way < len(self.time_s) and abs(stop - pulse) < _BESIDE:
            if self.doubtful[stop + way]:
                break
            stop += way
        times = self.time_s[min(stop, pulse) : max(stop, pulse) + 1].tolist()
        intervals = sorted(b - a for a, b in pairwise(times))
        return float(intervals[len(intervals) // 2])

    def _settle(self, inner: IntArray, place: FloatArray, reach: FloatArray) -> None:
        """Keep the pulse that is nearest to each place, if it is near; fill in the others."""
        self.kept[inner] = False
        for where, near in zip(place.tolist(), reach.tolist(), strict=True):
            apart = np.abs(self.time_s[inner] - where)
            best = int(np.argmin(apart)) if len(apart) else -1
            if best >= 0 and apart[best] <= near and not self.kept[inner[best]]:
                self.kept[inner[best]] = True
            else:
                self.filled.append(where)


def repair_uneven(time_s: FloatArray, per_turn: int) -> Repaired:
    """Fill in missing pulses and leave out extra ones of an uneven sequence.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Times of the pulses [s], ascending.
    per_turn : int
        Pulses a turn, at least 2.

    Returns
    -------
    Repaired

    Notes
    -----
    The spacing is first learned from the few consecutive turns whose intervals repeat best; each
    next pulse is then expected where the duration of the last turn puts it. One that comes within
    0.35 of the smaller interval beside its place is taken for it.
    """
    if len(time_s) < 3 * per_turn + 1:
        return Repaired(time_s=time_s)
    start, gaps = _repeating(time_s, per_turn)
    ahead, missing, extra = _walk(time_s[start:], gaps, per_turn)
    # the same backwards, for what lies before
    mirrored = -time_s[: start + per_turn + 1][::-1]
    behind, more_missing, more_extra = _walk(mirrored, gaps[::-1], per_turn)
    before = -behind[::-1]
    before = before[before < time_s[start] - 1e-12]
    repaired, changed = np.concatenate([before, ahead]), missing + more_missing + extra + more_extra
    wrong = misplaced(repaired, per_turn) if changed else None
    return Repaired(
        time_s=repaired,
        missing=missing + more_missing,
        extra=extra + more_extra,
        unclear_s=None if wrong is None else float(repaired[wrong]),
    )


def _repeating(time_s: FloatArray, per_turn: int) -> tuple[int, FloatArray]:
    """Where intervals repeat best from turn to turn, and the shares of a turn that they take."""
    turns = int(min(_FIRST_TURNS, (len(time_s) - 1) // per_turn))
    interval = np.diff(time_s)
    change = np.abs(np.log(interval[per_turn:] / interval[:-per_turn]))
    width = (turns - 1) * per_turn
    total = np.convolve(change, np.ones(width), "valid")
    start = int(np.argmin(total))
    chosen = interval[start : start + turns * per_turn].reshape(turns, per_turn)
    shares = np.median(chosen / chosen.sum(axis=1, keepdims=True), axis=0)
    return start, shares / shares.sum()


def _walk(time_s: FloatArray, gaps: FloatArray, per_turn: int) -> tuple[FloatArray, int, int]:
    """Follow a sequence whose first turn is sound; pulse 0 is followed by the first gap."""
    found = [float(t) for t in time_s[: per_turn + 1]]
    missing = extra = 0
    index = per_turn + 1
    limit = max(10, int(LIMITS.hopeless_uneven * len(time_s)))
    following = np.append(np.diff(time_s), np.inf)
    while index < len(time_s) and missing + extra <= limit:
        step = (len(found) - 1) % per_turn
        turn = found[-1] - found[-1 - per_turn]
        reach = LIMITS.early_or_late * turn * min(gaps[step], gaps[(step + 1) % per_turn])
        late = time_s[index] - (found[-1] + gaps[step] * turn)
        if late > reach:
            found.append(found[-1] + gaps[step] * turn)
            missing += 1
        elif late < -reach or abs(late + following[index]) < abs(late):  # the next is nearer
            extra += 1
            index += 1
        else:
            found.append(float(time_s[index]))
            index += 1
    return np.array(found), missing, extra


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
    if per_turn < 2:
        return True
    if len(time_s) < 3 * per_turn + 1:
        # too few turns to see intervals repeat
        ratio = np.diff(np.log(np.diff(time_s)))
        return bool(np.median(np.abs(ratio)) < 2 * LIMITS.even)
    _, shares = _repeating(time_s, per_turn)
    return bool(np.max(np.abs(shares * per_turn - 1)) < LIMITS.even)


def misplaced(time_s: FloatArray, per_turn: int) -> int | None:
    """Return the first pulse that is not where its neighbours and the spacing put it, if any.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Times of the pulses [s], ascending, as repaired.
    per_turn : int
        Pulses a turn.

    Notes
    -----
    The cubic through the two pulses before and the two after, at their learned angles, must come
    within a tenth of the smaller interval beside a pulse, or within eight robust standard
    deviations of what it usually misses by.
    """
    if len(time_s) < 3 * per_turn + 1:
        return None
    number = np.arange(len(time_s))
    angle = number // per_turn + learn_spacing(time_s, per_turn)[number % per_turn]
    four = [slice(0, -4), slice(1, -3), slice(3, -1), slice(4, None)]
    cubic = _cubic_at(angle[2:-2], [angle[k] for k in four], [time_s[k] for k in four])
    interval = np.diff(time_s)
    off = np.abs(time_s[2:-2] - cubic) / np.minimum(interval[1:-2], interval[2:-1])
    usual = float(np.median(off)) / 0.6745
    wrong = np.flatnonzero(off > max(LIMITS.misplaced, LIMITS.deviations * usual))
    return int(wrong[0]) + 2 if len(wrong) else None


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
    if per_turn == 1:
        return np.zeros(1)
    turns = len(time_s) // per_turn
    table = time_s[: turns * per_turn].reshape(turns, per_turn)
    first = table[:, 0]
    if turns < 4:
        length = np.diff(first)[:, None]
        return np.asarray(np.median((table[:-1] - first[:-1, None]) / length, axis=0))
    # the angles -1, 0, 1, 2 of the same pulse
    four = [part[:, None] for part in (first[:-3], first[1:-2], first[2:-1], first[3:])]
    angle = _cubic_at(table[1:-2], four, [np.float64(k) for k in (-1, 0, 1, 2)])
    return np.asarray(np.median(angle, axis=0))


def _cubic_at(
    x: FloatArray, nodes: Sequence[FloatArray], values: Sequence[FloatArray | np.float64]
) -> FloatArray:
    """Return Lagrange's cubic through the values at four nodes."""
    cubic = np.zeros(x.shape)
    for own, value in zip(nodes, values, strict=True):
        weight = np.ones(x.shape)
        for other in nodes:
            if other is not own:
                weight *= (x - other) / (own - other)
        cubic += weight * value
    return cubic
