"""Several pulses a turn that are not evenly spaced: their spacing is learned, pulses are repaired.

Painted stripes, bolt heads and zebra tapes with a joint give pulses whose intervals repeat from
turn to turn. What repeats tells a missing or an extra pulse from an uneven one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Turns from which the spacing is first learned.
_FIRST_TURNS = 6
# How far from its place a pulse may come, as a share of the smaller interval beside it.
_EARLY_OR_LATE = 0.35
# How far the shares of a turn may differ for pulses to be called even.
_EVEN = 0.05
# How far off the cubic through its neighbours a pulse may be: smaller intervals beside it, and
# robust deviations.
_MISPLACED, _DEVIATIONS = 0.1, 8.0
# Repairs beyond which the sequence is left to the caller's refusal.
_HOPELESS = 0.1


def repair_uneven(time_s: FloatArray, per_turn: int) -> tuple[FloatArray, int, int]:
    """Fill in missing pulses and leave out extra ones of an uneven sequence.

    Parameters
    ----------
    time_s : ndarray of float, shape (pulses,)
        Times of the pulses [s], ascending.
    per_turn : int
        Pulses a turn, at least 2.

    Returns
    -------
    time_s : ndarray of float
        The repaired sequence.
    missing, extra : int
        Pulses filled in and left out.

    Notes
    -----
    The spacing is first learned from the few consecutive turns whose intervals repeat best; each
    next pulse is then expected where the duration of the last turn puts it. One that comes within
    0.35 of the smaller interval beside its place is taken for it.
    """
    if len(time_s) < 3 * per_turn + 1:
        return time_s, 0, 0
    start, gaps = _repeating(time_s, per_turn)
    ahead, missing, extra = _walk(time_s[start:], gaps, per_turn)
    # the same backwards, for what lies before
    mirrored = -time_s[: start + per_turn + 1][::-1]
    behind, more_missing, more_extra = _walk(mirrored, gaps[::-1], per_turn)
    before = -behind[::-1]
    before = before[before < time_s[start] - 1e-12]
    return np.concatenate([before, ahead]), missing + more_missing, extra + more_extra


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
    limit = max(10, int(_HOPELESS * len(time_s)))
    while index < len(time_s) and missing + extra <= limit:
        step = (len(found) - 1) % per_turn
        turn = found[-1] - found[-1 - per_turn]
        reach = _EARLY_OR_LATE * turn * min(gaps[step], gaps[(step + 1) % per_turn])
        late = time_s[index] - (found[-1] + gaps[step] * turn)
        if late > reach:
            found.append(found[-1] + gaps[step] * turn)
            missing += 1
        elif late < -reach or _next_is_nearer(time_s, index, late):
            extra += 1
            index += 1
        else:
            found.append(float(time_s[index]))
            index += 1
    return np.array(found), missing, extra


def _next_is_nearer(time_s: FloatArray, index: int, late: float) -> bool:
    """Whether the pulse after one that comes so late [s] is nearer to the place of both."""
    if index + 1 >= len(time_s):
        return False
    return abs(late + float(time_s[index + 1] - time_s[index])) < abs(late)


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
        return bool(np.median(np.abs(ratio)) < 2 * _EVEN)
    _, shares = _repeating(time_s, per_turn)
    return bool(np.max(np.abs(shares * per_turn - 1)) < _EVEN)


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
    nodes = [slice(0, -4), slice(1, -3), slice(3, -1), slice(4, None)]
    here = angle[2:-2]
    cubic = np.zeros(len(here))
    for own in nodes:
        weight = np.ones(len(here))
        for other in nodes:
            if other != own:
                weight *= (here - angle[other]) / (angle[own] - angle[other])
        cubic += weight * time_s[own]
    interval = np.diff(time_s)
    off = np.abs(time_s[2:-2] - cubic) / np.minimum(interval[1:-2], interval[2:-1])
    usual = float(np.median(off)) / 0.6745
    wrong = np.flatnonzero(off > max(_MISPLACED, _DEVIATIONS * usual))
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
        shares: FloatArray = np.median((table[:-1] - first[:-1, None]) / length, axis=0)
        return shares
    before, start, end, after = first[:-3], first[1:-2], first[2:-1], first[3:]
    at = table[1:-2]
    # Lagrange's cubic through the angles -1, 0, 1, 2 of the same pulse
    nodes = np.stack([before, start, end, after])
    angle = np.zeros_like(at)
    for i, value in enumerate((-1.0, 0.0, 1.0, 2.0)):
        term = np.full_like(at, value)
        for j in range(4):
            if j != i:
                term *= (at - nodes[j][:, None]) / (nodes[i] - nodes[j])[:, None]
        angle += term
    return np.asarray(np.median(angle, axis=0))
