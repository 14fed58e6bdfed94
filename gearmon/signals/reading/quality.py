"""Channels that cannot be vibration: dead, pulsed, clipped, or without values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearmon.signals.reading.fields import Floats

# Samples at exactly the extreme value, over those at the commonest value next to it. For a rounded
# sine this ratio is at most 1 + sqrt(2), for rounded noise it is below 1.
_PILED_UP = 5.0
_FEWEST_SAMPLES = 10
_HARMLESS_SHARE = 1e-3
_NEIGHBOURHOOD = 0.05  # of the range
_SAMPLES_TO_COMPARE = 2**17  # from the first at the extreme on
_CHUNK = 2**16


@dataclass(frozen=True, kw_only=True)
class Defect:
    """What is wrong with a channel.

    Parameters
    ----------
    text : str
        What, as the rest of a sentence that begins with the channel.
    row : int
        Index of the first sample concerned; -1 if it is all of them.
    fatal : bool
        Whether the channel is useless.
    """

    text: str
    row: int
    fatal: bool = True


@dataclass(frozen=True, kw_only=True)
class Survey:
    """What one pass over a channel tells.

    Parameters
    ----------
    finite : bool
        Whether all samples are finite; if not, the rest means nothing.
    low, high : float
        Extremes.
    at_low, at_high : int
        Samples that equal them.
    first_low, first_high : int
        Index of the first sample that does.
    """

    finite: bool
    low: float = 0.0
    high: float = 0.0
    at_low: int = 0
    at_high: int = 0
    first_low: int = 0
    first_high: int = 0


def survey(values: Floats) -> Survey:
    """Return the extremes of a channel and how often they occur, in one pass through memory.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
    """
    low, high, at_low, at_high = np.inf, -np.inf, 0, 0
    first_low = first_high = 0
    for start in range(0, len(values), _CHUNK):
        part = values[start : start + _CHUNK]
        least, most = part.min(), part.max()
        if not (np.isfinite(least) and np.isfinite(most)):
            return Survey(finite=False)
        if least <= low:
            count = int(np.count_nonzero(part == least))
            if least < low:
                low, at_low, first_low = least, 0, start
            at_low += count
        if most >= high:
            count = int(np.count_nonzero(part == most))
            if most > high:
                high, at_high, first_high = most, 0, start
            at_high += count
    if not len(values):
        return Survey(finite=True, low=float(low), high=float(high))
    return Survey(
        finite=True,
        low=float(low),
        high=float(high),
        at_low=at_low,
        at_high=at_high,
        first_low=first_low + int(values[first_low : first_low + _CHUNK].argmin()),
        first_high=first_high + int(values[first_high : first_high + _CHUNK].argmax()),
    )


def missing_values(values: Floats, found: Survey | None = None) -> tuple[int, int]:
    """Return how many values are not finite, and the index of the first of them (-1: none).

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
    found : Survey, optional
        What is known of them.
    """
    if (found or survey(values)).finite:
        return 0, -1
    count, first = 0, -1
    for start in range(0, len(values), _CHUNK):
        bad = np.flatnonzero(~np.isfinite(values[start : start + _CHUNK]))
        first = start + int(bad[0]) if count == 0 and bad.size else first
        count += bad.size
    return count, first


def find_defect(values: Floats, found: Survey | None = None) -> Defect | None:
    """Return why a channel cannot be vibration, or None.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        Finite samples of one channel.
    found : Survey, optional
        What is known of them.

    Notes
    -----
    A channel is called clipped if its largest or smallest value occurs at least five times as
    often as any value within 5 % of the range next to it (and as the very next one). Clipping
    piles up samples at the limit; rounding alone does not: the top level of a rounded sine holds at
    most 1 + sqrt(2) times as many samples as the next, that of rounded noise fewer. It is fatal
    from one sample in a thousand on.
    """
    found = found or survey(values)
    low, high, at_low, at_high = found.low, found.high, found.at_low, found.at_high
    if low == high:
        return Defect(text=f"is constant ({low:g} in all {len(values)} samples)", row=-1)
    if len(values) < _FEWEST_SAMPLES:
        return None
    if at_low + at_high == len(values):
        text = f"has only two values, {low:g} and {high:g}: is it a tacho or a switch?"
        return Defect(text=text, row=-1)
    extremes = ((at_high, high, found.first_high), (at_low, low, found.first_low))
    for count, extreme, first in extremes:
        if count < _FEWEST_SAMPLES:
            continue
        if _is_piled_up(values[first:], high - low):
            share = count / len(values)
            text = f"is clipped: {count} samples ({100 * share:.2g} %) are exactly {extreme:g}"
            return Defect(text=text, row=first, fatal=share >= _HARMLESS_SHARE)
    return None


def _is_piled_up(values: Floats, range_: float) -> bool:
    """Tell whether far more samples equal the first one, an extreme, than any value next to it."""
    distance = np.abs(values[:_SAMPLES_TO_COMPARE] - values[0])
    beside = distance[distance > 0]
    if beside.size == 0:
        return False
    near = beside[beside <= max(float(beside.min()), _NEIGHBOURHOOD * range_)]
    _, counts = np.unique(near, return_counts=True)
    return bool(distance.size - beside.size >= _PILED_UP * counts.max())
